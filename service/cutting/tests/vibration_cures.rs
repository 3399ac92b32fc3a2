//! Every cure of a vibration cures: applied, the finding is gone, and nothing is refused for it.

use std::fmt::Write;

use crate::common::cures::{configs, errors, faults, has, lathe, replaced, the_finding, value};
use crate::common::validate;
use feedwave_cutting::{DriveModel, FollowingModel, PipelineConfig, ValidationReport};
use feedwave_program::Severity;
use proptest::prelude::*;

fn section(switch: &str, feed: &str, speed: u32) -> String {
    format!("M3 S{speed}\nG0 X30 Z1\n{switch}\nG1 Z-6 {feed}\nG201\nM30\n")
}

#[test]
fn a_frequency_is_offered_with_the_amplitude_that_it_needs_as_written() {
    let program = section("G200 F50 A0.01", "F0.02", 1_000);
    let config = lathe(&[]);
    let report = validate(&program, &config);
    let finding = the_finding(&report, "VIB-CHIP-UNBROKEN");
    // At 41.667 Hz instead of 41.66666… and up to the largest feed override.
    let first = &finding.suggestions[0];
    assert_eq!(first.replacement.as_deref(), Some("F41.667 A0.0151"), "{finding:#?}");
    assert_eq!(value(first, "frequency"), Some(41.667));
    assert_eq!(faults(&program, &config), (2, vec![]));
}

#[test]
fn an_amplitude_that_the_axes_could_not_follow_is_not_offered_but_explained() {
    let program = section("G200 F75 A0.05", "F0.12", 540);
    let config = lathe(&[]);
    let report = validate(&program, &config);
    let finding = the_finding(&report, "VIB-CHIP-UNBROKEN");
    let amplitudes = finding.suggestions.iter().filter_map(|suggestion| value(suggestion, "amplitude"));
    assert_eq!(amplitudes.count(), 0, "{finding:#?}");
    assert!(finding.message.contains("; an amplitude of 0.1"), "{}", finding.message);
    assert!(finding.message.contains("the Z axis' acceleration would have to be"), "{}", finding.message);
    assert_eq!(faults(&program, &config).1, [""; 0]);
}

/// At 62.5 Hz the axes follow 0.06 mm or so: enough for a thin chip only.
#[test]
fn an_amplitude_that_the_axes_follow_says_where_it_breaks_no_chip() {
    let config = lathe(&[]);
    let cures = |feed: &str| {
        let report = validate(&section("G200 F62.5 A0.1", feed, 1_500), &config);
        let finding = the_finding(&report, "VIB-AXIS-ACCELERATION").clone();
        let named =
            |name: &str| finding.suggestions.iter().find(|suggestion| value(suggestion, name).is_some()).cloned();
        (named("amplitude").expect("an amplitude"), named("frequency").expect("a frequency"))
    };
    let (amplitude, frequency) = cures("F0.15");
    let but = ", but the chip would not break in line 4 at a feed override of 150 %";
    assert!(amplitude.message.ends_with(but), "{amplitude:?}");
    let (program, word) = (section("G200 F62.5 A0.1", "F0.15", 1_500), amplitude.replacement.expect("a word"));
    let after = validate(&program.replace("A0.1", &word), &config);
    assert!(after.findings.iter().any(|finding| finding.code.name().starts_with("VIB-CHIP")), "it is so");
    // The highest frequency has hardly more than two vibrations per revolution.
    assert!(frequency.message.ends_with(but), "{frequency:?}");
    let (amplitude, _) = cures("F0.01");
    assert!(!amplitude.message.contains("but"), "{amplitude:?}");
}

#[test]
fn ranges_of_the_machine_are_kept_by_what_is_offered() {
    let config = lathe(&[]);
    let largest = config.profile.machine.max_spindle_rev_per_min;
    let mut offered = 0;
    for (frequency, speed) in [(100, 3_000), (125, 3_750), (150, 4_500), (490, 3_675), (80, 4_800)] {
        let program = section(&format!("G200 F{frequency} A0.003"), "F0.003", speed);
        let report = validate(&program, &config);
        let finding = the_finding(&report, "VIB-CHIP-UNBROKEN");
        for suggestion in &finding.suggestions {
            offered += 1;
            assert!(value(suggestion, "spindle_speed").is_none_or(|speed| speed <= largest), "{finding:#?}");
            assert!(value(suggestion, "frequency").is_none_or(|hz| hz <= 500.0), "{finding:#?}");
        }
    }
    assert!(offered > 5, "{offered}");
}

#[test]
fn a_spindle_speed_names_the_amplitude_that_a_feed_per_minute_needs_there() {
    let program = section("G200 F30 A0.02", "F30", 1_000).replace("M3", "G98\nM3");
    let config = lathe(&[(0, 1.0)]);
    let report = validate(&program, &config);
    let finding = the_finding(&report, "VIB-CHIP-UNBROKEN");
    let cure = finding.suggestions.iter().find(|suggestion| value(suggestion, "spindle_speed") == Some(720.0));
    let cure = cure.unwrap_or_else(|| panic!("{finding:#?}"));
    let also = cure.message.split("write ").nth(1).and_then(|rest| rest.split(' ').next());
    let also = also.unwrap_or_else(|| panic!("{}", cure.message));
    let cured = program.replace("S1000", "S720").replace("A0.02", also);
    let after = validate(&cured, &config);
    assert!(!has(&after, "VIB-CHIP-UNBROKEN") && !has(&after, "VIB-CHIP-OVERRIDE"), "{:#?}", after.findings);
}

#[test]
fn at_constant_surface_speed_no_other_speed_is_offered() {
    let program = "G50 S2000\nG96 S150 M3\nG0 X40 Z2\nG200 F60 A0.05\nG1 X20 Z-20 F0.12\nG201\nM30\n";
    let report = validate(program, &lathe(&[]));
    let said = format!("{:?}", the_finding(&report, "VIB-CHIP-UNBROKEN"));
    // It was said that the section had too many blocks.
    assert!(said.contains("at constant surface speed (G96) the spindle has no speed of its own"), "{said}");
    assert!(!said.contains("too many"), "{said}");
}

#[test]
fn the_feed_that_is_offered_serves_at_the_largest_permitted_override() {
    let program = |feed: f64| section("G200 F30 A0.02", &format!("F{feed}"), 1_000).replace("M3", "G98\nM3");
    let config = lathe(&[(0, 0.3)]);
    let report = validate(&program(30.0), &config);
    let finding = the_finding(&report, "VIB-CHIP-OVERRIDE");
    let ratio = finding.suggestions.iter().find_map(|suggestion| value(suggestion, "feed_ratio")).unwrap();
    assert!((ratio - 0.7837 / 1.5).abs() < 2e-4, "{ratio}");
    assert!(finding.suggestions.iter().any(|suggestion| suggestion.message.contains("52.2")), "{finding:#?}");
    assert!(!has(&validate(&program(30.0 * ratio), &config), "VIB-CHIP-OVERRIDE"));
}

#[test]
fn of_blocks_that_never_break_the_chip_the_fastest_counts() {
    let mut program = "G98\nM3 S1000\nG0 X30 Z1\nG200 F50 A0.008\n".to_owned();
    for feed in 11..30 {
        writeln!(program, "G1 Z-{} F{feed}", feed - 10).unwrap();
    }
    program.push_str("G201\nM30\n");
    let config = lathe(&[]);
    let report = validate(&program, &config);
    let finding = the_finding(&report, "VIB-CHIP-UNBROKEN");
    let feed = finding.values.iter().find(|value| value.name == "feed_per_rev").unwrap();
    assert!((feed.value - 0.029).abs() < 1e-12, "{finding:#?}");
    assert!(finding.message.contains("line 23"), "{}", finding.message);
    let (count, faults) = faults(&program, &config);
    assert!(count > 0);
    assert_eq!(faults, [""; 0]);
}

#[test]
fn an_amplitude_is_enough_up_to_the_override_that_is_named() {
    let config = lathe(&[(0, 2.0)]);
    let program = section("G200 F41.667 A0.03", "F0.05", 1_000);
    let report = validate(&program, &config);
    let finding = the_finding(&report, "VIB-CHIP-UNBROKEN");
    let cure = finding.suggestions.iter().find(|suggestion| value(suggestion, "amplitude").is_some()).unwrap();
    assert!(cure.message.contains("enough up to a feed override of 200 %"), "{}", cure.message);
    assert_eq!(faults(&program, &config).1, [""; 0]);
}

#[test]
fn ratios_are_ratios() {
    for (program, overrides) in [
        (section("G200 F41.667 A0.03", "F0.05", 1_000), vec![(0, 1.5)]),
        (section("G200 F41.667 A0.03", "F0.05", 1_000), vec![]),
        (section("G200 F30 A0.02", "F30", 1_000).replace("M3", "G98\nM3"), vec![(0, 0.3)]),
    ] {
        let report = validate(&program, &lathe(&overrides));
        let suggested = report.findings.iter().flat_map(|finding| &finding.suggestions);
        let values = report.findings.iter().flat_map(|finding| &finding.values);
        let values = values.chain(suggested.filter_map(|suggestion| suggestion.value.as_ref()));
        let mut ratios = 0;
        for value in values {
            assert_ne!(value.unit, "%", "{value:?}");
            if value.name.ends_with("override") || value.name == "feed_ratio" {
                ratios += 1;
                assert!(value.unit.is_empty() && value.value <= 2.0, "{value:?}");
            }
        }
        assert!(ratios > 0, "{:#?}", report.findings);
    }
}

/// A section of a random program.
#[derive(Clone, Debug)]
struct Section {
    inch: bool,
    per_minute: bool,
    surface_speed: bool,
    spindle: f64,
    frequency_hz: f64,
    amplitude_mm: f64,
    /// The feed along each block, mm/rev.
    blocks: Vec<(u8, f64)>,
}

impl Section {
    fn program(&self) -> String {
        let unit = if self.inch { 25.4 } else { 1.0 };
        let mut text = if self.inch { "G20 " } else { "G21 " }.to_owned();
        text.push_str(if self.per_minute { "G98\n" } else { "G99\n" });
        if self.surface_speed {
            writeln!(text, "G50 S4000\nG96 S{} M3", (0.1 * self.spindle).round()).unwrap();
        } else {
            writeln!(text, "G97 S{} M3", self.spindle).unwrap();
        }
        writeln!(text, "G0 X{:.6} Z{:.6}", 40.0 / unit, 2.0 / unit).unwrap();
        writeln!(text, "G200 F{} A{:.9}", self.frequency_hz, self.amplitude_mm / unit).unwrap();
        for (kind, feed_mm) in &self.blocks {
            let feed = if self.per_minute { feed_mm * self.spindle.min(4_000.0) } else { *feed_mm } / unit;
            let [two, four] = [2.0 / unit, 4.0 / unit];
            match kind {
                0 => writeln!(text, "G1 W-{two:.6} F{feed:.9}"),
                1 => writeln!(text, "G1 U{four:.6} W-{two:.6} F{feed:.9}"),
                2 => writeln!(text, "G3 U{four:.6} W-{two:.6} R{two:.6} F{feed:.9}"),
                _ => writeln!(text, "G1 U{four:.6} F{feed:.9}"),
            }
            .unwrap();
        }
        text.push_str("G201\nM30\n");
        text
    }
}

fn sections() -> impl Strategy<Value = Section> {
    let decade = |from: f64, to: f64| (from.ln()..to.ln()).prop_map(|value: f64| (1e4 * value.exp()).round() / 1e4);
    let whole = |range: std::ops::Range<f64>| range.prop_map(f64::round);
    let switches = (prop::bool::weighted(0.2), any::<bool>(), prop::bool::weighted(0.1));
    let frequency = prop_oneof![whole(8.0..160.0), (8.0..160.0_f64).prop_map(|hz| (1e3 * hz).round() / 1e3)];
    let spindle = prop_oneof![whole(300.0..5_000.0), (3..50_u32).prop_map(|hundreds| 100.0 * f64::from(hundreds))];
    let blocks = prop::collection::vec((0..4_u8, decade(0.005, 0.2)), 1..5);
    (switches, spindle, frequency, decade(0.003, 0.3), blocks).prop_map(
        |((inch, per_minute, surface_speed), spindle, frequency_hz, amplitude_mm, blocks)| Section {
            inch,
            per_minute,
            surface_speed,
            spindle,
            frequency_hz,
            amplitude_mm,
            blocks,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn a_replacement_ends_its_finding_and_makes_no_error(section in sections(), config in configs()) {
        let (_, faults) = faults(&section.program(), &config);
        prop_assert!(faults.is_empty(), "{}", faults.join("\n"));
    }

    #[test]
    fn other_cures_of_a_chip_end_its_finding_too(section in sections(), config in configs()) {
        let report = validate(&section.program(), &config);
        let chips = ["VIB-CHIP-UNBROKEN", "VIB-CHIP-OVERRIDE"];
        for finding in report.findings.iter().filter(|finding| chips.contains(&finding.code.name())) {
            for cure in &finding.suggestions {
                let (mut changed, mut config) = (section.clone(), config.clone());
                if let Some(speed) = value(cure, "spindle_speed") {
                    changed.spindle = speed;
                    if changed.per_minute {
                        // The feed that is written stays.
                        let ratio = section.spindle.min(4_000.0) / speed.min(4_000.0);
                        changed.blocks.iter_mut().for_each(|(_, feed_mm)| *feed_mm *= ratio);
                    }
                } else if let Some(hz) = value(cure, "frequency") {
                    changed.frequency_hz = hz;
                } else if let Some(amplitude_mm) = value(cure, "amplitude") {
                    changed.amplitude_mm = amplitude_mm;
                } else if let Some(ratio) = value(cure, "feed_ratio") {
                    changed.blocks.iter_mut().for_each(|(_, feed_mm)| *feed_mm *= ratio * (1.0 - 1e-3));
                } else if let Some(largest) = value(cure, "max_feed_override") {
                    config.profile.max_feed_override = largest;
                    config.overrides.iter_mut().for_each(|change| change.ratio = change.ratio.min(largest));
                } else {
                    config.profile.vibration.amplitude_follows_feed_up_to = Some(config.profile.max_feed_override);
                }
                let also = cure.message.split("write A").nth(1).and_then(|rest| rest.split(' ').next());
                if let Some(word) = also {
                    let unit = if section.inch { 25.4 } else { 1.0 };
                    changed.amplitude_mm = word.parse::<f64>().unwrap() * unit;
                }
                let after = validate(&changed.program(), &config);
                let new = errors(&after).into_iter().find(|code| !errors(&report).contains(code));
                prop_assert!(
                    !has(&after, finding.code.name()) && new.is_none(),
                    "{}\nof {}\n{}\n->\n{}\n{:#?}",
                    cure.message, finding.message, section.program(), changed.program(), after.findings
                );
            }
        }
    }
}

/// A lathe whose axes all have one drive.
fn driven(drive: DriveModel) -> PipelineConfig {
    let mut config = lathe(&[]);
    config.profile.following = FollowingModel { common: drive, axes: Vec::new() };
    config
}

fn warnings(report: &ValidationReport, prefix: &str) -> Vec<String> {
    let found = report.findings.iter().filter(|finding| finding.severity != Severity::Info);
    found.filter(|finding| finding.code.name().starts_with(prefix)).map(|finding| finding.message.clone()).collect()
}

#[test]
fn what_the_drives_lose_is_commanded_once_and_for_all() {
    // A moving average of 20 ms passes a quarter of 30 Hz: the chip that 0.03 mm breaks stays whole.
    let filtered = driven(DriveModel { filter_length_s: Some(0.025), ..DriveModel::default() });
    let lazy = driven(DriveModel { position_loop_gain_per_s: Some(60.0), ..DriveModel::default() });
    let mut cured = 0;
    for config in [&filtered, &lazy] {
        for (switch, feed) in
            [("G200 F25 A0.03", "F0.02"), ("G200 F58.333 A0.012", "F0.01"), ("G200 F42 A0.02", "F0.02")]
        {
            let program = section(switch, feed, 1_000);
            let report = validate(&program, config);
            let Some(finding) = report.findings.iter().find(|it| it.code == "VIB-FOLLOWING-LOSS") else { continue };
            if finding.severity == Severity::Info {
                continue;
            }
            let replacement = finding.suggestions.iter().find_map(|suggestion| suggestion.replacement.as_deref());
            let replacement = replacement.unwrap_or_else(|| panic!("{finding:#?}"));
            let after = validate(&replaced(&program, finding, replacement), config);
            assert_eq!(warnings(&after, "VIB-"), [] as [&str; 0], "{switch} -> {replacement}: {}", finding.message);
            cured += 1;
        }
    }
    assert!(cured >= 3, "{cured}");
}

#[test]
fn a_loss_that_leaves_the_chip_broken_ends_with_the_frequency_that_is_named() {
    let lazy = driven(DriveModel { position_loop_gain_per_s: Some(300.0), ..DriveModel::default() });
    let program = section("G200 F41.667 A0.06", "F0.02", 1_000);
    let report = validate(&program, &lazy);
    let finding = the_finding(&report, "VIB-FOLLOWING-LOSS");
    assert_eq!(finding.severity, Severity::Info);
    let replacement = finding.suggestions[0].replacement.as_deref().expect("a frequency");
    let after = validate(&replaced(&program, finding, replacement), &lazy);
    assert!(after.findings.iter().all(|it| it.code != "VIB-FOLLOWING-LOSS"), "{replacement}: {:#?}", after.findings);
    assert_eq!(warnings(&after, "VIB-"), [] as [&str; 0]);
}

#[test]
fn a_cured_chip_breaks_with_what_the_drives_let_through() {
    let lazy = driven(DriveModel { position_loop_gain_per_s: Some(60.0), ..DriveModel::default() });
    let program = section("G200 F25 A0.008", "F0.02", 1_000);
    let report = validate(&program, &lazy);
    let finding = the_finding(&report, "VIB-CHIP-UNBROKEN");
    let replacement = finding.suggestions.iter().find_map(|suggestion| suggestion.replacement.as_deref());
    let after = validate(&replaced(&program, finding, replacement.expect("a cure")), &lazy);
    assert_eq!(warnings(&after, "VIB-"), [] as [&str; 0], "{finding:#?}");
}

#[test]
fn a_resonance_is_no_warning_where_the_machine_permits_what_arrives() {
    let resonant = DriveModel {
        position_loop_gain_per_s: Some(200.0),
        velocity_loop_frequency_hz: Some(25.0),
        ..DriveModel::default()
    };
    let mut config = driven(resonant);
    let program = section("G200 F25 A0.05", "F0.02", 1_000);
    let report = validate(&program, &config);
    assert_eq!(the_finding(&report, "VIB-FOLLOWING-EXCESS").severity, Severity::Info);
    assert_eq!(warnings(&report, "VIB-"), [] as [&str; 0]);
    config.profile.vibration.max_amplitude_mm = 0.052;
    let report = validate(&program, &config);
    let finding = the_finding(&report, "VIB-FOLLOWING-EXCESS");
    assert_eq!(finding.severity, Severity::Warning);
    let replacement = finding.suggestions[0].replacement.as_deref().expect("an amplitude");
    let after = validate(&replaced(&program, finding, replacement), &config);
    assert_eq!(warnings(&after, "VIB-"), [] as [&str; 0]);
}

/// A thread of three passes with amplitudes of their own, as diameters.
fn thread(amplitudes: [&str; 3], speed: &str) -> String {
    let [first, second, third] = amplitudes;
    format!(
        "M3 S{speed}\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9\nG32 Z60 F2.5{first}\nG0 X14\nG0 Z100\nG0 X8.4\nG32 Z60 F2.5{second}\n\
         G0 X14\nG0 Z100\nG0 X8.2\nG32 Z60 F2.5{third}\nG0 X14\nG165 P0\nM30\n"
    )
}

#[test]
fn a_thread_that_the_drives_leave_whole_breaks_with_the_amplitudes_that_are_named() {
    let mut config = driven(DriveModel { position_loop_gain_per_s: Some(30.0), ..DriveModel::default() });
    for axis in &mut config.profile.machine.axes {
        axis.max_jerk_per_s3 = 1e9;
        axis.max_acceleration_per_s2 = 1e6;
    }
    let mut program = thread([" A1.2", " A0.75", " A0.3"], "300");
    let mut steps = 0;
    loop {
        let report = validate(&program, &config);
        let lost = report
            .findings
            .iter()
            .find(|finding| finding.code == "THREAD-FOLLOWING-LOSS" && finding.severity == Severity::Warning);
        let Some(finding) = lost else { break };
        let (suggestion, word) = finding
            .suggestions
            .iter()
            .find_map(|suggestion| Some((suggestion, suggestion.replacement.as_deref()?)))
            .unwrap_or_else(|| panic!("{finding:#?}"));
        // The word is a diameter, and what is named beside it on the radius.
        let written: f64 = word.strip_prefix('A').expect("a word").parse().expect("a number");
        assert!((0.5 * written - value(suggestion, "amplitude").expect("mm")).abs() < 1e-9, "{suggestion:?}");
        assert!(suggestion.message.contains(&format!("({word})")), "{suggestion:?}");
        program = replaced(&program, finding, word);
        steps += 1;
        assert!(steps <= 3, "one for each pass is enough: {finding:#?}");
    }
    assert!(steps > 0);
    // By the ratio for all passes, and by a slower spindle, at once.
    let by_ratio = thread(["", "", " A0.0"], "300");
    let finding = the_finding(&validate(&by_ratio, &config), "THREAD-FOLLOWING-LOSS").clone();
    let cure = |name: &str| finding.suggestions.iter().find_map(|suggestion| value(suggestion, name));
    let ratio = cure("ratio").unwrap_or_else(|| panic!("{finding:#?}"));
    let speed = cure("spindle_speed").unwrap_or_else(|| panic!("{finding:#?}"));
    for changed in [by_ratio.replace("Q1.2", &format!("Q{ratio}")), by_ratio.replace("S300", &format!("S{speed}"))] {
        let after = validate(&changed, &config);
        assert_eq!(warnings(&after, "THREAD-FOLLOWING"), [] as [&str; 0], "{changed}");
    }
}

#[test]
fn a_thread_that_is_cut_too_deep_is_not_so_at_the_speed_that_is_named() {
    let resonant = DriveModel {
        position_loop_gain_per_s: Some(100.0),
        velocity_loop_frequency_hz: Some(10.0),
        ..DriveModel::default()
    };
    let config = driven(resonant);
    let program = thread([" A0.4", " A0.3", " A0.0"], "300").replace("X9\n", "X9.7\n");
    let finding = the_finding(&validate(&program, &config), "THREAD-FOLLOWING-DEEP").clone();
    let speed = finding.suggestions.iter().find_map(|suggestion| value(suggestion, "spindle_speed"));
    let speed = speed.unwrap_or_else(|| panic!("{finding:#?}"));
    let after = validate(&program.replace("S300", &format!("S{speed}")), &config);
    assert_eq!(warnings(&after, "THREAD-FOLLOWING"), [] as [&str; 0]);
}
