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

    /// A subprogram of the O-word language, by its number or its name with or without `< >`.
    #[must_use]
    pub fn of_subprogram(name: &str) -> Self {
        let bare = name.trim_matches(['<', '>']);
        bare.parse().map_or_else(|_| Self::Text(bare.into()), Self::Number)
    }

    /// Whether a further file is named after it, in any folder and case: `O1000.nc`, `1000`; `rect.ngc`, `SHAFT-2.A`, `SHAFT-2.A.nc`.
    #[must_use]
    pub fn is_of_file(&self, path: &str) -> bool {
        let file = path.rsplit(['/', '\\']).next().unwrap_or(path).to_ascii_lowercase();
        match self {
            Self::Number(number) => {
                let (stem, name) = (file.split('.').next().unwrap_or_default(), number.to_string());
                stem == name || stem.strip_prefix('o').unwrap_or(stem).trim_start_matches('0') == name
            }
            Self::Text(name) => {
                let is_name = |text: &str| text.eq_ignore_ascii_case(name);
                is_name(&file) || file.rsplit_once('.').is_some_and(|(stem, _)| is_name(stem))
            }
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

    #[test]
    fn files_are_named_after_programs() {
        let number = ProgramName::Number;
        let text = |name: &str| ProgramName::Text(name.into());
        for (path, name) in [
            ("subs/O1000.nc", number(1_000)),
            ("1000", number(1_000)),
            ("a\\o0042.NC", number(42)),
            ("Rect.ngc", text("rect")),
            ("SHAFT-2.A", text("Shaft-2.A")),
            ("SHAFT-2.A.nc", text("SHAFT-2.A")),
            ("1000.nc", text("1000")),
            ("7.ngc", ProgramName::of_subprogram("7")),
            ("rect.ngc", ProgramName::of_subprogram("<rect>")),
        ] {
            assert!(name.is_of_file(path), "{path} {name}");
        }
        for (path, name) in [
            ("O10001.nc", number(1_000)),
            ("O1000.nc", text("1000")),
            ("O1000.nc", text("o100")),
            ("offset.nc", text("ffset")),
            ("PIN.A.nc", text("PIN")),
        ] {
            assert!(!name.is_of_file(path), "{path} {name}");
        }
    }
}
