//! What turning cycles leave for those after them.

use serde::{Deserialize, Serialize};

/// A turning, facing or grooving cycle, by what it does; its code depends on the control.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum TurningCycle {
    /// `G70`: along the contour.
    Finish,
    /// `G71`: roughing along Z.
    Turn(Pockets),
    /// `G72`: roughing along X.
    Face(Pockets),
    /// `G73`: roughing along the contour.
    Pattern,
    /// `G74`: pecks along Z.
    FaceGroove,
    /// `G75`: pecks along X.
    Groove,
    /// `G90` of system A.
    SingleTurn,
    /// `G94` of system A.
    SingleFace,
}

impl TurningCycle {
    /// Whether it follows a contour, which is programmed elsewhere than in its block.
    pub(crate) const fn has_contour(self) -> bool {
        matches!(self, Self::Finish | Self::Turn(_) | Self::Face(_) | Self::Pattern)
    }
}

/// Which pockets LinuxCNC cuts; all on other controls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Pockets {
    /// `G71`
    All,
    /// `G71.1`
    Without,
    /// `G71.2`: what `G71.1` has left.
    Only,
}

/// Which single cycle is in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum SingleCycle {
    /// `G90` of system A.
    Turn,
    /// `G94` of system A.
    Face,
}

/// On which side of a contour the stock is, across the passes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Roughed {
    /// Numbers of the first and the last block of the contour.
    pub(crate) blocks: [u32; 2],
    /// The passes went along X.
    pub(crate) facing: bool,
    /// 1 or −1, along the axis across the passes.
    pub(crate) outward: f64,
}

/// Modal words of turning cycles, mm, on the radius where they are along X.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct TurningModes {
    /// X and Z of the single cycle.
    pub(crate) end: [f64; 2],
    /// Start of its cut less the end: along X in turning, along Z in facing.
    pub(crate) taper_mm: f64,
    /// Depth of a pass of `G71` and `G72`.
    pub(crate) depth_mm: Option<f64>,
    /// How far the tool escapes from a pass of them.
    pub(crate) escape_mm: Option<f64>,
    /// What the first pass of `G73` leaves, along X and Z.
    pub(crate) relief_mm: Option<[f64; 2]>,
    /// Passes of `G73`.
    pub(crate) passes: Option<u32>,
    /// How far `G74` and `G75` go back after a peck.
    pub(crate) groove_return_mm: Option<f64>,
    /// Settings whose default has been reported: escape, return, chamfer of threads.
    pub(crate) default_reported: [bool; 3],
    /// What the last roughing cycle says of the side of its contour on which the stock is.
    pub(crate) roughed: Option<Roughed>,
    /// That the plane in force has no turning cycles has been reported.
    pub(crate) plane_reported: bool,
}
