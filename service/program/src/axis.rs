//! Axis letters, planes and positions.

use serde::{Deserialize, Serialize};

/// Number of axes a program can address.
pub const AXIS_COUNT: usize = 9;

/// One value per [`Axis`], indexed by [`Axis::index`]: mm for linear axes, degrees for rotary ones.
pub type Position = [f64; AXIS_COUNT];

/// An axis letter of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[allow(missing_docs, reason = "the letters are the documentation")]
pub enum Axis {
    X,
    Y,
    Z,
    A,
    B,
    C,
    U,
    V,
    W,
}

impl Axis {
    /// Every axis in index order.
    pub const ALL: [Self; AXIS_COUNT] =
        [Self::X, Self::Y, Self::Z, Self::A, Self::B, Self::C, Self::U, Self::V, Self::W];

    /// Place of this axis in a [`Position`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The letter as written in a program.
    #[must_use]
    pub const fn letter(self) -> char {
        b"XYZABCUVW"[self as usize] as char
    }

    /// The axis of an upper- or lower-case letter.
    #[must_use]
    pub fn from_letter(letter: char) -> Option<Self> {
        let letter = letter.to_ascii_uppercase();
        Self::ALL.into_iter().find(|axis| axis.letter() == letter)
    }

    /// Whether values of this axis are degrees rather than millimetres.
    #[must_use]
    pub const fn is_rotary(self) -> bool {
        matches!(self, Self::A | Self::B | Self::C)
    }
}

/// Ways of linear axes below this, mm, are the rounding of computed positions: where rotary axes turn, these turn alone.
pub(crate) const LEAST_WAY_MM: f64 = 1e-8;

/// Way of some axes between two positions: the root of the squares' sum.
pub(crate) fn way_of(start: &Position, end: &Position, counts: impl Fn(Axis) -> bool) -> f64 {
    let square = |axis: Axis| (end[axis.index()] - start[axis.index()]).powi(2);
    Axis::ALL.into_iter().filter(|&axis| counts(axis)).map(square).sum::<f64>().sqrt()
}

/// Length of a straight move: of its linear axes, mm, or of the rotary ones, degrees, where no linear axis moves.
#[must_use]
pub fn straight_length(start: &Position, end: &Position) -> f64 {
    let linear = way_of(start, end, |axis| !axis.is_rotary());
    if linear > LEAST_WAY_MM {
        return linear;
    }
    let rotary = way_of(start, end, Axis::is_rotary);
    if rotary > 0.0 { rotary } else { linear }
}

/// Plane of circular motion (`G17`, `G18`, `G19`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Plane {
    /// `G17`
    Xy,
    /// `G18`
    Zx,
    /// `G19`
    Yz,
}

impl Plane {
    /// First and second axis of the plane, right-handed about [`Plane::normal`].
    #[must_use]
    pub const fn axes(self) -> (Axis, Axis) {
        match self {
            Self::Xy => (Axis::X, Axis::Y),
            Self::Zx => (Axis::Z, Axis::X),
            Self::Yz => (Axis::Y, Axis::Z),
        }
    }

    /// The axis perpendicular to the plane.
    #[must_use]
    pub const fn normal(self) -> Axis {
        match self {
            Self::Xy => Axis::Z,
            Self::Zx => Axis::Y,
            Self::Yz => Axis::X,
        }
    }
}
