//! Programs: uploaded by content, continued where an upload broke off; found again, read and interpreted.

mod further;

use feedwave_contract::convert::{self, timestamp};
use feedwave_contract::names;
use feedwave_contract::proto::programs_server::Programs;
use feedwave_contract::proto::upload_program_request::Message;
use feedwave_contract::proto::{
    DeleteProgramRequest, DeleteProgramResponse, GetProgramRequest, GetProgramResponse, GetUploadRequest,
    GetUploadResponse, ImproveRequest, ImproveResponse, InterpretRequest, InterpretResponse, JobSettings,
    ListProgramsRequest, ListProgramsResponse, ListUploadsRequest, ListUploadsResponse, Program,
    ProgramsDeleteProgramRequest, ProgramsDeleteProgramResponse, ReadProgramRequest, ReadProgramResponse, Upload,
    UploadChunk, UploadHeader, UploadProgramRequest, UploadProgramResponse, improve_request, interpret_request,
};
use feedwave_cutting::{MAX_IMPROVED_BYTES, PipelineConfig};
use feedwave_store::{
    CHUNK_BYTES, Kind, MAX_PAGE_SIZE, Page, ProgramEntry, ProgramId, Scope, StoreError, Tenant, UploadInfo, UploadStart,
};
use futures_util::{Stream, stream};
use tonic::{Request, Response, Status, Streaming, async_trait};

use super::guarded::{Guarded, deadline};
use super::jobs::{ResponseStream, check_inline};
use super::settings::check_tools;
use super::{Api, page_request};
use crate::engine::{self, Actions, File, Source};
use crate::error::{Error, Result, Violations};

/// A part of an upload that does not fit what came before it.
fn wrong_offset(expected: u64, given: u64) -> Error {
    Error::OutOfRange {
        reason: "UPLOAD_OFFSET",
        message: format!("the upload continues at byte {expected}, not at byte {given}"),
        metadata: vec![("expected_offset", expected.to_string())],
    }
}

fn program_to_proto(entry: ProgramEntry) -> Program {
    Program {
        name: names::program(entry.info.id),
        size_bytes: entry.info.size_bytes,
        file_name: entry.file_name,
        job_count: entry.job_count,
        create_time: Some(timestamp(entry.info.created_us)),
    }
}

/// Checks a file name that may be empty.
fn check_file_name(violations: &mut Violations, field: &str, name: &str) {
    convert::check_display_name(violations, field, name);
}

fn program_id(field: &str, name: &str) -> Result<ProgramId> {
    names::parse_program(name).map_err(|error| Error::invalid(field, error.to_string()))
}

/// What a request states of a program and its machine.
struct Given {
    tenant: Tenant,
    config: PipelineConfig,
    source: Source,
    program_bytes: u64,
}

/// A request about a program as the one of Interpret, whose fields it has.
fn as_interpretation(request: ImproveRequest) -> InterpretRequest {
    let ImproveRequest { source, on, tools, programs, offsets, goals: _ } = request;
    InterpretRequest {
        source: source.map(|source| match source {
            improve_request::Source::InlineProgram(program) => interpret_request::Source::InlineProgram(program),
            improve_request::Source::Program(name) => interpret_request::Source::Program(name),
            improve_request::Source::Job(name) => interpret_request::Source::Job(name),
        }),
        on: on.map(|on| match on {
            improve_request::On::Machine(name) => interpret_request::On::Machine(name),
            improve_request::On::Profile(profile) => interpret_request::On::Profile(profile),
        }),
        tools,
        programs,
        offsets,
    }
}

impl Api {
    /// Names a stored program by its file. Without a name it keeps the one that it has.
    pub(super) async fn name_program(&self, id: ProgramId, file_name: &str) -> Result<()> {
        if !file_name.is_empty() {
            self.store.name_program(id, file_name).await?;
        }
        Ok(())
    }

    /// Receives a program. What arrived stays when the upload breaks off.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn upload_program(&self, mut messages: Streaming<UploadProgramRequest>) -> Result<UploadProgramResponse> {
        let header = match self.next(&mut messages).await? {
            Some(Message::Header(header)) => header,
            Some(Message::Chunk(_)) => return Err(Error::invalid("header", "must be the first message")),
            None => return Err(Error::invalid("header", "must be set")),
        };
        let expected = self.check_header(&header)?;
        let name = async |id| self.name_program(id, &header.file_name).await;
        let upload = match self.store.begin_upload(expected, header.program_bytes).await? {
            UploadStart::Unfinished(upload) => upload,
            UploadStart::Complete(program) => {
                name(program.id).await?;
                return Ok(UploadProgramResponse {
                    program: names::program(program.id),
                    received_bytes: program.size_bytes,
                });
            }
        };
        if header.offset != upload.received_bytes {
            return Err(wrong_offset(upload.received_bytes, header.offset));
        }
        let received_bytes = self.receive(&mut messages, &upload).await?;
        if received_bytes < header.program_bytes {
            return Ok(UploadProgramResponse { program: String::new(), received_bytes });
        }
        let program = self.store.finish_upload(&upload).await?;
        name(program.id).await?;
        tracing::info!(program = %program.id, bytes = program.size_bytes, "uploaded");
        Ok(UploadProgramResponse { program: names::program(program.id), received_bytes })
    }

    fn check_header(&self, header: &UploadHeader) -> Result<ProgramId> {
        let mut violations = Violations::default();
        let id = violations.check("header.sha256", header.sha256.parse::<ProgramId>());
        let limit = self.limits.upload_bytes;
        if header.program_bytes > limit {
            let reason = format!("is {}, more than the {limit} allowed", header.program_bytes);
            violations.add("header.program_bytes", reason);
        } else if header.offset > header.program_bytes {
            let reason = format!("is {}, beyond the size of {}", header.offset, header.program_bytes);
            violations.add("header.offset", reason);
        }
        check_file_name(&mut violations, "header.file_name", &header.file_name);
        violations.finish()?;
        id.ok_or_else(|| Error::internal("a header was neither accepted nor refused"))
    }

    /// Appends chunks up to the end of the messages; returns how many bytes there are then.
    async fn receive(&self, messages: &mut Streaming<UploadProgramRequest>, upload: &UploadInfo) -> Result<u64> {
        let mut received = upload.received_bytes;
        while let Some(message) = self.next(messages).await? {
            let Message::Chunk(UploadChunk { offset, data }) = message else {
                return Err(Error::invalid("header", "must be the first message only"));
            };
            if offset != received {
                return Err(wrong_offset(received, offset));
            }
            if data.len() as u64 > upload.size_bytes - received {
                let reason = format!("goes beyond the {} bytes that the header announced", upload.size_bytes);
                return Err(Error::invalid("chunk.data", reason));
            }
            if !data.is_empty() {
                received = self.store.append_upload(upload, received, data).await?;
            }
        }
        Ok(received)
    }

    /// The next message; `None` at the end. Ends with the service.
    async fn next(&self, messages: &mut Streaming<UploadProgramRequest>) -> Result<Option<Message>> {
        let message = tokio::select! {
            message = messages.message() => message,
            () = self.engine.draining().cancelled() => return Err(Error::Draining),
        };
        match message {
            Ok(None) => Ok(None),
            Ok(Some(UploadProgramRequest { message: Some(message) })) => Ok(Some(message)),
            Ok(Some(UploadProgramRequest { message: None })) => {
                Err(Error::invalid("message", "header or chunk must be set"))
            }
            Err(status) => Err(status.into()),
        }
    }

    /// Says how much of a program has been received.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn get_upload(&self, request: GetUploadRequest) -> Result<GetUploadResponse> {
        let id = program_id("program", &request.program)?;
        match self.store.program_info(id).await {
            Ok(program) => {
                let bytes = program.size_bytes;
                return Ok(GetUploadResponse { received_bytes: bytes, program_bytes: bytes, complete: true });
            }
            Err(StoreError::NotFound { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        Ok(match self.unfinished(id).await? {
            Some(upload) => GetUploadResponse {
                received_bytes: upload.received_bytes,
                program_bytes: upload.size_bytes,
                complete: false,
            },
            None => GetUploadResponse::default(),
        })
    }

    /// Lists programs.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn list_programs(&self, request: ListProgramsRequest) -> Result<ListProgramsResponse> {
        let mut violations = Violations::default();
        let page = page_request(&mut violations, request.page_size, request.page_token);
        check_file_name(&mut violations, "file_name", &request.file_name);
        violations.finish()?;
        let page = self.store.list_programs(&request.file_name, &page).await?;
        Ok(ListProgramsResponse {
            programs: page.items.into_iter().map(program_to_proto).collect(),
            next_page_token: page.next_token.unwrap_or_default(),
            unreachable: page.unreachable.iter().map(|id| format!("programs/{id}")).collect(),
        })
    }

    /// Says what is known of a program.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn get_program(&self, request: GetProgramRequest) -> Result<GetProgramResponse> {
        let entry = self.store.program_entry(program_id("name", &request.name)?).await?;
        Ok(GetProgramResponse { program: Some(program_to_proto(entry)) })
    }

    /// The bytes of a program, in pieces.
    ///
    /// # Errors
    /// As the contract says.
    pub(crate) async fn read_program(
        &self,
        request: ReadProgramRequest,
    ) -> Result<impl Stream<Item = Result<ReadProgramResponse>> + Send + 'static> {
        let program = self.store.program_info(program_id("name", &request.name)?).await?;
        let (id, size_bytes) = (program.id, program.size_bytes);
        if request.offset > size_bytes {
            return Err(Error::OutOfRange {
                reason: "START_BEYOND_END",
                message: format!("the program has {size_bytes} bytes, it cannot be read from byte {}", request.offset),
                metadata: vec![("size_bytes", size_bytes.to_string())],
            });
        }
        let wanted = if request.length == 0 { u64::MAX } else { request.length };
        let end = request.offset.saturating_add(wanted).min(size_bytes);
        let store = self.store.of_all_tenants().clone();
        Ok(stream::try_unfold(request.offset, move |offset| {
            let store = store.clone();
            async move {
                if offset >= end {
                    return Ok(None);
                }
                let chunk = store.program_chunk(id, offset / CHUNK_BYTES).await?;
                let from = (offset % CHUNK_BYTES) as usize;
                let to = chunk.len().min(from.saturating_add((end - offset) as usize));
                let data = chunk.slice(from.min(to)..to);
                let next = offset + data.len() as u64;
                if data.is_empty() {
                    return Err(Error::internal(format!("program {id} is shorter than it says")));
                }
                Ok(Some((ReadProgramResponse { offset, data }, next)))
            }
        }))
    }

    /// Begins to interpret a program.
    async fn start_interpretation(&self, request: InterpretRequest) -> Result<Actions> {
        let Given { tenant, config, source, .. } = self.given(Violations::default(), request).await?;
        self.engine.interpret(tenant, config, source)
    }

    /// Improves a program: the messages of the answer.
    async fn start_improvement(
        &self,
        request: ImproveRequest,
    ) -> Result<impl Stream<Item = Result<ImproveResponse>> + Send + 'static> {
        let mut violations = Violations::default();
        let goals = convert::improvement_goals_from_proto(&mut violations, "goals", request.goals.as_ref());
        let Given { tenant, config, source, program_bytes } =
            self.given(violations, as_interpretation(request)).await?;
        if program_bytes > MAX_IMPROVED_BYTES {
            let reason = format!("has {program_bytes} bytes; at most {MAX_IMPROVED_BYTES} are improved");
            return Err(Error::invalid("program", reason));
        }
        let goals = goals.on(&config.profile);
        self.engine.improve(tenant, &self.caller.client(), config, program_bytes, source, goals)
    }

    /// What a request states of a program, with the violations that were found before.
    async fn given(&self, mut violations: Violations, request: InterpretRequest) -> Result<Given> {
        use interpret_request::{On, Source as From};
        if let Some(From::Job(job)) = &request.source {
            let states_more = request.on.is_some() || !request.tools.is_empty() || !request.programs.is_empty();
            if states_more || request.offsets.is_some() {
                violations.add("job", "has its machine, tools, further files and offsets: nothing else may be stated");
            }
            violations.finish()?;
            let detail = self.job_detail(super::jobs::job_id("job", job)?).await?;
            let (config, source) = (engine::job_config(&detail)?, self.engine.job_source(&detail)?);
            let program_bytes = self.store.program_info(detail.job.program_id).await?.size_bytes;
            return Ok(Given { tenant: detail.job.tenant, config, source, program_bytes });
        }
        let mut inline_bytes = 0;
        let stored = match &request.source {
            Some(From::InlineProgram(program)) => {
                inline_bytes = program.len();
                check_inline(&mut violations, inline_bytes, self.limits.inline_program_bytes);
                None
            }
            Some(From::Program(name)) => violations.check("program", names::parse_program(name)),
            Some(From::Job(_)) => None,
            None => {
                violations.add("source", "inline_program, program or job must be set");
                None
            }
        };
        self.check_program_files(&mut violations, "programs", &request.programs, inline_bytes);
        let tools = check_tools(&mut violations, &request.tools);
        if let Some(offsets) = &request.offsets {
            convert::check_offsets(&mut violations, "offsets", offsets);
        }
        let (machine, profile) = match &request.on {
            Some(On::Machine(name)) => (violations.check("machine", names::parse_machine(name)), None),
            Some(On::Profile(given)) => (None, convert::profile_from_proto(&mut violations, "profile", given)),
            None => {
                violations.add("on", "machine or profile must be set");
                (None, None)
            }
        };
        violations.finish()?;
        let profile = match (profile, machine) {
            (Some(profile), _) => profile,
            (None, Some(id)) => self.machine_profile(id).await?.0,
            (None, None) => return Err(Error::internal("a request was neither accepted nor refused")),
        };
        let tools = self.job_tools(&tools).await?;
        let (own, program_bytes) = match (&request.source, stored) {
            (Some(From::InlineProgram(program)), _) => (File::Memory(program.clone()), program.len() as u64),
            (_, Some(id)) => {
                let program = self.store.program_info(id).await?;
                let store = self.store.of_all_tenants().clone();
                (File::stored_of_size(store, program.id, program.size_bytes), program.size_bytes)
            }
            _ => return Err(Error::internal("a request was neither accepted nor refused")),
        };
        let (source, programs) = self.sources(own, &request.programs).await?;
        let settings = JobSettings { tools, programs, offsets: request.offsets, ..JobSettings::default() };
        let config = convert::pipeline_config(profile, &settings);
        Ok(Given { tenant: self.caller.tenant(), config, source, program_bytes })
    }

    /// Deletes a program, or what was received of one.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn delete_program(&self, request: DeleteProgramRequest) -> Result<DeleteProgramResponse> {
        let id = program_id("name", &request.name)?;
        let unfinished = self.unfinished(id).await?;
        match (self.store.delete_program(id).await, unfinished) {
            (Err(StoreError::NotFound { kind: Kind::Program, .. }), Some(upload)) => {
                self.store.delete_upload(upload.id).await?;
            }
            (deleted, _) => deleted?,
        }
        tracing::info!(program = %id, "deleted");
        Ok(DeleteProgramResponse {})
    }

    /// Lists unfinished uploads.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn list_uploads(&self, request: ListUploadsRequest) -> Result<ListUploadsResponse> {
        let mut violations = Violations::default();
        let mut page = page_request(&mut violations, request.page_size, request.page_token);
        violations.finish()?;
        // Clients from before there were pages ask for all.
        page.size = if page.size == 0 { MAX_PAGE_SIZE } else { page.size };
        let scope = Scope::of([b"uploads".as_slice()]);
        let after = scope.after_sequence(&page.token)?.unwrap_or(i64::MIN);
        let mut uploads = self.store.uploads().await?;
        uploads.retain(|upload| upload.number > after);
        let page = Page::cut(uploads, page.bounded_size(), |last| scope.sequence_token(last.number));
        let upload = |upload: UploadInfo| Upload {
            program: names::program(upload.expected),
            program_bytes: upload.size_bytes,
            received_bytes: upload.received_bytes,
            client: upload.client,
            create_time: Some(timestamp(upload.created_us)),
            update_time: Some(timestamp(upload.updated_us)),
        };
        Ok(ListUploadsResponse {
            uploads: page.items.into_iter().map(upload).collect(),
            next_page_token: page.next_token.unwrap_or_default(),
        })
    }

    async fn unfinished(&self, id: ProgramId) -> Result<Option<UploadInfo>> {
        Ok(self.store.uploads().await?.into_iter().find(|upload| upload.expected.as_bytes() == id.as_bytes()))
    }
}

#[async_trait]
impl Programs for Api {
    async fn list_programs(
        &self,
        request: Request<ListProgramsRequest>,
    ) -> Result<Response<ListProgramsResponse>, Status> {
        self.answer(request, async |api, request| api.list_programs(request).await).await
    }

    async fn get_program(&self, request: Request<GetProgramRequest>) -> Result<Response<GetProgramResponse>, Status> {
        self.answer(request, async |api, request| api.get_program(request).await).await
    }

    type ReadProgramStream = ResponseStream<ReadProgramResponse>;

    async fn read_program(
        &self,
        request: Request<ReadProgramRequest>,
    ) -> Result<Response<Self::ReadProgramStream>, Status> {
        let deadline = deadline(request.metadata().as_ref());
        let api = self.called_by(request.extensions());
        let pieces = Box::pin(api.read_program(request.into_inner()).await?);
        let guarded = Guarded::new(pieces, deadline).ends_with(self.engine.draining(), Error::Draining);
        Ok(Response::new(Box::pin(guarded)))
    }

    async fn delete_program(
        &self,
        request: Request<ProgramsDeleteProgramRequest>,
    ) -> Result<Response<ProgramsDeleteProgramResponse>, Status> {
        let delete = async |api: Self, request: ProgramsDeleteProgramRequest| {
            api.delete_program(DeleteProgramRequest { name: request.name }).await?;
            Ok(ProgramsDeleteProgramResponse {})
        };
        self.answer(request, delete).await
    }

    async fn list_uploads(
        &self,
        request: Request<ListUploadsRequest>,
    ) -> Result<Response<ListUploadsResponse>, Status> {
        self.answer(request, async |api, request| api.list_uploads(request).await).await
    }

    type InterpretStream = ResponseStream<InterpretResponse>;

    async fn interpret(&self, request: Request<InterpretRequest>) -> Result<Response<Self::InterpretStream>, Status> {
        let deadline = deadline(request.metadata().as_ref());
        let api = self.called_by(request.extensions());
        let actions = api.start_interpretation(request.into_inner()).await?;
        let guarded = Guarded::new(actions, deadline).ends_with(self.engine.draining(), Error::Draining);
        Ok(Response::new(Box::pin(guarded)))
    }

    type ImproveStream = ResponseStream<ImproveResponse>;

    async fn improve(&self, request: Request<ImproveRequest>) -> Result<Response<Self::ImproveStream>, Status> {
        let deadline = deadline(request.metadata().as_ref());
        let api = self.called_by(request.extensions());
        let messages = Box::pin(api.start_improvement(request.into_inner()).await?);
        let guarded = Guarded::new(messages, deadline).ends_with(self.engine.draining(), Error::Draining);
        Ok(Response::new(Box::pin(guarded)))
    }
}
