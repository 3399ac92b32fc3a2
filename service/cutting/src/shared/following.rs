//! What lies between setpoints and tool: the drives of the axes, and what they make of a motion
//! (docs/functions/path-vibration.md, "Will the machine follow?").
//!
//! Every function that vibrates asks the same model: one transfer function for each axis.

mod contour;
mod drive;
mod wave;

use feedwave_motion::ProfileProblem;
use feedwave_program::Axis;
use serde::{Deserialize, Serialize};

pub(crate) use contour::{PathPlace, largest_between};
pub use drive::DriveModel;
pub(crate) use drive::Response;
pub(crate) use wave::Harmonics;

/// The drives of a machine; where nothing is stated nothing is predicted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FollowingModel {
    /// The drive of every axis without one of its own.
    pub common: DriveModel,
    /// Axes with another drive: it replaces the common one as a whole.
    pub axes: Vec<AxisDrive>,
}

/// The drive of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisDrive {
    /// Its letter; several machine axes of one letter move together and have one drive here.
    pub axis: Axis,
    /// Its drive.
    pub drive: DriveModel,
}

/// What one axis makes of a sine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisFollowing {
    /// The axis.
    pub axis: Axis,
    /// What arrives over what is commanded.
    pub gain: f64,
    /// By how much it lags, rad from 0 to 2π.
    pub lag_rad: f64,
}

/// How far the drives leave the contour, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FollowingContour {
    /// By the feed, at the programmed one: the axes lag by different distances on a slope, and cut inside a curve.
    pub feed_mm: f64,
    /// Line of the program where that is largest.
    pub feed_line: u32,
    /// By what vibrates, at its peak, in addition.
    pub vibration_mm: f64,
    /// Line of the program where that is largest.
    pub vibration_line: u32,
    /// Largest sum of both at one place.
    pub together_mm: f64,
    /// Path on which rotary axes move, mm: what their lag does to the tool is not judged.
    pub unjudged_mm: f64,
}

impl FollowingModel {
    /// Whether it states anything that changes a motion.
    #[must_use]
    pub fn is_stated(&self) -> bool {
        self.common.is_stated() || self.axes.iter().any(|axis| axis.drive.is_stated())
    }

    /// The drive of an axis.
    #[must_use]
    pub fn of(&self, axis: Axis) -> DriveModel {
        self.axes.iter().find(|own| own.axis == axis).map_or(self.common, |own| own.drive)
    }

    /// The drive that all of some axes have; `None` where they differ.
    #[must_use]
    pub fn shared_by(&self, axes: impl IntoIterator<Item = Axis>) -> Option<DriveModel> {
        let mut drives = axes.into_iter().map(|axis| self.of(axis));
        let first = drives.next()?;
        drives.all(|drive| drive == first).then_some(first)
    }

    /// What an axis makes of a sine of this frequency.
    #[must_use]
    pub fn axis(&self, axis: Axis, frequency_hz: f64) -> AxisFollowing {
        let drive = self.of(axis);
        AxisFollowing { axis, gain: drive.gain(frequency_hz), lag_rad: drive.lag_rad(frequency_hz) }
    }

    /// Everything that makes the model unusable on a machine with these axes, with the field; empty when it is valid.
    #[must_use]
    pub fn problems(&self, axes: &[Axis]) -> Vec<ProfileProblem> {
        let mut problems = self.common.problems();
        if self.axes.len() > axes.len() {
            let message = format!("has {} entries for the {} axes of the machine", self.axes.len(), axes.len());
            problems.push(ProfileProblem { field: "axes".to_owned(), message });
            return problems;
        }
        for (index, own) in self.axes.iter().enumerate() {
            let letter = own.axis.letter();
            let message = if !axes.contains(&own.axis) {
                Some(format!("the machine has no axis {letter}"))
            } else if self.axes[..index].iter().any(|before| before.axis == own.axis) {
                Some(format!("axis {letter} has a drive already"))
            } else {
                None
            };
            problems.extend(message.map(|message| ProfileProblem { field: format!("axes[{index}].axis"), message }));
            let own = own.drive.problems().into_iter();
            problems.extend(
                own.map(|problem| ProfileProblem { field: format!("axes[{index}].{}", problem.field), ..problem }),
            );
        }
        problems
    }
}

#[cfg(test)]
mod tests;
