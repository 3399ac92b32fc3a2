//! `G10`: offsets set by the program.

use super::Execution;
use super::register::CANCEL_OFFSET;
use crate::block::Word;
use crate::code;
use crate::coordinates::{Rotation, WorkOffset, WorkSystem};
use crate::dialect::letter_bit;
use crate::{Axis, DialectName, Finding, Plane, Position, SourceSpan, ToolOffset};

/// Largest number of a tool offset that `G10` sets.
const LARGEST_OFFSET: u32 = 999;

/// On lathes, geometry is set by the number of the offset and this.
const GEOMETRY: u32 = 10_000;

/// Letters whose words belong to `G10` only.
const LETTERS: u32 =
    letter_bit(b'L') | letter_bit(b'P') | letter_bit(b'R') | letter_bit(b'Q') | letter_bit(b'I') | letter_bit(b'J');

impl Execution<'_> {
    /// `G10`
    pub(super) fn set_data(&mut self, span: SourceSpan) {
        let kind = match self.take(b'L') {
            Some(word) => match self.whole(&word) {
                Some(kind) => Some(kind),
                None => return self.drop_words(),
            },
            None => None,
        };
        let dialect = self.settings.dialect;
        match (dialect, kind) {
            (DialectName::Lathe | DialectName::Mill, Some(3 | 50 | 51 | 52)) => self.skip_data(span),
            (DialectName::Lathe | DialectName::Mill, Some(2)) => {
                let Some(number) = self.data_number(span, 0, 6, "work offset") else { return };
                self.set_fanuc_offset(u16::try_from(number).ok().and_then(WorkSystem::plain), span);
            }
            (DialectName::Lathe | DialectName::Mill, Some(20)) => {
                let most = if self.is_haas() { 99 } else { u32::from(self.settings.coordinates.extended_systems) };
                let Some(number) = self.data_number(span, 1, most, "extended work offset") else { return };
                let system = u16::try_from(number).ok().and_then(WorkSystem::extended);
                if system.is_some() {
                    self.set_fanuc_offset(system, span);
                }
            }
            (DialectName::Lathe, None | Some(10 | 11)) => self.set_lathe_offset(kind, span),
            (DialectName::Mill, Some(kind @ (1 | 10..=13))) => self.set_mill_offset(kind, span),
            (DialectName::LinuxCnc, Some(kind @ (2 | 20))) => self.set_linuxcnc_offset(kind == 20, span),
            (DialectName::LinuxCnc, Some(kind @ (1 | 10 | 11))) => self.set_linuxcnc_tool(kind, span),
            _ => {
                self.drop_words();
                let message = kind.map_or("G10 without L".to_owned(), |kind| format!("G10 L{kind}"));
                self.coord(
                    code::COORD_WORD,
                    span,
                    format!("{message} sets nothing that is known"),
                    "write L with what is set, such as L2 for a work offset",
                );
            }
        }
    }

    /// Words that a finding has made meaningless.
    fn drop_words(&mut self) {
        self.used |= LETTERS | self.block.letters & self.table.axis_letters;
    }

    /// The number `P`; nothing after a finding.
    fn data_number(&mut self, span: SourceSpan, least: u32, most: u32, what: &str) -> Option<u32> {
        let number = match self.take(b'P') {
            Some(word) => self.ranged(&word, least, most, &format!("the number P of the {what}")),
            None => {
                let message = format!("the number P of the {what} is missing");
                self.coord(code::COORD_WORD, span, message, "add P with the number");
                None
            }
        };
        if number.is_none() {
            self.drop_words();
        }
        number
    }

    /// `G10 L50`, `G10 L3`: everything up to `G11` is data of the control.
    fn skip_data(&mut self, span: SourceSpan) {
        self.drop_words();
        self.state.skipping_data = Some(span.line);
        self.coord(
            code::DATA_SKIPPED,
            span,
            "data of the control up to G11 is not read",
            "make sure that the machine profile says what it changes",
        );
    }

    /// `G11` without data before it.
    pub(super) fn stray_data_end(&mut self, span: SourceSpan) {
        self.coord(code::COORD_WORD, span, "G11 ends data that no G10 has begun", "remove it");
    }

    /// Whether `G90` sets; `G91` adds, as the letters of increments do.
    fn adds(&self, increment: bool) -> bool {
        increment || !self.state.absolute
    }

    /// A work offset of a FANUC control; `None` for the external one.
    fn set_fanuc_offset(&mut self, system: Option<WorkSystem>, span: SourceSpan) {
        let axes = self.take_axes();
        if axes.is_empty() {
            return self.coord(
                code::COORD_WORD,
                span,
                "G10 sets the offset of no axis",
                "add the axes with their offsets",
            );
        }
        if self.is_frame_refused(span, "the setting of a work offset") {
            return;
        }
        let settings = self.settings;
        let changes: Vec<_> =
            axes.into_iter().map(|(axis, increment, value)| (axis, self.adds(increment), value)).collect();
        self.rebase(|state| {
            let coords = &mut state.coords;
            let mut place = system.map_or(WorkOffset { offset: coords.external, rotation_deg: 0.0 }, |system| {
                coords.offset_of(system, settings)
            });
            for (axis, adds, value) in changes {
                let offset = &mut place.offset[axis.index()];
                *offset = if adds { *offset + value } else { value };
            }
            match system {
                Some(system) => coords.set_offset(system, place),
                None => coords.external = place.offset,
            }
        });
    }

    /// The row of a tool offset, as the program, the job or the profile has it.
    pub(in super::super) fn tool_row(&self, number: u32) -> Option<ToolOffset> {
        super::tool_row(self.state, self.tools, number)
    }

    /// Sets a row unless it is in force with another offset.
    fn change_tool_row(&mut self, row: ToolOffset, span: SourceSpan) {
        let number = row.number;
        if number != 0 && self.state.is_in_force(&row, self.tool_row(number).as_ref()) {
            return self.findings.push_with(code::OFFSET_IN_FORCE, |code| {
                Finding::new(code, span, format!("tool offset {number} is changed while it is in force"))
                    .with_value("offset", f64::from(number), "")
                    .suggest(CANCEL_OFFSET)
            });
        }
        self.state.coords.set_tool(row);
    }

    /// `G10 L10` to `L13` and `L1` on mills.
    fn set_mill_offset(&mut self, kind: u32, span: SourceSpan) {
        let Some(number) = self.data_number(span, 1, LARGEST_OFFSET, "tool offset") else { return };
        let Some(word) = self.take(b'R') else {
            return self.coord(
                code::COORD_WORD,
                span,
                "the value R of the tool offset is missing",
                "add R with the value",
            );
        };
        let value = self.scaled(&word, true);
        let adds = !self.state.absolute;
        let mut row = self.tool_row(number).unwrap_or(ToolOffset::new(number));
        let z = Axis::Z.index();
        let is_known = match kind {
            10 => !adds || row.geometry.is_some(),
            12 => !adds || row.radius_mm.is_some(),
            _ => true,
        };
        if !is_known {
            return self.unknown_offset(number, span, "a value is added to a tool offset that is not known");
        }
        let set = |present: f64| if adds { present + value } else { value };
        match kind {
            10 => {
                let geometry = row.geometry.get_or_insert_default();
                geometry[z] = set(geometry[z]);
            }
            11 => row.wear[z] = set(row.wear[z]),
            12 => row.radius_mm = Some(set(row.radius_mm.unwrap_or(0.0))),
            13 => row.radius_wear_mm = set(row.radius_wear_mm),
            _ if adds || row.geometry.is_some_and(|geometry| geometry[z] != 0.0) || row.wear[z] != 0.0 => {
                return self.coord(
                    code::COORD_AMBIGUOUS,
                    span,
                    "G10 L1 sets the wear on controls with geometry and wear, the whole offset on others",
                    "write L10 for the geometry, L11 for the wear",
                );
            }
            _ => row.geometry.get_or_insert_default()[z] = value,
        }
        self.change_tool_row(row, span);
    }

    /// `G10 P` of lathes, and `L10`, `L11` with the number alone.
    fn set_lathe_offset(&mut self, kind: Option<u32>, span: SourceSpan) {
        let most = if kind.is_some() { LARGEST_OFFSET } else { GEOMETRY + LARGEST_OFFSET };
        let Some(number) = self.data_number(span, u32::from(kind.is_some()), most, "tool offset") else { return };
        let added_radius = self.take(b'C');
        let (radius, tip) = (self.take(b'R'), self.take(b'Q'));
        let axes = self.take_axes();
        if !self.state.absolute && axes.iter().any(|(_, increment, _)| !increment) {
            return self.coord(
                code::COORD_AMBIGUOUS,
                span,
                "whether X and Z of G10 add under G91 depends on the control",
                "write G90 before it, or U and W for what is added",
            );
        }
        if number == 0 {
            return self.shift_work(&axes, span);
        }
        if (LARGEST_OFFSET + 1..=GEOMETRY).contains(&number) {
            let message =
                format!("P{number} is neither a wear offset (1 to 999) nor a geometry offset (10001 to 10999)");
            return self.coord(code::COORD_WORD, span, message, "write the number of the offset");
        }
        let is_geometry = kind == Some(10) || number > GEOMETRY;
        let number = number % GEOMETRY;
        let mut row = self.tool_row(number).unwrap_or(ToolOffset::new(number));
        if is_geometry && row.geometry.is_none() && axes.iter().any(|(_, increment, _)| *increment)
            || is_geometry && row.radius_mm.is_none() && added_radius.is_some()
        {
            return self.unknown_offset(number, span, "a value is added to a tool offset that is not known");
        }
        for (axis, increment, value) in axes {
            let offset = if is_geometry { row.geometry.get_or_insert_default() } else { &mut row.wear };
            let offset = &mut offset[axis.index()];
            *offset = if increment { *offset + value } else { value };
        }
        for (word, adds) in [(radius, false), (added_radius, true)] {
            let Some(word) = word else { continue };
            let value = self.scaled(&word, true);
            let present = if is_geometry { row.radius_mm.unwrap_or(0.0) } else { row.radius_wear_mm };
            let value = if adds { present + value } else { value };
            if is_geometry {
                row.radius_mm = Some(value);
            } else {
                row.radius_wear_mm = value;
            }
        }
        if let Some(word) = tip {
            let Some(tip) = self.ranged(&word, 0, 9, "the tip Q") else { return };
            row.tip = tip as u8;
        }
        self.change_tool_row(row, span);
    }

    /// `G10 P0` of lathes.
    fn shift_work(&mut self, axes: &[(Axis, bool, f64)], span: SourceSpan) {
        if self.is_frame_refused(span, "the shift of the work coordinate systems") {
            return;
        }
        self.rebase(|state| {
            for (axis, increment, value) in axes {
                let shift = &mut state.coords.work_shift[axis.index()];
                *shift = if *increment { *shift + value } else { *value };
            }
        });
    }

    #[cold]
    pub(super) fn unknown_offset(&mut self, number: u32, span: SourceSpan, message: &str) {
        self.findings.push_with(code::OFFSET_UNKNOWN, |code| {
            Finding::new(code, span, format!("{message}: offset {number}"))
                .with_value("offset", f64::from(number), "")
                .suggest("give the tool its offset, and the job the tool")
        });
    }

    /// `G10 L2` and `L20` of LinuxCNC.
    fn set_linuxcnc_offset(&mut self, to_present: bool, span: SourceSpan) {
        let Some(number) = self.data_number(span, 0, 9, "coordinate system") else { return };
        let active = self.state.coords.system;
        let system = u16::try_from(number).ok().and_then(WorkSystem::plain).unwrap_or(active);
        let rotation = self.take(b'R');
        if let (true, Some(word)) = (to_present, rotation) {
            self.drop_words();
            return self.word_conflict(&word, "G10 L20 does not set the rotation; G10 L2 does");
        }
        let axes = self.take_axes();
        let settings = self.settings;
        let mut place = self.state.coords.stored_offset_of(system, settings);
        if let Some(word) = rotation {
            let before = self.state.coords.offset_of(active, settings).rotation_deg;
            place.rotation_deg = self.scaled(&word, false);
            let [x, y] = [self.state.coords.shift[0], self.state.coords.shift[1]];
            if system == active && place.rotation_deg != before && [x, y] != [0.0; 2] {
                return self.rotation_under_shift(span, [x, y]);
            }
        }
        if to_present {
            self.read_as(&mut place, &axes);
        } else {
            axes.iter().for_each(|(axis, _, value)| place.offset[axis.index()] = *value);
        }
        self.rebase(|state| state.coords.set_offset(system, place));
    }

    /// Refuses another rotation of the system in force under a shift: LinuxCNC counts the present position anew without the shift,
    /// so that an axis which the next move does not name goes elsewhere.
    #[cold]
    fn rotation_under_shift(&mut self, span: SourceSpan, [x, y]: [f64; 2]) {
        self.findings.push_with(code::COORD_TURNED_UNDER_SHIFT, |code| {
            let message = format!(
                "the system in force is turned under a shift of G52 or G92 by X{x} Y{y}: LinuxCNC 2.9 forgets the shift when it \
                 counts the position anew, and goes elsewhere with an axis that the next move does not name"
            );
            Finding::new(code, span, message)
                .with_value("shift_x", x, "mm")
                .with_value("shift_y", y, "mm")
                .suggest("clear the shift in a block before (G52 X0 Y0), and set it again in a block behind")
        });
    }

    /// Moves a system so that the present position reads the given values in it; unnamed axes read what they do.
    fn read_as(&self, place: &mut WorkOffset, axes: &[(Axis, bool, f64)]) {
        let rotation = Rotation::new(Plane::Xy, [0.0; 2], place.rotation_deg);
        let machine = self.machine_position();
        let (shift, tool) = (self.state.coords.shift, self.state.length.offset);
        let mut here: Position = core::array::from_fn(|axis| machine[axis] - tool[axis]);
        let mut arm: Position = core::array::from_fn(|axis| here[axis] - place.offset[axis]);
        [arm[0], arm[1]] = rotation.turn([arm[0], arm[1]], true);
        // The position in the system with the shift.
        for (axis, _, value) in axes {
            arm[axis.index()] = value + shift[axis.index()];
        }
        [arm[0], arm[1]] = rotation.turn([arm[0], arm[1]], false);
        for (here, arm) in here.iter_mut().zip(arm) {
            *here -= arm;
        }
        // Without a rotation, an axis depends on its own word only.
        for axis in Axis::ALL {
            let turns = place.rotation_deg != 0.0 && axis.index() < 2;
            if turns || axes.iter().any(|(named, _, _)| *named == axis) {
                place.offset[axis.index()] = here[axis.index()];
            }
        }
    }

    /// The offsets of a tool with which the present position reads the given values in a system (`G10 L10` in the one in force, `L11` in
    /// G59.3), or the values themselves (`L1`). In a turned system the offset is turned as well, whose other part along the system's
    /// axes stays.
    fn measure_tool(&self, row: &mut ToolOffset, axes: &[(Axis, bool, f64)], kind: u32, frame: &WorkOffset) {
        let rotation = Rotation::new(Plane::Xy, [0.0; 2], frame.rotation_deg);
        let turned = |mut place: Position, back: bool| {
            [place[0], place[1]] = rotation.turn([place[0], place[1]], back);
            place
        };
        let turns = kind != 1 && frame.rotation_deg != 0.0 && axes.iter().any(|(axis, _, _)| axis.index() < 2);
        let here: Position = match kind {
            10 => {
                let tool = if turns { turned(self.state.length.offset, true) } else { self.state.length.offset };
                core::array::from_fn(|axis| self.state.position[axis] + tool[axis])
            }
            _ => {
                let machine = self.machine_position();
                let arm = core::array::from_fn(|axis| machine[axis] - frame.offset[axis]);
                if turns { turned(arm, true) } else { arm }
            }
        };
        let total = row.total().unwrap_or_default();
        let mut offset = if turns { turned(total, true) } else { total };
        for (axis, _, value) in axes {
            let axis = axis.index();
            offset[axis] = if kind == 1 { *value } else { here[axis] - value };
        }
        if turns {
            offset = turned(offset, false);
        }
        for axis in Axis::ALL {
            if turns && axis.index() < 2 || axes.iter().any(|(named, _, _)| *named == axis) {
                row.geometry.get_or_insert_default()[axis.index()] = offset[axis.index()];
                row.wear[axis.index()] = 0.0;
            }
        }
    }

    /// `G10 L1`, `L10` and `L11` of LinuxCNC: the table only, what is in force stays.
    fn set_linuxcnc_tool(&mut self, kind: u32, span: SourceSpan) {
        let Some(number) = self.data_number(span, 1, u32::MAX, "tool") else { return };
        let words = [b'R', b'I', b'J', b'Q'].map(|letter| self.take(letter));
        let axes = self.take_axes();
        let Some(mut row) = self.tool_row(number) else {
            return self.unknown_offset(number, span, "the tool is not in the table of tools");
        };
        let settings = self.settings;
        let frame = match kind {
            11 => match WorkSystem::plain(9) {
                Some(system) => self.state.coords.offset_of(system, settings),
                None => return,
            },
            _ => self.state.coords.offset_of(self.state.coords.system, settings),
        };
        self.measure_tool(&mut row, &axes, kind, &frame);
        let [radius, front, back, orientation] = words;
        if let Some(word) = radius {
            row.radius_mm = Some(self.scaled(&word, true));
            row.radius_wear_mm = 0.0;
        }
        let degrees = |word: Option<Word>, present: f64| word.map_or(present, |word| word.number.value());
        row.front_angle_deg = degrees(front, row.front_angle_deg);
        row.back_angle_deg = degrees(back, row.back_angle_deg);
        if let Some(word) = orientation {
            let Some(orientation) = self.ranged(&word, 0, 9, "the orientation Q") else { return };
            row.tip = super::super::compensation::TIP_OF_ORIENTATION[orientation as usize];
        }
        self.state.coords.set_tool(row);
    }
}
