//! The pictures of the oscillating passes of a program.

use std::path::{Path, PathBuf};

use feedwave_cutting::{PipelineConfig, ValidationReport};
use feedwave_plot::{OscillationPictures, PlotError, write_oscillation};

/// Oscillating passes drawn at most: six pictures each.
const MAX_OSCILLATIONS_DRAWN: usize = 4;

pub(super) fn draw(
    config: &PipelineConfig,
    report: &ValidationReport,
    directory: &Path,
) -> Result<Vec<PathBuf>, PlotError> {
    let mut files = Vec::new();
    for section in report.oscillations.iter().take(MAX_OSCILLATIONS_DRAWN) {
        let Some((tool, oscillation)) = section.motion(config) else { continue };
        let name = format!("oscillation-line-{}", section.line);
        let pass = OscillationPictures { name, tool, oscillation: &oscillation, section };
        files.extend(write_oscillation(&pass, directory)?);
    }
    Ok(files)
}
