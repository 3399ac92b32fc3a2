//! What drilling, boring and tapping cycles remember between blocks.

use serde::{Deserialize, Serialize};

use crate::SourceSpan;

/// A cycle as the program calls it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DrillingCycle {
    cycle: Cycle,
    /// Line of the block with its code.
    pub line: u32,
}

/// A pattern of holes that Haas mills have a code for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BoltPattern {
    /// `G70`
    Circle,
    /// `G71`
    Arc,
    /// `G72`
    Line,
}

impl BoltPattern {
    /// The code as written.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Circle => "G70",
            Self::Arc => "G71",
            Self::Line => "G72",
        }
    }
}

impl DrillingCycle {
    /// Its code as written, such as `G83`.
    #[must_use]
    pub const fn code(&self) -> &'static str {
        self.cycle.name()
    }
}

/// A drilling, boring or tapping cycle, by its code on a mill.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Cycle {
    /// `G81`
    Drill,
    /// `G82`
    DrillDwell,
    /// `G83`
    Peck,
    /// `G73`
    ChipBreak,
    /// `G84`
    Tap,
    /// `G74`
    TapLeft,
    /// `G85`
    Bore,
    /// `G86`
    BoreStop,
    /// `G87`
    BackBore,
    /// `G88`
    BoreManual,
    /// `G89`
    BoreDwell,
    /// `G76`
    FineBore,
}

impl Cycle {
    /// The code as written.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Drill => "G81",
            Self::DrillDwell => "G82",
            Self::Peck => "G83",
            Self::ChipBreak => "G73",
            Self::Tap => "G84",
            Self::TapLeft => "G74",
            Self::Bore => "G85",
            Self::BoreStop => "G86",
            Self::BackBore => "G87",
            Self::BoreManual => "G88",
            Self::BoreDwell => "G89",
            Self::FineBore => "G76",
        }
    }
}

/// Drilling, boring and tapping cycles. Lengths are mm, X a radius.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Drilling {
    /// The cycle in force.
    pub(crate) cycle: Option<Cycle>,
    /// Line of its code.
    pub(crate) line: u32,
    /// The first block that could not be carried out, and after which no word of the cycle came: where further holes that cannot
    /// are counted.
    pub(crate) refused: Option<SourceSpan>,
    /// `G99`: cycles return to the R level.
    pub(crate) to_r: bool,
    /// Where the last hole of the mode returned to, as `to_r`.
    pub(crate) returned_to_r: Option<bool>,
    /// Level of the start of the mode along the drilling axis: work coordinate in LinuxCNC, elsewhere machine coordinate.
    pub(crate) start_level: Option<f64>,
    /// Index of the drilling axis of the last block that drilled.
    pub(crate) axis: Option<u8>,
    /// `R` and the bottom: as written in LinuxCNC, elsewhere work coordinates along the drilling axis.
    pub(crate) r_level: Option<f64>,
    pub(crate) bottom: Option<f64>,
    /// `Q`
    pub(crate) q: Option<f64>,
    /// `I`, `J`, `K` where they are words of the cycle.
    pub(crate) ijk: [Option<f64>; 3],
    /// `P`, s.
    pub(crate) dwell_s: Option<f64>,
    /// Haas: how many times faster a rigid tap goes out than in (`J`); 0 as fast.
    pub(crate) tap_retract: u32,
    /// That the retract of pecks is the default was reported: of `G83`, of `G73`.
    pub(crate) default_reported: [bool; 2],
}

impl Drilling {
    /// The cycle in force, as the program calls it.
    pub(crate) fn called(&self) -> Option<DrillingCycle> {
        self.cycle.map(|cycle| DrillingCycle { cycle, line: self.line })
    }

    /// The cycle in force, if there is one, ends with its words. LinuxCNC keeps the dwell for later.
    pub(crate) fn leave(&mut self, keeps_dwell: bool) {
        if self.cycle.is_some() {
            let dwell_s = self.dwell_s.filter(|_| keeps_dwell);
            *self = Self { to_r: self.to_r, default_reported: self.default_reported, dwell_s, ..Self::default() };
        }
    }
}
