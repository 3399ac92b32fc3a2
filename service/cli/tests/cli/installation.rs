//! `feedwave completions` and `feedwave man`: every command is in them, and the shell that is there reads them.

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

use clap::CommandFactory as _;

use super::{code, feedwave, run, stderr, stdout};

/// The names of a command and of everything below it, `feedwave-job-list`.
fn names(command: &clap::Command, prefix: &str, found: &mut BTreeSet<String>) {
    let name = format!("{prefix}{}", command.get_name());
    for further in command.get_subcommands().filter(|further| !further.is_hide_set()) {
        names(further, &format!("{name}-"), found);
    }
    found.insert(name);
}

fn all_names() -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    names(&feedwave::args::Cli::command(), "", &mut found);
    found
}

#[test]
fn every_command_has_a_manual_page() {
    let directory = tempfile::tempdir().unwrap();
    let pages = directory.path().join("share/man1");
    let output = run(&[&"man", &pages]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let written: BTreeSet<String> =
        fs::read_dir(&pages).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    let wanted: BTreeSet<String> = all_names().into_iter().map(|name| format!("{name}.1")).collect();
    assert_eq!(written, wanted);
    assert!(wanted.contains("feedwave-machine-put.1") && wanted.len() > 30);
    let page = fs::read_to_string(pages.join("feedwave-validate.1")).unwrap();
    for said in [".TH", "feedwave", "Interpolation period", "deny\\-warnings", "Exit codes"] {
        assert!(page.contains(said), "{said} is not in\n{page}");
    }
    let page = fs::read_to_string(pages.join("feedwave-job-list.1")).unwrap();
    assert!(page.contains("feedwave job list"), "{page}");
    // A file where the directory should be is told, and nothing is written.
    let output = run(&[&"man", &pages.join("feedwave.1")]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("feedwave.1: "), "{}", stderr(&output));
}

#[test]
fn every_shell_completes_every_command() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let output = run(&[&"completions", &shell]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let script = stdout(&output);
        for name in ["validate", "thread-plan", "completions", "compare-qualities", "least-time"] {
            // No shell is given values that its options do not have.
            assert_eq!(script.contains(name), name != "least-time", "{shell}: {name}");
        }
    }
    assert_eq!(code(&run(&[&"completions", &"csh"])), 2);
}

#[test]
fn bash_completes_commands_options_and_values() {
    let directory = tempfile::tempdir().unwrap();
    let script = directory.path().join("feedwave.bash");
    fs::write(&script, stdout(&run(&[&"completions", &"bash"]))).unwrap();
    let complete = |words: &str| {
        let line = format!(
            "source {}; COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}}-1)); \
             _feedwave feedwave \"${{COMP_WORDS[COMP_CWORD]}}\" \"${{COMP_WORDS[COMP_CWORD-1]}}\"; echo ${{COMPREPLY[@]}}",
            script.display()
        );
        let output = Command::new("bash").arg("--norc").arg("-c").arg(line).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    };
    assert_eq!(complete("feedwave val"), "validate");
    assert_eq!(complete("feedwave validate --deny"), "--deny-warnings");
    assert_eq!(complete("feedwave validate --machine-kind m"), "mill");
    assert_eq!(complete("feedwave machine pu"), "put");
    // What is completed is taken.
    let mut command = feedwave();
    command.args(["validate", "--machine-kind", "mill", "--deny-warnings", "--help"]);
    assert!(command.output().unwrap().status.success());
}
