//! Threading blocks: passes wait for the block behind them, and rapids for the pass that may follow.

use feedwave_motion::{Element, Planner};
use feedwave_program::{
    Axis, AxisSet, Finding, FindingLog, GuidedMove, Move, SourceSpan, ThreadKind, ThreadMove, ThreadPlane, ToolGuide,
};

use super::{Builder, X};
use crate::code;
use crate::frame::config::PipelineConfig;
use crate::frame::interpolator::Barrier;
use crate::functions::five_axis::Guided;
use crate::functions::thread::{KeptPass, Pass, WaitingPass, straight};
use crate::shared::plane_frame::PlaneFrame;

impl Builder {
    /// Whether a rapid waits for a thread that may follow.
    pub(super) fn holds_rapid(&mut self, mv: &Move, span: SourceSpan, config: &PipelineConfig) -> bool {
        self.state.functions.threads.holds_rapid(mv, span, &config.profile.thread_vibration)
    }

    /// A threading block.
    pub(super) fn thread(
        &mut self,
        mv: &ThreadMove,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        if mv.kind == ThreadKind::Tapped {
            self.flush_threads(config, planner, findings);
            return self.tap(mv, span, config, planner, findings);
        }
        if self.state.functions.threads.ends_pass(mv) {
            self.flush_threads(config, planner, findings);
        }
        let frame = match &mv.plane {
            None => None,
            Some(plane) => match self.thread_in_plane(mv, plane, span, config, findings) {
                Some(frame) => Some(Box::new(frame)),
                None => return,
            },
        };
        self.state.functions.threads.add_block(mv, frame, span, findings);
    }

    /// Leads the tool along a block of a thread in a tilted plane; nothing after a finding.
    fn thread_in_plane(
        &mut self,
        mv: &ThreadMove,
        plane: &ThreadPlane,
        span: SourceSpan,
        config: &PipelineConfig,
        findings: &mut FindingLog,
    ) -> Option<PlaneFrame> {
        let guided = in_plane(mv, plane);
        let Some(guide) = &self.guide else {
            self.refuse_guided(&guided, span, findings);
            return None;
        };
        let ends = [&mv.start, &mv.end].map(|place| [Axis::X, Axis::Z].map(|axis| place[axis.index()]));
        guide.thread_in_plane(&guided, ends, span, &mut self.state.guide, &config.guide_inputs(), findings)
    }

    /// A stroke of a rigid tap.
    fn tap(
        &mut self,
        stroke: &ThreadMove,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        self.close_thread(config, findings);
        self.check_speed((&stroke.spindle, stroke.start[X]), stroke.tool, span, config, findings);
        if self.state.functions.vibration.is_on() {
            vibrates_no_thread(span, findings);
        }
        let Some(element) = self.tap_element(stroke, span, config, findings) else { return };
        let Some(run) = self.state.functions.threads.tap(stroke, element, config.travel(), findings) else { return };
        self.state.x_mm = [run.element.end[X], run.element.work_offset[X]];
        if let Some(analysis) = &mut self.analysis {
            analysis.moves += 1;
            analysis.cutting_moves += 1;
            analysis.path_length_mm += run.element.length;
            analysis.cutting_length_mm += run.element.length;
            analysis.turns_at(60.0 * run.peak_rev_per_s());
        }
        planner.push_barrier(Barrier::from(run));
    }

    /// The path of a stroke; nothing where it leads nowhere, or after a finding. In a tilted plane the axes that follow the tool
    /// centre point go straight, as the rotary ones rest.
    fn tap_element(
        &mut self,
        stroke: &ThreadMove,
        span: SourceSpan,
        config: &PipelineConfig,
        findings: &mut FindingLog,
    ) -> Option<Element> {
        let Some(plane) = &stroke.plane else {
            let step = straight(stroke);
            if self.guide.is_some() {
                self.state.guide.moved(&step);
            }
            return Element::from_move(&step, span);
        };
        match self.follow(&in_plane(stroke, plane), span, config, findings)? {
            Guided::Elements(motion) => motion.elements.into_iter().next(),
            Guided::Axes(_) => None,
        }
    }

    /// Plans what waits: a rapid, or a pass that is complete now.
    pub(super) fn flush_threads(
        &mut self,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        let waiting = self.state.functions.threads.take_waiting();
        let pass = self.thread_pass(&waiting, config, findings);
        let WaitingPass { rapid, blocks } = waiting;
        let mut combines = false;
        if let Some((mut mv, span)) = rapid {
            if let (Some(pass), Some(first)) = (&pass, blocks.first()) {
                combines = pass.combine(&mut mv, first);
            }
            self.motion(&mv, span, config, planner, findings);
        }
        let (Some(pass), Some(last)) = (pass, blocks.last()) else { return };
        let analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.threads);
        let inputs = config.thread_inputs();
        let threads = &self.state.functions.threads;
        let Some(run) = threads.run(&pass, &blocks, !combines, &inputs, analysis, findings) else { return };
        self.state.x_mm = [run.end[X], run.work_offset[X]];
        if self.guide.is_some() && last.frame.is_none() {
            self.state.guide.moved(&Move { end: last.end(), ..straight(&last.mv) });
        }
        let (thread, passes) = threads.next_pass();
        if let Some(wanted) =
            self.wanted_pass.as_mut().filter(|wanted| wanted.place == (thread, passes.wrapping_sub(1)))
        {
            wanted.pass.get_or_insert_with(|| KeptPass { path: run.path.clone(), in_plane: run.frame.is_some() });
        }
        if let Some(analysis) = &mut self.analysis {
            analysis.moves += blocks.len() as u64;
            analysis.cutting_moves += blocks.len() as u64;
            analysis.path_length_mm += run.path.length_mm();
            analysis.cutting_length_mm += run.path.length_mm();
            analysis.turns_at(60.0 * pass.rev_per_s());
        }
        planner.push_barrier(Barrier::from(run));
    }

    /// The pass that waiting blocks are; nothing where there are none, or after a finding.
    fn thread_pass(
        &mut self,
        waiting: &WaitingPass,
        config: &PipelineConfig,
        findings: &mut FindingLog,
    ) -> Option<Pass> {
        let first = waiting.blocks.first()?;
        let path = Pass::path(&waiting.blocks, &config.profile.machine, findings)?;
        self.check_speed((&first.mv.spindle, first.mv.start[X]), first.mv.tool, first.span, config, findings);
        if self.state.functions.vibration.is_on() {
            vibrates_no_thread(first.span, findings);
        }
        let analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.threads);
        self.state.functions.threads.pass(first, path, &config.thread_inputs(), analysis, findings)
    }
}

/// A block of a thread or a tap in a tilted plane as a cut.
fn in_plane(mv: &ThreadMove, plane: &ThreadPlane) -> GuidedMove {
    GuidedMove {
        step: straight(mv),
        guide: ToolGuide::Plane,
        // The program says where the linear axes are; the rotary ones stay where G53.1 has turned them, which only the machine
        // knows.
        held: AxisSet::ROTARY,
        turned: AxisSet::NONE,
        length_offset: plane.length_offset,
        tool_length_mm: Some(plane.tool_length_mm),
        plane: Some(plane.plane),
        is_pure_cut: false,
    }
}

fn vibrates_no_thread(span: SourceSpan, findings: &mut FindingLog) {
    let message = "vibration along the path does not act on a thread, but is on";
    let finding = Finding::new(code::VIB_THREAD, span, message);
    findings.push(finding.suggest("switch it off before the thread; threads have a vibration of their own"));
}
