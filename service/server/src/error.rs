//! What can go wrong in a call, said once and mapped once: to a gRPC status with details, and from there to HTTP.
//!
//! Messages are for clients; what only the operator may know stays in the source and goes to the log.

mod status;

use std::sync::Arc;

use feedwave_store::{StoreError, UploadBound};
use tonic::{Code, Status};

pub use feedwave_contract::violations::{InvalidRequest, MAX_VIOLATIONS, Violation, Violations};
pub use status::MAX_STATUS_BYTES;
pub(crate) use status::{code_name, complete};

/// Domain of every `google.rpc.ErrorInfo` of this service.
pub const DOMAIN: &str = "feedwave";

/// Shorthand for results of a call.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why a call did not do what was asked.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Error {
    /// The request itself is wrong.
    #[error("invalid request: {0}")]
    Invalid(Violations),
    /// There is no such resource.
    #[error("{name} does not exist")]
    NotFound {
        /// Sort of resource, such as `job`.
        kind: String,
        /// Resource name.
        name: String,
    },
    /// The name is taken.
    #[error("{name} already exists")]
    AlreadyExists {
        /// Sort of resource, such as `machine`.
        kind: String,
        /// Resource name.
        name: String,
    },
    /// The request id belongs to a job with different content.
    #[error("request id {request_id:?} was used for {job} with different content")]
    RequestIdReused {
        /// The request id.
        request_id: String,
        /// The job made by its first use.
        job: String,
    },
    /// The resource changed since the client read it.
    #[error("{name} has changed: its etag is now {etag:?}")]
    EtagMismatch {
        /// Resource name.
        name: String,
        /// The present etag.
        etag: String,
    },
    /// The resource is not in a state that allows the call.
    #[error("{message}")]
    Precondition {
        /// Reason of the `ErrorInfo`, such as `JOB_NOT_READY`.
        reason: &'static str,
        /// Resource name.
        subject: String,
        /// What would have to be otherwise.
        message: String,
    },
    /// An index or offset beyond the end.
    #[error("{message}")]
    OutOfRange {
        /// Reason of the `ErrorInfo`, such as `UPLOAD_OFFSET`.
        reason: &'static str,
        /// What is out of range, with the numbers.
        message: String,
        /// Numbers for programs to read, such as `expected_offset`.
        metadata: Vec<(&'static str, String)>,
    },
    /// As many as permitted are in progress; try again.
    #[error("there are already {limit} {what}")]
    Overloaded {
        /// What there are too many of.
        what: &'static str,
        /// How many are permitted.
        limit: u64,
    },
    /// One client has as many as one may; it may try again.
    #[error("this client has as many {what} as one may have, {limit} ({key})")]
    ClientOverloaded {
        /// What there are too many of.
        what: &'static str,
        /// How many are permitted.
        limit: u64,
        /// The configuration key that says so.
        key: &'static str,
    },
    /// Nothing came of a request for too long.
    #[error("no further part of the request came for {seconds} s")]
    RequestStalled {
        /// How long was waited, s.
        seconds: u64,
    },
    /// The answer was not read for too long.
    #[error("the stream was not read for {seconds} s")]
    Unread {
        /// How long was waited, s.
        seconds: u64,
    },
    /// It is not known who asks.
    #[error("it is not known who asks: {why}")]
    Unauthenticated {
        /// What is missing or wrong, without what was shown.
        why: &'static str,
    },
    /// The service is reached by a name that it does not have.
    #[error("the service is not called so here: ask localhost, or an address, or name the host in auth.hosts")]
    HostDenied,
    /// A token cannot be judged, since the keys of the identity provider cannot be had.
    #[error("the keys of the identity provider cannot be had at the moment")]
    KeysUnavailable,
    /// Whoever asks may not do it.
    #[error("{client} may not do this: it needs {needs}")]
    PermissionDenied {
        /// Who asks.
        client: String,
        /// The role that is needed.
        role: &'static str,
        /// The same in words.
        needs: String,
    },
    /// Whoever asks belongs to another tenant than the one that it asks for.
    #[error("{client} does not act for that tenant")]
    TenantDenied {
        /// Who asks.
        client: String,
    },
    /// The service is ending.
    #[error("the server is shutting down")]
    Draining,
    /// The deadline of the call has passed.
    #[error("the deadline of the call has passed")]
    DeadlineExceeded,
    /// The job was cancelled or deleted while it was worked on.
    #[error("{job} was cancelled or deleted")]
    JobCancelled {
        /// The job.
        job: String,
    },
    /// Another connection goes on with the run.
    #[error("{run} was taken up by another connection")]
    TakenUp {
        /// The run.
        run: String,
    },
    /// A message is larger than the service takes.
    #[error("the message is larger than the {limit} bytes that are taken")]
    MessageTooLarge {
        /// Largest message, bytes before compression.
        limit: usize,
    },
    /// A message takes more memory than the requests of one client may.
    #[error(
        "the message takes up to {bytes} bytes of memory once it is read, more than the {limit} of {key}: send fewer elements at a time"
    )]
    MessageTooCostly {
        /// What it takes, at most.
        bytes: u64,
        /// How many are permitted.
        limit: u64,
        /// The configuration key that says so.
        key: &'static str,
    },
    /// A path of the HTTP port was asked by another method than GET and HEAD.
    #[error("this path is only read: use GET or HEAD")]
    OnlyRead,
    /// What the transport says: it could not read a message, or knows no such method.
    #[error("{}", .0.message())]
    Transport(Status),
    /// The store cannot be used at the moment.
    #[error("{0}")]
    StoreUnavailable(#[source] Arc<StoreError>),
    /// This replica does not reach the database that it shares with others.
    #[error("this replica is cut off from the database: connect anew, another one may reach it")]
    CutOff,
    /// What is stored cannot be read back as it was written.
    #[error("stored data is damaged: {0}")]
    Damaged(String),
    /// A fault of the service; the log has the cause.
    #[error("internal error")]
    Internal(String),
}

impl Error {
    /// A single violation.
    pub fn invalid(field: impl Into<String>, description: impl Into<String>) -> Self {
        let mut violations = Violations::default();
        violations.add(field, description);
        Self::Invalid(violations)
    }

    /// A fault of the service, with what the log shall say.
    pub fn internal(cause: impl std::fmt::Display) -> Self {
        Self::Internal(cause.to_string())
    }

    /// Status code.
    #[must_use]
    pub fn code(&self) -> Code {
        match self {
            Self::Invalid(_) => Code::InvalidArgument,
            Self::NotFound { .. } => Code::NotFound,
            Self::AlreadyExists { .. } | Self::RequestIdReused { .. } => Code::AlreadyExists,
            Self::EtagMismatch { .. } | Self::JobCancelled { .. } | Self::TakenUp { .. } => Code::Aborted,
            Self::Precondition { .. } => Code::FailedPrecondition,
            Self::OutOfRange { .. } => Code::OutOfRange,
            Self::Overloaded { .. }
            | Self::ClientOverloaded { .. }
            | Self::Unread { .. }
            | Self::MessageTooLarge { .. }
            | Self::MessageTooCostly { .. } => Code::ResourceExhausted,
            Self::Unauthenticated { .. } => Code::Unauthenticated,
            Self::PermissionDenied { .. } | Self::TenantDenied { .. } | Self::HostDenied => Code::PermissionDenied,
            Self::Draining | Self::StoreUnavailable(_) | Self::CutOff | Self::KeysUnavailable => Code::Unavailable,
            Self::DeadlineExceeded | Self::RequestStalled { .. } => Code::DeadlineExceeded,
            Self::OnlyRead => Code::Unimplemented,
            Self::Transport(status) => status.code(),
            Self::Damaged(_) => Code::DataLoss,
            Self::Internal(_) => Code::Internal,
        }
    }

    /// Reason of the `ErrorInfo`: stable, for programs.
    #[must_use]
    pub fn reason(&self) -> &'static str {
        match self {
            Self::Invalid(_) => "INVALID_FIELDS",
            Self::NotFound { .. } => "RESOURCE_NOT_FOUND",
            Self::AlreadyExists { .. } => "RESOURCE_EXISTS",
            Self::RequestIdReused { .. } => "REQUEST_ID_REUSED",
            Self::EtagMismatch { .. } => "ETAG_MISMATCH",
            Self::Precondition { reason, .. } | Self::OutOfRange { reason, .. } => reason,
            Self::Overloaded { .. } => "OVERLOADED",
            Self::ClientOverloaded { .. } => "CLIENT_LIMIT",
            Self::RequestStalled { .. } => "REQUEST_STALLED",
            Self::Unread { .. } => "STREAM_UNREAD",
            Self::Unauthenticated { .. } => "UNAUTHENTICATED",
            Self::KeysUnavailable => "IDENTITY_PROVIDER_UNAVAILABLE",
            Self::PermissionDenied { .. } => "ROLE_NEEDED",
            Self::TenantDenied { .. } => "TENANT_DENIED",
            Self::HostDenied => "HOST_DENIED",
            Self::Draining => "SERVER_DRAINING",
            Self::DeadlineExceeded => "DEADLINE_EXCEEDED",
            Self::MessageTooLarge { .. } | Self::MessageTooCostly { .. } => "MESSAGE_TOO_LARGE",
            Self::OnlyRead => "NOT_SERVED",
            // Methods, compressions, services of health and symbols of reflection that there are not.
            Self::Transport(status) if matches!(status.code(), Code::Unimplemented | Code::NotFound) => "NOT_SERVED",
            Self::Transport(_) => "REQUEST_BROKEN_OFF",
            Self::JobCancelled { .. } => "JOB_CANCELLED",
            Self::TakenUp { .. } => "RUN_TAKEN_UP",
            Self::StoreUnavailable(_) | Self::CutOff => "STORE_UNAVAILABLE",
            Self::Damaged(_) => "STORE_DAMAGED",
            Self::Internal(_) => "INTERNAL",
        }
    }

    /// After how long trying again may help; `None` where it does not.
    #[must_use]
    pub const fn retry_after(&self) -> Option<std::time::Duration> {
        match self {
            Self::Overloaded { .. }
            | Self::ClientOverloaded { .. }
            | Self::Unread { .. }
            | Self::Draining
            | Self::KeysUnavailable
            | Self::StoreUnavailable(_) => Some(status::RETRY_AFTER),
            Self::CutOff => Some(status::RETRY_ELSEWHERE_AFTER),
            _ => None,
        }
    }

    /// HTTP status of the same error.
    #[must_use]
    pub fn http_status(&self) -> http::StatusCode {
        match self.code() {
            // It is the service that has too many, not this client.
            _ if matches!(self, Self::Overloaded { .. }) => http::StatusCode::SERVICE_UNAVAILABLE,
            _ if matches!(self, Self::OnlyRead) => http::StatusCode::METHOD_NOT_ALLOWED,
            Code::InvalidArgument | Code::FailedPrecondition | Code::OutOfRange => http::StatusCode::BAD_REQUEST,
            Code::Unauthenticated => http::StatusCode::UNAUTHORIZED,
            Code::PermissionDenied => http::StatusCode::FORBIDDEN,
            Code::NotFound => http::StatusCode::NOT_FOUND,
            Code::AlreadyExists | Code::Aborted => http::StatusCode::CONFLICT,
            Code::ResourceExhausted => http::StatusCode::TOO_MANY_REQUESTS,
            Code::Unavailable => http::StatusCode::SERVICE_UNAVAILABLE,
            Code::DeadlineExceeded => http::StatusCode::GATEWAY_TIMEOUT,
            _ => http::StatusCode::INTERNAL_SERVER_ERROR,
        }
    }
}

impl From<InvalidRequest> for Error {
    fn from(InvalidRequest(violations): InvalidRequest) -> Self {
        Self::Invalid(violations)
    }
}

impl From<StoreError> for Error {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::NotFound { kind, id } => Self::NotFound { kind: kind.to_string(), name: name_of(kind, &id) },
            StoreError::AlreadyExists { kind, id } => {
                Self::AlreadyExists { kind: kind.to_string(), name: name_of(kind, &id) }
            }
            StoreError::Conflict { request_id, job_id } => {
                Self::RequestIdReused { request_id, job: format!("jobs/{job_id}") }
            }
            StoreError::InUse { kind, id, users } => {
                let subject = name_of(kind, &id);
                let message = format!("{subject} is in use by {users} job(s)");
                Self::Precondition { reason: "RESOURCE_IN_USE", subject, message }
            }
            StoreError::EtagMismatch { kind, id, current } => {
                Self::EtagMismatch { name: name_of(kind, &id), etag: current }
            }
            StoreError::InvalidPageToken => Self::invalid("page_token", error.to_string()),
            StoreError::WrongOffset { expected, given, .. } => Self::OutOfRange {
                reason: "UPLOAD_OFFSET",
                message: format!("the upload continues at byte {expected}, not at byte {given}"),
                metadata: vec![("expected_offset", expected.to_string())],
            },
            StoreError::TooLarge { what, size, limit } => {
                Self::invalid(what, format!("has {size} bytes, more than the {limit} allowed"))
            }
            StoreError::NulCharacter => Self::invalid("text", error.to_string()),
            StoreError::LimitReached { bound, limit } => too_many_uploads(bound, limit),
            StoreError::Incomplete { .. } => Self::internal(error),
            StoreError::HashMismatch { expected, actual } => Self::invalid(
                "header.sha256",
                format!("is {expected}, but the bytes received hash to {actual}; they were discarded"),
            ),
            StoreError::FailedState { job_id, actual, .. } => {
                let subject = format!("jobs/{job_id}");
                let message = format!("{subject} is {actual}");
                Self::Precondition { reason: "JOB_STATE", subject, message }
            }
            StoreError::RunEnded { run_id, state } => {
                let subject = format!("runs/{run_id}");
                let message = format!("{subject} is {state} and takes nothing more");
                Self::Precondition { reason: "RUN_ENDED", subject, message }
            }
            StoreError::Detached { run_id } => Self::TakenUp { run: format!("runs/{run_id}") },
            StoreError::Unavailable { .. } => Self::StoreUnavailable(Arc::new(error)),
            StoreError::Corrupt { reason, .. } => Self::Damaged(reason),
            other => {
                let source = std::error::Error::source(&other).map(|source| format!(": {source}")).unwrap_or_default();
                Self::internal(format!("{other}{source}"))
            }
        }
    }
}

/// Why there is no further upload: whatever there is for all, or the share of one client.
const fn too_many_uploads(bound: UploadBound, limit: u64) -> Error {
    match bound {
        UploadBound::Uploads | UploadBound::Bytes => Error::Overloaded { what: bound.what(), limit },
        UploadBound::ClientUploads => Error::ClientOverloaded {
            what: UploadBound::Uploads.what(),
            limit,
            key: "limits.unfinished_uploads_per_client",
        },
        UploadBound::ClientBytes => Error::ClientOverloaded {
            what: UploadBound::Bytes.what(),
            limit,
            key: "limits.unfinished_upload_bytes_per_client",
        },
    }
}

/// Resource name of a record of the store.
fn name_of(kind: feedwave_store::Kind, id: &str) -> String {
    use feedwave_store::Kind;
    let collection = match kind {
        Kind::Program => "programs",
        Kind::Upload => "uploads",
        Kind::Job => "jobs",
        Kind::Report => return format!("jobs/{id}/report"),
        Kind::Checkpoint => return format!("jobs/{id}/checkpoints"),
        Kind::Machine => "machines",
        Kind::Tool => "tools",
        Kind::Run => "runs",
        Kind::Monitoring => return format!("jobs/{id}/monitoring"),
        Kind::Condition => return format!("runs/{id}/conditions"),
        Kind::RecordedCut => return format!("runs/{id}"),
    };
    format!("{collection}/{id}")
}
