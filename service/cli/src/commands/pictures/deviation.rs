//! The path as programmed and as run, of programs whose path deviates.

use feedwave_cutting::{PipelineConfig, ToolMotion, ToolPathSink, ValidationReport};
use feedwave_plot::{CloseView, PathDeviations, Point};

use super::super::CliError;
use super::super::source::Source;
use super::read_path;

/// Half of this of a close view is shown where the path is exact, mm.
const EXACT_MM: f64 = 0.05;

/// The paths of a program; nothing where it is run as programmed, or under tool centre point control.
pub(super) fn trace(
    source: &mut Source,
    config: &PipelineConfig,
    report: &ValidationReport,
) -> Result<Option<PathDeviations>, CliError> {
    let slow = report.summary.slowdowns.iter().filter(|slowdown| slowdown.source.program == 0);
    let slow = slow.map(|slowdown| Slow { line: slowdown.source.line, place: None }).collect();
    let mut worst = Worst { farthest: None, slow };
    read_path(source, config, &mut worst)?;
    let Some((line, largest_mm, center)) = worst.farthest else { return Ok(None) };
    let views = views(line, largest_mm, center, &worst.slow);
    let mut both = Both { deviations: PathDeviations::new(largest_mm, views) };
    read_path(source, config, &mut both)?;
    Ok(Some(both.deviations))
}

/// A close view of where the paths are farthest apart, and one of where most time is lost: at another place, since two views of
/// one corner show nothing more.
fn views(line: u32, largest_mm: f64, center: Point, slow: &[Slow]) -> Vec<CloseView> {
    let mut farthest = CloseView { title: format!("farthest apart, line {line}"), center, deviation_mm: largest_mm };
    let mut elsewhere = "";
    for (slow, (deviation_mm, center)) in slow.iter().filter_map(|slow| slow.place.map(|place| (slow, place))) {
        let own = CloseView { title: format!("most time lost{elsewhere}, line {}", slow.line), center, deviation_mm };
        if !farthest.shows(center) && !own.shows(farthest.center) {
            return vec![farthest, own];
        }
        if elsewhere.is_empty() {
            farthest.title = match slow.line == line {
                true => format!("farthest apart, and most time lost, line {line}"),
                false => format!("farthest apart, line {line}, and most time lost, line {}", slow.line),
            };
            elsewhere = " elsewhere";
        }
    }
    vec![farthest]
}

/// A line that time is lost in.
struct Slow {
    line: u32,
    /// Distance of both paths, and the place.
    place: Option<(f64, Point)>,
}

/// Finds the worst places.
struct Worst {
    /// Line, distance and place.
    farthest: Option<(u32, f64, Point)>,
    /// Where most time is lost, and so on.
    slow: Vec<Slow>,
}

impl ToolPathSink for Worst {
    fn line(&mut self, _: ToolMotion, _: Point, _: Point) {}

    fn rapid(&mut self, _: u32) {}

    fn cut(&mut self, _: u32, _: f64) {}

    fn programmed(&mut self, line: u32, from: Point, _: Point) {
        // The corner is where the block starts.
        for slow in self.slow.iter_mut().filter(|slow| slow.line == line) {
            slow.place.get_or_insert((EXACT_MM, from));
        }
    }

    fn deviates(&mut self, line: u32, largest_mm: f64, here: Point) {
        if largest_mm > self.farthest.map_or(0.0, |(_, known, _)| known) {
            self.farthest = Some((line, largest_mm, here));
        }
        for slow in self.slow.iter_mut().filter(|slow| slow.line == line) {
            let known = slow.place.filter(|(known, _)| *known != EXACT_MM).map_or(0.0, |(known, _)| known);
            if largest_mm > known {
                slow.place = Some((largest_mm, here));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn close_views_are_of_different_places() {
        let slow = |line, place: Point| Slow { line, place: Some((EXACT_MM, place)) };
        let titles = |slow: &[Slow]| -> Vec<String> {
            views(7, 0.05, [10.0, 0.0, 0.0], slow).into_iter().map(|view| view.title).collect()
        };
        assert_eq!(titles(&[]), ["farthest apart, line 7"]);
        assert_eq!(titles(&[slow(9, [90.0, 0.0, 0.0])]), ["farthest apart, line 7", "most time lost, line 9"]);
        // The same corner, by its own line or that of the block behind it.
        assert_eq!(titles(&[slow(7, [10.0, 0.0, 0.0])]), ["farthest apart, and most time lost, line 7"]);
        assert_eq!(
            titles(&[slow(8, [10.1, 0.0, 0.0]), slow(7, [10.0, 0.0, 0.0]), slow(20, [0.0, 30.0, 0.0])]),
            ["farthest apart, line 7, and most time lost, line 8", "most time lost elsewhere, line 20"]
        );
    }
}
