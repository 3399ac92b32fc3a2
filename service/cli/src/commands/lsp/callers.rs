//! A file that other programs call, such as `O9001.nc` with `M99` at its end. What holds in it depends on its caller, so it is read
//! after several callers that differ in all they can: what all of them say is true of the file, and nothing else is shown.

mod texts;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use feedwave_contract::convert::finding_to_proto;
use feedwave_contract::proto;
use feedwave_cutting::PipelineConfig;
use feedwave_program::{
    Finding, FindingCode, FindingLog, Interpreter, Outline, Place, Reader, Reading, SourcePages, code,
};

use super::document::Document;
use super::input::Input;
use super::setup::Setup;
use crate::commands::CliError;
use crate::commands::source::Source;

/// The place of the document among the programs of a job: behind its caller.
pub(super) const OWN_PROGRAM: u32 = 1;
/// Most lines that are read after one caller.
const MAX_LINES: u32 = 500_000;
/// Lines between two looks whether anybody still wants to know.
const LINES_PER_LOOK: u32 = 4_096;
/// As many callers have to come to a line for what they say of it to be shown.
const LEAST_CALLERS: usize = 2;

/// What follows from the words of a line alone.
const BY_WORDS: [FindingCode; 24] = [
    code::LINE_TOO_LONG,
    code::NUL,
    code::NUL_IN_COMMENT,
    code::NOT_UTF8,
    code::NOT_UTF8_IN_COMMENT,
    code::CHARACTER,
    code::LOOKALIKE,
    code::COMMENT_UNCLOSED,
    code::BEHIND_BLOCK_END,
    code::TEXT,
    code::EXPRESSION,
    code::EXPRESSION_MALFORMED,
    code::EXPRESSION_DEPTH,
    code::NUMBER_MISSING,
    code::NUMBER_STRAY,
    code::NUMBER_INVALID,
    code::NUMBER_SPACED,
    code::WORD_UNKNOWN,
    code::WORD_DUPLICATE,
    code::UNKNOWN_CODE,
    code::UNSUPPORTED_CODE,
    code::GROUP_CONFLICT,
    code::STATEMENT,
    code::NOT_A_PROGRAM,
];

/// What callers say alike and other ones need not: an alarm where an argument is missing, a code whose meaning an earlier one settles.
const BY_CALLER: [FindingCode; 3] = [code::ALARM, code::CODE_AMBIGUOUS, code::ARGUMENT_WITHOUT_POINT];

/// Programs that call a document.
#[derive(Debug)]
pub(super) struct Callers {
    /// The machine; the document is the first of its further programs.
    pub(super) config: Arc<PipelineConfig>,
    texts: Vec<String>,
    /// Which of the further files the programs behind the document are.
    files: Vec<u32>,
}

impl Callers {
    /// The callers of a document; `None` where it is a program that is run.
    pub(super) fn of(document: &Document, path: Option<&Path>, setup: &Setup) -> Option<Self> {
        let language = &setup.config.profile.language;
        let outline = Outline::read(document.text().as_bytes(), language);
        if !outline.is_called() {
            return None;
        }
        let own = path.and_then(|path| std::fs::canonicalize(path).ok());
        let is_own = |path: &Path| own.is_some() && std::fs::canonicalize(path).ok() == own;
        let (mut files, mut names, mut is_included) = (Vec::new(), Vec::new(), false);
        for (place, (name, path)) in setup.further.further_paths().enumerate() {
            if is_own(path) {
                is_included = true;
            } else {
                files.push(place as u32);
                names.push(name.to_owned());
            }
        }
        // A main program of a bar feeder begins again with M99, and has all that a cut needs.
        if outline.prepares_cutting() && !is_included {
            return None;
        }
        let stem = path.and_then(|path| path.file_stem()).map(|stem| stem.to_string_lossy().into_owned());
        let calls = texts::Calls::of(&outline, stem.as_deref(), language)?;
        names.insert(0, calls.file_name());
        let mut config = PipelineConfig::clone(&setup.config);
        config.programs = names.into();
        let texts = texts::callers(&calls, document.text(), &config.profile);
        Some(Self { config: Arc::new(config), texts, files })
    }

    /// What a document is read with after the callers whose state is valid, and differs in all that is told.
    pub(super) fn inputs<'a>(&'a self, document: &'a Document, further: &'a mut Source, caller: usize) -> Input<'a> {
        Input::with_files(vec![&self.texts[caller], document.text()], &self.files, further)
    }

    /// What is found in the document whatever calls it, in the order of the source; `None` once it is superseded.
    ///
    /// # Errors
    /// [`CliError`] where a further file cannot be read.
    pub(super) fn judge(
        &self,
        document: &Document,
        further: &mut Source,
        superseded: &AtomicBool,
    ) -> Result<Option<Vec<proto::Finding>>, CliError> {
        let mut runs = Vec::new();
        for caller in 0..self.texts.len() {
            let input = self.inputs(document, further, caller);
            let Some(run) = Run::of(self.config.interpreter(), input, document, superseded)? else { return Ok(None) };
            runs.push(run);
        }
        let mut found = common(&runs, document);
        let seldom = |finding: &Finding| {
            runs.iter().filter(|run| run.has_run(finding.span.line)).count() < LEAST_CALLERS
                && BY_WORDS.contains(&finding.code)
                && !spanned(finding, document).contains('#')
        };
        let straight = texts::straight(document, &self.config.profile.language);
        let by_words = Interpreter::new(self.config.profile.language.clone()).read_all(straight.as_bytes()).1;
        found.extend(by_words.into_findings().into_iter().filter(seldom));
        found.sort_by_key(|finding| (finding.span.line, finding.span.column));
        Ok(Some(found.into_iter().map(|finding| self.shown(finding)).collect()))
    }

    /// A finding as of a document that is opened by itself.
    fn shown(&self, mut finding: Finding) -> proto::Finding {
        finding.related.retain(|place| place.span.program != 0);
        (finding.occurrences, finding.first, finding.worst) = (1, None, None);
        let mut finding = finding_to_proto(&finding, &self.config.programs);
        let own = &self.config.programs[0];
        if finding.file == *own {
            finding.file.clear();
        }
        for place in finding.related.iter_mut().filter(|place| place.file == *own) {
            place.file.clear();
        }
        finding
    }
}

/// What was read after one caller.
struct Run {
    findings: Vec<Finding>,
    /// By line of the document, counted from 0.
    lines: Vec<bool>,
}

impl Run {
    fn of(
        interpreter: Interpreter,
        mut input: Input<'_>,
        document: &Document,
        superseded: &AtomicBool,
    ) -> Result<Option<Self>, CliError> {
        let mut lines = vec![false; document.line_count()];
        let (mut reader, mut pages) = (Reader::new(interpreter), SourcePages::default());
        let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
        for count in 0..MAX_LINES {
            if count % LINES_PER_LOOK == 0 && superseded.load(Ordering::Relaxed) {
                return Ok(None);
            }
            if let Some(Place { program: OWN_PROGRAM, offset }) = reader.interpreter.executes_at()
                && let Some(line) = lines.get_mut(document.line_at(offset as usize))
            {
                *line = true;
            }
            match reader.read_line(&mut pages, &mut operations, &mut findings) {
                Reading::More => operations.clear(),
                Reading::Ended => break,
                Reading::NeedInput => match input.read(pages.wanted())? {
                    [] => pages.finish(),
                    piece => pages.push(piece),
                },
            }
        }
        let mut findings = findings.into_findings();
        findings.retain(|finding| place(finding).is_some() && !BY_CALLER.contains(&finding.code));
        Ok(Some(Self { findings, lines }))
    }

    /// Whether it came to a line, counted from 1.
    fn has_run(&self, line: u32) -> bool {
        self.lines.get(line as usize - 1) == Some(&true)
    }
}

/// The line of the document that a finding is about, counted from 1: its own, or that of the call which led to it.
fn place(finding: &Finding) -> Option<u32> {
    let calls = finding.related.iter().filter(|place| place.is_call).map(|place| place.span);
    let mut spans = std::iter::once(finding.span).chain(calls);
    spans.find(|span| span.program == OWN_PROGRAM).map(|span| span.line.max(1))
}

/// The text of a finding.
fn spanned<'a>(finding: &Finding, document: &'a Document) -> &'a str {
    let range = document.range(finding.span.line, finding.span.column, finding.span.length);
    document.text().get(document.offset(range.start)..document.offset(range.end)).unwrap_or_default()
}

/// What all say that came to its line, at least two.
fn common(runs: &[Run], document: &Document) -> Vec<Finding> {
    let mut common: Vec<Finding> = Vec::new();
    for finding in runs.iter().flat_map(|run| &run.findings) {
        let is_same = |other: &&Finding| {
            (other.code, other.span, &other.message) == (finding.code, finding.span, &finding.message)
        };
        let Some(line) = place(finding) else { continue };
        if common.iter().any(|known| is_same(&known)) || returns_to_a_block(finding, document) {
            continue;
        }
        let came = runs.iter().filter(|run| run.has_run(line)).map(|run| run.findings.iter().find(is_same));
        let Some(said) = came.collect::<Option<Vec<_>>>().filter(|said| said.len() >= LEAST_CALLERS) else { continue };
        let mut finding = finding.clone();
        // Numbers and cures that follow from the caller are none of the file.
        finding.suggestions.retain(|cure| said.iter().all(|other| other.suggestions.contains(cure)));
        finding.values.retain(|value| said.iter().all(|other| other.values.contains(value)));
        common.push(finding);
    }
    common
}

/// Whether it is about `M99 P`, whose block is one of the caller.
fn returns_to_a_block(finding: &Finding, document: &Document) -> bool {
    let line = finding.span.line.max(1) as usize - 1;
    finding.code == code::JUMP_TARGET && document.line(line).to_ascii_uppercase().contains("M99")
}
