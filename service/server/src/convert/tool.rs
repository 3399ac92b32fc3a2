//! Tools.

use crate::convert::{check_display_name, enumeration};
use crate::error::Violations;
use crate::proto;

/// Highest number of a T word.
const MAX_TOOL_NUMBER: u32 = 9_999;

/// Checks what a client says about a tool.
#[must_use]
pub fn check_tool(tool: &proto::Tool) -> Violations {
    let mut violations = Violations::default();
    if !(1..=MAX_TOOL_NUMBER).contains(&tool.number) {
        violations.add("number", format!("must be 1 to {MAX_TOOL_NUMBER}, is {}", tool.number));
    }
    check_display_name(&mut violations, "display_name", &tool.display_name);
    enumeration::<proto::ToolKind>(&mut violations, "kind", tool.kind);
    let positive = [
        ("max_rev_per_min", tool.max_rev_per_min),
        ("nose_radius_mm", tool.nose_radius_mm),
        ("diameter_mm", tool.diameter_mm),
        ("length_mm", tool.length_mm),
    ];
    for (field, value) in positive {
        if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
            violations.add(field, format!("must be a positive finite number, is {value}"));
        }
    }
    if tool.edge_count == Some(0) {
        violations.add("edge_count", "must be at least 1");
    }
    violations
}

/// What validation needs to know of a tool.
#[must_use]
pub fn tool_for_pipeline(tool: &proto::Tool) -> feedwave_cutting::Tool {
    feedwave_cutting::Tool {
        number: tool.number,
        name: tool.display_name.clone(),
        max_rev_per_min: tool.max_rev_per_min,
        length_mm: tool.length_mm,
        geometry: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bad_field_is_named() {
        let tool = proto::Tool {
            number: 0,
            kind: 77,
            display_name: "x".repeat(201),
            max_rev_per_min: Some(-1.0),
            nose_radius_mm: Some(f64::NAN),
            edge_count: Some(0),
            length_mm: Some(0.0),
            ..Default::default()
        };
        let violations = check_tool(&tool);
        let fields: Vec<_> = violations.as_slice().iter().map(|violation| violation.field.as_str()).collect();
        assert_eq!(
            fields,
            ["number", "display_name", "kind", "max_rev_per_min", "nose_radius_mm", "length_mm", "edge_count"]
        );
    }

    #[test]
    fn a_sound_tool_passes() {
        let tool =
            proto::Tool { number: 1, max_rev_per_min: Some(4_000.0), length_mm: Some(120.5), ..Default::default() };
        assert!(check_tool(&tool).is_empty());
        assert_eq!(tool_for_pipeline(&tool).length_mm, Some(120.5));
        assert_eq!(tool_for_pipeline(&tool).max_rev_per_min, Some(4_000.0));
    }
}
