//! The deepest stable speeds of bands, as a spindle table.

use super::{Check, LOW_IMMERSION_ERROR, LobeError, Lobes};
use crate::rules::{SpindleTable, TableRow};
use std::collections::VecDeque;

/// Speeds examined in each band.
const SPEEDS_PER_BAND: usize = 400;
/// Most bands.
const MAX_BANDS: u32 = 256;
/// Highest speed, rev/min.
pub(super) const MAX_RPM: f64 = 1e6;

/// What the spindle table is to cover.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PocketRequest {
    /// Lowest speed, rev/min.
    pub lowest_rev_per_min: f64,
    /// Highest speed, rev/min.
    pub highest_rev_per_min: f64,
    /// Bands of equal width.
    pub bands: u32,
    /// Fraction taken off every limit. The zeroth order errs by up to about 0.15 on the unsafe side at low radial immersion.
    pub margin: f64,
    /// How far the true speed may be off, as a fraction: a pocket counts with the smallest limit within it.
    pub speed_tolerance: f64,
    /// Depth or width that must be stable in every band, mm.
    pub required_mm: Option<f64>,
}

/// Best speed of one band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pocket {
    /// Band and speed, as a row of the table.
    pub row: TableRow,
    /// Stable depth or width there in mm, margin taken off; `None` when no depth chatters.
    pub stable_mm: Option<f64>,
}

impl Check {
    pub(super) fn speeds(&mut self, lowest_rev_per_min: f64, highest_rev_per_min: f64) {
        self.within("lowest_rev_per_min", lowest_rev_per_min, 1.0, MAX_RPM);
        self.within("highest_rev_per_min", highest_rev_per_min, lowest_rev_per_min * 1.001, MAX_RPM);
    }
}

impl PocketRequest {
    /// Bands by default.
    pub const BANDS: u32 = 8;
    /// Margin by default: what the zeroth order may err by.
    pub const MARGIN: f64 = LOW_IMMERSION_ERROR;
    /// Tolerance of the speed by default.
    pub const SPEED_TOLERANCE: f64 = 0.01;

    /// Everything that is impossible, field by field.
    pub fn problems(&self) -> Vec<LobeError> {
        let mut check = Check::default();
        check.speeds(self.lowest_rev_per_min, self.highest_rev_per_min);
        check.within("bands", f64::from(self.bands), 1.0, f64::from(MAX_BANDS));
        check.within("margin", self.margin, 0.0, 0.9);
        check.within("speed_tolerance", self.speed_tolerance, 0.0, 0.2);
        check.within("required_mm", self.required_mm.unwrap_or(0.0), 0.0, 1e4);
        check.0
    }
}

impl Lobes {
    /// Best pocket of each band.
    ///
    /// # Errors
    /// [`LobeError`] for an impossible request, and when a required depth is not stable in a band.
    pub fn pockets(&self, request: &PocketRequest) -> Result<Vec<Pocket>, LobeError> {
        let PocketRequest { lowest_rev_per_min, highest_rev_per_min, bands, margin, speed_tolerance, required_mm } =
            *request;
        Check(request.problems()).finish()?;
        let count = bands as usize * SPEEDS_PER_BAND;
        let step = (highest_rev_per_min - lowest_rev_per_min) / count as f64;
        let speeds: Vec<f64> = (0..=count).map(|index| lowest_rev_per_min + step * index as f64).collect();
        let bounds = |band: usize| speeds[band * SPEEDS_PER_BAND];
        // So near the ends of the range the limits around a speed are not known, and a little more speed leaves the table.
        let inside = speeds.partition_point(|&speed| speed * (1.0 - speed_tolerance) < lowest_rev_per_min)
            ..speeds.partition_point(|&speed| speed * (1.0 + speed_tolerance) <= highest_rev_per_min);
        let robust = self.least_around(
            speeds.get(inside.clone()).unwrap_or_default(),
            speed_tolerance,
            self.last_lobe(lowest_rev_per_min)?,
        );
        (0..bands as usize)
            .map(|band| {
                let first = (band * SPEEDS_PER_BAND + 1).max(inside.start);
                let end = ((band + 1) * SPEEDS_PER_BAND + 1).min(inside.end);
                if first >= end {
                    let (above_rev_per_min, up_to_rev_per_min) = (bounds(band), bounds(band + 1));
                    return Err(LobeError::BandTooNarrow { above_rev_per_min, up_to_rev_per_min, speed_tolerance });
                }
                // Among equals the slowest: it is kept unless another is strictly deeper.
                let (mut best, mut depth) = (first, f64::NEG_INFINITY);
                for index in first..end {
                    let limit = robust[index - inside.start];
                    if limit > depth {
                        (best, depth) = (index, limit);
                    }
                }
                let stable_mm = depth.is_finite().then_some(depth * (1.0 - margin));
                let row = TableRow {
                    above_rev_per_min: bounds(band),
                    up_to_rev_per_min: bounds(band + 1),
                    spindle_rev_per_min: speeds[best],
                };
                match (stable_mm, required_mm) {
                    (Some(stable_mm), Some(required_mm)) if stable_mm < required_mm => Err(LobeError::TooDeep {
                        above_rev_per_min: row.above_rev_per_min,
                        up_to_rev_per_min: row.up_to_rev_per_min,
                        stable_mm,
                        required_mm,
                        margin,
                    }),
                    _ => Ok(Pocket { row, stable_mm }),
                }
            })
            .collect()
    }

    /// The least exact limit that a speed can meet which is off by up to `tolerance` of itself, mm, for rising speeds;
    /// infinite where nothing chatters. A lobe is lowest at an end of such a range, or where it is lowest of all within it.
    fn least_around(&self, spindle_rev_per_min: &[f64], tolerance: f64, last_lobe: u32) -> Vec<f64> {
        let lows = self.low_speeds(last_lobe);
        let mut next = 0;
        // Those of the range that are lower than all after them, by rising speed.
        let mut falling: VecDeque<(f64, f64)> = VecDeque::new();
        let exact = |spindle_rev_per_min: f64| {
            self.exact(spindle_rev_per_min, last_lobe).map_or(f64::INFINITY, |exact| exact.limit.limit_mm)
        };
        let least = |&spindle_rev_per_min: &f64| {
            let [slow, fast] = [1.0 - tolerance, 1.0 + tolerance].map(|share| spindle_rev_per_min * share);
            while let Some(&low) = lows.get(next).filter(|low| low.0 <= fast) {
                while falling.back().is_some_and(|last| last.1 >= low.1) {
                    falling.pop_back();
                }
                falling.push_back(low);
                next += 1;
            }
            while falling.front().is_some_and(|first| first.0 < slow) {
                falling.pop_front();
            }
            let inside = falling.front().map_or(f64::INFINITY, |low| low.1);
            exact(slow).min(exact(fast)).min(inside)
        };
        spindle_rev_per_min.iter().map(least).collect()
    }
}

impl SpindleTable {
    /// The table of the pockets.
    pub fn from_pockets(pockets: &[Pocket]) -> Self {
        Self { rows: pockets.iter().map(|pocket| pocket.row).collect() }
    }
}
