//! Arcs as the interpreter of LinuxCNC reads them: end of section 4 of the page on the program language. The numbers that are
//! accepted and refused were found with rs274.

use super::*;

#[track_caller]
fn accepts(program: &str, expected: &str) {
    check(&linuxcnc(), &format!("F100 {program}"), expected);
}

#[track_caller]
fn refuses(block: &str, code: &str) {
    let (_, findings) = interpret(format!("F100\n{block}\nM2").as_bytes(), linuxcnc());
    let [finding] = findings.findings() else { panic!("{block}: {findings:?}") };
    assert_eq!((finding.code.name(), finding.severity), (code, Severity::Error), "{block}");
}

#[test]
fn absolute_centres() {
    accepts("G90.1 G2 X10 Y0 I5 J0", "arc 0 -> X10 about 5,0 by -180 @100/min");
    accepts(
        "G0 X10\nG90.1 G3 X0 Y10 I0 J0\nG91.1 X10 Y0 J-10",
        "rapid 0 -> X10\narc X10 -> Y10 about 0,0 by 90 @100/min\narc Y10 -> X10 about 0,0 by 270 @100/min",
    );
    // Independent of G91.
    accepts("G0 X10\nG91 G90.1 G3 X-10 Y10 I0 J0", "rapid 0 -> X10\narc X10 -> Y10 about 0,0 by 90 @100/min");
    accepts("G90.1 G2 X10 Y0 R5", "arc 0 -> X10 about 5,0 by -180 @100/min");
    refuses("G90.1 G2 X10 Y0 I5", "PRG-ARC-CENTRE-MISSING");
    check(&mill(), "G90.1", "! 1:1+5 PRG-UNKNOWN-CODE");
}

#[test]
fn turns() {
    accepts("G2 X10 Y0 I5 P2", "arc 0 -> X10 about 5,0 by -540 @100/min");
    accepts("G3 X0 Y0 I5 P3 Z-3", "arc 0 -> Z-3 about 5,0 by 1080 @100/min");
    accepts("G2 X10 R-5 P2", "arc 0 -> X10 about 5,0 by -540 @100/min");
    accepts("G2 X10 Y0 I5 P1", "arc 0 -> X10 about 5,0 by -180 @100/min");
    for block in ["G3 X0 Y0 I5 P0", "G3 X0 Y0 I5 P1.5", "G3 X0 Y0 I5 P-1", "G3 X0 Y0 I5 P10001"] {
        refuses(block, "PRG-ARC-TURNS");
    }
    // On FANUC and Haas controls nothing uses P.
    check(&mill(), "G2 X10 Y0 I5 P2 F100", "! 1:14+2 PRG-WORD-UNUSED");
}

#[test]
fn how_far_radii_may_differ() {
    for block in
        ["G2 X10 R4.9988", "G2 X10 Y0 I5.014", "G2 X200 Y0 I100.049", "G2 X20000 Y0 I10001.41", "G2 X0 Y0 I0.002"]
    {
        let (operations, findings) = interpret(format!("F100\n{block}\nM2").as_bytes(), linuxcnc());
        assert!(findings.findings().is_empty() && operations.len() == 2, "{block}: {findings:?}");
    }
    refuses("G2 X10 R4.9987", "PRG-ARC-RADIUS-TOO-SMALL");
    refuses("G2 X10 Y0 I5.0142", "PRG-ARC-RADIUS-MISMATCH");
    refuses("G2 X200 Y0 I100.051", "PRG-ARC-RADIUS-MISMATCH");
    refuses("G2 X20000 Y0 I10001.42", "PRG-ARC-RADIUS-MISMATCH");
    refuses("G2 X0 Y0 I0.001", "PRG-ARC-RADIUS-ZERO");
}
