//! What the black-box tests share: the built binary as a child process with a database of its own, clients, and the
//! decoding of setpoint streams. Nothing here knows the inside of the service.

mod chance;
mod client;
mod database;
mod freeform;
mod gate;
mod live;
mod memory;
mod patience;
mod programs;
mod raw;
mod run_ledger;
mod server;
mod setpoints;
mod web;

pub use chance::Chance;
pub use client::{Clients, Outcome, sha256_hex, upload, upload_messages};
pub use database::Database;
pub use freeform::{Directions, Freeform};
pub use gate::Gate;
pub use live::LiveClient;
pub use memory::{MemoryUse, measure_memory};
pub use patience::{PATIENCE, patiently, within_a_deadline};
pub use programs::{SHAFT, SHAFT_CURED, SHAFT_END_X_MM, SHAFT_END_Z_MM, long_dwell, many_blocks};
pub use raw::Raw;
pub use run_ledger::{LIVE_PART, Left, RunLedger, live_batch, live_config};
pub use server::{Home, Server, shared_store};
pub use setpoints::{Setpoints, header_of, stream};
pub use web::{Answer, Open, ServerEvent, Web};
