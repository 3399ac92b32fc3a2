//! What a line does besides its words: assignments, active comments, and the end of a program that cannot go on.

use super::Interpreter;
use super::system::{self, Effect};
use crate::expression::{Assignment, Refusal};
use crate::state::Phase;
use crate::{DialectName, Finding, FindingLog, Operation, OperationKind, SourceSpan, code};

/// Comments of LinuxCNC that do something, as they begin: what they write changes no path.
const WRITING: [&str; 8] =
    ["PRINT,", "LOG,", "DEBUG,", "LOGOPEN,", "LOGAPPEND,", "LOGCLOSE", "PROBEOPEN", "PROBECLOSE"];

/// The comment that ends the program with an error.
const ABORT: &str = "ABORT,";

/// Text of a comment, without its parentheses.
fn comment_text(line: &[u8], (start, end): (u32, u32)) -> &str {
    let text = core::str::from_utf8(&line[start as usize..end as usize]).unwrap_or_default();
    text.strip_prefix('(').map_or("", |text| text.strip_suffix(')').unwrap_or(text)).trim()
}

/// Whether a text begins with a word, whatever its case.
fn begins(text: &str, word: &str) -> bool {
    text.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word))
}

impl Interpreter {
    /// Makes the assignments of the present line, and what its last comment asks for. Whether the program has ended by it.
    #[cold]
    pub(super) fn assign(&mut self, line: &[u8], operations: &mut Vec<Operation>, findings: &mut FindingLog) -> bool {
        if self.block.has_failed {
            let span = self.block.span();
            self.give_up(span, operations, findings);
            return true;
        }
        let text = comment_text(line, self.block.comment);
        let made = core::mem::take(&mut self.block.assignments);
        if !made.is_empty() {
            self.state.phase = Phase::Blocks;
        }
        let mut has_ended = false;
        for made in &made {
            let effect = self.set(&made.assignment);
            has_ended = self.take_effect(effect, made.span, text, operations, findings);
            if has_ended {
                break;
            }
        }
        self.block.assignments = made;
        has_ended || self.active_comment(line, operations, findings)
    }

    /// Makes one assignment, whose message is the last comment of the line. Whether the program has ended by it.
    pub(super) fn assign_one(
        &mut self,
        assignment: &Assignment,
        span: SourceSpan,
        line: &[u8],
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> bool {
        let start = line.iter().rposition(|&byte| byte == b'(').unwrap_or(line.len());
        let end = line.iter().rposition(|&byte| byte == b')').map_or(line.len(), |end| end + 1).max(start);
        let text = comment_text(line, (start as u32, end as u32));
        let effect = self.set(assignment);
        self.take_effect(effect, span, text, operations, findings)
    }

    fn set(&mut self, Assignment { target, value, .. }: &Assignment) -> Result<Effect, Refusal> {
        system::assign(&mut self.state, &self.settings, self.table.dialect, target, *value)
    }

    /// What an assignment does besides setting a value. Whether it has ended the program.
    fn take_effect(
        &mut self,
        effect: Result<Effect, Refusal>,
        span: SourceSpan,
        text: &str,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> bool {
        match effect {
            Ok(Effect::Set) => return false,
            Ok(Effect::Ignored) => {
                findings.push_with(code::PARAMETER_IGNORED, |code| {
                    Finding::new(
                        code,
                        span,
                        "this sets a clock, an inhibition, a counter or an output of the control; here it does nothing",
                    )
                });
                return false;
            }
            Ok(Effect::Stop) => {
                operations.push(Operation { span, kind: OperationKind::Stop { optional: false } });
                return false;
            }
            Ok(Effect::Alarm(number)) => findings.push_with(code::ALARM, |code| {
                Finding::new(code, span, format!("the program stops itself with alarm {number}: {text}"))
                    .with_value("alarm", f64::from(number), "")
                    .suggest("see what leads to this block")
            }),
            Err(Refusal { code, message, cure }) => {
                findings.push_with(code, |code| Finding::new(code, span, message).suggest(cure));
            }
        }
        self.give_up(span, operations, findings);
        true
    }

    /// The last comment of a line, which is active in LinuxCNC where it begins with certain words. Whether it ends the program.
    fn active_comment(&mut self, line: &[u8], operations: &mut Vec<Operation>, findings: &mut FindingLog) -> bool {
        if self.settings.dialect != DialectName::LinuxCnc {
            return false;
        }
        let (start, end) = self.block.comment;
        let text = comment_text(line, (start, end));
        let program = self.state.place.program;
        let span = SourceSpan { program, line: self.state.lines, column: start + 1, length: end - start };
        if begins(text, ABORT) {
            findings.push_with(code::ALARM, |code| {
                Finding::new(code, span, format!("the program aborts itself: {}", text[ABORT.len()..].trim()))
                    .suggest("see what leads to this block")
            });
            self.give_up(span, operations, findings);
            return true;
        }
        if WRITING.iter().any(|word| begins(text, word)) {
            findings.push_with(code::OUTPUT, |code| {
                Finding::new(code, span, "this writes to a file or the screen of the control; here it does nothing")
            });
        }
        false
    }
}
