//! Findings: the one type for everything the product has to say about a program, from lexer to client.

mod code;
mod log;

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

pub use self::code::{CodeEntry, CodeTable, Example, Explanation, FindingCode};
pub use self::log::FindingLog;
pub(crate) use self::log::FindingMark;

/// How bad a finding is. A program with an [`Severity::Error`] is rejected before anything moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Severity {
    /// Worth knowing.
    Info,
    /// Runs, but probably not as wanted.
    Warning,
    /// Refused.
    Error,
}

/// A place in the program source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct SourceSpan {
    /// Which of the job's programs, 0 for the one that is run.
    #[serde(default)]
    pub program: u32,
    /// Line, counted from 1.
    pub line: u32,
    /// Byte column in the line, counted from 1.
    pub column: u32,
    /// Length in bytes; 0 marks a point between bytes.
    pub length: u32,
}

/// A number (or a name) that led to a finding.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedValue {
    /// What the value is, `snake_case`, without the unit.
    pub name: Cow<'static, str>,
    /// The value.
    pub value: f64,
    /// Its unit, `""` for a pure number.
    pub unit: Cow<'static, str>,
}

/// What would cure a finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Suggestion {
    /// What to do, as a sentence.
    pub message: String,
    /// Text to put in place of the finding's span, where that cures it.
    pub replacement: Option<String>,
    /// The suggested quantity, where there is one.
    pub value: Option<NamedValue>,
}

/// Which of several occurrences at one place, such as `pass` 3 of a cycle that is one block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Occurrence {
    /// What is counted, `snake_case`: `pass`, `line`.
    pub name: Cow<'static, str>,
    /// Its number, counted from 1.
    pub number: u64,
}

/// A place that has to do with a finding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RelatedPlace {
    /// What is there, as a short clause.
    pub message: Cow<'static, str>,
    /// Where it is.
    pub span: SourceSpan,
    /// Whether it is a call that led to the place of the finding.
    pub is_call: bool,
}

/// One thing found in a program. What is found again at the same place and for the same cause is one finding: a
/// [`FindingLog`] counts its occurrences and keeps the worst.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Stable code such as `VIB-CHIP-UNBROKEN`.
    pub code: FindingCode,
    /// How bad it is.
    pub severity: Severity,
    /// Where it is.
    pub span: SourceSpan,
    /// What is wrong, in one sentence with the numbers.
    pub message: String,
    /// The numbers as data.
    pub values: Vec<NamedValue>,
    /// Cures, best first.
    pub suggestions: Vec<Suggestion>,
    /// How often it was met; message, values and cures are those of the worst occurrence.
    pub occurrences: u64,
    /// The first occurrence, where the place alone does not tell it.
    pub first: Option<Occurrence>,
    /// The worst occurrence, likewise.
    pub worst: Option<Occurrence>,
    /// Other places that have to do with it: what it disagrees with, then the calls that led there, innermost first.
    pub related: Vec<RelatedPlace>,
    /// What distinguishes occurrences of one finding from other findings, and ranks them.
    rank: Option<Rank>,
}

/// See [`Finding::ranked`].
#[derive(Clone, Debug, PartialEq)]
struct Rank {
    about: Cow<'static, str>,
    excess: f64,
    /// The same thing at another place is the same finding.
    everywhere: bool,
}

impl Finding {
    /// A finding of this code and its severity, without values and suggestions yet.
    #[must_use]
    pub fn new(code: FindingCode, span: SourceSpan, message: impl Into<String>) -> Self {
        Self {
            code,
            severity: code.severity(),
            span,
            message: message.into(),
            values: Vec::new(),
            suggestions: Vec::new(),
            occurrences: 1,
            first: None,
            worst: None,
            related: Vec::new(),
            rank: None,
        }
    }

    /// Says that the finding may come again with other numbers: in a [`FindingLog`] findings of one code, severity and place
    /// that are about the same thing (an axis, a direction; `""` where the code says it all) are one, and the occurrence with
    /// the largest `excess` is kept. Without this, findings are one where their messages are equal.
    #[must_use]
    pub fn ranked(mut self, about: impl Into<Cow<'static, str>>, excess: f64) -> Self {
        self.rank = Some(Rank { about: about.into(), excess, everywhere: false });
        self
    }

    /// Says that the finding has one cause for the whole program, such as something that the machine does not have: in a
    /// [`FindingLog`] findings of one code and severity about the same thing are one, wherever they are, at the place of the first.
    #[must_use]
    pub fn everywhere(mut self, about: impl Into<Cow<'static, str>>) -> Self {
        self.rank = Some(Rank { about: about.into(), excess: 0.0, everywhere: true });
        self
    }

    /// Says which occurrence this is where the place alone does not tell it, and adds its number to the values.
    #[must_use]
    pub fn at(mut self, name: &'static str, number: u64) -> Self {
        let occurrence = Occurrence { name: name.into(), number };
        (self.first, self.worst) = (Some(occurrence.clone()), Some(occurrence));
        self.with_value(name, number as f64, "")
    }

    /// Names another place that has to do with the finding; nothing where that is not known (line 0).
    #[must_use]
    pub fn related_to(mut self, message: impl Into<Cow<'static, str>>, span: SourceSpan) -> Self {
        if span.line > 0 {
            self.related.push(RelatedPlace { message: message.into(), span, is_call: false });
        }
        self
    }

    /// Says that it was met in a program that is executed more than once: behind these calls, innermost first, and in this round
    /// of the innermost loop. Occurrences at one place are then one finding, whatever the values of variables are.
    pub(crate) fn met_within(&mut self, calls: impl Iterator<Item = SourceSpan>, round: Option<u64>) {
        self.called_from(calls);
        if self.rank.is_none() {
            let about = self.message.split(|letter: char| letter.is_ascii_digit() || "+-.e".contains(letter));
            let about: String = about.filter(|part| !part.is_empty()).collect();
            self.rank = Some(Rank { about: about.into(), excess: 0.0, everywhere: false });
        }
        if let (Some(number), None) = (round, &self.first) {
            let occurrence = Occurrence { name: "iteration".into(), number };
            (self.first, self.worst) = (Some(occurrence.clone()), Some(occurrence));
        }
    }

    /// Whether another finding says it too, and no less: of one code, line and thing, with no smaller excess ([`Finding::ranked`]) and
    /// no fewer occurrences.
    #[must_use]
    pub fn is_within(&self, other: &Self) -> bool {
        // Two ways to compute the same excess may differ by rounding.
        const ROUNDING: f64 = 1e-9;
        let is_no_worse = match (&self.rank, &other.rank) {
            (Some(one), Some(other)) => {
                one.about == other.about && one.excess <= other.excess + ROUNDING * other.excess.abs().max(1.0)
            }
            (None, None) => true,
            _ => false,
        };
        (self.code, self.span.line) == (other.code, other.span.line)
            && self.occurrences <= other.occurrences
            && is_no_worse
    }

    /// Whether it is the same occurrence, whatever was counted since.
    fn is_same_occurrence(&self, other: &Self) -> bool {
        (self.code, self.severity, self.span) == (other.code, other.severity, other.span)
            && self.message == other.message
            && self.suggestions == other.suggestions
    }

    /// Says `now` instead, where this occurrence is told; what was counted stays.
    pub fn retell(&mut self, told: &Self, now: &Self) {
        if self.is_same_occurrence(told) {
            let (first, related) = (self.first.take(), core::mem::take(&mut self.related));
            *self = Self { first, related, occurrences: self.occurrences, ..now.clone() };
        }
    }

    /// Takes the text to write from every cure: something else depends on the word as well.
    pub fn replace_nothing(&mut self) {
        self.suggestions.iter_mut().for_each(|suggestion| suggestion.replacement = None);
    }

    /// Names the calls that led to its place, innermost first; its place itself may be one.
    pub(crate) fn called_from(&mut self, calls: impl Iterator<Item = SourceSpan>) {
        let place = self.span;
        let call = |span| RelatedPlace { message: "called from here".into(), span, is_call: true };
        self.related.extend(calls.filter(|call| *call != place).map(call));
    }

    /// Adds a number that led to the finding.
    #[must_use]
    pub fn with_value(mut self, name: &'static str, value: f64, unit: &'static str) -> Self {
        self.values.push(NamedValue { name: name.into(), value, unit: unit.into() });
        self
    }

    /// Adds a cure in words.
    #[must_use]
    pub fn suggest(mut self, message: impl Into<String>) -> Self {
        self.suggestions.push(Suggestion { message: message.into(), replacement: None, value: None });
        self
    }

    /// Adds a cure that replaces the finding's span.
    #[must_use]
    pub fn suggest_replacement(mut self, message: impl Into<String>, replacement: impl Into<String>) -> Self {
        let replacement = Some(replacement.into());
        self.suggestions.push(Suggestion { message: message.into(), replacement, value: None });
        self
    }

    /// Adds a cure with its quantity and, where it replaces the finding's span, the new text.
    #[must_use]
    pub fn suggest_value(
        mut self,
        message: impl Into<String>,
        replacement: Option<String>,
        name: &'static str,
        value: f64,
        unit: &'static str,
    ) -> Self {
        let value = Some(NamedValue { name: name.into(), value, unit: unit.into() });
        self.suggestions.push(Suggestion { message: message.into(), replacement, value });
        self
    }
}
