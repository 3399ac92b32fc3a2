//! Words that look right and are not: the cure, followed to the letter, gives the program that was meant.

use super::*;
use crate::{CoordinateSettings, CoordinateStyle, GCodeSystem};

/// The program with every replacement of its findings made.
fn cured(program: &str, settings: &LanguageSettings) -> String {
    let (_, findings) = interpret(program.as_bytes(), settings.clone());
    let mut lines: Vec<Vec<u8>> = program.split('\n').map(|line| line.as_bytes().to_vec()).collect();
    let mut findings: Vec<_> =
        findings.findings().iter().filter(|finding| finding.severity == Severity::Error).collect();
    findings.sort_by_key(|finding| core::cmp::Reverse((finding.span.line, finding.span.column)));
    for finding in findings {
        let replacement = finding.suggestions[0].replacement.as_ref().expect("a replacement");
        let start = finding.span.column as usize - 1;
        let line = &mut lines[finding.span.line as usize - 1];
        line.splice(start..start + finding.span.length as usize, replacement.bytes());
    }
    String::from_utf8(lines.join(&b'\n')).expect("text")
}

#[test]
fn a_minus_sign_of_typesetting() {
    check(&mill(), "G0 X\u{2212}5 Y3\nX1", "rapid Y3 -> X1 Y3\n! 1:4+5 PRG-LOOKALIKE");
    for (written, meant) in [
        ("G0 X\u{2212}5", "G0 X-5"),
        ("G0 X\u{2013}5.2 Y\u{2014}3 Z\u{2011}1", "G0 X-5.2 Y-3 Z-1"),
        ("G0 X \u{2212}5 Y3", "G0 X-5 Y3"),
        ("G0 X\u{2212} 5", "G0 X-5"),
        ("G0 X \u{2212} 5.", "G0 X-5."),
        ("G0 \u{425} 50. Z2.", "G0 X50. Z2."),
        ("M3 \u{405} 500", "M3 S500"),
        ("\u{ff27}\u{ff10}\u{3000}\u{ff38}\u{ff11}\u{ff10}", "G0 X10"),
        ("G0\u{a0}X10\u{a0}Y5", "G0 X10 Y5"),
        ("G0 \u{425}10 (\u{425})", "G0 X10 (\u{425})"),
        ("G0 X1,5 Y,25", "G0 X1.5 Y.25"),
    ] {
        let program = format!("{written}\nM30");
        assert_eq!(cured(&program, &mill()), format!("{meant}\nM30"), "{written:?}");
    }
}

#[test]
fn one_finding_for_a_word() {
    check(&mill(), "G0 X1 Y\u{2212}5.\u{ff15} E1 Z2", "! 1:17+2 PRG-WORD-UNKNOWN\n! 1:7+9 PRG-LOOKALIKE");
    assert_eq!(render(b"G0 X\x965\nM30", &mill()), "end\n! 1:4+3 PRG-LOOKALIKE");
    check(&mill(), "G0 X1 (\u{2212})\nX2 ; \u{2212}", "rapid 0 -> X1\nrapid X1 -> X2");
    // What can be read differently is not replaced.
    for written in ["X1,000", "X\u{ad}5", "X1\u{41e}"] {
        let (_, findings) = interpret(format!("G0 {written}").as_bytes(), mill());
        let finding = &findings.findings()[0];
        assert_eq!(finding.code, "PRG-LOOKALIKE");
        assert!(finding.suggestions.iter().all(|cure| cure.replacement.is_none()), "{finding:?}");
    }
}

/// A number before a removed stretch and one behind it are never one number.
#[test]
fn a_stretch_ends_the_number_before_it() {
    for (line, place) in [
        ("G0 X5 \u{2212} 3. Z2.", "7+6"),
        ("G1 Z 1 \u{2212} 5.", "8+6"),
        ("G0 X5 \u{200b} 3.", "7+3"),
        ("G0 X-\u{2212}5.", "4+7"),
        ("G0 X5.\u{2212}", "4+6"),
    ] {
        let (_, findings) = interpret(format!("{line}\nM30").as_bytes(), mill());
        let finding = &findings.findings()[0];
        assert_eq!(finding.code, "PRG-LOOKALIKE", "{line}: {findings:?}");
        assert_eq!(format!("{}+{}", finding.span.column, finding.span.length), place, "{line}");
        assert_eq!(finding.suggestions[0].replacement, None, "{line}");
        assert!(findings.findings().iter().all(|finding| finding.code != "PRG-NUMBER-SPACED"), "{line}: {findings:?}");
    }
    check(&mill(), "G0 X1 \u{417} 2.", "! 1:7+2 PRG-CHARACTER\n! 1:10+2 PRG-NUMBER-STRAY");
}

#[test]
fn a_minus_sign_of_typesetting_in_an_expression() {
    for line in ["G0 X[#1\u{2212}5]", "#1=[5\u{2212}3]", "IF [#1 EQ \u{2212}5] GOTO 10", "G0 \u{425}1 Y[#1\u{2212}5]"] {
        let (_, findings) = interpret(format!("#1=1\n{line}\nN10 M30").as_bytes(), mill());
        let found: Vec<_> = findings.findings().iter().map(|finding| finding.code.name()).collect();
        assert!(!found.is_empty() && found.iter().all(|code| *code == "PRG-LOOKALIKE"), "{line}: {findings:?}");
    }
}

#[test]
fn a_letter_o_in_a_number_is_a_zero_and_begins_no_program() {
    for settings in [mill(), LanguageSettings { dialect: crate::DialectName::LinuxCnc, ..LanguageSettings::default() }]
    {
        for (written, meant) in [
            ("M3 S5O0", "M3 S500"),
            ("G1 X1O5 F100", "G1 X105 F100"),
            ("G94 G1 X10 F1O0", "G94 G1 X10 F100"),
            ("G94 G1 X10 F1O", "G94 G1 X10 F10"),
            ("G94 G1 X10 F1o Y2", "G94 G1 X10 F10 Y2"),
            ("G1 X-1.o5 F100", "G1 X-1.05 F100"),
        ] {
            let program = format!("{written}\nM30");
            assert_eq!(cured(&program, &settings), format!("{meant}\nM30"), "{written}");
        }
        let (_, findings) = interpret(b"G0 X1 O5\nM30", settings);
        let finding = &findings.findings()[0];
        assert_eq!((finding.code.name(), finding.span.column), ("PRG-CHARACTER", 7), "{finding:?}");
    }
    for program in ["O100\nG0 X1\nM30", "N10 O100 G0 X1\nM30", "/O100\nM30", "%\n:12\nG0 X1\nM30"] {
        let (_, findings) = interpret(program.as_bytes(), mill());
        assert!(findings.findings().iter().all(|finding| finding.severity != Severity::Error), "{program}");
    }
}

#[test]
fn words_of_vacant_values_are_named_where_they_would_switch_something() {
    for (line, place) in [("T#101", "1+5"), ("G0 X1 F#101", "7+5"), ("S#101 M3", "1+5"), ("M#[101]", "1+7")] {
        let (_, findings) = interpret(format!("{line}\nM30").as_bytes(), mill());
        let found: Vec<_> = findings.findings().iter().filter(|finding| finding.code == "PRG-VACANT-WORD").collect();
        assert_eq!(found.len(), 1, "{line}: {:?}", findings.findings());
        assert_eq!(format!("{}+{}", found[0].span.column, found[0].span.length), place, "{line}");
    }
    let (_, findings) = interpret(b"G0 X1 Y#101\nM30", mill());
    assert!(findings.findings().is_empty(), "macros leave axis words out so: {:?}", findings.findings());
}

#[test]
fn words_behind_the_end_of_a_block_are_neither_run_nor_dropped() {
    for settings in [mill(), LanguageSettings::default()] {
        for (line, place) in [
            ("G0 X40. Z2.; G1 X30. F0.1", "14+12"),
            ("G0 X40. ;; M8 ; note", "12+2"),
            (";G1 X30 (approach)", "2+17"),
            ("G0 X1; #1=5", "8+4"),
            ("G0 X1; IF [#1 EQ 2] GOTO 10", "8+20"),
        ] {
            let (_, findings) = interpret(format!("{line}\nM30").as_bytes(), settings.clone());
            let found: Vec<_> = findings.findings().iter().filter(|finding| finding.code == "PRG-BLOCK-END").collect();
            assert_eq!(found.len(), 1, "{line}: {:?}", findings.findings());
            assert_eq!(format!("{}+{}", found[0].span.column, found[0].span.length), place, "{line}");
        }
        // The end of a block as it is punched, and text that no control would run.
        for line in ["G0 X40.;", "G0 X40. ;\r", "G0 X40.; (note)", "; roughing with T1", "G0 X1 ; -- 10 mm --", ";;"] {
            let (_, findings) = interpret(format!("{line}\nM30").as_bytes(), settings.clone());
            assert!(findings.findings().iter().all(|finding| finding.code != "PRG-BLOCK-END"), "{line}");
        }
    }
    let comments = LanguageSettings { dialect: crate::DialectName::LinuxCnc, ..LanguageSettings::default() };
    let (_, findings) = interpret(b"G0 X40 ; G1 X30 F1\nM2", comments);
    assert!(findings.findings().iter().all(|finding| finding.code != "PRG-BLOCK-END"));
}

#[test]
fn nothing_is_taken_out_of_the_middle_of_a_word() {
    for written in ["X!5", "X1\u{e9}5", "X\x005", "X1\x005", "X\u{e9}5"] {
        let (_, findings) = interpret(format!("G0 {written}").as_bytes(), mill());
        for finding in findings.findings() {
            let cures = finding.suggestions.iter().map(|cure| cure.message.as_str());
            assert!(
                !cures.clone().any(|cure| cure.starts_with("remove")) || finding.severity == Severity::Warning,
                "{finding:?}"
            );
        }
    }
}

#[test]
fn numbers_of_lines_and_programs() {
    check(&mill(), "N0 G0 X1\nN99999999 X2\nN10. X3", "rapid 0 -> X1\nrapid X1 -> X2\nrapid X2 -> X3");
    check(&mill(), "N-1 G0 X1", "! 1:1+3 PRG-NUMBER-NOT-WHOLE");
    check(&mill(), "N1.5 G0 X1", "! 1:1+4 PRG-NUMBER-NOT-WHOLE");
    check(&mill(), "N99999999999 G0 X1", "! 1:1+12 PRG-NUMBER-RANGE");
    check(&mill(), "O-1\nG0 X1", "rapid 0 -> X1\n! 1:1+3 PRG-NUMBER-NOT-WHOLE");
    assert_eq!(cured("N-1 G0 X1\nN1.5 X2\nM30", &mill()), " G0 X1\n X2\nM30");
}

#[test]
fn cures_name_the_feed_codes_of_the_g_code_system() {
    let cures = |settings: LanguageSettings, program: &str| -> Vec<String> {
        let (_, findings) = interpret(program.as_bytes(), settings);
        let all = findings.findings().iter();
        all.flat_map(|finding| finding.suggestions.iter().map(|cure| cure.message.clone())).collect()
    };
    let system = |system| LanguageSettings { g_code_system: system, ..lathe() };
    for (settings, program, code) in [
        (system(Some(GCodeSystem::A)), "G21 G99 G97\nG0 X20. Z2.\nG1 X18. F0.1\nM30", "G98"),
        (system(None), "G21 G99 G97\nG0 X20. Z2.\nG1 X18. F0.1\nM30", "G98"),
        (system(Some(GCodeSystem::B)), "G21 G95 G97\nG0 X20. Z2.\nG1 X18. F0.1\nM30", "G94"),
        (mill(), "G21 G95\nG0 X20. Z2.\nG1 X18. F0.1\nM30", "G94"),
    ] {
        let cure = format!("use feed per minute, {code}");
        assert!(cures(settings, program).contains(&cure), "{program}");
    }
}

#[test]
fn polar_interpolation_of_a_lathe_is_no_work_offset() {
    let haas = |settings: LanguageSettings| LanguageSettings {
        coordinates: CoordinateSettings { style: CoordinateStyle::Haas, ..settings.coordinates.clone() },
        ..settings
    };
    for program in ["G112\nG1 X20. C10. F100\nM30", "G112\nM30"] {
        for settings in [lathe(), haas(lathe())] {
            let (_, findings) = interpret(program.as_bytes(), settings);
            let finding = &findings.findings()[0];
            assert_eq!(
                (finding.code.name(), finding.severity),
                ("PRG-UNSUPPORTED-CODE", Severity::Error),
                "{finding:?}"
            );
        }
    }
    let (_, findings) = interpret(b"G112\nG0 X1.\nG113\nX2.\nM30", haas(mill()));
    assert!(findings.findings().iter().all(|finding| finding.severity != Severity::Error));
}
