//! Path control from program text to setpoints: exact, with rounded corners, and with merged blocks.

use std::sync::Arc;

use crate::common::{Setpoints, resume, run, run_in_pieces, snapshots, validate};
use feedwave_cutting::{MachineProfile, Pipeline, PipelineConfig, PlanQuality, Step};
use proptest::prelude::*;

fn mill() -> PipelineConfig {
    PipelineConfig::new(MachineProfile::mill())
}

const SQUARE: [[f64; 2]; 5] = [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0], [0.0, 0.0]];

fn square(control: &str) -> Setpoints {
    square_at(3000, control)
}

fn square_at(feed: u32, control: &str) -> Setpoints {
    let program = format!("G17 G21 G90 M3 S3000 F{feed}. {control}\nG1 X20.\nY20.\nX0.\nY0.\nM30\n");
    run(&program, &mill())
}

/// Distance from setpoint `index` to the polyline through `corners`, mm.
fn distance(setpoints: &Setpoints, index: usize, corners: &[[f64; 2]]) -> f64 {
    let [x, y] = [setpoints.axes[0][index], setpoints.axes[1][index]];
    let to = |pair: &[[f64; 2]]| {
        let [dx, dy] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
        let along = ((x - pair[0][0]) * dx + (y - pair[0][1]) * dy) / (dx * dx + dy * dy);
        let along = along.clamp(0.0, 1.0);
        (x - pair[0][0] - along * dx).hypot(y - pair[0][1] - along * dy)
    };
    corners.windows(2).map(to).fold(f64::INFINITY, f64::min)
}

/// Lowest feed between the first and the last second-tenth of the program, mm/min.
fn lowest_feed(setpoints: &Setpoints) -> f64 {
    setpoints.feed[100..setpoints.len() - 100].iter().copied().fold(f64::INFINITY, f64::min)
}

#[test]
fn a_square_with_rounded_corners_runs_through_them_within_tolerance() {
    // At a feed at which rounding the corners is quicker than stopping in them.
    for (tolerance_mm, feed) in [(0.01, 500), (0.05, 2000), (0.2, 3000), (1.0, 3000)] {
        let rounded = square_at(feed, &format!("G64 P{tolerance_mm}"));
        let largest = (0..rounded.len()).map(|index| distance(&rounded, index, &SQUARE)).fold(0.0, f64::max);
        assert!(largest <= tolerance_mm && largest > 0.5 * tolerance_mm, "{largest} mm off of {tolerance_mm}");
        let slowest = lowest_feed(&rounded);
        assert!(slowest > 300.0, "{slowest} mm/min at {tolerance_mm} mm");
        let last = rounded.len() - 1;
        assert_eq!([rounded.axes[0][last], rounded.axes[1][last]], [0.0, 0.0]);
    }
}

#[test]
fn exact_corners_are_met() {
    for control in ["", "G61", "G61.1", "G64 P0"] {
        let exact = square(control);
        let largest = (0..exact.len()).map(|index| distance(&exact, index, &SQUARE)).fold(0.0, f64::max);
        assert!(largest < 1e-9, "{largest} mm off under {control}");
    }
}

#[test]
fn tolerance_gains_time() {
    let stopping = square("G61.1").len();
    let rounded = ["P0.1", "P0.3", "P1"].map(|tolerance| square(&format!("G64 {tolerance}")).len());
    assert!(rounded[0] < stopping && rounded.is_sorted_by(|a, b| a > b), "{rounded:?} against {stopping}");
    // Where it gains none, it costs none.
    let small = ["P0.005", "P0.01", "P0.02", "P0.05"].map(|tolerance| square(&format!("G64 {tolerance}")).len());
    assert!(small.iter().all(|&small| small <= stopping), "{small:?} against {stopping}");
}

#[test]
fn a_polygon_close_to_a_circle_runs_like_the_circle() {
    let polygon = |control: &str| {
        let mut text = format!("G17 G21 G90 M3 S3000 F3000. {control}\nG0 X20.\nG1\n");
        for degrees in 1..=360 {
            let angle_rad = f64::from(degrees).to_radians();
            text += &format!("X{:.4} Y{:.4}\n", 20.0 * angle_rad.cos(), 20.0 * angle_rad.sin());
        }
        run(&(text + "M30\n"), &mill())
    };
    let circle = run("G17 G21 G90 M3 S3000 F3000.\nG0 X20.\nG3 I-20.\nM30\n", &mill()).len();
    let [stopping, rounded] = ["G61.1", "G64 P0.01 Q0"].map(|control| polygon(control).len());
    assert!(stopping > circle + circle / 2, "{stopping} against {circle}");
    assert!(rounded < circle + circle / 50, "{rounded} against {circle}");
}

#[test]
fn stops_between_keep_the_programmed_point() {
    for between in ["G4 P10", "G9", "M0", "M8", "S2000", "G0 Z1."] {
        let (block, prefix) = if between == "G9" { (String::new(), "G9 ") } else { (format!("{between}\n"), "") };
        let program = format!("G17 G21 G90 M3 S3000 F3000. G64 P0.5\n{prefix}G1 X20.\n{block}G1 Y20.\nM30\n");
        let setpoints = run(&program, &mill());
        let corner = |index: usize| (setpoints.axes[0][index] - 20.0).hypot(setpoints.axes[1][index]);
        let nearest = (0..setpoints.len()).map(corner).fold(f64::INFINITY, f64::min);
        assert!(nearest < 0.03, "{between}: {nearest}");
    }
}

#[test]
fn short_blocks_of_a_line_run_like_the_line() {
    let mut short = String::from("G17 G21 G90 M3 S3000 F6000. G64 P0.02 Q0.01\nG1\n");
    for k in 1..=1_000 {
        short += &format!("X{:.3} Y{:.3}\n", f64::from(k) * 0.05, if k % 2 == 0 { 0.002 } else { 0.0 });
    }
    short += "Y10.\nM30\n";
    let setpoints = run(&short, &mill());
    let line = run("G17 G21 G90 M3 S3000 F6000. G64 P0.02\nG1 X50.\nY10.\nM30\n", &mill());
    assert!(setpoints.len().abs_diff(line.len()) <= 2, "{} and {}", setpoints.len(), line.len());
    let report = validate(&short, &mill());
    assert_eq!(report.summary.cutting_moves, 1_001);
    assert!(report.is_accepted());
}

#[test]
fn inverse_time_means_the_programmed_length() {
    let square = |mode: &str, feed: &str| {
        let sides = ["X20.", "Y20.", "X0.", "Y0."].map(|side| format!("G1 {side} {feed}\n")).concat();
        run(&format!("G17 G21 G90 {mode} M3 S3000 G64 P1\n{sides}M30\n"), &mill())
    };
    // 20 mm in 1/150 of a minute.
    assert!(square("G93", "F150.") == square("G94", "F3000."));
}

#[test]
fn a_corner_counts_as_part_of_the_later_block() {
    let setpoints = square("G64 P1");
    let corner = (0..setpoints.len())
        .find(|&index| {
            setpoints.axes[0][index] < 20.0 && setpoints.axes[0][index] > 10.0 && setpoints.axes[1][index] > 0.0
        })
        .expect("the path leaves the first side before its end");
    assert_eq!(setpoints.line[corner - 10], 2);
    assert_eq!(setpoints.line[corner], 3);
}

/// Distance of a point from a polyline.
fn off_polyline(points: &[[f64; 2]], [x, y]: [f64; 2]) -> f64 {
    let off = |pair: &[[f64; 2]]| {
        let [[ax, ay], [bx, by]] = [pair[0], pair[1]];
        let (dx, dy) = (bx - ax, by - ay);
        let share = (((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        (x - ax - share * dx).hypot(y - ay - share * dy)
    };
    points.windows(2).map(off).fold(f64::INFINITY, f64::min)
}

#[test]
fn short_blocks_become_one_curve_within_the_tolerance_both_ways() {
    // A wave in blocks of about 0.2 mm, written to a micrometre, with a wall of 25 mm and a corner behind it.
    let mut points: Vec<[f64; 2]> =
        (0..=200).map(|k| f64::from(k) * 0.2).map(|x| [x, (2.0 * (0.35 * x).sin() * 1e3).round() / 1e3]).collect();
    let last = points[points.len() - 1];
    points.extend([[last[0] + 25.0, last[1]], [last[0] + 25.0, last[1] + 10.0]]);
    let tolerances = [0.005, 0.02, 0.1];
    let cases = [PlanQuality::Fast, PlanQuality::LeastTime]
        .map(|quality| tolerances.map(|tolerance_mm| (quality, tolerance_mm)));
    for (quality, tolerance_mm) in cases.into_iter().flatten() {
        let mut config = PipelineConfig { interpolation_period_us: 250, ..mill() };
        config.profile.plan_quality = quality;
        let mut text = format!("G17 G21 G90 M3 S3000 F3000. G64 P{tolerance_mm} Q0\nG0 X0. Y0.\nG1\n");
        for [x, y] in &points[1..] {
            text += &format!("X{x:.3} Y{y:.3}\n");
        }
        let setpoints = run(&(text + "M30\n"), &config);
        let path: Vec<[f64; 2]> = (0..setpoints.len()).map(|k| [setpoints.axes[0][k], setpoints.axes[1][k]]).collect();
        let farthest = path.iter().map(|&point| off_polyline(&points, point)).fold(0.0, f64::max);
        assert!(farthest <= tolerance_mm, "{farthest} mm off of {tolerance_mm}");
        let mut moving = path.clone();
        moving.dedup();
        let left_out = points.iter().map(|&point| off_polyline(&moving, point)).fold(0.0, f64::max);
        // Setpoints are chords of the curve.
        assert!(left_out <= tolerance_mm + 1e-3, "a point is {left_out} mm off of {tolerance_mm}");
        let on_wall = path.iter().filter(|[x, _]| (last[0] + 10.5..last[0] + 14.5).contains(x));
        let beside = on_wall.map(|[_, y]| (y - last[1]).abs()).fold(0.0, f64::max);
        assert!(beside < 1e-9, "the wall is {beside} mm off");
        assert_eq!(*path.last().expect("it moves"), points[points.len() - 1]);
    }
}

/// A program of lines and arcs, short and long, with changing path control.
fn programs() -> impl Strategy<Value = String> {
    let um = || prop_oneof![-15_000..15_000_i32, -200..200_i32];
    let block = prop_oneof![
        6 => (um(), um()).prop_map(|(x, y)| format!("G1 X{:.3} Y{:.3}\n", f64::from(x) / 1e3, f64::from(y) / 1e3)),
        2 => (500..8_000_i32, any::<bool>()).prop_map(|(radius, clockwise)| {
            let (code, radius) = (if clockwise { 2 } else { 3 }, f64::from(radius) / 1e3);
            let side = if clockwise { -radius } else { radius };
            format!("G{code} X{radius:.3} Y{side:.3} I0. J{side:.3}\n")
        }),
        1 => (0..300_i32, 0..=100_i32).prop_map(|(um, percent)| {
            let tolerance = f64::from(um) / 1e3;
            format!("G64 P{tolerance:.6} Q{:.6}\n", tolerance * f64::from(percent) / 100.0)
        }),
        1 => Just(String::from("G61\n")),
        1 => (500..6_000_u32).prop_map(|feed| format!("F{feed}.\n")),
    ];
    prop::collection::vec(block, 1..25)
        .prop_map(|blocks| format!("G17 G21 G91 M3 S3000 F3000. G64 P0.05\n{}M30\n", blocks.concat()))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn smoothed_programs_stay_within_the_limits_of_the_axes(program in programs()) {
        let config = mill();
        let setpoints = run(&program, &config);
        let period_s = config.period_s();
        for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
            for (k, window) in column.windows(3).enumerate() {
                let velocity = (window[1] - window[0]) / period_s;
                let acceleration = (window[2] - 2.0 * window[1] + window[0]) / (period_s * period_s);
                prop_assert!(velocity.abs() <= axis.max_velocity_per_s * (1.0 + 1e-6), "velocity {velocity} at {k}");
                let rounding = 1e-13 / (period_s * period_s);
                prop_assert!(
                    acceleration.abs() <= axis.max_acceleration_per_s2 * (1.0 + 1e-6) + rounding,
                    "acceleration {acceleration} of {} at {k}, line {}", axis.name, setpoints.line[k]
                );
            }
        }
    }

    #[test]
    fn a_smoothed_stream_resumes_bit_for_bit(program in programs(), choice in any::<prop::sample::Index>()) {
        let config = mill();
        let original = run(&program, &config);
        let taken = snapshots(program.as_bytes(), &config);
        let (index, offset, snapshot) = choice.get(&taken);
        let (first, resumed) = resume(program.as_bytes(), &config, *offset, snapshot);
        prop_assert_eq!(first, *index);
        prop_assert_eq!(first as usize + resumed.len(), original.len());
        for k in 0..resumed.len() {
            prop_assert_eq!(original.bits(first as usize + k), resumed.bits(k), "setpoint {}", first as usize + k);
        }
    }
}

#[test]
fn corners_are_passed_with_the_velocity_step_that_the_machine_permits() {
    let mut config = mill();
    for axis in &mut config.profile.machine.axes {
        axis.max_velocity_step_per_s = 10.0;
    }
    let program = "G17 G21 G90 M3 S3000 F3000.\nG1 X20.\nY20.\nX0.\nY0.\nM30\n";
    let passing = run(program, &config);
    let resting = run(program, &mill());
    assert!(passing.len() + 5 < resting.len(), "{} of {}", passing.len(), resting.len());
    // At a right angle one axis stops and the other starts: both by the speed of the path, 10 mm/s = 600 mm/min.
    assert!((lowest_feed(&passing) - 600.0).abs() < 60.0, "{}", lowest_feed(&passing));
    let largest = (0..passing.len()).map(|index| distance(&passing, index, &SQUARE)).fold(0.0, f64::max);
    assert!(largest < 1e-9, "{largest} mm off");
    let period_s = config.period_s();
    for column in &passing.axes[..2] {
        let steps = column.windows(3).map(|p| ((p[2] - p[1]) - (p[1] - p[0])) / period_s);
        let largest = steps.map(f64::abs).fold(0.0, f64::max);
        // The step, and what the axis gains in a period beside it.
        assert!(largest <= 10.0 + 2.0 * 10_000.0 * period_s, "{largest} mm/s within a period");
    }
    // The axis with the smallest step decides, and one without any makes the path rest.
    config.profile.machine.axes[1].max_velocity_step_per_s = 0.0;
    assert_eq!(run(program, &config), resting);
}

/// How much of a program is read before its first setpoint but the start comes, as a share of its bytes, in pieces.
fn read_before_the_first(program: &str, config: &PipelineConfig) -> f64 {
    const PIECE: usize = 256;
    let mut pipeline = Pipeline::new(Arc::new(config.clone()));
    let mut block = pipeline.new_block();
    let mut read = 0;
    loop {
        match pipeline.next_setpoints(&mut block, 2) {
            Step::NeedInput(place) => {
                read = (place.offset as usize + PIECE).min(program.len());
                pipeline.supply(place, &program.as_bytes()[..read]);
            }
            Step::Block => return read as f64 / program.len() as f64,
            step => panic!("{step:?}: {:#?}", pipeline.findings()),
        }
    }
}

/// Blocks of 0.05 mm along a gentle wave, sixteen of which lie in one line within a hundredth.
fn merged_blocks(count: u32, control: &str) -> String {
    let mut text = format!("G17 G21 G90 G94 F6000. {control}\nG1\n");
    for k in 1..=count {
        let x = 0.05 * f64::from(k);
        text += &format!("X{x:.3} Y{:.4}\n", 4.0 * (0.2 * x).sin());
    }
    text + "M30\n"
}

#[test]
fn merged_blocks_come_as_early_as_others_and_the_same_however_they_arrive() {
    let program = merged_blocks(20_000, "G64 P0.02");
    for quality in [PlanQuality::Fast, PlanQuality::LeastTime] {
        let mut config = mill();
        config.profile.plan_quality = quality;
        let exact = read_before_the_first(&merged_blocks(20_000, "G64 P0.02 Q0"), &config);
        let merged = read_before_the_first(&program, &config);
        // A second of the path, what a stop takes, and a window of the curve; three quarters of the program before.
        assert!(merged < 0.3 && exact < 0.3, "{merged} merged, {exact} not");
        let whole = run_in_pieces(program.as_bytes(), &config, usize::MAX);
        for piece in [97, 4_096] {
            assert!(run_in_pieces(program.as_bytes(), &config, piece) == whole, "in pieces of {piece}");
        }
    }
}
