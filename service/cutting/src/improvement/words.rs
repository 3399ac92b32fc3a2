//! Words in the text of a program, found by their places.

use feedwave_program::SourceSpan;
use feedwave_program::lexer::{Lexer, Token, TokenKind};

/// A word that is written as a plain number.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Word {
    pub(super) span: SourceSpan,
    pub(super) text: String,
    pub(super) letter: char,
    pub(super) value: f64,
}

impl Word {
    /// What takes its place, with the letter as the program writes it: machines read both cases.
    pub(super) fn in_its_case(&self, new: String) -> String {
        if self.text.starts_with(|letter: char| letter.is_ascii_lowercase()) { new.to_ascii_lowercase() } else { new }
    }
}

/// Where lines begin, as the interpreter counts them.
#[derive(Debug)]
pub(super) struct Lines {
    starts: Vec<usize>,
}

impl Lines {
    pub(super) fn of(program: &[u8]) -> Self {
        let mark = if program.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        let ends = program
            .iter()
            .enumerate()
            .filter(|(at, byte)| **byte == b'\n' || **byte == b'\r' && program.get(at + 1) != Some(&b'\n'));
        Self { starts: std::iter::once(mark).chain(ends.map(|(at, _)| at + 1)).collect() }
    }

    /// The number of lines.
    pub(super) fn count(&self) -> u32 {
        u32::try_from(self.starts.len()).unwrap_or(u32::MAX)
    }

    /// The byte at which a place begins.
    pub(super) fn offset(&self, span: SourceSpan) -> Option<usize> {
        Some(self.starts.get(span.line.checked_sub(1)? as usize)? + span.column.checked_sub(1)? as usize)
    }

    /// The bytes of a line, without its end.
    fn line<'a>(&self, program: &'a [u8], line: u32) -> Option<&'a [u8]> {
        let index = line.checked_sub(1)? as usize;
        let start = *self.starts.get(index)?;
        let end = self.starts.get(index + 1).copied().unwrap_or(program.len());
        let text = program.get(start..end)?;
        Some(text.strip_suffix(b"\n").unwrap_or(text)).map(|text| text.strip_suffix(b"\r").unwrap_or(text))
    }

    /// The word at a place, where it is a plain number.
    pub(super) fn word(&self, program: &[u8], span: SourceSpan) -> Option<Word> {
        let start = self.offset(span)?;
        let text = program.get(start..start + span.length as usize)?;
        let mut tokens = Lexer::new(text);
        let token = tokens.next().filter(|token| token.kind == TokenKind::Word)?;
        tokens.next().is_none().then(|| word(text, token, span))
    }

    /// The words of a line that are plain numbers.
    pub(super) fn words(&self, program: &[u8], line: u32) -> Vec<Word> {
        let Some(text) = self.line(program, line) else { return Vec::new() };
        let plain = Lexer::new(text).filter(|token| token.kind == TokenKind::Word);
        plain
            .map(|token| {
                let (column, length) = (token.start + 1, token.end - token.start);
                word(
                    &text[token.start as usize..token.end as usize],
                    token,
                    SourceSpan { program: 0, line, column, length },
                )
            })
            .collect()
    }

    /// The only word of a line with this letter, where it is a plain number.
    pub(super) fn only_word(&self, program: &[u8], line: u32, letter: char) -> Option<Word> {
        let mut found = self.words(program, line).into_iter().filter(|word| word.letter == letter);
        let first = found.next()?;
        found.next().is_none().then_some(first)
    }
}

fn word(text: &[u8], token: Token, span: SourceSpan) -> Word {
    Word {
        span,
        text: String::from_utf8_lossy(text).into_owned(),
        letter: char::from(token.letter),
        value: token.number.value(),
    }
}
