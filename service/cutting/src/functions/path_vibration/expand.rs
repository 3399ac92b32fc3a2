//! Expanded servo output: what the drives would generate from the streamed conditions, at one setpoint per servo
//! period. Setpoint `i` of the interpolation is setpoint `i·m` of the expanded stream.

use crate::{ServoColumns, ServoCondition, ServoWave, SetpointBlock, fill_servo_positions};
use feedwave_motion::Machine;

/// One row of conditions.
struct Row {
    axes: Vec<ServoCondition>,
    path_position_mm: f64,
    spindle_angle_deg: f64,
}

/// Turns blocks of conditions into blocks of positions, in order.
pub struct ServoExpander {
    substeps: usize,
    period_s: f64,
    /// The row before the next one; `None` at the start.
    previous: Option<Row>,
    wave: Vec<f64>,
    positions_mm: Vec<f64>,
    /// Displacement along the path that is left after clamping, per servo period.
    offsets_mm: Vec<f64>,
    block: SetpointBlock,
}

impl ServoExpander {
    /// `substeps` servo periods per interpolation period of `period_s`.
    pub fn new(machine: &Machine, substeps: u32, period_s: f64) -> Self {
        let substeps = substeps as usize;
        Self {
            substeps,
            period_s,
            previous: None,
            wave: vec![0.0; substeps],
            positions_mm: vec![0.0; substeps],
            offsets_mm: vec![0.0; substeps],
            block: SetpointBlock::for_machine(machine, false),
        }
    }

    /// The servo periods up to the last setpoint of `conditions`. The first block ever gives its first setpoint
    /// alone, then every period that follows; blocks must come in order.
    pub fn expand(&mut self, conditions: &SetpointBlock) -> &SetpointBlock {
        let expanded = &mut self.block;
        let columns = expanded.axes.iter_mut().chain([
            &mut expanded.path_position_mm,
            &mut expanded.feed_mm_per_min,
            &mut expanded.vibration_offset_mm,
            &mut expanded.spindle_angle_deg,
        ]);
        for column in columns {
            column.clear();
        }
        expanded.line.clear();
        let periods_before = conditions.first_index.saturating_sub(1) * self.substeps as u64;
        expanded.first_index = match self.previous {
            Some(_) => periods_before + 1,
            None => conditions.first_index * self.substeps as u64,
        };
        for row in 0..conditions.len() {
            self.expand_row(conditions, row);
        }
        &self.block
    }

    fn expand_row(&mut self, conditions: &SetpointBlock, row: usize) {
        let current = Row::of(conditions, row);
        let wave = wave_of(conditions, row);
        // Before the first setpoint there is no period: it is a condition of its own, at its end.
        let substeps = if self.previous.is_some() { self.substeps } else { 1 };
        let period_s = if self.previous.is_some() { self.period_s } else { 0.0 };
        let previous = self.previous.as_ref().unwrap_or(&current);
        let (waves, positions) = (&mut self.wave[..substeps], &mut self.positions_mm[..substeps]);
        let period = wave.fill(period_s, waves);
        let expanded = &mut self.block;
        let between = |substep: usize, from: f64, to: f64| {
            let share = (substep + 1) as f64 / substeps as f64;
            if substep + 1 == substeps { to } else { from + (to - from) * share }
        };
        let amplitude_mm = current.axes.iter().map(|axis| axis.signed_amplitude_mm * axis.signed_amplitude_mm);
        let amplitude_mm = amplitude_mm.sum::<f64>().sqrt();
        let offsets = &mut self.offsets_mm[..substeps];
        offsets.fill(0.0);
        for (axis, column) in expanded.axes.iter_mut().enumerate() {
            let (before, after) = (&previous.axes[axis], &current.axes[axis]);
            fill_servo_positions(before, after, waves, period, positions);
            column.extend_from_slice(positions);
            if amplitude_mm > 0.0 {
                let direction = after.signed_amplitude_mm / amplitude_mm;
                for (substep, (offset, position)) in offsets.iter_mut().zip(positions.iter()).enumerate() {
                    *offset += (position - between(substep, before.commanded_mm, after.commanded_mm)) * direction;
                }
            }
        }
        for (substep, &offset) in offsets.iter().enumerate() {
            let between = |from: f64, to: f64| between(substep, from, to);
            expanded.path_position_mm.push(between(previous.path_position_mm, current.path_position_mm));
            expanded.spindle_angle_deg.push(between(previous.spindle_angle_deg, current.spindle_angle_deg));
            expanded.feed_mm_per_min.push(conditions.feed_mm_per_min[row]);
            expanded.vibration_offset_mm.push(offset);
            expanded.line.push(conditions.line[row]);
        }
        self.previous = Some(current);
    }
}

impl Row {
    fn of(block: &SetpointBlock, row: usize) -> Self {
        let condition = |axis: usize| {
            let servo = block.servo.as_ref();
            let value = |column: fn(&ServoColumns) -> &[Vec<f64>], off: f64| {
                servo.map_or(off, |servo| column(servo)[axis][row])
            };
            ServoCondition {
                commanded_mm: block.axes[axis][row],
                signed_amplitude_mm: value(|servo| &servo.amplitude_mm, 0.0),
                clamp_low_mm: value(|servo| &servo.clamp_low_mm, f64::NEG_INFINITY),
                clamp_high_mm: value(|servo| &servo.clamp_high_mm, f64::INFINITY),
            }
        };
        Self {
            axes: (0..block.axes.len()).map(condition).collect(),
            path_position_mm: block.path_position_mm[row],
            spindle_angle_deg: block.spindle_angle_deg[row],
        }
    }
}

fn wave_of(block: &SetpointBlock, row: usize) -> ServoWave {
    match &block.servo {
        Some(servo) if servo.frequency_hz[row] > 0.0 => {
            ServoWave { on: true, frequency_hz: servo.frequency_hz[row], phase_turns: servo.phase_turns[row] }
        }
        _ => ServoWave::OFF,
    }
}
