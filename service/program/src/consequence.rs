//! Findings that only follow from something that could not be read: a feed that is missing because its word is a variable is
//! no mistake of its own. What explains a finding is a part of the row of its code.

use crate::FindingCode;
use crate::dialect::letter_bit;

/// Letters of what a cut is judged by: feed, speed and sense of the spindle, tool. A cut with one of them unknown is not handed on.
pub(crate) const JUDGED_BY: u32 = letter_bit(b'F') | letter_bit(b'S') | letter_bit(b'M') | letter_bit(b'T');

/// Whether a finding with this code only follows from words that could not be read: those of its own block, or those that were
/// in force in it.
pub(crate) fn follows_from(code: FindingCode, in_block: u32, in_force: u32) -> bool {
    code.entry().explained_by.iter().any(|explanation| {
        let unread = if explanation.in_block { in_block } else { in_force };
        explanation.letters.bytes().any(|letter| letter_bit(letter) & unread != 0)
    })
}
