//! The machine: its axes, their limits, and how work positions become axis positions.

use feedwave_program::{AXIS_COUNT, Axis};
use serde::{Deserialize, Serialize};

/// Kind of machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MachineKind {
    /// Turning: the workpiece rotates.
    Lathe,
    /// Milling: the tool rotates.
    Mill,
}

/// What an axis moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CarriedBy {
    /// The axis moves the tool: axis position = work position + offset.
    #[default]
    Tool,
    /// The axis moves the workpiece in the opposite sense: axis position = −(work position + offset).
    Workpiece,
}

/// One machine axis: mm for linear axes, degrees for rotary ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MachineAxis {
    /// Column name in the setpoints, such as `X` or `X1`.
    pub name: String,
    /// Axis letter of the program that it carries out. Several axes may carry out one letter, as on a gantry: each
    /// follows it with its own limits.
    pub axis: Axis,
    /// Largest velocity, mm/s or degrees/s.
    pub max_velocity_per_s: f64,
    /// Largest acceleration, mm/s² or degrees/s².
    pub max_acceleration_per_s2: f64,
    /// Largest jerk, mm/s³ or degrees/s³.
    pub max_jerk_per_s3: f64,
    /// Largest step of the velocity permitted at a corner in exact path mode, mm/s or degrees/s; with 0 the path rests
    /// at corners that this axis takes part in.
    #[serde(default)]
    pub max_velocity_step_per_s: f64,
    /// Lowest position, machine coordinates; unlimited when absent.
    #[serde(default)]
    pub travel_min: Option<f64>,
    /// Highest position, machine coordinates; unlimited when absent.
    #[serde(default)]
    pub travel_max: Option<f64>,
    /// Whether it moves the tool or the workpiece.
    #[serde(default)]
    pub carried_by: CarriedBy,
}

impl MachineAxis {
    /// A tool-carried axis without travel limits, named after its letter.
    #[must_use]
    pub fn new(axis: Axis, max_velocity_per_s: f64, max_acceleration_per_s2: f64, max_jerk_per_s3: f64) -> Self {
        Self {
            name: axis.letter().to_string(),
            axis,
            max_velocity_per_s,
            max_acceleration_per_s2,
            max_jerk_per_s3,
            max_velocity_step_per_s: 0.0,
            travel_min: None,
            travel_max: None,
            carried_by: CarriedBy::Tool,
        }
    }

    /// −1 where the axis carries the workpiece, 1 where it carries the tool.
    #[must_use]
    pub const fn sign(&self) -> f64 {
        match self.carried_by {
            CarriedBy::Tool => 1.0,
            CarriedBy::Workpiece => -1.0,
        }
    }
}

/// One machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Turning or milling.
    pub kind: MachineKind,
    /// The axes, in the order of the setpoint columns: 1 to 9.
    pub axes: Vec<MachineAxis>,
    /// Highest spindle speed, rev/min.
    pub max_spindle_rev_per_min: f64,
}

/// Something that makes a profile unusable.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProfileProblem {
    /// Path of the field, such as `axes[0].max_velocity_per_s`.
    pub field: String,
    /// What is wrong with it.
    pub message: String,
}

/// Most axes of a machine: as many as a program can address.
const MAX_AXES: usize = AXIS_COUNT;
/// Range of an axis limit, per second, second² or second³. It holds every machine from a nanopositioner's to a
/// fast-tool drive's axis, and keeps every figure derived from it (squares, cubes, quotients) finite.
const LIMIT_RANGE: (f64, f64) = (1e-3, 1e15);
/// Range of the largest velocity step, mm/s or degrees/s.
const VELOCITY_STEP_RANGE: (f64, f64) = (0.0, 1e3);
/// Largest travel, mm or degrees: beyond it a double no longer resolves a nanometre.
const MAX_TRAVEL: f64 = 1e6;
/// Range of the highest spindle speed, rev/min; the fastest spindles made reach some 300 000.
const SPINDLE_RANGE: (f64, f64) = (1e-3, 1e6);

/// Linear axes of a modern lathe or mill with linear or stiff screw drives: 500 mm/s (30 m/min), 10 m/s² (1 g) and
/// a jerk that permits the typical chip-breaking vibration (50 Hz, 0.1 mm has 3 100 m/s³).
const LINEAR_AXIS: (f64, f64, f64) = (500.0, 10_000.0, 5_000_000.0);

impl Machine {
    /// A generic lathe with X and Z.
    #[must_use]
    pub fn lathe() -> Self {
        Self { kind: MachineKind::Lathe, axes: linear_axes(&[Axis::X, Axis::Z]), max_spindle_rev_per_min: 5_000.0 }
    }

    /// A generic three-axis mill.
    #[must_use]
    pub fn mill() -> Self {
        let axes = linear_axes(&[Axis::X, Axis::Y, Axis::Z]);
        Self { kind: MachineKind::Mill, axes, max_spindle_rev_per_min: 24_000.0 }
    }

    /// Whether an axis states an end of its travel.
    #[must_use]
    pub fn has_travel(&self) -> bool {
        self.axes.iter().any(|axis| axis.travel_min.is_some() || axis.travel_max.is_some())
    }

    /// First column of a program axis; there may be more.
    #[must_use]
    pub fn column_of(&self, axis: Axis) -> Option<usize> {
        self.axes.iter().position(|machine_axis| machine_axis.axis == axis)
    }

    /// Axis position of a work position, per column: sign · (work + offset).
    #[must_use]
    pub fn axis_value(&self, column: usize, work_value: f64, work_offset: f64) -> f64 {
        self.axes[column].sign() * (work_value + work_offset)
    }

    /// Everything that makes the machine unusable; empty when it is valid.
    #[must_use]
    pub fn validate(&self) -> Vec<ProfileProblem> {
        let mut problems = Vec::new();
        let mut add = |field: String, message: String| problems.push(ProfileProblem { field, message });
        if !(1..=MAX_AXES).contains(&self.axes.len()) {
            add("axes".to_owned(), format!("must list 1 to {MAX_AXES} axes, lists {}", self.axes.len()));
        }
        // A list that is too long says enough; looking for duplicates in all of it would cost its square.
        for (index, axis) in self.axes.iter().take(MAX_AXES).enumerate() {
            let field = |name: &str| format!("axes[{index}].{name}");
            let positive = [
                ("max_velocity_per_s", axis.max_velocity_per_s),
                ("max_acceleration_per_s2", axis.max_acceleration_per_s2),
                ("max_jerk_per_s3", axis.max_jerk_per_s3),
            ];
            for (name, value) in positive {
                if let Some(message) = out_of_range(value, LIMIT_RANGE) {
                    add(field(name), message);
                }
            }
            if let Some(message) = out_of_range(axis.max_velocity_step_per_s, VELOCITY_STEP_RANGE) {
                add(field("max_velocity_step_per_s"), message);
            }
            let is_name = |name: &str| {
                (1..=16).contains(&name.len()) && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
            };
            if !is_name(&axis.name) {
                add(field("name"), "must be 1 to 16 letters, digits or underscores".to_owned());
            }
            if self.axes[..index].iter().any(|other| other.name == axis.name) {
                add(field("name"), format!("{} names two axes", axis.name));
            }
            for (name, limit) in [("travel_min", axis.travel_min), ("travel_max", axis.travel_max)] {
                if let Some(message) = limit.and_then(|limit| out_of_range(limit, (-MAX_TRAVEL, MAX_TRAVEL))) {
                    add(field(name), message);
                }
            }
            if let (Some(min), Some(max)) = (axis.travel_min, axis.travel_max)
                && min >= max
            {
                add(field("travel_max"), format!("must lie above travel_min {min}, is {max}"));
            }
        }
        if let Some(message) = out_of_range(self.max_spindle_rev_per_min, SPINDLE_RANGE) {
            add("max_spindle_rev_per_min".to_owned(), message);
        }
        problems
    }
}

/// What is wrong with a value outside `low` to `high`; not-a-number is outside too.
fn out_of_range(value: f64, (low, high): (f64, f64)) -> Option<String> {
    (!(low..=high).contains(&value)).then(|| format!("must lie between {low} and {high}, is {value}"))
}

fn linear_axes(axes: &[Axis]) -> Vec<MachineAxis> {
    let (velocity, acceleration, jerk) = LINEAR_AXIS;
    axes.iter().map(|&axis| MachineAxis::new(axis, velocity, acceleration, jerk)).collect()
}

#[cfg(test)]
mod tests;
