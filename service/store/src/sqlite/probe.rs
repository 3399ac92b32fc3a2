//! Whether writing works: a durable write, and the files where they were opened.

use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::watch;
use tokio::task::JoinHandle;

use super::SqliteStore;
use super::options::{DEFAULT_HEADROOM, SqliteOptions};
use crate::error::{Result, StoreError};

/// What a probe writes once a write has failed, bytes: where this fits, ordinary writes do.
const BALLAST_BYTES: i64 = 1 << 20;

/// The part of a file system of which no more is kept free where it is not stated how much.
const SMALL_DISK: u64 = 16;

/// Why writes are refused without being tried.
pub(super) type Blocked = Option<&'static str>;

const STALLED: &str = "the disk does not answer in time";
const NO_ROOM: &str = "the disk is full but for what is kept for removing records";
const GONE: &str = "its file was removed or replaced while it was open";
const LOG_GONE: &str =
    "its log (-wal) was removed or replaced while it was open: end the service in order and start it again";
const INDEX_GONE: &str = "the index of its log (-shm) was removed or replaced while it was open: end the service in order and start it again";

/// What is known about writing.
#[derive(Debug)]
pub(super) struct Probing {
    blocked: watch::Sender<Blocked>,
    /// Counts writes that the database could not do.
    faults: watch::Sender<u64>,
    /// Why the log could not be moved into the database when that was last tried.
    stuck: Mutex<Blocked>,
    /// The files, as they were opened, with why nothing is written once one is another: what is written then is in no file that
    /// anybody finds again.
    files: [(PathBuf, Option<Identity>, &'static str); 3],
    path: PathBuf,
    pending: Mutex<Pending>,
    /// Free space of the disk that is kept, bytes, where that is stated.
    headroom: Option<u64>,
    /// Whether there was less when it was looked at last.
    cramped: AtomicBool,
}

#[derive(Debug, Default)]
struct Pending {
    /// A probe that has not come back yet.
    write: Option<JoinHandle<Result<()>>>,
    /// Whether the last one failed.
    failed: bool,
    /// Faults when the last one began.
    faults: u64,
}

/// Device and number of a file.
type Identity = (u64, u64);

/// The files of a database. Those beside it are beside what its name is a link to.
fn names(path: &Path) -> [(PathBuf, &'static str); 3] {
    let real = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let beside = |behind: &str| {
        let mut name = real.clone().into_os_string();
        name.push(behind);
        PathBuf::from(name)
    };
    [(path.to_owned(), GONE), (beside("-wal"), LOG_GONE), (beside("-shm"), INDEX_GONE)]
}

fn identity(path: &Path) -> Option<Identity> {
    std::fs::metadata(path).ok().map(|file| (file.dev(), file.ino()))
}

impl Probing {
    /// Of a file that has just been opened.
    pub(super) fn new(options: &SqliteOptions) -> Self {
        let path = &options.path;
        Self {
            headroom: options.headroom,
            cramped: AtomicBool::new(false),
            blocked: watch::channel(None).0,
            faults: watch::channel(0).0,
            stuck: Mutex::default(),
            files: names(path).map(|(name, reason)| (name.clone(), identity(&name), reason)),
            path: path.to_owned(),
            pending: Mutex::default(),
        }
    }

    fn pending(&self) -> MutexGuard<'_, Pending> {
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Follows why writes are refused without being tried.
    pub(super) fn blocked(&self) -> watch::Receiver<Blocked> {
        self.blocked.subscribe()
    }

    /// Follows the number of writes that the database could not do.
    pub(super) fn faults(&self) -> watch::Receiver<u64> {
        self.faults.subscribe()
    }

    /// Notes that the database could not do a write.
    pub(super) fn fault(&self) {
        self.faults.send_modify(|faults| *faults += 1);
    }

    /// Notes whether the log could be moved into the database, and why not.
    pub(super) fn log_moves(&self, stuck: Blocked) {
        let before = std::mem::replace(&mut *self.stuck(), stuck);
        if before.is_none() && stuck.is_some() {
            self.fault();
        }
    }

    /// Why writes that bring bytes are refused: what is left of the disk is kept for removing records.
    pub(super) fn cramped(&self) -> Blocked {
        let is_cramped = self.is_cramped();
        if is_cramped && !self.cramped.swap(true, Ordering::Relaxed) {
            self.fault();
        }
        self.cramped.store(is_cramped, Ordering::Relaxed);
        is_cramped.then_some(NO_ROOM)
    }

    fn is_cramped(&self) -> bool {
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // A file system that does not say how much there is has no bound but its own.
        let Ok(disk) = rustix::fs::statvfs(folder) else { return false };
        let kept = self.headroom.unwrap_or_else(|| DEFAULT_HEADROOM.min(disk.f_blocks * disk.f_frsize / SMALL_DISK));
        disk.f_bavail.saturating_mul(disk.f_frsize) < kept
    }

    fn stuck(&self) -> MutexGuard<'_, Blocked> {
        self.stuck.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Why nothing is written any more: a file is not the one that was opened. Writes are then refused without being tried.
    pub(super) fn gone(&self) -> Blocked {
        let (_, _, reason) = self.files.iter().find(|(name, file, _)| identity(name) != *file)?;
        self.block(Some(reason));
        Some(reason)
    }

    fn block(&self, reason: Blocked) {
        self.blocked.send_if_modified(|blocked| std::mem::replace(blocked, reason) != reason);
    }
}

impl SqliteStore {
    /// See [`crate::Database::probe`].
    pub(super) async fn probe_writing(&self, patience: Duration) -> Result<()> {
        let probing = &self.inner.probing;
        if let Some(reason) = probing.gone() {
            return Err(StoreError::unavailable(reason));
        }
        let (result, faults) = loop {
            let (mut write, faults, was_late) = self.probing_write();
            match tokio::time::timeout(patience, &mut write).await {
                // What came too late says nothing of a disk that is fast enough: the next write does.
                Ok(Ok(Ok(()))) if was_late => {}
                Ok(Ok(result)) => break (result, faults),
                Ok(Err(_)) => break (Err(StoreError::unavailable("the service is ending")), faults),
                Err(_) => {
                    probing.pending().write = Some(write);
                    probing.block(Some(STALLED));
                    return Err(StoreError::unavailable(STALLED));
                }
            }
        };
        probing.block(None);
        let mut pending = probing.pending();
        pending.failed = result.is_err();
        pending.faults = faults;
        // Small writes may find room in a log that can no longer be emptied, for as long as that lasts.
        let reason = *probing.stuck();
        match reason.or_else(|| probing.cramped()) {
            Some(reason) => result.and(Err(StoreError::unavailable(reason))),
            None => result,
        }
    }

    /// The write of a probe, faults when it began, and whether it is one that has not come back in time.
    fn probing_write(&self) -> (JoinHandle<Result<()>>, u64, bool) {
        let probing = &self.inner.probing;
        let mut pending = probing.pending();
        let faults = *probing.faults.borrow();
        let ballast = pending.failed || faults != pending.faults;
        match pending.write.take() {
            Some(write) => (write, faults, true),
            None => {
                let store = self.clone();
                let bytes = if ballast { BALLAST_BYTES } else { 0 };
                (tokio::spawn(async move { store.write_probe(bytes).await }), faults, false)
            }
        }
    }

    async fn write_probe(&self, ballast_bytes: i64) -> Result<()> {
        for bytes in [ballast_bytes, 0] {
            let write = self.inner.writer.write_unblocked(0, move |tx| {
                Box::pin(async move {
                    let now_us = tx.now_us();
                    sqlx::query("INSERT OR REPLACE INTO probe (id, at_us, ballast) VALUES (1, ?, zeroblob(?))")
                        .bind(now_us)
                        .bind(bytes)
                        .execute(&mut tx.connection)
                        .await?;
                    Ok(())
                })
            });
            write.await?;
            if ballast_bytes == 0 {
                break;
            }
        }
        Ok(())
    }
}
