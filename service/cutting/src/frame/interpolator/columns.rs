//! From activities to columns: where every setpoint is on the path, and which function carries it out.

use feedwave_motion::{Curve, Element};

use super::functions::FunctionScratch;
use super::{Activity, ActivityKind, Interpolator, Rest, Settings, State};
use crate::shared::columns::{ColumnMap, Samples, still};
use crate::shared::setpoint::{BLOCK_LENGTH, SetpointBlock};

/// Buffers of one block, so that interpolating allocates nothing for the next one.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    /// Commanded arc length in the element, mm.
    pub(super) s: Vec<f64>,
    /// Commanded speed, mm/s.
    pub(super) speed: Vec<f64>,
    pub(super) functions: FunctionScratch,
}

impl Scratch {
    pub(super) fn new() -> Self {
        Self { s: vec![0.0; BLOCK_LENGTH], speed: vec![0.0; BLOCK_LENGTH], functions: FunctionScratch::default() }
    }
}

impl Interpolator {
    /// Adds the activity's next setpoints to the block, at most `most` of them.
    pub(super) fn emit(&mut self, block: &mut SetpointBlock, activity: Activity, most: usize) {
        let start = block.len();
        let state = &self.state;
        let last = state.pause.map_or(activity.last, |pause| activity.last.min(pause.saturating_sub(1)));
        let count = usize::try_from(last - state.next + 1).unwrap_or(usize::MAX).min(most);
        grow(block, start + count);

        let first = state.next - state.clock.period;
        let period_s = self.settings.period_s;
        let first_period = first as f64;
        let local_s = |k: usize| (first_period + k as f64) * period_s - state.clock.lead_s;
        for (k, angle) in (0..count).zip(&mut block.spindle_angle_deg[start..]) {
            *angle = (state.spindle_rev + activity.spindle_rev_per_s * local_s(k)) * 360.0;
        }

        match activity.kind {
            ActivityKind::Hold { line } => self.emit_rest(block, start, line),
            ActivityKind::Function(kind) => self.emit_function(block, start, first, activity, kind),
            ActivityKind::Stretch(index) => self.emit_stretch(block, start, first, activity, index),
            ActivityKind::FeedHold { s } => {
                self.scratch.s[..count].fill(s);
                self.scratch.speed[..count].fill(0.0);
                self.emit_motion(block, start, state.track.current_index());
            }
            ActivityKind::VibratingHold => {
                if let Some(item) = self.last_motion_index()
                    && let Some(motion) = self.state.track.motion(item)
                {
                    self.scratch.s[..count].fill(motion.element.length);
                    self.scratch.speed[..count].fill(0.0);
                    self.emit_motion(block, start, item);
                }
            }
        }
        self.state.next += count as u64;
    }

    /// Setpoints of a planned stretch, `first` periods after its start.
    fn emit_stretch(&mut self, block: &mut SetpointBlock, start: usize, first: u64, activity: Activity, index: usize) {
        let (state, count) = (&self.state, block.len() - start);
        let item = state.track.current_index();
        let Some(motion) = state.track.motion(item) else { return };
        let stretch = &motion.stretches[index];
        let s = &mut self.scratch.s[..count];
        let speed = &mut self.scratch.speed[..count];
        stretch.profile.fill(first, self.settings.period_s, state.clock.lead_s, s, speed);
        let profile_length = stretch.profile.length();
        for value in s.iter_mut() {
            // The end is the planned one, not a sum that may miss it by a bit.
            *value = if *value >= profile_length { stretch.stretch.end } else { stretch.start + *value };
        }
        // So it is for a setpoint at the very instant of the end.
        let is_at_end = activity.end.lead_s == 0.0 && state.next + count as u64 > activity.end.period;
        if let Some(last) = s.last_mut().filter(|_| is_at_end) {
            *last = stretch.stretch.end;
        }
        self.emit_motion(block, start, item);
    }

    pub(super) fn emit_rest(&self, block: &mut SetpointBlock, start: usize, line: u32) {
        let rest = &self.state.rest;
        for (map, column) in self.settings.columns.iter().zip(&mut block.axes) {
            column[start..].fill(rest.value(*map));
        }
        if let Some(tool) = &self.settings.tool {
            tool.fill(block, start..block.len(), &rest.work_offset, rest.tool.as_ref().map(|(_, setup)| setup));
        }
        block.path_position_mm[start..].fill(self.state.path_base_mm);
        block.line[start..].fill(line);
        if let Some(servo) = &mut block.servo {
            still(servo, start);
        }
    }

    /// Columns of the samples whose commanded arc lengths in the element of motion `item` are in the scratch.
    fn emit_motion(&mut self, block: &mut SetpointBlock, start: usize, item: usize) {
        let State { track, functions, next, path_base_mm, .. } = &mut self.state;
        let Scratch { s, speed, functions: scratch } = &mut self.scratch;
        let Settings { columns, tool, period_s, mode, .. } = &self.settings;
        let Some(motion) = track.motion(item) else { return };
        let element = &motion.element;
        let s = &s[..block.len() - start];

        // A motion that was left already is part of the base.
        let base_mm = if item == track.current_index() { *path_base_mm } else { *path_base_mm - element.length };
        for (position, s) in block.path_position_mm[start..].iter_mut().zip(s) {
            *position = base_mm + s;
        }
        for (feed, speed) in block.feed_mm_per_min[start..].iter_mut().zip(&*speed) {
            *feed = speed * 60.0;
        }
        block.line[start..].fill(element.source.line);

        let tool = tool.as_ref();
        let at = Samples { columns, tool, track, item, element, s, index: *next, period_s: *period_s };
        functions.fill_axes(&at, *mode, scratch, block, start);
    }
}

impl Rest {
    /// At the end of an element.
    pub(super) fn after(element: &Element) -> Self {
        let tool = match &element.curve {
            Curve::FiveAxis(five_axis) => Some((five_axis.tip().ends()[1], *five_axis.setup())),
            _ => None,
        };
        let (position, work_offset, line) = (element.end, element.work_offset, element.source.line);
        Self { position, work_offset, line, tool }
    }

    /// Value of a column here.
    fn value(&self, map: ColumnMap) -> f64 {
        let index = map.axis.index();
        match &self.tool {
            Some((tip_mm, _)) if map.is_of_work() && index < 3 => tip_mm[index],
            _ => map.value(self.position[index], &self.work_offset),
        }
    }
}

/// Makes every column `length` long; new values are zero.
fn grow(block: &mut SetpointBlock, length: usize) {
    let columns = block.axes.iter_mut().chain(&mut block.tool_direction).chain([
        &mut block.path_position_mm,
        &mut block.feed_mm_per_min,
        &mut block.vibration_offset_mm,
        &mut block.spindle_angle_deg,
    ]);
    for column in columns {
        column.resize(length, 0.0);
    }
    block.line.resize(length, 0);
    if let Some(servo) = &mut block.servo {
        let per_axis = servo.amplitude_mm.iter_mut().chain(&mut servo.clamp_low_mm).chain(&mut servo.clamp_high_mm);
        for column in per_axis.chain([&mut servo.frequency_hz, &mut servo.phase_turns]) {
            column.resize(length, 0.0);
        }
    }
}
