//! Lexer: the bytes of one line in, words, comments and defects out, without copying.
//!
//! Every byte of the line is either blank or part of exactly one token, so nothing is ever ignored in silence,
//! and each call moves forward, so a line takes linear time whatever it holds.

#[cfg(test)]
mod tests;

use crate::expression::{operation_end, starts_value, value_end};
use crate::number::{Number, NumberDefect, Scan, scan_number, starts_number};

/// A piece of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Token {
    /// What it is.
    pub kind: TokenKind,
    /// Upper-case address letter, where the kind has one; `:` is read as `O`. 0 otherwise.
    pub letter: u8,
    /// The number of a [`TokenKind::Word`], 0 otherwise.
    pub number: Number,
    /// Offset of its first byte in the line.
    pub start: u32,
    /// Offset behind its last byte.
    pub end: u32,
}

/// What a [`Token`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TokenKind {
    /// An address letter with its number.
    Word,
    /// `( )` or `;` to the end of the line.
    Comment,
    /// `(` without `)`, to the end of the line.
    UnclosedComment,
    /// `%`
    Percent,
    /// `/`, or `/1` to `/9`.
    BlockDelete,
    /// An address letter without a number.
    LoneLetter,
    /// An address letter whose number has two signs, two points, or no digit.
    MalformedNumber,
    /// An address letter whose number is larger than any double.
    HugeNumber,
    /// A number without an address letter.
    StrayNumber,
    /// Several letters in a row without numbers.
    Text,
    /// An address letter whose value is an expression: `X#1`, `X-[#1+2]`, `XSIN[30]`.
    Computed,
    /// `#1=…`, `#<name>=…`
    Assignment,
    /// `DPRNT`, `BPRNT`, `POPEN` or `PCLOS`, to the end of the line.
    Output,
    /// A control statement, or brackets without an address letter, to the end of the line.
    Expression,
    /// A control statement of Macro B, to the end of the line.
    Statement,
    /// A comma with a word behind it: `,R5`, `,C2`.
    Corner,
    /// The same with an expression: `,R#1`, `,C[#1/2]`.
    ComputedCorner,
    /// `@` or `^` with a value: polar coordinates of LinuxCNC.
    Polar,
    /// A run of NUL bytes.
    Nul,
    /// A run of bytes above ASCII that is not UTF-8.
    NotUtf8,
    /// A run of other characters without a meaning.
    Unexpected,
    /// What was taken out of a line to read the rest of it: a run of `REMOVED`.
    Removed,
}

/// What stands in the place of what was taken out of a line. It ends words and numbers, and no line of a program holds it.
pub(crate) const REMOVED: u8 = b'\n';

/// Words that begin a statement of Macro B.
const MACRO_WORDS: [&[u8]; 8] = [b"GOTO", b"IF", b"THEN", b"ELSE", b"WHILE", b"WH", b"DO", b"END"];

/// Words of the macro language that write to files and printers.
const OUTPUT_WORDS: [&[u8]; 4] = [b"DPRNT", b"BPRNT", b"POPEN", b"PCLOS"];

/// What a byte can begin.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Class {
    Blank,
    Letter,
    Number,
    OpenComment,
    Semicolon,
    Percent,
    Slash,
    Macro,
    Nul,
    HighByte,
    Removed,
    Other,
}

static CLASSES: [Class; 256] = {
    let mut classes = [Class::Other; 256];
    let mut byte = 0;
    while byte < 256 {
        classes[byte] = match byte as u8 {
            b' ' | b'\t' => Class::Blank,
            b'A'..=b'Z' | b'a'..=b'z' | b':' => Class::Letter,
            b'(' => Class::OpenComment,
            b';' => Class::Semicolon,
            b'%' => Class::Percent,
            b'/' => Class::Slash,
            b'#' | b'[' | b']' | b'=' | b'*' => Class::Macro,
            0 => Class::Nul,
            0x80..=0xff => Class::HighByte,
            REMOVED => Class::Removed,
            other if starts_number(other) => Class::Number,
            _ => Class::Other,
        };
        byte += 1;
    }
    classes
};

/// Splits one line, without its terminator, into [`Token`]s.
#[derive(Clone, Debug)]
pub struct Lexer<'a> {
    line: &'a [u8],
    at: usize,
}

impl<'a> Lexer<'a> {
    /// A lexer at the start of `line`, which is no longer than 4 GiB and holds no line feed.
    #[must_use]
    pub const fn new(line: &'a [u8]) -> Self {
        Self::from(line, 0)
    }

    /// A lexer at a place in a line where a token begins.
    pub(crate) const fn from(line: &'a [u8], at: usize) -> Self {
        Self { line, at }
    }

    #[inline]
    fn class_at(&self, at: usize) -> Option<Class> {
        self.line.get(at).map(|&byte| CLASSES[usize::from(byte)])
    }

    /// First offset from `at` on whose byte is not of this class.
    fn skip_class(&self, mut at: usize, class: Class) -> usize {
        while self.class_at(at) == Some(class) {
            at += 1;
        }
        at
    }

    /// First offset from `at` on whose byte is not blank, and the class of that byte.
    #[inline]
    fn behind_blanks(&self, mut at: usize) -> (usize, Option<Class>) {
        loop {
            match self.class_at(at) {
                Some(Class::Blank) => at += 1,
                class => return (at, class),
            }
        }
    }

    /// A letter without a number, and what follows it.
    #[cold]
    fn lone_letter(&self, start: usize, next: usize) -> (TokenKind, usize) {
        match self.class_at(next) {
            Some(Class::Macro) if starts_value(self.line, next) => (TokenKind::Computed, value_end(self.line, next)),
            Some(Class::Macro) => (TokenKind::Expression, self.line.len()),
            Some(Class::Letter) => self.letters(start),
            _ => (TokenKind::LoneLetter, start + 1),
        }
    }

    /// A letter followed by a letter: a macro word, text, or one letter whose number is missing.
    fn letters(&self, start: usize) -> (TokenKind, usize) {
        let run = self.skip_class(start, Class::Letter);
        let is_among = |words: &[&[u8]]| words.iter().any(|word| self.line[start..run].eq_ignore_ascii_case(word));
        let is_macro = is_among(&MACRO_WORDS);
        let next = self.skip_class(run, Class::Blank);
        let value = self.skip_class(start + 1, Class::Blank);
        let numbered = self.class_at(next) == Some(Class::Number);
        match run - start {
            _ if is_macro => (TokenKind::Statement, self.line.len()),
            _ if is_among(&OUTPUT_WORDS) => (TokenKind::Output, self.line.len()),
            // `XSIN[30]`
            _ if starts_value(self.line, value) => (TokenKind::Computed, value_end(self.line, value)),
            // `X Y10`: the second letter is a word of its own.
            1 => (TokenKind::LoneLetter, run),
            2 if numbered => (TokenKind::LoneLetter, start + 1),
            _ if numbered => (TokenKind::Text, scan_number(self.line, next).end),
            _ => (TokenKind::Text, run),
        }
    }

    fn high_bytes(&self, start: usize) -> (TokenKind, usize) {
        let end = self.skip_class(start, Class::HighByte);
        let is_text = core::str::from_utf8(&self.line[start..end]).is_ok();
        (if is_text { TokenKind::Unexpected } else { TokenKind::NotUtf8 }, end)
    }

    /// The letter and the number of a word behind a comma.
    fn corner(&self, start: usize) -> Option<(u8, Scan)> {
        let letter = start + 1;
        if self.line[start] != b',' || self.class_at(letter) != Some(Class::Letter) {
            return None;
        }
        let number = self.skip_class(letter + 1, Class::Blank);
        let scan = (self.class_at(number) == Some(Class::Number)).then(|| scan_number(self.line, number))?;
        Some((upper(self.line[letter]), scan))
    }

    /// The letter of a word behind a comma whose value is an expression, and where that ends.
    fn computed_corner(&self, start: usize) -> Option<(u8, usize)> {
        let letter = start + 1;
        if self.line[start] != b',' || self.class_at(letter) != Some(Class::Letter) {
            return None;
        }
        let value = self.skip_class(letter + 1, Class::Blank);
        starts_value(self.line, value).then(|| (upper(self.line[letter]), value_end(self.line, value)))
    }

    /// Behind `@` or `^` and its value.
    #[cold]
    fn polar(&self, start: usize) -> usize {
        let at = self.skip_class(start + 1, Class::Blank);
        if starts_value(self.line, at) {
            return value_end(self.line, at);
        }
        if self.class_at(at) == Some(Class::Number) { scan_number(self.line, at).end } else { start + 1 }
    }

    /// A parameter at the start of a token, and the value that it is assigned.
    #[cold]
    fn assignment(&self, start: usize) -> usize {
        let sign = self.skip_class(value_end(self.line, start), Class::Blank);
        let end = match self.line.get(sign) {
            Some(b'=') => operation_end(self.line, sign + 1),
            _ => value_end(self.line, start),
        };
        end.max(start + 1)
    }

    fn block_delete(&self, start: usize) -> usize {
        let at = self.skip_class(start + 1, Class::Blank);
        match self.line.get(at) {
            Some(b'1'..=b'9') => at + 1,
            _ => start + 1,
        }
    }
}

impl Lexer<'_> {
    /// Whether nothing is left. Blanks may be, before [`Lexer::next_word`] was asked.
    #[inline]
    pub(crate) const fn is_at_end(&self) -> bool {
        self.at >= self.line.len()
    }

    /// The next token where it is a plain word, as most are: the same as [`Iterator::next`], which goes on behind the blanks
    /// otherwise.
    #[inline(always)]
    pub(crate) fn next_word(&mut self) -> Option<Token> {
        let (start, class) = self.behind_blanks(self.at);
        if class != Some(Class::Letter) {
            self.at = start;
            return None;
        }
        let (next, class) = self.behind_blanks(start + 1);
        if class != Some(Class::Number) {
            return None;
        }
        let Scan { end, number, defect: None } = scan_number(self.line, next) else { return None };
        self.at = end;
        let letter = upper(self.line[start]);
        Some(Token { kind: TokenKind::Word, letter, number, start: start as u32, end: end as u32 })
    }
}

impl Iterator for Lexer<'_> {
    type Item = Token;

    #[inline]
    fn next(&mut self) -> Option<Token> {
        let (start, class) = self.behind_blanks(self.at);
        let Some(class) = class else {
            self.at = start;
            return None;
        };
        let mut letter = 0;
        if class == Class::Letter {
            letter = upper(self.line[start]);
            let (next, class) = self.behind_blanks(start + 1);
            if class == Some(Class::Number) {
                let Scan { mut end, number, defect } = scan_number(self.line, next);
                let kind = match defect {
                    None => TokenKind::Word,
                    // `X-#1`: the sign is that of an expression.
                    Some(NumberDefect::Malformed) if starts_value(self.line, next) => {
                        end = value_end(self.line, next);
                        TokenKind::Computed
                    }
                    Some(NumberDefect::Malformed) => TokenKind::MalformedNumber,
                    Some(NumberDefect::TooLarge) => TokenKind::HugeNumber,
                };
                self.at = end;
                return Some(Token { kind, letter, number, start: start as u32, end: end as u32 });
            }
        }
        let (kind, end) = match class {
            Class::Letter => self.lone_letter(start, self.skip_class(start + 1, Class::Blank)),
            Class::OpenComment => match self.line[start..].iter().position(|&byte| byte == b')') {
                Some(length) => (TokenKind::Comment, start + length + 1),
                None => (TokenKind::UnclosedComment, self.line.len()),
            },
            Class::Semicolon => (TokenKind::Comment, self.line.len()),
            Class::Percent => (TokenKind::Percent, start + 1),
            Class::Slash => (TokenKind::BlockDelete, self.block_delete(start)),
            Class::Number => (TokenKind::StrayNumber, scan_number(self.line, start).end),
            Class::Macro if self.line[start] == b'#' => (TokenKind::Assignment, self.assignment(start)),
            Class::Macro => (TokenKind::Expression, self.line.len()),
            Class::Nul => (TokenKind::Nul, self.skip_class(start, Class::Nul)),
            Class::HighByte => self.high_bytes(start),
            Class::Removed => (TokenKind::Removed, self.skip_class(start, Class::Removed)),
            Class::Other if let Some((letter, Scan { end, number, defect: None })) = self.corner(start) => {
                self.at = end;
                return Some(Token { kind: TokenKind::Corner, letter, number, start: start as u32, end: end as u32 });
            }
            Class::Other if let Some((letter, end)) = self.computed_corner(start) => {
                self.at = end;
                let (start, end) = (start as u32, end as u32);
                return Some(Token { kind: TokenKind::ComputedCorner, letter, number: Number::ZERO, start, end });
            }
            Class::Other if matches!(self.line[start], b'@' | b'^') => (TokenKind::Polar, self.polar(start)),
            Class::Other | Class::Blank => (TokenKind::Unexpected, self.skip_class(start + 1, Class::Other)),
        };
        self.at = end;
        Some(Token { kind, letter, number: Number::ZERO, start: start as u32, end: end as u32 })
    }
}

/// Places of letters in the alphabet, with `:` read as the program number's `O`; others are behind its end.
static LETTER_PLACES: [u8; 256] = {
    let mut places = [u8::MAX; 256];
    let mut byte = 0;
    while byte < 256 {
        if let Class::Letter = CLASSES[byte] {
            places[byte] = upper(byte as u8) - b'A';
        }
        byte += 1;
    }
    places
};

/// The place in the alphabet of a byte that is a letter.
#[inline(always)]
pub(crate) fn letter_place(byte: u8) -> Option<usize> {
    let place = usize::from(LETTER_PLACES[usize::from(byte)]);
    (place < 26).then_some(place)
}

/// First offset from `at` on that is not blank.
#[inline(always)]
pub(crate) fn behind_blanks(line: &[u8], mut at: usize) -> usize {
    while let Some(b' ' | b'\t') = line.get(at) {
        at += 1;
    }
    at
}

/// Bytes in upper case, with `:` read as the program number's `O`.
const UPPER: [u8; 256] = {
    let mut upper = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        upper[byte] = (byte as u8).to_ascii_uppercase();
        byte += 1;
    }
    upper[b':' as usize] = b'O';
    upper
};

#[inline]
const fn upper(letter: u8) -> u8 {
    UPPER[letter as usize]
}
