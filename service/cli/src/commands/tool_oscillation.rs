//! What the command line asks of the oscillations of a program.

use feedwave_cutting::tool_oscillation::{NamedCondition, OscillationRequest};

use super::CliError;

/// Options about tool oscillation.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct OscillationArgs {
    /// Tool oscillation condition of the machine that the whole program runs with, whatever its P words choose [default:
    /// what the program says]
    #[arg(long, value_name = "NAME")]
    oscillation_condition: Option<String>,
    /// Parts finished before this one, where the edges of an oscillating tool change roles over parts
    #[arg(long, value_name = "COUNT", default_value_t = 0, hide_default_value = true)]
    parts_before: u64,
    /// Oscillating cutting time before this part, s, where they change roles over time
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, hide_default_value = true)]
    cutting_time_before: f64,
}

impl OscillationArgs {
    /// What is asked, unchecked.
    pub(super) fn request(&self) -> OscillationRequest {
        OscillationRequest {
            condition: self.oscillation_condition.clone(),
            parts_before: self.parts_before,
            cutting_time_before_s: self.cutting_time_before,
        }
    }

    /// What is asked of a machine with these conditions.
    pub(super) fn checked(&self, conditions: &[NamedCondition]) -> Result<OscillationRequest, CliError> {
        let request = self.request();
        let option = |field: &str| match field {
            "condition" => "--oscillation-condition",
            "parts_before" => "--parts-before",
            _ => "--cutting-time-before",
        };
        let problems = request.problems(conditions);
        if problems.is_empty() {
            return Ok(request);
        }
        let lines = problems.iter().map(|problem| format!("{}: {}", option(&problem.field), problem.message));
        Err(CliError::trouble(lines.collect::<Vec<_>>().join("\n")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_is_refused_with_its_option() {
        let args = OscillationArgs {
            oscillation_condition: Some("fast".to_owned()),
            parts_before: 3,
            cutting_time_before: -1.0,
        };
        let message = args.checked(&[]).unwrap_err().message;
        assert_eq!(
            message.lines().collect::<Vec<_>>(),
            [
                "--oscillation-condition: \"fast\" is no condition of this machine: it has none",
                "--cutting-time-before: must be 0 to 1000000000000 s, is -1",
            ]
        );
        let default = OscillationArgs::default().checked(&[]).unwrap();
        assert_eq!(default, OscillationRequest::default());
    }
}
