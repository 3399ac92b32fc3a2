//! What an oscillation leaves of the axes' limits.

use std::sync::Arc;

use feedwave_motion::Machine;
use feedwave_program::{Axis, Finding, SourceSpan};
use serde::{Deserialize, Serialize};

use super::code;
use super::{DirectionLimits, DirectionMotion, OscillationCut, OscillationLimits, OscillationRun};
use crate::shared::blend::BLEND_PEAKS;
use crate::shared::wording::{decimal, round_down};

/// Most of the spindle's angular speed with which the feed direction may turn.
pub(crate) const TURNING_SHARE: f64 = 0.05;
/// What that adds to the velocity of the oscillation at most: the phase runs by this share faster, and the offset turns by the
/// same share of its peak velocity. Accelerations and jerks are covered by its powers.
const TURNING_FACTOR: f64 = 1.0 + 2.0 * TURNING_SHARE;
/// Largest feed override: what is blended over the path comes that much faster.
pub(crate) const TOP_OVERRIDE: f64 = 2.0;
/// Least share of a limit that the oscillation has to leave to the feed.
const LEAST_SHARE: f64 = 0.02;

/// What the oscillation leaves of the limits of every machine axis, on straight and on curved elements.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct LeftLimits {
    #[serde(with = "shared")]
    pub(crate) straight: Arc<Machine>,
    #[serde(with = "shared")]
    pub(crate) curved: Arc<Machine>,
}

/// A shared machine in a snapshot is the machine.
mod shared {
    use std::sync::Arc;

    use feedwave_motion::Machine;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(machine: &Arc<Machine>, serializer: S) -> Result<S::Ok, S::Error> {
        Machine::serialize(machine, serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Arc<Machine>, D::Error> {
        Machine::deserialize(deserializer).map(Arc::new)
    }
}

impl LeftLimits {
    /// What `run` leaves of the limits of `machine`, or which limit it takes whole.
    pub(crate) fn of(machine: &Machine, run: &OscillationRun, cut: &OscillationCut) -> Result<Self, Shortage> {
        let straight = left_limits(machine, run, cut, 1.0)?;
        let curved = left_limits(machine, run, cut, TURNING_FACTOR)?;
        Ok(Self { straight: Arc::new(straight), curved: Arc::new(curved) })
    }
}

/// The weaker axis of the work plane, and the tool axis.
pub(crate) fn machine_limits(machine: &Machine) -> OscillationLimits {
    let none = DirectionLimits {
        velocity_mm_per_s: f64::INFINITY,
        acceleration_mm_per_s2: f64::INFINITY,
        jerk_mm_per_s3: f64::INFINITY,
    };
    let weakest = |axes: &[Axis]| {
        machine.axes.iter().filter(|axis| axes.contains(&axis.axis)).fold(none, |least, axis| DirectionLimits {
            velocity_mm_per_s: least.velocity_mm_per_s.min(axis.max_velocity_per_s),
            acceleration_mm_per_s2: least.acceleration_mm_per_s2.min(axis.max_acceleration_per_s2),
            jerk_mm_per_s3: least.jerk_mm_per_s3.min(axis.max_jerk_per_s3),
        })
    };
    OscillationLimits { plane: weakest(&[Axis::X, Axis::Y]), axial: weakest(&[Axis::Z]) }
}

/// A limit that leaves nothing for the feed.
pub(crate) struct Shortage {
    axis: String,
    taken: f64,
    limit: f64,
    unit: &'static str,
}

impl Shortage {
    /// The report has the peaks themselves; here they leave nothing for the feed and its blend. `fits` says whether `run`
    /// with all amplitudes multiplied by a share leaves enough.
    pub(crate) fn finding(&self, span: SourceSpan, run: &OscillationRun, fits: impl Fn(f64) -> bool) -> Finding {
        let message = format!(
            "the oscillation takes {} of the {} axis' limit of {} {}: nothing is left for the feed",
            decimal(self.taken, 1),
            self.axis,
            decimal(self.limit, 1),
            self.unit
        );
        let finding = Finding::new(code::OSC_AXIS_LIMIT, span, message)
            .ranked(self.axis.clone(), self.taken / self.limit)
            .with_value("demanded", self.taken, self.unit)
            .with_value("limit", self.limit, self.unit);
        let (mut least, mut most) = (0.0, 1.0);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (least + most);
            *(if fits(middle) { &mut least } else { &mut most }) = middle;
        }
        let amplitude = |motion: &DirectionMotion| round_down(least * motion.amplitude_mm, 4);
        let (feed_mm, axial_mm) = (amplitude(&run.oscillation.feed), amplitude(&run.oscillation.axial));
        let finding = if least > 0.0 {
            let cure = format!("use amplitudes of {} mm along the feed", decimal(feed_mm, 4));
            finding.suggest_value(cure, None, "feed_amplitude", feed_mm, "mm").suggest_value(
                format!("and {} mm along the tool axis", decimal(axial_mm, 4)),
                None,
                "axial_amplitude",
                axial_mm,
                "mm",
            )
        } else {
            finding
        };
        finding.suggest("use a lower spindle speed, or blend over more periods")
    }
}

/// Halvings until the largest share of the amplitudes is known to four digits.
const BISECTIONS: u32 = 14;

/// Amplitude and peaks of velocity, acceleration and jerk of motions that reach them at once, with the phase running faster by
/// `turning`.
fn summed_peaks<'a>(motions: impl Iterator<Item = &'a DirectionMotion>, period_s: f64, turning: f64) -> [f64; 4] {
    motions.fold([0.0; 4], |[a, v, c, j], motion| {
        let peaks = motion.peaks(period_s);
        [
            a + motion.amplitude_mm,
            v + turning * peaks.velocity_mm_per_s,
            c + turning * turning * peaks.acceleration_mm_per_s2,
            j + turning * turning * turning * peaks.jerk_mm_per_s3,
        ]
    })
}

/// The machine with what the oscillation leaves of its limits. With E the blend, s the place on the path and D its length, the
/// offset E(s)·u(t) has
///
/// ```text
/// (E·u)'   = E·u' + E'·s'·u
/// (E·u)''  = E·u'' + 2·E'·s'·u' + (E''·s'² + E'·s'')·u
/// (E·u)''' = E·u''' + 3·E'·s'·u'' + 3·(E''·s'² + E'·s'')·u' + (E'''·s'³ + 3·E''·s'·s'' + E'·s''')·u
/// ```
///
/// The parts with s'' and s''' go with the feed's own acceleration and jerk: what is left for the feed is divided by 1 + E'·A.
fn left_limits(
    machine: &Machine,
    run: &OscillationRun,
    cut: &OscillationCut,
    turning: f64,
) -> Result<Machine, Shortage> {
    let period_s = 60.0 / cut.spindle_rev_per_min / f64::from(run.oscillation.periods_per_rev);
    let rate = TOP_OVERRIDE * cut.feed_mm_per_min / 60.0 / run.ramp_mm;
    let [first, second, third] = BLEND_PEAKS;
    let oscillation = &run.oscillation;
    // In the plane both directions at once at worst.
    let plane = summed_peaks(core::iter::once(&oscillation.feed).chain(&oscillation.cross), period_s, turning);
    let axial = summed_peaks(core::iter::once(&oscillation.axial), period_s, turning);
    let mut left = machine.clone();
    let mut path = [0.0f64; 2];
    // The plane first: its acceleration and jerk are what the axial blend has to follow.
    for is_axial in [false, true] {
        let [amplitude, velocity, acceleration, jerk] = if is_axial { axial } else { plane };
        let slope = first * amplitude / run.ramp_mm;
        for axis in &mut left.axes {
            if is_axial != (axis.axis == Axis::Z) || !matches!(axis.axis, Axis::X | Axis::Y | Axis::Z) {
                continue;
            }
            let take = |limit: f64, taken: f64, unit: &'static str| {
                let rest = (limit - taken) / if is_axial { 1.0 } else { 1.0 + slope };
                if rest >= LEAST_SHARE * limit {
                    Ok(rest)
                } else {
                    Err(Shortage { axis: axis.name.clone(), taken, limit, unit })
                }
            };
            let feed = |index: usize| if is_axial { slope * path[index] } else { 0.0 };
            let taken = velocity + first * rate * amplitude;
            let velocity_left = take(axis.max_velocity_per_s, taken, "mm/s")?;
            let taken = acceleration + 2.0 * first * rate * velocity + second * rate * rate * amplitude + feed(0);
            let acceleration_left = take(axis.max_acceleration_per_s2, taken, "mm/s²")?;
            let path_acceleration = if is_axial { path[0] } else { acceleration_left };
            let bend = second * rate * rate + first * path_acceleration / run.ramp_mm;
            let taken = jerk
                + 3.0 * first * rate * acceleration
                + 3.0 * bend * velocity
                + (third * rate * rate * rate + 3.0 * second * rate * path_acceleration / run.ramp_mm) * amplitude
                + feed(1);
            let jerk_left = take(axis.max_jerk_per_s3, taken, "mm/s³")?;
            (axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3) =
                (velocity_left, acceleration_left, jerk_left);
            if !is_axial {
                path = [path[0].max(acceleration_left), path[1].max(jerk_left)];
            }
        }
    }
    Ok(left)
}
