//! The service through its own ports: real clients, real connections on free ports, a real database file for
//! each test.

mod five_axis;
mod jobs;
mod lobes;
mod operation;
mod oscillation;
mod programs;
mod raw;
mod runs;
mod setpoints;
mod support;
mod telemetry;
mod transport;
mod uploads;
