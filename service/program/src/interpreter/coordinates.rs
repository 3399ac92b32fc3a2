//! Coordinates and offsets: what the codes of coordinates do to the registers, and what follows for the place of the tool.
//!
//! No code here moves the machine by itself, except the returns to reference positions: the same place has other coordinates.

mod data;
mod due;
mod frames;
mod planar;
mod reference;
mod register;
mod tool;

use super::execute::Execution;
use crate::block::Word;
use crate::code;
use crate::dialect::{Group, Letter, Meaning};
use crate::state::{InterpreterState, ToolMode};
use crate::{Axis, CoordinateStyle, DialectName, Finding, FindingCode, LanguageSettings, Position, SourceSpan};

use super::motion::set_bits;

pub(crate) use register::set_initial_offsets;
pub(super) use register::{Register, assign, read, tool_row, unassigned_offset};

/// Changes registers while the machine stays where it is, so that its place has other coordinates.
pub(super) fn rebase(
    state: &mut InterpreterState,
    settings: &LanguageSettings,
    change: impl FnOnce(&mut InterpreterState),
) {
    let (total, transform) = (state.coords.total, state.coords.transform.clone());
    let machine = state.coords.machine(&state.position);
    change(state);
    let tool = state.length.offset;
    state.coords.resolve(settings, &tool);
    let is_same = transform == state.coords.transform;
    if is_same && total == state.coords.total {
        return;
    }
    state.spline_exit = None;
    state.parameters.changed();
    if is_same && transform.is_none() {
        for ((value, before), after) in state.position.iter_mut().zip(&total).zip(&state.coords.total) {
            if before != after {
                *value += before - after;
            }
        }
    } else {
        state.position = state.coords.programmed(&machine);
    }
}

/// Which setting says that the control is one of Haas.
pub(super) const HAAS_STYLE: &str = "language.coordinates.style of the machine profile to COORDINATE_STYLE_HAAS";

impl Execution<'_> {
    /// See [`rebase`].
    pub(super) fn rebase(&mut self, change: impl FnOnce(&mut InterpreterState)) {
        rebase(self.state, self.settings, change);
    }

    /// Takes over another tool offset while only the machine knows where the linear axes are.
    pub(super) fn resolve_held(&mut self) {
        let tool = self.state.length.offset;
        self.state.coords.resolve(self.settings, &tool);
    }

    /// The codes of coordinates that a block carries out before its motion.
    pub(super) fn coordinates(&mut self) {
        if self.block.code(Group::Mirror).is_some()
            || self.block.code(Group::Scaling).is_some()
            || self.block.code(Group::Rotation).is_some()
            || self.block.code(Group::PolarCoordinates).is_some()
        {
            self.planar_codes();
        }
        let Some((meaning, span)) = self.code(Group::NonModal) else { return };
        self.check_one_use_of_axes(meaning);
        match meaning {
            Meaning::LocalShift => self.local_shift(span),
            Meaning::ShiftSet | Meaning::SpeedClamp => self.set_coordinates(span),
            Meaning::ShiftClear { keeps } => self.clear_shift(keeps),
            Meaning::ShiftRestore => self.restore_shift(),
            Meaning::Preset => self.preset(span),
            Meaning::DataSetting => self.set_data(span),
            Meaning::DataSettingEnd => self.stray_data_end(span),
            Meaning::Reference | Meaning::FurtherReference => {
                self.reference(span, meaning == Meaning::FurtherReference);
            }
            Meaning::ReferenceReturn => self.reference_return(span),
            Meaning::StoreReference { second } => self.store_reference(second, span),
            _ => {}
        }
    }

    /// LinuxCNC refuses a motion code beside one that has the words of axes for itself.
    fn check_one_use_of_axes(&mut self, meaning: Meaning) {
        let has_axes_for_itself = matches!(
            meaning,
            Meaning::LocalShift
                | Meaning::ShiftSet
                | Meaning::DataSetting
                | Meaning::Reference
                | Meaning::FurtherReference
        );
        let Some((motion, span)) = self.code(Group::Motion).filter(|_| has_axes_for_itself) else { return };
        if self.is_linuxcnc_dialect() && motion != Meaning::CycleEnd {
            self.findings.push_with(code::WORD_CONFLICT, |code| {
                Finding::new(code, span, "two codes of the block use the words of axes: LinuxCNC refuses it")
                    .suggest("write the motion in a block of its own")
            });
        }
    }

    pub(super) fn is_linuxcnc_dialect(&self) -> bool {
        self.settings.dialect == DialectName::LinuxCnc
    }

    fn is_haas(&self) -> bool {
        self.settings.coordinates.style == CoordinateStyle::Haas
    }

    /// The axis words that no step has used, as axis, whether it is an increment by its letter, and value in mm or degrees. They
    /// are used by this.
    fn take_axes(&mut self) -> Vec<(Axis, bool, f64)> {
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        self.used |= axes;
        let mut taken: Vec<(Axis, bool, f64)> = Vec::new();
        for place in set_bits(axes) {
            let letter = self.table.dialect.letters[place];
            let (axis, increment) = match letter {
                Letter::Axis(axis) => (axis, false),
                Letter::Increment(axis) => (axis, true),
                _ => continue,
            };
            let word = *self.block.slot(place);
            if taken.iter().any(|(named, _, _)| *named == axis) {
                self.word_conflict(&word, "the block has both an absolute and an incremental word for this axis");
                continue;
            }
            let value = if axis == Axis::X { self.radius(&word) } else { self.scaled(&word, letter.is_length()) };
            taken.push((axis, increment, value));
        }
        taken
    }

    /// Whether something is on that does not go with a change of frames or a reference position, which is then reported.
    fn is_frame_refused(&mut self, span: SourceSpan, what: &str) -> bool {
        if self.state.tool_control.mode != ToolMode::Off {
            self.coord(
                code::COORD_BLOCK,
                span,
                format!("{what} under tool centre point control or in a tilted plane"),
                "switch it off with G49 or G69 first",
            );
            return true;
        }
        if self.is_linuxcnc_dialect() {
            return false;
        }
        self.is_transform_on(span, what)
    }

    /// Whether mirror image, scaling, rotation or polar coordinates are on, which is then reported as refusing something.
    pub(super) fn is_transform_on(&mut self, span: SourceSpan, what: &str) -> bool {
        let Some((name, cure)) = self.transform_on() else { return false };
        self.coord(code::COORD_BLOCK, span, format!("{what} while {name} is on"), cure);
        true
    }

    /// What of the transformations is on, and how it is switched off.
    fn transform_on(&self) -> Option<(&'static str, &'static str)> {
        let coords = &self.state.coords;
        if coords.polar.is_some() {
            return Some(("the polar coordinates (G16)", "switch them off with G15 first"));
        }
        let transform = coords.transform.as_ref()?;
        if transform.rotation.is_some() {
            return Some(match self.is_linuxcnc_dialect() {
                true => ("the rotation of the work coordinate system", "select a system without rotation first"),
                false => ("the rotation (G68)", "switch it off with G69 first"),
            });
        }
        if transform.scaling.is_some() {
            return Some(("the scaling (G51)", "switch it off with G50 first"));
        }
        Some(("the mirror image (G51.1)", "switch it off with G50.1 first"))
    }

    /// A whole number of a word from `least` to `most`; `None` after a finding.
    fn ranged(&mut self, word: &Word, least: u32, most: u32, what: &str) -> Option<u32> {
        let number = self.whole(word)?;
        if (least..=most).contains(&number) {
            return Some(number);
        }
        let span = self.block.word_span(word);
        self.findings.push_with(code::COORD_WORD, |code| {
            Finding::new(code, span, format!("{what} must be {least} to {most}, is {number}"))
                .with_value("number", f64::from(number), "")
                .with_value("least", f64::from(least), "")
                .with_value("most", f64::from(most), "")
                .suggest("write a number that there is")
        });
        None
    }

    #[cold]
    pub(super) fn coord(
        &mut self,
        code: FindingCode,
        span: SourceSpan,
        message: impl Into<String>,
        cure: impl Into<String>,
    ) {
        let (message, cure) = (message.into(), cure.into());
        self.findings.push_with(code, |code| Finding::new(code, span, message).suggest(cure));
    }

    /// The machine coordinates of the tool.
    pub(super) fn machine_position(&self) -> Position {
        self.state.coords.machine(&self.state.position)
    }
}
