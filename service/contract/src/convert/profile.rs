//! Machine profiles, to and from the contract.

use feedwave_cutting::thread::ThreadVibrationSettings;
use feedwave_cutting::{FollowingModel, MachineProfile, VibrationSettings};
use feedwave_motion::{CarriedBy, Machine, MachineAxis, MachineKind};
use feedwave_program::{
    Axis, DecimalPointRule, DialectName, DwellUnit, FeedMode, FunctionCodes, FunctionSwitch, LanguageSettings,
    PathControlMode, Position, ThreadEWord, XWord,
};

use super::five_axis::{kinematics_from_proto, kinematics_to_proto, thinning_from_proto, thinning_to_proto};
use super::machine_codes::{machine_code_to_proto, machine_codes_from_proto, unlisted_from_proto, unlisted_to_proto};
use super::oscillation::{condition_to_proto, conditions_from_proto, floor_from_proto, floor_to_proto};
use super::parameters::{angle_range_from_proto, angle_range_to_proto, parameters_from_proto, parameters_to_proto};
use super::thread::{start_up_from_proto, start_up_to_proto};
use crate::convert::{
    enumeration, generation_mode_from_proto, generation_mode_to_proto, vibration_envelope_from_proto,
    vibration_envelope_to_proto,
};
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
            inner.add(contract_field(&problem.field), problem.message);
        }
    }
    let valid = inner.is_empty();
    violations.extend(field, inner);
    converted.filter(|_| valid)
}

/// Positions are indexed in the pipeline and have one field per letter in the contract; a condition of tool oscillation
/// has its name and its tables beside its values.
fn contract_field(field: &str) -> String {
    if field.starts_with("tool_oscillation[") {
        return field.replacen(".condition.", ".", 1);
    }
    let position = |prefix: &str| field.starts_with("language.") && prefix.ends_with(['n', ']']);
    let Some((prefix, index)) = field.strip_suffix(']').and_then(|field| field.rsplit_once('[')) else {
        return field.to_owned();
    };
    match index.parse::<usize>().ok().and_then(|index| Axis::ALL.get(index)) {
        Some(axis) if position(prefix) => format!("{prefix}.{}", axis.letter().to_ascii_lowercase()),
        _ => field.to_owned(),
    }
}

fn convert_profile(violations: &mut Violations, profile: &proto::MachineProfile) -> Option<MachineProfile> {
    let Some(model) = &profile.machine else {
        violations.add("machine", "must be set");
        return None;
    };
    let machine = machine_from_proto(violations, model);
    let kind = machine.as_ref().map_or(MachineKind::Lathe, |machine| machine.kind);
    let language = language_from_proto(violations, &profile.language.clone().unwrap_or_default(), kind);
    let vibration = vibration_from_proto(violations, profile.vibration.unwrap_or_default());
    let thread_vibration = thread_vibration_from_proto(violations, profile.thread_vibration.unwrap_or_default());
    let kinematics = profile.kinematics.as_ref().map(|kinematics| kinematics_from_proto(violations, kinematics));
    let tool_oscillation = conditions_from_proto(violations, &profile.tool_oscillation);
    let following = profile.following.unwrap_or_default();
    Some(MachineProfile {
        language: language?,
        machine: machine?,
        vibration: vibration?,
        thread_vibration: thread_vibration?,
        following: FollowingModel {
            filter_length_s: following.filter_length_s,
            position_loop_gain_per_s: following.position_loop_gain_per_s,
        },
        kinematics: match kinematics {
            Some(kinematics) => Some(kinematics?),
            None => None,
        },
        pole_tolerance_deg: profile.pole_tolerance_deg,
        corner_direction_tolerance_deg: profile
            .corner_direction_tolerance_deg
            .unwrap_or(MachineProfile::lathe().corner_direction_tolerance_deg),
        thinning: thinning_from_proto(&profile.thinning.unwrap_or_default()),
        tool_oscillation: tool_oscillation?,
        oscillation_floor: floor_from_proto(&profile.oscillation_floor.unwrap_or_default()),
        max_feed_override: profile.max_feed_override.unwrap_or(MachineProfile::lathe().max_feed_override),
        look_ahead_blocks: profile.look_ahead_blocks.unwrap_or(MachineProfile::lathe().look_ahead_blocks),
    })
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

fn language_from_proto(
    violations: &mut Violations,
    language: &proto::LanguageSettings,
    kind: MachineKind,
) -> Option<LanguageSettings> {
    let dialect = match enumeration(violations, "language.dialect", language.dialect) {
        Some(proto::Dialect::Mill) => DialectName::Mill,
        Some(proto::Dialect::Lathe) => DialectName::Lathe,
        Some(proto::Dialect::Linuxcnc) => DialectName::LinuxCnc,
        Some(proto::Dialect::Unspecified) | None => match kind {
            MachineKind::Lathe => DialectName::Lathe,
            MachineKind::Mill => DialectName::Mill,
        },
    };
    let default = match dialect {
        DialectName::Lathe => LanguageSettings::default(),
        DialectName::Mill => LanguageSettings::mill(),
        DialectName::LinuxCnc => LanguageSettings::linuxcnc(),
    };
    let decimal_point = enumeration(violations, "language.decimal_point", language.decimal_point);
    let x_word = enumeration(violations, "language.x_word", language.x_word);
    let feed_mode = enumeration(violations, "language.initial_feed_mode", language.initial_feed_mode);
    let dwell_unit = enumeration(violations, "language.dwell_p_unit", language.dwell_p_unit);
    let path_control = enumeration(violations, "language.initial_path_control", language.initial_path_control);
    let thread_e_word = enumeration(violations, "language.thread_e_word", language.thread_e_word);
    let unlisted = enumeration(violations, "language.unlisted_machine_codes", language.unlisted_machine_codes);
    let machine_codes = machine_codes_from_proto(violations, &language.machine_codes);
    let contour_tolerances_mm = match language.contour_tolerances_mm.as_slice() {
        [] => Some(default.contour_tolerances_mm),
        given => given.try_into().ok(),
    };
    if contour_tolerances_mm.is_none() {
        let count = language.contour_tolerances_mm.len();
        violations.add("language.contour_tolerances_mm", format!("must list none or ten, lists {count}"));
    }
    let angle_range = enumeration(violations, "language.angle_range", language.angle_range);
    let parameters = parameters_from_proto(violations, &language.parameters);
    let mut work_offsets = default.work_offsets;
    if language.work_offsets.len() > work_offsets.len() {
        let count = language.work_offsets.len();
        violations.add("language.work_offsets", format!("must list at most {}, lists {count}", work_offsets.len()));
    }
    for (offset, given) in work_offsets.iter_mut().zip(&language.work_offsets) {
        *offset = position_from_proto(given);
    }
    let position = |given: &Option<proto::AxisPosition>, default| given.as_ref().map_or(default, position_from_proto);
    Some(LanguageSettings {
        dialect,
        decimal_point: match decimal_point? {
            proto::DecimalPointRule::Unspecified => default.decimal_point,
            proto::DecimalPointRule::Calculator => DecimalPointRule::Calculator,
            proto::DecimalPointRule::LeastIncrement => DecimalPointRule::LeastIncrement,
        },
        x_word: match x_word? {
            proto::XWord::Unspecified => default.x_word,
            proto::XWord::Diameter => XWord::Diameter,
            proto::XWord::Radius => XWord::Radius,
        },
        initial_feed_mode: match feed_mode? {
            proto::FeedMode::Unspecified => default.initial_feed_mode,
            proto::FeedMode::PerMinute => FeedMode::PerMinute,
            proto::FeedMode::PerRevolution => FeedMode::PerRevolution,
        },
        initial_path_control: match path_control? {
            proto::PathControl::Unspecified => default.initial_path_control,
            proto::PathControl::ExactPath => PathControlMode::ExactPath,
            proto::PathControl::ExactStop => PathControlMode::ExactStop,
            proto::PathControl::Continuous => PathControlMode::Continuous,
        },
        default_path_tolerance_mm: language.default_path_tolerance_mm.unwrap_or(default.default_path_tolerance_mm),
        initial_inch: language.initial_inch,
        dwell_p_unit: match dwell_unit? {
            proto::DwellUnit::Unspecified => default.dwell_p_unit,
            proto::DwellUnit::Milliseconds => DwellUnit::Milliseconds,
            proto::DwellUnit::Seconds => DwellUnit::Seconds,
        },
        block_delete: language.block_delete,
        path_vibration: language
            .path_vibration
            .map_or(default.path_vibration, |codes| FunctionCodes { on: codes.on, off: codes.off }),
        thread_vibration: language.thread_vibration.map_or(default.thread_vibration, |switch| FunctionSwitch {
            code: switch.code,
            on_p: switch.on_p,
            off_p: switch.off_p,
        }),
        thread_e_word: match thread_e_word? {
            proto::ThreadEWord::Unspecified => default.thread_e_word,
            proto::ThreadEWord::ThreadsPerInch => ThreadEWord::ThreadsPerInch,
            proto::ThreadEWord::PreciseLead => ThreadEWord::PreciseLead,
        },
        thinning: language.thinning.map_or(default.thinning, |codes| FunctionCodes { on: codes.on, off: codes.off }),
        tool_oscillation: language
            .tool_oscillation
            .map_or(default.tool_oscillation, |codes| FunctionCodes { on: codes.on, off: codes.off }),
        machine_codes: machine_codes?,
        unlisted_machine_codes: unlisted_from_proto(unlisted?),
        contour_tolerances_mm: contour_tolerances_mm?,
        dwell_in_revolutions: language.dwell_in_revolutions,
        input_result: language.input_result.unwrap_or(default.input_result),
        work_offsets,
        reference_position: position(&language.reference_position, default.reference_position),
        initial_position: position(&language.initial_position, default.initial_position),
        arc_radius_tolerance_mm: language.arc_radius_tolerance_mm.unwrap_or(default.arc_radius_tolerance_mm),
        max_line_bytes: language.max_line_bytes.unwrap_or(default.max_line_bytes),
        program_number_digits: language.program_number_digits.unwrap_or(default.program_number_digits),
        max_executed_blocks: language.max_executed_blocks.unwrap_or(default.max_executed_blocks),
        max_still_blocks: language.max_still_blocks.unwrap_or(default.max_still_blocks),
        angle_range: angle_range_from_proto(angle_range?),
        parameters,
    })
}

fn vibration_from_proto(violations: &mut Violations, vibration: proto::VibrationSettings) -> Option<VibrationSettings> {
    let default = VibrationSettings::default();
    let mode = enumeration(violations, "vibration.generation_mode", vibration.generation_mode);
    let envelope = enumeration(violations, "vibration.envelope", vibration.envelope);
    let (mode, envelope) = (mode?, envelope?);
    Some(VibrationSettings {
        generation_mode: generation_mode_from_proto(mode).unwrap_or(default.generation_mode),
        envelope: vibration_envelope_from_proto(envelope).unwrap_or(default.envelope),
        published_limits_bind: vibration.published_limits_bind,
        max_frequency_hz: vibration.max_frequency_hz.unwrap_or(default.max_frequency_hz),
        max_amplitude_mm: vibration.max_amplitude_mm.unwrap_or(default.max_amplitude_mm),
        contour_tolerance_mm: vibration.contour_tolerance_mm.unwrap_or(default.contour_tolerance_mm),
        servo_substeps: vibration.servo_substeps.unwrap_or(default.servo_substeps),
        amplitude_follows_feed_up_to: vibration.amplitude_follows_feed_up_to,
    })
}

fn thread_vibration_from_proto(
    violations: &mut Violations,
    settings: proto::ThreadVibrationSettings,
) -> Option<ThreadVibrationSettings> {
    let default = ThreadVibrationSettings::default();
    let start_up = enumeration(violations, "thread_vibration.start_up", settings.start_up)?;
    Some(ThreadVibrationSettings {
        vibrations_per_rev: settings.vibrations_per_rev.unwrap_or(default.vibrations_per_rev),
        start_up: start_up_from_proto(start_up),
        combined_preparation: settings.combined_preparation,
        odd_phase_shift_deg: settings.odd_phase_shift_deg.unwrap_or(default.odd_phase_shift_deg),
        even_phase_shift_deg: settings.even_phase_shift_deg.unwrap_or(default.even_phase_shift_deg),
        reference_angle_deg: settings.reference_angle_deg,
        included_angle_deg: settings.included_angle_deg.unwrap_or(default.included_angle_deg),
        approach_mm: settings.approach_mm,
        max_thickness_mm: settings.max_thickness_mm,
        max_finishing_thickness_mm: settings.max_finishing_thickness_mm,
    })
}

fn thread_vibration_to_proto(settings: &ThreadVibrationSettings) -> proto::ThreadVibrationSettings {
    proto::ThreadVibrationSettings {
        vibrations_per_rev: Some(settings.vibrations_per_rev),
        start_up: start_up_to_proto(settings.start_up).into(),
        combined_preparation: settings.combined_preparation,
        odd_phase_shift_deg: Some(settings.odd_phase_shift_deg),
        even_phase_shift_deg: Some(settings.even_phase_shift_deg),
        reference_angle_deg: settings.reference_angle_deg,
        included_angle_deg: Some(settings.included_angle_deg),
        approach_mm: settings.approach_mm,
        max_thickness_mm: settings.max_thickness_mm,
        max_finishing_thickness_mm: settings.max_finishing_thickness_mm,
    }
}

/// A profile as the contract has it, with every value stated.
#[must_use]
pub fn profile_to_proto(profile: &MachineProfile) -> proto::MachineProfile {
    let vibration = &profile.vibration;
    proto::MachineProfile {
        language: Some(language_to_proto(&profile.language)),
        machine: Some(machine_to_proto(&profile.machine)),
        vibration: Some(proto::VibrationSettings {
            generation_mode: generation_mode_to_proto(vibration.generation_mode).into(),
            envelope: vibration_envelope_to_proto(vibration.envelope).into(),
            published_limits_bind: vibration.published_limits_bind,
            max_frequency_hz: Some(vibration.max_frequency_hz),
            max_amplitude_mm: Some(vibration.max_amplitude_mm),
            contour_tolerance_mm: Some(vibration.contour_tolerance_mm),
            servo_substeps: Some(vibration.servo_substeps),
            amplitude_follows_feed_up_to: vibration.amplitude_follows_feed_up_to,
        }),
        following: Some(proto::FollowingModel {
            filter_length_s: profile.following.filter_length_s,
            position_loop_gain_per_s: profile.following.position_loop_gain_per_s,
        }),
        look_ahead_blocks: Some(profile.look_ahead_blocks),
        max_feed_override: Some(profile.max_feed_override),
        thread_vibration: Some(thread_vibration_to_proto(&profile.thread_vibration)),
        kinematics: profile.kinematics.as_ref().map(kinematics_to_proto),
        thinning: Some(thinning_to_proto(&profile.thinning)),
        pole_tolerance_deg: profile.pole_tolerance_deg,
        tool_oscillation: profile.tool_oscillation.iter().map(condition_to_proto).collect(),
        oscillation_floor: Some(floor_to_proto(&profile.oscillation_floor)),
        corner_direction_tolerance_deg: Some(profile.corner_direction_tolerance_deg),
    }
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

fn language_to_proto(language: &LanguageSettings) -> proto::LanguageSettings {
    let dialect = match language.dialect {
        DialectName::Lathe => proto::Dialect::Lathe,
        DialectName::Mill => proto::Dialect::Mill,
        DialectName::LinuxCnc => proto::Dialect::Linuxcnc,
    };
    let decimal_point = match language.decimal_point {
        DecimalPointRule::Calculator => proto::DecimalPointRule::Calculator,
        DecimalPointRule::LeastIncrement => proto::DecimalPointRule::LeastIncrement,
    };
    let x_word = match language.x_word {
        XWord::Diameter => proto::XWord::Diameter,
        XWord::Radius => proto::XWord::Radius,
    };
    let feed_mode = match language.initial_feed_mode {
        FeedMode::PerMinute => proto::FeedMode::PerMinute,
        FeedMode::PerRevolution => proto::FeedMode::PerRevolution,
    };
    let dwell_unit = match language.dwell_p_unit {
        DwellUnit::Milliseconds => proto::DwellUnit::Milliseconds,
        DwellUnit::Seconds => proto::DwellUnit::Seconds,
    };
    let path_control = match language.initial_path_control {
        PathControlMode::ExactPath => proto::PathControl::ExactPath,
        PathControlMode::ExactStop => proto::PathControl::ExactStop,
        PathControlMode::Continuous => proto::PathControl::Continuous,
    };
    let thread_e_word = match language.thread_e_word {
        ThreadEWord::ThreadsPerInch => proto::ThreadEWord::ThreadsPerInch,
        ThreadEWord::PreciseLead => proto::ThreadEWord::PreciseLead,
    };
    let thread_vibration = language.thread_vibration;
    proto::LanguageSettings {
        dialect: dialect.into(),
        decimal_point: decimal_point.into(),
        x_word: x_word.into(),
        initial_feed_mode: feed_mode.into(),
        initial_inch: language.initial_inch,
        dwell_p_unit: dwell_unit.into(),
        block_delete: language.block_delete,
        path_vibration: Some(proto::FunctionCodes { on: language.path_vibration.on, off: language.path_vibration.off }),
        work_offsets: language.work_offsets.iter().map(position_to_proto).collect(),
        reference_position: Some(position_to_proto(&language.reference_position)),
        initial_position: Some(position_to_proto(&language.initial_position)),
        arc_radius_tolerance_mm: Some(language.arc_radius_tolerance_mm),
        max_line_bytes: Some(language.max_line_bytes),
        program_number_digits: Some(language.program_number_digits),
        max_executed_blocks: Some(language.max_executed_blocks),
        max_still_blocks: Some(language.max_still_blocks),
        initial_path_control: path_control.into(),
        default_path_tolerance_mm: Some(language.default_path_tolerance_mm),
        thread_vibration: Some(proto::FunctionSwitch {
            code: thread_vibration.code,
            on_p: thread_vibration.on_p,
            off_p: thread_vibration.off_p,
        }),
        thread_e_word: thread_e_word.into(),
        angle_range: angle_range_to_proto(language.angle_range).into(),
        parameters: parameters_to_proto(&language.parameters),
        thinning: Some(proto::FunctionCodes { on: language.thinning.on, off: language.thinning.off }),
        tool_oscillation: Some(proto::FunctionCodes {
            on: language.tool_oscillation.on,
            off: language.tool_oscillation.off,
        }),
        machine_codes: language.machine_codes.iter().map(machine_code_to_proto).collect(),
        unlisted_machine_codes: unlisted_to_proto(language.unlisted_machine_codes).into(),
        input_result: Some(language.input_result),
        contour_tolerances_mm: language.contour_tolerances_mm.to_vec(),
        dwell_in_revolutions: language.dwell_in_revolutions,
    }
}

pub(super) fn position_from_proto(position: &proto::AxisPosition) -> Position {
    let proto::AxisPosition { x, y, z, a, b, c, u, v, w } = *position;
    [x, y, z, a, b, c, u, v, w]
}

fn position_to_proto(position: &Position) -> proto::AxisPosition {
    let [x, y, z, a, b, c, u, v, w] = *position;
    proto::AxisPosition { x, y, z, a, b, c, u, v, w }
}

#[cfg(test)]
mod tests;
