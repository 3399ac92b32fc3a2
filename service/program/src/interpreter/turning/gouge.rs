//! Whether moves of a cycle cut into the contour that they are to leave. Points are along and across, the stock is on the side of
//! growing levels, lengths are
//! in the unit of the program.

use super::linuxcnc::CLEAR_OF_THE_STOCK;
use super::passes::{Path, Refusal};
use super::stock::{Circle, Segment};
use crate::code;

/// A cut into the contour that is none: contours may turn back by half as much.
const LEAST: f64 = 2e-3;

/// Stretches shorter than this along the passes are walls.
const WALL: f64 = 1e-6;

/// Places at which a move is held against a piece where one of them is an arc.
const PLACES: u32 = 16;

/// Refuses a path that goes below both contours, that which is programmed and that at the distance D from it, behind its first
/// `begun` moves.
pub(super) fn check(path: &Path, begun: usize, contours: [&[Segment]; 2], unit_mm: f64) -> Result<(), Refusal> {
    let depths = path.steps[begun..].iter().map(|step| {
        let step = Segment::of(&path.frame.curve(&step.curve), 0);
        contours.into_iter().map(|contour| depth(&step, contour)).fold(f64::INFINITY, f64::min)
    });
    let worst = depths.fold(0.0, f64::max);
    if worst <= LEAST {
        return Ok(());
    }
    let worst_mm = worst * unit_mm;
    let message = format!("from where the cycle starts, a move of it cuts {worst_mm:.3} mm into its contour");
    Err(Refusal::new(code::TURNING_START, &message, CLEAR_OF_THE_STOCK))
}

/// How far a move goes below a contour, whose pieces go forward.
fn depth(step: &Segment, contour: &[Segment]) -> f64 {
    let (low, high) = (step.from[0].min(step.to[0]), step.from[0].max(step.to[0]));
    let first = contour.partition_point(|piece| piece.to[0] <= low);
    let beneath = contour[first..].iter().take_while(|piece| piece.from[0] < high + WALL);
    beneath.map(|piece| depth_in_piece(step, piece, [low, high])).fold(0.0, f64::max)
}

/// How far a move goes below a piece, between two places along; not above 0 where it does not.
fn depth_in_piece(step: &Segment, piece: &Segment, [low, high]: [f64; 2]) -> f64 {
    let (low, high) = (low.max(piece.from[0] + WALL), high.min(piece.to[0] - WALL));
    if low > high {
        return 0.0;
    }
    if high - low < WALL {
        return piece.height(low) - step.from[1].min(step.to[1]);
    }
    let places = if step.circle.is_none() && piece.circle.is_none() { 1 } else { PLACES };
    let at = |place: u32| low + (high - low) * f64::from(place) / f64::from(places);
    (0..=places).map(|place| piece.height(at(place)) - step.height(at(place))).fold(0.0, f64::max)
}

impl Segment {
    /// How high it is at a place along it; a wall as high as its end.
    fn height(&self, along: f64) -> f64 {
        match self.circle {
            None if (self.to[0] - self.from[0]).abs() < WALL => self.to[1],
            None => self.from[1] + (along - self.from[0]) / (self.to[0] - self.from[0]) * (self.to[1] - self.from[1]),
            Some(Circle { center, is_hill }) => {
                let radius = self.radius();
                let half = (radius * radius - (along - center[0]) * (along - center[0])).max(0.0).sqrt();
                center[1] + if is_hill { half } else { -half }
            }
        }
    }
}
