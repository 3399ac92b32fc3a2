//! How far a live run is: an estimate from the plan at the programmed feed and the changes of the feed so far.

use feedwave_contract::proto::RunProgress;
use feedwave_store::RunOverride;

/// Share of the time that an estimate does not go beyond: only the last setpoint ends a run.
const MOST: f64 = 0.999;

/// The machining time of a run in terms of its plan.
#[derive(Clone, Debug)]
pub(crate) struct Course {
    period_s: f64,
    /// Machining time at the programmed feed, s.
    planned_s: f64,
    /// Changes of the feed that are in force or over.
    passed: usize,
    /// Setpoint from which the present feed acts, and the planned time up to there, s.
    from: u64,
    from_s: f64,
    ratio: f64,
}

impl Course {
    /// The beginning of a run with this interpolation period, of a plan that takes so long at the programmed feed.
    pub(crate) fn new(period_s: f64, planned_s: f64) -> Self {
        let planned_s = if planned_s.is_finite() { planned_s.max(0.0) } else { 0.0 };
        Self { period_s, planned_s, passed: 0, from: 0, from_s: 0.0, ratio: 1.0 }
    }

    /// Ratio of the feed at the setpoint that was taken last.
    pub(crate) const fn ratio(&self) -> f64 {
        self.ratio
    }

    /// Planned time of setpoints before `index`, which is not before the present feed, s.
    fn planned_at(&self, index: u64) -> f64 {
        self.from_s + index.saturating_sub(self.from) as f64 * self.period_s * self.ratio
    }

    /// How far the run is when `taken` setpoints were taken of the `sent` that were handed out, with these changes of the
    /// feed. A rapid or a dwell counts as if the feed acted on it as well.
    pub(crate) fn progress(
        &mut self,
        changes: &[RunOverride],
        taken: u64,
        sent: u64,
        total: Option<u64>,
    ) -> RunProgress {
        while let Some(change) = changes.get(self.passed).filter(|change| change.setpoint_index < taken) {
            self.from_s = self.planned_at(change.setpoint_index);
            self.from = change.setpoint_index;
            self.ratio = change.ratio;
            self.passed += 1;
        }
        let (ratio, left_s) = match total {
            Some(0) => (1.0, Some(0.0)),
            Some(total) => (taken as f64 / total as f64, Some(total.saturating_sub(taken) as f64 * self.period_s)),
            None => {
                let over_s = self.planned_at(taken);
                let share = if self.planned_s > 0.0 { (over_s / self.planned_s).min(MOST) } else { 0.0 };
                let left_s = (self.ratio > 0.0).then(|| (self.planned_s - over_s).max(0.0) / self.ratio);
                (share, left_s)
            }
        };
        RunProgress {
            taken,
            sent,
            setpoint_count: total,
            ratio,
            remaining_s: left_s,
            // A product with a rounded period would show its rounding.
            machining_s: (taken as f64 * (self.period_s * 1e6).round()) / 1e6,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(number: u64, setpoint_index: u64, ratio: f64) -> RunOverride {
        RunOverride { number, setpoint_index, ratio, cause: String::new() }
    }

    #[test]
    fn time_left_follows_the_feed_at_the_setpoint_taken() {
        // Ten seconds at a millisecond each.
        let mut course = Course::new(1e-3, 10.0);
        let start = course.progress(&[], 0, 64, None);
        assert_eq!((start.ratio, start.remaining_s, course.ratio()), (0.0, Some(10.0), 1.0));
        // The change is decided, and acts from a setpoint on that was not taken yet.
        let changes = [change(0, 2_000, 0.5), change(1, 6_000, 0.0)];
        let before = course.progress(&changes, 2_000, 2_500, None);
        assert_eq!((before.ratio, before.remaining_s, course.ratio()), (0.2, Some(8.0), 1.0));
        let half = course.progress(&changes, 4_000, 6_500, None);
        assert!((half.ratio - 0.3).abs() < 1e-12, "{half:?}");
        assert!((half.remaining_s.unwrap() - 14.0).abs() < 1e-9, "{half:?}");
        // A held feed has no end in sight.
        let held = course.progress(&changes, 6_200, 6_500, None);
        assert!((held.ratio - 0.4).abs() < 1e-12 && held.remaining_s.is_none(), "{held:?}");
    }

    #[test]
    fn it_is_the_same_whoever_looked_in_between() {
        let changes = [change(0, 10, 0.5), change(1, 30, 1.5), change(2, 30, 0.9)];
        let mut often = Course::new(1e-3, 1.0);
        for taken in 0..100 {
            let mut once = Course::new(1e-3, 1.0);
            let (a, b) = (often.progress(&changes, taken, 100, None), once.progress(&changes, taken, 100, None));
            assert_eq!((a, often.ratio()), (b, once.ratio()));
        }
    }

    #[test]
    fn an_estimate_never_says_that_it_is_over() {
        let mut course = Course::new(1e-3, 1.0);
        assert_eq!(course.progress(&[], 5_000, 5_000, None).ratio, MOST);
        let known = course.progress(&[], 5_000, 10_000, Some(10_000));
        assert_eq!((known.ratio, known.remaining_s), (0.5, Some(5.0)));
        assert_eq!(course.progress(&[], 10_000, 10_000, Some(10_000)).ratio, 1.0);
        assert_eq!(Course::new(1e-3, f64::NAN).progress(&[], 1, 1, None).ratio, 0.0);
    }
}
