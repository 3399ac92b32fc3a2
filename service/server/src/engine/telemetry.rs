//! Ingestion of telemetry: a thread for each run takes batches as they come, makes what follows from them durable in
//! groups, and then tells the client. While one group is being written the next one gathers.

use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::{Duration, Instant};

use feedwave_contract::names;
use feedwave_contract::proto;
use feedwave_contract::proto::Execution;
use feedwave_store::{AttachedRun, RunCommit, RunState};
use futures_util::Stream;
use proto::ingest_response::Message;
use tokio::runtime::Handle;
use tokio::sync::{OwnedSemaphorePermit, mpsc};
use tokio::time::timeout;
use tokio_util::sync::{CancellationToken, DropGuard};

use super::session::Session;
use super::{Engine, JobGuard, until};
use crate::access::Work;
use crate::error::{Error, Result};
use crate::floor::Presence;
use crate::observability::metrics::{GaugeGuard, Metrics};

/// Batches that wait for the thread; a sender that is faster than it waits then.
const BATCHES_IN_FLIGHT: usize = 8;
/// Batches that become durable together at most.
const BATCHES_PER_GROUP: usize = 64;
/// Messages that wait for the connection. A client that leaves more unread is not listening to decisions.
const MESSAGES_IN_FLIGHT: usize = 1024;

/// How long the stream that had a run before may take to give up its place.
const GIVING_UP: Duration = Duration::from_secs(5);

/// What the connection brings.
#[derive(Debug)]
enum Input {
    /// A batch, and when it came.
    Batch(Box<proto::TelemetryBatch>, Instant),
    /// The client has said everything: the run is finished, which is the work of its call.
    End(Work),
    /// The client said something that it must not.
    Refused(Error),
}

/// Where batches go in.
#[derive(Debug)]
pub(crate) struct Intake {
    sender: mpsc::Sender<Input>,
    left: CancellationToken,
}

impl Intake {
    /// Takes a batch in, waiting for those before it; `false` when the receiver is gone.
    pub(crate) async fn batch(&self, batch: proto::TelemetryBatch) -> bool {
        self.sender.send(Input::Batch(Box::new(batch), Instant::now())).await.is_ok()
    }

    /// Ends the run, which is done when that is durable.
    pub(crate) async fn end(self, work: Work) {
        // A receiver that is gone has ended already.
        let _ = self.sender.send(Input::End(work)).await;
    }

    /// Ends the stream, not the run, with an error.
    pub(crate) async fn refuse(self, error: Error) {
        let _ = self.sender.send(Input::Refused(error)).await;
    }

    /// Waits until no stream of the run is read.
    pub(crate) async fn left(&self) {
        self.left.cancelled().await;
    }
}

/// A run that takes telemetry in: its messages, then at most one error.
#[derive(Debug)]
pub struct Ingestion {
    messages: mpsc::Receiver<proto::IngestResponse>,
    /// Why the thread ended, where it is not the client's own end.
    error: Arc<Mutex<Option<Error>>>,
    _left: DropGuard,
}

impl Stream for Ingestion {
    type Item = Result<proto::IngestResponse>;

    fn poll_next(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let polled = self.messages.poll_recv(cx);
        polled.map(|message| match message {
            Some(message) => Some(Ok(message)),
            None => self.error.lock().unwrap_or_else(PoisonError::into_inner).take().map(Err),
        })
    }
}

/// What ends the work on a run from outside. That the client left is no reason: its telemetry is silent then.
#[derive(Clone, Debug)]
pub(super) struct RunEnds {
    /// The job was cancelled or deleted.
    pub(super) job: CancellationToken,
    pub(super) job_name: String,
    /// The service is ending.
    pub(super) draining: CancellationToken,
}

impl RunEnds {
    /// Waits until the work has to end.
    pub(super) async fn reached(&self) -> Error {
        tokio::select! {
            () = self.job.cancelled() => Error::JobCancelled { job: self.job_name.clone() },
            () = self.draining.cancelled() => Error::Draining,
        }
    }
}

/// What work on a run needs.
pub(super) struct RunWork {
    pub(super) session: Session,
    /// Its place among the runs in progress, held as long as it goes on.
    pub(super) place: OwnedSemaphorePermit,
    pub(super) ends: RunEnds,
}

impl Engine {
    /// A place for a run that is to begin.
    ///
    /// # Errors
    /// [`Error::Overloaded`] when too many are in progress.
    pub(crate) fn run_place(&self) -> Result<OwnedSemaphorePermit> {
        self.inner.run_places.clone().try_acquire_owned().map_err(|_| self.too_many_runs())
    }

    /// The place for a run that was taken up: where there is none yet, that of the stream that had it before, which gives it up.
    ///
    /// # Errors
    /// [`Error::Overloaded`] when too many others are in progress.
    pub(crate) async fn place_or_given_up(&self, place: Option<OwnedSemaphorePermit>) -> Result<OwnedSemaphorePermit> {
        if let Some(place) = place {
            return Ok(place);
        }
        let given_up = timeout(GIVING_UP, self.inner.run_places.clone().acquire_owned()).await;
        given_up.ok().and_then(Result::ok).ok_or_else(|| self.too_many_runs())
    }

    fn too_many_runs(&self) -> Error {
        Error::Overloaded { what: "runs in progress", limit: self.inner.limits.concurrent_runs as u64 }
    }

    /// Begins work on a run that `guard` registers work on its job for, at its place among the runs in progress.
    ///
    /// # Errors
    /// Those of the store.
    pub(super) async fn work_on(
        &self,
        attached: &AttachedRun,
        sensor_time_ns: Option<u64>,
        guard: &JobGuard,
        place: OwnedSemaphorePermit,
    ) -> Result<RunWork> {
        let inner = &self.inner;
        let mut session = Session::new(inner.store.clone(), attached, sensor_time_ns, inner.commit_grid)?;
        session.record(attached).await?;
        let ends = RunEnds {
            job: guard.token().clone(),
            job_name: names::job(attached.run.job_id),
            draining: inner.draining.clone(),
        };
        Ok(RunWork { session, place, ends })
    }

    /// Takes in the telemetry of a run that `guard` registers work on its job for, and that the floor sees as `presence`. An intake that is dropped
    /// without its end leaves the run open.
    ///
    /// # Errors
    /// Those of the store.
    pub(crate) async fn ingest(
        &self,
        attached: &AttachedRun,
        sensor_time_ns: Option<u64>,
        guard: JobGuard,
        presence: Presence,
        place: OwnedSemaphorePermit,
    ) -> Result<(Intake, Ingestion)> {
        let inner = &self.inner;
        let RunWork { session, place, ends } = self.work_on(attached, sensor_time_ns, &guard, place).await?;
        let left = CancellationToken::new();
        let (sender, input) = mpsc::channel(BATCHES_IN_FLIGHT);
        let (outlet, messages) = mpsc::channel(MESSAGES_IN_FLIGHT);
        let error = Arc::new(Mutex::new(None));
        let told = error.clone();
        let (runtime, metrics) = (Handle::current(), inner.metrics.clone());
        let mut worker =
            Worker { session, presence, input, open: true, asked_to_end: None, outlet, ends, runtime, metrics };
        let active = GaugeGuard::new(&inner.metrics.active_runs);
        inner.tasks.spawn_blocking(move || {
            let _held = (place, active, guard);
            if let Err(error) = worker.run() {
                *told.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            }
        });
        let intake = Intake { sender, left: left.clone() };
        Ok((intake, Ingestion { messages, error, _left: left.drop_guard() }))
    }
}

/// Everything that the thread works with.
struct Worker {
    session: Session,
    presence: Presence,
    input: mpsc::Receiver<Input>,
    /// Whether more may come.
    open: bool,
    /// The call that asked for the end of the run.
    asked_to_end: Option<Work>,
    outlet: mpsc::Sender<proto::IngestResponse>,
    ends: RunEnds,
    runtime: Handle,
    metrics: Arc<Metrics>,
}

/// Why a waiting thread goes on.
enum Wake {
    /// Something came; `None`: the connection broke.
    Input(Option<Input>),
    Silence,
    Commit,
    /// The floor is to be told how things are.
    Show,
    /// Another client may have taken the run up.
    Doubt,
    Ended(Error),
}

impl Worker {
    fn run(&mut self) -> Result<()> {
        self.presence.arrive();
        let monitor = self.session.monitor();
        self.presence.observe(monitor);
        // What holds is known before anything is heard.
        let execution = Presence::execution_of(monitor);
        if matches!(execution, Execution::Stopped | Execution::Held) {
            self.presence.follow(execution);
        }
        self.presence.connect();
        let outcome = self.work();
        self.presence.leave(outcome.as_ref().err());
        outcome
    }

    fn work(&mut self) -> Result<()> {
        loop {
            let mut finished = false;
            let mut cause = None;
            let mut ended = None;
            let mut must_commit = false;
            match self.wait() {
                Wake::Input(Some(first)) => (finished, cause) = self.gather(first)?,
                Wake::Input(None) => {
                    // The log knows since when nobody is there.
                    (self.open, must_commit) = (false, true);
                }
                Wake::Silence => self.session.fall_silent()?,
                Wake::Commit | Wake::Show => {}
                // A commit fails where the run is another client's.
                Wake::Doubt => must_commit = true,
                Wake::Ended(error) => {
                    must_commit = matches!(error, Error::Draining);
                    ended = Some(error);
                }
            }
            // Silence counts on after the client has gone: its fallback is part of the log.
            let last = ended.is_some() || finished || (!self.open && self.session.silence_at().is_none());
            let commit_at = self.session.commit_at();
            if finished || must_commit || commit_at.is_some_and(|at| last || at <= Instant::now()) {
                self.commit(finished, cause)?;
            }
            if finished {
                if let Some(work) = self.asked_to_end.take() {
                    work.has_done();
                }
                self.presence.end(RunState::Finished, self.runtime.block_on(self.session.logged_at()));
            } else if must_commit && (!self.open || last) {
                self.presence.lose(self.runtime.block_on(self.session.logged_at()));
            }
            self.show();
            if last {
                return ended.map_or(Ok(()), Err);
            }
        }
    }

    /// Tells the floor, where it is time.
    fn show(&mut self) {
        if !self.presence.is_due() {
            return;
        }
        let monitor = self.session.monitor();
        self.metrics.showing(|| {
            self.presence.observe(monitor);
            if self.presence.execution() != Execution::Finished {
                self.presence.follow(Presence::execution_of(monitor));
            }
            self.presence.tell();
        });
    }

    fn wait(&mut self) -> Wake {
        if let Ok(input) = self.input.try_recv() {
            return Wake::Input(Some(input));
        }
        let (silence, commit) = (until(self.session.silence_at()), until(self.session.commit_at()));
        let show = until(self.presence.due());
        let (input, ends, open, doubt) = (&mut self.input, &self.ends, self.open, self.presence.doubt());
        self.runtime.block_on(async {
            tokio::select! {
                biased;
                error = ends.reached() => Wake::Ended(error),
                () = doubt.notified() => Wake::Doubt,
                input = input.recv(), if open => Wake::Input(input),
                () = silence => Wake::Silence,
                () = commit => Wake::Commit,
                () = show => Wake::Show,
            }
        })
    }

    /// Takes in what is there, up to a batch that causes a decision; whether it was the end, and when that batch came.
    fn gather(&mut self, first: Input) -> Result<(bool, Option<Instant>)> {
        let mut cause = None;
        let mut next = Some(first);
        for taken in 1.. {
            match next {
                Some(Input::Batch(batch, arrival)) => {
                    self.metrics.telemetry_samples.inc_by(batch.time_ns.len() as u64);
                    self.runtime.block_on(self.session.check_resume(&batch))?;
                    self.session.take(&batch, arrival, false)?;
                    self.presence.heard();
                    if !self.session.waiting_decisions().is_empty() {
                        // Nothing that came later is waited for.
                        cause = Some(arrival);
                        break;
                    }
                }
                Some(Input::End(work)) => {
                    self.asked_to_end = Some(work);
                    return Ok((true, cause));
                }
                Some(Input::Refused(error)) => return Err(error),
                None => break,
            }
            if taken == BATCHES_PER_GROUP {
                break;
            }
            next = self.input.try_recv().ok();
        }
        Ok((false, cause))
    }

    /// Makes everything durable and tells the client.
    fn commit(&mut self, finished: bool, cause: Option<Instant>) -> Result<()> {
        let end = finished.then(|| (RunState::Finished, String::new()));
        let besides = RunCommit { end, ..RunCommit::default() };
        let durable = self.runtime.block_on(self.session.commit(&self.metrics, besides))?;
        let decided = !durable.decisions.is_empty();
        self.metrics.showing(|| self.presence.decided(&durable.decisions));
        let decisions = durable.decisions.into_iter().map(Message::Decision);
        for message in decisions.chain(durable.ack.map(Message::Ack)) {
            let message = proto::IngestResponse { message: Some(message) };
            match self.outlet.try_send(message) {
                // A client that is gone gets it when it resumes the run.
                Ok(()) | Err(mpsc::error::TrySendError::Closed(_)) => {}
                Err(mpsc::error::TrySendError::Full(_)) => {
                    let message =
                        format!("{MESSAGES_IN_FLIGHT} messages were left unread; read decisions as they come");
                    return Err(Error::Precondition {
                        reason: "MESSAGES_UNREAD",
                        subject: self.ends.job_name.clone(),
                        message,
                    });
                }
            }
        }
        if let Some(cause) = cause.filter(|_| decided) {
            self.metrics.decision_seconds.observe(cause.elapsed().as_secs_f64());
        }
        Ok(())
    }
}
