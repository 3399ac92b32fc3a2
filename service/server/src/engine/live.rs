//! A live run: a thread hands setpoints out as far as the client gives credit, judges telemetry as it comes, and lets
//! every decision change the feed of what is not handed out yet.
//!
//! Invariants: a change of the feed is durable before a setpoint under it is handed out, and setpoints are a function of
//! program, profile and the changes alone; so any setpoint can be had again, and a replay gives the same bits.

mod checkpoint;
mod feed;
mod handed_out;
mod receipts;
mod replay;
mod setpoints;
mod spindle;
mod view;
mod worker;

use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Instant;

use feed::Feed;
use feedwave_cutting::{OverrideChange, PipelineConfig};
use feedwave_store::{AttachedRun, JobDetail, RunSetpoints};
use futures_util::Stream;
use tokio::runtime::Handle;
use tokio::sync::{OwnedSemaphorePermit, mpsc};
use tokio_util::sync::{CancellationToken, DropGuard};
use uuid::Uuid;

use super::telemetry::RunWork;
use super::{Engine, JobGuard};
use crate::error::{Error, Result};
use crate::floor::Presence;
use crate::observability::metrics::GaugeGuard;
pub(crate) use feed::feed_change_to_proto;
use feedwave_contract::proto;
use feedwave_contract::stream::ColumnSet;
pub(crate) use handed_out::HandedOut;
use proto::run_response::Message;
use receipts::Receipts;
use setpoints::Setpoints;
use spindle::Gate;
use view::LiveView;
use worker::Worker;

/// Inputs that wait for the thread; a client that is faster waits then.
const INPUTS_IN_FLIGHT: usize = 8;
/// Chunks that wait for the connection: what is in here is handed out and changes no more.
const CHUNKS_IN_FLIGHT: usize = 2;
/// Other messages that wait for the connection. A client that leaves more unread is not listening to decisions.
const MESSAGES_IN_FLIGHT: usize = 1024;

/// What the client says.
#[derive(Debug)]
pub(crate) enum LiveInput {
    /// Telemetry, and when it came.
    Batch(Box<proto::TelemetryBatch>, Instant),
    /// Setpoints before this index may be handed out.
    Credit(u64),
    /// So many setpoints were taken.
    Receipt(u64),
    /// The operator's wish.
    Command(proto::RunCommandKind),
    /// Something that it must not say.
    Refused(Error),
}

/// What a live run is to do, checked.
#[derive(Debug)]
pub(crate) struct LivePlan {
    /// Configuration of the pipeline, without changes of the feed.
    pub(crate) config: PipelineConfig,
    /// Columns and their encoding.
    pub(crate) columns: ColumnSet,
    /// First setpoint to hand out.
    pub(crate) first_index: u64,
    /// Time of the sensors' clock now, ns.
    pub(crate) sensor_time_ns: Option<u64>,
}

/// Where the client's words go in.
#[derive(Debug)]
pub(crate) struct LiveIntake {
    sender: mpsc::Sender<LiveInput>,
    left: CancellationToken,
}

impl LiveIntake {
    /// Takes something in, waiting for what came before; `false` when the receiver is gone.
    pub(crate) async fn take(&self, input: LiveInput) -> bool {
        self.sender.send(input).await.is_ok()
    }

    /// Waits until no stream of the run is read.
    pub(crate) async fn left(&self) {
        self.left.cancelled().await;
    }
}

/// What goes out: everything in the order in which it was said.
#[derive(Debug)]
struct Outgoing {
    message: Message,
    /// The place of a chunk among [`CHUNKS_IN_FLIGHT`].
    _place: Option<OwnedSemaphorePermit>,
}

/// A live run: its messages, then at most one error.
#[derive(Debug)]
pub struct LiveRun {
    outgoing: mpsc::Receiver<Outgoing>,
    error: Arc<Mutex<Option<Error>>>,
    _left: DropGuard,
}

impl Stream for LiveRun {
    type Item = Result<proto::RunResponse>;

    fn poll_next(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.outgoing.poll_recv(cx).map(|outgoing| match outgoing {
            Some(outgoing) => Some(Ok(proto::RunResponse { message: Some(outgoing.message) })),
            None => self.error.lock().unwrap_or_else(PoisonError::into_inner).take().map(Err),
        })
    }
}

impl Engine {
    /// Goes on with a live run that `guard` registers work on its job for, and that the floor sees as `presence`.
    ///
    /// # Errors
    /// Those of the store.
    pub(crate) async fn drive(
        &self,
        detail: &JobDetail,
        attached: &AttachedRun,
        plan: LivePlan,
        guard: JobGuard,
        presence: Presence,
        place: OwnedSemaphorePermit,
    ) -> Result<(LiveIntake, LiveRun)> {
        let inner = &self.inner;
        let RunWork { session, place, ends } = self.work_on(attached, plan.sensor_time_ns, &guard, place).await?;
        let feed = Feed::new(&attached.overrides)?;
        let view = LiveView::new(presence, &plan.config, inner.metrics.clone());
        let first_index = plan.first_index;
        let mut plan = plan;
        if plan.config.spindle_changes.is_some() {
            plan.config.spindle_changes = Some(feed.spindle_changes()?);
        }
        let mut generator = self.generator(detail, attached.run.id, plan, &feed.changes()).await?;
        let RunSetpoints { received, sent, digest } = attached.run.setpoints;
        if let Some(digest) = digest {
            generator = generator.expecting(sent, digest);
        }
        let (sender, input) = mpsc::channel(INPUTS_IN_FLIGHT);
        let (outlet, outgoing) = mpsc::channel(MESSAGES_IN_FLIGHT);
        let error = Arc::new(Mutex::new(None));
        let told = error.clone();
        let (runtime, metrics) = (Handle::current(), inner.metrics.clone());
        // The client says that it has the setpoints before the first that it asks for.
        let receipts = Receipts::new(received.max(first_index), inner.limits.receipt_patience());
        let gate = Gate::new(inner.limits.receipt_patience());
        let handed_out = inner.handed_out.of_run(attached, first_index);
        let mut worker = Worker::new(
            session, generator, feed, gate, view, receipts, input, outlet, ends, runtime, metrics, handed_out,
        );
        let active = GaugeGuard::new(&inner.metrics.active_runs);
        inner.tasks.spawn_blocking(move || {
            let _held = (place, active, guard);
            if let Err(error) = worker.run() {
                *told.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            }
        });
        let left = CancellationToken::new();
        let intake = LiveIntake { sender, left: left.clone() };
        Ok((intake, LiveRun { outgoing, error, _left: left.drop_guard() }))
    }

    /// The setpoints of a run, from the nearest checkpoint before the first one to hand out. Call inside a runtime.
    async fn generator(
        &self,
        detail: &JobDetail,
        run: Uuid,
        plan: LivePlan,
        changes: &[OverrideChange],
    ) -> Result<Setpoints> {
        // One setpoint at least is generated: whether the path rests there decides whether a run that was given up has ended.
        let before = plan.first_index.saturating_sub(1);
        let start = self.run_near(run, &plan.config, changes, before).await?;
        Ok(Setpoints::new(start, self.job_source(detail)?, plan.columns, plan.first_index))
    }
}
