//! What the stage has to say.

use super::geometry::{Point, length};
use super::window::{Cut, Gouge, Gouges};
use crate::code;
use crate::{Finding, FindingLog, Severity, SourceSpan};

/// An overcut below this, mm, is rounding.
const LEAST_OVERCUT_MM: f64 = 1e-6;

/// A length in a message: nanometres at most, without trailing zeros.
fn shown(value_mm: f64) -> f64 {
    (value_mm * 1e6).round() / 1e6
}

/// Unless the program ends there because of an error: nobody knows how it would go on.
#[cold]
pub(super) fn unfinished(span: SourceSpan, on: SourceSpan, findings: &mut FindingLog) {
    let is_there = |found: &Finding| (found.span.program, found.span.line) == (span.program, span.line);
    if findings.findings().iter().any(|found| found.severity == Severity::Error && is_there(found)) {
        return;
    }
    findings.push_with(code::COMP_UNFINISHED, |code| {
        let message = format!("the program ends with the radius compensation on, since line {}", on.line);
        Finding::new(code, span, message)
            .with_value("on_line", f64::from(on.line), "")
            .suggest("leave the contour with G40 and a straight move before the end")
    });
}

#[cold]
pub(super) fn not_permitted(span: SourceSpan, on: SourceSpan, is_beside: bool, what: &str, findings: &mut FindingLog) {
    findings.push_with(code::COMP_BLOCK, |code| {
        if is_beside {
            let message =
                format!("{what} while the tool still stands beside the contour, behind the G40 of line {}", on.line);
            return Finding::new(code, span, message)
                .with_value("off_line", f64::from(on.line), "")
                .suggest(crate::compensation::LEAVE_FIRST);
        }
        let message = format!("{what} with the radius compensation on, since line {}", on.line);
        Finding::new(code, span, message)
            .with_value("on_line", f64::from(on.line), "")
            .suggest("leave the contour with G40 and a straight move first")
    });
}

#[cold]
pub(super) fn entry_short(span: SourceSpan, reach_mm: f64, radius_mm: f64, findings: &mut FindingLog) {
    findings.push_with(code::COMP_ENTRY, |code| {
        let message = format!(
            "the first move with the radius compensation goes {} mm in the plane, but must go further than the radius, {} mm",
            shown(reach_mm),
            shown(radius_mm)
        );
        Finding::new(code, span, message)
            .with_value("length", reach_mm, "mm")
            .with_value("radius", radius_mm, "mm")
            .suggest("start further away, or switch the compensation on in the move to the contour")
    });
}

#[cold]
pub(super) fn entry_arc(span: SourceSpan, findings: &mut FindingLog) {
    findings.push_with(code::COMP_ENTRY, |code| {
        let message = "the first move with the radius compensation is an arc, but must be straight";
        Finding::new(code, span, message).suggest("put a straight move, G0 or G1, before the arc")
    });
}

#[cold]
pub(super) fn exit_curve(span: SourceSpan, off: SourceSpan, findings: &mut FindingLog) {
    findings.push_with(code::COMP_EXIT, |code| {
        let message = format!("the move away from the contour, behind the G40 of line {}, must be straight", off.line);
        Finding::new(code, span, message)
            .with_value("off_line", f64::from(off.line), "")
            .suggest("leave the contour with G0 or G1, and go on with the curve behind it")
    });
}

#[cold]
pub(super) fn exit_elsewhere(
    span: SourceSpan,
    off: SourceSpan,
    goes: bool,
    displacement: Point,
    findings: &mut FindingLog,
) {
    let beside_mm = length(displacement);
    findings.push_with(code::COMP_EXIT_ASIDE, |code| {
        let what = if goes { "also moves the tool" } else { "leaves the tool" };
        let message = format!(
            "this move, behind the G40 of line {}, names no place in the plane, and {what} {} mm {} the programmed point",
            off.line,
            shown(beside_mm),
            if goes { "sideways to" } else { "beside" },
        );
        Finding::new(code, span, message)
            .with_value("distance", beside_mm, "mm")
            .with_value("off_line", f64::from(off.line), "")
            .suggest("move in the plane with the G40, away from the part")
    });
}

#[cold]
pub(super) fn idle_blocks(span: SourceSpan, before: SourceSpan, most: u32, findings: &mut FindingLog) {
    findings.push_with(code::COMP_IDLE, |code| {
        let message = format!(
            "more than {most} blocks without motion in the plane follow line {}: the corner behind it is not known",
            before.line
        );
        Finding::new(code, span, message)
            .with_value("most", f64::from(most), "")
            .suggest("leave the contour with G40 first, or move them to another place")
    });
}

#[cold]
pub(super) fn arc_too_small(span: SourceSpan, arc_mm: f64, radius_mm: f64, findings: &mut FindingLog) {
    findings.push_with(code::COMP_ARC, |code| {
        let message = format!(
            "the tool, radius {} mm, is too large for the inside of this arc, radius {} mm",
            shown(radius_mm),
            shown(arc_mm)
        );
        Finding::new(code, span, message)
            .with_value("arc_radius", arc_mm, "mm")
            .with_value("radius", radius_mm, "mm")
            .suggest("use a tool with a radius smaller than that of the arc")
            .suggest(
                "where the program has the path of the tool's centre and the offset holds its wear only, state radius_wear_mm of the \
                 job's tool as minus its radius",
            )
    });
}

#[cold]
pub(super) fn no_crossing(span: SourceSpan, before: SourceSpan, radius_mm: f64, findings: &mut FindingLog) {
    findings.push_with(code::COMP_CORNER, |code| {
        let message = format!(
            "the tool, radius {} mm, does not fit into the corner between line {} and this block",
            shown(radius_mm),
            before.line
        );
        Finding::new(code, span, message)
            .with_value("radius", radius_mm, "mm")
            .with_value("line_before", f64::from(before.line), "")
            .suggest("use a smaller tool, or round the corner")
    });
}

#[cold]
pub(super) fn backwards(span: SourceSpan, radius_mm: f64, findings: &mut FindingLog) {
    findings.push_with(code::COMP_BACKWARDS, |code| {
        let message = format!(
            "the tool, radius {} mm, would pass this block backwards: it cannot reach it without cutting into its neighbours",
            shown(radius_mm)
        );
        Finding::new(code, span, message)
            .with_value("radius", radius_mm, "mm")
            .suggest("use a smaller tool")
            .suggest("take the block out of the contour that this tool cuts")
    });
}

pub(super) fn gouges(span: SourceSpan, gouges: Gouges, findings: &mut FindingLog) {
    if gouges != Gouges::default() {
        gouges.into_iter().flatten().for_each(|gouge| report_gouge(span, gouge, findings));
    }
}

#[cold]
fn report_gouge(span: SourceSpan, Gouge { depth_mm, line, on }: Gouge, findings: &mut FindingLog) {
    let code = if on == Cut::Contour { code::COMP_GOUGE } else { code::COMP_GOUGE_LINK };
    findings.push_with(code, |code| {
        let depth = shown(depth_mm);
        let (message, cure) = match on {
            Cut::Contour => (
                format!("on its path, the tool cuts {depth} mm into the contour, here and at line {line}"),
                "use a smaller tool, or switch the compensation off between both",
            ),
            Cut::Link => (
                format!(
                    "on its entry to the contour or exit from it, the tool cuts {depth} mm into the contour, here and at line {line}"
                ),
                "start and end beside the contour, at right angles to it",
            ),
            Cut::Lead => (
                format!(
                    "the tool passes {depth} mm over a block that leads to the contour or away from it, here and at line {line}"
                ),
                "nothing needs to be done where that block is no wall of the part; where it is one, use a smaller tool",
            ),
        };
        Finding::new(code, span, message)
            .with_value("depth", depth_mm, "mm")
            .with_value("other_line", f64::from(line), "")
            .suggest(cure)
            .ranked("", depth_mm)
    });
}

/// Corners that count as none, at the place that switched the compensation on: a contour of short lines has many.
pub(super) fn overcut(on: SourceSpan, span: SourceSpan, overcut_mm: f64, findings: &mut FindingLog) {
    if overcut_mm > LEAST_OVERCUT_MM {
        report_overcut(on, span, overcut_mm, findings);
    }
}

#[cold]
fn report_overcut(on: SourceSpan, span: SourceSpan, overcut_mm: f64, findings: &mut FindingLog) {
    findings.push_with(code::COMP_STRAIGHT, |code| {
        let message = format!(
            "a corner of less than 0.05 rad counts as none, so that the tool cuts up to {} mm into the contour at line {}",
            shown(overcut_mm),
            span.line
        );
        Finding::new(code, on, message)
            .with_value("depth", overcut_mm, "mm")
            .ranked("", overcut_mm)
            .at("line", u64::from(span.line))
            .suggest("let arcs and lines meet without a corner, or write them with more decimals")
    });
}
