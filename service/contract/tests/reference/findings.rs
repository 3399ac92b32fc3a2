//! `docs/findings.md`.

use std::fmt::Write;

use feedwave_contract::code::finding_codes;
use feedwave_program::{CodeEntry, Example, Severity};

const HEAD: &str = "# Findings

Every finding of a validation, a plan or a request has a code of this page. The finding itself adds the place, the numbers of the
case and what to write instead. A code keeps its name and meaning from release to release.

An **error** refuses the program before anything moves. A **warning** runs, but probably not as intended. An **info** is good to
know. Where a code has several severities, its text says when.

The examples are run by the tests. Those for the *lathe* and the *mill* need no machine profile; the mill has a tool 1. The
*five-axis mill* and the *oscillation mill* are those of `tests/fixtures/five-axis-mill.toml`, with tool 1, and
`tests/fixtures/oscillation-mill.toml`, with the tools beside it. What follows the machine is changed in its profile or in the job.

";

/// The whole page.
pub fn page() -> String {
    let mut page = HEAD.to_owned();
    for table in finding_codes() {
        let title = table.title;
        let anchor = title.to_lowercase().replace(' ', "-").replace(',', "");
        let _ = writeln!(page, "- [{title}](#{anchor}): {}", table.entries.len());
    }
    for table in finding_codes() {
        let _ = write!(page, "\n## {}\n", table.title);
        table.entries.iter().for_each(|entry| row(&mut page, entry));
    }
    page
}

fn row(page: &mut String, entry: &CodeEntry) {
    let CodeEntry { name, severities, meaning, cause, cure, example, .. } = entry;
    let severities: Vec<&str> = severities.iter().map(|severity| severity_name(*severity)).collect();
    let severities = severities.join(" or ");
    let _ =
        write!(page, "\n### {name}\n\n*{severities}*: {}.\n\n- Cause: {cause}\n- Cure: {cure}\n", capitalised(meaning));
    let _ = match example {
        Example::Program { machine, text } => write!(page, "- Example, {machine}:\n\n```\n{}\n```\n", visible(text)),
        Example::Words(text) => writeln!(page, "- Example: {text}."),
    };
}

const fn severity_name(severity: Severity) -> &'static str {
    match severity {
        Severity::Info => "info",
        Severity::Warning => "warning",
        Severity::Error => "error",
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// A program as text that an editor shows.
fn visible(program: &str) -> String {
    program.replace('\0', "␀")
}
