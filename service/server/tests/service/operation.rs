//! Running the service: health, reflection, the HTTP port, limits, and its end.

use feedwave_contract::openapi::query_fields;
use feedwave_contract::proto::DESCRIPTORS;
use feedwave_contract::proto::{
    CreateMachineRequest, DeleteMachineRequest, GetJobRequest, ListMachinesRequest, Machine, WatchJobsRequest,
};
use feedwave_contract::routes::{ROUTES, Route};
use feedwave_server::config::Limits;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tonic::Code;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;

use crate::support::{TURNING, TestServer, eventually, header, lathe_job, patiently, resting, stream_of, told};

struct Answer {
    status: u16,
    headers: String,
    body: String,
}

impl Answer {
    fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.body).unwrap()
    }

    fn header(&self, name: &str) -> &str {
        let line = self.headers.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": "));
        line.unwrap_or_else(|| panic!("no {name} in {}", self.headers))
    }
}

/// One request over a connection of its own.
async fn http(test: &TestServer, method: &str, path: &str, more_headers: &str) -> Answer {
    let mut connection = TcpStream::connect(test.server.http_addr()).await.unwrap();
    let request = format!("{method} {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n{more_headers}\r\n");
    connection.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    patiently(connection.read_to_string(&mut answer)).await.unwrap();
    let (headers, body) = answer.split_once("\r\n\r\n").unwrap();
    let status = headers.split(' ').nth(1).unwrap().parse().unwrap();
    Answer { status, headers: headers.to_owned(), body: body.to_owned() }
}

async fn get(test: &TestServer, path: &str) -> Answer {
    http(test, "GET", path, "").await
}

#[tokio::test(flavor = "multi_thread")]
async fn every_route_of_the_table_is_served_and_takes_the_parameters_of_its_request() {
    let test = TestServer::start().await;
    for entry in &ROUTES {
        let is_of_one = entry.path.contains("{id}");
        // A name of its kind that nothing has.
        let id = match entry.route {
            Route::GetMachineState => "none".to_owned(),
            Route::ReadProgram => "0".repeat(64),
            _ => "00000000-0000-7000-8000-000000000000".to_owned(),
        };
        let path = entry.path.replace("{id}", &id);
        let fields = entry.parameters.map_or_else(Vec::new, |request| {
            let request = DESCRIPTORS.get_message_by_name(&format!("feedwave.v1.{request}")).unwrap();
            query_fields(&request).iter().map(|field| field.json_name().to_owned()).collect()
        });
        // Of all parameters only states have no empty value.
        let value = |name: &String| format!("{name}={}", if name == "states" { "ready" } else { "" });
        let query = fields.iter().map(value).collect::<Vec<_>>().join("&");
        // Server-sent events have no end.
        let method = if entry.route == Route::Follow { "HEAD" } else { "GET" };
        let answer = http(&test, method, &format!("{path}?{query}"), "").await;
        assert_eq!(answer.status, if is_of_one { 404 } else { 200 }, "{}: {}", entry.path, answer.body);
        if entry.parameters.is_some() {
            assert_eq!(get(&test, &format!("{path}?colour=red")).await.status, 400, "{}", entry.path);
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn dashboards_poll_jobs_reports_events_and_state() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(TURNING)).await;
    let id = job.name.strip_prefix("jobs/").unwrap();

    let list = get(&test, "/v1/jobs?states=ready&machine=machines/lathe&pageSize=10").await;
    assert_eq!(list.status, 200, "{}", list.body);
    assert_eq!(list.json()["jobs"][0]["name"], job.name);
    let one = get(&test, &format!("/v1/jobs/{id}")).await;
    assert_eq!(one.json()["state"], "JOB_STATE_READY");
    let count = job.summary.unwrap().setpoint_count;
    assert_eq!(one.json()["summary"]["setpointCount"], count.to_string());
    let report = get(&test, &format!("/v1/jobs/{id}/report")).await;
    assert_eq!(report.json()["sections"][0]["chip"]["broken"], true);
    let events = get(&test, "/v1/events?after=1").await;
    assert_eq!(events.json()["events"].as_array().unwrap().len(), 2);
    let state = get(&test, "/v1/state").await;
    assert_eq!(state.json()["jobs"][0], serde_json::json!({ "state": "JOB_STATE_READY", "count": "1" }));
    assert_eq!(state.json()["lastEvent"], events.json()["events"][1]["sequence"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_has_not_changed_is_not_sent_again() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(TURNING)).await;
    let path = format!("/v1/{}", job.name);
    let first = get(&test, &path).await;
    let tag = first.header("etag").to_owned();
    let again = http(&test, "GET", &path, &format!("if-none-match: {tag}\r\n")).await;
    assert_eq!((again.status, again.body.as_str(), again.header("etag")), (304, "", tag.as_str()));
    let head = http(&test, "HEAD", &path, "").await;
    assert_eq!((head.status, head.body.as_str(), head.header("etag")), (200, "", tag.as_str()));

    let request = feedwave_contract::proto::CancelJobRequest { name: job.name };
    test.jobs().cancel_job(request).await.unwrap();
    let changed = http(&test, "GET", &path, &format!("if-none-match: {tag}\r\n")).await;
    assert_eq!(changed.status, 200);
    assert_ne!(changed.header("etag"), tag);
}

#[tokio::test(flavor = "multi_thread")]
async fn http_errors_are_statuses_in_json() {
    let test = TestServer::start().await;
    let missing = get(&test, "/v1/jobs/01900000-0000-7000-8000-000000000000").await;
    assert_eq!((missing.status, &missing.json()["code"]), (404, &serde_json::json!(5)));
    assert_eq!(get(&test, "/nothing").await.status, 404);
    let wrong = get(&test, "/v1/jobs?colour=red&pageSize=x").await;
    assert_eq!((wrong.status, &wrong.json()["code"]), (400, &serde_json::json!(3)));
    // Fields are called as the query calls them, whoever finds the mistake.
    for path in ["/v1/jobs?pageSize=-1", "/v1/jobs?page_size=1"] {
        let wrong = get(&test, path).await.json();
        let named = path.split(['?', '=']).nth(1).expect("a parameter");
        assert_eq!(wrong["details"][1]["fieldViolations"][0]["field"], *named, "{path}: {wrong}");
    }
    let post = http(&test, "POST", "/v1/jobs", "content-length: 0\r\n").await;
    assert_eq!((post.status, post.header("allow")), (405, "GET,HEAD"));
    assert_eq!(post.json()["code"], 12);
}

#[tokio::test(flavor = "multi_thread")]
async fn metrics_count_calls_by_method_and_code() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(TURNING)).await;
    test.collect(stream_of(&job)).await;
    let name = "jobs/01900000-0000-7000-8000-000000000000".to_owned();
    test.jobs().get_job(GetJobRequest { name }).await.unwrap_err();
    // A call is counted when its response is gone, which may be after the client has read its end.
    eventually(|| test.server.metrics().active_requests.get() == 0).await;
    let metrics = get(&test, "/metrics").await.body;
    let count = job.summary.unwrap().setpoint_count;
    for line in [
        "feedwave_grpc_requests_total{code=\"NOT_FOUND\",method=\"/feedwave.v1.Jobs/GetJob\"} 1".to_owned(),
        "feedwave_grpc_requests_total{code=\"OK\",method=\"/feedwave.v1.Setpoints/StreamSetpoints\"} 1".to_owned(),
        "feedwave_validations_total{outcome=\"ready\"} 1".to_owned(),
        "feedwave_jobs{state=\"ready\"} 1".to_owned(),
        format!("feedwave_setpoints_total {count}"),
    ] {
        assert!(metrics.lines().any(|found| found == line), "no {line:?} in\n{metrics}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn asking_for_readiness_makes_no_work() {
    const REQUESTS: u64 = 500;
    let test = TestServer::start().await;
    // By itself the service reads every other second.
    let reads = || test.server.metrics().store_read_seconds.get_sample_count();
    let before = reads();
    for _ in 0..REQUESTS {
        assert_eq!(get(&test, "/readyz").await.status, 200);
    }
    assert!(reads() - before < REQUESTS / 2, "{} reads", reads() - before);
}

#[tokio::test(flavor = "multi_thread")]
async fn health_and_reflection_are_served() {
    let test = TestServer::start().await;
    let services = DESCRIPTORS.services().map(|service| service.full_name().to_owned());
    for service in services.chain([String::new()]) {
        let request = HealthCheckRequest { service: service.clone() };
        let response = HealthClient::new(test.channel.clone()).check(request).await.unwrap().into_inner();
        assert_eq!(response.status(), ServingStatus::Serving, "{service}");
    }
    assert_eq!(get(&test, "/readyz").await.status, 200);
    assert_eq!(get(&test, "/healthz").await.body, "ok\n");

    use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient as V1;
    use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
    use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;
    use tonic_reflection::pb::v1::{ServerReflectionRequest, ServerReflectionResponse};
    let request = ServerReflectionRequest {
        message_request: Some(MessageRequest::ListServices(String::new())),
        ..Default::default()
    };
    let mut responses =
        V1::new(test.channel.clone()).server_reflection_info(tokio_stream::once(request)).await.unwrap().into_inner();
    let ServerReflectionResponse { message_response: Some(MessageResponse::ListServicesResponse(list)), .. } =
        responses.message().await.unwrap().unwrap()
    else {
        panic!("no list of services")
    };
    let names: Vec<_> = list.service.iter().map(|service| service.name.as_str()).collect();
    assert!(names.contains(&"feedwave.v1.Setpoints") && names.contains(&"grpc.health.v1.Health"), "{names:?}");

    use tonic_reflection::pb::v1alpha;
    let request = v1alpha::ServerReflectionRequest {
        message_request: Some(v1alpha::server_reflection_request::MessageRequest::FileContainingSymbol(
            "feedwave.v1.Jobs".to_owned(),
        )),
        ..Default::default()
    };
    let mut responses = v1alpha::server_reflection_client::ServerReflectionClient::new(test.channel.clone())
        .server_reflection_info(tokio_stream::once(request))
        .await
        .unwrap()
        .into_inner();
    let response = responses.message().await.unwrap().unwrap().message_response.unwrap();
    assert!(matches!(response, v1alpha::server_reflection_response::MessageResponse::FileDescriptorResponse(_)));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_default_machines_exist_until_they_are_deleted() {
    let test = TestServer::start().await;
    let list = async |test: &TestServer| {
        let page = test.machines().list_machines(ListMachinesRequest::default()).await.unwrap().into_inner();
        page.machines.into_iter().map(|machine| machine.name).collect::<Vec<_>>()
    };
    assert_eq!(list(&test).await, ["machines/lathe", "machines/mill"]);
    let request = DeleteMachineRequest { name: "machines/mill".to_owned(), ..Default::default() };
    test.machines().delete_machine(request).await.unwrap();
    let folder = test.stop().await;
    let next = TestServer::in_folder(folder, Limits::default()).await;
    assert_eq!(list(&next).await, ["machines/lathe"]);

    let request = CreateMachineRequest { machine_id: "Bad Id".to_owned(), machine: Some(Machine::default()) };
    let status = next.machines().create_machine(request).await.unwrap_err();
    assert_eq!(told(&status).2, ["machine_id", "machine.profile"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn calls_beyond_the_limit_are_turned_away() {
    let test = TestServer::with_limits(Limits { concurrent_requests: 1, ..Limits::default() }).await;
    let watch = test.jobs().watch_jobs(WatchJobsRequest::default()).await.unwrap();
    let status = test.jobs().list_jobs(feedwave_contract::proto::ListJobsRequest::default()).await.unwrap_err();
    assert_eq!((told(&status).0, told(&status).1.as_str()), (Code::ResourceExhausted, "OVERLOADED"));
    // Health has a place of its own.
    HealthClient::new(test.channel.clone()).check(HealthCheckRequest::default()).await.unwrap();
    drop(watch);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_end_of_the_service_reaches_every_open_stream() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(&resting(4_000))).await;
    let mut setpoints = test.stream(stream_of(&job)).await.unwrap();
    header(&mut setpoints).await;
    let mut events = test.jobs().watch_jobs(WatchJobsRequest::default()).await.unwrap().into_inner();
    let shutdown = tokio::spawn(test.stop());
    let status = patiently(async {
        loop {
            if let Err(status) = setpoints.message().await {
                break status;
            }
        }
    })
    .await;
    assert_eq!((told(&status).0, told(&status).1.as_str()), (Code::Unavailable, "SERVER_DRAINING"));
    let status = patiently(events.message()).await.unwrap_err();
    assert_eq!(told(&status).1, "SERVER_DRAINING");
    patiently(shutdown).await.unwrap();
}
