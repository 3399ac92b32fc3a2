//! The chip under the amplitude that the blends let through, against the chip thickness of the setpoints themselves.

use std::fmt::Write;

use crate::common::{run, validate};
use feedwave_cutting::{MachineProfile, PipelineConfig, SectionReport, VibrationEnvelope};
use proptest::prelude::*;

const HEAD: &str = "M3 S970\nG0 X20 Z0\nG200 F40.417 A0.05\n";

fn config() -> PipelineConfig {
    PipelineConfig { interpolation_period_us: 250, ..PipelineConfig::new(MachineProfile::lathe()) }
}

fn zigzag(length_mm: f64) -> String {
    let mut program = HEAD.to_owned();
    for block in 1..=59 {
        let x = if block % 2 == 1 { "20.020" } else { "20.000" };
        writeln!(program, "G1 X{x} Z{:.3} F0.05", -length_mm * f64::from(block)).unwrap();
    }
    program + "G201\nM30\n"
}

/// Share in air and the longest way without air, in revolutions, behind the first revolution of the setpoints.
struct Measured {
    air: f64,
    longest_rev: f64,
    without_air: usize,
    revolutions: usize,
}

fn measured(program: &str, rev_per_s: f64) -> Measured {
    measured_within(program, rev_per_s, 0.0)
}

/// In air counts what is within `slack_mm` of it.
fn measured_within(program: &str, rev_per_s: f64, slack_mm: f64) -> Measured {
    let config = config();
    let setpoints = run(program, &config);
    let first = setpoints.line.iter().position(|line| *line >= 4).unwrap();
    let start_mm = setpoints.path[first - 1];
    let last = setpoints.path.len()
        - setpoints.path.iter().rev().take_while(|mm| **mm == *setpoints.path.last().unwrap()).count();
    let x: Vec<f64> = (first..last).map(|k| setpoints.path[k] - start_mm + setpoints.vibration[k]).collect();
    let lag = 1.0 / (rev_per_s * 250e-6);
    let at =
        |place: f64| x[place as usize] + (x[(place as usize + 1).min(x.len() - 1)] - x[place as usize]) * place.fract();
    let mut air = Vec::new();
    for (k, present_mm) in x.iter().enumerate().skip(lag.ceil() as usize) {
        let surface = (1..6).map(|q| k as f64 - f64::from(q) * lag).take_while(|place| *place >= 0.0).map(at);
        air.push(*present_mm <= surface.fold(f64::NEG_INFINITY, f64::max) + slack_mm);
    }
    let (mut longest, mut present) = (0, 0);
    for in_air in &air {
        present = if *in_air { 0 } else { present + 1 };
        longest = longest.max(present);
    }
    let turns: Vec<_> = air.chunks_exact(lag as usize).collect();
    Measured {
        air: air.iter().filter(|in_air| **in_air).count() as f64 / air.len() as f64,
        longest_rev: f64::from(longest) / lag,
        without_air: turns.iter().filter(|turn| turn.iter().all(|in_air| !in_air)).count(),
        revolutions: turns.len(),
    }
}

/// The suggested value of a quantity of a finding.
fn cure(program: &str, code: &str, quantity: &str) -> Option<f64> {
    let report = validate(program, &config());
    let finding = report.findings.iter().find(|finding| finding.code.name() == code)?;
    let mut values = finding.suggestions.iter().filter_map(|suggestion| suggestion.value.as_ref());
    values.find(|value| value.name == quantity).map(|value| value.value)
}

/// At constant surface speed the vibrations per revolution change: the chip stays whole far beyond the first and the last blend.
/// Measured on the setpoints: 85.8 revolutions at the start, 115.5 at the end, at most 57.0 between two breaks.
#[test]
fn a_chip_that_stays_whole_beyond_the_outer_blends_is_told() {
    let program = "G98 G50 S3000\nG96 S150 M3\nG0 X60 Z0\nG200 F50 A0.05\nG1 X10 F100\nG201\nG0 Z5\nM30\n";
    let report =
        validate(program, &PipelineConfig::new(MachineProfile { max_feed_override: 1.0, ..MachineProfile::lathe() }));
    let blend = report.sections[0].blend.unwrap();
    for (told, measured) in
        [(blend.unbroken_at_start_rev, 85.8), (blend.unbroken_at_end_rev, 115.5), (blend.longest_unbroken_rev, 57.0)]
    {
        assert!((measured - 2.5..measured + 2.5).contains(&told), "{told} {measured} {blend:?}");
    }
}

/// A single short block, its vibrations per revolution 2.5 at 20.208 Hz.
fn short_section(length_mm: f64, amplitude_mm: f64, frequency_hz: f64) -> String {
    format!("M3 S485\nG0 X20 Z0\nG200 F{frequency_hz:.3} A{amplitude_mm:.4}\nG1 Z{:.3} F0.05\nG201\nM30\n", -length_mm)
}

/// How many cures a chip that a short section leaves whole has; each of them breaks it.
fn cures_of(length_mm: f64, amplitude_mm: f64, frequency_hz: f64) -> usize {
    let program = short_section(length_mm, amplitude_mm, frequency_hz);
    let length = cure(&program, "VIB-CHIP-UNBROKEN", "length");
    let amplitude = cure(&program, "VIB-CHIP-UNBROKEN", "amplitude");
    let cured = [
        length.map(|length_mm| short_section(length_mm, amplitude_mm, frequency_hz)),
        amplitude.map(|amplitude_mm| short_section(length_mm, amplitude_mm, frequency_hz)),
    ];
    for program in cured.iter().flatten() {
        let (report, codes) = section(program);
        assert!(!codes.contains(&"VIB-CHIP-UNBROKEN") && report.broken_share == Some(1.0), "{program} {codes:?}");
        assert!(measured(program, 485.0 / 60.0).air > 0.0, "{program}");
    }
    cured.iter().flatten().count()
}

#[test]
fn what_is_suggested_for_short_sections_breaks_the_chip() {
    let sections = [(0.02, 0.05), (0.1, 0.05), (0.13, 0.1), (0.12, 0.1), (0.15, 0.12), (0.18, 0.3)];
    let cures = sections.map(|(length_mm, amplitude_mm)| cures_of(length_mm, amplitude_mm, 20.208));
    assert!(cures.iter().all(|cures| *cures > 0) && cures.contains(&2), "a length each, and an amplitude: {cures:?}");
}

fn section(program: &str) -> (SectionReport, Vec<&'static str>) {
    let report = validate(program, &config());
    let codes = report.findings.iter().map(|finding| finding.code.name()).collect();
    (report.sections[0].clone(), codes)
}

#[test]
fn a_section_too_short_for_its_amplitude_breaks_nothing() {
    let (report, codes) = section(&format!("{HEAD}G1 Z-0.02 F0.05\nG201\nM30\n"));
    let chip = report.chip.unwrap();
    assert!(!chip.broken && chip.air_share == 0.0 && chip.condition.amplitude_mm < 0.0001, "{chip:?}");
    assert!((chip.min_amplitude_mm.unwrap() - 0.025).abs() < 1e-4);
    assert_eq!(report.broken_share, Some(0.0));
    assert!(codes.contains(&"VIB-CHIP-UNBROKEN"), "{codes:?}");
}

#[test]
fn junctions_that_are_blended_leave_revolutions_unbroken() {
    let program = zigzag(0.16);
    let (found, (report, codes)) = (measured(&program, 970.0 / 60.0), section(&program));
    assert!(found.without_air > 20 && found.longest_rev > 1.5, "{} {}", found.without_air, found.longest_rev);
    let blend = report.blend.unwrap();
    assert!((blend.air_share - found.air).abs() < 0.01, "{} {}", blend.air_share, found.air);
    // To within two setpoints, each a 248th of a revolution.
    assert!((blend.longest_unbroken_rev - found.longest_rev).abs() < 0.01, "{blend:?} {}", found.longest_rev);
    let unbroken = found.without_air as f64 / found.revolutions as f64;
    assert!(report.broken_share.unwrap() <= 1.0 - unbroken, "{:?} {unbroken}", report.broken_share);
    assert!(codes.contains(&"VIB-PARTLY-UNBROKEN"), "{codes:?}");
}

#[test]
fn junctions_everywhere_leave_the_whole_chip() {
    let program = zigzag(0.1);
    let (found, (report, codes)) = (measured(&program, 970.0 / 60.0), section(&program));
    assert_eq!((found.air, found.without_air), (0.0, found.revolutions));
    assert!(!report.chip.unwrap().broken);
    assert_eq!((report.broken_share, report.blend.unwrap().broken_share), (Some(0.0), 0.0));
    assert!(codes.contains(&"VIB-CHIP-UNBROKEN"), "{codes:?}");
}

#[test]
fn a_long_section_stays_broken_and_its_ends_are_numbers() {
    let program = "M3 S970\nG0 X50 Z0\nG200 F45 A0.1\nG1 Z-6 F0.1\nG201\nM30\n";
    let (found, (report, codes)) = (measured(program, 970.0 / 60.0), section(program));
    let blend = report.blend.unwrap();
    assert_eq!((report.broken_share, blend.longest_unbroken_mm), (Some(1.0), 0.0));
    assert!(blend.broken_share > 0.95 && blend.broken_share < 1.0);
    assert!((blend.air_share - found.air).abs() < 0.01, "{} {}", blend.air_share, found.air);
    assert!(!codes.contains(&"VIB-PARTLY-UNBROKEN"), "{codes:?}");
    let published = PipelineConfig { vibration_envelope: VibrationEnvelope::Published, ..config() };
    assert_eq!(validate(program, &published).sections[0].blend, None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn what_is_suggested_for_any_short_section_breaks_the_chip(
        length_mm in 0.02..0.3_f64,
        amplitude_mm in 0.03..0.3_f64,
        frequency_hz in 18.5..22.0_f64,
    ) {
        cures_of(length_mm, amplitude_mm, frequency_hz);
    }

    #[test]
    fn nothing_is_said_to_break_that_the_setpoints_leave_whole(
        length_mm in 0.03..0.5_f64,
        amplitude_mm in 0.028..0.07_f64,
        frequency_hz in 35.0..46.0_f64,
    ) {
        let words = format!("F{frequency_hz:.3} A{amplitude_mm:.4}");
        let program = zigzag(length_mm).replace("F40.417 A0.05", &words);
        // Between two setpoints the chip may be thinner than at both, and the surface that is drawn straight between two is too low.
        let step_rad = core::f64::consts::TAU * frequency_hz * 250e-6;
        let slack_mm = (0.05 + amplitude_mm) * step_rad * step_rad / 8.0;
        let (found, (report, codes)) =
            (measured_within(&program, 970.0 / 60.0, slack_mm), section(&program));
        let Some(blend) = report.blend else { return Ok(()) };
        let unbroken_rev = blend.longest_unbroken_rev.max(blend.unbroken_at_start_rev).max(blend.unbroken_at_end_rev);
        let broken = report.chip.unwrap().broken;
        if broken {
            prop_assert!(found.longest_rev <= unbroken_rev + 0.05, "{} {:?}", found.longest_rev, blend);
            let whole = found.without_air as f64 / found.revolutions.max(1) as f64;
            prop_assert!(blend.broken_share <= 1.0 - whole + 0.1, "{} {:?}", whole, blend);
        } else {
            prop_assert!(codes.contains(&"VIB-CHIP-UNBROKEN"));
        }
    }
}
