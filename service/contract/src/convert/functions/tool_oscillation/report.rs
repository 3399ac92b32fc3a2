//! What is said about tool oscillations, for the contract.

use feedwave_cutting::tool_oscillation::{
    DirectionFollowing, DirectionLoad, EdgeReport, FloorReport, OscillationDirection, OscillationFollowing,
    OscillationSectionReport, PlainEdge, RemovedLayer, RoleReport, RoleRotation, Roughness,
};

use crate::proto;

/// An oscillation of a program as the contract has it.
pub(super) fn section_to_proto(section: &OscillationSectionReport) -> proto::OscillationSectionReport {
    let (cut, report) = (&section.cut, &section.report);
    let [engagement_start_deg, engagement_end_deg] = cut.engagement_deg;
    proto::OscillationSectionReport {
        on_line: section.on_line,
        line: section.line,
        tool: section.tool,
        condition: section.condition.clone(),
        cut: Some(proto::OscillationCut {
            feed_mm_per_min: cut.feed_mm_per_min,
            spindle_rev_per_min: cut.spindle_rev_per_min,
            clockwise: cut.clockwise,
            depth_mm: cut.depth_mm,
            engagement_start_deg,
            engagement_end_deg,
        }),
        periods_per_rev: report.periods_per_rev,
        edges_per_period: report.edges_per_period,
        period_s: report.period_s,
        feed_mm_per_period: report.feed_per_period_mm,
        hold_share: report.hold_share,
        required_hold_share: report.required_hold_share,
        phase_error_deg: report.phase_error_deg,
        leading_edge: report.leading_edge,
        finishing_edges: report.finishing_edges.clone(),
        ramp_mm: report.ramp_mm,
        loads: report.loads.iter().map(load).collect(),
        edges: report.edges.iter().map(edge).collect(),
        plain_edges: report.plain.iter().map(plain_edge).collect(),
        volume_mm3_per_rev: report.volume_mm3_per_rev,
        plain_volume_mm3_per_rev: report.plain_volume_mm3_per_rev,
        axial_reach_mm: report.axial_reach_mm,
        above_edge_mm: report.above_edge_mm,
        floor: report.floor.as_ref().map(floor),
        feasible: report.feasible,
        roles: Some(roles(&section.roles)),
        plane_deg: report.plane_deg,
        min_feed_mm_per_min: report.feed_range_mm_per_min[0],
        max_feed_mm_per_min: report.feed_range_mm_per_min[1],
        following: report.following.as_ref().map(following),
    }
}

fn following(report: &OscillationFollowing) -> proto::OscillationFollowing {
    proto::OscillationFollowing {
        directions: report.directions.iter().map(direction_following).collect(),
        phase_error_deg: report.phase_error_deg,
        contour_error_mm: report.contour_error_mm,
    }
}

fn direction_following(own: &DirectionFollowing) -> proto::DirectionFollowing {
    proto::DirectionFollowing {
        direction: direction(own.direction).into(),
        axis: own.axis.letter().to_string(),
        gain: own.gain,
        lag_deg: own.lag_deg,
        arriving_amplitude_mm: own.arriving_amplitude_mm,
        amplitude_to_command_mm: own.amplitude_to_command_mm,
        phase_to_command_deg: own.phase_to_command_deg,
    }
}

const fn roles(roles: &RoleReport) -> proto::OscillationRoles {
    use proto::oscillation_roles::Rotation;
    proto::OscillationRoles {
        first_edge: roles.first_edge,
        changes: roles.changes,
        rotation: match roles.rotation {
            RoleRotation::Fixed => None,
            RoleRotation::EveryParts(parts) => Some(Rotation::EveryParts(parts)),
            RoleRotation::EverySeconds(seconds) => Some(Rotation::EveryS(seconds)),
        },
        parts_before: roles.parts_before,
        cutting_time_before_s: roles.cutting_time_before_s,
    }
}

const fn direction(direction: OscillationDirection) -> proto::OscillationDirection {
    match direction {
        OscillationDirection::Feed => proto::OscillationDirection::Feed,
        OscillationDirection::Axial => proto::OscillationDirection::Axial,
        OscillationDirection::Cross => proto::OscillationDirection::Cross,
    }
}

fn load(load: &DirectionLoad) -> proto::OscillationLoad {
    proto::OscillationLoad {
        direction: direction(load.direction).into(),
        amplitude_mm: load.amplitude_mm,
        velocity_mm_per_s: load.peaks.velocity_mm_per_s,
        acceleration_mm_per_s2: load.peaks.acceleration_mm_per_s2,
        jerk_mm_per_s3: load.peaks.jerk_mm_per_s3,
        acceleration_step_mm_per_s2: load.peaks.acceleration_step_mm_per_s2,
        velocity_with_feed_mm_per_s: load.velocity_with_feed_mm_per_s,
        velocity_limit_mm_per_s: load.limits.velocity_mm_per_s,
        acceleration_limit_mm_per_s2: load.limits.acceleration_mm_per_s2,
        jerk_limit_mm_per_s3: load.limits.jerk_mm_per_s3,
        utilisation: load.utilisation,
    }
}

fn edge(edge: &EdgeReport) -> proto::OscillationEdge {
    let chip = |&[azimuth_deg, thickness_mm]: &[f64; 2]| proto::ChipAtAngle { azimuth_deg, thickness_mm };
    proto::OscillationEdge {
        edge: edge.edge,
        phase_deg: edge.phase_deg,
        feed_offset_mm: edge.feed_offset_mm,
        retraction_mm: edge.retraction_mm,
        cross_offset_mm: edge.cross_offset_mm,
        front_mm: edge.front_mm,
        layers: edge.layers.iter().map(layer).collect(),
        area_mm2: edge.area_mm2,
        max_chip_mm: edge.max_chip_mm,
        chip_over_angle: edge.chip_over_angle.iter().map(chip).collect(),
        volume_share: edge.volume_share,
        duty: edge.duty,
        finishes: edge.finishes,
    }
}

const fn layer(layer: &RemovedLayer) -> proto::RemovedLayer {
    let RemovedLayer { low_mm, high_mm, from_mm, to_mm } = *layer;
    proto::RemovedLayer { low_mm, high_mm, from_mm, to_mm }
}

const fn plain_edge(edge: &PlainEdge) -> proto::PlainEdge {
    let PlainEdge { edge, max_chip_mm, volume_share, duty } = *edge;
    proto::PlainEdge { edge, max_chip_mm, volume_share, duty }
}

const fn floor(floor: &FloorReport) -> proto::OscillationFloor {
    proto::OscillationFloor {
        length_mm: floor.area.length_mm,
        width_mm: floor.area.width_mm,
        resolution_mm: floor.area.resolution_mm,
        trailing: floor.area.trailing,
        oscillating: Some(roughness(&floor.oscillating)),
        plain: Some(roughness(&floor.plain)),
        across_mm: floor.area.across_mm,
    }
}

const fn roughness(roughness: &Roughness) -> proto::FloorRoughness {
    let Roughness { peak_to_valley_mm, mean_mm, height_mm, unswept_share } = *roughness;
    proto::FloorRoughness { peak_to_valley_mm, mean_mm, height_mm, unswept_share }
}
