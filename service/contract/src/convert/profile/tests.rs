use feedwave_program::{
    BoringShift, DecimalPointRule, DrillingSettings, DrillingStyle, FunctionSwitch, LanguageSettings, PathControlMode,
    PeckReturn, ThreadEWord,
};

use super::functions::five_axis::tests::five_axis_mill;
use super::functions::tool_oscillation::tests::oscillating_mill;
use super::*;

/// The profile, or each violation as its field and description.
pub(in crate::convert) fn from_proto(profile: &proto::MachineProfile) -> Result<MachineProfile, Vec<(String, String)>> {
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
    lathe.language.drilling = DrillingSettings {
        style: DrillingStyle::Haas,
        chip_break_retract_mm: Some(0.3),
        peck_clearance_mm: Some(0.0),
        peck_lift_mm: 0.5,
        lathe_peck: Some(PeckReturn::Back),
        rigid_tapping: true,
        tap_peck: Some(PeckReturn::RLevel),
        boring_shift: Some(BoringShift::SecondMinus),
        lathe_r_is_level: true,
    };
    lathe.language.g_code_system = Some(feedwave_program::GCodeSystem::B);
    lathe.language.initial_motion = Some(feedwave_program::InitialMotion::Linear);
    lathe.language.turning = feedwave_program::TurningSettings {
        escape_mm: Some(0.5),
        groove_return_mm: Some(0.0),
        thread_chamfer_tenths: Some(12),
    };
    lathe.language.unlisted_machine_codes = feedwave_program::UnlistedMachineCodes::Error;
    lathe.language.input_result = 1.0;
    lathe.language.machine_codes = machine_codes();
    lathe.language.code_replacements =
        vec![feedwave_program::CodeReplacement { code: "M6".to_owned(), words: "G65 P9001".to_owned() }];
    lathe.language.contour_tolerances_mm[3] = 0.5;
    lathe.language.dwell_in_revolutions = true;
    lathe.language.plain_drawing_words = true;
    lathe.language.compensation.entry = feedwave_program::CompensationEntry::C;
    lathe.language.compensation.corner = feedwave_program::CompensationCorner::Circular;
    lathe.following.common.filter_length_s = Some(0.02);
    lathe.thinning.method = feedwave_cutting::thinning::ThinningMethod::Fitted;
    lathe.following.axes = vec![feedwave_cutting::AxisDrive {
        axis: Axis::X,
        drive: feedwave_cutting::DriveModel {
            filter_length_s: Some(0.004),
            position_loop_gain_per_s: Some(80.0),
            velocity_loop_frequency_hz: Some(60.0),
            velocity_loop_damping: Some(0.7),
            velocity_feed_forward: 0.9,
        },
    }];
    lathe.look_ahead_blocks = 100;
    lathe.plan_quality = PlanQuality::LeastTime;
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
    let language = lathe.language.as_mut().expect("it is stated");
    language.machine_codes.pop();
    let replaced = |code: &str, words: &str| proto::CodeReplacement { code: code.into(), words: words.into() };
    language.code_replacements = vec![replaced("M21", "M3 M8"), replaced("M98", "M3"), replaced("M6", "G65")];
    let expected = ["machine_codes[1].number", "code_replacements[1].code", "code_replacements[2].words"];
    assert_eq!(fields(&lathe), expected.map(|field| format!("profile.language.{field}")));
}

#[test]
fn codes_of_thinning_are_the_machines_own_without_five_axes() {
    let listed = |profile: &MachineProfile| {
        let mut profile = profile_to_proto(profile);
        let language = profile.language.as_mut().unwrap();
        language.thinning = Some(proto::FunctionCodes { on: 33.0, off: 34.0 });
        language.machine_codes = vec![proto::MachineCode { number: 33, ..Default::default() }];
        from_proto(&profile).map(|profile| profile.language)
    };
    for profile in [MachineProfile::mill(), MachineProfile::lathe()] {
        let language = listed(&profile).unwrap();
        assert_eq!((language.machine_codes.len(), language.thinning), (1, None));
        let (_, findings) = feedwave_program::interpret(b"M33\nM34\nM30\n", profile.language);
        let codes: Vec<_> = findings.findings().iter().map(|finding| finding.code.name()).collect();
        assert_eq!(codes, ["PRG-MACHINE-CODE"; 2]);
    }
    let mut five_axes = five_axis_mill();
    five_axes.language.thinning = LanguageSettings::mill().thinning;
    assert_eq!(listed(&five_axes).unwrap_err()[0].0, "profile.language.machine_codes[0].number");
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
