//! Judging a whole program: one observed run of the pipeline.

use std::sync::Arc;

use feedwave_program::{Place, Reading, Severity};

use crate::frame::builder::Analysis;
use crate::frame::config::PipelineConfig;
use crate::frame::pipeline::{Pipeline, Step};
use crate::frame::report::{AxisSummary, LimitTimes, PeakPlace, ProgramSummary, ValidationReport};
use crate::functions::thinning::report_findings;
use crate::shared::setpoint::{Frame, SetpointBlock};

/// Lines read per step once setpoints have stopped at an error.
const LINES_PER_STEP: usize = 4_096;

/// A pipeline that also judges the program: runs it to the end and reports.
#[derive(Clone, Debug)]
pub struct Validation {
    pipeline: Pipeline,
    block: SetpointBlock,
    axes: Vec<AxisTrace>,
    /// Whether setpoints have stopped, at the end of the program or at an error.
    stopped: bool,
    ended: bool,
    setpoint_count: u64,
}

/// Running extremes of one axis.
#[derive(Clone, Debug)]
struct AxisTrace {
    name: String,
    rotary: bool,
    min: f64,
    max: f64,
    /// Peaks of the first, second and third derivative.
    peaks: [Peak; 3],
    /// The last three positions, older first.
    last: [f64; 3],
    seen: u64,
}

/// A running maximum, and where it was reached first.
#[derive(Clone, Copy, Debug, Default)]
struct Peak {
    value: f64,
    /// Value at the place.
    placed_value: f64,
    place: Option<PeakPlace>,
}

/// A value that exceeds the peak by less than this share is the same but for rounding: the place stays the first one.
const SAME_PEAK: f64 = 1e-6;

impl Validation {
    /// A validation at the start of a program. Extents and peaks are in machine coordinates whatever the
    /// configured frame.
    #[must_use]
    pub fn new(config: Arc<PipelineConfig>) -> Self {
        let config = match config.frame {
            Frame::Machine => config,
            Frame::Work => Arc::new(PipelineConfig { frame: Frame::Machine, ..(*config).clone() }),
        };
        let trace = |axis: &feedwave_motion::MachineAxis| AxisTrace {
            name: axis.name.clone(),
            rotary: axis.axis.is_rotary(),
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
            peaks: [Peak::default(); 3],
            last: [0.0; 3],
            seen: 0,
        };
        let axes = config.profile.machine.axes.iter().map(trace).collect();
        let pipeline = Pipeline::with_analysis(config, Some(Analysis::default()));
        let block = pipeline.new_block();
        Self { pipeline, block, axes, stopped: false, ended: false, setpoint_count: 0 }
    }

    /// See [`Pipeline::push`].
    pub fn push(&mut self, bytes: &[u8]) {
        self.pipeline.push(bytes);
    }

    /// See [`Pipeline::finish_input`].
    pub fn finish_input(&mut self) {
        self.pipeline.finish_input();
    }

    /// See [`Pipeline::supply`].
    pub fn supply(&mut self, place: Place, program: &[u8]) {
        self.pipeline.supply(place, program);
    }

    /// Advances by at most one block of setpoints or a few thousand lines. Setpoints stop at the first error
    /// (the block is then empty); the rest of the program is still read for findings. [`Step::Refused`] never
    /// comes: a refused program ends with [`Step::Finished`] and a report that says why.
    pub fn step(&mut self) -> Step {
        if self.ended {
            return Step::Finished;
        }
        if self.stopped {
            return self.read_on();
        }
        match self.pipeline.next_block(&mut self.block) {
            Step::Block => {
                self.setpoint_count += self.block.len() as u64;
                let period_s = self.pipeline.config().period_s();
                for (trace, column) in self.axes.iter_mut().zip(&self.block.axes) {
                    trace.add(column, &self.block.line, period_s);
                }
                Step::Block
            }
            Step::NeedInput(place) => Step::NeedInput(place),
            Step::Finished => {
                // What follows the end of the program is still examined.
                self.stopped = true;
                self.read_on()
            }
            Step::Refused => {
                self.stopped = true;
                self.block = self.pipeline.new_block();
                if let Some(analysis) = &mut self.pipeline.builder.analysis {
                    analysis.functions.vibration.finish_waiting(&mut self.pipeline.findings);
                }
                Step::Block
            }
        }
    }

    fn read_on(&mut self) -> Step {
        for _ in 0..LINES_PER_STEP {
            let reading = self.pipeline.read_line();
            self.pipeline.discard_planned();
            if let Some(analysis) = &mut self.pipeline.builder.analysis {
                analysis.functions.vibration.finish_waiting(&mut self.pipeline.findings);
            }
            match reading {
                Reading::More => {}
                Reading::NeedInput => return Step::NeedInput(self.pipeline.wanted()),
                Reading::Ended => {
                    self.ended = true;
                    return Step::Finished;
                }
            }
        }
        Step::Block
    }

    /// The pipeline, to take snapshots of while validating.
    #[must_use]
    pub fn pipeline(&self) -> &Pipeline {
        &self.pipeline
    }

    /// The block that the last [`Step::Block`] filled.
    #[must_use]
    pub fn block(&self) -> &SetpointBlock {
        &self.block
    }

    /// The report; call after [`Step::Finished`].
    #[must_use]
    pub fn finish(self) -> ValidationReport {
        let Self { mut pipeline, axes, setpoint_count, .. } = self;
        let config = Arc::clone(&pipeline.config);
        if let Some(report) = pipeline.thinning.report() {
            report_findings(&report, &config.profile.thinning, &mut pipeline.findings);
        }
        let thinning = pipeline.thinning_report();
        if let Some(analysis) = &mut pipeline.builder.analysis {
            analysis.functions.vibration.settle_cures(&mut pipeline.findings);
            analysis.functions.threads.settle_cures(&mut pipeline.findings);
        }
        let findings = std::mem::take(&mut pipeline.findings);
        let analysis = pipeline.builder.analysis.take().unwrap_or_default();
        let refused = findings.has_errors();
        let shares = pipeline.interpolator.shares();
        let if_accepted = |value: f64| if refused { 0.0 } else { value };
        let examination = pipeline.interpolator.examination.take().filter(|_| !refused);
        let machine_axes = &config.profile.machine.axes;
        let (slowdown_time_s, slowdowns) =
            examination.as_ref().map_or_else(Default::default, |examination| examination.slowdowns.worst(machine_axes));
        let summary = ProgramSummary {
            errors: findings.count(Severity::Error),
            warnings: findings.count(Severity::Warning),
            infos: findings.count(Severity::Info),
            findings_not_listed: findings.dropped(),
            bytes: pipeline.place().offset,
            lines: u64::from(pipeline.interpreter_state().lines_read()),
            moves: analysis.moves,
            cutting_moves: analysis.cutting_moves,
            interpolation_period_us: pipeline.config().interpolation_period_us,
            plan_quality: config.profile.plan_quality,
            setpoint_count: if refused { 0 } else { setpoint_count },
            duration_s: if_accepted(pipeline.interpolator.elapsed_s()),
            cutting_time_s: if_accepted(shares.cutting_s),
            rapid_time_s: if_accepted(shares.rapid_s),
            rest_time_s: if_accepted(shares.limits.rest_s),
            limit_times: if refused { LimitTimes::default() } else { shares.limits },
            axis_limit_times: examination.map_or_else(Vec::new, |examination| examination.axis_times),
            path_deviation: analysis.deviation.filter(|_| !refused),
            slowdown_time_s,
            slowdowns,
            path_length_mm: analysis.path_length_mm,
            cutting_length_mm: analysis.cutting_length_mm,
            tools: analysis.tools.into_iter().collect(),
            axes: if refused { Vec::new() } else { axes.into_iter().map(AxisTrace::finish).collect() },
            spindle_rev_per_min: analysis.spindle_rev_per_min,
            ..ProgramSummary::default()
        };
        let mut findings = findings.into_sorted();
        findings.iter_mut().for_each(|finding| pipeline.interpreter_state().name_calls(finding));
        let mut report = ValidationReport {
            findings,
            programs: config.programs.clone(),
            thinning,
            summary,
            offsets: config.profile.language.initial_offsets(),
            ..ValidationReport::default()
        };
        pipeline.builder.report_functions(analysis.functions, &mut report);
        report
    }
}

impl AxisTrace {
    fn add(&mut self, column: &[f64], lines: &[u32], period_s: f64) {
        for (&position, &line) in column.iter().zip(lines) {
            self.min = self.min.min(position);
            self.max = self.max.max(position);
            let [oldest, older, last] = self.last;
            let differences =
                [position - last, position - 2.0 * last + older, position - 3.0 * (last - older) - oldest];
            let mut scale = 1.0;
            for (order, (peak, difference)) in (1..).zip(self.peaks.iter_mut().zip(differences)) {
                scale *= period_s;
                if self.seen >= order {
                    peak.reach(difference.abs() / scale, self.seen, line, period_s);
                }
            }
            self.last = [older, last, position];
            self.seen += 1;
        }
    }

    fn finish(self) -> AxisSummary {
        let [velocity, acceleration, jerk] = self.peaks;
        AxisSummary {
            axis: self.name,
            rotary: self.rotary,
            min: self.min,
            max: self.max,
            peak_velocity_per_s: velocity.value,
            peak_acceleration_per_s2: acceleration.value,
            peak_jerk_per_s3: jerk.value,
            peak_velocity_at: velocity.place,
            peak_acceleration_at: acceleration.place,
            peak_jerk_at: jerk.place,
        }
    }
}

impl Peak {
    fn reach(&mut self, value: f64, setpoint_index: u64, line: u32, period_s: f64) {
        if value <= self.value {
            return;
        }
        self.value = value;
        if value > self.placed_value * (1.0 + SAME_PEAK) {
            self.placed_value = value;
            self.place = Some(PeakPlace { setpoint_index, time_s: setpoint_index as f64 * period_s, line });
        }
    }
}
