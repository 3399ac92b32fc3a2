//! What a mode makes of a force that changes between two samples.

use std::f64::consts::TAU;

use super::LearningModel;
use crate::lobes::Mode;

/// Time constants of a mode after which what was before is forgotten to 1e-5.
const SETTLING_TIME_CONSTANTS: f64 = 12.0;
/// Places of Gauss's rule of three in −1 to 1, and the share of each.
pub(super) const GAUSS: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 18.0), (0.0, 8.0 / 18.0), (0.774_596_669_241_483_4, 5.0 / 18.0)];
/// Parts of the time between two samples that each take the rule: the response to a frequency of almost half of the sample rate is exact to 1e-7.
const PARTS: u32 = 4;

/// A force between two samples, N: its mean, and the coefficients of Legendre's next three polynomials over that time. What an entry, an exit or
/// the end of a chip leaves beyond them moves a mode of a tenth of the sample rate by 1e-4 of what the step of the force does within a sample.
pub(super) type Moments = [f64; 4];

/// Values of these polynomials at a place in −1 to 1.
#[inline]
pub(super) fn legendre(place: f64) -> Moments {
    let square = place * place;
    [1.0, place, 1.5 * square - 0.5, place * (2.5 * square - 1.5)]
}

/// Samples at the begin of a record after which the modes have forgotten how they began: they are not judged.
#[must_use]
pub fn settling_samples(model: &LearningModel) -> usize {
    let slowest = [&model.mode_x, &model.mode_y]
        .into_iter()
        .map(|mode| mode.damping_ratio * mode.frequency_hz)
        .fold(f64::INFINITY, f64::min);
    (SETTLING_TIME_CONSTANTS * model.sample_rate_hz / (TAU * slowest)).ceil() as usize
}

/// A mode from one sample to the next one: exact for a force of [`Moments`].
pub(super) struct Response {
    transition: [[f64; 2]; 2],
    /// What each moment of the force adds to deflection and speed.
    added: [[f64; 2]; 4],
}

/// Deflection, mm, and its speed, mm/s.
pub(super) type State = [f64; 2];

impl Response {
    pub(super) fn new(mode: &Mode, sample_rate_hz: f64) -> Self {
        let sample_s = 1.0 / sample_rate_hz;
        let omega = TAU * mode.frequency_hz;
        let by_n = omega * omega / mode.stiffness_n_per_mm;
        let mut added = [[0.0; 2]; 4];
        for part in 0..PARTS {
            for (place, share) in GAUSS {
                let place = (2.0 * f64::from(part) + 1.0 + place) / f64::from(PARTS) - 1.0;
                // An impulse there begins with its speed.
                let left_s = 0.5 * (1.0 - place) * sample_s;
                let [[_, deflection], [_, speed]] = transition(mode, left_s);
                let impulse = by_n * sample_s * share / f64::from(PARTS);
                for (added, value) in added.iter_mut().zip(legendre(place)) {
                    added[0] += impulse * value * deflection;
                    added[1] += impulse * value * speed;
                }
            }
        }
        Self { transition: transition(mode, sample_s), added }
    }

    /// Goes on to the next sample.
    #[inline]
    pub(super) fn advance(&self, state: &mut State, force: &Moments) {
        let [deflection, speed] = *state;
        let [of_deflection, of_speed] = &self.transition;
        *state =
            [of_deflection[0] * deflection + of_deflection[1] * speed, of_speed[0] * deflection + of_speed[1] * speed];
        for (added, force) in self.added.iter().zip(force) {
            state[0] += added[0] * force;
            state[1] += added[1] * force;
        }
    }
}

/// Transition of deflection and speed over a time without force, row by row, in closed form.
fn transition(mode: &Mode, time_s: f64) -> [[f64; 2]; 2] {
    let omega = TAU * mode.frequency_hz;
    let decay = mode.damping_ratio * omega;
    let damped = omega * (1.0 - mode.damping_ratio * mode.damping_ratio).sqrt();
    let scale = libm::exp(-decay * time_s);
    let sine = scale * libm::sin(damped * time_s) / damped;
    let cosine = scale * libm::cos(damped * time_s);
    [[cosine + decay * sine, sine], [-omega * omega * sine, cosine - decay * sine]]
}
