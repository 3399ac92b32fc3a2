//! Motion of one block: where it ends, and the move there.

mod polar;
mod target;

pub(super) use target::shorter_turn;

use super::execute::Execution;
use super::spline::is_point;
use crate::axis::{LEAST_WAY_MM, straight_length, way_of};
use crate::code;
use crate::consequence::JUDGED_BY;
use crate::dialect::{Code, FeedUnit, Flow, Group, Letter, Meaning, letter_bit};
use crate::state::{InterpreterState, Motion};
use crate::{
    ArcGeometry, Axis, AxisSet, DialectName, Feed, Finding, Move, MoveKind, Operation, OperationKind, PathControl,
    Position,
};

/// The letters of an arc's centre.
const CENTRE_LETTERS: u32 = letter_bit(b'I') | letter_bit(b'J') | letter_bit(b'K');

/// The letters of chamfers and roundings without a comma.
pub(super) const PLAIN_CORNER_LETTERS: u32 = letter_bit(b'R') | letter_bit(b'I') | letter_bit(b'K') | letter_bit(b'C');

/// Every letter of a curve beside its end.
pub(super) const CURVE_LETTERS: u32 = CENTRE_LETTERS
    | letter_bit(b'R')
    | letter_bit(b'P')
    | letter_bit(b'Q')
    | letter_bit(b'L')
    | letter_bit(b'F')
    | letter_bit(b'E');

/// The letters, beside axes, that ask for motion.
pub(super) const fn curve_letters(motion: Motion) -> u32 {
    match motion {
        Motion::Arc { .. } => CENTRE_LETTERS | letter_bit(b'R'),
        Motion::Cubic | Motion::Quadratic => CENTRE_LETTERS | letter_bit(b'P') | letter_bit(b'Q'),
        _ => 0,
    }
}

/// Which coordinates a block's axis words are written in.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Frame {
    /// Work coordinates, absolute or incremental as the distance mode says.
    Work,
    /// `G53`
    Machine,
}

impl Execution<'_> {
    /// Motion by the modal motion code.
    #[inline]
    pub(super) fn motion(&mut self) {
        let before = self.state.motion;
        if let Some(doubt) = self.doubt
            && self.is_doubtful_motion(doubt)
        {
            return;
        }
        if let Some(code) = self.block.code(Group::Motion)
            && self.is_done_by_code(code.place, before)
        {
            return;
        }
        let Some(frame) = self.frame() else { return };
        if self.is_done_by_mode(frame, before) {
            return;
        }
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        if (self.block.has_comma_words() || self.settings.plain_drawing_words)
            && frame == Frame::Work
            && let Some(word) = self.angle_word()
        {
            return self.angle_motion(word, axes);
        }
        let curve_words = self.block.letters & !self.used & curve_letters(self.state.motion);
        if frame == Frame::Machine && !self.block.unclear && !self.is_bare_machine_code(axes) {
            if self.is_wrong_machine_motion(axes) {
                self.used |= CURVE_LETTERS;
                if self.state.motion == Motion::Nurbs {
                    self.state.motion = Motion::Unclear;
                }
                self.state.position = self.target(axes, frame);
                return;
            }
        } else if self.is_smooth_interpolation(axes, before)
            || axes == 0 && (self.is_contour_control(axes, before) || curve_words == 0)
        {
            return self.check_motion_words();
        }
        if self.state.angle_line.is_some() {
            self.check_angle_line();
        }
        let end = self.target(axes, frame);
        if !self.block.unclear {
            self.move_to(&end, axes);
        }
        self.state.position = end;
    }

    /// Puts the motion code of the block in force; whether that is all, as it is carried out once or ends something.
    #[inline]
    fn is_done_by_code(&mut self, place: u8, before: Motion) -> bool {
        let &Code { meaning, tenths, .. } = self.table.code(place);
        match meaning {
            // Its interpreter leaves the mode alone.
            Meaning::CubicSpline | Meaning::QuadraticSpline | Meaning::Nurbs => {}
            Meaning::NurbsEnd => self.state.motion_code = -1,
            _ => self.state.motion_code = tenths as i16,
        }
        if !matches!(meaning, Meaning::Drill(_)) {
            self.leave_cycle();
        }
        self.state.motion = match meaning {
            // The motion code before it counts again after G80.
            Meaning::Drill(cycle) => {
                self.enter_cycle(cycle);
                before
            }
            Meaning::RigidTap => Motion::RigidTap,
            Meaning::Rapid => Motion::Rapid,
            Meaning::Linear => Motion::Linear,
            Meaning::Arc { clockwise } => Motion::Arc { clockwise },
            Meaning::CubicSpline => Motion::Cubic,
            Meaning::QuadraticSpline => Motion::Quadratic,
            Meaning::Nurbs => Motion::Nurbs,
            Meaning::Thread => Motion::Thread,
            Meaning::Probe => Motion::Probe,
            Meaning::NurbsEnd
            | Meaning::ThreadCycles
            | Meaning::ThreadCycle
            | Meaning::Turning(_)
            | Meaning::OfNoSystem(_) => {
                self.carry_out_once(meaning, before);
                return true;
            }
            _ => Motion::Unclear,
        };
        if self.state.motion != Motion::Cubic {
            self.state.spline_exit = None;
        }
        false
    }

    /// A code that is carried out in its block; the motion before it stays in force.
    fn carry_out_once(&mut self, meaning: Meaning, before: Motion) {
        match meaning {
            Meaning::NurbsEnd => self.close_nurbs(before),
            Meaning::ThreadCycle => self.open_thread_cycle(),
            Meaning::OfNoSystem(what) => self.cycle_of_no_system(what),
            Meaning::ThreadCycles | Meaning::Turning(_) if self.is_thread_refused() => {}
            Meaning::ThreadCycles => self.thread_cycles(),
            Meaning::Turning(cycle) => self.turning_cycle(cycle, before),
            _ => {}
        }
    }

    /// The coordinates of the block's axis words; nothing where they belong to its one-block code or to a curve of several blocks, which
    /// is then done with.
    #[inline]
    fn frame(&mut self) -> Option<Frame> {
        let one_block = self.block.code(Group::NonModal).map(|code| self.table.code(code.place).meaning);
        match one_block {
            Some(Meaning::MachineCoordinates) => return Some(Frame::Machine),
            _ if self.state.motion == Motion::Nurbs => self.nurbs(),
            // Its axis words are its own; what it left is reported as unused.
            // In LinuxCNC a move may follow the dwell.
            Some(Meaning::Dwell) if self.table.dialect.is_linuxcnc => return Some(Frame::Work),
            Some(
                Meaning::Dwell
                | Meaning::SpeedClamp
                | Meaning::LocalShift
                | Meaning::ShiftSet
                | Meaning::Preset
                | Meaning::DataSetting
                | Meaning::DataSettingEnd
                | Meaning::Reference
                | Meaning::FurtherReference
                | Meaning::ReferenceReturn
                | Meaning::StoreReference { .. }
                | Meaning::AlignTool { .. }
                | Meaning::LookAhead
                | Meaning::Smoothness
                | Meaning::BlockLimit,
            ) => {}
            Some(Meaning::Skip) => self.probing_move(),
            Some(Meaning::CircularPocket { clockwise }) => self.circular_pocket(clockwise),
            Some(Meaning::BoltHoles(pattern)) if self.state.drilling.cycle.is_none() => {
                self.bolts_without_cycle(pattern);
            }
            Some(Meaning::SpeedClampOrThreadCycle) => self.open_thread_cycle(),
            _ => return Some(Frame::Work),
        }
        None
    }

    /// Carries the block out where a mode makes another thing of it than one move: a cycle, a guided tool, a thread.
    #[inline]
    fn is_done_by_mode(&mut self, frame: Frame, before: Motion) -> bool {
        if self.state.drilling.cycle.is_some() {
            self.drill(frame);
            return true;
        }
        if frame == Frame::Machine && self.table.dialect.flow == Flow::MacroB {
            self.rapid_to_machine(before);
        }
        let is_work = frame == Frame::Work;
        match self.state.motion {
            Motion::Probe if is_work && self.block.letters & self.table.axis_letters & !self.used != 0 => {
                self.probing_move();
            }
            _ if !self.state.tool_control.is_plain() => self.guided_motion(frame, before),
            Motion::RigidTap if is_work => self.rigid_tap(),
            Motion::Thread | Motion::ThreadCycle if is_work => {
                if !self.is_thread_refused() {
                    self.thread_motion();
                }
            }
            Motion::SingleCycle(cycle) if is_work => self.single_cycle(cycle),
            _ => return false,
        }
        true
    }

    /// Moves to `end` by the motion in force.
    #[inline]
    fn move_to(&mut self, end: &Position, axes: u32) {
        let motion = if self.machine_rapid { Motion::Rapid } else { self.state.motion };
        match motion {
            Motion::Rapid => self.emit_move(MoveKind::Rapid, end, None, Feed::PerMinute(0.0)),
            Motion::Linear => {
                if self.is_move(end) {
                    let plain = self.table.dialect.plain_corners && self.block.letters & PLAIN_CORNER_LETTERS != 0;
                    let Some(feed) = self.cutting_feed() else { return self.pass_over_corner(plain) };
                    self.emit_cut(axes, end, None, feed, self.block.has_comma_words() || plain);
                }
            }
            Motion::Arc { clockwise } => {
                if let Some(arc) = self.arc(clockwise, end) {
                    let Some(feed) = self.cutting_feed() else { return self.pass_over_corner(false) };
                    self.emit_cut(axes, end, Some(arc), feed, self.block.has_comma_words());
                }
            }
            Motion::Cubic | Motion::Quadratic => {
                let cubic = self.state.motion == Motion::Cubic;
                if let Some(spline) = self.spline(cubic, axes, end)
                    && let Some(feed) = self.cutting_feed()
                    && !is_point(&spline)
                {
                    let mut step = self.new_move(MoveKind::Cutting, *end, feed);
                    step.spline = Some(self.placed_spline(spline));
                    self.emit(self.block.span(), OperationKind::Move(step));
                }
            }
            Motion::None => self.motion_missing(),
            Motion::Doubtful { tenths, line } => {
                self.used |= CURVE_LETTERS;
                self.doubtful_before(tenths, line);
            }
            Motion::Nurbs
            | Motion::Probe
            | Motion::Thread
            | Motion::ThreadCycle
            | Motion::SingleCycle(_)
            | Motion::RigidTap
            | Motion::Unclear => {
                self.used |= CURVE_LETTERS;
            }
        }
    }

    /// Emits a cutting move, with the corner behind it where words ask for one.
    #[inline]
    fn emit_cut(&mut self, axes: u32, end: &Position, arc: Option<ArcGeometry>, feed: Feed, has_corner: bool) {
        if !has_corner {
            return self.emit_move(MoveKind::Cutting, end, arc, feed);
        }
        let corner = self.corner_words(axes);
        self.emit_with_corner(corner, |this| this.emit_move(MoveKind::Cutting, end, arc, feed));
    }

    /// Whether the coordinates do not permit a thread, whose lead is along the axes of the machine; it is then reported.
    fn is_thread_refused(&mut self) -> bool {
        if self.state.coords.transform.is_none() && self.state.coords.polar.is_none() {
            return false;
        }
        if self.block.letters & self.table.axis_letters & !self.used == 0 {
            return false;
        }
        self.used = u32::MAX;
        self.is_transform_on(self.block.span(), "a thread or a turning cycle")
    }

    /// FANUC controls go to machine positions rapidly, unless a line is in force.
    fn rapid_to_machine(&mut self, before: Motion) {
        let is_in_force = self.block.code(Group::Motion).is_none();
        if is_in_force && matches!(before, Motion::None | Motion::Arc { .. }) {
            self.machine_rapid = true;
        }
    }

    /// LinuxCNC refuses an arc and a probing move that no word describes.
    fn check_motion_words(&mut self) {
        if !self.table.dialect.is_linuxcnc || self.block.unclear {
            return;
        }
        let (code, message) = match self.code(Group::Motion) {
            Some((Meaning::Arc { .. }, _)) => (code::ARC_CENTRE_MISSING, "the arc has no words"),
            Some((Meaning::Probe, _)) => (code::PROBE, "a probing move names no axis"),
            _ => return,
        };
        let span = self.block.span();
        self.findings.push_with(code, |code| Finding::new(code, span, message));
    }

    /// The axes whose words are in the mask.
    pub(super) fn named_axes(&self, axes: u32) -> AxisSet {
        set_bits(axes).fold(AxisSet::NONE, |named, place| match self.table.dialect.letters[place] {
            Letter::Axis(axis) | Letter::Increment(axis) => named.with_axis(axis),
            _ => named,
        })
    }

    /// `G53 G0` without axes, which LinuxCNC takes for the motion code alone; `G53` by itself is refused there.
    fn is_bare_machine_code(&self, axes: u32) -> bool {
        let is_straight = matches!(self.code(Group::Motion), Some((Meaning::Rapid | Meaning::Linear, _)));
        axes == 0 && is_straight && self.table.dialect.is_linuxcnc && self.state.absolute
    }

    /// Whether `G53` cannot be carried out, which is then reported.
    pub(super) fn is_wrong_machine_motion(&mut self, axes: u32) -> bool {
        let Some((_, span)) = self.code(Group::NonModal) else {
            return false;
        };
        let incremental = set_bits(axes).any(|place| matches!(self.table.dialect.letters[place], Letter::Increment(_)));
        if self.is_incremental_machine_motion(span) {
            self.used |= axes;
            return true;
        }
        let motion = if self.machine_rapid { Motion::Rapid } else { self.state.motion };
        let message = match motion {
            _ if axes == 0 => "machine coordinates without axis words",
            _ if incremental => "machine coordinates are absolute and take no incremental words",
            Motion::Arc { .. }
            | Motion::Cubic
            | Motion::Quadratic
            | Motion::Nurbs
            | Motion::Probe
            | Motion::Thread
            | Motion::ThreadCycle
            | Motion::SingleCycle(_)
            | Motion::RigidTap => "machine coordinates go with G0 or G1 only",
            _ => return false,
        };
        self.findings.push_with(code::MACHINE_MOTION, |code| {
            let finding = Finding::new(code, span, message);
            match axes {
                0 => finding.suggest(
                    "name the axes, such as G53 G0 Z0, or remove it: it holds for its block only and moves nothing",
                ),
                _ => finding,
            }
        });
        true
    }

    /// The feed of a cutting move; `None` after a finding, now or before.
    #[inline]
    pub(super) fn cutting_feed(&mut self) -> Option<Feed> {
        let feed = self.state.feed;
        if self.state.feed_unit == FeedUnit::InverseTime && self.block.word(b'F').is_none() {
            self.feed_missing("inverse time needs a feed in every cutting block");
            return None;
        }
        if feed <= 0.0 {
            if !self.state.reported.feed {
                self.state.reported.feed = true;
                self.feed_missing("a cutting move, but no feed has been programmed in this feed mode");
            }
            return None;
        }
        if self.state.unread & JUDGED_BY != 0 {
            return None;
        }
        match self.state.feed_unit {
            FeedUnit::PerMinute => Some(Feed::PerMinute(feed)),
            FeedUnit::InverseTime => Some(Feed::InverseTime(feed)),
            FeedUnit::PerRevolution if self.state.spindle_turns() => Some(Feed::PerRevolution(feed)),
            FeedUnit::PerRevolution => {
                self.spindle_stopped(feed);
                None
            }
        }
    }

    /// Reports axis words while no motion code is in force, once.
    #[cold]
    pub(super) fn motion_missing(&mut self) {
        self.state.motion = Motion::Unclear;
        let span = self.block.span();
        self.findings.push_with(code::MOTION_MISSING, |code| {
            let finding =
                Finding::new(code, span, "axis words, but no motion code says how to move").suggest("add G0 or G1");
            if self.settings.dialect == DialectName::LinuxCnc {
                return finding;
            }
            finding.suggest(
                "set language.initial_motion of the machine profile to INITIAL_MOTION_RAPID or INITIAL_MOTION_LINEAR, as \
                 the control has it (FANUC: parameter 3402, bit 0, is 0 or 1)",
            )
        });
    }

    #[cold]
    fn feed_missing(&mut self, message: &'static str) {
        let span = self.block.span();
        self.findings
            .push_with(code::FEED_MISSING, |code| Finding::new(code, span, message).suggest("add F to the block"));
    }

    #[cold]
    fn spindle_stopped(&mut self, feed_mm: f64) {
        if self.state.reported.spindle {
            return;
        }
        self.state.reported.spindle = true;
        let (span, [per_minute, _]) = (self.block.span(), self.settings.feed_codes());
        self.findings.push_with(code::SPINDLE_STOPPED, |code| {
            let message = format!("{feed_mm} mm per revolution with a spindle that does not turn never advances");
            Finding::new(code, span, message)
                .with_value("feed", feed_mm, "mm/rev")
                .suggest("start the spindle first, such as M3 S1000")
                .suggest(format!("use feed per minute, {per_minute}"))
        });
    }

    /// Emits a move to `end`, unless it is no move at all.
    #[inline]
    pub(super) fn emit_move(&mut self, kind: MoveKind, end: &Position, arc: Option<ArcGeometry>, feed: Feed) {
        if arc.is_none() {
            if !self.is_move(end) {
                return;
            }
            if !self.state.compensator.is_off() {
                self.name_exit(end);
            }
        }
        if self.state.coords.transform.is_some() {
            return self.emit_transformed(kind, end, arc, feed);
        }
        let (span, path_control, state) = (self.block.span(), self.path_control(), &*self.state);
        let leads_xyz = self.table.dialect.is_linuxcnc;
        let feed = if kind == MoveKind::Cutting && arc.is_none() && end[3..] != state.position[3..] {
            self.feed_of_straight(&state.position, end, feed)
        } else {
            feed
        };
        let step = || Move { leads_xyz, ..programmed_move(state, path_control, kind, end, arc, feed) };
        // In place, where a push would make the operation first and copy it then.
        self.operations.extend(core::iter::once_with(|| Operation { span, kind: OperationKind::Move(step()) }));
    }

    /// The same in transformed coordinates.
    #[cold]
    fn emit_transformed(&mut self, kind: MoveKind, end: &Position, arc: Option<ArcGeometry>, feed: Feed) {
        let arc = arc.map(|arc| self.state.coords.transform.as_ref().map_or(arc, |transform| transform.arc(&arc)));
        let mut step = Move { arc, ..self.new_move(kind, *end, feed) };
        if kind == MoveKind::Cutting && arc.is_none() {
            step.feed = self.feed_of_straight(&step.start, &step.end, feed);
        }
        self.emit(self.block.span(), OperationKind::Move(step));
    }

    /// The feed along the path of a straight cut, which [`straight_length`] measures, where other axes than X, Y and Z may move.
    ///
    /// LinuxCNC leads X, Y and Z at F, see [`Move::feed_on_path`]. FANUC controls lead all axes at it, a degree counted as a millimetre or, in inches, an inch
    /// (B-63324EN, section 4.3): the time is √(x² + … + c²)/F. Degrees of rotary axes that turn alone are the same in inches.
    #[cold]
    fn feed_of_straight(&self, start: &Position, end: &Position, feed: Feed) -> Feed {
        let length = straight_length(start, end);
        let linear = way_of(start, end, |axis| !axis.is_rotary());
        if length != linear {
            return self.feed_in_degrees(feed);
        }
        if self.table.dialect.is_linuxcnc {
            return feed;
        }
        let degrees = way_of(start, end, Axis::is_rotary) * (self.state.feed / self.state.feed_as_written);
        let led = (linear * linear + degrees * degrees).sqrt();
        match feed {
            Feed::PerMinute(feed) => Feed::PerMinute(feed * (length / led)),
            Feed::PerRevolution(feed) => Feed::PerRevolution(feed * (length / led)),
            Feed::InverseTime(_) => feed,
        }
    }

    const fn feed_in_degrees(&self, feed: Feed) -> Feed {
        match feed {
            Feed::PerMinute(_) => Feed::PerMinute(self.state.feed_as_written),
            Feed::PerRevolution(_) => Feed::PerRevolution(self.state.feed_as_written),
            Feed::InverseTime(_) => feed,
        }
    }

    /// Where the tip of a guided tool rests while the tool turns, F is degrees.
    pub(super) fn feed_of_guided(&self, step: &Move) -> Feed {
        let is_turn = step.kind == MoveKind::Cutting
            && (step.arc.is_none() && step.spline.is_none())
            && way_of(&step.start, &step.end, |axis| !axis.is_rotary()) <= LEAST_WAY_MM;
        if is_turn { self.feed_in_degrees(step.feed) } else { step.feed }
    }

    /// A straight move to `end` under the present modal states.
    #[inline]
    pub(super) fn new_move(&self, kind: MoveKind, end: Position, feed: Feed) -> Move {
        let step = programmed_move(self.state, self.path_control(), kind, &end, None, feed);
        let step = Move { leads_xyz: self.table.dialect.is_linuxcnc, ..step };
        match &self.state.coords.transform {
            None => step,
            Some(transform) => Move { start: transform.apply(&step.start), end: transform.apply(&step.end), ..step },
        }
    }
}

/// A move to `end` under the present modal states, in the coordinates that are programmed.
#[inline(always)]
fn programmed_move(
    state: &InterpreterState,
    path_control: PathControl,
    kind: MoveKind,
    end: &Position,
    arc: Option<ArcGeometry>,
    feed: Feed,
) -> Move {
    Move {
        kind,
        start: state.position,
        end: *end,
        work_offset: state.coords.total,
        arc,
        spline: None,
        path_control,
        feed,
        leads_xyz: false,
        spindle: state.spindle(),
        tool: state.tool,
        cycle: None,
    }
}

/// Places of the bits set in a mask, ascending.
#[inline]
pub(super) fn set_bits(mut mask: u32) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let place = mask.trailing_zeros();
        mask &= mask.wrapping_sub(1);
        (place < 32).then_some(place as usize)
    })
}
