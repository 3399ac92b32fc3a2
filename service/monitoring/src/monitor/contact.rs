//! Contact of tool and work, by flag or from the signal.

use crate::config::ContactSource;
use serde::{Deserialize, Serialize};

/// Whether tool and work touch, with the hysteresis of detection.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Contact {
    pub touching: bool,
    /// Consecutive samples that say otherwise.
    contrary: u32,
}

impl Contact {
    /// Takes the flag of a sample, and its deviation from the baseline when it is valid.
    #[inline]
    pub fn update(&mut self, source: ContactSource, flag: Option<bool>, deviation: Option<[f64; 2]>) {
        match source {
            ContactSource::Flag => self.touching = flag.unwrap_or(self.touching),
            ContactSource::Detected { threshold, on_samples, off_samples } => {
                let Some([dx, dy]) = deviation else { return };
                let above = dx * dx + dy * dy > threshold * threshold;
                if above == self.touching {
                    self.contrary = 0;
                    return;
                }
                self.contrary += 1;
                if self.contrary >= if self.touching { off_samples } else { on_samples } {
                    self.touching = above;
                    self.contrary = 0;
                }
            }
        }
    }
}
