//! Dialects as data: what each address letter and each G and M code means.
//!
//! A new dialect is a new [`Dialect`] table; the parser and the interpreter know letters and codes only by what
//! these tables say. Codes that a machine profile assigns to machining functions are merged in per interpreter.

mod lathe;
mod machine_codes;
mod tables;

use lathe::{LATHE, LATHE_B_AND_C, system_codes};
use tables::{COMMON_G_CODES, COMMON_M_CODES, LINUXCNC, MILL, code};

pub(crate) use machine_codes::{MachineAction, MachineRule, MachineStep};
pub(crate) use tables::{FunctionWordRule, function_words};

use crate::expression::Rules;
use crate::parameters::Ranges;
use crate::state::{Cycle, TurningCycle};
use crate::{
    Axis, DialectName, Function, FunctionCodes, GCodeSystem, LanguageSettings, PathControlMode, Plane, WorkSystem,
    XWord,
};

/// A modal group: a block may hold at most one code of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Group {
    Motion,
    NonModal,
    Plane,
    Units,
    Distance,
    ArcDistance,
    Diameter,
    FeedUnit,
    SpeedMode,
    CutterCompensation,
    LengthCompensation,
    Cycle,
    CycleReturn,
    WorkOffset,
    PathControl,
    PolarCoordinates,
    Scaling,
    Rotation,
    Mirror,
    MacroCall,
    Function,
    Stop,
    ToolChange,
    Spindle,
    Coolant,
    Tapping,
    Overrides,
    /// LinuxCNC's outputs and inputs.
    Signal,
    /// LinuxCNC's `M100` to `M199`.
    UserCode,
    Subprogram,
}

/// Number of modal groups.
pub(crate) const GROUP_COUNT: usize = Group::Subprogram as usize + 1;

impl Group {
    /// The group's name in messages.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Motion => "motion",
            Self::NonModal => "one-block",
            Self::Plane => "plane",
            Self::Units => "unit",
            Self::Distance => "distance mode",
            Self::ArcDistance => "arc distance mode",
            Self::Diameter => "diameter mode",
            Self::Overrides => "override",
            Self::FeedUnit => "feed mode",
            Self::SpeedMode => "spindle speed mode",
            Self::CutterCompensation => "cutter compensation",
            Self::LengthCompensation => "length compensation",
            Self::Cycle => "cycle",
            Self::CycleReturn => "cycle return",
            Self::WorkOffset => "work offset",
            Self::PathControl => "path control",
            Self::PolarCoordinates => "polar coordinate",
            Self::Scaling => "scaling",
            Self::Rotation => "rotation",
            Self::Mirror => "mirror image",
            Self::MacroCall => "macro call",
            Self::Function => "machining function",
            Self::Stop => "stop",
            Self::ToolChange => "tool change",
            Self::Spindle => "spindle",
            Self::Coolant => "coolant",
            Self::Tapping => "tapping",
            Self::Signal => "output",
            Self::UserCode => "user",
            Self::Subprogram => "subprogram",
        }
    }
}

/// Unit of the modal feed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) enum FeedUnit {
    PerMinute,
    PerRevolution,
    InverseTime,
}

/// What a code does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Meaning {
    Rapid,
    Linear,
    Arc {
        clockwise: bool,
    },
    /// `G5`
    CubicSpline,
    /// `G5.1`
    QuadraticSpline,
    /// `G5.2`: opens a NURBS or adds to it.
    Nurbs,
    /// `G5.3`
    NurbsEnd,
    Dwell,
    /// `G9`
    ExactStop,
    PathControl(PathControlMode),
    Plane(Plane),
    Units {
        inch: bool,
    },
    /// `G28`
    Reference,
    /// `G30`
    FurtherReference,
    /// `G29`
    ReferenceReturn,
    /// `G28.1`, `G30.1`
    StoreReference {
        second: bool,
    },
    MachineCoordinates,
    WorkOffset(WorkSystem),
    /// `G54.1 P`, and `G154 P` of Haas controls.
    ExtendedWorkOffset {
        haas: bool,
    },
    /// `G110` to `G129` of Haas controls.
    HaasWorkOffset(WorkSystem),
    /// `G52`
    LocalShift,
    /// `G92` of LinuxCNC.
    ShiftSet,
    /// `G92.1`, and `G92.2` that keeps what `G92.3` restores.
    ShiftClear {
        keeps: bool,
    },
    /// `G92.3`
    ShiftRestore,
    /// `G92.1` on FANUC controls.
    Preset,
    /// `G10`
    DataSetting,
    /// `G11`
    DataSettingEnd,
    /// `G16` and `G15`.
    Polar {
        on: bool,
    },
    /// `G51` and `G50` on mills.
    Scaling {
        on: bool,
    },
    /// `G51.1` and `G50.1`.
    Mirror {
        on: bool,
    },
    /// `G101` and `G100` of Haas controls.
    HaasMirror {
        on: bool,
    },
    /// `G68`
    Rotation,
    /// `G43`, and `G44` with the length subtracted.
    LengthCompensation {
        negative: bool,
    },
    /// `G43.1` and, added to what is in force, `G43.2`.
    LengthOffset {
        adds: bool,
    },
    /// `G43.4` with angles, `G43.5` with vectors.
    ToolControl {
        vectors: bool,
    },
    /// `G49`, for the length as well.
    ToolControlOff,
    /// `G68.2`
    TiltedPlane,
    /// `G69`
    RotationOff,
    /// `G53.1`
    AlignTool {
        /// The tool centre point rests on the work (`G53.6`), instead of the linear axes (`G53.1`).
        about_tip: bool,
    },
    /// `G40`
    CompensationOff,
    /// `G41`, `G42` by the number of a tool offset, `G41.1`, `G42.1` by words.
    Compensation {
        left: bool,
        by_words: bool,
    },
    Distance {
        absolute: bool,
    },
    /// `G90.1`, `G91.1`: centres of arcs from the origin or from the start.
    ArcDistance {
        absolute: bool,
    },
    /// `G62`, `G63`: cutting with overrides that the machine chooses.
    CuttingMode,
    /// `G8`
    LookAhead,
    /// `G187`
    Smoothness,
    /// `G103` of Haas controls: how many blocks are read ahead, which changes no path.
    BlockLimit,
    /// `G31`, `G36`, `G37`: a move to a contact, for its block only.
    Skip,
    /// `G38.2` to `G38.5`: moves to or from a contact.
    Probe,
    /// `G7`, `G8`
    XWord(XWord),
    Feed(FeedUnit),
    SpeedMode {
        surface: bool,
    },
    /// `G50` of a lathe, `G92` of a mill: with S alone the speed clamp, with axis words the setting of coordinates.
    SpeedClamp,
    /// A lathe's `G92`: the speed clamp with `S` alone, otherwise a threading cycle.
    SpeedClampOrThreadCycle,
    /// `G32`, `G33`
    Thread,
    /// `G34`: a thread whose lead changes.
    VariableLead,
    /// A lathe's `G76`, in one of its three forms.
    ThreadCycles,
    /// The threading cycle of G-code systems B and C, which `G92` is in system A.
    ThreadCycle,
    /// A turning, facing or grooving cycle.
    Turning(TurningCycle),
    /// A cycle whose meaning depends on the G-code system of the lathe, which the profile does not name: what it is in which.
    OfNoSystem(&'static str),
    /// A code of another G-code system than the lathe's: what it is there.
    OfOtherSystem(&'static str),
    /// A drilling, boring or tapping cycle.
    Drill(Cycle),
    /// `G80`
    CycleEnd,
    /// `G98`, `G99` where they are the level to which cycles return.
    CycleReturn {
        to_r: bool,
    },
    /// `G33.1`
    RigidTap,
    Function {
        function: Function,
        on: bool,
    },
    /// One code switches the function on and off by its `P` word.
    FunctionSwitch(Function),
    Stop {
        optional: bool,
    },
    End,
    Spindle(crate::SpindleDirection),
    ToolChange,
    Mist,
    Flood,
    CoolantOff,
    /// `M98`, `M198`
    Call,
    /// `M97`
    LocalCall,
    /// `M99`
    Return,
    /// `G65`, and `G66` for every block that moves.
    MacroCall {
        modal: bool,
    },
    /// `G67`
    MacroCallEnd,
    /// States what is the case anyway; every post writes these in its safety line.
    AlreadySo,
    /// A known code whose effect is not carried out yet: what it is, for the finding.
    Unsupported(&'static str),
}

impl Meaning {
    /// Whether the code is of this dialect and does what it says.
    const fn is_carried_out(self) -> bool {
        !matches!(self, Self::Unsupported(_) | Self::VariableLead | Self::OfNoSystem(_) | Self::OfOtherSystem(_))
    }
}

/// One code of a dialect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Code {
    /// Code number in tenths: `G43.4` is 434.
    pub(crate) tenths: u16,
    pub(crate) group: Group,
    pub(crate) meaning: Meaning,
    /// What another control of this kind makes of the code where axis words follow it.
    pub(crate) other_reading: Option<&'static OtherReading>,
}

/// A second reading of a code with axis words that a dialect cannot rule out: then nothing moves on a guess.
#[derive(Debug, PartialEq)]
pub(crate) struct OtherReading {
    /// What the code is without axis words.
    pub(crate) here: &'static str,
    /// What else it may be with them.
    pub(crate) elsewhere: &'static str,
    /// The other reading is that of G-code system A, which a program with codes of other systems is not written in.
    pub(crate) of_system_a: bool,
    /// The other reading is a motion code, so that of it and a motion code in one block the later one counts: a motion code behind
    /// it settles the matter, one before it does not. Otherwise any motion code in the block settles it.
    pub(crate) is_motion: bool,
    /// Without axis words in its block, it is in force for the blocks behind it until the next motion code.
    pub(crate) stays: bool,
}

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

/// Bit of a letter in a mask of letters.
pub(crate) const fn letter_bit(letter: u8) -> u32 {
    1 << (letter - b'A')
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

    /// Whether it has tool centre point control, without which nothing is thinned.
    fn has_tool_control(&self) -> bool {
        self.g_codes().any(|code| matches!(code.meaning, Meaning::ToolControl { .. }))
    }

    /// Mask of the letters that name an axis.
    fn axis_letters(&self) -> u32 {
        let names_axis = |letter: &Letter| matches!(letter, Letter::Axis(_) | Letter::Increment(_));
        let bits = self.letters.iter().enumerate().map(|(place, letter)| u32::from(names_axis(letter)) << place);
        bits.sum()
    }
}

/// Codes from this number of tenths on are unknown.
const CODE_TENTHS: usize = 10_000;

/// Marks a number without a code.
const NO_CODE: u8 = u8::MAX;

/// The codes of one interpreter: its dialect's, with the profile's function codes merged in, found by index.
#[derive(Clone, Debug)]
pub(crate) struct CodeTable {
    pub(crate) dialect: &'static Dialect,
    /// Mask of the letters that name an axis.
    pub(crate) axis_letters: u32,
    codes: Vec<Code>,
    /// M codes of the machine, ascending.
    machine: Vec<MachineRule>,
    /// Place in `codes` by number in tenths, G codes first, then M codes.
    index: Box<[u8]>,
}

impl CodeTable {
    pub(crate) fn new(settings: &LanguageSettings) -> Self {
        let dialect = Dialect::of(settings);
        let thread_vibration = Meaning::FunctionSwitch(Function::ThreadVibration);
        let functions = function_codes(Function::PathVibration, settings.path_vibration)
            .chain(function_codes(Function::ToolOscillation, settings.tool_oscillation))
            .chain(function_code(settings.thread_vibration.code, thread_vibration));
        let thins = dialect.has_tool_control();
        let switches = function_codes(Function::Thinning, settings.thinning).filter(move |_| thins);
        let angles = if settings.plain_drawing_words { letter_bit(b'A') | letter_bit(b'C') } else { 0 };
        let mut table = Self {
            dialect,
            axis_letters: dialect.axis_letters() & !angles,
            codes: Vec::new(),
            machine: machine_codes::rules(settings),
            index: vec![NO_CODE; 2 * CODE_TENTHS].into_boxed_slice(),
        };
        // The profile's own codes come last, so that they win over a dialect's.
        let system = system_codes(settings).iter().copied();
        table.add(b'G', dialect.g_codes().copied().chain(system).chain(functions));
        table.add(b'M', dialect.m_codes().copied().chain(switches));
        table
    }

    fn add(&mut self, letter: u8, codes: impl Iterator<Item = Code>) {
        for code in codes {
            self.index[first_index(letter) + usize::from(code.tenths)] = self.codes.len() as u8;
            self.codes.push(code);
        }
    }

    /// Place of the code `G` or `M` with this number, for [`CodeTable::code`].
    #[inline]
    pub(crate) fn find(&self, letter: u8, number: f64) -> Option<u8> {
        let place = self.index[first_index(letter) + tenths(number)?];
        (place != NO_CODE).then_some(place)
    }

    /// The code at a place that [`CodeTable::find`] gave.
    #[inline]
    pub(crate) fn code(&self, place: u8) -> &Code {
        &self.codes[usize::from(place)]
    }

    /// The M code of the machine with this number.
    pub(crate) fn machine_rule(&self, number: f64) -> Option<&MachineRule> {
        let place = self.machine.binary_search_by(|rule| f64::from(rule.number).total_cmp(&number)).ok()?;
        Some(&self.machine[place])
    }

    /// A code of a group as it is written, such as `G28`.
    pub(crate) fn name(&self, group: Group, place: u8) -> String {
        let number = f64::from(self.code(place).tenths) / 10.0;
        let letter = if matches!(group, Group::ToolChange | Group::Overrides | Group::Subprogram) { 'M' } else { 'G' };
        format!("{letter}{number}")
    }

    /// The supported codes of this letter, ascending, for suggestions.
    pub(crate) fn supported(&self, letter: u8) -> String {
        let places = &self.index[first_index(letter)..][..CODE_TENTHS];
        let known = places.iter().filter_map(|&place| self.codes.get(usize::from(place)));
        let supported = known.filter(|code| code.meaning.is_carried_out());
        let names = supported.map(|code| format!("{}{}", char::from(letter), f64::from(code.tenths) / 10.0));
        names.collect::<Vec<_>>().join(" ")
    }
}

/// Whether a dialect, apart from the profile's function codes, carries out the G code of this number.
pub(crate) fn carries_out_g_code(settings: &LanguageSettings, number: f64) -> bool {
    let codes = Dialect::of(settings).g_codes().chain(system_codes(settings));
    let Some(number) = tenths(number) else { return false };
    let last = codes.filter(|code| usize::from(code.tenths) == number).last();
    last.is_some_and(|code| code.meaning.is_carried_out())
}

/// The codes by which a profile switches a machining function.
fn function_codes(function: Function, codes: FunctionCodes) -> impl Iterator<Item = Code> {
    [(codes.on, true), (codes.off, false)]
        .into_iter()
        .filter_map(move |(number, on)| function_code(number, Meaning::Function { function, on }))
}

/// A profile's code, which may have come through arithmetic; the nearest tenth is meant.
fn function_code(number: f64, meaning: Meaning) -> Option<Code> {
    let number = (number * 10.0).round() / 10.0;
    tenths(number).map(|tenths| code(tenths as u16, Group::Function, meaning))
}

/// Whether a dialect, apart from any profile's function codes, knows the M code of this number.
pub(crate) fn knows_m_code(dialect: DialectName, number: f64) -> bool {
    let mut codes = Dialect::of(&LanguageSettings { dialect, ..LanguageSettings::default() }).m_codes();
    tenths(number).is_some_and(|number| codes.any(|code| usize::from(code.tenths) == number))
}

/// Where the codes of a letter begin in the index.
#[inline]
const fn first_index(letter: u8) -> usize {
    if letter == b'G' { 0 } else { CODE_TENTHS }
}

/// A code number in tenths, if it has at most one decimal place and is in range.
#[inline]
fn tenths(number: f64) -> Option<usize> {
    // (k/10)·10 = k exactly for every whole k, as 10 is a sum of two powers of two.
    let scaled = number * 10.0;
    let whole = scaled as u32;
    let index = whole as usize;
    (f64::from(whole) == scaled && index < CODE_TENTHS).then_some(index)
}

#[cfg(test)]
mod tests;
