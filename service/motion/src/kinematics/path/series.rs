//! Truncated power series: functions of a short stretch of the path with all their derivatives. Each operation is the
//! exact one, cut off after N terms (Griewank and Walther, *Evaluating Derivatives*, 2008, chapter 13).

use core::ops::{Add, Mul, Neg, Sub};

use crate::kinematics::vector::Vec3;

/// c₀ + c₁·t + … + c₍N₋₁₎·tᴺ⁻¹.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Series<const N: usize>(pub(super) [f64; N]);

/// A vector whose components are series.
pub(super) type SeriesVec<const N: usize> = [Series<N>; 3];

impl<const N: usize> Series<N> {
    pub(super) const ZERO: Self = Self([0.0; N]);

    pub(super) fn constant(value: f64) -> Self {
        Self::linear(value, 0.0)
    }

    /// value + slope·t.
    pub(super) fn linear(value: f64, slope: f64) -> Self {
        let mut series = Self::ZERO;
        series.0[0] = value;
        if N > 1 {
            series.0[1] = slope;
        }
        series
    }

    pub(super) fn scaled(self, factor: f64) -> Self {
        Self(self.0.map(|value| value * factor))
    }

    pub(super) fn plus(mut self, value: f64) -> Self {
        self.0[0] += value;
        self
    }

    /// Value at t.
    pub(super) fn at(&self, t: f64) -> f64 {
        self.0.iter().rev().fold(0.0, |sum, coefficient| sum * t + coefficient)
    }

    pub(super) fn divided_by(self, divisor: Self) -> Self {
        let mut quotient = [0.0; N];
        let per_first = 1.0 / divisor.0[0];
        for k in 0..N {
            let known: f64 = (0..k).map(|j| quotient[j] * divisor.0[k - j]).sum();
            quotient[k] = (self.0[k] - known) * per_first;
        }
        Self(quotient)
    }

    /// The positive root of a series that starts with a positive number.
    pub(super) fn sqrt(self) -> Self {
        let mut root = [0.0; N];
        root[0] = libm::sqrt(self.0[0]);
        let half = 0.5 / root[0];
        for k in 1..N {
            let known: f64 = (1..k).map(|j| root[j] * root[k - j]).sum();
            root[k] = (self.0[k] - known) * half;
        }
        Self(root)
    }

    /// Sine and cosine.
    pub(super) fn sincos(self) -> (Self, Self) {
        let (mut sine, mut cosine) = ([0.0; N], [0.0; N]);
        (sine[0], cosine[0]) = libm::sincos(self.0[0]);
        for k in 1..N {
            let (mut rising, mut falling) = (0.0, 0.0);
            for j in 1..=k {
                let slope = j as f64 * self.0[j];
                rising += slope * cosine[k - j];
                falling += slope * sine[k - j];
            }
            sine[k] = rising / k as f64;
            cosine[k] = -falling / k as f64;
        }
        (Self(sine), Self(cosine))
    }

    /// The angle of (x, y), within (−π, π] at t = 0: its derivative is (x·y′ − y·x′)/(x² + y²).
    pub(super) fn atan2(y: Self, x: Self) -> Self {
        let slope = |series: Self| {
            let mut slope = [0.0; N];
            for k in 1..N {
                slope[k - 1] = k as f64 * series.0[k];
            }
            Self(slope)
        };
        let rate = (x * slope(y) - y * slope(x)).divided_by(x * x + y * y);
        let mut angle = Self::constant(libm::atan2(y.0[0], x.0[0]));
        for k in 1..N {
            angle.0[k] = rate.0[k - 1] / k as f64;
        }
        angle
    }
}

impl<const N: usize> Add for Series<N> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let mut sum = self;
        for (sum, other) in sum.0.iter_mut().zip(other.0) {
            *sum += other;
        }
        sum
    }
}

impl<const N: usize> Sub for Series<N> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        let mut difference = self;
        for (difference, other) in difference.0.iter_mut().zip(other.0) {
            *difference -= other;
        }
        difference
    }
}

impl<const N: usize> Neg for Series<N> {
    type Output = Self;

    fn neg(self) -> Self {
        self.scaled(-1.0)
    }
}

impl<const N: usize> Mul for Series<N> {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let mut product = [0.0; N];
        for (j, left) in self.0.into_iter().enumerate() {
            for (product, right) in product[j..].iter_mut().zip(other.0) {
                *product += left * right;
            }
        }
        Self(product)
    }
}

pub(super) fn vector<const N: usize>(v: Vec3) -> SeriesVec<N> {
    v.map(Series::constant)
}

pub(super) fn plus<const N: usize>(a: SeriesVec<N>, b: Vec3, sign: f64) -> SeriesVec<N> {
    [a[0].plus(sign * b[0]), a[1].plus(sign * b[1]), a[2].plus(sign * b[2])]
}

pub(super) fn dot<const N: usize>(a: &SeriesVec<N>, b: &SeriesVec<N>) -> Series<N> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// With a constant vector.
pub(super) fn dot_constant<const N: usize>(a: Vec3, b: &SeriesVec<N>) -> Series<N> {
    b[0].scaled(a[0]) + b[1].scaled(a[1]) + b[2].scaled(a[2])
}

pub(super) fn cross<const N: usize>(a: &SeriesVec<N>, b: &SeriesVec<N>) -> SeriesVec<N> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Turns `v` about the constant unit vector `axis` (Rodrigues): a(a·v) + (v − a(a·v))·cos + (a×v)·sin.
pub(super) fn rotate<const N: usize>(
    axis: Vec3,
    (sine, cosine): (Series<N>, Series<N>),
    v: &SeriesVec<N>,
) -> SeriesVec<N> {
    let along = dot_constant(axis, v);
    let across = [
        v[2].scaled(axis[1]) - v[1].scaled(axis[2]),
        v[0].scaled(axis[2]) - v[2].scaled(axis[0]),
        v[1].scaled(axis[0]) - v[0].scaled(axis[1]),
    ];
    core::array::from_fn(|k| {
        let parallel = along.scaled(axis[k]);
        parallel + (v[k] - parallel) * cosine + across[k] * sine
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The coefficients predict the function beside the place of expansion.
    #[test]
    fn series_continue_their_functions() {
        let x = Series::<12>::linear(0.7, 0.2);
        let t = 0.1;
        let value = 0.7 + 0.2 * t;
        let (sine, cosine) = x.sincos();
        let near = |series: Series<12>, value: f64| assert!((series.at(t) - value).abs() < 1e-14, "{series:?} {value}");
        near(sine, value.sin());
        near(cosine, value.cos());
        near((x * x).plus(0.5).sqrt(), (value * value + 0.5).sqrt());
        near(sine.divided_by(cosine), value.tan());
        near(Series::atan2(sine.scaled(2.0), cosine), (2.0 * value.sin()).atan2(value.cos()));
        near(Series::atan2(-sine, -cosine), value - core::f64::consts::PI);
        near(-x, -value);
    }
}
