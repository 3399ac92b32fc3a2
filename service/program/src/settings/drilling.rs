//! Settings of the drilling, boring and tapping cycles.

use serde::{Deserialize, Serialize};

/// Retract of a peck where the profile of a FANUC control does not state it, mm.
pub(crate) const FANUC_RETRACT_MM: f64 = 1.0;

/// Retract of a peck of LinuxCNC, mm: 0.010 inch.
pub(crate) const LINUXCNC_RETRACT_MM: f64 = 0.254;

/// Whose drilling cycles a control has; of no effect in LinuxCNC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DrillingStyle {
    /// `K` repeats; on a lathe `G83` to `G85` along Z and `G87` to `G89` along X, with `R` from the level of the start.
    #[default]
    Fanuc,
    /// `L` repeats, `K` belongs to pecks; a lathe has the cycles of a mill, along Z.
    Haas,
}

/// Where a pecking tool goes between two pecks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PeckReturn {
    /// Out of the hole, to the R level.
    RLevel,
    /// Back by the retract of chip breaking.
    Back,
}

/// Direction in which the oriented tool is moved off the wall of a bore by `Q` of `G76` and `G87`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BoringShift {
    /// Along the first axis of the plane: +X in `G17`.
    FirstPlus,
    /// Against the first axis of the plane.
    FirstMinus,
    /// Along the second axis of the plane: +Y in `G17`.
    SecondPlus,
    /// Against the second axis of the plane.
    SecondMinus,
}

/// What a machine profile says about drilling, boring and tapping cycles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DrillingSettings {
    /// Whose cycles these are.
    pub style: DrillingStyle,
    /// How far `G73` moves back between pecks, mm (FANUC parameter 5114, Haas setting 22); 1 mm, and 0.254 mm in LinuxCNC.
    pub chip_break_retract_mm: Option<f64>,
    /// How far above the last depth the rapid of `G83` ends, mm (FANUC parameter 5115, Haas setting 22); as above.
    pub peck_clearance_mm: Option<f64>,
    /// How far above the R level `G83` goes between pecks, mm (Haas setting 52).
    pub peck_lift_mm: f64,
    /// Where a lathe's `G83` and `G87` with `Q` go between pecks; they are refused without it.
    pub lathe_peck: Option<PeckReturn>,
    /// `G84` and `G74` are synchronised with the spindle without `M29` as well. On Haas controls they always are.
    pub rigid_tapping: bool,
    /// Where a synchronised tap with `Q` goes between pecks; refused without it.
    pub tap_peck: Option<PeckReturn>,
    /// Direction of the `Q` of `G76` and `G87`; refused without it.
    pub boring_shift: Option<BoringShift>,
    /// `R` of the cycles of a FANUC lathe in G-code system A is a level, not a distance from the level of the start.
    pub lathe_r_is_level: bool,
}
