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

#[test]
fn comments_do_not_nest() {
    for settings in [mill(), lathe(), linuxcnc()] {
        one(&settings, "G1 X10 F100 (a (b) c)", "PRG-TEXT", "remove the inner parentheses");
        one(&settings, "(feed (mm/min) of the first pass)", "PRG-TEXT", "remove the inner parentheses");
        assert!(found(&settings, "G0 X10 (a b c)").is_empty());
        // What is behind the first ) is read where it is no rest of a comment.
        assert!(found(&settings, "G0 X10 (a (b) Y5\nX1").is_empty());
        assert!(found(&settings, "G0 X10 (a (b) (c)").is_empty());
    }
}

#[test]
fn programs_have_numbers() {
    for settings in [mill(), lathe()] {
        one(&settings, "O<SHAFT>\nG0 X1", "PRG-NUMBER-MISSING", "give the program a number");
        one(&settings, "G0 X1\nM98 <SUB1>", "PRG-NUMBER-MISSING", "give the program a number");
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
