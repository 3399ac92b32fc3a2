//! The queue of validations and the count of attempts.

use feedwave_store::{Attempt, EventFilter, JobState, Kind, NewJob, StoreError};
use uuid::Uuid;

use super::{Place, new_job, open, with_program};

#[tokio::test]
async fn what_waits_is_listed_in_its_order_with_who_sent_it() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let mut ids = Vec::new();
    for index in 0..5 {
        let job = NewJob { client: format!("client-{index}"), ..new_job(&index.to_string(), program) };
        ids.push(store.create_job(job).await.unwrap().id);
    }
    store.transition(ids[1], &JobState::ALL, JobState::Ready, "", None).await.unwrap();
    assert_eq!(store.begin_validation(ids[2], 3).await.unwrap(), Attempt::Begun(1));
    let first = store.waiting_jobs(0, 2).await.unwrap();
    let rest = store.waiting_jobs(first[1].sequence, 10).await.unwrap();
    let waiting: Vec<_> = first.iter().chain(&rest).collect();
    assert_eq!(waiting.iter().map(|job| job.id).collect::<Vec<_>>(), [ids[0], ids[2], ids[3], ids[4]]);
    assert_eq!(waiting.iter().map(|job| job.attempts).collect::<Vec<_>>(), [0, 1, 0, 0]);
    assert_eq!((waiting[1].client.as_str(), waiting[1].program_size_bytes), ("client-2", 16));
}

#[tokio::test]
async fn attempts_are_counted_over_restarts_and_end_in_failure() {
    let place = Place::new();
    use JobState::{Failed, PendingValidation, Validating};
    let (mut store, program) = with_program(&place).await;
    let id = store.create_job(new_job("r", program)).await.unwrap().id;
    for attempt in 1..=3 {
        assert_eq!(store.begin_validation(id, 3).await.unwrap(), Attempt::Begun(attempt));
        drop(store);
        store = open(&place).await;
        assert_eq!(store.job(id).await.unwrap().attempts, attempt);
    }
    assert_eq!(store.begin_validation(id, 3).await.unwrap(), Attempt::GivenUp);
    let job = store.job(id).await.unwrap();
    assert_eq!((job.state, job.attempts), (Failed, 3));
    assert!(job.state_detail.contains("3 time(s)"), "{}", job.state_detail);
    let refused = store.begin_validation(id, 3).await;
    assert!(matches!(refused, Err(StoreError::FailedState { actual: Failed, .. })), "{refused:?}");
    let log = store.events_after(0, &EventFilter { job_id: Some(id), ..EventFilter::default() }, 10).await.unwrap();
    let changes: Vec<_> = log.iter().map(|event| (event.from_state, event.to_state)).collect();
    let again = (Some(Validating), Some(Validating));
    let expected = [
        (None, Some(PendingValidation)),
        (Some(PendingValidation), Some(Validating)),
        again,
        again,
        (Some(Validating), Some(Failed)),
    ];
    assert_eq!(changes, expected);
}

#[tokio::test]
async fn an_attempt_that_was_broken_off_in_order_does_not_count() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let id = store.create_job(new_job("r", program)).await.unwrap().id;
    for _ in 0..10 {
        assert_eq!(store.begin_validation(id, 2).await.unwrap(), Attempt::Begun(1));
        store.return_attempt(id).await.unwrap();
    }
    assert_eq!(
        store.events_after(0, &EventFilter { job_id: Some(id), ..EventFilter::default() }, 100).await.unwrap().len(),
        2,
        "nobody is told of it"
    );
    store.return_attempt(id).await.unwrap();
    assert_eq!(store.job(id).await.unwrap().attempts, 0);
    store.return_attempt(Uuid::now_v7()).await.unwrap();
    let absent = store.begin_validation(Uuid::now_v7(), 2).await;
    assert!(matches!(absent, Err(StoreError::NotFound { kind: Kind::Job, .. })), "{absent:?}");
}

#[tokio::test]
async fn who_reads_on_misses_no_job_whatever_was_deleted() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let first = store.create_job(new_job("first", program)).await.unwrap();
    store.delete_job(first.id, None).await.unwrap();
    let second = store.create_job(new_job("second", program)).await.unwrap();
    let read = store.waiting_jobs(first.sequence, 10).await.unwrap();
    assert_eq!(read.iter().map(|job| job.id).collect::<Vec<_>>(), [second.id]);
}
