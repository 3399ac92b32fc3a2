//! The monitor of a run with everything of it that is not durable yet. The driver of a session takes batches in, then
//! commits; what a commit returns may be sent to the client.
//!
//! Invariant: a decision, the batches it was made from and the monitor's state after them become durable in one
//! transaction, so that a run that is taken up after a kill makes every decision once.

use std::ops::Range;
use std::time::{Duration, Instant};

use feedwave_contract::convert::{
    action_name, conditions_of, decision_to_proto, learning_record_of, recorded_cut_to_proto, recording_from_proto,
    state_to_proto, timestamp,
};
use feedwave_contract::{names, proto};
use feedwave_monitoring::{
    Decision, Event, Monitor, Overrides, Reason, Receipt, RecordedCut, Recorder, SnapshotError, State,
};
use feedwave_store::{
    AttachedRun, NewDecision, NewRecordedCut, RunCheckpoint, RunCommit, Store, StoreError, TelemetryGap,
};
use jiff::Timestamp;
use prost::Message as _;
use proto::machine_event::Event as ProtoEvent;
use uuid::Uuid;

use self::clock::SensorClock;
use self::messages::{batch_error, check_size, columns, event_from_proto, note_of};
use crate::error::{Error, Result, Violations};
use crate::observability::metrics::Metrics;
use crate::stored::{self, name_decision};

mod clock;
mod messages;

/// Most samples of a batch.
pub const MAX_BATCH_SAMPLES: usize = 100_000;
/// Most events of a batch.
pub const MAX_BATCH_EVENTS: usize = 64;
/// Most characters of the note of a decision.
const MAX_DECISION_NOTE_CHARACTERS: usize = 1_000;
/// Batches become durable this often where no decision is waiting.
const COMMIT_INTERVAL: Duration = Duration::from_millis(100);
/// A large state becomes durable less often, so that it is written at this rate at most, bytes/s.
const STATE_BYTES_PER_S: usize = 4 << 20;
/// The monitor of a run and what of it is not durable yet.
pub(super) struct Session {
    store: Store,
    run: Uuid,
    attachment: u64,
    monitor: Monitor,
    clock: SensorClock,
    /// When the newest samples came.
    last_arrival: Option<Instant>,
    /// The silence since then was reported to the monitor.
    silence_told: bool,
    /// Whether a thread is being cut: by the setpoints handed out, where there are any, and by what the client says.
    pass: Option<bool>,
    said_threading: bool,
    fresh: Fresh,
    /// Where steady cuts are kept to learn from: the recorder, and how many are kept or wait for it.
    recorder: Option<(Recorder, u64)>,
    next_commit: Instant,
    /// Where the grid of commits that can wait begins.
    grid: Instant,
}

/// What is not durable yet.
#[derive(Default)]
struct Fresh {
    /// Whether the monitor has changed.
    changed: bool,
    decisions: Vec<Decision>,
    gaps: Vec<TelemetryGap>,
    duplicates: u32,
    recorded: Vec<RecordedCut>,
}

/// What became durable.
#[derive(Debug, Default)]
pub(super) struct Durable {
    /// Decisions, in order, as the client receives them.
    pub(super) decisions: Vec<proto::Decision>,
    /// What is acknowledged; `None` where nothing came.
    pub(super) ack: Option<proto::TelemetryAck>,
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session").field("run", &self.run).field("state", &self.monitor.state()).finish_non_exhaustive()
    }
}

impl Session {
    /// Goes on with a run; `sensor_time_ns` is the time of the sensors' clock now, where the client knows it. Sessions with the
    /// same `grid` commit together what can wait.
    pub(super) fn new(
        store: Store,
        attached: &AttachedRun,
        sensor_time_ns: Option<u64>,
        grid: Instant,
    ) -> Result<Self> {
        let unreadable = |error: SnapshotError| {
            Error::internal(format!("the state of run {} cannot be read: {error}", attached.run.id))
        };
        let now = Instant::now();
        let mut monitor = Monitor::restore(&attached.monitor).map_err(unreadable)?;
        // What its clock showed was before the connection.
        monitor.note(Event::ClockUnknown, &mut |_| {}).map_err(Error::internal)?;
        let quality = &monitor.config().quality;
        let [stale, gap] = [quality.stale_s, quality.max_gap_s].map(Duration::from_secs_f64);
        Ok(Self {
            store,
            run: attached.run.id,
            attachment: attached.attachment,
            monitor,
            clock: SensorClock::new(sensor_time_ns, now, stale, gap),
            last_arrival: None,
            silence_told: false,
            pass: None,
            said_threading: false,
            fresh: Fresh::default(),
            recorder: None,
            next_commit: now,
            grid,
        })
    }

    /// Keeps steady cuts of the telemetry to learn from, where the run was made so.
    ///
    /// # Errors
    /// Those of the store.
    pub(super) async fn record(&mut self, attached: &AttachedRun) -> Result<()> {
        let settings: proto::RunSettings = stored::from_stored(attached.run.settings.get())?;
        let Some(recording) = &settings.recording else { return Ok(()) };
        let mut violations = Violations::default();
        let Some(limits) = recording_from_proto(&mut violations, "recording", recording) else {
            return Err(Error::internal(format!("stored settings are refused: {:?}", violations.as_slice())));
        };
        let mut kept = Vec::new();
        let mut bytes = 0;
        for head in self.store.recorded_cuts(self.run).await? {
            let damaged = |error| Error::Damaged(format!("a recorded cut of {}: {error}", self.run_name()));
            let (conditions, size) = conditions_of(&proto::LearningRecord::decode(head.head).map_err(damaged)?);
            kept.push(conditions);
            bytes += size;
        }
        let number = kept.len() as u64;
        let recorder = Recorder::new(self.monitor.config(), limits, kept, bytes).map_err(Error::internal)?;
        self.recorder = Some((recorder, number));
        Ok(())
    }

    /// The monitor as it is now, durable or not.
    pub(super) const fn monitor(&self) -> &Monitor {
        &self.monitor
    }

    /// Overrides decided last.
    pub(super) fn overrides(&self) -> Overrides {
        self.monitor.overrides()
    }

    /// Ends the hold of an escalation, where there is one.
    ///
    /// # Errors
    /// [`Error::Precondition`] while a condition of the run is not acknowledged: nothing has happened. Those of the store.
    pub(super) async fn resume(&mut self) -> Result<()> {
        if !self.monitor.holds_feed() {
            return Ok(());
        }
        self.check_acknowledged().await?;
        self.note(Event::Resume)
    }

    async fn check_acknowledged(&self) -> Result<()> {
        if self.store.run(self.run).await?.open_conditions == 0 {
            return Ok(());
        }
        let subject = names::run(self.run);
        let message = format!("{subject} has a condition that is not acknowledged: do so before the feed is resumed");
        Err(Error::Precondition { reason: "CONDITION_NOT_ACKNOWLEDGED", subject, message })
    }

    /// Refuses a batch that resumes what is not acknowledged.
    ///
    /// # Errors
    /// [`Error::Precondition`], and those of the store.
    pub(super) async fn check_resume(&self, batch: &proto::TelemetryBatch) -> Result<()> {
        let resumes = batch.events.iter().any(|event| matches!(event.event, Some(ProtoEvent::Resume(true))));
        let taken = self.monitor.newest_batch().is_some_and(|newest| batch.sequence <= newest);
        if resumes && !taken && self.monitor.holds_feed() { self.check_acknowledged().await } else { Ok(()) }
    }

    /// Takes a batch in.
    ///
    /// # Errors
    /// [`Error::Invalid`] when it cannot be read. The session is of no use then: part of the batch may have been taken.
    pub(super) fn take(&mut self, batch: &proto::TelemetryBatch, now: Instant, live: bool) -> Result<()> {
        check_size(batch)?;
        if self.monitor.newest_batch().is_some_and(|newest| batch.sequence <= newest) {
            self.fresh.duplicates = self.fresh.duplicates.saturating_add(1);
            return Ok(());
        }
        self.fresh.changed = true;
        let decisions = &mut self.fresh.decisions;
        for (index, event) in batch.events.iter().enumerate() {
            let note = note_of(event);
            let before = decisions.len();
            let mut event = event_from_proto(index, event, live)?;
            if let Event::Threading(threading) = &mut event {
                self.said_threading = *threading;
                *threading |= self.pass == Some(true);
            }
            let noted = self.monitor.note(event, &mut |decision| decisions.push(decision));
            noted.map_err(|error| Error::invalid(format!("batch.events[{index}]"), error.to_string()))?;
            if let (Some(note), Some(decision)) = (note, decisions.get_mut(before)) {
                note.clone_into(&mut decision.note);
            }
        }
        if !batch.time_ns.is_empty() {
            if let Some(event) = self.clock.follow(&batch.time_ns, now) {
                // Shows the monitor telemetry that is late.
                let noted = self.monitor.note(event, &mut |decision| decisions.push(decision));
                noted.map_err(Error::internal)?;
            }
            self.last_arrival = Some(now);
            self.silence_told = false;
        }
        let columns = columns(batch);
        let is_measuring = self.monitor.state() == State::Measuring;
        let receipt = self.monitor.push(&columns, &mut |decision| decisions.push(decision));
        match receipt.map_err(|error| batch_error(&error))? {
            Receipt::AcceptedAfterGap { first, last } => self.fresh.gaps.push(TelemetryGap { first, last }),
            Receipt::Accepted | Receipt::Dropped { .. } => {}
        }
        if let Some((recorder, _)) = &mut self.recorder {
            let is_measuring = is_measuring && self.monitor.state() == State::Measuring;
            self.fresh.recorded.extend(recorder.push(&columns, is_measuring));
        }
        Ok(())
    }

    /// A planned change of the spindle speed has come to its place, or not after all; `rev_per_min` is the speed there.
    pub(super) fn ask_for_spindle(&mut self, setpoint_index: Option<u64>, rev_per_min: Option<f64>) -> Result<()> {
        if self.monitor.spindle().request.is_none_or(|request| request.setpoint_index == setpoint_index) {
            return Ok(());
        }
        self.note(Event::SpindlePlace { setpoint_index, rev_per_min })
    }

    /// What follows setpoint `setpoint_index` cannot be cut at a spindle override, for this reason.
    pub(super) fn refuse_spindle(&mut self, spindle: f64, setpoint_index: u64, reason: &str) -> Result<()> {
        let before = self.fresh.decisions.len();
        self.note(Event::SpindleUnfit { spindle, setpoint_index })?;
        if let Some(decision) = self.fresh.decisions.get_mut(before) {
            decision.note = reason.chars().take(MAX_DECISION_NOTE_CHARACTERS).collect();
        }
        Ok(())
    }

    /// Tells the monitor whether the setpoints handed out cut a thread, which it has to know before telemetry and in a silence.
    pub(super) fn cut_thread(&mut self, pass: bool) -> Result<()> {
        if self.pass.replace(pass) == Some(pass) {
            return Ok(());
        }
        self.note(Event::Threading(pass || self.said_threading))
    }

    /// When silence has to be reported to the monitor; `None` while silence is harmless.
    pub(super) fn silence_at(&self) -> Option<Instant> {
        let arrival = self.last_arrival.filter(|_| self.monitor.is_cutting() && !self.silence_told);
        arrival.map(|arrival| arrival + self.silence())
    }

    /// What the monitor does not tolerate any more.
    fn silence(&self) -> Duration {
        Duration::from_secs_f64(self.monitor.config().quality.silence_s) + Duration::from_millis(1)
    }

    /// Tells the monitor that nothing has come for the time that is tolerated.
    pub(super) fn fall_silent(&mut self) -> Result<()> {
        self.silence_told = true;
        self.note(Event::Clock(self.clock.newest_ns().saturating_add(self.silence().as_nanos() as u64)))
    }

    fn note(&mut self, event: Event) -> Result<()> {
        self.fresh.changed = true;
        let decisions = &mut self.fresh.decisions;
        self.monitor.note(event, &mut |decision| decisions.push(decision)).map_err(Error::internal)
    }

    /// Decisions that wait for their commit.
    pub(super) fn waiting_decisions(&self) -> &[Decision] {
        &self.fresh.decisions
    }

    /// When the session wants to be committed; `None` when everything is durable.
    pub(super) fn commit_at(&self) -> Option<Instant> {
        if !self.fresh.decisions.is_empty() {
            return Some(Instant::now());
        }
        (self.fresh.changed || self.fresh.duplicates > 0).then_some(self.next_commit)
    }

    /// When what can wait, wants to be committed next.
    pub(super) const fn next_commit(&self) -> Instant {
        self.next_commit
    }

    /// Name of the run.
    pub(super) fn run_name(&self) -> String {
        names::run(self.run)
    }

    /// Keeps a checkpoint of the run's generator, and removes those in `removed`. One that is too large is left out: it is
    /// derived data.
    ///
    /// # Errors
    /// Those of the store; [`Error::TakenUp`] when another connection goes on with the run.
    pub(super) async fn put_checkpoint(&self, checkpoint: RunCheckpoint, removed: Vec<Range<u64>>) -> Result<()> {
        let index = checkpoint.mark.setpoint_index;
        match self.store.put_run_checkpoint(self.run, self.attachment, checkpoint, removed).await {
            Err(error @ StoreError::TooLarge { .. }) => {
                tracing::warn!(run = %self.run, index, %error, "no checkpoint");
                Ok(())
            }
            stored => stored.map_err(|error| self.refused(error)),
        }
    }

    /// Why something could not be written.
    fn refused(&self, error: StoreError) -> Error {
        match error {
            // By whoever took it up: what this session ends, it does not write to again.
            StoreError::RunEnded { .. } => Error::TakenUp { run: self.run_name() },
            error => error.into(),
        }
    }

    /// Stretches as the store keeps them.
    fn numbered(&mut self, cuts: &[RecordedCut]) -> Vec<NewRecordedCut> {
        let Some((_, next)) = &mut self.recorder else { return Vec::new() };
        let number = |cut: &RecordedCut| {
            let number = *next;
            *next += 1;
            let head = learning_record_of(cut, u32::try_from(number).unwrap_or(u32::MAX));
            let body = recorded_cut_to_proto(cut);
            NewRecordedCut { number, head: head.encode_to_vec().into(), body: body.encode_to_vec().into() }
        };
        cuts.iter().map(number).collect()
    }

    /// When the log heard of the run last: now, where that cannot be read.
    pub(super) async fn logged_at(&self) -> prost_types::Timestamp {
        let logged = self.store.run(self.run).await;
        timestamp(logged.map_or_else(|_| Timestamp::now().as_microsecond(), |run| run.updated_us))
    }

    /// Makes everything durable, together with what else happened in the run.
    ///
    /// # Errors
    /// Those of the store; [`Error::TakenUp`] when another connection goes on with the run.
    pub(super) async fn commit(&mut self, metrics: &Metrics, besides: RunCommit) -> Result<Durable> {
        let mut fresh = std::mem::take(&mut self.fresh);
        if besides.end.is_some()
            && let Some((recorder, _)) = &mut self.recorder
        {
            fresh.recorded.extend(recorder.finish());
        }
        let recorded_cuts = self.numbered(&fresh.recorded);
        let state = if fresh.changed { Some(self.monitor.snapshot().map_err(Error::internal)?) } else { None };
        let bytes = state.as_ref().map_or(0, Vec::len);
        let interval = Duration::from_secs_f64(bytes as f64 / STATE_BYTES_PER_S as f64);
        let mut decisions: Vec<proto::Decision> = fresh.decisions.iter().map(decision_to_proto).collect();
        let new = |(decision, message): (&Decision, &proto::Decision)| NewDecision {
            number: decision.number,
            action: action_name(decision.outcome.action),
            body: message.encode_to_vec().into(),
            raises_condition: decision.outcome.reason == Reason::AboveLimitAtBound,
        };
        let commit = RunCommit {
            telemetry: state.map(|state| (self.monitor.newest_batch(), state.into())),
            decisions: fresh.decisions.iter().zip(&decisions).map(new).collect(),
            gaps: fresh.gaps.clone(),
            recorded_cuts,
            ..besides
        };
        let committed = self.store.commit_run(self.run, self.attachment, commit).await;
        let records = committed.map_err(|error| self.refused(error))?;
        self.next_commit = on_grid(self.grid, Instant::now() + COMMIT_INTERVAL.max(interval));
        for ((message, decision), record) in decisions.iter_mut().zip(&fresh.decisions).zip(records) {
            name_decision(message, &record);
            metrics.decisions.with_label_values(&[action_name(decision.outcome.action)]).inc();
        }
        let told = fresh.changed || fresh.duplicates > 0;
        let ack = self.monitor.newest_batch().filter(|_| told).map(|durable_batch| proto::TelemetryAck {
            durable_batch,
            gaps: fresh.gaps.iter().map(|gap| proto::BatchGap { first: gap.first, last: gap.last }).collect(),
            duplicates: fresh.duplicates,
            state: state_to_proto(self.monitor.state()).into(),
        });
        Ok(Durable { decisions, ack })
    }
}

/// The nearest instant that is a whole number of intervals after `grid`: what can wait of all runs becomes durable at the
/// same instants, in one transaction, and leaves the disk to decisions in between.
fn on_grid(grid: Instant, at: Instant) -> Instant {
    let interval_ns = COMMIT_INTERVAL.as_nanos();
    let intervals = (at.saturating_duration_since(grid).as_nanos() + interval_ns / 2) / interval_ns;
    // Thirteen years of intervals are within 32 bits.
    grid + COMMIT_INTERVAL * u32::try_from(intervals).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commits_that_can_wait_meet_on_the_grid() {
        let grid = Instant::now();
        let at = |ms| on_grid(grid, grid + Duration::from_millis(ms)) - grid;
        let expected = [(0, 0), (40, 0), (60, 100), (100, 100), (1_249, 1_200), (1_250, 1_300)];
        for (ms, on_grid_ms) in expected {
            assert_eq!(at(ms), Duration::from_millis(on_grid_ms), "{ms} ms");
        }
        // A commit on the grid has the next one an interval later, whatever it took itself.
        assert_eq!(at(100 + 100 + 30), Duration::from_millis(200));
    }
}
