//! Tapping: with a feed and a spindle that is reversed, or as one motion of spindle and tool.

use super::super::execute::Execution;
use super::super::motion::Frame;
use super::{Drive, Hole};
use crate::dialect::{Group, letter_bit};
use crate::state::Cycle;
use crate::{
    DialectName, DrillingStyle, OperationKind, PeckReturn, Position, Spindle, SpindleDirection, SpindleSpeed,
    ThreadKind, ThreadMove,
};

/// Largest `J` of a Haas tap.
const MAX_TAP_RETRACT: u32 = 9;

/// The other sense.
const fn reversed(direction: SpindleDirection) -> SpindleDirection {
    match direction {
        SpindleDirection::Clockwise => SpindleDirection::CounterClockwise,
        SpindleDirection::CounterClockwise => SpindleDirection::Clockwise,
        SpindleDirection::Stopped => SpindleDirection::Stopped,
    }
}

impl Execution<'_> {
    /// `G84` and `G74` from the R level.
    pub(super) fn tap_hole(&mut self, hole: &Hole, direction: SpindleDirection) {
        if let Drive::Spindle { lead_mm } = hole.drive {
            return self.tap_rigidly(hole, lead_mm);
        }
        self.feed_along(hole, hole.bottom);
        self.turn(reversed(direction));
        self.wait(hole);
        let all_the_way = self.settings.dialect == DialectName::LinuxCnc;
        self.feed_along(hole, if all_the_way { hole.clear } else { hole.r });
        self.turn(direction);
        self.rapid_along(hole, hole.clear);
    }

    /// A tap whose spindle is bound to the tool; it comes to rest with it at both ends.
    fn tap_rigidly(&mut self, hole: &Hole, lead_mm: f64) {
        let into = match hole.cycle {
            Cycle::TapLeft => SpindleDirection::CounterClockwise,
            _ => SpindleDirection::Clockwise,
        };
        let out = reversed(into);
        if let super::Pecks::Constant(peck) = hole.pecks {
            let to_r = self.settings.drilling.tap_peck == Some(PeckReturn::RLevel);
            let back = self.retract(to_r);
            let mut depth = hole.r - hole.up * peck;
            while hole.up * (depth - hole.bottom) > 0.0 {
                self.tap_along(hole, depth, lead_mm, into, 1.0);
                let above = depth + hole.up * back;
                let above = if to_r || hole.up * (above - hole.r) > 0.0 { hole.r } else { above };
                self.tap_along(hole, above, lead_mm, out, hole.tap_retract);
                depth -= hole.up * peck;
            }
        }
        self.tap_along(hole, hole.bottom, lead_mm, into, 1.0);
        self.wait(hole);
        self.tap_along(hole, hole.r, lead_mm, out, hole.tap_retract);
        self.rapid_along(hole, hole.clear);
    }

    /// A stroke at so many times the speed.
    fn tap_along(&mut self, hole: &Hole, level: f64, lead_mm: f64, direction: SpindleDirection, times: f64) {
        let end = self.along(hole, level);
        self.tap_stroke(end, lead_mm, direction, self.state.rev_per_min * times);
    }

    /// `J` of Haas: how many times faster than in a tap goes out.
    pub(super) fn tap_retract(&mut self, cycle: Cycle) -> Option<f64> {
        let haas = self.settings.drilling.style == DrillingStyle::Haas && !self.is_linuxcnc();
        if !haas || !matches!(cycle, Cycle::Tap | Cycle::TapLeft) {
            return Some(1.0);
        }
        if let Some(word) = self.take(b'J') {
            if !self.taps_rigidly() {
                let what = "whether G84 and G74 are synchronised with the spindle, which J needs";
                self.cycle_setting(what, "rigid_tapping", "true where they are");
                return None;
            }
            let times = self.whole(&word)?;
            if times > MAX_TAP_RETRACT {
                let message = format!("J is {times}, but a tap is retracted 1 to {MAX_TAP_RETRACT} times as fast");
                self.drill_value(&word, message, "write how many times faster than in the tap goes out");
                return None;
            }
            self.state.drilling.tap_retract = times;
        }
        Some(f64::from(self.state.drilling.tap_retract.max(1)))
    }

    /// A stroke of a rigid tap to `end`.
    fn tap_stroke(&mut self, end: Position, lead_mm: f64, direction: SpindleDirection, rev_per_min: f64) {
        if end == self.state.position {
            return;
        }
        let stroke = ThreadMove {
            kind: ThreadKind::Tapped,
            start: self.state.coords.placed(&self.state.position),
            end: self.state.coords.placed(&end),
            work_offset: self.machine_offset(),
            frame_offset: self.frame_offset(),
            lead_mm,
            start_angle_deg: 0.0,
            thread_start: 0,
            amplitude_mm: None,
            amplitude_word: None,
            phase_shift_deg: None,
            pull_out: None,
            included_angle_deg: None,
            spindle: Spindle { direction, speed: SpindleSpeed::Constant { rev_per_min } },
            tool: self.state.tool,
            plane: self.thread_plane(),
        };
        self.emit(self.block.span(), OperationKind::Thread(Box::new(stroke)));
        self.state.position = end;
    }

    /// A block while `G33.1` is in force: in with the spindle, and out again with the spindle reversed.
    #[cold]
    pub(in super::super) fn rigid_tap(&mut self) {
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        if axes == 0 || self.block.unclear {
            self.used |= letter_bit(b'K') | letter_bit(b'I');
            if axes == 0 && !self.block.unclear && self.code(Group::Motion).is_some() {
                self.cycle_word("G33.1 names no axis", "add the axis of the hole with its bottom");
            }
            return;
        }
        let start = self.state.position;
        if let Some(word) = self.block.word(b'F').copied() {
            self.word_conflict(&word, "G33.1 has no feed: K says its travel per revolution");
        }
        let lead_mm = match self.take(b'K') {
            Some(word) => self.checked_lead(&word, self.scaled(&word, true)),
            None => {
                self.cycle_word("G33.1 has no K, the travel per revolution", "add K with the pitch");
                None
            }
        };
        let factor = self.take(b'I').map_or(1.0, |word| word.number.value());
        let turns = self.spindle_cuts_threads();
        let end = self.target(axes, Frame::Work);
        let factor = if factor > 0.0 { factor } else { 1.0 };
        if let Some(lead_mm) = lead_mm
            && turns
        {
            let (direction, speed) = (self.state.spindle_direction, self.state.rev_per_min);
            self.tap_stroke(end, lead_mm, direction, speed);
            self.tap_stroke(start, lead_mm, reversed(direction), speed * factor);
        }
    }
}
