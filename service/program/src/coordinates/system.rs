//! Names of work coordinate systems.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::Position;

/// Number of the first extended system less 1.
const EXTENDED: u16 = 100;

/// Most extended systems that any control has.
const MOST_EXTENDED: u16 = 300;

/// A work coordinate system: `G54` to `G59`, `G59.1` to `G59.3`, or one of the extended ones (`G54.1 P`, `G154 P`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct WorkSystem(u16);

impl WorkSystem {
    /// `G54`
    pub const FIRST: Self = Self(1);

    /// `G54` to `G59` for 1 to 6, `G59.1` to `G59.3` for 7 to 9.
    #[must_use]
    pub const fn plain(number: u16) -> Option<Self> {
        if number >= 1 && number <= 9 { Some(Self(number)) } else { None }
    }

    /// `G54.1 P` with this number, 1 to 300.
    #[must_use]
    pub const fn extended(number: u16) -> Option<Self> {
        if number >= 1 && number <= MOST_EXTENDED { Some(Self(EXTENDED + number)) } else { None }
    }

    /// 1 to 6 for `G54` to `G59`, 7 to 9 for `G59.1` to `G59.3`.
    #[must_use]
    pub const fn plain_number(self) -> Option<u16> {
        if self.0 < EXTENDED { Some(self.0) } else { None }
    }

    /// Its `P` where it is an extended one.
    #[must_use]
    pub const fn extended_number(self) -> Option<u16> {
        if self.0 > EXTENDED { Some(self.0 - EXTENDED) } else { None }
    }

    /// Its code in tenths, such as 540 for `G54`; 541 for every extended one.
    pub(crate) const fn tenths(self) -> u16 {
        match self.0 {
            number @ 1..=6 => 530 + 10 * number,
            number @ 7..=9 => 584 + number,
            _ => 541,
        }
    }
}

impl fmt::Display for WorkSystem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "G{}", f64::from(self.tenths()) / 10.0)?;
        self.extended_number().map_or(Ok(()), |number| write!(f, " P{number}"))
    }
}

/// Text that names no work coordinate system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownWorkSystem;

impl fmt::Display for UnknownWorkSystem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "must be G54 to G59, G59.1 to G59.3, or G54.1 P1 to P{MOST_EXTENDED}")
    }
}

impl std::error::Error for UnknownWorkSystem {}

impl FromStr for WorkSystem {
    type Err = UnknownWorkSystem;

    /// Reads a name as [`WorkSystem`] is shown, `G154 P7` for `G54.1 P7` as well; case and blanks do not count.
    fn from_str(text: &str) -> Result<Self, UnknownWorkSystem> {
        let text: String = text.chars().filter(|it| !it.is_whitespace()).collect::<String>().to_ascii_uppercase();
        let extended = text.strip_prefix("G54.1P").or_else(|| text.strip_prefix("G154P"));
        if let Some(number) = extended {
            return number.parse().ok().and_then(Self::extended).ok_or(UnknownWorkSystem);
        }
        (1..=9).filter_map(Self::plain).find(|system| system.to_string() == text).ok_or(UnknownWorkSystem)
    }
}

/// Where a work coordinate system lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WorkOffset {
    /// Its origin in machine coordinates, mm (X a radius) and degrees.
    pub offset: Position,
    /// Rotation about Z, degrees; LinuxCNC only (`G10 L2 R`).
    pub rotation_deg: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_shown() {
        let systems = (1..=9).filter_map(WorkSystem::plain).chain((1..=300).filter_map(WorkSystem::extended));
        for system in systems {
            assert_eq!(system.to_string().parse(), Ok(system));
        }
        assert_eq!("g59.3".parse(), Ok(WorkSystem(9)));
        assert_eq!("G154 P7".parse::<WorkSystem>().map(|it| it.to_string()), Ok("G54.1 P7".to_owned()));
        for wrong in ["", "G53", "G59.4", "G54.1", "G54.1 P0", "G54.1 P301", "54"] {
            assert_eq!(wrong.parse::<WorkSystem>(), Err(UnknownWorkSystem), "{wrong}");
        }
    }
}
