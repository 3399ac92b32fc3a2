//! What the documents print works as printed: their programs are accepted, their commands do what they are there for.
//!
//! A fence says what it holds: `sh` commands, `gcode NAME` a program, `toml NAME` a file for a command, `text` none of them. Any
//! other one fails.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Output;

use feedwave_tests::{Home, Server};
use tokio::process::Command;

use crate::FEEDWAVE;

const REPOSITORY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// The documents whose snippets are run, besides all pages of machining functions.
const DOCUMENTS: [&str; 3] = ["README.md", "docs/command-line.md", "docs/quick-start.md"];

/// Files that a reader is to have of their own.
const OWN_FILES: [(&str, &str); 1] =
    [("part.nc", "G21 G18 G99 G97 S1000 M3\nG0 X30. Z2.\nG1 Z-20. F0.2\nG0 X32.\nM30\n")];

/// How the programs are validated that do not run on the generic lathe.
const MACHINES: [(&str, &[&str]); 2] = [
    (
        "face.nc",
        &["--profile", "tests/fixtures/oscillation-mill.toml", "--tools", "tests/fixtures/oscillation-tools.toml"],
    ),
    ("slot.nc", &["--machine-kind", "mill"]),
];

/// The line of an output that has a name.
type FindName = fn(&str) -> Option<&str>;

/// Placeholders of names that the service gives: the command whose output has it, and which of its lines.
const NAMES: [(&str, &str, FindName); 2] =
    [("jobs/\u{2026}", "submit", |text| text.lines().last()), ("runs/\u{2026}", "run", |text| text.lines().next())];

/// Commands that are run elsewhere: this test is part of one, and what passes every change runs all of them.
const RUN_BY_CI: &str = "cargo ";

struct Snippet {
    tag: String,
    text: String,
}

/// All documents, as paths below the repository.
fn documents() -> Vec<String> {
    let pages = std::fs::read_dir(Path::new(REPOSITORY).join("docs/functions")).expect("a folder");
    let mut pages: Vec<String> = pages
        .map(|page| format!("docs/functions/{}", page.expect("a page").file_name().to_str().expect("a name")))
        .collect();
    pages.sort();
    assert!(pages.len() >= 5, "{pages:?}");
    DOCUMENTS.iter().map(|&document| document.to_owned()).chain(pages).collect()
}

fn snippets(document: &str) -> Vec<Snippet> {
    let text = std::fs::read_to_string(Path::new(REPOSITORY).join(document)).expect("the document is there");
    let mut snippets = Vec::new();
    let mut open: Option<Snippet> = None;
    for line in text.lines() {
        match (line.strip_prefix("```"), open.take()) {
            (Some(tag), None) => open = Some(Snippet { tag: tag.to_owned(), text: String::new() }),
            (Some(""), Some(snippet)) => snippets.push(snippet),
            (Some(tag), Some(_)) => panic!("{document}: a fence within a fence: {tag}"),
            (None, Some(snippet)) => open = Some(Snippet { text: snippet.text + line + "\n", ..snippet }),
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "{document}: a fence is not closed");
    snippets
}

/// Commands of a snippet in words, without comments and without what a pipe leads to; a backslash continues a line.
fn commands(text: &str) -> Vec<Vec<String>> {
    let text = text.replace("\\\n", " ");
    let lines = text.lines().map(|line| line.split_once('#').map_or(line, |(command, _)| command));
    let lines = lines.map(|line| line.split_once(" | ").map_or(line, |(command, _)| command));
    let words = lines.map(|line| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>());
    words.filter(|words| !words.is_empty()).collect()
}

async fn feedwave(home: &Path, server: Option<&Server>, arguments: &[String]) -> Output {
    let mut command = Command::new(FEEDWAVE);
    command.args(arguments).current_dir(home).env_remove("FEEDWAVE_CONFIG").env_remove("FEEDWAVE_SERVER");
    if let Some(server) = server {
        command.env("FEEDWAVE_SERVER", format!("http://{}", server.grpc));
    }
    let output = command.kill_on_drop(true).output().await.expect("the binary is started");
    let told = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "feedwave {}: {}\n{told}", arguments.join(" "), output.status);
    output
}

/// An empty working directory with the fixtures where the commands look for them, the programs of the document and the
/// files of the reader.
fn home(snippets: &[Snippet]) -> Home {
    let home = Home::new(FEEDWAVE, "");
    let repository = Path::new(REPOSITORY).canonicalize().expect("the repository is there");
    std::os::unix::fs::symlink(repository.join("tests"), home.path().join("tests")).expect("a link");
    for (name, text) in OWN_FILES {
        std::fs::write(home.path().join(name), text).expect("a file is written");
    }
    for snippet in snippets {
        if let Some(name) = ["gcode ", "toml "].into_iter().find_map(|kind| snippet.tag.strip_prefix(kind)) {
            std::fs::write(home.path().join(name), &snippet.text).expect("a file is written");
        }
    }
    home
}

#[test]
fn every_snippet_says_what_it_is() {
    let snippets: Vec<Snippet> = documents().iter().flat_map(|document| snippets(document)).collect();
    for Snippet { tag, text } in &snippets {
        let is_program = tag.strip_prefix("gcode ").is_some_and(|name| name.ends_with(".nc"));
        let is_file = tag.strip_prefix("toml ").is_some_and(|name| name.ends_with(".toml"));
        assert!(tag == "sh" || tag == "text" || is_program || is_file, "{tag:?}: {text}");
    }
    let count = |start: &str| snippets.iter().filter(|snippet| snippet.tag.starts_with(start)).count();
    assert!(count("sh") >= 12 && count("gcode") >= 5, "{} and {}", count("sh"), count("gcode"));
}

#[tokio::test]
async fn every_program_is_accepted() {
    for document in documents() {
        let snippets = snippets(&document);
        let home = home(&snippets);
        for name in snippets.iter().filter_map(|snippet| snippet.tag.strip_prefix("gcode ")) {
            let machine = MACHINES.iter().find(|(program, _)| *program == name).map_or(&[][..], |(_, options)| options);
            let arguments = [&["validate", name][..], machine].concat();
            feedwave(home.path(), None, &arguments.iter().map(|&word| word.to_owned()).collect::<Vec<_>>()).await;
        }
    }
}

#[tokio::test]
async fn every_command_works() {
    let documents = documents();
    let found = futures_util::future::join_all(documents.iter().map(|document| run_commands(document))).await;
    let names: BTreeSet<_> = found.into_iter().flatten().collect();
    assert_eq!(names.len(), NAMES.len(), "{names:?}");
}

/// Runs the commands of one document in their order, with a service of their own; which names stood in for others.
async fn run_commands(document: &str) -> Vec<&'static str> {
    let ci = std::fs::read_to_string(Path::new(REPOSITORY).join(".ci/run")).expect("it is there");
    let snippets = snippets(document);
    let mut home = Some(home(&snippets));
    let directory = home.as_ref().map(|home| home.path().to_owned()).expect("it is there");
    let mut server: Option<Server> = None;
    let mut names = BTreeMap::new();
    for words in snippets.iter().filter(|snippet| snippet.tag == "sh").flat_map(|snippet| commands(&snippet.text)) {
        let line = words.join(" ");
        if line.starts_with(RUN_BY_CI) {
            let mut steps = ci.lines().filter_map(|step| step.strip_prefix("step ")?.split_once(' '));
            let is_run = steps.any(|(_, command)| command.starts_with(&line));
            assert!(is_run, "{document}: {line} is not run by .ci/run");
            continue;
        }
        let (program, arguments) = words.split_first().expect("not empty");
        assert_eq!(program, "feedwave", "{document}: {line}");
        // The service goes on next to the others, on free ports.
        if arguments == ["serve", "--config", "feedwave.toml"] {
            server = Some(home.take().expect("one service is started").start().await);
            continue;
        }
        let named = |word: &String| names.get(word.as_str()).cloned().unwrap_or_else(|| word.clone());
        let arguments: Vec<String> = arguments.iter().map(named).collect();
        let is_named = !arguments.iter().any(|word| word.contains('\u{2026}'));
        assert!(is_named, "{document}: nothing before {line} gives the name");
        let output = feedwave(&directory, server.as_ref(), &arguments).await;
        let text = String::from_utf8(output.stdout).expect("a text");
        for (name, _, found) in NAMES.iter().filter(|(_, command, _)| *command == arguments[0]) {
            names.insert(*name, found(&text).expect("a name").to_owned());
        }
        let files =
            arguments.iter().zip(&arguments[1..]).filter(|(option, _)| ["--out", "--plots"].contains(&option.as_str()));
        for (_, file) in files {
            assert!(directory.join(file).exists(), "{document}: {line} leaves no {file}");
        }
    }
    names.into_keys().collect()
}
