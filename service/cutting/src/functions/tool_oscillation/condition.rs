//! How the tool is to oscillate, and the named conditions a machine keeps ("accuracy", "speed").

use serde::{Deserialize, Serialize};

use super::{ConditionTable, Engagement, MAX_EDGES, TableQuantity, ToolGeometry, Waveform};

/// Most conditions kept.
pub const MAX_CONDITIONS: usize = 64;
/// Most tools that a condition names.
pub const MAX_CONDITION_TOOLS: usize = 256;
/// Most tables of a condition: one for each [`TableQuantity`].
pub const MAX_CONDITION_TABLES: usize = 4;
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
        let steps = self.steps_after(parts, cutting_s);
        let edges = u64::from(edges.max(1));
        let index = (u64::from(self.edge.max(1)) - 1 + steps % edges) % edges;
        u32::try_from(index).map_or(1, |index| index + 1)
    }

    /// How often the roles have changed after so many finished parts and so much cutting time, s.
    #[must_use]
    pub fn steps_after(&self, parts: u64, cutting_s: f64) -> u64 {
        match self.rotation {
            RoleRotation::EveryParts(every) if every > 0 => parts / u64::from(every),
            RoleRotation::EverySeconds(every_s) if every_s > 0.0 => (cutting_s / every_s).max(0.0) as u64,
            _ => 0,
        }
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
    /// Where the work is around the tool; decides nothing but what is said about the edges.
    #[serde(default)]
    pub engagement: Engagement,
}

impl OscillationCondition {
    /// [`OscillationCondition::ramp_periods`] by default.
    pub const RAMP_PERIODS: u32 = 2;
}

const fn default_ramp_periods() -> u32 {
    OscillationCondition::RAMP_PERIODS
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

/// By what a condition is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConditionChoice<'a> {
    /// Its number, in the program.
    Number(u32),
    /// Its name, in the request.
    Name(&'a str),
}

/// The condition that is chosen for a tool: one that names the tool, else one for every tool.
#[must_use]
pub fn find_condition<'a>(
    conditions: &'a [NamedCondition],
    choice: ConditionChoice<'_>,
    tool: u32,
) -> Option<&'a NamedCondition> {
    let is_chosen = |condition: &&NamedCondition| match choice {
        ConditionChoice::Number(number) => condition.number == number,
        ConditionChoice::Name(name) => condition.name == name,
    };
    let for_tool = conditions.iter().filter(is_chosen).find(|condition| condition.tools.contains(&tool));
    for_tool.or_else(|| conditions.iter().filter(is_chosen).find(|condition| condition.tools.is_empty()))
}

/// Number of periods per revolution nearest to `wanted` that divides the number of edges.
#[must_use]
pub fn nearest_periods_per_rev(tool: &ToolGeometry, wanted: f64) -> u32 {
    let edges = tool.edge_count().clamp(1, MAX_EDGES as u32);
    let divides = |periods: &u32| edges.is_multiple_of(*periods);
    let distance = |periods: u32| (f64::from(periods) - wanted).abs();
    (1..=edges).filter(divides).min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(1)
}
