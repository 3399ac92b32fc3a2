//! Reference positions: `G28`, `G30`, `G29`, and `G28.1`, `G30.1` of LinuxCNC, which store them.

use super::super::motion::{Frame, shorter_turn};
use super::super::tool_control::{GuidedPath, ROTARY_LETTERS};
use super::{Execution, HAAS_STYLE};
use crate::code;
use crate::coordinates::Intermediate;
use crate::dialect::{Letter, letter_bit};
use crate::state::ToolMode;
use crate::{Axis, AxisSet, DialectName, Feed, Finding, MoveKind, Position, SourceSpan};

/// Rounding, in turns: an axis that is there does not turn.
const SAME_TURN: f64 = 1e-12;

/// Every axis.
const ALL: AxisSet = AxisSet::LINEAR.with(AxisSet::ROTARY).with_axis(Axis::U).with_axis(Axis::V).with_axis(Axis::W);

impl Execution<'_> {
    /// `G28`, `G30`: rapid over the intermediate point to the reference position, in the axes named.
    pub(super) fn reference(&mut self, span: SourceSpan, further: bool) {
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        let Some(number) = self.reference_number(further) else {
            self.used |= axes;
            return;
        };
        if !self.is_linuxcnc_dialect() && self.is_transform_on(span, "the return to a reference position") {
            self.used |= axes;
            return;
        }
        if further && self.state.tool_control.mode != ToolMode::Off {
            self.used |= axes;
            return self.not_permitted(span, "the return to a further reference position");
        }
        let Some(reference) = self.state.coords.tables.reference[number] else {
            self.used |= axes;
            let place = number + 1;
            let message = format!("where reference position {place} lies is not known");
            let cure = format!("state reference position {place} in the machine profile or the offsets of the job");
            return self.coord(code::COORD_SETTING, span, message, cure);
        };
        if self.state.tool_control.mode == ToolMode::Plane && self.refuse_rotary_words(axes & ROTARY_LETTERS) {
            self.used |= axes;
            return;
        }
        self.state.spline_exit = None;
        if axes == 0 {
            return self.bare_reference(span, &reference);
        }
        // The way over the point is the axes' own, whatever offset is to come.
        self.forget_due(axes);
        let held = self.state.tool_control.held;
        let over = self.target(axes, Frame::Work);
        self.rapid(over, held);
        self.state.position = over;
        let named = self.named_axes(axes);
        let intermediate = Intermediate { axes: named, position: over, total: self.state.coords.total };
        self.state.coords.tables.intermediate = Some(intermediate);
        self.go_home(named, &reference, span);
        if !further {
            self.length_returned();
        }
    }

    /// Index of the reference position; nothing after a finding.
    fn reference_number(&mut self, further: bool) -> Option<usize> {
        if !further {
            return Some(0);
        }
        if self.is_linuxcnc_dialect() {
            return Some(1);
        }
        match self.take(b'P') {
            None => Some(1),
            Some(word) => self.ranged(&word, 2, 4, "the number P of the reference position").map(|it| it as usize - 1),
        }
    }

    /// `G28` without axes.
    fn bare_reference(&mut self, span: SourceSpan, reference: &Position) {
        if !self.is_linuxcnc_dialect() && !self.is_haas() {
            let has_increments = self.table.dialect.letters.iter().any(|letter| matches!(letter, Letter::Increment(_)));
            let such_as = if has_increments { "U0 W0" } else { "G91 G28 Z0, with G90 behind it" };
            let of_system_a = letter_bit(b'U') | letter_bit(b'W');
            let is_in_words_of_a = self.settings.dialect == DialectName::Lathe
                && !has_increments
                && self.block.letters & !self.used & of_system_a != 0;
            if is_in_words_of_a {
                self.used |= of_system_a;
                return self.findings.push_with(code::REFERENCE_AXIS, |code| {
                    let message =
                        "the return to the reference position names no axis: U and W are those of G-code system A";
                    Finding::new(code, span, message).suggest(
                        "write G91 in the block and X and Z for U and W, such as G91 G28 X0 Z0, and G90 behind it",
                    )
                });
            }
            return self.findings.push_with(code::REFERENCE_AXIS, |code| {
                Finding::new(code, span, "the return to the reference position names no axis")
                    .suggest(format!("name the axes with their intermediate point, such as {such_as}"))
                    .suggest(format!("set {HAAS_STYLE} if the control sends all axes home"))
            });
        }
        if self.is_linuxcnc_dialect() {
            // Over an intermediate point, too: the present one, which is another behind a contour.
            let here = self.state.position;
            self.emit_move(MoveKind::Rapid, &here, None, Feed::PerMinute(0.0));
        }
        self.go_home(ALL, reference, span);
        self.length_returned();
    }

    /// Rapid to the reference position in these axes.
    fn go_home(&mut self, named: AxisSet, reference: &Position, span: SourceSpan) {
        if self.settings.coordinates.reference_cancels_local && !self.is_linuxcnc_dialect() {
            let settings = self.settings;
            self.rebase(|state| {
                let mut local = state.coords.local(settings);
                Axis::ALL.into_iter().filter(|axis| named.contains(*axis)).for_each(|axis| local[axis.index()] = 0.0);
                state.coords.set_local(local, settings);
            });
        }
        let home = if self.state.coords.transform.is_none() {
            let total = self.state.coords.total;
            let mut home = self.state.position;
            for axis in Axis::ALL.into_iter().filter(|axis| named.contains(*axis)) {
                let (place, offset) = (axis.index(), total[axis.index()]);
                home[place] = self.home_of(axis, reference[place], home[place] + offset, span) - offset;
            }
            home
        } else {
            // In a turned system LinuxCNC goes along the turned axes that are named, to where these have the reference position.
            let mut machine = *reference;
            let present = self.machine_position();
            for axis in Axis::ALL.into_iter().filter(|axis| named.contains(*axis)) {
                let place = axis.index();
                machine[place] = self.home_of(axis, reference[place], present[place], span);
            }
            let reached = self.state.coords.programmed(&machine);
            let mut home = self.state.position;
            for axis in Axis::ALL.into_iter().filter(|axis| named.contains(*axis)) {
                home[axis.index()] = reached[axis.index()];
            }
            home
        };
        let held = self.state.tool_control.held;
        for axis in Axis::ALL.into_iter().filter(|axis| named.contains(*axis)) {
            self.state.tool_control.held = self.state.tool_control.held.without(axis);
        }
        if self.state.tool_control.mode == ToolMode::Plane {
            self.emit_from_plane(MoveKind::Rapid, home, named, Feed::PerMinute(0.0));
        } else {
            self.rapid(home, held);
        }
        self.state.position = home;
    }

    /// Where an axis comes to its reference position from `present`, both in machine coordinates: one that rolls over within a turn, by the
    /// shorter way; that of LinuxCNC in the positive direction.
    fn home_of(&mut self, axis: Axis, reference: f64, present: f64, span: SourceSpan) -> f64 {
        if !self.settings.coordinates.rolls_over(axis) || self.state.tool_control.held.contains(axis) {
            return reference;
        }
        if self.is_linuxcnc_dialect() {
            return reference + 360.0 * ((present - reference) / 360.0 - SAME_TURN).ceil();
        }
        match shorter_turn(present, reference) {
            Ok(home) => home,
            Err(message) => {
                let message = format!("{}{reference}, the reference position: {message}", axis.letter());
                let cure = format!("turn {} part of the way before, in the direction that it is to go", axis.letter());
                self.findings.push_with(code::ROLL_OVER, |code| {
                    Finding::new(code, span, message).with_value("present", present, "deg").suggest(cure)
                });
                reference
            }
        }
    }

    /// Rapid to `end`; `held_before` are the axes whose places only the machine knew before its words.
    fn rapid(&mut self, end: Position, held_before: AxisSet) {
        if self.state.tool_control.is_plain() {
            self.emit_move(MoveKind::Rapid, &end, None, Feed::PerMinute(0.0));
        } else if !(self.is_on_contour() && self.is_still(&end, held_before)) {
            self.emit_guided(self.guide(None), MoveKind::Rapid, end, Feed::PerMinute(0.0), GuidedPath::Straight);
        }
    }

    /// `G29`: over the intermediate point of the last `G28` or `G30` to a position.
    pub(super) fn reference_return(&mut self, span: SourceSpan) {
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        if axes == 0 {
            return self.coord(code::COORD_WORD, span, "G29 names no axis", "add the axes with the position to go to");
        }
        let refused = self.is_frame_refused(span, "the return from a reference position");
        let Some(intermediate) = self.state.coords.tables.intermediate else {
            self.used |= axes;
            return self.coord(
                code::COORD_WORD,
                span,
                "no G28 or G30 before has passed an intermediate point",
                "position with G0",
            );
        };
        if !refused && intermediate.total != self.state.coords.total {
            self.coord(
                code::COORD_AMBIGUOUS,
                span,
                "offsets have changed since the intermediate point, which some controls shift with them",
                "position with G0",
            );
        }
        let named = self.named_axes(axes);
        let held = self.state.tool_control.held;
        let mut over = self.state.position;
        for axis in Axis::ALL.into_iter().filter(|axis| named.contains(*axis) && intermediate.axes.contains(*axis)) {
            over[axis.index()] = intermediate.position[axis.index()];
        }
        self.rapid(over, held);
        self.state.position = over;
        let end = self.target(axes, Frame::Work);
        self.rapid(end, held);
        self.state.position = end;
    }

    /// `G28.1`, `G30.1`: the present machine position becomes a reference position.
    pub(super) fn store_reference(&mut self, second: bool, span: SourceSpan) {
        if self.block.letters & self.table.axis_letters & !self.used != 0 {
            self.used |= self.block.letters & self.table.axis_letters;
            let name = if second { "G30.1" } else { "G28.1" };
            let message = format!("{name} stores the present position and takes no axis words");
            return self.coord(code::COORD_WORD, span, message, "write it without axes");
        }
        let machine = self.machine_position();
        self.state.coords.tables.reference[usize::from(second)] = Some(machine);
    }

    /// `G53`: whether it is refused in this mode, which is reported.
    pub(in super::super) fn is_incremental_machine_motion(&mut self, span: SourceSpan) -> bool {
        if self.state.absolute || self.state.tool_control.mode != ToolMode::Off {
            return false;
        }
        let cure = match self.settings.dialect {
            DialectName::Lathe => "write G90 before it, where the G-code system has it",
            DialectName::Mill | DialectName::LinuxCnc => "write G90 before it",
        };
        self.used |= letter_bit(b'F');
        let message = match self.settings.dialect {
            DialectName::LinuxCnc => "G53 under G91 is an error of LinuxCNC",
            DialectName::Lathe | DialectName::Mill => "controls ignore G53 under G91",
        };
        self.coord(code::MACHINE_MOTION, span, message, cure);
        true
    }
}
