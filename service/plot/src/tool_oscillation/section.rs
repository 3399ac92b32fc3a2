//! The work in the plane of feed and tool axis, before and after every edge's pass: what the stages and the layers are
//! drawn from.

use std::ops::Range;

use feedwave_cutting::tool_oscillation::{EdgePass, plane_section};

use super::super::figure::{Axis, Beside, MM, Panel, Place, short};
use super::super::theme::{self, Ink};
use super::OscillationPictures;

/// Work deeper than this many times the axial travel is not shown up to its surface: the layers would be lines.
const LARGEST_DEPTH: f64 = 6.0;
/// Height of a line of text, design units.
const LINE: f64 = 21.0;
/// Heights below this are none, mm.
const NOTHING_MM: f64 = 1e-9;

/// The passes of all edges in one revolution of the steady state.
pub(super) struct Section<'a> {
    pass: &'a OscillationPictures<'a>,
    /// By how far a front moves on in one revolution, mm.
    advance_mm: f64,
    pub(super) passes: Vec<EdgePass>,
    /// Heights between which every edge either cuts or does not, rising.
    levels_mm: Vec<f64>,
    /// What is shown along the feed and along the axis.
    pub(super) along_mm: Range<f64>,
    pub(super) height_mm: Range<f64>,
}

impl<'a> Section<'a> {
    pub(super) fn new(pass: &'a OscillationPictures<'a>) -> Self {
        let cut = &pass.section.cut;
        let passes = plane_section(pass.tool, pass.oscillation, cut, pass.section.report.plane_deg);
        let advance_mm = cut.feed_per_rev_mm() * pass.section.report.plane_deg.to_radians().cos();
        let edge_mm = pass.tool.axial_edge_height_mm;
        let ends = || passes.iter().map(|pass| pass.end_mm);
        let (low_mm, high_mm) = (ends().fold(f64::INFINITY, f64::min), ends().fold(f64::NEG_INFINITY, f64::max));
        let mut levels_mm: Vec<f64> =
            ends().flat_map(|end| [end, end + edge_mm]).chain([cut.depth_mm]).filter(|z| *z <= cut.depth_mm).collect();
        levels_mm.sort_by(f64::total_cmp);
        levels_mm.dedup_by(|a, b| *a - *b < NOTHING_MM);

        let travel_mm = if high_mm - low_mm > NOTHING_MM { high_mm - low_mm } else { cut.depth_mm.max(1e-3) };
        let depth_mm = (cut.depth_mm - low_mm).max(travel_mm);
        let top_mm =
            if depth_mm > LARGEST_DEPTH * travel_mm { high_mm + 0.9 * travel_mm } else { cut.depth_mm.max(high_mm) };
        let room_mm = 0.22 * (top_mm - low_mm);
        let top_mm = if top_mm < cut.depth_mm { top_mm } else { top_mm + room_mm };

        let fronts = || passes.iter().map(|pass| pass.front_mm);
        let met = passes.iter().flat_map(|pass| pass.layers.iter().map(|layer| layer.from_mm));
        let first_mm = met.chain(fronts()).fold(f64::INFINITY, f64::min);
        let last_mm = fronts().fold(f64::NEG_INFINITY, f64::max);
        let span_mm = (last_mm - first_mm).max(1e-3);
        let along_mm = first_mm - 0.3 * span_mm..last_mm + 0.3 * span_mm;
        Self { pass, advance_mm, passes, levels_mm, along_mm, height_mm: low_mm - room_mm..top_mm }
    }

    /// An empty panel of the plane.
    pub(super) fn panel(&self, title: impl Into<String>) -> Panel {
        let x = Axis::new(self.pass.outwards(), MM, self.along_mm.clone());
        let mut panel = Panel::new(title, x, Axis::new("height", MM, self.height_mm.clone()));
        let depth_mm = self.pass.section.cut.depth_mm;
        if depth_mm > self.height_mm.end {
            panel.note(format!(
                "cut off above: work and edges go on up to the surface of the work at {} mm",
                short(depth_mm, 3)
            ));
        }
        panel
    }

    fn cuts(&self, edge: usize, low_mm: f64, high_mm: f64) -> bool {
        let end_mm = self.passes[edge].end_mm;
        end_mm <= low_mm + NOTHING_MM && high_mm <= end_mm + self.pass.tool.axial_edge_height_mm + NOTHING_MM
    }

    /// Foremost front at these heights after `passed` edges of this revolution; what lies behind it is cut.
    fn front_mm(&self, passed: usize, low_mm: f64, high_mm: f64) -> f64 {
        let fronts = self.passes.iter().enumerate().filter(|(edge, _)| self.cuts(*edge, low_mm, high_mm));
        let fronts =
            fronts.map(|(edge, pass)| if edge < passed { pass.front_mm } else { pass.front_mm - self.advance_mm });
        fronts.fold(f64::NEG_INFINITY, f64::max)
    }

    /// The part of a rectangle that is shown.
    fn shown(&self, along_mm: Range<f64>, height_mm: Range<f64>) -> Option<[Place; 2]> {
        let (x, y) = (&self.along_mm, &self.height_mm);
        let corners = [
            (along_mm.start.max(x.start), height_mm.start.max(y.start)),
            (along_mm.end.min(x.end), height_mm.end.min(y.end)),
        ];
        (corners[0].0 < corners[1].0 && corners[0].1 < corners[1].1).then_some(corners)
    }

    /// The work as it is after `passed` edges of this revolution.
    pub(super) fn add_work(&self, panel: &mut Panel, passed: usize) {
        let depth_mm = self.pass.section.cut.depth_mm;
        let below = f64::NEG_INFINITY..self.levels_mm.first().copied().unwrap_or(depth_mm).min(depth_mm);
        let mut parts = vec![(self.along_mm.clone(), below)];
        for level in self.levels_mm.windows(2) {
            parts.push((self.front_mm(passed, level[0], level[1])..self.along_mm.end, level[0]..level[1]));
        }
        let ink = Ink::fill("work", theme::RAPID, 0.4);
        for [from, to] in parts.into_iter().filter_map(|(along, height)| self.shown(along, height)) {
            panel.rectangle(&ink, from.0..to.0, from.1..to.1);
        }
    }

    /// What an edge removes in this revolution.
    pub(super) fn add_removed(&self, panel: &mut Panel, edge: usize) {
        let ink = self.pass.fill(edge);
        for layer in &self.passes[edge].layers {
            if let Some([from, to]) = self.shown(layer.from_mm..layer.to_mm, layer.low_mm..layer.high_mm) {
                panel.rectangle(&ink, from.0..to.0, from.1..to.1);
            }
        }
    }

    /// Writes something into the shown layers of an edge, in one line or two as the `space` of the panel permits,
    /// design units; returns what does not fit.
    pub(super) fn write(
        &self,
        panel: &mut Panel,
        edge: usize,
        space: (f64, f64),
        text: impl Fn(&feedwave_cutting::tool_oscillation::RemovedLayer) -> [String; 2],
    ) -> Vec<String> {
        let mut left_out = Vec::new();
        for layer in &self.passes[edge].layers {
            let [first, second] = text(layer);
            let line = format!("{first}{second}");
            let shown = self.shown(layer.from_mm..layer.to_mm, layer.low_mm..layer.high_mm);
            let Some([from, to]) = shown else {
                left_out.push(line);
                continue;
            };
            let width = space.0 * (to.0 - from.0) / (self.along_mm.end - self.along_mm.start);
            let height = space.1 * (to.1 - from.1) / (self.height_mm.end - self.height_mm.start);
            let fits = |text: &str| theme::text_width(text, theme::LABEL_SIZE) + 8.0 <= width;
            let middle = (0.5 * (from.0 + to.0), 0.5 * (from.1 + to.1));
            if fits(&line) && height >= LINE {
                panel.label(middle, line, theme::INK, Beside::CENTER);
            } else if fits(&first) && fits(&second) && height >= 2.0 * LINE {
                for (part, down) in [(first, -0.5), (second, 0.5)] {
                    let by = (0.0, down * LINE);
                    panel.label(middle, part.trim().to_owned(), theme::INK, Beside { by, ..Beside::CENTER });
                }
            } else {
                left_out.push(line);
            }
        }
        left_out
    }

    /// Outline of an edge at its pass.
    pub(super) fn add_edge(&self, panel: &mut Panel, edge: usize) {
        let (pass, tool) = (&self.passes[edge], self.pass.tool);
        let (front_mm, back_mm) = (pass.front_mm, pass.front_mm - tool.radial_edge_length_mm);
        let rise_mm = tool.radial_edge_length_mm * tool.end_relief_deg.to_radians().tan();
        let top_mm = pass.end_mm + tool.axial_edge_height_mm;
        let outline: [Place; 4] =
            [(front_mm, top_mm), (front_mm, pass.end_mm), (back_mm, pass.end_mm + rise_mm), (back_mm, top_mm)];
        panel.endless(&self.pass.line(edge, 3.4), outline.to_vec());
    }

    /// The surface that is left behind all edges and ahead of them, from the panel's left edge to its right one.
    pub(super) fn add_profile(&self, panel: &mut Panel, ink: &Ink, passed: usize) {
        let mut profile: Vec<Place> = Vec::new();
        if let Some(lowest) = self.levels_mm.first() {
            profile.push((self.along_mm.start, *lowest));
        }
        for level in self.levels_mm.windows(2) {
            let front = self.front_mm(passed, level[0], level[1]);
            profile.extend([(front, level[0]), (front, level[1])]);
        }
        if let Some(highest) = self.levels_mm.last() {
            profile.push((self.along_mm.end, *highest));
        }
        panel.endless(ink, profile);
    }
}
