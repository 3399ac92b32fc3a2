//! Messages of the contract as documents of the store, which keeps their JSON without looking inside.

mod former;
mod runs;

use feedwave_contract::json;
pub(crate) use former::decision_from_stored;
use prost::Name;
pub(crate) use runs::{
    condition_to_proto, config_from_message, decision_from_record, name_decision, run_settings, run_state_to_proto,
};

use crate::error::{Error, Result};

/// A stored document, of an earlier version too; a fault of the service where it cannot be read.
///
/// # Errors
/// [`Error::Damaged`] when the text is not the JSON of such a message.
pub(crate) fn from_stored<M: Name + Default + 'static>(text: &str) -> Result<M> {
    former::document(text)
        .map_err(|error| Error::Damaged(format!("a stored {} cannot be read: {error}", M::full_name())))
}

/// A message as a document for the store.
///
/// # Errors
/// [`Error::Internal`] when it has a form that the store refuses.
pub(crate) fn to_stored<M: Name>(message: &M) -> Result<feedwave_store::Json> {
    feedwave_store::RawValue::from_string(json::to_string(message)).map_err(Error::internal)
}

/// Whether the stored body of a decision can be read, and what is wrong with it.
///
/// # Errors
/// Where it cannot.
pub fn read_decision(body: bytes::Bytes) -> std::result::Result<(), String> {
    let decision = decision_from_stored(body).map_err(|error| error.to_string())?;
    if decision.outcome.is_none() { Err("it decides nothing".to_owned()) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use feedwave_contract::proto;

    use super::*;

    #[test]
    fn stored_documents_survive_the_round_trip_and_later_fields() {
        let report = proto::ValidationReport {
            summary: Some(proto::ProgramSummary { duration_s: f64::INFINITY, lines: 3, ..Default::default() }),
            ..Default::default()
        };
        let stored = to_stored(&report).unwrap();
        assert_eq!(from_stored::<proto::ValidationReport>(stored.get()).unwrap(), report);
        assert!(from_stored::<proto::ValidationReport>(r#"{"laterField": 1}"#).is_ok());
        assert!(from_stored::<proto::ValidationReport>("[]").is_err());
    }

    #[test]
    fn an_error_is_written_with_its_details() {
        let status = tonic::Status::from(Error::invalid("page_size", "must not be negative"));
        let json: serde_json::Value = serde_json::from_str(&json::status_to_string(&status)).unwrap();
        assert_eq!(json["code"], 3);
        let kinds: Vec<_> = json["details"].as_array().unwrap().iter().map(|d| d["@type"].as_str().unwrap()).collect();
        assert!(kinds.contains(&"type.googleapis.com/google.rpc.BadRequest"), "{kinds:?}");
        assert!(kinds.contains(&"type.googleapis.com/google.rpc.ErrorInfo"), "{kinds:?}");
    }
}
