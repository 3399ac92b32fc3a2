//! Programs of newer FANUC controls by their names.

use super::*;

#[test]
fn a_program_may_have_a_name() {
    for head in ["<SHAFT-2>", "O<SHAFT-2>", "%\n<SHAFT-2.A> (A SHAFT)", "%\nO<_1> (A SHAFT)", "<O0012>"] {
        assert_eq!(mill_xs(&format!("{head}\nG0 X1.")), [1.0], "{head}");
        assert_eq!(xs(&format!("{head}\nG0 X2.\nM30\n"), &LanguageSettings::default()), [1.0], "{head}");
    }
    let (_, findings) = interpret(b"G0 X1.\n<SECOND>\nX2.\nM30\n", mill());
    let found: Vec<_> = findings.findings().iter().map(|finding| (finding.code, finding.span.line)).collect();
    assert_eq!(found, [(code::NO_END, 2)]);
    let long = "<A-NAME-OF-MORE-THAN-32-CHARACTERS-BY-FAR>";
    for head in [
        "<A B>",
        "O<>",
        "<>",
        "G0 X1. <SHAFT>",
        "N5 <SHAFT>",
        "M99 <SHAFT>",
        "O5 <SHAFT>",
        "M98 P<PIN>",
        "M98 L2 <PIN>",
        "G65 <P N>",
        "G65 A1. <PIN>",
    ] {
        assert_eq!(mill_codes(&format!("G0 X0\n{head}\nM30")), ["PRG-NUMBER-MISSING"], "{head}");
    }
    for head in [format!("M98 {long}"), format!("O{long}"), format!("G65 {long}")] {
        assert_eq!(mill_codes(&format!("{head}\nM30")), ["PRG-NUMBER-MISSING"], "{head}");
    }
    // Haas controls and LinuxCNC have numbers.
    for head in ["O<SHAFT>", "M98 <SHAFT>", "G65 <SHAFT>"] {
        assert_eq!(codes(&format!("{head}\nG0 X1.\nM30"), &haas_mill()), ["PRG-NUMBER-MISSING"], "{head}");
    }
}

/// A name stands where the letter O with its number stands, and nowhere else.
#[test]
fn a_name_begins_a_program_as_a_number_does() {
    let found = |program: &str| {
        let (operations, findings) = interpret(program.as_bytes(), mill());
        let codes: Vec<_> = findings.findings().iter().map(|it| (it.code.name(), it.span.line)).collect();
        (points(&operations), codes)
    };
    for program in [
        "@ #1=5.\nG0 X#1\nM30\n",
        "G0 X1.\n@ #1=5.\nX#1\nM30\n",
        "G0 X1.\n@ M99\nM30\n",
        "M98 <A>\nX9.\nM30\n<A>\nG0 X1.\n@ M99\n",
        "G0 X1.\n@ M98\nM30\n",
        "@ M98 P5\nM30\nO5\nG0 X1.\nM99\n",
        "@ M98 <A>\nM30\n<A>\nG0 X1.\nM99\n",
        "G0 X1.\n@ G65 P5\nM30\nO5\nX7.\nM99\n",
        "G0 X1.\n@ IF [1 EQ 1] GOTO 5\nN5 X2.\nM30\n",
        "@ G0 X1.\nX2.\nM30\n",
        "@ G0 X\nG0 X1. Y2.\nM30\n",
    ] {
        assert_eq!(found(&program.replace('@', "<MAIN>")), found(&program.replace('@', "O8")), "{program}");
        assert_eq!(found(&program.replace('@', "O<MAIN>")), found(&program.replace('@', "O8")), "{program}");
    }
    assert_eq!(mill_xs("<O0012>\n#101=#4115\nG0 X#101"), [12.0]);
    assert_eq!(mill_codes("<SHAFT>\n#101=#4115\nM30"), ["PRG-PARAMETER-UNAVAILABLE"]);
}

#[test]
fn programs_are_called_by_their_names() {
    let of = |calls: &str| mill_xs(&format!("<MAIN>\n{calls}\nX9.\nM30\n<PIN-1>\nG0 X1.\nM99\n<O7>\nX7.\nM99"));
    assert_eq!(of("M98 <PIN-1>"), [1.0, 9.0]);
    assert_eq!(of("G0 X3. M98 <PIN-1> L2"), [3.0, 1.0, 9.0]);
    assert_eq!(of("G65 <PIN-1>"), [1.0, 9.0]);
    assert_eq!(of("G0 X2.\nG66<PIN-1>\nX4.\nG67"), [2.0, 4.0, 1.0, 9.0]);
    assert_eq!(of("G0 X2.\nM98 P7"), [2.0, 7.0, 9.0]);
    assert_eq!(of("G0 X2.\nM98 <O0007>"), [2.0, 7.0, 9.0]);
    let arguments = "G65 <PIN> L2 A5. B1.\nM30\n<PIN>\nG0 X[#1+#2]\nG91 X1.\nG90\nM99";
    assert_eq!(mill_xs(arguments), [6.0, 7.0, 6.0, 7.0]);
    for (program, code) in [
        ("M98 <PIN>\nM30", "PRG-SUBPROGRAM-MISSING"),
        ("M98 <PIN> P5\nM30\n<PIN>\nM99\nO5\nM99", "PRG-WORD-CONFLICT"),
        ("G65 <PIN> P5\nM30\n<PIN>\nM99\nO5\nM99", "PRG-WORD-CONFLICT"),
        ("M98 <PIN> L0\nM30\n<PIN>\nM99", "PRG-WORD-CONFLICT"),
        ("M98 <PIN>\nM30\n<PIN>\nM99\n<PIN>\nM99", "PRG-JUMP-TARGET"),
        ("M98 <PIN>\nM30\n<PIN>\nG0 X1.\n<NEXT>\nM99", "PRG-SUBPROGRAM-END"),
    ] {
        assert_eq!(mill_codes(program), [code], "{program}");
    }
    // A block of the caller's that has the same number is another one.
    assert_eq!(mill_xs("N1 G0 X1.\nM98 <PIN>\nX9.\nM30\n<PIN>\nGOTO 1\nX8.\nN1 X2.\nM99"), [1.0, 2.0, 9.0]);
}

#[test]
fn further_files_are_found_by_the_names_of_programs() {
    let main = "G0 X1\nM98 <PIN.A>\nM98 <BORE>\nX4\nM30\n";
    let programs = [main, "G0 X2\nM99\n", "%\n<SLOT>\nM99\n<BORE>\nG0 X3\nM99\n%\n"];
    let (found, wrong) = with_files(&programs, &["subs/pin.a", "library.nc"]);
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(found, [(0, 1, 1.0), (1, 1, 2.0), (2, 5, 3.0), (0, 4, 4.0)]);
    let (moves, wrong) = with_files(&["M98 <PIN>\nM30\n", "<BORE>\nG0 X2\nM99\n"], &["PIN.nc"]);
    let [finding] = &wrong[..] else { panic!("{wrong:#?}") };
    assert!(moves.is_empty() && finding.code == code::JUMP_TARGET, "{finding:#?}");
    assert!(finding.message.contains("<PIN>") && finding.message.contains("<BORE>"), "{finding:#?}");
}

#[test]
fn a_document_in_xml_is_still_one_finding() {
    for text in ["<note>\n<to>You</to>\n</note>\n", "<a>\n<b>\n<c x=\"1\"/>\n</b>\n</a>\n", "<note>\n</note>\n"] {
        assert_eq!(mill_codes(text), ["PRG-NOT-A-PROGRAM"], "{text}");
    }
}
