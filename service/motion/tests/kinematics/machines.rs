//! Machines as their builders describe them, and random ones.

use feedwave_motion::kinematics::vector::{Vec3, unit};
use feedwave_motion::kinematics::{BranchPreference, ChainAxis, Kinematics, KinematicsDescription, Wrap};
use feedwave_program::Axis;
use proptest::prelude::*;

pub const X: Vec3 = [1.0, 0.0, 0.0];
pub const Y: Vec3 = [0.0, 1.0, 0.0];
pub const Z: Vec3 = [0.0, 0.0, 1.0];

pub fn linear(axis: Axis, direction: Vec3) -> ChainAxis {
    ChainAxis { axis, direction, point_mm: [0.0; 3], range: None, wrap: Wrap::Counting }
}

pub fn rotary(axis: Axis, direction: Vec3, point_mm: Vec3) -> ChainAxis {
    ChainAxis { axis, direction, point_mm, range: None, wrap: Wrap::Counting }
}

pub fn with_range(axis: ChainAxis, range: [f64; 2]) -> ChainAxis {
    ChainAxis { range: Some(range), ..axis }
}

pub fn machine(chain: Vec<ChainAxis>) -> KinematicsDescription {
    KinematicsDescription {
        chain,
        gauge_point_mm: [0.0, 0.0, 500.0],
        tool_direction: Z,
        preferred_branch: BranchPreference::Nearest,
    }
}

/// Trunnion table: A carries C, the lines do not meet.
pub fn table_table_ac() -> KinematicsDescription {
    machine(vec![
        rotary(Axis::C, Z, [10.0, 5.0, 0.0]),
        with_range(rotary(Axis::A, X, [0.0, 5.3, 40.0]), [-120.0, 30.0]),
        linear(Axis::Y, Y),
        linear(Axis::X, X),
        linear(Axis::Z, Z),
    ])
}

pub fn table_table_bc() -> KinematicsDescription {
    let a = rotary(Axis::C, Z, [0.0, 0.0, 0.0]);
    let b = rotary(Axis::B, Y, [0.2, 0.0, -60.0]);
    machine(vec![a, b, linear(Axis::X, X), linear(Axis::Y, Y), linear(Axis::Z, Z)])
}

/// Rotary table under a swivelling spindle.
pub fn head_table() -> KinematicsDescription {
    let c = rotary(Axis::C, Z, [100.0, 200.0, 0.0]);
    let b = rotary(Axis::B, Y, [0.0, 0.0, 650.0]);
    machine(vec![c, linear(Axis::X, X), linear(Axis::Y, Y), linear(Axis::Z, Z), b])
}

/// Fork head on a gantry.
pub fn head_head() -> KinematicsDescription {
    let c = rotary(Axis::C, Z, [0.0, 0.0, 900.0]);
    let a = rotary(Axis::A, X, [0.0, 0.4, 700.0]);
    machine(vec![linear(Axis::X, X), linear(Axis::Y, Y), linear(Axis::Z, Z), c, a])
}

/// Nutating head: the second axis is tilted by 45° in YZ, and the tool swings through a cone down to the horizontal.
pub fn nutating_head() -> KinematicsDescription {
    let c = rotary(Axis::C, Z, [0.0, 0.0, 900.0]);
    let b = rotary(Axis::B, [0.0, 1.0, 1.0], [0.0, 30.0, 700.0]);
    machine(vec![linear(Axis::X, X), linear(Axis::Y, Y), linear(Axis::Z, Z), c, b])
}

/// A rotary axis between the linear ones, linear axes out of square, the tool lying down.
pub fn oblique() -> KinematicsDescription {
    KinematicsDescription {
        tool_direction: X,
        gauge_point_mm: [300.0, -20.0, 80.0],
        ..machine(vec![
            linear(Axis::Y, [0.01, 1.0, 0.0]),
            rotary(Axis::B, [0.02, 1.0, -0.01], [12.0, 0.0, -7.0]),
            linear(Axis::X, [1.0, 0.0, 0.02]),
            linear(Axis::Z, [0.0, -0.015, 1.0]),
            rotary(Axis::C, [0.3, 0.1, 1.0], [40.0, 3.0, 9.0]),
        ])
    }
}

pub fn all() -> Vec<KinematicsDescription> {
    vec![table_table_ac(), table_table_bc(), head_table(), head_head(), nutating_head(), oblique()]
}

pub fn compiled(description: &KinematicsDescription) -> Kinematics {
    Kinematics::new(description).unwrap_or_else(|problems| panic!("{problems:?}"))
}

pub fn a_point(most_mm: f64) -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-most_mm..most_mm)
}

pub fn a_direction() -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-1.0..1.0).prop_filter_map("a zero vector has no direction", unit)
}

/// One of the machines above, or one with random lines, offsets and order of axes.
pub fn a_machine() -> impl Strategy<Value = Kinematics> {
    let order = Just(vec![0_usize, 1, 2, 3, 4]).prop_shuffle();
    let lines = (a_direction(), a_direction(), a_point(500.0), a_point(500.0));
    let random = (order, lines, a_direction(), a_point(500.0)).prop_filter_map(
        "parallel lines are refused",
        |(order, (first, second, point, other), tool_direction, gauge_point_mm)| {
            let axes = [
                rotary(Axis::A, first, point),
                rotary(Axis::C, second, other),
                linear(Axis::X, [1.0, 0.1, 0.0]),
                linear(Axis::Y, [0.0, 1.0, -0.1]),
                linear(Axis::Z, [0.05, 0.0, 1.0]),
            ];
            let chain = order.into_iter().map(|index| axes[index].clone()).collect();
            let preferred_branch = BranchPreference::Nearest;
            Kinematics::new(&KinematicsDescription { chain, gauge_point_mm, tool_direction, preferred_branch }).ok()
        },
    );
    prop_oneof![prop::sample::select(all()).prop_map(|description| compiled(&description)), random]
}
