//! Coordinates and offsets of machines and jobs, to and from the contract.

use std::collections::BTreeSet;

use feedwave_program::{
    Axis, CoordinateSettings, CoordinateStyle, InitialOffsets, InitialParameters, LanguageSettings, Position,
    WorkOffset, WorkSystem,
};

use super::language::{position_from_proto, position_to_proto};
use super::parameters::{parameters_from_proto, parameters_to_proto};
use crate::convert::enumeration;
use crate::proto;
use crate::violations::Violations;

/// Extended work offsets that a control has.
const EXTENDED_SYSTEMS: std::ops::RangeInclusive<u32> = 48..=300;

/// Work coordinate systems that there are at most.
const MOST_SYSTEMS: usize = 309;

/// Axes that can roll over.
const ROTARY: [Axis; 3] = [Axis::A, Axis::B, Axis::C];

/// What a control does with coordinates; with violations, what can be read of it.
pub(super) fn coordinates_from_proto(
    violations: &mut Violations,
    settings: &proto::CoordinateSettings,
) -> CoordinateSettings {
    let field = |name: &str| format!("language.coordinates.{name}");
    let style = enumeration(violations, &field("style"), settings.style);
    let extended = settings.extended_systems.unwrap_or(*EXTENDED_SYSTEMS.start());
    if !EXTENDED_SYSTEMS.contains(&extended) {
        violations.add(field("extended_systems"), format!("must be 48 to 300, is {extended}"));
    }
    let letters = settings.roll_over_axes.to_ascii_uppercase();
    if let Some(letter) = letters.chars().find(|letter| !ROTARY.iter().any(|axis| axis.letter() == *letter)) {
        violations.add(field("roll_over_axes"), format!("must hold letters of A, B and C only, has {letter:?}"));
    }
    CoordinateSettings {
        style: match style.unwrap_or_default() {
            proto::CoordinateStyle::Haas => CoordinateStyle::Haas,
            proto::CoordinateStyle::Unspecified | proto::CoordinateStyle::Fanuc => CoordinateStyle::Fanuc,
        },
        extended_systems: u16::try_from(extended).unwrap_or(u16::MAX),
        local_of_one_system: settings.local_of_one_system,
        reference_cancels_local: settings.reference_cancels_local,
        geometry_by_tool: settings.geometry_by_tool,
        two_digit_tools: settings.two_digit_tools,
        length_of_tool: settings.length_of_tool,
        roll_over: ROTARY.map(|axis| letters.contains(axis.letter())),
        ..CoordinateSettings::default()
    }
}

pub(super) fn coordinates_to_proto(settings: &CoordinateSettings) -> proto::CoordinateSettings {
    let style = match settings.style {
        CoordinateStyle::Fanuc => proto::CoordinateStyle::Fanuc,
        CoordinateStyle::Haas => proto::CoordinateStyle::Haas,
    };
    proto::CoordinateSettings {
        style: style.into(),
        extended_systems: Some(settings.extended_systems.into()),
        local_of_one_system: settings.local_of_one_system,
        reference_cancels_local: settings.reference_cancels_local,
        geometry_by_tool: settings.geometry_by_tool,
        two_digit_tools: settings.two_digit_tools,
        length_of_tool: settings.length_of_tool,
        roll_over_axes: ROTARY.into_iter().filter(|axis| settings.rolls_over(*axis)).map(Axis::letter).collect(),
    }
}

/// Checks offsets.
pub fn check_offsets(violations: &mut Violations, prefix: &str, offsets: &proto::Offsets) {
    let field = |name: String| if prefix.is_empty() { name } else { format!("{prefix}.{name}") };
    if let Some(external) = &offsets.external {
        check_position(violations, &field("external".to_owned()), external);
    }
    if offsets.work_offsets.len() > MOST_SYSTEMS {
        let count = offsets.work_offsets.len();
        violations.add(field("work_offsets".to_owned()), format!("must list at most {MOST_SYSTEMS}, lists {count}"));
        return;
    }
    let mut systems = BTreeSet::new();
    for (index, given) in offsets.work_offsets.iter().enumerate() {
        let field = |name: &str| field(format!("work_offsets[{index}].{name}"));
        match given.system.parse::<WorkSystem>() {
            Ok(system) if !systems.insert(system) => {
                violations.add(field("system"), format!("{system} is listed before"));
            }
            Ok(_) => {}
            Err(problem) => violations.add(field("system"), problem.to_string()),
        }
        check_position(violations, &field("offset"), &given.offset.unwrap_or_default());
        if !(-360.0..=360.0).contains(&given.rotation_deg) {
            violations.add(field("rotation_deg"), format!("must be -360 to 360, is {}", given.rotation_deg));
        }
    }
    let mut numbers = BTreeSet::new();
    for (index, given) in offsets.reference_positions.iter().enumerate() {
        let field = |name: &str| field(format!("reference_positions[{index}].{name}"));
        if !(1..=4).contains(&given.number) {
            violations.add(field("number"), format!("must be 1 to 4, is {}", given.number));
        } else if !numbers.insert(given.number) {
            violations.add(field("number"), format!("{} is listed before", given.number));
        }
        check_position(violations, &field("position"), &given.position.unwrap_or_default());
    }
    let mut parameters = Violations::default();
    parameters_from_proto(&mut parameters, &field("parameters".to_owned()), &offsets.parameters);
    violations.extend("", parameters);
}

fn check_position(violations: &mut Violations, field: &str, position: &proto::AxisPosition) {
    let position: Position = position_from_proto(position);
    for axis in Axis::ALL {
        let value = position[axis.index()];
        if !value.is_finite() {
            violations
                .add(format!("{field}.{}", axis.letter().to_ascii_lowercase()), format!("must be finite, is {value}"));
        }
    }
}

/// Puts offsets in place of those of a language, value by value. They must have been checked; what is wrong has no effect.
pub(super) fn apply_offsets(offsets: &proto::Offsets, language: &mut LanguageSettings) {
    if let Some(external) = &offsets.external {
        language.coordinates.external_offset = position_from_proto(external);
    }
    for given in &offsets.work_offsets {
        let Ok(system) = given.system.parse::<WorkSystem>() else { continue };
        let offset = given.offset.as_ref().map(position_from_proto).unwrap_or_default();
        language.coordinates.systems.insert(system, WorkOffset { offset, rotation_deg: given.rotation_deg });
    }
    for given in &offsets.reference_positions {
        let position = given.position.as_ref().map(position_from_proto).unwrap_or_default();
        match given.number {
            1 => language.reference_position = position,
            number => {
                let place = (number as usize).wrapping_sub(2);
                if let Some(more) = language.coordinates.more_reference_positions.get_mut(place) {
                    *more = Some(position);
                }
            }
        }
    }
    let InitialParameters { numbered, named } =
        parameters_from_proto(&mut Violations::default(), "parameters", &offsets.parameters);
    language.parameters.numbered.extend(numbered);
    language.parameters.named.extend(named);
}

/// Offsets beside those that have fields of their own; nothing where there are none.
pub(super) fn offsets_to_proto(language: &LanguageSettings) -> Option<proto::Offsets> {
    let coordinates = &language.coordinates;
    let more = coordinates.more_reference_positions.iter().zip(2..);
    let offsets = proto::Offsets {
        external: (coordinates.external_offset != Position::default())
            .then(|| position_to_proto(&coordinates.external_offset)),
        work_offsets: coordinates.systems.iter().map(|(system, place)| work_offset(*system, place)).collect(),
        reference_positions: more
            .filter_map(|(position, number)| {
                let position = Some(position_to_proto(position.as_ref()?));
                Some(proto::ReferencePosition { number, position })
            })
            .collect(),
        parameters: parameters_to_proto(&InitialParameters::default()),
    };
    (offsets != proto::Offsets::default()).then_some(offsets)
}

/// The offsets that a program found set; nothing where there were none.
pub(super) fn initial_offsets_to_proto(offsets: &InitialOffsets) -> Option<proto::Offsets> {
    let references = offsets.references.iter();
    let offsets = proto::Offsets {
        external: offsets.external.as_ref().map(position_to_proto),
        work_offsets: offsets.systems.iter().map(|(system, place)| work_offset(*system, place)).collect(),
        reference_positions: references
            .map(|&(number, position)| proto::ReferencePosition {
                number,
                position: Some(position_to_proto(&position)),
            })
            .collect(),
        parameters: Vec::new(),
    };
    (offsets != proto::Offsets::default()).then_some(offsets)
}

fn work_offset(system: WorkSystem, place: &WorkOffset) -> proto::WorkOffset {
    proto::WorkOffset {
        system: system.to_string(),
        offset: Some(position_to_proto(&place.offset)),
        rotation_deg: place.rotation_deg,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64) -> Option<proto::AxisPosition> {
        Some(proto::AxisPosition { x, ..Default::default() })
    }

    fn offsets() -> proto::Offsets {
        let offset = |system: &str, x, rotation_deg| proto::WorkOffset {
            system: system.to_owned(),
            offset: at(x),
            rotation_deg,
        };
        proto::Offsets {
            external: at(1.0),
            work_offsets: vec![offset("G55", 2.0, 0.0), offset("G54.1 P7", 3.0, 0.0)],
            reference_positions: vec![proto::ReferencePosition { number: 3, position: at(4.0) }],
            parameters: Vec::new(),
        }
    }

    #[test]
    fn offsets_take_the_place_of_the_machines_one_by_one() {
        let mut violations = Violations::default();
        check_offsets(&mut violations, "offsets", &offsets());
        assert!(violations.is_empty(), "{violations:?}");
        let mut language = LanguageSettings::mill();
        language.work_offsets[0][0] = 9.0;
        apply_offsets(&offsets(), &mut language);
        assert_eq!((language.work_offsets[0][0], language.coordinates.external_offset[0]), (9.0, 1.0));
        assert_eq!(language.coordinates.more_reference_positions[1].map(|at| at[0]), Some(4.0));
        assert_eq!(offsets_to_proto(&language), Some(offsets()));
        assert_eq!(language.initial_offset()[0], 10.0);
        let one = proto::ParameterValue { parameter: "5221".to_owned(), value: 20.0 };
        apply_offsets(&proto::Offsets { parameters: vec![one], ..Default::default() }, &mut language);
        assert_eq!(language.initial_offset()[0], 21.0);
    }

    #[test]
    fn every_bad_field_is_named() {
        let mut bad = offsets();
        bad.external = at(f64::NAN);
        bad.work_offsets[1].system = "g 55".to_owned();
        bad.work_offsets[0].rotation_deg = 400.0;
        bad.work_offsets.push(proto::WorkOffset { system: "G60".to_owned(), ..Default::default() });
        bad.reference_positions.push(proto::ReferencePosition { number: 5, position: None });
        bad.reference_positions.push(proto::ReferencePosition { number: 3, position: at(f64::INFINITY) });
        bad.parameters.push(proto::ParameterValue { parameter: "x".to_owned(), value: 1.0 });
        let mut violations = Violations::default();
        check_offsets(&mut violations, "offsets", &bad);
        let fields: Vec<_> = violations.as_slice().iter().map(|violation| violation.field.as_str()).collect();
        let expected = [
            "offsets.external.x",
            "offsets.work_offsets[0].rotation_deg",
            "offsets.work_offsets[1].system",
            "offsets.work_offsets[2].system",
            "offsets.reference_positions[1].number",
            "offsets.reference_positions[2].number",
            "offsets.reference_positions[2].position.x",
            "offsets.parameters[0].parameter",
        ];
        assert_eq!(fields, expected);
    }

    #[test]
    fn settings_come_back() {
        let settings = proto::CoordinateSettings {
            style: proto::CoordinateStyle::Haas.into(),
            extended_systems: Some(300),
            geometry_by_tool: true,
            roll_over_axes: "AC".to_owned(),
            ..Default::default()
        };
        let mut violations = Violations::default();
        assert_eq!(coordinates_to_proto(&coordinates_from_proto(&mut violations, &settings)), settings);
        assert!(violations.is_empty());
        let bad = proto::CoordinateSettings {
            extended_systems: Some(1),
            roll_over_axes: "X".to_owned(),
            style: 9,
            ..Default::default()
        };
        coordinates_from_proto(&mut violations, &bad);
        assert_eq!(violations.as_slice().len(), 3);
    }
}
