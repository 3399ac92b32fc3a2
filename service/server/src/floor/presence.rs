//! A run whose stream is connected, as it tells the floor of itself.

use std::sync::Arc;
use std::time::Instant;

use feedwave_contract::convert::{state_to_proto, timestamp};
use feedwave_contract::names;
use feedwave_contract::proto::{
    self, Availability, CommandedState, Decision, DecisionAction, DecisionBrief, DecisionReason, Execution,
    MachineCondition, Overrides, ProcessReading, RunActivity, RunProgress,
};
use feedwave_monitoring::{Monitor, State};
use feedwave_store::{DecisionRecord, Job, JobState, Run, RunKind, RunOverride, RunState};
use jiff::Timestamp;
use tokio::sync::Notify;

use super::alarms::{self, Alarms};
use super::machine::Here;
use super::{Course, Floor, Logged, RunView, STATE_INTERVAL};
use crate::error::{Error, Result};
use crate::stored::{self, decision_from_record, run_settings};

/// What the log has of a run.
#[derive(Debug)]
pub(crate) struct RunBase<'a> {
    /// Its job.
    pub(crate) job: &'a Job,
    /// The run.
    pub(crate) run: &'a Run,
    /// The decision it made last.
    pub(crate) last_decision: Option<&'a DecisionRecord>,
    /// Its newest decisions that changed something, the newest first.
    pub(crate) changes: &'a [DecisionRecord],
    /// Changes of the feed of a live run, in order.
    pub(crate) overrides: &'a [RunOverride],
    /// Whether an escalation holds its feed.
    pub(crate) feed_held: bool,
    /// Its conditions.
    pub(super) conditions: &'a [Logged],
    /// Unit of the deviation.
    pub(crate) deviation_unit: &'static str,
}

/// A run on the floor; it leaves when it is dropped.
#[derive(Debug)]
pub(crate) struct Presence {
    floor: Floor,
    machine_id: String,
    ticket: Option<u64>,
    here: Here,
    view: RunView,
    alarms: Alarms,
    logged: Vec<Logged>,
    deviation_unit: &'static str,
    /// Machining time of the job at the programmed feed, s; 0 where it is not known.
    planned_s: f64,
    /// What the floor was not told yet.
    is_changed: bool,
    /// The floor is to be told at once.
    is_urgent: bool,
    /// So are other replicas.
    has_happened: bool,
    told_at: Instant,
}

fn now() -> prost_types::Timestamp {
    timestamp(Timestamp::now().as_microsecond())
}

/// What the state of a run in the log means for what it does, while no stream of it is connected.
const fn execution_at_rest(state: RunState) -> Execution {
    match state {
        RunState::Open => Execution::Interrupted,
        RunState::Finished => Execution::Finished,
        RunState::Stopped | RunState::Aborted => Execution::Stopped,
    }
}

/// What others are told of a decision, whose deviation has this unit.
fn brief(decision: &Decision, deviation_unit: &str) -> DecisionBrief {
    let reason = decision.outcome.unwrap_or_default().reason();
    let is_for_a_limit = matches!(reason, DecisionReason::FeedAboveLimit | DecisionReason::FeedBelowLimit);
    let reading = if is_for_a_limit { alarms::reading(decision, deviation_unit) } else { None };
    DecisionBrief {
        sequence: decision.sequence,
        number: decision.number,
        time: decision.time,
        before: decision.inputs.as_ref().and_then(|inputs| inputs.before),
        outcome: decision.outcome,
        reading,
    }
}

/// Whether a decision changed the override of the feed.
fn changes_feed(brief: &DecisionBrief) -> bool {
    let after = brief.outcome.and_then(|outcome| outcome.after);
    brief.before.map(|before| before.feed) != after.map(|after| after.feed)
}

impl RunBase<'_> {
    /// Why the override of the feed is as it is. A decision that cannot be read is passed over.
    fn feed_decision(&self) -> Option<DecisionBrief> {
        let changes = self.changes.iter().filter_map(|change| decision_from_record(change).ok());
        changes.map(|change| brief(&change, self.deviation_unit)).find(changes_feed)
    }

    /// What is known of the run without its stream.
    pub(super) fn at_rest(&self) -> Result<(RunView, Alarms)> {
        let Self { job, run, .. } = self;
        let summary: proto::ProgramSummary = match &job.summary {
            Some(summary) => stored::from_stored(summary.get())?,
            None => proto::ProgramSummary::default(),
        };
        let last = self.last_decision.map(decision_from_record).transpose()?;
        let stop = last.as_ref().filter(|last| last.outcome.unwrap_or_default().action() == DecisionAction::Stop);
        let (execution, execution_time) = self.execution(stop);
        let stops = stop.is_some();
        let activity = RunActivity {
            run: names::run(run.id),
            job: names::job(job.id),
            job_display_name: job.display_name.clone(),
            program: names::program(job.program_id),
            kind: match run.kind {
                RunKind::Telemetry => proto::RunKind::Telemetry,
                RunKind::Live => proto::RunKind::Live,
            }
            .into(),
            availability: Availability::Unavailable.into(),
            execution: execution.into(),
            execution_time,
            create_time: Some(timestamp(run.created_us)),
            progress: if run.kind == RunKind::Live { Some(self.progress(&summary)?) } else { None },
            // An escalation is in the log; what an operator wants is known while his client is there.
            feed_held: self.feed_held,
            last_decision: last.as_ref().map(|last| brief(last, self.deviation_unit)),
            feed_decision: self.feed_decision(),
            finding_warnings: summary.warnings,
            update_time: Some(timestamp(run.updated_us)),
            ..RunActivity::default()
        };
        let mut alarms = Alarms::new(&activity.run, summary.warnings, activity.create_time);
        // What stopped the machine stays to be seen.
        if let Some(last) = last.filter(|_| run.state == RunState::Stopped || (run.state == RunState::Open && stops)) {
            alarms.decided(&last, alarms::reading(&last, self.deviation_unit).as_ref());
            alarms.rest();
        }
        let view = RunView { id: run.id, job_id: job.id, sequence: run.sequence, activity, alarms: alarms.all() };
        Ok((view, alarms))
    }

    /// What the run does without its stream, and since when, where its last decision is this stop, or is none.
    fn execution(&self, stop: Option<&Decision>) -> (Execution, Option<prost_types::Timestamp>) {
        let is_over = matches!(self.job.state, JobState::Cancelled | JobState::Failed);
        match (execution_at_rest(self.run.state), stop) {
            // Nothing follows a stop in a run of telemetry; a live one is taken up to come to rest.
            (Execution::Interrupted, Some(stop)) if self.run.kind == RunKind::Telemetry => {
                (Execution::Stopped, stop.time)
            }
            // A run of a job that ended cannot be taken up.
            (Execution::Interrupted, _) if is_over => (Execution::Stopped, Some(timestamp(self.job.updated_us))),
            (execution, _) => (execution, Some(timestamp(self.run.updated_us))),
        }
    }

    /// How far a live run is, as the log has it. The share of the time is that of the plan, under the changes of the feed so far.
    fn progress(&self, summary: &proto::ProgramSummary) -> Result<RunProgress> {
        let taken = self.run.setpoints;
        let is_finished = self.run.state == RunState::Finished;
        let period_us = run_settings(self.run)?.interpolation_period_us;
        let total = is_finished.then_some(taken.sent);
        let mut course = Course::new(f64::from(period_us) * 1e-6, summary.duration_s);
        let progress = course.progress(self.overrides, taken.received, taken.sent, total);
        let ratio = if is_finished { 1.0 } else { progress.ratio };
        Ok(RunProgress { ratio, remaining_s: None, ..progress })
    }
}

impl Floor {
    /// A run that is to be connected, by the stream with this number of the run's.
    ///
    /// # Errors
    /// [`Error::Internal`] when something stored cannot be read.
    pub(crate) fn presence(&self, base: &RunBase<'_>, attachment: u64) -> Result<Presence> {
        let (view, alarms) = base.at_rest()?;
        let summary: proto::ProgramSummary = match &base.job.summary {
            Some(summary) => stored::from_stored(summary.get())?,
            None => proto::ProgramSummary::default(),
        };
        Ok(Presence {
            floor: self.clone(),
            machine_id: base.job.machine_id.clone(),
            ticket: None,
            here: Here { attachment, doubt: Arc::new(Notify::new()) },
            view,
            alarms,
            logged: base.conditions.to_vec(),
            deviation_unit: base.deviation_unit,
            planned_s: summary.duration_s,
            is_changed: false,
            is_urgent: false,
            has_happened: false,
            told_at: Instant::now(),
        })
    }
}

impl Presence {
    /// Machining time of the job at the programmed feed, s; 0 where it is not known.
    pub(crate) const fn planned_s(&self) -> f64 {
        self.planned_s
    }

    /// The stream is connected; the floor is not told yet.
    pub(crate) fn arrive(&mut self) {
        let activity = &mut self.view.activity;
        activity.set_availability(Availability::Available);
        activity.set_execution(Execution::Ready);
        activity.execution_time = Some(now());
        activity.update_time = activity.execution_time;
    }

    /// Tells the floor of a stream that is connected.
    pub(crate) fn connect(&mut self) {
        if !self.view.is_available() {
            self.arrive();
        }
        let logged = std::mem::take(&mut self.logged);
        self.ticket = Some(self.floor.connect(&self.machine_id, self.view.clone(), logged, Some(self.here.clone())));
        self.floor.ring(self.view.id);
        self.told_at = Instant::now();
    }

    /// Rings where another client may have taken the run up: only the store knows whether it has.
    pub(crate) fn doubt(&self) -> Arc<Notify> {
        self.here.doubt.clone()
    }

    /// What the run does; nothing is told by that alone.
    pub(crate) fn set_execution(&mut self, execution: Execution) {
        self.execute(execution, now());
    }

    /// What the run does, and since when.
    fn execute(&mut self, execution: Execution, since: prost_types::Timestamp) {
        let activity = &mut self.view.activity;
        if activity.execution() != execution {
            activity.set_execution(execution);
            activity.execution_time = Some(since);
            self.happen();
        }
    }

    /// What the run does.
    pub(crate) fn execution(&self) -> Execution {
        self.view.activity.execution()
    }

    /// What the run does as its setpoints and its telemetry show it. Without its client it does nothing that anybody could know
    /// of, but that a decision may stop it.
    pub(crate) fn follow(&mut self, execution: Execution) {
        if self.view.is_available() || execution == Execution::Stopped {
            self.set_execution(execution);
        }
    }

    /// The client is gone, while the run is still attended to; since when, as the log has it.
    pub(crate) fn lose(&mut self, since: prost_types::Timestamp) {
        if self.view.is_available() {
            self.unmeasure();
            if !matches!(self.execution(), Execution::Stopped | Execution::Finished) {
                self.execute(Execution::Interrupted, since);
            }
            self.happen();
        }
    }

    /// Takes away what is no longer current.
    fn unmeasure(&mut self) {
        let activity = &mut self.view.activity;
        activity.set_availability(Availability::Unavailable);
        // What an operator wants is known from his client; an escalation is in the log.
        activity.held = false;
        activity.commanded = None;
        activity.overrides = None;
        activity.programmed_rev_per_min = None;
        activity.tool = None;
        activity.process = None;
        activity.monitor = proto::MonitorState::Unspecified.into();
        if let Some(progress) = &mut activity.progress {
            progress.remaining_s = None;
        }
        self.alarms.rest();
    }

    /// Something happened that everybody is to be told of at once.
    const fn happen(&mut self) {
        self.is_urgent = true;
        self.has_happened = true;
    }

    /// Something of the run has changed that can wait to be told.
    pub(crate) const fn touch(&mut self) {
        self.is_changed = true;
    }

    /// When the floor is to be told of what has changed; `None` where nothing has.
    pub(crate) fn due(&self) -> Option<Instant> {
        if self.is_urgent {
            return Some(self.told_at);
        }
        self.is_changed.then(|| self.told_at + STATE_INTERVAL)
    }

    /// Whether the floor is to be told now.
    pub(crate) fn is_due(&self) -> bool {
        self.is_urgent || (self.is_changed && self.told_at.elapsed() >= STATE_INTERVAL)
    }

    /// Telemetry came.
    pub(crate) fn heard(&mut self) {
        self.is_changed = true;
        if self.alarms.heard() {
            self.happen();
        }
    }

    /// Decisions became durable.
    pub(crate) fn decided(&mut self, decisions: &[Decision]) {
        for decision in decisions {
            let reading = alarms::reading(decision, self.deviation_unit);
            self.alarms.decided(decision, reading.as_ref());
            let outcome = decision.outcome.unwrap_or_default();
            if outcome.reason() == DecisionReason::AboveLimitAtBound {
                self.raise(decision, outcome.action(), reading.clone());
                self.has_happened = true;
            }
            if let (DecisionAction::Stop, Some(time)) = (outcome.action(), decision.time)
                && self.view.activity.kind() == proto::RunKind::Telemetry
            {
                self.execute(Execution::Stopped, time);
            }
            let activity = &mut self.view.activity;
            match outcome.reason() {
                // The data says nothing any more, or the baseline is another one.
                DecisionReason::Data
                | DecisionReason::Silence
                | DecisionReason::ToolFit
                | DecisionReason::ReplaceTool => activity.process = None,
                _ => activity.process = reading.or(activity.process.take()),
            }
            let brief = brief(decision, self.deviation_unit);
            if changes_feed(&brief) {
                activity.feed_decision = Some(brief.clone());
            }
            activity.last_decision = Some(brief);
            self.is_urgent = true;
        }
    }

    fn raise(&self, decision: &Decision, action: DecisionAction, reading: Option<ProcessReading>) {
        let condition = proto::RunCondition {
            decision_number: decision.number,
            action: action.into(),
            raise_time: decision.time,
            ..proto::RunCondition::default()
        };
        self.floor.raise(&self.machine_id, Logged { run: self.view.id, job_id: self.view.job_id, condition, reading });
    }

    /// What the monitor knows.
    pub(crate) fn observe(&mut self, monitor: &Monitor) {
        let activity = &mut self.view.activity;
        // Decisions go on without the client, and are in the log.
        activity.feed_held = monitor.holds_feed();
        if activity.availability() != Availability::Available {
            return;
        }
        activity.set_monitor(state_to_proto(monitor.state()));
        activity.programmed_rev_per_min = monitor.programmed_rev_per_min();
        activity.tool = Some(monitor.tool()).filter(|tool| *tool > 0);
        let overrides = monitor.overrides();
        activity.overrides = Some(Overrides { feed: overrides.feed, spindle: overrides.spindle });
        if !monitor.is_cutting() {
            activity.process = None;
            if self.alarms.leave_cut() {
                self.happen();
            }
        }
    }

    /// What follows from the state of a monitor for what a run of telemetry does.
    pub(crate) fn execution_of(monitor: &Monitor) -> Execution {
        match monitor.state() {
            State::Stopped => Execution::Stopped,
            _ if monitor.holds_feed() => Execution::Held,
            _ if monitor.is_cutting() => Execution::Running,
            _ => Execution::Ready,
        }
    }

    /// Where a live run is: how far, at which setpoint, under which ratio of the feed.
    pub(crate) fn proceed(&mut self, progress: RunProgress, commanded: Option<CommandedState>, feed: f64, held: bool) {
        let activity = &mut self.view.activity;
        activity.progress = Some(progress);
        if activity.availability() == Availability::Available {
            activity.held = held;
            activity.commanded = commanded;
            if let Some(overrides) = &mut activity.overrides {
                overrides.feed = feed;
            }
        } else if let Some(progress) = &mut activity.progress {
            progress.remaining_s = None;
        }
    }

    /// Tells the floor.
    pub(crate) fn tell(&mut self) {
        self.is_changed = false;
        self.is_urgent = false;
        self.told_at = Instant::now();
        let alarms: Vec<MachineCondition> = self.alarms.all();
        self.view.alarms = alarms;
        self.view.activity.update_time = Some(now());
        if let Some(ticket) = self.ticket {
            self.floor.update(&self.machine_id, ticket, &self.view);
            if std::mem::take(&mut self.has_happened) {
                self.floor.ring(self.view.id);
            }
        }
    }

    /// The run came to its end; when, as the log has it.
    pub(crate) fn end(&mut self, state: RunState, at: prost_types::Timestamp) {
        self.execute(execution_at_rest(state), at);
    }

    /// The stream has ended, with an error or without.
    pub(crate) fn leave(&mut self, error: Option<&Error>) {
        let Some(ticket) = self.ticket.take() else { return };
        self.unmeasure();
        let is_stopped = self.execution() == Execution::Stopped;
        match error {
            _ if self.view.has_ended() => {}
            // A stop of telemetry holds, whoever is connected.
            None | Some(Error::Draining | Error::TakenUp { .. }) if is_stopped => {}
            // Of a run that was taken up the other stream tells, once it is connected.
            None | Some(Error::Draining | Error::TakenUp { .. }) => self.set_execution(Execution::Interrupted),
            Some(Error::JobCancelled { .. }) => self.set_execution(Execution::Stopped),
            Some(error) => {
                self.set_execution(Execution::Fault);
                self.alarms.failed(&self.view.activity.run, error, now());
            }
        }
        self.tell();
        self.floor.disconnect(&self.machine_id, ticket, Some(self.view.clone()));
    }
}

impl Drop for Presence {
    fn drop(&mut self) {
        self.leave(None);
    }
}
