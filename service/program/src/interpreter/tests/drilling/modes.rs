//! What stays in force between the blocks of a cycle, and what ends it.

use super::*;

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

/// On Haas controls, and where R is a distance; elsewhere controls differ.
#[test]
fn without_r_the_tool_feeds_from_the_level_of_its_start() {
    let expected = "line Z10 -> Z-5 @100/min\nrapid Z-5 -> Z10\nrapid Z10 -> X2 Z10\nline X2 Z10 -> X2 Z-5 @100/min\n\
                    rapid X2 Z-5 -> X2 Z10\ni 3:1+16 PRG-CYCLE-NO-R";
    drills(&haas(), "G81 X0 Z-5. F100\nX2.", expected);
    let expected = "line Z10 -> Z-5 @100/min\nrapid Z-5 -> Z10\ni 3:1+21 PRG-CYCLE-NO-R";
    for settings in [mill(), haas()] {
        drills(&settings, "G91 G81 X0 Z-15. F100", expected);
    }
    for settings in [mill(), linuxcnc()] {
        drills(&settings, "G81 X0 Z-5. F100", "! 3:1+16 PRG-CYCLE-WORD");
    }
}
