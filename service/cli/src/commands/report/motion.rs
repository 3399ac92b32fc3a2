//! What a report says of the motion: limits of the axes, deviation from the programmed path, and where time is lost.

use feedwave_contract::proto::{
    AxisLimitTimes, PathDeviation, PlanQuality, ProgramSummary, QualityTime, Slowdown, SlowdownCause, SlowdownCure,
    ValidationReport,
};

use super::super::terminal::number;
use super::{Rows, duration};

/// Times below this share of the whole are not worth a word.
const LEAST_SHARE: f64 = 1e-3;

/// Limits by axis, deviation, quality of the plan.
pub(super) fn rows(rows: &mut Rows, summary: &ProgramSummary) {
    let by_axis = axis_limits(&summary.axis_limit_times, summary.duration_s);
    if !by_axis.is_empty() {
        rows.row("axis limits", by_axis);
    }
    if let Some(deviation) = &summary.path_deviation {
        rows.row("deviation", deviation_text(deviation));
    }
    match summary.quality_times.as_slice() {
        [] | [_] => rows.row("plan", quality(summary.plan_quality())),
        times => rows.row("plan", times.iter().map(quality_time).collect::<Vec<_>>().join(", ")),
    }
}

const fn quality(quality: PlanQuality) -> &'static str {
    match quality {
        PlanQuality::LeastTime => "close to the least time",
        PlanQuality::Fast | PlanQuality::Unspecified => "fast",
    }
}

fn quality_time(time: &QualityTime) -> String {
    format!("{} {}", quality(time.plan_quality()), duration(time.duration_s))
}

/// For how long each limit of each axis governs, the longest first, as shares of the whole.
fn axis_limits(axes: &[AxisLimitTimes], duration_s: f64) -> String {
    let of = |axis: &AxisLimitTimes| {
        [("velocity", axis.velocity_s), ("acceleration", axis.acceleration_s), ("jerk", axis.jerk_s)]
            .map(|(name, time_s)| (format!("{name} of {}", axis.axis), time_s))
    };
    let mut times: Vec<_> = axes.iter().flat_map(of).filter(|(_, time_s)| *time_s > LEAST_SHARE * duration_s).collect();
    times.sort_by(|a, b| b.1.total_cmp(&a.1));
    let shown = times.iter().map(|(name, time_s)| format!("{name} {} %", number(100.0 * time_s / duration_s, 3)));
    shown.collect::<Vec<_>>().join(", ")
}

fn deviation_text(deviation: &PathDeviation) -> String {
    let PathDeviation { largest_mm, line, file, axes } = deviation;
    let axes: Vec<_> = axes.iter().map(|place| format!("{} {}", place.axis, number(place.position, 7))).collect();
    format!(
        "at most {} mm from the programmed path, {} at {}",
        number(*largest_mm, 4),
        place(*line, file),
        axes.join(" ")
    )
}

fn place(line: u32, file: &str) -> String {
    if file.is_empty() { format!("line {line}") } else { format!("line {line} of {file}") }
}

/// Time lost to slowdowns, and the worst lines with their cures.
pub(super) fn slowdown_table(rows: &mut Rows, summary: &ProgramSummary) {
    let is_some = summary.slowdown_time_s > LEAST_SHARE * summary.duration_s;
    if summary.errors > 0 || summary.slowdowns.is_empty() || !is_some {
        return;
    }
    let share = number(100.0 * summary.slowdown_time_s / summary.duration_s, 3);
    rows.row("slowdowns", format!("{} lost below the feed, {share} % of the time", duration(summary.slowdown_time_s)));
    let head = ["worst lines", "lost", "times", "slowest, mm/min", "because of", "would save time"];
    let mut table = vec![head.map(str::to_owned).to_vec()];
    table.extend(summary.slowdowns.iter().map(row));
    rows.table(&table);
}

/// What would save time, a line for each of the worst places; nothing where little is lost.
pub(in crate::commands) fn suggestions_of_motion(report: &ValidationReport) -> Vec<String> {
    let Some(summary) = &report.summary else { return Vec::new() };
    let worth = summary.slowdowns.iter().filter(|at| at.lost_s > LEAST_SHARE * summary.duration_s && at.cure != 0);
    let line = |at: &Slowdown| {
        let (place, lost, slowest) = (place(at.line, &at.file), number(at.lost_s, 3), number(at.slowest_mm_per_min, 4));
        format!("{place}: {}, {lost} s lost at {slowest} mm/min ({})", cure(at), cause(at))
    };
    worth.map(line).collect()
}

fn cause(at: &Slowdown) -> &'static str {
    match at.cause() {
        SlowdownCause::ExactStop => "exact stop",
        SlowdownCause::RoundedCorner => "rounded corner",
        SlowdownCause::ShortBlocks => "short blocks",
        SlowdownCause::Curve => "curve",
        SlowdownCause::Corner | SlowdownCause::Unspecified => "corner",
    }
}

fn row(at: &Slowdown) -> Vec<String> {
    vec![
        place(at.line, &at.file),
        format!("{} s", number(at.lost_s, 3)),
        at.times.to_string(),
        number(at.slowest_mm_per_min, 4),
        cause(at).to_owned(),
        cure(at),
    ]
}

fn cure(at: &Slowdown) -> String {
    let axis = &at.axis;
    let tolerates = matches!(at.cause(), SlowdownCause::RoundedCorner | SlowdownCause::ShortBlocks);
    match at.cure() {
        SlowdownCure::Tolerance if tolerates => "a larger tolerance, G64 P".to_owned(),
        SlowdownCure::Tolerance => "a tolerance, G64 P".to_owned(),
        SlowdownCure::Arc => "an arc instead of chords".to_owned(),
        SlowdownCure::Velocity => format!("more velocity of {axis}"),
        SlowdownCure::Acceleration => format!("more acceleration of {axis}"),
        SlowdownCure::Jerk => format!("more jerk of {axis}"),
        SlowdownCure::Unspecified => String::new(),
    }
}
