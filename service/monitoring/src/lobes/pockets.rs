//! The deepest stable speeds of bands, as a spindle table.

use super::{Check, LobeError, Lobes, MAX_LOBES};
use crate::rules::{SpindleTable, TableRow};
use serde::{Deserialize, Serialize};

/// Speeds looked at in each band.
const SPEEDS_PER_BAND: usize = 400;
/// Most bands.
const MAX_BANDS: u32 = 256;
/// Highest speed, rev/min.
const MAX_RPM: f64 = 1e6;
/// Most speeds of a chart.
const MAX_CHART_SPEEDS: f64 = 20_000.0;

/// What the spindle table is to cover.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PocketRequest {
    /// Lowest speed, rev/min.
    pub lowest_rpm: f64,
    /// Highest speed, rev/min.
    pub highest_rpm: f64,
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pocket {
    /// Band and speed, as a row of the table.
    pub row: TableRow,
    /// Stable depth or width there in mm, margin taken off; `None` when no depth chatters.
    pub stable_mm: Option<f64>,
}

/// Where stability ends at one speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ChartLimit {
    /// Largest stable depth or width, mm, without margin.
    pub limit_mm: f64,
    /// Frequency at which it chatters above, Hz.
    pub frequency_hz: f64,
    /// Number of the lobe, from 0 at the highest speeds: whole waves between two edges.
    pub lobe: u32,
}

/// One speed of the stability chart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ChartPoint {
    /// Spindle speed, rev/min.
    pub speed_rpm: f64,
    /// Limit; `None` where nothing chatters.
    pub limit: Option<ChartLimit>,
}

impl Check {
    fn speeds(&mut self, lowest_rpm: f64, highest_rpm: f64) {
        self.within("lowest_rpm", lowest_rpm, 1.0, MAX_RPM);
        self.within("highest_rpm", highest_rpm, lowest_rpm * 1.001, MAX_RPM);
    }
}

impl PocketRequest {
    /// Everything that is impossible, field by field.
    pub fn problems(&self) -> Vec<LobeError> {
        let mut check = Check::default();
        check.speeds(self.lowest_rpm, self.highest_rpm);
        check.within("bands", f64::from(self.bands), 1.0, f64::from(MAX_BANDS));
        check.within("margin", self.margin, 0.0, 0.9);
        check.within("speed_tolerance", self.speed_tolerance, 0.0, 0.2);
        check.within("required_mm", self.required_mm.unwrap_or(0.0), 0.0, 1e4);
        check.0
    }
}

impl Lobes {
    /// Looks at every limit that any lobe sets at rising speeds: index of the speed, limit in mm, chatter frequency, lobe.
    fn scan(&self, speeds_rpm: &[f64], mut visit: impl FnMut(usize, f64, f64, u32)) -> Result<(), LobeError> {
        let lowest_rpm = speeds_rpm[0];
        // Beyond this lobe even the highest chatter frequency lies below the lowest speed.
        let last = (60.0 * self.max_hz / (self.edges * lowest_rpm)).ceil();
        if last > MAX_LOBES as f64 {
            return Err(LobeError::TooManyLobes { lowest_rpm, lobe: last as u32, limit: MAX_LOBES as u32 });
        }
        for branch in &self.branches {
            for lobe in 0..=last as u32 {
                for pair in branch.windows(2) {
                    let mut ends = [0, 1].map(|end| (self.speed_rpm(&pair[end], lobe), &pair[end]));
                    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
                    let [(slow_rpm, slow), (fast_rpm, fast)] = ends;
                    let first = speeds_rpm.partition_point(|&speed| speed < slow_rpm);
                    for (index, speed) in speeds_rpm.iter().enumerate().skip(first) {
                        if *speed > fast_rpm {
                            break;
                        }
                        let share = if fast_rpm > slow_rpm { (speed - slow_rpm) / (fast_rpm - slow_rpm) } else { 0.0 };
                        let between = |slow: f64, fast: f64| slow + share * (fast - slow);
                        let limit_mm = between(slow.limit_mm, fast.limit_mm);
                        visit(index, limit_mm, between(slow.frequency_hz, fast.frequency_hz), lobe);
                    }
                }
            }
        }
        Ok(())
    }

    /// Largest stable depth or width at rising speeds, mm; infinite where nothing chatters.
    fn limits_mm(&self, speeds_rpm: &[f64]) -> Result<Vec<f64>, LobeError> {
        let mut limits = vec![f64::INFINITY; speeds_rpm.len()];
        self.scan(speeds_rpm, |index, limit_mm, _, _| limits[index] = limits[index].min(limit_mm))?;
        Ok(limits)
    }

    /// The stability chart: at evenly spaced speeds from the lowest to the highest the limit with its lobe, and how the tool
    /// chatters above it. Both panels of the usual picture are in it, depth and chatter frequency over speed.
    ///
    /// # Errors
    /// [`LobeError`] for an impossible range or number of speeds (2 to 20 000).
    pub fn chart(&self, lowest_rpm: f64, highest_rpm: f64, speeds: u32) -> Result<Vec<ChartPoint>, LobeError> {
        let mut check = Check::default();
        check.speeds(lowest_rpm, highest_rpm);
        check.within("speeds", f64::from(speeds), 2.0, MAX_CHART_SPEEDS);
        check.finish()?;
        let step = (highest_rpm - lowest_rpm) / f64::from(speeds - 1);
        let speeds_rpm: Vec<f64> = (0..speeds).map(|index| lowest_rpm + step * f64::from(index)).collect();
        let mut chart: Vec<_> = speeds_rpm.iter().map(|&speed_rpm| ChartPoint { speed_rpm, limit: None }).collect();
        self.scan(&speeds_rpm, |index, limit_mm, frequency_hz, lobe| {
            let limit = &mut chart[index].limit;
            if limit.is_none_or(|least| limit_mm < least.limit_mm) {
                *limit = Some(ChartLimit { limit_mm, frequency_hz, lobe });
            }
        })?;
        Ok(chart)
    }

    /// Largest stable depth or width at one speed, mm; `None` where nothing chatters.
    ///
    /// # Errors
    /// [`LobeError`] for a speed below what is computed.
    pub fn limit_mm(&self, speed_rpm: f64) -> Result<Option<f64>, LobeError> {
        let mut check = Check::default();
        check.within("speed_rpm", speed_rpm, 1.0, MAX_RPM);
        check.finish()?;
        Ok(self.limits_mm(&[speed_rpm])?.first().copied().filter(|limit| limit.is_finite()))
    }

    /// Best pocket of each band.
    ///
    /// # Errors
    /// [`LobeError`] for an impossible request, and when a required depth cannot be had.
    pub fn pockets(&self, request: &PocketRequest) -> Result<Vec<Pocket>, LobeError> {
        let PocketRequest { lowest_rpm, highest_rpm, bands, margin, speed_tolerance, required_mm } = *request;
        Check(request.problems()).finish()?;
        let count = bands as usize * SPEEDS_PER_BAND;
        let step = (highest_rpm - lowest_rpm) / count as f64;
        let speeds: Vec<f64> = (0..=count).map(|index| lowest_rpm + step * index as f64).collect();
        let limits = self.limits_mm(&speeds)?;
        let robust = |index: usize| {
            let reach = speeds[index] * speed_tolerance;
            let first = speeds.partition_point(|&speed| speed < speeds[index] - reach);
            let end = speeds.partition_point(|&speed| speed <= speeds[index] + reach);
            limits[first..end].iter().copied().fold(f64::INFINITY, f64::min)
        };
        let bounds = |band: usize| speeds[band * SPEEDS_PER_BAND];
        // So near the ends of the range the limits around a speed are not known, and a little more speed leaves the table.
        let inside = speeds.partition_point(|&speed| speed * (1.0 - speed_tolerance) < lowest_rpm)
            ..speeds.partition_point(|&speed| speed * (1.0 + speed_tolerance) <= highest_rpm);
        (0..bands as usize)
            .map(|band| {
                let first = (band * SPEEDS_PER_BAND + 1).max(inside.start);
                let end = ((band + 1) * SPEEDS_PER_BAND + 1).min(inside.end);
                if first >= end {
                    let (above_rpm, up_to_rpm) = (bounds(band), bounds(band + 1));
                    return Err(LobeError::BandTooNarrow { above_rpm, up_to_rpm, speed_tolerance });
                }
                // Among equals the slowest: it is kept unless another is strictly deeper.
                let (mut best, mut depth) = (first, f64::NEG_INFINITY);
                for index in first..end {
                    let limit = robust(index);
                    if limit > depth {
                        (best, depth) = (index, limit);
                    }
                }
                let stable_mm = depth.is_finite().then_some(depth * (1.0 - margin));
                let row = TableRow { above_rpm: bounds(band), up_to_rpm: bounds(band + 1), speed_rpm: speeds[best] };
                match (stable_mm, required_mm) {
                    (Some(stable_mm), Some(required_mm)) if stable_mm < required_mm => Err(LobeError::TooDeep {
                        above_rpm: row.above_rpm,
                        up_to_rpm: row.up_to_rpm,
                        stable_mm,
                        required_mm,
                        margin,
                    }),
                    _ => Ok(Pocket { row, stable_mm }),
                }
            })
            .collect()
    }
}

impl SpindleTable {
    /// The table of the pockets.
    pub fn from_pockets(pockets: &[Pocket]) -> Self {
        Self { rows: pockets.iter().map(|pocket| pocket.row).collect() }
    }
}
