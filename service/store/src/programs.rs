//! Programs: source bytes addressed by their SHA-256, read by chunk, uploaded resumably.

use std::fmt;
use std::str::FromStr;

use async_trait::async_trait;
use bytes::Bytes;
use sha2::{Digest, Sha256};
use uuid::Uuid;

use crate::error::Result;
use crate::page::{Page, PageRequest};
use crate::tenant::{InvalidTenant, Tenant};

/// Bytes of source in every chunk of a program but the last. Each chunk is compressed alone, so any
/// offset can be read without what precedes it.
pub const CHUNK_BYTES: u64 = 1 << 20;

/// Largest program that [`Programs::put_program`] takes; larger ones are uploaded piece by piece, so
/// that no single write holds up the others.
pub const MAX_PUT_BYTES: u64 = 16 << 20;

/// The SHA-256 of a program's source, which is its identifier within its tenant. Shown and parsed as 64 lower-case
/// hexadecimal digits, without the tenant: what is parsed is of the default one.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ProgramId {
    sha256: [u8; 32],
    tenant: Tenant,
}

impl ProgramId {
    /// The identifier of a program with this source.
    pub fn of(source: &[u8]) -> Self {
        Self::from_bytes(Sha256::digest(source).into())
    }

    /// The identifier with this SHA-256.
    pub const fn from_bytes(sha256: [u8; 32]) -> Self {
        Self { sha256, tenant: Tenant::DEFAULT }
    }

    /// The SHA-256.
    pub const fn as_bytes(&self) -> &[u8; 32] {
        &self.sha256
    }

    /// The tenant whose program it is.
    pub const fn tenant(&self) -> Tenant {
        self.tenant
    }

    /// The identifier of the same source as a program of this tenant.
    #[must_use]
    pub const fn of_tenant(self, tenant: Tenant) -> Self {
        Self { tenant, ..self }
    }

    /// What it is called in the database.
    pub(crate) fn key(&self) -> String {
        self.tenant.key(self)
    }
}

impl fmt::Display for ProgramId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.sha256.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for ProgramId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ProgramId({})", self.key())
    }
}

/// The text is not 64 lower-case hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a program id is the SHA-256 of the program as 64 lower-case hexadecimal digits")]
pub struct InvalidProgramId;

impl FromStr for ProgramId {
    type Err = InvalidProgramId;

    fn from_str(text: &str) -> Result<Self, InvalidProgramId> {
        let digit = |byte: u8| match byte {
            b'0'..=b'9' => Ok(byte - b'0'),
            b'a'..=b'f' => Ok(byte - b'a' + 10),
            _ => Err(InvalidProgramId),
        };
        let text: &[u8; 64] = text.as_bytes().try_into().map_err(|_| InvalidProgramId)?;
        let mut sha256 = [0; 32];
        for (byte, pair) in sha256.iter_mut().zip(text.chunks_exact(2)) {
            *byte = digit(pair[0])? << 4 | digit(pair[1])?;
        }
        Ok(Self::from_bytes(sha256))
    }
}

/// A program as it is called in the database, where its tenant counts.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct ProgramKey(pub(crate) ProgramId);

/// The text is no key of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the key of a program is its id, and a space and the name of its tenant where it has one")]
pub(crate) struct InvalidProgramKey;

impl From<InvalidProgramId> for InvalidProgramKey {
    fn from(_: InvalidProgramId) -> Self {
        Self
    }
}

impl From<InvalidTenant> for InvalidProgramKey {
    fn from(_: InvalidTenant) -> Self {
        Self
    }
}

impl FromStr for ProgramKey {
    type Err = InvalidProgramKey;

    fn from_str(text: &str) -> Result<Self, InvalidProgramKey> {
        let (id, tenant) = Tenant::split(text)?;
        Ok(Self(id.parse::<ProgramId>()?.of_tenant(tenant)))
    }
}

/// A stored program without its source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProgramInfo {
    /// Identifier: the SHA-256 of the source.
    pub id: ProgramId,
    /// Bytes of source.
    pub size_bytes: u64,
    /// Chunks of [`CHUNK_BYTES`] bytes of source, the last one shorter; 0 for an empty program.
    pub chunk_count: u64,
    /// When the program became complete, microseconds since the Unix epoch.
    pub created_us: i64,
}

/// A stored program as lists show it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProgramEntry {
    /// Size and age.
    pub info: ProgramInfo,
    /// Place in the order in which programs became complete.
    pub sequence: i64,
    /// Name of the file that it was uploaded as last; may be empty.
    pub file_name: String,
    /// Jobs that use it, as their program or as a further file.
    pub job_count: u64,
}

/// Identifier of an upload.
pub type UploadId = Uuid;

/// An unfinished upload.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UploadInfo {
    /// Its place in the order in which uploads began.
    pub number: i64,
    /// Identifier of the upload.
    pub id: UploadId,
    /// The SHA-256 its bytes must have.
    pub expected: ProgramId,
    /// Who uploads it.
    pub client: String,
    /// Bytes announced.
    pub size_bytes: u64,
    /// Bytes durably received; the next byte is appended at this offset.
    pub received_bytes: u64,
    /// When it began, microseconds since the Unix epoch.
    pub created_us: i64,
    /// When bytes last arrived, microseconds since the Unix epoch.
    pub updated_us: i64,
}

/// What there may be only so much of among unfinished uploads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UploadBound {
    /// Their number.
    Uploads,
    /// The number of one client's.
    ClientUploads,
    /// The bytes announced for them.
    Bytes,
    /// The bytes that one client has announced.
    ClientBytes,
}

impl UploadBound {
    /// What is bounded, in words.
    #[must_use]
    pub const fn what(self) -> &'static str {
        match self {
            Self::Uploads => "unfinished uploads",
            Self::ClientUploads => "unfinished uploads of this client",
            Self::Bytes => "bytes of unfinished uploads",
            Self::ClientBytes => "bytes of unfinished uploads of this client",
        }
    }
}

/// State of an upload when it begins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum UploadStart {
    /// Bytes are still missing or [`Programs::finish_upload`] was not called yet; continue at
    /// [`UploadInfo::received_bytes`].
    Unfinished(UploadInfo),
    /// The program is already stored; nothing needs to be sent.
    Complete(ProgramInfo),
}

/// Keeps programs.
#[async_trait]
pub trait Programs {
    /// Stores a program of a tenant, of at most [`MAX_PUT_BYTES`], that is in memory as a whole. Storing it again
    /// changes nothing.
    ///
    /// # Errors
    /// `TooLarge`, `Unavailable`.
    async fn put_program(&self, tenant: Tenant, source: Bytes) -> Result<ProgramInfo>;

    /// Size and age of a program.
    ///
    /// # Errors
    /// `NotFound`, `Unavailable`.
    async fn program_info(&self, id: ProgramId) -> Result<ProgramInfo>;

    /// A program as lists show it.
    ///
    /// # Errors
    /// `NotFound`, `Unavailable`.
    async fn program_entry(&self, id: ProgramId) -> Result<ProgramEntry>;

    /// One page of programs of one tenant or of all, newest first: those that have this file name, or all where it is empty.
    ///
    /// # Errors
    /// `InvalidPageToken`, `Unavailable`.
    async fn list_programs(
        &self,
        tenant: Option<Tenant>,
        file_name: &str,
        page: &PageRequest,
    ) -> Result<Page<ProgramEntry>>;

    /// Gives a program the name of the file that it was uploaded as.
    ///
    /// # Errors
    /// `NotFound`, `TooLarge`, `Unavailable`.
    async fn name_program(&self, id: ProgramId, file_name: &str) -> Result<()>;

    /// One chunk of a program's source: the bytes from `chunk_index * CHUNK_BYTES`.
    ///
    /// # Errors
    /// `NotFound` if the program or the chunk does not exist, `Corrupt`, `Unavailable`.
    async fn program_chunk(&self, id: ProgramId, chunk_index: u64) -> Result<Bytes>;

    /// Deletes a program that no job references.
    ///
    /// # Errors
    /// `NotFound`, `InUse`, `Unavailable`.
    async fn delete_program(&self, id: ProgramId) -> Result<()>;

    /// Begins the upload of a program of `size_bytes` bytes with the SHA-256 `expected`, or finds
    /// the unfinished upload with the same hash and size. A new one counts as one of `client`.
    ///
    /// # Errors
    /// `TooLarge`, `LimitReached` if there are too many unfinished uploads or bytes of them, of the client or in all, `Unavailable`.
    async fn begin_upload(&self, expected: ProgramId, size_bytes: u64, client: &str) -> Result<UploadStart>;

    /// Appends bytes at `offset`, which must be the number of bytes received so far, and returns
    /// the number of bytes received thereafter. `data` may be of any size; if a large one fails
    /// half-way its beginning may have been received; [`Programs::upload`] then reports how much.
    ///
    /// # Errors
    /// `NotFound`, `WrongOffset`, `TooLarge` if more bytes come than were announced, `Unavailable`.
    async fn append_upload(&self, id: UploadId, offset: u64, data: Bytes) -> Result<u64>;

    /// Verifies the hash of an upload whose bytes have all arrived and makes the program visible.
    ///
    /// # Errors
    /// `NotFound`, `Incomplete`, `HashMismatch` (the upload is then discarded), `Unavailable`.
    async fn finish_upload(&self, id: UploadId) -> Result<ProgramInfo>;

    /// State of an unfinished upload.
    ///
    /// # Errors
    /// `NotFound`, `Unavailable`.
    async fn upload(&self, id: UploadId) -> Result<UploadInfo>;

    /// All unfinished uploads, oldest first. Their number is limited by
    /// [`crate::StoreSettings::max_uploads`].
    ///
    /// # Errors
    /// `Unavailable`.
    async fn uploads(&self) -> Result<Vec<UploadInfo>>;

    /// Discards unfinished uploads to which nothing came for as long as [`crate::StoreSettings::upload_expiry`]; returns how
    /// many.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn expire_uploads(&self) -> Result<u64>;

    /// Discards an unfinished upload with the bytes received.
    ///
    /// # Errors
    /// `NotFound`, `Unavailable`.
    async fn delete_upload(&self, id: UploadId) -> Result<()>;
}
