//! The plain words at the start of a line: letters with numbers and nothing unusual about them, as most lines are of.

use super::{Block, CodeWord};
use crate::FindingLog;
use crate::dialect::{Code, CodeTable};
use crate::lexer::{Token, TokenKind, behind_blanks, letter_place};
use crate::number::{Number, scan_plain, starts_number};

impl Block {
    /// Reads the plain words at the start of a line: where something else begins, or the end. Most lines have nothing else, and
    /// whatever needs a second look is left to who reads on from there.
    #[inline(never)]
    pub(super) fn parse_words(&mut self, line: &[u8], table: &CodeTable, findings: &mut FindingLog) -> usize {
        let mut start = behind_blanks(line, 0);
        while let Some(&letter) = line.get(start) {
            let Some(place) = letter_place(letter) else { return start };
            let Some((number, end)) = number_behind(line, start) else { return start };
            let next = behind_blanks(line, end);
            if line.get(next).is_some_and(|&byte| starts_number(byte)) {
                return start;
            }
            let extent = (start as u32, end as u32);
            let is_taken = self.take_value(place, number, extent, table)
                || place == usize::from(b'G' - b'A') && self.take_g_code(number, extent, table);
            if !is_taken {
                let letter = b'A' + place as u8;
                if letter == b'O' {
                    return start;
                }
                let token = Token { kind: TokenKind::Word, letter, number, start: extent.0, end: extent.1 };
                self.add_other_word(token, table, findings);
                if self.has_no_more_words() {
                    return line.len();
                }
            }
            start = next;
        }
        start
    }

    /// Takes a G code, unless there is something to say of it.
    #[inline(always)]
    fn take_g_code(&mut self, number: Number, (start, end): (u32, u32), table: &CodeTable) -> bool {
        let Some(place) = table.find(b'G', number.value()) else { return false };
        let &Code { group, meaning, .. } = table.code(place);
        if meaning.concerns_parser() || self.has_group(group) {
            return false;
        }
        self.extent = (self.extent.0.min(start), end);
        self.groups |= 1 << group as u32;
        self.codes[group as usize] = CodeWord { place, start, end };
        true
    }
}

/// The plain number behind a letter, and where it ends.
#[inline(always)]
fn number_behind(line: &[u8], letter: usize) -> Option<(Number, usize)> {
    let mut start = letter + 1;
    loop {
        if let Some(plain) = scan_plain(line, start) {
            return Some(plain);
        }
        let behind = behind_blanks(line, start);
        if behind == start {
            return None;
        }
        start = behind;
    }
}
