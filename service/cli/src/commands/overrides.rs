//! Changes of the feed override on the command line.

use std::sync::Arc;

use feedwave_contract::convert::{check_holds, overrides_from_proto};
use feedwave_contract::proto::FeedOverrideChange;
use feedwave_contract::proto::feed_override_change::At;
use feedwave_contract::violations::Violations;
use feedwave_cutting::{MAX_OVERRIDE_RATIO, MIN_OVERRIDE_RATIO, PipelineConfig, is_override_ratio};

use super::CliError;
use super::plan::time;

/// Lowest and highest feed override, %.
const MIN_PERCENT: f64 = 100.0 * MIN_OVERRIDE_RATIO;
const MAX_PERCENT: f64 = 100.0 * MAX_OVERRIDE_RATIO;

/// Options that change the feed override.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct OverrideArgs {
    /// Change the feed override at a time to a percentage of the programmed feed; repeat it for every change
    ///
    /// `2.5:40` runs at 40 % from 2.5 s on. 0 % is feed hold: the path comes to rest as soon as it can, and goes on with
    /// the next change, within a day, so that the last one must be above 0. Otherwise 1 to 200 %; changes are given in the
    /// order of time, and before the first one the feed is as programmed. The path stays the same and every axis within its limits; rapid
    /// moves are held but not slowed down, dwells and the spindle go on as they are.
    #[arg(long = "override", value_name = "SECONDS:PERCENT", value_parser = change)]
    changes: Vec<Change>,
}

/// One change, with what was typed.
#[derive(Clone, Debug)]
struct Change {
    text: String,
    change: FeedOverrideChange,
}

impl OverrideArgs {
    /// The changes as a request has them.
    pub(super) fn into_request(self) -> Vec<FeedOverrideChange> {
        self.changes.into_iter().map(|change| change.change).collect()
    }

    /// The configuration with the changes.
    pub(super) fn apply(&self, mut config: Arc<PipelineConfig>) -> Result<Arc<PipelineConfig>, CliError> {
        let mut violations = Violations::default();
        let period_us = config.interpolation_period_us;
        let changes = self.clone().into_request();
        let overrides = overrides_from_proto(&mut violations, "--override", &changes, period_us);
        if violations.is_empty() {
            check_holds(&mut violations, "--override", &overrides, period_us);
        }
        if violations.is_empty() {
            Arc::make_mut(&mut config).overrides = overrides;
            return Ok(config);
        }
        let lines = violations.as_slice().iter().map(|violation| {
            // Fields are counted from 0; people see what they have typed.
            let number = violation.field.split(['[', ']']).nth(1).and_then(|number| number.parse::<usize>().ok());
            match number.and_then(|number| self.changes.get(number)) {
                Some(change) => format!("--override {}: {}", change.text, violation.description),
                None => format!("--override: {}", violation.description),
            }
        });
        let more = match violations.not_listed() {
            0 => None,
            count => Some(format!("--override: and {count} more")),
        };
        Err(CliError::trouble(lines.chain(more).collect::<Vec<_>>().join("\n")))
    }
}

/// One change on the command line.
fn change(text: &str) -> Result<Change, String> {
    let (seconds, percent) = text
        .split_once(':')
        .ok_or("must be a time and a percentage with a colon between them, such as 2.5:40 for 40 % from 2.5 s on")?;
    let time_s = time(seconds).map_err(|reason| format!("the time {seconds:?} {reason}"))?;
    match percent.trim_end_matches('%').parse::<f64>() {
        Ok(value) if is_override_ratio(value / 100.0) => {
            let change = FeedOverrideChange { at: Some(At::TimeS(time_s)), ratio: Some(value / 100.0) };
            Ok(Change { text: text.to_owned(), change })
        }
        _ => Err(format!(
            "the percentage {percent:?} must be 0 (feed hold), or a number from {MIN_PERCENT} to {MAX_PERCENT}"
        )),
    }
}

#[cfg(test)]
mod tests {
    use feedwave_cutting::MachineProfile;

    use super::*;

    fn apply(changes: &[&str]) -> Result<Vec<(u64, f64)>, String> {
        let changes = changes.iter().map(|text| change(text)).collect::<Result<_, _>>()?;
        let config = Arc::new(PipelineConfig::new(MachineProfile::lathe()));
        let config = OverrideArgs { changes }.apply(config).map_err(|error| error.message)?;
        Ok(config.overrides.iter().map(|change| (change.index, change.ratio)).collect())
    }

    #[test]
    fn changes_are_times_and_percentages() {
        assert_eq!(apply(&["2:50", "3.5:0%", "5:100"]), Ok(vec![(2_000, 0.5), (3_500, 0.0), (5_000, 1.0)]));
        assert_eq!(apply(&[]), Ok(Vec::new()));
    }

    #[test]
    fn what_is_wrong_is_said_with_what_was_typed() {
        for (wrong, reason) in [
            ("2", "with a colon"),
            ("x:50", "the time \"x\" must be a number of seconds"),
            ("-1:50", "the time \"-1\" must be"),
            ("1:201", "the percentage \"201\" must be 0 (feed hold), or a number from 1 to 200"),
            ("0:1e-9", "the percentage \"1e-9\" must be 0 (feed hold), or a number from 1 to 200"),
            ("0:0.99", "the percentage \"0.99\" must be"),
            ("0:-1", "the percentage \"-1\" must be"),
            ("1:", "the percentage \"\" must be"),
            ("1:nan", "the percentage \"nan\" must be"),
        ] {
            let error = apply(&[wrong]).unwrap_err();
            assert!(error.contains(reason), "{wrong}: {error}");
        }
        let error = apply(&["2:50", "1:80", "3:0"]).unwrap_err();
        let lines: Vec<_> = error.lines().collect();
        assert_eq!(lines.len(), 2, "{error}");
        assert!(lines[0].starts_with("--override 1:80: must not lie before"), "{error}");
        assert!(lines[1].starts_with("--override 3:0: must be above 0"), "{error}");
        let error = apply(&["2:0", "90000:80"]).unwrap_err();
        assert!(error.starts_with("--override 90000:80: must lie within 86400 s"), "{error}");
    }
}
