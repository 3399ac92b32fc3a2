//! State changes of jobs: listed, and watched as they happen.

use feedwave_contract::convert::timestamp;
use feedwave_contract::proto::{
    JobEvent, ListJobEventsRequest, ListJobEventsResponse, WatchJobsRequest, WatchJobsResponse,
};
use feedwave_contract::{names, proto};
use feedwave_store::{EventFilter, JobEvent as EventRecord, JobState, Store};
use futures_util::{Stream, TryStreamExt as _};
use tokio::sync::watch;
use uuid::Uuid;

use super::jobs::state_to_proto;
use super::log::{Entry, Log, LogFilter, LogWatch, Stored};
use super::{Api, LogPage, cursor, page_request};
use crate::error::{Result, Violations};

/// The log of state changes.
#[derive(Debug)]
pub(crate) struct EventLog;

impl Log for EventLog {
    type Message = JobEvent;

    const RECORDS: &'static str = "state changes of jobs";

    fn newest(store: &Store) -> watch::Receiver<i64> {
        store.watch_events()
    }

    async fn read(store: &Store, after: i64, filter: LogFilter, limit: u32) -> Result<Vec<Stored<JobEvent>>> {
        let wanted = EventFilter { tenant: filter.tenant, job_id: filter.job };
        let events = store.events_after(after, &wanted, limit).await?;
        let entry = |event: &EventRecord| {
            let of = LogFilter { tenant: Some(event.tenant), job: Some(event.job_id), run: None };
            Stored { sequence: event.sequence, entry: Ok(Entry::new(event.sequence, of, event_to_proto(event))) }
        };
        Ok(events.iter().map(entry).collect())
    }
}

fn event_to_proto(event: &EventRecord) -> JobEvent {
    let state = |state: Option<JobState>| state.map_or(proto::JobState::Unspecified, state_to_proto).into();
    JobEvent {
        sequence: event.sequence.unsigned_abs(),
        job: names::job(event.job_id),
        previous_state: state(event.from_state),
        state: state(event.to_state),
        time: Some(timestamp(event.at_us)),
        message: event.detail.clone(),
    }
}

impl Api {
    /// Lists state changes of jobs.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn list_job_events(&self, request: ListJobEventsRequest) -> Result<ListJobEventsResponse> {
        let mut violations = Violations::default();
        let page = page_request(&mut violations, request.page_size, request.page_token);
        let job = event_filter(&mut violations, &request.job);
        violations.finish()?;
        let page = LogPage::new(page, "events", request.after, &[&request.job])?;
        let events = self.store.events_after(page.after, job, page.limit()).await?;
        let (events, next_page_token) = page.cut(events, |event| event.sequence);
        Ok(ListJobEventsResponse { events: events.iter().map(event_to_proto).collect(), next_page_token })
    }

    /// State changes from a cursor on, without end.
    ///
    /// # Errors
    /// As the contract says.
    pub fn watch_events(
        &self,
        request: &WatchJobsRequest,
    ) -> Result<impl Stream<Item = Result<WatchJobsResponse>> + Send + use<>> {
        let mut violations = Violations::default();
        let job = event_filter(&mut violations, &request.job);
        violations.finish()?;
        let filter = LogFilter { tenant: Some(self.caller.tenant()), job, run: None };
        let watch = LogWatch::new(self.store.of_all_tenants(), &self.recent_events, request.after.map(cursor), filter);
        Ok(watch.messages().map_ok(|event| WatchJobsResponse { event: Some(event) }))
    }
}

fn event_filter(violations: &mut Violations, job: &str) -> Option<Uuid> {
    if job.is_empty() { None } else { violations.check("job", names::parse_job(job)) }
}
