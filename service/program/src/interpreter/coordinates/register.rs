//! Offsets as system variables: which number is which register, for reading and for assigning.

use super::rebase;
use crate::code;
use crate::coordinates::{Coordinates, WorkOffset, WorkSystem};
use crate::expression::{Refusal, Value};
use crate::interpreter::execute::MM_PER_INCH;
use crate::interpreter::system::unassigned;
use crate::state::InterpreterState;
use crate::{Axis, DialectName, LanguageSettings, ToolOffset};

/// Numbers from one work coordinate system to the next.
const PITCH: u32 = 20;

/// LinuxCNC: the number of the work coordinate system in force.
const SYSTEM_IN_FORCE: u32 = 5_220;

/// Where the rotation is among the numbers of a system (LinuxCNC).
const ROTATION: u32 = 9;

/// The part of a row of the table of tool offsets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum ToolPart {
    Geometry(Axis),
    Wear(Axis),
    Radius,
    RadiusWear,
    Tip,
}

/// A register of coordinates or offsets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum Register {
    /// The external work offset.
    External(Axis),
    System(WorkSystem, Axis),
    Rotation(WorkSystem),
    /// A reference position, from 0.
    Reference(usize, Axis),
    /// LinuxCNC: what `G92.3` restores.
    StoredShift(Axis),
    /// LinuxCNC: whether `G92` is in force.
    ShiftIsOn,
    Tool(u32, ToolPart),
}

impl Register {
    /// The register of a number; `None` where it is none.
    pub(in super::super) fn of(settings: &LanguageSettings, number: u32) -> Option<Self> {
        match settings.dialect {
            DialectName::LinuxCnc => linuxcnc(number),
            dialect => frames(dialect, number).or_else(|| match (dialect, settings.is_haas()) {
                (DialectName::Lathe, false) => lathe_tool(number),
                (DialectName::Lathe, true) => haas_lathe_tool(number),
                (_, false) => mill_tool(number),
                (_, true) => haas_mill_tool(number),
            }),
        }
    }
}

/// The axis at a place; beyond the first ones the order is the machine's.
fn axis_of(dialect: DialectName, place: u32) -> Option<Axis> {
    let axes: &[Axis] = match dialect {
        DialectName::Lathe => &[Axis::X, Axis::Z],
        DialectName::Mill => &[Axis::X, Axis::Y, Axis::Z],
        DialectName::LinuxCnc => &Axis::ALL,
    };
    axes.get(place as usize).copied()
}

fn frames(dialect: DialectName, number: u32) -> Option<Register> {
    let within = |first: u32| (number - first) / PITCH + 1;
    let axis = |first: u32| axis_of(dialect, (number - first) % PITCH);
    let extended = |first: u32| u16::try_from(within(first)).ok().and_then(WorkSystem::extended);
    Some(match number {
        5_201..=5_220 => Register::External(axis(5_201)?),
        5_221..=5_340 => Register::System(WorkSystem::plain(within(5_221) as u16)?, axis(5_221)?),
        7_001..=7_960 => Register::System(extended(7_001)?, axis(7_001)?),
        14_001..=20_000 => Register::System(extended(14_001)?, axis(14_001)?),
        _ => return None,
    })
}

fn lathe_tool(number: u32) -> Option<Register> {
    let (row, part) = match number {
        2_001..=2_064 => (number - 2_000, ToolPart::Wear(Axis::X)),
        2_101..=2_164 => (number - 2_100, ToolPart::Wear(Axis::Z)),
        2_201..=2_264 => (number - 2_200, ToolPart::RadiusWear),
        2_301..=2_364 => (number - 2_300, ToolPart::Tip),
        2_701..=2_749 => (number - 2_700, ToolPart::Geometry(Axis::X)),
        2_801..=2_849 => (number - 2_800, ToolPart::Geometry(Axis::Z)),
        2_901..=2_949 => (number - 2_900, ToolPart::Radius),
        _ => return None,
    };
    Some(Register::Tool(row, part))
}

fn mill_tool(number: u32) -> Option<Register> {
    let (row, part) = match number {
        10_001..=10_999 => (number - 10_000, ToolPart::Wear(Axis::Z)),
        11_001..=11_999 => (number - 11_000, ToolPart::Geometry(Axis::Z)),
        12_001..=12_999 => (number - 12_000, ToolPart::RadiusWear),
        13_001..=13_999 => (number - 13_000, ToolPart::Radius),
        _ => return None,
    };
    Some(Register::Tool(row, part))
}

/// Haas mills. Their `D` offsets are diameters or radii by setting 40.
fn haas_mill_tool(number: u32) -> Option<Register> {
    let (row, part) = match number {
        2_001..=2_200 => (number - 2_000, ToolPart::Geometry(Axis::Z)),
        2_201..=2_400 => (number - 2_200, ToolPart::Wear(Axis::Z)),
        _ => return None,
    };
    Some(Register::Tool(row, part))
}

/// Haas lathes: what is a wear on FANUC controls is a geometry there.
fn haas_lathe_tool(number: u32) -> Option<Register> {
    matches!(number, 2_301..=2_350).then(|| Register::Tool(number - 2_300, ToolPart::Tip))
}

fn linuxcnc(number: u32) -> Option<Register> {
    let axis = |first: u32| axis_of(DialectName::LinuxCnc, number - first);
    Some(match number {
        5_161..=5_169 => Register::Reference(0, axis(5_161)?),
        5_181..=5_189 => Register::Reference(1, axis(5_181)?),
        5_210 => Register::ShiftIsOn,
        5_211..=5_219 => Register::StoredShift(axis(5_211)?),
        5_221..=5_390 => {
            let system = WorkSystem::plain(((number - 5_221) / PITCH + 1) as u16)?;
            match (number - 5_221) % PITCH {
                ROTATION => Register::Rotation(system),
                place => Register::System(system, axis_of(DialectName::LinuxCnc, place)?),
            }
        }
        _ => return None,
    })
}

/// mm in one unit of a register of an axis: FANUC controls show offsets in the units of the program, diameters in X of lathes;
/// LinuxCNC keeps them in units of the machine.
fn unit(state: &InterpreterState, settings: &LanguageSettings, axis: Option<Axis>) -> f64 {
    if settings.dialect == DialectName::LinuxCnc || axis.is_some_and(Axis::is_rotary) {
        return 1.0;
    }
    let unit = if state.inch { MM_PER_INCH } else { 1.0 };
    if axis == Some(Axis::X) && state.x_diameter { unit * 0.5 } else { unit }
}

/// A row of the table of tool offsets, as the program, the job or the profile has it.
pub(in super::super) fn tool_row(state: &InterpreterState, tools: &[ToolOffset], number: u32) -> Option<ToolOffset> {
    let is_it = |row: &&ToolOffset| row.number == number;
    state.coords.tables.tools.iter().find(is_it).or_else(|| tools.iter().find(is_it)).copied()
}

/// The value of a register as programs read it; `None` where it is not known.
pub(in super::super) fn read(
    state: &InterpreterState,
    settings: &LanguageSettings,
    tools: &[ToolOffset],
    register: Register,
) -> Option<f64> {
    let coords = &state.coords;
    let in_units = |axis: Axis, value: f64| value / unit(state, settings, Some(axis));
    Some(match register {
        Register::External(axis) => in_units(axis, coords.external[axis.index()]),
        Register::System(system, axis) => {
            in_units(axis, coords.stored_offset_of(system, settings).offset[axis.index()])
        }
        Register::Rotation(system) => coords.stored_offset_of(system, settings).rotation_deg,
        Register::Reference(number, axis) => coords.tables.reference[number].map_or(0.0, |at| at[axis.index()]),
        Register::StoredShift(axis) => coords.tables.stored_shift[axis.index()],
        Register::ShiftIsOn => f64::from(u8::from(coords.tables.shift_is_on)),
        Register::Tool(number, part) => {
            let row = tool_row(state, tools, number)?;
            let scale = unit(state, settings, None);
            match part {
                ToolPart::Geometry(axis) => in_units(axis, row.geometry?[axis.index()]),
                ToolPart::Wear(axis) => in_units(axis, row.wear[axis.index()]),
                ToolPart::Radius => row.radius_mm? / scale,
                ToolPart::RadiusWear => row.radius_wear_mm / scale,
                ToolPart::Tip => f64::from(row.tip),
            }
        }
    })
}

/// How a tool offset that is in force can be changed.
pub(super) const CANCEL_OFFSET: &str =
    "cancel it before (G49 on mills, T with offset 0 on lathes), and call it again behind";

/// Why a register cannot be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum Unassignable {
    /// No number of a tip.
    Tip,
    /// The radius compensation is on.
    Compensated,
    /// The coordinates are transformed.
    Transformed,
    /// The tool offset of this number is in force.
    InForce(u32),
}

impl Unassignable {
    /// The refusal of an assignment to a variable.
    pub(in super::super) fn refusal(self, number: u32) -> Refusal {
        let (why, cure) = match self {
            Self::InForce(offset) => {
                return Refusal {
                    code: code::OFFSET_IN_FORCE,
                    message: format!("#{number} changes tool offset {offset} while it is in force"),
                    cure: CANCEL_OFFSET.into(),
                };
            }
            Self::Tip => ("the tip of a tool is 0 to 9", "assign a whole number from 0 to 9"),
            Self::Compensated => ("the radius compensation is on", BEFORE_OR_BEHIND),
            Self::Transformed => ("the coordinates are transformed", BEFORE_OR_BEHIND),
        };
        Refusal {
            code: code::PARAMETER_READ_ONLY,
            message: format!("#{number} cannot be assigned here: {why}"),
            cure: cure.into(),
        }
    }
}

/// Where a variable can be assigned.
const BEFORE_OR_BEHIND: &str = "assign it in a block before that is so, or behind its end";

/// Sets a register; why it cannot be set, otherwise.
pub(in super::super) fn assign(
    state: &mut InterpreterState,
    settings: &LanguageSettings,
    tools: &[ToolOffset],
    register: Register,
    value: Value,
) -> Result<(), Unassignable> {
    // A vacant value clears a register as a zero does.
    let value = value.unwrap_or(0.0);
    let length = |axis: Option<Axis>| value * unit(state, settings, axis);
    match register {
        Register::Tool(number, part) => {
            let before = tool_row(state, tools, number);
            let mut row = before.unwrap_or(ToolOffset::new(number));
            match part {
                ToolPart::Geometry(axis) => row.geometry.get_or_insert_default()[axis.index()] = length(Some(axis)),
                ToolPart::Wear(axis) => row.wear[axis.index()] = length(Some(axis)),
                ToolPart::Radius => row.radius_mm = Some(length(None)),
                ToolPart::RadiusWear => row.radius_wear_mm = length(None),
                ToolPart::Tip if (0.0..=9.0).contains(&value) && value.fract() == 0.0 => row.tip = value as u8,
                ToolPart::Tip => return Err(Unassignable::Tip),
            }
            let is_radius = matches!(part, ToolPart::Radius | ToolPart::RadiusWear | ToolPart::Tip);
            if is_radius && state.compensation.on.is_some() {
                return Err(Unassignable::Compensated);
            }
            if state.is_in_force(&row, before.as_ref()) {
                return Err(Unassignable::InForce(number));
            }
            state.coords.set_tool(row);
        }
        Register::Reference(number, axis) => {
            state.coords.tables.reference[number].get_or_insert_default()[axis.index()] = value;
        }
        Register::StoredShift(axis) => state.coords.tables.stored_shift[axis.index()] = value,
        Register::ShiftIsOn => state.coords.tables.shift_is_on = value != 0.0,
        Register::External(_) | Register::System(..) | Register::Rotation(_) => {
            if state.compensation.on.is_some() {
                return Err(Unassignable::Compensated);
            }
            let is_transformed = state.coords.polar.is_some() || state.coords.transform.is_some();
            if is_transformed && settings.dialect != DialectName::LinuxCnc || !state.tool_control.is_plain() {
                return Err(Unassignable::Transformed);
            }
            let axis = match register {
                Register::External(axis) | Register::System(_, axis) => Some(axis),
                _ => None,
            };
            let value = if axis.is_some() { length(axis) } else { value };
            rebase(state, settings, |state| set_frame(state, settings, register, value));
        }
    }
    Ok(())
}

/// Sets a register of a frame, in mm and degrees.
fn set_frame(state: &mut InterpreterState, settings: &LanguageSettings, register: Register, value: f64) {
    let coords = &mut state.coords;
    match register {
        Register::External(axis) => coords.external[axis.index()] = value,
        Register::System(system, axis) => {
            let mut place = coords.stored_offset_of(system, settings);
            place.offset[axis.index()] = value;
            store(coords, settings, system, place);
        }
        Register::Rotation(system) => {
            let mut place = coords.stored_offset_of(system, settings);
            place.rotation_deg = value;
            store(coords, settings, system, place);
        }
        _ => {}
    }
}

/// Stores the variables of a system, which in LinuxCNC do not move one that is in force.
fn store(coords: &mut Coordinates, settings: &LanguageSettings, system: WorkSystem, place: WorkOffset) {
    if settings.dialect == DialectName::LinuxCnc && system == coords.system {
        coords.tables.written = Some(place);
    } else {
        coords.set_offset(system, place);
    }
}

/// Sets the registers that the initial parameters name, as a control finds them when it is switched on. Those of tools, and those that
/// cannot act, wait for the first block, which is read with the table of tools and can be refused.
pub(crate) fn set_initial_offsets(state: &mut InterpreterState, settings: &LanguageSettings) {
    let is_linuxcnc = settings.dialect == DialectName::LinuxCnc;
    let offsets = settings.parameters.numbered.range(2_000..);
    for (number, value) in offsets {
        let register = Register::of(settings, *number);
        let acts = match register {
            _ if is_linuxcnc && *number == SYSTEM_IN_FORCE => select_initial_system(state, *value),
            Some(Register::Tool(..)) => false,
            // Nothing that could refuse it is on yet.
            Some(register) => assign(state, settings, &[], register, Some(*value)).is_ok(),
            None => *value == 0.0 || unassigned(settings, *number).is_none(),
        };
        if !acts {
            state.coords.tables.assigned.push((*number, *value));
        }
    }
    if is_linuxcnc {
        let coords = &mut state.coords;
        coords.take_over_written();
        if coords.tables.shift_is_on {
            coords.shift = coords.tables.stored_shift;
        }
    }
}

/// LinuxCNC: the number of the work coordinate system in force, which its file of parameters keeps. Whether there is one.
fn select_initial_system(state: &mut InterpreterState, value: f64) -> bool {
    let system = WorkSystem::plain(value as u16).filter(|_| value.fract() == 0.0);
    if let Some(system) = system {
        state.coords.system = system;
    }
    system.is_some()
}

/// Why a number of an offset is no register here, though it is one of the control; `None` for all others.
pub(in super::super) fn unassigned_offset(settings: &LanguageSettings, number: u32) -> Option<Refusal> {
    if settings.dialect == DialectName::LinuxCnc {
        return (number == SYSTEM_IN_FORCE).then(|| Refusal {
            code: code::PARAMETER_READ_ONLY,
            message: format!(
                "#{SYSTEM_IN_FORCE} is the number of the work coordinate system in force, and selects none here"
            ),
            cure: "select it with its code, such as G55; what the job or the profile brings must be 1 to 9".into(),
        });
    }
    let place = match number {
        5_201..=5_340 => (number - 5_201) % PITCH,
        7_001..=7_960 => (number - 7_001) % PITCH,
        14_001..=20_000 => (number - 14_001) % PITCH,
        _ => return None,
    };
    (axis_of(settings.dialect, place).is_none() && place < 9).then(|| Refusal {
        code: code::PARAMETER_READ_ONLY,
        message: format!(
            "#{number} is the offset of axis {} of the control, whose letter the machine's parameters say",
            place + 1
        ),
        cure: "write G10 L2 with the letter of the axis, such as G10 L2 P1 A10., or give the offset with the job's or the profile's \
               work offsets"
            .into(),
    })
}
