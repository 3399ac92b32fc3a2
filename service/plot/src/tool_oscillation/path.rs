//! The path of the reference point of the tool: from the side and over time.

use super::super::figure::{Axis, Beside, Figure, Layout, MILLISECONDS, MM, Panel, Place};
use super::super::theme::{self, Ink};
use super::{OscillationPictures, sampled};

/// Periods that are shown.
const PERIODS: f64 = 3.0;
/// Points of a period.
const POINTS: u32 = 800;
/// Where arrows are on each period: not at the turning points of common waveforms.
const ARROWS: [f64; 6] = [0.06, 0.19, 0.44, 0.56, 0.81, 0.94];

/// The path of the reference point.
pub(super) struct PathPicture<'a> {
    pub(super) pass: &'a OscillationPictures<'a>,
}

impl PathPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let body = Layout::Column(vec![(0.54, self.side_panel().into()), (0.46, self.time_panel().into())]);
        let name = format!("{}-path", self.pass.name);
        Figure::new(name, "Path of the tool's reference point", self.pass.subtitle(), body)
    }

    /// The dot of an edge that points ahead.
    fn dot(&self, edge: usize) -> Ink {
        Ink::dot(format!("{} points ahead", self.pass.edge_name(edge)), self.pass.color(edge), 6.0)
    }

    fn shown_turns(&self) -> f64 {
        PERIODS * self.pass.period_turns()
    }

    /// Along the feed and away from the work, mm.
    fn side(&self, turns: f64) -> Place {
        let offset = self.pass.offset(turns);
        (self.pass.feed_per_rev_mm() * turns + offset.feed_mm, offset.retraction_mm)
    }

    /// Edges and turns at which they point ahead.
    fn passages(&self, to_turns: f64) -> Vec<(usize, f64)> {
        let pass = self.pass;
        let turns = |edge: usize| (0..4).map(move |turn| (edge, f64::from(turn) + pass.tool.turns_behind_first(edge)));
        (0..pass.edge_count()).flat_map(turns).filter(|(_, turns)| *turns < to_turns).collect()
    }

    fn peaks_mm(&self) -> (f64, f64) {
        let oscillation = self.pass.oscillation;
        (oscillation.feed.amplitude_mm.max(1e-6), oscillation.axial.amplitude_mm.max(1e-6))
    }

    fn side_panel(&self) -> Panel {
        let shown = self.shown_turns();
        let (feed_mm, axial_mm) = self.peaks_mm();
        let end_mm = self.pass.feed_per_rev_mm() * shown;
        let x = Axis::new("along the feed", MM, -1.2 * feed_mm..end_mm + 1.2 * feed_mm);
        let y = Axis::new("away from the work", MM, -1.5 * axial_mm..1.5 * axial_mm);
        let mut panel = Panel::new("from the side", x, y);
        panel.path(&commanded(), vec![(0.0, 0.0), (end_mm, 0.0)]);
        let points = (f64::from(POINTS) * PERIODS) as u32;
        panel.path(&oscillating(), sampled(0.0, shown, points, |turns| self.side(turns)));
        let periods = (0..PERIODS as u32).map(f64::from);
        for period in periods.flat_map(|whole| ARROWS.map(|part| whole + part)) {
            let turns = period * self.pass.period_turns();
            let step = 2.0 * shown / f64::from(points);
            panel.arrow(&oscillating(), self.side(turns - step), self.side(turns));
        }
        for (edge, turns) in self.passages(shown) {
            let at = self.side(turns);
            let beside = if at.1.abs() < 0.6 * axial_mm {
                Beside { by: (9.0, 5.0), ..Beside::INSIDE_TOP }
            } else if at.1 < 0.0 {
                Beside::BELOW
            } else {
                Beside::ABOVE
            };
            panel.dots(&self.dot(edge), vec![at]);
            panel.label(at, format!("E{}", edge + 1), theme::INK, beside);
        }
        panel
    }

    fn time_panel(&self) -> Panel {
        let shown = self.shown_turns();
        let ms_per_turn = 60e3 / self.pass.section.cut.spindle_rev_per_min;
        let (feed_mm, _) = self.peaks_mm();
        let end_mm = self.pass.feed_per_rev_mm() * shown;
        let x = Axis::new("time", MILLISECONDS, 0.0..ms_per_turn * shown);
        let y = Axis::new("along the feed", MM, -1.3 * feed_mm..end_mm + 1.3 * feed_mm);
        let mut panel = Panel::new("along the feed over time", x, y);
        panel.path(&commanded(), vec![(0.0, 0.0), (ms_per_turn * shown, end_mm)]);
        let at = |turns: f64| (ms_per_turn * turns, self.side(turns).0);
        panel.path(&oscillating(), sampled(0.0, shown, (f64::from(POINTS) * PERIODS) as u32, at));
        for (edge, turns) in self.passages(shown) {
            panel.dots(&self.dot(edge), vec![at(turns)]);
        }
        panel
    }
}

fn commanded() -> Ink {
    Ink::dashed("commanded path", theme::COMMAND, 2.2)
}

fn oscillating() -> Ink {
    Ink::line("with oscillation", theme::VIBRATION, 3.0)
}
