//! Drilling on lathes, along Z and along X.

use super::*;

#[test]
fn fanuc_lathe_along_z_and_along_x() {
    // R is a distance from the level of the start.
    check(
        &turning(Some(PeckReturn::RLevel)),
        "M3 S1000\nG0 X0 Z5.\nG83 Z-12. R-3. Q5000 F0.1\nG80\nG0 X20.",
        "spindle cw 1000
         rapid 0 -> Z5
         rapid Z5 -> Z2
         line Z2 -> Z-3 @0.1/rev
         rapid Z-3 -> Z2
         rapid Z2 -> Z-2
         line Z-2 -> Z-8 @0.1/rev
         rapid Z-8 -> Z2
         rapid Z2 -> Z-7
         line Z-7 -> Z-12 @0.1/rev
         rapid Z-12 -> Z5
         rapid Z5 -> X10 Z5",
    );
    check(
        &turning(Some(PeckReturn::Back)),
        "M3 S1000\nG0 X0 Z5.\nG83 W-10. R-3. Q5000 F0.1",
        "spindle cw 1000
         rapid 0 -> Z5
         rapid Z5 -> Z2
         line Z2 -> Z-3 @0.1/rev
         rapid Z-3 -> Z-2
         line Z-2 -> Z-8 @0.1/rev
         rapid Z-8 -> Z5",
    );
    check(
        &turning(None),
        "M3 S1000\nG0 X50. Z-20.\nG89 X30. R-5. P100 F0.1\nG87 Z-30. C90.",
        "spindle cw 1000
         rapid 0 -> X25 Z-20
         rapid X25 Z-20 -> X20 Z-20
         line X20 Z-20 -> X15 Z-20 @0.1/rev
         dwell 0.1
         line X15 Z-20 -> X20 Z-20 @0.1/rev
         rapid X20 Z-20 -> X25 Z-20
         rapid X25 Z-20 -> X25 Z-30 C90
         rapid X25 Z-30 C90 -> X20 Z-30 C90
         line X20 Z-30 C90 -> X15 Z-30 C90 @0.1/rev
         dwell 0.1
         rapid X15 Z-30 C90 -> X25 Z-30 C90",
    );
    let go = "M3 S1000\nG0 X0 Z5.\n";
    let went = "spindle cw 1000\nrapid 0 -> Z5\n";
    for (program, expected) in [
        ("G83 Z-12. R-3. Q5000 F0.1", "! 3:1+25 PRG-CYCLE-SETTING"),
        ("G81 Z-12. R-3. F0.1", "! 3:1+19 PRG-CYCLE-UNDEFINED"),
    ] {
        check(&turning(None), &format!("{go}{program}"), &format!("{went}{expected}"));
    }
}

#[test]
fn a_haas_lathe_drills_as_a_mill() {
    let settings = LanguageSettings { drilling: haas().drilling, ..lathe() };
    check(
        &settings,
        "M3 S1000\nG0 X0 Z5.\nG83 Z-6. R2. Q5. F0.1\nG81 Z-5. R2.",
        "spindle cw 1000
         rapid 0 -> Z5
         rapid Z5 -> Z2
         line Z2 -> Z-3 @0.1/rev
         rapid Z-3 -> Z2
         rapid Z2 -> Z-2
         line Z-2 -> Z-6 @0.1/rev
         rapid Z-6 -> Z5
         rapid Z5 -> Z2
         line Z2 -> Z-5 @0.1/rev
         rapid Z-5 -> Z5",
    );
}
