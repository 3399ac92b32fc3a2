//! Characters that only look like those of a program: a minus sign of typesetting, wide digits, a Cyrillic X, a decimal comma.
//!
//! Removing one changes the number (`X−5` without its minus is X5), so the whole word is one finding whose cure is the word as it
//! looks.

use crate::Finding;
use crate::block::quote;
use crate::lexer::{Lexer, Token, TokenKind};

/// A stretch of a line with such characters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Stretch {
    /// Offset of its first byte in the line.
    pub(crate) start: usize,
    /// Offset behind its last byte.
    pub(crate) end: usize,
    /// The stretch as it looks, in ASCII.
    pub(crate) text: String,
    /// Whether it can only mean that.
    pub(crate) is_certain: bool,
    /// Whether it can be read as it looks, in its line.
    pub(crate) reads: bool,
}

impl Stretch {
    /// What is wrong with it.
    pub(crate) fn message(&self, line: &[u8]) -> String {
        let (written, text) = (quote(&line[self.start..self.end]), &self.text);
        format!("{written} holds characters that only look like those of a program; it looks like {text}")
    }

    /// The cure in words.
    pub(crate) fn cure(&self) -> String {
        let Self { text, .. } = self;
        match self.reads {
            true if self.is_certain => format!("write {text}"),
            true => format!("write it again, as {text} if that is meant: it may be read as either"),
            false => "write it again: as it looks, it cannot be read".to_owned(),
        }
    }

    /// A finding with the cure.
    pub(crate) fn cured(&self, finding: Finding) -> Finding {
        if self.reads && self.is_certain {
            return finding.suggest_replacement(self.cure(), self.text.clone());
        }
        finding.suggest(self.cure())
    }
}

/// Texts in UTF-8 that were taken for Windows-1252 and written in UTF-8 once more: minus sign, dashes, space.
const GARBLED: [(&str, char); 4] = [
    ("\u{e2}\u{2c6}\u{2019}", '-'),
    ("\u{e2}\u{20ac}\u{201c}", '-'),
    ("\u{e2}\u{20ac}\u{201d}", '-'),
    ("\u{c2}\u{a0}", ' '),
];

/// What a character outside ASCII looks like: `Some(None)` for one that cannot be seen.
fn look(character: char) -> Option<Option<char>> {
    let code = u32::from(character);
    let seen = match character {
        '\u{2010}'..='\u{2015}' | '\u{2212}' | '\u{2796}' | '\u{2d7}' | '\u{fe58}' | '\u{fe63}' | '\u{ad}' => '-',
        '\u{2795}' | '\u{fe62}' => '+',
        '\u{2024}' | '\u{b7}' | '\u{fe52}' => '.',
        '\u{a0}' | '\u{1680}' | '\u{2000}'..='\u{200a}' | '\u{202f}' | '\u{205f}' | '\u{3000}' => ' ',
        '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2060}' | '\u{2066}'..='\u{2069}' | '\u{feff}' => {
            return Some(None);
        }
        '\u{ff01}'..='\u{ff5e}' => char::from_u32(code - 0xfee0)?,
        '\u{660}'..='\u{669}' => char::from_digit(code - 0x660, 10)?,
        '\u{6f0}'..='\u{6f9}' => char::from_digit(code - 0x6f0, 10)?,
        '\u{1d7ce}'..='\u{1d7ff}' => char::from_digit((code - 0x1d7ce) % 10, 10)?,
        // Cyrillic and Greek.
        '\u{410}' | '\u{430}' | '\u{391}' => 'A',
        '\u{412}' | '\u{392}' => 'B',
        '\u{421}' | '\u{441}' => 'C',
        '\u{415}' | '\u{435}' | '\u{395}' => 'E',
        '\u{41d}' | '\u{397}' => 'H',
        '\u{406}' | '\u{456}' | '\u{399}' => 'I',
        '\u{408}' | '\u{458}' => 'J',
        '\u{41a}' | '\u{39a}' => 'K',
        '\u{41c}' | '\u{39c}' => 'M',
        '\u{39d}' => 'N',
        '\u{41e}' | '\u{43e}' | '\u{39f}' => 'O',
        '\u{420}' | '\u{440}' | '\u{3a1}' => 'P',
        '\u{405}' | '\u{455}' => 'S',
        '\u{422}' | '\u{3a4}' => 'T',
        '\u{425}' | '\u{445}' | '\u{3a7}' => 'X',
        '\u{423}' | '\u{443}' | '\u{3a5}' => 'Y',
        '\u{396}' => 'Z',
        _ => return None,
    };
    Some(Some(seen))
}

/// What a byte that is not UTF-8 shows in Windows-1252.
const fn look_of_byte(byte: u8) -> Option<Option<char>> {
    match byte {
        0x96 | 0x97 | 0xad => Some(Some('-')),
        0xa0 => Some(Some(' ')),
        0xb7 => Some(Some('.')),
        _ => None,
    }
}

/// The character at an offset: its length, what it looks like, and whether that is certain; `None` for what ends a stretch.
fn character(line: &[u8], at: usize) -> Option<(usize, Option<char>, bool, bool)> {
    let byte = *line.get(at)?;
    if byte.is_ascii() {
        let before = at.checked_sub(1).map(|before| line[before]);
        if byte == b',' {
            return decimal_comma(line, at, before);
        }
        let plain = byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-' | b'.');
        return plain.then_some((1, Some(char::from(byte)), true, false));
    }
    let rest = &line[at..];
    let valid = &rest[..rest.len().min(16)];
    let chunk = valid.utf8_chunks().next()?;
    let Some(first) = chunk.valid().chars().next() else {
        let seen = look_of_byte(byte)?;
        return Some((1, seen, byte != 0xad, true));
    };
    if let Some((text, seen)) = GARBLED.iter().find(|(text, _)| chunk.valid().starts_with(text)) {
        return Some((text.len(), Some(*seen), true, true));
    }
    let seen = look(first)?;
    // A soft hyphen may be seen or not; a letter O may be a zero.
    let is_certain = first != '\u{ad}' && seen != Some('O');
    Some((first.len_utf8(), seen, is_certain, true))
}

/// A comma before a digit that can only be a decimal comma, or with three digits behind it one of thousands.
fn decimal_comma(line: &[u8], at: usize, before: Option<u8>) -> Option<(usize, Option<char>, bool, bool)> {
    let follows = before.is_some_and(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-'));
    let digits = line[at + 1..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    (follows && digits > 0).then_some((1, Some('.'), digits != 3, true))
}

/// A run of characters without blanks, as it looks.
struct Run {
    end: usize,
    text: String,
    is_certain: bool,
    is_foreign: bool,
}

impl Run {
    /// The run from an offset on, which may be empty.
    fn at(line: &[u8], start: usize) -> Self {
        let mut run = Self { end: start, text: String::new(), is_certain: true, is_foreign: false };
        while let Some((length, seen, certain, foreign)) = character(line, run.end) {
            run.text.extend(seen);
            run.is_certain &= certain;
            run.is_foreign |= foreign;
            run.end += length;
        }
        run
    }

    /// Whether it looks like the beginning of a word whose digits are behind blanks.
    fn is_begun(&self) -> bool {
        self.text.ends_with(['+', '-'])
            || self.text.len() == 1 && self.text.starts_with(|it: char| it.is_ascii_alphabetic())
    }

    /// Takes in the number behind blanks that belongs to it.
    fn complete(mut self, line: &[u8]) -> Self {
        while self.is_begun() {
            let blanks = line[self.end..].iter().take_while(|byte| matches!(byte, b' ' | b'\t')).count();
            let next = Self::at(line, self.end + blanks);
            let is_sign = next.text.starts_with(['+', '-']) && !self.text.ends_with(['+', '-']);
            if !is_sign && !next.text.starts_with(|it: char| it.is_ascii_digit() || it == '.') {
                break;
            }
            self.end = next.end;
            self.text.push_str(&next.text);
            self.is_certain &= next.is_certain;
        }
        self
    }
}

/// Length of what no stretch holds: a character, or the bytes of one that is not whole.
fn length_of_other(line: &[u8], at: usize) -> usize {
    let rest = &line[at..line.len().min(at + 4)];
    let chunk = rest.utf8_chunks().next();
    let first = chunk.as_ref().and_then(|chunk| chunk.valid().chars().next()).map(char::len_utf8);
    first.or_else(|| chunk.map(|chunk| chunk.invalid().len())).unwrap_or(1).max(1)
}

/// The stretches of a line outside comments that hold such characters, with the letter before and the number behind where one
/// is alone.
pub(crate) fn find(line: &[u8]) -> Vec<Stretch> {
    let mut stretches = Vec::new();
    let mut at = 0;
    // A letter with nothing but blanks behind it.
    let mut lone_letter = None;
    while at < line.len() {
        match line[at] {
            b'(' => {
                at += line[at..].iter().position(|&byte| byte == b')').map_or(line.len() - at, |length| length + 1);
                lone_letter = None;
                continue;
            }
            b';' => break,
            b' ' | b'\t' => {
                at += 1;
                continue;
            }
            _ => {}
        }
        let start = at;
        let mut run = Run::at(line, start);
        if run.end == start {
            at += length_of_other(line, at);
            lone_letter = None;
            continue;
        }
        if run.is_foreign {
            let is_number =
                run.text.starts_with(|first: char| first.is_ascii_digit() || matches!(first, '+' | '-' | '.'));
            let letter = lone_letter.take().filter(|_| is_number);
            if let Some(letter) = letter {
                run.text.insert(0, char::from(line[letter]));
            }
            let Run { end, text, is_certain, .. } = run.complete(line);
            at = end;
            stretches.push(Stretch { start: letter.unwrap_or(start), end, text, is_certain, reads: true });
            continue;
        }
        at = run.end;
        lone_letter = (at - start == 1 && line[start].is_ascii_alphabetic()).then_some(start);
    }
    read_as_they_look(line, &mut stretches);
    stretches
}

/// Finds out which stretches can be read as they look, with all of them written so.
fn read_as_they_look(line: &[u8], stretches: &mut [Stretch]) {
    let mut text = Vec::with_capacity(line.len());
    let mut places = Vec::with_capacity(stretches.len());
    let mut behind = 0;
    for Stretch { start, end, text: looks, .. } in &*stretches {
        text.extend_from_slice(&line[behind..*start]);
        let place = text.len();
        text.extend_from_slice(looks.as_bytes());
        places.push((place, text.len()));
        behind = *end;
    }
    text.extend_from_slice(&line[behind..]);
    for token in Lexer::new(&text).filter(|token| !is_readable(*token)) {
        let (from, to) = (token.start as usize, token.end as usize);
        for (stretch, &(start, end)) in stretches.iter_mut().zip(&places) {
            stretch.reads &= to <= start || end <= from;
        }
    }
}

/// Whether a token can be a part of a program as it is written.
fn is_readable(token: Token) -> bool {
    match token.kind {
        TokenKind::Word | TokenKind::Corner => !token.number.is_spaced(),
        TokenKind::UnclosedComment
        | TokenKind::LoneLetter
        | TokenKind::MalformedNumber
        | TokenKind::HugeNumber
        | TokenKind::StrayNumber
        | TokenKind::Text
        | TokenKind::Expression
        | TokenKind::Nul
        | TokenKind::NotUtf8
        | TokenKind::Unexpected
        | TokenKind::Removed => false,
        TokenKind::Comment
        | TokenKind::Percent
        | TokenKind::BlockDelete
        | TokenKind::Computed
        | TokenKind::Assignment
        | TokenKind::Output
        | TokenKind::Statement
        | TokenKind::ComputedCorner
        | TokenKind::Polar => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(line: impl AsRef<[u8]>, expected: &[(usize, usize, &str, bool)]) {
        let found = find(line.as_ref());
        let found: Vec<_> =
            found.iter().map(|found| (found.start, found.end, found.text.as_str(), found.is_certain)).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn every_kind_of_minus() {
        for minus in
            ['\u{2212}', '\u{2010}', '\u{2011}', '\u{2012}', '\u{2013}', '\u{2014}', '\u{2015}', '\u{ff0d}', '\u{fe63}']
        {
            let line = format!("G1 X{minus}5.2 Y3");
            check(&line, &[(3, 3 + 4 + minus.len_utf8(), "X-5.2", true)]);
        }
        check("G1 X \u{2212}5 Y3", &[(3, 9, "X-5", true)]);
        check(b"G1 X\x965", &[(3, 6, "X-5", true)]);
        check("X\u{e2}\u{2c6}\u{2019}5", &[(0, 9, "X-5", true)]);
        // A soft hyphen may be seen as nothing.
        check("X\u{ad}5", &[(0, 4, "X-5", false)]);
    }

    #[test]
    fn wide_and_invisible_characters_and_other_alphabets() {
        check(
            "\u{ff27}\u{ff11} \u{ff38}\u{ff11}\u{ff10}\u{ff0e}\u{ff15}",
            &[(0, 6, "G1", true), (7, 22, "X10.5", true)],
        );
        check("G1\u{a0}X10\u{a0}Z5", &[(0, 11, "G1 X10 Z5", true)]);
        check("G1 X1\u{200b}0", &[(3, 9, "X10", true)]);
        check("G1 \u{425}10", &[(3, 7, "X10", true)]);
        check("X1\u{41e}", &[(0, 4, "X1O", false)]);
    }

    #[test]
    fn decimal_commas() {
        check("X1,5 Z-2,25", &[(0, 4, "X1.5", true), (5, 11, "Z-2.25", true)]);
        check("X,5", &[(0, 3, "X.5", true)]);
        check("X1,000", &[(0, 6, "X1.000", false)]);
        check("X10 ,R5", &[]);
        check("X10,R5", &[]);
    }

    #[test]
    fn comments_and_unknown_characters_are_left() {
        check("G1 (X\u{2212}5) X5 ; X\u{2212}5", &[]);
        check("G1 \u{e9}\u{e8} X5", &[]);
        check(b"G1 \xe9 X5", &[]);
        check("(open X\u{2212}5", &[]);
    }

    #[test]
    fn a_character_is_never_divided() {
        // Each ends in a byte that shows a dash, a blank or a point in Windows-1252.
        for character in
            ['\u{417}', '\u{416}', '\u{d7}', '\u{d6}', '\u{ed}', '\u{e0}', '\u{5d0}', '\u{4e16}', '\u{1f516}']
        {
            for line in [format!("G0 X50. {character} 2."), format!("X5{character}"), character.to_string()] {
                check(&line, &[]);
            }
            check(
                format!("{character} X\u{2212}5"),
                &[(character.len_utf8() + 1, character.len_utf8() + 6, "X-5", true)],
            );
        }
        // Half of a minus sign is none.
        check(b"X5 \xe2\x88 3", &[]);
        check(b"X5 \xd0", &[]);
    }

    #[test]
    fn a_word_over_blanks_is_one() {
        check("G0 X \u{2212} 5.", &[(3, 11, "X-5.", true)]);
        check("G0 \u{425} 50. Z2.", &[(3, 9, "X50.", true)]);
        check("M3 \u{405} 500", &[(3, 9, "S500", true)]);
        check("X5. \u{456} \u{2212} 2.", &[(4, 13, "I-2.", true)]);
        check("G0 \u{425} Z2", &[(3, 5, "X", true)]);
    }

    #[test]
    fn what_cannot_be_read_as_it_looks() {
        let reads = |line: &str| find(line.as_bytes()).iter().map(|found| found.reads).collect::<Vec<_>>();
        for line in ["X\u{2212}5", "X \u{2212} 5", "\u{425} 5", "#1=5 \u{2212} 3", "X[#1\u{2212}5]", "G1\u{a0}X1,5"] {
            assert_eq!(reads(line), [true], "{line}");
        }
        for line in [
            "X-\u{2212}5",
            "X5.\u{2212}",
            "X5 \u{2212} 3.",
            "Z 1 \u{2212} 5.",
            "\u{425} Z2",
            "N\u{410}10",
            "X1 \u{ff15}",
            "X5 \u{a0} 3",
            "X5 \u{200b} 3",
            "X\u{2212}5\u{2212}3",
        ] {
            assert_eq!(reads(line), [false], "{line}");
        }
        assert_eq!(reads("X\u{2212}5 Z5.\u{2212}"), [true, false]);
    }
}
