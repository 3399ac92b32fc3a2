//! Random programs of expressions and control flow: never a panic, one end, bounded work, the same after restoring; and what
//! was resolved can be printed as a plain program that means the same.

mod common;

use std::fmt::Write as _;

use common::{bounded, check, interpreted, program};
use feedwave_program::{
    DialectName, Feed, LanguageSettings, Move, MoveKind, Operation, OperationKind, Plane, Position, SpindleDirection,
    SpindleSpeed,
};
use proptest::prelude::*;

fn linuxcnc() -> LanguageSettings {
    LanguageSettings { dialect: DialectName::LinuxCnc, ..LanguageSettings::mill() }
}

/// A program of plain moves for the operations of another one.
fn printed(operations: &[Operation]) -> String {
    let mut text = String::from("G21 G90 G17\n");
    for operation in operations {
        match &operation.kind {
            OperationKind::Move(step) => print_move(step, &mut text),
            OperationKind::Dwell { time: feedwave_program::DwellTime::Seconds(seconds), .. } => {
                writeln!(text, "G4 P{seconds}").unwrap();
            }
            OperationKind::Spindle(spindle) => {
                let code = match spindle.direction {
                    SpindleDirection::Stopped => "M5",
                    SpindleDirection::Clockwise => "M3",
                    SpindleDirection::CounterClockwise => "M4",
                };
                let SpindleSpeed::Constant { rev_per_min } = spindle.speed else { panic!("no surface speed here") };
                writeln!(text, "{code} S{rev_per_min}").unwrap();
            }
            _ => {}
        }
    }
    text + "M2\n"
}

fn print_move(step: &Move, text: &mut String) {
    let words = |letters: &str, values: [f64; 3]| -> String {
        letters.chars().zip(values).map(|(letter, value)| format!(" {letter}{value}")).collect()
    };
    let [x, y, z, ..] = step.end;
    let feed = match (step.kind, step.feed) {
        (MoveKind::Rapid, _) => String::new(),
        (MoveKind::Cutting, Feed::PerMinute(feed)) => format!(" F{feed}"),
        (MoveKind::Cutting, other) => panic!("{other:?} is not written here"),
    };
    let code = match (&step.arc, step.kind) {
        (Some(arc), _) if arc.clockwise => "G2",
        (Some(_), _) => "G3",
        (None, MoveKind::Rapid) => "G0",
        (None, MoveKind::Cutting) => "G1",
    };
    write!(text, "{code}{}", words("XYZ", [x, y, z])).unwrap();
    if let Some(arc) = &step.arc {
        assert_eq!(arc.plane, Plane::Xy);
        let turns = (arc.sweep_rad.abs() / std::f64::consts::TAU - 1e-9).ceil().max(1.0);
        let [i, j] = [arc.center[0] - step.start[0], arc.center[1] - step.start[1]];
        write!(text, " I{i} J{j} P{turns}").unwrap();
    }
    writeln!(text, "{feed}").unwrap();
}

/// The moves that go anywhere.
fn moves(operations: &[Operation]) -> Vec<Move> {
    let step = |operation: &Operation| match &operation.kind {
        OperationKind::Move(step) => Some(step.clone()),
        _ => None,
    };
    operations.iter().filter_map(step).filter(|step| step.start != step.end || step.arc.is_some()).collect()
}

/// The first move that does not begin where the one before ends, or the program.
fn first_gap(operations: &[Operation]) -> Option<usize> {
    let mut at = Some(Position::default());
    operations.iter().position(|operation| {
        let OperationKind::Move(step) = &operation.kind else { return false };
        at.replace(step.end).is_some_and(|at| !close(&at, &step.start))
    })
}

fn close(one: &Position, other: &Position) -> bool {
    one.iter().zip(other).all(|(one, other)| (one - other).abs() <= 1e-9 * one.abs().max(1.0))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn programs_of_macro_b_end_and_resume(bytes in prop::collection::vec(any::<u8>(), 40..400)) {
        check(&program(&bytes, false), &bounded(LanguageSettings::mill()));
    }

    #[test]
    fn programs_of_o_words_end_and_resume(bytes in prop::collection::vec(any::<u8>(), 40..400)) {
        check(&program(&bytes, true), &bounded(linuxcnc()));
    }

    #[test]
    fn what_was_resolved_means_the_same_when_printed(bytes in prop::collection::vec(any::<u8>(), 40..400)) {
        let settings = bounded(linuxcnc());
        let (mut operations, found) = interpreted(program(&bytes, true).as_bytes(), &settings, 0);
        if let Some(gap) = first_gap(&operations) {
            // A block in error is left out, and what follows begins where it would have ended.
            prop_assert!(found.has_errors(), "{:?}", operations[gap]);
            operations.truncate(gap);
        }
        let text = printed(&operations);
        let (again, findings) = interpreted(text.as_bytes(), &settings, 0);
        prop_assert!(!findings.has_errors(), "{:?} in {text}", findings.findings());
        let (before, after) = (moves(&operations), moves(&again));
        prop_assert_eq!(before.len(), after.len(), "{}", text);
        for (one, other) in before.iter().zip(&after) {
            prop_assert_eq!((one.kind, one.work_offset), (other.kind, other.work_offset));
            prop_assert!(close(&one.start, &other.start) && close(&one.end, &other.end), "{one:?} {other:?}");
            prop_assert_eq!(one.arc.is_some(), other.arc.is_some());
            if let (Some(one), Some(other)) = (&one.arc, &other.arc) {
                prop_assert!((one.sweep_rad - other.sweep_rad).abs() < 1e-6, "{one:?} {other:?}");
            }
            if one.kind == MoveKind::Cutting {
                prop_assert_eq!(one.feed, other.feed);
            }
        }
    }
}
