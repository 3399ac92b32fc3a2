//! How programs become objects and objects go, whichever database knows of them.
//!
//! A row says that there may be an object before there is one, and goes after it. So whatever is interrupted, no object is
//! there that nobody knows of, and nothing has to be looked for in an object store.

use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use bytes::Bytes;

use super::programs::Chunk;
use super::record::Record;
use crate::error::{Result, StoreError};
use crate::objects::{MISSING, ObjectName, Objects, Piece, Writer, Written};
use crate::programs::ProgramId;

/// What is not in use for so long is not being written any more.
const WRITTEN_WITHIN: Duration = Duration::from_secs(86_400);
/// Objects that are removed in one go, and most that may wait for it before no new ones are written.
pub(crate) const LEFT_AT_MOST: i64 = 1_000;
/// Rows of one statement.
pub(crate) const PIECES: usize = 500;

/// Chunks as they are compressed.
pub(crate) enum Packed {
    /// So many of a content in the database.
    Content(i64, u64),
    /// All of a program.
    Chunks(Arc<Vec<Chunk>>),
}

/// The name of a row's object.
pub(crate) fn object_name(row: &impl Record) -> Result<ObjectName> {
    Ok(ObjectName { key: row.text("key")?.to_owned(), place: row.text("place")?.to_owned() })
}

/// A piece of an object.
pub(crate) fn piece(row: &impl Record) -> Result<Piece> {
    let sha256 = row.bytes("sha256")?.try_into();
    Ok(Piece {
        index: row.integer("chunk_index")?,
        source_bytes: row.integer("source_bytes")?,
        object_offset: row.integer("object_offset")?,
        object_bytes: row.integer("object_bytes")?,
        sha256: sha256.map_err(|_| StoreError::corrupt("the hash of a piece of an object has another length"))?,
    })
}

/// The piece that holds a chunk of a content, `$1` and `$2`, with the name of its object.
pub(crate) const PIECE: &str = "SELECT key, place, chunk_index, source_bytes, object_offset, object_bytes, sha256
    FROM objects JOIN object_chunks USING (content_id) WHERE content_id = $1 AND chunk_index = $2";

/// The same for a chunk of a program, `$1` and `$2`.
pub(crate) const PIECE_OF_PROGRAM: &str =
    "SELECT key, place, chunk_index, source_bytes, object_offset, object_bytes, sha256
    FROM programs JOIN objects USING (content_id) JOIN object_chunks USING (content_id) WHERE id = $1 AND chunk_index = $2";

/// Whether a program is in an object at a place, `$1`.
pub(crate) const HAS_OBJECTS: &str =
    "SELECT EXISTS (SELECT 1 FROM objects WHERE place = $1 AND content_id IS NOT NULL)";

/// The steps that a database does, and what is made of them.
#[async_trait]
pub(crate) trait ObjectSteps: Clone + Send + Sync + 'static {
    fn objects(&self) -> &Objects;

    /// The time now, microseconds since the Unix epoch.
    fn now_us(&self) -> i64;

    /// Says that there may be an object of this name from now on, unless too many others are to go.
    async fn announce_object(&self, name: &ObjectName) -> Result<()>;

    /// Whether a program is in an object at a place.
    async fn has_objects_at(&self, place: &str) -> Result<bool>;

    /// One chunk of a content as it is compressed, with its bytes of source.
    async fn packed_chunk(&self, content: i64, index: u64) -> Result<Option<(i64, Vec<u8>)>>;

    /// Where a chunk of a program is, if it is in an object.
    async fn find_piece(&self, program: ProgramId, index: u64) -> Result<Option<(ObjectName, Piece)>>;

    /// Keeps an object that nothing refers to from being taken into use; false if something does.
    async fn let_object_go(&self, name: &ObjectName) -> Result<bool>;

    /// Forgets an object that is gone.
    async fn forget_object(&self, name: &ObjectName) -> Result<()>;

    /// Objects that are to go: those that were let go, and those announced before a time that nothing refers to.
    async fn objects_to_go(&self, before_us: i64) -> Result<Vec<ObjectName>>;

    /// Contents that are in an object and still in chunks.
    async fn contents_in_both(&self) -> Result<Vec<i64>>;

    /// Removes the chunks of a content that is in an object.
    async fn shed_chunks(&self, content: i64) -> Result<()>;

    /// Writes an object; until a program refers to it, it is to go after a day. Goes on when the caller does not wait.
    async fn write_object(&self, name: ObjectName, from: Packed) -> Result<Arc<Written>> {
        let store = self.clone();
        let task = tokio::spawn(async move {
            store.announce_object(&name).await?;
            match write(&store, name.clone(), from).await {
                Ok(written) => Ok(Arc::new(written)),
                Err(error) => {
                    store.objects().has_failed();
                    store.discard_object(&name).await;
                    Err(error)
                }
            }
        });
        task.await.map_err(|_| StoreError::unavailable("the service is ending"))?
    }

    /// Removes an object unless something refers to it.
    async fn remove_object(&self, name: &ObjectName) -> Result<()> {
        if self.let_object_go(name).await? {
            self.objects().remove(name).await?;
            self.forget_object(name).await?;
        }
        Ok(())
    }

    /// As [`ObjectSteps::remove_object`]; what cannot be removed now is later.
    async fn discard_object(&self, name: &ObjectName) {
        if self.objects().removes_nothing() {
            // What is deleted a thousand times must not wait a thousand times for it.
            if let Err(error) = self.let_object_go(name).await {
                tracing::warn!(%error, object = name.key, "an object that nobody needs is removed later");
            }
            return;
        }
        if let Err(error) = self.remove_object(name).await {
            let cause = std::error::Error::source(&error).map(ToString::to_string);
            tracing::warn!(%error, cause, object = name.key, "an object that nobody needs is removed later");
        }
    }

    /// Removes what interrupted work left: objects that nothing refers to, and chunks of contents that are in objects.
    async fn tidy_objects(&self) -> Result<()> {
        for content in self.contents_in_both().await? {
            self.shed_chunks(content).await?;
        }
        let age_us = i64::try_from(WRITTEN_WITHIN.as_micros()).unwrap_or(i64::MAX);
        for name in self.objects_to_go(self.now_us().saturating_sub(age_us)).await? {
            if let Err(error) = self.remove_object(&name).await {
                // That it does not answer holds nothing else up.
                let cause = std::error::Error::source(&error).map(ToString::to_string);
                tracing::warn!(%error, cause, "objects that nobody needs are removed later");
                return Ok(());
            }
        }
        Ok(())
    }

    /// The source of a chunk of a program that is in an object.
    async fn read_piece(&self, program: ProgramId, index: u64) -> Result<Option<Bytes>> {
        let Some((name, piece)) = self.find_piece(program, index).await? else { return Ok(None) };
        match self.objects().read(&name, &piece).await {
            Ok(source) => Ok(Some(source)),
            // The program may have been deleted meanwhile.
            Err(_) if self.find_piece(program, index).await?.is_none() => Ok(None),
            Err(error) => Err(error),
        }
    }
}

async fn write(store: &impl ObjectSteps, name: ObjectName, from: Packed) -> Result<Written> {
    if !store.objects().is_marked(&name.place).await? {
        if store.has_objects_at(&name.place).await? {
            return Err(StoreError::unavailable(MISSING));
        }
        store.objects().mark(&name.place).await?;
    }
    let mut writer = store.objects().writer(name).await?;
    match fill(store, &mut writer, from).await {
        Ok(()) => writer.finish().await,
        Err(error) => {
            writer.abort().await;
            Err(error)
        }
    }
}

async fn fill(store: &impl ObjectSteps, writer: &mut Writer<'_>, from: Packed) -> Result<()> {
    match from {
        Packed::Content(content, count) => {
            for index in 0..count {
                let chunk = store.packed_chunk(content, index).await?;
                let (source_bytes, data) =
                    chunk.ok_or_else(|| StoreError::unavailable("the upload was finished or discarded meanwhile"))?;
                writer.push(source_bytes, data).await?;
            }
        }
        Packed::Chunks(chunks) => {
            for chunk in chunks.iter() {
                writer.push(chunk.source_bytes, chunk.data.clone()).await?;
            }
        }
    }
    Ok(())
}
