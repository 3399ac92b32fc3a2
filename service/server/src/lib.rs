//! The service: gRPC and HTTP in front of the pipeline and the store, and the command line.
//!
//! Generated protobuf types stay at the edge: they are converted once on entry, with every violation reported,
//! and once on exit ([`convert`]). Machining happens in the pure crates; [`engine`] runs them on blocking threads
//! and feeds them; [`api`] and [`http`] are the two doors. [`cli`] is what people type, with files of setpoints
//! ([`output`]) and pictures ([`plot`]).

pub mod api;
pub mod args;
pub mod cli;
mod client_tls;
pub mod config;
pub mod convert;
pub mod delta;
pub mod engine;
pub mod error;
pub mod healthcheck;
pub mod http;
pub mod json;
pub mod lifecycle;
mod lingering;
pub mod names;
pub mod observability;
pub mod output;
pub mod plot;
pub mod proto;
pub mod serve;
mod services;
