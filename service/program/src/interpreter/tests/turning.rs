//! Turning cycles against end points worked by hand from docs/turning-cycles.md, and those of LinuxCNC against its interpreter.

mod compensated;
mod contours;
mod grooves;
mod linuxcnc;
mod one_line;
mod refusals;
mod resuming;
mod single;
mod starts;
mod systems;

use super::*;
use crate::GCodeSystem;

/// A lathe of a G-code system.
fn system(system: GCodeSystem) -> LanguageSettings {
    LanguageSettings { g_code_system: Some(system), ..lathe() }
}

/// A FANUC lathe of system A.
fn a() -> LanguageSettings {
    system(GCodeSystem::A)
}

/// LinuxCNC with diameters.
fn g7() -> LanguageSettings {
    LanguageSettings { x_word: crate::XWord::Diameter, ..linuxcnc() }
}

/// The moves of a program as X (diameter) and Z: `r` for rapids, `f` for feeds, `a` for arcs, and threads as `t`; then its findings.
fn path(settings: &LanguageSettings, program: &str) -> String {
    let program = format!("{program}\nM30\n");
    let (operations, findings) = Interpreter::new(settings.clone()).with_tools(tools()).read_all(program.as_bytes());
    let mut at: Option<Position> = None;
    let mut lines = Vec::new();
    for operation in &operations {
        let (kind, start, end) = match &operation.kind {
            OperationKind::Move(step) => match (step.kind, step.arc) {
                (MoveKind::Rapid, _) => ("r", step.start, step.end),
                (MoveKind::Cutting, None) => ("f", step.start, step.end),
                (MoveKind::Cutting, Some(arc)) => {
                    let radius = |end: &Position| (end[2] - arc.center[0]).hypot(end[0] - arc.center[1]);
                    assert!((radius(&step.start) - radius(&step.end)).abs() < 1e-6, "{step:?}");
                    (if arc.clockwise { "a-" } else { "a+" }, step.start, step.end)
                }
            },
            OperationKind::Thread(step) => ("t", step.start, step.end),
            _ => continue,
        };
        if let Some(at) = at {
            assert_eq!(at, start, "the path is whole: {operation:?}");
        }
        at = Some(end);
        lines.push(format!("{kind} {} {}", number(end[0] * 2.0), number(end[2])));
    }
    lines.extend(findings.findings().iter().map(render_finding));
    lines.join("\n")
}

/// Compares the moves behind the first `skip` of a program.
#[track_caller]
fn moves(settings: &LanguageSettings, program: &str, skip: usize, expected: &str) {
    let found = path(settings, program);
    let found: Vec<_> = found.lines().skip(skip).collect();
    let expected: Vec<_> = expected.split([';', '\n']).map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(found, expected, "program:\n{program}");
}

/// The codes of the findings.
fn codes(settings: &LanguageSettings, program: &str) -> Vec<String> {
    let program = format!("{program}\nM30\n");
    let (_, findings) = Interpreter::new(settings.clone()).with_tools(tools()).read_all(program.as_bytes());
    findings.findings().iter().map(|finding| finding.code.name().to_owned()).collect()
}
