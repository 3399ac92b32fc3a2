//! Machine profiles, both ways.

use feedwave_cutting::thread::ThreadVibrationSettings;
use feedwave_cutting::{FollowingModel, MachineProfile, VibrationSettings};
use feedwave_motion::{CarriedBy, Machine, MachineAxis, MachineKind};
use feedwave_program::{
    Axis, DecimalPointRule, DialectName, DwellUnit, FeedMode, FunctionCodes, FunctionSwitch, LanguageSettings,
    PathControlMode, Position, ThreadEWord, XWord,
};

use super::five_axis::{kinematics_from_proto, kinematics_to_proto, thinning_from_proto, thinning_to_proto};
use super::oscillation::{condition_to_proto, conditions_from_proto};
use super::thread::{start_up_from_proto, start_up_to_proto};
use crate::convert::{enumeration, generation_mode_from_proto, generation_mode_to_proto};
use crate::error::Violations;
use crate::proto;

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
    let sound = inner.is_empty();
    violations.extend(field, inner);
    converted.filter(|_| sound)
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
        thinning: thinning_from_proto(&profile.thinning.unwrap_or_default()),
        tool_oscillation: tool_oscillation?,
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
        Some(proto::Dialect::Unspecified) | None => match kind {
            MachineKind::Lathe => DialectName::Lathe,
            MachineKind::Mill => DialectName::Mill,
        },
    };
    let usual = match dialect {
        DialectName::Lathe => LanguageSettings::default(),
        DialectName::Mill => LanguageSettings::mill(),
    };
    let decimal_point = enumeration(violations, "language.decimal_point", language.decimal_point);
    let x_word = enumeration(violations, "language.x_word", language.x_word);
    let feed_mode = enumeration(violations, "language.initial_feed_mode", language.initial_feed_mode);
    let dwell_unit = enumeration(violations, "language.dwell_p_unit", language.dwell_p_unit);
    let path_control = enumeration(violations, "language.initial_path_control", language.initial_path_control);
    let thread_e_word = enumeration(violations, "language.thread_e_word", language.thread_e_word);
    let mut work_offsets = usual.work_offsets;
    if language.work_offsets.len() > work_offsets.len() {
        let count = language.work_offsets.len();
        violations.add("language.work_offsets", format!("must list at most {}, lists {count}", work_offsets.len()));
    }
    for (offset, given) in work_offsets.iter_mut().zip(&language.work_offsets) {
        *offset = position_from_proto(given);
    }
    let position = |given: &Option<proto::AxisPosition>, usual| given.as_ref().map_or(usual, position_from_proto);
    Some(LanguageSettings {
        dialect,
        decimal_point: match decimal_point? {
            proto::DecimalPointRule::Unspecified => usual.decimal_point,
            proto::DecimalPointRule::Calculator => DecimalPointRule::Calculator,
            proto::DecimalPointRule::LeastIncrement => DecimalPointRule::LeastIncrement,
        },
        x_word: match x_word? {
            proto::XWord::Unspecified => usual.x_word,
            proto::XWord::Diameter => XWord::Diameter,
            proto::XWord::Radius => XWord::Radius,
        },
        initial_feed_mode: match feed_mode? {
            proto::FeedMode::Unspecified => usual.initial_feed_mode,
            proto::FeedMode::PerMinute => FeedMode::PerMinute,
            proto::FeedMode::PerRevolution => FeedMode::PerRevolution,
        },
        initial_path_control: match path_control? {
            proto::PathControl::Unspecified => usual.initial_path_control,
            proto::PathControl::ExactPath => PathControlMode::ExactPath,
            proto::PathControl::ExactStop => PathControlMode::ExactStop,
            proto::PathControl::Continuous => PathControlMode::Continuous,
        },
        default_path_tolerance_mm: language.default_path_tolerance_mm.unwrap_or(usual.default_path_tolerance_mm),
        initial_inch: language.initial_inch,
        dwell_p_unit: match dwell_unit? {
            proto::DwellUnit::Unspecified => usual.dwell_p_unit,
            proto::DwellUnit::Milliseconds => DwellUnit::Milliseconds,
            proto::DwellUnit::Seconds => DwellUnit::Seconds,
        },
        block_delete: language.block_delete,
        path_vibration: language
            .path_vibration
            .map_or(usual.path_vibration, |codes| FunctionCodes { on: codes.on, off: codes.off }),
        thread_vibration: language.thread_vibration.map_or(usual.thread_vibration, |switch| FunctionSwitch {
            code: switch.code,
            on_p: switch.on_p,
            off_p: switch.off_p,
        }),
        thread_e_word: match thread_e_word? {
            proto::ThreadEWord::Unspecified => usual.thread_e_word,
            proto::ThreadEWord::ThreadsPerInch => ThreadEWord::ThreadsPerInch,
            proto::ThreadEWord::PreciseLead => ThreadEWord::PreciseLead,
        },
        thinning: language.thinning.map_or(usual.thinning, |codes| FunctionCodes { on: codes.on, off: codes.off }),
        tool_oscillation: language
            .tool_oscillation
            .map_or(usual.tool_oscillation, |codes| FunctionCodes { on: codes.on, off: codes.off }),
        work_offsets,
        reference_position: position(&language.reference_position, usual.reference_position),
        initial_position: position(&language.initial_position, usual.initial_position),
        arc_radius_tolerance_mm: language.arc_radius_tolerance_mm.unwrap_or(usual.arc_radius_tolerance_mm),
        max_line_bytes: language.max_line_bytes.unwrap_or(usual.max_line_bytes),
    })
}

fn vibration_from_proto(violations: &mut Violations, vibration: proto::VibrationSettings) -> Option<VibrationSettings> {
    let usual = VibrationSettings::default();
    let mode = enumeration(violations, "vibration.generation_mode", vibration.generation_mode)?;
    Some(VibrationSettings {
        generation_mode: generation_mode_from_proto(mode).unwrap_or(usual.generation_mode),
        max_frequency_hz: vibration.max_frequency_hz.unwrap_or(usual.max_frequency_hz),
        max_amplitude_mm: vibration.max_amplitude_mm.unwrap_or(usual.max_amplitude_mm),
        contour_tolerance_mm: vibration.contour_tolerance_mm.unwrap_or(usual.contour_tolerance_mm),
        servo_substeps: vibration.servo_substeps.unwrap_or(usual.servo_substeps),
    })
}

fn thread_vibration_from_proto(
    violations: &mut Violations,
    settings: proto::ThreadVibrationSettings,
) -> Option<ThreadVibrationSettings> {
    let usual = ThreadVibrationSettings::default();
    let start_up = enumeration(violations, "thread_vibration.start_up", settings.start_up)?;
    Some(ThreadVibrationSettings {
        vibrations_per_rev: settings.vibrations_per_rev.unwrap_or(usual.vibrations_per_rev),
        start_up: start_up_from_proto(start_up),
        combined_preparation: settings.combined_preparation,
        odd_phase_shift_deg: settings.odd_phase_shift_deg.unwrap_or(usual.odd_phase_shift_deg),
        even_phase_shift_deg: settings.even_phase_shift_deg.unwrap_or(usual.even_phase_shift_deg),
        reference_angle_deg: settings.reference_angle_deg,
        included_angle_deg: settings.included_angle_deg.unwrap_or(usual.included_angle_deg),
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
            max_frequency_hz: Some(vibration.max_frequency_hz),
            max_amplitude_mm: Some(vibration.max_amplitude_mm),
            contour_tolerance_mm: Some(vibration.contour_tolerance_mm),
            servo_substeps: Some(vibration.servo_substeps),
        }),
        following: Some(proto::FollowingModel {
            filter_length_s: profile.following.filter_length_s,
            position_loop_gain_per_s: profile.following.position_loop_gain_per_s,
        }),
        look_ahead_blocks: Some(profile.look_ahead_blocks),
        thread_vibration: Some(thread_vibration_to_proto(&profile.thread_vibration)),
        kinematics: profile.kinematics.as_ref().map(kinematics_to_proto),
        thinning: Some(thinning_to_proto(&profile.thinning)),
        pole_tolerance_deg: profile.pole_tolerance_deg,
        tool_oscillation: profile.tool_oscillation.iter().map(condition_to_proto).collect(),
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
        initial_path_control: path_control.into(),
        default_path_tolerance_mm: Some(language.default_path_tolerance_mm),
        thread_vibration: Some(proto::FunctionSwitch {
            code: thread_vibration.code,
            on_p: thread_vibration.on_p,
            off_p: thread_vibration.off_p,
        }),
        thread_e_word: thread_e_word.into(),
        thinning: Some(proto::FunctionCodes { on: language.thinning.on, off: language.thinning.off }),
        tool_oscillation: Some(proto::FunctionCodes {
            on: language.tool_oscillation.on,
            off: language.tool_oscillation.off,
        }),
    }
}

fn position_from_proto(position: &proto::AxisPosition) -> Position {
    let proto::AxisPosition { x, y, z, a, b, c, u, v, w } = *position;
    [x, y, z, a, b, c, u, v, w]
}

fn position_to_proto(position: &Position) -> proto::AxisPosition {
    let [x, y, z, a, b, c, u, v, w] = *position;
    proto::AxisPosition { x, y, z, a, b, c, u, v, w }
}

#[cfg(test)]
mod tests {
    use feedwave_cutting::tool_oscillation::{
        ConditionTable, DirectionOscillation, Interpolation, LeadingEdge, NamedCondition, OscillationCondition,
        OscillationPeriod, RoleRotation, TableQuantity, Waveform,
    };
    use feedwave_motion::kinematics::{BranchPreference, ChainAxis, KinematicsDescription, Wrap};

    use super::*;

    fn from_proto(profile: &proto::MachineProfile) -> Result<MachineProfile, Vec<(String, String)>> {
        let mut violations = Violations::default();
        let converted = profile_from_proto(&mut violations, "profile", profile);
        let found = |v: &crate::error::Violation| (v.field.clone(), v.description.clone());
        converted.ok_or_else(|| violations.as_slice().iter().map(found).collect())
    }

    #[test]
    fn profiles_survive_the_round_trip() {
        let mut lathe = MachineProfile::lathe();
        lathe.machine.axes[0].travel_max = Some(200.0);
        lathe.thread_vibration.start_up = feedwave_cutting::thread::StartUp::Delayed;
        lathe.thread_vibration.combined_preparation = true;
        lathe.thread_vibration.reference_angle_deg = 12.5;
        lathe.thread_vibration.approach_mm = Some(4.0);
        lathe.machine.axes[1].carried_by = CarriedBy::Workpiece;
        lathe.machine.axes[1].max_velocity_step_per_s = 0.2;
        lathe.language.work_offsets[2][5] = 90.0;
        lathe.language.initial_path_control = PathControlMode::Continuous;
        lathe.language.default_path_tolerance_mm = 0.025;
        lathe.language.decimal_point = DecimalPointRule::LeastIncrement;
        lathe.language.thread_vibration = FunctionSwitch { code: 165.1, on_p: 1, off_p: 2 };
        lathe.language.thread_e_word = ThreadEWord::PreciseLead;
        lathe.following.filter_length_s = Some(0.02);
        lathe.look_ahead_blocks = 100;
        for profile in [lathe, five_axis_mill(), oscillating_mill(), MachineProfile::lathe(), MachineProfile::mill()] {
            assert_eq!(from_proto(&profile_to_proto(&profile)), Ok(profile));
        }
    }

    /// A trunnion with everything that a profile can say of five axes.
    fn five_axis_mill() -> MachineProfile {
        let axis = |axis: Axis, direction: [f64; 3]| ChainAxis {
            axis,
            direction,
            point_mm: [1.0, 2.0, 3.0],
            range: (axis == Axis::A).then_some([-120.0, 30.0]),
            wrap: if axis == Axis::C { Wrap::Rollover } else { Wrap::Counting },
        };
        let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let mut mill = MachineProfile::mill();
        for letter in [Axis::A, Axis::C] {
            mill.machine.axes.push(MachineAxis::new(letter, 100.0, 1_000.0, 10_000.0));
        }
        mill.kinematics = Some(KinematicsDescription {
            chain: vec![axis(Axis::C, z), axis(Axis::A, x), axis(Axis::X, x), axis(Axis::Y, y), axis(Axis::Z, z)],
            gauge_point_mm: [0.0, 0.0, 500.0],
            tool_direction: z,
            preferred_branch: BranchPreference::Smaller,
        });
        mill.thinning.group_blocks = 77;
        mill.thinning.interpolated_direction_tolerance_deg = Some(2.5);
        mill.pole_tolerance_deg = 0.5;
        mill.language.thinning = FunctionCodes { on: 133.0, off: 134.0 };
        mill
    }

    /// A mill with every kind of waveform, period, rotation and table.
    fn oscillating_mill() -> MachineProfile {
        let direction = |amplitude_mm, waveform, phase_deg| DirectionOscillation { amplitude_mm, waveform, phase_deg };
        let table = |quantity, interpolation| ConditionTable {
            quantity,
            interpolation,
            feed_mm_per_min: vec![300.0, 600.0, 900.0],
            spindle_rev_per_min: vec![500.0, 700.0],
            values: vec![vec![0.1, 0.2, 0.3], vec![0.2, 0.3, 0.4]],
        };
        let first = NamedCondition {
            name: "accuracy".to_owned(),
            number: 1,
            tools: vec![4, 7],
            condition: OscillationCondition {
                period: OscillationPeriod::PerRevolution(2),
                feed: direction(0.4, Waveform::Sine, 0.0),
                axial: direction(0.03, Waveform::HeldPeak { hold_share: 0.3 }, -12.5),
                cross: Some(direction(
                    0.1,
                    Waveform::Table { points: vec![[0.0, 0.5], [0.25, 1.0], [0.75, -1.0]] },
                    3.0,
                )),
                leading_edge: LeadingEdge { edge: 3, phase_deg: 30.0, rotation: RoleRotation::EveryParts(5) },
                ramp_periods: 4,
                may_overrun: true,
            },
            tables: vec![
                table(TableQuantity::FeedAmplitude, Interpolation::Linear),
                table(TableQuantity::AxialAmplitude, Interpolation::Monotone),
                table(TableQuantity::CrossAmplitude, Interpolation::Linear),
                table(TableQuantity::AxialHoldShare, Interpolation::Monotone),
            ],
        };
        let mut second = NamedCondition { name: "speed".to_owned(), tools: Vec::new(), ..first.clone() };
        second.condition.period = OscillationPeriod::Seconds(0.05);
        second.condition.axial.waveform = Waveform::JerkLimitedHeldPeak { hold_share: 0.25 };
        second.condition.cross = None;
        second.condition.leading_edge.rotation = RoleRotation::EverySeconds(600.0);
        second.tables.clear();
        let mut mill = MachineProfile::mill();
        mill.tool_oscillation = vec![first, second];
        mill.language.tool_oscillation = FunctionCodes { on: 302.1, off: 303.0 };
        mill
    }

    #[test]
    fn oscillation_conditions_are_checked_with_their_fields() {
        let mut profile = profile_to_proto(&oscillating_mill());
        let [first, second] = profile.tool_oscillation.as_mut_slice() else { panic!("two conditions") };
        (first.period, first.axial) = (None, None);
        first.tables[2].quantity = 0;
        second.name = "\n".to_owned();
        let fields: Vec<String> = from_proto(&profile).unwrap_err().into_iter().map(|(field, _)| field).collect();
        let field = |place: &str| format!("profile.tool_oscillation{place}");
        assert_eq!(fields, ["[0].period", "[0].axial", "[0].tables[2].quantity", "[1].name"].map(field));

        let mut profile = profile_to_proto(&oscillating_mill());
        let [first, second] = profile.tool_oscillation.as_mut_slice() else { panic!("two conditions") };
        first.feed.as_mut().unwrap().amplitude_mm = f64::NAN;
        first.cross.as_mut().unwrap().waveform = Some(proto::Waveform {
            kind: Some(proto::waveform::Kind::HeldPeak(proto::HeldPeakWave { hold_share: 0.5 })),
        });
        first.ramp_periods = Some(0);
        first.tables[1].rows.pop();
        second.period = Some(proto::oscillation_condition::Period::PeriodS(-1.0));
        second.leading_edge.as_mut().unwrap().phase_deg = 400.0;
        second.leading_edge.as_mut().unwrap().rotation = Some(proto::leading_edge::Rotation::EveryParts(0));
        profile.language.as_mut().unwrap().tool_oscillation = Some(proto::FunctionCodes { on: 1.0, off: 203.0 });
        let found: Vec<String> = from_proto(&profile).unwrap_err().into_iter().map(|(field, _)| field).collect();
        for place in [
            "[0].ramp_periods",
            "[0].feed.amplitude_mm",
            "[0].cross.waveform",
            "[0].tables[1]",
            "[1].period",
            "[1].leading_edge.phase_deg",
            "[1].leading_edge.rotation",
        ] {
            assert!(found.contains(&field(place)), "{place} not in {found:?}");
        }
    }

    #[test]
    fn kinematics_are_checked_with_their_fields() {
        let mut profile = profile_to_proto(&five_axis_mill());
        let kinematics = profile.kinematics.as_mut().unwrap();
        kinematics.chain[0].axis = 0;
        kinematics.chain[1].direction = None;
        let fields: Vec<String> = from_proto(&profile).unwrap_err().into_iter().map(|(field, _)| field).collect();
        assert_eq!(fields, ["profile.kinematics.chain[0].axis", "profile.kinematics.chain[1].direction"]);
        let mut profile = profile_to_proto(&five_axis_mill());
        profile.machine.as_mut().unwrap().axes.pop();
        profile.thinning.as_mut().unwrap().group_blocks = Some(1);
        let fields: Vec<String> = from_proto(&profile).unwrap_err().into_iter().map(|(field, _)| field).collect();
        assert_eq!(fields, ["profile.thinning.group_blocks", "profile.kinematics.chain[0].axis"]);
    }

    #[test]
    fn what_is_left_open_is_as_usual_for_the_machine() {
        for usual in [MachineProfile::lathe(), MachineProfile::mill()] {
            let machine = profile_to_proto(&usual).machine;
            let sparse = proto::MachineProfile { machine, ..Default::default() };
            assert_eq!(from_proto(&sparse), Ok(usual));
        }
    }

    #[test]
    fn everything_wrong_is_reported_at_once_with_its_field() {
        let mut profile = profile_to_proto(&MachineProfile::mill());
        profile.machine.as_mut().unwrap().axes[1].max_jerk_per_s3 = -1.0;
        profile.machine.as_mut().unwrap().axes[2].name = String::new();
        profile.machine.as_mut().unwrap().axes[0].max_velocity_step_per_s = -1.0;
        profile.language.as_mut().unwrap().work_offsets[3].b = f64::NAN;
        profile.language.as_mut().unwrap().default_path_tolerance_mm = Some(11.0);
        profile.vibration.as_mut().unwrap().servo_substeps = Some(0);
        profile.look_ahead_blocks = Some(0);
        let found = from_proto(&profile).unwrap_err();
        let fields: Vec<_> = found.iter().map(|(field, _)| field.as_str()).collect();
        for field in [
            "profile.machine.axes[0].max_velocity_step_per_s",
            "profile.machine.axes[1].max_jerk_per_s3",
            "profile.machine.axes[2].name",
            "profile.language.default_path_tolerance_mm",
            "profile.language.work_offsets[3].b",
            "profile.vibration.servo_substeps",
            "profile.look_ahead_blocks",
        ] {
            assert!(fields.contains(&field), "{field} not in {fields:?}");
        }
    }

    #[test]
    fn values_that_are_none_and_missing_parts_are_reported() {
        let found = from_proto(&proto::MachineProfile::default()).unwrap_err();
        assert_eq!(found[0].0, "profile.machine");
        let mut profile = profile_to_proto(&MachineProfile::lathe());
        profile.machine.as_mut().unwrap().axes[0].axis = 0;
        profile.language.as_mut().unwrap().dialect = 40;
        let found = from_proto(&profile).unwrap_err();
        let fields: Vec<_> = found.iter().map(|(field, _)| field.as_str()).collect();
        assert!(fields.contains(&"profile.machine.axes[0].axis"), "{fields:?}");
        assert!(fields.contains(&"profile.language.dialect"), "{fields:?}");
    }
}
