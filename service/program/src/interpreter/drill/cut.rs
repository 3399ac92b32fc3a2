//! The cut of a hole and the return from it, for every cycle.

use super::super::execute::Execution;
use super::{Hole, Pecks};
use crate::code;
use crate::settings::{FANUC_RETRACT_MM, LINUXCNC_RETRACT_MM};
use crate::state::Cycle;
use crate::{DialectName, DwellTime, Finding, PeckReturn, SpindleDirection};

/// Strokes of one block, at most: more are a mistake, and nobody waits for them.
pub(in super::super) const MAX_STROKES: u32 = 10_000;

impl Pecks {
    /// The first peck, mm.
    const fn first(self) -> f64 {
        match self {
            Self::None => f64::INFINITY,
            Self::Constant(peck) | Self::Reducing { first: peck, .. } => peck,
        }
    }

    /// The peck after one of `peck` mm.
    fn after(self, peck: f64) -> f64 {
        match self {
            Self::None | Self::Constant(_) => peck,
            Self::Reducing { less, least, .. } => (peck - less).max(least),
        }
    }

    /// Strokes to a depth of `depth` mm, at most one more than [`MAX_STROKES`].
    pub(super) fn strokes(self, depth: f64) -> u32 {
        let (mut reached, mut peck, mut strokes) = (self.first(), self.first(), 1);
        while reached < depth && strokes <= MAX_STROKES {
            peck = self.after(peck);
            reached += peck;
            strokes += 1;
        }
        strokes
    }
}

impl Execution<'_> {
    /// Cuts a hole from the R level above it and returns; `direction` is the sense of the spindle before the cycle.
    pub(super) fn cut_hole(&mut self, hole: &Hole, direction: SpindleDirection) {
        match hole.cycle {
            Cycle::Drill | Cycle::DrillDwell => {
                self.feed_along(hole, hole.bottom);
                self.wait(hole);
                self.rapid_along(hole, hole.clear);
            }
            Cycle::Peck | Cycle::ChipBreak => {
                self.peck(hole);
                self.wait(hole);
                self.rapid_along(hole, hole.clear);
            }
            Cycle::Tap | Cycle::TapLeft => self.tap_hole(hole, direction),
            Cycle::Bore | Cycle::BoreDwell => {
                self.feed_along(hole, hole.bottom);
                self.wait(hole);
                let all_the_way = hole.cycle == Cycle::BoreDwell && self.settings.dialect == DialectName::LinuxCnc;
                self.feed_along(hole, if all_the_way { hole.clear } else { hole.r });
                self.rapid_along(hole, hole.clear);
            }
            Cycle::BoreStop => {
                self.feed_along(hole, hole.bottom);
                self.wait(hole);
                self.turn(SpindleDirection::Stopped);
                self.rapid_along(hole, hole.clear);
                self.turn(direction);
            }
            Cycle::FineBore => self.fine_bore(hole, direction),
            // Refused, and carried out elsewhere.
            Cycle::BoreManual | Cycle::BackBore => {}
        }
    }

    /// The dwell at the bottom.
    pub(super) fn wait(&mut self, hole: &Hole) {
        if hole.dwell_s > 0.0 {
            self.dwell_for(self.block.span(), DwellTime::Seconds(hole.dwell_s));
        }
    }

    /// Peck after peck down to the bottom.
    fn peck(&mut self, hole: &Hole) {
        let Hole { up, r, bottom, pecks, .. } = *hole;
        let to_r = hole.cycle == Cycle::Peck
            && !(self.has_lathe_cycles() && self.settings.drilling.lathe_peck == Some(PeckReturn::Back));
        // One peck is no retract.
        let back = if up * (r - up * pecks.first() - bottom) > 0.0 { self.retract(to_r) } else { 0.0 };
        let linuxcnc = self.settings.dialect == DialectName::LinuxCnc;
        let lift = if linuxcnc { 0.0 } else { self.settings.drilling.peck_lift_mm };
        let mut peck = pecks.first();
        let mut depth = r - up * peck;
        let mut since_out = peck;
        while up * (depth - bottom) > 0.0 {
            self.feed_along(hole, depth);
            let is_out = to_r || hole.out_after.is_some_and(|most| since_out >= most);
            if is_out {
                self.rapid_along(hole, r + up * if to_r { lift } else { 0.0 });
                since_out = 0.0;
            }
            let above = depth + up * back;
            // LinuxCNC goes above the R level where the pecks are smaller than the retract.
            let above = if linuxcnc || up * (above - r) <= 0.0 { above } else { r };
            self.rapid_along(hole, above);
            peck = pecks.after(peck);
            since_out += peck;
            depth -= up * peck;
        }
        self.feed_along(hole, bottom);
    }

    /// How far a peck is retracted, or how far above its depth the rapid back ends, mm; a default is reported once.
    pub(super) fn retract(&mut self, to_r: bool) -> f64 {
        let drilling = &self.settings.drilling;
        let (stated, setting, parameter) = if to_r {
            (drilling.peck_clearance_mm, "peck_clearance_mm", 5115.0)
        } else {
            (drilling.chip_break_retract_mm, "chip_break_retract_mm", 5114.0)
        };
        if let Some(retract_mm) = stated {
            return retract_mm;
        }
        if self.settings.dialect == DialectName::LinuxCnc {
            return LINUXCNC_RETRACT_MM;
        }
        let reported = &mut self.state.drilling.default_reported[usize::from(!to_r)];
        if !std::mem::replace(reported, true) {
            let span = self.block.span();
            let (kind, value, number) = if self.settings.is_haas() {
                ("setting", "haas_setting", 22.0)
            } else {
                ("parameter", "fanuc_parameter", parameter)
            };
            self.findings.push_with(code::CYCLE_DEFAULT, |code| {
                let message = format!(
                    "the machine profile does not state language.drilling.{setting}: {FANUC_RETRACT_MM} mm is taken"
                );
                Finding::new(code, span, message)
                    .with_value("retract", FANUC_RETRACT_MM, "mm")
                    .with_value(value, number, "")
                    .suggest(format!("set {setting} to the value of {kind} {number} of the control"))
            });
        }
        FANUC_RETRACT_MM
    }
}
