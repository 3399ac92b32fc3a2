//! A program and a machine in, a better program out, every change with its reason and its gain (docs/functions/path-vibration.md, "A
//! better vibration").
//!
//! Invariants: only words in their place change; what comes out is validated again, and a change that validation does not bear out
//! is not made; what is not changed is said with its reason. Where a word may govern more than what it is changed for, the actions
//! of the changed program are compared with those of the program one by one.

use std::borrow::Cow;
use std::sync::Arc;

use feedwave_program::{Place, Severity, SourceSpan};

use crate::functions::path_vibration::code;
use crate::{PipelineConfig, SearchGoals, ValidationReport};

mod actions;
mod again;
mod edits;
mod feed;
mod judged;
mod speed;
mod stability;
mod thread;
mod tolerance;
mod vibration;
mod words;
mod work;
mod written;

#[cfg(test)]
mod tests;

use self::edits::Edits;
pub use self::stability::StabilityGoal;
use self::work::Work;

/// Longest program that is improved, bytes.
pub const MAX_IMPROVED_BYTES: u64 = 64 << 20;

/// How often a program is improved, the last time to see that nothing more changes.
const MAX_ROUNDS: u32 = 8;

/// What is wanted of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct ImprovementGoals {
    /// What every vibration along the path has to do.
    pub vibration: SearchGoals,
    /// Lower amplitudes that are more than enough as well.
    pub least_amplitude: bool,
    /// Lowest and highest spindle speed, rev/min, within which the speed of a section may change that nothing else would cure; `None`:
    /// speeds stay.
    pub spindle_rev_per_min: Option<[f64; 2]>,
    /// Largest feed per revolution at the largest override, mm, up to which feeds of vibrating sections are raised; a vibration makes
    /// the chip thicker than that in places. `None`: feeds stay.
    pub max_feed_per_rev_mm: Option<f64>,
    /// Largest tolerance of the path, mm, up to which tolerances (`G64 P`) are raised where that saves time; `None`: they stay.
    pub max_tolerance_mm: Option<f64>,
    /// The depth that has to be stable in every vibrating section, by the lobes of the tool; `None`: stability is not judged.
    pub stability: Option<StabilityGoal>,
}

/// What came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Improvement {
    /// The report about the program.
    pub before: ValidationReport,
    /// The report about what came out; of a program with errors the same, but for those of vibrations that an axis could not follow.
    pub after: ValidationReport,
    /// What came out: the bytes of the program with the changes.
    pub program: Vec<u8>,
    /// Each word that changed, once, in the order of the program.
    pub changes: Vec<WordChange>,
    /// What was done and what was not, by what it is about, in the order in which it was done.
    pub steps: Vec<ImprovementStep>,
}

impl Improvement {
    /// Whether everything that is wanted holds: no step was impossible, and every section was judged.
    #[must_use]
    pub fn holds(&self) -> bool {
        let possible = |step: &ImprovementStep| step.outcome != ImprovementOutcome::NotPossible;
        self.after.is_accepted() && self.sections_not_judged() == 0 && self.steps.iter().all(possible)
    }

    /// Sections that the report counts and does not list.
    #[must_use]
    pub const fn sections_not_judged(&self) -> u64 {
        self.before.summary.section_count.saturating_sub(self.before.sections.len() as u64)
    }
}

/// A word and what takes its place.
#[derive(Clone, Debug, PartialEq)]
pub struct WordChange {
    /// The word in the program.
    pub span: SourceSpan,
    /// What it is.
    pub old: String,
    /// What it becomes.
    pub new: String,
}

/// What a step is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImprovementKind {
    /// Frequency and amplitude of a vibration along the path.
    Vibration,
    /// The same with another spindle speed.
    SpindleSpeed,
    /// Feeds of a vibrating section.
    Feed,
    /// Amplitude and phase of a vibrating threading pass.
    ThreadPass,
    /// Tolerance of the path.
    Tolerance,
}

/// What became of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImprovementOutcome {
    /// It is as wanted, or nothing better was found within what is permitted, and stays.
    Stays,
    /// It was changed.
    Changed,
    /// What is wanted does not hold, and could not be made to.
    NotPossible,
}

/// What was done about one thing, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct ImprovementStep {
    /// The line that it is about.
    pub line: u32,
    /// What it is about.
    pub kind: ImprovementKind,
    /// As it was, such as `50 Hz, 0.03 mm`.
    pub subject: String,
    /// What became of it.
    pub outcome: ImprovementOutcome,
    /// Why, as a clause.
    pub reason: String,
    /// The words that it changed, as they were when it did.
    pub changes: Vec<WordChange>,
    /// What it gained: figures before and after it.
    pub figures: Vec<ImprovementFigure>,
}

/// A figure before and after a step.
#[derive(Clone, Debug, PartialEq)]
pub struct ImprovementFigure {
    /// What it is, as a few words.
    pub name: Cow<'static, str>,
    /// Before.
    pub before: f64,
    /// After.
    pub after: f64,
    /// Its unit, `""` for a ratio.
    pub unit: &'static str,
}

/// What an improvement is given while it computes.
pub trait Surroundings {
    /// Why it cannot go on.
    type Error;

    /// Bytes of a further program file from a place on; none at its end. The program itself is never asked for.
    ///
    /// # Errors
    /// Ends the improvement.
    fn further(&mut self, place: Place) -> Result<Cow<'_, [u8]>, Self::Error>;

    /// Is called again and again, some thousand lines or one block of setpoints apart.
    ///
    /// # Errors
    /// Ends the improvement.
    fn step(&mut self) -> Result<(), Self::Error>;
}

/// Improves a program of at most [`MAX_IMPROVED_BYTES`], and what comes out again, until nothing more changes: a speed, a feed or an
/// amplitude that changed may be that of what was judged before. At most eight times.
///
/// # Errors
/// Those of the surroundings.
pub fn improve<S: Surroundings>(
    program: &[u8],
    config: &Arc<PipelineConfig>,
    goals: &ImprovementGoals,
    surroundings: &mut S,
) -> Result<Improvement, S::Error> {
    let mut whole = improve_once(program, config, goals, surroundings)?;
    let mut is_settled = whole.changes.is_empty();
    for _ in 1..MAX_ROUNDS {
        if is_settled {
            break;
        }
        let next = improve_once(&whole.program, config, goals, surroundings)?;
        is_settled = next.changes.is_empty();
        whole = again::together(whole, next);
    }
    Ok(whole)
}

fn improve_once<S: Surroundings>(
    program: &[u8],
    config: &Arc<PipelineConfig>,
    goals: &ImprovementGoals,
    surroundings: &mut S,
) -> Result<Improvement, S::Error> {
    let mut work = Work::new(program, config, goals, surroundings);
    let before = work.validate(program)?;
    if !is_improvable(&before) {
        let (after, program) = (before.clone(), program.to_vec());
        return Ok(Improvement { before, after, program, changes: Vec::new(), steps: Vec::new() });
    }
    let mut state = State { edits: Edits::default(), after: before.clone(), steps: Vec::new() };
    let found = work.function_words()?;
    let mut sections = vibration::improve(&mut work, &before, &found, &mut state)?;
    if state.after.is_accepted() {
        feed::improve(&mut work, &found, &mut sections, &mut state)?;
        thread::improve(&mut work, &found, &mut state)?;
        tolerance::improve(&mut work, &mut state)?;
    }
    let State { edits, after, steps } = state;
    let (program, changes) = (edits.apply(program, &work.lines), edits.into_changes());
    Ok(Improvement { before, after, program, changes, steps })
}

/// Whether nothing is wrong with a program but vibrations that an axis cannot follow.
fn is_improvable(report: &ValidationReport) -> bool {
    let axes = [code::VIB_AXIS_VELOCITY, code::VIB_AXIS_ACCELERATION, code::VIB_AXIS_JERK];
    let mut errors = report.findings.iter().filter(|finding| finding.severity == Severity::Error).peekable();
    let is_explained = report.is_accepted() || errors.peek().is_some();
    is_explained && errors.all(|finding| axes.contains(&finding.code))
}

/// The program so far.
struct State {
    edits: Edits,
    /// The report about it.
    after: ValidationReport,
    steps: Vec<ImprovementStep>,
}
