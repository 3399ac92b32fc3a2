//! Actions as lines of JSON against the mapping, on all programs among the fixtures and on neighbours made of their actions.

use std::fs;
use std::path::{Path, PathBuf};

use feedwave_contract::convert::action_to_proto;
use feedwave_contract::json;
use feedwave_contract::proto::Action;
use feedwave_program::{LanguageSettings, interpret};
use proptest::prelude::*;

/// All files below a directory.
fn files(directory: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "nc" || extension == "ngc") {
            found.push(path);
        }
    }
}

/// The actions of every program in every dialect, as far as it is read.
fn actions() -> Vec<Action> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests");
    let mut programs = Vec::new();
    files(&root.join("fixtures"), &mut programs);
    files(&root.join("reference/programs"), &mut programs);
    assert!(programs.len() > 150, "{}", programs.len());
    programs.sort();
    let names = ["sub.nc".to_owned(), "\"a\\b\".nc".to_owned()];
    let mut actions = Vec::new();
    for program in programs {
        let text = fs::read(program).unwrap();
        for settings in [LanguageSettings::default(), LanguageSettings::mill(), LanguageSettings::linuxcnc()] {
            let (operations, _) = interpret(&text, settings);
            actions.extend(operations.iter().take(2_000).map(|operation| action_to_proto(operation, &names)));
        }
    }
    actions
}

#[track_caller]
fn check(lines: &mut json::Actions, action: &Action) {
    let mut written = Vec::new();
    lines.append(action.clone(), &mut written);
    assert_eq!(String::from_utf8(written).unwrap(), json::to_string(action));
}

#[test]
fn actions_of_all_fixtures_are_written_as_the_mapping_does() {
    let mut lines = json::Actions::default();
    let mut kinds = std::collections::BTreeSet::new();
    for action in actions() {
        check(&mut lines, &action);
        kinds.insert(action.kind);
    }
    assert!(kinds.len() > 10, "{kinds:?}");
}

#[test]
fn numbers_that_are_none_and_names_that_are_unknown_are_written_as_the_mapping_does() {
    let mut lines = json::Actions::default();
    let action = Action { kind: 4_711, file: "é\"\\\n\u{1}".into(), dwell_s: Some(-0.0), ..Action::default() };
    for dwell in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 1e300, 5e-324, 0.1] {
        check(&mut lines, &Action { dwell_rev: Some(dwell), ..action.clone() });
        let end = feedwave_contract::proto::AxisPosition { x: dwell, c: -dwell, ..Default::default() };
        check(&mut lines, &Action { end: Some(end), machine_end: Some(end), ..action.clone() });
    }
}

proptest! {
    #[test]
    fn whatever_neighbours_have_in_common(places in prop::collection::vec((0_usize..10_000, 0_u32..4096), 1..60)) {
        use std::sync::LazyLock;
        static ACTIONS: LazyLock<Vec<Action>> = LazyLock::new(actions);
        let mut lines = json::Actions::default();
        let mut action = Action::default();
        for (place, taken) in places {
            let other = &ACTIONS[place * 7 % ACTIONS.len()];
            // Some fields of another action, and some at other places.
            let takes = |bit: u32| taken & (1 << bit) != 0;
            if takes(0) { action.start = action.end; }
            if takes(1) { action.end = other.end; }
            if takes(2) { action.machine_end = other.machine_end; }
            if takes(3) { action.offset = other.start; }
            if takes(4) { (action.plane, action.arc) = (other.plane, other.arc); }
            if takes(5) { action.feed = other.feed; }
            if takes(6) { action.spindle = other.spindle; }
            if takes(7) { (action.tool, action.path_control) = (other.tool, other.path_control); }
            if takes(8) { (action.line, action.kind) = (other.line, other.kind); }
            if takes(9) { action.thread = other.thread; }
            if takes(10) { action.function.clone_from(&other.function); }
            if takes(11) { action.spline.clone_from(&other.spline); }
            if takes(11) { action.dwell_s = other.dwell_s; }
            check(&mut lines, &action);
        }
    }
}
