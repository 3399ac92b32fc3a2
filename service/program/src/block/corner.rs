//! Words with a comma: chamfers (`,C`), roundings (`,R`) and the angle of a line (`,A`).

use super::{Block, Word};
use crate::code;
use crate::dialect::{CodeTable, letter_bit};
use crate::lexer::{Token, TokenKind};
use crate::number::Number;
use crate::{Finding, FindingLog};

/// The words with a comma of one block.
#[derive(Clone, Copy, Debug)]
pub(super) struct CommaWords {
    /// Letters present, one bit each.
    letters: u32,
    /// `,C`, `,R` or `,A`, in this order.
    words: [Word; 3],
}

impl Default for CommaWords {
    fn default() -> Self {
        Self { letters: 0, words: [Word { number: Number::ZERO, start: 0, end: 0 }; 3] }
    }
}

impl CommaWords {
    #[inline]
    pub(super) const fn clear(&mut self) {
        self.letters = 0;
    }
}

/// Place of a letter that goes with a comma.
const fn place(letter: u8) -> Option<usize> {
    match letter {
        b'C' => Some(0),
        b'R' => Some(1),
        b'A' => Some(2),
        _ => None,
    }
}

impl Block {
    /// Whether there is any word with a comma.
    #[inline]
    pub(crate) const fn has_comma_words(&self) -> bool {
        self.commas.letters != 0
    }

    /// The word with a comma and this letter.
    pub(crate) fn comma_word(&self, letter: u8) -> Option<&Word> {
        let word = &self.commas.words[place(letter)?];
        (self.commas.letters & letter_bit(letter) != 0).then_some(word)
    }

    #[cold]
    pub(super) fn add_comma_word(&mut self, line: &[u8], token: Token, table: &CodeTable, findings: &mut FindingLog) {
        let place = if table.dialect.takes_comma_words { place(token.letter) } else { None };
        let Some(place) = place else {
            return self.report_defect(line, Token { kind: TokenKind::Unexpected, letter: 0, ..token }, findings);
        };
        let bit = letter_bit(token.letter);
        let both = letter_bit(b'C') | letter_bit(b'R');
        if self.commas.letters & bit != 0 || bit & both != 0 && self.commas.letters & both != 0 {
            return self.defect(code::WORD_DUPLICATE, token, findings, |mut finding: Finding| {
                finding.message = format!("{} is the second word of its kind in the block", char::from(token.letter));
                finding
            });
        }
        self.extent.0 = self.extent.0.min(token.start);
        self.extent.1 = token.end;
        self.commas.letters |= bit;
        self.commas.words[place] = Word { number: token.number, start: token.start, end: token.end };
    }
}
