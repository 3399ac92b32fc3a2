//! System variables of FANUC and Haas.

use super::{Effect, Row, System};
use crate::dialect::FeedUnit;
use crate::expression::{Value, nearest};
use crate::state::Motion;
use crate::{Axis, DialectName, PathControl, Plane};

pub(super) static ROWS: &[Row] = &[
    (4_001, 4_030, |system, place| modal(system, place + 1).map(Some)),
    (4_109, 4_109, |system, _| Some(Some(system.state.feed_as_written))),
    (4_111, 4_111, |system, _| Some(Some(f64::from(system.state.length.number)))),
    (4_119, 4_119, |system, _| Some(Some(speed(system)))),
    (4_120, 4_120, |system, _| Some(Some(f64::from(system.state.tool)))),
    (5_001, 5_020, |system, place| on_axis(system, place, |axis| system.state.position[axis.index()])),
    (5_021, 5_040, |system, place| {
        let offset = system.machine_offset();
        on_axis(system, place, |axis| system.state.position[axis.index()] + offset[axis.index()])
    }),
    (5_041, 5_060, |system, place| {
        on_axis(system, place, |axis| system.state.position[axis.index()] + tool_offset(system, axis))
    }),
    (5_081, 5_100, |system, place| on_axis(system, place, |axis| tool_offset(system, axis))),
    (5_221, 5_340, |system, place| {
        let offset = system.work_offset(place as usize / 20)?;
        on_axis(system, place % 20, |axis| offset[axis.index()])
    }),
];

/// The axis of this place in the order of the control. Beyond the first ones the order is the machine's.
fn axis_at(system: &System<'_>, place: u32) -> Option<Axis> {
    let axes: &[Axis] = match system.settings.dialect {
        DialectName::Lathe => &[Axis::X, Axis::Z],
        DialectName::Mill | DialectName::LinuxCnc => &[Axis::X, Axis::Y, Axis::Z],
    };
    axes.get(place as usize).copied()
}

/// What the last probing move is taken to have found.
pub(super) fn probed(system: &System<'_>, place: u32) -> Option<Value> {
    let end = system.state.probed.as_ref()?;
    on_axis(system, place, |axis| end[axis.index()])
}

/// A value per axis, in the units of the program; `None` where the axis or its place is not known.
fn on_axis(system: &System<'_>, place: u32, value: impl Fn(Axis) -> f64) -> Option<Value> {
    let axis = axis_at(system, place)?;
    let mut position = [0.0; crate::AXIS_COUNT];
    position[axis.index()] = value(axis);
    system.place(&position, axis).map(Some)
}

/// The tool offset in effect, mm.
fn tool_offset(system: &System<'_>, axis: Axis) -> f64 {
    if axis == Axis::Z { system.state.length.along_z_mm } else { 0.0 }
}

/// The speed as the program writes it.
fn speed(system: &System<'_>) -> f64 {
    let state = system.state;
    match state.surface_speed {
        true if state.inch => state.m_per_min / 0.3048,
        true => state.m_per_min,
        false => state.rev_per_min,
    }
}

/// The G code of a modal group in force before the block; `None` where the group is not kept.
fn modal(system: &System<'_>, group: u32) -> Option<f64> {
    let state = system.state;
    let is_lathe = system.settings.dialect == DialectName::Lathe;
    let choose = |first: bool, one: f64, other: f64| Some(if first { one } else { other });
    match group {
        1 => motion(state.motion),
        2 if is_lathe => choose(state.surface_speed, 96.0, 97.0),
        2 | 16 if (group == 2) != is_lathe => Some(match state.plane {
            Plane::Xy => 17.0,
            Plane::Zx => 18.0,
            Plane::Yz => 19.0,
        }),
        3 => choose(state.absolute, 90.0, 91.0),
        5 if !is_lathe => Some(match state.feed_unit {
            FeedUnit::InverseTime => 93.0,
            FeedUnit::PerMinute => 94.0,
            FeedUnit::PerRevolution => 95.0,
        }),
        6 => choose(state.inch, 20.0, 21.0),
        7 => Some(40.0),
        8 if !is_lathe => match (state.length.number, state.length.negative) {
            (0, _) => Some(49.0),
            (_, false) => Some(43.0),
            (_, true) => Some(44.0),
        },
        9 if !is_lathe => Some(80.0),
        13 if !is_lathe => choose(state.surface_speed, 96.0, 97.0),
        14 => Some(54.0 + f64::from(state.work_offset)),
        15 if !is_lathe => choose(matches!(state.path_control, PathControl::Continuous { .. }), 64.0, 61.0),
        _ => None,
    }
}

fn motion(motion: Motion) -> Option<f64> {
    match motion {
        Motion::Rapid => Some(0.0),
        Motion::Linear => Some(1.0),
        Motion::Arc { clockwise } => Some(if clockwise { 2.0 } else { 3.0 }),
        Motion::Thread => Some(33.0),
        _ => None,
    }
}

/// What assigning a system variable does; `None` where it cannot be assigned.
pub(super) fn effect(number: u32, value: Value) -> Option<Effect> {
    match number {
        3_000 => Some(Effect::Alarm(nearest(value.unwrap_or(0.0)).clamp(0.0, 9_999.0) as u32)),
        3_006 => Some(Effect::Stop),
        // Clock, block and override inhibit, counter: nothing of them changes a path.
        3_001..=3_004 | 3_901 | 3_902 => Some(Effect::Ignored),
        _ => None,
    }
}
