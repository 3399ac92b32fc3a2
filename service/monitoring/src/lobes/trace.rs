//! Follows the limit over the chatter frequency.

use super::pockets::MAX_RPM;
use super::{LobePoint, Lobes, Model};
use std::f64::consts::{PI, TAU};

/// Frequencies of the grid from a fifth of the lowest mode to five times the highest.
const FREQUENCIES: usize = 4000;
/// Growth from one frequency to the next outside of it, where everything is smooth.
const OUTER_GROWTH: f64 = 1.05;
/// Smallest part of a wave between two edges that is looked for at the lowest speed.
const LEAST_WAVE: f64 = 1e-3;
/// Around each resonance: steps in half-power widths, how many to each side, and how the distance grows beyond them.
const WIDTH_STEP: f64 = 0.05;
const WIDTH_STEPS: i32 = 200;
const WIDTH_GROWTH: f64 = 1.05;
/// Limit and phase between two frequencies differ from the mean by less, as a fraction and in rad.
const SMOOTH: f64 = 1e-3;
/// Most halvings between two frequencies of the grid.
const MAX_HALVINGS: u32 = 16;
/// Most points of all branches: many times what 64 modes with the least damping need.
const MAX_POINTS: usize = 400_000;
/// Halvings towards the end of a branch, where the limit grows beyond all bounds.
const END_HALVINGS: u32 = 40;
/// Depths and widths from here on are as good as boundless, mm.
const BOUNDLESS_MM: f64 = 1e5;
/// A point lies lower than its neighbours when it does so by this fraction: less is rounding.
const LOWER: f64 = 1e-12;
/// Points that are examined together.
const BLOCK: usize = 32;

/// One continuous stretch of the limit, by rising frequency.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Branch {
    pub(super) points: Vec<LobePoint>,
    pub(super) blocks: Vec<Block>,
}

/// What neighbouring points span, so that most of them need not be examined.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Block {
    /// The points `first..=last`.
    pub(super) first: usize,
    pub(super) last: usize,
    pub(super) least_mm: f64,
    pub(super) least_rad: f64,
    pub(super) most_rad: f64,
}

impl Branch {
    fn new(points: Vec<LobePoint>) -> Self {
        let block = |first: usize| {
            let last = (first + BLOCK).min(points.len() - 1);
            let fold = |start: f64, of: fn(&LobePoint) -> f64, pick: fn(f64, f64) -> f64| {
                points[first..=last].iter().map(of).fold(start, pick)
            };
            Block {
                first,
                last,
                least_mm: fold(f64::INFINITY, |point| point.limit_mm, f64::min),
                least_rad: fold(f64::INFINITY, |point| point.phase_rad, f64::min),
                most_rad: fold(f64::NEG_INFINITY, |point| point.phase_rad, f64::max),
            }
        };
        let blocks = (0..points.len() - 1).step_by(BLOCK).map(block).collect();
        Self { points, blocks }
    }
}

impl Model {
    /// The point of a branch at a frequency between two of its points: of two roots the one that goes on from them.
    pub(super) fn between(&self, [low, high]: [&LobePoint; 2], frequency_hz: f64) -> Option<LobePoint> {
        let share = (frequency_hz - low.frequency_hz) / (high.frequency_hz - low.frequency_hz);
        let expected = LobePoint {
            frequency_hz,
            limit_mm: low.limit_mm * libm::pow(high.limit_mm / low.limit_mm, share),
            phase_rad: low.phase_rad + share * (high.phase_rad - low.phase_rad),
        };
        let found = self.limits_at(frequency_hz).into_iter().flatten();
        found
            .min_by(|a, b| distance(a, &expected).total_cmp(&distance(b, &expected)))
            .filter(|point| (point.phase_rad - expected.phase_rad).abs() < PI)
    }

    fn grid(&self) -> Vec<f64> {
        let lowest = self.modes().map(|mode| mode.frequency_hz).fold(f64::MAX, f64::min) * 0.2;
        let highest = self.highest_hz();
        let ratio = libm::log(highest / lowest);
        let mut grid: Vec<f64> =
            (0..=FREQUENCIES).map(|index| lowest * libm::exp(ratio * index as f64 / FREQUENCIES as f64)).collect();
        // At every speed there is a chatter frequency below that of edge passing, or within the range of the modes.
        let passing_hz = self.edges() / 60.0;
        let below = std::iter::successors(Some(lowest), |frequency| Some(frequency / OUTER_GROWTH));
        grid.extend(below.take_while(|&frequency| frequency > LEAST_WAVE * passing_hz));
        let above = std::iter::successors(Some(highest), |frequency| Some(frequency * OUTER_GROWTH));
        grid.extend(above.take_while(|&frequency| frequency < OUTER_GROWTH * MAX_RPM * passing_hz));
        for mode in self.modes() {
            let width = mode.frequency_hz * mode.damping_ratio;
            let near = -WIDTH_STEPS..=WIDTH_STEPS;
            grid.extend(near.map(|step| mode.frequency_hz + f64::from(step) * WIDTH_STEP * width));
            let edge = f64::from(WIDTH_STEPS) * WIDTH_STEP * width;
            let distances = std::iter::successors(Some(edge), |distance| Some(distance * WIDTH_GROWTH));
            let distances = distances.take_while(|&distance| distance < mode.frequency_hz);
            grid.extend(distances.flat_map(|distance| [mode.frequency_hz - distance, mode.frequency_hz + distance]));
        }
        grid.retain(|frequency| *frequency > 0.0);
        grid.sort_by(f64::total_cmp);
        grid.dedup();
        grid
    }

    /// Above all modes the limit only grows from here on.
    pub(super) fn highest_hz(&self) -> f64 {
        self.modes().map(|mode| mode.frequency_hz).fold(0.0, f64::max) * 5.0
    }

    /// Halves the distance between two points until the limit is smooth.
    fn refine(&self, points: &[LobePoint], budget: &mut usize) -> Vec<LobePoint> {
        let mut fine = Vec::with_capacity(points.len());
        let mut open: Vec<(LobePoint, LobePoint, u32)> = Vec::new();
        for pair in points.windows(2) {
            open.push((pair[0], pair[1], 0));
            while let Some((low, high, halvings)) = open.pop() {
                let middle_hz = 0.5 * (low.frequency_hz + high.frequency_hz);
                let middle = self.between([&low, &high], middle_hz).filter(|middle| {
                    let mean = 0.5 * (libm::log(low.limit_mm) + libm::log(high.limit_mm));
                    let limit = (libm::log(middle.limit_mm) - mean).abs();
                    limit + (middle.phase_rad - 0.5 * (low.phase_rad + high.phase_rad)).abs() > SMOOTH
                });
                match middle {
                    Some(middle) if halvings < MAX_HALVINGS && *budget > 0 => {
                        *budget -= 1;
                        open.push((middle, high, halvings + 1));
                        open.push((low, middle, halvings + 1));
                    }
                    _ => fine.push(low),
                }
            }
        }
        fine.extend(points.last());
        fine
    }

    /// The points of a branch from its last one towards a frequency at which it is no more.
    fn towards_end(&self, last: LobePoint, beyond_hz: f64) -> Vec<LobePoint> {
        let (mut inside, mut outside_hz) = (last, beyond_hz);
        let mut points = Vec::new();
        for _ in 0..END_HALVINGS {
            if inside.limit_mm > BOUNDLESS_MM {
                break;
            }
            let middle_hz = 0.5 * (inside.frequency_hz + outside_hz);
            let found = self.limits_at(middle_hz).into_iter().flatten();
            let next = found.min_by(|a, b| distance(a, &inside).total_cmp(&distance(b, &inside)));
            match next.filter(|next| (next.phase_rad - inside.phase_rad).abs() < 0.5 * PI) {
                Some(next) => {
                    points.push(next);
                    inside = next;
                }
                None => outside_hz = middle_hz,
            }
        }
        points
    }

    /// The lowest point between two others, by golden section.
    fn lowest(&self, ends: [&LobePoint; 2], middle: LobePoint) -> LobePoint {
        const GOLDEN: f64 = 0.381_966_011_250_105_1;
        let mut best = middle;
        let [mut low, mut high] = ends.map(|end| end.frequency_hz);
        for _ in 0..60 {
            let upper = high - best.frequency_hz > best.frequency_hz - low;
            let span = if upper { high - best.frequency_hz } else { low - best.frequency_hz };
            let Some(next) = self.between(ends, best.frequency_hz + GOLDEN * span) else { break };
            let (inner, outer) = (best.frequency_hz, next.frequency_hz);
            if next.limit_mm < best.limit_mm {
                best = next;
                if upper { low = inner } else { high = inner }
            } else if upper {
                high = outer;
            } else {
                low = outer;
            }
        }
        best
    }
}

/// How far two points are from each other, where one goes on from the other.
fn distance(a: &LobePoint, b: &LobePoint) -> f64 {
    (a.phase_rad - b.phase_rad).abs() + libm::log(a.limit_mm / b.limit_mm).abs().min(TAU)
}

impl Lobes {
    /// Follows the limits over frequencies around the modes, dense enough for narrow ones.
    pub(super) fn trace(model: Model) -> Self {
        let grid = model.grid();
        let mut traced: Vec<Vec<LobePoint>> = Vec::new();
        let mut open: [Vec<LobePoint>; 2] = Default::default();
        let mut before_hz = grid[0];
        for &frequency_hz in &grid {
            let mut limits = model.limits_at(frequency_hz);
            // The two roots may change places from one frequency to the next.
            let apart = |branch: &Vec<LobePoint>, point: Option<LobePoint>| match (branch.last(), point) {
                (Some(last), Some(point)) => distance(last, &point),
                _ => 1.0,
            };
            let straight = apart(&open[0], limits[0]) + apart(&open[1], limits[1]);
            let crossed = apart(&open[0], limits[1]) + apart(&open[1], limits[0]);
            if crossed < straight {
                limits.swap(0, 1);
            }
            for (branch, limit) in open.iter_mut().zip(limits) {
                let breaks = branch
                    .last()
                    .is_some_and(|last| limit.is_none_or(|point| (last.phase_rad - point.phase_rad).abs() > PI));
                if breaks {
                    let last = branch[branch.len() - 1];
                    branch.extend(model.towards_end(last, frequency_hz));
                    traced.push(std::mem::take(branch));
                }
                let Some(point) = limit else { continue };
                if branch.is_empty() && before_hz < frequency_hz {
                    branch.extend(model.towards_end(point, before_hz).into_iter().rev());
                }
                branch.push(point);
            }
            before_hz = frequency_hz;
        }
        traced.extend(open);
        traced.retain(|branch| branch.len() > 1);
        let mut budget = MAX_POINTS;
        let mut lows = Vec::new();
        let branches = traced.iter().map(|points| {
            let fine = model.refine(points, &mut budget);
            let mut points = Vec::with_capacity(fine.len());
            lows.extend(fine.first());
            for (index, &point) in fine.iter().enumerate() {
                let beside = index.checked_sub(1).map(|before| &fine[before]).zip(fine.get(index + 1));
                let dip = beside.filter(|(before, after)| {
                    before.limit_mm.min(after.limit_mm) >= point.limit_mm
                        && before.limit_mm.max(after.limit_mm) > point.limit_mm * (1.0 + LOWER)
                });
                let low = dip.map(|(before, after)| model.lowest([before, after], point));
                lows.extend(low);
                points.push(point);
                points.extend(low.filter(|low| low.frequency_hz != point.frequency_hz));
            }
            lows.extend(fine.last());
            points.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
            Branch::new(points)
        });
        let branches = branches.collect();
        Self { model, branches, lows }
    }
}
