//! The contract of the service, and everything that speaks it: generated types, conversion from and to the types of
//! the pure crates, the JSON mapping, resource names, HTTP routes, violations, delta coding.
//!
//! Invariant: no I/O. What a client may send is checked here, once, with every violation reported.

#![forbid(unsafe_code)]

/// Largest message that a client takes, and the most that a service may be configured to take, bytes.
pub const MAX_MESSAGE_BYTES: usize = 256 << 20;

pub mod code;
#[cfg(feature = "services")]
pub mod codec;
pub mod columns;
pub mod comments;
pub mod convert;
pub mod cost;
pub mod delta;
pub mod document;
pub mod json;
pub mod names;
pub mod openapi;
pub mod proto;
pub mod raw_double;
pub mod routes;
pub mod stream;
pub mod text;
pub mod violations;
