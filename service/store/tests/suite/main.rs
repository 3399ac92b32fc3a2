//! What every database behind the store must do. The environment variable `FEEDWAVE_TEST_STORE` says which: the URI
//! of a store with `{}` where the name of an empty one goes, as in `sqlite:///tmp/{}.db`. Without it the tests run on
//! temporary SQLite files with a write-ahead log, as in production.

mod audit;
mod checkpoints;
#[path = "../common/mod.rs"]
mod common;
#[path = "../../../../tests/src/database.rs"]
mod database;
mod documents;
mod jobs;
mod objects;
mod programs;
mod retention;
mod runs;
mod tenants;
mod uploads;
mod validations;

use feedwave_store::{ProgramId, Store, StoreSettings, StoreUri, Tenant};
use tempfile::TempDir;
use uuid::Uuid;

pub(crate) use common::{json, new_job};
use database::Database;

/// A place that keeps what is stored between two openings; empty at first.
pub(crate) struct Place {
    uri: StoreUri,
    _database: Database,
    _folder: TempDir,
}

impl Place {
    pub(crate) fn new() -> Self {
        let folder = TempDir::new().expect("a temporary folder");
        let pattern = std::env::var("FEEDWAVE_TEST_STORE").unwrap_or_else(|_| {
            // However slowly a store that was dropped lets go of the file.
            format!("sqlite://{}/{{}}.db?busy_timeout_s=600", folder.path().display())
        });
        assert!(pattern.contains("{}"), "FEEDWAVE_TEST_STORE has no {{}}");
        let database = Database::new(&pattern, &format!("test-{}", Uuid::now_v7()));
        let uri = database.uri.parse().expect("FEEDWAVE_TEST_STORE is the URI of a store");
        Self { uri, _database: database, _folder: folder }
    }

    /// Opens the store at this place.
    pub(crate) async fn open(&self, settings: StoreSettings) -> Store {
        // Whoever opens it again is the one who had it before.
        let settings = StoreSettings { replica_name: "test".into(), ..settings };
        Store::open(&self.uri, settings).await.expect("opens")
    }
}

pub(crate) async fn open(place: &Place) -> Store {
    place.open(StoreSettings::default()).await
}

/// A store with one small program.
pub(crate) async fn with_program(place: &Place) -> (Store, ProgramId) {
    let store = open(place).await;
    let program = store.put_program(Tenant::DEFAULT, "G1 X10 F100\nM30\n".into()).await.expect("stores a program");
    (store, program.id)
}

/// Bytes that look like a program, differ everywhere, and compress somewhat.
pub(crate) fn source(bytes: usize) -> Vec<u8> {
    let mut source = Vec::with_capacity(bytes + 64);
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    while source.len() < bytes {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        source.extend_from_slice(format!("G1 X{} Z-{}\n", state >> 44, (state >> 20) & 0xfffff).as_bytes());
    }
    source.truncate(bytes);
    source
}

/// Everything a program's chunks hold, read in order.
pub(crate) async fn read_back(store: &Store, id: ProgramId) -> Vec<u8> {
    let info = store.program_info(id).await.expect("the program exists");
    let mut source = Vec::new();
    for index in 0..info.chunk_count {
        source.extend_from_slice(&store.program_chunk(id, index).await.expect("the chunk exists"));
    }
    source
}
