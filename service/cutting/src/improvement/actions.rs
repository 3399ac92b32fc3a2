//! The actions of a program, one after the other, and whether a changed program has the same ones but for what was changed.

use std::collections::VecDeque;

use feedwave_program::{Feed, Function, Operation, OperationKind, PathControl, SourceSpan, SpindleSpeed};

use super::Surroundings;
use super::words::Word;
use crate::{Interpretation, InterpretationStep, PipelineConfig};

/// What a change is meant to change of the actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Meant {
    /// Feeds of cuts on these lines.
    Feeds {
        /// First line.
        first: u32,
        /// Last line.
        last: u32,
    },
    /// Spindle speeds.
    SpindleSpeeds,
    /// How the path runs from block to block.
    PathControl,
    /// Amplitudes and phases of threading passes.
    Threads,
}

/// A block that switches vibration along the path on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FunctionBlock {
    /// Its line, counted from 1.
    pub(super) line: u32,
    /// Whether lengths are inches there.
    pub(super) inch: bool,
    /// The word of the frequency, where it is written as a number.
    pub(super) frequency: Option<Word>,
    /// The word of the amplitude, likewise.
    pub(super) amplitude: Option<Word>,
}

/// The actions of a program.
pub(super) struct Actions<'a> {
    program: &'a [u8],
    interpretation: Interpretation,
    read: VecDeque<Operation>,
    ended: bool,
}

impl<'a> Actions<'a> {
    pub(super) fn new(program: &'a [u8], config: &PipelineConfig) -> Self {
        Self { program, interpretation: Interpretation::new(config), read: VecDeque::new(), ended: false }
    }

    /// The next one.
    pub(super) fn next<S: Surroundings>(&mut self, surroundings: &mut S) -> Result<Option<Operation>, S::Error> {
        while self.read.is_empty() && !self.ended {
            surroundings.step()?;
            let step = self.interpretation.step();
            self.read.extend(self.interpretation.take_operations());
            match step {
                InterpretationStep::NeedInput(place) if place.program == 0 => {
                    self.interpretation.supply(place, self.program);
                }
                InterpretationStep::NeedInput(place) => match &*surroundings.further(place)? {
                    [] => self.interpretation.finish_input(),
                    bytes => self.interpretation.push(bytes),
                },
                InterpretationStep::More => {}
                InterpretationStep::Ended => self.ended = true,
            }
        }
        Ok(self.read.pop_front())
    }
}

/// Whether two programs do the same but for what is meant to change, and but for words of vibrations.
pub(super) fn same<S: Surroundings>(
    programs: [&[u8]; 2],
    config: &PipelineConfig,
    meant: Meant,
    surroundings: &mut S,
) -> Result<bool, S::Error> {
    let [mut one, mut other] = programs.map(|program| Actions::new(program, config));
    loop {
        let pair = (one.next(surroundings)?, other.next(surroundings)?);
        match pair {
            (None, None) => return Ok(true),
            (Some(one), Some(other)) if without(one.clone(), meant) == without(other.clone(), meant) => {}
            _ => return Ok(false),
        }
    }
}

/// An action without what is meant to change, and without the columns of its words.
fn without(mut action: Operation, meant: Meant) -> Operation {
    let line = action.span.line;
    action.span = SourceSpan { column: 0, length: 0, ..action.span };
    match (&mut action.kind, meant) {
        (OperationKind::Function(command), _) => {
            let vibrates = matches!(command.function, Function::PathVibration | Function::ThreadVibration);
            for word in &mut command.words {
                word.span = SourceSpan::default();
                if vibrates {
                    word.value = 0.0;
                }
            }
        }
        (OperationKind::MachineCode(command), _) => {
            for word in &mut command.words {
                word.span = SourceSpan::default();
            }
        }
        (OperationKind::Move(cut), Meant::Feeds { first, last }) if (first..=last).contains(&line) => {
            cut.feed = Feed::PerMinute(0.0);
        }
        (OperationKind::Move(cut), Meant::PathControl) => cut.path_control = PathControl::ExactPath,
        (OperationKind::Guided(cut), Meant::PathControl) => cut.step.path_control = PathControl::ExactPath,
        (OperationKind::Move(cut), Meant::SpindleSpeeds) => still(&mut cut.spindle.speed),
        (OperationKind::Guided(cut), Meant::SpindleSpeeds) => still(&mut cut.step.spindle.speed),
        (OperationKind::Spindle(spindle), Meant::SpindleSpeeds) => still(&mut spindle.speed),
        (OperationKind::Thread(pass), Meant::SpindleSpeeds) => still(&mut pass.spindle.speed),
        (OperationKind::Thread(pass), Meant::Threads) => {
            (pass.amplitude_mm, pass.amplitude_word, pass.phase_shift_deg) = (None, None, None);
        }
        _ => {}
    }
    action
}

fn still(speed: &mut SpindleSpeed) {
    *speed = SpindleSpeed::Constant { rev_per_min: 0.0 };
}
