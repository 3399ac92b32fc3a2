//! `feedwave lsp` as an editor has it: messages on standard input and output.

mod called;

use std::fs;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::process::{Child, ChildStdin, ChildStdout, Stdio};

use serde_json::{Value, json};

use super::{feedwave, fixture, stdout};

/// A session with the real binary.
struct Session {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    next_id: i64,
}

impl Session {
    fn start() -> Self {
        let mut child =
            feedwave().arg("lsp").arg("--stdio").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        Self { input: child.stdin.take(), output, child, next_id: 0 }
    }

    /// A session that has begun, with a workspace and the editor's options.
    fn initialized(root: &std::path::Path, options: &Value) -> Self {
        let mut session = Self::start();
        let params = json!({
            "processId": null, "capabilities": {}, "rootUri": uri(root), "initializationOptions": { "options": options },
        });
        session.ask("initialize", &params);
        session.tell("initialized", &json!({}));
        session
    }

    fn write(&mut self, bytes: &[u8]) {
        let input = self.input.as_mut().unwrap();
        input.write_all(bytes).unwrap();
        input.flush().unwrap();
    }

    fn send(&mut self, message: &Value) {
        let body = message.to_string();
        self.write(format!("Content-Length: {}\r\n\r\n{body}", body.len()).as_bytes());
    }

    fn receive(&mut self) -> Value {
        let mut length = 0;
        loop {
            let mut line = String::new();
            assert!(self.output.read_line(&mut line).unwrap() > 0, "the server has gone");
            let line = line.trim_end();
            if line.is_empty() {
                break;
            }
            length = line.strip_prefix("Content-Length: ").unwrap().parse().unwrap();
        }
        let mut body = vec![0; length];
        self.output.read_exact(&mut body).unwrap();
        serde_json::from_slice(&body).unwrap()
    }

    fn tell(&mut self, method: &str, params: &Value) {
        self.send(&json!({ "jsonrpc": "2.0", "method": method, "params": params }));
    }

    /// Asks, and waits for the answer; other messages before it are passed over.
    fn ask(&mut self, method: &str, params: &Value) -> Value {
        self.next_id += 1;
        let id = self.next_id;
        self.send(&json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": params }));
        self.answer(id)
    }

    fn answer(&mut self, id: i64) -> Value {
        loop {
            let message = self.receive();
            if message["id"] == id && message.get("method").is_none() {
                return message;
            }
        }
    }

    fn open(&mut self, uri: &str, text: &str) {
        let document = json!({ "uri": uri, "languageId": "gcode", "version": 1, "text": text });
        self.tell("textDocument/didOpen", &json!({ "textDocument": document }));
    }

    /// The findings that are shown next for a version of a document.
    fn shown(&mut self, uri: &str, version: i64) -> Vec<Value> {
        loop {
            let message = self.receive();
            let params = &message["params"];
            let told = message["method"] == "textDocument/publishDiagnostics";
            if told && params["uri"] == uri && params["version"] == version {
                return params["diagnostics"].as_array().unwrap().clone();
            }
        }
    }

    fn end(mut self) {
        assert_eq!(self.ask("shutdown", &Value::Null)["result"], Value::Null);
        self.tell("exit", &Value::Null);
        drop(self.input.take());
        assert_eq!(self.child.wait().unwrap().code(), Some(0));
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn uri(path: &std::path::Path) -> String {
    format!("file://{}", path.display())
}

fn at(uri: &str, line: u32, character: u32) -> Value {
    json!({ "textDocument": { "uri": uri }, "position": { "line": line, "character": character } })
}

fn codes(shown: &[Value]) -> Vec<&str> {
    shown.iter().filter_map(|diagnostic| diagnostic["code"].as_str()).collect()
}

#[test]
fn a_hover_says_what_is_in_force_behind_its_line() {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("O9001.nc"), "O9001\nG1 X41 Y30\nM99\n").unwrap();
    let root = uri(directory.path());
    let mut session = Session::start();
    // Options as they are, as editors without settings of their own say them.
    let options = json!({ "machine-kind": "mill", "include": ["."] });
    let params = json!({ "processId": null, "capabilities": {}, "rootUri": root, "initializationOptions": options });
    session.ask("initialize", &params);
    session.tell("initialized", &json!({}));
    let name = format!("{root}/main.nc");
    let lines = [
        "G21 G17 G90",
        "T2 M6",
        "S800 M3",
        "G0 X5 Y0 Z5",
        "G1 F500 X10",
        "M98 P9001",
        "(behind it)",
        "G1 X20",
        "M5",
        "M30",
    ];
    session.open(&name, &(lines.join("\n") + "\n"));
    let mut hover = |line: u32| {
        let answer = session.ask("textDocument/hover", &at(&name, line, 0));
        answer["result"]["contents"]["value"].as_str().unwrap_or_default().to_owned()
    };
    for (line, said) in [
        (1, "- tool: T2"),
        (2, "- spindle: M3 S800"),
        (4, "- feed: F500"),
        (4, "- position: x10 y0"),
        (5, "- position (since line 2 of O9001.nc): x41 y30"),
        (6, "- position (since line 2 of O9001.nc): x41 y30"),
        (7, "- position: x20 y30"),
        (8, "- spindle: M5"),
        (8, "- position (since line 8): x20 y30"),
    ] {
        let text = hover(line);
        assert!(text.contains(said), "line {line}: {said} is not in\n{text}");
    }
    assert!(!hover(3).contains("M5"));
    session.end();
}

#[test]
fn a_hover_of_a_line_without_actions_says_what_is_in_force_where_it_is_carried_out() {
    let directory = tempfile::tempdir().unwrap();
    let root = uri(directory.path());
    let mut session = Session::start();
    let params = json!({ "processId": null, "capabilities": {}, "rootUri": root, "initializationOptions": { "machine-kind": "mill" } });
    session.ask("initialize", &params);
    session.tell("initialized", &json!({}));
    let name = format!("{root}/main.nc");
    let lines = [
        "O1000",
        "G21 G90 G94 F500",
        "#1=1",
        "G1 X5",
        "M98 P2000",
        "#2=7",
        "WHILE [#2 LT 9] DO1",
        "G1 X#2",
        "G1 Y#2",
        "#2=#2+1",
        "END1",
        "GOTO 30",
        "#3=1",
        "N30 G1 X80",
        "M98 P3000",
        "M30",
        "O2000",
        "#4=1",
        "G1 X15",
        "IF [#4 EQ 2] GOTO 9",
        "G1 Z-10",
        "M99",
        "O3000",
        "G1 X90",
        "M99",
    ];
    session.open(&name, &(lines.join("\n") + "\n"));
    let mut position = |line: u32| {
        let answer = session.ask("textDocument/hover", &at(&name, line, 0));
        let text = answer["result"]["contents"]["value"].as_str().unwrap_or_default().to_owned();
        let said = text
            .lines()
            .find_map(|it| Some(it.strip_prefix("- position")?.split(": ").nth(1)?.split(" mm").next()?.to_owned()));
        said.unwrap_or_default()
    };
    for (line, place) in [
        (2, ""),
        (5, "x15 y0 z-10"),
        (6, "x15 y0 z-10"),
        (9, "x7 y7 z-10"),
        (11, "x8 y8 z-10"),
        (17, "x5 y0 z0"),
        (19, "x15 y0 z0"),
        (21, "x15 y0 z-10"),
        (24, "x90 y8 z-10"),
    ] {
        assert_eq!(position(line), place, "line {}: {}", line + 1, lines[line as usize]);
    }
    session.end();
}

#[test]
fn a_document_whose_uri_has_a_bare_per_cent_sign_is_judged_under_its_name() {
    let directory = tempfile::tempdir().unwrap();
    let mut session = Session::initialized(directory.path(), &json!({}));
    let uri = format!("{}/100% done.nc", uri(directory.path()));
    session.open(&uri, "G0 X20 Z5\nG9999\nM30\n");
    assert!(!session.shown(&uri, 1).is_empty());
    let hover = session.ask("textDocument/hover", &at(&uri, 0, 1));
    assert!(hover["result"].is_object(), "{hover}");
    session.end();
}

#[test]
fn a_session_is_as_it_was() {
    follow("lsp-session.jsonl");
}

/// Every message of a session in its order, as the file has it. What a server answers is written anew with
/// `FEEDWAVE_WRITE_DOCS=1`, and is to be read then.
fn follow(name: &str) {
    let path = fixture(name);
    let lines: Vec<Value> =
        fs::read_to_string(&path).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let mut session = Session::start();
    let mut found = String::new();
    for line in &lines {
        let line = match (line.get("send"), line.get("receive")) {
            (Some(message), None) => {
                session.send(message);
                line.clone()
            }
            _ => json!({ "receive": session.receive() }),
        };
        found.push_str(&line.to_string());
        found.push('\n');
    }
    drop(session.input.take());
    assert_eq!(session.child.wait().unwrap().code(), Some(0));
    if std::env::var_os("FEEDWAVE_WRITE_DOCS").is_some() {
        fs::write(&path, &found).unwrap();
        return;
    }
    for (line, (found, expected)) in found.lines().zip(&lines).enumerate() {
        assert_eq!(&serde_json::from_str::<Value>(found).unwrap(), expected, "line {}", line + 1);
    }
}

#[test]
fn a_quick_fix_cures_what_it_was_offered_for() {
    let directory = tempfile::tempdir().unwrap();
    let program = fs::read_to_string(fixture("spec-trap.nc")).unwrap();
    let name = uri(&directory.path().join("trap.nc"));
    let mut session = Session::initialized(directory.path(), &json!({}));
    session.open(&name, &program);
    let shown = session.shown(&name, 1);
    assert_eq!(codes(&shown), ["VIB-CHIP-UNBROKEN"]);
    let context = json!({ "diagnostics": shown });
    let asked = json!({ "textDocument": { "uri": name }, "range": shown[0]["range"], "context": context });
    let actions = session.ask("textDocument/codeAction", &asked)["result"].clone();
    assert_eq!(actions[0]["diagnostics"][0]["code"], "VIB-CHIP-UNBROKEN");
    let edit = &actions[0]["edit"]["changes"][&name][0];
    let change = json!({ "range": edit["range"], "text": edit["newText"] });
    let document = json!({ "uri": name, "version": 2 });
    session.tell("textDocument/didChange", &json!({ "textDocument": document, "contentChanges": [change] }));
    assert_eq!(session.shown(&name, 2), Vec::<Value>::new());
    // Away from the finding there is nothing to offer; closing takes everything off the screen.
    let elsewhere = json!({ "start": { "line": 0, "character": 0 }, "end": { "line": 0, "character": 0 } });
    let asked = json!({ "textDocument": { "uri": name }, "range": elsewhere, "context": { "diagnostics": [] } });
    assert_eq!(session.ask("textDocument/codeAction", &asked)["result"], json!([]));
    session.tell("textDocument/didClose", &json!({ "textDocument": { "uri": name } }));
    assert_eq!(session.ask("textDocument/hover", &at(&name, 0, 0))["error"]["code"], -32803);
    session.end();
}

#[test]
fn the_machine_is_that_of_the_file_beside_the_program_and_changes_with_it() {
    let directory = tempfile::tempdir().unwrap();
    let root = directory.path();
    let name = uri(&root.join("part.nc"));
    let options = root.join("feedwave.toml");
    fs::create_dir(root.join("subs")).unwrap();
    fs::write(root.join("subs/O1000.nc"), "O1000\nG1 Z-2 F100\nN7 G1 X20\nG1 Y0 Q5\nM99\n").unwrap();
    fs::write(&options, "[validate]\nmachine_kind = \"mill\"\ninclude = \"subs\"\n").unwrap();
    let mut session = Session::initialized(root, &json!({ "machine_kind": "lathe" }));
    session.open(&name, "G21 G90 S500 M3\nG0 X10 Y0 Z5\nM98 P1000\nM30\n");
    let shown = session.shown(&name, 1);
    // The finding of the other file is shown at the call, with its place beside it.
    assert_eq!(codes(&shown), ["PRG-WORD-UNUSED"], "{shown:?}");
    assert_eq!(shown[0]["range"]["start"]["line"], 2);
    let related = &shown[0]["relatedInformation"][0]["location"];
    assert_eq!(related["uri"], uri(&root.join("subs/O1000.nc")));
    assert_eq!((&related["range"]["start"]["line"], &related["range"]["start"]["character"]), (&json!(3), &json!(6)));
    // The call leads to the file; times of lines are not told, as those of both would be mixed.
    let found = session.ask("textDocument/definition", &at(&name, 2, 6));
    assert_eq!(found["result"][0]["uri"], uri(&root.join("subs/O1000.nc")));
    assert_eq!(found["result"][0]["range"]["start"]["line"], 0);
    let whole = json!({ "start": { "line": 0, "character": 0 }, "end": { "line": 9, "character": 0 } });
    let hints = session.ask("textDocument/inlayHint", &json!({ "textDocument": { "uri": name }, "range": whole }));
    assert_eq!(hints["result"], json!([]));
    // Another machine: everything is judged anew.
    fs::write(&options, "[validate]\nmachine_kind = \"drill\"\n").unwrap();
    session.tell("workspace/didChangeWatchedFiles", &json!({ "changes": [] }));
    let shown = session.shown(&name, 1);
    let message = shown[0]["message"].as_str().unwrap();
    assert!(
        message.contains("not judged") && message.contains("feedwave.toml") && message.contains("drill"),
        "{message}"
    );
    session.end();
}

#[test]
fn a_newer_version_ends_the_judging_of_an_older_one() {
    let directory = tempfile::tempdir().unwrap();
    let name = uri(&directory.path().join("long.nc"));
    let mut session = Session::initialized(directory.path(), &json!({ "machine_kind": "mill", "period_us": 50 }));
    // Hours of judging, if it were not ended.
    let endless = format!("G21 G90\n{}M30\n", "G1 X100 F1\nG1 X0\n".repeat(5_000));
    session.open(&name, &endless);
    for version in 2..=40 {
        let change = json!({ "range": { "start": { "line": 0, "character": 0 }, "end": { "line": 0, "character": 0 } }, "text": "(a)" });
        let document = json!({ "uri": name, "version": version });
        session.tell("textDocument/didChange", &json!({ "textDocument": document, "contentChanges": [change] }));
    }
    let whole = json!({ "text": "G21 G90\nG1 X10 F100\nM30\n" });
    let document = json!({ "uri": name, "version": 41 });
    session.tell("textDocument/didChange", &json!({ "textDocument": document, "contentChanges": [whole] }));
    // The first that is shown is the last.
    let first = loop {
        let message = session.receive();
        if message["method"] == "textDocument/publishDiagnostics" {
            break message["params"]["version"].clone();
        }
    };
    assert_eq!(first, 41);
    session.end();
}

#[test]
fn what_makes_no_sense_is_refused_and_the_session_goes_on() {
    let directory = tempfile::tempdir().unwrap();
    let mut session = Session::start();
    // Before it has begun.
    assert_eq!(session.ask("textDocument/hover", &json!({}))["error"]["code"], -32002);
    session.tell("textDocument/didOpen", &json!({}));
    assert_eq!(session.ask("initialize", &json!({ "capabilities": 3 }))["error"]["code"], -32602);
    session.ask("initialize", &json!({ "capabilities": {}, "processId": null, "rootUri": null }));
    assert_eq!(session.ask("initialize", &json!({}))["error"]["code"], -32600);
    // No JSON, no message, no UTF-8, too long.
    session.write(b"Content-Length: 1\r\n\r\n{");
    let refused = session.receive();
    assert_eq!((&refused["error"]["code"], &refused["id"]), (&json!(-32700), &Value::Null));
    session.write(b"Content-Length: 2\r\n\r\n[]");
    assert_eq!(session.receive()["error"]["code"], -32600);
    session.write(b"Content-Length: 2\r\n\r\n\xff\xff");
    assert_eq!(session.receive()["error"]["code"], -32700);
    let long = 65 << 20;
    session.write(format!("Content-Length: {long}\r\n\r\n").as_bytes());
    session.write(&vec![b' '; long]);
    assert!(session.receive()["error"]["message"].as_str().unwrap().contains("67108864"));
    // Unknown methods and documents, parameters of other types.
    assert_eq!(session.ask("textDocument/rename", &json!({}))["error"]["code"], -32601);
    assert_eq!(session.ask("textDocument/hover", &json!({}))["error"]["code"], -32602);
    assert_eq!(session.ask("textDocument/hover", &at("file:///none.nc", 0, 0))["error"]["code"], -32803);
    for (method, params) in [
        ("textDocument/didOpen", json!([1])),
        ("textDocument/didChange", json!({ "textDocument": 1 })),
        ("workspace/didChangeConfiguration", json!(null)),
        ("$/cancelRequest", json!({ "id": 99 })),
        ("nobody/knows", json!({})),
    ] {
        session.tell(method, &params);
    }
    let name = uri(&directory.path().join("a.nc"));
    session.open(&name, "%\nM30\n%\n");
    session.shown(&name, 1);
    let wrong = json!({ "textDocument": { "uri": name }, "position": "here" });
    assert_eq!(session.ask("textDocument/hover", &wrong)["error"]["code"], -32602);
    // Places that are not there, and changes around them.
    for place in [(0, 999), (999, 0), (u32::MAX, u32::MAX)] {
        assert!(session.ask("textDocument/hover", &at(&name, place.0, place.1))["error"].is_null());
        assert_eq!(session.ask("textDocument/definition", &at(&name, place.0, place.1))["result"], Value::Null);
    }
    session.end();
}

#[test]
fn a_document_that_is_too_long_is_said_to_be_and_comes_back() {
    let directory = tempfile::tempdir().unwrap();
    let name = uri(&directory.path().join("huge.nc"));
    let mut session = Session::initialized(directory.path(), &json!({}));
    session.open(&name, &"(0123456789)\n".repeat((32 << 20) / 13 + 1));
    let message = session.receive();
    let told = message["params"]["diagnostics"][0]["message"].as_str().unwrap().to_owned();
    assert!(told.contains("33554432 bytes"), "{told}");
    assert_eq!(session.ask("textDocument/hover", &at(&name, 0, 0))["error"]["code"], -32803);
    // Changes are followed meanwhile: as soon as it is short enough, it has its findings.
    let cut = |from: u32, to: u32, text: &str| {
        let place = |line: u32| json!({ "line": line, "character": 0 });
        json!({ "range": { "start": place(from), "end": place(to) }, "text": text })
    };
    let mut change = |version: i64, part: Value| {
        let document = json!({ "uri": name, "version": version });
        session.tell("textDocument/didChange", &json!({ "textDocument": document, "contentChanges": [part] }));
    };
    change(2, cut(0, 1, "(a comment instead of that)\n"));
    change(3, cut(3, u32::MAX, "G1 X5 Q\n"));
    let shown = session.shown(&name, 3);
    assert_eq!(shown[0]["range"]["start"]["line"], 3, "{shown:?}");
    // The same from a document that was short, then too long by a change, then short again.
    let mut change = |version: i64, part: Value| {
        let document = json!({ "uri": name, "version": version });
        session.tell("textDocument/didChange", &json!({ "textDocument": document, "contentChanges": [part] }));
    };
    change(4, cut(0, 0, &"(0123456789)\n".repeat((32 << 20) / 13 + 1)));
    change(5, cut(0, (32 << 20) / 13 + 1, ""));
    assert_eq!(session.shown(&name, 5), shown);
    session.end();
}

#[test]
fn a_document_beyond_all_bounds_is_known_again_when_it_is_saved() {
    let directory = tempfile::tempdir().unwrap();
    let name = uri(&directory.path().join("huge.nc"));
    let mut session = Session::initialized(directory.path(), &json!({}));
    let piece = "(0123456789)\n".repeat((40 << 20) / 13);
    session.open(&name, &piece);
    let place = json!({ "line": 0, "character": 0 });
    let part = json!({ "range": { "start": place, "end": place }, "text": piece });
    let document = json!({ "uri": name, "version": 2 });
    session.tell("textDocument/didChange", &json!({ "textDocument": document, "contentChanges": [part] }));
    // Without its text nothing can be made of a change.
    let part = json!({ "range": { "start": place, "end": { "line": u32::MAX, "character": 0 } }, "text": "" });
    let document = json!({ "uri": name, "version": 3 });
    session.tell("textDocument/didChange", &json!({ "textDocument": document, "contentChanges": [part] }));
    session.tell("textDocument/didSave", &json!({ "textDocument": { "uri": name }, "text": "G1 X5 Q\n" }));
    assert!(!session.shown(&name, 0).is_empty());
    session.end();
}

#[test]
fn quick_fixes_are_asked_for_by_whole_kinds() {
    let directory = tempfile::tempdir().unwrap();
    let program = fs::read_to_string(fixture("spec-trap.nc")).unwrap();
    let name = uri(&directory.path().join("trap.nc"));
    let mut session = Session::initialized(directory.path(), &json!({}));
    session.open(&name, &program);
    let shown = session.shown(&name, 1);
    for (only, offers) in [
        (json!(["quickfix"]), true),
        (json!([""]), true),
        (json!(["refactor", "quickfix"]), true),
        (json!(["quick"]), false),
        (json!(["quickfix.all"]), false),
        (json!(["source"]), false),
        (json!([]), false),
    ] {
        let context = json!({ "diagnostics": shown, "only": only });
        let asked = json!({ "textDocument": { "uri": name }, "range": shown[0]["range"], "context": context });
        let actions = session.ask("textDocument/codeAction", &asked)["result"].clone();
        assert_eq!(!actions.as_array().unwrap().is_empty(), offers, "{only}: {actions}");
    }
    session.end();
}

#[test]
fn a_session_that_just_ends_says_so_by_its_exit_code() {
    let mut session = Session::start();
    drop(session.input.take());
    assert_eq!(session.child.wait().unwrap().code(), Some(1));
    let mut session = Session::start();
    session.write(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n");
    assert_eq!(session.child.wait().unwrap().code(), Some(2));
    let help = feedwave().args(["lsp", "--help"]).output().unwrap();
    assert!(stdout(&help).contains("[validate]"));
}
