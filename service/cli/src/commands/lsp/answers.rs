//! Answers to what an editor asks about a document, each made from one version of it.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use feedwave_program::{Outline, ProgramName, Target, Vocabulary};
use lsp_server::{ErrorCode, Request, Response};
use lsp_types::{
    CodeAction, CodeActionKind, CodeActionOrCommand, CodeActionParams, DocumentSymbolResponse, GotoDefinitionResponse,
    Hover, HoverContents, InlayHint, InlayHintLabel, InlayHintTooltip, Location, MarkupContent, MarkupKind, Position,
    Range, SemanticTokens, TextDocumentPositionParams, TextEdit, Uri, WorkspaceEdit,
};
use serde::Deserialize;
use serde_json::Value;

use super::callers::Callers;
use super::document::Document;
use super::judge::Judgement;
use super::places::{self, Files};
use super::setup::{EditorSettings, Setup};
use super::{hover, syntax};
use crate::commands::terminal::number;

/// Most times that are shown in one answer.
const MAX_HINTS: usize = 10_000;

/// A question with all that its answer is made from.
#[derive(Debug)]
pub(super) struct Question {
    pub(super) request: Request,
    pub(super) uri: Uri,
    pub(super) document: Arc<Document>,
    /// The newest judgement of it, of this version or an earlier one.
    pub(super) judged: Option<Arc<Judgement>>,
    pub(super) settings: EditorSettings,
    /// Whether the editor has withdrawn it.
    pub(super) withdrawn: Arc<AtomicBool>,
}

/// The part of a question that says how much of the document it is about.
#[derive(Debug, Deserialize)]
struct RangeParams {
    range: Range,
}

/// What is asked, as [`answer`] tells questions apart.
pub(super) const METHODS: [&str; 8] = [
    "textDocument/hover",
    "textDocument/definition",
    "textDocument/codeAction",
    "textDocument/semanticTokens/full",
    "textDocument/semanticTokens/range",
    "textDocument/foldingRange",
    "textDocument/documentSymbol",
    "textDocument/inlayHint",
];

/// Answers it.
pub(super) fn answer(question: Question) -> Response {
    let id = question.request.id.clone();
    let result = match question.request.method.as_str() {
        "textDocument/hover" => hover_at(&question),
        "textDocument/definition" => definition(&question),
        "textDocument/codeAction" => code_actions(&question),
        "textDocument/semanticTokens/full" => tokens(&question, 0..usize::MAX),
        "textDocument/semanticTokens/range" => range(&question).and_then(|range| {
            tokens(&question, range.start.line as usize..(range.end.line as usize).saturating_add(1))
        }),
        "textDocument/foldingRange" => outline(&question).map(|outline| to_value(syntax::folds(&outline))),
        "textDocument/documentSymbol" => outline(&question)
            .map(|outline| to_value(DocumentSymbolResponse::Nested(syntax::symbols(&question.document, &outline)))),
        "textDocument/inlayHint" => range(&question).map(|range| to_value(hints(&question, range))),
        other => Err((ErrorCode::MethodNotFound, format!("{other} is not answered"))),
    };
    if question.withdrawn.load(Ordering::Relaxed) {
        return Response::new_err(id, ErrorCode::RequestCanceled as i32, "withdrawn".to_owned());
    }
    match result {
        Ok(value) => Response::new_ok(id, value),
        Err((code, message)) => Response::new_err(id, code as i32, message),
    }
}

type Answer = Result<Value, (ErrorCode, String)>;

fn to_value(answer: impl serde::Serialize) -> Value {
    serde_json::to_value(answer).unwrap_or_default()
}

fn params<T: serde::de::DeserializeOwned>(question: &Question) -> Result<T, (ErrorCode, String)> {
    T::deserialize(&question.request.params).map_err(|error| (ErrorCode::InvalidParams, error.to_string()))
}

fn range(question: &Question) -> Result<Range, (ErrorCode, String)> {
    params::<RangeParams>(question).map(|params| params.range)
}

fn setup(question: &Question) -> Result<Setup, (ErrorCode, String)> {
    let path = places::path(&question.uri);
    Setup::read(path.as_deref(), &question.settings).map_err(|reason| (ErrorCode::RequestFailed, reason))
}

fn outline(question: &Question) -> Result<Outline, (ErrorCode, String)> {
    let setup = setup(question)?;
    Ok(Outline::read(question.document.text().as_bytes(), &setup.config.profile.language))
}

fn hover_at(question: &Question) -> Answer {
    let position = params::<TextDocumentPositionParams>(question)?.position;
    if position.line as usize >= question.document.line_count() {
        return Ok(Value::Null);
    }
    let mut setup = setup(question)?;
    let judged = question.judged.as_deref();
    let path = places::path(&question.uri);
    let text = match Callers::of(&question.document, path.as_deref(), &setup) {
        Some(callers) => {
            hover::text_of_called(&callers, &question.document, &mut setup, position.line, &question.withdrawn)
        }
        None => hover::text(&question.document, &mut setup, judged, position.line, &question.withdrawn),
    };
    Ok(to_value(text.map(|value| Hover {
        contents: HoverContents::Markup(MarkupContent { kind: MarkupKind::Markdown, value }),
        range: Some(question.document.line_range(position.line)),
    })))
}

fn definition(question: &Question) -> Answer {
    let position = params::<TextDocumentPositionParams>(question)?.position;
    let document = &question.document;
    if position.line as usize >= document.line_count() {
        return Ok(Value::Null);
    }
    let setup = setup(question)?;
    let language = &setup.config.profile.language;
    let line = position.line as usize;
    let at = document.offset(position);
    let targets = Vocabulary::new(language).targets(document.counted_line(line).as_bytes());
    let here = targets.into_iter().find(|(span, _)| {
        let range = document.range(position.line + 1, span.column, span.length);
        (document.offset(range.start)..=document.offset(range.end)).contains(&at)
    });
    let Some((_, target)) = here else { return Ok(Value::Null) };
    let mut files = Files::new(&question.uri, document, Some(&setup));
    let mut found: Vec<Location> = Vec::new();
    for (name, is_named) in candidates(&target, &setup) {
        let Some((uri, text)) = files.get(&name) else { continue };
        let outline = Outline::read(text.text().as_bytes(), language);
        // Labels on their own are of the program that is open; in further files only programs and subprograms are.
        let mut lines = outline.find(&target, if name.is_empty() { position.line + 1 } else { 1 });
        if lines.is_empty() && is_named && !matches!(target, Target::Label(_)) {
            lines.push(1);
        }
        found.extend(lines.into_iter().map(|line| Location { uri: uri.clone(), range: text.line_range(line - 1) }));
        if !found.is_empty() {
            break;
        }
    }
    Ok(to_value(GotoDefinitionResponse::Array(found)))
}

/// The files in which a target is looked for, in their order, and whether each is named after it: the program itself, files of
/// its name, and for programs by number the others.
fn candidates(target: &Target, setup: &Setup) -> Vec<(String, bool)> {
    let own = (String::new(), false);
    let name = match target {
        Target::Label(_) => return vec![own],
        Target::Program { name, .. } => name.clone(),
        Target::Subprogram(name) => ProgramName::of_subprogram(name),
    };
    let files = setup.config.programs.iter();
    let (named, others): (Vec<_>, Vec<_>) = files.cloned().partition(|file| name.is_of_file(file));
    let by_number = matches!(target, Target::Program { .. });
    let others = others.into_iter().filter(|_| by_number).map(|file| (file, false));
    std::iter::once(own).chain(named.into_iter().map(|file| (file, true))).chain(others).collect()
}

/// Whether a kind of code action is `wanted` or below it: kinds are divided at dots, and the empty one has all.
fn includes(wanted: &CodeActionKind, kind: &CodeActionKind) -> bool {
    let (wanted, kind) = (wanted.as_str(), kind.as_str());
    wanted.is_empty() || kind.strip_prefix(wanted).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

fn code_actions(question: &Question) -> Answer {
    let asked: CodeActionParams = params(question)?;
    let wants = asked
        .context
        .only
        .as_ref()
        .is_none_or(|only| only.iter().any(|kind| includes(kind, &CodeActionKind::QUICKFIX)));
    let document = &question.document;
    // Places of another version are no places of this one.
    let judged = question.judged.as_ref().filter(|judged| judged.version == document.version && wants);
    let mut files = Files::new(&question.uri, document, None);
    let mut actions = Vec::new();
    for finding in judged.iter().flat_map(|judged| &judged.findings).filter(|finding| finding.file.is_empty()) {
        let range = document.range(finding.line, finding.column, finding.length);
        if range.end < asked.range.start || range.start > asked.range.end {
            continue;
        }
        let mut is_first = true;
        for suggestion in &finding.suggestions {
            let Some(replacement) = &suggestion.replacement else { continue };
            let title = match replacement.as_str() {
                "" => suggestion.message.clone(),
                text if suggestion.message == format!("write {text}") => suggestion.message.clone(),
                text => format!("{}: write {text}", suggestion.message),
            };
            let edit = TextEdit { range, new_text: replacement.clone() };
            actions.push(CodeActionOrCommand::CodeAction(CodeAction {
                title,
                kind: Some(CodeActionKind::QUICKFIX),
                diagnostics: Some(vec![places::diagnostic(finding, &mut files)]),
                edit: Some(edits(question.uri.clone(), vec![edit])),
                is_preferred: is_first.then_some(true),
                ..CodeAction::default()
            }));
            is_first = false;
        }
    }
    Ok(to_value(actions))
}

#[allow(clippy::mutable_key_type, reason = "the protocol's type; nobody changes a key")]
fn edits(uri: Uri, edits: Vec<TextEdit>) -> WorkspaceEdit {
    WorkspaceEdit { changes: Some(HashMap::from([(uri, edits)])), ..WorkspaceEdit::default() }
}

fn tokens(question: &Question, lines: std::ops::Range<usize>) -> Answer {
    let setup = setup(question)?;
    let vocabulary = Vocabulary::new(&setup.config.profile.language);
    Ok(to_value(SemanticTokens { result_id: None, data: syntax::tokens(&question.document, &vocabulary, lines) }))
}

/// When each line ends, at its end.
fn hints(question: &Question, range: Range) -> Vec<InlayHint> {
    let document = &question.document;
    let Some(judged) = question.judged.as_ref().filter(|judged| judged.version == document.version) else {
        return Vec::new();
    };
    let (first, last) = (range.start.line as usize, range.end.line as usize);
    let lines = judged.times.iter().enumerate().skip(first).take(last.saturating_sub(first).saturating_add(1));
    let moving = lines.filter(|(_, time)| time.takes_s > 0.0).take(MAX_HINTS);
    let hint = |(line, time): (usize, &super::judge::LineTime)| InlayHint {
        position: Position { ..document.line_range(line as u32).end },
        label: InlayHintLabel::String(format!("{} s", number(time.end_s, 5))),
        kind: None,
        text_edits: None,
        tooltip: Some(InlayHintTooltip::String(format!(
            "from {} s, takes {} s of {} s",
            number(time.start_s, 6),
            number(time.takes_s, 4),
            number(judged.duration_s.unwrap_or_default(), 6)
        ))),
        padding_left: Some(true),
        padding_right: None,
        data: None,
    };
    moving.map(hint).collect()
}
