//! A validation report for people: findings, a part for each machining function, summary. The same text whether the report
//! came from this machine or from a service.

mod motion;
mod offsets;
mod path_vibration;
mod thinning;
mod thread;
mod tool_oscillation;

pub(super) use motion::suggestions_of_motion;
pub(super) use thread::text as thread_text;

use feedwave_contract::proto::{AxisSummary, LimitTimes, PeakPlace, ProgramSummary, ValidationReport};

use super::CliError;
use super::findings;
use super::source::Source;
use super::terminal::{Style, count, counted, number};

/// What is said of each machining function, in the order of the report.
const FUNCTIONS: [fn(&ValidationReport, Style) -> String; 4] =
    [path_vibration::text, thread::sections_text, tool_oscillation::text, thinning::text];

/// The whole report.
pub(super) fn text(report: &ValidationReport, source: &mut Source, style: Style) -> Result<String, CliError> {
    let mut text = findings_text(report, source, style)?;
    text.extend(FUNCTIONS.map(|of_function| of_function(report, style)));
    text.push_str(&offsets::text(report, style));
    if let Some(summary) = &report.summary {
        text.push_str(&summary_text(summary, style));
    }
    text.push_str(&verdict(report, &source.name, style));
    text.push('\n');
    Ok(text)
}

/// Sections of a function one after the other, of `count` in all.
fn sections<S>(listed: &[S], count: Option<u64>, noun: &str, text: impl Fn(usize, &S) -> String) -> String {
    let mut all: String = (1..).zip(listed).map(|(number, section)| text(number, section) + "\n").collect();
    let not_listed = count.unwrap_or_default().saturating_sub(listed.len() as u64);
    if not_listed > 0 {
        all.push_str(&format!("{} more not listed.\n\n", counted(not_listed, noun)));
    }
    all
}

/// The findings alone.
pub(super) fn findings_text(report: &ValidationReport, source: &mut Source, style: Style) -> Result<String, CliError> {
    let mut text = findings::text(&report.findings, source, style)?;
    let not_listed = report.summary.as_ref().map_or(0, |summary| summary.findings_not_listed);
    if not_listed > 0 {
        text.push_str(&format!("{} more not listed.\n\n", counted(not_listed, "finding")));
    }
    Ok(text)
}

/// One line: accepted or not, and how much was found.
pub(super) fn verdict(report: &ValidationReport, name: &str, style: Style) -> String {
    let summary = report.summary.clone().unwrap_or_default();
    let counts = [(summary.errors, "error"), (summary.warnings, "warning"), (summary.infos, "note")];
    let counts: Vec<_> =
        counts.into_iter().filter(|(count, _)| *count > 0).map(|(count, noun)| counted(count, noun)).collect();
    let found = if counts.is_empty() { "nothing found".to_owned() } else { counts.join(", ") };
    let verdict = match (summary.errors, summary.warnings) {
        (0, 0) => style.good("accepted"),
        (0, _) => style.warning("accepted"),
        _ => style.bad("rejected"),
    };
    format!("{}: {verdict}, {found}", style.bold(name))
}

/// Rows of a name and a text, aligned.
struct Rows {
    text: String,
    style: Style,
}

impl Rows {
    const fn new(style: Style) -> Self {
        Self { text: String::new(), style }
    }

    fn heading(&mut self, heading: &str) {
        self.text.push_str(&self.style.bold(heading));
        self.text.push('\n');
    }

    fn row(&mut self, name: &str, value: impl AsRef<str>) {
        self.text.push_str(&format!("  {} {}\n", self.style.faint(&format!("{name:<13}")), value.as_ref()));
    }

    /// Says how many are not listed, if any.
    fn more(&mut self, not_listed: u64) {
        if not_listed > 0 {
            self.row("", format!("and {} more", count(not_listed)));
        }
    }

    /// A row of a table: the first cell to the left, the others to the right.
    fn cells(&mut self, cells: &[String], widths: &[usize]) {
        let mut line = String::from("  ");
        for (position, (cell, &width)) in cells.iter().zip(widths).enumerate() {
            if position == 0 {
                line.push_str(&format!("{cell:<width$}"));
            } else {
                line.push_str(&format!("  {cell:>width$}"));
            }
        }
        self.text.push_str(line.trim_end());
        self.text.push('\n');
    }

    /// A table: the first row is its head.
    fn table(&mut self, rows: &[Vec<String>]) {
        let columns = rows.first().map_or(0, Vec::len);
        let width = |column: usize| {
            rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..columns).map(width).collect();
        for row in rows {
            self.cells(row, &widths);
        }
    }
}

/// A share of 1 as per cent.
fn percent(share: f64) -> String {
    format!("{} %", number(share * 100.0, 3))
}

/// Lines of a program.
fn lines(first: u32, last: u32) -> String {
    if first == last { format!("{first}") } else { format!("{first}–{last}") }
}

fn summary_text(summary: &ProgramSummary, style: Style) -> String {
    let mut rows = Rows::new(style);
    rows.heading("Program");
    let tools: Vec<_> = summary.tools.iter().map(u32::to_string).collect();
    let tools = if tools.is_empty() { String::new() } else { format!(", tools {}", tools.join(" ")) };
    rows.row(
        "size",
        format!(
            "{}, {}, {} ({} cutting){tools}",
            counted(summary.program_bytes, "byte"),
            counted(summary.lines, "line"),
            counted(summary.moves, "move"),
            count(summary.cutting_moves),
        ),
    );
    rows.row(
        "path",
        format!("{} mm, of it {} mm cutting", number(summary.path_length_mm, 6), number(summary.cutting_length_mm, 6)),
    );
    if summary.thread_count > 0 {
        let cuts = counted(summary.thread_passes, "threading cut");
        rows.row("threads", format!("{}, {cuts}", counted(summary.thread_count, "thread")));
    }
    if let Some(speed) = &summary.spindle_speed {
        let (low, high) = (number(speed.min_rev_per_min, 5), number(speed.max_rev_per_min, 5));
        let range = if low == high { low } else { format!("{low} to {high}") };
        rows.row("spindle", format!("{range} rev/min while cutting"));
    }
    if summary.errors == 0 {
        rows.row(
            "time",
            format!(
                "{}: cutting {}, rapid {}, at rest {}",
                exact_duration(summary.duration_s),
                duration(summary.cutting_time_s),
                duration(summary.rapid_time_s),
                duration(summary.rest_time_s)
            ),
        );
        if let Some(times) = &summary.limit_times {
            rows.row("governed by", governed_by(times, summary.duration_s));
        }
        motion::rows(&mut rows, summary);
        let period_ms = f64::from(summary.interpolation_period_us) / 1e3;
        rows.row("setpoints", format!("{} every {} ms", count(summary.setpoint_count), number(period_ms, 6)));
    }
    axis_rows(&mut rows, &summary.axes);
    motion::slowdown_table(&mut rows, summary);
    rows.text.push('\n');
    rows.text
}

/// Extents and peaks of the axes.
fn axis_rows(rows: &mut Rows, axes: &[AxisSummary]) {
    let linear = ["axis", "from, mm", "to, mm", "velocity, mm/min", "acceleration, m/s²", "jerk, m/s³"];
    let rotary = ["axis", "from, °", "to, °", "velocity, °/min", "acceleration, °/s²", "jerk, °/s³"];
    for (is_rotary, head, per) in [(false, linear, 1e3), (true, rotary, 1.0)] {
        let mut table = vec![head.map(str::to_owned).to_vec()];
        table.extend(axes.iter().filter(|axis| axis.rotary == is_rotary).map(|axis| {
            vec![
                axis.axis.clone(),
                number(axis.min, 7),
                number(axis.max, 7),
                number(axis.peak_velocity_per_s * 60.0, 5),
                number(axis.peak_acceleration_per_s2 / per, 4),
                number(axis.peak_jerk_per_s3 / per, 4),
            ]
        }));
        if table.len() > 1 {
            rows.table(&table);
        }
    }
    for axis in axes {
        let places = [&axis.peak_velocity_at, &axis.peak_acceleration_at, &axis.peak_jerk_at];
        let names = ["velocity", "acceleration", "jerk"];
        let place = |(name, place): (&str, &Option<PeakPlace>)| {
            let place = place.as_ref()?;
            Some(format!("{name} at {:.6} s in line {}", place.time_s, place.line))
        };
        let places: Vec<_> = names.into_iter().zip(places).filter_map(place).collect();
        if !places.is_empty() {
            rows.row(&format!("peaks of {}", axis.axis), places.join(", "));
        }
    }
}

/// What limits the motion, the longest time first, as shares of the whole.
fn governed_by(times: &LimitTimes, duration_s: f64) -> String {
    let mut shares = [
        ("programmed feed", times.feed_s),
        ("axis velocity", times.axis_velocity_s),
        ("curvature", times.curvature_s),
        ("corners and neighbouring blocks", times.corners_s),
        ("acceleration", times.acceleration_s),
        ("jerk", times.jerk_s),
        ("rest", times.rest_s),
    ];
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    // A moment of rounding is not worth a word.
    let shown = shares.iter().filter(|(_, time_s)| *time_s > 1e-6 * duration_s);
    let shown = shown.map(|(name, time_s)| format!("{name} {} %", number(100.0 * time_s / duration_s, 3)));
    shown.collect::<Vec<_>>().join(", ")
}

/// A time to the microsecond, with the hours and minutes of a long one.
fn exact_duration(seconds: f64) -> String {
    let exact = format!("{seconds:.6} s");
    if seconds < 60.0 { exact } else { format!("{exact} ({})", duration(seconds)) }
}

pub(super) fn duration(seconds: f64) -> String {
    if seconds < 60.0 {
        return format!("{} s", number(seconds, 4));
    }
    let whole = seconds as u64;
    let (hours, minutes, rest) = (whole / 3_600, whole % 3_600 / 60, whole % 60);
    if hours > 0 { format!("{hours} h {minutes:02} min") } else { format!("{minutes} min {rest:02} s") }
}
