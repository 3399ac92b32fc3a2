//! Intervals of values, and of lengths of vectors whose parts are estimated.

use super::Estimate;

/// Quantile of the normal distribution for 95 % between both ends.
const NORMAL: f64 = 1.959_963_984_540_054;
/// From this many standard errors on a length is as good as normal.
const NEARLY_NORMAL: f64 = 8.0;
/// Probability below the lower end of an interval's estimate.
const BELOW: f64 = 0.975;

impl Estimate {
    /// Of a value whose estimate is normal.
    pub(super) fn of_value(value: f64, standard_error: f64) -> Self {
        let half = NORMAL * standard_error;
        Self { value, standard_error, lower: value - half, upper: value + half }
    }

    /// Of the length of a vector, with the variances and the covariance of its parts.
    ///
    /// The measured length is never below 0, and near 0 too long: it has Rice's distribution. The lower end is the length that
    /// gives no longer vector with 97.5 %, or 0 where every length does; at the upper end a length that is further off lies beyond in
    /// its own direction alone. With unequal parts the wider one counts for both, so the interval is none too narrow.
    pub(super) fn of_length([a, b]: [f64; 2], [aa, ab, bb]: [f64; 3]) -> Self {
        let value = libm::hypot(a, b);
        let widest = (0.5 * (aa + bb) + libm::hypot(0.5 * (aa - bb), ab)).max(0.0).sqrt();
        if value <= NEARLY_NORMAL * widest {
            let lower = rice_lower(value, widest);
            return Self { value, standard_error: widest, lower, upper: value + NORMAL * widest };
        }
        let [u, v] = [a / value, b / value];
        let variance = u * u * aa + 2.0 * u * v * ab + v * v * bb;
        Self::of_value(value, variance.max(0.0).sqrt())
    }
}

/// The length that is measured as no more than `value` with 97.5 %, where each part has the standard error `sigma`; 0 where
/// none is.
fn rice_lower(value: f64, sigma: f64) -> f64 {
    if sigma <= 0.0 || sigma.is_nan() {
        return value;
    }
    let ratio = value / sigma;
    if shorter(ratio, 0.0) <= BELOW {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, ratio);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if shorter(ratio, middle) > BELOW { low = middle } else { high = middle }
    }
    low * sigma
}

/// Probability that a vector of length `truth` is measured as no longer than `measured`, both in standard errors of its parts: the
/// noncentral χ² distribution of two degrees of freedom as a sum of central ones with Poisson's weights.
fn shorter(measured: f64, truth: f64) -> f64 {
    let (x, mean) = (0.5 * measured * measured, 0.5 * truth * truth);
    let (mut weight, mut term) = (libm::exp(-mean), libm::exp(-x));
    let mut beyond = term;
    let mut sum = weight * (1.0 - beyond);
    // Weights beyond the mean by ten of its deviations are rounding.
    let most = (mean + 10.0 * mean.sqrt() + 40.0) as u32;
    for count in 1..=most {
        weight *= mean / f64::from(count);
        term *= x / f64::from(count);
        beyond += term;
        sum += weight * (1.0 - beyond);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distribution_of_a_length_is_that_of_rayleigh_at_zero_and_normal_far_away() {
        for measured in [0.1, 1.0, 2.5] {
            assert!((shorter(measured, 0.0) - (1.0 - libm::exp(-0.5 * measured * measured))).abs() < 1e-15);
        }
        // Marcum's Q of order 1: Q(1, 1) = 0.7328798, Q(2, 1) = 0.9181077.
        assert!((1.0 - shorter(1.0, 1.0) - 0.732_879_8).abs() < 1e-6);
        assert!((1.0 - shorter(1.0, 2.0) - 0.918_107_7).abs() < 1e-6);
    }

    #[test]
    fn a_length_near_zero_has_an_interval_from_zero_on() {
        let estimate = Estimate::of_length([0.3, -0.2], [1.0, 0.0, 1.0]);
        assert_eq!(estimate.lower, 0.0);
        assert!((estimate.upper - estimate.value - NORMAL).abs() < 1e-12);
        assert!(!estimate.is_positive());
        // Just beyond what noise alone gives in one of forty cases.
        let estimate = Estimate::of_length([2.8, 0.0], [1.0, 0.0, 1.0]);
        assert!(estimate.lower > 0.0 && estimate.lower < 1.0, "{estimate:?}");
        let far = Estimate::of_length([30.0, 40.0], [1.0, 0.0, 4.0]);
        assert!((far.standard_error - (0.36 + 0.64 * 4.0_f64).sqrt()).abs() < 1e-12);
    }
}
