//! Streams among each other and against the clock of the call.

use std::time::Duration;

use feedwave_contract::proto::{StreamSetpointsRequest, WatchJobsRequest};
use feedwave_tests::{Home, SHAFT_CURED, Server, header_of, long_dwell, patiently, stream, within_a_deadline};
use tonic::{Code, Request};

use crate::FEEDWAVE;
use crate::status::assert_error;

#[tokio::test]
async fn a_deadline_ends_a_stream_in_the_middle() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let job = clients.submit(&long_dwell(5_000)).await.job;
    let request = StreamSetpointsRequest { job: job.name, ..StreamSetpointsRequest::default() };
    let mut messages = within_a_deadline(async |deadline| {
        let mut messages = clients.setpoints.stream_setpoints(with_deadline(&request, deadline)).await?.into_inner();
        header_of(&mut messages).await?;
        Ok(messages)
    })
    .await;
    // Nothing is read until the service has given up.
    let web = server.web();
    let given_up =
        async { while !web.get("/metrics").await.text().lines().any(|line| line == "feedwave_active_streams 0") {} };
    patiently(given_up).await;
    let status = loop {
        match messages.message().await {
            Ok(Some(_)) => {}
            Ok(None) => panic!("the stream ended as if it were complete"),
            Err(status) => break status,
        }
    };
    assert_eq!(status.code(), Code::DeadlineExceeded, "{status:?}");

    let mut events = within_a_deadline(async |deadline| {
        let request = with_deadline(&WatchJobsRequest::default(), deadline);
        Ok(clients.jobs.watch_jobs(request).await?.into_inner())
    })
    .await;
    assert_error(&events.message().await.unwrap_err(), Code::DeadlineExceeded, "DEADLINE_EXCEEDED");
}

fn with_deadline<T: Clone>(request: &T, deadline: Duration) -> Request<T> {
    let mut request = Request::new(request.clone());
    request.set_timeout(deadline);
    request
}

#[tokio::test]
async fn slow_readers_stop_nobody_else() {
    let server = Server::start(FEEDWAVE).await;
    let mut slow_clients = server.connect().await;
    let long = slow_clients.submit(&long_dwell(3_000)).await.job;
    let short = slow_clients.submit(SHAFT_CURED).await.job;
    let request = StreamSetpointsRequest { job: long.name, ..StreamSetpointsRequest::default() };
    let mut unread = Vec::new();
    for _ in 0..4 {
        let mut clients = server.connect().await;
        let mut messages = clients.setpoints.stream_setpoints(request.clone()).await.unwrap().into_inner();
        header_of(&mut messages).await.unwrap();
        unread.push(messages);
    }
    // One more that is not read on the very connection that others use.
    let mut messages = slow_clients.setpoints.stream_setpoints(request).await.unwrap().into_inner();
    header_of(&mut messages).await.unwrap();
    unread.push(messages);

    let request = StreamSetpointsRequest { job: short.name, ..StreamSetpointsRequest::default() };
    let mut other_clients = server.connect().await;
    let beside = stream(&mut slow_clients, request.clone()).await.unwrap();
    let apart = stream(&mut other_clients, request).await.unwrap();
    assert!(beside.bits_from(0) == apart.bits_from(0));
    // And a slow reader gets everything in order.
    assert!(unread[0].message().await.unwrap().is_some());
}

#[tokio::test]
async fn more_streams_than_permitted_are_refused_until_one_ends() {
    let server = Home::new(FEEDWAVE, "[limits]\nconcurrent_streams = 2").start().await;
    let mut clients = server.connect().await;
    let job = clients.submit(&long_dwell(3_000)).await.job;
    let request = StreamSetpointsRequest { job: job.name, ..StreamSetpointsRequest::default() };
    let mut open = Vec::new();
    for _ in 0..2 {
        let mut messages = clients.setpoints.stream_setpoints(request.clone()).await.unwrap().into_inner();
        header_of(&mut messages).await.unwrap();
        open.push(messages);
    }
    let status = stream(&mut clients, request.clone()).await.unwrap_err();
    assert_error(&status, Code::ResourceExhausted, "OVERLOADED");
    // A client that disconnects frees its place; the service learns of it with the next packets.
    open.pop();
    let freed = async {
        loop {
            if let Ok(response) = clients.setpoints.stream_setpoints(request.clone()).await
                && header_of(&mut response.into_inner()).await.is_ok()
            {
                return;
            }
        }
    };
    patiently(freed).await;
}
