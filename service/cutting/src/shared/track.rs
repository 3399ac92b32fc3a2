//! The stretch of track around the tool: planned motions behind and ahead, with the barriers between them.

use std::collections::VecDeque;

use feedwave_motion::{Ahead, Planned, PlannedMotion, PlannedStretch};
use serde::{Deserialize, Serialize};

/// The path within one amplitude of the tool must fit in memory, so amplitudes have a ceiling, mm.
pub const MAX_AMPLITUDE_MM: f64 = 10.0;

/// A barrier between motions, as far as the path of a section is concerned.
pub(crate) trait PathBarrier {
    /// Whether the path of a section, or of a part of it, starts here.
    fn starts_path(&self) -> bool;

    /// Whether the path of a section, or of a part of it, ends here.
    fn ends_path(&self) -> bool;

    /// Whether the tool leaves its place here: what comes behind begins elsewhere.
    fn moves_tool(&self) -> bool;
}

/// Tolerance for the rounding of summed path lengths, relative and mm.
const LENGTH_MARGIN: f64 = 1e-9;

/// Planned items from one amplitude behind the tool to one amplitude ahead.
///
/// Every item knows its place on the section's path, so that a place is found by bisection, however short the
/// elements are: with elements of nanometres, millions lie within an amplitude.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Track<B> {
    items: VecDeque<Item<B>>,
    /// Index of the item the tool is on (or is about to take).
    current: usize,
    /// Path length of the section up to its last known item, mm.
    known_mm: f64,
    /// Whether the last item is the section's end; nothing is pushed until the tool is there.
    end_is_known: bool,
    /// Items at the end that are shown only, see [`Track::show_path`], and whether the section's end is.
    shown: usize,
    end_is_shown: bool,
    /// Memory that the items take at the most, bytes. Not part of snapshots: [`Track::count_bytes`].
    #[serde(skip)]
    bytes: usize,
}

/// An item of the track.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Item<B> {
    /// Path length from the section's start to the start of this item, mm; meaningless outside sections.
    start_mm: f64,
    planned: Planned<B>,
}

/// Where a path position lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Location {
    /// Index of the item.
    pub(crate) item: usize,
    /// Arc length within its element, mm.
    pub(crate) s: f64,
    /// By how much the position lay beyond the section, mm; negative before its start, 0 within.
    pub(crate) beyond_mm: f64,
}

impl<B> Item<B> {
    /// Whether it only shows where the path goes.
    fn is_shown(&self) -> bool {
        self.motion().is_some_and(|motion| motion.stretches.is_empty())
    }

    fn motion(&self) -> Option<&PlannedMotion> {
        match &self.planned {
            Planned::Motion(motion) => Some(motion),
            Planned::Barrier(_) => None,
        }
    }

    fn length_mm(&self) -> f64 {
        self.motion().map_or(0.0, |motion| motion.element.length)
    }

    fn bytes(&self) -> usize {
        self.motion().map_or(0, PlannedMotion::bytes)
    }
}

impl<B> Default for Track<B> {
    fn default() -> Self {
        Self {
            items: VecDeque::new(),
            current: 0,
            known_mm: 0.0,
            end_is_known: false,
            shown: 0,
            end_is_shown: false,
            bytes: 0,
        }
    }
}

impl<B: PathBarrier> Track<B> {
    pub(crate) fn push(&mut self, planned: Planned<B>) {
        if let Some(last) = self.items.back_mut().filter(|last| last.is_shown()) {
            // A feed hold stands, or stood, at its start.
            self.shown = 0;
            if matches!(planned, Planned::Motion(_)) {
                last.planned = planned;
                return self.count_bytes();
            }
            // What is to be done before that motion: see [`Track::leave_shown`].
            self.known_mm = last.start_mm;
        }
        match &planned {
            Planned::Barrier(barrier) if barrier.starts_path() => self.known_mm = 0.0,
            Planned::Barrier(barrier) if barrier.ends_path() => self.end_is_known = true,
            _ => {}
        }
        let item = Item { start_mm: self.known_mm, planned };
        self.known_mm += item.length_mm();
        self.bytes += item.bytes();
        self.items.push_back(item);
    }

    /// Adds stretches to the last item, whose element goes on where a change of the feed override has divided it.
    pub(crate) fn extend_last(&mut self, stretches: &[PlannedStretch]) {
        if let Some(Planned::Motion(motion)) = self.items.back_mut().map(|item| &mut item.planned) {
            motion.stretches.extend(stretches.iter().cloned());
        }
    }

    /// Changes the planned motion of an item; its element stays.
    pub(crate) fn motion_mut(&mut self, item: usize) -> Option<&mut PlannedMotion> {
        match &mut self.items.get_mut(item)?.planned {
            Planned::Motion(motion) => Some(motion),
            Planned::Barrier(_) => None,
        }
    }

    /// Items from this one on that are to be planned again: those that were only shown are not among them.
    pub(crate) fn planned_from(&self, from: usize) -> impl Iterator<Item = Ahead<'_, B>> {
        let from = from.min(self.items.len());
        self.items.range(from..).filter(|item| !item.is_shown()).map(|item| Ahead::from(&item.planned))
    }

    /// Forgets every item from this one on.
    pub(crate) fn withdraw(&mut self, from: usize) {
        let from = from.min(self.items.len());
        let is_end = |item: &Item<B>| matches!(&item.planned, Planned::Barrier(barrier) if barrier.ends_path());
        self.end_is_known &= !(self.end_is_shown || self.items.range(from..).any(is_end));
        self.end_is_shown = false;
        self.known_mm = self.items.get(from).map_or(self.known_mm, |item| item.start_mm);
        self.shown = self.items.range(..from).rev().take_while(|item| item.is_shown()).count();
        if let Some(last) = self.items.range(..from).next_back().filter(|last| last.is_shown()) {
            self.known_mm = last.start_mm + last.length_mm();
        }
        self.bytes = self.items.range(..from).map(Item::bytes).sum();
        self.items.truncate(from);
    }

    /// Adds what lies ahead of a feed hold without being planned: the first of it, and as much as is asked for, up to the end of the
    /// section or of what is known.
    pub(crate) fn show_path<'a>(&mut self, path: impl Iterator<Item = Ahead<'a, B>>, is_enough: impl Fn(&Self) -> bool)
    where
        B: 'a,
    {
        let mut shown = 0;
        for item in path {
            match item {
                Ahead::Barrier(barrier) if barrier.ends_path() => {
                    self.end_is_known = true;
                    self.end_is_shown = true;
                    return;
                }
                // No section is in progress, and what lies behind is another path.
                Ahead::Barrier(barrier) if barrier.starts_path() || barrier.moves_tool() => return,
                _ if !item.begins_element() => {}
                _ if shown < self.shown => shown += 1,
                _ if self.shown > 0 && is_enough(self) => return,
                _ => {
                    let Some(motion) = item.unplanned() else { continue };
                    let start_mm = self.known_mm;
                    self.known_mm += motion.element.length;
                    self.items.push_back(Item { start_mm, planned: Planned::Motion(motion) });
                    shown += 1;
                    self.shown = shown;
                }
            }
        }
    }

    /// Forgets the motion that the tool waits for, where it is only shown and something is to be done before it.
    pub(crate) fn leave_shown(&mut self) {
        let is_shown = self.items.get(self.current).is_some_and(Item::is_shown);
        if is_shown && self.current + 1 < self.items.len() - self.shown {
            self.items.remove(self.current);
            self.count_bytes();
        }
    }

    /// Number of items held.
    pub(crate) fn len(&self) -> usize {
        self.items.len()
    }

    /// Memory that they take at the most, bytes, but for what a change of the feed override has added or shown since.
    pub(crate) const fn bytes(&self) -> usize {
        self.bytes
    }

    /// Counts anew what the items take: of what a snapshot held, and where they were changed in the middle.
    pub(crate) fn count_bytes(&mut self) {
        self.bytes = self.items.iter().map(Item::bytes).sum();
    }

    pub(crate) fn current(&self) -> Option<&Planned<B>> {
        self.items.get(self.current).map(|item| &item.planned)
    }

    pub(crate) fn current_index(&self) -> usize {
        self.current
    }

    pub(crate) fn motion(&self, item: usize) -> Option<&PlannedMotion> {
        self.items.get(item)?.motion()
    }

    /// Path length from the section's start to the start of an item, mm.
    fn start_mm(&self, item: usize) -> f64 {
        self.items.get(item).map_or(self.known_mm, |item| item.start_mm)
    }

    /// Distance of the start of an item from the start of its section, and the section's length where it is known, mm.
    pub(crate) fn section_place(&self, item: usize) -> (f64, Option<f64>) {
        (self.start_mm(item), self.end_is_known.then_some(self.known_mm))
    }

    /// Takes the next item; what lies further behind than `keep_mm` is forgotten.
    pub(crate) fn advance(&mut self, keep_mm: f64) {
        if matches!(self.current(), Some(Planned::Barrier(barrier)) if barrier.ends_path()) {
            self.end_is_known = false;
        }
        self.current += 1;
        let here_mm = self.start_mm(self.current);
        let kept_from_mm = here_mm - keep_mm - margin(here_mm + keep_mm);
        while self.current > 0 {
            let is_needed = |item: &Item<B>| keep_mm > 0.0 && item.start_mm + item.length_mm() > kept_from_mm;
            if self.items.front().is_none_or(is_needed) {
                break;
            }
            let gone = self.items.pop_front();
            self.bytes = self.bytes.saturating_sub(gone.map_or(0, |item| item.bytes()));
            self.current -= 1;
        }
    }

    /// Whether the section's path is known for `distance_mm` beyond the current item, or to its end.
    pub(crate) fn is_known_ahead(&self, distance_mm: f64) -> bool {
        let ahead_mm = self.known_mm - self.start_mm(self.current + 1);
        self.end_is_known || ahead_mm > distance_mm + margin(self.known_mm + distance_mm)
    }

    /// Finds the place `s` mm from the start of the element of motion `from` on the path of the section; what lies
    /// beyond the section is clamped to its first or last point.
    pub(crate) fn locate(&self, from: usize, s: f64) -> Location {
        let length_at = |item: usize| self.items.get(item).map_or(0.0, Item::length_mm);
        if s >= 0.0 && s <= length_at(from) {
            return Location { item: from, s, beyond_mm: 0.0 };
        }
        // Beside the section's ends a sum of path lengths would miss them by its rounding.
        let end = length_at(from);
        if s > end && self.start_mm(from) + end >= self.known_mm {
            return Location { item: from, s: end, beyond_mm: s - end };
        }
        if s < 0.0 && self.start_mm(from) == 0.0 {
            return Location { item: from, s: 0.0, beyond_mm: s };
        }
        let place_mm = self.start_mm(from) + s;
        let reached = self.items.partition_point(|item| item.start_mm <= place_mm);
        let is_motion = |item: &usize| self.motion(*item).is_some();
        let item = (0..reached).rev().find(is_motion).or_else(|| (reached..self.items.len()).find(is_motion));
        let item = item.unwrap_or(from);
        let s = place_mm - self.start_mm(item);
        let end = length_at(item);
        if s < 0.0 {
            Location { item, s: 0.0, beyond_mm: s }
        } else if s > end {
            // Beyond an element that another one follows is rounding.
            let is_last = self.start_mm(item) + end >= self.known_mm;
            Location { item, s: end, beyond_mm: if is_last { s - end } else { 0.0 } }
        } else {
            Location { item, s, beyond_mm: 0.0 }
        }
    }

    /// The section's first motion and the distance from its start to the start of motion `from`, where that is
    /// less than `within_mm`.
    pub(crate) fn section_start_near(&self, from: usize, within_mm: f64) -> Option<(&PlannedMotion, f64)> {
        let distance_mm = self.start_mm(from);
        let is_near = distance_mm < within_mm;
        // While it is near, the section's start is held in front.
        let first = self.items.iter().find_map(Item::motion).filter(|_| is_near)?;
        Some((first, distance_mm))
    }

    /// The section's last motion and the distance from the end of motion `from` to its end, where that is less
    /// than `within_mm`.
    pub(crate) fn section_end_near(&self, from: usize, within_mm: f64) -> Option<(&PlannedMotion, f64)> {
        let distance_mm = self.known_mm - self.start_mm(from + 1);
        let is_near = self.end_is_known && distance_mm < within_mm;
        let last = self.items.iter().rev().find_map(Item::motion).filter(|_| is_near)?;
        Some((last, distance_mm))
    }
}

fn margin(length_mm: f64) -> f64 {
    LENGTH_MARGIN * (1.0 + length_mm)
}
