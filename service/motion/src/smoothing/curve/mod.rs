//! One curve over many blocks.
//!
//! Where the corners of a path lie so close together that each leaves no room for the next, they are not rounded one by
//! one: the elements between two places that lie on long elements become one curve, a smoothing spline (see [`fit`])
//! with the position, direction and curvature of the programmed path at both ends. Its parts are given on block by block. Under tool centre
//! point control the rotary axes are further coordinates of it, and the linear axes follow.
//!
//! The curve is made in windows of at most [`CURVE_KNOTS`] knots and [`CURVE_BLOCKS`] blocks. A window ends on the path in the
//! middle of its last element; what lies in its first part is settled, and the next window goes on from there with the same
//! position and first two derivatives. Should the next one not keep the tolerance, the rest of the window before is run,
//! which does. A first window that fails leaves its first corner to be rounded by itself.

mod bezier;
mod fit;
mod parts;
mod path;
mod place;

use serde::{Deserialize, Serialize};

use self::bezier::{Span, State};
use self::fit::Fit;
use self::parts::Settled;
use self::path::Path;
use self::place::{GUIDED, LINEAR, exact};
use super::joint::Joint;
use super::origin::Origin;
use super::ways::Way;
use super::{Carried, CornerSpeed, Entry, Joining, PathSmoother, Smoothed};
use crate::Curve;
use crate::tolerance::{
    ALONE_SHARE, CORNER_SHARE, CURVE_BLOCKS, CURVE_KNOTS, CURVE_LINK_SHARE, CURVE_MOST_END_MM, CURVE_RAMP_LINK_SHARE,
    CURVE_SETTLED_SHARE, LEAST_CURVE_TOLERANCE_MM, LEAST_STOP_KINK, LIKE_SHARE, TANGENT_TOLERANCE_RAD,
};

/// A curve in progress: its first element is the first that is held.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Open {
    /// Where it goes on, at the start of the first element.
    start: State,
    /// The last element that certainly belongs to it.
    pub(super) last: usize,
    /// What the window before has fitted beyond the start; empty where the curve starts on the path.
    rest: Vec<Span>,
    /// Elements with which the next window is tried.
    next_try: usize,
}

impl Open {
    /// The same that starts on another element, at its start, where it starts so.
    pub(super) fn on<T>(&self, front: &Entry<T>) -> Option<Self> {
        let start = State { is_free: self.start.is_free, ..exact(&front.element, 0.0) };
        self.is_at_its_start().then_some(Self { start, rest: Vec::new(), last: self.last, next_try: self.next_try })
    }

    /// Up to where the window before has made it, from the start of the first element, mm.
    pub(super) fn made_mm(&self) -> f64 {
        self.rest.last().map_or(0.0, |span| span.to)
    }

    /// Whether nothing of it is settled.
    pub(super) fn is_at_its_start(&self) -> bool {
        self.rest.is_empty()
    }
}

/// Where what is settled ends.
#[derive(Clone, Copy)]
pub(super) enum Ending {
    /// On the curve, at this arc length of the programmed path.
    Within(f64),
    /// On the programmed path, so far from the start of an element.
    OnPath { leg: usize, offset_mm: f64 },
}

/// Where a window ends on the programmed path.
#[derive(Clone, Copy)]
struct Window {
    leg: usize,
    offset_mm: f64,
    /// Whether the curve ends there.
    is_whole: bool,
}

impl Window {
    fn ending(self) -> Ending {
        Ending::OnPath { leg: self.leg, offset_mm: self.offset_mm }
    }
}

impl<T: Carried> Entry<T> {
    /// Whether it can be part of a curve over many blocks.
    pub(super) fn is_joinable(&self) -> bool {
        let is_own_kind = match self.element.curve {
            Curve::Line | Curve::Arc(_) => true,
            Curve::FiveAxis(_) => self.is_smoothable() && !self.is_turn(),
            Curve::Spline(_) => false,
        };
        self.joins && is_own_kind
    }

    /// Largest part of the reaches of the corners before and behind `next` that it may be long to be part of one curve over both.
    fn link_share(&self, next: &Self) -> f64 {
        let is_tangent = |entry: &Self| entry.joint.kink().is_some_and(|kink| kink <= TANGENT_TOLERANCE_RAD);
        let are_ramps = is_tangent(self) && is_tangent(next);
        if are_ramps && self.corner_speed == CornerSpeed::Steady { CURVE_RAMP_LINK_SHARE } else { CURVE_LINK_SHARE }
    }

    /// Angle that it turns, rad.
    pub(super) fn turn_rad(&self) -> f64 {
        match &self.element.curve {
            Curve::Arc(arc) => arc.sweep_rad.abs(),
            _ => 0.0,
        }
    }

    /// Whether it is a fillet that is as sharp as a corner, seen from a joint to an element beside it that reaches this far, mm.
    pub(super) fn is_tight(&self, beside: &Self, reach_mm: f64) -> bool {
        let stands_out = self.turn_rad() * beside.element.length >= 2.0 * beside.turn_rad() * self.element.length;
        stands_out && self.turn_rad() >= LEAST_STOP_KINK && self.full_length_mm <= reach_mm
    }

    pub(super) fn reach_mm(&self) -> Option<f64> {
        match self.joint {
            Joint::Corner { reach_mm, .. } => Some(reach_mm),
            Joint::Unknown | Joint::Fixed => None,
        }
    }
}

impl<T: Carried> PathSmoother<T> {
    /// Whether the curve over the corner before an element goes on over the corner behind it; `None` until that is known.
    pub(super) fn goes_on_over(&self, index: usize, is_last: bool) -> Option<bool> {
        let (before, entry) = (&self.pending[index - 1], &self.pending[index]);
        let reach_mm = before.reach_mm().filter(|&reach_mm| reach_mm > 0.0);
        let (true, Some(reach_mm)) = (before.is_joinable() && entry.is_joinable(), reach_mm) else {
            return Some(false);
        };
        let is_wide = before.corner_tolerance_mm().is_some_and(|tolerance_mm| tolerance_mm >= LEAST_CURVE_TOLERANCE_MM);
        let is_alike = entry.control == before.control && is_wide;
        let is_alone = [before, entry].iter().any(|entry| matches!(entry.joint.way(), Way::Alone | Way::Rounded));
        let is_far = entry.full_length_mm >= CURVE_LINK_SHARE * (reach_mm + CURVE_MOST_END_MM);
        if !is_alike || is_far || is_alone {
            return Some(false);
        }
        match (self.pending.get(index + 1), entry.reach_mm()) {
            (None, _) => is_last.then_some(false),
            (Some(next), Some(next_reach_mm)) if next.is_joinable() && next_reach_mm > 0.0 => {
                let is_near = entry.full_length_mm < before.link_share(entry) * (reach_mm + next_reach_mm);
                if is_near { self.stops_behind(index, is_last).map(|stops| !stops) } else { Some(false) }
            }
            _ => Some(false),
        }
    }

    /// Whether the path is to stop at the end of an element; `None` until that is known.
    ///
    /// Other turns within the reach of a corner are smoothed out together with it, and between corners that are near to each other a
    /// path that stops in them never becomes fast, so that it has to stand alone. Between two elements that are too long for a curve
    /// over many, it is judged by their lengths when it is rounded.
    pub(super) fn stops_behind(&self, index: usize, is_last: bool) -> Option<bool> {
        let before = &self.pending[index];
        let Joint::Corner { reach_mm, kink, stop_from_mm, way, .. } = before.joint else { return Some(false) };
        if way != Way::Open {
            return Some(way == Way::Stop);
        }
        let is_long = |entry: &Entry<T>| entry.full_length_mm >= CURVE_LINK_SHARE * (reach_mm + CURVE_MOST_END_MM);
        let are_long = is_long(before) && self.pending.get(index + 1).is_some_and(is_long);
        if are_long || stop_from_mm.is_infinite() {
            return Some(false);
        }
        let is_like = |other: f64| other >= LIKE_SHARE * kink;
        let within =
            |entry: &Entry<T>, left_mm: f64| entry.turn_rad() * (left_mm / entry.element.length).clamp(0.0, 1.0);
        let (mut distance_mm, mut others_rad) = (0.0, 0.0);
        for index in (0..=index).rev() {
            let entry = &self.pending[index];
            others_rad += within(entry, reach_mm - distance_mm);
            distance_mm += entry.element.length;
            let other = match index.checked_sub(1) {
                Some(before) => self.pending[before].joint.turn(),
                None => {
                    distance_mm += self.passed.distance_mm;
                    self.passed.kink
                }
            };
            if distance_mm >= stop_from_mm {
                break;
            }
            if is_like(other) {
                return Some(false);
            }
            others_rad += if distance_mm < reach_mm { other } else { 0.0 };
        }
        distance_mm = 0.0;
        for (seen, entry) in self.pending.iter().skip(index + 1).enumerate() {
            others_rad += within(entry, reach_mm - distance_mm);
            distance_mm += entry.element.length;
            if distance_mm >= stop_from_mm {
                break;
            }
            if matches!(entry.joint, Joint::Unknown) {
                if is_last || seen >= CURVE_BLOCKS {
                    break;
                }
                return None;
            }
            let other = entry.joint.turn();
            if is_like(other) {
                return Some(false);
            }
            others_rad += if distance_mm < reach_mm { other } else { 0.0 };
        }
        Some(others_rad <= ALONE_SHARE * kink)
    }

    /// Starts a curve within the first element, or at its start.
    pub(super) fn open_curve(&mut self, emit: &mut impl FnMut(Smoothed<T>)) {
        let Some(front) = self.pending.front_mut() else { return };
        let length = front.element.length;
        let most_cut_mm = if front.start_is_cut { CORNER_SHARE * front.full_length_mm } else { length };
        let cut_mm = front.reach_mm().unwrap_or(0.0).min(most_cut_mm);
        if cut_mm < (1.0 - 2.0 * (0.5 - CORNER_SHARE)) * length
            && let (Some(before), Some(after)) =
                (front.element.part(0.0, length - cut_mm), front.element.part(length - cut_mm, length))
        {
            let (carried, deviation) = (front.carried.clone(), front.merged.behind(0.0, before.length));
            front.merged = front.merged.behind(before.length, after.length);
            self.passed.distance_mm += before.length;
            let (blocks, rest_at_end, origin) = (0, false, Origin::Block);
            front.element = after;
            self.give(Smoothed { element: before, carried, blocks, rest_at_end, origin, deviation }, emit);
        }
        let Some(front) = self.pending.front() else { return };
        let is_free = !front.start_is_cut && front.element.length >= front.full_length_mm;
        let start = State { is_free, ..exact(&front.element, 0.0) };
        self.open = Some(Open { start, last: 1, rest: Vec::new(), next_try: 2 });
    }

    /// Goes on with a curve whose corners are to be passed in other ways than they were.
    pub(super) fn resume(&mut self, mut open: Open) {
        let is_in = self.pending.front().is_some_and(|front| matches!(front.joint.way(), Way::Open | Way::Joined));
        debug_assert!(is_in || open.rest.is_empty(), "it goes on beside the path");
        (open.last, open.next_try) = (1, 2);
        self.open = is_in.then_some(open);
    }

    /// Gives on what of the curve is settled; whether there was anything to do.
    pub(super) fn advance_curve(
        &mut self,
        is_last: bool,
        joining: Joining<'_>,
        emit: &mut impl FnMut(Smoothed<T>),
    ) -> bool {
        let Some(mut open) = self.open.take() else { return false };
        let ends = self.extend(&mut open, is_last);
        if open.last == 0 {
            // Nothing but the rest of its last element, which is on the path.
            return true;
        }
        if !ends && self.pending.len() < open.next_try {
            self.open = Some(open);
            return false;
        }
        let path = self.path(open.last, joining);
        let knots = path.knots(path.length(), CURVE_KNOTS, 1.0);
        let is_full = knots.len() >= CURVE_KNOTS || self.pending.len() >= CURVE_BLOCKS;
        if !ends && !is_full {
            let count = self.pending.len();
            open.next_try = (count + 4).max(count * CURVE_KNOTS / knots.len() * 9 / 10).min(CURVE_BLOCKS);
            self.open = Some(open);
            return false;
        }
        match self.choose_ways(&open, is_last || !ends, joining) {
            Some(false) => {}
            Some(true) => {
                self.resume(open);
                return true;
            }
            None => {
                self.open = Some(open);
                return false;
            }
        }
        let path = self.path(open.last, joining);
        let window = self.window(&path, open.last, &knots, ends);
        let found = self.fit(&path, &open, window, joining);
        match found.or_else(|| self.rest_of_before(&path, &open, joining)) {
            Some((settled, rest)) => self.go_on(open, settled, rest, window.is_whole, emit),
            None => self.round_front(joining, emit),
        }
        true
    }

    /// Takes the next elements into the curve as long as it goes on over them; whether its last one is known.
    fn extend(&self, open: &mut Open, is_last: bool) -> bool {
        while open.last > 0 {
            match self.goes_on_over(open.last, is_last) {
                Some(true) => open.last += 1,
                Some(false) => return true,
                None => return false,
            }
        }
        true
    }

    /// Where the window over the elements up to `last` ends, which has these knots: where the curve does, if that is known and
    /// near, or in the middle of an element.
    fn window(&self, path: &Path<'_>, last: usize, knots: &[[f64; 2]], ends: bool) -> Window {
        let whole = Window { leg: last, offset_mm: self.end_offset_mm(last), is_whole: true };
        let [last_knot, _] = knots[knots.len() - 1];
        let leg = path.leg_at(last_knot).min(last);
        let part = Window { leg, offset_mm: 0.5 * self.pending[leg].element.length, is_whole: false };
        let is_short =
            knots.len() < CURVE_KNOTS || last == 1 || path.place(whole.ending()) <= path.place(part.ending());
        if ends && is_short { whole } else { part }
    }

    /// What a fit of the window settles, and the rest of it; `None` where none keeps the tolerance.
    fn fit(
        &self,
        path: &Path<'_>,
        open: &Open,
        window: Window,
        joining: Joining<'_>,
    ) -> Option<(Settled<T>, Vec<Span>)> {
        let Window { leg, offset_mm, is_whole } = window;
        let programmed = &self.pending[leg].element;
        let goal = State { is_free: offset_mm >= programmed.length, ..exact(programmed, offset_mm) };
        let end = path.place(window.ending());
        let (mut spans, mut samples) = (Vec::new(), Vec::new());
        for refinement in [1, 2, 4] {
            let mut knots = path.knots(end, 2 * CURVE_KNOTS * refinement, refinement as f64);
            path.close(&mut knots, end);
            path.samples(&knots, &mut samples);
            let places: Vec<f64> = knots.iter().map(|knot| knot[0]).collect();
            let farthest = |spans: &[Span], ratios: &mut Vec<f64>| path.farthest(spans, &samples, ratios);
            let ends = [&open.start, &goal];
            let is_found = if self.pending[leg].is_guided() {
                Fit::<GUIDED>::default().solve(&places, &samples, ends, &mut spans, farthest)
            } else {
                Fit::<LINEAR>::default().solve(&places, &samples, ends, &mut spans, farthest)
            };
            if !is_found {
                continue;
            }
            let upto = if is_whole { window.ending() } else { Self::settled_end(path, &spans, leg.min(open.last)) };
            if let Some(settled) = self.settle(path, &spans, open, upto, joining) {
                let rest = match upto {
                    Ending::Within(upto) => rest_of(&spans, upto),
                    Ending::OnPath { .. } => Vec::new(),
                };
                return Some((settled, rest));
            }
        }
        None
    }

    /// What the window before has fitted, which keeps the tolerance and ends on the path.
    fn rest_of_before(&self, path: &Path<'_>, open: &Open, joining: Joining<'_>) -> Option<(Settled<T>, Vec<Span>)> {
        let ending = path.on_path(open.rest.last()?.to);
        let settled = self.settle(path, &open.rest, open, ending, joining)?;
        Some((settled, Vec::new()))
    }

    /// Gives on what is settled and keeps where the curve goes on.
    fn go_on(
        &mut self,
        mut open: Open,
        settled: Settled<T>,
        rest: Vec<Span>,
        is_whole: bool,
        emit: &mut impl FnMut(Smoothed<T>),
    ) {
        let Settled { parts, done, offset_mm } = settled;
        parts.into_iter().for_each(|part| self.give(part, emit));
        self.pass(done);
        self.pending.drain(..done);
        let is_over = is_whole && rest.is_empty() && done >= open.last || done > open.last;
        open.last -= done.min(open.last);
        let Some(front) = self.pending.front_mut() else { return };
        if offset_mm > 0.0
            && let Some(part) = front.element.part(offset_mm, front.element.length)
        {
            front.merged = front.merged.behind(offset_mm, part.length);
            front.element = part;
            self.passed.distance_mm += offset_mm;
            front.start_is_cut = true;
        }
        if !is_over {
            open.start = rest.first().map_or_else(|| exact(&front.element, 0.0), |span| span.state(span.from));
            open.next_try = self.pending.len() + 1;
            open.rest = rest;
            self.open = Some(open);
        }
    }

    /// The path of the elements up to and with `last`.
    fn path<'a>(&'a self, last: usize, joining: Joining<'a>) -> Path<'a> {
        let entries = self.pending.iter().take(last + 1);
        let merged_mm = entries.clone().map(|entry| entry.merged.largest_mm).fold(0.0, f64::max);
        let tolerance_mm = self.pending.front().and_then(Entry::corner_tolerance_mm).unwrap_or(0.0);
        let mut path = Path::new(tolerance_mm - merged_mm, joining.corners);
        for (index, entry) in entries.enumerate() {
            let angle_rad = match entry.joint {
                Joint::Corner { angle_rad, .. } if index < last => angle_rad,
                _ => 0.0,
            };
            path.push(&entry.element, angle_rad);
        }
        path
    }

    /// Where a curve ends whose last element this is, mm from its start.
    fn end_offset_mm(&self, last: usize) -> f64 {
        let entry = &self.pending[last];
        let reach_mm = self.pending[last - 1].reach_mm().unwrap_or(0.0);
        let length = entry.element.length;
        let is_cut_behind = entry.reach_mm().is_some() && self.stops_behind(last, true) != Some(true);
        let share = if is_cut_behind { CORNER_SHARE } else { 2.0 * CORNER_SHARE };
        if reach_mm < share * length {
            reach_mm
        } else if is_cut_behind {
            share * length
        } else {
            length
        }
    }

    /// Up to where a window is settled: the end of an element about where the settled share of its spans ends, or there; before
    /// the last element in any case, so that the curve still knows the corner before that.
    fn settled_end(path: &Path<'_>, spans: &[Span], last: usize) -> Ending {
        let count = ((spans.len() as f64) * CURVE_SETTLED_SHARE) as usize;
        let most = spans[count.clamp(1, spans.len() - 1)].from;
        let leg = path.leg_at(most);
        if leg >= last {
            let [from, to] = path.range(last - 1);
            let middle = 0.5 * (from + to);
            let knot = spans[spans.partition_point(|span| span.from <= middle) - 1].from;
            return Ending::Within(if knot > from { knot } else { middle });
        }
        let [from, _] = path.range(leg);
        Ending::Within(if from > 0.5 * most { from } else { most })
    }
}

/// The spans behind a place, from which arc lengths are counted then.
fn rest_of(spans: &[Span], from: f64) -> Vec<Span> {
    let behind = spans.iter().filter(|span| span.to > from);
    behind.map(|span| span.part(span.from.max(from), span.to).moved(from)).collect()
}

#[cfg(test)]
mod tests;
