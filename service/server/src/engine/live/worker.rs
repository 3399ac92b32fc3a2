//! The thread of a live run.

use std::sync::Arc;
use std::time::Instant;

use feedwave_contract::proto;
use feedwave_cutting::OverrideChange;
use feedwave_monitoring::Action;
use feedwave_store::{RunCommit, RunOverride, RunSetpoints, RunState};
use tokio::runtime::Handle;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};

use super::checkpoint;
use super::feed::{Cause, Feed, feed_change_to_proto};
use super::handed_out::{MOST_UNCOMMITTED, RunHandedOut};
use super::receipts::Receipts;
use super::setpoints::{Next, Setpoints};
use super::spindle::{Gate, change_of};
use super::view::{LiveView, Reached};
use super::{CHUNKS_IN_FLIGHT, LiveInput, MESSAGES_IN_FLIGHT, Message, Outgoing};
use crate::engine::session::Session;
use crate::engine::telemetry::RunEnds;
use crate::engine::until;
use crate::error::{Error, Result};
use crate::observability::metrics::Metrics;

/// Inputs that become durable together at most.
const INPUTS_PER_GROUP: usize = 64;

/// Why a waiting thread goes on.
enum Wake {
    /// The client said something; `None`: the connection broke.
    Input(Option<LiveInput>),
    /// Another chunk may be sent.
    Slot(OwnedSemaphorePermit),
    Silence,
    /// Setpoints have waited too long for a receipt.
    Overdue,
    Commit,
    /// There is something to do at a place between sections.
    Judge,
    /// The floor is to be told how things are.
    Show,
    /// Another client may have taken the run up.
    Doubt,
    Ended(Error),
}

/// Everything that the thread works with.
pub(super) struct Worker {
    session: Session,
    setpoints: Setpoints,
    feed: Feed,
    gate: Gate,
    view: LiveView,
    input: mpsc::Receiver<LiveInput>,
    /// Whether the client may say more.
    open: bool,
    outlet: mpsc::Sender<Outgoing>,
    slots: Arc<Semaphore>,
    ends: RunEnds,
    runtime: Handle,
    metrics: Arc<Metrics>,
    /// Setpoints before this index may be handed out.
    credit: u64,
    /// What the client has taken.
    receipts: Receipts,
    /// Number of setpoints of the run, once the last one was generated.
    total: Option<u64>,
    /// Setpoints as they became durable last.
    durable: RunSetpoints,
    handed_out: RunHandedOut,
}

impl Worker {
    #[allow(clippy::too_many_arguments, reason = "the parts of one thread, put together in one place")]
    pub(super) fn new(
        session: Session,
        setpoints: Setpoints,
        feed: Feed,
        gate: Gate,
        view: LiveView,
        receipts: Receipts,
        input: mpsc::Receiver<LiveInput>,
        outlet: mpsc::Sender<Outgoing>,
        ends: RunEnds,
        runtime: Handle,
        metrics: Arc<Metrics>,
        handed_out: RunHandedOut,
    ) -> Self {
        let slots = Arc::new(Semaphore::new(CHUNKS_IN_FLIGHT));
        let durable = RunSetpoints { received: receipts.received(), ..RunSetpoints::default() };
        Self {
            session,
            setpoints,
            feed,
            gate,
            view,
            input,
            open: true,
            outlet,
            slots,
            ends,
            runtime,
            metrics,
            credit: 0,
            receipts,
            total: None,
            durable,
            handed_out,
        }
    }

    pub(super) fn run(&mut self) -> Result<()> {
        let reached = reached(&self.setpoints, &self.feed, self.receipts.received(), self.total);
        self.view.connect(self.session.monitor(), reached);
        let outcome = self.work();
        if matches!(outcome, Err(Error::TakenUp { .. } | Error::JobCancelled { .. } | Error::NotFound { .. })) {
            self.handed_out.forget();
        }
        self.view.presence.leave(outcome.as_ref().err());
        outcome
    }

    fn work(&mut self) -> Result<()> {
        // Wherever it was before, the place has to be reached again.
        self.session.ask_for_spindle(None, None)?;
        loop {
            let mut ended = None;
            let mut cause = None;
            let mut must_commit = false;
            match self.wait() {
                Wake::Input(Some(first)) => cause = self.gather(first)?,
                Wake::Input(None) => {
                    // The log knows since when nobody is there.
                    (self.open, must_commit) = (false, true);
                }
                Wake::Slot(place) => self.hand_out(place)?,
                Wake::Overdue => ended = Some(self.overdue()),
                Wake::Silence => {
                    self.session.cut_thread(self.cuts_thread())?;
                    self.session.fall_silent()?;
                }
                Wake::Commit | Wake::Show | Wake::Judge => {}
                // A commit fails where the run is another client's.
                Wake::Doubt => must_commit = true,
                Wake::Ended(error) => {
                    must_commit = matches!(error, Error::Draining);
                    ended = Some(error);
                }
            }
            let request = match self.advance() {
                // The refusal is durable before the stream ends.
                Err(error @ Error::Precondition { .. }) => {
                    ended = ended.or(Some(error));
                    None
                }
                request => request?,
            };
            self.take_decisions();
            // After the last setpoint there is nothing left that could change.
            let change = match self.total {
                None => self.feed.change(self.session.overrides().feed, self.setpoints.earliest_change()),
                Some(_) => None,
            };
            let end = self.end();
            let last = ended.is_some() || end.is_some() || (!self.open && self.session.silence_at().is_none());
            let due = self.commit_at().is_some_and(|at| last || at <= Instant::now());
            if due || end.is_some() {
                self.keep_checkpoint()?;
            }
            if due || must_commit || change.is_some() || end.is_some() {
                self.commit(change, end, cause)?;
            }
            if must_commit && (!self.open || last) {
                self.view.presence.lose(self.runtime.block_on(self.session.logged_at()));
            }
            if let Some(request) = request {
                self.tell(Message::SpindleRequest(request), None)?;
            }
            self.view.show(
                self.session.monitor(),
                reached(&self.setpoints, &self.feed, self.receipts.received(), self.total),
            );
            if last {
                return ended.map_or(Ok(()), Err);
            }
        }
    }

    /// Goes on with a planned change of the spindle speed; what is to be asked of the client.
    fn advance(&mut self) -> Result<Option<proto::RunSpindleRequest>> {
        let is_reached = self.session.waiting_decisions().iter().any(|decision| change_of(decision).is_some());
        self.gate.advance(&mut self.setpoints, &mut self.session, is_reached)
    }

    /// What waiting decisions ask of feed and spindle.
    fn take_decisions(&mut self) {
        for decision in self.session.waiting_decisions() {
            if let Some(change) = change_of(decision) {
                self.feed.set_spindle(decision.number, change);
                continue;
            }
            match decision.outcome.action {
                Action::Stop => self.feed.set_cause(Cause::Stop(decision.number)),
                Action::Change => self.feed.set_cause(Cause::Decision(decision.number)),
                Action::HoldFeed => self.feed.set_cause(Cause::Escalation(decision.number)),
                Action::Keep | Action::Hold => {}
            }
        }
    }

    /// How the run ends, where it does now.
    fn end(&self) -> Option<(RunState, String)> {
        // What the client had before has to be generated again first.
        let rests = self.is_past_start() && (self.total.is_some() || self.setpoints.at_rest());
        match self.feed.ending {
            Some(Cause::Stop(number)) if rests => {
                Some((RunState::Stopped, format!("decision {number} stopped the machine")))
            }
            Some(_) if rests => Some((RunState::Aborted, "given up by the client".to_owned())),
            Some(_) => None,
            None => self
                .total
                .filter(|total| self.receipts.received() >= *total)
                .map(|_| (RunState::Finished, String::new())),
        }
    }

    fn progress(&self) -> RunSetpoints {
        RunSetpoints { received: self.receipts.received(), sent: self.setpoints.next_index(), digest: None }
    }

    /// When something wants to be committed.
    fn commit_at(&self) -> Option<Instant> {
        let waits = self.progress() != self.durable || self.setpoints.has_checkpoint();
        let progress = (waits && self.is_past_start()).then(|| match self.is_far_ahead() {
            true => self.session.next_commit().min(Instant::now()),
            false => self.session.next_commit(),
        });
        self.session.commit_at().into_iter().chain(progress).min()
    }

    /// Before that the digest is of less than the client has.
    fn is_past_start(&self) -> bool {
        self.setpoints.next_index() >= self.setpoints.first_index()
    }

    /// Whether so much was handed out that the log does not have that it comes first; one more chunk stays within the bound.
    fn is_far_ahead(&self) -> bool {
        let durable = self.durable.sent.max(self.setpoints.first_index());
        self.setpoints.next_index().saturating_sub(durable) >= MOST_UNCOMMITTED / 2
    }

    fn wait(&mut self) -> Wake {
        // What the client has is generated first: it may be a thread, in which nothing may be decided.
        let open = self.open && self.is_past_start();
        if let Some(input) = open.then(|| self.input.try_recv().ok()).flatten() {
            return Wake::Input(Some(input));
        }
        let (silence, commit) = (until(self.session.silence_at()), until(self.commit_at()));
        // A client that is gone owes nothing: it says what it has when it takes the run up.
        let overdue = until(self.overdue_at().filter(|_| self.open));
        let judges = self.gate.is_due(&self.setpoints, &self.session) && open;
        let show = until(self.view.presence.due());
        let within_credit = self.setpoints.next_index() < self.credit_end();
        let generates = self.open
            && self.total.is_none()
            && within_credit
            && !self.is_far_ahead()
            && self.gate.is_open(&self.setpoints);
        let (input, ends, slots) = (&mut self.input, &self.ends, self.slots.clone());
        let doubt = self.view.presence.doubt();
        self.runtime.block_on(async {
            tokio::select! {
                biased;
                error = ends.reached() => Wake::Ended(error),
                () = doubt.notified() => Wake::Doubt,
                input = input.recv(), if open => Wake::Input(input),
                () = silence => Wake::Silence,
                () = commit => Wake::Commit,
                () = overdue => Wake::Overdue,
                Ok(place) = slots.acquire_owned(), if generates => Wake::Slot(place),
                () = show => Wake::Show,
                () = std::future::ready(()), if judges => Wake::Judge,
            }
        })
    }

    /// Setpoints before this index may be generated: what the client has needs no credit.
    fn credit_end(&self) -> u64 {
        self.credit.max(self.setpoints.first_index())
    }

    /// Takes in what is there, up to a batch that causes a decision; when that batch came.
    fn gather(&mut self, first: LiveInput) -> Result<Option<Instant>> {
        let mut next = Some(first);
        for taken in 1.. {
            match next {
                Some(LiveInput::Batch(batch, arrival)) => {
                    self.metrics.telemetry_samples.inc_by(batch.time_ns.len() as u64);
                    self.session.cut_thread(self.cuts_thread())?;
                    self.session.take(&batch, arrival, true)?;
                    self.view.presence.heard();
                    if !self.session.waiting_decisions().is_empty() {
                        return Ok(Some(arrival));
                    }
                }
                Some(LiveInput::Credit(end)) => self.credit = self.credit.max(end),
                Some(LiveInput::Receipt(received)) => self.receive(received)?,
                Some(LiveInput::Command(command)) => {
                    self.obey(command)?;
                    // Each command has its own place in the log.
                    return Ok(None);
                }
                Some(LiveInput::Refused(error)) => return Err(error),
                None => break,
            }
            if taken == INPUTS_PER_GROUP {
                break;
            }
            next = self.input.try_recv().ok();
        }
        Ok(None)
    }

    fn obey(&mut self, command: proto::RunCommandKind) -> Result<()> {
        let cause = match command {
            proto::RunCommandKind::Hold => Cause::Hold,
            proto::RunCommandKind::Resume => match self.runtime.block_on(self.session.resume()) {
                Ok(()) => Cause::Resume,
                // An unacknowledged hold is not resumed; the run itself goes on.
                Err(Error::Precondition { reason, message, .. }) => {
                    let refused = proto::RunCommandRefused { kind: command.into(), reason: reason.into(), message };
                    return self.tell(Message::CommandRefused(refused), None);
                }
                Err(error) => return Err(error),
            },
            proto::RunCommandKind::Abort => Cause::Abort,
            proto::RunCommandKind::Unspecified => return Err(Error::invalid("command.kind", "must be set")),
        };
        self.feed.set_cause(cause);
        Ok(())
    }

    fn receive(&mut self, received: u64) -> Result<()> {
        let sent = self.setpoints.next_index().max(self.setpoints.first_index());
        if received > sent {
            let why = format!("is {received}, but only {sent} setpoints were sent");
            return Err(Error::invalid("receipt.received", why));
        }
        self.receipts.receive(received, sent, Instant::now());
        if self.session.monitor().owes_fallback() {
            // No telemetry brings the end of the pass.
            self.session.cut_thread(self.cuts_thread())?;
        }
        self.view.presence.touch();
        Ok(())
    }

    /// Whether the client may be cutting a thread.
    fn cuts_thread(&self) -> bool {
        self.setpoints.cuts_thread(self.receipts.received())
    }

    /// When the patience with the client ends.
    fn overdue_at(&self) -> Option<Instant> {
        self.receipts.overdue_at().into_iter().chain(self.gate.overdue_at()).min()
    }

    /// The client has what it was sent, or not: without receipts nobody knows, and the run is not its to keep.
    fn overdue(&self) -> Error {
        if self.receipts.overdue_at().is_none_or(|at| at > Instant::now()) {
            return self.gate.overdue(self.session.run_name());
        }
        let received = self.receipts.received();
        let message = format!(
            "{} setpoints were sent and {received} acknowledged for {} s: say what was taken (RunReceipt), and take the run \
             up at the first setpoint that is missing",
            self.setpoints.next_index(),
            self.receipts.patience().as_secs()
        );
        Error::Precondition { reason: "RECEIPTS_MISSING", subject: self.session.run_name(), message }
    }

    /// Stores a checkpoint that was taken.
    fn keep_checkpoint(&mut self) -> Result<()> {
        let Some(taken) = self.setpoints.take_checkpoint() else { return Ok(()) };
        let removed = checkpoint::outdated(taken.mark.setpoint_index);
        self.runtime.block_on(self.session.put_checkpoint(taken, removed))
    }

    /// Generates the next setpoints and hands them out.
    fn hand_out(&mut self, place: OwnedSemaphorePermit) -> Result<()> {
        let before = self.setpoints.next_index();
        let next = self.setpoints.next(self.credit_end())?;
        if !matches!(next, Next::End) {
            self.view.note(self.setpoints.block());
        }
        match next {
            Next::Chunk(chunk) => {
                self.handed_out.reach(self.setpoints.next_index());
                self.metrics.setpoints.inc_by(u64::from(chunk.count));
                self.receipts.owes(Instant::now());
                self.tell(Message::Chunk(chunk), Some(place))
            }
            Next::Passed => {
                self.metrics.regenerated_setpoints.inc_by(self.setpoints.next_index() - before);
                Ok(())
            }
            Next::End => {
                let total = self.setpoints.next_index();
                if total < self.setpoints.first_index() {
                    return Err(crate::engine::beyond_end(self.setpoints.first_index(), total));
                }
                self.total = Some(total);
                Ok(())
            }
        }
    }

    /// Makes everything durable, tells the client, and lets a change of the feed act.
    fn commit(
        &mut self,
        change: Option<RunOverride>,
        end: Option<(RunState, String)>,
        cause: Option<Instant>,
    ) -> Result<()> {
        let past_start = self.is_past_start();
        let progress = self.progress();
        let setpoints = RunSetpoints { digest: Some(self.setpoints.digest()), ..progress };
        let besides = RunCommit {
            overrides: change.iter().cloned().collect(),
            setpoints: past_start.then_some(setpoints),
            end: end.clone(),
            ..RunCommit::default()
        };
        let durable = self.runtime.block_on(self.session.commit(&self.metrics, besides))?;
        if past_start {
            self.durable = progress;
        }
        let decided = !durable.decisions.is_empty();
        self.view.decided(&durable.decisions);
        for decision in durable.decisions {
            self.tell(Message::Decision(decision), None)?;
        }
        if let Some(change) = change {
            self.setpoints.append(OverrideChange { index: change.setpoint_index, ratio: change.ratio })?;
            if let Cause::Spindle(_, spindle) = change.cause.parse()? {
                self.setpoints.turn(spindle)?;
                self.gate.turned(spindle);
            }
            self.tell(Message::FeedChange(feed_change_to_proto(&change)?), None)?;
        }
        if let Some(cause) = cause.filter(|_| decided) {
            self.metrics.decision_seconds.observe(cause.elapsed().as_secs_f64());
        }
        if let Some(ack) = durable.ack {
            self.tell(Message::Ack(ack), None)?;
        }
        let Some((state, message)) = end else { return Ok(()) };
        self.handed_out.forget();
        let reached = reached(&self.setpoints, &self.feed, self.receipts.received(), self.total);
        let at = self.runtime.block_on(self.session.logged_at());
        self.view.end(state, at, self.session.monitor(), reached);
        let digest = setpoints.digest.unwrap_or_default().iter().map(|byte| format!("{byte:02x}")).collect();
        let state = crate::stored::run_state_to_proto(state).into();
        self.tell(Message::Ended(proto::RunEnded { state, message, setpoint_count: progress.sent, digest }), None)
    }

    fn tell(&self, message: Message, place: Option<OwnedSemaphorePermit>) -> Result<()> {
        match self.outlet.try_send(Outgoing { message, _place: place }) {
            // A client that is gone gets it when it resumes the run.
            Ok(()) | Err(mpsc::error::TrySendError::Closed(_)) => Ok(()),
            Err(mpsc::error::TrySendError::Full(_)) => {
                let message = format!("{MESSAGES_IN_FLIGHT} messages were left unread; read decisions as they come");
                Err(Error::Precondition { reason: "MESSAGES_UNREAD", subject: self.ends.job_name.clone(), message })
            }
        }
    }
}

/// How far a run is, for those who look.
fn reached<'a>(setpoints: &Setpoints, feed: &'a Feed, taken: u64, total: Option<u64>) -> Reached<'a> {
    Reached { taken, sent: setpoints.handed_out(), total, changes: feed.log(), held: feed.held }
}
