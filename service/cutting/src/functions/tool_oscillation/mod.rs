//! Oscillation of a rotary tool with several edges (JP 7583159 B2): in step with its rotation the tool goes back and
//! forth along the feed and up and down along its axis, so that some edges rough and others finish in one pass.
//!
//! Everything is a function of the spindle angle. Axial offsets are **retractions**, positive away from the work; a
//! protrusion is the negative of one. Amplitudes are half the peak-to-peak travel.

mod blended;
pub(crate) mod code;
mod condition;
mod curve;
mod engagement;
mod feed_direction;
mod feed_range;
mod findings;
mod floor;
mod floor_area;
mod following;
mod inclination;
mod judgement;
mod judgements;
mod limits;
mod motion;
mod problems;
mod removal;
mod report;
mod request;
mod state;
mod superposition;
mod table;
mod values;
mod waveform;

pub use crate::shared::blend::{BLEND_STEEPNESS, blend};
pub use crate::shared::tool::{CuttingEdge, MAX_EDGES, ToolError, ToolGeometry};
pub use condition::{
    ConditionChoice, DirectionOscillation, LeadingEdge, MAX_CONDITION_TABLES, MAX_CONDITION_TOOLS, MAX_CONDITIONS,
    MAX_RAMP_PERIODS, NamedCondition, OscillationCondition, OscillationPeriod, RoleRotation, find_condition,
    nearest_periods_per_rev,
};
pub use engagement::{Engagement, WorkSide};
pub use floor::{FloorArea, FloorError, HeightField, MAX_FLOOR_CELLS, Roughness};
pub use floor_area::{FloorSettings, MAX_FLOOR_REVOLUTIONS};
pub use following::{DirectionFollowing, OscillationDrives, OscillationFollowing};
use judgements::Judgements;
pub(crate) use limits::LeftOver;
pub use motion::{DirectionMotion, DirectionPeaks, ToolOffset, ToolOscillation, ramp_mm};
pub use problems::condition_problems;
pub use removal::{EdgePass, EdgeReport, OscillationCut, RemovedLayer, plane_section};
pub use report::{
    DirectionLimits, DirectionLoad, FloorReport, OscillationDirection, OscillationJob, OscillationLimits,
    OscillationReport, OscillationSectionReport, PlainEdge, RoleReport, judge, synchronise,
};
pub use request::OscillationRequest;
use request::known_names;
pub(crate) use state::{Oscillation, OscillationAnalysis, OscillationInputs};
pub(crate) use superposition::{OscillationBarrier, OscillationRun, OscillationScratch};
pub use table::{ConditionTable, Interpolation, MAX_TABLE_POINTS, TableQuantity};

pub use waveform::{MAX_HOLD_SHARE, MAX_WAVE_POINTS, MIN_WAVE_POINT_TURNS, Wave, WavePeaks, Waveform, WaveformError};
