//! Setpoint blocks: columns of a fixed count of interpolation periods.

use feedwave_motion::Machine;

/// Index of the first setpoint at or after `time_s`, with `period_us` from one setpoint to the next. A time that
/// falls on a setpoint but for rounding means that setpoint.
#[must_use]
pub fn setpoint_index_at(time_s: f64, period_us: f64) -> u64 {
    const ROUNDING_PERIODS: f64 = 1e-6;
    (time_s * 1e6 / period_us - ROUNDING_PERIODS).ceil().max(0.0) as u64
}

/// Periods in a full block.
pub const BLOCK_LENGTH: usize = 1_024;

/// Which coordinates the axis columns are in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Frame {
    /// Machine coordinates: work offsets added, sign of workpiece-carried axes applied.
    #[default]
    Machine,
    /// Work coordinates as programmed (X a radius); while the tool is guided X, Y and Z are those of its centre point.
    Work,
}

/// What a drive needs to generate the vibration itself (servo-side mode), one value per period.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServoColumns {
    /// Signed amplitude A·τ_i per machine axis, mm; 0 while the vibration is off.
    pub amplitude_mm: Vec<Vec<f64>>,
    /// Vibration frequency, Hz; 0 while off.
    pub frequency_hz: Vec<f64>,
    /// Vibration phase at the end of the period, turns; 0 while off.
    pub phase_turns: Vec<f64>,
    /// Lowest position the drive may command, per machine axis, mm; −∞ where free.
    pub clamp_low_mm: Vec<Vec<f64>>,
    /// Highest position the drive may command, per machine axis, mm; +∞ where free.
    pub clamp_high_mm: Vec<Vec<f64>>,
}

/// Up to [`BLOCK_LENGTH`] consecutive setpoints, column by column. Setpoint `i` of the block is the state at
/// time `(first_index + i) · Δt`; setpoint 0 of a program is its start position at time 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SetpointBlock {
    /// Index of the first setpoint.
    pub first_index: u64,
    /// One column per machine axis in the order of the profile: mm (X a radius) or degrees.
    pub axes: Vec<Vec<f64>>,
    /// Tool direction in work coordinates, from the tip to the spindle: X, Y and Z of the unit vector. In [`Frame::Work`] on
    /// machines whose kinematics are known; no columns otherwise.
    pub tool_direction: Vec<Vec<f64>>,
    /// Commanded path position from the program's start, mm.
    pub path_position_mm: Vec<f64>,
    /// Commanded feed along the path, mm/min, without the vibration's share.
    pub feed_mm_per_min: Vec<f64>,
    /// Displacement along the path that the vibration adds after clamping, mm.
    pub vibration_offset_mm: Vec<f64>,
    /// Spindle angle since the program's start, degrees, unwrapped; counts down under `M4`.
    pub spindle_angle_deg: Vec<f64>,
    /// Source line of the commanded position.
    pub line: Vec<u32>,
    /// Vibration conditions for the drives, in servo-side mode only; the axis columns are then the command.
    pub servo: Option<ServoColumns>,
}

impl SetpointBlock {
    /// An empty block with capacity for [`BLOCK_LENGTH`] setpoints of this machine, so that filling it allocates
    /// nothing.
    #[must_use]
    pub fn for_machine(machine: &Machine, servo: bool) -> Self {
        let column = || Vec::with_capacity(BLOCK_LENGTH);
        let axis_columns = || machine.axes.iter().map(|_| column()).collect::<Vec<_>>();
        Self {
            first_index: 0,
            axes: axis_columns(),
            tool_direction: Vec::new(),
            path_position_mm: column(),
            feed_mm_per_min: column(),
            vibration_offset_mm: column(),
            spindle_angle_deg: column(),
            line: Vec::with_capacity(BLOCK_LENGTH),
            servo: servo.then(|| ServoColumns {
                amplitude_mm: axis_columns(),
                frequency_hz: column(),
                phase_turns: column(),
                clamp_low_mm: axis_columns(),
                clamp_high_mm: axis_columns(),
            }),
        }
    }

    /// The block with columns for the tool direction.
    #[must_use]
    pub fn with_tool_direction(mut self) -> Self {
        self.tool_direction = (0..3).map(|_| Vec::with_capacity(BLOCK_LENGTH)).collect();
        self
    }

    /// Empties the block, keeping its capacity.
    pub(crate) fn clear(&mut self, first_index: u64) {
        self.first_index = first_index;
        let columns = self.axes.iter_mut().chain(&mut self.tool_direction).chain([
            &mut self.path_position_mm,
            &mut self.feed_mm_per_min,
            &mut self.vibration_offset_mm,
            &mut self.spindle_angle_deg,
        ]);
        for column in columns {
            column.clear();
        }
        self.line.clear();
        if let Some(servo) = &mut self.servo {
            let per_axis = servo.amplitude_mm.iter_mut().chain(&mut servo.clamp_low_mm).chain(&mut servo.clamp_high_mm);
            for column in per_axis.chain([&mut servo.frequency_hz, &mut servo.phase_turns]) {
                column.clear();
            }
        }
    }

    /// Number of setpoints in the block.
    #[must_use]
    pub fn len(&self) -> usize {
        self.line.len()
    }

    /// Whether the block holds no setpoint.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.line.is_empty()
    }
}
