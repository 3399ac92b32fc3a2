//! Five axes: kinematics and thinning settings to and from the contract, and the report of thinning.

use feedwave_cutting::ProgramThinning;
use feedwave_cutting::thinning::ThinningSettings;
use feedwave_motion::kinematics::{BranchPreference, ChainAxis, KinematicsDescription, Wrap};

use super::profile::axis_letter_from_proto;
use crate::convert::enumeration;
use crate::proto;
use crate::violations::Violations;

/// The kinematics as the pipeline needs them; `None` with a violation.
pub(super) fn kinematics_from_proto(
    violations: &mut Violations,
    kinematics: &proto::Kinematics,
) -> Option<KinematicsDescription> {
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
pub(super) fn kinematics_to_proto(kinematics: &KinematicsDescription) -> proto::Kinematics {
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

/// Thinning settings, with what the message leaves open filled in.
pub(super) fn thinning_from_proto(settings: &proto::ThinningSettings) -> ThinningSettings {
    let default = ThinningSettings::default();
    ThinningSettings {
        angle_tolerance_deg: settings.angle_tolerance_deg.unwrap_or(default.angle_tolerance_deg),
        distance_tolerance_mm: settings.distance_tolerance_mm.unwrap_or(default.distance_tolerance_mm),
        group_blocks: settings.group_blocks.unwrap_or(default.group_blocks),
        interpolated_direction_tolerance_deg: settings.interpolated_direction_tolerance_deg,
    }
}

/// Thinning settings as the contract has them.
pub(super) const fn thinning_to_proto(settings: &ThinningSettings) -> proto::ThinningSettings {
    proto::ThinningSettings {
        angle_tolerance_deg: Some(settings.angle_tolerance_deg),
        distance_tolerance_mm: Some(settings.distance_tolerance_mm),
        group_blocks: Some(settings.group_blocks),
        interpolated_direction_tolerance_deg: settings.interpolated_direction_tolerance_deg,
    }
}

/// What thinning did, as the contract has it.
pub(super) fn thinning_report_to_proto(thinning: &ProgramThinning) -> proto::ThinningReport {
    let figures = &thinning.figures;
    let rotary = &figures.rotary;
    let counts = rotary.reversals_before.into_iter().zip(rotary.reversals_after);
    let axes = thinning.rotary_axes.iter().zip(counts);
    proto::ThinningReport {
        blocks_read: figures.blocks_read,
        blocks_dropped: figures.blocks_dropped,
        blocks_kept: figures.blocks_kept(),
        other_blocks: figures.other_blocks,
        groups: figures.groups,
        position_deviation_mm: figures.position_deviation_mm,
        position_deviation_line: figures.position_deviation_line,
        direction_deviation_deg: figures.direction_deviation_deg,
        direction_deviation_line: figures.direction_deviation_line,
        feeds_inherited: figures.feeds_inherited,
        feeds_lost: figures.feeds_lost,
        rotary_axes: axes
            .map(|(letter, (reversals_before, reversals_after))| proto::ThinnedRotaryAxis {
                letter: letter.to_string(),
                reversals_before,
                reversals_after,
            })
            .collect(),
        rotary_off_blocks: rotary.off_blocks,
        rotary_deviation_deg: rotary.largest_deviation_deg,
        rotary_deviation_line: rotary.largest_deviation_line,
        time_before_s: thinning.time_before_s,
        time_after_s: thinning.time_after_s,
        dropped: thinning
            .dropped
            .iter()
            .map(|run| proto::DroppedRun {
                first_line: run.first_line,
                last_line: run.last_line,
                blocks: run.blocks,
                kept_line: run.kept_line,
            })
            .collect(),
        dropped_not_listed: thinning.dropped_not_listed,
    }
}
