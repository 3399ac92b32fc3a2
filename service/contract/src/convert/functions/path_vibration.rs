//! Vibration along the path: its words, its settings on a machine, what a job asks of it, its report.

mod report;

use feedwave_cutting::{FollowingModel, GenerationMode, MachineProfile, VibrationEnvelope, VibrationSettings};

use super::{Function, codes_from_proto, codes_to_proto};
use crate::convert::enumeration;
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
    let following = given.following.unwrap_or_default();
    profile.following = FollowingModel {
        filter_length_s: following.filter_length_s,
        position_loop_gain_per_s: following.position_loop_gain_per_s,
    };
    if let Some(vibration) = vibration_from_proto(violations, given.vibration.unwrap_or_default()) {
        profile.vibration = vibration;
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
    shown.following = Some(proto::FollowingModel {
        filter_length_s: profile.following.filter_length_s,
        position_loop_gain_per_s: profile.following.position_loop_gain_per_s,
    });
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

/// See [`generation_mode_from_proto`].
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

/// See [`vibration_envelope_from_proto`].
#[must_use]
pub const fn vibration_envelope_to_proto(envelope: VibrationEnvelope) -> proto::VibrationEnvelope {
    match envelope {
        VibrationEnvelope::Blended => proto::VibrationEnvelope::Blended,
        VibrationEnvelope::Published => proto::VibrationEnvelope::Published,
    }
}
