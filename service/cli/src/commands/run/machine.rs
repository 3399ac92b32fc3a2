//! Which machine is simulated, and how it is judged where the job does not say.

use std::path::PathBuf;

use feedwave_contract::convert::monitoring_to_proto;
use feedwave_contract::proto;
use feedwave_monitoring::Violation;
use feedwave_simulator::{Contact, Description, Where};

use crate::commands::CliError;
use crate::commands::terminal::tell;

/// Options that say what is simulated.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct MachineArgs {
    /// The machine, tool, work, sensors and faults as JSON, with the names and units of the contract [default: a four-edged mill of 10 mm in steel, half immersed, two
    /// distance sensors at 20 kHz]
    #[arg(long, value_name = "FILE", requires = "simulate")]
    description: Option<PathBuf>,
    /// Seed of noise and outliers, in place of the description's
    #[arg(long, value_name = "N", requires = "simulate")]
    seed: Option<u64>,
    /// Lines in which the tool cuts, and the depth of cut in mm; may be repeated, and goes before the description's contacts
    /// [default: nothing is cut]
    #[arg(long, value_name = "FIRST-LAST:DEPTH", requires = "simulate", value_parser = cut)]
    cut: Vec<Cut>,
    /// Spindle speed at which the machine idles for the baseline
    #[arg(long, value_name = "REV/MIN", default_value_t = 1000.0, requires = "simulate", value_parser = speed)]
    pub(super) idle_rev_per_min: f64,
}

/// Lines in which the tool cuts, and how deep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cut {
    first: u32,
    last: u32,
    depth_mm: f64,
}

fn cut(text: &str) -> Result<Cut, String> {
    let wrong = || "must be lines and a depth in mm, such as 3:1.5 or 3-7:0.5".to_owned();
    let (lines, depth) = text.split_once(':').ok_or_else(wrong)?;
    let (first, last) = lines.split_once('-').unwrap_or((lines, lines));
    let number = |text: &str| text.parse::<u32>().map_err(|_| wrong());
    let cut = Cut { first: number(first)?, last: number(last)?, depth_mm: depth.parse().map_err(|_| wrong())? };
    if cut.first == 0 || cut.last < cut.first {
        return Err("lines count from 1, the last is not before the first".to_owned());
    }
    Ok(cut)
}

fn speed(text: &str) -> Result<f64, String> {
    let speed: f64 = text.parse().map_err(|_| "must be a speed in rev/min".to_owned())?;
    if speed > 0.0 && speed <= 1e6 {
        Ok(speed)
    } else {
        Err(format!("must be above 0 and at most 1000000, is {speed}"))
    }
}

impl MachineArgs {
    /// What is simulated.
    pub(super) fn description(&self) -> Result<Description, CliError> {
        let mut description = match &self.description {
            None => Description::default(),
            Some(path) => {
                let text = std::fs::read_to_string(path).map_err(|error| CliError::file(path, &error))?;
                let wrong = |error| CliError::trouble(format!("{}: {error}", path.display()));
                serde_json::from_str(&text).map_err(wrong)?
            }
        };
        description.seed = self.seed.unwrap_or(description.seed);
        let cuts = self
            .cut
            .iter()
            .map(|cut| Contact { at: Where::Lines { first: cut.first, last: cut.last }, depth_mm: cut.depth_mm });
        description.contacts.splice(0..0, cuts);
        let violations = description.violations();
        if !violations.is_empty() {
            return Err(refused(&violations));
        }
        if description.contacts.is_empty() {
            tell(
                "a dry run: the simulated tool cuts nothing, so that nothing bends it; to cut, say in which lines and how \
                 deep, such as --cut 3-7:0.5, or give contacts in the --description\n",
            );
        }
        Ok(description)
    }
}

/// A description that cannot be simulated.
pub(super) fn refused(violations: &[Violation]) -> CliError {
    let list: Vec<_> = violations.iter().map(|violation| format!("\n  {violation}")).collect();
    CliError::trouble(format!("the machine cannot be simulated:{}", list.concat()))
}

/// How a simulated machine is judged where the job does not say.
pub(in crate::commands) fn default_monitoring(description: &Description) -> Result<proto::MonitoringConfig, CliError> {
    let config = description.monitoring().ok_or_else(|| {
        CliError::trouble(
            "the job has no monitoring, and limits for strain or acceleration sensors cannot be guessed: set it first",
        )
    })?;
    Ok(monitoring_to_proto(&config))
}
