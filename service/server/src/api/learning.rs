//! Learning from runs: proposals for tools, and their adoption.

use feedwave_contract::convert::{LearningPlan, learning_names};
use feedwave_contract::names;
use feedwave_contract::proto::{
    AdoptToolProposalRequest, AdoptToolProposalResponse, ComputeToolProposalRequest, ComputeToolProposalResponse,
    LearningRecord, LearningSource, LeftOut, RecordedCut, Tool, ToolProposal,
};
use feedwave_store::{Run, ToolRecord};
use prost::Message as _;
use sha2::{Digest as _, Sha256};

use super::{Api, tools};
use crate::error::{Error, Result, Violations};

/// A stretch in the runs that are learnt from.
struct Found {
    record: LearningRecord,
    /// Place of the run among those of the source.
    run: usize,
}

impl Api {
    /// Learns from runs.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn compute_tool_proposal(
        &self,
        request: ComputeToolProposalRequest,
    ) -> Result<ComputeToolProposalResponse> {
        let source = request.source.ok_or_else(|| Error::invalid("source", "must be set"))?;
        let (_, proposal) = self.learn(&source).await?;
        Ok(ComputeToolProposalResponse { proposal: Some(proposal) })
    }

    /// Writes what was learnt into a tool.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn adopt_tool_proposal(&self, request: AdoptToolProposalRequest) -> Result<AdoptToolProposalResponse> {
        if let Some(source) = &request.source {
            self.concerns(&source.tool, names::parse_tool, names::tool);
        }
        let mut violations = Violations::default();
        if request.digest.is_empty() {
            violations.add("digest", "must be that of the proposal that is adopted");
        }
        if request.source.is_none() {
            violations.add("source", "must be set");
        }
        violations.finish()?;
        let source = request.source.unwrap_or_default();
        let (record, proposal) = self.learn(&source).await?;
        if proposal.digest != request.digest {
            let name = format!("the proposal for {}", proposal.tool);
            return Err(Error::EtagMismatch { name, etag: proposal.digest });
        }
        let tool = Tool { dynamics: proposal.dynamics.clone(), ..tools::from_record(&record)? };
        let document = tools::checked_document(Violations::default(), &tool)?;
        let record = self.store.update_tool(&record.id, Some(&record.etag), tool.number, document).await?;
        tracing::info!(tool = record.id, digest = proposal.digest, "proposal adopted");
        Ok(AdoptToolProposalResponse { tool: Some(tools::from_record(&record)?), proposal: Some(proposal) })
    }

    /// The tool and the proposal for it.
    async fn learn(&self, source: &LearningSource) -> Result<(ToolRecord, ToolProposal)> {
        let mut violations = Violations::default();
        let named = learning_names(&mut violations, "source", source);
        violations.finish()?;
        let (tool, ids) = named.ok_or_else(|| Error::internal("a request was neither accepted nor refused"))?;
        let record = self.store.tool(&tool).await?;
        let mut violations = Violations::default();
        let plan = LearningPlan::new(&mut violations, "source", source, tools::from_record(&record)?);
        violations.finish()?;
        let plan = plan.ok_or_else(|| Error::internal("a request was neither accepted nor refused"))?;
        let mut runs = Vec::with_capacity(ids.len());
        for id in ids {
            runs.push(self.store.run(id).await?);
        }
        let found = self.stretches(&runs).await?;
        if found.is_empty() {
            return Err(not_learnt(
                source,
                "nothing was kept of these runs: a run keeps steady cuts where it is asked to record them".to_owned(),
            ));
        }
        let mut records: Vec<_> = found.iter().map(|found| found.record.clone()).collect();
        plan.choose(&mut records);
        let mut cuts = Vec::new();
        for (record, found) in records.iter().zip(&found) {
            if record.left_out() == LeftOut::Unspecified {
                let body = self.store.recorded_cut(&runs[found.run], u64::from(record.number)).await?;
                let damaged = |error| Error::Damaged(format!("a recorded cut of {}: {error}", record.run));
                cuts.push(RecordedCut::decode(body).map_err(damaged)?);
            }
        }
        let proposed = self.engine.compute(move || plan.propose(records, &cuts)).await?;
        let mut proposal = proposed.map_err(|why| not_learnt(source, why))?;
        proposal.digest = hex(&Sha256::digest(proposal.encode_to_vec()));
        Ok((record, proposal))
    }

    /// Every stretch that was kept of the runs.
    async fn stretches(&self, runs: &[Run]) -> Result<Vec<Found>> {
        let mut found = Vec::new();
        for (place, run) in runs.iter().enumerate() {
            for head in self.store.recorded_cuts(run).await? {
                let damaged = |error| Error::Damaged(format!("a recorded cut of {}: {error}", names::run(run.id)));
                let record = LearningRecord::decode(head.head).map_err(damaged)?;
                let number = u32::try_from(head.number).unwrap_or(u32::MAX);
                found.push(Found { record: LearningRecord { run: names::run(run.id), number, ..record }, run: place });
            }
        }
        Ok(found)
    }
}

fn not_learnt(source: &LearningSource, message: String) -> Error {
    Error::Precondition { reason: "NOT_LEARNT", subject: source.tool.clone(), message }
}

fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    bytes.iter().fold(String::with_capacity(64), |mut text, byte| {
        // Writing into a string does not fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}
