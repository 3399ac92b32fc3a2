//! What thinning did, in figures that need no memory of the blocks.

use serde::{Deserialize, Serialize};

/// Changes of a rotary axis smaller than this are rounding, rad.
const STILL_RAD: f64 = 1e-9;

/// The largest of a figure, and the program line it belongs to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Largest {
    value: f64,
    line: u32,
}

impl Largest {
    pub(super) fn add(&mut self, value: f64, line: u32) {
        if value > self.value {
            *self = Self { value, line };
        }
    }

    pub(super) fn get(self) -> (f64, u32) {
        (self.value, self.line)
    }
}

/// Reversals of the two rotary axes along a sequence of blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Reversals {
    last_rad: Option<[f64; 2]>,
    /// Sense in which each axis turned last; 0 before it did.
    sense: [i8; 2],
    count: [u64; 2],
}

impl Reversals {
    pub(super) fn add(&mut self, rotary_rad: Option<[f64; 2]>) {
        if let (Some(now), Some(last)) = (rotary_rad, self.last_rad) {
            for axis in 0..2 {
                let travel = now[axis] - last[axis];
                let sense = if travel > STILL_RAD { 1 } else { -i8::from(travel < -STILL_RAD) };
                self.count[axis] += u64::from(sense * self.sense[axis] < 0);
                if sense != 0 {
                    self.sense[axis] = sense;
                }
            }
        }
        self.last_rad = rotary_rad;
    }

    /// Another block moved the axes, and how is not known here.
    pub(super) fn interrupt(&mut self) {
        (self.last_rad, self.sense) = (None, [0; 2]);
    }

    pub(super) const fn count(&self) -> [u64; 2] {
        self.count
    }
}

/// Figures of the rotary axes; they are known where blocks come with rotary angles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RotaryReport {
    /// Direction reversals of each rotary axis as programmed.
    pub reversals_before: [u64; 2],
    /// Direction reversals of each rotary axis along the kept blocks.
    pub reversals_after: [u64; 2],
    /// Dropped blocks whose angles differ from the interpolated ones by more than the angle tolerance: equal directions
    /// do not mean equal angles.
    pub off_blocks: u64,
    /// Largest difference of a dropped block's angle from the interpolated one, degrees.
    pub largest_deviation_deg: f64,
    /// Program line of that block, 0 when none was dropped.
    pub largest_deviation_line: u32,
}

/// What thinning did (docs/functions/five-axis-thinning.md, "Report").
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ThinningReport {
    /// Blocks read, all kinds.
    pub blocks_read: u64,
    /// Blocks dropped.
    pub blocks_dropped: u64,
    /// Blocks kept because they do more than cut along a line; each ends its group.
    pub other_blocks: u64,
    /// Groups thinned.
    pub groups: u64,
    /// Largest distance of a dropped block from the path that is left, mm; below the distance tolerance. In the fitted method
    /// the distance is to the same share of the path length, so that it bounds both paths' distance from each other everywhere.
    pub position_deviation_mm: f64,
    /// Program line of that block, 0 when the deviation is zero.
    pub position_deviation_line: u32,
    /// Largest angle between a block's direction and the one that is left there, degrees. The angle tolerance does not bound it
    /// in the published method, where only dropped blocks deviate.
    pub direction_deviation_deg: f64,
    /// Program line of that block, 0 when the deviation is zero.
    pub direction_deviation_line: u32,
    /// Most that the direction can be from the programmed one anywhere, between blocks as well, degrees; in the fitted
    /// method, whose tolerance it never exceeds, else 0.
    pub direction_bound_deg: f64,
    /// Kept blocks that run at the feed of a dropped one.
    pub feeds_inherited: u64,
    /// Feeds of dropped blocks that no block runs at, because another feed follows before the next kept block.
    pub feeds_lost: u64,
    /// Figures of the rotary axes.
    pub rotary: RotaryReport,
}

impl ThinningReport {
    /// Blocks kept, all kinds, once everything is flushed.
    #[must_use]
    pub const fn blocks_kept(&self) -> u64 {
        self.blocks_read - self.blocks_dropped
    }
}
