//! Coordinates and offsets, against positions of the machine worked by hand (docs/coordinates.md).

mod data;
mod frames;
mod planar;
mod properties;
mod tools;
mod variables;
mod worked;

use super::*;

/// Moves of a program in machine coordinates, as kind, X, Y and Z, and its findings.
struct Run {
    moves: Vec<(MoveKind, [f64; 3])>,
    findings: Vec<String>,
    operations: Vec<Operation>,
}

fn run_with(settings: &LanguageSettings, tools: &[ToolOffset], program: &str) -> Run {
    let program = format!("{program}\nM30\n");
    let interpreter = Interpreter::new(settings.clone()).with_tools(tools.to_vec());
    let (operations, findings) = interpreter.read_all(program.as_bytes());
    let mut stands: Option<[f64; 3]> = None;
    let moves = operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Move(step) => {
            let [start, end] =
                [&step.start, &step.end].map(|at| [0, 1, 2].map(|axis| at[axis] + step.work_offset[axis]));
            // Whatever changes, the machine goes on from where it is.
            if let Some(stands) = stands.filter(|_| !findings.has_errors()) {
                assert!(
                    stands.iter().zip(start).all(|(one, other)| (one - other).abs() < 1e-9),
                    "{stands:?} {start:?}"
                );
            }
            stands = Some(end);
            Some((step.kind, end))
        }
        _ => None,
    });
    let moves = moves.collect();
    let findings = findings.findings().iter().map(|it| format!("{}:{}", it.span.line, it.code)).collect();
    Run { moves, findings, operations }
}

/// Ends of the moves of a program in machine coordinates along X and Y, which must have no findings.
#[track_caller]
fn ends(settings: &LanguageSettings, program: &str, expected: &[[f64; 3]]) {
    ends_with(settings, &tools(), program, expected);
}

#[track_caller]
fn ends_with(settings: &LanguageSettings, tools: &[ToolOffset], program: &str, expected: &[[f64; 3]]) {
    let run = run_with(settings, tools, program);
    assert_eq!(run.findings, [""; 0], "{program}");
    same(program, &run.moves.iter().map(|(_, end)| *end).collect::<Vec<_>>(), expected);
}

#[track_caller]
fn same(program: &str, found: &[[f64; 3]], expected: &[[f64; 3]]) {
    let is_same = found.len() == expected.len()
        && found.iter().flatten().zip(expected.iter().flatten()).all(|(one, other)| (one - other).abs() < 1e-9);
    assert!(is_same, "{program}\nfound {found:?}\nexpected {expected:?}");
}

/// The findings of a program, as line and code.
#[track_caller]
fn finds(settings: &LanguageSettings, program: &str, expected: &[&str]) {
    assert_eq!(run_with(settings, &tools(), program).findings, expected, "{program}");
}

fn haas() -> LanguageSettings {
    let mut settings = mill();
    settings.coordinates.style = crate::CoordinateStyle::Haas;
    settings
}

/// Resumed from its state before every line, a program gives what it gives in one run.
#[track_caller]
fn resumes(settings: &LanguageSettings, program: &str) {
    let program = format!("{program}\nM30\n");
    let tools = tools();
    let whole = Interpreter::new(settings.clone()).with_tools(tools.clone()).read_all(program.as_bytes()).0;
    let mut interpreter = Interpreter::new(settings.clone()).with_tools(tools.clone());
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    loop {
        // An index in the making is no part of the state.
        if interpreter.indexing.is_none() {
            let state = postcard::to_allocvec(interpreter.state()).expect("a state");
            let state = postcard::from_bytes(&state).expect("the same state");
            let indexes = core::mem::take(&mut interpreter.indexes);
            interpreter = Interpreter::restore(settings.clone(), state).with_tools(tools.clone());
            interpreter.indexes = indexes;
        }
        let rest = &program.as_bytes()[program.len().min(interpreter.place().offset as usize)..];
        match interpreter.read_line(rest, true, &mut operations, &mut findings) {
            LineOutcome::Consumed(_) | LineOutcome::Elsewhere => {}
            LineOutcome::NeedMore | LineOutcome::Ended => break,
        }
    }
    assert_eq!(operations, whole, "{program}");
}
