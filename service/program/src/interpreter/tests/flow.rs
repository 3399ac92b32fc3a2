//! Control flow: section 3 of the language page, and its worked examples 6 and 7.

mod endless;
mod haas;
mod labels;
mod names;

use super::*;
use crate::{DrillingSettings, DrillingStyle, Reader, Reading, SourcePages};

/// End points (X, Y, Z) of all moves, with the findings.
fn ends(program: &str, settings: &LanguageSettings) -> (Vec<[f64; 3]>, FindingLog) {
    let (operations, findings) = interpret(program.as_bytes(), settings.clone());
    (points(&operations), findings)
}

fn points(operations: &[Operation]) -> Vec<[f64; 3]> {
    let end = |operation: &Operation| match &operation.kind {
        OperationKind::Move(step) => Some([step.end[0], step.end[1], step.end[2]]),
        _ => None,
    };
    operations.iter().filter_map(end).collect()
}

/// X of all moves of a program without findings.
fn xs(program: &str, settings: &LanguageSettings) -> Vec<f64> {
    let (points, findings) = ends(program, settings);
    let wrong: Vec<_> = findings.into_findings();
    assert!(wrong.is_empty(), "{program}\n{wrong:#?}");
    points.iter().map(|point| point[0]).collect()
}

fn mill_xs(program: &str) -> Vec<f64> {
    xs(&format!("{program}\nM30\n"), &LanguageSettings::mill())
}

fn haas_mill() -> LanguageSettings {
    LanguageSettings {
        drilling: DrillingSettings { style: DrillingStyle::Haas, ..DrillingSettings::default() },
        ..LanguageSettings::mill()
    }
}

fn linuxcnc_xs(program: &str) -> Vec<f64> {
    xs(&format!("{program}\nM2\n"), &LanguageSettings::linuxcnc())
}

/// Codes of the findings of a program, which must be refused.
fn codes(program: &str, settings: &LanguageSettings) -> Vec<String> {
    let (_, findings) = ends(program, settings);
    assert!(findings.has_errors(), "{program}");
    findings.into_findings().iter().map(|finding| finding.code.name().to_owned()).collect()
}

fn mill_codes(program: &str) -> Vec<String> {
    codes(program, &LanguageSettings::mill())
}

#[test]
fn what_follows_a_comment_within_a_comment_is_still_read() {
    assert_eq!(mill_codes("(TOOL 1 (10MM) ROUGH)\nG0 X1\nG9999\nM30"), ["PRG-TEXT", "PRG-UNKNOWN-CODE"]);
}

#[test]
fn goto_leads_to_the_block_of_its_number_forward_and_back() {
    assert_eq!(mill_xs("GOTO 20\nN10 G0 X1\nGOTO30\nN20 G0 X2\nGOTO 10\nN30 X3"), [2.0, 1.0, 3.0]);
    assert_eq!(mill_xs("IF [1 EQ 2] GOTO 20\nG0 X1\nN20 G0 X2"), [1.0, 2.0]);
    assert_eq!(mill_xs("IF [1 LT 2] GOTO[10+10]\nG0 X1\nN20 G0 X2"), [2.0]);
}

#[test]
fn a_condition_before_m99_is_a_jump_of_haas_controls() {
    let haas = haas_mill();
    let haas_xs = |program: &str| xs(&format!("{program}\nM30\n"), &haas);
    assert_eq!(haas_xs("#1=1\nN10 [#1 EQ 1] M99 P50\nG0 X9\nN50 G0 X1"), [1.0]);
    assert_eq!(haas_xs("#1=2\n[#1 EQ 1] M99 P50\nG0 X9\nN50 G0 X1"), [9.0, 1.0]);
    assert_eq!(haas_xs("IF [1 EQ 1] M99 P50 (ON)\nG0 X9\nN50 G0 X1"), [1.0]);
    // Every value but 0 is true there.
    assert_eq!(haas_xs("#1=3\nWHILE [#1] DO1\nG0 X#1\n#1=#1-1\nEND1\nIF [#1] GOTO 9\nX7\nN9"), [3.0, 2.0, 1.0, 7.0]);
    // In a called program it goes on there, without P back to the caller.
    assert_eq!(haas_xs("M98 P1\nX5\nM30\nO1\n[1 EQ 1] M99 P20\nG0 X9\nN20 G0 X1\nM99"), [1.0, 5.0]);
    assert_eq!(haas_xs("M98 P1\nX5\nM30\nO1\nG0 X1\n[1 EQ 1] M99\nX9\nM99"), [1.0, 5.0]);
    assert_eq!(haas_xs("M98 P1\nX5\nM30\nO1\nM99 P20\nG0 X9\nN20 G0 X1\nM99"), [1.0, 5.0]);
    assert_eq!(haas_xs("M98 P1\nX5\nN20 X6\nM30\nO1\nG0 X1\nM99 P20"), [1.0, 6.0], "only the caller has it");
    let both = "M98 P1\nN20 G0 X5\nM30\nO1\nM99 P20\nN20 G0 X1\nM99\n";
    assert_eq!(codes(both, &haas), ["PRG-JUMP-TARGET"]);
    assert_eq!(mill_codes("#1=1\n[#1 EQ 1] M99 P50\nN50 G0 X1\nM30"), ["PRG-STATEMENT"]);
    for (program, settings) in [("IF [1 EQ 1] M99 P50 G0 X5\nN50\nM30", &mill()), ("[1 EQ 1] M99 X5\nM30", &haas)] {
        assert_eq!(codes(program, settings), ["PRG-STATEMENT"], "{program}");
    }
}

#[test]
fn loops_of_macro_b_run_while_their_condition_holds() {
    assert_eq!(mill_xs("#1=1\nWHILE [#1 LE 3] DO1\nG0 X#1\n#1=#1+1\nEND1\nX9"), [1.0, 2.0, 3.0, 9.0]);
    let nested = "#1=1\nWHILE[#1LE2]DO1\n#2=1\nWHILE[#2LE2]DO2\nG0 X[10*#1+#2]\n#2=#2+1\nEND2\n#1=#1+1\nEND1";
    assert_eq!(mill_xs(nested), [11.0, 12.0, 21.0, 22.0]);
    let left = "#1=0\nDO1\n#1=#1+1\nG0 X#1\nIF[#1 GE 2] GOTO 5\nEND1\nN5 X7\n#1=0\nWHILE[#1 LT 1]DO1\n#1=1\nX8\nEND1";
    assert_eq!(mill_xs(left), [1.0, 2.0, 7.0, 8.0], "a number is used again");
    assert_eq!(mill_xs("IF [1 EQ 1] THEN #1=7\nG0 X#1"), [7.0]);
}

#[test]
fn subprograms_are_called_by_number_and_return() {
    let sub = "G0 X1\nM98 P1000\nX2\nM30\nO1000\nG91\nX10\nG90\nM99";
    assert_eq!(mill_xs(sub), [1.0, 11.0, 2.0]);
    assert_eq!(mill_xs("G0 X0.5\nM98 P1000 L3\nM30\nO1000\nG91 X1\nG90\nM99"), [0.5, 1.5, 2.5, 3.5]);
    assert_eq!(mill_xs("G91\nM98 P20001\nG90\nM30\nO0001\nG0 X1\nM99"), [1.0, 2.0], "four digits of program");
    assert_eq!(mill_xs("M98 P1\nN10 G0 X5\nM30\nN20 X6\nM30\nO1\nG0 X1\nM99 P20"), [1.0, 6.0], "back to a block");
    assert_eq!(mill_xs("M97 P100 L2\nM30\nN100 G91 G0 X1\nM99"), [1.0, 2.0]);
    let eight = LanguageSettings { program_number_digits: 8, ..LanguageSettings::mill() };
    assert_eq!(xs("M98 P20001\nM30\nO20001\nG0 X3\nM99\n", &eight), [3.0]);
}

#[test]
fn a_main_program_that_ends_with_m99_is_run_once() {
    let (points, findings) = ends("G0 X1\nM99\nG0 X2\n", &LanguageSettings::mill());
    assert_eq!(points, [[1.0, 0.0, 0.0]]);
    let codes: Vec<_> = findings.into_findings().iter().map(|it| (it.code.name(), it.severity)).collect();
    assert_eq!(codes, [("PRG-MAIN-RETURN", Severity::Info)]);
}

#[test]
fn a_main_program_that_goes_back_without_a_condition_is_run_once() {
    for (program, ends_at) in [
        ("G0 X1\nN10 X2\nX3\nM99 P10\n", 3.0),
        // Counted, but nobody asks for the count.
        ("N10 #1=#1+1\nG0 X#1\nM99 P10\nM30\n", 1.0),
        ("N10 G0 X1\nM98 P100\nM99 P10\nM30\nO100\nG0 X2\nM99\n", 2.0),
    ] {
        let (points, findings) = ends(program, &LanguageSettings::mill());
        assert_eq!(points.last().map(|it| it[0]), Some(ends_at), "{program}");
        let codes: Vec<_> = findings.into_findings().iter().map(|it| it.code.name()).collect();
        assert_eq!(codes, ["PRG-MAIN-RETURN"], "{program}");
    }
    // Where something is decided it is a jump.
    assert_eq!(mill_xs("N10 #1=#1+1\nG0 X#1\nIF [#1 GT 2] GOTO 20\nM99 P10\nN20"), [1.0, 2.0, 3.0]);
    assert_eq!(mill_xs("#2=10\nN10 G0 X#2\n#2=#2+10\nM99 P#2\nN20 X7\nM99 P30\nN30"), [10.0, 7.0]);
    assert_eq!(xs("N10 #1=#1+1\nG0 X#1\n[#1 GT 2] M99 P20\nM99 P10\nN20 M30\n", &haas_mill()), [1.0, 2.0, 3.0]);
}

#[test]
fn macro_calls_pass_arguments() {
    let program =
        "G65 P9100 A5. B10. I1. I2. K3.\nM30\nO9100\nG0 X#1 Y#2\nX#4\nX#7\nX#9\nIF [#5 EQ #0] THEN #5=7\nX#5\nM99";
    assert_eq!(mill_xs(program), [5.0, 1.0, 2.0, 3.0, 7.0]);
    let (points, _) = ends("G0 Y4\nG65 P1 A1.\nM30\nO1\nG0 X#1 Y#3\nM99\n", &LanguageSettings::mill());
    assert_eq!(points[1], [1.0, 4.0, 0.0], "Y#3 is vacant: only X moves");
    let own = "#1=4\nG65 P1 A9.\nG0 X#1\nM30\nO1\n#1=8\nM99";
    assert_eq!(mill_xs(own), [4.0], "locals are those of the call");
    assert_eq!(mill_xs("#1=4\nM98 P1\nG0 X#1\nM30\nO1\n#1=8\nM99"), [8.0], "M98 shares them");
    // A feed is passed as it is written, as in a block.
    let least = LanguageSettings { decimal_point: crate::DecimalPointRule::LeastIncrement, ..LanguageSettings::mill() };
    let (points, _) = ends("G65 P1 A100 E7 F100\nM30\nO1\nG0 X#1 Y#8 Z#9\nM99\n", &least);
    assert_eq!(points, [[0.1, 7.0, 100.0]]);
    assert_eq!(mill_xs("G65 P1 L3 A1.\nM30\nO1\nG0 X#1\n#1=#1+1\nM99"), [1.0, 2.0, 3.0], "repeats keep changed locals");
}

#[test]
fn modal_macros_follow_every_block_that_moves() {
    let program = "G66 P1 A5.\nG0 X1\nM8\nX2\nG67\nX3\nM30\nO1\nG0 Z#1\nZ0\nM99";
    let (points, findings) = ends(program, &LanguageSettings::mill());
    assert!(!findings.has_errors(), "{findings:#?}");
    let z: Vec<_> = points.iter().map(|point| (point[0], point[2])).collect();
    assert_eq!(z, [(1.0, 0.0), (1.0, 5.0), (1.0, 0.0), (2.0, 0.0), (2.0, 5.0), (2.0, 0.0), (3.0, 0.0)]);
    // A block that names the place where the tool is, too, unless its axis words are none of a move.
    let there =
        "G0 X1\nG66 P1\nX1\nG91 Y0\nG90 G4 X1.\nG52 X0\nG51.1 X0\nG50.1 X0\nM8\nG67\nX1\nM30\nO1\nG91 G0 Z1\nG90\nM99";
    let (points, findings) = ends(there, &LanguageSettings::mill());
    assert!(!findings.has_errors(), "{findings:#?}");
    assert_eq!(points, [[1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, 2.0]]);
    let stacked = "G66 P1\nG66 P2\nG0 X1\nG67\nG67\nX9\nM30\nO1\nG91 G0 Z1\nG90\nM99\nO2\nG0 Y2\nM99";
    let (points, findings) = ends(stacked, &LanguageSettings::mill());
    assert!(!findings.has_errors(), "{findings:#?}");
    assert_eq!(
        points,
        [[1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [1.0, 2.0, 1.0], [9.0, 2.0, 1.0]],
        "the newest, then the one before"
    );
}

#[test]
fn o_word_loops_and_branches() {
    let example = "#1=0\no1 while [#1 LT 3]\nG0 X#1\n#1=[#1+1]\no1 endwhile\no2 repeat [2]\nG91 Y1\nG90\no2 endrepeat";
    let (points, findings) = ends(&format!("{example}\nM2\n"), &LanguageSettings::linuxcnc());
    assert!(!findings.has_errors(), "{findings:#?}");
    assert_eq!(points, [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [2.0, 2.0, 0.0]]);
    let branches = |value: u32| {
        format!(
            "#1={value}\no1 if [#1 EQ 1]\nG0 X1\no1 elseif [#1 EQ 2]\nG0 X2\no1 elseif [#1 EQ 3]\nG0 X3\no1 else\nG0 X4\no1 endif\nX9"
        )
    };
    for (value, x) in [(1, 1.0), (2, 2.0), (3, 3.0), (4, 4.0)] {
        assert_eq!(linuxcnc_xs(&branches(value)), [x, 9.0], "{value}");
    }
    assert_eq!(linuxcnc_xs("#1=0\no1 do\n#1=[#1+1]\nG0 X#1\no1 while [#1 LT 2]\nX5"), [1.0, 2.0, 5.0]);
    let leaving = "#1=0\no1 while [1]\n#1=[#1+1]\no2 if [#1 EQ 2]\no1 continue\no2 endif\no3 if [#1 GT 3]\no1 break\no3 endif\nG0 X#1\no1 endwhile\nX9";
    assert_eq!(linuxcnc_xs(leaving), [1.0, 3.0, 9.0]);
    assert_eq!(linuxcnc_xs("G91\no1 repeat [2.5]\nG0 X1\no1 endrepeat\no2 repeat [0]\nX5\no2 endrepeat"), [1.0, 2.0]);
    assert_eq!(linuxcnc_xs("G91\no1 repeat [2.7]\nG0 X1\no1 endrepeat"), [1.0, 2.0, 3.0]);
}

#[test]
fn o_word_subprograms_have_arguments_and_values() {
    let example = "o<rect> sub\n#31=5\n#<a>=1\no<rect> endsub [#1+#2]\n#1=3\n#<a>=9\no<rect> call [10] [20]\nG0 X#<_value>\nX#1\nX#31\nX#<a>";
    assert_eq!(linuxcnc_xs(example), [30.0, 3.0, 5.0, 9.0]);
    let early = "o100 sub\no101 if [#1 GT 1]\no100 return [7]\no101 endif\no100 endsub [8]\no100 call [2]\nG0 X#<_value>\no100 call [0]\nX#<_value>";
    assert_eq!(linuxcnc_xs(early), [7.0, 8.0]);
    let recursion = "o1 sub\nG0 X#1\no2 if [#1 GT 1]\no1 call [#1-1]\no2 endif\no1 endsub\no1 call [3]";
    assert_eq!(linuxcnc_xs(recursion), [3.0, 2.0, 1.0]);
    let numbered = "G91 G0 X1\nM98 P2000 L2\nM2\no2000\nG0 X5\nM99\n";
    assert_eq!(xs(numbered, &LanguageSettings::linuxcnc()), [1.0, 6.0, 11.0]);
}

#[test]
fn what_cannot_be_followed_is_refused_with_its_place() {
    for (program, code) in [
        ("GOTO 10\nM30", "PRG-JUMP-TARGET"),
        ("GOTO 10\nN10 G0 X1\nN10 G0 X2\nM30", "PRG-JUMP-TARGET"),
        ("#1=1\nGOTO 10\nWHILE[#1 LT 3]DO1\nN10 #1=#1+1\nEND1\nM30", "PRG-JUMP-TARGET"),
        ("WHILE [1 EQ 1] DO1\nM30", "PRG-LOOP"),
        ("END1\nM30", "PRG-LOOP"),
        ("#1=0\nWHILE[#1 LT 1]DO1\nWHILE[#1 LT 1]DO2\nEND1\nEND2\nM30", "PRG-LOOP"),
        ("M98 P77\nM30", "PRG-SUBPROGRAM-MISSING"),
        ("M98 P1\nM30\nO1\nG0 X1\nO2\nM99", "PRG-SUBPROGRAM-END"),
        ("M98 P1\nM30\nO1\nG0 X1\n", "PRG-SUBPROGRAM-END"),
        ("M98 P1\nM30\nO1\nM98 P1\nM99", "PRG-CALL-DEPTH"),
        ("G65 P1\nM30\nO1\nG65 P1\nM99", "PRG-CALL-DEPTH"),
        ("G65 P1 A1. A2.\nM30\nO1\nM99", "PRG-WORD-DUPLICATE"),
        ("G65 P1 P1 A1.\nM30\nO1\nM99", "PRG-WORD-DUPLICATE"),
        // Nothing else beside it, such as how the word were written with a point.
        ("G65 P1 O5 A1.\nM30\nO1\nM99", "PRG-STATEMENT"),
        ("G65 P1 A1. N6\nM30\nO1\nM99", "PRG-STATEMENT"),
        ("#1=0\nWHILE [#1 LT 5] DO1\nEND1\nM30", "PRG-ENDLESS"),
        ("N1 GOTO 1\nM30", "PRG-ENDLESS"),
        ("IF [1 EQ 1] G1 X5\nM30", "PRG-STATEMENT"),
        ("IF [1 EQ 1] THEN G0 X5\nM30", "PRG-STATEMENT"),
        ("WHILE [1 EQ 1] DO4\nM30", "PRG-STATEMENT"),
        ("G0 X5 G65 P1\nM30\nO1\nM99", "PRG-STATEMENT"),
        ("M8 G66 P1\nX1\nG67\nM30\nO1\nM99", "PRG-STATEMENT"),
    ] {
        assert_eq!(mill_codes(program), [code], "{program}");
    }
    for (program, code) in [
        ("o1 if [0]\nM2", "PRG-LOOP"),
        ("o1 endwhile\nM2", "PRG-LOOP"),
        ("o1 while [1]\no1 endwhile\nM2", "PRG-ENDLESS"),
        ("o<none> call\nM2", "PRG-SUBPROGRAM-MISSING"),
        ("o1 sub\no1 call\no1 endsub\no1 call\nM2", "PRG-CALL-DEPTH"),
        ("o1 if [1] G0 X1\no1 endif\nM2", "PRG-STATEMENT"),
        ("IF [1 EQ 1] GOTO 10\nN10 G0 X1\nM2", "PRG-STATEMENT"),
        ("WHILE [1 EQ 1] DO1\nEND1\nM2", "PRG-STATEMENT"),
        ("N10 GOTO 20\nN20 G0 X1\nM2", "PRG-STATEMENT"),
    ] {
        let found = codes(program, &LanguageSettings::linuxcnc());
        assert_eq!(found, [code], "{program}");
    }
}

/// Where the tool goes in which program and line, and what is found, of a program with further files.
fn with_files(programs: &[&str], names: &[&str]) -> (Vec<(u32, u32, f64)>, Vec<Finding>) {
    let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
    let mut reader = Reader::new(Interpreter::new(LanguageSettings::mill()).with_programs(names.into()));
    let mut pages = SourcePages::default();
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    loop {
        match reader.read_line(&mut pages, &mut operations, &mut findings) {
            Reading::More => {}
            Reading::NeedInput => {
                let wanted = pages.wanted();
                match &programs[wanted.program as usize].as_bytes()[wanted.offset as usize..] {
                    [] => pages.finish(),
                    rest => pages.push(&rest[..rest.len().min(7)]),
                }
            }
            Reading::Ended => break,
        }
    }
    let moves = operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Move(step) => Some((operation.span.program, operation.span.line, step.end[0])),
        _ => None,
    });
    (moves.collect(), findings.into_findings())
}

#[test]
fn further_files_are_found_by_name_and_by_number() {
    let main = "G0 X1\nM98 P1000\nM98 P2000\nX4\nM30\n";
    let programs = [main, "O1000\nG0 X2\nM99\n", "%\nO0005\nM99\nO2000\nG0 X3\nM99\n%\n"];
    let (found, wrong) = with_files(&programs, &["subs/O1000.nc", "library.nc"]);
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(found, [(0, 1, 1.0), (1, 2, 2.0), (2, 5, 3.0), (0, 4, 4.0)]);
    // With titles, and one without a number of its own.
    let programs = [
        "%MAIN\nM98 P1000\nM98 P2000\nM30\n%\n",
        "%FIRST SUB\nO1000\nG0 X2\nM99\n%\n",
        "\n%SECOND SUB\nG0 X3\nM99\n%\n",
    ];
    let (found, wrong) = with_files(&programs, &["O1000.nc", "O2000.nc"]);
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(found, [(1, 3, 2.0), (2, 3, 3.0)]);
}

/// Behind the closing `%` nothing can follow: what called the program would be cut off without a word.
#[test]
fn a_called_program_is_not_ended_by_the_end_of_its_file() {
    for sub in ["O1000\nG0 X2\n%\n", "G0 X2\n%\n", "%\nG0 X2\n%\n", "%TITLE\nG0 X2\n", "%G20\nG0 X2\nM99\n%\n"] {
        let (_, wrong) = with_files(&["M98 P1000\nX4\nM30\n", sub], &["O1000.nc"]);
        let codes: Vec<_> = wrong.iter().map(|finding| finding.code.name()).collect();
        assert!(codes.contains(&"PRG-SUBPROGRAM-END"), "{sub:?}: {wrong:#?}");
        let says_its_place_twice = |it: &Finding| it.related.iter().any(|related| related.span == it.span);
        assert!(!wrong.iter().any(says_its_place_twice), "{sub:?}: {wrong:#?}");
    }
}

/// A dump of a control's memory has its programs by number: a subprogram may come first.
#[test]
fn a_subprogram_that_comes_first_is_not_the_main_program() {
    let found = |program: &str| -> Vec<_> {
        let (_, findings) = interpret(program.as_bytes(), mill());
        findings.findings().iter().map(|finding| (finding.code.name(), finding.span.line)).collect()
    };
    let (sub, main) = ("O9001(SUB)\nG91 G0 X1.\nM99\n", "O0001(MAIN)\nG90 G0 X0 Y0\nM98 P9001 L3\nM30\n");
    let unclear = [("PRG-MAIN-RETURN", 3), ("PRG-MAIN-UNCLEAR", 4)];
    assert_eq!(found(&format!("{sub}{main}")), unclear);
    assert_eq!(found(&format!("%\n{sub}%\n%\n{main}%\n")), [("PRG-MAIN-RETURN", 4), ("PRG-MAIN-UNCLEAR", 7)]);
    assert_eq!(found(&format!("{main}{sub}")), []);
    // What calls is no subprogram that nobody calls here, and what nothing stands behind may be either.
    assert_eq!(found(&format!("O1\nM98 P9001\nM99\n{sub}")), [("PRG-MAIN-RETURN", 3)]);
    assert_eq!(found(&format!("{sub}(a note)\nG0 X5\n")), [("PRG-MAIN-RETURN", 3)]);
}

/// Controls differ in what no repetition means.
#[test]
fn a_call_without_a_repetition_is_refused() {
    for call in ["M98 P20 L0", "G65 P20 L0 A1."] {
        let (_, findings) = interpret(format!("G0 X0\n{call}\nM30\nO20\nG0 X1\nM99\n").as_bytes(), mill());
        assert_eq!(
            findings.findings().iter().map(|it| it.code.name()).collect::<Vec<_>>(),
            ["PRG-WORD-CONFLICT"],
            "{call}"
        );
    }
    // Digits before the number that are zeros are no repetitions.
    assert_eq!(xs("M98 P00020\nM30\nO20\nG0 X3\nM99\n", &mill()), [3.0]);
}

#[test]
fn a_program_that_is_there_twice_is_not_called() {
    let [main, one, other] = ["M98 P2000\nM30\n", "O2000\nG0 X1\nM99\n", "O2000\nG0 X2\nM99\n"];
    let nameless = "G0 X3\nM99\n";
    let both = format!("{main}{one}{other}");
    for (programs, names) in [
        (&[&*both][..], &[][..]),
        (&[main, &format!("{one}{other}")], &["library.nc"]),
        (&[main, one, other], &["a.nc", "b.nc"]),
        (&[main, one, other], &["a/O2000.nc", "b/2000"]),
        (&[main, nameless, nameless], &["a/O2000.nc", "b/2000"]),
    ] {
        let (moves, found) = with_files(programs, names);
        assert!(moves.is_empty(), "{programs:?} {names:?}");
        let [finding] = &found[..] else { panic!("{found:#?}") };
        assert_eq!((finding.code.name(), finding.span.line), ("PRG-JUMP-TARGET", 1), "{finding:#?}");
        assert!(names.iter().all(|name| finding.message.contains(name)), "{finding:#?}");
    }
    // A file's name says one program and its text another.
    let (moves, found) = with_files(&[main, "O3000\nG0 X3\nM99\n"], &["a/O2000.nc"]);
    let [finding] = &found[..] else { panic!("{found:#?}") };
    assert!(moves.is_empty() && finding.code == code::JUMP_TARGET, "{finding:#?}");
    assert!(finding.message.contains("O3000") && finding.message.contains("a/O2000.nc"), "{finding:#?}");
    // In the order of the search: the file of the call, files named after the program, all others.
    let mine = format!("{main}{one}");
    assert_eq!(with_files(&[&mine, other, other], &["O2000.nc", "b.nc"]).0, [(0, 4, 1.0)]);
    assert_eq!(with_files(&[main, one, other, nameless], &["b.nc", "O2000.nc", "2000.txt"]).0, [(2, 2, 2.0)]);
    assert_eq!(with_files(&[main, one, nameless], &["b.nc", "O2000.nc"]).0, [(1, 2, 1.0)]);
}

#[test]
fn what_is_found_in_a_loop_is_one_finding_with_its_first_iteration() {
    let program = "#1=0\nWHILE [#1 LT 5] DO1\n#1=#1+1\nIF [#1 LT 3] GOTO 7\nG2 X[10*#1] Y0 I1 F100\nN7\nEND1\nM30";
    let (_, findings) = interpret(program.as_bytes(), mill());
    let [arc] = findings.findings() else { panic!("{findings:?}") };
    assert_eq!((arc.code, arc.span.line, arc.occurrences), (code::ARC_RADIUS_MISMATCH, 5, 3));
    assert_eq!(arc.first.as_ref().map(|first| (&*first.name, first.number)), Some(("iteration", 3)));
    assert_eq!(findings.count(Severity::Error), 1);
}

#[test]
fn what_is_found_in_a_called_program_names_the_calls() {
    let program = "G0 X1\nM98 P100\nM30\nO100\nG65 P200\nM99\nO200\nG1 X3 F100\nG2 X9 Y5 I1\nM99";
    let (_, findings) = interpret(program.as_bytes(), mill());
    let [arc] = findings.findings() else { panic!("{findings:?}") };
    let related: Vec<_> = arc.related.iter().map(|place| (place.span.line, place.is_call)).collect();
    assert_eq!((arc.span.line, related), (9, vec![(8, false), (5, true), (2, true)]));
}

#[test]
fn lines_that_are_too_long_lead_nowhere_however_the_program_is_cut() {
    // N100 and O6002 stand on lines that are not read.
    let settings = LanguageSettings { max_line_bytes: 20, ..LanguageSettings::mill() };
    let program =
        b"G0 X1\nM98 P6002\nM97 P100\nM30\nO6002 (A PROGRAM OF A LONG NAME)\nX2\nM99\nN100 G91 G01 X10. F800.\nM99\n";
    let whole = interpret(program, settings.clone());
    assert!(whole.1.findings().iter().any(|finding| finding.code == "PRG-SUBPROGRAM-MISSING"), "{:?}", whole.1);
    for piece in [1, 7, 19, 20, 21, 22, 23, 40] {
        let mut interpreter = Interpreter::new(settings.clone());
        let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
        let mut offered = piece;
        loop {
            let from = program.len().min(interpreter.place().offset as usize);
            let to = program.len().min(from + offered);
            match interpreter.read_line(&program[from..to], to == program.len(), &mut operations, &mut findings) {
                LineOutcome::NeedMore => offered += piece,
                LineOutcome::Ended => break,
                LineOutcome::Consumed(_) | LineOutcome::Elsewhere => offered = piece,
            }
        }
        assert_eq!((operations, findings), whole, "pieces of {piece} bytes");
    }
}

#[test]
fn comments_stand_between_the_words_of_a_statement() {
    assert_eq!(mill_xs("#1=5\nIF[#1EQ5](YES)GOTO 20\nG0 X1\nN20 G0 X2"), [2.0]);
    assert_eq!(mill_xs("#1=0\nWHILE[#1LT2](TWICE)DO1\n#1=#1+1\nG0 X#1\nEND1"), [1.0, 2.0]);
}

#[test]
fn a_return_takes_nothing_but_where_to() {
    let program = "M98 P5\nM30\nO5\nG0 X1\nM99 L1\n";
    let (_, findings) = ends(program, &LanguageSettings::mill());
    let [finding] = findings.findings() else { panic!("{findings:?}") };
    assert_eq!((finding.code.name(), finding.span.line, finding.span.column), ("PRG-WORD-UNUSED", 5, 5));
}
