//! Limits and steps of the decisions (docs/functions/adaptive-feed.md, "Decisions").

use serde::{Deserialize, Serialize};

/// Which process property the feed rule and the milling rule compare with their limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Property {
    /// Largest deviation from the baseline, max D: mm, or mm/s² with acceleration sensors.
    Deviation,
    /// Amplitude of the dominant spectral line, in the unit of the deviation (claims 3, 5, 7).
    VibrationAmplitude,
    /// Frequency of the dominant spectral line in Hz (claims 3, 5, 7).
    VibrationFrequency,
}

/// Inclusive bounds of an override, as factors (1 = 100 %).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Smallest factor.
    pub lower: f64,
    /// Largest factor.
    pub upper: f64,
}

/// Feed rule: inside `lower..=upper` nothing changes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FeedRule {
    /// D*: below it the feed goes up. Unit of the property.
    pub lower: f64,
    /// D**: above it the feed goes down. Unit of the property.
    pub upper: f64,
    /// Step p as a fraction of the current feed.
    pub step: f64,
}

impl FeedRule {
    /// Step by default.
    pub const STEP: f64 = 0.05;
}

/// Spindle rule of the process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum SpindleRule {
    /// The spindle speed is left alone.
    None,
    /// The workpiece rotates: the mean angle of the tool's deflection decides.
    Turning {
        /// α* in degrees: below it the speed goes up.
        lower_deg: f64,
        /// α** in degrees: above it the speed goes down.
        upper_deg: f64,
        /// Step q as a fraction of the current speed.
        step: f64,
        /// Shortest mean resultant (0..1) of the window's angles for which their mean means anything.
        min_concentration: f64,
    },
    /// The tool rotates: from the limit on, the speed comes from the table.
    Milling {
        /// D***, unit of the property.
        limit: f64,
        /// Speeds by band.
        table: SpindleTable,
    },
}

impl SpindleRule {
    /// Step in turning by default.
    pub const STEP: f64 = 0.05;
    /// Shortest mean resultant in turning by default.
    pub const MIN_CONCENTRATION: f64 = 0.5;
}

/// One band of the spindle table: a current speed in (`above_rev_per_min`, `up_to_rev_per_min`] is changed to `spindle_rev_per_min`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TableRow {
    /// B of the row before, rev/min, exclusive.
    pub above_rev_per_min: f64,
    /// B of this row, rev/min, inclusive.
    pub up_to_rev_per_min: f64,
    /// F, rev/min.
    pub spindle_rev_per_min: f64,
}

/// Spindle table (B_j, F_j): bands that follow each other without gap or overlap.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SpindleTable {
    /// Bands by rising speed.
    pub rows: Vec<TableRow>,
}

impl SpindleTable {
    /// The table whose bands end at the given B_j, the first starting at 0, each with its F_j.
    pub fn from_pairs(pairs: &[(f64, f64)]) -> Self {
        let starts = std::iter::once(0.0).chain(pairs.iter().map(|pair| pair.0));
        let rows = starts.zip(pairs);
        Self {
            rows: rows
                .map(|(above_rev_per_min, &(up_to_rev_per_min, spindle_rev_per_min))| TableRow {
                    above_rev_per_min,
                    up_to_rev_per_min,
                    spindle_rev_per_min,
                })
                .collect(),
        }
    }

    /// Speed for a current speed; `None` outside all bands.
    pub fn spindle_rev_per_min(&self, current_rev_per_min: f64) -> Option<f64> {
        let row = self
            .rows
            .iter()
            .find(|row| current_rev_per_min > row.above_rev_per_min && current_rev_per_min <= row.up_to_rev_per_min)?;
        Some(row.spindle_rev_per_min)
    }
}

/// What happens when telemetry stops while cutting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Fallback {
    /// Overrides stay as they are.
    Hold,
    /// Both overrides go to 100 %.
    Full,
    /// The machine stops.
    Stop,
}

/// What happens when the property stays above its limit at the lower feed bound (docs/functions/adaptive-feed.md,
/// "Escalation").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Escalation {
    /// After so many windows in a row; at least 1.
    pub windows: u32,
    /// What then.
    pub action: EscalationAction,
}

impl Default for Escalation {
    fn default() -> Self {
        Self { windows: 5, action: EscalationAction::Hold }
    }
}

/// How an escalation ends the cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum EscalationAction {
    /// The feed is held: its override is 0 until [`crate::Event::Resume`].
    Hold,
    /// The machine stops.
    Stop,
}

/// Everything a decision depends on besides what was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rules {
    /// What is compared.
    pub property: Property,
    /// Feed rule.
    pub feed: FeedRule,
    /// Spindle rule.
    pub spindle: SpindleRule,
    /// Bounds of the feed override.
    pub feed_bounds: Bounds,
    /// Bounds of the spindle override.
    pub spindle_bounds: Bounds,
    /// On silence while cutting.
    pub fallback: Fallback,
    /// On a property that stays above its limit at the lower feed bound; `None`: the cut goes on.
    pub escalation: Option<Escalation>,
}

impl Default for Rules {
    /// Defaults and example limits of docs/functions/adaptive-feed.md, "Settings": D* = 0.003 mm, D** = 0.01 mm,
    /// p = 5 %, escalation after 5 windows.
    fn default() -> Self {
        Self {
            property: Property::Deviation,
            feed: FeedRule { lower: 0.003, upper: 0.01, step: FeedRule::STEP },
            spindle: SpindleRule::None,
            feed_bounds: Bounds { lower: 0.1, upper: 1.5 },
            spindle_bounds: Bounds { lower: 0.5, upper: 1.2 },
            fallback: Fallback::Hold,
            escalation: Some(Escalation::default()),
        }
    }
}
