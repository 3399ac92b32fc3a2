//! Setpoints that were handed out and not taken yet, as rows far enough apart to be kept in bounded memory.

use std::collections::VecDeque;

use feedwave_contract::proto::{CommandedAxis, CommandedState};
use feedwave_cutting::{Frame, SetpointBlock};
use feedwave_motion::Machine;

/// Machining time between two rows, s.
const INTERVAL_S: f64 = 0.05;
/// Most rows: more than three minutes ahead. A client that takes even less has rows further apart.
const MOST_ROWS: usize = 4_096;

/// A setpoint without its positions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Row {
    index: u64,
    line: u32,
    feed_mm_per_min: f64,
    rev_per_min: f64,
    path_position_mm: f64,
}

/// Rows of setpoints, from the one that was taken last on.
#[derive(Debug)]
pub(crate) struct HandedOut {
    axes: Vec<(String, &'static str)>,
    period_s: f64,
    work_coordinates: bool,
    /// From one row to the next, setpoints.
    stride: u64,
    /// Index of the next row.
    next: u64,
    rows: VecDeque<Row>,
    /// Of each row those of all axes.
    positions: VecDeque<f64>,
    /// The very last setpoint, with its positions: a run ends there.
    last: Option<(Row, Vec<f64>)>,
    /// Spindle angle of the last setpoint, degrees.
    angle_deg: Option<f64>,
}

impl HandedOut {
    /// Nothing yet, of a machine in this frame and with this interpolation period.
    pub(crate) fn new(machine: &Machine, frame: Frame, period_s: f64) -> Self {
        let unit = |is_rotary| if is_rotary { "deg" } else { "mm" };
        let axes = machine.axes.iter().map(|axis| (axis.name.clone(), unit(axis.axis.is_rotary()))).collect();
        Self {
            axes,
            period_s,
            work_coordinates: frame == Frame::Work,
            stride: ((INTERVAL_S / period_s).round() as u64).max(1),
            next: 0,
            rows: VecDeque::new(),
            positions: VecDeque::new(),
            last: None,
            angle_deg: None,
        }
    }

    /// Notes setpoints, which follow those noted before.
    pub(crate) fn note(&mut self, block: &SetpointBlock) {
        let count = block.len();
        let Some(last) = count.checked_sub(1) else { return };
        let end = block.first_index + count as u64;
        while self.next < end {
            // Within the block, whose length is a usize.
            let row = self.next.saturating_sub(block.first_index) as usize;
            self.rows.push_back(self.row(block, row));
            self.positions.extend(block.axes.iter().map(|axis| axis[row]));
            self.next = block.first_index + row as u64 + self.stride;
            if self.rows.len() >= MOST_ROWS {
                self.thin();
            }
        }
        let row = self.row(block, last);
        let (kept, positions) = self.last.get_or_insert_default();
        *kept = row;
        positions.clear();
        positions.extend(block.axes.iter().map(|axis| axis[last]));
        self.angle_deg = block.spindle_angle_deg.last().copied();
    }

    fn row(&self, block: &SetpointBlock, row: usize) -> Row {
        let angles = &block.spindle_angle_deg;
        let before = row.checked_sub(1).map(|before| angles[before]).or(self.angle_deg);
        // The very first setpoint moves as the second does.
        let step_deg = match before {
            Some(before) => angles[row] - before,
            None => angles.get(row + 1).map_or(0.0, |after| after - angles[row]),
        };
        Row {
            index: block.first_index + row as u64,
            line: block.line[row],
            feed_mm_per_min: block.feed_mm_per_min[row],
            rev_per_min: step_deg / 360.0 / self.period_s * 60.0,
            path_position_mm: block.path_position_mm[row],
        }
    }

    /// Drops every second row.
    fn thin(&mut self) {
        let width = self.axes.len();
        let mut number = 0;
        self.rows.retain(|_| {
            number += 1;
            number % 2 == 1
        });
        let mut number = 0;
        self.positions.retain(|_| {
            number += 1;
            width == 0 || ((number - 1) / width).is_multiple_of(2)
        });
        self.stride *= 2;
    }

    /// The last of so many setpoints that were taken, as far as it is known; what lies before it is forgotten.
    pub(crate) fn taken(&mut self, taken: u64) -> Option<CommandedState> {
        while self.rows.get(1).is_some_and(|next| next.index < taken) {
            self.rows.pop_front();
            self.positions.drain(..self.axes.len());
        }
        let last = self.last.as_ref().filter(|(row, _)| row.index < taken);
        if let Some((row, positions)) = last {
            return Some(self.state(row, positions.iter().copied()));
        }
        let row = self.rows.front().filter(|row| row.index < taken)?;
        Some(self.state(row, self.positions.iter().copied()))
    }

    fn state(&self, row: &Row, positions: impl Iterator<Item = f64>) -> CommandedState {
        let axis = |((axis, unit), position): (&(String, &'static str), f64)| CommandedAxis {
            axis: axis.clone(),
            position,
            unit: (*unit).to_owned(),
        };
        CommandedState {
            line: row.line,
            feed_mm_per_min: row.feed_mm_per_min,
            spindle_rev_per_min: row.rev_per_min,
            path_position_mm: row.path_position_mm,
            axes: self.axes.iter().zip(positions).map(axis).collect(),
            work_coordinates: self.work_coordinates,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Setpoints whose values follow from their index, a turn a second.
    fn block(first: u64, count: u64) -> SetpointBlock {
        let machine = Machine::lathe();
        let mut block = SetpointBlock::for_machine(&machine, false);
        block.first_index = first;
        for index in first..first + count {
            for (axis, column) in block.axes.iter_mut().enumerate() {
                column.push(index as f64 + 0.25 * axis as f64);
            }
            block.path_position_mm.push(index as f64);
            block.feed_mm_per_min.push(2.0 * index as f64);
            block.vibration_offset_mm.push(0.0);
            block.spindle_angle_deg.push(0.36 * index as f64);
            block.line.push(index as u32 / 100 + 1);
        }
        block
    }

    fn filled(blocks: u64) -> HandedOut {
        let mut handed_out = HandedOut::new(&Machine::lathe(), Frame::Machine, 1e-3);
        for number in 0..blocks {
            handed_out.note(&block(number * 64, 64));
        }
        handed_out
    }

    #[test]
    fn what_was_taken_is_known_to_within_the_interval() {
        let mut handed_out = filled(1_000);
        assert_eq!(handed_out.taken(0), None);
        for taken in (1..64_000).step_by(777) {
            let state = handed_out.taken(taken).unwrap();
            let behind = (taken - 1) as f64 - state.path_position_mm;
            assert!((0.0..50.0).contains(&behind), "{taken}: {state:?}");
            assert_eq!(state.feed_mm_per_min, 2.0 * state.path_position_mm);
            assert_eq!(state.line, state.path_position_mm as u32 / 100 + 1);
            let axes: Vec<f64> = state.axes.iter().map(|axis| axis.position - state.path_position_mm).collect();
            assert_eq!(axes, [0.0, 0.25][..axes.len().min(2)], "{state:?}");
            assert!((state.spindle_rev_per_min - 60.0).abs() < 1e-6, "{state:?}");
        }
    }

    #[test]
    fn the_last_setpoint_is_exact() {
        let mut handed_out = filled(10);
        let last = handed_out.taken(640).unwrap();
        assert_eq!(last.path_position_mm, 639.0);
        assert!((last.spindle_rev_per_min - 60.0).abs() < 1e-6, "{last:?}");
        assert!(handed_out.taken(639).unwrap().path_position_mm < 639.0);
    }

    #[test]
    fn a_client_that_takes_nothing_costs_no_more() {
        let mut handed_out = filled(30_000);
        assert!(handed_out.rows.len() < MOST_ROWS, "{}", handed_out.rows.len());
        assert_eq!(handed_out.positions.len(), handed_out.rows.len() * handed_out.axes.len());
        let stride = handed_out.stride as f64;
        for taken in [1, 5_000, 1_000_000, 1_919_999] {
            let state = handed_out.taken(taken).unwrap();
            let behind = (taken - 1) as f64 - state.path_position_mm;
            assert!((0.0..=stride).contains(&behind), "{taken}: {behind}");
        }
    }
}
