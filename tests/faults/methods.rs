//! Every method of the service, as reflection tells of them, with random messages: each answer is one of the contract's, and
//! the service is as good as before. `FEEDWAVE_FUZZ_REQUESTS` says how many.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use bytes::Bytes;
use feedwave_contract::proto::validate_program_request::On;
use feedwave_contract::proto::{GetMachineRequest, ValidateProgramRequest};
use feedwave_tests::{Chance, Raw, Server, patiently};
use prost::Message as _;
use prost_reflect::{
    DescriptorPool, DynamicMessage, FieldDescriptor, Kind, MapKey, MessageDescriptor, MethodDescriptor, Value,
};
use prost_types::FileDescriptorProto;
use tokio_stream::StreamExt as _;
use tonic::transport::Channel;
use tonic::{Code, Status};
use tonic_reflection::pb::v1::ServerReflectionRequest;
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;
use tonic_types::StatusExt as _;

use crate::FEEDWAVE;

/// Requests where nothing else is asked for; `tests/faults/long.sh` asks for 50 000.
const REQUESTS: u64 = 400;
/// Messages of one request in a stream.
const MOST_SENT: u64 = 3;
/// Messages read of one answer.
const MOST_READ: usize = 20;
/// After so long an answer that goes on, such as that of a watcher, is left.
const READ_TIME: Duration = Duration::from_millis(200);
/// Messages within each other.
const MOST_DEEP: u32 = 6;

/// A method: its path, its request and whether clients send a stream of them.
struct Method {
    path: String,
    request: MessageDescriptor,
    sends_many: bool,
}

/// Asks the reflection of a service.
struct Reflection(ServerReflectionClient<Channel>);

impl Reflection {
    async fn ask(&mut self, message: MessageRequest) -> MessageResponse {
        let request = ServerReflectionRequest { host: String::new(), message_request: Some(message) };
        let answers = self.0.server_reflection_info(tokio_stream::once(request)).await.expect("reflection");
        let answer = answers.into_inner().message().await.expect("reflection goes on").expect("an answer");
        answer.message_response.expect("it says something")
    }

    async fn file(&mut self, message: MessageRequest) -> FileDescriptorProto {
        let MessageResponse::FileDescriptorResponse(files) = self.ask(message).await else { panic!("no file") };
        FileDescriptorProto::decode(files.file_descriptor_proto[0].as_slice()).expect("a file")
    }
}

/// Every method of the service's own that it tells of.
async fn methods(channel: &Channel) -> Vec<Method> {
    let mut reflection = Reflection(ServerReflectionClient::new(channel.clone()));
    let MessageResponse::ListServicesResponse(listed) =
        reflection.ask(MessageRequest::ListServices(String::new())).await
    else {
        panic!("no list of services")
    };
    let own: Vec<String> =
        listed.service.into_iter().map(|service| service.name).filter(|name| name.starts_with("feedwave.")).collect();
    let mut files = BTreeMap::new();
    for name in &own {
        let file = reflection.file(MessageRequest::FileContainingSymbol(name.clone())).await;
        files.insert(file.name().to_owned(), file);
    }
    // What a file needs comes as files of its own.
    loop {
        let needed = files.values().flat_map(|file| file.dependency.iter());
        let Some(name) = needed.into_iter().find(|name| !files.contains_key(*name)).cloned() else { break };
        files.insert(name.clone(), reflection.file(MessageRequest::FileByFilename(name)).await);
    }
    let mut pool = DescriptorPool::new();
    pool.add_file_descriptor_protos(files.into_values()).expect("files that fit each other");
    let of_service = |name: &String| {
        let service = pool.get_service_by_name(name).expect("the service that was listed");
        let method = |method: MethodDescriptor| Method {
            path: format!("/{}/{}", service.full_name(), method.name()),
            request: method.input(),
            sends_many: method.is_client_streaming(),
        };
        service.methods().map(method).collect::<Vec<_>>()
    };
    own.iter().flat_map(of_service).collect()
}

/// Random messages.
struct Messages {
    chance: Chance,
    /// Texts that mean something somewhere.
    texts: Vec<String>,
}

impl Messages {
    fn one_in(&mut self, most: u64) -> bool {
        self.chance.up_to(most) == 1
    }

    fn message(&mut self, descriptor: &MessageDescriptor, depth: u32) -> DynamicMessage {
        let mut message = DynamicMessage::new(descriptor.clone());
        for field in descriptor.fields() {
            if self.one_in(2) && depth < MOST_DEEP {
                let value = self.field(&field, depth);
                message.set_field(&field, value);
            }
        }
        message
    }

    fn field(&mut self, field: &FieldDescriptor, depth: u32) -> Value {
        if field.is_map() {
            let Kind::Message(entry) = field.kind() else { panic!("{field:?} is a map of no messages") };
            let value = self.value(&entry.map_entry_value_field().kind(), depth + 1);
            let key = self.text();
            // Every map of the contract is by text; another one would fail here.
            return Value::Map([(MapKey::String(key), value)].into());
        }
        if field.is_list() {
            let count = if self.one_in(50) { 300 } else { self.chance.up_to(4) - 1 };
            return Value::List((0..count).map(|_| self.value(&field.kind(), depth + 1)).collect());
        }
        self.value(&field.kind(), depth)
    }

    fn value(&mut self, kind: &Kind, depth: u32) -> Value {
        let number = self.number();
        match kind {
            Kind::Double => Value::F64(self.real()),
            Kind::Float => Value::F32(self.real() as f32),
            Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 => Value::I32(number as i32),
            Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 => Value::I64(number as i64),
            Kind::Uint32 | Kind::Fixed32 => Value::U32(number as u32),
            Kind::Uint64 | Kind::Fixed64 => Value::U64(number),
            Kind::Bool => Value::Bool(self.one_in(2)),
            Kind::String => Value::String(self.text()),
            Kind::Bytes => Value::Bytes(self.text().into_bytes().into()),
            Kind::Enum(values) => {
                let known = values.values().count() as u64;
                let number = if self.one_in(10) { number as i32 } else { (self.chance.up_to(known) - 1) as i32 };
                Value::EnumNumber(number)
            }
            Kind::Message(message) => Value::Message(self.message(message, depth + 1)),
        }
    }

    fn number(&mut self) -> u64 {
        let edges = [0, 1, 2, 255, 1_000, i32::MAX as u64, u64::from(u32::MAX), i64::MAX as u64, u64::MAX];
        match self.chance.up_to(3) {
            1 => edges[self.chance.up_to(edges.len() as u64) as usize - 1],
            _ => self.chance.up_to(1_000) - 1,
        }
    }

    fn real(&mut self) -> f64 {
        let edges =
            [0.0, -0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN_POSITIVE, -1.0, 1e-9, 1e9];
        match self.chance.up_to(3) {
            1 => edges[self.chance.up_to(edges.len() as u64) as usize - 1],
            _ => self.chance.up_to(10_000) as f64 * 0.01,
        }
    }

    fn text(&mut self) -> String {
        let index = self.chance.up_to(self.texts.len() as u64) as usize - 1;
        let mut text = self.texts[index].clone();
        if self.one_in(6) {
            text.push(char::from_u32(self.chance.up_to(0x2_0000) as u32).unwrap_or('\u{fffd}'));
        }
        if self.one_in(60) {
            text = text.repeat(2_000);
        }
        text
    }
}

/// Sends a request, reads what comes for a while; how it ended.
async fn call(channel: &Channel, method: &Method, messages: Vec<Bytes>) -> Option<Status> {
    let mut client = tonic::client::Grpc::new(channel.clone()).max_decoding_message_size(64 << 20);
    client.ready().await.expect("the service is there");
    let path = method.path.parse().expect("a path");
    let request = tonic::Request::new(tokio_stream::iter(messages));
    let answer = tokio::time::timeout(READ_TIME * 300, client.streaming(request, path, Raw)).await;
    let mut answers = match answer.unwrap_or_else(|_| panic!("{} does not answer", method.path)) {
        Ok(answer) => answer.into_inner(),
        Err(status) => return Some(status),
    };
    for _ in 0..MOST_READ {
        match tokio::time::timeout(READ_TIME, answers.next()).await {
            Ok(Some(Ok(_))) => {}
            Ok(Some(Err(status))) => return Some(status),
            Ok(None) | Err(_) => return None,
        }
    }
    None
}

#[tokio::test(flavor = "multi_thread")]
async fn random_messages_to_every_method_are_answered_as_the_contract_says() {
    let requests = std::env::var("FEEDWAVE_FUZZ_REQUESTS").map_or(REQUESTS, |count| count.parse().expect("a number"));
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit("M30\n").await.job;
    let lathe = GetMachineRequest { name: "machines/lathe".to_owned() };
    let lathe = clients.machines.get_machine(lathe).await.expect("the lathe").into_inner().machine;
    let profile = lathe.and_then(|machine| machine.profile).expect("a profile");
    let texts =
        ["", "x", "machines/lathe", "machines/mill", "tools/none", "*", "display_name", "M30\n", "G1 X10 F100\nM30\n"];
    let mut texts: Vec<String> = texts.map(str::to_owned).to_vec();
    texts.extend([job.name.clone(), job.program.clone(), job.name.replace("jobs/", "runs/"), "9".repeat(64)]);
    let chance = Chance::new();
    let seed = chance.seed();
    let mut messages = Messages { chance, texts };
    let methods = methods(&clients.channel).await;
    let paths: BTreeSet<&str> = methods.iter().map(|method| method.path.as_str()).collect();
    assert!(paths.len() >= 40, "{paths:?}");
    let mut codes: BTreeMap<&'static str, u64> = BTreeMap::new();
    for number in 0..requests {
        let method = &methods[number as usize % methods.len()];
        let count = if method.sends_many { messages.chance.up_to(MOST_SENT + 1) - 1 } else { 1 };
        let mut sent: Vec<Bytes> =
            (0..count).map(|_| messages.message(&method.request, 0).encode_to_vec().into()).collect();
        if messages.one_in(20) {
            // What is no message at all.
            sent = sent.into_iter().map(|message| message.iter().rev().copied().collect()).collect();
        }
        let told = format!("request {number} of seed {seed}: {} with {sent:?}", method.path);
        match call(&clients.channel, method, sent).await {
            Some(status) => {
                let broken = [Code::Internal, Code::Unknown, Code::DataLoss, Code::Unavailable, Code::Cancelled];
                let reason = status.get_error_details().error_info().map(|info| info.reason.clone());
                // What cannot be decoded is told with INTERNAL by the transport, which is gRPC's own rule.
                let is_undecodable = reason.as_deref() == Some("REQUEST_BROKEN_OFF");
                assert!(!broken.contains(&status.code()) || is_undecodable, "{status:?}: {told}");
                assert!(reason.is_some(), "no ErrorInfo in {status:?}: {told}");
                *codes.entry(status.code().description()).or_default() += 1;
            }
            None => *codes.entry("answered").or_default() += 1,
        }
    }
    // As good as before, and nobody panicked on the way. The machine itself may have been deleted by one of them.
    let validate = ValidateProgramRequest {
        inline_program: Bytes::from_static(b"M30\n"),
        on: Some(On::Profile(profile)),
        ..ValidateProgramRequest::default()
    };
    let report = patiently(clients.jobs.validate_program(validate)).await.expect("a report").into_inner().report;
    let summary = report.and_then(|report| report.summary);
    assert!(summary.is_some_and(|summary| summary.errors == 0), "seed {seed}");
    let figures = server.web().get("/metrics").await;
    assert!(figures.text().lines().any(|line| line == "feedwave_panics_total 0"), "seed {seed}: {}", server.log());
    assert!(codes.len() > 2, "{codes:?}");
    println!("{requests} requests to {} methods, seed {seed}: {codes:?}", methods.len());
}
