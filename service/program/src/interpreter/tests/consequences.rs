//! What only follows from something unread is no finding of its own.

use super::*;

#[test]
fn modal_words_that_could_not_be_read() {
    check(&mill(), "G1 X1 F..01\nX2\nY3", "! 1:7+5 PRG-NUMBER-INVALID");
    check(&mill(), "F..01\nG1 X2\nF10\nG1 X3", "line X2 -> X3 @10/min\n! 1:1+5 PRG-NUMBER-INVALID");
    check(&mill(), "F\u{2212}5\nG1 X2", "! 1:1+5 PRG-LOOKALIKE");
    check(&lathe(), "G97 S.. M3\nG1 X1 F.1\nG32 Z-5 F2", "! 1:5+3 PRG-NUMBER-INVALID");
    check(&lathe(), "S500 M..\nG1 X1 F.1", "! 1:6+3 PRG-NUMBER-INVALID");
    check(&mill(), "T..\nM6\nT2\nM6", "tool 2.0\n! 1:1+3 PRG-NUMBER-INVALID");
    check(&mill(), "G..\nX5", "! 1:1+3 PRG-NUMBER-INVALID");
    check(&lathe(), "G50 S..\nG96 S100 M3", "spindle cw 100 m/min max inf\n! 1:5+3 PRG-NUMBER-INVALID");
    check(&mill(), "G4 P..", "! 1:4+3 PRG-NUMBER-INVALID");
    check(&mill(), "G0 X..\nG2 X1 Y1 I0.5 J5 F10\nG0 X0 Y0", "rapid X1 Y1 -> 0\n! 1:4+3 PRG-NUMBER-INVALID");
}

#[test]
fn the_corner_of_a_cut_that_cannot_be_carried_out() {
    check(&mill(), "T1 T2\nG1 X5. F100\nX10. ,R1.\nY10.", "! 1:4+2 PRG-WORD-DUPLICATE");
    check(&lathe(), "T1 T2\nM3 S500\nG1 Z-5. F.1\nZ-10. R1.\nX10.", "spindle cw 500\n! 1:4+2 PRG-WORD-DUPLICATE");
}

#[test]
fn a_first_feed_or_speed_without_a_value() {
    check(&lathe(), "S500 M3\nG1 X1 F#101\nX2", "spindle cw 500\n! 2:7+5 PRG-VACANT-WORD");
    check(&lathe(), "S#1 M3\nG1 X1 F.1\nG32 Z-5 F2", "! 1:1+3 PRG-VACANT-WORD");
    check(&lathe(), "S500 M3\nG32 Z-5 F#101", "spindle cw 500\n! 2:9+5 PRG-VACANT-WORD");
    // What was in force stays so.
    check(&mill(), "G1 X1 F10\nX2 F#101", "line 0 -> X1 @10/min\nline X1 -> X2 @10/min\nw 2:4+5 PRG-VACANT-WORD");
}

#[test]
fn what_does_not_follow_is_said() {
    check(&mill(), "S..\nG1 X1", "! 1:1+3 PRG-NUMBER-INVALID\n! 2:1+5 PRG-FEED-MISSING");
    check(
        &mill(),
        "F..\nG1 X1 F10\nG93\nG1 X2",
        "line 0 -> X1 @10/min\n! 1:1+3 PRG-NUMBER-INVALID\n! 4:1+5 PRG-FEED-MISSING",
    );
    check(
        &mill(),
        "G0 X..\nX0 Y0\nG2 X1 Y1 I0.5 J5 F10",
        "! 1:4+3 PRG-NUMBER-INVALID\n! 3:10+4 PRG-ARC-RADIUS-MISMATCH",
    );
    check(&mill(), "P..\nG4", "! 1:1+3 PRG-NUMBER-INVALID\n! 2:1+2 PRG-DWELL-TIME");
}

#[test]
fn a_cut_with_something_unknown_is_judged_by_nothing() {
    // Neither the feed nor the speed of before counts for what follows.
    check(
        &mill(),
        "G1 X1 F10\nF..\nX2\nG0 X3\nG1 X4 F5",
        "line 0 -> X1 @10/min\nrapid X2 -> X3\nline X3 -> X4 @5/min\n! 2:1+3 PRG-NUMBER-INVALID",
    );
    check(
        &lathe(),
        "S500 M3\nG1 X2 F.1\nS..\nX4\nG32 Z-5 F2\nS600\nG1 X6 F.1",
        "spindle cw 500
         line 0 -> X1 @0.1/rev
         spindle cw 600
         line X2 Z-5 -> X3 Z-5 @0.1/rev
         ! 3:1+3 PRG-NUMBER-INVALID",
    );
    check(
        &mill(),
        "G1 X1 F10\nT..\nM6\nG1 X2\nT2 M6\nX3",
        "line 0 -> X1 @10/min\ntool 2.0\nline X2 -> X3 @10/min\n! 2:1+3 PRG-NUMBER-INVALID",
    );
    check(&lathe(), "G32 Z-5 F..\nZ-6", "! 1:9+3 PRG-NUMBER-INVALID");
}

/// A target that is not there because its number only looks like one.
#[test]
fn a_number_that_only_looks_like_one_is_the_cause_of_a_missing_target() {
    let found = |settings: &LanguageSettings, program: &str| {
        let (_, findings) = interpret(program.as_bytes(), settings.clone());
        let found = findings.findings().iter().map(|finding| (finding.span.line, finding.code.name()));
        found.collect::<Vec<_>>()
    };
    let contour = |first: &str| {
        format!("S500 M3\nG0 X50 Z2\nG71 U1 R.5\nG71 P10 Q20 U.4 W.1 F.15\n{first} G0 X20\nG1 Z-10\nN20 X50\nM30\n")
    };
    for first in ["N\u{410}10", "\u{ff2e}10", "N1\u{ff10}", "N1\u{41e}", "/\u{39d}10"] {
        assert_eq!(found(&lathe(), &contour(first)), [(5, "PRG-LOOKALIKE")], "{first}");
    }
    for first in ["N11", "\u{ff2e}11", "G1 (\u{2212})"] {
        assert_eq!(found(&lathe(), &contour(first))[0], (4, "PRG-TURNING-CONTOUR"), "{first}");
    }
    for (jump, there) in [("GOTO 10", "\u{39d}10 G1"), ("M98 P1000", "\u{41e}1000"), ("M98 P1000", "O1\u{ff10}00")] {
        let program = format!("{jump}\nM30\n{there} X1\nM99\n");
        assert_eq!(found(&mill(), &program), [(3, "PRG-LOOKALIKE")], "{program}");
    }
}

/// The settings of the machine of an example; `None` where they are those of a profile.
fn settings_of(machine: &str) -> Option<LanguageSettings> {
    match machine {
        "lathe" => Some(lathe()),
        "mill" => Some(mill()),
        "mill, language.dialect = DIALECT_LINUXCNC" => Some(linuxcnc()),
        _ => None,
    }
}

/// The findings of a program, as lines with codes.
fn codes(program: &str, settings: &LanguageSettings) -> Vec<(u32, &'static str)> {
    let (_, findings) = Interpreter::new(settings.clone()).with_tools(tools()).read_all(program.as_bytes());
    findings.findings().iter().map(|finding| (finding.span.line, finding.code.name())).collect()
}

/// Each word that explains a finding does, in its block or before it.
#[test]
fn what_explains_a_finding_is_found_in_its_place() {
    let mut seen = 0;
    let mut wrong = Vec::new();
    for entry in code::TABLES.iter().flat_map(|table| table.entries) {
        let crate::Example::Program { machine, text } = entry.example else { continue };
        let Some(settings) = settings_of(machine) else { continue };
        let Some(&(line, _)) = codes(text, &settings).iter().find(|(_, code)| *code == entry.name) else { continue };
        for explanation in entry.explained_by {
            for letter in explanation.letters.chars() {
                let mut lines: Vec<_> = text.lines().map(str::to_owned).collect();
                let own = &mut lines[line as usize - 1];
                // A word that is there is the one that cannot be read; codes stay.
                let words = own
                    .split(' ')
                    .filter(|word| "GM".contains(letter) || !word.starts_with(letter))
                    .collect::<Vec<_>>()
                    .join(" ");
                *own = format!("{words} {letter}..");
                let in_block = lines.join("\n");
                let before = text.lines().enumerate().map(|(at, text)| match at + 1 == line as usize {
                    true => format!("{letter}..\n{text}\n"),
                    false => format!("{text}\n"),
                });
                let before: String = before.collect();
                for program in core::iter::once(in_block).chain((!explanation.in_block).then_some(before)) {
                    let found = codes(&program, &settings);
                    let is_found = found.iter().any(|(at, code)| *code == entry.name && *at <= line + 1);
                    if is_found || found.iter().all(|(_, code)| *code != "PRG-NUMBER-INVALID") {
                        wrong.push(format!("{} by {letter}: {program}", entry.name));
                    }
                    seen += 1;
                }
            }
        }
    }
    assert!(seen > 200 && wrong.is_empty(), "{seen}: {wrong:#?}");
}

/// Rows about what is missing that no unread word explains: text and statements, marks of the file, and notes.
const UNEXPLAINED: &[&str] = &[
    "PRG-TEXT",
    "PRG-NUMBER-MISSING",
    "PRG-NUMBER-STRAY",
    "PRG-NO-END",
    "PRG-EXPRESSION-ARITHMETIC",
    // A number that only looks like one is reported in its place.
    "PRG-JUMP-TARGET",
    "PRG-LOOP",
    "PRG-ARGUMENT-POINT",
    "PRG-MAIN-RETURN",
    "PRG-THREAD-CHAMFER",
    "PRG-COMP-IDLE",
    "PRG-DATA-OPEN",
];

#[test]
fn what_is_missing_has_what_explains_it() {
    let unexplained = code::TABLES.iter().flat_map(|table| table.entries).filter(|entry| {
        let is_missing = entry.meaning.contains("without") || entry.meaning.contains("missing");
        is_missing && entry.explained_by.is_empty()
    });
    let mut unexplained: Vec<_> = unexplained.map(|entry| entry.name).collect();
    let mut expected = UNEXPLAINED.to_vec();
    unexplained.sort_unstable();
    expected.sort_unstable();
    assert_eq!(unexplained, expected);
}

#[test]
fn what_follows_from_an_unread_word_of_another_kind() {
    check(
        &lathe(),
        "S500 M3\nT..\nG41 G1 X40 F.1\nG40 G0 X60",
        "spindle cw 500\nrapid X20 -> X30\n! 2:1+3 PRG-NUMBER-INVALID",
    );
    check(&mill(), "G41 D.. G1 X10 F100\nG0 X5", "rapid X10 -> X5\n! 1:5+3 PRG-NUMBER-INVALID");
    check(&mill(), "M98 P..\nG1 X5 F10", "! 1:5+3 PRG-NUMBER-INVALID");
    check(
        &lathe(),
        "S500 M3\nG0 X50 Z2\nG76 P010060 Q50 R\u{2212}0.02\nG76 X18.16 Z-20 P920 Q200 F1.5",
        "spindle cw 500\nrapid 0 -> X25 Z2\n! 3:17+8 PRG-LOOKALIKE",
    );
    assert_eq!(codes("G51 X0 P..\nG1 X20 F100\nG50\nM30", &mill()), [(1, "PRG-NUMBER-INVALID")]);
}
