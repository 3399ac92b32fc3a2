//! What a client can find out without knowing the service: health, reflection, gRPC-Web.

use bytes::{BufMut, Bytes, BytesMut};
use feedwave_contract::proto::{GetMachineRequest, GetMachineResponse};
use feedwave_tests::{Server, Web};
use http::StatusCode;
use prost::Message;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;

use crate::FEEDWAVE;

const SERVICES: [&str; 5] =
    ["feedwave.v1.Jobs", "feedwave.v1.Machines", "feedwave.v1.Setpoints", "feedwave.v1.Threads", "feedwave.v1.Tools"];

#[tokio::test]
async fn every_service_says_that_it_serves() {
    let server = Server::start(FEEDWAVE).await;
    let mut health = HealthClient::new(server.connect().await.channel);
    for service in SERVICES.into_iter().chain(["", "liveness"]) {
        let request = HealthCheckRequest { service: service.to_owned() };
        let response = health.check(request).await.unwrap_or_else(|status| panic!("{service}: {status:?}"));
        assert_eq!(response.into_inner().status(), ServingStatus::Serving, "{service}");
    }
    let unknown = HealthCheckRequest { service: "feedwave.v1.Nothing".to_owned() };
    assert_eq!(health.check(unknown).await.unwrap_err().code(), tonic::Code::NotFound);
}

/// Both versions of the reflection protocol have the same messages in packages of their own.
macro_rules! reflection_lists_the_services {
    ($test:ident, $version:ident) => {
        #[tokio::test]
        async fn $test() {
            use tonic_reflection::pb::$version::ServerReflectionRequest;
            use tonic_reflection::pb::$version::server_reflection_client::ServerReflectionClient;
            use tonic_reflection::pb::$version::server_reflection_request::MessageRequest;
            use tonic_reflection::pb::$version::server_reflection_response::MessageResponse;

            let server = Server::start(FEEDWAVE).await;
            let mut client = ServerReflectionClient::new(server.connect().await.channel);
            let ask = |message| ServerReflectionRequest { host: String::new(), message_request: Some(message) };
            let requests = vec![
                ask(MessageRequest::ListServices(String::new())),
                ask(MessageRequest::FileContainingSymbol("feedwave.v1.Setpoints".to_owned())),
            ];
            let response = client.server_reflection_info(futures_util::stream::iter(requests)).await.unwrap();
            let mut answers = response.into_inner();
            let Some(MessageResponse::ListServicesResponse(list)) =
                answers.message().await.unwrap().unwrap().message_response
            else {
                panic!("no list of services")
            };
            let names: Vec<&str> = list.service.iter().map(|service| service.name.as_str()).collect();
            for service in SERVICES.into_iter().chain(["grpc.health.v1.Health"]) {
                assert!(names.contains(&service), "{service} is not in {names:?}");
            }
            let Some(MessageResponse::FileDescriptorResponse(files)) =
                answers.message().await.unwrap().unwrap().message_response
            else {
                panic!("no descriptor of Setpoints")
            };
            assert!(!files.file_descriptor_proto.is_empty());
        }
    };
}

reflection_lists_the_services!(reflection_v1_lists_the_services, v1);
reflection_lists_the_services!(reflection_v1alpha_lists_the_services, v1alpha);

#[tokio::test]
async fn a_browser_speaks_grpc_web_over_http_1() {
    let server = Server::start(FEEDWAVE).await;
    let request = GetMachineRequest { name: "machines/lathe".to_owned() }.encode_to_vec();
    let mut body = BytesMut::new();
    body.put_u8(0);
    body.put_u32(u32::try_from(request.len()).unwrap());
    body.put_slice(&request);
    let headers = [("content-type", "application/grpc-web+proto"), ("x-grpc-web", "1")];
    let web = Web::new(server.grpc);
    let answer = web.send("POST", "/feedwave.v1.Machines/GetMachine", &headers, body.freeze()).await;
    assert_eq!(answer.status, StatusCode::OK);
    assert!(answer.header("content-type").starts_with("application/grpc-web"), "{answer:?}");
    let mut frames = frames(answer.body);
    let (flags, trailers) = frames.pop().expect("trailers");
    assert_eq!(flags, 0x80, "the last frame has the trailers");
    let trailers = String::from_utf8(trailers.to_vec()).unwrap();
    assert!(trailers.to_ascii_lowercase().replace(' ', "").contains("grpc-status:0"), "{trailers}");
    let [(0, message)] = frames.as_slice() else { panic!("{frames:?}") };
    let machine = GetMachineResponse::decode(message.clone()).unwrap().machine.unwrap();
    assert_eq!(machine.name, "machines/lathe");
}

/// Length-prefixed frames of a gRPC body: flags and content.
fn frames(mut body: Bytes) -> Vec<(u8, Bytes)> {
    let mut frames = Vec::new();
    while !body.is_empty() {
        let head = body.split_to(5);
        let length = u32::from_be_bytes([head[1], head[2], head[3], head[4]]) as usize;
        frames.push((head[0], body.split_to(length)));
    }
    frames
}
