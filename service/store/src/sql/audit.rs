//! Entries of the audit log as rows.

use std::borrow::Cow;

use super::record::{Record, unsigned};
use crate::audit::{AuditEntry, AuditRequest, AuditResult, MAX_AUDIT_TEXT_BYTES};
use crate::error::Result;

/// After so many new entries the oldest ones beyond the bound are removed.
pub(crate) const ROUND: i64 = 256;
/// Entries removed at a time: more than are added meanwhile, so that a bound that was lowered is reached.
pub(crate) const REMOVED: i64 = 1_024;

/// The beginning of a text, as much as is kept. An entry is never refused for a character that a database cannot keep.
pub(crate) fn cut(text: &str) -> Cow<'_, str> {
    let kept = |text: &str| text.floor_char_boundary(MAX_AUDIT_TEXT_BYTES);
    if !text.contains('\0') {
        return Cow::Borrowed(&text[..kept(text)]);
    }
    let mut text = text.replace('\0', "\u{fffd}");
    text.truncate(kept(&text));
    Cow::Owned(text)
}

pub(crate) fn entry(row: &impl Record) -> Result<AuditEntry> {
    let text = |column| row.text(column).map(str::to_owned);
    let code = text("result")?;
    let (resource, reason) = (text("resource")?, text("reason")?);
    Ok(AuditEntry {
        sequence: row.integer("sequence")?,
        at_us: row.integer("at_us")?,
        ended_us: row.integer_option("ended_us")?,
        request: AuditRequest {
            principal: text("principal")?,
            tenant: text("tenant")?,
            address: text("address")?,
            certificate: text("certificate")?,
            method: text("method")?,
            request_id: text("request_id")?,
        },
        result: (!code.is_empty()).then_some(AuditResult { resource, code, reason }),
        occurrences: unsigned(row, "occurrences")?,
    })
}

#[cfg(test)]
mod tests {
    use super::{MAX_AUDIT_TEXT_BYTES, cut};

    #[test]
    fn texts_are_cut_between_characters_and_rid_of_the_one_that_cannot_be_kept() {
        assert_eq!(cut("a"), "a");
        assert_eq!(cut("a\0b"), "a\u{fffd}b");
        assert_eq!(cut(&format!("a{}", "ä".repeat(400))).len(), MAX_AUDIT_TEXT_BYTES - 1);
        assert_eq!(cut(&"\0".repeat(400)).len(), MAX_AUDIT_TEXT_BYTES / 3 * 3);
    }
}
