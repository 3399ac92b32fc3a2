//! How bytes become lines: where a line ends, one that is too long, and what is passed over.

use super::{Interpreter, LineOutcome, Straight};
use crate::code;
use crate::foreign;
use crate::{Finding, FindingLog, Operation, SourceSpan};

impl Interpreter {
    /// Reads the next line, or part of one that is passed over.
    #[inline]
    pub(super) fn read(
        &mut self,
        input: &[u8],
        end_of_input: bool,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> LineOutcome {
        if self.state.after_return && !input.is_empty() {
            self.state.after_return = false;
            if input[0] == b'\n' {
                return LineOutcome::Consumed(1);
            }
        }
        if self.state.skipping_line || self.state.reported.trailing && !self.state.evidence.goes_on() {
            return self.skip_line(input, end_of_input, operations, findings);
        }
        let longest = self.settings.max_line_bytes as usize;
        let window = &input[..input.len().min(longest.saturating_add(1))];
        match find_line_end(window) {
            Some(length) => {
                self.line(&input[..length], operations, findings);
                LineOutcome::Consumed(self.line_end(input, length))
            }
            None if input.len() > longest => {
                let line = self.state.lines.saturating_add(1);
                if !self.state.evidence.is_readable()
                    && !self.state.has_ended()
                    && let Some(foreign) = foreign::recognise(window, true)
                {
                    self.refuse_file(foreign, window.len(), line, operations, findings);
                    return LineOutcome::Consumed(input.len());
                }
                if !self.state.evidence.is_settled() {
                    self.state.evidence.add(line, window);
                }
                self.report_long_line(window, findings);
                self.state.skipping_line = true;
                self.skip_line(input, end_of_input, operations, findings)
            }
            None if !end_of_input => LineOutcome::NeedMore,
            None if input.is_empty() => {
                if self.state.flow.waits() && !self.state.has_ended() && self.contour_at_end(findings) {
                    return LineOutcome::Elsewhere;
                }
                self.finish(operations, findings);
                LineOutcome::Ended
            }
            None => {
                self.line(input, operations, findings);
                LineOutcome::Consumed(input.len())
            }
        }
    }

    /// Remembers where a line ends for who looks: blanks say nothing.
    #[inline]
    pub(super) fn note_line_end(&mut self, line: &[u8]) {
        match line.iter().rposition(|byte| !byte.is_ascii_whitespace() && *byte != 0) {
            Some(last) => (self.state.last_line_bytes, self.state.blank_lines) = (last as u32 + 1, 0),
            None => self.state.blank_lines = self.state.blank_lines.saturating_add(1),
        }
    }

    /// Where the line ends whose terminator is at `at`: behind a line feed, a carriage return, or both.
    #[inline]
    fn line_end(&mut self, input: &[u8], at: usize) -> usize {
        if input[at] == b'\n' {
            return at + 1;
        }
        match input.get(at + 1) {
            Some(b'\n') => at + 2,
            next => {
                self.state.after_return = next.is_none();
                at + 1
            }
        }
    }

    /// Consumes the rest of a line that is too long, or everything after the end once that has been reported.
    fn skip_line(
        &mut self,
        input: &[u8],
        end_of_input: bool,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> LineOutcome {
        if input.is_empty() {
            if !end_of_input {
                return LineOutcome::NeedMore;
            }
            self.finish(operations, findings);
            return LineOutcome::Ended;
        }
        if self.state.reported.trailing {
            return if self.state.flow.has_jumped() { LineOutcome::Ended } else { LineOutcome::Consumed(input.len()) };
        }
        let end = find_line_end(input);
        let length = end.unwrap_or(input.len());
        self.state.last_line_bytes =
            self.state.last_line_bytes.saturating_add(u32::try_from(length).unwrap_or(u32::MAX));
        match end {
            Some(length) => {
                self.state.skipping_line = false;
                self.state.lines = self.state.lines.saturating_add(1);
                LineOutcome::Consumed(self.line_end(input, length))
            }
            None => LineOutcome::Consumed(input.len()),
        }
    }

    #[cold]
    fn report_long_line(&mut self, start: &[u8], findings: &mut FindingLog) {
        let longest = self.settings.max_line_bytes;
        let line = self.state.lines.saturating_add(1);
        (self.state.last_line_bytes, self.state.blank_lines) = (0, 0);
        // Any word may have stood in it.
        self.state.unread = u32::MAX;
        self.straight = Straight::Unknown;
        if self.state.has_ended() {
            return self.report_trailing(start, line, findings);
        }
        self.break_nurbs();
        let span = SourceSpan { program: self.state.place.program, line, column: 1, length: longest };
        findings.push_with(code::LINE_TOO_LONG, |code| {
            Finding::new(code, span, format!("the line is longer than {longest} bytes and is skipped"))
                .with_value("max_line_length", f64::from(longest), "bytes")
                .suggest("break it into blocks")
        });
    }
}

/// Offset of the first line feed or carriage return, eight bytes at a time.
#[inline]
pub(crate) fn find_line_end(bytes: &[u8]) -> Option<usize> {
    const ONES: u64 = u64::from_ne_bytes([1; 8]);
    const HIGHS: u64 = u64::from_ne_bytes([0x80; 8]);
    let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
    let (chunks, rest) = bytes.as_chunks::<8>();
    for (index, bytes) in chunks.iter().enumerate() {
        // Bytes up to a carriage return, so that one comparison finds both; of the others among them only tabs are common.
        let chunk = u64::from_le_bytes(*bytes);
        let small = chunk.wrapping_sub(ONES * u64::from(b'\r' + 1)) & !chunk & HIGHS;
        if small != 0 {
            // The lowest bit marks the first of them exactly.
            let first = small.trailing_zeros() as usize / 8;
            if is_end(&((chunk >> (8 * first)) as u8)) {
                return Some(index * 8 + first);
            }
            if let Some(place) = bytes[first + 1..].iter().position(is_end) {
                return Some(index * 8 + first + 1 + place);
            }
        }
    }
    Some(chunks.len() * 8 + rest.iter().position(is_end)?)
}
