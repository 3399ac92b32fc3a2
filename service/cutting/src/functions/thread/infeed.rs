//! How deep every pass goes, and where along the lead (docs/functions/thread-vibration.md, "Infeed, tapers and run-up";
//! the depth law and the flank infeed are those of its program A).

use serde::{Deserialize, Serialize};

use super::GrooveProfile;

/// How the tool comes into the groove from pass to pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InfeedPattern {
    /// Straight in: both flanks cut.
    #[default]
    Radial,
    /// Along one flank, which then only the tip touches: Δz = Δd·tan β.
    Flank,
    /// Along a direction a little steeper than the flank, so that it is not rubbed: Δz = Δd·tan(β − relief).
    ModifiedFlank {
        /// Angle between the infeed and the flank, degrees; typically 1 to 5.
        relief_deg: f64,
    },
    /// Odd passes lie against one flank of the finished groove, even ones against the other.
    AlternatingFlank,
}

impl InfeedPattern {
    /// Axial offset of a pass against the first one, mm in the direction of travel.
    ///
    /// `pass` counts from 0, `final_depth_mm` is the depth of the finished groove. The first pass of alternating
    /// flanks counts as an odd one.
    #[must_use]
    pub fn axial_offset_mm(
        self,
        profile: &GrooveProfile,
        pass: usize,
        first_depth_mm: f64,
        depth_mm: f64,
        final_depth_mm: f64,
    ) -> f64 {
        let deepening_mm = depth_mm - first_depth_mm;
        match self {
            Self::Radial => 0.0,
            Self::Flank => deepening_mm * profile.tan_half_angle(),
            Self::ModifiedFlank { relief_deg } => {
                let infeed_deg = 0.5 * profile.included_angle_deg - relief_deg;
                deepening_mm * libm::tan(infeed_deg.to_radians())
            }
            Self::AlternatingFlank => {
                let missing_mm = final_depth_mm - depth_mm;
                let side = if pass.is_multiple_of(2) { -1.0 } else { 1.0 };
                (side * missing_mm + (final_depth_mm - first_depth_mm)) * profile.tan_half_angle()
            }
        }
    }
}

/// How the depth grows from pass to pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthLaw {
    /// Depth of pass k proportional to √k: every pass of a pointed tool removes the same section.
    #[default]
    SquareRoot,
    /// Every pass goes deeper by the same amount.
    Constant,
}

impl DepthLaw {
    /// Depth of pass `pass` (from 0) of `passes`, the last of which reaches `depth_mm`, mm.
    #[must_use]
    pub fn depth_mm(self, pass: usize, passes: usize, depth_mm: f64) -> f64 {
        let share = (pass + 1) as f64 / passes.max(1) as f64;
        depth_mm
            * match self {
                Self::SquareRoot => libm::sqrt(share),
                Self::Constant => share,
            }
    }

    /// Least number of passes whose first is no deeper than `first_depth_mm`; `None` where a depth is not positive or
    /// more than `limit` passes were needed.
    #[must_use]
    pub fn passes(self, depth_mm: f64, first_depth_mm: f64, limit: usize) -> Option<usize> {
        if !(depth_mm > 0.0 && first_depth_mm > 0.0) {
            return None;
        }
        let ratio = depth_mm / first_depth_mm;
        let passes = match self {
            Self::SquareRoot => ratio * ratio,
            Self::Constant => ratio,
        };
        // A quotient that is whole but for its rounding is whole.
        let passes = (passes * (1.0 - 1e-12)).ceil().max(1.0);
        (passes <= limit as f64).then_some(passes as usize)
    }
}
