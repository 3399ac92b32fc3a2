//! The exclusive right to a database file. Two processes could write to one SQLite file safely, but neither would see
//! the other's events arrive, and both would validate the same jobs.
//!
//! The right is a lock of the operating system on a file beside the database, which ends with the process however it
//! ends: what a killed one leaves is the file, not the lock. The file says who holds it, for the error of the next one. The database
//! itself is locked as well: by another name of it (a hard link) it has another file beside it, and another log of SQLite, which
//! would destroy it. SQLite's own locks are of another kind, and know nothing of this one.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::error::{Result, StoreError};

/// How often a lock that another process holds is tried again.
const RETRY: Duration = Duration::from_millis(20);

/// Most bytes read of what another process left in the file.
const MAX_HOLDER_BYTES: u64 = 512;

/// The lock; dropping it gives it up.
#[derive(Debug)]
pub(super) struct FileLock {
    _file: File,
    /// The database, once there is one. Nothing is read or written through it.
    database: Option<File>,
}

impl FileLock {
    /// Takes the lock of the database at `path`, waiting up to `patience` for another process that is ending.
    ///
    /// # Errors
    /// `InUseBy` who holds it, `CannotOpen` if the file beside the database cannot be used.
    pub(super) async fn take(path: &Path, patience: Duration) -> Result<Self> {
        let cannot = |error| StoreError::CannotOpen {
            reason: "its lock file cannot be used",
            source: Some(std::sync::Arc::new(error)),
        };
        let place = beside(path);
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&place).map_err(cannot)?;
        let begun = Instant::now();
        loop {
            match file.try_lock() {
                Ok(()) => break,
                Err(TryLockError::WouldBlock) if begun.elapsed() < patience => tokio::time::sleep(RETRY).await,
                Err(TryLockError::WouldBlock) => return Err(StoreError::InUseBy { holder: holder(&mut file) }),
                Err(TryLockError::Error(error)) => return Err(cannot(error)),
            }
        }
        let text = format!("process {} on host {}\n", std::process::id(), host());
        file.set_len(0).and_then(|()| file.write_all(text.as_bytes())).map_err(cannot)?;
        let mut lock = Self { _file: file, database: None };
        if path.exists() {
            lock.hold(path)?;
        }
        Ok(lock)
    }

    /// Locks the database itself, which is there; once is enough.
    ///
    /// # Errors
    /// `InUseBy` another process that has it by another name, `CannotOpen` if it cannot be used.
    pub(super) fn hold(&mut self, path: &Path) -> Result<()> {
        if self.database.is_some() {
            return Ok(());
        }
        let cannot =
            |error| StoreError::CannotOpen { reason: "it cannot be locked", source: Some(std::sync::Arc::new(error)) };
        let database = OpenOptions::new().read(true).write(true).open(path).map_err(cannot)?;
        match database.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let process = match flock_holder(&database) {
                    Some(process) => format!("process {process} on host {}", host()),
                    None => "another process".to_owned(),
                };
                return Err(StoreError::InUseBy {
                    holder: format!(
                        "{process}, whose lock file was removed, or which has it by another name (a hard link)"
                    ),
                });
            }
            Err(TryLockError::Error(error)) => return Err(cannot(error)),
        }
        self.database = Some(database);
        Ok(())
    }
}

/// The process that holds the lock of a file, where the system tells: Linux does, of processes that this one can see.
fn flock_holder(file: &File) -> Option<u32> {
    let metadata = rustix::fs::fstat(file).ok()?;
    let (major, minor) = (rustix::fs::major(metadata.st_dev), rustix::fs::minor(metadata.st_dev));
    let place = format!("{major:02x}:{minor:02x}:{}", metadata.st_ino);
    let locks = std::fs::read_to_string("/proc/locks").ok()?;
    locks.lines().find_map(|line| {
        // `1: FLOCK  ADVISORY  WRITE 4711 fe:00:131072 0 EOF`
        let fields: Vec<&str> = line.split_whitespace().collect();
        let is_it = fields.len() > 5 && fields[1] == "FLOCK" && fields[5] == place;
        // One of another namespace has no number here.
        is_it.then(|| fields[4].parse().ok()).flatten().filter(|&process| process > 0)
    })
}

/// Name of this host, which is that of the container in one.
fn host() -> String {
    // Where the system says it, and where it is configured.
    let files = ["/proc/sys/kernel/hostname", "/etc/hostname"].into_iter();
    let name = files.filter_map(|file| std::fs::read_to_string(file).ok()).find(|name| !name.trim().is_empty());
    name.map_or_else(|| "of unknown name".to_owned(), |name| name.trim().to_owned())
}

/// The lock file of a database: links to one file have one lock.
fn beside(path: &Path) -> PathBuf {
    let real = path.canonicalize().unwrap_or_else(|_| match (path.parent(), path.file_name()) {
        // The database is yet to be created.
        (Some(folder), Some(name)) => folder.canonicalize().unwrap_or_else(|_| folder.to_owned()).join(name),
        _ => path.to_owned(),
    });
    let mut name = real.into_os_string();
    name.push(".lock");
    name.into()
}

/// Who holds the lock, as they wrote it down.
fn holder(file: &mut File) -> String {
    let mut text = String::new();
    let read = file.rewind().and_then(|()| file.take(MAX_HOLDER_BYTES).read_to_string(&mut text));
    match text.trim() {
        "" => "another process".to_owned(),
        _ if read.is_err() => "another process".to_owned(),
        holder => holder.to_owned(),
    }
}
