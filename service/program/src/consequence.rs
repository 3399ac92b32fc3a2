//! Findings that only follow from something that could not be read: a feed that is missing because its word is a variable is
//! no mistake of its own.

use crate::FindingCode;
use crate::code;
use crate::dialect::letter_bit;

/// The letters of a mask.
const fn letters(text: &[u8]) -> u32 {
    let mut mask = 0;
    let mut at = 0;
    while at < text.len() {
        mask |= letter_bit(text[at]);
        at += 1;
    }
    mask
}

/// Letters of the axes, of the centre of an arc and of its radius.
const PLACE: u32 = letters(b"XYZUVWABCHIJKR");

/// Letters of what a cut is judged by: feed, speed and sense of the spindle, tool. A cut with one of them unknown is not handed on.
pub(crate) const JUDGED_BY: u32 = letters(b"FSMT");

/// Findings about what is missing or does not fit, and the letters that would explain each: words of any block before that
/// are still in force, or of its own block only.
const EXPLAINED_BY: &[(FindingCode, Scope, u32)] = &[
    (code::FEED_MISSING, Scope::Modal, letters(b"FG")),
    (code::SPINDLE_STOPPED, Scope::Modal, letters(b"SMG")),
    (code::SPEED_MISSING, Scope::Modal, letters(b"S")),
    (code::SPEED_CLAMP_MISSING, Scope::Modal, letters(b"SG")),
    (code::TOOL_MISSING, Scope::Modal, letters(b"T")),
    (code::MOTION_MISSING, Scope::Modal, letters(b"G")),
    (code::NURBS_NOT_OPEN, Scope::Modal, letters(b"G")),
    (code::TOOL_CONTROL_OFF, Scope::Modal, letters(b"G")),
    (code::PLANE_OFF, Scope::Modal, letters(b"G")),
    (code::THREAD_LEAD_MISSING, Scope::Modal, letters(b"FEG")),
    (code::CYCLE_WORD, Scope::Modal, letters(b"XYZUVWRQPG")),
    (code::CYCLE_LEVEL, Scope::Modal, PLACE | letters(b"G")),
    (code::CYCLE_SPINDLE, Scope::Modal, letters(b"SMG")),
    (code::THREAD_TRAVEL, Scope::Modal, PLACE),
    (code::THREAD_CYCLE_START, Scope::Modal, PLACE),
    (code::ARC_RADIUS_MISMATCH, Scope::Modal, PLACE),
    (code::ARC_RADIUS_ZERO, Scope::Modal, PLACE),
    (code::ARC_RADIUS_TOO_SMALL, Scope::Modal, PLACE),
    (code::ARC_FULL_BY_RADIUS, Scope::Modal, PLACE),
    (code::DWELL_TIME, Scope::Block, letters(b"PXU")),
    (code::FUNCTION_WORD_MISSING, Scope::Block, u32::MAX),
    (code::FUNCTION_SWITCH, Scope::Block, letters(b"P")),
    (code::REFERENCE_AXIS, Scope::Block, PLACE),
    (code::MACHINE_MOTION, Scope::Block, PLACE),
    (code::LENGTH_NUMBER, Scope::Block, letters(b"H")),
    (code::TOOL_CONTROL_LENGTH, Scope::Block, letters(b"H")),
];

/// Place of the word that a finding follows from.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Scope {
    Block,
    Modal,
}

/// Whether a finding with this code only follows from words that could not be read: those of its own block, or those that were
/// in force in it.
pub(crate) fn follows_from(code: FindingCode, in_block: u32, in_force: u32) -> bool {
    EXPLAINED_BY.iter().any(|&(explained, scope, by)| {
        let unread = if scope == Scope::Block { in_block } else { in_force };
        explained == code && by & unread != 0
    })
}
