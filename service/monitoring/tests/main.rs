//! Monitoring: data, decisions, escalation, lobes.

mod bad_data;
mod common;
mod configuration;
mod decisions;
mod escalation;
mod lobes;
mod properties;
mod random_bytes;
mod spindle_answers;
mod state_machine;
