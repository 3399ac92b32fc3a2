//! Values, conditions and assignments in statements.

use std::cell::Cell;

use super::Interpreter;
use crate::expression::{self, Context, Defect, Name, Reading, Refusal, Value, Variables};
use crate::interpreter::System;
use crate::{Finding, FindingLog, Operation};

/// The variables of a statement, and whether it has asked for one that the control sets: a position, a mode, an offset.
struct Watched<'a> {
    system: System<'a>,
    asked: Cell<bool>,
}

impl Variables for Watched<'_> {
    fn numbered(&self, number: u32) -> Result<Reading, Refusal> {
        self.asked.set(self.asked.get() || self.system.sets(number));
        self.system.numbered(number)
    }

    fn named(&self, name: &Name) -> Result<Option<f64>, Refusal> {
        self.asked.set(self.asked.get() || System::sets_named(name));
        self.system.named(name)
    }
}

impl Interpreter {
    /// The value that starts at `at`, and where it ends; nothing after a finding.
    pub(super) fn value(&mut self, line: &[u8], at: usize, findings: &mut FindingLog) -> Option<(Value, usize)> {
        self.read_value(line, at, findings, expression::evaluate)
    }

    /// The condition in brackets that starts at `at`, and where it ends; nothing after a finding.
    pub(super) fn condition(&mut self, line: &[u8], at: usize, findings: &mut FindingLog) -> Option<(bool, usize)> {
        let at = super::line::skip_blanks(line, at);
        self.read_value(line, at, findings, expression::condition)
    }

    fn read_value<T>(
        &mut self,
        line: &[u8],
        at: usize,
        findings: &mut FindingLog,
        read: impl FnOnce(&[u8], usize, &mut Context<'_>) -> Result<T, Box<Defect>>,
    ) -> Option<T> {
        let dialect = self.table.dialect;
        let system = System { state: &self.state, settings: &self.settings, dialect, tools: &self.tools };
        let watched = Watched { system, asked: Cell::new(false) };
        let mut context = Context::new(self.table.expressions, &watched, self.settings.angle_range);
        let found = read(line, at, &mut context);
        let notes = context.notes;
        self.state.flow.asked += u64::from(watched.asked.get());
        for note in notes {
            let span = self.span_in(line, note.start, note.end);
            let (code, message, cure) = note.text();
            findings.push_with(code, |code| Finding::new(code, span, message).suggest(cure));
        }
        match found {
            Ok(found) => Some(found),
            Err(defect) => {
                let span = self.span_in(line, defect.start, defect.end);
                findings.push_with(defect.code, |code| {
                    let mut finding = Finding::new(code, span, defect.message);
                    for (name, value) in defect.values {
                        finding = finding.with_value(name, value, "");
                    }
                    if defect.cure.is_empty() { finding } else { finding.suggest(defect.cure) }
                });
                None
            }
        }
    }

    /// Executes the assignment whose `#` is at `at`: where it ends; nothing after a finding.
    pub(super) fn assign_at(
        &mut self,
        line: &[u8],
        at: usize,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> Option<usize> {
        let made = self.read_value(line, at, findings, expression::assignment)?;
        let span = self.span_in(line, made.start, made.end);
        let has_ended = self.assign_one(&made, span, line, operations, findings);
        (!has_ended).then_some(made.end)
    }
}
