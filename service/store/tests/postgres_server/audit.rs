//! The audit log of several replicas, read by who follows it.

use feedwave_store::{AuditFilter, AuditRequest, AuditResult};

use super::Place;

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn who_reads_the_audit_log_on_misses_nothing_that_replicas_write_at_once() {
    const ENTRIES: usize = 60;
    let place = Place::new();
    let stores = [place.open().await, place.open().await, place.open().await];
    let mut writers = tokio::task::JoinSet::new();
    for store in stores.clone() {
        for _ in 0..ENTRIES {
            let store = store.clone();
            writers.spawn(async move {
                // A character that PostgreSQL cannot keep is no way to go unseen.
                let asked = AuditRequest { request_id: "a\0b".into(), ..AuditRequest::default() };
                let sequence = store.begin_audit(asked, None).await.unwrap();
                let done = AuditResult { code: "OK".into(), ..AuditResult::default() };
                store.end_audit(sequence, done).await.unwrap();
            });
        }
    }
    let mut seen = Vec::new();
    while seen.len() < stores.len() * ENTRIES {
        let after = seen.last().copied().unwrap_or(0);
        let entries = stores[0].audit_after(after, &AuditFilter::default(), 1_000).await.unwrap();
        seen.extend(entries.iter().map(|entry| entry.sequence));
        tokio::task::yield_now().await;
    }
    assert!(seen.iter().copied().eq(1..=seen.len() as i64), "{seen:?}");
    while let Some(written) = writers.join_next().await {
        written.unwrap();
    }
    let entries = stores[1].audit_after(0, &AuditFilter::default(), 1_000).await.unwrap();
    assert!(entries.iter().all(|entry| entry.result.is_some() && entry.request.request_id == "a\u{fffd}b"));
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn who_follows_changes_of_the_audit_log_sees_each_result_once_that_replicas_write_at_once() {
    const ENTRIES: usize = 60;
    let place = Place::new();
    let stores = [place.open().await, place.open().await, place.open().await];
    let mut writers = tokio::task::JoinSet::new();
    for store in stores.clone() {
        for number in 0..ENTRIES {
            let store = store.clone();
            writers.spawn(async move {
                let asked = AuditRequest { tenant: format!("plant-{}", number % 3), ..AuditRequest::default() };
                let sequence = store.begin_audit(asked, None).await.unwrap();
                let done = AuditResult { code: "OK".into(), ..AuditResult::default() };
                store.end_audit(sequence, done).await.unwrap();
            });
        }
    }
    let (mut cursor, mut results) = (0, Vec::new());
    while results.len() < stores.len() * ENTRIES {
        for entry in stores[0].audit_changed_after(cursor, &AuditFilter::default(), 50).await.unwrap() {
            assert!(entry.change > cursor);
            cursor = entry.change;
            results.extend(entry.result.is_some().then_some(entry.sequence));
        }
        tokio::task::yield_now().await;
    }
    while let Some(written) = writers.join_next().await {
        written.unwrap();
    }
    results.sort_unstable();
    assert!(results.iter().copied().eq(1..=results.len() as i64), "{results:?}");
    assert!(stores[1].audit_changed_after(cursor, &AuditFilter::default(), 1).await.unwrap().is_empty());
}
