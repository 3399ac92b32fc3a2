//! Runs of straight moves against the same blocks one by one: a comment in a block ends the run, and means nothing.

use proptest::prelude::*;

use crate::{FindingLog, Interpreter, InterpreterState, LanguageSettings, LineOutcome, Operation, Place};

/// Operations, findings, and what is remembered at the end but for places in the text.
fn read(text: &str, settings: &LanguageSettings) -> (Vec<Operation>, FindingLog, InterpreterState) {
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    let mut interpreter = Interpreter::new(settings.clone());
    loop {
        let rest = &text.as_bytes()[text.len().min(interpreter.place().offset as usize)..];
        match interpreter.read_line(rest, true, &mut operations, &mut findings) {
            LineOutcome::Consumed(_) | LineOutcome::Elsewhere => {}
            LineOutcome::NeedMore | LineOutcome::Ended => break,
        }
    }
    let state =
        InterpreterState { place: Place::default(), last_line_bytes: 0, blank_lines: 0, ..interpreter.state().clone() };
    (operations, findings, state)
}

fn block() -> impl Strategy<Value = String> {
    let value = || (-40_000_i32..40_000).prop_map(|thousandths| f64::from(thousandths / 250) / 4.0);
    let word = |letters: &'static str| {
        let letters: Vec<_> = letters.chars().collect();
        (prop::sample::select(letters), value()).prop_map(|(letter, value)| format!(" {letter}{value:?}"))
    };
    let code = prop::sample::select(vec!["", "", "", "G0", "G1", "G1", "N7", "N8 G01"]);
    let axes = prop::collection::vec(word("XXYZZUWF"), 0..4);
    let straight = (code, axes).prop_map(|(code, axes)| format!("{code}{}", axes.concat()));
    let others = prop::sample::select(vec![
        "G2 X10. Z4. R20.",
        "G3 X5. Y5. R30.",
        "G90",
        "G91",
        "G94 F200.",
        "G95 F.2",
        "G93",
        "M3 S500",
        "M5",
        "G20",
        "G21",
        "G54",
        "G55",
        "G41 D1",
        "G40",
        "G18",
        "G17",
        "G64 P0.01",
        "G61",
        "G4 P1.",
        "G81 Z-3. R1. F50.",
        "G80",
        "S900",
        "T0202",
        "F-1.",
        "F0",
        "X1 X2",
        "X Y",
        "G68 X0 Y0 R30.",
        "G69",
        "G16",
        "G15",
        "G5.1 Q1",
        "G200 F50 A0.03",
        "G201",
        "G92 X0",
        "G52 X5.",
        "X1.2.3",
        "A5.",
        "G0 C30.",
        "G1 X5. ,R2.",
        "#1=5",
        "X#1",
        "G32 Z-5. F1.5",
        "G1 Z-9. R2.",
        "P5",
        "G28 U0",
    ]);
    prop_oneof![4 => straight, 1 => others.prop_map(str::to_owned)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1_000))]

    #[test]
    fn a_run_is_its_blocks_one_by_one(blocks in prop::collection::vec(block(), 1..40), dialect in 0_usize..4) {
        let settings = match dialect {
            0 => LanguageSettings::default(),
            1 => LanguageSettings::mill(),
            2 => LanguageSettings::linuxcnc(),
            _ => LanguageSettings { plain_drawing_words: true, ..LanguageSettings::default() },
        };
        let text = |behind: &str| {
            let lines = blocks.iter().map(|block| format!("{block}{behind}\n"));
            lines.chain(["M30\n".to_owned()]).collect::<String>()
        };
        let (run, run_findings, run_state) = read(&text(""), &settings);
        let (single, single_findings, mut single_state) = read(&text(" (-)"), &settings);
        // Lengths of lines, and whether there are comments, are what the texts differ in.
        single_state.evidence = run_state.evidence.clone();
        single_state.first_line = run_state.first_line;
        prop_assert_eq!(run, single);
        prop_assert_eq!(run_findings.findings(), single_findings.findings());
        prop_assert_eq!(run_state, single_state);
    }
}
