//! The floor without a service around it.

use feedwave_contract::names;
use feedwave_contract::proto::{Availability, ConditionSeverity, DecisionAction, Execution, RunProgress};
use feedwave_store::{
    Fingerprint, Job, JobFilter, JobState, NewJob, NewRun, PageRequest, RawValue, RetentionPolicy, Run, RunCommit,
    RunKind, RunOverride, RunSetpoints, RunState, Store, StoreSettings, Tenant,
};
use tokio_util::sync::CancellationToken;

use super::machine::MAX_CONDITIONS;
use super::presence::RunBase;
use super::*;
use crate::error::Error;
use crate::events::EventReader;

fn job(id: u128) -> Job {
    Job {
        id: Uuid::from_u128(id),
        sequence: 1,
        tenant: Tenant::DEFAULT,
        owner: String::new(),
        request_id: String::new(),
        display_name: "Shaft".to_owned(),
        program_id: "7".repeat(64).parse().unwrap(),
        program_size_bytes: 1,
        machine_id: "lathe".to_owned(),
        state: JobState::Ready,
        state_detail: String::new(),
        findings: None,
        summary: None,
        created_us: 0,
        updated_us: 0,
        revision: 1,
        attempts: 1,
    }
}

fn run(id: u128, sequence: i64, state: RunState) -> Run {
    Run {
        id: Uuid::from_u128(id),
        sequence,
        job_id: Uuid::from_u128(1),
        tenant: Tenant::DEFAULT,
        kind: RunKind::Live,
        state,
        state_detail: String::new(),
        created_us: 0,
        updated_us: 0,
        newest_batch: None,
        setpoints: RunSetpoints { received: 7, sent: 9, digest: None },
        settings: RawValue::from_string("{}".to_owned()).unwrap(),
        attachment: 1,
        open_conditions: 0,
    }
}

fn presence(floor: &Floor, id: u128, sequence: i64) -> Presence {
    let (job, run) = (job(1), run(id, sequence, RunState::Open));
    let base = RunBase {
        job: &job,
        run: &run,
        last_decision: None,
        changes: &[],
        overrides: &[],
        feed_held: false,
        conditions: &[],
        deviation_unit: "mm",
    };
    floor.presence(&base, 1).unwrap()
}

fn lathe(floor: &Floor) -> MachineState {
    floor.state("lathe").unwrap().state.clone()
}

#[test]
fn a_run_is_there_from_its_connection_to_its_end() {
    let floor = Floor::new();
    floor.put_machine("lathe", "1", "Lathe 1");
    assert_eq!((lathe(&floor).execution(), lathe(&floor).display_name.as_str()), (Execution::Idle, "Lathe 1"));
    let mut first = presence(&floor, 10, 1);
    assert!(lathe(&floor).run.is_none(), "it is not connected yet");
    first.connect();
    assert_eq!((lathe(&floor).execution(), lathe(&floor).availability()), (Execution::Ready, Availability::Available));
    first.end(RunState::Finished, Default::default());
    first.tell();
    first.leave(None);
    let state = lathe(&floor);
    assert_eq!((state.execution(), state.availability()), (Execution::Finished, Availability::Unavailable));
    assert_eq!(state.finished_runs, 1);
    drop(first);
    assert_eq!(lathe(&floor).finished_runs, 1, "it leaves once");
}

#[test]
fn the_newest_stream_is_shown_and_the_others_are_counted() {
    let floor = Floor::new();
    let (mut first, mut second) = (presence(&floor, 10, 1), presence(&floor, 20, 2));
    first.connect();
    second.connect();
    let shown = |floor: &Floor| (lathe(floor).run.map(|run| run.run), lathe(floor).other_runs);
    assert_eq!(shown(&floor), (Some(names::run(Uuid::from_u128(20))), 1));
    drop(second);
    assert_eq!(shown(&floor), (Some(names::run(Uuid::from_u128(10))), 0));
    drop(first);
    // A machine that is in no store is forgotten with its last run.
    assert!(floor.state("lathe").is_none());
}

#[test]
fn a_run_whose_client_is_gone_does_not_run() {
    let floor = Floor::new();
    let mut run = presence(&floor, 10, 1);
    run.connect();
    run.follow(Execution::Running);
    run.proceed(RunProgress::default(), None, 1.0, true);
    run.tell();
    assert!(lathe(&floor).run.unwrap().held);
    run.lose(Default::default());
    // What goes on while its silence is waited for is not told as motion.
    run.follow(Execution::Running);
    run.proceed(RunProgress::default(), None, 1.0, true);
    run.tell();
    let state = lathe(&floor);
    assert_eq!((state.execution(), state.availability()), (Execution::Interrupted, Availability::Unavailable));
    assert!(!state.run.unwrap().held);
    run.follow(Execution::Stopped);
    run.tell();
    assert_eq!(lathe(&floor).execution(), Execution::Stopped, "the decision on silence stops it");
    let mut over = presence(&floor, 20, 2);
    over.connect();
    over.end(RunState::Finished, Default::default());
    over.lose(Default::default());
    over.tell();
    assert_eq!(over.execution(), Execution::Finished);
}

#[test]
fn a_run_that_moves_is_shown_before_one_that_does_not_or_is_lost() {
    let floor = Floor::new();
    let (mut moving, mut ready, mut lost) = (presence(&floor, 10, 1), presence(&floor, 20, 2), presence(&floor, 30, 3));
    for run in [&mut moving, &mut ready, &mut lost] {
        run.connect();
    }
    let shown = |floor: &Floor| (lathe(floor).run.unwrap().run, lathe(floor).other_runs);
    let name = |id| names::run(Uuid::from_u128(id));
    lost.follow(Execution::Running);
    lost.tell();
    assert_eq!(shown(&floor), (name(30), 2));
    lost.lose(Default::default());
    lost.tell();
    assert_eq!(shown(&floor), (name(20), 1), "who is lost is neither shown nor counted");
    moving.follow(Execution::Running);
    moving.tell();
    assert_eq!((shown(&floor), lathe(&floor).execution()), ((name(10), 1), Execution::Running));
    drop(moving);
    drop(ready);
    assert_eq!(shown(&floor), (name(30), 0));
}

/// A decision of the log that stops the machine.
#[test]
fn of_lost_runs_the_newest_is_shown() {
    let floor = Floor::new();
    let (mut old, mut new) = (presence(&floor, 10, 1), presence(&floor, 20, 2));
    old.connect();
    old.follow(Execution::Running);
    old.lose(Default::default());
    old.tell();
    new.connect();
    new.follow(Execution::Running);
    new.tell();
    // The newer one has left, while the silence of the older one is waited for.
    new.leave(None);
    let shown = lathe(&floor).run.unwrap().run;
    assert_eq!(shown, names::run(Uuid::from_u128(20)));
    drop(old);
}

fn stop_of(run: &Run) -> feedwave_store::DecisionRecord {
    use feedwave_contract::proto;
    let outcome = proto::DecisionOutcome { action: DecisionAction::Stop.into(), ..Default::default() };
    let decision =
        proto::Decision { run: names::run(run.id), number: 3, outcome: Some(outcome), ..proto::Decision::default() };
    let body = prost::Message::encode_to_vec(&decision).into();
    feedwave_store::DecisionRecord {
        is_intact: true,
        sequence: 1,
        run_id: run.id,
        job_id: run.job_id,
        tenant: run.tenant,
        number: 3,
        at_us: 0,
        body,
    }
}

#[test]
fn a_stop_of_telemetry_stays_after_a_restart_and_without_its_client() {
    let floor = Floor::new();
    let (job, mut run) = (job(1), run(10, 1, RunState::Open));
    run.kind = RunKind::Telemetry;
    let stop = stop_of(&run);
    let base = RunBase {
        job: &job,
        run: &run,
        last_decision: Some(&stop),
        changes: &[],
        overrides: &[],
        feed_held: false,
        conditions: &[],
        deviation_unit: "mm",
    };
    let (view, _) = base.at_rest().unwrap();
    assert_eq!(view.activity.execution(), Execution::Stopped);
    assert!(matches!(&view.alarms[..], [alarm] if alarm.severity() == ConditionSeverity::Fault), "{:?}", view.alarms);
    floor.put_machine("lathe", "1", "");
    let mut presence = floor.presence(&base, 1).unwrap();
    presence.connect();
    presence.follow(Execution::Stopped);
    presence.leave(None);
    assert_eq!(lathe(&floor).execution(), Execution::Stopped);
    assert_eq!(lathe(&floor).conditions.len(), 1);
}

#[test]
fn how_far_a_run_came_is_known_at_rest() {
    let summary = feedwave_contract::proto::ProgramSummary { duration_s: 4.0, ..Default::default() };
    let mut job = job(1);
    job.summary = Some(crate::stored::to_stored(&summary).unwrap());
    let mut run = run(10, 1, RunState::Open);
    run.setpoints = RunSetpoints { received: 1_000, sent: 1_500, digest: None };
    let settings = feedwave_contract::proto::RunSettings { interpolation_period_us: 1_000, ..Default::default() };
    run.settings = crate::stored::to_stored(&settings).unwrap();
    let change = |setpoint_index, ratio| RunOverride { number: 0, setpoint_index, ratio, cause: String::new() };
    let progress = |run: &Run, overrides: &[RunOverride]| {
        let base = RunBase {
            job: &job,
            run,
            last_decision: None,
            changes: &[],
            overrides,
            feed_held: false,
            conditions: &[],
            deviation_unit: "mm",
        };
        let progress = base.at_rest().unwrap().0.activity.progress.unwrap();
        (progress.taken, progress.ratio, progress.machining_s, progress.remaining_s)
    };
    assert_eq!(progress(&run, &[]), (1_000, 0.25, 1.0, None));
    // At half the feed for half of the time; the last change acts behind what was taken.
    let slower = [change(500, 0.5), change(1_200, 0.25)];
    assert_eq!(progress(&run, &slower), (1_000, 0.1875, 1.0, None));
    run.state = RunState::Finished;
    assert_eq!(progress(&run, &slower), (1_000, 1.0, 1.0, None));
}

#[test]
fn how_a_stream_ended_is_what_the_run_does() {
    let floor = Floor::new();
    floor.put_machine("lathe", "1", "");
    let cancelled = Error::JobCancelled { job: String::new() };
    let cases = [
        (None, Execution::Interrupted),
        (Some(Error::Draining), Execution::Interrupted),
        (Some(cancelled), Execution::Stopped),
        (Some(Error::internal("the disk is gone")), Execution::Fault),
    ];
    for (error, execution) in cases {
        let mut presence = presence(&floor, 10, 1);
        presence.connect();
        presence.leave(error.as_ref());
        assert_eq!(lathe(&floor).execution(), execution, "{error:?}");
    }
    let [condition] = &lathe(&floor).conditions[..] else { panic!("{:?}", lathe(&floor).conditions) };
    assert_eq!((condition.severity(), condition.code.as_str()), (ConditionSeverity::Fault, "INTERNAL"));
    // A stream that another one replaced says nothing of the run any more.
    let mut first = presence(&floor, 10, 1);
    first.connect();
    let mut second = presence(&floor, 10, 1);
    second.connect();
    first.leave(Some(&Error::TakenUp { run: String::new() }));
    assert_eq!((lathe(&floor).execution(), lathe(&floor).other_runs), (Execution::Ready, 0));
}

#[test]
fn conditions_of_the_log_stay_until_they_are_acknowledged() {
    let floor = Floor::new();
    floor.put_machine("lathe", "1", "");
    let mut presence = presence(&floor, 10, 1);
    presence.connect();
    let condition = |acknowledged_by: &str| ConditionMessage {
        decision_number: 3,
        action: DecisionAction::HoldFeed.into(),
        acknowledge_time: (!acknowledged_by.is_empty()).then(Default::default),
        acknowledged_by: acknowledged_by.to_owned(),
        ..Default::default()
    };
    let (run, job_id) = (Uuid::from_u128(10), Uuid::from_u128(1));
    floor.raise("lathe", Logged { run, job_id, condition: condition(""), reading: None });
    presence.leave(None);
    assert_eq!(lathe(&floor).conditions.len(), 1);
    floor.acknowledge("lathe", run, &condition("Ada"));
    assert!(lathe(&floor).conditions.is_empty());
    for _ in 0..2 * MAX_LOGGED {
        floor.raise("lathe", Logged { run, job_id, condition: condition(""), reading: None });
    }
    assert_eq!(lathe(&floor).conditions.len(), MAX_CONDITIONS);
    assert_eq!(floor.board().machines["lathe"].logged.len(), MAX_LOGGED as usize);
    floor.forget_job("lathe", job_id);
    assert!(lathe(&floor).conditions.is_empty() && lathe(&floor).run.is_none());
}

#[test]
fn a_deleted_job_is_forgotten_with_the_stream_of_its_run() {
    let floor = Floor::new();
    floor.put_machine("lathe", "1", "");
    let mut presence = presence(&floor, 10, 1);
    presence.connect();
    floor.forget_job("lathe", Uuid::from_u128(1));
    presence.leave(Some(&Error::JobCancelled { job: String::new() }));
    assert!(lathe(&floor).run.is_none());
}

#[tokio::test(start_paused = true)]
async fn a_reader_is_told_of_what_changed_at_its_own_pace() {
    let floor = Floor::new();
    floor.put_machine("lathe", "1", "");
    floor.put_machine("mill", "1", "");
    let mut reader = floor.reader(None);
    let ids = |changes: &Changes| changes.states.iter().map(|shown| shown.machine_id().to_owned()).collect::<Vec<_>>();
    assert_eq!(ids(&reader.next().await.unwrap()), ["lathe", "mill"]);
    for number in 0..100 {
        floor.put_machine("mill", "1", &number.to_string());
    }
    let before = Instant::now();
    let changes = reader.next().await.unwrap();
    assert_eq!((ids(&changes), changes.states[0].state.display_name.as_str()), (vec!["mill".to_owned()], "99"));
    assert_eq!(before.elapsed(), STATE_INTERVAL, "what follows at once is joined");
    // A wait that is given up misses nothing.
    floor.remove_machine("mill");
    assert!(tokio::time::timeout(STATE_INTERVAL / 2, reader.next()).await.is_err());
    assert_eq!(reader.next().await.unwrap().gone, ["mill"]);
    let mut of_lathe = floor.reader(Some("lathe".to_owned()));
    assert_eq!(ids(&of_lathe.next().await.unwrap()), ["lathe"]);
}

#[test]
fn a_run_is_on_the_floor_of_its_tenant_alone() {
    let floors = Floors::default();
    let [ours, theirs] = ["ours", "theirs"].map(|name| name.parse::<Tenant>().unwrap());
    floors.put_machine("lathe", "1", "Lathe 1");
    let mut watch = floors.of(theirs).reader(None);
    let first = watch.changes();
    assert_eq!(first.states.len(), 1);
    let mut run = presence(&floors.of(ours), 3, 5);
    run.connect();
    run.set_execution(Execution::Running);
    run.tell();

    assert_eq!(lathe(&floors.of(ours)).execution(), Execution::Running);
    for other in [theirs, Tenant::DEFAULT] {
        let state = lathe(&floors.of(other));
        assert_eq!((state.execution(), state.run, state.other_runs), (Execution::Idle, None, 0));
        assert_eq!(floors.of(other).activity("lathe", Uuid::from_u128(3)), None);
    }
    // Who watches is not even woken.
    assert!(!watch.newest.has_changed().unwrap());
    // Machines are everybody's.
    floors.put_machine("lathe", "2", "Turning centre");
    floors.put_machine("mill", "1", "");
    let changes = watch.changes();
    let named: Vec<_> = changes.states.iter().map(|shown| shown.state.display_name.as_str()).collect();
    assert_eq!(named, ["Turning centre", ""]);
    assert_eq!(lathe(&floors.of(ours)).execution(), Execution::Running);
    floors.remove_machine("mill");
    assert_eq!(watch.changes().gone, ["mill"]);
    assert!(floors.of(ours).state("mill").is_none());

    // Who may see all sees it, whoever else has a floor.
    let mut second = presence(&floors.of(theirs), 9, 1);
    second.connect();
    second.end(RunState::Finished, Default::default());
    second.leave(None);
    let all = floors.of_all_tenants(10);
    let [state] = &all[..] else { panic!("{all:?}") };
    assert_eq!((state.execution(), state.finished_runs), (Execution::Running, 1));
    run.leave(None);
    drop(second);
    assert_eq!(floors.of_all_tenants(10)[0].run.as_ref().unwrap().run, names::run(Uuid::from_u128(3)), "the newer one");
}

#[test]
fn asking_for_tenants_that_have_nothing_fills_no_memory() {
    let floors = Floors::default();
    floors.put_machine("lathe", "1", "");
    let theirs: Tenant = "theirs".parse().unwrap();
    let mut run = presence(&floors.of(theirs), 3, 5);
    run.connect();
    drop(run);
    let watched: Tenant = "watched".parse().unwrap();
    let _watch = floors.of(watched).reader(None);
    for number in 0..1_000 {
        let asked: Tenant = format!("t{number}").parse().unwrap();
        assert_eq!(lathe(&floors.of(asked)).execution(), Execution::Idle);
    }
    assert_eq!(lathe(&floors.of(theirs)).execution(), Execution::Interrupted, "what is known stays");
    assert!(floors.len() <= 4, "{}", floors.len());
}

fn empty() -> feedwave_store::Json {
    RawValue::from_string("{}".to_owned()).unwrap()
}

/// A store with a run on the lathe that has come to its end.
async fn store_with_a_run(folder: &tempfile::TempDir) -> Store {
    let uri = format!("sqlite://{}/feedwave.db", folder.path().display());
    let store = Store::open(&uri.parse().unwrap(), StoreSettings::default()).await.unwrap();
    let program = store.put_program(Tenant::DEFAULT, "M30\n".into()).await.unwrap();
    let job = NewJob {
        tenant: Tenant::DEFAULT,
        owner: String::new(),
        request_id: "r".to_owned(),
        fingerprint: Fingerprint::of([]),
        display_name: String::new(),
        program_id: program.id,
        further_program_ids: Vec::new(),
        machine_id: "lathe".to_owned(),
        client: String::new(),
        machine_snapshot: empty(),
        settings: empty(),
    };
    let job_id = store.create_job(job).await.unwrap().id;
    store.transition(job_id, &JobState::ALL, JobState::Ready, "", None).await.unwrap();
    let run = NewRun { job_id, kind: RunKind::Live, settings: empty(), monitor: Bytes::new() };
    let run = store.create_run(run).await.unwrap();
    let end = RunCommit { end: Some((RunState::Finished, String::new())), ..RunCommit::default() };
    store.commit_run(run.run.id, run.attachment, end).await.unwrap();
    store.create_machine(Some("lathe"), empty()).await.unwrap();
    store
}

/// Waits until the lathe is as wanted.
async fn until(floor: &Floor, wanted: impl Fn(&MachineState) -> bool) {
    let mut reader = floor.reader(Some("lathe".to_owned()));
    while !wanted(&lathe(floor)) {
        reader.next().await.unwrap();
    }
}

#[tokio::test]
async fn what_retention_removes_leaves_the_floor() {
    for keeps_jobs in [false, true] {
        let folder = tempfile::TempDir::new().unwrap();
        let store = store_with_a_run(&folder).await;
        let (floors, stop) = (Floors::default(), CancellationToken::new());
        let events = EventReader::new(store.clone(), stop.clone());
        floors.restore(&store).await.unwrap();
        floors.put_machine("lathe", "1", "");
        let floor = floors.of(Tenant::DEFAULT);
        assert_eq!(lathe(&floor).execution(), Execution::Finished);
        let following = tokio::spawn(follow(floors.clone(), store.clone(), events));
        let age = Some(Duration::ZERO);
        let mut policy = RetentionPolicy { runs: age, ..RetentionPolicy::default() };
        if !keeps_jobs {
            policy = RetentionPolicy { jobs: age, ..RetentionPolicy::default() };
        }
        let removed = store.remove_expired(&policy).await.unwrap();
        assert_eq!((removed.jobs, removed.runs), if keeps_jobs { (0, 1) } else { (1, 0) });
        if keeps_jobs {
            floors.forget_removed(&store).await.unwrap();
        }
        until(&floor, |state| state.run.is_none()).await;
        stop.cancel();
        following.await.unwrap();
    }
}

#[tokio::test]
async fn a_job_that_is_cancelled_stops_its_interrupted_run() {
    let folder = tempfile::TempDir::new().unwrap();
    let store = store_with_a_run(&folder).await;
    let job_id = store.list_jobs(&JobFilter::default(), &PageRequest::default()).await.unwrap().items[0].id;
    let run = NewRun { job_id, kind: RunKind::Live, settings: empty(), monitor: Bytes::new() };
    store.create_run(run).await.unwrap();
    let (floors, stop) = (Floors::default(), CancellationToken::new());
    let events = EventReader::new(store.clone(), stop.clone());
    floors.restore(&store).await.unwrap();
    floors.put_machine("lathe", "1", "");
    let floor = floors.of(Tenant::DEFAULT);
    assert_eq!(lathe(&floor).execution(), Execution::Interrupted);
    let following = tokio::spawn(follow(floors.clone(), store.clone(), events));
    store.transition(job_id, &[JobState::Ready], JobState::Cancelled, "", None).await.unwrap();
    until(&floor, |state| state.execution() == Execution::Stopped).await;
    stop.cancel();
    following.await.unwrap();
}

#[test]
fn what_is_heard_late_of_an_earlier_stream_changes_no_end() {
    let floor = Floor::new();
    floor.put_machine("lathe", "1", "");
    floor.share(Arc::default());
    // A stream at another replica, which breaks; the run goes on here, and ends.
    let mut other = presence(&floor, 10, 1);
    other.connect();
    other.leave(None);
    let (_, mut left, _) = floor.of_this_replica(false);
    let (_, interrupted) = left.pop().unwrap();
    let elsewhere = floor.connect("lathe", interrupted.clone(), Vec::new(), None);
    let mut here = presence(&floor, 10, 1);
    here.connect();
    assert_eq!(floor.of_this_replica(false).0.len(), 1, "only what is connected here is told");
    here.end(RunState::Finished, Default::default());
    here.leave(None);
    floor.disconnect("lathe", elsewhere, Some(interrupted.clone()));
    floor.come_and_gone("lathe", interrupted, Vec::new());
    let (_, left, _) = floor.of_this_replica(false);
    assert_eq!(left.len(), 1, "the end is told");
    floor.come_and_gone("lathe", left[0].1.clone(), Vec::new());
    let state = lathe(&floor);
    assert_eq!((state.execution(), state.finished_runs), (Execution::Finished, 1));
}
