//! Streams among each other and against the clock of the call.

use std::time::Duration;

use feedwave::proto::{StreamSetpointsRequest, WatchJobsRequest};
use feedwave_tests::{Home, SHAFT_CURED, Server, header_of, long_dwell, stream};
use tonic::{Code, Request, Status};

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
    // Read slowly: one message, then nothing until the service has given up.
    let status = loop {
        match messages.message().await {
            Ok(Some(_)) => tokio::task::yield_now().await,
            Ok(None) => panic!("five million setpoints within the deadline"),
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

/// What is opened before its deadline has passed, which is as short as the machine is quick.
async fn within_a_deadline<T>(mut open: impl AsyncFnMut(Duration) -> Result<T, Status>) -> T {
    let mut deadline = Duration::from_millis(200);
    loop {
        match open(deadline).await {
            Ok(opened) => return opened,
            Err(status) if deadline < Duration::from_secs(60) => {
                assert!(matches!(status.code(), Code::DeadlineExceeded | Code::Cancelled), "{status:?}");
                deadline *= 2;
            }
            Err(status) => panic!("{status:?}"),
        }
    }
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
    // And whoever was slow finds everything in its place.
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
    // A client that goes away makes room; the service learns of it with the next packets.
    open.pop();
    for _ in 0..20_000 {
        if let Ok(response) = clients.setpoints.stream_setpoints(request.clone()).await
            && header_of(&mut response.into_inner()).await.is_ok()
        {
            return;
        }
        tokio::task::yield_now().await;
    }
    panic!("a dropped stream is never freed");
}
