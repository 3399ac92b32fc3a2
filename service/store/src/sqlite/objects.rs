//! Objects that SQLite knows of.

use async_trait::async_trait;
use sqlx::{QueryBuilder, Row as _, Sqlite, SqliteConnection};

use super::SqliteStore;
use crate::error::{Result, StoreError};
use crate::objects::{ObjectName, Objects, Piece, Written};
use crate::programs::ProgramId;
use crate::sql::clock::system_us;
use crate::sql::objects::{HAS_OBJECTS, LEFT_AT_MOST, ObjectSteps, PIECE_OF_PROGRAM, PIECES, object_name, piece};
use crate::sql::programs::REMOVED_CHUNKS;

impl SqliteStore {
    /// The object of a content.
    pub(super) async fn object_of(&self, content: i64) -> Result<Option<ObjectName>> {
        let row = sqlx::query("SELECT key, place FROM objects WHERE content_id = ?")
            .bind(content)
            .fetch_optional(&mut self.reader().await?)
            .await?;
        row.as_ref().map(object_name).transpose()
    }

    /// Lets go what an earlier process announced and did not take into use: the file is this one's, so nobody writes it.
    pub(super) async fn let_announced_go(&self) -> Result<()> {
        let announced = "SELECT EXISTS (SELECT 1 FROM objects WHERE content_id IS NULL AND leaving = 0)";
        if !sqlx::query_scalar::<_, bool>(announced).fetch_one(&mut self.reader().await?).await? {
            // Opening writes nothing where there is nothing to write.
            return Ok(());
        }
        self.write(0, |tx| {
            Box::pin(async move {
                sqlx::query("UPDATE objects SET leaving = 1 WHERE content_id IS NULL AND leaving = 0")
                    .execute(&mut tx.connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }
}

/// Takes a written object into use.
pub(super) async fn use_object(connection: &mut SqliteConnection, content: i64, written: &Written) -> Result<()> {
    let used = sqlx::query("UPDATE objects SET content_id = ?, size_bytes = ? WHERE key = ? AND leaving = 0")
        .bind(content)
        .bind(written.bytes)
        .bind(&written.name.key)
        .execute(&mut *connection)
        .await?;
    if used.rows_affected() == 0 {
        return Err(StoreError::unavailable("writing the object took too long"));
    }
    for pieces in written.pieces.chunks(PIECES) {
        let mut sql = QueryBuilder::<Sqlite>::new(
            "INSERT INTO object_chunks (content_id, chunk_index, source_bytes, object_offset, object_bytes, sha256) ",
        );
        sql.push_values(pieces, |mut row, piece| {
            row.push_bind(content)
                .push_bind(piece.index)
                .push_bind(piece.source_bytes)
                .push_bind(piece.object_offset)
                .push_bind(piece.object_bytes)
                .push_bind(piece.sha256.to_vec());
        });
        sql.build().persistent(false).execute(&mut *connection).await?;
    }
    Ok(())
}

#[async_trait]
impl ObjectSteps for SqliteStore {
    fn objects(&self) -> &Objects {
        &self.inner.objects
    }

    fn now_us(&self) -> i64 {
        system_us()
    }

    async fn announce_object(&self, name: &ObjectName) -> Result<()> {
        let name = name.clone();
        self.write(0, move |tx| {
            Box::pin(async move {
                let to_go: i64 = sqlx::query_scalar("SELECT COUNT(*) FROM objects WHERE content_id IS NULL")
                    .fetch_one(&mut tx.connection)
                    .await?;
                if to_go >= LEFT_AT_MOST {
                    return Err(StoreError::unavailable("the object store of large programs removes nothing"));
                }
                let now_us = tx.now_us();
                sqlx::query("INSERT INTO objects (key, place, size_bytes, created_us) VALUES (?, ?, 0, ?)")
                    .bind(name.key)
                    .bind(name.place)
                    .bind(now_us)
                    .execute(&mut tx.connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }

    async fn has_objects_at(&self, place: &str) -> Result<bool> {
        Ok(sqlx::query_scalar(HAS_OBJECTS).bind(place).fetch_one(&mut self.reader().await?).await?)
    }

    async fn packed_chunk(&self, content: i64, index: u64) -> Result<Option<(i64, Vec<u8>)>> {
        let row = sqlx::query("SELECT source_bytes, data FROM program_chunks WHERE content_id = ? AND chunk_index = ?")
            .bind(content)
            .bind(i64::try_from(index).unwrap_or(i64::MAX))
            .fetch_optional(&mut self.reader().await?)
            .await?;
        row.map(|row| Ok((row.try_get("source_bytes")?, row.try_get("data")?))).transpose()
    }

    async fn find_piece(&self, program: ProgramId, index: u64) -> Result<Option<(ObjectName, Piece)>> {
        let row = sqlx::query(PIECE_OF_PROGRAM)
            .bind(program.key())
            .bind(i64::try_from(index).unwrap_or(i64::MAX))
            .fetch_optional(&mut self.reader().await?)
            .await?;
        row.map(|row| Ok((object_name(&row)?, piece(&row)?))).transpose()
    }

    async fn let_object_go(&self, name: &ObjectName) -> Result<bool> {
        let key = name.key.clone();
        self.write(0, move |tx| {
            Box::pin(async move {
                let left = sqlx::query("UPDATE objects SET leaving = 1 WHERE key = ? AND content_id IS NULL")
                    .bind(key)
                    .execute(&mut tx.connection)
                    .await?;
                Ok(left.rows_affected() > 0)
            })
        })
        .await
    }

    async fn forget_object(&self, name: &ObjectName) -> Result<()> {
        let key = name.key.clone();
        self.write(0, move |tx| {
            Box::pin(async move {
                sqlx::query("DELETE FROM objects WHERE key = ? AND leaving = 1")
                    .bind(key)
                    .execute(&mut tx.connection)
                    .await?;
                Ok(())
            })
        })
        .await
    }

    async fn objects_to_go(&self, before_us: i64) -> Result<Vec<ObjectName>> {
        let rows = sqlx::query(
            "SELECT key, place FROM objects WHERE content_id IS NULL AND (leaving = 1 OR created_us < ?)
             ORDER BY created_us LIMIT ?",
        )
        .bind(before_us)
        .bind(LEFT_AT_MOST)
        .fetch_all(&mut self.reader().await?)
        .await?;
        rows.iter().map(object_name).collect()
    }

    async fn contents_in_both(&self) -> Result<Vec<i64>> {
        let contents = sqlx::query_scalar(
            "SELECT content_id FROM objects AS o WHERE content_id IS NOT NULL
             AND EXISTS (SELECT 1 FROM program_chunks AS c WHERE c.content_id = o.content_id)",
        );
        Ok(contents.fetch_all(&mut self.reader().await?).await?)
    }

    async fn shed_chunks(&self, content: i64) -> Result<()> {
        loop {
            let removed = self
                .write(0, move |tx| {
                    Box::pin(async move {
                        let removed = sqlx::query(
                            "DELETE FROM program_chunks WHERE content_id = ?1
                             AND EXISTS (SELECT 1 FROM objects WHERE content_id = ?1) AND chunk_index IN
                                (SELECT chunk_index FROM program_chunks WHERE content_id = ?1 LIMIT ?2)",
                        )
                        .bind(content)
                        .bind(REMOVED_CHUNKS)
                        .execute(&mut tx.connection)
                        .await?;
                        Ok(removed.rows_affected())
                    })
                })
                .await?;
            if removed < REMOVED_CHUNKS as u64 {
                return Ok(());
            }
        }
    }
}
