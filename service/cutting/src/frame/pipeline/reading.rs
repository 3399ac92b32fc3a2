//! From bytes to the builder: lines, thinning, and looking ahead where the builder has to know what follows.

use feedwave_program::{Function, LineOutcome, Operation, OperationKind};

use super::Pipeline;
use crate::frame::scout::Scout;
use crate::functions::thinning::ProgramThinning;

impl Pipeline {
    /// Reads one line into the planner; `false` when more input is needed first.
    pub(crate) fn read_line(&mut self) -> bool {
        if !self.waiting.is_empty() {
            return self.hand_on();
        }
        let unread = &self.input[self.consumed..];
        let outcome = self.interpreter.read_line(unread, self.input_finished, &mut self.operations, &mut self.findings);
        let more = match outcome {
            LineOutcome::Consumed(bytes) => {
                self.consumed += bytes;
                self.offset += bytes as u64;
                true
            }
            LineOutcome::NeedMore => false,
            LineOutcome::Ended => !self.operations.is_empty(),
        };
        let mut operations = std::mem::take(&mut self.operations);
        for operation in operations.drain(..) {
            self.operation(operation);
        }
        self.operations = operations;
        (self.waiting.is_empty() || self.hand_on()) && more
    }

    #[inline]
    fn operation(&mut self, operation: Operation) {
        let is_switch = |command: &feedwave_program::FunctionCommand| command.function == Function::Thinning;
        if self.thinning.is_on() || matches!(&operation.kind, OperationKind::Function(command) if is_switch(command)) {
            return self.thin(operation);
        }
        if !self.waiting.is_empty() || matches!(operation.kind, OperationKind::Guided(_)) {
            return self.waiting.push_back(operation);
        }
        self.builder.operation(&operation, &self.config, &mut self.planner, &mut self.findings);
    }

    /// Passes an operation through the thinning stage.
    fn thin(&mut self, operation: Operation) {
        let Self { config, thinning, waiting, timed, .. } = self;
        let ends = operation.kind == OperationKind::End;
        if let Some(timed) = timed {
            timed.before(&operation, config);
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

    /// Hands on what waits for the builder; `false` when more input is needed to look ahead.
    fn hand_on(&mut self) -> bool {
        while let Some(operation) = self.waiting.front() {
            if self.scout.is_none()
                && let Some(ahead) = self.builder.ahead(operation, &self.config)
            {
                let scout = Scout::new(ahead, &self.interpreter, &self.thinning, self.waiting.iter().skip(1));
                self.scout = Some(Box::new(scout));
            }
            if let Some(scout) = &mut self.scout {
                let chosen = scout.look(&self.input[self.consumed..], self.input_finished);
                if chosen.is_none() {
                    return false;
                }
                self.builder.chosen = chosen;
                self.scout = None;
            }
            if let Some(operation) = self.waiting.pop_front() {
                self.builder.operation(&operation, &self.config, &mut self.planner, &mut self.findings);
            }
        }
        if let Some(timed) = self.timed.as_mut().filter(|timed| self.thinning.is_on() && !timed.are_running()) {
            timed.start(&self.builder, &self.config);
        }
        true
    }

    /// What thinning did, where it was switched on.
    pub(crate) fn thinning_report(&mut self) -> Option<ProgramThinning> {
        let figures = self.thinning.report()?;
        let dropped = self.thinning.dropped.take().unwrap_or_default();
        let [time_before_s, time_after_s] = self.timed.as_ref().map_or([0.0; 2], |timed| timed.times_s);
        Some(ProgramThinning {
            figures,
            rotary_axes: self.thinning.rotary_letters(),
            dropped: dropped.runs,
            dropped_not_listed: dropped.not_listed,
            time_before_s,
            time_after_s,
            deviations: self.thinning.deviations(),
        })
    }
}
