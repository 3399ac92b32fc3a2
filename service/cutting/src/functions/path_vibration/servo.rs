//! Servo-side mode: the reference generator that a drive runs on its own, shorter servo period
//! (docs/functions/path-vibration.md, "Three generation modes").
//!
//! Invariant: with one servo period per interpolation period the output equals the tangential mode to the bit,
//! command + A_i·sin(2π·phase), clamped.

use serde::{Deserialize, Serialize};

use feedwave_motion::sin_turns;

/// The condition of one axis for the end of one interpolation period.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ServoCondition {
    /// Commanded position without vibration, mm.
    pub commanded_mm: f64,
    /// Amplitude along this axis with its sign, A·τ_i, mm; 0 while the vibration is off.
    pub signed_amplitude_mm: f64,
    /// Lowest position the drive may command, mm; −∞ where free.
    pub clamp_low_mm: f64,
    /// Highest position the drive may command, mm; +∞ where free.
    pub clamp_high_mm: f64,
}

impl ServoCondition {
    /// The axis' position in the tangential mode: command + signed amplitude · `wave`, clamped.
    #[inline]
    #[must_use]
    pub fn position_mm(&self, wave: f64) -> f64 {
        (self.commanded_mm + self.signed_amplitude_mm * wave).max(self.clamp_low_mm).min(self.clamp_high_mm)
    }
}

/// What all axes share for one interpolation period.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ServoWave {
    /// Whether the vibration is on.
    pub on: bool,
    /// Vibration frequency, Hz.
    pub frequency_hz: f64,
    /// Turns of the vibration from the start of the section to the end of this period, not reduced to one turn:
    /// a period in which the section starts has less than one period's worth of them.
    pub phase_turns: f64,
}

impl ServoWave {
    /// The wave of a period without vibration.
    pub const OFF: Self = Self { on: false, frequency_hz: 0.0, phase_turns: 0.0 };

    /// Fills `wave` with sin(2π·phase) at the ends of `wave.len()` equal servo periods of one interpolation
    /// period of `period_s`, 0 at those before the section's start.
    pub fn fill(&self, period_s: f64, wave: &mut [f64]) -> ServoPeriod {
        let substeps = wave.len();
        if !self.on {
            wave.fill(0.0);
            return ServoPeriod { first_vibrating: substeps, starts_section: false };
        }
        let turns_per_period = self.frequency_hz * period_s;
        let turns_per_substep = turns_per_period / substeps as f64;
        let mut first_vibrating = substeps;
        for index in (0..substeps).rev() {
            // Backwards from the end of the period, so that the last servo period has the streamed phase exactly.
            let phase_turns = self.phase_turns - turns_per_substep * (substeps - 1 - index) as f64;
            if phase_turns >= 0.0 {
                wave[index] = sin_turns(phase_turns);
                first_vibrating = index;
            } else {
                wave[index] = 0.0;
            }
        }
        // A section that starts exactly with the period may have lost a rounding.
        let starts_section = self.phase_turns <= turns_per_period * (1.0 + 1e-9);
        ServoPeriod { first_vibrating, starts_section }
    }
}

/// Where in an interpolation period the vibration is on; see [`ServoWave::fill`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoPeriod {
    /// First servo period at whose end the section has started; the number of servo periods when it is off.
    pub first_vibrating: usize,
    /// Whether the section starts in this period: the period's first condition says nothing about the amplitude.
    pub starts_section: bool,
}

/// One axis' positions at the ends of the servo periods between `previous` and `current`.
///
/// Command and amplitude go linearly from one condition to the other; the offset is the amplitude times `wave`,
/// as filled by [`ServoWave::fill`]; from the section's start on, the position (never the increment) is clamped.
/// In the period in which a section starts, the amplitude is that of `current` throughout. Inside a period the
/// clamps of both its ends hold, though never tighter than the command itself.
///
/// # Panics
/// When `wave` and `positions_mm` differ in length.
pub fn fill_servo_positions(
    previous: &ServoCondition,
    current: &ServoCondition,
    wave: &[f64],
    period: ServoPeriod,
    positions_mm: &mut [f64],
) {
    assert_eq!(wave.len(), positions_mm.len(), "one wave value for each servo period");
    let last = positions_mm.len().saturating_sub(1);
    let substeps = positions_mm.len() as f64;
    let from_amplitude_mm =
        if period.starts_section { current.signed_amplitude_mm } else { previous.signed_amplitude_mm };
    for (index, (position_mm, &wave_value)) in positions_mm.iter_mut().zip(wave).enumerate() {
        // The end of the period is streamed, not interpolated: no rounding may touch it.
        if index == last && index >= period.first_vibrating {
            *position_mm = current.position_mm(wave_value);
            continue;
        }
        let share = (index + 1) as f64 / substeps;
        let step_mm = current.commanded_mm - previous.commanded_mm;
        let commanded_mm = if index == last { current.commanded_mm } else { previous.commanded_mm + step_mm * share };
        if index < period.first_vibrating {
            *position_mm = commanded_mm;
            continue;
        }
        let mut between = ServoCondition {
            commanded_mm,
            signed_amplitude_mm: from_amplitude_mm + (current.signed_amplitude_mm - from_amplitude_mm) * share,
            ..*current
        };
        if !period.starts_section {
            between.clamp_low_mm = between.clamp_low_mm.max(previous.clamp_low_mm).min(commanded_mm);
            between.clamp_high_mm = between.clamp_high_mm.min(previous.clamp_high_mm).max(commanded_mm);
        }
        *position_mm = between.position_mm(wave_value);
    }
}

#[cfg(test)]
mod tests;
