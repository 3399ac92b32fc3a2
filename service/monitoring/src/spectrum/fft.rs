//! Radix-2 transform with twiddle factors from `libm`: the same bits on every platform.

use std::f64::consts::TAU;

/// A complex number as (real, imaginary).
pub(super) type Complex = [f64; 2];

/// Twiddle factors e^(−2πi·j/n) for j < n/2.
#[derive(Debug, Clone)]
pub(super) struct Fft {
    twiddles: Vec<Complex>,
}

impl Fft {
    /// For transforms of `length`, a power of two from 2 up.
    pub fn new(length: usize) -> Self {
        let angle = |j: usize| TAU * j as f64 / length as f64;
        Self { twiddles: (0..length / 2).map(|j| [libm::cos(angle(j)), -libm::sin(angle(j))]).collect() }
    }

    /// Transforms in place: decimation in time after bit reversal (Cooley and Tukey, 1965).
    pub fn transform(&self, data: &mut [Complex]) {
        let length = data.len();
        let bits = length.trailing_zeros();
        for index in 0..length {
            let reversed = index.reverse_bits() >> (usize::BITS - bits);
            if index < reversed {
                data.swap(index, reversed);
            }
        }
        let mut half = 1;
        while half < length {
            let stride = length / (2 * half);
            for start in (0..length).step_by(2 * half) {
                for offset in 0..half {
                    let [wr, wi] = self.twiddles[offset * stride];
                    let [br, bi] = data[start + offset + half];
                    let product = [br * wr - bi * wi, br * wi + bi * wr];
                    let [ar, ai] = data[start + offset];
                    data[start + offset] = [ar + product[0], ai + product[1]];
                    data[start + offset + half] = [ar - product[0], ai - product[1]];
                }
            }
            half *= 2;
        }
    }
}
