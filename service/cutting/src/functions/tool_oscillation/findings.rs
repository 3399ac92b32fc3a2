//! The conditions of docs/functions/tool-oscillation.md ("Conditions"), each a finding with its numbers and what cures
//! it.

use feedwave_motion::Quantity;
use feedwave_program::Finding;

use super::code;
use super::condition::{OscillationPeriod, nearest_periods_per_rev};
use super::following::suggest_phase;
use super::limits::leaves_feed;
use super::report::{DirectionLoad, OscillationJob, OscillationReport, synchronise};
use super::waveform::MAX_HOLD_SHARE;
use super::{DirectionPeaks, OscillationDirection, Waveform, ramp_mm};
use crate::functions::axis_load::{AxisCodes, AxisLoad};
use crate::shared::wording::{decimal, round_down, round_up};

const AXIS_CODES: AxisCodes = [code::OSC_AXIS_VELOCITY, code::OSC_AXIS_ACCELERATION, code::OSC_AXIS_JERK];
/// Phase error from which on it is worth a warning, degrees.
pub(super) const PHASE_TOLERANCE_DEG: f64 = 1.0;
/// Tolerance for the rounding of computed limits, which are often met exactly.
pub(super) const ROUNDING: f64 = 1e-9;
/// Longest hold that a waveform is suggested for: what is left is one ramp, a short retraction and the other ramp.
const MAX_LONG_HOLD: f64 = 0.9;
/// Amplitudes that are tried beside another waveform, in equal steps.
const AMPLITUDE_SHARES: u32 = 64;
/// Height that counts as left over above an edge, mm.
pub(super) const NOTHING_MM: f64 = 1e-6;

/// The cure by another number of periods per revolution.
pub(super) fn use_periods(periods: f64) -> String {
    format!("use {periods} {} per revolution", if periods == 1.0 { "period" } else { "periods" })
}

/// Every condition of a pass whose quantities are possible.
pub(super) fn conditions(job: &OscillationJob<'_>, report: &OscillationReport, findings: &mut Vec<Finding>) {
    edges_and_period(job, report, findings);
    hold(job, report, findings);
    step(job, report, findings);
    overrides(job, report, findings);
    phase(job, report, findings);
    roles(job, report, findings);
    for load in &report.loads {
        dynamics(job, load, findings);
    }
    depth(job, report, findings);
}

fn edges_and_period(job: &OscillationJob<'_>, report: &OscillationReport, findings: &mut Vec<Finding>) {
    let (edges, periods) = (job.tool.edge_count(), report.periods_per_rev);
    if edges.is_multiple_of(periods) {
        return;
    }
    let nearest = f64::from(nearest_periods_per_rev(job.tool, f64::from(periods)));
    let message =
        format!("{periods} periods per revolution do not divide the {edges} edges: no edge leads in every period");
    findings.push(
        Finding::new(code::OSC_EDGES_PERIOD, job.span, message)
            .with_value("edges", f64::from(edges), "")
            .with_value("periods_per_rev", f64::from(periods), "")
            .suggest_value(use_periods(nearest), None, "periods_per_rev", nearest, ""),
    );
}

fn hold(job: &OscillationJob<'_>, report: &OscillationReport, findings: &mut Vec<Finding>) {
    let (held, required) = (report.hold_share, report.required_hold_share);
    if held >= required * (1.0 - ROUNDING) || job.condition.axial.amplitude_mm == 0.0 {
        return;
    }
    let message = format!(
        "the largest protrusion is held for {} of the period, but the next edge comes after {}: the protruded edges close \
         no circle and the floor is not smooth",
        decimal(held, 4),
        decimal(required, 4)
    );
    let finding = Finding::new(code::OSC_HOLD_SHORT, job.span, message)
        .ranked("", required - held)
        .with_value("hold_share", held, "")
        .with_value("required", required, "");
    findings.push(if required <= MAX_HOLD_SHARE {
        let share = round_up(required, 4).min(MAX_HOLD_SHARE);
        finding.suggest_value(
            format!("use a held peak with a hold share of at least {}", decimal(share, 4)),
            None,
            "hold_share",
            share,
            "",
        )
    } else {
        longer_hold(job, report, finding)
    });
}

/// Cures where extremes that are held alike cannot be held long enough: fewer periods per revolution, or a waveform that holds
/// the protrusion longer than the retraction.
fn longer_hold(job: &OscillationJob<'_>, report: &OscillationReport, finding: Finding) -> Finding {
    let (edges, gap) = (job.tool.edge_count(), job.tool.widest_gap_turns());
    let fitting = |most: f64| {
        (1..=edges).rev().find(|periods| f64::from(*periods) * gap <= most && edges.is_multiple_of(*periods))
    };
    let finding = match fitting(MAX_HOLD_SHARE).map(f64::from) {
        Some(periods) => finding.suggest_value(use_periods(periods), None, "periods_per_rev", periods, ""),
        None => finding,
    };
    let Some(periods) = fitting(MAX_LONG_HOLD).filter(|periods| *periods <= report.periods_per_rev) else {
        return finding.suggest("use a tool with more edges");
    };
    let (points, hold_share) = long_hold(f64::from(periods) * gap);
    let points = points.map(|[phase, value]| format!("({}, {value})", decimal(phase, 3))).join(", ");
    let with = format!("the axial waveform of a table through {points}, which holds the protrusion longer");
    if periods == report.periods_per_rev {
        finding.suggest_value(format!("use {with}"), None, "hold_share", hold_share, "")
    } else {
        let periods = f64::from(periods);
        finding.suggest_value(format!("{} and {with}", use_periods(periods)), None, "periods_per_rev", periods, "")
    }
}

/// A table that holds the protrusion around ¾ of the period for a little more than `required`, and the share for which it does.
/// What is left is shared by ramps, retraction and ramps as 3 : 4 : 3.
fn long_hold(required: f64) -> ([[f64; 2]; 4], f64) {
    let trough = round_up(0.5 * required + 0.01, 3);
    let crest = round_down(0.2 * (1.0 - 2.0 * trough), 3);
    let points = [[trough - 0.25, -1.0], [0.25 - crest, 1.0], [0.25 + crest, 1.0], [0.75 - trough, -1.0]];
    (points, 2.0 * trough)
}

fn step(job: &OscillationJob<'_>, report: &OscillationReport, findings: &mut Vec<Finding>) {
    let (step_mm, length_mm) = (report.feed_per_period_mm, job.tool.radial_edge_length_mm);
    if step_mm <= length_mm * (1.0 + ROUNDING) {
        return;
    }
    let feed = round_down(60.0 * length_mm / report.period_s, 1);
    let message = format!(
        "the feed goes {} mm in one period, further than the {} mm that an edge cuts at its end",
        decimal(step_mm, 4),
        decimal(length_mm, 4)
    );
    let finding = Finding::new(code::OSC_STEP_LONG, job.span, message)
        .ranked("", step_mm / length_mm)
        .with_value("feed_per_period", step_mm, "mm")
        .with_value("radial_edge_length", length_mm, "mm")
        .suggest_value(format!("feed at most {} mm/min", decimal(feed, 1)), None, "feed", feed, "mm/min");
    let speed = round_up(job.cut.spindle_rev_per_min * step_mm / length_mm, 1);
    findings.push(finding.suggest_value(
        format!("or turn at {} rev/min at least", decimal(speed, 1)),
        None,
        "spindle_speed",
        speed,
        "rev/min",
    ));
}

/// A condition that holds at the programmed feed, but not at every override that is permitted.
fn overrides(job: &OscillationJob<'_>, report: &OscillationReport, findings: &mut Vec<Finding>) {
    let [low, high] = report.feed_range_mm_per_min;
    let (feed, most) = (job.cut.feed_mm_per_min, job.max_feed_override);
    // What does not hold at the programmed feed is said of it.
    if !(low..=high * (1.0 + ROUNDING)).contains(&feed) {
        return;
    }
    let finding = |message: String, ratio: f64, rank: f64, subject: &'static str| {
        Finding::new(code::OSC_OVERRIDE, job.span, message)
            .ranked(subject, rank)
            .with_value("override", ratio, "")
            .with_value("max_override", most, "")
            .with_value("min_feed", low, "mm/min")
            .with_value("max_feed", high, "mm/min")
    };
    if feed * most > high * (1.0 + ROUNDING) {
        let ratio = round_down(high / feed, 3);
        let message = format!(
            "at an override of {} the feed is {} mm/min, but the conditions hold up to {} mm/min only",
            decimal(most, 3),
            decimal(feed * most, 1),
            decimal(high, 1)
        );
        let cure = round_down(high / most, 1);
        findings.push(
            finding(message, ratio, feed * most / high, "high")
                .suggest_value(format!("feed at most {} mm/min", decimal(cure, 1)), None, "feed", cure, "mm/min")
                .suggest(format!(
                    "or permit overrides up to {} only, max_feed_override of the machine profile",
                    decimal(ratio, 3)
                )),
        );
    }
    if low > 0.0 {
        let ratio = round_up(low / feed, 3);
        let message = format!(
            "below an override of {} the stages leave material above an edge: the feed has to be {} mm/min at least",
            decimal(ratio, 3),
            decimal(low, 1)
        );
        findings.push(
            finding(message, ratio, low / feed, "low").suggest("cut less deep, so that the edges need no stages"),
        );
    }
}

fn phase(job: &OscillationJob<'_>, report: &OscillationReport, findings: &mut Vec<Finding>) {
    // What the drives let arrive at the tool counts, where they are known; see also `OSC-FOLLOWING`.
    let at_tool_deg = report.following.as_ref().map(|following| following.phase_error_deg);
    let error_deg = report.phase_error_deg;
    if at_tool_deg.is_some_and(|deg| deg.abs() <= PHASE_TOLERANCE_DEG) {
        return;
    }
    if error_deg.abs() <= PHASE_TOLERANCE_DEG {
        return;
    }
    let message = format!(
        "the largest protrusion comes {} degrees {} the largest retreat in the feed direction",
        decimal(error_deg.abs(), 2),
        if error_deg > 0.0 { "after" } else { "before" }
    );
    // Beyond a quarter the protruded tool is in front of the retracted one: it would rough with what has to finish.
    let finding = if error_deg.abs() > 90.0 {
        Finding::new(code::OSC_PHASE, job.span, format!("{message}: it would finish before it roughs"))
    } else {
        Finding::new(code::OSC_PHASE_OFF, job.span, message)
    };
    let finding = finding.ranked("", error_deg.abs()).with_value("phase_error", error_deg, "deg");
    findings.push(suggest_phase(finding, job, report));
}

/// Which edges lead and finish, and whether they are those meant for it.
fn roles(job: &OscillationJob<'_>, report: &OscillationReport, findings: &mut Vec<Finding>) {
    let names = |edges: &[u32]| edges.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    let finishing = match &report.finishing_edges[..] {
        edges @ [_] => format!("edge {} finishes", names(edges)),
        edges => format!("edges {} finish", names(edges)),
    };
    let message = format!("edge {} leads, {finishing}", report.leading_edge);
    findings.push(
        Finding::new(code::OSC_ROLES, job.span, message)
            .with_value("leading_edge", f64::from(report.leading_edge), "")
            .with_value("finishing_edges", report.finishing_edges.len() as f64, "")
            .with_value("expected_finishing_edges", f64::from(report.periods_per_rev), ""),
    );
    let meant: Vec<u32> =
        (1..).zip(&job.tool.edges).filter(|(_, edge)| edge.finishing).map(|(number, _)| number).collect();
    if meant.is_empty() || report.finishing_edges.iter().all(|edge| meant.contains(edge)) {
        return;
    }
    // Turning the roles by the distance from a finishing edge to the one meant for it.
    let edges = job.tool.edge_count();
    let shift = report.finishing_edges.first().map_or(0, |finishing| (meant[0] + edges - finishing) % edges);
    let leading = (job.leading_edge - 1 + shift) % edges + 1;
    let message = format!("{finishing}, but edge {} is meant for it", names(&meant));
    findings.push(
        Finding::new(code::OSC_FINISHING_EDGE, job.span, message)
            .with_value("finishing_edge", f64::from(report.finishing_edges.first().copied().unwrap_or(0)), "")
            .with_value("meant", f64::from(meant[0]), "")
            .suggest_value(format!("let edge {leading} lead"), None, "leading_edge", f64::from(leading), ""),
    );
}

fn dynamics(job: &OscillationJob<'_>, load: &DirectionLoad, findings: &mut Vec<Finding>) {
    let (name, amplitude) = match load.direction {
        OscillationDirection::Feed => ("in the feed direction", "feed_amplitude"),
        OscillationDirection::Axial => ("along the tool axis", "axial_amplitude"),
        OscillationDirection::Cross => ("across the feed", "cross_amplitude"),
    };
    let feed = load.velocity_with_feed_mm_per_s - load.peaks.velocity_mm_per_s;
    let DirectionPeaks { velocity_mm_per_s, acceleration_mm_per_s2, jerk_mm_per_s3, .. } = load.peaks;
    let demanded = [velocity_mm_per_s + feed, acceleration_mm_per_s2, jerk_mm_per_s3];
    let limits = load.limits;
    let limits = [limits.velocity_mm_per_s, limits.acceleration_mm_per_s2, limits.jerk_mm_per_s3];
    for axis in AxisLoad::of_linear(demanded, limits).into_iter().filter(|axis| axis.exceeds(ROUNDING)) {
        let AxisLoad { quantity, demanded, limit, .. } = axis;
        // The feed takes its part of the velocity first.
        let (peak, taken) = match quantity {
            Quantity::Velocity => (velocity_mm_per_s, feed),
            Quantity::Acceleration | Quantity::Jerk => (demanded, 0.0),
        };
        let left = (limit - taken).max(0.0);
        let message = format!(
            "the oscillation {name} takes {} {} of the {quantity}, whose limit is {}",
            decimal(demanded, 1),
            axis.unit(),
            decimal(limit, 1)
        );
        let mut finding = axis.with_numbers(Finding::new(axis.code(&AXIS_CODES), job.span, message), name);
        if peak > 0.0 && left > 0.0 {
            let largest_mm = round_down(load.amplitude_mm * left / peak, 4);
            let speed = round_down(job.cut.spindle_rev_per_min * libm::pow(left / peak, 1.0 / axis.order()), 1);
            finding = finding
                .suggest_value(
                    format!("the machine can follow an amplitude of {} mm", decimal(largest_mm, 4)),
                    None,
                    amplitude,
                    largest_mm,
                    "mm",
                )
                .suggest_value(
                    format!("or turn at {} rev/min at most", decimal(speed, 1)),
                    None,
                    "spindle_speed",
                    speed,
                    "rev/min",
                );
        }
        findings.push(finding);
    }
    jerk_step(job, load, name, findings);
}

/// A step of the acceleration, whose jerk is unbounded.
fn jerk_step(job: &OscillationJob<'_>, load: &DirectionLoad, name: &'static str, findings: &mut Vec<Finding>) {
    let step = load.peaks.acceleration_step_mm_per_s2;
    if step > 0.0 {
        let message = format!(
            "the waveform {name} steps the acceleration by {} mm/s²: the jerk is unbounded there",
            decimal(step, 1)
        );
        let waveform = match load.direction {
            OscillationDirection::Feed => Some(&job.condition.feed.waveform),
            OscillationDirection::Axial => Some(&job.condition.axial.waveform),
            OscillationDirection::Cross => job.condition.cross.as_ref().map(|cross| &cross.waveform),
        };
        let finding = Finding::new(code::OSC_JERK_STEP, job.span, message).ranked(name, step).with_value(
            "acceleration_step",
            step,
            "mm/s²",
        );
        findings.push(match waveform {
            Some(Waveform::HeldPeak { hold_share }) => jerk_limited(job, load, *hold_share, finding),
            // No other waveform holds the protrusion longer than the retraction.
            Some(Waveform::Table { .. }) if needs_long_hold(job, load.direction) => {
                finding.suggest("use a smaller axial amplitude or a lower spindle speed, which make the step smaller")
            }
            _ => finding.suggest("use a sine or the jerk-limited held peak"),
        });
    }
}

/// The jerk-limited held peak instead, with as much of the amplitude as its larger jerk leaves possible.
fn jerk_limited(job: &OscillationJob<'_>, load: &DirectionLoad, hold_share: f64, finding: Finding) -> Finding {
    let fits = |amplitude_mm: f64| {
        let mut condition = job.condition.clone();
        let direction = match load.direction {
            OscillationDirection::Feed => Some(&mut condition.feed),
            OscillationDirection::Axial => Some(&mut condition.axial),
            OscillationDirection::Cross => condition.cross.as_mut(),
        };
        if let Some(direction) = direction {
            direction.waveform = Waveform::JerkLimitedHeldPeak { hold_share };
            direction.amplitude_mm = amplitude_mm;
        }
        let job = OscillationJob { condition: &condition, ..*job };
        synchronise(&job, &mut Vec::new()).is_some_and(|oscillation| {
            let feed_per_period_mm = job.cut.feed_per_rev_mm() / f64::from(oscillation.periods_per_rev);
            let feed_mm = oscillation.feed.amplitude_mm;
            let ramp_mm = ramp_mm(condition.ramp_periods, feed_per_period_mm, feed_mm, condition.may_overrun);
            leaves_feed(&oscillation, &job.cut, ramp_mm, &job)
        })
    };
    let cure = "use the jerk-limited held peak with the same holds";
    if fits(load.amplitude_mm) {
        return finding.suggest_value(cure, None, "hold_share", hold_share, "");
    }
    let shares = (1..AMPLITUDE_SHARES).rev().map(|share| f64::from(share) / f64::from(AMPLITUDE_SHARES));
    let amplitudes = shares.map(|share| round_down(share * load.amplitude_mm, 4));
    match amplitudes.into_iter().find(|amplitude_mm| *amplitude_mm > 0.0 && fits(*amplitude_mm)) {
        Some(amplitude_mm) => finding.suggest_value(
            format!(
                "{cure} and an amplitude of {} mm, beyond which the axes cannot follow it",
                decimal(amplitude_mm, 4)
            ),
            None,
            "hold_share",
            hold_share,
            "",
        ),
        None => finding.suggest("use a smaller amplitude or a lower spindle speed, which make the step smaller"),
    }
}

/// Whether extremes that are held alike would leave the floor rough.
fn needs_long_hold(job: &OscillationJob<'_>, direction: OscillationDirection) -> bool {
    let periods = match job.condition.period {
        OscillationPeriod::PerRevolution(periods) => f64::from(periods),
        OscillationPeriod::Seconds(seconds) => 60.0 / job.cut.spindle_rev_per_min / seconds,
    };
    direction == OscillationDirection::Axial && periods * job.tool.widest_gap_turns() > MAX_HOLD_SHARE
}

fn depth(job: &OscillationJob<'_>, report: &OscillationReport, findings: &mut Vec<Finding>) {
    let (reach_mm, height_mm) = (report.axial_reach_mm, job.tool.axial_edge_height_mm);
    if reach_mm <= height_mm * (1.0 + ROUNDING) {
        return;
    }
    let message = format!(
        "depth and axial travel together are {} mm, the edges are {} mm high",
        decimal(reach_mm, 4),
        decimal(height_mm, 4)
    );
    let with_values = |finding: Finding| {
        finding
            .ranked("", reach_mm - height_mm)
            .with_value("reach", reach_mm, "mm")
            .with_value("edge_height", height_mm, "mm")
            .with_value("left_above_edge", report.above_edge_mm, "mm")
    };
    if report.above_edge_mm <= NOTHING_MM {
        let message = format!("{message}; the stages leave nothing above an edge");
        findings.push(with_values(Finding::new(code::OSC_DEPTH_COVERED, job.span, message)));
        return;
    }
    let message = format!("{message}: {} mm meet the tool above an edge", decimal(report.above_edge_mm, 4));
    let mut finding = with_values(Finding::new(code::OSC_DEPTH, job.span, message));
    let travel_mm = 2.0 * job.condition.axial.amplitude_mm;
    let depth_mm = round_down(height_mm - travel_mm, 4);
    if depth_mm > 0.0 {
        let cure = format!("cut at most {} mm deep", decimal(depth_mm, 4));
        finding = finding.suggest_value(cure, None, "depth", depth_mm, "mm");
    }
    let amplitude_mm = round_down(0.5 * (height_mm - job.cut.depth_mm), 4);
    if amplitude_mm > 0.0 {
        let cure = format!("or use an axial amplitude of at most {} mm", decimal(amplitude_mm, 4));
        finding = finding.suggest_value(cure, None, "axial_amplitude", amplitude_mm, "mm");
    }
    findings.push(finding);
}
