//! `G74` and `G75`.

use super::*;

#[test]
fn pecks_along_z_in_columns() {
    let go = "M3 S500\nG0 X50. Z2.\n";
    moves(
        &a(),
        &format!("{go}G74 R1.\nG74 X32. Z-8. P5000 Q5000 R0.5 F0.1"),
        1,
        "f 50 -3; r 50 -2; f 50 -8; r 50 2;
         r 40 2; f 40 -3; r 40 -2; f 40 -8; r 41 -8; r 41 2;
         r 32 2; f 32 -3; r 32 -2; f 32 -8; r 33 -8; r 33 2; r 50 2",
    );
}

#[test]
fn peck_drilling() {
    // Without X and P; 4 mm each from Z2, the last one what is left.
    let pecks = "f 0 -2; r 0 -1.5; f 0 -6; r 0 -5.5; f 0 -10; r 0 2";
    let go = "M3 S500\nG0 X0 Z2.\n";
    moves(&a(), &format!("{go}G74 R0.5\nG74 Z-10. Q4000 F0.1"), 1, pecks);
    moves(&a(), &format!("{go}G74 R0.5\nG74 W-12. Q4. F0.1"), 1, pecks);
    moves(&system(GCodeSystem::C), &format!("{go}G76 R0.5\nG76 Z-10. Q4000 F0.1"), 1, pecks);
    moves(&system(GCodeSystem::B), &format!("{go}G74 R0.5\nG91 G74 Z-12. Q4000 F0.1"), 1, pecks);
    let mut haas = a();
    haas.drilling.style = crate::DrillingStyle::Haas;
    haas.turning.groove_return_mm = Some(0.5);
    moves(&haas, &format!("{go}G74 Z-10. K4. F0.1"), 1, pecks);
}

#[test]
fn grooves_along_x() {
    let go = "M3 S500\nG0 X62. Z-10.\n";
    // The pecks are on the radius: 31 mm, 28, 25, then 24.
    let passes = "f 56 -10; r 57 -10; f 50 -10; r 51 -10; f 48 -10; r 62 -10;
        r 62 -14; f 56 -14; r 57 -14; f 50 -14; r 51 -14; f 48 -14; r 62 -14;
        r 62 -16; f 56 -16; r 57 -16; f 50 -16; r 51 -16; f 48 -16; r 62 -16; r 62 -10";
    moves(&a(), &format!("{go}G75 R0.5\nG75 X48. Z-16. P3000 Q4000 F0.1"), 1, passes);
    let mut one_line = a();
    one_line.turning.groove_return_mm = Some(0.5);
    moves(&one_line, &format!("{go}G75 X48. Z-16. I3. K4. F0.1"), 1, passes);
    moves(&system(GCodeSystem::C), &format!("{go}G77 R0.5\nG77 X48. Z-16. P3000 Q4000 F0.1"), 1, passes);
    // One groove, in a bore, with what it moves off at the bottom: there is no other column.
    moves(
        &a(),
        "M3 S500\nG0 X20. Z-5.\nG75 R0.2\nG75 X26. P2000 R0.1 F0.05",
        1,
        "f 24 -5; r 23.6 -5; f 26 -5; r 20 -5",
    );
}

#[test]
fn what_a_groove_lacks() {
    let go = "M3 S500\nG0 X62. Z-10.\nG75 R0.5\n";
    assert_eq!(codes(&a(), &format!("{go}G75 X48. Z-16. P3000 F0.1")), ["PRG-TURNING-WORD"]);
    assert_eq!(codes(&a(), &format!("{go}G75 X48. Z-16. Q3000 F0.1")), ["PRG-TURNING-WORD"]);
    assert_eq!(codes(&a(), &format!("{go}G75 X62. P3000 F0.1")), ["PRG-TURNING-START"]);
    assert_eq!(codes(&a(), &format!("{go}G75 X48. P3000 I3. F0.1")), ["PRG-TURNING-FORM"]);
    assert_eq!(codes(&a(), &format!("{go}G75 X48. P-3000 F0.1")), ["PRG-TURNING-VALUE"]);
    assert_eq!(codes(&a(), &format!("{go}G75 X48. Z-500. P1 Q1000 F0.1")), ["PRG-TURNING-LIMIT"]);
    assert_eq!(codes(&a(), "M3 S500\nG0 X62. Z-10.\nG75 X48. P3000 F0.1"), ["PRG-TURNING-DEFAULT"]);
    assert_eq!(codes(&a(), &format!("{go}G75")), ["PRG-TURNING-WORD"]);
}
