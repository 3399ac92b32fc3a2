//! `feedwave._native`: the core as an extension of Python, for `feedwave.local`.
//!
//! Messages of the contract cross the border as bytes and columns as little-endian doubles, so that the package reads them with
//! what it reads answers of a service with. Python holds its lock only while it reads programs and takes results.

mod actions;
mod job;
mod refusal;
mod setpoints;
mod source;

use feedwave_contract::convert::profile_to_proto;
use feedwave_cutting::MachineProfile;
use prost::Message as _;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use refusal::refused;

/// The generic machine of a kind, `lathe` or `mill`: a `MachineProfile` as bytes.
#[pyfunction]
fn generic_profile<'py>(py: Python<'py>, kind: &str) -> PyResult<Bound<'py, PyBytes>> {
    let profile = match kind {
        "lathe" => MachineProfile::lathe(),
        "mill" => MachineProfile::mill(),
        _ => {
            return Err(refused(
                "INVALID_ARGUMENT",
                "",
                format!("the generic machines are lathe and mill, not {kind:?}"),
            ));
        }
    };
    Ok(PyBytes::new(py, &profile_to_proto(&profile).encode_to_vec()))
}

/// The core of feedwave.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("Refused", module.py().get_type::<refusal::Refused>())?;
    module.add_function(wrap_pyfunction!(generic_profile, module)?)?;
    module.add_class::<job::Job>()?;
    module.add_class::<setpoints::Setpoints>()?;
    module.add_class::<actions::Actions>()
}
