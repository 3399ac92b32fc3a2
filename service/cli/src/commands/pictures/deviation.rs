//! The path as programmed and as run, of programs whose path deviates.

use feedwave_cutting::{PipelineConfig, Slowdown, ToolMotion, ToolPathSink, ValidationReport};

use super::super::CliError;
use super::super::source::Source;
use super::read_path;
use crate::plot::{CloseView, PathDeviations, Point};

/// Half of this of a close view is shown where the path is exact, mm.
const EXACT_MM: f64 = 0.05;

/// The paths of a program; nothing where it is run as programmed, or under tool centre point control.
pub(super) fn trace(
    source: &mut Source,
    config: &PipelineConfig,
    report: &ValidationReport,
) -> Result<Option<PathDeviations>, CliError> {
    let mut worst = Worst { slowest: report.summary.slowdowns.first(), ..Worst::default() };
    read_path(source, config, &mut worst)?;
    let Some((line, largest_mm, center)) = worst.farthest else { return Ok(None) };
    let mut views = vec![CloseView { title: format!("farthest apart, line {line}"), center, deviation_mm: largest_mm }];
    if let (Some(slowest), Some((deviation_mm, center))) = (worst.slowest, worst.slow) {
        let title = format!("most time lost, line {}", slowest.source.line);
        views.push(CloseView { title, center, deviation_mm });
    }
    let mut both = Both { deviations: PathDeviations::new(largest_mm, views) };
    read_path(source, config, &mut both)?;
    Ok(Some(both.deviations))
}

/// Finds the worst places.
#[derive(Default)]
struct Worst<'a> {
    slowest: Option<&'a Slowdown>,
    /// Line, distance and place.
    farthest: Option<(u32, f64, Point)>,
    /// Distance and place where most time is lost.
    slow: Option<(f64, Point)>,
}

impl ToolPathSink for Worst<'_> {
    fn line(&mut self, _: ToolMotion, _: Point, _: Point) {}

    fn rapid(&mut self, _: u32) {}

    fn cut(&mut self, _: u32, _: f64) {}

    fn programmed(&mut self, line: u32, from: Point, _: Point) {
        // The corner is where the block starts.
        let is_slowest = self.slowest.is_some_and(|slowest| slowest.source.program == 0 && slowest.source.line == line);
        if is_slowest && self.slow.is_none() {
            self.slow = Some((EXACT_MM, from));
        }
    }

    fn deviates(&mut self, line: u32, largest_mm: f64, here: Point) {
        if largest_mm > self.farthest.map_or(0.0, |(_, known, _)| known) {
            self.farthest = Some((line, largest_mm, here));
        }
        let is_slowest = self.slowest.is_some_and(|slowest| slowest.source.program == 0 && slowest.source.line == line);
        if is_slowest && largest_mm > 0.0 {
            let known = self.slow.filter(|(known, _)| *known != EXACT_MM).map_or(0.0, |(known, _)| known);
            if largest_mm > known {
                self.slow = Some((largest_mm, here));
            }
        }
    }
}

/// Both paths.
struct Both {
    deviations: PathDeviations,
}

impl ToolPathSink for Both {
    fn line(&mut self, motion: ToolMotion, from: Point, to: Point) {
        if motion != ToolMotion::Rapid {
            self.deviations.run(from, to);
        }
    }

    fn rapid(&mut self, _: u32) {}

    fn cut(&mut self, _: u32, _: f64) {}

    fn programmed(&mut self, _: u32, from: Point, to: Point) {
        self.deviations.programmed(from, to);
    }

    fn deviates(&mut self, _: u32, largest_mm: f64, _: Point) {
        self.deviations.deviates(largest_mm);
    }
}
