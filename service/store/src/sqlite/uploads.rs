//! Uploads in SQLite. Bytes that do not fill a chunk wait as they came in `upload_tails`; once they
//! fill one, or are the last, they are compressed into a chunk. So an acknowledged byte is written
//! at most twice however small the pieces are, and a finished upload becomes a program without
//! copying.

use std::time::{SystemTime, UNIX_EPOCH};

use bytes::Bytes;
use sha2::{Digest, Sha256};
use sqlx::Row;
use sqlx::sqlite::SqliteRow;
use uuid::Uuid;

use super::SqliteStore;
use super::compress::offload;
use super::fault::{parsed, signed, unsigned};
use super::programs::{Chunk, find_program, insert_chunks, insert_content, insert_program};
use super::writer::Transaction;
use crate::error::{Kind, Result, StoreError, check_size};
use crate::programs::{CHUNK_BYTES, ProgramId, ProgramInfo, ProgramKey, UploadId, UploadInfo, UploadStart};

/// Longest name of a client in bytes.
const MAX_CLIENT_BYTES: u64 = 4_096;

/// Bytes appended by one write; larger pieces are appended by several.
const APPENDED_BYTES: usize = 4 << 20;

fn upload_info(row: &SqliteRow) -> Result<UploadInfo> {
    Ok(UploadInfo {
        id: parsed(row, "id")?,
        expected: parsed::<ProgramKey>(row, "expected_id")?.0,
        client: row.try_get("client")?,
        size_bytes: unsigned(row, "size_bytes")?,
        received_bytes: unsigned(row, "received_bytes")?,
        created_us: row.try_get("created_us")?,
        updated_us: row.try_get("updated_us")?,
    })
}

fn missing(id: UploadId) -> StoreError {
    StoreError::not_found(Kind::Upload, id)
}

impl SqliteStore {
    /// An upload and its content.
    pub(super) async fn find_upload(&self, id: UploadId) -> Result<(i64, UploadInfo)> {
        let row = sqlx::query("SELECT * FROM uploads WHERE id = ?")
            .bind(id.to_string())
            .fetch_optional(&mut *self.reader().await?)
            .await?
            .ok_or_else(|| missing(id))?;
        Ok((row.try_get("content_id")?, upload_info(&row)?))
    }

    pub(super) async fn all_uploads(&self) -> Result<Vec<UploadInfo>> {
        let rows =
            sqlx::query("SELECT * FROM uploads ORDER BY content_id").fetch_all(&mut *self.reader().await?).await?;
        rows.iter().map(upload_info).collect()
    }

    pub(super) async fn begin(&self, expected: ProgramId, size_bytes: u64, client: &str) -> Result<UploadStart> {
        check_size("client size in bytes", client.len(), MAX_CLIENT_BYTES)?;
        let what = "program size in bytes";
        let limit = self.settings().max_program_bytes;
        if size_bytes > limit {
            return Err(StoreError::TooLarge { what, size: size_bytes, limit });
        }
        let size = signed(what, size_bytes)?;
        let limits = [self.settings().max_uploads, self.settings().max_client_uploads].map(u64::from);
        let client = client.to_owned();
        // What nobody goes on with keeps nobody out.
        self.discard_expired().await?;
        self.write(0, move |tx| {
            Box::pin(async move {
                if let Some(program) = find_program(&mut tx.connection, expected).await? {
                    return Ok(UploadStart::Complete(program));
                }
                let unfinished = sqlx::query("SELECT * FROM uploads WHERE expected_id = ? AND size_bytes = ?")
                    .bind(expected.key())
                    .bind(size)
                    .fetch_optional(&mut tx.connection)
                    .await?;
                if let Some(row) = unfinished {
                    return Ok(UploadStart::Unfinished(upload_info(&row)?));
                }
                let counts: (i64, i64) =
                    sqlx::query_as("SELECT COUNT(*), COUNT(*) FILTER (WHERE client = ?) FROM uploads")
                        .bind(&client)
                        .fetch_one(&mut tx.connection)
                        .await?;
                let what = ["unfinished uploads", "unfinished uploads of this client"];
                for ((count, limit), what) in [counts.0, counts.1].into_iter().zip(limits).zip(what) {
                    if count.unsigned_abs() >= limit {
                        return Err(StoreError::LimitReached { what, limit });
                    }
                }
                let content = insert_content(&mut tx.connection).await?;
                let now_us = tx.now_us();
                let row = sqlx::query(
                    "INSERT INTO uploads (id, content_id, expected_id, size_bytes, received_bytes, created_us, updated_us,
                        client) VALUES (?, ?, ?, ?, 0, ?, ?, ?) RETURNING *",
                )
                    .bind(Uuid::now_v7().to_string())
                    .bind(content)
                    .bind(expected.key())
                    .bind(size)
                    .bind(now_us)
                    .bind(now_us)
                    .bind(&client)
                    .fetch_one(&mut tx.connection)
                    .await?;
                Ok(UploadStart::Unfinished(upload_info(&row)?))
            })
        })
        .await
    }

    pub(super) async fn append(&self, id: UploadId, offset: u64, data: Bytes) -> Result<u64> {
        let (content, info) = self.find_upload(id).await?;
        let received = info.received_bytes;
        if offset != received {
            return Err(StoreError::WrongOffset { upload_id: id, expected: received, given: offset });
        }
        let end = received.saturating_add(data.len() as u64);
        if end > info.size_bytes {
            return Err(StoreError::TooLarge { what: "upload size in bytes", size: end, limit: info.size_bytes });
        }
        let mut received = received;
        let mut rest = data;
        while !rest.is_empty() {
            let piece = rest.split_to(rest.len().min(APPENDED_BYTES));
            let last = received + piece.len() as u64 == info.size_bytes;
            received = self.append_piece(id, content, received, piece, last).await?;
        }
        Ok(received)
    }

    async fn append_piece(&self, id: UploadId, content: i64, offset: u64, piece: Bytes, last: bool) -> Result<u64> {
        let received = offset + piece.len() as u64;
        let full = received / CHUNK_BYTES > offset / CHUNK_BYTES;
        let (chunks, tail) = if full || last {
            let mut source = self.tail(id, offset).await?;
            let begin = offset - source.len() as u64;
            offload(source.len() + piece.len(), move || {
                source.extend_from_slice(&piece);
                let whole = if last { source.len() } else { source.len() - source.len() % CHUNK_BYTES as usize };
                let pieces = source[..whole].chunks(CHUNK_BYTES as usize).zip((begin..).step_by(CHUNK_BYTES as usize));
                let chunks = pieces.map(|(piece, offset)| Chunk::of(piece, offset)).collect::<Result<Vec<_>>>()?;
                Ok((chunks, source.split_off(whole)))
            })
            .await?
        } else {
            (Vec::new(), piece.to_vec())
        };
        let tail_offset = signed("upload size in bytes", received - tail.len() as u64)?;
        let offset_column = signed("upload size in bytes", offset)?;
        let received_column = signed("upload size in bytes", received)?;
        let payload = chunks.iter().map(|chunk| chunk.data.len()).sum::<usize>() + tail.len();
        self.write(payload, move |tx| {
            Box::pin(async move {
                // Another caller may have appended since the tail was read; then nothing of this fits.
                let now_us = tx.now_us();
                let updated = sqlx::query(
                    "UPDATE uploads SET received_bytes = ?, updated_us = ? WHERE id = ? AND received_bytes = ?",
                )
                .bind(received_column)
                .bind(now_us)
                .bind(id.to_string())
                .bind(offset_column)
                .execute(&mut tx.connection)
                .await?;
                if updated.rows_affected() == 0 {
                    return Err(not_there(tx, id, offset).await?);
                }
                if !chunks.is_empty() {
                    sqlx::query("DELETE FROM upload_tails WHERE upload_id = ?")
                        .bind(id.to_string())
                        .execute(&mut tx.connection)
                        .await?;
                    insert_chunks(&mut tx.connection, content, chunks).await?;
                }
                if !tail.is_empty() {
                    sqlx::query("INSERT INTO upload_tails (upload_id, source_offset, data) VALUES (?, ?, ?)")
                        .bind(id.to_string())
                        .bind(tail_offset)
                        .bind(tail)
                        .execute(&mut tx.connection)
                        .await?;
                }
                Ok(received)
            })
        })
        .await
    }

    /// The bytes before `offset` that are not in a chunk yet.
    async fn tail(&self, id: UploadId, offset: u64) -> Result<Vec<u8>> {
        let rows = sqlx::query(
            "SELECT data FROM upload_tails WHERE upload_id = ? AND source_offset < ? ORDER BY source_offset",
        )
        .bind(id.to_string())
        .bind(signed("upload size in bytes", offset)?)
        .fetch_all(&mut *self.reader().await?)
        .await?;
        let mut tail = Vec::with_capacity(CHUNK_BYTES as usize);
        for row in rows {
            tail.extend_from_slice(row.try_get("data")?);
        }
        if tail.len() as u64 == offset % CHUNK_BYTES {
            return Ok(tail);
        }
        // Either the upload went on meanwhile, or what was received is not all there.
        match self.find_upload(id).await?.1.received_bytes {
            received if received == offset => {
                Err(StoreError::corrupt(format!("bytes of upload {id} before {offset} are missing")))
            }
            expected => Err(StoreError::WrongOffset { upload_id: id, expected, given: offset }),
        }
    }

    pub(super) async fn finish(&self, id: UploadId) -> Result<ProgramInfo> {
        let (content, info) = self.find_upload(id).await?;
        if info.received_bytes < info.size_bytes {
            return Err(StoreError::Incomplete {
                upload_id: id,
                received: info.received_bytes,
                expected: info.size_bytes,
            });
        }
        let chunk_count = info.size_bytes.div_ceil(CHUNK_BYTES);
        let actual = self.hash(id, content, chunk_count).await?.of_tenant(info.expected.tenant());
        if actual != info.expected {
            tracing::warn!(upload = %id, expected = %info.expected, %actual, "upload discarded: wrong hash");
            self.discard(id).await?;
            return Err(StoreError::HashMismatch { expected: Box::new(info.expected), actual: Box::new(actual) });
        }
        let (program, superfluous) = self
            .write(0, move |tx| {
                Box::pin(async move {
                    let deleted = sqlx::query("DELETE FROM uploads WHERE id = ?")
                        .bind(id.to_string())
                        .execute(&mut tx.connection)
                        .await?;
                    if deleted.rows_affected() == 0 {
                        return Err(missing(id));
                    }
                    // The same program may have been uploaded by another request meanwhile.
                    if let Some(program) = find_program(&mut tx.connection, info.expected).await? {
                        return Ok((program, true));
                    }
                    let program = ProgramInfo {
                        id: info.expected,
                        size_bytes: info.size_bytes,
                        chunk_count,
                        created_us: tx.now_us(),
                    };
                    insert_program(&mut tx.connection, content, &program).await?;
                    Ok((program, false))
                })
            })
            .await?;
        if superfluous {
            self.remove_content(content).await?;
        }
        Ok(program)
    }

    /// The SHA-256 of what was received, chunk by chunk from the database: what is verified is what
    /// is kept.
    async fn hash(&self, id: UploadId, content: i64, chunk_count: u64) -> Result<ProgramId> {
        let mut hash = Sha256::new();
        for index in 0..chunk_count {
            let Some(chunk) = self.content_chunk(content, index).await? else {
                self.find_upload(id).await?;
                return Err(StoreError::corrupt(format!("chunk {index} of upload {id} is missing")));
            };
            hash = offload(chunk.len(), move || Ok(hash.chain_update(&chunk))).await?;
        }
        Ok(ProgramId::from_bytes(hash.finalize().into()))
    }

    pub(super) async fn discard_expired(&self) -> Result<u64> {
        let kept_us = i64::try_from(self.settings().upload_expiry.as_micros()).unwrap_or(i64::MAX);
        let now_us = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |age| age.as_micros());
        let before_us = i64::try_from(now_us).unwrap_or(i64::MAX).saturating_sub(kept_us);
        let expired = sqlx::query("SELECT id FROM uploads WHERE updated_us < ?")
            .bind(before_us)
            .fetch_all(&mut *self.reader().await?)
            .await?;
        let mut discarded = 0;
        for row in &expired {
            let id = parsed(row, "id")?;
            match self.discard(id).await {
                Ok(()) => {
                    tracing::info!(upload = %id, "an unfinished upload has expired");
                    discarded += 1;
                }
                // Finished or deleted in the meantime.
                Err(StoreError::NotFound { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(discarded)
    }

    pub(super) async fn discard(&self, id: UploadId) -> Result<()> {
        let content = self
            .write(0, move |tx| {
                Box::pin(async move {
                    sqlx::query_scalar("DELETE FROM uploads WHERE id = ? RETURNING content_id")
                        .bind(id.to_string())
                        .fetch_optional(&mut tx.connection)
                        .await?
                        .ok_or_else(|| missing(id))
                })
            })
            .await?;
        self.remove_content(content).await
    }
}

/// Why an upload does not continue at `offset`.
async fn not_there(tx: &mut Transaction, id: UploadId, offset: u64) -> Result<StoreError> {
    let row = sqlx::query("SELECT received_bytes FROM uploads WHERE id = ?")
        .bind(id.to_string())
        .fetch_optional(&mut tx.connection)
        .await?;
    Ok(match row {
        Some(row) => {
            StoreError::WrongOffset { upload_id: id, expected: unsigned(&row, "received_bytes")?, given: offset }
        }
        None => missing(id),
    })
}
