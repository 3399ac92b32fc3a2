//! What all programs pass through: from operations to elements with their limits, from plans to setpoints, the pipeline around
//! both, and what is judged and reported of every program.

pub(crate) mod builder;
pub(crate) mod config;
pub(crate) mod interpolator;
pub(crate) mod interpretation;
pub(crate) mod pipeline;
pub(crate) mod profile;
pub(crate) mod report;
mod scout;
pub(crate) mod slowdown;
pub(crate) mod spindle_trial;
mod timed;
pub(crate) mod tool_path;
pub(crate) mod validation;
