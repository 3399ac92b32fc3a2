//! Which part of the floor is simulated for the report of a program.

use feedwave_motion::ProfileProblem;
use serde::{Deserialize, Serialize};

use super::{FloorArea, MAX_FLOOR_CELLS, OscillationCut, ToolGeometry};

/// Cells along the feed that the mark of one edge gets at least.
const CELLS_PER_MARK: f64 = 8.0;
/// Most runs over cells in one simulation, so that a tiny feed does not take for ever.
const MAX_RUNS: f64 = 4e6;
/// Most cells of a floor that is simulated for a report, whatever the profile permits: 16 MB.
const MAX_REPORTED_CELLS: u32 = 4_000_000;
/// Most cells that the edges lower in one simulation, each as often as it is lowered: a part of a second.
const MAX_UPDATES: f64 = 2.5e8;
/// Places at which a crossing of a row is computed, as an estimate.
const RUNS_PER_CROSSING: f64 = 4.0;

/// How the floor of a program's oscillations is simulated for the report.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FloorSettings {
    /// Whether it is; true unless stated.
    pub simulate: bool,
    /// Revolutions whose feed is simulated, 1 to [`MAX_FLOOR_REVOLUTIONS`]; 2 unless stated. All of them are alike.
    pub revolutions: u32,
    /// Largest size of a cell, mm, 0.001 to 1; 0.02 unless stated. Where the feed per edge is small the cells are smaller,
    /// so that every mark has at least eight.
    pub resolution_mm: f64,
    /// Most cells, 1 000 to [`MAX_FLOOR_CELLS`]; 400 000 unless stated. Where the floor has more, a strip about the middle
    /// of what the tool sweeps represents it.
    pub max_cells: u32,
    /// Whether the trailing half of the tool cuts as well; true unless stated. Not where the spindle is tilted.
    pub trailing: bool,
}

/// Most revolutions whose feed is simulated.
pub const MAX_FLOOR_REVOLUTIONS: u32 = 100;

impl Default for FloorSettings {
    fn default() -> Self {
        Self { simulate: true, revolutions: 2, resolution_mm: 0.02, max_cells: 400_000, trailing: true }
    }
}

impl FloorSettings {
    /// What makes the settings unusable, each with its field.
    #[must_use]
    pub fn problems(&self) -> Vec<ProfileProblem> {
        let mut problems = Vec::new();
        let mut require = |holds: bool, field: &str, message: String| {
            if !holds {
                problems.push(ProfileProblem { field: field.to_owned(), message });
            }
        };
        let Self { revolutions, resolution_mm, max_cells, .. } = *self;
        let is_possible = (1..=MAX_FLOOR_REVOLUTIONS).contains(&revolutions);
        require(is_possible, "revolutions", format!("must be 1 to {MAX_FLOOR_REVOLUTIONS}, is {revolutions}"));
        let is_possible = (0.001..=1.0).contains(&resolution_mm);
        require(is_possible, "resolution_mm", format!("must be 0.001 to 1 mm, is {resolution_mm}"));
        let is_possible = (1_000..=MAX_FLOOR_CELLS as u32).contains(&max_cells);
        require(is_possible, "max_cells", format!("must be 1000 to {MAX_FLOOR_CELLS}, is {max_cells}"));
        problems
    }

    /// The part of the floor that represents a cut; `None` where none is requested or not one row of cells could be
    /// simulated.
    #[must_use]
    pub fn area(&self, tool: &ToolGeometry, cut: &OscillationCut) -> Option<FloorArea> {
        if !self.simulate {
            return None;
        }
        let per_rev_mm = cut.feed_per_rev_mm();
        let edges = f64::from(tool.edge_count());
        let resolution_mm = self.resolution_mm.min(per_rev_mm / edges / CELLS_PER_MARK);
        let length_mm = f64::from(self.revolutions) * per_rev_mm;
        let columns = (length_mm / resolution_mm).round();
        // Every edge with both its halves, in all revolutions in which it comes across the strip.
        let revolutions = (length_mm + 2.0 * tool.radial_edge_length_mm) / per_rev_mm;
        let runs_per_row = 2.0 * edges * revolutions * RUNS_PER_CROSSING;
        let most_cells = f64::from(self.max_cells.min(MAX_REPORTED_CELLS));
        let updates_per_row = updates_per_row(tool, cut, columns, resolution_mm, self.trailing);
        let most_rows = (most_cells / columns).min(MAX_RUNS / runs_per_row).min(MAX_UPDATES / updates_per_row).floor();
        // What the engagement sweeps across the feed, to the right of it.
        let side = if cut.clockwise { 1.0 } else { -1.0 };
        let across = |azimuth_deg: f64| side * tool.radius_mm * libm::sin(azimuth_deg.to_radians());
        let [from_mm, to_mm] = cut.engagement_deg.map(across);
        let rows = ((to_mm - from_mm).abs() / resolution_mm).floor().min(most_rows);
        let is_possible = rows >= 1.0 && columns >= 1.0 && resolution_mm > 0.0;
        is_possible.then_some(FloorArea {
            length_mm: columns * resolution_mm,
            width_mm: rows * resolution_mm,
            across_mm: 0.5 * (from_mm + to_mm),
            resolution_mm,
            trailing: self.trailing,
        })
    }
}

/// How often cells of a row are lowered in a simulation of so many columns: by every half of every edge, in all revolutions in
/// which it comes across the strip, at most along its length.
fn updates_per_row(tool: &ToolGeometry, cut: &OscillationCut, columns: f64, resolution_mm: f64, trailing: bool) -> f64 {
    let halves = if trailing { 2.0 } else { 1.0 } * f64::from(tool.edge_count());
    let crossing_mm = 2.0 * tool.radial_edge_length_mm;
    let revolutions = (columns * resolution_mm + crossing_mm) / cut.feed_per_rev_mm();
    halves * revolutions * ((crossing_mm / resolution_mm).min(columns) + RUNS_PER_CROSSING)
}

impl FloorArea {
    /// How often cells are lowered while this part is simulated, about.
    pub(super) fn updates(&self, tool: &ToolGeometry, cut: &OscillationCut) -> f64 {
        let rows = (self.width_mm / self.resolution_mm).round();
        let columns = (self.length_mm / self.resolution_mm).round();
        rows * updates_per_row(tool, cut, columns, self.resolution_mm, self.trailing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(feed_mm_per_min: f64, engagement_deg: [f64; 2]) -> OscillationCut {
        OscillationCut {
            feed_mm_per_min,
            spindle_rev_per_min: 600.0,
            clockwise: true,
            depth_mm: 1.0,
            engagement_deg,
            incline_deg: 0.0,
        }
    }

    #[test]
    fn the_area_is_bounded_and_lies_in_the_engagement() {
        let settings = FloorSettings::default();
        let tool = ToolGeometry::even(4, 60.0, 1.5, 5.0);
        let area = settings.area(&tool, &cut(600.0, [-90.0, 90.0])).expect("possible");
        assert_eq!((area.length_mm, area.resolution_mm, area.across_mm), (2.0, 0.02, 0.0));
        assert!((area.width_mm - 80.0).abs() < 1e-9, "{area:?}");
        // The right half by 30 degrees.
        let area = settings.area(&tool, &cut(600.0, [30.0, 90.0])).expect("possible");
        assert!((area.across_mm - 45.0).abs() < 1e-9 && (area.width_mm - 30.0).abs() < 0.02, "{area:?}");
        // A small feed has small cells, and a tiny one a few rows of them.
        let area = settings.area(&tool, &cut(60.0, [-90.0, 90.0])).expect("possible");
        assert!((area.resolution_mm - 0.1 / 32.0).abs() < 1e-12, "{area:?}");
        for feed in [1e-3, 0.1, 10.0, 1e5] {
            for edges in [1, 2, 64] {
                let tool = ToolGeometry::even(edges, 60.0, 1.5, 5.0);
                if let Some(area) = settings.area(&tool, &cut(feed, [-90.0, 90.0])) {
                    let cells = area.length_mm * area.width_mm / (area.resolution_mm * area.resolution_mm);
                    assert!(cells < 400_001.0, "{area:?}");
                }
            }
        }
        // Whatever a profile permits, one simulation has its bounds.
        let extreme = FloorSettings {
            revolutions: MAX_FLOOR_REVOLUTIONS,
            resolution_mm: 0.001,
            max_cells: MAX_FLOOR_CELLS as u32,
            ..settings
        };
        for (edges, edge_length_mm) in [(1, 0.1), (4, 1.5), (64, 1.5), (64, 20.0)] {
            for feed in [1.0, 60.0, 6e3, 1e5] {
                let tool = ToolGeometry::even(edges, 60.0, edge_length_mm, 5.0);
                let cut = cut(feed, [-90.0, 90.0]);
                let Some(area) = extreme.area(&tool, &cut) else { continue };
                let cells = area.length_mm * area.width_mm / (area.resolution_mm * area.resolution_mm);
                assert!(cells < 1.000_001 * f64::from(MAX_REPORTED_CELLS), "{area:?}");
                assert!(area.updates(&tool, &cut) < 1.000_001 * MAX_UPDATES, "{area:?}");
            }
        }
        assert_eq!(FloorSettings { simulate: false, ..settings }.area(&tool, &cut(600.0, [-90.0, 90.0])), None);
    }

    #[test]
    fn settings_have_their_bounds() {
        assert!(FloorSettings::default().problems().is_empty());
        let wrong = FloorSettings { revolutions: 0, resolution_mm: f64::NAN, max_cells: 999, ..Default::default() };
        let fields: Vec<String> = wrong.problems().into_iter().map(|problem| problem.field).collect();
        assert_eq!(fields, ["revolutions", "resolution_mm", "max_cells"]);
    }
}
