//! The HTTP port, polled as a dashboard polls.

use bytes::Bytes;
use feedwave_contract::proto::StreamSetpointsRequest;
use feedwave_contract::proto::stream_setpoints_response::Message;
use feedwave_tests::{SHAFT, Server, header_of, long_dwell, patiently};
use http::StatusCode;

use crate::FEEDWAVE;

#[tokio::test]
async fn jobs_and_their_reports_are_the_messages_of_the_contract_as_json() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit(SHAFT).await.job;
    let web = server.web();

    let list = web.get("/v1/jobs?states=ready").await;
    assert_eq!((list.status, list.header("content-type")), (StatusCode::OK, "application/json"));
    let list = list.json();
    assert_eq!(list["jobs"][0]["name"], job.name);
    assert_eq!(list["jobs"][0]["state"], "JOB_STATE_READY");
    assert_eq!(web.get("/v1/jobs?states=rejected").await.json()["jobs"].as_array().map_or(0, Vec::len), 0);

    let one = web.get(&format!("/v1/{}", job.name)).await.json();
    assert_eq!(one["machine"], "machines/lathe");
    // 64-bit numbers are texts in the protobuf mapping.
    assert_eq!(one["programBytes"], SHAFT.len().to_string());
    let report = web.get(&format!("/v1/{}/report", job.name)).await.json();
    let codes: Vec<_> = report["findings"].as_array().expect("findings").iter().map(|f| f["code"].clone()).collect();
    assert!(codes.iter().any(|code| code == "VIB-CHIP-UNBROKEN"), "{codes:?}");
}

#[tokio::test]
async fn what_has_not_changed_is_not_sent_again_and_cursors_name_what_is_new() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit("G0 X1. Z1.\nM30\n").await.job;
    let program = format!("/v1/{}", job.program);
    let web = server.web();
    // The state also counts the worker, which is at its job for a moment after the job is ready.
    let idle = async {
        while web.get("/v1/state").await.json()["activeValidations"].as_u64().is_some_and(|active| active > 0) {}
    };
    patiently(idle).await;

    let part = format!("{program}?offset=3&length=2");
    for path in ["/v1/jobs", "/v1/events", "/v1/state", &program, &part] {
        let first = web.get(path).await;
        let tag = first.header("etag").to_owned();
        assert!(tag.starts_with('"'), "{path}: {tag:?} is not a strong entity tag");
        let again = web.send("GET", path, &[("if-none-match", &tag)], Bytes::new()).await;
        assert_eq!((again.status, again.body.len()), (StatusCode::NOT_MODIFIED, 0), "{path}");
    }
    let before = web.get("/v1/events").await.json();
    let last = before["events"].as_array().and_then(|events| events.last()).expect("an event");
    let cursor = last["sequence"].as_str().expect("a cursor").to_owned();
    let old_tag = web.get("/v1/jobs").await.header("etag").to_owned();

    let job = clients.submit("G0 X2. Z1.\nM30\n").await.job;
    let changed = web.send("GET", "/v1/jobs", &[("if-none-match", &old_tag)], Bytes::new()).await;
    assert_eq!(changed.status, StatusCode::OK);
    let new = web.get(&format!("/v1/events?after={cursor}")).await.json();
    let states: Vec<_> = new["events"].as_array().expect("events").iter().map(|event| event["state"].clone()).collect();
    assert_eq!(states, ["JOB_STATE_PENDING", "JOB_STATE_VALIDATING", "JOB_STATE_READY"]);
    assert!(new["events"].as_array().expect("events").iter().all(|event| event["job"] == job.name));
}

#[tokio::test]
async fn what_cannot_be_answered_is_refused_in_the_same_vocabulary() {
    let server = Server::start(FEEDWAVE).await;
    let web = server.web();
    let cases = [
        ("/v1/jobs?pageSize=many&colour=red", StatusCode::BAD_REQUEST),
        ("/v1/jobs/7", StatusCode::BAD_REQUEST),
        ("/v1/jobs/01900000-0000-7000-8000-000000000001", StatusCode::NOT_FOUND),
        ("/v1/nothing", StatusCode::NOT_FOUND),
        ("/v1/jobs/%ff", StatusCode::BAD_REQUEST),
        // A parameter that a path does not have is refused before anything is looked for.
        ("/v1/jobs/01900000-0000-7000-8000-000000000001?colour=red", StatusCode::BAD_REQUEST),
        ("/v1/jobs/01900000-0000-7000-8000-000000000001/report?colour=red", StatusCode::BAD_REQUEST),
        ("/v1/runs/01900000-0000-7000-8000-000000000001?colour=red", StatusCode::BAD_REQUEST),
        ("/v1/machines/mill/state?colour=red", StatusCode::BAD_REQUEST),
        ("/v1/state?colour=red", StatusCode::BAD_REQUEST),
    ];
    for (path, status) in cases {
        let answer = web.get(path).await;
        assert_eq!(answer.status, status, "{path}: {answer:?}");
        let json = answer.json();
        assert!(json["code"].is_u64() && json["message"].is_string(), "{path}: {json}");
        let names_parameter = answer.text().contains("colour: is not a parameter");
        assert_eq!(names_parameter, path.contains("colour"), "{path}: {json}");
    }
    let posted = web.send("POST", "/v1/jobs", &[], Bytes::from_static(b"{}")).await;
    assert_eq!((posted.status, posted.header("allow")), (StatusCode::METHOD_NOT_ALLOWED, "GET,HEAD"));
    assert_eq!(posted.json()["details"][0]["reason"], "NOT_SERVED", "{posted:?}");
}

#[tokio::test]
async fn metrics_count_what_happens() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let web = server.web();
    for path in ["/healthz", "/readyz"] {
        assert_eq!(web.get(path).await.status, StatusCode::OK, "{path}");
    }
    let job = clients.submit(&long_dwell(3_000)).await.job;
    let request = StreamSetpointsRequest { job: job.name, ..StreamSetpointsRequest::default() };
    let mut open = clients.setpoints.stream_setpoints(request).await.expect("a stream").into_inner();
    header_of(&mut open).await.expect("a header");
    // More than one chunk, and far from the end: the rest waits to be read.
    let mut received = 0;
    while received < 20_000 {
        match open.message().await.expect("a chunk").and_then(|response| response.message) {
            Some(Message::Chunk(chunk)) => received += chunk.count,
            other => panic!("after the header come chunks, not {other:?}"),
        }
    }

    let answer = web.get("/metrics").await;
    assert!(answer.header("content-type").starts_with("text/plain"), "{:?}", answer.headers);
    let metrics = answer.text();
    let value = |start: &str| -> f64 {
        let line = metrics.lines().find(|line| line.starts_with(start)).unwrap_or_else(|| panic!("{start}: {metrics}"));
        line.rsplit(' ').next().and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("{line}"))
    };
    assert_eq!(value("feedwave_jobs{state=\"ready\"}"), 1.0);
    assert_eq!(value("feedwave_active_streams"), 1.0);
    assert!(value("feedwave_setpoints_total") >= f64::from(received), "{received}");
    assert_eq!(value("feedwave_build_info"), 1.0);
    for line in metrics.lines().filter(|line| !line.starts_with('#')) {
        assert!(line.starts_with("feedwave_") || line.starts_with("process_"), "{line}");
    }
    assert!(value("process_resident_memory_bytes") > 0.0);
}
