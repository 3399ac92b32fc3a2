//! A word of one block may govern several sections: what replaces it cures all of them, or is not offered.

use std::fmt::Write;

use crate::common::cures::{configs, faults, has, lathe, replaced, the_finding};
use crate::common::validate;
use feedwave_cutting::{DriveModel, FollowingModel, ValidationReport};
use feedwave_program::{Finding, Severity};
use proptest::prelude::*;

fn replacements(finding: &Finding) -> Vec<&str> {
    finding.suggestions.iter().filter_map(|suggestion| suggestion.replacement.as_deref()).collect()
}

fn warnings(report: &ValidationReport) -> Vec<&str> {
    let grave = report.findings.iter().filter(|finding| finding.severity != Severity::Info);
    grave.map(|finding| finding.message.as_str()).collect()
}

#[test]
fn a_chip_is_cured_for_the_fastest_cut_of_its_block() {
    let program = "G21 G18 G99 G97 S1000 M3\nG0 X30. Z2.\nG200 F50. A0.03\nG1 Z-20. F0.05\nG0 X32.\nG0 Z2.\nX28.\nG1 Z-20. F0.12\n\
                   G201\nG0 X32. Z2.\nM30\n";
    let config = lathe(&[]);
    let report = validate(program, &config);
    let finding = the_finding(&report, "VIB-CHIP-UNBROKEN");
    assert_eq!(finding.occurrences, 2);
    let words = replacements(finding);
    // A/2·|sin πD| of the faster cut, up to the largest override; the slower one needs A0.0376.
    assert_eq!(words.first(), Some(&"F41.667 A0.0901"), "{finding:#?}");
    for word in &words {
        assert_eq!(warnings(&validate(&replaced(program, finding, word), &config)), [""; 0], "{word}");
    }
}

#[test]
fn a_chip_is_cured_for_every_round_of_a_loop_that_its_block_is_in() {
    let program = "G21 G18 G99 G97 S1000 M3\n#1=0.05\nWHILE[#1 LT 0.13]DO1\nG0 X30. Z2.\nG200 F50. A0.03\nG1 Z-20. F#1\nG201\n#1=#1+0.07\nEND1\n\
                   M30\n";
    let config = lathe(&[]);
    let report = validate(program, &config);
    let finding = the_finding(&report, "VIB-CHIP-UNBROKEN");
    assert_eq!(replacements(finding).first(), Some(&"F41.667 A0.0901"), "{finding:#?}");
    assert_eq!(faults(program, &config).1, [""; 0]);
}

#[test]
fn of_words_that_are_computed_no_other_is_replaced() {
    let program = "G21 G18 G99 G97 S1000 M3\n#1=50\nWHILE[#1 LT 70]DO1\nG0 X30. Z2.\nG200 F#1 A0.03\nG1 Z-20. F0.05\nG201\n#1=#1+16.667\nEND1\n\
                   M30\n";
    let report = validate(program, &lathe(&[]));
    let finding = the_finding(&report, "VIB-CHIP-UNBROKEN");
    assert_eq!(replacements(finding), [""; 0], "{finding:#?}");
}

#[test]
fn blocks_cure_their_own_sections_only() {
    let one = |feed: &str| format!("G0 X30. Z2.\nG200 F50. A0.03\nG1 Z-20. {feed}\nG201\n");
    let program = format!("G21 G18 G99 G97 S1000 M3\n{}{}M30\n", one("F0.05"), one("F0.12"));
    let report = validate(&program, &lathe(&[]));
    let found = report.findings.iter().filter(|finding| finding.code == "VIB-CHIP-UNBROKEN");
    let first: Vec<_> = found.map(|finding| replacements(finding)[0]).collect();
    assert_eq!(first, ["F41.667 A0.0376", "F41.667 A0.0901"]);
}

#[test]
fn what_an_axis_of_another_section_could_not_follow_is_not_offered() {
    let one = |feed: &str| format!("G0 X30. Z2.\nG1 W-8. {feed}\n");
    let alone = format!("G99 G97 S1200 M3\nG200 F60. A0.012\n{}G201\nM30\n", one("F0.03"));
    let sharp = "G0 X30. Z2.\nG3 U0.2 W-0.1 R0.1 F0.03\n";
    let both = alone.replace("G201", &format!("{sharp}G201"));
    let config = lathe(&[]);
    let report = validate(&alone, &config);
    assert!(!replacements(the_finding(&report, "VIB-CHIP-UNBROKEN")).is_empty());
    let (_, faults) = faults(&both, &config);
    assert_eq!(faults, [""; 0]);
}

#[test]
fn sections_beyond_what_is_kept_are_cured_in_words_alone() {
    let mut program = "G21 G18 G99 G97 S1000 M3\nG0 X30. Z2.\nG200 F50. A0.03\n".to_owned();
    for index in 0..80 {
        writeln!(program, "S{}\nG0 Z2.\nG1 Z1. F{:.3}", 1_000 + index, 0.05 + 1e-3 * f64::from(index)).unwrap();
    }
    program.push_str("G201\nM30\n");
    let report = validate(&program, &lathe(&[]));
    let chips = report.findings.iter().filter(|finding| finding.code.name().starts_with("VIB-CHIP"));
    for finding in chips {
        assert_eq!(replacements(finding), [""; 0], "{finding:#?}");
    }
    assert!(has(&report, "VIB-CHIP-UNBROKEN"));
}

#[test]
fn an_amplitude_of_a_thread_that_several_passes_are_cut_with_is_not_replaced() {
    let cut = "G0 X#1\nG32 Z-20 F2 A0.3\nG0 X14\nG0 Z5\n";
    let once = |body: &str| format!("G99 G97 M3 S300\n#1=9.\nG165 P3 X10 Q1.2\nG0 X14 Z5\n{body}G165 P0\nM30\n");
    let config = lathe(&[]);
    let alone = validate(&once(cut), &config);
    let word = |report: &ValidationReport| {
        let found = report.findings.iter().filter(|finding| finding.code.name().starts_with("THREAD-"));
        found.filter(|finding| !replacements(finding).is_empty()).count()
    };
    assert!(word(&alone) > 0, "{:#?}", alone.findings);
    let looped = validate(&once(&format!("WHILE[#1 GT 8.]DO1\n{cut}#1=#1-0.3\nEND1\n")), &config);
    assert!(looped.findings.iter().any(|finding| finding.code.name().starts_with("THREAD-AMPLITUDE")), "{looped:#?}");
    assert_eq!(word(&looped), 0, "{:#?}", looped.findings);
}

/// A program with one block that switches the vibration on, and several sections.
#[derive(Clone, Debug)]
struct Program {
    inch: bool,
    per_minute: bool,
    frequency_hz: f64,
    amplitude_mm: f64,
    sections: Vec<Section>,
}

#[derive(Clone, Debug)]
struct Section {
    diameter_mm: f64,
    /// Constant, rev/min, or at the surface, m/min.
    spindle: (bool, f64),
    /// Kind, length, mm, and feed, mm/rev.
    blocks: Vec<(u8, f64, f64)>,
}

impl Program {
    fn text(&self) -> String {
        let unit = if self.inch { 25.4 } else { 1.0 };
        let per = if self.per_minute { "G98" } else { "G99" };
        let mut text = format!("{} G18 {per}\nG50 S4000\nM3 S1000\n", if self.inch { "G20" } else { "G21" });
        for (index, section) in self.sections.iter().enumerate() {
            let (is_surface, speed) = section.spindle;
            let (code, speed) = if is_surface { ("G96", (0.1 * speed).round()) } else { ("G97", speed) };
            writeln!(text, "G0 X{:.6} Z{:.6}", section.diameter_mm / unit, 2.0 / unit).unwrap();
            writeln!(text, "{code} S{speed}").unwrap();
            if index == 0 {
                writeln!(text, "G200 F{} A{:.9}", self.frequency_hz, self.amplitude_mm / unit).unwrap();
            }
            for (kind, length_mm, feed_mm) in &section.blocks {
                let feed = if self.per_minute { feed_mm * 1_000.0 } else { *feed_mm } / unit;
                let length = length_mm / unit;
                match kind {
                    0 | 1 => writeln!(text, "G1 W-{length:.6} F{feed:.9}"),
                    2 => writeln!(text, "G1 U{:.6} W-{length:.6} F{feed:.9}", 0.3 * length),
                    3 => writeln!(text, "G3 U{:.6} W-{length:.6} R{length:.6} F{feed:.9}", 2.0 * length),
                    _ => writeln!(text, "G1 U{:.6} F{feed:.9}", 2.0 * length),
                }
                .unwrap();
            }
        }
        text.push_str("G201\nM30\n");
        text
    }
}

/// Drives of all axes; none stated in most cases.
fn drives() -> impl Strategy<Value = DriveModel> {
    let gain =
        (30.0..400.0_f64).prop_map(|gain| DriveModel { position_loop_gain_per_s: Some(gain), ..DriveModel::default() });
    let filter =
        (0.002..0.03_f64).prop_map(|length| DriveModel { filter_length_s: Some(length), ..DriveModel::default() });
    prop_oneof![3 => Just(DriveModel::default()), 1 => gain, 1 => filter]
}

fn programs() -> impl Strategy<Value = Program> {
    let decade = |from: f64, to: f64| (from.ln()..to.ln()).prop_map(|value: f64| (1e4 * value.exp()).round() / 1e4);
    let frequency =
        prop_oneof![(8..160_u32).prop_map(f64::from), (8.0..160.0_f64).prop_map(|hz| (1e3 * hz).round() / 1e3)];
    let blocks = prop::collection::vec((0..5_u8, decade(0.5, 12.0), decade(0.005, 0.2)), 1..4);
    let speeds = prop_oneof![3 => Just(1_200.0), 1 => (300..5_000_u32).prop_map(f64::from)];
    let spindle = (prop::bool::weighted(0.1), speeds);
    let section = (20.0..60.0_f64, spindle, blocks).prop_map(|(diameter_mm, spindle, blocks)| Section {
        diameter_mm: (1e3 * diameter_mm).round() / 1e3,
        spindle,
        blocks,
    });
    let switches = (prop::bool::weighted(0.2), prop::bool::weighted(0.2));
    (switches, frequency, decade(0.003, 0.2), prop::collection::vec(section, 2..4)).prop_map(
        |((inch, per_minute), frequency_hz, amplitude_mm, sections)| Program {
            inch,
            per_minute,
            frequency_hz,
            amplitude_mm,
            sections,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn a_replacement_ends_its_finding_in_all_sections_and_makes_no_error(
        program in programs(),
        mut config in configs(),
        common in drives(),
    ) {
        config.profile.following = FollowingModel { common, axes: Vec::new() };
        let (_, faults) = faults(&program.text(), &config);
        prop_assert!(faults.is_empty(), "{}", faults.join("\n"));
    }
}
