//! Quantities of a condition over feed and spindle speed.

use serde::{Deserialize, Serialize};

use super::curve::monotone_value;

/// Most points of a condition table along each of its two directions.
pub const MAX_TABLE_POINTS: usize = 32;

/// A quantity of a condition that a table decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TableQuantity {
    /// Amplitude in the feed direction, mm.
    FeedAmplitude,
    /// Axial amplitude, mm.
    AxialAmplitude,
    /// Amplitude across, mm.
    CrossAmplitude,
    /// Hold share of the axial waveform, where it is a held peak.
    AxialHoldShare,
}

/// How a table is read between its points. Beyond its ends the value at the end holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Straight between neighbours.
    #[default]
    Linear,
    /// By a monotone cubic: smooth, without overshoot.
    Monotone,
}

/// A quantity over feed and spindle speed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConditionTable {
    /// What it decides.
    pub quantity: TableQuantity,
    /// How it is read between its points.
    #[serde(default)]
    pub interpolation: Interpolation,
    /// Feeds, mm/min, strictly increasing: 1 to [`MAX_TABLE_POINTS`].
    pub feed_mm_per_min: Vec<f64>,
    /// Spindle speeds, rev/min, strictly increasing: 1 to [`MAX_TABLE_POINTS`].
    pub spindle_rev_per_min: Vec<f64>,
    /// The values: for each spindle speed those at every feed.
    pub values: Vec<Vec<f64>>,
}

impl ConditionTable {
    /// What makes the table unusable, if anything.
    #[must_use]
    pub fn problem(&self) -> Option<&'static str> {
        let increases = |axis: &[f64]| {
            (1..=MAX_TABLE_POINTS).contains(&axis.len())
                && axis.iter().all(|value| value.is_finite())
                && axis.windows(2).all(|pair| pair[0] < pair[1])
        };
        if !increases(&self.feed_mm_per_min) || !increases(&self.spindle_rev_per_min) {
            return Some("a table has 1 to 32 strictly increasing feeds and spindle speeds");
        }
        let is_whole = self.values.len() == self.spindle_rev_per_min.len()
            && self.values.iter().all(|row| row.len() == self.feed_mm_per_min.len());
        let is_finite = self.values.iter().flatten().all(|value| value.is_finite());
        (!(is_whole && is_finite)).then_some("a table has a finite value for every feed at every spindle speed")
    }

    /// The value at a feed and a spindle speed; beyond the ends that at the end.
    #[must_use]
    pub fn value(&self, feed_mm_per_min: f64, spindle_rev_per_min: f64) -> f64 {
        let read = |abscissae: &[f64], values: &[f64], x: f64| match self.interpolation {
            Interpolation::Linear => linear_value(abscissae, values, x),
            Interpolation::Monotone => monotone_value(abscissae, values, x),
        };
        let column: Vec<f64> =
            self.values.iter().map(|row| read(&self.feed_mm_per_min, row, feed_mm_per_min)).collect();
        read(&self.spindle_rev_per_min, &column, spindle_rev_per_min)
    }
}

fn linear_value(abscissae: &[f64], values: &[f64], x: f64) -> f64 {
    let count = abscissae.len().min(values.len());
    let Some(last) = count.checked_sub(1) else { return 0.0 };
    let after = abscissae[..count].partition_point(|&start| start <= x);
    if after == 0 {
        return values[0];
    }
    if after > last {
        return values[last];
    }
    let share = (x - abscissae[after - 1]) / (abscissae[after] - abscissae[after - 1]);
    values[after - 1] + share * (values[after] - values[after - 1])
}
