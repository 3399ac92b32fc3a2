//! Partial updates: copies the fields that a mask names from one message to another, at any depth.

use prost::Name;
use prost_reflect::{DynamicMessage, ReflectMessage as _, Value};
use prost_types::FieldMask;

use crate::error::{Error, Result, Violations};
use crate::json::to_dynamic;

/// `stored` with the fields that the mask names taken from `given`; all of `given` where the mask is absent,
/// empty or `*`.
pub(super) fn apply<M: Name + Default + Clone>(stored: &M, given: &M, mask: Option<&FieldMask>) -> Result<M> {
    let paths = mask.map_or(&[][..], |mask| &mask.paths);
    if paths.is_empty() || paths == ["*"] {
        return Ok(given.clone());
    }
    let mut target = to_dynamic(stored);
    let source = to_dynamic(given);
    let mut violations = Violations::default();
    for path in paths {
        if let Err(reason) = copy(&mut target, &source, path) {
            violations.add("update_mask", format!("{path:?}: {reason}"));
        }
    }
    violations.finish()?;
    target.transcode_to().map_err(Error::internal)
}

fn copy(target: &mut DynamicMessage, source: &DynamicMessage, path: &str) -> Result<(), String> {
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
    match (target.get_field_mut(&field), source.get_field(&field).as_ref()) {
        (Value::Message(target), Value::Message(source)) => copy(target, source, rest),
        _ => Err(format!("{name:?} has no fields")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::proto::{Machine, MachineProfile, VibrationSettings};

    fn machine(frequency: f64, amplitude: f64, name: &str) -> Machine {
        let vibration = VibrationSettings {
            max_frequency_hz: Some(frequency),
            max_amplitude_mm: Some(amplitude),
            ..Default::default()
        };
        let profile = MachineProfile { vibration: Some(vibration), ..Default::default() };
        Machine { display_name: name.to_owned(), profile: Some(profile), ..Default::default() }
    }

    fn masked(paths: &[&str]) -> Result<Machine> {
        let mask = FieldMask { paths: paths.iter().map(|&path| path.to_owned()).collect() };
        apply(&machine(100.0, 0.1, "old"), &machine(200.0, 0.2, "new"), Some(&mask))
    }

    #[test]
    fn only_the_named_fields_change_at_any_depth() {
        assert_eq!(masked(&["profile.vibration.max_frequency_hz"]).unwrap(), machine(200.0, 0.1, "old"));
        assert_eq!(masked(&["display_name"]).unwrap(), machine(100.0, 0.1, "new"));
        assert_eq!(masked(&[]).unwrap(), machine(200.0, 0.2, "new"));
        assert_eq!(masked(&["*"]).unwrap(), machine(200.0, 0.2, "new"));
    }

    #[test]
    fn a_named_field_that_is_absent_is_cleared() {
        let mask = FieldMask { paths: vec!["profile.vibration".to_owned()] };
        let cleared = apply(&machine(1.0, 1.0, "m"), &Machine::default(), Some(&mask)).unwrap();
        assert_eq!(cleared.profile.unwrap().vibration, None);
    }

    #[test]
    fn paths_that_lead_nowhere_are_all_reported() {
        let Err(Error::Invalid(violations)) = masked(&["nothing", "profile.machine.axes.name", "display_name.x"])
        else {
            panic!("accepted");
        };
        assert_eq!(violations.len(), 3);
    }
}
