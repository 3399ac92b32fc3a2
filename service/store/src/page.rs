//! Pages of lists: a bounded number of records and an opaque token for what follows.

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;

use crate::error::{Result, StoreError};
use crate::jobs::Fingerprint;
use crate::tenant::Tenant;

/// Page size where the request leaves it open.
pub const DEFAULT_PAGE_SIZE: u32 = 50;
/// Largest page; larger requests get this size.
pub const MAX_PAGE_SIZE: u32 = 500;
/// Most bytes of documents on a page: its message stays within what a gRPC client takes where it sets nothing, 4 MiB.
pub(crate) const MAX_PAGE_BYTES: usize = 2 << 20;

/// Which page of a list is wanted.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PageRequest {
    /// Most records wanted; 0 means [`DEFAULT_PAGE_SIZE`], more than [`MAX_PAGE_SIZE`] means that. A page of large records has
    /// fewer.
    pub size: u32,
    /// Empty for the first page, else [`Page::next_token`] of the page before, used with the same
    /// filters. The page size may differ from page to page.
    pub token: String,
}

impl PageRequest {
    /// Most records of the page.
    #[must_use]
    pub fn bounded_size(&self) -> usize {
        match self.size {
            0 => DEFAULT_PAGE_SIZE as usize,
            size => size.min(MAX_PAGE_SIZE) as usize,
        }
    }
}

/// One page of a list.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Page<T> {
    /// The records, in the order of the list.
    pub items: Vec<T>,
    /// Token of the following page; `None` on the last page.
    pub next_token: Option<String>,
    /// Identifiers of the records that belong here and cannot be read: they are damaged, and keep nobody from the others.
    pub unreachable: Vec<String>,
}

/// Longest token that is accepted; those the store makes are shorter.
const MAX_TOKEN_BYTES: usize = 1024;
/// Bytes of the scope's digest in a token: enough that no two lists share one by chance.
const SCOPE_BYTES: usize = 16;

/// What a page token belongs to: one list with its filters. A token carries a digest of its scope,
/// so that it is refused elsewhere instead of silently skipping records.
#[derive(Debug)]
pub struct Scope([u8; SCOPE_BYTES]);

impl Scope {
    /// The scope of a list and its filters, told apart by their bytes.
    pub fn of<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let digest = Fingerprint::of(parts);
        let mut scope = [0; SCOPE_BYTES];
        scope.copy_from_slice(&digest.as_bytes()[..SCOPE_BYTES]);
        Self(scope)
    }

    /// The token of the page after `position`, the place of its last record in the order of the list.
    #[must_use]
    pub fn token(&self, position: &[u8]) -> String {
        URL_SAFE_NO_PAD.encode([&self.0, position].concat())
    }

    /// The position in a token of this scope; `None` for the first page.
    ///
    /// # Errors
    /// `InvalidPageToken` where it is none.
    pub fn position(&self, token: &str) -> Result<Option<Vec<u8>>> {
        if token.is_empty() {
            return Ok(None);
        }
        if token.len() > MAX_TOKEN_BYTES {
            return Err(StoreError::InvalidPageToken);
        }
        let mut bytes = URL_SAFE_NO_PAD.decode(token).map_err(|_| StoreError::InvalidPageToken)?;
        if !bytes.starts_with(&self.0) {
            return Err(StoreError::InvalidPageToken);
        }
        bytes.drain(..SCOPE_BYTES);
        Ok(Some(bytes))
    }

    /// The token of the page after the record with this number, in a list by numbers.
    #[must_use]
    pub fn sequence_token(&self, sequence: i64) -> String {
        self.token(&sequence.to_be_bytes())
    }

    /// The number of the record that a page begins after; `None` for the first page.
    ///
    /// # Errors
    /// `InvalidPageToken` where it is none.
    pub fn after_sequence(&self, token: &str) -> Result<Option<i64>> {
        let Some(position) = self.position(token)? else { return Ok(None) };
        let bytes = position.try_into().map_err(|_| StoreError::InvalidPageToken)?;
        Ok(Some(i64::from_be_bytes(bytes)))
    }
}

/// What a list of one tenant's records, or of all, has in its scope.
pub(crate) fn tenant_scope(tenant: Option<Tenant>) -> Vec<u8> {
    // A present and an absent filter differ in length, so no name can pass for "absent".
    tenant.map_or_else(Vec::new, |tenant| format!("={tenant}").into_bytes())
}

impl<T> Page<T> {
    /// The page made of `items`, of which one more than `size` was asked for: that one tells whether
    /// there is a following page.
    pub fn cut(mut items: Vec<T>, size: usize, token: impl FnOnce(&T) -> String) -> Self {
        let more = items.len() > size;
        items.truncate(size);
        let next_token = if more { items.last().map(token) } else { None };
        Self { items, next_token, unreachable: Vec::new() }
    }
}
