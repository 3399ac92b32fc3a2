//! Pecks along one axis in columns along the other: `G74` along Z, `G75` along X.
//!
//! A column is cut from the level of the start in pecks of Δ, after each of which the tool goes back rapidly by e. At the bottom
//! of every column but the first the tool moves off by Δd, away from the next column, and returns rapidly. The last column is
//! at the end point exactly, and the cycle ends where it started.

use super::super::execute::Execution;
use super::{DEPTHS_MM, LENGTHS_MM, SCALED, THOUSANDTHS};
use crate::code;
use crate::dialect::letter_bit;
use crate::settings::ESCAPE_MM;
use crate::{Axis, DrillingStyle, Feed, Finding, MoveKind, PathControl};

/// Strokes of one block, at most: more are a mistake.
const MAX_STROKES: f64 = 10_000.0;

/// A rest of a peck or of a step below this is none, mm.
const REST_MM: f64 = 1e-9;

/// The words of a groove.
struct Groove {
    /// Place of the axis of the pecks: 0 for X, 1 for Z.
    deep: usize,
    end: [f64; 2],
    peck_mm: f64,
    /// From column to column; nothing where there is one.
    step_mm: Option<f64>,
    relief_mm: f64,
    return_mm: f64,
    feed: Feed,
}

impl Groove {
    /// How far it goes along an axis, from the start.
    fn travel(&self, start: [f64; 2], axis: usize) -> f64 {
        (self.end[axis] - start[axis]).abs()
    }
}

/// Mask of letters.
fn letters_of(letters: &[u8]) -> u32 {
    letters.iter().fold(0, |mask, &letter| mask | letter_bit(letter))
}

impl Execution<'_> {
    /// A block with `G74` or `G75` of a lathe.
    pub(super) fn groove(&mut self, along: Axis) {
        let letters = self.block.letters & !self.used;
        let [x, z] = self.turning_letters();
        if letters & (x | z | letters_of(b"PQIKD")) == 0 {
            return self.groove_return();
        }
        let start = self.tool_place();
        let Some(groove) = self.groove_words(along, letters, start) else { return };
        let columns = groove.step_mm.map_or(1.0, |step| (groove.travel(start, 1 - groove.deep) / step).ceil() + 1.0);
        let strokes = (groove.travel(start, groove.deep) / groove.peck_mm).ceil() * columns;
        if strokes > MAX_STROKES {
            let span = self.block.span();
            return self.findings.push_with(code::TURNING_LIMIT, |code| {
                Finding::new(code, span, format!("the cycle has {strokes} strokes, more than {MAX_STROKES}"))
                    .with_value("strokes", strokes, "")
                    .with_value("limit", MAX_STROKES, "")
                    .suggest("write larger pecks and steps; a decimal point may be missing")
            });
        }
        let modal = std::mem::replace(&mut self.state.path_control, PathControl::ExactPath);
        self.cut_groove(&groove, start);
        self.state.path_control = modal;
    }

    /// The first of two lines: `R` alone, for all that follow.
    fn groove_return(&mut self) {
        match self.turning_length(b'R', "return", &LENGTHS_MM, SCALED) {
            Some(Some(return_mm)) => self.state.turning.groove_return_mm = Some(return_mm),
            Some(None) => {
                self.turning_word_missing("words", "write R with the return, or X, Z, P and Q of the groove");
            }
            None => {}
        }
    }

    /// The groove that the words of a block describe; nothing after a finding.
    fn groove_words(&mut self, along: Axis, letters: u32, start: [f64; 2]) -> Option<Groove> {
        let one_line = letters & letters_of(b"IKD") != 0;
        if one_line && letters & letters_of(b"PQR") != 0 {
            self.used = u32::MAX;
            self.turning_finding(
                code::TURNING_FORM,
                "the words of this grooving cycle belong to two of its forms",
                "in two lines: R, then X Z P Q R F; in one line: X Z I K D F",
            );
            return None;
        }
        let (steps, relief_letter, read) =
            if one_line { ([b'I', b'K'], b'D', SCALED) } else { ([b'P', b'Q'], b'R', THOUSANDTHS) };
        // Δd of FANUC's two lines is a length like any other, D of its one line counts in least increments.
        let read_relief = match self.settings.drilling.style {
            DrillingStyle::Fanuc if one_line => THOUSANDTHS,
            _ => SCALED,
        };
        let deep = usize::from(along == Axis::Z);
        // Posts write P0 beside pecks without a step.
        if self.block.word(steps[1 - deep]).is_some_and(|word| word.number.value() == 0.0) {
            self.take(steps[1 - deep]);
        }
        let along_x = self.turning_length(steps[0], "step_along_x", &DEPTHS_MM, read);
        let along_z = self.turning_length(steps[1], "step_along_z", &DEPTHS_MM, read);
        let relief = self.turning_length(relief_letter, "relief", &LENGTHS_MM, read_relief);
        let (end, _) = self.turning_end()?;
        if self.is_cycle_on_contour("a grooving cycle") {
            return None;
        }
        let feed = self.cutting_feed();
        let (along_x, along_z, relief, feed) = (along_x?, along_z?, relief?, feed?);
        let pecks = [along_x, along_z];
        let names = ["X", "Z"];
        if end[deep] == start[deep] {
            let message = format!("the groove ends at the {} where it starts", names[deep]);
            let cure = "check the end point and the position before it";
            self.turning_finding(code::TURNING_START, &message, cure);
            return None;
        }
        let Some(peck_mm) = pecks[deep] else {
            let cure = format!("add {} with the peck along {}", char::from(steps[deep]), names[deep]);
            self.turning_word_missing("peck", &cure);
            return None;
        };
        let step_mm = if end[1 - deep] == start[1 - deep] { None } else { pecks[1 - deep] };
        if step_mm.is_none() && end[1 - deep] != start[1 - deep] {
            let cure = format!("add {} with the step along {}", char::from(steps[1 - deep]), names[1 - deep]);
            self.turning_word_missing("step from groove to groove", &cure);
            return None;
        }
        let turning = &self.settings.turning;
        let stated = self.state.turning.groove_return_mm.or(turning.groove_return_mm);
        let return_mm = self.turning_default(1, stated, "groove_return_mm", ESCAPE_MM);
        Some(Groove { deep, end, peck_mm, step_mm, relief_mm: relief.unwrap_or(0.0), return_mm, feed })
    }

    fn cut_groove(&mut self, groove: &Groove, start: [f64; 2]) {
        let &Groove { deep, end, step_mm, relief_mm, .. } = groove;
        let across = 1 - deep;
        let travel = (end[across] - start[across]).abs();
        let sense = (end[across] - start[across]).signum();
        let mut column = 0.0;
        loop {
            let is_last = step_mm.is_none_or(|step| column * step >= travel - REST_MM);
            let at = match step_mm {
                Some(step) if !is_last => start[across] + sense * column * step,
                _ => end[across],
            };
            self.groove_to(MoveKind::Rapid, deep, start[deep], at, groove.feed);
            self.cut_column(groove, start[deep], at);
            let back_at = if column > 0.0 { at - sense * relief_mm } else { at };
            self.groove_to(MoveKind::Rapid, deep, end[deep], back_at, groove.feed);
            self.groove_to(MoveKind::Rapid, deep, start[deep], back_at, groove.feed);
            if is_last {
                break;
            }
            column += 1.0;
        }
        self.groove_to(MoveKind::Rapid, deep, start[deep], start[across], groove.feed);
    }

    /// The pecks of a column.
    fn cut_column(&mut self, groove: &Groove, from: f64, at: f64) {
        let &Groove { deep, end, peck_mm, return_mm, feed, .. } = groove;
        let (travel, sense) = ((end[deep] - from).abs(), (end[deep] - from).signum());
        let mut pecks = 1.0;
        while pecks * peck_mm < travel - REST_MM {
            let reached = pecks * peck_mm;
            self.groove_to(MoveKind::Cutting, deep, from + sense * reached, at, feed);
            // Not beyond the level of the start.
            self.groove_to(MoveKind::Rapid, deep, from + sense * (reached - return_mm.min(reached)), at, feed);
            pecks += 1.0;
        }
        self.groove_to(MoveKind::Cutting, deep, end[deep], at, feed);
    }

    fn groove_to(&mut self, kind: MoveKind, deep: usize, level: f64, at: f64, feed: Feed) {
        let (x, z) = if deep == 0 { (level, at) } else { (at, level) };
        self.turning_move(kind, x, z, feed);
    }
}
