//! Where a pipeline's program bytes come from.

use std::sync::OnceLock;

use bytes::Bytes;
use feedwave_program::Place;
use feedwave_store::{CHUNK_BYTES, ProgramId, Store};
use tokio::runtime::Handle;

use crate::error::{Error, Result};

/// Bytes of a job's programs at any place: the program itself, and the further files in the order of their places. Reads block:
/// use it on a blocking thread.
#[derive(Clone, Debug)]
pub struct Source {
    files: Vec<File>,
}

/// One program of a [`Source`].
#[derive(Clone, Debug)]
pub enum File {
    /// In memory.
    Memory(Bytes),
    /// Stored, and read chunk by chunk.
    Stored(Box<StoredFile>),
}

/// A stored program.
#[derive(Clone, Debug)]
pub struct StoredFile {
    store: Store,
    id: ProgramId,
    /// Size, bytes, once it is known.
    size_bytes: OnceLock<u64>,
    runtime: Handle,
}

impl Source {
    /// A program, and further files.
    pub const fn new(files: Vec<File>) -> Self {
        Self { files }
    }

    /// A program in memory alone.
    pub fn memory(program: Bytes) -> Self {
        Self { files: vec![File::Memory(program)] }
    }

    /// Bytes from a place on; `None` at the end of the program.
    pub(super) fn read(&self, place: Place) -> Result<Option<Bytes>> {
        match self.files.get(place.program as usize) {
            Some(File::Memory(program)) => {
                let from = program.len().min(place.offset as usize);
                let to = program.len().min(from + CHUNK_BYTES as usize);
                Ok((from < to).then(|| program.slice(from..to)))
            }
            Some(File::Stored(stored)) => stored.read(place.offset),
            None => Err(Error::internal(format!("there is no program file {}", place.program))),
        }
    }
}

impl File {
    /// A stored program. Call inside a runtime.
    pub fn stored(store: Store, id: ProgramId) -> Self {
        Self::stored_file(store, id, OnceLock::new())
    }

    /// A stored program of this size, bytes. Call inside a runtime.
    pub fn stored_of_size(store: Store, id: ProgramId, size_bytes: u64) -> Self {
        Self::stored_file(store, id, OnceLock::from(size_bytes))
    }

    fn stored_file(store: Store, id: ProgramId, size_bytes: OnceLock<u64>) -> Self {
        Self::Stored(Box::new(StoredFile { store, id, size_bytes, runtime: Handle::current() }))
    }
}

impl StoredFile {
    fn read(&self, offset: u64) -> Result<Option<Bytes>> {
        let size_bytes = match self.size_bytes.get() {
            Some(size_bytes) => *size_bytes,
            None => {
                let size_bytes = self.runtime.block_on(self.store.program_info(self.id))?.size_bytes;
                *self.size_bytes.get_or_init(|| size_bytes)
            }
        };
        if offset >= size_bytes {
            return Ok(None);
        }
        let chunk = self.runtime.block_on(self.store.program_chunk(self.id, offset / CHUNK_BYTES))?;
        Ok(Some(chunk.slice((offset % CHUNK_BYTES) as usize..)))
    }
}
