//! Five axes: the kinematics of a machine and its tolerances for tool directions. The words of tool centre point control
//! are those of the dialect, and its findings say what there is to report.

use feedwave_cutting::MachineProfile;
use feedwave_motion::kinematics::{BranchPreference, ChainAxis, KinematicsDescription, Wrap};

use super::Function;
use crate::convert::enumeration;
use crate::convert::profile::axis_letter_from_proto;
use crate::proto;
use crate::violations::Violations;

pub(super) const FUNCTION: Function = Function {
    words_from_proto: |_, _| {},
    words_to_proto: |_, _| {},
    settings_from_proto,
    settings_to_proto,
    job_from_proto: |_, _| {},
    report_to_proto: |_, _| {},
};

fn settings_from_proto(violations: &mut Violations, given: &proto::MachineProfile, profile: &mut MachineProfile) {
    profile.kinematics = given.kinematics.as_ref().and_then(|given| kinematics_from_proto(violations, given));
    profile.pole_tolerance_deg = given.pole_tolerance_deg;
    profile.corner_direction_tolerance_deg =
        given.corner_direction_tolerance_deg.unwrap_or(profile.corner_direction_tolerance_deg);
}

fn settings_to_proto(profile: &MachineProfile, shown: &mut proto::MachineProfile) {
    shown.kinematics = profile.kinematics.as_ref().map(kinematics_to_proto);
    shown.pole_tolerance_deg = profile.pole_tolerance_deg;
    shown.corner_direction_tolerance_deg = Some(profile.corner_direction_tolerance_deg);
}

/// The kinematics as the pipeline needs them; `None` with a violation.
fn kinematics_from_proto(violations: &mut Violations, kinematics: &proto::Kinematics) -> Option<KinematicsDescription> {
    let chain: Vec<Option<ChainAxis>> = kinematics
        .chain
        .iter()
        .enumerate()
        .map(|(index, axis)| chain_axis_from_proto(violations, &format!("kinematics.chain[{index}]"), axis))
        .collect();
    let branch = enumeration(violations, "kinematics.preferred_branch", kinematics.preferred_branch);
    Some(KinematicsDescription {
        chain: chain.into_iter().collect::<Option<_>>()?,
        gauge_point_mm: kinematics.gauge_point_mm.map_or([0.0; 3], vector),
        tool_direction: kinematics.tool_direction.map_or([0.0, 0.0, 1.0], vector),
        preferred_branch: match branch? {
            proto::BranchPreference::Unspecified | proto::BranchPreference::Nearest => BranchPreference::Nearest,
            proto::BranchPreference::Larger => BranchPreference::Larger,
            proto::BranchPreference::Smaller => BranchPreference::Smaller,
        },
    })
}

fn chain_axis_from_proto(violations: &mut Violations, field: &str, axis: &proto::ChainAxis) -> Option<ChainAxis> {
    let letter = axis_letter_from_proto(violations, &format!("{field}.axis"), axis.axis);
    let wrap = enumeration(violations, &format!("{field}.wrap"), axis.wrap);
    let Some(direction) = axis.direction else {
        violations.add(format!("{field}.direction"), "must be set");
        return None;
    };
    Some(ChainAxis {
        axis: letter?,
        direction: vector(direction),
        point_mm: axis.point_mm.map_or([0.0; 3], vector),
        range: axis.range.map(|range| [range.min, range.max]),
        wrap: match wrap? {
            proto::Wrap::Unspecified | proto::Wrap::Counting => Wrap::Counting,
            proto::Wrap::Rollover => Wrap::Rollover,
        },
    })
}

const fn vector(vector: proto::Vector) -> [f64; 3] {
    [vector.x, vector.y, vector.z]
}

/// Kinematics as the contract has them.
fn kinematics_to_proto(kinematics: &KinematicsDescription) -> proto::Kinematics {
    let to_vector = |[x, y, z]: [f64; 3]| Some(proto::Vector { x, y, z });
    let chain_axis = |axis: &ChainAxis| proto::ChainAxis {
        axis: axis.axis.index() as i32 + 1,
        direction: to_vector(axis.direction),
        point_mm: to_vector(axis.point_mm),
        range: axis.range.map(|[min, max]| proto::AxisRange { min, max }),
        wrap: match axis.wrap {
            Wrap::Counting => proto::Wrap::Counting,
            Wrap::Rollover => proto::Wrap::Rollover,
        }
        .into(),
    };
    proto::Kinematics {
        chain: kinematics.chain.iter().map(chain_axis).collect(),
        gauge_point_mm: to_vector(kinematics.gauge_point_mm),
        tool_direction: to_vector(kinematics.tool_direction),
        preferred_branch: match kinematics.preferred_branch {
            BranchPreference::Nearest => proto::BranchPreference::Nearest,
            BranchPreference::Larger => proto::BranchPreference::Larger,
            BranchPreference::Smaller => proto::BranchPreference::Smaller,
        }
        .into(),
    }
}

#[cfg(test)]
pub(in crate::convert) mod tests;
