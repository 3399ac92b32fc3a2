//! Tenants: the same program and the same request id in two of them, and lists of one.

use feedwave_store::{
    DecisionFilter, EventFilter, JobFilter, JobState, NewDecision, NewJob, NewRun, PageRequest, ProgramId, RunCommit,
    RunKind, Store, StoreError, Tenant, UploadStart,
};

use crate::{Place, json, new_job, open, read_back};

const PROGRAM: &str = "G1 X10 F100\nM30\n";

fn tenants() -> [Tenant; 3] {
    ["a".parse().unwrap(), "b".parse().unwrap(), Tenant::DEFAULT]
}

async fn job_of(store: &Store, tenant: Tenant, program: ProgramId) -> feedwave_store::Job {
    let new = NewJob { tenant, owner: format!("planner of {tenant}"), ..new_job("the same", program) };
    store.create_job(new).await.unwrap()
}

#[tokio::test]
async fn the_same_program_of_two_tenants_is_two_programs() {
    let place = Place::new();
    let store = open(&place).await;
    let [a, b, default] = tenants();
    let of_a = store.put_program(a, PROGRAM.into()).await.unwrap();
    assert_eq!(of_a.id.tenant(), a);
    let id = ProgramId::of(PROGRAM.as_bytes());
    for other in [b, default] {
        let error = store.program_info(id.of_tenant(other)).await.unwrap_err();
        // The message has the hash alone: it does not tell one tenant from another.
        assert_eq!(
            error.to_string(),
            store
                .program_info(ProgramId::of(b"never").of_tenant(other))
                .await
                .unwrap_err()
                .to_string()
                .replace(&ProgramId::of(b"never").to_string(), &id.to_string())
        );
        assert!(store.list_programs(Some(other), "", &PageRequest::default()).await.unwrap().items.is_empty());
    }

    // An upload of the same bytes has to bring them all.
    let size = PROGRAM.len() as u64;
    let UploadStart::Unfinished(upload) = store.begin_upload(id.of_tenant(b), size, "").await.unwrap() else {
        panic!("another tenant's program was told of");
    };
    let UploadStart::Unfinished(again) = store.begin_upload(id.of_tenant(default), size, "").await.unwrap() else {
        panic!("another tenant's program was told of");
    };
    assert_ne!(upload.id, again.id);
    assert_eq!(upload.expected.tenant(), b);
    store.append_upload(upload.id, 0, PROGRAM.into()).await.unwrap();
    let of_b = store.finish_upload(upload.id).await.unwrap();
    store.name_program(of_b.id, "b.nc").await.unwrap();
    assert_eq!(store.program_entry(of_a.id).await.unwrap().file_name, "");
    assert_eq!(of_b.id, id.of_tenant(b));

    // Each uses and deletes its own.
    job_of(&store, b, id).await;
    assert!(matches!(store.delete_program(of_b.id).await, Err(StoreError::InUse { users: 1, .. })));
    assert_eq!(store.program_entry(of_a.id).await.unwrap().job_count, 0);
    store.delete_program(of_a.id).await.unwrap();
    assert_eq!(read_back(&store, of_b.id).await, PROGRAM.as_bytes());
    let missing = NewJob { tenant: a, ..new_job("x", id) };
    assert!(matches!(store.create_job(missing).await, Err(StoreError::NotFound { .. })));
    drop(store);
    let store = open(&place).await;
    assert_eq!(store.list_programs(None, "", &PageRequest::default()).await.unwrap().items.len(), 1);
    assert_eq!(store.uploads().await.unwrap()[0].expected, id);
}

#[tokio::test]
async fn lists_counts_and_logs_are_of_one_tenant() {
    let place = Place::new();
    let store = open(&place).await;
    let mut jobs = Vec::new();
    for tenant in tenants() {
        let program = store.put_program(tenant, PROGRAM.into()).await.unwrap().id;
        let job = job_of(&store, tenant, program).await;
        assert_eq!((job.tenant, job.request_id.as_str(), job.program_id), (tenant, "the same", program));
        assert_eq!(job_of(&store, tenant, program).await.id, job.id, "the request id is known in its tenant");
        jobs.push(job);
    }
    store.transition(jobs[1].id, &[JobState::PendingValidation], JobState::Cancelled, "", None).await.unwrap();
    for (tenant, job) in tenants().into_iter().zip(&jobs) {
        let filter = JobFilter { tenant: Some(tenant), ..JobFilter::default() };
        let listed = store.list_jobs(&filter, &PageRequest::default()).await.unwrap().items;
        assert_eq!(listed.iter().map(|job| job.id).collect::<Vec<_>>(), [job.id]);
        assert_eq!(listed[0].owner, format!("planner of {tenant}"));
        assert_eq!(store.job_by_request(tenant, "the same").await.unwrap().unwrap().0.id, job.id);
        let state = store.job(job.id).await.unwrap().state;
        assert_eq!(store.count_jobs(Some(tenant)).await.unwrap(), [(state, 1)]);
        let filter = EventFilter { tenant: Some(tenant), job_id: None };
        let events = store.events_after(0, &filter, 10).await.unwrap();
        assert!(events.iter().all(|event| event.job_id == job.id && event.tenant == tenant) && !events.is_empty());
        assert_eq!(store.newest_event(tenant).await.unwrap(), events.last().unwrap().sequence);

        let new = NewRun { job_id: job.id, kind: RunKind::Telemetry, settings: json("{}"), monitor: "m".into() };
        let run = store.create_run(new).await.unwrap();
        assert_eq!(run.run.tenant, tenant);
        let decision = NewDecision { number: 0, action: "stop", body: "d".into(), raises_condition: true };
        let commit = RunCommit { decisions: vec![decision], ..RunCommit::default() };
        store.commit_run(run.run.id, run.attachment, commit).await.unwrap();
    }
    for (tenant, job) in tenants().into_iter().zip(&jobs) {
        let runs = store.list_runs(Some(tenant), None, &PageRequest::default()).await.unwrap().items;
        assert_eq!(runs.iter().map(|run| run.job_id).collect::<Vec<_>>(), [job.id]);
        assert_eq!(store.count_open_conditions(Some(tenant)).await.unwrap(), 1);
        let filter = DecisionFilter { tenant: Some(tenant), ..DecisionFilter::default() };
        let decisions = store.decisions_after(0, &filter, 10).await.unwrap();
        assert_eq!(decisions.iter().map(|decision| decision.job_id).collect::<Vec<_>>(), [job.id]);
    }
    assert_eq!(store.count_open_conditions(None).await.unwrap(), 3);
    // A token of one tenant's list is none of another's.
    let page = PageRequest { size: 1, token: String::new() };
    let program = store.put_program(Tenant::DEFAULT, "M2\n".into()).await.unwrap().id;
    store.create_job(new_job("further", program)).await.unwrap();
    let of = |tenant| JobFilter { tenant, ..JobFilter::default() };
    let token = store.list_jobs(&of(Some(Tenant::DEFAULT)), &page).await.unwrap().next_token.unwrap();
    let elsewhere = PageRequest { size: 1, token };
    for other in [None, Some(tenants()[0])] {
        let refused = store.list_jobs(&of(other), &elsewhere).await;
        assert!(matches!(refused, Err(StoreError::InvalidPageToken)));
    }
}
