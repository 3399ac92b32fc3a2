//! What only follows from something unread is no finding of its own.

use super::*;

#[test]
fn modal_words_that_could_not_be_read() {
    check(&mill(), "G1 X1 F..01\nX2\nY3", "! 1:7+5 PRG-NUMBER-INVALID");
    check(&mill(), "F..01\nG1 X2\nF10\nG1 X3", "line X2 -> X3 @10/min\n! 1:1+5 PRG-NUMBER-INVALID");
    check(&mill(), "F\u{2212}5\nG1 X2", "! 1:1+5 PRG-LOOKALIKE");
    check(&lathe(), "G97 S.. M3\nG1 X1 F.1\nG32 Z-5 F2", "! 1:5+3 PRG-NUMBER-INVALID");
    check(&lathe(), "S500 M..\nG1 X1 F.1", "! 1:6+3 PRG-NUMBER-INVALID");
    check(&mill(), "T..\nM6\nT2\nM6", "tool 2.0\n! 1:1+3 PRG-NUMBER-INVALID");
    check(&mill(), "G..\nX5", "! 1:1+3 PRG-NUMBER-INVALID");
    check(&lathe(), "G50 S..\nG96 S100 M3", "spindle cw 100 m/min max inf\n! 1:5+3 PRG-NUMBER-INVALID");
    check(&mill(), "G4 P..", "! 1:4+3 PRG-NUMBER-INVALID");
    check(&mill(), "G0 X..\nG2 X1 Y1 I0.5 J5 F10\nG0 X0 Y0", "rapid X1 Y1 -> 0\n! 1:4+3 PRG-NUMBER-INVALID");
}

#[test]
fn a_first_feed_or_speed_without_a_value() {
    check(&lathe(), "S500 M3\nG1 X1 F#101\nX2", "spindle cw 500\n! 2:7+5 PRG-VACANT-WORD");
    check(&lathe(), "S#1 M3\nG1 X1 F.1\nG32 Z-5 F2", "! 1:1+3 PRG-VACANT-WORD");
    check(&lathe(), "S500 M3\nG32 Z-5 F#101", "spindle cw 500\n! 2:9+5 PRG-VACANT-WORD");
    // What was in force stays so.
    check(&mill(), "G1 X1 F10\nX2 F#101", "line 0 -> X1 @10/min\nline X1 -> X2 @10/min\nw 2:4+5 PRG-VACANT-WORD");
}

#[test]
fn what_does_not_follow_is_said() {
    check(&mill(), "S..\nG1 X1", "! 1:1+3 PRG-NUMBER-INVALID\n! 2:1+5 PRG-FEED-MISSING");
    check(
        &mill(),
        "F..\nG1 X1 F10\nG93\nG1 X2",
        "line 0 -> X1 @10/min\n! 1:1+3 PRG-NUMBER-INVALID\n! 4:1+5 PRG-FEED-MISSING",
    );
    check(
        &mill(),
        "G0 X..\nX0 Y0\nG2 X1 Y1 I0.5 J5 F10",
        "! 1:4+3 PRG-NUMBER-INVALID\n! 3:10+4 PRG-ARC-RADIUS-MISMATCH",
    );
    check(&mill(), "P..\nG4", "! 1:1+3 PRG-NUMBER-INVALID\n! 2:1+2 PRG-DWELL-TIME");
}

#[test]
fn a_cut_with_something_unknown_is_judged_by_nothing() {
    // Neither the feed nor the speed of before counts for what follows.
    check(
        &mill(),
        "G1 X1 F10\nF..\nX2\nG0 X3\nG1 X4 F5",
        "line 0 -> X1 @10/min\nrapid X2 -> X3\nline X3 -> X4 @5/min\n! 2:1+3 PRG-NUMBER-INVALID",
    );
    check(
        &lathe(),
        "S500 M3\nG1 X2 F.1\nS..\nX4\nG32 Z-5 F2\nS600\nG1 X6 F.1",
        "spindle cw 500
         line 0 -> X1 @0.1/rev
         spindle cw 600
         line X2 Z-5 -> X3 Z-5 @0.1/rev
         ! 3:1+3 PRG-NUMBER-INVALID",
    );
    check(
        &mill(),
        "G1 X1 F10\nT..\nM6\nG1 X2\nT2 M6\nX3",
        "line 0 -> X1 @10/min\ntool 2.0\nline X2 -> X3 @10/min\n! 2:1+3 PRG-NUMBER-INVALID",
    );
    check(&lathe(), "G32 Z-5 F..\nZ-6", "! 1:9+3 PRG-NUMBER-INVALID");
}

/// A target that is not there because its number only looks like one.
#[test]
fn a_number_that_only_looks_like_one_is_the_cause_of_a_missing_target() {
    let found = |settings: &LanguageSettings, program: &str| {
        let (_, findings) = interpret(program.as_bytes(), settings.clone());
        let found = findings.findings().iter().map(|finding| (finding.span.line, finding.code.name()));
        found.collect::<Vec<_>>()
    };
    let contour = |first: &str| {
        format!("S500 M3\nG0 X50 Z2\nG71 U1 R.5\nG71 P10 Q20 U.4 W.1 F.15\n{first} G0 X20\nG1 Z-10\nN20 X50\nM30\n")
    };
    for first in ["N\u{410}10", "\u{ff2e}10", "N1\u{ff10}", "N1\u{41e}", "/\u{39d}10"] {
        assert_eq!(found(&lathe(), &contour(first)), [(5, "PRG-LOOKALIKE")], "{first}");
    }
    for first in ["N11", "\u{ff2e}11", "G1 (\u{2212})"] {
        assert_eq!(found(&lathe(), &contour(first))[0], (4, "PRG-TURNING-CONTOUR"), "{first}");
    }
    for (jump, there) in [("GOTO 10", "\u{39d}10 G1"), ("M98 P1000", "\u{41e}1000"), ("M98 P1000", "O1\u{ff10}00")] {
        let program = format!("{jump}\nM30\n{there} X1\nM99\n");
        assert_eq!(found(&mill(), &program), [(3, "PRG-LOOKALIKE")], "{program}");
    }
}
