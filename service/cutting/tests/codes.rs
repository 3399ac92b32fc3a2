//! The table of finding codes: every example that is a program is validated and gives its code.

mod common;
#[path = "five_axis/machine.rs"]
mod machine;

use std::collections::BTreeSet;

use common::validate;
use feedwave_cutting::tool_oscillation::{
    CuttingEdge, DirectionOscillation, Engagement, LeadingEdge, NamedCondition, OscillationCondition,
    OscillationPeriod, RoleRotation, ToolGeometry, Waveform,
};
use feedwave_cutting::{MachineProfile, PipelineConfig, Tool, code};
use feedwave_program::{CodeEntry, Example, LanguageSettings};
use serde_json::Value;

fn entries() -> impl Iterator<Item = &'static CodeEntry> {
    feedwave_program::code::TABLES.iter().chain(&code::TABLES).flat_map(|table| table.entries)
}

/// As in `tests/fixtures/oscillation-mill.toml`.
fn conditions() -> Vec<NamedCondition> {
    let direction = |amplitude_mm, waveform| DirectionOscillation { amplitude_mm, waveform, phase_deg: 0.0 };
    let named = |number, name: &str, axial_mm, waveform| NamedCondition {
        name: name.to_owned(),
        number,
        tools: Vec::new(),
        condition: OscillationCondition {
            period: OscillationPeriod::PerRevolution(1),
            feed: direction(0.4, Waveform::Sine),
            axial: direction(axial_mm, waveform),
            cross: None,
            leading_edge: LeadingEdge::default(),
            ramp_periods: 2,
            may_overrun: false,
            engagement: Engagement::Slot,
        },
        tables: Vec::new(),
    };
    let mut speed = named(3, "speed", 0.05, Waveform::JerkLimitedHeldPeak { hold_share: 0.26 });
    speed.condition.leading_edge.rotation = RoleRotation::EveryParts(50);
    vec![
        named(1, "accuracy", 0.03, Waveform::HeldPeak { hold_share: 0.3 }),
        named(2, "smooth", 0.03, Waveform::JerkLimitedHeldPeak { hold_share: 0.3 }),
        speed,
    ]
}

fn tool(number: u32, geometry: Option<ToolGeometry>) -> Tool {
    Tool { number, name: String::new(), max_rev_per_min: None, length_mm: Some(100.0), geometry }
}

/// As in `tests/fixtures/oscillation-tools.toml`.
fn oscillating_tools() -> Vec<Tool> {
    let even = ToolGeometry::even(4, 60.0, 1.5, 5.0);
    let mut measured = even.clone();
    measured.end_relief_deg = 0.1;
    let set_over_mm = [0.003, -0.002, 0.004, 0.001];
    measured.edges = even
        .edges
        .iter()
        .zip(set_over_mm)
        .map(|(edge, axial_set_over_mm)| CuttingEdge { axial_set_over_mm, ..edge.clone() })
        .collect();
    measured.edges[3].finishing = true;
    vec![tool(4, Some(even)), tool(5, Some(measured))]
}

/// The machine of an example and its changes.
fn config(described: &str) -> PipelineConfig {
    let mut parts = described.split(", ");
    let mut config = match parts.next().expect("a machine") {
        "lathe" => PipelineConfig::new(MachineProfile::lathe()),
        "mill" => PipelineConfig { tools: vec![tool(1, None)], ..PipelineConfig::new(MachineProfile::mill()) },
        "LinuxCNC mill" => {
            PipelineConfig::new(MachineProfile { language: LanguageSettings::linuxcnc(), ..MachineProfile::mill() })
        }
        "five-axis mill" => machine::config(),
        "oscillation mill" => {
            let profile = MachineProfile { tool_oscillation: conditions(), ..MachineProfile::mill() };
            PipelineConfig { tools: oscillating_tools(), ..PipelineConfig::new(profile) }
        }
        "five-axis mill with the conditions and tools of the oscillation mill" => {
            let mut config = machine::config();
            config.profile.tool_oscillation = conditions();
            config.tools = oscillating_tools();
            config
        }
        other => panic!("which machine is {other:?}?"),
    };
    for change in parts {
        let (path, value) = change.split_once(" = ").expect("a setting");
        let value = serde_json::from_str(value).unwrap_or_else(|_| Value::from(value));
        set(&mut config, path, value);
    }
    config
}

fn set(config: &mut PipelineConfig, path: &str, value: Value) {
    match path {
        "interpolation_period_us" => config.interpolation_period_us = serde_json::from_value(value).expect(path),
        "generation_mode" => config.generation_mode = serde_json::from_value(value).expect(path),
        "vibration_envelope" => config.vibration_envelope = serde_json::from_value(value).expect(path),
        "condition" => config.oscillation.condition = serde_json::from_value(value).expect(path),
        "tools" => {
            let numbers: Vec<u32> = serde_json::from_value(value).expect(path);
            config.tools = numbers.into_iter().map(|number| tool(number, None)).collect();
        }
        _ => {
            let mut profile = serde_json::to_value(&config.profile).expect("plain data");
            let place = path.split('.').fold(&mut profile, |value, key| match key.parse::<usize>() {
                Ok(index) => &mut value[index],
                Err(_) => value.get_mut(key).unwrap_or_else(|| panic!("{path}: no {key}")),
            });
            *place = value;
            config.profile = serde_json::from_value(profile).unwrap_or_else(|error| panic!("{path}: {error}"));
        }
    }
}

#[test]
fn every_code_is_there_once() {
    let mut names = BTreeSet::new();
    for CodeEntry { name, severities, meaning, cause, cure, .. } in entries() {
        assert!(names.insert(name), "{name} twice");
        assert!(!severities.is_empty() && !meaning.ends_with('.'), "{name}");
        assert!(cause.ends_with('.') && cure.ends_with('.'), "{name}");
    }
}

/// The examples that are no program: requests, tools, and what would take too long or too much to run here.
const IN_WORDS: usize = 24;

#[test]
fn examples_give_their_findings() {
    let (mut in_words, mut wrong) = (0, Vec::new());
    for entry in entries() {
        let Example::Program { machine, text } = entry.example else {
            in_words += 1;
            continue;
        };
        let report = validate(text, &config(machine));
        let found = report.findings.iter().find(|finding| finding.code == entry.name);
        if !found.is_some_and(|found| entry.severities.contains(&found.severity)) {
            let found: Vec<_> = report.findings.iter().map(|found| (found.code, &found.message)).collect();
            wrong.push(format!("{}: {machine}, {text:?} gives {found:?}", entry.name));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(in_words, IN_WORDS, "examples without a program");
}
