//! The actions of a program for a client: read on a blocking thread that waits whenever the reader does.

use std::pin::Pin;
use std::task::{Context, Poll};

use feedwave_contract::convert::{action_to_proto, finding_to_proto};
use feedwave_contract::proto;
use feedwave_cutting::{Interpretation, InterpretationStep, PipelineConfig};
use feedwave_store::Tenant;
use futures_util::Stream;
use tokio::runtime::Handle;
use tokio::sync::mpsc;
use tokio_util::sync::{CancellationToken, DropGuard};

use super::{Engine, Source};
use crate::error::{Error, Result};
use crate::observability::metrics::GaugeGuard;

/// Messages that wait between the interpreter and the connection.
const MESSAGES_IN_FLIGHT: usize = 2;

/// The messages of an interpretation. Dropping it ends the work.
#[derive(Debug)]
pub struct Actions {
    messages: mpsc::Receiver<Result<proto::InterpretResponse>>,
    /// The last message, or an error, was received: a channel that closes before was cut off.
    complete: bool,
    _left: DropGuard,
}

impl Stream for Actions {
    type Item = Result<proto::InterpretResponse>;

    fn poll_next(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let polled = self.messages.poll_recv(cx);
        match &polled {
            Poll::Ready(Some(Ok(message))) => self.complete = message.complete,
            Poll::Ready(Some(Err(_))) => self.complete = true,
            Poll::Ready(None) if !self.complete => {
                self.complete = true;
                return Poll::Ready(Some(Err(Error::internal("the interpretation was cut off"))));
            }
            _ => {}
        }
        polled
    }
}

impl Engine {
    /// Begins to interpret a program for a tenant.
    ///
    /// # Errors
    /// [`Error::Overloaded`] when too many streams are open: those of setpoints and of actions count together.
    pub fn interpret(&self, tenant: Tenant, config: PipelineConfig, source: Source) -> Result<Actions> {
        let inner = &self.inner;
        let limit = inner.limits.concurrent_streams as u64;
        let overloaded = |_| Error::Overloaded { what: "open streams", limit };
        let place = inner.stream_places.clone().try_acquire_owned().map_err(overloaded)?;
        let left = CancellationToken::new();
        let (sender, messages) = mpsc::channel(MESSAGES_IN_FLIGHT);
        let (token, draining, runtime) = (left.clone(), inner.draining.clone(), Handle::current());
        let metrics = &inner.metrics;
        let active = (GaugeGuard::new(&metrics.active_streams), metrics.streams_by_tenant.enter(tenant));
        inner.tasks.spawn_blocking(move || {
            let _held = (place, active);
            let ended = || token.is_cancelled() || draining.is_cancelled();
            let send = |message| {
                runtime.block_on(async {
                    tokio::select! {
                        sent = sender.send(message) => sent.is_ok(),
                        () = token.cancelled() => false,
                        () = draining.cancelled() => false,
                    }
                })
            };
            if let Err(error) = run(&config, &source, ended, |message| send(Ok(message))) {
                send(Err(error));
            }
        });
        Ok(Actions { messages, complete: false, _left: left.drop_guard() })
    }
}

/// Reads a program to its end, or until `ended` says so or a message cannot be handed over.
fn run(
    config: &PipelineConfig,
    source: &Source,
    ended: impl Fn() -> bool,
    send: impl Fn(proto::InterpretResponse) -> bool,
) -> Result<()> {
    let mut interpretation = Interpretation::new(config);
    while !ended() {
        let step = interpretation.step();
        let operations = interpretation.take_operations();
        let actions: Vec<_> = operations.map(|operation| action_to_proto(&operation, &config.programs)).collect();
        if !actions.is_empty() && !send(proto::InterpretResponse { actions, ..Default::default() }) {
            return Ok(());
        }
        match step {
            InterpretationStep::More => {}
            InterpretationStep::NeedInput(place) => match source.read(place)? {
                Some(bytes) => interpretation.push(&bytes),
                None => interpretation.finish_input(),
            },
            InterpretationStep::Ended => {
                let found = interpretation.into_findings().into_sorted();
                let findings = found.iter().map(|finding| finding_to_proto(finding, &config.programs)).collect();
                send(proto::InterpretResponse { findings, complete: true, ..Default::default() });
                return Ok(());
            }
        }
    }
    Ok(())
}
