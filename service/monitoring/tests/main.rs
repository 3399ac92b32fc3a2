//! Monitoring: data, decisions, escalation, lobes.

mod bad_data;
mod common;
mod configuration;
mod decisions;
mod escalation;
mod lobes;
mod properties;
mod spindle_answers;
mod state_machine;
