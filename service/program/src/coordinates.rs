//! Where the coordinates of a program lie in the machine: every register that a program, a job or a profile can set.
//!
//! A programmed position goes through mirror image, scaling and rotation ([`Transform`]) to work coordinates, the path of the
//! tool is compensated there, and the sum of all offsets leads to the machine. In LinuxCNC the rotation is that of the work
//! coordinate system, and `G92` lies before it.

mod initial;
mod system;
mod transform;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

pub use self::initial::InitialOffsets;
pub use self::system::{UnknownWorkSystem, WorkOffset, WorkSystem};
pub(crate) use self::transform::{Rotation, Scaling, Transform, direction};

use crate::{AXIS_COUNT, Axis, AxisSet, DialectName, LanguageSettings, Plane, Position, ToolOffset};

/// Machine positions that are closer than this are the same one, mm.
const SAME_PLACE_MM: f64 = 1e-9;

/// Registers of offsets, and what follows from them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Coordinates {
    pub(crate) system: WorkSystem,
    pub(crate) external: Position,
    /// `G10 P0` of a lathe: shift of the work coordinate systems.
    pub(crate) work_shift: Position,
    /// `G52` on FANUC controls, for every system.
    pub(crate) local: Position,
    /// `G92` and `G50`; in LinuxCNC `G52` as well.
    pub(crate) shift: Position,
    /// The offsets without the tool's: where the coordinates of the program lie, whichever tool is in the spindle.
    pub(crate) frame: Position,
    /// What machine coordinates are more than work coordinates: all offsets together.
    pub(crate) total: Position,
    /// From programmed positions to work coordinates, where it does anything.
    pub(crate) transform: Option<Box<Transform>>,
    /// `G16`
    pub(crate) polar: Option<Polar>,
    /// A rotation was switched, and no move in the plane has followed.
    pub(crate) awaits_absolute: bool,
    /// What the tool's offset changed by, until the axes have moved.
    pub(crate) due: Option<Box<OffsetDue>>,
    pub(crate) tables: Box<Tables>,
}

/// A change of the tool's length or offset.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct OffsetDue {
    /// Axes that have not been named since.
    pub(crate) axes: AxisSet,
    /// By how much it changed, mm.
    pub(crate) change: Position,
    /// Where the machine was then.
    pub(crate) machine: Position,
    /// `G28` of a Haas control may have cancelled the length since.
    pub(crate) returned: bool,
}

impl OffsetDue {
    /// Whether an axis has not moved since, with the machine at this place.
    pub(crate) fn is_due(&self, axis: Axis, machine: &Position) -> bool {
        let place = axis.index();
        self.axes.contains(axis) && (machine[place] - self.machine[place]).abs() < SAME_PLACE_MM
    }
}

/// Registers that few programs change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Tables {
    /// Systems as the program has set them.
    systems: BTreeMap<WorkSystem, WorkOffset>,
    /// `G52` where it belongs to one system.
    locals: BTreeMap<WorkSystem, Position>,
    /// LinuxCNC: what `G92.3` restores, and whether it is in force.
    pub(crate) stored_shift: Position,
    pub(crate) shift_is_on: bool,
    /// First to fourth reference position, machine coordinates.
    pub(crate) reference: [Option<Position>; 4],
    /// Rows of the table of tool offsets as the program has set them.
    pub(crate) tools: Vec<ToolOffset>,
    pub(crate) intermediate: Option<Intermediate>,
    /// Offsets that a block has assigned, in force from the next one on.
    pub(crate) assigned: Vec<(u32, f64)>,
    /// LinuxCNC: the system in force as its variables have been assigned since it was selected. Its interpreter does not look
    /// at them before another system is selected, or `G10` sets this one.
    pub(crate) written: Option<WorkOffset>,
}

/// Where the last `G28` or `G30` has passed, for `G29`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Intermediate {
    pub(crate) axes: AxisSet,
    /// In work coordinates.
    pub(crate) position: Position,
    /// The offsets that they are counted from.
    pub(crate) total: Position,
}

/// `G16`: the words of the plane are a radius and an angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Polar {
    pub(crate) plane: Option<Plane>,
    /// Line that switched it on.
    pub(crate) on_line: u32,
    /// As last programmed, mm.
    pub(crate) radius_mm: Option<f64>,
    /// As last programmed, degrees.
    pub(crate) angle_deg: Option<f64>,
    /// The radius last programmed was counted from where the tool was.
    pub(crate) from_present: bool,
}

impl Coordinates {
    /// As they are before the first line.
    pub(crate) fn new(settings: &LanguageSettings) -> Self {
        let mut more = settings.coordinates.more_reference_positions;
        if settings.dialect == DialectName::LinuxCnc {
            // Its parameters are 0 until something is stored.
            more[0].get_or_insert_default();
        }
        let tables = Tables {
            systems: BTreeMap::new(),
            locals: BTreeMap::new(),
            stored_shift: Position::default(),
            shift_is_on: false,
            reference: [Some(settings.reference_position), more[0], more[1], more[2]],
            tools: Vec::new(),
            intermediate: None,
            assigned: Vec::new(),
            written: None,
        };
        let zero = Position::default();
        Self {
            system: WorkSystem::FIRST,
            external: settings.coordinates.external_offset,
            work_shift: zero,
            local: zero,
            shift: zero,
            frame: zero,
            total: zero,
            transform: None,
            polar: None,
            awaits_absolute: false,
            due: None,
            tables: Box::new(tables),
        }
    }

    /// Where a system lies: as the program has set it, or the job, or the profile.
    pub(crate) fn offset_of(&self, system: WorkSystem, settings: &LanguageSettings) -> WorkOffset {
        let set = self.tables.systems.get(&system).or_else(|| settings.coordinates.systems.get(&system));
        set.copied().unwrap_or_else(|| {
            let plain = system.plain_number().map(|number| usize::from(number) - 1);
            let offset = plain.and_then(|place| settings.work_offsets.get(place)).copied().unwrap_or_default();
            WorkOffset { offset, rotation_deg: 0.0 }
        })
    }

    pub(crate) fn set_offset(&mut self, system: WorkSystem, offset: WorkOffset) {
        if system == self.system {
            self.tables.written = None;
        }
        self.tables.systems.insert(system, offset);
    }

    /// The variables of a system: where it lies, but for one in force whose variables have been assigned in LinuxCNC.
    pub(crate) fn stored_offset_of(&self, system: WorkSystem, settings: &LanguageSettings) -> WorkOffset {
        let written = self.tables.written.filter(|_| system == self.system);
        written.unwrap_or_else(|| self.offset_of(system, settings))
    }

    /// Makes of the variables of the system in force where it lies from now on.
    pub(crate) fn take_over_written(&mut self) {
        if let Some(written) = self.tables.written {
            self.set_offset(self.system, written);
        }
    }

    /// The local shift in force.
    pub(crate) fn local(&self, settings: &LanguageSettings) -> Position {
        match settings.coordinates.local_of_one_system {
            true => self.tables.locals.get(&self.system).copied().unwrap_or_default(),
            false => self.local,
        }
    }

    pub(crate) fn set_local(&mut self, local: Position, settings: &LanguageSettings) {
        match settings.coordinates.local_of_one_system {
            true => drop(self.tables.locals.insert(self.system, local)),
            false => self.local = local,
        }
    }

    /// Computes what follows from the registers, with this tool offset.
    pub(crate) fn resolve(&mut self, settings: &LanguageSettings, tool: &Position) {
        let WorkOffset { offset, rotation_deg } = self.offset_of(self.system, settings);
        let mut shift = self.shift;
        if settings.dialect == DialectName::LinuxCnc {
            let rotation = (rotation_deg != 0.0).then(|| Rotation::new(Plane::Xy, [0.0; 2], rotation_deg));
            if let Some(rotation) = &rotation {
                [shift[0], shift[1]] = rotation.turn([shift[0], shift[1]], false);
            }
            self.transform =
                rotation.map(|rotation| Box::new(Transform { rotation: Some(rotation), ..Transform::default() }));
        }
        let local = self.local(settings);
        self.frame = core::array::from_fn(|axis| {
            offset[axis] + self.external[axis] + self.work_shift[axis] + local[axis] + shift[axis]
        });
        self.total = sum(&self.frame, tool);
    }

    /// Work coordinates of a programmed position.
    #[inline]
    pub(crate) fn placed(&self, position: &Position) -> Position {
        match &self.transform {
            None => *position,
            Some(transform) => transform.apply(position),
        }
    }

    /// Machine coordinates of a programmed position.
    pub(crate) fn machine(&self, position: &Position) -> Position {
        sum(&self.placed(position), &self.total)
    }

    /// The programmed position of machine coordinates.
    pub(crate) fn programmed(&self, machine: &Position) -> Position {
        let placed = core::array::from_fn(|axis| machine[axis] - self.total[axis]);
        match &self.transform {
            None => placed,
            Some(transform) => transform.invert(&placed),
        }
    }

    /// Sets a row of the table of tool offsets.
    pub(crate) fn set_tool(&mut self, row: ToolOffset) {
        let rows = &mut self.tables.tools;
        match rows.iter_mut().find(|present| present.number == row.number) {
            Some(present) => *present = row,
            None => rows.push(row),
        }
    }

    /// Changes the transformation; one that does nothing is none.
    pub(crate) fn set_transform(&mut self, transform: Transform) {
        self.transform = (!transform.is_identity()).then(|| Box::new(transform));
    }
}

/// The sum of two positions.
pub(crate) fn sum(one: &Position, other: &Position) -> Position {
    core::array::from_fn::<f64, AXIS_COUNT, _>(|axis| one[axis] + other[axis])
}
