//! From a window that is over to a decision and the state that follows.

use super::{Monitor, State};
use crate::decision::{Action, Decision, Evidence, HoldReason, Inputs, Properties, Span, decide, windows_at_bound};
use crate::spectrum::{self, LineOrigin, SpectralLine};

impl Monitor {
    /// A window is over: judges it, decides, and goes on.
    pub(super) fn finish(&mut self, time_ns: u64, sink: &mut dyn FnMut(Decision)) {
        let span = self.run.window.span;
        let other_tool = self.run.state != State::Baseline && self.run.tool != self.run.baseline_tool;
        let unfit = if other_tool { Some(HoldReason::OtherTool) } else { self.run.window.unfit(&self.config) };
        let evidence = unfit.map_or_else(|| self.evidence(), Evidence::Unfit);
        let action = self.decide(time_ns, span, evidence, sink);
        if action == Action::Stop {
            return;
        }
        if unfit.is_some() {
            self.restart_window();
            return;
        }
        match self.run.state {
            State::Baseline => {
                self.run.window.points.write_means(&mut self.run.baseline);
                self.run.baseline_tool = self.run.tool;
                let run_up = self.config.idle_run_up.is_some();
                self.enter(if run_up { State::IdleRunUp { step: 0 } } else { State::WaitingForContact });
            }
            State::IdleRunUp { step } => {
                let steps = self.config.idle_run_up.as_ref().map_or(0, |idle| idle.spindle_rev_per_min.len());
                let last = step as usize + 1 >= steps;
                self.enter(if last { State::WaitingForContact } else { State::IdleRunUp { step: step + 1 } });
            }
            _ => self.restart_window(),
        }
    }

    /// What a valid window says.
    fn evidence(&mut self) -> Evidence {
        let summary = self.run.window.points.summary(&self.run.baseline);
        match self.run.state {
            State::Baseline => {
                let check = self.config.tool_check;
                Evidence::ToolCheck {
                    least: summary.least,
                    most: summary.most,
                    max_ratio: check.max_ratio,
                    max_run_out: check.max_run_out,
                }
            }
            State::IdleRunUp { step } => {
                let (spindle_rev_per_min, max_difference) = self
                    .config
                    .idle_run_up
                    .as_ref()
                    .map_or((0.0, 0.0), |idle| (idle.spindle_rev_per_min[step as usize], idle.max_difference));
                Evidence::IdleCheck { spindle_rev_per_min, difference: summary.max_difference, max_difference }
            }
            _ => Evidence::Process(Properties {
                max_deviation: summary.max_deviation,
                mean_angle: summary.mean_angle(),
                line: self.line(),
            }),
        }
    }

    /// Dominant spectral line of the window.
    fn line(&mut self) -> Option<SpectralLine> {
        let current_rev_per_min = self.current_rev_per_min();
        let (config, analyser) = (self.config.spectrum.as_ref()?, self.analyser.as_mut()?);
        let record = self.run.window.record.as_ref()?;
        let (frequency_hz, amplitude) = analyser.line(record, config, self.config.sample_rate_hz)?;
        let origin: LineOrigin = spectrum::origin(frequency_hz, amplitude, current_rev_per_min, config);
        Some(SpectralLine { frequency_hz, amplitude, origin })
    }

    /// Spindle speed of the window, rev/min.
    fn current_rev_per_min(&self) -> Option<f64> {
        let programmed = self.run.programmed_rev_per_min.map(|rev_per_min| rev_per_min * self.run.overrides.spindle);
        self.run.window.spindle_rev_per_min().or(programmed)
    }

    /// Makes one record and carries it out.
    pub(super) fn decide(
        &mut self,
        time_ns: u64,
        span: Span,
        evidence: Evidence,
        sink: &mut dyn FnMut(Decision),
    ) -> Action {
        // A window that a thread reached into is no evidence of the cut after it; a silence is about the present.
        let threading = self.run.threading || (self.run.threaded && matches!(evidence, Evidence::Process(_)));
        let inputs = Inputs {
            evidence,
            rules: self.config.rules.clone(),
            before: self.run.overrides,
            programmed_rev_per_min: self.run.programmed_rev_per_min,
            current_rev_per_min: self.current_rev_per_min(),
            threading,
            windows_at_bound: self.run.windows_at_bound,
            held: self.run.held_feed.is_some(),
            spindle: self.run.spindle,
        };
        let outcome = decide(&inputs);
        self.run.windows_at_bound = windows_at_bound(&inputs);
        let number = self.run.decisions;
        self.run.decisions += 1;
        self.run.overrides = outcome.after;
        self.request_spindle(number, inputs.before, evidence, &outcome);
        match outcome.action {
            Action::Stop => self.run.state = State::Stopped,
            Action::HoldFeed => self.run.held_feed = Some(inputs.before.feed),
            Action::Keep | Action::Change | Action::Hold => {}
        }
        sink(Decision { number, time_ns, tool: self.run.tool, span, inputs, outcome, note: String::new() });
        outcome.action
    }
}
