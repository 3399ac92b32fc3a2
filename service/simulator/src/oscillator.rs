//! One direction of the tool as a damped mode, advanced exactly.

use feedwave_monitoring::Mode;
use std::f64::consts::TAU;

/// m·ẍ + c·ẋ + k·x = F with F a straight line over a step: the transition of what does not follow it is known in closed form.
#[derive(Debug, Clone)]
pub(crate) struct Oscillator {
    /// Transition over one step, row by row.
    transition: [[f64; 2]; 2],
    /// Half of a step, s.
    half_step_s: f64,
    /// By what a deflection lags behind a force that changes steadily, s.
    lag_s: f64,
    stiffness_n_per_mm: f64,
    /// ω² and 2ζω.
    omega_squared: f64,
    damping: f64,
    /// Deflection, mm, and its speed, mm/s.
    pub deflection_mm: f64,
    speed_mm_per_s: f64,
}

impl Oscillator {
    /// At rest. With ω_d = ω√(1 − ζ²), s = sin(ω_d·T)/ω_d, c = cos(ω_d·T):
    /// Φ = e^(−ζωT)·[[c + ζω·s, s], [−ω²·s, c − ζω·s]].
    pub fn new(mode: &Mode, step_s: f64) -> Self {
        let omega = TAU * mode.frequency_hz;
        let decay = mode.damping_ratio * omega;
        let damped = omega * (1.0 - mode.damping_ratio * mode.damping_ratio).sqrt();
        let scale = libm::exp(-decay * step_s);
        let sine = scale * libm::sin(damped * step_s) / damped;
        let cosine = scale * libm::cos(damped * step_s);
        Self {
            transition: [[cosine + decay * sine, sine], [-omega * omega * sine, cosine - decay * sine]],
            half_step_s: 0.5 * step_s,
            lag_s: 2.0 * mode.damping_ratio / omega,
            stiffness_n_per_mm: mode.stiffness_n_per_mm,
            omega_squared: omega * omega,
            damping: 2.0 * decay,
            deflection_mm: 0.0,
            speed_mm_per_s: 0.0,
        }
    }

    /// Acceleration under a force in N, mm/s².
    #[inline]
    pub fn acceleration(&self, force_n: f64) -> f64 {
        let still = force_n / self.stiffness_n_per_mm;
        self.omega_squared * (still - self.deflection_mm) - self.damping * self.speed_mm_per_s
    }

    /// By how much the deflection changes over half of a step, mm.
    #[inline]
    pub fn change_mm(&self) -> f64 {
        self.half_step_s * self.speed_mm_per_s
    }

    /// Goes on by one step under a force in N of this mean that changes steadily by so much over half of the step.
    #[inline]
    pub fn advance(&mut self, mean_n: f64, change_n: f64) {
        // What follows the force: x_p = (F − 2ζ/ω·Ḟ)/k.
        let steady = change_n / (self.half_step_s * self.stiffness_n_per_mm);
        let middle = mean_n / self.stiffness_n_per_mm - self.lag_s * steady;
        let [start, end] = [middle - self.half_step_s * steady, middle + self.half_step_s * steady];
        let (offset, speed) = (self.deflection_mm - start, self.speed_mm_per_s - steady);
        let [[xx, xv], [vx, vv]] = self.transition;
        self.deflection_mm = end + xx * offset + xv * speed;
        self.speed_mm_per_s = steady + vx * offset + vv * speed;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_response_is_the_textbook_one_whatever_the_sample() {
        let mode = Mode { frequency_hz: 400.0, damping_ratio: 0.05, stiffness_n_per_mm: 8000.0 };
        let omega = TAU * 400.0;
        let damped = omega * libm::sqrt(1.0 - 0.05 * 0.05);
        for sample_s in [1e-5, 1e-3, 0.0171] {
            let mut oscillator = Oscillator::new(&mode, sample_s);
            for step in 1..=50 {
                oscillator.advance(160.0, 0.0);
                let t = f64::from(step) * sample_s;
                let shape = libm::cos(damped * t) + 0.05 * omega / damped * libm::sin(damped * t);
                let expected = 0.02 * (1.0 - libm::exp(-0.05 * omega * t) * shape);
                assert!((oscillator.deflection_mm - expected).abs() < 1e-12, "{t} s");
            }
        }
    }

    #[test]
    fn acceleration_is_the_second_derivative() {
        let mode = Mode { frequency_hz: 400.0, damping_ratio: 0.05, stiffness_n_per_mm: 8000.0 };
        let mut oscillator = Oscillator::new(&mode, 1e-6);
        let mut positions = Vec::new();
        for _ in 0..1000 {
            positions.push((oscillator.deflection_mm, oscillator.acceleration(160.0)));
            oscillator.advance(160.0, 0.0);
        }
        for three in positions.windows(3) {
            let second = (three[0].0 - 2.0 * three[1].0 + three[2].0) / 1e-12;
            assert!((second - three[1].1).abs() < 1.0 + 1e-3 * three[1].1.abs(), "{second} {}", three[1].1);
        }
    }
}
