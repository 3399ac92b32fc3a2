//! What only shows from inside: guarantees of the connections, and faults in the middle of a batch.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use sqlx::Row;
use sqlx::sqlite::SqliteConnectOptions;
use tempfile::TempDir;
use tokio::sync::oneshot;

use super::{SqliteOptions, SqliteStore, checkpointer};
use crate::{Database, Kind, Machines, Observer, PageRequest, RawValue, StoreError, StoreSettings};

async fn store(settings: StoreSettings) -> (TempDir, SqliteStore) {
    let folder = TempDir::new().unwrap();
    let store = SqliteStore::open(SqliteOptions::new(folder.path().join("feedwave.db")), settings).await.unwrap();
    (folder, store)
}

async fn note(store: &SqliteStore, text: &'static str) -> Result<(), StoreError> {
    store
        .write(0, move |tx| {
            Box::pin(async move {
                sqlx::query("INSERT INTO notes VALUES (?)").bind(text).execute(&mut tx.connection).await?;
                if text.starts_with("refused") {
                    return Err(StoreError::not_found(Kind::Job, text));
                }
                Ok(())
            })
        })
        .await
}

async fn notes(store: &SqliteStore) -> Vec<String> {
    let mut reader = store.reader().await.unwrap();
    let rows = sqlx::query("SELECT text FROM notes ORDER BY rowid").fetch_all(&mut reader).await.unwrap();
    rows.iter().map(|row| row.get("text")).collect()
}

async fn create_notes(store: &SqliteStore) {
    store
        .write(0, |tx| {
            Box::pin(async {
                sqlx::query("CREATE TABLE notes (text TEXT UNIQUE)").execute(&mut tx.connection).await?;
                Ok(())
            })
        })
        .await
        .unwrap();
}

#[tokio::test]
async fn connections_keep_what_the_store_promises() {
    let (_folder, store) = store(StoreSettings::default()).await;
    async fn pragmas(connection: impl sqlx::SqliteExecutor<'_>) -> (String, i64, i64, i64) {
        let sql = "SELECT journal_mode, synchronous, foreign_keys, timeout
            FROM pragma_journal_mode, pragma_synchronous, pragma_foreign_keys, pragma_busy_timeout";
        sqlx::query_as(sql).fetch_one(connection).await.unwrap()
    }
    let expected = ("wal".to_owned(), 2, 1, 5000);
    let writer = store.write(0, |tx| Box::pin(async { Ok(pragmas(&mut tx.connection).await) })).await.unwrap();
    assert_eq!(writer, expected);
    let mut reader = store.reader().await.unwrap();
    assert_eq!(pragmas(&mut reader).await, expected);
    let written = sqlx::query("DELETE FROM jobs").execute(&mut reader).await;
    assert!(written.is_err(), "a reader cannot write");
}

#[tokio::test]
async fn the_log_is_moved_into_the_database_beside_the_writer() {
    let (folder, store) = store(StoreSettings::default()).await;
    create_notes(&store).await;
    note(&store, "moved").await.unwrap();
    let path = folder.path().join("feedwave.db");
    let options = SqliteConnectOptions::new().filename(&path);
    let connection = checkpointer::checkpoint(None, &options).await.unwrap();
    // Without its log the file has everything, and the writer goes on.
    let copy = TempDir::new().unwrap();
    std::fs::copy(&path, copy.path().join("feedwave.db")).unwrap();
    let alone =
        SqliteStore::open(SqliteOptions::new(copy.path().join("feedwave.db")), StoreSettings::default()).await.unwrap();
    assert_eq!(notes(&alone).await, ["moved"]);
    note(&store, "later").await.unwrap();
    checkpointer::checkpoint(Some(connection), &options).await.unwrap();
    assert_eq!(notes(&store).await, ["moved", "later"]);
    store.close().await;
}

#[tokio::test]
async fn lists_are_read_by_index() {
    let (_folder, store) = store(StoreSettings::default()).await;
    let mut reader = store.reader().await.unwrap();
    for (sql, index) in [
        (
            "EXPLAIN QUERY PLAN SELECT * FROM jobs AS j LEFT JOIN programs AS p ON p.id = j.program_id
             WHERE j.sequence >= 1 AND j.sequence <= 9 ORDER BY j.sequence DESC LIMIT 5",
            "jobs_by_sequence",
        ),
        (
            "EXPLAIN QUERY PLAN SELECT * FROM jobs AS j LEFT JOIN programs AS p ON p.id = j.program_id
             WHERE j.state IN ('ready') AND j.sequence <= 9 ORDER BY j.sequence DESC LIMIT 5",
            "jobs_by_state",
        ),
        (
            "EXPLAIN QUERY PLAN SELECT * FROM jobs AS j LEFT JOIN programs AS p ON p.id = j.program_id
             WHERE j.machine_id = 'm' AND +j.created_us < 7 AND j.sequence <= 9 ORDER BY j.sequence DESC LIMIT 5",
            "jobs_by_machine",
        ),
        (
            "EXPLAIN QUERY PLAN SELECT * FROM decisions WHERE sequence > 7 AND run_id = 'r' ORDER BY sequence LIMIT 5",
            "decisions_by_run",
        ),
        (
            "EXPLAIN QUERY PLAN SELECT * FROM decisions WHERE sequence > 7 AND job_id = 'j' ORDER BY sequence LIMIT 5",
            "decisions_by_job",
        ),
    ] {
        let plan = sqlx::query(sql).fetch_all(&mut reader).await.unwrap();
        let plan: Vec<String> = plan.iter().map(|row| row.get("detail")).collect();
        assert!(plan[0].contains(index), "{plan:?}");
        assert!(!plan.iter().any(|step| step.contains("TEMP B-TREE")), "{plan:?}");
    }
}

#[tokio::test]
async fn a_refused_write_takes_none_of_its_batch_with_it() {
    #[derive(Default)]
    struct Committed(AtomicUsize);
    impl Observer for Committed {
        fn write_committed(&self, operations: usize, _: Duration) {
            self.0.fetch_add(operations, Ordering::Relaxed);
        }
    }
    let observer = Arc::new(Committed::default());
    let (_folder, store) = store(StoreSettings { observer: observer.clone(), ..StoreSettings::default() }).await;
    create_notes(&store).await;
    let before = store.stats();
    // A write that is in progress until all others are queued: they go together into the next transaction.
    let (begun, has_begun) = oneshot::channel();
    let (go_on, may_go_on) = oneshot::channel::<()>();
    let held = tokio::spawn({
        let store = store.clone();
        async move {
            let wait = store.write(0, move |_| {
                Box::pin(async move {
                    begun.send(()).expect("the test waits");
                    may_go_on.await.expect("the test goes on");
                    Ok(())
                })
            });
            wait.await
        }
    });
    has_begun.await.unwrap();
    let all_queued = async {
        while store.stats().write_queue_depth < 7 {
            tokio::task::yield_now().await;
        }
        go_on.send(()).expect("the writer waits");
    };
    let (a, b, c, d, e, f, ()) = tokio::join!(
        note(&store, "refused at the start"),
        note(&store, "first"),
        note(&store, "refused between"),
        note(&store, "first"),
        note(&store, "second"),
        note(&store, "refused at the end"),
        all_queued,
    );
    held.await.unwrap().unwrap();
    assert!(b.is_ok() && e.is_ok());
    assert!(matches!(d, Err(StoreError::Unavailable { .. })), "a broken constraint fails alone: {d:?}");
    for refused in [a, c, f] {
        assert!(matches!(refused, Err(StoreError::NotFound { .. })), "{refused:?}");
    }
    assert_eq!(notes(&store).await, ["first", "second"]);
    let after = store.stats();
    assert_eq!(after.commits - before.commits, 2, "the first and all others");
    assert_eq!(after.committed_operations - before.committed_operations, 3);
    assert_eq!(after.failed_operations - before.failed_operations, 4);
    assert_eq!(after.write_queue_depth, 0);
    assert_eq!(observer.0.load(Ordering::Relaxed) as u64, after.committed_operations);
}

#[tokio::test]
async fn a_full_disk_fails_writes_and_only_until_there_is_space() {
    let (_folder, store) = store(StoreSettings::default()).await;
    create_notes(&store).await;
    let limit_pages = |limit: &'static str| {
        store.write(0, move |tx| {
            Box::pin(async move {
                sqlx::query(limit).execute(&mut tx.connection).await?;
                Ok(())
            })
        })
    };
    limit_pages("PRAGMA max_page_count = 1").await.unwrap();
    let large = RawValue::from_string(format!("\"{}\"", "x".repeat(1 << 20))).unwrap();
    let (large_write, small_write) =
        tokio::join!(store.create_machine(Some("m"), large.clone()), note(&store, "beside it"));
    match &large_write {
        Err(StoreError::Unavailable { reason, source }) => {
            assert_eq!(*reason, "the disk is full");
            assert!(source.is_some());
        }
        other => panic!("{other:?}"),
    }
    assert!(matches!(store.machine("m").await, Err(StoreError::NotFound { .. })));
    assert_eq!(notes(&store).await.len(), usize::from(small_write.is_ok()), "what is acknowledged is there");

    limit_pages("PRAGMA max_page_count = 1000000").await.unwrap();
    store.create_machine(Some("m"), large).await.unwrap();
    note(&store, "afterwards").await.unwrap();
}

#[tokio::test]
async fn a_lock_held_by_another_program_passes() {
    let (folder, store) = store(StoreSettings::default()).await;
    create_notes(&store).await;
    // The lock outlasts any wait: the writer need not wait at all.
    let impatient = store.write(0, |tx| {
        Box::pin(async {
            sqlx::query("PRAGMA busy_timeout = 0").execute(&mut tx.connection).await?;
            Ok(())
        })
    });
    impatient.await.unwrap();
    let options = SqliteConnectOptions::new().filename(folder.path().join("feedwave.db"));
    let mut other = sqlx::ConnectOptions::connect(&options).await.unwrap();
    sqlx::query("BEGIN IMMEDIATE").execute(&mut other).await.unwrap();
    let (first, second) = tokio::join!(note(&store, "first"), note(&store, "second"));
    for locked in [first, second] {
        match locked {
            Err(error @ StoreError::Unavailable { reason, .. }) => {
                assert_eq!(reason, "it is locked by another program");
                assert!(!error.to_string().contains("SAVEPOINT"), "no SQL in {error}");
            }
            other => panic!("{other:?}"),
        }
    }
    sqlx::query("ROLLBACK").execute(&mut other).await.unwrap();
    note(&store, "third").await.unwrap();
    assert_eq!(notes(&store).await, ["third"]);
}

#[tokio::test]
async fn writes_wait_for_a_place_in_a_short_queue() {
    let settings =
        StoreSettings { write_queue: 1, write_queue_bytes: 1, max_commit_operations: 2, ..StoreSettings::default() };
    let (_folder, store) = store(settings).await;
    let mut writes = tokio::task::JoinSet::new();
    for index in 0..50 {
        let store = store.clone();
        let body = RawValue::from_string(format!("\"{}\"", "x".repeat(index * 100))).unwrap();
        writes.spawn(async move { store.create_machine(None, body).await });
    }
    assert!(writes.join_all().await.iter().all(Result::is_ok));
}

#[tokio::test]
async fn times_never_go_back_or_repeat() {
    let (_folder, store) = store(StoreSettings::default()).await;
    let times =
        store.write(0, |tx| Box::pin(async { Ok((0..1000).map(|_| tx.now_us()).collect::<Vec<_>>()) })).await.unwrap();
    assert!(times.is_sorted_by(|earlier, later| earlier < later));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_disk_that_is_slow_again_and_again_is_not_taken_for_a_fast_one_in_between() {
    let (_folder, store) = store(StoreSettings { max_commit_operations: 1, ..StoreSettings::default() }).await;
    let short = Duration::from_millis(50);
    /// A write that takes until it is told; what tells when it has begun.
    fn slow(store: &SqliteStore) -> (oneshot::Receiver<()>, oneshot::Sender<()>) {
        let ((begin, begun), (end, ended)) = (oneshot::channel(), oneshot::channel::<()>());
        let store = store.clone();
        tokio::spawn(async move {
            let write = store.inner.writer.write_unblocked(0, move |_| {
                Box::pin(async move {
                    let _ = begin.send(());
                    let _ = ended.await;
                    Ok(())
                })
            });
            write.await
        });
        (begun, end)
    }
    let (begun, first) = slow(&store);
    begun.await.unwrap();
    let late = |result: Result<(), StoreError>| assert!(result.unwrap_err().to_string().contains("in time"));
    late(store.probe(short).await);
    // The probe is done as soon as the first write is, and the next write is as slow.
    let (begun, second) = slow(&store);
    let queued = async {
        while store.stats().write_queue_depth < 3 {
            tokio::task::yield_now().await;
        }
    };
    queued.await;
    first.send(()).unwrap();
    begun.await.unwrap();
    late(store.probe(short).await);
    second.send(()).unwrap();
    store.probe(Duration::from_secs(60)).await.unwrap();
}

#[tokio::test]
async fn damaged_records_are_named_and_every_other_one_is_listed() {
    let (_folder, store) = store(StoreSettings::default()).await;
    let ids: Vec<_> = (0..7).map(|number| format!("m{number}")).collect();
    for id in &ids {
        let body = RawValue::from_string("{\"displayName\":\"1\"}".to_owned()).unwrap();
        store.create_machine(Some(id), body).await.unwrap();
    }
    store
        .write(0, |tx| {
            Box::pin(async {
                let sql = "UPDATE documents SET body = REPLACE(body, '1', '3') WHERE id IN ('m1', 'm2', 'm3', 'm6')";
                sqlx::query(sql).execute(&mut tx.connection).await?;
                Ok(())
            })
        })
        .await
        .unwrap();
    for size in 1..9 {
        let (mut read, mut unreachable, mut token) = (Vec::new(), Vec::new(), String::new());
        loop {
            let page = store.list_machines(&PageRequest { size, token }).await.unwrap();
            assert!(page.items.len() + page.unreachable.len() <= size as usize);
            read.extend(page.items.into_iter().map(|machine| machine.id));
            unreachable.extend(page.unreachable);
            match page.next_token {
                Some(next) => token = next,
                None => break,
            }
        }
        assert_eq!((read, unreachable), (names(&["m0", "m4", "m5"]), names(&["m1", "m2", "m3", "m6"])), "{size}");
    }
    // What it was does not matter to who puts it again.
    let body = RawValue::from_string("{}".to_owned()).unwrap();
    let refused = store.machine("m1").await.unwrap_err().to_string();
    assert!(refused.contains("seal"), "{refused}");
    store.update_machine("m1", None, body).await.unwrap();
    assert_eq!(store.machine("m1").await.unwrap().body.get(), "{}");
    store.delete_machine("m2", None).await.unwrap();
}

fn names(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}
