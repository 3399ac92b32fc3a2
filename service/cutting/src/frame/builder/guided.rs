//! Moves under tool centre point control.

use feedwave_motion::Planner;
use feedwave_program::{FindingLog, GuidedMove, MoveKind, SourceSpan};

use super::Builder;
use crate::frame::interpolator::Barrier;
use crate::frame::pipeline::PipelineConfig;
use crate::functions::five_axis::{Guided, no_kinematics};
use crate::shared::checks::check_travel;
use crate::shared::cut::Cut;

impl Builder {
    /// A move of a guided tool.
    pub(super) fn guided(
        &mut self,
        guided: &GuidedMove,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        let Some(guide) = self.guide.clone() else {
            if self.state.guide.is_first_refusal(guided.length_offset) {
                findings.push(no_kinematics(span));
            }
            return;
        };
        let chosen = self.chosen.take();
        let motion =
            match guide.carry_out(guided, span, chosen, &mut self.state.guide, &config.guide_inputs(), findings) {
                Some(Guided::Axes(mv)) => return self.motion(&mv, span, config, planner, findings),
                Some(Guided::Elements(motion)) => motion,
                None => return,
            };
        let mv = &guided.step;
        let cutting = mv.kind == MoveKind::Cutting;
        if cutting && !motion.elements.is_empty() {
            self.open_section(config, planner);
            self.check_speed(&mv.spindle, mv.tool, span, config, findings);
        } else {
            self.close_section(planner, findings);
        }
        if cutting && !self.can_act_on_guided(&motion, span, config, findings) {
            return;
        }
        if let Some(analysis) = &mut self.analysis {
            analysis.moves += 1;
            analysis.cutting_moves += u64::from(cutting);
        }
        let corners = guide.corners(&config.guide_inputs());
        let joining = self.joining(config);
        for element in motion.elements {
            check_travel(&element, &config.profile.machine, findings);
            let cut = Cut::of(mv, &element);
            let (control, smoothed) = (mv.path_control, &mut self.smoothed);
            let mut take = |element| smoothed.push(element);
            self.state.smoother.push_guided(element, control, cut, joining, corners, &mut take);
        }
        self.run_smoothed(config, planner, findings);
    }
}
