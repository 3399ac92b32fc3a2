//! Any bytes as a program, whole and in pieces with the interpreter restored between them: the same operations and
//! findings, one end, finite coordinates.

#![no_main]

use feedwave_program::{
    DecimalPointRule, FindingLog, Interpreter, LanguageSettings, LineOutcome, Operation, OperationKind, ThreadEWord,
    interpret,
};
use libfuzzer_sys::fuzz_target;

/// Settings from the bits of a byte.
fn settings(bits: u8) -> LanguageSettings {
    let base = match (bits & 1, bits & 128) {
        (0, 0) => LanguageSettings::default(),
        (0, _) => LanguageSettings::linuxcnc(),
        _ => LanguageSettings::mill(),
    };
    let mut settings = LanguageSettings {
        initial_inch: bits & 2 != 0,
        block_delete: bits & 4 != 0,
        // A loop that counts to the bounds of a machine takes seconds.
        max_executed_blocks: 20_000,
        max_still_blocks: 10_000,
        max_line_bytes: if bits & 8 != 0 { 20 } else { 4_096 },
        ..base
    };
    if bits & 16 != 0 {
        settings.decimal_point = DecimalPointRule::LeastIncrement;
    }
    if bits & 32 != 0 {
        settings.work_offsets[1] = [10.0; 9];
        settings.reference_position = [500.0; 9];
    }
    if bits & 64 != 0 {
        settings.thread_e_word = ThreadEWord::PreciseLead;
    }
    settings
}

/// How often the interpreter is restored within a program.
const MAX_RESTORED: u32 = 64;

/// Offers the program in pieces of `piece` bytes.
fn interpret_in_pieces(program: &[u8], settings: &LanguageSettings, piece: usize) -> (Vec<Operation>, FindingLog) {
    let mut interpreter = Interpreter::new(settings.clone());
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    // Bytes offered from the interpreter's place on.
    let mut offered = piece;
    let mut restored = 0;
    loop {
        let from = program.len().min(interpreter.place().offset as usize);
        let to = program.len().min(from + offered);
        let end_of_input = to == program.len();
        match interpreter.read_line(&program[from..to], end_of_input, &mut operations, &mut findings) {
            LineOutcome::Consumed(length) => {
                assert!(length > 0 && length <= to - from);
                offered = piece;
            }
            LineOutcome::Elsewhere => offered = piece,
            LineOutcome::NeedMore => {
                assert!(!end_of_input);
                assert!(to - from <= settings.max_line_bytes as usize + 2, "held back without need");
                offered += piece;
                // Restoring rebuilds the code tables, too slow to do it at every byte; while the program is indexed for a jump
                // it begins that anew, which would never end.
                if to % 8 == 0 && restored < MAX_RESTORED {
                    restored += 1;
                    interpreter = Interpreter::restore(settings.clone(), interpreter.state().clone());
                }
            }
            LineOutcome::Ended => return (operations, findings),
        }
    }
}

fuzz_target!(|input: &[u8]| {
    let [bits, piece, program @ ..] = input else {
        return;
    };
    let settings = settings(*bits);
    let (operations, findings) = interpret(program, settings.clone());
    let ends = operations.iter().filter(|operation| operation.kind == OperationKind::End).count();
    assert_eq!(ends, 1);
    assert!(matches!(operations.last(), Some(Operation { kind: OperationKind::End, .. })));
    for operation in &operations {
        if let OperationKind::Thread(step) = &operation.kind {
            assert!(step.start.iter().chain(&step.end).all(|value| value.is_finite()));
            assert!(step.start != step.end && step.lead_mm > 0.0 && step.lead_mm.is_finite());
            assert!((0.0..=360.0).contains(&step.start_angle_deg));
            assert!(step.amplitude_mm.is_none_or(|amplitude| amplitude >= 0.0 && amplitude.is_finite()));
            assert!(step.pull_out.is_none_or(|out| out.travel_mm > 0.0 && out.retreat_mm.is_finite()));
        }
        if let OperationKind::Move(step) = &operation.kind {
            assert!(step.start.iter().chain(&step.end).all(|value| value.is_finite()));
            if let Some(arc) = step.arc {
                assert!(arc.center.iter().chain([&arc.sweep_rad]).all(|value| value.is_finite()));
            }
            if let Some(spline) = &step.spline {
                assert!(spline.points.iter().flatten().chain(&spline.weights).all(|value| value.is_finite()));
                assert!(spline.points.len() == spline.weights.len());
                assert!(spline.order >= 3 && usize::from(spline.order) <= spline.points.len());
            }
        }
    }
    for finding in findings.findings() {
        assert!(finding.code.name().starts_with("PRG-"));
        assert!(finding.span.line > 0 && finding.span.column > 0 && !finding.message.is_empty());
    }
    let pieces = interpret_in_pieces(program, &settings, usize::from(*piece).max(1));
    assert_eq!((operations, findings), pieces);
});
