//! The path of the reference point of the tool: from the side and over time.

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::text_anchor::{HPos, VPos};

use super::super::DrawResult;
use super::super::canvas::Picture;
use super::super::theme::{self, AxisSpec, Scale, Swatch};
use super::{Beside, OscillationPictures, RIGHT, arrow, mark, sampled};

/// Periods that are shown.
const PERIODS: f64 = 3.0;
/// Points of a period.
const POINTS: u32 = 800;
/// Where arrows stand on each period: not at the turning points of the usual waveforms.
const ARROWS: [f64; 6] = [0.06, 0.19, 0.44, 0.56, 0.81, 0.94];

/// The path of the reference point.
pub(super) struct PathPicture<'a> {
    pub(super) pass: &'a OscillationPictures<'a>,
}

impl Picture for PathPicture<'_> {
    fn name(&self) -> String {
        format!("{}-path", self.pass.name)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let title = "Path of the tool's reference point";
        let body = theme::headline(area, scale, title, &self.pass.subtitle())?;
        let entries =
            [(Swatch::Dashed, theme::COMMAND, "commanded path"), (Swatch::Line, theme::VIBRATION, "with oscillation")];
        let mut entries: Vec<_> = entries.map(|(swatch, color, label)| (swatch, color, label.to_owned())).into();
        let edges = self.pass.legend(Swatch::Fill).into_iter();
        entries.extend(edges.map(|(swatch, color, name)| (swatch, color, format!("{name} points ahead"))).take(6));
        let entries: Vec<_> = entries.iter().map(|(swatch, color, label)| (*swatch, *color, label.as_str())).collect();
        let body = theme::legend(&body, scale, &entries)?;
        let (side, lower) = body.split_vertically(body.dim_in_pixel().1 * 52 / 100);
        self.draw_side(&side, scale)?;
        self.draw_time(&lower, scale)
    }
}

impl PathPicture<'_> {
    fn shown_turns(&self) -> f64 {
        PERIODS * self.pass.period_turns()
    }

    /// Along the feed and away from the work, mm.
    fn side(&self, turns: f64) -> (f64, f64) {
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

    fn draw_side<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let shown = self.shown_turns();
        let (feed_mm, axial_mm) = self.peaks_mm();
        let end_mm = self.pass.feed_per_rev_mm() * shown;
        let x = AxisSpec::new("along the feed, mm", -1.2 * feed_mm..end_mm + 1.2 * feed_mm);
        let y = AxisSpec::new("away from the work, mm", -1.4 * axial_mm..1.4 * axial_mm);
        let title = "from the side";
        let mut chart = theme::panel(area, scale, title, &x, &y)?;
        let style = scale.stroke(theme::COMMAND, 2.0);
        let command = [(0.0, 0.0), (end_mm, 0.0)];
        chart.draw_series([DashedPathElement::new(command, scale.px(9.0), scale.px(6.0), style)])?;
        let points = (f64::from(POINTS) * PERIODS) as u32;
        let curve = sampled(0.0, shown, points, |turns| self.side(turns));
        theme::curve(&mut chart, &curve, scale.stroke(theme::VIBRATION, 3.0))?;
        let periods = (0..PERIODS as u32).map(f64::from);
        for period in periods.flat_map(|whole| ARROWS.map(|part| whole + part)) {
            let turns = period * self.pass.period_turns();
            let step = 2.0 * shown / f64::from(points);
            arrow(&mut chart, scale, self.side(turns - step), self.side(turns), theme::VIBRATION)?;
        }
        for (edge, turns) in self.passages(shown) {
            let at = self.side(turns);
            let beside = if at.1.abs() < 0.6 * axial_mm {
                Beside { x: HPos::Left, y: VPos::Top, by: (8.0, 5.0) }
            } else if at.1 < 0.0 {
                Beside { x: HPos::Center, y: VPos::Top, by: (0.0, 9.0) }
            } else {
                Beside { x: HPos::Center, y: VPos::Bottom, by: (0.0, -9.0) }
            };
            mark(&mut chart, scale, at, &format!("E{}", edge + 1), self.pass.color(edge), beside)?;
        }
        Ok(())
    }

    fn draw_time<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let shown = self.shown_turns();
        let ms_per_turn = 60e3 / self.pass.section.cut.spindle_rev_per_min;
        let (feed_mm, _) = self.peaks_mm();
        let end_mm = self.pass.feed_per_rev_mm() * shown;
        let x = AxisSpec::new("time, ms", 0.0..ms_per_turn * shown);
        let y = AxisSpec::new("along the feed, mm", -1.3 * feed_mm..end_mm + 1.3 * feed_mm);
        let mut chart = theme::panel(area, scale, "along the feed over time", &x, &y)?;
        let style = scale.stroke(theme::COMMAND, 2.0);
        let command = [(0.0, 0.0), (ms_per_turn * shown, end_mm)];
        chart.draw_series([DashedPathElement::new(command, scale.px(9.0), scale.px(6.0), style)])?;
        let at = |turns: f64| (ms_per_turn * turns, self.side(turns).0);
        let curve = sampled(0.0, shown, (f64::from(POINTS) * PERIODS) as u32, at);
        theme::curve(&mut chart, &curve, scale.stroke(theme::VIBRATION, 3.0))?;
        for (edge, turns) in self.passages(shown) {
            mark(&mut chart, scale, at(turns), "", self.pass.color(edge), RIGHT)?;
        }
        Ok(())
    }
}
