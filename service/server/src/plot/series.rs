//! Downsampling for pictures: a curve of any length in bounded memory that still shows every peak.

/// Buckets at most; a power of two so that pairs always merge cleanly. More than the pixels of a panel.
const MAX_BUCKETS: usize = 4_096;

/// A curve over time. Each bucket keeps its first, lowest, highest and last sample, which is all that a picture
/// of that width can show; when the buckets run out, neighbours merge and buckets become twice as wide.
#[derive(Clone, Debug)]
pub struct Series {
    buckets: Vec<Bucket>,
    samples_per_bucket: u64,
    samples_in_last: u64,
    magnitudes: Magnitudes,
}

type Sample = (f64, f64);

#[derive(Clone, Copy, Debug)]
struct Bucket {
    first: Sample,
    low: Sample,
    high: Sample,
    last: Sample,
}

impl Bucket {
    const fn of(sample: Sample) -> Self {
        Self { first: sample, low: sample, high: sample, last: sample }
    }

    /// Takes in a later bucket.
    fn merge(&mut self, later: &Self) {
        if later.low.1 < self.low.1 {
            self.low = later.low;
        }
        if later.high.1 > self.high.1 {
            self.high = later.high;
        }
        self.last = later.last;
    }
}

impl Default for Series {
    fn default() -> Self {
        Self { buckets: Vec::new(), samples_per_bucket: 1, samples_in_last: 0, magnitudes: Magnitudes::default() }
    }
}

impl Series {
    /// Adds a sample; times ascend.
    pub fn push(&mut self, time_s: f64, value: f64) {
        self.magnitudes.count(value);
        let sample = Bucket::of((time_s, value));
        match self.buckets.last_mut() {
            Some(last) if self.samples_in_last < self.samples_per_bucket => {
                last.merge(&sample);
                self.samples_in_last += 1;
            }
            _ => {
                if self.buckets.len() == MAX_BUCKETS {
                    self.halve();
                }
                self.buckets.push(sample);
                self.samples_in_last = 1;
            }
        }
    }

    fn halve(&mut self) {
        for pair in 0..MAX_BUCKETS / 2 {
            let mut merged = self.buckets[2 * pair];
            merged.merge(&self.buckets[2 * pair + 1]);
            self.buckets[pair] = merged;
        }
        self.buckets.truncate(MAX_BUCKETS / 2);
        self.samples_per_bucket *= 2;
    }

    /// The curve, in the order of time.
    #[must_use]
    pub fn points(&self) -> Vec<(f64, f64)> {
        let mut points = Vec::with_capacity(self.buckets.len() * 4);
        for bucket in &self.buckets {
            let (early, late) =
                if bucket.low.0 <= bucket.high.0 { (bucket.low, bucket.high) } else { (bucket.high, bucket.low) };
            for sample in [bucket.first, early, late, bucket.last] {
                if points.last() != Some(&sample) {
                    points.push(sample);
                }
            }
        }
        points
    }

    /// A range for pictures in which rare, far larger values (rapid moves in a plot of feeds) may leave the panel so
    /// that the rest can be read; whether they do. `None` when empty.
    #[must_use]
    pub fn legible_extent(&self) -> Option<((f64, f64), bool)> {
        let (low, high) = self.extent()?;
        let usual = self.magnitudes.below(USUAL_SHARE);
        let limit = ROOM_FACTOR * usual;
        if usual == 0.0 || high.max(-low) <= RARE_FACTOR * usual {
            return Some(((low, high), false));
        }
        Some(((low.max(-limit), high.min(limit)), true))
    }

    /// Lowest and highest value; `None` when empty.
    #[must_use]
    pub fn extent(&self) -> Option<(f64, f64)> {
        let low = self.buckets.iter().map(|bucket| bucket.low.1).reduce(f64::min)?;
        let high = self.buckets.iter().map(|bucket| bucket.high.1).reduce(f64::max)?;
        Some((low, high))
    }
}

/// Share of the time that a curve is to be legible in.
const USUAL_SHARE: f64 = 0.95;
/// Values this much larger than those of most of the time may leave the panel.
const RARE_FACTOR: f64 = 4.0;
/// Room that is then left for values above the usual.
const ROOM_FACTOR: f64 = 2.0;

/// Counts magnitudes in classes of a few per cent: enough to say what is usual.
#[derive(Clone, Debug)]
struct Magnitudes {
    classes: Vec<u64>,
    total: u64,
}

/// Classes per factor of two, and the exponent of the smallest class.
const CLASSES_PER_OCTAVE: f64 = 16.0;
const SMALLEST_EXPONENT: f64 = -20.0;
const CLASS_COUNT: usize = 1_024;

impl Default for Magnitudes {
    fn default() -> Self {
        Self { classes: vec![0; CLASS_COUNT], total: 0 }
    }
}

impl Magnitudes {
    fn count(&mut self, value: f64) {
        // Zero and the smallest fall into the first class, the largest into the last: the cast saturates.
        let class = ((value.abs().log2() - SMALLEST_EXPONENT) * CLASSES_PER_OCTAVE) as usize;
        self.classes[class.min(CLASS_COUNT - 1)] += 1;
        self.total += 1;
    }

    /// The magnitude that this share of the values stays below.
    fn below(&self, share: f64) -> f64 {
        let wanted = share * self.total as f64;
        let mut seen = 0;
        for (class, count) in self.classes.iter().enumerate() {
            seen += count;
            if seen as f64 >= wanted {
                let upper = (class + 1) as f64 / CLASSES_PER_OCTAVE + SMALLEST_EXPONENT;
                return if class == 0 { 0.0 } else { upper.exp2() };
            }
        }
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_series_is_kept_whole() {
        let mut series = Series::default();
        for step in 0..100 {
            series.push(f64::from(step), f64::from(step % 7));
        }
        assert_eq!(series.points(), (0..100).map(|step| (f64::from(step), f64::from(step % 7))).collect::<Vec<_>>());
    }

    #[test]
    fn a_long_series_stays_small_and_keeps_its_peaks_and_ends() {
        let mut series = Series::default();
        for step in 0..1_000_003_u32 {
            let value = if step == 654_321 { 1e6 } else { f64::from(step % 13) };
            series.push(f64::from(step), value);
        }
        let points = series.points();
        assert!(points.len() <= 4 * MAX_BUCKETS);
        assert_eq!(points.first(), Some(&(0.0, 0.0)));
        assert_eq!(points.last().map(|point| point.0), Some(1_000_002.0));
        assert!(points.contains(&(654_321.0, 1e6)));
        assert!(points.windows(2).all(|pair| pair[0].0 <= pair[1].0));
        assert_eq!(series.extent(), Some((0.0, 1e6)));
    }

    #[test]
    fn rare_large_values_leave_the_panel_and_frequent_ones_do_not() {
        let series = |large_every: u32| {
            let mut series = Series::default();
            for step in 0..10_000 {
                let value = if step % large_every == 0 { 30_000.0 } else { 100.0 };
                series.push(f64::from(step), value);
            }
            series.legible_extent().unwrap()
        };
        let ((low, high), cut) = series(100);
        assert!(cut && low == 100.0 && (200.0..220.0).contains(&high), "{high}");
        assert_eq!(series(10), ((100.0, 30_000.0), false));
        assert_eq!(Series::default().legible_extent(), None);
    }
}
