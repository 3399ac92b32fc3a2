//! Vibration along the programmed path (ES 2 634 340 T3): its settings and words, what has to hold before it
//! runs, and the drive-side reference generator. Setpoints themselves come out of the pipeline's interpolator.

mod amplitude;
mod analysis;
pub(crate) mod chip;
mod chip_blend;
mod chip_course;
mod chip_cures;
mod chip_findings;
mod chips;
pub(crate) mod code;
mod departure;
mod envelope;
mod expand;
mod findings;
mod following;
mod following_findings;
mod governed;
mod loads;
mod report;
mod robustness;
mod search;
mod section;
mod servo;
mod state;
mod superposition;
mod trial;
mod trial_cuts;
mod words;

use core::f64::consts::TAU;

pub use expand::ServoExpander;
use feedwave_motion::PathMotion;
pub use feedwave_motion::{fill_sin_turns, sin_turns};
use serde::{Deserialize, Serialize};

use amplitude::{Amplitude, PEAK_RESERVE, RAMP_VIBRATIONS};
pub(crate) use analysis::VibrationAnalysis;
pub use chip::*;
pub use departure::{Departure, JunctionDeparture};
pub(crate) use envelope::VibrationDemand;
pub use envelope::VibrationEnvelope;
pub use following::FollowingReport;
pub use report::{
    AxisLoadReport, BlendReport, ChipSpan, ExceededAxis, OverrideReport, PublishedEnds, SamplingReport,
    SectionPartStart, SectionReport, SurfaceCut,
};
pub use robustness::{ChipRobustness, CutTolerances, chip_robustness};
pub use search::{
    FoundVibration, SearchBlend, SearchCut, SearchGoals, SectionCorners, TooManyCorners, Unsearchable, VibrationSearch,
};
pub use section::SectionAnalyzer;
pub use servo::{ServoCondition, ServoPeriod, ServoWave, fill_servo_positions};
pub(crate) use state::{Vibration, VibrationInputs};
pub(crate) use superposition::{
    RunningVibration, SectionBarrier, SectionPart, SectionSamples, SectionStart, VibrationScratch,
};
pub use words::{MIN_FREQUENCY_HZ, VibrationWordSpans, condition_from_command};

/// How the vibration is put onto the path (docs/functions/path-vibration.md, "Three generation modes").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GenerationMode {
    /// The tool goes forwards and backwards on the programmed contour itself.
    #[default]
    AlongPath,
    /// The offset is added along the tangent: cheaper, leaves the contour on curves.
    Tangential,
    /// The drives generate the tangential vibration on their own, shorter period.
    ServoSide,
}

/// What a machine profile says about vibration along the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VibrationSettings {
    /// How it is generated unless a job says otherwise.
    pub generation_mode: GenerationMode,
    /// How it begins and ends unless a job says otherwise.
    pub envelope: VibrationEnvelope,
    /// Whether a peak beyond an axis' limit at the ends of a published vibration forbids the program; otherwise it is a
    /// warning.
    pub published_limits_bind: bool,
    /// Highest permitted frequency, Hz.
    pub max_frequency_hz: f64,
    /// Largest permitted amplitude, mm.
    pub max_amplitude_mm: f64,
    /// Permitted deviation from the contour in the tangential and servo-side modes, mm.
    pub contour_tolerance_mm: f64,
    /// Servo periods per interpolation period in the servo-side mode.
    pub servo_substeps: u32,
    /// Largest ratio of the amplitude to the programmed one at which it follows the feed override, so that the chip
    /// stays broken; the limits of the axes are kept at that amplitude. `None`: the amplitude stays as programmed.
    pub amplitude_follows_feed_up_to: Option<f64>,
}

impl VibrationSettings {
    /// Largest ratio at which a programmed amplitude follows the feed override, within the largest permitted amplitude.
    pub(crate) fn follows_up_to(&self, amplitude_mm: f64) -> Option<f64> {
        self.amplitude_follows_feed_up_to.map(|ratio| ratio.min(self.max_amplitude_mm / amplitude_mm).max(1.0))
    }

    /// Largest offset of a programmed amplitude, mm.
    pub(crate) fn reach_mm(&self, amplitude_mm: f64) -> f64 {
        amplitude_mm * self.follows_up_to(amplitude_mm).unwrap_or(1.0)
    }
}

impl Default for VibrationSettings {
    fn default() -> Self {
        Self {
            generation_mode: GenerationMode::AlongPath,
            envelope: VibrationEnvelope::Blended,
            published_limits_bind: false,
            max_frequency_hz: 500.0,
            max_amplitude_mm: 1.0,
            contour_tolerance_mm: 0.001,
            servo_substeps: 8,
            amplitude_follows_feed_up_to: None,
        }
    }
}

/// A programmed vibration a(t) = A·sin(2π·f·t).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct VibrationCondition {
    /// Frequency f, Hz.
    pub frequency_hz: f64,
    /// Amplitude A, mm; half the peak-to-peak travel.
    pub amplitude_mm: f64,
}

impl VibrationCondition {
    /// Peak velocity 2πf·A, acceleration (2πf)²·A and jerk (2πf)³·A along the path.
    #[must_use]
    pub fn peaks(&self) -> PathMotion {
        let rad_per_s = TAU * self.frequency_hz;
        let velocity = rad_per_s * self.amplitude_mm;
        PathMotion { velocity, acceleration: rad_per_s * velocity, jerk: rad_per_s * rad_per_s * velocity }
    }
}
