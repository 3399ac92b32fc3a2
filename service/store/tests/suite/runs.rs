//! Runs and their decisions.

use feedwave_store::{
    AttachedRun, DecisionFilter, EventFilter, Kind, NewDecision, NewRecordedCut, NewRun, PageRequest, RunCheckpoint,
    RunCommit, RunKind, RunMark, RunOverride, RunSetpoints, RunState, Store, StoreError, StoreSettings, TelemetryGap,
    Tenant,
};
use uuid::Uuid;

use super::{Place, json, new_job, open, with_program};

fn new_run(job_id: Uuid) -> NewRun {
    NewRun { job_id, kind: RunKind::Live, settings: json(r#"{"tool":7}"#), monitor: vec![1; 9_000].into() }
}

async fn with_run(place: &Place) -> (Store, AttachedRun) {
    let (store, program) = with_program(place).await;
    let job_id = store.create_job(new_job("r", program)).await.unwrap().id;
    let run = store.create_run(new_run(job_id)).await.unwrap();
    (store, run)
}

fn decision(number: u64) -> NewDecision {
    NewDecision { number, action: "change", body: number.to_le_bytes().to_vec().into(), raises_condition: false }
}

fn decisions(numbers: std::ops::Range<u64>) -> RunCommit {
    RunCommit { decisions: numbers.map(decision).collect(), ..RunCommit::default() }
}

#[tokio::test]
async fn a_run_goes_on_where_its_last_commit_left_it() {
    let place = Place::new();
    let (store, AttachedRun { run, attachment, .. }) = with_run(&place).await;
    assert_eq!((run.state, run.newest_batch, run.setpoints), (RunState::Open, None, RunSetpoints::default()));
    let setpoints = RunSetpoints { received: 900, sent: 1_024, digest: Some([7; 32]) };
    let change = |number, setpoint_index, ratio| RunOverride {
        number,
        setpoint_index,
        ratio,
        cause: format!("decision {number}"),
    };
    let gap = TelemetryGap { first: 4, last: 9 };
    let commit = RunCommit {
        telemetry: Some((Some(3), vec![2; 50_000].into())),
        overrides: vec![change(0, 100, 0.95), change(1, 200, 0.95 * 0.95)],
        setpoints: Some(setpoints),
        gaps: vec![gap],
        ..decisions(0..2)
    };
    let stored = store.commit_run(run.id, attachment, commit).await.unwrap();
    assert_eq!(stored.iter().map(|decision| decision.number).collect::<Vec<_>>(), [0, 1]);
    // What a commit leaves out stays.
    store.commit_run(run.id, attachment, decisions(2..3)).await.unwrap();
    drop(store);

    let store = open(&place).await;
    let again = store.attach_run(run.id).await.unwrap();
    assert_eq!((again.run.newest_batch, again.run.setpoints), (Some(3), setpoints));
    assert_eq!(again.monitor, vec![2; 50_000]);
    assert_eq!(again.overrides, [change(0, 100, 0.95), change(1, 200, 0.95 * 0.95)]);
    assert_eq!(again.run.settings.get(), r#"{"tool":7}"#);
    assert_eq!(store.telemetry_gaps(run.id).await.unwrap(), [gap]);
    let filter = DecisionFilter { run_id: Some(run.id), ..DecisionFilter::default() };
    let kept = store.decisions_after(0, &filter, 10).await.unwrap();
    for (number, kept) in (0..3_u64).zip(&kept) {
        assert_eq!((kept.number, kept.body.as_ref()), (number, number.to_le_bytes().as_slice()));
    }
    assert_eq!(kept.len(), 3);
    // The same decision twice is a fault of the caller and changes nothing.
    let twice = store.commit_run(run.id, again.attachment, decisions(2..4)).await;
    assert!(matches!(twice, Err(StoreError::Unavailable { .. })), "{twice:?}");
    assert_eq!(store.decisions_after(0, &filter, 10).await.unwrap().len(), 3);
}

#[tokio::test]
async fn recorded_cuts_are_kept_with_the_batches_they_come_from_and_go_with_their_run() {
    let place = Place::new();
    let (store, AttachedRun { run, attachment, .. }) = with_run(&place).await;
    let cut = |number: u64| NewRecordedCut {
        number,
        head: format!("head {number}").into_bytes().into(),
        body: vec![number as u8; 200_000].into(),
    };
    let recorded = |numbers: std::ops::Range<u64>| RunCommit {
        telemetry: Some((Some(7), vec![3; 100].into())),
        recorded_cuts: numbers.map(cut).collect(),
        ..RunCommit::default()
    };
    store.commit_run(run.id, attachment, recorded(0..2)).await.unwrap();
    // All of a commit or nothing of it.
    let twice =
        store.commit_run(run.id, attachment, RunCommit { decisions: vec![decision(0)], ..recorded(1..3) }).await;
    assert!(matches!(twice, Err(StoreError::Unavailable { .. })), "{twice:?}");
    let large =
        NewRecordedCut { body: vec![0; (StoreSettings::default().max_snapshot_bytes + 1) as usize].into(), ..cut(2) };
    let large = RunCommit { recorded_cuts: vec![large], ..RunCommit::default() };
    let large = store.commit_run(run.id, attachment, large).await;
    assert!(matches!(large, Err(StoreError::TooLarge { .. })), "{large:?}");
    drop(store);

    let store = open(&place).await;
    let heads = store.recorded_cuts(run.id).await.unwrap();
    let listed: Vec<_> = heads.iter().map(|head| (head.number, head.head.as_ref())).collect();
    assert_eq!(listed, [(0, b"head 0".as_slice()), (1, b"head 1".as_slice())]);
    assert_eq!(store.recorded_cut(run.id, 1).await.unwrap(), vec![1; 200_000]);
    let missing = store.recorded_cut(run.id, 2).await;
    assert!(matches!(missing, Err(StoreError::NotFound { kind: Kind::RecordedCut, .. })), "{missing:?}");
    // Who was replaced records nothing more.
    let newer = store.attach_run(run.id).await.unwrap().attachment;
    assert!(matches!(store.commit_run(run.id, attachment, recorded(2..3)).await, Err(StoreError::Detached { .. })));
    let end = RunCommit { end: Some((RunState::Finished, String::new())), ..recorded(2..3) };
    store.commit_run(run.id, newer, end).await.unwrap();
    assert_eq!(store.recorded_cuts(run.id).await.unwrap().len(), 3);
    store.delete_job(run.job_id, None).await.unwrap();
    assert!(store.recorded_cuts(run.id).await.unwrap().is_empty());
}

#[tokio::test]
async fn conditions_stay_until_somebody_has_seen_them() {
    let place = Place::new();
    let (store, AttachedRun { run, attachment, .. }) = with_run(&place).await;
    let (id, events) = (run.id, store.latest_sequence());
    let raising = |number| {
        let decision = NewDecision { action: "hold_feed", raises_condition: true, ..decision(number) };
        RunCommit { decisions: vec![decision], ..RunCommit::default() }
    };
    let unseen = async |store: &Store| {
        let (of_run, of_all) =
            (store.run(id).await.unwrap().open_conditions, store.count_open_conditions(None).await.unwrap());
        assert_eq!(of_run, of_all);
        of_all
    };
    store.commit_run(id, attachment, decisions(0..2)).await.unwrap();
    assert_eq!(unseen(&store).await, 0);
    let refused = store.acknowledge_condition(id, None, "me".to_owned(), String::new()).await.err();
    assert!(matches!(refused, Some(StoreError::NotFound { kind: Kind::Condition, .. })), "{refused:?}");
    store.commit_run(id, attachment, raising(2)).await.unwrap();
    // A commit that fails raises nothing: the decision is there already.
    assert!(store.commit_run(id, attachment, raising(2)).await.is_err());
    store.commit_run(id, attachment, raising(3)).await.unwrap();
    drop(store);

    let store = open(&place).await;
    assert_eq!(unseen(&store).await, 2);
    let seen = store.acknowledge_condition(id, Some(2), "Ada".to_owned(), "worn".to_owned()).await.unwrap();
    let first = seen.acknowledged.clone().unwrap();
    assert_eq!((seen.decision_number, first.by.as_str(), first.note.as_str()), (2, "Ada", "worn"));
    // Once: later acknowledgements change nothing.
    let again = store.acknowledge_condition(id, Some(2), "Bob".to_owned(), String::new()).await.unwrap();
    assert_eq!(again, seen);
    assert_eq!(unseen(&store).await, 1);
    // The newest where none is named, also of a run that has ended.
    let end = RunCommit { end: Some((RunState::Aborted, String::new())), ..RunCommit::default() };
    store.commit_run(id, attachment, end).await.unwrap();
    store.acknowledge_condition(id, None, "Bob".to_owned(), String::new()).await.unwrap();
    let kept = store.run_conditions(id).await.unwrap();
    assert_eq!(kept.iter().map(|kept| kept.decision_number).collect::<Vec<_>>(), [2, 3]);
    assert_eq!((&kept[0], unseen(&store).await), (&seen, 0));
    // The job's events tell of both, raised and acknowledged, once each.
    let told = store
        .events_after(events, &EventFilter { job_id: Some(run.job_id), ..EventFilter::default() }, 100)
        .await
        .unwrap();
    assert_eq!(told.len(), 4);
    assert!(told.iter().all(|event| event.from_state == event.to_state && event.detail.contains("condition")));
    assert_eq!(store.latest_sequence(), told[3].sequence);
}

#[tokio::test]
async fn what_a_machine_did_last_is_found_by_the_machine() {
    let place = Place::new();
    let (store, first) = with_run(&place).await;
    let job = store.job(first.run.job_id).await.unwrap();
    let end = |state| RunCommit { end: Some((state, String::new())), ..RunCommit::default() };
    store.commit_run(first.run.id, first.attachment, end(RunState::Finished)).await.unwrap();
    let second = store.create_run(new_run(job.id)).await.unwrap();
    let mut other = new_job("of-another", job.program_id);
    other.machine_id = "another".to_owned();
    let other = store.create_job(other).await.unwrap();
    let third = store.create_run(new_run(other.id)).await.unwrap();
    store.commit_run(third.run.id, third.attachment, end(RunState::Stopped)).await.unwrap();

    let theirs: Tenant = "theirs".parse().unwrap();
    let program = store.put_program(theirs, "G1 X10 F100\nM30\n".into()).await.unwrap();
    let mut foreign = new_job("theirs", program.id);
    (foreign.tenant, foreign.machine_id) = (theirs, job.machine_id.clone());
    let foreign = store.create_job(foreign).await.unwrap();
    let fourth = store.create_run(new_run(foreign.id)).await.unwrap();

    let ours = Tenant::DEFAULT;
    let runs = store.machine_runs().await.unwrap();
    let mut expected = [
        ("another", ours, third.run.id, 0),
        (job.machine_id.as_str(), ours, second.run.id, 1),
        (job.machine_id.as_str(), theirs, fourth.run.id, 0),
    ];
    expected.sort_by_key(|(machine, tenant, ..)| (*machine, *tenant));
    let found: Vec<_> =
        runs.iter().map(|runs| (runs.machine_id.as_str(), runs.tenant, runs.newest, runs.finished)).collect();
    assert_eq!(found, expected);

    assert!(store.last_decision(second.run.id).await.unwrap().is_none());
    let raising = NewDecision { raises_condition: true, ..decision(4) };
    let commit = RunCommit { decisions: vec![decision(3), raising], ..RunCommit::default() };
    store.commit_run(second.run.id, second.attachment, commit).await.unwrap();
    let last = store.last_decision(second.run.id).await.unwrap().unwrap();
    assert_eq!((last.number, last.run_id, last.job_id, last.tenant), (4, second.run.id, job.id, ours));
    let commit = RunCommit {
        decisions: (5..9).map(|number| NewDecision { raises_condition: true, ..decision(number) }).collect(),
        ..RunCommit::default()
    };
    store.commit_run(fourth.run.id, fourth.attachment, commit).await.unwrap();
    let open = store.open_conditions(3).await.unwrap();
    let mut found: Vec<_> = open.iter().map(|open| (open.tenant, open.condition.decision_number)).collect();
    found.sort_unstable();
    assert_eq!(found, [(ours, 4), (theirs, 6), (theirs, 7), (theirs, 8)], "each tenant has its own bound");
    let open = open.iter().find(|open| open.tenant == ours).unwrap();
    assert_eq!((&open.machine_id, open.run_id, open.job_id), (&job.machine_id, second.run.id, job.id));
    assert_eq!(open.condition.acknowledged, None);
    store.acknowledge_condition(second.run.id, Some(4), "Ada".to_owned(), String::new()).await.unwrap();
    assert!(store.open_conditions(3).await.unwrap().iter().all(|open| open.tenant == theirs));
}

#[tokio::test]
async fn only_the_newest_attachment_writes() {
    let place = Place::new();
    let (store, first) = with_run(&place).await;
    let id = first.run.id;
    let second = store.attach_run(id).await.unwrap();
    let third = store.attach_run(id).await.unwrap();
    for old in [first.attachment, second.attachment] {
        let refused = store.commit_run(id, old, decisions(0..1)).await;
        assert!(matches!(refused, Err(StoreError::Detached { run_id }) if run_id == id), "{refused:?}");
    }
    store.commit_run(id, third.attachment, decisions(0..1)).await.unwrap();
    assert_eq!(store.decisions_after(0, &DecisionFilter::default(), 10).await.unwrap().len(), 1);
}

#[tokio::test]
async fn an_ended_run_takes_nothing_more() {
    let place = Place::new();
    let (store, AttachedRun { run, attachment, .. }) = with_run(&place).await;
    let end = RunCommit { end: Some((RunState::Stopped, "replace the tool".into())), ..decisions(0..1) };
    store.commit_run(run.id, attachment, end).await.unwrap();
    let ended = store.run(run.id).await.unwrap();
    assert_eq!((ended.state, ended.state_detail.as_str()), (RunState::Stopped, "replace the tool"));
    let refused = store.commit_run(run.id, attachment, decisions(1..2)).await.err();
    assert!(matches!(refused, Some(StoreError::RunEnded { state: RunState::Stopped, .. })), "{refused:?}");
    let refused = store.attach_run(run.id).await.err();
    assert!(matches!(refused, Some(StoreError::RunEnded { .. })), "{refused:?}");
}

#[tokio::test]
async fn decisions_are_followed_without_gaps() {
    let place = Place::new();
    let (store, first) = with_run(&place).await;
    let second = store.create_run(new_run(first.run.job_id)).await.unwrap();
    let mut newest = store.watch_decisions();
    let mut seen = Vec::new();
    for number in 0..20 {
        let run = if number % 3 == 0 { &second } else { &first };
        let after = seen.last().copied().unwrap_or(0);
        // Who looks at the log may see the commit before it is answered: what is lent of the watch is given back at once,
        // or the writer, which tells of its commit as well, waits for it for good.
        let told = async { newest.wait_for(|newest| *newest > after).await.map(drop) };
        let both =
            tokio::join!(store.commit_run(run.run.id, run.attachment, decisions(10 * number..10 * number + 2)), told,);
        both.0.unwrap();
        both.1.unwrap();
        let new = store.decisions_after(after, &DecisionFilter::default(), 500).await.unwrap();
        seen.extend(new.iter().map(|decision| decision.sequence));
    }
    assert_eq!(seen, (1..=40).collect::<Vec<i64>>());
    let of_job = DecisionFilter { job_id: Some(first.run.job_id), ..DecisionFilter::default() };
    assert_eq!(store.decisions_after(10, &of_job, 7).await.unwrap().len(), 7);
    let of_run = DecisionFilter { run_id: Some(second.run.id), ..DecisionFilter::default() };
    assert_eq!(store.decisions_after(0, &of_run, 500).await.unwrap().len(), 14);
    drop(store);
    assert_eq!(*open(&place).await.watch_decisions().borrow(), 40, "the position survives");
}

#[tokio::test]
async fn runs_need_their_job_and_go_with_it() {
    let place = Place::new();
    let (store, AttachedRun { run, attachment, .. }) = with_run(&place).await;
    let other = Uuid::now_v7();
    let refused = store.create_run(new_run(other)).await.err();
    assert!(matches!(refused, Some(StoreError::NotFound { kind: Kind::Job, .. })), "{refused:?}");
    let refused = store.put_monitoring(other, json("{}")).await.err();
    assert!(matches!(refused, Some(StoreError::NotFound { kind: Kind::Job, .. })), "{refused:?}");
    let refused = store.monitoring(other).await.err();
    assert!(matches!(refused, Some(StoreError::NotFound { kind: Kind::Job, .. })), "{refused:?}");
    let refused = store.monitoring(run.job_id).await.err();
    assert!(matches!(refused, Some(StoreError::NotFound { kind: Kind::Monitoring, .. })), "{refused:?}");
    for config in [r#"{"a":1}"#, r#"{"a":2}"#] {
        store.put_monitoring(run.job_id, json(config)).await.unwrap();
        assert_eq!(store.monitoring(run.job_id).await.unwrap().get(), config);
    }
    store.commit_run(run.id, attachment, decisions(0..3)).await.unwrap();
    store.delete_job(run.job_id, None).await.unwrap();
    let refused = store.commit_run(run.id, attachment, decisions(3..4)).await.err();
    assert!(matches!(refused, Some(StoreError::NotFound { kind: Kind::Run, .. })), "{refused:?}");
    assert!(store.decisions_after(0, &DecisionFilter::default(), 10).await.unwrap().is_empty());
}

#[tokio::test]
async fn runs_page_newest_first() {
    let place = Place::new();
    let (store, first) = with_run(&place).await;
    let job_id = first.run.job_id;
    let mut created = vec![first.run.id];
    for _ in 0..6 {
        created.push(store.create_run(new_run(job_id)).await.unwrap().run.id);
    }
    let mut listed = Vec::new();
    let mut page = PageRequest { size: 3, token: String::new() };
    loop {
        let runs = store.list_runs(None, Some(job_id), &page).await.unwrap();
        listed.extend(runs.items.iter().map(|run| run.id));
        match runs.next_token {
            Some(token) => page.token = token,
            None => break,
        }
    }
    created.reverse();
    assert_eq!(listed, created);
    let foreign = store.list_runs(None, None, &page).await.err();
    assert!(matches!(foreign, Some(StoreError::InvalidPageToken)), "{foreign:?}");
    assert_eq!(store.list_runs(None, None, &PageRequest::default()).await.unwrap().items.len(), 7);
}

#[tokio::test]
async fn checkpoints_of_a_run_are_found_replaced_and_removed() {
    let place = Place::new();
    let (store, AttachedRun { run, attachment, .. }) = with_run(&place).await;
    let checkpoint = |setpoint_index: u64| RunCheckpoint {
        mark: RunMark { setpoint_index, digest_state: vec![setpoint_index as u8; 105].into() },
        change_count: setpoint_index / 100,
        generation_key: "v1".to_owned(),
        snapshot: vec![7; 20_000].into(),
    };
    let indices = async |store: &Store| -> Vec<u64> {
        store.run_marks(run.id).await.unwrap().iter().map(|mark| mark.setpoint_index).collect()
    };
    for index in [100, 200, 300, 300, 400] {
        store.put_run_checkpoint(run.id, attachment, checkpoint(index), Vec::new()).await.unwrap();
    }
    drop(store);
    let store = open(&place).await;
    assert_eq!(indices(&store).await, [100, 200, 300, 400]);
    for (wanted, expected) in [(99, None), (100, Some(100)), (399, Some(300)), (u64::MAX, Some(400))] {
        let found = store.nearest_run_checkpoint(run.id, "v1", wanted).await.unwrap();
        assert_eq!(found, expected.map(checkpoint), "at {wanted}");
    }
    // Another version's are not found, but marked.
    let other = RunCheckpoint { generation_key: "v2".to_owned(), ..checkpoint(500) };
    store.put_run_checkpoint(run.id, attachment, other, vec![100..101, 250..400]).await.unwrap();
    assert_eq!(indices(&store).await, [200, 400, 500]);
    let found = store.nearest_run_checkpoint(run.id, "v1", u64::MAX).await.unwrap();
    assert_eq!(found, Some(checkpoint(400)));
    // Who was replaced writes no more, and nothing is written to a run that has ended.
    let newer = store.attach_run(run.id).await.unwrap().attachment;
    let detached = store.put_run_checkpoint(run.id, attachment, checkpoint(600), vec![0..400, 500..1_000]).await;
    assert!(matches!(detached, Err(StoreError::Detached { .. })), "{detached:?}");
    let limit = StoreSettings::default().max_snapshot_bytes as usize;
    let large = RunCheckpoint { snapshot: vec![0; limit + 1].into(), ..checkpoint(600) };
    let large = store.put_run_checkpoint(run.id, newer, large, Vec::new()).await;
    assert!(matches!(large, Err(StoreError::TooLarge { .. })), "{large:?}");
    let end = RunCommit { end: Some((RunState::Finished, String::new())), ..RunCommit::default() };
    store.commit_run(run.id, newer, end).await.unwrap();
    let ended = store.put_run_checkpoint(run.id, newer, checkpoint(600), Vec::new()).await;
    assert!(matches!(ended, Err(StoreError::RunEnded { .. })), "{ended:?}");
    assert_eq!(indices(&store).await, [200, 400, 500]);
}
