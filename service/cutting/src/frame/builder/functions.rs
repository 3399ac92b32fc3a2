//! The machining functions in the builder: where they are switched, closed and ended, and the passes of threads.
//!
//! This is the place, with [`Functions`] and [`FunctionAnalysis`], to which a function is added.

use feedwave_motion::Planner;
use feedwave_program::{Axis, Finding, FindingLog, Function, FunctionCommand, SourceSpan, ThreadMove};
use serde::{Deserialize, Serialize};

use super::Builder;
use crate::code;
use crate::frame::interpolator::Barrier;
use crate::frame::pipeline::PipelineConfig;
use crate::functions::path_vibration::{Vibration, VibrationAnalysis};
use crate::functions::thread::{Pass, ThreadAnalysis, Threads, WaitingPass};
use crate::functions::tool_oscillation::{Oscillation, OscillationAnalysis};

/// What every function remembers between operations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Functions {
    pub(super) vibration: Vibration,
    pub(super) oscillation: Oscillation,
    pub(super) threads: Threads,
}

/// What every function finds out about a program, gathered while validating only.
#[derive(Clone, Debug, Default)]
pub(crate) struct FunctionAnalysis {
    pub(crate) vibration: VibrationAnalysis,
    pub(crate) oscillation: OscillationAnalysis,
    pub(crate) threads: ThreadAnalysis,
}

impl Builder {
    /// Carries out a block that switches a function. What is open of it ends here.
    pub(super) fn switch(
        &mut self,
        command: &FunctionCommand,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        match command.function {
            Function::PathVibration => {
                if !command.on || self.state.functions.vibration.is_on() {
                    self.close_section(planner, findings);
                }
                self.state.functions.vibration.turn(command, span, &config.profile.vibration, findings);
            }
            Function::ToolOscillation => {
                self.close_oscillation(planner, findings);
                self.state.functions.oscillation.turn(command, span, &config.oscillation, findings);
            }
            Function::ThreadVibration => {
                self.close_thread(config, findings);
                self.state.functions.threads.turn(command, span, findings);
            }
            // A stage before the builder.
            Function::Thinning => {}
        }
    }

    /// The program ends: what is open of every function is closed, and what is still on is found.
    pub(super) fn end_functions(
        &mut self,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        self.close_section(planner, findings);
        self.close_thread(config, findings);
        let Functions { vibration, oscillation, threads } = &mut self.state.functions;
        threads.end(findings);
        vibration.end(findings);
        oscillation.end(findings);
    }

    /// Opens a vibrating section at the first cutting block after the vibration was switched on or interrupted.
    pub(super) fn open_section(&mut self, config: &PipelineConfig, planner: &mut Planner<Barrier>) {
        let analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.vibration);
        self.state.functions.vibration.open_section(&config.vibration_inputs(), analysis, planner);
    }

    /// Closes the sections of all functions that follow the path: it is interrupted here.
    pub(super) fn close_section(&mut self, planner: &mut Planner<Barrier>, findings: &mut FindingLog) {
        self.close_oscillation(planner, findings);
        let analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.vibration);
        self.state.functions.vibration.close_section(analysis, planner);
    }

    /// Closes the oscillating section: the path rests here.
    pub(super) fn close_oscillation(&mut self, planner: &mut Planner<Barrier>, findings: &mut FindingLog) {
        self.state.functions.oscillation.close_section(planner, findings);
    }

    fn close_thread(&mut self, config: &PipelineConfig, findings: &mut FindingLog) {
        let analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.threads);
        self.state.functions.threads.close(&config.thread_inputs(), analysis, findings);
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
        if self.state.functions.threads.ends_pass(mv) {
            self.flush_threads(config, planner, findings);
        }
        self.state.functions.threads.add_block(mv, span, findings);
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
        self.state.radius_mm = last.end()[Axis::X.index()];
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
        self.check_speed(&first.mv.spindle, first.mv.tool, first.span, config, findings);
        if self.state.functions.vibration.is_on() {
            let message = "vibration along the path does not act on a thread, but is on";
            let finding = Finding::new(code::VIB_THREAD, first.span, message);
            findings.push(finding.suggest("switch it off before the thread; threads have a vibration of their own"));
        }
        let analysis = self.analysis.as_mut().map(|analysis| &mut analysis.functions.threads);
        self.state.functions.threads.pass(first, path, &config.thread_inputs(), analysis, findings)
    }
}
