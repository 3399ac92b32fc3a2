//! The built binary as a black box: a child process with a real database file, spoken to through its ports.

/// The binary that cargo built along.
const FEEDWAVE: &str = env!("CARGO_BIN_EXE_feedwave");

mod access;
mod audit;
mod configuration;
mod connections;
mod cross_origin;
mod dashboards;
mod discovery;
mod documents;
mod durability;
mod escalation;
mod exclusive;
mod five_axis;
mod floor_tenants;
mod following;
mod guided_curves;
mod hostile;
mod identity_provider;
mod jobs;
mod learning;
mod lifecycle;
mod live_runs;
mod live_stream;
mod live_threads;
mod long_runs;
mod memory;
mod mqtt;
mod mtconnect;
mod offsets;
mod oscillation;
mod overrides;
mod replicas;
mod setpoints;
mod shop_floor;
mod spindle_changes;
mod status;
mod strangers;
mod streaming;
mod telemetry;
mod tenants;
mod thinning;
mod threads;
mod uploads;
mod validation_queue;
mod waiting_runs;
