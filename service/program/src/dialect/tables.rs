//! The tables: codes, letters and function words of each dialect.

use super::{Code, Dialect, FeedUnit, Group, Letter, Meaning};
use crate::{Axis, Function, PathControlMode, Plane, SpindleDirection};

pub(super) const fn code(tenths: u16, group: Group, meaning: Meaning) -> Code {
    Code { tenths, group, meaning }
}

/// G codes all dialects share.
pub(super) const COMMON_G_CODES: &[Code] = &[
    code(0, Group::Motion, Meaning::Rapid),
    code(10, Group::Motion, Meaning::Linear),
    code(20, Group::Motion, Meaning::Arc { clockwise: true }),
    code(30, Group::Motion, Meaning::Arc { clockwise: false }),
    code(40, Group::NonModal, Meaning::Dwell),
    code(50, Group::Motion, Meaning::CubicSpline),
    code(51, Group::Motion, Meaning::QuadraticSpline),
    code(52, Group::Motion, Meaning::Nurbs),
    code(53, Group::Motion, Meaning::NurbsEnd),
    code(80, Group::PathControl, Meaning::Unsupported("high-precision contour control")),
    code(90, Group::NonModal, Meaning::ExactStop),
    code(100, Group::NonModal, Meaning::Unsupported("data setting")),
    code(170, Group::Plane, Meaning::Plane(Plane::Xy)),
    code(180, Group::Plane, Meaning::Plane(Plane::Zx)),
    code(190, Group::Plane, Meaning::Plane(Plane::Yz)),
    code(200, Group::Units, Meaning::Units { inch: true }),
    code(210, Group::Units, Meaning::Units { inch: false }),
    code(270, Group::NonModal, Meaning::Unsupported("reference position check")),
    code(280, Group::NonModal, Meaning::Reference),
    code(290, Group::NonModal, Meaning::Unsupported("return from the reference position")),
    code(300, Group::NonModal, Meaning::Unsupported("second reference position")),
    code(310, Group::NonModal, Meaning::Unsupported("skip motion")),
    code(330, Group::Motion, Meaning::Thread),
    code(400, Group::CutterCompensation, Meaning::AlreadySo),
    code(410, Group::CutterCompensation, Meaning::Unsupported("cutter compensation")),
    code(420, Group::CutterCompensation, Meaning::Unsupported("cutter compensation")),
    code(520, Group::NonModal, Meaning::Unsupported("local coordinate system")),
    code(530, Group::NonModal, Meaning::MachineCoordinates),
    code(540, Group::WorkOffset, Meaning::WorkOffset(0)),
    code(550, Group::WorkOffset, Meaning::WorkOffset(1)),
    code(560, Group::WorkOffset, Meaning::WorkOffset(2)),
    code(570, Group::WorkOffset, Meaning::WorkOffset(3)),
    code(580, Group::WorkOffset, Meaning::WorkOffset(4)),
    code(590, Group::WorkOffset, Meaning::WorkOffset(5)),
    code(541, Group::WorkOffset, Meaning::Unsupported("additional work offsets")),
    code(610, Group::PathControl, Meaning::PathControl(PathControlMode::ExactPath)),
    code(611, Group::PathControl, Meaning::PathControl(PathControlMode::ExactStop)),
    code(640, Group::PathControl, Meaning::PathControl(PathControlMode::Continuous)),
    code(650, Group::NonModal, Meaning::Unsupported("macro call")),
    code(660, Group::MacroCall, Meaning::Unsupported("modal macro call")),
    code(670, Group::MacroCall, Meaning::AlreadySo),
    code(800, Group::Cycle, Meaning::AlreadySo),
    code(810, Group::Motion, Meaning::Unsupported("drilling cycle")),
    code(820, Group::Motion, Meaning::Unsupported("drilling cycle with dwell")),
    code(830, Group::Motion, Meaning::Unsupported("deep-hole drilling cycle")),
    code(840, Group::Motion, Meaning::Unsupported("tapping cycle")),
    code(850, Group::Motion, Meaning::Unsupported("boring cycle")),
    code(860, Group::Motion, Meaning::Unsupported("boring cycle")),
    code(870, Group::Motion, Meaning::Unsupported("boring cycle")),
    code(880, Group::Motion, Meaning::Unsupported("boring cycle")),
    code(890, Group::Motion, Meaning::Unsupported("boring cycle")),
    code(900, Group::Distance, Meaning::Distance { absolute: true }),
    code(910, Group::Distance, Meaning::Distance { absolute: false }),
    code(930, Group::FeedUnit, Meaning::Feed(FeedUnit::InverseTime)),
    code(940, Group::FeedUnit, Meaning::Feed(FeedUnit::PerMinute)),
    code(950, Group::FeedUnit, Meaning::Feed(FeedUnit::PerRevolution)),
    code(960, Group::SpeedMode, Meaning::SpeedMode { surface: true }),
    code(970, Group::SpeedMode, Meaning::SpeedMode { surface: false }),
];

/// M codes all dialects share.
pub(super) const COMMON_M_CODES: &[Code] = &[
    code(0, Group::Stop, Meaning::Stop { optional: false }),
    code(10, Group::Stop, Meaning::Stop { optional: true }),
    code(20, Group::Stop, Meaning::End),
    code(300, Group::Stop, Meaning::End),
    code(30, Group::Spindle, Meaning::Spindle(SpindleDirection::Clockwise)),
    code(40, Group::Spindle, Meaning::Spindle(SpindleDirection::CounterClockwise)),
    code(50, Group::Spindle, Meaning::Spindle(SpindleDirection::Stopped)),
    code(70, Group::Coolant, Meaning::Mist),
    code(80, Group::Coolant, Meaning::Flood),
    code(90, Group::Coolant, Meaning::CoolantOff),
    code(190, Group::Spindle, Meaning::Unsupported("spindle orientation")),
    code(290, Group::Tapping, Meaning::Unsupported("rigid tapping")),
    code(970, Group::Subprogram, Meaning::Unsupported("local subprogram call")),
    code(980, Group::Subprogram, Meaning::Unsupported("subprogram call")),
    code(990, Group::Subprogram, Meaning::Unsupported("return from a subprogram")),
];

const fn with_letters<const N: usize>(mut letters: [Letter; 26], table: [(u8, Letter); N]) -> [Letter; 26] {
    let mut entry = 0;
    while entry < N {
        letters[(table[entry].0 - b'A') as usize] = table[entry].1;
        entry += 1;
    }
    letters
}

const COMMON_LETTERS: [Letter; 26] = with_letters(
    [Letter::Unknown; 26],
    [
        (b'A', Letter::Axis(Axis::A)),
        (b'B', Letter::Axis(Axis::B)),
        (b'C', Letter::Axis(Axis::C)),
        (b'D', Letter::Parameter),
        (b'F', Letter::Feed),
        (b'G', Letter::Code),
        (b'H', Letter::Parameter),
        (b'I', Letter::Centre(0)),
        (b'J', Letter::Centre(1)),
        (b'K', Letter::Centre(2)),
        (b'L', Letter::Parameter),
        (b'M', Letter::Code),
        (b'N', Letter::Label),
        (b'O', Letter::Label),
        (b'P', Letter::Parameter),
        (b'Q', Letter::Parameter),
        (b'R', Letter::Radius),
        (b'S', Letter::Speed),
        (b'T', Letter::Tool),
        (b'X', Letter::Axis(Axis::X)),
        (b'Y', Letter::Axis(Axis::Y)),
        (b'Z', Letter::Axis(Axis::Z)),
    ],
);

pub(super) static LATHE: Dialect = Dialect {
    letters: with_letters(
        COMMON_LETTERS,
        [
            (b'U', Letter::Increment(Axis::X)),
            (b'V', Letter::Increment(Axis::Y)),
            (b'W', Letter::Increment(Axis::Z)),
            (b'H', Letter::Increment(Axis::C)),
            // Threads per inch, or a lead, and a length in cycles.
            (b'E', Letter::Parameter),
        ],
    ),
    g_codes: &[
        code(320, Group::Motion, Meaning::Thread),
        code(340, Group::Motion, Meaning::Unsupported("variable-lead thread cutting")),
        code(430, Group::LengthCompensation, Meaning::Unsupported("tool length compensation")),
        code(440, Group::LengthCompensation, Meaning::Unsupported("tool length compensation")),
        code(434, Group::LengthCompensation, Meaning::Unsupported("tool centre point control")),
        code(490, Group::LengthCompensation, Meaning::AlreadySo),
        code(500, Group::NonModal, Meaning::SpeedClamp),
        code(700, Group::Motion, Meaning::Unsupported("finishing cycle")),
        code(710, Group::Motion, Meaning::Unsupported("turning cycle")),
        code(720, Group::Motion, Meaning::Unsupported("facing cycle")),
        code(730, Group::Motion, Meaning::Unsupported("pattern repeating cycle")),
        code(740, Group::Motion, Meaning::Unsupported("peck cycle")),
        code(750, Group::Motion, Meaning::Unsupported("grooving cycle")),
        code(760, Group::Motion, Meaning::ThreadCycles),
        code(920, Group::NonModal, Meaning::SpeedClampOrThreadCycle),
        code(980, Group::FeedUnit, Meaning::Feed(FeedUnit::PerMinute)),
        code(990, Group::FeedUnit, Meaning::Feed(FeedUnit::PerRevolution)),
    ],
    // The T word has changed the tool already; some posts write M6 after it all the same.
    m_codes: &[code(60, Group::ToolChange, Meaning::AlreadySo)],
    tool_word_changes: true,
    dwell_takes_u: true,
};

pub(super) static MILL: Dialect = Dialect {
    letters: with_letters(
        COMMON_LETTERS,
        [(b'U', Letter::Axis(Axis::U)), (b'V', Letter::Axis(Axis::V)), (b'W', Letter::Axis(Axis::W))],
    ),
    g_codes: &[
        code(150, Group::PolarCoordinates, Meaning::AlreadySo),
        code(160, Group::PolarCoordinates, Meaning::Unsupported("polar coordinates")),
        code(430, Group::LengthCompensation, Meaning::LengthCompensation { negative: false }),
        code(440, Group::LengthCompensation, Meaning::LengthCompensation { negative: true }),
        code(434, Group::LengthCompensation, Meaning::ToolControl { vectors: false }),
        code(435, Group::LengthCompensation, Meaning::ToolControl { vectors: true }),
        code(490, Group::LengthCompensation, Meaning::ToolControlOff),
        code(500, Group::Scaling, Meaning::AlreadySo),
        code(510, Group::Scaling, Meaning::Unsupported("scaling")),
        code(680, Group::Rotation, Meaning::Unsupported("coordinate rotation")),
        code(531, Group::NonModal, Meaning::AlignTool),
        code(682, Group::Rotation, Meaning::TiltedPlane),
        code(690, Group::Rotation, Meaning::RotationOff),
        code(730, Group::Motion, Meaning::Unsupported("peck drilling cycle")),
        code(740, Group::Motion, Meaning::Unsupported("tapping cycle")),
        code(760, Group::Motion, Meaning::Unsupported("fine boring cycle")),
        code(920, Group::NonModal, Meaning::SpeedClamp),
        code(980, Group::CycleReturn, Meaning::AlreadySo),
        code(990, Group::CycleReturn, Meaning::Unsupported("return to the R level in cycles")),
    ],
    m_codes: &[code(60, Group::ToolChange, Meaning::ToolChange)],
    tool_word_changes: false,
    dwell_takes_u: false,
};

/// A word of a machining function.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FunctionWordRule {
    pub(crate) letter: u8,
    pub(crate) is_length: bool,
    /// Without it the block says nothing; the values, and the words of other functions, are the function's business.
    pub(crate) required: bool,
}

const fn word(letter: u8, is_length: bool, required: bool) -> FunctionWordRule {
    FunctionWordRule { letter, is_length, required }
}

/// The words a machining function takes in its "on" block; "off" takes none.
pub(crate) const fn function_words(function: Function, on: bool) -> &'static [FunctionWordRule] {
    const PATH_VIBRATION: &[FunctionWordRule] = &[word(b'F', false, false), word(b'A', true, false)];
    // X is a radius here as everywhere.
    const THREAD_VIBRATION: &[FunctionWordRule] = &[word(b'X', true, true), word(b'Q', false, true)];
    const TOOL_OSCILLATION: &[FunctionWordRule] = &[
        word(b'P', false, false),
        word(b'A', true, false),
        word(b'Q', true, false),
        word(b'D', true, false),
        word(b'L', false, false),
    ];
    match (function, on) {
        (Function::PathVibration, true) => PATH_VIBRATION,
        (Function::ThreadVibration, true) => THREAD_VIBRATION,
        (Function::ToolOscillation, true) => TOOL_OSCILLATION,
        (Function::PathVibration | Function::ThreadVibration | Function::ToolOscillation, false)
        | (Function::Thinning, _) => &[],
    }
}
