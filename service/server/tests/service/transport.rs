//! What holds for every method alike: compression, the largest message, and statuses that every client can read.

use bytes::Bytes;
use feedwave_contract::proto::{
    CreateJobRequest, FeedOverrideChange, GetMachineRequest, GetPlanSummaryRequest, IngestRequest, IngestStart,
    ListMachinesRequest, Machine, RunRequest, RunStart, StreamSetpointsRequest, UpdateMachineRequest,
    feed_override_change, ingest_request, ingest_start, run_request, run_start,
};
use feedwave_server::config::Limits;
use feedwave_server::error::MAX_STATUS_BYTES;
use prost::Message as _;
use prost_reflect::{DynamicMessage, Kind, MessageDescriptor, Value};
use tonic::{Code, Request, Status};
use tonic_types::StatusExt as _;

use crate::raw::{call, methods, outcome, path};
use crate::support::{TURNING, TestServer, lathe_job, patiently, stream_of, told};
use crate::telemetry::{config, monitored_job};

const GZIP: &str = "gzip";
/// Methods besides those of the contract.
const HEALTH: &str = "/grpc.health.v1.Health/Check";
/// Streams that stay silent until something happens.
const WATCHES: [&str; 2] = ["/feedwave.v1.Jobs/WatchJobs", "/feedwave.v1.Telemetry/WatchDecisions"];
const REFLECTION: [&str; 2] = [
    "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
    "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
];

fn all_paths() -> Vec<String> {
    let others = [HEALTH].into_iter().chain(REFLECTION).map(str::to_owned);
    methods().iter().map(path).chain(others).collect()
}

/// Bytes of message and details as they are sent.
fn sent_bytes(status: &Status) -> usize {
    let mut headers = http::HeaderMap::new();
    status.add_header(&mut headers).unwrap();
    ["grpc-message", "grpc-status-details-bin"]
        .iter()
        .filter_map(|&name| headers.get(name))
        .map(http::HeaderValue::len)
        .sum()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_method_reads_gzip() {
    let test = TestServer::start().await;
    for path in all_paths() {
        // An empty message is answered or refused for what it says.
        let outcome = if WATCHES.contains(&path.as_str()) {
            patiently(call(&test.channel, &path, vec![Bytes::new()], true)).await.map(drop)
        } else {
            patiently(outcome(&test.channel, &path, vec![Bytes::new()], true)).await
        };
        if let Err(status) = outcome {
            let expected = [Code::InvalidArgument, Code::NotFound];
            assert!(expected.contains(&status.code()), "{path}: {status:?}");
        }
    }
    // And what is in a compressed message is understood.
    let request = GetMachineRequest { name: "machines/lathe".to_owned() }.encode_to_vec();
    let machines = call(&test.channel, "/feedwave.v1.Machines/GetMachine", vec![request.into()], true).await.unwrap();
    assert_eq!(machines.metadata().get("grpc-encoding").unwrap(), GZIP);
    assert!(machines.into_inner().message().await.unwrap().unwrap().len() > 100);
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_are_compressed_where_asked_for_but_streams_of_a_machine_never() {
    let test = TestServer::start().await;
    let (_, job) = monitored_job(&test, config(), TURNING).await;
    let job = job.name;
    let run = RunStart { target: Some(run_start::Target::Job(job.clone())), ..Default::default() };
    let ingest = IngestStart { target: Some(ingest_start::Target::Job(job.clone())), ..Default::default() };
    let never = [
        (
            "/feedwave.v1.Setpoints/StreamSetpoints",
            StreamSetpointsRequest { job: job.clone(), ..Default::default() }.encode_to_vec(),
        ),
        ("/feedwave.v1.Runs/Run", RunRequest { message: Some(run_request::Message::Start(run)) }.encode_to_vec()),
        (
            "/feedwave.v1.Telemetry/Ingest",
            IngestRequest { message: Some(ingest_request::Message::Start(ingest)) }.encode_to_vec(),
        ),
    ];
    for (path, request) in never {
        let answer = call(&test.channel, path, vec![request.into()], true).await.unwrap();
        assert!(answer.metadata().get("grpc-encoding").is_none(), "{path}");
        assert!(patiently(answer.into_inner().message()).await.unwrap().is_some(), "{path}");
    }
    let summary = GetPlanSummaryRequest { job }.encode_to_vec();
    let asked = [
        ("/feedwave.v1.Setpoints/GetPlanSummary", summary),
        ("/feedwave.v1.Jobs/ListJobs", Vec::new()),
        ("/feedwave.v1.Jobs/WatchJobs", Vec::new()),
        ("/feedwave.v1.Machines/ListMachines", Vec::new()),
        ("/feedwave.v1.Tools/ListTools", Vec::new()),
        ("/feedwave.v1.Telemetry/ListRuns", Vec::new()),
        ("/feedwave.v1.Telemetry/WatchDecisions", Vec::new()),
        (HEALTH, Vec::new()),
        (REFLECTION[0], Vec::new()),
        (REFLECTION[1], Vec::new()),
    ];
    for (path, request) in asked {
        let answer = call(&test.channel, path, vec![request.clone().into()], true).await.unwrap();
        assert_eq!(
            answer.metadata().get("grpc-encoding").map(tonic::metadata::MetadataValue::as_bytes),
            Some(GZIP.as_bytes()),
            "{path}"
        );
        let plain = call(&test.channel, path, vec![request.into()], false).await.unwrap();
        assert!(plain.metadata().get("grpc-encoding").is_none(), "{path}");
    }
}

fn assert_too_large(what: &str, status: &Status, limit: usize) {
    let expected = (Code::ResourceExhausted, "MESSAGE_TOO_LARGE".to_owned());
    assert_eq!((told(status).0, told(status).1), expected, "{what}: {status:?}");
    let details = status.get_error_details();
    assert_eq!(details.error_info().unwrap().metadata["limit_bytes"], limit.to_string(), "{what}");
    assert_eq!(details.quota_failure().unwrap().violations[0].subject, "limits.message_bytes", "{what}");
    assert!(status.message().contains(&limit.to_string()), "{what}: {}", status.message());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_message_that_is_too_large_is_refused_by_every_method_plain_and_compressed() {
    let limit = 64 << 10;
    let limits = Limits { message_bytes: limit, inline_program_bytes: 1_000, ..Limits::default() };
    let test = TestServer::with_limits(limits).await;
    let status = test.jobs().create_job(lathe_job(&" ".repeat(1_001))).await.unwrap_err();
    assert_eq!(told(&status).2, ["inline_program"]);

    let plain = Bytes::from(vec![0; limit + 1]);
    let bomb = Bytes::from(vec![0; 16 << 20]);
    let mut state = 1_u64;
    let noise = std::iter::repeat_with(|| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 56) as u8
    });
    let incompressible = noise.take(limit + 1_000).collect::<Bytes>();
    for path in all_paths() {
        for (message, compressed) in [(&plain, false), (&bomb, true), (&incompressible, true)] {
            let outcome = patiently(outcome(&test.channel, &path, vec![message.clone()], compressed)).await;
            // Reflection, which is not ours, ends without an answer.
            if REFLECTION.contains(&path.as_str()) && outcome.is_ok() {
                continue;
            }
            assert_too_large(&path, &outcome.unwrap_err(), limit);
        }
    }
    // The connection is as good as before.
    test.machines().list_machines(ListMachinesRequest::default()).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_message_that_is_too_large_ends_an_open_stream_with_the_reason() {
    let limit = 64 << 10;
    let limits = Limits { message_bytes: limit, inline_program_bytes: 1_000, ..Limits::default() };
    let test = TestServer::with_limits(limits).await;
    let (_, job) = monitored_job(&test, config(), TURNING).await;
    let run = RunStart { target: Some(run_start::Target::Job(job.name.clone())), ..Default::default() };
    let ingest = IngestStart { target: Some(ingest_start::Target::Job(job.name)), ..Default::default() };
    let starts = [
        ("/feedwave.v1.Runs/Run", RunRequest { message: Some(run_request::Message::Start(run)) }.encode_to_vec()),
        (
            "/feedwave.v1.Telemetry/Ingest",
            IngestRequest { message: Some(ingest_request::Message::Start(ingest)) }.encode_to_vec(),
        ),
    ];
    for (path, start) in starts {
        let messages = vec![start.into(), vec![0; limit + 1].into()];
        let mut stream = call(&test.channel, path, messages, false).await.unwrap().into_inner();
        let status = patiently(async {
            loop {
                match stream.message().await {
                    Ok(Some(_)) => {}
                    Ok(None) => panic!("{path} ends without a word"),
                    Err(status) => break status,
                }
            }
        })
        .await;
        assert_too_large(path, &status, limit);
    }
}

/// A value of every field, as wrong and as long as can be; `pick` chooses among alternatives.
fn hostile(descriptor: &MessageDescriptor, pick: usize, depth: usize) -> DynamicMessage {
    let mut message = DynamicMessage::new(descriptor.clone());
    if depth == 0 {
        return message;
    }
    for field in descriptor.fields() {
        if let Some(oneof) = field.containing_oneof()
            && oneof.fields().nth(pick % oneof.fields().count()) != Some(field.clone())
        {
            continue;
        }
        let value = match field.kind() {
            Kind::Double => Value::F64([f64::NAN, -1e300, f64::INFINITY][pick % 3]),
            Kind::Float => Value::F32(f32::NAN),
            Kind::Bool => Value::Bool(true),
            Kind::String => Value::String("\u{1f529}\"% ".repeat(400)),
            Kind::Bytes => Value::Bytes(Bytes::from_static(&[0xff; 50])),
            Kind::Enum(_) => Value::EnumNumber(99_999),
            Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 => Value::I32(i32::MIN),
            Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 => Value::I64(i64::MIN),
            Kind::Uint32 | Kind::Fixed32 => Value::U32(u32::MAX),
            Kind::Uint64 | Kind::Fixed64 => Value::U64(u64::MAX),
            Kind::Message(inner) => Value::Message(hostile(&inner, pick, depth - 1)),
        };
        if field.is_map() {
            continue;
        }
        let value = if field.is_list() { Value::List(vec![value; if depth > 3 { 50 } else { 5 }]) } else { value };
        message.set_field(&field, value);
    }
    message
}

#[tokio::test(flavor = "multi_thread")]
async fn whatever_is_wrong_the_refusal_of_every_method_fits_into_the_trailers() {
    let test = TestServer::with_limits(Limits { message_bytes: 64 << 20, ..Limits::default() }).await;
    let mut refused = 0;
    for method in methods() {
        for pick in 0..3 {
            let request = Bytes::from(hostile(&method.input(), pick, 6).encode_to_vec());
            let path = path(&method);
            let Err(status) = patiently(outcome(&test.channel, &path, vec![request], true)).await else { continue };
            refused += 1;
            assert!(sent_bytes(&status) <= MAX_STATUS_BYTES, "{path}: {} bytes: {status:?}", sent_bytes(&status));
            assert_eq!(status.code(), Code::InvalidArgument, "{path}: {status:?}");
            let details = status.get_error_details();
            let listed = details.bad_request().unwrap_or_else(|| panic!("{path}")).field_violations.len();
            let not_listed = details.error_info().unwrap().metadata.get("violations_not_listed");
            assert!(listed > 0, "{path}");
            let said = status.message().rsplit_once("; and ").and_then(|(_, more)| more.strip_suffix(" more"));
            assert!(not_listed.is_none() || said.is_some(), "{path}: {not_listed:?} left out: {}", status.message());
        }
    }
    assert!(refused > methods().len(), "only {refused} requests were refused");
}

#[tokio::test(flavor = "multi_thread")]
async fn fifty_bad_tools_and_ten_thousand_bad_changes_are_invalid_arguments() {
    let test = TestServer::start().await;
    let tools =
        (0..50).map(|index| format!("tools/No Such Tool With A Long Name {index} {}", "x".repeat(200))).collect();
    let status = test.jobs().create_job(CreateJobRequest { tools, ..lathe_job(TURNING) }).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    assert!(sent_bytes(&status) <= MAX_STATUS_BYTES);
    let details = status.get_error_details();
    let listed = details.bad_request().unwrap().field_violations.len();
    assert_eq!(details.error_info().unwrap().metadata["violations_not_listed"], (50 - listed).to_string());

    let job = test.ready(lathe_job(TURNING)).await;
    let change = FeedOverrideChange { at: Some(feed_override_change::At::TimeS(0.0)), ratio: Some(3.0) };
    let request = StreamSetpointsRequest { overrides: vec![change; 10_000], ..stream_of(&job) };
    let status = test.stream(request).await.unwrap_err();
    let info = status.get_error_details().error_info().unwrap().clone();
    let listed = status.get_error_details().bad_request().unwrap().field_violations.len();
    assert_eq!(info.metadata["violations_not_listed"], (10_000 - listed).to_string());

    // A mask is a list, too.
    let paths = (0..5_000).map(|index| format!("profile.nothing_{index}")).collect();
    let machine = Some(Machine { name: "machines/lathe".to_owned(), ..Default::default() });
    let update_mask = Some(prost_types::FieldMask { paths });
    let status = test.machines().update_machine(UpdateMachineRequest { machine, update_mask }).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_transport_refuses_has_details_and_bounds_as_well() {
    let test = TestServer::start().await;
    let unknown = outcome(&test.channel, "/feedwave.v1.Jobs/Nothing", vec![Bytes::new()], false).await.unwrap_err();
    assert_eq!((told(&unknown).0, told(&unknown).1.as_str()), (Code::Unimplemented, "NOT_SERVED"));

    let mut request = Request::new(ListMachinesRequest::default());
    request.metadata_mut().insert("grpc-encoding", "x".repeat(6_000).parse().unwrap());
    let status = test.machines().list_machines(request).await.unwrap_err();
    assert_eq!(status.code(), Code::Unimplemented);
    assert!(sent_bytes(&status) <= MAX_STATUS_BYTES, "{}", sent_bytes(&status));

    // An id of the client's own comes back, but none that would fill the headers.
    for (id, comes_back) in [("job-4711".to_owned(), true), ("x".repeat(6_000), false)] {
        let mut request = Request::new(ListMachinesRequest::default());
        request.metadata_mut().insert("x-request-id", id.parse().unwrap());
        let answer = test.machines().list_machines(request).await.unwrap();
        let returned = answer.metadata().get("x-request-id").unwrap().to_str().unwrap();
        assert_eq!(returned == id, comes_back, "{returned}");
    }
}
