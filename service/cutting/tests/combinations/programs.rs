//! Programs with one machining function, and with what else may be on at the same time.

use std::fmt::Write as _;

use feedwave_cutting::thinning::{ThinningMethod, ThinningSettings};
use feedwave_cutting::thread::StartUp;
use feedwave_cutting::tool_oscillation::{
    DirectionOscillation, Engagement, LeadingEdge, NamedCondition, OscillationCondition, OscillationPeriod,
    ToolGeometry, Waveform,
};
use feedwave_cutting::{MachineProfile, PipelineConfig, PlanQuality, Tool};
use feedwave_motion::kinematics::KinematicsDescription;
use feedwave_motion::kinematics::vector::Vec3;
use feedwave_program::{Axis, TiltedPlane};

use crate::common::machines::{config_of, direction_at, kinds, kinematics};

/// The five functions, and programs of several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    PathVibration,
    ToolOscillation,
    Thread,
    FiveAxis,
    Thinning,
    /// Several in one program: vibration, drilling cycles and oscillation on a mill, vibration and a thread on a lathe, a tilted plane
    /// with vibration and a drilling cycle before a guided cut with thinning and vibration in five axes.
    Several,
}

/// A kind of machine.
#[derive(Clone, Debug)]
pub enum Kind {
    Lathe,
    Mill,
    FiveAxis(&'static str, KinematicsDescription),
}

/// What a program is made of.
#[derive(Clone, Debug)]
pub struct Numbers {
    /// Each between -1 and 1.
    pub values: Vec<f64>,
    pub flags: [bool; 4],
    pub quality: PlanQuality,
}

impl Numbers {
    /// A number of the range.
    fn at(&self, index: usize, low: f64, high: f64) -> f64 {
        let share = 0.5 + 0.5 * self.values[index % self.values.len()];
        ((low + (high - low) * share) * 1e3).round() / 1e3
    }
}

/// A place that the path comes through.
#[derive(Clone, Debug)]
pub enum End {
    /// Columns and their values.
    Axes(Vec<(usize, f64)>),
    /// Tool centre point, work coordinates, mm.
    Tip(Vec3),
}

/// A program on a machine.
pub struct Case {
    pub name: String,
    pub config: PipelineConfig,
    pub program: String,
    pub ends: Vec<End>,
    /// Share by which the jerk may be more than its limit; `None` where it has none.
    jerk: Option<f64>,
}

impl Case {
    /// Share by which a derivative may be more than its limit; `None` where nothing is promised.
    pub fn tolerance(&self, order: i32) -> Option<f64> {
        if order == 3 { self.jerk } else { Some(1e-6) }
    }
}

impl Function {
    /// The machines that can do it.
    pub fn machines(self) -> Vec<Kind> {
        let five_axes = kinds().into_iter().map(|(name, description)| Kind::FiveAxis(name, description));
        match self {
            Self::PathVibration => [Kind::Lathe, Kind::Mill].into_iter().chain(five_axes).collect(),
            Self::ToolOscillation => [Kind::Mill].into_iter().chain(five_axes).collect(),
            Self::Thread => vec![Kind::Lathe],
            Self::FiveAxis | Self::Thinning => five_axes.collect(),
            // Planes need a tool along Z.
            Self::Several => {
                let upright = |kind: &Kind| !matches!(kind, Kind::FiveAxis(_, description) if description.tool_direction != [0.0, 0.0, 1.0]);
                [Kind::Lathe, Kind::Mill].into_iter().chain(five_axes).filter(upright).collect()
            }
        }
    }

    pub fn case(self, kind: &Kind, numbers: &Numbers) -> Case {
        let mut case = match (self, kind) {
            (Self::Thread, _) => thread(numbers),
            (Self::PathVibration, Kind::Lathe) => turned(numbers),
            (Self::PathVibration, Kind::Mill) => milled(numbers),
            (Self::ToolOscillation, Kind::Mill) => oscillating(numbers),
            (Self::Several, Kind::Lathe) => turned_and_threaded(numbers),
            (Self::Several, Kind::Mill) => milled_with_all(numbers),
            (Self::Several, Kind::FiveAxis(name, description)) => plane_and_guided(name, description.clone(), numbers),
            (function, Kind::FiveAxis(name, description)) => guided(function, name, description.clone(), numbers),
            (function, kind) => unreachable!("{function:?} on {kind:?}"),
        };
        case.config.profile.plan_quality = numbers.quality;
        case
    }
}

/// Frequency, Hz, and amplitude, mm, of a vibration that leaves an axis of the generic machines most of its limits.
fn vibration(numbers: &Numbers, config: &PipelineConfig) -> [f64; 2] {
    let frequency_hz = numbers.at(30, 12.0, 60.0).round();
    let omega = std::f64::consts::TAU * frequency_hz;
    let most = |axis: &feedwave_motion::MachineAxis| {
        (axis.max_acceleration_per_s2 / omega.powi(2)).min(axis.max_jerk_per_s3 / omega.powi(3))
    };
    let most_mm = config.profile.machine.axes.iter().map(most).fold(f64::INFINITY, f64::min);
    [frequency_hz, ((most_mm * numbers.at(31, 0.05, 0.35) * 1e4).floor() / 1e4).max(1e-3)]
}

/// Turning with vibration: a cylinder, a taper, an arc, a face.
fn turned(numbers: &Numbers) -> Case {
    let config = PipelineConfig::new(MachineProfile::lathe());
    let [frequency_hz, amplitude_mm] = vibration(numbers, &config);
    let feed = numbers.at(1, 0.03, 0.12);
    let z = [-numbers.at(2, 3.0, 12.0), -numbers.at(3, 14.0, 20.0)];
    let x = 2.0 * numbers.at(4, 16.0, 20.0);
    let mut program = format!("G21 S{} M3\nG0 X30 Z2\n", numbers.at(0, 400.0, 1_500.0).round());
    let _ = writeln!(program, "G200 F{frequency_hz} A{amplitude_mm}\nG1 Z{} F{feed}\nX{x} Z{}", z[0], z[1]);
    if numbers.flags[0] {
        let _ = writeln!(program, "G2 X{} Z{} R4", x + 4.0, z[1] - 2.0);
    }
    program += "G201\nG0 X60\nZ10\nM30\n";
    let mut ends = vec![End::Axes(vec![(0, 30.0), (1, 10.0)])];
    if !numbers.flags[0] {
        ends.push(End::Axes(vec![(0, 0.5 * x), (1, z[1])]));
    }
    Case { name: "turning with vibration".to_owned(), config, program, ends, jerk: Some(1e-6) }
}

/// Milling with vibration along lines and arcs.
fn milled(numbers: &Numbers) -> Case {
    let config = PipelineConfig::new(MachineProfile::mill());
    let [frequency_hz, amplitude_mm] = vibration(numbers, &config);
    let [x, y] = [numbers.at(1, 5.0, 30.0), numbers.at(2, -20.0, 20.0)];
    let radius = numbers.at(3, 4.0, 12.0);
    let feed = numbers.at(4, 200.0, 900.0);
    let program = format!(
        "G21 G90 G17 M3 S3000\nG0 X0 Y0 Z5\nG1 Z-1 F300\nG200 F{frequency_hz} A{amplitude_mm}\nG1 X{x} Y{y} F{feed}\n\
         G3 X{} Y{y} R{radius}\nX{} R{radius}\nG201\nG0 Z20\nM30\n",
        x + 2.0 * radius,
        x + 4.0 * radius,
    );
    let ends = vec![
        End::Axes(vec![(0, x + 4.0 * radius), (1, y), (2, -1.0)]),
        End::Axes(vec![(0, x + 4.0 * radius), (1, y), (2, 20.0)]),
    ];
    Case { name: "milling with vibration".to_owned(), config, program, ends, jerk: Some(1e-6) }
}

/// A cutter with oscillation words, whose waveforms have a bounded jerk.
fn with_oscillation(config: &mut PipelineConfig, numbers: &Numbers) {
    let direction = |amplitude_mm, waveform| DirectionOscillation { amplitude_mm, waveform, phase_deg: 0.0 };
    let condition = OscillationCondition {
        period: OscillationPeriod::PerRevolution(1),
        feed: direction(numbers.at(32, 0.05, 0.4), Waveform::Sine),
        axial: direction(numbers.at(33, 0.005, 0.03), Waveform::JerkLimitedHeldPeak { hold_share: 0.3 }),
        cross: None,
        leading_edge: LeadingEdge::default(),
        ramp_periods: 2,
        may_overrun: false,
        engagement: Engagement::Slot,
    };
    let named = NamedCondition { name: "face".to_owned(), number: 1, tools: Vec::new(), condition, tables: Vec::new() };
    config.profile.tool_oscillation = vec![named];
    if config.tools.is_empty() {
        config.tools.push(Tool { number: 1, ..Tool::default() });
    }
    config.tools[0].geometry = Some(ToolGeometry::even(4, 60.0, 1.5, 5.0));
}

/// Milling a floor with an oscillating tool.
fn oscillating(numbers: &Numbers) -> Case {
    let mut config = PipelineConfig::new(MachineProfile::mill());
    with_oscillation(&mut config, numbers);
    let [x, y] = [numbers.at(1, 10.0, 30.0), numbers.at(2, -20.0, 20.0)];
    let radius = numbers.at(3, 15.0, 30.0);
    let program = format!(
        "T1 M6\nG21 G90 G17 M3 S{}\nG0 X0 Y0 Z5\nG1 Z-1 F300\nG202 P1 D1\nG1 X{x} Y{y} F{}\nG3 X{} Y{y} R{radius}\nG203\n\
         G0 Z20\nM30\n",
        numbers.at(4, 300.0, 600.0).round(),
        numbers.at(5, 100.0, 250.0),
        x + 2.0 * radius,
    );
    let ends = vec![
        End::Axes(vec![(0, x + 2.0 * radius), (1, y), (2, -1.0)]),
        End::Axes(vec![(0, x + 2.0 * radius), (1, y), (2, 20.0)]),
    ];
    Case { name: "milling with oscillation".to_owned(), config, program, ends, jerk: Some(1e-6) }
}

/// A vibrating thread on a cylinder, a taper or a face.
fn thread(numbers: &Numbers) -> Case {
    let mut config = PipelineConfig::new(MachineProfile::lathe());
    let settings = &mut config.profile.thread_vibration;
    settings.start_up = if numbers.flags[0] { StartUp::Delayed } else { StartUp::Preparatory };
    settings.combined_preparation = numbers.flags[1];
    let on_face = numbers.flags[2];
    let mut program = format!("G97 S{} M3\n", numbers.at(0, 100.0, 500.0).round());
    let lead_mm = numbers.at(1, 1.5, 4.0);
    program += if on_face { "G0 X80. Z5.\nG165 P3 Z0. Q1.3\n" } else { "G0 X36. Z10.\nG165 P3 X30. Q1.3\n" };
    let (mut depth_mm, mut ends) = (0.0, Vec::new());
    for pass in 0..3 {
        depth_mm += numbers.at(2 + pass, 0.02, 0.15);
        let shift_mm = numbers.at(6 + pass, -0.3, 0.3);
        let start_deg = if numbers.flags[3] { numbers.at(10 + pass, 0.0, 300.0) } else { 0.0 };
        let taper_mm = numbers.at(14, 0.0, 0.8);
        if on_face {
            let _ = writeln!(program, "G0 X{:.3}\nG0 Z{:.4}", 80.0 + shift_mm, -depth_mm);
            let _ = writeln!(program, "G32 X20. Z{:.4} F{lead_mm} Q{start_deg}\nG0 Z5.\nG0 X80.", taper_mm - depth_mm);
            ends.push(End::Axes(vec![(0, 10.0)]));
        } else {
            let x_mm = 30.0 - 2.0 * depth_mm;
            let _ = writeln!(program, "G0 Z{:.3}\nG0 X{x_mm:.4}", 10.0 + shift_mm);
            let _ = writeln!(program, "G32 X{:.4} Z-15. F{lead_mm} Q{start_deg}\nG0 X36.", x_mm + taper_mm);
            ends.push(End::Axes(vec![(1, -15.0)]));
        }
    }
    program += "G165 P0\nG0 X90. Z20.\nM30\n";
    ends.push(End::Axes(vec![(0, 45.0), (1, 20.0)]));
    // The rate of the wave's phase rises from rest by 1.3 % more jerk than the wave has.
    Case { name: "thread".to_owned(), config, program, ends, jerk: Some(0.014) }
}

/// Cuts of a guided tool, with the function and perhaps another one on.
// As long as the program that it writes.
fn guided(function: Function, name: &str, description: KinematicsDescription, numbers: &Numbers) -> Case {
    let mut config = config_of(description);
    let letters = kinematics(&config).letters().1.map(Axis::letter);
    let [l, m] = letters;
    let oscillates = function == Function::ToolOscillation;
    if oscillates {
        with_oscillation(&mut config, numbers);
    }
    let method = if numbers.flags[1] { ThinningMethod::Fitted } else { ThinningMethod::Published };
    config.profile.thinning = ThinningSettings { group_blocks: 20, method, ..ThinningSettings::default() };
    let vibrates = function == Function::PathVibration || function == Function::Thinning && numbers.flags[2];
    let mut program = String::from("T1 M6\nG21 G90 M3 S600\nG43.4 H1\n");
    let _ = writeln!(program, "G0 X0 Y0 Z20 {l}10 {m}-20");
    if function == Function::FiveAxis {
        program += if numbers.flags[0] { "G64 P0.02\n" } else { "G61\n" };
    }
    if function == Function::Thinning {
        program += "M33\n";
    }
    if vibrates {
        let _ = writeln!(program, "G200 F{} A{}", numbers.at(30, 3.0, 8.0), numbers.at(31, 0.005, 0.03));
    }
    if oscillates {
        program += "G202 P1 D1\n";
    }
    // The coordinate axes by how far they are across the tool: an oscillating tool cannot plunge.
    let tool = direction_at(&config, [12.0, -22.0]);
    let mut across = [0, 1, 2];
    across.sort_by(|&a, &b| tool[a].abs().total_cmp(&tool[b].abs()));
    let (blocks, step_mm, flicker_deg) = match function {
        Function::Thinning => (30, 0.8, 0.3),
        Function::ToolOscillation => (1, 30.0, 0.0),
        _ => (4, 8.0, 0.0),
    };
    let (mut tip_mm, mut rotary_deg) = ([0.0, 0.0, 20.0], [10.0, -20.0]);
    for block in 0..blocks {
        tip_mm[across[0]] += step_mm;
        tip_mm[across[1]] += 0.2 * step_mm * numbers.values[(2 + block) % 20];
        if !oscillates {
            tip_mm[across[2]] += 0.2 * step_mm * numbers.values[(5 + block) % 20];
        }
        for (axis, rotary_deg) in rotary_deg.iter_mut().enumerate() {
            let side = if block % 2 == 0 { flicker_deg } else { -flicker_deg };
            *rotary_deg += 0.1 * step_mm * numbers.values[(20 + 3 * axis + block) % 30] + side;
        }
        let [x, y, z] = tip_mm;
        let feed = if block == 0 { format!(" F{}", numbers.at(4, 300.0, 900.0)) } else { String::new() };
        let code = if block == 0 { "G1 " } else { "" };
        let _ =
            writeln!(program, "{code}X{x:.4} Y{y:.4} Z{z:.4} {l}{:.4} {m}{:.4}{feed}", rotary_deg[0], rotary_deg[1]);
    }
    if vibrates {
        program += "G201\n";
    }
    if oscillates {
        program += "G203\n";
    }
    if function == Function::Thinning {
        program += "M34\n";
    }
    program += "G49\nM30\n";
    let rounded = tip_mm.map(|value: f64| (value * 1e4).round() / 1e4);
    let ends = vec![End::Tip(rounded)];
    Case { name: format!("{function:?} on {name}, {method:?}"), config, program, ends, jerk: Some(1e-6) }
}

/// A drilling cycle over two holes; the block that it begins with.
fn drilling(numbers: &Numbers, feed: f64) -> String {
    let [x, y] = [numbers.at(22, -10.0, 10.0), numbers.at(23, -10.0, 10.0)];
    let bottom = -numbers.at(24, 2.0, 6.0);
    let cycle = match (numbers.flags[1], numbers.flags[2]) {
        (false, false) => "G81",
        (false, true) => "G82 P40",
        (true, false) => "G83 Q1.7",
        (true, true) => "G73 Q1.1",
    };
    let level = if numbers.flags[3] { "G99" } else { "G98" };
    format!("{level} {cycle} X{x} Y{y} Z{bottom} R2 F{feed}\nX{:.3}\nG80\n", x + 7.0)
}

/// Vibration, a drilling cycle, oscillation, and vibration again, on a mill.
fn milled_with_all(numbers: &Numbers) -> Case {
    let mut config = PipelineConfig::new(MachineProfile::mill());
    config.profile.language.drilling.peck_clearance_mm = Some(1.0);
    config.profile.language.drilling.chip_break_retract_mm = Some(0.5);
    let [frequency_hz, amplitude_mm] = vibration(numbers, &config);
    with_oscillation(&mut config, numbers);
    let [x, y] = [numbers.at(1, 5.0, 20.0), numbers.at(2, -15.0, 15.0)];
    let radius = numbers.at(3, 15.0, 25.0);
    let feed = numbers.at(4, 100.0, 250.0);
    let mut program = format!("T1 M6\nG21 G90 G17 M3 S{}\nG0 X0 Y0 Z5\n", numbers.at(5, 300.0, 600.0).round());
    let _ = writeln!(program, "G1 Z-1 F300\nG200 F{frequency_hz} A{amplitude_mm}\nG1 X{x} Y{y} F{feed}\nG201\nG0 Z20");
    program += &drilling(numbers, feed);
    let _ = writeln!(
        program,
        "G0 X0 Y0 Z5\nG1 Z-1 F300\nG202 P1 D1\nG1 X{x} Y{y} F{feed}\nG3 X{} Y{y} R{radius}\nG203",
        x + 2.0 * radius
    );
    let _ = writeln!(
        program,
        "G64 P0.02\nG1 X{x}\nX0 Y0\nG61\nG200 F{frequency_hz} A{amplitude_mm}\nX9 F{feed}\nG2 X19 R5\nG201\nG0 Z20\nM30"
    );
    let ends = vec![
        End::Axes(vec![(0, x), (1, y), (2, -1.0)]),
        End::Axes(vec![(0, x + 2.0 * radius), (1, y), (2, -1.0)]),
        End::Axes(vec![(0, 19.0), (1, 0.0), (2, 20.0)]),
    ];
    Case { name: "milling with everything".to_owned(), config, program, ends, jerk: Some(1e-6) }
}

/// Vibrating cuts before and behind a vibrating thread, on a lathe.
fn turned_and_threaded(numbers: &Numbers) -> Case {
    let Case { mut config, program: threaded, ends: thread_ends, .. } = thread(numbers);
    let [frequency_hz, amplitude_mm] = vibration(numbers, &config);
    config.profile.vibration.amplitude_follows_feed_up_to = numbers.flags[0].then_some(1.2);
    let feed = numbers.at(24, 0.03, 0.1);
    let cut = |x: f64| {
        format!(
            "G97 S{} M3\nG0 X{x} Z2.\nG200 F{frequency_hz} A{amplitude_mm}\nG1 Z-6. F{feed}\nX{}\nG201\nG0 X90.\n",
            numbers.at(25, 400.0, 900.0).round(),
            x + 4.0
        )
    };
    let body = threaded.trim_end().strip_suffix("M30").unwrap_or(&threaded).to_owned();
    let program = format!("G21\n{}{body}{}G0 X90. Z20.\nM30\n", cut(32.0), cut(28.0));
    let mut ends = thread_ends;
    ends.push(End::Axes(vec![(0, 18.0), (1, -6.0)]));
    ends.push(End::Axes(vec![(0, 16.0), (1, -6.0)]));
    Case { name: "turning and threading with vibration".to_owned(), config, program, ends, jerk: Some(0.014) }
}

/// A tilted plane with vibration and a drilling cycle, then a guided cut that is thinned and vibrates.
fn plane_and_guided(name: &str, description: KinematicsDescription, numbers: &Numbers) -> Case {
    let guided = guided(Function::Thinning, name, description, numbers);
    let Case { mut config, program: guided_program, mut ends, .. } = guided;
    config.profile.language.drilling.peck_clearance_mm = Some(1.0);
    config.profile.language.drilling.chip_break_retract_mm = Some(0.5);
    let origin = [10, 11, 12].map(|index| numbers.at(index, -10.0, 10.0));
    let angles = [numbers.at(13, -30.0, 30.0), numbers.at(14, 3.0, 20.0), numbers.at(15, -30.0, 30.0)];
    let ([x, y, z], [i, j, k]) = (origin, angles);
    let feed = numbers.at(16, 200.0, 700.0);
    let [to_x, to_y] = [numbers.at(17, 8.0, 15.0), numbers.at(18, -6.0, 6.0)];
    let mut program =
        format!("T1 M6\nG21 G90 G17 M3 S600\nG68.2 X{x} Y{y} Z{z} I{i} J{j} K{k}\nG53.1\nG43 H1\nG0 X0 Y0 Z20\n");
    let [frequency_hz, amplitude_mm] = [numbers.at(30, 3.0, 8.0), numbers.at(31, 0.005, 0.03)];
    let _ = writeln!(
        program,
        "G1 Z1 F{feed}\nG200 F{frequency_hz} A{amplitude_mm}\nG1 X{to_x} Y{to_y}\nG3 X{:.3} R6\nG201\nG0 Z20",
        to_x + 8.0
    );
    program += &drilling(numbers, feed);
    program += "G0 Z30\nG49\nG69\n";
    program += guided_program.trim_start_matches("T1 M6\nG21 G90 M3 S600\n");
    let plane = TiltedPlane::by_euler_angles(origin, angles, 0);
    // Where the vibrating section ends; inside of it blocks end between setpoints.
    ends.push(End::Tip(plane.to_work([((to_x + 8.0) * 1e3).round() / 1e3, to_y, 1.0])));
    Case { name: format!("a tilted plane and a guided cut on {name}"), config, program, ends, jerk: Some(1e-6) }
}
