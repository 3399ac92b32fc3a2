//! The single cycles: one pass along Z (`G90` of system A) or along X (`G94`), cylinder or cone, for every block with X or Z.
//!
//! From the start S the tool goes rapidly along the axis of the infeed to the start of the cut, cuts to the end point, feeds
//! back to the level of S and returns rapidly. `R` is the start of the cut less its end: on the radius in turning, along Z in
//! facing (`I` and `K` on older controls).

use super::super::execute::Execution;
use super::SIGNED_MM;
use crate::code;
use crate::dialect::{Group, letter_bit};
use crate::state::{Motion, SingleCycle};
use crate::{Feed, Finding, MoveKind, PathControl};

impl Execution<'_> {
    /// A block with the code of a single cycle.
    pub(super) fn open_single_cycle(&mut self, cycle: SingleCycle, before: Motion) {
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        if before != Motion::SingleCycle(cycle) {
            self.state.turning.taper_mm = 0.0;
            let tapers = letter_bit(b'R') | letter_bit(b'I') | letter_bit(b'K');
            if (axes | self.block.letters & tapers) == 0 {
                return self.idle_single_cycle();
            }
            if self.turning_letters().into_iter().any(|letters| axes & letters == 0) {
                self.state.motion = Motion::Unclear;
                self.used |= axes | tapers;
                return self.turning_word_missing(
                    "end point in its first block",
                    "add X and Z, or U and W in G-code system A",
                );
            }
        }
        self.state.motion = Motion::SingleCycle(cycle);
        self.single_cycle(cycle);
    }

    /// The code of a single cycle in a block that has nothing else of it, as posts of other controls write `G90`: it moves nothing, and
    /// what axis words behind it would cut is not guessed.
    fn idle_single_cycle(&mut self) {
        let Some((_, span)) = self.code(Group::Motion) else { return };
        let tenths = self.block.code(Group::Motion).map_or(0, |code| self.table.code(code.place).tenths);
        self.state.motion = Motion::Doubtful { tenths, line: span.line };
        self.findings.push_with(code::TURNING_IDLE, |code| {
            let name = format!("G{}", tenths / 10);
            let message = format!(
                "{name} is a turning cycle in this G-code system and moves nothing without words of X and Z, which would cut in the blocks behind it"
            );
            let instead = match tenths {
                900 => ": X and Z are absolute, U and W incremental",
                940 => "; the feed per minute is G98",
                200 => "; inches are G70",
                _ => "",
            };
            Finding::new(code, span, message).suggest(format!("leave {name} out{instead}"))
        });
    }

    /// A block while a single cycle is in force.
    pub(in super::super) fn single_cycle(&mut self, cycle: SingleCycle) {
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        if self.block.unclear || axes == 0 {
            return;
        }
        let older = if cycle == SingleCycle::Turn { b'I' } else { b'K' };
        let has_older = self.block.word(older).is_some() && self.block.word(b'R').is_none();
        let letter = if has_older { older } else { b'R' };
        let taper = self.turning_length(letter, "taper", &SIGNED_MM, |this, word| this.scaled(word, true));
        let Some((end, named)) = self.turning_end() else { return };
        for (place, named) in named.into_iter().enumerate() {
            if named {
                self.state.turning.end[place] = end[place];
            }
        }
        if let Some(Some(taper_mm)) = taper {
            self.state.turning.taper_mm = taper_mm;
        }
        if self.is_cycle_on_contour("a turning cycle") {
            return;
        }
        let feed = self.cutting_feed();
        if let (Some(_), Some(feed)) = (taper, feed) {
            self.single_pass(cycle, feed);
        }
    }

    fn single_pass(&mut self, cycle: SingleCycle, feed: Feed) {
        let start = self.tool_place();
        let (end, taper_mm) = (self.state.turning.end, self.state.turning.taper_mm);
        // Along the infeed and along the cut.
        let (deep, along) = if cycle == SingleCycle::Turn { (0, 1) } else { (1, 0) };
        if end[along] == start[along] {
            return self.turning_finding(
                code::TURNING_START,
                "the cycle ends at the level where it starts",
                "check the end point and the position before the cycle",
            );
        }
        let infeed = end[deep] - start[deep];
        if taper_mm * infeed < 0.0 && taper_mm.abs() > infeed.abs() {
            let span = self.block.span();
            return self.findings.push_with(code::TURNING_VALUE, |code| {
                let message = format!(
                    "the taper of {taper_mm} mm begins beyond the start of the cycle, {} mm away",
                    infeed.abs()
                );
                Finding::new(code, span, message)
                    .with_value("taper", taper_mm, "mm")
                    .with_value("infeed", infeed, "mm")
                    .suggest("start further away from the work, or check the sign of R: start less end of the cut")
            });
        }
        let mut cut_start = start;
        cut_start[deep] = end[deep] + taper_mm;
        let mut back = end;
        back[deep] = start[deep];
        let modal = std::mem::replace(&mut self.state.path_control, PathControl::ExactPath);
        for (kind, [x, z]) in [
            (MoveKind::Rapid, cut_start),
            (MoveKind::Cutting, end),
            (MoveKind::Cutting, back),
            (MoveKind::Rapid, start),
        ] {
            self.turning_move(kind, x, z, feed);
        }
        self.state.path_control = modal;
    }

    /// A straight move of a cycle.
    pub(super) fn turning_move(&mut self, kind: MoveKind, x: f64, z: f64, feed: Feed) {
        let end = self.moved(x, z);
        let feed = if kind == MoveKind::Rapid { Feed::PerMinute(0.0) } else { feed };
        self.emit_move(kind, &end, None, feed);
        self.state.position = end;
    }
}
