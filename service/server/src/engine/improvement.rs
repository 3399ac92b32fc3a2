//! A better program for a client: computed in turns, as validations are.

use std::borrow::Cow;
use std::sync::Arc;

use bytes::Bytes;
use feedwave_contract::convert::improvement_to_proto;
use feedwave_contract::proto::ImproveResponse;
use feedwave_cutting::{ImprovementGoals, MAX_IMPROVED_BYTES, PipelineConfig, Surroundings, improve};
use feedwave_program::Place;
use feedwave_store::Tenant;
use futures_util::{Stream, TryStreamExt as _, stream};
use tokio_util::sync::CancellationToken;

use super::turns::{Next, Turn};
use super::{Engine, Source};
use crate::error::{Error, Result};
use crate::observability::metrics::GaugeGuard;

/// Bytes of the program in one message of the answer.
const PIECE_BYTES: usize = 1 << 20;

/// Why an improvement does not go on.
enum Interrupted {
    /// Its client or the service is gone.
    Stopped,
    /// It is to begin again later.
    SetAside,
    /// Its program cannot be read.
    Failed(Error),
}

impl From<Error> for Interrupted {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

/// The rest of a program and the turn of one improvement.
struct InTurn {
    turn: Turn,
    source: Source,
    token: CancellationToken,
}

impl Surroundings for InTurn {
    type Error = Interrupted;

    fn further(&mut self, place: Place) -> Result<Cow<'_, [u8]>, Interrupted> {
        let bytes = self.source.read(place)?;
        Ok(Cow::Owned(bytes.map_or_else(Vec::new, |bytes| bytes.to_vec())))
    }

    fn step(&mut self) -> Result<(), Interrupted> {
        if !self.token.is_cancelled() && self.turn.is_over() && self.turn.rest() == Next::SetAside {
            return Err(Interrupted::SetAside);
        }
        if self.token.is_cancelled() { Err(Interrupted::Stopped) } else { Ok(()) }
    }
}

impl InTurn {
    /// The whole program.
    fn program(&self) -> Result<Vec<u8>, Interrupted> {
        let mut program = Vec::new();
        let mut place = Place { program: 0, offset: 0 };
        while let Some(bytes) = self.source.read(place)? {
            program.extend_from_slice(&bytes);
            place.offset = program.len() as u64;
            if place.offset > MAX_IMPROVED_BYTES {
                return Err(Error::internal("a program is longer than it was").into());
            }
        }
        Ok(program)
    }
}

/// The messages of an answer.
type Messages = Vec<Result<ImproveResponse>>;

impl Engine {
    /// Improves a program of `program_bytes` bytes for `client`: the messages of the answer. Nothing is stored; it has turns as
    /// validations have. Dropping the stream ends the work.
    ///
    /// # Errors
    /// [`Error::Overloaded`] when too many streams are open: those of setpoints, of actions and these count together.
    pub fn improve(
        &self,
        tenant: Tenant,
        client: &str,
        config: PipelineConfig,
        program_bytes: u64,
        source: Source,
        goals: ImprovementGoals,
    ) -> Result<impl Stream<Item = Result<ImproveResponse>> + Send + use<>> {
        let inner = &self.inner;
        let limit = inner.limits.concurrent_streams as u64;
        let overloaded = |_| Error::Overloaded { what: "open streams", limit };
        let place = inner.stream_places.clone().try_acquire_owned().map_err(overloaded)?;
        let metrics = &inner.metrics;
        let held = (place, GaugeGuard::new(&metrics.active_streams), metrics.streams_by_tenant.enter(tenant));
        let (engine, client, config) = (self.clone(), client.to_owned(), Arc::new(config));
        let messages = async move {
            let mut times = 0;
            let messages = loop {
                let turn = engine.inner.turns.request(&client, program_bytes, times).await.ok_or(Error::Draining)?;
                match engine.improve_in_turns(turn, config.clone(), source.clone(), goals.clone()).await? {
                    Ok(messages) => break messages,
                    Err(Interrupted::Stopped) => return Err(Error::Draining),
                    Err(Interrupted::SetAside) => times += 1,
                    Err(Interrupted::Failed(error)) => return Err(error),
                }
            };
            let held = Arc::new(held);
            Ok(stream::iter(messages).inspect_ok(move |_| {
                let _ = &held;
            }))
        };
        Ok(stream::once(messages).try_flatten())
    }

    async fn improve_in_turns(
        &self,
        turn: Turn,
        config: Arc<PipelineConfig>,
        source: Source,
        goals: ImprovementGoals,
    ) -> Result<Result<Messages, Interrupted>> {
        let token = self.inner.draining.child_token();
        let cancel_when_dropped = token.clone().drop_guard();
        let active = GaugeGuard::new(&self.inner.metrics.active_validations);
        let run = self.inner.tasks.spawn_blocking(move || {
            let _active = active;
            let mut in_turn = InTurn { turn, source, token };
            in_turn.turn.start();
            let program = in_turn.program()?;
            let improvement = improve(&program, &config, &goals, &mut in_turn)?;
            let first = ImproveResponse {
                improvement: Some(improvement_to_proto(&improvement, &goals)),
                ..ImproveResponse::default()
            };
            let improved = Bytes::from(improvement.program);
            let pieces = (0..improved.len()).step_by(PIECE_BYTES).map(|from| {
                let data = improved.slice(from..improved.len().min(from + PIECE_BYTES));
                Ok(ImproveResponse { improvement: None, offset: from as u64, data })
            });
            Ok(std::iter::once(Ok(first)).chain(pieces).collect())
        });
        let outcome = run.await.map_err(Error::internal)?;
        drop(cancel_when_dropped);
        Ok(outcome)
    }
}
