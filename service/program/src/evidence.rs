//! How much of a file reads as blocks: what tells text, tables and drawings, of which no single line says that it is none, from
//! a program with mistakes.
//!
//! Words and whatever is none are counted from the beginning, until there is enough of either. A program is never taken for
//! something else by its mistakes: they stand among words, and what is refused has next to none.

use serde::{Deserialize, Serialize};

use crate::foreign::{BINARY, Foreign, POST, UPLOAD, binary, foreign};
use crate::lexer::{Lexer, TokenKind};
use crate::lookalike;
use crate::number::starts_number;

/// Fewest defects of a file that is refused: a line or two of text.
const FEWEST_DEFECTS: u32 = 6;

/// Most of a file that is refused: one block of two or more words, and one other word, for so many defects.
const DEFECTS_PER_BLOCK: u32 = 64;
const DEFECTS_PER_WORD: u32 = 16;

/// Blocks after which a file is a program, whatever else is in it, and defects after which it is judged.
const ENOUGH_BLOCKS: u32 = 64;
const ENOUGH_DEFECTS: u32 = DEFECTS_PER_BLOCK * ENOUGH_BLOCKS;

/// Assignments of source code for each line that is certainly of it.
const LINES_PER_MARK: u32 = 8;

/// What was counted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Evidence {
    /// Blocks of at least two words, in lines without a defect.
    blocks: u32,
    /// Other words.
    words: u32,
    /// Whatever is neither word nor comment: text, numbers, marks.
    defects: u32,
    /// Lines with any of these.
    pub(crate) lines: u32,
    /// Lines among them that could be read.
    pub(crate) clear_lines: u32,
    /// The first of them, and its length in bytes.
    pub(crate) first: (u32, u32),
    /// What the other lines look like, by [`TextKind`].
    looks: [u32; TextKind::ALL.len()],
    has_comments: bool,
    has_nul: bool,
    /// The program was given up before.
    goes_on: bool,
    /// Nothing is counted any more.
    is_settled: bool,
}

impl Evidence {
    #[inline]
    pub(crate) const fn is_settled(&self) -> bool {
        self.is_settled
    }

    /// Whether any line could be read.
    pub(crate) const fn is_readable(&self) -> bool {
        self.clear_lines > 0
    }

    /// Goes on counting although the program was given up.
    pub(crate) const fn go_on(&mut self) {
        self.goes_on = true;
    }

    /// Whether what the file is remains to be seen after the program was given up.
    #[inline]
    pub(crate) const fn goes_on(&self) -> bool {
        self.goes_on && !self.is_settled
    }

    /// Ends the counting.
    pub(crate) const fn settle(&mut self) {
        self.is_settled = true;
    }

    /// A line that could be read, with so many words.
    pub(crate) fn add_block(&mut self, number: u32, length: usize, words: u32) {
        self.add_line(number, length);
        self.clear_lines += 1;
        if words > 1 {
            self.blocks += 1;
        } else {
            self.words += 1;
        }
    }

    /// A row of a table, which says nothing although it may read as a word and a comment: `T1;10.0`.
    pub(crate) fn add_row(&mut self, number: u32, length: usize, fields: u32) {
        self.add_line(number, length);
        self.defects += fields;
        self.looks[TextKind::Table as usize] += 1;
    }

    /// A line that is not read, such as a title.
    pub(crate) const fn add_comment(&mut self) {
        self.has_comments = true;
    }

    /// A line that could not be read, that is a statement or a comment, or behind the place where the program was given up.
    pub(crate) fn add(&mut self, number: u32, line: &[u8]) {
        if let Some(fields) = fields(line) {
            return self.add_row(number, line.len(), fields);
        }
        let (words, defects) = self.count(&as_it_looks(line));
        if words + defects == 0 {
            return;
        }
        if defects == 0 {
            return self.add_block(number, line.len(), words);
        }
        self.add_line(number, line.len());
        self.words += words;
        self.defects += defects;
        self.looks[TextKind::of(line) as usize] += 1;
    }

    fn add_line(&mut self, number: u32, length: usize) {
        if self.lines == 0 {
            self.first = (number, length as u32);
        }
        self.lines += 1;
    }

    /// The words of a line, and whatever is neither word nor comment.
    fn count(&mut self, line: &[u8]) -> (u32, u32) {
        // A line of LinuxCNC's control flow, whatever the dialect.
        if let [b'o' | b'O', b'<' | b'0'..=b'9', ..] = line.trim_ascii_start() {
            return (2, 0);
        }
        let pieces =
            |from: usize| line[from..].split(u8::is_ascii_whitespace).filter(|it| !it.is_empty()).count() as u32;
        if is_assignment(line.trim_ascii_start()) {
            return (0, pieces(0));
        }
        let (mut words, mut defects) = (0, 0);
        // Where a number, a letter or text ends: a word directly behind is a part of it, as in `1A4` and `of 5`.
        let mut torn_at = u32::MAX;
        for token in Lexer::new(line) {
            let (start, end) = (token.start as usize, token.end as usize);
            let is_torn = core::mem::replace(&mut torn_at, u32::MAX) == token.start;
            match token.kind {
                TokenKind::Word | TokenKind::Computed | TokenKind::Corner | TokenKind::ComputedCorner if !is_torn => {
                    words += 1;
                }
                TokenKind::Output => words += 1,
                TokenKind::Assignment if is_parameter(&line[start..]) => words += 1,
                TokenKind::Statement if is_condition(&line[start..]) => words += 2,
                // `X=5`: a slip of the pen, and more words behind it.
                TokenKind::Expression if let Some(value) = assigned(&line[start..]) => {
                    let (more_words, more_defects) = self.count(value);
                    return (words + 1 + more_words, defects + more_defects);
                }
                TokenKind::Statement | TokenKind::Expression => defects += pieces(start),
                TokenKind::Comment | TokenKind::UnclosedComment => self.has_comments = true,
                TokenKind::Nul => self.has_nul = true,
                TokenKind::Percent | TokenKind::BlockDelete => {}
                // A mistake in the number of a word.
                TokenKind::MalformedNumber | TokenKind::HugeNumber if !is_torn => {}
                _ => {
                    defects += 1;
                    torn_at = end as u32;
                }
            }
        }
        (words, defects)
    }

    /// What the file is if what was counted is enough to say that it is no program.
    pub(crate) fn verdict(&mut self) -> Option<Foreign> {
        let is_enough = self.blocks >= ENOUGH_BLOCKS || self.defects >= ENOUGH_DEFECTS;
        if !is_enough {
            return None;
        }
        self.settle();
        self.text()
    }

    /// What the file is where it ends before [`Evidence::verdict`], if it is no program.
    pub(crate) fn verdict_at_end(&mut self) -> Option<Foreign> {
        if core::mem::replace(&mut self.is_settled, true) {
            return None;
        }
        if self.lines > 0 {
            return self.text();
        }
        Some(match (self.has_nul, self.has_comments) {
            (true, _) => Foreign::NUL,
            (false, true) => Foreign::COMMENTS,
            (false, false) => Foreign::EMPTY,
        })
    }

    fn text(&self) -> Option<Foreign> {
        let is_foreign = self.defects >= FEWEST_DEFECTS
            && self.blocks.saturating_mul(DEFECTS_PER_BLOCK) <= self.defects
            && self.words.saturating_mul(DEFECTS_PER_WORD) <= self.defects;
        let looks = |kind: TextKind| self.looks[kind as usize];
        let most = TextKind::ALL.into_iter().rev().max_by_key(|kind| looks(*kind));
        // Source code is full of assignments.
        let is_code = looks(TextKind::Code) * LINES_PER_MARK >= looks(TextKind::Configuration);
        let most = most.map(|most| if most == TextKind::Configuration && is_code { TextKind::Code } else { most });
        most.filter(|_| is_foreign).map(TextKind::foreign)
    }
}

/// The number of fields of a line that is the row of a table: one name or number, and at least one bare number behind a
/// separator. In a block, what is behind a semicolon is a comment, and behind a comma a corner.
pub(crate) fn fields(line: &[u8]) -> Option<u32> {
    let separator = *line.iter().find(|byte| matches!(byte, b';' | b',' | b'\t'))?;
    let mut fields = line.split(|byte| *byte == separator).map(<[u8]>::trim_ascii);
    let is_name = |field: &[u8]| {
        field.iter().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'-' | b'+' | b'_' | b'"'))
    };
    fields.next().filter(|first| !first.is_empty() && is_name(first))?;
    let (mut count, mut numbers) = (1, 0);
    for field in fields {
        count += 1;
        numbers += u32::from(is_bare_number(field, separator));
    }
    (numbers > 0).then_some(count)
}

/// `10`, `-1.5`, `"2"`, and `10,5` where commas separate nothing; where they do, `X10,5` is a number with a decimal comma.
fn is_bare_number(field: &[u8], separator: u8) -> bool {
    let field = field.strip_prefix(b"\"").and_then(|field| field.strip_suffix(b"\"")).unwrap_or(field);
    let digits = field.strip_prefix(b"-").or_else(|| field.strip_prefix(b"+")).unwrap_or(field);
    let is_part = |byte: &u8| byte.is_ascii_digit() || *byte == b'.' || *byte == b',' && separator != b',';
    let is_told = separator != b',' || digits.contains(&b'.');
    is_told && digits.iter().any(u8::is_ascii_digit) && digits.iter().all(is_part)
}

/// A line with characters that only look like those of a program taken for those.
fn as_it_looks(line: &[u8]) -> Vec<u8> {
    let mut text = Vec::with_capacity(line.len());
    let mut at = 0;
    for stretch in lookalike::find(line) {
        text.extend_from_slice(&line[at..stretch.start]);
        text.extend_from_slice(stretch.text.as_bytes());
        at = stretch.end;
    }
    text.extend_from_slice(&line[at..]);
    text
}

/// What is behind the `=` of a word that is assigned a number.
fn assigned(text: &[u8]) -> Option<&[u8]> {
    let [letter, rest @ ..] = text else { return None };
    let value = rest.trim_ascii_start().strip_prefix(b"=")?.trim_ascii_start();
    let is_number = value.first().is_some_and(|byte| starts_number(*byte) || matches!(byte, b'#' | b'['));
    (letter.is_ascii_alphabetic() && is_number).then_some(value)
}

/// Whether a line of source code or a configuration begins so: `x1 = 5`, `x = 5`, `depth=3`. `X=5` is a slip of the pen.
fn is_assignment(line: &[u8]) -> bool {
    let is_name = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    let name = line.iter().take_while(|byte| is_name(byte)).count();
    let behind = &line[name..];
    let is_spaced = behind.starts_with(b" ");
    line.first().is_some_and(u8::is_ascii_alphabetic)
        && (name > 1 || is_spaced)
        && behind.trim_ascii_start().starts_with(b"=")
}

/// Whether this begins a parameter: `#1`, `##2`, `#[3]`, `#<name>`.
fn is_parameter(text: &[u8]) -> bool {
    let name = text.iter().find(|byte| **byte != b'#');
    name.is_some_and(|byte| byte.is_ascii_digit() || matches!(byte, b'[' | b'<' | b'_'))
}

/// Whether a statement of the macro language goes on as one: `IF [`, `DO1`.
fn is_condition(statement: &[u8]) -> bool {
    let behind = statement.iter().position(|byte| !byte.is_ascii_alphabetic()).map_or(&b""[..], |at| &statement[at..]);
    matches!(behind.trim_ascii_start().first(), Some(b'[' | b'#' | b'0'..=b'9'))
}

/// What lines of a file look like that is text and no program: a guess, which only names what was told from a program already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TextKind {
    Binary,
    Drawing,
    Table,
    Markdown,
    Code,
    Configuration,
    Text,
}

impl TextKind {
    /// Each in the order of preference where lines look as much like one as like another.
    pub(crate) const ALL: [Self; 7] =
        [Self::Binary, Self::Drawing, Self::Table, Self::Markdown, Self::Code, Self::Configuration, Self::Text];

    pub(crate) const fn foreign(self) -> Foreign {
        match self {
            Self::Binary => BINARY,
            Self::Drawing => foreign("a drawing (DXF)", POST),
            Self::Table => foreign("a table (CSV)", UPLOAD),
            Self::Markdown => foreign("a Markdown document", UPLOAD),
            Self::Code => foreign("source code", UPLOAD),
            Self::Configuration => foreign("a configuration file", UPLOAD),
            Self::Text => foreign("text", UPLOAD),
        }
    }

    /// What this line looks like.
    pub(crate) fn of(line: &[u8]) -> Self {
        let text = line.trim_ascii();
        let starts = |starts: &[&[u8]]| starts.iter().any(|start| text.starts_with(start));
        let count = |byte: u8| text.iter().filter(|it| **it == byte).count();
        if binary(line).is_some() {
            return Self::Binary;
        }
        // Codes of groups, on lines of their own, are most of a drawing.
        if !text.is_empty() && text.len() <= 4 && text.iter().all(u8::is_ascii_digit) || starts(&[b"AcDb", b"$ACAD"]) {
            return Self::Drawing;
        }
        if starts(&[b"## ", b"### ", b"```", b"- ", b"* ", b"| ", b"> "]) {
            return Self::Markdown;
        }
        if starts(&[
            b"//",
            b"/*",
            b"#include",
            b"import ",
            b"from ",
            b"def ",
            b"class ",
            b"function ",
            b"use ",
            b"fn ",
            b"pub ",
            b"const ",
            b"let ",
            b"var ",
            b"return ",
            b"}",
            b"using ",
            b"package ",
        ]) || text.ends_with(b"{")
            || text.ends_with(b");")
        {
            return Self::Code;
        }
        if fields(line).is_some()
            || count(b',') > 1 && !text.windows(2).any(|pair| pair == b", ")
            || count(b';') > 1
            || count(b'\t') > 1
        {
            return Self::Table;
        }
        let is_section = text.first() == Some(&b'[') && text.last() == Some(&b']');
        let key = text.iter().take_while(|byte| byte.is_ascii_alphanumeric() || b"_-.".contains(byte)).count();
        let is_set = key > 1 && matches!(text[key..].trim_ascii_start().first(), Some(b'=' | b':'));
        if is_section || is_set { Self::Configuration } else { Self::Text }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_defects_of_lines() {
        let lines = [
            ("N10 G0 X1. ROUGH IT", (3, 2)),
            ("G0 X\u{2212}5", (2, 0)),
            ("X=5 Y=2", (2, 2)),
            ("of 5 parts", (0, 3)),
            ("1A4 7f45 4c46", (0, 4)),
            ("IF [#1 EQ 5] GOTO 10", (2, 0)),
            ("if x > 5:", (0, 4)),
            ("o<rect> call [10]", (2, 0)),
            ("#100=5", (1, 0)),
            ("x1 = 5", (0, 3)),
            ("G0 X = 5", (2, 1)),
            ("# Title", (0, 2)),
            ("## Title", (0, 2)),
            ("#include <stdio.h>", (0, 6)),
            ("int main(void) {", (0, 3)),
            ("    return printf(\"hello\\n\");", (0, 2)),
            ("1.5,2.5", (0, 1)),
            ("(comment) ; G0", (0, 0)),
            ("%", (0, 0)),
        ];
        let counted = |line: &str| Evidence::default().count(&as_it_looks(line.as_bytes()));
        assert_eq!(lines.map(|(line, _)| (line, counted(line))), lines);
    }
}
