//! Chains of short blocks under tool centre point control, as CAM systems write them: one curve within both tolerances.

use std::fmt::Write;

use feedwave_cutting::{PipelineConfig, PlanQuality};
use feedwave_motion::kinematics::KinematicsDescription;
use feedwave_motion::kinematics::vector::{Vec3, add, add_scaled, angle, cross, norm, rotate, sub, unit};
use feedwave_program::Axis;
use proptest::prelude::*;

use super::least_time::check_limits;
use crate::common::machines::{LENGTH_MM, config_of, kinds, position};
use crate::common::{Setpoints, all_bits, resume, run, snapshots, validate};

/// A place of the tool: its centre point, mm, and its tilt and turn, degrees.
type Place = (Vec3, [f64; 2]);

/// Lines of a program before its first cut.
const LINES_BEFORE: u32 = 3;

/// How the directions of a program are written.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Angles([char; 2]),
    Vectors,
}

/// Names of the kinds of [`chain`].
const KINDS: [&str; 9] =
    ["freeform", "flickering freeform", "circle", "flank", "zigzag", "raster", "wave", "beside a pole", "random legs"];

/// Numbers from 0 to 1 that follow from a seed.
struct Numbers(u64);

impl Numbers {
    fn of(seed: u64) -> Self {
        let mut numbers = Self(seed);
        (0..8).for_each(|_| _ = numbers.next());
        numbers
    }

    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1_u32 << 31)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// Places of a cut of one kind in blocks of about `block_mm`.
fn chain(kind: usize, block_mm: f64, numbers: &mut Numbers) -> Vec<Place> {
    let steps = |length_mm: f64| (length_mm / block_mm).round().max(2.0) as u32;
    let (one, two, three) = (numbers.next(), numbers.next(), numbers.next());
    let mut places = Vec::new();
    match kind {
        // Two passes to and fro over a bowl, without and with the modeller's noise.
        0 | 1 => {
            let noise = if kind == 1 { 1.0 } else { 0.0 };
            let (rise, lean) = (0.004 + 0.02 * one, 12.0 + 20.0 * two);
            for pass in 0..2 {
                let y = 3.0 + 0.4 * f64::from(pass);
                for k in 0..=steps(24.0) {
                    let share = f64::from(k) / f64::from(steps(24.0));
                    let x = 24.0 * if pass == 0 { share } else { 1.0 - share } - 12.0;
                    let z = rise * (x * x + 0.7 * y * y) + noise * 0.003 * (numbers.next() - 0.5);
                    let tilt = lean + (2.0 * rise * x).atan().to_degrees() * 0.6 + noise * 0.1 * (numbers.next() - 0.5);
                    let turn = 30.0 + 60.0 * three + 2.5 * x + noise * 0.2 * (numbers.next() - 0.5);
                    places.push(([x, y, z], [tilt, turn]));
                }
            }
        }
        // A circle with the tool leaning to its middle.
        2 => {
            let (radius, lean) = (3.0 + 15.0 * one, 5.0 + 30.0 * two);
            let sweep = 240.0 / radius.max(8.0) * 10.0;
            for k in 0..=steps(radius * sweep.to_radians()) {
                let turned = sweep * f64::from(k) / f64::from(steps(radius * sweep.to_radians()));
                let (sine, cosine) = turned.to_radians().sin_cos();
                places.push(([radius * cosine, radius * sine, 10.0], [lean, turned]));
            }
        }
        // The flank of a twisted wall.
        3 => {
            let (wave, twist) = (1.0 + 3.0 * one, 2.0 + 10.0 * two);
            for k in 0..=steps(30.0) {
                let x = 30.0 * f64::from(k) / f64::from(steps(30.0));
                let slope = wave * 0.3 * (0.3 * x).cos();
                places.push((
                    [x, wave * (0.3 * x).sin(), 5.0],
                    [15.0 + twist * (0.2 * x).sin(), slope.atan().to_degrees() + twist * (0.15 * x).cos()],
                ));
            }
        }
        // Sharp corners between legs of a few blocks, with the tool turning along.
        4 => {
            let (leg, height) = (1.0 + 4.0 * one, 0.5 + 3.0 * two);
            for leg_number in 0..8 {
                let odd = f64::from(leg_number % 2);
                let number = f64::from(leg_number);
                let count = steps(leg.hypot(height));
                for k in 0..count {
                    let share = f64::from(k) / f64::from(count);
                    let up = if odd > 0.5 { 1.0 - share } else { share };
                    places.push((
                        [leg * (number + share), height * up, 0.0],
                        [20.0 + 3.0 * three * up, 4.0 * (number + share)],
                    ));
                }
            }
        }
        // Rows with step-overs, each leaning the other way.
        5 => {
            let (row_mm, over_mm) = (4.0 + 6.0 * one, 0.1 + 0.5 * two);
            for row in 0..5 {
                let odd = row % 2 == 1;
                for k in 0..=steps(row_mm) {
                    let share = f64::from(k) / f64::from(steps(row_mm));
                    let x = row_mm * if odd { 1.0 - share } else { share };
                    places.push((
                        [x, over_mm * f64::from(row), 0.05 * x * x / row_mm],
                        [18.0 + 6.0 * three * (0.5 * x).sin(), 20.0 + 1.5 * x],
                    ));
                }
            }
        }
        // Along a wave in space.
        6 => {
            for k in 0..=steps(24.0) {
                let x = 24.0 * f64::from(k) / f64::from(steps(24.0));
                places.push((
                    [x, (x / (2.0 + 3.0 * one)).sin(), 0.4 * (1.3 * x / (2.0 + 3.0 * one)).sin()],
                    [25.0 + 4.0 * (x / 5.0).sin() * (1.0 + two), 3.0 * x.cos() * three],
                ));
            }
        }
        // Past a pole, with the direction nearly along the axis of the turn.
        7 => {
            for k in 0..=steps(16.0) {
                let x = 16.0 * f64::from(k) / f64::from(steps(16.0)) - 8.0;
                let (across, least) = (1.5 * x, 0.05 + 2.0 * one);
                places.push(([x, 0.02 * x * x, 0.0], [across.hypot(least), across.atan2(least).to_degrees()]));
            }
        }
        // Legs in any direction.
        _ => {
            let (mut x, mut y, mut heading, mut tilt, mut turn) = (0.0, 0.0, 0.0_f64, 20.0_f64, 0.0);
            for _ in 0..40 {
                places.push(([x, y, 0.0], [tilt, turn]));
                let length = block_mm * numbers.between(0.4, 2.0);
                x += length * heading.cos();
                y += length * heading.sin();
                heading += numbers.between(-0.8, 0.8);
                tilt = (tilt + block_mm * numbers.between(-2.0, 2.0)).clamp(8.0, 50.0);
                turn += block_mm * numbers.between(-3.0, 3.0);
            }
        }
    }
    // As the text has them.
    for place in &mut places {
        place.0[2] += 20.0;
        place.0 = place.0.map(|value| (value * 1e4).round() / 1e4);
        place.1 = place.1.map(|value| (value * 1e4).round() / 1e4);
    }
    places.dedup_by(|a, b| a.0 == b.0);
    places
}

/// The direction with this tilt and turn, as a trunnion table of A and C has it with a negative tilt.
fn vector([tilt, turn]: [f64; 2]) -> Vec3 {
    let (sine, cosine) = tilt.to_radians().sin_cos();
    let (across, along) = turn.to_radians().sin_cos();
    [sine * across, sine * along, cosine].map(|value| (value * 1e6).round() / 1e6)
}

/// The cut through places, after a rapid to the first of them.
fn text(places: &[Place], form: Form, feed: f64) -> String {
    let mut text = String::from(if form == Form::Vectors { "G43.5 H1\n" } else { "G43.4 H1\n" });
    for (index, &([x, y, z], angles)) in places.iter().enumerate() {
        let code = match index {
            0 => "G0 ".to_owned(),
            1 => format!("G1 F{feed} "),
            _ => String::new(),
        };
        let _ = write!(text, "{code}X{x:.4} Y{y:.4} Z{z:.4} ");
        let _ = match form {
            Form::Angles([tilt, turn]) => writeln!(text, "{tilt}{:.4} {turn}{:.4}", angles[0], angles[1]),
            Form::Vectors => {
                let [i, j, k] = vector(angles);
                writeln!(text, "I{i:.6} J{j:.6} K{k:.6}")
            }
        };
    }
    text + "M30\n"
}

/// A machine of one kind in a quality of its plans, and the letters of its rotary axes.
fn machine(kind: usize, quality: PlanQuality) -> (PipelineConfig, [char; 2]) {
    let mut config = config_of(kinds().swap_remove(kind).1);
    config.profile.plan_quality = quality;
    let tilt = config.profile.machine.axes[3..].iter().map(|axis| axis.axis).find(|&axis| axis != Axis::C);
    (config, [tilt.expect("a tilting axis").letter(), 'C'])
}

/// The pose of the tool in the coordinates of the chain with the axes there, from the tool to the work, link by link.
fn pose(machine: &KinematicsDescription, position: &[f64; 9], length_mm: f64) -> (Vec3, Vec3) {
    let direction = unit(machine.tool_direction).expect("a direction");
    let (mut point, mut tool) = (add_scaled(machine.gauge_point_mm, direction, -length_mm), direction);
    for link in machine.chain.iter().rev() {
        let (own, value) = (unit(link.direction).expect("a direction"), position[link.axis.index()]);
        if link.axis.is_rotary() {
            let (sine, cosine) = value.to_radians().sin_cos();
            point = add(link.point_mm, rotate(own, (sine, cosine), sub(point, link.point_mm)));
            tool = rotate(own, (sine, cosine), tool);
        } else {
            point = add_scaled(point, own, value);
        }
    }
    (point, tool)
}

/// Poses of the tool in work coordinates with G54.
fn poses(setpoints: &Setpoints, config: &PipelineConfig) -> Vec<(Vec3, Vec3)> {
    let machine = config.profile.kinematics.as_ref().expect("five axes");
    let (origin, _) = pose(machine, &config.profile.language.work_offsets[0], 0.0);
    let at = |index| {
        let (point, tool) = pose(machine, &position(setpoints, config, index), LENGTH_MM);
        (sub(point, origin), tool)
    };
    (0..setpoints.len()).map(at).collect()
}

/// The programmed pose at a share of a block.
fn programmed(places: &[Place], block: usize, share: f64, form: Form, config: &PipelineConfig) -> (Vec3, Vec3) {
    let [(from, turned), (to, turning)] = [places[block], places[block + 1]];
    let tip = add_scaled(from, sub(to, from), share);
    let direction = match form {
        Form::Angles(letters) => {
            let machine = config.profile.kinematics.as_ref().expect("five axes");
            let mut position = [0.0; 9];
            for k in 0..2 {
                let axis = Axis::ALL.into_iter().find(|axis| axis.letter() == letters[k]).expect("an axis");
                position[axis.index()] = turned[k] + (turning[k] - turned[k]) * share;
            }
            pose(machine, &position, 0.0).1
        }
        Form::Vectors => {
            let [from, to] = [turned, turning].map(|angles| unit(vector(angles)).expect("a direction"));
            match unit(cross(from, to)) {
                Some(normal) => rotate(normal, (share * angle(from, to)).sin_cos(), from),
                None => from,
            }
        }
    };
    (tip, direction)
}

/// How far a pose is from the programmed ones near a block, where it is nearest, by what it may be.
fn deviation(
    (tip, direction): (Vec3, Vec3),
    places: &[Place],
    block: usize,
    form: Form,
    config: &PipelineConfig,
    p_mm: f64,
) -> f64 {
    let tolerance_rad = config.profile.corner_direction_tolerance_deg.to_radians();
    let off = |block: usize, share: f64| {
        let (own, at) = programmed(places, block, share, form, config);
        (norm(sub(own, tip)) / p_mm).max(angle(at, direction) / tolerance_rad)
    };
    let mut least = f64::INFINITY;
    for block in block.saturating_sub(1)..=(block + 1).min(places.len() - 2) {
        // It has one valley there: the path hardly bends along a block.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..4 {
            let shares = (0..=10).map(|k| low + (high - low) * f64::from(k) / 10.0);
            let nearest = shares.min_by(|&a, &b| off(block, a).total_cmp(&off(block, b))).expect("eleven");
            let step = 0.1 * (high - low);
            (low, high) = ((nearest - step).max(0.0), (nearest + step).min(1.0));
            least = least.min(off(block, nearest));
        }
    }
    least
}

/// Largest deviation of setpoints from the programmed path, and of its points from those, by what they may be.
fn deviations(places: &[Place], form: Form, config: &PipelineConfig, p_mm: f64, setpoints: &Setpoints) -> [f64; 2] {
    let poses = poses(setpoints, config);
    let tolerance_rad = config.profile.corner_direction_tolerance_deg.to_radians();
    let mut largest = [0.0_f64; 2];
    let first = setpoints.line.iter().position(|&line| line > LINES_BEFORE).expect("it cuts");
    for (&pose, &line) in poses.iter().zip(&setpoints.line).skip(first) {
        let block = (line.saturating_sub(LINES_BEFORE + 1) as usize).min(places.len() - 2);
        largest[0] = largest[0].max(deviation(pose, places, block, form, config, p_mm));
    }
    for block in 0..places.len() - 1 {
        for share in [0.5, 1.0] {
            let (tip, direction) = programmed(places, block, share, form, config);
            let mut least = f64::INFINITY;
            for pair in (first..poses.len()).map(|k| [poses[k - 1], poses[k]]) {
                // What lies between two setpoints is as near as the nearer one, less half their distance.
                let [a, b] =
                    pair.map(|(point, tool)| [norm(sub(point, tip)) / p_mm, angle(tool, direction) / tolerance_rad]);
                let steps = [norm(sub(pair[1].0, pair[0].0)) / p_mm, angle(pair[1].1, pair[0].1) / tolerance_rad];
                let off = |k: usize| a[k].min(b[k]) - 0.5 * steps[k];
                least = least.min(off(0).max(off(1)));
            }
            largest[1] = largest[1].max(least);
        }
    }
    largest
}

/// A chain of one kind on a machine.
#[derive(Clone, Debug)]
struct Case {
    kind: usize,
    machine: usize,
    vectors: bool,
    least_time: bool,
    block_mm: f64,
    feed: f64,
    p_mm: f64,
    seed: u64,
}

impl Case {
    fn places(&self) -> Vec<Place> {
        chain(self.kind, self.block_mm, &mut Numbers::of(self.seed))
    }

    fn config(&self) -> (PipelineConfig, Form) {
        let quality = if self.least_time { PlanQuality::LeastTime } else { PlanQuality::Fast };
        let (mut config, letters) = machine(self.machine, quality);
        // Great circles as they are programmed.
        config.profile.pole_tolerance_deg = 0.0;
        (config, if self.vectors { Form::Vectors } else { Form::Angles(letters) })
    }

    fn text(&self, code: &str) -> String {
        format!("{code}\n{}", text(&self.places(), self.config().1, self.feed))
    }
}

fn cases() -> impl Strategy<Value = Case> {
    let feed = prop_oneof![Just(600.0), Just(3_000.0), Just(10_000.0)];
    let machine = (0..7_usize, any::<bool>()).prop_map(|(machine, vectors)| (machine, vectors && machine < 6));
    (0..KINDS.len(), machine, any::<bool>(), 0.1..0.7_f64, feed, 0.005..0.2_f64, any::<u32>()).prop_map(
        |(kind, (machine, vectors), least_time, block_mm, feed, p_mm, seed)| {
            let p_mm = (p_mm * 1e4).round() / 1e4;
            Case { kind, machine, vectors, least_time, block_mm, feed, p_mm, seed: seed.into() }
        },
    )
}

#[test]
fn smooth_chains_take_far_less_time_than_corner_by_corner() {
    // With each corner by itself, these took 0.18 and 0.52 of the time with stops.
    for (kind, most) in [(0, 0.135), (3, 0.29)] {
        let (machine, vectors, least_time) = (0, false, false);
        let case = Case { kind, machine, vectors, least_time, block_mm: 0.3, feed: 3_000.0, p_mm: 0.02, seed: 3 };
        let (config, _) = case.config();
        let [stopping, curve] = ["G61.1", "G64 P0.02"].map(|code| {
            let report = validate(&case.text(code), &config);
            assert!(report.is_accepted(), "{:?}", report.findings.first());
            report.summary.duration_s
        });
        assert!(curve < most * stopping, "{}: {curve} and {stopping} s", KINDS[kind]);
    }
}

#[test]
fn the_report_says_how_far_the_tip_is_from_the_programmed_path() {
    let case = Case {
        kind: 3,
        machine: 3,
        vectors: true,
        least_time: true,
        block_mm: 0.3,
        feed: 3_000.0,
        p_mm: 0.02,
        seed: 3,
    };
    let (config, form) = case.config();
    let report = validate(&case.text("G64 P0.02"), &config);
    let stated = report.summary.path_deviation.expect("it deviates").largest_mm;
    assert!(stated > 1e-4 && stated <= 0.02, "{stated}");
    // The direction may be as far off as it likes here.
    let mut tip_alone = config.clone();
    tip_alone.profile.corner_direction_tolerance_deg = 90.0;
    let [off, _] = deviations(&case.places(), form, &tip_alone, stated, &run(&case.text("G64 P0.02"), &config));
    assert!(off <= 1.0 + 1e-6, "{off}");
}

#[test]
fn a_chain_stays_within_the_travel_of_the_programmed_path() {
    for (kind, machine) in [(3, 0), (6, 0), (6, 4)] {
        let (vectors, least_time) = (false, true);
        let case = Case { kind, machine, vectors, least_time, block_mm: 0.3, feed: 3_000.0, p_mm: 0.2, seed: 3 };
        let (mut config, _) = case.config();
        let exact = run(&case.text("G61.1"), &config);
        for (axis, column) in config.profile.machine.axes.iter_mut().zip(&exact.axes) {
            // The path comes to rest at its ends near a setpoint, not at one.
            axis.travel_min = Some(column.iter().copied().fold(f64::INFINITY, f64::min) - 1e-4);
            axis.travel_max = Some(column.iter().copied().fold(f64::NEG_INFINITY, f64::max) + 1e-4);
        }
        let text = case.text("G64 P0.2");
        let report = validate(&text, &config);
        assert!(report.is_accepted(), "{:?}", report.findings.first());
        let rounded = run(&text, &config);
        assert!(2 * rounded.len() < exact.len(), "{} and {}", rounded.len(), exact.len());
        for (axis, column) in config.profile.machine.axes.iter().zip(&rounded.axes) {
            let range = axis.travel_min.expect("it has one")..=axis.travel_max.expect("it has one");
            assert!(column.iter().all(|value| range.contains(value)), "{}", axis.name);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Every setpoint is within both tolerances of one programmed pose, and every programmed pose of the path.
    #[test]
    fn chains_keep_both_tolerances(case in cases(), tolerance_deg in prop_oneof![Just(0.1), 0.01..1.0_f64]) {
        let (mut config, form) = case.config();
        config.profile.corner_direction_tolerance_deg = tolerance_deg;
        let text = case.text(&format!("G64 P{:.4}", case.p_mm));
        let setpoints = run(&text, &config);
        let [of_run, of_programmed] = deviations(&case.places(), form, &config, case.p_mm, &setpoints);
        // The search for the nearest pose ends a ten-thousandth of a block beside it.
        prop_assert!(of_run <= 1.003, "{of_run} of the tolerances");
        prop_assert!(of_programmed <= 1.003, "{of_programmed} of the tolerances");
        // The end is exact.
        let exact = run(&case.text("G61.1"), &config);
        let end = |setpoints: &Setpoints| setpoints.bits(setpoints.len() - 1)[..5].to_vec();
        prop_assert_eq!(end(&setpoints), end(&exact));
    }

    /// Every axis keeps its limits at any period, and the stream is the same from any place.
    #[test]
    fn chains_keep_limits_at_any_period(case in cases(), period in 0..3_usize) {
        let (mut config, _) = case.config();
        config.interpolation_period_us = [250, 1_000, 4_000][period];
        let text = case.text(&format!("G64 P{:.4}", case.p_mm));
        let whole = run(&text, &config);
        check_limits(&whole, &config)?;
        for (index, offset, snapshot) in snapshots(text.as_bytes(), &config) {
            let (first, rest) = resume(text.as_bytes(), &config, offset, &snapshot);
            prop_assert_eq!(first, index);
            prop_assert!(all_bits(&rest) == all_bits(&whole)[index as usize..], "resumed at {}", index);
        }
    }

    /// No tolerance takes longer than exact stops.
    #[test]
    fn no_chain_takes_longer_than_stops(case in cases()) {
        let (config, _) = case.config();
        let [stopping, rounded] = ["G61.1", &format!("G64 P{:.4}", case.p_mm)].map(|code| {
            let report = validate(&case.text(code), &config);
            (report.is_accepted(), report.summary.duration_s)
        });
        prop_assert!(stopping.0 && rounded.0);
        // Both end on the interpolation grid.
        prop_assert!(rounded.1 <= 1.001 * stopping.1 + 2.0 * config.period_s(), "{} and {} s", rounded.1, stopping.1);
    }
}

/// Times of chains of every kind, printed: a line for each.
#[test]
#[ignore = "it prints times, and takes minutes"]
fn times_of_chains() {
    let machines = [0, 3, 4];
    let seeds = std::env::var("SEEDS").map_or(6, |seeds| seeds.parse().expect("a number"));
    let from = std::env::var("FROM").map_or(0, |from| from.parse().expect("a number"));
    for quality in [PlanQuality::Fast, PlanQuality::LeastTime] {
        for (kind, name) in KINDS.iter().enumerate() {
            for seed in from..from + seeds {
                let mut numbers = Numbers::of(seed * 1_000 + kind as u64);
                let block_mm = [0.1, 0.2, 0.35, 0.5, 0.7][numbers.between(0.0, 5.0) as usize];
                let feed = [600.0, 1_500.0, 3_000.0, 10_000.0][numbers.between(0.0, 4.0) as usize];
                let machine_kind = machines[numbers.between(0.0, 3.0) as usize];
                let vectors = numbers.next() < 0.4;
                let (config, letters) = machine(machine_kind, quality);
                let form = if vectors { Form::Vectors } else { Form::Angles(letters) };
                let places = chain(kind, block_mm, &mut numbers);
                let cut = text(&places, form, feed);
                let mut line =
                    format!("{quality:?} | {name} | {seed} | {block_mm} F{feed} machine {machine_kind} {vectors}");
                for code in ["G61.1", "G64 P0.005", "G64 P0.02", "G64 P0.05", "G64 P0.2"] {
                    let began = std::time::Instant::now();
                    let report = validate(&format!("{code}\n{cut}"), &config);
                    assert!(report.is_accepted(), "{cut}{:?}", report.findings.first());
                    let _ = write!(line, " | {:.4} ({:.2})", report.summary.duration_s, began.elapsed().as_secs_f64());
                }
                println!("{line}");
            }
        }
    }
}
