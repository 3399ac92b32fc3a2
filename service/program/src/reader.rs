//! An interpreter with the bytes that it reads: what everything that reads programs uses.

use crate::source::{SourcePages, Window};
use crate::{FindingLog, Interpreter, LineOutcome, Operation};

/// What [`Reader::read_line`] did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// It got on; there may be more.
    More,
    /// Bytes are needed first: those from [`SourcePages::wanted`] on.
    NeedInput,
    /// The program has ended, and all that is looked at behind its end.
    Ended,
}

/// Reads programs from pages, which several readers may share.
#[derive(Clone, Debug)]
pub struct Reader {
    /// What is read, and as what.
    pub interpreter: Interpreter,
    /// A line that goes on in the next page.
    seam: Vec<u8>,
}

impl Reader {
    /// Reads on where the interpreter is.
    #[must_use]
    pub const fn new(interpreter: Interpreter) -> Self {
        Self { interpreter, seam: Vec::new() }
    }

    /// Reads at most one line and appends its operations and findings.
    #[inline]
    pub fn read_line(
        &mut self,
        pages: &mut SourcePages,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> Reading {
        let Some(Window { bytes, ends }) = pages.window(self.interpreter.place()) else {
            return Reading::NeedInput;
        };
        match self.interpreter.read_line(bytes, ends, operations, findings) {
            LineOutcome::Consumed(_) | LineOutcome::Elsewhere => Reading::More,
            LineOutcome::Ended => Reading::Ended,
            LineOutcome::NeedMore => self.read_across(pages, operations, findings),
        }
    }

    /// Reads a line that one page does not hold.
    #[cold]
    fn read_across(
        &mut self,
        pages: &mut SourcePages,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> Reading {
        let start = self.interpreter.place();
        self.seam.clear();
        loop {
            let mut next = start;
            next.offset += self.seam.len() as u64;
            let Some(Window { bytes, ends }) = pages.window(next) else {
                return Reading::NeedInput;
            };
            // No more of the next page than the longest line, so that the seam stays short.
            let most = self.interpreter.settings().max_line_bytes as usize + 2;
            let taken = if self.seam.is_empty() { bytes } else { &bytes[..bytes.len().min(most)] };
            let ends = ends && taken.len() == bytes.len();
            self.seam.extend_from_slice(taken);
            match self.interpreter.read_line(&self.seam, ends, operations, findings) {
                LineOutcome::NeedMore => {}
                LineOutcome::Consumed(_) | LineOutcome::Elsewhere => return Reading::More,
                LineOutcome::Ended => return Reading::Ended,
            }
        }
    }
}
