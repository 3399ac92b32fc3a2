//! From path positions to columns: superposition of the vibration, geometry, and the machine's axes.

use std::ops::Range;

use feedwave_motion::kinematics::{Kinematics, RotaryDirections, Setup, ToolPose};
use feedwave_motion::{Curve, Element, Machine, PlannedMotion};
use feedwave_program::{Axis, Position};

use super::{Activity, ActivityKind, Interpolator, Rest, Section};
use crate::functions::tool_oscillation::OscillationScratch;
use crate::shared::blend::BlendedPath;
use crate::shared::setpoint::ServoColumns;
use crate::{BLOCK_LENGTH, Frame, GenerationMode, SetpointBlock, sin_turns};

/// How a column follows from a program axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ColumnMap {
    pub(crate) axis: Axis,
    /// −1 where the workpiece carries the axis.
    pub(crate) sign: f64,
    /// 1 where the work offset is added.
    offset_share: f64,
    /// Coordinates of the column.
    frame: Frame,
}

impl ColumnMap {
    pub(crate) fn of(machine: &Machine, frame: Frame) -> Vec<Self> {
        let map = |axis: &feedwave_motion::MachineAxis| match frame {
            Frame::Machine => Self { axis: axis.axis, sign: axis.sign(), offset_share: 1.0, frame },
            Frame::Work => Self { axis: axis.axis, sign: 1.0, offset_share: 0.0, frame },
        };
        machine.axes.iter().map(map).collect()
    }

    /// Whether the column is in work coordinates.
    pub(crate) fn is_of_work(&self) -> bool {
        self.frame == Frame::Work
    }

    fn value(self, work: f64, work_offset: &Position) -> f64 {
        self.sign * (work + self.offset_share * work_offset[self.axis.index()])
    }

    /// Value at the arc length `s` of one element, seen from another one that may have another work offset.
    fn value_of(self, of: &Element, s: f64, seen_from: &Element) -> f64 {
        let index = self.axis.index();
        let mut point = [0.0];
        match self.frame {
            Frame::Machine => of.fill_axis(self.axis, &[s], &mut point),
            Frame::Work => of.fill_work_axis(self.axis, &[s], &mut point),
        }
        let shift = of.work_offset[index] - seen_from.work_offset[index];
        self.value(point[0] + shift, &seen_from.work_offset)
    }

    /// Values on an element at the arc lengths `s`.
    fn fill(self, element: &Element, s: &[f64], out: &mut [f64]) {
        match self.frame {
            Frame::Machine => element.fill_axis(self.axis, s, out),
            Frame::Work => element.fill_work_axis(self.axis, s, out),
        }
        self.apply(&element.work_offset, out);
    }

    /// Derivatives by arc length, without the sign.
    fn fill_tangent(self, element: &Element, s: &[f64], out: &mut [f64]) {
        match self.frame {
            Frame::Machine => element.fill_tangent(self.axis, s, out),
            Frame::Work => element.fill_work_tangent(self.axis, s, out),
        }
    }

    /// Value at rest.
    fn at_rest(self, rest: &Rest) -> f64 {
        match (self.frame, &rest.tool) {
            (Frame::Work, Some((tip_mm, _))) if self.axis.index() < 3 => tip_mm[self.axis.index()],
            _ => self.value(rest.position[self.axis.index()], &rest.work_offset),
        }
    }

    pub(crate) fn apply(self, work_offset: &Position, column: &mut [f64]) {
        let offset = self.offset_share * work_offset[self.axis.index()];
        if self.sign != 1.0 || offset != 0.0 {
            for value in column {
                *value = self.sign * (*value + offset);
            }
        }
    }
}

/// Buffers of one block, so that interpolating allocates nothing.
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    /// Commanded arc length in the element, mm.
    pub(crate) s: Vec<f64>,
    /// Commanded speed, mm/s.
    pub(crate) speed: Vec<f64>,
    /// Amplitude of the vibration, mm.
    pub(crate) amplitude: Vec<f64>,
    /// Vibration wave, then a(t), mm.
    pub(crate) vibration: Vec<f64>,
    /// Arc length after superposition, mm.
    pub(crate) combined: Vec<f64>,
    /// Share of the vibration's amplitude near the ends of its path.
    share: Vec<f64>,
    oscillation: OscillationScratch,
}

impl Scratch {
    pub(crate) fn new() -> Self {
        let column = || vec![0.0; BLOCK_LENGTH];
        Self {
            s: column(),
            speed: column(),
            amplitude: column(),
            vibration: column(),
            combined: column(),
            share: column(),
            oscillation: OscillationScratch::new(),
        }
    }
}

impl Interpolator {
    /// Adds the activity's next setpoints to the block, at most `most` of them.
    pub(crate) fn emit(&mut self, block: &mut SetpointBlock, activity: Activity, most: usize) {
        let start = block.len();
        let state = &self.state;
        let last = state.pause.map_or(activity.last, |pause| activity.last.min(pause.saturating_sub(1)));
        let count = usize::try_from(last - state.next + 1).unwrap_or(usize::MAX).min(most);
        grow(block, start + count);

        let first = state.next - state.clock.period;
        let period_s = self.settings.period_s;
        let local_s = |k: usize| (first + k as u64) as f64 * period_s - state.clock.lead_s;
        for (k, angle) in block.spindle_angle_deg[start..].iter_mut().enumerate() {
            *angle = (state.spindle_rev + activity.spindle_rev_per_s * local_s(k)) * 360.0;
        }

        match activity.kind {
            ActivityKind::Hold { line } => self.emit_rest(block, start, line),
            ActivityKind::ThreadPreparation { line } => self.emit_preparation(block, start, first, line),
            ActivityKind::Thread { .. } => {
                let (lead_s, rev_per_s) = (state.clock.lead_s, activity.spindle_rev_per_s.abs());
                let turned_rev = |k: usize| rev_per_s * ((first + k as u64) as f64 * period_s - lead_s);
                self.emit_thread(block, start, turned_rev);
            }
            ActivityKind::Stretch(index) => {
                let item = state.track.current_index();
                if let Some(motion) = state.track.motion(item) {
                    let stretch = &motion.stretches[index];
                    let s = &mut self.scratch.s[..count];
                    let speed = &mut self.scratch.speed[..count];
                    stretch.profile.fill(first, period_s, state.clock.lead_s, s, speed);
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
            }
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

    pub(crate) fn emit_rest(&self, block: &mut SetpointBlock, start: usize, line: u32) {
        let rest = &self.state.rest;
        for (map, column) in self.settings.columns.iter().zip(&mut block.axes) {
            column[start..].fill(map.at_rest(rest));
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
        let state = &mut self.state;
        let scratch = &mut self.scratch;
        let (columns, tool) = (&self.settings.columns, self.settings.tool.as_ref());
        let Some(motion) = state.track.motion(item) else { return };
        let element = &motion.element;
        let count = block.len() - start;
        let s = &scratch.s[..count];

        // A motion that was left already is part of the base.
        let base_mm =
            if item == state.track.current_index() { state.path_base_mm } else { state.path_base_mm - element.length };
        for (position, s) in block.path_position_mm[start..].iter_mut().zip(s) {
            *position = base_mm + s;
        }
        for (feed, speed) in block.feed_mm_per_min[start..].iter_mut().zip(&scratch.speed) {
            *feed = speed * 60.0;
        }
        block.line[start..].fill(element.source.line);

        let Some(section) = &mut state.section else {
            fill_axes(columns, tool, element, s, block, start);
            if let Some(run) = &state.oscillation {
                let place_mm = state.track.section_place(item);
                run.superpose(columns, element, place_mm, s, &mut scratch.oscillation, block, start);
            }
            if let Some(servo) = &mut block.servo {
                still(servo, start);
            }
            return;
        };
        section.samples.total += count as u64;
        let vibration = &mut scratch.vibration[..count];
        fill_wave(section, self.settings.period_s, state.next, vibration);
        let amplitude_mm = &mut scratch.amplitude[..count];
        state.amplitude.fill(&section.condition, self.settings.period_s, state.next, amplitude_mm);
        if let Some(ramp_mm) = section.part.ramp_mm {
            let (before_mm, length_mm) = state.track.section_place(item);
            let path = BlendedPath { ramp_mm, before_mm, length_mm };
            if !path.is_whole(s) {
                let share = &mut scratch.share[..count];
                path.fill_share(s, share);
                for (amplitude_mm, share) in amplitude_mm.iter_mut().zip(share) {
                    *amplitude_mm *= *share;
                }
            }
        }

        if self.settings.mode == GenerationMode::AlongPath {
            for (offset, amplitude_mm) in vibration.iter_mut().zip(&*amplitude_mm) {
                *offset *= amplitude_mm;
            }
            let combined = &mut scratch.combined[..count];
            let mut within = true;
            for ((combined, s), offset) in combined.iter_mut().zip(s).zip(vibration.iter()) {
                *combined = s + offset;
                within &= *combined >= 0.0 && *combined <= element.length;
            }
            block.vibration_offset_mm[start..].copy_from_slice(vibration);
            if within {
                fill_axes(columns, tool, element, combined, block, start);
                return;
            }
            // Samples that leave the element, forwards or backwards, go to its neighbours in runs.
            let mut k = 0;
            while k < count {
                let run_start = k;
                let mut place = state.track.locate(item, combined[k]);
                let run_item = place.item;
                while place.item == run_item {
                    combined[k] = place.s;
                    if place.beyond_mm != 0.0 {
                        section.samples.clamped += 1;
                        block.vibration_offset_mm[start + k] -= place.beyond_mm;
                    }
                    k += 1;
                    if k == count {
                        break;
                    }
                    place = state.track.locate(item, combined[k]);
                }
                if let Some(run_motion) = state.track.motion(run_item) {
                    let run = &combined[run_start..k];
                    fill_axes(columns, tool, &run_motion.element, run, block, start + run_start);
                }
            }
            return;
        }

        fill_axes(columns, tool, element, s, block, start);
        let within_mm = section.condition.reach_mm();
        let is_clamped = section.part.ramp_mm.is_none();
        let ends = SectionEnds {
            first: state.track.section_start_near(item, within_mm).filter(|_| is_clamped),
            last: state.track.section_end_near(item, within_mm).filter(|_| is_clamped),
            within_mm,
        };
        // Between the reaches of the part's ends nothing is clamped: column by column.
        let free = ends.free(element, s);
        let amplitudes = &mut scratch.combined[free.clone()];
        for (column, map) in columns.iter().enumerate() {
            map.fill_tangent(element, &s[free.clone()], amplitudes);
            for (amplitude, amplitude_mm) in amplitudes.iter_mut().zip(&amplitude_mm[free.clone()]) {
                *amplitude = map.sign * (amplitude_mm * *amplitude);
            }
            let rows = start + free.start..start + free.end;
            if let Some(servo) = &mut block.servo {
                servo.amplitude_mm[column][rows.clone()].copy_from_slice(amplitudes);
                servo.clamp_low_mm[column][rows.clone()].fill(f64::NEG_INFINITY);
                servo.clamp_high_mm[column][rows].fill(f64::INFINITY);
            } else {
                let waves = &vibration[free.clone()];
                for ((command, amplitude), wave) in block.axes[column][rows].iter_mut().zip(&*amplitudes).zip(waves) {
                    *command += amplitude * wave;
                }
            }
        }
        let waves = amplitude_mm.iter().zip(&*vibration);
        for (offset, (amplitude_mm, wave)) in block.vibration_offset_mm[start..].iter_mut().zip(waves) {
            *offset = amplitude_mm * wave;
        }
        for k in (0..free.start).chain(free.end..count) {
            let (wave, amplitude_mm) = (vibration[k], amplitude_mm[k]);
            // Wanted and clamped offsets of the axes, projected onto the tangent.
            let (mut wanted_sum, mut clamped_sum) = (0.0, 0.0);
            let mut clamped = false;
            for (column, map) in columns.iter().enumerate() {
                let mut direction = [0.0];
                map.fill_tangent(element, &s[k..=k], &mut direction);
                let [direction] = direction;
                let command = &mut block.axes[column][start + k];
                let [low, high] = ends.clamp(*map, element, s[k], direction, *command);
                let forwards = map.sign * direction;
                let signed_amplitude_mm = map.sign * (amplitude_mm * direction);
                if let Some(servo) = &mut block.servo {
                    servo.amplitude_mm[column][start + k] = signed_amplitude_mm;
                    servo.clamp_low_mm[column][start + k] = low;
                    servo.clamp_high_mm[column][start + k] = high;
                }
                let wanted = *command + signed_amplitude_mm * wave;
                let position = wanted.max(low).min(high);
                clamped |= position != wanted;
                wanted_sum += (wanted - *command) * forwards;
                clamped_sum += (position - *command) * forwards;
                if block.servo.is_none() {
                    *command = position;
                }
            }
            let share = if clamped && wanted_sum != 0.0 { clamped_sum / wanted_sum } else { 1.0 };
            block.vibration_offset_mm[start + k] = amplitude_mm * wave * share;
            section.samples.clamped += u64::from(clamped);
        }
        if let Some(servo) = &mut block.servo {
            servo.frequency_hz[start..].fill(section.condition.frequency_hz);
            for (k, phase) in servo.phase_turns[start..].iter_mut().enumerate() {
                *phase = phase_turns(section, self.settings.period_s, state.next + k as u64);
            }
        }
    }
}

/// The ends of a part of the section as far as the vibration reaches them.
struct SectionEnds<'a> {
    first: Option<(&'a PlannedMotion, f64)>,
    last: Option<(&'a PlannedMotion, f64)>,
    within_mm: f64,
}

impl SectionEnds<'_> {
    /// The samples, of increasing arc lengths `s`, that lie beyond the reach of both ends.
    fn free(&self, element: &Element, s: &[f64]) -> Range<usize> {
        let start = match self.first {
            Some((_, before_mm)) => s.partition_point(|s| before_mm + s < self.within_mm),
            None => 0,
        };
        let end = match self.last {
            Some((_, after_mm)) => s.partition_point(|s| after_mm + (element.length - s) >= self.within_mm),
            None => s.len(),
        };
        start.min(end)..end
    }

    /// Bounds of a column's position, in the machining direction: never before the section's first point, never
    /// beyond its last, never tighter than the command itself.
    fn clamp(&self, map: ColumnMap, element: &Element, s: f64, direction: f64, command: f64) -> [f64; 2] {
        let mut bounds = [f64::NEG_INFINITY, f64::INFINITY];
        let forwards = map.sign * direction;
        if let Some((first, before_mm)) = self.first
            && before_mm + s < self.within_mm
        {
            let limit = map.value_of(&first.element, 0.0, element);
            if forwards > 0.0 {
                bounds[0] = limit.min(command);
            } else if forwards < 0.0 {
                bounds[1] = limit.max(command);
            }
        }
        if let Some((last, after_mm)) = self.last
            && after_mm + (element.length - s) < self.within_mm
        {
            let limit = map.value_of(&last.element, last.element.length, element);
            if forwards > 0.0 {
                bounds[1] = limit.max(command);
            } else if forwards < 0.0 {
                bounds[0] = limit.min(command);
            }
        }
        bounds
    }
}

/// Vibration phase of a setpoint, turns: f·t with t from the section's start, which lies on the grid.
pub(crate) fn phase_turns(section: &Section, period_s: f64, index: u64) -> f64 {
    (index - section.start_period) as f64 * (section.condition.frequency_hz * period_s)
}

fn fill_wave(section: &Section, period_s: f64, first: u64, out: &mut [f64]) {
    for (k, wave) in out.iter_mut().enumerate() {
        *wave = sin_turns(phase_turns(section, period_s, first + k as u64));
    }
}

fn fill_axes(
    columns: &[ColumnMap],
    tool: Option<&ToolColumns>,
    element: &Element,
    s: &[f64],
    block: &mut SetpointBlock,
    start: usize,
) {
    let rows = start..start + s.len();
    for (map, column) in columns.iter().zip(&mut block.axes) {
        map.fill(element, s, &mut column[rows.clone()]);
    }
    if let Some(tool) = tool {
        let setup = match &element.curve {
            Curve::FiveAxis(five_axis) => Some(five_axis.setup()),
            _ => None,
        };
        tool.fill(block, rows, &element.work_offset, setup);
    }
}

/// The tool direction from the columns of the rotary axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ToolColumns {
    directions: RotaryDirections,
    /// The rotary axes of the chain: program axis and column.
    rotary: [(Axis, usize); 2],
}

impl ToolColumns {
    /// For a machine that has both rotary axes.
    pub(crate) fn of(machine: &Machine, kinematics: &Kinematics) -> Option<Self> {
        let [first, second] = kinematics.letters().1;
        let place = |axis: Axis| machine.column_of(axis).map(|column| (axis, column));
        Some(Self { directions: kinematics.rotary_directions(), rotary: [place(first)?, place(second)?] })
    }

    /// Fills rows whose axes are there, in work coordinates: those of a guided tool, or parallel to the chain's.
    fn fill(&self, block: &mut SetpointBlock, rows: Range<usize>, work_offset: &Position, setup: Option<&Setup>) {
        let [x, y, z] = block.tool_direction.as_mut_slice() else { return };
        for row in rows {
            let rotary_rad =
                self.rotary.map(|(axis, column)| (block.axes[column][row] + work_offset[axis.index()]).to_radians());
            let direction = self.directions.at(rotary_rad);
            let on_work = |setup: &Setup| setup.to_work(&ToolPose { tip_mm: [0.0; 3], direction }).direction;
            [x[row], y[row], z[row]] = setup.map_or(direction, on_work);
        }
    }
}

/// No vibration for the drives.
pub(crate) fn still(servo: &mut ServoColumns, start: usize) {
    for column in &mut servo.clamp_low_mm {
        column[start..].fill(f64::NEG_INFINITY);
    }
    for column in &mut servo.clamp_high_mm {
        column[start..].fill(f64::INFINITY);
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
