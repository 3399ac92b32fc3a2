//! Tests of expressions: the numbers of the page (06-program-language.md, section 2), and an independent evaluator.

mod extent;
mod oracle;

use std::collections::BTreeMap;

use super::*;

/// Parameters of a test; a number that is not there is vacant.
#[derive(Default)]
pub(super) struct Table {
    pub(super) numbered: BTreeMap<u32, f64>,
    pub(super) named: BTreeMap<String, f64>,
}

impl Variables for Table {
    fn numbered(&self, number: u32) -> Result<Reading, Refusal> {
        if number > 9_999 {
            let message = format!("#{number} does not exist");
            return Err(Refusal { code: code::PARAMETER_NUMBER, message, cure: "use another".into() });
        }
        let is_probed = number == 5_061;
        Ok(Reading { value: self.numbered.get(&number).copied(), is_probed })
    }

    fn named(&self, name: &Name) -> Result<Option<f64>, Refusal> {
        Ok(self.named.get(name.as_str()).copied())
    }
}

/// `#1` to `#4` are 7, 3, -2.5 and 2, `#<width>` is 40.
fn table() -> Table {
    Table {
        numbered: [(1, 7.0), (2, 3.0), (3, -2.5), (4, 2.0), (7, 70.0), (5_061, 1.0)].into(),
        named: [("width".to_owned(), 40.0), ("_global".to_owned(), 1.0)].into(),
    }
}

pub(super) fn context<'a>(rules: &'static Rules, table: &'a Table) -> Context<'a> {
    Context::new(rules, table, AngleRange::Positive)
}

/// The value of a whole text; the text of a defect where there is none.
fn value(rules: &'static Rules, text: &str) -> Result<Value, String> {
    let table = table();
    let mut context = context(rules, &table);
    match evaluate(text.as_bytes(), 0, &mut context) {
        Ok((value, end)) => {
            assert_eq!(end, text.len(), "{text} is read to its end");
            assert_eq!(value_end(text.as_bytes(), 0), end, "the extent of {text}");
            Ok(value)
        }
        Err(defect) => {
            assert!(defect.start <= defect.end && defect.end <= text.len(), "{text}: {defect:?}");
            assert!(!defect.message.is_empty() && !defect.cure.is_empty(), "{text}: {defect:?}");
            Err(defect.code.name().to_owned())
        }
    }
}

#[track_caller]
fn check(rules: &'static Rules, cases: &[(&str, f64)]) {
    for &(text, expected) in cases {
        let found = value(rules, text).unwrap_or_else(|code| panic!("{text}: {code}"));
        let found = found.unwrap_or_else(|| panic!("{text} is vacant"));
        assert!((found - expected).abs() <= 1e-12 * expected.abs().max(1.0), "{text} = {found}, not {expected}");
    }
}

#[track_caller]
fn refused(rules: &'static Rules, cases: &[(&str, &str)]) {
    for &(text, expected) in cases {
        assert_eq!(value(rules, text), Err(expected.to_owned()), "{text}");
    }
}

/// The condition of a whole text.
fn holds(rules: &'static Rules, text: &str) -> Result<bool, String> {
    let table = table();
    match condition(text.as_bytes(), 0, &mut context(rules, &table)) {
        Ok((holds, end)) => {
            assert_eq!(end, text.len(), "{text} is read to its end");
            Ok(holds)
        }
        Err(defect) => Err(defect.code.name().to_owned()),
    }
}

#[test]
fn section_2_linuxcnc_precedence() {
    check(
        &LINUXCNC,
        &[
            ("[2**3**2]", 64.0),
            ("[1 OR 0 AND 0]", 0.0),
            ("[10/4/5]", 0.5),
            ("[-2**2]", 4.0),
            ("[1+2*3]", 7.0),
            ("[2*3**2]", 18.0),
            ("[7 MOD 4*2]", 6.0),
            ("[1+1 EQ 2]", 1.0),
            ("[1 LT 2 AND 3 GT 4]", 0.0),
            ("[1 xor 1]", 0.0),
            ("[10-5]", 5.0),
            ("[1 0 - 5]", 5.0),
            ("--5", 5.0),
            ("-#1", -7.0),
            ("##4", 3.0),
            ("#[#4+1]", -2.5),
            ("-SIN[30]", -0.5),
            ("# 1", 7.0),
        ],
    );
}

#[test]
fn section_2_linuxcnc_functions() {
    check(
        &LINUXCNC,
        &[
            ("ATAN[1]/[-1]", 135.0),
            ("ATAN[-1]/[-1]", -135.0),
            ("ASIN[-1]", -90.0),
            ("FIX[-2.3]", -3.0),
            ("FUP[-2.3]", -2.0),
            ("ROUND[-0.5]", -1.0),
            ("ROUND[2.5]", 3.0),
            ("[-7 MOD 3]", 2.0),
            ("[7 MOD -3]", 1.0),
            ("[7.5 MOD 2]", 1.5),
            ("[1 EQ 1.0000001]", 1.0),
            ("[1 EQ 1.00009]", 1.0),
            ("[1 NE 1.00009]", 0.0),
            ("[1 GE 1.00009]", 0.0),
            ("[1 EQ 1.0002]", 0.0),
            ("EXISTS[#<width>]", 1.0),
            ("EXISTS[#<other>]", 0.0),
            ("#<Wi dth>", 40.0),
            ("SQRT[ABS[-16]]", 4.0),
            ("EXP[LN[3]]", 3.0),
            ("ACOS[0.5]", 60.0),
            ("TAN[45]", 1.0),
            ("COS[60]", 0.5),
        ],
    );
}

#[test]
fn section_2_fanuc_precedence_and_functions() {
    check(
        &FANUC,
        &[
            ("[1+2*3]", 7.0),
            ("[10/4/5]", 0.5),
            ("[1 OR 6 AND 2]", 3.0),
            ("[5 XOR 1]", 4.0),
            ("[7 MOD 4]", 3.0),
            ("[7.5 MOD 3]", 2.0),
            ("FIX[-2.3]", -2.0),
            ("FUP[-2.3]", -3.0),
            ("ROUND[-2.5]", -3.0),
            ("ATAN[1]/[-1]", 135.0),
            ("ATAN[-1]/[-1]", 225.0),
            ("ATAN[-1,-1]", 225.0),
            ("ATAN[#1-7,2]", 0.0),
            ("ATAN[-1]", -45.0),
            ("ASIN[-0.5]", 330.0),
            ("ASIN[0.5]", 30.0),
            ("POW[2,10]", 1024.0),
            ("BIN[18]", 12.0),
            ("BCD[12]", 18.0),
            ("-#1", -7.0),
            ("[#1-#2*-#4]", 13.0),
            ("[#1-2]", 5.0),
            ("#[#4+1]", -2.5),
        ],
    );
}

#[test]
fn section_2_the_profile_chooses_the_range_of_angles() {
    let table = table();
    let mut context = Context::new(&FANUC, &table, AngleRange::Signed);
    for (text, expected) in [("ATAN[-1]/[-1]", -135.0), ("ASIN[-0.5]", -30.0)] {
        let (value, _) = evaluate(text.as_bytes(), 0, &mut context).expect("it has a value");
        assert!((value.expect("it is a number") - expected).abs() < 1e-12, "{text}");
    }
}

#[test]
fn section_2_round_in_a_word_is_to_the_least_increment() {
    let table = table();
    let mut context = context(&FANUC, &table);
    context.increments = 1_000.0;
    let (value, _) = evaluate(b"ROUND[1.23456]", 0, &mut context).expect("it has a value");
    assert!((value.expect("it is a number") - 1.235).abs() < 1e-12);
}

#[test]
fn section_2_vacant_values() {
    for text in ["#0", "#9", "[#9]", "-#9", "#[4+5]"] {
        assert_eq!(value(&FANUC, text), Ok(None), "{text}");
    }
    check(&FANUC, &[("[#9+0]", 0.0), ("[#9*5]", 0.0), ("ABS[#9]", 0.0), ("[5-#9]", 5.0)]);
    for (text, expected) in [
        ("[#9 EQ #0]", true),
        ("[#9 EQ 0]", false),
        ("[#9 NE 0]", true),
        ("[#9 NE #0]", false),
        ("[#9 GE 0]", true),
        ("[#9 GT 0]", false),
        ("[#9 LE 0]", true),
        ("[#9 LT 0]", false),
        ("[#9+0 EQ #0]", false),
    ] {
        assert_eq!(holds(&FANUC, text), Ok(expected), "{text}");
    }
}

#[test]
fn section_2_conditions() {
    for (text, expected) in [
        ("[#1 GT 5]", true),
        ("[#1+1 EQ 8]", true),
        ("[[#1 GT 5] AND [#2 GT 5]]", false),
        ("[[#1 GT 5] OR [#2 GT 5]]", true),
        ("[[#1 GT 5] XOR [#2 LT 5]]", false),
        ("[[#1+1] LE 8]", true),
        ("[0.1+0.2 EQ 0.3]", true),
        ("[0.1 EQ 0.1002]", false),
    ] {
        assert_eq!(holds(&FANUC, text), Ok(expected), "{text}");
        assert_eq!(holds(&LINUXCNC, text), Ok(expected), "{text}");
    }
    // Of a control's eight or so digits, and within the tolerance of the other.
    assert_eq!(holds(&FANUC, "[0.1 EQ 0.10001]"), Ok(false));
    assert_eq!(holds(&LINUXCNC, "[0.1 EQ 0.10001]"), Ok(true));
    assert_eq!(holds(&LINUXCNC, "[#1]"), Ok(true));
    assert_eq!(holds(&LINUXCNC, "[#1-7]"), Ok(false));
    for text in ["[#1]", "[#1 GT 5 AND #2 LT 5]", "[[#1 GT 5] + 1]", "[[#1 GT 5] AND 1]"] {
        assert_eq!(holds(&FANUC, text), Err("PRG-EXPRESSION-TRUTH".to_owned()), "{text}");
    }
    refused(&FANUC, &[("[#1 GT 5]", "PRG-EXPRESSION-TRUTH"), ("SIN[#1 GT 5]", "PRG-EXPRESSION-TRUTH")]);
}

#[test]
fn section_2_errors() {
    for rules in [&FANUC, &LINUXCNC] {
        refused(
            rules,
            &[
                ("[1/0]", "PRG-EXPRESSION-ARITHMETIC"),
                ("[1/[#1-7]]", "PRG-EXPRESSION-ARITHMETIC"),
                ("[1 MOD 0]", "PRG-EXPRESSION-ARITHMETIC"),
                ("SQRT[-1]", "PRG-EXPRESSION-ARITHMETIC"),
                ("ASIN[1.1]", "PRG-EXPRESSION-ARITHMETIC"),
                ("ACOS[-1.1]", "PRG-EXPRESSION-ARITHMETIC"),
                ("LN[0]", "PRG-EXPRESSION-ARITHMETIC"),
                ("EXP[1000]", "PRG-EXPRESSION-ARITHMETIC"),
                ("#[0.5]", "PRG-PARAMETER-NUMBER"),
                ("#[0-1]", "PRG-PARAMETER-NUMBER"),
                ("#10000", "PRG-PARAMETER-NUMBER"),
                ("SINE[30]", "PRG-EXPRESSION-FUNCTION"),
                ("[1+]", "PRG-EXPRESSION-MALFORMED"),
                ("[1+2", "PRG-EXPRESSION-MALFORMED"),
                ("[]", "PRG-EXPRESSION-MALFORMED"),
                ("[1.2.3]", "PRG-EXPRESSION-MALFORMED"),
                ("#", "PRG-EXPRESSION-MALFORMED"),
                ("[1 2 [3]]", "PRG-EXPRESSION-MALFORMED"),
                ("SIN", "PRG-EXPRESSION-MALFORMED"),
            ],
        );
    }
    refused(
        &FANUC,
        &[
            ("##1", "PRG-EXPRESSION-MALFORMED"),
            ("--5", "PRG-EXPRESSION-MALFORMED"),
            ("[2**3]", "PRG-EXPRESSION-MALFORMED"),
            ("#<width>", "PRG-EXPRESSION-MALFORMED"),
            ("#[#9]", "PRG-PARAMETER-NUMBER"),
            ("[-7 MOD 3]", "PRG-EXPRESSION-DIFFERS"),
            ("[1.5 AND 1]", "PRG-EXPRESSION-DIFFERS"),
            ("ADP[#1]", "PRG-EXPRESSION-DIFFERS"),
            ("EXISTS[#<width>]", "PRG-EXPRESSION-FUNCTION"),
            ("BIN[15]", "PRG-EXPRESSION-ARITHMETIC"),
            ("BCD[100000000]", "PRG-EXPRESSION-ARITHMETIC"),
            ("ATAN[0]/[0]", "PRG-EXPRESSION-ARITHMETIC"),
            ("ATAN[0,0]", "PRG-EXPRESSION-ARITHMETIC"),
        ],
    );
    refused(
        &LINUXCNC,
        &[
            ("#<other>", "PRG-PARAMETER-UNSET"),
            ("#<>", "PRG-PARAMETER-NAME"),
            ("POW[2,3]", "PRG-EXPRESSION-FUNCTION"),
            ("ATAN[1]", "PRG-EXPRESSION-MALFORMED"),
            ("EXISTS[#1]", "PRG-EXPRESSION-MALFORMED"),
            ("[[0-2]**0.5]", "PRG-EXPRESSION-ARITHMETIC"),
            ("[0**[0-1]]", "PRG-EXPRESSION-ARITHMETIC"),
        ],
    );
}

#[test]
fn section_2_depth() {
    let nested = |depth: usize| format!("{}1{}", "[".repeat(depth), "]".repeat(depth));
    for (rules, limit) in [(&FANUC, 5), (&LINUXCNC, 32)] {
        assert_eq!(value(rules, &nested(limit)), Ok(Some(1.0)));
        assert_eq!(value(rules, &nested(limit + 1)), Err("PRG-EXPRESSION-DEPTH".to_owned()));
    }
    assert_eq!(value(&FANUC, "SIN[[[[[0]]]]]"), Ok(Some(0.0)), "functions count");
    assert_eq!(value(&FANUC, "[SIN[[[[[0]]]]]]"), Err("PRG-EXPRESSION-DEPTH".to_owned()));
    assert_eq!(value(&LINUXCNC, &format!("{}1", "#".repeat(40))), Err("PRG-EXPRESSION-DEPTH".to_owned()));
}

#[test]
fn assignments() {
    let table = table();
    let read = |rules, text: &str| assignment(text.as_bytes(), 0, &mut context(rules, &table));
    let target = |text: &str| Target::Named(Name::read(text.as_bytes()).expect("a name"));
    let found = read(&FANUC, "#5 = #1+2*#2 (c)").expect("an assignment");
    assert_eq!((found.target, found.value, found.start, found.end), (Target::Numbered(5), Some(13.0), 0, 12));
    let vacant = read(&FANUC, "#5=#9").expect("an assignment");
    assert_eq!(vacant.value, None);
    let first = read(&LINUXCNC, "#3=6 G1 X#3").expect("an assignment");
    assert_eq!((first.target, first.value, first.end), (Target::Numbered(3), Some(6.0), 4));
    let named = read(&LINUXCNC, "#<_Foo Bar>=[#1 EQ 7]").expect("an assignment");
    assert_eq!((named.target, named.value), (target("_foobar"), Some(1.0)));
    assert_eq!(read(&LINUXCNC, "#3=#1+2").expect("an assignment").end, 5, "brackets are needed");
    assert_eq!(read(&FANUC, "#3=[#1 GT 2]").map_err(|defect| defect.code), Err(code::EXPRESSION_TRUTH));
    assert_eq!(read(&FANUC, "#3").map_err(|defect| defect.code), Err(code::EXPRESSION_MALFORMED));
    assert_eq!(read(&LINUXCNC, "##4=1").map(|found| found.target), Ok(Target::Numbered(2)));
}

#[test]
fn notes_on_equality_and_probes() {
    let table = table();
    let mut context = context(&FANUC, &table);
    for text in ["[#3 EQ 1]", "[#5061 NE 1]", "[#1 EQ 7]"] {
        condition(text.as_bytes(), 0, &mut context).expect("a condition");
    }
    let notes: Vec<_> = context.notes.iter().map(|note| (note.text().0.name(), note.start, note.end)).collect();
    assert_eq!(notes, [("PRG-EXPRESSION-EQUALITY", 1, 8), ("PRG-PARAMETER-PROBED", 1, 6)]);
    // Whether a value is vacant is exact, and no cure that compares otherwise asks for it.
    let mut vacant = self::context(&FANUC, &table);
    for text in ["[#3 EQ #0]", "[#0 NE #3]", "[#3EQ#8]"] {
        condition(text.as_bytes(), 0, &mut vacant).expect("a condition");
    }
    assert!(vacant.notes.is_empty(), "{:?}", vacant.notes);
    assert!(context.notes.iter().all(|note| !note.text().2.contains("GE")));
}
