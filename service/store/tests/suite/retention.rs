//! What goes beyond the size that is kept, and what a dry run says of it.

use std::time::Duration;

use bytes::Bytes;
use feedwave_store::{
    CHUNK_BYTES, JobState, LogPlace, NewDecision, NewJob, NewRun, ProgramId, Removed, RetentionPolicy, RunCommit,
    RunKind, RunState, Store, StoreError, Tenant, UploadStart,
};

use tempfile::TempDir;

use super::{Place, json, new_job, open};

/// Bytes that do not compress.
fn noise(mut state: u64, bytes: u64) -> Bytes {
    let next = |_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 56) as u8
    };
    (0..bytes).map(next).collect()
}

async fn ready(store: &Store, job: NewJob) -> uuid::Uuid {
    let job = store.create_job(job).await.unwrap().id;
    store.transition(job, &JobState::ALL, JobState::Ready, "", None).await.unwrap();
    job
}

#[tokio::test]
async fn beyond_the_size_only_the_oldest_jobs_go_with_programs_that_no_other_uses() {
    let place = Place::new();
    beyond_the_size(&open(&place).await).await;
}

#[tokio::test]
async fn objects_count_for_the_size_and_go_with_their_programs() {
    let (place, folder) = (Place::new(), TempDir::new().unwrap());
    let store = place.open(super::objects::settings(folder.path())).await;
    let gone = beyond_the_size(&store).await;
    // Eight programs and the one whose job may be yet to come.
    assert_eq!(super::objects::files(folder.path()).len() as u64, 9 - gone);
    // Of the jobs there are no reports.
    let report = feedwave_store::check(store.uri()).await.unwrap();
    assert!(report.problems.iter().all(|problem| problem.kind == "job"), "{report:?}");
}

/// How many went.
async fn beyond_the_size(store: &Store) -> u64 {
    let mut programs = Vec::new();
    for index in 0..8 {
        programs.push(store.put_program(Tenant::DEFAULT, noise(index + 1, CHUNK_BYTES + 1)).await.unwrap().id);
    }
    let mut jobs = Vec::new();
    for (index, program) in programs.iter().enumerate() {
        let mut job = new_job(&index.to_string(), *program);
        // The second one takes along what the last one is about.
        job.further_program_ids = if index == 1 { vec![programs[7]] } else { Vec::new() };
        jobs.push(ready(store, job).await);
    }
    // The first one waits still, and is nobody's to remove.
    store.transition(jobs[0], &JobState::ALL, JobState::PendingValidation, "", None).await.unwrap();
    // Programs whose jobs may be yet to come take nobody's place, however many there are, nor do unfinished ones.
    let waiting = store.put_program(Tenant::DEFAULT, noise(100, 6 * CHUNK_BYTES)).await.unwrap().id;
    let unfinished = noise(101, 6 * CHUNK_BYTES + CHUNK_BYTES / 2);
    let expected = ProgramId::of(&[&unfinished[..], b"M30\n"].concat());
    let begun = store.begin_upload(expected, unfinished.len() as u64 + 4, "").await.unwrap();
    let UploadStart::Unfinished(upload) = begun else { panic!("it is not there") };
    store.append_upload(upload.id, 0, unfinished.clone()).await.unwrap();

    let enough = RetentionPolicy { bytes: Some(10 << 20), ..RetentionPolicy::default() };
    assert_eq!(store.remove_expired(&enough).await.unwrap(), Removed::default());
    let policy = RetentionPolicy { bytes: Some(4 << 20), ..RetentionPolicy::default() };
    assert_eq!(store.expired(&policy).await.unwrap(), Removed::default(), "the size is not foreseen");
    let removed = store.remove_expired(&policy).await.unwrap();
    assert!(removed.jobs == removed.programs && (3..=5).contains(&removed.jobs), "{removed:?}");
    let kept = store.jobs_in_state(&JobState::ALL, 10).await.unwrap();
    let gone = usize::try_from(removed.jobs).unwrap();
    assert_eq!(kept, [&jobs[..1], &jobs[gone + 1..]].concat());
    for (index, program) in programs.iter().enumerate() {
        let is_gone = matches!(store.program_info(*program).await, Err(StoreError::NotFound { .. }));
        assert_eq!(is_gone, (1..=gone).contains(&index), "{index} of {removed:?}");
    }
    store.program_info(waiting).await.unwrap();
    assert_eq!(store.upload(upload.id).await.unwrap().received_bytes, unfinished.len() as u64);
    assert_eq!(store.remove_expired(&policy).await.unwrap(), Removed::default(), "what is enough once is enough again");
    removed.programs
}

#[tokio::test]
async fn a_dry_run_counts_the_programs_of_the_jobs_that_go() {
    let place = Place::new();
    let store = open(&place).await;
    let mut programs = Vec::new();
    for index in 0..4 {
        programs.push(store.put_program(Tenant::DEFAULT, noise(index + 1, 100)).await.unwrap().id);
    }
    // One job goes with two programs, one waits and keeps one, which the first one used as well; nobody uses the last one.
    let further = NewJob { further_program_ids: vec![programs[1], programs[2]], ..new_job("goes", programs[0]) };
    ready(&store, further).await;
    store.create_job(new_job("waits", programs[2])).await.unwrap();
    let policy = |jobs| RetentionPolicy { jobs, programs: Some(Duration::ZERO), ..RetentionPolicy::default() };
    assert_eq!(store.expired(&policy(None)).await.unwrap(), Removed { programs: 1, ..Removed::default() });
    let foreseen = store.expired(&policy(Some(Duration::ZERO))).await.unwrap();
    assert_eq!(foreseen, Removed { jobs: 1, programs: 3, ..Removed::default() });
    assert_eq!(store.remove_expired(&policy(Some(Duration::ZERO))).await.unwrap(), foreseen);
}

/// Nobody can end their runs any more.
#[tokio::test]
async fn open_runs_keep_jobs_that_can_go_on_and_no_others() {
    let place = Place::new();
    let store = open(&place).await;
    let program = store.put_program(Tenant::DEFAULT, noise(1, 100)).await.unwrap().id;
    let mut jobs = Vec::new();
    for name in ["goes on", "cancelled"] {
        let job = ready(&store, new_job(name, program)).await;
        let new = NewRun { job_id: job, kind: RunKind::Live, settings: json("{}"), monitor: "m".into() };
        store.create_run(new).await.unwrap();
        jobs.push(job);
    }
    store.transition(jobs[1], &[JobState::Ready], JobState::Cancelled, "", None).await.unwrap();
    let policy = RetentionPolicy { jobs: Some(Duration::ZERO), ..RetentionPolicy::default() };
    let foreseen = store.expired(&policy).await.unwrap();
    assert_eq!((foreseen.jobs, store.remove_expired(&policy).await.unwrap()), (1, foreseen));
    store.job(jobs[0]).await.unwrap();
    assert!(matches!(store.job(jobs[1]).await, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn what_is_removed_of_a_log_is_known_afterwards() {
    let place = Place::new();
    let store = open(&place).await;
    let program = store.put_program(Tenant::DEFAULT, noise(1, 100)).await.unwrap().id;
    let mut jobs = Vec::new();
    for name in ["removed by a client", "whose run is too old", "stays"] {
        let job = ready(&store, new_job(name, program)).await;
        let new = NewRun { job_id: job, kind: RunKind::Telemetry, settings: json("{}"), monitor: "m".into() };
        let run = store.create_run(new).await.unwrap();
        let decision = NewDecision { number: 0, action: "stop", body: "d".into(), raises_condition: false };
        let end = (name != "stays").then(|| (RunState::Finished, String::new()));
        let commit = RunCommit { decisions: vec![decision], end, ..RunCommit::default() };
        store.commit_run(run.run.id, run.attachment, commit).await.unwrap();
        jobs.push(job);
    }
    let all = store.log_places(Tenant::DEFAULT).await.unwrap();
    assert_eq!((all.events.removed, all.decisions), (0, LogPlace { newest: 3, removed: 0 }));

    store.delete_job(jobs[0], None).await.unwrap();
    assert_eq!(store.log_places(Tenant::DEFAULT).await.unwrap().decisions, LogPlace { newest: 3, removed: 1 });
    let policy = RetentionPolicy { runs: Some(Duration::ZERO), ..RetentionPolicy::default() };
    assert_eq!(store.remove_expired(&policy).await.unwrap().runs, 1);
    assert_eq!(store.log_places(Tenant::DEFAULT).await.unwrap().decisions, LogPlace { newest: 3, removed: 2 });

    // Places of what is gone are not given again, and stay the newest ones.
    let newest = store.latest_sequence();
    let policy = RetentionPolicy { events: Some(Duration::ZERO), ..RetentionPolicy::default() };
    assert!(store.remove_expired(&policy).await.unwrap().events > 0);
    let places = store.log_places(Tenant::DEFAULT).await.unwrap();
    assert_eq!(places.events, LogPlace { newest, removed: newest });
    let other = store.log_places("other".parse().unwrap()).await.unwrap();
    assert_eq!((other.events, other.decisions), (LogPlace::default(), LogPlace::default()));

    // The store is the same when it is opened again, and another one elsewhere.
    store.close().await;
    assert_eq!(open(&place).await.log_places(Tenant::DEFAULT).await.unwrap(), places);
    assert_ne!(open(&Place::new()).await.log_places(Tenant::DEFAULT).await.unwrap().store, places.store);
}
