//! Vibration along the path: its words, its settings on a machine, what a job asks of it, its report.

mod report;

use feedwave_cutting::{
    AxisDrive, DriveModel, FollowingModel, GenerationMode, MachineProfile, VibrationEnvelope, VibrationSettings,
};

use super::{Function, codes_from_proto, codes_to_proto};
use crate::convert::enumeration;
use crate::convert::profile::{axis_letter_from_proto, axis_letter_to_proto};
use crate::proto;
use crate::violations::Violations;

pub(super) const FUNCTION: Function = Function {
    words_from_proto: |given, language| {
        language.path_vibration = codes_from_proto(given.path_vibration, language.path_vibration);
    },
    words_to_proto: |language, shown| shown.path_vibration = Some(codes_to_proto(language.path_vibration)),
    settings_from_proto,
    settings_to_proto,
    job_from_proto: |settings, config| {
        config.generation_mode =
            generation_mode_from_proto(settings.generation_mode()).unwrap_or(config.generation_mode);
        config.vibration_envelope =
            vibration_envelope_from_proto(settings.vibration_envelope()).unwrap_or(config.vibration_envelope);
    },
    report_to_proto: |report, shown| shown.sections = report.sections.iter().map(report::section_to_proto).collect(),
};

fn settings_from_proto(violations: &mut Violations, given: &proto::MachineProfile, profile: &mut MachineProfile) {
    if let Some(following) = following_from_proto(violations, given.following.clone().unwrap_or_default()) {
        profile.following = following;
    }
    if let Some(vibration) = vibration_from_proto(violations, given.vibration.unwrap_or_default()) {
        profile.vibration = vibration;
    }
}

/// The drives; whether they are possible is the model's to say.
fn following_from_proto(violations: &mut Violations, given: proto::FollowingModel) -> Option<FollowingModel> {
    let axes = given.axes.iter().enumerate().map(|(index, own)| {
        let axis = axis_letter_from_proto(violations, &format!("following.axes[{index}].axis"), own.axis)?;
        let drive = DriveModel {
            filter_length_s: own.filter_length_s,
            position_loop_gain_per_s: own.position_loop_gain_per_s,
            velocity_loop_frequency_hz: own.velocity_loop_frequency_hz,
            velocity_loop_damping: own.velocity_loop_damping,
            velocity_feed_forward: own.velocity_feed_forward,
        };
        Some(AxisDrive { axis, drive })
    });
    // All of them, so that each one's violation is said.
    let axes: Vec<Option<AxisDrive>> = axes.collect();
    Some(FollowingModel {
        common: DriveModel {
            filter_length_s: given.filter_length_s,
            position_loop_gain_per_s: given.position_loop_gain_per_s,
            velocity_loop_frequency_hz: given.velocity_loop_frequency_hz,
            velocity_loop_damping: given.velocity_loop_damping,
            velocity_feed_forward: given.velocity_feed_forward,
        },
        axes: axes.into_iter().collect::<Option<_>>()?,
    })
}

fn following_to_proto(model: &FollowingModel) -> proto::FollowingModel {
    let DriveModel {
        filter_length_s,
        position_loop_gain_per_s,
        velocity_loop_frequency_hz,
        velocity_loop_damping,
        velocity_feed_forward,
    } = model.common;
    proto::FollowingModel {
        filter_length_s,
        position_loop_gain_per_s,
        velocity_loop_frequency_hz,
        velocity_loop_damping,
        velocity_feed_forward,
        axes: model.axes.iter().map(axis_drive_to_proto).collect(),
    }
}

fn axis_drive_to_proto(own: &AxisDrive) -> proto::AxisFollowingModel {
    let DriveModel {
        filter_length_s,
        position_loop_gain_per_s,
        velocity_loop_frequency_hz,
        velocity_loop_damping,
        velocity_feed_forward,
    } = own.drive;
    proto::AxisFollowingModel {
        axis: axis_letter_to_proto(own.axis).into(),
        filter_length_s,
        position_loop_gain_per_s,
        velocity_loop_frequency_hz,
        velocity_loop_damping,
        velocity_feed_forward,
    }
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

fn settings_to_proto(profile: &MachineProfile, shown: &mut proto::MachineProfile) {
    let vibration = &profile.vibration;
    shown.vibration = Some(proto::VibrationSettings {
        generation_mode: generation_mode_to_proto(vibration.generation_mode).into(),
        envelope: vibration_envelope_to_proto(vibration.envelope).into(),
        published_limits_bind: vibration.published_limits_bind,
        max_frequency_hz: Some(vibration.max_frequency_hz),
        max_amplitude_mm: Some(vibration.max_amplitude_mm),
        contour_tolerance_mm: Some(vibration.contour_tolerance_mm),
        servo_substeps: Some(vibration.servo_substeps),
        amplitude_follows_feed_up_to: vibration.amplitude_follows_feed_up_to,
    });
    shown.following = Some(following_to_proto(&profile.following));
}

/// The mode that a message names; `None` where it leaves it open.
#[must_use]
pub const fn generation_mode_from_proto(mode: proto::GenerationMode) -> Option<GenerationMode> {
    match mode {
        proto::GenerationMode::Unspecified => None,
        proto::GenerationMode::AlongPath => Some(GenerationMode::AlongPath),
        proto::GenerationMode::Tangential => Some(GenerationMode::Tangential),
        proto::GenerationMode::ServoSide => Some(GenerationMode::ServoSide),
    }
}

/// The message's name of a mode.
#[must_use]
pub const fn generation_mode_to_proto(mode: GenerationMode) -> proto::GenerationMode {
    match mode {
        GenerationMode::AlongPath => proto::GenerationMode::AlongPath,
        GenerationMode::Tangential => proto::GenerationMode::Tangential,
        GenerationMode::ServoSide => proto::GenerationMode::ServoSide,
    }
}

/// The envelope that a message names; `None` where it leaves it open.
#[must_use]
pub const fn vibration_envelope_from_proto(envelope: proto::VibrationEnvelope) -> Option<VibrationEnvelope> {
    match envelope {
        proto::VibrationEnvelope::Unspecified => None,
        proto::VibrationEnvelope::Blended => Some(VibrationEnvelope::Blended),
        proto::VibrationEnvelope::Published => Some(VibrationEnvelope::Published),
    }
}

/// The message's name of an envelope.
#[must_use]
pub const fn vibration_envelope_to_proto(envelope: VibrationEnvelope) -> proto::VibrationEnvelope {
    match envelope {
        VibrationEnvelope::Blended => proto::VibrationEnvelope::Blended,
        VibrationEnvelope::Published => proto::VibrationEnvelope::Published,
    }
}
