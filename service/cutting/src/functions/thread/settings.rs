//! What a machine profile says about threads and their vibration.

use feedwave_motion::ProfileProblem;
use serde::{Deserialize, Serialize};

use super::{StartUp, default_phase_shift_deg};

/// What a machine profile says about threading passes and their vibration (docs/functions/thread-vibration.md, "Program
/// words").
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ThreadVibrationSettings {
    /// Vibrations per spindle revolution D.
    pub vibrations_per_rev: f64,
    /// How the vibration of every pass starts.
    pub start_up: StartUp,
    /// Whether the preparatory movement of start-up A is part of the rapid before the pass, which then goes to the
    /// vibration position at once; otherwise X moves there after the rapid.
    pub combined_preparation: bool,
    /// Phase shift of odd passes without `R` word, degrees.
    pub odd_phase_shift_deg: f64,
    /// Phase shift of even passes without `R` word, degrees.
    pub even_phase_shift_deg: f64,
    /// Spindle angle of the thread-start reference point, degrees from 0 to 360 in the setpoints' spindle angle.
    pub reference_angle_deg: f64,
    /// Included angle of the tool where no cycle names it, degrees.
    pub included_angle_deg: f64,
    /// Distance from the start position of a thread to the work that programs keep, mm; the distance that the lead axis
    /// needs to come into step is compared with it where it is stated.
    pub approach_mm: Option<f64>,
    /// Largest chip thickness that the tool withstands, mm on the radius.
    pub max_thickness_mm: Option<f64>,
    /// Largest chip thickness that a finishing pass may find, mm on the radius; twice its infeed where not stated.
    pub max_finishing_thickness_mm: Option<f64>,
}

impl Default for ThreadVibrationSettings {
    fn default() -> Self {
        Self {
            vibrations_per_rev: 2.0,
            start_up: StartUp::Preparatory,
            combined_preparation: false,
            odd_phase_shift_deg: default_phase_shift_deg(0),
            even_phase_shift_deg: default_phase_shift_deg(1),
            reference_angle_deg: 0.0,
            included_angle_deg: 60.0,
            approach_mm: None,
            max_thickness_mm: None,
            max_finishing_thickness_mm: None,
        }
    }
}

impl ThreadVibrationSettings {
    /// Phase shift of a pass without `R` word, degrees; `pass` counts from 0 in its groove.
    #[must_use]
    pub fn phase_shift_deg(&self, pass: usize) -> f64 {
        if pass.is_multiple_of(2) { self.odd_phase_shift_deg } else { self.even_phase_shift_deg }
    }

    /// Everything that makes the settings unusable, with the field; empty when they are valid.
    #[must_use]
    pub fn problems(&self) -> Vec<ProfileProblem> {
        let mut problems = Vec::new();
        let mut require = |field: &str, is_valid: bool, value: f64, permitted: &str| {
            if !is_valid {
                let message = format!("must be {permitted}, is {value}");
                problems.push(ProfileProblem { field: field.to_owned(), message });
            }
        };
        let per_rev = self.vibrations_per_rev;
        require("vibrations_per_rev", (0.01..=100.0).contains(&per_rev), per_rev, "0.01 to 100");
        for (field, angle_deg) in [
            ("odd_phase_shift_deg", self.odd_phase_shift_deg),
            ("even_phase_shift_deg", self.even_phase_shift_deg),
            ("reference_angle_deg", self.reference_angle_deg),
        ] {
            require(field, (0.0..360.0).contains(&angle_deg), angle_deg, "0 to below 360");
        }
        let angle_deg = self.included_angle_deg;
        require("included_angle_deg", (1.0..=170.0).contains(&angle_deg), angle_deg, "1 to 170");
        for (field, value) in [
            ("approach_mm", self.approach_mm),
            ("max_thickness_mm", self.max_thickness_mm),
            ("max_finishing_thickness_mm", self.max_finishing_thickness_mm),
        ] {
            let value = value.unwrap_or(1.0);
            require(field, value.is_finite() && value > 0.0, value, "a positive finite number");
        }
        problems
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_problem_is_named_with_its_field() {
        assert_eq!(ThreadVibrationSettings::default().problems(), []);
        let settings = ThreadVibrationSettings {
            vibrations_per_rev: 0.0,
            odd_phase_shift_deg: f64::NAN,
            even_phase_shift_deg: 360.0,
            reference_angle_deg: -1.0,
            included_angle_deg: 180.0,
            approach_mm: Some(0.0),
            max_thickness_mm: Some(f64::INFINITY),
            max_finishing_thickness_mm: Some(-1.0),
            ..ThreadVibrationSettings::default()
        };
        let fields: Vec<String> = settings.problems().into_iter().map(|problem| problem.field).collect();
        let expected = [
            "vibrations_per_rev",
            "odd_phase_shift_deg",
            "even_phase_shift_deg",
            "reference_angle_deg",
            "included_angle_deg",
            "approach_mm",
            "max_thickness_mm",
            "max_finishing_thickness_mm",
        ];
        assert_eq!(fields, expected);
    }
}
