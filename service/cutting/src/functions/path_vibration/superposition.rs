//! What is superposed on the path: the vibration of a section and its parts.

use std::ops::Range;

use feedwave_motion::{Element, PlannedMotion, sin_turns};
use serde::{Deserialize, Serialize};

use super::{Amplitude, GenerationMode};
use crate::shared::blend::BlendedPath;
use crate::shared::columns::{ColumnMap, Samples, fill_axes};
use crate::shared::setpoint::{BLOCK_LENGTH, SetpointBlock};
use crate::shared::track::PathBarrier;

/// A barrier of a vibrating section; the path rests at each.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum SectionBarrier {
    /// A vibrating section starts.
    Start(SectionStart),
    /// The vibrating section ends, and its last part with it.
    End,
    /// A part of the section starts, which the vibration does not leave.
    PartStart(SectionPart),
    /// That part ends, and another one follows: the vibration cannot go over the junction of the two.
    PartEnd,
}

/// What the generator needs to know of a vibrating section.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SectionStart {
    pub(crate) frequency_hz: f64,
    pub(crate) amplitude_mm: f64,
    /// Largest ratio to it at which the amplitude follows the feed override; `None`: it stays.
    pub(crate) follows_up_to: Option<f64>,
}

/// Part of a vibrating section between two junctions that the vibration does not go over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct SectionPart {
    /// Length of path over which the vibration is blended in and out, mm; `None` where it is clamped at the part's ends.
    pub(crate) ramp_mm: Option<f64>,
}

/// Samples of one vibrating section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SectionSamples {
    pub(crate) total: u64,
    pub(crate) clamped: u64,
}

/// The section that is being interpolated, and the amplitude that outlasts it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct RunningVibration {
    section: Option<Section>,
    amplitude: Amplitude,
}

/// A running vibrating section.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Section {
    start_period: u64,
    condition: SectionStart,
    part: SectionPart,
    /// Path length of the parts before the present one, and with the present one once it has ended, mm.
    before_mm: f64,
    ended_mm: f64,
    samples: SectionSamples,
}

/// Buffers of one block.
#[derive(Clone, Debug)]
pub(crate) struct VibrationScratch {
    /// Amplitude, mm.
    amplitude_mm: Vec<f64>,
    /// Vibration wave, then a(t), mm.
    wave: Vec<f64>,
    /// Arc length after superposition, or an axis' share of the amplitude, mm.
    combined: Vec<f64>,
    /// Share of the amplitude near the ends of its path.
    share: Vec<f64>,
}

impl VibrationScratch {
    pub(crate) fn new() -> Self {
        let column = || vec![0.0; BLOCK_LENGTH];
        Self { amplitude_mm: column(), wave: column(), combined: column(), share: column() }
    }
}

impl RunningVibration {
    pub(crate) const fn is_in_section(&self) -> bool {
        self.section.is_some()
    }

    /// A section starts at a period of the grid.
    pub(crate) fn open(&mut self, start_period: u64, condition: SectionStart) {
        let (part, samples) = (SectionPart::default(), SectionSamples::default());
        self.section = Some(Section { start_period, condition, part, before_mm: 0.0, ended_mm: 0.0, samples });
        self.amplitude.open(&condition);
    }

    /// The section is over; its samples.
    pub(crate) fn close(&mut self) -> Option<SectionSamples> {
        self.section.take().map(|section| section.samples)
    }

    pub(crate) fn start_part(&mut self, part: SectionPart) {
        if let Some(section) = &mut self.section {
            section.part = part;
            section.before_mm = section.ended_mm;
        }
    }

    /// The present part of the section ends after `part_mm`.
    pub(crate) fn end_part(&mut self, part_mm: f64) {
        if let Some(section) = &mut self.section {
            section.ended_mm = section.before_mm + part_mm;
        }
    }

    /// Distance from the section's start of a place of the present part, mm.
    pub(crate) fn place_mm(&self, in_part_mm: f64) -> Option<f64> {
        self.section.map(|section| section.before_mm + in_part_mm)
    }

    /// Largest offset along the path that there can be, mm; 0 outside sections.
    pub(crate) fn reach_mm(&self) -> f64 {
        self.section.map_or(0.0, |section| section.condition.reach_mm())
    }

    /// How far ahead the path has to be known, mm.
    pub(crate) fn needed_ahead_mm(&self) -> Option<f64> {
        self.section.map(|section| section.part.ramp_mm.unwrap_or_else(|| section.condition.reach_mm()))
    }

    /// Whether the vibration is clamped at the ends of its parts instead of blended out.
    pub(crate) fn is_clamped(&self) -> bool {
        self.section.is_some_and(|section| section.part.ramp_mm.is_none())
    }

    /// Whether the end point is reached at a period of the grid: a blended vibration is 0 there, and while the offset is not
    /// negative the clamp holds the end point, so that drives that generate the vibration themselves arrive there without
    /// a jump.
    pub(crate) fn arrives_at_end(&self, period_s: f64, period: u64) -> bool {
        self.section.is_some_and(|section| {
            section.part.ramp_mm.is_some() || sin_turns(section.phase_turns(period_s, period)) >= 0.0
        })
    }

    /// Time until a clamped vibration next passes zero, s; with `only_if_negative` 0 while its offset is not negative.
    /// `since_s` is the time since a period of the grid.
    pub(crate) fn wait_for_zero_s(&self, since_s: impl Fn(u64) -> f64, only_if_negative: bool) -> f64 {
        let Some(section) = self.section.filter(|_| self.is_clamped()) else { return 0.0 };
        let frequency_hz = section.condition.frequency_hz;
        let half_turns = 2.0 * frequency_hz * since_s(section.start_period);
        let is_negative = half_turns.floor() % 2.0 == 1.0;
        if only_if_negative && !is_negative {
            return 0.0;
        }
        (half_turns.ceil() - half_turns) / (2.0 * frequency_hz)
    }

    /// The feed override asked for is another one from the setpoint `index` on.
    pub(crate) fn follow(&mut self, period_s: f64, index: u64, wanted: f64) {
        let condition = self.section.as_ref().map(|section| &section.condition);
        self.amplitude.follow(condition, period_s, index, wanted);
    }

    /// First setpoint at which the amplitude is large enough for this feed override, and stays so; 0 outside sections.
    pub(crate) fn suffices_from(&self, period_s: f64, wanted: f64) -> u64 {
        let condition = self.section.as_ref().map(|section| &section.condition);
        condition.map_or(0, |condition| self.amplitude.suffices_from(condition, period_s, wanted))
    }

    /// Fills the axes of the rows from `start` on with the commanded path and the vibration on it.
    pub(crate) fn fill<B: PathBarrier>(
        &mut self,
        at: &Samples<'_, B>,
        mode: GenerationMode,
        scratch: &mut VibrationScratch,
        block: &mut SetpointBlock,
        start: usize,
    ) {
        let Self { section: Some(section), amplitude } = self else { return };
        let count = at.s.len();
        section.samples.total += count as u64;
        section.fill_wave(at.period_s, at.index, &mut scratch.wave[..count]);
        amplitude.fill(&section.condition, at.period_s, at.index, &mut scratch.amplitude_mm[..count]);
        section.blend(at, scratch);
        match mode {
            GenerationMode::AlongPath => section.fill_along_path(at, scratch, block, start),
            GenerationMode::Tangential | GenerationMode::ServoSide => {
                section.fill_along_tangent(at, scratch, block, start);
            }
        }
    }
}

impl Section {
    /// Vibration phase of a setpoint, turns: f·t with t from the section's start, which lies on the grid.
    fn phase_turns(&self, period_s: f64, index: u64) -> f64 {
        (index - self.start_period) as f64 * (self.condition.frequency_hz * period_s)
    }

    fn fill_wave(&self, period_s: f64, first: u64, out: &mut [f64]) {
        let (first, turns) = ((first - self.start_period) as f64, self.condition.frequency_hz * period_s);
        for (k, wave) in (0..out.len()).zip(out.iter_mut()) {
            *wave = sin_turns((first + k as f64) * turns);
        }
    }

    /// Takes the amplitude back towards the ends of the part.
    fn blend<B: PathBarrier>(&self, at: &Samples<'_, B>, scratch: &mut VibrationScratch) {
        let Some(ramp_mm) = self.part.ramp_mm else { return };
        let count = at.s.len();
        let (before_mm, length_mm) = at.track.section_place(at.item);
        let path = BlendedPath { ramp_mm, before_mm, length_mm };
        if !path.is_whole(at.s) {
            let share = &mut scratch.share[..count];
            path.fill_share(at.s, share);
            for (amplitude_mm, share) in scratch.amplitude_mm[..count].iter_mut().zip(share) {
                *amplitude_mm *= *share;
            }
        }
    }

    /// The tool goes forwards and backwards on the path itself, also over the ends of its element.
    fn fill_along_path<B: PathBarrier>(
        &mut self,
        at: &Samples<'_, B>,
        scratch: &mut VibrationScratch,
        block: &mut SetpointBlock,
        start: usize,
    ) {
        let count = at.s.len();
        let (offset, combined) = (&mut scratch.wave[..count], &mut scratch.combined[..count]);
        for (offset, amplitude_mm) in offset.iter_mut().zip(&scratch.amplitude_mm) {
            *offset *= amplitude_mm;
        }
        let mut within = true;
        for ((combined, s), offset) in combined.iter_mut().zip(at.s).zip(offset.iter()) {
            *combined = s + offset;
            within &= *combined >= 0.0 && *combined <= at.element.length;
        }
        block.vibration_offset_mm[start..].copy_from_slice(offset);
        if within {
            fill_axes(at.columns, at.tool, at.element, combined, block, start);
            return;
        }
        // Samples that leave the element, forwards or backwards, go to its neighbours in runs.
        let mut k = 0;
        while k < count {
            let run_start = k;
            let mut place = at.track.locate(at.item, combined[k]);
            let run_item = place.item;
            while place.item == run_item {
                combined[k] = place.s;
                if place.beyond_mm != 0.0 {
                    self.samples.clamped += 1;
                    block.vibration_offset_mm[start + k] -= place.beyond_mm;
                }
                k += 1;
                if k == count {
                    break;
                }
                place = at.track.locate(at.item, combined[k]);
            }
            if let Some(run_motion) = at.track.motion(run_item) {
                let run = &combined[run_start..k];
                fill_axes(at.columns, at.tool, &run_motion.element, run, block, start + run_start);
            }
        }
    }

    /// The offset is added along the tangent, here or by the drives, and clamped at the ends of its part.
    fn fill_along_tangent<B: PathBarrier>(
        &mut self,
        at: &Samples<'_, B>,
        scratch: &mut VibrationScratch,
        block: &mut SetpointBlock,
        start: usize,
    ) {
        let count = at.s.len();
        fill_axes(at.columns, at.tool, at.element, at.s, block, start);
        let within_mm = self.condition.reach_mm();
        let is_clamped = self.part.ramp_mm.is_none();
        let ends = SectionEnds {
            first: at.track.section_start_near(at.item, within_mm).filter(|_| is_clamped),
            last: at.track.section_end_near(at.item, within_mm).filter(|_| is_clamped),
            within_mm,
        };
        // Between the reaches of the part's ends nothing is clamped: column by column.
        let free = ends.free(at.element, at.s);
        fill_free(at, free.clone(), scratch, block, start);
        let (amplitude_mm, wave) = (&scratch.amplitude_mm[..count], &scratch.wave[..count]);
        let waves = amplitude_mm.iter().zip(wave);
        for (offset, (amplitude_mm, wave)) in block.vibration_offset_mm[start..].iter_mut().zip(waves) {
            *offset = amplitude_mm * wave;
        }
        for k in (0..free.start).chain(free.end..count) {
            let is_clamped = ends.fill_clamped(at, k, [amplitude_mm[k], wave[k]], block, start + k);
            self.samples.clamped += u64::from(is_clamped);
        }
        if let Some(servo) = &mut block.servo {
            servo.frequency_hz[start..].fill(self.condition.frequency_hz);
            for (k, phase) in servo.phase_turns[start..].iter_mut().enumerate() {
                *phase = self.phase_turns(at.period_s, at.index + k as u64);
            }
        }
    }
}

/// Adds the offset along the tangent to the samples in `free`, which nothing clamps.
fn fill_free<B>(
    at: &Samples<'_, B>,
    free: Range<usize>,
    scratch: &mut VibrationScratch,
    block: &mut SetpointBlock,
    start: usize,
) {
    let (amplitude_mm, waves) = (&scratch.amplitude_mm[free.clone()], &scratch.wave[free.clone()]);
    let amplitudes = &mut scratch.combined[free.clone()];
    for (column, map) in at.columns.iter().enumerate() {
        map.fill_tangent(at.element, &at.s[free.clone()], amplitudes);
        for (amplitude, amplitude_mm) in amplitudes.iter_mut().zip(amplitude_mm) {
            *amplitude = map.sign * (amplitude_mm * *amplitude);
        }
        let rows = start + free.start..start + free.end;
        if let Some(servo) = &mut block.servo {
            servo.amplitude_mm[column][rows.clone()].copy_from_slice(amplitudes);
            servo.clamp_low_mm[column][rows.clone()].fill(f64::NEG_INFINITY);
            servo.clamp_high_mm[column][rows].fill(f64::INFINITY);
        } else {
            for ((command, amplitude), wave) in block.axes[column][rows].iter_mut().zip(&*amplitudes).zip(waves) {
                *command += amplitude * wave;
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

    /// One sample near an end: amplitude and wave, clamped. Whether it is.
    fn fill_clamped<B>(
        &self,
        at: &Samples<'_, B>,
        k: usize,
        [amplitude_mm, wave]: [f64; 2],
        block: &mut SetpointBlock,
        row: usize,
    ) -> bool {
        // Wanted and clamped offsets of the axes, projected onto the tangent.
        let (mut wanted_sum, mut clamped_sum) = (0.0, 0.0);
        let mut clamped = false;
        for (column, map) in at.columns.iter().enumerate() {
            let mut direction = [0.0];
            map.fill_tangent(at.element, &at.s[k..=k], &mut direction);
            let [direction] = direction;
            let command = &mut block.axes[column][row];
            let [low, high] = self.clamp(*map, at.element, at.s[k], direction, *command);
            let forwards = map.sign * direction;
            let signed_amplitude_mm = map.sign * (amplitude_mm * direction);
            if let Some(servo) = &mut block.servo {
                servo.amplitude_mm[column][row] = signed_amplitude_mm;
                servo.clamp_low_mm[column][row] = low;
                servo.clamp_high_mm[column][row] = high;
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
        block.vibration_offset_mm[row] = amplitude_mm * wave * share;
        clamped
    }
}
