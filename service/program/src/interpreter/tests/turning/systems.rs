//! The G-code systems of lathes.

use super::*;

#[test]
fn modes_of_system_a() {
    check(
        &a(),
        "G98 G1 X10. F100.\nM3 S500\nG99 G1 X20. F0.2",
        "line 0 -> X5 @100/min\nspindle cw 500\nline X5 -> X10 @0.2/rev",
    );
    check(&a(), "G21\nG0 U10. W5.\nU-2.", "rapid 0 -> X5 Z5\nrapid X5 Z5 -> X4 Z5");
    for code in ["G91 G0 X1.", "G95", "G77 X5. Z-5.", "G24 X5. Z-5."] {
        assert_eq!(codes(&a(), code), ["PRG-UNKNOWN-CODE"], "{code}");
    }
}

#[test]
fn a_program_of_another_system_is_one_finding() {
    let program = "G21 G95 G97 S500 M3\nG90 G0 X50. Z2.\nG77 X45. Z-20. F0.2\nG91 G77 X-14.\nG90 G78 X40. Z-20. F1.5\nG98 G83 X0 Z-5. R1.";
    assert_eq!(codes(&a(), program), ["PRG-UNKNOWN-CODE"]);
    let (_, findings) = interpret(format!("G0 X50. Z2.\n{}\nM30\n", "G90 G78 X40. Z-20. F1.5").as_bytes(), a());
    let findings = findings.into_findings();
    let cure = &findings[0].suggestions[0].message;
    assert_eq!(findings.len(), 1, "{findings:?}");
    assert!(cure.ends_with("to G_CODE_SYSTEM_B"), "{cure}");
}

#[test]
fn codes_of_haas_lathes_are_known_as_what_they_are() {
    for code in ["G14", "G101 X0", "G105 J1. K2.", "G184 Z-10. R2. F1.", "G195 S500", "G241 X10. R2. F0.1"] {
        assert_eq!(codes(&a(), code), ["PRG-UNSUPPORTED-CODE"], "{code}");
    }
}

#[test]
fn modes_of_system_b() {
    let mut b = system(GCodeSystem::B);
    b.drilling.peck_clearance_mm = Some(1.0);
    check(
        &b,
        "G94 G1 X10. F100.\nG91 X2. Z-5.\nG90 X10.",
        "line 0 -> X5 @100/min\nline X5 -> X6 Z-5 @100/min\nline X6 Z-5 -> X5 Z-5 @100/min",
    );
    check(&b, "G92 S2000\nG96 S200 M3\nG20 G0 X1.", "spindle cw 200 m/min max 2000\nrapid 0 -> X12.7");
    // U is no axis there, and G50 no clamp.
    assert_eq!(codes(&b, "G0 U5."), ["PRG-WORD-UNUSED"]);
    assert_eq!(codes(&b, "G50 S2000"), ["PRG-UNKNOWN-CODE"]);
    // G98 and G99 are the level to which drilling cycles return.
    moves(&b, "M3 S500\nG0 X0 Z10.\nG99 G83 Z-10. R2. F0.1\nG80\nG0 Z20.", 1, "r 0 2; f 0 -10; r 0 2; r 0 20");
    moves(&b, "M3 S500\nG0 X0 Z10.\nG98 G83 Z-10. R2. F0.1\nG80\nG0 Z20.", 1, "r 0 2; f 0 -10; r 0 10; r 0 20");
}

#[test]
fn modes_of_system_c() {
    let c = system(GCodeSystem::C);
    check(&c, "G70\nG0 X1.\nG71\nX10.", "rapid 0 -> X12.7\nrapid X12.7 -> X5");
    moves(
        &c,
        "M3 S500\nG0 X24. Z5.\nG78 P010000 Q100 R0.05\nG78 X22. Z-20. P1000 Q1000 F1.5",
        1,
        "r 22.1 5; t 22.1 -20; r 24 -20; r 24 5; r 22 5; t 22 -20; r 24 -20; r 24 5",
    );
}

/// A control stops at the code of another system, also where both cut the same thread.
#[test]
fn threads_have_the_code_of_their_system() {
    let go = "M3 S500\nG0 X24. Z5.\n";
    for (system, own, other) in
        [(GCodeSystem::A, "G32", "G33"), (GCodeSystem::B, "G33", "G32"), (GCodeSystem::C, "G33", "G32")]
    {
        let settings = LanguageSettings { g_code_system: Some(system), ..lathe() };
        assert_eq!(codes(&settings, &format!("{go}{own} Z-10. F1.5")), [""; 0], "{system:?}");
        assert_eq!(codes(&settings, &format!("{go}{other} Z-10. F1.5")), ["PRG-UNKNOWN-CODE"], "{system:?}");
    }
}

#[test]
fn without_a_system_nothing_is_guessed() {
    let go = "M3 S500\nG0 X50. Z2.\n";
    for block in [
        "G90 X45. Z-30. F0.2",
        "G94 X45. Z-30. F0.2",
        "G77 X45. Z-30. F0.2",
        "G78 X45. Z-30. F1.5",
        "G79 X45. Z-30. F0.2",
        "G24 X45. Z-30. F0.2",
        "G20 X45. Z-30.",
        "G71",
        "G70",
        "G73 U5. R3",
        "G73 P10 Q20 U0.4 F0.2",
        "G72 P10 Q20",
        "G74 P10 Q20 U0.4 W0.1 F0.2",
        "G75 P10 Q20 U0.4 W0.1 F0.2",
    ] {
        assert_eq!(codes(&lathe(), &format!("{go}{block}")), ["PRG-CODE-AMBIGUOUS"], "{block}");
    }
    // Words that one system only has settle it.
    for (block, expected) in [
        ("G74 R0.5\nG74 Z-10. Q2000 F0.1", ""),
        ("G75 R0.5\nG75 X20. P2000 F0.1", ""),
        ("G73 U5. W2. R3", ""),
        ("G72 W2. R1.", ""),
    ] {
        assert_eq!(codes(&lathe(), &format!("{go}{block}")).join(" "), expected, "{block}");
    }
}

#[test]
fn every_doubt_names_the_setting() {
    for block in ["G90 X45. Z-30. F0.2", "G90\nX45.", "G92 X45. Z-30.", "G77 X45. Z-30. F0.2", "G73 U5. R3"] {
        let program = format!("M3 S500\nG0 X50. Z2.\n{block}\nM30");
        let (_, findings) = interpret(program.as_bytes(), lathe());
        let cures = &findings.findings()[0].suggestions;
        assert!(cures.iter().any(|cure| cure.message.contains("g_code_system")), "{block}: {cures:?}");
    }
}
