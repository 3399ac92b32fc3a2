//! What of the telemetry is kept to learn from (docs/functions/adaptive-feed.md, "Learning from runs"): stretches of straight cuts
//! under constant conditions, sample by sample, a few of each condition and bounded in bytes.
//!
//! Samples that a sensor did not deliver, or that are wrong, leave a place that is marked; what is longer, a step of the clock, or a
//! change of feed, direction or line ends a stretch.

use serde::{Deserialize, Serialize};

use crate::batch::Batch;
use crate::channel::Worth;
use crate::config::{MonitoringConfig, Quantity};
use crate::learning::MIN_RECORD_SAMPLES;
use crate::monitor::input::{Channels, lacks_column, read};

/// Stretches that are kept of one condition: more say little that these do not.
const PER_CONDITION: usize = 4;
/// Most stretches of a run.
pub const MAX_RECORDED_CUTS: usize = 64;
/// Samples in a row that may be missing.
const MAX_GAP_SAMPLES: u64 = 20;
/// Share of a stretch's samples that may be missing.
const MAX_MISSING: f64 = 0.1;
/// How far a time stamp may be off the even grid, as a share of the time between samples.
const MAX_JITTER: f64 = 0.25;
/// How far the velocity of one cut may change, as a share of it.
const VELOCITY_TOLERANCE: f64 = 1e-3;
/// Conditions are the same where feeds and speeds differ by no more than this share, and directions by no more in radians.
const SAME: f64 = 0.02;
/// How far the spindle may be off an even turn within a stretch, degrees.
const MAX_ANGLE_RIPPLE_DEG: f64 = 10.0;
/// Least turns of the spindle in a stretch.
const MIN_TURNS: f64 = 3.0;

/// How much of a run is kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RecordingLimits {
    /// Most bytes of all stretches, as [`RecordedCut::bytes`] counts them.
    pub max_bytes: u64,
    /// Longest stretch, s.
    pub cut_s: f64,
}

impl RecordingLimits {
    /// [`RecordingLimits::max_bytes`] by default: about 17 s at 20 kHz.
    pub const MAX_BYTES: u64 = 8 << 20;
    /// Largest bound in bytes.
    pub const MOST_BYTES: u64 = 64 << 20;
    /// [`RecordingLimits::cut_s`] by default.
    pub const CUT_S: f64 = 0.5;
    /// Longest stretch that may be asked for, s.
    pub const MOST_CUT_S: f64 = 10.0;
    /// Most samples of a stretch, however long it is.
    const MOST_SAMPLES: f64 = 100_000.0;

    fn samples(&self, sample_rate_hz: f64) -> usize {
        (self.cut_s * sample_rate_hz).clamp(2.0 * MIN_RECORD_SAMPLES as f64, Self::MOST_SAMPLES) as usize
    }
}

impl Default for RecordingLimits {
    fn default() -> Self {
        Self { max_bytes: Self::MAX_BYTES, cut_s: Self::CUT_S }
    }
}

/// What is constant in a stretch.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CutConditions {
    /// Source line; 0 where it is not known.
    pub line: u32,
    /// Feed as commanded, mm/min.
    pub feed_mm_per_min: f64,
    /// Its direction in the axes of the sensors, a unit vector.
    pub feed_direction: [f64; 2],
    /// Mean spindle speed, rev/min; negative backwards.
    pub spindle_rev_per_min: f64,
}

impl CutConditions {
    fn is_like(&self, other: &Self) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() <= SAME * b.abs();
        let [x, y] = [0, 1].map(|axis| self.feed_direction[axis] - other.feed_direction[axis]);
        self.line == other.line
            && near(self.feed_mm_per_min, other.feed_mm_per_min)
            && near(self.spindle_rev_per_min, other.spindle_rev_per_min)
            && libm::hypot(x, y) <= SAME
    }
}

/// A stretch of a straight cut under constant conditions, on an even grid of time.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedCut {
    /// What is constant in it.
    pub conditions: CutConditions,
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// Time stamp of the first sample, ns on the sensors' clock.
    pub first_ns: u64,
    /// Deflection of the tool in X and Y, mm from any zero; 0 where it is missing.
    pub deflection_mm: [Vec<f64>; 2],
    /// Spindle angle, degrees; between its neighbours where the sample is missing.
    pub spindle_angle_deg: Vec<f64>,
    /// Places of the samples that are missing, ascending.
    pub missing: Vec<u32>,
}

impl RecordedCut {
    /// What it counts against the bound.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        Self::bytes_of(self.spindle_angle_deg.len(), self.missing.len())
    }

    /// What a stretch of so many samples, and so many of them missing, counts.
    #[must_use]
    pub const fn bytes_of(samples: usize, missing: usize) -> u64 {
        (64 + 24 * samples + 4 * missing) as u64
    }
}

/// Why nothing can be recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RecordingError {
    /// Accelerations say nothing of the deflection.
    #[error("needs sensors of distance or strain: accelerations do not tell the deflection of the tool")]
    Acceleration,
}

/// A stretch that is not complete.
#[derive(Debug, Clone)]
struct Current {
    cut: RecordedCut,
    /// Velocity of its first sample, mm/s.
    velocity: [f64; 2],
    /// Velocities of all samples together.
    velocities: [f64; 2],
    last_ns: u64,
}

/// Takes the stretches out of telemetry.
#[derive(Debug, Clone)]
pub struct Recorder {
    config: MonitoringConfig,
    limits: RecordingLimits,
    channels: Channels,
    current: Option<Current>,
    kept: Vec<CutConditions>,
    bytes: u64,
}

/// One sample as far as a stretch needs it.
#[derive(Debug, Clone, Copy)]
struct Sample {
    time_ns: u64,
    line: u32,
    velocity: [f64; 2],
    angle_deg: f64,
    /// `None` where it is wrong.
    deflection_mm: Option<[f64; 2]>,
}

impl Recorder {
    /// Records from telemetry that is judged so, beyond what was kept of the run before with so many bytes in all.
    ///
    /// # Errors
    /// [`RecordingError`] where the sensors do not tell the deflection.
    pub fn new(
        config: &MonitoringConfig,
        limits: RecordingLimits,
        kept: Vec<CutConditions>,
        bytes: u64,
    ) -> Result<Self, RecordingError> {
        let sensors = [config.tool, config.work];
        if sensors.iter().flatten().any(|sensors| sensors.quantity == Quantity::Acceleration) {
            return Err(RecordingError::Acceleration);
        }
        Ok(Self { config: config.clone(), limits, channels: Channels::default(), current: None, kept, bytes })
    }

    /// Whether there is room for nothing more.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.kept.len() >= MAX_RECORDED_CUTS
            || self.bytes + RecordedCut::bytes_of(2 * MIN_RECORD_SAMPLES, 0) > self.limits.max_bytes
    }

    /// Takes a batch in that the monitor has accepted; `is_measuring` says whether tool and work have touched for longer than
    /// the monitor's settling time. The stretches that are complete.
    pub fn push(&mut self, batch: &Batch<'_>, is_measuring: bool) -> Vec<RecordedCut> {
        let mut complete = Vec::new();
        let (Some(velocity), Some(angle)) = (batch.velocity_mm_per_s, batch.spindle_angle_deg) else {
            self.current = None;
            return complete;
        };
        if !is_measuring || self.is_full() || lacks_column(batch, &self.config) {
            complete.extend(self.finish());
            return complete;
        }
        for index in 0..batch.time_ns.len() {
            let sample = read(batch, index, false, &self.config, &mut self.channels);
            let is_good = sample.worth == Worth::Good;
            let sample = Sample {
                time_ns: sample.time_ns,
                line: batch.line.map_or(0, |line| line[index]),
                velocity: [velocity.x[index], velocity.y[index]],
                angle_deg: angle[index],
                deflection_mm: (is_good && sample.contact != Some(false)).then_some(sample.value),
            };
            let touches = batch.contact.is_none_or(|contact| contact[index]);
            complete.extend(if touches { self.take(&sample) } else { self.finish() });
        }
        complete
    }

    /// Ends what is being recorded: telemetry does not go on from here.
    pub fn finish(&mut self) -> Option<RecordedCut> {
        let Current { mut cut, last_ns, velocities: [x, y], .. } = self.current.take()?;
        let samples = cut.spindle_angle_deg.len();
        let seconds = last_ns.saturating_sub(cut.first_ns) as f64 * 1e-9;
        let first_deg = *cut.spindle_angle_deg.first()?;
        let turned_deg = cut.spindle_angle_deg.last()? - first_deg;
        let step_deg = turned_deg / (samples - 1).max(1) as f64;
        let is_even =
            cut.spindle_angle_deg.iter().enumerate().all(|(place, angle_deg)| {
                (angle_deg - first_deg - step_deg * place as f64).abs() <= MAX_ANGLE_RIPPLE_DEG
            });
        cut.conditions.spindle_rev_per_min = turned_deg / 360.0 / seconds * 60.0;
        // The mean: a stretch may begin where the axes reach their feed.
        let sum = libm::hypot(x, y);
        cut.conditions.feed_mm_per_min = 60.0 * sum / samples as f64;
        cut.conditions.feed_direction = [x / sum, y / sum];
        let fits = samples >= 2 * MIN_RECORD_SAMPLES
            && is_even
            && turned_deg.abs() >= 360.0 * MIN_TURNS
            && cut.missing.len() as f64 <= MAX_MISSING * samples as f64
            && self.bytes + cut.bytes() <= self.limits.max_bytes
            && self.kept.iter().filter(|kept| cut.conditions.is_like(kept)).count() < PER_CONDITION;
        if !fits {
            return None;
        }
        self.bytes += cut.bytes();
        self.kept.push(cut.conditions);
        Some(cut)
    }

    /// Appends a sample, or ends the stretch and begins another with it.
    fn take(&mut self, sample: &Sample) -> Option<RecordedCut> {
        if !self.continues(sample) {
            let complete = self.finish();
            self.begin(sample);
            return complete;
        }
        let most = self.limits.samples(self.config.sample_rate_hz);
        let Some(current) = &mut self.current else {
            self.begin(sample);
            return None;
        };
        current.append(sample, self.config.sample_rate_hz);
        if current.cut.spindle_angle_deg.len() >= most { self.finish() } else { None }
    }

    /// Whether a sample belongs to the stretch that is being recorded.
    fn continues(&self, sample: &Sample) -> bool {
        let Some(current) = &self.current else { return false };
        let periods = sample.time_ns.saturating_sub(current.last_ns) as f64 * 1e-9 * self.config.sample_rate_hz;
        let whole = periods.round();
        let [x, y] = [0, 1].map(|axis| sample.velocity[axis] - current.velocity[axis]);
        let [along, across] = current.velocity;
        sample.line == current.cut.conditions.line
            && whole >= 1.0
            && whole <= MAX_GAP_SAMPLES as f64 + 1.0
            && (periods - whole).abs() <= MAX_JITTER
            && sample.angle_deg.is_finite()
            && libm::hypot(x, y) <= VELOCITY_TOLERANCE * libm::hypot(along, across)
    }

    fn begin(&mut self, sample: &Sample) {
        let [x, y] = sample.velocity;
        let speed = libm::hypot(x, y);
        let possible = speed.is_finite() && speed > 0.0 && sample.angle_deg.is_finite();
        let Some(deflection_mm) = sample.deflection_mm.filter(|_| possible) else { return };
        let conditions = CutConditions {
            line: sample.line,
            feed_mm_per_min: speed * 60.0,
            feed_direction: [x / speed, y / speed],
            spindle_rev_per_min: 0.0,
        };
        self.current = Some(Current {
            cut: RecordedCut {
                conditions,
                sample_rate_hz: self.config.sample_rate_hz,
                first_ns: sample.time_ns,
                deflection_mm: deflection_mm.map(|value| vec![value]),
                spindle_angle_deg: vec![sample.angle_deg],
                missing: Vec::new(),
            },
            velocity: sample.velocity,
            velocities: sample.velocity,
            last_ns: sample.time_ns,
        });
    }
}

impl Current {
    /// Appends a sample that continues the stretch, and marked places for those that are lost before it.
    fn append(&mut self, sample: &Sample, sample_rate_hz: f64) {
        let periods = ((sample.time_ns - self.last_ns) as f64 * 1e-9 * sample_rate_hz).round() as usize;
        let before_deg = *self.cut.spindle_angle_deg.last().unwrap_or(&sample.angle_deg);
        // An encoder that counts within one turn begins again: of all turns it is the one that goes on as before.
        let step_deg = match self.cut.spindle_angle_deg[..] {
            [.., earlier_deg, _] => before_deg - earlier_deg,
            _ => 0.0,
        };
        let expected_deg = before_deg + step_deg * periods as f64;
        let angle_deg = sample.angle_deg + 360.0 * ((expected_deg - sample.angle_deg) / 360.0).round();
        for step in 1..=periods {
            let share = step as f64 / periods as f64;
            let value = sample.deflection_mm.filter(|_| step == periods);
            if value.is_none() {
                self.cut.missing.push(self.cut.spindle_angle_deg.len() as u32);
            }
            for (column, value) in self.cut.deflection_mm.iter_mut().zip(value.unwrap_or_default()) {
                column.push(value);
            }
            let angle_deg = if step == periods { angle_deg } else { before_deg + share * (angle_deg - before_deg) };
            self.cut.spindle_angle_deg.push(angle_deg);
        }
        // Lost samples had the velocity of this one.
        for (sum, velocity) in self.velocities.iter_mut().zip(sample.velocity) {
            *sum += velocity * periods as f64;
        }
        self.last_ns = sample.time_ns;
    }
}
