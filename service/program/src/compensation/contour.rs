//! A contour between `G41` and the move behind `G40`: operations in, the path of the tool out.

mod ends;

use core::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use ends::{is_lead, is_smooth};

use super::geometry::{Circle, Curve, Point, Side, angle_between, dot, minus, plus};
use super::joint::{Corner, Joint, Meeting};
use super::window::{Place, Window, is_same};
use super::{CompensationMode, CompensationRules, report};
use crate::path_move::PathMove;
use crate::{
    ArcGeometry, Axis, AxisSet, Feed, FindingLog, Move, MoveKind, Operation, OperationKind, Plane, Position,
    SourceSpan, ToolGuide,
};

/// Blocks without motion in the plane that FANUC controls look over.
const MAX_IDLE_BLOCKS: u32 = 2;

/// Operations that wait for the next motion in the plane at most.
const MAX_WAITING: usize = 1_000;

/// Rounding of lengths and angles, mm and rad.
const ROUNDING: f64 = 1e-9;

/// Where the stage is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Phase {
    /// On, but nothing has moved in the plane yet.
    Entering,
    On,
    /// Off, but the tool still stands beside the programmed point.
    Leaving,
    /// The same, and the next move goes to a programmed point in the plane, be it the present one.
    Exiting,
}

/// A move in the plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Block {
    span: SourceSpan,
    step: PathMove,
    /// As programmed.
    curve: Curve,
}

/// A block whose end is not known yet.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Pending {
    block: Block,
    /// Where the centre of the tool starts.
    from: Point,
    /// What an arc has lost at its start, rad.
    lost_rad: f64,
    is_entry: bool,
    /// The entry of a contour that was reached at right angles: the window has it.
    is_beside: bool,
    /// After an error: it is not judged any more.
    is_broken: bool,
    place: Place,
    /// The block before it is the entry, or goes over into it without a corner.
    is_smooth: bool,
}

/// A contour in work: what of it is not handed on yet.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Contour {
    mode: CompensationMode,
    /// What switched it on, then off.
    span: SourceSpan,
    phase: Phase,
    /// Where the tool is, beside the programmed point.
    displacement: Point,
    /// Where the tool is, along the axes of the plane.
    at: Point,
    pending: Option<Pending>,
    /// Behind the pending block the tool is lifted or comes down rapidly: what follows does not meet it.
    is_elsewhere: bool,
    /// What follows the pending block without motion in the plane.
    waiting: Vec<Operation>,
    idle_blocks: u32,
    /// Program and line of the last of them.
    idle_line: (u32, u32),
    /// Something was said that need not be said again until the next motion in the plane.
    reported: bool,
    window: Window,
}

/// Where operations and findings go.
pub(super) struct Sink<'a> {
    pub(super) out: &'a mut Vec<Operation>,
    pub(super) findings: &'a mut FindingLog,
}

impl Sink<'_> {
    #[inline]
    fn push(&mut self, span: SourceSpan, step: PathMove) {
        self.out.push(Operation { span, kind: step.into() });
    }
}

/// How a move moves in the plane.
enum InPlane {
    Rests,
    Moves(Curve),
    /// A spline, or an arc of another plane.
    Foreign,
}

impl Contour {
    pub(super) fn new(mode: CompensationMode, span: SourceSpan, displacement: Point) -> Self {
        Self {
            mode,
            span,
            phase: Phase::Entering,
            displacement,
            at: [0.0; 2],
            pending: None,
            is_elsewhere: false,
            waiting: Vec::new(),
            idle_blocks: 0,
            idle_line: (0, 0),
            reported: false,
            window: Window::default(),
        }
    }

    pub(super) fn is_leaving(&self) -> bool {
        matches!(self.phase, Phase::Leaving | Phase::Exiting)
    }

    pub(super) const fn plane(&self) -> Plane {
        self.mode.plane
    }

    pub(super) const fn displacement(&self) -> Point {
        self.displacement
    }

    fn side(&self) -> Side {
        Side { left: self.mode.left, radius: self.mode.radius_mm }
    }

    fn axes(&self) -> [usize; 2] {
        let (first, second) = self.mode.plane.axes();
        [first.index(), second.index()]
    }

    fn in_plane(&self, position: &Position) -> Point {
        self.axes().map(|axis| position[axis])
    }

    fn place(&self, position: &mut Position, point: Point) {
        for (axis, value) in self.axes().into_iter().zip(point) {
            position[axis] = value;
        }
    }

    fn motion(&self, step: &Move) -> InPlane {
        let (from, to) = (self.in_plane(&step.start), self.in_plane(&step.end));
        match (&step.arc, &step.spline) {
            (_, Some(_)) => InPlane::Foreign,
            (Some(arc), None) if arc.plane != self.mode.plane => InPlane::Foreign,
            (Some(arc), None) => InPlane::Moves(Curve::arc(from, to, arc.center, arc.sweep_rad)),
            (None, None) if from == to => InPlane::Rests,
            (None, None) => InPlane::Moves(Curve::line(from, to)),
        }
    }

    /// Takes an operation; whether the tool is on the programmed path again behind it.
    pub(super) fn take(&mut self, operation: Operation, sink: &mut Sink) -> bool {
        let Operation { span, kind } = operation;
        let step = match PathMove::of(kind, self.mode.tilted) {
            Ok(step) => step,
            Err(kind) => return self.take_other(Operation { span, kind }, sink),
        };
        match (self.motion(&step), self.phase) {
            (InPlane::Foreign, _) => {
                let operation = Operation { span, kind: step.into() };
                self.refuse(operation, "a spline or an arc in another plane", sink)
            }
            (InPlane::Rests, Phase::Entering) => {
                self.rest_before_entry(step, span, sink);
                false
            }
            (InPlane::Rests, Phase::On) => {
                if step.kind == MoveKind::Rapid {
                    // The tool is lifted or comes down: what follows is cut elsewhere.
                    self.window.clear();
                    self.is_elsewhere = self.pending.is_some();
                }
                self.wait(Operation { span, kind: step.into() }, sink);
                false
            }
            (InPlane::Rests, Phase::Leaving) => self.rest_before_exit(step, span, sink),
            (InPlane::Moves(curve), Phase::Entering) => {
                self.enter(Block { span, step, curve }, sink);
                false
            }
            (InPlane::Moves(curve), Phase::On) => {
                self.go_on(Block { span, step, curve }, sink);
                false
            }
            (InPlane::Rests, Phase::Exiting) => {
                let here = self.in_plane(&step.end);
                self.exit(Block { span, step, curve: Curve::line(here, here) }, sink);
                true
            }
            (InPlane::Moves(curve), Phase::Leaving | Phase::Exiting) => {
                self.exit(Block { span, step, curve }, sink);
                true
            }
        }
    }

    /// Takes what is no move along a path of the contour's coordinates; whether the contour ends with it.
    fn take_other(&mut self, operation: Operation, sink: &mut Sink) -> bool {
        let Operation { span, kind } = &operation;
        match kind {
            OperationKind::End => {
                if !self.is_leaving() && self.mode.rules != CompensationRules::LinuxCnc {
                    report::unfinished(*span, self.span, sink.findings);
                }
                self.stand(sink);
                sink.out.push(operation);
                true
            }
            OperationKind::Guided(guided) if self.goes_to_the_machine(guided.guide) => {
                let stays = guided.held.meets(AxisSet::LINEAR);
                self.leave_plane(operation, stays, sink);
                true
            }
            OperationKind::Move(_) | OperationKind::Thread(_) | OperationKind::Guided(_) => {
                self.refuse(operation, "a thread or a guided tool", sink)
            }
            _ => {
                self.wait(operation, sink);
                false
            }
        }
    }

    /// From beside a contour of a tilted plane to a place of the machine (`G53`, `G28`).
    fn goes_to_the_machine(&self, guide: ToolGuide) -> bool {
        self.mode.tilted && self.is_leaving() && guide == ToolGuide::Axes
    }

    /// What no compensated contour can hold; the contour ends with it.
    #[cold]
    fn refuse(&mut self, operation: Operation, what: &'static str, sink: &mut Sink) -> bool {
        let (on, is_beside) = (self.span, self.is_leaving());
        report::not_permitted(operation.span, on, is_beside, what, sink.findings);
        self.stand(sink);
        sink.out.push(operation);
        true
    }

    /// An operation without motion in the plane.
    fn wait(&mut self, mut operation: Operation, sink: &mut Sink) {
        let Some(pending) = &self.pending else {
            if let Some(step) = operation.kind.path_step_mut() {
                self.displace(step);
            }
            return sink.out.push(operation);
        };
        let pending_span = pending.block.span;
        let line = line_of(operation.span);
        self.idle_blocks += u32::from(line != line_of(pending_span) && line != self.idle_line);
        self.idle_line = line;
        self.waiting.push(operation);
        let looks_over = self.mode.rules == CompensationRules::LinuxCnc || self.idle_blocks <= MAX_IDLE_BLOCKS;
        let is_full = self.waiting.len() >= MAX_WAITING;
        let is_leaving = self.is_leaving();
        if (is_full || !looks_over) && !is_leaving && !self.reported {
            self.reported = true;
            let most = if looks_over { MAX_WAITING as u32 } else { MAX_IDLE_BLOCKS };
            report::idle_blocks(self.waiting[0].span, pending_span, most, sink.findings);
        }
        if is_full || !looks_over && is_leaving {
            self.stand(sink);
        }
    }

    /// A move that rests in the plane rests where the tool is.
    fn displace(&self, step: &mut Move) {
        let point = plus(self.in_plane(&step.start), self.displacement);
        self.place(&mut step.start, point);
        self.place(&mut step.end, point);
    }

    /// A further move in the plane.
    fn go_on(&mut self, mut block: Block, sink: &mut Sink) {
        let side = self.side();
        let Block { span, curve, .. } = block;
        resolve_feed(&mut block, self.mode.plane);
        let mut is_broken = false;
        if curve.circle.is_some() && side.offset_radius(&curve) <= ROUNDING {
            is_broken = true;
            report::arc_too_small(span, curve.radius(), side.radius, sink.findings);
        }
        let is_first = self.pending.as_ref().is_some_and(|pending| pending.is_entry);
        let goes_on = |pending: &Pending| is_smooth(&pending.block.curve, &curve);
        let is_smooth = is_first || self.pending.as_ref().is_some_and(goes_on);
        let (joint, turn_rad) = match self.pending.take() {
            // Where they do not meet, a block that was refused is missing between them.
            Some(pending) if is_same(pending.block.curve.to, curve.from) => self.join(pending, &block, is_broken, sink),
            pending => {
                self.pending = pending;
                self.stand(sink);
                (Joint::at(plus(curve.from, side.offset(curve.start_tangent()))), 0.0)
            }
        };
        let place = self.window.advance(&curve, turn_rad).moving(block.step.kind == MoveKind::Rapid);
        // Until the block behind it shows whether it leads there.
        let place = place.linking(is_first && is_lead(&curve));
        self.corner(&joint, &block, place, sink);
        let lost_rad = joint.lost_rad[1];
        self.pending = Some(Pending {
            block,
            from: joint.start,
            lost_rad,
            is_entry: false,
            is_beside: false,
            is_broken,
            place,
            is_smooth,
        });
    }

    /// Joins the pending block to the next; how the direction changes there, rad.
    fn join(&mut self, mut pending: Pending, next: &Block, is_broken: bool, sink: &mut Sink) -> (Joint, f64) {
        let is_rapid = next.step.kind == MoveKind::Rapid;
        let meeting = Meeting::new(self.side(), &pending.block.curve, &next.curve, is_rapid);
        let joint = if is_broken || pending.is_broken {
            meeting.around()
        } else {
            let rules = self.mode.rules;
            let joint = if pending.is_entry { meeting.entry(rules) } else { meeting.joint(rules) };
            joint.unwrap_or_else(|| {
                report::no_crossing(next.span, pending.block.span, self.mode.radius_mm, sink.findings);
                meeting.around()
            })
        };
        report::overcut(self.span, next.span, joint.overcut, sink.findings);
        let turn_rad = if pending.is_entry { 0.0 } else { meeting.heading_rad() };
        if !pending.is_entry && !is_smooth(&pending.block.curve, &next.curve) {
            pending.place = pending.place.as_wall();
        }
        self.hand_on(pending, &joint, sink);
        (joint, turn_rad)
    }

    /// Hands on the pending block up to the joint, and what waits behind it.
    fn hand_on(&mut self, pending: Pending, joint: &Joint, sink: &mut Sink) {
        let is_last = self.is_leaving();
        if !pending.is_broken && !pending.is_beside && !pending.is_entry {
            let Block { span, curve, .. } = pending.block;
            let gouges = self.window.add(curve, self.mode.radius_mm, pending.place, span.line, is_last);
            report::gouges(span, gouges, sink.findings);
        }
        let Pending { block: Block { span, mut step, curve }, from, lost_rad, is_entry, is_broken, place, .. } =
            pending;
        let to = joint.end;
        let mut path = Curve::line(from, to);
        let mut is_backwards = !is_entry && dot(minus(to, from), curve.end_tangent()) < -ROUNDING;
        if let Some(circle) = &curve.circle {
            let left = circle.sweep_rad.abs() - lost_rad - joint.lost_rad[0];
            is_backwards = !is_entry && left < -ROUNDING;
            let between = angle_between(minus(from, circle.center), minus(to, circle.center), circle.is_clockwise());
            let turns = libm::round((left - between) / TAU).max(0.0);
            let sweep_rad = (between + turns * TAU).copysign(circle.sweep_rad);
            path.circle = Some(Circle { center: circle.center, sweep_rad });
        }
        if is_broken || is_backwards {
            path.circle = None;
        }
        if is_backwards && !is_broken {
            report::backwards(span, self.mode.radius_mm, sink.findings);
        } else if !is_broken {
            let gouges = self.window.pass(path, self.mode.radius_mm, place, span.line, is_last);
            report::gouges(span, gouges, sink.findings);
        }
        if std::mem::take(&mut self.is_elsewhere) {
            self.window.clear();
        }
        step.arc = path.circle.map(|circle| self.geometry(&circle));
        let target = plus(to, self.mode.reference_mm);
        let moves = step.arc.is_some() || !is_same(self.at, target);
        self.place(&mut step.start, self.at);
        if moves {
            self.at = target;
        }
        self.place(&mut step.end, self.at);
        if moves || !step.is_nothing() {
            sink.push(span, step);
        }
        self.displacement = minus(self.at, curve.to);
        self.hand_on_waiting(sink);
    }

    fn hand_on_waiting(&mut self, sink: &mut Sink) {
        self.idle_blocks = 0;
        self.idle_line = (0, 0);
        self.reported = false;
        let mut waiting = std::mem::take(&mut self.waiting);
        for mut operation in waiting.drain(..) {
            if let Some(step) = operation.kind.path_step_mut() {
                self.place(&mut step.start, self.at);
                self.place(&mut step.end, self.at);
            }
            sink.out.push(operation);
        }
        // Its storage is used again.
        self.waiting = waiting;
    }

    fn geometry(&self, circle: &Circle) -> ArcGeometry {
        let center = plus(circle.center, self.mode.reference_mm);
        let Circle { sweep_rad, .. } = *circle;
        ArcGeometry { plane: self.mode.plane, center, clockwise: circle.is_clockwise(), sweep_rad }
    }

    /// How a corner is passed, by the words of the block behind it.
    fn corner(&mut self, joint: &Joint, next: &Block, place: Place, sink: &mut Sink) {
        let (points, count, circle) = match joint.corner {
            Corner::Lines(points, count) => (points, count, None),
            Corner::Arc(circle) => ([joint.start; 3], 1, Some(circle)),
        };
        for to in points.into_iter().take(count) {
            let from = minus(self.at, self.mode.reference_mm);
            let gouges = self.window.pass(
                Curve { from, to, circle },
                self.mode.radius_mm,
                place.corner(),
                next.span.line,
                false,
            );
            report::gouges(next.span, gouges, sink.findings);
            self.piece(next, to, circle, sink);
        }
    }

    /// A move before a block, to where the centre of the tool gets.
    fn piece(&mut self, next: &Block, to: Point, circle: Option<Circle>, sink: &mut Sink) {
        let target = plus(to, self.mode.reference_mm);
        if circle.is_none() && is_same(self.at, target) {
            return;
        }
        let mut piece = next.step.clone();
        piece.arc = circle.map(|circle| self.geometry(&circle));
        piece.feed = feed_per_minute(next, self.mode.plane);
        piece.end = piece.start;
        piece.rest_rotary();
        self.place(&mut piece.start, self.at);
        self.place(&mut piece.end, target);
        self.at = target;
        sink.push(next.span, piece);
    }

    /// Ends the pending block beside its programmed end.
    pub(super) fn stand(&mut self, sink: &mut Sink) {
        if let Some(pending) = self.pending.take() {
            let curve = &pending.block.curve;
            let joint = Joint::at(plus(curve.to, self.side().offset(curve.end_tangent())));
            self.hand_on(pending, &joint, sink);
        }
    }
}

/// Which block of which program.
const fn line_of(span: SourceSpan) -> (u32, u32) {
    (span.program, span.line)
}

/// Inverse time is that of the programmed length, as the compensated one is longer or shorter; rotary axes keep it.
fn resolve_feed(block: &mut Block, plane: Plane) {
    let Move { start, end, feed, .. } = &*block.step;
    let turns = [Axis::A, Axis::B, Axis::C].iter().any(|axis| start[axis.index()] != end[axis.index()]);
    if matches!(feed, Feed::InverseTime(_)) && !turns {
        block.step.feed = feed_per_minute(block, plane);
    }
}

/// The feed, as one per minute where it is an inverse time: the programmed length in that time.
fn feed_per_minute(block: &Block, plane: Plane) -> Feed {
    let Block { step, curve, .. } = block;
    let Feed::InverseTime(per_minute) = step.feed else { return step.feed };
    let normal = plane.normal().index();
    let [in_plane, across] = [curve.length(), step.end[normal] - step.start[normal]];
    Feed::PerMinute((in_plane * in_plane + across * across).sqrt() * per_minute)
}
