//! A threading pass as setpoints: its variable is the spindle angle.

use feedwave_motion::Profile;
use feedwave_program::{Axis, Position};
use serde::{Deserialize, Serialize};

use super::{PathColumns, ThreadPath};
use crate::shared::columns::{ColumnMap, still};
use crate::shared::plane_frame::PlaneFrame;
use crate::shared::setpoint::{BLOCK_LENGTH, SetpointBlock};

/// A pass to run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ThreadRun {
    pub(crate) path: ThreadPath,
    /// Where it ends, to the bit; of the machine in a tilted plane.
    pub(crate) end: Position,
    pub(crate) work_offset: Position,
    /// Its way through a tilted plane.
    pub(crate) frame: Option<Box<PlaneFrame>>,
    /// Movement of the axis across the lead to the vibration position, where it is done here.
    pub(crate) preparation: Option<Profile>,
    /// That axis.
    pub(crate) across: Axis,
    /// Its sign in which the tool retreats.
    pub(crate) outwards: f64,
    /// Spindle angle of the thread-start reference point, revolutions.
    pub(crate) reference_rev: f64,
    /// Spindle speed without its sense, rev/s.
    pub(crate) rev_per_s: f64,
    /// First source line.
    pub(crate) line: u32,
}

/// Buffers of one block.
#[derive(Clone, Debug)]
pub(crate) struct ThreadScratch {
    x: Vec<f64>,
    z: Vec<f64>,
    /// mm per degree.
    speed: Vec<f64>,
}

impl ThreadScratch {
    pub(crate) fn new() -> Self {
        let column = || vec![0.0; BLOCK_LENGTH];
        Self { x: column(), z: column(), speed: column() }
    }
}

impl ThreadRun {
    /// The next passage of the reference point, this very instant included: the spindle's angle from it, degrees in the
    /// direction of rotation and not positive, and the time until the pass is over, s.
    pub(crate) fn next_passage(&self, spindle_rev: f64, forwards: f64) -> (f64, f64) {
        let past_rev = forwards * (spindle_rev - self.reference_rev);
        let start_deg = 360.0 * (past_rev - past_rev.ceil());
        (start_deg, (self.path.rest_deg() - start_deg) / (360.0 * self.rev_per_s))
    }

    /// The preparatory movement on rows from `start` on that rest at a position: the tool retreats by so much.
    pub(crate) fn fill_preparation(
        &self,
        columns: &[ColumnMap],
        (position, work_offset): (&Position, &Position),
        retreat_mm: &[f64],
        block: &mut SetpointBlock,
        start: usize,
    ) {
        block.vibration_offset_mm[start..].copy_from_slice(retreat_mm);
        if let Some(frame) = &self.frame {
            let from = self.path.start();
            let place = |retreat_mm: f64| match self.across {
                Axis::X => [from[0] + self.outwards * retreat_mm, from[1]],
                _ => [from[0], from[1] + self.outwards * retreat_mm],
            };
            for (map, column) in columns.iter().zip(&mut block.axes) {
                for (value, retreat_mm) in column[start..].iter_mut().zip(retreat_mm) {
                    *value = frame.value(map.axis, map.frame(), place(*retreat_mm));
                }
                map.apply(work_offset, &mut column[start..]);
            }
            return;
        }
        let columns = columns.iter().zip(&mut block.axes).filter(|(map, _)| map.axis == self.across);
        for (map, column) in columns {
            for (value, retreat_mm) in column[start..].iter_mut().zip(retreat_mm) {
                *value = position[self.across.index()] + self.outwards * retreat_mm;
            }
            map.apply(work_offset, &mut column[start..]);
        }
    }

    /// The pass on rows from `start` on, at these spindle angles from the reference point on.
    pub(crate) fn fill(
        &self,
        columns: &[ColumnMap],
        angles_deg: &[f64],
        path_base_mm: f64,
        scratch: &mut ThreadScratch,
        block: &mut SetpointBlock,
        start: usize,
    ) {
        let count = angles_deg.len();
        let (x, z, speed) = (&mut scratch.x[..count], &mut scratch.z[..count], &mut scratch.speed[..count]);
        let (path_mm, retreat_mm) = (&mut block.path_position_mm[start..], &mut block.vibration_offset_mm[start..]);
        let line = &mut block.line[start..];
        self.path.fill(angles_deg, PathColumns { x, z, path_mm, speed, retreat_mm, line });
        for path_mm in &mut block.path_position_mm[start..] {
            *path_mm += path_base_mm;
        }
        let mm_per_min = 360.0 * 60.0 * self.rev_per_s;
        for (feed, mm_per_deg) in block.feed_mm_per_min[start..].iter_mut().zip(&scratch.speed) {
            *feed = mm_per_deg * mm_per_min;
        }
        for (map, column) in columns.iter().zip(&mut block.axes) {
            let column = &mut column[start..];
            if let Some(frame) = &self.frame {
                let places = scratch.x[..count].iter().zip(&scratch.z[..count]);
                for (value, (x, z)) in column.iter_mut().zip(places) {
                    *value = frame.value(map.axis, map.frame(), [*x, *z]);
                }
                map.apply(&self.work_offset, column);
                continue;
            }
            match map.axis {
                Axis::X => column.copy_from_slice(&scratch.x[..count]),
                Axis::Z => column.copy_from_slice(&scratch.z[..count]),
                other => column.fill(self.end[other.index()]),
            }
            map.apply(&self.work_offset, column);
        }
        if let Some(servo) = &mut block.servo {
            still(servo, start);
        }
    }
}
