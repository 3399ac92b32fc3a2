//! A thread played against a measured spindle angle, for a drive loop that follows a real spindle.

use super::{SpindleRotation, ThreadPath, ThreadPlace};

/// Follows one pass by the angles that an encoder reports.
///
/// The position is a pure function of the angle: whatever the speed of the spindle, and where it shakes or turns back
/// for a moment, X and Z stay in step with it.
#[derive(Clone, Debug, PartialEq)]
pub struct ThreadFollower {
    path: ThreadPath,
    rotation: SpindleRotation,
    reference_deg: f64,
    /// Last angle from the reference point, degrees in the direction of rotation.
    angle_deg: Option<f64>,
}

/// A measured angle that is not a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the measured spindle angle is not a finite number")]
pub struct NotAnAngle;

impl ThreadFollower {
    /// A follower at the start of a pass; `reference_angle_deg` is the encoder's angle at the thread-start reference
    /// point.
    #[must_use]
    pub const fn new(path: ThreadPath, rotation: SpindleRotation, reference_angle_deg: f64) -> Self {
        Self { path, rotation, reference_deg: reference_angle_deg, angle_deg: None }
    }

    /// The pass.
    #[must_use]
    pub const fn path(&self) -> &ThreadPath {
        &self.path
    }

    /// Position at an unwrapped angle of the spindle, degrees as in the setpoints' spindle angle, `reference_angle_deg`
    /// being that of the turn in which the pass starts.
    ///
    /// # Errors
    /// [`NotAnAngle`].
    pub fn unwrapped(&mut self, spindle_angle_deg: f64) -> Result<ThreadPlace, NotAnAngle> {
        if !spindle_angle_deg.is_finite() {
            return Err(NotAnAngle);
        }
        let angle_deg = self.forwards(spindle_angle_deg);
        self.angle_deg = Some(angle_deg);
        Ok(self.path.at(angle_deg))
    }

    /// Position at a raw angle of the encoder, degrees of any turn: the turns are counted here, from the first reading
    /// on, which lies before the reference point. Between two readings the spindle must turn by less than half a turn.
    ///
    /// # Errors
    /// [`NotAnAngle`].
    pub fn encoder(&mut self, encoder_angle_deg: f64) -> Result<ThreadPlace, NotAnAngle> {
        if !encoder_angle_deg.is_finite() {
            return Err(NotAnAngle);
        }
        let raw_deg = super::reduce_deg(self.forwards(encoder_angle_deg));
        let angle_deg = match self.angle_deg {
            // The thread starts at the next passage of the reference point.
            None if raw_deg == 0.0 => 0.0,
            None => raw_deg - 360.0,
            Some(last_deg) => {
                let step_deg = super::reduce_deg(raw_deg - last_deg);
                last_deg + if step_deg > 180.0 { step_deg - 360.0 } else { step_deg }
            }
        };
        // Not a sum of steps, which would drift: the turn is counted, the angle is the measured one.
        let angle_deg = raw_deg + 360.0 * ((angle_deg - raw_deg) / 360.0).round();
        self.angle_deg = Some(angle_deg);
        Ok(self.path.at(angle_deg))
    }

    /// Angle of the last reading from the reference point, degrees in the direction of rotation, turns counted.
    #[must_use]
    pub const fn angle_deg(&self) -> Option<f64> {
        self.angle_deg
    }

    /// Whether the pass is over at the last reading.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.angle_deg.is_some_and(|angle_deg| angle_deg >= self.path.rest_deg())
    }

    fn forwards(&self, angle_deg: f64) -> f64 {
        match self.rotation {
            SpindleRotation::Forward => angle_deg - self.reference_deg,
            SpindleRotation::Reverse => self.reference_deg - angle_deg,
        }
    }
}
