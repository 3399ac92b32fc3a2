//! `G71` to `G75` in one line, as older FANUC and Haas controls write them: three cases each, worked by hand from
//! docs/turning-cycles.md.

use super::*;

/// Escapes and returns of half a millimetre.
fn haas() -> LanguageSettings {
    let mut settings = a();
    settings.drilling.style = crate::DrillingStyle::Haas;
    settings.turning.escape_mm = Some(0.5);
    settings.turning.groove_return_mm = Some(0.5);
    settings
}

#[track_caller]
fn worked(go: &str, cycle: &str, expected: &str) {
    moves(&haas(), &format!("M3 S500\n{go}\n{cycle}"), 1, expected);
}

#[test]
fn g71_roughs_along_z() {
    // From C (30, 1) in steps of 8 in diameter; the level 14 would pass the contour.
    worked(
        "G0 X30. Z1.",
        "G71 P10 Q20 D4. F0.2\nN10 G0 X20.\nN20 G1 Z-10.",
        "r 22 1; f 22 -10; r 23 -9.5; r 23 1; r 20 1; f 20 -10; r 30 -10; r 30 1",
    );
    // Allowances move C to (30.4, 1.1) and the contour by as much.
    worked(
        "G0 X30. Z1.",
        "G71 P10 Q20 U0.4 W0.1 D4. F0.2\nN10 G0 X20.\nN20 G1 Z-10.",
        "r 30.4 1.1; r 22.4 1.1; f 22.4 -9.9; r 23.4 -9.4; r 23.4 1.1; r 20.4 1.1; f 20.4 -9.9; r 30 -9.9; r 30 1",
    );
    // A bore from 10 to 20, over a cone at 45 degrees: the level 14 meets it 3 mm in front of its end.
    worked(
        "G0 X10. Z1.",
        "G71 P10 Q20 D2. F0.2\nN10 G0 X20.\nG1 Z-5.\nN20 X10. Z-10.",
        "r 14 1; f 14 -8; r 13 -7.5; r 13 1; r 18 1; f 18 -6; r 17 -5.5; r 17 1; r 20 1; f 20 -5; f 10 -10; r 10 1",
    );
}

#[test]
fn g72_roughs_along_x() {
    worked(
        "G0 X30. Z1.",
        "G72 P10 Q20 D2. F0.2\nN10 G0 Z-5.\nN20 G1 X10.",
        "r 30 -1; f 10 -1; r 11 -0.5; r 30 -0.5; r 30 -3; f 10 -3; r 11 -2.5; r 30 -2.5; r 30 -5; f 10 -5; r 10 1; r 30 1",
    );
    worked(
        "G0 X30. Z1.",
        "G72 P10 Q20 U0.4 W0.2 D4. F0.2\nN10 G0 Z-5.\nN20 G1 X10.",
        "r 30.4 1.2; r 30.4 -2.8; f 10.4 -2.8; r 11.4 -2.3; r 30.4 -2.3; r 30.4 -4.8; f 10.4 -4.8; r 10.4 1; r 30 1",
    );
    // A cone: Z-3 is reached at X 20.
    worked(
        "G0 X30. Z1.",
        "G72 P10 Q20 D4. F0.2\nN10 G0 Z-5.\nG1 X24.\nN20 X12. Z1.",
        "r 30 -3; f 20 -3; r 21 -2.5; r 30 -2.5; r 30 -5; f 24 -5; f 12 1; r 30 1",
    );
}

#[test]
fn g73_follows_the_contour() {
    // Moved by the whole relief, 4 in diameter and 1, then not at all.
    worked(
        "G0 X40. Z2.",
        "G73 P10 Q20 I2. K1. D2 F0.2\nN10 G0 X20.\nN20 G1 Z-10.",
        "r 24 3; f 24 -9; r 44 -9; r 44 3; r 20 2; f 20 -10; r 40 -10; r 40 2",
    );
    // One pass at the allowances alone.
    worked(
        "G0 X40. Z2.",
        "G73 P10 Q20 U0.4 W0.1 I2. K1. D1 F0.2\nN10 G0 X20.\nN20 G1 Z-10.",
        "r 20.4 2.1; f 20.4 -9.9; r 40.4 -9.9; r 40.4 2.1; r 40.4 2; r 40 2",
    );
    // Three passes in a bore: the relief is negative.
    worked(
        "G0 X10. Z2.",
        "G73 P10 Q20 I-2. D3 F0.2\nN10 G0 X20.\nN20 G1 Z-10.",
        "r 16 2; f 16 -10; r 6 -10; r 6 2; r 18 2; f 18 -10; r 8 -10; r 8 2; r 20 2; f 20 -10; r 10 -10; r 10 2",
    );
}

#[test]
fn g74_pecks_along_z() {
    // Pecks of 5 from Z2, back by 0.5; columns 10 apart in diameter, off by D at the bottom but in the first.
    worked(
        "G0 X50. Z2.",
        "G74 X32. Z-8. I5. K5. D0.5 F0.1",
        "f 50 -3; r 50 -2.5; f 50 -8; r 50 2; r 40 2; f 40 -3; r 40 -2.5; f 40 -8; r 41 -8; r 41 2;
         r 32 2; f 32 -3; r 32 -2.5; f 32 -8; r 33 -8; r 33 2; r 50 2",
    );
    worked("G0 X0 Z2.", "G74 Z-10. K4. F0.1", "f 0 -2; r 0 -1.5; f 0 -6; r 0 -5.5; f 0 -10; r 0 2");
    worked("G0 X20. Z1.", "G74 X12. Z-4. I4. K10. F0.1", "f 20 -4; r 20 1; r 12 1; f 12 -4; r 12 1; r 20 1");
}

#[test]
fn g75_pecks_along_x() {
    worked(
        "G0 X62. Z-10.",
        "G75 X48. Z-14. I3. K4. F0.1",
        "f 56 -10; r 57 -10; f 50 -10; r 51 -10; f 48 -10; r 62 -10;
         r 62 -14; f 56 -14; r 57 -14; f 50 -14; r 51 -14; f 48 -14; r 62 -14; r 62 -10",
    );
    worked("G0 X20. Z-5.", "G75 X26. I2. F0.05", "f 24 -5; r 23 -5; f 26 -5; r 20 -5");
    worked("G0 X40. Z-5.", "G75 X30. Z-8. I10. K3. F0.1", "f 30 -5; r 40 -5; r 40 -8; f 30 -8; r 40 -8; r 40 -5");
}
