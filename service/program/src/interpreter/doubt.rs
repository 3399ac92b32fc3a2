//! Codes that controls read differently where axis words follow them: the turning, facing and threading cycles of one
//! G-code system are modes of another. A wrong guess would be a rapid into the bar, so nothing moves on one.

use super::execute::Execution;
use super::motion::Frame;
use crate::code;
use crate::dialect::{Group, Meaning, OtherReading, letter_bit};
use crate::state::Motion;
use crate::{Finding, GCodeSystem, SourceSpan};

/// A code of the present block that may be something else.
#[derive(Clone, Copy)]
pub(super) struct Doubt {
    span: SourceSpan,
    tenths: u32,
    reading: &'static OtherReading,
}

impl Doubt {
    /// Whether the code ends the motion mode in force.
    pub(super) const fn stays(self) -> bool {
        self.reading.stays
    }
}

/// Groups whose codes may have another reading.
const GROUPS: [Group; 4] = [Group::Distance, Group::FeedUnit, Group::Units, Group::Cycle];

/// What settles every doubt about the G-code system.
pub(super) const SYSTEM_CURE: &str = "set language.g_code_system of the machine profile to the system of the control: \
     G_CODE_SYSTEM_A, G_CODE_SYSTEM_B or G_CODE_SYSTEM_C";

/// Words that a threading cycle has and no setting of coordinates.
const THREAD_LETTERS: u32 = letter_bit(b'F') | letter_bit(b'E') | letter_bit(b'Q') | letter_bit(b'R');

impl Execution<'_> {
    /// The code of this block, if there is one, whose other reading neither a motion code nor the program before rules out.
    pub(super) fn doubt(&mut self) -> Option<Doubt> {
        self.show_system();
        let meaning = |group| self.code(group).map(|(meaning, _)| meaning);
        // In system C the units have other codes, and G50 sets no speed.
        let has_axes = self.block.letters & self.table.axis_letters != 0;
        let not_c = matches!(meaning(Group::Units), Some(Meaning::Units { .. })) && !has_axes
            || self.code_number(Group::NonModal) == Some(500);
        self.state.not_system_c |= not_c;
        GROUPS.into_iter().find_map(|group| {
            let word = self.block.code(group)?;
            let code = self.table.code(word.place);
            let reading = code.other_reading.filter(|reading| !(reading.of_system_a && self.state.not_system_a))?;
            let span = self.block.code_span(word);
            let motion = self.block.code(Group::Motion).map(|motion| self.block.code_span(motion).column);
            let settled = motion.is_some_and(|column| !reading.is_motion || column > span.column);
            (!settled).then_some(Doubt { span, tenths: code.tenths, reading })
        })
    }

    /// The number of a group's code, tenths.
    pub(super) fn code_number(&self, group: Group) -> Option<u32> {
        self.block.code(group).map(|word| self.table.code(word.place).tenths)
    }

    /// Refuses the axis words of a block with a doubtful code; `true` where nothing of the block is left to move.
    pub(super) fn is_doubtful_motion(&mut self, doubt: Doubt) -> bool {
        let Doubt { span, tenths, reading } = doubt;
        let one_block = self.code(Group::NonModal).map(|(meaning, _)| meaning);
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        let claimed = matches!(
            one_block,
            Some(Meaning::Dwell | Meaning::SpeedClamp | Meaning::Reference | Meaning::AlignTool { .. })
        );
        if claimed || axes == 0 {
            if reading.stays {
                self.state.motion = Motion::Doubtful { tenths, line: span.line };
            }
            return claimed || reading.stays;
        }
        self.used = u32::MAX;
        self.state.position = self.target(axes, Frame::Work);
        self.state.motion = Motion::Unclear;
        if self.block.unclear {
            return true;
        }
        let name = format!("G{}", f64::from(tenths) / 10.0);
        self.findings.push_with(code::CODE_AMBIGUOUS, |code| {
            let OtherReading { here, elsewhere, is_motion, .. } = reading;
            let message = format!("{name} with axis words is {here} on some controls and {elsewhere} on others");
            let finding = Finding::new(code, span, message);
            if !is_motion {
                return finding
                    .suggest(format!("write {name} in a block of its own, and the motion code with the axis words"));
            }
            // Without the unit every length would be another one.
            let otherwise = match reading.of_system_a {
                true => format!("leave {name} out in G-code system A"),
                false => format!("write {name} in a block of its own before this one"),
            };
            let finding = finding
                .suggest(format!("for a move, write its motion code behind {name}, such as {name} G1, or {otherwise}"));
            finding.suggest("for a cycle, write its passes with G0 and G1 (or a thread with G32)").suggest(SYSTEM_CURE)
        });
        true
    }

    /// Axis words behind a doubtful code in a block before.
    #[cold]
    pub(super) fn doubtful_before(&mut self, tenths: u32, line: u32) {
        self.state.motion = Motion::Unclear;
        let span = self.block.span();
        self.findings.push_with(code::CODE_AMBIGUOUS, |code| {
            let name = format!("G{}", f64::from(tenths) / 10.0);
            let system = self.settings.g_code_system;
            let of = system.map_or("G-code system A", |_| "this G-code system");
            let message =
                format!("axis words without a motion code after the {name} of line {line}, which is a cycle in {of}");
            let finding = Finding::new(code, span, message)
                .with_value("line", f64::from(line), "")
                .suggest("for a move, write its motion code, such as G0 or G1, in this block");
            match system {
                Some(_) => finding.suggest(format!("for the cycle, write {name} in this block")),
                None => finding.suggest("for a cycle, write its passes with G0 and G1").suggest(SYSTEM_CURE),
            }
        });
    }

    /// Whether a lathe's `G92` with axis words may be the setting of coordinates, which is then reported.
    pub(super) fn is_doubtful_thread(&mut self, span: SourceSpan) -> bool {
        let is_thread = self.state.motion == Motion::ThreadCycle || self.block.letters & THREAD_LETTERS != 0;
        if is_thread && !self.state.not_system_a || self.settings.g_code_system == Some(GCodeSystem::A) {
            self.show_by_code(true, Group::NonModal);
            return false;
        }
        self.used = u32::MAX;
        self.state.motion = Motion::Unclear;
        self.findings.push_with(code::CODE_AMBIGUOUS, |code| {
            let message =
                "G92 with axis words is a threading cycle in G-code system A, and sets the coordinates in B and C";
            Finding::new(code, span, message)
                .suggest("for a thread, write its lead F in this block, such as F1.5")
                .suggest("for other coordinates, use a work offset, G54 to G59")
                .suggest(SYSTEM_CURE)
        });
        true
    }
}
