//! System variables: what a program reads of the control by number or by name, and what it sets by assignment.
//!
//! Which there are is a table per dialect. What a control knows and the interpreter does not (its clock, its inputs, the result of a
//! probe) comes from [`crate::InitialParameters`] or is refused: nothing is made up.

mod fanuc;
mod linuxcnc;
#[cfg(test)]
mod tests;

use crate::code;
use crate::dialect::Dialect;
use crate::expression::{Name, Reading, Refusal, Target, Value, Variables};
use crate::parameters::{Kind, profile_row};
use crate::state::ToolMode;
use crate::{Axis, DialectName, InterpreterState, LanguageSettings, Position, ToolOffset};

use super::coordinates::{self, Register};
use super::execute::{M_PER_FOOT, MM_PER_INCH};

/// What expressions read: the state before their line.
#[derive(Clone, Copy)]
pub(crate) struct System<'a> {
    pub(crate) state: &'a InterpreterState,
    pub(crate) settings: &'a LanguageSettings,
    pub(crate) dialect: &'static Dialect,
    pub(crate) tools: &'a [ToolOffset],
}

/// Reads one variable of a row: its place in the row from 0. `None` where its value is not known.
type Read = fn(&System<'_>, u32) -> Option<Value>;

/// System variables with consecutive numbers: first and last, and how they are read.
type Row = (u32, u32, Read);

/// What an assignment to a system variable does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    /// It has set the value.
    Set,
    /// It changes nothing here, which is worth saying.
    Ignored,
    /// The program stops for the operator.
    Stop,
    /// The program ends with an alarm of this number.
    Alarm(u32),
}

impl Variables for System<'_> {
    #[inline]
    fn numbered(&self, number: u32) -> Result<Reading, Refusal> {
        let ranges = self.dialect.parameters;
        let parameters = &self.state.parameters;
        match ranges.kind(number) {
            Some(Kind::Local) => Ok(parameters.local(number).or(ranges.unassigned).into()),
            Some(Kind::Common) => Ok(self.stored(number).unwrap_or(ranges.unassigned).into()),
            Some(Kind::Vacant) => Ok(Reading::from(None)),
            Some(Kind::System) => self.system(number),
            None => Err(ranges.unknown(number)),
        }
    }

    fn named(&self, name: &Name) -> Result<Option<f64>, Refusal> {
        if let Some(value) = linuxcnc::named(self, name) {
            return Ok(Some(value));
        }
        let assigned = self.state.parameters.named(name);
        let value = assigned.or_else(|| self.settings.parameters.named.get(name.as_str()).copied());
        if value.is_none() && linuxcnc::is_outside(name) {
            return Err(unavailable(name.as_str()));
        }
        Ok(value)
    }
}

impl System<'_> {
    /// Whether the control sets this parameter: a position, a mode, an offset.
    pub(super) fn sets(&self, number: u32) -> bool {
        self.dialect.parameters.kind(number) == Some(Kind::System)
    }

    /// As [`Self::sets`], of a named parameter.
    pub(super) fn sets_named(name: &Name) -> bool {
        linuxcnc::is_predefined(name)
    }

    /// A stored value: as assigned, or as the settings bring it.
    #[inline]
    fn stored(&self, number: u32) -> Option<Value> {
        let assigned = self.state.parameters.common(number);
        assigned.or_else(|| self.settings.parameters.numbered.get(&number).map(|value| Some(*value)))
    }

    fn rows(&self) -> &'static [Row] {
        match self.settings.dialect {
            DialectName::Lathe | DialectName::Mill => fanuc::ROWS,
            DialectName::LinuxCnc => linuxcnc::ROWS,
        }
    }

    #[cold]
    fn system(&self, number: u32) -> Result<Reading, Refusal> {
        if let Some(register) = Register::of(self.settings, number)
            && let Some(value) = coordinates::read(self.state, self.settings, self.tools, register)
        {
            return Ok(Some(value).into());
        }
        if let Some((first, _, read)) = self.rows().iter().find(|(first, last, _)| (*first..=*last).contains(&number))
            && let Some(value) = read(self, number - first)
        {
            return Ok(value.into());
        }
        if let Some(value) = self.stored(number) {
            return Ok(value.into());
        }
        if let Some(value) = self.probed(number) {
            return Ok(Reading { value, is_probed: true });
        }
        if let Some(refusal) = doubtful_offset(self.settings, number) {
            return Err(refusal);
        }
        let is_linuxcnc = self.settings.dialect == DialectName::LinuxCnc;
        match number {
            // Whether the probe has found a contact.
            5_070 if self.state.probed.is_some() => Err(unavailable("5070")),
            _ if is_linuxcnc => match linuxcnc::of_spindle_tool(number) {
                Some((what, cure)) => Err(of_unknown_tool(number, what, self.state.tool, cure)),
                None if matches!(number, 5_021..=5_029 | 5_420..=5_428) => Err(unavailable(&number.to_string())),
                None => Ok(Reading::from(Some(0.0))),
            },
            3_001 | 3_002 | 3_011 | 3_012 | 3_901 | 3_902 => Err(Refusal {
                code: code::PARAMETER_CLOCK,
                message: format!(
                    "#{number} is a clock or a counter of the control, so that the program would not run twice alike"
                ),
                cure: format!("take it out, or {}", bring(&number.to_string())).into(),
            }),
            _ => Err(unavailable(&number.to_string())),
        }
    }

    /// What a probing move is taken to have found, where this is the number of an axis of it.
    fn probed(&self, number: u32) -> Option<Value> {
        let place = number.checked_sub(5_061)?;
        match self.settings.dialect {
            DialectName::Lathe | DialectName::Mill => fanuc::probed(self, place),
            DialectName::LinuxCnc => linuxcnc::probed(self, place),
        }
    }

    /// A value of an axis in the units of the program: a diameter in X where the control writes diameters.
    fn in_units(&self, axis: Axis, value: f64) -> f64 {
        let is_diameter = axis == Axis::X && self.state.x_diameter && self.settings.dialect != DialectName::LinuxCnc;
        let value = if is_diameter { value * 2.0 } else { value };
        if axis.is_rotary() || !self.state.inch { value } else { value / MM_PER_INCH }
    }

    /// A place of an axis in the units of the program; `None` where only the machine knows it.
    fn place(&self, position: &Position, axis: Axis) -> Option<f64> {
        let is_held = self.state.tool_control.held.contains(axis);
        (!is_held).then(|| self.in_units(axis, position[axis.index()]))
    }

    /// The machine position of an axis in the units of the program; `None` where only the machine knows it: in a tilted plane, under
    /// tool centre point control, and beside a contour.
    fn machine(&self, axis: Axis) -> Option<f64> {
        let is_known = self.is_of_tool(axis);
        let position = is_known.then(|| self.state.coords.machine(&self.state.position))?;
        self.place(&position, axis)
    }

    /// Whether the tool is at the programmed place of an axis, and the machine where the offsets say.
    fn is_of_tool(&self, axis: Axis) -> bool {
        if self.state.tool_control.mode != ToolMode::Off {
            return false;
        }
        let on = self.state.compensation.on.filter(|on| on.mode.radius_mm != 0.0).map(|on| on.mode.plane);
        // LinuxCNC counts from the programmed point behind G40, wherever the tool is.
        let is_linuxcnc = self.settings.dialect == DialectName::LinuxCnc;
        let beside = on.or_else(|| self.state.compensator.plane().filter(|_| !is_linuxcnc));
        beside.is_none_or(|plane| {
            let (first, second) = plane.axes();
            axis != first && axis != second
        })
    }

    /// Whether a programmed position differs from work coordinates by more than offsets.
    fn is_transformed(&self) -> bool {
        self.state.coords.transform.is_some()
    }
}

/// The speed as the program writes it.
fn speed(system: &System<'_>) -> f64 {
    let state = system.state;
    match state.surface_speed {
        true if state.inch => state.m_per_min / M_PER_FOOT,
        true => state.m_per_min,
        false => state.rev_per_min,
    }
}

/// Why a number that is a tool offset on some controls is none that is certain here; `None` for all others.
fn doubtful_offset(settings: &LanguageSettings, number: u32) -> Option<Refusal> {
    let (what, cure) = match (settings.dialect, settings.is_haas(), number) {
        (DialectName::Mill, false, 2_001..=2_999) => (
            "is a length, a radius, a geometry or a wear of a tool offset, by the kind of offset memory that the control has",
            "write #10001 on (H wear), #11001 on (H geometry), #12001 on (D wear) or #13001 on (D geometry), which are the same \
             on all FANUC controls",
        ),
        (DialectName::Mill, true, 2_401..=2_800) => (
            "is a diameter or a radius of a tool offset, by setting 40 of the control",
            "write the value itself, or bring it in the table of tools",
        ),
        (DialectName::Mill, true, 10_000..=13_999) => (
            "is a variable, an input or an output of Haas controls, and a tool offset of FANUC controls",
            "write #2001 on (H geometry) or #2201 on (H wear) for an offset, and #100 on for a variable",
        ),
        (DialectName::Lathe, true, 2_001..=2_299 | 2_701..=2_999) => (
            "is a tool offset whose geometry and wear have each other's numbers on Haas and on FANUC controls",
            "write the value itself, or bring it in the table of tools",
        ),
        _ => return None,
    };
    Some(Refusal { code: code::PARAMETER_UNAVAILABLE, message: format!("#{number} {what}"), cure: cure.into() })
}

#[cold]
fn unavailable(parameter: &str) -> Refusal {
    let name = if parameter.starts_with('_') { format!("#<{parameter}>") } else { format!("#{parameter}") };
    Refusal {
        code: code::PARAMETER_UNAVAILABLE,
        message: format!("{name} is a value of the control that is not known here"),
        cure: bring(parameter).into(),
    }
}

/// What brings the value of a parameter, by its number or name.
fn bring(parameter: &str) -> String {
    format!("let the profile bring its value: {}, or the job: [[parameters]] of its offsets", profile_row(parameter))
}

/// A value of the tool in the spindle, whose row of the table of tools is not known, or does not state it.
#[cold]
fn of_unknown_tool(number: u32, what: &str, tool: u32, cure: &'static str) -> Refusal {
    Refusal {
        code: code::PARAMETER_UNAVAILABLE,
        message: format!("#{number} is {what} of the tool in the spindle, and that of T{tool} is not known"),
        cure: cure.into(),
    }
}

#[cold]
fn read_only(name: String) -> Refusal {
    Refusal {
        code: code::PARAMETER_READ_ONLY,
        message: format!("{name} is a value of the control and cannot be assigned"),
        cure: "assign a variable of the program".into(),
    }
}

/// Makes an assignment.
pub(crate) fn assign(
    state: &mut InterpreterState,
    settings: &LanguageSettings,
    dialect: &'static Dialect,
    target: &Target,
    value: Value,
) -> Result<Effect, Refusal> {
    let number = match target {
        Target::Named(name) if linuxcnc::is_predefined(name) => {
            return Err(read_only(format!("#<{}>", name.as_str())));
        }
        // A name has no vacant value: only Macro B has them, and it has no names.
        Target::Named(name) => return state.parameters.set_named(name, value.unwrap_or(0.0)).map(|()| Effect::Set),
        Target::Numbered(number) => *number,
    };
    match dialect.parameters.kind(number) {
        Some(Kind::Local) => state.parameters.set_local(number, value),
        Some(Kind::Common) => state.parameters.set_common(number, value),
        Some(Kind::Vacant) => return Err(read_only("#0".to_owned())),
        Some(Kind::System) => return set_system(state, settings, number, value),
        None => return Err(dialect.parameters.unknown(number)),
    }
    Ok(Effect::Set)
}

fn set_system(
    state: &mut InterpreterState,
    settings: &LanguageSettings,
    number: u32,
    value: Value,
) -> Result<Effect, Refusal> {
    let effect = match settings.dialect {
        DialectName::Lathe | DialectName::Mill => fanuc::effect(number, value),
        DialectName::LinuxCnc => linuxcnc::effect(number),
    };
    match effect {
        Some(Effect::Set) => state.parameters.set_common(number, value),
        None if Register::of(settings, number).is_some() => {
            // In force from the next block on.
            state.coords.tables.assigned.push((number, value.unwrap_or(0.0)));
            state.parameters.changed();
            return Ok(Effect::Set);
        }
        None => return Err(unassigned(settings, number).unwrap_or_else(|| read_only(format!("#{number}")))),
        Some(_) => {}
    }
    Ok(effect.unwrap_or(Effect::Set))
}

/// Puts an offset in force that a block before has assigned.
pub(crate) fn assign_offset(
    state: &mut InterpreterState,
    settings: &LanguageSettings,
    tools: &[ToolOffset],
    number: u32,
    value: f64,
) -> Result<(), Refusal> {
    let Some(register) = Register::of(settings, number) else {
        return unassigned(settings, number).map_or(Ok(()), Err);
    };
    coordinates::assign(state, settings, tools, register, Some(value)).map_err(|why| why.refusal(number))
}

/// Why a number that is an offset on the control cannot be assigned whatever is in force; `None` for all others.
pub(super) fn unassigned(settings: &LanguageSettings, number: u32) -> Option<Refusal> {
    let read_only = |refusal| Refusal { code: code::PARAMETER_READ_ONLY, ..refusal };
    coordinates::unassigned_offset(settings, number).or_else(|| doubtful_offset(settings, number).map(read_only))
}
