//! What a section demands of the machine's axes.

use feedwave_motion::{
    Curve, Element, LEAST_FEED_SHARE, LimitExceeded, Machine, MachineAxis, PathLimits, PathMotion, Quantity,
    TANGENT_TOLERANCE_RAD,
};
use feedwave_program::{Axis, Position};

use super::trial::Objection;
use super::{
    AxisLoadReport, ExceededAxis, GenerationMode, PublishedEnds, VibrationCondition, VibrationDemand,
    VibrationEnvelope, VibrationSettings, sin_turns,
};

/// Differently directed or cut elements that are kept to judge another vibration on.
const MAX_LINES: usize = 32;
/// Curves that are kept of a section to judge another vibration on.
const MAX_CURVES: usize = 32;

/// From one value of the search to the next lower one, until one fits.
const SEARCH_RATIO: f64 = 0.7;
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
    /// Slowest and fastest programmed feed, mm/s.
    least_feed_mm_per_s: f64,
    top_feed_mm_per_s: f64,
    /// Largest feed override that the machine permits or the plan has, at least 1.
    top_override: f64,
    /// Per machine axis.
    axes: Vec<AxisLoad>,
    /// First element that the axes cannot follow.
    pub(super) exceeded: Option<Exceeded>,
    pub(super) largest_amplitude_mm: Option<f64>,
    pub(super) highest_frequency_hz: Option<f64>,
    /// What curves permit feed and vibration together, along the path.
    pub(super) on_curves: Option<PathMotion>,
    lines: Vec<CutDirections>,
    curves: Vec<CutCurve>,
    /// There are more curves than are kept.
    is_incomplete: bool,
}

/// Largest |derivatives| of the axes by path length on an element, and how it is cut.
#[derive(Clone, Debug)]
struct CutDirections {
    directions: Position,
    feed_mm_per_s: f64,
}

/// A curve and how it is cut.
#[derive(Clone, Debug)]
struct CutCurve {
    element: Element,
    feed_mm_per_s: f64,
}

/// An element that an axis cannot follow.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exceeded {
    pub(super) limit: LimitExceeded,
    /// The axis' own limit, of which a curve leaves less.
    pub(super) nominal: f64,
    pub(super) line: u32,
}

/// What a published vibration steps beside itself, and how it is seen.
#[derive(Clone, Copy, Debug)]
struct Steps {
    /// The highest feed.
    feed_mm_per_s: f64,
    /// The period of setpoints, or of servo setpoints.
    period_s: f64,
    /// Whether the command rests at corners until the offset is 0.
    rests: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct AxisLoad {
    worst_direction: f64,
    /// Largest change of the direction at a junction of a published vibration.
    kink: f64,
    velocity_per_s: f64,
    acceleration_per_s2: f64,
    jerk_per_s3: f64,
    line: u32,
    /// What is asked of velocity, acceleration and jerk, and what may be, where an element leaves too little.
    refused: [Option<[f64; 2]>; 3],
}

impl AxisLoad {
    /// Keeps the demand that is furthest beyond what is permitted.
    fn refuse(&mut self, quantity: Quantity, demanded: f64, permitted: f64) {
        let kept = &mut self.refused[quantity as usize];
        if kept.is_none_or(|[demand, limit]| demanded * limit > demand * permitted) {
            *kept = Some([demanded, permitted]);
        }
    }

    /// Largest acceleration and jerk where a published vibration with these peaks steps the velocity, seen in setpoints of a
    /// period: at its ends and clamps to or from rest, at corners by the change of direction, beside its own.
    fn at_steps(&self, peaks: &PathMotion, steps: Steps) -> [f64; 2] {
        let Steps { feed_mm_per_s: feed, period_s: period, rests } = steps;
        let Self { worst_direction: direction, kink, .. } = *self;
        let squared = period * period;
        let acceleration_at_ends = direction * (peaks.velocity + feed) / period;
        // Velocity and acceleration of a sine are a quarter of a period apart, velocity and jerk are not.
        let wave = libm::hypot(kink * peaks.velocity / period, direction * peaks.acceleration);
        let acceleration = acceleration_at_ends.max(wave + kink * feed / period);
        let jerk_of = |turn: f64| {
            let along = turn * peaks.velocity / squared + direction * peaks.jerk;
            turn * feed / squared + libm::hypot(along, turn * peaks.acceleration / period)
        };
        // A rest of one period: the second step undoes the first one.
        let jerk_at_ends = if rests { 2.0 } else { 1.0 } * jerk_of(direction);
        [acceleration, jerk_at_ends.max(jerk_of(kink))]
    }

    fn demanded(&self) -> [f64; 3] {
        [self.velocity_per_s, self.acceleration_per_s2, self.jerk_per_s3]
    }

    fn report(&self, axis: &MachineAxis, demanded: [f64; 3], limits: [f64; 3]) -> AxisLoadReport {
        let own = limits_of(axis);
        AxisLoadReport {
            axis: axis.name.clone(),
            rotary: axis.axis.is_rotary(),
            worst_direction: self.worst_direction,
            line: self.line,
            velocity_per_s: demanded[0],
            max_velocity_per_s: limits[0],
            acceleration_per_s2: demanded[1],
            max_acceleration_per_s2: limits[1],
            jerk_per_s3: demanded[2],
            max_jerk_per_s3: limits[2],
            limited_on_curve: limits.iter().zip(own).any(|(limit, own)| *limit < (1.0 - 2.0 * LEAST_FEED_SHARE) * own),
            utilisation: demanded.iter().zip(limits).map(|(demand, limit)| demand / limit).fold(0.0, f64::max),
        }
    }
}

/// An axis' limits of velocity, acceleration and jerk.
const fn limits_of(axis: &MachineAxis) -> [f64; 3] {
    [axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3]
}

impl AxisLoads {
    pub(super) fn new(condition: VibrationCondition, settings: &VibrationSettings, machine: &Machine) -> Self {
        Self {
            condition,
            settings: *settings,
            machine: machine.clone(),
            part_feed_mm_per_s: 0.0,
            least_feed_mm_per_s: f64::INFINITY,
            top_feed_mm_per_s: 0.0,
            top_override: 1.0,
            axes: vec![AxisLoad::default(); machine.axes.len()],
            exceeded: None,
            largest_amplitude_mm: None,
            highest_frequency_hz: None,
            on_curves: None,
            lines: Vec::new(),
            curves: Vec::new(),
            is_incomplete: false,
        }
    }

    /// The feed may be so many times the programmed one.
    pub(super) fn permit(&mut self, feed_override: f64) {
        self.top_override = self.top_override.max(feed_override);
    }

    pub(super) fn start_part(&mut self, feed_mm_per_s: f64) {
        self.part_feed_mm_per_s = feed_mm_per_s;
        self.least_feed_mm_per_s = self.least_feed_mm_per_s.min(feed_mm_per_s);
    }

    /// The directions of the axes change so much at a junction, before and behind which a published vibration may be at its
    /// full speed.
    pub(super) fn turns_at_junction(&mut self, kinks: &Position) {
        for (load, axis) in self.axes.iter_mut().zip(&self.machine.axes) {
            load.kink = load.kink.max(kinks[axis.axis.index()]);
        }
    }

    /// Adds the blocks of another section with the same vibration, for [`AxisLoads::objection`].
    pub(super) fn join(&mut self, other: &Self) {
        self.least_feed_mm_per_s = self.least_feed_mm_per_s.min(other.least_feed_mm_per_s);
        self.top_feed_mm_per_s = self.top_feed_mm_per_s.max(other.top_feed_mm_per_s);
        self.permit(other.top_override);
        for (load, other) in self.axes.iter_mut().zip(&other.axes) {
            load.worst_direction = load.worst_direction.max(other.worst_direction);
            load.kink = load.kink.max(other.kink);
        }
        self.exceeded = self.exceeded.or(other.exceeded);
        let least = |one: Option<f64>, other: Option<f64>| one.into_iter().chain(other).reduce(f64::min);
        self.largest_amplitude_mm = least(self.largest_amplitude_mm, other.largest_amplitude_mm);
        self.highest_frequency_hz = least(self.highest_frequency_hz, other.highest_frequency_hz);
        other.lines.iter().for_each(|line| self.keep_directions(line.directions, line.feed_mm_per_s));
        other.curves.iter().for_each(|curve| self.keep_curve(&curve.element, curve.feed_mm_per_s));
        self.is_incomplete |= other.is_incomplete;
    }

    /// See [`super::trial::Trial::forget`].
    pub(super) fn forget(&mut self) {
        (self.lines, self.curves, self.is_incomplete) = (Vec::new(), Vec::new(), true);
    }

    /// How many lines and curves are kept.
    pub(super) fn kept(&self) -> usize {
        self.lines.len() + self.curves.len()
    }

    fn demand(&self, condition: VibrationCondition) -> VibrationDemand {
        self.settings.demand(condition, self.part_feed_mm_per_s)
    }

    /// Adds an element that is cut at `feed_mm_per_s`.
    pub(super) fn add(&mut self, element: &Element, feed_mm_per_s: f64, limits: &Result<PathLimits, LimitExceeded>) {
        let directions = element.largest_tangent();
        self.least_feed_mm_per_s = self.least_feed_mm_per_s.min(feed_mm_per_s);
        self.top_feed_mm_per_s = self.top_feed_mm_per_s.max(feed_mm_per_s);
        let peaks = self.demand(self.condition).peaks(feed_mm_per_s);
        let path_velocity = feed_mm_per_s + peaks.velocity;
        let mut too_much = false;
        for (load, axis) in self.axes.iter_mut().zip(&self.machine.axes) {
            let direction = directions[axis.axis.index()];
            load.worst_direction = load.worst_direction.max(direction);
            load.acceleration_per_s2 = load.acceleration_per_s2.max(direction * peaks.acceleration);
            load.jerk_per_s3 = load.jerk_per_s3.max(direction * peaks.jerk);
            let velocity_per_s = direction * path_velocity;
            let demanded = [velocity_per_s, direction * peaks.acceleration, direction * peaks.jerk];
            too_much |= demanded.iter().zip(limits_of(axis)).any(|(demanded, limit)| *demanded > limit);
            if velocity_per_s > load.velocity_per_s {
                load.velocity_per_s = velocity_per_s;
                load.line = element.source.line;
            }
        }
        if let Err(exceeded) = limits {
            self.refuse(element, exceeded);
        }
        self.keep_directions(directions, feed_mm_per_s);
        if !matches!(element.curve, Curve::Line) {
            self.keep_curve(element, feed_mm_per_s);
            let permitted = self.demand(self.condition).permitted(element, &self.machine, feed_mm_per_s);
            let tightest = self.on_curves.get_or_insert(permitted);
            tightest.velocity = tightest.velocity.min(permitted.velocity);
            tightest.acceleration = tightest.acceleration.min(permitted.acceleration);
            tightest.jerk = tightest.jerk.min(permitted.jerk);
        }
        if too_much || limits.is_err() {
            self.search(element, feed_mm_per_s);
        }
    }

    /// An axis gives too little on an element; in the plane of an arc all axes do, whose direction turns.
    fn refuse(&mut self, element: &Element, exceeded: &LimitExceeded) {
        let LimitExceeded { axis, quantity, demanded, .. } = *exceeded;
        let is_meant = |other: Axis| {
            other == axis
                || matches!(&element.curve, Curve::Arc(arc)
                    if [axis, other].iter().all(|axis| [arc.first, arc.second].contains(axis)))
        };
        let mut nominal = exceeded.limit;
        for (load, machine_axis) in self.axes.iter_mut().zip(&self.machine.axes) {
            if is_meant(machine_axis.axis) {
                load.refuse(quantity, demanded, exceeded.permitted());
            }
            if machine_axis.axis == axis {
                nominal = limits_of(machine_axis)[quantity as usize];
            }
        }
        self.exceeded.get_or_insert(Exceeded { limit: *exceeded, nominal, line: element.source.line });
    }

    /// Keeps how an element is directed and cut for [`AxisLoads::objection`]; where there are very many, the worst of the last.
    fn keep_directions(&mut self, directions: Position, feed_mm_per_s: f64) {
        let is_alike = |kept: &CutDirections| kept.directions == directions;
        let kept = match self.lines.iter().position(is_alike) {
            Some(index) => &mut self.lines[index],
            None if self.lines.len() < MAX_LINES => {
                return self.lines.push(CutDirections { directions, feed_mm_per_s });
            }
            None => &mut self.lines[MAX_LINES - 1],
        };
        for (kept, new) in kept.directions.iter_mut().zip(directions) {
            *kept = kept.max(new);
        }
        kept.feed_mm_per_s = kept.feed_mm_per_s.max(feed_mm_per_s);
    }

    /// Keeps a curve likewise. Of arcs in one plane the most curved one, cut as fast as the fastest, leaves the least of every
    /// limit.
    fn keep_curve(&mut self, element: &Element, feed_mm_per_s: f64) {
        if self.curves.len() < MAX_CURVES {
            self.curves.push(CutCurve { element: element.clone(), feed_mm_per_s });
            return;
        }
        let plane = plane_of(element);
        let in_plane = |kept: &&mut CutCurve| plane.is_some() && plane_of(&kept.element) == plane;
        let Some(kept) = self.curves.iter_mut().find(in_plane) else {
            self.is_incomplete = true;
            return;
        };
        kept.feed_mm_per_s = kept.feed_mm_per_s.max(feed_mm_per_s);
        if element.curvature() > kept.element.curvature() {
            kept.element = element.clone();
        }
    }

    /// What an axis would lack for another vibration, with feeds between these ratios of the present ones: the verdict of
    /// the section for it, or a harder one where its blocks have different feeds.
    pub(super) fn objection(
        &self,
        condition: VibrationCondition,
        settings: &VibrationSettings,
        [least_ratio, largest_ratio]: [f64; 2],
        period_s: f64,
    ) -> Option<Objection> {
        // Another vibration may pass other junctions, so that a part may begin at any of the feeds.
        let demand = settings.demand(condition, least_ratio * self.least_feed_mm_per_s);
        let found = self
            .lines
            .iter()
            .find_map(|line| self.objection_on_line(&line.directions, &demand, largest_ratio * line.feed_mm_per_s));
        let found = found.or_else(|| {
            let mut exceeded = self.curves.iter().filter_map(|curve| {
                demand.limit_pieces(&curve.element, &self.machine, largest_ratio * curve.feed_mm_per_s).err()
            });
            exceeded.next().map(|exceeded| self.objection_of(&exceeded))
        });
        let ends = || {
            let binds = settings.envelope == VibrationEnvelope::Published && settings.published_limits_bind;
            // A published vibration has no blend, whatever the feed.
            let steps = self.steps(largest_ratio, period_s);
            let axis = binds.then(|| self.exceeding(&demand.peaks(0.0), steps)).flatten()?;
            let (quantity, [demanded, permitted]) = axis.most_exceeded();
            Some(Objection::Axis { name: axis.axis.into(), quantity, rotary: axis.rotary, demanded, permitted })
        };
        // Of curves that are not kept it is known only that they allow what is programmed.
        let is_known = || {
            let [programmed, tried] = [self.condition, condition].map(|condition| condition.peaks());
            let is_less = tried.velocity <= programmed.velocity
                && tried.acceleration <= programmed.acceleration
                && tried.jerk <= programmed.jerk;
            !self.is_incomplete || (is_less && self.exceeded.is_none() && largest_ratio <= 1.0)
        };
        found.or_else(ends).or_else(|| (!is_known()).then_some(Objection::Unknown))
    }

    /// What an axis would lack where the path is directed so: what a line takes, and a curve at least.
    fn objection_on_line(
        &self,
        directions: &Position,
        demand: &VibrationDemand,
        feed_mm_per_s: f64,
    ) -> Option<Objection> {
        let [_, slowest] = demand.speeds(feed_mm_per_s);
        let peaks = demand.peaks(slowest);
        let at_top = demand.peaks(feed_mm_per_s);
        self.machine.axes.iter().find_map(|axis| {
            let direction = directions[axis.axis.index()];
            let [velocity, acceleration, jerk] = limits_of(axis);
            let permitted = |limit: f64| (1.0 - LEAST_FEED_SHARE) * limit;
            let demands = [
                (Quantity::Velocity, feed_mm_per_s + at_top.velocity, velocity),
                (Quantity::Acceleration, at_top.acceleration, acceleration),
                (Quantity::Jerk, at_top.jerk, jerk),
                (Quantity::Velocity, peaks.velocity, permitted(velocity)),
                (Quantity::Acceleration, peaks.acceleration, permitted(acceleration)),
                (Quantity::Jerk, peaks.jerk, permitted(jerk)),
            ];
            let exceeded = demands.into_iter().find(|(_, along, limit)| direction * along > *limit);
            exceeded.map(|(quantity, along, permitted)| Objection::Axis {
                name: axis.name.clone().into(),
                quantity,
                rotary: axis.axis.is_rotary(),
                demanded: direction * along,
                permitted,
            })
        })
    }

    fn objection_of(&self, exceeded: &LimitExceeded) -> Objection {
        let LimitExceeded { axis, quantity, demanded, .. } = *exceeded;
        let named = self.machine.axes.iter().find(|machine_axis| machine_axis.axis == axis);
        let name = named.map_or_else(|| axis.letter().to_string(), |axis| axis.name.clone());
        let (rotary, permitted) = (axis.is_rotary(), exceeded.permitted());
        Objection::Axis { name: name.into(), quantity, rotary, demanded, permitted }
    }

    /// Lowers the largest amplitude and highest frequency to what fits this element as well.
    fn search(&mut self, element: &Element, feed_mm_per_s: f64) {
        let programmed = self.condition;
        let amplitude_mm = self.largest_amplitude_mm.unwrap_or(programmed.amplitude_mm);
        let frequency_hz = self.highest_frequency_hz.unwrap_or(programmed.frequency_hz);
        let directions = element.largest_tangent();
        let fits = |condition: VibrationCondition| {
            let demand = self.demand(condition);
            let peaks = demand.peaks(feed_mm_per_s);
            let along = [feed_mm_per_s + peaks.velocity, peaks.acceleration, peaks.jerk];
            let is_followed = |axis: &MachineAxis| {
                let direction = directions[axis.axis.index()];
                along.iter().zip(limits_of(axis)).all(|(along, limit)| direction * along <= limit)
            };
            self.machine.axes.iter().all(is_followed)
                && demand.limit_pieces(element, &self.machine, feed_mm_per_s).is_ok()
        };
        let largest_amplitude_mm =
            largest_that(amplitude_mm, |amplitude_mm| fits(VibrationCondition { amplitude_mm, ..programmed }));
        let highest_frequency_hz =
            largest_that(frequency_hz, |frequency_hz| fits(VibrationCondition { frequency_hz, ..programmed }));
        self.largest_amplitude_mm = Some(largest_amplitude_mm);
        self.highest_frequency_hz = Some(highest_frequency_hz);
    }

    /// One report for each axis that moves, of the vibration inside the section beside the axes' own limits.
    pub(super) fn inside(&self) -> Vec<AxisLoadReport> {
        self.moving().map(|(load, axis)| load.report(axis, load.demanded(), limits_of(axis))).collect()
    }

    /// The same with all that decides whether the axes can follow: what curves leave of limits, and the steps of a published
    /// vibration.
    pub(super) fn deciding(&self, published_period_s: Option<f64>) -> Vec<AxisLoadReport> {
        let peaks = self.demand(self.condition).peaks(0.0);
        self.moving()
            .map(|(load, axis)| {
                let (mut demanded, mut limits) = (load.demanded(), limits_of(axis));
                if let Some(period_s) = published_period_s {
                    let [acceleration, jerk] = load.at_steps(&peaks, self.steps(1.0, period_s));
                    demanded = [demanded[0], demanded[1].max(acceleration), demanded[2].max(jerk)];
                }
                for (index, refused) in load.refused.iter().enumerate() {
                    if let Some([demand, permitted]) = *refused
                        && demand * limits[index] > demanded[index] * permitted
                    {
                        (demanded[index], limits[index]) = (demand, permitted);
                    }
                }
                load.report(axis, demanded, limits)
            })
            .collect()
    }

    fn moving(&self) -> impl Iterator<Item = (&AxisLoad, &MachineAxis)> {
        self.axes.iter().zip(&self.machine.axes).filter(|(load, _)| load.worst_direction > 0.0)
    }

    /// The steps of a published vibration at the ends of its parts, seen in setpoints (or servo setpoints) of `period_s`.
    pub(super) fn published_ends(&self, period_s: f64) -> PublishedEnds {
        let demand = self.demand(self.condition);
        let peaks = demand.peaks(0.0);
        let velocity_step_mm_per_s = peaks.velocity;
        let first_mm = demand.amplitude_mm() * sin_turns((self.condition.frequency_hz * period_s).min(0.25));
        let clamp_step_mm_per_s = velocity_step_mm_per_s + self.top_feed_mm_per_s;
        PublishedEnds {
            start_velocity_step_mm_per_s: velocity_step_mm_per_s,
            start_acceleration_mm_per_s2: first_mm / (period_s * period_s),
            clamp_velocity_step_mm_per_s: clamp_step_mm_per_s,
            clamp_acceleration_mm_per_s2: clamp_step_mm_per_s / period_s,
            has_corners: self.has_corners(),
            exceeded: self.exceeding(&peaks, self.steps(1.0, period_s)),
        }
    }

    fn has_corners(&self) -> bool {
        self.axes.iter().any(|load| load.kink > TANGENT_TOLERANCE_RAD)
    }

    /// The steps at the highest feed that is permitted or planned, times a ratio.
    fn steps(&self, feed_ratio: f64, period_s: f64) -> Steps {
        let feed_mm_per_s = feed_ratio * self.top_override * self.top_feed_mm_per_s;
        let is_along_path = self.settings.generation_mode == GenerationMode::AlongPath;
        Steps { feed_mm_per_s, period_s, rests: !is_along_path && self.has_corners() }
    }

    /// The axis whose limits the steps of a published vibration exceed most.
    fn exceeding(&self, peaks: &PathMotion, steps: Steps) -> Option<ExceededAxis> {
        let demanded = self.axes.iter().zip(&self.machine.axes).map(|(load, axis)| {
            let [acceleration_per_s2, jerk_per_s3] = load.at_steps(peaks, steps);
            ExceededAxis {
                axis: axis.name.clone(),
                rotary: axis.axis.is_rotary(),
                acceleration_per_s2,
                max_acceleration_per_s2: axis.max_acceleration_per_s2,
                jerk_per_s3,
                max_jerk_per_s3: axis.max_jerk_per_s3,
            }
        });
        demanded.max_by(|a, b| a.utilisation().total_cmp(&b.utilisation())).filter(|axis| axis.utilisation() > 1.0)
    }
}

/// The plane of an arc that is no spiral.
fn plane_of(element: &Element) -> Option<[Axis; 2]> {
    match &element.curve {
        Curve::Arc(arc) if arc.start_radius_mm == arc.end_radius_mm => {
            let is_ordered = arc.first.index() < arc.second.index();
            Some(if is_ordered { [arc.first, arc.second] } else { [arc.second, arc.first] })
        }
        _ => None,
    }
}

/// The largest value up to `start` that fits, found by bisection; 0 where none down to a millionth does. Not all below it need
/// fit: the blend of a smaller amplitude is shorter and steeper.
fn largest_that(start: f64, fits: impl Fn(f64) -> bool) -> f64 {
    if fits(start) {
        return start;
    }
    let (mut low, mut high) = (start * SEARCH_RATIO, start);
    while !fits(low) {
        if low <= 1e-6 * start {
            return 0.0;
        }
        (low, high) = (low * SEARCH_RATIO, low);
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
