//! Jobs, their events and lists.

use std::collections::HashSet;

use feedwave_store::{
    EventFilter, FindingCounts, Fingerprint, JobFilter, JobState, Kind, NewJob, NewReport, PageRequest, ProgramId,
    Store, StoreError, StoreSettings, Tenant,
};
use uuid::Uuid;

use super::{Place, json, new_job, open, with_program};

fn report(text: &str) -> NewReport {
    NewReport {
        report: json(text),
        findings: FindingCounts { errors: 1, warnings: 2, infos: 3 },
        summary: Some(json(r#"{"duration_s":1.5}"#)),
    }
}

#[tokio::test]
async fn a_job_is_kept_as_it_was_created() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let created = store.create_job(new_job("r-1", program)).await.unwrap();
    drop(store);
    let store = open(&place).await;
    let detail = store.job_detail(created.id).await.unwrap();
    assert_eq!(detail.machine_snapshot.get(), r#"{"axes":["X","Z"]}"#);
    assert_eq!(detail.settings.get(), r#"{"interpolation_period_us":1000}"#);
    for job in [detail.job, store.job(created.id).await.unwrap(), created] {
        assert_eq!((job.request_id.as_str(), job.display_name.as_str()), ("r-1", "job of r-1"));
        assert_eq!((job.program_id, job.program_size_bytes), (program, 16));
        assert_eq!((job.machine_id.as_str(), job.state), ("lathe-1", JobState::PendingValidation));
        assert_eq!((job.revision, job.findings), (1, None));
        assert!(job.summary.is_none() && job.created_us > 0 && job.created_us == job.updated_us);
    }
}

#[tokio::test]
async fn the_same_request_makes_one_job() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let mut creations = tokio::task::JoinSet::new();
    for _ in 0..100 {
        let store = store.clone();
        creations.spawn(async move { store.create_job(new_job("once", program)).await.unwrap().id });
    }
    let ids: HashSet<_> = creations.join_all().await.into_iter().collect();
    assert_eq!(ids.len(), 1);
    assert_eq!(store.events_after(0, &EventFilter::default(), 10).await.unwrap().len(), 1, "one creation is logged");
    assert_eq!(
        store.job_by_request(Tenant::DEFAULT, "once").await.unwrap().map(|(job, _)| job.id),
        ids.into_iter().next()
    );
    assert!(store.job_by_request(Tenant::DEFAULT, "never").await.unwrap().is_none());
}

#[tokio::test]
async fn the_same_request_with_other_content_conflicts() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let first = store.create_job(new_job("r", program)).await.unwrap();
    let other = Fingerprint::of([&b"other"[..]]);
    let refused = store.create_job(NewJob { fingerprint: other, ..new_job("r", program) }).await;
    assert!(matches!(refused, Err(StoreError::Conflict { job_id, .. }) if job_id == first.id), "{refused:?}");
    // A profile edited between two attempts is no other request.
    let edited = NewJob { machine_snapshot: json("{}"), ..new_job("r", program) };
    assert_eq!(store.create_job(edited).await.unwrap().id, first.id);
    assert_eq!(store.job_detail(first.id).await.unwrap().machine_snapshot.get(), r#"{"axes":["X","Z"]}"#);
}

#[tokio::test]
async fn a_job_needs_its_program_and_its_bounds() {
    let place = Place::new();
    let store = place.open(StoreSettings { max_document_bytes: 100, ..StoreSettings::default() }).await;
    let absent = ProgramId::of(b"absent");
    let refused = store.create_job(new_job("r", absent)).await;
    assert!(matches!(refused, Err(StoreError::NotFound { kind: Kind::Program, .. })), "{refused:?}");
    assert!(store.job_by_request(Tenant::DEFAULT, "r").await.unwrap().is_none());
    assert_eq!(store.latest_sequence(), 0);

    let large = json(&format!("\"{}\"", "x".repeat(100)));
    for job in [
        NewJob { settings: large.clone(), ..new_job("r", absent) },
        NewJob { machine_snapshot: large, ..new_job("r", absent) },
        new_job(&"r".repeat(5000), absent),
    ] {
        assert!(matches!(store.create_job(job).await, Err(StoreError::TooLarge { .. })));
    }
}

#[tokio::test]
async fn transitions_compare_store_and_log() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let job = store.create_job(new_job("r", program)).await.unwrap();
    use JobState::{PendingValidation, Ready, Rejected, Validating};
    let validating = store.transition(job.id, &[PendingValidation], Validating, "", None).await.unwrap();
    assert_eq!((validating.state, validating.revision), (Validating, 2));
    assert_ne!(validating.etag(), job.etag());
    assert!(matches!(store.report(job.id).await, Err(StoreError::NotFound { kind: Kind::Report, .. })));

    let rejected = store
        .transition(job.id, &[PendingValidation, Validating], Rejected, "one error", Some(report(r#"{"a":1}"#)))
        .await
        .unwrap();
    assert_eq!((rejected.state, rejected.state_detail.as_str()), (Rejected, "one error"));
    assert_eq!(rejected.findings, Some(FindingCounts { errors: 1, warnings: 2, infos: 3 }));
    assert_eq!(rejected.summary.as_ref().unwrap().get(), r#"{"duration_s":1.5}"#);
    assert!(rejected.updated_us > validating.updated_us && validating.updated_us > job.updated_us);
    assert_eq!(store.report(job.id).await.unwrap().report.get(), r#"{"a":1}"#);

    let refused = store.transition(job.id, &[Validating], Ready, "", Some(report(r#"{"b":2}"#))).await;
    match &refused {
        Err(StoreError::FailedState { actual: Rejected, expected, .. }) => assert_eq!(expected, &[Validating]),
        other => panic!("{other:?}"),
    }
    assert_eq!(store.report(job.id).await.unwrap().report.get(), r#"{"a":1}"#, "a refused change stores nothing");

    let log =
        store.events_after(0, &EventFilter { job_id: Some(job.id), ..EventFilter::default() }, 100).await.unwrap();
    let changes: Vec<_> = log.iter().map(|event| (event.from_state, event.to_state, event.detail.as_str())).collect();
    assert_eq!(
        changes,
        [
            (None, Some(PendingValidation), ""),
            (Some(PendingValidation), Some(Validating), ""),
            (Some(Validating), Some(Rejected), "one error"),
        ]
    );
    assert_eq!(log.last().unwrap().at_us, rejected.updated_us);
    let absent = store.transition(Uuid::now_v7(), &[Validating], Ready, "", None).await;
    assert!(matches!(absent, Err(StoreError::NotFound { kind: Kind::Job, .. })));
}

#[tokio::test]
async fn of_racing_transitions_one_wins() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let job = store.create_job(new_job("r", program)).await.unwrap();
    let mut changes = tokio::task::JoinSet::new();
    for to in [JobState::Ready, JobState::Cancelled, JobState::Failed, JobState::Rejected] {
        let store = store.clone();
        changes.spawn(async move { store.transition(job.id, &[JobState::PendingValidation], to, "", None).await });
    }
    let outcomes = changes.join_all().await;
    let won: Vec<_> = outcomes.iter().filter_map(|outcome| outcome.as_ref().ok()).collect();
    assert_eq!(won.len(), 1, "{outcomes:?}");
    assert_eq!(store.job(job.id).await.unwrap().state, won[0].state);
}

#[tokio::test]
async fn large_reports_come_back_whole() {
    let place = Place::new();
    let limits = StoreSettings { max_report_bytes: 3_000_000, ..StoreSettings::default() };
    let store = place.open(limits).await;
    let program = store.put_program(Tenant::DEFAULT, "M30".into()).await.unwrap().id;
    let job = store.create_job(new_job("r", program)).await.unwrap();
    let text = format!("[{}0]", "123456789.125,".repeat(200_000));
    store.transition(job.id, &JobState::ALL, JobState::Ready, "", Some(report(&text))).await.unwrap();
    assert_eq!(store.report(job.id).await.unwrap().report.get(), text);
    let text = format!("[{}0]", "123456789.125,".repeat(300_000));
    let refused = store.transition(job.id, &JobState::ALL, JobState::Failed, "", Some(report(&text))).await;
    assert!(matches!(refused, Err(StoreError::TooLarge { limit: 3_000_000, .. })));
    assert_eq!(store.job(job.id).await.unwrap().state, JobState::Ready);
}

#[tokio::test]
async fn deleting_a_job_leaves_its_log() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let job = store.create_job(new_job("r", program)).await.unwrap();
    let ready = store
        .transition(job.id, &[JobState::PendingValidation], JobState::Ready, "", Some(report("{}")))
        .await
        .unwrap();
    let refused = store.delete_job(job.id, Some(&job.etag())).await;
    assert!(
        matches!(&refused, Err(StoreError::EtagMismatch { current, .. }) if *current == ready.etag()),
        "{refused:?}"
    );
    store.delete_job(job.id, Some(&ready.etag())).await.unwrap();
    assert!(matches!(store.job(job.id).await, Err(StoreError::NotFound { kind: Kind::Job, .. })));
    assert!(matches!(store.report(job.id).await, Err(StoreError::NotFound { kind: Kind::Job, .. })));
    assert!(matches!(store.delete_job(job.id, None).await, Err(StoreError::NotFound { .. })));
    let log =
        store.events_after(0, &EventFilter { job_id: Some(job.id), ..EventFilter::default() }, 100).await.unwrap();
    let last = log.last().unwrap();
    assert_eq!((log.len(), last.from_state, last.to_state), (3, Some(JobState::Ready), None));
    // The request id is free again.
    assert_ne!(store.create_job(new_job("r", program)).await.unwrap().id, job.id);
}

#[tokio::test]
async fn events_are_followed_without_gaps() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let mut watch = store.watch_events();
    let follower = tokio::spawn({
        let store = store.clone();
        async move {
            let mut seen = Vec::new();
            while seen.len() < 60 {
                let after = seen.last().copied().unwrap_or(0);
                let events = store.events_after(after, &EventFilter::default(), 7).await.unwrap();
                if events.is_empty() {
                    // Only a sequence beyond what was read is waited for, so none is missed.
                    watch.wait_for(|newest| *newest > after).await.unwrap();
                }
                seen.extend(events.iter().map(|event| event.sequence));
            }
            seen
        }
    });
    let mut creations = tokio::task::JoinSet::new();
    for index in 0..60 {
        let store = store.clone();
        creations.spawn(async move { store.create_job(new_job(&index.to_string(), program)).await.unwrap() });
    }
    creations.join_all().await;
    assert_eq!(follower.await.unwrap(), (1..=60).collect::<Vec<_>>());
    assert_eq!(store.latest_sequence(), 60);
    drop(store);
    assert_eq!(open(&place).await.latest_sequence(), 60, "the position survives");
}

async fn all_pages(store: &Store, filter: &JobFilter, size: u32) -> Vec<Uuid> {
    let (mut ids, mut token) = (Vec::new(), String::new());
    loop {
        let page = store.list_jobs(filter, &PageRequest { size, token }).await.unwrap();
        assert!(page.items.len() <= size as usize);
        ids.extend(page.items.iter().map(|job| job.id));
        match page.next_token {
            Some(next) => token = next,
            None => return ids,
        }
    }
}

#[tokio::test]
async fn lists_filter_and_page_newest_first() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let mut jobs = Vec::new();
    for index in 0..30 {
        let machine_id = format!("lathe-{}", index % 3);
        let job = NewJob { machine_id, ..new_job(&index.to_string(), program) };
        let mut job = store.create_job(job).await.unwrap();
        if index % 2 == 0 {
            job = store.transition(job.id, &JobState::ALL, JobState::Ready, "", None).await.unwrap();
        }
        jobs.push(job);
    }
    jobs.reverse();
    let (from, before) = (jobs[20].created_us, jobs[5].created_us);
    let ready = vec![JobState::Ready];
    let machine_id = Some("lathe-1".to_owned());
    for filter in [
        JobFilter::default(),
        JobFilter { states: ready.clone(), ..JobFilter::default() },
        JobFilter { states: vec![JobState::Ready, JobState::PendingValidation], ..JobFilter::default() },
        JobFilter { states: vec![JobState::Failed], ..JobFilter::default() },
        JobFilter { machine_id: machine_id.clone(), ..JobFilter::default() },
        JobFilter { created_from_us: Some(from), created_before_us: Some(before), ..JobFilter::default() },
        JobFilter {
            tenant: None,
            states: ready,
            machine_id,
            created_from_us: Some(from),
            created_before_us: Some(before),
        },
    ] {
        let expected: Vec<_> = jobs
            .iter()
            .filter(|job| filter.states.is_empty() || filter.states.contains(&job.state))
            .filter(|job| filter.machine_id.as_ref().is_none_or(|machine| *machine == job.machine_id))
            .filter(|job| filter.created_from_us.is_none_or(|from| job.created_us >= from))
            .filter(|job| filter.created_before_us.is_none_or(|before| job.created_us < before))
            .map(|job| job.id)
            .collect();
        for size in [1, 4, 10, 30, 500] {
            assert_eq!(all_pages(&store, &filter, size).await, expected, "{filter:?} by {size}");
        }
    }
    let mut counts = store.count_jobs(None).await.unwrap();
    counts.sort();
    assert_eq!(counts, [(JobState::PendingValidation, 15), (JobState::Ready, 15)]);
    let pending = store.jobs_in_state(&[JobState::PendingValidation, JobState::Validating], 4).await.unwrap();
    let oldest = jobs.iter().rev().filter(|job| job.state == JobState::PendingValidation).map(|job| job.id);
    assert_eq!(pending, oldest.take(4).collect::<Vec<_>>());
    assert!(store.jobs_in_state(&[], 4).await.unwrap().is_empty());
}

#[tokio::test]
async fn pages_are_bounded_and_stable_while_inserting() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let mut old = Vec::new();
    for index in 0..120 {
        old.push(store.create_job(new_job(&index.to_string(), program)).await.unwrap().id);
    }
    old.reverse();
    let filter = JobFilter::default();
    let first = store.list_jobs(&filter, &PageRequest::default()).await.unwrap();
    assert_eq!(first.items.len(), 50, "the default size");
    let mut seen: Vec<_> = first.items.iter().map(|job| job.id).collect();
    let mut token = first.next_token;
    let mut inserted = 0;
    while let Some(next) = token {
        for _ in 0..3 {
            inserted += 1;
            store.create_job(new_job(&format!("late {inserted}"), program)).await.unwrap();
        }
        let page = store.list_jobs(&filter, &PageRequest { size: 10, token: next }).await.unwrap();
        seen.extend(page.items.iter().map(|job| job.id));
        token = page.next_token;
    }
    assert_eq!(seen, old, "neither repeated nor skipped nor mixed with later ones");
    let huge = store.list_jobs(&filter, &PageRequest { size: u32::MAX, ..PageRequest::default() }).await.unwrap();
    assert_eq!(huge.items.len(), 120 + inserted);
}

#[tokio::test]
async fn foreign_and_damaged_tokens_are_refused() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    for index in 0..3 {
        store.create_job(new_job(&index.to_string(), program)).await.unwrap();
        store.create_tool(None, index, json("{}")).await.unwrap();
    }
    let filter = JobFilter::default();
    let page = |token: &str| PageRequest { size: 1, token: token.to_owned() };
    let token = store.list_jobs(&filter, &page("")).await.unwrap().next_token.unwrap();
    store.list_jobs(&filter, &page(&token)).await.unwrap();
    let tools = store.list_tools(&Default::default(), &page("")).await.unwrap().next_token.unwrap();

    for other in [
        JobFilter { states: vec![JobState::Ready], ..JobFilter::default() },
        JobFilter { machine_id: Some(String::new()), ..JobFilter::default() },
        JobFilter { created_from_us: Some(0), ..JobFilter::default() },
        JobFilter { created_before_us: Some(0), ..JobFilter::default() },
    ] {
        let refused = store.list_jobs(&other, &page(&token)).await;
        assert!(matches!(refused, Err(StoreError::InvalidPageToken)), "{other:?}");
    }
    let long = token.repeat(100);
    for garbage in [" ", "x", "====", "\u{0}", "ü", &tools, &token[1..], &token[..token.len() - 2], &long] {
        let refused = store.list_jobs(&filter, &page(garbage)).await;
        assert!(matches!(refused, Err(StoreError::InvalidPageToken)), "{garbage:?}");
        if garbage != tools {
            let refused = store.list_tools(&Default::default(), &page(garbage)).await;
            assert!(matches!(refused, Err(StoreError::InvalidPageToken)), "{garbage:?}");
            assert!(matches!(store.list_machines(&page(garbage)).await, Err(StoreError::InvalidPageToken)));
        }
    }
}
