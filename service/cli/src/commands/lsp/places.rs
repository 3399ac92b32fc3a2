//! Files as the protocol names them, and places in them.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::str::FromStr as _;

use feedwave_contract::proto::{Finding, Severity};
use lsp_types::{Diagnostic, DiagnosticRelatedInformation, DiagnosticSeverity, Location, NumberOrString, Range, Uri};

use super::document::Document;
use super::judge::Judgement;
use super::setup::Setup;
use crate::commands::findings;
use crate::commands::source::Source;

/// Most findings that are sent for one document.
const MAX_DIAGNOSTICS: usize = 2_000;
/// Longest further file in which places are looked up, bytes.
const MAX_FILE_BYTES: u64 = 32 << 20;

/// The path of a file that the protocol names; `None` for what is no file.
pub(super) fn path(uri: &Uri) -> Option<PathBuf> {
    url::Url::parse(uri.as_str()).ok().filter(|url| url.scheme() == "file")?.to_file_path().ok()
}

/// How the protocol names a file.
fn uri(path: &Path) -> Option<Uri> {
    let path = std::path::absolute(path).ok()?;
    Uri::from_str(url::Url::from_file_path(path).ok()?.as_str()).ok()
}

/// The program and its further files, read when a place in one is asked for.
pub(super) struct Files<'a> {
    own: &'a Uri,
    document: &'a Document,
    paths: HashMap<String, PathBuf>,
    read: HashMap<String, Option<(Uri, Document)>>,
}

impl<'a> Files<'a> {
    pub(super) fn new(own: &'a Uri, document: &'a Document, setup: Option<&Setup>) -> Self {
        let paths = setup.map(|setup| &setup.further).into_iter().flat_map(Source::further_paths);
        let paths = paths.map(|(name, path)| (name.to_owned(), path.to_owned())).collect();
        Self { own, document, paths, read: HashMap::new() }
    }

    /// A file by its name, empty for the program itself; `None` where it cannot be read.
    pub(super) fn get(&mut self, name: &str) -> Option<(&Uri, &Document)> {
        if name.is_empty() {
            return Some((self.own, self.document));
        }
        let path = self.paths.get(name)?;
        let read = self.read.entry(name.to_owned()).or_insert_with(|| {
            let size = std::fs::metadata(path).ok()?.len();
            let bytes = (size <= MAX_FILE_BYTES).then(|| std::fs::read(path).ok())??;
            Some((uri(path)?, Document::new(0, String::from_utf8_lossy(&bytes).into_owned())))
        });
        read.as_ref().map(|(uri, document)| (uri, document))
    }

    /// A place in one of them: line and byte column from 1, length in bytes.
    fn location(&mut self, name: &str, line: u32, column: u32, length: u32) -> Option<Location> {
        let (uri, document) = self.get(name)?;
        Some(Location { uri: uri.clone(), range: document.range(line, column, length) })
    }
}

/// What the editor shows of a judgement.
pub(super) fn diagnostics(judged: &Judgement, files: &mut Files<'_>) -> Vec<Diagnostic> {
    let mut shown: Vec<_> =
        judged.findings.iter().take(MAX_DIAGNOSTICS).map(|finding| diagnostic(finding, files)).collect();
    let more = judged.findings.len().saturating_sub(MAX_DIAGNOSTICS);
    let told = (more > 0).then(|| format!("{more} further findings are not shown: feedwave validate lists them"));
    for message in judged.problem.clone().into_iter().chain(told) {
        shown.push(about_all(message));
    }
    shown
}

/// A message about a whole document: why it was not judged.
pub(super) fn about_all(message: String) -> Diagnostic {
    Diagnostic {
        range: Range::default(),
        severity: Some(DiagnosticSeverity::WARNING),
        source: Some("feedwave".to_owned()),
        message,
        ..Diagnostic::default()
    }
}

/// A finding at its place; one in a further file at the call that led there, with its place beside it.
pub(super) fn diagnostic(finding: &Finding, files: &mut Files<'_>) -> Diagnostic {
    let mut message = finding.message.clone() + &findings::repetition(finding);
    if let Some(help) = findings::help(finding) {
        message = message + "\n" + &help;
    }
    let own = &finding.file;
    let mut related = Vec::new();
    let range = if own.is_empty() {
        files.document.range(finding.line, finding.column, finding.length)
    } else {
        message = format!("{own}:{}: {message}", finding.line);
        related.extend(
            files
                .location(own, finding.line, finding.column, finding.length)
                .map(|location| DiagnosticRelatedInformation { location, message: "it is here".to_owned() }),
        );
        let call = finding.related.iter().find(|place| place.is_call && place.file.is_empty());
        call.map_or_else(Range::default, |call| files.document.range(call.line, call.column, call.length))
    };
    for place in &finding.related {
        let location = files.location(&place.file, place.line, place.column, place.length);
        let message = place.message.clone();
        related.extend(location.map(|location| DiagnosticRelatedInformation { location, message }));
    }
    Diagnostic {
        range,
        severity: Some(match finding.severity() {
            Severity::Error | Severity::Unspecified => DiagnosticSeverity::ERROR,
            Severity::Warning => DiagnosticSeverity::WARNING,
            Severity::Info => DiagnosticSeverity::INFORMATION,
        }),
        code: Some(NumberOrString::String(finding.code.clone())),
        source: Some("feedwave".to_owned()),
        message,
        related_information: (!related.is_empty()).then_some(related),
        ..Diagnostic::default()
    }
}
