//! Uploads in SQLite.

use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use sqlx::Row;
use uuid::Uuid;

use super::SqliteStore;
use super::objects::use_object;
use super::programs::{find_program, insert_chunks, insert_content, insert_program};
use super::writer::Transaction;
use crate::error::{Result, StoreError};
use crate::objects::Written;
use crate::programs::{ProgramInfo, UploadId, UploadInfo, UploadStart};
use crate::settings::StoreSettings;
use crate::sql::programs::{Appended, missing_upload, upload_info};
use crate::sql::record::{parsed, unsigned};
use crate::sql::uploads::{NewUpload, Unfinished, UploadSteps};

impl SqliteStore {
    pub(super) async fn all_uploads(&self) -> Result<Vec<UploadInfo>> {
        let rows =
            sqlx::query("SELECT * FROM uploads ORDER BY content_id").fetch_all(&mut self.reader().await?).await?;
        rows.iter().map(upload_info).collect()
    }
}

#[async_trait]
impl UploadSteps for SqliteStore {
    fn limits(&self) -> &StoreSettings {
        self.settings()
    }

    async fn find_upload(&self, id: UploadId) -> Result<(i64, UploadInfo)> {
        let row = sqlx::query("SELECT * FROM uploads WHERE id = ?")
            .bind(id.to_string())
            .fetch_optional(&mut self.reader().await?)
            .await?
            .ok_or_else(|| missing_upload(id))?;
        Ok((row.try_get("content_id")?, upload_info(&row)?))
    }

    async fn content_chunk(&self, content: i64, index: u64) -> Result<Option<Bytes>> {
        self.chunk_of(content, index).await
    }

    async fn tail_pieces(&self, id: UploadId, before: i64) -> Result<Vec<Vec<u8>>> {
        let pieces = sqlx::query_scalar(
            "SELECT data FROM upload_tails WHERE upload_id = ? AND source_offset < ? ORDER BY source_offset",
        )
        .bind(id.to_string())
        .bind(before)
        .fetch_all(&mut self.reader().await?)
        .await?;
        Ok(pieces)
    }

    async fn untouched_since(&self, before_us: i64) -> Result<Vec<UploadId>> {
        let rows = sqlx::query("SELECT id FROM uploads WHERE updated_us < ?")
            .bind(before_us)
            .fetch_all(&mut self.reader().await?)
            .await?;
        rows.iter().map(|row| parsed(row, "id")).collect()
    }

    async fn write_beginning(&self, new: NewUpload) -> Result<UploadStart> {
        self.write(0, move |tx| Box::pin(begin(tx, new))).await
    }

    async fn write_appended(&self, id: UploadId, content: i64, span: [i64; 2], appended: Appended) -> Result<()> {
        let payload = appended.bytes();
        self.write(payload, move |tx| Box::pin(append(tx, id, content, span, appended))).await
    }

    async fn write_program(
        &self,
        id: UploadId,
        content: i64,
        program: ProgramInfo,
        object: Option<Arc<Written>>,
    ) -> Result<(ProgramInfo, bool)> {
        self.write(0, move |tx| Box::pin(finish(tx, id, content, program, object))).await
    }

    async fn remove_content(&self, content: i64) -> Result<()> {
        self.remove_chunks(content).await
    }

    async fn discard(&self, id: UploadId) -> Result<()> {
        let content = self
            .write(0, move |tx| {
                Box::pin(async move {
                    sqlx::query_scalar("DELETE FROM uploads WHERE id = ? RETURNING content_id")
                        .bind(id.to_string())
                        .fetch_optional(&mut tx.connection)
                        .await?
                        .ok_or_else(|| missing_upload(id))
                })
            })
            .await?;
        self.remove_chunks(content).await
    }
}

async fn begin(tx: &mut Transaction, new: NewUpload) -> Result<UploadStart> {
    if let Some(program) = find_program(&mut tx.connection, new.expected).await? {
        return Ok(UploadStart::Complete(program));
    }
    let unfinished = sqlx::query("SELECT * FROM uploads WHERE expected_id = ? AND size_bytes = ?")
        .bind(new.expected.key())
        .bind(new.size_bytes)
        .fetch_optional(&mut tx.connection)
        .await?;
    if let Some(row) = unfinished {
        return Ok(UploadStart::Unfinished(upload_info(&row)?));
    }
    let unfinished = sqlx::query_as(
        "SELECT COUNT(*), COUNT(*) FILTER (WHERE client = ?1), COALESCE(SUM(size_bytes), 0),
             COALESCE(SUM(size_bytes) FILTER (WHERE client = ?1), 0) FROM uploads",
    )
    .bind(&new.client)
    .fetch_one(&mut tx.connection)
    .await?;
    new.check_bounds(Unfinished::of(unfinished))?;
    let content = insert_content(&mut tx.connection).await?;
    let now_us = tx.now_us();
    let row = sqlx::query(
        "INSERT INTO uploads (id, content_id, expected_id, size_bytes, received_bytes, created_us, updated_us, client)
         VALUES (?, ?, ?, ?, 0, ?, ?, ?) RETURNING *",
    )
    .bind(Uuid::now_v7().to_string())
    .bind(content)
    .bind(new.expected.key())
    .bind(new.size_bytes)
    .bind(now_us)
    .bind(now_us)
    .bind(&new.client)
    .fetch_one(&mut tx.connection)
    .await?;
    Ok(UploadStart::Unfinished(upload_info(&row)?))
}

async fn append(
    tx: &mut Transaction,
    id: UploadId,
    content: i64,
    [from, to]: [i64; 2],
    appended: Appended,
) -> Result<()> {
    // Another caller may have appended since the tail was read; then nothing of this fits.
    let now_us = tx.now_us();
    let updated =
        sqlx::query("UPDATE uploads SET received_bytes = ?, updated_us = ? WHERE id = ? AND received_bytes = ?")
            .bind(to)
            .bind(now_us)
            .bind(id.to_string())
            .bind(from)
            .execute(&mut tx.connection)
            .await?;
    if updated.rows_affected() == 0 {
        return Err(not_there(tx, id, from).await?);
    }
    if !appended.chunks.is_empty() {
        sqlx::query("DELETE FROM upload_tails WHERE upload_id = ?")
            .bind(id.to_string())
            .execute(&mut tx.connection)
            .await?;
    }
    let tail_offset = to - i64::try_from(appended.tail.len()).unwrap_or(0);
    insert_chunks(&mut tx.connection, content, appended.chunks).await?;
    if !appended.tail.is_empty() {
        sqlx::query("INSERT INTO upload_tails (upload_id, source_offset, data) VALUES (?, ?, ?)")
            .bind(id.to_string())
            .bind(tail_offset)
            .bind(appended.tail)
            .execute(&mut tx.connection)
            .await?;
    }
    Ok(())
}

async fn finish(
    tx: &mut Transaction,
    id: UploadId,
    content: i64,
    program: ProgramInfo,
    object: Option<Arc<Written>>,
) -> Result<(ProgramInfo, bool)> {
    let deleted =
        sqlx::query("DELETE FROM uploads WHERE id = ?").bind(id.to_string()).execute(&mut tx.connection).await?;
    if deleted.rows_affected() == 0 {
        return Err(missing_upload(id));
    }
    // The same program may have been uploaded by another request meanwhile.
    if let Some(program) = find_program(&mut tx.connection, program.id).await? {
        return Ok((program, false));
    }
    insert_program(&mut tx.connection, content, &program).await?;
    if let Some(object) = object {
        use_object(&mut tx.connection, content, &object).await?;
    }
    Ok((program, true))
}

/// Why an upload does not continue at `offset`.
async fn not_there(tx: &mut Transaction, id: UploadId, offset: i64) -> Result<StoreError> {
    let row = sqlx::query("SELECT received_bytes FROM uploads WHERE id = ?")
        .bind(id.to_string())
        .fetch_optional(&mut tx.connection)
        .await?;
    Ok(match row {
        Some(row) => StoreError::WrongOffset {
            upload_id: id,
            expected: unsigned(&row, "received_bytes")?,
            given: offset.unsigned_abs(),
        },
        None => missing_upload(id),
    })
}
