//! The offsets over the spindle angle, with the edges that point in the feed direction and the held protrusion.

use feedwave_cutting::tool_oscillation::DirectionMotion;
use plotters::style::RGBColor;

use super::super::figure::{Axis, Beside, DEGREES, Figure, Layout, MM, Panel, short};
use super::super::theme::{self, Ink};
use super::{OscillationPictures, sampled};

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
    name: &'static str,
    title: String,
    color: RGBColor,
}

impl WaveformPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let directions = self.directions();
        let last = directions.len() - 1;
        let panels = directions.iter().enumerate().map(|(index, direction)| self.panel(direction, index == last));
        let title = "Oscillation over the spindle angle";
        let name = format!("{}-waveform", self.pass.name);
        Figure::new(name, title, self.pass.subtitle(), Layout::column(panels.collect()))
    }

    fn directions(&self) -> Vec<Direction<'_>> {
        let (oscillation, report) = (self.pass.oscillation, &self.pass.section.report);
        let mut directions = vec![
            Direction {
                motion: &oscillation.feed,
                label: "forwards",
                name: "offset along the feed",
                title: format!("along the feed: {} mm to both sides", short(oscillation.feed.amplitude_mm, 4)),
                color: theme::VIBRATION,
            },
            Direction {
                motion: &oscillation.axial,
                label: "away from the work",
                name: "offset along the tool axis",
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
                label: "to the right",
                name: "offset across both",
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

    fn panel(&self, direction: &Direction<'_>, labelled: bool) -> Panel {
        let pass = self.pass;
        let shown_deg = 360.0 * SHOWN_TURNS;
        let peak_mm = direction.motion.amplitude_mm.max(1e-6);
        let x = Axis::new("spindle angle from the first edge's passage", DEGREES, 0.0..shown_deg);
        let y = Axis::new(direction.label, MM, -1.45 * peak_mm..1.45 * peak_mm);
        let mut panel = Panel::new(&direction.title, x.labelled_if(labelled), y);
        if std::ptr::eq(direction.motion, &raw const pass.oscillation.axial) {
            self.shade_hold(&mut panel);
        }
        panel.endless(&Ink::line("no offset", theme::MUTED, 1.0), vec![(0.0, 0.0), (shown_deg, 0.0)]);
        self.mark_retreat(&mut panel);
        let offset = |deg: f64| direction.motion.offset_mm(pass.phase_turns(deg / 360.0));
        let passages = self.passages();
        for &(_, deg) in &passages {
            let passage = Ink::dashed("an edge points in the feed direction", theme::MUTED, 1.2);
            panel.upright(&passage, deg);
        }
        let curve = sampled(0.0, shown_deg, POINTS, |deg| (deg, offset(deg)));
        panel.path(&Ink::line(direction.name, direction.color, 3.0), curve);
        for &(edge, deg) in &passages {
            panel.dots(&Ink::dot(pass.edge_name(edge), pass.color(edge), 6.5), vec![(deg, offset(deg))]);
            if pass.edge_count() <= NAMED_EDGES {
                let top = panel.y.range.end;
                panel.label((deg, top), format!("E{}", edge + 1), theme::INK, Beside::INSIDE_TOP);
            }
        }
        panel
    }

    /// Edges with the angles at which they point in the feed direction.
    fn passages(&self) -> Vec<(usize, f64)> {
        let pass = self.pass;
        let behind = |edge: usize| pass.tool.turns_behind_first(edge);
        let edges = (0..pass.edge_count()).flat_map(|edge| [0.0, 1.0].map(|turn| (edge, behind(edge) + turn)));
        edges.filter(|(_, turns)| *turns < SHOWN_TURNS).map(|(edge, turns)| (edge, 360.0 * turns)).collect()
    }

    /// Where the protrusion is held; for how long in the first of the stretches that is long enough.
    fn shade_hold(&self, panel: &mut Panel) {
        let (middle, share) = self.pass.oscillation.axial.trough();
        let half = 0.5 * share * self.pass.period_turns();
        if half == 0.0 {
            return;
        }
        let ink = Ink::fill("protrusion held", theme::GOOD, 0.15);
        for turns in self.turns_at(middle) {
            let (from, to) = ((turns - half).max(0.0), (turns + half).min(SHOWN_TURNS));
            if from >= to {
                continue;
            }
            panel.shade(&ink, [(360.0 * from, 360.0 * to)]);
            if to - from > 0.15 {
                let at = (360.0 * from, panel.y.range.start);
                let text = format!("held for {} degrees", short(720.0 * half, 2));
                panel.label(at, text, theme::INK, Beside::INSIDE_BOTTOM);
            }
        }
    }

    /// Where the tool is furthest back.
    fn mark_retreat(&self, panel: &mut Panel) {
        if self.pass.oscillation.feed.amplitude_mm == 0.0 {
            return;
        }
        let (middle, _) = self.pass.oscillation.feed.trough();
        let ink = Ink::line("middle of the largest retreat", theme::BAD, 3.0);
        for turns in self.turns_at(middle).filter(|turns| (0.0..=SHOWN_TURNS).contains(turns)) {
            panel.upright(&ink, 360.0 * turns);
        }
    }
}
