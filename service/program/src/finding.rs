//! Findings: the one type for everything the product has to say about a program, from lexer to client.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

/// How bad a finding is. A program with an [`Severity::Error`] is rejected before anything moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
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
    /// Line, counted from 1.
    pub line: u32,
    /// Byte column in the line, counted from 1.
    pub column: u32,
    /// Length in bytes; 0 marks a point between bytes.
    pub length: u32,
}

/// A number (or a name) that led to a finding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NamedValue {
    /// What the value is, `snake_case`, without the unit.
    pub name: Cow<'static, str>,
    /// The value.
    pub value: f64,
    /// Its unit, `""` for a pure number.
    pub unit: Cow<'static, str>,
}

/// What would cure a finding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Suggestion {
    /// What to do, as a sentence.
    pub message: String,
    /// Text to put in place of the finding's span, where that cures it.
    pub replacement: Option<String>,
    /// The suggested quantity, where there is one.
    pub value: Option<NamedValue>,
}

/// One thing found in a program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Stable code such as `VIB-CHIP-UNBROKEN`.
    pub code: Cow<'static, str>,
    /// How bad it is.
    pub severity: Severity,
    /// Where it is.
    #[serde(flatten)]
    pub span: SourceSpan,
    /// What is wrong, in one sentence with the numbers.
    pub message: String,
    /// The numbers as data.
    pub values: Vec<NamedValue>,
    /// Cures, best first.
    pub suggestions: Vec<Suggestion>,
}

impl Finding {
    /// A finding without values and suggestions yet.
    #[must_use]
    pub fn new(code: &'static str, severity: Severity, span: SourceSpan, message: impl Into<String>) -> Self {
        Self {
            code: Cow::Borrowed(code),
            severity,
            span,
            message: message.into(),
            values: Vec::new(),
            suggestions: Vec::new(),
        }
    }

    /// An error; see [`Finding::new`].
    #[must_use]
    pub fn error(code: &'static str, span: SourceSpan, message: impl Into<String>) -> Self {
        Self::new(code, Severity::Error, span, message)
    }

    /// A warning; see [`Finding::new`].
    #[must_use]
    pub fn warning(code: &'static str, span: SourceSpan, message: impl Into<String>) -> Self {
        Self::new(code, Severity::Warning, span, message)
    }

    /// An information; see [`Finding::new`].
    #[must_use]
    pub fn info(code: &'static str, span: SourceSpan, message: impl Into<String>) -> Self {
        Self::new(code, Severity::Info, span, message)
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

/// How far a [`FindingLog`] was filled.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FindingMark {
    kept: usize,
    dropped: u64,
    counts: [u64; 3],
}

impl FindingMark {
    /// How many findings were kept.
    pub(crate) const fn kept(self) -> usize {
        self.kept
    }

    /// How many errors had been pushed.
    pub(crate) const fn errors(self) -> u64 {
        self.counts[Severity::Error as usize]
    }
}

/// A bounded collection of findings: keeps the first ones in full and counts the rest, so that a program of
/// nothing but mistakes cannot exhaust memory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FindingLog {
    findings: Vec<Finding>,
    limit: usize,
    /// Findings counted but not kept.
    dropped: u64,
    /// How many of each severity were pushed, indexed info, warning, error.
    counts: [u64; 3],
}

impl FindingLog {
    /// Findings kept in full unless told otherwise.
    pub const DEFAULT_LIMIT: usize = 1_000;

    /// An empty log that keeps at most `limit` findings in full.
    #[must_use]
    pub const fn with_limit(limit: usize) -> Self {
        Self { findings: Vec::new(), limit, dropped: 0, counts: [0; 3] }
    }

    /// Adds a finding, or counts it when the log is full.
    pub fn push(&mut self, finding: Finding) {
        self.counts[finding.severity as usize] += 1;
        if self.findings.len() < self.limit {
            self.findings.push(finding);
        } else {
            self.dropped += 1;
        }
    }

    /// Adds a finding of this severity, built only if the log still keeps findings in full, so that a program of
    /// nothing but mistakes costs no formatting either.
    pub fn push_with(&mut self, severity: Severity, build: impl FnOnce() -> Finding) {
        if self.findings.len() < self.limit {
            let finding = build();
            debug_assert_eq!(finding.severity, severity);
            self.push(finding);
        } else {
            self.counts[severity as usize] += 1;
            self.dropped += 1;
        }
    }

    /// A mark to withdraw from.
    #[inline]
    pub(crate) const fn mark(&self) -> FindingMark {
        FindingMark { kept: self.findings.len(), dropped: self.dropped, counts: self.counts }
    }

    /// Takes back everything since the mark.
    pub(crate) fn rewind(&mut self, mark: FindingMark) {
        self.findings.truncate(mark.kept);
        (self.dropped, self.counts) = (mark.dropped, mark.counts);
    }

    /// Takes back the findings from the `from`th on that `is_void` says; those that were only counted stay counted.
    pub(crate) fn withdraw(&mut self, from: usize, is_void: impl Fn(&Finding) -> bool) {
        let mut index = 0;
        let counts = &mut self.counts;
        self.findings.retain(|finding| {
            let goes = index >= from && is_void(finding);
            index += 1;
            counts[finding.severity as usize] -= u64::from(goes);
            !goes
        });
    }

    /// The findings kept, in the order of discovery.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// How many findings of this severity were pushed, kept or not.
    #[must_use]
    pub const fn count(&self, severity: Severity) -> u64 {
        self.counts[severity as usize]
    }

    /// How many findings were counted but not kept.
    #[must_use]
    pub const fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Whether any error was pushed.
    #[must_use]
    pub const fn has_errors(&self) -> bool {
        self.count(Severity::Error) > 0
    }

    /// The findings kept, ordered by place and then by discovery.
    #[must_use]
    pub fn into_sorted(mut self) -> Vec<Finding> {
        self.findings.sort_by_key(|finding| (finding.span.line, finding.span.column));
        self.findings
    }
}

impl Default for FindingLog {
    fn default() -> Self {
        Self::with_limit(Self::DEFAULT_LIMIT)
    }
}
