//! Programs in SQLite.

use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use sqlx::{QueryBuilder, Sqlite, SqliteConnection, SqliteExecutor};

use super::SqliteStore;
use super::objects::use_object;
use crate::error::{Kind, Result, StoreError, check_size};
use crate::objects::Written;
use crate::page::{Page, PageRequest, Scope, tenant_scope};
use crate::programs::{
    CHUNK_BYTES, MAX_PUT_BYTES, ProgramEntry, ProgramId, ProgramInfo, Programs, UploadId, UploadInfo, UploadStart,
};
use crate::sql::compress::offload;
use crate::sql::fault::is_reference;
use crate::sql::objects::{ObjectSteps as _, Packed};
use crate::sql::pages::{page_of, sequence_token};
use crate::sql::programs::{
    Chunk, MAX_FILE_NAME_BYTES, REMOVED_CHUNKS, chunk_seal, chunk_source, program_chunk_source, program_entry,
    program_seal, sealed_program,
};
use crate::sql::uploads::UploadSteps as _;
use crate::tenant::Tenant;

/// Writes chunks of a content.
pub(super) async fn insert_chunks(connection: &mut SqliteConnection, content: i64, chunks: Vec<Chunk>) -> Result<()> {
    if chunks.is_empty() {
        return Ok(());
    }
    let mut sql = QueryBuilder::<Sqlite>::new(
        "INSERT INTO program_chunks (content_id, chunk_index, source_offset, source_bytes, data, seal) ",
    );
    sql.push_values(chunks, |mut row, chunk| {
        let seal = chunk_seal(content, chunk.index, chunk.source_bytes);
        row.push_bind(content)
            .push_bind(chunk.index)
            .push_bind(chunk.index * CHUNK_BYTES as i64)
            .push_bind(chunk.source_bytes)
            .push_bind(chunk.data)
            .push_bind(seal);
    });
    sql.build().persistent(false).execute(connection).await?;
    Ok(())
}

/// Makes a content visible as a program.
pub(super) async fn insert_program(connection: &mut SqliteConnection, content: i64, info: &ProgramInfo) -> Result<()> {
    let (seal, size, chunks) = program_seal(info, content)?;
    sqlx::query(
        "INSERT INTO programs (id, content_id, size_bytes, chunk_count, created_us, tenant, seal, sequence)
         VALUES (?, ?, ?, ?, ?, ?, ?, (SELECT COALESCE(MAX(sequence), 0) + 1 FROM programs))",
    )
    .bind(info.id.key())
    .bind(content)
    .bind(size)
    .bind(chunks)
    .bind(info.created_us)
    .bind(info.id.tenant().name())
    .bind(seal)
    .execute(connection)
    .await?;
    Ok(())
}

/// A new content without chunks.
pub(super) async fn insert_content(connection: &mut SqliteConnection) -> Result<i64> {
    Ok(sqlx::query_scalar("INSERT INTO contents DEFAULT VALUES RETURNING id").fetch_one(connection).await?)
}

pub(super) async fn find_program(connection: impl SqliteExecutor<'_>, id: ProgramId) -> Result<Option<ProgramInfo>> {
    let row =
        sqlx::query("SELECT id, content_id, size_bytes, chunk_count, created_us, seal FROM programs WHERE id = ?")
            .bind(id.key())
            .fetch_optional(connection)
            .await?;
    row.as_ref().map(sealed_program).transpose()
}

/// Number of jobs that use a program.
macro_rules! job_count {
    ($program:literal) => {
        concat!(
            "(SELECT COUNT(*) FROM (SELECT id FROM jobs WHERE program_id = ",
            $program,
            " UNION SELECT job_id FROM job_programs WHERE program_id = ",
            $program,
            "))"
        )
    };
}

macro_rules! entry_query {
    ($rest:literal) => {
        concat!(
            "SELECT p.id, p.sequence, p.size_bytes, p.chunk_count, p.created_us, p.file_name, ",
            job_count!("p.id"),
            " AS job_count FROM programs AS p ",
            $rest
        )
    };
}

impl SqliteStore {
    /// One chunk of a content, of a program or an upload.
    pub(super) async fn chunk_of(&self, content: i64, index: u64) -> Result<Option<Bytes>> {
        let index = i64::try_from(index).unwrap_or(i64::MAX);
        let row =
            sqlx::query("SELECT source_bytes, data, seal FROM program_chunks WHERE content_id = ? AND chunk_index = ?")
                .bind(content)
                .bind(index)
                .fetch_optional(&mut self.reader().await?)
                .await?;
        match row {
            Some(row) => chunk_source(&row, (content, index)).await.map(Some),
            None => Ok(None),
        }
    }

    /// Removes the bytes of a content to which nothing refers any more. Goes on when the caller does
    /// not wait; what is left when the process ends is removed when the store is opened again.
    pub(super) async fn remove_chunks(&self, content: i64) -> Result<()> {
        let store = self.clone();
        let task = tokio::spawn(async move {
            let object = store.object_of(content).await?;
            store.remove_rows(content).await?;
            if let Some(name) = object {
                store.discard_object(&name).await;
            }
            Ok(())
        });
        task.await.map_err(|_| StoreError::unavailable("the service is ending"))?
    }

    /// Removes a content and its chunks. If it is in an object, that is to go.
    async fn remove_rows(&self, content: i64) -> Result<()> {
        while !self.write(0, move |tx| Box::pin(remove_piece(&mut tx.connection, content))).await? {}
        Ok(())
    }

    /// Removes what earlier removals left. An object store that does not answer keeps nobody from beginning: objects go later.
    pub(super) async fn remove_orphans(&self) -> Result<()> {
        let orphans: Vec<i64> = sqlx::query_scalar(
            "SELECT id FROM contents AS c
             WHERE NOT EXISTS (SELECT 1 FROM programs WHERE content_id = c.id)
               AND NOT EXISTS (SELECT 1 FROM uploads WHERE content_id = c.id)",
        )
        .fetch_all(&mut self.reader().await?)
        .await?;
        for content in orphans {
            self.remove_rows(content).await?;
        }
        Ok(())
    }
}

/// Removes some chunks of a content; true once nothing is left of it.
async fn remove_piece(connection: &mut SqliteConnection, content: i64) -> Result<bool> {
    let removed = sqlx::query(
        "DELETE FROM program_chunks WHERE content_id = ?1 AND chunk_index IN
            (SELECT chunk_index FROM program_chunks WHERE content_id = ?1 LIMIT ?2)",
    )
    .bind(content)
    .bind(REMOVED_CHUNKS)
    .execute(&mut *connection)
    .await?
    .rows_affected();
    if removed == REMOVED_CHUNKS as u64 {
        return Ok(false);
    }
    sqlx::query("UPDATE objects SET content_id = NULL, leaving = 1 WHERE content_id = ?")
        .bind(content)
        .execute(&mut *connection)
        .await?;
    sqlx::query("DELETE FROM contents WHERE id = ?").bind(content).execute(connection).await?;
    Ok(true)
}

/// Makes a written object visible as a program, unless the program is there.
async fn put_object(
    connection: &mut SqliteConnection,
    info: ProgramInfo,
    object: Arc<Written>,
) -> Result<(ProgramInfo, bool)> {
    if let Some(there) = find_program(&mut *connection, info.id).await? {
        return Ok((there, false));
    }
    let content = insert_content(&mut *connection).await?;
    insert_program(&mut *connection, content, &info).await?;
    use_object(connection, content, &object).await?;
    Ok((info, true))
}

#[async_trait]
impl Programs for SqliteStore {
    async fn put_program(&self, tenant: Tenant, source: Bytes) -> Result<ProgramInfo> {
        check_size("program size in bytes", source.len(), self.settings().max_program_bytes.min(MAX_PUT_BYTES))?;
        let hashed = source.clone();
        let id = offload(source.len(), move || Ok(ProgramId::of(&hashed).of_tenant(tenant))).await?;
        if let Some(info) = find_program(&mut self.reader().await?, id).await? {
            return Ok(info);
        }
        let size_bytes = source.len() as u64;
        let chunks = offload(source.len(), move || Chunk::all(&source, 0)).await?;
        let chunk_count = chunks.len() as u64;
        if let Some(name) = self.objects().name_for(size_bytes) {
            match self.program_info(id).await {
                Err(StoreError::NotFound { .. }) => {}
                there => return there,
            }
            let object = self.write_object(name, Packed::Chunks(Arc::new(chunks))).await?;
            let info = ProgramInfo { id, size_bytes, chunk_count, created_us: self.now_us() };
            let written = object.clone();
            let put = self.write(0, move |tx| Box::pin(put_object(&mut tx.connection, info, written))).await;
            if !matches!(put, Ok((_, true))) {
                self.discard_object(&object.name).await;
            }
            return Ok(put?.0);
        }
        let payload = chunks.iter().map(|chunk| chunk.data.len()).sum();
        self.write(payload, move |tx| {
            Box::pin(async move {
                if let Some(info) = find_program(&mut tx.connection, id).await? {
                    return Ok(info);
                }
                let info = ProgramInfo { id, size_bytes, chunk_count, created_us: tx.now_us() };
                let content = insert_content(&mut tx.connection).await?;
                insert_chunks(&mut tx.connection, content, chunks).await?;
                insert_program(&mut tx.connection, content, &info).await?;
                Ok(info)
            })
        })
        .await
    }

    async fn program_info(&self, id: ProgramId) -> Result<ProgramInfo> {
        let info = find_program(&mut self.reader().await?, id).await?;
        info.ok_or_else(|| StoreError::not_found(Kind::Program, id))
    }

    async fn program_entry(&self, id: ProgramId) -> Result<ProgramEntry> {
        let row = sqlx::query(entry_query!("WHERE p.id = ?"))
            .bind(id.key())
            .fetch_optional(&mut self.reader().await?)
            .await?;
        program_entry(&row.ok_or_else(|| StoreError::not_found(Kind::Program, id))?)
    }

    async fn list_programs(
        &self,
        tenant: Option<Tenant>,
        file_name: &str,
        page: &PageRequest,
    ) -> Result<Page<ProgramEntry>> {
        let scope = Scope::of([b"programs", file_name.as_bytes(), &tenant_scope(tenant)]);
        let size = page.bounded_size();
        let mut sql = QueryBuilder::<Sqlite>::new(entry_query!("WHERE TRUE"));
        if let Some(tenant) = tenant {
            sql.push(" AND p.tenant = ").push_bind(tenant.name().to_owned());
        }
        if !file_name.is_empty() {
            // An index has only programs with a name.
            sql.push(" AND p.file_name <> '' AND p.file_name = ").push_bind(file_name);
        }
        if let Some(before) = scope.after_sequence(&page.token)? {
            sql.push(" AND p.sequence < ").push_bind(before);
        }
        sql.push(" ORDER BY p.sequence DESC LIMIT ").push_bind(size as i64 + 1);
        let mut reader = self.reader().await?;
        let rows = sql.build().fetch(&mut reader);
        page_of(rows, size, program_entry, |program| program.file_name.len(), sequence_token(&scope)).await
    }

    async fn name_program(&self, id: ProgramId, file_name: &str) -> Result<()> {
        check_size("file name size in bytes", file_name.len(), MAX_FILE_NAME_BYTES)?;
        let file_name = file_name.to_owned();
        self.write(file_name.len(), move |tx| {
            Box::pin(async move {
                let named = sqlx::query("UPDATE programs SET file_name = ? WHERE id = ?")
                    .bind(file_name)
                    .bind(id.key())
                    .execute(&mut tx.connection)
                    .await?;
                if named.rows_affected() == 0 { Err(StoreError::not_found(Kind::Program, id)) } else { Ok(()) }
            })
        })
        .await
    }

    async fn program_chunk(&self, id: ProgramId, chunk_index: u64) -> Result<Bytes> {
        let index = i64::try_from(chunk_index).unwrap_or(i64::MAX);
        let row = sqlx::query(
            "SELECT p.content_id, p.size_bytes, p.chunk_count, p.seal AS program_seal, c.source_bytes, c.data, c.seal
             FROM programs AS p JOIN program_chunks AS c ON c.content_id = p.content_id
             WHERE p.id = ? AND c.chunk_index = ?",
        )
        .bind(id.key())
        .bind(index)
        .fetch_optional(&mut self.reader().await?)
        .await?;
        match row {
            Some(row) => program_chunk_source(&row, id, index).await,
            None => {
                let read = self.read_piece(id, chunk_index).await?;
                read.ok_or_else(|| StoreError::not_found(Kind::Program, format_args!("{id}, chunk {chunk_index}")))
            }
        }
    }

    async fn delete_program(&self, id: ProgramId) -> Result<()> {
        let content = self
            .write(0, move |tx| {
                Box::pin(async move {
                    let deleted = sqlx::query_scalar("DELETE FROM programs WHERE id = ? RETURNING content_id")
                        .bind(id.key())
                        .fetch_optional(&mut tx.connection)
                        .await;
                    match deleted {
                        Ok(Some(content)) => Ok(content),
                        Ok(None) => Err(StoreError::not_found(Kind::Program, id)),
                        Err(error) if is_reference(&error) => {
                            let users: i64 = sqlx::query_scalar(concat!("SELECT ", job_count!("?1")))
                                .bind(id.key())
                                .fetch_one(&mut tx.connection)
                                .await?;
                            Err(StoreError::InUse {
                                kind: Kind::Program,
                                id: id.to_string(),
                                users: users.unsigned_abs(),
                            })
                        }
                        Err(error) => Err(error.into()),
                    }
                })
            })
            .await?;
        self.remove_chunks(content).await
    }

    async fn begin_upload(&self, expected: ProgramId, size_bytes: u64, client: &str) -> Result<UploadStart> {
        self.begin(expected, size_bytes, client).await
    }

    async fn append_upload(&self, id: UploadId, offset: u64, data: Bytes) -> Result<u64> {
        self.append(id, offset, data).await
    }

    async fn finish_upload(&self, id: UploadId) -> Result<ProgramInfo> {
        self.finish(id).await
    }

    async fn upload(&self, id: UploadId) -> Result<UploadInfo> {
        Ok(self.find_upload(id).await?.1)
    }

    async fn uploads(&self) -> Result<Vec<UploadInfo>> {
        self.all_uploads().await
    }

    async fn expire_uploads(&self) -> Result<u64> {
        let expired = self.discard_expired().await?;
        self.tidy_objects().await?;
        Ok(expired)
    }

    async fn delete_upload(&self, id: UploadId) -> Result<()> {
        self.discard(id).await
    }
}
