//! The machining time without thinning and with each method: the same blocks, planned by themselves.

use feedwave_motion::{Planned, Planner};
use feedwave_program::{FindingLog, Operation};

use crate::frame::builder::Builder;
use crate::frame::config::PipelineConfig;
use crate::frame::interpolator::Barrier;

/// A plan that nothing is interpolated from.
#[derive(Clone, Debug)]
struct TimedPlan {
    builder: Builder,
    planner: Planner<Barrier>,
    time_s: f64,
}

impl TimedPlan {
    fn operation(&mut self, operation: &Operation, config: &PipelineConfig) {
        // Findings are made in the plan that is run.
        let mut findings = FindingLog::with_limit(0);
        self.builder.operation(operation, config, &mut self.planner, &mut findings);
        self.drain();
    }

    fn drain(&mut self) {
        while let Some(item) = self.planner.pop() {
            self.time_s += match &item {
                Planned::Motion(motion) => motion.stretches.iter().map(|stretch| stretch.profile.duration()).sum(),
                Planned::Barrier(Barrier::Dwell { duration_s, .. }) => *duration_s,
                Planned::Barrier(_) => 0.0,
            };
        }
    }

    fn finish(&mut self, config: &PipelineConfig) -> f64 {
        self.builder.flush(config, &mut self.planner, &mut FindingLog::with_limit(0));
        self.planner.finish();
        self.drain();
        self.time_s
    }
}

/// All plans, while thinning is on; gathered while validating only.
#[derive(Clone, Debug, Default)]
pub(crate) struct TimedPlans {
    running: Option<Box<[TimedPlan; 3]>>,
    /// Times so far: as programmed, thinned, and thinned by the other method, s.
    pub(crate) times_s: [f64; 3],
}

impl TimedPlans {
    /// Thinning is switched on: the plans begin at rest where the builder is.
    pub(crate) fn start(&mut self, builder: &Builder, config: &PipelineConfig) {
        let settings = config.profile.planner_settings(config.period_s());
        let plan = TimedPlan { builder: builder.beside(), planner: Planner::new(settings), time_s: 0.0 };
        self.running = Some(Box::new([plan.clone(), plan.clone(), plan]));
    }

    /// An operation as programmed.
    pub(crate) fn before(&mut self, operation: &Operation, config: &PipelineConfig) {
        if let Some(plans) = &mut self.running {
            plans[0].operation(operation, config);
        }
    }

    /// An operation that thinning has left.
    pub(crate) fn after(&mut self, operation: &Operation, config: &PipelineConfig) {
        if let Some(plans) = &mut self.running {
            plans[1].operation(operation, config);
        }
    }

    /// An operation that the other method has left.
    pub(crate) fn after_other(&mut self, operation: &Operation, config: &PipelineConfig) {
        if let Some(plans) = &mut self.running {
            plans[2].operation(operation, config);
        }
    }

    pub(crate) fn are_running(&self) -> bool {
        self.running.is_some()
    }

    /// Thinning is switched off, or the program ends.
    pub(crate) fn stop(&mut self, config: &PipelineConfig) {
        if let Some(mut plans) = self.running.take() {
            for (time_s, plan) in self.times_s.iter_mut().zip(plans.iter_mut()) {
                *time_s += plan.finish(config);
            }
        }
    }
}
