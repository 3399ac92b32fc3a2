//! Tool oscillation on the command line: machine and tools from files.

use std::path::Path;

use serde_json::Value;

use super::{code, fixture, run, stderr};

fn validate(program: &Path, tools: &Path, more: &[&str]) -> std::process::Output {
    let profile = fixture("oscillation-mill.toml");
    let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
        vec![&"validate", &program, &"--profile", &profile, &"--tools", &tools, &"--format", &"json"];
    arguments.extend(more.iter().map(|argument| argument as &dyn AsRef<std::ffi::OsStr>));
    run(&arguments)
}

#[test]
fn a_tool_library_makes_the_oscillation_possible() {
    let (program, tools) = (fixture("oscillation-mill.nc"), fixture("oscillation-tools.toml"));
    let output = validate(&program, &tools, &[]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let one = &report["oscillations"][0];
    assert_eq!((one["tool"].as_u64(), one["condition"].as_str()), (Some(4), Some("accuracy")));
    let areas = one["edges"].as_array().unwrap().iter().map(|edge| edge["areaMm2"].as_f64().unwrap());
    assert!((areas.sum::<f64>() - 1.03).abs() < 1e-9);
    for condition in ["P2", "P3"] {
        let directory = tempfile::tempdir().unwrap();
        let other = directory.path().join("other.nc");
        let text = std::fs::read_to_string(&program).unwrap();
        std::fs::write(&other, text.replace("P1", condition)).unwrap();
        assert_eq!(code(&validate(&other, &tools, &["--deny-warnings"])), 0, "{condition}");
    }
}

#[test]
fn what_is_wrong_with_a_tool_library_is_said_before_anything_is_read() {
    let directory = tempfile::tempdir().unwrap();
    let library = directory.path().join("tools.toml");
    let text = std::fs::read_to_string(fixture("oscillation-tools.toml")).unwrap();
    std::fs::write(&library, text.replace("radius_mm = 60", "radius_mm = 0")).unwrap();
    let output = validate(&fixture("oscillation-mill.nc"), &library, &[]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("tools.toml: tools[0].geometry.radius_mm: "), "{}", stderr(&output));
    let output = validate(&fixture("oscillation-mill.nc"), &fixture("oscillation-tools.toml"), &["--tool", "4=60"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("--tool 4: that tool is stated already"), "{}", stderr(&output));
    // Without cutting edges there is nothing that could oscillate.
    std::fs::write(&library, "[[tools]]\nnumber = 4\n").unwrap();
    let output = validate(&fixture("oscillation-mill.nc"), &library, &[]);
    assert_eq!(code(&output), 1);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let codes: Vec<_> = report["findings"].as_array().unwrap().iter().map(|finding| &finding["code"]).collect();
    assert!(codes.contains(&&Value::from("OSC-TOOL-UNKNOWN")), "{codes:?}");
}
