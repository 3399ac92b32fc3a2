//! Monotone cubic interpolation (F. N. Fritsch and R. E. Carlson, SIAM J. Numer. Anal. 17, 1980): a curve through points
//! that never overshoots them, so that its extremes are among the points.

use serde::{Deserialize, Serialize};

use super::waveform::WavePeaks;

/// Slopes at the points that keep every interval monotone. `wraps` says that the last interval leads to the first point.
fn slopes(secants: &[f64], wraps: bool) -> Vec<f64> {
    let intervals = secants.len();
    let count = if wraps { intervals } else { intervals + 1 };
    let mut slopes: Vec<f64> = (0..count)
        .map(|point| {
            let before = if point > 0 { Some(secants[point - 1]) } else { secants.last().copied().filter(|_| wraps) };
            match (before, secants.get(point)) {
                (Some(before), Some(&after)) if before * after > 0.0 => 0.5 * (before + after),
                // An extreme, or a level part.
                (Some(_), Some(_)) => 0.0,
                (before, after) => before.or(after.copied()).unwrap_or(0.0),
            }
        })
        .collect();
    for (interval, &secant) in secants.iter().enumerate() {
        let next = (interval + 1) % count;
        if secant == 0.0 {
            slopes[interval] = 0.0;
            slopes[next] = 0.0;
            continue;
        }
        let (start, end) = (slopes[interval] / secant, slopes[next] / secant);
        let square = start * start + end * end;
        // Within the circle of radius 3 the cubic is monotone; making one slope smaller never leaves it elsewhere.
        if square > 9.0 {
            let share = 3.0 / square.sqrt();
            slopes[interval] = share * start * secant;
            slopes[next] = share * end * secant;
        }
    }
    slopes
}

/// A polynomial over one interval: value = c₀ + c₁·x + c₂·x² + c₃·x³, x from the interval's start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Piece {
    length: f64,
    coefficients: [f64; 4],
}

impl Piece {
    fn hermite(length: f64, values: [f64; 2], slopes: [f64; 2]) -> Self {
        let secant = (values[1] - values[0]) / length;
        let c2 = (3.0 * secant - 2.0 * slopes[0] - slopes[1]) / length;
        let c3 = (slopes[0] + slopes[1] - 2.0 * secant) / (length * length);
        Self { length, coefficients: [values[0], slopes[0], c2, c3] }
    }

    fn value(&self, x: f64) -> f64 {
        let [c0, c1, c2, c3] = self.coefficients;
        c0 + x * (c1 + x * (c2 + x * c3))
    }

    fn second(&self, x: f64) -> f64 {
        2.0 * self.coefficients[2] + 6.0 * self.coefficients[3] * x
    }

    /// Largest |first derivative|: at the ends or at the vertex of the parabola.
    fn largest_first(&self) -> f64 {
        let [_, c1, c2, c3] = self.coefficients;
        let first = |x: f64| (c1 + x * (2.0 * c2 + x * 3.0 * c3)).abs();
        let vertex = if c3 == 0.0 { 0.0 } else { -c2 / (3.0 * c3) };
        first(0.0).max(first(self.length)).max(first(vertex.clamp(0.0, self.length)))
    }
}

/// A periodic curve of period 1 through points (phase, value).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PeriodicCurve {
    phases: Vec<f64>,
    pieces: Vec<Piece>,
}

impl PeriodicCurve {
    /// The curve through at least two points with strictly increasing phases within [0, 1), which the caller has checked.
    pub(super) fn through(points: &[[f64; 2]]) -> Self {
        let count = points.len();
        let next = |index: usize| {
            let [phase, value] = points[(index + 1) % count];
            [if index + 1 == count { phase + 1.0 } else { phase }, value]
        };
        let length = |index: usize| next(index)[0] - points[index][0];
        let secants: Vec<f64> = (0..count).map(|index| (next(index)[1] - points[index][1]) / length(index)).collect();
        let slopes = slopes(&secants, true);
        let pieces = (0..count).map(|index| {
            let values = [points[index][1], next(index)[1]];
            Piece::hermite(length(index), values, [slopes[index], slopes[(index + 1) % count]])
        });
        Self { pieces: pieces.collect(), phases: points.iter().map(|point| point[0]).collect() }
    }

    /// Value at a phase of any size, turns.
    pub(super) fn value(&self, turns: f64) -> f64 {
        let phase = turns - turns.floor();
        let after = self.phases.partition_point(|&start| start <= phase);
        match after.checked_sub(1) {
            Some(index) => self.pieces[index].value(phase - self.phases[index]),
            // Before the first point the last piece is still on.
            None => {
                let last = self.pieces.len() - 1;
                self.pieces[last].value(phase + 1.0 - self.phases[last])
            }
        }
    }

    /// Peaks of the derivatives by phase.
    pub(super) fn peaks(&self) -> WavePeaks {
        let mut peaks = WavePeaks { first: 0.0, second: 0.0, third: 0.0, second_step: 0.0 };
        for (index, piece) in self.pieces.iter().enumerate() {
            let next = &self.pieces[(index + 1) % self.pieces.len()];
            let end = piece.second(piece.length);
            peaks.first = peaks.first.max(piece.largest_first());
            peaks.second = peaks.second.max(piece.second(0.0).abs()).max(end.abs());
            peaks.third = peaks.third.max(6.0 * piece.coefficients[3].abs());
            peaks.second_step = peaks.second_step.max((next.second(0.0) - end).abs());
        }
        peaks
    }

    /// Middle and length of the longest stretch at `sign` times the highest value of the curve, turns.
    pub(super) fn extreme(&self, sign: f64) -> (f64, f64) {
        let values: Vec<f64> = self.pieces.iter().map(|piece| sign * piece.coefficients[0]).collect();
        let top = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let count = values.len();
        let mut best = (0.0, -1.0);
        for start in (0..count).filter(|&index| values[index] == top) {
            let mut length = 0.0;
            let mut index = start;
            // A level piece lies between two highest points.
            while values[(index + 1) % count] == top && length < 1.0 {
                length += self.pieces[index].length;
                index = (index + 1) % count;
            }
            if length > best.1 {
                best = (self.phases[start] + 0.5 * length, length);
            }
        }
        (best.0 - best.0.floor(), best.1.clamp(0.0, 1.0))
    }
}

/// Value at `x` of the monotone curve through `points` (strictly increasing abscissae); beyond its ends the first or last
/// value. 0 where there are no points.
pub(super) fn monotone_value(abscissae: &[f64], values: &[f64], x: f64) -> f64 {
    let count = abscissae.len().min(values.len());
    let Some(last) = count.checked_sub(1) else { return 0.0 };
    if x <= abscissae[0] || last == 0 {
        return values[0];
    }
    if x >= abscissae[last] {
        return values[last];
    }
    let secants: Vec<f64> =
        (0..last).map(|i| (values[i + 1] - values[i]) / (abscissae[i + 1] - abscissae[i])).collect();
    let slopes = slopes(&secants, false);
    let index = abscissae[..count].partition_point(|&start| start <= x) - 1;
    let length = abscissae[index + 1] - abscissae[index];
    let piece = Piece::hermite(length, [values[index], values[index + 1]], [slopes[index], slopes[index + 1]]);
    piece.value(x - abscissae[index])
}
