//! Entries of the audit log as rows.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::record::{Record, unsigned};
use crate::audit::{AuditEntry, AuditRequest, AuditResult, MAX_AUDIT_TEXT_BYTES};
use crate::error::Result;

/// After so many new entries the oldest ones beyond the bound are removed.
pub(crate) const ROUND: i64 = 256;
/// Entries removed at a time: more than are added meanwhile, so that a bound that was lowered is reached.
pub(crate) const REMOVED: i64 = 1_024;
/// Tenants looked at for that, those with most entries. They alone have as many to lose.
pub(crate) const TENANTS: i64 = REMOVED;

/// In which order entries are read on.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Order {
    /// As they were made.
    Sequence,
    /// As they were last changed.
    Change,
}

impl Order {
    /// The column of their place.
    pub(crate) const fn column(self) -> &'static str {
        match self {
            Self::Sequence => "sequence",
            Self::Change => "change",
        }
    }
}

/// How many entries each tenant loses so that `excess` go: those that have most are brought down to the same number, so that
/// nobody loses any because of what others write while he has his share. `counts` has the largest first.
pub(crate) fn losses(counts: &[(String, i64)], excess: i64) -> impl Iterator<Item = (&str, i64)> {
    // The largest `sharing` of them lose: not even down to what the next one has.
    let mut sum = 0;
    let mut sharing = 0;
    let mut kept = 0;
    for (index, (_, count)) in counts.iter().enumerate() {
        (sum, sharing) = (sum + count, sharing + 1);
        kept = (sum - excess).max(0);
        let next = counts.get(index + 1).map_or(0, |(_, next)| *next);
        if kept >= next * sharing {
            break;
        }
    }
    let sharing = sharing.max(1);
    // What cannot be divided stays with the first ones.
    let left = (0..sharing).map(move |place| kept / sharing + i64::from(place < kept % sharing));
    counts.iter().zip(left).map(|((tenant, count), left)| (tenant.as_str(), count - left)).filter(|(_, lost)| *lost > 0)
}

/// How many of these are each tenant's.
pub(crate) fn by_tenant(tenants: &[String]) -> BTreeMap<&str, i64> {
    let mut counts = BTreeMap::new();
    for tenant in tenants {
        *counts.entry(tenant.as_str()).or_default() += 1;
    }
    counts
}

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
        change: row.integer("change")?,
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
    use proptest::collection::vec;
    use proptest::{prop_assert, prop_assert_eq, proptest};

    use super::{MAX_AUDIT_TEXT_BYTES, cut, losses};

    #[test]
    fn who_has_most_loses_down_to_what_the_next_ones_have() {
        let counts = |counts: &[i64]| -> Vec<(String, i64)> {
            counts.iter().enumerate().map(|(index, count)| (index.to_string(), *count)).collect()
        };
        let lost = |of: &[i64], excess| losses(&counts(of), excess).map(|(_, lost)| lost).collect::<Vec<_>>();
        assert_eq!(lost(&[100, 10, 3], 50), [50]);
        assert_eq!(lost(&[100, 10, 3], 90), [90]);
        assert_eq!(lost(&[100, 10, 3], 93), [91, 2]);
        assert_eq!(lost(&[10, 10, 10], 4), [1, 1, 2]);
        assert_eq!(lost(&[10, 10, 3], 23), [10, 10, 3]);
        assert_eq!(lost(&[], 5), [0; 0]);
    }

    proptest! {
        #[test]
        fn as_many_go_as_have_to_and_nobody_with_less_than_his_share_loses(
            mut counts in vec(1_i64..2_000, 1..40),
            share in 0.0..1.0,
        ) {
            counts.sort_unstable_by(|a, b| b.cmp(a));
            let all: i64 = counts.iter().sum();
            let excess = (all as f64 * share) as i64;
            let named: Vec<_> = counts.iter().enumerate().map(|(index, count)| (index.to_string(), *count)).collect();
            let mut lost = vec![0; counts.len()];
            for (tenant, gone) in losses(&named, excess) {
                lost[tenant.parse::<usize>().unwrap()] = gone;
            }
            prop_assert_eq!(lost.iter().sum::<i64>(), excess);
            let fair = (all - excess) / counts.len() as i64;
            for (count, lost) in counts.iter().zip(&lost) {
                prop_assert!((0..=*count).contains(lost));
                prop_assert!(*lost == 0 || count - lost >= fair, "{} of {} with a share of {}", lost, count, fair);
            }
        }
    }

    #[test]
    fn texts_are_cut_between_characters_and_rid_of_the_one_that_cannot_be_kept() {
        assert_eq!(cut("a"), "a");
        assert_eq!(cut("a\0b"), "a\u{fffd}b");
        assert_eq!(cut(&format!("a{}", "ä".repeat(400))).len(), MAX_AUDIT_TEXT_BYTES - 1);
        assert_eq!(cut(&"\0".repeat(400)).len(), MAX_AUDIT_TEXT_BYTES / 3 * 3);
    }
}
