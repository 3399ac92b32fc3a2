//! `feedwave.v1.Tools`.

use feedwave_contract::convert::{self, timestamp};
use feedwave_contract::names;
use feedwave_contract::proto::tools_server::Tools;
use feedwave_contract::proto::{
    AdoptToolProposalRequest, AdoptToolProposalResponse, ComputeStabilityLobesRequest, ComputeStabilityLobesResponse,
    ComputeToolProposalRequest, ComputeToolProposalResponse, CreateToolRequest, CreateToolResponse, DeleteToolRequest,
    DeleteToolResponse, GetToolRequest, GetToolResponse, ListToolsRequest, ListToolsResponse, Tool, UpdateToolRequest,
    UpdateToolResponse,
};
use feedwave_store::{Json, ToolFilter, ToolRecord};
use tonic::{Request, Response, Status, async_trait};

use super::{Api, etag, mask, page_request};
use crate::error::{Error, Result, Violations};
use crate::stored;

pub(super) fn from_record(record: &ToolRecord) -> Result<Tool> {
    Ok(Tool {
        name: names::tool(&record.id),
        etag: record.etag.clone(),
        create_time: Some(timestamp(record.created_us)),
        update_time: Some(timestamp(record.updated_us)),
        ..stored::from_stored(record.body.get())?
    })
}

/// The document of a tool that a client sends, checked.
pub(super) fn checked_document(mut violations: Violations, tool: &Tool) -> Result<Json> {
    violations.extend("tool", convert::check_tool(tool));
    violations.finish()?;
    let stored =
        Tool { name: String::new(), etag: String::new(), create_time: None, update_time: None, ..tool.clone() };
    stored::to_stored(&stored)
}

impl Api {
    /// Adds a tool.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn create_tool(&self, request: CreateToolRequest) -> Result<CreateToolResponse> {
        self.concerns(&request.tool_id, names::check_id, names::tool);
        let mut violations = Violations::default();
        violations.check("tool_id", names::check_id(&request.tool_id));
        let tool = request.tool.unwrap_or_default();
        let document = checked_document(violations, &tool)?;
        let record = self.store.create_tool(Some(&request.tool_id), tool.number, document).await?;
        Ok(CreateToolResponse { tool: Some(from_record(&record)?) })
    }

    /// Reads a tool.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn get_tool(&self, request: GetToolRequest) -> Result<GetToolResponse> {
        let id = names::parse_tool(&request.name).map_err(|error| Error::invalid("name", error.to_string()))?;
        Ok(GetToolResponse { tool: Some(from_record(&self.store.tool(id).await?)?) })
    }

    /// Lists tools.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn list_tools(&self, request: ListToolsRequest) -> Result<ListToolsResponse> {
        let mut violations = Violations::default();
        let page = page_request(&mut violations, request.page_size, request.page_token);
        violations.finish()?;
        let page = self.store.list_tools(&ToolFilter::default(), &page).await?;
        Ok(ListToolsResponse {
            tools: page.items.iter().map(from_record).collect::<Result<_>>()?,
            next_page_token: page.next_token.unwrap_or_default(),
            unreachable: page.unreachable.iter().map(|id| names::tool(id)).collect(),
        })
    }

    /// Replaces a tool or some of its fields.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn update_tool(&self, request: UpdateToolRequest) -> Result<UpdateToolResponse> {
        let given = request.tool.unwrap_or_default();
        self.concerns(&given.name, names::parse_tool, names::tool);
        let id = names::parse_tool(&given.name).map_err(|error| Error::invalid("tool.name", error.to_string()))?;
        // What is replaced as a whole may be damaged.
        let record = match mask::replaces_everything(request.update_mask.as_ref()) {
            true => None,
            false => Some(self.store.tool(id).await?),
        };
        let stored = record.as_ref().map_or_else(|| Ok(Tool::default()), from_record)?;
        let updated = mask::apply(&stored, &given, request.update_mask.as_ref())?;
        let document = checked_document(Violations::default(), &updated)?;
        // What is kept was just read: it must not have changed since.
        let expected = etag(&given.etag).or_else(|| record.as_ref().map(|record| record.etag.as_str()));
        let record = self.store.update_tool(id, expected, updated.number, document).await?;
        Ok(UpdateToolResponse { tool: Some(from_record(&record)?) })
    }

    /// Removes a tool.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn delete_tool(&self, request: DeleteToolRequest) -> Result<DeleteToolResponse> {
        let id = names::parse_tool(&request.name).map_err(|error| Error::invalid("name", error.to_string()))?;
        self.store.delete_tool(id, etag(&request.etag)).await?;
        Ok(DeleteToolResponse {})
    }
}

#[async_trait]
impl Tools for Api {
    async fn create_tool(&self, request: Request<CreateToolRequest>) -> Result<Response<CreateToolResponse>, Status> {
        self.answer(request, async |api, request| api.create_tool(request).await).await
    }

    async fn get_tool(&self, request: Request<GetToolRequest>) -> Result<Response<GetToolResponse>, Status> {
        self.answer(request, async |api, request| api.get_tool(request).await).await
    }

    async fn list_tools(&self, request: Request<ListToolsRequest>) -> Result<Response<ListToolsResponse>, Status> {
        self.answer(request, async |api, request| api.list_tools(request).await).await
    }

    async fn update_tool(&self, request: Request<UpdateToolRequest>) -> Result<Response<UpdateToolResponse>, Status> {
        self.answer(request, async |api, request| api.update_tool(request).await).await
    }

    async fn delete_tool(&self, request: Request<DeleteToolRequest>) -> Result<Response<DeleteToolResponse>, Status> {
        self.answer(request, async |api, request| api.delete_tool(request).await).await
    }

    async fn compute_tool_proposal(
        &self,
        request: Request<ComputeToolProposalRequest>,
    ) -> Result<Response<ComputeToolProposalResponse>, Status> {
        self.answer(request, async |api, request| api.compute_tool_proposal(request).await).await
    }

    async fn adopt_tool_proposal(
        &self,
        request: Request<AdoptToolProposalRequest>,
    ) -> Result<Response<AdoptToolProposalResponse>, Status> {
        self.answer(request, async |api, request| api.adopt_tool_proposal(request).await).await
    }

    async fn compute_stability_lobes(
        &self,
        request: Request<ComputeStabilityLobesRequest>,
    ) -> Result<Response<ComputeStabilityLobesResponse>, Status> {
        self.answer(request, async |api, request| api.compute_stability_lobes(request).await).await
    }
}
