//! What stands behind the `%` that begins a file, on its line.

use crate::lexer::{Lexer, Token, TokenKind};

/// Most pieces of a title that read as words of a program, as `REV.A X20` has one.
const OTHERS_IN_TITLE: usize = 2;

/// What stands behind the first `%`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Title {
    /// Nothing, comments, or the number of the program.
    None,
    /// Text that is no block. FANUC controls skip it to the end of the line.
    Skipped,
    /// Text that other controls are not known to skip, the number of a program for another control, or a whole program that has
    /// lost its line ends.
    Unclear,
    /// Words from this column on, counted from 0. Controls that skip a title do not carry them out; others refuse them.
    Words(u32),
}

impl Title {
    /// What stands behind the `%` of this line, which begins with it but for blanks, where the control `skips` titles.
    pub(crate) fn of(line: &[u8], skips: bool) -> Self {
        let is_nothing = |kind| matches!(kind, TokenKind::Percent | TokenKind::Comment | TokenKind::Nul);
        let behind = || Lexer::new(line).skip(1);
        // A number names the program of NUM and other controls, whose language is another one.
        if behind().next().is_some_and(|token| token.kind == TokenKind::StrayNumber) {
            return Self::Unclear;
        }
        if behind().any(|token| is_text(token.kind)) {
            let is_other =
                |token: &Token| !is_text(token.kind) && !matches!(token.kind, TokenKind::Comment | TokenKind::Nul);
            let is_title = behind().filter(is_other).count() <= OTHERS_IN_TITLE;
            return if skips && is_title { Self::Skipped } else { Self::Unclear };
        }
        let names_program = |token: &Token| token.kind == TokenKind::Word && matches!(token.letter, b'O' | b'N');
        let words = behind().find(|token| !is_nothing(token.kind) && !names_program(token));
        words.map_or(Self::None, |first| Self::Words(first.start))
    }
}

const fn is_text(kind: TokenKind) -> bool {
    matches!(
        kind,
        TokenKind::Text
            | TokenKind::StrayNumber
            | TokenKind::LoneLetter
            | TokenKind::MalformedNumber
            | TokenKind::Unexpected
            | TokenKind::NotUtf8
    )
}
