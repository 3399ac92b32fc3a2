//! The loop of page 04 closed over the pipeline, the simulated machine and the monitor.

mod faults;
mod feed;
mod harness;
mod sensors;
mod spindle;
