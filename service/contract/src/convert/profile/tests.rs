use feedwave_cutting::tool_oscillation::{
    ConditionTable, DirectionOscillation, Engagement, FloorSettings, Interpolation, LeadingEdge, NamedCondition,
    OscillationCondition, OscillationPeriod, RoleRotation, TableQuantity, Waveform, WorkSide,
};
use feedwave_motion::kinematics::{BranchPreference, ChainAxis, KinematicsDescription, Wrap};

use super::*;

fn from_proto(profile: &proto::MachineProfile) -> Result<MachineProfile, Vec<(String, String)>> {
    let mut violations = Violations::default();
    let converted = profile_from_proto(&mut violations, "profile", profile);
    let found = |v: &crate::violations::Violation| (v.field.clone(), v.description.clone());
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
    lathe.language.unlisted_machine_codes = feedwave_program::UnlistedMachineCodes::Error;
    lathe.language.input_result = 1.0;
    lathe.language.machine_codes = machine_codes();
    lathe.language.contour_tolerances_mm[3] = 0.5;
    lathe.language.dwell_in_revolutions = true;
    lathe.following.filter_length_s = Some(0.02);
    lathe.look_ahead_blocks = 100;
    lathe.max_feed_override = 1.2;
    for profile in [lathe, five_axis_mill(), oscillating_mill(), MachineProfile::lathe(), MachineProfile::mill()] {
        assert_eq!(from_proto(&profile_to_proto(&profile)), Ok(profile));
    }
}

/// M codes with every effect.
fn machine_codes() -> Vec<feedwave_program::MachineCode> {
    use feedwave_program::{MachineCode, MachineEffect, MachineTiming};
    let code = |number, effect, timing, words: &str| MachineCode { number, effect, timing, words: words.to_owned() };
    vec![
        code(10, MachineEffect::None, MachineTiming::Before, ""),
        code(11, MachineEffect::Stop, MachineTiming::After, "PQ"),
        code(19, MachineEffect::Dwell { seconds: 1.5 }, MachineTiming::Before, "R"),
        code(1_234, MachineEffect::Barrier, MachineTiming::After, ""),
    ]
}

#[test]
fn violations_of_machine_codes_have_their_fields() {
    let mut lathe = profile_to_proto(&MachineProfile::lathe());
    let language = lathe.language.as_mut().expect("it is stated");
    let code = |number| proto::MachineCode { number, ..proto::MachineCode::default() };
    let barrier = proto::MachineCodeEffect::Barrier.into();
    language.machine_codes = vec![code(10), code(3), proto::MachineCode { dwell_s: 1.0, effect: barrier, ..code(11) }];
    let fields = |profile: &proto::MachineProfile| {
        let violations = from_proto(profile).expect_err("it is refused");
        violations.into_iter().map(|(field, _)| field).collect::<Vec<_>>()
    };
    assert_eq!(fields(&lathe), ["profile.language.machine_codes[2].dwell_s"]);
    lathe.language.as_mut().expect("it is stated").machine_codes.pop();
    assert_eq!(fields(&lathe), ["profile.language.machine_codes[1].number"]);
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
    mill.corner_direction_tolerance_deg = 0.25;
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
            cross: Some(direction(0.1, Waveform::Table { points: vec![[0.0, 0.5], [0.25, 1.0], [0.75, -1.0]] }, 3.0)),
            leading_edge: LeadingEdge { edge: 3, phase_deg: 30.0, rotation: RoleRotation::EveryParts(5) },
            ramp_periods: 4,
            may_overrun: true,
            engagement: Engagement::Width { width_mm: 12.5, side: WorkSide::Left },
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
    second.condition.engagement = Engagement::Angles { entry_deg: -12.0, exit_deg: 90.0 };
    second.condition.leading_edge.rotation = RoleRotation::EverySeconds(600.0);
    second.tables.clear();
    let mut mill = MachineProfile::mill();
    mill.tool_oscillation = vec![first, second];
    mill.oscillation_floor =
        FloorSettings { simulate: false, revolutions: 3, resolution_mm: 0.05, max_cells: 5_000, trailing: false };
    mill.language.tool_oscillation = FunctionCodes { on: 302.1, off: 303.0 };
    mill
}

#[test]
fn oscillation_conditions_are_checked_with_their_fields() {
    let mut profile = profile_to_proto(&oscillating_mill());
    let [first, second] = profile.tool_oscillation.as_mut_slice() else { panic!("two conditions") };
    (first.period, first.axial) = (None, None);
    first.tables[2].quantity = 0;
    let width = proto::EngagementWidth { width_mm: 1.0, side: 0 };
    first.engagement = Some(proto::Engagement { kind: Some(proto::engagement::Kind::Width(width)) });
    second.name = "\n".to_owned();
    let fields: Vec<String> = from_proto(&profile).unwrap_err().into_iter().map(|(field, _)| field).collect();
    let field = |place: &str| format!("profile.tool_oscillation{place}");
    assert_eq!(
        fields,
        ["[0].period", "[0].axial", "[0].engagement.width.side", "[0].tables[2].quantity", "[1].name"].map(field)
    );

    let mut profile = profile_to_proto(&oscillating_mill());
    let [first, second] = profile.tool_oscillation.as_mut_slice() else { panic!("two conditions") };
    first.feed.as_mut().unwrap().amplitude_mm = f64::NAN;
    first.cross.as_mut().unwrap().waveform =
        Some(proto::Waveform { kind: Some(proto::waveform::Kind::HeldPeak(proto::HeldPeakWave { hold_share: 0.5 })) });
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
fn unset_fields_have_the_defaults_of_the_machine() {
    for default in [MachineProfile::lathe(), MachineProfile::mill()] {
        let machine = profile_to_proto(&default).machine;
        let sparse = proto::MachineProfile { machine, ..Default::default() };
        assert_eq!(from_proto(&sparse), Ok(default));
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
    profile.vibration.as_mut().unwrap().amplitude_follows_feed_up_to = Some(f64::NAN);
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
        "profile.vibration.amplitude_follows_feed_up_to",
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
