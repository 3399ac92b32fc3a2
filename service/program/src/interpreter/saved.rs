//! `M70` to `M73` of LinuxCNC: saving and restoring modes.

use serde::{Deserialize, Serialize};

use super::execute::Execution;
use crate::code;
use crate::coordinates::WorkSystem;
use crate::dialect::FeedUnit;
use crate::state::{CompensationOn, InterpreterState, LengthCompensation, Overrides};
use crate::{Coolant, Finding, OperationKind, PathControl, Plane, Position, SourceSpan, SpindleDirection};

/// The modes that `M70` saves: not the motion, nor the position.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SavedModes {
    plane: Plane,
    inch: bool,
    absolute: bool,
    arc_absolute: bool,
    feed_unit: FeedUnit,
    feed: f64,
    feed_as_written: f64,
    spindle_direction: SpindleDirection,
    surface_speed: bool,
    rev_per_min: f64,
    m_per_min: f64,
    max_rev_per_min: Option<f64>,
    coolant: Coolant,
    system: WorkSystem,
    x_diameter: bool,
    length: LengthCompensation,
    compensation: Option<CompensationOn>,
    path_control: PathControl,
    cycles_return_to_r: bool,
    shift_is_on: bool,
    overrides: Overrides,
}

impl SavedModes {
    /// The modes in force.
    pub(crate) fn of(state: &InterpreterState) -> Self {
        Self {
            plane: state.plane,
            inch: state.inch,
            absolute: state.absolute,
            arc_absolute: state.arc_absolute,
            feed_unit: state.feed_unit,
            feed: state.feed,
            feed_as_written: state.feed_as_written,
            spindle_direction: state.spindle_direction,
            surface_speed: state.surface_speed,
            rev_per_min: state.rev_per_min,
            m_per_min: state.m_per_min,
            max_rev_per_min: state.max_rev_per_min,
            coolant: state.coolant,
            system: state.coords.system,
            x_diameter: state.x_diameter,
            length: state.length,
            compensation: state.compensation.on,
            path_control: state.path_control,
            cycles_return_to_r: state.drilling.to_r,
            shift_is_on: state.coords.tables.shift_is_on,
            overrides: state.machine.overrides,
        }
    }
}

impl SavedModes {
    /// The same without what they say of the compensation of the radius.
    pub(crate) fn without_compensation(self) -> Self {
        Self { compensation: None, ..self }
    }
}

impl Execution<'_> {
    /// `M72`, and the return to modes of `M73`. The interpreter of LinuxCNC writes the codes that differ, without words beside them: `G43`
    /// is the offset of the tool in the spindle as the table has it now, and does nothing where any offset is in force; `G96`
    /// clamps no speed, and leaves the clamp alone where it is in force; `G92.2` or `G92.3` put the shift out of force or back.
    pub(super) fn restore_codes(&mut self, saved: &SavedModes, span: SourceSpan) {
        let mut saved = saved.clone();
        let clamp = saved.max_rev_per_min;
        saved.max_rev_per_min = self.state.max_rev_per_min;
        if saved.surface_speed && !self.state.surface_speed {
            saved.max_rev_per_min = None;
            self.note_clamp_lost(clamp, span);
        }
        let is_code_g43 = |length: &LengthCompensation| length.offset != Position::default();
        saved.length = match (is_code_g43(&saved.length), is_code_g43(&self.state.length)) {
            (true, false) => self.length_of_spindle_tool(span).unwrap_or(self.state.length),
            (false, true) => LengthCompensation::default(),
            _ => self.state.length,
        };
        self.state.machine.overrides.restore(saved.overrides);
        self.restore(&saved, span);
        match (saved.shift_is_on, self.state.coords.tables.shift_is_on) {
            (true, false) => self.restore_shift(),
            (false, true) => self.clear_shift(true),
            _ => {}
        }
    }

    fn note_clamp_lost(&mut self, clamp: Option<f64>, span: SourceSpan) {
        let Some(clamp) = clamp else { return };
        self.findings.push_with(code::SPEED_CLAMP_MISSING, |code| {
            let message =
                format!("G96 is restored without its D{clamp}: LinuxCNC restores the code and S, not the clamp");
            Finding::new(code, span, message)
                .with_value("clamp", clamp, "rev/min")
                .suggest(format!("write G96 D{clamp} with S behind it"))
        });
    }

    /// Puts saved modes in force again as they were; the spindle and the coolant follow where they differ.
    pub(super) fn restore(&mut self, saved: &SavedModes, span: SourceSpan) {
        let before = self.state.spindle();
        let state = &mut *self.state;
        if state.plane != saved.plane {
            state.spline_exit = None;
        }
        state.plane = saved.plane;
        state.inch = saved.inch;
        state.absolute = saved.absolute;
        state.arc_absolute = saved.arc_absolute;
        state.feed_unit = saved.feed_unit;
        state.feed = saved.feed;
        state.feed_as_written = saved.feed_as_written;
        state.spindle_direction = saved.spindle_direction;
        state.surface_speed = saved.surface_speed;
        state.rev_per_min = saved.rev_per_min;
        state.m_per_min = saved.m_per_min;
        state.max_rev_per_min = saved.max_rev_per_min;
        state.path_control = saved.path_control;
        state.drilling.to_r = saved.cycles_return_to_r;
        (state.reported.feed, state.reported.spindle) = (false, false);
        state.x_diameter = saved.x_diameter;
        let (length, system) = (saved.length, saved.system);
        self.rebase(|state| {
            if system != state.coords.system {
                state.coords.take_over_written();
            }
            (state.length, state.coords.system) = (length, system);
        });
        if saved.compensation.is_some() {
            self.compensation_restored(span);
        }
        self.emit_spindle(before, span);
        if self.state.coolant != saved.coolant {
            self.state.coolant = saved.coolant;
            self.emit(span, OperationKind::Coolant(saved.coolant));
        }
    }
}
