//! Programs of a file that are in objects become chunks of the database, so that no two stores refer to one object.

use futures_util::TryStreamExt as _;
use sha2::{Digest as _, Sha256};
use sqlx::{PgConnection, SqliteConnection};

use crate::error::{Result, StoreError};
use crate::maintenance::{CopyError, TableCopy};
use crate::objects::{ObjectName, Objects, Piece};
use crate::programs::CHUNK_BYTES;
use crate::sql::objects::{object_name, piece};
use crate::sql::programs::chunk_seal;
use crate::sql::record::Record as _;

/// Pieces of which no chunk is in the file as well.
const PIECES: &str = "SELECT key, place, content_id, chunk_index, source_bytes, object_offset, object_bytes, sha256
    FROM objects JOIN object_chunks AS p USING (content_id)
    WHERE NOT EXISTS (SELECT 1 FROM program_chunks AS c WHERE c.content_id = p.content_id AND c.chunk_index = p.chunk_index)
    ORDER BY content_id, chunk_index";

/// Copies them, and compares what was written with the hashes of what was read.
pub(super) async fn copy(from: &mut SqliteConnection, to: &mut PgConnection) -> Result<TableCopy, CopyError> {
    let objects = Objects::known();
    let (mut rows, mut hash) = (0, Sha256::new());
    let mut read = sqlx::query(PIECES).fetch(&mut *from);
    while let Some(row) = read.try_next().await.map_err(|error| CopyError::From(error.into()))? {
        let (name, content, piece) = found(&row).map_err(CopyError::From)?;
        let packed = objects.packed(&name, &piece).await.map_err(CopyError::From)?;
        insert(to, content, &piece, &packed).await.map_err(CopyError::To)?;
        hash.update(&packed);
        rows += 1;
    }
    drop(read);
    let mut read = sqlx::query(PIECES).fetch(from);
    while let Some(row) = read.try_next().await.map_err(|error| CopyError::From(error.into()))? {
        let (_, content, piece) = found(&row).map_err(CopyError::From)?;
        if written(to, content, &piece).await.map_err(CopyError::To)? != piece.sha256 {
            return Err(CopyError::To(StoreError::corrupt("what was written of an object is not what was read")));
        }
    }
    Ok(TableCopy { table: "object_chunks", rows, sha256: hash.finalize().into() })
}

fn found(row: &sqlx::sqlite::SqliteRow) -> Result<(ObjectName, i64, Piece)> {
    Ok((object_name(row)?, row.integer("content_id")?, piece(row)?))
}

async fn insert(to: &mut PgConnection, content: i64, piece: &Piece, packed: &[u8]) -> Result<()> {
    sqlx::query(
        "INSERT INTO program_chunks (content_id, chunk_index, source_offset, source_bytes, data, seal)
         VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(content)
    .bind(piece.index)
    .bind(piece.index * CHUNK_BYTES as i64)
    .bind(piece.source_bytes)
    .bind(packed)
    .bind(chunk_seal(content, piece.index, piece.source_bytes))
    .execute(to)
    .await?;
    Ok(())
}

async fn written(to: &mut PgConnection, content: i64, piece: &Piece) -> Result<[u8; 32]> {
    let data: Vec<u8> =
        sqlx::query_scalar("SELECT data FROM program_chunks WHERE content_id = $1 AND chunk_index = $2")
            .bind(content)
            .bind(piece.index)
            .fetch_one(to)
            .await?;
    Ok(Sha256::digest(&data).into())
}
