//! The audit log: kept with what came of each call, and bounded.

use feedwave_store::{AuditFilter, AuditRequest, AuditResult, MAX_AUDIT_TEXT_BYTES, RetentionPolicy, StoreSettings};

use crate::{Place, open};

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
