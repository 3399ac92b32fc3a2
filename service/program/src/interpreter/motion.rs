//! Motion of one block: where it ends, and the move there.

use super::execute::Execution;
use super::spline::is_point;
use crate::code;
use crate::consequence::JUDGED_BY;
use crate::dialect::{Code, FeedUnit, Flow, Group, Letter, Meaning, letter_bit};
use crate::state::{Motion, ToolMode};
use crate::{ArcGeometry, Axis, AxisSet, Feed, Finding, Move, MoveKind, OperationKind, Position};

/// The letters of an arc's centre.
const CENTRE_LETTERS: u32 = letter_bit(b'I') | letter_bit(b'J') | letter_bit(b'K');

/// The letters of chamfers and roundings without a comma.
const PLAIN_CORNER_LETTERS: u32 = letter_bit(b'R') | letter_bit(b'I') | letter_bit(b'K') | letter_bit(b'C');

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
        if let Some(code) = self.block.code(Group::Motion) {
            let &Code { meaning, tenths, .. } = self.table.code(code.place);
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
                Meaning::NurbsEnd => return self.close_nurbs(before),
                Meaning::Thread => Motion::Thread,
                Meaning::Probe => Motion::Probe,
                // It is carried out once; the motion before it stays in force.
                Meaning::ThreadCycles if self.is_thread_refused() => return,
                Meaning::ThreadCycles => return self.thread_cycles(),
                Meaning::ThreadCycle => return self.open_thread_cycle(),
                Meaning::Turning(_) if self.is_thread_refused() => return,
                Meaning::Turning(cycle) => return self.turning_cycle(cycle, before),
                Meaning::OfNoSystem(what) => return self.cycle_of_no_system(what),
                _ => Motion::Unclear,
            };
            if self.state.motion != Motion::Cubic {
                self.state.spline_exit = None;
            }
        }
        let one_block = self.block.code(Group::NonModal).map(|code| self.table.code(code.place).meaning);
        let frame = match one_block {
            Some(Meaning::MachineCoordinates) => Frame::Machine,
            _ if self.state.motion == Motion::Nurbs => return self.nurbs(),
            // Its axis words are its own; what it left is reported as unused.
            // In LinuxCNC a move may follow the dwell, if a motion code is written.
            Some(Meaning::Dwell) if self.table.dialect.is_linuxcnc && self.block.code(Group::Motion).is_some() => {
                Frame::Work
            }
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
            ) => return,
            Some(Meaning::Skip) => return self.probing_move(),
            Some(Meaning::SpeedClampOrThreadCycle) => return self.open_thread_cycle(),
            _ => Frame::Work,
        };
        if self.state.drilling.cycle.is_some() {
            return self.drill(frame);
        }
        if frame == Frame::Machine && self.table.dialect.flow == Flow::MacroB {
            self.rapid_to_machine(before);
        }
        if self.state.motion == Motion::Probe
            && frame == Frame::Work
            && self.block.letters & self.table.axis_letters & !self.used != 0
        {
            return self.probing_move();
        }
        if !self.state.tool_control.is_plain() {
            return self.guided_motion(frame, before);
        }
        if frame == Frame::Work && self.state.motion == Motion::RigidTap {
            return self.rigid_tap();
        }
        if frame == Frame::Work && matches!(self.state.motion, Motion::Thread | Motion::ThreadCycle) {
            if !self.is_thread_refused() {
                self.thread_motion();
            }
            return;
        }
        if let (Frame::Work, Motion::SingleCycle(cycle)) = (frame, self.state.motion) {
            return self.single_cycle(cycle);
        }
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        if (self.block.has_comma_words() || self.settings.plain_drawing_words)
            && frame == Frame::Work
            && let Some(word) = self.angle_word()
        {
            return self.angle_motion(word, axes);
        }
        let curve_words = self.block.letters & !self.used & curve_letters(self.state.motion);
        if frame == Frame::Machine && !self.block.unclear {
            if self.is_wrong_machine_motion(axes) {
                self.used |= CURVE_LETTERS;
                if self.state.motion == Motion::Nurbs {
                    self.state.motion = Motion::Unclear;
                }
                self.state.position = self.target(axes, frame);
                return;
            }
        } else if axes == 0 && (curve_words == 0 || self.is_contour_control(axes, before)) {
            return self.check_motion_words();
        }
        if self.state.angle_line.is_some() {
            self.check_angle_line();
        }
        let plain = self.table.dialect.plain_corners && self.block.letters & PLAIN_CORNER_LETTERS != 0;
        let may_have_corner = self.block.has_comma_words() || plain;
        let end = self.target(axes, frame);
        if self.block.unclear {
            self.state.position = end;
            return;
        }
        let motion = if self.machine_rapid { Motion::Rapid } else { self.state.motion };
        match motion {
            Motion::Rapid => self.emit_move(MoveKind::Rapid, &end, None, Feed::PerMinute(0.0)),
            Motion::Linear => {
                if end != self.state.position
                    && let Some(feed) = self.cutting_feed(axes)
                {
                    if may_have_corner {
                        let corner = self.corner_words(axes);
                        self.emit_with_corner(corner, |this| this.emit_move(MoveKind::Cutting, &end, None, feed));
                    } else {
                        self.emit_move(MoveKind::Cutting, &end, None, feed);
                    }
                }
            }
            Motion::Arc { clockwise } => {
                if let Some(arc) = self.arc(clockwise, &end)
                    && let Some(feed) = self.cutting_feed(axes)
                {
                    if self.block.has_comma_words() {
                        let corner = self.corner_words(axes);
                        self.emit_with_corner(corner, |this| this.emit_move(MoveKind::Cutting, &end, Some(arc), feed));
                    } else {
                        self.emit_move(MoveKind::Cutting, &end, Some(arc), feed);
                    }
                }
            }
            Motion::Cubic | Motion::Quadratic => {
                let cubic = self.state.motion == Motion::Cubic;
                if let Some(spline) = self.spline(cubic, axes, &end)
                    && let Some(feed) = self.cutting_feed(axes)
                    && !is_point(&spline)
                {
                    let mut step = self.new_move(MoveKind::Cutting, end, feed);
                    step.spline = Some(self.placed_spline(spline));
                    self.emit(self.block.span(), OperationKind::Move(step));
                }
            }
            Motion::None => {
                self.state.motion = Motion::Unclear;
                let span = self.block.span();
                self.findings.push_with(code::MOTION_MISSING, |code| {
                    Finding::new(code, span, "axis words, but no motion code says how to move").suggest("add G0 or G1")
                });
            }
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
        self.state.position = end;
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
        self.findings.push_with(code::MACHINE_MOTION, |code| Finding::new(code, span, message));
        true
    }

    /// The position after the axis words in the mask `axes`, which are used by this.
    #[inline]
    pub(super) fn target(&mut self, axes: u32, frame: Frame) -> Position {
        let coords = &self.state.coords;
        let is_plain = frame == Frame::Work && coords.polar.is_none() && !coords.awaits_absolute;
        if is_plain && self.state.tool_control.held.is_empty() {
            let mut end = self.state.position;
            self.plain_target(axes, &mut end);
            return end;
        }
        self.transformed_target(axes, frame)
    }

    /// Places the axes of the words where these are work coordinates, and the program knows where every axis is.
    #[inline]
    fn plain_target(&mut self, axes: u32, end: &mut Position) {
        self.used |= axes;
        let mut named = 0u32;
        for place in set_bits(axes) {
            let letter = self.table.dialect.letters[place];
            let (axis, increment) = match letter {
                Letter::Axis(axis) => (axis, !self.state.absolute),
                Letter::Increment(axis) => (axis, true),
                _ => continue,
            };
            let word = self.block.slot(place);
            let mut value = if axis == Axis::X { self.radius(word) } else { self.scaled(word, letter.is_length()) };
            if named & (1 << axis.index()) != 0 {
                self.named_twice(place);
            }
            named |= 1 << axis.index();
            if axis.is_rotary() && !increment {
                value = self.rolled(axis, value, Frame::Work, place);
            }
            let target = &mut end[axis.index()];
            *target = if increment { *target + value } else { value };
        }
    }

    #[cold]
    fn named_twice(&mut self, place: usize) {
        let word = *self.block.slot(place);
        self.word_conflict(&word, "the block has both an absolute and an incremental word for this axis");
    }

    fn transformed_target(&mut self, axes: u32, frame: Frame) -> Position {
        let mut end = self.state.position;
        let mut named = 0u32;
        self.used |= axes;
        let mut axes = axes;
        if self.state.coords.awaits_absolute {
            self.check_absolute(axes);
        }
        if frame == Frame::Work && self.state.coords.polar.is_some() {
            axes = self.polar_target(axes, &mut end);
        }
        // Machine positions are behind every transformation.
        let mut machine =
            (frame == Frame::Machine && self.state.coords.transform.is_some()).then(|| self.machine_position());
        for place in set_bits(axes) {
            let letter = self.table.dialect.letters[place];
            let (axis, increment) = match letter {
                Letter::Axis(axis) => (axis, !self.state.absolute && frame == Frame::Work),
                Letter::Increment(axis) => (axis, true),
                _ => continue,
            };
            let word = self.block.slot(place);
            let value = if axis == Axis::X { self.radius(word) } else { self.scaled(word, letter.is_length()) };
            if named & (1 << axis.index()) != 0 {
                self.named_twice(place);
            }
            named |= 1 << axis.index();
            let value = if axis.is_rotary() && !increment { self.rolled(axis, value, frame, place) } else { value };
            if !self.state.tool_control.held.is_empty() {
                let span = self.block.word_span(self.block.slot(place));
                self.place_held(axis, increment, value, span);
            }
            if let Some(machine) = &mut machine {
                machine[axis.index()] = value;
                continue;
            }
            let target = &mut end[axis.index()];
            if increment {
                *target += value;
            } else if frame == Frame::Machine {
                *target = value - self.machine_offset()[axis.index()];
            } else {
                *target = value;
            }
        }
        match machine {
            Some(machine) => self.state.coords.programmed(&machine),
            None => end,
        }
    }

    /// The angle that an absolute word of an axis that rolls over means; others mean what they say.
    #[cold]
    fn rolled(&mut self, axis: Axis, value: f64, frame: Frame, place: usize) -> f64 {
        if !self.settings.coordinates.rolls_over(axis) {
            return value;
        }
        let span = self.block.word_span(self.block.slot(place));
        if self.state.tool_control.held.contains(axis) {
            let message = format!("{} rolls over, but only the machine knows where it is", axis.letter());
            let letter = axis.letter();
            let first = match self.state.tool_control.mode {
                ToolMode::Off => "",
                ToolMode::Plane => "cancel the plane with G69, then ",
                ToolMode::Angles | ToolMode::Vectors => "switch the tool centre point control off with G49, then ",
            };
            let cure = format!("{first}send it to its reference position with G91 G28 {letter}0, and go on in G90");
            self.coord(code::ROLL_OVER, span, message, cure);
            return value;
        }
        let offset = if frame == Frame::Machine { self.machine_offset()[axis.index()] } else { 0.0 };
        let present = self.state.position[axis.index()] + offset;
        match rolled_over(present, value, self.table.dialect.is_linuxcnc) {
            Ok(rolled) => rolled,
            Err(message) => {
                let message = format!("{}{value}: {message}", axis.letter());
                let cure = "go there in two moves, or by an incremental one";
                self.findings.push_with(code::ROLL_OVER, |code| {
                    Finding::new(code, span, message).with_value("present", present, "deg").suggest(cure)
                });
                value
            }
        }
    }

    /// The feed of a cutting move over these axis words; `None` after a finding, now or before.
    #[inline]
    pub(super) fn cutting_feed(&mut self, axes: u32) -> Option<Feed> {
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
            FeedUnit::PerMinute => {
                let rotary =
                    |place: usize| matches!(self.table.dialect.letters[place], Letter::Axis(axis) if axis.is_rotary());
                let rotary_only =
                    self.state.feed != self.state.feed_as_written && axes != 0 && set_bits(axes).all(rotary);
                Some(Feed::PerMinute(if rotary_only { self.state.feed_as_written } else { feed }))
            }
            FeedUnit::InverseTime => Some(Feed::InverseTime(feed)),
            FeedUnit::PerRevolution if self.state.spindle_turns() => Some(Feed::PerRevolution(feed)),
            FeedUnit::PerRevolution => {
                self.spindle_stopped(feed);
                None
            }
        }
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
        let span = self.block.span();
        self.findings.push_with(code::SPINDLE_STOPPED, |code| {
            let message = format!("{feed_mm} mm per revolution with a spindle that does not turn never advances");
            Finding::new(code, span, message)
                .with_value("feed", feed_mm, "mm/rev")
                .suggest("start the spindle first, such as M3 S1000")
                .suggest("use feed per minute, G94")
        });
    }

    /// Emits a move to `end`, unless it is no move at all.
    #[inline]
    pub(super) fn emit_move(&mut self, kind: MoveKind, end: &Position, arc: Option<ArcGeometry>, feed: Feed) {
        if arc.is_none() && *end == self.state.position {
            return;
        }
        if self.state.coords.transform.is_some() {
            return self.emit_transformed(kind, end, arc, feed);
        }
        let step = Move { arc, ..self.programmed_move(kind, end, feed) };
        self.operations.push(crate::Operation { span: self.block.span(), kind: OperationKind::Move(step) });
    }

    /// The same in transformed coordinates.
    #[cold]
    fn emit_transformed(&mut self, kind: MoveKind, end: &Position, arc: Option<ArcGeometry>, feed: Feed) {
        let arc = arc.map(|arc| self.state.coords.transform.as_ref().map_or(arc, |transform| transform.arc(&arc)));
        let step = Move { arc, ..self.new_move(kind, *end, feed) };
        self.emit(self.block.span(), OperationKind::Move(step));
    }

    /// A straight move to `end` under the present modal states.
    #[inline]
    pub(super) fn new_move(&self, kind: MoveKind, end: Position, feed: Feed) -> Move {
        let step = self.programmed_move(kind, &end, feed);
        match &self.state.coords.transform {
            None => step,
            Some(transform) => Move { start: transform.apply(&step.start), end: transform.apply(&step.end), ..step },
        }
    }

    /// The same in the coordinates that are programmed.
    #[inline(always)]
    fn programmed_move(&self, kind: MoveKind, end: &Position, feed: Feed) -> Move {
        Move {
            kind,
            start: self.state.position,
            end: *end,
            work_offset: self.machine_offset(),
            arc: None,
            spline: None,
            path_control: self.path_control(),
            feed,
            spindle: self.state.spindle(),
            tool: self.state.tool,
            cycle: None,
        }
    }
}

/// Half a turn is as far one way as the other, within this, degrees.
const HALF_TURN_TOLERANCE_DEG: f64 = 1e-9;

/// Where an axis that rolls over goes for an absolute word: the shorter way; in LinuxCNC the sign says which way.
fn rolled_over(present: f64, value: f64, is_linuxcnc: bool) -> Result<f64, &'static str> {
    if is_linuxcnc {
        if value.abs() >= 360.0 {
            return Err("an axis that wraps takes less than a full turn");
        }
        let rolled = value.abs() + (present / 360.0).floor() * 360.0;
        return Ok(match value.is_sign_negative() {
            false if rolled < present => rolled + 360.0,
            true if rolled > present => rolled - 360.0,
            _ => rolled,
        });
    }
    let ahead = (value - present).rem_euclid(360.0);
    if (ahead - 180.0).abs() < HALF_TURN_TOLERANCE_DEG {
        return Err("it is half a turn away, so that both ways are equally short");
    }
    Ok(present + if ahead > 180.0 { ahead - 360.0 } else { ahead })
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
