//! From bytes to the builder: lines, thinning, and looking ahead where the builder has to know what follows.

use feedwave_program::{Function, Operation, OperationKind, Reading};

use super::Pipeline;
use crate::frame::scout::Scout;
use crate::functions::thinning::{MethodFigures, ProgramThinning, ThinningMethod};

impl Pipeline {
    /// Reads one line into the planner.
    pub(crate) fn read_line(&mut self) -> Reading {
        if !self.waiting.is_empty() {
            return self.hand_on();
        }
        let reading = self.reader.read_line(&mut self.pages, &mut self.operations, &mut self.findings);
        if self.operations.is_empty() {
            return reading;
        }
        let mut operations = std::mem::take(&mut self.operations);
        for operation in operations.drain(..) {
            self.operation(operation);
        }
        self.operations = operations;
        if self.waiting.is_empty() { Reading::More } else { self.hand_on() }
    }

    #[inline]
    fn operation(&mut self, operation: Operation) {
        let is_switch = |command: &feedwave_program::FunctionCommand| command.function == Function::Thinning;
        if self.thinning.is_on() || matches!(&operation.kind, OperationKind::Function(command) if is_switch(command)) {
            return self.thin(operation);
        }
        let waits = !self.waiting.is_empty() || self.config.spindle_changes.is_some();
        if waits || matches!(operation.kind, OperationKind::Guided(_)) {
            return self.waiting.push_back(operation);
        }
        self.builder.operation(&operation, &self.config, &mut self.planner, &mut self.findings);
    }

    /// Passes an operation through the thinning stage.
    fn thin(&mut self, operation: Operation) {
        let Self { config, thinning, compared, waiting, timed, .. } = self;
        let ends = operation.kind == OperationKind::End;
        if let Some(timed) = timed {
            timed.before(&operation, config);
            if let Some(compared) = compared {
                compared.operation(operation.clone(), &mut |operation| timed.after_other(&operation, config));
            }
        }
        thinning.operation(operation, &mut |operation| {
            if let Some(timed) = timed {
                timed.after(&operation, config);
            }
            waiting.push_back(operation);
        });
        if let (Some(timed), true) = (timed, ends || !thinning.is_on()) {
            timed.stop(config);
        }
    }

    /// Hands on what waits for the builder, for which it may have to look ahead.
    fn hand_on(&mut self) -> Reading {
        while let Some(operation) = self.waiting.front() {
            if self.stops_before(operation) {
                self.rest_between();
                return Reading::More;
            }
            if self.scout.is_none()
                && let Some(ahead) = self.builder.ahead(operation, &self.config)
            {
                let scout = Scout::new(ahead, &self.reader, &self.thinning, self.waiting.iter().skip(1));
                self.scout = Some(Box::new(scout));
            }
            if let Some(scout) = &mut self.scout {
                let Some(chosen) = scout.look(&mut self.pages) else {
                    return Reading::NeedInput;
                };
                self.builder.chosen = Some(chosen);
                self.scout = None;
            }
            if let Some(mut operation) = self.waiting.pop_front() {
                self.spindle.pass(&mut operation, self.config.spindle_changes.is_some());
                self.builder.operation(&operation, &self.config, &mut self.planner, &mut self.findings);
            }
        }
        if let Some(timed) = self.timed.as_mut().filter(|timed| self.thinning.is_on() && !timed.are_running()) {
            timed.start(&self.builder, &self.config);
        }
        Reading::More
    }

    /// What thinning did, where it was switched on.
    pub(crate) fn thinning_report(&mut self) -> Option<ProgramThinning> {
        let figures = self.thinning.report()?;
        let dropped = self.thinning.dropped.take().unwrap_or_default();
        let [time_before_s, time_after_s, time_other_s] = self.timed.as_ref().map_or([0.0; 3], |timed| timed.times_s);
        let method = self.thinning.method();
        let own = MethodFigures { method, figures, time_s: time_after_s };
        let other = self.compared.as_ref().and_then(|compared| {
            compared.report().map(|figures| MethodFigures { method: compared.method(), figures, time_s: time_other_s })
        });
        let mut methods = vec![own];
        methods.extend(other);
        methods.sort_by_key(|of| ThinningMethod::ALL.iter().position(|method| *method == of.method));
        Some(ProgramThinning {
            method,
            figures,
            methods,
            rotary_axes: self.thinning.rotary_letters(),
            dropped: dropped.runs,
            dropped_not_listed: dropped.not_listed,
            time_before_s,
            time_after_s,
            deviations: self.thinning.deviations(),
        })
    }
}
