//! Lower feeds and feed holds on plans for the least time: how fast the path may be, and how soon it obeys.

use crate::common::changes::{check_limits, wave};
use crate::common::{Setpoints, run};
use feedwave_cutting::{MachineProfile, OverrideChange, PipelineConfig, PlanQuality};
use proptest::prelude::*;

const ACCELERATION: f64 = 2_000.0;
const JERK: f64 = 30_000.0;

fn config(overrides: &[(u64, f64)]) -> PipelineConfig {
    let overrides = overrides.iter().map(|&(index, ratio)| OverrideChange { index, ratio }).collect();
    let mut profile = MachineProfile { plan_quality: PlanQuality::LeastTime, ..MachineProfile::mill() };
    for axis in &mut profile.machine.axes {
        (axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3) = (200.0, ACCELERATION, JERK);
    }
    PipelineConfig { overrides, ..PipelineConfig::new(profile) }
}

fn begin(feed: f64) -> String {
    format!("G21 G90 G94 G17 G64 P0.05\nG0 X0 Y0 Z0\nG1 F{feed:.0}\n")
}

/// Legs alternately along X and Y.
fn zigzag(leg_mm: f64, legs: u32, feed: f64) -> String {
    let mut program = begin(feed);
    for leg in 0..legs {
        let word = if leg % 2 == 0 { 'X' } else { 'Y' };
        program += &format!("{word}{:.4}\n", leg_mm * f64::from(leg / 2 + 1));
    }
    program + "M30\n"
}

/// A straight line, a quarter of a circle, and a straight line.
fn line_arc_line(leg_mm: f64, radius_mm: f64, feed: f64) -> String {
    let [x, y] = [leg_mm + radius_mm, radius_mm + leg_mm];
    begin(feed) + &format!("X{leg_mm:.4}\nG3 X{x:.4} Y{radius_mm:.4} I0 J{radius_mm:.4}\nG1 Y{y:.4}\nM30\n")
}

/// Rectangles within each other, with round corners.
fn pocket(feed: f64) -> String {
    let mut program = begin(feed) + "Y-20\n";
    for [x, y] in [[30.0, 20.0], [20.0, 14.0], [12.0, 8.0]] {
        let [near_x, near_y] = [x - 5.0, y - 5.0];
        program += &format!(
            "Y-{y}\nX{near_x}\nG3 X{x} Y-{near_y} I0 J5\nG1 Y{near_y}\nG3 X{near_x} Y{y} I-5 J0\nG1 X-{near_x}\n\
             G3 X-{x} Y{near_y} I0 J-5\nG1 Y-{near_y}\nG3 X-{near_x} Y-{y} I5 J0\nG1 X0\n"
        );
    }
    program + "M30\n"
}

/// A closed curve in short blocks.
fn freeform(feed: f64) -> String {
    let at = |t: f64| {
        let x = 30.0 * t.cos() + 3.0 * (5.0 * t).cos();
        (x - 33.0, 20.0 * t.sin() + 5.0 * (2.0 * t + 0.4).sin() + 2.0 * (5.0 * t).sin() - 1.947)
    };
    let mut program = begin(feed);
    for k in 1..=600 {
        let (x, y) = at(core::f64::consts::TAU * f64::from(k) / 600.0);
        program += &format!("X{x:.4} Y{y:.4}\n");
    }
    program + "M30\n"
}

/// The programs of these tests, at a feed.
fn program(number: usize, feed: f64) -> String {
    match number {
        0 => zigzag(10.0, 10, feed),
        1 => zigzag(15.0, 6, feed),
        2 => zigzag(25.0, 5, feed),
        3 => line_arc_line(30.0, 10.0, feed),
        4 => line_arc_line(12.0, 3.0, feed),
        5 => pocket(feed),
        6 => freeform(feed),
        _ => wave().replace("F20000", &format!("F{feed:.0}")),
    }
}

/// Speed of a setpoint, mm/s.
fn speed(setpoints: &Setpoints, k: usize) -> f64 {
    setpoints.feed.get(k).map_or(0.0, |feed| feed / 60.0)
}

/// Time of the fastest stop along a straight line from a speed and an acceleration, s.
fn stop_s(speed: f64, acceleration: f64) -> f64 {
    let (mut speed, mut time_s) = (speed, 0.0);
    if acceleration > 0.0 {
        time_s += acceleration / JERK;
        speed += 0.5 * acceleration * acceleration / JERK;
    }
    // What a braking in progress has done is as if it had begun earlier.
    let braking = (-acceleration).max(0.0);
    let whole = speed + 0.5 * braking * braking / JERK;
    let most = (whole * JERK).sqrt().min(ACCELERATION);
    time_s + 2.0 * most / JERK + (whole - most * most / JERK) / ACCELERATION - braking / JERK
}

/// Where the path rests first from a setpoint on.
fn rest(setpoints: &Setpoints, from: usize) -> usize {
    (from..setpoints.len()).find(|&k| setpoints.path.get(k + 1) == setpoints.path.get(k)).expect("it rests")
}

#[test]
fn a_lower_feed_while_the_path_accelerates_never_makes_it_faster() {
    let program = zigzag(15.0, 6, 6_000.0);
    for at in (40..700).step_by(10) {
        for ratio in [0.9, 0.5, 0.0] {
            let changes = [(at, ratio), (at + 900, 1.0)];
            let config = config(&changes);
            let changed = run(&program, &config);
            check_limits(&changed, &config).expect("within the limits");
            let most = (110..changed.len()).map(|k| speed(&changed, k)).fold(0.0, f64::max);
            assert!(most <= 100.0 * (1.0 + 1e-9), "{most} mm/s with {ratio} from {at} on");
        }
    }
}

#[test]
fn a_hold_on_a_straight_leg_acts_with_the_next_setpoint_and_stops_at_the_jerk() {
    // The first leg has room for a stop.
    let program = line_arc_line(60.0, 10.0, 60_000.0);
    let plain = run(&program, &config(&[]));
    let first = plain.line.iter().position(|&line| line == 4).expect("the first leg") as u64;
    for at in (first + 20..first + 220).step_by(9) {
        let k = at as usize;
        let held = run(&program, &config(&[(at, 0.0), (at + 1_000, 1.0)]));
        assert!(held.path[k + 1] <= plain.path[k + 1] && held.path[k + 2] < plain.path[k + 2], "held at {at}");
        let acceleration = (speed(&plain, k) - speed(&plain, k - 1)) / 1e-3;
        let [taken, least] = [(rest(&held, k) - k) as f64 * 1e-3, stop_s(speed(&plain, k), acceleration)];
        assert!(taken <= 1.15 * least + 3e-3, "{taken} s of {least} s, held at {at}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Changes below the programmed feed never make the path faster than that.
    #[test]
    fn the_speed_is_never_above_the_programmed_feed(
        number in 0..8_usize,
        feed in prop_oneof![Just(3_000.0), Just(4_000.0), Just(6_000.0), 1_000.0..20_000.0_f64],
        steps in prop::collection::vec((20..400_u64, prop_oneof![3 => 0.1..1.0_f64, 1 => Just(0.0)]), 1..5),
    ) {
        let feed = feed.round();
        let mut index = 100;
        let mut changes = Vec::new();
        for (step, ratio) in steps {
            index += step;
            changes.push((index, ratio));
        }
        changes.push((index + 400, 1.0));
        let config = config(&changes);
        let changed = run(&program(number, feed), &config);
        check_limits(&changed, &config)?;
        let start = changed.line.iter().position(|&line| line > 3).unwrap_or(0);
        for k in start..changed.len() {
            let commanded = feed / 60.0;
            prop_assert!(speed(&changed, k) <= commanded * (1.0 + 1e-9), "{} of {commanded} at {k}", speed(&changed, k));
        }
    }
}
