//! How far what is left of the deflection is from white noise, and by how much that widens the standard errors.

/// Fewest lags that are examined, and most.
const LEAST_LAGS: usize = 100;
pub(super) const MOST_LAGS: usize = 1_000;
/// Correlations of white noise lie within so many standard deviations but for one in a thousand.
const BEYOND_CHANCE: f64 = 3.3;

/// What is left of records.
///
/// Two factors are made of it, and the larger one counts:
///
/// - √(1 + 2·Σρ_k) over the lags of a turn of the spindle at which it is correlated beyond chance (Bartlett). What swings counts with
///   the lags at which it adds only, so the factor is none too small.
/// - What comes again with every turn is no noise but what the model lacks, and another turn tells nothing new of it: it counts as one
///   turn, however many there are. With m the mean over the turns by the spindle's angle and T the turns, T·m² is σ² of white
///   noise in the mean; the factor is the root of T·m²/σ², with the correlations of m within the turn as above.
pub(super) struct Residuals {
    /// Sums of products by lag.
    lags: Vec<f64>,
    /// The same of the means over the turns, each with the number of turns.
    turns: Vec<f64>,
    samples: usize,
    means: usize,
}

impl Residuals {
    /// Of records with turns of no more samples than these.
    pub(super) fn new(turn: usize) -> Self {
        let lags = turn.clamp(LEAST_LAGS, MOST_LAGS) + 1;
        Self { lags: vec![0.0; lags], turns: vec![0.0; lags], samples: 0, means: 0 }
    }

    /// Takes one direction of a record in: turns of the spindle, and what is left there.
    pub(super) fn add(&mut self, left: &[(f64, f64)], turn: usize) {
        for (lag, sum) in self.lags.iter_mut().enumerate() {
            *sum += left.iter().zip(left.iter().skip(lag)).map(|(a, b)| a.1 * b.1).sum::<f64>();
        }
        self.samples += left.len();
        let bins = turn.clamp(1, MOST_LAGS);
        let mut sums = vec![(0.0, 0.0); bins];
        for (turns, left) in left {
            let bin = ((turns - turns.floor()) * bins as f64) as usize;
            let (sum, count) = &mut sums[bin.min(bins - 1)];
            (*sum, *count) = (*sum + left, *count + 1.0);
        }
        // Each is as wide as a sample.
        let means: Vec<f64> =
            sums.iter().map(|&(sum, count)| if count > 0.0 { sum / f64::sqrt(count) } else { 0.0 }).collect();
        for (lag, sum) in self.turns.iter_mut().enumerate().take(bins / 2 + 1) {
            *sum += (0..bins).map(|bin| means[bin] * means[(bin + lag) % bins]).sum::<f64>();
        }
        self.means += sums.iter().filter(|(_, count)| *count > 0.0).count();
    }

    /// The factor of the standard errors, 1 at least.
    pub(super) fn factor(&self) -> f64 {
        let variance = self.lags[0] / (self.samples as f64).max(1.0);
        let chance = BEYOND_CHANCE / (self.samples as f64).max(1.0).sqrt();
        let within = 1.0 + 2.0 * beyond(self.lags[1..].iter().map(|sum| sum / self.lags[0]), chance);
        let means = (self.means as f64).max(1.0);
        let again: Vec<f64> = self.turns.iter().map(|sum| sum / (means * variance)).collect();
        // The mean of squares of white noise is off by √(2/n) at one standard deviation.
        if again[0] <= 1.0 + BEYOND_CHANCE * (2.0 / means).sqrt() {
            return within.sqrt();
        }
        let again = again[0] + 2.0 * beyond(again[1..].iter().copied(), BEYOND_CHANCE / means.sqrt());
        within.max(again).sqrt()
    }
}

/// The sum of the correlations that chance does not make.
fn beyond(correlations: impl Iterator<Item = f64>, chance: f64) -> f64 {
    correlations.filter(|share| *share > chance).sum()
}
