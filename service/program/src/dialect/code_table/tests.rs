//! The codes of every dialect, by their written numbers.

use super::*;
use crate::FunctionSwitch;

fn meaning(table: &CodeTable, letter: u8, number: f64) -> Option<Meaning> {
    Some(table.code(table.find(letter, number)?).meaning)
}

#[test]
fn every_code_is_found_by_its_written_number() {
    for settings in [LanguageSettings::default(), LanguageSettings::mill(), LanguageSettings::linuxcnc()] {
        let table = CodeTable::new(&settings);
        assert!(table.codes.len() < usize::from(NO_CODE));
        let codes = table.dialect.g_codes().map(|code| (b'G', code));
        for (letter, code) in codes.chain(table.dialect.m_codes().map(|code| (b'M', code))) {
            let written = format!("{}.{}", code.tenths / 10, code.tenths % 10);
            assert_eq!(meaning(&table, letter, written.parse().unwrap()), Some(code.meaning), "{written}");
        }
    }
}

#[test]
fn numbers_that_are_no_code() {
    let table = CodeTable::new(&LanguageSettings::default());
    for number in [-1.0, 0.05, 43.45, 999.9, 1_000.0, 9_999.9, 10_000.0, 1e9, f64::NAN, f64::INFINITY] {
        assert_eq!(table.find(b'G', number), None, "{number}");
    }
    assert_eq!(table.find(b'G', 68.2), None, "a mill code");
}

#[test]
fn what_a_dialect_carries_out_itself() {
    for (number, lathe, mill) in [
        (1.0, true, true),
        (33.0, true, true),
        (76.0, true, true),
        (99.0, true, true),
        (43.4, false, true),
        (200.0, false, false),
    ] {
        assert_eq!(LanguageSettings::default().carries_out_g_code(number), lathe, "G{number}");
        assert_eq!(LanguageSettings::mill().carries_out_g_code(number), mill, "G{number}");
    }
}

#[test]
fn the_profile_moves_function_codes() {
    let path_vibration = FunctionCodes { on: 8.5, off: 8.6 };
    let table = CodeTable::new(&LanguageSettings { path_vibration, ..LanguageSettings::default() });
    assert_eq!(table.find(b'G', 200.0), None);
    let on = Meaning::Function { function: Function::PathVibration, on: true };
    assert_eq!(meaning(&table, b'G', 8.5), Some(on));
    let thread_vibration = FunctionSwitch { code: 166.0, on_p: 3, off_p: 0 };
    let table = CodeTable::new(&LanguageSettings { thread_vibration, ..LanguageSettings::default() });
    assert_eq!(table.find(b'G', 165.0), None);
    assert_eq!(meaning(&table, b'G', 166.0), Some(Meaning::FunctionSwitch(Function::ThreadVibration)));
}

#[test]
fn suggestions_name_every_code_that_is_carried_out() {
    let table = CodeTable::new(&LanguageSettings::linuxcnc());
    let known = table.supported(b'M');
    assert_eq!(known, "M0 to M9, M19, M30, M48 to M53, M60 to M68, M70 to M73, M98 to M199");
    let known = table.supported(b'G');
    assert!(known.starts_with("G0 to G5, G5.1, G5.2, G5.3, G7, G8, G10, G17 to G21, G28, G28.1,"), "{known}");
    let mill = CodeTable::new(&LanguageSettings::mill());
    let known = mill.supported(b'G');
    assert!(known.contains("G110 to G129, G154"), "{known}");
}
