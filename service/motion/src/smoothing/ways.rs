//! Which way sharp corners are passed.
//!
//! One curve over several of them may turn so tightly that the path creeps along it, where it would have been faster to stop in them;
//! how long either takes depends on all of them, on the blocks between them, and on how fast the path is before and behind. So the
//! ways are tried: what is held of the path is smoothed and planned in each of them, from rest to rest with the pieces before it, and
//! the quickest is taken.
//!
//! Plans for the least time hardly ever stop between corners that near. They try curves over few blocks, and those most of whose corners
//! are sharp, against the corners each by itself and as U-turns ([`turn`](super::turn)); under tool centre point control all curves with
//! sharp corners. A sharp corner among many blocks is tried by itself, on the blocks round it. In plans of runs the corners behind those that
//! are decided are passed in the same way in the trial: on a path of many like corners each of them is judged among like ones. There the ends
//! of a fillet count as sharp corners too, where it is so short for the tolerance that the curve makes no difference between it and a corner.
//!
//! Corners between chords of an arc are not tried, however sharp they are: a path that is slow along the arc is slow in all of them.
//!
//! The interpolation period of trials is always the same, so that the path does not depend on that of the job.

use std::collections::vec_deque;

use serde::{Deserialize, Serialize};

use super::curve::Open;
use super::guided;
use super::joint::Joint;
use super::origin::turns_differ;
use super::turn::TURN_SEEN;
use super::{Carried, CornerSpeed, Entry, Joining, PathSmoother, Smoothed};
use crate::tolerance::{
    CHORDS_TRIED, CORNER_SHARE, CORNER_STOP_GAIN, FEW_STOPS_GAIN, LEAST_ALONE_KINK, LEAST_STOP_KINK, LIKE_TURN_SHARE,
    MOST_CHORD_KINK, MOST_MIXED, MOST_TRIED_BLOCKS, MOST_TRIED_IN_LEAST_TIME, MOST_TRIED_TOGETHER, TRAIL,
    TRIED_PERIOD_S, WAYS_SEEN,
};
use crate::{
    Element, LimitPiece, Machine, MotionRequest, PathMotion, Planned, Planner, PlannerSettings, Stretch, Stretches,
    limit_pieces,
};

/// How a corner is passed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Way {
    /// It is not decided.
    #[default]
    Open,
    /// In one curve with others, where they are near.
    Joined,
    /// By itself, rounded or with a stop.
    Alone,
    /// Rounded by itself.
    Rounded,
    /// The path stops in it.
    Stop,
    /// With the one beside it, as a U-turn.
    Turned,
}

/// What is tried, on how much of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Trials {
    usual: Way,
    others: &'static [Way],
    /// Most elements of what is held, and pieces before it.
    pub(super) elements: usize,
    pub(super) trail: usize,
    /// Whether the corners are tried in ways of their own.
    are_mixed: bool,
}

impl<T: Carried> PathSmoother<T> {
    /// Decides how the sharp corners of a curve are passed that has been begun, as soon as enough is known of the path behind it: whether
    /// another way than in that curve is quicker for one of them.
    pub(super) fn choose_ways(&mut self, open: &Open, is_last: bool, joining: Joining<'_>) -> Option<bool> {
        let steady = joining.corner_speed == CornerSpeed::Steady;
        let is_guided = self.is_guided();
        if self.is_trial {
            return Some(false);
        }
        let sharp = self.undecided(open.last, LEAST_STOP_KINK).len();
        if sharp == 0 {
            self.join_open_corners(open.last);
            return Some(false);
        }
        let usual = Way::Joined;
        let (seen, trials) = if steady || is_guided {
            let others: &'static [Way] = if steady { &[Way::Stop, Way::Alone] } else { &[Way::Alone] };
            (open.last + WAYS_SEEN, Trials { usual, others, elements: usize::MAX, trail: TRAIL, are_mixed: true })
        } else {
            let are_few = open.last > MOST_TRIED_IN_LEAST_TIME && 2 * sharp < open.last;
            if are_few {
                return Some(self.part_sharp_corners(open, joining));
            }
            if !open.is_at_its_start() {
                return Some(false);
            }
            let elements = open.last.min(MOST_TRIED_TOGETHER) + 2;
            let others = &[Way::Alone, Way::Turned];
            (elements - 1, Trials { usual, others, elements, trail: 1, are_mixed: false })
        };
        if self.pending.len() < seen && !is_last {
            return None;
        }
        // A trial that ended in a fillet would know half of its turn.
        let last = trials.elements.min(self.pending.len()) - 1;
        let ends_in_fillet = last > open.last && self.is_at_fillet(last - 1) && self.pending[last].turn_rad() > 0.0;
        let trials = Trials { elements: last + 1 - usize::from(ends_in_fillet), ..trials };
        let seen = seen.min(trials.elements - 1);
        let all = self.undecided(seen, LEAST_STOP_KINK);
        let tightest = if is_guided { self.tightest(&all) } else { Vec::new() };
        let sets = [(!is_guided || steady).then_some(all), Some(tightest)];
        let mut least_s = f64::INFINITY;
        let mut found = (Vec::new(), Vec::new());
        for corners in sets.into_iter().flatten() {
            let count = corners.partition_point(|&index| index < open.last);
            if count == 0 {
                continue;
            }
            let (mut ways, seconds) = self.answer(Some(open), &corners, count, trials, joining);
            ways.truncate(count);
            if seconds < least_s && ways.iter().any(|&way| way != usual) {
                (least_s, found) = (seconds, (corners, ways));
            }
        }
        self.set_ways(&found.0, &found.1);
        let are_joined = found.1.is_empty();
        self.join_open_corners(seen.min(open.last));
        Some(!are_joined)
    }

    /// Decides which of the few sharp corners among many blocks of a curve stand alone in a plan for the least time; whether there are any.
    ///
    /// A curve over blocks that hardly turn bends evenly round a sharp corner as well, where axes that brake and start at constant jerk may
    /// take less time, though they do it in less room.
    fn part_sharp_corners(&mut self, open: &Open, joining: Joining<'_>) -> bool {
        // The curve has been made over what lies before.
        let mut corners = self.undecided(open.last, LEAST_STOP_KINK);
        corners.retain(|&index| {
            let end_mm: f64 = self.pending.iter().take(index + 1).map(|entry| entry.element.length).sum();
            end_mm > open.made_mm()
        });
        let ways: Vec<_> = corners.iter().map(|&index| self.way_among_chords(index, joining)).collect();
        self.set_ways(&corners, &ways);
        ways.contains(&Way::Alone)
    }

    /// Whether a corner is passed in one curve with the blocks round it, as far as the next sharp corners, or alone.
    fn way_among_chords(&mut self, index: usize, joining: Joining<'_>) -> Way {
        let goes_on =
            |&joint: &usize| self.pending[joint].is_joinable() && self.pending[joint].joint.turn() < LEAST_STOP_KINK;
        let before = (0..index).rev().take(CHORDS_TRIED - 1).take_while(goes_on).count();
        let behind = (index + 1..self.pending.len()).take(CHORDS_TRIED - 1).take_while(goes_on).count();
        let pending = self.pending.iter().skip(index - before).take(before + behind + 2).cloned().collect();
        let held = Self { pending, is_trial: true, ..Self::default() };
        let (usual, others) = (Way::Joined, &[Way::Alone]);
        let trials = Trials { usual, others, elements: usize::MAX, trail: 0, are_mixed: false };
        let (ways, _) = self.answers.quickest(&held, None, (&[before], 1), trials, joining);
        ways[0]
    }

    /// Decides how the first corners are passed, of which the first is in no curve; whether more of the path has to be known for that.
    pub(super) fn waits_for_ways(&mut self, is_last: bool, joining: Joining<'_>) -> bool {
        let is_sharp = self.undecided(1, LEAST_ALONE_KINK).len() == 1;
        let may_be_tried = self.pending.iter().take(2).all(Entry::is_joinable);
        if self.is_trial || !is_sharp || !may_be_tried || joining.corner_speed != CornerSpeed::Steady {
            return false;
        }
        if self.pending.len() < WAYS_SEEN && !is_last {
            return true;
        }
        let corners = self.undecided(WAYS_SEEN, LEAST_ALONE_KINK);
        let (usual, others) = (Way::Alone, &[Way::Stop, Way::Rounded]);
        let trials = Trials { usual, others, elements: usize::MAX, trail: TRAIL, are_mixed: false };
        let (ways, _) = self.answer(None, &corners, 1, trials, joining);
        self.set_ways(&corners, &ways[..1]);
        false
    }

    /// The quickest ways found to pass the two corners of a U-turn.
    pub(super) fn quickest_turn(&mut self, corners: &[usize], joining: Joining<'_>) -> Vec<Way> {
        let others = &[Way::Alone, Way::Turned];
        let trials = Trials { usual: Way::Open, others, elements: TURN_SEEN, trail: 1, are_mixed: false };
        self.answer(None, corners, corners.len(), trials, joining).0
    }

    /// Whether the tool centre point is guided.
    fn is_guided(&self) -> bool {
        self.pending.front().is_some_and(Entry::is_guided)
    }

    /// The sharp corners among the first joints that may be passed in any way.
    fn open_corners(&self, joints: usize, least_kink: f64) -> impl Iterator<Item = (usize, &Entry<T>)> {
        let first = self.pending.iter().take(joints).take_while(|entry| entry.is_joinable()).enumerate();
        first.filter(move |&(index, entry)| match entry.joint {
            Joint::Corner { kink, way, .. } => way == Way::Open && (kink >= least_kink || self.is_at_fillet(index)),
            Joint::Unknown | Joint::Fixed => false,
        })
    }

    /// Whether a fillet that is as sharp as a corner begins or ends behind an element. In plans for the least time it is as fast in a curve.
    fn is_at_fillet(&self, index: usize) -> bool {
        let (Some(before), Some(after)) = (self.pending.get(index), self.pending.get(index + 1)) else { return false };
        let reach_mm = before.reach_mm().unwrap_or(0.0);
        let is_fillet = before.is_tight(after, reach_mm) || after.is_tight(before, reach_mm);
        is_fillet && before.corner_speed == CornerSpeed::Steady
    }

    /// Those of them that are to be tried: all but the ones between chords of an arc.
    fn undecided(&self, joints: usize, least_kink: f64) -> Vec<usize> {
        let open = self.open_corners(joints, least_kink);
        open.filter(|&(index, entry)| !self.is_in_arc(index, entry)).map(|(index, _)| index).collect()
    }

    /// Passes the corners among the first joints in the curve that are still open, also those between chords of an arc: when the blocks
    /// before them are gone, nothing tells any more that they are.
    fn join_open_corners(&mut self, joints: usize) {
        let corners: Vec<_> = self.open_corners(joints, LEAST_STOP_KINK).map(|(index, _)| index).collect();
        self.set_ways(&corners, &vec![Way::Joined; corners.len()]);
    }

    /// Whether a corner is one between chords of an arc, which is passed at one speed: between blocks that are short for what it reaches,
    /// the path turns as it does at the next corner or at the one before, and by little enough.
    fn is_in_arc(&self, index: usize, entry: &Entry<T>) -> bool {
        let Joint::Corner { kink, reach_mm, .. } = entry.joint else { return false };
        let is_short = |index: usize| self.pending.get(index).is_some_and(|entry| entry.full_length_mm <= reach_mm);
        let turns_alike = |first: usize| {
            let [Some(first), Some(second), Some(third)] =
                [first, first + 1, first + 2].map(|index| self.pending.get(index))
            else {
                return false;
            };
            turns_differ([first, second, third]) <= LIKE_TURN_SHARE
        };
        let may_be_chords = kink < MOST_CHORD_KINK && is_short(index) && is_short(index + 1);
        may_be_chords && (turns_alike(index) || index.checked_sub(1).is_some_and(turns_alike))
    }

    /// Those of these corners that stay sharp within their tolerances: of a tool that hardly turns otherwise for as long as the blocks
    /// beside them are, these leave nothing.
    fn tightest(&self, corners: &[usize]) -> Vec<usize> {
        let is_tight = |&index: &usize| {
            let (Some(before), Some(after)) = (self.pending.get(index), self.pending.get(index + 1)) else {
                return false;
            };
            let Joint::Corner { reach_mm, .. } = before.joint else { return false };
            reach_mm < CORNER_SHARE * before.full_length_mm.min(after.full_length_mm)
                || guided::tip_kink(&before.element, &after.element) >= LEAST_STOP_KINK
        };
        corners.iter().copied().filter(is_tight).collect()
    }

    /// The quickest ways found to pass these corners, of which `count` are to be decided: the first way, or others for all of them or for
    /// some; and the time of their plan, s, or what others would have had to take less than.
    pub(super) fn quickest(
        &self,
        open: Option<&Open>,
        corners: &[usize],
        count: usize,
        trials: &Trials,
        joining: Joining<'_>,
    ) -> (Vec<Way>, f64) {
        let usual = trials.usual;
        let mut ways = vec![usual; corners.len()];
        let mut seen = Vec::new();
        let trail = self.trail.range(self.trail.len().saturating_sub(trials.trail)..);
        let mut seconds =
            |ways: &[Way]| self.trial(open, corners, ways, trials.elements).seconds(trail.clone(), joining, &mut seen);
        let Some(usual_s) = seconds(&ways) else { return (ways, f64::INFINITY) };
        let are_few = !self.is_guided() && open.is_some_and(|open| corners.len() <= open.last / 2);
        let mut least_s = usual_s / if are_few { FEW_STOPS_GAIN } else { CORNER_STOP_GAIN };
        let mut times_s = Vec::new();
        for &way in trials.others {
            let Some(tried) = self.all_in(way, corners, joining) else { continue };
            let Some(seconds) = seconds(&tried) else { continue };
            // Rounded by itself may be a stop.
            if seconds == usual_s || times_s.iter().any(|&(_, other)| other == seconds) {
                continue;
            }
            times_s.push((way, seconds));
            if seconds < least_s {
                (least_s, ways) = (seconds, tried);
            }
        }
        times_s.push((usual, usual_s));
        times_s.retain(|&(_, seconds)| seconds < least_s * MOST_MIXED);
        // Chords of arcs as well: among many of them the path is slow in any way.
        let passed = self.pending.iter().take(corners[count - 1] + 1);
        let sharp = passed.filter(|entry| entry.joint.turn() >= LEAST_STOP_KINK).count();
        let is_much = count.max(sharp) * self.pending.len() > MOST_TRIED_BLOCKS;
        if !trials.are_mixed || corners.len() == 1 || times_s.len() == 1 || is_much {
            return (ways, least_s);
        }
        for index in 0..count {
            for &(way, _) in &times_s {
                let before = ways[index];
                if way == before {
                    continue;
                }
                ways[index] = way;
                match seconds(&ways).filter(|&seconds| seconds < least_s) {
                    Some(seconds) => least_s = seconds,
                    None => ways[index] = before,
                }
            }
        }
        (ways, least_s)
    }

    /// One way for all these corners; that of U-turns is taken where there are some, and the others alone.
    fn all_in(&self, way: Way, corners: &[usize], joining: Joining<'_>) -> Option<Vec<Way>> {
        if way != Way::Turned {
            return Some(vec![way; corners.len()]);
        }
        let mut ways = vec![Way::Alone; corners.len()];
        for k in 1..corners.len() {
            let is_pair = corners[k] == corners[k - 1] + 1 && ways[k - 1] != Way::Turned;
            if is_pair && self.u_turn(corners[k - 1], joining).is_some() {
                (ways[k - 1], ways[k]) = (Way::Turned, Way::Turned);
            }
        }
        ways.contains(&Way::Turned).then_some(ways)
    }

    pub(super) fn set_ways(&mut self, corners: &[usize], ways: &[Way]) {
        for (&index, &chosen) in corners.iter().zip(ways) {
            if let Joint::Corner { way, .. } = &mut self.pending[index].joint {
                *way = chosen;
            }
        }
    }

    /// What is held, at most so many elements, with these ways.
    fn trial(&self, open: Option<&Open>, corners: &[usize], ways: &[Way], elements: usize) -> Self {
        let passed = self.passed;
        let pending = self.pending.iter().take(elements).take_while(|entry| entry.is_joinable()).cloned().collect();
        let mut trial = Self { pending, passed, is_trial: true, ..Self::default() };
        trial.set_ways(corners, ways);
        if let Some(open) = open {
            trial.resume(open.clone());
        }
        trial
    }

    /// Time of a plan of all that is held and of pieces before it, from rest to rest, s; `None` where limits leave nothing.
    fn seconds(
        mut self,
        trail: vec_deque::Iter<'_, Smoothed<T>>,
        joining: Joining<'_>,
        seen: &mut Vec<MotionRequest>,
    ) -> Option<f64> {
        let mut smoothed = Vec::new();
        self.advance(true, joining, &mut |part| smoothed.push(part));
        let pieces = trail.chain(&smoothed);
        planned_s(pieces.map(|piece| (&piece.element, &piece.carried, piece.rest_at_end)), joining, seen)
    }
}

/// Time of a plan of these pieces from rest to rest, each with whether the path rests at its end, s; `None` where limits leave nothing.
pub(super) fn planned_s<'a, T: Carried + 'a>(
    pieces: impl IntoIterator<Item = (&'a Element, &'a T, bool)>,
    joining: Joining<'_>,
    seen: &mut Vec<MotionRequest>,
) -> Option<f64> {
    let settings = PlannerSettings::new(joining.machine, usize::MAX, TRIED_PERIOD_S);
    let mut planner = Planner::<()>::new(match joining.corner_speed {
        CornerSpeed::Steady => settings,
        CornerSpeed::Changing => settings.for_least_time(joining.machine),
    });
    for (element, carried, rest_at_end) in pieces {
        let mut request = request(element, carried, joining.machine, seen)?;
        request.rest_at_end = rest_at_end;
        planner.push_motion(request);
    }
    planner.finish();
    let mut total_s = 0.0;
    while let Some(Planned::Motion(motion)) = planner.pop() {
        total_s += motion.stretches.iter().map(|stretch| stretch.profile.duration()).sum::<f64>();
    }
    Some(total_s)
}

/// What the planner is asked for, which is kept for further trials: most pieces are the same in several.
fn request<T: Carried>(
    element: &Element,
    carried: &T,
    machine: &Machine,
    seen: &mut Vec<MotionRequest>,
) -> Option<MotionRequest> {
    let speed_mm_per_s = carried.commanded_mm_per_s(element, machine);
    let is_same = |other: &&MotionRequest| {
        other.element == *element && other.stretches.first().is_some_and(|first| first.speed_mm_per_s == speed_mm_per_s)
    };
    if let Some(same) = seen.iter().rev().find(is_same) {
        return Some(same.clone());
    }
    let pieces = limit_pieces(element, machine, PathMotion::ZERO, 2.0 * speed_mm_per_s).ok()?;
    let stretch =
        |&LimitPiece { end, limits }: &LimitPiece| Stretch { end, speed_mm_per_s, spindle_rev_per_s: 0.0, limits };
    let stretches: Stretches = pieces.iter().map(stretch).collect();
    let request = MotionRequest::new(element.clone(), stretches);
    seen.push(request.clone());
    Some(request)
}

#[cfg(test)]
mod tests;
