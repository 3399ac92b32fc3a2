//! How the service ends.

use feedwave_contract::proto::{GetJobRequest, JobState, StreamSetpointsRequest, WatchJobsRequest};
use feedwave_tests::{Home, header_of, long_dwell};
use rustix::process::Signal;
use tonic::Code;

use crate::FEEDWAVE;
use crate::status::assert_error;

async fn ends_gracefully_on(signal: Signal) {
    // The reader below takes its time, and gets it.
    let server = Home::new(FEEDWAVE, "[limits]\ndrain_s = 600").start().await;
    let mut clients = server.connect().await;
    let job = clients.submit(&long_dwell(3_000)).await.job;
    let request = StreamSetpointsRequest { job: job.name.clone(), ..StreamSetpointsRequest::default() };
    let mut messages = clients.setpoints.stream_setpoints(request).await.unwrap().into_inner();
    header_of(&mut messages).await.unwrap();
    let watch = WatchJobsRequest { after: None, job: String::new() };
    let mut events = clients.jobs.watch_jobs(watch).await.unwrap().into_inner();

    server.signal(signal);
    // The watch would wait forever and the stream is read by nobody for now: both are ended with a reason.
    assert_error(&events.message().await.unwrap_err(), Code::Unavailable, "SERVER_DRAINING");
    let status = loop {
        match messages.message().await {
            Ok(Some(_)) => {}
            Ok(None) => panic!("the stream ended as if it were complete"),
            Err(status) => break status,
        }
    };
    assert_error(&status, Code::Unavailable, "SERVER_DRAINING");
    let (exit, home) = server.ended().await;
    assert_eq!(exit.code(), Some(0), "{exit:?}");
    assert!(!home.path().join("ready.json").exists(), "it is ready no more");

    let server = home.start().await;
    let mut clients = server.connect().await;
    let job = clients.jobs.get_job(GetJobRequest { name: job.name }).await.unwrap().into_inner().job.unwrap();
    assert_eq!(job.state(), JobState::Ready);
}

#[tokio::test]
async fn sigterm_ends_open_streams_with_the_reason_and_the_process_with_0() {
    ends_gracefully_on(Signal::TERM).await;
}

#[tokio::test]
async fn sigint_does_the_same() {
    ends_gracefully_on(Signal::INT).await;
}

#[tokio::test]
async fn a_reader_that_never_reads_cannot_keep_the_service_alive() {
    let server = Home::new(FEEDWAVE, "[limits]\ndrain_s = 1").start().await;
    let mut clients = server.connect().await;
    let job = clients.submit(&long_dwell(3_000)).await.job;
    let request = StreamSetpointsRequest { job: job.name, ..StreamSetpointsRequest::default() };
    let unread = clients.setpoints.stream_setpoints(request).await.unwrap().into_inner();
    server.signal(Signal::TERM);
    let (exit, _home) = server.ended().await;
    assert_eq!(exit.code(), Some(0), "{exit:?}");
    drop(unread);
}
