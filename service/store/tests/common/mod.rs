//! What the tests of the store write.

use feedwave_store::{Fingerprint, Json, NewJob, ProgramId, RawValue, Tenant};

pub(crate) fn json(text: &str) -> Json {
    RawValue::from_string(text.to_owned()).expect("test documents are JSON")
}

/// A job of this program that a request made.
pub(crate) fn new_job(request: &str, program_id: ProgramId) -> NewJob {
    NewJob {
        tenant: Tenant::DEFAULT,
        owner: String::new(),
        request_id: request.into(),
        fingerprint: Fingerprint::of([request.as_bytes()]),
        display_name: format!("job of {request}"),
        program_id,
        further_program_ids: Vec::new(),
        machine_id: "lathe-1".into(),
        client: String::new(),
        machine_snapshot: json(r#"{"axes":["X","Z"]}"#),
        settings: json(r#"{"interpolation_period_us":1000}"#),
    }
}
