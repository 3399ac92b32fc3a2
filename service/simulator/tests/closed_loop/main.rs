//! Adaptive feed (docs/functions/adaptive-feed.md) closed over the pipeline, the simulated machine and the monitor.

mod faults;
mod feed;
mod harness;
mod sensors;
mod spindle;
