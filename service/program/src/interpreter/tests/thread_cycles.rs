//! Threading cycles `G92` and `G76`, pass by pass, against numbers computed by hand from the formulas of the manuals.

use proptest::prelude::*;

use super::*;
use crate::{DecimalPointRule, XWord};

/// Spindle on and the rapid to the start of a cycle.
const GO: &str = "M3 S500\nG0 X20. Z5.\n";

/// The operations behind [`GO`], then the findings.
fn after_go(settings: &LanguageSettings, program: &str) -> Vec<String> {
    let rendered = render(format!("{GO}{program}\nM30"), settings);
    let lines = rendered.lines().skip(2).filter(|line| *line != "end");
    lines.map(str::to_owned).collect()
}

/// The threading passes alone.
fn passes(program: &str, settings: LanguageSettings) -> Vec<ThreadMove> {
    let (operations, findings) = interpret(program.as_bytes(), settings);
    assert!(!findings.has_errors(), "{program}: {findings:?}");
    let threads = operations.into_iter().filter_map(|operation| match operation.kind {
        OperationKind::Thread(step) => Some(*step),
        _ => None,
    });
    threads.collect()
}

/// X at the end of each pass below `crest`, in millionths.
fn depths(crest: f64, passes: &[ThreadMove]) -> Vec<String> {
    passes.iter().map(|pass| number((crest - pass.end[0]).abs())).collect()
}

#[track_caller]
fn refused(program: &str, expected: &str) {
    let found = after_go(&lathe(), program);
    let expected: Vec<_> = expected.lines().map(str::trim).collect();
    assert_eq!(found, expected, "{program}");
}

#[test]
fn g92_repeats_with_a_new_x() {
    check(
        &lathe(),
        &format!("{GO}G92 X18. Z-20. F2.\nX17.4\nU-3. Z-15. Q180.\nG0 X30."),
        "spindle cw 500
         rapid 0 -> X10 Z5
         rapid X10 Z5 -> X9 Z5
         thread X9 Z5 -> X9 Z-20 @2
         rapid X9 Z-20 -> X10 Z-20
         rapid X10 Z-20 -> X10 Z5
         rapid X10 Z5 -> X8.7 Z5
         thread X8.7 Z5 -> X8.7 Z-20 @2
         rapid X8.7 Z-20 -> X10 Z-20
         rapid X10 Z-20 -> X10 Z5
         rapid X10 Z5 -> X8.5 Z5
         thread X8.5 Z5 -> X8.5 Z-15 @2 from 180
         rapid X8.5 Z-15 -> X10 Z-15
         rapid X10 Z-15 -> X10 Z5
         rapid X10 Z5 -> X15 Z5",
    );
}

#[test]
fn g92_taper_inside_and_clamp() {
    // R is start less end, on the radius: the thread gets thicker towards the chuck.
    check(
        &lathe(),
        &format!("{GO}G92 X18. Z-20. R-1. E8\nX17."),
        "spindle cw 500
         rapid 0 -> X10 Z5
         rapid X10 Z5 -> X8 Z5
         thread X8 Z5 -> X9 Z-20 @3.175
         rapid X9 Z-20 -> X10 Z-20
         rapid X10 Z-20 -> X10 Z5
         rapid X10 Z5 -> X7.5 Z5
         thread X7.5 Z5 -> X8.5 Z-20 @3.175
         rapid X8.5 Z-20 -> X10 Z-20
         rapid X10 Z-20 -> X10 Z5",
    );
    // A bore; the block before it is the speed clamp.
    check(
        &lathe(),
        &format!("{GO}G50 S2000\nG92 U2. W-25. F2."),
        "spindle cw 500
         rapid 0 -> X10 Z5
         rapid X10 Z5 -> X11 Z5
         thread X11 Z5 -> X11 Z-20 @2
         rapid X11 Z-20 -> X10 Z-20
         rapid X10 Z-20 -> X10 Z5",
    );
    // On a mill it sets coordinates.
    check(&mill(), "G92 S2000\nG92 X5\nG0 X7", "rapid X5 -> X7");
}

/// The example of the manuals: M68 × 6, thread height 3.68 mm, first depth 1.8 mm, allowance 0.2 mm.
#[test]
fn g76_in_two_lines() {
    let program = "M3 S500\nG0 X80. Z130.\nG76 P011060 Q100 R.2\nG76 X60.64 Z25. P3680 Q1800 F6.\nG0 X100.";
    // Depth d: X = 34 - d, Z = 130 + (3.68 - d)·tan 30°; d = 1.8, 1.8·√2, 1.8·√3, 3.48 (1.8·√4 = 3.6 is beyond), 3.68.
    check(
        &lathe(),
        program,
        "spindle cw 500
         rapid 0 -> X40 Z130
         rapid X40 Z130 -> X32.2 Z131.085419
         thread X32.2 Z131.085419 -> X32.2 Z25 @6 out over 6 by 6 tool 60
         rapid X38.2 Z25 -> X40 Z25
         rapid X40 Z25 -> X40 Z130
         rapid X40 Z130 -> X31.454416 Z130.654955
         thread X31.454416 Z130.654955 -> X31.454416 Z25 @6 out over 6 by 6 tool 60
         rapid X37.454416 Z25 -> X40 Z25
         rapid X40 Z25 -> X40 Z130
         rapid X40 Z130 -> X30.882309 Z130.324649
         thread X30.882309 Z130.324649 -> X30.882309 Z25 @6 out over 6 by 6 tool 60
         rapid X36.882309 Z25 -> X40 Z25
         rapid X40 Z25 -> X40 Z130
         rapid X40 Z130 -> X30.52 Z130.11547
         thread X30.52 Z130.11547 -> X30.52 Z25 @6 out over 6 by 6 tool 60
         rapid X36.52 Z25 -> X40 Z25
         rapid X40 Z25 -> X40 Z130
         rapid X40 Z130 -> X30.32 Z130
         thread X30.32 Z130 -> X30.32 Z25 @6 amplitude 0 out over 6 by 6 tool 60
         rapid X36.32 Z25 -> X40 Z25
         rapid X40 Z25 -> X40 Z130
         rapid X40 Z130 -> X50 Z130
         i 4:1+31 PRG-THREAD-FLANK",
    );
    // The same in least increments, and the same in inches to their resolution.
    let settings = LanguageSettings { decimal_point: DecimalPointRule::LeastIncrement, ..lathe() };
    let increments = "M3 S500\nG0 X80000 Z130000\nG76 P011060 Q100 R200\nG76 X60640 Z25000 P3680 Q1800 F6.";
    assert_eq!(passes(increments, settings), passes(program, lathe()));
    let inches = "G20 M3 S500\nG0 X4. Z4.\nG76 P011060 Q50 R.01\nG76 X3. Z1. P1500 Q.08 F.25";
    let inches = passes(inches, lathe());
    assert_eq!(depths(1.65 * 25.4, &inches), ["2.032", "2.873682", "3.519527", "3.556", "3.81"]);
    assert!(inches.iter().all(|pass| (pass.lead_mm - 6.35).abs() < 1e-12));
}

#[test]
fn g76_keeps_the_least_infeed_and_counts_its_finishing_passes() {
    let program = "M3 S500\nG0 X22. Z5.\nG76 P030000 Q200 R0\nG76 X18. Z-20. P1000 Q500 F2.";
    let found = passes(program, lathe());
    // 0.5·√2 = 0.707107; 0.5·√3 = 0.866025 is less than 0.2 deeper; 0.5·√4 = 1.
    assert_eq!(depths(10.0, &found), ["0.5", "0.707107", "0.907107", "1", "1", "1", "1"]);
    let still = found.iter().map(|pass| pass.amplitude_mm == Some(0.0));
    assert_eq!(still.collect::<Vec<_>>(), [false, false, false, false, true, true, true]);
    // A tool angle of 0 is infeed straight in, and says nothing about the tool.
    assert!(found.iter().all(|pass| pass.start[2] == 5.0 && pass.included_angle_deg.is_none()));
    assert!(found.iter().all(|pass| pass.pull_out.is_none()));
    // What the first line does not say stays as it was.
    let program = "M3 S500\nG0 X22. Z5.\nG76 P010055 Q300\nG76 R.1\nG76 X18. Z-20. P1000 Q500 F2.";
    assert_eq!(depths(10.0, &passes(program, lathe())), ["0.5", "0.8", "0.9", "1"]);
}

#[test]
fn g76_on_tapers_and_in_bores() {
    // Taper: the start of a shifted pass lies on the same cone. tan 40° = 0.8391; shift 0.5·0.8391 of 25 mm.
    let found = passes("M3 S500\nG0 X24. Z5.\nG76 P010080 Q0 R0\nG76 X18. Z-20. R-1. P1000 Q500 F2.", lathe());
    assert_eq!(depths(10.0, &found), ["0.5", "0.707107", "0.866025", "1", "1"]);
    assert_eq!(number(found[0].start[2]), "5.41955");
    assert_eq!(number(found[0].start[0]), number(9.5 - 1.0 - 0.419_549_816 / 25.0));
    assert_eq!((number(found[4].start[0]), number(found[4].start[2])), ("8".to_owned(), "5".to_owned()));
    let found = passes("M3 S500\nG0 X17. Z5.\nG76 P011060 Q0 R0\nG76 X20. Z-20. P1000 Q600 F2.", lathe());
    assert_eq!(depths(9.0, &found), ["0.6", "0.848528", "1", "1"]);
    // Out to the axis, and no further than the return path: 8.5 is 1.1 from 9.6.
    let retreats: Vec<_> = found.iter().map(|pass| number(pass.pull_out.unwrap().retreat_mm)).collect();
    assert_eq!(retreats, ["-1.1", "-1.348528", "-1.5", "-1.5"]);
}

#[test]
fn g76_in_one_line_has_four_patterns() {
    let pattern = |word: &str| {
        let program = format!("M3 S500\nG0 X22. Z5.\nG76 X18. Z-20. I0 K1. D400 F2. A60 {word}");
        passes(&program, lathe())
    };
    let area = ["0.4", "0.565685", "0.69282", "0.8", "0.894427", "0.979796", "1", "1"];
    for word in ["", "P1", "P2"] {
        assert_eq!(depths(10.0, &pattern(word)), area, "{word}");
    }
    for word in ["P3", "P4"] {
        assert_eq!(depths(10.0, &pattern(word)), ["0.4", "0.8", "1", "1"], "{word}");
    }
    // Along the flank: 5 + (1 - d)·tan 30°. On both: every other pass at 5 - (1 - d)·tan 30°.
    let starts = |word| pattern(word).iter().map(|pass| number(pass.start[2])).collect::<Vec<_>>();
    assert_eq!(starts("P3"), ["5.34641", "5.11547", "5", "5"]);
    assert_eq!(starts("P4"), ["5.34641", "4.88453", "5", "5"]);
    assert_eq!(pattern("P1 Q90.")[0].start_angle_deg, 90.0);
    // The words of a first line are in force here too.
    let program = "M3 S500\nG0 X22. Z5.\nG76 P020560 R.1\nG76 X18. Z-20. K1. D.5 F2. A60 P3";
    let found = passes(program, lathe());
    assert_eq!(depths(10.0, &found), ["0.5", "0.9", "1", "1"]);
    assert_eq!(found[0].pull_out.map(|pull_out| pull_out.travel_mm), Some(1.0));
}

#[test]
fn g76_of_linuxcnc() {
    let radius = LanguageSettings { x_word: XWord::Radius, ..lathe() };
    // Crest at 20 - 1; depths 0.3, 0.6, 0.9 and a spring pass; tan 30° = 0.577350 moves each by 0.173205 more. Every pass is left by
    // I + K = 1.9.
    check(
        &radius,
        &format!("{GO}G76 P1.5 Z-20. I-1. J.3 K.9 H1 Q30.\nG0 Z5."),
        "spindle cw 500
         rapid 0 -> X20 Z5
         rapid X20 Z5 -> X20.6 Z4.826795
         rapid X20.6 Z4.826795 -> X18.7 Z4.826795
         thread X18.7 Z4.826795 -> X18.7 Z-19.65359 @1.5
         rapid X18.7 Z-19.65359 -> X20.6 Z-19.65359
         rapid X20.6 Z-19.65359 -> X20.3 Z4.65359
         rapid X20.3 Z4.65359 -> X18.4 Z4.65359
         thread X18.4 Z4.65359 -> X18.4 Z-19.826795 @1.5
         rapid X18.4 Z-19.826795 -> X20.3 Z-19.826795
         rapid X20.3 Z-19.826795 -> X20 Z4.480385
         rapid X20 Z4.480385 -> X18.1 Z4.480385
         thread X18.1 Z4.480385 -> X18.1 Z-20 @1.5
         rapid X18.1 Z-20 -> X20 Z-20
         rapid X20 Z-20 -> X20 Z4.480385
         rapid X20 Z4.480385 -> X18.1 Z4.480385
         thread X18.1 Z4.480385 -> X18.1 Z-20 @1.5 amplitude 0
         rapid X18.1 Z-20 -> X20 Z-20
         rapid X20 Z-20 -> X20 Z5",
    );
    // Degression: J·n^(1/R).
    let law = |word: &str| depths(19.0, &passes(&format!("{GO}G76 P1.5 Z-20. I-1. J.4 K.8 {word}"), radius.clone()));
    assert_eq!(law("R2"), ["0.4", "0.565685", "0.69282", "0.8"]);
    assert_eq!(law("R1.5"), ["0.4", "0.63496", "0.8"]);
    // With diameters in X, so are I, J and K; inside, towards +Z, in inches.
    let bore = passes("G20 M3 S500\nG0 X1. Z0\nG76 P.1 Z1. I.2 J.02 K.04", lathe());
    assert_eq!(depths(0.6 * 25.4, &bore), ["0.254", "0.508"]);
    assert_eq!((bore[0].end[2], bore[0].lead_mm), (25.4, 2.54));
}

#[test]
fn g76_of_linuxcnc_tapers_its_ends() {
    let radius = LanguageSettings { x_word: XWord::Radius, ..lathe() };
    check(
        &radius,
        &format!("{GO}G76 P2. Z-20. I-1. J.4 K.8 E1.6 L3"),
        "spindle cw 500
         rapid 0 -> X20 Z5
         rapid X20 Z5 -> X20.4 Z5
         rapid X20.4 Z5 -> X19.4 Z5
         thread X19.4 Z5 -> X18.6 Z3.4 @2
         thread X18.6 Z3.4 -> X18.6 Z-20 @2 out over 1.6 by 0.8
         rapid X19.4 Z-20 -> X20.4 Z-20
         rapid X20.4 Z-20 -> X20 Z5
         rapid X20 Z5 -> X19 Z5
         thread X19 Z5 -> X18.2 Z3.4 @2
         thread X18.2 Z3.4 -> X18.2 Z-20 @2 out over 1.6 by 0.8
         rapid X19 Z-20 -> X20 Z-20",
    );
    // Steeper than 45° X travels further: 0.8 over 0.4 doubles the lead, so that the pitch along Z stays.
    let found = passes(&format!("{GO}G76 P2. Z-20. I-1. J.4 K.8 E.4 L1"), radius.clone());
    assert_eq!(found.iter().map(|pass| pass.lead_mm).collect::<Vec<_>>(), [4.0, 2.0, 4.0, 2.0]);
    assert_eq!(passes(&format!("{GO}G76 P2. Z-20. I-1. J.4 K.8 E.4"), radius).len(), 2, "no end is named");
}

#[test]
fn cycles_end_where_the_control_stands() {
    for (program, end) in [
        ("G92 X18. Z-20. F2.", [10.0, 5.0]),
        ("G76 P021060 Q50 R.05\nG76 X18. Z-20. P900 Q200 F2.", [10.0, 5.0]),
        ("G76 X18. Z-20. K.9 D200 F2. A60 P2", [10.0, 5.0]),
        ("G76 P2. Z-20. I-1. J.3 K1. Q29. E.5 L3 H2", [10.0, -20.0]),
    ] {
        let mut interpreter = Interpreter::new(lathe());
        let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
        let program = format!("{GO}{program}\n");
        let mut rest = program.as_bytes();
        while let LineOutcome::Consumed(length) = interpreter.read_line(rest, false, &mut operations, &mut findings) {
            rest = &rest[length..];
        }
        assert!(!findings.has_errors(), "{findings:?}");
        let position = interpreter.state().position();
        assert_eq!([position[0], position[2]], end, "{program}");
    }
}

#[test]
fn words_of_g92_that_are_refused() {
    refused("G92 X18. F2.", "! 3:1+12 PRG-THREAD-CYCLE-WORD");
    refused("G92 X18. F2.\nX17.\nX16.", "! 3:1+12 PRG-THREAD-CYCLE-WORD");
    refused("G92 X18. Z-20.", "! 3:1+3 PRG-CODE-AMBIGUOUS");
    refused("G92 X18. Z-20. R0", "! 3:1+17 PRG-THREAD-LEAD-MISSING");
    refused("G92 X18. Z5. F2.", "! 3:1+16 PRG-THREAD-TRAVEL");
    refused("G92 X20. Z-5. F2.", "! 3:1+17 PRG-THREAD-CYCLE-START");
    refused("G92 X18. Z-5. R2. F2.", "! 3:1+21 PRG-THREAD-CYCLE-START");
    refused("G92 X18. Z-5. F2. S100", "! 3:19+4 PRG-WORD-CONFLICT");
    refused("G0 G92 X18. Z-5. F2.", "! 3:1+2 PRG-GROUP-CONFLICT");
    refused("G92 X18. Z-5. F2. Q400.", "! 3:19+5 PRG-THREAD-ANGLE");
    refused("G92 X18. Z-5. C5. F2.", "! 3:15+3 PRG-THREAD-AXIS");
    refused("G92 X18. Z-5. R2000. F2.", "! 3:15+6 PRG-THREAD-CYCLE-VALUE");
    // The taper, as older controls write it.
    refused("G92 X18. Z-5. I2. F2.", "! 3:1+21 PRG-THREAD-CYCLE-START");
    refused("G92 X18. Z-5. R-1. I2. F2.", "! 3:20+3 PRG-WORD-UNUSED");
    // A chamfer longer than the thread, set by the P of a G76.
    refused("G76 P019960\nG92 X18. Z0 F2.", "! 4:1+15 PRG-THREAD-TRAVEL");
    refused("G76 P010160\nG92 X16. Z0 R-5.5 F2.", "! 4:1+21 PRG-THREAD-TRAVEL");
}

#[test]
fn words_of_g76_that_are_refused() {
    let first = "G76 P011060 Q50 R.05\n";
    let second = |words: &str, expected: &str| refused(&format!("{first}G76 {words}"), expected);
    refused("G76 X18. Z-5. P900 Q200 F2.", "! 3:1+27 PRG-THREAD-CYCLE-WORD");
    refused("G76 Q50", "! 3:1+7 PRG-THREAD-CYCLE-WORD");
    refused("G76", "! 3:1+3 PRG-THREAD-CYCLE-WORD");
    refused("G76 P001060", "! 3:5+7 PRG-THREAD-CYCLE-VALUE");
    refused("G76 P011045", "! 3:5+7 PRG-THREAD-CYCLE-VALUE");
    refused("G76 P11.5", "! 3:5+5 PRG-NUMBER-NOT-WHOLE");
    refused("G76 P011060 Q-50", "! 3:13+4 PRG-THREAD-CYCLE-VALUE");
    refused("G76 P011060 R-.5", "! 3:13+4 PRG-THREAD-CYCLE-VALUE");
    second("X18. Z-5. Q200 F2.", "! 4:1+22 PRG-THREAD-CYCLE-WORD");
    second("X18. P900 Q200 F2.", "! 4:1+22 PRG-THREAD-CYCLE-WORD");
    second("X18. Z-5. P900 Q0 F2.", "! 4:20+2 PRG-THREAD-CYCLE-VALUE");
    second("X18. Z-5. P-900 Q200 F2.", "! 4:15+5 PRG-THREAD-CYCLE-VALUE");
    second("X18. Z-5. P900 Q200", "! 4:1+23 PRG-THREAD-LEAD-MISSING");
    second("X18. Z-5. P40 Q20 F2.", "! 4:1+25 PRG-THREAD-CYCLE-VALUE");
    second("X18. Z-20. P2000 Q200 F2.", "! 4:1+29 PRG-THREAD-CYCLE-START");
    second("X18. Z4.5 P900 Q200 F2.", "! 4:1+27 PRG-THREAD-TRAVEL");
    second("X18. Z-5. P900 Q200 F2. H1", "! 4:1+30 PRG-THREAD-CYCLE-FORM");
    // Of several forms, or of none.
    for words in ["X18. Z-5. K.9 F2.", "P2. Z-5. I-1. K.9", "X18. Z-5. J.1 K.9 F2.", "X18. Z-5. K.9 D200 R.1 F2."] {
        let length = words.len() + 4;
        refused(&format!("G76 {words}"), &format!("! 3:1+{length} PRG-THREAD-CYCLE-FORM"));
    }
    refused("G9 G76 X18. Z-5. K.9 D200 F2.", "! 3:1+2 PRG-GROUP-CONFLICT");
    refused("G76 X18. Z-5. K.9 D200 F2. P5", "! 3:28+2 PRG-THREAD-CYCLE-VALUE");
    refused("G76 X18. Z-5. K.9 D200 F2. A130", "! 3:28+4 PRG-THREAD-CYCLE-VALUE");
    refused(
        "G76 Z-5. J.1",
        "! 3:1+12 PRG-THREAD-CYCLE-WORD\n! 3:1+12 PRG-THREAD-CYCLE-WORD\n! 3:1+12 PRG-THREAD-CYCLE-WORD",
    );
    let drive_line = |words: &str, expected: &str| refused(&format!("G76 P2. Z-5. {words}"), expected);
    drive_line("I0 J.1 K.9", "! 3:14+2 PRG-THREAD-CYCLE-VALUE");
    drive_line("I-1. J-.1 K.9", "! 3:19+4 PRG-THREAD-CYCLE-VALUE");
    drive_line("I-1. J.1 K.9 R.5", "! 3:27+3 PRG-THREAD-CYCLE-VALUE");
    drive_line("I-1. J.1 K.9 Q81.", "! 3:27+4 PRG-THREAD-CYCLE-VALUE");
    drive_line("I-1. J.1 K.9 H1.5", "! 3:27+4 PRG-NUMBER-NOT-WHOLE");
    drive_line("I-1. J.1 K.9 L4", "! 3:27+2 PRG-THREAD-CYCLE-VALUE");
    drive_line("I-1. J.1 K.9 E5.5 L1", "! 3:1+33 PRG-THREAD-CYCLE-VALUE");
    refused("G76 P0 Z-5. I-1. J.1 K.9", "! 3:5+2 PRG-THREAD-LEAD");
    refused("G76 P2. Z5. I-1. J.1 K.9", "! 3:1+24 PRG-THREAD-TRAVEL");
    refused("G76 P2. Z-5. I-1. J.9 K.9", "! 3:23+3 PRG-THREAD-CYCLE-VALUE");
    refused("G17 G76 P2. Z-5. I-1. J.1 K.9", "! 3:1+29 PRG-THREAD-CYCLE-FORM");
}

#[test]
fn cycles_of_too_many_passes_are_refused_with_a_depth_that_does() {
    let program = |first: f64| format!("{GO}G76 P010060 Q0 R0\nG76 X18. Z-20. P.9 Q{first} F2.\nM30");
    let (_, findings) = interpret(program(0.05).as_bytes(), lathe());
    let finding = &findings.findings()[0];
    assert_eq!(finding.code, "PRG-THREAD-CYCLE-PASSES");
    // 0.9 / √99 = 0.0905
    let value = finding.suggestions[0].value.as_ref().unwrap().value;
    assert_eq!(value, 0.091);
    assert_eq!(passes(&program(value), lathe()).len(), 99);
    refused("G76 P2. Z-20. I-1. J.001 K.9 R100", "! 3:1+33 PRG-THREAD-CYCLE-PASSES");
    refused("G76 P990060\nG76 X18. Z-20. P900 Q100 F2.", "! 4:1+28 PRG-THREAD-CYCLE-PASSES");
}

#[test]
fn spindles_and_modes_of_cycles() {
    refused("M5\nG76 X18. Z-5. K.9 D200 F2. P1\nG92 X18. Z-5. F2.", "spindle off 500\n! 4:1+29 PRG-SPINDLE-STOPPED");
    refused(
        "G50 S900\nG96 S100\nG92 X18. Z-5. F2.\nX17.",
        "spindle cw 100 m/min max 900\n! 5:1+17 PRG-THREAD-SURFACE-SPEED",
    );
    // The motion before a G76 goes on behind it; the lead stays for the next thread and is no feed.
    let found = after_go(&lathe(), "G76 X18. Z-5. K.9 D.9 F2. P1\nX30.\nG92 X18. Z-5.\nG1 X17.");
    assert_eq!(found[found.len() - 1], "! 6:1+7 PRG-FEED-MISSING");
    assert!(found.contains(&"rapid X10 Z5 -> X15 Z5".to_owned()), "{found:?}");
    assert!(found.contains(&"thread X9 Z5 -> X9 Z-5 @2".to_owned()), "{found:?}");
}

/// Rapids and passes of a cycle meet, and a pass is never deeper than the one after it or than the root.
fn assert_feeds_in(operations: &[Operation], root: f64, outwards: f64) {
    let mut at: Option<Position> = None;
    let mut last = f64::INFINITY;
    for operation in operations {
        let (start, end) = match &operation.kind {
            OperationKind::Move(step) => (step.start, step.end),
            OperationKind::Thread(step) => {
                let above = outwards * (step.end[0] - root);
                assert!(above >= -1e-9 && above <= last + 1e-9, "{above} after {last}: {step:?}");
                last = above;
                let mut end = step.end;
                end[0] += step.pull_out.map_or(0.0, |pull_out| pull_out.retreat_mm);
                (step.start, end)
            }
            _ => continue,
        };
        assert!(at.is_none_or(|at| at == start), "{operation:?} starts elsewhere than {at:?}");
        at = Some(end);
    }
    assert!(last.abs() < 1e-9, "the last pass reaches the root: {last}");
}

proptest! {
    #[test]
    fn passes_of_fanuc_feed_in_to_the_root(
        (height, share, least, allowance) in (0.1..3.0_f64, 0.11..1.5_f64, 0.0..0.2_f64, 0.0..0.09_f64),
        (finishing, chamfer, angle) in (1..9_u32, 0..30_u32, prop::sample::select(vec![80, 60, 55, 30, 29, 0])),
        (pattern, taper, bore) in (0..5_u32, -0.4..0.4_f64, any::<bool>()),
    ) {
        // A first depth of a tenth of the height takes the 100 passes that a cycle may have.
        // The diameter at the root, and a start clear of crest and taper.
        let outwards = if bore { -1.0 } else { 1.0 };
        let root = 20.0;
        let start = 2.0 * (root + outwards * (height + 0.5));
        let first = height * share;
        let body = match pattern {
            0 => format!("R{taper:.4} P{height:.4} Q{first:.4}"),
            _ => format!("I{taper:.4} K{height:.4} D{first:.4} A{angle} P{pattern}"),
        };
        let program = format!(
            "M3 S500\nG0 X{start:.4} Z10.\nG76 P{finishing:02}{chamfer:02}{angle:02} Q{least:.4} R{allowance:.4}\n\
             G76 X40. Z-30. {body} F1.5\nM30"
        );
        let (operations, findings) = interpret(program.as_bytes(), lathe());
        prop_assert!(!findings.has_errors(), "{program}: {findings:?}");
        assert_feeds_in(&operations, root, outwards);
        let threads = operations.iter().filter_map(|operation| match &operation.kind {
            OperationKind::Thread(step) => Some(step.amplitude_mm == Some(0.0)),
            _ => None,
        });
        let still = threads.collect::<Vec<_>>();
        prop_assert!(still.len() <= 100);
        prop_assert_eq!(still.iter().filter(|still| **still).count(), finishing as usize);
    }

    #[test]
    fn passes_of_linuxcnc_feed_in_to_the_root(
        (height, share, degression, slide) in (0.1..3.0_f64, 0.1..0.99_f64, 1.0..2.0_f64, -30.0..30.0_f64),
        (springs, ends, taper, bore) in (0..9_u32, 0..4_u32, 0.1..5.0_f64, any::<bool>()),
    ) {
        let radius = LanguageSettings { x_word: XWord::Radius, ..lathe() };
        let inwards = if bore { 1.0 } else { -1.0 };
        let first = height * share;
        let program = format!(
            "M3 S500\nG0 X20. Z10.\nG76 P1.5 Z-30. I{:.4} J{first:.4} K{height:.4} R{degression:.4} Q{slide:.4} \
             H{springs} E{taper:.4} L{ends}\nM30",
            inwards * 0.5
        );
        let (operations, findings) = interpret(program.as_bytes(), radius);
        prop_assert!(!findings.has_errors(), "{program}: {findings:?}");
        // To the four decimals written.
        let written: f64 = format!("{height:.4}").parse().unwrap();
        assert_feeds_in(&operations, 20.0 + inwards * (0.5 + written), -inwards);
        let last = operations.iter().rev().find_map(|operation| match &operation.kind {
            OperationKind::Move(step) => Some(step.end),
            _ => None,
        });
        prop_assert_eq!(last.map(|end| [end[0], end[2]]), Some([20.0, -30.0]));
    }
}

#[test]
fn the_taper_of_a_threading_cycle_may_be_written_i() {
    let [older, newer] = ["I-1.", "R-1."].map(|taper| {
        let program = format!("{GO}G92 X18. Z-20. {taper} F2.\nX17.\nM30");
        render(&program, &lathe())
    });
    assert_eq!(older, newer);
    assert!(older.contains("thread"), "{older}");
}

#[test]
fn a_bad_first_line_is_one_finding() {
    for (first, expected) in [
        ("G76 P010045 Q100 R0.05", "! 3:5+7 PRG-THREAD-CYCLE-VALUE"),
        ("G76 P0.5 Q100 R0.05", "! 3:5+4 PRG-NUMBER-NOT-WHOLE"),
        ("G76 P010060 Q-100 R0.05", "! 3:13+5 PRG-THREAD-CYCLE-VALUE"),
    ] {
        refused(&format!("{first}\nG76 X17.4 Z-30. P1299 Q400 F2."), expected);
    }
}
