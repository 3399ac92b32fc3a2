//! The exact limit at a spindle speed: the least of all lobes.

use super::pockets::MAX_RPM;
use super::trace::{Block, Branch};
use super::{Check, LobeError, LobePoint, Lobes, MAX_LOBES};
use std::f64::consts::TAU;

/// By how much the limit between two points of a branch may lie below both of them, as a fraction; the points are so close
/// that it is far less.
const SLACK: f64 = 0.01;
/// How far the waves may reach beyond those at the points of a branch, where they turn back between two of them.
const TURN: f64 = 1e-3;
/// A root is found when the waves are a whole number up to this fraction: rounding.
const ROOT: f64 = 4e-15;
/// Most steps to a root or a turn; a root needs about five.
const MAX_STEPS: u32 = 60;

/// Where stability ends at one speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChartLimit {
    /// Largest stable depth or width, mm, without margin.
    pub limit_mm: f64,
    /// Frequency at which it chatters above, Hz.
    pub frequency_hz: f64,
    /// Number of the lobe, from 0 at the highest speeds: whole waves between two edges.
    pub lobe: u32,
}

/// The limit at a speed, and where on a branch it lies.
#[derive(Debug, Clone, Copy)]
pub(super) struct Exact<'a> {
    pub(super) limit: ChartLimit,
    pub(super) branch: usize,
    ends: [&'a LobePoint; 2],
}

/// Waves between two edges at one speed, the whole ones being the number of the lobe: 60·f/(z·S) − ε/2π.
#[derive(Debug, Clone, Copy)]
struct Waves {
    per_hz: f64,
    last_lobe: f64,
}

impl Waves {
    fn at(&self, point: &LobePoint) -> f64 {
        self.per_hz * point.frequency_hz - point.phase_rad / TAU
    }

    /// The lobes between two numbers of waves.
    fn lobes(&self, one: f64, other: f64) -> std::ops::Range<u32> {
        let first = one.min(other).ceil().max(0.0);
        let end = one.max(other).floor().min(self.last_lobe) + 1.0;
        first as u32..end.max(first) as u32
    }
}

impl Lobes {
    /// The highest lobe that is examined: beyond it even five times the highest mode lies below the lowest speed.
    ///
    /// # Errors
    /// [`LobeError::TooManyLobes`].
    pub(super) fn last_lobe(&self, lowest_rev_per_min: f64) -> Result<u32, LobeError> {
        let last = (60.0 * self.model.highest_hz() / (self.model.edges() * lowest_rev_per_min)).ceil();
        if last > f64::from(MAX_LOBES) {
            return Err(LobeError::TooManyLobes { lowest_rev_per_min, lobe: last as u32, limit: MAX_LOBES });
        }
        Ok(last as u32)
    }

    /// Largest stable depth or width at one speed, mm; `None` where nothing chatters.
    ///
    /// # Errors
    /// [`LobeError`] for a speed below what is computed.
    pub fn limit_mm(&self, spindle_rev_per_min: f64) -> Result<Option<f64>, LobeError> {
        let mut check = Check::default();
        check.within("spindle_rev_per_min", spindle_rev_per_min, 1.0, MAX_RPM);
        check.finish()?;
        let exact = self.exact(spindle_rev_per_min, self.last_lobe(spindle_rev_per_min)?);
        Ok(exact.map(|exact| exact.limit.limit_mm))
    }

    /// The least limit of the lobes up to `last_lobe`.
    pub(super) fn exact(&self, spindle_rev_per_min: f64, last_lobe: u32) -> Option<Exact<'_>> {
        let waves =
            Waves { per_hz: 60.0 / (self.model.edges() * spindle_rev_per_min), last_lobe: f64::from(last_lobe) };
        let mut best: Option<Exact<'_>> = None;
        for (index, branch) in self.branches.iter().enumerate() {
            for block in &branch.blocks {
                let [first, last] = [block.first, block.last].map(|place| branch.points[place].frequency_hz);
                let reach = [
                    waves.per_hz * first - block.most_rad / TAU - TURN,
                    waves.per_hz * last - block.least_rad / TAU + TURN,
                ];
                if may_be_less(block.least_mm, &best) && !waves.lobes(reach[0], reach[1]).is_empty() {
                    self.search(index, branch, block, waves, &mut best);
                }
            }
        }
        best
    }

    /// Looks for a smaller limit in a block of a branch.
    fn search<'a>(
        &'a self,
        index: usize,
        branch: &'a Branch,
        block: &Block,
        waves: Waves,
        best: &mut Option<Exact<'a>>,
    ) {
        let mut take = |limit: ChartLimit, ends| {
            if best.is_none_or(|best| limit.limit_mm < best.limit.limit_mm) {
                *best = Some(Exact { limit, branch: index, ends });
            }
        };
        for place in block.first..block.last {
            let [low, high] = [&branch.points[place], &branch.points[place + 1]];
            let [start, end] = [low, high].map(|point| waves.at(point));
            for lobe in waves.lobes(start, end) {
                take(self.root([low, high], waves, lobe), [low, high]);
            }
            // The waves turn back at the first of the two points, or beside it.
            let Some(before) = place.checked_sub(1).map(|before| &branch.points[before]) else { continue };
            let rise = start - waves.at(before);
            let bend = rise - (end - start);
            if rise * (end - start) >= 0.0 || waves.lobes(start, start + bend).is_empty() {
                continue;
            }
            let Some(turn) = self.turn([before, high], waves, rise.signum()) else { continue };
            for lobe in waves.lobes(start, waves.at(&turn)) {
                for ends in [[before, &turn], [&turn, high]] {
                    take(self.root(ends, waves, lobe), [before, high]);
                }
            }
        }
    }

    /// The limit of a lobe between two points of a branch that lie on either side of it.
    fn root(&self, ends: [&LobePoint; 2], waves: Waves, lobe: u32) -> ChartLimit {
        let beyond = |point: &LobePoint| waves.at(point) - f64::from(lobe);
        let [mut low, mut high] = ends.map(|end| (end.frequency_hz, beyond(end)));
        let nearer = |a: (LobePoint, f64), b: (LobePoint, f64)| if a.1.abs() <= b.1.abs() { a } else { b };
        let mut best = nearer((*ends[0], low.1), (*ends[1], high.1));
        let mut stays = 0.0;
        for step in 0..MAX_STEPS {
            if best.1.abs() <= ROOT * (1.0 + f64::from(lobe)) {
                break;
            }
            // False position; where one end stays, its weight is halved (Illinois); at last the interval itself is.
            let share = if step < MAX_STEPS / 2 { low.1 / (low.1 - high.1) } else { 0.5 };
            let frequency_hz = low.0 + share * (high.0 - low.0);
            if frequency_hz <= low.0 || frequency_hz >= high.0 {
                break;
            }
            let Some(point) = self.model.between(ends, frequency_hz) else { break };
            let value = beyond(&point);
            best = nearer((point, value), best);
            if (value > 0.0) == (high.1 > 0.0) {
                high = (frequency_hz, value);
                low.1 *= if stays < 0.0 { 0.5 } else { 1.0 };
                stays = -1.0;
            } else {
                low = (frequency_hz, value);
                high.1 *= if stays > 0.0 { 0.5 } else { 1.0 };
                stays = 1.0;
            }
        }
        let LobePoint { limit_mm, frequency_hz, .. } = best.0;
        ChartLimit { limit_mm, frequency_hz, lobe }
    }

    /// Where the waves turn back between two points of a branch; `rising` is 1 where they rise before, −1 where they fall.
    fn turn(&self, ends: [&LobePoint; 2], waves: Waves, rising: f64) -> Option<LobePoint> {
        let [mut low, mut high] = ends.map(|end| end.frequency_hz);
        let mut best: Option<LobePoint> = None;
        for _ in 0..MAX_STEPS {
            let third = (high - low) / 3.0;
            let [left, right] = [low + third, high - third].map(|frequency_hz| self.model.between(ends, frequency_hz));
            let (left, right) = (left?, right?);
            let left_is_further = rising * (waves.at(&left) - waves.at(&right)) > 0.0;
            best = Some(if left_is_further { left } else { right });
            if left_is_further {
                high = right.frequency_hz;
            } else {
                low = left.frequency_hz;
            }
            if high - low <= 1e-12 * high {
                break;
            }
        }
        best
    }

    /// Slope of the limit over the speed where it is exact, mm·min; NaN where the branch ends.
    pub(super) fn slope(&self, exact: &Exact<'_>) -> f64 {
        let [low, high] = exact.ends.map(|end| end.frequency_hz);
        let frequency_hz = exact.limit.frequency_hz;
        let step = 1e-3 * (high - low);
        let [before, after] =
            [frequency_hz - step, frequency_hz + step].map(|frequency_hz| self.model.between(exact.ends, frequency_hz));
        let Some((before, after)) = before.zip(after) else { return f64::NAN };
        let speed = |point: &LobePoint| self.spindle_rev_per_min(point, exact.limit.lobe);
        (after.limit_mm - before.limit_mm) / (speed(&after) - speed(&before))
    }

    /// Speeds at which a lobe is lowest, or ends, by rising speed, with its limit there.
    pub(super) fn low_speeds(&self, last_lobe: u32) -> Vec<(f64, f64)> {
        let lobes = |point| (0..=last_lobe).map(move |lobe| (self.spindle_rev_per_min(point, lobe), point.limit_mm));
        let mut lows: Vec<_> = self.lows.iter().flat_map(lobes).collect();
        lows.sort_by(|a, b| a.0.total_cmp(&b.0));
        lows
    }
}

/// Whether a limit near `about_mm` may be less than the best.
fn may_be_less(about_mm: f64, best: &Option<Exact<'_>>) -> bool {
    best.is_none_or(|best| about_mm * (1.0 - SLACK) < best.limit.limit_mm)
}
