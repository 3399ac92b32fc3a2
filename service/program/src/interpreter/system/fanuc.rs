//! System variables of FANUC and Haas.

use super::{Effect, Row, System};
use crate::dialect::FeedUnit;
use crate::expression::{Value, nearest};
use crate::state::{Motion, SingleCycle, ToolMode};
use crate::{Axis, DialectName, GCodeSystem, PathControl, Plane};

/// Outputs to the machine.
const OUTPUTS: core::ops::RangeInclusive<u32> = 1_100..=1_139;

pub(super) static ROWS: &[Row] = &[
    (4_001, 4_030, |system, place| modal(system, place + 1).map(Some)),
    (4_109, 4_109, |system, _| Some(Some(system.state.thread.lead_as_written.unwrap_or(system.state.feed_as_written)))),
    (4_111, 4_111, |system, _| Some(Some(f64::from(length_number(system))))),
    (4_107, 4_107, |system, _| {
        let is_mill = system.settings.dialect == DialectName::Mill;
        number(system.state.compensation.number.or(is_mill.then_some(0)))
    }),
    (4_113, 4_113, |system, _| number(system.state.m_code)),
    (4_114, 4_114, |system, _| number(system.state.sequence_number)),
    (4_115, 4_115, |system, _| number(system.state.program_number)),
    (4_119, 4_119, |system, _| Some(Some(super::speed(system)))),
    (4_120, 4_120, |system, _| Some(Some(f64::from(system.state.tool_word)))),
    (4_130, 4_130, |system, _| number(system.state.coords.system.extended_number().map(u32::from))),
    (5_001, 5_020, |system, place| work(system, place, |_| 0.0)),
    (5_021, 5_040, |system, place| axis_at(system, place).and_then(|axis| system.machine(axis)).map(Some)),
    (5_041, 5_060, |system, place| {
        // That of the tool, as #5021 is.
        axis_at(system, place).filter(|axis| system.is_of_tool(*axis))?;
        work(system, place, |axis| tool_offset(system, axis).unwrap_or(0.0))
    }),
    (5_081, 5_100, |system, place| {
        let axis = axis_at(system, place)?;
        Some(Some(system.in_units(axis, tool_offset(system, axis)?)))
    }),
];

/// A number that is refused where it is not known.
fn number(number: Option<u32>) -> Option<Value> {
    number.map(|number| Some(f64::from(number)))
}

/// `H` of the length in force, 0 without one.
const fn length_number(system: &System<'_>) -> u32 {
    let control = &system.state.tool_control;
    match control.mode {
        ToolMode::Angles | ToolMode::Vectors => control.length_offset,
        ToolMode::Off | ToolMode::Plane => system.state.length.number,
    }
}

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

/// The tool offset in effect, mm: in a tilted plane and under tool centre point control the length; `None` where it is not known.
fn tool_offset(system: &System<'_>, axis: Axis) -> Option<f64> {
    let control = &system.state.tool_control;
    match control.mode {
        ToolMode::Off => Some(system.state.length.offset[axis.index()]),
        _ if axis != Axis::Z => Some(0.0),
        ToolMode::Plane => Some(system.state.length.length_mm),
        ToolMode::Angles | ToolMode::Vectors => control.tool_length_mm,
    }
}

/// The work position and something added. What it is under a mirror image, scaling or rotation, controls say differently.
fn work(system: &System<'_>, place: u32, added: impl Fn(Axis) -> f64) -> Option<Value> {
    let is_known = !system.is_transformed();
    let value = |axis: Axis| system.state.position[axis.index()] + added(axis);
    if is_known { on_axis(system, place, value) } else { None }
}

/// The G code of a modal group in force before the block; `None` where the group is not kept.
fn modal(system: &System<'_>, group: u32) -> Option<f64> {
    let state = system.state;
    let is_lathe = system.settings.dialect == DialectName::Lathe;
    let is_haas = system.settings.is_haas();
    let choose = |first: bool, one: f64, other: f64| Some(if first { one } else { other });
    let transform = state.coords.transform.as_deref();
    match group {
        1 => motion(system),
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
        5 => system.settings.g_code_system.map(|_| {
            let [per_minute, per_revolution] = system.settings.feed_codes();
            code_number(if state.feed_unit == FeedUnit::PerRevolution { per_revolution } else { per_minute })
        }),
        6 => choose(state.inch, 20.0, 21.0),
        7 => Some(match state.compensation.on {
            None => 40.0,
            Some(on) if on.left => 41.0,
            Some(_) => 42.0,
        }),
        8 if !is_lathe => Some(match (state.tool_control.mode, state.length.is_on) {
            (ToolMode::Angles, _) => 43.4,
            (ToolMode::Vectors, _) => 43.5,
            (_, false) => 49.0,
            (_, true) if state.length.negative => 44.0,
            (_, true) => 43.0,
        }),
        9 if !is_lathe => Some(state.drilling.cycle.map_or(80.0, |cycle| code_number(cycle.name()))),
        10 if !is_lathe => choose(state.drilling.to_r, 99.0, 98.0),
        11 if !is_lathe => choose(transform.is_some_and(|it| it.scaling.is_some()), 51.0, 50.0),
        // On Haas controls the work offsets are group 12, and there is no group 14.
        12 if is_haas => state.coords.system.extended_number().is_none().then(|| work_system(system)),
        14 if is_haas => None,
        12 => choose(state.flow.has_modal_calls(), 66.0, 67.0),
        13 if !is_lathe => choose(state.surface_speed, 96.0, 97.0),
        14 => Some(work_system(system)),
        15 if !is_lathe && state.path_code > 0 => Some(f64::from(state.path_code) / 10.0),
        15 if !is_lathe => choose(matches!(state.path_control, PathControl::Continuous { .. }), 64.0, 61.0),
        16 if !is_lathe => choose(transform.is_some_and(|it| it.rotation.is_some()), 68.0, 69.0),
        17 if !is_lathe => choose(state.coords.polar.is_some(), 16.0, 15.0),
        22 if !is_lathe => choose(transform.is_some_and(|it| it.mirror.iter().any(Option::is_some)), 51.1, 50.1),
        _ => None,
    }
}

/// The code of the work offset in force.
fn work_system(system: &System<'_>) -> f64 {
    f64::from(system.state.coords.system.tenths()) / 10.0
}

/// The number of a G code as written.
fn code_number(code: &str) -> f64 {
    code.trim_start_matches('G').parse().unwrap_or(0.0)
}

/// The code of motion in force; `None` where it depends on a G-code system that is not known, and where there is none.
fn motion(system: &System<'_>) -> Option<f64> {
    let lathe = || match system.settings.g_code_system {
        _ if system.settings.dialect != DialectName::Lathe => None,
        None if !system.state.is_system_a && !system.settings.is_haas() => None,
        None => Some(GCodeSystem::A),
        known => known,
    };
    // Of systems A, B and C.
    let of_system = |codes: [f64; 3]| lathe().map(|known| codes[known as usize]);
    match system.state.motion {
        Motion::Rapid => Some(0.0),
        Motion::Linear => Some(1.0),
        Motion::Arc { clockwise } => Some(if clockwise { 2.0 } else { 3.0 }),
        Motion::Thread if system.settings.dialect != DialectName::Lathe => Some(33.0),
        Motion::Thread => of_system([32.0, 33.0, 33.0]),
        Motion::SingleCycle(SingleCycle::Turn) => of_system([90.0, 77.0, 20.0]),
        Motion::ThreadCycle => of_system([92.0, 78.0, 21.0]),
        Motion::SingleCycle(SingleCycle::Face) => of_system([94.0, 79.0, 24.0]),
        _ => None,
    }
}

/// What assigning a system variable does; `None` where it cannot be assigned.
pub(super) fn effect(number: u32, value: Value) -> Option<Effect> {
    match number {
        number if OUTPUTS.contains(&number) => Some(Effect::Ignored),
        3_000 => Some(Effect::Alarm(nearest(value.unwrap_or(0.0)).clamp(0.0, 9_999.0) as u32)),
        3_006 => Some(Effect::Stop),
        // Clock, block and override inhibit, counter, outputs: nothing of them changes a path.
        3_001..=3_004 | 3_901 | 3_902 => Some(Effect::Ignored),
        _ => None,
    }
}
