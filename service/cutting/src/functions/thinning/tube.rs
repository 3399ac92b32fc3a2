//! The smoothest curve within a tube: of all values within their distance of the given ones, those that bend least.
//!
//! Least ½·Σ mᵢ·y″ᵢ² with |yᵢ − dᵢ| ≤ τᵢ, y″ the second divided difference over the neighbours and m the length that stands
//! for it: the discrete form of ∫ y″² ds (Whittaker, On a new method of graduation, 1923) with bounds instead of weights. A
//! quadratic program in a band of five, solved by a primal-dual interior point method (Wright, Primal-Dual Interior-Point
//! Methods, SIAM 1997, chapter 5). It starts in the middle of the tube and every iterate is inside, so that wherever it ends
//! the bounds hold; what is left to more steps is smoothness only. Only + − × ÷ are used: the same to the bit everywhere.

/// Steps: the gap falls by about [`CENTERING`] in each, to 1e-9 of the curve's energy.
const STEPS: usize = 18;
/// Share of the gap that a step aims at.
const CENTERING: f64 = 0.2;
/// Share of the way to the wall of the tube that a step may go.
const TO_THE_WALL: f64 = 0.95;
/// Least distance from a wall that counts, as a share of the half width: beyond, rounding would make it none.
const NEAREST: f64 = 1e-12;
/// Least weight of a value against the largest of the curve, and least pivot: between bounds that do not touch, a straight
/// curve may be moved at no cost, and rounding must not move it.
const LEAST_WEIGHT: f64 = 1e-11;
const LEAST_PIVOT: f64 = 1e-15;
/// Weight that keeps a value where it is, against those of the curve.
const FIXED: f64 = 1e30;
/// Lengths between two values are taken within these shares of their mean: what is beside them says nothing of the rest.
const LENGTH_SHARES: (f64, f64) = (0.05, 20.0);

/// Values with the tube around them.
#[derive(Clone, Debug, Default)]
pub(super) struct Tube {
    /// Given values.
    pub(super) values: Vec<f64>,
    /// Half widths; 0 keeps the value.
    pub(super) widths: Vec<f64>,
}

/// The lengths between the points of a fit, made comparable; shared by all components.
#[derive(Clone, Debug, Default)]
pub(super) struct Spacing(Vec<f64>);

impl Spacing {
    /// From the lengths between neighbours, all of them above 0.
    pub(super) fn new(lengths: impl ExactSizeIterator<Item = f64> + Clone) -> Self {
        let count = lengths.len().max(1) as f64;
        let mean = lengths.clone().sum::<f64>() / count;
        let (least, most) = LENGTH_SHARES;
        Self(lengths.map(|length| (length / mean).clamp(least, most)).collect())
    }
}

/// A symmetric matrix of bandwidth two: its diagonal and the two beside it.
#[derive(Clone, Debug)]
struct Band {
    diagonal: Vec<f64>,
    first: Vec<f64>,
    second: Vec<f64>,
}

impl Band {
    /// Of the bending energy.
    fn bending(spacing: &Spacing, count: usize) -> Self {
        let mut band = Self { diagonal: vec![0.0; count], first: vec![0.0; count], second: vec![0.0; count] };
        for middle in 1..count.saturating_sub(1) {
            let (before, after) = (spacing.0[middle - 1], spacing.0[middle]);
            let half = 0.5 * (before + after);
            // y″ = ((y₊ − y)/after − (y − y₋)/before)/half, and half stands for it.
            let row = [1.0 / (before * half), -(1.0 / before + 1.0 / after) / half, 1.0 / (after * half)];
            for (place, value) in row.iter().enumerate() {
                band.diagonal[middle - 1 + place] += half * value * value;
            }
            band.first[middle - 1] += half * row[0] * row[1];
            band.first[middle] += half * row[1] * row[2];
            band.second[middle - 1] += half * row[0] * row[2];
        }
        band
    }

    /// The largest of its diagonal, against which everything else is small or large.
    fn scale(&self) -> f64 {
        self.diagonal.iter().copied().fold(0.0, f64::max)
    }

    fn times(&self, x: &[f64]) -> Vec<f64> {
        let count = x.len();
        let mut product: Vec<f64> = x.iter().zip(&self.diagonal).map(|(x, diagonal)| x * diagonal).collect();
        for place in 0..count {
            if place + 1 < count {
                product[place] += self.first[place] * x[place + 1];
                product[place + 1] += self.first[place] * x[place];
            }
            if place + 2 < count {
                product[place] += self.second[place] * x[place + 2];
                product[place + 2] += self.second[place] * x[place];
            }
        }
        product
    }

    /// Solves (self + diag(added))·x = right by LDLᵀ in place of `right`.
    fn solve(&self, added: &[f64], right: &mut [f64]) {
        let (count, least) = (right.len(), LEAST_PIVOT * self.scale());
        let (mut pivots, mut lower, mut further) = (vec![0.0; count], vec![0.0; count], vec![0.0; count]);
        for row in 0..count {
            let (mut pivot, mut beside) = (self.diagonal[row] + added[row], self.first[row]);
            if row >= 1 {
                pivot -= lower[row - 1] * lower[row - 1] * pivots[row - 1];
                beside -= lower[row - 1] * further[row - 1] * pivots[row - 1];
            }
            if row >= 2 {
                pivot -= further[row - 2] * further[row - 2] * pivots[row - 2];
            }
            let pivot = pivot.max(least);
            pivots[row] = pivot;
            lower[row] = beside / pivot;
            further[row] = self.second[row] / pivot;
        }
        for row in 0..count {
            if row >= 1 {
                right[row] -= lower[row - 1] * right[row - 1];
            }
            if row >= 2 {
                right[row] -= further[row - 2] * right[row - 2];
            }
        }
        for row in (0..count).rev() {
            right[row] /= pivots[row];
            if row + 1 < count {
                right[row] -= lower[row] * right[row + 1];
            }
            if row + 2 < count {
                right[row] -= further[row] * right[row + 2];
            }
        }
    }
}

impl Tube {
    /// The smoothest values within the tube, at these lengths from each other.
    pub(super) fn smoothest(&self, spacing: &Spacing) -> Vec<f64> {
        let count = self.values.len();
        if count < 3 || self.widths.iter().all(|width| *width <= 0.0) {
            return self.values.clone();
        }
        let bending = Band::bending(spacing, count);
        let is_free: Vec<bool> = self.widths.iter().map(|width| *width > 0.0).collect();
        let free = is_free.iter().filter(|free| **free).count() as f64;
        // Distances from the given values, and the multipliers of the lower and the upper wall.
        let mut moved = vec![0.0; count];
        let scale = bending.scale();
        let mut walls: Vec<[f64; 2]> =
            self.widths.iter().map(|width| [scale * width.max(f64::MIN_POSITIVE); 2]).collect();
        for _ in 0..STEPS {
            let gap: f64 = (0..count)
                .filter(|at| is_free[*at])
                .map(|at| {
                    let (low, high) = self.distances(at, moved[at]);
                    walls[at][0] * low + walls[at][1] * high
                })
                .sum();
            let aim = CENTERING * gap / (2.0 * free);
            self.step(&bending, &is_free, aim, &mut moved, &mut walls);
        }
        let inside = |at: usize| moved[at].clamp(-self.widths[at], self.widths[at]);
        if moved.iter().any(|moved| !moved.is_finite()) {
            // Beyond what numbers can hold nothing is smoother than what is given.
            return self.values.clone();
        }
        (0..count).map(|at| if is_free[at] { self.values[at] + inside(at) } else { self.values[at] }).collect()
    }

    /// Distances from the lower and the upper wall.
    fn distances(&self, at: usize, moved: f64) -> (f64, f64) {
        let (width, least) = (self.widths[at], NEAREST * self.widths[at]);
        ((width + moved).max(least), (width - moved).max(least))
    }

    /// One step of Newton's method towards the point where every product of a wall's multiplier and distance is `aim`.
    fn step(&self, bending: &Band, is_free: &[bool], aim: f64, moved: &mut [f64], walls: &mut [[f64; 2]]) {
        let (count, least) = (moved.len(), LEAST_WEIGHT * bending.scale());
        let values: Vec<f64> = self.values.iter().zip(&*moved).map(|(value, moved)| value + moved).collect();
        let mut change = bending.times(&values);
        let mut added = vec![FIXED; count];
        for at in 0..count {
            let (low, high) = self.distances(at, moved[at]);
            if is_free[at] {
                change[at] = aim / low - aim / high - change[at];
                added[at] = (walls[at][0] / low + walls[at][1] / high).max(least);
            } else {
                change[at] = 0.0;
            }
        }
        bending.solve(&added, &mut change);
        let mut share: f64 = 1.0;
        let mut turns = vec![[0.0; 2]; count];
        for at in (0..count).filter(|at| is_free[*at]) {
            let (low, high) = self.distances(at, moved[at]);
            let [lower, upper] = walls[at];
            turns[at] = [aim / low - lower - lower / low * change[at], aim / high - upper + upper / high * change[at]];
            for (distance, toward) in
                [(low, change[at]), (high, -change[at]), (lower, turns[at][0]), (upper, turns[at][1])]
            {
                if toward < 0.0 {
                    share = share.min(-TO_THE_WALL * distance / toward);
                }
            }
        }
        for at in (0..count).filter(|at| is_free[*at]) {
            moved[at] += share * change[at];
            walls[at][0] += share * turns[at][0];
            walls[at][1] += share * turns[at][1];
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn smoothest(values: Vec<f64>, widths: Vec<f64>) -> Vec<f64> {
        let spacing = Spacing::new(std::iter::repeat_n(1.0, values.len() - 1));
        Tube { values, widths }.smoothest(&spacing)
    }

    fn bending(values: &[f64]) -> f64 {
        values.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).powi(2)).sum()
    }

    fn reversals(values: &[f64]) -> usize {
        let senses: Vec<bool> = values
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .filter(|step| step.abs() > 1e-9)
            .map(|step| step > 0.0)
            .collect();
        senses.windows(2).filter(|pair| pair[0] != pair[1]).count()
    }

    #[test]
    fn flicker_within_the_tube_becomes_a_line() {
        let values: Vec<f64> = (0..400).map(|at| 0.01 * f64::from(at) + if at % 2 == 0 { 0.4 } else { -0.4 }).collect();
        let smooth = smoothest(values.clone(), vec![0.5; 400]);
        assert!(bending(&smooth) < 1e-9 * bending(&values), "{}", bending(&smooth));
        assert_eq!(reversals(&smooth), 0);
    }

    #[test]
    fn a_sharp_turn_stays_without_the_flicker_beside_it() {
        let flicker = |at: usize| if at.is_multiple_of(2) { 0.3 } else { -0.3 };
        let turn = |at: usize| 10.0 * (at as f64 - 100.0).clamp(0.0, 3.0);
        let values: Vec<f64> = (0..200).map(|at| turn(at) + flicker(at)).collect();
        let smooth = smoothest(values.clone(), vec![0.5; 200]);
        assert!(reversals(&values) > 150);
        // Before the turn it gathers way and behind it it comes to rest: nothing else is left.
        assert!(reversals(&smooth) <= 4, "{}", reversals(&smooth));
        assert!((smooth[199] - smooth[0] - 30.0).abs() < 1.7);
    }

    #[test]
    fn what_is_fixed_stays_to_the_bit() {
        let values: Vec<f64> = (0..50).map(|at| (f64::from(at) * 0.7).sin()).collect();
        let mut widths = vec![0.2; 50];
        for at in [0, 1, 20, 49] {
            widths[at] = 0.0;
        }
        let smooth = smoothest(values.clone(), widths);
        for at in [0, 1, 20, 49] {
            assert_eq!(smooth[at].to_bits(), values[at].to_bits());
        }
        assert!(bending(&smooth) < 0.7 * bending(&values));
    }

    proptest! {
        /// Always within the tube, and no small change within it bends less.
        #[test]
        fn the_values_are_within_the_tube_and_cannot_be_bettered(
            values in prop::collection::vec(-1.0..1.0f64, 3..60),
            width in 0.01..1.0f64,
            lengths in prop::collection::vec(1e-3..10.0f64, 60),
            nudges in prop::collection::vec((0usize..60, -1.0..1.0f64), 20),
        ) {
            let count = values.len();
            let spacing = Spacing::new(lengths[..count - 1].iter().copied());
            let tube = Tube { values: values.clone(), widths: vec![width; count] };
            let smooth = tube.smoothest(&spacing);
            for (smooth, value) in smooth.iter().zip(&values) {
                prop_assert!((smooth - value).abs() <= width * (1.0 + 1e-15));
            }
            let energy = |values: &[f64]| {
                let band = Band::bending(&spacing, count);
                values.iter().zip(band.times(values)).map(|(a, b)| a * b).sum::<f64>()
            };
            let (least, given) = (energy(&smooth), energy(&values));
            prop_assert!(least <= given * (1.0 + 1e-9) + 1e-12);
            for (at, nudge) in nudges {
                let mut other = smooth.clone();
                let at = at % count;
                other[at] = (other[at] + 1e-3 * nudge).clamp(values[at] - width, values[at] + width);
                prop_assert!(energy(&other) >= least - 1e-6 * given - 1e-9, "{} below {}", energy(&other), least);
            }
        }
    }
}
