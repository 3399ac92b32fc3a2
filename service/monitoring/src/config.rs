//! Configuration of one monitored run; what is impossible is refused field by field.

mod validate;

use crate::rules::Rules;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What a pair of sensors measures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Quantity {
    /// Distance in mm.
    Displacement,
    /// Strain, turned into displacement.
    Strain {
        /// mm of displacement per unit of strain (1, not µm/m).
        mm_per_strain: f64,
    },
    /// Acceleration in mm/s²; that of the commanded motion is subtracted.
    Acceleration,
}

/// A pair of sensors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sensors {
    /// What it measures.
    pub quantity: Quantity,
    /// Smallest value the sensor can give, in its own unit; what lies below is wrong data.
    pub min: f64,
    /// Largest value the sensor can give.
    pub max: f64,
}

/// How samples are averaged before they are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Grouping {
    /// By spindle angle: points A_i of 360°/n each (36 points of 10°, 72 of 5°).
    Angle {
        /// n.
        points: u32,
    },
    /// In time: consecutive samples.
    Time {
        /// Samples averaged into one point.
        samples_per_point: u32,
    },
}

/// How long is collected.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Length {
    /// This many seconds.
    Seconds(f64),
    /// Until each angular point was passed this often (k) and there are [`Quality::min_valid_samples`]; needs the
    /// grouping by angle.
    Series(u32),
}

/// The tool's check on the baseline: a limit that is exceeded by either sensor means "replace the tool".
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ToolCheck {
    /// C, limit of (max X⁰ − min X⁰)/max X⁰; for distances only.
    pub max_ratio: Option<f64>,
    /// Limit of max X⁰ − min X⁰ in mm (mm/s² with accelerations): does not depend on the stand-off.
    pub max_run_out: Option<f64>,
}

/// Spindle raised step by step without cutting, before work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IdleRunUp {
    /// Speeds of the steps in rev/min, rising.
    pub spindle_rev_per_min: Vec<f64>,
    /// A sample belongs to a step when its speed is this close, as a fraction.
    pub speed_tolerance: f64,
    /// How long each step is collected.
    pub length: Length,
    /// Largest |X_i¹ − X_i⁰| of a healthy machine, mm (mm/s² with accelerations).
    pub max_difference: f64,
}

impl IdleRunUp {
    /// A run-up over these speeds with the defaults: three series at each, speeds within 2 %, a healthy machine within
    /// 0.001 mm.
    pub const fn over(spindle_rev_per_min: Vec<f64>) -> Self {
        Self { spindle_rev_per_min, speed_tolerance: 0.02, length: Length::Series(3), max_difference: 0.001 }
    }
}

/// Where the contact of tool and work is known from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum ContactSource {
    /// The contact column.
    Flag,
    /// The deviation from the baseline.
    Detected {
        /// A deviation above this means contact, mm (mm/s² with accelerations).
        threshold: f64,
        /// Consecutive valid samples above it that make contact.
        on_samples: u32,
        /// Consecutive valid samples at or below it that end contact.
        off_samples: u32,
    },
}

impl ContactSource {
    /// [`ContactSource::Detected`]: samples that make contact by default, 1 ms at 20 kHz.
    pub const ON_SAMPLES: u32 = 20;
    /// Samples that end it by default, 0.1 s at 20 kHz.
    pub const OFF_SAMPLES: u32 = 2_000;
}

/// Spectrum of a window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpectrumConfig {
    /// Samples transformed, a power of two: the last ones of the window.
    pub samples: u32,
    /// Lines below this frequency in Hz are not vibration.
    pub min_frequency_hz: f64,
    /// A line below this amplitude is noise and never chatter; unit of the deviation.
    pub noise_floor: f64,
    /// How far a line may be from a harmonic of the spindle, Hz.
    pub harmonic_tolerance_hz: f64,
    /// Cutting edges z; harmonics of z·n are edge passing.
    pub edges: u32,
}

impl Default for SpectrumConfig {
    fn default() -> Self {
        Self { samples: 4_096, min_frequency_hz: 20.0, noise_floor: 0.000_2, harmonic_tolerance_hz: 3.0, edges: 1 }
    }
}

/// Removes single values that jump: a step larger than `max_step` from the last good value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpikeFilter {
    /// Largest believable step between samples, in the sensor's unit.
    pub max_step: f64,
    /// After this many in a row the jump is real and accepted.
    pub max_run: u32,
}

impl SpikeFilter {
    /// [`SpikeFilter::max_run`] by default.
    pub const MAX_RUN: u32 = 3;
}

/// When data is too bad to decide on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Spike removal.
    pub spikes: Option<SpikeFilter>,
    /// Fewest valid samples of a window.
    pub min_valid_samples: u32,
    /// Largest fraction of a window's samples that may be removed.
    pub max_removed: f64,
    /// A channel that repeats exactly the same value this often is stuck.
    pub stuck_samples: u32,
    /// Largest time between two samples, s; beyond it the window is void.
    pub max_gap_s: f64,
    /// Telemetry that is silent for this long while cutting brings the fallback, s.
    pub silence_s: f64,
    /// A sample this much older than the clock is stale, s.
    pub stale_s: f64,
    /// A window by series that takes longer is given up, s.
    pub max_window_s: f64,
}

/// Configuration of one run: one tool on one machine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MonitoringConfig {
    /// Nominal samples per second of every channel.
    pub sample_rate_hz: f64,
    /// Sensors at the tool.
    pub tool: Option<Sensors>,
    /// Sensors at the workpiece; with both, the relative vector tool − workpiece is used.
    pub work: Option<Sensors>,
    /// Averaging.
    pub grouping: Grouping,
    /// How long the baseline is collected.
    pub baseline: Length,
    /// Tool check on the baseline.
    pub tool_check: ToolCheck,
    /// Optional idle run-up.
    pub idle_run_up: Option<IdleRunUp>,
    /// Contact.
    pub contact: ContactSource,
    /// Waiting time after contact, s.
    pub settling_s: f64,
    /// How long a window is.
    pub window: Length,
    /// Optional spectrum.
    pub spectrum: Option<SpectrumConfig>,
    /// Demands on data.
    pub quality: Quality,
    /// Limits and steps.
    pub rules: Rules,
}

impl Default for MonitoringConfig {
    /// Defaults of docs/functions/adaptive-feed.md, "Settings": displacement at the tool, 36 points, run-out 2 %,
    /// settling 10 s, windows of 2 s.
    fn default() -> Self {
        Self {
            sample_rate_hz: 20_000.0,
            tool: Some(Sensors { quantity: Quantity::Displacement, min: 0.0, max: 100.0 }),
            work: None,
            grouping: Grouping::Angle { points: 36 },
            baseline: Length::Series(3),
            tool_check: ToolCheck { max_ratio: Some(0.02), max_run_out: None },
            idle_run_up: None,
            contact: ContactSource::Flag,
            settling_s: 10.0,
            window: Length::Seconds(2.0),
            spectrum: None,
            quality: Quality {
                spikes: None,
                min_valid_samples: 1_000,
                max_removed: 0.1,
                stuck_samples: 1_000,
                max_gap_s: 0.01,
                silence_s: 0.5,
                stale_s: 1.0,
                max_window_s: 60.0,
            },
            rules: Rules::default(),
        }
    }
}

impl MonitoringConfig {
    /// Unit of the deviation: mm, or mm/s² with acceleration sensors.
    pub fn deviation_unit(&self) -> &'static str {
        let is_acceleration = |sensors: Sensors| sensors.quantity == Quantity::Acceleration;
        if self.tool.or(self.work).is_some_and(is_acceleration) { "mm/s²" } else { "mm" }
    }

    /// All that is wrong, one violation per field; empty when the monitor can run.
    pub fn violations(&self) -> Vec<Violation> {
        validate::violations(self)
    }

    /// Number of averaged points: those of the circle, or one in time.
    pub(crate) fn points(&self) -> usize {
        match self.grouping {
            Grouping::Angle { points } => points as usize,
            Grouping::Time { .. } => 1,
        }
    }
}

/// One impossible field of the configuration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// Path of the field as the contract has it, e.g. `rules.feed.lower` or `rules.spindle.milling.table[1].up_to_rev_per_min`.
    pub field: String,
    /// What is wrong and what would be right, with numbers.
    pub problem: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.field, self.problem)
    }
}
