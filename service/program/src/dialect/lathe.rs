//! The tables of lathes: what all of them share, and the codes of each G-code system.

use super::tables::{
    COMMON_LETTERS, FANUC_G_CODES, FANUC_M_CODES, FANUC_M_CODES_IN_A_BLOCK, HAAS_MILL_G_CODES, code, doubtful,
    unsupported, with_letters,
};
use super::{Code, Dialect, FeedUnit, Flow, Group, Letter, Meaning, Order, OtherReading};
use crate::GCodeSystem::{A, B, C};
use crate::state::{Pockets, TurningCycle};
use crate::{Axis, DialectName, GCodeSystem, LanguageSettings, expression, parameters};

/// `G90` of G-code system A.
static TURNING_CYCLE: OtherReading = OtherReading {
    here: "absolute coordinates",
    elsewhere: "the turning cycle (G-code system A)",
    of_system_a: true,
    is_motion: true,
    stays: true,
};

/// `G94` of G-code system A.
static FACING_CYCLE: OtherReading = OtherReading {
    here: "feed per minute",
    elsewhere: "the facing cycle (G-code system A)",
    of_system_a: true,
    is_motion: true,
    stays: true,
};

/// `G20` of G-code system C. Alone in a block it is no cycle, and systems A and B agree on it.
static TURNING_CYCLE_C: OtherReading = OtherReading {
    here: "inches",
    elsewhere: "the turning cycle (G-code system C)",
    of_system_a: false,
    is_motion: true,
    stays: false,
};

/// `G21` of G-code system C.
static THREADING_CYCLE_C: OtherReading = OtherReading {
    here: "millimetres",
    elsewhere: "the threading cycle (G-code system C)",
    of_system_a: false,
    is_motion: true,
    stays: false,
};

/// A lathe of G-code system A, or of one that the profile does not name.
pub(super) static LATHE: Dialect = lathe(with_letters(
    COMMON_LETTERS,
    [
        (b'U', Letter::Increment(Axis::X)),
        (b'V', Letter::Increment(Axis::Y)),
        (b'W', Letter::Increment(Axis::Z)),
        (b'H', Letter::Increment(Axis::C)),
        // Threads per inch, or a lead, and a length in cycles.
        (b'E', Letter::Parameter),
    ],
));

/// A lathe of G-code system B or C, where `G91` makes words incremental, and `U` and `W` belong to cycles only.
pub(super) static LATHE_B_AND_C: Dialect = lathe(with_letters(
    COMMON_LETTERS,
    [
        (b'U', Letter::Parameter),
        (b'V', Letter::Parameter),
        (b'W', Letter::Parameter),
        (b'H', Letter::Parameter),
        (b'E', Letter::Parameter),
    ],
));

const fn lathe(letters: [Letter; 26]) -> Dialect {
    Dialect {
        letters,
        g_codes: &[FANUC_G_CODES, LATHE_G_CODES],
        m_codes: &[FANUC_M_CODES, LATHE_M_CODES],
        tool_word_changes: true,
        is_linuxcnc: false,
        takes_comma_words: true,
        plain_corners: true,
        tool_stays_selected: false,
        max_m_codes: FANUC_M_CODES_IN_A_BLOCK,
        m_codes_closed: false,
        dwell_takes_u: true,
        f_is_lead: true,
        flow: Flow::MacroB,
        order: Order::FANUC,
        expressions: &expression::FANUC,
        parameters: &parameters::FANUC,
    }
}

/// The T word has changed the tool already; some posts write M6 after it all the same.
const LATHE_M_CODES: &[Code] = &[code(60, Group::ToolChange, Meaning::AlreadySo)];

const LATHE_G_CODES: &[Code] = &[
    doubtful(200, Group::Units, Meaning::Units { inch: true }, &TURNING_CYCLE_C),
    doubtful(210, Group::Units, Meaning::Units { inch: false }, &THREADING_CYCLE_C),
    code(240, Group::Motion, Meaning::OfNoSystem("the facing cycle of G-code system C")),
    code(250, Group::NonModal, Meaning::AlreadySo),
    unsupported(260, "the detection of a spindle whose speed varies"),
    code(320, Group::Motion, Meaning::Thread),
    code(340, Group::Motion, Meaning::VariableLead),
    code(360, Group::NonModal, Meaning::Skip),
    code(370, Group::NonModal, Meaning::Skip),
    code(430, Group::LengthCompensation, Meaning::Unsupported("tool length compensation")),
    code(440, Group::LengthCompensation, Meaning::Unsupported("tool length compensation")),
    code(434, Group::LengthCompensation, Meaning::Unsupported("tool centre point control")),
    code(490, Group::LengthCompensation, Meaning::AlreadySo),
    code(500, Group::NonModal, Meaning::SpeedClamp),
    code(503, Group::NonModal, Meaning::Preset),
    code(700, Group::Motion, Meaning::Turning(TurningCycle::Finish)),
    code(710, Group::Motion, Meaning::Turning(TurningCycle::Turn(Pockets::All))),
    code(720, Group::Motion, Meaning::Turning(TurningCycle::Face(Pockets::All))),
    code(730, Group::Motion, Meaning::Turning(TurningCycle::Pattern)),
    code(740, Group::Motion, Meaning::Turning(TurningCycle::FaceGroove)),
    code(750, Group::Motion, Meaning::Turning(TurningCycle::Groove)),
    code(760, Group::Motion, Meaning::ThreadCycles),
    code(770, Group::Motion, Meaning::OfNoSystem("the turning cycle of G-code system B, and the grooving cycle of C")),
    code(
        780,
        Group::Motion,
        Meaning::OfNoSystem("the threading cycle of G-code system B, and the multiple threading cycle of C"),
    ),
    code(790, Group::Motion, Meaning::OfNoSystem("the facing cycle of G-code system B")),
    code(680, Group::Rotation, Meaning::Unsupported("the mirror image of double turrets, or balanced cutting")),
    code(690, Group::Rotation, Meaning::AlreadySo),
    code(1_120, Group::PolarInterpolation, Meaning::Unsupported("polar coordinate interpolation")),
    code(1_130, Group::PolarInterpolation, Meaning::AlreadySo),
    code(140, Group::PolarCoordinates, Meaning::Unsupported("swapping the spindles of Haas lathes")),
    code(150, Group::PolarCoordinates, Meaning::AlreadySo),
    code(1_000, Group::Mirror, Meaning::AlreadySo),
    code(1_010, Group::Mirror, Meaning::Unsupported("the mirror image of Haas lathes")),
    code(1_030, Group::NonModal, Meaning::BlockLimit),
    unsupported(1_070, "cylindrical interpolation"),
    unsupported(1_050, "the bar feeder of Haas lathes"),
    code(1_560, Group::Motion, Meaning::Unsupported("broaching on Haas lathes")),
    code(1_840, Group::Motion, Meaning::Unsupported("tapping of left-hand threads on Haas lathes")),
    code(1_860, Group::Motion, Meaning::Unsupported("tapping of left-hand threads with live tools on Haas lathes")),
    code(1_950, Group::Motion, Meaning::Unsupported("radial tapping with live tools on Haas lathes")),
    code(
        1_960,
        Group::Motion,
        Meaning::Unsupported("radial tapping of left-hand threads with live tools on Haas lathes"),
    ),
    unsupported(1_980, "the end of synchronous spindles of Haas lathes"),
    unsupported(1_990, "synchronous spindles of Haas lathes"),
    code(2_410, Group::Motion, Meaning::Unsupported("radial drilling on Haas lathes")),
    code(2_420, Group::Motion, Meaning::Unsupported("radial spot drilling on Haas lathes")),
    code(2_430, Group::Motion, Meaning::Unsupported("radial peck drilling on Haas lathes")),
    code(2_450, Group::Motion, Meaning::Unsupported("radial boring on Haas lathes")),
    code(2_460, Group::Motion, Meaning::Unsupported("radial boring with a stop on Haas lathes")),
    code(2_470, Group::Motion, Meaning::Unsupported("radial boring with retraction by hand on Haas lathes")),
    code(
        2_480,
        Group::Motion,
        Meaning::Unsupported("radial boring with a dwell and retraction by hand on Haas lathes"),
    ),
    code(2_490, Group::Motion, Meaning::Unsupported("radial boring with a dwell on Haas lathes")),
    doubtful(900, Group::Distance, Meaning::Distance { absolute: true }, &TURNING_CYCLE),
    code(920, Group::NonModal, Meaning::SpeedClampOrThreadCycle),
    doubtful(940, Group::FeedUnit, Meaning::Feed(FeedUnit::PerMinute), &FACING_CYCLE),
    code(980, Group::CycleReturn, Meaning::FeedOrReturn { to_r: false }),
    code(990, Group::CycleReturn, Meaning::FeedOrReturn { to_r: true }),
];

/// What Haas lathes have in the place of codes of FANUC's systems.
const HAAS_LATHE_G_CODES: &[Code] = &[
    code(50, Group::Motion, Meaning::Unsupported("fine spindle control on Haas lathes")),
    code(950, Group::Motion, Meaning::Unsupported("rigid tapping with live tools on Haas lathes")),
];

/// The G codes of a control that is one of Haas, which come behind all others.
pub(super) fn haas_codes(settings: &LanguageSettings) -> &'static [Code] {
    match settings.dialect {
        DialectName::Lathe if settings.is_haas() => HAAS_LATHE_G_CODES,
        DialectName::Mill if settings.is_haas() => HAAS_MILL_G_CODES,
        _ => &[],
    }
}

/// The G codes that the G-code system named by a lathe's profile reads differently, after which those of [`LATHE_G_CODES`]
/// count.
pub(super) fn system_codes(settings: &LanguageSettings) -> &'static [Code] {
    match (settings.dialect, settings.g_code_system) {
        (DialectName::Lathe, Some(A)) => SYSTEM_A,
        (DialectName::Lathe, Some(B)) => SYSTEM_B,
        (DialectName::Lathe, Some(C)) => SYSTEM_C,
        _ => &[],
    }
}

const INCH: Meaning = Meaning::Units { inch: true };
const MILLIMETRE: Meaning = Meaning::Units { inch: false };
const TURN: Meaning = Meaning::Turning(TurningCycle::Turn(Pockets::All));
const FACE: Meaning = Meaning::Turning(TurningCycle::Face(Pockets::All));
const SINGLE_TURN: Meaning = Meaning::Turning(TurningCycle::SingleTurn);
const SINGLE_FACE: Meaning = Meaning::Turning(TurningCycle::SingleFace);

/// A code of other G-code systems, which the lathe's own writes as `here` says.
const fn of_other(what: &'static str, systems: &'static [GCodeSystem], here: &'static str) -> Meaning {
    Meaning::OfOtherSystem { what, systems, here }
}

const SYSTEM_A: &[Code] = &[
    code(200, Group::Units, INCH),
    code(210, Group::Units, MILLIMETRE),
    code(240, Group::Motion, of_other("the facing cycle", &[C], "A G94")),
    code(330, Group::Motion, of_other("the thread", &[B, C], "A G32")),
    code(770, Group::Motion, of_other("the turning cycle", &[B], "A G90")),
    code(780, Group::Motion, of_other("the threading cycle", &[B], "A G92")),
    code(790, Group::Motion, of_other("the facing cycle", &[B], "A G94")),
    code(900, Group::Motion, SINGLE_TURN),
    code(910, Group::Distance, of_other("the incremental mode", &[B, C], "A words U and W")),
    code(940, Group::Motion, SINGLE_FACE),
    code(950, Group::FeedUnit, of_other("the feed per revolution", &[B, C], "A G99")),
    code(980, Group::FeedUnit, Meaning::Feed(FeedUnit::PerMinute)),
    code(990, Group::FeedUnit, Meaning::Feed(FeedUnit::PerRevolution)),
];

const SYSTEM_B: &[Code] = &[
    code(200, Group::Units, INCH),
    code(210, Group::Units, MILLIMETRE),
    code(240, Group::Motion, of_other("the facing cycle", &[C], "B G79")),
    code(320, Group::Motion, of_other("the thread", &[A], "B and C G33")),
    code(500, Group::NonModal, of_other("the speed clamp", &[A], "B G92")),
    code(503, Group::NonModal, of_other("the preset of coordinates", &[A], "B and C G92.1")),
    code(770, Group::Motion, SINGLE_TURN),
    code(780, Group::Motion, Meaning::ThreadCycle),
    code(790, Group::Motion, SINGLE_FACE),
    code(900, Group::Distance, Meaning::Distance { absolute: true }),
    code(920, Group::NonModal, Meaning::SpeedClamp),
    code(921, Group::NonModal, Meaning::Preset),
    code(940, Group::FeedUnit, Meaning::Feed(FeedUnit::PerMinute)),
    code(980, Group::CycleReturn, Meaning::CycleReturn { to_r: false }),
    code(990, Group::CycleReturn, Meaning::CycleReturn { to_r: true }),
];

const SYSTEM_C: &[Code] = &[
    code(200, Group::Motion, SINGLE_TURN),
    code(210, Group::Motion, Meaning::ThreadCycle),
    code(240, Group::Motion, SINGLE_FACE),
    code(320, Group::Motion, of_other("the thread", &[A], "B and C G33")),
    code(500, Group::NonModal, of_other("the speed clamp", &[A], "C G92")),
    code(503, Group::NonModal, of_other("the preset of coordinates", &[A], "B and C G92.1")),
    code(700, Group::Units, INCH),
    code(710, Group::Units, MILLIMETRE),
    code(720, Group::Motion, Meaning::Turning(TurningCycle::Finish)),
    code(730, Group::Motion, TURN),
    code(740, Group::Motion, FACE),
    code(750, Group::Motion, Meaning::Turning(TurningCycle::Pattern)),
    code(760, Group::Motion, Meaning::Turning(TurningCycle::FaceGroove)),
    code(770, Group::Motion, Meaning::Turning(TurningCycle::Groove)),
    code(780, Group::Motion, Meaning::ThreadCycles),
    code(790, Group::Motion, of_other("the facing cycle", &[B], "C G24")),
    code(900, Group::Distance, Meaning::Distance { absolute: true }),
    code(920, Group::NonModal, Meaning::SpeedClamp),
    code(921, Group::NonModal, Meaning::Preset),
    code(940, Group::FeedUnit, Meaning::Feed(FeedUnit::PerMinute)),
    code(980, Group::CycleReturn, Meaning::CycleReturn { to_r: false }),
    code(990, Group::CycleReturn, Meaning::CycleReturn { to_r: true }),
];
