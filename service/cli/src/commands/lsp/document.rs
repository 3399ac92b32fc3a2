//! The text of an open document and the places in it. The protocol counts lines from 0 and columns in UTF-16 code units; findings
//! count lines from 1 and columns in bytes, without a byte order mark.

use lsp_types::{Position, Range, TextDocumentContentChangeEvent};

/// A byte order mark, which findings do not count.
const BYTE_ORDER_MARK: &str = "\u{feff}";

/// One version of a document.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Document {
    /// The editor's number of this version.
    pub(super) version: i32,
    text: String,
    /// Where each line begins, bytes; one more line than line ends.
    starts: Vec<usize>,
}

impl Document {
    pub(super) fn new(version: i32, text: String) -> Self {
        let starts = line_starts(&text);
        Self { version, text, starts }
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }

    /// Lines, counted as the editor does: behind a last line end there is an empty one.
    pub(super) fn line_count(&self) -> usize {
        self.starts.len()
    }

    /// The line, counted from 0, that a byte belongs to.
    pub(super) fn line_at(&self, offset: usize) -> usize {
        self.starts.partition_point(|start| *start <= offset).saturating_sub(1)
    }

    /// A line, counted from 0, without its end; empty behind the last one.
    pub(super) fn line(&self, line: usize) -> &str {
        let Some(&start) = self.starts.get(line) else { return "" };
        let end = self.starts.get(line + 1).copied().unwrap_or(self.text.len());
        self.text[start..end].trim_end_matches(['\r', '\n'])
    }

    /// A line as findings count its bytes: without a byte order mark.
    pub(super) fn counted_line(&self, line: usize) -> &str {
        let text = self.line(line);
        if line == 0 { text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text) } else { text }
    }

    /// The byte at a position. Columns behind a line mean its end, one within a character its start, lines behind the last one
    /// the end of the text, as the protocol has it.
    pub(super) fn offset(&self, position: Position) -> usize {
        let line = position.line as usize;
        let Some(&start) = self.starts.get(line) else { return self.text.len() };
        let mut units = 0;
        for (at, character) in self.line(line).char_indices() {
            units += character.len_utf16() as u32;
            if units > position.character {
                return start + at;
            }
        }
        start + self.line(line).len()
    }

    /// The place of a finding: line and byte column from 1, length in bytes.
    pub(super) fn range(&self, line: u32, column: u32, length: u32) -> Range {
        let line = (line.max(1) - 1).min(self.line_count() as u32 - 1);
        let text = self.line(line as usize);
        let mark = text.len() - self.counted_line(line as usize).len();
        let from = mark + (column.max(1) - 1) as usize;
        let position = |at: usize| Position { line, character: utf16_units(text, at) };
        Range { start: position(from), end: position(from.saturating_add(length as usize)) }
    }

    /// A whole line, counted from 0.
    pub(super) fn line_range(&self, line: u32) -> Range {
        let text = self.line(line as usize);
        Range {
            start: Position { line, character: 0 },
            end: Position { line, character: utf16_units(text, text.len()) },
        }
    }

    /// Takes changes over, in their order; `most` is the longest that the text may become, bytes.
    pub(super) fn change(
        &mut self,
        version: i32,
        changes: Vec<TextDocumentContentChangeEvent>,
        most: usize,
    ) -> Result<(), TooLong> {
        self.version = version;
        for change in changes {
            match change.range {
                None => *self = Self::new(version, change.text),
                Some(range) => {
                    let (from, to) = (self.offset(range.start), self.offset(range.end));
                    // A range that ends before it starts covers nothing.
                    self.text.replace_range(from..to.max(from), &change.text);
                    self.starts = line_starts(&self.text);
                }
            }
            if self.text.len() > most {
                return Err(TooLong);
            }
        }
        Ok(())
    }
}

/// A document that has become too long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TooLong;

/// UTF-16 code units before a byte of a line; within a character those before it.
fn utf16_units(line: &str, at: usize) -> u32 {
    let before = line.char_indices().take_while(|(start, character)| start + character.len_utf8() <= at);
    before.map(|(_, character)| character.len_utf16() as u32).sum()
}

/// Where lines begin: behind a line feed, a carriage return, or both.
fn line_starts(text: &str) -> Vec<usize> {
    let bytes = text.as_bytes();
    let mut starts = vec![0];
    for (at, byte) in bytes.iter().enumerate() {
        let ends = *byte == b'\n' || *byte == b'\r' && bytes.get(at + 1) != Some(&b'\n');
        if ends {
            starts.push(at + 1);
        }
    }
    starts
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const fn at(line: u32, character: u32) -> Position {
        Position { line, character }
    }

    fn change(from: Position, to: Position, text: &str) -> TextDocumentContentChangeEvent {
        TextDocumentContentChangeEvent {
            range: Some(Range { start: from, end: to }),
            range_length: None,
            text: text.to_owned(),
        }
    }

    #[test]
    fn columns_are_utf_16_and_places_of_findings_bytes() {
        // ü: two bytes, one unit; 𝛥: four bytes, two units.
        let document = Document::new(1, "(ü𝛥) X1\r\nY2\rZ3\n".to_owned());
        assert_eq!(document.line_count(), 4);
        assert_eq!([0, 1, 2, 3, 4].map(|line| document.line(line)), ["(ü𝛥) X1", "Y2", "Z3", "", ""]);
        let x = document.range(1, 10, 2);
        assert_eq!((x.start, x.end), (at(0, 6), at(0, 8)));
        assert_eq!(document.offset(x.start), 9);
        assert_eq!(document.offset(at(0, 3)), 3, "within a character");
        assert_eq!(document.offset(at(0, 99)), 11, "behind the line");
        assert_eq!(document.offset(at(9, 0)), document.text().len());
        assert_eq!(document.range(99, 5, 5).start, at(3, 0));
        assert_eq!(document.range(2, 2, u32::MAX).end, at(1, 2));
    }

    #[test]
    fn a_byte_order_mark_is_a_column_of_the_editor_only() {
        let document = Document::new(1, "\u{feff}G1\n".to_owned());
        assert_eq!(document.range(1, 1, 2), Range { start: at(0, 1), end: at(0, 3) });
        assert_eq!(document.counted_line(0), "G1");
    }

    #[test]
    fn changes_in_their_order() {
        let mut document = Document::new(1, "G1 X1\nG1 X2\n".to_owned());
        let changes = vec![
            change(at(1, 3), at(1, 5), "Y9\nM30"),
            change(at(0, 0), at(1, 0), ""),
            change(at(5, 0), at(5, 0), "%"),
        ];
        document.change(2, changes, 100).unwrap();
        assert_eq!((document.text(), document.version), ("G1 Y9\nM30\n%", 2));
        document.change(3, vec![change(at(1, 1), at(0, 0), "x")], 100).unwrap();
        assert_eq!(document.text(), "G1 Y9\nMx30\n%");
        let whole = TextDocumentContentChangeEvent { range: None, range_length: None, text: "M2".to_owned() };
        document.change(4, vec![whole], 100).unwrap();
        assert_eq!(document.text(), "M2");
        let long = change(at(0, 0), at(0, 0), &"x".repeat(100));
        assert_eq!(document.change(5, vec![long], 100), Err(TooLong));
    }

    proptest! {
        #[test]
        fn any_change_leaves_the_lines_of_the_text(
            text in "[a𝛥ü\r\n]{0,40}",
            new in "[b𝛥\r\n]{0,10}",
            places in proptest::array::uniform4(0_u32..12),
        ) {
            let mut document = Document::new(1, text.clone());
            let [line, column, further, behind] = places;
            let (from, to) = (at(line, column), at(line + further, column + behind));
            let range = document.offset(from)..document.offset(to);
            let mut expected = text;
            expected.replace_range(range, &new);
            document.change(2, vec![change(from, to, &new)], 1_000).unwrap();
            prop_assert_eq!(&document, &Document::new(2, expected.clone()));
            // Every character's place there and back.
            for (offset, _) in expected.char_indices() {
                let line = document.line_at(offset);
                let column = offset - document.starts[line];
                if column <= document.line(line).len() {
                    let place = at(line as u32, utf16_units(document.line(line), column));
                    prop_assert_eq!(document.offset(place), offset);
                }
            }
        }
    }
}
