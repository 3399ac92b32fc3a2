//! Thinning: its words, its settings on a machine, its report.

use feedwave_cutting::thinning::{RotaryReport, ThinningMethod, ThinningSettings};
use feedwave_cutting::{MethodFigures, ProgramThinning};

use super::{Function, codes_from_proto, codes_to_proto};
use crate::convert::enumeration;
use crate::proto;

pub(super) const FUNCTION: Function = Function {
    words_from_proto: |given, language| {
        language.thinning = language.thinning.map(|codes| codes_from_proto(given.thinning, codes));
    },
    words_to_proto: |language, shown| shown.thinning = language.thinning.map(codes_to_proto),
    settings_from_proto: |violations, given, profile| {
        // Read behind the kinematics.
        if profile.kinematics.is_none() {
            profile.language.thinning = None;
        }
        let settings = given.thinning.unwrap_or_default();
        if let Some(method) = enumeration(violations, "thinning.method", settings.method) {
            profile.thinning = settings_from_proto(&settings, method);
        }
    },
    settings_to_proto: |profile, shown| shown.thinning = Some(settings_to_proto(&profile.thinning)),
    job_from_proto: |_, _| {},
    report_to_proto: |report, shown| shown.thinning = report.thinning.as_ref().map(report_to_proto),
};

/// What the message leaves open is filled in.
fn settings_from_proto(settings: &proto::ThinningSettings, method: proto::ThinningMethod) -> ThinningSettings {
    let default = ThinningSettings::default();
    ThinningSettings {
        angle_tolerance_deg: settings.angle_tolerance_deg.unwrap_or(default.angle_tolerance_deg),
        distance_tolerance_mm: settings.distance_tolerance_mm.unwrap_or(default.distance_tolerance_mm),
        group_blocks: settings.group_blocks.unwrap_or(default.group_blocks),
        interpolated_direction_tolerance_deg: settings.interpolated_direction_tolerance_deg,
        method: match method {
            proto::ThinningMethod::Unspecified => default.method,
            proto::ThinningMethod::Published => ThinningMethod::Published,
            proto::ThinningMethod::Fitted => ThinningMethod::Fitted,
        },
    }
}

const fn method_to_proto(method: ThinningMethod) -> proto::ThinningMethod {
    match method {
        ThinningMethod::Published => proto::ThinningMethod::Published,
        ThinningMethod::Fitted => proto::ThinningMethod::Fitted,
    }
}

fn settings_to_proto(settings: &ThinningSettings) -> proto::ThinningSettings {
    proto::ThinningSettings {
        angle_tolerance_deg: Some(settings.angle_tolerance_deg),
        distance_tolerance_mm: Some(settings.distance_tolerance_mm),
        group_blocks: Some(settings.group_blocks),
        interpolated_direction_tolerance_deg: settings.interpolated_direction_tolerance_deg,
        method: method_to_proto(settings.method).into(),
    }
}

/// Reversals of the rotary axes before and after.
#[expect(deprecated, reason = "a former name of a field, which its readers were promised")]
fn axes_to_proto(letters: &[char], rotary: &RotaryReport) -> Vec<proto::ThinnedRotaryAxis> {
    let counts = rotary.reversals_before.into_iter().zip(rotary.reversals_after);
    let axes = letters.iter().zip(counts).map(|(letter, (reversals_before, reversals_after))| {
        let axis = letter.to_string();
        proto::ThinnedRotaryAxis { letter: axis.clone(), axis, reversals_before, reversals_after }
    });
    axes.collect()
}

fn method_figures(of: &MethodFigures, letters: &[char]) -> proto::ThinningComparison {
    let figures = &of.figures;
    proto::ThinningComparison {
        method: method_to_proto(of.method).into(),
        blocks_kept: figures.blocks_kept(),
        rotary_axes: axes_to_proto(letters, &figures.rotary),
        time_s: of.time_s,
        position_deviation_mm: figures.position_deviation_mm,
        direction_deviation_deg: figures.direction_deviation_deg,
        direction_bound_deg: figures.direction_bound_deg,
    }
}

fn report_to_proto(thinning: &ProgramThinning) -> proto::ThinningReport {
    let figures = &thinning.figures;
    let rotary = &figures.rotary;
    proto::ThinningReport {
        method: method_to_proto(thinning.method).into(),
        methods: thinning.methods.iter().map(|of| method_figures(of, &thinning.rotary_axes)).collect(),
        direction_bound_deg: figures.direction_bound_deg,
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
        rotary_axes: axes_to_proto(&thinning.rotary_axes, rotary),
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
