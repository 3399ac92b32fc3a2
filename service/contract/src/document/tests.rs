use crate::json;
use crate::proto::{Machine, MachineKind, MachineProfile, Tool};

use super::*;

const FORMER: &[FormerField] = &[
    FormerField { message: "Waveform", field: "kind", now: "sine = {}", flattened: false },
    FormerField { message: "OscillationCondition", field: "condition", now: "its fields", flattened: true },
];

fn refused<M: Name + Default>(text: &str, syntax: Syntax) -> Vec<(String, String)> {
    let document = Document::parse(text, syntax).unwrap();
    let violations = document.message::<M>(FORMER).map(|_| ()).expect_err(text);
    violations.as_slice().iter().map(|v| (v.field.clone(), v.description.clone())).collect()
}

fn of_toml(text: &str) -> Vec<(String, String)> {
    refused::<MachineProfile>(text, Syntax::Toml)
}

#[test]
fn toml_and_json_with_both_kinds_of_names_are_the_same_message() {
    let toml = "[machine]\nkind = 'MACHINE_KIND_MILL'\nmax_spindle_rev_per_min = 9_000\n\
                [[machine.axes]]\nname = 'X'\naxis = 'AXIS_LETTER_X'\ntravel_min = -3\n";
    let camel = r#"{"machine": {"kind": 2, "maxSpindleRevPerMin": "9000", "axes": [{"name": "X", "axis": "AXIS_LETTER_X",
        "travelMin": -3.0, "travelMax": null}]}}"#;
    let snake = r#"{"machine": {"kind": 2, "max_spindle_rev_per_min": 9e3, "axes": [{"name": "X", "axis": 1,
        "travel_min": -3}]}}"#;
    let read = |text, syntax| Document::parse(text, syntax).unwrap().message::<MachineProfile>(&[]).unwrap();
    let profile = read(toml, Syntax::Toml);
    assert_eq!(profile.machine.as_ref().unwrap().kind(), MachineKind::Mill);
    assert_eq!((read(camel, Syntax::Json), read(snake, Syntax::Json)), (profile.clone(), profile.clone()));
    // What the service answers is a file.
    let machine =
        Machine { profile: Some(profile), create_time: Some(crate::convert::timestamp(7)), ..Machine::default() };
    let answer = Document::parse(&json::to_string(&machine), Syntax::Json).unwrap();
    assert_eq!(answer.message::<Machine>(&[]), Ok(machine));
}

#[test]
fn what_is_stated_is_found_under_both_names() {
    let document = Document::parse(r#"{"machine": {"maxSpindleRevPerMin": 0, "axes": null}}"#, Syntax::Json).unwrap();
    assert!(document.states(&["machine"]) && document.states(&["machine", "max_spindle_rev_per_min"]));
    assert!(!document.states(&["machine", "axes"]) && !document.states(&["machine", "kind", "x"]));
}

#[test]
fn unknown_fields_are_named_with_their_path_and_the_nearest_name() {
    let found = of_toml("look = 1\n[vibration]\nmax_frequency = 1.0\n[[machine.axes]]\nmax_velocty_per_s = 3\n");
    assert_eq!(found.len(), 3, "{found:?}");
    for (path, words) in [
        ("look", "is not a field of MachineProfile, which are language, machine, "),
        ("vibration.max_frequency", "is not a field of VibrationSettings, is max_frequency_hz meant?"),
        ("machine.axes[0].max_velocty_per_s", "is max_velocity_per_s meant?"),
    ] {
        let (_, reason) =
            found.iter().find(|(field, _)| field == path).unwrap_or_else(|| panic!("{path} in {found:?}"));
        assert!(reason.contains(words), "{reason}");
    }
}

#[test]
fn every_wrong_value_is_named_with_what_it_must_be() {
    for (text, path, reason) in [
        ("vibration = 3", "vibration", "must be a table of generation_mode, "),
        ("look_ahead_blocks = -1", "look_ahead_blocks", "must be a whole number from 0 to 4294967295, is -1"),
        ("look_ahead_blocks = 1.5", "look_ahead_blocks", "must be a whole number"),
        ("look_ahead_blocks = 'four'", "look_ahead_blocks", "is \"four\""),
        ("pole_tolerance_deg = true", "pole_tolerance_deg", "must be a number, is true"),
        ("pole_tolerance_deg = [1]", "pole_tolerance_deg", "must be a number, is a list"),
        ("[machine]\nkind = 'mill'", "machine.kind", "must be \"MACHINE_KIND_MILL\", is \"mill\""),
        ("[machine]\nkind = 'saw'", "machine.kind", "must be one of MACHINE_KIND_LATHE, MACHINE_KIND_MILL, is \"saw\""),
        ("[machine]\naxes = {}", "machine.axes", "must be a list, is a table"),
        ("[machine]\naxes = [1]", "machine.axes[0]", "must be a table of name, axis, "),
        ("[kinematics]\ntool_direction = [0, 0.5, 1]", "kinematics.tool_direction", "write { x = 0, y = 0.5, z = 1 }"),
        ("[[tool_oscillation]]\ntools = [1, 'b']", "tool_oscillation[0].tools[1]", "must be a whole number"),
        (
            "[[tool_oscillation]]\nperiods_per_rev = 1\nperiod_s = 1",
            "tool_oscillation[0].periods_per_rev",
            "excludes period_s",
        ),
        ("[language]\nblock_delete = 'yes'", "language.block_delete", "must be true or false, is \"yes\""),
    ] {
        let found = of_toml(text);
        let matching = found.iter().any(|(field, description)| field == path && description.contains(reason));
        assert!(found.len() == 1 && matching, "{text}: {found:?}");
    }
    let twice = refused::<MachineProfile>(r#"{"lookAheadBlocks": 5, "look_ahead_blocks": 6}"#, Syntax::Json);
    assert!(twice[0].1.contains("is given twice, as lookAheadBlocks and as look_ahead_blocks"), "{twice:?}");
    assert!(refused::<Tool>("3", Syntax::Json)[0].1.contains("must be a table of name, number"));
}

#[test]
fn fields_of_a_former_form_say_what_to_write() {
    let text = "[[tool_oscillation]]\nname = 'a'\n[tool_oscillation.condition]\nfed = 1\n\
                feed = { amplitude_mm = 1, waveform = { kind = 'sine' } }\n";
    let found = of_toml(text);
    let at = |path: &str| found.iter().find(|(field, _)| field == path).map(|(_, reason)| reason.as_str());
    let condition = at("tool_oscillation[0].condition").unwrap();
    assert_eq!(condition, "is of a former form of these files: write its fields");
    assert!(at("tool_oscillation[0].condition.feed.waveform.kind").unwrap().ends_with("write sine = {}"));
    assert!(at("tool_oscillation[0].condition.fed").unwrap().contains("is feed meant?"));
    assert_eq!(found.len(), 3, "{found:?}");
}

#[test]
fn numbers_that_json_does_not_have_are_not_lost() {
    let document = Document::parse("length_mm = nan\nnose_radius_mm = -inf\n", Syntax::Toml).unwrap();
    let tool = document.message::<Tool>(&[]).unwrap();
    assert!(tool.length_mm.unwrap().is_nan());
    assert_eq!(tool.nose_radius_mm, Some(f64::NEG_INFINITY));
    let document = Document::parse("create_time = 2026-11-22T08:00:00Z\n", Syntax::Toml).unwrap();
    assert_eq!(document.message::<Tool>(&[]).unwrap().create_time.unwrap().seconds, 1_795_334_400);
}

#[test]
fn what_is_no_document_is_refused_with_its_place() {
    for (text, syntax, words) in [
        ("number = 1\nlength_mm = \n", Syntax::Toml, "at line 2 column"),
        ("number = 1\nnumber = 2\n", Syntax::Toml, "duplicate key"),
        ("{\"number\": 1,\n \"number\": 2}", Syntax::Json, "\"number\" is given twice at line 2"),
        ("{", Syntax::Json, "line 1"),
        ("", Syntax::Json, "line 1"),
        ("{\"number\": 1e999}", Syntax::Json, "out of range"),
    ] {
        let error = Document::parse(text, syntax).unwrap_err();
        assert!(error.contains(words), "{text:?}: {error}");
    }
}
