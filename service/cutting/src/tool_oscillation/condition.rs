//! How the tool is to oscillate, and the named conditions a machine keeps ("accuracy", "speed").

use feedwave_motion::ProfileProblem;
use serde::{Deserialize, Serialize};

use super::curve::monotone_value;
use super::{MAX_EDGES, ToolGeometry, Waveform};
use crate::MAX_AMPLITUDE_MM;

/// Most conditions kept.
pub const MAX_CONDITIONS: usize = 64;
/// Most points of a condition table along each of its two directions.
pub const MAX_TABLE_POINTS: usize = 32;
/// Most periods over which the oscillation is blended in and out.
pub const MAX_RAMP_PERIODS: u32 = 100;

/// The period of the oscillation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OscillationPeriod {
    /// 1/M of a revolution; the value is M.
    PerRevolution(u32),
    /// A time, s: it has to be 1/M of a revolution at the speed in force.
    Seconds(f64),
}

/// Oscillation in one direction: amplitude·wave(τ + phase).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DirectionOscillation {
    /// Half the peak-to-peak travel, mm.
    pub amplitude_mm: f64,
    /// The waveform.
    pub waveform: Waveform,
    /// By how much it runs ahead of the oscillation's phase, degrees of the period.
    #[serde(default)]
    pub phase_deg: f64,
}

/// Which edge points in the feed direction when.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LeadingEdge {
    /// The edge, counted from 1 in the order of the tool data.
    pub edge: u32,
    /// Phase of the oscillation at which it points in the feed direction, degrees.
    pub phase_deg: f64,
    /// How the edges change roles, so that they wear alike.
    pub rotation: RoleRotation,
}

/// How the edges change roles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoleRotation {
    /// They keep them.
    #[default]
    Fixed,
    /// The next edge leads after this many parts.
    EveryParts(u32),
    /// The next edge leads after this cutting time, s; it changes between sections only.
    EverySeconds(f64),
}

impl Default for LeadingEdge {
    fn default() -> Self {
        Self { edge: 1, phase_deg: 0.0, rotation: RoleRotation::Fixed }
    }
}

impl LeadingEdge {
    /// The edge that leads after so many finished parts and so much cutting time, counted from 1: the same wherever and
    /// whenever it is asked for.
    #[must_use]
    pub fn edge_after(&self, parts: u64, cutting_s: f64, edges: u32) -> u32 {
        let steps = match self.rotation {
            RoleRotation::EveryParts(every) if every > 0 => parts / u64::from(every),
            RoleRotation::EverySeconds(every_s) if every_s > 0.0 => (cutting_s / every_s).max(0.0) as u64,
            _ => 0,
        };
        let edges = u64::from(edges.max(1));
        let index = (u64::from(self.edge.max(1)) - 1 + steps % edges) % edges;
        u32::try_from(index).map_or(1, |index| index + 1)
    }
}

/// How the tool oscillates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OscillationCondition {
    /// The period.
    pub period: OscillationPeriod,
    /// Along the feed direction, positive forwards.
    pub feed: DirectionOscillation,
    /// Along the tool axis, positive **retracted** from the work. A protrusion is the negative of it.
    pub axial: DirectionOscillation,
    /// Across both, along feed direction × tool axis: to the right of the feed, seen from the spindle.
    #[serde(default)]
    pub cross: Option<DirectionOscillation>,
    /// Which edge points in the feed direction when.
    #[serde(default)]
    pub leading_edge: LeadingEdge,
    /// The oscillation is blended in and out over the feed of this many periods, 1 to [`MAX_RAMP_PERIODS`], or of more
    /// where the tool would leave the section otherwise.
    #[serde(default = "default_ramp_periods")]
    pub ramp_periods: u32,
    /// Whether the tool may pass the ends of the section in the feed direction for the sake of a short blend.
    #[serde(default)]
    pub may_overrun: bool,
}

const fn default_ramp_periods() -> u32 {
    2
}

/// A quantity of a condition that a table decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TableQuantity {
    /// Amplitude in the feed direction, mm.
    FeedAmplitude,
    /// Axial amplitude, mm.
    AxialAmplitude,
    /// Amplitude across, mm.
    CrossAmplitude,
    /// Hold share of the axial waveform, where it is a held peak.
    AxialHoldShare,
}

/// How a table is read between its points. Beyond its ends the value at the end holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Straight between neighbours.
    #[default]
    Linear,
    /// By a monotone cubic: smooth, without overshoot.
    Monotone,
}

/// A quantity over feed and spindle speed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConditionTable {
    /// What it decides.
    pub quantity: TableQuantity,
    /// How it is read between its points.
    #[serde(default)]
    pub interpolation: Interpolation,
    /// Feeds, mm/min, strictly increasing: 1 to [`MAX_TABLE_POINTS`].
    pub feed_mm_per_min: Vec<f64>,
    /// Spindle speeds, rev/min, strictly increasing: 1 to [`MAX_TABLE_POINTS`].
    pub spindle_rev_per_min: Vec<f64>,
    /// The values: for each spindle speed those at every feed.
    pub values: Vec<Vec<f64>>,
}

impl ConditionTable {
    /// What makes the table unusable, if anything.
    #[must_use]
    pub fn problem(&self) -> Option<&'static str> {
        let increases = |axis: &[f64]| {
            (1..=MAX_TABLE_POINTS).contains(&axis.len())
                && axis.iter().all(|value| value.is_finite())
                && axis.windows(2).all(|pair| pair[0] < pair[1])
        };
        if !increases(&self.feed_mm_per_min) || !increases(&self.spindle_rev_per_min) {
            return Some("a table has 1 to 32 strictly increasing feeds and spindle speeds");
        }
        let is_whole = self.values.len() == self.spindle_rev_per_min.len()
            && self.values.iter().all(|row| row.len() == self.feed_mm_per_min.len());
        let is_finite = self.values.iter().flatten().all(|value| value.is_finite());
        (!(is_whole && is_finite)).then_some("a table has a finite value for every feed at every spindle speed")
    }

    /// The value at a feed and a spindle speed; beyond the ends that at the end.
    #[must_use]
    pub fn value(&self, feed_mm_per_min: f64, spindle_rev_per_min: f64) -> f64 {
        let read = |abscissae: &[f64], values: &[f64], x: f64| match self.interpolation {
            Interpolation::Linear => linear_value(abscissae, values, x),
            Interpolation::Monotone => monotone_value(abscissae, values, x),
        };
        let column: Vec<f64> =
            self.values.iter().map(|row| read(&self.feed_mm_per_min, row, feed_mm_per_min)).collect();
        read(&self.spindle_rev_per_min, &column, spindle_rev_per_min)
    }
}

fn linear_value(abscissae: &[f64], values: &[f64], x: f64) -> f64 {
    let count = abscissae.len().min(values.len());
    let Some(last) = count.checked_sub(1) else { return 0.0 };
    let after = abscissae[..count].partition_point(|&start| start <= x);
    if after == 0 {
        return values[0];
    }
    if after > last {
        return values[last];
    }
    let share = (x - abscissae[after - 1]) / (abscissae[after] - abscissae[after - 1]);
    values[after - 1] + share * (values[after] - values[after - 1])
}

/// A condition with a name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedCondition {
    /// Its name, such as `accuracy`.
    pub name: String,
    /// Number by which a program chooses it.
    pub number: u32,
    /// Tools it is for; none for every tool that no other condition of this number names.
    #[serde(default)]
    pub tools: Vec<u32>,
    /// The condition.
    pub condition: OscillationCondition,
    /// Quantities that depend on feed and spindle speed; they take the place of those in the condition.
    #[serde(default)]
    pub tables: Vec<ConditionTable>,
}

impl NamedCondition {
    /// The condition at a feed and a spindle speed.
    #[must_use]
    pub fn at(&self, feed_mm_per_min: f64, spindle_rev_per_min: f64) -> OscillationCondition {
        let mut condition = self.condition.clone();
        for table in &self.tables {
            let value = table.value(feed_mm_per_min, spindle_rev_per_min);
            match table.quantity {
                TableQuantity::FeedAmplitude => condition.feed.amplitude_mm = value,
                TableQuantity::AxialAmplitude => condition.axial.amplitude_mm = value,
                TableQuantity::CrossAmplitude => {
                    if let Some(cross) = &mut condition.cross {
                        cross.amplitude_mm = value;
                    }
                }
                TableQuantity::AxialHoldShare => {
                    if let Waveform::HeldPeak { hold_share } | Waveform::JerkLimitedHeldPeak { hold_share } =
                        &mut condition.axial.waveform
                    {
                        *hold_share = value;
                    }
                }
            }
        }
        condition
    }
}

/// The condition of this number for a tool: one that names the tool, else one for every tool.
#[must_use]
pub fn find_condition(conditions: &[NamedCondition], number: u32, tool: u32) -> Option<&NamedCondition> {
    let of_number = |condition: &&NamedCondition| condition.number == number;
    let for_tool = conditions.iter().filter(of_number).find(|condition| condition.tools.contains(&tool));
    for_tool.or_else(|| conditions.iter().filter(of_number).find(|condition| condition.tools.is_empty()))
}

/// What makes a machine's conditions unusable, each with the path of the field in the profile.
#[must_use]
pub fn condition_problems(conditions: &[NamedCondition]) -> Vec<ProfileProblem> {
    let mut problems = Vec::new();
    let mut problem = |field: String, message: String| problems.push(ProfileProblem { field, message });
    if conditions.len() > MAX_CONDITIONS {
        problem(
            "tool_oscillation".to_owned(),
            format!("has {} conditions, at most {MAX_CONDITIONS}", conditions.len()),
        );
    }
    for (index, named) in conditions.iter().enumerate() {
        let field = format!("tool_oscillation[{index}]");
        let same_tools = |other: &NamedCondition| {
            other.number == named.number
                && (other.tools.iter().any(|tool| named.tools.contains(tool))
                    || (other.tools.is_empty() && named.tools.is_empty()))
        };
        if conditions[..index].iter().any(same_tools) {
            problem(format!("{field}.number"), format!("{} is another condition's for the same tool", named.number));
        }
        let condition = &named.condition;
        match condition.period {
            OscillationPeriod::PerRevolution(0) => {
                problem(format!("{field}.condition.period"), "must be at least 1 per revolution, is 0".to_owned());
            }
            OscillationPeriod::Seconds(seconds) if !(1e-6..=1e3).contains(&seconds) => {
                problem(format!("{field}.condition.period"), format!("must be 0.000001 to 1000 s, is {seconds}"));
            }
            OscillationPeriod::PerRevolution(_) | OscillationPeriod::Seconds(_) => {}
        }
        if !(1..=MAX_RAMP_PERIODS).contains(&condition.ramp_periods) {
            let message = format!("must be 1 to {MAX_RAMP_PERIODS}, is {}", condition.ramp_periods);
            problem(format!("{field}.condition.ramp_periods"), message);
        }
        let leading = &condition.leading_edge;
        if !(1..=MAX_EDGES as u32).contains(&leading.edge) {
            let message = format!("must be 1 to {MAX_EDGES}, is {}", leading.edge);
            problem(format!("{field}.condition.leading_edge.edge"), message);
        }
        if !(-360.0..=360.0).contains(&leading.phase_deg) {
            let message = format!("must be within 360 degrees, is {}", leading.phase_deg);
            problem(format!("{field}.condition.leading_edge.phase_deg"), message);
        }
        let is_interval = match leading.rotation {
            RoleRotation::Fixed => true,
            RoleRotation::EveryParts(parts) => parts > 0,
            RoleRotation::EverySeconds(seconds) => seconds.is_finite() && seconds > 0.0,
        };
        if !is_interval {
            problem(format!("{field}.condition.leading_edge.rotation"), "must be positive and finite".to_owned());
        }
        let directions =
            [("feed", Some(&condition.feed)), ("axial", Some(&condition.axial)), ("cross", condition.cross.as_ref())];
        for (name, direction) in directions.iter().filter_map(|(name, direction)| Some((name, (*direction)?))) {
            if let Err(error) = direction.waveform.compile() {
                problem(format!("{field}.condition.{name}.waveform"), error.to_string());
            }
            if !(0.0..=MAX_AMPLITUDE_MM).contains(&direction.amplitude_mm) {
                let message = format!("must be 0 to {MAX_AMPLITUDE_MM} mm, is {}", direction.amplitude_mm);
                problem(format!("{field}.condition.{name}.amplitude_mm"), message);
            }
            if !(-360.0..=360.0).contains(&direction.phase_deg) {
                let message = format!("must be within 360 degrees, is {}", direction.phase_deg);
                problem(format!("{field}.condition.{name}.phase_deg"), message);
            }
        }
        for (place, table) in named.tables.iter().enumerate() {
            if let Some(message) = table.problem() {
                problem(format!("{field}.tables[{place}]"), message.to_owned());
            }
        }
    }
    problems
}

/// Number of periods per revolution nearest to `wanted` that divides the number of edges.
#[must_use]
pub fn nearest_periods_per_rev(tool: &ToolGeometry, wanted: f64) -> u32 {
    let edges = tool.edge_count().clamp(1, MAX_EDGES as u32);
    let divides = |periods: &u32| edges.is_multiple_of(*periods);
    let distance = |periods: u32| (f64::from(periods) - wanted).abs();
    (1..=edges).filter(divides).min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(1)
}
