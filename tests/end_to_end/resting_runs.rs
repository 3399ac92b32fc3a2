//! What is known of a run that nobody is connected to: as the log has it, whatever became of the service meanwhile.

use feedwave_contract::proto::machines_client::MachinesClient;
use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::{
    Availability, CreateMachineRequest, DeleteMachineRequest, Execution, GetMachineRequest, Machine, MachineState,
};
use feedwave_tests::{Server, patiently};
use http::StatusCode;

use crate::FEEDWAVE;
use crate::contact::apart;
use crate::live_runs::config;
use crate::shop_floor::{Live, Watch, monitored};

/// A run under half the feed that was left at a setpoint.
async fn left(server: &Server, job: &str, watch: &mut Watch) -> MachineState {
    let mut live = Live::open(server, Target::Job(job.to_owned()), 0).await;
    live.reach(600).await;
    live.take(500).await;
    live.measure(0..25).await;
    live.reach(3_000).await;
    live.take(3_000).await;
    let is_halved = |state: &MachineState| {
        let run = state.run.as_ref();
        let has_taken = run.and_then(|run| run.progress).is_some_and(|progress| progress.taken == 3_000);
        has_taken && run.and_then(|run| run.overrides).is_some_and(|overrides| overrides.feed < 1.0)
    };
    watch.until(is_halved).await;
    // Out of the cut nothing is waited for any more once the client is gone.
    live.say(Request::Batch(apart(25))).await;
    watch.until(|state| state.run.as_ref().is_some_and(|run| run.process.is_none())).await;
    drop(live);
    watch.until(|state| state.execution() == Execution::Interrupted).await
}

#[tokio::test]
async fn how_far_a_run_is_and_since_when_it_rests_is_the_same_after_a_restart() {
    let server = Server::start(FEEDWAVE).await;
    let job = monitored(&server, config()).await;
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let before = left(&server, &job, &mut watch).await;
    let progress = before.run.as_ref().and_then(|run| run.progress).expect("how far it is");
    assert!(progress.ratio > 0.0 && progress.ratio < 0.999, "{progress:?}");

    let server = server.kill().await.start().await;
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let after = watch.until(|_| true).await;
    assert_eq!((after.execution(), after.execution_time), (Execution::Interrupted, before.execution_time));
    let run = after.run.expect("a run");
    assert_eq!(run.progress, Some(progress));
    let live = Live::open(&server, Target::Run(run.run), 3_000).await;
    let again = watch.until(|state| state.availability() == Availability::Available).await;
    let again = again.run.and_then(|run| run.progress).expect("how far it is");
    assert_eq!((again.taken, again.ratio), (progress.taken, progress.ratio));

    live.finish().await;
    let before = watch.until(|state| state.finished_runs == 1).await;
    let server = server.kill().await.start().await;
    let after = Watch::open(&server, "machines/lathe").await.until(|_| true).await;
    assert_eq!((after.execution(), after.execution_time), (Execution::Finished, before.execution_time));
}

#[tokio::test]
async fn a_machine_that_is_made_again_has_its_runs_again() {
    let server = Server::start(FEEDWAVE).await;
    let job = monitored(&server, config()).await;
    let mut watch = Watch::open(&server, "machines/lathe").await;
    let before = left(&server, &job, &mut watch).await;
    let name = "machines/lathe".to_owned();
    let mut machines = MachinesClient::new(server.connect().await.channel);
    let lathe = machines.get_machine(GetMachineRequest { name: name.clone() }).await.expect("a machine").into_inner();
    let profile = lathe.machine.expect("a machine").profile;
    machines.delete_machine(DeleteMachineRequest { name, ..Default::default() }).await.expect("it is deleted");
    let web = server.web();
    patiently(async { while web.get("/v1/machines/lathe/state").await.status != StatusCode::NOT_FOUND {} }).await;

    let machine = Some(Machine { profile, ..Default::default() });
    let request = CreateMachineRequest { machine_id: "lathe".to_owned(), machine };
    machines.create_machine(request).await.expect("it is made again");
    let after = Watch::open(&server, "machines/lathe").await.until(|_| true).await;
    assert_eq!((after.execution(), after.execution_time), (Execution::Interrupted, before.execution_time));
    assert_eq!(after.run.map(|run| (run.run, run.progress)), before.run.map(|run| (run.run, run.progress)));
}
