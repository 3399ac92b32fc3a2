//! Applying what findings of vibrations offer.

use feedwave_cutting::{
    GenerationMode, MachineProfile, OverrideChange, PipelineConfig, ValidationReport, VibrationEnvelope,
};
use feedwave_program::{Finding, Severity, Suggestion};
use proptest::prelude::*;

use super::validate;

pub fn lathe(overrides: &[(u64, f64)]) -> PipelineConfig {
    let overrides = overrides.iter().map(|&(index, ratio)| OverrideChange { index, ratio }).collect();
    PipelineConfig { overrides, ..PipelineConfig::new(MachineProfile::lathe()) }
}

pub fn the_finding<'a>(report: &'a ValidationReport, code: &str) -> &'a Finding {
    let found = report.findings.iter().find(|finding| finding.code == code);
    found.unwrap_or_else(|| panic!("no {code}: {:#?}", report.findings))
}

pub fn errors(report: &ValidationReport) -> Vec<&'static str> {
    let errors = report.findings.iter().filter(|finding| finding.severity == Severity::Error);
    errors.map(|finding| finding.code.name()).collect()
}

pub fn has(report: &ValidationReport, code: &str) -> bool {
    report.findings.iter().any(|finding| finding.code == code)
}

pub fn value(suggestion: &Suggestion, name: &str) -> Option<f64> {
    suggestion.value.as_ref().filter(|value| value.name == name).map(|value| value.value)
}

/// The program with the text at the finding's place replaced.
pub fn replaced(program: &str, finding: &Finding, replacement: &str) -> String {
    let start: usize = program.split_inclusive('\n').take(finding.span.line as usize - 1).map(str::len).sum();
    let from = start + finding.span.column as usize - 1;
    let to = from + finding.span.length as usize;
    format!("{}{replacement}{}", &program[..from], &program[to..])
}

/// What is wrong with the replacements of vibrations in a program.
pub fn faults(program: &str, config: &PipelineConfig) -> (usize, Vec<String>) {
    let report = validate(program, config);
    let (mut count, mut faults) = (0, Vec::new());
    for finding in report.findings.iter().filter(|finding| finding.code.name().starts_with("VIB-")) {
        let code = finding.code.name();
        for replacement in finding.suggestions.iter().filter_map(|suggestion| suggestion.replacement.as_deref()) {
            count += 1;
            let after = validate(&replaced(program, finding, replacement), config);
            let new: Vec<_> = errors(&after).into_iter().filter(|code| !errors(&report).contains(code)).collect();
            let remains = |other: &Finding| other.code == finding.code && other.severity >= finding.severity;
            if after.findings.iter().any(remains) || !new.is_empty() {
                let still = after.findings.iter().map(|finding| finding.message.as_str()).collect::<Vec<_>>();
                faults.push(format!("{replacement} for {code}: {}\n-> {new:?} {still:#?}\n{program}", finding.message));
            }
        }
    }
    (count, faults)
}

pub fn configs() -> impl Strategy<Value = PipelineConfig> {
    let mode = prop_oneof![
        3 => Just(GenerationMode::AlongPath),
        1 => Just(GenerationMode::Tangential),
        1 => Just(GenerationMode::ServoSide),
    ];
    let envelope = prop_oneof![3 => Just(VibrationEnvelope::Blended), 1 => Just(VibrationEnvelope::Published)];
    let overrides = prop_oneof![
        3 => Just(vec![]),
        1 => prop_oneof![Just(0.3), Just(0.7), Just(1.5), Just(2.0)].prop_map(|ratio| vec![(0, ratio)]),
    ];
    let follows = prop_oneof![3 => Just(None), 1 => Just(Some(1.3))];
    let period_us = prop_oneof![3 => Just(1_000_u32), 1 => Just(4_000)];
    (mode, envelope, overrides, follows, any::<bool>(), period_us).prop_map(
        |(generation_mode, vibration_envelope, overrides, follows, bind, interpolation_period_us)| {
            let mut config = lathe(&overrides);
            config.profile.vibration.amplitude_follows_feed_up_to = follows;
            config.profile.vibration.published_limits_bind = bind;
            PipelineConfig { generation_mode, vibration_envelope, interpolation_period_us, ..config }
        },
    )
}
