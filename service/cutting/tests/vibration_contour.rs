//! Tangential vibrations leave the contour by no more than is reported, on arcs and over junctions.

use std::fmt::Write;

use crate::common::measured::positions;
use crate::common::{run, validate};
use feedwave_cutting::{GenerationMode, MachineProfile, PipelineConfig, VibrationEnvelope};
use proptest::prelude::*;

/// How exact positions are.
const EXACT_MM: f64 = 1e-9;
/// Least direction change that ends the blend.
const TANGENT_RAD: f64 = 1e-3;

fn mill(mode: GenerationMode, tolerance_mm: f64) -> PipelineConfig {
    let mut config = PipelineConfig::new(MachineProfile::mill());
    config.profile.vibration.contour_tolerance_mm = tolerance_mm;
    PipelineConfig { generation_mode: mode, ..config }
}

/// A piece of the contour.
#[derive(Clone, Copy, Debug)]
enum Piece {
    Line { from: [f64; 2], to: [f64; 2] },
    Arc { center: [f64; 2], from: [f64; 2], to: [f64; 2], counterclockwise: bool },
}

fn between(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

impl Piece {
    fn distance(self, point: [f64; 2]) -> f64 {
        match self {
            Self::Line { from, to } => {
                let along = [to[0] - from[0], to[1] - from[1]];
                let square = along[0] * along[0] + along[1] * along[1];
                let share = ((point[0] - from[0]) * along[0] + (point[1] - from[1]) * along[1]) / square;
                let share = share.clamp(0.0, 1.0);
                between(point, [from[0] + share * along[0], from[1] + share * along[1]])
            }
            Self::Arc { center, from, to, counterclockwise } => {
                let angle = |of: [f64; 2]| (of[1] - center[1]).atan2(of[0] - center[0]);
                let turn = |angle: f64| angle.rem_euclid(std::f64::consts::TAU);
                let [first, last] = if counterclockwise { [from, to] } else { [to, from] };
                let is_inside = turn(angle(point) - angle(first)) <= turn(angle(last) - angle(first));
                let ends = between(point, from).min(between(point, to));
                if is_inside { (between(point, center) - between(from, center)).abs().min(ends) } else { ends }
            }
        }
    }
}

/// Largest distance of a setpoint of the vibrating section from the contour.
fn measured_mm(program: &str, contour: &[Piece], config: &PipelineConfig) -> f64 {
    let setpoints = run(program, config);
    let [x, y] = [0, 1].map(|axis| positions(&setpoints, axis));
    let first = setpoints.line.iter().position(|line| *line >= 5).expect("a section");
    let points = x[first..].iter().zip(&y[first..]).map(|(x, y)| [*x, *y]);
    let distance = |point| contour.iter().map(|piece| piece.distance(point)).fold(f64::INFINITY, f64::min);
    points.map(distance).fold(0.0, f64::max)
}

#[test]
fn a_junction_that_is_gone_over_counts_with_what_it_turns_the_offset_by() {
    // 0.9 mrad, below what divides a section.
    let program = "G21 G90 G94 G17 S1000 M3\nG0 X0 Y0 Z0\nF60\nG200 F20 A0.2\nG1 X20\nG1 X40 Y0.018\nG201\nM30\n";
    let contour =
        [Piece::Line { from: [0.0, 0.0], to: [20.0, 0.0] }, Piece::Line { from: [20.0, 0.0], to: [40.0, 0.018] }];
    for envelope in [VibrationEnvelope::Blended, VibrationEnvelope::Published] {
        for mode in [GenerationMode::Tangential, GenerationMode::ServoSide] {
            let config = PipelineConfig { vibration_envelope: envelope, ..mill(mode, 0.001) };
            let report = validate(program, &config);
            let section = &report.sections[0];
            assert_eq!((section.blended_junctions, section.min_radius_mm), (0, None));
            let reported_mm = section.contour_deviation_mm;
            assert!((reported_mm - 0.2 * 0.9e-3).abs() < 1e-9, "{mode:?}: {reported_mm}");
            let measured_mm = measured_mm(program, &contour, &config);
            assert!((0.5 * reported_mm..reported_mm + EXACT_MM).contains(&measured_mm), "{mode:?}: {measured_mm}");
            assert!(report.is_accepted(), "{:?}", report.findings);

            // Beyond the tolerance it is refused, and the amplitude that the cure names is not.
            let config = PipelineConfig { vibration_envelope: envelope, ..mill(mode, 1e-4) };
            let report = validate(program, &config);
            let finding = report.findings.iter().find(|finding| finding.code == "VIB-CONTOUR").expect("a finding");
            assert!(finding.message.contains("by 0.00018 mm at the junction before line 6"), "{}", finding.message);
            assert!(finding.suggestions.iter().any(|it| it.replacement.as_deref() == Some("A0.1111")), "{finding:?}");
            let cured = validate(&program.replace("A0.2", "A0.1111"), &config);
            assert!(cured.findings.iter().all(|finding| finding.code != "VIB-CONTOUR"), "{:?}", cured.findings);
        }
    }
    let along = validate(program, &mill(GenerationMode::AlongPath, 1e-4));
    assert_eq!(along.sections[0].contour_deviation_mm, 0.0);
}

/// The section as text, and its contour.
fn program(blocks: &[(f64, f64, Option<f64>)], amplitude_mm: f64) -> (String, Vec<Piece>) {
    let mut text = format!("G21 G90 G94 G17 S1000 M3\nG0 X0 Y0 Z0\nF120\nG200 F25 A{amplitude_mm:.4}\n");
    let round = |value: f64| (value * 1e6).round() / 1e6;
    let (mut at, mut heading, mut contour) = ([0.0_f64; 2], 0.3_f64, Vec::new());
    for &(length_mm, turn, radius_mm) in blocks {
        heading += turn;
        let from = at;
        match radius_mm {
            None => {
                at = [round(at[0] + length_mm * heading.cos()), round(at[1] + length_mm * heading.sin())];
                writeln!(text, "G1 X{:.6} Y{:.6}", at[0], at[1]).unwrap();
                contour.push(Piece::Line { from, to: at });
            }
            Some(radius) => {
                let side = radius.signum();
                let [i, j] = [round(-radius * heading.sin()), round(radius * heading.cos())];
                let center = [at[0] + i, at[1] + j];
                heading += (length_mm / radius).clamp(-3.0, 3.0);
                at = [round(center[0] + radius * heading.sin()), round(center[1] - radius * heading.cos())];
                let code = if side < 0.0 { 2 } else { 3 };
                writeln!(text, "G{code} X{:.6} Y{:.6} I{i:.6} J{j:.6}", at[0], at[1]).unwrap();
                contour.push(Piece::Arc { center, from, to: at, counterclockwise: side > 0.0 });
            }
        }
    }
    text.push_str("G201\nM30\n");
    (text, contour)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn setpoints_are_within_the_reported_deviation(
        blocks in prop::collection::vec((
            (-1.5..1.0_f64).prop_map(|exponent| 10.0_f64.powf(exponent)),
            prop_oneof![3 => -TANGENT_RAD..TANGENT_RAD, 1 => -2.0..2.0_f64],
            prop_oneof![3 => Just(None), 1 => (1.0..20.0_f64).prop_map(Some), 1 => (-20.0..-1.0_f64).prop_map(Some)],
        ), 1..12),
        amplitude_mm in 0.01..0.1_f64,
        mode in prop_oneof![Just(GenerationMode::Tangential), Just(GenerationMode::ServoSide)],
        published in any::<bool>(),
    ) {
        let (text, contour) = program(&blocks, amplitude_mm);
        let envelope = if published { VibrationEnvelope::Published } else { VibrationEnvelope::Blended };
        let config = PipelineConfig { vibration_envelope: envelope, ..mill(mode, 1.0) };
        let report = validate(&text, &config);
        if report.is_accepted() {
            let measured_mm = measured_mm(&text, &contour, &config);
            let reported_mm = report.sections[0].contour_deviation_mm;
            // Ends of arcs are programmed to a millionth.
            prop_assert!(measured_mm <= reported_mm + 2e-6, "{} of {}\n{}", measured_mm, reported_mm, text);
        }
    }
}
