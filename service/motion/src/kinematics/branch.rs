//! The choice of the inverse solution for a whole cut: looked at ahead, so that it never flips inside.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::chain::{Kinematics, KinematicsError, Setup, ToolPose};
use super::inverse::way;
use super::range::nearest_turn;
use super::vector::Vec3;

/// Most turns of an axis that are tried as the start of a cut, each way from where it stands.
const TRIED_TURNS: i32 = 4;

/// Where the rotary axes start a cut, and how they fare.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CutStart {
    /// Values of the rotary axes at the first direction, rad.
    pub start_rad: [f64; 2],
    /// Values at the last direction, rad.
    pub end_rad: [f64; 2],
    /// Most that a rotary axis turns from one direction to the next, rad.
    pub largest_step_rad: f64,
    /// The direction (counted from 0) at whose end that step is.
    pub largest_step_at: u64,
    /// Directions in a pole, where the first rotary axis is left where it stands.
    pub singular: u64,
    /// Smallest distance from a pole, rad.
    pub least_pole_distance_rad: f64,
}

/// Why a cut cannot be made in one go.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("at direction {at} of the cut: {reason}")]
pub struct CutFailure {
    /// The direction (counted from 0) at which the last start ran out of its ranges, or which cannot be reached. A cut
    /// that ends before it can be made.
    pub at: u64,
    /// What stands in the way there.
    pub reason: KinematicsError,
}

impl Kinematics {
    /// Chooses where the rotary axes (now at `reference_rad`) start a cut through directions in work coordinates, so that
    /// they can follow it to its end without a jump and within their ranges. Each start (two branches, with the turns that
    /// the ranges allow) is followed along the great circles from direction to direction, as [`Kinematics::elements`] does; of those that reach the end the one that the
    /// profile prefers is taken, and among those the nearest. A cut that starts in a pole is prepared for the first direction
    /// outside it, since the first axis is free until then. Memory does not grow with the cut.
    ///
    /// # Errors
    ///
    /// [`CutFailure`]; where the ranges stand in the way, the start that got furthest says where.
    pub fn choose_start(
        &self,
        directions: impl IntoIterator<Item = Vec3>,
        setup: &Setup,
        reference_rad: [f64; 2],
    ) -> Result<CutStart, CutFailure> {
        self.choose_start_within(directions, setup, reference_rad, 0.0)
    }

    /// [`Kinematics::choose_start`] where great circles may be bent through a pole within a tolerance; see
    /// [`super::FiveAxisBlock::pole_tolerance_rad`].
    ///
    /// # Errors
    ///
    /// [`CutFailure`], as there.
    pub fn choose_start_within(
        &self,
        directions: impl IntoIterator<Item = Vec3>,
        setup: &Setup,
        reference_rad: [f64; 2],
        pole_tolerance_rad: f64,
    ) -> Result<CutStart, CutFailure> {
        let mut before = None;
        let mut alive: Vec<CutStart> = Vec::new();
        let mut poles = 0_u64;
        let mut pole_second = None;
        let mut failure = None;
        for (at, direction) in directions.into_iter().enumerate() {
            let at = at as u64;
            let direction = setup.to_chain(&ToolPose { tip_mm: [0.0; 3], direction }).direction;
            let solution = self.solve_direction(direction).map_err(|reason| CutFailure { at, reason })?;
            let from = before.replace(direction).unwrap_or(direction);
            if alive.is_empty() {
                if solution.singular {
                    poles += 1;
                    pole_second = Some(solution.branches_rad[0][1]);
                    continue;
                }
                for branch in solution.branches_rad {
                    self.add_starts(&mut alive, branch, reference_rad);
                }
                for start in &mut alive {
                    start.singular = poles;
                    start.least_pole_distance_rad = if poles > 0 { 0.0 } else { solution.pole_distance_rad };
                    if let Some(second) = pole_second {
                        // Begin in the pole, with the first axis ready for what follows.
                        start.start_rad[1] = nearest_turn(second, start.start_rad[1]);
                        start.largest_step_rad = way(start.end_rad, start.start_rad);
                        start.largest_step_at = at;
                    }
                }
                alive.retain(|start| self.excess_of(start.start_rad).is_none());
                if alive.is_empty() {
                    let reason = self.nearest_rotary(direction, reference_rad).err();
                    let reason = reason.unwrap_or(KinematicsError::Degenerate);
                    return Err(CutFailure { at, reason });
                }
                continue;
            }
            alive.retain_mut(|start| {
                let followed = self.followed([from, direction], pole_tolerance_rad, start.end_rad);
                let next = match followed {
                    Ok(next) => next.unwrap_or_else(|| self.continued(&solution, start.end_rad)),
                    Err(reason) => {
                        failure = Some(CutFailure { at, reason });
                        return false;
                    }
                };
                let step = way(next, start.end_rad);
                if step > start.largest_step_rad {
                    (start.largest_step_rad, start.largest_step_at) = (step, at);
                }
                start.singular += u64::from(solution.singular);
                start.least_pole_distance_rad = start.least_pole_distance_rad.min(solution.pole_distance_rad);
                start.end_rad = next;
                self.excess_of(next).is_none_or(|reason| {
                    failure = Some(CutFailure { at, reason });
                    false
                })
            });
            if let (true, Some(failure)) = (alive.is_empty(), failure) {
                return Err(failure);
            }
        }
        if alive.is_empty() {
            // Nothing but a pole: the first axis stays.
            let start_rad = [reference_rad[0], nearest_turn(pole_second.unwrap_or(reference_rad[1]), reference_rad[1])];
            if let Some(reason) = self.excess_of(start_rad) {
                return Err(CutFailure { at: 0, reason });
            }
            let (largest_step_rad, largest_step_at, least_pole_distance_rad) = (0.0, 0, 0.0);
            let end_rad = start_rad;
            let singular = poles;
            let start =
                CutStart { start_rad, end_rad, largest_step_rad, largest_step_at, singular, least_pole_distance_rad };
            return Ok(start);
        }
        let better = |best: CutStart, start: CutStart| {
            let (a, b) = (start.start_rad, best.start_rad);
            let nearer = !self.prefers(b, a) && way(a, reference_rad) < way(b, reference_rad);
            if self.prefers(a, b) || nearer { start } else { best }
        };
        let first = alive[0];
        Ok(alive.into_iter().fold(first, better))
    }

    /// The rotary values within range that a branch has, near `reference_rad`.
    fn add_starts(&self, alive: &mut Vec<CutStart>, branch_rad: [f64; 2], reference_rad: [f64; 2]) {
        let values = |axis: usize| {
            let nearest = nearest_turn(branch_rad[axis], reference_rad[axis]);
            let joint = &self.joints[self.rotary[axis]];
            // An unlimited axis never runs out: its nearest value is as good as any.
            let turns = if joint.range.is_some() { TRIED_TURNS } else { 0 };
            (-turns..=turns)
                .map(move |turn| nearest + std::f64::consts::TAU * f64::from(turn))
                .filter(|&value| joint.excess(value) == 0.0)
        };
        for first in values(0) {
            for second in values(1) {
                let start_rad = [first, second];
                alive.push(CutStart {
                    start_rad,
                    end_rad: start_rad,
                    largest_step_rad: 0.0,
                    largest_step_at: 0,
                    singular: 0,
                    least_pole_distance_rad: 0.0,
                });
            }
        }
    }

    /// Why rotary values are not allowed.
    pub(super) fn excess_of(&self, rotary_rad: [f64; 2]) -> Option<KinematicsError> {
        self.rotary.iter().zip(rotary_rad).find_map(|(&index, value)| {
            let joint = &self.joints[index];
            let excess_rad = joint.excess(value);
            (excess_rad > 0.0).then_some(KinematicsError::OutOfRange { axis: joint.axis, excess_rad })
        })
    }
}
