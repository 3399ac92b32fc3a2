//! The paths of the edges seen along the tool axis: the whole tool, and its front magnified along the feed, with and
//! without oscillation.

use std::f64::consts::TAU;

use feedwave_cutting::tool_oscillation::ToolOscillation;
use plotters::coord::Shift;
use plotters::element::{Circle, PathElement, Polygon};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::Color;

use super::super::DrawResult;
use super::super::canvas::Picture;
use super::super::theme::{self, AxisSpec, Scale, Swatch};
use super::super::tool_path::same_scale;
use super::{OscillationPictures, RIGHT, arrow, sampled, write};

/// Revolutions of which the front is shown.
const REVOLUTIONS: u32 = 3;
/// Points of a path.
const POINTS: u32 = 600;

/// The paths of the edges.
pub(super) struct EdgesPicture<'a> {
    pub(super) pass: &'a OscillationPictures<'a>,
}

impl Picture for EdgesPicture<'_> {
    fn name(&self) -> String {
        format!("{}-edges", self.pass.name)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let pass = self.pass;
        let title = "Paths of the edges, seen from the spindle";
        let body = theme::headline(area, scale, title, &pass.subtitle())?;
        let entries = pass.legend(Swatch::Line);
        let entries: Vec<_> = entries.iter().map(|(swatch, color, label)| (*swatch, *color, label.as_str())).collect();
        let body = theme::legend(&body, scale, &entries)?;
        let (left, right) = body.split_horizontally(body.dim_in_pixel().0 * 42 / 100);
        self.draw_tool(&left, scale)?;
        let (upper, lower) = right.split_vertically(right.dim_in_pixel().1 / 2);
        self.draw_front(
            &upper,
            scale,
            "front of the tool in three revolutions, with oscillation",
            "",
            pass.oscillation,
        )?;
        let label = "to the right of the feed, mm";
        self.draw_front(&lower, scale, "the same without oscillation", label, &pass.plain())
    }
}

impl EdgesPicture<'_> {
    /// Place of an edge's tip across and along the feed, mm, after so many turns of the spindle.
    fn tip(&self, oscillation: &ToolOscillation, edge: usize, turns: f64) -> (f64, f64) {
        let pass = self.pass;
        let first = pass.tool.edges.first().map_or(0.0, |edge| edge.angle_deg / 360.0);
        let offset = oscillation.offset(oscillation.phase_turns(first + turns, 0.0));
        let radius_mm = pass.tool.radius_mm + pass.tool.edges[edge].radial_set_over_mm;
        let (sin, cos) = (TAU * (turns - pass.tool.turns_behind_first(edge))).sin_cos();
        let side = if pass.section.cut.clockwise { 1.0 } else { -1.0 };
        (offset.cross_mm + side * radius_mm * sin, pass.feed_per_rev_mm() * turns + offset.feed_mm + radius_mm * cos)
    }

    fn draw_tool<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let pass = self.pass;
        let radius_mm = pass.tool.radius_mm;
        let (x, y) = (-1.15 * radius_mm..1.15 * radius_mm, -1.15 * radius_mm..1.45 * radius_mm);
        let (x, y) = same_scale(area.dim_in_pixel(), scale, x, y);
        let (x, y) = (AxisSpec::new("to the right of the feed, mm", x), AxisSpec::new("along the feed, mm", y));
        let mut chart = theme::panel(area, scale, "the tool at the first edge's passage", &x, &y)?;
        let engaged_mm = pass.engaged_mm();
        // The work: ahead of what the edges have swept, and beside the tool where they reach its side.
        let ahead = |x_mm: f64| (radius_mm * radius_mm - x_mm * x_mm).max(0.0).sqrt();
        let is_open = |side_mm: f64| side_mm.abs() > radius_mm * (1.0 - 1e-6);
        let mut work = vec![(engaged_mm.start, y.range.end)];
        if is_open(engaged_mm.start) {
            work =
                vec![(engaged_mm.start, y.range.start), (x.range.start, y.range.start), (x.range.start, y.range.end)];
        }
        if is_open(engaged_mm.end) {
            work.extend([(x.range.end, y.range.end), (x.range.end, y.range.start), (engaged_mm.end, y.range.start)]);
        } else {
            work.push((engaged_mm.end, y.range.end));
        }
        work.extend(sampled(engaged_mm.end, engaged_mm.start, 360, |x_mm| (x_mm, ahead(x_mm))));
        chart.draw_series([Polygon::new(work, theme::RAPID.mix(0.32).filled())])?;
        let circle = sampled(0.0, 1.0, 360, |turns| {
            let (sin, cos) = (TAU * turns).sin_cos();
            (radius_mm * sin, radius_mm * cos)
        });
        chart.draw_series([PathElement::new(circle, scale.stroke(theme::INK, 1.4))])?;
        for edge in 0..pass.edge_count() {
            let (tip, color) = (self.tip(pass.oscillation, edge, 0.0), pass.color(edge));
            // The last eighth of a turn of every edge.
            let path = sampled(-0.125, 0.0, POINTS, |turns| self.tip(pass.oscillation, edge, turns));
            theme::curve(&mut chart, &path, scale.stroke(color, 3.0))?;
            let inner = 1.0 - (pass.tool.radial_edge_length_mm / radius_mm).max(0.12);
            let blade = vec![(tip.0 * inner, tip.1 * inner), tip];
            chart.draw_series([PathElement::new(blade, scale.stroke(color, 4.0))])?;
            let name = format!("E{}", edge + 1);
            let at = (tip.0 * (inner - 0.1), tip.1 * (inner - 0.1));
            write(&mut chart, scale, at, &name, color, super::CENTRE)?;
        }
        let feed = [(0.0, -0.25 * radius_mm), (0.0, 0.35 * radius_mm)];
        chart.draw_series([PathElement::new(feed.to_vec(), scale.stroke(theme::COMMAND, 3.0))])?;
        arrow(&mut chart, scale, feed[0], feed[1], theme::COMMAND)?;
        write(&mut chart, scale, (0.0, 0.0), "feed", theme::COMMAND, RIGHT)?;
        let turn = if pass.section.cut.clockwise { 1.0 } else { -1.0 };
        let arc = sampled(-0.06, 0.06, 60, |turns| {
            let (sin, cos) = (TAU * turns).sin_cos();
            (turn * 0.55 * radius_mm * sin, 0.55 * radius_mm * cos)
        });
        let end = (arc[arc.len() - 2], arc[arc.len() - 1]);
        chart.draw_series([PathElement::new(arc, scale.stroke(theme::MUTED, 3.0))])?;
        arrow(&mut chart, scale, end.0, end.1, theme::MUTED)
    }

    fn draw_front<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        title: &str,
        label: &str,
        oscillation: &ToolOscillation,
    ) -> DrawResult<(), DB> {
        let pass = self.pass;
        let (radius_mm, per_rev_mm) = (pass.tool.radius_mm, pass.feed_per_rev_mm());
        let feed_mm = pass.oscillation.feed.amplitude_mm;
        // As far to the sides as the front falls back by about one and a half feeds.
        let half_mm = (2.0 * radius_mm * 1.5 * per_rev_mm.max(feed_mm)).sqrt().min(0.9 * radius_mm);
        let low_mm = radius_mm - 0.7 * per_rev_mm - feed_mm;
        let high_mm = radius_mm + per_rev_mm * f64::from(REVOLUTIONS) + 0.9 * feed_mm;
        let x = AxisSpec::new(label, -half_mm..half_mm);
        let y = AxisSpec::new("along the feed, mm", low_mm..high_mm);
        let mut chart = theme::panel(area, scale, title, &x, &y)?;
        for revolution in 0..REVOLUTIONS {
            for edge in 0..pass.edge_count() {
                let middle = f64::from(revolution) + pass.tool.turns_behind_first(edge);
                let path = sampled(middle - 0.13, middle + 0.13, POINTS, |turns| self.tip(oscillation, edge, turns));
                let within: Vec<_> = path.into_iter().filter(|point| point.0.abs() <= half_mm).collect();
                theme::curve(&mut chart, &within, scale.stroke(pass.color(edge), 2.4))?;
                let tip = self.tip(oscillation, edge, middle);
                chart.draw_series([Circle::new(tip, scale.px(4.5), pass.color(edge).filled())])?;
            }
        }
        Ok(())
    }
}
