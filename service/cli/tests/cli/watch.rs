//! `feedwave watch` against a real service.

use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use serde_json::Value;

use super::service::Service;
use super::{code, feedwave, stderr, stdout};

const SLOT: &str = "G21 G90 G94 G17 S3000 M3\nG0 X10 Y0 Z0\nG1 X20 F1200\nM30\n";

/// A job that was run to its end on the machine `mill`.
fn finished(service: &Service) -> String {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("slot.nc");
    std::fs::write(&file, SLOT).unwrap();
    let submitted = service.run(&["submit", file.to_str().unwrap(), "--wait", "--machine", "mill"]);
    assert_eq!(code(&submitted), 0, "{}", stderr(&submitted));
    let job = stdout(&submitted).lines().last().unwrap().to_owned();
    let run = service.run(&["run", &job, "--simulate", "--cut", "3:0.2"]);
    assert_eq!(code(&run), 0, "{}{}", stdout(&run), stderr(&run));
    job
}

#[test]
fn once_shows_machines_and_jobs_as_they_are() {
    let service = Service::start();
    let idle = service.run(&["watch", "--once"]);
    assert_eq!(code(&idle), 0, "{}", stderr(&idle));
    let line = |text: &str, name: &str| {
        let line =
            text.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("{name} is not in\n{text}"));
        line.split_whitespace().map(str::to_owned).collect::<Vec<_>>()
    };
    assert!(stdout(&idle).lines().any(|line| line.split_whitespace().any(|word| word == "idle")), "{}", stdout(&idle));
    assert!(!stdout(&idle).contains('\u{1b}'), "no colours where there is no terminal");

    finished(&service);
    let states = stdout(&service.run(&["watch", "--once", "--format", "json"]));
    let states: Vec<Value> = states.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let mill = states.iter().find(|state| state["machine"] == "machines/mill").unwrap();
    assert_eq!(mill["execution"], "EXECUTION_FINISHED");
    let text = stdout(&service.run(&["watch", "--once"]));
    let name = mill["displayName"].as_str().filter(|name| !name.is_empty()).unwrap_or("mill");
    let words = line(&text, name);
    assert!(words.contains(&"finished".to_owned()) && words.contains(&"slot.nc".to_owned()), "{text}");
    assert_eq!(line(&text, "slot.nc")[1], "ready", "{text}");
}

#[test]
fn changes_come_as_lines() {
    let service = Service::start();
    let url = format!("http://{}", service.address());
    let mut watching = feedwave()
        .args(["watch", "--format", "json", "--interval", "0.1", "--server", &url])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(watching.stdout.take().unwrap()).lines();
    let mut next = |wanted: &str| loop {
        let state: Value = serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
        if state["machine"] == "machines/mill" && state["execution"] == wanted {
            return state;
        }
    };
    next("EXECUTION_IDLE");
    let job = finished(&service);
    assert_eq!(next("EXECUTION_FINISHED")["run"]["job"], Value::from(job));
    watching.kill().unwrap();
    watching.wait().unwrap();
}

#[test]
fn no_service_and_odd_intervals_are_wrong_usage() {
    let output = feedwave().args(["watch", "--once", "--server", "http://127.0.0.1:1"]).output().unwrap();
    assert_eq!(code(&output), 2, "{}", stdout(&output));
    for interval in ["0", "-1", "61", "nan", "x"] {
        let output = feedwave().args(["watch", &format!("--interval={interval}")]).output().unwrap();
        assert_eq!(code(&output), 2, "{interval}");
        assert!(stderr(&output).contains("from 0.1 to 60"), "{}", stderr(&output));
    }
}

#[test]
fn whoever_reads_changes_is_told_that_the_service_does_not_answer() {
    let service = Service::start();
    let url = format!("http://{}", service.address());
    let mut watching = feedwave()
        .args(["watch", "--format", "json", "--interval", "0.1", "--server", &url])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // It has begun once it has shown something.
    let mut shown = BufReader::new(watching.stdout.take().unwrap()).lines();
    assert!(shown.next().is_some_and(|line| line.unwrap().contains("execution")));
    drop(service);
    let said = BufReader::new(watching.stderr.take().unwrap()).lines().next().unwrap().unwrap();
    assert!(said.starts_with(&format!("{url} does not answer: ")) && said.ends_with("trying for 60 s"), "{said}");
    watching.kill().unwrap();
    watching.wait().unwrap();
}
