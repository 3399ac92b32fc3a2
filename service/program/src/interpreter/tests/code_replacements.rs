//! Codes in whose place the profile has other words.

use super::*;
use crate::{CodeReplacement, GCodeSystem, MachineCode, code_replacement_problems};

fn with(settings: LanguageSettings, replaced: &[(&str, &str)]) -> LanguageSettings {
    let entry = |(code, words): &(&str, &str)| CodeReplacement { code: code.to_string(), words: words.to_string() };
    let settings = LanguageSettings { code_replacements: replaced.iter().map(entry).collect(), ..settings };
    assert_eq!(code_replacement_problems(&settings), []);
    settings
}

/// Holds a program against one that writes out what its codes stand for.
#[track_caller]
fn same(settings: &LanguageSettings, program: &str, plain: &str) {
    let without = LanguageSettings { code_replacements: Vec::new(), ..settings.clone() };
    let [found, expected] = [(program, settings), (plain, &without)].map(|(it, settings)| render(it, settings));
    assert!(!expected.contains('!'), "{plain}\n{expected}");
    assert_eq!(found, expected, "{program}");
}

const BORE: &str = "G0 X50.\nM30\nO9010\nG91 G0 X#24\nG90\nM99";

#[test]
fn a_code_stands_for_several() {
    let settings = with(mill(), &[("M13", "M3 M8"), ("M63", "M5 M9"), ("G9999.9", "G90 G17"), ("M9350", "M4")]);
    for (written, meant) in [
        ("M13 S500 G0 X5", "M3 M8 S500 G0 X5"),
        ("S500 M13\nG1 X5 F100 M63", "S500 M3 M8\nG1 X5 F100 M5 M9"),
        ("G91\nG0 X1\nG9999.9 X2\nS100 M9350", "G91\nG0 X1\nG90 G17 X2\nS100 M4"),
    ] {
        same(&settings, &format!("{written}\nM30"), &format!("{meant}\nM30"));
    }
    // Each word is where the code is.
    check(&settings, "G0 X1 M3 M13", "! 1:10+3 PRG-GROUP-CONFLICT");
}

#[test]
fn a_macro_behind_a_code_takes_the_words_behind_it() {
    let settings = with(mill(), &[("G120", "G65 P9010"), ("M66", "G65 P9010 L2"), ("G1000", "G65 P9010")]);
    for (written, meant) in [
        ("G120 X2.", "G65 P9010 X2."),
        ("N5 G120 X[1+1] L3 (bore)", "G65 P9010 L3 X2."),
        ("M66 X2.", "G65 P9010 L2 X2."),
        ("G1000 X2.", "G65 P9010 X2."),
        ("G120", "G65 P9010"),
    ] {
        same(&settings, &format!("G0 X1.\n{written}\n{BORE}"), &format!("G0 X1.\n{meant}\n{BORE}"));
    }
    let (_, findings) = interpret(format!("G120 P9011 X2.\n{BORE}").as_bytes(), settings.clone());
    assert_eq!(findings.findings()[0].code.name(), "PRG-STATEMENT");
    let (_, findings) = interpret(format!("G0 X5. G120 X2.\n{BORE}").as_bytes(), settings.clone());
    assert_eq!(findings.findings()[0].code.name(), "PRG-STATEMENT");
    let (_, findings) = interpret(b"G120 X2.\nM30\n", settings);
    assert_eq!(findings.findings()[0].code.name(), "PRG-SUBPROGRAM-MISSING");
}

#[test]
fn in_its_macro_a_code_is_what_it_is() {
    // The macro of a tool change goes to its place, changes the tool and calls another program, in which that holds as well.
    let program = "G0 X5 Z9\nT3 M6\nX7\nM30\nO9001\nG0 Z100\nM6\nM98 P9002\nM13\nM99\nO9002\nT4 M6\nX8\nM99";
    let plain = program.replacen("M6", "M98 P9001", 1).replace("M13", "M3 M8");
    let settings = with(mill(), &[("M6", "M98 P9001"), ("M13", "M3 M8")]);
    same(&settings, program, &plain);
    // Behind its end it calls again.
    same(&settings, &program.replacen("X7", "T5 M6\nX7", 1), &plain.replacen("X7", "T5 M98 P9001\nX7", 1));
}

#[test]
fn it_takes_the_place_of_codes_of_the_machine_too() {
    let listed = MachineCode {
        number: 21,
        effect: crate::MachineEffect::Stop,
        timing: crate::MachineTiming::Before,
        words: "P".to_owned(),
    };
    let settings = with(LanguageSettings { machine_codes: vec![listed], ..mill() }, &[("M21", "M98 P7")]);
    check(&settings, "M21\nM30\nO7\nM21 P3\nM99", "M21 P3 Stop\nend");
}

#[test]
fn linuxcnc_calls_by_m98() {
    let settings = with(linuxcnc(), &[("M6", "M98 P100"), ("G88.1", "G1 F200")]);
    let end = "M2\no100\nG0 X3\nM6\nM99";
    same(&settings, &format!("T1 M6\nG88.1 X5\n{end}"), &format!("T1 M98 P100\nG1 F200 X5\n{end}"));
}

#[test]
fn what_cannot_be_replaced_is_said_at_its_field() {
    let fields = |settings: LanguageSettings, code: &str, words: &str| -> Vec<String> {
        let entry = CodeReplacement { code: code.to_owned(), words: words.to_owned() };
        let settings = LanguageSettings { code_replacements: vec![entry], ..settings };
        code_replacement_problems(&settings).into_iter().map(|(field, message)| format!("{field}: {message}")).collect()
    };
    for code in ["", "M", "T6", "M6 M7", "M6.5", "M10000", "G10000", "M98", "G65", "M99", "M30", "G200"] {
        let found = fields(mill(), code, "M3");
        assert!(found.len() == 1 && found[0].starts_with("code_replacements[0].code: "), "{code}: {found:?}");
    }
    for words in [
        "",
        "(x)",
        "X",
        "X#1",
        "S100",
        "N10 M3",
        "O1",
        "M3 M3",
        "G0 G1",
        "M98 P1 P2",
        "G65",
        "G65 A1.",
        "G65 P1 A1.",
        "G66 P1",
        "G1000",
        "IF",
        "M3 S1 F1 X1 Y1 Z1 A1 B1 C1",
    ] {
        let found = fields(mill(), "M21", words);
        assert!(found.len() == 1 && found[0].starts_with("code_replacements[0].words: "), "{words}: {found:?}");
    }
    let entry = |code: &str| CodeReplacement { code: code.to_owned(), words: "M3".to_owned() };
    let twice = LanguageSettings { code_replacements: vec![entry("M21"), entry("m021")], ..mill() };
    assert_eq!(code_replacement_problems(&twice).len(), 1);
    let many = LanguageSettings { code_replacements: vec![entry("M21"); 33], ..mill() };
    assert_eq!(code_replacement_problems(&many)[0].0, "code_replacements");
}

#[test]
fn the_largest_table_has_places_for_all() {
    let codes: Vec<_> = (900..932).map(|number| (format!("M{number}"), "M3".to_owned())).collect();
    let borrowed: Vec<_> = codes.iter().map(|(code, words)| (code.as_str(), words.as_str())).collect();
    let lathe = |system| LanguageSettings { g_code_system: system, ..LanguageSettings::default() };
    let systems = [None, Some(GCodeSystem::A), Some(GCodeSystem::B), Some(GCodeSystem::C)].map(lathe);
    for settings in [mill(), linuxcnc()].into_iter().chain(systems) {
        let settings = with(settings, &borrowed);
        let (_, findings) = interpret(b"S100 M931\nM30\n", settings);
        assert!(!findings.has_errors());
    }
}
