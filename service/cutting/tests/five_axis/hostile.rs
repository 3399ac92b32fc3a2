//! Whatever five-axis words a program puts together, it ends with a report; and what is accepted streams like it was judged.

use feedwave_cutting::PlanQuality;
use proptest::prelude::*;

use super::machine::config;
use crate::common::{run, validate};

fn a_line() -> impl Strategy<Value = String> {
    let word = |letters: &'static [&'static str], most: f64| {
        (prop::sample::select(letters), -most..most).prop_map(|(letter, value)| format!("{letter}{value:.3}"))
    };
    let axes = prop::collection::vec(word(&["X", "Y", "Z"], 40.0), 0..3);
    let turn = prop_oneof![
        3 => word(&["A", "C"], 40.0),
        1 => word(&["A", "B", "C"], 400.0),
        2 => word(&["I", "J", "K"], 1.0),
        1 => Just("I0 J0 K1".to_owned()),
        1 => Just("I0 J0 K0".to_owned()),
        2 => Just(String::new()),
    ];
    let code = prop::sample::select(vec![
        "G1",
        "G1",
        "G1",
        "G0",
        "",
        "",
        "M33",
        "M34",
        "G49",
        "G43.4 H1",
        "G43.5 H1",
        "G43.4 P1",
        "G43.4 H1 P1",
        "G91",
        "G90",
        "G55",
        "G2",
        "G28",
        "G53 G0",
        "G200 F50 A0.01",
        "G201",
        "M8",
        "G4 P1",
        "G61.1",
        "G64 P0.1",
        "F500",
    ]);
    (code, axes, turn).prop_map(|(code, axes, turn)| format!("{code} {} {turn}\n", axes.join(" ")))
}

/// A program in one of the modes, with more of what is right than of what is not.
fn a_program() -> impl Strategy<Value = String> {
    let valid = (-40.0..40.0_f64, -40.0..40.0_f64, -1.0..1.0_f64, -1.0..1.0_f64);
    let body = prop::collection::vec((valid, a_line(), 0..8_u32), 1..40);
    (any::<bool>(), body).prop_map(|(vectors, body)| {
        let mode = if vectors { "G43.5 H1" } else { "G43.4 H1" };
        let mut text = format!("{mode} G0 X0 Y0 Z60\nM33\nG1 F2000\n");
        for ((x, y, u, v), line, kind) in body {
            match (kind, vectors) {
                (0, _) => text += &line,
                (_, true) => text += &format!("X{x:.3} Y{y:.3} I{u:.4} J{v:.4} K1\n"),
                (_, false) => text += &format!("X{x:.3} Y{y:.3} A{:.3} C{:.3}\n", -30.0 + 25.0 * u, 170.0 * v),
            }
        }
        text + "M30\n"
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn every_program_ends_with_a_report(program in a_program()) {
        let mut config = config();
        // Four plans of each for the least time would take minutes.
        config.profile.plan_quality = PlanQuality::Fast;
        let report = validate(&program, &config);
        prop_assert!(report.findings.iter().all(|finding| !finding.message.is_empty() && finding.span.line > 0));
        let times = report.thinning.as_ref().map_or([0.0; 2], |it| [it.time_before_s, it.time_after_s]);
        prop_assert!(times.iter().all(|time| time.is_finite() && *time >= 0.0), "{:?}", times);
        if report.is_accepted() {
            let setpoints = run(&program, &config);
            prop_assert_eq!(setpoints.len() as u64, report.summary.setpoint_count);
            prop_assert!(setpoints.axes.iter().flatten().all(|value| value.is_finite()));
        }
    }
}
