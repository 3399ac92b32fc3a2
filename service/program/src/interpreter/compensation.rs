//! Compensation of tool radius and nose as it is programmed: `G40`, `G41`, `G42`, in LinuxCNC `G41.1` and `G42.1` as well.

mod tilted;

use std::borrow::Cow;

use super::execute::Execution;
use crate::code;
use crate::dialect::{Group, Meaning, letter_bit};
use crate::state::{CompensationOn, Motion, ToolMode};
use crate::{
    CompensationCommand, CompensationMode, CompensationRules, DialectName, Finding, OperationKind, Plane, Position,
    SourceSpan,
};

/// From the centre of the nose to the reference point, in radii along X and Z, by FANUC's number of the tip.
const TIPS: [[f64; 2]; 10] = [
    [0.0, 0.0],
    [1.0, 1.0],
    [1.0, -1.0],
    [-1.0, -1.0],
    [-1.0, 1.0],
    [0.0, 1.0],
    [1.0, 0.0],
    [0.0, -1.0],
    [-1.0, 0.0],
    [0.0, 0.0],
];

/// FANUC's number of the tip by LinuxCNC's orientation, which is mirrored in X.
pub(super) const TIP_OF_ORIENTATION: [u8; 10] = [0, 4, 3, 2, 1, 5, 8, 7, 6, 9];

/// Radius and tip of a tool.
pub(super) struct Nose {
    pub(super) radius_mm: f64,
    tip: u8,
    /// L said where the tip is.
    is_said: bool,
}

impl Execution<'_> {
    /// Switches the compensation.
    pub(super) fn compensation(&mut self) {
        match self.code(Group::CutterCompensation) {
            Some((Meaning::CompensationOff, span)) if self.state.compensation.on.is_some() => {
                self.state.compensation.on = None;
                self.emit(span, OperationKind::Compensation(CompensationCommand::Off));
            }
            Some((Meaning::Compensation { left, by_words }, span)) => self.compensation_on(left, by_words, span),
            _ => {}
        }
    }

    /// I, J or K beside `G40`, which no other code of the block has taken: FANUC controls leave towards the wall that they show,
    /// which is not carried out.
    pub(super) fn takes_wall(&mut self, unused: u32) -> u32 {
        let wall = unused & (letter_bit(b'I') | letter_bit(b'J') | letter_bit(b'K'));
        let Some((Meaning::CompensationOff, span)) = self.code(Group::CutterCompensation) else { return 0 };
        if wall == 0 || self.is_linuxcnc_dialect() {
            return 0;
        }
        self.findings.push_with(code::COMP_BLOCK, |code| {
            let message =
                "G40 with I, J or K leaves the contour towards the wall that they show, which is not carried out";
            Finding::new(code, span, message).suggest(
                "leave these words out: the tool then leaves square to the last cut; see that it clears the work",
            )
        });
        wall
    }

    /// Whether a straight move to `end` moves anything. Behind `G40` one to the present programmed point does: from beside it.
    #[inline]
    pub(super) fn is_move(&self, end: &Position) -> bool {
        *end != self.state.position || !self.state.compensator.is_off() && self.comes_to_the_path()
    }

    /// LinuxCNC moves in the plane with a word of any axis, FANUC controls with one of the plane.
    fn comes_to_the_path(&self) -> bool {
        self.left_plane().is_some_and(|plane| self.table.dialect.is_linuxcnc || self.names_axis_of(plane))
    }

    /// The plane of a contour beside which the tool still stands, behind `G40`.
    fn left_plane(&self) -> Option<Plane> {
        // The moves of a contour that is only read are not those of the tool.
        let is_read = self.state.flow.contour.as_ref().is_some_and(|run| !run.is_finish());
        if self.state.compensation.on.is_some() || is_read {
            return None;
        }
        self.state.compensator.plane()
    }

    fn names_axis_of(&self, plane: Plane) -> bool {
        let (first, second) = plane.axes();
        (self.letters_of(first) | self.letters_of(second)) & self.block.letters != 0
    }

    /// Tells the stage, before a straight move to `end`, that its words name the present point in the plane.
    pub(super) fn name_exit(&mut self, end: &Position) {
        let Some(plane) = self.left_plane() else { return };
        let (first, second) = plane.axes();
        let rests = [first, second].into_iter().all(|axis| end[axis.index()] == self.state.position[axis.index()]);
        if rests && self.names_axis_of(plane) {
            self.emit(self.block.span(), OperationKind::Compensation(CompensationCommand::Exit));
        }
    }

    fn compensation_on(&mut self, left: bool, by_words: bool, span: SourceSpan) {
        let plane = self.state.plane;
        let nose = if by_words { self.nose_of_words(span) } else { self.nose_of_offset(span) };
        let Some(Nose { radius_mm, tip, is_said }) = nose else { return };
        let is_linuxcnc = self.settings.dialect == DialectName::LinuxCnc;
        let [x, z] = TIPS.get(usize::from(tip)).copied().unwrap_or_default();
        let is_nose = [x, z] != [0.0; 2];
        let wrong_plane = match plane {
            Plane::Zx => None,
            _ if is_nose || is_said => Some("a turning tool is compensated in G18 only"),
            Plane::Yz if is_linuxcnc => Some("the radius is compensated in G17 and G18 only"),
            Plane::Xy | Plane::Yz => None,
        };
        if let Some(message) = wrong_plane {
            return self.findings.push_with(code::COMP_PLANE, |code| {
                Finding::new(code, span, message).suggest("select the plane before it")
            });
        }
        if !self.state.tool_control.is_plain() && self.is_contour_refused(span) {
            return;
        }
        if self.state.coords.transform.as_ref().is_some_and(|transform| !transform.keeps_circles(plane)) {
            let message = "circles of this plane would not stay circles";
            return self.coord(
                code::COORD_SHAPE,
                span,
                message,
                "scale both axes of the plane alike, in the plane of the rotation",
            );
        }
        let code_left = left;
        let is_mirrored = self.state.coords.transform.as_ref().is_some_and(|transform| transform.swaps_sides(plane));
        // A negative radius is that of a tool smaller than the one that the path was made for.
        let left = (left == (radius_mm >= 0.0)) != is_mirrored;
        let radius_mm = radius_mm.abs();
        let reference_mm = if plane == Plane::Zx { [z * radius_mm, x * radius_mm] } else { [0.0; 2] };
        if let Some(on) = self.state.compensation.on {
            // FANUC posts repeat the code.
            let is_same = on.mode.left == left && on.mode.radius_mm == radius_mm && !is_linuxcnc;
            if !is_same {
                self.compensation_nested(on, span);
            }
            return;
        }
        if radius_mm == 0.0 {
            self.findings.push_with(code::COMP_RADIUS_ZERO, |code| {
                Finding::new(code, span, "the radius is zero, so that nothing is compensated")
                    .suggest("write the number of the tool's offset, unless the program has the path of its centre")
            });
        }
        let rules = match self.settings.compensation {
            _ if is_linuxcnc => CompensationRules::LinuxCnc,
            settings => CompensationRules::Fanuc { entry: settings.entry, corner: settings.corner },
        };
        let tilted = self.state.tool_control.mode == ToolMode::Plane;
        let mode = CompensationMode { left, plane, tilted, radius_mm, reference_mm, rules };
        self.state.compensation.on = Some(CompensationOn { line: span.line, left: code_left, mode });
        self.emit(span, OperationKind::Compensation(CompensationCommand::On(mode)));
    }

    /// `D` as the diameter and `L` as the orientation of a turning tool (LinuxCNC).
    fn nose_of_words(&mut self, span: SourceSpan) -> Option<Nose> {
        let (diameter, orientation) = (self.take(b'D'), self.take(b'L'));
        let Some(diameter) = diameter else {
            self.findings.push_with(code::COMP_NUMBER, |code| {
                Finding::new(code, span, "the diameter D of the tool is missing").suggest("add D with the diameter")
            });
            return None;
        };
        let radius_mm = self.scaled(&diameter, true) * 0.5;
        let Some(word) = orientation else {
            return Some(Nose { radius_mm, tip: 0, is_said: false });
        };
        let number = self.whole(&word)?;
        let tip = TIP_OF_ORIENTATION.get(number as usize).copied();
        if tip.is_none() {
            let span = self.block.word_span(&word);
            self.findings.push_with(code::COMP_TIP, |code| {
                Finding::new(code, span, format!("L{number} is no orientation of a turning tool, which is 0 to 9"))
                    .with_value("orientation", f64::from(number), "")
                    .suggest("write where the nose is, such as L2 for turning toward the chuck outside")
            });
        }
        Some(Nose { radius_mm, tip: tip?, is_said: true })
    }

    /// The radius of a tool offset: by `D` on mills, by the offset of the `T` word on lathes, by the tool in LinuxCNC.
    pub(super) fn nose_of_offset(&mut self, span: SourceSpan) -> Option<Nose> {
        let word = match self.settings.dialect {
            DialectName::Lathe => None,
            DialectName::Mill | DialectName::LinuxCnc => self.take(b'D'),
        };
        let number = match (self.settings.dialect, word) {
            (_, Some(word)) => {
                let number = self.whole(&word)?;
                if self.settings.dialect == DialectName::Mill {
                    self.state.compensation.number = Some(number);
                }
                // The row 0 of LinuxCNC's table is the spindle.
                Some(if number == 0 && self.is_linuxcnc_dialect() { self.state.tool } else { number })
            }
            (DialectName::Mill | DialectName::Lathe, None) => self.state.compensation.number,
            (DialectName::LinuxCnc, None) => Some(self.state.tool),
        };
        let span = word.map_or(span, |word| self.block.word_span(&word));
        let Some(number) = number else {
            let (message, cure): (_, Cow<'_, str>) = match self.settings.dialect {
                DialectName::Lathe => {
                    ("no T word has named a tool offset", "call the tool with its offset, such as T0101".into())
                }
                _ => {
                    let message = "no D has named a tool offset: a control takes the number that the program before has left, or \
                                   D0, which compensates nothing";
                    let cure = match self.state.tool {
                        0 => "add D with the number of the offset, such as D1".into(),
                        tool => {
                            format!("add D with the number of the offset, such as D{tool} of the tool in the spindle")
                                .into()
                        }
                    };
                    (message, cure)
                }
            };
            self.findings.push_with(code::COMP_NUMBER, |code| Finding::new(code, span, message).suggest(cure));
            return None;
        };
        if number == 0 {
            return Some(Nose { radius_mm: 0.0, tip: 0, is_said: false });
        }
        let geometry = match self.settings.dialect {
            DialectName::Lathe => self.geometry_number(self.state.tool, number),
            DialectName::Mill | DialectName::LinuxCnc => number,
        };
        let nose = self.nose_by_number(geometry, number);
        if nose.is_none() {
            self.findings.push_with(code::COMP_NUMBER, |code| {
                let message = format!("no tool offset {geometry} with a radius is known");
                Finding::new(code, span, message)
                    .with_value("offset", f64::from(geometry), "")
                    .suggest("give the tool its radius, and the job the tool")
            });
        }
        nose
    }

    /// `D` without `G41` and `G42`: FANUC and Haas mills keep the number for the next of them, as posts write it beside the tool's
    /// length. Refused where it would change the radius of the contour that is on; `false` beside `G96`, where other controls read a
    /// speed.
    #[cold]
    pub(super) fn takes_offset_number(&mut self) -> bool {
        let Some(word) = self.block.word(b'D').copied() else { return false };
        if self.settings.dialect != DialectName::Mill || self.code(Group::SpeedMode).is_some() {
            return false;
        }
        let Some(number) = self.whole(&word) else { return true };
        match self.state.compensation.on {
            Some(on) if self.state.compensation.number != Some(number) => {
                let span = self.block.word_span(&word);
                self.compensation_refused(span, &format!("another offset, D{number},"), on.line);
            }
            _ => self.state.compensation.number = Some(number),
        }
        true
    }

    /// Radius and tip of the geometry in this row of tool offsets, if it has a radius, with the wear of row `wear`.
    fn nose_by_number(&self, number: u32, wear: u32) -> Option<Nose> {
        let geometry = self.tool_row(number)?;
        let wear_mm = self.tool_row(wear).map_or(0.0, |row| row.radius_wear_mm);
        Some(Nose { radius_mm: geometry.radius_mm? + wear_mm, tip: geometry.tip, is_said: false })
    }

    /// Reports codes that contradict the compensation, before they change anything.
    pub(super) fn check_compensated_block(&mut self) {
        let was_on = self.state.compensation.on.is_some();
        let switch = self.code(Group::CutterCompensation).map(|(meaning, _)| meaning);
        if !was_on && switch.is_none() {
            return;
        }
        let is_linuxcnc = self.settings.dialect == DialectName::LinuxCnc;
        let starts = matches!(switch, Some(Meaning::Compensation { .. }));
        let ends = switch == Some(Meaning::CompensationOff);
        // Plane, tool and overrides come before the compensation in a block, everything else behind it.
        let is_on = was_on && !ends || starts && is_linuxcnc;
        let on_line = self.state.compensation.on.map(|on| on.line);
        for group in CHECKED {
            let Some((meaning, span)) = self.code(group) else { continue };
            let comes_before = matches!(group, Group::Plane | Group::ToolChange | Group::Overrides);
            let is_on = if comes_before { was_on } else { is_on };
            if is_on && self.is_refused_on_contour(group, meaning, is_linuxcnc) {
                let what = self.block.code(group).map(|code| self.table.name(group, code.place)).unwrap_or_default();
                self.compensation_refused(span, &what, on_line.unwrap_or(span.line));
            }
        }
        if let Some(on) = self.state.compensation.on.filter(|_| !is_linuxcnc) {
            self.note_compensated_return(on);
        }
        for word in self.block.machine_codes().iter().filter(|_| is_linuxcnc && was_on) {
            let number = word.rule.number;
            if matches!(number, 48..=53 | 62..=68 | 72) {
                self.compensation_refused(word.span, &format!("M{number}"), on_line.unwrap_or(word.span.line));
            }
        }
    }

    /// `M99` of a subprogram on a contour, which goes on in the caller.
    fn note_compensated_return(&mut self, on: CompensationOn) {
        let Some((Meaning::Return, span)) = self.code(Group::Subprogram) else { return };
        if self.state.flow.calls.is_empty() {
            return;
        }
        self.findings.push_with(code::COMP_RETURN, |code| {
            let message = format!(
                "M99 with the radius compensation on, since line {}: the contour goes on in the caller",
                on.line
            );
            Finding::new(code, span, message)
                .with_value("on_line", f64::from(on.line), "")
                .suggest("write G40 and a straight move before M99 where the control stops here")
        });
    }

    /// Reports a lathe's `T` on a contour, before it changes the tool. On the way from it the offset may go out of force, as towards where
    /// tools are changed (`G40 G0 X200. Z100. T0100`).
    pub(super) fn check_compensated_tool(&mut self, number: u32, offset: u32, span: SourceSpan) {
        let Some(on) = self.state.compensation.on else { return };
        let leaves = self.code(Group::CutterCompensation).is_some_and(|(it, _)| it == Meaning::CompensationOff);
        if !(leaves && (number, offset) == (self.state.tool, 0)) {
            self.compensation_refused(span, "a tool change", on.line);
        }
    }

    fn is_refused_on_contour(&self, group: Group, meaning: Meaning, is_linuxcnc: bool) -> bool {
        match (group, meaning) {
            // They have their own finding.
            (_, Meaning::Unsupported(_) | Meaning::VariableLead | Meaning::AlignTool { .. }) => false,
            _ if self.is_refused_in_plane(meaning) => false,
            (Group::Plane, Meaning::Plane(plane)) => plane != self.state.plane,
            (Group::ToolChange, meaning) => meaning == Meaning::ToolChange,
            (Group::WorkOffset, Meaning::WorkOffset(system)) => is_linuxcnc || system != self.state.coords.system,
            (Group::WorkOffset, _) => true,
            (Group::LengthCompensation, Meaning::ToolControl { .. }) => true,
            (Group::LengthCompensation | Group::PathControl | Group::CycleReturn | Group::Overrides, _) => is_linuxcnc,
            (
                Group::NonModal,
                Meaning::Dwell
                | Meaning::ExactStop
                | Meaning::AlreadySo
                | Meaning::LookAhead
                | Meaning::Smoothness
                | Meaning::BlockLimit,
            ) => false,
            // With axes it sets the coordinates, or cuts a thread.
            (Group::NonModal, Meaning::SpeedClamp | Meaning::SpeedClampOrThreadCycle) => {
                self.block.letters & self.table.axis_letters & !letter_bit(b'S') != 0
            }
            (Group::NonModal, _) => true,
            // Contour control of FANUC (G5.1 Q1, G5 P10000) moves nothing.
            (Group::Motion, Meaning::CubicSpline | Meaning::QuadraticSpline)
                if !is_linuxcnc && self.block.letters & self.table.axis_letters == 0 =>
            {
                false
            }
            // LinuxCNC compensates the contour while it reads it, and goes astray.
            (Group::Motion, Meaning::Turning(cycle)) => is_linuxcnc || !cycle.has_contour(),
            (Group::Motion, meaning) => !matches!(meaning, Meaning::Rapid | Meaning::Linear | Meaning::Arc { .. }),
            _ => false,
        }
    }

    /// Refuses a cycle on a contour, whose further blocks are followed silently; whether there is one. Its code has been reported
    /// where it stands in this block.
    pub(super) fn is_cycle_on_contour(&mut self, what: &'static str) -> bool {
        let Some(on) = self.state.compensation.on else { return false };
        let span = self.block.span();
        // FANUC controls switch on in the order of the block, behind the check of its codes.
        let starts_here = on.line == span.line && self.settings.dialect != DialectName::LinuxCnc;
        if self.code(Group::Motion).is_none() || starts_here {
            self.compensation_refused(span, what, on.line);
        }
        self.state.motion = Motion::Unclear;
        true
    }

    #[cold]
    pub(super) fn compensation_refused(&mut self, span: SourceSpan, what: &str, on_line: u32) {
        self.findings.push_with(code::COMP_BLOCK, |code| {
            let message = format!("{what} with the radius compensation on, since line {on_line}");
            Finding::new(code, span, message)
                .with_value("on_line", f64::from(on_line), "")
                .suggest("leave the contour with G40 and a straight move first")
        });
    }

    /// `M72` or a return to modes with the compensation on.
    pub(super) fn compensation_restored(&mut self, span: SourceSpan) {
        self.findings.push_with(code::COMP_BLOCK, |code| {
            let message = "the saved modes have the radius compensation on, whose contour is not that of this place";
            Finding::new(code, span, message)
                .suggest("save the modes with the compensation off, and write G41 or G42 here")
        });
    }

    #[cold]
    fn compensation_nested(&mut self, on: CompensationOn, span: SourceSpan) {
        self.findings.push_with(code::COMP_NESTED, |code| {
            let message = format!("the radius compensation is on already, since line {}", on.line);
            Finding::new(code, span, message)
                .with_value("on_line", f64::from(on.line), "")
                .suggest("leave the contour with G40 and a straight move first")
        });
    }
}

/// The groups that hold what a compensated contour does not permit.
const CHECKED: [Group; 9] = [
    Group::Plane,
    Group::ToolChange,
    Group::Overrides,
    Group::WorkOffset,
    Group::LengthCompensation,
    Group::PathControl,
    Group::CycleReturn,
    Group::NonModal,
    Group::Motion,
];
