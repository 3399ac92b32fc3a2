//! What a drive makes of a periodic motion of any form, by its harmonics.

use feedwave_motion::sincos_turns;

use super::{DriveModel, Response};

/// Samples of a period.
const SAMPLES: usize = 1_024;
/// Harmonics that are kept: those of a wave whose acceleration has steps fall with the third power, so that what is left out is
/// below 1e-5 of the amplitude.
const HARMONICS: usize = 128;

/// A wave of period 1 as the sum of its harmonics: Re Σ cₖ·e^(2πikτ).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Harmonics {
    /// c₀ to c of the last one.
    coefficients: Vec<Response>,
}

/// What is left of a wave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ArrivingWave {
    /// Half of its peak to peak.
    pub(crate) amplitude: f64,
    /// By how much its first harmonic lags, rad from 0 to 2π.
    pub(crate) lag_rad: f64,
    /// Gain of the first harmonic.
    pub(crate) gain: f64,
}

impl Harmonics {
    /// Of a wave by its phase in turns.
    pub(crate) fn of(wave: impl Fn(f64) -> f64) -> Self {
        let values: Vec<f64> = (0..SAMPLES).map(|index| wave(index as f64 / SAMPLES as f64)).collect();
        let coefficient = |harmonic: usize| {
            let mut sum = Response::default();
            for (index, value) in values.iter().enumerate() {
                let (sine, cosine) = sincos_turns((harmonic * index % SAMPLES) as f64 / SAMPLES as f64);
                sum = sum.plus(Response { re: value * cosine, im: -value * sine });
            }
            sum.scaled(if harmonic == 0 { 1.0 } else { 2.0 } / SAMPLES as f64)
        };
        Self { coefficients: (0..=HARMONICS).map(coefficient).collect() }
    }

    /// What arrives of it through a drive, at this frequency.
    pub(crate) fn through(&self, drive: &DriveModel, frequency_hz: f64) -> ArrivingWave {
        let arriving: Vec<Response> = self
            .coefficients
            .iter()
            .enumerate()
            .map(|(harmonic, own)| own.times(drive.response(frequency_hz * harmonic as f64)))
            .collect();
        let at = |index: usize| {
            let terms = arriving.iter().enumerate().map(|(harmonic, own)| {
                let (sine, cosine) = sincos_turns((harmonic * index % SAMPLES) as f64 / SAMPLES as f64);
                own.re * cosine - own.im * sine
            });
            terms.sum::<f64>()
        };
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in (0..SAMPLES).map(at) {
            (least, most) = (least.min(value), most.max(value));
        }
        ArrivingWave {
            amplitude: 0.5 * (most - least),
            lag_rad: drive.lag_rad(frequency_hz),
            gain: drive.gain(frequency_hz),
        }
    }
}
