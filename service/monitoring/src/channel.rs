//! One sensor channel: removes wrong values and notices a stuck sensor (docs/functions/adaptive-feed.md, "Signals").

use crate::config::{Quality, Sensors};
use serde::{Deserialize, Serialize};

/// What a raw value is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Worth {
    Good,
    NonFinite,
    OutOfRange,
    Spike,
    Stuck,
}

/// History of one channel, in its sensor's unit.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(crate) struct Channel {
    last: f64,
    /// How often `last` has come in a row.
    repeats: u32,
    good: Option<f64>,
    /// Spikes in a row.
    spikes: u32,
}

impl Channel {
    #[inline]
    pub fn judge(&mut self, value: f64, sensors: &Sensors, quality: &Quality) -> Worth {
        if !value.is_finite() {
            return Worth::NonFinite;
        }
        if value == self.last && self.repeats > 0 {
            self.repeats = self.repeats.saturating_add(1);
        } else {
            self.repeats = 1;
            self.last = value;
        }
        if self.repeats >= quality.stuck_samples {
            return Worth::Stuck;
        }
        if value < sensors.min || value > sensors.max {
            return Worth::OutOfRange;
        }
        if let (Some(filter), Some(good)) = (quality.spikes, self.good)
            && (value - good).abs() > filter.max_step
            && self.spikes < filter.max_run
        {
            self.spikes += 1;
            return Worth::Spike;
        }
        self.spikes = 0;
        self.good = Some(value);
        Worth::Good
    }

    /// Forgets what came before a gap, where a step proves nothing.
    pub fn interrupt(&mut self) {
        self.good = None;
        self.spikes = 0;
    }
}
