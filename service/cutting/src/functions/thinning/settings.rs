//! What a machine profile says about thinning.

use std::ops::RangeInclusive;

use feedwave_motion::ProfileProblem;
use serde::{Deserialize, Serialize};

/// Fewest blocks of a group: with two nothing lies between.
pub const MIN_GROUP_BLOCKS: u32 = 3;
/// Most blocks of a group: a hundred times the look-ahead of a fast control, and some 20 MB.
pub const MAX_GROUP_BLOCKS: u32 = 100_000;
/// Range of the angle tolerances, degrees: below, directions of six decimals are noise; above, they are no tolerances.
const ANGLE_RANGE_DEG: RangeInclusive<f64> = 1e-4..=90.0;
/// Range of the distance tolerance, mm: from a hundredth of a micrometre to roughing.
const DISTANCE_RANGE_MM: RangeInclusive<f64> = 1e-5..=10.0;

/// Largest angle tolerance of the fitted method, degrees: its bounds are those of small angles.
const MAX_FITTED_ANGLE_DEG: f64 = 10.0;

/// How blocks are thinned out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ThinningMethod {
    /// As published: blocks are dropped, those that are kept are as programmed.
    #[default]
    Published,
    /// The directions of the kept blocks lie on a smooth curve; position and direction are within the tolerances everywhere.
    Fitted,
}

impl ThinningMethod {
    /// Both, in the order of reports.
    pub const ALL: [Self; 2] = [Self::Published, Self::Fitted];

    /// The one that it is compared with.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Published => Self::Fitted,
            Self::Fitted => Self::Published,
        }
    }
}

/// Tolerances and group size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThinningSettings {
    /// θ: a block may be dropped while its direction is closer to that of the last kept block, degrees.
    pub angle_tolerance_deg: f64,
    /// D: a block may be dropped while its tool centre point is closer to the segment that is left, mm.
    pub distance_tolerance_mm: f64,
    /// Blocks that are read ahead and thinned together.
    pub group_blocks: u32,
    /// Where given, a span also shrinks while a dropped block's direction is this far from the interpolated one, degrees.
    #[serde(default)]
    pub interpolated_direction_tolerance_deg: Option<f64>,
    /// The method.
    #[serde(default)]
    pub method: ThinningMethod,
}

impl Default for ThinningSettings {
    /// The flicker of directions averaged over triangles, and the chord tolerance of a finishing program; groups that fill
    /// within the time of a few hundred blocks.
    fn default() -> Self {
        Self {
            angle_tolerance_deg: 1.0,
            distance_tolerance_mm: 0.01,
            group_blocks: 1_000,
            interpolated_direction_tolerance_deg: None,
            method: ThinningMethod::Published,
        }
    }
}

impl ThinningSettings {
    /// Everything that makes the settings unusable, by field; empty when they are valid.
    #[must_use]
    pub fn validate(&self) -> Vec<ProfileProblem> {
        let mut problems = Vec::new();
        let mut check = |field: &str, value: f64, range: RangeInclusive<f64>, unit: &str| {
            if !range.contains(&value) {
                let message = format!("must be {} to {}{unit}, is {value}", range.start(), range.end());
                problems.push(ProfileProblem { field: field.to_owned(), message });
            }
        };
        check("angle_tolerance_deg", self.angle_tolerance_deg, ANGLE_RANGE_DEG, " degrees");
        check("distance_tolerance_mm", self.distance_tolerance_mm, DISTANCE_RANGE_MM, " mm");
        let blocks = f64::from(MIN_GROUP_BLOCKS)..=f64::from(MAX_GROUP_BLOCKS);
        check("group_blocks", f64::from(self.group_blocks), blocks, " blocks");
        if let Some(tolerance) = self.interpolated_direction_tolerance_deg {
            check("interpolated_direction_tolerance_deg", tolerance, ANGLE_RANGE_DEG, " degrees");
        }
        if self.method == ThinningMethod::Fitted && self.fitted_tolerance_deg() > MAX_FITTED_ANGLE_DEG {
            let message = format!(
                "must be at most {MAX_FITTED_ANGLE_DEG} degrees in the fitted method, is {}",
                self.fitted_tolerance_deg()
            );
            problems.push(ProfileProblem { field: "angle_tolerance_deg".to_owned(), message });
        }
        problems
    }

    /// Tolerance of the direction in the fitted method, degrees: the stricter one where both are given.
    #[must_use]
    pub fn fitted_tolerance_deg(&self) -> f64 {
        self.interpolated_direction_tolerance_deg.unwrap_or(f64::INFINITY).min(self.angle_tolerance_deg)
    }

    /// The same with the other method, at a tolerance that this one permits.
    #[must_use]
    pub fn with_other_method(&self) -> Self {
        let method = self.method.other();
        let angle_tolerance_deg = match method {
            ThinningMethod::Published => self.angle_tolerance_deg,
            ThinningMethod::Fitted => self.angle_tolerance_deg.min(MAX_FITTED_ANGLE_DEG),
        };
        Self { method, angle_tolerance_deg, ..*self }
    }
}
