//! The MTConnect agent, read as standard clients read it.

use bytes::Bytes;
use feedwave_contract::proto::RunReceipt;
use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::run_start::Target;
use feedwave_tests::{Home, Open, Server, Web, patiently};
use http::StatusCode;
use serde_json::Value;

use crate::FEEDWAVE;
use crate::shop_floor::{Live, monitored};

async fn agent(more: &str) -> (Server, Web) {
    let server = Home::new(FEEDWAVE, &format!("[mtconnect]\nlisten = '127.0.0.1:0'\n{more}")).start().await;
    let web = Web::new(server.mtconnect.expect("an agent"));
    (server, web)
}

/// The header of a document.
fn header<'a>(document: &'a Value, kind: &str) -> &'a Value {
    &document[format!("MTConnect{kind}")]["Header"]
}

/// Every observation of an item in a document, in the order of their sequence numbers: the value, or the name of the
/// element of a condition.
pub(crate) fn observed(document: &Value, item: &str) -> Vec<Value> {
    let mut found = Vec::new();
    let devices = document["MTConnectStreams"]["Streams"]["DeviceStream"].as_array().cloned().unwrap_or_default();
    for stream in devices.iter().flat_map(|device| device["ComponentStream"].as_array().cloned().unwrap_or_default()) {
        for category in ["Samples", "Events", "Condition"] {
            for (element, list) in stream[category].as_object().cloned().unwrap_or_default() {
                for entry in list.as_array().expect("a list").iter().filter(|entry| entry["dataItemId"] == item) {
                    let value = if category == "Condition" { element.clone().into() } else { entry["value"].clone() };
                    found.push((entry["sequence"].as_u64().expect("a number"), value));
                }
            }
        }
    }
    found.sort_by_key(|(sequence, _)| *sequence);
    found.into_iter().map(|(_, value)| value).collect()
}

/// What a probe of one device says of its spindle beside the data items.
fn spindle_specifications(probe: &Value) -> Value {
    let axes = &probe["MTConnectDevices"]["Devices"]["Device"][0]["Components"]["Axes"][0]["Components"];
    let rotary = axes["Rotary"].as_array().expect("axes that turn");
    let spindle = rotary.iter().find(|axis| axis["name"] == "S").expect("a spindle");
    spindle["Configuration"]["Specifications"].clone()
}

/// The next document of a stream, as JSON.
async fn next_document(stream: &mut Open) -> Option<Value> {
    let ends = |read: &[u8]| {
        let head_end = read.windows(4).position(|four| four == b"\r\n\r\n")? + 4;
        let head = std::str::from_utf8(&read[..head_end]).expect("a text");
        assert!(head.starts_with("--") && head.contains("Content-type: application/mtconnect+json\r\n"), "{head}");
        let length = head.split("Content-length: ").nth(1)?.split('\r').next()?.parse::<usize>().ok()?;
        let end = head_end + length + 2;
        (read.len() >= end).then_some(end)
    };
    let part = patiently(stream.next_part(ends)).await?;
    let text = std::str::from_utf8(&part).expect("a text");
    let document = text.split_once("\r\n\r\n").expect("a head").1;
    Some(serde_json::from_str(document).expect("JSON"))
}

#[tokio::test]
async fn there_is_no_agent_unless_it_is_wanted() {
    let server = Server::start(FEEDWAVE).await;
    assert_eq!(server.mtconnect, None);
}

#[tokio::test]
async fn the_agent_is_reached_by_its_own_names_alone() {
    let (_server, web) = agent("[auth]\nhosts = ['cell-4']\n").await;
    for (host, status) in [("evil.example", 403), ("localhost:5000", 200), ("127.0.0.1", 200), ("cell-4", 200)] {
        let answer = web.send("GET", "/current", &[("host", host)], Bytes::new()).await;
        assert_eq!(answer.status, status, "{host}");
        assert_eq!(answer.text().contains("UNAUTHORIZED"), status == 403, "{host}");
    }
}

#[tokio::test]
async fn documents_are_xml_or_json_and_errors_have_their_codes() {
    let (_server, web) = agent("").await;
    for path in ["/probe", "/", "/lathe", "/feedwave.mill/probe", "/current", "/sample", "/lathe/current?at=1"] {
        let answer = web.get(path).await;
        assert_eq!((answer.status, answer.header("content-type")), (StatusCode::OK, "application/xml"), "{path}");
        let kind = if path.contains("current") || path.contains("sample") { "Streams" } else { "Devices" };
        assert!(answer.text().contains(&format!("<MTConnect{kind} xmlns=")), "{path}: {}", answer.text());
        let answer = web.send("GET", path, &[("accept", "application/json")], Bytes::new()).await;
        assert_eq!(answer.header("content-type"), "application/mtconnect+json", "{path}");
        let document = answer.json();
        assert!(header(&document, kind)["instanceId"].as_u64() > Some(0), "{document}");
    }
    for (path, status, code) in [
        ("/nobody/current", StatusCode::NOT_FOUND, "NO_DEVICE"),
        ("/lathe/nothing", StatusCode::NOT_FOUND, "INVALID_URI"),
        ("/asset/7", StatusCode::NOT_FOUND, "UNSUPPORTED"),
        ("/sample?from=1000000", StatusCode::BAD_REQUEST, "OUT_OF_RANGE"),
        ("/sample?count=0", StatusCode::BAD_REQUEST, "OUT_OF_RANGE"),
        ("/sample?from=x", StatusCode::BAD_REQUEST, "INVALID_REQUEST"),
        ("/current?path=//////Linear", StatusCode::BAD_REQUEST, "INVALID_XPATH"),
        ("/current?path=//Linear[@name='W']", StatusCode::BAD_REQUEST, "INVALID_XPATH"),
    ] {
        let path = path.replace('[', "%5B").replace(']', "%5D").replace('\'', "%27");
        let answer = web.send("GET", &path, &[("accept", "application/json")], Bytes::new()).await;
        assert_eq!(answer.status, status, "{path}");
        assert_eq!(answer.json()["MTConnectError"]["Errors"]["Error"][0]["errorCode"], code, "{path}");
    }
    let posted = web.send("POST", "/probe", &[], Bytes::new()).await;
    assert_eq!((posted.status, posted.header("allow")), (StatusCode::METHOD_NOT_ALLOWED, "GET,HEAD"));
}

// One run, as a client of the standard meets it from its first request to the last.
#[tokio::test]
async fn a_client_follows_a_run_from_probe_to_its_end() {
    let (server, web) = agent("").await;
    let job = monitored(&server, crate::live_runs::config()).await;
    let current_before = web.get("/current?format=json").await.json();
    assert_eq!(observed(&current_before, "lathe_avail"), ["UNAVAILABLE"]);
    assert_eq!(observed(&current_before, "lathe_smode"), ["SPINDLE"]);
    let next = header(&current_before, "Streams")["nextSequence"].as_u64().expect("a number");
    let last = header(&current_before, "Streams")["lastSequence"].as_u64().expect("a number");
    assert_eq!(next, last + 1);
    let nothing = web.get(&format!("/sample?from={next}&format=json")).await.json();
    assert_eq!(nothing["MTConnectStreams"]["Streams"], serde_json::json!({}));

    let path = format!("/lathe/sample?from={next}&interval=0&heartbeat=1000&count=1000&format=json");
    let mut stream = web.open(&path, &[]).await;
    let content_type = stream.headers["content-type"].to_str().expect("a text").to_owned();
    assert!(content_type.starts_with("multipart/mixed;boundary="), "{content_type}");
    let mut live = Live::open(&server, Target::Job(job), 0).await;
    let mut executions = Vec::new();
    let mut follow = async |until: &str| {
        loop {
            let document = next_document(&mut stream).await.expect("the stream goes on");
            let new = observed(&document, "lathe_exec");
            executions.extend(new.iter().map(|value| value.as_str().expect("a word").to_owned()));
            if executions.iter().any(|execution| execution == until) {
                return executions.clone();
            }
        }
    };
    // States that follow one another at once are joined, so each is waited for.
    assert_eq!(follow("READY").await, ["READY"]);
    live.reach(600).await;
    live.take(500).await;
    live.measure(0..25).await;
    assert_eq!(follow("ACTIVE").await, ["READY", "ACTIVE"]);
    // What is shown is what the service says elsewhere.
    let shown = async {
        loop {
            let current = web.get("/lathe/current?format=json").await.json();
            let state = server.web().get("/v1/machines/lathe/state").await.json();
            let line = state["run"]["commanded"]["line"].clone();
            let conditions = observed(&current, "lathe_mot");
            if observed(&current, "lathe_line") == [line] && conditions.iter().any(|it| it == "Warning") {
                return (current, state);
            }
        }
    };
    let (current, state) = patiently(shown).await;
    assert_eq!(observed(&current, "lathe_avail"), ["AVAILABLE"]);
    assert_eq!(observed(&current, "lathe_a0pos"), [state["run"]["commanded"]["axes"][0]["position"].clone()]);
    assert_eq!(observed(&current, "lathe_sdef"), [state["run"]["process"]["maxDeviation"].clone()]);
    assert_eq!(observed(&current, "lathe_fovr"), [100.0]);
    // The limits that the deviation is held against are in the probe, while that run is connected.
    let process = &state["run"]["process"];
    let limits = serde_json::json!([{
        "id": "lathe_sdef_limits", "type": "DISPLACEMENT", "originator": "USER", "dataItemIdRef": "lathe_sdef",
        "units": "MILLIMETER", "ControlLimits": { "LowerLimit": process["lower"], "UpperLimit": process["upper"] },
    }]);
    let probe = web.get("/lathe/probe?format=json").await.json();
    assert_eq!(spindle_specifications(&probe)["ProcessSpecification"], limits);
    let changed = header(&probe, "Devices")["deviceModelChangeTime"].clone();
    assert_ne!(changed, header(&current_before, "Streams")["deviceModelChangeTime"]);
    let feed = state["run"]["commanded"]["feedMmPerMin"].as_f64().expect("a number");
    assert_eq!(observed(&current, "lathe_feed"), [feed / 60.0]);

    live.say(Request::Receipt(RunReceipt { received: live.received })).await;
    live.finish().await;
    assert_eq!(follow("UNAVAILABLE").await, ["READY", "ACTIVE", "PROGRAM_COMPLETED", "UNAVAILABLE"]);
    let current = web.get("/lathe/current?format=json").await.json();
    for item in ["lathe_avail", "lathe_line", "lathe_a0pos", "lathe_sdef", "lathe_fovr"] {
        assert_eq!(observed(&current, item), ["UNAVAILABLE"], "{item}");
    }
    assert_eq!(observed(&current, "lathe_mot"), ["Unavailable"]);
    let probe = web.get("/lathe/probe?format=json").await.json();
    assert_eq!(spindle_specifications(&probe), Value::Null);
    // Nothing new, but a sign of life.
    let quiet = next_document(&mut stream).await.expect("the stream goes on");
    assert_eq!(quiet["MTConnectStreams"]["Streams"], serde_json::json!({}));
}

#[tokio::test]
async fn streams_are_bounded_and_end_with_the_service() {
    let (server, web) = agent("streams = 1\n").await;
    let mut stream = web.open("/current?interval=50&format=json", &[]).await;
    assert_eq!(stream.status, StatusCode::OK);
    for _ in 0..2 {
        next_document(&mut stream).await.expect("the stream goes on");
    }
    let second = web.get("/sample?interval=0&format=json").await;
    assert_eq!(second.status, StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(second.json()["MTConnectError"]["Errors"]["Error"][0]["errorCode"], "TOO_MANY");
    server.signal(rustix::process::Signal::TERM);
    while next_document(&mut stream).await.is_some() {}
    assert!(server.ended().await.0.success());
}
