//! Where a pipeline's program bytes come from.

use bytes::Bytes;
use feedwave_program::Place;
use feedwave_store::{CHUNK_BYTES, ProgramId, Store};
use tokio::runtime::Handle;

use crate::error::Result;

/// Program bytes at any place. Reads block: use it on a blocking thread.
#[derive(Debug)]
pub(super) enum Source {
    /// A program in memory.
    Memory(Bytes),
    /// A stored program.
    Stored(StoredSource),
}

/// A stored program, read chunk by chunk.
#[derive(Debug)]
pub(super) struct StoredSource {
    store: Store,
    id: ProgramId,
    size_bytes: u64,
    runtime: Handle,
}

impl Source {
    /// A program in memory.
    pub(super) const fn memory(program: Bytes) -> Self {
        Self::Memory(program)
    }

    /// A stored program. Call inside a runtime.
    pub(super) fn stored(store: Store, id: ProgramId, size_bytes: u64) -> Self {
        Self::Stored(StoredSource { store, id, size_bytes, runtime: Handle::current() })
    }

    /// Bytes from a place on; `None` at the end of the program.
    pub(super) fn read(&self, place: Place) -> Result<Option<Bytes>> {
        match self {
            Self::Memory(program) => {
                let from = program.len().min(place.offset as usize);
                let to = program.len().min(from + CHUNK_BYTES as usize);
                Ok((from < to).then(|| program.slice(from..to)))
            }
            Self::Stored(stored) => stored.read(place.offset),
        }
    }
}

impl StoredSource {
    fn read(&self, offset: u64) -> Result<Option<Bytes>> {
        if offset >= self.size_bytes {
            return Ok(None);
        }
        let chunk = self.runtime.block_on(self.store.program_chunk(self.id, offset / CHUNK_BYTES))?;
        Ok(Some(chunk.slice((offset % CHUNK_BYTES) as usize..)))
    }
}
