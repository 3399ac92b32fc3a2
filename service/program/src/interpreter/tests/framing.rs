//! Lines, ends, and independence from how the input arrives.

use proptest::prelude::*;

use super::*;
use crate::interpreter::lines::find_line_end;

#[test]
fn line_ends_and_byte_order_mark() {
    let expected = "rapid 0 -> X1\nrapid X1 -> X2\nend";
    for program in ["G0 X1\nX2\nM30\n", "G0 X1\r\nX2\r\nM30", "\u{feff}G0 X1\n\n\r\nX2\nM30\n"] {
        assert_eq!(render(program, &mill()), expected, "{program:?}");
    }
    // The mark is no column.
    assert_eq!(render("\u{feff}E1\nM30", &mill()), "end\n! 1:1+2 PRG-WORD-UNKNOWN");
    // A carriage return alone ends a line as well, and every mixture counts the same lines.
    for end in ["\r", "\n", "\r\n"] {
        let program = ["G0 X1", "", "E1 X2", "X3", "M30", ""].join(end);
        assert_eq!(
            render(&program, &mill()),
            "rapid 0 -> X1\nrapid X2 -> X3\nend\n! 3:1+2 PRG-WORD-UNKNOWN",
            "{end:?}"
        );
    }
    assert_eq!(
        render("G0 X1\r\r\nX2\n\rE1\rM30", &mill()),
        "rapid 0 -> X1\nrapid X1 -> X2\nend\n! 5:1+2 PRG-WORD-UNKNOWN"
    );
}

#[test]
fn titles() {
    let expected = "rapid 0 -> X1\nend";
    for title in
        ["TITLE", " PART 5", "SHAFT, REV B", "PART-5 REV.A X20", "<SHAFT>", "T", "(TITLE)", "O12", " N1 O12", "\u{e4}"]
    {
        for before in ["", "\n", "  ", "(FIRST)\n", "\u{feff}"] {
            let program = format!("{before}%{title}\nG0 X1\nM30\n%\n");
            assert_eq!(render(&program, &mill()), expected, "{program:?}");
        }
    }
    // Words that the control would skip.
    assert_eq!(render("%G20\nG0 X1\nM30\n%", &mill()), "rapid 0 -> X1\nend\n! 1:2+3 PRG-TITLE-WORDS");
    assert_eq!(render("% O1 X5\nG0 X1\nM30\n%", &mill()), "rapid 0 -> X1\nend\n! 1:6+2 PRG-TITLE-WORDS");
    assert_eq!(render("%#1=5\nG0 X1\nM30\n%", &mill()), "rapid 0 -> X1\nend\n! 1:2+4 PRG-TITLE-WORDS");
    // Other controls are not known to skip anything, or have such numbers.
    assert_eq!(render("%1234 (PART)\nG0 X1\nM30\n%", &mill()), "rapid 0 -> X1\nend\n! 1:2+4 PRG-NUMBER-STRAY");
    assert_eq!(render("%TITLE\nG0 X1\nM30\n%", &linuxcnc()), "rapid 0 -> X1\nend\n! 1:2+5 PRG-TEXT");
    assert_eq!(render("%TITLE G0 X1 M30", &mill()), "end\n! 1:2+5 PRG-TEXT");
    // A file with nothing but titles is no program, and only the first % begins one.
    assert_eq!(render("%TITLE\n%\n", &mill()), "end\n! 1:1+0 PRG-NOT-A-PROGRAM");
    assert!(render("%TITLE\nG0 X1\n%TITLE\n", &mill()).starts_with("rapid 0 -> X1\nend\n"));
}

#[test]
fn ways_to_end() {
    assert_eq!(render("", &mill()), "end\n! 1:1+0 PRG-NOT-A-PROGRAM");
    assert_eq!(render("G0 X1\n\n", &mill()), "rapid 0 -> X1\nend\nw 1:6+0 PRG-NO-END");
    assert_eq!(render("G0 X1 \n(TEXT)\t \n\r\n  \n", &mill()), "rapid 0 -> X1\nend\nw 2:7+0 PRG-NO-END");
    // The end of the last line, however it ends.
    for program in ["G0 X1\nX2.5", "G0 X1\nX2.5\n", "G0 X1\r\nX2.5\r\n", "G0 X1\rX2.5\r", "\u{feff}G0 X1\nX2.5"] {
        assert!(render(program, &mill()).ends_with("\nw 2:5+0 PRG-NO-END"), "{program:?}");
    }
    assert_eq!(render("\u{feff}G0 X1", &mill()), "rapid 0 -> X1\nend\nw 1:6+0 PRG-NO-END");
    assert_eq!(render("%\nG0 X1\n%\n", &mill()), "rapid 0 -> X1\nend");
    assert_eq!(render("%\n%\n", &mill()), "end\n! 1:1+0 PRG-NOT-A-PROGRAM");
    assert_eq!(render("%\nO1\n%\n", &mill()), "end");
    assert_eq!(render("%\nG0 X1\nM2\n\n%\n\0\0\n", &mill()), "rapid 0 -> X1\nend");
    assert_eq!(render("M30\n%\n  G0 X1 \nG1 E5\n", &mill()), "end\nw 3:3+5 PRG-TRAILING", "said once, not read");
    assert_eq!(render("%\nG0 X1\n% X5\nX6", &mill()), "rapid 0 -> X1\nend\nw 3:3+2 PRG-TRAILING");
    assert_eq!(render("M30 E5\nX1", &mill()), "end\n! 1:5+2 PRG-WORD-UNKNOWN\nw 2:1+2 PRG-TRAILING");
}

#[test]
fn a_line_that_is_too_long() {
    let settings = LanguageSettings { max_line_bytes: 10, ..mill() };
    let program = "G0 X1     \nG0 X2      \nG0 X3\nX4 (.......)";
    assert_eq!(
        render(program, &settings),
        "rapid 0 -> X1\nrapid X1 -> X3\nend\n! 2:1+10 PRG-LINE-TOO-LONG\n! 4:1+10 PRG-LINE-TOO-LONG\nw 4:13+0 PRG-NO-END"
    );
}

#[test]
fn a_carriage_return_at_the_border_of_two_pieces() {
    let mut interpreter = Interpreter::new(mill());
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    let mut read = |input: &[u8], end| interpreter.read_line(input, end, &mut operations, &mut findings);
    assert_eq!(read(b"G0 X1\r", false), LineOutcome::Consumed(6), "not held back");
    assert_eq!(read(b"", false), LineOutcome::NeedMore);
    assert_eq!(read(b"\nX2\r\nE1\r", false), LineOutcome::Consumed(1));
    assert_eq!(read(b"X2\r\nE1\r", false), LineOutcome::Consumed(4));
    assert_eq!(read(b"E1\r", false), LineOutcome::Consumed(3));
    assert_eq!(read(b"E2\rM30", false), LineOutcome::Consumed(3));
    let places: Vec<_> = findings.findings().iter().map(|finding| finding.span.line).collect();
    assert_eq!(places, [3, 4]);
}

#[test]
fn no_complete_line_yet() {
    let mut interpreter = Interpreter::new(mill());
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    let mut read = |input: &[u8], end| interpreter.read_line(input, end, &mut operations, &mut findings);
    assert_eq!(read(b"", false), LineOutcome::NeedMore);
    assert_eq!(read(b"G0 X1", false), LineOutcome::NeedMore);
    assert_eq!(read(b"G0 X12\nX", false), LineOutcome::Consumed(7));
    assert_eq!(read(b"X", false), LineOutcome::NeedMore);
    assert_eq!(read(b"X5", true), LineOutcome::Consumed(2));
    assert_eq!(read(b"", true), LineOutcome::Ended);
    assert_eq!(read(b"", true), LineOutcome::Ended);
    let (rendered, count) = (operations.iter().map(render_operation).collect::<Vec<_>>(), findings.findings().len());
    assert_eq!(rendered, ["rapid 0 -> X12", "rapid X12 -> X5", "end"]);
    assert_eq!(count, 1);
}

/// Reads `source` in pieces that end at `cuts`, restoring the interpreter from its serialised state at `restores`
/// (counted in calls).
fn interpret_in_pieces(
    source: &[u8],
    settings: &LanguageSettings,
    cuts: &[usize],
    restores: &[usize],
) -> (Vec<Operation>, FindingLog) {
    let mut interpreter = Interpreter::new(settings.clone());
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    let mut cuts: Vec<_> = cuts.iter().map(|cut| cut % (source.len() + 1)).collect();
    cuts.sort_unstable();
    cuts.push(source.len());
    let mut calls = 0;
    for cut in cuts {
        loop {
            calls += 1;
            if restores.contains(&calls) {
                let bytes = postcard::to_allocvec(interpreter.state()).unwrap();
                let state: InterpreterState = postcard::from_bytes(&bytes).unwrap();
                assert_eq!(&state, interpreter.state());
                interpreter = Interpreter::restore(settings.clone(), state);
            }
            // A contour is read from where it is.
            let at = interpreter.place().offset as usize;
            let input = &source[at.min(cut)..cut];
            match interpreter.read_line(input, cut == source.len(), &mut operations, &mut findings) {
                LineOutcome::Consumed(length) => {
                    assert!(length > 0 && length <= input.len());
                }
                LineOutcome::Elsewhere => {}
                LineOutcome::NeedMore | LineOutcome::Ended => break,
            }
        }
    }
    assert_eq!(interpreter.place().offset, source.len() as u64, "all input is consumed");
    (operations, findings)
}

/// Words that set, use and upset every modal state.
const WORDS: [&str; 79] = [
    "G0",
    "G1",
    "G2",
    "G3",
    "G4",
    "G5",
    "G5.1",
    "G5.2",
    "G5.2",
    "G5.3",
    "G9",
    "G61",
    "G64",
    "G17",
    "G18",
    "G20",
    "G21",
    "G28",
    "G53",
    "G54",
    "G56",
    "G90",
    "G91",
    "G93",
    "G94",
    "G95",
    "G96",
    "G97",
    "G50",
    "G71",
    "G200",
    "G201",
    "M0",
    "M3",
    "M4",
    "M5",
    "M6",
    "M8",
    "M9",
    "X10.",
    "X-3",
    "Z20.5",
    "Y1",
    "U2",
    "W-1",
    "I5",
    "K-2",
    "R12.5",
    "F.2",
    "F0",
    "F100",
    "S1000",
    "S0",
    "T0101",
    "T2",
    "P5",
    "P.1",
    "Q.05",
    "Q1",
    "L3",
    "J2",
    "A.03",
    "E1",
    "(note)",
    "(open",
    "#1",
    "#1=5",
    "#100=[#100+1]",
    "X#1",
    "/",
    "%",
    ";x",
    "N5",
    "O7",
    "\0",
    "\u{e9}",
    "X 1 2",
    "GG",
    "\r",
];

/// Lines of such words.
fn line() -> impl Strategy<Value = String> {
    let body = prop::collection::vec(prop::sample::select(&WORDS), 0..6).prop_map(|words| words.join(" "));
    // A NURBS is rarely hit upon.
    let nurbs = prop::sample::select(vec!["G5.2 L3 F9", "X1 Y2 Z3 P2", "X3 Y5", "Y4 X7 P.5", "Z5 X1", "G5.3"]);
    prop_oneof![40 => body, 20 => nurbs.prop_map(str::to_owned), 1 => Just("M30".to_owned()), 1 => Just("X1 ".repeat(30)), 1 => Just("%".to_owned())]
}

proptest! {
    #[test]
    fn the_first_line_end_of_any_bytes(
        bytes in prop::collection::vec(prop::sample::select(b"\n\r\t\0\x0b\x0c\x0e\x80\xff\x8a\x8d1X ".to_vec()), 0..40),
    ) {
        let expected = bytes.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
        prop_assert_eq!(find_line_end(&bytes), expected);
    }

    #[test]
    fn pieces_and_restores_make_no_difference(
        lines in prop::collection::vec(line(), 0..60),
        is_mill: bool,
        cuts in prop::collection::vec(any::<usize>(), 0..20),
        restores in prop::collection::vec(1usize..200, 0..20),
    ) {
        let source = lines.join("\n");
        let settings = LanguageSettings { max_line_bytes: 60, ..if is_mill { mill() } else { lathe() } };
        let straight = interpret(source.as_bytes(), settings.clone());
        let pieces = interpret_in_pieces(source.as_bytes(), &settings, &cuts, &restores);
        prop_assert_eq!(straight, pieces);
    }
}
