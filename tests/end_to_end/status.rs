//! Errors as clients read them.

use tonic::{Code, Status};
use tonic_types::StatusExt;

/// Checks code and reason of an error and that it names this service.
#[track_caller]
pub(crate) fn assert_error(status: &Status, code: Code, reason: &str) {
    let details = status.get_error_details();
    let info = details.error_info().unwrap_or_else(|| panic!("no ErrorInfo in {status:?}"));
    assert_eq!((status.code(), info.reason.as_str(), info.domain.as_str()), (code, reason, "feedwave"), "{status:?}");
}

/// Fields named by the violations of an error, sorted.
#[track_caller]
pub(crate) fn violated_fields(status: &Status) -> Vec<String> {
    assert_error(status, Code::InvalidArgument, "INVALID_FIELDS");
    let details = status.get_error_details();
    let violations = &details.bad_request().unwrap_or_else(|| panic!("no BadRequest in {status:?}")).field_violations;
    assert!(violations.iter().all(|violation| !violation.description.is_empty()));
    let mut fields: Vec<String> = violations.iter().map(|violation| violation.field.clone()).collect();
    fields.sort_unstable();
    fields
}
