//! Filter and position loop between setpoints and tool, and what they leave of a vibration
//! (docs/functions/path-vibration.md, "Will the machine follow?").

use core::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use feedwave_motion::sin_turns;

/// What a machine profile states about the path from setpoints to the tool; `None` where it states nothing and
/// nothing is predicted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FollowingModel {
    /// Length T_f of a moving-average filter behind interpolation, s.
    pub filter_length_s: Option<f64>,
    /// Gain K_v of the position loop, 1/s.
    pub position_loop_gain_per_s: Option<f64>,
}

/// What arrives at the tool of a vibration that was commanded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FollowingReport {
    /// Gain of the filter, |sin(π·f·T_f) / (π·f·T_f)|.
    pub filter_gain: f64,
    /// Gain of the position loop, 1/√(1 + (2πf/K_v)²).
    pub loop_gain: f64,
    /// Phase lag of the position loop, atan(2πf/K_v), rad.
    pub phase_lag_rad: f64,
    /// Amplitude at the tool, mm.
    pub arriving_amplitude_mm: f64,
    /// Amplitude to command so that the programmed one arrives, mm; `None` when the filter erases the vibration.
    pub amplitude_to_command_mm: Option<f64>,
}

impl FollowingModel {
    /// Whether the profile states anything that changes a vibration.
    #[must_use]
    pub const fn is_stated(&self) -> bool {
        self.filter_length_s.is_some() || self.position_loop_gain_per_s.is_some()
    }

    /// What remains of a vibration of `amplitude_mm` at `frequency_hz`.
    #[must_use]
    pub fn predict(&self, frequency_hz: f64, amplitude_mm: f64) -> FollowingReport {
        let filter_gain = self.filter_length_s.map_or(1.0, |length_s| sinc_gain(frequency_hz * length_s));
        let detuning = self.position_loop_gain_per_s.map_or(0.0, |gain_per_s| TAU * frequency_hz / gain_per_s);
        let loop_gain = 1.0 / (1.0 + detuning * detuning).sqrt();
        let gain = filter_gain * loop_gain;
        FollowingReport {
            filter_gain,
            loop_gain,
            phase_lag_rad: libm::atan(detuning),
            arriving_amplitude_mm: amplitude_mm * gain,
            amplitude_to_command_mm: (gain > ERASED_GAIN).then(|| amplitude_mm / gain),
        }
    }
}

/// Below this gain nothing arrives: the rounding of f·T_f alone leaves this much of a vibration at a zero of the
/// filter.
const ERASED_GAIN: f64 = 1e-12;

/// |sin(πx)/(πx)| with x = f·T_f: exactly 1 at 0 and exactly 0 at the other integers.
fn sinc_gain(periods: f64) -> f64 {
    if periods == 0.0 { 1.0 } else { (sin_turns(0.5 * periods) / (PI * periods)).abs() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_twenty_millisecond_filter_erases_fifty_hertz() {
        let model = FollowingModel { filter_length_s: Some(0.02), position_loop_gain_per_s: None };
        let report = model.predict(50.0, 0.03);
        assert!(report.filter_gain < 1e-15, "gain {}", report.filter_gain);
        assert_eq!(report.amplitude_to_command_mm, None);
        let half = model.predict(25.0, 0.03);
        assert!((half.filter_gain - 2.0 / PI).abs() < 1e-15);
        assert!((half.amplitude_to_command_mm.unwrap() * half.filter_gain - 0.03).abs() < 1e-17);
    }

    #[test]
    fn the_position_loop_halves_the_power_at_its_corner() {
        let gain_per_s = 100.0;
        let model = FollowingModel { filter_length_s: None, position_loop_gain_per_s: Some(gain_per_s) };
        let report = model.predict(gain_per_s / TAU, 1.0);
        assert!((report.loop_gain - 0.5f64.sqrt()).abs() < 1e-15);
        assert!((report.phase_lag_rad - PI / 4.0).abs() < 1e-15);
        assert_eq!(report.filter_gain, 1.0);
    }

    #[test]
    fn nothing_stated_means_everything_arrives() {
        let report = FollowingModel::default().predict(500.0, 0.1);
        assert_eq!(report.arriving_amplitude_mm, 0.1);
        assert_eq!(report.amplitude_to_command_mm, Some(0.1));
        assert_eq!(report.phase_lag_rad, 0.0);
        assert!(!FollowingModel::default().is_stated());
    }
}
