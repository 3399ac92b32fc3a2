//! Validation reports: from the pipeline to the contract.

use feedwave_cutting::{
    AxisLimitTimes, AxisSummary, LimitTimes, PathDeviation, PeakPlace, ProgramSummary, Slowdown, SlowdownCause,
    SlowdownCure, ValidationReport,
};
use feedwave_program::{Finding, NamedValue, Occurrence, RelatedPlace, Severity, Suggestion};

use super::action::file_name;
use super::functions;
use super::offsets::initial_offsets_to_proto;
use super::profile::plan_quality_to_proto;
use super::report_size::{self, MAX_REPORT_BYTES};
use crate::proto;

/// A report as the contract has it, within the 4 MiB that a gRPC client takes where it sets nothing.
#[must_use]
pub fn report_to_proto(report: &ValidationReport) -> proto::ValidationReport {
    bounded_report(report, MAX_REPORT_BYTES)
}

/// A report of `max_bytes` at most.
pub(super) fn bounded_report(report: &ValidationReport, max_bytes: usize) -> proto::ValidationReport {
    let mut shown = proto::ValidationReport {
        findings: report.findings.iter().map(|finding| finding_to_proto(finding, &report.programs)).collect(),
        summary: Some(summary_to_proto(&report.summary, &report.programs)),
        offsets: initial_offsets_to_proto(&report.offsets),
        ..proto::ValidationReport::default()
    };
    functions::report_to_proto(report, &mut shown);
    report_size::bound(&mut shown, max_bytes);
    shown
}

/// A summary as the contract has it; `programs` are the names of the job's further files.
#[must_use]
pub fn summary_to_proto(summary: &ProgramSummary, programs: &[String]) -> proto::ProgramSummary {
    let is_planned = summary.setpoint_count > 0;
    let own_time = proto::QualityTime {
        plan_quality: plan_quality_to_proto(summary.plan_quality).into(),
        duration_s: summary.duration_s,
    };
    proto::ProgramSummary {
        errors: summary.errors,
        warnings: summary.warnings,
        infos: summary.infos,
        findings_not_listed: summary.findings_not_listed,
        section_count: summary.section_count,
        thread_count: summary.thread_count,
        thread_passes: summary.thread_passes,
        oscillation_count: summary.oscillation_count,
        oscillating_cutting_time_s: summary.oscillating_cutting_time_s,
        program_bytes: summary.bytes,
        lines: summary.lines,
        moves: summary.moves,
        cutting_moves: summary.cutting_moves,
        interpolation_period_us: summary.interpolation_period_us,
        plan_quality: plan_quality_to_proto(summary.plan_quality).into(),
        setpoint_count: summary.setpoint_count,
        duration_s: summary.duration_s,
        cutting_time_s: summary.cutting_time_s,
        rapid_time_s: summary.rapid_time_s,
        rest_time_s: summary.rest_time_s,
        path_length_mm: summary.path_length_mm,
        cutting_length_mm: summary.cutting_length_mm,
        tools: summary.tools.clone(),
        axes: summary.axes.iter().map(axis_summary).collect(),
        spindle_speed: summary
            .spindle_rev_per_min
            .map(|[min_rev_per_min, max_rev_per_min]| proto::SpindleSpeedRange { min_rev_per_min, max_rev_per_min }),
        limit_times: Some(limit_times(&summary.limit_times)),
        axis_limit_times: summary.axis_limit_times.iter().map(axis_limit_times).collect(),
        path_deviation: summary.path_deviation.as_ref().map(|deviation| path_deviation(deviation, programs)),
        slowdown_time_s: summary.slowdown_time_s,
        slowdowns: summary.slowdowns.iter().map(|at| slowdown(at, programs)).collect(),
        quality_times: is_planned.then_some(own_time).into_iter().collect(),
    }
}

fn axis_limit_times(times: &AxisLimitTimes) -> proto::AxisLimitTimes {
    let AxisLimitTimes { axis, velocity_s, acceleration_s, jerk_s } = times.clone();
    proto::AxisLimitTimes { axis, velocity_s, acceleration_s, jerk_s }
}

fn path_deviation(deviation: &PathDeviation, programs: &[String]) -> proto::PathDeviation {
    let place = |(axis, position): &(String, f64)| proto::ColumnPosition { axis: axis.clone(), position: *position };
    proto::PathDeviation {
        largest_mm: deviation.largest_mm,
        line: deviation.source.line,
        file: file_name(deviation.source, programs),
        axes: deviation.axes.iter().map(place).collect(),
    }
}

fn slowdown(at: &Slowdown, programs: &[String]) -> proto::Slowdown {
    let cause = match at.cause {
        SlowdownCause::ExactStop => proto::SlowdownCause::ExactStop,
        SlowdownCause::Corner => proto::SlowdownCause::Corner,
        SlowdownCause::RoundedCorner => proto::SlowdownCause::RoundedCorner,
        SlowdownCause::ShortBlocks => proto::SlowdownCause::ShortBlocks,
        SlowdownCause::Curve => proto::SlowdownCause::Curve,
    };
    let cure = match at.cure {
        SlowdownCure::Tolerance => proto::SlowdownCure::Tolerance,
        SlowdownCure::Arc => proto::SlowdownCure::Arc,
        SlowdownCure::Velocity => proto::SlowdownCure::Velocity,
        SlowdownCure::Acceleration => proto::SlowdownCure::Acceleration,
        SlowdownCure::Jerk => proto::SlowdownCure::Jerk,
    };
    proto::Slowdown {
        line: at.source.line,
        file: file_name(at.source, programs),
        lost_s: at.lost_s,
        times: at.times,
        slowest_mm_per_min: at.slowest_mm_per_min,
        cause: cause.into(),
        cure: cure.into(),
        axis: at.axis.clone(),
    }
}

const fn limit_times(times: &LimitTimes) -> proto::LimitTimes {
    let LimitTimes { feed_s, axis_velocity_s, curvature_s, corners_s, acceleration_s, jerk_s, rest_s } = *times;
    proto::LimitTimes { feed_s, axis_velocity_s, curvature_s, corners_s, acceleration_s, jerk_s, rest_s }
}

#[expect(deprecated, reason = "a former name of a field, which its readers were promised")]
fn axis_summary(axis: &AxisSummary) -> proto::AxisSummary {
    proto::AxisSummary {
        name: axis.axis.clone(),
        axis: axis.axis.clone(),
        rotary: axis.rotary,
        min: axis.min,
        max: axis.max,
        peak_velocity_per_s: axis.peak_velocity_per_s,
        peak_acceleration_per_s2: axis.peak_acceleration_per_s2,
        peak_jerk_per_s3: axis.peak_jerk_per_s3,
        peak_velocity_at: axis.peak_velocity_at.as_ref().map(peak_place),
        peak_acceleration_at: axis.peak_acceleration_at.as_ref().map(peak_place),
        peak_jerk_at: axis.peak_jerk_at.as_ref().map(peak_place),
    }
}

const fn peak_place(place: &PeakPlace) -> proto::PeakPlace {
    let PeakPlace { setpoint_index, time_s, line } = *place;
    proto::PeakPlace { setpoint_index, time_s, line }
}

/// A finding as the contract has it; `programs` are the names of the job's further files.
#[must_use]
pub fn finding_to_proto(finding: &Finding, programs: &[String]) -> proto::Finding {
    let severity = match finding.severity {
        Severity::Info => proto::Severity::Info,
        Severity::Warning => proto::Severity::Warning,
        Severity::Error => proto::Severity::Error,
    };
    proto::Finding {
        code: finding.code.to_string(),
        severity: severity.into(),
        line: finding.span.line,
        column: finding.span.column,
        length: finding.span.length,
        message: finding.message.clone(),
        values: finding.values.iter().map(named_value).collect(),
        suggestions: finding.suggestions.iter().map(suggestion).collect(),
        occurrences: finding.occurrences,
        first: finding.first.as_ref().map(occurrence),
        worst: finding.worst.as_ref().map(occurrence),
        file: file_name(finding.span, programs),
        related: finding.related.iter().map(|place| related_place(place, programs)).collect(),
    }
}

fn related_place(place: &RelatedPlace, programs: &[String]) -> proto::RelatedPlace {
    proto::RelatedPlace {
        message: place.message.to_string(),
        file: file_name(place.span, programs),
        line: place.span.line,
        column: place.span.column,
        length: place.span.length,
        is_call: place.is_call,
    }
}

fn occurrence(occurrence: &Occurrence) -> proto::Occurrence {
    proto::Occurrence { name: occurrence.name.to_string(), number: occurrence.number }
}

fn named_value(value: &NamedValue) -> proto::NamedValue {
    proto::NamedValue { name: value.name.to_string(), value: value.value, unit: value.unit.to_string() }
}

fn suggestion(suggestion: &Suggestion) -> proto::Suggestion {
    proto::Suggestion {
        message: suggestion.message.clone(),
        replacement: suggestion.replacement.clone(),
        value: suggestion.value.as_ref().map(named_value),
    }
}
