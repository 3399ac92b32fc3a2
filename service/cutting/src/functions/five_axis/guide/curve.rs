//! Curves of guided moves: circles and splines of the program as paths of the tool centre point in work coordinates.

use feedwave_motion::kinematics::vector::Vec3;
use feedwave_motion::kinematics::{
    FiveAxisBlock, FiveAxisMotion, FiveAxisPoint, FiveAxisRefusal, GreatCircle, Setup, TipCircle, TipCurve, Toward,
};
use feedwave_motion::{Curve, Element, Spline};
use feedwave_program::{FindingLog, GuidedMove, Move, Position, SourceSpan};

use super::Guide;
use crate::shared::checks::spline_cusp;

/// The circle of a move, work coordinates; nothing where it has none.
pub(super) fn circle_in_work(guided: &GuidedMove) -> Option<TipCircle> {
    let arc = guided.step.arc?;
    let (first, second) = arc.plane.axes();
    let (mut center_mm, mut normal) = ([0.0; 3], [0.0; 3]);
    center_mm[first.index()] = arc.center[0];
    center_mm[second.index()] = arc.center[1];
    normal[arc.plane.normal().index()] = 1.0;
    let sweep_rad = arc.sweep_rad;
    Some(match &guided.plane {
        None => TipCircle { center_mm, normal, sweep_rad },
        Some(plane) => TipCircle { center_mm: plane.to_work(center_mm), normal: plane.turned_out(normal), sweep_rad },
    })
}

/// The spline of a move, work coordinates, in parts without corners; none where it has no spline, nothing after a finding.
pub(super) fn spline_in_work(
    guided: &GuidedMove,
    [from_mm, to_mm]: [Vec3; 2],
    span: SourceSpan,
    findings: &mut FindingLog,
) -> Option<Vec<Spline>> {
    if guided.step.spline.is_none() {
        return Some(Vec::new());
    }
    let own = |point_mm: Vec3| guided.plane.as_ref().map_or(point_mm, |plane| plane.from_work(point_mm));
    let [start, end] = [from_mm, to_mm].map(|point_mm| {
        let mut position = Position::default();
        position[..3].copy_from_slice(&own(point_mm));
        position
    });
    let Some(element) = Element::from_move(&Move { start, end, ..guided.step.clone() }, span) else {
        findings.push(spline_cusp(span));
        return None;
    };
    let parts = element.smooth_parts().into_iter().filter_map(|part| match part.curve {
        Curve::Spline(spline) => Some(match &guided.plane {
            None => *spline,
            Some(plane) => spline.placed(&plane.axes, &plane.origin_mm),
        }),
        _ => None,
    });
    Some(parts.collect())
}

impl Guide {
    /// The elements of a block along the parts of a spline: the tool turns evenly over its whole length.
    pub(super) fn along_spline(
        &self,
        setup: &Setup,
        start: &FiveAxisPoint,
        block: &FiveAxisBlock<'_>,
        parts: &[Spline],
    ) -> Result<FiveAxisMotion, FiveAxisRefusal> {
        let length_mm: f64 = parts.iter().map(Spline::length_mm).sum();
        let from_deg = self.kinematics.letters().1.map(|axis| start.position[axis.index()]);
        let toward = |share: f64| -> Result<Toward, FiveAxisRefusal> {
            Ok(match block.toward {
                toward if share >= 1.0 => toward,
                Toward::Angles(to_deg) => {
                    Toward::Angles([0, 1].map(|axis| from_deg[axis] + (to_deg[axis] - from_deg[axis]) * share))
                }
                Toward::Vector(direction) => Toward::Vector(GreatCircle::new(start.direction, direction)?.at(share)),
            })
        };
        let mut whole: Option<FiveAxisMotion> = None;
        let mut done_mm = 0.0;
        for (index, part) in parts.iter().enumerate() {
            let is_last = index + 1 == parts.len();
            done_mm += part.length_mm();
            let share = if is_last { 1.0 } else { done_mm / length_mm };
            let end_mm = if is_last { block.end_mm } else { part.ends()[1] };
            let curve = Some(TipCurve::Spline(part));
            let from = whole.as_ref().map_or(*start, |motion| motion.end);
            let part_block = FiveAxisBlock { end_mm, curve, toward: toward(share)?, ..*block };
            let motion = self.elements(setup, &from, &part_block, None)?;
            whole = Some(match whole {
                None => motion,
                Some(mut whole) => {
                    whole.elements.extend(motion.elements);
                    FiveAxisMotion {
                        elements: whole.elements,
                        end: motion.end,
                        least_pole_distance_rad: whole.least_pole_distance_rad.min(motion.least_pole_distance_rad),
                        deviation_rad: whole.deviation_rad.max(motion.deviation_rad),
                        turn_in_pole_rad: whole.turn_in_pole_rad.max(motion.turn_in_pole_rad),
                    }
                }
            });
        }
        whole.ok_or(FiveAxisRefusal::NotANumber)
    }
}
