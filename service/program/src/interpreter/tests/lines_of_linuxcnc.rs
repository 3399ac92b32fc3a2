//! Lines as the interpreter of LinuxCNC reads them: section 1 of the page on the program language, checked with rs274.

use super::*;

#[test]
fn a_program_has_an_end() {
    let found = |program: &str, settings: LanguageSettings| {
        let (_, findings) = interpret(program.as_bytes(), settings);
        findings.findings().iter().map(render_finding).collect::<Vec<_>>()
    };
    assert_eq!(found("G0 X1\n", linuxcnc()), ["! 1:6+0 PRG-NO-END"]);
    assert_eq!(found("%\nG0 X1\n", linuxcnc()), ["! 2:6+0 PRG-NO-END"]);
    assert_eq!(found("G0 X1\n", mill()), ["w 1:6+0 PRG-NO-END"]);
    for program in ["%\nG0 X1\n%\n", "G0 X1\nM2\n", "G0 X1 M30\n"] {
        assert!(found(program, linuxcnc()).is_empty(), "{program}");
    }
}

#[test]
fn a_move_may_follow_a_dwell() {
    check(&linuxcnc(), "G0 G4 P1 X5", "dwell 1\nrapid 0 -> X5");
    check(&linuxcnc(), "G0\nG4 P1 X5", "! 2:7+2 PRG-WORD-UNUSED");
    check(&mill(), "G0\nG4 X5", "dwell 5");
}

#[test]
fn no_feed_is_one_until_a_move_needs_it() {
    check(&linuxcnc(), "F0\nF10 G1 X1", "line 0 -> X1 @10/min");
    check(&linuxcnc(), "G0 X1 F0", "rapid 0 -> X1");
    check(&linuxcnc(), "F0 G1 X1", "! 1:1+8 PRG-FEED-MISSING");
    check(&linuxcnc(), "F-1", "! 1:1+3 PRG-FEED-NOT-POSITIVE");
    check(&mill(), "G0 X1 F0", "! 1:7+2 PRG-FEED-NOT-POSITIVE");
}

#[test]
fn the_clamp_of_a_surface_speed_is_its_d() {
    check(&linuxcnc(), "G96 D2000 S100 M3", "spindle cw 100 m/min max 2000");
    check(
        &linuxcnc(),
        "G96 D2000 S100 M3\nG96 S100",
        "spindle cw 100 m/min max 2000\nspindle cw 100 m/min max inf\nw 2:1+3 PRG-SPEED-CLAMP-MISSING",
    );
    check(&linuxcnc(), "G96 D0 S100", "! 1:5+2 PRG-SPEED-INVALID\nw 1:1+3 PRG-SPEED-CLAMP-MISSING");
    check(&mill(), "G96 D2000 S100 M3", "w 1:1+3 PRG-SPEED-CLAMP-MISSING\n! 1:5+5 PRG-WORD-UNUSED");
}

#[test]
fn motion_codes_without_words() {
    check(&linuxcnc(), "G0\nG1 F100", "");
    check(&linuxcnc(), "G2 F100", "! 1:1+7 PRG-ARC-CENTRE-MISSING");
    check(&linuxcnc(), "G38.2 F10", "! 1:1+9 PRG-PROBE");
    check(&mill(), "G2 F100", "");
}
