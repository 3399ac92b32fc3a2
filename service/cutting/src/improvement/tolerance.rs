//! Tolerances of the path (`G64 P`), raised where that saves time.

use feedwave_program::{OperationKind, PathControl};

use super::actions::Meant;
use super::judged;
use super::words::Word;
use super::work::Work;
use super::{ImprovementFigure, ImprovementKind, ImprovementOutcome, ImprovementStep, State, Surroundings};
use crate::ValidationReport;
use crate::shared::wording::{decimal, round_down, word};

/// Share of the machining time that a larger tolerance has to save.
const LEAST_SAVED: f64 = 1e-3;
/// Decimals of a tolerance.
const DECIMALS: usize = 5;

/// A tolerance that is written as a number.
struct Tolerance {
    word: Word,
    /// mm of one unit of the word.
    unit_mm: f64,
    tolerance_mm: f64,
}

/// Raises them one after the other.
pub(super) fn improve<S: Surroundings>(work: &mut Work<'_, S>, state: &mut State) -> Result<(), S::Error> {
    let Some(limit_mm) = work.goals.max_tolerance_mm else { return Ok(()) };
    for found in tolerances(work)? {
        let line = found.word.span.line;
        let step = |outcome, reason: String| ImprovementStep {
            line,
            kind: ImprovementKind::Tolerance,
            subject: format!("a tolerance of {} mm", decimal(found.tolerance_mm, 4)),
            outcome,
            reason,
            changes: Vec::new(),
            figures: Vec::new(),
        };
        let stays = |reason: &str| step(ImprovementOutcome::Stays, reason.to_owned());
        let new = round_down(limit_mm / found.unit_mm, DECIMALS);
        if new <= found.word.value {
            state.steps.push(stays("no more is permitted"));
            continue;
        }
        if !work.may_try() {
            state.steps.push(stays(&Work::<S>::no_more()));
            return Ok(());
        }
        let mut edits = state.edits.clone();
        let changes = edits.set(&found.word, word('P', new, DECIMALS)).into_iter().collect();
        let Some(after) = work.attempt(&state.edits, &edits, Meant::PathControl)? else {
            state.steps.push(stays("its word says something else as well"));
            continue;
        };
        let [was_s, is_s] = [&state.after, &after].map(|report| report.summary.duration_s);
        if let Some(worse) =
            judged::worse(&state.after, &after, |_| true).filter(|_| !after.is_accepted() || is_s < was_s)
        {
            state.steps.push(stays(&format!("a larger one would be worse in another way: {worse}")));
            continue;
        }
        if !after.is_accepted() || is_s > was_s * (1.0 - LEAST_SAVED) {
            state.steps.push(stays("a larger one saves no time worth it"));
            continue;
        }
        let deviation =
            |report: &ValidationReport| report.summary.path_deviation.as_ref().map_or(0.0, |it| it.largest_mm);
        let figure =
            |name: &'static str, before, after, unit| ImprovementFigure { name: name.into(), before, after, unit };
        let figures = vec![
            figure("machining time", was_s, is_s, "s"),
            figure("largest path deviation", deviation(&state.after), deviation(&after), "mm"),
        ];
        let reason = format!("the path may leave the programmed one by {} mm", decimal(limit_mm, 4));
        let changed = ImprovementStep { changes, figures, ..step(ImprovementOutcome::Changed, reason) };
        state.steps.push(changed);
        (state.edits, state.after) = (edits, after);
    }
    Ok(())
}

/// The tolerances of the program, in their order.
fn tolerances<S: Surroundings>(work: &mut Work<'_, S>) -> Result<Vec<Tolerance>, S::Error> {
    let mut words: Vec<Word> = Vec::new();
    for line in 1..=work.lines.count() {
        let of_line = work.lines.words(work.program, line);
        if of_line.iter().any(|word| word.letter == 'G' && word.value == 64.0) {
            words.extend(of_line.into_iter().find(|word| word.letter == 'P' && word.value > 0.0));
        }
    }
    // In mm as the first cut that follows in the text has it.
    let mut found: Vec<Tolerance> = Vec::new();
    let mut waiting = words.into_iter().peekable();
    let mut last: Option<Word> = None;
    work.each_action(|action| {
        let line = action.span.line;
        while let Some(next) = waiting.next_if(|word| word.span.line <= line) {
            last = Some(next);
        }
        let control = match &action.kind {
            OperationKind::Move(cut) => cut.path_control,
            OperationKind::Guided(cut) => cut.step.path_control,
            _ => return,
        };
        if let (PathControl::Continuous { tolerance_mm, .. }, 0) = (control, action.span.program)
            && let Some(word) = last.take()
        {
            found.push(Tolerance { unit_mm: tolerance_mm / word.value, word, tolerance_mm });
        }
    })?;
    Ok(found)
}
