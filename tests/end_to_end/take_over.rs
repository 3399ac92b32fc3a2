//! A run that another client takes up while the former one is still connected: the former stream ends at once, and the
//! machine does what the run does.

use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::{
    Availability, Execution, MachineState, RunCommand, RunCommandKind, RunSettings, RunState, ingest_start,
};
use feedwave_tests::{LiveClient, Server};
use tonic::{Code, Status};

use crate::FEEDWAVE;

use crate::live_runs::{batch, config};
use crate::shop_floor::{Ingest, Watch, monitored};
use crate::status::assert_error;

/// The error that ends a stream whose client says nothing.
pub(crate) async fn error_of(client: &mut LiveClient) -> Status {
    loop {
        match client.next().await {
            Ok(ended) => assert_eq!(ended, None, "the run is another client's"),
            Err(status) => return status,
        }
    }
}

/// Holds the feed and takes what there is until the path rests; the state then.
pub(crate) async fn hold(client: &mut LiveClient, watch: &mut Watch) -> MachineState {
    let held = client.command(RunCommandKind::Hold).await.expect("the feed is held");
    client.credit(held.setpoint_index + 2_000).await;
    loop {
        tokio::select! {
            state = watch.until(|state| state.execution() == Execution::Held) => return state,
            ended = client.next() => {
                assert_eq!(ended.expect("the run goes on"), None);
                client.receipt().await;
            }
        }
    }
}

/// Aborts a run whose path rests, and waits for its end.
pub(crate) async fn abort(client: &mut LiveClient) {
    client.say(Request::Command(RunCommand { kind: RunCommandKind::Abort.into() })).await;
    loop {
        if let Some(ended) = client.next().await.expect("the run goes on to its end") {
            assert_eq!(ended.state(), RunState::Aborted);
            return;
        }
    }
}

fn has_taken(state: &MachineState, taken: u64) -> bool {
    let run = state.run.as_ref().expect("a run");
    run.progress.is_some_and(|progress| progress.taken == taken)
}

/// A run whose first client took 2 000 setpoints, and that a second one goes on with.
async fn taken_over(server: &Server, job: &str, watch: &mut Watch) -> (LiveClient, LiveClient) {
    let channel = server.connect().await.channel;
    let mut first = LiveClient::begin(channel, job, RunSettings::default()).await.expect("a run");
    first.reach(2_000).await.expect("setpoints");
    watch.until(|state| state.execution() == Execution::Running && has_taken(state, 2_000)).await;
    let channel = server.connect().await.channel;
    let second = LiveClient::take_up(channel, &first.started.run, 2_000).await.expect("the run is taken up");
    assert_error(&error_of(&mut first).await, Code::Aborted, "RUN_TAKEN_UP");
    (first, second)
}

#[tokio::test]
async fn a_live_run_is_that_of_the_client_that_took_it_up_last() {
    let server = Server::start(FEEDWAVE).await;
    let job = monitored(&server, config()).await;
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let (first, mut second) = taken_over(&server, &job, &mut watch).await;
    let state = hold(&mut second, &mut watch).await;
    assert_eq!((state.availability(), state.other_runs), (Availability::Available, 0));

    abort(&mut second).await;
    let state = watch.until(|state| state.execution() == Execution::Stopped).await;
    assert_eq!(state.other_runs, 0);
    // What the former client still says concerns nobody.
    first.credit(3_000).await;
    drop((first, second));
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let state = watch.until(|state| state.availability() == Availability::Unavailable).await;
    assert_eq!((state.execution(), state.finished_runs), (Execution::Stopped, 0));
    let run = &state.run.expect("a run").run;
    assert_eq!(server.web().get(&format!("/v1/{run}")).await.json()["activity"]["execution"], "EXECUTION_STOPPED");

    // One that comes to its end is counted once.
    let (_first, mut second) = taken_over(&server, &job, &mut watch).await;
    second.finish().await.expect("the run ends");
    let state = watch.until(|state| state.finished_runs == 1).await;
    let shown = (state.execution(), state.availability(), state.other_runs);
    assert_eq!(shown, (Execution::Finished, Availability::Unavailable, 0));
}

#[tokio::test]
async fn a_run_of_telemetry_is_that_of_the_client_that_took_it_up_last() {
    let server = Server::start(FEEDWAVE).await;
    let job = monitored(&server, config()).await;
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let mut first = Ingest::open(&server, job).await;
    for sequence in 0..25 {
        first.send(batch(sequence)).await;
    }
    watch.until(|state| state.run.as_ref().is_some_and(|run| run.process.is_some())).await;
    let second = Ingest::open_at(&server, ingest_start::Target::Run(first.run.clone())).await;
    assert_error(&first.error().await, Code::Aborted, "RUN_TAKEN_UP");
    second.send(batch(25)).await;
    let state = watch.until(|state| state.execution() == Execution::Running).await;
    assert_eq!((state.availability(), state.other_runs), (Availability::Available, 0));
    second.end().await;
    let state = watch.until(|state| state.finished_runs == 1).await;
    let shown = (state.execution(), state.availability(), state.other_runs);
    assert_eq!(shown, (Execution::Finished, Availability::Unavailable, 0));
}
