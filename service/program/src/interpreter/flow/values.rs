//! Values, conditions and assignments in statements.

use super::Interpreter;
use crate::expression::{self, Context, Defect, Value};
use crate::interpreter::System;
use crate::{Finding, FindingLog, Operation};

impl Interpreter {
    /// The value that starts at `at`, and where it ends; nothing after a finding.
    pub(super) fn value(&self, line: &[u8], at: usize, findings: &mut FindingLog) -> Option<(Value, usize)> {
        self.read_value(line, at, findings, expression::evaluate)
    }

    /// The condition in brackets that starts at `at`, and where it ends; nothing after a finding.
    pub(super) fn condition(&self, line: &[u8], at: usize, findings: &mut FindingLog) -> Option<(bool, usize)> {
        let at = super::line::skip_blanks(line, at);
        // A Haas control takes every value but 0 as true.
        let takes_numbers = self.settings.is_haas();
        self.read_value(line, at, findings, |line, at, context| expression::condition(line, at, takes_numbers, context))
    }

    fn read_value<T>(
        &self,
        line: &[u8],
        at: usize,
        findings: &mut FindingLog,
        read: impl FnOnce(&[u8], usize, &mut Context<'_>) -> Result<T, Box<Defect>>,
    ) -> Option<T> {
        let dialect = self.table.dialect;
        let system = System { state: &self.state, settings: &self.settings, dialect, tools: &self.tools };
        let mut context = Context::new(dialect.expressions, &system, self.settings.angle_range);
        let found = read(line, at, &mut context);
        for note in context.notes {
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
