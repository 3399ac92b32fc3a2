//! `G32`, `G33` and `G165`.

use super::*;
use crate::{DecimalPointRule, FunctionSwitch, ThreadEWord, XWord};

/// The first message that contains `text`.
fn finding_with(settings: LanguageSettings, program: &str, text: &str) -> Finding {
    let (_, findings) = interpret(program.as_bytes(), settings);
    let found = findings.findings().iter().find(|finding| finding.message.contains(text));
    found.unwrap_or_else(|| panic!("{text:?} is not in {findings:?}")).clone()
}

#[test]
fn program_a_of_the_thread_vibration_page() {
    check(
        &lathe(),
        include_str!("../../../../../tests/fixtures/thread-a.nc"),
        "tool 7.7
         spindle cw 300
         coolant mist false flood true
         rapid 0 -> X7 Z100
         ThreadVibration on X5 Q1.2
         rapid X7 Z100 -> X4 Z100
         thread X4 Z100 -> X4 Z60 @2.5
         rapid X4 Z60 -> X7 Z60
         rapid X7 Z60 -> X7 Z100
         rapid X7 Z100 -> X3.586 Z100
         thread X3.586 Z100 -> X3.586 Z60 @2.5 from 325.584
         rapid X3.586 Z60 -> X7 Z60
         rapid X7 Z60 -> X7 Z100
         rapid X7 Z100 -> X3.268 Z100
         thread X3.268 Z100 -> X3.268 Z60 @2.5 from 299.088
         rapid X3.268 Z60 -> X7 Z60
         rapid X7 Z60 -> X7 Z100
         rapid X7 Z100 -> X3.25 Z100
         thread X3.25 Z100 -> X3.25 Z60 @2.5 from 297.648 amplitude 0
         rapid X3.25 Z60 -> X7 Z60
         rapid X7 Z60 -> X7 Z100
         ThreadVibration off
         coolant mist false flood false
         spindle off 300
         end",
    );
}

#[test]
fn program_b_of_the_thread_vibration_page() {
    let (operations, findings) =
        interpret(include_bytes!("../../../../../tests/fixtures/thread-b.nc"), LanguageSettings::default());
    assert!(findings.findings().is_empty(), "{findings:?}");
    let threads = operations.iter().filter(|operation| matches!(operation.kind, OperationKind::Thread(_)));
    let threads: Vec<_> = threads.map(render_operation).collect();
    let way = "thread X3.5 Z100 -> X3.5 Z60 @2.5";
    let words = ["", " amplitude 1.8 shift 120", " amplitude 1.8 shift 240", " amplitude 0"];
    assert_eq!(threads, words.map(|words| format!("{way}{words}")));
}

#[test]
fn diameters_radii_increments_and_inches() {
    let go = "M3 S100 G0 X20. Z5.\n";
    check(
        &lathe(),
        &format!("{go}G32 W-10. F1.5 A.4\nU2. W-1.\nW-2."),
        "spindle cw 100
         rapid 0 -> X10 Z5
         thread X10 Z5 -> X10 Z-5 @1.5 amplitude 0.2
         thread X10 Z-5 -> X11 Z-6 @1.5
         thread X11 Z-6 -> X11 Z-8 @1.5",
    );
    let radius = LanguageSettings { x_word: XWord::Radius, ..lathe() };
    check(
        &radius,
        &format!("{go}G32 X22. Z-5. F1.5 A.4"),
        "spindle cw 100\nrapid 0 -> X20 Z5\nthread X20 Z5 -> X22 Z-5 @1.5 amplitude 0.4",
    );
    // Leads and amplitudes are inches, angles are degrees.
    check(
        &lathe(),
        "G20\nM3 S100 G32 Z-1. F.1 A.1 R90. Q45.",
        "spindle cw 100\nthread 0 -> Z-25.4 @2.54 from 45 amplitude 1.27 shift 90",
    );
    check(&lathe(), "G20 M3 S100\nG165 P3 X1. Q1.5", "spindle cw 100\nThreadVibration on X12.7 Q1.5");
}

#[test]
fn an_amplitude_is_a_travel_of_the_axis_across_the_lead() {
    check(
        &lathe(),
        "M3 S100 G0 X20. Z5.\nG165 P3 Z-.5 Q1.5\nG32 X40. F1.5 A.4\nG165 P0",
        "spindle cw 100
         rapid 0 -> X10 Z5
         ThreadVibration on Z-0.5 Q1.5
         thread X10 Z5 -> X20 Z5 @1.5 amplitude 0.4
         ThreadVibration off",
    );
}

#[test]
fn numbers_without_a_decimal_point() {
    let settings = LanguageSettings { decimal_point: DecimalPointRule::LeastIncrement, ..lathe() };
    check(
        &settings,
        "M3 S100\nG165 P3 X10000 Q1.2\nG32 Z-10000 F2.5 Q180000 A2400 R120000\nG165 P0",
        "spindle cw 100
         ThreadVibration on X5 Q1.2
         thread 0 -> Z-10 @2.5 from 180 amplitude 1.2 shift 120
         ThreadVibration off",
    );
}

/// In which increments a feed or lead per revolution counts, depends on the control.
#[test]
fn feeds_per_revolution_without_a_decimal_point_are_refused_where_numbers_are_increments() {
    let settings = LanguageSettings { decimal_point: DecimalPointRule::LeastIncrement, ..lathe() };
    let refused = "spindle cw 100\n! 2:11+3 PRG-FEED-WITHOUT-POINT";
    check(&settings, "M3 S100\nG1 Z-1000 F20", refused);
    check(&settings, "M3 S100\nG32 Z-1000 F15", &refused.replace("2:11", "2:12"));
    check(
        &settings,
        "M3 S100\nG1 Z-1000 F.2\nZ-2000 F20\nZ-3000",
        "spindle cw 100\nline 0 -> Z-1 @0.2/rev\nline Z-2 -> Z-3 @0.2/rev\n! 3:8+3 PRG-FEED-WITHOUT-POINT",
    );
    check(&lathe(), "M3 S100\nG1 Z-1 F2", "spindle cw 100\nline 0 -> Z-1 @2/rev");
}

#[test]
fn threads_per_inch() {
    check(&lathe(), "M3 S100\nG32 Z-10. E8", "spindle cw 100\nthread 0 -> Z-10 @3.175");
    check(&lathe(), "G20 M3 S100\nG32 Z-1. E8", "spindle cw 100\nthread 0 -> Z-25.4 @3.175");
    check(
        &lathe(),
        "M3 S100\nG32 Z-10. E1.5",
        "spindle cw 100\nthread 0 -> Z-10 @16.933333\nw 2:11+4 PRG-THREAD-PER-INCH",
    );
    let settings = LanguageSettings { thread_e_word: ThreadEWord::PreciseLead, ..lathe() };
    check(&settings, "M3 S100\nG32 Z-10. E1.41111", "spindle cw 100\nthread 0 -> Z-10 @1.41111");
    check(&settings, "G20 M3 S100\nG32 Z-1. E.0625", "spindle cw 100\nthread 0 -> Z-25.4 @1.5875");
    check(&mill(), "M3 S100\nG33 Z-10. E8", "spindle cw 100\n! 2:11+2 PRG-WORD-UNKNOWN");
}

#[test]
fn the_lead_of_k_is_along_the_path() {
    check(
        &linuxcnc(),
        "M3 S100\nG33 Z-10. K1.5\nZ-20. K1.5",
        "spindle cw 100\nthread 0 -> Z-10 @1.5\nthread Z-10 -> Z-20 @1.5",
    );
    // 3-4-5: 4 mm of Z on 5 mm of path.
    check(&linuxcnc(), "M3 S100\nG33 X3. Z-4. K1.", "spindle cw 100\nthread 0 -> X3 Z-4 @0.8");
    check(&linuxcnc(), "G20 M3 S100\nG33 Z-1. K.1", "spindle cw 100\nthread 0 -> Z-25.4 @2.54");
    // It is of its block alone.
    check(
        &linuxcnc(),
        "M3 S100 F50\nG33 Z-10. K1.5\nZ-20.\nG1 Z0",
        "spindle cw 100
         thread 0 -> Z-10 @1.5
         line Z-20 -> 0 @50/min
         ! 3:1+5 PRG-THREAD-LEAD-MISSING",
    );
}

/// Feed and lead are one modal word, but never taken for each other.
#[test]
fn k_is_no_lead_on_fanuc_controls() {
    for settings in [mill(), lathe(), LanguageSettings { g_code_system: Some(crate::GCodeSystem::B), ..lathe() }] {
        check(&settings, "M3 S100\nG33 Z-10. K1.5\nZ-20.", "spindle cw 100\n! 2:11+4 PRG-THREAD-LEAD");
        check(&settings, "M3 S100\nG33 Z-10. F2. K.1", "spindle cw 100\n! 2:15+3 PRG-THREAD-LEAD");
    }
    // The lead of F is along the longer axis: 4 mm of Z on 5 mm of path.
    for (program, cure) in [("G33 X3. Z-4. K1.", "F0.8"), ("G33 Z-4. K1.5", "F1.5"), ("G20 G33 Z-1. K.1", "F0.1")] {
        let (_, findings) = interpret(format!("M3 S100\n{program}\nM30").as_bytes(), mill());
        let replacement = findings.findings().last().and_then(|finding| finding.suggestions[0].replacement.clone());
        assert_eq!(replacement.as_deref(), Some(cure), "{program}");
        let at = program.find(" K").unwrap();
        let cured = format!("M3 S100\n{} {cure}\nM30", &program[..at]);
        let (_, findings) = interpret(cured.as_bytes(), mill());
        assert!(!findings.has_errors(), "{cured}: {:?}", findings.findings());
    }
}

#[test]
fn a_lead_is_no_feed_and_a_feed_is_no_lead() {
    check(
        &lathe(),
        "M3 S100 G1 Z1. F.2\nG32 Z5. F2.\nG0 Z0\nG32 Z9.\nG1 Z10.\nZ11.\nZ12. F.1",
        "spindle cw 100
         line 0 -> Z1 @0.2/rev
         thread Z1 -> Z5 @2
         rapid Z5 -> 0
         thread 0 -> Z9 @2
         line Z11 -> Z12 @0.1/rev
         ! 5:1+7 PRG-FEED-MISSING",
    );
    check(
        &lathe(),
        "M3 S100 G32 Z5. F2.\nG1 Z6. F.2\nG32 Z9.\nZ12.\nF1.\nZ15.",
        "spindle cw 100
         thread 0 -> Z5 @2
         line Z5 -> Z6 @0.2/rev
         thread Z12 -> Z15 @1
         ! 3:1+7 PRG-THREAD-LEAD-MISSING",
    );
    let finding = finding_with(lathe(), "M3 S100 G1 Z1. F.2\nG32 Z9.", "no lead");
    assert!(finding.message.contains("F0.2"), "{}", finding.message);
    // Feed modes have nothing to say about a thread.
    check(
        &lathe(),
        "M3 S100 G98 G32 Z5. F2.\nG93 Z9.\nG99 Z10.",
        "spindle cw 100\nthread 0 -> Z5 @2\nthread Z5 -> Z9 @2\nthread Z9 -> Z10 @2",
    );
}

#[test]
fn leads_that_are_none() {
    check(&lathe(), "M3 S100\nG32 Z5. F2. E8", "spindle cw 100\n! 2:13+2 PRG-WORD-CONFLICT");
    check(&linuxcnc(), "M3 S100\nG33 Z5. F2. K2.", "spindle cw 100\n! 2:9+3 PRG-WORD-CONFLICT");
    check(&linuxcnc(), "M3 S100\nG33 Z5. E2.", "spindle cw 100\n! 2:9+3 PRG-WORD-CONFLICT");
    check(&linuxcnc(), "M3 S100\nG33.1 K2.", "spindle cw 100\n! 2:1+9 PRG-CYCLE-WORD");
    for word in ["F0", "F-1.5", "E0", "E-8", "F500.1", "K-1.", "K0", "E.01"] {
        let length = word.len();
        check(
            &lathe(),
            &format!("M3 S100\nG33 Z5. {word}"),
            &format!("spindle cw 100\n! 2:9+{length} PRG-THREAD-LEAD"),
        );
    }
    // Said once.
    check(&lathe(), "M3 S100\nG32 Z5. F0\nZ6.\nZ7.", "spindle cw 100\n! 2:9+2 PRG-THREAD-LEAD");
    check(&lathe(), "M3 S100\nG32 Z5.\nZ6.\nZ7.", "spindle cw 100\n! 2:1+7 PRG-THREAD-LEAD-MISSING");
}

#[test]
fn spindles_that_cut_no_thread() {
    check(
        &lathe(),
        "G32 Z5. F2.\nZ6.\nM3 S100\nZ7.",
        "spindle cw 100\nthread Z6 -> Z7 @2\n! 1:1+11 PRG-SPINDLE-STOPPED",
    );
    check(
        &lathe(),
        "G50 S2000\nG96 S100 M3\nG0 X100.\nG32 Z5. F2.\nZ6.\nG97 S300\nZ7.",
        "spindle cw 100 m/min max 2000
         rapid 0 -> X50
         spindle cw 300
         thread X50 Z6 -> X50 Z7 @2
         ! 4:1+11 PRG-THREAD-SURFACE-SPEED",
    );
    // n = v/(2π·r) = 100 m/min / (2π·50 mm) = 318.3/min
    let program = "G50 S2000\nG96 S100 M3\nG0 X100.\nG32 Z5. F2.";
    let finding = finding_with(lathe(), program, "spoils a thread");
    assert!(finding.suggestions[0].message.contains("G97 S318"), "{:?}", finding.suggestions);
    check(&lathe(), "M4 S100\nG32 Z5. F2.", "spindle ccw 100\nthread 0 -> Z5 @2");
}

#[test]
fn angles_and_amplitudes_out_of_range() {
    check(
        &lathe(),
        "M3 S100\nG32 Z5. F2. Q360.\nZ9. Q-1.",
        "spindle cw 100\nthread 0 -> Z5 @2 from 360\n! 3:5+4 PRG-THREAD-ANGLE",
    );
    check(&lathe(), "M3 S100\nG32 Z5. F2. R400.", "spindle cw 100\n! 2:13+5 PRG-THREAD-ANGLE");
    check(&lathe(), "M3 S100\nG32 Z5. F2. A-1.", "spindle cw 100\n! 2:13+4 PRG-THREAD-AMPLITUDE");
    let replacements = |program: &str, text: &str| -> Vec<_> {
        finding_with(lathe(), program, text).suggestions.into_iter().filter_map(|cure| cure.replacement).collect()
    };
    assert_eq!(replacements("M3 S100\nG32 Z5. F2. Q-30.", "start angle"), ["Q330.0"]);
    assert_eq!(replacements("M3 S100\nG32 Z5. F2. Q400.5", "start angle"), ["Q40.5"]);
    // Controls refuse a decimal point.
    assert_eq!(replacements("M3 S100\nG32 Z5. F2. Q400000", "start angle"), ["Q40000"]);
    assert_eq!(replacements("M3 S100\nG32 Z5. F2. R540.", "phase shift"), ["R180.0"]);
    assert_eq!(replacements("M3 S100\nG32 Z5. F2. A-1.5", "amplitude"), ["A1.5", "A0"]);
}

/// FANUC lathes count thousandths of a degree; passes that vibrate have degrees.
#[test]
fn start_angles_without_a_decimal_point() {
    let pass =
        |angle: &str, from: &str| (format!("G32 Z5. F2. {angle}"), format!("spindle cw 100\nthread 0 -> Z5 @2{from}"));
    for (angle, from) in [("Q180000", " from 180"), ("Q500", " from 0.5"), ("Q0", ""), ("Q180.", " from 180")] {
        let (block, expected) = pass(angle, from);
        check(&lathe(), &format!("M3 S100\n{block}"), &expected);
    }
    let (block, expected) = pass("Q180", " from 180");
    check(&lathe(), &format!("M3 S100\n{block}"), &format!("{expected}\nw 2:13+4 PRG-THREAD-ANGLE-UNIT"));
    let cycle = |angle: &str| render(format!("M3 S100 G0 X40. Z5.\nG92 X30. Z-20. F2. {angle}"), &lathe());
    let found = cycle("Q180");
    assert!(found.contains("from 0.18\n") && found.contains("w 2:20+4 PRG-THREAD-ANGLE-UNIT"), "{found}");
    let cured = cycle("Q180000");
    assert!(cured.contains("from 180\n") && !cured.contains("PRG-THREAD"), "{cured}");
    for (kind, program) in [("pass", "M3 S100\nG32 Z5. F2. Q180"), ("cycle", "M3 S100 G0 X9.\nG92 X3. Z-2. F2. Q180")] {
        let finding = finding_with(lathe(), program, "thousandths");
        assert_eq!(finding.suggestions[0].replacement.as_deref(), Some("Q180000"), "{kind}");
    }
    // Where passes vibrate, with the amplitude that follows or with their own, there are degrees; not so where they do not.
    let under_vibration =
        |pass: &str| render(format!("M3 S100 G0 X40. Z5.\nG165 P3 X40. Q1.2\n{pass}\nG165 P0"), &lathe());
    for pass in ["G32 Z-10. F2.5 Q180 A2.4", "G32 Z-10. F2.5 Q180", "G92 X36. Z-10. F2.5 Q180"] {
        let found = under_vibration(pass);
        assert!(found.contains("from 180") && !found.contains("PRG-THREAD-ANGLE"), "{pass}: {found}");
    }
    assert!(under_vibration("G32 Z-10. F2.5 Q180 A0").contains("PRG-THREAD-ANGLE-UNIT"));
    let alone = render("M3 S100\nG32 Z5. F2. Q180 A2.4", &lathe());
    assert!(alone.contains("PRG-THREAD-ANGLE-UNIT"), "{alone}");
}

#[test]
fn words_that_no_thread_has() {
    check(&lathe(), "M3 S100 G0 X2.\nG32 X2. F2.", "spindle cw 100\nrapid 0 -> X1\n! 2:1+11 PRG-THREAD-TRAVEL");
    check(
        &lathe(),
        "M3 S100\nG32 Z5. C90. F2.\nY1.",
        "spindle cw 100\n! 2:9+4 PRG-THREAD-AXIS\n! 3:1+3 PRG-THREAD-AXIS",
    );
    check(&lathe(), "M3 S100\nG32 Z5. F2. P3 D1", "spindle cw 100\n! 2:16+2 PRG-WORD-UNUSED\n! 2:13+2 PRG-WORD-UNUSED");
    check(&lathe(), "M3 S100\nG53 G32 Z5. F2.", "spindle cw 100\n! 2:1+3 PRG-MACHINE-MOTION");
    check(&lathe(), "M3 S100\nG32 Q5.\nZ5. F1.", "spindle cw 100\nthread 0 -> Z5 @1\n! 2:5+3 PRG-WORD-UNUSED");
    // Outside of threads A is an axis and E is nothing.
    check(&lathe(), "G0 X2. A5.\nG32\nG0 E5", "rapid 0 -> X1 A5\n! 3:4+2 PRG-WORD-UNUSED");
}

#[test]
fn vibration_in_threads_is_switched_by_p() {
    check(
        &lathe(),
        "G165\nG165 P1 X10. Q1.2\nG165 P3 X10.\nG165 P3\nG165 P0 X1.\nG165 P3 X10. Q1.2 Z5.",
        "! 1:1+4 PRG-FUNCTION-SWITCH
         ! 2:6+2 PRG-FUNCTION-SWITCH
         ! 3:1+4 PRG-FUNCTION-WORD-MISSING
         ! 4:1+4 PRG-FUNCTION-WORD-MISSING
         ! 4:1+4 PRG-FUNCTION-WORD-MISSING
         ! 5:9+3 PRG-FUNCTION-WORD
         ! 6:19+3 PRG-FUNCTION-WORD",
    );
    // Values are the function's own business.
    check(&lathe(), "G165 P3. X-1. Q0", "ThreadVibration on X-0.5 Q0");
    let thread_vibration = FunctionSwitch { code: 8.5, on_p: 1, off_p: 2 };
    check(
        &LanguageSettings { thread_vibration, ..lathe() },
        "G8.5 P1 X10. Q2.\nG8.5 P2\nG8.5 P3\nG165 P0",
        "ThreadVibration on X5 Q2
         ThreadVibration off
         ! 3:6+2 PRG-FUNCTION-SWITCH
         ! 4:1+4 PRG-UNKNOWN-CODE",
    );
}

/// What an error keeps from being switched on is off already, and switching it off no second error.
#[test]
fn a_function_that_was_refused_is_not_switched_off() {
    // The missing ratio, and a P that says nothing.
    check(&lathe(), "G165 P3 X10.\nG165 P0", "! 1:1+4 PRG-FUNCTION-WORD-MISSING");
    check(&lathe(), "G165 P7\nG165 P0", "! 1:6+2 PRG-FUNCTION-SWITCH");
    check(&lathe(), "G200 F50 A.03 D1\nG201", "! 1:15+2 PRG-FUNCTION-WORD");
    // Once only, and only where nothing else was on.
    check(&lathe(), "G165 P3 X10.\nG165 P0\nG165 P0", "ThreadVibration off\n! 1:1+4 PRG-FUNCTION-WORD-MISSING");
    check(
        &lathe(),
        "G165 P3 X10. Q2\nG165 P3 X10.\nG165 P0",
        "ThreadVibration on X5 Q2\nThreadVibration off\n! 2:1+4 PRG-FUNCTION-WORD-MISSING",
    );
    check(
        &lathe(),
        "G165 P3 X10.\nG165 P3 X10. Q2\nG165 P0\nG165 P0",
        "ThreadVibration on X5 Q2
         ThreadVibration off
         ThreadVibration off
         ! 1:1+4 PRG-FUNCTION-WORD-MISSING",
    );
}

#[test]
fn threads_and_tool_centre_point_control_exclude_each_other() {
    check(
        &mill(),
        "M3 S100\nG33 Z-5. F1.\nG43.4 H1\nZ-6. F1.\nG49\nG33 Z-7. F1.\nG0 X0 Y0 Z0\nG33 Z-8. F1.",
        "spindle cw 100
         thread 0 -> Z-5 @1
         guided axes H0 rapid -> 0
         thread 0 -> Z-8 @1
         ! 4:1+8 PRG-TOOL-CONTROL-BLOCK
         ! 6:1+12 PRG-TOOL-CONTROL-HELD",
    );
}

/// An interpreter that is restored within a thread knows its lead, its cycle and what a first line has set.
#[test]
fn threads_go_on_in_a_restored_interpreter() {
    let program =
        "M3 S100 G0 X20. Z5.\nG76 P021060 Q50 R.05\nG92 X18. Z-20. R-.5 F2.\nX17.\nG76 X16. Z-20. P900 Q300\nM30\n";
    let (expected, _) = interpret(program.as_bytes(), lathe());
    let mut interpreter = Interpreter::new(lathe());
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    let mut rest = program.as_bytes();
    while let LineOutcome::Consumed(length) = interpreter.read_line(rest, true, &mut operations, &mut findings) {
        rest = &rest[length..];
        let stored = postcard::to_allocvec(interpreter.state()).expect("a state can be stored");
        let state = postcard::from_bytes(&stored).expect("and read back");
        interpreter = Interpreter::restore(lathe(), state);
    }
    assert!(findings.findings().iter().all(|finding| finding.severity == Severity::Info), "{findings:?}");
    assert_eq!(operations, expected);
    assert!(expected.iter().filter(|operation| matches!(operation.kind, OperationKind::Thread(_))).count() > 5);
}
