//! Whether the files can be read at all. SQLite tells a disk that fails to read (EIO) as damage of the database
//! (`SQLITE_IOERR_CORRUPTFS` becomes `SQLITE_CORRUPT` on its way out), so what looks like damage is held against the files themselves.

use std::fs::File;
use std::io::{Error, ErrorKind};
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
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

/// What was found last.
#[derive(Debug, Default)]
pub(super) struct Reading(Mutex<Option<(Instant, Option<StoreError>)>>);

impl Reading {
    /// Why the files of a database cannot be read; `None` where they can.
    pub(super) async fn fault(&self, path: &Path) -> Option<StoreError> {
        let mut last = self.0.lock().await;
        if let Some((at, fault)) = &*last
            && at.elapsed() < FRESH
        {
            return fault.clone();
        }
        let fault = read_fault(path).await;
        *last = Some((Instant::now(), fault.clone()));
        fault
    }
}

/// Why the files of a database cannot be read; `None` where they can.
pub(super) async fn read_fault(path: &Path) -> Option<StoreError> {
    let mut log = path.as_os_str().to_owned();
    log.push("-wal");
    let files = [path.to_owned(), PathBuf::from(log)];
    let read = tokio::task::spawn_blocking(move || {
        let until = Instant::now() + PATIENCE;
        files.iter().try_for_each(|file| read_through(file, until))
    });
    read.await.ok()?.err().map(|error| StoreError::unavailable_by(UNREADABLE, error))
}

fn read_through(path: &Path, until: Instant) -> Result<(), Error> {
    let file = match File::open(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        file => file?,
    };
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
