//! Values of an oscillation that are impossible by themselves, each a finding: without them nothing can be computed.

use feedwave_program::{Finding, SourceSpan};

use super::Engagement;
use super::code;
use super::condition::{MAX_RAMP_PERIODS, OscillationPeriod, nearest_periods_per_rev};
use super::findings::use_periods;
use super::report::OscillationJob;
use super::waveform::{MAX_HOLD_SHARE, WaveformError};
use crate::shared::track::MAX_AMPLITUDE_MM;
use crate::shared::wording::decimal;

/// Share by which a period may miss a whole part of a revolution: what a time written with six digits is rounded by.
const PERIOD_TOLERANCE: f64 = 1e-5;
/// Most periods per revolution.
const MAX_PERIODS_PER_REV: f64 = 1_000.0;

/// Values that are impossible by themselves.
pub(super) fn input(job: &OscillationJob<'_>, findings: &mut Vec<Finding>) {
    if let Err(error) = job.tool.check() {
        let finding = Finding::new(code::OSC_TOOL, job.span, error.to_string());
        findings.push(finding.suggest("correct the tool in the tool library"));
    }
    let mut check = |name: &'static str, value: f64, low: f64, high: f64, unit: &'static str| {
        // NaN is refused as well.
        if !(low..=high).contains(&value) {
            let message = format!("the oscillation's {name} must be between {low} and {high} {unit}, is {value}");
            let nearest = if value > high { high } else { low };
            findings.push(
                Finding::new(code::OSC_VALUE, job.span, message)
                    .ranked(name, value.abs())
                    .with_value("value", value, unit)
                    .with_value("least", low, unit)
                    .with_value("most", high, unit)
                    .suggest_value("use a value within the range", None, "nearest", nearest, unit),
            );
        }
    };
    let (condition, cut) = (job.condition, &job.cut);
    let directions =
        [("feed", Some(&condition.feed)), ("axial", Some(&condition.axial)), ("cross", condition.cross.as_ref())];
    for (name, direction) in directions.iter().filter_map(|(name, direction)| Some((*name, (*direction)?))) {
        let (amplitude, phase) = match name {
            "feed" => ("feed amplitude", "feed phase"),
            "axial" => ("axial amplitude", "axial phase"),
            _ => ("cross amplitude", "cross phase"),
        };
        check(amplitude, direction.amplitude_mm, 0.0, MAX_AMPLITUDE_MM, "mm");
        check(phase, direction.phase_deg, -360.0, 360.0, "deg");
    }
    check("leading phase", condition.leading_edge.phase_deg, -360.0, 360.0, "deg");
    check("number of ramp periods", f64::from(condition.ramp_periods), 1.0, f64::from(MAX_RAMP_PERIODS), "");
    check("feed", cut.feed_mm_per_min, 1e-3, 1e6, "mm/min");
    check("spindle speed", cut.spindle_rev_per_min, 1e-3, 1e6, "rev/min");
    check("depth", cut.depth_mm, 0.0, 1_000.0, "mm");
    check("start of the engagement", cut.engagement_deg[0], -90.0, 90.0, "deg");
    check("end of the engagement", cut.engagement_deg[1], cut.engagement_deg[0].clamp(-90.0, 90.0), 90.0, "deg");
    check("inclination of the path", cut.incline_deg, 0.0, 90.0, "deg");
    if let Engagement::Width { width_mm, .. } = condition.engagement {
        check("width of the engagement", width_mm, 1e-3, 2.0 * job.tool.radius_mm, "mm");
    }
    match condition.period {
        OscillationPeriod::PerRevolution(periods) => {
            check("number of periods per revolution", f64::from(periods), 1.0, MAX_PERIODS_PER_REV, "");
        }
        OscillationPeriod::Seconds(seconds) => check("period", seconds, 1e-6, 1e3, "s"),
    }
    for (name, direction) in directions.iter().filter_map(|(name, direction)| Some((*name, (*direction)?))) {
        if let Err(error) = direction.waveform.compile() {
            findings.push(waveform(name, &error, job.span));
        }
    }
    findings.extend(leading_edge(job));
}

/// The tool does not have the edge that is to lead.
fn leading_edge(job: &OscillationJob<'_>) -> Option<Finding> {
    let edges = job.tool.edge_count();
    if (1..=edges).contains(&job.leading_edge) {
        return None;
    }
    let message = format!("edge {} is to lead, but the tool has the edges 1 to {edges}", job.leading_edge);
    Some(
        Finding::new(code::OSC_LEADING_EDGE, job.span, message)
            .with_value("edge", f64::from(job.leading_edge), "")
            .with_value("edges", f64::from(edges), "")
            .suggest_value("let the first edge lead", None, "edge", 1.0, ""),
    )
}

fn waveform(direction: &str, error: &WaveformError, span: SourceSpan) -> Finding {
    let finding = Finding::new(code::OSC_WAVEFORM, span, format!("waveform in the {direction} direction: {error}"));
    match *error {
        WaveformError::HoldShare(share) => {
            let nearest = if share > MAX_HOLD_SHARE { MAX_HOLD_SHARE } else { 0.0 };
            finding.with_value("hold_share", share, "").suggest_value(
                "use a share within the range",
                None,
                "hold_share",
                nearest,
                "",
            )
        }
        WaveformError::PointCount(count) => finding.with_value("points", count as f64, ""),
        WaveformError::Phase { number, phase } => {
            finding.with_value("point", number as f64, "").with_value("phase", phase, "")
        }
        WaveformError::Peak(peak) => {
            finding.with_value("peak", peak, "").suggest("divide all values by the largest and scale the amplitude")
        }
    }
}

/// Periods per revolution M; `None`, with a finding, where the period is no whole part of a revolution.
pub(super) fn period(job: &OscillationJob<'_>, findings: &mut Vec<Finding>) -> Option<u32> {
    let seconds = match job.condition.period {
        OscillationPeriod::PerRevolution(periods) => return Some(periods),
        OscillationPeriod::Seconds(seconds) => seconds,
    };
    let revolution_s = 60.0 / job.cut.spindle_rev_per_min;
    let periods = revolution_s / seconds;
    let whole = periods.round().clamp(1.0, MAX_PERIODS_PER_REV);
    if (periods - whole).abs() <= PERIOD_TOLERANCE * whole {
        return Some(whole as u32);
    }
    let nearest = f64::from(nearest_periods_per_rev(job.tool, periods));
    let message = format!(
        "a period of {} ms is no whole part of a revolution of {} ms: {} periods fit",
        decimal(seconds * 1e3, 4),
        decimal(revolution_s * 1e3, 4),
        decimal(periods, 4)
    );
    findings.push(
        Finding::new(code::OSC_PERIOD_FRACTION, job.span, message)
            .ranked("", (periods - whole).abs())
            .with_value("period", seconds, "s")
            .with_value("revolution", revolution_s, "s")
            .with_value("periods_per_rev", periods, "")
            .suggest_value(use_periods(nearest), None, "periods_per_rev", nearest, "")
            .suggest_value("or the period that belongs to it", None, "period", revolution_s / nearest, "s"),
    );
    None
}
