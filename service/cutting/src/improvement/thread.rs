//! Threading passes whose chip is not cut through: the amplitude, the phase shift or the ratio that their finding names.

use std::collections::BTreeSet;

use feedwave_program::{Finding, FindingCode};

use super::actions::Meant;
use super::judged;
use super::words::Word;
use super::work::{FunctionWords, PassWords, Work};
use super::{ImprovementFigure, ImprovementKind, ImprovementOutcome, ImprovementStep, State, Surroundings, WordChange};
use crate::ValidationReport;
use crate::functions::thread::code;
use crate::shared::wording::{decimal, round_up, word};

/// What says that the chip of a pass is not cut through.
const UNBROKEN: [FindingCode; 5] = [
    code::THREAD_FIRST_PASS,
    code::THREAD_AMPLITUDE_SMALL,
    code::THREAD_PHASE_EQUAL,
    code::THREAD_PHASE_UNBROKEN,
    code::THREAD_CHIP_RIBBON,
];

/// Does what the findings of unbroken passes name, from pass to pass, where that breaks the chip and makes nothing else worse. What a
/// pass has changes what the next one finds, whose turn comes then; where more passes are broken in the end, all is kept, and
/// otherwise nothing.
pub(super) fn improve<S: Surroundings>(
    work: &mut Work<'_, S>,
    found: &FunctionWords,
    state: &mut State,
) -> Result<(), S::Error> {
    let (edits, before, first_step) = (state.edits.clone(), state.after.clone(), state.steps.len());
    let mut tried: BTreeSet<(u32, &str)> = BTreeSet::new();
    loop {
        let next =
            state.after.findings.iter().find(|it| is_unbroken(it) && !tried.contains(&(it.span.line, it.code.name())));
        let Some(finding) = next.cloned() else { break };
        let words = found.passes.get(&finding.span.line).cloned().unwrap_or_default();
        let step = cure(work, &finding, &words, state)?;
        tried.insert((finding.span.line, finding.code.name()));
        state.steps.push(step);
    }
    let unbroken = |report: &ValidationReport| report.findings.iter().filter(|it| is_unbroken(it)).count();
    if state.edits != edits && unbroken(&state.after) >= unbroken(&before) {
        (state.edits, state.after) = (edits, before);
        for step in &mut state.steps[first_step..] {
            if step.outcome == ImprovementOutcome::Changed {
                step.outcome = ImprovementOutcome::NotPossible;
                step.reason.push_str(", and what would break it leaves the chips of other passes uncut");
                (step.changes, step.figures) = (Vec::new(), Vec::new());
            }
        }
    }
    Ok(())
}

/// Whether a finding says that the chip of a pass of the program itself is not cut through.
fn is_unbroken(finding: &Finding) -> bool {
    UNBROKEN.contains(&finding.code) && finding.span.program == 0
}

/// Tries the cures of one finding.
fn cure<S: Surroundings>(
    work: &mut Work<'_, S>,
    finding: &Finding,
    words: &PassWords,
    state: &mut State,
) -> Result<ImprovementStep, S::Error> {
    let line = finding.span.line;
    let step = |outcome, reason: String| ImprovementStep {
        line,
        kind: ImprovementKind::ThreadPass,
        subject: "the chip of a threading pass".to_owned(),
        outcome,
        reason,
        changes: Vec::new(),
        figures: Vec::new(),
    };
    let mut why = "no word of its own says what would have to change".to_owned();
    if words.repeated {
        why = "its block is run more than once, and each pass would need words of its own".to_owned();
    }
    for (old, new) in candidates(finding, words) {
        if !work.may_try() {
            return Ok(step(ImprovementOutcome::NotPossible, Work::<S>::no_more()));
        }
        let mut edits = state.edits.clone();
        let changes: Vec<WordChange> = edits.set(&old, new).into_iter().collect();
        let Some(after) = work.attempt(&state.edits, &edits, Meant::Threads)? else {
            why = format!("{} says something else as well", old.text);
            continue;
        };
        let still = |known: &Finding| known.code == finding.code && known.span.line == line && known.span.program == 0;
        // The passes behind it have their turn.
        let counts = |known: &Finding| !(is_unbroken(known) && known.span.line > line);
        let worse = judged::worse(&state.after, &after, counts);
        if after.findings.iter().any(still) || !after.is_accepted() || worse.is_some() {
            why = worse.unwrap_or_else(|| "what its finding names does not break the chip here".to_owned());
            continue;
        }
        let count = |report: &ValidationReport| report.summary.warnings as f64;
        let figures = vec![ImprovementFigure {
            name: "warnings".into(),
            before: count(&state.after),
            after: count(&after),
            unit: "",
        }];
        (state.edits, state.after) = (edits, after);
        let reason = finding.message.clone();
        return Ok(ImprovementStep { changes, figures, ..step(ImprovementOutcome::Changed, reason) });
    }
    Ok(step(ImprovementOutcome::NotPossible, format!("{}, and {why}", finding.message)))
}

/// The words that the cures of a finding name, with what would take their place.
fn candidates(finding: &Finding, words: &PassWords) -> Vec<(Word, String)> {
    if words.repeated {
        return Vec::new();
    }
    let of_cure = |cure: &feedwave_program::Suggestion| {
        let value = cure.value.as_ref()?;
        match &*value.name {
            "amplitude" => {
                let (old, unit_mm) = words.amplitude.clone()?;
                let new = word('A', round_up(value.value / unit_mm, 5), 5);
                Some((old, new))
            }
            "phase_shift" => Some((words.phase.clone()?, format!("R{}", decimal(value.value, 3)))),
            "ratio" => Some((words.ratio.clone()?, word('Q', value.value, 3))),
            _ => None,
        }
    };
    finding.suggestions.iter().filter_map(of_cure).collect()
}
