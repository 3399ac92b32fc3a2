//! Whether the files can be read at all. SQLite tells a disk that fails to read (EIO) as damage of the database
//! (`SQLITE_IOERR_CORRUPTFS` becomes `SQLITE_CORRUPT` on its way out), so what looks like damage is held against the files themselves.

use std::fs::File;
use std::io::{Error, ErrorKind};
use std::mem::ManuallyDrop;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::Mutex;

use crate::error::StoreError;

const UNREADABLE: &str = "reading the file failed";

/// For how long is read. Of a database that is larger than what a disk reads in this time the rest is taken for readable.
const PATIENCE: Duration = Duration::from_secs(10);
/// How long an answer holds: many may ask at once.
const FRESH: Duration = Duration::from_secs(2);
/// Bytes that are read at once.
const PIECE_BYTES: usize = 1 << 20;

/// A database that is never closed again: closing any descriptor of it would give up the locks that SQLite holds on it for this process, and
/// another process that closes it would then remove the log under it.
type Kept = Arc<ManuallyDrop<File>>;

/// Reads the files of a database that is open.
#[derive(Debug, Default)]
pub(super) struct Reading(Mutex<Read>);

#[derive(Debug, Default)]
struct Read {
    database: Option<Kept>,
    /// What was found last.
    last: Option<(Instant, Option<StoreError>)>,
}

impl Reading {
    /// Why the files of a database cannot be read; `None` where they can.
    pub(super) async fn fault(&self, path: &Path) -> Option<StoreError> {
        let mut read = self.0.lock().await;
        if let Some((at, fault)) = &read.last
            && at.elapsed() < FRESH
        {
            return fault.clone();
        }
        let fault = match read.open(path) {
            Ok(database) => read_files(database, path).await,
            Err(error) => Err(error),
        };
        let fault = fault.err().map(|error| StoreError::unavailable_by(UNREADABLE, error));
        read.last = Some((Instant::now(), fault.clone()));
        fault
    }
}

impl Read {
    fn open(&mut self, path: &Path) -> Result<Kept, Error> {
        if let Some(database) = &self.database {
            return Ok(database.clone());
        }
        let database = Arc::new(ManuallyDrop::new(File::open(path)?));
        self.database = Some(database.clone());
        Ok(database)
    }
}

async fn read_files(database: Kept, path: &Path) -> Result<(), Error> {
    let mut log = path.as_os_str().to_owned();
    log.push("-wal");
    let log = PathBuf::from(log);
    let read = tokio::task::spawn_blocking(move || {
        let until = Instant::now() + PATIENCE;
        read_through(&database, until)?;
        match File::open(log) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            log => read_through(&log?, until),
        }
    });
    // It is not read where the service is ending.
    read.await.unwrap_or(Ok(()))
}

fn read_through(file: &File, until: Instant) -> Result<(), Error> {
    let (mut piece, mut offset) = (vec![0; PIECE_BYTES], 0);
    while Instant::now() < until {
        match file.read_at(&mut piece, offset) {
            Ok(0) => break,
            Ok(bytes) => offset += bytes as u64,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
