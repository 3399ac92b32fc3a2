//! The service: gRPC and HTTP in front of the pipeline and the store.
//!
//! Machining happens in the pure crates; [`engine`] runs them on blocking threads and feeds them; [`api`] and [`http`]
//! are the two doors. Messages are converted in `feedwave-contract`, once on entry and once on exit.

mod accept;
pub mod access;
pub mod api;
mod audit;
mod conditional;
pub mod config;
mod connections;
mod cut_off;
pub mod engine;
pub mod error;
mod events;
mod floor;
pub mod http;
pub mod lifecycle;
mod lingering;
mod mqtt;
mod mtconnect;
pub mod observability;
pub mod readiness;
mod records;
mod retention;
pub mod rpc;
pub mod services;
mod stored;

pub use stored::read_decision;
