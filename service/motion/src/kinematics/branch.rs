//! The choice of the inverse solution for a whole cut, by looking ahead, so that it never flips inside.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::chain::{Kinematics, KinematicsError, Setup, ToolPose};
use super::description::BranchPreference;
use super::direction::GreatCircle;
use super::inverse::travel;
use super::range::nearest_turn;
use super::vector::Vec3;

/// Most turns of an axis that are tried as the start of a cut, in each direction from where it is.
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
    /// Directions in a pole, where the first rotary axis is left where it is.
    pub singular: u64,
    /// Smallest distance from a pole, rad.
    pub least_pole_distance_rad: f64,
}

/// Why a cut cannot be made in one go.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("at direction {at} of the cut: {reason}")]
pub struct CutFailure {
    /// Where the rotary axes would have started, rad.
    pub start_rad: [f64; 2],
    /// The direction (counted from 0) at which the start ran out of its ranges, or which cannot be reached. A cut
    /// that ends before it can be made.
    pub at: u64,
    /// What prevents it there.
    pub reason: KinematicsError,
}

/// A start on trial.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Trial {
    start: CutStart,
    /// Which of the two inverse solutions it starts in.
    solution: usize,
}

/// The search for a start from which the rotary axes can follow a cut to its end, without a jump and within their
/// ranges. Directions are given one after the other; memory does not grow with them.
///
/// Every start (two inverse solutions, with the turns that the ranges allow) is followed along the great circles from
/// direction to direction, as [`Kinematics::elements`] does. A cut that starts in a pole is prepared for the first direction
/// outside it, since the first axis is free until then.
#[derive(Clone, Debug, PartialEq)]
pub struct CutSearch {
    setup: Setup,
    reference_rad: [f64; 2],
    pole_tolerance_rad: f64,
    /// The direction before, chain coordinates.
    before: Option<Vec3>,
    count: u64,
    alive: Vec<Trial>,
    /// The starts of either solution that got furthest before they failed.
    failed: [Option<CutFailure>; 2],
    /// A direction that no start can reach.
    unreachable: Option<CutFailure>,
    poles: u64,
    /// The second axis in the pole in which the cut starts, rad.
    pole_second: Option<f64>,
}

impl CutSearch {
    /// A search for rotary axes at `reference_rad`. Great circles are bent through a pole within the tolerance;
    /// see [`super::FiveAxisBlock::pole_tolerance_rad`].
    #[must_use]
    pub const fn new(setup: Setup, reference_rad: [f64; 2], pole_tolerance_rad: f64) -> Self {
        Self {
            setup,
            reference_rad,
            pole_tolerance_rad,
            before: None,
            count: 0,
            alive: Vec::new(),
            failed: [None; 2],
            unreachable: None,
            poles: 0,
            pole_second: None,
        }
    }

    /// Directions given so far.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// Starts that have got here; none while every direction so far was in a pole, and once all have failed.
    #[must_use]
    pub fn alive(&self) -> usize {
        self.alive.len()
    }

    /// The furthest failures of starts in either solution (the one with the larger second angle first), so far.
    #[must_use]
    pub const fn failed(&self) -> &[Option<CutFailure>; 2] {
        &self.failed
    }

    /// Whether nothing can be made of the cut whatever follows.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.unreachable.is_some() || (self.alive.is_empty() && self.failed.iter().any(Option::is_some))
    }

    /// The next direction of the cut, a unit vector in work coordinates.
    pub fn push(&mut self, kinematics: &Kinematics, direction: Vec3) {
        if self.has_failed() {
            return;
        }
        let at = self.count;
        self.count += 1;
        let direction = self.setup.to_chain(&ToolPose { tip_mm: [0.0; 3], direction }).direction;
        let solution = match kinematics.solve_direction(direction) {
            Ok(solution) => solution,
            Err(reason) => {
                let start_rad = self.alive.first().map_or(self.reference_rad, |trial| trial.start.start_rad);
                self.unreachable = Some(CutFailure { start_rad, at, reason });
                return;
            }
        };
        let from = self.before.replace(direction);
        if self.alive.is_empty() {
            if solution.singular {
                self.poles += 1;
                self.pole_second = Some(solution.branches_rad[0][1]);
                return;
            }
            for (branch, values_rad) in solution.branches_rad.into_iter().enumerate() {
                self.add_starts(kinematics, branch, values_rad, at, solution.pole_distance_rad);
            }
            return;
        }
        let from = from.unwrap_or(direction);
        let is_opposite = GreatCircle::new(from, direction).is_err();
        let (failed, tolerance_rad) = (&mut self.failed, self.pole_tolerance_rad);
        self.alive.retain_mut(|Trial { start, solution: branch }| {
            let next = if is_opposite {
                let next = kinematics.continued(&solution, start.end_rad);
                kinematics.excess_of(next).map_or(Ok(next), Err)
            } else {
                kinematics.followed([from, direction], tolerance_rad, start.end_rad)
            };
            let next = match next {
                Ok(next) => next,
                Err(reason) => {
                    failed[*branch] = Some(CutFailure { start_rad: start.start_rad, at, reason });
                    return false;
                }
            };
            let step = travel(next, start.end_rad);
            if step > start.largest_step_rad {
                (start.largest_step_rad, start.largest_step_at) = (step, at);
            }
            start.singular += u64::from(solution.singular);
            start.least_pole_distance_rad = start.least_pole_distance_rad.min(solution.pole_distance_rad);
            start.end_rad = next;
            true
        });
    }

    /// Begins the trial of the values within range that a solution has, near where the axes are.
    fn add_starts(
        &mut self,
        kinematics: &Kinematics,
        branch: usize,
        values_rad: [f64; 2],
        at: u64,
        pole_distance_rad: f64,
    ) {
        let candidates = |axis: usize| {
            let nearest = nearest_turn(values_rad[axis], self.reference_rad[axis]);
            // An unlimited axis never runs out: its nearest value is as good as any.
            let turns = if kinematics.joints[kinematics.rotary[axis]].range.is_some() { TRIED_TURNS } else { 0 };
            (-turns..=turns).map(move |turn| nearest + core::f64::consts::TAU * f64::from(turn))
        };
        let mut nearest_failure: Option<CutFailure> = None;
        let mut any = false;
        for first in candidates(0) {
            for second in candidates(1) {
                let end_rad = [first, second];
                let mut start = CutStart {
                    start_rad: end_rad,
                    end_rad,
                    largest_step_rad: 0.0,
                    largest_step_at: 0,
                    singular: self.poles,
                    least_pole_distance_rad: if self.poles > 0 { 0.0 } else { pole_distance_rad },
                };
                if let Some(second) = self.pole_second {
                    // Begin in the pole, with the first axis ready for what follows.
                    start.start_rad[1] = nearest_turn(second, end_rad[1]);
                    (start.largest_step_rad, start.largest_step_at) = (travel(end_rad, start.start_rad), at);
                }
                let excess = kinematics.excess_of(end_rad).or_else(|| kinematics.excess_of(start.start_rad));
                let Some(reason) = excess else {
                    any = true;
                    self.alive.push(Trial { start, solution: branch });
                    continue;
                };
                let less = nearest_failure.is_none_or(|nearest| reason.excess_rad() < nearest.reason.excess_rad());
                if less {
                    nearest_failure = Some(CutFailure { start_rad: start.start_rad, at, reason });
                }
            }
        }
        if !any {
            self.failed[branch] = nearest_failure;
        }
    }

    /// The start to take: of those that got to the last direction the one that is preferred, and among those the nearest.
    ///
    /// # Errors
    ///
    /// [`CutFailure`] of the start that got furthest.
    pub fn chosen(&self, kinematics: &Kinematics, preferred: BranchPreference) -> Result<CutStart, CutFailure> {
        if let Some(failure) = self.unreachable {
            return Err(failure);
        }
        let better = |best: CutStart, start: CutStart| {
            let (a, b) = (start.start_rad, best.start_rad);
            let nearer = travel(a, self.reference_rad) < travel(b, self.reference_rad);
            if preferred.prefers(a, b) || (nearer && !preferred.prefers(b, a)) { start } else { best }
        };
        if let Some(start) = self.alive.iter().map(|trial| trial.start).reduce(better) {
            return Ok(start);
        }
        let further = |best: CutFailure, failure: CutFailure| {
            let less = failure.at == best.at && failure.reason.excess_rad() < best.reason.excess_rad();
            if failure.at > best.at || less { failure } else { best }
        };
        if let Some(failure) = self.failed.into_iter().flatten().reduce(further) {
            return Err(failure);
        }
        // Nothing but a pole: the first axis stays.
        let second = self.pole_second.unwrap_or(self.reference_rad[1]);
        let start_rad = [self.reference_rad[0], nearest_turn(second, self.reference_rad[1])];
        if let Some(reason) = kinematics.excess_of(start_rad) {
            return Err(CutFailure { start_rad, at: 0, reason });
        }
        Ok(CutStart {
            start_rad,
            end_rad: start_rad,
            largest_step_rad: 0.0,
            largest_step_at: 0,
            singular: self.poles,
            least_pole_distance_rad: 0.0,
        })
    }
}

impl Kinematics {
    /// Chooses where the rotary axes (now at `reference_rad`) start a cut through directions in work coordinates; see
    /// [`CutSearch`]. Of the starts that reach the end the one that the profile prefers is taken, and among those the nearest.
    ///
    /// # Errors
    ///
    /// [`CutFailure`]; where the ranges prevent it, the start that got furthest says where.
    pub fn choose_start(
        &self,
        directions: impl IntoIterator<Item = Vec3>,
        setup: &Setup,
        reference_rad: [f64; 2],
    ) -> Result<CutStart, CutFailure> {
        let mut search = CutSearch::new(*setup, reference_rad, 0.0);
        for direction in directions {
            search.push(self, direction);
        }
        search.chosen(self, self.preferred)
    }

    /// Why rotary values are not allowed.
    pub(super) fn excess_of(&self, rotary_rad: [f64; 2]) -> Option<KinematicsError> {
        self.rotary.iter().zip(rotary_rad).find_map(|(&index, value)| self.joints[index].refusal(value))
    }
}
