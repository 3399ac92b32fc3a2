//! The order in which the words of one block take effect, in every dialect.

use super::*;

#[test]
fn the_unit_and_the_feed() {
    // FANUC and Haas: 6 inch/min. LinuxCNC: 6 mm/min, as its interpreter reads F before G20; X is in inches in either.
    check(&mill(), "G20 G1 X1 F6", "line 0 -> X25.4 @152.4/min\nw 1:1+3 PRG-UNIT-WITH-FEED");
    check(&linuxcnc(), "G20 G1 X1 F6", "line 0 -> X25.4 @6/min\nw 1:1+3 PRG-UNIT-WITH-FEED");
    check(&lathe(), "M3 S100\nG20 G1 Z1 F.1", "spindle cw 100\nline 0 -> Z25.4 @2.54/rev\nw 2:1+3 PRG-UNIT-WITH-FEED");
    check(&linuxcnc(), "G20\nG21 F6 G1 X1", "line 0 -> X1 @152.4/min\nw 2:1+3 PRG-UNIT-WITH-FEED");
    // No change of the unit, no two readings; and in the next block they agree.
    for settings in [mill(), linuxcnc()] {
        check(&settings, "G21 G1 X1 F6\nG20\nX2 F6", "line 0 -> X1 @6/min\nline X1 -> X50.8 @152.4/min");
        // The feed stays what it is when the unit changes.
        check(&settings, "F60\nG20\nG1 X1", "line 0 -> X25.4 @60/min");
        // Lengths of a machining function are in the unit of its block.
        check(&settings, "G20 G200 F10 A.01", "PathVibration on F10 A0.254");
    }
}

#[test]
fn the_unit_and_the_surface_speed() {
    check(&mill(), "G92 S3000\nG20 G96 S100 M3", "spindle cw 30.48 m/min max 3000");
    check(&lathe(), "G50 S3000\nG20 G96 S100 M3", "spindle cw 30.48 m/min max 3000");
    check(&linuxcnc(), "G20 G96 S100 M3", "spindle cw 100 m/min max inf\nw 1:5+3 PRG-SPEED-CLAMP-MISSING");
}

#[test]
fn the_feed_mode_and_the_feed() {
    for settings in [mill(), linuxcnc()] {
        check(&settings, "F2 G1 X1 G93", "line 0 -> X1 @1/2");
        check(
            &settings,
            "M3 S100\nX1 F.1 G95 G1\nF50 X2 G94",
            "spindle cw 100\nline 0 -> X1 @0.1/rev\nline X1 -> X2 @50/min",
        );
    }
    check(
        &lathe(),
        "X2 G98 F50 G1\nM3 S100\nF.1 G99 X4",
        "line 0 -> X1 @50/min\nspindle cw 100\nline X1 -> X2 @0.1/rev",
    );
    // LinuxCNC: each of these words asks for a feed anew.
    check(&mill(), "G1 X1 F10\nG94 X2", "line 0 -> X1 @10/min\nline X1 -> X2 @10/min");
    check(
        &linuxcnc(),
        "G1 X1 F10\nG94 X2\nG94 F5 X3",
        "line 0 -> X1 @10/min\nline X2 -> X3 @5/min\n! 2:1+6 PRG-FEED-MISSING",
    );
}

#[test]
fn the_speed_mode_and_the_speed() {
    for settings in [lathe(), mill()] {
        check(&settings, "G92 S2000\nS180 M3 G96\nS600 G97", "spindle cw 180 m/min max 2000\nspindle cw 600");
    }
    check(&linuxcnc(), "S180 G97 M3\nS600 G97", "spindle cw 180\nspindle cw 600");
}

#[test]
fn tools_and_their_length() {
    for settings in [mill(), linuxcnc()] {
        check(&settings, "G0 G43 Z10 H1 M6 T1\nG1 X1 F5", "tool 1.0\nrapid Z-100 -> Z10\nline Z10 -> X1 Z10 @5/min");
    }
    check(&lathe(), "G0 X10 T0203", "tool 2.3\nrapid 0 -> X5");
}

#[test]
fn starts_before_the_motion_and_stops_behind_it() {
    for settings in [lathe(), mill()] {
        check(
            &settings,
            "G94 G1 Z1 F10 S100 M3 M8\nZ2 M5 M9\nZ3",
            "spindle cw 100
             coolant mist false flood true
             line 0 -> Z1 @10/min
             line Z1 -> Z2 @10/min
             spindle off 100
             coolant mist false flood false
             line Z2 -> Z3 @10/min",
        );
    }
    check(
        &linuxcnc(),
        "G94 G1 Z1 F10 S100 M3 M8\nZ2 M5 M9\nZ3",
        "spindle cw 100
         coolant mist false flood true
         line 0 -> Z1 @10/min
         spindle off 100
         coolant mist false flood false
         line Z1 -> Z2 @10/min
         line Z2 -> Z3 @10/min",
    );
    // A cut per revolution that ends with M5 still turns on a FANUC control, and cannot in LinuxCNC.
    check(&mill(), "S100 M3\nG95 G1 X1 F.1 M5", "spindle cw 100\nline 0 -> X1 @0.1/rev\nspindle off 100");
    check(&linuxcnc(), "S100 M3\nG95 G1 X1 F.1 M5", "spindle cw 100\n! 2:1+16 PRG-SPINDLE-STOPPED");
}

#[test]
fn dwell_modes_offsets_and_motion() {
    let with_offset = |mut settings: LanguageSettings| {
        settings.work_offsets[1][0] = 100.0;
        settings
    };
    for settings in [mill(), linuxcnc(), lathe()].map(with_offset) {
        let settings = LanguageSettings { x_word: crate::XWord::Radius, ..settings };
        // Whatever their order, offset and distance mode hold for the motion of their block.
        check(&settings, "G0 X5 G55\nX1 G91\nG0 X1", "rapid X-100 -> X5\nrapid X5 -> X6\nrapid X6 -> X7");
        check(
            &settings,
            "G94 G1 X5 F10 G18\nG2 X2 I1 G17 G91",
            "line 0 -> X5 @10/min\narc X5 -> X7 about 6,0 by -180 @10/min",
        );
        check(&settings, "G0 X1 M0", "rapid 0 -> X1\nstop false");
        // The words of G4 are its own on FANUC and Haas controls; in LinuxCNC the motion in force follows it.
        let behind = match settings.dialect {
            crate::DialectName::LinuxCnc => "dwell 2\nrapid X1 -> X1 Y5",
            _ => "! 2:7+2 PRG-WORD-UNUSED",
        };
        check(&settings, "G0 X1\nG4 P2 Y5", &format!("rapid 0 -> X1\n{behind}"));
    }
}

#[test]
fn linuxcnc_has_codes_of_its_own() {
    check(&linuxcnc(), "G8 G0 X1\nG7\nX4", "rapid 0 -> X1\nrapid X1 -> X2");
    let diameters = LanguageSettings { x_word: crate::XWord::Diameter, ..linuxcnc() };
    check(&diameters, "G7 G0 X2\nG8 X3", "rapid 0 -> X1\nrapid X1 -> X3");
    check(&linuxcnc(), "G4 P1.5\nG0 X1 G91.1 G90", "dwell 1.5\nrapid 0 -> X1");
    check(&linuxcnc(), "G32 Z-5 F1", "! 1:1+3 PRG-UNKNOWN-CODE");
    check(&linuxcnc(), "M3 S100\nG33 Z-5 K1.5", "spindle cw 100\nthread 0 -> Z-5 @1.5");
    // F is a feed there, never a lead.
    check(&linuxcnc(), "M3 S100\nG33 Z-5 F1.5", "spindle cw 100\n! 2:9+4 PRG-WORD-CONFLICT");
    check(&linuxcnc(), "M3 S100 F20\nG33 Z-5", "spindle cw 100\n! 2:1+7 PRG-THREAD-LEAD-MISSING");
    check(
        &linuxcnc(),
        "M3 S100 F20\nG33 Z-5 K1.5\nG1 X1",
        "spindle cw 100\nthread 0 -> Z-5 @1.5\nline Z-5 -> X1 Z-5 @20/min",
    );
    check(&linuxcnc(), "M3 S100\nG18 G76 X18 Z-5 I1 K1 D300 F2 A60", "spindle cw 100\n! 2:1+33 PRG-THREAD-CYCLE-FORM");
}
