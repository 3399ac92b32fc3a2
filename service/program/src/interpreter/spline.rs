//! Splines: the Bézier curves of `G5` and `G5.1`, and the NURBS from `G5.2` to `G5.3`.
//!
//! Words and rules are those of LinuxCNC, except that every plane has splines: `I`, `J` and `K` are along X, Y and Z as
//! for arcs, and `P` and `Q` of `G5` along the first and the second axis of the plane in the order X, Y, Z.

use core::ops::RangeInclusive;

use super::arc::centre_letter;
use super::execute::Execution;
use super::motion::{CURVE_LETTERS, Frame, set_bits};
use crate::block::Word;
use crate::code;
use crate::dialect::{Group, Letter, Meaning, letter_bit};
use crate::state::{Motion, Nurbs};
use crate::{Axis, Finding, FindingCode, MoveKind, OperationKind, Plane, Position, SourceSpan, SplineGeometry};

/// Most control points of a NURBS.
const MAX_CONTROL_POINTS: usize = 10_000;

/// Orders of a NURBS: below 3 it has corners, above 10 no program has a use for it.
const ORDERS: RangeInclusive<u32> = 3..=10;

/// Weights of a control point: beyond these a curve cannot be told from one through or without the point.
const WEIGHTS: RangeInclusive<f64> = 1e-6..=1e6;

/// Order of a NURBS without an `L`.
const USUAL_ORDER: u8 = 3;

impl Execution<'_> {
    /// The curve of `G5` (`cubic`) or `G5.1` from the present position to `end`; `None` after a finding.
    pub(super) fn spline(&mut self, cubic: bool, axes: u32, end: &Position) -> Option<Box<SplineGeometry>> {
        let plane = self.state.plane;
        let (first, second) = plane.axes();
        let from_start = [first, second].map(|axis| self.take(centre_letter(axis)));
        let before_end = if cubic { end_letters(plane).map(|letter| self.take(letter)) } else { [None; 2] };
        let [after_first, after_second] = [first, second].map(|axis| char::from(centre_letter(axis)));
        let departure = self.offset(from_start);

        let exit = self.state.spline_exit;
        let span = self.block.span();
        if cubic {
            // A block that goes on from this one can do so even if this one has a mistake.
            self.state.spline_exit = Some(self.offset(before_end).map(|value| -value));
            if before_end.iter().any(Option::is_none) {
                return self.spline_error(code::SPLINE_POINT_MISSING, span, |mut finding| {
                    finding.message.push_str("G5 takes both P and Q, from its end to its second control point");
                    finding.suggest("add P and Q")
                });
            }
        }
        self.check_spline_axes(axes)?;
        let is_request = !cubic && !self.table.dialect.is_linuxcnc && self.block.word(b'Q').is_some();
        if is_request && from_start.iter().all(Option::is_none) {
            // The motion before is in force: the blocks behind are no curves.
            self.take(b'Q');
            self.state.motion = Motion::Unclear;
        }
        let departure = match (from_start, exit) {
            ([None, None], Some(exit)) if cubic => exit,
            ([None, None], _) => self.spline_error(code::SPLINE_POINT_MISSING, span, |mut finding| {
                let code = if cubic { "the first G5 of a series" } else { "G5.1" };
                finding.message =
                    format!("{code} has no {after_first} and {after_second}, from its start to its control point");
                if is_request {
                    finding.message.push_str(", and as a request for contour control it has words of axes");
                    return finding.suggest("write the request, G5.1 with Q, in a block without axes");
                }
                finding.suggest(format!("add {after_first} and {after_second}"))
            })?,
            ([None, Some(_)] | [Some(_), None], _) => {
                self.spline_error(code::SPLINE_POINT_MISSING, span, |mut finding| {
                    finding.message = match cubic {
                        true => format!("G5 takes both {after_first} and {after_second}, or neither"),
                        false => format!("G5.1 takes both {after_first} and {after_second}"),
                    };
                    finding.suggest("write the missing one, 0 if it is meant")
                })?
            }
            _ if !cubic && departure == [0.0; 2] => {
                self.spline_error(code::SPLINE_POINT_MISSING, span, |mut finding| {
                    finding.message = "the control point of G5.1 is its start".to_owned();
                    finding.suggest(format!("write {after_first} or {after_second} other than 0, or use G1"))
                })?
            }
            _ => departure,
        };

        let start = in_plane(plane, &self.state.position);
        let end = in_plane(plane, end);
        let mut points = vec![start, sum(start, departure)];
        if cubic {
            points.push(sum(end, self.offset(before_end)));
        }
        points.push(end);
        let weights = vec![1.0; points.len()];
        Some(Box::new(SplineGeometry { plane, order: points.len() as u8, points, weights }))
    }

    /// A block in a NURBS, the first of which opens it.
    pub(super) fn nurbs(&mut self) {
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        let (weight, order) = (self.take(b'P'), self.take(b'L'));
        let is_refused = self.state.nurbs.is_none() && !self.block.unclear && self.is_nurbs_refused();
        let end = self.target(axes, Frame::Work);
        if is_refused {
            self.used |= CURVE_LETTERS;
            self.state.motion = Motion::Unclear;
            self.state.position = end;
            return;
        }
        let mut nurbs = match self.state.nurbs.take() {
            Some(nurbs) => nurbs,
            None => Box::new(Nurbs {
                span: self.block.span(),
                order: USUAL_ORDER,
                points: vec![in_plane(self.state.plane, &self.state.position)],
                weights: vec![1.0],
                end: self.state.position,
                feed: self.cutting_feed(),
                path_control: self.path_control(),
                broken: false,
            }),
        };
        if axes != 0 {
            nurbs.end = end;
        }
        if !self.block.unclear {
            if let Some(word) = order {
                self.nurbs_order(&mut nurbs, &word);
            }
            // After a finding it breaks, with every other block that has one.
            let _ = self.control_point(&mut nurbs, axes, weight);
        }
        self.state.nurbs = Some(nurbs);
    }

    fn nurbs_order(&mut self, nurbs: &mut Nurbs, word: &Word) {
        let Some(order) = self.whole(word) else {
            return;
        };
        if ORDERS.contains(&order) {
            nurbs.order = order as u8;
            return;
        }
        let span = self.block.word_span(word);
        let (least, most) = (*ORDERS.start(), *ORDERS.end());
        self.findings.push_with(code::NURBS_ORDER, |code| {
            Finding::new(code, span, format!("the order is {order}, but must be {least} to {most}"))
                .with_value("order", f64::from(order), "")
                .with_value("min_order", f64::from(least), "")
                .with_value("max_order", f64::from(most), "")
                .suggest("use L3 or L4")
        });
    }

    /// Adds the block's control point; before the first one, a weight alone is that of the start.
    fn control_point(&mut self, nurbs: &mut Nurbs, axes: u32, weight_word: Option<Word>) -> Option<()> {
        let weight = match weight_word {
            Some(word) => self.weight(&word)?,
            None => 1.0,
        };
        self.check_spline_axes(axes)?;
        let plane = self.state.plane;
        let (first, second) = plane.axes();
        let span = self.block.span();
        match [first, second].map(|axis| self.axes_of(axes).any(|named| named == axis)) {
            [true, true] => {}
            [false, false] if weight_word.is_none() => return Some(()),
            [false, false] if nurbs.points.len() == 1 => {
                nurbs.weights[0] = weight;
                return Some(());
            }
            [named, _] => {
                let [first, second] = [first.letter(), second.letter()];
                return self.spline_error(code::NURBS_POINT, span, |mut finding| {
                    finding.message = match (axes, named) {
                        (0, _) => "a weight without its control point".to_owned(),
                        (_, true) => format!("the control point has {first}, but not {second}"),
                        (_, false) => format!("the control point has {second}, but not {first}"),
                    };
                    finding.suggest(format!("write both {first} and {second}"))
                });
            }
        }
        if self.is_linuxcnc() && weight_word.is_none() {
            return self.spline_error(code::NURBS_WEIGHT, span, |mut finding| {
                finding.message = "LinuxCNC asks for a weight at every control point".to_owned();
                finding.suggest("add P1 for an ordinary control point")
            });
        }
        if nurbs.broken {
            return Some(());
        }
        if nurbs.points.len() >= MAX_CONTROL_POINTS {
            return self.spline_error(code::NURBS_TOO_LONG, span, |mut finding| {
                finding.message = format!("the NURBS has more than {MAX_CONTROL_POINTS} control points");
                let finding = finding.with_value("max_control_points", MAX_CONTROL_POINTS as f64, "");
                finding.suggest("close it with G5.3 and open another one")
            });
        }
        nurbs.points.push(in_plane(plane, &nurbs.end));
        nurbs.weights.push(weight);
        Some(())
    }

    fn weight(&mut self, word: &Word) -> Option<f64> {
        let weight = word.number.value();
        if WEIGHTS.contains(&weight) {
            return Some(weight);
        }
        let (least, most) = (*WEIGHTS.start(), *WEIGHTS.end());
        self.spline_error(code::NURBS_WEIGHT, self.block.word_span(word), |mut finding| {
            finding.message = format!("the weight is {weight}, but must lie between {least} and {most}");
            let finding = finding.with_value("weight", weight, "").with_value("min_weight", least, "");
            finding.with_value("max_weight", most, "").suggest("use P1 for an ordinary control point")
        })
    }

    /// `G5.3`: the NURBS is complete. `before` is the motion before this block.
    pub(super) fn close_nurbs(&mut self, before: Motion) {
        self.state.motion = Motion::None;
        let span = self.code(Group::Motion).map_or(self.block.span(), |(_, span)| span);
        let Some(nurbs) = self.state.nurbs.take() else {
            if before != Motion::Unclear {
                self.findings.push_with(code::NURBS_NOT_OPEN, |code| {
                    Finding::new(code, span, "G5.3 closes a NURBS, but none is open")
                        .suggest("open one with G5.2, or remove G5.3")
                });
            }
            return;
        };
        let start = core::mem::replace(&mut self.state.position, nurbs.end);
        if nurbs.broken {
            return;
        }
        let Nurbs { order, points, weights, feed, path_control, .. } = *nurbs;
        if points.len() < usize::from(order) {
            let count = points.len();
            self.findings.push_with(code::NURBS_ORDER, |code| {
                let message =
                    format!("a NURBS of order {order} takes at least {order} control points, this has {count}");
                Finding::new(code, span, format!("{message}, its start among them"))
                    .with_value("order", f64::from(order), "")
                    .with_value("control_points", count as f64, "")
                    .suggest("add control points or lower the order, L")
            });
            return;
        }
        let Some(feed) = feed else {
            return;
        };
        let spline = Box::new(SplineGeometry { plane: self.state.plane, order, points, weights });
        if is_point(&spline) {
            return;
        }
        let mut step = self.new_move(MoveKind::Cutting, nurbs.end, feed);
        step.start = self.state.coords.placed(&start);
        (step.path_control, step.spline) = (path_control, Some(self.placed_spline(spline)));
        let kind = match self.state.tool_control.is_plain() {
            true => OperationKind::Move(step),
            false => OperationKind::Guided(Box::new(self.guided_step(self.guide(None), step))),
        };
        self.emit(nurbs.span, kind);
    }

    /// Drops the open NURBS where the block holds anything but its control points.
    #[cold]
    pub(super) fn check_open_nurbs(&mut self) {
        let motion = self.code(Group::Motion).map(|(meaning, _)| meaning);
        let own = matches!(motion, None | Some(Meaning::Nurbs | Meaning::NurbsEnd));
        let foreign = letter_bit(b'F') | letter_bit(b'S') | letter_bit(b'T');
        if own && !self.block.has_codes_besides_motion() && self.block.letters & foreign == 0 {
            return;
        }
        let Some(nurbs) = self.state.nurbs.take() else {
            return;
        };
        self.state.position = nurbs.end;
        self.state.motion = Motion::Unclear;
        let span = self.block.span();
        let opened = nurbs.span.line;
        self.findings.push_with(code::NURBS_UNFINISHED, |code| {
            let message = format!("only control points are permitted in the NURBS opened in line {opened}");
            Finding::new(code, span, message)
                .with_value("opened_in_line", f64::from(opened), "")
                .suggest("close it with G5.3 first")
        });
    }

    /// The axes of the words in the mask `axes`.
    fn axes_of(&self, axes: u32) -> impl Iterator<Item = Axis> {
        let letters = &self.table.dialect.letters;
        set_bits(axes).filter_map(|place| match letters[place] {
            Letter::Axis(axis) | Letter::Increment(axis) => Some(axis),
            _ => None,
        })
    }

    /// Whether every axis word is of the plane.
    fn check_spline_axes(&mut self, axes: u32) -> Option<()> {
        let (first, second) = self.state.plane.axes();
        let Some(place) =
            set_bits(axes).find(|&place| self.axes_of(1 << place).any(|axis| axis != first && axis != second))
        else {
            return Some(());
        };
        let span = self.block.word_span(self.block.slot(place));
        self.spline_error(code::SPLINE_AXIS, span, |mut finding| {
            let [first, second] = [first.letter(), second.letter()];
            let letter = char::from(b'A' + place as u8);
            finding.message = format!("a spline runs in the plane of {first} and {second}, and takes no {letter}");
            finding.suggest("move the other axes in a block of their own")
        })
    }

    /// The spline in work coordinates.
    pub(super) fn placed_spline(&mut self, mut spline: Box<SplineGeometry>) -> Box<SplineGeometry> {
        let Some(transform) = self.state.coords.transform.as_deref().copied() else { return spline };
        if transform.keeps_plane(spline.plane) {
            transform.spline(&mut spline);
        } else {
            let span = self.block.span();
            self.coord(
                code::COORD_SHAPE,
                span,
                "a spline in another plane than that of the rotation",
                "select the plane of the rotation",
            );
        }
        spline
    }

    /// Lengths along both axes of a plane, mm; 0 where there is no word.
    fn offset(&self, words: [Option<Word>; 2]) -> [f64; 2] {
        words.map(|word| word.map_or(0.0, |word| self.scaled(&word, true)))
    }

    #[cold]
    fn spline_error<T>(
        &mut self,
        code: FindingCode,
        span: SourceSpan,
        fill: impl FnOnce(Finding) -> Finding,
    ) -> Option<T> {
        self.findings.push_with(code, |code| fill(Finding::new(code, span, "")));
        None
    }
}

/// Whether the curve is a single point, so that there is nothing to move.
pub(super) fn is_point(spline: &SplineGeometry) -> bool {
    spline.points.iter().all(|point| *point == spline.points[0])
}

/// `P` and `Q` along the first and the second axis of the plane.
fn end_letters(plane: Plane) -> [u8; 2] {
    let (first, second) = plane.axes();
    if first.index() < second.index() { [b'P', b'Q'] } else { [b'Q', b'P'] }
}

/// Coordinates in the plane.
fn in_plane(plane: Plane, position: &Position) -> [f64; 2] {
    let (first, second) = plane.axes();
    [position[first.index()], position[second.index()]]
}

fn sum(point: [f64; 2], offset: [f64; 2]) -> [f64; 2] {
    [point[0] + offset[0], point[1] + offset[1]]
}
