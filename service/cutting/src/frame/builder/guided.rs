//! Moves under tool centre point control.

use feedwave_motion::Planner;
use feedwave_program::{FindingLog, GuidedMove, MoveKind, PathControl, SourceSpan};

use super::{Builder, X, joining};
use crate::frame::config::PipelineConfig;
use crate::frame::interpolator::Barrier;
use crate::functions::five_axis::{Guided, no_kinematics};
use crate::shared::cut::Cut;

impl Builder {
    /// What becomes of a move of a guided tool, which the guide then has made; nothing after a finding.
    pub(super) fn follow(
        &mut self,
        guided: &GuidedMove,
        span: SourceSpan,
        config: &PipelineConfig,
        findings: &mut FindingLog,
    ) -> Option<Guided> {
        let Some(guide) = &self.guide else {
            self.refuse_guided(guided, span, findings);
            return None;
        };
        let chosen = self.chosen.take();
        guide.carry_out(guided, span, chosen, &mut self.state.guide, &config.guide_inputs(), findings)
    }

    /// Reports a guided tool on a machine without kinematics, once.
    pub(super) fn refuse_guided(&mut self, guided: &GuidedMove, span: SourceSpan, findings: &mut FindingLog) {
        if self.state.guide.is_first_refusal(guided.length_offset) {
            findings.push(no_kinematics(span));
        }
    }

    /// A move of a guided tool.
    pub(super) fn guided(
        &mut self,
        guided: &GuidedMove,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        let motion = match self.follow(guided, span, config, findings) {
            Some(Guided::Axes(mv)) => return self.motion(&mv, span, config, planner, findings),
            Some(Guided::Elements(motion)) => motion,
            None => return,
        };
        let mv = &guided.step;
        let cutting = mv.kind == MoveKind::Cutting;
        if cutting && !motion.elements.is_empty() {
            self.open_section(mv, config, planner);
            let least_radius_mm =
                motion.elements.iter().map(|element| element.radius_range_mm()[0]).fold(f64::INFINITY, f64::min);
            self.check_speed((&mv.spindle, least_radius_mm), mv.tool, span, config, findings);
            self.check_override(config, findings);
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
        if let Some(last) = motion.elements.last() {
            self.state.x_mm = [last.end[X], last.work_offset[X]];
        }
        let joining = joining(&self.state.functions, self.guide.as_ref(), config);
        let mut elements = motion.elements.into_iter().peekable();
        while let Some(element) = elements.next() {
            config.travel().check(&element, findings);
            let cut = Cut::of(mv, &element);
            // Along a spline the block stops at its own end only.
            let stops_within = elements.peek().is_some() && mv.spline.is_some();
            let is_inner = stops_within && mv.path_control == PathControl::ExactStop;
            let control = if is_inner { PathControl::ExactPath } else { mv.path_control };
            let smoothed = &mut self.smoothed;
            let mut take = |element| smoothed.push(element);
            self.state.smoother.push(element, control, cut, joining, &mut take);
        }
        self.run_smoothed(config, planner, findings);
    }
}
