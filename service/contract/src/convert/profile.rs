//! Machine profiles, to and from the contract.

use feedwave_cutting::{MachineProfile, PlanQuality};
use feedwave_motion::{CarriedBy, Machine, MachineAxis, MachineKind};
use feedwave_program::Axis;

use super::functions;
use super::language::{language_from_proto, language_to_proto};
use crate::convert::enumeration;
use crate::proto;
use crate::violations::Violations;

/// A profile as the pipeline needs it. What the message leaves open is filled in; what makes the profile unusable
/// is added to `violations`, each with its field below `field`.
pub fn profile_from_proto(
    violations: &mut Violations,
    field: &str,
    profile: &proto::MachineProfile,
) -> Option<MachineProfile> {
    let mut inner = Violations::default();
    let converted = convert_profile(&mut inner, profile);
    if inner.is_empty()
        && let Some(converted) = &converted
    {
        for problem in converted.problems() {
            inner.add(problem.field, problem.message);
        }
    }
    let valid = inner.is_empty();
    violations.extend(field, inner);
    converted.filter(|_| valid)
}

fn convert_profile(violations: &mut Violations, profile: &proto::MachineProfile) -> Option<MachineProfile> {
    let Some(model) = &profile.machine else {
        violations.add("machine", "must be set");
        return None;
    };
    let machine = machine_from_proto(violations, model);
    let kind = machine.as_ref().map_or(MachineKind::Lathe, |machine| machine.kind);
    let language = language_from_proto(violations, &profile.language.clone().unwrap_or_default(), kind);
    let default = MachineProfile::lathe();
    let mut converted = MachineProfile {
        max_feed_override: profile.max_feed_override.unwrap_or(default.max_feed_override),
        look_ahead_blocks: profile.look_ahead_blocks.unwrap_or(default.look_ahead_blocks),
        plan_quality: plan_quality_from_proto(violations, profile.plan_quality),
        language,
        ..default
    };
    // Before the machine may be missing: everything wrong is reported at once.
    functions::settings_from_proto(violations, profile, &mut converted);
    Some(MachineProfile { machine: machine?, ..converted })
}

fn machine_from_proto(violations: &mut Violations, model: &proto::MachineModel) -> Option<Machine> {
    let kind = match enumeration(violations, "machine.kind", model.kind)? {
        proto::MachineKind::Unspecified => {
            violations.add("machine.kind", "must be set");
            return None;
        }
        proto::MachineKind::Lathe => MachineKind::Lathe,
        proto::MachineKind::Mill => MachineKind::Mill,
    };
    let axes: Vec<Option<MachineAxis>> = model
        .axes
        .iter()
        .enumerate()
        .map(|(index, axis)| axis_from_proto(violations, &format!("machine.axes[{index}]"), axis))
        .collect();
    let axes = axes.into_iter().collect::<Option<Vec<_>>>()?;
    Some(Machine { kind, axes, max_spindle_rev_per_min: model.max_spindle_rev_per_min })
}

/// An axis letter; `None` with a violation.
pub(super) fn axis_letter_from_proto(violations: &mut Violations, field: &str, letter: i32) -> Option<Axis> {
    let letter: proto::AxisLetter = enumeration(violations, field, letter)?;
    if letter == proto::AxisLetter::Unspecified {
        violations.add(field, "must be set");
    }
    // The letters are numbered from 1 in the order of `Axis::ALL`.
    Axis::ALL.get((letter as usize).checked_sub(1)?).copied()
}

/// An axis letter as the contract has it: they are numbered from 1 in the order of `Axis::ALL`.
pub(super) fn axis_letter_to_proto(axis: Axis) -> proto::AxisLetter {
    proto::AxisLetter::try_from(axis.index() as i32 + 1).unwrap_or_default()
}

fn axis_from_proto(violations: &mut Violations, field: &str, axis: &proto::MachineAxis) -> Option<MachineAxis> {
    let letter = axis_letter_from_proto(violations, &format!("{field}.axis"), axis.axis);
    let carried_by = match enumeration(violations, &format!("{field}.carried_by"), axis.carried_by)? {
        proto::CarriedBy::Unspecified | proto::CarriedBy::Tool => CarriedBy::Tool,
        proto::CarriedBy::Workpiece => CarriedBy::Workpiece,
    };
    Some(MachineAxis {
        name: axis.name.clone(),
        axis: letter?,
        max_velocity_per_s: axis.max_velocity_per_s,
        max_acceleration_per_s2: axis.max_acceleration_per_s2,
        max_jerk_per_s3: axis.max_jerk_per_s3,
        travel_min: axis.travel_min,
        travel_max: axis.travel_max,
        carried_by,
        max_velocity_step_per_s: axis.max_velocity_step_per_s,
    })
}

/// A profile as the contract has it, with every value stated.
#[must_use]
pub fn profile_to_proto(profile: &MachineProfile) -> proto::MachineProfile {
    let mut shown = proto::MachineProfile {
        language: Some(language_to_proto(&profile.language)),
        machine: Some(machine_to_proto(&profile.machine)),
        look_ahead_blocks: Some(profile.look_ahead_blocks),
        plan_quality: plan_quality_to_proto(profile.plan_quality).into(),
        max_feed_override: Some(profile.max_feed_override),
        ..proto::MachineProfile::default()
    };
    functions::settings_to_proto(profile, &mut shown);
    shown
}

fn machine_to_proto(machine: &Machine) -> proto::MachineModel {
    let kind = match machine.kind {
        MachineKind::Lathe => proto::MachineKind::Lathe,
        MachineKind::Mill => proto::MachineKind::Mill,
    };
    proto::MachineModel {
        kind: kind.into(),
        axes: machine.axes.iter().map(axis_to_proto).collect(),
        max_spindle_rev_per_min: machine.max_spindle_rev_per_min,
    }
}

fn plan_quality_from_proto(violations: &mut Violations, quality: i32) -> PlanQuality {
    match enumeration(violations, "plan_quality", quality) {
        None | Some(proto::PlanQuality::Unspecified) => PlanQuality::default(),
        Some(proto::PlanQuality::Fast) => PlanQuality::Fast,
        Some(proto::PlanQuality::LeastTime) => PlanQuality::LeastTime,
    }
}

pub(super) const fn plan_quality_to_proto(quality: PlanQuality) -> proto::PlanQuality {
    match quality {
        PlanQuality::Fast => proto::PlanQuality::Fast,
        PlanQuality::LeastTime => proto::PlanQuality::LeastTime,
    }
}

fn axis_to_proto(axis: &MachineAxis) -> proto::MachineAxis {
    let carried_by = match axis.carried_by {
        CarriedBy::Tool => proto::CarriedBy::Tool,
        CarriedBy::Workpiece => proto::CarriedBy::Workpiece,
    };
    proto::MachineAxis {
        name: axis.name.clone(),
        axis: axis.axis.index() as i32 + 1,
        max_velocity_per_s: axis.max_velocity_per_s,
        max_acceleration_per_s2: axis.max_acceleration_per_s2,
        max_jerk_per_s3: axis.max_jerk_per_s3,
        travel_min: axis.travel_min,
        travel_max: axis.travel_max,
        carried_by: carried_by.into(),
        max_velocity_step_per_s: axis.max_velocity_step_per_s,
    }
}

#[cfg(test)]
pub(super) mod tests;
