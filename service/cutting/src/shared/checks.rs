//! Checks of every move, whatever carries it out: axes, travel and time.

use feedwave_motion::{Curve, Element, Machine, MachineKind, travel_exceeded};
use feedwave_program::{Axis, Finding, FindingLog, SourceSpan};

use super::code;

/// Longest time a single block may take, s: one day. A slower one is a slip of a decimal point.
pub(crate) const MAX_BLOCK_DURATION_S: f64 = 86_400.0;

/// Whether the length of an element is in degrees: only rotary axes move.
pub(crate) fn is_rotary_only(element: &Element) -> bool {
    !matches!(element.curve, Curve::FiveAxis(_))
        && Axis::ALL.into_iter().all(|axis| axis.is_rotary() || !element.moves(axis))
}

/// A word of an axis that the machine does not have; one finding for all of its words.
pub(crate) fn missing(axis: Axis, span: SourceSpan, machine: &Machine) -> Finding {
    let letter = axis.letter();
    let finding = Finding::new(code::AXIS_MISSING, span, format!("the machine has no {letter} axis"))
        .suggest("remove the word, or add the axis to the machine profile")
        .everywhere(letter.to_string());
    if machine.kind == MachineKind::Lathe && matches!(axis, Axis::A | Axis::C) {
        let cure = "where A is the angle of a line and C a chamfer, set language.plain_drawing_words of the machine profile to true";
        return finding.suggest(cure);
    }
    finding
}

pub(crate) fn check_travel(element: &Element, machine: &Machine, findings: &mut FindingLog) {
    if let Some(exceeded) = travel_exceeded(element, machine) {
        let letter = exceeded.axis.letter();
        let unit = if exceeded.axis.is_rotary() { "deg" } else { "mm" };
        let message = format!(
            "{letter} would reach {:.3} {unit}, beyond its travel limit {:.3} {unit} (machine coordinates)",
            exceeded.value, exceeded.limit
        );
        let end = if exceeded.value < exceeded.limit { "low" } else { "high" };
        findings.push(
            Finding::new(code::AXIS_TRAVEL, element.source, message)
                .ranked(format!("{letter} {end}"), (exceeded.value - exceeded.limit).abs())
                .with_value("position", exceeded.value, unit)
                .with_value("limit", exceeded.limit, unit)
                .suggest("check the work offset and the programmed coordinate"),
        );
    }
}

pub(crate) fn spline_cusp(span: SourceSpan) -> Finding {
    let message = "the spline has a place without a direction, a cusp or a handle of length 0, or turns back";
    Finding::new(code::PATH_SPLINE_CUSP, span, message)
        .suggest("move its control points apart, or divide it at the cusp")
}

pub(crate) fn too_long(span: SourceSpan, duration_s: f64) -> Finding {
    let message = format!("the block would take {duration_s:.0} s, longer than {MAX_BLOCK_DURATION_S:.0} s");
    Finding::new(code::PLAN_TOO_LONG, span, message)
        .ranked("", duration_s)
        .with_value("duration", duration_s, "s")
        .with_value("limit", MAX_BLOCK_DURATION_S, "s")
        .suggest("check the decimal point of the feed or dwell")
}
