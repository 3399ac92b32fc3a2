//! System variables of LinuxCNC: numbers from 5001 on, and predefined names.

use super::{Effect, Row, System};
use crate::dialect::FeedUnit;
use crate::expression::{Name, Value};
use crate::interpreter::compensation::TIP_OF_ORIENTATION;
use crate::interpreter::coordinates::tool_row;
use crate::{Axis, Plane, Position, SpindleDirection, ToolOffset};

pub(super) static ROWS: &[Row] = &[
    (5_021, 5_029, |system, place| axis(place).and_then(|axis| system.machine(axis)).map(Some)),
    (5_081, 5_089, |system, place| axis(place).map(|axis| Some(tool_offset(system, axis)))),
    (5_220, 5_220, |system, _| Some(system.state.coords.system.plain_number().map(f64::from))),
    (5_399, 5_399, |system, _| Some(Some(system.settings.input_result))),
    (5_400, 5_400, |system, _| Some(Some(f64::from(system.state.tool)))),
    (5_401, 5_409, |system, place| {
        axis(place).and_then(|axis| spindle_tool(system)?.total().map(|it| Some(it[axis.index()])))
    }),
    (5_410, 5_410, |system, _| Some(Some(spindle_tool(system)?.total_radius_mm()? * 2.0))),
    (5_411, 5_411, |system, _| Some(Some(spindle_tool(system)?.front_angle_deg))),
    (5_412, 5_412, |system, _| Some(Some(spindle_tool(system)?.back_angle_deg))),
    (5_413, 5_413, |system, _| Some(Some(orientation(spindle_tool(system)?.tip)))),
    (5_420, 5_428, |system, place| {
        // LinuxCNC refuses them while the radius is compensated, whatever the axis.
        axis(place).filter(|_| system.state.compensation.on.is_none()).and_then(|axis| work(system, axis)).map(Some)
    }),
];

/// Whether the value of a name comes from outside the interpreter: pins, the configuration, and predefined names that only the
/// machine has, as it alone knows which tool is in which pocket.
pub(super) fn is_outside(name: &Name) -> bool {
    ["_hal[", "_ini["].iter().any(|prefix| name.as_str().starts_with(prefix)) || is_predefined(name)
}

/// What the last probing move is taken to have found, in the units of the program.
pub(super) fn probed(system: &System<'_>, place: u32) -> Option<Value> {
    let end = system.state.probed.as_ref()?;
    axis(place).and_then(|axis| system.place(end, axis)).map(Some)
}

fn axis(place: u32) -> Option<Axis> {
    Axis::ALL.get(place as usize).copied()
}

/// Position of the tool in work coordinates, in the units of the program; `None` beside a contour.
fn work(system: &System<'_>, axis: Axis) -> Option<f64> {
    if system.is_of_tool(axis) { system.place(&system.state.position, axis) } else { None }
}

/// The row of the tool in the spindle, in machine units; without a tool everything is 0, and `None` where its row is not known.
/// `G43` and `G49` put offsets in force and change nothing of it.
fn spindle_tool(system: &System<'_>) -> Option<ToolOffset> {
    match system.state.tool {
        0 => Some(ToolOffset { geometry: Some(Position::default()), radius_mm: Some(0.0), ..ToolOffset::default() }),
        number => tool_row(system.state, system.tools, number),
    }
}

/// LinuxCNC's orientation of FANUC's number of the tip: the table is its own inverse.
fn orientation(tip: u8) -> f64 {
    f64::from(TIP_OF_ORIENTATION.get(usize::from(tip)).copied().unwrap_or_default())
}

/// What #5401 to #5413 are of the tool in the spindle, and what brings it; `None` for other numbers.
pub(super) fn of_spindle_tool(number: u32) -> Option<(&'static str, &'static str)> {
    Some(match number {
        5_401..=5_409 => ("the offset", "give the tool its length or offset, and the job the tool"),
        5_410 => ("the diameter", "give the tool its diameter, and the job the tool"),
        5_411 => ("the front angle", "give the job the tool"),
        5_412 => ("the back angle", "give the job the tool"),
        5_413 => ("the orientation", "give the job the tool"),
        _ => return None,
    })
}

/// The tool offset in effect, in machine units.
fn tool_offset(system: &System<'_>, axis: Axis) -> f64 {
    system.state.length.offset[axis.index()]
}

/// What assigning a number from 5001 on does; `None` where it cannot be assigned, or acts like `G10`.
pub(super) const fn effect(number: u32) -> Option<Effect> {
    match number {
        // The reference version takes the first three rows as plain parameters, later ones as values of the control.
        5_021..=5_029
        | 5_081..=5_089
        | 5_399
        | 5_400..=5_413
        | 5_420..=5_428
        | 5_161..=5_169
        | 5_181..=5_189
        | 5_210..=5_220 => None,
        // Twenty numbers for each system: nine axes, the rotation, the rest unused.
        5_221..=5_390 if (number - 5_221) % 20 < 10 => None,
        _ => Some(Effect::Set),
    }
}

/// How a predefined name is read.
type Read = fn(&System<'_>) -> Option<f64>;

fn truth(holds: bool) -> Option<f64> {
    Some(f64::from(u8::from(holds)))
}

static NAMES: &[(&str, Read)] = &[
    ("_vmajor", |_| Some(2.9)),
    ("_vminor", |_| Some(0.0)),
    ("_line", |system| Some(f64::from(system.state.lines))),
    ("_motion_mode", |system| Some(f64::from(system.state.motion_code))),
    ("_plane", |system| Some(plane(system.state.plane))),
    ("_ccomp", |system| Some(compensation(system))),
    ("_metric", |system| truth(!system.state.inch)),
    ("_imperial", |system| truth(system.state.inch)),
    ("_absolute", |system| truth(system.state.absolute)),
    ("_incremental", |system| truth(!system.state.absolute)),
    ("_inverse_time", |system| truth(system.state.feed_unit == FeedUnit::InverseTime)),
    ("_units_per_minute", |system| truth(system.state.feed_unit == FeedUnit::PerMinute)),
    ("_units_per_rev", |system| truth(system.state.feed_unit == FeedUnit::PerRevolution)),
    ("_coord_system", |system| Some(f64::from(system.state.coords.system.tenths()))),
    ("_tool_offset", |system| truth(system.state.length.is_on)),
    ("_retract_r_plane", |system| truth(system.state.drilling.to_r)),
    ("_retract_old_z", |system| truth(!system.state.drilling.to_r)),
    ("_spindle_rpm_mode", |system| truth(!system.state.surface_speed)),
    ("_spindle_css_mode", |system| truth(system.state.surface_speed)),
    ("_ijk_absolute_mode", |system| truth(system.state.arc_absolute)),
    ("_lathe_diameter_mode", |system| truth(system.state.x_diameter)),
    ("_lathe_radius_mode", |system| truth(!system.state.x_diameter)),
    ("_spindle_on", |system| truth(system.state.spindle_direction != SpindleDirection::Stopped)),
    ("_spindle_cw", |system| truth(system.state.spindle_direction == SpindleDirection::Clockwise)),
    ("_mist", |system| truth(system.state.coolant.mist)),
    ("_flood", |system| truth(system.state.coolant.flood)),
    ("_speed_override", |system| truth(system.state.machine.overrides.speed)),
    ("_feed_override", |system| truth(system.state.machine.overrides.feed)),
    ("_adaptive_feed", |system| truth(system.state.machine.overrides.adaptive_feed)),
    ("_feed_hold", |system| truth(system.state.machine.overrides.feed_hold)),
    ("_feed", |system| Some(system.state.feed_as_written)),
    // The number S, whatever it stands for.
    ("_rpm", |system| Some(super::speed(system))),
    ("_x", |system| work(system, Axis::X)),
    ("_y", |system| work(system, Axis::Y)),
    ("_z", |system| work(system, Axis::Z)),
    ("_a", |system| work(system, Axis::A)),
    ("_b", |system| work(system, Axis::B)),
    ("_c", |system| work(system, Axis::C)),
    ("_u", |system| work(system, Axis::U)),
    ("_v", |system| work(system, Axis::V)),
    ("_w", |system| work(system, Axis::W)),
    ("_abs_x", |system| system.machine(Axis::X)),
    ("_abs_y", |system| system.machine(Axis::Y)),
    ("_abs_z", |system| system.machine(Axis::Z)),
    ("_abs_a", |system| system.machine(Axis::A)),
    ("_abs_b", |system| system.machine(Axis::B)),
    ("_abs_c", |system| system.machine(Axis::C)),
    ("_current_tool", |system| Some(f64::from(system.state.tool))),
    ("_selected_tool", |system| Some(f64::from(system.state.next_tool.unwrap_or(0)))),
    ("_current_pocket", |_| None),
    ("_selected_pocket", |system| system.state.next_tool.is_none().then_some(-1.0)),
    ("_call_level", |system| Some(system.state.parameters.depth() as f64)),
    ("_remap_level", |_| Some(0.0)),
    ("_task", |_| Some(1.0)),
    ("_value", |system| Some(system.state.parameters.returned().unwrap_or(0.0))),
    ("_value_returned", |system| truth(system.state.parameters.returned().is_some())),
];

/// The value of a predefined name.
pub(super) fn named(system: &System<'_>, name: &Name) -> Option<f64> {
    if !name.is_global() {
        return None;
    }
    let (_, read) = NAMES.iter().find(|(text, _)| *text == name.as_str())?;
    read(system)
}

/// Whether a name is predefined, so that it cannot be assigned.
pub(super) fn is_predefined(name: &Name) -> bool {
    name.is_global() && NAMES.iter().any(|(text, _)| *text == name.as_str())
}

/// Ten times the code of the compensation of the radius; that of the side for `G41.1` and `G42.1`.
fn compensation(system: &System<'_>) -> f64 {
    match system.state.compensation.on {
        None => 400.0,
        Some(on) if on.left => 410.0,
        Some(_) => 420.0,
    }
}

const fn plane(plane: Plane) -> f64 {
    match plane {
        Plane::Xy => 170.0,
        Plane::Zx => 180.0,
        Plane::Yz => 190.0,
    }
}
