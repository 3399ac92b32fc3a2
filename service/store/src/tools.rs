//! The tool library.

use async_trait::async_trait;

use crate::Json;
use crate::error::Result;
use crate::page::{Page, PageRequest};

/// A tool.
#[derive(Debug, Clone)]
pub struct ToolRecord {
    /// Identifier.
    pub id: String,
    /// Number by which programs call it (`T`). Several tools may have the same one, on different
    /// machines.
    pub number: u32,
    /// The tool's data.
    pub body: Json,
    /// Strong entity tag: equal exactly while the tool is unchanged, also across deletion and
    /// creation anew. Without quotes.
    pub etag: String,
    /// When it was created, microseconds since the Unix epoch.
    pub created_us: i64,
    /// When it last changed, microseconds since the Unix epoch.
    pub updated_us: i64,
}

/// Which tools a list shows. The default shows all.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ToolFilter {
    /// Only tools with this number.
    pub number: Option<u32>,
}

/// Keeps tools.
#[async_trait]
pub trait Tools {
    /// Creates a tool; without an identifier one is made up.
    ///
    /// # Errors
    /// `AlreadyExists`, `TooLarge`, `Unavailable`.
    async fn create_tool(&self, id: Option<&str>, number: u32, body: Json) -> Result<ToolRecord>;

    /// A tool.
    ///
    /// # Errors
    /// `NotFound`, `Unavailable`.
    async fn tool(&self, id: &str) -> Result<ToolRecord>;

    /// Tools by identifier.
    ///
    /// # Errors
    /// `InvalidPageToken`, `Unavailable`.
    async fn list_tools(&self, filter: &ToolFilter, page: &PageRequest) -> Result<Page<ToolRecord>>;

    /// Replaces a tool, if it still has this etag where one is given.
    ///
    /// # Errors
    /// `NotFound`, `EtagMismatch`, `TooLarge`, `Unavailable`.
    async fn update_tool(&self, id: &str, etag: Option<&str>, number: u32, body: Json) -> Result<ToolRecord>;

    /// Deletes a tool, if it still has this etag where one is given.
    ///
    /// # Errors
    /// `NotFound`, `EtagMismatch`, `Unavailable`.
    async fn delete_tool(&self, id: &str, etag: Option<&str>) -> Result<()>;
}
