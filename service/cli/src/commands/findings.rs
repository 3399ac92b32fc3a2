//! Findings under their source lines.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use feedwave_contract::proto::{Finding, Occurrence, RelatedPlace, Severity};
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
    let mut snippets = Snippets::read(findings, source)?;
    let theme = if style.is_coloured() { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let handler = GraphicalReportHandler::new_themed(theme).with_width(WIDTH).with_links(false).with_break_words(false);
    let mut text = String::new();
    for finding in findings {
        let located = snippets.take(&finding.file, place_of(finding));
        let related = finding.related.iter().map(|place| ShownPlace {
            message: &place.message,
            located: snippets.take(&place.file, place_of_related(place)),
        });
        let related = related.collect();
        let shown = Shown { finding, help: help(finding), located, related };
        handler.render_report(&mut text, &shown).map_err(CliError::trouble)?;
        text.push('\n');
    }
    Ok(text)
}

const fn place_of(finding: &Finding) -> Place {
    Place { line: finding.line, column: finding.column, length: finding.length }
}

const fn place_of_related(place: &RelatedPlace) -> Place {
    Place { line: place.line, column: place.column, length: place.length }
}

/// The source lines of all places that findings name.
struct Snippets {
    /// By the name of the file, empty for the program itself.
    files: BTreeMap<String, FileSnippets>,
}

struct FileSnippets {
    /// What findings call the file.
    name: String,
    lines: BTreeMap<Place, Snippet>,
}

impl Snippets {
    /// Reads each file once.
    fn read(findings: &[Finding], source: &mut Source) -> Result<Self, CliError> {
        let mut wanted: BTreeMap<String, BTreeSet<Place>> = BTreeMap::new();
        let mut want = |file: &str, place| wanted.entry(file.to_owned()).or_default().insert(place);
        for finding in findings {
            want(&finding.file, place_of(finding));
            for place in &finding.related {
                want(&place.file, place_of_related(place));
            }
        }
        let mut files = BTreeMap::new();
        for (file, places) in wanted {
            // A report may name a file that is not at hand.
            let Some(opened) = source.file(&file)? else { continue };
            let places: Vec<Place> = places.into_iter().collect();
            let snippets = opened.snippets(&places)?.into_iter().zip(places);
            let lines = snippets.filter_map(|(snippet, place)| Some((place, snippet?))).collect();
            files.insert(file, FileSnippets { name: opened.name.clone(), lines });
        }
        Ok(Self { files })
    }

    fn take(&mut self, file: &str, place: Place) -> Option<Located> {
        let file = self.files.get(file)?;
        Some(Located::new(place, file.lines.get(&place)?.clone(), file.name.clone()))
    }
}

pub(super) fn help(finding: &Finding) -> Option<String> {
    let cures = finding.suggestions.iter().map(|suggestion| match &suggestion.replacement {
        // What is removed, and what the message says already, is not said again.
        Some(replacement) if !replacement.is_empty() && suggestion.message != format!("write {replacement}") => {
            format!("{}: write `{replacement}`", suggestion.message)
        }
        _ => suggestion.message.clone(),
    });
    let cures: Vec<_> = cures.collect();
    (!cures.is_empty()).then(|| cures.join("\n"))
}

/// A finding as the renderer wants it.
#[derive(Debug)]
struct Shown<'a> {
    finding: &'a Finding,
    help: Option<String>,
    located: Option<Located>,
    related: Vec<ShownPlace<'a>>,
}

/// Another place that has to do with a finding.
#[derive(Debug)]
struct ShownPlace<'a> {
    message: &'a str,
    located: Option<Located>,
}

impl fmt::Display for ShownPlace<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.message)
    }
}

impl std::error::Error for ShownPlace<'_> {}

impl Diagnostic for ShownPlace<'_> {
    fn severity(&self) -> Option<miette::Severity> {
        Some(miette::Severity::Advice)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        source_code(self.located.as_ref())
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        labels(self.located.as_ref())
    }
}

fn source_code(located: Option<&Located>) -> Option<&dyn SourceCode> {
    located.map(|located| located as &dyn SourceCode)
}

fn labels(located: Option<&Located>) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
    let located = located?;
    let span = (located.snippet.start, located.snippet.length);
    Some(Box::new(std::iter::once(LabeledSpan::new_primary_with_span(None, span))))
}

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.finding.message)?;
        f.write_str(&repetition(self.finding))
    }
}

/// How often it was met, and where first and worst, for a finding that was met more than once.
pub(super) fn repetition(finding: &Finding) -> String {
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
        source_code(self.located.as_ref())
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        labels(self.located.as_ref())
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        if self.related.is_empty() {
            return None;
        }
        Some(Box::new(self.related.iter().map(|place| place as &dyn Diagnostic)))
    }
}

/// One line of a program that is not in memory.
#[derive(Debug)]
struct Located {
    snippet: Snippet,
    whole: SourceSpan,
    name: String,
    line: usize,
    column: usize,
}

impl Located {
    fn new(place: Place, snippet: Snippet, name: String) -> Self {
        let from_zero = |value: u32| value.saturating_sub(1) as usize;
        let whole = (0, snippet.text.len()).into();
        Self { snippet, whole, name, line: from_zero(place.line), column: from_zero(place.column) }
    }
}

impl SourceCode for Located {
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
            self.name.clone(),
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
    use feedwave_contract::proto::Suggestion;

    use super::*;

    #[test]
    fn a_cure_says_what_to_write_once() {
        let help = |message: &str, replacement: Option<&str>| {
            let suggestion = Suggestion {
                message: message.to_owned(),
                replacement: replacement.map(str::to_owned),
                ..Suggestion::default()
            };
            help(&Finding { suggestions: vec![suggestion], ..Finding::default() }).unwrap()
        };
        assert_eq!(help("raise the amplitude", Some("A0.05")), "raise the amplitude: write `A0.05`");
        assert_eq!(help("remove it", Some("")), "remove it");
        assert_eq!(help("write X-5", Some("X-5")), "write X-5");
        assert_eq!(help("slow down", None), "slow down");
    }

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
