//! The offsets over the spindle angle, with the edges that point in the feed direction and the held protrusion.

use feedwave_cutting::tool_oscillation::DirectionMotion;
use plotters::coord::Shift;
use plotters::element::{Circle, DashedPathElement, PathElement, Rectangle};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color, RGBColor};

use super::super::DrawResult;
use super::super::canvas::Picture;
use super::super::theme::{self, AxisSpec, Scale, Swatch};
use super::{Beside, OscillationPictures, sampled, short, write};

/// Turns of the spindle that are shown.
const SHOWN_TURNS: f64 = 1.25;
/// Points of a curve.
const POINTS: u32 = 3_000;
/// More edges than this are marked without their names.
const NAMED_EDGES: usize = 24;

/// The offsets over the spindle angle.
pub(super) struct WaveformPicture<'a> {
    pub(super) pass: &'a OscillationPictures<'a>,
}

/// One of the directions.
struct Direction<'a> {
    motion: &'a DirectionMotion,
    label: &'static str,
    title: String,
    color: RGBColor,
}

impl Picture for WaveformPicture<'_> {
    fn name(&self) -> String {
        format!("{}-waveform", self.pass.name)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let body = theme::headline(area, scale, "Oscillation over the spindle angle", &self.pass.subtitle())?;
        let entries = [
            (Swatch::Line, theme::VIBRATION, "offset along the feed"),
            (Swatch::Line, theme::COMMAND, "offset along the tool axis"),
            (Swatch::Fill, theme::GOOD, "protrusion held"),
            (Swatch::Dashed, theme::BAD, "middle of the largest retreat"),
            (Swatch::Dashed, theme::MUTED, "edge points in the feed direction"),
        ];
        let body = theme::legend(&body, scale, &entries)?;
        let directions = self.directions();
        let last = directions.len() - 1;
        for (index, area) in body.split_evenly((directions.len(), 1)).iter().enumerate() {
            let label = if index == last { "spindle angle from the first edge's passage, degrees" } else { "" };
            self.draw_direction(area, scale, label, &directions[index])?;
        }
        Ok(())
    }
}

impl WaveformPicture<'_> {
    fn directions(&self) -> Vec<Direction<'_>> {
        let (oscillation, report) = (self.pass.oscillation, &self.pass.section.report);
        let mut directions = vec![
            Direction {
                motion: &oscillation.feed,
                label: "forwards, mm",
                title: format!("along the feed: {} mm to both sides", short(oscillation.feed.amplitude_mm, 4)),
                color: theme::VIBRATION,
            },
            Direction {
                motion: &oscillation.axial,
                label: "away from the work, mm",
                title: format!(
                    "along the tool axis: {} mm to both sides \u{b7} the largest protrusion is held for {} of the period, \
                     {} needed, {} degrees after the largest retreat",
                    short(oscillation.axial.amplitude_mm, 4),
                    short(report.hold_share, 3),
                    short(report.required_hold_share, 3),
                    short(report.phase_error_deg, 2)
                ),
                color: theme::COMMAND,
            },
        ];
        if let Some(cross) = &oscillation.cross {
            directions.push(Direction {
                motion: cross,
                label: "to the right, mm",
                title: format!("across both: {} mm to both sides", short(cross.amplitude_mm, 4)),
                color: theme::PALETTE[3],
            });
        }
        directions
    }

    /// Turns within the picture at which a phase is reached, from one period before it on.
    fn turns_at(&self, phase_turns: f64) -> impl Iterator<Item = f64> {
        let (period, start) = (self.pass.period_turns(), self.pass.phase_turns(0.0));
        let first = (phase_turns - start - (phase_turns - start).ceil()) * period;
        let count = (SHOWN_TURNS / period).ceil() as u32 + 2;
        (0..count).map(move |index| first + f64::from(index) * period)
    }

    fn draw_direction<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        label: &str,
        direction: &Direction<'_>,
    ) -> DrawResult<(), DB> {
        let pass = self.pass;
        let shown_deg = 360.0 * SHOWN_TURNS;
        let peak_mm = direction.motion.amplitude_mm.max(1e-6);
        let x = AxisSpec::new(label, 0.0..shown_deg);
        let y = AxisSpec::new(direction.label, -1.45 * peak_mm..1.45 * peak_mm);
        let mut chart = theme::panel(area, scale, &direction.title, &x, &y)?;
        if std::ptr::eq(direction.motion, &raw const pass.oscillation.axial) {
            self.shade_hold(&mut chart, scale, &y)?;
        }
        let zero = vec![(0.0, 0.0), (shown_deg, 0.0)];
        chart.draw_series([PathElement::new(zero, scale.stroke(theme::MUTED, 1.0))])?;
        self.mark_retreat(&mut chart, scale, &y)?;
        let offset = |deg: f64| direction.motion.offset_mm(pass.phase_turns(deg / 360.0));
        let passages = self.passages();
        for &(edge, deg) in &passages {
            let line = [(deg, y.range.start), (deg, y.range.end)];
            let style = scale.stroke(pass.color(edge), 1.2);
            chart.draw_series([DashedPathElement::new(line, scale.px(5.0), scale.px(5.0), style)])?;
        }
        let curve = sampled(0.0, shown_deg, POINTS, |deg| (deg, offset(deg)));
        theme::curve(&mut chart, &curve, scale.stroke(direction.color, 3.0))?;
        for &(edge, deg) in &passages {
            let color = pass.color(edge);
            chart.draw_series([Circle::new((deg, offset(deg)), scale.px(6.0), color.filled())])?;
            if pass.edge_count() <= NAMED_EDGES {
                let beside = Beside { x: HPos::Left, y: VPos::Top, by: (5.0, 4.0) };
                write(&mut chart, scale, (deg, y.range.end), &format!("E{}", edge + 1), color, beside)?;
            }
        }
        Ok(())
    }

    /// Edges with the angles at which they point in the feed direction.
    fn passages(&self) -> Vec<(usize, f64)> {
        let pass = self.pass;
        let behind = |edge: usize| pass.tool.turns_behind_first(edge);
        let edges = (0..pass.edge_count()).flat_map(|edge| [0.0, 1.0].map(|turn| (edge, behind(edge) + turn)));
        edges.filter(|(_, turns)| *turns < SHOWN_TURNS).map(|(edge, turns)| (edge, 360.0 * turns)).collect()
    }

    /// Where the protrusion is held; its name in the first of the stretches that has room.
    fn shade_hold<'a, DB: DrawingBackend + 'a>(
        &self,
        chart: &mut theme::Panel<'a, DB>,
        scale: Scale,
        y: &AxisSpec,
    ) -> DrawResult<(), DB> {
        let (middle, share) = self.pass.oscillation.axial.trough();
        let half = 0.5 * share * self.pass.period_turns();
        if half == 0.0 {
            return Ok(());
        }
        for turns in self.turns_at(middle) {
            let (from, to) = ((turns - half).max(0.0), (turns + half).min(SHOWN_TURNS));
            if from >= to {
                continue;
            }
            let corners = [(360.0 * from, y.range.start), (360.0 * to, y.range.end)];
            chart.draw_series([Rectangle::new(corners, theme::GOOD.mix(0.12).filled())])?;
            if to - from > 0.15 {
                let at = (360.0 * from, y.range.start);
                let beside = Beside { x: HPos::Left, y: VPos::Bottom, by: (8.0, -8.0) };
                let text = format!("held for {} degrees", short(720.0 * half, 2));
                write(chart, scale, at, &text, theme::GOOD, beside)?;
            }
        }
        Ok(())
    }

    /// Where the tool is furthest back.
    fn mark_retreat<'a, DB: DrawingBackend + 'a>(
        &self,
        chart: &mut theme::Panel<'a, DB>,
        scale: Scale,
        y: &AxisSpec,
    ) -> DrawResult<(), DB> {
        if self.pass.oscillation.feed.amplitude_mm == 0.0 {
            return Ok(());
        }
        let (middle, _) = self.pass.oscillation.feed.trough();
        for turns in self.turns_at(middle).filter(|turns| (0.0..=SHOWN_TURNS).contains(turns)) {
            let line = [(360.0 * turns, y.range.start), (360.0 * turns, y.range.end)];
            let style = scale.stroke(theme::BAD, 2.0);
            chart.draw_series([DashedPathElement::new(line, scale.px(9.0), scale.px(6.0), style)])?;
        }
        Ok(())
    }
}
