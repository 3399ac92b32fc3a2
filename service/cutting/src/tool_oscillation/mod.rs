//! Oscillation of a rotary tool with several edges (JP 7583159 B2): in step with its rotation the tool goes back and
//! forth along the feed and up and down along its axis, so that some edges rough and others finish in one pass.
//!
//! Everything is a function of the spindle angle. Axial offsets are **retractions**, positive away from the work; a
//! protrusion is the negative of one. Amplitudes are half the peak-to-peak travel.

mod condition;
mod curve;
mod findings;
mod floor;
mod motion;
mod removal;
mod report;
mod tool;
mod waveform;

pub use condition::{
    ConditionTable, DirectionOscillation, Interpolation, LeadingEdge, MAX_CONDITIONS, MAX_RAMP_PERIODS,
    MAX_TABLE_POINTS, NamedCondition, OscillationCondition, OscillationPeriod, RoleRotation, TableQuantity,
    condition_problems, find_condition, nearest_periods_per_rev,
};
pub use floor::{FloorArea, FloorError, HeightField, MAX_FLOOR_CELLS, Roughness};
pub use motion::{BLEND_STEEPNESS, DirectionMotion, DirectionPeaks, ToolOffset, ToolOscillation, blend, ramp_mm};
pub use removal::{EdgePass, EdgeReport, OscillationCut, RemovedLayer, plane_section};
pub use report::{
    DirectionLimits, DirectionLoad, FloorReport, OscillationDirection, OscillationJob, OscillationLimits,
    OscillationReport, OscillationSectionReport, PlainEdge, judge, synchronise,
};
pub use tool::{CuttingEdge, MAX_EDGES, ToolError, ToolGeometry};
pub use waveform::{MAX_HOLD_SHARE, MAX_WAVE_POINTS, MIN_WAVE_POINT_TURNS, Wave, WavePeaks, Waveform, WaveformError};
