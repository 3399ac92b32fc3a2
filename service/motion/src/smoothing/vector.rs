//! Vectors of X, Y and Z, and of further coordinates.

use feedwave_program::{Axis, Position};

/// X, Y and Z.
pub(super) type Vector = [f64; 3];

pub(super) fn sum<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    core::array::from_fn(|k| a[k] + b[k])
}

pub(super) fn difference<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    core::array::from_fn(|k| a[k] - b[k])
}

pub(super) fn scaled<const N: usize>(a: [f64; N], factor: f64) -> [f64; N] {
    a.map(|value| value * factor)
}

pub(super) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// X, Y and Z of a position.
pub(super) fn linear(position: &Position) -> Vector {
    [Axis::X, Axis::Y, Axis::Z].map(|axis| position[axis.index()])
}
