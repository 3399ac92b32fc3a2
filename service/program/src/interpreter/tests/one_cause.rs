//! One cause is one finding, and its cure ends it.

use super::*;
use crate::GCodeSystem;

/// The codes and the first cures of what is found in a program, information left out.
fn found(settings: &LanguageSettings, program: &str) -> Vec<(String, String)> {
    let (_, findings) = interpret(format!("{program}\nM30\n").as_bytes(), settings.clone());
    let findings = findings.findings().iter().filter(|finding| finding.severity != Severity::Info);
    findings
        .map(|finding| {
            (
                finding.code.name().to_owned(),
                finding.suggestions.first().map_or_else(String::new, |cure| cure.message.clone()),
            )
        })
        .collect()
}

#[track_caller]
fn one(settings: &LanguageSettings, program: &str, code: &str, cure: &str) {
    let found = found(settings, program);
    let [(found_code, found_cure)] = found.as_slice() else { panic!("{program}: {found:?}") };
    assert_eq!(found_code, code, "{program}");
    assert!(found_cure.contains(cure), "{program}: {found_cure}");
}

/// Motion is what it was: the blocks behind have nothing wrong.
#[test]
fn a_request_for_contour_control_that_is_none() {
    for line in ["G5.1", "G05.1 Q5", "G05.1 P1", "G05.1 Q1 X5. Y5."] {
        let found = found(&mill(), &format!("G1 X1. F100.\n{line}\nX10.\nY20."));
        assert_eq!(found.len(), 1, "{line}: {found:?}");
    }
    one(&mill(), "G1 X1. F100.\nG05.1 Q1 P1\nX10.\nX20.", "PRG-WORD-UNUSED", "remove it");
}

#[test]
fn the_wall_that_a_contour_is_left_towards() {
    let contour = "G1 X5. Y0 F100.\nG41 D1 X10.\nX30.\nG40 X40. Y-10. I0 J-1.";
    let codes: Vec<_> = found(&mill(), contour).into_iter().map(|(code, _)| code).collect();
    assert_eq!(codes.iter().filter(|code| *code == "PRG-COMP-BLOCK").count(), 1, "{codes:?}");
    assert!(!codes.contains(&"PRG-WORD-UNUSED".to_owned()), "{codes:?}");
}

#[test]
fn corners_where_nothing_moves() {
    one(&mill(), "G1 X10. Y0 F100.\nX10. Y0 ,R2.\nX20.", "PRG-CORNER", "correct where the block ends");
}

#[test]
fn comments_do_not_nest() {
    for settings in [mill(), lathe(), linuxcnc()] {
        one(&settings, "G1 X10 F100 (a (b) c)", "PRG-TEXT", "remove the inner parentheses");
        one(&settings, "(feed (mm/min) of the first pass)", "PRG-TEXT", "remove the inner parentheses");
        assert!(found(&settings, "G0 X10 (a b c)").is_empty());
    }
    for settings in [mill(), lathe()] {
        // What is behind the first ) is read where it is no rest of a comment.
        assert!(found(&settings, "G0 X10 (a (b) Z5\nX1").is_empty());
        assert!(found(&settings, "G0 X10 (a (b) (c)").is_empty());
    }
    // Refused there, wherever the outer one ends; checked with rs274.
    one(&linuxcnc(), "G0 X5\n(a (b)\nG0 X6", "PRG-TEXT", "remove the inner parentheses");
}

#[test]
fn programs_have_numbers_or_short_names() {
    for settings in [mill(), lathe()] {
        one(&settings, "O<SHAFT 1>\nG0 X1", "PRG-NUMBER-MISSING", "give the program a number");
        one(&settings, "G0 X1\nM98 <SUB 1>", "PRG-NUMBER-MISSING", "give the program a number");
        one(&settings, "G0 X1\nM98 P<SUB1>", "PRG-NUMBER-MISSING", "give the program a number");
    }
}

#[test]
fn a_skip_inside_a_block_has_a_cure_of_its_own() {
    one(&mill(), "G1 X10 F100 /Y20", "PRG-CHARACTER", "a block of its own that begins with /");
    assert!(found(&mill(), "G1 X10 F100\n/Y20").is_empty());
}

#[test]
fn words_of_system_a_in_a_return_to_the_reference() {
    for system in [GCodeSystem::B, GCodeSystem::C] {
        let settings = LanguageSettings { g_code_system: Some(system), ..lathe() };
        one(&settings, "G0 X40. Z5.\nG28 U0 W0", "PRG-REFERENCE-AXIS", "such as G91 G28 X0 Z0, and G90 behind it");
        one(&settings, "G0 X40. Z5.\nG28 U0", "PRG-REFERENCE-AXIS", "such as G91 G28 X0 Z0, and G90 behind it");
        assert!(found(&settings, "G0 X40. Z5.\nG91 G28 X0 Z0\nG90").is_empty());
    }
    let settings = LanguageSettings { g_code_system: Some(GCodeSystem::A), ..lathe() };
    assert!(found(&settings, "G0 X40. Z5.\nG28 U0 W0").is_empty());
}

#[test]
fn a_hole_in_one_cut_needs_no_retract_of_the_profile() {
    let mut settings = LanguageSettings { g_code_system: Some(GCodeSystem::A), ..lathe() };
    settings.drilling.lathe_peck = Some(crate::PeckReturn::RLevel);
    let go = "G97 S1000 M3\nG0 X0 Z5.\n";
    let codes = |program: &str| {
        let (_, findings) = interpret(format!("{go}{program}\nG80\nM30\n").as_bytes(), settings.clone());
        findings.findings().iter().map(|finding| finding.code.name().to_owned()).collect::<Vec<_>>()
    };
    assert!(codes("G83 Z-20. R-3. F0.1").is_empty());
    assert!(codes("G83 Z-20. R-3. Q5000 F0.1").contains(&"PRG-CYCLE-DEFAULT".to_owned()));
}

#[test]
fn a_cycle_on_a_contour_is_refused_where_its_code_is() {
    let before = "M3 S1000\nG0 X-20 Y-20 Z5\nG41 D1 G1 X0 Y-10 F100\nY20";
    for cycle in ["G81 X30 Z-3 R2 F50\nX40\nX50", "G81 X30 Z-3 R2 F50\nX40\nG80\nG1 X60 Y20"] {
        let program = format!("{before}\n{cycle}\nG40 G1 X80 Y-10\nM30\n");
        let interpreter = Interpreter::new(mill()).with_tools(vec![ToolOffset::new(1).with_radius(3.0)]);
        let (_, findings) = interpreter.read_all(program.as_bytes());
        let errors = findings.findings().iter().filter(|finding| finding.severity == Severity::Error);
        let errors: Vec<_> = errors.map(|finding| (finding.code.name(), finding.span.line)).collect();
        assert_eq!(errors, [("PRG-COMP-BLOCK", 5)], "{program}");
    }
}

#[test]
fn the_plane_of_turning_cycles_is_missing_once() {
    let settings = LanguageSettings { g_code_system: Some(GCodeSystem::A), ..lathe() };
    let cycles = "G90 X40. Z-10. F0.2\nX38.\nG0 X50.\nG74 R1.\nG74 Z-10. Q5000 F0.1\nG94 X30. Z-1.";
    one(&settings, &format!("S1000 M3\nG17\nG0 X50. Z2.\n{cycles}"), "PRG-TURNING-FORM", "select it before, G18");
}

#[test]
fn a_text_is_one() {
    one(&mill(), "G0 X1\nremove the old part", "PRG-TEXT", "write comments in ( )");
    one(&mill(), "G0 X1 remove the old part\nG0 X2", "PRG-TEXT", "write comments in ( )");
    assert_eq!(found(&mill(), "GO XY\nG0 X1").len(), 2);
}

/// What a cure says is in the unit of the program, and right when followed.
#[test]
fn cures_of_inch_programs_are_in_inches() {
    one(&mill(), "G20\nG1 X1. F10. ,R1.5\nY.5", "PRG-CORNER", "write at most 0.5 inch");
    assert!(found(&mill(), "G20\nG1 X1. F10. ,R0.5\nY.5").is_empty());
    one(&mill(), "G1 X25. F100 ,R30.\nY10.", "PRG-CORNER", " mm");
}

/// Start, centre and end rounded to 0.0001 inch: the radii differ by 0.0053 mm.
#[test]
fn arcs_of_inch_programs_may_be_off_by_their_rounding() {
    let arc = "G0 X4.0125 Y-0.5965\nG3 X3.4949 Y-1.5899 I-0.1461 J-0.5553 F10";
    assert!(found(&mill(), &format!("G20\n{arc}")).is_empty());
    let in_mm = "G0 X101.9175 Y-15.1511\nG3 X88.77046 Y-40.38346 I-3.71094 J-14.10462 F100";
    assert_eq!(found(&mill(), in_mm).len(), 1, "0.005 mm in a program of millimetres");
}
