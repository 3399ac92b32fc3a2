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
    for head in ["<A B>", "O<>", "<>", "G0 X1. <SHAFT>", "N5 <SHAFT>", "M99 <SHAFT>", "O5 <SHAFT>", "M98 P<PIN>"] {
        let found = mill_codes(&format!("{head}\nM30"));
        assert_eq!(found.len(), 1, "{head}: {found:?}");
    }
    // Haas controls and LinuxCNC have numbers.
    assert_eq!(codes("O<SHAFT>\nG0 X1.\nM30", &haas_mill()), ["PRG-NUMBER-MISSING"]);
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
        ("G65 <PIN> P5\nM30\n<PIN>\nM99\nO5\nM99", "PRG-WORD-DUPLICATE"),
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
