//! `feedwave validate`: findings as people and programs read them, and exit codes.

use std::io::{Read as _, Write as _};
use std::process::Stdio;

use feedwave_contract::json;
use feedwave_contract::proto::ValidationReport;
use serde_json::Value;

use super::{code, feedwave, fixture, number, run, stderr, stdout, validate_json};

#[test]
fn json_is_the_message_of_the_contract_and_has_the_trap_with_its_cure() {
    let output = run(&[&"validate", &fixture("spec-trap.nc"), &"--format", &"json"]);
    assert_eq!(code(&output), 0, "a warning does not refuse the program");
    let message: ValidationReport = json::from_str(&stdout(&output)).unwrap();
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&json::to_string(&message)).unwrap(), report, "no other name");

    let finding = &report["findings"][0];
    let named = (finding["code"].as_str(), finding["severity"].as_str());
    assert_eq!(named, (Some("VIB-CHIP-UNBROKEN"), Some("SEVERITY_WARNING")));
    assert_eq!([&finding["line"], &finding["column"], &finding["length"]].map(Value::as_u64), [6, 6, 3].map(Some));
    assert_eq!(finding["suggestions"][0]["replacement"], "F41.667");

    let chip = &report["sections"][0]["chip"];
    assert_eq!(chip["vibrationsPerRev"], 3.0);
    assert_eq!(chip["broken"], false);
    assert_eq!(chip.get("minAmplitudeMm"), None);
    let recommended = chip["recommendedFrequenciesHz"][0].as_f64().unwrap();
    assert!((recommended - 125.0 / 3.0).abs() < 1e-9, "{recommended}");
    assert_eq!((number(&report["summary"]["errors"]), number(&report["summary"]["warnings"])), (0, 1));
}

#[test]
fn the_cured_program_has_nothing_to_find() {
    let (report, code) = validate_json(&fixture("spec-trap-cured.nc"));
    assert_eq!(code, 0);
    assert_eq!(report["findings"], Value::Array(Vec::new()));
    assert_eq!(report["sections"][0]["chip"]["broken"], true);
}

#[test]
fn a_finding_stands_under_its_column() {
    let output = run(&[&"validate", &fixture("spec-trap.nc")]);
    let text = stdout(&output);
    assert!(text.contains("spec-trap.nc:6:6]"), "{text}");
    let lines: Vec<_> = text.lines().collect();
    let source = lines.iter().position(|line| line.contains("│ G200 F50 A0.03")).unwrap();
    let column = |line: &str, wanted: char| line.chars().position(|character| character == wanted).unwrap();
    // "F50" is the first F of the line; the underline begins below it and is as long.
    assert_eq!(column(lines[source], 'F'), column(lines[source + 1], '─'));
    assert_eq!(lines[source + 1].matches('─').count(), 3);
    assert!(!text.contains('\u{1b}'), "no colour without a terminal");
    assert!(text.contains("help: vibrate at 41.667 Hz") && text.contains("F41.667"), "{text}");
    assert!(text.contains("does not break at any amplitude"), "{text}");
    assert!(text.trim_end().ends_with("accepted, 1 warning"), "{text}");
}

#[test]
fn every_mistake_is_reported_in_one_pass() {
    let output = run(&[&"validate", &fixture("bad.nc")]);
    assert_eq!(code(&output), 1);
    let text = stdout(&output);
    for code in ["PRG-NUMBER-INVALID", "PRG-UNKNOWN-CODE", "PRG-COMMENT-UNCLOSED", "VIB-NESTED", "VIB-OFF-WITHOUT-ON"] {
        assert!(text.contains(code), "{code} in {text}");
    }
    let (report, _) = validate_json(&fixture("bad.nc"));
    let findings = report["findings"].as_array().unwrap();
    assert_eq!(findings.len() as u64, number(&report["summary"]["errors"]) + 1);
    let lines: Vec<_> = findings.iter().map(|finding| finding["line"].as_u64().unwrap()).collect();
    assert!(lines.is_sorted());
}

#[test]
fn exit_codes_tell_apart_warnings_errors_and_trouble() {
    assert_eq!(code(&run(&[&"validate", &fixture("spec-trap-cured.nc"), &"--deny-warnings"])), 0);
    assert_eq!(code(&run(&[&"validate", &fixture("spec-trap.nc"), &"--deny-warnings"])), 1);
    assert_eq!(code(&run(&[&"validate", &fixture("pocket-mill.nc"), &"--machine-kind", &"mill"])), 0);
    assert_eq!(code(&run(&[&"validate", &fixture("facing-g96.nc")])), 0);
    for (arguments, wanted) in [
        (vec!["validate", "/no/such/file.nc"], "/no/such/file.nc: no such file or directory"),
        (vec!["validate", "/tmp"], "/tmp: is a directory"),
        (vec!["plan", "-", "--out", "x.txt"], "--out x.txt: must end in .csv or .parquet"),
        (vec!["plan", "-", "--out", "x.csv", "--servo-substeps"], "--servo-substeps needs --mode servo-side"),
        (vec!["stream", "jobs/x", "--server", "http://127.0.0.1:1"], "http://127.0.0.1:1: "),
    ] {
        let output = feedwave().args(&arguments).output().unwrap();
        assert_eq!(code(&output), 2, "{arguments:?}");
        let text = stderr(&output);
        assert!(text.starts_with("feedwave: ") && text.contains(wanted), "{arguments:?}: {text}");
        assert!(output.stdout.is_empty());
    }
    assert_eq!(code(&run(&[&"validate", &"-", &"--period-us", &"7"])), 2);
}

#[test]
fn standard_input_is_as_good_as_a_file() {
    let mut child = feedwave().args(["validate", "-"]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(&std::fs::read(fixture("spec-trap.nc")).unwrap()).unwrap();
    let output = child.wait_with_output().unwrap();
    let text = stdout(&output);
    assert!(text.contains("[standard input:6:6]") && text.contains("│ G200 F50 A0.03"), "{text}");
    assert_eq!(code(&output), 0);
}

#[test]
fn a_reader_that_stops_reading_ends_the_command_quietly() {
    let program = fixture("spec-trap-cured.nc");
    let mut child = feedwave()
        .arg("plan")
        .arg(program)
        .args(["--out", "-"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = [0_u8; 100];
    child.stdout.take().unwrap().read_exact(&mut first).unwrap();
    assert!(first.starts_with(b"index,time_s,"));
    // The pipe is closed now, long before the 8 MB that follow.
    let output = child.wait_with_output().unwrap();
    assert_eq!((code(&output), stderr(&output)), (0, String::new()));
}

#[test]
fn a_profile_changes_what_is_said() {
    let directory = tempfile::tempdir().unwrap();
    let profile = directory.path().join("slow.toml");
    std::fs::write(&profile, "[following]\nfilter_length_s = 0.02\n\n[vibration]\nmax_frequency_hz = 40.0\n").unwrap();
    let output = run(&[&"validate", &fixture("spec-trap.nc"), &"--profile", &profile]);
    assert_eq!(code(&output), 1, "50 Hz is beyond the profile's limit");
    std::fs::write(&profile, "[vibration]\nmax_frequency = 40.0\n").unwrap();
    let output = run(&[&"validate", &fixture("spec-trap.nc"), &"--profile", &profile]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("max_frequency"), "{}", stderr(&output));
}
