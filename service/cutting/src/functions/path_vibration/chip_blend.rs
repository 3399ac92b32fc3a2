//! Where the chip breaks under the amplitude that the blends of a section let through.
//!
//! At a place s the tool cuts over what it left a revolution before, at s − f_r. With the shares E of the amplitude at both
//! places the thickness is f_r + A·(E(s)·sin u − E(s − f_r)·sin(u − 2πD)), whose swing is
//!
//! ```text
//! A·√((E(s) − E(s − f_r))² + 4·E(s)·E(s − f_r)·sin²(πD))
//! ```
//!
//! The chip can break where that is at least f_r; with E = 1 at both places it is the 2A·|sin πD| of a steady vibration. Where a
//! steady one breaks nothing, nothing breaks; within the first revolution of a section there is no surface to break through.
//!
//! It does break there within a share a = acos(f_r/swing)/π of each vibration of the thickness. So behind a break the next one comes
//! after no more than 1 − a/2 of such a vibration along which it can, whatever the phase, and no stretch of one is without a break.
//! The thickness goes through its vibrations ahead of or behind the tool by the angle of E(s) − E(s − f_r)·e^(−2πiD), which the
//! blends change.

use core::f64::consts::PI;
use std::collections::VecDeque;

use smallvec::SmallVec;

use super::chip::{CutCondition, reaches_through};
use super::chip_course::{Piece, WorstCut};
use super::report::BlendReport;
use crate::shared::blend::{BlendedPath, blend};
use feedwave_motion::sincos_turns;

/// Steps in which the blend is gone through; the place where breaking begins or ends is solved for in its step.
const STEPS_PER_RAMP: f64 = 16.0;
/// Most steps of one blend, whatever the feed.
const MAX_STEPS: f64 = 512.0;
/// Most steps of a solution.
const SOLVING_STEPS: usize = 24;
/// How far from breaking it may leave the margin.
const SOLVED: f64 = 1e-9;
/// Steps in which the air at a constant surface speed is averaged.
const AIR_STEPS: usize = 32;
/// A run that begins or ends this close to a place does so there, mm.
const SAME_PLACE_MM: f64 = 1e-9;
/// Share of breaking that a cut without an earlier revolution counts as at most.
const WITHOUT_SURFACE: f64 = 0.999;

/// A stretch on which the chip can break is at least a vibration long if it lacks this share of one: rounding.
const WHOLE_VIBRATION: f64 = 1e-9;

/// Share of its amplitude that a vibration has at least over a whole vibration in the middle of a part of a section, and a revolution
/// before: what a steady one with this share breaks, is broken there, whatever the phase. `vibration_mm` is f_r/D.
pub(super) fn reached_share(part_mm: f64, ramp_mm: f64, feed_per_rev_mm: f64, vibration_mm: f64) -> f64 {
    let at = |place_mm: f64| blend(place_mm / ramp_mm) * blend((part_mm - place_mm) / ramp_mm);
    let middle_mm = 0.5 * (part_mm + vibration_mm);
    (at(middle_mm - 0.5 * feed_per_rev_mm) * at(middle_mm + 0.5 * feed_per_rev_mm)).sqrt()
}

/// Length of a part from which on that share is 1, mm.
pub(super) fn whole_from_mm(ramp_mm: f64, feed_per_rev_mm: f64, vibration_mm: f64) -> f64 {
    2.0 * ramp_mm + feed_per_rev_mm + vibration_mm
}

/// Part of a section between two places without vibration.
#[derive(Clone, Copy, Debug)]
struct Part {
    start_mm: f64,
    /// `None` while it is further ahead.
    end_mm: Option<f64>,
    ramp_mm: f64,
    feed_mm_per_s: f64,
}

/// The longest part of a section.
#[derive(Clone, Copy, Debug)]
pub(super) struct LongestPart {
    pub(super) length_mm: f64,
    pub(super) ramp_mm: f64,
    /// Programmed feed at its start, on which its blends depend.
    pub(super) feed_mm_per_s: f64,
}

/// The parts of a section around the place that is judged. Without parts the amplitude is whole everywhere.
#[derive(Clone, Debug, Default)]
pub(super) struct Parts {
    parts: VecDeque<Part>,
    /// First and last blend of the section, mm.
    outer_ramps_mm: [f64; 2],
    any: bool,
    /// Whether there are places without vibration inside of the section.
    several: bool,
    longest: Option<LongestPart>,
}

impl Parts {
    pub(super) fn start(&mut self, start_mm: f64, ramp_mm: f64, feed_mm_per_s: f64) {
        self.close(start_mm);
        if !self.any {
            self.outer_ramps_mm[0] = ramp_mm;
        }
        self.several = self.any;
        self.any = true;
        self.outer_ramps_mm[1] = ramp_mm;
        self.parts.push_back(Part { start_mm, end_mm: None, ramp_mm, feed_mm_per_s });
    }

    pub(super) fn close(&mut self, end_mm: f64) {
        let Some(last) = self.parts.back_mut().filter(|last| last.end_mm.is_none()) else { return };
        last.end_mm = Some(end_mm);
        let Part { start_mm, ramp_mm, feed_mm_per_s, .. } = *last;
        let length_mm = end_mm - start_mm;
        if self.longest.is_none_or(|longest| longest.length_mm < length_mm) {
            self.longest = Some(LongestPart { length_mm, ramp_mm, feed_mm_per_s });
        }
    }

    /// The longest part that has ended; `None` as published.
    pub(super) const fn longest(&self) -> Option<LongestPart> {
        self.longest
    }

    /// Up to where the amplitude is known of a path known up to `known_mm`.
    pub(super) fn judged_up_to_mm(&self, known_mm: f64) -> f64 {
        match self.parts.back() {
            Some(Part { end_mm: None, ramp_mm, .. }) => known_mm - ramp_mm,
            _ => known_mm,
        }
    }

    /// What lies before a place is no longer asked for.
    pub(super) fn forget_before(&mut self, place_mm: f64) {
        while self.parts.front().and_then(|part| part.end_mm).is_some_and(|end_mm| end_mm < place_mm) {
            self.parts.pop_front();
        }
    }

    /// Share of the amplitude at a place.
    fn share(&self, place_mm: f64) -> f64 {
        if !self.any {
            return 1.0;
        }
        let part = self.parts.iter().rev().find(|part| part.start_mm <= place_mm);
        let Some(part) = part.filter(|_| place_mm >= 0.0) else { return 0.0 };
        let length_mm = part.end_mm.map(|end_mm| end_mm - part.start_mm);
        BlendedPath { ramp_mm: part.ramp_mm, before_mm: 0.0, length_mm }.share(place_mm - part.start_mm)
    }

    /// Where a stretch of path has to be gone through in steps, because the amplitude is not whole there or was not a revolution
    /// before; and the step.
    fn blended(&self, [from_mm, to_mm]: [f64; 2], feed_mm: f64) -> SmallVec<[([f64; 2], f64); 8]> {
        let mut zones = SmallVec::new();
        let is_here = |part: &&Part| part.start_mm < to_mm && part.end_mm.is_none_or(|end_mm| end_mm > from_mm);
        for part in self.parts.iter().filter(is_here) {
            let end_mm = part.end_mm.unwrap_or(f64::INFINITY);
            let step_mm = (part.ramp_mm / STEPS_PER_RAMP).max((part.ramp_mm + feed_mm) / MAX_STEPS);
            let whole_mm = part.start_mm + part.ramp_mm + feed_mm;
            // Where both blends act, most of the amplitude is there in the middle.
            let most_mm = (0.5 * (part.start_mm + end_mm + feed_mm)).min(whole_mm);
            // Behind the first revolution of the section there is a surface.
            let surface_mm = if part.start_mm <= SAME_PLACE_MM { feed_mm.min(most_mm) } else { part.start_mm };
            for [low, high] in [
                [part.start_mm, surface_mm.min(end_mm)],
                [surface_mm, most_mm.min(end_mm)],
                [most_mm, whole_mm.min(end_mm)],
                [(end_mm - part.ramp_mm).max(whole_mm), end_mm],
            ] {
                let zone = [low.max(from_mm), high.min(to_mm)];
                if zone[1] > zone[0] {
                    zones.push((zone, step_mm));
                }
            }
        }
        zones
    }
}

/// A length of path, and the revolutions and the vibrations of the chip's thickness on it.
#[derive(Clone, Copy, Debug, Default)]
struct Extent {
    mm: f64,
    revolutions: f64,
    vibrations: f64,
}

impl Extent {
    /// Of a stretch along which the thickness gains on the tool by `gained_turns`.
    fn of(mm: f64, cut: &CutCondition, gained_turns: f64) -> Self {
        let revolutions = mm / cut.feed_per_rev_mm;
        Self { mm, revolutions, vibrations: revolutions * cut.vibrations_per_rev() + gained_turns }
    }

    /// What of it has this many vibrations; `None` where it has fewer.
    fn up_to(self, vibrations: f64) -> Option<Self> {
        let share = if vibrations > 0.0 { vibrations / self.vibrations } else { 0.0 };
        let part = Self { mm: self.mm * share, revolutions: self.revolutions * share, vibrations };
        (vibrations <= self.vibrations).then_some(part)
    }

    fn add(&mut self, other: Self) {
        self.mm += other.mm;
        self.revolutions += other.revolutions;
        self.vibrations += other.vibrations;
    }
}

/// Chip from a break to the next one that is certain, over path on which the chip cannot break.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// Where it begins and ends to be impossible.
    start_mm: f64,
    end_mm: f64,
    /// Part of it that a whole amplitude would break, mm.
    blended_mm: f64,
    /// From the last break before, as far as it is behind; to the end of what cannot break.
    extent: Extent,
    /// Behind it, until a break is certain.
    after: Extent,
    line: u32,
}

/// A cut at a place, and how far its swing is beyond breaking: with the whole amplitude, and with what there is.
#[derive(Clone, Copy, Debug)]
struct Place {
    cut: CutCondition,
    whole: f64,
    margin: f64,
    /// How far the thickness is ahead of the tool in its vibration, turns.
    ahead_turns: f64,
}

impl Place {
    /// How far it is beyond breaking: at 1 and above it breaks.
    fn openness(&self) -> f64 {
        self.whole.min(self.margin)
    }

    fn breaks(&self) -> bool {
        reaches_through(self.openness())
    }

    /// How much farther ahead the thickness is at another place nearby, turns.
    fn gained_turns(&self, later: &Self) -> f64 {
        let gained = later.ahead_turns - self.ahead_turns;
        gained - libm::rint(gained)
    }

    /// Share in air over the revolution before.
    fn air(&self) -> f64 {
        if self.breaks() { libm::acos((1.0 / self.margin).min(1.0)) / PI } else { 0.0 }
    }
}

/// A piece of path whose places are looked at.
struct Places<'a> {
    piece: &'a Piece,
    parts: &'a Parts,
    /// At a constant spindle speed every cut of the piece, and its margin with the whole amplitude.
    constant: Option<(CutCondition, f64)>,
    /// Sine and cosine of the angle that a revolution lies behind by, likewise.
    behind: Option<(f64, f64)>,
}

impl<'a> Places<'a> {
    fn of(piece: &'a Piece, parts: &'a Parts) -> Self {
        let constant = match piece {
            Piece::Constant(block) => Some((block.cut, block.cut.breaking_margin())),
            Piece::Surface(_) | Piece::Stopped { .. } => None,
        };
        let behind = constant.map(|(cut, _)| sincos_turns(cut.vibrations_per_rev()));
        Self { piece, parts, constant, behind }
    }

    /// The cut at a place, and its margin with the whole amplitude.
    fn cut_at(&self, place_mm: f64) -> Option<(CutCondition, f64)> {
        self.constant.or_else(|| self.piece.cut_at(place_mm).map(|cut| (cut, cut.breaking_margin())))
    }

    fn at(&self, place_mm: f64) -> Option<Place> {
        let (cut, whole) = self.cut_at(place_mm)?;
        let before_mm = place_mm - cut.feed_per_rev_mm;
        let (now, before) = (self.parts.share(place_mm), self.parts.share(before_mm));
        let change = (now - before) * cut.amplitude_mm / cut.feed_per_rev_mm;
        let margin = (change * change + now * before * whole * whole).sqrt();
        let has_surface = !self.parts.any || before_mm >= -SAME_PLACE_MM;
        let margin = if has_surface { margin } else { margin.min(WITHOUT_SURFACE) };
        let (sin, cos) = self.behind.unwrap_or_else(|| sincos_turns(cut.vibrations_per_rev()));
        let ahead_turns = libm::atan2(before * sin, now - before * cos) / (2.0 * PI);
        Some(Place { cut, whole, margin, ahead_turns })
    }

    /// Where breaking begins or ends between two places that differ in it: by false position, in which an end that stays counts half.
    fn change_mm(&self, [mut from_mm, mut to_mm]: [f64; 2], [from, to]: [&Place; 2]) -> f64 {
        let (mut at_from, mut at_to) = (from.openness() - 1.0, to.openness() - 1.0);
        let mut stayed = 0;
        for _ in 0..SOLVING_STEPS {
            let inner_mm = from_mm + (to_mm - from_mm) * (at_from / (at_from - at_to)).clamp(0.0, 1.0);
            let Some(inner) = self.at(inner_mm).map(|place| place.openness() - 1.0) else { break };
            if inner.abs() <= SOLVED {
                return inner_mm;
            }
            if (inner < 0.0) == (at_from < 0.0) {
                (from_mm, at_from) = (inner_mm, inner);
                at_to *= if stayed == 1 { 0.5 } else { 1.0 };
                stayed = 1;
            } else {
                (to_mm, at_to) = (inner_mm, inner);
                at_from *= if stayed == -1 { 0.5 } else { 1.0 };
                stayed = -1;
            }
        }
        0.5 * (from_mm + to_mm)
    }
}

/// Gathers where the chip of a section breaks.
#[derive(Clone, Debug, Default)]
pub(super) struct BlendTally {
    length_mm: f64,
    broken_mm: f64,
    air_mm: f64,
    /// What the whole amplitude would break inside of the section, mm.
    inside_mm: f64,
    run: Option<Run>,
    /// The last vibration on which the chip could break, and the least share in air.
    breaking: VecDeque<(Extent, f64)>,
    /// Vibrations of the stretch in progress on which it can break, and of the one that has most.
    breaking_vibrations: f64,
    most_vibrations: f64,
    at_start: Option<Run>,
    longest: Option<Run>,
    /// The cut that comes closest to breaking.
    best: Option<(f64, WorstCut)>,
    /// Feed at the start, mm/rev.
    first_feed_mm: Option<f64>,
}

impl BlendTally {
    /// Adds the next piece, under the override that it is cut at.
    pub(super) fn add(&mut self, piece: &Piece, parts: &Parts, feed_override: f64) {
        let Some(feed_mm) = piece.largest_feed_per_rev_mm() else {
            self.interrupt(parts);
            return;
        };
        self.first_feed_mm.get_or_insert(feed_mm);
        let (from_mm, to_mm) = (piece.start_mm(), piece.start_mm() + piece.length_mm());
        self.length_mm += piece.length_mm();
        let places = Places::of(piece, parts);
        let mut cursor_mm = from_mm;
        for (zone_mm, step_mm) in parts.blended([from_mm, to_mm], feed_mm) {
            self.add_whole(&places, [cursor_mm, zone_mm[0]], feed_override);
            self.add_blend(&places, zone_mm, step_mm, feed_override);
            cursor_mm = zone_mm[1];
        }
        self.add_whole(&places, [cursor_mm, to_mm], feed_override);
    }

    /// A stretch with the whole amplitude.
    fn add_whole(&mut self, places: &Places<'_>, [from_mm, to_mm]: [f64; 2], feed_override: f64) {
        if to_mm <= from_mm {
            return;
        }
        let steps = if places.constant.is_some() { 1 } else { AIR_STEPS };
        let length_mm = (to_mm - from_mm) / steps as f64;
        for step in 0..steps {
            let start_mm = from_mm + length_mm * step as f64;
            let Some((cut, whole)) = places.cut_at(start_mm + 0.5 * length_mm) else { return };
            // The same share at both places: the thickness keeps its angle.
            let place = Place { cut, whole, margin: whole, ahead_turns: 0.0 };
            self.is_at(places, &place, feed_override);
            self.add_stretch(places, [start_mm, start_mm + length_mm], [&place, &place], &place, 0.5);
        }
    }

    /// A stretch along which the share changes, in steps.
    fn add_blend(&mut self, places: &Places<'_>, [low_mm, high_mm]: [f64; 2], step_mm: f64, feed_override: f64) {
        let steps = ((high_mm - low_mm) / step_mm).ceil().max(1.0);
        let (mut from_mm, mut from) = (low_mm, places.at(low_mm));
        for step in 1..=steps as u32 {
            let to_mm = low_mm + (high_mm - low_mm) * (f64::from(step) / steps);
            let to = places.at(to_mm);
            let (Some(first), Some(last)) = (from, to) else { return };
            self.is_at(places, &last, feed_override);
            if first.breaks() == last.breaks() {
                self.add_stretch(places, [from_mm, to_mm], [&first, &last], &last, 0.5);
            } else {
                let change_mm = places.change_mm([from_mm, to_mm], [&first, &last]);
                let Some(change) = places.at(change_mm) else { return };
                // Where breaking begins the share in air rises as a root.
                self.add_stretch(places, [from_mm, change_mm], [&first, &change], &first, 1.0 / 1.5);
                self.add_stretch(places, [change_mm, to_mm], [&change, &last], &last, 1.0 / 1.5);
            }
            (from_mm, from) = (to_mm, to);
        }
    }

    /// Keeps the cut that comes closest to breaking.
    fn is_at(&mut self, places: &Places<'_>, place: &Place, feed_override: f64) {
        if self.best.is_none_or(|(margin, _)| margin < place.margin) {
            let cut = WorstCut { cut: place.cut, line: places.piece.line(), feed_override };
            self.best = Some((place.margin, cut));
        }
    }

    /// A stretch between two places on which the chip can break as at `place`; on the mean it is in air for `mean` of the sum of the
    /// shares at its ends.
    fn add_stretch(
        &mut self,
        places: &Places<'_>,
        [start_mm, end_mm]: [f64; 2],
        [first, last]: [&Place; 2],
        place: &Place,
        mean: f64,
    ) {
        let (length_mm, parts) = (end_mm - start_mm, places.parts);
        if length_mm <= 0.0 {
            return;
        }
        let extent = Extent::of(length_mm, &place.cut, first.gained_turns(last));
        if place.breaks() {
            let airs = [first.air(), last.air()];
            self.air_mm += mean * (airs[0] + airs[1]) * length_mm;
            self.broken_mm += length_mm;
            self.add_breaking(extent, airs[0].min(airs[1]), parts);
            return;
        }
        self.breaking_vibrations = 0.0;
        let run = match &mut self.run {
            Some(run) => {
                // What lies between need not have broken.
                let after = core::mem::take(&mut run.after);
                run.extent.add(after);
                run
            }
            none => {
                let extent = since_break(&self.breaking);
                let after = Extent::default();
                none.insert(Run { start_mm, end_mm, blended_mm: 0.0, extent, after, line: places.piece.line() })
            }
        };
        self.breaking.clear();
        run.end_mm = end_mm;
        run.extent.add(extent);
        run.blended_mm += if reaches_through(place.whole) { length_mm } else { 0.0 };
    }

    /// Adds a stretch on which the chip can break, with at least this share in air.
    fn add_breaking(&mut self, extent: Extent, air: f64, parts: &Parts) {
        self.breaking_vibrations += extent.vibrations;
        self.most_vibrations = self.most_vibrations.max(self.breaking_vibrations);
        self.breaking.push_back((extent, air));
        let mut kept: f64 = self.breaking.iter().map(|(extent, _)| extent.vibrations).sum();
        while let Some((first, _)) = self.breaking.front().filter(|(first, _)| kept - first.vibrations >= 1.0) {
            kept -= first.vibrations;
            self.breaking.pop_front();
        }
        let Some(run) = &mut self.run else { return };
        let needed = (1.0 - 0.5 * air - run.after.vibrations).max(0.0);
        let certain = extent.up_to(needed);
        run.after.add(certain.unwrap_or(extent));
        if certain.is_some() {
            self.end_run(parts);
        }
    }

    /// The spindle stands: what follows is another chip.
    fn interrupt(&mut self, parts: &Parts) {
        self.end_run(parts);
        self.breaking.clear();
        self.breaking_vibrations = 0.0;
    }

    /// The chip breaks for certain behind a run.
    fn end_run(&mut self, parts: &Parts) {
        let Some(mut run) = self.run.take() else { return };
        run.extent.add(run.after);
        let first_blend_mm = parts.outer_ramps_mm[0] + self.first_feed_mm.unwrap_or(0.0);
        let is_first = run.start_mm <= SAME_PLACE_MM;
        if is_first {
            self.at_start = Some(run);
        }
        if !is_first || run.end_mm > first_blend_mm + SAME_PLACE_MM {
            self.is_inside(run, is_first, parts);
        }
    }

    /// A run goes further than the first or the last blend of the section; it may begin or end there. Between two breaks it lies if it
    /// does not, and if there may be blends between.
    fn is_inside(&mut self, run: Run, is_at_an_end: bool, parts: &Parts) {
        self.inside_mm += run.blended_mm;
        let is_between = !is_at_an_end || parts.several;
        if is_between && self.longest.is_none_or(|longest| longest.extent.revolutions < run.extent.revolutions) {
            self.longest = Some(run);
        }
    }

    /// The section ends after `length_mm`.
    pub(super) fn finish(mut self, parts: &Parts, length_mm: f64) -> BlendVerdict {
        let at_end = self.run.take().map(|mut run| {
            run.extent.add(run.after);
            if run.start_mm <= SAME_PLACE_MM {
                self.at_start = Some(run);
            }
            if run.start_mm < length_mm - parts.outer_ramps_mm[1] - SAME_PLACE_MM {
                self.is_inside(run, true, parts);
            }
            run
        });
        let share = |mm: f64| if self.length_mm > 0.0 { (mm / self.length_mm).min(1.0) } else { 0.0 };
        let run_mm = |run: Option<Run>| run.map_or(0.0, |run| run.extent.mm);
        let revolutions = |run: Option<Run>| run.map_or(0.0, |run| run.extent.revolutions);
        let report = (self.length_mm > 0.0 && parts.any).then(|| BlendReport {
            broken_share: share(self.broken_mm),
            air_share: share(self.air_mm),
            unbroken_at_start_mm: run_mm(self.at_start),
            unbroken_at_start_rev: revolutions(self.at_start),
            unbroken_at_end_mm: run_mm(at_end),
            unbroken_at_end_rev: revolutions(at_end),
            longest_unbroken_mm: run_mm(self.longest),
            longest_unbroken_rev: revolutions(self.longest),
            longest_unbroken_line: self.longest.map(|run| run.line),
            longest_part_mm: parts.longest.map_or(0.0, |part| part.length_mm),
            longest_part_ramp_mm: parts.longest.map_or(0.0, |part| part.ramp_mm),
        });
        let is_certain = self.most_vibrations >= 1.0 - WHOLE_VIBRATION;
        let never = (parts.any && !is_certain).then_some(self.best).flatten();
        let never = never.map(|(_, cut)| parts.longest.map_or(cut, |part| cut.reaching(part)));
        BlendVerdict { report, inside_mm: self.inside_mm, never }
    }
}

/// From the last break that is certain on the path behind to its end.
fn since_break(breaking: &VecDeque<(Extent, f64)>) -> Extent {
    let mut since = Extent::default();
    for (extent, air) in breaking.iter().rev() {
        let needed = (1.0 - 0.5 * air - since.vibrations).max(0.0);
        let certain = extent.up_to(needed);
        since.add(certain.unwrap_or(*extent));
        if certain.is_some() {
            break;
        }
    }
    since
}

/// What the blends leave of the chip's breaking.
pub(super) struct BlendVerdict {
    pub(super) report: Option<BlendReport>,
    /// What the blends inside of the section keep from breaking, mm.
    pub(super) inside_mm: f64,
    /// Where no break is certain: the cut that comes closest, with the amplitude that is there over a whole vibration.
    pub(super) never: Option<WorstCut>,
}

impl WorstCut {
    fn reaching(mut self, part: LongestPart) -> Self {
        let (feed_mm, whole) = (self.cut.feed_per_rev_mm, self.cut.breaking_margin());
        if reaches_through(whole) {
            let share = reached_share(part.length_mm, part.ramp_mm, feed_mm, self.cut.vibration_mm());
            // Never 0, which would be no vibration; nor what would break.
            self.cut.amplitude_mm *= share.min(WITHOUT_SURFACE / whole).max(1e-9);
        }
        self
    }
}
