//! A validation report for people: findings, vibrating sections, summary. The same text whether the report came from
//! this machine or from a service.

mod oscillation;
mod section;
mod thinning;
mod thread;

pub(super) use thread::text as thread_text;

use feedwave_contract::proto::{LimitTimes, PeakPlace, ProgramSummary, ValidationReport};

use super::CliError;
use super::findings;
use super::source::Source;
use super::terminal::{Style, count, counted, number};

/// The whole report.
pub(super) fn text(report: &ValidationReport, source: &mut Source, style: Style) -> Result<String, CliError> {
    let mut text = findings_text(report, source, style)?;
    for (number, section) in (1..).zip(&report.sections) {
        text.push_str(&section::text(number, section, style));
        text.push('\n');
    }
    for (number, section) in (1..).zip(&report.threads) {
        text.push_str(&thread::section_text(number, section, style));
        text.push('\n');
    }
    for (number, section) in (1..).zip(&report.oscillations) {
        text.push_str(&oscillation::section_text(number, section, style));
        text.push('\n');
    }
    if let Some(thinning) = &report.thinning {
        text.push_str(&thinning::text(thinning, style));
        text.push('\n');
    }
    let summary = report.summary.as_ref();
    if let Some(summary) = summary {
        let listed = [
            (summary.section_count, report.sections.len(), "vibrating section"),
            (summary.thread_count, report.threads.len(), "thread"),
            (summary.oscillation_count, report.oscillations.len(), "oscillation"),
        ];
        for (count, listed, noun) in listed {
            let not_listed = count.saturating_sub(listed as u64);
            if not_listed > 0 {
                text.push_str(&format!("{} more not listed.\n\n", counted(not_listed, noun)));
            }
        }
        text.push_str(&summary_text(summary, style));
    }
    text.push_str(&verdict(report, &source.name, style));
    text.push('\n');
    Ok(text)
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
        let period_ms = f64::from(summary.interpolation_period_us) / 1e3;
        rows.row("setpoints", format!("{} every {} ms", count(summary.setpoint_count), number(period_ms, 6)));
    }
    if !summary.axes.is_empty() {
        let linear = ["axis", "from, mm", "to, mm", "velocity, mm/min", "acceleration, m/s²", "jerk, m/s³"];
        let rotary = ["axis", "from, °", "to, °", "velocity, °/min", "acceleration, °/s²", "jerk, °/s³"];
        for (is_rotary, head, per) in [(false, linear, 1e3), (true, rotary, 1.0)] {
            let mut table = vec![head.map(str::to_owned).to_vec()];
            table.extend(summary.axes.iter().filter(|axis| axis.rotary == is_rotary).map(|axis| {
                vec![
                    axis.name.clone(),
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
        for axis in &summary.axes {
            let places = [&axis.peak_velocity_at, &axis.peak_acceleration_at, &axis.peak_jerk_at];
            let names = ["velocity", "acceleration", "jerk"];
            let place = |(name, place): (&str, &Option<PeakPlace>)| {
                let place = place.as_ref()?;
                Some(format!("{name} at {:.6} s in line {}", place.time_s, place.line))
            };
            let places: Vec<_> = names.into_iter().zip(places).filter_map(place).collect();
            if !places.is_empty() {
                rows.row(&format!("peaks of {}", axis.name), places.join(", "));
            }
        }
    }
    rows.text.push('\n');
    rows.text
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

fn duration(seconds: f64) -> String {
    if seconds < 60.0 {
        return format!("{} s", number(seconds, 4));
    }
    let whole = seconds as u64;
    let (hours, minutes, rest) = (whole / 3_600, whole % 3_600 / 60, whole % 60);
    if hours > 0 { format!("{hours} h {minutes:02} min") } else { format!("{minutes} min {rest:02} s") }
}
