//! The machine profile: everything the product knows about one machine.

use feedwave_motion::kinematics::KinematicsDescription;
use feedwave_motion::{CornerSpeed, Machine, PlannerSettings, ProfileProblem};
use feedwave_program::{
    Axis, LanguageSettings, MAX_PATH_TOLERANCE_MM, code_replacement_problems, machine_code_problems,
};
use serde::{Deserialize, Serialize};

use crate::functions::path_vibration::{MIN_FREQUENCY_HZ, VibrationSettings};
use crate::functions::thinning::ThinningSettings;
use crate::functions::thread::ThreadVibrationSettings;
use crate::functions::tool_oscillation::{FloorSettings, NamedCondition, condition_problems};
use crate::shared::checks::MAX_BLOCK_DURATION_S;
use crate::shared::following::FollowingModel;
use crate::shared::track::MAX_AMPLITUDE_MM;

/// Largest limit of executed blocks.
const MAX_BLOCKS: u64 = 1_000_000_000;

/// One machine: how its programs are written, its axes and their limits, and its machining functions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MachineProfile {
    /// How programs for it are written.
    pub language: LanguageSettings,
    /// Axes, limits and kinematics.
    pub machine: Machine,
    /// Vibration along the path.
    #[serde(default)]
    pub vibration: VibrationSettings,
    /// Threads and their vibration.
    #[serde(default)]
    pub thread_vibration: ThreadVibrationSettings,
    /// Conditions of tool oscillation that a program chooses by number.
    #[serde(default)]
    pub tool_oscillation: Vec<NamedCondition>,
    /// How the floor that they leave is simulated for the report.
    #[serde(default)]
    pub oscillation_floor: FloorSettings,
    /// What lies between setpoints and tool.
    #[serde(default)]
    pub following: FollowingModel,
    /// The arrangement of its five axes; without it, tool centre point control is refused.
    #[serde(default)]
    pub kinematics: Option<KinematicsDescription>,
    /// Angle to the line of the first rotary axis within which the tool direction may be bent to lead through it, degrees,
    /// 0 to [`MAX_POLE_TOLERANCE_DEG`]; for programs with direction vectors.
    #[serde(default)]
    pub pole_tolerance_deg: f64,
    /// Largest angle between the programmed tool direction and the one that is taken where `G64` rounds a corner or makes one curve of
    /// short blocks under tool centre point control, degrees, 0 to [`MAX_CORNER_DIRECTION_TOLERANCE_DEG`]; with 0 corners at which the
    /// tool turns otherwise stay.
    #[serde(default = "default_corner_direction_tolerance_deg")]
    pub corner_direction_tolerance_deg: f64,
    /// Thinning of five-axis blocks.
    #[serde(default)]
    pub thinning: ThinningSettings,
    /// Largest feed override that operators and monitoring may use on this machine, as a factor, 1 to
    /// [`MAX_OVERRIDE_RATIO`]: whether a chip breaks is judged up to it. A plan that states a higher one is judged at that.
    #[serde(default = "default_max_feed_override")]
    pub max_feed_override: f64,
    /// Elements that the feed is planned ahead: [`MIN_LOOK_AHEAD_BLOCKS`] to [`MAX_LOOK_AHEAD_BLOCKS`].
    #[serde(default = "default_look_ahead_blocks")]
    pub look_ahead_blocks: u32,
    /// How the speed along the path is planned.
    #[serde(default)]
    pub plan_quality: PlanQuality,
}

/// How the speed along the path is planned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanQuality {
    /// In runs under one set of limits: at little cost, and slower on corners, curves and short blocks.
    Fast,
    /// Close to the least time, with the limits of the axes place by place.
    #[default]
    LeastTime,
}

impl MachineProfile {
    /// Settings of a planner for this machine at an interpolation period.
    #[must_use]
    pub fn planner_settings(&self, period_s: f64) -> PlannerSettings {
        let settings = PlannerSettings::new(&self.machine, self.look_ahead_blocks as usize, period_s);
        match self.plan_quality {
            PlanQuality::Fast => settings,
            PlanQuality::LeastTime => settings.for_least_time(&self.machine),
        }
    }

    /// How the speed along the path behaves at corners.
    #[must_use]
    pub const fn corner_speed(&self) -> CornerSpeed {
        match self.plan_quality {
            PlanQuality::Fast => CornerSpeed::Steady,
            PlanQuality::LeastTime => CornerSpeed::Changing,
        }
    }

    /// The letters of its axes.
    fn machine_letters(&self) -> Vec<Axis> {
        self.machine.axes.iter().map(|axis| axis.axis).collect()
    }

    /// A generic two-axis lathe.
    #[must_use]
    pub fn lathe() -> Self {
        Self {
            language: LanguageSettings::default(),
            machine: Machine::lathe(),
            vibration: VibrationSettings::default(),
            thread_vibration: ThreadVibrationSettings::default(),
            tool_oscillation: Vec::new(),
            oscillation_floor: FloorSettings::default(),
            following: FollowingModel::default(),
            kinematics: None,
            pole_tolerance_deg: 0.0,
            corner_direction_tolerance_deg: DEFAULT_CORNER_DIRECTION_TOLERANCE_DEG,
            thinning: ThinningSettings::default(),
            max_feed_override: DEFAULT_MAX_FEED_OVERRIDE,
            look_ahead_blocks: DEFAULT_LOOK_AHEAD_BLOCKS,
            plan_quality: PlanQuality::default(),
        }
    }

    /// A generic three-axis mill.
    #[must_use]
    pub fn mill() -> Self {
        let language = LanguageSettings { thinning: None, ..LanguageSettings::mill() };
        Self { language, machine: Machine::mill(), ..Self::lathe() }
    }

    /// Everything that makes the profile unusable, each with the path of the field; empty when it is valid.
    #[must_use]
    pub fn problems(&self) -> Vec<ProfileProblem> {
        let mut problems = prefixed("machine", self.machine.validate());
        problems.extend(prefixed("language", language_problems(&self.language)));
        problems.extend(prefixed("vibration", vibration_problems(&self.vibration)));
        problems.extend(prefixed("thread_vibration", self.thread_vibration.problems()));
        problems.extend(condition_problems(&self.tool_oscillation));
        problems.extend(prefixed("oscillation_floor", self.oscillation_floor.problems()));
        problems.extend(prefixed("following", self.following.problems(&self.machine_letters())));
        problems.extend(prefixed("thinning", self.thinning.validate()));
        if let Some(kinematics) = &self.kinematics {
            problems.extend(prefixed("kinematics", kinematics_problems(kinematics, &self.machine)));
        }
        if !(0.0..=MAX_POLE_TOLERANCE_DEG).contains(&self.pole_tolerance_deg) {
            let message = format!("must lie between 0 and {MAX_POLE_TOLERANCE_DEG}, is {}", self.pole_tolerance_deg);
            problems.push(problem("pole_tolerance_deg", message));
        }
        let tolerance_deg = self.corner_direction_tolerance_deg;
        if !(0.0..=MAX_CORNER_DIRECTION_TOLERANCE_DEG).contains(&tolerance_deg) {
            let message = format!("must lie between 0 and {MAX_CORNER_DIRECTION_TOLERANCE_DEG}, is {tolerance_deg}");
            problems.push(problem("corner_direction_tolerance_deg", message));
        }
        if !(1.0..=MAX_OVERRIDE_RATIO).contains(&self.max_feed_override) {
            let message = format!("must lie between 1 and {MAX_OVERRIDE_RATIO}, is {}", self.max_feed_override);
            problems.push(problem("max_feed_override", message));
        }
        if !(MIN_LOOK_AHEAD_BLOCKS..=MAX_LOOK_AHEAD_BLOCKS).contains(&self.look_ahead_blocks) {
            let blocks = self.look_ahead_blocks;
            let message = format!("must be {MIN_LOOK_AHEAD_BLOCKS} to {MAX_LOOK_AHEAD_BLOCKS}, is {blocks}");
            problems.push(problem("look_ahead_blocks", message));
        }
        problems
    }
}

fn prefixed(prefix: &str, problems: Vec<ProfileProblem>) -> Vec<ProfileProblem> {
    problems
        .into_iter()
        .map(|problem| ProfileProblem { field: format!("{prefix}.{}", problem.field), ..problem })
        .collect()
}

fn problem(field: impl Into<String>, message: impl Into<String>) -> ProfileProblem {
    ProfileProblem { field: field.into(), message: message.into() }
}

fn require_positive(problems: &mut Vec<ProfileProblem>, field: &str, value: f64) {
    if !(value.is_finite() && value > 0.0) {
        problems.push(problem(field, format!("must be a positive finite number, is {value}")));
    }
}

fn language_problems(language: &LanguageSettings) -> Vec<ProfileProblem> {
    let mut problems = Vec::new();
    position_problems(language, &mut problems);
    let codes = machine_code_problems(language).into_iter().chain(code_replacement_problems(language));
    problems.extend(codes.map(|(field, message)| problem(&field, message)));
    require_positive(&mut problems, "arc_radius_tolerance_mm", language.arc_radius_tolerance_mm);
    length_problems(language, &mut problems);
    if !language.input_result.is_finite() {
        problems.push(problem("input_result", "must be finite"));
    }
    if !matches!(language.program_number_digits, 4 | 8) {
        problems
            .push(problem("program_number_digits", format!("must be 4 or 8, is {}", language.program_number_digits)));
    }
    for (name, blocks) in
        [("max_executed_blocks", language.max_executed_blocks), ("max_still_blocks", language.max_still_blocks)]
    {
        if !(1..=MAX_BLOCKS).contains(&blocks) {
            problems.push(problem(name, format!("must be 1 to {MAX_BLOCKS}, is {blocks}")));
        }
    }
    if !(64..=65_536).contains(&language.max_line_bytes) {
        problems.push(problem("max_line_bytes", format!("must be 64 to 65536, is {}", language.max_line_bytes)));
    }
    code_problems(language, &mut problems);
    problems
}

/// What is wrong with positions and offsets.
fn position_problems(language: &LanguageSettings, problems: &mut Vec<ProfileProblem>) {
    let positions = language.work_offsets.iter().enumerate().map(|(index, p)| (format!("work_offsets[{index}]"), p));
    let positions = positions.chain([
        ("coordinates.external_offset".to_owned(), &language.coordinates.external_offset),
        ("reference_position".to_owned(), &language.reference_position),
        ("initial_position".to_owned(), &language.initial_position),
    ]);
    let systems = language.coordinates.systems.iter();
    let systems = systems.map(|(system, place)| (format!("coordinates.systems[{system}]"), &place.offset));
    let more = language.coordinates.more_reference_positions.iter().flatten();
    let more = more.map(|position| ("coordinates.more_reference_positions".to_owned(), position));
    for (field, position) in positions.chain(systems).chain(more) {
        if let Some(axis) = Axis::ALL.into_iter().find(|axis| !position[axis.index()].is_finite()) {
            problems.push(problem(format!("{field}.{}", axis.letter().to_ascii_lowercase()), "must be finite"));
        }
    }
}

/// What is wrong with tolerances, and with the lengths of cycles.
fn length_problems(language: &LanguageSettings, problems: &mut Vec<ProfileProblem>) {
    let tolerance_mm = language.default_path_tolerance_mm;
    if !(0.0..=MAX_PATH_TOLERANCE_MM).contains(&tolerance_mm) {
        let message = format!("must lie between 0 and {MAX_PATH_TOLERANCE_MM}, is {tolerance_mm}");
        problems.push(problem("default_path_tolerance_mm", message));
    }
    for (level, tolerance_mm) in language.contour_tolerances_mm.iter().enumerate() {
        if !(0.0..=MAX_PATH_TOLERANCE_MM).contains(tolerance_mm) {
            let message = format!("must lie between 0 and {MAX_PATH_TOLERANCE_MM}, is {tolerance_mm}");
            problems.push(problem(format!("contour_tolerances_mm[{level}]"), message));
        }
    }
    let drilling = &language.drilling;
    for (field, length_mm) in [
        ("drilling.chip_break_retract_mm", drilling.chip_break_retract_mm),
        ("drilling.peck_clearance_mm", drilling.peck_clearance_mm),
        ("drilling.peck_lift_mm", Some(drilling.peck_lift_mm)),
        ("turning.escape_mm", language.turning.escape_mm),
        ("turning.groove_return_mm", language.turning.groove_return_mm),
    ] {
        if let Some(length_mm) = length_mm.filter(|length_mm| !(0.0..=MAX_PECK_RETRACT_MM).contains(length_mm)) {
            problems.push(problem(field, format!("must lie between 0 and {MAX_PECK_RETRACT_MM}, is {length_mm}")));
        }
    }
    if let Some(tenths) = language.turning.thread_chamfer_tenths.filter(|tenths| *tenths > MAX_CHAMFER_TENTHS) {
        problems
            .push(problem("turning.thread_chamfer_tenths", format!("must be 0 to {MAX_CHAMFER_TENTHS}, is {tenths}")));
    }
}

/// What is wrong with the codes that switch the machining functions.
fn code_problems(language: &LanguageSettings, problems: &mut Vec<ProfileProblem>) {
    let (codes, oscillation, switch) = (language.path_vibration, language.tool_oscillation, language.thread_vibration);
    let fields = [
        ("path_vibration.on", codes.on),
        ("path_vibration.off", codes.off),
        ("tool_oscillation.on", oscillation.on),
        ("tool_oscillation.off", oscillation.off),
        ("thread_vibration.code", switch.code),
    ];
    for (index, &(field, code)) in fields.iter().enumerate() {
        let tenths = code * 10.0;
        if !((0.0..1_000.0).contains(&code) && (tenths - tenths.round()).abs() < 1e-6) {
            problems.push(problem(field, format!("must be a G code 0 to 999.9 with one decimal, is {code}")));
        } else if language.carries_out_g_code(code) {
            problems.push(problem(field, format!("G{code} has a meaning of its own in this dialect")));
        }
        if let Some((other, _)) = fields[..index].iter().find(|(_, earlier)| *earlier == code) {
            problems.push(problem(field, format!("must differ from {other}, which is G{code} too")));
        }
    }
    for (field, word) in [("thread_vibration.on_p", switch.on_p), ("thread_vibration.off_p", switch.off_p)] {
        if word > MAX_SWITCH_WORD {
            problems.push(problem(field, format!("must be 0 to {MAX_SWITCH_WORD}, is {word}")));
        }
    }
    if switch.on_p == switch.off_p {
        problems.push(problem("thread_vibration.off_p", "must differ from the word that switches it on"));
    }
    let Some(codes) = language.thinning else { return };
    for (field, code) in [("thinning.on", codes.on), ("thinning.off", codes.off)] {
        let tenths = code * 10.0;
        if !((0.0..1_000.0).contains(&code) && (tenths - tenths.round()).abs() < 1e-6) {
            problems.push(problem(field, format!("must be an M code 0 to 999.9 with one decimal, is {code}")));
        } else if language.dialect.knows_m_code(code) {
            problems.push(problem(field, format!("M{code} has a meaning of its own in this dialect")));
        }
    }
    if codes.on == codes.off {
        problems.push(problem("thinning.off", "must differ from the code that switches it on"));
    }
}

/// What is wrong with the kinematics, by itself and for these axes.
fn kinematics_problems(kinematics: &KinematicsDescription, machine: &Machine) -> Vec<ProfileProblem> {
    let mut problems = kinematics.validate();
    if !problems.is_empty() {
        return problems;
    }
    for (index, axis) in kinematics.chain.iter().enumerate() {
        let letter = axis.axis.letter();
        let field = format!("chain[{index}].axis");
        if !axis.axis.is_rotary() && !matches!(axis.axis, Axis::X | Axis::Y | Axis::Z) {
            problems.push(problem(field, format!("must be X, Y or Z where the axis is linear, is {letter}")));
        } else if machine.column_of(axis.axis).is_none() {
            problems.push(problem(field, format!("the machine has no {letter} axis")));
        }
    }
    problems
}

fn vibration_problems(vibration: &VibrationSettings) -> Vec<ProfileProblem> {
    let mut problems = Vec::new();
    require_positive(&mut problems, "max_frequency_hz", vibration.max_frequency_hz);
    require_positive(&mut problems, "max_amplitude_mm", vibration.max_amplitude_mm);
    require_positive(&mut problems, "contour_tolerance_mm", vibration.contour_tolerance_mm);
    if vibration.max_frequency_hz > 0.0 && vibration.max_frequency_hz < MIN_FREQUENCY_HZ {
        problems.push(problem("max_frequency_hz", format!("must be at least {MIN_FREQUENCY_HZ} Hz")));
    }
    if vibration.max_amplitude_mm > MAX_AMPLITUDE_MM {
        problems.push(problem("max_amplitude_mm", format!("must not exceed {MAX_AMPLITUDE_MM} mm")));
    }
    if !(1..=MAX_SERVO_SUBSTEPS).contains(&vibration.servo_substeps) {
        problems.push(problem("servo_substeps", format!("must be 1 to {MAX_SERVO_SUBSTEPS}")));
    }
    if vibration.amplitude_follows_feed_up_to.is_some_and(|ratio| !(1.0..=MAX_OVERRIDE_RATIO).contains(&ratio)) {
        problems.push(problem("amplitude_follows_feed_up_to", format!("must be 1 to {MAX_OVERRIDE_RATIO}")));
    }
    problems
}

/// Largest tolerance within which the tool direction may be bent to lead through a pole, degrees.
pub const MAX_POLE_TOLERANCE_DEG: f64 = 5.0;
/// Largest angle between the programmed tool direction and the one that is taken at a corner or in a curve, degrees.
pub const MAX_CORNER_DIRECTION_TOLERANCE_DEG: f64 = 5.0;
/// A tenth of a degree moves the flank of a tool by 0.02 mm in 10 mm: less than is left for finishing.
const DEFAULT_CORNER_DIRECTION_TOLERANCE_DEG: f64 = 0.1;
/// Largest retract between pecks, mm.
const MAX_PECK_RETRACT_MM: f64 = 100.0;

/// Longest chamfer of a thread, tenths of its lead.
const MAX_CHAMFER_TENTHS: u32 = 127;
/// Largest `P` word that switches a machining function.
const MAX_SWITCH_WORD: u32 = 9_999;
/// Most drive-side setpoints per interpolation period.
pub const MAX_SERVO_SUBSTEPS: u32 = 64;
/// Lowest ratio of the feed override but for 0, which holds the feed: the step of the switch of common controls. At a ratio r a program
/// takes 1/r of its time and has as many more setpoints, so there is a lowest one.
pub const MIN_OVERRIDE_RATIO: f64 = 0.01;
/// Highest ratio of the feed override.
pub const MAX_OVERRIDE_RATIO: f64 = 2.0;
/// Longest hold of the feed that a plan is validated with, s: as long as a block may take.
pub const MAX_HOLD_S: f64 = MAX_BLOCK_DURATION_S;

/// Whether the feed override can have this ratio: 0, which holds the feed, or [`MIN_OVERRIDE_RATIO`] to [`MAX_OVERRIDE_RATIO`].
#[must_use]
pub fn is_override_ratio(ratio: f64) -> bool {
    ratio == 0.0 || (MIN_OVERRIDE_RATIO..=MAX_OVERRIDE_RATIO).contains(&ratio)
}

/// Default bound of monitoring, and the common end of a machine's override switch.
const DEFAULT_MAX_FEED_OVERRIDE: f64 = 1.5;
/// Fewest elements looked ahead.
pub const MIN_LOOK_AHEAD_BLOCKS: u32 = 4;
/// Most elements looked ahead: bounds the memory of a plan, and the size of its snapshots.
pub const MAX_LOOK_AHEAD_BLOCKS: u32 = 100_000;
/// Elements looked ahead where the profile does not say.
const DEFAULT_LOOK_AHEAD_BLOCKS: u32 = 5_000;

const fn default_corner_direction_tolerance_deg() -> f64 {
    DEFAULT_CORNER_DIRECTION_TOLERANCE_DEG
}

const fn default_max_feed_override() -> f64 {
    DEFAULT_MAX_FEED_OVERRIDE
}

const fn default_look_ahead_blocks() -> u32 {
    DEFAULT_LOOK_AHEAD_BLOCKS
}

#[cfg(test)]
mod tests {
    use feedwave_program::{FunctionCodes, FunctionSwitch};

    use super::*;

    #[test]
    fn codes_of_threads_are_the_dialect_s_own() {
        let mut profile = MachineProfile::lathe();
        for code in [32.0, 33.0, 76.0, 92.0] {
            profile.language.thread_vibration.code = code;
            let fields: Vec<String> = profile.problems().into_iter().map(|problem| problem.field).collect();
            assert_eq!(fields, ["language.thread_vibration.code"], "G{code}");
        }
    }

    #[test]
    fn every_problem_is_named_with_its_field() {
        let mut profile = MachineProfile::lathe();
        assert!(profile.problems().is_empty() && MachineProfile::mill().problems().is_empty());
        profile.language.path_vibration.on = 1.0;
        profile.language.path_vibration.off = 200.55;
        profile.language.thread_vibration = FunctionSwitch { code: 200.55, on_p: 10_000, off_p: 10_000 };
        profile.language.max_line_bytes = 1;
        profile.language.default_path_tolerance_mm = f64::NAN;
        profile.language.drilling.peck_lift_mm = -1.0;
        profile.language.turning.escape_mm = Some(f64::NAN);
        profile.language.turning.thread_chamfer_tenths = Some(128);
        profile.language.work_offsets[2][1] = f64::NAN;
        profile.language.thinning = Some(FunctionCodes { on: 8.0, off: f64::NAN });
        profile.thinning.group_blocks = 2;
        profile.vibration.max_amplitude_mm = 11.0;
        profile.vibration.servo_substeps = 0;
        profile.vibration.amplitude_follows_feed_up_to = Some(0.9);
        profile.thread_vibration.vibrations_per_rev = f64::NAN;
        profile.following.common.filter_length_s = Some(-1.0);
        profile.pole_tolerance_deg = 6.0;
        profile.machine.max_spindle_rev_per_min = 0.0;
        profile.max_feed_override = 0.9;
        profile.look_ahead_blocks = 3;
        let fields: Vec<String> = profile.problems().into_iter().map(|problem| problem.field).collect();
        let expected = [
            "machine.max_spindle_rev_per_min",
            "language.work_offsets[2].y",
            "language.default_path_tolerance_mm",
            "language.drilling.peck_lift_mm",
            "language.turning.escape_mm",
            "language.turning.thread_chamfer_tenths",
            "language.max_line_bytes",
            "language.path_vibration.on",
            "language.path_vibration.off",
            "language.thread_vibration.code",
            "language.thread_vibration.code",
            "language.thread_vibration.on_p",
            "language.thread_vibration.off_p",
            "language.thread_vibration.off_p",
            "language.thinning.on",
            "language.thinning.off",
            "vibration.max_amplitude_mm",
            "vibration.servo_substeps",
            "vibration.amplitude_follows_feed_up_to",
            "thread_vibration.vibrations_per_rev",
            "following.filter_length_s",
            "thinning.group_blocks",
            "pole_tolerance_deg",
            "max_feed_override",
            "look_ahead_blocks",
        ];
        assert_eq!(fields, expected);
    }
}
