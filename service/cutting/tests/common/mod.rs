//! Running whole programs for tests.
#![allow(dead_code, reason = "every test file uses its part")]

pub mod changes;
pub mod course;
pub mod cures;
pub mod machines;
pub mod measured;

use std::sync::Arc;

use feedwave_cutting::{OverrideChange, Pipeline, PipelineConfig, SetpointBlock, Step, Validation, ValidationReport};

/// All setpoints of a program, column by column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Setpoints {
    pub axes: Vec<Vec<f64>>,
    pub tool_direction: Vec<Vec<f64>>,
    pub path: Vec<f64>,
    pub feed: Vec<f64>,
    pub vibration: Vec<f64>,
    pub spindle: Vec<f64>,
    pub line: Vec<u32>,
    pub servo_amplitude: Vec<Vec<f64>>,
    pub servo_low: Vec<Vec<f64>>,
    pub servo_high: Vec<Vec<f64>>,
    pub servo_phase: Vec<f64>,
}

impl Setpoints {
    pub fn append(&mut self, block: &SetpointBlock) {
        fn extend(to: &mut Vec<Vec<f64>>, from: &[Vec<f64>]) {
            to.resize(from.len(), Vec::new());
            for (to, from) in to.iter_mut().zip(from) {
                to.extend_from_slice(from);
            }
        }
        assert_eq!(block.first_index, self.len() as u64, "blocks follow each other");
        extend(&mut self.axes, &block.axes);
        extend(&mut self.tool_direction, &block.tool_direction);
        self.path.extend_from_slice(&block.path_position_mm);
        self.feed.extend_from_slice(&block.feed_mm_per_min);
        self.vibration.extend_from_slice(&block.vibration_offset_mm);
        self.spindle.extend_from_slice(&block.spindle_angle_deg);
        self.line.extend_from_slice(&block.line);
        if let Some(servo) = &block.servo {
            extend(&mut self.servo_amplitude, &servo.amplitude_mm);
            extend(&mut self.servo_low, &servo.clamp_low_mm);
            extend(&mut self.servo_high, &servo.clamp_high_mm);
            self.servo_phase.extend_from_slice(&servo.phase_turns);
        }
    }

    pub fn len(&self) -> usize {
        self.line.len()
    }

    /// Bits of every column of setpoint `index`, for exact comparison.
    pub fn bits(&self, index: usize) -> Vec<u64> {
        let columns = self.axes.iter().chain(&self.tool_direction).chain([
            &self.path,
            &self.feed,
            &self.vibration,
            &self.spindle,
        ]);
        columns.map(|column| column[index].to_bits()).chain([u64::from(self.line[index])]).collect()
    }
}

/// Feeds a program in pieces of `piece` bytes, and asks for as many setpoints at a time.
pub fn run_in_pieces(program: &[u8], config: &PipelineConfig, piece: usize) -> Setpoints {
    let mut pipeline = Pipeline::new(Arc::new(config.clone()));
    let mut block = pipeline.new_block();
    let mut setpoints = Setpoints::default();
    loop {
        match pipeline.next_setpoints(&mut block, piece) {
            Step::Block => setpoints.append(&block),
            Step::NeedInput(place) => {
                let end = (place.offset as usize).saturating_add(piece.max(1)).min(program.len());
                pipeline.supply(place, &program[..end.max(place.offset as usize)]);
            }
            Step::Finished => return setpoints,
            Step::Refused => panic!("refused: {:#?}", pipeline.findings()),
        }
    }
}

pub fn run(program: &str, config: &PipelineConfig) -> Setpoints {
    run_in_pieces(program.as_bytes(), config, usize::MAX)
}

pub fn validate(program: &str, config: &PipelineConfig) -> ValidationReport {
    let mut validation = Validation::new(Arc::new(config.clone()));
    loop {
        match validation.step() {
            Step::Block => {}
            Step::NeedInput(place) => validation.supply(place, program.as_bytes()),
            Step::Finished => return validation.finish(),
            Step::Refused => panic!("a validation reads to the end"),
        }
    }
}

/// Snapshot at every block boundary: (index, input offset, snapshot).
pub fn snapshots(program: &[u8], config: &PipelineConfig) -> Vec<(u64, u64, Vec<u8>)> {
    let mut pipeline = Pipeline::new(Arc::new(config.clone()));
    let mut block = pipeline.new_block();
    let mut taken = Vec::new();
    loop {
        match pipeline.next_block(&mut block) {
            Step::Block => {
                let snapshot = pipeline.snapshot().expect("plain data");
                taken.push((pipeline.next_index(), pipeline.place().offset, snapshot));
            }
            Step::NeedInput(place) => pipeline.supply(place, program),
            Step::Finished => return taken,
            Step::Refused => panic!("refused: {:#?}", pipeline.findings()),
        }
    }
}

/// Every setpoint from a snapshot on.
pub fn resume(program: &[u8], config: &PipelineConfig, offset: u64, snapshot: &[u8]) -> (u64, Setpoints) {
    let mut pipeline = Pipeline::restore(Arc::new(config.clone()), snapshot).expect("a snapshot just taken");
    assert_eq!(pipeline.place().offset, offset);
    let first = pipeline.next_index();
    let mut block = pipeline.new_block();
    let mut setpoints = Setpoints::default();
    loop {
        match pipeline.next_block(&mut block) {
            Step::Block => {
                block.first_index -= first;
                setpoints.append(&block);
            }
            Step::NeedInput(place) => pipeline.supply(place, program),
            Step::Finished => return (first, setpoints),
            Step::Refused => panic!("refused: {:#?}", pipeline.findings()),
        }
    }
}

/// All setpoints of a program whose changes of the feed override are appended while it runs, asked for `most` at a time.
pub fn run_appending(program: &str, config: &PipelineConfig, overrides: &[OverrideChange], most: usize) -> Setpoints {
    let mut pipeline = Pipeline::new(Arc::new(config.clone()));
    let mut block = pipeline.new_block();
    let mut setpoints = Setpoints::default();
    let mut changes = overrides.iter().peekable();
    pipeline.push(program.as_bytes());
    pipeline.finish_input();
    loop {
        let next = pipeline.next_index();
        let mut most = most;
        while let Some(&&change) = changes.peek() {
            if change.index > next {
                most = most.min((change.index - next) as usize);
                break;
            }
            pipeline.append_override(change).unwrap();
            changes.next();
        }
        match pipeline.next_setpoints(&mut block, most) {
            Step::Block => setpoints.append(&block),
            Step::Finished => return setpoints,
            step => panic!("{step:?}: {:#?}", pipeline.findings()),
        }
    }
}

/// Bits of all setpoints.
pub fn all_bits(setpoints: &Setpoints) -> Vec<Vec<u64>> {
    (0..setpoints.len()).map(|k| setpoints.bits(k)).collect()
}
