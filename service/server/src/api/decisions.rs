//! Decisions: listed, and watched as they become durable.

use std::collections::VecDeque;

use feedwave_contract::names;
use feedwave_contract::proto::{
    Decision, ListDecisionsRequest, ListDecisionsResponse, WatchDecisionsRequest, WatchDecisionsResponse,
};
use feedwave_store::{DecisionFilter, DecisionRecord};
use futures_util::{Stream, stream};
use tokio::sync::watch;

use super::{Api, LogPage, cursor, page_request};
use crate::engine::name_decision;
use crate::error::{Error, Result, Violations};
use crate::records::Records;
use crate::stored::decision_from_stored;

/// Decisions read together for a watcher.
const DECISION_PAGE: u32 = 100;

/// A stored decision.
///
/// # Errors
/// [`Error::Internal`] when it cannot be read.
pub(crate) fn decision_from_record(record: &DecisionRecord) -> Result<Decision> {
    let mut decision = decision_from_stored(record.body.clone()).map_err(Error::internal)?;
    name_decision(&mut decision, record);
    Ok(decision)
}

impl Api {
    /// Lists decisions.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn list_decisions(&self, request: ListDecisionsRequest) -> Result<ListDecisionsResponse> {
        let mut violations = Violations::default();
        let page = page_request(&mut violations, request.page_size, request.page_token);
        let filter = filter(&mut violations, &request.job, &request.run);
        violations.finish()?;
        let page = LogPage::new(page, "decisions", request.after, &[&request.job, &request.run])?;
        let records = self.store.decisions_after(page.after, &filter, page.limit()).await?;
        let (records, next_page_token) = page.cut(records, |record| record.sequence);
        let decisions = records.iter().map(decision_from_record).collect::<Result<_>>()?;
        Ok(ListDecisionsResponse { decisions, next_page_token })
    }

    /// Decisions from a cursor on, without end.
    ///
    /// # Errors
    /// As the contract says.
    pub fn watch_decisions(
        &self,
        request: &WatchDecisionsRequest,
    ) -> Result<impl Stream<Item = Result<WatchDecisionsResponse>> + Send + use<>> {
        let mut violations = Violations::default();
        let filter = filter(&mut violations, &request.job, &request.run);
        violations.finish()?;
        let newest = self.store.watch_decisions();
        let after = request.after.map_or_else(|| *newest.borrow(), cursor);
        let watch = DecisionWatch { store: self.store.clone(), newest, after, filter, read: VecDeque::new() };
        Ok(stream::try_unfold(watch, async |mut watch| {
            let decision = watch.next().await?;
            Ok(decision.map(|decision| (WatchDecisionsResponse { decision: Some(decision) }, watch)))
        }))
    }
}

fn filter(violations: &mut Violations, job: &str, run: &str) -> DecisionFilter {
    let job_id = if job.is_empty() { None } else { violations.check("job", names::parse_job(job)) };
    let run_id = if run.is_empty() { None } else { violations.check("run", names::parse_run(run)) };
    // Records are asked for the caller's tenant.
    DecisionFilter { tenant: None, run_id, job_id }
}

/// Reads decisions as they come.
struct DecisionWatch {
    store: Records,
    newest: watch::Receiver<i64>,
    after: i64,
    filter: DecisionFilter,
    read: VecDeque<Decision>,
}

impl DecisionWatch {
    /// The next decision; `None` when the store was closed.
    async fn next(&mut self) -> Result<Option<Decision>> {
        loop {
            if let Some(decision) = self.read.pop_front() {
                return Ok(Some(decision));
            }
            let newest = *self.newest.borrow_and_update();
            if newest > self.after {
                let records = self.store.decisions_after(self.after, &self.filter, DECISION_PAGE).await?;
                // Decisions of other runs are passed over; a full page may not reach the newest one.
                let last = records.last().map_or(newest, |record| record.sequence);
                self.after = if records.len() < DECISION_PAGE as usize { last.max(newest) } else { last };
                self.read = records.iter().map(decision_from_record).collect::<Result<_>>()?;
            } else if self.newest.changed().await.is_err() {
                return Ok(None);
            }
        }
    }
}
