//! Whether a report says that the axes can follow a vibration, and with which numbers it says that they cannot.

use crate::common::machines::{config_of, kinds};
use crate::common::validate;
use feedwave_cutting::{
    AxisLoadReport, MachineProfile, PipelineConfig, SectionReport, ValidationReport, VibrationEnvelope,
};
use feedwave_program::{Finding, Severity};

/// 45 Hz and 0.1 mm: the sine itself asks for 8 m/s² of the generic lathe, whose axes follow 10; its steps for 30.
const TURNED: &str = "M3 S970\nG0 X40 Z1\nG200 F45 A0.1\nG1 Z-6 F0.1\nG201\nM30\n";

fn published(bind: bool) -> PipelineConfig {
    let mut config = PipelineConfig::new(MachineProfile::lathe());
    config.profile.vibration.published_limits_bind = bind;
    PipelineConfig { vibration_envelope: VibrationEnvelope::Published, ..config }
}

fn the_finding<'a>(report: &'a ValidationReport, code: &str) -> &'a Finding {
    let found = report.findings.iter().find(|finding| finding.code == code);
    found.unwrap_or_else(|| panic!("no {code}: {:#?}", report.findings))
}

fn value<'a>(finding: &'a Finding, name: &str) -> (f64, &'a str) {
    let value = finding.values.iter().find(|value| value.name == name);
    value.map(|value| (value.value, value.unit.as_ref())).unwrap_or_else(|| panic!("no {name} in {finding:#?}"))
}

fn axis<'a>(section: &'a SectionReport, name: &str) -> &'a AxisLoadReport {
    section.axes.iter().find(|axis| axis.axis == name).expect("the axis moves")
}

/// Acceleration, its limit and the utilisation of an axis.
fn row(section: &SectionReport, name: &str) -> (f64, f64, f64) {
    let axis = axis(section, name);
    (axis.acceleration_per_s2, axis.max_acceleration_per_s2, axis.utilisation)
}

#[test]
fn steps_that_no_axis_follows_are_in_its_row_and_in_the_verdict_whether_they_bind_or_not() {
    for bind in [false, true] {
        let report = validate(TURNED, &published(bind));
        assert_eq!(report.is_accepted(), !bind);
        let section = &report.sections[0];
        let finding = the_finding(&report, "VIB-PUBLISHED-ENDS");
        let (demanded, limit, _) = row(section, "Z");
        assert!(demanded > 29_000.0 && limit == 10_000.0, "{demanded} of {limit}");
        let axis = axis(section, "Z");
        // Of the limits that of jerk is exceeded most.
        let jerk = (axis.jerk_per_s3, axis.max_jerk_per_s3);
        assert_eq!((value(finding, "demanded"), value(finding, "limit")), ((jerk.0, "mm/s³"), (jerk.1, "mm/s³")));
        assert!(jerk.0 > 29e6 && jerk.1 == 5e6, "{jerk:?}");
        assert_eq!(axis.utilisation, jerk.0 / jerk.1);
        assert!(!section.feasible);
    }
    // Where the axis follows the jerk of the steps, their acceleration decides.
    let mut config = published(true);
    config.profile.machine.axes.iter_mut().for_each(|axis| axis.max_jerk_per_s3 = 35e6);
    let report = validate(TURNED, &config);
    assert!(!report.is_accepted());
    let (demanded, limit, utilisation) = row(&report.sections[0], "Z");
    let finding = the_finding(&report, "VIB-PUBLISHED-ENDS");
    assert_eq!((value(finding, "demanded"), value(finding, "limit")), ((demanded, "mm/s²"), (limit, "mm/s²")));
    assert_eq!(utilisation, demanded / limit);
    // Where the axis follows the steps too, it can follow.
    for axis in &mut config.profile.machine.axes {
        axis.max_acceleration_per_s2 = 31_000.0;
    }
    let report = validate(TURNED, &config);
    let section = &report.sections[0];
    assert!(report.is_accepted() && section.feasible, "{:#?}", report.findings);
    assert!(row(section, "Z").2 > 0.9 && row(section, "Z").2 < 1.0);
}

#[test]
fn a_blended_vibration_on_a_line_is_judged_as_before() {
    let report = validate(TURNED, &PipelineConfig::new(MachineProfile::lathe()));
    let (demanded, limit, utilisation) = row(&report.sections[0], "Z");
    assert!(report.sections[0].feasible && (utilisation - demanded / limit).abs() < 1e-12);
    assert!(demanded > 7_990.0 && demanded < 8_300.0 && limit == 10_000.0, "{demanded} of {limit}");
}

#[test]
fn what_a_curve_leaves_of_a_limit_is_the_limit_in_the_row_and_the_refusal_says_every_number() {
    let program = |amplitude: f64| {
        format!(
            "M3 S1200\nG0 X20 Z1\nG200 F70 A{amplitude}\nG1 Z-1 F0.05\nX24 Z-4\nG2 X30 Z-7 R3\nG1 X34\nZ-8\nG201\nM30\n"
        )
    };
    let config = PipelineConfig::new(MachineProfile::lathe());
    let check = |amplitude: f64, expected: std::ops::Range<f64>| {
        let report = validate(&program(amplitude), &config);
        let finding = the_finding(&report, "VIB-AXIS-ACCELERATION");
        assert_eq!(finding.severity, Severity::Error);
        let [demanded, limit, permitted, of_axis] =
            ["demanded", "limit", "permitted", "axis_limit"].map(|name| value(finding, name).0);
        // An arc leaves three fifths along it, and a fiftieth of that is the feed's.
        assert!(expected.contains(&demanded) && (limit, of_axis) == (6_000.0, 10_000.0), "{finding:#?}");
        assert!((permitted - 5_880.0).abs() < 1e-9 && demanded > permitted);
        for number in [format!("{demanded:.1}"), "6000.0".to_owned(), "5880.0".to_owned(), "10000".to_owned()] {
            assert!(finding.message.contains(&number), "no {number}: {}", finding.message);
        }
        for axis in ["X", "Z"] {
            let (acceleration, limit, utilisation) = row(&report.sections[0], axis);
            assert!((limit - permitted).abs() < 1e-9 && acceleration == demanded, "{axis}: {acceleration} of {limit}");
            assert!(utilisation > 1.0, "{axis}: {utilisation}");
        }
        assert!(!report.sections[0].feasible);
    };
    check(0.04, 7_700.0..8_100.0);
    // Less than the limit of the curve, and yet too much.
    check(0.0292, 5_880.0..6_000.0);
    assert!(validate(&program(0.025), &config).sections[0].feasible);
}

#[test]
fn a_section_whose_block_is_refused_is_not_said_to_be_followed() {
    let (_, kinematics) = kinds().swap_remove(0);
    let config = config_of(kinematics);
    let alone = "G90 G94\nT1 M6\nM3 S1000\nG200 F50 A0.05\nG1 A20 F500\nG201\nM30\n";
    let report = validate(alone, &config);
    the_finding(&report, "VIB-ROTARY-ONLY");
    assert!(report.sections.iter().all(|section| !section.feasible && section.length_mm == 0.0));
    assert!(!report.sections.is_empty());
    let among = "G90 G94\nT1 M6\nM3 S1000\nG200 F50 A0.05\nG1 X10 F500\nA20\nX20\nG201\nM30\n";
    let report = validate(among, &config);
    the_finding(&report, "VIB-ROTARY-ONLY");
    assert!(report.sections[0].length_mm > 0.0 && !report.sections[0].feasible);
}

#[test]
fn steps_beyond_a_rotary_axis_are_in_degrees() {
    let (_, kinematics) = kinds().swap_remove(0);
    let config = PipelineConfig { vibration_envelope: VibrationEnvelope::Published, ..config_of(kinematics) };
    let report = validate("G90 G94\nT1 M6\nM3 S1000\nG200 F20 A0.01\nG1 X10 C90 F200\nG201\nM30\n", &config);
    let finding = the_finding(&report, "VIB-PUBLISHED-ENDS");
    let ends = report.sections[0].published_ends.as_ref().unwrap();
    let exceeded = ends.exceeded.as_ref().unwrap();
    assert_eq!((exceeded.axis.as_str(), exceeded.rotary), ("C", true));
    assert_eq!(value(finding, "demanded"), (exceeded.jerk_per_s3, "deg/s³"));
    assert_eq!(value(finding, "limit"), (exceeded.max_jerk_per_s3, "deg/s³"));
    assert!(finding.message.contains("deg/s³ of the C axis"), "{}", finding.message);
}
