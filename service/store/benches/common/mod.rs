//! What the benchmarks of the store write.

use feedwave_store::{Fingerprint, NewJob, ProgramId, RawValue, Tenant};

/// A job of this program, unlike every other one.
pub fn new_job(program_id: ProgramId) -> NewJob {
    let request_id = uuid::Uuid::now_v7().to_string();
    let body = || RawValue::from_string(r#"{"axes":["X","Z"]}"#.into()).expect("JSON");
    NewJob {
        tenant: Tenant::DEFAULT,
        owner: String::new(),
        fingerprint: Fingerprint::of([request_id.as_bytes()]),
        request_id,
        display_name: "benchmark".into(),
        program_id,
        further_program_ids: Vec::new(),
        machine_id: "lathe-1".into(),
        client: String::new(),
        machine_snapshot: body(),
        settings: body(),
    }
}
