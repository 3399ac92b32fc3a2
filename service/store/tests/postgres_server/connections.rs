//! Connections that break, fall silent or are cut off.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use feedwave_store::{Store, StoreError, Tenant};
use tokio::time::timeout;

use super::{Place, SOON, new_job, program};

/// Comes back when a store works.
async fn ready(store: &Store) {
    let works = async {
        while store.ping().await.is_err() {
            tokio::task::yield_now().await;
        }
    };
    timeout(SOON, works).await.expect("the store works again");
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn connections_that_fall_silent_cost_a_moment() {
    const READERS: usize = 12;
    let place = Place::new();
    let other = place.open().await;
    let (store, proxy) = place.open_by_proxy().await;
    let program = program(&store).await;
    let job = store.create_job(new_job("first", program)).await.unwrap();
    for round in 0..3 {
        // More readers than connections, so that some of them read and others wait whenever it is.
        let reads: Arc<[AtomicU64; READERS]> = Arc::default();
        let mut readers = tokio::task::JoinSet::new();
        for reader in 0..READERS {
            let (store, reads, id) = (store.clone(), reads.clone(), job.id);
            readers.spawn(async move {
                loop {
                    let read = timeout(SOON, store.job(id)).await.expect("a read comes back");
                    reads[reader].fetch_add(u64::from(read.is_ok()), Ordering::Relaxed);
                }
            });
        }
        let all_read = async |times: u64| {
            let from = reads.each_ref().map(|reads| reads.load(Ordering::Relaxed));
            let read = async {
                while reads.iter().zip(from).any(|(reads, from)| reads.load(Ordering::Relaxed) < from + times) {
                    tokio::task::yield_now().await;
                }
            };
            timeout(SOON, read).await.expect("everybody reads");
        };
        all_read(20).await;
        proxy.cut(true);
        // What another replica writes is seen, and what this one is asked to write is written.
        let theirs = other.create_job(new_job(&format!("theirs {round}"), program)).await.unwrap();
        let mut events = store.watch_events();
        let seen = timeout(SOON, events.wait_for(|newest| *newest >= theirs.sequence)).await;
        assert!(seen.expect("it is seen soon").is_ok());
        let created = timeout(SOON, store.create_job(new_job(&format!("ours {round}"), program))).await;
        created.expect("it is written soon").unwrap();
        // Those in use may leave no connection for a moment.
        let put =
            async { while store.put_program(Tenant::DEFAULT, format!("N{round}\nM30\n").into()).await.is_err() {} };
        timeout(SOON, put).await.expect("it is written soon");
        all_read(20).await;
        readers.shutdown().await;
        ready(&store).await;
    }
    timeout(SOON, store.close()).await.expect("it is closed soon");
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_replica_that_is_cut_off_is_not_ready_until_it_is_there_again() {
    let place = Place::new();
    let (store, proxy) = place.open_by_proxy().await;
    let id = program(&store).await;
    store.ping().await.unwrap();
    proxy.cut(false);
    let silent = async {
        while store.ping().await.is_ok() {
            tokio::task::yield_now().await;
        }
    };
    timeout(SOON, silent).await.expect("it is not ready");
    let read = timeout(SOON, store.program_info(id)).await.expect("the read comes back");
    assert!(matches!(&read, Err(StoreError::Unavailable { .. })), "{read:?}");
    proxy.cut(true);
    ready(&store).await;
    store.program_info(id).await.unwrap();
    store.create_job(new_job("r", id)).await.unwrap();
    timeout(SOON, store.close()).await.expect("it is closed soon");
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_server_that_was_read_only_is_written_to_again() {
    let place = Place::new();
    let store = place.open().await;
    let put = async |number: u32| store.put_program(Tenant::DEFAULT, format!("N{number}\nM30\n").into()).await;
    // For whoever connects from now on: sessions go on as they began.
    place
        .execute(
            "DO $$ BEGIN EXECUTE format('ALTER DATABASE %I SET default_transaction_read_only = on', current_database()); END $$",
        )
        .await;
    place
        .execute(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = current_database() AND pid <> pg_backend_pid()",
        )
        .await;
    let refused = async { while put(1).await.is_ok() {} };
    timeout(SOON, refused).await.expect("nothing is written");
    // Several sessions that are read-only wait in the pool.
    let refused = futures_util::future::join_all((2..10).map(put)).await;
    assert!(refused.iter().all(|written| matches!(written, Err(StoreError::Unavailable { .. }))), "{refused:?}");
    let mut raw = place.raw().await;
    for sql in [
        "SET default_transaction_read_only = off",
        "DO $$ BEGIN EXECUTE format('ALTER DATABASE %I RESET default_transaction_read_only', current_database()); END $$",
    ] {
        sqlx::query(sql).execute(&mut raw).await.unwrap();
    }
    // One write may find how it was.
    let _ = put(10).await;
    put(11).await.unwrap();
    timeout(SOON, store.ping()).await.expect("an answer").unwrap();
}
