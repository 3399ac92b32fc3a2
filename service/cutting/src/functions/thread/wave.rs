//! The vibration of one pass as a function of the spindle angle (docs/functions/thread-vibration.md, "Amplitude" and
//! "Phase").

use serde::{Deserialize, Serialize};

use feedwave_motion::sin_turns;

/// How the vibration of a pass is brought to its phase (docs/functions/thread-vibration.md, "Phase").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartUp {
    /// Start-up A: X moves to the vibration position of the corrected phase beforehand, the vibration starts at the
    /// thread-start reference point.
    #[default]
    Preparatory,
    /// Start-up B: the vibration starts from phase 0 where its phase shift has passed since the reference point.
    Delayed,
}

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
        if self.amplitude_mm == 0.0 {
            return 0.0;
        }
        match start_up {
            StartUp::Preparatory => self.at_phase_mm(self.phase_deg(spindle_angle_deg.max(0.0))),
            StartUp::Delayed if spindle_angle_deg < self.delay_deg() => 0.0,
            StartUp::Delayed => self.at_phase_mm(self.phase_deg(spindle_angle_deg)),
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

    /// Spindle angle from which the vibration runs, degrees.
    #[must_use]
    pub fn start_deg(&self, start_up: StartUp) -> f64 {
        match start_up {
            StartUp::Preparatory => 0.0,
            StartUp::Delayed => self.delay_deg(),
        }
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
