//! The life of a session: what is open, what is asked, what is told.

use std::collections::HashMap;
use std::io::{self, BufReader, BufWriter, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender, SyncSender};
use std::thread;

use lsp_server::{ErrorCode, Message, Notification, Request, RequestId, Response};
use lsp_types::{
    CodeActionKind, CodeActionOptions, CodeActionProviderCapability, DidChangeTextDocumentParams,
    DidCloseTextDocumentParams, DidOpenTextDocumentParams, DidSaveTextDocumentParams, FoldingRangeProviderCapability,
    HoverProviderCapability, InitializeParams, OneOf, PublishDiagnosticsParams, SemanticTokensFullOptions,
    SemanticTokensOptions, SemanticTokensServerCapabilities, ServerCapabilities, TextDocumentSyncCapability,
    TextDocumentSyncKind, Uri,
};
use serde_json::{Map, Value, json};

use super::answers::{self, METHODS, Question};
use super::document::Document;
use super::judge::{self, Judgement};
use super::places::{self, Files};
use super::setup::{EditorSettings, Setup};
use super::syntax;
use super::transport::{self, Received};
use super::uris::Uris;
use crate::commands::{CliError, EXIT_REFUSED};

/// Longest document that is judged, bytes.
const MAX_DOCUMENT_BYTES: usize = 32 << 20;
/// Longest document whose changes are followed, bytes: as long as a message may be.
const MAX_FOLLOWED_BYTES: usize = 64 << 20;
/// Most bytes of all documents.
const MAX_OPEN_BYTES: usize = 256 << 20;
/// Most questions that wait for their answers.
const MAX_WAITING: usize = 256;
/// Most messages that are read ahead.
const READ_AHEAD: usize = 64;

/// What the main thread waits for.
enum Event {
    Received(io::Result<Received>),
    /// A version was judged; with what is shown of it.
    Judged(Uri, Arc<Judgement>, Vec<lsp_types::Diagnostic>),
    Answered(Response),
}

/// A version to judge.
struct Task {
    uri: Uri,
    document: Arc<Document>,
    settings: EditorSettings,
    superseded: Arc<AtomicBool>,
}

/// A document that the editor has open.
struct Open {
    /// `None` while it is too long to be judged.
    document: Option<Arc<Document>>,
    /// One that is too long, for the changes that make it shorter; `None` beyond what is followed.
    too_long: Option<Arc<Document>>,
    judged: Option<Arc<Judgement>>,
    /// Ends the judging of the present version.
    superseded: Arc<AtomicBool>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    New,
    Running,
    ShutDown,
}

struct Server<W> {
    output: W,
    phase: Phase,
    settings: EditorSettings,
    documents: HashMap<String, Open>,
    uris: Uris,
    /// Withdraws a question.
    waiting: HashMap<RequestId, Arc<AtomicBool>>,
    tasks: Sender<Task>,
    questions: Sender<Question>,
    /// What the editor can do.
    refreshes_hints: bool,
    watches_files: bool,
    next_id: i32,
}

/// Serves on standard input and output.
pub(super) fn run() -> Result<ExitCode, CliError> {
    let (events, received) = mpsc::sync_channel(READ_AHEAD);
    let (tasks, tasks_received) = mpsc::channel();
    let (questions, questions_received) = mpsc::channel();
    let reader = events.clone();
    thread::spawn(move || read(&reader));
    let judged = events.clone();
    thread::spawn(move || judge_all(&tasks_received, &judged));
    thread::spawn(move || answer_all(&questions_received, &events));
    let mut server = Server {
        output: BufWriter::new(io::stdout().lock()),
        phase: Phase::New,
        settings: EditorSettings::default(),
        documents: HashMap::new(),
        uris: Uris::default(),
        waiting: HashMap::new(),
        tasks,
        questions,
        refreshes_hints: false,
        watches_files: false,
        next_id: 0,
    };
    let ended = server.serve(&received);
    // What still runs is of no use to anybody.
    for open in server.documents.values() {
        open.superseded.store(true, Ordering::Relaxed);
    }
    ended
}

/// Reads messages until the stream ends.
fn read(events: &SyncSender<Event>) {
    let mut input = BufReader::new(io::stdin());
    loop {
        let received = transport::receive(&mut input);
        let ends = matches!(received, Err(_) | Ok(Received::Ended));
        if events.send(Event::Received(received)).is_err() || ends {
            return;
        }
    }
}

/// Judges versions in the order in which they came, those that are superseded by then left out.
fn judge_all(tasks: &Receiver<Task>, events: &SyncSender<Event>) {
    for Task { uri, document, settings, superseded } in tasks {
        if superseded.load(Ordering::Relaxed) {
            continue;
        }
        let judging = AssertUnwindSafe(|| {
            let path = places::path(&uri);
            let mut setup = match Setup::read(path.as_deref(), &settings) {
                Ok(setup) => setup,
                Err(reason) => {
                    let problem = Some(format!("not judged, as its machine is not known: {reason}"));
                    let judged = Judgement { version: document.version, problem, ..Judgement::default() };
                    let shown = places::diagnostics(&judged, &mut Files::new(&uri, &document, None));
                    return Some((judged, shown));
                }
            };
            let judged = judge::judge(&document, path.as_deref(), &mut setup, &superseded)?;
            let shown = places::diagnostics(&judged, &mut Files::new(&uri, &document, Some(&setup)));
            Some((judged, shown))
        });
        let result = catch_unwind(judging).unwrap_or_else(|_| {
            let problem = Some("not judged: feedwave lsp failed on this program; its output says where".to_owned());
            let judged = Judgement { version: document.version, problem, ..Judgement::default() };
            let shown = places::diagnostics(&judged, &mut Files::new(&uri, &document, None));
            Some((judged, shown))
        });
        if let Some((judged, shown)) = result
            && events.send(Event::Judged(uri, Arc::new(judged), shown)).is_err()
        {
            return;
        }
    }
}

/// Answers questions one after the other.
fn answer_all(questions: &Receiver<Question>, events: &SyncSender<Event>) {
    for question in questions {
        let id = question.request.id.clone();
        let response = catch_unwind(AssertUnwindSafe(|| answers::answer(question)));
        let response = response.unwrap_or_else(|_| {
            Response::new_err(
                id,
                ErrorCode::InternalError as i32,
                "the answer failed; the output says where".to_owned(),
            )
        });
        if events.send(Event::Answered(response)).is_err() {
            return;
        }
    }
}

impl<W: Write> Server<W> {
    fn serve(&mut self, events: &Receiver<Event>) -> Result<ExitCode, CliError> {
        let broken = |error: &io::Error| CliError::trouble(format!("standard input: {error}"));
        loop {
            let Ok(event) = events.recv() else { return Ok(self.exit_code()) };
            match event {
                Event::Received(Err(error)) => return Err(broken(&error)),
                Event::Received(Ok(Received::Ended)) => return Ok(self.exit_code()),
                Event::Received(Ok(Received::Malformed(answer))) => self.send(answer)?,
                Event::Received(Ok(Received::Message(Message::Notification(mut told)))) => {
                    self.uris.take_in(&mut told.params, told.method == "textDocument/didOpen");
                    if told.method == "exit" {
                        return Ok(self.exit_code());
                    }
                    if self.phase == Phase::Running {
                        self.told(told)?;
                    }
                }
                Event::Received(Ok(Received::Message(Message::Request(mut request)))) => {
                    self.uris.take_in(&mut request.params, false);
                    self.asked(request)?;
                }
                // Answers to registrations and refreshes say nothing that matters.
                Event::Received(Ok(Received::Message(Message::Response(_)))) => {}
                Event::Judged(uri, judged, shown) => self.judged(&uri, judged, shown)?,
                Event::Answered(response) => {
                    self.waiting.remove(&response.id);
                    self.respond(response)?;
                }
            }
        }
    }

    fn exit_code(&self) -> ExitCode {
        if self.phase == Phase::ShutDown { ExitCode::SUCCESS } else { ExitCode::from(EXIT_REFUSED) }
    }

    fn send(&mut self, mut message: Value) -> Result<(), CliError> {
        self.uris.give_out(&mut message);
        transport::send(&mut self.output, &message).map_err(|error| CliError::written("standard output", &error))
    }

    fn respond(&mut self, response: Response) -> Result<(), CliError> {
        let mut message = serde_json::to_value(response).map_err(CliError::trouble)?;
        message["jsonrpc"] = "2.0".into();
        self.send(message)
    }

    fn refuse(&mut self, id: &RequestId, code: ErrorCode, message: &str) -> Result<(), CliError> {
        self.respond(Response::new_err(id.clone(), code as i32, message.to_owned()))
    }

    /// Asks the editor something whose answer does not matter.
    fn ask(&mut self, method: &str, params: &Value) -> Result<(), CliError> {
        self.next_id += 1;
        let id = format!("feedwave-{}", self.next_id);
        self.send(json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": params }))
    }

    fn asked(&mut self, request: Request) -> Result<(), CliError> {
        let id = request.id.clone();
        match (self.phase, request.method.as_str()) {
            (Phase::New, "initialize") => self.initialize(request),
            (Phase::New, _) => self.refuse(&id, ErrorCode::ServerNotInitialized, "not initialized"),
            (Phase::ShutDown, _) => self.refuse(&id, ErrorCode::InvalidRequest, "shut down"),
            (Phase::Running, "initialize") => self.refuse(&id, ErrorCode::InvalidRequest, "initialized already"),
            (Phase::Running, "shutdown") => {
                self.phase = Phase::ShutDown;
                self.respond(Response::new_ok(id, Value::Null))
            }
            (Phase::Running, method) if METHODS.contains(&method) => self.question(request),
            (Phase::Running, method) => {
                let message = format!("{method} is not answered");
                self.refuse(&id, ErrorCode::MethodNotFound, &message)
            }
        }
    }

    fn initialize(&mut self, request: Request) -> Result<(), CliError> {
        let params: InitializeParams = match serde_json::from_value(request.params) {
            Ok(params) => params,
            Err(error) => return self.refuse(&request.id, ErrorCode::InvalidParams, &error.to_string()),
        };
        let folders = params.workspace_folders.iter().flatten().map(|folder| &folder.uri);
        #[allow(deprecated, reason = "older editors say the workspace only so")]
        let root = folders.chain(&params.root_uri).next().and_then(places::path);
        // As they are, or within `options` as editors say settings.
        let given = params.initialization_options.as_ref().map(|given| given.get("options").unwrap_or(given));
        self.settings = EditorSettings { options: options(given), root };
        let workspace = params.capabilities.workspace.unwrap_or_default();
        self.refreshes_hints = workspace.inlay_hint.and_then(|it| it.refresh_support) == Some(true);
        self.watches_files = workspace.did_change_watched_files.and_then(|it| it.dynamic_registration) == Some(true);
        self.phase = Phase::Running;
        let result = json!({
            "capabilities": capabilities(),
            "serverInfo": { "name": "feedwave", "version": env!("CARGO_PKG_VERSION") },
        });
        self.respond(Response::new_ok(request.id, result))
    }

    fn question(&mut self, request: Request) -> Result<(), CliError> {
        let uri = request.params.pointer("/textDocument/uri").cloned().unwrap_or_default();
        let Ok(uri) = serde_json::from_value::<Uri>(uri) else {
            return self.refuse(&request.id, ErrorCode::InvalidParams, "no textDocument.uri");
        };
        let open =
            self.documents.get(uri.as_str()).and_then(|open| Some((open.document.clone()?, open.judged.clone())));
        let Some((document, judged)) = open else {
            return self.refuse(&request.id, ErrorCode::RequestFailed, "the document is not open, or too long");
        };
        if self.waiting.len() >= MAX_WAITING || self.waiting.contains_key(&request.id) {
            return self.refuse(&request.id, ErrorCode::ServerCancelled, "too many questions wait, or this one does");
        }
        let withdrawn = Arc::new(AtomicBool::new(false));
        self.waiting.insert(request.id.clone(), Arc::clone(&withdrawn));
        let settings = self.settings.clone();
        let question = Question { request, uri, document, judged, settings, withdrawn };
        self.questions.send(question).map_err(CliError::trouble)
    }

    /// A notification; what is none that is known, or has no sense, changes nothing.
    fn told(&mut self, told: Notification) -> Result<(), CliError> {
        match told.method.as_str() {
            "initialized" => self.watch(),
            "textDocument/didOpen" => {
                let Ok(params) = serde_json::from_value::<DidOpenTextDocumentParams>(told.params) else {
                    return Ok(());
                };
                let opened = params.text_document;
                self.open(opened.uri, Document::new(opened.version, opened.text))
            }
            "textDocument/didChange" => {
                let Ok(params) = serde_json::from_value(told.params) else { return Ok(()) };
                self.change(params)
            }
            "textDocument/didClose" => {
                let Ok(params) = serde_json::from_value::<DidCloseTextDocumentParams>(told.params) else {
                    return Ok(());
                };
                let uri = params.text_document.uri;
                if let Some(open) = self.documents.remove(uri.as_str()) {
                    open.superseded.store(true, Ordering::Relaxed);
                }
                let name = uri.as_str().to_owned();
                self.publish(uri, None, Vec::new())?;
                self.uris.forget(&name);
                Ok(())
            }
            // What other files say may have changed.
            "textDocument/didSave" => {
                self.saved(told.params)?;
                self.judge_everything()
            }
            "workspace/didChangeWatchedFiles" => self.judge_everything(),
            "workspace/didChangeConfiguration" => {
                self.settings.options = options(told.params.pointer("/settings/feedwave/options"));
                self.judge_everything()
            }
            "$/cancelRequest" => {
                let id = told.params.get("id").cloned().and_then(|id| serde_json::from_value::<RequestId>(id).ok());
                if let Some(withdrawn) = id.and_then(|id| self.waiting.get(&id)) {
                    withdrawn.store(true, Ordering::Relaxed);
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Asks to be told of changed files that judgements depend on.
    fn watch(&mut self) -> Result<(), CliError> {
        if !self.watches_files {
            return Ok(());
        }
        let watchers = ["**/*.toml", "**/*.json", "**/*.nc", "**/*.ngc"].map(|glob| json!({ "globPattern": glob }));
        let registration = json!({
            "id": "files",
            "method": "workspace/didChangeWatchedFiles",
            "registerOptions": { "watchers": watchers },
        });
        self.ask("client/registerCapability", &json!({ "registrations": [registration] }))
    }

    fn open(&mut self, uri: Uri, document: Document) -> Result<(), CliError> {
        let size = document.text().len();
        let is_kept = size <= self.room_for(&uri);
        let fits = is_kept && size <= MAX_DOCUMENT_BYTES;
        let document = is_kept.then(|| Arc::new(document));
        let open = Open {
            document: document.clone().filter(|_| fits),
            too_long: document.filter(|_| !fits),
            judged: None,
            superseded: Arc::new(AtomicBool::new(false)),
        };
        if let Some(former) = self.documents.insert(uri.as_str().to_owned(), open) {
            former.superseded.store(true, Ordering::Relaxed);
        }
        if fits { self.judge(&uri) } else { self.too_long(uri) }
    }

    /// Bytes that a document may have beside the others, for its changes to be followed.
    fn room_for(&self, uri: &Uri) -> usize {
        let others = self.documents.iter().filter(|(known, _)| *known != uri.as_str());
        let kept = others.filter_map(|(_, open)| open.document.as_ref().or(open.too_long.as_ref()));
        MAX_OPEN_BYTES.saturating_sub(kept.map(|it| it.text().len()).sum()).min(MAX_FOLLOWED_BYTES)
    }

    /// A document whose text is not known any more is known again by the text that was saved.
    fn saved(&mut self, params: Value) -> Result<(), CliError> {
        let Ok(DidSaveTextDocumentParams { text_document, text }) = serde_json::from_value(params) else {
            return Ok(());
        };
        let known = self.documents.get(text_document.uri.as_str());
        let is_unknown = known.is_some_and(|open| open.document.is_none() && open.too_long.is_none());
        match text {
            // Its version is that of the change behind it.
            Some(text) if is_unknown => self.open(text_document.uri, Document::new(0, text)),
            _ => Ok(()),
        }
    }

    fn too_long(&mut self, uri: Uri) -> Result<(), CliError> {
        let message = format!(
            "not judged: a document has at most {MAX_DOCUMENT_BYTES} bytes here, and all together {MAX_OPEN_BYTES}; feedwave \
             validate has no such limit"
        );
        self.publish(uri, None, vec![places::about_all(message)])
    }

    fn change(&mut self, params: DidChangeTextDocumentParams) -> Result<(), CliError> {
        let uri = params.text_document.uri;
        let room = self.room_for(&uri);
        let Some(open) = self.documents.get_mut(uri.as_str()) else { return Ok(()) };
        // One whose text is not known is known again when its whole text comes.
        let mut document = match (open.document.take().or(open.too_long.take()), params.content_changes.first()) {
            (Some(document), _) => document,
            (None, Some(first)) if first.range.is_none() => Arc::new(Document::new(0, String::new())),
            (None, _) => return Ok(()),
        };
        let changed = Arc::make_mut(&mut document);
        let is_kept = changed.change(params.text_document.version, params.content_changes, room).is_ok();
        if is_kept && document.text().len() <= MAX_DOCUMENT_BYTES {
            open.document = Some(document);
            return self.judge(&uri);
        }
        open.too_long = is_kept.then_some(document);
        open.superseded.store(true, Ordering::Relaxed);
        self.too_long(uri)
    }

    fn judge_everything(&mut self) -> Result<(), CliError> {
        let uris: Vec<Uri> = self.documents.keys().filter_map(|uri| uri.parse().ok()).collect();
        uris.iter().try_for_each(|uri| self.judge(uri))
    }

    /// Has the present version of a document judged; that of an earlier one ends.
    fn judge(&mut self, uri: &Uri) -> Result<(), CliError> {
        let Some(open) = self.documents.get_mut(uri.as_str()) else { return Ok(()) };
        let Some(document) = open.document.clone() else { return Ok(()) };
        open.superseded.store(true, Ordering::Relaxed);
        open.superseded = Arc::new(AtomicBool::new(false));
        let superseded = Arc::clone(&open.superseded);
        let task = Task { uri: uri.clone(), document, settings: self.settings.clone(), superseded };
        self.tasks.send(task).map_err(CliError::trouble)
    }

    fn judged(&mut self, uri: &Uri, judged: Arc<Judgement>, shown: Vec<lsp_types::Diagnostic>) -> Result<(), CliError> {
        let Some(open) = self.documents.get_mut(uri.as_str()) else { return Ok(()) };
        // A newer version may have come meanwhile.
        if open.document.as_ref().map(|document| document.version) != Some(judged.version) {
            return Ok(());
        }
        let version = judged.version;
        open.judged = Some(judged);
        self.publish(uri.clone(), Some(version), shown)?;
        if self.refreshes_hints {
            self.ask("workspace/inlayHint/refresh", &Value::Null)?;
        }
        Ok(())
    }

    fn publish(
        &mut self,
        uri: Uri,
        version: Option<i32>,
        diagnostics: Vec<lsp_types::Diagnostic>,
    ) -> Result<(), CliError> {
        let params = PublishDiagnosticsParams { uri, diagnostics, version };
        let method = "textDocument/publishDiagnostics";
        self.send(json!({ "jsonrpc": "2.0", "method": method, "params": params }))
    }
}

/// The options that an editor says: an object of them.
fn options(given: Option<&Value>) -> Map<String, Value> {
    given.and_then(Value::as_object).cloned().unwrap_or_default()
}

fn capabilities() -> ServerCapabilities {
    ServerCapabilities {
        text_document_sync: Some(TextDocumentSyncCapability::Options(lsp_types::TextDocumentSyncOptions {
            open_close: Some(true),
            change: Some(TextDocumentSyncKind::INCREMENTAL),
            // The text makes a document known again that was too long to be kept.
            save: Some(lsp_types::SaveOptions { include_text: Some(true) }.into()),
            ..lsp_types::TextDocumentSyncOptions::default()
        })),
        hover_provider: Some(HoverProviderCapability::Simple(true)),
        definition_provider: Some(OneOf::Left(true)),
        document_symbol_provider: Some(OneOf::Left(true)),
        folding_range_provider: Some(FoldingRangeProviderCapability::Simple(true)),
        inlay_hint_provider: Some(OneOf::Left(true)),
        code_action_provider: Some(CodeActionProviderCapability::Options(CodeActionOptions {
            code_action_kinds: Some(vec![CodeActionKind::QUICKFIX]),
            ..CodeActionOptions::default()
        })),
        semantic_tokens_provider: Some(SemanticTokensServerCapabilities::SemanticTokensOptions(
            SemanticTokensOptions {
                legend: syntax::legend(),
                range: Some(true),
                full: Some(SemanticTokensFullOptions::Bool(true)),
                ..SemanticTokensOptions::default()
            },
        )),
        ..ServerCapabilities::default()
    }
}
