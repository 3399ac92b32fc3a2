//! Machine profiles.

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
pub trait Machines {
    /// Creates a profile; without an identifier one is made up.
    ///
    /// # Errors
    /// `AlreadyExists`, `TooLarge`, `Unavailable`.
    fn create_machine(&self, id: Option<&str>, body: Json) -> impl Future<Output = Result<MachineRecord>> + Send;

    /// A profile.
    ///
    /// # Errors
    /// `NotFound`, `Unavailable`.
    fn machine(&self, id: &str) -> impl Future<Output = Result<MachineRecord>> + Send;

    /// Profiles by identifier.
    ///
    /// # Errors
    /// `InvalidPageToken`, `Unavailable`.
    fn list_machines(&self, page: &PageRequest) -> impl Future<Output = Result<Page<MachineRecord>>> + Send;

    /// Replaces a profile, if it still has this etag where one is given.
    ///
    /// # Errors
    /// `NotFound`, `EtagMismatch`, `TooLarge`, `Unavailable`.
    fn update_machine(
        &self,
        id: &str,
        etag: Option<&str>,
        body: Json,
    ) -> impl Future<Output = Result<MachineRecord>> + Send;

    /// Deletes a profile, if it still has this etag where one is given.
    ///
    /// # Errors
    /// `NotFound`, `EtagMismatch`, `Unavailable`.
    fn delete_machine(&self, id: &str, etag: Option<&str>) -> impl Future<Output = Result<()>> + Send;
}
