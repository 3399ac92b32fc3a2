//! Tool oscillation: its words, its conditions on a machine, the cutting edges of a tool, what a job asks of it, its
//! report.

mod condition;
mod report;

use feedwave_cutting::MachineProfile;
use feedwave_cutting::tool_oscillation::{CuttingEdge, FloorSettings, OscillationRequest, ToolGeometry};

use super::{Function, codes_from_proto, codes_to_proto};
use crate::proto;
use crate::violations::Violations;

pub(super) const FUNCTION: Function = Function {
    words_from_proto: |given, language| {
        language.tool_oscillation = codes_from_proto(given.tool_oscillation, language.tool_oscillation);
    },
    words_to_proto: |language, shown| shown.tool_oscillation = Some(codes_to_proto(language.tool_oscillation)),
    settings_from_proto,
    settings_to_proto,
    job_from_proto: |settings, config| {
        config.oscillation = oscillation_request_from_proto(settings.oscillation.as_ref());
    },
    report_to_proto: |report, shown| {
        shown.oscillations = report.oscillations.iter().map(report::section_to_proto).collect();
    },
};

fn settings_from_proto(violations: &mut Violations, given: &proto::MachineProfile, profile: &mut MachineProfile) {
    if let Some(conditions) = condition::conditions_from_proto(violations, &given.tool_oscillation) {
        profile.tool_oscillation = conditions;
    }
    profile.oscillation_floor = floor_from_proto(&given.oscillation_floor.unwrap_or_default());
}

fn settings_to_proto(profile: &MachineProfile, shown: &mut proto::MachineProfile) {
    shown.tool_oscillation = profile.tool_oscillation.iter().map(condition::condition_to_proto).collect();
    shown.oscillation_floor = Some(floor_to_proto(&profile.oscillation_floor));
}

/// How the floor is simulated; unset fields have their defaults.
fn floor_from_proto(settings: &proto::OscillationFloorSettings) -> FloorSettings {
    let default = FloorSettings::default();
    FloorSettings {
        simulate: settings.simulate.unwrap_or(default.simulate),
        revolutions: settings.revolutions.unwrap_or(default.revolutions),
        resolution_mm: settings.resolution_mm.unwrap_or(default.resolution_mm),
        max_cells: settings.max_cells.unwrap_or(default.max_cells),
        trailing: settings.trailing.unwrap_or(default.trailing),
    }
}

/// How the floor is simulated, with every value stated.
const fn floor_to_proto(settings: &FloorSettings) -> proto::OscillationFloorSettings {
    let FloorSettings { simulate, revolutions, resolution_mm, max_cells, trailing } = *settings;
    proto::OscillationFloorSettings {
        simulate: Some(simulate),
        revolutions: Some(revolutions),
        resolution_mm: Some(resolution_mm),
        max_cells: Some(max_cells),
        trailing: Some(trailing),
    }
}

/// What a job asks; whether the machine can do it is [`OscillationRequest::problems`]' to say.
#[must_use]
pub fn oscillation_request_from_proto(request: Option<&proto::OscillationRequest>) -> OscillationRequest {
    let Some(request) = request else { return OscillationRequest::default() };
    OscillationRequest {
        condition: Some(request.condition.clone()).filter(|name| !name.is_empty()),
        parts_before: request.parts_before,
        cutting_time_before_s: request.cutting_time_before_s,
    }
}

/// What a job asks, as the contract has it.
#[must_use]
pub fn oscillation_request_to_proto(request: &OscillationRequest) -> proto::OscillationRequest {
    proto::OscillationRequest {
        condition: request.condition.clone().unwrap_or_default(),
        parts_before: request.parts_before,
        cutting_time_before_s: request.cutting_time_before_s,
    }
}

/// The cutting edges of a tool; what is impossible is found by [`ToolGeometry::problems`].
pub(in crate::convert) fn geometry_from_proto(geometry: &proto::ToolGeometry) -> ToolGeometry {
    let edge = |edge: &proto::CuttingEdge| CuttingEdge {
        angle_deg: edge.angle_deg,
        radial_set_over_mm: edge.radial_set_over_mm,
        axial_set_over_mm: edge.axial_set_over_mm,
        finishing: edge.finishing,
    };
    ToolGeometry {
        edges: geometry.edges.iter().map(edge).collect(),
        radius_mm: geometry.radius_mm,
        radial_edge_length_mm: geometry.radial_edge_length_mm,
        axial_edge_height_mm: geometry.axial_edge_height_mm,
        end_relief_deg: geometry.end_relief_deg,
    }
}

#[cfg(test)]
pub(in crate::convert) mod tests;
