//! Compensated contours: the worked examples of the page, joints, refusals, and random contours against brute force.

mod exits;
mod goldens;
mod random;
mod rules;

use super::*;
use crate::{Axis, LanguageSettings, Move, Severity, interpret};

/// Millimetres that programs and expectations of these tests may differ by: four decimals.
const TOLERANCE_MM: f64 = 5.1e-5;

fn settings() -> LanguageSettings {
    LanguageSettings { arc_radius_tolerance_mm: 1e-3, ..LanguageSettings::linuxcnc() }
}

fn moves(operations: &[Operation]) -> Vec<&Move> {
    let moves = operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Move(step) => Some(step),
        _ => None,
    });
    moves.collect()
}

/// Operations and findings of a LinuxCNC program.
fn read(program: &str) -> (Vec<Operation>, FindingLog) {
    let (operations, findings) = interpret(format!("G21 F100\n{program}\nM2\n").as_bytes(), settings());
    assert!(!operations.iter().any(|operation| matches!(operation.kind, OperationKind::Compensation(_))));
    if !findings.has_errors() {
        is_continuous(&operations);
    }
    (operations, findings)
}

fn is_continuous(operations: &[Operation]) {
    for pair in moves(operations).windows(2) {
        assert_eq!(pair[0].end, pair[1].start);
    }
}

/// A mill's program of lines and arcs, with the compensation switched on before the `on`th line and off before the `off`th,
/// counted from 1.
fn fanuc(
    program: &str,
    (on, off): (u32, u32),
    left: bool,
    radius_mm: f64,
    entry: CompensationEntry,
    corner: CompensationCorner,
) -> (Vec<Operation>, FindingLog) {
    let rules = CompensationRules::Fanuc { entry, corner };
    let mode = CompensationMode { left, plane: Plane::Xy, tilted: false, radius_mm, reference_mm: [0.0; 2], rules };
    compensated(program, (on, off), mode)
}

fn compensated(program: &str, (on, off): (u32, u32), mode: CompensationMode) -> (Vec<Operation>, FindingLog) {
    let (programmed, mut findings) = interpret(format!("{program}\nM2\n").as_bytes(), settings());
    assert!(!findings.has_errors(), "{:?}", findings.findings());
    let mut stage = Compensator::default();
    let mut out = Vec::new();
    let mut switches = [(on, CompensationCommand::On(mode)), (off, CompensationCommand::Off)].into_iter().peekable();
    for operation in programmed {
        while let Some((line, command)) = switches.next_if(|&(line, _)| line <= operation.span.line) {
            let span = SourceSpan { line, column: 1, length: 3, ..SourceSpan::default() };
            stage.push(Operation { span, kind: OperationKind::Compensation(command) }, &mut out, &mut findings);
        }
        stage.push(operation, &mut out, &mut findings);
    }
    assert!(stage.is_off());
    is_continuous(&out);
    (out, findings)
}

fn codes(findings: &FindingLog, severity: Severity) -> Vec<&'static str> {
    let of_severity = findings.findings().iter().filter(|finding| finding.severity == severity);
    of_severity.map(|finding| finding.code.name()).collect()
}

/// Ends of the moves in two axes, from the `skip`th on, against an expectation; an arc comes with its centre.
fn assert_ends(operations: &[Operation], axes: [Axis; 2], skip: usize, expected: &[(f64, f64, Option<[f64; 2]>)]) {
    let found: Vec<_> = moves(operations)
        .into_iter()
        .skip(skip)
        .map(|step| (step.end[axes[0].index()], step.end[axes[1].index()], step.arc.map(|arc| arc.center)))
        .collect();
    let is_near = |a: f64, b: f64| (a - b).abs() < TOLERANCE_MM;
    let same = found.len() == expected.len()
        && found.iter().zip(expected).all(|(found, expected)| {
            let same_centre = match (found.2, expected.2) {
                (Some(found), Some(expected)) => is_near(found[0], expected[0]) && is_near(found[1], expected[1]),
                (found, expected) => found.is_none() && expected.is_none(),
            };
            is_near(found.0, expected.0) && is_near(found.1, expected.1) && same_centre
        });
    assert!(same, "{found:#?} is not {expected:#?}");
}

fn assert_xy(operations: &[Operation], expected: &[(f64, f64, Option<[f64; 2]>)]) {
    assert_ends(operations, [Axis::X, Axis::Y], 1, expected);
}
