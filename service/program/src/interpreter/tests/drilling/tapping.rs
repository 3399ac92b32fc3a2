//! Tapping: with a feed, rigid, and `G33.1`.

use super::*;

#[test]
fn tapping_with_a_feed() {
    let out = |level: &str| {
        format!(
            "rapid Z10 -> Z2
             line Z2 -> Z-8 @1500/min
             spindle ccw 1000
             dwell 0.2
             line Z-8 -> Z{level} @1500/min
             spindle cw 1000"
        )
    };
    drills(&mill(), "G84 X0 Z-8 R2 P200 F1500", &format!("{}\nrapid Z2 -> Z10", out("2")));
    // LinuxCNC feeds all the way.
    drills(&linuxcnc(), "G98 G84 X0 Z-8 R2 P0.2 F1500", &out("10"));
    drills(&linuxcnc(), "G99 G84 X0 Z-8 R2 P0.2 F1500", &out("2"));
    check(
        &linuxcnc(),
        "M4 S500 G0 Z10\nG98 G74 X0 Z-8 R2 F750",
        "spindle ccw 500
         rapid 0 -> Z10
         rapid Z10 -> Z2
         line Z2 -> Z-8 @750/min
         spindle cw 500
         line Z-8 -> Z10 @750/min
         spindle ccw 500",
    );
}

#[test]
fn rigid_tapping() {
    let expected = "spindle off 800
         rapid Z10 -> X5 Z10
         rapid X5 Z10 -> X5 Z2
         tap X5 Z2 -> X5 Z-8 @1.25 cw 800
         tap X5 Z-8 -> X5 Z2 @1.25 ccw 800
         rapid X5 Z2 -> X5 Z10";
    let holes = |f: &str, expected: &str| {
        drills(&mill(), &format!("M29 S800\n{f}\nG80"), &format!("spindle cw 800\nM29 Barrier\n{expected}"));
    };
    holes("G84 X5 Z-8 R2 F1000", expected);
    holes("G95 G84 X5 Z-8 R2 F1.25", expected);
    let left = expected.replace("@1.25 cw", "@1.25 ?").replace("@1.25 ccw", "@1.25 cw").replace('?', "ccw");
    holes("G74 X5 Z-8 R2 F1000", &left);
    // A setting of the profile, with pecks that go back by 1 mm, and a spindle that never started.
    let settings =
        with(DrillingSettings { rigid_tapping: true, tap_peck: Some(PeckReturn::Back), ..stated().drilling });
    check(
        &settings,
        "G95 S500 G0 Z10\nG99 G84 X0 Z-8 R2 Q6 F1",
        "rapid 0 -> Z10
         rapid Z10 -> Z2
         tap Z2 -> Z-4 @1 cw 500
         tap Z-4 -> Z-3 @1 ccw 500
         tap Z-3 -> Z-8 @1 cw 500
         tap Z-8 -> Z2 @1 ccw 500",
    );
}

#[test]
fn g33_1_goes_in_and_out_with_the_spindle() {
    drills(
        &linuxcnc(),
        "G33.1 Z-8 K1.25\nG33.1 Z-8 K1.25 I2",
        "tap Z10 -> Z-8 @1.25 cw 1000
         tap Z-8 -> Z10 @1.25 ccw 1000
         tap Z10 -> Z-8 @1.25 cw 1000
         tap Z-8 -> Z10 @1.25 ccw 2000",
    );
    drills(&linuxcnc(), "G33.1 Z-8 K1 F10", "! 3:14+3 PRG-WORD-CONFLICT");
    drills(&linuxcnc(), "G33.1 Z10 K1", "");
    drills(&linuxcnc(), "G33.1 Z-8", "! 3:1+9 PRG-CYCLE-WORD");
    check(&linuxcnc(), "G33.1 Z-8 K1", "! 1:1+12 PRG-SPINDLE-STOPPED");
}

/// Under `G96` the S of `M29` is a surface speed, so that it is no cure.
#[test]
fn a_rigid_tap_under_surface_speed_asks_for_a_constant_one() {
    let (_, findings) = interpret(b"G96 S100 M3\nG0 Z10\nM29 S400\nG84 X5 Z-8 R2 F1000\nM30\n", mill());
    let found = findings.findings().iter().find(|it| it.code.name() == "PRG-CYCLE-SPINDLE");
    assert!(found.is_some_and(|it| it.suggestions[0].message.contains("G97")), "{findings:?}");
}
