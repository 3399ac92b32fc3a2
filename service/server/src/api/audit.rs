//! `feedwave.v1.Audit`.

use feedwave_contract::convert::timestamp;
use feedwave_contract::proto::audit_server::Audit;
use feedwave_contract::proto::{AuditEntry, ListAuditEntriesRequest, ListAuditEntriesResponse};
use feedwave_store::AuditEntry as AuditRecord;
use tonic::{Request, Response, Status, async_trait};

use super::{Api, LogPage, page_request};
use crate::error::{Result, Violations};

fn entry_to_proto(record: AuditRecord) -> AuditEntry {
    let AuditRecord { sequence, change, at_us, ended_us, request, result, occurrences } = record;
    let result = result.unwrap_or_default();
    AuditEntry {
        sequence: sequence.unsigned_abs(),
        time: Some(timestamp(at_us)),
        end_time: ended_us.map(timestamp),
        principal: request.principal,
        tenant: request.tenant,
        address: request.address,
        certificate: request.certificate,
        method: request.method,
        resource: result.resource,
        result: result.code,
        reason: result.reason,
        request_id: request.request_id,
        occurrences,
        change: change.unsigned_abs(),
    }
}

impl Api {
    /// Lists the audit log.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn list_audit_entries(&self, request: ListAuditEntriesRequest) -> Result<ListAuditEntriesResponse> {
        let mut violations = Violations::default();
        let page = page_request(&mut violations, request.page_size, request.page_token);
        if request.changed_after.is_some() && request.after != 0 {
            violations.add("after", "must be 0 where changed_after is set");
        }
        violations.finish()?;
        let tenant = self.caller.confined_to().map_or_else(String::new, |tenant| format!("={tenant}"));
        let filters = [request.principal.as_str(), &tenant];
        let (records, next_page_token) = if let Some(changed_after) = request.changed_after {
            let page = LogPage::new(page, "audit changes", changed_after, &filters)?;
            let records = self.store.audit_changed_after(page.after, &request.principal, page.limit()).await?;
            page.cut(records, |record| record.change)
        } else {
            let page = LogPage::new(page, "audit", request.after, &filters)?;
            let records = self.store.audit_after(page.after, &request.principal, page.limit()).await?;
            page.cut(records, |record| record.sequence)
        };
        Ok(ListAuditEntriesResponse { entries: records.into_iter().map(entry_to_proto).collect(), next_page_token })
    }
}

#[async_trait]
impl Audit for Api {
    async fn list_audit_entries(
        &self,
        request: Request<ListAuditEntriesRequest>,
    ) -> Result<Response<ListAuditEntriesResponse>, Status> {
        self.answer(request, async |api, request| api.list_audit_entries(request).await).await
    }
}
