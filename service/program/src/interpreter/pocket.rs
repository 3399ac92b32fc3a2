//! Circular pockets of Haas mills: `G12` clockwise, `G13` counter-clockwise.
//!
//! From the centre the tool feeds to the depth, gets to the first circle on half a circle, goes round, from circle to circle by a
//! straight step along X, and from the last one back to the centre on half a circle. `I` is the radius of the first circle, `K` of the
//! last one, `Q` the step; the radius of the tool (`D`) is taken off. With `G91` the depth `Z` is gone down again in each of `L` rounds.
//! What the manual does not say is noted (`PRG-POCKET-PATH`).

use core::f64::consts::{PI, TAU};

use super::drill::MAX_STROKES;
use super::execute::Execution;
use super::motion::Frame;
use crate::code;
use crate::dialect::letter_bit;
use crate::state::Motion;
use crate::{ArcGeometry, Axis, Feed, Finding, MoveKind, Plane, Position, SourceSpan};

/// The words of a pocket beside its place.
const WORDS: u32 =
    letter_bit(b'D') | letter_bit(b'I') | letter_bit(b'K') | letter_bit(b'Q') | letter_bit(b'L') | letter_bit(b'F');

/// Circles that are nearer to the last one than this, mm, are that one.
const SAME_CIRCLE_MM: f64 = 1e-6;

/// The circles of a pocket, radii of the path of the tool's centre, mm.
#[derive(Clone, Copy, Debug)]
struct Circles {
    first_mm: f64,
    last_mm: f64,
    step_mm: f64,
    clockwise: bool,
    rounds: u32,
}

impl Circles {
    /// How many there are in a round, at most one more than a block may have.
    fn count(&self) -> u32 {
        let steps = (self.last_mm - self.first_mm - SAME_CIRCLE_MM) / self.step_mm;
        if steps > 0.0 { (steps.ceil() as u32).min(MAX_STROKES) + 1 } else { 1 }
    }

    /// The radii of a round.
    fn radii(self) -> impl Iterator<Item = f64> {
        let count = self.count();
        (0..count).map(move |number| match number {
            _ if number + 1 == count => self.last_mm,
            _ => self.first_mm + f64::from(number) * self.step_mm,
        })
    }
}

impl Execution<'_> {
    /// `G12` and `G13`.
    #[cold]
    pub(super) fn circular_pocket(&mut self, clockwise: bool) {
        let span = self.block.span();
        let axes = [Axis::X, Axis::Y, Axis::Z].map(|axis| self.letters_of(axis) & self.block.letters);
        let mark = self.findings.mark();
        let circles = if self.is_pocket_refused(clockwise, span) { None } else { self.circles(clockwise, span) };
        let feed = circles.and_then(|_| self.cutting_feed());
        let start = self.state.position;
        let end = self.target(axes.iter().fold(0, |letters, of_axis| letters | of_axis), Frame::Work);
        self.used |= WORDS;
        let (Some(circles), Some(feed), false) = (circles, feed, self.findings.has_errors_since(&mark)) else {
            self.state.position = end;
            return;
        };
        let down_mm = end[2] - start[2];
        if circles.rounds > 1 && !self.state.absolute && (axes[0] | axes[1]) != 0 {
            self.state.position = end;
            let message = "whether each round of a pocket moves by incremental X and Y depends on the control";
            return self.pocket_finding(
                code::POCKET_WORD,
                span,
                message.to_owned(),
                "move to the centre in a block before it",
            );
        }
        self.note_pocket_path(span);
        let is_rapid = matches!(self.state.motion, Motion::Rapid | Motion::None);
        let kind = if is_rapid { MoveKind::Rapid } else { MoveKind::Cutting };
        let mut center = end;
        center[2] = start[2];
        self.pocket_move(kind, center, None, feed);
        for round in 0..circles.rounds {
            let mut at = self.state.position;
            at[2] = if self.state.absolute || round == 0 { end[2] } else { at[2] + down_mm };
            self.pocket_move(MoveKind::Cutting, at, None, feed);
            self.cut_circles(circles, at, feed);
        }
    }

    /// The circles about `center`, which is where the tool is and comes back to.
    fn cut_circles(&mut self, circles: Circles, center: Position, feed: Feed) {
        let sense = if circles.clockwise { -1.0 } else { 1.0 };
        let arc = |along_x: f64, sweep_rad: f64| ArcGeometry {
            plane: Plane::Xy,
            center: [center[0] + along_x, center[1]],
            clockwise: circles.clockwise,
            sweep_rad: sense * sweep_rad,
        };
        let mut reached_mm = 0.0;
        for radius_mm in circles.radii() {
            if radius_mm <= 0.0 {
                continue;
            }
            let mut at = center;
            at[0] += radius_mm;
            let inward = (reached_mm == 0.0).then(|| arc(0.5 * radius_mm, PI));
            self.pocket_move(MoveKind::Cutting, at, inward, feed);
            self.pocket_move(MoveKind::Cutting, at, Some(arc(0.0, TAU)), feed);
            reached_mm = radius_mm;
        }
        if reached_mm > 0.0 {
            self.pocket_move(MoveKind::Cutting, center, Some(arc(0.5 * reached_mm, PI)), feed);
        }
    }

    fn pocket_move(&mut self, kind: MoveKind, end: Position, arc: Option<ArcGeometry>, feed: Feed) {
        let feed = if kind == MoveKind::Rapid { Feed::PerMinute(0.0) } else { feed };
        self.emit_move(kind, &end, arc, feed);
        self.state.position = end;
    }

    /// Whether a pocket cannot be carried out in what is in force; it is then reported.
    fn is_pocket_refused(&mut self, clockwise: bool, span: SourceSpan) -> bool {
        let name = if clockwise { "G12" } else { "G13" };
        if !self.is_haas_code(name, "a circular pocket", None, span) {
            return true;
        }
        let keeps_circles = |plane| self.state.coords.transform.as_ref().is_none_or(|it| it.keeps_circles(plane));
        let (message, cure) = if self.state.plane != Plane::Xy {
            ("a circular pocket is cut in the plane G17", "select it before the block")
        } else if self.state.drilling.cycle.is_some() {
            ("a circular pocket while a drilling cycle is in force", "end the cycle with G80 before it")
        } else if self.state.coords.polar.is_some() {
            ("a circular pocket in polar coordinates (G16)", "end them with G15 before it")
        } else if !keeps_circles(Plane::Xy) {
            (
                "a circular pocket in coordinates in which circles do not stay circles",
                "scale both axes of the plane alike",
            )
        } else if !self.state.tool_control.is_plain() {
            (
                "a circular pocket while the machine places the tool",
                "end tool centre point control or the tilted plane before it",
            )
        } else {
            return false;
        };
        self.pocket_finding(code::POCKET_BLOCK, span, message.to_owned(), cure);
        true
    }

    /// The circles that the words say; nothing after a finding.
    fn circles(&mut self, clockwise: bool, span: SourceSpan) -> Option<Circles> {
        let tool_mm = self.nose_of_offset(span)?.radius_mm.abs();
        let [first, last, step] = [b'I', b'K', b'Q'].map(|letter| self.take(letter));
        let Some(first) = first else {
            self.pocket_finding(
                code::POCKET_WORD,
                span,
                "the radius I of the first circle is missing".to_owned(),
                "add I",
            );
            return None;
        };
        let first_mm = self.scaled(&first, true);
        let last_mm = last.map_or(first_mm, |word| self.scaled(&word, true));
        let step_mm = step.map_or(0.0, |word| self.scaled(&word, true));
        let message = if first_mm <= 0.0 || first_mm < tool_mm {
            format!("the first circle, I {first_mm} mm, is smaller than the tool, {tool_mm} mm")
        } else if last.is_some() != step.is_some() {
            "K, the radius of the last circle, and Q, the step to it, go together".to_owned()
        } else if last.is_some() && (last_mm <= first_mm || step_mm <= 0.0) {
            format!(
                "the last circle, K {last_mm} mm, must be larger than the first, I {first_mm} mm, and the step Q {step_mm} mm positive"
            )
        } else {
            String::new()
        };
        if !message.is_empty() {
            let cure = "write I from the radius of the tool on, and K with Q for more circles up to a larger one";
            self.pocket_finding(code::POCKET_WORD, span, message, cure);
            return None;
        }
        let rounds = match self.take(b'L') {
            Some(word) => self.whole(&word)?.max(1),
            None => 1,
        };
        let circles = Circles { first_mm: first_mm - tool_mm, last_mm: last_mm - tool_mm, step_mm, clockwise, rounds };
        if u64::from(circles.count()) * u64::from(rounds) > u64::from(MAX_STROKES) {
            let message = format!("more than {MAX_STROKES} circles in one block");
            self.pocket_finding(
                code::POCKET_WORD,
                span,
                message,
                "write a larger step Q or fewer rounds L; a decimal point may be missing",
            );
            return None;
        }
        Some(circles)
    }

    fn note_pocket_path(&mut self, span: SourceSpan) {
        if !core::mem::replace(&mut self.state.reported.pocket, true) {
            let message = "half circles from the centre and back to it, and steps along X from circle to circle are planned: how the control gets there is not documented";
            self.pocket_finding(code::POCKET_PATH, span, message.to_owned(), "leave room for them within the pocket");
        }
    }

    #[cold]
    fn pocket_finding(&mut self, code: crate::FindingCode, span: SourceSpan, message: String, cure: &'static str) {
        self.findings.push_with(code, |code| Finding::new(code, span, message).suggest(cure));
    }
}
