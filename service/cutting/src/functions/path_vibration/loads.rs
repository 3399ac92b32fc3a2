//! What a section demands of the machine's axes.

use feedwave_motion::{Element, LimitExceeded, Machine, MachineAxis, PathLimits};

use super::{
    AxisLoadReport, ExceededAxis, PublishedEnds, VibrationCondition, VibrationDemand, VibrationSettings, sin_turns,
};

/// Steps of the search for the largest vibration that fits; each halves the relative uncertainty.
const SEARCH_STEPS: u32 = 30;

/// Axis loads gathered over the elements of a section.
#[derive(Clone, Debug)]
pub(super) struct AxisLoads {
    condition: VibrationCondition,
    settings: VibrationSettings,
    machine: Machine,
    /// Programmed feed at the start of the present part, mm/s.
    part_feed_mm_per_s: f64,
    /// Fastest programmed feed, mm/s.
    top_feed_mm_per_s: f64,
    /// Per machine axis.
    axes: Vec<AxisLoad>,
    /// First element that the axes cannot follow.
    pub(super) exceeded: Option<(LimitExceeded, u32)>,
    pub(super) largest_amplitude_mm: Option<f64>,
    pub(super) highest_frequency_hz: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default)]
struct AxisLoad {
    worst_direction: f64,
    velocity_per_s: f64,
    acceleration_per_s2: f64,
    jerk_per_s3: f64,
    line: u32,
}

impl AxisLoads {
    pub(super) fn new(condition: VibrationCondition, settings: &VibrationSettings, machine: &Machine) -> Self {
        Self {
            condition,
            settings: *settings,
            machine: machine.clone(),
            part_feed_mm_per_s: 0.0,
            top_feed_mm_per_s: 0.0,
            axes: vec![AxisLoad::default(); machine.axes.len()],
            exceeded: None,
            largest_amplitude_mm: None,
            highest_frequency_hz: None,
        }
    }

    pub(super) fn start_part(&mut self, feed_mm_per_s: f64) {
        self.part_feed_mm_per_s = feed_mm_per_s;
    }

    fn demand(&self, condition: VibrationCondition) -> VibrationDemand {
        self.settings.demand(condition, self.part_feed_mm_per_s)
    }

    /// Adds an element that is cut at `feed_mm_per_s`.
    pub(super) fn add(&mut self, element: &Element, feed_mm_per_s: f64, limits: &Result<PathLimits, LimitExceeded>) {
        let directions = element.largest_tangent();
        self.top_feed_mm_per_s = self.top_feed_mm_per_s.max(feed_mm_per_s);
        let peaks = self.demand(self.condition).peaks(feed_mm_per_s);
        let path_velocity = feed_mm_per_s + peaks.velocity;
        let mut too_fast = false;
        for (load, axis) in self.axes.iter_mut().zip(&self.machine.axes) {
            let direction = directions[axis.axis.index()];
            load.worst_direction = load.worst_direction.max(direction);
            load.acceleration_per_s2 = load.acceleration_per_s2.max(direction * peaks.acceleration);
            load.jerk_per_s3 = load.jerk_per_s3.max(direction * peaks.jerk);
            let velocity_per_s = direction * path_velocity;
            too_fast |= velocity_per_s > axis.max_velocity_per_s;
            if velocity_per_s > load.velocity_per_s {
                load.velocity_per_s = velocity_per_s;
                load.line = element.source.line;
            }
        }
        if let Err(exceeded) = limits
            && self.exceeded.is_none()
        {
            self.exceeded = Some((*exceeded, element.source.line));
        }
        if too_fast || limits.is_err() {
            self.search(element, feed_mm_per_s);
        }
    }

    /// Lowers the largest amplitude and highest frequency to what fits this element as well.
    fn search(&mut self, element: &Element, feed_mm_per_s: f64) {
        let programmed = self.condition;
        let amplitude_mm = self.largest_amplitude_mm.unwrap_or(programmed.amplitude_mm);
        let frequency_hz = self.highest_frequency_hz.unwrap_or(programmed.frequency_hz);
        let directions = element.largest_tangent();
        let fits = |condition: VibrationCondition| {
            let demand = self.demand(condition);
            let path_velocity = feed_mm_per_s + demand.peaks(feed_mm_per_s).velocity;
            let slow_enough =
                |axis: &MachineAxis| directions[axis.axis.index()] * path_velocity <= axis.max_velocity_per_s;
            self.machine.axes.iter().all(slow_enough)
                && demand.limit_pieces(element, &self.machine, feed_mm_per_s).is_ok()
        };
        let largest_amplitude_mm =
            largest_that(amplitude_mm, |amplitude_mm| fits(VibrationCondition { amplitude_mm, ..programmed }));
        let highest_frequency_hz =
            largest_that(frequency_hz, |frequency_hz| fits(VibrationCondition { frequency_hz, ..programmed }));
        self.largest_amplitude_mm = Some(largest_amplitude_mm);
        self.highest_frequency_hz = Some(highest_frequency_hz);
    }

    /// One report for each axis that moves.
    pub(super) fn report(&self) -> Vec<AxisLoadReport> {
        let moving = self.axes.iter().zip(&self.machine.axes).filter(|(load, _)| load.worst_direction > 0.0);
        moving
            .map(|(load, axis)| {
                let utilisation = (load.velocity_per_s / axis.max_velocity_per_s)
                    .max(load.acceleration_per_s2 / axis.max_acceleration_per_s2)
                    .max(load.jerk_per_s3 / axis.max_jerk_per_s3);
                AxisLoadReport {
                    name: axis.name.clone(),
                    rotary: axis.axis.is_rotary(),
                    worst_direction: load.worst_direction,
                    line: load.line,
                    velocity_per_s: load.velocity_per_s,
                    max_velocity_per_s: axis.max_velocity_per_s,
                    acceleration_per_s2: load.acceleration_per_s2,
                    max_acceleration_per_s2: axis.max_acceleration_per_s2,
                    jerk_per_s3: load.jerk_per_s3,
                    max_jerk_per_s3: axis.max_jerk_per_s3,
                    utilisation,
                }
            })
            .collect()
    }

    /// The steps of a published vibration at the ends of its parts, seen in setpoints (or servo setpoints) of `period_s`.
    pub(super) fn published_ends(&self, period_s: f64) -> PublishedEnds {
        let demand = self.demand(self.condition);
        let velocity_step_mm_per_s = demand.peaks(0.0).velocity;
        let first_mm = demand.amplitude_mm() * sin_turns((self.condition.frequency_hz * period_s).min(0.25));
        let clamp_step_mm_per_s = velocity_step_mm_per_s + self.top_feed_mm_per_s;
        PublishedEnds {
            start_velocity_step_mm_per_s: velocity_step_mm_per_s,
            start_acceleration_mm_per_s2: first_mm / (period_s * period_s),
            clamp_velocity_step_mm_per_s: clamp_step_mm_per_s,
            clamp_acceleration_mm_per_s2: clamp_step_mm_per_s / period_s,
            exceeded: self.exceeding(clamp_step_mm_per_s / period_s),
        }
    }

    /// The axis whose acceleration limit is exceeded most by this acceleration along the path.
    fn exceeding(&self, acceleration_mm_per_s2: f64) -> Option<ExceededAxis> {
        let ratio = |(load, axis): &(&AxisLoad, &MachineAxis)| load.worst_direction / axis.max_acceleration_per_s2;
        let worst = self.axes.iter().zip(&self.machine.axes).max_by(|a, b| ratio(a).total_cmp(&ratio(b)))?;
        let (acceleration_per_s2, max_acceleration_per_s2) =
            (worst.0.worst_direction * acceleration_mm_per_s2, worst.1.max_acceleration_per_s2);
        let name = || worst.1.name.clone();
        (acceleration_per_s2 > max_acceleration_per_s2).then(|| ExceededAxis {
            name: name(),
            acceleration_per_s2,
            max_acceleration_per_s2,
        })
    }
}

/// The largest value up to `start` that fits, found by bisection; 0 where even a millionth does not.
fn largest_that(start: f64, fits: impl Fn(f64) -> bool) -> f64 {
    if fits(start) {
        return start;
    }
    let (mut low, mut high) = (start * 1e-6, start);
    if !fits(low) {
        return 0.0;
    }
    for _ in 0..SEARCH_STEPS {
        // Geometric: the answer may lie orders of magnitude below.
        let middle = (low * high).sqrt();
        if fits(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}
