//! Replicas that share a database of a PostgreSQL server. The tests need a server: `tests/postgres/run.sh` starts one and
//! says in `FEEDWAVE_TEST_STORE` where it is.

#[path = "../../../../tests/src/database.rs"]
mod database;

mod audit;
#[path = "../common/mod.rs"]
mod common;
mod connections;
mod proxy;
mod tls;

use std::collections::HashSet;
use std::time::Duration;

use feedwave_store::{
    Attempt, AuditFilter, AuditRequest, CopyError, DecisionFilter, EventFilter, FindingCounts, JobState, NewDecision,
    NewJob, NewReport, NewRun, PageRequest, Presence, ProgramId, RawValue, RunCommit, RunKind, Store, StoreError,
    StoreSettings, StoreUri, Tenant,
};
use sqlx::postgres::PgConnectOptions;
use sqlx::{ConnectOptions as _, PgConnection};
use tempfile::TempDir;
use tokio::time::timeout;
use url::Url;
use uuid::Uuid;

use common::new_job;
use database::Database;
use proxy::Proxy;

/// Far more than it takes to find that a connection is silent, and far less than a statement may take.
const SOON: Duration = Duration::from_secs(25);

/// A database of its own on the server.
struct Place {
    uri: String,
    _database: Database,
}

impl Place {
    fn new() -> Self {
        let pattern = std::env::var("FEEDWAVE_TEST_STORE").expect("FEEDWAVE_TEST_STORE: tests/postgres/run.sh sets it");
        assert!(pattern.starts_with("postgres://"), "{pattern}");
        let database = Database::new(&pattern, &format!("test-{}", Uuid::now_v7()));
        Self { uri: database.uri.clone(), _database: database }
    }

    fn store_uri(&self) -> StoreUri {
        self.uri.parse().unwrap()
    }

    /// One more replica.
    async fn open(&self) -> Store {
        Store::open(&self.store_uri(), StoreSettings::default()).await.unwrap()
    }

    /// One more replica, and its way to the server.
    async fn open_by_proxy(&self) -> (Store, Proxy) {
        let mut url: Url = self.uri.parse().unwrap();
        let proxy = Proxy::to(url.port().unwrap()).await;
        url.set_port(Some(proxy.port())).unwrap();
        (Store::open(&url.as_str().parse().unwrap(), StoreSettings::default()).await.unwrap(), proxy)
    }

    /// A connection past every store.
    async fn raw(&self) -> PgConnection {
        self.uri.split('?').next().unwrap().parse::<PgConnectOptions>().unwrap().connect().await.unwrap()
    }

    async fn execute(&self, sql: &'static str) -> u64 {
        sqlx::query(sql).execute(&mut self.raw().await).await.unwrap().rows_affected()
    }
}

async fn program(store: &Store) -> ProgramId {
    store.put_program(Tenant::DEFAULT, "M30\n".into()).await.unwrap().id
}

fn decision(number: u64) -> RunCommit {
    let body = number.to_le_bytes().to_vec().into();
    let decision = NewDecision { number, action: "change", body, raises_condition: number.is_multiple_of(5) };
    RunCommit { decisions: vec![decision], ..RunCommit::default() }
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn replicas_that_start_together_make_one_schema() {
    let place = Place::new();
    let opened = tokio::join!(place.open(), place.open(), place.open(), place.open());
    let id = program(&opened.0).await;
    for store in [&opened.1, &opened.2, &opened.3] {
        assert_eq!(store.program_info(id).await.unwrap().size_bytes, 4);
    }
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn every_replica_sees_every_event_once_and_in_order() {
    const REPLICAS: usize = 3;
    const JOBS: usize = 40;
    let place = Place::new();
    let stores = [place.open().await, place.open().await, place.open().await];
    let program = program(&stores[0]).await;
    let mut followers = tokio::task::JoinSet::new();
    for store in stores.clone() {
        followers.spawn(async move {
            let mut newest = store.watch_events();
            let mut seen: Vec<_> = Vec::new();
            while seen.len() < REPLICAS * JOBS {
                let after = seen.last().map_or(0, |(sequence, _)| *sequence);
                // Only what was announced is read, so a number that becomes visible late would be missed.
                let announced = *newest.wait_for(|newest| *newest > after).await.unwrap();
                let events = store.events_after(after, &EventFilter::default(), 1_000).await.unwrap();
                assert!(events.last().unwrap().sequence >= announced);
                seen.extend(events.iter().map(|event| (event.sequence, event.job_id)));
            }
            seen
        });
    }
    let mut creations = tokio::task::JoinSet::new();
    for (replica, store) in stores.iter().enumerate() {
        for job in 0..JOBS {
            let store = store.clone();
            creations
                .spawn(async move { store.create_job(new_job(&format!("{replica}/{job}"), program)).await.unwrap() });
        }
    }
    let created: HashSet<_> = creations.join_all().await.into_iter().map(|job| (job.sequence, job.id)).collect();
    let seen = followers.join_all().await;
    assert!(seen[0].iter().map(|(sequence, _)| *sequence).eq(1..=i64::try_from(REPLICAS * JOBS).unwrap()));
    assert_eq!(seen[0].iter().copied().collect::<HashSet<_>>(), created);
    assert!(seen.iter().all(|each| *each == seen[0]));
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn one_request_to_several_replicas_makes_one_job() {
    let place = Place::new();
    let stores = [place.open().await, place.open().await];
    let program = program(&stores[0]).await;
    let mut creations = tokio::task::JoinSet::new();
    for index in 0..40 {
        let store = stores[index % 2].clone();
        creations.spawn(async move { store.create_job(new_job("once", program)).await.unwrap().id });
    }
    assert_eq!(creations.join_all().await.into_iter().collect::<HashSet<_>>().len(), 1);
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_run_is_who_took_it_up_last() {
    let place = Place::new();
    let (first, second) = (place.open().await, place.open().await);
    let job_id = first.create_job(new_job("r", program(&first).await)).await.unwrap().id;
    let settings = RawValue::from_string("{}".into()).unwrap();
    let new = NewRun { job_id, kind: RunKind::Live, settings, monitor: vec![7; 100].into() };
    let run = first.create_run(new).await.unwrap();
    let id = run.run.id;
    first.commit_run(id, run.attachment, decision(0)).await.unwrap();
    let taken = second.attach_run(id).await.unwrap();
    assert_eq!(taken.monitor, vec![7; 100]);
    let refused = first.commit_run(id, run.attachment, decision(1)).await;
    assert!(matches!(refused, Err(StoreError::Detached { run_id }) if run_id == id), "{refused:?}");
    second.commit_run(id, taken.attachment, decision(1)).await.unwrap();
    let numbers: Vec<_> = first.decisions_after(0, &DecisionFilter::default(), 10).await.unwrap();
    assert_eq!(
        numbers.iter().map(|decision| (decision.sequence, decision.number)).collect::<Vec<_>>(),
        [(1, 0), (2, 1)]
    );
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_validation_is_one_replica_s_as_long_as_that_says_so() {
    let place = Place::new();
    let (first, second) = (place.open().await, place.open().await);
    let id = first.create_job(new_job("r", program(&first).await)).await.unwrap().id;
    assert_eq!(first.begin_validation(id, 3).await.unwrap(), Attempt::Begun(1));
    assert_eq!(second.begin_validation(id, 3).await.unwrap(), Attempt::Elsewhere);
    assert!(first.renew_validation(id).await.unwrap());
    assert!(!second.renew_validation(id).await.unwrap());
    assert!(second.abandoned_jobs(10).await.unwrap().is_empty());
    // What another replica has is not given back.
    second.return_attempt(id).await.unwrap();
    assert_eq!(second.begin_validation(id, 3).await.unwrap(), Attempt::Elsewhere);

    // Broken off in order, it is anybody's, and counts as no attempt.
    first.return_attempt(id).await.unwrap();
    assert_eq!(second.abandoned_jobs(10).await.unwrap()[0].id, id);
    assert_eq!(second.begin_validation(id, 3).await.unwrap(), Attempt::Begun(1));

    // The second one is heard of no more: its time is over.
    assert_eq!(place.execute("UPDATE jobs SET lease_until_us = 1").await, 1);
    assert_eq!(first.abandoned_jobs(10).await.unwrap()[0].id, id);
    assert_eq!(first.begin_validation(id, 3).await.unwrap(), Attempt::Begun(2));
    assert!(!second.renew_validation(id).await.unwrap());
    // Its result is not wanted any more, whatever became of the job.
    let stolen = second.end_validation(id, JobState::Rejected, "", None).await;
    assert!(matches!(stolen, Err(StoreError::FailedState { actual: JobState::Validating, .. })), "{stolen:?}");
    first.end_validation(id, JobState::Ready, "", None).await.unwrap();
    let late = second.end_validation(id, JobState::Rejected, "", None).await;
    assert!(matches!(late, Err(StoreError::FailedState { actual: JobState::Ready, .. })), "{late:?}");
    assert!(first.abandoned_jobs(10).await.unwrap().is_empty());
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_replica_takes_up_what_an_earlier_one_of_its_name_had_but_not_what_one_has_that_runs() {
    let place = Place::new();
    let named = || async {
        let settings = StoreSettings { replica_name: "pod-1".into(), ..StoreSettings::default() };
        Store::open(&place.store_uri(), settings).await.unwrap()
    };
    let probed = |store: Store| async move {
        store.probe(SOON).await.unwrap();
        store
    };
    let (first, second) = (probed(named().await).await, named().await);
    let program = program(&first).await;
    let job = first.create_job(new_job("r", program)).await.unwrap().id;
    assert_eq!(first.begin_validation(job, 9).await.unwrap(), Attempt::Begun(1));
    // The first has not been heard of since the second began: it is taken for gone.
    let second = probed(second).await;
    assert_eq!(second.begin_validation(job, 9).await.unwrap(), Attempt::Begun(2));
    // Both run, and each knows it of the other.
    let (first, second) = (probed(first).await, probed(second).await);
    assert_eq!(first.begin_validation(job, 9).await.unwrap(), Attempt::Elsewhere);
    assert!(second.renew_validation(job).await.unwrap());
    let other = second.create_job(new_job("s", program)).await.unwrap().id;
    assert_eq!(first.begin_validation(other, 9).await.unwrap(), Attempt::Begun(1));
    assert_eq!(second.begin_validation(other, 9).await.unwrap(), Attempt::Elsewhere);
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn writes_outlive_their_connections() {
    let place = Place::new();
    let store = place.open().await;
    let program = program(&store).await;
    let cutter = tokio::spawn({
        let uri = place.uri.clone();
        async move {
            let mut raw = uri.split('?').next().unwrap().parse::<PgConnectOptions>().unwrap().connect().await.unwrap();
            for _ in 0..30 {
                sqlx::query(
                    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity
                     WHERE datname = CURRENT_DATABASE() AND pid <> pg_backend_pid()",
                )
                .execute(&mut raw)
                .await
                .unwrap();
                tokio::task::yield_now().await;
            }
        }
    });
    let mut acknowledged = Vec::new();
    let mut index = 0;
    while !cutter.is_finished() || acknowledged.len() < 20 {
        index += 1;
        // A commit that was not answered is the only thing that is not done again.
        match store.create_job(new_job(&index.to_string(), program)).await {
            Ok(job) => acknowledged.push(job.id),
            Err(StoreError::Unavailable { .. }) => {}
            Err(error) => panic!("{error}"),
        }
    }
    cutter.await.unwrap();
    let mut raw = place.raw().await;
    let ids: Vec<String> = sqlx::query_scalar("SELECT id FROM jobs").fetch_all(&mut raw).await.unwrap();
    let ids: HashSet<_> = ids.into_iter().collect();
    assert!(acknowledged.iter().all(|id| ids.contains(&id.to_string())), "an acknowledged job is gone");
    let (events, newest): (i64, i64) =
        sqlx::query_as("SELECT (SELECT COUNT(*) FROM job_events), (SELECT newest FROM counters WHERE name = 'event')")
            .fetch_one(&mut raw)
            .await
            .unwrap();
    assert_eq!((events, newest), (ids.len() as i64, ids.len() as i64), "no gap, and nothing twice");
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_character_that_the_server_cannot_keep_is_refused_as_such() {
    let place = Place::new();
    let store = place.open().await;
    let program = program(&store).await;
    let refused = store.create_job(new_job("a\0b", program)).await;
    assert!(matches!(refused, Err(StoreError::NulCharacter)), "{refused:?}");
    assert!(matches!(store.name_program(program, "\0").await, Err(StoreError::NulCharacter)));
    store.create_job(new_job("größe\u{1}\u{10ffff}", program)).await.unwrap();
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn what_is_not_ours_or_newer_is_refused() {
    let place = Place::new();
    place.open().await.close().await;
    place.execute("INSERT INTO _sqlx_migrations SELECT 9999, 'later', now(), true, ''::bytea, 0").await;
    let refused = Store::open(&place.store_uri(), StoreSettings::default()).await.err().unwrap();
    assert!(matches!(&refused, StoreError::Incompatible(_)), "{refused}");
    assert!(refused.to_string().contains("it has migration 9999"), "{refused}");

    let place = Place::new();
    place.open().await.close().await;
    place.execute("DROP TABLE feedwave").await;
    let refused = Store::open(&place.store_uri(), StoreSettings::default()).await.err().unwrap();
    assert!(refused.to_string().contains("it has tables of another program"), "{refused}");

    let uri = place.uri.replace("feedwave@", "nobody@");
    let refused = Store::open(&uri.parse().unwrap(), StoreSettings::default()).await.err().unwrap();
    assert!(matches!(refused, StoreError::CannotOpen { .. }), "{refused}");

    // Broken off before the first migration: that of nobody yet.
    let place = Place::new();
    place.open().await.close().await;
    place.execute("DROP SCHEMA public CASCADE").await;
    place.execute("CREATE SCHEMA public").await;
    place
        .execute(
            "CREATE TABLE _sqlx_migrations (version BIGINT PRIMARY KEY, description TEXT NOT NULL,
                installed_on TIMESTAMPTZ NOT NULL DEFAULT now(), success BOOLEAN NOT NULL, checksum BYTEA NOT NULL,
                execution_time BIGINT NOT NULL)",
        )
        .await;
    program(&place.open().await).await;
}

// One copy with a record of every kind, and what goes on behind each.
#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_file_is_copied_whole_or_not_at_all() {
    let folder = TempDir::new().unwrap();
    let from = StoreUri::of_file(&folder.path().join("feedwave.db")).unwrap();
    let store = Store::open(&from, StoreSettings::default()).await.unwrap();
    let source: Vec<u8> = (0..3_000_000_u32).flat_map(u32::to_le_bytes).collect();
    let large = store.put_program(Tenant::DEFAULT, source.into()).await.unwrap();
    let mut jobs = Vec::new();
    for index in 0..700 {
        jobs.push(store.create_job(new_job(&format!("größe {index}"), large.id)).await.unwrap());
    }
    store.delete_job(jobs[699].id, None).await.unwrap();
    let settings = RawValue::from_string("{}".into()).unwrap();
    let new = NewRun { job_id: jobs[0].id, kind: RunKind::Live, settings, monitor: vec![7; 100].into() };
    let run = store.create_run(new).await.unwrap();
    for number in 0..7 {
        store.commit_run(run.run.id, run.attachment, decision(number)).await.unwrap();
    }
    store.create_tool(Some("t"), 7, RawValue::from_string("[1]".into()).unwrap()).await.unwrap();
    let tenant: Tenant = "plant-b".parse().unwrap();
    let other = store.put_program(tenant, "M30\n".into()).await.unwrap().id;
    let theirs = NewJob { tenant, owner: "b".into(), ..new_job("größe 1", other) };
    let theirs = store.create_job(theirs).await.unwrap();
    let asked = AuditRequest { method: "/a/b".into(), ..AuditRequest::default() };
    let audited = store.begin_audit(asked.clone(), None).await.unwrap();
    let entries = store.audit_after(0, &AuditFilter::default(), 10).await.unwrap();
    let events = store.events_after(0, &EventFilter::default(), 1_000).await.unwrap();
    let to = Place::new();
    let refused = feedwave_store::copy(&format!("{from}?busy_timeout_s=0").parse().unwrap(), &to.store_uri()).await;
    assert!(matches!(refused, Err(CopyError::From(StoreError::InUseBy { .. }))), "{refused:?}");
    store.close().await;
    drop(store);

    let tables = feedwave_store::copy(&from, &to.store_uri()).await.unwrap();
    let rows = |name: &str| tables.iter().find(|copy| copy.table == name).unwrap().rows;
    assert_eq!((rows("jobs"), rows("program_chunks"), rows("decisions")), (700, 13, 7));
    let again = feedwave_store::copy(&from, &to.store_uri()).await;
    assert!(matches!(again, Err(CopyError::To(StoreError::CannotOpen { .. }))), "{again:?}");

    let store = to.open().await;
    assert_eq!(store.events_after(0, &EventFilter::default(), 1_000).await.unwrap(), events);
    assert_eq!(store.latest_sequence(), events.last().unwrap().sequence);
    let mut hash = Vec::new();
    for index in 0..large.chunk_count {
        hash.extend_from_slice(&store.program_chunk(large.id, index).await.unwrap());
    }
    assert_eq!(ProgramId::of(&hash), large.id);
    let newest = store.list_jobs(&Default::default(), &PageRequest::default()).await.unwrap().items.remove(0);
    assert_eq!((newest.id, newest.tenant, newest.program_id, newest.owner.as_str()), (theirs.id, tenant, other, "b"));
    assert_eq!(store.audit_after(0, &AuditFilter::default(), 10).await.unwrap(), entries);
    // Everything goes on where it was.
    let followed = entries.last().unwrap().change;
    assert_eq!(store.begin_audit(asked, None).await.unwrap(), audited + 1);
    let entries = store.audit_changed_after(followed, &AuditFilter::default(), 10).await.unwrap();
    assert_eq!(
        entries.iter().map(|entry| (entry.sequence, entry.change)).collect::<Vec<_>>(),
        [(audited + 1, followed + 1)]
    );
    let next = store.create_job(new_job("next", large.id)).await.unwrap();
    assert_eq!(next.sequence, events.last().unwrap().sequence + 1);
    let taken = store.attach_run(run.run.id).await.unwrap();
    let records = store.commit_run(run.run.id, taken.attachment, decision(7)).await.unwrap();
    assert_eq!(records[0].sequence, 8);
    store.put_program(Tenant::DEFAULT, "another\n".into()).await.unwrap();
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn what_one_replica_tells_of_runs_the_others_hear_until_it_is_taken_back() {
    let place = Place::new();
    let (first, second) = (place.open().await, place.open().await);
    let (run, tenant) = (Uuid::now_v7(), "plant".parse::<Tenant>().unwrap());
    let presence = |body: &'static [u8]| Presence {
        run_id: run,
        tenant,
        sequence: 7,
        is_connected: true,
        body: bytes::Bytes::from_static(body),
    };
    let (mut rung, own) = (second.watch_presences(), first.watch_presences());
    first.tell_presences(vec![presence(b"one")], Vec::new(), true).await.unwrap();
    timeout(Duration::from_secs(60), rung.changed()).await.expect("it rings").unwrap();
    assert!(!own.has_changed().unwrap(), "nobody rings itself");
    let heard = second.presences(Duration::MAX).await.unwrap();
    let [told] = &heard[..] else { panic!("{heard:?}") };
    assert_eq!((told.run_id, told.tenant, told.sequence, told.is_connected), (run, tenant, 7, true));
    assert_eq!(told.body.as_deref(), Some(&b"one"[..]));
    assert_eq!(first.presences(Duration::MAX).await.unwrap(), [], "nobody hears itself");
    // What was told before is not told again.
    let again = second.presences(Duration::ZERO).await.unwrap();
    assert_eq!((again[0].told_us, &again[0].body), (told.told_us, &None));
    second.tell_presences(vec![presence(b"three")], Vec::new(), false).await.unwrap();
    first.tell_presences(vec![presence(b"two")], Vec::new(), false).await.unwrap();
    let newer = second.presences(Duration::MAX).await.unwrap();
    assert_eq!((newer.len(), newer[0].body.as_deref()), (1, Some(&b"two"[..])));
    assert!(newer[0].told_us > told.told_us);
    first.tell_presences(Vec::new(), vec![run], false).await.unwrap();
    assert_eq!(second.presences(Duration::MAX).await.unwrap(), []);
    assert_eq!(first.presences(Duration::MAX).await.unwrap().len(), 1, "each takes back its own");
    // What nobody tells again for long is nobody's.
    place.execute("UPDATE presences SET told_us = told_us - 61000000").await;
    first.tell_presences(vec![presence(b"two")], Vec::new(), false).await.unwrap();
    assert_eq!(first.presences(Duration::MAX).await.unwrap(), []);
}

#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn what_is_not_as_it_was_written_is_found_by_its_record() {
    let place = Place::new();
    let missing = feedwave_store::check(&place.store_uri()).await.unwrap_err();
    assert!(matches!(missing, StoreError::CannotOpen { .. }), "{missing:?}");
    let store = place.open().await;
    let program = store.put_program(Tenant::DEFAULT, "G1 X10 F100\nM30\n".into()).await.unwrap().id;
    let job = store.create_job(new_job("r", program)).await.unwrap().id;
    let json = || RawValue::from_string("{}".into()).unwrap();
    let report = NewReport { report: json(), findings: FindingCounts::default(), summary: Some(json()) };
    store.transition(job, &JobState::ALL, JobState::Ready, "", Some(report)).await.unwrap();
    let run = NewRun { job_id: job, kind: RunKind::Live, settings: json(), monitor: vec![7; 5_000].into() };
    let run = store.create_run(run).await.unwrap();
    let decision = |number| NewDecision { number, action: "keep", body: "d".into(), raises_condition: false };
    let decisions = (0..3).map(decision).collect();
    let commit = RunCommit { decisions, ..RunCommit::default() };
    store.commit_run(run.run.id, run.attachment, commit).await.unwrap();

    // While replicas have it.
    let found = feedwave_store::check(&place.store_uri()).await.unwrap();
    assert_eq!(found.problems, [], "{found:?}");
    let checked = |kind| found.checked.iter().find(|(name, _)| *name == kind).map(|(_, count)| *count);
    let counts = ["program", "job", "report", "run", "event"].map(checked);
    assert_eq!(counts, [Some(1), Some(1), Some(1), Some(1), Some(2)]);

    for (sql, kind, reason) in [
        ("UPDATE program_chunks SET source_bytes = source_bytes - 1", "program", ""),
        ("DELETE FROM decisions WHERE number = 1", "run", "2 of 3 decisions are there"),
        ("UPDATE validation_reports SET report = '\\x00'", "report", "cannot be restored"),
        ("DELETE FROM validation_reports", "job", "it is ready and has no report"),
        ("UPDATE jobs SET settings = 'x'", "job", "holds no JSON"),
    ] {
        place.execute(sql).await;
        let found = feedwave_store::check(&place.store_uri()).await.unwrap();
        let is_told = found.problems.iter().any(|problem| problem.kind == kind && problem.reason.contains(reason));
        assert!(is_told, "{sql}: {found:?}");
    }
    // Copies are the server's.
    let folder = TempDir::new().unwrap();
    let refused = feedwave_store::backup(&place.store_uri(), &folder.path().join("copy.db")).await.unwrap_err();
    assert!(refused.to_string().contains("pg_dump"), "{refused}");
    let refused = feedwave_store::restore(&place.store_uri(), &folder.path().join("copy.db"), false).await.unwrap_err();
    assert!(refused.to_string().contains("pg_restore"), "{refused}");
}
