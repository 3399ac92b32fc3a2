//! Vibrating sections: where they and their parts start and end, and what is waited for there.

use super::functions::FunctionStep;
use super::{ActivityKind, After, Interpolator, State};
use crate::functions::path_vibration::{SectionBarrier, SectionStart};

impl Interpolator {
    pub(super) fn begin_section_barrier(&mut self, barrier: SectionBarrier) {
        match barrier {
            SectionBarrier::Start(condition) => {
                self.align_then(After::Function(FunctionStep::OpenSection(condition)));
            }
            SectionBarrier::End => {
                // The clamp holds a positive offset at the end point; a negative one would be cut off.
                let wait_s = self.wait_for_zero_s(true);
                self.hold(ActivityKind::VibratingHold, wait_s, After::Function(FunctionStep::SettleSection));
            }
            SectionBarrier::PartStart(part) => {
                self.state.functions.vibration.start_part(part);
                self.state.track.advance(0.0);
            }
            SectionBarrier::PartEnd => {
                let (part_mm, _) = self.state.track.section_place(self.state.track.current_index());
                self.state.functions.vibration.end_part(part_mm);
                if self.state.functions.vibration.is_clamped() {
                    // The offset would jump with the direction unless it is zero here.
                    let wait_s = self.wait_for_zero_s(false);
                    self.hold(ActivityKind::VibratingHold, wait_s, After::LeaveMotion);
                } else {
                    self.state.track.advance(0.0);
                }
            }
        }
    }

    /// Time until a clamped vibration next passes zero, s; with `only_if_negative` 0 while its offset is not negative.
    fn wait_for_zero_s(&self, only_if_negative: bool) -> f64 {
        let State { clock, functions, .. } = &self.state;
        let since_s = |start_period| clock.since_s(start_period, self.settings.period_s);
        functions.vibration.wait_for_zero_s(since_s, only_if_negative)
    }

    pub(super) fn open_section(&mut self, condition: SectionStart) {
        self.state.functions.vibration.open(self.state.clock.period, condition);
        self.state.track.advance(condition.reach_mm());
    }

    /// Rests up to the next grid instant, whose setpoint is the section's exact end point.
    pub(super) fn settle_section(&mut self) {
        let aligned = self.state.clock.aligned().period;
        let line = self.state.rest.line;
        // The command alone is there where the vibration does not arrive.
        let arrives = self.state.functions.vibration.arrives_at_end(self.settings.period_s, aligned);
        let kind = if arrives { ActivityKind::VibratingHold } else { ActivityKind::Hold { line } };
        self.align(kind, After::Function(FunctionStep::CloseSection));
    }

    pub(super) fn close_section(&mut self) {
        self.state.functions.finished_section = self.state.functions.vibration.close();
        self.state.track.advance(0.0);
    }
}
