//! What the drives of several axes together do at a place of the path.

use feedwave_motion::Element;
use feedwave_program::Axis;

use super::{FollowingModel, Response};

/// The linear axes that carry a path, in the order of [`Axis::ALL`].
const LINEAR: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];
/// Curvature below which a path counts as straight, 1/mm: half a square millimetre over it is 5e-13 mm.
const STRAIGHT_PER_MM: f64 = 1e-12;
/// Places of a curve that are looked at before the largest is refined.
const PLACES: usize = 33;
/// Steps by which it is refined; each takes a third off.
const REFINEMENTS: usize = 40;

/// Direction and curvature of a path at one of its places, by the linear axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PathPlace {
    /// Derivative of the position by path length.
    pub(crate) tangent: [f64; 3],
    /// Second derivative, 1/mm.
    pub(crate) curvature: [f64; 3],
}

impl PathPlace {
    pub(crate) fn of(element: &Element, at_mm: f64) -> Self {
        let (tangent, curvature) = (element.tangent(at_mm), element.second_derivative(at_mm));
        Self {
            tangent: LINEAR.map(|axis| tangent[axis.index()]),
            curvature: LINEAR.map(|axis| curvature[axis.index()]),
        }
    }

    /// Complex share of a vibration along the path that arrives along it: Σ τᵢ²·Hᵢ.
    pub(crate) fn arriving(&self, model: &FollowingModel, frequency_hz: f64) -> Response {
        let shares = LINEAR.into_iter().zip(self.tangent);
        shares.fold(Response::default(), |sum, (axis, tangent)| {
            sum.plus(model.of(axis).response(frequency_hz).scaled(tangent * tangent))
        })
    }

    /// How far a vibration along the path of amplitude 1 leaves it, at its peak: the larger half-axis of the ellipse
    /// that the part of (τᵢ·Hᵢ) across the path goes through.
    pub(crate) fn vibration_error(&self, model: &FollowingModel, frequency_hz: f64) -> f64 {
        let along = self.arriving(model, frequency_hz);
        let (mut real, mut imaginary, mut mixed) = (0.0, 0.0, 0.0);
        for (axis, tangent) in LINEAR.into_iter().zip(self.tangent) {
            let across = model.of(axis).response(frequency_hz).minus(along).scaled(tangent);
            real += across.re * across.re;
            imaginary += across.im * across.im;
            mixed += across.re * across.im;
        }
        largest_half_axis(real, imaginary, mixed)
    }

    /// How far the tool is from the contour in steady motion at `speed` mm/s, mm.
    ///
    /// The path is taken for its circle of curvature there, which the axes follow with H at ω = speed·κ:
    /// δᵢ = Re((Hᵢ − 1)·(rᵢ − i·τᵢ/κ)), r from the middle to the place; on a straight path that is −speed·Lᵢ·τᵢ with the lags
    /// Lᵢ of a steady motion.
    pub(crate) fn feed_error(&self, model: &FollowingModel, speed: f64) -> f64 {
        let curvature = norm(self.curvature);
        if curvature < STRAIGHT_PER_MM {
            let lag = core::array::from_fn(|at| -speed * model.of(LINEAR[at]).steady_lag_s() * self.tangent[at]);
            return norm(without(lag, self.tangent));
        }
        let radius = 1.0 / curvature;
        let outwards = self.curvature.map(|component| -component * radius);
        let moved: [f64; 3] = core::array::from_fn(|at| {
            let error = model.of(LINEAR[at]).error(speed * curvature);
            // Re((a + ib)(r − iτ)·R) = (a·r + b·τ)·R
            radius * (error.re * outwards[at] + error.im * self.tangent[at])
        });
        let (out, along) = (dot(moved, outwards), dot(moved, self.tangent));
        let off_plane = norm(without(without(moved, outwards), self.tangent));
        // √((R + out)² + along²) − R without cancellation.
        let from_middle = libm::hypot(radius + out, along);
        let radial = (2.0 * radius * out + out * out + along * along) / (from_middle + radius);
        libm::hypot(radial, off_plane)
    }
}

/// The largest value on [0, `length`] and where it is: looked for at a few places, and refined around the best of them.
pub(crate) fn largest_between(length: f64, value: impl Fn(f64) -> f64) -> (f64, f64) {
    let step = length / (PLACES - 1) as f64;
    let at = |place: f64| (value(place), place);
    let larger = |a: (f64, f64), b: (f64, f64)| if b.0 > a.0 { b } else { a };
    let mut largest = (1..PLACES).map(|index| at(step * index as f64)).fold(at(0.0), larger);
    let (mut low, mut high) = ((largest.1 - step).max(0.0), (largest.1 + step).min(length));
    for _ in 0..REFINEMENTS {
        let third = (high - low) / 3.0;
        let (left, right) = (at(low + third), at(high - third));
        largest = larger(larger(largest, left), right);
        if left.0 < right.0 {
            low += third;
        } else {
            high -= third;
        }
    }
    largest
}

/// Largest |u·cos φ − v·sin φ| of two vectors with these squares and this product.
fn largest_half_axis(real: f64, imaginary: f64, mixed: f64) -> f64 {
    let (middle, half) = (0.5 * (real + imaginary), 0.5 * (real - imaginary));
    (middle + libm::hypot(half, mixed)).sqrt()
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

/// The part of a vector across a direction.
fn without(vector: [f64; 3], direction: [f64; 3]) -> [f64; 3] {
    let along = dot(vector, direction);
    core::array::from_fn(|at| vector[at] - along * direction[at])
}
