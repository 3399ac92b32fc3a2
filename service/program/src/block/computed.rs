//! Words whose value is an expression, and assignments.

use super::{Block, Made};
use crate::dialect::{CodeTable, Letter};
use crate::expression::{
    Assignment, Context, Defect, Name, Note, Reading, Refusal, Target, Value, Variables, WHOLE_TOLERANCE, assignment,
    evaluate, nearest, nearest_increment,
};
use crate::interpreter::System;
use crate::lexer::{Token, TokenKind};
use crate::number::Number;
use crate::state::InterpreterState;
use crate::{Finding, FindingCode, FindingLog, code};

/// Assignments of one line: each value is looked for among those before it.
const MOST_ASSIGNMENTS: usize = 100;

/// The state before the line, with what the line has assigned so far.
struct Pending<'a> {
    system: System<'a>,
    made: &'a [Made],
}

impl Pending<'_> {
    fn assigned(&self, target: &Target) -> Option<Value> {
        let made = self.made.iter().rev().map(|made| &made.assignment);
        made.into_iter().find(|made| made.target == *target).map(|made| made.value)
    }
}

impl Variables for Pending<'_> {
    fn numbered(&self, number: u32) -> Result<Reading, Refusal> {
        match self.assigned(&Target::Numbered(number)) {
            Some(value) => Ok(value.into()),
            None => self.system.numbered(number),
        }
    }

    fn named(&self, name: &Name) -> Result<Option<f64>, Refusal> {
        match self.assigned(&Target::Named(*name)) {
            Some(value) => Ok(value),
            None => self.system.named(name),
        }
    }
}

/// How often the least increment of an address goes into a unit, where its values are rounded to it.
fn increments(letter: u8, meaning: Letter, inch: bool) -> Option<f64> {
    match meaning {
        Letter::Code if letter == b'G' => Some(10.0),
        Letter::Code | Letter::Speed | Letter::Tool => Some(1.0),
        Letter::Axis(axis) | Letter::Increment(axis) if axis.is_rotary() => Some(1_000.0),
        _ if meaning.is_length() => Some(if inch { 10_000.0 } else { 1_000.0 }),
        Letter::Parameter if matches!(letter, b'D' | b'H' | b'L' | b'P') => Some(1.0),
        _ => None,
    }
}

/// The code that a computed number means: it may differ by a little from one.
fn code_number(value: f64) -> f64 {
    let tenths = nearest(value * 10.0);
    // A tenth of a code may differ by ten times as much as a whole number.
    if (value * 10.0 - tenths).abs() < 10.0 * WHOLE_TOLERANCE { tenths / 10.0 } else { value }
}

/// Whether nothing is in force that a word of this letter could leave as it is.
fn is_wanted(letter: u8, state: &InterpreterState) -> bool {
    match letter {
        b'F' => state.feed == 0.0 && state.thread.lead_mm.is_none(),
        b'S' => state.rev_per_min == 0.0 && state.m_per_min == 0.0,
        _ => false,
    }
}

impl Block {
    /// Reads an assignment or a word with an expression.
    #[cold]
    pub(super) fn read_computed(
        &mut self,
        line: &[u8],
        token: Token,
        table: &CodeTable,
        system: System<'_>,
        findings: &mut FindingLog,
    ) {
        if self.has_removed(line, token) {
            self.has_failed = true;
            return;
        }
        // Taken out while the values read what was assigned before.
        let made = core::mem::take(&mut self.assignments);
        let in_sequence = table.expressions.assigns_in_sequence;
        let pending = Pending { system, made: if in_sequence { &made } else { &[] } };
        let mut context = Context::new(table.expressions, &pending, system.settings.angle_range);
        if token.kind == TokenKind::Assignment {
            let result = assignment(line, token.start as usize, &mut context).and_then(|made| {
                nothing_between(line, made.end, token.end as usize, "put expressions in brackets: #1=[#2+3]")
                    .map(|()| made)
            });
            self.note(&context.notes, findings);
            self.assignments = made;
            match result {
                Ok(assignment) if self.assignments.len() >= MOST_ASSIGNMENTS => {
                    let (start, end) = (assignment.start, assignment.end);
                    let message = format!("more than {MOST_ASSIGNMENTS} assignments in a line");
                    let defect = Defect::new(code::EXPRESSION_MALFORMED, start, end, message);
                    self.fail(&defect.cure("write them in several lines"), findings);
                }
                Ok(assignment) => self.assignments.push(self.made(assignment)),
                Err(defect) => self.fail(&defect, findings),
            }
            return;
        }
        let is_corner = token.kind == TokenKind::ComputedCorner;
        // The word itself is behind the comma.
        let word = Token { start: token.start + u32::from(is_corner), ..token };
        let result = computed(line, word, table, system, &mut context);
        self.note(&context.notes, findings);
        self.assignments = made;
        match result {
            Ok(Some(number)) if is_corner => {
                self.add_comma_word(line, Token { kind: TokenKind::Corner, number, ..token }, table, findings);
            }
            // A corner of no size is none.
            Ok(None) if is_corner => {}
            Ok(Some(number)) => self.add_word(Token { kind: TokenKind::Word, number, ..token }, table, findings),
            // A vacant value: the word is not there.
            Ok(None) if is_wanted(token.letter, system.state) => self.refuse_vacant(token, findings),
            Ok(None) => self.note_vacant(token, findings),
            Err(defect) => self.fail(&defect, findings),
        }
    }

    /// An axis word that is not there is what macros use vacant values for; another one may be missed.
    fn note_vacant(&self, token: Token, findings: &mut FindingLog) {
        if b"FGMST".contains(&token.letter) {
            let span = self.span_of(token.start, token.end);
            let letter = char::from(token.letter);
            findings.push_with(code::VACANT_WORD, |code| {
                Finding::new(
                    code,
                    span,
                    format!("the value of {letter} is vacant: the block is read as if the word were not there"),
                )
                .suggest("assign the parameter before, if the word is meant to act")
            });
        }
    }

    /// Without the word nothing of its kind is in force: what is missing then is missing because of it.
    fn refuse_vacant(&mut self, token: Token, findings: &mut FindingLog) {
        self.defect(code::VACANT_WORD_REFUSED, token, findings, |mut finding| {
            let letter = char::from(token.letter);
            finding.message = format!("the value of {letter} is vacant, and no {letter} before it is in force");
            finding.suggest("assign the parameter before")
        });
    }

    fn made(&self, assignment: Assignment) -> Made {
        Made { assignment, span: self.span_of(assignment.start as u32, assignment.end as u32) }
    }

    /// What is worth saying about an expression.
    pub(super) fn note(&self, notes: &[Note], findings: &mut FindingLog) {
        for note in notes {
            let (code, message, cure) = note.text();
            let span = self.span_of(note.start as u32, note.end as u32);
            findings.push_with(code, |code| Finding::new(code, span, message).suggest(cure));
        }
    }

    /// An expression without a value: nothing behind it can be known.
    #[cold]
    pub(super) fn fail(&mut self, defect: &Defect, findings: &mut FindingLog) {
        self.unclear = true;
        self.has_failed = true;
        self.extent.0 = self.extent.0.min(defect.start as u32);
        self.extent.1 = self.extent.1.max(defect.end as u32);
        let span = self.span_of(defect.start as u32, defect.end as u32);
        findings.push_with(defect.code, |code| {
            let mut finding = Finding::new(code, span, defect.message.clone());
            for &(name, value) in &defect.values {
                finding = finding.with_value(name, value, "");
            }
            if defect.cure.is_empty() { finding } else { finding.suggest(defect.cure.clone()) }
        });
    }

    /// Whether assignments and words share the line of a dialect that takes them in blocks of their own.
    pub(super) fn check_assignments(&mut self, table: &CodeTable, findings: &mut FindingLog) {
        if !table.expressions.assigns_in_sequence {
            return;
        }
        let label = 1 << (b'N' - b'A');
        let has_codes = self.has_codes() && !table.expressions.assigns_beside_codes;
        if let Some(made) = self.assignments.first()
            && (self.letters & !label != 0 || has_codes)
        {
            let (start, end) = (made.assignment.start, made.assignment.end);
            let defect =
                Defect::new(code::EXPRESSION_MALFORMED, start, end, "an assignment shares its block with words")
                    .cure("write it in a block of its own before them");
            self.fail(&defect, findings);
        }
    }

    /// A statement that writes to a file or a printer: it changes no path.
    #[cold]
    pub(super) fn note_output(&self, start: u32, end: u32, findings: &mut FindingLog) {
        let span = self.span_of(start, end);
        findings.push_with(code::OUTPUT, |code: FindingCode| {
            Finding::new(code, span, "this writes to a file or a printer of the control; here it does nothing")
        });
    }
}

/// Refuses what is in a token behind the value that was read, as where a dialect wants brackets around operations: nothing
/// of a value is left out in silence.
pub(super) fn nothing_between(line: &[u8], read_to: usize, end: usize, cure: &'static str) -> Result<(), Box<Defect>> {
    if line[read_to.min(end)..end].iter().all(|byte| matches!(byte, b' ' | b'\t')) {
        return Ok(());
    }
    Err(Defect::new(code::EXPRESSION_MALFORMED, read_to, end, "this cannot stand behind a value").cure(cure))
}

/// The number of a word with an expression; `None` where its value is vacant.
fn computed(
    line: &[u8],
    token: Token,
    table: &CodeTable,
    system: System<'_>,
    context: &mut Context<'_>,
) -> Result<Option<Number>, Box<Defect>> {
    let Token { letter, start, end, .. } = token;
    let (start, end) = (start as usize, end as usize);
    let meaning = table.dialect.letters[usize::from(letter - b'A')];
    if meaning == Letter::Label {
        return Err(Defect::new(code::EXPRESSION_MALFORMED, start, end, "line and program numbers cannot be computed")
            .cure("write the number itself"));
    }
    let increments = if context.rules.rounds_words { increments(letter, meaning, system.state.inch) } else { None };
    context.increments = increments.unwrap_or(1.0);
    let (value, read_to) = evaluate(line, start + 1, context)?;
    nothing_between(line, read_to, end, "put expressions in brackets: X[#1+2]")?;
    Ok(value.map(|value| {
        let value = increments.map_or(value, |increments| nearest_increment(value, increments));
        Number::computed(if meaning == Letter::Code { code_number(value) } else { value })
    }))
}
