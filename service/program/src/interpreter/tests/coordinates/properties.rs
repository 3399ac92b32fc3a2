//! Invariants of coordinates under random programs.

use proptest::prelude::*;

use super::*;

/// A change of coordinates that moves nothing.
fn change() -> impl Strategy<Value = String> {
    let number = || (-100..100_i32).prop_map(f64::from);
    prop_oneof![
        (1..=9_u32, number(), number()).prop_map(|(system, x, y)| format!("G10 L2 P{system} X{x} Y{y}")),
        // Under a shift the turn of the system in force is refused.
        (0..=9_u32, number()).prop_map(|(system, angle)| format!("G92.1\nG10 L2 P{system} R{angle}")),
        (1..=9_u32, number()).prop_map(|(system, x)| format!("G10 L20 P{system} X{x}")),
        (54..=59_u32).prop_map(|system| format!("G{system}")),
        (1..=3_u32).prop_map(|system| format!("G59.{system}")),
        (number(), number()).prop_map(|(x, y)| format!("G92 X{x} Y{y}")),
        number().prop_map(|y| format!("G52 Y{y}")),
        prop_oneof![
            Just("G92.1"),
            Just("G92.2"),
            Just("G92.3"),
            Just("G43.1 X3 Z5"),
            Just("G49"),
            Just("G20"),
            Just("G21")
        ]
        .prop_map(str::to_owned),
    ]
}

/// Whether nothing was found but that `G43.1` was programmed in the other unit.
fn is_right(findings: &[String]) -> bool {
    findings.iter().all(|finding| finding.ends_with(":PRG-LENGTH-UNIT"))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Whatever the registers, the machine goes on from where it is, `G53` goes where it says, and states resume identically.
    #[test]
    fn changes_of_coordinates_move_nothing(changes in proptest::collection::vec(change(), 1..12), x in -50..50_i32) {
        let program: String =
            changes.iter().map(|change| format!("{change}\nG0 X{x} Y2\n")).collect::<String>() + "G21 G53 X7 Y-8";
        let run = run_with(&linuxcnc(), &tools(), &program);
        prop_assert!(is_right(&run.findings), "{program}\n{:?}", run.findings);
        let Some((_, end)) = run.moves.last() else { return Ok(()) };
        prop_assert!((end[0] - 7.0).abs() < 1e-9 && (end[1] + 8.0).abs() < 1e-9, "{program}\n{end:?}");
        resumes(&linuxcnc(), &program);
    }

    /// What `G10 L20` makes the present position read, a move to that value does not leave.
    #[test]
    fn l20_reads_what_it_says(changes in proptest::collection::vec(change(), 0..6), x in -50..50_i32, y in -50..50_i32) {
        let changes = changes.join("\n");
        let program = format!("{changes}\nG21 G90 G10 L20 P0 X{x} Y{y}\nG0 X{x} Y{y}");
        let run = run_with(&linuxcnc(), &tools(), &program);
        prop_assert!(is_right(&run.findings), "{program}\n{:?}", run.findings);
        for (_, end) in run.moves {
            prop_assert!(end[0].abs() < 1e-9 && end[1].abs() < 1e-9, "{program}\n{end:?}");
        }
    }
}
