use super::*;
use crate::{DialectName, ProgramName};

fn mill() -> LanguageSettings {
    LanguageSettings { dialect: DialectName::Mill, ..LanguageSettings::default() }
}

fn linuxcnc() -> LanguageSettings {
    LanguageSettings { dialect: DialectName::LinuxCnc, ..LanguageSettings::default() }
}

fn stretches(program: &str, settings: &LanguageSettings) -> Vec<(StretchKind, String, u32, u32)> {
    let outline = Outline::read(program.as_bytes(), settings);
    outline.stretches.into_iter().map(|it| (it.kind, it.name, it.first_line, it.last_line)).collect()
}

fn named(kind: StretchKind, name: &str, first: u32, last: u32) -> (StretchKind, String, u32, u32) {
    (kind, name.to_owned(), first, last)
}

#[test]
fn programs_loops_and_comments_of_macro_b() {
    let program = "\u{feff}%\r\nO1 (MAIN)\r\n(A)\r\n(B)\r\nN10 WHILE [#1 LT 3] DO1\r\nDO2\r\nEND2\r\nEND1\r\nM98 P2\r\nM30\r\nO2\r\n(C)\r\nM99\r\n%";
    let expected = [
        named(StretchKind::Program, "O1", 2, 10),
        named(StretchKind::Comment, "(A)", 3, 4),
        named(StretchKind::Block, "DO1", 5, 8),
        named(StretchKind::Block, "DO2", 6, 7),
        named(StretchKind::Program, "O2", 11, 14),
    ];
    assert_eq!(stretches(program, &mill()), expected);
    // Whatever ends the lines; an open loop is one line.
    assert_eq!(stretches(&program.replace("\r\n", "\r"), &mill()), expected);
    assert_eq!(stretches("WHILE [1] DO1\nO5\nEND1\n", &mill())[0], named(StretchKind::Block, "DO1", 1, 1));
    assert_eq!(stretches("", &mill()), []);
}

#[test]
fn o_words_nest_by_their_names() {
    let program =
        "o<a> sub\no1 if [1]\no1 else\no1 endif\no2 do\no3 repeat [2]\no3 endrepeat\no2 while [0]\no<a> endsub\n";
    let expected = [
        named(StretchKind::Subprogram, "o<a> sub", 1, 9),
        named(StretchKind::Block, "o1 if", 2, 4),
        named(StretchKind::Block, "o2 do", 5, 8),
        named(StretchKind::Block, "o3 repeat", 6, 7),
    ];
    assert_eq!(stretches(program, &linuxcnc()), expected);
}

#[test]
fn functions_last_from_their_code_to_the_one_that_ends_them() {
    let settings = LanguageSettings::default();
    let vibration = settings.path_vibration;
    let thread = settings.thread_vibration;
    let program = format!(
        "G{} F50 A0.1\nG1 X1\nG{}\nG{1}\nG{2} P{3} X20. Q1.3\nM30\n",
        vibration.on, vibration.off, thread.code, thread.on_p
    );
    let found = stretches(&program, &settings);
    assert_eq!(found[0], named(StretchKind::Function, "vibration along the path", 1, 3));
    assert_eq!(found[1], named(StretchKind::Function, "vibration of threads", 5, 6));
    assert_eq!(found.len(), 2);
}

#[test]
fn labels_are_those_of_their_program() {
    let outline = Outline::read(b"O1\nN10\nN20\nO2\nN10\nN10\nO7\n", &mill());
    assert_eq!(outline.find(&Target::Label(10), 3), [2]);
    assert_eq!(outline.find(&Target::Label(10), 4), [5, 6]);
    assert!(outline.find(&Target::Label(20), 4).is_empty());
    let program = |number, label| Target::Program { name: ProgramName::Number(number), label };
    assert_eq!(outline.find(&program(7, None), 1), [7]);
    assert_eq!(outline.find(&program(1, Some(20)), 7), [3]);
    let outline = Outline::read(b"%\n<SHAFT>\nN10\n<PIN>\nN10\n", &mill());
    let names: Vec<_> = outline.stretches.iter().map(|stretch| (stretch.name.as_str(), stretch.last_line)).collect();
    assert_eq!(names, [("<SHAFT>", 3), ("<PIN>", 5)]);
    assert_eq!(outline.find(&Target::Label(10), 4), [5]);
    let outline = Outline::read(b"o<rect> sub\no<rect> endsub\n", &linuxcnc());
    assert_eq!(outline.find(&Target::Subprogram("<rect>".into()), 2), [1]);
}

fn targets(line: &str, settings: &LanguageSettings) -> Vec<(String, Target)> {
    let found = Vocabulary::new(settings).targets(line.as_bytes()).into_iter();
    let text = |span: SourceSpan| line[span.column as usize - 1..][..span.length as usize].to_owned();
    found.map(|(span, target)| (text(span), target)).collect()
}

#[test]
fn calls_and_jumps_name_their_targets() {
    let program = |number, label| Target::Program { name: ProgramName::Number(number), label };
    let of = |line: &str| targets(line, &mill());
    assert_eq!(of("N5 M98 P1000 L2"), [("P1000".to_owned(), program(1_000, None))]);
    assert_eq!(of("M98 P31000"), [("P31000".to_owned(), program(1_000, None))]);
    assert_eq!(of("M98 P31000 L1"), [("P31000".to_owned(), program(31_000, None))]);
    assert_eq!(of("M98 P8 Q20"), [("P8".to_owned(), program(8, Some(20)))]);
    assert_eq!(of("G65 P9010 X1."), [("P9010".to_owned(), program(9_010, None))]);
    assert_eq!(of("IF [#1 EQ 2] GOTO 030"), [("GOTO 030".to_owned(), Target::Label(30))]);
    assert_eq!(of("goto5 (GOTO 7)"), [("goto5".to_owned(), Target::Label(5))]);
    let named = || Target::Program { name: ProgramName::Text("PIN-1".into()), label: None };
    assert_eq!(of("M98 <PIN-1> L3"), [("<PIN-1>".to_owned(), named())]);
    assert_eq!(of("G65<PIN-1> A1."), [("<PIN-1>".to_owned(), named())]);
    assert_eq!(of("(M98 P1000)"), []);
    assert_eq!(of("G4 P1000"), []);
    let lathe = LanguageSettings::default();
    let contour = targets("G71 P10 Q20 U0.4 W0.1 F0.2", &lathe);
    assert_eq!(contour, [("P10".to_owned(), Target::Label(10)), ("Q20".to_owned(), Target::Label(20))]);
    assert_eq!(targets("G71 U2. R0.5", &lathe), []);
    assert_eq!(
        targets("  o <Rect> call [1]", &linuxcnc()),
        [("o <Rect>".to_owned(), Target::Subprogram("<rect>".into()))]
    );
}

#[test]
fn words_have_roles() {
    let role = |word: &str, settings: &LanguageSettings| {
        let token = Lexer::new(word.as_bytes()).next().unwrap();
        Vocabulary::new(settings).role(&token)
    };
    let lathe = LanguageSettings::default();
    let on = format!("G{}", lathe.path_vibration.on);
    for (word, expected) in [
        ("G1", WordRole::Motion),
        ("G21", WordRole::Code),
        ("G999", WordRole::UnknownCode),
        ("M98", WordRole::Call),
        (on.as_str(), WordRole::Function),
        ("U-1.5", WordRole::Axis),
        ("I3", WordRole::Centre),
        ("F0.2", WordRole::Feed),
        ("S1000", WordRole::Speed),
        ("T0101", WordRole::Tool),
        ("N10", WordRole::Label),
        ("P3", WordRole::Parameter),
    ] {
        assert_eq!(role(word, &lathe), expected, "{word}");
    }
}

#[test]
fn what_returns_and_ends_no_program_is_called() {
    let (mill, linuxcnc) = (mill(), linuxcnc());
    for (program, settings, called) in [
        ("%\nO9001 (DRILL)\nG1 X41 Y30\nM99\n%", &mill, true),
        ("G1 X41 Y30\nX2 Z99\nN99 M99", &mill, true),
        ("G1 X41 Y30\nX2 Z99", &mill, false),
        ("O1\nM98 P2\nM30\nO2\nG1 X1\nM99", &mill, false),
        ("O1\nG1 X1\nM30", &mill, false),
        ("O1\nG1 X1\n(M99)", &mill, false),
        (
            "(holes)\no<holes> sub\n o1 if [#1 GT 0]\n  o<hole> call\n o1 endif\n G1 X#1\no<holes> endsub\n",
            &linuxcnc,
            true,
        ),
        ("o100 sub\nG1 X1\no100 endsub\nM2", &linuxcnc, true),
        ("o100 sub\nG1 X1\no100 endsub\no100 call\nM2", &linuxcnc, false),
        ("o100 sub\nG1 X1\no100 endsub\nG0 X5\n", &linuxcnc, false),
        ("G1 X1\nM2", &linuxcnc, false),
    ] {
        assert_eq!(Outline::read(program.as_bytes(), settings).is_called(), called, "{program}");
    }
    let outline = Outline::read(b"O1 (BAR)\nT0101 S1200 M3\nG1 X1\nM99", &mill);
    assert!(outline.is_called() && outline.prepares_cutting());
    assert!(!Outline::read(b"O1\nT0101 S#1 M3\nM99", &mill).prepares_cutting());
}
