//! Operations: what a program asks the machine to do, with every modal state resolved.
//!
//! All lengths are millimetres (inch programs are converted), X is a radius even where the program writes
//! diameters, positions are absolute in the work coordinate system. An operation carries everything needed to
//! carry it out: nothing downstream tracks modal state.

use serde::{Deserialize, Serialize};

use crate::axis::{Axis, LEAST_WAY_MM, way_of};
use crate::{CompensationCommand, DrillingCycle, GuidedMove, MachineCommand, Plane, Position, SourceSpan, TiltedPlane};

/// One step of the program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Operation {
    /// The words that ask for it.
    pub span: SourceSpan,
    /// What to do.
    pub kind: OperationKind,
}

/// What an [`Operation`] does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "most operations are moves, and a box would allocate once per block")]
pub enum OperationKind {
    /// Axis motion.
    Move(Move),
    /// A threading pass.
    Thread(Box<ThreadMove>),
    /// Axis motion that depends on the kinematics of the machine (`G43.4`, `G43.5`).
    Guided(Box<GuidedMove>),
    /// Stand still (`G4`).
    Dwell {
        /// For so long.
        time: DwellTime,
        /// Work offset here: constant surface speed goes by X in these coordinates, which may be others than those of the
        /// move before.
        work_offset: Position,
    },
    /// The spindle starts, stops, or its commanded speed changes.
    Spindle(Spindle),
    /// `T` word: the tool number and, on lathes, the offset number.
    Tool {
        /// Tool number.
        number: u32,
        /// Offset number (the last two digits of a lathe's `T0101`), 0 for none.
        offset: u32,
    },
    /// Coolant state after `M7`, `M8`, `M9`.
    Coolant(Coolant),
    /// A machining function is switched by its configured code (such as `G200`, `G201`).
    Function(FunctionCommand),
    /// An M code that the machine carries out itself.
    MachineCode(MachineCommand),
    /// The compensation of the tool's radius is switched; the stage behind the interpreter takes this out, and nothing
    /// behind that sees it.
    Compensation(CompensationCommand),
    /// Program stop: `M0`, or `M1` when `optional`.
    Stop {
        /// Whether the stop is taken only when the operator asks for it.
        optional: bool,
    },
    /// End of program: `M2` or `M30`. Always the last operation; also sent, with a finding, where a program
    /// just stops.
    End,
}

impl Operation {
    /// Whether it is a move that moves nothing.
    pub(crate) fn is_nothing(&self) -> bool {
        matches!(&self.kind, OperationKind::Move(step) if step.is_nothing())
    }
}

impl Move {
    /// The feed along the path, whose length over all linear axes this is: where X, Y and Z are led alone, U, V and W make it longer.
    #[must_use]
    pub fn feed_on_path(&self, length_mm: f64) -> Feed {
        if !self.leads_xyz {
            return self.feed;
        }
        let way = |axes: [Axis; 3]| way_of(&self.start, &self.end, |axis| axes.contains(&axis));
        let beside_mm = way([Axis::U, Axis::V, Axis::W]);
        let straight_mm = way([Axis::X, Axis::Y, Axis::Z]);
        let is_curved = self.arc.is_some() || self.spline.is_some();
        let led_mm = match is_curved {
            true => (length_mm * length_mm - beside_mm * beside_mm).max(0.0).sqrt().max(straight_mm),
            false => straight_mm,
        };
        if beside_mm <= LEAST_WAY_MM || led_mm <= LEAST_WAY_MM {
            return self.feed;
        }
        let ratio = length_mm / led_mm;
        match self.feed {
            Feed::PerMinute(feed) => Feed::PerMinute(feed * ratio),
            Feed::PerRevolution(feed) => Feed::PerRevolution(feed * ratio),
            feed @ Feed::InverseTime(_) => feed,
        }
    }

    /// Whether it moves nothing.
    pub(crate) fn is_nothing(&self) -> bool {
        self.start == self.end && self.arc.is_none() && self.spline.is_none()
    }
}

/// Kind of axis motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum MoveKind {
    /// `G0`, `G28`: as fast as the axes allow, on a straight line.
    Rapid,
    /// `G1`, `G2`, `G3` at the programmed feed.
    Cutting,
}

/// Motion from `start` to `end`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Move {
    /// Rapid or cutting.
    pub kind: MoveKind,
    /// Where the block before ended, in the work coordinates of **this** block.
    pub start: Position,
    /// The programmed end point, in work coordinates.
    pub end: Position,
    /// Work offset: machine position = work position + offset, per axis.
    pub work_offset: Position,
    /// The circle, for `G2` and `G3`.
    pub arc: Option<ArcGeometry>,
    /// The spline, for `G5`, `G5.1` and `G5.2`; straight where neither this nor `arc` is there.
    pub spline: Option<Box<SplineGeometry>>,
    /// How the path runs through the end point of this block into the next.
    pub path_control: PathControl,
    /// Programmed feed; meaningless for rapids.
    pub feed: Feed,
    /// Whether the feed is that of X, Y and Z while one of them moves, and U, V and W come along, as LinuxCNC has it; it is that of all
    /// linear axes otherwise. See [`Move::feed_on_path`].
    pub leads_xyz: bool,
    /// Spindle state while this block runs.
    pub spindle: Spindle,
    /// Tool number while this block runs, 0 before the first `T`.
    pub tool: u32,
    /// The drilling, boring or tapping cycle that the move is one of.
    pub cycle: Option<DrillingCycle>,
}

/// A threading pass (`G32`, `G33`, and every pass of a threading cycle): the lead axis follows the spindle angle.
///
/// Blocks that follow each other without anything between them are one thread of several parts: only the first
/// waits for the spindle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThreadMove {
    /// Turned or tapped.
    pub kind: ThreadKind,
    /// Where the block before ended, in the work coordinates of this block.
    pub start: Position,
    /// The programmed end point, in work coordinates.
    pub end: Position,
    /// Work offset: machine position = work position + offset, per axis.
    pub work_offset: Position,
    /// The work offset without the tool's: where the coordinates of the program lie.
    pub frame_offset: Position,
    /// Travel per spindle revolution along whichever of X (radius) and Z travels further, mm; of a tap along its path.
    pub lead_mm: f64,
    /// Spindle angle from the thread-start reference point at which the lead axis starts (`Q`), degrees.
    pub start_angle_deg: f64,
    /// Which start of a multi-start thread the pass cuts, from 0, where a cycle says so.
    pub thread_start: u32,
    /// Peak-to-peak vibration across the lead (`A`), on the radius or along Z, mm, where the pass has its own.
    pub amplitude_mm: Option<f64>,
    /// The `A` word of the pass, where it can have one: the passes of a cycle cannot.
    pub amplitude_word: Option<ThreadAmplitudeWord>,
    /// Phase shift of the vibration (`R`), degrees, where the pass has its own.
    pub phase_shift_deg: Option<f64>,
    /// How the tool leaves the thread before its end.
    pub pull_out: Option<PullOut>,
    /// Included angle of the tool, degrees, where a cycle names it.
    pub included_angle_deg: Option<f64>,
    /// Spindle state while this block runs.
    pub spindle: Spindle,
    /// Tool number while this block runs, 0 before the first `T`.
    pub tool: u32,
    /// The tilted plane whose coordinates start and end are in, instead of work coordinates: X and Z are the plane's.
    pub plane: Option<Box<ThreadPlane>>,
}

/// How the amplitude of a threading pass is written.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThreadAmplitudeWord {
    /// Its place, where it is written.
    pub span: Option<SourceSpan>,
    /// Amplitude that `A1.0` says, mm: half a millimetre on the radius where words of X are diameters.
    pub mm_per_unit: f64,
}

/// The tilted plane of a thread or a tap.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThreadPlane {
    /// The plane.
    pub plane: TiltedPlane,
    /// Number of the tool length (`H`), 0 for no length.
    pub length_offset: u32,
    /// That length with its wear, mm.
    pub tool_length_mm: f64,
}

/// How a thread is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ThreadKind {
    /// Turned: the lead axis comes into step with a spindle that turns at its speed.
    #[default]
    Turned,
    /// A stroke of a rigid tap, in or out: the spindle starts and comes to rest with the tool, which is at every instant
    /// where its angle says.
    Tapped,
}

/// How the tool leaves a thread before its end: a chamfer of a threading cycle. The move after it starts at the end
/// point plus this retreat, where the tool then is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PullOut {
    /// Travel along the lead axis before the end point within which the tool is pulled out, mm.
    pub travel_mm: f64,
    /// By how much it is pulled out at the end point, signed change of X, mm on the radius.
    pub retreat_mm: f64,
}

/// A circular arc or helix; the start and end radii agree within the arc tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArcGeometry {
    /// The plane of the circle.
    pub plane: Plane,
    /// Centre: first and second axis of the plane, work coordinates, mm.
    pub center: [f64; 2],
    /// `G2` seen from the positive end of the plane's normal.
    pub clockwise: bool,
    /// Signed swept angle about the plane's normal, rad: positive counter-clockwise, |sweep| may exceed 2π.
    pub sweep_rad: f64,
}

/// A NURBS in a plane with uniform knots, clamped at both ends: it starts at the first control point and ends at the
/// last. `G5` gives one of order 4 with four points, `G5.1` one of order 3 with three points, all weights 1: Bézier
/// curves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplineGeometry {
    /// The plane of the curve.
    pub plane: Plane,
    /// Order (degree + 1), at most the number of control points.
    pub order: u8,
    /// Control points, the start and the end of the move among them: first and second axis of the plane, work
    /// coordinates, mm.
    pub points: Vec<[f64; 2]>,
    /// Weight of each control point, positive.
    pub weights: Vec<f64>,
}

/// How the path runs from one block into the next (modal group 13).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PathControl {
    /// `G61`: through the programmed point, at a corner with no larger step of the axis velocities than the machine
    /// permits.
    #[default]
    ExactPath,
    /// `G61.1`, and `G9` for one block: to rest on the programmed point.
    ExactStop,
    /// `G64 P Q`: corners are rounded within a tolerance.
    Continuous {
        /// Largest distance of the path from the programmed one, mm (`P`).
        tolerance_mm: f64,
        /// Largest distance of a point left out of a straight run of short lines, mm (`Q`); part of `tolerance_mm`.
        merge_tolerance_mm: f64,
    },
}

/// Programmed feed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Feed {
    /// mm/min (degrees/min for rotary-only motion).
    PerMinute(f64),
    /// mm per spindle revolution.
    PerRevolution(f64),
    /// The block takes 1/F minutes; the value is F in 1/min.
    InverseTime(f64),
}

/// Spindle state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spindle {
    /// Direction of rotation.
    pub direction: SpindleDirection,
    /// Commanded speed.
    pub speed: SpindleSpeed,
}

/// Sense of spindle rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SpindleDirection {
    /// `M5`
    Stopped,
    /// `M3`
    Clockwise,
    /// `M4`
    CounterClockwise,
}

/// Commanded spindle speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum SpindleSpeed {
    /// `G97 S`: rev/min.
    Constant {
        /// Speed, rev/min.
        rev_per_min: f64,
    },
    /// `G96 S`: constant surface speed at the tool's X radius.
    Surface {
        /// Surface speed, m/min.
        m_per_min: f64,
        /// Speed clamp (`G50 S`, `G92 S`), rev/min; infinite when none is programmed.
        max_rev_per_min: f64,
    },
}

impl Spindle {
    /// A stopped spindle, as before the first `M3`.
    pub const STOPPED: Self =
        Self { direction: SpindleDirection::Stopped, speed: SpindleSpeed::Constant { rev_per_min: 0.0 } };

    /// Whether the spindle turns.
    #[must_use]
    pub fn is_turning(&self) -> bool {
        self.direction != SpindleDirection::Stopped && self.rev_per_s(1.0) > 0.0
    }

    /// Speed in rev/s (never negative) with the tool at X radius `radius_mm`; `0` when stopped.
    #[must_use]
    pub fn rev_per_s(&self, radius_mm: f64) -> f64 {
        self.rev_per_min(radius_mm) / 60.0
    }

    /// Speed in rev/min (never negative) with the tool at X radius `radius_mm`; `0` when stopped.
    ///
    /// Under constant surface speed n = v_c / (2π·r), clamped at the programmed maximum.
    #[must_use]
    pub fn rev_per_min(&self, radius_mm: f64) -> f64 {
        if self.direction == SpindleDirection::Stopped {
            return 0.0;
        }
        match self.speed {
            SpindleSpeed::Constant { rev_per_min } => rev_per_min,
            // 0/0 at the axis would count as unlimited.
            SpindleSpeed::Surface { m_per_min: 0.0, .. } => 0.0,
            SpindleSpeed::Surface { m_per_min, max_rev_per_min } => {
                let circumference_mm = core::f64::consts::TAU * radius_mm.abs();
                let wanted_rev_per_min = m_per_min * 1_000.0 / circumference_mm;
                wanted_rev_per_min.min(max_rev_per_min)
            }
        }
    }
}

/// How long a dwell lasts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum DwellTime {
    /// Seconds.
    Seconds(f64),
    /// Spindle revolutions.
    Revolutions(f64),
}

/// Coolant state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coolant {
    /// `M7`
    pub mist: bool,
    /// `M8`
    pub flood: bool,
}

/// A machining function that a program switches on and off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Function {
    /// Vibration along the path: on with `F` (Hz) and `A` (mm).
    PathVibration,
    /// Vibration of threading passes: on with the work diameter (`X`), or the face of the work (`Z`) for threads along X, and
    /// the ratio of amplitude to infeed (`Q`).
    ThreadVibration,
    /// Thinning of five-axis blocks.
    Thinning,
    /// Oscillation of a rotary tool in step with its rotation: on with the number of a condition (`P`), and optionally the
    /// amplitudes along the feed (`A`) and the tool axis (`Q`), the depth of cut (`D`) and the leading edge (`L`).
    ToolOscillation,
}

/// A block that switches a machining function. The words are those of the function's table in the dialect,
/// lengths in mm; their meaning and validity are the function's own business.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FunctionCommand {
    /// Which function.
    pub function: Function,
    /// Switched on or off.
    pub on: bool,
    /// Whether the program writes lengths in inches here, for suggested replacements; the words are mm all the same.
    pub inch: bool,
    /// Where the coordinates of the program lie here: the work offset without the tool's.
    pub frame_offset: Position,
    /// The block's words for it, each letter at most once.
    pub words: Vec<FunctionWord>,
}

impl FunctionCommand {
    /// The word with this letter.
    #[must_use]
    pub fn word(&self, letter: char) -> Option<&FunctionWord> {
        self.words.iter().find(|word| word.letter == letter)
    }
}

/// One word of a [`FunctionCommand`] or a [`MachineCommand`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FunctionWord {
    /// Upper-case address letter.
    pub letter: char,
    /// Value; lengths of a machining function in mm.
    pub value: f64,
    /// Its place.
    pub span: SourceSpan,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surface_speed_zero_stands_still_at_the_axis_too() {
        let speed = SpindleSpeed::Surface { m_per_min: 0.0, max_rev_per_min: 3_000.0 };
        let spindle = Spindle { direction: SpindleDirection::Clockwise, speed };
        assert_eq!(spindle.rev_per_s(0.0), 0.0);
        assert!(!spindle.is_turning());
    }
}
