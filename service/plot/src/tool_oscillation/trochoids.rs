//! The paths of the edges seen along the tool axis: the whole tool, and its front magnified along the feed, with and
//! without oscillation.

use std::f64::consts::TAU;

use feedwave_cutting::tool_oscillation::ToolOscillation;

use super::super::figure::{Axis, Beside, Figure, Layout, MM, Panel, Place};
use super::super::theme::{self, Ink};
use super::{OscillationPictures, sampled};

/// Revolutions of which the front is shown.
const REVOLUTIONS: u32 = 3;
/// Points of a path.
const POINTS: u32 = 600;

/// The paths of the edges.
pub(super) struct EdgesPicture<'a> {
    pub(super) pass: &'a OscillationPictures<'a>,
}

impl EdgesPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let pass = self.pass;
        let oscillating = self.front("front of the tool in three revolutions, with oscillation", pass.oscillation);
        let plain = self.front("the same without oscillation", &pass.plain());
        let fronts = vec![Panel { x: oscillating.x.clone().labelled_if(false), ..oscillating }, plain];
        let body = Layout::Row(vec![(0.42, self.tool().into()), (0.58, Layout::column(fronts))]);
        let name = format!("{}-edges", pass.name);
        Figure::new(name, "Paths of the edges, seen from the spindle", pass.subtitle(), body)
    }

    /// Place of an edge's tip across and along the feed, mm, after so many turns of the spindle.
    fn tip(&self, oscillation: &ToolOscillation, edge: usize, turns: f64) -> Place {
        let pass = self.pass;
        let first = pass.tool.edges.first().map_or(0.0, |edge| edge.angle_deg / 360.0);
        let offset = oscillation.offset(oscillation.phase_turns(first + turns, 0.0));
        let radius_mm = pass.tool.radius_mm + pass.tool.edges[edge].radial_set_over_mm;
        let (sin, cos) = (TAU * (turns - pass.tool.turns_behind_first(edge))).sin_cos();
        let side = if pass.section.cut.clockwise { 1.0 } else { -1.0 };
        (offset.cross_mm + side * radius_mm * sin, pass.feed_per_rev_mm() * turns + offset.feed_mm + radius_mm * cos)
    }

    fn tool(&self) -> Panel {
        let pass = self.pass;
        let radius_mm = pass.tool.radius_mm;
        let (x, y) = (-1.15 * radius_mm..1.15 * radius_mm, -1.15 * radius_mm..1.45 * radius_mm);
        let (x, y) = (Axis::new("to the right of the feed", MM, x), Axis::new("along the feed", MM, y));
        let mut panel = Panel::new("the tool at the first edge's passage", x, y).in_proportion();
        panel.area(&Ink::fill("work", theme::RAPID, 0.32), self.work());
        let circle = sampled(0.0, 1.0, 360, |turns| {
            let (sin, cos) = (TAU * turns).sin_cos();
            (radius_mm * sin, radius_mm * cos)
        });
        panel.path(&Ink::line("circle of the edges", theme::INK, 1.4), circle);
        for edge in 0..pass.edge_count() {
            let tip = self.tip(pass.oscillation, edge, 0.0);
            // The last eighth of a turn of every edge.
            let path = sampled(-0.125, 0.0, POINTS, |turns| self.tip(pass.oscillation, edge, turns));
            panel.path(&pass.line(edge, 2.6), path);
            let inner = 1.0 - (pass.tool.radial_edge_length_mm / radius_mm).max(0.12);
            panel.path(&pass.line(edge, 2.6), vec![(tip.0 * inner, tip.1 * inner), tip]);
            let at = (tip.0 * (inner - 0.1), tip.1 * (inner - 0.1));
            panel.label(at, format!("E{}", edge + 1), theme::INK, Beside::CENTER);
        }
        let feed = [(0.0, -0.25 * radius_mm), (0.0, 0.35 * radius_mm)];
        let ink = Ink::line("feed", theme::INK, 3.0);
        panel.path(&ink, feed.to_vec());
        panel.arrow(&ink, feed[0], feed[1]);
        panel.label((0.0, 0.0), "feed", theme::INK, Beside::RIGHT);
        let turn = if pass.section.cut.clockwise { 1.0 } else { -1.0 };
        let arc = sampled(-0.06, 0.06, 60, |turns| {
            let (sin, cos) = (TAU * turns).sin_cos();
            (turn * 0.55 * radius_mm * sin, 0.55 * radius_mm * cos)
        });
        let ink = Ink::line("rotation", theme::MUTED, 3.0);
        let end = (arc[arc.len() - 2], arc[arc.len() - 1]);
        panel.path(&ink, arc);
        panel.arrow(&ink, end.0, end.1);
        panel
    }

    /// The work: ahead of what the edges have swept, and beside the tool where they reach its side.
    fn work(&self) -> Vec<Place> {
        let radius_mm = self.pass.tool.radius_mm;
        let engaged_mm = self.pass.engaged_mm();
        let far_mm = 10.0 * radius_mm;
        let ahead = |x_mm: f64| (radius_mm * radius_mm - x_mm * x_mm).max(0.0).sqrt();
        let is_open = |side_mm: f64| side_mm.abs() > radius_mm * (1.0 - 1e-6);
        let mut work = vec![(engaged_mm.start, far_mm)];
        if is_open(engaged_mm.start) {
            work = vec![(engaged_mm.start, -far_mm), (-far_mm, -far_mm), (-far_mm, far_mm)];
        }
        if is_open(engaged_mm.end) {
            work.extend([(far_mm, far_mm), (far_mm, -far_mm), (engaged_mm.end, -far_mm)]);
        } else {
            work.push((engaged_mm.end, far_mm));
        }
        work.extend(sampled(engaged_mm.end, engaged_mm.start, 360, |x_mm| (x_mm, ahead(x_mm))));
        work
    }

    fn front(&self, title: &str, oscillation: &ToolOscillation) -> Panel {
        let pass = self.pass;
        let (radius_mm, per_rev_mm) = (pass.tool.radius_mm, pass.feed_per_rev_mm());
        let feed_mm = pass.oscillation.feed.amplitude_mm;
        // As far to the sides as the front falls back by about one and a half feeds.
        let half_mm = (2.0 * radius_mm * 1.5 * per_rev_mm.max(feed_mm)).sqrt().min(0.9 * radius_mm);
        let low_mm = radius_mm - 0.7 * per_rev_mm - feed_mm;
        let high_mm = radius_mm + per_rev_mm * f64::from(REVOLUTIONS) + 0.9 * feed_mm;
        let x = Axis::new("to the right of the feed", MM, -half_mm..half_mm);
        let mut panel = Panel::new(title, x, Axis::new("along the feed", MM, low_mm..high_mm));
        for revolution in 0..REVOLUTIONS {
            for edge in 0..pass.edge_count() {
                let middle = f64::from(revolution) + pass.tool.turns_behind_first(edge);
                let path = sampled(middle - 0.13, middle + 0.13, POINTS, |turns| self.tip(oscillation, edge, turns));
                panel.endless(&pass.line(edge, 2.6), path);
                let tip = self.tip(oscillation, edge, middle);
                panel.dots(&Ink::dot("an edge points ahead", theme::INK, 3.5), vec![tip]);
            }
        }
        panel
    }
}
