//! Where the bytes of programs come from.

use feedwave_program::Place;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// A callable of Python: number of the file (0 is the program itself) and offset to the bytes from there on, none at the
/// end.
#[derive(Debug)]
pub(crate) struct Source {
    read: Py<PyAny>,
}

impl Source {
    pub(crate) const fn new(read: Py<PyAny>) -> Self {
        Self { read }
    }

    /// Hands the bytes from a place on to `take`. Takes Python's lock, and answers its signals.
    pub(crate) fn read(&self, place: Place, take: impl FnOnce(&[u8])) -> PyResult<()> {
        Python::attach(|py| {
            py.check_signals()?;
            let piece = self.read.call1(py, (place.program, place.offset))?;
            take(piece.bind(py).cast::<PyBytes>()?.as_bytes());
            Ok(())
        })
    }
}

/// How often long work without input looks whether it was interrupted: once in so many steps.
const SIGNAL_STEPS: u32 = 64;

/// Counts steps of work, so that it can be interrupted.
#[derive(Debug, Default)]
pub(crate) struct Signals {
    steps: u32,
}

impl Signals {
    /// After a step.
    pub(crate) fn step(&mut self) -> PyResult<()> {
        self.steps += 1;
        if self.steps % SIGNAL_STEPS == 0 { Python::attach(|py| py.check_signals()) } else { Ok(()) }
    }
}
