//! Programs and uploads as rows.

use bytes::Bytes;

use super::compress::{compress, decompress, offload};
use super::record::{Record, parsed, signed, unsigned};
use super::seal::{CHUNK, PROGRAM};
use crate::error::{Kind, Result, StoreError};
use crate::programs::{CHUNK_BYTES, ProgramEntry, ProgramId, ProgramInfo, ProgramKey, UploadId, UploadInfo};

/// Chunks removed by one write: a large program is removed in pieces, so that other writes are not delayed.
pub(crate) const REMOVED_CHUNKS: i64 = 32;

/// Longest file name in bytes.
pub(crate) const MAX_FILE_NAME_BYTES: u64 = 4_096;

/// A compressed chunk to be written.
#[derive(Debug)]
pub(crate) struct Chunk {
    pub(crate) index: i64,
    pub(crate) source_bytes: i64,
    pub(crate) data: Vec<u8>,
}

impl Chunk {
    /// Compresses the chunk of `source` that begins at a multiple of [`CHUNK_BYTES`].
    fn of(source: &[u8], source_offset: u64) -> Result<Self> {
        Ok(Self {
            index: signed("chunk index", source_offset / CHUNK_BYTES)?,
            source_bytes: signed("chunk size in bytes", source.len() as u64)?,
            data: compress(source)?,
        })
    }

    /// The chunks of a whole `source` that begins at a multiple of [`CHUNK_BYTES`].
    pub(crate) fn all(source: &[u8], begin: u64) -> Result<Vec<Self>> {
        let pieces = source.chunks(CHUNK_BYTES as usize).zip((begin..).step_by(CHUNK_BYTES as usize));
        pieces.map(|(piece, offset)| Self::of(piece, offset)).collect()
    }
}

/// What appending to an upload writes.
#[derive(Debug)]
pub(crate) struct Appended {
    /// Chunks that are full, or the last.
    pub(crate) chunks: Vec<Chunk>,
    /// Bytes behind them that do not fill a chunk.
    pub(crate) tail: Vec<u8>,
}

impl Appended {
    /// What `source`, beginning at byte `begin` of an upload, is written as; `last` where nothing follows.
    pub(crate) fn of(mut source: Vec<u8>, begin: u64, last: bool) -> Result<Self> {
        let whole = if last { source.len() } else { source.len() - source.len() % CHUNK_BYTES as usize };
        let chunks = Chunk::all(&source[..whole], begin)?;
        Ok(Self { chunks, tail: source.split_off(whole) })
    }

    /// Bytes that it holds in memory.
    pub(crate) fn bytes(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.data.len()).sum::<usize>() + self.tail.len()
    }
}

pub(crate) fn program_info(row: &impl Record) -> Result<ProgramInfo> {
    Ok(ProgramInfo {
        id: parsed::<ProgramKey>(row, "id")?.0,
        size_bytes: unsigned(row, "size_bytes")?,
        chunk_count: unsigned(row, "chunk_count")?,
        created_us: row.integer("created_us")?,
    })
}

/// A program as its row has it, whose seal is compared.
pub(crate) fn sealed_program(row: &impl Record) -> Result<ProgramInfo> {
    PROGRAM.verify(row)?;
    program_info(row)
}

/// The seal of the row of a program; its size and its number of chunks.
pub(crate) fn program_seal(info: &ProgramInfo, content: i64) -> Result<(Vec<u8>, i64, i64)> {
    let size = signed("program size in bytes", info.size_bytes)?;
    let chunks = signed("number of chunks", info.chunk_count)?;
    Ok((PROGRAM.seal([info.id.key().as_str().into(), content.into(), size.into(), chunks.into()]), size, chunks))
}

/// The seal of the row of a chunk.
pub(crate) fn chunk_seal(content: i64, index: i64, source_bytes: i64) -> Vec<u8> {
    CHUNK.seal([content.into(), index.into(), source_bytes.into()])
}

pub(crate) fn program_entry(row: &impl Record) -> Result<ProgramEntry> {
    Ok(ProgramEntry {
        info: program_info(row)?,
        sequence: row.integer("sequence")?,
        file_name: row.text("file_name")?.to_owned(),
        job_count: unsigned(row, "job_count")?,
    })
}

/// The source of the chunk of a content that was looked up by its index.
pub(crate) async fn chunk_source(row: &impl Record, (content, index): (i64, i64)) -> Result<Bytes> {
    CHUNK.compare(row, "seal", [content.into(), index.into(), row.integer("source_bytes")?.into()])?;
    let size = unsigned(row, "source_bytes")?;
    let data = row.bytes("data")?.to_vec();
    if size > CHUNK_BYTES {
        return Err(StoreError::corrupt("a chunk claims to be larger than chunks are"));
    }
    offload(data.len(), move || decompress(&data, size)).await
}

/// The source of the chunk of a program that was looked up by its identifier and index.
pub(crate) async fn program_chunk_source(row: &impl Record, id: ProgramId, index: i64) -> Result<Bytes> {
    let content = row.integer("content_id")?;
    let [size, chunks] = [row.integer("size_bytes")?, row.integer("chunk_count")?].map(Into::into);
    PROGRAM.compare(row, "program_seal", [id.key().as_str().into(), content.into(), size, chunks])?;
    chunk_source(row, (content, index)).await
}

/// Longest name of a client in bytes.
pub(crate) const MAX_CLIENT_BYTES: u64 = 4_096;

/// Bytes appended by one write; larger pieces are appended by several.
pub(crate) const APPENDED_BYTES: usize = 4 << 20;

pub(crate) fn upload_info(row: &impl Record) -> Result<UploadInfo> {
    Ok(UploadInfo {
        number: row.integer("content_id")?,
        id: parsed(row, "id")?,
        expected: parsed::<ProgramKey>(row, "expected_id")?.0,
        client: row.text("client")?.to_owned(),
        size_bytes: unsigned(row, "size_bytes")?,
        received_bytes: unsigned(row, "received_bytes")?,
        created_us: row.integer("created_us")?,
        updated_us: row.integer("updated_us")?,
    })
}

pub(crate) fn missing_upload(id: UploadId) -> StoreError {
    StoreError::not_found(Kind::Upload, id)
}
