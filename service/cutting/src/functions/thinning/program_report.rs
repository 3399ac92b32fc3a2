//! What thinning did to a program, with the lines and the times.

use feedwave_program::{Finding, FindingLog, SourceSpan};

use super::code;
use super::{DeviationTrace, ThinningMethod, ThinningReport, ThinningSettings};

/// Blocks dropped one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DroppedRun {
    /// Program line of the first one.
    pub first_line: u32,
    /// Program line of the last one.
    pub last_line: u32,
    /// How many.
    pub blocks: u32,
    /// Program line of the kept block that takes their place.
    pub kept_line: u32,
}

/// What one method makes of a program.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MethodFigures {
    /// The method.
    pub method: ThinningMethod,
    /// Counts, deviations and reversals.
    pub figures: ThinningReport,
    /// Time of the blocks that it leaves, planned by themselves from rest to rest, s.
    pub time_s: f64,
}

/// Thinning over a whole program (docs/functions/five-axis-thinning.md, "Report").
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProgramThinning {
    /// The method by which the program is run.
    pub method: ThinningMethod,
    /// Counts, deviations and reversals.
    pub figures: ThinningReport,
    /// Both methods side by side, in the order of [`ThinningMethod::ALL`]; the published and the fitted one.
    pub methods: Vec<MethodFigures>,
    /// Letters of the two rotary axes, in the order of the figures: next to the work first.
    pub rotary_axes: Vec<char>,
    /// Runs of dropped blocks, in order; the first ones where there are very many.
    pub dropped: Vec<DroppedRun>,
    /// Runs that are not listed.
    pub dropped_not_listed: u64,
    /// Time of the blocks between on and off as programmed, planned by themselves from rest to rest, s.
    pub time_before_s: f64,
    /// The same time of the blocks that are left, s.
    pub time_after_s: f64,
    /// Deviations of the dropped blocks along the program; no part of the report as a document.
    pub deviations: DeviationTrace,
}

/// Findings of thinning at the end of a program.
pub(crate) fn report_findings(report: &ThinningReport, settings: &ThinningSettings, findings: &mut FindingLog) {
    let rotary = &report.rotary;
    let place = |line| SourceSpan { line, column: 1, ..SourceSpan::default() };
    if rotary.off_blocks > 0 {
        let (blocks, largest) = (rotary.off_blocks, rotary.largest_deviation_deg);
        let message = format!(
            "{blocks} dropped blocks turn a rotary axis by more than the angle tolerance from what is interpolated, \
             {largest:.3} degrees here, while their tool direction is within it of the kept block before"
        );
        findings.push(
            Finding::new(code::THIN_ROTARY, place(rotary.largest_deviation_line), message)
                .with_value("blocks", blocks as f64, "")
                .with_value("deviation", largest, "deg")
                .with_value("angle_tolerance", settings.angle_tolerance_deg, "deg")
                .suggest("switch thinning off where the axis has to turn"),
        );
    }
    let deviation_deg = report.direction_deviation_deg;
    if settings.method == ThinningMethod::Published && deviation_deg > settings.angle_tolerance_deg {
        let message = format!(
            "the interpolated direction is up to {deviation_deg:.3} degrees from that of a dropped block: the angle \
             tolerance of {} degrees compares with the last kept block only",
            settings.angle_tolerance_deg
        );
        findings.push(
            Finding::new(code::THIN_DIRECTION, place(report.direction_deviation_line), message)
                .with_value("deviation", deviation_deg, "deg")
                .with_value("angle_tolerance", settings.angle_tolerance_deg, "deg")
                .suggest_value(
                    "set a tolerance on the interpolated direction",
                    None,
                    "interpolated_direction_tolerance",
                    settings.angle_tolerance_deg,
                    "deg",
                )
                .suggest("or choose the fitted method, which bounds the direction everywhere"),
        );
    }
    if report.feeds_lost > 0 {
        let lost = report.feeds_lost;
        let message =
            format!("{lost} feeds of dropped blocks are never run: another feed follows before the next kept block");
        findings.push(
            Finding::new(code::THIN_FEED, place(1), message).with_value("feeds_lost", lost as f64, "").with_value(
                "feeds_inherited",
                report.feeds_inherited as f64,
                "",
            ),
        );
    }
}
