//! Bytes as upload calls: see `any_uploads`.

#![no_main]

#[path = "../../service/store/tests/common/any_uploads.rs"]
mod any_uploads;

use std::sync::{LazyLock, Mutex};

use feedwave_store::{Store, StoreSettings, StoreUri};
use libfuzzer_sys::fuzz_target;
use tempfile::TempDir;
use tokio::runtime::Runtime;

static RUNTIME: LazyLock<Runtime> = LazyLock::new(|| Runtime::new().expect("a runtime"));
static HOME: LazyLock<TempDir> = LazyLock::new(|| tempfile::tempdir().expect("a temporary directory"));
/// Opened once and left empty by every run.
static STORE: LazyLock<Mutex<Option<Store>>> = LazyLock::new(|| Mutex::new(Some(RUNTIME.block_on(open()))));

async fn open() -> Store {
    let settings = StoreSettings { max_uploads: 2, ..StoreSettings::default() };
    let uri = StoreUri::of_file(&HOME.path().join("feedwave.db")).expect("a path");
    Store::open(&uri, settings).await.expect("the store opens")
}

fuzz_target!(|input: &[u8]| {
    let mut kept = STORE.lock().expect("no run has failed");
    let store = kept.take().expect("it was left by the run before");
    *kept = Some(RUNTIME.block_on(any_uploads::check(store, open, input)));
});
