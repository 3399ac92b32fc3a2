//! Dialects as data: what each address letter and each G and M code means.
//!
//! A new dialect is a new [`Dialect`] table; the parser and the interpreter know letters and codes only by what
//! these tables say. Codes that a machine profile assigns to machining functions are merged in per interpreter.

mod code_table;
mod lathe;
mod machine_codes;
mod meaning;
mod tables;

use lathe::{LATHE, LATHE_B_AND_C};
use tables::{COMMON_G_CODES, COMMON_M_CODES, LINUXCNC, MILL};

pub(crate) use code_table::{CodeTable, carries_out_g_code, knows_m_code};
pub(crate) use meaning::{Code, FeedUnit, GROUP_COUNT, Group, Meaning, OtherReading};

pub(crate) use machine_codes::{MachineAction, MachineRule, MachineStep};
pub(crate) use tables::{FunctionWordRule, function_words};

use crate::expression::Rules;
use crate::parameters::Ranges;
use crate::{Axis, DialectName, GCodeSystem, LanguageSettings};

/// The language of control flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flow {
    /// `IF`, `GOTO`, `WHILE`; programs by number (`O1000`), macro calls (`G65`).
    MacroB,
    /// `o100 while`, `o<name> call`.
    OWords,
}

/// What differs between dialects in the order in which the words of one block take effect.
///
/// Common to all, whatever the order of the words: feed mode (`G93`–`G95`), feed (`F`), tool (`T`, `M6`), speed clamp, spindle speed
/// mode and speed (`G96`, `G97`, `S`), `M3` and `M4`, `M7` and `M8`, dwell (`G4`), plane, path control, work offset, distance mode
/// (`G90`, `G91`), tool length (`G43`), tilted plane, machining function, reference position (`G28`), motion, stop or end. So `G91`,
/// `G54` and `G43` hold for the motion of their own block, `M3` is in force before it, and `G4` waits before it.
#[derive(Debug)]
pub(crate) struct Order {
    /// The unit (`G20`, `G21`) is in force before the feed and the speed of its block; otherwise directly behind them, before the
    /// dwell. Lengths of axes and curves are in the new unit in either case, as are those of a machining function.
    pub(crate) unit_before_feed: bool,
    /// `M5` and `M9` take effect behind the motion of their block instead of before it.
    pub(crate) stops_after_motion: bool,
    /// Each word of a feed mode takes the feed before it out of force, even one that changes nothing.
    pub(crate) feed_mode_clears_feed: bool,
}

impl Order {
    /// FANUC and Haas: the unit first; the builder chooses when `M5` and `M9` act, usually behind the motion.
    const FANUC: Self = Self { unit_before_feed: true, stops_after_motion: true, feed_mode_clears_feed: false };

    /// LinuxCNC, as its handbook lists it and its interpreter does: the unit takes effect behind feed and speed, so that `G20 F6`
    /// under `G21` is 6 mm/min.
    const LINUXCNC: Self = Self { unit_before_feed: false, stops_after_motion: false, feed_mode_clears_feed: true };
}

/// What an address letter means outside the blocks of machining functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Letter {
    Unknown,
    /// `G` and `M`: their words are codes.
    Code,
    /// Line and program numbers: labels that move nothing.
    Label,
    Axis(Axis),
    /// Always incremental: a lathe's `U` and `W`.
    Increment(Axis),
    /// `I J K`: centre relative to the start along X, Y, Z, always a radius value.
    Centre(u8),
    /// `R`
    Radius,
    Feed,
    Speed,
    Tool,
    /// Known parameters of codes (`P`, `Q`, `D`, `H` and so on): unused unless the block's code takes them.
    Parameter,
}

impl Letter {
    /// Whether its word places this axis.
    pub(crate) fn is_of(self, wanted: Axis) -> bool {
        matches!(self, Self::Axis(axis) | Self::Increment(axis) if axis == wanted)
    }

    /// Whether its number is a length (mm or inch), which units and the decimal-point rule scale.
    pub(crate) const fn is_length(self) -> bool {
        match self {
            Self::Axis(axis) | Self::Increment(axis) => !axis.is_rotary(),
            Self::Centre(_) | Self::Radius => true,
            _ => false,
        }
    }
}

/// Bit of an upper-case letter in a mask of letters.
#[inline]
pub(crate) const fn letter_bit(letter: u8) -> u32 {
    debug_assert!(letter.is_ascii_uppercase());
    // Without checks of the distance, since it is asked of every word.
    1u32.wrapping_shl(letter.wrapping_sub(b'A') as u32)
}

/// The tables of one dialect.
#[derive(Debug)]
pub(crate) struct Dialect {
    /// Meaning of each letter from A to Z.
    pub(crate) letters: [Letter; 26],
    /// Lists of its own G codes; a later entry wins over an earlier one and over the common ones.
    g_codes: &'static [&'static [Code]],
    m_codes: &'static [&'static [Code]],
    /// A `T` word changes the tool at once, its last two digits being the offset; otherwise `M6` does.
    pub(crate) tool_word_changes: bool,
    /// LinuxCNC's reading of what has no setting of its own: turns and tolerances of arcs, requests of path control, what a
    /// dwell goes with, active comments, and that a program has an end.
    pub(crate) is_linuxcnc: bool,
    /// Words with a comma: `,C`, `,R` and `,A`.
    pub(crate) takes_comma_words: bool,
    /// Chamfers and roundings of a line along one axis are also written without a comma, with a sign: `R`, `I`, `K`.
    pub(crate) plain_corners: bool,
    /// A tool change stops the spindle and leaves the tool selected.
    pub(crate) tool_stays_selected: bool,
    /// Most M codes in a block.
    pub(crate) max_m_codes: u8,
    /// The dialect knows all of its M codes, so that an unlisted one is no code of the machine.
    pub(crate) m_codes_closed: bool,
    /// `U` in a dwell is a time like `X`.
    pub(crate) dwell_takes_u: bool,
    /// The `F` of a threading block is its lead; otherwise it is a feed, and leads have letters of their own.
    pub(crate) f_is_lead: bool,
    pub(crate) flow: Flow,
    pub(crate) order: Order,
    /// How expressions are read.
    pub(crate) expressions: &'static Rules,
    /// Which parameters there are.
    pub(crate) parameters: &'static Ranges,
}

impl Dialect {
    fn of(settings: &LanguageSettings) -> &'static Self {
        match (settings.dialect, settings.g_code_system) {
            (DialectName::Lathe, Some(GCodeSystem::B | GCodeSystem::C)) => &LATHE_B_AND_C,
            (DialectName::Lathe, _) => &LATHE,
            (DialectName::Mill, _) => &MILL,
            (DialectName::LinuxCnc, _) => &LINUXCNC,
        }
    }

    /// Its G codes, later ones winning.
    fn g_codes(&self) -> impl Iterator<Item = &'static Code> + use<> {
        core::iter::once(&COMMON_G_CODES).chain(self.g_codes).flat_map(|codes| codes.iter())
    }

    /// Its M codes, later ones winning.
    fn m_codes(&self) -> impl Iterator<Item = &'static Code> + use<> {
        core::iter::once(&COMMON_M_CODES).chain(self.m_codes).flat_map(|codes| codes.iter())
    }

    /// Every letter of the axes that absolute words among these letters place.
    pub(crate) fn letters_placed_by(&self, letters: u32) -> u32 {
        let axis_at = |place: usize| match self.letters[place] {
            Letter::Axis(axis) | Letter::Increment(axis) => Some(axis),
            _ => None,
        };
        let is_absolute =
            |place: &usize| matches!(self.letters[*place], Letter::Axis(_)) && letters & (1 << place) != 0;
        let placed = |axis| (0..26).filter(is_absolute).any(|place| axis_at(place) == Some(axis));
        (0..26).filter(|&place| axis_at(place).is_some_and(placed)).fold(0, |mask, place| mask | 1 << place)
    }

    /// Mask of the letters that name an axis.
    fn axis_letters(&self) -> u32 {
        self.letters_that(|letter| matches!(letter, Letter::Axis(_) | Letter::Increment(_)))
    }

    /// Mask of the letters that say where a linear axis goes, or how far.
    fn linear_letters(&self) -> u32 {
        self.letters_that(|letter| matches!(letter, Letter::Axis(axis) | Letter::Increment(axis) if !axis.is_rotary()))
    }

    /// Mask of the letters whose words are a number and no more, line numbers among them: no codes, no program numbers.
    fn value_letters(&self) -> u32 {
        self.letters_that(|letter| !matches!(letter, Letter::Unknown | Letter::Code)) & !letter_bit(b'O')
    }

    fn letters_that(&self, is_meant: impl Fn(&Letter) -> bool) -> u32 {
        let bits = self.letters.iter().enumerate().map(|(place, letter)| u32::from(is_meant(letter)) << place);
        bits.sum()
    }
}
