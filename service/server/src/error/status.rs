//! Errors as gRPC statuses with `google.rpc` details: the one place where statuses are made and bounded.
//!
//! A status travels in HTTP/2 trailers, and many clients refuse more than 8 KiB of them, all together and after
//! encoding: a longer one would lose even its code.

use std::collections::HashMap;
use std::time::Duration;

use feedwave_contract::text::{percent_encoded, shortened};
use feedwave_contract::violations::more;
use http::HeaderMap;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, FieldViolation, StatusExt};

use super::{DOMAIN, Error, Violation, Violations};

/// Most bytes of message and details as they are sent: the message percent-encoded, the details in base64.
pub const MAX_STATUS_BYTES: usize = 4_096;
/// Of these, most of the message.
const MAX_MESSAGE_BYTES: usize = 960;
/// Longest text in the details but those of violations, bytes.
const MAX_TEXT_BYTES: usize = 256;
/// Space for what the details have besides the message and the violations: type URLs, reason, domain, counts, lengths.
const FRAME_BYTES: usize = 320;
/// What a violation takes besides its texts: three tags, three lengths of two bytes.
const VIOLATION_BYTES: usize = 9;

/// After how long an overloaded service may be asked again.
pub(super) const RETRY_AFTER: Duration = Duration::from_secs(1);
/// After how long another replica may be asked: at once, but not by all clients in the same moment.
pub(super) const RETRY_ELSEWHERE_AFTER: Duration = Duration::from_millis(50);

/// Key of the number of violations that the details do not list.
const NOT_LISTED: &str = "violations_not_listed";

impl From<Error> for Status {
    fn from(error: Error) -> Self {
        match &error {
            Error::Internal(cause) => tracing::error!(%cause, "internal error"),
            Error::Damaged(cause) => tracing::error!(%cause, "stored data is damaged: `feedwave check` says what else"),
            Error::StoreUnavailable(cause) => tracing::error!(error = ?cause, "the store is unavailable"),
            // `complete` adds it, where the limits are known.
            Error::Transport(status) => return status.clone(),
            _ => {}
        }
        status_of(&error)
    }
}

impl From<Status> for Error {
    fn from(status: Status) -> Self {
        Self::Transport(status)
    }
}

/// Gives a status that the transport has made the details that all others have. Headers without such a status stay as
/// they are. `message_bytes` is the largest message.
pub(crate) fn complete(headers: &mut HeaderMap, message_bytes: usize) {
    let failed = headers.get(Status::GRPC_STATUS).is_some_and(|code| code != "0");
    if !failed || headers.contains_key(Status::GRPC_STATUS_DETAILS) {
        return;
    }
    let Some(status) = Status::from_header_map(headers) else { return };
    let error = match status.code() {
        // The one thing that the transport says with these codes, before and after decompression.
        Code::OutOfRange | Code::ResourceExhausted => Error::MessageTooLarge { limit: message_bytes },
        Code::Unimplemented if status.message().is_empty() => {
            Error::Transport(Status::unimplemented("there is no such method"))
        }
        _ => Error::Transport(status),
    };
    // It fails only for texts that are no header values, and these are encoded.
    let _ = status_of(&error).add_header(headers);
}

fn status_of(error: &Error) -> Status {
    let message = message(error);
    let details = details(error, &message);
    Status::with_error_details(error.code(), message, details)
}

fn wire_bytes(text: &str) -> usize {
    text.chars().map(percent_encoded).sum()
}

fn message(error: &Error) -> String {
    match error {
        Error::Invalid(violations) => invalid_message(violations),
        _ => shortened(&error.to_string(), MAX_MESSAGE_BYTES, percent_encoded).into_owned(),
    }
}

/// As many violations as fit, at least the first.
fn invalid_message(violations: &Violations) -> String {
    let mut message = String::from("invalid request: ");
    let space = MAX_MESSAGE_BYTES - wire_bytes(&message) - wire_bytes("; ") - wire_bytes(&more(usize::MAX));
    let mut left = space;
    for (index, violation) in violations.as_slice().iter().enumerate() {
        let text = violation.to_string();
        let separator = if index == 0 { "" } else { "; " };
        match left.checked_sub(wire_bytes(separator) + wire_bytes(&text)) {
            Some(rest) => left = rest,
            None if index == 0 => left = 0,
            None => return format!("{message}; {}", more(violations.count() - index)),
        }
        message.push_str(separator);
        message.push_str(&shortened(&text, space, percent_encoded));
    }
    if violations.not_listed() > 0 {
        message = format!("{message}; {}", more(violations.not_listed()));
    }
    message
}

fn details(error: &Error, message: &str) -> ErrorDetails {
    let text = |text: &str| shortened(text, MAX_TEXT_BYTES, char::len_utf8).into_owned();
    let mut metadata = metadata(error);
    metadata.values_mut().for_each(|value| *value = text(value));
    let mut details = ErrorDetails::new();
    match error {
        Error::Invalid(violations) => {
            let listed = listed(violations, message);
            let not_listed = violations.count() - listed.len();
            if not_listed > 0 {
                metadata.insert(NOT_LISTED.to_owned(), not_listed.to_string());
            }
            details.set_bad_request(listed);
        }
        Error::NotFound { kind, name } | Error::AlreadyExists { kind, name } => {
            details.set_resource_info(kind, text(name), "", "");
        }
        Error::RequestIdReused { job, .. } => {
            details.set_resource_info("job", job, "", "");
        }
        Error::Precondition { reason, subject, .. } => {
            let description = shortened(message, 2 * MAX_TEXT_BYTES, char::len_utf8);
            details.add_precondition_failure_violation(*reason, text(subject), description);
        }
        Error::MessageTooLarge { .. } => {
            details.add_quota_failure_violation("limits.message_bytes", message);
        }
        Error::ClientOverloaded { key, .. } | Error::MessageTooCostly { key, .. } => {
            details.add_quota_failure_violation(*key, message);
        }
        Error::EtagMismatch { .. }
        | Error::OutOfRange { .. }
        | Error::Overloaded { .. }
        | Error::Unread { .. }
        | Error::Unauthenticated { .. }
        | Error::PermissionDenied { .. }
        | Error::TenantDenied { .. }
        | Error::HostDenied
        | Error::KeysUnavailable
        | Error::RequestStalled { .. }
        | Error::Draining
        | Error::StoreUnavailable(_)
        | Error::CutOff
        | Error::DeadlineExceeded
        | Error::OnlyRead
        | Error::Transport(_)
        | Error::JobCancelled { .. }
        | Error::TakenUp { .. }
        | Error::Damaged(_)
        | Error::Internal(_) => {}
    }
    if let Some(after) = error.retry_after() {
        details.set_retry_info(Some(after));
    }
    details.set_error_info(error.reason(), DOMAIN, metadata);
    details
}

/// The first violations, as many as fit next to the message.
fn listed(violations: &Violations, message: &str) -> Vec<FieldViolation> {
    // Base64 makes four bytes of three, and the details repeat the message.
    let space = (MAX_STATUS_BYTES - wire_bytes(message)) / 4 * 3;
    let mut left = space.saturating_sub(message.len() + FRAME_BYTES);
    let fits = |violation: &&Violation| {
        let rest = left.checked_sub(violation.field.len() + violation.description.len() + VIOLATION_BYTES);
        left = rest.unwrap_or(left);
        rest.is_some()
    };
    let field_violation = |violation: &Violation| FieldViolation::new(&violation.field, &violation.description);
    violations.as_slice().iter().take_while(fits).map(field_violation).collect()
}

fn metadata(error: &Error) -> HashMap<String, String> {
    match error {
        Error::EtagMismatch { name, etag } => pairs([("resource", name.clone()), ("etag", etag.clone())]),
        Error::OutOfRange { metadata, .. } => pairs(metadata.iter().cloned()),
        Error::Overloaded { limit, .. } | Error::ClientOverloaded { limit, .. } => {
            pairs([("limit", limit.to_string())])
        }
        Error::PermissionDenied { role, .. } => pairs([("role", (*role).to_owned())]),
        Error::MessageTooLarge { limit } => pairs([("limit_bytes", limit.to_string())]),
        Error::MessageTooCostly { bytes, limit, .. } => {
            pairs([("limit_bytes", limit.to_string()), ("bytes", bytes.to_string())])
        }
        Error::JobCancelled { job } => pairs([("job", job.clone())]),
        Error::TakenUp { run } => pairs([("run", run.clone())]),
        Error::RequestIdReused { request_id, .. } => pairs([("request_id", request_id.clone())]),
        _ => HashMap::new(),
    }
}

fn pairs(items: impl IntoIterator<Item = (&'static str, String)>) -> HashMap<String, String> {
    items.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

/// Name of a status code as the gRPC documentation writes it.
#[must_use]
pub const fn code_name(code: Code) -> &'static str {
    match code {
        Code::Ok => "OK",
        Code::Cancelled => "CANCELLED",
        Code::Unknown => "UNKNOWN",
        Code::InvalidArgument => "INVALID_ARGUMENT",
        Code::DeadlineExceeded => "DEADLINE_EXCEEDED",
        Code::NotFound => "NOT_FOUND",
        Code::AlreadyExists => "ALREADY_EXISTS",
        Code::PermissionDenied => "PERMISSION_DENIED",
        Code::ResourceExhausted => "RESOURCE_EXHAUSTED",
        Code::FailedPrecondition => "FAILED_PRECONDITION",
        Code::Aborted => "ABORTED",
        Code::OutOfRange => "OUT_OF_RANGE",
        Code::Unimplemented => "UNIMPLEMENTED",
        Code::Internal => "INTERNAL",
        Code::Unavailable => "UNAVAILABLE",
        Code::DataLoss => "DATA_LOSS",
        Code::Unauthenticated => "UNAUTHENTICATED",
    }
}

#[cfg(test)]
mod tests;
