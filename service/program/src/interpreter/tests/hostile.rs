//! Input that means no good: always a finding, never a panic, in bounded memory.

use proptest::prelude::*;

use super::*;

#[test]
fn a_line_of_100_mb_streams_through_one_buffer() {
    let buffer = vec![b'X'; 64 << 10];
    let mut interpreter = Interpreter::new(mill());
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    for _ in 0..(100 << 20) / buffer.len() {
        let outcome = interpreter.read_line(&buffer, false, &mut operations, &mut findings);
        assert_eq!(outcome, LineOutcome::Consumed(buffer.len()), "never held back");
    }
    let mut rest: &[u8] = b"XXX\nG0 X1\nM30\n";
    while let LineOutcome::Consumed(length) = interpreter.read_line(rest, true, &mut operations, &mut findings) {
        rest = &rest[length..];
    }
    let operations: Vec<_> = operations.iter().map(render_operation).collect();
    assert_eq!(operations, ["rapid 0 -> X1", "end"]);
    let findings: Vec<_> = findings.findings().iter().map(render_finding).collect();
    assert_eq!(findings, ["! 1:1+4096 PRG-LINE-TOO-LONG"]);
}

#[test]
fn a_million_nested_brackets_are_one_finding() {
    let settings = LanguageSettings { max_line_bytes: 4_000_000, ..mill() };
    for bracket in ["[", "#[", "]"] {
        let program = format!("G0 X{}\nM30", bracket.repeat(1_000_000));
        let length = bracket.len() * 1_000_000 + 1;
        assert_eq!(render(&program, &settings), format!("end\n! 1:4+{length} PRG-EXPRESSION"));
    }
    let program = format!("{}\nM30", "[".repeat(1_000_000));
    assert_eq!(render(&program, &mill()), "end\n! 1:1+4096 PRG-LINE-TOO-LONG");
}

#[test]
fn every_long_line_takes_linear_time() {
    // Quadratic reading of 4 MB would take minutes.
    let settings = LanguageSettings { max_line_bytes: 4_000_001, ..mill() };
    for piece in ["(", "( ", "X ", "1 ", "/", "%", "G1", "X1", "- ", "\0 ", "\u{e9}", "X(a)", ". ", "N", "a(", "5("] {
        let program = piece.repeat(4_000_000 / piece.len());
        let (_, findings) = interpret(program.as_bytes(), settings.clone());
        assert!(findings.findings().len() <= FindingLog::DEFAULT_LIMIT);
        assert!(findings.has_errors(), "{piece:?}");
    }
}

#[test]
fn strange_bytes_are_one_finding_per_run() {
    assert_eq!(
        render(b"G0\0\0\0X1\0\nG0 \xff\xfe\xfd X2 \xff\nM30", &mill()),
        "end\n! 1:3+3 PRG-NUL\n! 1:8+1 PRG-NUL\n! 2:4+3 PRG-NOT-UTF8\n! 2:11+1 PRG-NOT-UTF8"
    );
    // In a comment they move nothing.
    assert_eq!(
        render(b"G0 X1 (Fr\xe4ser)\nX2 (\xc3\xa4)\nX3 (\0\0)\nM30", &mill()),
        "rapid 0 -> X1\nrapid X1 -> X2\nrapid X2 -> X3\nend\nw 1:10+1 PRG-NOT-UTF8\nw 3:5+2 PRG-NUL"
    );
    assert_eq!(render("G0 X1 (open\nX2\nM30", &mill()), "rapid X1 -> X2\nend\n! 1:7+5 PRG-COMMENT-UNCLOSED");
}

#[test]
fn findings_are_bounded_and_counted() {
    let program = "E1\n".repeat(100_000);
    let (operations, findings) = interpret(program.as_bytes(), mill());
    assert_eq!(operations.len(), 1);
    assert_eq!(findings.findings().len(), FindingLog::DEFAULT_LIMIT);
    assert_eq!(findings.count(Severity::Error), 100_000);
    assert_eq!(findings.dropped(), 100_000 - 1_000 + 1);
}

/// Every coordinate that leaves the interpreter is a finite number.
fn assert_finite(operations: &[Operation]) {
    for operation in operations {
        if let OperationKind::Move(step) = &operation.kind {
            assert!(step.start.iter().chain(&step.end).all(|value| value.is_finite()), "{step:?}");
            if let Some(arc) = step.arc {
                assert!(arc.center.iter().chain([&arc.sweep_rad]).all(|value| value.is_finite()), "{arc:?}");
            }
        }
    }
}

#[test]
fn the_largest_numbers_stay_finite() {
    let mut program = "G91 G20 G1 F1\n".to_owned();
    program.push_str(&"X999999999 Y-999999999\nG3 X999999999 R-999999999\nG2 X1 I999999999 J.00000001\n".repeat(50));
    let (operations, _) = interpret(program.as_bytes(), mill());
    assert!(operations.len() > 50);
    assert_finite(&operations);
}

proptest! {
    #[test]
    fn any_bytes(source in prop::collection::vec(any::<u8>(), 0..2_000)) {
        for settings in [lathe(), mill()] {
            render(&source, &settings);
        }
    }

    #[test]
    fn any_words(source in "([GMXYZUWIJKRFSTPAN/%(;#\n .+-][0-9]{0,3}[. \n]?){0,200}") {
        for settings in [lathe(), mill()] {
            render(&source, &settings);
            assert_finite(&interpret(source.as_bytes(), settings).0);
        }
    }
}
