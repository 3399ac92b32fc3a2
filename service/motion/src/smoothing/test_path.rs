//! Elements for the tests of this folder.

use core::f64::consts::TAU;

use feedwave_program::{ArcGeometry, Feed, Move, MoveKind, PathControl, Plane, Position, SourceSpan, Spindle};
use proptest::prelude::*;

use super::vector::Vector;
use crate::{Element, Spline};

pub(super) fn at([x, y, z]: Vector) -> Position {
    [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

pub(super) fn moved(start: Vector, end: Vector, arc: Option<ArcGeometry>) -> Move {
    Move {
        kind: MoveKind::Cutting,
        start: at(start),
        end: at(end),
        work_offset: [0.0; 9],
        arc,
        spline: None,
        path_control: PathControl::default(),
        feed: Feed::PerMinute(1_000.0),
        spindle: Spindle::STOPPED,
        tool: 0,
        leads_xyz: false,
        cycle: None,
    }
}

pub(super) fn line(start: Vector, end: Vector) -> Element {
    Element::from_move(&moved(start, end, None), SourceSpan::default()).expect("it moves")
}

/// A block that starts wherever the one before ends.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    Line {
        by: Vector,
    },
    /// A helix in XY that starts in this direction.
    Arc {
        radius: f64,
        direction: f64,
        sweep: f64,
        rise: f64,
    },
    /// A quintic Bézier curve that swings to both sides of its chord by these parts of it.
    Spline {
        by: Vector,
        swings: [f64; 2],
    },
}

impl Shape {
    pub(super) fn element(self, start: Vector) -> Element {
        let [x, y, z] = start;
        match self {
            Self::Line { by: [dx, dy, dz] } => line(start, [x + dx, y + dy, z + dz]),
            Self::Spline { by, swings } => {
                let aside = [-by[1], by[0], 0.3 * by[0]];
                let points = [0.0, swings[0], swings[0], swings[1], swings[1], 0.0];
                let mut share = 0.0;
                let points = points.map(|swing| {
                    let point = core::array::from_fn(|axis| start[axis] + share * by[axis] + swing * aside[axis]);
                    share += 0.2;
                    point
                });
                let spline = Spline::from_polynomial_spans(&[points]).expect("it has no cusp");
                let [_, end] = spline.ends();
                Element::from_spline(at(start), at(end), spline, [0.0; 9], SourceSpan::default(), false)
                    .expect("it starts and ends there")
            }
            Self::Arc { radius, direction, sweep, rise } => {
                let to_center = direction + 0.25 * TAU * sweep.signum();
                let center = [x + radius * to_center.cos(), y + radius * to_center.sin()];
                let last = to_center + 0.5 * TAU + sweep;
                let end = [center[0] + radius * last.cos(), center[1] + radius * last.sin(), z + rise];
                let arc = ArcGeometry { plane: Plane::Xy, center, clockwise: sweep < 0.0, sweep_rad: sweep };
                Element::from_move(&moved(start, end, Some(arc)), SourceSpan::default()).expect("it moves")
            }
        }
    }
}

pub(super) fn lines() -> impl Strategy<Value = Shape> {
    let size = prop_oneof![0.001..0.1, 0.1..20.0_f64];
    (size, -1.0..1.0_f64, -1.0..1.0_f64, -0.5..0.5_f64)
        .prop_filter("it moves", |(_, x, y, _)| x.abs() + y.abs() > 0.01)
        .prop_map(|(size, x, y, z)| Shape::Line { by: [size * x, size * y, size * z] })
}

pub(super) fn shapes() -> impl Strategy<Value = Shape> {
    let sweep = prop_oneof![0.01..0.9 * TAU, -0.9 * TAU..-0.01];
    let arcs = (0.05..20.0_f64, 0.0..TAU, sweep, -2.0..2.0_f64)
        .prop_map(|(radius, direction, sweep, rise)| Shape::Arc { radius, direction, sweep, rise });
    let splines = (-10.0..10.0_f64, 0.1..10.0_f64, prop::array::uniform2(-0.5..0.5_f64))
        .prop_map(|(x, y, swings)| Shape::Spline { by: [x, y, 0.2 * y], swings });
    prop_oneof![2 => lines(), 2 => arcs, 1 => splines]
}

/// The elements of blocks that follow each other.
pub(super) fn chain(shapes: &[Shape]) -> Vec<Element> {
    let mut start = [0.0; 3];
    let mut elements = Vec::new();
    for shape in shapes {
        let element = shape.element(start);
        start = super::vector::linear(&element.end);
        elements.push(element);
    }
    elements
}
