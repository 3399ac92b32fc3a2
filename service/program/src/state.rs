//! Everything the interpreter remembers between two lines.

mod drilling;
mod machine;
mod shown;
mod turning;

use serde::{Deserialize, Serialize};

pub use self::drilling::DrillingCycle;
pub(crate) use self::drilling::{BoltPattern, Cycle, Drilling};
pub(crate) use self::machine::{MachineModes, ModeContext, Overrides};
pub(crate) use self::shown::ShownBy;
pub(crate) use self::turning::{Pockets, Roughed, SingleCycle, TurningCycle, TurningModes};

use crate::coordinates::Coordinates;
use crate::dialect::FeedUnit;
use crate::evidence::Evidence;
use crate::interpreter::{AngleLine, FlowState, PendingCorner};
use crate::parameters::Parameters;
use crate::{
    AxisSet, CompensationMode, Compensator, Coolant, Feed, FeedMode, Finding, Function, InitialMotion,
    LanguageSettings, PathControl, Place, Plane, Position, SourceSpan, Spindle, SpindleDirection, SpindleSpeed,
    TiltedPlane, ToolOffset,
};

/// Everything an [`crate::Interpreter`] remembers between two lines: modal state, position, place in the source.
///
/// Without the settings, and small but for the control points of a NURBS that is not closed yet: an interpreter restored from it and the same settings goes on identically.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InterpreterState {
    /// Where the next line begins.
    pub(crate) place: Place,
    /// What control flow remembers.
    pub(crate) flow: FlowState,
    /// Lines read so far: the number of the last one.
    pub(crate) lines: u32,
    pub(crate) phase: Phase,
    /// The last line ended with a carriage return, to which a line feed may still belong.
    pub(crate) after_return: bool,
    /// Bytes of the last line with anything in it, up to the blanks at its end, and how many blank lines follow it.
    pub(crate) last_line_bytes: u32,
    pub(crate) blank_lines: u32,
    /// The first line with anything in it; 0 before.
    pub(crate) first_line: u32,
    /// Whether it reads as a program.
    pub(crate) evidence: Evidence,
    /// Letters of modal words that could not be read and have not been since, one bit each.
    pub(crate) unread: u32,
    /// A leading `%` was read.
    pub(crate) percent_seen: bool,
    /// Within a line that is too long to be read.
    pub(crate) skipping_line: bool,
    pub(crate) reported: Reported,
    /// Programmed position, before mirror image, scaling and rotation, mm (X a radius) and degrees.
    pub(crate) position: Position,
    /// The block that moved there; line 0 before the first.
    pub(crate) moved_by: SourceSpan,
    pub(crate) motion: Motion,
    /// LinuxCNC: ten times the last code of motion or cycles, -1 behind a NURBS: `#<_motion_mode>`.
    pub(crate) motion_code: i16,
    pub(crate) plane: Plane,
    pub(crate) inch: bool,
    /// A code was read that G-code system A does not have.
    pub(crate) not_system_a: bool,
    /// A code or a word was read that G-code system A alone has, on a lathe whose profile names no system.
    pub(crate) is_system_a: bool,
    /// Which code or word that was, or the first that A does not have.
    pub(crate) system_shown_by: Option<ShownBy>,
    /// The first `G98` or `G99` that changed the feed mode, as it does in A, while the system was open.
    pub(crate) feed_of_system_a: Option<ShownBy>,
    /// A code was read that G-code system C does not have.
    pub(crate) not_system_c: bool,
    pub(crate) absolute: bool,
    /// `G90.1`: centres of arcs are absolute.
    pub(crate) arc_absolute: bool,
    pub(crate) feed_unit: FeedUnit,
    /// Modal feed with lengths in mm; 0 until programmed in the present feed mode.
    pub(crate) feed: f64,
    /// The same number as written, which is what counts for motion of rotary axes alone.
    pub(crate) feed_as_written: f64,
    pub(crate) spindle_direction: SpindleDirection,
    /// Constant surface speed is on.
    pub(crate) surface_speed: bool,
    pub(crate) rev_per_min: f64,
    pub(crate) m_per_min: f64,
    pub(crate) max_rev_per_min: Option<f64>,
    /// Tool in use, 0 for none.
    pub(crate) tool: u32,
    /// The last `T` word as a number, 0 before the first.
    pub(crate) tool_word: u32,
    /// The last M code; `None` before the first, and behind one that calls or ends a program, which controls count differently.
    pub(crate) m_code: Option<u32>,
    /// The last `N` of a block that was executed, in whatever program.
    pub(crate) sequence_number: Option<u32>,
    /// The number of the program that is read, where it has one.
    pub(crate) program_number: Option<u32>,
    pub(crate) thread: ThreadModes,
    pub(crate) drilling: Drilling,
    pub(crate) turning: TurningModes,
    /// Tool that the next `M6` changes to.
    pub(crate) next_tool: Option<u32>,
    pub(crate) coolant: Coolant,
    pub(crate) coords: Coordinates,
    /// X words are diameters.
    pub(crate) x_diameter: bool,
    /// Between `G10 L50` and `G11`: the line of its start.
    pub(crate) skipping_data: Option<u32>,
    pub(crate) path_control: PathControl,
    /// The last code of path control in tenths, 0 before the first: FANUC has it in #4015.
    pub(crate) path_code: u16,
    /// The path control before contour control (`G5.1 Q1`, `G5 P10000`, `G8 P1`, `G187`), while it is on.
    pub(crate) before_contour: Option<PathControl>,
    /// Where the last probing move would have ended without a contact, in work coordinates.
    pub(crate) probed: Option<Position>,
    /// A move that waits for the next one, as there is a corner between them.
    pub(crate) corner: Option<Box<PendingCorner>>,
    /// A line with an angle whose end the next line says.
    pub(crate) angle_line: Option<Box<AngleLine>>,
    /// Where a `G5` that continues the one before has its first control point: from its start along the axes of the
    /// plane, mm.
    pub(crate) spline_exit: Option<[f64; 2]>,
    /// The NURBS that is open, between `G5.2` and `G5.3`.
    pub(crate) nurbs: Option<Box<Nurbs>>,
    pub(crate) tool_control: ToolControl,
    /// The tilted plane, in its mode.
    pub(crate) plane_tilted: Option<TiltedPlane>,
    /// A plane that several blocks give, until the last of them.
    pub(crate) plane_sequence: Option<Box<PlaneSequence>>,
    pub(crate) length: LengthCompensation,
    /// What M codes of the machine leave for the blocks behind them.
    pub(crate) machine: MachineModes,
    /// What the program has assigned.
    pub(crate) parameters: Parameters,
    pub(crate) compensation: RadiusCompensation,
    /// The stage behind the interpreter.
    pub(crate) compensator: Compensator,
    /// Machining functions that a block without errors has switched on.
    pub(crate) functions_on: FunctionSet,
    /// Machining functions that are off because the block that should have switched them on has an error.
    pub(crate) functions_refused: FunctionSet,
}

/// A set of machining functions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct FunctionSet(u8);

impl FunctionSet {
    pub(crate) const fn contains(self, function: Function) -> bool {
        self.0 & (1 << function as u8) != 0
    }

    pub(crate) const fn set(&mut self, function: Function, inside: bool) {
        let bit = 1 << function as u8;
        self.0 = if inside { self.0 | bit } else { self.0 & !bit };
    }
}

/// Tool length compensation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct LengthCompensation {
    /// It is on; on lathes an offset is in force whenever its number is not 0.
    pub(crate) is_on: bool,
    /// `H`, 0 where it is off; on lathes the number of the offset in the `T` word.
    pub(crate) number: u32,
    /// The number that the geometry belongs to: that of the tool on lathes with `geometry_by_tool`.
    pub(crate) geometry_number: u32,
    /// `G44`
    pub(crate) negative: bool,
    /// The length, negative for `G44`, mm.
    pub(crate) length_mm: f64,
    /// What it adds to machine coordinates, mm: nothing in a tilted plane, where the length is along the tool axis.
    pub(crate) offset: Position,
    /// Line that switched it on.
    pub(crate) on_line: u32,
}

impl InterpreterState {
    /// Whether a row of the table of tool offsets differs from the one `before` in what is in force.
    pub(crate) fn is_in_force(&self, row: &ToolOffset, before: Option<&ToolOffset>) -> bool {
        let has_geometry = row.geometry != before.and_then(|before| before.geometry);
        let has_wear = row.wear != before.map_or(Position::default(), |before| before.wear);
        let control = &self.tool_control;
        let is_of_tip =
            matches!(control.mode, ToolMode::Angles | ToolMode::Vectors) && control.length_offset == row.number;
        has_geometry && (is_of_tip || self.length.geometry_number == row.number)
            || has_wear && (is_of_tip || self.length.number == row.number)
    }
}

/// Compensation of tool radius and nose, as it is programmed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct RadiusCompensation {
    pub(crate) on: Option<CompensationOn>,
    /// Number of the tool offset on FANUC controls: `D` of a mill, of the `T` word on a lathe.
    pub(crate) number: Option<u32>,
}

/// What `G41` or `G42` switched on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct CompensationOn {
    /// Line that switched it on.
    pub(crate) line: u32,
    /// The code was that of the left side: a mirror image and a negative radius change the side of the path, not the code.
    pub(crate) left: bool,
    pub(crate) mode: CompensationMode,
}

/// Tool centre point control, and tilted planes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ToolControl {
    pub(crate) mode: ToolMode,
    /// Line that switched it on.
    pub(crate) on_line: u32,
    /// `H`
    pub(crate) length_offset: u32,
    /// That length with its wear, mm; `None` where it is not known.
    pub(crate) tool_length_mm: Option<f64>,
    /// Tool direction last programmed.
    pub(crate) direction: Option<[f64; 3]>,
    /// Axes whose place only the machine knows.
    pub(crate) held: AxisSet,
    /// Blocks are thinned.
    pub(crate) thinning: bool,
    /// In a tilted plane: the tool axis is along its normal (`G53.1`, `G53.6`).
    pub(crate) is_aligned: bool,
    /// In a tilted plane: the tool axis was turned about the tip with this tool length (`G53.6 H`), which was not in force; 0: none.
    pub(crate) turned_length: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum ToolMode {
    #[default]
    Off,
    /// `G43.4`
    Angles,
    /// `G43.5`
    Vectors,
    /// `G68.2`
    Plane,
}

/// The blocks so far of a plane by three points (`G68.2 P2`) or two vectors (`G68.2 P3`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct PlaneSequence {
    /// 2 or 3.
    pub(crate) form: u32,
    /// Line of the first block.
    pub(crate) line: u32,
    /// `Q` of the next block.
    pub(crate) next: u32,
    /// `X Y Z` of each `Q`, mm.
    pub(crate) points_mm: [[f64; 3]; 4],
    /// `I J K` of each `Q`.
    pub(crate) vectors: [[f64; 3]; 4],
    /// `R`, degrees.
    pub(crate) turn_deg: f64,
    /// There was a `Q0`.
    pub(crate) has_shift: bool,
}

impl ThreadModes {
    /// A feed has taken the place of the lead.
    pub(crate) const fn forget_lead(&mut self) {
        (self.lead_mm, self.lead_as_written) = (None, None);
    }
}

impl ToolControl {
    /// Whether moves are plain ones, whose positions the program knows.
    pub(crate) fn is_plain(&self) -> bool {
        self.mode == ToolMode::Off && self.held.is_empty()
    }
}

/// What threads leave for the threads after them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ThreadModes {
    /// The modal `F` (or `E`) where a thread wrote it, as a lead, mm. A feed and a lead replace each other, as they are
    /// one modal word, but neither is ever taken for the other.
    pub(crate) lead_mm: Option<f64>,
    /// The number of that word, where it was `F`.
    pub(crate) lead_as_written: Option<f64>,
    /// End of the passes of `G92`, X and Z in work coordinates, mm.
    pub(crate) end: [f64; 2],
    /// Radius at the start less radius at the end of the passes of `G92`, mm.
    pub(crate) taper_mm: f64,
    /// What the first line of a `G76` of two lines has set, which other cycles take over.
    pub(crate) cycle: Option<CycleModes>,
    /// The first line of the last one was refused: that the second one lacks it need not be said.
    pub(crate) cycle_refused: bool,
    /// A plane was tilted or cancelled since the vibration of threads was switched on: its work is stated in other coordinates.
    pub(crate) work_is_elsewhere: bool,
}

/// Modal words of threading cycles, lengths in mm on the radius.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct CycleModes {
    /// Passes at full depth at the end, 1 to 99.
    pub(crate) finishing_passes: u32,
    /// Pull-out at the end of the thread, tenths of a lead, 0 to 99.
    pub(crate) chamfer_tenths: u32,
    /// Included angle of the tool, degrees.
    pub(crate) included_angle_deg: f64,
    pub(crate) least_infeed_mm: f64,
    pub(crate) allowance_mm: f64,
}

impl Default for CycleModes {
    /// One finishing pass and no pull-out.
    fn default() -> Self {
        Self {
            finishing_passes: 1,
            chamfer_tenths: 0,
            included_angle_deg: 0.0,
            least_infeed_mm: 0.0,
            allowance_mm: 0.0,
        }
    }
}

/// A NURBS whose control points are being read; the position stays at its start meanwhile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Nurbs {
    /// The block that opened it.
    pub(crate) span: SourceSpan,
    pub(crate) order: u8,
    /// Along the axes of the plane, mm.
    pub(crate) points: Vec<[f64; 2]>,
    pub(crate) weights: Vec<f64>,
    /// The last control point.
    pub(crate) end: Position,
    /// Feed of the block that opened it; `None` after a finding about it.
    pub(crate) feed: Option<Feed>,
    pub(crate) path_control: PathControl,
    /// One of its blocks had an error, so that it makes no curve.
    pub(crate) broken: bool,
}

/// Where in the program the reader is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Phase {
    /// Before the first block.
    Start,
    Blocks,
    Ended,
}

/// Modal motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Motion {
    /// No motion code yet, and none that the control has in force when it is switched on.
    None,
    Rapid,
    Linear,
    Arc {
        clockwise: bool,
    },
    Cubic,
    Quadratic,
    Nurbs,
    /// `G38.2` to `G38.5`
    Probe,
    /// `G32`, `G33`
    Thread,
    /// A lathe's `G92` with axis words: further blocks with axis words are further passes.
    ThreadCycle,
    /// A single turning or facing cycle: likewise.
    SingleCycle(SingleCycle),
    /// `G33.1`
    RigidTap,
    /// After a code that another control reads as a cycle: axis words are refused until the next motion code.
    Doubtful {
        /// Code number in tenths.
        tenths: u32,
        line: u32,
    },
    /// After a finding about the motion mode: axis words are followed silently until the next motion code.
    Unclear,
}

/// Findings about a lasting condition that have been made and are not repeated while it lasts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Reported {
    pub(crate) feed: bool,
    pub(crate) lead: bool,
    pub(crate) spindle: bool,
    pub(crate) thread_surface_speed: bool,
    pub(crate) speed_clamp: bool,
    pub(crate) trailing: bool,
    /// The path of circular pockets.
    pub(crate) pocket: bool,
}

impl InterpreterState {
    /// The state before the first line.
    // As long as the state: every field is one line.
    pub(crate) fn new(settings: &LanguageSettings) -> Self {
        let mut state = Self {
            place: Place::default(),
            flow: FlowState::default(),
            lines: 0,
            phase: Phase::Start,
            after_return: false,
            last_line_bytes: 0,
            blank_lines: 0,
            first_line: 0,
            evidence: Evidence::default(),
            unread: 0,
            percent_seen: false,
            skipping_line: false,
            reported: Reported::default(),
            position: Position::default(),
            moved_by: SourceSpan::default(),
            motion: match settings.motion_at_power_on() {
                Some(InitialMotion::Rapid) => Motion::Rapid,
                Some(InitialMotion::Linear) => Motion::Linear,
                None => Motion::None,
            },
            motion_code: 800,
            plane: match settings.dialect {
                crate::DialectName::Lathe => Plane::Zx,
                crate::DialectName::Mill | crate::DialectName::LinuxCnc => Plane::Xy,
            },
            inch: settings.initial_inch,
            not_system_a: matches!(settings.g_code_system, Some(crate::GCodeSystem::B | crate::GCodeSystem::C)),
            is_system_a: false,
            system_shown_by: None,
            feed_of_system_a: None,
            not_system_c: false,
            absolute: true,
            arc_absolute: false,
            feed_unit: match settings.initial_feed_mode {
                FeedMode::PerMinute => FeedUnit::PerMinute,
                FeedMode::PerRevolution => FeedUnit::PerRevolution,
            },
            feed: 0.0,
            feed_as_written: 0.0,
            spindle_direction: SpindleDirection::Stopped,
            surface_speed: false,
            rev_per_min: 0.0,
            m_per_min: 0.0,
            max_rev_per_min: None,
            tool: 0,
            tool_word: 0,
            m_code: None,
            sequence_number: None,
            program_number: None,
            thread: ThreadModes::default(),
            // As LinuxCNC starts, whatever its handbook says.
            drilling: Drilling { to_r: settings.dialect == crate::DialectName::LinuxCnc, ..Drilling::default() },
            turning: TurningModes::default(),
            next_tool: None,
            coolant: Coolant::default(),
            coords: Coordinates::new(settings),
            x_diameter: settings.x_word == crate::XWord::Diameter,
            skipping_data: None,
            path_control: settings.path_control(settings.initial_path_control),
            path_code: 0,
            before_contour: None,
            corner: None,
            angle_line: None,
            probed: None,
            spline_exit: None,
            nurbs: None,
            tool_control: ToolControl::default(),
            plane_tilted: None,
            plane_sequence: None,
            length: LengthCompensation::default(),
            machine: MachineModes::default(),
            parameters: Parameters::default(),
            compensation: RadiusCompensation::default(),
            compensator: Compensator::default(),
            functions_on: FunctionSet::default(),
            functions_refused: FunctionSet::default(),
        };
        crate::interpreter::set_initial_offsets(&mut state, settings);
        state.coords.resolve(settings, &Position::default());
        state.position = state.coords.programmed(&settings.initial_position);
        state
    }

    /// Lines read so far.
    #[must_use]
    pub const fn lines_read(&self) -> u32 {
        self.lines
    }

    /// Names the calls that first led to a finding in a further program that names none: what is found once moves are planned does not
    /// know them any more.
    pub fn name_calls(&self, finding: &mut Finding) {
        if !finding.related.iter().any(|place| place.is_call) {
            finding.called_from(self.flow.first_calls_of(finding.span.program));
        }
    }

    /// Whether a plane was tilted whose words were refused: until `G69` nothing is said of what follows from that.
    #[inline]
    pub(crate) const fn is_plane_refused(&self) -> bool {
        matches!(self.tool_control.mode, ToolMode::Plane) && self.plane_tilted.is_none()
    }

    /// Whether the end of the program was read.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.phase == Phase::Ended
    }

    /// Programmed position in work coordinates, mm (X a radius) and degrees.
    #[must_use]
    pub const fn position(&self) -> &Position {
        &self.position
    }

    /// The spindle as commanded.
    #[must_use]
    pub fn spindle(&self) -> Spindle {
        let speed = if self.surface_speed {
            let max_rev_per_min = self.max_rev_per_min.unwrap_or(f64::INFINITY);
            SpindleSpeed::Surface { m_per_min: self.m_per_min, max_rev_per_min }
        } else {
            SpindleSpeed::Constant { rev_per_min: self.rev_per_min }
        };
        Spindle { direction: self.spindle_direction, speed }
    }

    /// Whether the spindle turns at a speed other than zero.
    pub(crate) fn spindle_turns(&self) -> bool {
        let speed = if self.surface_speed { self.m_per_min } else { self.rev_per_min };
        self.spindle_direction != SpindleDirection::Stopped && speed > 0.0
    }
}
