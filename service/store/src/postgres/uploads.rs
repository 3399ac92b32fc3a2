//! Uploads in PostgreSQL.

use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use sqlx::{PgConnection, Row};
use uuid::Uuid;

use super::PostgresStore;
use super::objects::use_object;
use super::programs::{find_program, insert_chunks, insert_content, insert_program};
use crate::error::{Result, StoreError};
use crate::objects::Written;
use crate::programs::{ProgramInfo, UploadId, UploadInfo, UploadStart};
use crate::settings::StoreSettings;
use crate::sql::programs::{Appended, missing_upload, upload_info};
use crate::sql::record::{parsed, unsigned};
use crate::sql::uploads::{NewUpload, Unfinished, UploadSteps};

impl PostgresStore {
    pub(super) async fn all_uploads(&self) -> Result<Vec<UploadInfo>> {
        let rows =
            sqlx::query("SELECT * FROM uploads ORDER BY content_id").fetch_all(&mut self.reader().await?).await?;
        rows.iter().map(upload_info).collect()
    }
}

#[async_trait]
impl UploadSteps for PostgresStore {
    fn limits(&self) -> &StoreSettings {
        self.settings()
    }

    async fn find_upload(&self, id: UploadId) -> Result<(i64, UploadInfo)> {
        let row = sqlx::query("SELECT * FROM uploads WHERE id = $1")
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
            "SELECT data FROM upload_tails WHERE upload_id = $1 AND source_offset < $2 ORDER BY source_offset",
        )
        .bind(id.to_string())
        .bind(before)
        .fetch_all(&mut self.reader().await?)
        .await?;
        Ok(pieces)
    }

    async fn untouched_since(&self, before_us: i64) -> Result<Vec<UploadId>> {
        let rows = sqlx::query("SELECT id FROM uploads WHERE updated_us < $1")
            .bind(before_us)
            .fetch_all(&mut self.reader().await?)
            .await?;
        rows.iter().map(|row| parsed(row, "id")).collect()
    }

    async fn write_beginning(&self, new: NewUpload) -> Result<UploadStart> {
        let now_us = self.clock().now_us();
        self.write(0, move |connection| {
            let new = new.clone();
            Box::pin(async move { begin(connection, new, now_us).await })
        })
        .await
    }

    async fn write_appended(&self, id: UploadId, content: i64, span: [i64; 2], appended: Appended) -> Result<()> {
        let payload = appended.bytes();
        let appended = Arc::new(appended);
        let now_us = self.clock().now_us();
        self.write(payload, move |connection| {
            let appended = appended.clone();
            Box::pin(async move { append(connection, id, content, span, &appended, now_us).await })
        })
        .await
    }

    async fn write_program(
        &self,
        id: UploadId,
        content: i64,
        program: ProgramInfo,
        object: Option<Arc<Written>>,
    ) -> Result<(ProgramInfo, bool)> {
        self.write(0, move |connection| {
            let (program, object) = (program.clone(), object.clone());
            Box::pin(async move { finish(connection, id, content, program, object).await })
        })
        .await
    }

    async fn remove_content(&self, content: i64) -> Result<()> {
        self.remove_chunks(content).await
    }

    async fn discard(&self, id: UploadId) -> Result<()> {
        let content = self
            .write(0, move |connection| {
                Box::pin(async move {
                    sqlx::query_scalar("DELETE FROM uploads WHERE id = $1 RETURNING content_id")
                        .bind(id.to_string())
                        .fetch_optional(&mut *connection)
                        .await?
                        .ok_or_else(|| missing_upload(id))
                })
            })
            .await?;
        self.remove_chunks(content).await
    }
}

async fn begin(connection: &mut PgConnection, new: NewUpload, now_us: i64) -> Result<UploadStart> {
    // One at a time, so that limits hold over all replicas.
    sqlx::query("SELECT 1 FROM counters WHERE name = 'upload' FOR UPDATE").execute(&mut *connection).await?;
    if let Some(program) = find_program(&mut *connection, new.expected).await? {
        return Ok(UploadStart::Complete(program));
    }
    let unfinished = sqlx::query("SELECT * FROM uploads WHERE expected_id = $1 AND size_bytes = $2")
        .bind(new.expected.key())
        .bind(new.size_bytes)
        .fetch_optional(&mut *connection)
        .await?;
    if let Some(row) = unfinished {
        return Ok(UploadStart::Unfinished(upload_info(&row)?));
    }
    // A sum of whole numbers is of another kind there.
    let unfinished = sqlx::query_as(
        "SELECT COUNT(*), COUNT(*) FILTER (WHERE client = $1), COALESCE(SUM(size_bytes), 0)::BIGINT,
             COALESCE(SUM(size_bytes) FILTER (WHERE client = $1), 0)::BIGINT FROM uploads",
    )
    .bind(&new.client)
    .fetch_one(&mut *connection)
    .await?;
    new.check_bounds(Unfinished::of(unfinished))?;
    let content = insert_content(&mut *connection).await?;
    let row = sqlx::query(
        "INSERT INTO uploads (id, content_id, expected_id, size_bytes, received_bytes, created_us, updated_us, client)
         VALUES ($1, $2, $3, $4, 0, $5, $6, $7) RETURNING *",
    )
    .bind(Uuid::now_v7().to_string())
    .bind(content)
    .bind(new.expected.key())
    .bind(new.size_bytes)
    .bind(now_us)
    .bind(now_us)
    .bind(&new.client)
    .fetch_one(&mut *connection)
    .await?;
    Ok(UploadStart::Unfinished(upload_info(&row)?))
}

async fn append(
    connection: &mut PgConnection,
    id: UploadId,
    content: i64,
    [from, to]: [i64; 2],
    appended: &Appended,
    now_us: i64,
) -> Result<()> {
    // Another caller may have appended since the tail was read; then nothing of this fits.
    let updated =
        sqlx::query("UPDATE uploads SET received_bytes = $1, updated_us = $2 WHERE id = $3 AND received_bytes = $4")
            .bind(to)
            .bind(now_us)
            .bind(id.to_string())
            .bind(from)
            .execute(&mut *connection)
            .await?;
    if updated.rows_affected() == 0 {
        return Err(not_there(connection, id, from).await?);
    }
    if !appended.chunks.is_empty() {
        sqlx::query("DELETE FROM upload_tails WHERE upload_id = $1")
            .bind(id.to_string())
            .execute(&mut *connection)
            .await?;
    }
    let tail_offset = to - i64::try_from(appended.tail.len()).unwrap_or(0);
    insert_chunks(&mut *connection, content, &appended.chunks).await?;
    if !appended.tail.is_empty() {
        sqlx::query("INSERT INTO upload_tails (upload_id, source_offset, data) VALUES ($1, $2, $3)")
            .bind(id.to_string())
            .bind(tail_offset)
            .bind(appended.tail.as_slice())
            .execute(&mut *connection)
            .await?;
    }
    Ok(())
}

async fn finish(
    connection: &mut PgConnection,
    id: UploadId,
    content: i64,
    program: ProgramInfo,
    object: Option<Arc<Written>>,
) -> Result<(ProgramInfo, bool)> {
    let deleted =
        sqlx::query("DELETE FROM uploads WHERE id = $1").bind(id.to_string()).execute(&mut *connection).await?;
    if deleted.rows_affected() == 0 {
        return Err(missing_upload(id));
    }
    // The same program may have been uploaded by another request meanwhile.
    if insert_program(connection, content, &program).await? {
        if let Some(object) = object {
            use_object(connection, content, &object).await?;
        }
        return Ok((program, true));
    }
    let there = find_program(&mut *connection, program.id).await?;
    let there = there.ok_or_else(|| StoreError::unavailable("the program was deleted while it was stored"))?;
    Ok((there, false))
}

/// Why an upload does not continue at `offset`.
async fn not_there(connection: &mut PgConnection, id: UploadId, offset: i64) -> Result<StoreError> {
    let row = sqlx::query("SELECT received_bytes FROM uploads WHERE id = $1")
        .bind(id.to_string())
        .fetch_optional(&mut *connection)
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
