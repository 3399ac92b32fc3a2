//! Places of a curve and of the programmed path.

use feedwave_program::Axis;

use super::super::vector::{Vector, linear, scaled};
use super::bezier::State;
use crate::{Curve, Element, FiveAxis};

/// X, Y and Z, mm; under tool centre point control those of the tool centre point and both rotary axes, rad, which are 0 otherwise.
pub(super) type Point = [f64; GUIDED];

/// Coordinates of a place on three axes.
pub(super) const LINEAR: usize = 3;
/// The same under tool centre point control.
pub(super) const GUIDED: usize = 5;

/// The first coordinates of a place.
pub(super) fn first<const N: usize>(point: Point) -> [f64; N] {
    core::array::from_fn(|k| point[k])
}

/// A place by its first coordinates.
pub(super) fn filled<const N: usize>(first: [f64; N]) -> Point {
    core::array::from_fn(|k| first.get(k).copied().unwrap_or_default())
}

/// X, Y and Z of a place.
pub(super) fn tip<const N: usize>(point: [f64; N]) -> Vector {
    [point[0], point[1], point[2]]
}

/// The rotary axes of a place, rad.
pub(super) fn turns([.., first, second]: Point) -> [f64; 2] {
    [first, second]
}

/// The programmed path at an arc length of an element.
pub(super) fn exact(element: &Element, s: f64) -> State {
    State {
        point: point(element, s),
        first: slope(element, s),
        second: match &element.curve {
            Curve::FiveAxis(five_axis) => {
                let second = element.second_derivative(s);
                let [first, second] = rotary(five_axis).map(|axis| second[axis.index()].to_radians());
                [0.0, 0.0, 0.0, first, second]
            }
            _ => beside_nothing(linear(&element.second_derivative(s))),
        },
        is_free: false,
    }
}

/// The programmed path at an arc length of an element: to the bit at its ends.
pub(super) fn point(element: &Element, s: f64) -> Point {
    let Curve::FiveAxis(five_axis) = &element.curve else {
        return beside_nothing([Axis::X, Axis::Y, Axis::Z].map(|axis| value(element, axis, s)));
    };
    let [start, end] = *five_axis.tip().ends();
    let [x, y, z] = match s {
        s if s <= 0.0 => start,
        s if s >= element.length => end,
        s => five_axis.tip().at(s / element.length),
    };
    let [first, second] = rotary(five_axis).map(|axis| value(element, axis, s).to_radians());
    [x, y, z, first, second]
}

/// Its derivative by arc length.
pub(super) fn slope(element: &Element, s: f64) -> Point {
    let Curve::FiveAxis(five_axis) = &element.curve else { return beside_nothing(linear(&element.tangent(s))) };
    let [x, y, z] = scaled(five_axis.tip().slope(s / element.length), 1.0 / element.length);
    let [first, second] = rotary(five_axis).map(|axis| {
        let mut slope = [0.0];
        element.fill_tangent(axis, &[s], &mut slope);
        slope[0].to_radians()
    });
    [x, y, z, first, second]
}

fn beside_nothing([x, y, z]: Vector) -> Point {
    [x, y, z, 0.0, 0.0]
}

fn rotary(five_axis: &FiveAxis) -> [Axis; 2] {
    let [.., first, second] = *five_axis.axes();
    [first, second]
}

fn value(element: &Element, axis: Axis, s: f64) -> f64 {
    let mut value = [0.0];
    element.fill_axis(axis, &[s], &mut value);
    value[0]
}
