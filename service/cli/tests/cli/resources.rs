//! `feedwave machine`, `feedwave tool` and `feedwave job` against a real service.

use serde_json::Value;

use super::service::{Service, path};
use super::{code, feedwave, stderr, stdout};

/// What a command that must succeed says.
fn ok(service: &Service, arguments: &[&str]) -> String {
    let output = service.run(arguments);
    assert_eq!(code(&output), 0, "{arguments:?}: {}", stderr(&output));
    stdout(&output)
}

/// What a command says that must end with 2.
fn refused(service: &Service, arguments: &[&str]) -> String {
    let output = service.run(arguments);
    assert_eq!((code(&output), stdout(&output)), (2, String::new()), "{arguments:?}: {}", stderr(&output));
    stderr(&output)
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

#[test]
fn a_machine_is_put_shown_changed_and_deleted() {
    let service = Service::start();
    let profile = path("five-axis-mill.toml");
    assert!(refused(&service, &["machine", "put", &profile]).contains("name: must be set, such as \"machines/my-1\""));
    assert!(refused(&service, &["machine", "put", &profile, "Mill 3"]).contains("lower-case letters"));
    let put = ["machine", "put", &profile, "mill-3", "--display-name", "Mill 3"];
    assert_eq!(ok(&service, &put), "machines/mill-3: created\n");
    // Without the option the name for people stays.
    assert_eq!(ok(&service, &put[..4]), "machines/mill-3: replaced\n");

    let shown = ok(&service, &["machine", "get", "mill-3"]);
    for words in ["machines/mill-3", "Mill 3", "mill", "up to 24000 rev/min", "-300 to 300  mm", "unlimited  deg"] {
        assert!(shown.contains(words), "{words:?} is not in\n{shown}");
    }
    let text = ok(&service, &["machine", "get", "machines/mill-3", "--format", "json"]);
    let machine = json(&text);
    assert_eq!(machine["displayName"], "Mill 3");
    assert_eq!(machine["profile"]["kinematics"]["chain"][1]["range"]["max"], 30.0);

    // What is shown is a file: for put, once, since the etag is then another; and for a local validation.
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("mill-3.json");
    let file_name = file.to_str().unwrap();
    std::fs::write(&file, text.replace("\"Mill 3\"", "\"Mill three\"")).unwrap();
    assert_eq!(ok(&service, &["machine", "put", file_name]), "machines/mill-3: replaced\n");
    assert!(ok(&service, &["machine", "get", "mill-3"]).contains("Mill three"));
    assert!(refused(&service, &["machine", "put", file_name]).contains("etag"));
    let other = refused(&service, &["machine", "put", file_name, "mill-4"]);
    assert!(other.contains("name: is machines/mill-3, not machines/mill-4"), "{other}");
    let validate = |profile: &str| {
        let program = path("freeform.nc");
        let output = feedwave().args(["validate", &program, "--profile", profile, "--tool", "1=120"]).output().unwrap();
        (code(&output), stdout(&output))
    };
    assert_eq!(validate(file_name), validate(&profile));

    let listed = ok(&service, &["machine", "list"]);
    assert_eq!(listed.lines().count(), 4, "{listed}");
    assert!(listed.contains("machines/mill-3               mill    X Y Z A C             Mill three\n"), "{listed}");
    let listed = json(&ok(&service, &["machine", "list", "--format", "json"]));
    assert_eq!((listed["machines"].as_array().unwrap().len(), &listed["nextPageToken"]), (3, &"".into()));

    let stale = machine["etag"].as_str().unwrap();
    assert!(refused(&service, &["machine", "delete", "mill-3", "--etag", stale]).contains("etag"));
    assert_eq!(ok(&service, &["machine", "delete", "mill-3"]), "machines/mill-3: deleted\n");
    assert_eq!(ok(&service, &["machine", "delete", "mill-3"]), "machines/mill-3: is not there, nothing deleted\n");
    assert!(refused(&service, &["machine", "get", "mill-3"]).contains("machines/mill-3"));
    let gone = refused(&service, &["machine", "put", file_name]);
    assert!(gone.contains("machines/mill-3 is not there any more; without etag"), "{gone}");
}

#[test]
fn a_machine_that_cannot_be_is_refused_before_it_is_sent() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("m.toml");
    let put = |text: &str| {
        std::fs::write(&file, text).unwrap();
        // There is no service: a file is read first.
        let arguments = ["machine", "put", file.to_str().unwrap(), "m", "--server", "http://127.0.0.1:1"];
        let output = feedwave().args(arguments).output().unwrap();
        assert_eq!(code(&output), 2);
        stderr(&output)
    };
    let two = put("[machine]\nkind = 'MACHINE_KIND_MILL'\n[vibration]\nmax_frequency_hz = -1\nmax_amplitude = 1\n");
    assert!(two.contains("m.toml: vibration.max_amplitude: is not a field of"), "{two}");
    let two = put("[machine]\nkind = 'MACHINE_KIND_MILL'\n[vibration]\nmax_frequency_hz = -1\nmax_amplitude_mm = 0\n");
    assert!(two.contains("m.toml: vibration.max_frequency_hz: must be") && two.contains("max_amplitude_mm: "), "{two}");
    let kind = put("[vibration]\nmax_frequency_hz = 100\n");
    assert!(kind.contains("m.toml: machine.kind: must be \"MACHINE_KIND_LATHE\" or"), "{kind}");
    let former = put("[machine]\nkind = 'mill'\n");
    assert!(former.contains("m.toml: machine.kind: must be \"MACHINE_KIND_MILL\", is \"mill\""), "{former}");
    assert!(put("[machine]\nkind = 'MACHINE_KIND_MILL'\n").contains("http://127.0.0.1:1"), "no service");
}

#[test]
fn axes_that_a_file_leaves_out_are_told_of() {
    let service = Service::start();
    let output = service.run(&["machine", "put", &path("oscillation-mill.toml"), "osc"]);
    assert_eq!((code(&output), stdout(&output)), (0, "machines/osc: created\n".to_owned()));
    let told = stderr(&output);
    assert!(told.contains("leaves out machine.axes, machine.max_spindle_rev_per_min: those of the generic"), "{told}");
}

#[test]
fn tools_are_put_shown_changed_and_deleted() {
    let service = Service::start();
    let library = path("oscillation-tools.toml");
    let created = "tools/face-mill-120: created\ntools/face-mill-120-measured: created\n";
    assert_eq!(ok(&service, &["tool", "put", &library]), created);
    assert_eq!(ok(&service, &["tool", "put", &library]), created.replace("created", "replaced"));
    assert!(refused(&service, &["tool", "put", &library, "x"]).contains("has 2 tools"));

    let shown = ok(&service, &["tool", "get", "face-mill-120"]);
    for words in ["tools/face-mill-120\n", "face mill, 120 mm, four edges\n", "68.4 mm", "120 mm", "edges          4\n"]
    {
        assert!(shown.contains(words), "{words:?} is not in\n{shown}");
    }
    // The whole library is a file, for put and for a local validation.
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("tools.json");
    let file_name = file.to_str().unwrap();
    std::fs::write(&file, ok(&service, &["tool", "list", "--format", "json"])).unwrap();
    let validate = |tools: &str| {
        let (program, profile) = (path("oscillation-mill.nc"), path("oscillation-mill.toml"));
        let output = feedwave().args(["validate", &program, "--profile", &profile, "--tools", tools]).output().unwrap();
        (code(&output), stdout(&output))
    };
    assert_eq!(validate(file_name), validate(&library));
    ok(&service, &["tool", "put", file_name]);
    assert!(refused(&service, &["tool", "put", file_name]).contains("etag"), "changed since the list");

    // One tool alone.
    let one = json(&ok(&service, &["tool", "get", "face-mill-120", "--format", "json"]));
    assert_eq!(one["geometry"]["radiusMm"], 60.0);
    std::fs::write(&file, r#"{"number": 7, "lengthMm": 100.5, "kind": "TOOL_KIND_DRILL"}"#).unwrap();
    assert!(refused(&service, &["tool", "put", file_name]).contains("name: must be set"));
    assert_eq!(ok(&service, &["tool", "put", file_name, "drill-7"]), "tools/drill-7: created\n");
    let listed = ok(&service, &["tool", "list"]);
    assert_eq!(listed.lines().count(), 4, "{listed}");
    assert!(listed.contains("tools/drill-7                      7       100.5  drill\n"), "{listed}");
    std::fs::write(&file, r#"{"tools": [{"name": "tools/a", "number": 1}, {"name": "tools/a", "number": 2}]}"#)
        .unwrap();
    assert!(refused(&service, &["tool", "put", file_name]).contains("tools/a is there twice"));
    std::fs::write(&file, r#"{"tools": [{"name": "tools/b", "number": 1}, {"name": "tools/c", "number": 0}]}"#)
        .unwrap();
    assert!(refused(&service, &["tool", "put", file_name]).contains("tools[1].number: must be 1 to 9999, is 0"));
    assert_eq!(ok(&service, &["tool", "list"]), listed, "a refused file changes nothing");

    assert_eq!(ok(&service, &["tool", "delete", "drill-7"]), "tools/drill-7: deleted\n");
    assert_eq!(ok(&service, &["tool", "delete", "drill-7"]), "tools/drill-7: is not there, nothing deleted\n");
    assert!(refused(&service, &["tool", "get", "drill-7"]).contains("drill-7"));
}

#[test]
fn jobs_are_listed_over_all_pages_shown_cancelled_and_deleted() {
    let service = Service::start();
    let job = ok(&service, &["submit", &path("spec-trap.nc"), "--wait"]).lines().last().unwrap().to_owned();
    let bad = service.run(&["submit", &path("bad.nc"), "--wait", "--machine", "machines/lathe"]);
    let bad = stdout(&bad).lines().last().unwrap().to_owned();

    let shown = ok(&service, &["job", "get", job.strip_prefix("jobs/").unwrap()]);
    for words in [job.as_str(), "spec-trap.nc", "ready", "machines/lathe", "0 errors"] {
        assert!(shown.contains(words), "{words:?} is not in\n{shown}");
    }
    let shown = json(&ok(&service, &["job", "get", &job, "--format", "json"]));
    assert_eq!((&shown["state"], &shown["name"]), (&"JOB_STATE_READY".into(), &job.as_str().into()));

    // Its program came with the request, and is found by the name of its file.
    let programs = json(&ok(&service, &["program", "list", "--file-name", "spec-trap.nc", "--format", "json"]));
    assert_eq!(programs["programs"].as_array().unwrap().len(), 1);
    assert_eq!(programs["programs"][0]["name"], shown["program"]);

    let names = |arguments: &[&str]| {
        let text = ok(&service, &[&["job", "list", "--format", "json"], arguments].concat());
        text.lines().map(|line| json(line)["name"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(names(&[]), [bad.clone(), job.clone()], "newest first");
    assert_eq!(names(&["--state", "ready", "--state", "failed"]), std::slice::from_ref(&job));
    assert_eq!(names(&["--machine", "mill"]), [""; 0]);
    let table = ok(&service, &["job", "list"]);
    assert_eq!(table.lines().count(), 3, "{table}");
    assert!(table.lines().nth(1).is_some_and(|line| line.starts_with(&bad) && line.contains("rejected")), "{table}");

    assert!(refused(&service, &["job", "cancel", &bad]).contains("rejected"));
    for _ in 0..2 {
        assert_eq!(ok(&service, &["job", "cancel", &job]), format!("{job}: cancelled\n"));
    }
    assert!(ok(&service, &["job", "get", &job]).contains("cancelled"));
    let stale = shown["etag"].as_str().unwrap();
    assert!(refused(&service, &["job", "delete", &job, "--etag", stale]).contains("etag"));
    assert_eq!(ok(&service, &["job", "delete", &job]), format!("{job}: deleted\n"));
    assert_eq!(ok(&service, &["job", "delete", &job]), format!("{job}: is not there, nothing deleted\n"));
    assert!(refused(&service, &["job", "get", &job]).contains("does not exist"));
    assert!(refused(&service, &["job", "get", "jobs/7"]).contains("jobs/{uuid}"));
}

#[test]
fn nothing_is_shown_before_the_service_has_answered() {
    let service = Service::start();
    let absent = "00000000-0000-7000-8000-000000000000";
    for name in [absent.to_owned(), format!("jobs/{absent}"), format!("runs/{absent}")] {
        assert!(refused(&service, &["decisions", &name]).contains("does not exist"), "{name}");
    }
    assert!(refused(&service, &["job", "list", "--machine", "Mill 3"]).contains("machine"));
    let job = ok(&service, &["submit", &path("spec-trap.nc")]);
    assert_eq!(ok(&service, &["decisions", job.trim_end()]).lines().count(), 1);
}

#[test]
fn lists_go_through_all_pages() {
    let service = Service::start();
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("tools.json");
    // More than a page has at most.
    let tools = (1..=510).map(|number| format!("{{\"name\": \"tools/t{number}\", \"number\": {number}}}"));
    std::fs::write(&file, format!("{{\"tools\": [{}]}}", tools.collect::<Vec<_>>().join(","))).unwrap();
    assert_eq!(ok(&service, &["tool", "put", file.to_str().unwrap()]).lines().count(), 510);
    assert_eq!(ok(&service, &["tool", "list"]).lines().count(), 511);
    let listed = json(&ok(&service, &["tool", "list", "--format", "json"]));
    let numbers: std::collections::BTreeSet<_> =
        listed["tools"].as_array().unwrap().iter().map(|tool| tool["number"].as_u64().unwrap()).collect();
    assert_eq!(numbers, (1..=510).collect());
    assert_eq!(listed["nextPageToken"], "");
}

#[test]
fn machines_of_more_than_four_mebibytes_are_listed() {
    let service = Service::start();
    // A profile with as many conditions as are permitted, each with the longest tables.
    let row = format!("{{ \"values\": [{}] }}", vec!["0.1"; 32].join(","));
    let numbers = (1..=32).map(|n| n.to_string()).collect::<Vec<_>>().join(",");
    let table = |quantity: &str| {
        format!(
            "{{ \"quantity\": \"TABLE_QUANTITY_{quantity}\", \"feed_mm_per_min\": [{numbers}],
               \"spindle_rev_per_min\": [{numbers}], \"rows\": [{}] }}",
            vec![row.as_str(); 32].join(",")
        )
    };
    let condition = |number: usize| {
        format!(
            "{{ \"name\": \"c{number}\", \"number\": {number}, \"periods_per_rev\": 1,
               \"feed\": {{ \"amplitude_mm\": 0.1 }}, \"axial\": {{ \"amplitude_mm\": 0.1 }},
               \"tables\": [{}, {}] }}",
            table("FEED_AMPLITUDE"),
            table("AXIAL_AMPLITUDE")
        )
    };
    let conditions = (1..=64).map(condition).collect::<Vec<_>>().join(",");
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("m.json");
    let kind = "\"machine\": { \"kind\": \"MACHINE_KIND_MILL\" }";
    std::fs::write(&file, format!("{{ {kind}, \"tool_oscillation\": [{conditions}] }}")).unwrap();
    for name in ["a", "b", "c", "d", "e"] {
        ok(&service, &["machine", "put", file.to_str().unwrap(), name]);
    }
    let listed = ok(&service, &["machine", "list", "--format", "json"]);
    let machines = json(&listed)["machines"].as_array().unwrap().clone();
    let cells = machines.iter().flat_map(|machine| machine["profile"]["toolOscillation"].as_array().unwrap());
    let cells = cells.flat_map(|condition| condition["tables"].as_array().unwrap()).map(|_| 32 * 32);
    assert!(machines.len() == 7 && cells.sum::<usize>() * 8 > 4 << 20, "a number takes 8 bytes on the wire");
}
