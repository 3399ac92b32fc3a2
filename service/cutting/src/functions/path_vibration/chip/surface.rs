//! The surface that earlier revolutions left, and the thickness of what is cut over it.

use core::f64::consts::PI;

use super::{CutCondition, MAX_EARLIER_REVOLUTIONS, reaches_through};
use feedwave_motion::sin_turns;

/// The largest thickness is found to within this, mm.
const THICKNESS_TOLERANCE_MM: f64 = 1e-10;

/// Intervals that the search for the largest thickness looks at before it settles for its upper bound; it needs
/// a few hundred.
const MAX_INTERVALS: usize = 100_000;

/// Distance of q·D to the nearest integer, signed: all that the revolution q back contributes besides q·f_r.
///
/// D comes out of a division, so a D within its rounding of an integer is that integer: S1002 with 16.7 Hz is
/// D = 1 although 60·16.7/1002 is not.
pub(super) fn reduced_lag(vibrations_per_rev: f64) -> f64 {
    let lag = vibrations_per_rev - vibrations_per_rev.round();
    if lag.abs() <= 4.0 * f64::EPSILON * vibrations_per_rev { 0.0 } else { lag }
}

/// sin(π·x).
pub(super) fn sin_half_turns(x: f64) -> f64 {
    sin_turns(0.5 * x)
}

/// The thickness of the chip against one earlier revolution, h_q = q·f_r + 2A·sin(πqD)·cos(u − πqD), as
/// `base + sin_part·sin u + cos_part·cos u`.
struct EarlierCut {
    /// q·f_r, mm.
    base_mm: f64,
    sin_part_mm: f64,
    cos_part_mm: f64,
    /// 2A·|sin πqD|, mm.
    swing_mm: f64,
    /// Where h_q is largest, turns of the vibration in [0, 1).
    peak_turns: f64,
}

impl EarlierCut {
    fn new(condition: &CutCondition, revolutions: u32, lag: f64) -> Self {
        let q = f64::from(revolutions);
        let lag = q * lag - (q * lag).round();
        let sine = sin_half_turns(lag);
        let cosine = sin_half_turns(lag + 0.5);
        let swing = 2.0 * condition.amplitude_mm * sine;
        let peak_turns = 0.5 * lag + if lag >= 0.0 { 0.0 } else { 0.5 };
        Self {
            base_mm: q * condition.feed_per_rev_mm,
            sin_part_mm: swing * sine,
            cos_part_mm: swing * cosine,
            swing_mm: swing.abs(),
            peak_turns,
        }
    }

    fn thickness_mm(&self, phase: Phase) -> f64 {
        self.base_mm + self.sin_part_mm * phase.sine + self.cos_part_mm * phase.cosine
    }

    /// Smallest and largest thickness for phases from `low` to `high`, at most a turn apart.
    fn range_mm(&self, low: Phase, high: Phase) -> (f64, f64) {
        let (a, b) = (self.thickness_mm(low), self.thickness_mm(high));
        let contains = |turns: f64| {
            let turns = if turns < low.turns { turns + 1.0 } else { turns };
            turns <= high.turns
        };
        let trough_turns = if self.peak_turns < 0.5 { self.peak_turns + 0.5 } else { self.peak_turns - 0.5 };
        let smallest = if contains(trough_turns) { self.base_mm - self.swing_mm } else { a.min(b) };
        let largest = if contains(self.peak_turns) { self.base_mm + self.swing_mm } else { a.max(b) };
        (smallest, largest)
    }
}

/// A vibration phase with its sine and cosine.
#[derive(Clone, Copy)]
struct Phase {
    turns: f64,
    sine: f64,
    cosine: f64,
}

impl Phase {
    fn at(turns: f64) -> Self {
        Self { turns, sine: sin_turns(turns), cosine: sin_turns(turns + 0.25) }
    }
}

/// Where the tool cuts air, over one turn of the vibration.
pub(super) struct Air {
    /// Share of the turn.
    pub(super) share: f64,
    /// Separate stretches of air.
    pub(super) count: usize,
    /// Longest stretch in the material between two of them, turns.
    pub(super) longest_gap_turns: f64,
}

/// Every earlier revolution whose surface can be seen.
pub(super) struct Surface {
    cuts: Vec<EarlierCut>,
    complete: bool,
}

impl Surface {
    /// The surface of a valid condition.
    pub(super) fn new(condition: &CutCondition) -> Self {
        let lag = reduced_lag(condition.vibrations_per_rev());
        let mut cuts = Vec::new();
        let mut complete = false;
        for revolutions in 1..=MAX_EARLIER_REVOLUTIONS {
            let cut = EarlierCut::new(condition, revolutions, lag);
            // The tool's turn hides the one this far back everywhere. So does any earlier turn the one this far
            // behind itself: nothing older is left to see.
            complete = cut.swing_mm <= cut.base_mm;
            cuts.push(cut);
            if complete {
                break;
            }
        }
        Self { cuts, complete }
    }

    pub(super) fn earlier_revolutions(&self) -> u32 {
        self.cuts.len() as u32
    }

    pub(super) fn is_complete(&self) -> bool {
        self.complete
    }

    fn thickness_mm(&self, phase: Phase) -> f64 {
        self.cuts.iter().map(|cut| cut.thickness_mm(phase)).fold(f64::INFINITY, f64::min)
    }

    /// Where the thickness is not positive: the union of one closed-form interval for each earlier revolution.
    pub(super) fn air(&self) -> Air {
        let mut intervals: Vec<(f64, f64)> = self
            .cuts
            .iter()
            .filter(|cut| reaches_through(cut.swing_mm / cut.base_mm))
            .map(|cut| {
                let half_width = libm::acos((cut.base_mm / cut.swing_mm).min(1.0)) / (2.0 * PI);
                let start = cut.peak_turns + 0.5 - half_width;
                let start = start - start.floor();
                (start, start + 2.0 * half_width)
            })
            .collect();
        intervals.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut merged: Vec<(f64, f64)> = Vec::new();
        for (start, end) in intervals {
            match merged.last_mut() {
                Some(last) if start <= last.1 => last.1 = last.1.max(end),
                _ => merged.push((start, end)),
            }
        }
        join_ends(&mut merged);
        let share = merged.iter().map(|(start, end)| end - start).fold(0.0, |sum, width| sum + width).min(1.0);
        let starts = merged.iter().skip(1).map(|interval| interval.0);
        let next_starts = starts.chain(merged.first().map(|first| first.0 + 1.0));
        let longest_gap_turns = merged.iter().zip(next_starts).map(|(air, next)| next - air.1).fold(0.0, f64::max);
        Air { share, count: merged.len(), longest_gap_turns }
    }

    /// The largest thickness over a turn of the vibration, mm, and whether it is within the tolerance.
    ///
    /// Branch and bound over intervals of the phase: h is the least of sinusoids, each of which has its exact
    /// range on any interval. The least of the upper ends bounds h from above, and a sinusoid whose lower end
    /// lies above that bound cannot matter inside the interval.
    pub(super) fn largest_thickness_mm(&self) -> (f64, bool) {
        let mut best_mm = f64::NEG_INFINITY;
        let mut unresolved_mm = f64::NEG_INFINITY;
        // Active sinusoids of the open intervals, one above the other; an interval's descendants lie behind it.
        let mut active: Vec<u32> = (0..self.cuts.len() as u32).collect();
        let quarter = |index: u8| (f64::from(index) * 0.25, f64::from(index + 1) * 0.25, 0..active.len());
        let mut open: Vec<_> = (0..4).map(quarter).collect();
        let mut ranges = Vec::new();
        let mut intervals = 0;
        while let Some((low, high, set)) = open.pop() {
            active.truncate(set.end);
            let (low_phase, high_phase) = (Phase::at(low), Phase::at(high));
            ranges.clear();
            ranges.extend(active[set.clone()].iter().map(|&i| self.cuts[i as usize].range_mm(low_phase, high_phase)));
            let bound_mm = ranges.iter().map(|range| range.1).fold(f64::INFINITY, f64::min);
            if bound_mm <= best_mm + THICKNESS_TOLERANCE_MM {
                continue;
            }
            let first = active.len();
            for (offset, range) in ranges.iter().enumerate() {
                if range.0 <= bound_mm {
                    active.push(active[set.start + offset]);
                }
            }
            let filtered = first..active.len();
            let least_at = |turns: f64| {
                let phase = Phase::at(turns);
                let cuts = active[filtered.clone()].iter().map(|&i| self.cuts[i as usize].thickness_mm(phase));
                cuts.fold(f64::INFINITY, f64::min)
            };
            let middle = 0.5 * (low + high);
            best_mm = best_mm.max(least_at(middle));
            let lowest_peak = active[filtered.clone()]
                .iter()
                .map(|&i| &self.cuts[i as usize])
                .min_by(|a, b| (a.base_mm + a.swing_mm).total_cmp(&(b.base_mm + b.swing_mm)));
            if let Some(cut) = lowest_peak.filter(|cut| (low..=high).contains(&cut.peak_turns)) {
                best_mm = best_mm.max(least_at(cut.peak_turns));
            }
            intervals += 1;
            if bound_mm <= best_mm + THICKNESS_TOLERANCE_MM {
                continue;
            }
            if intervals >= MAX_INTERVALS || middle <= low || middle >= high {
                unresolved_mm = unresolved_mm.max(bound_mm);
                continue;
            }
            open.push((low, middle, filtered.clone()));
            open.push((middle, high, filtered));
        }
        if unresolved_mm > best_mm + THICKNESS_TOLERANCE_MM { (unresolved_mm, false) } else { (best_mm, true) }
    }
}

/// Joins the last interval of a turn to the first ones where it reaches over the turn's end.
fn join_ends(merged: &mut Vec<(f64, f64)>) {
    let Some(&(_, mut end)) = merged.last() else { return };
    let mut absorbed = 0;
    while absorbed + 1 < merged.len() && merged[absorbed].0 + 1.0 <= end {
        end = end.max(merged[absorbed].1 + 1.0);
        absorbed += 1;
    }
    if let Some(last) = merged.last_mut() {
        last.1 = end;
    }
    merged.drain(..absorbed);
}

/// Uncut chip thickness at vibration phase `phase_rad` over all earlier revolutions, mm; 0 or less where the tool
/// cuts air. NaN for a condition that is not [valid](CutCondition::is_valid).
#[must_use]
pub fn thickness(condition: &CutCondition, phase_rad: f64) -> f64 {
    if !condition.is_valid() {
        return f64::NAN;
    }
    let phase = Phase { turns: 0.0, sine: libm::sin(phase_rad), cosine: libm::cos(phase_rad) };
    Surface::new(condition).thickness_mm(phase)
}
