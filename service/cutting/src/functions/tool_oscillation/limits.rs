//! What an oscillation leaves of the axes' limits.

use std::sync::Arc;

use feedwave_motion::kinematics::{TipPath, ToolFrame};
use feedwave_motion::{Curve, Element, FiveAxis, Machine, PathLimits};
use feedwave_program::{Axis, Finding, SourceSpan};
use serde::{Deserialize, Serialize};

use super::blended::Demand;
use super::code;
use super::inclination::{Slope, power_of_two};
use super::superposition::rotary_rad;
use super::{DirectionLimits, OscillationCut, OscillationJob, OscillationLimits, OscillationRun, ToolOscillation};
use crate::shared::reach::Reach;
use crate::shared::wording::decimal;

/// Most of the spindle's angular speed with which the feed direction may turn.
pub(crate) const TURNING_SHARE: f64 = 0.05;
/// What that adds to the velocity of the oscillation at most: the phase runs by this share faster, and the offset turns by the
/// same share of its peak velocity. Accelerations and jerks are covered by its powers.
const TURNING_FACTOR: f64 = 1.0 + 2.0 * TURNING_SHARE;
/// The same for a guided tool, whose own directions turn by that share as well, at most.
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
    /// How far it moves the tool from the path.
    pub(crate) reach: Reach,
}

impl LeftOver {
    /// Of a tool that stands along Z.
    pub(crate) fn of_machine(machine: &Arc<Machine>, run: &OscillationRun) -> Self {
        let [feed_mm, cross_mm, axial_mm] = run.amplitudes_mm();
        Self { machine: Arc::clone(machine), path: None, reach: Reach::InPlane { feed_mm, cross_mm, axial_mm } }
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
/// element: mm by mm, rounded up, so that neighbouring blocks have the same; and how the feed lies to the tool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct AxisShares {
    axes: [Axis; 3],
    shares: [[f64; 2]; 3],
    /// By how much the directions turn at most, rad for each mm of the path, rounded up to a power of two; infinite where the path
    /// itself is curved.
    turned_rad_per_mm: f64,
    slope: Slope,
}

/// Places of an element at which shares are examined.
const SHARE_PLACES: usize = 16;
/// Steps in which a share is rounded up.
const SHARE_STEPS: f64 = 32.0;
/// By how much an element turns faster somewhere than from one examined place to the next at most.
const UNEVEN_TURN: f64 = 2.0;

impl AxisShares {
    /// Of an element of a guided tool; nothing where the linear axes do not span space.
    pub(crate) fn of(frame: &ToolFrame, element: &Element, five_axis: &FiveAxis, slope: Slope) -> Option<Self> {
        let mut shares = [[0.0_f64; 2]; 3];
        let (mut turned_rad, mut before) = (0.0_f64, None);
        let turns = element_turns(element, five_axis);
        let places = if turns { SHARE_PLACES } else { 0 };
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
        let between_rad = if frame.is_constant() { 0.0 } else { 0.5 * turned_rad };
        for [across, along] in &mut shares {
            // Between two places an axis has at most what half of the turn adds.
            let most = libm::hypot(*across, *along) * between_rad;
            for share in [across, along] {
                *share = libm::ceil((*share + most) * SHARE_STEPS - 1e-6) / SHARE_STEPS;
            }
        }
        let turned_rad_per_mm = match five_axis.tip() {
            TipPath::Line(_) if !turns => 0.0,
            TipPath::Line(_) => power_of_two(UNEVEN_TURN * turned_rad * places as f64 / element.length),
            _ => f64::INFINITY,
        };
        Some(Self { axes: frame.linear_axes(), shares, turned_rad_per_mm, slope })
    }

    /// Of an element on which a tool that stands along Z climbs or descends.
    pub(crate) fn upright(element: &Element, slope: Slope) -> Self {
        Self {
            axes: [Axis::X, Axis::Y, Axis::Z],
            shares: [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            turned_rad_per_mm: if element.curve == Curve::Line { 0.0 } else { f64::INFINITY },
            slope,
        }
    }

    /// What each axis has of the demands along the feed, across it and along the tool axis.
    fn demands(&self, [feed, cross, axial]: [Demand; 3], cut: &OscillationCut) -> [Demand; 3] {
        let Slope { across: feed_across, along: feed_along, change_per_mm } = self.slope;
        let plane = feed.plus(&cross);
        // What the changing parts add: as directions that turn, up to the third derivative.
        let rad_per_rev = change_per_mm * TOP_OVERRIDE * cut.feed_per_rev_mm();
        let changing = 3.0 * (rad_per_rev / core::f64::consts::TAU).min(TURNING_SHARE);
        self.shares.map(|[across, along]| {
            if self.slope.is_level() {
                return plane.scaled(across).plus(&axial.scaled(along));
            }
            let by_parts = (feed_across + changing) * across + (feed_along + changing) * along;
            let most = by_parts.min(libm::hypot(across, along));
            feed.scaled(most).plus(&cross.scaled(across)).plus(&axial.scaled(along))
        })
    }

    /// By how much the phase and the directions of the oscillation run faster than on a straight path that does not turn, as a factor.
    fn turning(&self, cut: &OscillationCut) -> f64 {
        let rad_per_rev = self.turned_rad_per_mm * TOP_OVERRIDE * cut.feed_per_rev_mm();
        1.0 + 3.0 * (rad_per_rev / core::f64::consts::TAU).min(TURNING_SHARE)
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
    /// As [`left_limits`], but for each linear axis with its share of every direction. The acceleration s'' of the path is not
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
        let oscillation = &run.oscillation;
        let turning = shares.turning(cut);
        let of = |motion| Demand::of(core::iter::once(motion), period_s, turning, rate);
        let cross = oscillation.cross.as_ref().map_or_else(Demand::default, of);
        let demands = shares.demands([of(&oscillation.feed), cross, of(&oscillation.axial)], cut);
        let mut left = machine.clone();
        let columns = shares.axes.map(|axis| left.axes.iter().position(|own| own.axis == axis));
        let slopes = demands.map(|demand| demand.slope(run.ramp_mm));
        let short = |k: usize, taken: f64, limit: f64, unit: &'static str| {
            let axis = columns[k].map_or_else(String::new, |column| machine.axes[column].name.clone());
            Shortage { axis, taken, limit, unit }
        };
        // What is left of one limit on every axis for the path.
        let settle = |limits: [f64; 3], taken: [f64; 3], unit: &'static str| -> Result<f64, Shortage> {
            let mut path = f64::INFINITY;
            for k in 0..3 {
                let rest = (limits[k] - taken[k]) / (1.0 + slopes[k]);
                if rest < LEAST_SHARE * limits[k] {
                    return Err(short(k, taken[k], limits[k], unit));
                }
                path = path.min(rest);
            }
            Ok(path)
        };
        let limit_of = |of: fn(&feedwave_motion::MachineAxis) -> f64| {
            columns.map(|column| column.map_or(f64::INFINITY, |column| of(&machine.axes[column])))
        };
        let (velocities, accelerations, jerks) = (
            limit_of(|axis| axis.max_velocity_per_s),
            limit_of(|axis| axis.max_acceleration_per_s2),
            limit_of(|axis| axis.max_jerk_per_s3),
        );
        let [by_velocity, by_acceleration, by_jerk] = [0, 1, 2].map(|order| demands.map(|demand| demand.steady[order]));
        let velocity = settle(velocities, by_velocity, "mm/s")?;
        let mut acceleration = settle(accelerations, by_acceleration, "mm/s²")?;
        let coupled = demands.map(|demand| demand.jerk_by_acceleration(rate, run.ramp_mm));
        for k in 0..3 {
            acceleration = acceleration.min(gentle_acceleration(jerks[k], by_jerk[k], coupled[k]));
            let least = LEAST_SHARE * accelerations[k];
            if acceleration < least {
                return Err(short(k, jerk_taken(jerks[k], by_jerk[k], least * coupled[k]), jerks[k], "mm/s³"));
            }
        }
        let taken = core::array::from_fn(|k| by_jerk[k] + coupled[k] * acceleration);
        let jerk = settle(jerks, taken, "mm/s³")?;
        let less = |limits: [f64; 3], taken: [f64; 3], path: f64| -> [f64; 3] {
            core::array::from_fn(|k| limits[k] - taken[k] - slopes[k] * path)
        };
        let velocity_left = less(velocities, by_velocity, velocity);
        let acceleration_left = less(accelerations, by_acceleration, acceleration);
        let jerk_left = less(jerks, taken, jerk);
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

    /// Of a tool that is guided, or stands along Z.
    pub(crate) fn left_over(&self, run: &OscillationRun, guided: bool) -> LeftOver {
        let [feed_mm, cross_mm, axial_mm] = run.amplitudes_mm();
        let AxisShares { axes, shares, slope, .. } = self.shares;
        let in_plane_mm = libm::hypot(slope.across * feed_mm, cross_mm);
        let most = |[across, along]: [f64; 2]| across * in_plane_mm + along * (axial_mm + slope.along * feed_mm);
        let reach = if guided {
            Reach::Guided(core::array::from_fn(|k| (axes[k], most(shares[k]))))
        } else {
            Reach::InPlane { feed_mm, cross_mm, axial_mm }
        };
        LeftOver { machine: Arc::clone(&self.machine), path: Some(self.path), reach }
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
    /// The report has the peaks themselves; here they leave nothing for the feed and its blend. `fits` says whether a run with other
    /// amplitudes leaves enough.
    pub(crate) fn finding(
        &self,
        span: SourceSpan,
        run: &OscillationRun,
        feed_per_period_mm: f64,
        fits: impl Fn(&OscillationRun) -> bool,
    ) -> Finding {
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
        let with = |share: f64| run.with_amplitudes(share, feed_per_period_mm);
        let (mut least, mut most) = (0.0, 1.0);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (least + most);
            *(if fits(&with(middle)) { &mut least } else { &mut most }) = middle;
        }
        let OscillationRun { oscillation, .. } = with(least);
        let (feed_mm, axial_mm) = (oscillation.feed.amplitude_mm, oscillation.axial.amplitude_mm);
        let finding = if least > 0.0 {
            let cross = oscillation
                .cross
                .as_ref()
                .map_or_else(String::new, |cross| format!(", of {} mm across it", decimal(cross.amplitude_mm, 4)));
            let cure = format!(
                "use amplitudes of {} mm along the feed{cross} and of {} mm along the tool axis",
                decimal(feed_mm, 4),
                decimal(axial_mm, 4)
            );
            finding.suggest_value(cure, None, "feed_amplitude", feed_mm, "mm").suggest_value(
                format!("beside that amplitude along the feed, {} mm along the tool axis", decimal(axial_mm, 4)),
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

/// The machine with what the oscillation leaves of its limits ([`super::blended`]). The parts with s'' and s''' go with the feed's own
/// acceleration and jerk: what is left for the feed is divided by 1 + E'·A. An acceleration s'' within the blend asks for jerk with u'
/// beside: where that would be too much, the path accelerates less.
fn left_limits(
    machine: &Machine,
    run: &OscillationRun,
    cut: &OscillationCut,
    turning: f64,
) -> Result<Machine, Shortage> {
    let period_s = 60.0 / cut.spindle_rev_per_min / f64::from(run.oscillation.periods_per_rev);
    let rate = TOP_OVERRIDE * cut.feed_mm_per_min / 60.0 / run.ramp_mm;
    let oscillation = &run.oscillation;
    // In the plane both directions at once at worst.
    let plane = Demand::of(core::iter::once(&oscillation.feed).chain(&oscillation.cross), period_s, turning, rate);
    let axial = Demand::of(core::iter::once(&oscillation.axial), period_s, turning, rate);
    let demand_of = |axis: Axis| match axis {
        Axis::X | Axis::Y => Some(plane),
        Axis::Z => Some(axial),
        _ => None,
    };
    // What the jerk of any axis leaves to the acceleration of the path.
    let mut gentle = f64::INFINITY;
    for axis in &machine.axes {
        let Some(demand) = demand_of(axis.axis) else { continue };
        let ([.., fixed], coupled) = (demand.steady, demand.jerk_by_acceleration(rate, run.ramp_mm));
        gentle = gentle.min(gentle_acceleration(axis.max_jerk_per_s3, fixed, coupled));
        let least = LEAST_SHARE * axis.max_acceleration_per_s2;
        if gentle < least {
            let taken = jerk_taken(axis.max_jerk_per_s3, fixed, least * coupled);
            return Err(Shortage { axis: axis.name.clone(), taken, limit: axis.max_jerk_per_s3, unit: "mm/s³" });
        }
    }
    let mut left = machine.clone();
    let mut path = [0.0f64; 2];
    // The plane first: its acceleration and jerk are what the axial blend has to follow.
    for is_axial in [false, true] {
        for axis in &mut left.axes {
            let Some(demand) = demand_of(axis.axis).filter(|_| is_axial == (axis.axis == Axis::Z)) else { continue };
            let slope = demand.slope(run.ramp_mm);
            let [by_velocity, by_acceleration, by_jerk] = demand.steady;
            let take = |limit: f64, taken: f64, unit: &'static str| {
                let rest = (limit - taken) / if is_axial { 1.0 } else { 1.0 + slope };
                if rest >= LEAST_SHARE * limit {
                    Ok(rest)
                } else {
                    Err(Shortage { axis: axis.name.clone(), taken, limit, unit })
                }
            };
            let feed = |index: usize| if is_axial { slope * path[index] } else { 0.0 };
            let velocity_left = take(axis.max_velocity_per_s, by_velocity, "mm/s")?;
            let acceleration_left = take(axis.max_acceleration_per_s2, by_acceleration + feed(0), "mm/s²")?;
            let acceleration_left = if is_axial { acceleration_left } else { acceleration_left.min(gentle) };
            let path_acceleration = if is_axial { path[0] } else { acceleration_left };
            let taken = by_jerk + path_acceleration * demand.jerk_by_acceleration(rate, run.ramp_mm) + feed(1);
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

/// Jerk that is told to be taken where too little is left: that of a steady feed where it is too much already, or with twice what the
/// least acceleration of the path asks for beside.
fn jerk_taken(limit: f64, steady: f64, by_least_acceleration: f64) -> f64 {
    if steady >= limit { steady } else { steady + 2.0 * by_least_acceleration }
}

/// Acceleration of the path, mm/s², that takes half of the jerk which is left.
fn gentle_acceleration(limit: f64, taken: f64, coupled: f64) -> f64 {
    if coupled > 0.0 { 0.5 * (limit - taken) / coupled } else { f64::INFINITY }
}

/// Whether an oscillation that is blended over `ramp_mm` leaves the feed enough of what the machine can do in each direction. Where one
/// axis may carry a part of every direction, they are counted together.
pub(super) fn leaves_feed(
    oscillation: &ToolOscillation,
    cut: &OscillationCut,
    ramp_mm: f64,
    job: &OscillationJob<'_>,
) -> bool {
    let period_s = 60.0 / cut.spindle_rev_per_min / f64::from(oscillation.periods_per_rev);
    let rate = TOP_OVERRIDE * cut.feed_mm_per_min / 60.0 / ramp_mm;
    let motions = core::iter::once(&oscillation.feed).chain(&oscillation.cross);
    let plane = Demand::of(motions, period_s, GUIDED_TURNING_FACTOR, rate);
    let axial = Demand::of(core::iter::once(&oscillation.axial), period_s, GUIDED_TURNING_FACTOR, rate);
    let climbs = cut.incline_deg != 0.0;
    let axial = if climbs {
        let feed = Demand::of(core::iter::once(&oscillation.feed), period_s, GUIDED_TURNING_FACTOR, rate);
        axial.plus(&feed.scaled(libm::sin(cut.incline_deg.to_radians())))
    } else {
        axial
    };
    // Shares of velocity, acceleration and jerk.
    let shares = |demand: &Demand, limits: DirectionLimits| {
        let [velocity, acceleration, jerk] = demand.steady;
        let path = LEAST_SHARE * limits.acceleration_mm_per_s2 * demand.jerk_by_acceleration(rate, ramp_mm);
        let slope = 1.0 + demand.slope(ramp_mm);
        [
            velocity / limits.velocity_mm_per_s + LEAST_SHARE * slope,
            acceleration / limits.acceleration_mm_per_s2 + LEAST_SHARE * slope,
            (jerk + 2.0 * path) / limits.jerk_mm_per_s3 + 2.0 * LEAST_SHARE * slope,
        ]
    };
    let (plane, axial) = (shares(&plane, job.limits.plane), shares(&axial, job.limits.axial));
    let together = job.drives.is_some_and(|drives| drives.guided);
    plane
        .into_iter()
        .zip(axial)
        .all(|(plane, axial)| if together { plane + axial <= 1.0 } else { plane.max(axial) <= 1.0 })
}
