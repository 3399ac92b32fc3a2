//! How a contour begins and ends: the first move in the plane, and the move behind `G40`.

use core::f64::consts::PI;

use super::super::geometry::{Curve, Side, along, angle_between, distance, dot, length, minus, plus};
use super::super::joint::Meeting;
use super::super::window::Place;
use super::super::{CompensationEntry, CompensationRules, report};
use super::{Block, Contour, Pending, Phase, ROUNDING, Sink, line_of, resolve_feed};
use crate::path_move::PathMove;
use crate::{MoveKind, Operation, SourceSpan};

impl Contour {
    /// A block in front of the first move in the plane.
    pub(super) fn rest_before_entry(&mut self, mut step: PathMove, span: SourceSpan, sink: &mut Sink) {
        if self.mode.rules == CompensationRules::LinuxCnc && !self.reported {
            self.reported = true;
            report::entry_short(span, 0.0, self.mode.radius_mm, sink.findings);
        }
        self.displace(&mut step);
        sink.push(span, step);
    }

    /// The first move in the plane.
    pub(super) fn enter(&mut self, mut block: Block, sink: &mut Sink) {
        let Block { span, curve, .. } = block;
        self.phase = Phase::On;
        self.reported = false;
        self.at = plus(curve.from, self.displacement);
        let radius = self.mode.radius_mm;
        let reach = distance(curve.from, curve.to);
        let is_arc = curve.circle.is_some();
        let mut is_broken = true;
        resolve_feed(&mut block, self.mode.plane);
        match (self.mode.rules, &curve.circle) {
            (CompensationRules::LinuxCnc, _) if reach <= radius => {
                report::entry_short(span, reach, radius, sink.findings);
            }
            (CompensationRules::LinuxCnc, Some(_)) => match entry_arc(self.side(), &curve) {
                Some(arc) => (block.curve, is_broken) = (arc, false),
                None => report::arc_too_small(span, curve.radius(), radius, sink.findings),
            },
            (CompensationRules::Fanuc { .. }, Some(_)) => report::entry_arc(span, sink.findings),
            (_, None) => is_broken = false,
        }
        let is_type_c = matches!(self.mode.rules, CompensationRules::Fanuc { entry: CompensationEntry::C, .. });
        let is_beside = is_type_c && line_of(span) != line_of(self.span) && !is_broken;
        let mut from = curve.from;
        let mut place = Place::LINK;
        if is_beside {
            from = plus(from, self.side().offset(curve.start_tangent()));
            place = self.window.advance(&curve, 0.0);
            report::gouges(span, self.window.add(curve, radius, place, span.line, false), sink.findings);
        }
        if is_beside || is_arc {
            // The reference point moves along an arc only once it is beside the centre of the nose.
            self.piece(&block, from, None, sink);
        }
        self.pending = Some(Pending {
            block,
            from,
            lost_rad: 0.0,
            is_entry: !is_beside,
            is_beside,
            is_broken,
            place,
            is_smooth: true,
        });
    }

    /// `G40`: whether the tool is on the programmed path.
    pub(in super::super) fn leave(&mut self, span: SourceSpan, sink: &mut Sink) -> bool {
        if let Some(pending) = &mut self.pending
            && is_lead(&pending.block.curve)
            && pending.is_smooth
        {
            pending.place = pending.place.linking(true);
        }
        self.phase = Phase::Leaving;
        if !matches!(self.mode.rules, CompensationRules::Fanuc { entry: CompensationEntry::B, .. }) {
            self.stand(sink);
        }
        self.span = span;
        self.reported = false;
        self.pending.is_none() && self.displacement == [0.0; 2]
    }

    /// A cycle begins that is not compensated: whether the tool is on the programmed path. A straight block that waits goes there.
    pub(in super::super) fn suspend(&mut self, span: SourceSpan, sink: &mut Sink) -> bool {
        if self.is_leaving() || self.pending.as_ref().is_none_or(|pending| pending.block.curve.circle.is_some()) {
            return self.leave(span, sink);
        }
        let Some(Pending { block: Block { span, mut step, curve }, .. }) = self.pending.take() else { return true };
        let path = Curve::line(minus(self.at, self.mode.reference_mm), curve.to);
        report::gouges(span, self.window.pass(path, self.mode.radius_mm, Place::LINK, span.line, false), sink.findings);
        self.place(&mut step.start, self.at);
        self.at = curve.to;
        if !step.is_nothing() {
            sink.push(span, step);
        }
        self.hand_on_waiting(sink);
        true
    }

    /// The next move names its end in the plane.
    pub(in super::super) fn name_exit(&mut self) {
        if self.phase == Phase::Leaving {
            self.phase = Phase::Exiting;
        }
    }

    /// The move behind `G40`.
    pub(super) fn exit(&mut self, mut block: Block, sink: &mut Sink) {
        let Block { span, curve, .. } = block;
        if curve.circle.is_some() {
            report::exit_curve(span, self.span, sink.findings);
        }
        if curve.circle.is_some() || distance(curve.from, curve.to) <= ROUNDING {
            // What has no direction makes no corner with the last block.
            self.stand(sink);
        }
        if let Some(pending) = self.pending.take() {
            let is_rapid = block.step.kind == MoveKind::Rapid;
            let joint = Meeting::new(self.side(), &pending.block.curve, &curve, is_rapid).exit(self.mode.rules);
            let place = pending.place;
            self.hand_on(pending, &joint, sink);
            self.corner(&joint, &block, place, sink);
        } else {
            self.at = plus(curve.from, self.displacement);
        }
        let path = Curve::line(minus(self.at, self.mode.reference_mm), curve.to);
        report::gouges(span, self.window.pass(path, self.mode.radius_mm, Place::LINK, span.line, false), sink.findings);
        self.place(&mut block.step.start, self.at);
        if !block.step.is_nothing() {
            sink.push(span, block.step);
        }
    }

    /// A block behind `G40` that rests in the plane: whether the tool is on the programmed path behind it.
    pub(super) fn rest_before_exit(&mut self, mut step: PathMove, span: SourceSpan, sink: &mut Sink) -> bool {
        if self.pending.is_some() {
            self.wait(Operation { span, kind: step.into() }, sink);
            return false;
        }
        let goes = self.mode.rules == CompensationRules::LinuxCnc;
        if !self.reported {
            self.reported = true;
            report::exit_elsewhere(span, self.span, goes, self.displacement, sink.findings);
        }
        let end = self.in_plane(&step.end);
        self.displace(&mut step);
        if goes {
            self.place(&mut step.end, end);
        }
        if !step.is_nothing() {
            sink.push(span, step);
        }
        goes
    }
}

impl Contour {
    /// A move to a place of the machine behind `G40` in a tilted plane. The tool `stays` beside the programmed point where the move
    /// names no place of an axis; the coordinates of the plane do not say how far, so that every axis is placed anew behind it.
    #[cold]
    pub(super) fn leave_plane(&mut self, operation: Operation, stays: bool, sink: &mut Sink) {
        self.stand(sink);
        if stays && !self.reported && self.displacement != [0.0; 2] {
            report::exit_elsewhere(operation.span, self.span, false, self.displacement, sink.findings);
        }
        sink.out.push(operation);
    }
}

/// A change of direction below this is none: of arcs whose words are rounded, rad.
const SMOOTH_RAD: f64 = 0.02;

/// Whether a block goes on in the direction of the one before it, and not as another part of the same circle: an arc that leads to a
/// contour does.
pub(super) fn is_smooth(before: &Curve, next: &Curve) -> bool {
    let is_one_circle = match (&before.circle, &next.circle) {
        (Some(one), Some(other)) => distance(one.center, other.center) <= SMOOTH_RAD * next.radius(),
        _ => false,
    };
    dot(before.end_tangent(), next.start_tangent()) >= libm::cos(SMOOTH_RAD) && !is_one_circle
}

/// Whether a block next to the entry or the exit of a contour may lead to it or away from it: an arc of less than half a turn, which
/// most programs have there so that the tool leaves no mark. It is no wall of the part where it is tangent to the contour; an arc
/// that meets the next block in a corner is one.
pub(super) fn is_lead(curve: &Curve) -> bool {
    curve.circle.is_some_and(|circle| circle.sweep_rad.abs() < PI - ROUNDING)
}

/// The arc of an entry as LinuxCNC changes it: from where the tool is to beside the programmed end, where it has the
/// programmed direction. `None` where there is none.
fn entry_arc(side: Side, arc: &Curve) -> Option<Curve> {
    let circle = arc.circle?;
    if side.offset_radius(arc) <= ROUNDING {
        return None;
    }
    let beside = plus(arc.to, side.offset(arc.end_tangent()));
    let (chord, toward) = (minus(arc.from, beside), minus(circle.center, beside));
    // The centre is on the line from the end to the programmed centre, as far from the start as from the end.
    let along_line = dot(chord, toward);
    if along_line <= 1e-4 * length(chord) * length(toward) {
        return None;
    }
    let center = along(beside, toward, dot(chord, chord) / (2.0 * along_line));
    let is_clockwise = circle.is_clockwise();
    let sweep_rad = angle_between(minus(arc.from, center), minus(beside, center), is_clockwise);
    Some(Curve::arc(arc.from, arc.to, center, if is_clockwise { -sweep_rad } else { sweep_rad }))
}
