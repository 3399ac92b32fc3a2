//! What an oscillation leaves of the axes' limits.

use std::sync::Arc;

use feedwave_motion::kinematics::ToolFrame;
use feedwave_motion::{Element, FiveAxis, Machine, PathLimits};
use feedwave_program::{Axis, Finding, SourceSpan};
use serde::{Deserialize, Serialize};

use super::code;
use super::superposition::rotary_rad;
use super::{DirectionLimits, DirectionMotion, OscillationCut, OscillationLimits, OscillationRun};
use crate::shared::blend::BLEND_PEAKS;
use crate::shared::wording::{decimal, round_down};

/// Most of the spindle's angular speed with which the feed direction may turn.
pub(crate) const TURNING_SHARE: f64 = 0.05;
/// What that adds to the velocity of the oscillation at most: the phase runs by this share faster, and the offset turns by the
/// same share of its peak velocity. Accelerations and jerks are covered by its powers.
const TURNING_FACTOR: f64 = 1.0 + 2.0 * TURNING_SHARE;
/// The same for a guided tool, whose own directions turn by that share as well.
const GUIDED_TURNING_FACTOR: f64 = 1.0 + 3.0 * TURNING_SHARE;
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

/// What an oscillation leaves of the limits on an element.
#[derive(Clone, Debug)]
pub(crate) struct LeftOver {
    /// The machine with what is left of the limits of its axes.
    pub(crate) machine: Arc<Machine>,
    /// What the path itself may do at most.
    pub(crate) path: Option<PathLimits>,
}

impl LeftOver {
    pub(crate) fn of_machine(machine: &Arc<Machine>) -> Self {
        Self { machine: Arc::clone(machine), path: None }
    }
}

/// What the oscillation of a guided tool leaves of the limits on an element.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct GuidedLimits {
    shares: AxisShares,
    #[serde(with = "shared")]
    machine: Arc<Machine>,
    path: PathLimits,
}

/// How much of an offset across the tool, and of one along it, each linear axis (in the order of the chain) has at most along an
/// element: mm by mm, rounded up, so that neighbouring blocks have the same.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct AxisShares {
    axes: [Axis; 3],
    shares: [[f64; 2]; 3],
}

/// Places of an element at which shares are examined.
const SHARE_PLACES: usize = 16;
/// Steps in which a share is rounded up.
const SHARE_STEPS: f64 = 32.0;

impl AxisShares {
    /// Of an element of a guided tool; nothing where the linear axes do not span space.
    pub(crate) fn of(frame: &ToolFrame, element: &Element, five_axis: &FiveAxis) -> Option<Self> {
        let mut shares = [[0.0_f64; 2]; 3];
        let (mut turned_rad, mut before) = (0.0_f64, None);
        let rests = frame.is_constant() || !element_turns(element, five_axis);
        let places = if rests { 0 } else { SHARE_PLACES };
        for place in 0..=places {
            let s = element.length * place as f64 / places.max(1) as f64;
            let at_rad = rotary_rad(element, five_axis, s);
            let moved =
                [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|own| frame.linear_mm(at_rad, own).ok());
            let [Some(first), Some(second), Some(along)] = moved else { return None };
            for axis in 0..3 {
                shares[axis][0] = shares[axis][0].max(libm::hypot(first[axis], second[axis]));
                shares[axis][1] = shares[axis][1].max(along[axis].abs());
            }
            if let Some([first_rad, second_rad]) = before.replace(at_rad) {
                turned_rad = turned_rad.max((at_rad[0] - first_rad).abs() + (at_rad[1] - second_rad).abs());
            }
        }
        for [across, along] in &mut shares {
            // Between two places an axis has at most what half of the turn adds.
            let most = libm::hypot(*across, *along) * 0.5 * turned_rad;
            for share in [across, along] {
                *share = libm::ceil((*share + most) * SHARE_STEPS - 1e-6) / SHARE_STEPS;
            }
        }
        Some(Self { axes: frame.linear_axes(), shares })
    }

    /// What the machine can do across the tool and along it: the weakest of the axes that have a share.
    pub(crate) fn limits(&self, machine: &Machine) -> OscillationLimits {
        let direction = |kind: usize| {
            let none = DirectionLimits {
                velocity_mm_per_s: f64::INFINITY,
                acceleration_mm_per_s2: f64::INFINITY,
                jerk_mm_per_s3: f64::INFINITY,
            };
            let shares = self.axes.iter().zip(&self.shares).filter(|(_, shares)| shares[kind] > 0.0);
            let axes =
                shares.filter_map(|(axis, shares)| Some((&machine.axes[machine.column_of(*axis)?], shares[kind])));
            axes.fold(none, |least, (axis, share)| DirectionLimits {
                velocity_mm_per_s: least.velocity_mm_per_s.min(axis.max_velocity_per_s / share),
                acceleration_mm_per_s2: least.acceleration_mm_per_s2.min(axis.max_acceleration_per_s2 / share),
                jerk_mm_per_s3: least.jerk_mm_per_s3.min(axis.max_jerk_per_s3 / share),
            })
        };
        OscillationLimits { plane: direction(0), axial: direction(1) }
    }
}

/// Whether a rotary axis moves along an element.
fn element_turns(element: &Element, five_axis: &FiveAxis) -> bool {
    five_axis.axes()[3..].iter().any(|&axis| element.moves(axis))
}

impl GuidedLimits {
    /// What `run` leaves of the limits of `machine` on elements with these shares, or which limit it takes whole.
    ///
    /// As [`left_limits`], but for each linear axis with its share of both directions. The acceleration s'' of the path is not
    /// that of any one axis here, so the path itself is bounded: with R_k what the oscillation leaves of the limit of axis k while
    /// the path does not accelerate, and A_k the axis' amplitude, by the least R_k/(1 + E'·A_k) of all axes; then axis k
    /// has R_k − E'·A_k·s'' left at least. The jerk likewise.
    pub(crate) fn of(
        machine: &Machine,
        run: &OscillationRun,
        cut: &OscillationCut,
        shares: AxisShares,
    ) -> Result<Self, Shortage> {
        let period_s = 60.0 / cut.spindle_rev_per_min / f64::from(run.oscillation.periods_per_rev);
        let rate = TOP_OVERRIDE * cut.feed_mm_per_min / 60.0 / run.ramp_mm;
        let [first, second, third] = BLEND_PEAKS;
        let oscillation = &run.oscillation;
        let motions = core::iter::once(&oscillation.feed).chain(&oscillation.cross);
        let plane = summed_peaks(motions, period_s, GUIDED_TURNING_FACTOR);
        let axial = summed_peaks(core::iter::once(&oscillation.axial), period_s, GUIDED_TURNING_FACTOR);
        let peaks = shares.shares.map(|[across, along]| [0, 1, 2, 3].map(|k| across * plane[k] + along * axial[k]));
        let mut left = machine.clone();
        let columns = shares.axes.map(|axis| left.axes.iter().position(|own| own.axis == axis));
        let slope = |amplitude: f64| first * amplitude / run.ramp_mm;
        // What is left of one limit on every axis, and what the path may do then.
        let settle = |limits: [f64; 3], taken: [f64; 3], unit: &'static str| -> Result<([f64; 3], f64), Shortage> {
            let mut path = f64::INFINITY;
            for k in 0..3 {
                let rest = (limits[k] - taken[k]) / (1.0 + slope(peaks[k][0]));
                if rest < LEAST_SHARE * limits[k] {
                    let axis = columns[k].map_or_else(String::new, |column| machine.axes[column].name.clone());
                    return Err(Shortage { axis, taken: taken[k], limit: limits[k], unit });
                }
                path = path.min(rest);
            }
            Ok((core::array::from_fn(|k| limits[k] - taken[k] - slope(peaks[k][0]) * path), path))
        };
        let limit_of = |of: fn(&feedwave_motion::MachineAxis) -> f64| {
            columns.map(|column| column.map_or(f64::INFINITY, |column| of(&machine.axes[column])))
        };
        let taken = peaks.map(|[amplitude, velocity, ..]| velocity + first * rate * amplitude);
        let (velocity_left, _) = settle(limit_of(|axis| axis.max_velocity_per_s), taken, "mm/s")?;
        let taken = peaks.map(|[amplitude, velocity, acceleration, _]| {
            acceleration + 2.0 * first * rate * velocity + second * rate * rate * amplitude
        });
        let (acceleration_left, acceleration) = settle(limit_of(|axis| axis.max_acceleration_per_s2), taken, "mm/s²")?;
        let bend = second * rate * rate + first * acceleration / run.ramp_mm;
        let taken = peaks.map(|[amplitude, velocity, own, jerk]| {
            let blended = third * rate * rate * rate + 3.0 * second * rate * acceleration / run.ramp_mm;
            jerk + 3.0 * first * rate * own + 3.0 * bend * velocity + blended * amplitude
        });
        let (jerk_left, jerk) = settle(limit_of(|axis| axis.max_jerk_per_s3), taken, "mm/s³")?;
        for k in 0..3 {
            if let Some(column) = columns[k] {
                let axis = &mut left.axes[column];
                (axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3) =
                    (velocity_left[k], acceleration_left[k], jerk_left[k]);
            }
        }
        let path = PathLimits { velocity: f64::INFINITY, acceleration, jerk };
        Ok(Self { shares, machine: Arc::new(left), path })
    }

    pub(crate) fn are_of(&self, shares: &AxisShares) -> bool {
        self.shares == *shares
    }

    pub(crate) fn left_over(&self) -> LeftOver {
        LeftOver { machine: Arc::clone(&self.machine), path: Some(self.path) }
    }
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
