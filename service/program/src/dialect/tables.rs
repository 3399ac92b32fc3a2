//! The tables: codes, letters and function words of each dialect.

use super::{Code, Dialect, FeedUnit, Flow, Group, Letter, Meaning, Order, OtherReading};
use crate::state::{BoltPattern, Cycle, Pockets, TurningCycle};
use crate::{Axis, Function, PathControlMode, Plane, SpindleDirection, WorkSystem, XWord, expression, parameters};

pub(super) const fn code(tenths: u32, group: Group, meaning: Meaning) -> Code {
    Code { tenths, group, meaning, other_reading: None }
}

/// A code that other controls read as something else where axis words follow it.
pub(super) const fn doubtful(
    tenths: u32,
    group: Group,
    meaning: Meaning,
    other_reading: &'static OtherReading,
) -> Code {
    Code { tenths, group, meaning, other_reading: Some(other_reading) }
}

/// `G54` to `G59.3` for 1 to 9.
const fn system(number: u16) -> WorkSystem {
    match WorkSystem::plain(number) {
        Some(system) => system,
        None => panic!("a table has a wrong number"),
    }
}

/// `G110` to `G129` of Haas controls, for 1 to 20; of them `G112` and `G113` on mills alone.
const fn haas_offset(number: u16) -> Code {
    match WorkSystem::extended(number) {
        Some(system) => code(1_090 + 10 * number as u32, Group::WorkOffset, Meaning::HaasWorkOffset(system)),
        None => panic!("a table has a wrong number"),
    }
}

/// `G80` with axis words: LinuxCNC refuses it, FANUC controls differ.
static CYCLE_END: OtherReading = OtherReading {
    here: "the end of the cycles with a move behind it",
    elsewhere: "an end without a move, or an error",
    of_system_a: false,
    is_motion: false,
    stays: false,
};

/// A code that is known, and not carried out.
pub(super) const fn unsupported(tenths: u32, what: &'static str) -> Code {
    code(tenths, Group::NonModal, Meaning::Unsupported(what))
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
    code(100, Group::NonModal, Meaning::DataSetting),
    code(170, Group::Plane, Meaning::Plane(Plane::Xy)),
    code(180, Group::Plane, Meaning::Plane(Plane::Zx)),
    code(190, Group::Plane, Meaning::Plane(Plane::Yz)),
    code(200, Group::Units, Meaning::Units { inch: true }),
    code(210, Group::Units, Meaning::Units { inch: false }),
    code(280, Group::NonModal, Meaning::Reference),
    code(300, Group::NonModal, Meaning::FurtherReference),
    code(330, Group::Motion, Meaning::Thread),
    code(400, Group::CutterCompensation, Meaning::CompensationOff),
    code(410, Group::CutterCompensation, Meaning::Compensation { left: true, by_words: false }),
    code(420, Group::CutterCompensation, Meaning::Compensation { left: false, by_words: false }),
    code(520, Group::NonModal, Meaning::LocalShift),
    code(530, Group::NonModal, Meaning::MachineCoordinates),
    code(540, Group::WorkOffset, Meaning::WorkOffset(system(1))),
    code(550, Group::WorkOffset, Meaning::WorkOffset(system(2))),
    code(560, Group::WorkOffset, Meaning::WorkOffset(system(3))),
    code(570, Group::WorkOffset, Meaning::WorkOffset(system(4))),
    code(580, Group::WorkOffset, Meaning::WorkOffset(system(5))),
    code(590, Group::WorkOffset, Meaning::WorkOffset(system(6))),
    code(611, Group::PathControl, Meaning::PathControl(PathControlMode::ExactStop)),
    code(640, Group::PathControl, Meaning::PathControl(PathControlMode::Continuous)),
    doubtful(800, Group::Cycle, Meaning::CycleEnd, &CYCLE_END),
    code(810, Group::Motion, Meaning::Drill(Cycle::Drill)),
    code(820, Group::Motion, Meaning::Drill(Cycle::DrillDwell)),
    code(830, Group::Motion, Meaning::Drill(Cycle::Peck)),
    code(840, Group::Motion, Meaning::Drill(Cycle::Tap)),
    code(850, Group::Motion, Meaning::Drill(Cycle::Bore)),
    code(860, Group::Motion, Meaning::Drill(Cycle::BoreStop)),
    code(870, Group::Motion, Meaning::Drill(Cycle::BackBore)),
    code(880, Group::Motion, Meaning::Drill(Cycle::BoreManual)),
    code(890, Group::Motion, Meaning::Drill(Cycle::BoreDwell)),
    code(900, Group::Distance, Meaning::Distance { absolute: true }),
    code(910, Group::Distance, Meaning::Distance { absolute: false }),
    code(930, Group::FeedUnit, Meaning::Feed(FeedUnit::InverseTime)),
    code(940, Group::FeedUnit, Meaning::Feed(FeedUnit::PerMinute)),
    code(950, Group::FeedUnit, Meaning::Feed(FeedUnit::PerRevolution)),
    code(960, Group::SpeedMode, Meaning::SpeedMode { surface: true }),
    code(970, Group::SpeedMode, Meaning::SpeedMode { surface: false }),
];

/// G codes of FANUC controls and the like, lathe and mill.
pub(super) const FANUC_G_CODES: &[Code] = &[
    code(80, Group::NonModal, Meaning::LookAhead),
    code(90, Group::NonModal, Meaning::ExactStop),
    code(22, Group::Motion, Meaning::Unsupported("involute interpolation, clockwise")),
    code(32, Group::Motion, Meaning::Unsupported("involute interpolation, counter-clockwise")),
    code(62, Group::Motion, Meaning::Unsupported("NURBS interpolation of FANUC controls")),
    unsupported(70, "hypothetical axis interpolation"),
    unsupported(71, "cylindrical interpolation"),
    code(121, Group::PolarInterpolation, Meaning::Unsupported("polar coordinate interpolation")),
    code(131, Group::PolarInterpolation, Meaning::AlreadySo),
    code(220, Group::StrokeCheck, Meaning::Unsupported("stored stroke check")),
    code(230, Group::StrokeCheck, Meaning::AlreadySo),
    unsupported(23, "exponential interpolation, clockwise"),
    unsupported(33, "exponential interpolation, counter-clockwise"),
    unsupported(24, "a circle in space, clockwise"),
    unsupported(34, "a circle in space, counter-clockwise"),
    unsupported(54, "high-speed cycle machining: a table of positions that the control holds"),
    unsupported(106, "retraction to a stored position"),
    unsupported(109, "switching between diameters and radii"),
    unsupported(270, "reference position check"),
    unsupported(301, "the floating reference position"),
    unsupported(390, "an arc at a corner of a compensated contour"),
    unsupported(401, "the end of the tool turned at right angles to the path"),
    unsupported(412, "three-dimensional radius compensation, left"),
    unsupported(422, "three-dimensional radius compensation, right"),
    unsupported(411, "the tool turned at right angles to the path, left"),
    unsupported(421, "the tool turned at right angles to the path, right"),
    unsupported(450, "lengthening a move by a tool offset"),
    unsupported(460, "shortening a move by a tool offset"),
    unsupported(480, "shortening a move by twice a tool offset"),
    code(502, Group::Scaling, Meaning::AlreadySo),
    code(512, Group::Scaling, Meaning::Unsupported("polygon turning")),
    unsupported(542, "the fixture offset of a rotary table"),
    unsupported(544, "the compensation of a misplaced workpiece"),
    unsupported(600, "positioning from one side"),
    unsupported(721, "a figure copied by rotation"),
    unsupported(722, "a figure copied in a row"),
    unsupported(804, "the end of an electronic gear box"),
    unsupported(814, "an electronic gear box"),
    unsupported(811, "chopping of grinding machines"),
    unsupported(842, "rigid tapping of older controls: write M29 S and G84"),
    unsupported(843, "rigid tapping of left-hand threads of older controls: write M29 S and G74"),
    unsupported(661, "a macro call behind every block"),
    code(110, Group::NonModal, Meaning::DataSettingEnd),
    code(290, Group::NonModal, Meaning::ReferenceReturn),
    code(310, Group::NonModal, Meaning::Skip),
    code(541, Group::WorkOffset, Meaning::ExtendedWorkOffset { haas: false }),
    code(1_540, Group::WorkOffset, Meaning::ExtendedWorkOffset { haas: true }),
    haas_offset(1),
    haas_offset(2),
    haas_offset(5),
    haas_offset(6),
    haas_offset(7),
    haas_offset(8),
    haas_offset(9),
    haas_offset(10),
    haas_offset(11),
    haas_offset(12),
    haas_offset(13),
    haas_offset(14),
    haas_offset(15),
    haas_offset(16),
    haas_offset(17),
    haas_offset(18),
    haas_offset(19),
    haas_offset(20),
    // FANUC's G61 is the exact stop check; the exact path is LinuxCNC's.
    code(610, Group::PathControl, Meaning::PathControl(PathControlMode::ExactStop)),
    code(620, Group::PathControl, Meaning::CuttingMode),
    code(630, Group::PathControl, Meaning::CuttingMode),
    code(650, Group::MacroCall, Meaning::MacroCall { modal: false }),
    code(660, Group::MacroCall, Meaning::MacroCall { modal: true }),
    code(670, Group::MacroCall, Meaning::MacroCallEnd),
    code(1_870, Group::NonModal, Meaning::Smoothness),
];

/// M codes of FANUC controls and the like.
pub(super) const FANUC_M_CODES: &[Code] =
    &[code(970, Group::Subprogram, Meaning::LocalCall), code(1_980, Group::Subprogram, Meaning::Call)];

/// What Haas mills have that FANUC's do not.
pub(super) const HAAS_MILL_G_CODES: &[Code] = &[
    code(770, Group::Motion, Meaning::Unsupported("back boring of Haas controls, which is G87 on others")),
    unsupported(350, "measuring the diameter of a tool on Haas controls"),
    unsupported(360, "measuring a work offset on Haas controls"),
    unsupported(1_360, "measuring the centre of a work offset on Haas controls"),
    code(1_740, Group::Motion, Meaning::Unsupported("tapping of left-hand threads in any direction on Haas controls")),
    code(1_840, Group::Motion, Meaning::Unsupported("tapping in any direction on Haas controls")),
    unsupported(1_880, "the program of a pallet on Haas controls"),
    unsupported(2_530, "the spindle at right angles to the plane on Haas controls"),
    unsupported(2_680, "the feature coordinate system of Haas controls: write G68.2"),
    unsupported(2_690, "the end of the feature coordinate system of Haas controls"),
];

/// M codes of Haas controls that are those of the machine's builder elsewhere.
pub(super) const HAAS_M_CODES: &[Code] = &[
    code(960, Group::Subprogram, Meaning::Unsupported("a jump that an input decides")),
    unsupported(1_090, "a question that the operator answers"),
];

/// Those of Haas lathes beside.
pub(super) const HAAS_LATHE_M_CODES: &[Code] = &[code(
    230,
    Group::NonModal,
    Meaning::Unsupported("chamfers at the ends of threads that a setting of the control sizes"),
)];

/// Those of Haas mills beside.
pub(super) const HAAS_MILL_M_CODES: &[Code] = &[code(160, Group::ToolChange, Meaning::ToolChange)];

/// FANUC: one, or up to three by a parameter.
pub(super) const FANUC_M_CODES_IN_A_BLOCK: u8 = 3;

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
    code(980, Group::Subprogram, Meaning::Call),
    code(990, Group::Subprogram, Meaning::Return),
];

pub(super) const fn with_letters<const N: usize>(mut letters: [Letter; 26], table: [(u8, Letter); N]) -> [Letter; 26] {
    let mut entry = 0;
    while entry < N {
        letters[(table[entry].0 - b'A') as usize] = table[entry].1;
        entry += 1;
    }
    letters
}

pub(super) const COMMON_LETTERS: [Letter; 26] = with_letters(
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

pub(super) static MILL: Dialect = Dialect {
    letters: with_letters(
        COMMON_LETTERS,
        [(b'U', Letter::Axis(Axis::U)), (b'V', Letter::Axis(Axis::V)), (b'W', Letter::Axis(Axis::W))],
    ),
    g_codes: &[FANUC_G_CODES, MILL_G_CODES],
    m_codes: &[FANUC_M_CODES, &[code(60, Group::ToolChange, Meaning::ToolChange)]],
    tool_word_changes: false,
    is_linuxcnc: false,
    takes_comma_words: true,
    plain_corners: false,
    tool_stays_selected: false,
    max_m_codes: FANUC_M_CODES_IN_A_BLOCK,
    m_codes_closed: false,
    dwell_takes_u: false,
    f_is_lead: true,
    flow: Flow::MacroB,
    order: Order::FANUC,
    expressions: &expression::FANUC,
    parameters: &parameters::FANUC,
};

const MILL_G_CODES: &[Code] = &[
    haas_offset(3),
    haas_offset(4),
    code(120, Group::NonModal, Meaning::CircularPocket { clockwise: true }),
    code(130, Group::NonModal, Meaning::CircularPocket { clockwise: false }),
    unsupported(470, "lengthening a move by twice a tool offset, or text engraving of Haas controls"),
    code(700, Group::NonModal, Meaning::BoltHoles(BoltPattern::Circle)),
    code(710, Group::NonModal, Meaning::BoltHoles(BoltPattern::Arc)),
    code(720, Group::NonModal, Meaning::BoltHoles(BoltPattern::Line)),
    code(1_030, Group::NonModal, Meaning::BlockLimit),
    unsupported(1_070, "cylindrical mapping of Haas controls"),
    unsupported(1_410, "three-dimensional cutter compensation of Haas controls"),
    unsupported(1_430, "five-axis tool length compensation of Haas controls"),
    unsupported(1_500, "general-purpose pocket milling of Haas controls"),
    unsupported(2_340, "tool centre point control of Haas controls: write G43.4"),
    unsupported(2_540, "dynamic work offset of Haas controls: write G68.2"),
    code(2_550, Group::Rotation, Meaning::AlreadySo),
    code(150, Group::PolarCoordinates, Meaning::Polar { on: false }),
    code(160, Group::PolarCoordinates, Meaning::Polar { on: true }),
    code(370, Group::NonModal, Meaning::Skip),
    code(430, Group::LengthCompensation, Meaning::LengthCompensation { negative: false }),
    code(440, Group::LengthCompensation, Meaning::LengthCompensation { negative: true }),
    code(434, Group::LengthCompensation, Meaning::ToolControl { vectors: false }),
    code(435, Group::LengthCompensation, Meaning::ToolControl { vectors: true }),
    code(490, Group::LengthCompensation, Meaning::ToolControlOff),
    code(500, Group::Scaling, Meaning::Scaling { on: false }),
    code(501, Group::Mirror, Meaning::Mirror { on: false }),
    code(510, Group::Scaling, Meaning::Scaling { on: true }),
    code(511, Group::Mirror, Meaning::Mirror { on: true }),
    code(680, Group::Rotation, Meaning::Rotation),
    code(531, Group::NonModal, Meaning::AlignTool { about_tip: false }),
    code(536, Group::NonModal, Meaning::AlignTool { about_tip: true }),
    code(682, Group::Rotation, Meaning::TiltedPlane),
    code(690, Group::Rotation, Meaning::RotationOff),
    code(730, Group::Motion, Meaning::Drill(Cycle::ChipBreak)),
    code(740, Group::Motion, Meaning::Drill(Cycle::TapLeft)),
    code(760, Group::Motion, Meaning::Drill(Cycle::FineBore)),
    code(920, Group::NonModal, Meaning::SpeedClamp),
    code(921, Group::NonModal, Meaning::Preset),
    code(1_000, Group::Mirror, Meaning::HaasMirror { on: false }),
    code(1_010, Group::Mirror, Meaning::HaasMirror { on: true }),
    code(980, Group::CycleReturn, Meaning::CycleReturn { to_r: false }),
    code(990, Group::CycleReturn, Meaning::CycleReturn { to_r: true }),
];

pub(super) static LINUXCNC: Dialect = Dialect {
    letters: with_letters(
        COMMON_LETTERS,
        [
            (b'U', Letter::Axis(Axis::U)),
            (b'V', Letter::Axis(Axis::V)),
            (b'W', Letter::Axis(Axis::W)),
            // The length of a thread's tapers in G76.
            (b'E', Letter::Parameter),
        ],
    ),
    g_codes: &[LINUXCNC_G_CODES],
    m_codes: &[LINUXCNC_M_CODES],
    tool_word_changes: false,
    is_linuxcnc: true,
    takes_comma_words: false,
    plain_corners: false,
    tool_stays_selected: true,
    max_m_codes: 4,
    m_codes_closed: true,
    dwell_takes_u: false,
    f_is_lead: false,
    flow: Flow::OWords,
    order: Order::LINUXCNC,
    expressions: &expression::LINUXCNC,
    parameters: &parameters::LINUXCNC,
};

const LINUXCNC_G_CODES: &[Code] = &[
    code(610, Group::PathControl, Meaning::PathControl(PathControlMode::ExactPath)),
    code(70, Group::Diameter, Meaning::XWord(XWord::Diameter)),
    code(80, Group::Diameter, Meaning::XWord(XWord::Radius)),
    code(171, Group::Plane, Meaning::Unsupported("the plane of U and V")),
    code(181, Group::Plane, Meaning::Unsupported("the plane of U and W")),
    code(191, Group::Plane, Meaning::Unsupported("the plane of V and W")),
    code(281, Group::NonModal, Meaning::StoreReference { second: false }),
    code(301, Group::NonModal, Meaning::StoreReference { second: true }),
    code(331, Group::Motion, Meaning::RigidTap),
    code(382, Group::Motion, Meaning::Probe),
    code(383, Group::Motion, Meaning::Probe),
    code(384, Group::Motion, Meaning::Probe),
    code(385, Group::Motion, Meaning::Probe),
    code(411, Group::CutterCompensation, Meaning::Compensation { left: true, by_words: true }),
    code(421, Group::CutterCompensation, Meaning::Compensation { left: false, by_words: true }),
    code(430, Group::LengthCompensation, Meaning::LengthCompensation { negative: false }),
    code(431, Group::LengthCompensation, Meaning::LengthOffset { adds: false }),
    code(432, Group::LengthCompensation, Meaning::LengthOffset { adds: true }),
    code(490, Group::LengthCompensation, Meaning::ToolControlOff),
    code(591, Group::WorkOffset, Meaning::WorkOffset(system(7))),
    code(592, Group::WorkOffset, Meaning::WorkOffset(system(8))),
    code(593, Group::WorkOffset, Meaning::WorkOffset(system(9))),
    code(700, Group::Motion, Meaning::Turning(TurningCycle::Finish)),
    code(710, Group::Motion, Meaning::Turning(TurningCycle::Turn(Pockets::All))),
    code(711, Group::Motion, Meaning::Turning(TurningCycle::Turn(Pockets::Without))),
    code(712, Group::Motion, Meaning::Turning(TurningCycle::Turn(Pockets::Only))),
    code(720, Group::Motion, Meaning::Turning(TurningCycle::Face(Pockets::All))),
    code(721, Group::Motion, Meaning::Turning(TurningCycle::Face(Pockets::Without))),
    code(722, Group::Motion, Meaning::Turning(TurningCycle::Face(Pockets::Only))),
    code(730, Group::Motion, Meaning::Drill(Cycle::ChipBreak)),
    code(740, Group::Motion, Meaning::Drill(Cycle::TapLeft)),
    code(760, Group::Motion, Meaning::ThreadCycles),
    code(901, Group::ArcDistance, Meaning::ArcDistance { absolute: true }),
    code(911, Group::ArcDistance, Meaning::ArcDistance { absolute: false }),
    code(920, Group::NonModal, Meaning::ShiftSet),
    code(921, Group::NonModal, Meaning::ShiftClear { keeps: false }),
    code(922, Group::NonModal, Meaning::ShiftClear { keeps: true }),
    code(923, Group::NonModal, Meaning::ShiftRestore),
    code(980, Group::CycleReturn, Meaning::CycleReturn { to_r: false }),
    code(990, Group::CycleReturn, Meaning::CycleReturn { to_r: true }),
];

const LINUXCNC_M_CODES: &[Code] = &[code(60, Group::ToolChange, Meaning::ToolChange)];

/// A word of a machining function.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FunctionWordRule {
    pub(crate) letter: u8,
    pub(crate) is_length: bool,
    /// Without it the block says nothing; the values, and the words of other functions, are the function's business.
    pub(crate) required: bool,
    /// The word that may stand in its place, and not beside it.
    pub(crate) instead: Option<u8>,
}

const fn word(letter: u8, is_length: bool, required: bool) -> FunctionWordRule {
    FunctionWordRule { letter, is_length, required, instead: None }
}

/// The words a machining function takes in its "on" block; "off" takes none.
pub(crate) const fn function_words(function: Function, on: bool) -> &'static [FunctionWordRule] {
    const PATH_VIBRATION: &[FunctionWordRule] = &[word(b'F', false, false), word(b'A', true, false)];
    // X is a radius here as everywhere. Which of X and Z is stated says along which axis the lead is.
    const THREAD_VIBRATION: &[FunctionWordRule] = &[
        FunctionWordRule { instead: Some(b'Z'), ..word(b'X', true, true) },
        FunctionWordRule { instead: Some(b'X'), ..word(b'Z', true, false) },
        word(b'Q', false, true),
    ];
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
