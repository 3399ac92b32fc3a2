//! What is collected between two decisions.

use crate::config::{Length, MonitoringConfig};
use crate::decision::{HoldReason, Removed, Span};
use crate::points::Points;
use crate::spectrum::Record;
use serde::{Deserialize, Serialize};

/// How far more samples than nominal a window takes before its time stamps are disbelieved.
const DENSITY_LIMIT: f64 = 4.0;

/// One window of the baseline, a step of the run-up, or the process.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Window {
    pub span: Span,
    pub points: Points,
    pub record: Option<Record>,
    /// First cause why it is no evidence.
    pub void: Option<HoldReason>,
    /// Time collected, without pauses, ns.
    elapsed_ns: u64,
    end: End,
    /// Sum and number of measured spindle speeds.
    rev_per_min_sum: f64,
    rev_per_min_count: u32,
}

/// When a window is over.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct End {
    /// By its points, before the time is up, with this many valid samples.
    by_points: bool,
    valid_samples: u64,
    after_ns: u64,
    after_samples: u64,
}

impl Window {
    pub fn new(config: &MonitoringConfig) -> Self {
        Self {
            span: Span::default(),
            points: Points::new(config),
            record: config.spectrum.map(|spectrum| Record::new(spectrum.samples)),
            void: None,
            elapsed_ns: 0,
            end: End::default(),
            rev_per_min_sum: 0.0,
            rev_per_min_count: 0,
        }
    }

    pub fn restart(&mut self, length: Length, config: &MonitoringConfig) {
        let (by_points, series, seconds) = match length {
            Length::Seconds(seconds) => (false, 1, seconds),
            Length::Series(series) => (true, series, config.quality.max_window_s),
        };
        self.points.restart(series);
        self.span = Span::default();
        if let Some(record) = &mut self.record {
            record.clear();
        }
        self.void = None;
        self.elapsed_ns = 0;
        self.end = End {
            by_points,
            valid_samples: u64::from(config.quality.min_valid_samples),
            after_ns: (seconds * 1e9).round() as u64,
            after_samples: (seconds * config.sample_rate_hz * DENSITY_LIMIT).ceil() as u64 + 2,
        };
        self.rev_per_min_sum = 0.0;
        self.rev_per_min_count = 0;
    }

    /// Counts a sample and the time since the one before.
    #[inline]
    pub fn count(&mut self, time_ns: u64, index: u64, step_ns: u64) {
        if self.span.samples == 0 {
            self.span.first_ns = time_ns;
            self.span.first_sample = index;
        }
        self.span.samples += 1;
        self.span.last_ns = time_ns;
        self.elapsed_ns += step_ns;
    }

    #[inline]
    pub fn measured_speed(&mut self, rev_per_min: f64) {
        self.rev_per_min_sum += rev_per_min;
        self.rev_per_min_count += 1;
    }

    /// Mean of the measured spindle speeds, rev/min.
    pub fn spindle_rev_per_min(&self) -> Option<f64> {
        (self.rev_per_min_count > 0).then(|| self.rev_per_min_sum / f64::from(self.rev_per_min_count))
    }

    /// Contact or data paused: nothing incomplete is continued.
    pub fn interrupt(&mut self) {
        self.points.interrupt();
        if let Some(record) = &mut self.record {
            record.clear();
        }
    }

    pub fn invalidate(&mut self, reason: HoldReason) {
        self.void.get_or_insert(reason);
    }

    /// Whether the window is over; one that never completes is given up.
    #[inline]
    pub fn is_over(&mut self) -> bool {
        // At high speed the series are complete before there are enough samples to decide on: more of them are taken.
        if self.end.by_points && self.points.complete() && self.span.valid >= self.end.valid_samples {
            return true;
        }
        if self.elapsed_ns >= self.end.after_ns {
            if self.end.by_points && !self.points.complete() {
                self.invalidate(HoldReason::PointsMissing);
            }
            return true;
        }
        if self.span.samples >= self.end.after_samples {
            self.invalidate(HoldReason::TimeTooDense);
            return true;
        }
        false
    }

    /// Why the finished window is no evidence.
    pub fn unfit(&self, config: &MonitoringConfig) -> Option<HoldReason> {
        if self.void.is_some() {
            return self.void;
        }
        let Removed { non_finite, dropped, .. } = self.span.removed;
        let removed = self.span.removed.total();
        let expected = self.span.samples + u64::from(dropped);
        let too_few = self.span.valid < u64::from(config.quality.min_valid_samples);
        if too_few || removed as f64 > config.quality.max_removed * expected as f64 {
            let mostly_not_finite = 2 * u64::from(non_finite) > removed;
            return Some(if mostly_not_finite { HoldReason::NotFinite } else { HoldReason::TooFewSamples });
        }
        (!self.points.all_seen()).then_some(HoldReason::PointsMissing)
    }

    /// Whether a restored value fits the configuration.
    pub fn fits(&self, config: &MonitoringConfig) -> bool {
        self.points.fits(config)
            && match (&self.record, &config.spectrum) {
                (Some(record), Some(spectrum)) => record.fits(spectrum),
                (None, None) => true,
                _ => false,
            }
    }
}
