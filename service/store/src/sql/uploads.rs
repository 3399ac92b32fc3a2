//! How uploads go on, whichever database keeps them. Bytes that do not fill a chunk wait as they came as a tail; once they
//! fill one, or are the last, they are compressed into a chunk. So an acknowledged byte is written at most twice however
//! small the pieces are, and a finished upload becomes a program without copying.

use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use sha2::{Digest, Sha256};

use super::compress::offload;
use super::objects::{ObjectSteps, Packed};
use super::programs::{APPENDED_BYTES, Appended, MAX_CLIENT_BYTES};
use super::record::signed;
use crate::error::{Result, StoreError, check_size};
use crate::objects::Written;
use crate::programs::{CHUNK_BYTES, ProgramId, ProgramInfo, UploadBound, UploadId, UploadInfo, UploadStart};
use crate::settings::StoreSettings;

/// A new upload, as it is asked for.
#[derive(Debug, Clone)]
pub(crate) struct NewUpload {
    /// The SHA-256 its bytes must have.
    pub(crate) expected: ProgramId,
    /// Bytes announced.
    pub(crate) size_bytes: i64,
    /// Who uploads it.
    pub(crate) client: String,
    /// How much there may be.
    pub(crate) limits: [(UploadBound, u64); 4],
}

/// What there is of unfinished uploads already, in all and of one client.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Unfinished {
    pub(crate) uploads: i64,
    pub(crate) client_uploads: i64,
    pub(crate) bytes: i64,
    pub(crate) client_bytes: i64,
}

impl Unfinished {
    /// Numbers of all and of the client, and bytes of all and of the client.
    pub(crate) const fn of((uploads, client_uploads, bytes, client_bytes): (i64, i64, i64, i64)) -> Self {
        Self { uploads, client_uploads, bytes, client_bytes }
    }

    const fn of_bound(&self, bound: UploadBound) -> i64 {
        match bound {
            UploadBound::Uploads => self.uploads,
            UploadBound::ClientUploads => self.client_uploads,
            UploadBound::Bytes => self.bytes,
            UploadBound::ClientBytes => self.client_bytes,
        }
    }
}

impl NewUpload {
    /// Refuses one more upload where there is too much then. All bytes that are announced count, since all may come.
    pub(crate) fn check_bounds(&self, unfinished: Unfinished) -> Result<()> {
        for (bound, limit) in self.limits {
            let more = match bound {
                UploadBound::Uploads | UploadBound::ClientUploads => 1,
                UploadBound::Bytes | UploadBound::ClientBytes => self.size_bytes.unsigned_abs(),
            };
            if unfinished.of_bound(bound).unsigned_abs().saturating_add(more) > limit {
                return Err(StoreError::LimitReached { bound, limit });
            }
        }
        Ok(())
    }
}

/// The steps of an upload that a database does, and what is made of them.
#[async_trait]
pub(crate) trait UploadSteps: ObjectSteps {
    fn limits(&self) -> &StoreSettings;

    /// An upload and its content.
    async fn find_upload(&self, id: UploadId) -> Result<(i64, UploadInfo)>;

    /// One chunk of a content.
    async fn content_chunk(&self, content: i64, index: u64) -> Result<Option<Bytes>>;

    /// The bytes before an offset that are not in a chunk, in pieces as they came.
    async fn tail_pieces(&self, id: UploadId, before: i64) -> Result<Vec<Vec<u8>>>;

    /// Uploads to which nothing came since a time.
    async fn untouched_since(&self, before_us: i64) -> Result<Vec<UploadId>>;

    /// Begins an upload, or finds its program or an unfinished one.
    async fn write_beginning(&self, new: NewUpload) -> Result<UploadStart>;

    /// Writes what is received up to the second number, if the first is how much was.
    async fn write_appended(&self, id: UploadId, content: i64, span: [i64; 2], appended: Appended) -> Result<()>;

    /// Makes an upload a program, which is in an object if one was written; false if there is one already, and content and
    /// object are superfluous.
    async fn write_program(
        &self,
        id: UploadId,
        content: i64,
        program: ProgramInfo,
        object: Option<Arc<Written>>,
    ) -> Result<(ProgramInfo, bool)>;

    /// Removes the bytes of a content to which nothing refers any more.
    async fn remove_content(&self, content: i64) -> Result<()>;

    /// Discards an upload.
    async fn discard(&self, id: UploadId) -> Result<()>;

    async fn begin(&self, expected: ProgramId, size_bytes: u64, client: &str) -> Result<UploadStart> {
        check_size("client size in bytes", client.len(), MAX_CLIENT_BYTES)?;
        let what = "program size in bytes";
        let limit = self.limits().max_program_bytes;
        if size_bytes > limit {
            return Err(StoreError::TooLarge { what, size: size_bytes, limit });
        }
        let settings = self.limits();
        let limits = [
            (UploadBound::Uploads, settings.max_uploads.into()),
            (UploadBound::ClientUploads, settings.max_client_uploads.into()),
            (UploadBound::Bytes, settings.max_uploads_bytes),
            (UploadBound::ClientBytes, settings.max_client_uploads_bytes),
        ];
        let new = NewUpload { expected, size_bytes: signed(what, size_bytes)?, client: client.to_owned(), limits };
        // What nobody goes on with keeps nobody out.
        self.discard_expired().await?;
        self.write_beginning(new).await
    }

    async fn append(&self, id: UploadId, offset: u64, data: Bytes) -> Result<u64> {
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
        let appended = if full || last {
            let mut source = self.tail(id, offset).await?;
            let begin = offset - source.len() as u64;
            offload(source.len() + piece.len(), move || {
                source.extend_from_slice(&piece);
                Appended::of(source, begin, last)
            })
            .await?
        } else {
            Appended { chunks: Vec::new(), tail: piece.to_vec() }
        };
        let what = "upload size in bytes";
        self.write_appended(id, content, [signed(what, offset)?, signed(what, received)?], appended).await?;
        Ok(received)
    }

    /// The bytes before `offset` that are not in a chunk yet.
    async fn tail(&self, id: UploadId, offset: u64) -> Result<Vec<u8>> {
        let pieces = self.tail_pieces(id, signed("upload size in bytes", offset)?).await?;
        let mut tail = Vec::with_capacity(CHUNK_BYTES as usize);
        for piece in pieces {
            tail.extend_from_slice(&piece);
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

    async fn finish(&self, id: UploadId) -> Result<ProgramInfo> {
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
        let program =
            ProgramInfo { id: info.expected, size_bytes: info.size_bytes, chunk_count, created_us: self.now_us() };
        let object = match self.objects().name_for(info.size_bytes) {
            Some(name) => Some(self.write_object(name, Packed::Content(content, chunk_count)).await?),
            None => None,
        };
        let written = self.write_program(id, content, program, object.clone()).await;
        if !matches!(written, Ok((_, true)))
            && let Some(object) = &object
        {
            self.discard_object(&object.name).await;
        }
        let (program, used) = written?;
        match (used, object) {
            (true, Some(_)) => self.shed_chunks(content).await?,
            (true, None) => {}
            (false, _) => self.remove_content(content).await?,
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

    async fn discard_expired(&self) -> Result<u64> {
        let kept_us = i64::try_from(self.limits().upload_expiry.as_micros()).unwrap_or(i64::MAX);
        let before_us = self.now_us().saturating_sub(kept_us);
        let mut discarded = 0;
        for id in self.untouched_since(before_us).await? {
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
}
