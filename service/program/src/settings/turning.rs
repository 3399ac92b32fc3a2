//! Settings of lathes: the G-code system, and what turning cycles take from parameters of the control.

use serde::{Deserialize, Serialize};

/// Escape of a roughing pass where neither the program nor the profile states it, mm on the radius.
pub(crate) const ESCAPE_MM: f64 = 1.0;

/// The G-code system of a FANUC lathe or of a control like it, which a parameter chooses: the same numbers mean different
/// cycles and modes in each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GCodeSystem {
    /// `U` and `W` are incremental, `G90`, `G92` and `G94` are cycles, `G98` and `G99` feed modes. Haas lathes as well.
    A,
    /// `G90` and `G91`, `G94` and `G95` are modes, `G77`, `G78` and `G79` cycles.
    B,
    /// As B, but `G20`, `G21` and `G24` are cycles, `G70` and `G71` units, and `G72` to `G78` the cycles that are `G70` to
    /// `G76` elsewhere.
    C,
}

/// What turning cycles take from parameters of the control.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TurningSettings {
    /// How far the tool escapes from a roughing pass of `G71` and `G72` without `R`, mm on the radius (FANUC parameter 5133,
    /// Haas setting 73); 1 mm.
    pub escape_mm: Option<f64>,
    /// How far `G74` and `G75` without `R` go back after a peck, mm (FANUC parameter 5139, Haas setting 22); 1 mm.
    pub groove_return_mm: Option<f64>,
    /// How long before its end a thread of `G92` and `G76` is left at 45°, in tenths of its lead, 0 to 127, where the program
    /// does not say (FANUC parameter 5130, Haas settings 95 and 96); none.
    pub thread_chamfer_tenths: Option<u32>,
}
