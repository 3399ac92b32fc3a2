//! Parameters (Macro B: variables): what a program stores and reads by number or by name.
//!
//! Which numbers there are is a table per dialect ([`Ranges`]). The state holds what has been assigned; initial values are part of the
//! settings, so that a state of a program without parameters is small.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::code;
use crate::expression::{Name, Refusal, Value};

/// Arguments and other locals of a call: `#1` to `#33`.
pub(crate) const LOCALS: usize = 33;

/// Named parameters in all: those of the program and its calls, and global ones.
const MOST_NAMES: usize = 1_000;

/// What the number of a parameter stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// `#0` of Macro B: always vacant.
    Vacant,
    /// Of the present call.
    Local,
    /// Of the whole program.
    Common,
    /// A value of the control: position, offset, mode.
    System,
}

/// The parameters of a dialect: first and last number, what they are. Other numbers do not exist.
#[derive(Debug)]
pub(crate) struct Ranges {
    rows: &'static [(u32, u32, Kind)],
    /// What an unassigned parameter reads as.
    pub(crate) unassigned: Value,
}

/// Macro B. Beyond the variables are the system variables.
pub(crate) static FANUC: Ranges = Ranges {
    rows: &[
        (0, 0, Kind::Vacant),
        (1, 33, Kind::Local),
        (100, 199, Kind::Common),
        (500, 999, Kind::Common),
        (1_000, 99_999, Kind::System),
    ],
    unassigned: None,
};

/// LinuxCNC. The numbers from 5001 on are stored as any other but for those that are values of the control.
pub(crate) static LINUXCNC: Ranges = Ranges {
    rows: &[(1, 30, Kind::Local), (31, 5_000, Kind::Common), (5_001, 5_601, Kind::System)],
    unassigned: Some(0.0),
};

impl Ranges {
    /// What a number stands for, `None` where there is no such parameter.
    #[inline]
    pub(crate) fn kind(&self, number: u32) -> Option<Kind> {
        let row = self.rows.iter().find(|(first, last, _)| (*first..=*last).contains(&number))?;
        Some(row.2)
    }

    /// That there is no parameter of this number.
    #[cold]
    pub(crate) fn unknown(&self, number: u32) -> Refusal {
        let range = |first: u32, last: u32| match first == last {
            true => format!("#{first}"),
            false => format!("#{first} to #{last}"),
        };
        let known = self.rows.iter().map(|(first, last, _)| range(*first, *last)).collect::<Vec<_>>();
        Refusal {
            code: code::PARAMETER_NUMBER,
            message: format!("#{number} does not exist; there are {}", known.join(", ")),
            cure: "check the number, and what it is computed from".into(),
        }
    }
}

/// The rows of a profile that bring the value of a parameter, by its number or name, as cures write them.
#[cold]
pub(crate) fn profile_row(parameter: &str) -> String {
    format!("[[language.parameters]] with parameter = \"{parameter}\" and its value")
}

/// Parameters that a profile or a job brings: initial values, and values of the control that are not known otherwise, such as the result of
/// a probe.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InitialParameters {
    /// By number: `#100` to `#199` and `#500` to `#999` of Macro B, `#31` to `#5601` of LinuxCNC, and system variables.
    pub numbered: BTreeMap<u32, f64>,
    /// Global names of LinuxCNC, in lower case with their `_`.
    pub named: BTreeMap<String, f64>,
}

impl InitialParameters {
    /// Why a name cannot be that of an initial value; `None` where it can.
    #[must_use]
    pub fn name_problem(name: &str) -> Option<&'static str> {
        match Name::read(name.as_bytes()) {
            Some(read) if read.as_str() != name => Some("must be written in lower case and without blanks"),
            Some(read) if !read.is_global() => {
                Some("must start with _: other names belong to one program or subprogram")
            }
            Some(_) => None,
            None => Some("must have 1 to 63 characters of ASCII"),
        }
    }
}

/// The parameters of one level of calls.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Level {
    /// `#1` and what follows it; shorter where nothing was assigned.
    numbered: Vec<Value>,
    named: BTreeMap<Box<str>, f64>,
}

/// Everything that a program has assigned.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Parameters {
    /// Of the whole program, as assigned; a vacant one may have been assigned over an initial value.
    common: BTreeMap<u32, Value>,
    globals: BTreeMap<Box<str>, f64>,
    /// The present call.
    level: Level,
    /// The calls that led to it, the main program first.
    callers: Vec<Level>,
    /// Names in all levels.
    names: u32,
    /// How often an assignment has changed a value, counting on from 0 again beyond the largest number.
    changes: u64,
    /// What the last return gave: `None` after one without a value.
    returned: Value,
}

impl Parameters {
    /// How often an assignment has changed a value: where it has not gone up, all parameters are as they were.
    pub(crate) const fn changes(&self) -> u64 {
        self.changes
    }

    /// Whether all parameters are as those, however often they have changed.
    pub(crate) fn are_as(&self, other: &Self) -> bool {
        // What loops count with comes first.
        self.level == other.level
            && self.common == other.common
            && self.globals == other.globals
            && self.callers == other.callers
            && self.returned == other.returned
    }

    /// Counts the changes from another number on; gives the one before.
    pub(crate) const fn exchange_changes(&mut self, changes: u64) -> u64 {
        core::mem::replace(&mut self.changes, changes)
    }

    /// Levels of calls with parameters of their own, 0 in the main program.
    pub(crate) fn depth(&self) -> usize {
        self.callers.len()
    }

    /// Enters a call with parameters of its own.
    pub(crate) fn enter(&mut self, arguments: [Value; LOCALS]) {
        let assigned = arguments.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
        let level = Level { numbered: arguments[..assigned].to_vec(), named: BTreeMap::new() };
        self.callers.push(core::mem::replace(&mut self.level, level));
        self.changed();
    }

    /// Leaves a call: the caller's parameters are in force again. In the main program nothing happens.
    pub(crate) fn leave(&mut self) {
        if let Some(level) = self.callers.pop() {
            self.names -= self.level.named.len() as u32;
            self.level = level;
            self.changed();
        }
    }

    /// Remembers what a subprogram has returned, for `#<_value>`.
    pub(crate) fn set_returned(&mut self, value: Value) {
        if self.returned != value {
            self.returned = value;
            self.changed();
        }
    }

    /// What the last subprogram returned.
    pub(crate) const fn returned(&self) -> Value {
        self.returned
    }

    /// Notes that a value that programs read has changed.
    pub(crate) const fn changed(&mut self) {
        self.changes = self.changes.wrapping_add(1);
    }

    /// A local of the present call, `None` where nothing was assigned.
    #[inline]
    pub(crate) fn local(&self, number: u32) -> Value {
        let place = (number as usize).checked_sub(1)?;
        self.level.numbered.get(place).copied().flatten()
    }

    /// Assigns a local of the present call, from 1 to [`LOCALS`].
    pub(crate) fn set_local(&mut self, number: u32, value: Value) {
        let Some(place) = (number as usize).checked_sub(1).filter(|place| *place < LOCALS) else { return };
        if self.level.numbered.len() <= place {
            self.level.numbered.resize(place + 1, None);
        }
        if core::mem::replace(&mut self.level.numbered[place], value) != value {
            self.changed();
        }
    }

    /// A parameter of the whole program as assigned, `None` where nothing was.
    #[inline]
    pub(crate) fn common(&self, number: u32) -> Option<Value> {
        if self.common.is_empty() { None } else { self.common.get(&number).copied() }
    }

    /// Assigns a parameter of the whole program.
    pub(crate) fn set_common(&mut self, number: u32, value: Value) {
        if self.common.insert(number, value) != Some(value) {
            self.changed();
        }
    }

    /// A named parameter as assigned.
    pub(crate) fn named(&self, name: &Name) -> Option<f64> {
        let names = if name.is_global() { &self.globals } else { &self.level.named };
        names.get(name.as_str()).copied()
    }

    /// Assigns a named parameter: of the present call, or of all where its name starts with `_`.
    pub(crate) fn set_named(&mut self, name: &Name, value: f64) -> Result<(), Refusal> {
        let names = if name.is_global() { &mut self.globals } else { &mut self.level.named };
        if let Some(present) = names.get_mut(name.as_str()) {
            if core::mem::replace(present, value) != value {
                self.changed();
            }
            return Ok(());
        }
        if self.names as usize >= MOST_NAMES {
            return Err(Refusal {
                code: code::PARAMETER_LIMIT,
                message: format!("#<{}> would be more than {MOST_NAMES} named parameters", name.as_str()),
                cure: "use numbered parameters".into(),
            });
        }
        names.insert(name.as_str().into(), value);
        self.names += 1;
        self.changed();
        Ok(())
    }
}
