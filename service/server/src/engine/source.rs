//! Where a pipeline's program bytes come from.

use bytes::Bytes;
use feedwave_store::{CHUNK_BYTES, ProgramId, Store};
use tokio::runtime::Handle;

use crate::error::Result;

/// Program bytes in order. Reads block: use it on a blocking thread.
#[derive(Debug)]
pub(super) enum Source {
    /// A program in memory.
    Memory(Option<Bytes>),
    /// A stored program.
    Stored(StoredSource),
}

/// A stored program, read chunk by chunk.
#[derive(Debug)]
pub(super) struct StoredSource {
    store: Store,
    id: ProgramId,
    size_bytes: u64,
    offset: u64,
    runtime: Handle,
}

impl Source {
    /// A program in memory, in pieces of a size that suits a pipeline.
    pub(super) const fn memory(program: Bytes) -> Self {
        Self::Memory(Some(program))
    }

    /// A stored program from `offset` on. Call inside a runtime.
    pub(super) fn stored(store: Store, id: ProgramId, size_bytes: u64, offset: u64) -> Self {
        Self::Stored(StoredSource { store, id, size_bytes, offset, runtime: Handle::current() })
    }

    /// The next bytes; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<Bytes>> {
        match self {
            Self::Memory(program) => Ok(program.take()),
            Self::Stored(stored) => stored.next(),
        }
    }
}

impl StoredSource {
    fn next(&mut self) -> Result<Option<Bytes>> {
        if self.offset >= self.size_bytes {
            return Ok(None);
        }
        let chunk = self.runtime.block_on(self.store.program_chunk(self.id, self.offset / CHUNK_BYTES))?;
        let piece = chunk.slice((self.offset % CHUNK_BYTES) as usize..);
        self.offset += piece.len() as u64;
        Ok(Some(piece))
    }
}
