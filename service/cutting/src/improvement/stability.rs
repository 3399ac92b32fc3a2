//! Whether the cuts of a section are stable at their spindle speeds, where the lobes of the tool are stated.

use std::sync::Arc;

use feedwave_monitoring::{StabilityRobustness, most_stable_speed, stability_robustness, stable_speeds};

use super::ImprovementGoals;
use crate::SectionReport;
use crate::shared::wording::{decimal, round_down};

/// Limits of stability over the spindle speed, and the depth that is cut.
#[derive(Clone, Debug, PartialEq)]
pub struct StabilityGoal {
    /// Spindle speeds, rev/min, ascending, with the limit, mm, straight between neighbours; `None` where nothing chatters.
    pub chart: Arc<[(f64, Option<f64>)]>,
    /// Depth of cut, in turning its width, mm.
    pub depth_mm: f64,
    /// Share by which the depth may be smaller or larger, 0 to below 1.
    pub depth_tolerance: f64,
}

impl StabilityGoal {
    /// What is stable between two speeds at all of them, rev/min, when each may be off by a tolerance.
    pub(super) fn judge(&self, speeds_rev_per_min: [f64; 2], speed_tolerance: f64) -> Judged {
        let [slowest, fastest] = speeds_rev_per_min;
        let (low, high) = (slowest * (1.0 - speed_tolerance), fastest * (1.0 + speed_tolerance));
        let (middle, share) = (0.5 * (low + high), (high - low) / (high + low));
        // One speed keeps the digits of its tolerance.
        let (middle, share) = if slowest == fastest { (slowest, speed_tolerance) } else { (middle, share) };
        let robustness = stability_robustness(&self.chart, middle, share, self.depth_mm, self.depth_tolerance);
        Judged {
            speeds_rev_per_min,
            range_rev_per_min: [low, high],
            largest_depth_mm: self.largest_depth_mm(),
            robustness,
        }
    }

    fn largest_depth_mm(&self) -> f64 {
        self.depth_mm * (1.0 + self.depth_tolerance)
    }

    /// The speeds between two, rev/min, that are stable.
    pub(super) fn stable_speeds(&self, speed_tolerance: f64, range: [f64; 2]) -> Vec<[f64; 2]> {
        stable_speeds(&self.chart, speed_tolerance, self.largest_depth_mm(), range)
    }

    /// What there is in place of a stable speed between two, rev/min.
    pub(super) fn best_text(&self, speed_tolerance: f64, range: [f64; 2]) -> String {
        let [low, high] = range.map(|speed| decimal(speed, 0));
        match most_stable_speed(&self.chart, speed_tolerance, range) {
            Some((speed, Some(limit_mm))) => format!(
                "no speed from {low} to {high} rev/min is stable: at the best one, {} rev/min, the limit is {} mm at worst, {} of the \
                 largest depth of {} mm",
                decimal(speed, 0),
                decimal(round_down(limit_mm, 4), 4),
                decimal(round_down(limit_mm / self.largest_depth_mm(), 3), 3),
                decimal(self.largest_depth_mm(), 4)
            ),
            _ => format!("the lobes have no speed from {low} to {high} rev/min with its tolerance"),
        }
    }
}

/// What was judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Judged {
    /// The slowest and the fastest speed, rev/min.
    speeds_rev_per_min: [f64; 2],
    /// The same with their tolerance.
    range_rev_per_min: [f64; 2],
    largest_depth_mm: f64,
    /// `None` where the lobes do not have all of these speeds.
    robustness: Option<StabilityRobustness>,
}

impl Judged {
    /// Whether it is stable for all values within the tolerances. What is not judged is not.
    pub(super) fn is_stable(&self) -> bool {
        self.robustness.is_some_and(|it| it.worst_margin.is_none_or(|margin| margin >= 1.0))
    }

    /// The limit at worst by the largest depth; `None` where nothing chatters, or it is not judged.
    pub(super) fn margin(&self) -> Option<f64> {
        self.robustness.and_then(|it| it.worst_margin)
    }

    /// For the worst of several: what is not judged first, and what never chatters last.
    fn rank(&self) -> f64 {
        self.robustness.map_or(f64::NEG_INFINITY, |it| it.worst_margin.unwrap_or(f64::INFINITY))
    }

    /// What was judged, as a clause.
    pub(super) fn text(&self) -> String {
        let [slowest, fastest] = self.speeds_rev_per_min.map(|speed| decimal(speed, 1));
        let at = if slowest == fastest { slowest } else { format!("{slowest} to {fastest}") };
        let Some(robustness) = self.robustness else {
            let [low, high] = self.range_rev_per_min.map(|speed| decimal(speed, 1));
            return format!(
                "the lobes do not have all speeds from {low} to {high} rev/min, so that stability is not judged"
            );
        };
        let (Some(limit_mm), Some(margin)) = (robustness.least_limit_mm, robustness.worst_margin) else {
            return format!("at {at} rev/min nothing chatters");
        };
        let (limit, margin) = (decimal(round_down(limit_mm, 4), 4), decimal(round_down(margin, 3), 3));
        if self.is_stable() {
            format!("at {at} rev/min stable with a margin of {margin}, {limit} mm at worst")
        } else {
            let depth = decimal(self.largest_depth_mm, 4);
            format!("at {at} rev/min not stable: {limit} mm at worst, {margin} of the largest depth of {depth} mm")
        }
    }
}

/// The worst of these sections; `None` without lobes, or where nothing is cut.
pub(super) fn of(sections: &[&SectionReport], goals: &ImprovementGoals) -> Option<Judged> {
    let goal = goals.stability.as_ref()?;
    let spans = sections.iter().flat_map(|section| &section.chip_spans);
    let mut speeds: Vec<f64> = spans.map(|span| span.spindle_rev_per_min).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    let changing =
        sections.iter().filter_map(|section| section.surface_speed.as_ref()).map(|it| it.spindle_rev_per_min);
    let ranges = speeds.iter().map(|speed| [*speed; 2]).chain(changing);
    let judged = ranges.map(|range| goal.judge(range, goals.vibration.speed_tolerance));
    judged.min_by(|a, b| a.rank().total_cmp(&b.rank()))
}
