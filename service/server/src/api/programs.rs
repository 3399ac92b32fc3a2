//! Programs: uploaded by content, continued where an upload broke off.

use feedwave_contract::names;
use feedwave_contract::proto::upload_program_request::Message;
use feedwave_contract::proto::{
    DeleteProgramRequest, DeleteProgramResponse, GetUploadRequest, GetUploadResponse, UploadChunk, UploadHeader,
    UploadProgramRequest, UploadProgramResponse,
};
use feedwave_store::{Kind, ProgramId, StoreError, UploadInfo, UploadStart};
use tonic::Streaming;

use super::Api;
use crate::error::{Error, Result, Violations};

/// A part of an upload that does not fit what came before it.
fn wrong_offset(expected: u64, given: u64) -> Error {
    Error::OutOfRange {
        reason: "UPLOAD_OFFSET",
        message: format!("the upload continues at byte {expected}, not at byte {given}"),
        metadata: vec![("expected_offset", expected.to_string())],
    }
}

fn program_id(field: &str, name: &str) -> Result<ProgramId> {
    names::parse_program(name).map_err(|error| Error::invalid(field, error.to_string()))
}

impl Api {
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
        let upload = match self.store.begin_upload(expected, header.program_bytes).await? {
            UploadStart::Unfinished(upload) => upload,
            UploadStart::Complete(program) => {
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
        let program = self.store.finish_upload(upload.id).await?;
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
                received = self.store.append_upload(upload.id, received, data).await?;
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

    async fn unfinished(&self, id: ProgramId) -> Result<Option<UploadInfo>> {
        Ok(self.store.uploads().await?.into_iter().find(|upload| upload.expected == id))
    }
}
