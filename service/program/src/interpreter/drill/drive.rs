//! What makes the tool of a cycle cut: the feed, or the spindle.

use super::super::execute::Execution;
use super::Drive;
use crate::code;
use crate::consequence::JUDGED_BY;
use crate::dialect::FeedUnit;
use crate::state::Cycle;
use crate::{DialectName, Finding};

/// Leads of taps, mm.
const LEADS_MM: core::ops::RangeInclusive<f64> = 1e-4..=500.0;

impl Execution<'_> {
    /// Whether the taps of this place are synchronised with the spindle.
    pub(super) fn taps_rigidly(&self) -> bool {
        let always = self.settings.drilling.rigid_tapping || self.settings.is_haas();
        !self.is_linuxcnc() && (always || self.state.machine.rigid_tapping)
    }

    /// What makes the tool cut; nothing after a finding.
    pub(super) fn drive(&mut self, cycle: Cycle) -> Option<Drive> {
        if self.state.feed_unit == FeedUnit::InverseTime {
            let (span, [per_minute, _]) = (self.cycle_span(), self.settings.feed_codes());
            self.findings.push_with(code::CYCLE_FEED, |code| {
                Finding::new(code, span, "a drilling cycle under inverse time feed, G93")
                    .suggest(format!("switch to feed per minute before the cycle, {per_minute}"))
            });
            return None;
        }
        if !matches!(cycle, Cycle::Tap | Cycle::TapLeft) {
            if cycle == Cycle::BoreStop && self.is_linuxcnc() {
                self.check_spindle(cycle)?;
            }
            return self.cutting_feed().map(Drive::Feed);
        }
        if !self.taps_rigidly() {
            let feed = self.cutting_feed();
            self.check_spindle(cycle)?;
            return feed.map(Drive::Feed);
        }
        self.rigid_drive()
    }

    /// Lead of a rigid tap: the feed per revolution, or the feed per minute over the speed.
    fn rigid_drive(&mut self) -> Option<Drive> {
        let (feed, speed) = (self.state.feed, self.state.rev_per_min);
        if self.state.surface_speed || speed <= 0.0 {
            if self.state.unread & JUDGED_BY == 0 {
                // Under G96 an S, that of M29 as well, is a surface speed.
                let cure = if self.state.surface_speed {
                    "switch to a constant speed before it, such as G97 S500"
                } else {
                    "write M29 S500 before it"
                };
                self.spindle_finding("a rigid tap needs a constant spindle speed", cure);
            }
            return None;
        }
        if feed <= 0.0 || self.state.unread & JUDGED_BY != 0 {
            // Reports a missing feed.
            self.cutting_feed();
            return None;
        }
        let lead_mm = if self.state.feed_unit == FeedUnit::PerMinute { feed / speed } else { feed };
        if LEADS_MM.contains(&lead_mm) {
            return Some(Drive::Spindle { lead_mm });
        }
        let (span, [per_minute, per_revolution]) = (self.cycle_span(), self.settings.feed_codes());
        self.findings.push_with(code::CYCLE_VALUE, |code| {
            let message = format!("the lead of the tap is {lead_mm} mm, but must be 0.0001 to 500 mm");
            Finding::new(code, span, message)
                .with_value("lead", lead_mm, "mm")
                .suggest(format!("in {per_revolution} F is the pitch, in {per_minute} pitch times speed"))
        });
        None
    }

    /// Whether the spindle turns as the cycle needs it.
    fn check_spindle(&mut self, cycle: Cycle) -> Option<()> {
        use crate::SpindleDirection::{Clockwise, CounterClockwise};
        if self.state.unread & JUDGED_BY != 0 {
            return None;
        }
        let name = self.cycle_name();
        if !self.state.spindle_turns() {
            let start = if cycle == Cycle::TapLeft { "M4" } else { "M3" };
            let cure = match self.settings.dialect {
                DialectName::Lathe => format!(
                    "start it before, such as {start} S500; where an M code of the machine starts a live tool, list that code with \
                     {start} in code_replacements of the profile's language"
                ),
                _ => format!("start it before, such as {start} S500"),
            };
            self.spindle_finding(&format!("the spindle does not turn in {name}"), &cure);
            return None;
        }
        let wrong = match (cycle, self.state.spindle_direction) {
            (Cycle::Tap, CounterClockwise) => Some(("counter-clockwise", "M3, or G74 for a left-hand thread")),
            (Cycle::TapLeft, Clockwise) => Some(("clockwise", "M4, or G84 for a right-hand thread")),
            _ => None,
        };
        let Some((sense, cure)) = wrong else { return Some(()) };
        self.spindle_finding(&format!("the spindle turns {sense} in {name}"), &format!("write {cure}"));
        None
    }

    fn spindle_finding(&mut self, message: &str, cure: &str) {
        let span = self.cycle_span();
        let speed = self.state.rev_per_min;
        self.findings.push_with(code::CYCLE_SPINDLE, |code| {
            Finding::new(code, span, message).with_value("speed", speed, "rev/min").suggest(cure)
        });
    }
}
