//! Vectors of X, Y and Z.

use feedwave_program::{Axis, Position};

/// X, Y and Z.
pub(super) type Vector = [f64; 3];

pub(super) fn sum(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn difference(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn scaled(a: Vector, factor: f64) -> Vector {
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
