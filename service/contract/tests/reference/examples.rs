//! The examples of the table of finding codes: those that are programs are validated, and give their codes.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use feedwave_contract::code::finding_codes;
use feedwave_contract::convert::{profile_from_proto, profile_to_proto, tool_for_pipeline};
use feedwave_contract::document::{Document, Syntax};
use feedwave_contract::proto::DESCRIPTORS;
use feedwave_contract::violations::Violations;
use feedwave_contract::{json, proto};
use feedwave_cutting::{MachineProfile, PipelineConfig, Step, Tool, Validation, ValidationReport};
use feedwave_program::{CodeEntry, Example, ToolOffset};
use prost::Name;
use serde_json::Value;

/// Examples that are not programs: requests, tools, and what would take too long or too much to run here.
const IN_WORDS: usize = 37;

#[test]
fn every_code_is_there_once() {
    let mut names = BTreeSet::new();
    for CodeEntry { name, severities, meaning, cause, cure, .. } in entries() {
        assert!(names.insert(name), "{name} twice");
        assert!(!severities.is_empty() && !meaning.ends_with('.'), "{name}");
        assert!(cause.ends_with('.') && cure.ends_with('.'), "{name}");
    }
}

#[test]
fn examples_give_their_findings() {
    let (mut in_words, mut wrong) = (0, Vec::new());
    for entry in entries() {
        let Example::Program { machine, text } = entry.example else {
            in_words += 1;
            continue;
        };
        let report = validate(text, config(machine));
        let found = report.findings.iter().find(|finding| finding.code == entry.name);
        if !found.is_some_and(|found| entry.severities.contains(&found.severity)) {
            let found: Vec<_> = report.findings.iter().map(|found| (found.code, &found.message)).collect();
            wrong.push(format!("{}: {machine}, {text:?} gives {found:?}", entry.name));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(in_words, IN_WORDS, "examples in words");
}

/// A cure is right when it is followed to the letter: the fields of the profile and the values that it names are there.
#[test]
fn cures_name_fields_and_values_that_there_are() {
    let profile = DESCRIPTORS.get_message_by_name("feedwave.v1.MachineProfile").expect("the profile");
    let values: BTreeSet<String> = DESCRIPTORS
        .all_enums()
        .flat_map(|kind| kind.values().map(|value| value.name().to_owned()).collect::<Vec<_>>())
        .collect();
    let is_field = |path: &str| {
        let mut message = Some(profile.clone());
        path.split('.').all(|name| {
            let field = message.take().and_then(|message| message.get_field_by_name(name));
            message = field.as_ref().and_then(|field| field.kind().as_message().cloned());
            field.is_some()
        })
    };
    let (mut seen, mut wrong) = (0, BTreeSet::new());
    for entry in entries() {
        let Example::Program { machine, text } = entry.example else { continue };
        let report = validate(text, config(machine));
        for cure in report.findings.iter().flat_map(|finding| &finding.suggestions) {
            let is_of_name = |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '_' | '.');
            for word in cure.message.split(|letter| !is_of_name(letter)).map(|word| word.trim_end_matches('.')) {
                let is_value =
                    word.contains('_') && word.chars().all(|letter| letter.is_ascii_uppercase() || letter == '_');
                if word.starts_with("language.") || is_value {
                    seen += 1;
                    if !values.contains(word) && !is_field(word) {
                        wrong.insert(format!("{}: {word} in {:?}", entry.name, cure.message));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(seen >= 8, "{seen}");
}

fn entries() -> impl Iterator<Item = &'static CodeEntry> {
    finding_codes().flat_map(|table| table.entries)
}

fn validate(program: &str, config: PipelineConfig) -> ValidationReport {
    let mut validation = Validation::new(Arc::new(config));
    validation.push(program.as_bytes());
    validation.finish_input();
    while validation.step() != Step::Finished {}
    validation.finish()
}

/// The machine and the job of an example: the name of a machine, then changes of fields of its profile or of the job.
fn config(described: &str) -> PipelineConfig {
    let mut parts = described.split(", ");
    let generic = |profile: MachineProfile| profile_to_proto(&profile);
    let (machine, tools) = match parts.next().expect("a machine") {
        "lathe" => (generic(MachineProfile::lathe()), Vec::new()),
        "mill" => (generic(MachineProfile::mill()), vec![tool(1)]),
        "five-axis mill" => (message(fixture("five-axis-mill.toml")), vec![tool(1)]),
        // Its axes are those of the mill.
        "oscillation mill" => (with_conditions(generic(MachineProfile::mill())), oscillating_tools()),
        "five-axis mill with the conditions and tools of the oscillation mill" => {
            (with_conditions(message(fixture("five-axis-mill.toml"))), oscillating_tools())
        }
        other => panic!("which machine is {other:?}?"),
    };
    let mut machine: Value = serde_json::from_str(&json::to_string(&machine)).expect("JSON");
    let changes: Vec<(&str, Value)> = parts
        .map(|change| {
            let (path, value) = change.split_once(" = ").expect("a field and its value");
            (path, serde_json::from_str(value).unwrap_or_else(|_| Value::from(value)))
        })
        .collect();
    let of_job = |path: &str| ["interpolation_period_us", "tools", "oscillation.condition"].contains(&path);
    changes.iter().filter(|(path, _)| !of_job(path)).for_each(|(path, value)| set(&mut machine, path, value));
    let mut violations = Violations::default();
    let profile = profile_from_proto(&mut violations, "profile", &message(machine));
    let profile = profile.unwrap_or_else(|| panic!("{described}: {violations:?}"));
    let mut config = PipelineConfig { tools, ..PipelineConfig::new(profile) };
    for (path, value) in changes.iter().filter(|(path, _)| of_job(path)) {
        let number = || u32::try_from(value.as_u64().expect("a number")).expect("in range");
        match *path {
            "interpolation_period_us" => config.interpolation_period_us = number(),
            "oscillation.condition" => config.oscillation.condition = value.as_str().map(str::to_owned),
            _ => config.tools = vec![tool(value[0].as_u64().expect("a number") as u32)],
        }
    }
    config
}

/// Sets a field by its path with the names of the proto; `null` clears it.
fn set(message: &mut Value, path: &str, value: &Value) {
    let (parents, last) = path.rsplit_once('.').unwrap_or(("", path));
    let parents = parents.split('.').filter(|name| !name.is_empty());
    let place = parents.fold(message, |message, name| match name.parse::<usize>() {
        Ok(index) => &mut message[index],
        Err(_) => &mut message[json_name(name)],
    });
    if value.is_null() {
        place.as_object_mut().expect("a message").remove(&json_name(last));
    } else {
        place[json_name(last)] = value.clone();
    }
}

fn json_name(name: &str) -> String {
    let mut words = name.split('_');
    let first = words.next().unwrap_or_default().to_owned();
    words.fold(first, |name, word| name + &word[..1].to_uppercase() + &word[1..])
}

fn fixture(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures").join(name);
    toml::from_str(&std::fs::read_to_string(&path).expect("a fixture")).expect("TOML")
}

fn message<M: Name + Default>(value: Value) -> M {
    let document = Document::parse(&value.to_string(), Syntax::Json).expect("JSON");
    document.message(&[]).unwrap_or_else(|violations| panic!("{violations:?}"))
}

fn with_conditions(machine: proto::MachineProfile) -> proto::MachineProfile {
    let proto::MachineProfile { tool_oscillation, .. } = message(fixture("oscillation-mill.toml"));
    proto::MachineProfile { tool_oscillation, ..machine }
}

fn oscillating_tools() -> Vec<Tool> {
    let tools = fixture("oscillation-tools.toml")["tools"].take();
    let tools = tools.as_array().expect("tools").iter().cloned();
    tools.map(|tool| tool_for_pipeline(&message::<proto::Tool>(tool))).collect()
}

fn tool(number: u32) -> Tool {
    Tool { number, offset: ToolOffset::new(number).with_length(120.0), ..Tool::default() }
}
