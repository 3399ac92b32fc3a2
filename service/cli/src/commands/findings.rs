//! Findings under their source lines.

use std::fmt;

use feedwave_contract::proto::{Finding, Occurrence, Severity};
use miette::{
    Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteError, MietteSpanContents, SourceCode,
    SourceSpan, SpanContents,
};

use super::CliError;
use super::source::{Place, Snippet, Source};
use super::terminal::Style;

/// Columns of the text.
const WIDTH: usize = 100;

/// Every finding with its source line, in the order of the source.
pub(super) fn text(findings: &[Finding], source: &mut Source, style: Style) -> Result<String, CliError> {
    let places: Vec<Place> = findings
        .iter()
        .map(|finding| Place { line: finding.line, column: finding.column, length: finding.length })
        .collect();
    let snippets = source.snippets(&places)?;
    let theme = if style.is_coloured() { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let handler = GraphicalReportHandler::new_themed(theme).with_width(WIDTH).with_links(false).with_break_words(false);
    let mut text = String::new();
    for (finding, snippet) in findings.iter().zip(snippets) {
        let located = snippet.map(|snippet| Located::new(finding, snippet, &source.name));
        let shown = Shown { finding, help: help(finding), located };
        handler.render_report(&mut text, &shown).map_err(CliError::trouble)?;
        text.push('\n');
    }
    Ok(text)
}

fn help(finding: &Finding) -> Option<String> {
    let cures = finding.suggestions.iter().map(|suggestion| match &suggestion.replacement {
        Some(replacement) => format!("{}: write `{replacement}`", suggestion.message),
        None => suggestion.message.clone(),
    });
    let cures: Vec<_> = cures.collect();
    (!cures.is_empty()).then(|| cures.join("\n"))
}

/// A finding as the renderer wants it.
#[derive(Debug)]
struct Shown<'a> {
    finding: &'a Finding,
    help: Option<String>,
    located: Option<Located<'a>>,
}

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.finding.message)?;
        f.write_str(&repetition(self.finding))
    }
}

/// How often it was met, and where first and worst, for a finding that was met more than once.
fn repetition(finding: &Finding) -> String {
    let Finding { occurrences, first, worst, .. } = finding;
    if *occurrences < 2 {
        return String::new();
    }
    let at = |what: &str, occurrence: &Option<Occurrence>| {
        let told = occurrence.as_ref().map(|Occurrence { name, number }| format!(", {what} in {name} {number}"));
        told.unwrap_or_default()
    };
    format!(" ({occurrences} times{}{})", at("first", first), at("worst", worst))
}

impl std::error::Error for Shown<'_> {}

impl Diagnostic for Shown<'_> {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(&self.finding.code))
    }

    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.finding.severity() {
            Severity::Error | Severity::Unspecified => miette::Severity::Error,
            Severity::Warning => miette::Severity::Warning,
            Severity::Info => miette::Severity::Advice,
        })
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.located.as_ref().map(|located| located as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let located = self.located.as_ref()?;
        let span = (located.snippet.start, located.snippet.length);
        Some(Box::new(std::iter::once(LabeledSpan::new_primary_with_span(None, span))))
    }
}

/// One line of a program that is not in memory.
#[derive(Debug)]
struct Located<'a> {
    snippet: Snippet,
    whole: SourceSpan,
    name: &'a str,
    line: usize,
    column: usize,
}

impl<'a> Located<'a> {
    fn new(finding: &Finding, snippet: Snippet, name: &'a str) -> Self {
        let from_zero = |value: u32| value.saturating_sub(1) as usize;
        let whole = (0, snippet.text.len()).into();
        Self { snippet, whole, name, line: from_zero(finding.line), column: from_zero(finding.column) }
    }
}

impl SourceCode for Located<'_> {
    /// Always the whole line. Lines and columns are those of the program, not of the part that is shown.
    fn read_span<'b>(
        &'b self,
        span: &SourceSpan,
        _context_lines_before: usize,
        _context_lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'b> + 'b>, MietteError> {
        if span.offset() + span.len() > self.snippet.text.len() {
            return Err(MietteError::OutOfBounds);
        }
        Ok(Box::new(MietteSpanContents::new_named(
            self.name.to_owned(),
            self.snippet.text.as_bytes(),
            self.whole,
            self.line,
            self.column,
            1,
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_met_again_says_how_often_and_where() {
        let pass = |number| Some(Occurrence { name: "pass".to_owned(), number });
        let finding = |occurrences, first, worst| Finding { occurrences, first, worst, ..Finding::default() };
        assert_eq!(repetition(&finding(35, pass(1), pass(12))), " (35 times, first in pass 1, worst in pass 12)");
        assert_eq!(repetition(&finding(2, None, None)), " (2 times)");
        // Reports of before have no count.
        assert_eq!(repetition(&finding(1, pass(1), pass(1))) + &repetition(&finding(0, None, None)), "");
    }
}
