//! The pictures of the threads of a program.

use std::path::{Path, PathBuf};

use feedwave_cutting::{PipelineConfig, ValidationReport};
use feedwave_plot::{PlotError, ThreadPictures, write_thread};

/// Threads drawn at most: three pictures each.
const MAX_THREADS_DRAWN: usize = 8;

pub(super) fn draw(_: &PipelineConfig, report: &ValidationReport, directory: &Path) -> Result<Vec<PathBuf>, PlotError> {
    let mut files = Vec::new();
    for section in report.threads.iter().take(MAX_THREADS_DRAWN) {
        let name = format!("thread-line-{}", section.first_line);
        let thread = ThreadPictures { name, job: &section.job, report: &section.report };
        files.extend(write_thread(&thread, directory)?);
    }
    Ok(files)
}
