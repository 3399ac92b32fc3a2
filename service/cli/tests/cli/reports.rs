//! A program has one report: validated here, as a job, and over HTTP.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;

use serde_json::Value;

use super::service::Service;
use super::{code, feedwave, fixture, stderr, stdout};

/// A program with its machine in the service, and the options with which `validate` has the same machine.
struct Case {
    program: &'static str,
    machine: &'static str,
    tools: &'static [&'static str],
    local: Vec<String>,
}

fn case(program: &'static str, machine: &'static str, local: &[&str]) -> Case {
    Case { program, machine, tools: &[], local: local.iter().map(ToString::to_string).collect() }
}

fn cases() -> Vec<Case> {
    let file = |name: &str| fixture(name).display().to_string();
    let mut cases: Vec<Case> = [
        "spec-trap.nc",
        "spec-trap-cured.nc",
        "bad.nc",
        "facing-g96.nc",
        "thread-a.nc",
        "thread-b.nc",
        "turning-demo.nc",
    ]
    .map(|program| case(program, "lathe", &[]))
    .into();
    cases.extend(
        ["pocket-mill.nc", "contour-mill.nc"].map(|program| case(program, "mill", &["--machine-kind", "mill"])),
    );
    let five_axis = case("freeform.nc", "five-axis", &["--profile", &file("five-axis-mill.toml"), "--tool", "1=120"]);
    cases.push(Case { tools: &["tools/ball"], ..five_axis });
    let (profile, tools) = (file("oscillation-mill.toml"), file("oscillation-tools.toml"));
    let oscillating = case("oscillation-mill.nc", "oscillating", &["--profile", &profile, "--tools", &tools]);
    cases.push(Case { tools: &["tools/face-mill-120", "tools/face-mill-120-measured"], ..oscillating });
    cases
}

/// Gives the service the machines and tools of the files.
fn equip(service: &Service) {
    let file = |name: &str| fixture(name).display().to_string();
    let ball = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(&ball, "number = 1\nlength_mm = 120\n").unwrap();
    for arguments in [
        ["machine", "put", &file("five-axis-mill.toml"), "five-axis"].as_slice(),
        &["machine", "put", &file("oscillation-mill.toml"), "oscillating"],
        &["tool", "put", &file("oscillation-tools.toml")],
        &["tool", "put", ball.path().to_str().unwrap(), "ball"],
    ] {
        let output = service.run(arguments);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
    }
}

/// The paths of all fields that differ, with both values.
fn differences(path: &str, left: &Value, right: &Value, into: &mut Vec<String>) {
    match (left, right) {
        (Value::Object(left), Value::Object(right)) => {
            let names: std::collections::BTreeSet<_> = left.keys().chain(right.keys()).collect();
            for name in names {
                let of = |fields: &serde_json::Map<String, Value>| fields.get(name).cloned().unwrap_or_default();
                differences(&format!("{path}.{name}"), &of(left), &of(right), into);
            }
        }
        (Value::Array(left), Value::Array(right)) if left.len() == right.len() => {
            for (index, (left, right)) in left.iter().zip(right).enumerate() {
                differences(&format!("{path}[{index}]"), left, right, into);
            }
        }
        _ if left == right => {}
        _ => into.push(format!("{path}: {left} and {right}")),
    }
}

/// The body of an answer of the HTTP port.
fn get(service: &Service, path: &str) -> Value {
    let mut stream = TcpStream::connect(service.http_address()).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    assert!(head.starts_with("HTTP/1.1 200 "), "{answer}");
    serde_json::from_str(body).unwrap()
}

#[test]
fn a_program_has_the_same_report_here_as_a_job_and_over_http() {
    let service = Service::start();
    equip(&service);
    for Case { program, machine, tools, local } in cases() {
        let path = fixture(program).display().to_string();
        let tools: Vec<&str> = tools.iter().flat_map(|tool| ["--tool", tool]).collect();
        let both = |format: &str| {
            let here = feedwave().args(["validate", &path, "--format", format]).args(&local).output().unwrap();
            let submit = ["submit", &path, "--wait", "--machine", machine, "--format", format];
            let there = service.run(&[&submit[..], &tools].concat());
            assert!(code(&here) < 2, "{program}: {}", stderr(&here));
            assert_eq!(code(&here), code(&there), "{program}: {}{}", stderr(&here), stderr(&there));
            [stdout(&here), stdout(&there)]
        };
        let [here, there] = both("json").map(|json| serde_json::from_str::<Value>(&json).unwrap());
        let mut different = Vec::new();
        differences("report", &here, &there, &mut different);
        assert!(different.is_empty(), "{program}: here and there: {different:#?}");

        let [text_here, text_there] = both("text");
        let (text_there, job) = text_there.trim_end().rsplit_once('\n').unwrap();
        assert_eq!(text_there, text_here.trim_end(), "{program}");
        assert!(job.starts_with("jobs/"), "{program}: {job}");
        assert!(get(&service, &format!("/v1/{job}/report")) == here, "{program}: over HTTP");
    }
}
