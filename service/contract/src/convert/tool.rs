//! Tools.

use feedwave_program::{Axis, Position, ToolOffset};

use super::functions::tool_oscillation::geometry_from_proto;
use super::language::position_from_proto;
use super::lobes::check_dynamics;
use crate::convert::{check_display_name, enumeration};
use crate::names;
use crate::proto;
use crate::violations::Violations;

/// Highest number of a T word.
const MAX_TOOL_NUMBER: u32 = 9_999;

/// Checks a list of tools with all their data, each with another number.
pub fn check_tools(violations: &mut Violations, field: &str, tools: &[proto::Tool]) {
    for (index, tool) in tools.iter().enumerate() {
        violations.extend(&format!("{field}[{index}]"), check_named_tool(tool));
        if let Some(first) = tools[..index].iter().position(|other| other.number == tool.number) {
            let message = format!("{field}[{first}] has the number {} already", tool.number);
            violations.add(format!("{field}[{index}].number"), message);
        }
    }
}

/// Checks a tool that comes with its resource name, or without one.
#[must_use]
pub fn check_named_tool(tool: &proto::Tool) -> Violations {
    let mut violations = check_tool(tool);
    if !tool.name.is_empty()
        && let Err(error) = names::parse_tool(&tool.name)
    {
        violations.add("name", format!("{error}; the name for people is display_name"));
    }
    violations
}

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
    check_offset(&mut violations, tool);
    if let Some(dynamics) = &tool.dynamics {
        check_dynamics(&mut violations, "dynamics", dynamics);
    }
    violations
}

/// Largest value of a tool offset, mm.
const MAX_OFFSET_MM: f64 = 100_000.0;

/// Checks the row of the table of tool offsets.
fn check_offset(violations: &mut Violations, tool: &proto::Tool) {
    for (field, position) in [("offset", &tool.offset), ("wear", &tool.wear)] {
        let Some(position) = position.as_ref().map(position_from_proto) else { continue };
        for axis in Axis::ALL {
            let value = position[axis.index()];
            let field = format!("{field}.{}", axis.letter().to_ascii_lowercase());
            if axis.is_rotary() && value != 0.0 {
                violations.add(field, format!("must be 0, as a rotary axis has no tool offset, is {value}"));
            } else if !(-MAX_OFFSET_MM..=MAX_OFFSET_MM).contains(&value) {
                violations.add(field, format!("must be -{MAX_OFFSET_MM} to {MAX_OFFSET_MM}, is {value}"));
            }
        }
    }
    if tool.offset.is_some() && tool.length_mm.is_some() {
        violations.add("offset", "must not be stated beside length_mm: z is the length");
    }
    if !(-MAX_OFFSET_MM..=MAX_OFFSET_MM).contains(&tool.radius_wear_mm) {
        let wear = tool.radius_wear_mm;
        violations.add("radius_wear_mm", format!("must be -{MAX_OFFSET_MM} to {MAX_OFFSET_MM}, is {wear}"));
    }
    if tool.tip > 9 {
        violations.add("tip", format!("must be 0 to 9, is {}", tool.tip));
    }
    for (field, angle) in [("front_angle_deg", tool.front_angle_deg), ("back_angle_deg", tool.back_angle_deg)] {
        if !(-360.0..=360.0).contains(&angle) {
            violations.add(field, format!("must be -360 to 360, is {angle}"));
        }
    }
}

/// A tool's row of the table of tool offsets.
fn offset_from_proto(tool: &proto::Tool) -> ToolOffset {
    let along_z = |length_mm| {
        let mut position = Position::default();
        position[Axis::Z.index()] = length_mm;
        position
    };
    let cutter_mm = tool.diameter_mm.map(|diameter_mm| 0.5 * diameter_mm);
    let radius_mm = match tool.kind() {
        proto::ToolKind::Turning | proto::ToolKind::Grooving | proto::ToolKind::Threading => tool.nose_radius_mm,
        _ => cutter_mm.or(tool.nose_radius_mm),
    };
    ToolOffset {
        number: tool.number,
        geometry: tool.offset.as_ref().map(position_from_proto).or(tool.length_mm.map(along_z)),
        wear: tool.wear.as_ref().map_or_else(Position::default, position_from_proto),
        radius_mm,
        radius_wear_mm: tool.radius_wear_mm,
        tip: tool.tip as u8,
        front_angle_deg: tool.front_angle_deg,
        back_angle_deg: tool.back_angle_deg,
    }
}

/// What validation needs to know of a tool.
#[must_use]
pub fn tool_for_pipeline(tool: &proto::Tool) -> feedwave_cutting::Tool {
    feedwave_cutting::Tool {
        number: tool.number,
        name: tool.display_name.clone(),
        max_rev_per_min: tool.max_spindle_rev_per_min,
        offset: offset_from_proto(tool),
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
    fn a_row_of_the_tool_table_is_checked_and_converted() {
        let position = |x, z| Some(proto::AxisPosition { x, z, ..Default::default() });
        let mut tool = proto::Tool {
            number: 3,
            kind: proto::ToolKind::Turning.into(),
            nose_radius_mm: Some(0.8),
            diameter_mm: Some(20.0),
            offset: position(35.0, 120.0),
            wear: position(-0.02, 0.05),
            radius_wear_mm: 0.01,
            tip: 3,
            front_angle_deg: 95.0,
            back_angle_deg: 30.0,
            ..Default::default()
        };
        assert!(check_tool(&tool).is_empty());
        let row = tool_for_pipeline(&tool).offset;
        assert_eq!((row.number, row.tip, row.total_radius_mm()), (3, 3, Some(0.81)));
        assert_eq!(row.total().map(|total| [total[0], total[2]]), Some([34.98, 120.05]));
        assert_eq!((row.front_angle_deg, row.back_angle_deg), (95.0, 30.0));
        tool.kind = proto::ToolKind::Mill.into();
        assert_eq!(tool_for_pipeline(&tool).offset.radius_mm, Some(10.0));

        tool.length_mm = Some(120.0);
        tool.wear = position(f64::NAN, 0.0);
        tool.offset.as_mut().unwrap().c = 1.0;
        tool.tip = 10;
        tool.radius_wear_mm = f64::INFINITY;
        tool.back_angle_deg = 400.0;
        let violations = check_tool(&tool);
        let fields: Vec<_> = violations.as_slice().iter().map(|violation| violation.field.as_str()).collect();
        assert_eq!(fields, ["offset.c", "wear.x", "offset", "radius_wear_mm", "tip", "back_angle_deg"]);
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
        assert_eq!(tool_for_pipeline(&tool).offset.length_mm(), Some(120.5));
        assert_eq!(tool_for_pipeline(&tool).max_rev_per_min, Some(4_000.0));
    }
}
