//! A snapshot within a cycle goes on as if nothing had been.

use super::*;

/// Reads a program, and goes on from a snapshot behind every call: the same operations and findings follow.
#[track_caller]
fn resumes(settings: &LanguageSettings, program: &str) {
    resumes_with(&[], settings, program);
}

#[track_caller]
fn resumes_with(tools: &[ToolOffset], settings: &LanguageSettings, program: &str) {
    let program = format!("{program}\nM30\n");
    let source = program.as_bytes();
    let rest = |interpreter: &Interpreter| &source[source.len().min(interpreter.place().offset as usize)..];
    let (whole, log) = Interpreter::new(settings.clone()).with_tools(tools.to_vec()).read_all(source);
    assert!(!log.has_errors(), "{log:?}");
    let mut interpreter = Interpreter::new(settings.clone()).with_tools(tools.to_vec());
    let mut done = Vec::new();
    let mut findings = FindingLog::default();
    let mut calls = 0;
    loop {
        let bytes = rest(&interpreter);
        let outcome = interpreter.read_line(bytes, true, &mut done, &mut findings);
        if outcome == LineOutcome::Ended {
            break;
        }
        calls += 1;
        let bytes = postcard::to_allocvec(interpreter.state()).expect("a state is serialisable");
        assert!(bytes.len() < 20_000, "{} bytes", bytes.len());
        let state = postcard::from_bytes(&bytes).expect("and comes back");
        let mut resumed = Interpreter::restore(settings.clone(), state).with_tools(tools.to_vec());
        let mut after = Vec::new();
        while resumed.read_line(rest(&resumed).to_vec().as_slice(), true, &mut after, &mut FindingLog::default())
            != LineOutcome::Ended
        {}
        assert_eq!([done.as_slice(), after.as_slice()].concat(), whole, "after {calls} calls");
    }
    assert_eq!(done, whole);
}

const CONTOUR: &str = "N10 G0 X20.\nG1 Z-10. F0.1\nX30. Z-15.\nG2 X40. Z-20. R5.\nG1 Z-30.\nN20 X50.";

#[test]
fn within_roughing_and_finishing() {
    let program =
        format!("M3 S1000\nG0 X50. Z2.\nG71 U0.2 R1.\nG71 P10 Q20 U0.8 W0.2 F0.2\n{CONTOUR}\nG70 P10 Q20\nG0 X60.");
    resumes(&a(), &program);
}

#[test]
fn under_compensation_of_the_nose() {
    let nose = ToolOffset { tip: 3, ..ToolOffset::new(1).with_radius(0.4) };
    let program = format!(
        "T0101 M3 S1000\nG0 X52. Z3.\nG42 X50. Z2.\nG71 U0.2 R1.\nG71 P10 Q20 U0.8 W0.2 F0.2\n{CONTOUR}\nG70 P10 Q20\nG0 Z9.\nG40 X60."
    );
    resumes_with(&[nose], &a(), &program);
}

#[test]
fn within_a_pattern_and_single_cycles() {
    let program = format!(
        "M3 S1000\nG0 X50. Z2.\nG73 U4. W1. R20\nG73 P10 Q20 U0.8 W0.2 F0.2\n{CONTOUR}\nG90 X45. Z-20.\nX40.\nG0 X60.\nG75 R1.\nG75 X40. P2000"
    );
    resumes(&a(), &program);
}

#[test]
fn within_the_cycles_of_linuxcnc() {
    let program = "o100 sub\nG0 X10\nG1 Z-10\nX15 Z-15\nX12 Z-18\nX16 Z-25\no100 endsub\nG18 F100 M3 S100\nG0 X25 Z2\nG71 Q100 I0.2 R1 D0.5\nG0 X25 Z2\nG70 Q100\nG0 X30";
    resumes(&linuxcnc(), program);
}
