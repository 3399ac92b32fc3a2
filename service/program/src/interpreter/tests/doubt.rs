//! Codes that are a cycle on one control and a mode on another: never a move on a guess.

use super::*;
use crate::GCodeSystem;

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

/// The units of a lathe change every length, so that leaving their code out is no cure.
#[test]
fn the_cure_of_a_unit_keeps_the_unit() {
    let cures = |block: &str| {
        let (_, findings) = interpret(format!("{GO}{block}\nM30\n").as_bytes(), lathe());
        findings.findings()[0].suggestions[0].message.clone()
    };
    for code in ["G20", "G21"] {
        let cure = format!(
            "for a move, write its motion code behind {code}, such as {code} G1, or write {code} in a block of its own before this one"
        );
        assert_eq!(cures(&format!("{code} X1. Z.5")), cure);
    }
    assert!(cures("G90 X45. Z-30.").ends_with("or leave G90 out in G-code system A"));
}

/// What one system reads otherwise is carried out once a code has shown the system, and refused as long as none has.
#[test]
fn return_levels_once_a_code_rules_out_system_a() {
    let b = LanguageSettings { g_code_system: Some(GCodeSystem::B), ..lathe() };
    for holes in [
        "G95\nG99 G85 Z-20. R1. F.1\nG80",
        "G95\nG98 G85 Z-20. R1. F.1\nG80",
        "G91 G1 Z-1. F.2\nG90\nG94\nG99 G85 Z-20. R0 F100\nG80",
        "G90 G95 G99 G1 X40. F.2",
        "G95 G98 G1 X40. F.2",
    ] {
        let program = format!("{GO}{holes}\nM30\n");
        let found = render(program.clone(), &lathe());
        assert!(!found.contains("PRG"), "{found}");
        assert_eq!(found, render(program, &b), "{holes}");
    }
}

#[test]
fn the_words_of_system_a_are_refused_once_a_code_rules_it_out() {
    for (word, span) in [
        ("G1 U-5. F.2", "4:4+4"),
        ("G28 U0 W0", "4:5+2"),
        ("G50 S800", "4:1+3"),
        ("G32 Z-5. F2.", "4:1+3"),
        ("G0 H90.", "4:4+4"),
    ] {
        for code in ["G95", "G91 G0 X1."] {
            let found = render(format!("{GO}{code}\n{word}\nM30\n"), &lathe());
            assert!(found.contains(&format!("! {span} PRG-CODE-AMBIGUOUS")), "{code} {word}: {found}");
        }
        // And the codes of the others behind them.
        let found = render(format!("{GO}{word}\nG95\nM30\n"), &lathe());
        assert!(found.contains("! 4:1+3 PRG-CODE-AMBIGUOUS"), "{word}: {found}");
    }
    // A feed mode of A that was none.
    after_go("G98 F100 G1 X40.\nG91", "line X25 Z2 -> X20 Z2 @100/min\n! 4:1+3 PRG-CODE-AMBIGUOUS");
    after_go("G99 F.1 G1 X40.\nG91", "line X25 Z2 -> X20 Z2 @0.1/rev");
    // Of a Haas lathe the system is known.
    let haas = LanguageSettings {
        drilling: crate::DrillingSettings { style: crate::DrillingStyle::Haas, ..lathe().drilling },
        ..lathe()
    };
    check(
        &haas,
        "M3 S500 G98 F100 G1 X40.\nG99 U-2. F.1",
        "spindle cw 500\nline 0 -> X20 @100/min\nline X20 -> X19 @0.1/rev",
    );
}

#[test]
fn levels_of_drilling_cycles_are_refused_while_the_system_is_open() {
    for (block, length) in [("G85 Z-20. R-1. F.1", 18), ("G85 Z-20. R3. F.1", 17), ("G85 Z-20. F.1", 13)] {
        after_go(&format!("{block}\nG80"), &format!("! 3:1+{length} PRG-CODE-AMBIGUOUS"));
    }
    // From zero the distance and the level are the same, but not behind G99.
    let found = render(format!("{GO}G0 Z0\nG85 Z-20. R-1. F.1\nG80\nM30\n"), &lathe());
    assert!(found.contains("Z-1") && !found.contains("PRG"), "{found}");
    let found = render(format!("{GO}G99\nG0 Z0\nG85 Z-20. R-1. F.1\nG80\nM30\n"), &lathe());
    assert!(found.contains("! 5:1+18 PRG-CODE-AMBIGUOUS"), "{found}");
    // Where the program has shown A.
    let a = LanguageSettings { g_code_system: Some(GCodeSystem::A), ..lathe() };
    let program = "G50 S900\nG99 M3 S500\nG0 X50. Z2.\nG85 Z-20. R-1. F.1\nG80\nM30\n";
    let found = render(program, &lathe());
    assert!(!found.contains("PRG"), "{found}");
    assert_eq!(found, render(program, &a));
}

#[test]
fn a_thread_in_one_line_may_be_a_groove_of_system_c() {
    after_go("G76 X30. Z-20. I2. K3. D.2 F.1", "! 3:1+3 PRG-CODE-AMBIGUOUS");
    for certain in [" P1", " A60."] {
        let found = render(format!("{GO}G76 X30. Z-20. K.9 D.2 F2.{certain}\nM30\n"), &lathe());
        assert!(!found.contains("AMBIGUOUS") && found.contains("thread"), "{found}");
    }
    let found = render(format!("G50 S900\n{GO}G76 X30. Z-20. K.9 D.2 F2.\nM30\n"), &lathe());
    assert!(!found.contains("AMBIGUOUS") && found.contains("thread"), "{found}");
}

/// The threading cycle of system A clamps nothing.
#[test]
fn a_clamp_of_systems_b_and_c_is_refused_in_a() {
    let a = LanguageSettings { g_code_system: Some(GCodeSystem::A), ..lathe() };
    check(
        &a,
        "G92 S1500\nG96 S200 M3",
        "spindle cw 200 m/min max inf\n! 1:1+3 PRG-UNKNOWN-CODE\nw 2:1+3 PRG-SPEED-CLAMP-MISSING",
    );
    check(&lathe(), "G50 S900\nG92 S1500", "! 2:1+3 PRG-UNKNOWN-CODE");
}
