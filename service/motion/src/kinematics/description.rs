//! The description of a five-axis machine as data, and its validation field by field.

use feedwave_program::Axis;
use serde::{Deserialize, Serialize};

use super::chain::LEAST_VOLUME;
use super::vector::{Vec3, angle, cross, dot, unit};
use crate::machine::ProfileProblem;

/// Axes of a chain: three linear and two rotary ones.
pub(super) const CHAIN_AXES: usize = 5;
/// Largest coordinate of a point and largest linear range, mm: beyond it a double no longer resolves 1e-10 mm.
const MAX_LENGTH_MM: f64 = 1e5;
/// Largest rotary range, degrees: a hundred turns of a cable-fed axis.
const MAX_RANGE_DEG: f64 = 36_000.0;
/// Smallest angle between the two rotary axes, and between the second one and the tool, rad (0.06°): with less the
/// second axis does not tilt the tool.
const LEAST_TILT_RAD: f64 = 1e-3;
/// What a commanded angle of a rotary axis means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wrap {
    /// Angles count on beyond a turn: 370° is a turn and 10°, and is approached from wherever the axis is.
    #[default]
    Counting,
    /// Angles repeat every turn: 370° is 10°, and an absolute one is approached by the shortest path.
    Rollover,
}

/// Which of the two inverse solutions a cut starts with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BranchPreference {
    /// The one that is nearest to where the rotary axes are.
    #[default]
    Nearest,
    /// The one with the larger angle of the second rotary axis within (−180°, 180°].
    Larger,
    /// The one with the smaller angle of the second rotary axis within (−180°, 180°].
    Smaller,
}

/// One axis of the chain: the motion of all on its tool side relative to all on its work side.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChainAxis {
    /// The program letter, which also says whether the axis is linear or rotary.
    pub axis: Axis,
    /// Direction of a linear axis, or of a rotary axis' line of rotation (right-handed), with all axes at zero; any
    /// length but zero. It need not be parallel to a coordinate axis.
    pub direction: Vec3,
    /// A point on a rotary axis' line of rotation with all axes at zero, mm; without meaning for a linear axis.
    #[serde(default)]
    pub point_mm: Vec3,
    /// Smallest and largest value, mm or degrees; without one the axis is unlimited (rotary: continuous).
    #[serde(default)]
    pub range: Option<[f64; 2]>,
    /// What commanded angles mean; without meaning for a linear axis.
    #[serde(default)]
    pub wrap: Wrap,
}

/// A machine with three linear and two rotary axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KinematicsDescription {
    /// The axes in order from the workpiece to the tool, whichever parts are at rest: a table-table machine is
    /// `C A X Y Z`, a head-table machine `C X Y Z B`, a head-head machine `X Y Z C A`.
    pub chain: Vec<ChainAxis>,
    /// Where the gauge point of the spindle (from which tool lengths count) is with all axes at zero, mm from the origin
    /// that [`ChainAxis::point_mm`] counts from: any fixed point, since only the distances between them matter.
    pub gauge_point_mm: Vec3,
    /// Tool direction, from the tip to the spindle, with all axes at zero; any length but zero.
    pub tool_direction: Vec3,
    /// Which of the two inverse solutions a cut starts with.
    #[serde(default)]
    pub preferred_branch: BranchPreference,
}

/// Places of the axes of a kind in the chain.
pub(super) fn places(chain: &[ChainAxis], rotary: bool) -> Vec<usize> {
    (0..chain.len()).filter(|&index| chain[index].axis.is_rotary() == rotary).collect()
}

fn point_problem(point: Vec3) -> Option<String> {
    let fine = point.iter().all(|value| value.abs() <= MAX_LENGTH_MM);
    (!fine).then(|| format!("must be three numbers of at most {MAX_LENGTH_MM} mm, is {point:?}"))
}

fn direction_problem(direction: Vec3) -> Option<String> {
    unit(direction).is_none().then(|| format!("must be three numbers that are not all zero, is {direction:?}"))
}

impl KinematicsDescription {
    /// Everything that makes the description unusable, by field; empty when it is valid.
    #[must_use]
    pub fn validate(&self) -> Vec<ProfileProblem> {
        let mut problems = Vec::new();
        let mut add = |field: String, message: Option<String>| {
            problems.extend(message.map(|message| ProfileProblem { field, message }));
        };
        add("gauge_point_mm".to_owned(), point_problem(self.gauge_point_mm));
        add("tool_direction".to_owned(), direction_problem(self.tool_direction));
        // A chain that is too long says enough; its axes are checked up to the length of a valid one.
        for (index, axis) in self.chain.iter().take(CHAIN_AXES).enumerate() {
            let field = |name: &str| format!("chain[{index}].{name}");
            let twin = self.chain[..index].iter().position(|other| other.axis == axis.axis);
            add(field("axis"), twin.map(|twin| format!("{:?} is already the axis of chain[{twin}]", axis.axis)));
            add(field("direction"), direction_problem(axis.direction));
            add(field("point_mm"), point_problem(axis.point_mm));
            add(field("range"), axis.range_problem());
            let rollover_in_range = axis.axis.is_rotary() && axis.wrap == Wrap::Rollover && axis.range.is_some();
            let message = "rollover is for continuous axes: take the range away, or let the angles count".to_owned();
            add(field("wrap"), rollover_in_range.then_some(message));
        }
        let (linear, rotary) = (places(&self.chain, false), places(&self.chain, true));
        if linear.len() != 3 || rotary.len() != 2 {
            let message = format!("must have 3 linear and 2 rotary axes, has {} and {}", linear.len(), rotary.len());
            add("chain".to_owned(), Some(message));
        } else if problems.is_empty() {
            self.add_geometry_problems(&linear, &rotary, &mut problems);
        }
        problems
    }

    /// What only the directions together show. All of them are known to be vectors.
    fn add_geometry_problems(&self, linear: &[usize], rotary: &[usize], problems: &mut Vec<ProfileProblem>) {
        let direction = |index: usize| unit(self.chain[index].direction).unwrap_or_default();
        let between = |a: Vec3, b: Vec3| {
            let angle = angle(a, b);
            angle.min(std::f64::consts::PI - angle)
        };
        let [x, y, z] = [direction(linear[0]), direction(linear[1]), direction(linear[2])];
        let volume = dot(x, cross(y, z)).abs();
        if volume < LEAST_VOLUME {
            let message = format!("the linear axes span no space: the volume of their directions is {volume:.6}");
            problems.push(ProfileProblem { field: "chain".to_owned(), message });
        }
        let (first, second) = (direction(rotary[0]), direction(rotary[1]));
        if between(first, second) < LEAST_TILT_RAD {
            let field = format!("chain[{}].direction", rotary[1]);
            let message = format!("is parallel to the rotary axis chain[{}]", rotary[0]);
            problems.push(ProfileProblem { field, message });
        }
        if between(second, unit(self.tool_direction).unwrap_or_default()) < LEAST_TILT_RAD {
            let message = format!("is parallel to the rotary axis chain[{}], which cannot tilt it", rotary[1]);
            problems.push(ProfileProblem { field: "tool_direction".to_owned(), message });
        }
    }
}

impl ChainAxis {
    fn range_problem(&self) -> Option<String> {
        let [low, high] = self.range?;
        let (bound, unit) = if self.axis.is_rotary() { (MAX_RANGE_DEG, "degrees") } else { (MAX_LENGTH_MM, "mm") };
        let fine = low < high && low.abs() <= bound && high.abs() <= bound;
        (!fine).then(|| format!("must rise from one number of at most {bound} {unit} to another, is {low} to {high}"))
    }
}
