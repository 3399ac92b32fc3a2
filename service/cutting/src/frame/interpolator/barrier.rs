//! What separates motions.

use feedwave_program::Spindle;
use serde::{Deserialize, Serialize};

use crate::functions::path_vibration::SectionBarrier;
use crate::functions::thread::ThreadRun;
use crate::functions::tool_oscillation::OscillationBarrier;
use crate::shared::track::PathBarrier;

/// What separates motions; the path is at rest at each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Barrier {
    /// Of a section that vibrates along the path.
    Vibration(SectionBarrier),
    /// Of a part of the path on which the tool oscillates.
    Oscillation(OscillationBarrier),
    /// Stand still.
    Dwell {
        /// For so long, s.
        duration_s: f64,
        /// Source line of the dwell.
        line: u32,
    },
    /// A threading pass.
    Thread(Box<ThreadRun>),
    /// The spindle's state changes.
    Spindle(Spindle),
    /// The program ends.
    End,
}

impl From<SectionBarrier> for Barrier {
    fn from(barrier: SectionBarrier) -> Self {
        Self::Vibration(barrier)
    }
}

impl From<OscillationBarrier> for Barrier {
    fn from(barrier: OscillationBarrier) -> Self {
        Self::Oscillation(barrier)
    }
}

impl PathBarrier for Barrier {
    fn starts_path(&self) -> bool {
        matches!(self, Self::Vibration(SectionBarrier::PartStart(_)) | Self::Oscillation(OscillationBarrier::Start(_)))
    }

    fn ends_path(&self) -> bool {
        matches!(
            self,
            Self::Vibration(SectionBarrier::End | SectionBarrier::PartEnd) | Self::Oscillation(OscillationBarrier::End)
        )
    }
}
