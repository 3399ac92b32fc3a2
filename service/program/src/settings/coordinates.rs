//! Settings of coordinates: offsets beyond `G54` to `G59`, and what controls do differently with them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{Axis, Position, WorkOffset, WorkSystem};

/// Whose coordinate codes a control has; of no effect in LinuxCNC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CoordinateStyle {
    /// `G54.1 P`; `G28` and `G30` name their axes.
    #[default]
    Fanuc,
    /// `G154 P`, `G110` to `G129` and `G100`, `G101` beside; `G28` without axes sends all axes home.
    Haas,
}

/// What a machine profile, or the job in its place, says about coordinates and offsets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CoordinateSettings {
    /// Whose codes these are.
    pub style: CoordinateStyle,
    /// The external offset, which is added to every work offset, mm (X a radius) and degrees.
    pub external_offset: Position,
    /// Work coordinate systems beside [`crate::LanguageSettings::work_offsets`], or in their place.
    pub systems: BTreeMap<WorkSystem, WorkOffset>,
    /// Second to fourth reference position (`G30 P2` to `P4`), machine coordinates; `None` where it is not known.
    pub more_reference_positions: [Option<Position>; 3],
    /// How many extended systems the control has, 48 or 300.
    pub extended_systems: u16,
    /// `G52` shifts the work coordinate system in force only, as on Mitsubishi controls, instead of all.
    pub local_of_one_system: bool,
    /// `G28` and `G30` cancel `G52` along their axes.
    pub reference_cancels_local: bool,
    /// On lathes the geometry is that of the tool's number, the wear that of the offset's number.
    pub geometry_by_tool: bool,
    /// On lathes a `T` word of one or two digits names tool and offset of that number.
    pub two_digit_tools: bool,
    /// `G43` without `H` takes the length of the tool in the spindle (a Haas setting).
    pub length_of_tool: bool,
    /// The rotary axes A, B and C that roll over: an absolute word takes the shorter turn.
    pub roll_over: [bool; 3],
}

impl Default for CoordinateSettings {
    fn default() -> Self {
        Self {
            style: CoordinateStyle::Fanuc,
            external_offset: [0.0; 9],
            systems: BTreeMap::new(),
            more_reference_positions: [None; 3],
            extended_systems: 48,
            local_of_one_system: false,
            reference_cancels_local: false,
            geometry_by_tool: false,
            two_digit_tools: false,
            length_of_tool: false,
            roll_over: [false; 3],
        }
    }
}

impl CoordinateSettings {
    /// Whether an axis rolls over.
    #[must_use]
    pub const fn rolls_over(&self, axis: Axis) -> bool {
        match axis {
            Axis::A => self.roll_over[0],
            Axis::B => self.roll_over[1],
            Axis::C => self.roll_over[2],
            _ => false,
        }
    }
}
