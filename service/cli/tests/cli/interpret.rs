//! `feedwave interpret`, further program files, and programs in the style of posts.

use std::fs;
use std::path::PathBuf;

use feedwave_contract::json;
use feedwave_contract::proto::{Action, ActionKind};
use serde_json::Value;

use super::{code, fixture, run, stderr, stdout};

/// What is to be found in the posts that are refused.
const REFUSED: [(&str, &str); 3] = [
    ("fanuc-mill/macro-alarm.nc", "PRG-ALARM"),
    ("lathe/system-a-doubt.nc", "PRG-CODE-AMBIGUOUS"),
    ("linuxcnc/missing-sub-file.ngc", "PRG-SUBPROGRAM-MISSING"),
];

#[test]
fn an_action_a_line_as_the_contract_has_it() {
    let directory = tempfile::tempdir().unwrap();
    let program = directory.path().join("main.nc");
    let subs = directory.path().join("subs/deeper");
    fs::create_dir_all(&subs).unwrap();
    fs::write(&program, "G21 G90\nS500 M3\nG0 X10 Y0 Z5\nM98 P1000\nG4 P1500\nM30\n").unwrap();
    fs::write(subs.join("O1000.nc"), "G1 Z-2 F100\nG2 I-10 J0\nM99\n").unwrap();
    let include = directory.path().join("subs");
    let arguments: [&dyn AsRef<std::ffi::OsStr>; 8] =
        [&"interpret", &program, &"--machine-kind", &"mill", &"--include", &include, &"--format", &"jsonl"];
    let output = run(&arguments);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let actions: Vec<Action> = stdout(&output).lines().map(|line| json::from_str(line).unwrap()).collect();
    let kinds: Vec<_> = actions.iter().map(Action::kind).collect();
    assert_eq!(
        kinds,
        [ActionKind::Spindle, ActionKind::Rapid, ActionKind::Line, ActionKind::Arc, ActionKind::Dwell, ActionKind::End]
    );
    let arc = &actions[3];
    assert_eq!((arc.file.as_str(), arc.line, arc.arc.unwrap().center_first), ("deeper/O1000.nc", 2, 0.0));
    assert_eq!(arc.machine_end.unwrap().z, -2.0);

    // As text; without the file the finding names it and the exit code says so.
    let output = run(&arguments[..6]);
    assert!(stdout(&output).contains("deeper/O1000.nc:2  arc"), "{}", stdout(&output));
    let output = run(&arguments[..4]);
    assert_eq!(code(&output), 1);
    assert!(stderr(&output).contains("O1000"), "{}", stderr(&output));

    // Validated and planned alike.
    let table = directory.path().join("part.csv");
    let validated = run(&[&"validate", &program, &"--machine-kind", &"mill", &"--include", &include]);
    assert_eq!(code(&validated), 0, "{}", stdout(&validated));
    let arguments: [&dyn AsRef<std::ffi::OsStr>; 8] =
        [&"plan", &program, &"--machine-kind", &"mill", &"--include", &include, &"--out", &table];
    let planned = run(&arguments);
    assert_eq!(code(&planned), 0, "{}", stderr(&planned));
}

#[test]
fn findings_in_called_files_show_their_line_and_the_calls() {
    let directory = tempfile::tempdir().unwrap();
    let program = directory.path().join("main.nc");
    let sub = directory.path().join("subs");
    fs::create_dir(&sub).unwrap();
    fs::write(&program, "G21 G90\nG0 X10 Y0 Z5\nM98 P1000 L3\nM30\n").unwrap();
    fs::write(sub.join("O1000.nc"), "G1 Z1 F100\nG2 X20 Y5 I1 J0\nM99\n").unwrap();
    let output = run(&[&"interpret", &program, &"--machine-kind", &"mill", &"--include", &sub]);
    assert_eq!(code(&output), 1);
    let text = stderr(&output);
    for shown in ["PRG-ARC-RADIUS-MISMATCH", "G2 X20 Y5 I1 J0", "M98 P1000 L3", "called from here", "G1 Z1 F100"] {
        assert!(text.contains(shown), "{shown} in {text}");
    }
}

#[test]
fn posts_are_accepted_or_refused_with_the_named_finding() {
    let folder = fixture("posts");
    let mut programs: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            programs.extend(fs::read_dir(&path).unwrap().map(|program| program.unwrap().path()));
        }
    }
    programs.sort();
    assert!(programs.len() >= 70, "{}", programs.len());
    for program in programs {
        let machine = program.parent().unwrap();
        let profile = machine.with_extension("toml");
        let tools = folder.join(format!("{}-tools.toml", machine.file_name().unwrap().to_str().unwrap()));
        let output = run(&[&"validate", &program, &"--profile", &profile, &"--tools", &tools, &"--format", &"json"]);
        let report: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", stderr(&output)));
        let findings = report["findings"].as_array().unwrap().iter();
        let errors: Vec<_> = findings.filter(|finding| finding["severity"] == "SEVERITY_ERROR").collect();
        let name = program.strip_prefix(&folder).unwrap().to_string_lossy().replace('\\', "/");
        match REFUSED.iter().find(|(refused, _)| *refused == name) {
            Some((_, expected)) => {
                assert!(errors.iter().any(|finding| finding["code"] == *expected), "{name}: {errors:?}");
            }
            None => assert!(errors.is_empty(), "{name}: {errors:?}"),
        }
    }
}
