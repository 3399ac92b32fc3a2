//! Server-sent events: what happens comes once and in order, whatever became of the connection or of the service.

use feedwave_tests::{Home, Open, Server, ServerEvent, patiently};
use http::StatusCode;
use rustix::process::Signal;

use crate::FEEDWAVE;

const PROGRAM: &str = "G0 X1. Z1.\nM30\n";

/// The next event that is no state and no comment.
async fn next_logged(stream: &mut Open) -> ServerEvent {
    loop {
        let event = patiently(stream.next_event()).await.expect("the stream goes on");
        if !matches!(event.event.as_str(), "" | "state") {
            return event;
        }
    }
}

/// The states that a job goes through, in the events of a stream; with the ids of those.
async fn states_of(stream: &mut Open, job: &str) -> (Vec<String>, Vec<String>) {
    let (mut states, mut ids) = (Vec::new(), Vec::new());
    while states.last().is_none_or(|last| last != "JOB_STATE_READY") {
        let event = next_logged(stream).await;
        assert_eq!((event.event.as_str(), &event.data["job"]), ("job", &job.into()), "{event:?}");
        states.push(event.data["state"].as_str().expect("a state").to_owned());
        ids.push(event.id);
    }
    (states, ids)
}

#[tokio::test]
async fn the_first_words_are_the_states_of_all_machines() {
    let server = Server::start(FEEDWAVE).await;
    let mut stream = server.web().open("/v1/stream", &[]).await;
    assert_eq!(stream.status, StatusCode::OK);
    let header = |name: &str| stream.headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
    assert_eq!(header("content-type"), "text/event-stream");
    assert_eq!((header("cache-control"), header("x-accel-buffering")), ("no-cache", "no"));
    assert_eq!(header("content-length"), "");
    let first = patiently(stream.next_event()).await.expect("a greeting");
    assert!(!first.id.is_empty() && first.event.is_empty(), "{first:?}");
    for machine in ["machines/lathe", "machines/mill"] {
        let state = patiently(stream.next_event()).await.expect("a state");
        assert_eq!(state.event, "state");
        assert_eq!(state.data["machine"], machine);
        assert_eq!(state.data["execution"], "EXECUTION_IDLE");
        assert_eq!(state.data["availability"], "AVAILABILITY_UNAVAILABLE");
    }
}

#[tokio::test]
async fn a_client_that_comes_back_misses_nothing_and_hears_nothing_twice() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let mut stream = server.web().open("/v1/stream", &[]).await;
    let first = clients.submit(PROGRAM).await.job;
    let (states, ids) = states_of(&mut stream, &first.name).await;
    assert_eq!(states, ["JOB_STATE_PENDING", "JOB_STATE_VALIDATING", "JOB_STATE_READY"]);
    drop(stream);

    // Behind the second of three events, and what happened since.
    let second = clients.submit(PROGRAM).await.job;
    let mut again = server.web().open("/v1/stream", &[("last-event-id", &ids[1])]).await;
    let (rest, _) = states_of(&mut again, &first.name).await;
    assert_eq!(rest, ["JOB_STATE_READY"]);
    let (states, ids) = states_of(&mut again, &second.name).await;
    assert_eq!(states.len(), 3);

    // The log outlives the service.
    let server = server.kill().await.start().await;
    let mut after = server.web().open("/v1/stream", &[("last-event-id", &ids[0])]).await;
    let (rest, _) = states_of(&mut after, &second.name).await;
    assert_eq!(rest, states[1..]);
}

/// The id of the first words of a stream.
async fn first_id(server: &Server, tenant: &str) -> String {
    let named = [("x-feedwave-tenant", tenant)];
    let headers = if tenant.is_empty() { &[] } else { named.as_slice() };
    let mut stream = server.web().open("/v1/stream", headers).await;
    patiently(stream.next_event()).await.expect("a greeting").id
}

#[tokio::test]
async fn who_is_of_another_store_is_told_to_start_over() {
    let server = Server::start(FEEDWAVE).await;
    let elsewhere = first_id(&Server::start(FEEDWAVE).await, "").await;
    let own = first_id(&server, "").await;
    let (stamp, _) = own.split_once('-').expect("a stamp");
    let other_tenant = first_id(&server, "south").await;
    for id in [format!("{stamp}-99-0").as_str(), &format!("{stamp}-0-99"), &elsewhere, &other_tenant, "0-0", "nonsense"]
    {
        let mut stream = server.web().open("/v1/stream", &[("last-event-id", id)]).await;
        assert_eq!(next_logged(&mut stream).await.event, "reset", "{id}");
    }
    // Nothing is reset for who comes back.
    server.connect().await.submit(PROGRAM).await;
    let mut stream = server.web().open("/v1/stream", &[("last-event-id", &own)]).await;
    assert_eq!(next_logged(&mut stream).await.event, "job");
}

#[tokio::test]
async fn ids_say_nothing_of_what_other_tenants_do() {
    let server = Server::start(FEEDWAVE).await;
    let before = first_id(&server, "south").await;
    let mut stream = server.web().open("/v1/stream", &[]).await;
    let job = server.connect().await.submit(PROGRAM).await.job;
    let (_, ids) = states_of(&mut stream, &job.name).await;
    assert_eq!(first_id(&server, "south").await, before);
    assert_eq!(first_id(&server, "").await, *ids.last().expect("three events"));
}

#[tokio::test]
async fn a_quiet_stream_says_that_it_lives_and_ends_with_the_service() {
    let server = Home::new(FEEDWAVE, "").start().await;
    // The configuration has one section of a name only, so the heartbeat comes by the environment.
    let mut home = server.kill().await;
    home.set_environment(vec![("FEEDWAVE_HTTP__HEARTBEAT_S".to_owned(), "1".to_owned())]);
    let server = home.start().await;
    let mut stream = server.web().open("/v1/stream", &[]).await;
    // The greeting, and each comment with the place as well.
    let mut comments = 0;
    while comments < 3 {
        let event = patiently(stream.next_event()).await.expect("the stream goes on");
        let is_comment = event.event.is_empty() && event.data == ServerEvent::default().data;
        assert_eq!(is_comment, !event.id.is_empty(), "{event:?}");
        comments += u32::from(is_comment);
    }
    server.signal(Signal::TERM);
    while patiently(stream.next_event()).await.is_some() {}
    assert!(server.ended().await.0.success());
}

#[tokio::test]
async fn unknown_parameters_are_refused_and_answers_are_of_the_type_they_say() {
    let server = Server::start(FEEDWAVE).await;
    let web = server.web();
    for path in ["/v1/stream?machine=lathe", "/v1/machines/lathe/state?colour=red"] {
        let answer = web.get(path).await;
        assert_eq!(answer.status, StatusCode::BAD_REQUEST, "{path}");
        assert!(answer.text().contains("is not a parameter"), "{}", answer.text());
    }
    let answers = [web.get("/v1/machines").await, web.get("/v1/jobs/none").await, web.get("/v1/nothing").await];
    for answer in answers {
        assert_eq!(answer.header("x-content-type-options"), "nosniff", "{answer:?}");
    }
}

#[tokio::test]
async fn streams_of_one_client_are_bounded() {
    let server = Home::new(FEEDWAVE, "[connections]\nwatchers_per_client = 2\n").start().await;
    let web = server.web();
    let first = web.open("/v1/stream", &[]).await;
    let second = web.open("/v1/stream", &[]).await;
    assert_eq!((first.status, second.status), (StatusCode::OK, StatusCode::OK));
    let third = web.get("/v1/stream").await;
    assert_eq!(third.status, StatusCode::TOO_MANY_REQUESTS);
    assert!(third.text().contains("connections.watchers_per_client"), "{}", third.text());
    // Other requests have places of their own, and a stream that is left gives its place back.
    assert_eq!(web.get("/v1/machines").await.status, StatusCode::OK);
    drop(first);
    let admitted = async { while web.open("/v1/stream", &[]).await.status != StatusCode::OK {} };
    patiently(admitted).await;
}
