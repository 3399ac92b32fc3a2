//! Corners between blocks under tool centre point control: `G64` leads through them within the tolerances of position and
//! direction.

use std::fmt::Write;
use std::ops::RangeInclusive;

use feedwave_cutting::{PipelineConfig, PlanQuality};
use feedwave_motion::kinematics::Kinematics;
use feedwave_motion::kinematics::vector::{Vec3, add_scaled, angle, norm, sub};
use feedwave_program::Axis;
use proptest::prelude::*;

use super::least_time::check_limits;
use super::machine::config;
use super::{distance, freeform, poses};
use crate::common::machines::{config_of, kinds};
use crate::common::{Setpoints, all_bits, resume, run, snapshots, validate};

const P_MM: f64 = 0.02;

/// Cuts through points with A and C, after a rapid to the first.
fn program(control: &str, points: &[([f64; 3], [f64; 2])]) -> String {
    let mut text = format!("{control}\nG43.4 H1\n");
    for (index, ([x, y, z], [a, c])) in points.iter().enumerate() {
        let code = if index == 0 { "G0" } else { "G1 F3000" };
        let _ = writeln!(text, "{code} X{x:.4} Y{y:.4} Z{z:.4} A{a:.4} C{c:.4}");
    }
    text + "M30\n"
}

/// Largest distance of the cut from the programmed points' polygon, and largest angle from the nearest of the programmed
/// directions that belong to places within `p_mm`, rad.
fn deviations(text: &str, config: &PipelineConfig, points: &[([f64; 3], [f64; 2])], p_mm: f64) -> (f64, f64) {
    const PLACES: usize = 400;
    let setpoints = run(text, config);
    let kinematics = Kinematics::new(config.profile.kinematics.as_ref().expect("five axes")).expect("valid");
    let directions = kinematics.rotary_directions();
    let (mut off_mm, mut off_rad) = (0.0_f64, 0.0_f64);
    for (pose, &line) in poses(&setpoints, config).iter().zip(&setpoints.line).step_by(3) {
        if line < 4 {
            continue;
        }
        // Around a corner either block may be the nearer one.
        let near = (line as usize - 4).saturating_sub(1)..(line as usize - 2).min(points.len() - 1);
        let distances = near.clone().map(|first| distance(pose.tip_mm, points[first].0, points[first + 1].0));
        let nearest_mm = distances.fold(f64::INFINITY, f64::min);
        off_mm = off_mm.max(nearest_mm);
        if nearest_mm < 1e-9 {
            continue;
        }
        let mut nearest_rad = f64::INFINITY;
        for first in near {
            let [(from, turned), (to, turning)] = [points[first], points[first + 1]];
            for place in 0..=PLACES {
                let share = place as f64 / PLACES as f64;
                let tip = add_scaled(from, sub(to, from), share);
                if norm(sub(tip, pose.tip_mm)) <= p_mm + norm(sub(to, from)) / PLACES as f64 {
                    let at = [1, 0].map(|axis| (turned[axis] + (turning[axis] - turned[axis]) * share).to_radians());
                    nearest_rad = nearest_rad.min(angle(directions.at(at), pose.direction));
                }
            }
        }
        off_rad = off_rad.max(nearest_rad);
    }
    (off_mm, off_rad)
}

fn zigzag() -> Vec<(Vec3, [f64; 2])> {
    (0..20)
        .map(|k| {
            let k_mm = f64::from(k);
            (
                [2.0 * k_mm, 0.3 * f64::from(k % 2), 20.0 + 0.1 * f64::from(k % 3)],
                [-20.0 - 0.6 * f64::from(k % 2), 1.5 * k_mm],
            )
        })
        .collect()
}

#[test]
fn corners_are_led_through_within_both_tolerances() {
    // Which never stops for the sake of time.
    let mut config = config();
    config.profile.plan_quality = PlanQuality::LeastTime;
    let points = zigzag();
    let rounded = program(&format!("G64 P{P_MM}"), &points);
    let (off_mm, off_rad) = deviations(&rounded, &config, &points, P_MM);
    assert!(off_mm > 1e-4 && off_mm <= P_MM, "{off_mm}");
    assert!(off_rad > 1e-5 && off_rad.to_degrees() <= 0.1 + 1e-3, "{}", off_rad.to_degrees());
    // The exact path is exact.
    let (off_mm, _) = deviations(&program("G61", &points), &config, &points, P_MM);
    assert!(off_mm < 1e-9, "{off_mm:e}");
    // And nearly stops at every block, where the rounded one does not.
    let [exact, led_through] =
        [program("G61", &points), rounded.clone()].map(|text| slowest(&run(&text, &config), 4..=20));
    assert!(exact < 0.5 && led_through > 5.0, "{exact} {led_through}");
    // A tolerance of nothing leaves the corners.
    let mut strict = config.clone();
    strict.profile.corner_direction_tolerance_deg = 0.0;
    assert!(run(&rounded, &strict) == run(&program("(EXACT PATH)", &points), &config));
}

/// The slowest feed within some lines but for their start and end, mm/s.
fn slowest(setpoints: &Setpoints, lines: RangeInclusive<u32>) -> f64 {
    let within: Vec<f64> = (0..setpoints.len())
        .filter(|&k| lines.contains(&setpoints.line[k]))
        .map(|k| setpoints.feed[k] / 60.0)
        .collect();
    let moving = within.iter().position(|&feed| feed > 5.0).expect("it moves");
    within[moving..].iter().copied().fold(f64::INFINITY, f64::min)
}

#[test]
fn a_freeform_cut_does_not_stop_at_its_blocks() {
    // Fast plans stop where that is quicker, as between blocks whose directions flicker.
    let mut config = config();
    config.profile.plan_quality = PlanQuality::LeastTime;
    let thinned = freeform::program(1, 60);
    let whole = thinned.replace("M33\n", "").replace("M34\n", "");
    let last = thinned.lines().count() as u32 - 10;
    for (program, least) in [(whole, 2.0), (thinned, 4.5)] {
        let slowest = ["G61", "G64 P0.01"].map(|control| {
            let setpoints = run(&format!("{control}\n{program}"), &config);
            slowest(&setpoints, 6..=last)
        });
        assert!(slowest[0] < 0.5 * least && slowest[1] > least, "{slowest:?}");
    }
}

#[test]
fn a_stream_from_a_corner_on_is_the_same() {
    let config = config();
    let text = program("G64 P0.02", &zigzag());
    let whole = run(&text, &config);
    for (_, offset, snapshot) in snapshots(text.as_bytes(), &config) {
        let (first, rest) = resume(text.as_bytes(), &config, offset, &snapshot);
        for place in 0..rest.len() {
            assert_eq!(rest.bits(place), whole.bits(first as usize + place), "setpoint {place} from {first}");
        }
    }
}

/// Kinds of cuts.
const KINDS: usize = 7;

/// The one whose directions are vectors.
const BY_VECTORS: usize = 6;

/// Lines along X and turns at rest between them, by vectors.
fn cut_by_vectors(feed: f64, mut numbers: impl FnMut(f64, f64) -> f64) -> String {
    let mut text = format!("G43.5 H1\nG0 X0 Y0 Z20 I0.3 J0.2 K1\nG1 F{feed}\n");
    let (mut x, [mut i, mut j]) = (0.0, [0.3, 0.2]);
    for k in 1..14 {
        if k % 2 == 1 {
            x += numbers(0.2, 6.0);
        }
        // Every other line keeps its direction.
        if k % 4 != 1 {
            (i, j) = (i + numbers(-0.05, 0.05), j + numbers(-0.05, 0.05));
        }
        let _ = writeln!(text, "X{x:.4} I{i:.5} J{j:.5} K1");
    }
    text + "M30\n"
}

/// A cut of one kind at a feed, with the rotary axes of a machine, whose numbers come from `numbers`.
fn cut(kind: usize, feed: f64, rotary: [char; 2], mut numbers: impl FnMut(f64, f64) -> f64) -> String {
    let [tilt, turn] = rotary;
    if kind == BY_VECTORS {
        return cut_by_vectors(feed, numbers);
    }
    let mut text = format!("G43.4 H1\nG0 X0 Y0 Z20 {tilt}20 {turn}0\nG1 F{feed}\n");
    let (leg, height, kink_deg) = (numbers(0.3, 6.0), numbers(0.2, 3.0), numbers(0.0, 3.0));
    let ([mut x, mut y], mut heading, [mut a, mut c]) = ([0.0; 2], 0.0_f64, [20.0, 0.0]);
    for k in 1..14 {
        let odd = f64::from(k % 2);
        match kind {
            // Legs in any direction, without and with turning axes.
            0 | 1 => {
                let length = numbers(0.5, 8.0);
                x += length * heading.cos();
                y += length * heading.sin();
                heading += numbers(-2.0, 2.0);
                if kind == 1 {
                    a = (a + numbers(-3.0, 3.0)).clamp(5.0, 60.0);
                    c += numbers(-4.0, 4.0);
                }
            }
            // A zigzag that turns with it.
            2 => {
                (x, y, a, c) = (leg * f64::from(k), height * odd, 20.0 + kink_deg * odd, 1.5 * kink_deg * f64::from(k));
            }
            // Directions that change in place.
            3 | 5 if k % 2 == 0 => (a, c) = (20.0 + numbers(-5.0, 5.0), c + numbers(-5.0, 5.0)),
            3 => x += numbers(1.0, 6.0),
            // The same between lines on which the tool turns as well.
            5 => (x, a, c) = (x + numbers(0.2, 6.0), a + numbers(-2.0, 2.0), c + numbers(-2.0, 2.0)),
            // Short blocks along a wave.
            _ => {
                x += numbers(0.1, 1.0);
                (y, a, c) = ((x / 3.0).sin(), 25.0 + 4.0 * (x / 5.0).sin(), 3.0 * x.cos());
            }
        }
        let _ = writeln!(text, "X{x:.4} Y{y:.4} {tilt}{a:.4} {turn}{c:.4}");
    }
    text + "M30\n"
}

/// Times of a cut under these codes, s.
fn times_s<const CODES: usize>(codes: [&str; CODES], cut: &str, config: &PipelineConfig) -> [f64; CODES] {
    codes.map(|code| {
        let report = validate(&format!("{code}\n{cut}"), config);
        assert!(report.is_accepted(), "{cut}{:?}", report.findings);
        report.summary.duration_s
    })
}

/// A machine of one kind in a quality of its plans, and the letters of its rotary axes.
fn machine(kind: usize, quality: PlanQuality) -> (PipelineConfig, [char; 2]) {
    let mut config = config_of(kinds().swap_remove(kind).1);
    config.profile.plan_quality = quality;
    let tilt = config.profile.machine.axes[3..].iter().map(|axis| axis.axis).find(|&axis| axis != Axis::C);
    (config, [tilt.expect("a tilting axis").letter(), 'C'])
}

#[test]
fn corners_are_not_rounded_where_that_takes_longer() {
    // Rounded whatever it costs, this took 1.6 times as long.
    let mut numbers = [2.0, 2.2488, 1.705].into_iter();
    let (config, rotary) = machine(4, PlanQuality::Fast);
    let cut = cut(2, 3000.0, rotary, |_, _| numbers.next().expect("three numbers"));
    let [stopping, rounded] = times_s(["G61.1", "G64 P0.2"], &cut, &config);
    assert!(rounded <= 1.001 * stopping + 2e-3, "{rounded} and {stopping} s");
}

#[test]
fn plans_for_the_least_time_brake_and_start_in_corners_with_all_axes() {
    let (config, rotary) = machine(4, PlanQuality::LeastTime);
    let mut numbers = [2.0, 2.2488, 1.705].into_iter();
    let cut = cut(2, 3000.0, rotary, |_, _| numbers.next().expect("three numbers"));
    let [stopping, rounded] = times_s(["G61.1", "G64 P0.05"], &cut, &config);
    assert!(rounded < 0.97 * stopping, "{rounded} and {stopping} s");
}

/// Lines of 5 mm along X with turns of A at rest between them, the angle of A on each line, and the cut.
fn turns_at_rest(turn_deg: f64) -> (Vec<f64>, String) {
    let mut text = "G43.4 H1\nG0 X0 Y0 Z20 A20 C10\nG1 F3000\n".to_owned();
    let mut angles = vec![20.0];
    for k in 1..=8 {
        let _ = writeln!(text, "X{}", 5 * k);
        let at = 20.0 + turn_deg * f64::from(k) * if k % 3 == 0 { -1.0 } else { 1.0 };
        let _ = writeln!(text, "A{at:.4}");
        angles.push(at);
    }
    (angles, text + "X45\nM30\n")
}

#[test]
fn a_turn_at_rest_begins_while_the_tip_comes_to_rest_and_ends_while_it_leaves() {
    for (quality, turn_deg, least_gain) in [
        (PlanQuality::LeastTime, 0.15, 1.05),
        (PlanQuality::LeastTime, 1.0, 1.02),
        // At one speed along a corner, a stop is quicker.
        (PlanQuality::Fast, 1.0, 0.999),
    ] {
        for kind in 0..6 {
            let (config, rotary) = machine(kind, quality);
            let (angles, cut) = turns_at_rest(turn_deg);
            let cut = cut.replace('A', &rotary[0].to_string());
            let [stopping, overlapping] = times_s(["G61.1", "G64 P0.02"], &cut, &config);
            assert!(overlapping * least_gain < stopping, "{kind} {turn_deg}: {overlapping} and {stopping} s");
            let setpoints = run(&format!("G64 P0.02\n{cut}"), &config);
            let column = config.profile.machine.axes.iter().position(|axis| axis.axis.letter() == rotary[0]);
            let tilts = &setpoints.axes[column.expect("a tilting axis")];
            let mut off_deg = 0.0_f64;
            for ((pose, tilt), line) in poses(&setpoints, &config).iter().zip(tilts).zip(&setpoints.line) {
                if *line < 4 {
                    continue;
                }
                let [x, y, z] = pose.tip_mm;
                assert!(y.abs() < 1e-9 && (z - 20.0).abs() < 1e-9, "{kind}: {x} {y} {z}");
                let corner = (x / 5.0).round();
                if (x - 5.0 * corner).abs() > 1e-9 {
                    off_deg = off_deg.max((tilt - angles[(x / 5.0) as usize]).abs());
                }
            }
            // Strictly by the place of the tip, and no less than it may be.
            let least_deg = if quality == PlanQuality::LeastTime { 0.05 } else { 0.0 };
            assert!(off_deg <= 0.1 + 1e-9 && off_deg >= least_deg, "{kind} {turn_deg}: {off_deg}°");
            let last = setpoints.len() - 1;
            let [x, ..] = poses(&setpoints, &config)[last].tip_mm;
            assert!((x - 45.0).abs() < 1e-9 && tilts[last] == angles[8], "{x} {}", tilts[last]);
            // A tolerance of nothing leaves them as they are programmed.
            let mut strict = config.clone();
            strict.profile.corner_direction_tolerance_deg = 0.0;
            let [exact] = times_s(["G64 P0.02"], &cut, &strict);
            assert!(exact * 1.001 >= overlapping * least_gain, "{exact}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Fast plans within a tolerance take no longer than exact stops, whatever the machine, the cut and the feed.
    #[test]
    fn no_tolerance_takes_longer_than_stops(
        kind in 0..KINDS,
        machine_kind in 0..6_usize,
        feed in prop_oneof![Just(600.0), Just(3000.0), Just(10_000.0)],
        p in 0.005..0.2_f64,
        shares in prop::collection::vec(0.0..1.0_f64, 64),
    ) {
        let (config, rotary) = machine(machine_kind, PlanQuality::Fast);
        let mut shares = shares.into_iter().cycle();
        let cut = cut(kind, feed, rotary, |low, high| low + (high - low) * shares.next().expect("endless"));
        let [stopping, rounded] = times_s(["G61.1", &format!("G64 P{p:.4}")], &cut, &config);
        // Both end on the interpolation grid.
        prop_assert!(rounded <= 1.001 * stopping + 2.0 * config.period_s(), "{rounded} and {stopping} s:\n{cut}");
    }

    /// Corners keep the limits of every axis at any period in either quality, and go on the same from any place.
    #[test]
    fn corners_keep_limits_at_any_period(
        kind in 0..KINDS,
        machine_kind in 0..6_usize,
        least_time: bool,
        period in 0..3_usize,
        shares in prop::collection::vec(0.0..1.0_f64, 64),
    ) {
        let quality = if least_time { PlanQuality::LeastTime } else { PlanQuality::Fast };
        let (mut config, rotary) = machine(machine_kind, quality);
        config.interpolation_period_us = [250, 1_000, 4_000][period];
        let mut shares = shares.into_iter().cycle();
        let cut = cut(kind, 6000.0, rotary, |low, high| low + (high - low) * shares.next().expect("endless"));
        let text = format!("G64 P0.03\n{cut}");
        let whole = run(&text, &config);
        check_limits(&whole, &config)?;
        for (index, offset, snapshot) in snapshots(text.as_bytes(), &config) {
            let (first, rest) = resume(text.as_bytes(), &config, offset, &snapshot);
            prop_assert_eq!(first, index);
            prop_assert!(all_bits(&rest) == all_bits(&whole)[index as usize..], "resumed at {}", index);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever the corners, both tolerances hold, and so do the limits of every axis.
    #[test]
    fn any_corners_keep_tolerances_and_limits(
        steps in prop::collection::vec(([-3.0..3.0_f64, -3.0..3.0_f64, -1.0..1.0_f64], [-4.0..4.0_f64, -6.0..6.0_f64]), 2..20),
        p in 0.002..0.2_f64,
        tolerance_deg in 0.01..1.0_f64,
        least_time: bool,
    ) {
        let mut config = config();
        config.profile.plan_quality = if least_time { PlanQuality::LeastTime } else { PlanQuality::Fast };
        config.profile.corner_direction_tolerance_deg = tolerance_deg;
        let mut points: Vec<(Vec3, [f64; 2])> = vec![([0.0, 0.0, 20.0], [-40.0, 0.0])];
        for (travel, turn) in steps {
            let (at, turned) = points[points.len() - 1];
            let round = |value: f64| (value * 1e4).round() / 1e4;
            let tilt = (turned[0] + turn[0]).clamp(-80.0, -5.0);
            let next = [0, 1, 2].map(|axis| round(at[axis] + travel[axis]));
            if norm(sub(next, at)) < 0.05 {
                continue;
            }
            points.push((next, [round(tilt), round(turned[1] + turn[1])]));
        }
        prop_assume!(points.len() > 2);
        let text = program(&format!("G64 P{p:.4}"), &points);
        let (off_mm, off_rad) = deviations(&text, &config, &points, p);
        prop_assert!(off_mm <= p + 5e-5, "{off_mm} {p}");
        prop_assert!(off_rad.to_degrees() <= 1.03 * tolerance_deg + 0.01, "{} {tolerance_deg}", off_rad.to_degrees());
        let setpoints = run(&text, &config);
        let period_s = config.period_s();
        for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
            let mut largest = 0.0_f64;
            for k in column.windows(3) {
                largest = largest.max(((k[2] - 2.0 * k[1] + k[0]) / (period_s * period_s)).abs());
            }
            // A corner that stays steps by what the machine permits.
            let step = axis.max_velocity_step_per_s / period_s;
            prop_assert!(largest <= axis.max_acceleration_per_s2 * 1.001 + step, "{} {largest}", axis.name);
        }
    }
}
