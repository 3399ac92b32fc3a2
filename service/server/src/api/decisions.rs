//! Decisions: listed, and watched as they become durable.

use feedwave_contract::names;
use feedwave_contract::proto::{
    Decision, ListDecisionsRequest, ListDecisionsResponse, WatchDecisionsRequest, WatchDecisionsResponse,
};
use feedwave_store::{DecisionFilter, DecisionRecord, Store};
use futures_util::{Stream, TryStreamExt as _};
use tokio::sync::watch;

use super::log::{Entry, Log, LogFilter, LogWatch, Stored};
use super::{Api, LogPage, cursor, page_request};
use crate::error::{Result, Violations};
use crate::stored::decision_from_record;

/// The log of decisions.
#[derive(Debug)]
pub(crate) struct DecisionLog;

impl Log for DecisionLog {
    type Message = Decision;

    const RECORDS: &'static str = "decisions";

    fn newest(store: &Store) -> watch::Receiver<i64> {
        store.watch_decisions()
    }

    async fn read(store: &Store, after: i64, filter: LogFilter, limit: u32) -> Result<Vec<Stored<Decision>>> {
        let filter = DecisionFilter { tenant: filter.tenant, run_id: filter.run, job_id: filter.job };
        let records = store.decisions_after(after, &filter, limit).await?;
        let entry = |record: &DecisionRecord| {
            let of = LogFilter { tenant: Some(record.tenant), job: Some(record.job_id), run: Some(record.run_id) };
            let entry = decision_from_record(record).map(|decision| Entry::new(record.sequence, of, decision));
            Stored { sequence: record.sequence, entry }
        };
        Ok(records.iter().map(entry).collect())
    }
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
        let filter = LogFilter { tenant: Some(self.caller.tenant()), job: filter.job_id, run: filter.run_id };
        let watch =
            LogWatch::new(self.store.of_all_tenants(), &self.recent_decisions, request.after.map(cursor), filter);
        Ok(watch.messages().map_ok(|decision| WatchDecisionsResponse { decision: Some(decision) }))
    }
}

fn filter(violations: &mut Violations, job: &str, run: &str) -> DecisionFilter {
    let job_id = if job.is_empty() { None } else { violations.check("job", names::parse_job(job)) };
    let run_id = if run.is_empty() { None } else { violations.check("run", names::parse_run(run)) };
    // Records are asked for the caller's tenant.
    DecisionFilter { tenant: None, run_id, job_id }
}
