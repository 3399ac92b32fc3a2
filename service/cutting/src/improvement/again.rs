//! An improvement, and that of what came out of it, as one.

use std::collections::BTreeMap;

use feedwave_program::SourceSpan;

use super::{Improvement, ImprovementKind, ImprovementOutcome, ImprovementStep, WordChange};

/// The changes of a program by the places of its words.
type Changes = BTreeMap<(u32, u32), WordChange>;

/// One improvement of two, of which the second is that of what came out of the first.
pub(super) fn together(first: Improvement, second: Improvement) -> Improvement {
    let mut changes: Changes = first.changes.into_iter().map(|change| (place(change.span), change)).collect();
    let mut later = second.steps;
    for change in later.iter_mut().flat_map(|step| &mut step.changes) {
        change.span = given(&changes, change.span);
    }
    let known = changes.clone();
    for change in second.changes {
        put(&mut changes, WordChange { span: given(&known, change.span), ..change });
    }
    Improvement {
        before: first.before,
        after: second.after,
        program: second.program,
        changes: changes.into_values().collect(),
        steps: steps(first.steps, later),
    }
}

const fn place(span: SourceSpan) -> (u32, u32) {
    (span.line, span.column)
}

/// Where a word of the changed program is in the program as it was given.
fn given(changes: &Changes, span: SourceSpan) -> SourceSpan {
    let mut longer = 0;
    for change in changes.range((span.line, 0)..(span.line + 1, 0)).map(|(_, change)| change) {
        let column = i64::from(change.span.column) + longer;
        if column == i64::from(span.column) {
            return change.span;
        }
        if column < i64::from(span.column) {
            longer += change.new.len() as i64 - i64::from(change.span.length);
        }
    }
    let column = (i64::from(span.column) - longer).unsigned_abs();
    SourceSpan { column: u32::try_from(column).unwrap_or(span.column), ..span }
}

/// Changes a word that may have been changed before.
fn put(changes: &mut Changes, change: WordChange) {
    let old = changes.remove(&place(change.span)).map_or_else(|| change.old.clone(), |known| known.old);
    if old != change.new {
        changes.insert(place(change.span), WordChange { old, ..change });
    }
}

/// What was done in all: what was changed, as one step for each thing, and of the rest what was said last.
fn steps(first: Vec<ImprovementStep>, later: Vec<ImprovementStep>) -> Vec<ImprovementStep> {
    let mut all = first;
    let mut met = BTreeMap::new();
    for step in later {
        let subject = (step.line, is_of_vibration(step.kind), step.kind as u8 * u8::from(!is_of_vibration(step.kind)));
        let count: &mut usize = met.entry(subject).or_default();
        let same = |known: &(usize, &ImprovementStep)| {
            known.1.line == step.line
                && (known.1.kind == step.kind || is_of_vibration(known.1.kind) && is_of_vibration(step.kind))
        };
        let known = all.iter().enumerate().filter(same).nth(*count).map(|(index, _)| index);
        *count += 1;
        let Some(index) = known else {
            all.push(step);
            continue;
        };
        let was_changed = all[index].outcome == ImprovementOutcome::Changed;
        match step.outcome {
            ImprovementOutcome::Changed if was_changed => go_on(&mut all[index], step),
            ImprovementOutcome::Stays if was_changed => {}
            ImprovementOutcome::NotPossible if was_changed => all.push(step),
            _ => all[index] = step,
        }
    }
    all
}

/// Whether a step is about a vibration along the path, with another spindle speed or not.
const fn is_of_vibration(kind: ImprovementKind) -> bool {
    matches!(kind, ImprovementKind::Vibration | ImprovementKind::SpindleSpeed)
}

/// A thing that was changed is changed again.
fn go_on(step: &mut ImprovementStep, later: ImprovementStep) {
    let mut changes: Changes = core::mem::take(&mut step.changes).into_iter().map(|it| (place(it.span), it)).collect();
    later.changes.into_iter().for_each(|change| put(&mut changes, change));
    step.changes = changes.into_values().collect();
    // Of the same thing the last reason is that of what is written.
    step.reason = match later.kind == step.kind {
        true => later.reason,
        false => format!("{}; then {}", step.reason, later.reason),
    };
    if later.kind == ImprovementKind::SpindleSpeed {
        step.kind = later.kind;
    }
    for figure in later.figures {
        match step.figures.iter_mut().find(|known| known.name == figure.name) {
            Some(known) => known.after = figure.after,
            None => step.figures.push(figure),
        }
    }
    if step.changes.is_empty() {
        (step.outcome, step.reason) = (ImprovementOutcome::Stays, "what was changed was changed back".to_owned());
        step.figures.clear();
    }
}
