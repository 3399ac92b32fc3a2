//! What separates motions.

use feedwave_program::Spindle;
use serde::{Deserialize, Serialize};

use super::functions::FunctionBarrier;
use crate::shared::track::PathBarrier;

/// What separates motions; the path is at rest at each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Barrier {
    /// Of a machining function.
    Function(FunctionBarrier),
    /// Stand still.
    Dwell {
        /// For so long, s.
        duration_s: f64,
        /// Source line of the dwell.
        line: u32,
        /// Work offset of X that the program has then, mm, where it may be another than that of the move before.
        x_offset_mm: Option<f64>,
    },
    /// Rest on the grid, so that the resting point is a setpoint.
    Align,
    /// The spindle's state changes.
    Spindle(Spindle),
    /// The program ends.
    End,
}

impl<T: Into<FunctionBarrier>> From<T> for Barrier {
    fn from(barrier: T) -> Self {
        Self::Function(barrier.into())
    }
}

impl PathBarrier for Barrier {
    fn starts_path(&self) -> bool {
        matches!(self, Self::Function(barrier) if barrier.starts_path())
    }

    fn ends_path(&self) -> bool {
        matches!(self, Self::Function(barrier) if barrier.ends_path())
    }

    fn moves_tool(&self) -> bool {
        matches!(self, Self::Function(barrier) if barrier.moves_tool())
    }
}
