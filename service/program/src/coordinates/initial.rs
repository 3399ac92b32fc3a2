//! The offsets that a program finds set.

use super::{WorkOffset, WorkSystem};
use crate::{InterpreterState, LanguageSettings, Position};

/// Offsets before the first block: of the profile, of the job, and of initial parameters that set them (`#5221`). What is zero is
/// left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InitialOffsets {
    /// The external work offset, added to every other one, mm (X a radius) and degrees.
    pub external: Option<Position>,
    /// Work coordinate systems, ascending.
    pub systems: Vec<(WorkSystem, WorkOffset)>,
    /// Reference positions by their numbers, 1 (`G28`) to 4 (`G30 P4`), machine coordinates.
    pub references: Vec<(u32, Position)>,
}

impl LanguageSettings {
    /// The offsets that a program finds set.
    #[must_use]
    pub fn initial_offsets(&self) -> InitialOffsets {
        let coords = InterpreterState::new(self).coords;
        let is_set = |position: &Position| *position != Position::default();
        let plain = (1..=9).filter_map(WorkSystem::plain);
        let all = plain.chain((1..=300).filter_map(WorkSystem::extended));
        let systems = all.map(|system| (system, coords.offset_of(system, self)));
        let references = coords.tables.reference.iter().zip(1..);
        InitialOffsets {
            external: Some(coords.external).filter(is_set),
            systems: systems.filter(|(_, place)| *place != WorkOffset::default()).collect(),
            references: references.filter_map(|(position, number)| Some((number, position.filter(is_set)?))).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64) -> Position {
        let mut position = Position::default();
        position[0] = x;
        position
    }

    #[test]
    fn offsets_of_profile_job_and_parameters_are_one_list() {
        let mut settings = LanguageSettings::mill();
        assert_eq!(settings.initial_offsets(), InitialOffsets::default());
        settings.work_offsets[1] = at(5.0);
        settings.reference_position = at(9.0);
        settings.coordinates.external_offset = at(-1.0);
        settings.coordinates.more_reference_positions[2] = Some(at(8.0));
        let seventh = WorkSystem::extended(7).unwrap();
        settings.coordinates.systems.insert(seventh, WorkOffset { offset: at(7.0), rotation_deg: 0.0 });
        settings.parameters.numbered.insert(5_261, 6.0);
        let found = settings.initial_offsets();
        assert_eq!(found.external, Some(at(-1.0)));
        let systems: Vec<_> = found.systems.iter().map(|(system, place)| (system.to_string(), place.offset)).collect();
        let expected = [("G55", 5.0), ("G56", 6.0), ("G54.1 P7", 7.0)].map(|(name, x)| (name.to_owned(), at(x)));
        assert_eq!(systems, expected);
        assert_eq!(found.references, [(1, at(9.0)), (4, at(8.0))]);
    }
}
