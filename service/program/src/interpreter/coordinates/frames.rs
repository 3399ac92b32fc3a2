//! Work coordinate systems and shifts: `G54` to `G59.3` and the extended ones, `G52`, the family of `G92`, and `G50` of lathes.

use super::{Execution, HAAS_STYLE};
use crate::code;
use crate::coordinates::WorkSystem;
use crate::dialect::{Group, Meaning, letter_bit};
use crate::{DialectName, Position, SourceSpan};

impl Execution<'_> {
    /// Selects the work coordinate system of the block.
    pub(in super::super) fn work_system(&mut self) {
        let Some((meaning, span)) = self.code(Group::WorkOffset) else { return };
        let system = match meaning {
            Meaning::WorkOffset(system) => match self.system_parameter(system, span) {
                Some(system) => system,
                None => return,
            },
            Meaning::ExtendedWorkOffset { haas } => {
                if haas && self.is_other_style(span, "G154 is an extended work offset of Haas controls") {
                    self.used |= letter_bit(b'P');
                    return;
                }
                match self.extended_system(span) {
                    Some(system) => system,
                    None => return,
                }
            }
            Meaning::HaasWorkOffset(system) => {
                if self
                    .is_other_style(span, "G110 to G129 are work offsets of Haas controls and other things elsewhere")
                {
                    return;
                }
                system
            }
            _ => return,
        };
        self.select_system(system, span);
    }

    /// Another system from here on; the machine stays where it is.
    pub(in super::super) fn select_system(&mut self, system: WorkSystem, span: SourceSpan) {
        if system == self.state.coords.system {
            return;
        }
        if !self.is_linuxcnc_dialect() && self.is_transform_on(span, "another work offset") {
            return;
        }
        self.rebase(|state| {
            state.coords.take_over_written();
            state.coords.system = system;
        });
    }

    /// `G54 P` is an extended system, where the `P` belongs to no other code of the block.
    fn system_parameter(&mut self, system: WorkSystem, span: SourceSpan) -> Option<WorkSystem> {
        let is_free = system == WorkSystem::FIRST
            && !self.is_linuxcnc_dialect()
            && self.block.letters & !self.used & letter_bit(b'P') != 0
            && [Group::NonModal, Group::Subprogram, Group::MacroCall, Group::Function, Group::Scaling]
                .iter()
                .all(|group| self.block.code(*group).is_none())
            && self.state.drilling.cycle.is_none()
            && !matches!(
                self.code(Group::Motion),
                Some((meaning, _)) if !matches!(meaning, Meaning::Rapid | Meaning::Linear | Meaning::Arc { .. })
            );
        if is_free { self.extended_system(span) } else { Some(system) }
    }

    /// The extended system that `P` names; nothing after a finding.
    fn extended_system(&mut self, span: SourceSpan) -> Option<WorkSystem> {
        let Some(word) = self.take(b'P') else {
            self.coord(
                code::COORD_WORD,
                span,
                "the number P of the extended work offset is missing",
                "add P, such as P1",
            );
            return None;
        };
        let most = if self.is_haas() { 99 } else { u32::from(self.settings.coordinates.extended_systems) };
        let number = self.ranged(&word, 1, most, "the number P of an extended work offset")?;
        u16::try_from(number).ok().and_then(WorkSystem::extended)
    }

    /// Whether the control is not one of Haas, which is then reported.
    pub(super) fn is_other_style(&mut self, span: SourceSpan, message: &str) -> bool {
        if self.is_haas() {
            return false;
        }
        self.coord(code::COORD_SETTING, span, message, format!("set {HAAS_STYLE} if this is such a control"));
        true
    }

    /// `G52`
    pub(super) fn local_shift(&mut self, span: SourceSpan) {
        let axes = self.take_axes();
        if axes.is_empty() {
            return self.coord(
                code::COORD_WORD,
                span,
                "G52 names no axis",
                "add the axes with their shift, such as X0 Y0",
            );
        }
        if self.is_frame_refused(span, "G52") {
            return;
        }
        if self.is_linuxcnc_dialect() {
            return self.rebase(|state| {
                let coords = &mut state.coords;
                axes.iter().for_each(|(axis, _, value)| coords.shift[axis.index()] = *value);
                coords.tables.stored_shift = coords.shift;
                coords.tables.shift_is_on = true;
            });
        }
        if !self.state.absolute || axes.iter().any(|(_, increment, _)| *increment) {
            return self.coord(
                code::COORD_AMBIGUOUS,
                span,
                "whether an incremental G52 adds to the shift in force depends on the control",
                "write G90 before it, with the whole shift",
            );
        }
        let settings = self.settings;
        self.rebase(|state| {
            let mut local = state.coords.local(settings);
            axes.iter().for_each(|(axis, _, value)| local[axis.index()] = *value);
            state.coords.set_local(local, settings);
        });
    }

    /// `G92` with axis words, and `G50` on lathes: the present place gets these coordinates.
    pub(super) fn set_coordinates(&mut self, span: SourceSpan) {
        let is_linuxcnc = self.is_linuxcnc_dialect();
        let axes = self.take_axes();
        if axes.is_empty() {
            // With S alone it is the speed clamp.
            if is_linuxcnc {
                self.coord(code::COORD_WORD, span, "G92 names no axis", "add the axes with their present coordinates");
            }
            return;
        }
        if self.is_frame_refused(span, "the setting of coordinates") {
            return;
        }
        if let Some((axis, _, _)) = axes.iter().find(|(axis, _, _)| self.state.tool_control.held.contains(*axis)) {
            let message = format!("where {} is, only the machine knows", axis.letter());
            return self.coord(code::COORD_SETTING, span, message, "place the axis with an absolute word first");
        }
        if !is_linuxcnc && !self.state.absolute {
            return self.coord(
                code::COORD_AMBIGUOUS,
                span,
                "whether G92 under G91 sets coordinates or shifts them depends on the control",
                "write G90 before it",
            );
        }
        let settings = self.settings;
        let before = self.state.position;
        self.rebase(|state| {
            let coords = &mut state.coords;
            let mut local = coords.local(settings);
            for (axis, increment, value) in &axes {
                let place = axis.index();
                // What an increment adds to the coordinate, it takes from the frame.
                let change = if *increment { *value } else { value - before[place] };
                coords.shift[place] -= change;
                if !is_linuxcnc && !increment {
                    coords.shift[place] += local[place];
                    local[place] = 0.0;
                }
            }
            if is_linuxcnc {
                coords.tables.stored_shift = coords.shift;
                coords.tables.shift_is_on = true;
            } else {
                coords.set_local(local, settings);
            }
        });
        for (axis, increment, value) in &axes {
            if !increment {
                self.state.position[axis.index()] = *value;
            }
        }
    }

    /// `G92.1` and `G92.2` of LinuxCNC.
    pub(in super::super) fn clear_shift(&mut self, keeps: bool) {
        self.rebase(|state| {
            let coords = &mut state.coords;
            coords.shift = Position::default();
            coords.tables.shift_is_on = false;
            if !keeps {
                coords.tables.stored_shift = Position::default();
            }
        });
    }

    /// `G92.3` of LinuxCNC.
    pub(in super::super) fn restore_shift(&mut self) {
        self.rebase(|state| {
            let coords = &mut state.coords;
            coords.shift = coords.tables.stored_shift;
            coords.tables.shift_is_on = true;
        });
    }

    /// `G92.1` and, on lathes, `G50.3`: these axes are back in the work coordinate system without shifts.
    pub(super) fn preset(&mut self, span: SourceSpan) {
        let axes = self.take_axes();
        let name = if self.settings.dialect == DialectName::Lathe { "G50.3" } else { "G92.1" };
        if axes.is_empty() {
            let message = format!("{name} names no axis");
            return self.coord(code::COORD_WORD, span, message, "name the axes with 0, such as X0 Y0");
        }
        if axes.iter().any(|(_, _, value)| *value != 0.0) {
            let message = format!("the words of {name} must be 0: it presets axes to their work coordinate system");
            return self.coord(code::COORD_WORD, span, message, "write 0 for each axis, or set coordinates with G92");
        }
        if self.is_frame_refused(span, "the preset of coordinates") {
            return;
        }
        let settings = self.settings;
        self.rebase(|state| {
            let mut local = state.coords.local(settings);
            for (axis, _, _) in &axes {
                state.coords.shift[axis.index()] = 0.0;
                local[axis.index()] = 0.0;
            }
            state.coords.set_local(local, settings);
        });
    }
}
