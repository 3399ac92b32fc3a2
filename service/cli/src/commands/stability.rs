//! The lobes of a tool and the depth that is cut, as `improve` and `robustness` are told them.

use std::path::{Path, PathBuf};

use feedwave_contract::convert::stability_chart;
use feedwave_contract::json;
use feedwave_contract::proto::StabilityLobes;

use super::CliError;

/// Longest file of lobes, bytes.
const MAX_LOBES_BYTES: u64 = 64 << 20;

/// Arguments about stability.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct StabilityArgs {
    /// Lobes of the tool, what `feedwave lobes --format json` writes [default: stability is not judged]
    #[arg(long, value_name = "FILE", requires = "depth")]
    lobes: Option<PathBuf>,
    /// Depth of cut, in turning its width, mm
    #[arg(long, value_name = "MM", requires = "lobes", value_parser = depth)]
    pub(super) depth: Option<f64>,
    /// By how many per cent the depth may be smaller or larger
    #[arg(long, value_name = "PERCENT", default_value = "10", value_parser = percent)]
    pub(super) depth_tolerance: f64,
}

/// A share as per cent, at most half.
pub(super) fn percent(text: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|value| (0.0..=50.0).contains(value));
    value.map(|percent| 0.01 * percent).ok_or_else(|| "must be a number from 0 to 50".to_owned())
}

fn depth(text: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite() && *value > 0.0);
    value.ok_or_else(|| "must be a positive number of millimetres".to_owned())
}

impl StabilityArgs {
    /// The file of lobes, with what it is called.
    pub(super) fn file(&self) -> Option<(&'static str, &Path)> {
        self.lobes.as_deref().map(|path| ("the file of --lobes", path))
    }

    /// The lobes with their chart by rising speed; `None` where none are stated.
    ///
    /// # Errors
    /// [`CliError`] when the file cannot be read, or has no lobes.
    pub(super) fn read(&self) -> Result<Option<StabilityLobes>, CliError> {
        let Some(path) = &self.lobes else { return Ok(None) };
        let failed = |error: std::io::Error| CliError::file(path, &error);
        if std::fs::metadata(path).map_err(failed)?.len() > MAX_LOBES_BYTES {
            return Err(CliError::trouble(format!("{}: has more than {MAX_LOBES_BYTES} bytes", path.display())));
        }
        let text = std::fs::read_to_string(path).map_err(failed)?;
        let mut lobes: StabilityLobes =
            json::from_str(&text).map_err(|error| CliError::trouble(format!("{}: {error}", path.display())))?;
        let is_number = |(speed, limit): (f64, Option<f64>)| speed.is_finite() && limit.is_none_or(f64::is_finite);
        if lobes.chart.is_empty() || !stability_chart(&lobes).all(is_number) {
            return Err(CliError::trouble(format!("{}: has no chart of lobes", path.display())));
        }
        lobes.chart.sort_by(|a, b| a.spindle_rev_per_min.total_cmp(&b.spindle_rev_per_min));
        Ok(Some(lobes))
    }
}
