//! What a program has shown of the G-code system it is written in.

use core::fmt;

use serde::{Deserialize, Serialize};

/// A code or a word that some G-code systems alone have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ShownBy {
    pub(crate) letter: u8,
    /// Number of a code; words have none.
    pub(crate) tenths: u32,
    pub(crate) line: u32,
}

impl fmt::Display for ShownBy {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let letter = char::from(self.letter);
        match self.letter {
            b'G' => write!(formatter, "{letter}{}", f64::from(self.tenths) / 10.0),
            _ => write!(formatter, "{letter} word"),
        }
    }
}
