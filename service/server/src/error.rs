//! What can go wrong in a call, said once and mapped once: to a gRPC status with details, and from there to HTTP.
//!
//! Messages are for clients; what only the operator may know stays in the source and goes to the log.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use feedwave_store::StoreError;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, FieldViolation, StatusExt};

/// Domain of every `google.rpc.ErrorInfo` of this service.
pub const DOMAIN: &str = "feedwave";

/// After how long an overloaded service may be asked again.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// Shorthand for results of a call.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// One field of a request that cannot be accepted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Path of the field in the request, such as `machine.profile.machine.axes[0].max_velocity`.
    pub field: String,
    /// What is wrong with it, with the value and what is allowed.
    pub description: String,
}

/// Collects everything that is wrong with a request, so that a client hears of all of it at once.
#[derive(Debug, Default)]
pub struct Violations(Vec<Violation>);

impl Violations {
    /// Adds a violation.
    pub fn add(&mut self, field: impl Into<String>, description: impl Into<String>) {
        self.0.push(Violation { field: field.into(), description: description.into() });
    }

    /// Takes the value, or adds the violation and goes on.
    pub fn check<T, E: std::fmt::Display>(&mut self, field: impl Into<String>, value: Result<T, E>) -> Option<T> {
        value.map_err(|error| self.add(field, error.to_string())).ok()
    }

    /// Takes over violations of a part of the request.
    pub fn extend(&mut self, prefix: &str, inner: Self) {
        self.0.extend(inner.0.into_iter().map(|violation| Violation {
            field: format!("{prefix}.{}", violation.field),
            description: violation.description,
        }));
    }

    /// Takes over the first violations of a long list, and counts the rest.
    pub fn extend_listed(&mut self, field: &str, inner: Self, most: usize) {
        let not_listed = inner.0.len().saturating_sub(most);
        self.0.extend(inner.0.into_iter().take(most));
        if not_listed > 0 {
            self.add(field, format!("{not_listed} more violations are not listed"));
        }
    }

    /// What was found.
    #[must_use]
    pub fn as_slice(&self) -> &[Violation] {
        &self.0
    }

    /// Whether nothing was found.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Ends the collection.
    ///
    /// # Errors
    /// [`Error::Invalid`] when anything was found.
    pub fn finish(self) -> Result<()> {
        if self.0.is_empty() { Ok(()) } else { Err(Error::Invalid(self.0)) }
    }
}

/// Why a call did not do what was asked.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Error {
    /// The request itself is wrong.
    #[error("{}", invalid_message(.0))]
    Invalid(Vec<Violation>),
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
    /// An index or offset beyond what there is.
    #[error("{message}")]
    OutOfRange {
        /// Reason of the `ErrorInfo`, such as `UPLOAD_OFFSET`.
        reason: &'static str,
        /// What is out of range, with the numbers.
        message: String,
        /// Numbers for programs to read, such as `expected_offset`.
        metadata: Vec<(&'static str, String)>,
    },
    /// As many as permitted are under way; try again.
    #[error("there are already {limit} {what}")]
    Overloaded {
        /// What there are too many of.
        what: &'static str,
        /// How many are permitted.
        limit: u64,
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
    /// The client's messages ended with this instead of their end.
    #[error("{message}")]
    Transport {
        /// Status code that the transport gave.
        code: Code,
        /// What the transport says.
        message: String,
    },
    /// The database cannot be used at the moment.
    #[error("the database is unavailable")]
    StoreUnavailable(#[source] Arc<StoreError>),
    /// A fault of the service; the log has the cause.
    #[error("internal error")]
    Internal(String),
}

fn invalid_message(violations: &[Violation]) -> String {
    let fields: Vec<String> =
        violations.iter().map(|violation| format!("{}: {}", violation.field, violation.description)).collect();
    format!("invalid request: {}", fields.join("; "))
}

impl Error {
    /// A single violation.
    pub fn invalid(field: impl Into<String>, description: impl Into<String>) -> Self {
        Self::Invalid(vec![Violation { field: field.into(), description: description.into() }])
    }

    /// A fault of the service, with what the log shall say.
    pub fn internal(cause: impl std::fmt::Display) -> Self {
        Self::Internal(cause.to_string())
    }

    /// Status code.
    #[must_use]
    pub const fn code(&self) -> Code {
        match self {
            Self::Invalid(_) => Code::InvalidArgument,
            Self::NotFound { .. } => Code::NotFound,
            Self::AlreadyExists { .. } | Self::RequestIdReused { .. } => Code::AlreadyExists,
            Self::EtagMismatch { .. } | Self::JobCancelled { .. } | Self::TakenUp { .. } => Code::Aborted,
            Self::Precondition { .. } => Code::FailedPrecondition,
            Self::OutOfRange { .. } => Code::OutOfRange,
            Self::Overloaded { .. } => Code::ResourceExhausted,
            Self::Draining | Self::StoreUnavailable(_) => Code::Unavailable,
            Self::DeadlineExceeded => Code::DeadlineExceeded,
            Self::Transport { code, .. } => *code,
            Self::Internal(_) => Code::Internal,
        }
    }

    /// Reason of the `ErrorInfo`: stable, for programs.
    #[must_use]
    pub const fn reason(&self) -> &'static str {
        match self {
            Self::Invalid(_) => "INVALID_FIELDS",
            Self::NotFound { .. } => "RESOURCE_NOT_FOUND",
            Self::AlreadyExists { .. } => "RESOURCE_EXISTS",
            Self::RequestIdReused { .. } => "REQUEST_ID_REUSED",
            Self::EtagMismatch { .. } => "ETAG_MISMATCH",
            Self::Precondition { reason, .. } | Self::OutOfRange { reason, .. } => reason,
            Self::Overloaded { .. } => "OVERLOADED",
            Self::Draining => "SERVER_DRAINING",
            Self::DeadlineExceeded => "DEADLINE_EXCEEDED",
            Self::Transport { .. } => "REQUEST_BROKEN_OFF",
            Self::JobCancelled { .. } => "JOB_CANCELLED",
            Self::TakenUp { .. } => "RUN_TAKEN_UP",
            Self::StoreUnavailable(_) => "STORE_UNAVAILABLE",
            Self::Internal(_) => "INTERNAL",
        }
    }

    fn details(&self) -> ErrorDetails {
        let mut details = ErrorDetails::with_error_info(self.reason(), DOMAIN, self.metadata());
        match self {
            Self::Invalid(violations) => {
                let violations: Vec<FieldViolation> = violations
                    .iter()
                    .map(|violation| FieldViolation::new(&violation.field, &violation.description))
                    .collect();
                details.set_bad_request(violations);
            }
            Self::NotFound { kind, name } | Self::AlreadyExists { kind, name } => {
                details.set_resource_info(kind, name, "", "");
            }
            Self::RequestIdReused { job, .. } => {
                details.set_resource_info("job", job, "", "");
            }
            Self::Precondition { reason, subject, message } => {
                details.add_precondition_failure_violation(*reason, subject, message);
            }
            Self::Overloaded { .. } | Self::Draining | Self::StoreUnavailable(_) => {
                details.set_retry_info(Some(RETRY_AFTER));
            }
            Self::EtagMismatch { .. }
            | Self::OutOfRange { .. }
            | Self::DeadlineExceeded
            | Self::Transport { .. }
            | Self::JobCancelled { .. }
            | Self::TakenUp { .. }
            | Self::Internal(_) => {}
        }
        details
    }

    fn metadata(&self) -> HashMap<String, String> {
        match self {
            Self::EtagMismatch { name, etag } => pairs([("resource", name.clone()), ("etag", etag.clone())]),
            Self::OutOfRange { metadata, .. } => pairs(metadata.iter().cloned()),
            Self::Overloaded { limit, .. } => pairs([("limit", limit.to_string())]),
            Self::JobCancelled { job } => pairs([("job", job.clone())]),
            Self::TakenUp { run } => pairs([("run", run.clone())]),
            Self::RequestIdReused { request_id, .. } => pairs([("request_id", request_id.clone())]),
            _ => HashMap::new(),
        }
    }

    /// HTTP status of the same error.
    #[must_use]
    pub const fn http_status(&self) -> http::StatusCode {
        match self.code() {
            Code::InvalidArgument | Code::FailedPrecondition | Code::OutOfRange => http::StatusCode::BAD_REQUEST,
            Code::NotFound => http::StatusCode::NOT_FOUND,
            Code::AlreadyExists | Code::Aborted => http::StatusCode::CONFLICT,
            Code::ResourceExhausted => http::StatusCode::TOO_MANY_REQUESTS,
            Code::Unavailable => http::StatusCode::SERVICE_UNAVAILABLE,
            Code::DeadlineExceeded => http::StatusCode::GATEWAY_TIMEOUT,
            _ => http::StatusCode::INTERNAL_SERVER_ERROR,
        }
    }
}

fn pairs(items: impl IntoIterator<Item = (&'static str, String)>) -> HashMap<String, String> {
    items.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

impl From<Error> for Status {
    fn from(error: Error) -> Self {
        match &error {
            Error::Internal(cause) => tracing::error!(%cause, "internal error"),
            Error::StoreUnavailable(cause) => tracing::error!(error = ?cause, "the database is unavailable"),
            _ => {}
        }
        Self::with_error_details(error.code(), error.to_string(), error.details())
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
            StoreError::LimitReached { what, limit } => Self::Overloaded { what, limit },
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
            other => {
                let source = std::error::Error::source(&other).map(|source| format!(": {source}")).unwrap_or_default();
                Self::internal(format!("{other}{source}"))
            }
        }
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
    };
    format!("{collection}/{id}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_violation_becomes_one_field_violation() {
        let mut violations = Violations::default();
        violations.add("machine", "must be set");
        violations.add("interpolation_period_us", "must be 50 to 20000, is 7");
        let status = Status::from(violations.finish().unwrap_err());
        assert_eq!(status.code(), Code::InvalidArgument);
        let details = status.get_error_details();
        let fields: Vec<_> = details.bad_request().unwrap().field_violations.iter().map(|v| v.field.as_str()).collect();
        assert_eq!(fields, ["machine", "interpolation_period_us"]);
        let info = details.error_info().unwrap();
        assert_eq!((info.reason.as_str(), info.domain.as_str()), ("INVALID_FIELDS", DOMAIN));
    }

    #[test]
    fn the_cause_of_an_internal_error_stays_inside() {
        let status = Status::from(Error::internal("secret path /var/lib"));
        assert_eq!(status.message(), "internal error");
    }

    #[test]
    fn a_draining_server_says_when_to_come_back() {
        let status = Status::from(Error::Draining);
        assert_eq!(status.code(), Code::Unavailable);
        assert_eq!(status.get_error_details().retry_info().unwrap().retry_delay, Some(RETRY_AFTER));
        assert_eq!(status.get_error_details().error_info().unwrap().reason, "SERVER_DRAINING");
    }

    #[test]
    fn a_wrong_offset_names_the_right_one() {
        let error = Error::from(StoreError::WrongOffset { upload_id: uuid::Uuid::nil(), expected: 4_096, given: 0 });
        let status = Status::from(error);
        assert_eq!(status.code(), Code::OutOfRange);
        assert_eq!(status.get_error_details().error_info().unwrap().metadata["expected_offset"], "4096");
    }
}
