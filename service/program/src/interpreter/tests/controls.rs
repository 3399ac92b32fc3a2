//! Codes that FANUC and Haas controls read differently, or that one of them alone has.

use super::*;
use crate::{DrillingSettings, DrillingStyle, GCodeSystem, MachineCode, MachineEffect, MachineTiming};

fn haas(settings: LanguageSettings) -> LanguageSettings {
    LanguageSettings { drilling: DrillingSettings { style: DrillingStyle::Haas, ..settings.drilling }, ..settings }
}

#[test]
fn f_of_an_arc_under_inverse_time_is_a_time_on_haas_and_linuxcnc_only() {
    let program = "G0 X10\nG93 G1 X20 F5\nG3 X10 Y10 I-10 F5\nG3 Y0 R5 F5";
    let moves = "rapid 0 -> X10\nline X10 -> X20 @1/5";
    let arcs = "arc X20 -> X10 Y10 about 10,0 by 90 @1/5\narc X10 Y10 -> X10 about 10,5 by 180 @1/5";
    for settings in [haas(mill()), linuxcnc()] {
        check(&settings, program, &format!("{moves}\n{arcs}"));
    }
    check(&mill(), program, &format!("{moves}\n! 3:17+2 PRG-ARC-INVERSE-TIME\n! 4:10+2 PRG-ARC-INVERSE-TIME"));
    // The cure, followed to the letter.
    check(
        &mill(),
        "G0 X10\nG93 G1 X20 F5\nG94 G3 X10 Y10 I-10 F50\nG93 G1 X0 F5",
        "rapid 0 -> X10\nline X10 -> X20 @1/5\n\
        arc X20 -> X10 Y10 about 10,0 by 90 @50/min\nline X10 Y10 -> Y10 @1/5",
    );
}

#[test]
fn g95_of_a_haas_lathe_taps() {
    let program = "M3 S500\nG95 C45. Z-20. F1.";
    check(&haas(lathe()), program, "spindle cw 500\n! 2:1+3 PRG-UNSUPPORTED-CODE");
    // Without words of a hole it is no feed mode either.
    assert!(render("M3 S500\nG95\nG1 Z-20. F0.1", &haas(lathe())).contains("! 2:1+3 PRG-UNSUPPORTED-CODE"));
    check(&haas(mill()), "M3 S500\nG95 G1 X5 F0.1", "spindle cw 500\nline 0 -> X5 @0.1/rev");
    let b = LanguageSettings { g_code_system: Some(GCodeSystem::B), ..lathe() };
    // With the cycles of a mill it still has system B, which no Haas lathe has.
    for settings in [b.clone(), haas(b)] {
        check(&settings, "M3 S500\nG95 G1 Z-5. F0.1", "spindle cw 500\nline 0 -> Z-5 @0.1/rev");
    }
}

#[test]
fn g5_of_a_haas_lathe_is_no_spline() {
    for block in ["G5 C90. F10", "G05 R-10. F1.", "G5 X20 P1 Q1"] {
        assert!(render(format!("M3 S500\n{block}"), &haas(lathe())).contains("PRG-UNSUPPORTED-CODE"), "{block}");
    }
}

#[test]
fn a_drawing_word_on_a_contour_says_so_once() {
    let program = "G99 S500 M3\nG0 X50 Z2\nG71 U1 R0.5\nG71 P10 Q20 U0.4 W0.1 F0.2\nN10 G0 X20\nG1 Z-10 C.5\nX40\nN20 X50\n\
                   G70 P10 Q20\nM30\n";
    let (_, findings) = interpret(program.as_bytes(), lathe());
    let [finding] = findings.findings() else { panic!("{findings:#?}") };
    assert_eq!((finding.code.name(), finding.span.line), ("PRG-TURNING-CONTOUR", 6));
    assert!(finding.suggestions[0].message.contains("plain_drawing_words"), "{finding:#?}");
}

#[test]
fn g87_of_haas_controls_is_retracted_by_hand() {
    let boring = "M3 S500\nG0 Z10\nG98 G87 X0 Z-2 R-20 Q1 F50";
    assert!(
        render(boring, &haas(mill())).contains("! 3:1+26 PRG-CYCLE-UNDEFINED"),
        "{}",
        render(boring, &haas(mill()))
    );
    assert!(!render(boring, &mill()).contains("PRG-CYCLE-UNDEFINED"));
    for code in ["G77", "G47"] {
        assert!(render(format!("{code} Z-2 R-20 Q1"), &haas(mill())).contains("PRG-UNSUPPORTED-CODE"), "{code}");
    }
}

#[test]
fn m_codes_of_haas_controls() {
    // Where an input decides, or the operator, the way is not known.
    for number in [96, 109] {
        let program = format!("G0 X1\nM{number} P10 Q8");
        let refused = |settings: LanguageSettings| render(&program, &haas(settings)).contains("PRG-UNSUPPORTED-CODE");
        assert!(refused(mill()) && refused(lathe()), "M{number}");
        assert!(!render(&program, &mill()).contains("PRG-UNSUPPORTED-CODE"));
    }
    check(&haas(mill()), "T3 M16", "tool 3.0");
    // What the profile lists is the machine's.
    let own =
        MachineCode { number: 16, effect: MachineEffect::None, timing: MachineTiming::Before, words: String::new() };
    check(&LanguageSettings { machine_codes: vec![own], ..haas(mill()) }, "M16", "M16 None");
}

#[test]
fn a_dwell_of_a_cycle_is_read_as_that_of_g4() {
    for (settings, seconds) in [
        (mill(), 1.0),
        (haas(mill()), 1.0),
        (LanguageSettings { dwell_p_unit: crate::DwellUnit::Seconds, ..mill() }, 1.0),
    ] {
        let found = render("M3 S500\nG4 P1.\nG82 X0 Z-1 R0 P1. F100\nG80\nM30\n", &settings);
        assert_eq!(found.matches(&format!("dwell {seconds}\n")).count(), 2, "{found}");
    }
    let found = render("M3 S500\nG4 P500\nG82 X0 Z-1 R0 P500 F100\nG80\nM30\n", &mill());
    assert_eq!(found.matches("dwell 0.5\n").count(), 2, "{found}");
}

#[test]
fn requests_and_words_of_posts_that_change_nothing_here() {
    // Smoothing along axes, which are named by zeros.
    let found = render("G61\nG0 X1\nG5.1 Q2 X0 Y0 Z0\nX2\nG5.1 Q0\nM30\n", &mill());
    assert!(found.contains("rapid 0 -> X1") && found.contains("rapid X1 -> X2") && !found.contains('!'), "{found}");
    let found = render("G0 X1\nG5.1 Q2 X1 Y0 Z0\nM30\n", &mill());
    assert!(found.contains('!'), "a place is none of a request: {found}");
    // No step from groove to groove, as there is one hole.
    let pecks = "M3 S500\nG0 X0 Z1.\nG74 R1.\nG74 X0 Z-3.{}Q2000 F0.1\nM30\n";
    let [with, without] = [" P0 ", " "].map(|words| render(pecks.replace("{}", words), &lathe()));
    assert!(!with.contains('!'), "{with}");
    assert_eq!(with, without);
    let a = LanguageSettings { g_code_system: Some(GCodeSystem::A), ..lathe() };
    check(&haas(a.clone()), "M24\nM23", "M24 None\n! 2:1+3 PRG-UNSUPPORTED-CODE");
    let found = render("G0 X#4012\nM30\n", &mill());
    assert!(found.contains("rapid 0 -> X67"), "{found}");
    let found = render("G0X1./M8\nM30\n", &mill());
    assert!(found.contains("! 1:6+1 "), "{found}");
}

#[test]
fn haas_controls_tap_with_the_spindle_and_start_it_themselves() {
    let tap = |sense: [&str; 2]| format!("tap 0 -> Z-8 @1 {} 500\ntap Z-8 -> 0 @1 {} 500", sense[0], sense[1]);
    let left = tap(["ccw", "cw"]);
    for (start, before) in [
        ("S500", ""),
        ("S500 M3", "spindle cw 500\nspindle off 500\n"),
        ("S500 M4", "spindle ccw 500\nspindle off 500\n"),
    ] {
        check(&haas(mill()), &format!("{start}\nG74 X0 Z-8 R0 F500"), &format!("{before}{left}"));
        let right = tap(["cw", "ccw"]);
        check(&haas(mill()), &format!("{start}\nG84 X0 Z-8 R0 F500"), &format!("{before}{right}"));
    }
}

#[test]
fn the_path_control_that_a_program_reads_is_the_last_that_it_has_named() {
    let notes = |line: usize, column: usize| format!("i {line}:{column}+3 PRG-PATH-REQUEST");
    for (code, number) in [("G61", 61), ("G62", 62), ("G63", 63), ("G64", 64)] {
        let found = render(format!("G64\nG61\n{code}\nG0 X#4015\nM30\n"), &mill());
        assert!(found.contains(&format!("rapid 0 -> X{number}")), "{found}");
        assert_eq!(found.contains(&notes(3, 1)), matches!(number, 62 | 63), "{found}");
    }
    check(&mill(), "G0 X#4015", "rapid 0 -> X61");
}

#[test]
fn what_ends_something_that_is_not_carried_out_is_no_code_of_its_block() {
    check(&lathe(), "G0 G40 G69 G50.2 G23 G13.1 G80 X2.", "rapid 0 -> X1");
    check(&haas(lathe()), "G0 G40 G100 G113 G15 X2.", "rapid 0 -> X1");
    check(&mill(), "G0 G40 G49 G80 G69 G15 G50 G23 G13.1 X2.", "rapid 0 -> X2");
    for (settings, code) in [(lathe(), "G68"), (lathe(), "G51.2"), (lathe(), "G22"), (mill(), "G12.1"), (mill(), "G60")]
    {
        let found = render(format!("{code} X1.\nM30\n"), &settings);
        assert!(found.contains("PRG-UNSUPPORTED-CODE") && !found.contains("PRG-UNKNOWN"), "{code}: {found}");
    }
}

#[test]
fn a_speed_beside_an_unlisted_code_may_be_that_of_another_spindle() {
    let warned = |program: &str| render(program, &mill()).contains("PRG-MACHINE-SPEED");
    assert!(warned("M133 S300\nM30\n") && warned("S1200 M13\nM30\n"));
    // The gear of the main spindle, and what takes the speed itself.
    for program in ["M41 S300", "M3 S300 M13", "G97 S300 M133", "M133 P300", "M133"] {
        assert!(!warned(&format!("{program}\nM30\n")), "{program}");
    }
    let own =
        MachineCode { number: 133, effect: MachineEffect::None, timing: MachineTiming::Before, words: "S".to_owned() };
    check(
        &LanguageSettings { machine_codes: vec![own], ..mill() },
        "M133 S300\nM3 S500",
        "M133 S300 None\nspindle cw 500",
    );
}
