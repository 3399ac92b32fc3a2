//! The audit log: kept with what came of each call, and bounded.

use std::collections::BTreeMap;

use feedwave_store::{
    AuditEntry, AuditFilter, AuditRequest, AuditResult, JobState, MAX_AUDIT_TEXT_BYTES, Removed, RetentionPolicy,
    Store, StoreSettings, Tenant,
};
use proptest::prelude::*;
use tokio::task::JoinSet;

use crate::{Place, new_job, open};

fn asked(principal: &str, tenant: &str) -> AuditRequest {
    AuditRequest {
        principal: principal.to_owned(),
        tenant: tenant.to_owned(),
        address: "10.0.0.7".to_owned(),
        certificate: String::new(),
        method: "/feedwave.v1.Jobs/CreateJob".to_owned(),
        request_id: "r".to_owned(),
    }
}

fn done(code: &str) -> AuditResult {
    AuditResult { resource: "jobs/1".to_owned(), code: code.to_owned(), reason: String::new() }
}

#[tokio::test]
async fn entries_are_there_before_their_results_and_after_a_restart() {
    let place = Place::new();
    let store = open(&place).await;
    let first = store.begin_audit(asked("a", ""), None).await.unwrap();
    let denied = store.begin_audit(asked("b", "x"), Some(done("PERMISSION_DENIED"))).await.unwrap();
    assert!(denied > first);
    let entries = store.audit_after(0, &AuditFilter::default(), 10).await.unwrap();
    assert_eq!((entries[0].result.clone(), entries[0].ended_us, entries[0].occurrences), (None, None, 1));
    assert_eq!(entries[0].request, asked("a", ""));
    assert_eq!(entries[1].result, Some(done("PERMISSION_DENIED")));

    store.end_audit(first, done("OK")).await.unwrap();
    store.repeat_audit(denied, 41).await.unwrap();
    // One that is not kept is no error.
    store.end_audit(1_000, done("OK")).await.unwrap();
    drop(store);
    let store = open(&place).await;
    let entries = store.audit_after(0, &AuditFilter::default(), 10).await.unwrap();
    assert_eq!((entries[0].result.clone(), entries[0].ended_us.is_some()), (Some(done("OK")), true));
    assert_eq!((entries.len(), entries[1].occurrences), (2, 42));

    let of = async |filter: AuditFilter| {
        let entries = store.audit_after(0, &filter, 10).await.unwrap();
        entries.iter().map(|entry| entry.sequence).collect::<Vec<_>>()
    };
    assert_eq!(of(AuditFilter { principal: Some("b".to_owned()), ..AuditFilter::default() }).await, [denied]);
    assert_eq!(of(AuditFilter { tenant: Some(String::new()), ..AuditFilter::default() }).await, [first]);
    assert_eq!(store.audit_after(first, &AuditFilter::default(), 10).await.unwrap().len(), 1);
}

#[tokio::test]
async fn the_log_is_bounded_by_number_by_age_and_in_every_text() {
    let place = Place::new();
    let store = place.open(StoreSettings { max_audit_entries: 300, ..StoreSettings::default() }).await;
    for _ in 0..1_500 {
        store.begin_audit(asked("flood", ""), Some(done("OK"))).await.unwrap();
    }
    let entries = store.audit_after(0, &AuditFilter::default(), 1_000).await.unwrap();
    // The oldest ones go some hundred at a time.
    assert!((300..=600).contains(&entries.len()), "{}", entries.len());
    assert_eq!(entries.last().unwrap().sequence, 1_500);

    let long = "ä".repeat(MAX_AUDIT_TEXT_BYTES);
    let sequence = store.begin_audit(AuditRequest { method: long.clone(), ..asked("x", "") }, None).await.unwrap();
    store.end_audit(sequence, AuditResult { reason: long, ..done("INTERNAL") }).await.unwrap();
    let entry = store.audit_after(sequence - 1, &AuditFilter::default(), 1).await.unwrap().remove(0);
    assert_eq!(entry.request.method.len(), MAX_AUDIT_TEXT_BYTES);
    assert_eq!(entry.result.unwrap().reason.len(), MAX_AUDIT_TEXT_BYTES);

    let policy = RetentionPolicy { audit: Some(std::time::Duration::ZERO), ..RetentionPolicy::default() };
    let there = entries.len() as u64 + 1;
    assert_eq!(store.expired(&policy).await.unwrap().audit, there);
    assert_eq!(store.remove_expired(&policy).await.unwrap().audit, there);
    assert!(store.audit_after(0, &AuditFilter::default(), 10).await.unwrap().is_empty());
    assert!(store.begin_audit(asked("x", ""), None).await.unwrap() > sequence, "no number is used twice");
}

/// Has so many entries of a tenant written, many at once.
async fn write(store: &Store, tenant: &str, count: usize) {
    let mut writers = JoinSet::new();
    for _ in 0..count {
        let (store, asked) = (store.clone(), asked("a", tenant));
        writers.spawn(async move { store.begin_audit(asked, Some(done("OK"))).await.unwrap() });
        if writers.len() == 100 {
            writers.join_next().await.unwrap().unwrap();
        }
    }
    writers.join_all().await;
}

/// The sequence numbers of a tenant's entries.
async fn kept(store: &Store, tenant: &str) -> Vec<i64> {
    let filter = AuditFilter { tenant: Some(tenant.to_owned()), ..AuditFilter::default() };
    let entries = store.audit_after(0, &filter, 1_000).await.unwrap();
    entries.iter().map(|entry| entry.sequence).collect()
}

#[tokio::test]
async fn the_bound_of_the_log_is_kept_at_the_cost_of_who_fills_it() {
    const MOST: u64 = 300;
    let place = Place::new();
    let store = place.open(StoreSettings { max_audit_entries: MOST, ..StoreSettings::default() }).await;
    write(&store, "small", 20).await;
    write(&store, "", 60).await;
    let (small, default) = (kept(&store, "small").await, kept(&store, "").await);
    write(&store, "flood", 1_800).await;
    assert_eq!((kept(&store, "small").await, kept(&store, "").await), (small.clone(), default));
    let flood = kept(&store, "flood").await;
    assert!((220..220 + 256).contains(&flood.len()), "{}", flood.len());
    // Of its own entries the newest are kept.
    assert!(flood.windows(2).all(|pair| pair[1] == pair[0] + 1) && flood.last() == Some(&1_880), "{flood:?}");

    // A second one that fills it shares with the first, over a restart, and who has little keeps it.
    drop(store);
    let store = place.open(StoreSettings { max_audit_entries: MOST, ..StoreSettings::default() }).await;
    write(&store, "", 1_800).await;
    let [default, flood] = [kept(&store, "").await.len(), kept(&store, "flood").await.len()];
    assert_eq!(kept(&store, "small").await, small);
    assert!((139..=140).contains(&flood) && (140..140 + 256).contains(&default), "{flood} {default}");

    // What has gone by its age is nobody's share any more.
    let policy = RetentionPolicy { audit: Some(std::time::Duration::ZERO), ..RetentionPolicy::default() };
    while !store.audit_after(0, &AuditFilter::default(), 1).await.unwrap().is_empty() {
        store.remove_expired(&policy).await.unwrap();
    }
    write(&store, "later", MOST as usize).await;
    assert_eq!(kept(&store, "later").await.len(), MOST as usize);
}

#[tokio::test]
async fn who_follows_changes_finds_results_that_come_later() {
    let place = Place::new();
    let store = open(&place).await;
    let first = store.begin_audit(asked("a", ""), None).await.unwrap();
    let second = store.begin_audit(asked("b", "x"), None).await.unwrap();
    let all = AuditFilter::default();
    let told = async |store: &Store, change: i64, filter: &AuditFilter| {
        let entries = store.audit_changed_after(change, filter, 10).await.unwrap();
        assert!(entries.windows(2).all(|pair| pair[0].change < pair[1].change));
        let last = entries.last().map_or(change, |entry| entry.change);
        (entries.iter().map(|entry| (entry.sequence, entry.result.is_some())).collect::<Vec<_>>(), last)
    };
    let (seen, cursor) = told(&store, 0, &all).await;
    assert_eq!(seen, [(first, false), (second, false)]);
    store.end_audit(second, done("OK")).await.unwrap();
    let (seen, cursor) = told(&store, cursor, &all).await;
    assert_eq!(seen, [(second, true)]);
    // The number of a change is never used again, though its entry is gone and the store was closed.
    let policy = RetentionPolicy { audit: Some(std::time::Duration::ZERO), ..RetentionPolicy::default() };
    assert_eq!(store.remove_expired(&policy).await.unwrap().audit, 2);
    drop(store);
    let store = open(&place).await;
    store.end_audit(first, done("OK")).await.unwrap();
    let third = store.begin_audit(asked("b", "x"), Some(done("OK"))).await.unwrap();
    assert_eq!(told(&store, cursor, &all).await.0, [(third, true)]);
    let of = |tenant: &str, principal: &str| AuditFilter {
        tenant: Some(tenant.to_owned()),
        principal: Some(principal.to_owned()),
    };
    assert_eq!(told(&store, cursor, &of("x", "b")).await.0, [(third, true)]);
    assert!(told(&store, cursor, &of("x", "a")).await.0.is_empty());
    assert!(told(&store, cursor, &of("", "b")).await.0.is_empty());
}

/// What happens to a log.
#[derive(Debug, Clone, Copy)]
enum Step {
    Begin,
    Deny,
    /// Ends one of those in progress.
    End(usize),
    /// Counts a refusal once more.
    Repeat(usize),
    /// The follower reads so many.
    Read(u32),
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        3 => Just(Step::Begin),
        1 => Just(Step::Deny),
        3 => (0..100_usize).prop_map(Step::End),
        1 => (0..100_usize).prop_map(Step::Repeat),
        2 => (1..4_u32).prop_map(Step::Read),
    ]
}

/// Follows a log through these steps and to its end.
async fn follow(steps: Vec<Step>) {
    let place = Place::new();
    let store = open(&place).await;
    let (mut open, mut refused) = (Vec::new(), Vec::new());
    let (mut cursor, mut states) = (0, Vec::new());
    let mut read = async |limit: u32| {
        let entries = store.audit_changed_after(cursor, &AuditFilter::default(), limit).await.unwrap();
        cursor = entries.last().map_or(cursor, |entry| entry.change);
        states.extend(entries.iter().cloned());
        entries.len()
    };
    for step in steps {
        match step {
            Step::Begin => open.push(store.begin_audit(asked("a", ""), None).await.unwrap()),
            Step::Deny => refused.push(store.begin_audit(asked("b", ""), Some(done("DENIED"))).await.unwrap()),
            Step::End(_) if open.is_empty() => {}
            Step::End(index) => {
                let sequence = open.swap_remove(index % open.len());
                store.end_audit(sequence, done("OK")).await.unwrap();
            }
            Step::Repeat(_) if refused.is_empty() => {}
            Step::Repeat(index) => store.repeat_audit(refused[index % refused.len()], 1).await.unwrap(),
            Step::Read(limit) => drop(read(limit).await),
        }
    }
    while read(7).await > 0 {}
    // What was seen last of each is what there is, and no result came twice.
    let there = store.audit_after(0, &AuditFilter::default(), 1_000).await.unwrap();
    let last: BTreeMap<i64, _> = states.iter().map(|entry| (entry.sequence, entry)).collect();
    assert_eq!(last.into_values().collect::<Vec<_>>(), there.iter().collect::<Vec<_>>());
    let results = |entries: &[AuditEntry]| {
        entries.iter().filter(|entry| entry.request.principal == "a" && entry.result.is_some()).count()
    };
    assert_eq!(results(&states), results(&there));
    assert!(states.windows(2).all(|pair| pair[0].change < pair[1].change));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn a_follower_sees_every_entry_and_every_result_once(steps in proptest::collection::vec(step(), 1..60)) {
        tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap().block_on(follow(steps));
    }
}

#[tokio::test]
async fn a_full_audit_log_pushes_out_no_job_and_jobs_push_out_none_of_its_entries() {
    const ENTRIES: usize = 1_000;
    let place = Place::new();
    let store = open(&place).await;
    let program = store.put_program(Tenant::DEFAULT, "M30\n".into()).await.unwrap();
    let job = store.create_job(new_job("kept", program.id)).await.unwrap();
    store.transition(job.id, &JobState::ALL, JobState::Ready, "", None).await.unwrap();
    let long = "x".repeat(MAX_AUDIT_TEXT_BYTES);
    let mut writers = JoinSet::new();
    for _ in 0..ENTRIES {
        let asked = AuditRequest { method: long.clone(), request_id: long.clone(), ..asked(&long, &long) };
        let done = AuditResult { resource: long.clone(), reason: long.clone(), ..done("OK") };
        let store = store.clone();
        writers.spawn(async move { store.begin_audit(asked, Some(done)).await.unwrap() });
    }
    writers.join_all().await;
    // What all of it takes is far more than this, what a job takes far less.
    let policy = |bytes| RetentionPolicy { bytes: Some(bytes), ..RetentionPolicy::default() };
    assert_eq!(store.remove_expired(&policy(2 << 20)).await.unwrap(), Removed::default());
    let removed = store.remove_expired(&policy(0)).await.unwrap();
    assert_eq!((removed.jobs, removed.audit), (1, 0));
    assert_eq!(store.audit_after(0, &AuditFilter::default(), 1_000).await.unwrap().len(), ENTRIES);
}
