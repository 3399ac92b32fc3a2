//! Words and codes that are known and not carried out, each with a finding of its own; and what is noted about threads.

use super::*;

/// Codes of the findings of a program.
fn codes(settings: &LanguageSettings, program: &str) -> Vec<&'static str> {
    let (_, findings) = interpret(format!("{program}\nM30\n").as_bytes(), settings.clone());
    findings.findings().iter().map(|finding| finding.code.name()).collect()
}

#[test]
fn polar_words_that_place_nothing_are_refused() {
    for program in [
        "G0 @10",
        "G0 X1 @",
        "G1 X1 ^-30.5 F100",
        "G0 Y1 @5",
        "G0 @1 @2 ^3",
        "G91 G0 @10 ^0",
        "G91 G0 ^10",
        "G18\nG0 @5 ^0",
        "G18\nG17 G0 @5 ^0",
        "G53 G0 @10 ^0",
        "G28 @10 ^0",
        "G30 @1",
        "G92 @10 ^0",
        "G52 @1",
        "G10 L2 P1 @5",
        "G10 L20 P1 @1 ^2",
        "G43.1 @1",
        "G80 @5 ^1",
        "G18 M3 S100\nG76 @5 Z1",
    ] {
        assert_eq!(codes(&linuxcnc(), program), ["PRG-POLAR-WORD"], "{program}");
    }
    for program in ["@1 ^2", "G4 P1 @1 ^2"] {
        assert_eq!(codes(&linuxcnc(), program), ["PRG-MOTION-MISSING"], "{program}");
    }
    assert_eq!(codes(&mill(), "G0 X1 @10"), ["PRG-CHARACTER"]);
}

#[test]
fn a_thread_of_variable_lead_is_refused_by_itself() {
    for settings in [lathe(), LanguageSettings { g_code_system: Some(crate::GCodeSystem::B), ..lathe() }] {
        assert_eq!(codes(&settings, "M3 S500\nG0 X20 Z5\nG34 Z-20 F1.5 K0.1"), ["PRG-THREAD-VARIABLE-LEAD"]);
    }
}

#[test]
fn cycles_of_haas_mills_are_named() {
    for program in ["G47 P0 X1. E2. F100", "G150 P1000 X0 Y0 Z-5. D1", "G234 H1"] {
        assert_eq!(codes(&mill(), program)[0], "PRG-UNSUPPORTED-CODE", "{program}");
    }
    assert_eq!(codes(&mill(), "G103 P1\nG0 X1"), [""; 0]);
}

#[test]
fn codes_of_fanuc_that_are_not_carried_out_are_named() {
    for settings in [mill(), lathe()] {
        for program in
            ["G66.1 P100 A1.", "G6.2 P4 X1. K0", "G2.2 X1. Y1. I1. J1. R5. F100", "G7.1 C20.", "G12.1", "G22 X10."]
        {
            assert_eq!(codes(&settings, program)[0], "PRG-UNSUPPORTED-CODE", "{program}");
        }
    }
    // The modal macro stays what it was.
    let (_, findings) = interpret(b"G66 P100\nG66.1 P200\nG0 X1\nM30\nO100\nG67\nM99\n", mill());
    assert_eq!(findings.count(Severity::Error), 1, "{findings:?}");
}

#[test]
fn a_bare_return_is_cured_with_words_of_its_dialect() {
    for (settings, such_as, cured) in
        [(mill(), "G91 G28 Z0, with G90 behind it", "G91 G28 Z0\nG90"), (lathe(), "U0 W0", "G28 U0 W0")]
    {
        let (_, findings) = interpret(b"G28\nM30\n", settings.clone());
        let cures: Vec<_> = findings.findings()[0].suggestions.iter().map(|cure| cure.message.as_str()).collect();
        assert_eq!(cures[0], format!("name the axes with their intermediate point, such as {such_as}"));
        assert!(cures[1].contains("COORDINATE_STYLE_HAAS"), "{cures:?}");
        assert_eq!(codes(&settings, cured), [""; 0]);
    }
}

#[test]
fn a_start_angle_beyond_a_turn_is_in_thousandths() {
    let angle = |program: &str| {
        let (operations, findings) = interpret(format!("M3 S500\nG0 X20. Z5.\n{program}\nM30").as_bytes(), lathe());
        assert!(!findings.has_errors(), "{findings:?}");
        let thread = operations.iter().find_map(|operation| match &operation.kind {
            OperationKind::Thread(thread) => Some(thread.start_angle_deg),
            _ => None,
        });
        thread.unwrap_or_default()
    };
    assert_eq!(angle("G32 Z-20. F3. Q180000"), 180.0);
    assert_eq!(angle("G32 Z-20. F3. Q180."), 180.0);
    assert_eq!(angle("G92 X18. Z-20. F3. Q90000"), 90.0);
    assert_eq!(codes(&lathe(), "M3 S500\nG0 X20. Z5.\nG32 Z-20. F3. Q400."), ["PRG-THREAD-ANGLE"]);
    assert_eq!(codes(&lathe(), "M3 S500\nG0 X20. Z5.\nG32 Z-20. F3. Q360001"), ["PRG-THREAD-ANGLE"]);
}

#[test]
fn what_nothing_states_about_threads_is_noted() {
    let go = "M3 S500\nG0 X24. Z5.\n";
    let plain = LanguageSettings::default();
    assert_eq!(codes(&plain, &format!("{go}G92 X19.2 Z-20. F1.5\nX18.7\nX18.16")), ["PRG-THREAD-CHAMFER"]);
    assert_eq!(codes(&lathe(), &format!("{go}G92 X19.2 Z-20. F1.5")), [""; 0]);
    let two_lines = "G76 P010060 Q100 R0.05\nG76 X18.16 Z-20. P920 Q300 F1.5";
    assert_eq!(codes(&plain, &format!("{go}{two_lines}")), ["PRG-THREAD-FLANK"]);
    assert_eq!(codes(&plain, &format!("{go}{}", two_lines.replace("0060", "0000"))), [""; 0]);
}

#[test]
fn comments_may_follow_the_end() {
    for (text, expected) in
        [("(made by a post)\n%", 0), ("; made by a post\n(by hand)", 0), ("(made by a post) G0 X1", 1)]
    {
        let (_, findings) = interpret(format!("G0 X1\nM30\n{text}\n").as_bytes(), mill());
        let found: Vec<_> = findings.findings().iter().map(|finding| finding.code.name()).collect();
        assert_eq!(found, vec!["PRG-TRAILING"; expected], "{text}");
    }
}

#[test]
fn the_motion_mode_is_that_of_the_reference_interpreter() {
    // Seen in its version 2.9: splines leave the mode alone, a NURBS leaves none.
    let mode = |program: &str| {
        let program = format!("F100 G0 X0 Y0 Z5\n{program}\n#1=#<_motion_mode>\nG80\nG1 X#1\nM2\n");
        let (operations, findings) = interpret(program.as_bytes(), linuxcnc());
        assert!(!findings.has_errors(), "{findings:?}");
        let last = operations.iter().rev().find_map(|operation| match &operation.kind {
            OperationKind::Move(step) => Some(step.end[0]),
            _ => None,
        });
        last.unwrap_or_default()
    };
    for (program, expected) in [
        ("G1 X1", 10.0),
        ("G38.2 X5", 382.0),
        ("G38.5 X5", 385.0),
        ("G5 I1 J2 P-1 Q2 X5 Y0", 0.0),
        ("G1 X1\nG5.1 I1 J2 X5 Y0", 10.0),
        ("G5.2 P1 L3 X1 Y1\nX2 Y2 P1\nX4 Y0 P1\nG5.3", -1.0),
        ("G81 X1 Y1 Z-1 R1", 810.0),
        ("G73 X1 Y1 Z-1 R1 Q0.5", 730.0),
        ("G81 X1 Y1 Z-1 R1\nG80", 800.0),
        ("S100 M3\nG33 Z1 K1", 330.0),
        ("S100 M3\nG33.1 Z1 K1", 331.0),
    ] {
        assert_eq!(mode(program), expected, "{program}");
    }
}
