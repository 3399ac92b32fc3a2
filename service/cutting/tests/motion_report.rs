//! What a report says of the motion: deviation from the programmed path, limits by axis, and where time is lost.

use crate::common::{run, validate};
use feedwave_cutting::{MachineProfile, PipelineConfig, PlanQuality, ProgramSummary, SlowdownCause, SlowdownCure};

/// A mill on which 50 mm/s are reached within 0.065 s and 1.625 mm: 1 000 mm/s², 66 666.7 mm/s³.
fn mill() -> PipelineConfig {
    let mut config = PipelineConfig::new(MachineProfile::mill());
    for axis in &mut config.profile.machine.axes {
        (axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3) = (500.0, 1_000.0, 1e6 / 15.0);
    }
    config
}

const FEED_MM_PER_S: f64 = 50.0;
/// Time of a change of speed between rest and the feed, s: v/a + a/j.
const CHANGE_S: f64 = 0.05 + 0.015;

fn square(control: &str) -> String {
    format!("G17 G21 G90 G94 F3000. {control}\nG1 X20.\nY20.\nX0.\nY0.\nM30\n")
}

fn summary(program: &str, config: &PipelineConfig) -> ProgramSummary {
    let report = validate(program, config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    report.summary
}

#[test]
fn an_exact_stop_costs_two_changes_of_speed() {
    let summary = summary(&square("G61.1"), &mill());
    // Half of a change is lost at the mean speed.
    // All of them are as bad but for rounding.
    let mut slowdowns = summary.slowdowns.clone();
    slowdowns.sort_by_key(|slowdown| slowdown.source.line);
    assert_eq!(slowdowns.len(), 3);
    for (slowdown, line) in slowdowns.iter().zip([3, 4, 5]) {
        assert!((slowdown.lost_s - CHANGE_S).abs() < 1e-9, "{}", slowdown.lost_s);
        assert_eq!((slowdown.source.line, slowdown.times), (line, 1));
        assert_eq!(slowdown.cause, SlowdownCause::ExactStop);
        assert_eq!(slowdown.cure, SlowdownCure::Tolerance);
        assert!(slowdown.slowest_mm_per_min.abs() < 1e-6);
    }
    assert!((summary.slowdown_time_s - 3.0 * CHANGE_S).abs() < 1e-9, "{}", summary.slowdown_time_s);
    let without_s = 80.0 / FEED_MM_PER_S + CHANGE_S;
    assert!((summary.duration_s - without_s - summary.slowdown_time_s).abs() < 1e-9);
    assert_eq!(summary.path_deviation, None, "the exact path is run");
}

#[test]
fn what_is_lost_is_what_the_program_takes_longer_than_at_its_feed() {
    for quality in [PlanQuality::Fast, PlanQuality::LeastTime] {
        let mut config = mill();
        config.profile.plan_quality = quality;
        // The last period of a program is a whole one.
        config.interpolation_period_us = 250;
        for control in ["G61", "G64 P0.01", "G64 P0.05", "G64 P0.3"] {
            let summary = summary(&square(control), &config);
            let lost_s = summary.duration_s - summary.path_length_mm / FEED_MM_PER_S - CHANGE_S;
            // The start of a plan for the least time may be a little slower than the closed form.
            assert!(
                (lost_s - summary.slowdown_time_s).abs() < 2e-3,
                "{control}: {lost_s}, {}",
                summary.slowdown_time_s
            );
            assert_eq!(summary.slowdowns.len(), 3, "{control}");
        }
    }
}

#[test]
fn the_deviation_is_that_of_the_setpoints() {
    let corners = [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0], [0.0, 0.0]];
    for tolerance_mm in [0.02, 0.2] {
        let program = square(&format!("G64 P{tolerance_mm}"));
        let mut config = mill();
        config.interpolation_period_us = 250;
        // In fast plans these corners stay exact: stopping in them takes less time.
        config.profile.plan_quality = PlanQuality::LeastTime;
        let setpoints = run(&program, &config);
        let off = |k: usize| {
            let [x, y] = [setpoints.axes[0][k], setpoints.axes[1][k]];
            let to = |pair: &[[f64; 2]]| {
                let [dx, dy] = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
                let share = (((x - pair[0][0]) * dx + (y - pair[0][1]) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
                (x - pair[0][0] - share * dx).hypot(y - pair[0][1] - share * dy)
            };
            corners.windows(2).map(to).fold(f64::INFINITY, f64::min)
        };
        let seen_mm = (0..setpoints.len()).map(off).fold(0.0, f64::max);
        let deviation = summary(&program, &config).path_deviation.expect("corners are rounded");
        assert!(deviation.largest_mm <= tolerance_mm && deviation.largest_mm >= seen_mm, "{deviation:?}, {seen_mm}");
        // The corner is farther from the curve than the curve from the sides: by √2 at a right angle.
        assert!(deviation.largest_mm < 1.5 * seen_mm, "{deviation:?}, {seen_mm}");
        assert_eq!(deviation.source.line, 3, "the first corner");
        let names: Vec<_> = deviation.axes.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["X", "Y", "Z"]);
        let [x, y] = [deviation.axes[0].1, deviation.axes[1].1];
        let from_corner = (x - 20.0).hypot(y);
        assert!((from_corner - deviation.largest_mm).abs() < 1e-6, "{from_corner} mm from the corner");
    }
}

#[test]
fn merged_points_count_as_deviation() {
    let mut program = String::from("G17 G21 G90 F3000. G64 P0.2\nG1\n");
    for k in 1..=100 {
        program += &format!("X{:.3} Y{}\n", f64::from(k) * 0.1, if k == 37 { 0.004 } else { 0.0 });
    }
    let deviation = summary(&(program + "M30\n"), &mill()).path_deviation.expect("a point is left out");
    assert!((deviation.largest_mm - 0.004).abs() < 1e-12, "{deviation:?}");
    assert!((deviation.axes[0].1 - 3.7).abs() < 1e-9, "{deviation:?}");
}

#[test]
fn each_place_has_the_cure_that_helps() {
    // A circle in chords wants to be an arc, and takes less time as one.
    let polygon: String = (1..=360)
        .map(|degrees| f64::from(degrees).to_radians())
        .map(|angle_rad| format!("X{:.4} Y{:.4}\n", 2.0 * angle_rad.cos(), 2.0 * angle_rad.sin()))
        .collect();
    let chords = summary(&format!("G17 G21 G90 F20000. G64 P0.01 Q0\nG0 X2.\nG1\n{polygon}M30\n"), &mill());
    let short: Vec<_> = chords.slowdowns.iter().filter(|at| at.cause == SlowdownCause::ShortBlocks).collect();
    assert!(!short.is_empty(), "{:#?}", chords.slowdowns);
    assert!(short.iter().all(|at| at.cure == SlowdownCure::Arc), "{:?}", chords.slowdowns);
    // An arc that the acceleration of its axes limits, between a start and an end that are none of it.
    let mut in_runs = mill();
    in_runs.profile.plan_quality = PlanQuality::Fast;
    let arc = summary("G17 G21 G90 F20000. G61\nG0 X20.\nG3 I-20. J0.\nM30\n", &in_runs);
    let [curve] = arc.slowdowns.as_slice() else { panic!("{:?}", arc.slowdowns) };
    assert_eq!((curve.source.line, curve.cause), (3, SlowdownCause::Curve), "{curve:?}");
    assert_eq!(curve.cure, SlowdownCure::Acceleration, "{curve:?}");
    assert!(curve.lost_s > 0.3 * arc.duration_s, "{curve:?} of {} s", arc.duration_s);
    // With stops before and behind the arc all of it is one slow place, named by its last stop.
    let into = summary("G17 G21 G90 F20000. G61\nG0 X20.\nG1 Y50.\nG3 X-20. I-20. J0.\nG1 Y0.\nM30\n", &in_runs);
    let [stops] = into.slowdowns.as_slice() else { panic!("{:?}", into.slowdowns) };
    assert_eq!((stops.source.line, stops.cause), (5, SlowdownCause::ExactStop), "{stops:?}");
    assert_eq!(stops.cure, SlowdownCure::Tolerance, "{stops:?}");
    // A reversal stays exact whatever the tolerance.
    let back = summary("G17 G21 G90 F3000. G64 P0.1\nG1 X20.\nX0.\nM30\n", &mill());
    assert_eq!(back.slowdowns[0].cure, SlowdownCure::Jerk, "{:?}", back.slowdowns);
    assert_eq!(back.slowdowns[0].axis, "X");
}

#[test]
fn feeds_that_change_and_stops_that_are_asked_for_are_no_slowdowns() {
    let summary =
        summary("G17 G21 G90 F3000.\nG1 X20.\nX40. F1500.\nX60. F3000.\nG4 P100\nX80.\nM0\nX90.\nM30\n", &mill());
    assert_eq!(summary.slowdowns, [], "{:?}", summary.slowdown_time_s);
    assert_eq!(summary.slowdown_time_s, 0.0);
}

#[test]
fn a_loop_adds_up_at_its_lines() {
    let program =
        "G17 G21 G90 F3000. G61.1\n#1=0\nWHILE [#1 LT 5] DO1\nG1 X20.\nY10.\nX0.\nY0.\n#1=[#1+1]\nEND1\nM30\n";
    let summary = summary(program, &mill());
    let mut times: Vec<_> = summary.slowdowns.iter().map(|slowdown| (slowdown.source.line, slowdown.times)).collect();
    assert_eq!(times.last(), Some(&(4, 4)), "the first pass over the first side comes from rest");
    times.sort_unstable();
    assert_eq!(times, [(4, 4), (5, 5), (6, 5), (7, 5)]);
}

#[test]
fn limits_of_the_axes_share_the_time_that_the_limits_have() {
    let mut config = mill();
    config.profile.machine.axes[1].max_jerk_per_s3 = 2e4;
    for quality in [PlanQuality::Fast, PlanQuality::LeastTime] {
        config.profile.plan_quality = quality;
        let program = "G17 G21 G90 F3000. G64 P0.02\nG0 X10. Y10. Z5.\nG1 X30. F40000.\nG3 X40. Y20. I0. J10.\n\
                       G1 Y60.\nX0. F3000.\nY0.\nM30\n";
        let summary = summary(program, &config);
        let times = &summary.limit_times;
        let of_limits = times.axis_velocity_s + times.curvature_s + times.acceleration_s + times.jerk_s;
        let axes = &summary.axis_limit_times;
        let of_axes: f64 = axes.iter().map(|axis| axis.velocity_s + axis.acceleration_s + axis.jerk_s).sum();
        assert!((of_limits - of_axes).abs() < 1e-9 * of_limits, "{of_limits} and {of_axes} s");
        let names: Vec<_> = axes.iter().map(|axis| axis.axis.as_str()).collect();
        assert_eq!(names, ["X", "Y", "Z"]);
        // The weaker Y is at its jerk for longer than X on the way of the same shape.
        assert!(axes[1].jerk_s > axes[0].jerk_s, "{axes:?}");
    }
}

#[test]
fn a_stop_that_is_quicker_than_rounding_is_cured_by_jerk() {
    // At 50 mm/s and 5 µm a stop in a right angle takes less time than the curve, in a plan of runs.
    let mut mill = mill();
    mill.profile.plan_quality = PlanQuality::Fast;
    let summary = summary(&square("G64 P0.005"), &mill);
    assert_eq!(summary.slowdowns.len(), 3);
    assert_eq!(summary.path_deviation, None, "the corners stay");
    for slowdown in &summary.slowdowns {
        assert_eq!((slowdown.cause, slowdown.cure), (SlowdownCause::Corner, SlowdownCure::Jerk));
        assert!(["X", "Y"].contains(&slowdown.axis.as_str()), "{}", slowdown.axis);
    }
    // Followed to the letter, it saves time.
    let mut faster = mill;
    for axis in &mut faster.profile.machine.axes {
        axis.max_jerk_per_s3 *= 1.5;
    }
    let shorter = validate(&square("G64 P0.005"), &faster).summary;
    assert!(shorter.slowdown_time_s < 0.95 * summary.slowdown_time_s, "{}", shorter.slowdown_time_s);
}
