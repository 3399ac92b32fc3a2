//! Tools.

use super::lobes::check_dynamics;
use super::oscillation::geometry_from_proto;
use crate::convert::{check_display_name, enumeration};
use crate::proto;
use crate::violations::Violations;

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
        ("max_spindle_rev_per_min", tool.max_spindle_rev_per_min),
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
    for (field, error) in tool.geometry.iter().flat_map(|geometry| geometry_from_proto(geometry).problems()) {
        violations.add(format!("geometry.{field}"), error.to_string());
    }
    if let Some(dynamics) = &tool.dynamics {
        check_dynamics(&mut violations, "dynamics", dynamics);
    }
    violations
}

/// What validation needs to know of a tool.
#[must_use]
pub fn tool_for_pipeline(tool: &proto::Tool) -> feedwave_cutting::Tool {
    feedwave_cutting::Tool {
        number: tool.number,
        name: tool.display_name.clone(),
        max_rev_per_min: tool.max_spindle_rev_per_min,
        length_mm: tool.length_mm,
        geometry: tool.geometry.as_ref().map(geometry_from_proto),
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
            max_spindle_rev_per_min: Some(-1.0),
            nose_radius_mm: Some(f64::NAN),
            edge_count: Some(0),
            length_mm: Some(0.0),
            ..Default::default()
        };
        let violations = check_tool(&tool);
        let fields: Vec<_> = violations.as_slice().iter().map(|violation| violation.field.as_str()).collect();
        assert_eq!(
            fields,
            ["number", "display_name", "kind", "max_spindle_rev_per_min", "nose_radius_mm", "length_mm", "edge_count"]
        );
    }

    #[test]
    fn cutting_edges_are_checked_one_by_one() {
        let edge = |angle_deg, axial_set_over_mm| proto::CuttingEdge {
            angle_deg,
            radial_set_over_mm: 0.1,
            axial_set_over_mm,
            finishing: angle_deg == 0.0,
        };
        let mut geometry = proto::ToolGeometry {
            edges: vec![edge(0.0, 0.02), edge(90.0, 0.0), edge(200.0, -0.1)],
            radius_mm: 60.0,
            radial_edge_length_mm: 1.5,
            axial_edge_height_mm: 5.0,
            end_relief_deg: 0.5,
        };
        let tool = |geometry: &proto::ToolGeometry| proto::Tool {
            number: 4,
            geometry: Some(geometry.clone()),
            ..Default::default()
        };
        assert!(check_tool(&tool(&geometry)).is_empty());
        let converted = tool_for_pipeline(&tool(&geometry));
        let converted = converted.geometry.unwrap();
        assert_eq!((converted.radius_mm, converted.radial_edge_length_mm), (60.0, 1.5));
        assert_eq!((converted.axial_edge_height_mm, converted.end_relief_deg), (5.0, 0.5));
        let edges: Vec<_> = converted.edges.iter().map(|edge| (edge.angle_deg, edge.axial_set_over_mm)).collect();
        assert_eq!(edges, [(0.0, 0.02), (90.0, 0.0), (200.0, -0.1)]);
        assert!(converted.edges[0].finishing && !converted.edges[1].finishing);
        assert!(converted.edges.iter().all(|edge| edge.radial_set_over_mm == 0.1));

        geometry.edges[1].angle_deg = 0.0;
        geometry.edges[2].axial_set_over_mm = f64::NAN;
        geometry.axial_edge_height_mm = -1.0;
        geometry.end_relief_deg = 50.0;
        let violations = check_tool(&tool(&geometry));
        let fields: Vec<_> = violations.as_slice().iter().map(|violation| violation.field.as_str()).collect();
        for field in ["axial_edge_height_mm", "end_relief_deg", "edges[1].angle_deg", "edges[2].axial_set_over_mm"] {
            assert!(fields.contains(&format!("geometry.{field}").as_str()), "{field} not in {fields:?}");
        }
        let violations = check_tool(&tool(&proto::ToolGeometry::default()));
        let fields: Vec<_> = violations.as_slice().iter().map(|violation| violation.field.as_str()).collect();
        let lengths = ["radius_mm", "radial_edge_length_mm", "axial_edge_height_mm"];
        assert_eq!(fields[0], "geometry.edges");
        assert_eq!(fields[1..], lengths.map(|field| format!("geometry.{field}")));
    }

    #[test]
    fn a_valid_tool_passes() {
        let tool = proto::Tool {
            number: 1,
            max_spindle_rev_per_min: Some(4_000.0),
            length_mm: Some(120.5),
            ..Default::default()
        };
        assert!(check_tool(&tool).is_empty());
        assert_eq!(tool_for_pipeline(&tool).length_mm, Some(120.5));
        assert_eq!(tool_for_pipeline(&tool).max_rev_per_min, Some(4_000.0));
    }
}
