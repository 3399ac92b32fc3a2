//! What makes a machine's conditions unusable.

use feedwave_motion::ProfileProblem;

use super::{
    LeadingEdge, MAX_CONDITION_TABLES, MAX_CONDITION_TOOLS, MAX_CONDITIONS, MAX_EDGES, MAX_RAMP_PERIODS,
    NamedCondition, OscillationCondition, OscillationPeriod, RoleRotation,
};
use crate::shared::track::MAX_AMPLITUDE_MM;

/// Problems of one condition.
struct Problems<'a> {
    /// Path of the condition.
    field: String,
    found: &'a mut Vec<ProfileProblem>,
}

impl Problems<'_> {
    fn add(&mut self, field: &str, message: impl Into<String>) {
        self.found.push(ProfileProblem { field: format!("{}.{field}", self.field), message: message.into() });
    }

    fn require<T: core::fmt::Display>(&mut self, holds: bool, field: &str, range: &str, value: T) {
        if !holds {
            self.add(field, format!("must be {range}, is {value}"));
        }
    }
}

/// What makes a machine's conditions unusable, each with the path of the field in the profile. More conditions than there
/// may be are one problem, and so are more tools or tables of one: what is checked is bounded.
#[must_use]
pub fn condition_problems(conditions: &[NamedCondition]) -> Vec<ProfileProblem> {
    let mut found = Vec::new();
    if conditions.len() > MAX_CONDITIONS {
        let message = format!("has {} conditions, at most {MAX_CONDITIONS}", conditions.len());
        return vec![ProfileProblem { field: "tool_oscillation".to_owned(), message }];
    }
    for (index, named) in conditions.iter().enumerate() {
        let mut problems = Problems { field: format!("tool_oscillation[{index}]"), found: &mut found };
        if named.tools.len() > MAX_CONDITION_TOOLS {
            problems.add("tools", format!("has {} tools, at most {MAX_CONDITION_TOOLS}", named.tools.len()));
            continue;
        }
        choice(named, &conditions[..index], &mut problems);
        condition(&named.condition, &mut problems);
        tables(named, &mut problems);
    }
    found
}

/// Whether number and name choose this condition and no earlier one.
fn choice(named: &NamedCondition, before: &[NamedCondition], problems: &mut Problems<'_>) {
    let for_same_tool = |other: &&NamedCondition| {
        let shares_one = other.tools.iter().any(|tool| named.tools.contains(tool));
        // A list that is too long was refused before.
        (shares_one && other.tools.len() <= MAX_CONDITION_TOOLS) || (other.tools.is_empty() && named.tools.is_empty())
    };
    if before.iter().filter(for_same_tool).any(|other| other.number == named.number) {
        problems.add("number", format!("{} is another condition's for the same tool", named.number));
    }
    if before.iter().filter(for_same_tool).any(|other| other.name == named.name) {
        problems.add("name", format!("{:?} is another condition's for the same tool", named.name));
    }
}

fn condition(condition: &OscillationCondition, problems: &mut Problems<'_>) {
    match condition.period {
        OscillationPeriod::PerRevolution(periods) => {
            problems.require(periods > 0, "periods_per_rev", "at least 1", periods);
        }
        OscillationPeriod::Seconds(seconds) => {
            let is_possible = (1e-6..=1e3).contains(&seconds);
            problems.require(is_possible, "period_s", "0.000001 to 1000", seconds);
        }
    }
    let is_possible = (1..=MAX_RAMP_PERIODS).contains(&condition.ramp_periods);
    let range = format!("1 to {MAX_RAMP_PERIODS}");
    problems.require(is_possible, "ramp_periods", &range, condition.ramp_periods);
    leading_edge(&condition.leading_edge, problems);
    if let Some(message) = condition.engagement.problem() {
        problems.add("engagement", message);
    }
    let directions =
        [("feed", Some(&condition.feed)), ("axial", Some(&condition.axial)), ("cross", condition.cross.as_ref())];
    for (name, direction) in directions.iter().filter_map(|(name, direction)| Some((name, (*direction)?))) {
        if let Err(error) = direction.waveform.compile() {
            problems.add(&format!("{name}.waveform"), error.to_string());
        }
        let (amplitude, phase) = (direction.amplitude_mm, direction.phase_deg);
        let range = format!("0 to {MAX_AMPLITUDE_MM} mm");
        let is_possible = (0.0..=MAX_AMPLITUDE_MM).contains(&amplitude);
        problems.require(is_possible, &format!("{name}.amplitude_mm"), &range, amplitude);
        let is_possible = (-360.0..=360.0).contains(&phase);
        problems.require(is_possible, &format!("{name}.phase_deg"), "within 360 degrees", phase);
    }
}

fn leading_edge(leading: &LeadingEdge, problems: &mut Problems<'_>) {
    let range = format!("1 to {MAX_EDGES}");
    let is_possible = (1..=MAX_EDGES as u32).contains(&leading.edge);
    problems.require(is_possible, "leading_edge.edge", &range, leading.edge);
    let is_possible = (-360.0..=360.0).contains(&leading.phase_deg);
    problems.require(is_possible, "leading_edge.phase_deg", "within 360 degrees", leading.phase_deg);
    let (field, interval) = match leading.rotation {
        RoleRotation::Fixed => return,
        RoleRotation::EveryParts(parts) => ("leading_edge.every_parts", f64::from(parts)),
        RoleRotation::EverySeconds(seconds) => ("leading_edge.every_s", seconds),
    };
    let is_possible = interval.is_finite() && interval > 0.0;
    problems.require(is_possible, field, "positive and finite", interval);
}

fn tables(named: &NamedCondition, problems: &mut Problems<'_>) {
    if named.tables.len() > MAX_CONDITION_TABLES {
        problems.add("tables", format!("has {} tables, at most {MAX_CONDITION_TABLES}", named.tables.len()));
        return;
    }
    for (place, table) in named.tables.iter().enumerate() {
        if let Some(message) = table.problem() {
            problems.add(&format!("tables[{place}]"), message);
        }
        if named.tables[..place].iter().any(|other| other.quantity == table.quantity) {
            problems.add(&format!("tables[{place}].quantity"), "is decided by another table already");
        }
    }
}
