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
    // Only subprograms, which others call.
    assert_eq!(found("(c)\nO<a> sub\nG1 X#1\nO<a> endsub\n", linuxcnc()), ["w 4:1+0 PRG-NO-END"]);
    assert_eq!(found("O1 sub\nO1 endsub\nG0 X1\n", linuxcnc()), ["! 3:6+0 PRG-NO-END"]);
    assert_eq!(found("O1 sub\nG0 X1\nO1 endsub\nO1 call\n", linuxcnc()), ["! 4:1+0 PRG-NO-END"]);
    for program in ["%\nG0 X1\n%\n", "G0 X1\nM2\n", "G0 X1 M30\n"] {
        assert!(found(program, linuxcnc()).is_empty(), "{program}");
    }
}

/// What rs274 calls `Bad character '%' used`.
#[test]
fn a_percent_frames_the_file_alone() {
    for program in ["%\nG0 X1\n%", " \n % \r\nG0 X1\n\t%\t\n", "G0 X1\nM2\n%\n", "(c)\nG0 X1\nM2\n% (end)"] {
        assert_eq!(render(program, &linuxcnc()), "rapid 0 -> X1\nend", "{program}");
    }
    for (program, place, cured) in [
        ("% (title)\nG0 X1\nM2", "1:1", "%\n(title)\nG0 X1\nM2"),
        ("%;c\nG0 X1\nM2", "1:1", "%\n;c\nG0 X1\nM2"),
        ("%n5\nG0 X1\nM2", "1:1", "%\nn5\nG0 X1\nM2"),
        ("(c)\n%\nG0 X1\nM2", "2:1", "%\n(c)\nG0 X1\nM2"),
        ("(c)\n%(d)\nG0 X1\nM2", "2:1", "%\n(c)\n(d)\nG0 X1\nM2"),
        ("G0 X1\n%", "2:1", "G0 X1\nM2"),
        ("G0 X1\n %(d)", "2:2", "%\nG0 X1\n%"),
        ("%\nG0 X1\n%(d)", "3:1", "%\nG0 X1\n%\n(d)"),
    ] {
        assert_eq!(render(program, &linuxcnc()), format!("rapid 0 -> X1\nend\n! {place}+1 PRG-CHARACTER"), "{program}");
        assert_eq!(render(cured, &linuxcnc()), "rapid 0 -> X1\nend", "{cured}");
        assert_eq!(render(program, &mill()), "rapid 0 -> X1\nend", "{program}");
    }
}

#[test]
fn a_line_number_is_the_first_word() {
    let moved = "rapid 0 -> X1";
    for line in ["N5 G0 X1", " N5.5 (comment) G0 X1", "N5G0X1", "/N5 G0 X1", "/ N5 G0 X1"] {
        check(&linuxcnc(), line, moved);
    }
    check(&linuxcnc(), "G0 X1 N5", "! 1:7+2 PRG-LINE-NUMBER-LATE");
    check(&linuxcnc(), "(comment) N5 G0 X1", "! 1:11+2 PRG-LINE-NUMBER-LATE");
    check(&linuxcnc(), "#1=5 N5 G0 X1", "! 1:6+2 PRG-LINE-NUMBER-LATE");
    check(&linuxcnc(), "N4 N5 G0 X1", "! 1:4+2 PRG-WORD-DUPLICATE");
    check(&linuxcnc(), "N5/G0 X1", "! 1:3+1 PRG-CHARACTER");
    check(&linuxcnc(), "(comment) /G0 X1", "! 1:11+1 PRG-CHARACTER");
    // The words of a block have no order on other controls.
    for settings in [mill(), lathe()] {
        for line in ["G0 X1. N5", "(comment) N5 G0 X1.", "N5/G0 X1."] {
            assert!(!interpret(line.as_bytes(), settings.clone()).1.has_errors(), "{line}");
        }
    }
}

#[test]
fn a_move_may_follow_a_dwell() {
    check(&linuxcnc(), "G0 G4 P1 X5", "dwell 1\nrapid 0 -> X5");
    check(&linuxcnc(), "G0\nG4 P1 X5\nG4 P2 @3 ^90", "dwell 1\nrapid 0 -> X5\ndwell 2\nrapid X5 -> Y3");
    check(&linuxcnc(), "G4 P1 X5", "! 1:1+8 PRG-MOTION-MISSING");
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

#[test]
fn a_line_number_may_have_a_fraction() {
    check(&linuxcnc(), "N10 G0 X1\nN10.5 X2\nN10.1234567 X3", "rapid 0 -> X1\nrapid X1 -> X2\nrapid X2 -> X3");
    check(&linuxcnc(), "N.5 G0 X1", "! 1:1+3 PRG-NUMBER-NOT-WHOLE");
    check(&linuxcnc(), "N-1.5 G0 X1", "! 1:1+5 PRG-NUMBER-NOT-WHOLE");
    check(&mill(), "N10.5 G0 X1", "! 1:1+5 PRG-NUMBER-NOT-WHOLE");
    check(&linuxcnc(), "N10 N20 G0 X1", "! 1:5+3 PRG-WORD-DUPLICATE");
}

#[test]
fn machine_coordinates_without_axes_are_a_motion_code() {
    check(
        &linuxcnc(),
        "G1 X1 F10\nG53 G0\nX2\nG53 G1\nX3",
        "line 0 -> X1 @10/min\nrapid X1 -> X2\nline X2 -> X3 @10/min",
    );
    for program in ["G0\nG53", "G0\nG53 F100", "G0 G91\nG53 G0"] {
        let (_, findings) = interpret(format!("{program}\nM2\n").as_bytes(), linuxcnc());
        let found: Vec<_> = findings.findings().iter().map(|finding| finding.code).collect();
        assert_eq!(found, ["PRG-MACHINE-MOTION"], "{program}");
    }
}

/// The row 0 of the table of tools is the spindle.
#[test]
fn row_0_is_the_tool_in_the_spindle() {
    check(&linuxcnc(), "G43 H0\nG43.2 H0\nG0 Z1", "rapid 0 -> Z1");
    check(&linuxcnc(), "T2 M6\nG43 H0\nG0 Z1", "tool 2.0\nrapid Z-50 -> Z1");
    check(&linuxcnc(), "T2 M6\nG43.1 Z1\nG43.2 H0\nG0 Z1", "tool 2.0\nrapid Z-51 -> Z1");
    let tools = vec![ToolOffset::new(2).with_length(50.0).with_radius(3.0)];
    let interpreter = Interpreter::new(linuxcnc()).with_tools(tools);
    let (operations, findings) = interpreter.read_all(b"T2 M6\nG41 D0 G1 X20 F10\nY50\nG40 X60\nM2\n");
    assert!(!findings.has_errors(), "{:?}", findings.findings());
    assert!(
        operations.iter().map(render_operation).any(|line| line == "line X17 Y3 -> X17 Y50 @10/min"),
        "{operations:?}"
    );
}

/// `$` names a spindle, of which there is one; checked with rs274.
#[test]
fn the_spindle_number_is_that_of_the_one_spindle() {
    for words in ["M3 $0 S500", "M3 S500 $0", "M3 $-1 S500", "M3 S500 $[1-1]"] {
        let program = format!("{words}\nG1 X5 F100");
        let rendered = render(format!("{program}\nM2\n"), &linuxcnc());
        assert!(!rendered.contains("PRG-"), "{program}: {rendered}");
        assert!(rendered.contains("line 0 -> X5 @100/min"), "{program}: {rendered}");
    }
    for (words, at) in
        [("M3 $1 S500", "1:4+2"), ("M3 S500 $0 $0", "1:12+2"), ("G0 X1 $0", "1:7+2"), ("G97 S500 $-1", "1:10+3")]
    {
        let rendered = render(format!("{words}\nM2\n"), &linuxcnc());
        assert!(rendered.contains(&format!("! {at} PRG-SPINDLE-NUMBER")), "{words}: {rendered}");
    }
    check(&mill(), "M3 S500 $0", "! 1:9+1 PRG-CHARACTER\n! 1:10+1 PRG-NUMBER-STRAY");
}
