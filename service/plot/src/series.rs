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
    /// Extent of the samples of cuts.
    cuts: Option<(f64, f64)>,
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
        Self { buckets: Vec::new(), samples_per_bucket: 1, samples_in_last: 0, cuts: None }
    }
}

impl Series {
    /// Adds a sample of a cut; times ascend.
    pub fn push_cut(&mut self, time_s: f64, value: f64) {
        let (low, high) = self.cuts.unwrap_or((value, value));
        self.cuts = Some((low.min(value), high.max(value)));
        self.push(time_s, value);
    }

    /// Adds a sample; times ascend.
    pub fn push(&mut self, time_s: f64, value: f64) {
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

    /// A range in which the cuts can be read: rapid moves may leave it where they are far larger. `None` when empty.
    #[must_use]
    pub fn legible_extent(&self) -> Option<(f64, f64)> {
        let (low, high) = self.extent()?;
        let Some((low_cut, high_cut)) = self.cuts else { return Some((low, high)) };
        let largest = high_cut.max(-low_cut);
        let is_legible = largest == 0.0 || high.max(-low) <= FAR_FACTOR * largest;
        Some(if is_legible { (low, high) } else { (low_cut, high_cut) })
    }

    /// Lowest and highest value; `None` when empty.
    #[must_use]
    pub fn extent(&self) -> Option<(f64, f64)> {
        let low = self.buckets.iter().map(|bucket| bucket.low.1).reduce(f64::min)?;
        let high = self.buckets.iter().map(|bucket| bucket.high.1).reduce(f64::max)?;
        Some((low, high))
    }
}

/// Rapid moves up to this many times as large as cuts stay in the picture.
const FAR_FACTOR: f64 = 1.7;

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
    fn rapid_moves_leave_the_range_where_they_are_far_larger_however_long_they_take() {
        let extent = |rapid: f64, share: u32| {
            let mut series = Series::default();
            for step in 0..10_000 {
                if step % 10 < share {
                    series.push(f64::from(step), rapid);
                } else {
                    series.push_cut(f64::from(step), 750.0);
                }
            }
            series.legible_extent()
        };
        assert_eq!(extent(30_000.0, 1), Some((750.0, 750.0)));
        assert_eq!(extent(30_000.0, 9), Some((750.0, 750.0)));
        assert_eq!(extent(1_000.0, 1), Some((750.0, 1_000.0)));
        assert_eq!(extent(30_000.0, 10), Some((30_000.0, 30_000.0)));
        assert_eq!(Series::default().legible_extent(), None);
    }
}
