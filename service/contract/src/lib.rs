//! The contract of the service, and everything that speaks it: generated types, conversion from and to the types of
//! the pure crates, the JSON mapping, resource names, violations, delta coding.
//!
//! Invariant: no I/O. What a client may send is checked here, once, with every violation reported.

#![forbid(unsafe_code)]

pub mod convert;
pub mod delta;
pub mod json;
pub mod names;
pub mod proto;
pub mod text;
pub mod violations;
