//! What telemetry of steady cuts says about material and tool: specific cutting forces, run-out, natural frequencies, each with
//! its uncertainty (docs/functions/adaptive-feed.md, "Learning from runs").
//!
//! - **Forces**: the mechanistic model, linear in K_tc, K_te, K_rc and K_re (Altintas: Manufacturing Automation, 2nd ed.,
//!   Cambridge 2012, chapter 2), with chips that differ from edge to edge by the run-out of the edges (Kline and DeVor: The
//!   effect of runout on cutting geometry and forces in end milling, Int. J. Machine Tool Design and Research 23, 1983).
//! - **Tool**: one mode in each of two directions, whose stiffness is known; the deflection follows exactly from the force as it changes between two
//!   samples: where within them an edge enters, leaves, or has no chip any more.
//! - **Estimate**: all parameters at once by nonlinear least squares on the deflection (output error; Ljung: System Identification,
//!   2nd ed., Prentice Hall 1999, chapters 7 and 9) with Levenberg's and Marquardt's steps. Standard errors are those of the
//!   linearised model, σ²·(JᵀJ)⁻¹ (Seber and Wild: Nonlinear Regression, Wiley 1989, chapter 2), times √(1 + 2·Σρ_k) where the
//!   residuals are correlated (Bartlett). What of them comes again with every turn is what the model lacks, and counts as one turn,
//!   however long was recorded. A run-out is a length: its interval is that of Rice's distribution.
//!
//! Intervals hold the true value with 95 % where the model lacks nothing that moves it by more than what is seen to be left; entry, exit,
//! the first edge, depth and stiffness count as exact.
//!
//! Nothing here decides or changes anything: an estimate is a proposal.

mod chips;
mod conclude;
mod fit;
mod forces;
mod interval;
mod residuals;
mod response;
mod squares;
mod start;

use core::f64::consts::PI;
use core::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::batch::Pair;
use crate::lobes::Mode;
pub use response::settling_samples;

/// Least samples of a record behind its settling.
pub const MIN_RECORD_SAMPLES: usize = 500;
/// Most samples of all records.
pub const MAX_LEARNING_SAMPLES: usize = 4_000_000;
/// Most records.
pub const MAX_RECORDS: usize = 64;
/// Most edges.
const MAX_EDGES: u32 = 64;

/// What is known of the tool and of how it cuts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LearningModel {
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// Cutting edges, evenly spaced.
    pub edges: u32,
    /// Entry angle from the normal of the feed direction in the direction of rotation, rad, 0 to below π.
    pub entry_rad: f64,
    /// Exit angle, rad, above the entry angle, at most π.
    pub exit_rad: f64,
    /// Mode in X: its stiffness is taken as it is, frequency and damping are where the search starts.
    pub mode_x: Mode,
    /// Mode in Y.
    pub mode_y: Mode,
}

/// A stretch of a straight cut under constant conditions, sampled without gaps.
#[derive(Debug, Clone, Copy)]
pub struct CutRecord<'a> {
    /// Deflection of the tool, mm, from any zero.
    pub deflection_mm: Pair<'a>,
    /// Spindle angle, degrees, any number of turns.
    pub spindle_angle_deg: &'a [f64],
    /// Feed, mm/min.
    pub feed_mm_per_min: f64,
    /// Depth of cut, mm.
    pub depth_mm: f64,
    /// Direction of the feed in the axes of the sensors, a unit vector.
    pub feed_direction: [f64; 2],
    /// Spindle angle at which the first edge is where entry and exit angles count from, degrees.
    pub first_edge_deg: f64,
    /// Places of samples whose deflection is not known, ascending: they are not judged, whatever is there.
    pub missing: &'a [u32],
}

/// A value with its uncertainty.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Where the interval begins in which the true value is with a probability of 95 % at least.
    pub lower: f64,
    /// Where it ends.
    pub upper: f64,
}

impl Estimate {
    /// From where to where the true value is with a probability of 95 %; of a length, which is never below 0, with 95 % at least.
    #[must_use]
    pub const fn interval(&self) -> [f64; 2] {
        [self.lower, self.upper]
    }

    /// Whether the interval is all above 0.
    #[must_use]
    pub fn is_positive(&self) -> bool {
        self.lower > 0.0
    }
}

/// What was learnt of one direction of the tool.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct LearntMode {
    /// Natural frequency, Hz.
    pub frequency_hz: Estimate,
    /// Damping ratio.
    pub damping_ratio: Estimate,
}

/// What was learnt.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Learnt {
    /// K_tc: tangential force by chip thickness, N/mm².
    pub tangential_n_per_mm2: Estimate,
    /// K_te: tangential force of the edge, N/mm.
    pub edge_tangential_n_per_mm: Estimate,
    /// K_rc: radial force by chip thickness, N/mm².
    pub radial_n_per_mm2: Estimate,
    /// K_re: radial force of the edge, N/mm.
    pub edge_radial_n_per_mm: Estimate,
    /// Run-out of the edges, mm: half of the difference between opposite ones. `None` of a tool with one edge.
    pub edge_run_out_mm: Option<Estimate>,
    /// Run-out of the surface that the sensors see, mm: half of the total indicated reading.
    pub run_out_mm: Estimate,
    /// The mode in X.
    pub mode_x: LearntMode,
    /// The mode in Y.
    pub mode_y: LearntMode,
    /// Standard deviation of what is left of the deflection, mm.
    pub residual_mm: f64,
    /// Factor of the standard errors for correlated residuals; 1 where they are not.
    pub correlation_factor: f64,
    /// Samples that were judged, of either direction.
    pub samples: usize,
}

impl Learnt {
    /// The mode that answers the forces more: the one with the smaller dynamic stiffness 2ζk.
    #[must_use]
    pub fn dominant(&self, model: &LearningModel) -> LearntMode {
        let soft = |mode: &LearntMode, of: &Mode| mode.damping_ratio.value * of.stiffness_n_per_mm;
        if soft(&self.mode_x, &model.mode_x) <= soft(&self.mode_y, &model.mode_y) { self.mode_x } else { self.mode_y }
    }
}

/// Why nothing was learnt.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LearningError {
    /// A value of the model or of a record that is impossible.
    #[error("{field} must be {permitted}, is {value}")]
    Value {
        /// Which.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        permitted: &'static str,
    },
    /// Columns of a record of different lengths.
    #[error("record {record} has columns of different lengths")]
    Columns {
        /// Number of the record, from 0.
        record: usize,
    },
    /// Too few samples, or too many.
    #[error("{samples} samples {which}, {least} to {most} are needed")]
    Samples {
        /// How many there are.
        samples: usize,
        /// Of what.
        which: &'static str,
        /// Least number.
        least: usize,
        /// Largest number.
        most: usize,
    },
    /// The records do not tell a parameter from the others.
    #[error("the records do not tell the {0} from the rest")]
    NotIdentifiable(&'static str),
    /// The force by chip thickness is the same all the time.
    #[error(
        "the force by chip thickness does not change over a turn, and the records do not tell it from the zero of the deflection: as in a whole slot \
             with an even number of edges, four or more, that run true; cut less than the whole width"
    )]
    Steady,
    /// What explains the records best is nothing that a tool or a material has: entry, exit, rotation or the tool are other ones.
    #[error(
        "the {what} that explains the records best is {value}, not {least} to {most}: entry and exit angle, the angle of the first \
             edge, the depth or the modes are not those of these cuts"
    )]
    Implausible {
        /// Of what.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Least value that is possible.
        least: f64,
        /// Largest value that is possible.
        most: f64,
    },
    /// No parameters explain the records.
    #[error("the search ended after {0} steps without parameters that explain the records")]
    NoFit(u32),
}

/// Learns from records of cuts with one tool in one material; they may differ in feed, depth, direction and speed.
///
/// # Errors
/// [`LearningError`] where nothing can be learnt; never a guess.
pub fn learn(model: &LearningModel, records: &[CutRecord<'_>]) -> Result<Learnt, LearningError> {
    check(model, records)?;
    fit::fit(model, records)
}

fn within(
    field: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
    permitted: &'static str,
) -> Result<(), LearningError> {
    if range.contains(&value) { Ok(()) } else { Err(LearningError::Value { field, value, permitted }) }
}

fn check(model: &LearningModel, records: &[CutRecord<'_>]) -> Result<(), LearningError> {
    check_model(model)?;
    if !(1..=MAX_RECORDS).contains(&records.len()) {
        let which = "as records";
        return Err(LearningError::Samples { samples: records.len(), which, least: 1, most: MAX_RECORDS });
    }
    let mut all = 0;
    for (record, cut) in records.iter().enumerate() {
        check_record(model, record, cut)?;
        all += cut.spindle_angle_deg.len();
    }
    if all > MAX_LEARNING_SAMPLES {
        let which = "in all";
        return Err(LearningError::Samples { samples: all, which, least: 0, most: MAX_LEARNING_SAMPLES });
    }
    Ok(())
}

fn check_model(model: &LearningModel) -> Result<(), LearningError> {
    within("sample rate", model.sample_rate_hz, 100.0..=1e6, "100 to 1000000 Hz")?;
    within("number of edges", f64::from(model.edges), 1.0..=f64::from(MAX_EDGES), "1 to 64")?;
    within("entry angle", model.entry_rad, 0.0..=PI - 1e-3, "0 to below half a turn")?;
    let exit_rad = model.entry_rad + 1e-3..=PI + 1e-9;
    within("exit angle", model.exit_rad, exit_rad, "above the entry angle, at most half a turn")?;
    for mode in [&model.mode_x, &model.mode_y] {
        let frequency_hz = 1.0..=0.45 * model.sample_rate_hz;
        within("frequency", mode.frequency_hz, frequency_hz, "1 Hz to 0.45 of the sample rate")?;
        within("damping ratio", mode.damping_ratio, 1e-4..=0.9, "0.0001 to 0.9")?;
        within("stiffness", mode.stiffness_n_per_mm, 1e-3..=1e9, "0.001 to 1e9 N/mm")?;
    }
    Ok(())
}

fn check_record(model: &LearningModel, record: usize, cut: &CutRecord<'_>) -> Result<(), LearningError> {
    let samples = cut.spindle_angle_deg.len();
    if [cut.deflection_mm.x.len(), cut.deflection_mm.y.len()] != [samples; 2] {
        return Err(LearningError::Columns { record });
    }
    within("feed", cut.feed_mm_per_min, 1e-3..=1e6, "0.001 to 1000000 mm/min")?;
    within("depth", cut.depth_mm, 1e-6..=1e3, "0.000001 to 1000 mm")?;
    within("angle of the first edge", cut.first_edge_deg, -360.0..=360.0, "-360 to 360 degrees")?;
    if let Some(place) = cut.missing.iter().find(|place| **place as usize >= samples) {
        let (value, permitted) = (f64::from(*place), "that of a sample");
        return Err(LearningError::Value { field: "the place of a missing sample", value, permitted });
    }
    check_samples(settling_samples(model), "in a record", cut)?;
    let [x, y] = cut.feed_direction;
    within("length of the feed direction", libm::hypot(x, y), 1.0 - 1e-6..=1.0 + 1e-6, "1")?;
    let columns = [cut.deflection_mm.x, cut.deflection_mm.y, cut.spindle_angle_deg];
    if let Some(value) = columns.into_iter().flatten().find(|value| !value.is_finite()) {
        return Err(LearningError::Value { field: "a sample", value: *value, permitted: "finite" });
    }
    let turned_deg = cut.spindle_angle_deg[samples - 1] - cut.spindle_angle_deg[0];
    within("turns of the spindle in a record", turned_deg.abs() / 360.0, 3.0..=1e9, "3 at least")
}

/// Refuses a record of which too little is left behind so many samples.
fn check_samples(settling: usize, which: &'static str, cut: &CutRecord<'_>) -> Result<(), LearningError> {
    let (samples, most) = (cut.spindle_angle_deg.len(), MAX_LEARNING_SAMPLES);
    let least = MIN_RECORD_SAMPLES + settling;
    if samples < least {
        return Err(LearningError::Samples { samples, which, least, most });
    }
    let missing = cut.missing.iter().filter(|place| **place as usize >= settling).count();
    let samples = (samples - settling).saturating_sub(missing);
    if samples < MIN_RECORD_SAMPLES {
        let which = "of a record that are not missing";
        return Err(LearningError::Samples { samples, which, least: MIN_RECORD_SAMPLES, most });
    }
    Ok(())
}
