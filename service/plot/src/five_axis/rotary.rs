//! Rotary axes over time, as programmed and thinned: the whole program, then a stretch of the path close up with its
//! velocities.

use std::ops::Range;

use super::super::dynamics::{both_limits, with_limits};
use super::super::figure::{Axis, DEG_PER_S, DEGREES, Figure, Layout, MM, Panel, Place, SECONDS, extent, padded};
use super::super::theme::Ink;
use super::{FiveAxisPlots, Plan};

pub(super) struct RotaryPicture<'a> {
    pub(super) program: &'a str,
    pub(super) plots: &'a FiveAxisPlots,
}

/// Range of all points, with some air.
fn joined(curves: &[Vec<Place>], of: fn(&Place) -> f64, share: f64) -> Range<f64> {
    extent(curves.iter().flatten().map(of)).map_or(0.0..1.0, |(low, high)| padded(low, high, share))
}

impl RotaryPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let mut subtitle = self.program.to_owned();
        if let Some(thinning) = &self.plots.thinning {
            let [before_s, after_s] = thinning.times_s;
            let [read, dropped] = thinning.blocks;
            subtitle.push_str(&format!(
                " \u{b7} {dropped} of {read} blocks dropped \u{b7} the thinned cuts take {before_s:.1} s as programmed, \
                 {after_s:.1} s thinned"
            ));
        }
        let columns = [0, 1].map(|axis| {
            let parts = [self.whole(axis), self.close(axis), self.velocity(axis)];
            (1.0, Layout::column(parts.into()))
        });
        Figure::new("rotary-axes", "Rotary axes over time", subtitle, Layout::Row(columns.into())).with_height(1_180)
    }

    /// A curve of each plan.
    fn panel(
        &self,
        title: String,
        (mut x, mut y): (Axis, Axis),
        range: Option<Range<f64>>,
        curve: impl Fn(&Plan) -> Vec<Place>,
    ) -> Panel {
        let curves: Vec<_> = self.plots.plans().map(|(plan, _)| curve(plan)).collect();
        x.range = joined(&curves, |point| point.0, 0.0);
        y.range = range.unwrap_or_else(|| joined(&curves, |point| point.1, 0.08));
        let mut panel = Panel::new(title, x, y);
        for (points, (_, ink)) in curves.into_iter().zip(self.plots.plans()) {
            panel.path_beyond(&ink, points, "the swing before and after the cuts");
        }
        panel
    }

    fn whole(&self, axis: usize) -> Panel {
        let letter = self.plots.setup.letters[axis];
        let axes = (Axis::new("time", SECONDS, 0.0..1.0), Axis::new("angle", DEGREES, 0.0..1.0));
        // Where it swings to before and after the cuts would make them small.
        let extents = self.plots.plans().map(|(plan, _)| plan.cut_extents_deg[axis]);
        let extent = extents.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let range = extent.filter(|(low, high)| low <= high).map(|(low, high)| padded(low, high, 0.12));
        let mut panel = self.panel(format!("{letter} axis"), axes, range, |plan| plan.angles_deg[axis].points());
        if let Some(thinning) = &self.plots.thinning {
            let (before, after) = (thinning.reversals_before[axis], thinning.reversals_after[axis]);
            let names: Vec<_> = self.plots.plans().map(|(_, ink)| ink.name).collect();
            let thinned = names.last().map_or("thinned", |name| name.as_ref());
            // The other method is between both.
            let other = thinning.reversals_by_other_method.filter(|_| names.len() > 2);
            let other = other.map_or_else(String::new, |other| format!(", {} {}", other[axis], names[1]));
            panel.note(format!("reversals inside the cuts: {before} as programmed{other}, {after} {thinned}"));
        }
        let plans: Vec<_> = self.plots.plans().map(|(plan, ink)| (plan.reversals[axis].count, ink.name)).collect();
        let counts: Vec<_> = plans.iter().map(|(count, name)| format!("{count} {name}")).collect();
        panel.note(format!("in the whole program, turns between cuts included: {}", counts.join(", ")));
        panel
    }

    fn close(&self, axis: usize) -> Panel {
        let letter = self.plots.setup.letters[axis];
        let lines = &self.plots.setup.close_lines;
        let title = format!("{letter} close up: lines {} to {}", lines.start(), lines.end());
        let x = Axis::new("path of the tool centre point", MM, 0.0..1.0);
        self.panel(title, (x, Axis::new("angle", DEGREES, 0.0..1.0)), None, |plan| {
            plan.close.iter().map(|sample| (sample.path_mm, sample.angles_deg[axis])).collect()
        })
    }

    fn velocity(&self, axis: usize) -> Panel {
        let letter = self.plots.setup.letters[axis];
        let title = format!("velocity of {letter} in the same stretch of the path");
        let x = Axis::new("time from its start", SECONDS, 0.0..1.0);
        let mut panel = self.panel(title, (x, Axis::new("velocity", DEG_PER_S, 0.0..1.0)), None, |plan| {
            let start_s = plan.close.first().map_or(0.0, |sample| sample.time_s);
            let pairs = plan.close.windows(2);
            pairs
                .map(|pair| {
                    let travel_deg = pair[1].angles_deg[axis] - pair[0].angles_deg[axis];
                    (pair[1].time_s - start_s, travel_deg / (pair[1].time_s - pair[0].time_s))
                })
                .collect()
        });
        let limits = [(self.plots.setup.max_velocities_deg_per_s[axis], letter.to_string())];
        panel.y.range = with_limits(&panel.y.range, &limits);
        both_limits(&mut panel, &Ink::limit("limit of the axis"), &limits);
        panel
    }
}
