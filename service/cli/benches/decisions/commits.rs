//! Bare SQLite transactions: what a decision needs on the disk, and nothing else.

use std::path::Path;
use std::time::{Duration, Instant};

use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use sqlx::{ConnectOptions as _, Connection as _};

/// How long it is measured.
const LENGTH: Duration = Duration::from_secs(3);
/// Bytes of a decision, and of a monitor's state after it, as the service stores them.
const DECISION_BYTES: usize = 256;
const STATE_BYTES: usize = 1_536;

/// Inserts a row and replaces another, durably, one transaction after the other; how long each took, ascending.
pub async fn measure(path: &Path) -> Vec<Duration> {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .disable_statement_logging();
    let mut connection = options.connect().await.expect("a database");
    let schema = "CREATE TABLE runs (id INTEGER PRIMARY KEY, monitor BLOB); INSERT INTO runs (id) VALUES (1);
        CREATE TABLE decisions (sequence INTEGER PRIMARY KEY AUTOINCREMENT, body BLOB)";
    sqlx::raw_sql(schema).execute(&mut connection).await.expect("tables");
    let (decision, state) = (vec![7_u8; DECISION_BYTES], vec![7_u8; STATE_BYTES]);
    let begun = Instant::now();
    let mut times = Vec::new();
    while begun.elapsed() < LENGTH {
        let begun = Instant::now();
        let mut transaction = connection.begin().await.expect("a transaction");
        sqlx::query("UPDATE runs SET monitor = ? WHERE id = 1")
            .bind(&state)
            .execute(&mut *transaction)
            .await
            .expect("an update");
        sqlx::query("INSERT INTO decisions (body) VALUES (?)")
            .bind(&decision)
            .execute(&mut *transaction)
            .await
            .expect("an insert");
        transaction.commit().await.expect("a commit");
        times.push(begun.elapsed());
    }
    times.sort();
    times
}
