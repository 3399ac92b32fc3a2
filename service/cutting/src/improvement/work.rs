//! What every step of an improvement works with: the program as it was given, validations, and comparisons of actions.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::sync::Arc;

use feedwave_program::{Feed, Function, FunctionCommand, MoveKind, Operation, OperationKind};

use super::actions::{self, Actions, FunctionBlock, Meant};
use super::edits::Edits;
use super::words::{Lines, Word};
use super::{ImprovementGoals, Surroundings};
use crate::{PipelineConfig, Step, Validation, ValidationReport};

/// Validations of programs with changes that are tried one after the other, beside those of all vibrations at once.
const MAX_TRIALS: u32 = 200;

/// The program as it was given, and what of it was validated.
pub(super) struct Work<'a, S> {
    pub(super) program: &'a [u8],
    pub(super) lines: Lines,
    pub(super) config: &'a Arc<PipelineConfig>,
    pub(super) goals: &'a ImprovementGoals,
    surroundings: &'a mut S,
    trials: u32,
}

/// A threading pass with words of its own.
#[derive(Clone, Debug, Default)]
pub(super) struct PassWords {
    /// Its amplitude, and mm of one unit of the word.
    pub(super) amplitude: Option<(Word, f64)>,
    /// Its phase shift.
    pub(super) phase: Option<Word>,
    /// The ratio of amplitude to infeed that is in force, where a word says it.
    pub(super) ratio: Option<Word>,
    /// The line is run more than once: what is changed for one pass would change others.
    pub(super) repeated: bool,
}

/// The words of machining functions in a program.
#[derive(Clone, Debug, Default)]
pub(super) struct FunctionWords {
    /// The blocks that switch vibration along the path on, by their lines.
    pub(super) blocks: BTreeMap<u32, FunctionBlock>,
    /// The threading passes, by their lines.
    pub(super) passes: BTreeMap<u32, PassWords>,
}

impl<'a, S: Surroundings> Work<'a, S> {
    pub(super) fn new(
        program: &'a [u8],
        config: &'a Arc<PipelineConfig>,
        goals: &'a ImprovementGoals,
        surroundings: &'a mut S,
    ) -> Self {
        Self { program, lines: Lines::of(program), config, goals, surroundings, trials: 0 }
    }

    /// Lets the surroundings have a look, between two searches.
    pub(super) fn step(&mut self) -> Result<(), S::Error> {
        self.surroundings.step()
    }

    /// Validates a program.
    pub(super) fn validate(&mut self, program: &[u8]) -> Result<ValidationReport, S::Error> {
        let mut validation = Validation::new(Arc::clone(self.config));
        loop {
            self.surroundings.step()?;
            match validation.step() {
                Step::NeedInput(place) if place.program == 0 => validation.supply(place, program),
                Step::NeedInput(place) => match &*self.surroundings.further(place)? {
                    [] => validation.finish_input(),
                    bytes => validation.push(bytes),
                },
                Step::Block => {}
                Step::Finished | Step::Refused => return Ok(validation.finish()),
            }
        }
    }

    /// Whether one more change may be tried.
    pub(super) const fn may_try(&self) -> bool {
        self.trials < MAX_TRIALS
    }

    /// Why nothing more is tried.
    pub(super) fn no_more() -> String {
        format!("{MAX_TRIALS} changes were tried one after the other, and no more are")
    }

    /// Validates the program with these changes, where its actions are those of the program with the earlier changes but for what
    /// is meant to change; `None` where they are not.
    pub(super) fn attempt(
        &mut self,
        earlier: &Edits,
        edits: &Edits,
        meant: Meant,
    ) -> Result<Option<ValidationReport>, S::Error> {
        self.trials += 1;
        let [before, program] = [earlier, edits].map(|edits| edits.apply(self.program, &self.lines));
        if !actions::same([&before, &program], self.config, meant, self.surroundings)? {
            return Ok(None);
        }
        Ok(Some(self.validate(&program)?))
    }

    /// Whether a program with changes does the same but for what is meant to change.
    pub(super) fn is_same(&mut self, edits: &Edits, meant: Meant) -> Result<bool, S::Error> {
        let changed = edits.apply(self.program, &self.lines);
        actions::same([self.program, &changed], self.config, meant, self.surroundings)
    }

    /// The words of machining functions.
    pub(super) fn function_words(&mut self) -> Result<FunctionWords, S::Error> {
        let mut found = FunctionWords::default();
        let mut ratio = None;
        let mut actions = Actions::new(self.program, self.config);
        while let Some(action) = actions.next(self.surroundings)? {
            let line = action.span.line;
            let is_own = action.span.program == 0;
            match &action.kind {
                OperationKind::Function(command) if command.function == Function::ThreadVibration => {
                    let word = command.word('Q').filter(|_| is_own);
                    ratio = word.and_then(|word| self.lines.word(self.program, word.span));
                }
                OperationKind::Function(command)
                    if is_own && command.function == Function::PathVibration && command.on =>
                {
                    self.add_block(&mut found.blocks, line, command);
                }
                OperationKind::Thread(pass) if is_own => {
                    if let Some(known) = found.passes.get_mut(&line) {
                        known.repeated = true;
                        continue;
                    }
                    let own = |letter| self.lines.only_word(self.program, line, letter);
                    let amplitude = pass.amplitude_mm.zip(own('A')).filter(|(mm, word)| *mm > 0.0 && word.value > 0.0);
                    let amplitude =
                        amplitude.map(|(mm, word)| (mm / word.value, word)).map(|(unit, word)| (word, unit));
                    let phase = pass.phase_shift_deg.zip(own('R')).filter(|(deg, word)| *deg == word.value);
                    let words = PassWords {
                        amplitude,
                        phase: phase.map(|(_, word)| word),
                        ratio: ratio.clone(),
                        repeated: false,
                    };
                    found.passes.insert(line, words);
                }
                _ => {}
            }
        }
        Ok(found)
    }

    fn add_block(&self, blocks: &mut BTreeMap<u32, FunctionBlock>, line: u32, command: &FunctionCommand) {
        let word = |letter| command.word(letter).and_then(|word| self.lines.word(self.program, word.span));
        let block = FunctionBlock { line, inch: command.inch, frequency: word('F'), amplitude: word('A') };
        // In a loop, or with lengths in another unit, a line may come again; its text is the same.
        let known = blocks.entry(line).or_insert_with(|| block.clone());
        if known.inch != block.inch {
            (known.frequency, known.amplitude) = (None, None);
        }
    }

    /// Shows every action of the program.
    pub(super) fn each_action(&mut self, mut see: impl FnMut(&Operation)) -> Result<(), S::Error> {
        let mut actions = Actions::new(self.program, self.config);
        while let Some(action) = actions.next(self.surroundings)? {
            see(&action);
        }
        Ok(())
    }

    /// The feeds of cuts on these lines, one of each line. Reading them counts as a change that is tried.
    pub(super) fn feeds_of(
        &mut self,
        lines: impl Iterator<Item = RangeInclusive<u32>>,
    ) -> Result<BTreeMap<u32, Feed>, S::Error> {
        self.trials += 1;
        // In a loop the sections of one block have the same lines.
        let lines: BTreeSet<(u32, u32)> = lines.map(|lines| (*lines.start(), *lines.end())).collect();
        let mut feeds = BTreeMap::new();
        self.each_action(|action| {
            let line = action.span.line;
            if action.span.program == 0
                && lines.iter().any(|(first, last)| (*first..=*last).contains(&line))
                && let OperationKind::Move(cut) = &action.kind
                && cut.kind == MoveKind::Cutting
            {
                feeds.insert(line, cut.feed);
            }
        })?;
        Ok(feeds)
    }

    /// The word with this letter that is in force at a line: on it or above it, but for one line.
    pub(super) fn word_above(&self, line: u32, letter: char, but: u32) -> Option<Word> {
        (1..=line).rev().filter(|line| *line != but).find_map(|line| self.last_word(line, letter))
    }

    /// The word of the spindle speed in force at a line: on it or above it, and not that of a clamp.
    pub(super) fn spindle_word_above(&self, line: u32) -> Option<Word> {
        (1..=line).rev().find_map(|line| {
            let words = self.lines.words(self.program, line);
            let is_clamp = words.iter().any(|word| word.letter == 'G' && [50.0, 92.0].contains(&word.value));
            words.into_iter().rev().find(|word| word.letter == 'S' && !is_clamp)
        })
    }

    /// The words in force with this letter at each of these lines, which ascend; the lines between them are read once.
    pub(super) fn words_above(&self, lines: &[u32], letter: char, but: u32) -> Vec<Option<Word>> {
        let Some(first) = lines.first() else { return Vec::new() };
        let mut known = self.word_above(*first, letter, but);
        let mut read = *first;
        let at = |line: &u32| {
            let newest =
                (read + 1..=*line).rev().filter(|line| *line != but).find_map(|line| self.last_word(line, letter));
            (read, known) = (*line, newest.or_else(|| known.take()));
            known.clone()
        };
        lines.iter().map(at).collect()
    }

    fn last_word(&self, line: u32, letter: char) -> Option<Word> {
        self.lines.words(self.program, line).into_iter().rev().find(|word| word.letter == letter)
    }
}
