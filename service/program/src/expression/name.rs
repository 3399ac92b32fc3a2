//! Names of parameters.

use core::fmt;

/// Longest name, bytes without blanks.
pub(crate) const LONGEST: usize = 63;

/// The name of a parameter: lower case, without blanks.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Name {
    text: [u8; LONGEST],
    length: u8,
}

impl Name {
    /// A name as written between `<` and `>`; `None` where nothing is left of it, where it is too long or not of printable ASCII.
    pub(crate) fn read(written: &[u8]) -> Option<Self> {
        let mut name = Self { text: [0; LONGEST], length: 0 };
        for byte in written.iter().filter(|byte| !matches!(byte, b' ' | b'\t')) {
            if !byte.is_ascii_graphic() {
                return None;
            }
            *name.text.get_mut(usize::from(name.length))? = byte.to_ascii_lowercase();
            name.length += 1;
        }
        (name.length > 0).then_some(name)
    }

    /// Its text.
    pub(crate) fn as_str(&self) -> &str {
        // Only printable ASCII was let in.
        core::str::from_utf8(&self.text[..usize::from(self.length)]).unwrap_or_default()
    }

    /// Whether it is known everywhere: it starts with `_`.
    pub(crate) const fn is_global(&self) -> bool {
        self.text[0] == b'_'
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}
