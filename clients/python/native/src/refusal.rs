//! What is refused, in the terms in which a service refuses it.

use feedwave_contract::violations::Violations;
use prost::Message;
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(
    feedwave._native,
    Refused,
    PyException,
    "A refusal: status code, reason, message, violations as pairs of field and description, how many more there are."
);

/// A refusal without violations.
pub(crate) fn refused(code: &'static str, reason: &'static str, message: String) -> PyErr {
    Refused::new_err((code, reason, message, Vec::<(String, String)>::new(), 0))
}

/// Fields that are wrong.
pub(crate) fn finish(violations: Violations) -> PyResult<()> {
    let not_listed = violations.not_listed();
    let listed = violations.as_slice().iter();
    let pairs: Vec<_> = listed.map(|one| (one.field.clone(), one.description.clone())).collect();
    match violations.finish() {
        Ok(()) => Ok(()),
        Err(error) => {
            Err(Refused::new_err(("INVALID_ARGUMENT", "INVALID_FIELDS", error.to_string(), pairs, not_listed)))
        }
    }
}

/// A message from the package.
pub(crate) fn decoded<M: Message + Default>(bytes: &[u8]) -> PyResult<M> {
    M::decode(bytes).map_err(|error| refused("INVALID_ARGUMENT", "", error.to_string()))
}
