//! From a job and its contour to the moves of the passes. The same job and contour always give the same moves, so that they need
//! not be remembered: who goes on in the middle of a cycle makes them again.

use super::beyond::{self, Beyond};
use super::contour::{Part, Piece, SAME_MM, TURNS_BACK_MM, parts, turns_back};
use super::frame::{Frame, moved};
use super::linuxcnc;
use super::pockets::{self, Stock};
use super::request::{Job, Request};
use crate::compensation::geometry::{Curve, Point, plus};
use crate::{FindingCode, SourceSpan, code};

/// Most moves of a cycle.
pub(super) const MAX_STEPS: usize = 100_000;

/// A move of a cycle: Z and X.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::interpreter) struct Step {
    pub(in crate::interpreter) curve: Curve,
    pub(in crate::interpreter) is_rapid: bool,
    /// The block of the contour that it follows; `None` for the cycle's.
    pub(in crate::interpreter) block: Option<u32>,
}

/// Why there are no passes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Refusal {
    pub(super) code: FindingCode,
    /// The block that it is about; `None` for the cycle's.
    pub(super) span: Option<SourceSpan>,
    pub(super) message: String,
    pub(super) cure: &'static str,
    /// In place of message and cure, where the start is what is wrong.
    pub(super) beyond: Option<Box<Beyond>>,
}

impl Refusal {
    pub(super) fn new(code: FindingCode, message: &str, cure: &'static str) -> Self {
        Self { code, span: None, message: message.to_owned(), cure, beyond: None }
    }

    fn beyond(beyond: Beyond) -> Self {
        Self { beyond: Some(Box::new(beyond)), ..Self::new(code::TURNING_START, "", "") }
    }

    pub(super) fn at(self, span: SourceSpan) -> Self {
        Self { span: Some(span), ..self }
    }

    pub(super) fn too_many() -> Self {
        let message = format!("the cycle has more than {MAX_STEPS} moves");
        Self::new(
            code::TURNING_LIMIT,
            &message,
            "write a larger depth, or divide the contour; a decimal point may be missing",
        )
    }
}

/// The moves of a cycle, and what is worth saying about them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Plan {
    pub(super) steps: Vec<Step>,
    pub(super) has_pockets: bool,
    /// An allowance points into the finished part.
    pub(super) cuts_in: bool,
    /// Of a roughing cycle: the passes go along X, and which way the stock is, across them.
    pub(super) outward: Option<(bool, f64)>,
}

/// Moves in a frame, one behind the other.
pub(super) struct Path {
    pub(super) frame: Frame,
    pub(super) at: Point,
    pub(super) steps: Vec<Step>,
    /// The last move ended beside `at`, by less than counts.
    is_beside: bool,
}

impl Path {
    pub(super) const fn new(frame: Frame, at: Point) -> Self {
        Self { frame, at, steps: Vec::new(), is_beside: false }
    }

    /// Whether there are more moves than a cycle may have.
    pub(super) const fn is_full(&self) -> bool {
        self.steps.len() > MAX_STEPS
    }

    pub(super) fn rapid(&mut self, to: Point) {
        self.straight(to, true);
    }

    pub(super) fn feed(&mut self, to: Point) {
        self.straight(to, false);
    }

    pub(super) fn straight(&mut self, to: Point, is_rapid: bool) {
        if (to != self.at || self.is_beside) && !self.is_full() {
            let curve = self.frame.curve_back(&Curve::line(self.at, to));
            self.steps.push(Step { curve, is_rapid, block: None });
            self.is_beside = false;
        }
        self.at = to;
    }

    /// Goes on from a point that the last move ended beside, by less than counts.
    pub(super) fn stand_at(&mut self, point: Point) {
        self.is_beside |= point != self.at;
        self.at = point;
    }

    /// A feed along a curve that begins here, of a block of the contour.
    pub(super) fn follow(&mut self, curve: &Curve, block: usize) {
        let is_point = match curve.circle {
            None => curve.to == curve.from,
            Some(circle) => circle.sweep_rad == 0.0,
        };
        if !is_point && !self.is_full() {
            let curve = self.frame.curve_back(curve);
            self.steps.push(Step { curve, is_rapid: false, block: Some(block as u32) });
            self.is_beside = false;
        }
        self.at = curve.to;
    }

    /// Rapidly to a point, first along the axis on which it is further away from the part.
    pub(super) fn return_to(&mut self, to: Point) {
        let over = if to[1] >= self.at[1] { [self.at[0], to[1]] } else { [to[0], self.at[1]] };
        self.rapid(over);
        self.rapid(to);
    }
}

/// The contour as it was read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contour<'a> {
    /// The move to the contour comes first.
    pub(super) pieces: &'a [Piece],
    /// Whether the first block names Z and X.
    pub(super) named: [bool; 2],
    /// Z and X where the cycle begins.
    pub(super) start: Point,
    /// Z and X of the tool.
    pub(super) tool: Point,
    /// The compensated tool is left of it, or right.
    pub(super) left: Option<bool>,
    /// The passes of a roughing cycle along it went along X, and which way its stock is, across them.
    pub(super) roughed: Option<(bool, f64)>,
}

/// The moves of a job.
pub(super) fn plan(request: &Request, contour: Contour<'_>) -> Result<Plan, Refusal> {
    let Some((approach, pieces)) = contour.pieces.split_first() else {
        return Err(Refusal::new(
            code::TURNING_CONTOUR,
            "the contour has no move",
            "write its lines and arcs between the first and the last block",
        ));
    };
    if approach.curve.circle.is_some() {
        let message = "the first block of the contour is an arc, but the passes go to their depth along it";
        let refusal = Refusal::new(code::TURNING_CONTOUR, message, "begin the contour with G0 or G1");
        return Err(refusal.at(approach.span));
    }
    let pieces = if request.may_depart { without_departure(contour, approach, pieces) } else { pieces };
    match request.job {
        Job::Finish => finish_return(contour, approach, pieces),
        Job::Rough { facing, depth_mm, escape_mm, allowance } => {
            rough(contour, approach, pieces, facing, [depth_mm, escape_mm], allowance)
        }
        Job::Pattern { relief, passes, allowance } => pattern(contour, approach, pieces, relief, passes, allowance),
        Job::Steps { .. } | Job::Offsets { .. } => linuxcnc::plan(&request.job, contour),
    }
}

/// A contour without the rapid moves at its end that go back along the passes, outside all of it.
fn without_departure<'a>(contour: Contour<'_>, approach: &Piece, pieces: &'a [Piece]) -> &'a [Piece] {
    let cut = pieces.iter().rposition(|piece| !piece.is_rapid).map_or(0, |last| last + 1);
    if cut == 0 || cut == pieces.len() {
        return pieces;
    }
    let frame = followed(contour, approach, &pieces[..cut]);
    let curves: Vec<_> = pieces.iter().map(|piece| frame.curve(&piece.curve)).collect();
    let goes_back = |curve: &Curve| curve.to[0] < curve.from[0];
    let Some(back) = (cut..curves.len()).find(|place| goes_back(&curves[*place])) else { return pieces };
    let levels = |part: Part| [part.curve.from[1], part.curve.to[1]];
    let top = parts(&curves[..back]).into_iter().flat_map(levels).fold(f64::NEG_INFINITY, f64::max);
    let is_outside = |curve: &Curve| curve.from[1].min(curve.to[1]) >= top - TURNS_BACK_MM;
    if curves[back..].iter().all(is_outside) { &pieces[..back] } else { pieces }
}

/// Which way is away from the part across a contour: from its start to that of the cycle.
fn outward(contour: Contour<'_>, axis: usize) -> f64 {
    let start_of_contour = contour.pieces[0].curve.to;
    (contour.start[axis] - start_of_contour[axis]).signum()
}

/// The frame of a contour that is followed; its passes go along X where only Z is named in its first block.
fn followed(contour: Contour<'_>, approach: &Piece, pieces: &[Piece]) -> Frame {
    let facing = contour.named[0] && !contour.named[1];
    let [across, along] = if facing { [0, 1] } else { [1, 0] };
    let end = pieces.last().unwrap_or(approach).curve.to;
    let progress = end[along] - approach.curve.to[along];
    let progress = if progress == 0.0 { -1.0 } else { progress.signum() };
    let outward = if is_level(contour, across) { side(contour, facing, progress) } else { None }
        .unwrap_or_else(|| outward(contour, across));
    Frame { swaps: facing, signs: [progress, outward] }
}

/// Whether a cycle starts at the level of the first point of its contour.
fn is_level(contour: Contour<'_>, across: usize) -> bool {
    (contour.start[across] - contour.pieces[0].curve.to[across]).abs() < SAME_MM
}

/// Which way the stock is across a contour, where the start of its cycle does not say it: where the compensated tool is, or where the
/// roughing cycle found it.
fn side(contour: Contour<'_>, facing: bool, progress: f64) -> Option<f64> {
    let of_tool = contour.left.map(|left| if left == facing { -progress } else { progress });
    of_tool.or_else(|| contour.roughed.filter(|roughed| roughed.0 == facing).map(|roughed| roughed.1))
}

/// Back to the start of the cycle, from the end of the contour.
fn finish_return(contour: Contour<'_>, approach: &Piece, pieces: &[Piece]) -> Result<Plan, Refusal> {
    let frame = followed(contour, approach, pieces);
    let curves: Vec<_> = pieces.iter().map(|piece| frame.curve(&piece.curve)).collect();
    // Where the tool is: its way back may have begun within the contour.
    let end = contour.pieces.last().unwrap_or(approach).curve.to;
    let mut path = Path::new(frame, frame.to(end));
    path.return_to(frame.to(contour.start));
    let to_contour = Step { curve: Curve::line(contour.start, approach.curve.to), is_rapid: true, block: None };
    let rapids = path.steps.iter().chain([&to_contour]);
    let finished = parts(&curves);
    check_side(contour, &frame, &finished)?;
    match beyond::of_rapids(contour, &frame, &finished, rapids) {
        Some(found) => Err(Refusal::beyond(found)),
        None => Ok(Plan { steps: path.steps, ..Plan::default() }),
    }
}

/// Names of the axes of a point.
const NAMES: [&str; 2] = ["Z", "X"];

/// Passes parallel to an axis.
fn rough(
    contour: Contour<'_>,
    approach: &Piece,
    pieces: &[Piece],
    facing: bool,
    [depth_mm, escape_mm]: [f64; 2],
    allowance: Point,
) -> Result<Plan, Refusal> {
    let [across, along] = if facing { [0, 1] } else { [1, 0] };
    let last = checked(contour, approach, pieces, across)?;
    let progress = last.curve.to[along] - approach.curve.to[along];
    let progress = if progress == 0.0 { -1.0 } else { progress.signum() };
    let frame = Frame { swaps: facing, signs: [progress, outward(contour, across)] };
    let curves: Vec<_> = pieces.iter().map(|piece| frame.curve(&piece.curve)).collect();
    let has_both = contour.named[along];
    let finished = parts(&curves);
    let start_beyond = || {
        beyond::of_roughing(contour, &frame, &finished, has_both).map_or(Ok(()), |found| Err(Refusal::beyond(found)))
    };
    if !has_both && beyond::begins_behind(&finished) {
        start_beyond()?;
    }
    let has_pockets = has_pockets(&finished, pieces, [along, across], has_both)?;
    start_beyond()?;
    let shift = frame.to(allowance);
    if has_pockets && shift[0] != 0.0 {
        let message = format!("an allowance along {} cuts into the far walls of the pockets", NAMES[along]);
        let cure = "leave it out, and let the finishing cycle cut the walls";
        return Err(Refusal::new(code::TURNING_VALUE, &message, cure));
    }
    let curves: Vec<_> = curves.iter().map(|curve| moved(curve, shift)).collect();
    let start = frame.to(contour.start);
    let stock = Stock {
        corner: plus(start, shift),
        parts: parts(&curves),
        contour: curves,
        depth_mm,
        escape_mm,
        plunges_rapidly: approach.is_rapid,
        follows_walls: has_both,
    };
    let mut path = Path::new(frame, start);
    pockets::rough(&stock, &mut path)?;
    path.return_to(start);
    if path.is_full() {
        return Err(Refusal::too_many());
    }
    // Away from the part is against the passes along them, and outward across.
    let cuts_in = shift[1] < 0.0 || shift[0] > 0.0;
    Ok(Plan { steps: path.steps, has_pockets, cuts_in, outward: Some((facing, frame.signs[1])) })
}

fn unknown_side(name: &str) -> Refusal {
    let message =
        format!("the cycle starts at the {name} where the contour starts, so that the side of the stock is not known");
    let cure = "move the tool to the corner of the stock, clear of it, before the cycle";
    Refusal::new(code::TURNING_START, &message, cure)
}

/// Refuses a contour that is followed from the level of its first point and goes below that: in a bore, the way back would be
/// another one.
fn check_side(contour: Contour<'_>, frame: &Frame, parts: &[Part]) -> Result<(), Refusal> {
    let level = frame.to(contour.start)[1];
    let is_level = is_level(contour, usize::from(!frame.swaps));
    if is_level && side(contour, frame.swaps, frame.signs[0]).is_some() {
        return Ok(());
    }
    let goes_below = parts.iter().any(|part| part.curve.to[1] < level - TURNS_BACK_MM);
    if is_level && goes_below { Err(unknown_side(NAMES[usize::from(!frame.swaps)])) } else { Ok(()) }
}

/// The last block of a contour whose start says on which side of it the stock is, across the passes.
fn checked<'a>(
    contour: Contour<'_>,
    approach: &Piece,
    pieces: &'a [Piece],
    across: usize,
) -> Result<&'a Piece, Refusal> {
    let name = NAMES[across];
    if !contour.named[across] {
        let message = format!("the first block of the contour does not move {name}");
        let cure = "let the first block go to the start of the contour across the passes: X for G71, Z for G72";
        return Err(Refusal::new(code::TURNING_CONTOUR, &message, cure).at(approach.span));
    }
    let Some(last) = pieces.last() else {
        let message = "the contour has no block behind its first one";
        return Err(Refusal::new(code::TURNING_CONTOUR, message, "write its lines and arcs").at(approach.span));
    };
    if contour.start[across] == approach.curve.to[across] {
        return Err(unknown_side(name));
    }
    Ok(last)
}

/// Whether a contour turns back across the passes, which it may where its first block names both axes; along them it must not.
fn has_pockets(parts: &[Part], pieces: &[Piece], axes: [usize; 2], may_have: bool) -> Result<bool, Refusal> {
    let refuse = |block: usize, axis: usize| {
        let message = format!("the contour turns back along {} here", NAMES[axes[axis]]);
        let cure = if axis == 1 {
            "where it is a pocket, name both axes in the first block of the contour, such as W0; where the stock is on the \
             other side of the contour, start the cycle there, beyond all of it"
        } else {
            "let the contour keep one direction along the passes"
        };
        Refusal::new(code::TURNING_MONOTONY, &message, cure).at(pieces[block].span)
    };
    if let Some(block) = turns_back(parts, 0) {
        return Err(refuse(block, 0));
    }
    match turns_back(parts, 1) {
        Some(block) if !may_have => Err(refuse(block, 1)),
        falls => Ok(falls.is_some()),
    }
}

/// Passes along the contour, each nearer to it.
fn pattern(
    contour: Contour<'_>,
    approach: &Piece,
    pieces: &[Piece],
    relief: Point,
    passes: u32,
    allowance: Point,
) -> Result<Plan, Refusal> {
    if pieces.is_empty() {
        let message = "the contour has no block behind its first one";
        return Err(Refusal::new(code::TURNING_CONTOUR, message, "write its lines and arcs").at(approach.span));
    }
    if pieces.len().saturating_mul(passes as usize) > MAX_STEPS {
        return Err(Refusal::too_many());
    }
    let frame = followed(contour, approach, pieces);
    let unshifted: Vec<_> = pieces.iter().map(|piece| frame.curve(&piece.curve)).collect();
    check_side(contour, &frame, &parts(&unshifted))?;
    let start = frame.to(contour.start);
    let mut path = Path::new(frame, start);
    for pass in 0..passes {
        let left = if passes > 1 { 1.0 - f64::from(pass) / f64::from(passes - 1) } else { 0.0 };
        let shift = [allowance[0] + relief[0] * left, allowance[1] + relief[1] * left];
        let by = frame.to(shift);
        path.rapid(plus(frame.to(approach.curve.to), by));
        for (block, piece) in pieces.iter().enumerate() {
            path.follow(&moved(&frame.curve(&piece.curve), by), block);
        }
        path.return_to(plus(start, by));
    }
    path.return_to(start);
    let shift = frame.to(allowance);
    let cuts_in = [shift, frame.to(relief)].into_iter().any(|shift| shift[1] < 0.0 || shift[0] > 0.0);
    let finished: Vec<_> = unshifted.iter().map(|curve| moved(curve, shift)).collect();
    let rapids = path.steps.iter().filter(|step| step.is_rapid);
    // What is cut deeper than the contour is said by the warning of its allowance.
    match beyond::of_rapids(contour, &frame, &parts(&finished), rapids) {
        Some(found) if !cuts_in => Err(Refusal::beyond(found)),
        _ => Ok(Plan { steps: path.steps, cuts_in, ..Plan::default() }),
    }
}
