//! What a machine shows of a cut is gone with the cut.

use feedwave_contract::proto::machine_event::Event;
use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::{Availability, Execution, MachineEvent, MachineState, TelemetryBatch};
use feedwave_tests::Server;

use crate::FEEDWAVE;
use crate::live_runs::{batch, config};
use crate::shop_floor::{Ingest, Live, Watch, monitored};

/// A batch in which tool and work do not touch.
pub(crate) fn apart(sequence: u64) -> TelemetryBatch {
    TelemetryBatch { contact: vec![false; 10], ..batch(sequence) }
}

fn warns(state: &MachineState) -> bool {
    state.conditions.iter().any(|condition| condition.code == "FEED_ABOVE_LIMIT")
}

fn is_judged(state: &MachineState) -> bool {
    state.run.as_ref().is_some_and(|run| run.process.is_some())
}

async fn metrics(server: &Server) -> String {
    server.web().get("/metrics").await.text().to_owned()
}

#[tokio::test]
async fn telemetry_out_of_the_cut_shows_neither_motion_nor_values() {
    let server = Server::start(FEEDWAVE).await;
    let job = monitored(&server, config()).await;
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let ingest = Ingest::open(&server, job).await;
    for sequence in 0..25 {
        ingest.send(batch(sequence)).await;
    }
    let state = watch.until(is_judged).await;
    assert!(state.execution() == Execution::Running && warns(&state), "{state:?}");
    let deflection = "feedwave_machine_deflection_meters{";
    assert!(metrics(&server).await.contains(deflection));

    ingest.send(apart(25)).await;
    let state = watch.until(|state| state.execution() == Execution::Ready).await;
    assert_eq!(state.availability(), Availability::Available);
    assert!(!is_judged(&state) && !warns(&state), "{state:?}");
    assert!(!metrics(&server).await.contains(deflection));

    // Back in the cut nothing is known before the first window is full.
    ingest.send(batch(26)).await;
    let state = watch.until(|state| state.execution() == Execution::Running).await;
    assert!(!is_judged(&state) && !warns(&state), "{state:?}");
    for sequence in 27..40 {
        ingest.send(batch(sequence)).await;
    }
    assert!(warns(&watch.until(is_judged).await));
    // Nor does anything hold that was measured against another baseline.
    let rebaseline = MachineEvent { event: Some(Event::Rebaseline(true)) };
    ingest.send(TelemetryBatch { events: vec![rebaseline], ..batch(40) }).await;
    let state = watch.until(|state| state.execution() == Execution::Ready).await;
    assert!(!is_judged(&state) && !warns(&state), "{state:?}");
}

#[tokio::test]
async fn a_live_run_goes_on_out_of_the_cut_without_the_values_of_the_cut() {
    let server = Server::start(FEEDWAVE).await;
    let job = monitored(&server, config()).await;
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let mut live = Live::open(&server, Target::Job(job), 0).await;
    live.reach(600).await;
    live.take(500).await;
    live.measure(0..25).await;
    let state = watch.until(is_judged).await;
    assert!(state.execution() == Execution::Running && warns(&state), "{state:?}");
    live.say(Request::Batch(apart(25))).await;
    let state = watch.until(|state| !is_judged(state)).await;
    assert!(state.execution() == Execution::Running && !warns(&state), "{state:?}");
}
