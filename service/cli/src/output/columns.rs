//! Which columns a setpoint file has: data, read by every format.

use feedwave_cutting::SetpointBlock;

/// A machine axis as a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisColumn {
    /// Name of the axis.
    pub name: String,
    /// Whether its values are degrees rather than millimetres.
    pub rotary: bool,
}

impl AxisColumn {
    const fn unit(&self) -> &'static str {
        if self.rotary { "deg" } else { "mm" }
    }
}

/// Where the values of a column come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    Index,
    Time,
    Axis(usize),
    PathPosition,
    Feed,
    VibrationOffset,
    SpindleAngle,
    ToolDirection(usize),
    ServoAmplitude(usize),
    ServoFrequency,
    ServoPhase,
    ServoClampLow(usize),
    ServoClampHigh(usize),
    Line,
}

impl Source {
    /// The column of the block, for columns of doubles that are stored as such.
    pub(super) fn doubles(self, block: &SetpointBlock) -> Option<&[f64]> {
        let servo = block.servo.as_ref();
        match self {
            Self::Index | Self::Time | Self::Line => None,
            Self::Axis(axis) => Some(&block.axes[axis]),
            Self::PathPosition => Some(&block.path_position_mm),
            Self::Feed => Some(&block.feed_mm_per_min),
            Self::VibrationOffset => Some(&block.vibration_offset_mm),
            Self::SpindleAngle => Some(&block.spindle_angle_deg),
            Self::ToolDirection(axis) => block.tool_direction.get(axis).map(Vec::as_slice),
            Self::ServoAmplitude(axis) => servo.map(|servo| servo.amplitude_mm[axis].as_slice()),
            Self::ServoFrequency => servo.map(|servo| servo.frequency_hz.as_slice()),
            Self::ServoPhase => servo.map(|servo| servo.phase_turns.as_slice()),
            Self::ServoClampLow(axis) => servo.map(|servo| servo.clamp_low_mm[axis].as_slice()),
            Self::ServoClampHigh(axis) => servo.map(|servo| servo.clamp_high_mm[axis].as_slice()),
        }
    }
}

/// One column of a setpoint file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Name with the unit at its end, as in `X_mm`.
    pub name: String,
    /// Unit, `""` for a count.
    pub unit: &'static str,
    pub(super) source: Source,
}

/// The columns of a setpoint file and the clock behind its indices.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    columns: Vec<Column>,
    period_us: f64,
}

impl Layout {
    /// Index, time, each axis, path position, feed, vibration offset, spindle angle, source line; setpoint `i` belongs
    /// to time `i · period_us`.
    #[must_use]
    pub fn new(axes: &[AxisColumn], period_us: f64) -> Self {
        let mut columns = Vec::with_capacity(axes.len() + 7);
        let mut add = |name: &str, unit: &'static str, source| {
            columns.push(Column { name: name.to_owned(), unit, source });
        };
        add("index", "", Source::Index);
        add("time_s", "s", Source::Time);
        for (index, axis) in axes.iter().enumerate() {
            add(&format!("{}_{}", axis.name, axis.unit()), axis.unit(), Source::Axis(index));
        }
        add("path_position_mm", "mm", Source::PathPosition);
        add("feed_mm_per_min", "mm/min", Source::Feed);
        add("vibration_offset_mm", "mm", Source::VibrationOffset);
        add("spindle_angle_deg", "deg", Source::SpindleAngle);
        add("source_line", "", Source::Line);
        Self { columns, period_us }
    }

    /// Adds the tool direction in work coordinates.
    #[must_use]
    pub fn with_tool_direction(mut self) -> Self {
        for (index, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let name = format!("tool_direction_{axis}");
            self.columns.push(Column { name, unit: "", source: Source::ToolDirection(index) });
        }
        self
    }

    /// Adds the vibration conditions that a drive needs to generate the vibration itself.
    #[must_use]
    pub fn with_servo_conditions(mut self, axes: &[AxisColumn]) -> Self {
        let mut add = |name: String, unit: &'static str, source| {
            self.columns.push(Column { name, unit, source });
        };
        add("vibration_frequency_hz".to_owned(), "Hz", Source::ServoFrequency);
        add("vibration_phase_turns".to_owned(), "turn", Source::ServoPhase);
        for (index, axis) in axes.iter().enumerate().filter(|(_, axis)| !axis.rotary) {
            add(format!("{}_vibration_amplitude_mm", axis.name), "mm", Source::ServoAmplitude(index));
            add(format!("{}_clamp_low_mm", axis.name), "mm", Source::ServoClampLow(index));
            add(format!("{}_clamp_high_mm", axis.name), "mm", Source::ServoClampHigh(index));
        }
        self
    }

    /// The columns, in order.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Time of a setpoint, s: the decimal that a person would write, rounded once.
    #[must_use]
    pub fn time_s(&self, index: u64) -> f64 {
        index as f64 * self.period_us / 1e6
    }

    /// The first setpoint at or after a time, s.
    #[must_use]
    pub fn index_at(&self, time_s: f64) -> u64 {
        let estimate = (time_s * 1e6 / self.period_us).ceil() as u64;
        if estimate > 0 && self.time_s(estimate - 1) >= time_s { estimate - 1 } else { estimate }
    }
}
