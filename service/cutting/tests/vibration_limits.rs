//! Limits of axes under vibration, by finite differences at every setpoint of random programs: turning with corners, arcs and
//! surface speed, rotary axes beside linear ones and under tool centre point control, threads. What the report says the
//! machine follows stays within them, starts, ends, junctions and returns from clamps included.

use core::f64::consts::TAU;
use std::fmt::Write as _;

use crate::common::machines::{config_of, kinds, kinematics};
use crate::common::measured::worst_use;
use crate::common::{run, validate};
use feedwave_cutting::thread::StartUp;
use feedwave_cutting::{
    GenerationMode, MachineProfile, PipelineConfig, SectionReport, ValidationReport, VibrationEnvelope,
};
use feedwave_motion::MachineAxis;
use feedwave_program::Axis;
use proptest::prelude::*;

const CASES: u32 = 48;
/// How exact positions are besides the rounding of their numbers, mm or degrees: of axes alone, and of a chain of axes.
const FIT: f64 = 2e-13;
const CHAIN_FIT: f64 = 1e-9;

/// What a program is made of, each number between 0 and 1, and how it is run.
#[derive(Clone, Debug)]
struct Draw {
    values: Vec<f64>,
    flags: [bool; 6],
    mode: GenerationMode,
    envelope: VibrationEnvelope,
    period_us: u32,
}

fn draws() -> impl Strategy<Value = Draw> {
    let modes = [GenerationMode::AlongPath, GenerationMode::Tangential, GenerationMode::ServoSide];
    let envelopes = vec![VibrationEnvelope::Blended, VibrationEnvelope::Blended, VibrationEnvelope::Published];
    (
        prop::collection::vec(0.0..1.0_f64, 48),
        any::<[bool; 6]>(),
        prop::sample::select(modes.to_vec()),
        prop::sample::select(envelopes),
        prop::sample::select(vec![250_u32, 1_000, 4_000]),
    )
        .prop_map(|(values, flags, mode, envelope, period_us)| Draw { values, flags, mode, envelope, period_us })
}

impl Draw {
    fn at(&self, index: usize, low: f64, high: f64) -> f64 {
        low + (high - low) * self.values[index % self.values.len()]
    }

    fn config(&self, mut profile: MachineProfile) -> PipelineConfig {
        for (index, axis) in profile.machine.axes.iter_mut().enumerate() {
            axis.max_velocity_per_s *= self.at(40 + index, 0.3, 1.0);
            axis.max_acceleration_per_s2 *= self.at(43 + index, 0.2, 1.5);
            axis.max_jerk_per_s3 *= self.at(45 + index, 0.1, 2.0);
        }
        profile.vibration.contour_tolerance_mm = 1.0;
        PipelineConfig {
            generation_mode: self.mode,
            vibration_envelope: self.envelope,
            interpolation_period_us: self.period_us,
            ..PipelineConfig::new(profile)
        }
    }

    /// Frequency, Hz, at most a quarter of the setpoints' rate, and an amplitude about as large as the axes follow.
    fn vibration(&self, config: &PipelineConfig, most_hz: f64) -> [f64; 2] {
        let frequency_hz = self.at(0, 10.0, most_hz.min(0.25e6 / f64::from(self.period_us)));
        let omega = TAU * frequency_hz;
        let follows = |axis: &MachineAxis| {
            let by_velocity = axis.max_velocity_per_s / omega;
            by_velocity.min(axis.max_acceleration_per_s2 / omega.powi(2)).min(axis.max_jerk_per_s3 / omega.powi(3))
        };
        let linear = config.profile.machine.axes.iter().filter(|axis| !axis.axis.is_rotary());
        let most_mm = linear.map(follows).fold(0.5, f64::min);
        [frequency_hz, (most_mm * self.at(1, 0.2, 1.0)).max(1e-3)]
    }
}

/// A program with the amplitude times a factor, on its machine.
type Program = fn(&Draw, f64) -> (String, PipelineConfig);

/// By how much the amplitudes have to be smaller, as the report says; nothing where none would serve.
fn largest_share(report: &ValidationReport) -> Option<f64> {
    let share = |section: &SectionReport| Some(section.largest_amplitude_mm? / section.condition.amplitude_mm);
    let share = report.sections.iter().filter_map(share).reduce(f64::min)?;
    (share > 0.0 && share < 1.0).then_some(share)
}

fn validate_of(draw: &Draw, program: Program) -> ValidationReport {
    let (text, config) = program(draw, 1.0);
    validate(&text, &config)
}

/// Holds the setpoints of what the report says the machine follows against its limits: with the amplitude as drawn, or the
/// largest that the report names. Rejects the case where there is none.
fn measure(draw: &Draw, program: Program, fit: f64, has_jerk: bool) -> Result<ValidationReport, TestCaseError> {
    let (mut text, config) = program(draw, 1.0);
    let mut report = validate(&text, &config);
    let mut scale = 1.0;
    // What one section asks for may be less than what another one does.
    for _ in 0..3 {
        let Some(share) = largest_share(&report).filter(|_| !report.is_accepted()) else { break };
        scale *= 0.9999 * share;
        text = program(draw, scale).0;
        report = validate(&text, &config);
    }
    prop_assume!(report.is_accepted() && report.sections.iter().all(|section| section.feasible));
    let setpoints = run(&text, &config);
    let (worst, at) = worst_use(&setpoints, &config, fit);
    let orders = if has_jerk { 3 } else { 2 };
    prop_assert!(
        worst[..orders].iter().all(|ratio| *ratio <= 1.0 + 1e-6),
        "{:?} at {:?}, lines {:?}, {:?} {:?} {} us\n{}",
        worst,
        at,
        at.map(|k| setpoints.line[k]),
        config.generation_mode,
        config.vibration_envelope,
        config.interpolation_period_us,
        text
    );
    Ok(report)
}

/// A contour of a shaft from right to left, in one or two sections.
fn turned(draw: &Draw, scale: f64) -> (String, PipelineConfig) {
    let config = draw.config(MachineProfile::lathe());
    let [frequency_hz, amplitude_mm] = draw.vibration(&config, 80.0);
    let amplitude_mm = amplitude_mm * scale;
    let mut text = String::from("G21 G18\n");
    if draw.flags[0] {
        let _ = writeln!(text, "G50 S2500\nG96 S{:.0} M3", draw.at(2, 80.0, 250.0));
    } else {
        let _ = writeln!(text, "G97 S{:.0} M3", draw.at(2, 300.0, 2_000.0));
    }
    let (mut x_mm, mut z_mm) = (draw.at(3, 10.0, 20.0), 2.0);
    let _ = writeln!(text, "G0 X{:.3} Z2", 2.0 * x_mm);
    let feed = |index: usize| draw.at(index, 0.02, 0.3);
    let _ = writeln!(
        text,
        "{}G200 F{frequency_hz:.3} A{amplitude_mm:.9}\nG1 F{:.3}",
        if draw.flags[1] { "G64 P0.02\n" } else { "" },
        feed(4)
    );
    for block in 0..5 {
        let index = 5 + 4 * block;
        let length_mm = 0.2 * 100.0_f64.powf(draw.at(index, 0.0, 1.0));
        match (draw.values[index + 1] * 5.0) as u32 {
            0 => x_mm += length_mm.min(8.0),
            1 => x_mm = (x_mm - length_mm).max(1.0),
            2 => {
                let radius_mm = draw.at(index + 2, 0.3, 6.0);
                (x_mm, z_mm) = (x_mm + radius_mm, z_mm - radius_mm);
                let code = if draw.values[index + 3] < 0.5 { "G2" } else { "G3" };
                let _ = writeln!(text, "{code} X{:.4} Z{z_mm:.4} R{radius_mm:.4}", 2.0 * x_mm);
                continue;
            }
            3 => (x_mm, z_mm) = (x_mm + 0.3 * length_mm * draw.values[index + 3], z_mm - length_mm),
            _ => z_mm -= length_mm,
        }
        let _ = writeln!(text, "G1 X{:.4} Z{z_mm:.4} F{:.3}", 2.0 * x_mm, feed(index + 2));
        if block == 2 && draw.flags[2] {
            text += "G201\nG4 U0.01\n";
            let _ = writeln!(text, "G200 F{:.3} A{:.9}", 0.7 * frequency_hz, 0.8 * amplitude_mm);
        }
    }
    let _ = writeln!(text, "G201\nG0 X{:.3}\nM30", 2.0 * x_mm + 10.0);
    (text, config)
}

/// Lines and arcs with a rotary axis that turns along, beside linear axes.
fn with_rotary_axis(draw: &Draw, scale: f64) -> (String, PipelineConfig) {
    let mut profile = MachineProfile::mill();
    let letter = if draw.flags[0] { Axis::C } else { Axis::A };
    profile.machine.axes.push(MachineAxis::new(letter, 180.0, 900.0, 30_000.0));
    let config = draw.config(profile);
    let [frequency_hz, amplitude_mm] = draw.vibration(&config, 60.0);
    let amplitude_mm = amplitude_mm * scale;
    let mut text = String::from("G21 G90 G94 G17 M3 S2000\nG0 X0 Y0 Z5\nG1 Z0 F500\n");
    let _ = writeln!(text, "G200 F{frequency_hz:.3} A{amplitude_mm:.9}");
    let (mut x_mm, mut y_mm, mut angle_deg) = (0.0, 0.0, 0.0);
    for block in 0..4 {
        let index = 3 + 5 * block;
        let letter = letter.letter();
        x_mm += draw.at(index, 0.5, 20.0);
        y_mm += draw.at(index + 1, -10.0, 10.0);
        angle_deg += draw.at(index + 2, -40.0, 40.0);
        let feed = draw.at(index + 3, 60.0, 900.0);
        let code = if draw.values[index + 4] < 0.25 { "G2 R80" } else { "G1" };
        let turn = if draw.values[index + 4] < 0.7 { format!(" {letter}{angle_deg:.3}") } else { String::new() };
        let _ = writeln!(text, "{code} X{x_mm:.4} Y{y_mm:.4}{turn} F{feed:.1}");
    }
    text += "G201\nG0 Z20\nM30\n";
    (text, config)
}

/// Blocks of a guided tool on any kind of machine.
fn guided(draw: &Draw, scale: f64) -> (String, PipelineConfig) {
    let machines: Vec<_> = kinds().into_iter().collect();
    let kind = (draw.values[2] * machines.len() as f64) as usize;
    let base = config_of(machines[kind].1.clone());
    // Split over the axes the offset would leave the path of a guided tool.
    let mode = GenerationMode::AlongPath;
    let config = PipelineConfig { tools: base.tools, generation_mode: mode, ..draw.config(base.profile) };
    let [frequency_hz, amplitude_mm] = draw.vibration(&config, 30.0);
    let amplitude_mm = amplitude_mm * scale;
    let [l, m] = kinematics(&config).letters().1.map(Axis::letter);
    let mut text = format!("T1 M6\nG21 G90 M3 S600\nG43.4 H1\nG0 X0 Y0 Z20 {l}10 {m}-20\n");
    let _ = writeln!(text, "G200 F{frequency_hz:.3} A{amplitude_mm:.9}");
    let (mut tip_mm, mut rotary_deg) = ([0.0, 0.0, 20.0], [10.0, -20.0]);
    for block in 0..4 {
        let index = 4 + 6 * block;
        for (axis, tip_mm) in tip_mm.iter_mut().enumerate() {
            *tip_mm += if axis == block % 3 { draw.at(index, 1.0, 15.0) } else { draw.at(index + axis, -3.0, 3.0) };
        }
        for (axis, rotary_deg) in rotary_deg.iter_mut().enumerate() {
            *rotary_deg += draw.at(index + 3 + axis, -4.0, 4.0);
        }
        let [x, y, z] = tip_mm;
        let feed = draw.at(index + 5, 100.0, 900.0);
        let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} Z{z:.4} {l}{:.4} {m}{:.4} F{feed:.1}", rotary_deg[0], rotary_deg[1]);
    }
    text += "G201\nG49\nM30\n";
    (text, config)
}

/// Vibrating passes of a thread on a cylinder, a taper or a face, whose axis is about as fast as it can.
fn thread(draw: &Draw, _scale: f64) -> (String, PipelineConfig) {
    let mut config = draw.config(MachineProfile::lathe());
    let on_face = draw.flags[2];
    let settings = &mut config.profile.thread_vibration;
    settings.start_up = if draw.flags[0] { StartUp::Delayed } else { StartUp::Preparatory };
    settings.combined_preparation = draw.flags[1];
    let ratio = draw.at(3, 1.1, 2.5);
    let infeeds: Vec<f64> = (0..3).map(|pass| draw.at(4 + pass, 0.02, 0.2)).collect();
    let most_mm = infeeds.iter().copied().fold(0.0, f64::max) * ratio;
    let vibrating = &config.profile.machine.axes[usize::from(on_face)];
    let vibrations = config.profile.thread_vibration.vibrations_per_rev;
    let omega = [
        (vibrating.max_acceleration_per_s2 / (0.5 * most_mm)).sqrt(),
        (vibrating.max_jerk_per_s3 / (0.5 * most_mm)).cbrt(),
        vibrating.max_velocity_per_s / (0.5 * most_mm),
        0.25e6 * TAU / f64::from(draw.period_us),
    ];
    let omega = omega.into_iter().fold(f64::INFINITY, f64::min) * draw.at(7, 0.3, 0.9);
    let rev_per_min = (60.0 * omega / TAU / vibrations).min(1_500.0);
    let lead_mm = draw.at(8, 1.5, 4.0);
    let mut text = format!("G97 S{rev_per_min:.0} {}\n", if draw.flags[4] { "M4" } else { "M3" });
    let (clear, on) = if on_face {
        ("G0 X80. Z5.", format!("Z0. Q{ratio:.3}"))
    } else {
        ("G0 X36. Z12.", format!("X30. Q{ratio:.3}"))
    };
    let _ = writeln!(text, "{clear}\nG165 P3 {on}");
    let mut depth_mm = 0.0;
    for (pass, infeed_mm) in infeeds.into_iter().enumerate() {
        depth_mm += infeed_mm;
        let start_deg = if draw.flags[3] { draw.at(9 + pass, 0.0, 359.0) } else { 0.0 };
        let shift = if draw.flags[5] { format!(" R{:.2}", draw.at(12 + pass, 0.0, 360.0)) } else { String::new() };
        let taper_mm = if draw.values[15] < 0.4 { 0.0 } else { draw.at(16, -1.0, 1.0) };
        let shift_mm = draw.at(17 + pass, -0.3, 0.3);
        if on_face {
            let _ = writeln!(text, "G0 X{:.3}\nG0 Z{:.4}", 80.0 + shift_mm, -depth_mm);
            let _ = writeln!(
                text,
                "G32 X20. Z{:.4} F{lead_mm:.3} Q{start_deg:.3}{shift}\nG0 Z5.\nG0 X80.",
                taper_mm.abs() - depth_mm
            );
        } else {
            let x_mm = 30.0 - 2.0 * depth_mm;
            let _ = writeln!(text, "G0 Z{:.3}\nG0 X{x_mm:.4}", 12.0 + shift_mm);
            let _ = writeln!(text, "G32 X{:.4} Z-15. F{lead_mm:.3} Q{start_deg:.3}{shift}\nG0 X36.", x_mm + taper_mm);
        }
    }
    text += "G165 P0\nG0 X90. Z20.\nM30\n";
    (text, config)
}

proptest! {
    // At least half of what is drawn is measured.
    #![proptest_config(ProptestConfig { max_global_rejects: CASES, ..ProptestConfig::with_cases(CASES) })]

    #[test]
    fn of_turning(draw in draws()) {
        let report = measure(&draw, turned, FIT, draw.envelope == VibrationEnvelope::Blended)?;
        prop_assert!(!report.sections.is_empty());
    }

    #[test]
    fn of_rotary_axes_beside_linear_ones(draw in draws()) {
        let report = measure(&draw, with_rotary_axis, FIT, draw.envelope == VibrationEnvelope::Blended)?;
        prop_assert!(!report.sections.is_empty());
    }

    #[test]
    fn of_a_guided_tool(draw in draws()) {
        let report = measure(&draw, guided, CHAIN_FIT, false)?;
        prop_assert!(!report.sections.is_empty());
    }

    #[test]
    fn of_threads(draw in draws()) {
        // The vibration of a thread steps the acceleration at its ends, which is said where it takes more jerk than there is.
        let steps = validate_of(&draw, thread).findings.iter().any(|finding| finding.code == "THREAD-VIBRATION-STEP");
        let report = measure(&draw, thread, FIT, !steps)?;
        prop_assert!(!report.threads.is_empty());
    }
}
