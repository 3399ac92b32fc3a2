//! The path of a guided tool's centre point, as the program gives it.

use std::ops::RangeInclusive;

use feedwave_motion::Element;
use feedwave_program::{Axis, GuidedMove, Move, MoveKind, Position, SourceSpan, ToolGuide};

use super::{PathPoint, ToolMotion, ToolPathSink, chord_count, point};

/// Cuts distinguished at most; further ones belong to the last one.
const MAX_CUTS: usize = 2_000;

/// The cuts that a program makes with a guided tool.
#[derive(Clone, Debug, Default)]
pub struct GuidedCuts {
    /// The lines of each, in order; the last of very many has the lines of all further ones.
    pub lines: Vec<RangeInclusive<u32>>,
    /// Work offset of the first one, mm and degrees; `None` where there is none.
    pub work_offset: Option<Position>,
}

/// Where the centre point of a guided tool is.
#[derive(Debug, Default)]
pub(super) struct GuidedTip {
    /// Known once every coordinate was programmed.
    at_mm: Option<PathPoint>,
    cutting: bool,
    cuts: GuidedCuts,
}

impl GuidedTip {
    pub(super) fn into_cuts(self) -> GuidedCuts {
        self.cuts
    }

    /// The tool is not guided, or not any more.
    pub(super) const fn interrupt(&mut self) {
        (self.at_mm, self.cutting) = (None, false);
    }

    /// Follows a move; a cut is drawn as `cut`.
    pub(super) fn follow(
        &mut self,
        guided: &GuidedMove,
        span: SourceSpan,
        cut: ToolMotion,
        sink: &mut impl ToolPathSink,
    ) {
        let line = span.line;
        // The tip moves with the rotary axes and how, only the machine knows.
        if matches!(guided.guide, ToolGuide::Axes | ToolGuide::Align { .. }) {
            return self.interrupt();
        }
        let cutting = guided.step.kind != MoveKind::Rapid;
        let before = self.at_mm;
        // In a tilted plane the words are in its coordinates, and the path is in work coordinates.
        let from = match &guided.plane {
            Some(plane) => before.map(|tip_mm| plane.from_work(tip_mm)),
            None => before,
        };
        let value = |axis: Axis| {
            let index = axis.index();
            if guided.held.contains(axis) { from.map(|tip| tip[index]) } else { Some(guided.step.end[index]) }
        };
        let to = match [Axis::X, Axis::Y, Axis::Z].map(value) {
            [Some(x), Some(y), Some(z)] => Some([x, y, z]),
            _ => None,
        };
        self.at_mm = match &guided.plane {
            Some(plane) => to.map(|point_mm| plane.to_work(point_mm)),
            None => to,
        };
        if let (Some(from_mm), Some(to_mm)) = (before, self.at_mm) {
            let motion = if cutting { cut } else { ToolMotion::Rapid };
            let curve = from.and_then(|from| TipCurve::of(guided, from, to?, span));
            let chords = curve.as_ref().map_or(1, |curve| chord_count(curve.turn_rad()));
            let mut last_mm = from_mm;
            for chord in 1..=chords {
                let next_mm = match &curve {
                    Some(curve) if chord < chords => {
                        let point_mm = curve.at(f64::from(chord) / f64::from(chords));
                        guided.plane.as_ref().map_or(point_mm, |plane| plane.to_work(point_mm))
                    }
                    _ => to_mm,
                };
                sink.line(motion, last_mm, next_mm);
                last_mm = next_mm;
            }
        }
        self.count(guided, cutting, line);
    }

    /// Counts a move to the cut that it belongs to.
    fn count(&mut self, guided: &GuidedMove, cutting: bool, line: u32) {
        let GuidedCuts { lines, work_offset } = &mut self.cuts;
        let full = lines.len() == MAX_CUTS;
        match lines.last_mut() {
            Some(last) if cutting && (self.cutting || full) => *last = *last.start()..=line,
            _ if cutting => lines.push(line..=line),
            _ => {}
        }
        if cutting {
            work_offset.get_or_insert(guided.step.work_offset);
        }
        self.cutting = cutting;
    }
}

/// The curve of a move, in the coordinates of its end.
enum TipCurve {
    Circle(Circle),
    Spline(Box<Element>),
}

impl TipCurve {
    fn of(guided: &GuidedMove, from: PathPoint, to: PathPoint, span: SourceSpan) -> Option<Self> {
        if guided.step.spline.is_none() {
            return Circle::of(guided, from, to).map(Self::Circle);
        }
        let [start, end] = [from, to].map(|point_mm| {
            let mut position = Position::default();
            position[..3].copy_from_slice(&point_mm);
            position
        });
        Element::from_move(&Move { start, end, ..guided.step.clone() }, span)
            .map(|element| Self::Spline(Box::new(element)))
    }

    /// Upper bound of the angle that it turns by.
    fn turn_rad(&self) -> f64 {
        match self {
            Self::Circle(circle) => circle.sweep_rad.abs(),
            Self::Spline(element) => element.length * element.curvature(),
        }
    }

    fn at(&self, share: f64) -> PathPoint {
        match self {
            Self::Circle(circle) => circle.at(share),
            Self::Spline(element) => point(&element.position(element.length * share)),
        }
    }
}

/// The circle of a move, in the coordinates of its end.
struct Circle {
    start: PathPoint,
    end: PathPoint,
    /// First and second axis of the circle's plane.
    axes: [usize; 2],
    center: [f64; 2],
    sweep_rad: f64,
}

impl Circle {
    fn of(guided: &GuidedMove, start: PathPoint, end: PathPoint) -> Option<Self> {
        let arc = guided.step.arc?;
        let (first, second) = arc.plane.axes();
        let axes = [first.index(), second.index()];
        Some(Self { start, end, axes, center: arc.center, sweep_rad: arc.sweep_rad })
    }

    fn at(&self, share: f64) -> PathPoint {
        let from = [0, 1].map(|axis| self.start[self.axes[axis]] - self.center[axis]);
        let (sine, cosine) = libm::sincos(self.sweep_rad * share);
        let mut point = [0, 1, 2].map(|axis| self.start[axis] + (self.end[axis] - self.start[axis]) * share);
        point[self.axes[0]] = self.center[0] + from[0] * cosine - from[1] * sine;
        point[self.axes[1]] = self.center[1] + from[0] * sine + from[1] * cosine;
        point
    }
}
