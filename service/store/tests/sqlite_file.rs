//! The file itself: opening it, what is refused, and what survives.

#[path = "common/any_uploads.rs"]
mod any_uploads;
mod common;

use std::path::Path;

use feedwave_store::{
    AuditFilter, AuditRequest, CHUNK_BYTES, EventFilter, JobFilter, JobState, Kind, PageRequest, ProgramId, RawValue,
    Removed, RetentionPolicy, Store, StoreError, StoreSettings, StoreUri, Tenant, UploadStart,
};
use proptest::prelude::*;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{ConnectOptions, Connection};
use tempfile::TempDir;
use uuid::Uuid;

use common::new_job;

async fn open(path: &Path) -> Result<Store, StoreError> {
    // However slowly a store that was dropped lets go of the file.
    let uri = format!("{}?busy_timeout_s=600", StoreUri::of_file(path).unwrap());
    Store::open(&uri.parse().unwrap(), StoreSettings::default()).await
}

async fn raw(path: &Path) -> SqliteConnection {
    SqliteConnectOptions::new().filename(path).create_if_missing(true).connect().await.unwrap()
}

fn folder() -> (TempDir, std::path::PathBuf) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("feedwave.db");
    (folder, path)
}

#[tokio::test]
async fn unusable_paths_are_named() {
    let (folder, path) = folder();
    let absent = folder.path().join("absent").join("feedwave.db");
    for (path, words) in [(absent.as_path(), "its folder does not exist"), (folder.path(), "it is a folder")] {
        let error = open(path).await.err().unwrap();
        assert!(matches!(error, StoreError::CannotOpen { .. }), "{error:?}");
        assert!(error.to_string().contains(words), "{error}");
    }
    open(&path).await.unwrap();
    assert!(path.is_file());
}

#[tokio::test]
async fn a_database_that_is_in_use_is_refused_with_who_uses_it() {
    let (folder, path) = folder();
    let first = open(&path).await.unwrap();
    let link = folder.path().join("link.db");
    std::os::unix::fs::symlink(&path, &link).unwrap();
    for name in [&path, &link] {
        let uri = format!("{}?busy_timeout_s=0", StoreUri::of_file(name).unwrap());
        let error = Store::open(&uri.parse().unwrap(), StoreSettings::default()).await.err().unwrap();
        let own = format!("process {} on host ", std::process::id());
        assert!(matches!(&error, StoreError::InUseBy { holder } if holder.starts_with(&own)), "{error:?}");
    }
    // Another name of the file itself has another file beside it, and would have another log.
    let other = folder.path().join("other.db");
    std::fs::hard_link(&path, &other).unwrap();
    let error = open(&other).await.err().unwrap();
    assert!(matches!(&error, StoreError::InUseBy { holder } if holder.contains("hard link")), "{error:?}");
    if cfg!(target_os = "linux") {
        let process = format!("process {} on host ", std::process::id());
        assert!(error.to_string().contains(&process), "{error}");
    }
    // Nor does a lock file that was removed let anybody in.
    std::fs::remove_file(folder.path().join("feedwave.db.lock")).unwrap();
    let error = open(&path).await.err().unwrap();
    assert!(matches!(&error, StoreError::InUseBy { holder } if holder.contains("was removed")), "{error:?}");
    // What a killed process leaves is the file without its lock.
    first.close().await;
    assert!(folder.path().join("feedwave.db.lock").is_file());
    open(&path).await.unwrap();
}

#[tokio::test]
async fn order_does_not_depend_on_the_clock() {
    let (_folder, path) = folder();
    let store = open(&path).await.unwrap();
    let programs = [
        store.put_program(Tenant::DEFAULT, "M30\n".into()).await.unwrap().id,
        store.put_program(Tenant::DEFAULT, "M2\n".into()).await.unwrap().id,
    ];
    let early = store.create_job(new_job("early", programs[0])).await.unwrap().id;
    // As if the clock had been ten years ahead when they were made, and was set back since.
    let mut database = raw(&path).await;
    for sql in [
        "UPDATE jobs SET created_us = created_us + 315360000000000",
        "UPDATE programs SET created_us = created_us + sequence",
    ] {
        sqlx::query(sql).execute(&mut database).await.unwrap();
    }
    let late = store.create_job(new_job("late", programs[0])).await.unwrap().id;
    let size = |size, token| PageRequest { size, token };
    let first = store.list_jobs(&JobFilter::default(), &size(1, String::new())).await.unwrap();
    let second = store.list_jobs(&JobFilter::default(), &size(1, first.next_token.unwrap())).await.unwrap();
    assert_eq!((first.items[0].id, second.items[0].id), (late, early));
    assert_eq!(store.jobs_in_state(&[JobState::PendingValidation], 10).await.unwrap(), [early, late]);
    // Times remain what they were said to be: a filter by them finds what was created in them.
    let from = Some(first.items[0].created_us + 1);
    let filter = JobFilter { created_from_us: from, ..JobFilter::default() };
    let found = store.list_jobs(&filter, &PageRequest::default()).await.unwrap();
    assert_eq!(found.items.iter().map(|job| job.id).collect::<Vec<_>>(), [early]);
    let listed = store.list_programs(None, "", &PageRequest::default()).await.unwrap();
    assert_eq!(listed.items.iter().map(|entry| entry.info.id).collect::<Vec<_>>(), [programs[1], programs[0]]);
}

#[tokio::test]
async fn what_is_no_database_is_refused_and_left_alone() {
    let (_folder, path) = folder();
    for garbage in [b"G1 X10\n".repeat(1000), [b"SQLite format 3\0".to_vec(), vec![0xAA; 9000]].concat()] {
        std::fs::write(&path, &garbage).unwrap();
        let error = open(&path).await.err().unwrap();
        assert!(matches!(error, StoreError::Corrupt { .. }), "{error:?}");
        assert!(std::error::Error::source(&error).is_some());
        assert_eq!(std::fs::read(&path).unwrap(), garbage);
    }
}

#[tokio::test]
async fn another_programs_database_is_refused_and_left_alone() {
    let (_folder, path) = folder();
    let mut other = raw(&path).await;
    sqlx::query("CREATE TABLE songs (title TEXT)").execute(&mut other).await.unwrap();
    other.close().await.unwrap();
    let before = std::fs::read(&path).unwrap();
    let error = open(&path).await.err().unwrap();
    assert!(matches!(error, StoreError::Incompatible(_)), "{error:?}");
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[tokio::test]
async fn a_newer_or_altered_schema_is_refused() {
    let (_folder, path) = folder();
    open(&path).await.unwrap().close().await;
    open(&path).await.unwrap().close().await;
    let mut database = raw(&path).await;
    sqlx::query(
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
         VALUES (9999, 'later', TRUE, x'00', 0)",
    )
    .execute(&mut database)
    .await
    .unwrap();
    let error = open(&path).await.err().unwrap();
    assert!(matches!(&error, StoreError::Incompatible(reason) if reason.contains("9999")), "{error:?}");
    assert!(error.to_string().contains("newer version"), "{error}");

    sqlx::query("DELETE FROM _sqlx_migrations WHERE version = 9999").execute(&mut database).await.unwrap();
    sqlx::query("UPDATE _sqlx_migrations SET checksum = x'00'").execute(&mut database).await.unwrap();
    let error = open(&path).await.err().unwrap();
    assert!(matches!(&error, StoreError::Incompatible(_)), "{error:?}");
}

/// A database as a version before tenants left it: a program with a job that has a run, and an unfinished upload.
async fn database_of_migration_8(path: &Path, program: ProgramId, job: Uuid) {
    let mut before = sqlx::migrate!("../../migrations/sqlite");
    before.migrations.to_mut().retain(|migration| migration.version <= 8);
    let mut database = raw(path).await;
    before.run_direct(None, &mut database, false).await.unwrap();
    let sql = format!(
        "PRAGMA application_id = 0x66776462;
         INSERT INTO contents (id) VALUES (1), (2);
         INSERT INTO programs (id, content_id, size_bytes, chunk_count, created_us, sequence)
            VALUES ('{program}', 1, 0, 0, 1, 1);
         INSERT INTO uploads (id, content_id, expected_id, size_bytes, received_bytes, created_us, updated_us)
            VALUES ('{job}', 2, '{program}', 7, 0, 1, {now});
         INSERT INTO job_events (sequence, job_id, to_state, at_us, detail) VALUES (1, '{job}', 'ready', 1, '');
         INSERT INTO jobs (id, request_id, fingerprint, display_name, program_id, machine_id, state, state_detail, created_us,
            updated_us, revision, settings, machine_snapshot, sequence)
            VALUES ('{job}', 'early', x'00', '', '{program}', 'mill', 'ready', '', 1, 1, 1, '{{}}', '{{}}', 1);
         INSERT INTO runs (id, job_id, kind, state, state_detail, created_us, updated_us, attachment, setpoints_received,
            setpoints_sent, settings, monitor_bytes, monitor, sequence)
            VALUES ('{job}', '{job}', 'telemetry', 'finished', '', 1, 1, 1, 0, 0, '{{}}', 0, x'', 1)",
        now = i64::MAX
    );
    sqlx::raw_sql(sqlx::AssertSqlSafe(sql)).execute(&mut database).await.unwrap();
    database.close().await.unwrap();
}

#[tokio::test]
async fn records_of_a_version_without_tenants_are_of_the_default_tenant() {
    let (_folder, path) = folder();
    let (program, job) = (ProgramId::of(b""), Uuid::now_v7());
    database_of_migration_8(&path, program, job).await;
    let store = open(&path).await.unwrap();
    let kept = store.job(job).await.unwrap();
    assert_eq!((kept.tenant, kept.owner.as_str(), kept.program_id), (Tenant::DEFAULT, "", program));
    assert_eq!(store.job_by_request(Tenant::DEFAULT, "early").await.unwrap().unwrap().0.id, job);
    assert_eq!(store.program_entry(program).await.unwrap().job_count, 1);
    assert_eq!(store.run(job).await.unwrap().tenant, Tenant::DEFAULT);
    assert_eq!(store.uploads().await.unwrap()[0].expected, program);
    let filter = EventFilter { tenant: Some(Tenant::DEFAULT), job_id: None };
    assert_eq!(store.events_after(0, &filter, 10).await.unwrap().len(), 1);
    let other: Tenant = "other".parse().unwrap();
    assert!(store.program_info(program.of_tenant(other)).await.is_err());
    assert_eq!(store.put_program(other, "".into()).await.unwrap().id.tenant(), other);
    store.delete_program(program.of_tenant(other)).await.unwrap();
    assert_eq!(store.program_entry(program).await.unwrap().job_count, 1);
    assert!(store.audit_after(0, &AuditFilter::default(), 10).await.unwrap().is_empty());
}

#[tokio::test]
async fn the_audit_log_of_an_earlier_version_is_followed_and_shared_as_if_it_had_always_been() {
    let (_folder, path) = folder();
    let mut before = sqlx::migrate!("../../migrations/sqlite");
    before.migrations.to_mut().retain(|migration| migration.version <= 12);
    let mut database = raw(&path).await;
    before.run_direct(None, &mut database, false).await.unwrap();
    let sql = "PRAGMA application_id = 0x66776462;
        INSERT INTO audit_entries (sequence, at_us, ended_us, principal, tenant, address, certificate, method, request_id,
            resource, result, reason, occurrences)
            VALUES (3, 1, 2, 'a', '', '', '', '/a/b', 'r', '', 'OK', '', 1),
                (5, 1, NULL, 'a', '', '', '', '/a/b', 'r', '', '', '', 1),
                (7, 1, 2, 'b', 'plant-b', '', '', '/a/b', 'r', '', 'OK', '', 1);
        DELETE FROM audit_entries WHERE sequence = 7";
    sqlx::raw_sql(sql).execute(&mut database).await.unwrap();
    database.close().await.unwrap();
    let store = open(&path).await.unwrap();
    let entries = store.audit_changed_after(0, &AuditFilter::default(), 10).await.unwrap();
    let places: Vec<_> = entries.iter().map(|entry| (entry.sequence, entry.change)).collect();
    assert_eq!(places, [(3, 3), (5, 5)]);
    // What was given once is not given again.
    assert_eq!(store.begin_audit(AuditRequest::default(), None).await.unwrap(), 8);
    assert_eq!(store.audit_changed_after(5, &AuditFilter::default(), 10).await.unwrap()[0].change, 8);
    store.close().await;
    let shares: Vec<(String, i64)> =
        sqlx::query_as("SELECT tenant, entries FROM audit_tenants").fetch_all(&mut raw(&path).await).await.unwrap();
    assert_eq!(shares, [(String::new(), 3)]);
}

#[tokio::test]
async fn migrations_leave_a_valid_schema() {
    let (_folder, path) = folder();
    open(&path).await.unwrap().close().await;
    let mut database = raw(&path).await;
    let integrity: String = sqlx::query_scalar("PRAGMA integrity_check").fetch_one(&mut database).await.unwrap();
    assert_eq!(integrity, "ok");
    let tables: Vec<String> = sqlx::query_scalar(
        "SELECT name FROM pragma_table_list WHERE schema = 'main' AND type = 'table' AND strict = 0
         AND name NOT LIKE 'sqlite%' AND name NOT LIKE '\\_sqlx%' ESCAPE '\\'",
    )
    .fetch_all(&mut database)
    .await
    .unwrap();
    assert!(tables.is_empty(), "tables that take values of any type: {tables:?}");
}

/// The files as a killed process leaves them: whatever was written, nothing tidied up.
#[tokio::test]
async fn what_is_acknowledged_is_in_the_files_at_once() {
    let (folder, path) = folder();
    let store = open(&path).await.unwrap();
    let copy = TempDir::new().unwrap();
    for round in 0..5 {
        let program = store.put_program(Tenant::DEFAULT, format!("G4 P{round}\n").into()).await.unwrap();
        let job = store.create_job(new_job(&round.to_string(), program.id)).await.unwrap();
        store.transition(job.id, &[JobState::PendingValidation], JobState::Ready, "", None).await.unwrap();
        for file in ["feedwave.db", "feedwave.db-wal"] {
            std::fs::copy(folder.path().join(file), copy.path().join(file)).unwrap();
        }
        let survived = open(&copy.path().join("feedwave.db")).await.unwrap();
        assert_eq!(survived.job(job.id).await.unwrap().state, JobState::Ready);
        assert_eq!(survived.latest_sequence(), 2 * (round + 1));
        survived.program_chunk(program.id, 0).await.unwrap();
        survived.close().await;
    }
}

#[tokio::test]
async fn dropping_without_closing_loses_nothing() {
    let (_folder, path) = folder();
    let store = open(&path).await.unwrap();
    let program = store.put_program(Tenant::DEFAULT, "M30\n".into()).await.unwrap();
    let mut ids = Vec::new();
    for index in 0..20 {
        ids.push(store.create_job(new_job(&index.to_string(), program.id)).await.unwrap().id);
    }
    drop(store);
    let store = open(&path).await.unwrap();
    assert_eq!(store.jobs_in_state(&[JobState::PendingValidation], 100).await.unwrap(), ids);
}

#[tokio::test]
async fn a_closed_store_finishes_its_queue_and_refuses_more() {
    let (_folder, path) = folder();
    let store = open(&path).await.unwrap();
    let program = store.put_program(Tenant::DEFAULT, "M30\n".into()).await.unwrap();
    store.ping().await.unwrap();
    let mut creations = tokio::task::JoinSet::new();
    for index in 0..100 {
        let store = store.clone();
        creations.spawn(async move { store.create_job(new_job(&index.to_string(), program.id)).await });
    }
    // Lets every creation reach the queue before the store closes.
    tokio::task::yield_now().await;
    store.close().await;
    store.close().await;
    let outcomes = creations.join_all().await;
    for refused in [
        store.create_job(new_job("late", program.id)).await.map(|_| ()),
        store.job_by_request(Tenant::DEFAULT, "late").await.map(|_| ()),
        store.ping().await,
    ] {
        assert!(matches!(refused, Err(StoreError::Unavailable { .. })), "{refused:?}");
    }
    let reopened = open(&path).await.unwrap();
    let kept = reopened.jobs_in_state(&JobState::ALL, 1000).await.unwrap();
    let acknowledged: Vec<_> = outcomes.into_iter().filter_map(Result::ok).map(|job| job.id).collect();
    assert!(!acknowledged.is_empty() && acknowledged.iter().all(|id| kept.contains(id)));
}

#[tokio::test]
async fn damage_is_told_from_content() {
    let (_folder, path) = folder();
    let store = open(&path).await.unwrap();
    // Noise does not compress, so most of the file is this program.
    let mut state = 1_u64;
    let noise: Vec<u8> = (0..CHUNK_BYTES)
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 56) as u8
        })
        .collect();
    let program = store.put_program(Tenant::DEFAULT, noise.into()).await.unwrap();
    store.close().await;
    let mut file = std::fs::read(&path).unwrap();
    let middle = file.len() / 2 / 4096 * 4096 + 1000;
    file[middle] ^= 1;
    std::fs::write(&path, file).unwrap();
    let store = open(&path).await.unwrap();
    let damaged = store.program_chunk(program.id, 0).await;
    assert!(matches!(damaged, Err(StoreError::Corrupt { .. })), "one flipped bit: {damaged:?}");
}

#[tokio::test]
async fn an_interrupted_removal_is_completed_when_opening() {
    let (_folder, path) = folder();
    let store = open(&path).await.unwrap();
    let gone = store.put_program(Tenant::DEFAULT, vec![b'x'; 10 << 20].into()).await.unwrap();
    let kept = store.put_program(Tenant::DEFAULT, "M30\n".into()).await.unwrap();
    let UploadStart::Unfinished(upload) = store.begin_upload(ProgramId::of(b"ab"), 2, "").await.unwrap() else {
        panic!("nothing was uploaded yet");
    };
    store.append_upload(upload.id, 0, "a".into()).await.unwrap();
    store.close().await;
    let mut database = raw(&path).await;
    sqlx::query("DELETE FROM programs WHERE id = ?").bind(gone.id.to_string()).execute(&mut database).await.unwrap();

    let store = open(&path).await.unwrap();
    let contents: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM contents").fetch_one(&mut database).await.unwrap();
    let chunks: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM program_chunks").fetch_one(&mut database).await.unwrap();
    assert_eq!((contents, chunks), (2, 1));
    store.program_chunk(kept.id, 0).await.unwrap();
    store.append_upload(upload.id, 1, "b".into()).await.unwrap();
    store.finish_upload(upload.id).await.unwrap();
}

#[tokio::test]
async fn a_large_program_is_removed_in_pieces() {
    let (_folder, path) = folder();
    let store = open(&path).await.unwrap();
    let source = bytes::Bytes::from(vec![b'\n'; 70 << 20]);
    let id = ProgramId::of(&source);
    let UploadStart::Unfinished(upload) = store.begin_upload(id, source.len() as u64, "").await.unwrap() else {
        panic!("nothing was uploaded yet");
    };
    store.append_upload(upload.id, 0, source).await.unwrap();
    store.finish_upload(upload.id).await.unwrap();
    assert_eq!(store.program_info(id).await.unwrap().chunk_count, 70);
    let before = store.stats().commits;
    store.delete_program(id).await.unwrap();
    assert_eq!(store.stats().commits - before, 4, "the program, then 32, 32 and 6 of its chunks");
    let mut database = raw(&path).await;
    let chunks: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM program_chunks").fetch_one(&mut database).await.unwrap();
    assert_eq!(chunks, 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn many_writers_and_readers_never_find_it_busy() {
    let (_folder, path) = folder();
    let store = open(&path).await.unwrap();
    let program = store.put_program(Tenant::DEFAULT, "M30\n".into()).await.unwrap().id;
    let mut tasks = tokio::task::JoinSet::new();
    for writer in 0..32 {
        let store = store.clone();
        tasks.spawn(async move {
            for index in 0..10 {
                let job = store.create_job(new_job(&format!("{writer}-{index}"), program)).await?;
                assert_eq!(store.job(job.id).await?.revision, 1, "an acknowledged write is read");
                store.transition(job.id, &JobState::ALL, JobState::Ready, "", None).await?;
                let machine = store.create_machine(None, RawValue::from_string("{}".into()).unwrap()).await?;
                store.delete_machine(&machine.id, Some(&machine.etag)).await?;
            }
            Ok::<_, StoreError>(())
        });
    }
    for outcome in tasks.join_all().await {
        outcome.unwrap();
    }
    assert_eq!(store.count_jobs(None).await.unwrap(), [(JobState::Ready, 320)]);
    let stats = store.stats();
    assert_eq!((stats.failed_operations, stats.write_queue_depth), (0, 0));
    assert_eq!(stats.committed_operations, 1 + 320 * 4);
    assert!(stats.commits < stats.committed_operations, "commits are shared: {stats:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_order_of_upload_calls_is_like_a_list_of_bytes(input in prop::collection::vec(any::<u8>(), 0..160)) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let (_folder, path) = folder();
            let uri: StoreUri = format!("{}?busy_timeout_s=600", StoreUri::of_file(&path).unwrap()).parse().unwrap();
            let settings = StoreSettings { max_uploads: 2, ..StoreSettings::default() };
            let open = async || Store::open(&uri, settings.clone()).await.unwrap();
            any_uploads::check(open().await, open, &input).await.close().await;
        });
    }

    /// However an upload is cut and wherever the store is opened anew, the program is the same.
    #[test]
    fn any_cut_of_an_upload_gives_the_program(
        pieces in prop::collection::vec((0_usize..700_000, any::<bool>()), 1..8),
        seed in any::<u8>(),
    ) {
        let size: usize = pieces.iter().map(|(size, _)| size).sum();
        let source: Vec<u8> = (0..size).map(|index| (index / 7) as u8 ^ (index >> 9) as u8 ^ seed).collect();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let (_folder, path) = folder();
            let mut store = open(&path).await.unwrap();
            let id = ProgramId::of(&source);
            let mut rest = &source[..];
            for (size, reopen) in pieces {
                if reopen {
                    drop(store);
                    store = open(&path).await.unwrap();
                }
                let UploadStart::Unfinished(upload) = store.begin_upload(id, source.len() as u64, "").await.unwrap() else {
                    panic!("not finished yet");
                };
                assert_eq!(upload.received_bytes as usize, source.len() - rest.len());
                let (piece, later) = rest.split_at(size);
                let piece = bytes::Bytes::copy_from_slice(piece);
                store.append_upload(upload.id, upload.received_bytes, piece).await.unwrap();
                rest = later;
            }
            let upload = store.uploads().await.unwrap().remove(0);
            let info = store.finish_upload(upload.id).await.unwrap();
            let mut read = Vec::new();
            for index in 0..info.chunk_count {
                read.extend_from_slice(&store.program_chunk(id, index).await.unwrap());
            }
            assert_eq!(read, source);
            assert!(matches!(store.upload(upload.id).await, Err(StoreError::NotFound { kind: Kind::Upload, .. })));
        });
    }
}

#[tokio::test]
async fn beyond_its_size_a_database_loses_the_oldest_jobs_and_gives_space_back() {
    let (_folder, path) = folder();
    let store = open(&path).await.unwrap();
    let mut jobs = Vec::new();
    // Noise does not compress.
    let noise = |mut state: u64, bytes: u64| -> Vec<u8> {
        let next = |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 56) as u8
        };
        (0..bytes).map(next).collect()
    };
    for index in 0..8_u8 {
        let program = noise(u64::from(index) + 1, CHUNK_BYTES);
        let program = store.put_program(Tenant::DEFAULT, program.into()).await.unwrap().id;
        let job = store.create_job(new_job(&index.to_string(), program)).await.unwrap().id;
        store.transition(job, &JobState::ALL, JobState::Ready, "", None).await.unwrap();
        jobs.push(job);
    }
    // The first one waits still, and is nobody's to remove.
    store.transition(jobs[0], &JobState::ALL, JobState::PendingValidation, "", None).await.unwrap();
    // Programs whose jobs may be yet to come take nobody's place, however many there are.
    let waiting = store.put_program(Tenant::DEFAULT, noise(100, CHUNK_BYTES).into()).await.unwrap().id;
    let policy = RetentionPolicy { bytes: Some(4 << 20), ..RetentionPolicy::default() };
    assert_eq!(store.expired(&policy).await.unwrap(), Removed::default(), "the size is not foreseen");
    let removed = store.remove_expired(&policy).await.unwrap();
    assert!(removed.jobs == removed.programs && (3..=5).contains(&removed.jobs), "{removed:?}");
    let kept = store.jobs_in_state(&JobState::ALL, 10).await.unwrap();
    let oldest_gone = usize::try_from(removed.jobs).unwrap() + 1;
    assert_eq!(kept, [&jobs[..1], &jobs[oldest_gone..]].concat());
    store.program_info(waiting).await.unwrap();
    store.close().await;
    assert!(std::fs::metadata(&path).unwrap().len() < 6 << 20, "the file has shrunk");
}
