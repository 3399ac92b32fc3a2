//! The bytes of a document and of the files that it calls, as the interpreter asks for them.

use feedwave_cutting::{Interpretation, InterpretationStep};
use feedwave_program::Place;

use crate::commands::CliError;
use crate::commands::source::Source;

/// Most bytes of a text in memory that are handed over at once.
const PIECE_BYTES: usize = 256 << 10;

/// Texts in memory, then files.
#[derive(Debug)]
pub(super) struct Input<'a> {
    /// The first programs of the job.
    texts: Vec<&'a str>,
    /// Which of the further files the programs behind them are; `None` for all of them in their order.
    files: Option<&'a [u32]>,
    further: &'a mut Source,
}

impl<'a> Input<'a> {
    /// A document as the program that is run, with all further files.
    pub(super) fn of_main(document: &'a str, further: &'a mut Source) -> Self {
        Self { texts: vec![document], files: None, further }
    }

    /// Texts, with those further files that are at these places.
    pub(super) const fn with_files(texts: Vec<&'a str>, files: &'a [u32], further: &'a mut Source) -> Self {
        Self { texts, files: Some(files), further }
    }

    /// Bytes from a place on; none at the end.
    pub(super) fn read(&mut self, place: Place) -> Result<&[u8], CliError> {
        let program = place.program as usize;
        if let Some(text) = self.texts.get(program) {
            let rest = text.as_bytes().get(place.offset as usize..).unwrap_or_default();
            return Ok(&rest[..rest.len().min(PIECE_BYTES)]);
        }
        let behind = program - self.texts.len();
        let file = self.files.map_or(Some(behind as u32), |files| files.get(behind).copied());
        let file = file.ok_or_else(|| CliError::trouble(format!("there is no further file {behind}")))?;
        self.further.read(Place { program: file + 1, ..place })
    }

    /// One step of an interpretation, with what it needs; `None` where that cannot be read.
    pub(super) fn step(&mut self, interpretation: &mut Interpretation) -> Option<InterpretationStep> {
        let step = interpretation.step();
        if let InterpretationStep::NeedInput(place) = step {
            match self.read(place).ok()? {
                [] => interpretation.finish_input(),
                piece => interpretation.push(piece),
            }
        }
        Some(step)
    }
}
