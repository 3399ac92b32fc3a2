//! What a code can be: its modal group and what it does.

use crate::state::{BoltPattern, Cycle, TurningCycle};
use crate::{Function, GCodeSystem, PathControlMode, Plane, WorkSystem, XWord};

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
    StrokeCheck,
    PolarInterpolation,
}

/// Number of modal groups.
pub(crate) const GROUP_COUNT: usize = Group::PolarInterpolation as usize + 1;

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
            Self::StrokeCheck => "stroke check",
            Self::PolarInterpolation => "polar interpolation",
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
    /// A code of other G-code systems than the lathe's: what it is there, which they are, and how the lathe's own system writes it.
    OfOtherSystem {
        what: &'static str,
        systems: &'static [GCodeSystem],
        here: &'static str,
    },
    /// A drilling, boring or tapping cycle.
    Drill(Cycle),
    /// `G70` to `G72` of Haas mills: the cycle in force at holes in a pattern.
    BoltHoles(BoltPattern),
    /// `G12`, `G13` of Haas mills.
    CircularPocket {
        clockwise: bool,
    },
    /// `G80`
    CycleEnd,
    /// `G98`, `G99` where they are the level to which cycles return.
    CycleReturn {
        to_r: bool,
    },
    /// `G98`, `G99` of a lathe whose G-code system is not known: a feed mode in A, the level to which cycles return in B and C.
    FeedOrReturn {
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
    /// States what is the case anyway, or ends what is not carried out; every post writes these in its safety line.
    AlreadySo,
    /// The profile has other words in its place: which of the table's replacements.
    Replaced(u8),
    /// A known code whose effect is not carried out yet: what it is, for the finding.
    Unsupported(&'static str),
}

impl Meaning {
    /// Whether the parser has something to do with it beside noting its place: it is refused, or the line ends differently.
    #[inline]
    pub(crate) const fn concerns_parser(self) -> bool {
        matches!(
            self,
            Self::Unsupported(_)
                | Self::OfOtherSystem { .. }
                | Self::VariableLead
                | Self::MacroCall { .. }
                | Self::Replaced(_)
        )
    }

    /// Whether the code is of this dialect and does what it says.
    pub(super) const fn is_carried_out(self) -> bool {
        !matches!(self, Self::Unsupported(_) | Self::VariableLead | Self::OfNoSystem(_) | Self::OfOtherSystem { .. })
    }
}

/// One code of a dialect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Code {
    /// Code number in tenths: `G43.4` is 434.
    pub(crate) tenths: u32,
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
