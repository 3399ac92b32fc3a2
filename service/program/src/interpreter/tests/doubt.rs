//! Codes that are a cycle on one control and a mode on another: never a move on a guess.

use super::*;

const GO: &str = "M3 S500\nG0 X50. Z2.\n";

/// What a lathe makes of `program` after the rapid to X50 Z2.
#[track_caller]
fn after_go(program: &str, expected: &str) {
    check(&lathe(), &format!("{GO}{program}"), &format!("spindle cw 500\nrapid 0 -> X25 Z2\n{expected}"));
}

#[test]
fn cycles_of_system_a_are_no_moves() {
    for block in [
        "G90 X45. Z-30. F0.2",
        "G90 X45. Z-30. R-2. F0.2",
        "G90 U-5. W-32. F0.2",
        "G94 X10. Z-1. F0.2",
        "X45. Z-30. G90 F0.2",
        "G0 G90 X45. Z-30. F0.2",
        "G1 X45. G94 Z-30. F0.2",
        "N10 G90 G99 X45. Z-30. F0.2",
    ] {
        let column = block.find("G9").map(|at| if block.contains("G90") { block.find("G90").unwrap() } else { at });
        let column = column.unwrap() + 1;
        after_go(block, &format!("! 3:{column}+3 PRG-CODE-AMBIGUOUS"));
        // The blocks behind it are further passes, and no further findings.
        after_go(&format!("{block}\nX40.\nX35. Z-20."), &format!("! 3:{column}+3 PRG-CODE-AMBIGUOUS"));
    }
    after_go("G90 X45. Z-30. F0.2\nX40.\nG0 X60.", "rapid X20 Z-30 -> X30 Z-30\n! 3:1+3 PRG-CODE-AMBIGUOUS");
}

#[test]
fn a_doubtful_code_stays_until_the_next_motion_code() {
    for bare in ["G90", "G94", "G0 G90", "G1 F0.2 G94", "G90 G28 U0", "G90 G4 X1."] {
        let rendered = render(format!("{GO}{bare}\nX45. Z-30. F0.2\nX40.\nM30"), &lathe());
        let findings: Vec<_> = rendered.lines().filter(|line| line.starts_with('!')).collect();
        assert_eq!(findings, ["! 4:1+15 PRG-CODE-AMBIGUOUS"], "{bare}");
        assert!(!rendered.contains("X22.5"), "{bare}: {rendered}");
    }
    after_go("G90\nG0 X45.\nX40.", "rapid X25 Z2 -> X22.5 Z2\nrapid X22.5 Z2 -> X20 Z2");
    after_go("G94 F100\nG1 X45.\nX40.", "line X25 Z2 -> X22.5 Z2 @100/min\nline X22.5 Z2 -> X20 Z2 @100/min");
    // The F of a block that ends a thread's mode is a feed.
    after_go("G32 Z-5. F1.5\nG94 F100\nG1 X60.", "thread X25 Z2 -> X25 Z-5 @1.5\nline X25 Z-5 -> X30 Z-5 @100/min");
}

#[test]
fn what_every_control_reads_alike_is_read() {
    after_go("G90 G0 X45.", "rapid X25 Z2 -> X22.5 Z2");
    after_go("G90 G1 X45. F0.2", "line X25 Z2 -> X22.5 Z2 @0.2/rev");
    after_go("G21 G90 G94 G1 X45. F100", "line X25 Z2 -> X22.5 Z2 @100/min");
    // G91 and G95 are not of system A, so that what follows is not written in it.
    after_go("G91 X-2.\nG90 X45.", "rapid X25 Z2 -> X24 Z2\nrapid X24 Z2 -> X22.5 Z2");
    after_go("G95\nG90 X45.", "rapid X25 Z2 -> X22.5 Z2");
    // G93 says nothing about the system: newer controls have it in each.
    after_go("G93\nG90 X45.", "! 4:1+3 PRG-CODE-AMBIGUOUS");
    // Mills and LinuxCNC have no such cycles.
    for settings in [mill(), linuxcnc()] {
        check(
            &settings,
            "G0 X1\nG90 X2\nX3 G94 F10\nG0 G90 X4\nG21 X5",
            "rapid 0 -> X1\nrapid X1 -> X2\nrapid X2 -> X3\nrapid X3 -> X4\nrapid X4 -> X5",
        );
    }
}

#[test]
fn coordinates_or_a_thread() {
    after_go("G92 X45. Z-30.", "! 3:1+3 PRG-CODE-AMBIGUOUS");
    after_go("G92 X0\nX40.\nX30.", "! 3:1+3 PRG-CODE-AMBIGUOUS");
    // A lead of before does not make a thread of it.
    after_go("G32 Z-5. F1.5\nG92 X45. Z-30.", "thread X25 Z2 -> X25 Z-5 @1.5\n! 4:1+3 PRG-CODE-AMBIGUOUS");
    after_go("G95\nG92 X45. Z-30. F1.5", "! 4:1+3 PRG-CODE-AMBIGUOUS");
}

#[test]
fn units_that_are_cycles_of_system_c() {
    after_go("G21 X45. Z-30. F1.5", "! 3:1+3 PRG-CODE-AMBIGUOUS");
    after_go("G0 G20 X1.", "! 3:4+3 PRG-CODE-AMBIGUOUS");
    after_go("G21\nX45.", "rapid X25 Z2 -> X22.5 Z2");
    after_go("G20 G0 X2.", "rapid X25 Z2 -> X25.4 Z2");
    for cycle in ["G24 X10. Z-1.", "G77 X45. Z-30. F0.2", "G78 X45. Z-30. F1.5", "G79 X10. Z-1."] {
        after_go(cycle, "! 3:1+3 PRG-CODE-AMBIGUOUS");
    }
}

#[test]
fn the_end_of_a_cycle_with_axis_words() {
    for settings in [mill(), linuxcnc()] {
        check(&settings, "G0 X1\nG80 X5\nG80\nG0 X2", "rapid 0 -> X1\nrapid X5 -> X2\n! 2:1+3 PRG-CODE-AMBIGUOUS");
        check(&settings, "G80 G0 X5\nG0 G80 X6", "rapid 0 -> X5\nrapid X5 -> X6");
    }
}
