//! What thinning did, for people.

use feedwave_contract::proto::{ThinningMethod, ThinningReport, ValidationReport};

use super::super::terminal::{Style, count, counted, number};
use super::{Rows, lines, percent};

/// Runs of dropped blocks listed; the JSON has all.
const LISTED_RUNS: usize = 8;

pub(super) fn text(report: &ValidationReport, style: Style) -> String {
    report.thinning.as_ref().map_or_else(String::new, |thinning| thinning_text(thinning, style) + "\n")
}

fn thinning_text(thinning: &ThinningReport, style: Style) -> String {
    let mut rows = Rows::new(style);
    let method = match thinning.method() {
        ThinningMethod::Fitted => "Thinning, fitted",
        ThinningMethod::Published | ThinningMethod::Unspecified => "Thinning",
    };
    rows.heading(method);
    let groups = counted(thinning.groups, "group");
    rows.row(
        "blocks",
        format!(
            "{} read in {groups}, {} dropped, {} kept",
            count(thinning.blocks_read),
            count(thinning.blocks_dropped),
            count(thinning.blocks_kept)
        ),
    );
    for axis in &thinning.rotary_axes {
        let (before, after) = (count(axis.reversals_before), count(axis.reversals_after));
        rows.row("reversals", format!("{}: {before} before, {after} after", axis.axis));
    }
    if thinning.time_before_s > 0.0 {
        let share = 1.0 - thinning.time_after_s / thinning.time_before_s;
        let (before, after) = (number(thinning.time_before_s, 5), number(thinning.time_after_s, 5));
        // A dropped block's feed that moved on may be a lower one.
        let than = if share < 0.0 { "more" } else { "less" };
        rows.row("time", format!("{before} s before, {after} s after: {} {than}", percent(share.abs())));
    }
    deviation_rows(&mut rows, thinning);
    if thinning.methods.len() > 1 {
        method_table(&mut rows, thinning);
    }
    if thinning.feeds_inherited + thinning.feeds_lost > 0 {
        let (inherited, lost) = (count(thinning.feeds_inherited), count(thinning.feeds_lost));
        rows.row("feeds", format!("{inherited} moved on to the next kept block, {lost} replaced before it"));
    }
    if !thinning.dropped.is_empty() {
        let head = ["dropped, lines", "blocks", "replaced by"];
        let mut table = vec![head.map(str::to_owned).to_vec()];
        table.extend(thinning.dropped.iter().take(LISTED_RUNS).map(|run| {
            vec![lines(run.first_line, run.last_line), count(run.blocks.into()), format!("{}", run.kept_line)]
        }));
        rows.table(&table);
        rows.more(thinning.dropped.len().saturating_sub(LISTED_RUNS) as u64 + thinning.dropped_not_listed);
    }
    rows.text
}

/// How far the kept blocks are from the program.
fn deviation_rows(rows: &mut Rows, thinning: &ThinningReport) {
    if thinning.blocks_dropped > 0 {
        let at = |line: u32| if line == 0 { String::new() } else { format!(" (line {line})") };
        rows.row(
            "deviation",
            format!(
                "at most {} mm{} and {} degrees{}",
                number(thinning.position_deviation_mm, 3),
                at(thinning.position_deviation_line),
                number(thinning.direction_deviation_deg, 3),
                at(thinning.direction_deviation_line)
            ),
        );
    }
    if thinning.direction_bound_deg > 0.0 {
        let bound = number(thinning.direction_bound_deg, 3);
        rows.row(
            "",
            format!("the direction is nowhere more than {bound} degrees from the program, between blocks neither"),
        );
    }
}

/// Both methods side by side.
fn method_table(rows: &mut Rows, thinning: &ThinningReport) {
    let mut head = vec!["method".to_owned(), "kept".to_owned()];
    head.extend(thinning.rotary_axes.iter().map(|axis| format!("reversals of {}", axis.axis)));
    head.extend(["time, s", "position, mm", "direction, deg", "anywhere, deg"].map(str::to_owned));
    let mut table = vec![head];
    let mut programmed = vec!["as programmed".to_owned(), count(thinning.blocks_read)];
    programmed.extend(thinning.rotary_axes.iter().map(|axis| count(axis.reversals_before)));
    programmed.extend([number(thinning.time_before_s, 5), String::new(), String::new(), String::new()]);
    table.push(programmed);
    table.extend(thinning.methods.iter().map(|of| {
        let (name, bound) = match of.method() {
            ThinningMethod::Fitted => ("fitted", number(of.direction_bound_deg, 3)),
            ThinningMethod::Published | ThinningMethod::Unspecified => ("published", "unbounded".to_owned()),
        };
        let mut row = vec![name.to_owned(), count(of.blocks_kept)];
        row.extend(of.rotary_axes.iter().map(|axis| count(axis.reversals_after)));
        row.extend([
            number(of.time_s, 5),
            number(of.position_deviation_mm, 3),
            number(of.direction_deviation_deg, 3),
            bound,
        ]);
        row
    }));
    rows.table(&table);
}
