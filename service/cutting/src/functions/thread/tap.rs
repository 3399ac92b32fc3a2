//! Rigid tapping: strokes in which spindle and tool start, move and come to rest together.
//!
//! The tool is at every instant where the spindle's angle says: a stroke is one motion from rest to rest, and the angle
//! is its path over the lead. So the tap goes out through the thread that it has cut, whatever the speeds are.

use feedwave_motion::{Element, Machine, PathLimits, PathMotion, Profile, missing_axis, path_limits};
use feedwave_program::{
    Axis, Finding, FindingLog, Move, MoveKind, PathControl, SourceSpan, SpindleDirection, ThreadMove,
};
use serde::{Deserialize, Serialize};

use super::code;
use super::pass::axis_limits;
use crate::shared::checks::{MAX_BLOCK_DURATION_S, Travel, missing, too_long};

/// A tap whose spindle stays below this share of its speed is reported.
const SPEED_REACHED: f64 = 0.99;

/// A stroke to run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct TapRun {
    pub(crate) element: Element,
    pub(crate) profile: Profile,
    /// Turn of the spindle along the path, revolutions per mm, signed.
    pub(crate) rev_per_mm: f64,
}

impl TapRun {
    /// The stroke along a straight element of its own; nothing after a finding that forbids it.
    pub(crate) fn new(
        stroke: &ThreadMove,
        element: Element,
        span: SourceSpan,
        travel: Travel<'_>,
        findings: &mut FindingLog,
    ) -> Option<Self> {
        let machine = travel.machine;
        if let Some(axis) = missing_axis(&element, machine) {
            findings.push(missing(axis, span, machine, false));
            return None;
        }
        travel.check(&element, findings);
        let rev_per_s = stroke.spindle.rev_per_s(0.0).min(machine.max_spindle_rev_per_min / 60.0);
        let wanted_mm_per_s = stroke.lead_mm * rev_per_s;
        let limits = path_limits(&element, machine, PathMotion::ZERO).ok()?;
        if wanted_mm_per_s > limits.velocity * (1.0 + 1e-9) {
            findings.push(too_fast(&element, wanted_mm_per_s, rev_per_s, machine));
        }
        let limits = PathLimits { velocity: wanted_mm_per_s.min(limits.velocity), ..limits };
        let profile = Profile::solve(element.length, 0.0, 0.0, limits)?;
        let duration_s = profile.duration();
        if !(0.0..=MAX_BLOCK_DURATION_S).contains(&duration_s) {
            findings.push(too_long(span, duration_s));
            return None;
        }
        let sense = if stroke.spindle.direction == SpindleDirection::CounterClockwise { -1.0 } else { 1.0 };
        Some(Self { element, profile, rev_per_mm: sense / stroke.lead_mm })
    }

    /// Turn of the spindle in the whole stroke, revolutions, signed.
    pub(crate) fn turn_rev(&self) -> f64 {
        self.rev_per_mm * self.element.length
    }

    /// Highest speed of the spindle, rev/s.
    pub(crate) fn peak_rev_per_s(&self) -> f64 {
        self.profile.peak_velocity() * self.rev_per_mm.abs()
    }

    /// A spindle that the stroke is too short for.
    pub(crate) fn speed_finding(&self, stroke: &ThreadMove) -> Option<Finding> {
        let (wanted, reached) = (60.0 * stroke.spindle.rev_per_s(0.0), 60.0 * self.peak_rev_per_s());
        if reached >= SPEED_REACHED * wanted {
            return None;
        }
        let length_mm = self.element.length;
        let message = format!(
            "the stroke of {length_mm:.3} mm is too short for {wanted} rev/min: the spindle reaches {reached:.0} rev/min"
        );
        Some(
            Finding::new(code::THREAD_TAP_SPEED, self.element.source, message)
                .ranked("", 1.0 - reached / wanted)
                .with_value("spindle_speed", wanted, "rev/min")
                .with_value("reached", reached, "rev/min")
                .with_value("stroke", length_mm, "mm")
                .suggest_value("the thread is the same at a lower speed", None, "speed", reached.floor(), "rev/min"),
        )
    }
}

/// A stroke as a straight cut.
pub(crate) fn straight(stroke: &ThreadMove) -> Move {
    Move {
        kind: MoveKind::Cutting,
        start: stroke.start,
        end: stroke.end,
        work_offset: stroke.work_offset,
        arc: None,
        spline: None,
        path_control: PathControl::ExactStop,
        feed: feedwave_program::Feed::PerRevolution(stroke.lead_mm),
        spindle: stroke.spindle,
        tool: stroke.tool,
        leads_xyz: false,
        cycle: None,
    }
}

/// The finding on a lead and a speed that an axis cannot follow.
fn too_fast(element: &Element, wanted_mm_per_s: f64, rev_per_s: f64, machine: &Machine) -> Finding {
    let share = |axis: Axis| (element.end[axis.index()] - element.start[axis.index()]).abs() / element.length;
    let excess = |axis: Axis| wanted_mm_per_s * share(axis) / axis_limits(machine, axis).velocity;
    let moving = Axis::ALL.into_iter().filter(|&axis| share(axis) > 0.0);
    let worst = moving.max_by(|&one, &other| excess(one).total_cmp(&excess(other))).unwrap_or(Axis::Z);
    let (demanded, limit) = (wanted_mm_per_s * share(worst), axis_limits(machine, worst).velocity);
    let speed = (60.0 * rev_per_s * limit / demanded).floor();
    let letter = worst.letter();
    let message = format!("the tap moves {letter} with {demanded:.1} mm/s, whose limit is {limit:.1} mm/s");
    Finding::new(code::THREAD_AXIS_SPEED, element.source, message)
        .ranked(letter.to_string(), demanded / limit)
        .with_value("velocity", demanded, "mm/s")
        .with_value("limit", limit, "mm/s")
        .suggest_value(format!("turn at {speed} rev/min at most"), None, "spindle_speed", speed, "rev/min")
}
