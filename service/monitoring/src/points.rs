//! Averages per angular point or over consecutive samples, and what is computed from them
//! (docs/functions/adaptive-feed.md, "State machine of one run").

use crate::config::{Grouping, MonitoringConfig};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Sums of one point.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Point {
    sum: [f64; 2],
    count: u32,
    /// Completed passes.
    passes: u32,
}

impl Point {
    #[inline]
    fn add(&mut self, value: [f64; 2]) {
        self.sum[0] += value[0];
        self.sum[1] += value[1];
        self.count += 1;
    }

    fn mean(&self) -> [f64; 2] {
        self.sum.map(|sum| sum / f64::from(self.count))
    }
}

/// What the means of the points say together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Summary {
    /// Points taken in.
    pub points: u32,
    /// Largest distance of a mean from its baseline.
    pub max_deviation: f64,
    /// Largest |difference| of X or Y from its baseline.
    pub max_difference: f64,
    /// Sum of the unit vectors of the deviations, and their number.
    pub direction: [f64; 2],
    pub directions: u32,
    /// Extremes of the means of X and Y, before the baseline is subtracted.
    pub least: [f64; 2],
    pub most: [f64; 2],
    /// Sum of the means.
    sum: [f64; 2],
}

impl Default for Summary {
    fn default() -> Self {
        Self {
            points: 0,
            max_deviation: 0.0,
            max_difference: 0.0,
            direction: [0.0; 2],
            directions: 0,
            least: [f64::MAX; 2],
            most: [f64::MIN; 2],
            sum: [0.0; 2],
        }
    }
}

impl Summary {
    fn add(&mut self, mean: [f64; 2], baseline: [f64; 2]) {
        let [dx, dy] = [mean[0] - baseline[0], mean[1] - baseline[1]];
        let deviation = (dx * dx + dy * dy).sqrt();
        self.points += 1;
        self.max_deviation = self.max_deviation.max(deviation);
        self.max_difference = self.max_difference.max(dx.abs()).max(dy.abs());
        if deviation > 0.0 {
            // The unit vector is (cos α, sin α): the circular mean needs no trigonometry per point.
            self.direction[0] += dx / deviation;
            self.direction[1] += dy / deviation;
            self.directions += 1;
        }
        for (axis, value) in mean.into_iter().enumerate() {
            self.least[axis] = self.least[axis].min(value);
            self.most[axis] = self.most[axis].max(value);
            self.sum[axis] += value;
        }
    }

    /// Circular mean of α_i = atan2(Ȳ_i − Y_i⁰, X̄_i − X_i⁰) in degrees and the length of the mean resultant.
    pub fn mean_angle(&self) -> Option<(f64, f64)> {
        let [x, y] = self.direction;
        if self.directions == 0 || (x == 0.0 && y == 0.0) {
            return None;
        }
        Some((libm::atan2(y, x) * (180.0 / PI), (x * x + y * y).sqrt() / f64::from(self.directions)))
    }
}

/// Collects the samples of one window.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Points {
    points: Vec<Point>,
    /// Angular point of the last sample.
    current: Option<u32>,
    /// Passes each point must complete, and how many points have.
    required: u32,
    satisfied: u32,
    /// Samples per point in time; 0 groups by angle.
    per_group: u32,
    /// Groups in time, as they were completed.
    groups: Summary,
}

impl Points {
    pub fn new(config: &MonitoringConfig) -> Self {
        Self {
            points: vec![Point::default(); config.points()],
            current: None,
            required: 1,
            satisfied: 0,
            per_group: match config.grouping {
                Grouping::Angle { .. } => 0,
                Grouping::Time { samples_per_point } => samples_per_point,
            },
            groups: Summary::default(),
        }
    }

    /// Empties it for a window that needs every point passed `required` times.
    pub fn restart(&mut self, required: u32) {
        self.points.fill(Point::default());
        self.current = None;
        self.required = required;
        self.satisfied = 0;
        self.groups = Summary::default();
    }

    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Point A_i of a spindle angle: i counts sectors from angle 0 in the positive direction.
    #[inline]
    pub fn index(&self, angle_deg: f64) -> usize {
        if self.per_group > 0 {
            return 0;
        }
        let turns = angle_deg / 360.0;
        let fraction = turns - turns.floor();
        ((fraction * self.points.len() as f64) as usize).min(self.points.len() - 1)
    }

    #[inline]
    pub fn add(&mut self, index: usize, value: [f64; 2], baseline: &[[f64; 2]]) {
        if self.per_group > 0 {
            let group = &mut self.points[0];
            group.add(value);
            if group.count == self.per_group {
                let mean = group.mean();
                *group = Point::default();
                self.groups.add(mean, baseline[0]);
            }
            return;
        }
        let index_u32 = index as u32;
        if self.current != Some(index_u32) {
            self.leave();
            self.current = Some(index_u32);
        }
        self.points[index].add(value);
    }

    /// Ends the pass in progress.
    #[inline]
    fn leave(&mut self) {
        if let Some(last) = self.current.take() {
            let point = &mut self.points[last as usize];
            point.passes += 1;
            self.satisfied += u32::from(point.passes == self.required);
        }
    }

    /// Contact or data was interrupted: what is incomplete does not continue afterwards.
    pub fn interrupt(&mut self) {
        if self.per_group > 0 {
            self.points[0] = Point::default();
        } else {
            self.current = None;
        }
    }

    /// Whether each point was passed as often as required.
    pub fn complete(&self) -> bool {
        self.satisfied as usize == self.points.len()
    }

    /// Whether each point has a mean.
    pub fn all_seen(&self) -> bool {
        if self.per_group > 0 { self.groups.points > 0 } else { self.points.iter().all(|point| point.count > 0) }
    }

    /// Everything over all points; call only when [`Self::all_seen`].
    pub fn summary(&self, baseline: &[[f64; 2]]) -> Summary {
        if self.per_group > 0 {
            return self.groups;
        }
        let mut summary = Summary::default();
        for (point, &baseline) in self.points.iter().zip(baseline) {
            summary.add(point.mean(), baseline);
        }
        summary
    }

    /// Writes the means as a baseline; call only when [`Self::all_seen`].
    pub fn write_means(&self, baseline: &mut [[f64; 2]]) {
        if self.per_group > 0 {
            baseline[0] = self.groups.sum.map(|sum| sum / f64::from(self.groups.points));
            return;
        }
        for (point, mean) in self.points.iter().zip(baseline) {
            *mean = point.mean();
        }
    }

    /// Whether a restored value fits the configuration.
    pub fn fits(&self, config: &MonitoringConfig) -> bool {
        let fresh = Self::new(config);
        self.points.len() == fresh.points.len()
            && self.per_group == fresh.per_group
            && self.current.is_none_or(|index| (index as usize) < self.points.len())
    }
}
