//! State changes of jobs: listed, and watched as they happen.

mod recent;

use std::collections::VecDeque;
use std::sync::Arc;

use feedwave_contract::convert::timestamp;
use feedwave_contract::proto::{
    JobEvent, ListJobEventsRequest, ListJobEventsResponse, WatchJobsRequest, WatchJobsResponse,
};
use feedwave_contract::{names, proto};
use feedwave_store::{EventFilter, JobEvent as EventRecord, JobState};
use futures_util::{Stream, stream};
use tokio::sync::watch;
use uuid::Uuid;

use super::jobs::state_to_proto;
use super::{Api, LogPage, cursor, page_request};
use crate::error::{Result, Violations};
use crate::records::Records;

pub(crate) use recent::RecentEvents;

/// Events read together for a watcher.
const EVENT_PAGE: u32 = 500;

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
        let newest = self.store.watch_events();
        let after = request.after.map_or_else(|| *newest.borrow(), cursor);
        let watch = EventWatch {
            store: self.store.clone(),
            recent: self.recent_events.clone(),
            newest,
            after,
            filter: EventFilter { tenant: Some(self.caller.tenant()), job_id: job },
            read: VecDeque::new(),
        };
        Ok(stream::try_unfold(watch, async |mut watch| {
            let event = watch.next().await?;
            Ok(event.map(|event| (WatchJobsResponse { event: Some(event) }, watch)))
        }))
    }
}

fn event_filter(violations: &mut Violations, job: &str) -> Option<Uuid> {
    if job.is_empty() { None } else { violations.check("job", names::parse_job(job)) }
}

/// Reads events as they come.
struct EventWatch {
    store: Records,
    recent: Arc<RecentEvents>,
    newest: watch::Receiver<i64>,
    after: i64,
    filter: EventFilter,
    read: VecDeque<JobEvent>,
}

impl EventWatch {
    /// The next event; `None` when the store was closed.
    async fn next(&mut self) -> Result<Option<JobEvent>> {
        loop {
            if let Some(event) = self.read.pop_front() {
                return Ok(Some(event));
            }
            let newest = *self.newest.borrow_and_update();
            if newest > self.after {
                let limit = EVENT_PAGE as usize;
                if let Some(found) =
                    self.recent.after(self.store.of_all_tenants(), self.after, newest, &self.filter, limit).await?
                {
                    self.after = found.to.max(self.after);
                    self.read.extend(found.events.iter().map(event_to_proto));
                    continue;
                }
                let events = self.store.events_after(self.after, self.filter.job_id, EVENT_PAGE).await?;
                // Events of other jobs are passed over; a full page may not reach the newest one.
                let last = events.last().map_or(newest, |event| event.sequence);
                self.after = if events.len() < EVENT_PAGE as usize { last.max(newest) } else { last };
                self.read.extend(events.iter().map(event_to_proto));
            } else if self.newest.changed().await.is_err() {
                return Ok(None);
            }
        }
    }
}
