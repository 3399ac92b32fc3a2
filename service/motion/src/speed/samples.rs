//! Derivatives of the path at the places of every interval at which limits are held or examined: each is taken once.

use super::path::{Derivatives, Path};
use super::problem::Knots;
use crate::tolerance::SPEED_SIDE;

/// Parts of an interval between the places that are examined: what is held at the ends and in the middle may be exceeded in
/// between.
pub(super) const EXAMINED_PARTS: usize = 8;
/// The same where limits are only held.
pub(super) const HELD_PARTS: usize = 2;

/// Most places of an interval where third derivatives jump that are examined; bounds its memory.
const MOST_BREAKS: usize = 64;

/// What is known of the path at places of the intervals between knots.
#[derive(Clone, Debug, Default)]
pub(super) struct Samples {
    axes: usize,
    /// Parts of an interval between places that all of them have.
    parts: usize,
    /// The first place of every interval, and one beyond the last.
    first: Vec<usize>,
    /// Places from the start of their interval, 0, to its end, 1.
    shares: Vec<f64>,
    /// By place and axis.
    derivatives: Vec<Derivatives>,
    breaks: Vec<f64>,
}

impl Samples {
    /// Takes the derivatives on these knots: in equal parts of the intervals, at their ends on their own side; where limits are examined,
    /// also on both sides of every place where third derivatives jump, and in the middle of every span that lies wholly inside, as a
    /// small bend may lie between places in equal parts.
    pub(super) fn take(&mut self, path: &Path<'_>, knots: &Knots, parts: usize) {
        (self.axes, self.parts) = (path.axes.len(), parts);
        self.first.clear();
        self.shares.clear();
        self.derivatives.clear();
        let per_part = 1.0 / parts as f64;
        let mut span = 0;
        for pair in knots.0.windows(2) {
            let (from, h) = (pair[0], pair[1] - pair[0]);
            self.first.push(self.shares.len());
            for part in 0..=parts {
                let share = part as f64 * per_part;
                let s = from + h * share.clamp(SPEED_SIDE, 1.0 - SPEED_SIDE);
                span = path.span_from(span, s);
                self.shares.push(share);
                path.add_derivatives(span, s, &mut self.derivatives);
            }
            if parts == HELD_PARTS {
                continue;
            }
            let mut add = |share: f64| {
                let share = share.clamp(SPEED_SIDE, 1.0 - SPEED_SIDE);
                let s = from + h * share;
                self.shares.push(share);
                path.add_derivatives(path.span_from(span, s), s, &mut self.derivatives);
            };
            for s in path.middles_between(from, pair[1]) {
                add((s - from) / h);
            }
            self.breaks.clear();
            path.add_breaks(span, [from, pair[1]], &mut self.breaks);
            for s in self.breaks.iter().take(MOST_BREAKS) {
                let share = (s - from) / h;
                add(share - SPEED_SIDE);
                add(share + SPEED_SIDE);
            }
        }
        self.first.push(self.shares.len());
    }

    /// The start, the middle and the end of an interval.
    pub(super) fn held(&self, interval: usize) -> [usize; 3] {
        let first = self.first[interval];
        [first, first + self.parts / 2, first + self.parts]
    }

    /// All places of an interval.
    pub(super) fn of(&self, interval: usize) -> core::ops::Range<usize> {
        self.first[interval]..self.first[interval + 1]
    }

    /// From 0 at the start of its interval to 1 at its end.
    pub(super) fn share(&self, place: usize) -> f64 {
        self.shares[place]
    }

    /// By axis.
    pub(super) fn derivatives(&self, place: usize) -> &[Derivatives] {
        &self.derivatives[place * self.axes..][..self.axes]
    }
}
