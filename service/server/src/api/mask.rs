//! Partial updates (AIP-134): takes the fields that a mask names, or those that are populated, from one message into
//! another, at any depth.

use feedwave_contract::json::to_dynamic;
use prost::Name;
use prost_reflect::{DynamicMessage, ReflectMessage as _, Value};
use prost_types::FieldMask;

use crate::error::{Error, Result, Violations};

/// The path of a full replacement.
const EVERYTHING: &str = "*";

/// Whether an update keeps nothing of the stored message.
pub(super) fn replaces_everything(mask: Option<&FieldMask>) -> bool {
    mask.is_some_and(|mask| mask.paths == [EVERYTHING])
}

/// `stored` with the fields that the mask names taken from `given`, cleared where `given` has none; without a mask or with
/// an empty one, the fields that are populated in `given`, at any depth, lists as a whole; with `*`, all of `given`.
pub(super) fn apply<M: Name + Default + Clone>(stored: &M, given: &M, mask: Option<&FieldMask>) -> Result<M> {
    if replaces_everything(mask) {
        return Ok(given.clone());
    }
    let paths = mask.map_or(&[][..], |mask| &mask.paths);
    let mut target = to_dynamic(stored);
    let source = to_dynamic(given);
    if paths.is_empty() {
        merge(&mut target, &source);
    }
    let mut violations = Violations::default();
    for path in paths {
        if let Err(reason) = copy(&mut target, &source, path) {
            violations.add("update_mask", format!("{path:?}: {reason}"));
        }
    }
    violations.finish()?;
    target.transcode_to().map_err(Error::internal)
}

/// Takes over every populated field: what a message does not say stays as it is.
fn merge(target: &mut DynamicMessage, source: &DynamicMessage) {
    for (field, value) in source.fields() {
        match (value, target.has_field(&field)) {
            (Value::Message(source), true) => {
                if let Value::Message(target) = target.get_field_mut(&field) {
                    merge(target, source);
                }
            }
            (value, _) => target.set_field(&field, value.clone()),
        }
    }
}

fn copy(target: &mut DynamicMessage, source: &DynamicMessage, path: &str) -> Result<(), String> {
    if path == EVERYTHING {
        return Err("replaces everything and cannot be combined with other paths or be part of one".to_owned());
    }
    let (name, rest) = path.split_once('.').map_or((path, None), |(name, rest)| (name, Some(rest)));
    let descriptor = target.descriptor();
    let field =
        descriptor.get_field_by_name(name).ok_or_else(|| format!("{} has no field {name:?}", descriptor.name()))?;
    let Some(rest) = rest else {
        if source.has_field(&field) {
            target.set_field(&field, source.get_field(&field).into_owned());
        } else {
            target.clear_field(&field);
        }
        return Ok(());
    };
    if field.is_list() || field.is_map() {
        return Err(format!("{name:?} is a list and can be replaced as a whole only"));
    }
    let inside = source.get_field(&field);
    let Value::Message(source_inside) = inside.as_ref() else { return Err(format!("{name:?} has no fields")) };
    if source.has_field(&field) || target.has_field(&field) {
        let Value::Message(target) = target.get_field_mut(&field) else {
            return Err(format!("{name:?} has no fields"));
        };
        return copy(target, source_inside, rest);
    }
    // Neither has the message: the path is checked, and no empty message is made.
    copy(&mut source_inside.clone(), source_inside, rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use feedwave_contract::proto::{Machine, MachineProfile, OscillationCondition, VibrationSettings};

    fn machine(frequency: f64, amplitude: f64, name: &str) -> Machine {
        let vibration = VibrationSettings {
            max_frequency_hz: Some(frequency),
            max_amplitude_mm: Some(amplitude),
            ..Default::default()
        };
        let profile = MachineProfile { vibration: Some(vibration), ..Default::default() };
        Machine { display_name: name.to_owned(), profile: Some(profile), ..Default::default() }
    }

    fn mask(paths: &[&str]) -> FieldMask {
        FieldMask { paths: paths.iter().map(|&path| path.to_owned()).collect() }
    }

    fn masked(paths: &[&str]) -> Result<Machine> {
        let (stored, given) = (machine(100.0, 0.1, "old"), machine(200.0, 0.2, "new"));
        apply(&stored, &given, Some(&mask(paths)))
    }

    #[test]
    fn only_the_named_fields_change_at_any_depth() {
        assert_eq!(masked(&["profile.vibration.max_frequency_hz"]).unwrap(), machine(200.0, 0.1, "old"));
        assert_eq!(masked(&["display_name"]).unwrap(), machine(100.0, 0.1, "new"));
        assert_eq!(masked(&["*"]).unwrap(), machine(200.0, 0.2, "new"));
    }

    #[test]
    fn without_a_mask_populated_fields_change_at_any_depth_and_nothing_else() {
        let condition = |name: &str| OscillationCondition { name: name.to_owned(), ..Default::default() };
        let mut stored = machine(100.0, 0.1, "old");
        stored.profile.as_mut().unwrap().tool_oscillation = vec![condition("a"), condition("b")];
        let vibration = VibrationSettings { max_frequency_hz: Some(200.0), ..Default::default() };
        let profile = MachineProfile { vibration: Some(vibration), ..Default::default() };
        let given = Machine { profile: Some(profile), ..Default::default() };
        for mask in [None, Some(mask(&[]))] {
            let updated = apply(&stored, &given, mask.as_ref()).unwrap();
            let mut expected = stored.clone();
            expected.profile.as_mut().unwrap().vibration.as_mut().unwrap().max_frequency_hz = Some(200.0);
            assert_eq!(updated, expected);
            assert_eq!(apply(&stored, &Machine::default(), mask.as_ref()).unwrap(), stored);
        }
        // A list is one value.
        let mut other = Machine::default();
        other.profile.get_or_insert_default().tool_oscillation = vec![condition("c")];
        let updated = apply(&stored, &other, None).unwrap().profile.unwrap();
        assert_eq!(updated.tool_oscillation, [condition("c")]);
        assert_eq!(updated.vibration, stored.profile.unwrap().vibration);
    }

    #[test]
    fn everything_is_replaced_only_where_it_is_asked_for() {
        let stored = machine(100.0, 0.1, "old");
        let updated = apply(&stored, &Machine::default(), Some(&mask(&["*"]))).unwrap();
        assert_eq!(updated, Machine::default());
    }

    #[test]
    fn a_named_field_that_is_absent_is_cleared() {
        let mask = mask(&["profile.vibration"]);
        let cleared = apply(&machine(1.0, 1.0, "m"), &Machine::default(), Some(&mask)).unwrap();
        assert_eq!(cleared.profile.unwrap().vibration, None);
    }

    #[test]
    fn a_path_into_a_message_that_neither_has_changes_nothing() {
        let stored = Machine::default();
        let mask = mask(&["profile.vibration.max_frequency_hz"]);
        assert_eq!(apply(&stored, &Machine::default(), Some(&mask)).unwrap(), stored);
    }

    #[test]
    fn paths_that_lead_nowhere_are_all_reported() {
        let wrong = ["nothing", "", "profile.machine.axes.name", "display_name.x", "profile.", "profile.*", "*"];
        let Err(Error::Invalid(violations)) = masked(&wrong) else { panic!("accepted") };
        assert_eq!(violations.count(), wrong.len(), "{violations}");
        // In a message that is in neither, too.
        let empty = Machine::default();
        assert!(apply(&empty, &empty, Some(&mask(&["profile.vibration.nothing"]))).is_err());
    }
}
