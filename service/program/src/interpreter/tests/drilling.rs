//! Drilling, boring and tapping cycles: section 5 of the language page, and its worked examples 2 and 3.

mod boring;
mod haas;
mod lathe;
mod modes;
mod tapping;

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
    let drilling = DrillingSettings { lathe_peck, ..stated().drilling };
    LanguageSettings { drilling, g_code_system: Some(crate::GCodeSystem::A), ..lathe() }
}

/// What comes of `program` behind `go`, which moves the tool to Z 10 without a finding.
#[track_caller]
fn drills(settings: &LanguageSettings, program: &str, expected: &str) {
    let go = "M3 S1000\nG0 Z10.\n";
    let before = "spindle cw 1000\nrapid 0 -> Z10\n";
    check(settings, &format!("{go}{program}"), &format!("{before}{expected}"));
}

#[test]
fn what_is_wrong_with_a_cycle_is_one_finding_for_all_its_holes() {
    let found = |settings: LanguageSettings, cycle: &str| {
        let program = format!("M3 S1000\nG0 X0 Y0 Z10.\n{cycle}\nX20.\nX30.\nX40.\nG80\nG0 Z50.\nM30\n");
        let (_, findings) = interpret(program.as_bytes(), settings);
        let found = findings.findings().iter();
        found.map(|it| (it.code.to_string(), it.span.line, it.occurrences)).collect::<Vec<_>>()
    };
    let one = |code: &str, line: u32, count: u64| vec![(code.to_owned(), line, count)];
    assert_eq!(found(mill(), "G76 X10. Z-5. R2. Q0.1 F100"), one("PRG-CYCLE-SETTING", 3, 4));
    assert_eq!(found(mill(), "G81 X10. Z-5. R-8. F100"), one("PRG-CYCLE-LEVEL", 3, 4));
    assert_eq!(found(mill(), "G0 Z1.\nG81 X10. Z-5. R2. F100"), one("PRG-CYCLE-LEVEL", 4, 4));
    assert_eq!(found(mill(), "G83 X10. Z-5. R2. F100"), one("PRG-CYCLE-WORD", 3, 4));
    assert_eq!(found(mill(), "G93 G81 X10. Z-5. R2. F100"), one("PRG-CYCLE-FEED", 3, 4));
    assert_eq!(found(mill(), "M5\nG84 X10. Z-5. R2. F100"), one("PRG-CYCLE-SPINDLE", 4, 4));
    assert_eq!(found(mill(), "G83 X10. Z-500. R2. Q0.001 F100"), one("PRG-CYCLE-VALUE", 3, 4));
    assert_eq!(found(mill(), "G83 X10. Z-5. R2. Q0. F100"), one("PRG-CYCLE-VALUE", 3, 1));
    // A word of the cycle is a place of its own.
    let levels = found(mill(), "G81 X10. Z-5. R-8. F100\nX12.\nX14. R-9.");
    assert_eq!(levels, [one("PRG-CYCLE-LEVEL", 3, 2), one("PRG-CYCLE-LEVEL", 5, 4)].concat());
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
    let haas = with(DrillingSettings { style: DrillingStyle::Haas, ..DrillingSettings::default() });
    for (settings, where_it_is) in [(mill(), "parameter 5115 of"), (haas, "setting 22 of")] {
        let findings = interpret(program.as_bytes(), settings).1;
        let default = findings.findings().iter().find(|finding| finding.code.name() == "PRG-CYCLE-DEFAULT").unwrap();
        assert!(default.suggestions[0].message.contains(where_it_is), "{default:?}");
    }
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

#[test]
fn two_kinds_of_pecks_in_a_block_are_refused() {
    let found = |settings: LanguageSettings, cycle: &str| {
        let program = format!("M3 S1000\nG0 X0 Y0 Z10.\n{cycle}\nG80\nG0 Z50.\nM30\n");
        let (_, findings) = interpret(program.as_bytes(), settings);
        findings
            .findings()
            .iter()
            .filter(|it| it.severity == Severity::Error)
            .map(|it| it.code.to_string())
            .collect::<Vec<_>>()
    };
    let mut haas = mill();
    haas.drilling.style = DrillingStyle::Haas;
    for cycle in ["G83 X10. Z-20. R2. Q5. I8. F100.", "G83 X10. Z-20. R2. Q5. J1. F100."] {
        assert_eq!(found(mill(), cycle), ["PRG-WORD-CONFLICT"], "{cycle}");
        assert_eq!(found(haas.clone(), cycle), ["PRG-WORD-CONFLICT"], "{cycle}");
    }
    assert_eq!(found(haas.clone(), "G83 X10. Z-20. R2. Q5. K11. F100."), ["PRG-WORD-CONFLICT"]);
    // K repeats elsewhere, and in G73 of Haas it goes with Q.
    assert_eq!(found(mill(), "G83 X10. Z-20. R2. Q5. K1 F100."), [""; 0]);
    assert_eq!(found(haas, "G73 X10. Z-20. R2. Q5. K11. F100."), [""; 0]);
}
