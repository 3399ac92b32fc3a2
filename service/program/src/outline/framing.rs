//! Whether a file is run or called, by how it begins and ends.

use super::{Outline, Vocabulary};
use crate::SpindleDirection;
use crate::dialect::Meaning;
use crate::lexer::{Lexer, Token, TokenKind};

/// What says whether a file is run or called.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Framing {
    /// It returns to a caller.
    returns: bool,
    /// It ends the program.
    ends: bool,
    /// Something is done outside of the subprograms of the O-word language.
    acts: bool,
    /// Words of a block that prepares cutting: tool, speed, start of the spindle.
    prepares: [bool; 3],
}

impl Framing {
    /// Takes a line in; `is_within` for one of a subprogram of the O-word language, its first and last one included.
    pub(super) fn read(&mut self, text: &[u8], is_within: bool, vocabulary: &Vocabulary) {
        for token in Lexer::new(text).filter(|token| !matches!(token.kind, TokenKind::Comment | TokenKind::Percent)) {
            let is_code = token.kind == TokenKind::Word && matches!(token.letter, b'G' | b'M');
            let meaning = if is_code { vocabulary.meaning(&token) } else { None };
            match meaning {
                Some(Meaning::Return) => self.returns = true,
                Some(Meaning::End) => self.ends |= !is_within,
                _ => self.acts |= !is_within && !is_label(&token),
            }
            let is_start = matches!(meaning, Some(Meaning::Spindle(it)) if it != SpindleDirection::Stopped);
            let is = |letter: u8| token.kind == TokenKind::Word && token.letter == letter;
            for (known, now) in self.prepares.iter_mut().zip([is(b'T'), is(b'S'), is_start]) {
                *known |= now;
            }
        }
    }
}

/// Whether a word only names a place; `o1 call` is none.
fn is_label(token: &Token) -> bool {
    token.kind == TokenKind::Word && matches!(token.letter, b'N' | b'O')
}

impl Outline {
    /// Whether the file is made to be called: it returns (`M99`) and ends no program, or has nothing but subprograms of the O-word
    /// language.
    #[must_use]
    pub fn is_called(&self) -> bool {
        let Framing { returns, ends, acts, .. } = self.framing;
        returns && !ends || !self.subprograms.is_empty() && !acts
    }

    /// Whether it takes a tool, states a speed and starts the spindle itself, as main programs do that begin again with `M99`.
    #[must_use]
    pub fn prepares_cutting(&self) -> bool {
        self.framing.prepares == [true; 3]
    }
}
