//! What programs are called by.

use core::fmt;

use serde::{Deserialize, Serialize};

/// Most characters of a name, as newer FANUC controls take them.
const LONGEST: usize = 32;

/// What a program is called by: its number, or on newer FANUC controls a name.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum ProgramName {
    /// `O1000`
    Number(u32),
    /// `<SHAFT-2>`, without the brackets.
    Text(Box<str>),
}

impl ProgramName {
    /// The name in `< >` that a text begins with, and its bytes with the brackets: letters, digits and `+ - _ .`, 1 to 32 of them.
    /// `<O1000>` is the program O1000, as on the control.
    pub(crate) fn read(text: &[u8]) -> Option<(Self, usize)> {
        let belongs = |byte: &&u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-' | b'_' | b'.');
        let name = text.strip_prefix(b"<")?;
        let length = name.iter().take_while(belongs).take(LONGEST + 1).count();
        if !(1..=LONGEST).contains(&length) || name.get(length) != Some(&b'>') {
            return None;
        }
        let name = core::str::from_utf8(&name[..length]).ok()?;
        let number = name.strip_prefix('O').filter(|digits| (1..=8).contains(&digits.len()));
        let number = number.filter(|digits| digits.bytes().all(|byte| byte.is_ascii_digit()));
        let read = match number.and_then(|digits| digits.parse().ok()) {
            Some(number) => Self::Number(number),
            None => Self::Text(name.into()),
        };
        Some((read, length + 2))
    }

    /// Its number, where it has one.
    #[must_use]
    pub const fn number(&self) -> Option<u32> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Text(_) => None,
        }
    }

    /// As a file that is named after the program has it: the number without zeros before it, or the name in lower case.
    #[must_use]
    pub fn file_stem(&self) -> String {
        match self {
            Self::Number(number) => number.to_string(),
            Self::Text(name) => name.to_ascii_lowercase(),
        }
    }

    /// As a call names it: `P1000`, `<SHAFT-2>`.
    #[must_use]
    pub fn in_call(&self) -> String {
        match self {
            Self::Number(number) => format!("P{number}"),
            Self::Text(name) => format!("<{name}>"),
        }
    }
}

impl fmt::Display for ProgramName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(formatter, "O{number}"),
            Self::Text(name) => write!(formatter, "<{name}>"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_brackets_and_few_characters() {
        let read = |text: &str| ProgramName::read(text.as_bytes());
        assert_eq!(read("<SHAFT-2.A> L3"), Some((ProgramName::Text("SHAFT-2.A".into()), 11)));
        assert_eq!(read("<O0123>"), Some((ProgramName::Number(123), 7)));
        assert_eq!(read("<O>"), Some((ProgramName::Text("O".into()), 3)));
        assert_eq!(read("<O123456789>"), Some((ProgramName::Text("O123456789".into()), 12)));
        let longest = format!("<{}>", "A".repeat(LONGEST));
        assert_eq!(read(&longest).map(|(_, length)| length), Some(LONGEST + 2));
        let longer = format!("<{}>", "A".repeat(LONGEST + 1));
        for text in ["", "<>", "<A", "A>", "</A>", "<A B>", "<!--", "<?xml>", &longer] {
            assert_eq!(read(text), None, "{text}");
        }
    }
}
