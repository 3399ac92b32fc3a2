//! Replay: decisions made again from their inputs, setpoints generated again from the log, both compared.

use std::ops::Range;

use feedwave_contract::convert::decision_from_proto;
use feedwave_contract::proto;
use feedwave_cutting::PipelineConfig;
use feedwave_monitoring::{Overrides, decide};
use feedwave_store::{DecisionFilter, JobDetail, MAX_DECISIONS, Run, RunMark, RunOverride, Store};
use proto::ReplayRunResponse;
use tokio::sync::OwnedSemaphorePermit;

use super::feed::{Cause, Feed};
use super::setpoints::{Next, Setpoints};
use crate::engine::{Engine, beyond_end};
use crate::error::{Error, Result, Violations};
use crate::stored::decision_from_record;
use feedwave_contract::stream::ColumnSet;

/// Differences reported at most.
const MAX_DIFFERENCES: usize = 100;

/// Collects what differs.
#[derive(Default)]
struct Differences(Vec<String>);

impl Differences {
    fn require(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds && self.0.len() < MAX_DIFFERENCES {
            self.0.push(what());
        }
    }
}

impl Engine {
    /// Replays a run; a live one with the configuration that its pipeline had, from the nearest checkpoint at or before
    /// `start_index` on.
    ///
    /// # Errors
    /// [`Error::Overloaded`] when too many streams are open, and those of the store.
    pub(crate) async fn replay(
        &self,
        detail: &JobDetail,
        run: Run,
        config: Option<PipelineConfig>,
        start_index: u64,
    ) -> Result<ReplayRunResponse> {
        let inner = &self.inner;
        let limit = inner.limits.concurrent_streams as u64;
        let overloaded = |_| Error::Overloaded { what: "open setpoint streams", limit };
        let place = inner.stream_places.clone().try_acquire_owned().map_err(overloaded)?;
        let mut differences = Differences::default();
        let overrides = inner.store.run_overrides(run.id).await?;
        let (decisions, decided) = decide_again(&inner.store, &run, &mut differences).await?;
        check_changes(&overrides, &decided, &mut differences)?;
        let stored_digest = run.setpoints.digest.filter(|_| config.is_some());
        let mut response = ReplayRunResponse {
            decision_count: decisions,
            stored_digest: stored_digest.map_or_else(String::new, hex),
            ..ReplayRunResponse::default()
        };
        if let Some(config) = config {
            let again = self.generate_again(detail, &run, config, &overrides, start_index, place).await?;
            let Generated { first, count, digest, differs } = again;
            if let Some(Range { start, end }) = differs {
                differences.require(false, || {
                    format!("the setpoints from {start} to {} are not those that were sent", end - 1)
                });
            }
            differences.require(count == run.setpoints.sent, || {
                format!("{count} setpoints came out, {} were sent", run.setpoints.sent)
            });
            differences.require(stored_digest.is_none_or(|stored| stored == digest), || {
                format!("the digest of the first {count} setpoints differs")
            });
            response.first_index = first;
            response.setpoint_count = count.saturating_sub(first);
            response.digest = hex(digest);
        }
        response.identical = differences.0.is_empty();
        response.differences = differences.0;
        Ok(response)
    }

    /// Generates again what was sent of a run, from the nearest checkpoint at or before `start_index` on.
    async fn generate_again(
        &self,
        detail: &JobDetail,
        run: &Run,
        config: PipelineConfig,
        overrides: &[RunOverride],
        start_index: u64,
        place: OwnedSemaphorePermit,
    ) -> Result<Generated> {
        let inner = &self.inner;
        let mut violations = Violations::default();
        let machine = &config.profile.machine;
        let columns = ColumnSet::select(&mut violations, &[], machine, false, false, proto::Encoding::PackedDouble);
        let sent = run.setpoints.sent;
        if start_index > sent {
            return Err(beyond_end(start_index, sent));
        }
        let feed = Feed::new(overrides)?;
        let changes = feed.changes();
        let spindle_changes = config.spindle_changes.is_some().then(|| feed.spindle_changes()).transpose()?;
        let config = PipelineConfig { spindle_changes, ..config };
        let start = self.run_near(run.id, &config, &changes, start_index).await?;
        let first = start.pipeline.next_index();
        let marks = inner.store.run_marks(run.id).await?;
        let marks = marks.into_iter().filter(|mark| (first + 1..=sent).contains(&mark.setpoint_index)).collect();
        let setpoints = Setpoints::new(start, self.job_source(detail)?, columns, sent);
        // Given up, it ends as well.
        let stop = inner.draining.child_token();
        let _given_up = stop.clone().drop_guard();
        let generated = inner.tasks.spawn_blocking(move || {
            let _place = place;
            generate(setpoints, marks, sent, || stop.is_cancelled())
        });
        generated.await.map_err(Error::internal)?
    }
}

fn hex(digest: [u8; 32]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Setpoints that came out again.
struct Generated {
    /// Index of the first one.
    first: u64,
    /// Index behind the last one.
    count: u64,
    /// Digest of all before it.
    digest: [u8; 32],
    /// The setpoints between two running digests of the run of which the second was not met first.
    differs: Option<Range<u64>>,
}

/// Generates the setpoints before `count`, and compares their running digest with those that the run has.
fn generate(
    mut setpoints: Setpoints,
    marks: Vec<RunMark>,
    count: u64,
    cancelled: impl Fn() -> bool,
) -> Result<Generated> {
    let mut differs = None;
    let first = setpoints.next_index();
    let mut proved = first;
    let mut marks = marks.into_iter().peekable();
    while setpoints.next_index() < count {
        if cancelled() {
            return Err(Error::Draining);
        }
        setpoints.generate_to(marks.peek().map_or(count, |mark| mark.setpoint_index));
        if matches!(setpoints.next(count)?, Next::End) {
            break;
        }
        let next = setpoints.next_index();
        if let Some(mark) = marks.next_if(|mark| mark.setpoint_index == next) {
            if mark.digest_state != setpoints.digest_state() {
                differs = differs.or(Some(proved..next));
            }
            proved = next;
        }
    }
    Ok(Generated { first, count: setpoints.next_index(), digest: setpoints.digest(), differs })
}

/// Makes every decision again; how many there were, and the overrides after each.
async fn decide_again(store: &Store, run: &Run, differences: &mut Differences) -> Result<(u64, Vec<Overrides>)> {
    let filter = DecisionFilter { run_id: Some(run.id), ..DecisionFilter::default() };
    let mut made: Vec<Overrides> = Vec::new();
    let unknown = Overrides { feed: f64::NAN, spindle: f64::NAN };
    let mut after = 0;
    loop {
        let records = store.decisions_after(after, &filter, MAX_DECISIONS).await?;
        let Some(last) = records.last() else { return Ok((made.len() as u64, made)) };
        after = last.sequence;
        for record in &records {
            let number = made.len() as u64;
            differences.require(record.number == number, || format!("decision {number} is missing"));
            let decision = decision_from_record(record)?;
            let decided = decision_from_proto(&decision);
            differences.require(decided.as_ref().is_some_and(|(inputs, outcome)| decide(inputs) == *outcome), || {
                format!("decision {} does not follow from its inputs", record.number)
            });
            made.push(decided.map_or(unknown, |(_, outcome)| outcome.after));
        }
    }
}

/// Compares the changes of the feed with the decisions that brought them.
fn check_changes(overrides: &[RunOverride], decided: &[Overrides], differences: &mut Differences) -> Result<()> {
    let after = |number: u64| usize::try_from(number).ok().and_then(|number| decided.get(number).copied());
    let is_decided = |ratio| decided.iter().any(|overrides| overrides.feed == ratio);
    for change in overrides {
        let expected = match change.cause.parse()? {
            Cause::Hold | Cause::Stop(_) | Cause::Abort => Some(0.0),
            Cause::Decision(number) | Cause::Escalation(number) => after(number).map(|overrides| overrides.feed),
            Cause::Spindle(number, spindle) => {
                differences.require(after(number).is_some_and(|overrides| overrides.spindle == spindle.ratio), || {
                    format!(
                        "the spindle at setpoint {} has an override of {}, not what decision {number} says",
                        spindle.index, spindle.ratio
                    )
                });
                // Held, or the feed decided last.
                (change.ratio == 0.0 || is_decided(change.ratio)).then_some(change.ratio)
            }
            // The feed decided last; which decision that was, the log does not say.
            Cause::Resume => (change.ratio == 1.0 || is_decided(change.ratio)).then_some(change.ratio),
        };
        differences.require(expected == Some(change.ratio), || {
            format!(
                "the feed at setpoint {} is {}, not what {} asks for",
                change.setpoint_index, change.ratio, change.cause
            )
        });
    }
    Ok(())
}
