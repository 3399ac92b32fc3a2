//! What a job asks of the oscillations of its program.

use feedwave_motion::ProfileProblem;
use serde::{Deserialize, Serialize};

use super::NamedCondition;

/// Most parts and longest cutting time, s, before a part: far beyond the life of any machine, and exact in an `f64`.
const MAX_BEFORE: f64 = 1e12;

/// What a job asks of the oscillations of its program; the same request replays to the bit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OscillationRequest {
    /// Name of the condition that all oscillations of the program run with, whatever condition the program chooses by
    /// number; none: as the program says.
    pub condition: Option<String>,
    /// Parts that were finished before this one: decides which edge leads where the roles rotate over parts.
    pub parts_before: u64,
    /// Oscillating cutting time before this part, s: decides which edge leads where the roles rotate over time.
    pub cutting_time_before_s: f64,
}

impl OscillationRequest {
    /// What makes the request unusable on a machine with these conditions, each with its field.
    #[must_use]
    pub fn problems(&self, conditions: &[NamedCondition]) -> Vec<ProfileProblem> {
        let mut problems = Vec::new();
        let mut problem = |field: &str, message| problems.push(ProfileProblem { field: field.to_owned(), message });
        if let Some(name) = &self.condition
            && !conditions.iter().any(|condition| condition.name == *name)
        {
            problem("condition", format!("{name:?} is no condition of this machine: {}", known_names(conditions)));
        }
        if self.parts_before as f64 > MAX_BEFORE {
            problem("parts_before", format!("must be at most {MAX_BEFORE}, is {}", self.parts_before));
        }
        // NaN is refused as well.
        if !(0.0..=MAX_BEFORE).contains(&self.cutting_time_before_s) {
            let message = format!("must be 0 to {MAX_BEFORE} s, is {}", self.cutting_time_before_s);
            problem("cutting_time_before_s", message);
        }
        problems
    }
}

/// The conditions that there are, for people.
pub(crate) fn known_names(conditions: &[NamedCondition]) -> String {
    if conditions.is_empty() {
        return "it has none".to_owned();
    }
    let known: Vec<String> = conditions.iter().map(|named| format!("P{} {}", named.number, named.name)).collect();
    format!("it has {}", known.join(", "))
}
