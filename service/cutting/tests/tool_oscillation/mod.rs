//! Oscillation of a rotary tool, from the worked example of docs/functions/tool-oscillation.md to an independent
//! simulation.

mod brute_force;
mod conditions;
mod example;
mod program;
mod ramps;
mod request;
mod speeds;
mod waveforms;

use feedwave_cutting::tool_oscillation::{
    DirectionLimits, DirectionOscillation, Engagement, LeadingEdge, OscillationCondition, OscillationCut,
    OscillationJob, OscillationLimits, OscillationPeriod, ToolGeometry, Waveform,
};
use feedwave_program::SourceSpan;

/// The tool of the worked example.
fn tool() -> ToolGeometry {
    ToolGeometry::even(4, 60.0, 1.5, 5.0)
}

/// The oscillation of the worked example.
fn condition() -> OscillationCondition {
    let direction = |amplitude_mm, waveform| DirectionOscillation { amplitude_mm, waveform, phase_deg: 0.0 };
    OscillationCondition {
        period: OscillationPeriod::PerRevolution(1),
        feed: direction(0.4, Waveform::Sine),
        axial: direction(0.03, Waveform::HeldPeak { hold_share: 0.3 }),
        cross: None,
        leading_edge: LeadingEdge::default(),
        ramp_periods: 2,
        may_overrun: false,
        engagement: Engagement::Slot,
    }
}

/// The cut of the worked example: a full slot, 1 mm deep.
fn cut() -> OscillationCut {
    OscillationCut {
        feed_mm_per_min: 600.0,
        spindle_rev_per_min: 600.0,
        clockwise: true,
        depth_mm: 1.0,
        engagement_deg: [-90.0, 90.0],
        incline_deg: 0.0,
    }
}

/// A machine that can do all of it.
fn limits() -> OscillationLimits {
    let limits =
        DirectionLimits { velocity_mm_per_s: 500.0, acceleration_mm_per_s2: 10_000.0, jerk_mm_per_s3: 5_000_000.0 };
    OscillationLimits { plane: limits, axial: limits }
}

fn job<'a>(tool: &'a ToolGeometry, condition: &'a OscillationCondition) -> OscillationJob<'a> {
    OscillationJob {
        tool,
        condition,
        leading_edge: condition.leading_edge.edge,
        cut: cut(),
        limits: limits(),
        max_feed_override: 1.0,
        drives: None,
        floor: None,
        span: SourceSpan { line: 7, column: 1, length: 4, ..SourceSpan::default() },
    }
}

#[track_caller]
fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} instead of {expected}");
}
