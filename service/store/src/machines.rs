//! Machine profiles.

use async_trait::async_trait;

use crate::Json;
use crate::error::Result;
use crate::page::{Page, PageRequest};

/// A machine profile.
#[derive(Debug, Clone)]
pub struct MachineRecord {
    /// Identifier.
    pub id: String,
    /// The profile.
    pub body: Json,
    /// Strong entity tag: equal exactly while the profile is unchanged, also across deletion and
    /// creation anew. Without quotes.
    pub etag: String,
    /// When it was created, microseconds since the Unix epoch.
    pub created_us: i64,
    /// When it last changed, microseconds since the Unix epoch.
    pub updated_us: i64,
}

/// Keeps machine profiles. Jobs carry the profile they were created with, so profiles may be
/// changed and deleted freely.
#[async_trait]
pub trait Machines {
    /// Creates a profile; without an identifier one is made up.
    ///
    /// # Errors
    /// `AlreadyExists`, `TooLarge`, `Unavailable`.
    async fn create_machine(&self, id: Option<&str>, body: Json) -> Result<MachineRecord>;

    /// A profile.
    ///
    /// # Errors
    /// `NotFound`, `Unavailable`.
    async fn machine(&self, id: &str) -> Result<MachineRecord>;

    /// Profiles by identifier.
    ///
    /// # Errors
    /// `InvalidPageToken`, `Unavailable`.
    async fn list_machines(&self, page: &PageRequest) -> Result<Page<MachineRecord>>;

    /// Replaces a profile, if it still has this etag where one is given.
    ///
    /// # Errors
    /// `NotFound`, `EtagMismatch`, `TooLarge`, `Unavailable`.
    async fn update_machine(&self, id: &str, etag: Option<&str>, body: Json) -> Result<MachineRecord>;

    /// Deletes a profile, if it still has this etag where one is given.
    ///
    /// # Errors
    /// `NotFound`, `EtagMismatch`, `Unavailable`.
    async fn delete_machine(&self, id: &str, etag: Option<&str>) -> Result<()>;
}
