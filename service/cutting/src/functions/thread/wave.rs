//! The vibration of one pass as a function of the spindle angle (docs/functions/thread-vibration.md, "Amplitude" and
//! "Phase").

use serde::{Deserialize, Serialize};

use feedwave_motion::sin_turns;

/// How the vibration of a pass is brought to its phase (docs/functions/thread-vibration.md, "Phase").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartUp {
    /// Start-up A: X moves to the vibration position of the corrected phase beforehand, the vibration starts at the
    /// thread-start reference point. In the middle of the wave it starts from rest and falls one vibration behind, over two
    /// of them ([`RetreatWave::in_phase_deg`]).
    #[default]
    Preparatory,
    /// Start-up B: the vibration starts from phase 0 where its phase shift has passed since the reference point.
    Delayed,
}

/// By how much the jerk of a start-up in the middle of the wave may exceed the peak of the vibration, a share: 0.01323 where
/// the rate of the phase has nearly risen.
pub(crate) const START_JERK: f64 = 0.0133;

/// Retreat of the tool in one pass: r(ψ) = (A/2)·(1 − cos ψ), ψ = D·θ − Δ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RetreatWave {
    /// Peak-to-peak travel A on the radius, mm.
    pub amplitude_mm: f64,
    /// Vibrations per spindle revolution D.
    pub vibrations_per_rev: f64,
    /// Phase shift Δ, degrees.
    pub phase_shift_deg: f64,
}

impl RetreatWave {
    /// Phase ψ = D·θ − Δ at a spindle angle from the thread-start reference point, degrees, not reduced.
    #[inline]
    #[must_use]
    pub fn phase_deg(&self, spindle_angle_deg: f64) -> f64 {
        self.vibrations_per_rev * spindle_angle_deg - self.phase_shift_deg
    }

    /// Retreat at a vibration phase, mm, within 0 and A.
    #[inline]
    #[must_use]
    pub fn at_phase_mm(&self, phase_deg: f64) -> f64 {
        // (1 − cos ψ)/2 = sin²(ψ/2), which cannot leave 0 to 1 by rounding.
        let sine = sin_turns(phase_deg / 720.0);
        self.amplitude_mm * (sine * sine).min(1.0)
    }

    /// Retreat at a spindle angle from the reference point, mm; the start-up included.
    #[must_use]
    pub fn retreat_mm(&self, start_up: StartUp, spindle_angle_deg: f64) -> f64 {
        if self.amplitude_mm == 0.0 || start_up == StartUp::Delayed && spindle_angle_deg < self.delay_deg() {
            return 0.0;
        }
        self.at_phase_mm(self.started_phase_deg(start_up, spindle_angle_deg))
    }

    /// Phase at a spindle angle from the reference point, degrees, not reduced; the start-up included, where the vibration has
    /// begun.
    ///
    /// In the middle of the wave a vibration cannot begin at its full rate: X would have to jump to its speed. The rate of
    /// the phase rises from 0 to D as the quintic 6s⁵ − 15s⁴ + 10s³ over two vibrations, s their share. Its mean is a half, so
    /// that the phase is one whole vibration behind then: the same one. Nowhere are velocity or acceleration higher than in
    /// the vibration itself, and the jerk only by [`START_JERK`].
    fn started_phase_deg(&self, start_up: StartUp, spindle_angle_deg: f64) -> f64 {
        let Self { vibrations_per_rev, phase_shift_deg, .. } = *self;
        let in_phase_deg = self.in_phase_deg(start_up);
        if start_up == StartUp::Delayed || spindle_angle_deg >= in_phase_deg {
            return self.phase_deg(spindle_angle_deg.max(0.0));
        }
        let s = (spindle_angle_deg / in_phase_deg).max(0.0);
        let risen = s * s * s * s * ((s - 3.0) * s + 2.5);
        vibrations_per_rev * in_phase_deg * risen - phase_shift_deg
    }

    /// Whether start-up A starts in the middle of the wave, where the speed of the vibration is not zero.
    #[must_use]
    pub fn starts_within(&self) -> bool {
        reduce_deg(2.0 * self.phase_shift_deg) != 0.0
    }

    /// Spindle angle from the reference point from which on the vibration has its phase, degrees.
    #[must_use]
    pub fn in_phase_deg(&self, start_up: StartUp) -> f64 {
        match start_up {
            StartUp::Preparatory if self.starts_within() => 2.0 * 360.0 / self.vibrations_per_rev,
            StartUp::Preparatory => 0.0,
            StartUp::Delayed => self.delay_deg(),
        }
    }

    /// Spindle angle at which the vibration starts to move X, degrees.
    #[must_use]
    pub fn start_deg(&self, start_up: StartUp) -> f64 {
        match start_up {
            StartUp::Preparatory => 0.0,
            StartUp::Delayed => self.delay_deg(),
        }
    }

    /// Phase to which start-up A moves X beforehand: (360° − Δ) mod 360°, degrees.
    #[must_use]
    pub fn prepared_phase_deg(&self) -> f64 {
        reduce_deg(-self.phase_shift_deg)
    }

    /// Spindle angle from the reference point at which start-up B starts the vibration: Δ/D, degrees.
    #[must_use]
    pub fn delay_deg(&self) -> f64 {
        reduce_deg(self.phase_shift_deg) / self.vibrations_per_rev
    }
}

/// Phase shift of a pass without `R` word: 0° on odd passes, 180° on even ones; `pass` counts from 0.
#[must_use]
pub fn default_phase_shift_deg(pass: usize) -> f64 {
    if pass.is_multiple_of(2) { 0.0 } else { 180.0 }
}

/// An angle between 0 (included) and 360 (excluded), degrees.
#[must_use]
pub fn reduce_deg(angle_deg: f64) -> f64 {
    let reduced = angle_deg - 360.0 * (angle_deg / 360.0).floor();
    // The rounding of a tiny negative angle.
    if reduced >= 360.0 { 0.0 } else { reduced.max(0.0) }
}
