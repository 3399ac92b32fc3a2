//! Clients that take too much, send too little or do not read: they are bounded, and everybody else is served.

use std::net::SocketAddr;
use std::time::Duration;

use bytes::Bytes;
use feedwave_contract::proto::{ListJobsRequest, StreamSetpointsRequest, WatchJobsRequest};
use feedwave_tests::{Clients, Home, Raw, Server, header_of, long_dwell, patiently};
use http::uri::PathAndQuery;
use rustix::process::{Pid, Resource, Rlimit, prlimit};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpSocket, TcpStream};
use tonic::transport::Channel;
use tonic::{Code, Request};
use tonic_types::StatusExt as _;

use crate::FEEDWAVE;
use crate::status::assert_error;

/// A connection from another address of this machine: another client.
async fn from_another_address(to: SocketAddr) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind("127.0.0.2:0".parse().unwrap()).unwrap();
    socket.connect(to).await.unwrap()
}

/// Sends a request of HTTP/1.1 and returns what comes up to the end of the answer's head and as much of the body as is said.
async fn ask(connection: &mut TcpStream, path: &str) -> String {
    let request = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n");
    connection.write_all(request.as_bytes()).await.unwrap();
    answer(connection).await
}

async fn answer(connection: &mut TcpStream) -> String {
    let mut text = String::new();
    let mut buffer = [0; 4096];
    patiently(async {
        loop {
            let count = connection.read(&mut buffer).await.unwrap();
            text.push_str(&String::from_utf8_lossy(&buffer[..count]));
            if let Some((head, body)) = text.split_once("\r\n\r\n") {
                let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
                if length.is_none_or(|length| body.len() >= length.parse().unwrap()) {
                    break;
                }
            }
            assert!(count > 0, "the connection ended: {text:?}");
        }
    })
    .await;
    text
}

/// Waits until a figure is as it has to be.
async fn figure(server: &Server, name: &str, holds: impl Fn(f64) -> bool) {
    let web = server.web();
    let mut ticks = tokio::time::interval(Duration::from_millis(5));
    patiently(async {
        loop {
            ticks.tick().await;
            let figures = web.get("/metrics").await;
            let value =
                figures.text().lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' ')?.parse().ok());
            if value.is_some_and(&holds) {
                break;
            }
        }
    })
    .await;
}

async fn is_closed(mut connection: TcpStream) -> bool {
    let mut rest = Vec::new();
    // Reset or closed in order: both are an end.
    let _ = patiently(connection.read_to_end(&mut rest)).await;
    rest.is_empty() || !rest.starts_with(b"HTTP/1.1 200")
}

#[tokio::test]
async fn half_requests_and_idle_connections_are_closed() {
    let server = Home::new(FEEDWAVE, "[connections]\nheader_timeout_s = 1\nidle_timeout_s = 1").start().await;
    for port in [server.grpc, server.http] {
        for begun in ["", "P", "PRI * HTTP/2.0\r\n", "GET /healthz HT", "GET /healthz HTTP/1.1\r\nhost: x\r\n"] {
            let mut connection = TcpStream::connect(port).await.unwrap();
            connection.write_all(begun.as_bytes()).await.unwrap();
            assert!(is_closed(connection).await, "{begun:?}");
        }
    }
    // After a whole request, as well.
    let mut idle = TcpStream::connect(server.http).await.unwrap();
    assert!(ask(&mut idle, "/healthz").await.starts_with("HTTP/1.1 200"));
    assert!(is_closed(idle).await);
    // A watcher is not idle, however little happens.
    let mut clients = server.connect().await;
    let watch = WatchJobsRequest { after: Some(0), job: String::new() };
    let mut events = clients.jobs.watch_jobs(watch).await.unwrap().into_inner();
    let mut idle = TcpStream::connect(server.http).await.unwrap();
    assert!(ask(&mut idle, "/healthz").await.starts_with("HTTP/1.1 200"));
    assert!(is_closed(idle).await);
    let mut other = server.connect().await;
    other.create("M30\n").await.unwrap();
    patiently(events.message()).await.unwrap().unwrap();
}

#[tokio::test]
async fn one_client_cannot_take_every_connection() {
    let server = Home::new(FEEDWAVE, "[connections]\nper_client = 2").start().await;
    let mut first = TcpStream::connect(server.http).await.unwrap();
    let mut second = TcpStream::connect(server.grpc).await.unwrap();
    for connection in [&mut first, &mut second] {
        assert!(ask(connection, "/healthz").await.starts_with("HTTP/1.1 "));
    }
    // Over HTTP and over gRPC the refusal says why and when to come again.
    let mut third = TcpStream::connect(server.http).await.unwrap();
    let refused = ask(&mut third, "/v1/state").await;
    assert!(refused.starts_with("HTTP/1.1 429"), "{refused}");
    for part in ["retry-after: 1", "CLIENT_LIMIT", "connections.per_client"] {
        assert!(refused.contains(part), "{part} is not in {refused}");
    }
    assert!(is_closed(third).await);
    let status = Clients::connect(server.grpc).await.create("M30\n").await.unwrap_err();
    assert_error(&status, Code::ResourceExhausted, "CLIENT_LIMIT");
    // Somebody else has a share of his own.
    let mut other = from_another_address(server.http).await;
    assert!(ask(&mut other, "/v1/state").await.starts_with("HTTP/1.1 200"));
    // What is closed is free again.
    drop(first);
    patiently(async {
        loop {
            let mut again = TcpStream::connect(server.http).await.unwrap();
            if ask(&mut again, "/v1/state").await.starts_with("HTTP/1.1 200") {
                break;
            }
        }
    })
    .await;
}

#[tokio::test]
async fn watchers_of_one_client_leave_calls_and_other_watchers_their_places() {
    let limits = "[connections]\nwatchers_per_client = 2\nwatchers = 3\nstreams_per_client = 1";
    let server = Home::new(FEEDWAVE, limits).start().await;
    let mut clients = server.connect().await;
    let mut held = Vec::new();
    for _ in 0..2 {
        held.push(clients.jobs.watch_jobs(WatchJobsRequest::default()).await.unwrap());
    }
    let status = clients.jobs.watch_jobs(WatchJobsRequest::default()).await.unwrap_err();
    assert_error(&status, Code::ResourceExhausted, "CLIENT_LIMIT");
    clients.jobs.list_jobs(ListJobsRequest::default()).await.unwrap();
    held.clear();
    let outcome = clients.submit(&long_dwell(3_000)).await;
    let request = StreamSetpointsRequest { job: outcome.job.name, ..StreamSetpointsRequest::default() };
    let _open = clients.setpoints.stream_setpoints(request.clone()).await.unwrap();
    let status = clients.setpoints.stream_setpoints(request).await.unwrap_err();
    assert_error(&status, Code::ResourceExhausted, "CLIENT_LIMIT");
}

#[tokio::test]
async fn a_stream_that_nobody_reads_is_ended_with_the_reason() {
    let server = Home::new(FEEDWAVE, "[connections]\nunread_timeout_s = 1").start().await;
    let mut clients = server.connect().await;
    let job = clients.submit(&long_dwell(3_000)).await.job;
    let request = StreamSetpointsRequest { job: job.name, ..StreamSetpointsRequest::default() };
    let mut messages = clients.setpoints.stream_setpoints(request).await.unwrap().into_inner();
    header_of(&mut messages).await.unwrap();
    // What it was made of is gone before anybody reads on.
    figure(&server, "feedwave_unread_streams_ended_total", |count| count >= 1.0).await;
    figure(&server, "feedwave_active_streams", |count| count == 0.0).await;
    let status = patiently(async {
        loop {
            match messages.message().await {
                Ok(Some(_)) => {}
                Ok(None) => panic!("the stream ended as if it were complete"),
                Err(status) => break status,
            }
        }
    })
    .await;
    assert_error(&status, Code::ResourceExhausted, "STREAM_UNREAD");
}

/// Half of a head over HTTP/2 is cut off like half of one over HTTP/1, in whatever way it is held open; who only says
/// nothing is not.
#[tokio::test]
async fn half_a_head_of_http2_is_not_waited_for() {
    const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
    const SETTINGS: &[u8] = &[0, 0, 0, 4, 0, 0, 0, 0, 0];
    let server = Home::new(FEEDWAVE, "[connections]\nheader_timeout_s = 1").start().await;
    let mut clients = server.connect().await;
    clients.submit("M30\n").await;
    for half in [
        &[][..],
        // HEADERS of 100 bytes, of which none comes; and one that is to be continued and is not.
        &[0, 0, 100, 1, 4, 0, 0, 0, 1],
        &[0, 0, 1, 1, 0, 0, 0, 0, 1, 0x82],
        &[0, 0, 1, 1, 0, 0, 0, 0, 1, 0x82, 0, 0, 1, 9, 0, 0, 0, 0, 1],
    ] {
        for address in [server.grpc, server.http] {
            let mut connection = TcpStream::connect(address).await.unwrap();
            let settings = if half.is_empty() { &SETTINGS[..5] } else { SETTINGS };
            connection.write_all(&[PREFACE, settings, half].concat()).await.unwrap();
            let mut heard = Vec::new();
            // It ends, in whatever way the system tells it.
            let _ = patiently(connection.read_to_end(&mut heard)).await;
        }
    }
    figure(&server, "feedwave_connections_closed_total{reason=\"header_timeout\"}", |count| count >= 8.0).await;
    // The connection that was silent all the while.
    clients.submit("M30\n").await;
}

/// Half of a call: a message of which `sent` of `announced` bytes come.
async fn half_a_call(server: &Server, announced: u32, sent: usize) -> TcpStream {
    let mut connection = TcpStream::connect(server.grpc).await.unwrap();
    let head = format!(
        "POST /feedwave.v1.Jobs/CreateJob HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/grpc-web+proto\r\n\
         content-length: {}\r\n\r\n",
        announced + 5
    );
    connection.write_all(head.as_bytes()).await.unwrap();
    connection.write_all(&[0]).await.unwrap();
    connection.write_all(&announced.to_be_bytes()).await.unwrap();
    connection.write_all(&vec![0; sent]).await.unwrap();
    connection
}

#[tokio::test]
async fn bytes_of_requests_under_way_have_a_bound() {
    let limits = "[limits]\nmessage_bytes = 65536\ninline_program_bytes = 1024\n\
                  [connections]\nrequest_bytes = 65536\nrequest_bytes_per_client = 65536";
    let server = Home::new(FEEDWAVE, limits).start().await;
    let first = half_a_call(&server, 60_000, 40_000).await;
    figure(&server, "feedwave_request_bytes", |bytes| bytes >= 40_000.0).await;
    let mut second = half_a_call(&server, 60_000, 40_000).await;
    let refused = answer(&mut second).await;
    assert!(refused.contains("grpc-status: 8"), "{refused}");
    drop(first);
    figure(&server, "feedwave_request_bytes", |bytes| bytes == 0.0).await;
    server.connect().await.submit("M30\n").await;
}

#[tokio::test]
async fn messages_that_grow_when_they_are_read_are_refused_before() {
    // What a refused call still sends may come as slowly as the machine is busy.
    let server = Home::new(FEEDWAVE, "[connections]\nheader_timeout_s = 3600").start().await;
    let before = server.peak_resident_bytes();
    // As many files without name and content as 4 MB have space for: field 7, of length 0.
    let message = Bytes::from([7 << 3 | 2, 0].repeat(2_000_000));
    let calls = (0..16).map(|_| async {
        let channel = Channel::from_shared(format!("http://{}", server.grpc)).unwrap().connect().await.unwrap();
        let mut client = tonic::client::Grpc::new(channel);
        client.ready().await.unwrap();
        let method = PathAndQuery::from_static("/feedwave.v1.Programs/Interpret");
        client.server_streaming(Request::new(message.clone()), method, Raw).await.map(drop).unwrap_err()
    });
    let refused = patiently(futures_util::future::join_all(calls)).await;
    assert!(refused.iter().all(|status| status.code() == Code::ResourceExhausted), "{refused:?}");
    // Some are too many at once; the others would be too much alone.
    let too_costly = refused.iter().filter(|status| status.message().contains("once it is read")).collect::<Vec<_>>();
    assert!(!too_costly.is_empty(), "{refused:?}");
    for status in too_costly {
        assert_error(status, Code::ResourceExhausted, "MESSAGE_TOO_LARGE");
        assert!(status.get_error_details().retry_info().is_none(), "it is never taken: {status:?}");
    }
    let grown = server.peak_resident_bytes() - before;
    assert!(grown < 200 << 20, "{} MiB", grown >> 20);
    figure(&server, "feedwave_request_bytes", |bytes| bytes == 0.0).await;
    // Where the machine was busy with that alone, a database server may just have been too slow for its probe.
    let mut clients = server.connect().await;
    let served = async {
        while let Err(status) = clients.create("M30\n").await {
            assert_eq!(status.code(), Code::Unavailable, "{status:?}");
        }
    };
    patiently(served).await;
}

#[tokio::test]
async fn a_request_that_stalls_is_ended_with_the_reason() {
    let server = Home::new(FEEDWAVE, "[connections]\nrequest_timeout_s = 1").start().await;
    let mut stalled = half_a_call(&server, 1_000, 10).await;
    let ended = answer(&mut stalled).await;
    assert!(ended.contains("grpc-status: 4") && ended.contains("no%20further%20part"), "{ended}");
}

#[tokio::test]
async fn without_descriptors_connections_wait_and_are_served_later() {
    let server = Server::start(FEEDWAVE).await;
    let pid = i32::try_from(server.pid()).ok().and_then(Pid::from_raw);
    let mut known = TcpStream::connect(server.http).await.unwrap();
    assert!(ask(&mut known, "/healthz").await.starts_with("HTTP/1.1 200"));
    let before = prlimit(pid, Resource::Nofile, Rlimit { current: Some(3), maximum: None }).unwrap_or_else(|_| {
        // Without the right to raise the upper bound it stays as it is.
        let maximum = rustix::process::getrlimit(Resource::Nofile).maximum;
        prlimit(pid, Resource::Nofile, Rlimit { current: Some(3), maximum }).unwrap()
    });
    let mut waiting = TcpStream::connect(server.http).await.unwrap();
    patiently(async {
        while !ask(&mut known, "/metrics")
            .await
            .lines()
            .any(|line| line.strip_prefix("feedwave_accept_errors_total ").is_some_and(|count| count != "0"))
        {}
    })
    .await;
    prlimit(pid, Resource::Nofile, before).unwrap();
    assert!(ask(&mut waiting, "/healthz").await.starts_with("HTTP/1.1 200"));
    assert!(server.log().contains("connections cannot be accepted"), "{}", server.log());
}

#[tokio::test]
async fn connections_leave_the_store_its_descriptors() {
    let folder = tempfile::TempDir::new().unwrap();
    let limited = folder.path().join("limited");
    std::fs::write(&limited, format!("#!/bin/sh\nulimit -n 200\nexec '{FEEDWAVE}' \"$@\"\n")).unwrap();
    std::fs::set_permissions(&limited, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let server = Server::start(&limited).await;
    let mut clients = server.connect().await;
    let mut silent = Vec::new();
    for port in [server.grpc, server.http].repeat(150) {
        silent.extend(TcpStream::connect(port).await.ok());
    }
    assert!(silent.len() > 250, "the system has taken them");
    for _ in 0..32 {
        clients.create("M30\n").await.expect("the store has descriptors");
    }
    assert!(server.log().contains("connections.total is more than there are descriptors for"), "{}", server.log());
}
