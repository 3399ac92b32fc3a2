//! The spindle under constant surface speed: where it is looked at, and what limits it.

use crate::common::{Setpoints, run, validate};
use feedwave_cutting::{MachineProfile, OverrideChange, PipelineConfig, Tool, ValidationReport};
use feedwave_program::Severity::{Info, Warning};
use feedwave_program::{DialectName, LanguageSettings};

fn lathe(max_rev_per_min: f64) -> PipelineConfig {
    let mut profile = MachineProfile::lathe();
    profile.machine.max_spindle_rev_per_min = max_rev_per_min;
    profile.language.dwell_in_revolutions = true;
    PipelineConfig::new(profile)
}

/// Speed of the spindle in the middle of a line, rev/min, and how long it lasts, s.
fn turns(setpoints: &Setpoints, line: u32) -> (f64, f64) {
    let own: Vec<usize> = (0..setpoints.len()).filter(|&k| setpoints.line[k] == line).collect();
    let middle = own[own.len() / 2];
    let turned_deg = (setpoints.spindle[middle] - setpoints.spindle[middle - 1]).rem_euclid(360.0);
    (turned_deg / 360.0 * 60_000.0, own.len() as f64 * 1e-3)
}

/// Speed at 100 m/min on a diameter.
fn at(diameter_mm: f64) -> f64 {
    100_000.0 / (std::f64::consts::PI * diameter_mm)
}

#[test]
fn a_dwell_in_revolutions_knows_the_top_speed_of_the_machine() {
    let setpoints = run("G50 S9000\nG96 S100 M3\nG0 X20 Z0\nG1 X2 F0.1\nG4 U100\nG1 Z-1\nM30\n", &lathe(3_000.0));
    let (rev_per_min, time_s) = turns(&setpoints, 5);
    assert!((rev_per_min - 3_000.0).abs() < 1e-6 && (time_s - 2.0).abs() < 2e-3, "{rev_per_min} {time_s}");
}

#[test]
fn a_dwell_goes_by_the_coordinates_that_are_in_force_there() {
    for (shift, diameter_mm) in
        [("", 20.0), ("G50 X40\n", 40.0), ("G50 U20\n", 40.0), ("G52 X-20\n", 40.0), ("G52 X10\n", 10.0)]
    {
        let text = format!("G50 S9000\nG96 S100 M3\nG0 X20 Z0\n{shift}G4 U10\nM30\n");
        let setpoints = run(&text, &lathe(9_000.0));
        let (rev_per_min, time_s) = turns(&setpoints, if shift.is_empty() { 4 } else { 5 });
        let expected = at(diameter_mm);
        assert!((rev_per_min - expected).abs() < 1e-6 * expected, "{shift}{rev_per_min}");
        assert!((time_s - 600.0 / expected).abs() < 2e-3, "{shift}{time_s}");
    }
}

#[test]
fn on_a_rapid_the_spindle_turns_as_at_its_end() {
    let setpoints = run("G50 S9000\nG96 S100 M3\nG0 X100 Z5\nG0 X20\nG0 X60\nG1 Z0 F0.1\nM30\n", &lathe(9_000.0));
    for (line, diameter_mm) in [(3, 100.0), (4, 20.0), (5, 60.0), (6, 60.0)] {
        let (rev_per_min, _) = turns(&setpoints, line);
        assert!((rev_per_min - at(diameter_mm)).abs() < 1e-6 * rev_per_min, "line {line}: {rev_per_min}");
    }
}

fn codes(report: &ValidationReport) -> Vec<&str> {
    report.findings.iter().map(|finding| finding.code.name()).collect()
}

#[test]
fn the_limit_of_the_tool_holds_under_constant_surface_speed() {
    let mut config = lathe(9_000.0);
    config.tools = vec![Tool { number: 1, max_rev_per_min: Some(1_000.0), ..Tool::default() }];
    let program = |clamp: &str, end: &str| {
        format!("T0101\nG50 S{clamp}\nG96 S100 M3\nG0 X60 Z1\nG1 X{end} F0.1\nG1 X12 Z0\nM30\n")
    };
    let report = validate(&program("5000", "10"), &config);
    assert_eq!(codes(&report), ["SPINDLE-SPEED"]);
    let [speed, limit] = &report.findings[0].values[..] else { panic!("{:?}", report.findings) };
    assert!((speed.value - at(10.0)).abs() < 1e-6 && limit.value == 1_000.0, "{:?}", report.findings);
    // A clamp of the program keeps it, and so does one of the machine.
    assert_eq!(codes(&validate(&program("1000", "10"), &config)), [""; 0]);
    config.profile.machine.max_spindle_rev_per_min = 1_000.0;
    assert_eq!(codes(&validate(&program("5000", "10"), &config)), [""; 0]);
}

#[test]
fn overrides_that_the_program_forbids_are_said() {
    let mut profile = MachineProfile::mill();
    profile.language = LanguageSettings { dialect: DialectName::LinuxCnc, ..LanguageSettings::mill() };
    let mut config = PipelineConfig::new(profile);
    let found = |text: &str, config: &PipelineConfig| {
        let report = validate(&format!("G21 G90 G94 F600\nG1 X10\n{text}\nM2\n"), config);
        report
            .findings
            .iter()
            .map(|finding| (finding.code.name(), finding.severity, finding.span.line))
            .collect::<Vec<_>>()
    };
    let name = "OVERRIDE-FORBIDDEN";
    assert_eq!(
        found("M49\nG1 X20\nX30\nM48\nG1 X40\nM50 P0\nG1 X50\nM50 P1\nX60", &config),
        [(name, Info, 3), (name, Info, 8)]
    );
    assert_eq!(found("M49\nM48\nG1 X20\nM50\nX30\nM49\nG0 X0", &config), []);
    config.overrides = vec![OverrideChange { index: 0, ratio: 0.5 }];
    assert_eq!(found("M49\nG1 X20", &config), [(name, Warning, 3)]);
    assert_eq!(found("G1 X20", &config), []);
    // To hold the feed is not to change it.
    config.overrides = vec![OverrideChange { index: 9, ratio: 0.0 }, OverrideChange { index: 99, ratio: 1.0 }];
    assert_eq!(found("M49\nG1 X20", &config), [(name, Info, 3)]);
}
