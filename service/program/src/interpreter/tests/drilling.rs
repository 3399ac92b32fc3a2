//! Drilling, boring and tapping cycles: section 5 of the language page, and its worked examples 2 and 3.

use super::*;
use crate::{BoringShift, DecimalPointRule, DrillingSettings, DrillingStyle, PeckReturn};

/// A mill whose profile states everything.
fn stated() -> LanguageSettings {
    with(DrillingSettings {
        chip_break_retract_mm: Some(1.0),
        peck_clearance_mm: Some(1.0),
        boring_shift: Some(BoringShift::FirstPlus),
        ..DrillingSettings::default()
    })
}

fn with(drilling: DrillingSettings) -> LanguageSettings {
    LanguageSettings { drilling, ..mill() }
}

fn haas() -> LanguageSettings {
    with(DrillingSettings { style: DrillingStyle::Haas, ..stated().drilling })
}

fn turning(lathe_peck: Option<PeckReturn>) -> LanguageSettings {
    LanguageSettings { drilling: DrillingSettings { lathe_peck, ..stated().drilling }, ..lathe() }
}

/// What comes of `program` behind `go`, which moves the tool to Z 10 without a finding.
#[track_caller]
fn drills(settings: &LanguageSettings, program: &str, expected: &str) {
    let go = "M3 S1000\nG0 Z10.\n";
    let before = "spindle cw 1000\nrapid 0 -> Z10\n";
    check(settings, &format!("{go}{program}"), &format!("{before}{expected}"));
}

#[test]
fn worked_example_2_peck_drilling() {
    let program = "G0 X0 Y0 Z10\nG98 G83 X10 Y5 Z-12 R2 Q5 F100";
    let expected = |first: &str, second: &str| {
        format!(
            "rapid 0 -> Z10
             rapid Z10 -> X10 Y5 Z10
             rapid X10 Y5 Z10 -> X10 Y5 Z2
             line X10 Y5 Z2 -> X10 Y5 Z-3 @100/min
             rapid X10 Y5 Z-3 -> X10 Y5 Z2
             rapid X10 Y5 Z2 -> X10 Y5 Z{first}
             line X10 Y5 Z{first} -> X10 Y5 Z-8 @100/min
             rapid X10 Y5 Z-8 -> X10 Y5 Z2
             rapid X10 Y5 Z2 -> X10 Y5 Z{second}
             line X10 Y5 Z{second} -> X10 Y5 Z-12 @100/min
             rapid X10 Y5 Z-12 -> X10 Y5 Z10"
        )
    };
    check(&linuxcnc(), program, &expected("-2.746", "-7.746"));
    check(&stated(), program, &expected("-2", "-7"));
    // Nobody says how far: 1 mm, with an info.
    check(&mill(), program, &format!("{}\ni 2:1+30 PRG-CYCLE-DEFAULT", expected("-2", "-7")));
}

#[test]
fn worked_example_3_incremental_repeats() {
    let expected = "rapid 0 -> Z10
         rapid Z10 -> X10 Y5 Z10
         rapid X10 Y5 Z10 -> X10 Y5 Z2
         line X10 Y5 Z2 -> X10 Y5 Z-1 @100/min
         rapid X10 Y5 Z-1 -> X10 Y5 Z10
         rapid X10 Y5 Z10 -> X20 Y10 Z10
         rapid X20 Y10 Z10 -> X20 Y10 Z2
         line X20 Y10 Z2 -> X20 Y10 Z-1 @100/min
         rapid X20 Y10 Z-1 -> X20 Y10 Z10";
    for settings in [linuxcnc(), haas(), mill()] {
        check(&settings, "G0 Z10\nG91 G98 G81 X10 Y5 Z-3 R-8 L2 F100", expected);
    }
    check(&mill(), "G0 Z10\nG91 G98 G81 X10 Y5 Z-3 R-8 K2 F100", expected);
}

#[test]
fn drilling_with_and_without_a_dwell_to_either_level() {
    drills(
        &mill(),
        "G99 G82 X1 Z-5 R2 P500 F100\nX2\nG81 Y3\nG80\nX5",
        "rapid Z10 -> X1 Z10
         rapid X1 Z10 -> X1 Z2
         line X1 Z2 -> X1 Z-5 @100/min
         dwell 0.5
         rapid X1 Z-5 -> X1 Z2
         rapid X1 Z2 -> X2 Z2
         line X2 Z2 -> X2 Z-5 @100/min
         dwell 0.5
         rapid X2 Z-5 -> X2 Z2
         rapid X2 Z2 -> X2 Y3 Z2
         line X2 Y3 Z2 -> X2 Y3 Z-5 @100/min
         rapid X2 Y3 Z-5 -> X2 Y3 Z2
         rapid X2 Y3 Z2 -> X5 Y3 Z2",
    );
}

#[test]
fn a_block_without_a_place_drills_where_the_tool_is() {
    drills(
        &mill(),
        "G81 Z-5 R2 F100\nF50\nG0 X1",
        "rapid Z10 -> Z2
         line Z2 -> Z-5 @100/min
         rapid Z-5 -> Z10
         rapid Z10 -> X1 Z10",
    );
}

#[test]
fn words_are_stored_without_drilling() {
    for (settings, none) in [(mill(), "K0"), (haas(), "L0")] {
        drills(
            &settings,
            &format!("G81 Z-5 R2 {none} F100\nX1"),
            "rapid Z10 -> X1 Z10
             rapid X1 Z10 -> X1 Z2
             line X1 Z2 -> X1 Z-5 @100/min
             rapid X1 Z-5 -> X1 Z10",
        );
    }
    drills(&linuxcnc(), "G81 X1 Z-5 R2 L0 F100", "! 3:15+2 PRG-CYCLE-VALUE");
}

#[test]
fn every_plane_has_its_axis() {
    check(
        &mill(),
        "G18 G0 Y10\nG81 X1 Z2 Y-5 R3 F100\nG80\nG19 G0 X10\nG81 Y3 Z4 X-1 R2",
        "rapid 0 -> Y10
         rapid Y10 -> X1 Y10 Z2
         rapid X1 Y10 Z2 -> X1 Y3 Z2
         line X1 Y3 Z2 -> X1 Y-5 Z2 @100/min
         rapid X1 Y-5 Z2 -> X1 Y10 Z2
         rapid X1 Y10 Z2 -> X10 Y10 Z2
         rapid X10 Y10 Z2 -> X10 Y3 Z4
         rapid X10 Y3 Z4 -> X2 Y3 Z4
         line X2 Y3 Z4 -> X-1 Y3 Z4 @100/min
         rapid X-1 Y3 Z4 -> X10 Y3 Z4",
    );
}

#[test]
fn chip_breaking() {
    let expected = |d: [&str; 2]| {
        let [first, second] = d;
        format!(
            "rapid Z10 -> Z2
             line Z2 -> Z-3 @100/min
             rapid Z-3 -> Z{first}
             line Z{first} -> Z-8 @100/min
             rapid Z-8 -> Z{second}
             line Z{second} -> Z-12 @100/min
             rapid Z-12 -> Z2"
        )
    };
    drills(&stated(), "G99 G73 X0 Z-12 R2 Q5 F100", &expected(["-2", "-7"]));
    drills(&linuxcnc(), "G99 G73 X0 Z-12 R2 Q5 F100", &expected(["-2.746", "-7.746"]));
    // Haas: out of the hole after each K.
    drills(
        &haas(),
        "G99 G73 X0 Z-13 R2 Q5 K10 F100",
        "rapid Z10 -> Z2
         line Z2 -> Z-3 @100/min
         rapid Z-3 -> Z-2
         line Z-2 -> Z-8 @100/min
         rapid Z-8 -> Z2
         rapid Z2 -> Z-7
         line Z-7 -> Z-13 @100/min
         rapid Z-13 -> Z2",
    );
}

#[test]
fn pecks_of_haas_get_smaller() {
    let settings = with(DrillingSettings { peck_lift_mm: 0.5, ..haas().drilling });
    drills(
        &settings,
        "G99 G83 X0 Z-10 R2 I5 J2 K2 F100",
        "rapid Z10 -> Z2
         line Z2 -> Z-3 @100/min
         rapid Z-3 -> Z2.5
         rapid Z2.5 -> Z-2
         line Z-2 -> Z-6 @100/min
         rapid Z-6 -> Z2.5
         rapid Z2.5 -> Z-5
         line Z-5 -> Z-8 @100/min
         rapid Z-8 -> Z2.5
         rapid Z2.5 -> Z-7
         line Z-7 -> Z-10 @100/min
         rapid Z-10 -> Z2",
    );
}

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

#[test]
fn boring() {
    drills(
        &mill(),
        "G85 X0 Z-8 R2 F100\nG89 X1 P100",
        "rapid Z10 -> Z2
         line Z2 -> Z-8 @100/min
         line Z-8 -> Z2 @100/min
         rapid Z2 -> Z10
         rapid Z10 -> X1 Z10
         rapid X1 Z10 -> X1 Z2
         line X1 Z2 -> X1 Z-8 @100/min
         dwell 0.1
         line X1 Z-8 -> X1 Z2 @100/min
         rapid X1 Z2 -> X1 Z10",
    );
    drills(
        &linuxcnc(),
        "G98 G85 X0 Z-8 R2 F100\nG89 X0 Z-8 R2 P0.1",
        "rapid Z10 -> Z2
         line Z2 -> Z-8 @100/min
         line Z-8 -> Z2 @100/min
         rapid Z2 -> Z10
         rapid Z10 -> Z2
         line Z2 -> Z-8 @100/min
         dwell 0.1
         line Z-8 -> Z10 @100/min",
    );
    drills(
        &mill(),
        "G86 X0 Z-8 R2 P100 F100",
        "rapid Z10 -> Z2
         line Z2 -> Z-8 @100/min
         dwell 0.1
         spindle off 1000
         rapid Z-8 -> Z10
         spindle cw 1000",
    );
}

#[test]
fn boring_with_an_oriented_tool() {
    let fine = "rapid Z10 -> Z2
         line Z2 -> Z-8 @100/min
         spindle off 1000
         M19 Barrier
         rapid Z-8 -> X0.5 Z-8
         rapid X0.5 Z-8 -> X0.5 Z10
         rapid X0.5 Z10 -> Z10
         spindle cw 1000";
    drills(&stated(), "G76 X0 Z-8 R2 Q0.5 F100", fine);
    drills(&mill(), "G76 X0 Z-8 R2 I0.5 F100", fine);
    drills(&mill(), "G76 X0 Z-8 R2 Q0.5 F100", "! 3:1+23 PRG-CYCLE-SETTING");
    drills(
        &stated(),
        "G87 X0 Z-15 R-20 Q0.5 F100",
        "spindle off 1000
         M19 Barrier
         rapid Z10 -> X0.5 Z10
         rapid X0.5 Z10 -> X0.5 Z-20
         rapid X0.5 Z-20 -> Z-20
         spindle cw 1000
         line Z-20 -> Z-15 @100/min
         spindle off 1000
         M19 Barrier
         rapid Z-15 -> X0.5 Z-15
         rapid X0.5 Z-15 -> X0.5 Z10
         rapid X0.5 Z10 -> Z10
         spindle cw 1000",
    );
    drills(&stated(), "G99 G87 X0 Z-15 R-20 Q0.5 F100", "! 3:1+30 PRG-CYCLE-UNDEFINED");
}

#[test]
fn the_return_level_changes_within_the_mode() {
    // Settled by an experiment: LinuxCNC goes up on a slant.
    drills(
        &linuxcnc(),
        "G99 G81 X0 Z-5 R2 F100\nG98 X5",
        "rapid Z10 -> Z2
         line Z2 -> Z-5 @100/min
         rapid Z-5 -> Z2
         rapid Z2 -> X5 Z10
         rapid X5 Z10 -> X5 Z2
         line X5 Z2 -> X5 Z-5 @100/min
         rapid X5 Z-5 -> X5 Z10
         w 4:1+6 PRG-CYCLE-RETURN",
    );
    drills(
        &mill(),
        "G99 G81 X0 Z-5 R2 F100\nG98 X5",
        "rapid Z10 -> Z2
         line Z2 -> Z-5 @100/min
         rapid Z-5 -> Z2
         rapid Z2 -> X5 Z2
         line X5 Z2 -> X5 Z-5 @100/min
         rapid X5 Z-5 -> X5 Z10
         w 4:1+6 PRG-CYCLE-RETURN",
    );
}

#[test]
fn saved_modes_have_the_return_level() {
    drills(
        &linuxcnc(),
        "G98\nM70\nG99\nM72\nG81 X0 Z-5 R2 F100",
        "rapid Z10 -> Z2
         line Z2 -> Z-5 @100/min
         rapid Z-5 -> Z10",
    );
}

#[test]
fn a_start_below_the_r_level() {
    let program = "G0 Z1\nG81 X5 Z-5 R2 F100";
    check(
        &linuxcnc(),
        program,
        "rapid 0 -> Z1
         rapid Z1 -> Z2
         rapid Z2 -> X5 Z2
         line X5 Z2 -> X5 Z-5 @100/min
         rapid X5 Z-5 -> X5 Z2",
    );
    check(&mill(), program, "rapid 0 -> Z1\n! 2:1+18 PRG-CYCLE-LEVEL");
}

#[test]
fn linuxcnc_needs_r_and_z_again() {
    drills(
        &linuxcnc(),
        "G98 G81 X0 Z-5 R2 F100\nG82 X1 P1",
        "rapid Z10 -> Z2
         line Z2 -> Z-5 @100/min
         rapid Z-5 -> Z10
         ! 4:1+9 PRG-CYCLE-WORD
         ! 4:1+9 PRG-CYCLE-WORD",
    );
    drills(
        &linuxcnc(),
        "G98 G81 X0 Z-5 R2 F100\nG0 X1\nG81 X2",
        "rapid Z10 -> Z2
         line Z2 -> Z-5 @100/min
         rapid Z-5 -> Z10
         rapid Z10 -> X1 Z10
         ! 5:1+6 PRG-CYCLE-WORD
         ! 5:1+6 PRG-CYCLE-WORD",
    );
    drills(&linuxcnc(), "G82 X0 Z-5 R2 F100", "! 3:1+18 PRG-CYCLE-WORD");
    drills(&linuxcnc(), "G81 R2 F100", "! 3:1+11 PRG-CYCLE-WORD");
}

#[test]
fn the_return_level_at_the_start_of_a_program() {
    // LinuxCNC starts in G99, checked with rs274; FANUC in G98.
    for (settings, level) in [(linuxcnc(), 2), (mill(), 10)] {
        let expected = format!("rapid Z10 -> Z2\nline Z2 -> Z-5 @100/min\nrapid Z-5 -> Z{level}");
        drills(&settings, "G81 X0 Z-5 R2 F100", &expected);
    }
}

#[test]
fn linuxcnc_ignores_g80_beside_a_cycle() {
    // Checked with rs274: R and Z stay.
    drills(
        &linuxcnc(),
        "G98 G81 X1 Z-5 R2 F100\nG80 G81 X2",
        "rapid Z10 -> X1 Z10
         rapid X1 Z10 -> X1 Z2
         line X1 Z2 -> X1 Z-5 @100/min
         rapid X1 Z-5 -> X1 Z10
         rapid X1 Z10 -> X2 Z10
         rapid X2 Z10 -> X2 Z2
         line X2 Z2 -> X2 Z-5 @100/min
         rapid X2 Z-5 -> X2 Z10",
    );
}

#[test]
fn linuxcnc_reads_its_words_by_the_present_modes() {
    // Checked with rs274: the level of the start stays in another plane, and G91 makes distances of R and Z.
    drills(
        &linuxcnc(),
        "G98 G81 X1 Z-5 R2 F100\nG18 X2 Y-5",
        "rapid Z10 -> X1 Z10
         rapid X1 Z10 -> X1 Z2
         line X1 Z2 -> X1 Z-5 @100/min
         rapid X1 Z-5 -> X1 Z10
         rapid X1 Z10 -> X2 Y10 Z10
         rapid X2 Y10 Z10 -> X2 Y2 Z10
         line X2 Y2 Z10 -> X2 Y-5 Z10 @100/min
         rapid X2 Y-5 Z10 -> X2 Y10 Z10",
    );
    drills(
        &linuxcnc(),
        "G91 G98 G81 X1 Z-3 R-8 F100\nG90 X0",
        "rapid Z10 -> X1 Z10
         rapid X1 Z10 -> X1 Z2
         line X1 Z2 -> X1 Z-1 @100/min
         rapid X1 Z-1 -> X1 Z10
         ! 4:1+6 PRG-CYCLE-LEVEL",
    );
    // Pecks smaller than the retract go above the R level.
    drills(
        &linuxcnc(),
        "G99 G73 X0 Z1.85 R2 Q0.1 F100",
        "rapid Z10 -> Z2
         line Z2 -> Z1.9 @100/min
         rapid Z1.9 -> Z2.154
         line Z2.154 -> Z1.85 @100/min
         rapid Z1.85 -> Z2",
    );
}

#[test]
fn fanuc_forgets_with_the_mode() {
    let drilled = "rapid Z10 -> Z2
         line Z2 -> Z-5 @100/min
         rapid Z-5 -> Z10";
    let missing = |line: u32| format!("{drilled}\n! {line}:1+6 PRG-CYCLE-WORD\n! {line}:1+6 PRG-CYCLE-WORD");
    drills(&mill(), "G81 X0 Z-5 R2 F100\nG80\nG81 X2", &missing(5));
    drills(&mill(), "G81 X0 Z-5 R2 F100\nG1\nG81 X2", &missing(5));
}

#[test]
fn g80_and_axis_words() {
    drills(&linuxcnc(), "G80 X1", "! 3:1+3 PRG-CODE-AMBIGUOUS");
    drills(&linuxcnc(), "G80\nX1", "! 4:1+2 PRG-MOTION-MISSING");
    drills(&linuxcnc(), "G80 G0 X1", "rapid Z10 -> X1 Z10");
    drills(&mill(), "G80 X1", "! 3:1+3 PRG-CODE-AMBIGUOUS");
    drills(&mill(), "G80 G0 X1", "rapid Z10 -> X1 Z10");
}

#[test]
fn refusals() {
    for (settings, program, expected) in [
        (mill(), "G81 X0 Z-5 R-8 F100", "! 3:1+19 PRG-CYCLE-LEVEL"),
        (linuxcnc(), "G81 X0 Z-5 R-8 F100", "! 3:1+19 PRG-CYCLE-LEVEL"),
        (mill(), "G81 X0 Z-5 R2", "! 3:1+13 PRG-FEED-MISSING"),
        (mill(), "G93 G81 X0 Z-5 R2 F1", "! 3:1+20 PRG-CYCLE-FEED"),
        (mill(), "G83 X0 Z-5 R2 F100", "! 3:1+18 PRG-CYCLE-WORD"),
        (mill(), "G83 X0 Z-5 R2 Q0 F100", "! 3:15+2 PRG-CYCLE-VALUE"),
        (mill(), "G82 X0 Z-5 R2 P-1 F100", "! 3:15+3 PRG-CYCLE-VALUE"),
        (mill(), "G81 X0 Z-5 R2 Q5 F100", "! 3:15+2 PRG-WORD-UNUSED"),
        (mill(), "G81 X0 Z-5 R2 K20000 F100", "! 3:1+25 PRG-CYCLE-VALUE"),
        (mill(), "G83 X0 Z-5 R2 Q0.0001 F100", "! 3:1+26 PRG-CYCLE-VALUE"),
        (mill(), "G81 X0 U1 Z-5 R2 F100", "! 3:8+2 PRG-CYCLE-AXIS"),
        (linuxcnc(), "G81 X0 A1 Z-5 R2 F100", "! 3:8+2 PRG-CYCLE-AXIS"),
        (linuxcnc(), "G83 X0 Z-5 R2 Q1 D1 F100", "! 3:18+2 PRG-WORD-UNUSED"),
        (mill(), "G88 X0 Z-5 R2 P1 F100", "! 3:1+21 PRG-CYCLE-UNDEFINED"),
        (linuxcnc(), "G88 X0 Z-5 R2 P1 F100", "! 3:1+21 PRG-CYCLE-UNDEFINED"),
        (linuxcnc(), "G87 X0 Z-5 R2 I1 J1 K1 F100", "! 3:1+27 PRG-CYCLE-UNDEFINED"),
        (mill(), "G74 X0 Z-5 R2 F100", "! 3:1+18 PRG-CYCLE-SPINDLE"),
        (linuxcnc(), "G74 X0 Z-5 R2 F100", "! 3:1+18 PRG-CYCLE-SPINDLE"),
        (mill(), "M29\nG84 X0 Z-5 R2 Q2 F100", "M29 Barrier\n! 4:1+21 PRG-CYCLE-SETTING"),
        (mill(), "G81 X0 Z-5 R2 K2 L2 F100", "! 3:18+2 PRG-WORD-CONFLICT"),
    ] {
        drills(&settings, program, expected);
    }
    check(&mill(), "G0 Z10\nG84 X0 Z-5 R2 F100", "rapid 0 -> Z10\n! 2:1+18 PRG-CYCLE-SPINDLE");
    drills(&mill(), "G81 Z-5 R2 K0 F100\nG53 X1", "! 4:1+6 PRG-MACHINE-MOTION");
}

#[test]
fn blocks_after_a_refused_cycle_say_nothing_more() {
    drills(&linuxcnc(), "G88 X0 Z-5 R2 P1 F100\nX1\nX2\nG0 X3", "rapid X2 Z-5 -> X3 Z-5\n! 3:1+21 PRG-CYCLE-UNDEFINED");
}

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

#[test]
fn inches_and_least_increments() {
    let settings = LanguageSettings { decimal_point: DecimalPointRule::LeastIncrement, ..stated() };
    drills(
        &settings,
        "G99 G83 X1000 Z-6000 R2000 Q5000 F100",
        "rapid Z10 -> X1 Z10
         rapid X1 Z10 -> X1 Z2
         line X1 Z2 -> X1 Z-3 @100/min
         rapid X1 Z-3 -> X1 Z2
         rapid X1 Z2 -> X1 Z-2
         line X1 Z-2 -> X1 Z-6 @100/min
         rapid X1 Z-6 -> X1 Z2",
    );
    check(
        &linuxcnc(),
        "G20\nM3 S100 G0 Z1\nG99 G73 X0 Z-0.3 R0.1 Q0.2 F10",
        "spindle cw 100
         rapid 0 -> Z25.4
         rapid Z25.4 -> Z2.54
         line Z2.54 -> Z-2.54 @254/min
         rapid Z-2.54 -> Z-2.286
         line Z-2.286 -> Z-7.62 @254/min
         rapid Z-7.62 -> Z2.54",
    );
}

#[test]
fn moves_go_through_every_point() {
    let (operations, _) = interpret(b"G64 P0.1\nM3 S1000 G0 Z10\nG85 X0 Z-5 R2 F100\nG1 X5\nM30\n", mill());
    let controls: Vec<_> = operations
        .iter()
        .filter_map(|operation| match &operation.kind {
            OperationKind::Move(step) if operation.span.line >= 3 => Some(step.path_control),
            _ => None,
        })
        .collect();
    let modal = crate::PathControl::Continuous { tolerance_mm: 0.1, merge_tolerance_mm: 0.1 };
    assert_eq!(controls.len(), 5, "{operations:?}");
    assert!(controls[..4].iter().all(|control| *control == crate::PathControl::ExactPath));
    assert_eq!(controls[4], modal);
}

#[test]
fn moves_say_which_cycle_they_belong_to() {
    let called = |settings: LanguageSettings, program: &str| -> Vec<(u32, Option<(&'static str, u32)>)> {
        let (operations, findings) = interpret(program.as_bytes(), settings);
        assert!(!findings.has_errors(), "{findings:?}");
        let moves = operations.iter().filter_map(|operation| match &operation.kind {
            OperationKind::Move(step) => Some((operation.span.line, step.cycle)),
            _ => None,
        });
        let mut called: Vec<_> =
            moves.map(|(line, cycle)| (line, cycle.map(|cycle| (cycle.code(), cycle.line)))).collect();
        called.dedup();
        called
    };
    let program = "G0 Z10\nG98 G83 X1 Y1 Z-4 R2 Q3 F100\nX2\nG81\nX3\nG80\nG1 X5\nM30\n";
    let (peck, drill) = (Some(("G83", 2)), Some(("G81", 4)));
    assert_eq!(called(stated(), program), [(1, None), (2, peck), (3, peck), (5, drill), (7, None)]);
    // The code as written, whatever the control means by it.
    let program = "M3 S500\nG0 X50 Z10\nG87 X20 Z5 R-5 F0.1\nG80\nM30\n";
    assert_eq!(called(turning(None), program), [(2, None), (3, Some(("G87", 3)))]);
}
