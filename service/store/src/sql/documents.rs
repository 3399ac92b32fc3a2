//! Machine profiles and tools as rows: two collections of one kind of document.

use super::record::{Record, json, unsigned};
use super::seal::DOCUMENT;
use crate::Json;
use crate::error::{Kind, Result, StoreError, check_size};
use crate::machines::MachineRecord;
use crate::page::Scope;
use crate::settings::StoreSettings;
use crate::tools::ToolRecord;

/// Longest identifier in bytes; it must fit a page token.
pub(crate) const MAX_ID_BYTES: u64 = 256;

/// The `collection` column.
pub(crate) fn collection(kind: Kind) -> &'static str {
    match kind {
        Kind::Tool => "tool",
        _ => "machine",
    }
}

/// A machine profile or a tool.
#[derive(Debug)]
pub(crate) struct Document {
    pub(crate) id: String,
    /// A tool's; machines have none.
    number: Option<u32>,
    body: Json,
    revision: u64,
    created_us: i64,
    updated_us: i64,
}

impl Document {
    /// Bytes of its body.
    pub(crate) fn bytes(&self) -> usize {
        self.body.get().len()
    }

    pub(crate) fn of(row: &impl Record) -> Result<Self> {
        DOCUMENT.verify(row)?;
        Ok(Self {
            id: row.text("id")?.to_owned(),
            number: row.integer_option("number")?.map(number).transpose()?,
            body: json(row, "body")?,
            revision: unsigned(row, "revision")?,
            created_us: row.integer("created_us")?,
            updated_us: row.integer("updated_us")?,
        })
    }

    /// Creation time and revision: a document created anew under an old identifier has another tag.
    pub(crate) fn etag(&self) -> String {
        etag(self.created_us, self.revision)
    }
}

fn etag(created_us: i64, revision: u64) -> String {
    format!("{created_us:x}-{revision}")
}

/// Refuses if a document is not the one the caller read. Its body is not looked at: one that is damaged can be put again and
/// deleted.
pub(crate) fn check_etag(row: &impl Record, kind: Kind, id: &str, etag: Option<&str>) -> Result<()> {
    let current = self::etag(row.integer("created_us")?, unsigned(row, "revision")?);
    match etag {
        Some(etag) if etag != current => Err(StoreError::EtagMismatch { kind, id: id.to_owned(), current }),
        _ => Ok(()),
    }
}

/// The seal of the row of a document.
pub(crate) fn seal(kind: Kind, id: &str, number: Option<u32>, body: &Json) -> Vec<u8> {
    DOCUMENT.seal([collection(kind).into(), id.into(), number.map(i64::from).into(), body.get().into()])
}

impl From<Document> for MachineRecord {
    fn from(document: Document) -> Self {
        let etag = document.etag();
        let Document { id, body, created_us, updated_us, .. } = document;
        Self { id, body, etag, created_us, updated_us }
    }
}

impl TryFrom<Document> for ToolRecord {
    type Error = StoreError;

    fn try_from(document: Document) -> Result<Self> {
        let etag = document.etag();
        let Document { id, number, body, created_us, updated_us, .. } = document;
        let number = number.ok_or_else(|| StoreError::corrupt(format!("tool {id:?} has no number")))?;
        Ok(Self { id, number, body, etag, created_us, updated_us })
    }
}

fn number(number: i64) -> Result<u32> {
    u32::try_from(number).map_err(|_| StoreError::corrupt(format!("column number holds {number}")))
}

/// Refuses a body that is too large.
pub(crate) fn check_body(kind: Kind, body: &Json, settings: &StoreSettings) -> Result<()> {
    let what = if kind == Kind::Tool { "tool size in bytes" } else { "machine profile size in bytes" };
    check_size(what, body.get().len(), settings.max_document_bytes)
}

/// The token scope of a list of documents.
pub(crate) fn scope(kind: Kind, number: Option<u32>) -> Scope {
    let filter = number.map(u32::to_be_bytes).map_or_else(Vec::new, Vec::from);
    Scope::of([collection(kind).as_bytes(), &filter])
}

/// The identifier behind which a page begins; empty for the first page.
pub(crate) fn after(scope: &Scope, token: &str) -> Result<String> {
    match scope.position(token)? {
        Some(position) => String::from_utf8(position).map_err(|_| StoreError::InvalidPageToken),
        None => Ok(String::new()),
    }
}

/// How many machines there are, how often they were changed, and when one was last.
pub(crate) const MACHINES_MARK: &str = "SELECT COUNT(*) AS machines,
        CAST(COALESCE(SUM(revision), 0) AS BIGINT) AS revisions, COALESCE(MAX(updated_us), 0) AS updated_us
    FROM documents WHERE collection = 'machine'";

/// What [`MACHINES_MARK`] found.
pub(crate) fn machines_mark(row: &impl Record) -> Result<[i64; 3]> {
    Ok([row.integer("machines")?, row.integer("revisions")?, row.integer("updated_us")?])
}
