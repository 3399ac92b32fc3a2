//! How a vibration begins and ends: limits at every setpoint, the exact end, nothing beyond the section, whatever the
//! program, the mode, the period and the feed override.

use core::f64::consts::TAU;
use std::fmt::Write;

use crate::common::measured::{positions, worst_use};
use crate::common::{all_bits, resume, run, run_appending, run_in_pieces, snapshots, validate};
use feedwave_cutting::{
    AxisLoadReport, GenerationMode, MachineProfile, OverrideChange, PipelineConfig, VibrationEnvelope,
};
use proptest::prelude::*;

/// 45 Hz and 0.1 mm on the generic lathe, whose axes follow 10 m/s².
const TURNED: &str = "G21 S970 M3\nG0 X30 Z2\nG200 F45 A0.1\nG1 Z-6 F0.1\nG201\nM30\n";
/// How exact positions are besides the rounding of their numbers.
const FIT_MM: f64 = 2e-13;
const PERIODS_US: [u32; 3] = [250, 1_000, 4_000];
const MODES: [GenerationMode; 3] = [GenerationMode::AlongPath, GenerationMode::Tangential, GenerationMode::ServoSide];

fn lathe(mode: GenerationMode, period_us: u32) -> PipelineConfig {
    let config = PipelineConfig::new(MachineProfile::lathe());
    PipelineConfig { generation_mode: mode, interpolation_period_us: period_us, ..config }
}

#[test]
fn limits_hold_at_the_ends_as_inside() {
    for mode in MODES {
        for period_us in PERIODS_US {
            let config = lathe(mode, period_us);
            let setpoints = run(TURNED, &config);
            let (worst, at) = worst_use(&setpoints, &config, FIT_MM);
            assert!(worst.iter().all(|ratio| *ratio <= 1.0 + 1e-6), "{mode:?} {period_us}: {worst:?} at {at:?}");
            let z = positions(&setpoints, 1);
            assert_eq!(z.last(), Some(&-6.0));
            let first = setpoints.line.iter().position(|line| *line == 4).unwrap();
            assert!(z[first..].iter().all(|z| (-6.0..=2.0).contains(z)), "{mode:?} {period_us}");
        }
    }
    let report = validate(TURNED, &lathe(GenerationMode::AlongPath, 1_000));
    assert!(report.is_accepted(), "{:?}", report.findings);
    let section = &report.sections[0];
    assert_eq!(section.envelope, VibrationEnvelope::Blended);
    // 1.2 amplitudes are more than two vibrations at 1.617 mm/s.
    assert!((section.ramp_mm.unwrap() - 0.12).abs() < 1e-12);
    assert!((section.full_amplitude_share - (8.0 - 0.24) / 8.0).abs() < 1e-12);
    assert_eq!((section.clamped_share, section.published_ends.as_ref()), (0.0, None));
}

#[test]
fn the_published_form_says_what_it_asks_for() {
    let published = |bind| {
        let mut config = lathe(GenerationMode::AlongPath, 1_000);
        config.profile.vibration.published_limits_bind = bind;
        PipelineConfig { vibration_envelope: VibrationEnvelope::Published, ..config }
    };
    let report = validate(TURNED, &published(false));
    assert!(report.is_accepted());
    let ends = report.sections[0].published_ends.clone().unwrap();
    assert!((ends.start_velocity_step_mm_per_s - TAU * 4.5).abs() < 1e-9);
    let (worst, _) = worst_use(&run(TURNED, &published(false)), &published(false), FIT_MM);
    let found = worst[1] * 10_000.0;
    assert!(found > 27_000.0 && found <= ends.clamp_acceleration_mm_per_s2, "{found} of {ends:?}");
    assert!((ends.start_acceleration_mm_per_s2 / 27_900.0 - 1.0).abs() < 0.01, "{ends:?}");
    let finding = report.findings.iter().find(|finding| finding.code == "VIB-PUBLISHED-ENDS").unwrap();
    assert_eq!(finding.severity, feedwave_program::Severity::Warning);
    assert!(!validate(TURNED, &published(true)).is_accepted());
}

/// The peaks that the report states are those of the setpoints, or a little above them: at starts, clamps, corners and rests.
#[test]
fn the_published_form_asks_for_no_more_than_is_reported() {
    let cornered = "G21 S970 M3\nG0 X30 Z2\nG200 F45 A0.1\nG1 Z-6 F0.1\nG1 X32\nG1 X40 Z-7.3\nG201\nM30\n";
    for (program, mode) in [TURNED, cornered].into_iter().flat_map(|program| MODES.map(|mode| (program, mode))) {
        for period_us in [250, 1_000] {
            let config = lathe(mode, period_us);
            let config = PipelineConfig { vibration_envelope: VibrationEnvelope::Published, ..config };
            let axes = &validate(program, &config).sections[0].axes;
            let stated = |ratio: fn(&AxisLoadReport) -> f64| axes.iter().map(ratio).fold(0.0, f64::max);
            let acceleration = stated(|axis| axis.acceleration_per_s2 / axis.max_acceleration_per_s2);
            let jerk = stated(|axis| axis.jerk_per_s3 / axis.max_jerk_per_s3);
            let ([_, found, found_jerk], at) = worst_use(&run(program, &config), &config, FIT_MM);
            let case = format!("{mode:?} {period_us}: {found} of {acceleration}, {found_jerk} of {jerk} at {at:?}");
            assert!(found <= acceleration && found_jerk <= jerk && jerk > 1.0, "{case}");
            // The period of servo setpoints is a fraction of what is measured here.
            assert!(mode == GenerationMode::ServoSide || found_jerk > 0.3 * jerk, "{case}");
        }
    }
}

/// What steps by the feed as well, does so at the highest one that is permitted or planned.
#[test]
fn the_published_form_is_judged_at_every_feed_override() {
    let program = |feed: f64| {
        format!(
            "G21 G97 G99\nM3 S1000\nG0 X20 Z10\nG4 X0.2\nG200 F41.667 A0.03\nG1 Z9.2 F{feed}\nG201\nG4 X0.2\nG0 X40\nM30\n"
        )
    };
    let refused = |feed: f64, max_feed_override: f64, overrides: Vec<OverrideChange>| {
        let mut config = lathe(GenerationMode::AlongPath, 1_000);
        config.profile.vibration.published_limits_bind = true;
        config.profile.max_feed_override = max_feed_override;
        config.profile.machine.axes.iter_mut().for_each(|axis| axis.max_jerk_per_s3 = 20e6);
        let config = PipelineConfig { vibration_envelope: VibrationEnvelope::Published, overrides, ..config };
        let report = validate(&program(feed), &config);
        let is_refused = report.findings.iter().any(|finding| finding.code == "VIB-PUBLISHED-ENDS");
        assert_eq!(report.sections[0].feasible, !is_refused, "{:?}", report.findings);
        is_refused
    };
    // 2πfA + v of 7.854 and 2 mm/s in 1 ms, of 10 000 mm/s² at most.
    assert!(!refused(0.12, 1.0, Vec::new()));
    assert!(refused(0.12, 1.5, Vec::new()), "7.854 + 3");
    assert!(refused(0.12, 1.0, vec![OverrideChange { index: 400, ratio: 2.0 }]), "7.854 + 4");
    assert!(refused(0.24, 1.0, Vec::new()));
}

#[test]
fn the_amplitude_is_the_envelope_of_the_place_on_the_path() {
    for (mode, share) in MODES.into_iter().zip([1.0, 1.0, 1.0]) {
        let setpoints = run(TURNED, &lathe(mode, 1_000));
        let section = setpoints.line.iter().position(|line| *line == 4).unwrap();
        let start_mm = setpoints.path[section - 1];
        for k in section..setpoints.len() {
            let along = setpoints.path[k] - start_mm;
            let x = (along.min(8.0 - along) / 0.12).clamp(0.0, 1.0);
            let e = x * x * x * (10.0 + x * (6.0 * x - 15.0));
            let expected = share * 0.1 * e * (TAU * 0.045 * (k + 1 - section) as f64).sin();
            assert!((setpoints.vibration[k] - expected).abs() < 1e-9, "{mode:?} {k}: {expected}");
        }
    }
}

#[test]
fn an_interior_corner_is_not_overrun() {
    let program = "G21 G98 S970 M3\nG0 X10 Z0\nG200 F41 A0.03\nG1 Z-1 F60\nG1 X22\nG201\nM30\n";
    for mode in MODES {
        for envelope in [VibrationEnvelope::Blended, VibrationEnvelope::Published] {
            let config = PipelineConfig { vibration_envelope: envelope, ..lathe(mode, 1_000) };
            let setpoints = run(program, &config);
            let mut z = setpoints.axes[1].clone();
            if mode == GenerationMode::ServoSide {
                for (k, z) in z.iter_mut().enumerate() {
                    let offset = setpoints.servo_amplitude[1][k] * (TAU * setpoints.servo_phase[k]).sin();
                    *z = (*z + offset).max(setpoints.servo_low[1][k]).min(setpoints.servo_high[1][k]);
                }
            }
            let lowest = z.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(lowest >= -1.0, "{mode:?} {envelope:?}: Z{lowest}");
        }
        let report = validate(program, &lathe(mode, 1_000));
        let section = &report.sections[0];
        assert_eq!(section.blended_junctions, 1, "{mode:?}");
        let ramp_mm = section.ramp_mm.unwrap();
        assert!((section.full_amplitude_share - (7.0 - 4.0 * ramp_mm) / 7.0).abs() < 1e-9);
    }
}

#[test]
fn a_section_too_short_for_its_amplitude_is_warned_of() {
    let report = validate(
        "G21 S970 M3\nG0 X10 Z0\nG200 F45 A0.1\nG1 Z-0.2 F0.1\nG201\nM30\n",
        &lathe(GenerationMode::AlongPath, 1_000),
    );
    assert_eq!(report.sections[0].full_amplitude_share, 0.0);
    assert!(report.findings.iter().any(|finding| finding.code == "VIB-TRAVEL-SHORT"), "{:?}", report.findings);
}

#[derive(Clone, Debug)]
enum Block {
    /// Length, mm, and turn of direction before it, rad.
    Line(f64, f64),
    /// Radius and sweep.
    Arc(f64, f64),
    /// mm/min
    Feed(f64),
}

fn blocks() -> impl Strategy<Value = Vec<Block>> {
    let length = || (-1.5..1.0_f64).prop_map(|exponent| 10.0_f64.powf(exponent));
    let sign = || prop_oneof![Just(-1.0), Just(1.0)];
    let block = prop_oneof![
        3 => (length(), -3.0..3.0_f64).prop_map(|(length, turn)| Block::Line(length, turn)),
        3 => (length(), Just(0.0)).prop_map(|(length, turn)| Block::Line(length, turn)),
        2 => (length(), -2e-3..2e-3_f64).prop_map(|(length, turn)| Block::Line(length, turn)),
        4 => (0.2..20.0_f64, 0.05..3.0_f64, sign()).prop_map(|(radius, sweep, side)| Block::Arc(radius, side * sweep)),
        1 => (5.0..2_000.0_f64).prop_map(Block::Feed),
    ];
    prop::collection::vec(block, 1..8)
}

fn program(blocks: &[Block], frequency_hz: f64, amplitude_mm: f64) -> (String, [f64; 2]) {
    let mut text = format!("G21 G90 G94 G17 S1000 M3\nG0 X0 Y0 Z0\nF120\nG200 F{frequency_hz:.3} A{amplitude_mm:.4}\n");
    let (mut at, mut heading) = ([0.0_f64; 2], 0.3_f64);
    let round = |value: f64| (value * 1e6).round() / 1e6;
    for block in blocks {
        match *block {
            Block::Line(length, turn) => {
                heading += turn;
                at = [round(at[0] + length * heading.cos()), round(at[1] + length * heading.sin())];
                writeln!(text, "G1 X{:.6} Y{:.6}", at[0], at[1]).unwrap();
            }
            Block::Arc(radius, sweep) => {
                let side = sweep.signum();
                let [i, j] = [-side * radius * heading.sin(), side * radius * heading.cos()];
                let center = [at[0] + i, at[1] + j];
                heading += sweep;
                at = [
                    round(center[0] + side * radius * heading.sin()),
                    round(center[1] - side * radius * heading.cos()),
                ];
                let code = if sweep < 0.0 { 2 } else { 3 };
                writeln!(text, "G{code} X{:.6} Y{:.6} I{i:.6} J{j:.6}", at[0], at[1]).unwrap();
            }
            Block::Feed(feed) => writeln!(text, "F{feed:.1}").unwrap(),
        }
    }
    text.push_str("G201\nM30\n");
    (text, at)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn whatever_the_program_limits_hold_the_end_is_exact_and_every_way_gives_the_same_bits(
        blocks in blocks(),
        frequency_hz in 15.0..60.0_f64,
        amplitude in 0.1..1.0_f64,
        mode in prop_oneof![Just(MODES[0]), Just(MODES[1]), Just(MODES[2])],
        period_us in prop_oneof![Just(250_u32), Just(1_000), Just(4_000)],
        steps in proptest::collection::vec((1_u64..900, prop_oneof![1 => Just(0.0), 4 => 0.2..2.0_f64]), 0..6),
        follows in prop_oneof![Just(None), Just(Some(1.4))],
        piece in 17_usize..2_000,
    ) {
        // Of what the axes could follow at the largest.
        let rad_per_s = TAU * frequency_hz;
        let amplitude_mm = amplitude * (0.4 * 10_000.0 / rad_per_s.powi(2)).min(0.25 * 5e6 / rad_per_s.powi(3)).min(0.3);
        let mut config = PipelineConfig::new(MachineProfile::mill());
        config.profile.vibration.contour_tolerance_mm = 1.0;
        config.profile.vibration.amplitude_follows_feed_up_to = follows;
        config = PipelineConfig { generation_mode: mode, interpolation_period_us: period_us, ..config };
        let (text, end) = program(&blocks, frequency_hz, amplitude_mm);
        let mut index = 1;
        let changes: Vec<OverrideChange> = steps.into_iter().chain([(500, 1.0)]).map(|(pause, ratio)| {
            index += pause;
            OverrideChange { index, ratio }
        }).collect();
        let report = validate(&text, &config);
        prop_assume!(report.is_accepted());
        let plain = config.clone();
        config.overrides = changes.clone();
        let setpoints = run(&text, &config);
        for (axis, end) in end.into_iter().enumerate() {
            prop_assert_eq!(positions(&setpoints, axis).last().copied(), Some(end));
        }
        let (worst, at) = worst_use(&setpoints, &config, FIT_MM);
        prop_assert!(
            worst.iter().all(|ratio| *ratio <= 1.0 + 1e-6),
            "{:?} at {:?}, lines {:?}\n{}", worst, at, at.map(|k| setpoints.line[k]), text
        );
        let reach_mm = amplitude_mm * follows.unwrap_or(1.0);
        prop_assert!(setpoints.vibration.iter().all(|offset| offset.abs() <= reach_mm + 1e-4));
        prop_assert_eq!(all_bits(&run_in_pieces(text.as_bytes(), &config, piece)), all_bits(&setpoints));
        prop_assert_eq!(all_bits(&run_appending(&text, &plain, &changes, piece)), all_bits(&setpoints));
        // Each of these runs to the end: few of them, from all parts of the program.
        let taken = snapshots(text.as_bytes(), &config);
        let every = taken.len().div_ceil(5).max(1);
        for (_, offset, snapshot) in taken.into_iter().step_by(every) {
            let (first, rest) = resume(text.as_bytes(), &config, offset, &snapshot);
            prop_assert_eq!(all_bits(&rest), all_bits(&setpoints)[first as usize..].to_vec());
        }
    }
}

#[test]
fn the_report_names_the_drilling_cycle_of_a_section() {
    let mut config = PipelineConfig::new(MachineProfile::mill());
    config.profile.language.drilling.peck_clearance_mm = Some(1.0);
    // Two holes of three strokes, then a bore that is fed out again, and a cut without a cycle.
    let program = "M3 S1000
G0 X0 Y0 Z10
G200 F41.667 A0.03
G98 G83 X10 Y5 Z-12 R2 Q5 F40
X20
G85 X30 Z-4
G80
G1 X40 Y40
G0 Z20
G1 Z8
G81 Z3 R8
G80
G201
M30
";
    let report = validate(program, &config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    let sections: Vec<_> = report
        .sections
        .iter()
        .map(|section| {
            let cycle = section.drilling_cycle.map(|cycle| (cycle.code(), cycle.line));
            (section.first_line, section.last_line, cycle, (section.length_mm * 1e6).round() / 1e6)
        })
        .collect();
    let (peck, bore, drill) = (Some(("G83", 4)), Some(("G85", 6)), Some(("G81", 11)));
    let strokes = |line| [5.0, 6.0, 5.0].map(|length_mm| (line, line, peck, length_mm));
    let travel_mm = ((10.0_f64 * 10.0 + 35.0 * 35.0).sqrt() * 1e6).round() / 1e6;
    let others = [(6, 6, bore, 12.0), (8, 8, None, travel_mm), (10, 11, drill, 17.0)];
    let expected: Vec<_> = strokes(4).into_iter().chain(strokes(5)).chain(others).collect();
    assert_eq!(sections, expected);
    // It does vibrate there, and nowhere on the way out of a hole at rapid.
    let setpoints = run(program, &config);
    let vibrates = |line: u32| {
        (0..setpoints.len()).any(|index| setpoints.line[index] == line && setpoints.vibration[index].abs() > 0.02)
    };
    assert!([4, 5, 6, 8, 10, 11].into_iter().all(vibrates) && ![2, 9].into_iter().any(vibrates));
}
