//! `$` of LinuxCNC: which spindle a speed, a start or a synchronised motion is of. The machine has one, number 0; -1 is all of them.

use super::{Block, LARGEST_NUMBER};
use crate::code;
use crate::dialect::{CodeTable, FeedUnit, Group, Meaning, letter_bit};
use crate::expression::{Context, evaluate, whole_near};
use crate::interpreter::System;
use crate::lexer::Token;
use crate::{Finding, FindingLog};

impl Block {
    /// Reads the number behind `$`; where the line goes on.
    #[cold]
    pub(super) fn read_spindle_number(
        &mut self,
        line: &[u8],
        token: Token,
        table: &CodeTable,
        system: System<'_>,
        findings: &mut FindingLog,
    ) -> usize {
        let start = token.start as usize;
        let mut context = Context::new(table.expressions, &system, system.settings.angle_range);
        let read = evaluate(line, start + 1, &mut context);
        self.note(&context.notes, findings);
        let (value, end) = match read {
            Ok((value, end)) => (value.unwrap_or(0.0), end),
            Err(defect) => {
                self.fail(&defect, findings);
                return line.len();
            }
        };
        let token = Token { end: end as u32, ..token };
        (self.extent.0, self.extent.1) = (self.extent.0.min(token.start), token.end);
        if self.spindle_number.is_some() {
            self.refuse_spindle_number(token, "$ occurs twice in the block", "keep one of them", findings);
        } else if value != -1.0 && whole_near(value, LARGEST_NUMBER) != Some(0) {
            let message = "the machine has one spindle, whose number is 0";
            self.refuse_spindle_number(token, message, "write $0, or leave it out", findings);
        }
        self.spindle_number = Some((token.start, token.end, value == -1.0));
        end
    }

    /// Checks that something in the block is of a spindle, once the line has been read.
    #[cold]
    pub(super) fn check_spindle_number(&mut self, table: &CodeTable, findings: &mut FindingLog) {
        let Some((start, end, is_all)) = self.spindle_number else { return };
        let meaning = |group| self.code(group).map(|code| table.code(code.place).meaning);
        // These are of one spindle.
        let is_of_one = self.has_group(Group::SpeedMode)
            || meaning(Group::FeedUnit) == Some(Meaning::Feed(FeedUnit::PerRevolution))
            || matches!(meaning(Group::Motion), Some(Meaning::Thread | Meaning::RigidTap | Meaning::ThreadCycles))
            || self.machine_codes().iter().any(|word| matches!(word.rule.number, 19 | 51));
        let is_of_any = self.letters & letter_bit(b'S') != 0 || self.has_group(Group::Spindle);
        let (message, cure) = match is_of_one {
            _ if self.unclear => return,
            true if is_all => ("$-1, all spindles, beside what is of one spindle", "write $0, or leave it out"),
            false if !is_of_any => {
                ("$ in a block without a speed, a code of the spindle or synchronised motion", "leave it out")
            }
            _ => return,
        };
        let span = self.span_of(start, end);
        findings.push_with(code::SPINDLE_NUMBER, |code| Finding::new(code, span, message).suggest(cure));
    }

    fn refuse_spindle_number(
        &mut self,
        token: Token,
        message: &'static str,
        cure: &'static str,
        findings: &mut FindingLog,
    ) {
        self.defect(code::SPINDLE_NUMBER, token, findings, |mut finding| {
            message.clone_into(&mut finding.message);
            finding.suggest(cure)
        });
    }
}
