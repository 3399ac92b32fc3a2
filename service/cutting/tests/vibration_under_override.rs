//! The amplitude of a vibration under the feed override: fixed, or following the feed so that the chip stays broken.

use core::f64::consts::TAU;

use crate::common::{Setpoints, all_bits, resume, run, run_appending, run_in_pieces, snapshots, validate};
use feedwave_cutting::{
    CutCondition, FeedCoupling, GenerationMode, MachineProfile, OverrideChange, PipelineConfig, SectionReport,
    VibrationEnvelope,
};
use feedwave_program::{Finding, Severity};
use proptest::prelude::*;

/// 1000 rev/min, 2.5 vibrations per revolution, twice the amplitude is 1.2 times the feed per revolution.
const TURNED: &str = "G21 G97 S1000 M3\nG0 X6. Z2.\nG200 F41.66666667 A0.03\nG1 Z12. F0.05\nG201\nM30\n";
const FREQUENCY_HZ: f64 = 41.666_666_67;
/// Setpoints of a revolution at 1 ms.
const TURN: usize = 60;

fn config(up_to: Option<f64>, overrides: &[(u64, f64)]) -> PipelineConfig {
    let mut profile = MachineProfile::lathe();
    profile.vibration.amplitude_follows_feed_up_to = up_to;
    let overrides = overrides.iter().map(|&(index, ratio)| OverrideChange { index, ratio }).collect();
    PipelineConfig { overrides, ..PipelineConfig::new(profile) }
}

/// Setpoints of the section without its first and last revolutions, where the feed begins and ends.
fn middle(setpoints: &Setpoints) -> std::ops::Range<usize> {
    let is_section = |k: &usize| setpoints.line[*k] == 4;
    let first = (0..setpoints.len()).find(is_section).unwrap();
    let last = (0..setpoints.len()).rev().find(is_section).unwrap();
    first + 4 * TURN..last - 2 * TURN
}

/// Revolutions, by their first setpoint, in which no setpoint lies where an earlier revolution has cut already.
fn unbroken_turns(setpoints: &Setpoints) -> Vec<usize> {
    let place: Vec<f64> = setpoints.axes[1].clone();
    let within = middle(setpoints);
    let cuts_air = |k: usize| {
        let start = within.start - 3 * TURN;
        (1..)
            .map(|turn| k - turn * TURN)
            .take_while(|earlier| *earlier >= start)
            .any(|earlier| place[earlier] >= place[k])
    };
    // Half a millisecond beside the turning point of the wave costs less than a hundredth of it.
    (within.start..within.end - TURN).step_by(TURN).filter(|&turn| !(turn..turn + TURN).any(cuts_air)).collect()
}

/// The cut as it is at the end of the section's middle.
fn cut(setpoints: &Setpoints) -> CutCondition {
    let within = middle(setpoints);
    let last = within.end - 8 * TURN..within.end;
    let amplitude_mm = setpoints.vibration[last.clone()].iter().copied().fold(0.0, f64::max);
    CutCondition {
        feed_per_rev_mm: (setpoints.path[last.end] - setpoints.path[last.start]) / 8.0,
        amplitude_mm,
        frequency_hz: FREQUENCY_HZ,
        spindle_rev_per_min: 1000.0,
        diameter_mm: 6.0,
        feed_coupling: FeedCoupling::PerRevolution,
    }
}

#[test]
fn the_chip_stays_broken_from_60_to_140_percent_where_the_amplitude_follows() {
    for (ratio, change) in [(0.6, 2_000), (1.4, 2_000), (1.4, 2_017), (0.6, 1_993)] {
        let following = run(TURNED, &config(Some(1.5), &[(change, ratio)]));
        let fixed = run(TURNED, &config(None, &[(change, ratio)]));
        let (now, before) = (cut(&following), cut(&fixed));
        assert!((now.feed_per_rev_mm - 0.05 * ratio).abs() < 1e-9, "{now:?}");
        assert!((now.amplitude_mm - 0.03 * ratio).abs() < 1e-4, "{now:?}");
        assert!((before.amplitude_mm - 0.03).abs() < 1e-4, "{before:?}");
        assert!(now.breaks_chip(), "{now:?}");
        assert_eq!(before.breaks_chip(), ratio < 1.2, "a fixed amplitude suffices up to 120 %: {before:?}");
        assert_eq!(unbroken_turns(&following), [0; 0], "in no revolution, the change included, at {ratio}");
        assert_eq!(unbroken_turns(&fixed).is_empty(), ratio < 1.2);
    }
}

#[test]
fn the_amplitude_does_not_exceed_its_limit_and_never_that_of_the_machine() {
    let following = run(TURNED, &config(Some(1.25), &[(2_000, 2.0)]));
    assert!((cut(&following).amplitude_mm - 0.0375).abs() < 1e-4);
    let mut config = config(Some(2.0), &[(2_000, 2.0)]);
    config.profile.vibration.max_amplitude_mm = 0.04;
    let following = run(TURNED, &config);
    assert!((cut(&following).amplitude_mm - 0.04).abs() < 1e-4);
}

#[test]
fn the_vibration_is_as_programmed_without_the_setting_and_without_a_change() {
    let changes = [(1_500, 0.5), (4_000, 1.0)];
    for setpoints in [run(TURNED, &config(None, &changes)), run(TURNED, &config(Some(1.5), &[]))] {
        let wave = |k: usize| (TAU * FREQUENCY_HZ * 1e-3 * k as f64).sin();
        let first = (0..setpoints.len()).find(|&k| setpoints.vibration[k] != 0.0).unwrap() - 1;
        for k in middle(&setpoints) {
            assert!((setpoints.vibration[k] - 0.03 * wave(k - first)).abs() < 1e-7, "at {k}");
        }
    }
}

#[test]
fn a_held_feed_lets_the_vibration_die_out_and_waits_for_it_to_come_back() {
    let held = run(TURNED, &config(Some(1.5), &[(2_000, 0.0), (3_000, 1.0)]));
    let rests = |k: usize| held.feed[k] == 0.0;
    // Four vibrations are 96 ms: so long after the feed has had the time to stop, and so long before it goes on.
    assert!((2_200..3_000).all(|k| held.vibration[k] == 0.0 && rests(k)), "at rest");
    assert!((3_000..3_096).all(rests) && !rests(3_110), "the vibration comes back first");
    assert_eq!(unbroken_turns(&held)[..], [0; 0], "air is cut at rest too");
    assert_eq!(held.axes[1].last(), run(TURNED, &config(None, &[])).axes[1].last());
}

/// Third differences of the vibrating axis within the section.
fn check_limits(setpoints: &Setpoints, config: &PipelineConfig) -> Result<(), TestCaseError> {
    let h = config.period_s();
    let axis = &config.profile.machine.axes[1];
    for (k, p) in setpoints.axes[1][middle(setpoints)].windows(4).enumerate() {
        let velocity = (p[3] - p[2]) / h;
        let acceleration = (p[3] - 2.0 * p[2] + p[1]) / (h * h);
        let jerk = (p[3] - 3.0 * p[2] + 3.0 * p[1] - p[0]) / (h * h * h);
        prop_assert!(velocity.abs() <= axis.max_velocity_per_s * (1.0 + 1e-6), "{velocity} at {k}");
        prop_assert!(acceleration.abs() <= axis.max_acceleration_per_s2 * (1.0 + 1e-6), "{acceleration} at {k}");
        prop_assert!(jerk.abs() <= axis.max_jerk_per_s3 * (1.0 + 1e-6) + 1e-3, "{jerk} at {k}");
    }
    Ok(())
}

/// Limits that the largest amplitude as published just meets: a fiftieth is the least that has to be left for the feed.
fn tight(up_to: f64, overrides: &[(u64, f64)]) -> PipelineConfig {
    let mut config = config(Some(up_to), overrides);
    config.vibration_envelope = VibrationEnvelope::Published;
    let rad_per_s = TAU * FREQUENCY_HZ;
    let amplitude_mm = 0.03 * up_to * 1.03;
    let axis = &mut config.profile.machine.axes[1];
    axis.max_acceleration_per_s2 = 1.03 * rad_per_s.powi(2) * amplitude_mm;
    axis.max_jerk_per_s3 = 1.03 * rad_per_s.powi(3) * amplitude_mm;
    config
}

#[test]
fn an_amplitude_that_could_not_follow_is_refused_before_anything_moves() {
    let mut config = tight(1.5, &[]);
    // The steps at the ends of the published form are more than the axis follows; the amplitude inside fits.
    let refusals = |config: &PipelineConfig| -> Vec<&'static str> {
        let report = validate(TURNED, config);
        let errors = report.findings.iter().filter(|finding| finding.severity == Severity::Error);
        errors.map(|finding| finding.code.name()).collect()
    };
    assert!(refusals(&config).is_empty(), "what just fits");
    config.profile.vibration.amplitude_follows_feed_up_to = Some(1.6);
    let report = validate(TURNED, &config);
    let codes: Vec<&str> = report.findings.iter().map(|finding| finding.code.name()).collect();
    assert!(codes.contains(&"VIB-AXIS-JERK"), "{codes:?}");
    config.profile.vibration.amplitude_follows_feed_up_to = None;
    assert!(refusals(&config).is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn whatever_the_changes_limits_hold_the_path_stays_and_every_way_gives_the_same_bits(
        steps in proptest::collection::vec((1_u64..900, prop_oneof![Just(0.0), 0.3..2.0_f64]), 1..8),
        mode in prop_oneof![Just(GenerationMode::AlongPath), Just(GenerationMode::Tangential), Just(GenerationMode::ServoSide)],
        piece in 17_usize..2_000,
    ) {
        let mut index = 1_200;
        let mut changes: Vec<_> = steps.into_iter().map(|(pause, ratio)| { index += pause; (index, ratio) }).collect();
        changes.push((index + 500, 1.0));
        let config = PipelineConfig { generation_mode: mode, ..tight(1.5, &changes) };
        let whole = run(TURNED, &config);
        if mode != GenerationMode::ServoSide {
            check_limits(&whole, &config)?;
        }
        prop_assert!(whole.vibration.iter().all(|offset| offset.abs() <= 0.045 + 1e-12));
        prop_assert!(whole.path.windows(2).all(|pair| pair[1] >= pair[0]));
        prop_assert_eq!(whole.axes[1].last(), Some(&12.0));
        prop_assert_eq!(all_bits(&run_in_pieces(TURNED.as_bytes(), &config, piece)), all_bits(&whole));
        let plain = PipelineConfig { overrides: Vec::new(), ..config.clone() };
        prop_assert_eq!(all_bits(&run_appending(TURNED, &plain, &config.overrides, piece)), all_bits(&whole));
        for (_, offset, snapshot) in snapshots(TURNED.as_bytes(), &config).into_iter().step_by(3) {
            let (first, rest) = resume(TURNED.as_bytes(), &config, offset, &snapshot);
            prop_assert_eq!(all_bits(&rest), all_bits(&whole)[first as usize..].to_vec());
        }
    }
}

/// 2.5 vibrations per revolution at 1000 rev/min, and a margin of 1.1 at the programmed feed of 0.01 mm/rev.
const SCARCE: &str = "G21 G97 S1000 M3\nG0 X6. Z2.\nG200 F41.66666667 A0.0055\nG1 Z12. F0.01\nG201\nM30\n";

/// Its only section, and what is said about its chip.
fn judged(program: &str, config: &PipelineConfig) -> (SectionReport, Vec<Finding>) {
    let mut report = validate(program, config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    let about_chips =
        |finding: &Finding| finding.code.name().contains("CHIP") || finding.code.name().contains("UNBROKEN");
    report.findings.retain(about_chips);
    (report.sections.remove(0), report.findings)
}

fn codes(findings: &[Finding]) -> Vec<&str> {
    findings.iter().map(|finding| finding.code.name()).collect()
}

fn value(finding: &Finding, name: &str) -> f64 {
    let value = finding.values.iter().find(|value| value.name == name);
    value.unwrap_or_else(|| panic!("no {name} in {finding:#?}")).value
}

#[test]
fn the_verdict_holds_at_the_overridden_feed() {
    let (section, findings) = judged(SCARCE, &config(None, &[(0, 1.5)]));
    assert_eq!(codes(&findings), ["VIB-CHIP-UNBROKEN"]);
    let chip = section.chip.unwrap();
    assert!(!chip.broken && (chip.condition.feed_per_rev_mm - 0.015).abs() < 1e-12);
    assert_eq!((section.broken_share, section.feed_override), (Some(0.0), Some(1.5)));
    assert_eq!(value(&findings[0], "feed_override"), 1.5);
    assert!(findings[0].message.contains("override of 150 %"), "{}", findings[0].message);

    // The same of a feed per minute; and where the amplitude follows there is nothing to say.
    let per_minute = SCARCE.replace("G21", "G21 G94").replace("F0.01", "F10");
    assert_eq!(codes(&judged(&per_minute, &config(None, &[(0, 1.5)])).1), ["VIB-CHIP-UNBROKEN"]);
    let (section, findings) = judged(SCARCE, &config(Some(1.5), &[(0, 1.5)]));
    assert!(codes(&findings).is_empty() && section.chip.unwrap().broken, "{findings:#?}");
    assert_eq!(section.at_max_feed_override.unwrap().broken_share, 1.0);
}

#[test]
fn what_the_machine_permits_beyond_the_plan_is_a_warning_with_the_feed_and_the_amplitude_that_serve() {
    for changes in [&[][..], &[(0, 0.5)], &[(0, 1.05)], &[(1_000, 0.3), (3_000, 0.0), (3_500, 1.0)]] {
        let (section, findings) = judged(SCARCE, &config(None, changes));
        assert_eq!(codes(&findings), ["VIB-CHIP-OVERRIDE"], "{changes:?}");
        assert!(section.chip.unwrap().broken);
        let found = &findings[0];
        assert_eq!(found.severity, Severity::Warning);
        assert!((value(found, "largest_feed_override") - 1.1).abs() < 1.1e-4);
        assert!((value(found, "largest_feed_per_rev") - 0.011).abs() < 1.1e-5);
        assert_eq!(value(found, "max_feed_override"), 1.5);
    }
    let (_, findings) = judged(SCARCE, &config(None, &[]));
    let cure = findings[0].suggestions[0].replacement.clone().expect("a word");
    assert_eq!(cure, "A0.0075");
    // Each cure cures; the smallest sufficient amplitude leaves no margin for the spindle's speed besides.
    let changed = SCARCE.replace("A0.0055", &cure);
    assert!(codes(&judged(&changed, &config(None, &[])).1).is_empty());
    assert_eq!(codes(&judged(&changed, &config(None, &[(0, 1.5)])).1), ["VIB-CHIP-MARGINAL"]);
    assert!(codes(&judged(SCARCE, &config(Some(1.5), &[])).1).is_empty());
    let mut limited = config(None, &[]);
    let limit = findings[0].suggestions.iter().filter_map(|cure| cure.value.as_ref());
    limited.profile.max_feed_override = limit.rev().find(|value| value.name == "max_feed_override").unwrap().value;
    assert!(codes(&judged(SCARCE, &limited).1).is_empty());
    // A machine that permits more than what is stated is judged at that.
    let mut fast = config(None, &[]);
    fast.profile.max_feed_override = 2.0;
    assert_eq!(value(&judged(SCARCE, &fast).1[0], "max_feed_override"), 2.0);
}

#[test]
fn a_change_within_a_section_counts_from_its_place_on() {
    let config = config(None, &[(20_000, 1.5)]);
    let (section, findings) = judged(SCARCE, &config);
    assert_eq!(codes(&findings), ["VIB-CHIP-UNBROKEN"]);
    let setpoints = run(SCARCE, &config);
    let start_mm = setpoints.path[(0..setpoints.len()).find(|&k| setpoints.line[k] == 4).unwrap()];
    let place_mm = setpoints.path[20_000] - start_mm;
    assert!((section.broken_share.unwrap() - place_mm / 10.0).abs() < 1e-4, "{:?} {place_mm}", section.broken_share);
    let spans: Vec<_> = section.chip_spans.iter().map(|span| (span.feed_override, span.broken)).collect();
    assert_eq!(spans, [(1.0, true), (1.5, false)]);
}

#[test]
fn constant_surface_speed_is_judged_at_the_override_too() {
    // From D = 2.5 to 2.58, with a margin of 1.06 there.
    let program = "G21 G96 S10 M3\nG0 X6.\nZ2.\nG200 F22.1 A0.0055\nG1 X6.2 Z-8. F0.01\nG201\nM30\n";
    let (section, findings) = judged(program, &config(None, &[]));
    assert_eq!((codes(&findings), section.broken_share), (vec!["VIB-CHIP-OVERRIDE"], Some(1.0)), "{section:#?}");
    let largest = value(&findings[0], "largest_feed_override");
    for (ratio, breaks) in [(largest - 0.001, true), (largest + 0.001, false)] {
        let (section, findings) = judged(program, &config(None, &[(0, ratio)]));
        assert_eq!(section.broken_share == Some(1.0), breaks, "{ratio}");
        assert_eq!(codes(&findings).contains(&"VIB-PARTLY-UNBROKEN"), !breaks, "{ratio}: {findings:#?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn the_report_and_the_plan_agree(
        changes in prop::collection::vec((300_u64..4_000, 0_u32..=20), 1..6),
        follows in any::<bool>(),
    ) {
        let mut index = 0;
        let mut overrides = Vec::new();
        for (pause, tenths) in changes {
            index += pause;
            overrides.push((index, f64::from(tenths) / 10.0));
        }
        overrides.push((index + 1_000, 0.9));
        let up_to = follows.then_some(1.3);
        let config = config(up_to, &overrides);
        let (section, findings) = judged(SCARCE, &config);
        let setpoints = run(SCARCE, &config);
        let section_rows = (0..setpoints.len()).filter(|&k| setpoints.line[k] == 4);
        let fastest_mm = section_rows.map(|k| setpoints.feed[k] / 1_000.0).fold(0.0, f64::max);
        let fastest = fastest_mm / 0.01;
        let margin = 1.1 * if follows { fastest.min(1.3) } else { 1.0 } / fastest;
        let chip = section.chip.unwrap();
        prop_assert!((chip.condition.feed_per_rev_mm - fastest_mm).abs() < 1e-6 || follows, "{:?}", chip.condition);
        prop_assert!(margin > 1.0 - 1e-6 || !chip.broken);
        prop_assert!(margin < 1.0 - 1e-3 || chip.broken, "{} {:?}", margin, chip.condition);
        let said = codes(&findings).contains(&"VIB-CHIP-UNBROKEN");
        prop_assert_eq!(said, !chip.broken);
    }
}
