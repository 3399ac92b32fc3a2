//! Generation of a stream of setpoints: from the nearest checkpoint to the end of the program, chunk by chunk, on
//! a blocking thread that waits whenever the reader does.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll};

use feedwave_contract::names;
use feedwave_contract::proto;
use feedwave_contract::stream::{Rows, StreamPlan, StreamStep, beyond_end_message, refusal_message};
use feedwave_cutting::{Pipeline, PipelineConfig};
use feedwave_store::{JobDetail, StoreError};
use futures_util::Stream;
use prometheus::IntCounter;
use tokio::runtime::Handle;
use tokio::sync::mpsc;
use tokio::time::Instant;
use tokio_util::sync::{CancellationToken, DropGuard};

use super::columns::ChunkWriter;
use super::source::Source;
use super::{Engine, JobGuard, checkpoint_set, until};
use crate::error::{Error, Result};
use crate::observability::metrics::GaugeGuard;

/// Chunks that wait between the generator and the connection. With the one being filled this is all that a stream
/// holds in memory.
const CHUNKS_IN_FLIGHT: usize = 2;

/// A running generator: its chunks, then at most one error. Dropping it ends the generator.
#[derive(Debug)]
pub struct Generator {
    chunks: mpsc::Receiver<Result<proto::SetpointChunk>>,
    /// Set once the last setpoint was handed over: a channel that closes without it was cut off.
    complete: Arc<AtomicBool>,
    ends: Ends,
    _left: DropGuard,
}

impl Stream for Generator {
    type Item = Result<proto::SetpointChunk>;

    fn poll_next(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        match self.chunks.poll_recv(cx) {
            Poll::Ready(None) if !self.complete.swap(true, Ordering::Relaxed) => {
                Poll::Ready(Some(Err(self.ends.reason())))
            }
            polled => polled,
        }
    }
}

/// Why a generator has to end before its last setpoint. The reader's side says the same to the client.
#[derive(Clone, Debug)]
struct Ends {
    /// The reader left.
    left: CancellationToken,
    /// The job was cancelled or deleted.
    job: CancellationToken,
    job_name: String,
    /// The service is ending.
    draining: CancellationToken,
    /// The deadline of the call.
    deadline: Option<Instant>,
}

impl Ends {
    fn reached(&self) -> bool {
        self.left.is_cancelled()
            || self.job.is_cancelled()
            || self.draining.is_cancelled()
            || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Why the generator ended early.
    fn reason(&self) -> Error {
        if self.job.is_cancelled() {
            Error::JobCancelled { job: self.job_name.clone() }
        } else if self.draining.is_cancelled() {
            Error::Draining
        } else if self.deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            Error::DeadlineExceeded
        } else {
            Error::internal(format!("the generator of {} failed", self.job_name))
        }
    }

    /// Waits until one of them is reached.
    async fn wait(&self) {
        tokio::select! {
            () = self.left.cancelled() => {}
            () = self.job.cancelled() => {}
            () = self.draining.cancelled() => {}
            () = until(self.deadline) => {}
        }
    }
}

/// The generator's end of the channel.
struct Outlet {
    sender: mpsc::Sender<Result<proto::SetpointChunk>>,
    ends: Ends,
    runtime: Handle,
}

impl Outlet {
    /// Hands a chunk over, waiting for the reader; `false` when the receiver is gone.
    fn send(&self, chunk: Result<proto::SetpointChunk>) -> bool {
        match self.sender.try_send(chunk) {
            Ok(()) => true,
            Err(mpsc::error::TrySendError::Closed(_)) => false,
            Err(mpsc::error::TrySendError::Full(chunk)) => self.runtime.block_on(async {
                tokio::select! {
                    sent = self.sender.send(chunk) => sent.is_ok(),
                    () = self.ends.wait() => false,
                }
            }),
        }
    }
}

impl Engine {
    /// Starts to generate a stream of a job that `guard` registers work on.
    ///
    /// # Errors
    /// [`Error::Overloaded`] when too many streams are open, and those of the store.
    pub async fn generate(
        &self,
        detail: &JobDetail,
        guard: JobGuard,
        plan: StreamPlan,
        deadline: Option<Instant>,
    ) -> Result<Generator> {
        let inner = &self.inner;
        let limit = inner.limits.concurrent_streams as u64;
        let overloaded = |_| Error::Overloaded { what: "open setpoint streams", limit };
        let place = inner.stream_places.clone().try_acquire_owned().map_err(overloaded)?;
        let ends = Ends {
            left: CancellationToken::new(),
            job: guard.token().clone(),
            job_name: names::job(detail.job.id),
            draining: inner.draining.clone(),
            deadline,
        };
        let complete = Arc::new(AtomicBool::new(false));
        let generator_ends = ends.clone();

        let config = Arc::new(plan.config.clone());
        let pipeline = self.pipeline_near(detail, config, plan.first_block_index()).await?;
        let source = self.job_source(detail)?;
        let (sender, chunks) = mpsc::channel(CHUNKS_IN_FLIGHT);
        let outlet = Outlet { sender, ends: generator_ends, runtime: Handle::current() };
        let (engine, id, runtime) = (self.clone(), detail.job.id, Handle::current());
        let metrics = &inner.metrics;
        let regenerated = metrics.regenerated_setpoints.clone();
        let rows = Rows::new(&plan, pipeline);
        let mut run = Run { rows, source, plan, regenerated, outlet };
        let active = (GaugeGuard::new(&metrics.active_streams), metrics.streams_by_tenant.enter(detail.job.tenant));
        let finished = complete.clone();
        inner.tasks.spawn_blocking(move || {
            let _held = (place, active, guard);
            let end = run.generate().unwrap_or_else(|error| {
                let error = runtime.block_on(engine.mark_damaged(id, error));
                // A reader that left does not need the error.
                run.outlet.send(Err(error));
                End::Last
            });
            finished.store(end == End::Last, Ordering::Relaxed);
        });
        let left = ends.left.clone().drop_guard();
        Ok(Generator { chunks, complete, ends, _left: left })
    }

    /// A pipeline at or before a setpoint, as near as a checkpoint allows.
    pub(super) async fn pipeline_near(
        &self,
        detail: &JobDetail,
        config: Arc<PipelineConfig>,
        index: u64,
    ) -> Result<Pipeline> {
        // Checkpoints are of the plan without overrides, which holds as far as the first of them.
        let index = config.overrides.first().map_or(index, |first| index.min(first.index));
        let plain = match config.overrides.is_empty() {
            true => config.clone(),
            false => Arc::new(PipelineConfig { overrides: Vec::new(), ..(*config).clone() }),
        };
        let set = checkpoint_set(detail.job.id, &config);
        let checkpoint = match self.inner.store.nearest_checkpoint(&set, index).await {
            Ok(Some(checkpoint)) => checkpoint,
            Ok(None) => return Ok(Pipeline::new(config)),
            Err(error @ StoreError::Corrupt { .. }) => {
                tracing::warn!(job = %detail.job.id, ?error, "damaged checkpoint: made anew");
                self.rebuild_checkpoints(detail);
                return Ok(Pipeline::new(config));
            }
            Err(error) => return Err(error.into()),
        };
        match Pipeline::restore(plain, &checkpoint.snapshot) {
            Ok(mut pipeline) => {
                // Several changes at one setpoint cannot be appended: rare, and only slower.
                let appended = config.overrides.iter().try_for_each(|change| pipeline.append_override(*change));
                Ok(if appended.is_ok() { pipeline } else { Pipeline::new(config) })
            }
            Err(error) => {
                // Derived data: without it the stream only begins later.
                let index = checkpoint.setpoint_index;
                tracing::warn!(job = %detail.job.id, index, %error, "unusable checkpoint: made anew");
                self.rebuild_checkpoints(detail);
                Ok(Pipeline::new(config))
            }
        }
    }
}

/// Everything that the blocking thread works with.
struct Run {
    rows: Rows,
    source: Source,
    plan: StreamPlan,
    /// Counts setpoints of the interpolation before the stream's start.
    regenerated: IntCounter,
    outlet: Outlet,
}

/// How a generator ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// Everything there is to say was said.
    Last,
    /// The receiver is gone.
    CutOff,
}

impl Run {
    /// Generates to the last setpoint, or until the receiver is gone.
    fn generate(&mut self) -> Result<End> {
        let plan = &self.plan;
        let mut writer = ChunkWriter::new(&plan.columns, plan.chunk_size, plan.first_index);
        while !self.outlet.ends.reached() {
            match self.rows.step() {
                StreamStep::NeedInput(place) => match self.source.read(place)? {
                    Some(bytes) => self.rows.push(&bytes),
                    None => self.rows.finish_input(),
                },
                StreamStep::Skipped(count) => self.regenerated.inc_by(count),
                StreamStep::Rows(block, rows) => {
                    if !writer.write(block, rows, |chunk| self.outlet.send(Ok(chunk))) {
                        return Ok(End::CutOff);
                    }
                }
                StreamStep::Finished(end) => {
                    if plan.first_index > end {
                        return Err(beyond_end(plan.first_index, end));
                    }
                    let sent = writer.finish().is_none_or(|chunk| self.outlet.send(Ok(chunk)));
                    return Ok(if sent { End::Last } else { End::CutOff });
                }
                StreamStep::Refused => return Err(self.refused()),
            }
        }
        Ok(End::CutOff)
    }

    /// The program is valid as the job has it, but not with what this stream asks for otherwise.
    fn refused(&self) -> Error {
        let message = refusal_message(self.rows.refusal());
        Error::Precondition { reason: "PROGRAM_REFUSED", subject: self.outlet.ends.job_name.clone(), message }
    }
}

/// A start beyond the end of the plan.
#[must_use]
pub(crate) fn beyond_end(first_index: u64, setpoint_count: u64) -> Error {
    Error::OutOfRange {
        reason: "START_BEYOND_END",
        message: beyond_end_message(first_index, setpoint_count),
        metadata: vec![("setpoint_count", setpoint_count.to_string())],
    }
}
