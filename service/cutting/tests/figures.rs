//! What the summary says of a plan: what governs its time, and where its peaks are.

use crate::common::{run, validate};
use feedwave_cutting::{AxisSummary, LimitTimes, MachineProfile, OverrideChange, PipelineConfig, PlanQuality};

fn mill() -> PipelineConfig {
    PipelineConfig::new(MachineProfile::mill())
}

#[track_caller]
fn assert_near(found: f64, wanted: f64) {
    assert!((found - wanted).abs() <= 1e-6, "{found} for {wanted}");
}

fn total_s(times: &LimitTimes) -> f64 {
    let LimitTimes { feed_s, axis_velocity_s, curvature_s, corners_s, acceleration_s, jerk_s, rest_s } = *times;
    feed_s + axis_velocity_s + curvature_s + corners_s + acceleration_s + jerk_s + rest_s
}

#[test]
fn the_time_of_one_line_divides_as_its_profile_does() {
    // 100 mm at 100 mm/s; the axis has 10 000 mm/s² and 5e6 mm/s³: ramps of 2 ms, which change the speed by 20 mm/s
    // together, a hold of 80/10 000 s, and 12 ms and 0.6 mm for each of the two changes.
    let summary = validate("G21 G90 G94 G1 X100. F6000.\nG4 P500\nM30\n", &mill()).summary;
    let times = summary.limit_times;
    assert_near(times.jerk_s, 4.0 * 0.002);
    assert_near(times.acceleration_s, 2.0 * 0.008);
    assert_near(times.feed_s, (100.0 - 2.0 * 0.6) / 100.0);
    assert_eq!((times.axis_velocity_s, times.curvature_s, times.corners_s), (0.0, 0.0, 0.0));
    assert!(times.rest_s >= 0.5 && times.rest_s < 0.501, "{times:?}");
    assert_near(total_s(&times), summary.duration_s);
}

#[test]
fn the_limits_that_govern_are_told_apart() {
    // A rapid and a feed that no axis can follow: both lines run at the axis' velocity.
    let fast = validate("G21 G90 G94 G0 X300.\nG1 X0. F99000.\nM30\n", &mill()).summary.limit_times;
    assert!(fast.axis_velocity_s > 0.5 && fast.feed_s == 0.0 && fast.curvature_s == 0.0, "{fast:?}");
    // A circle of 0.5 mm at 6 m/min would take 20 000 mm/s²: its curvature decides.
    let arc = "G21 G90 G94 G17 G1 X10. F6000.\nG3 X10. Y0. I0. J0.5\nG3 X10. Y0. I0. J0.5\nG1 X20.\nM30\n";
    let arc = validate(arc, &mill()).summary.limit_times;
    assert!(arc.curvature_s > 0.05 && arc.feed_s > 0.0 && arc.axis_velocity_s == 0.0, "{arc:?}");
    // At half the feed, that feed is what governs.
    let config = PipelineConfig { overrides: vec![OverrideChange { index: 0, ratio: 0.5 }], ..mill() };
    let half = validate("G21 G90 G94 G1 X100. F6000.\nM30\n", &config).summary;
    assert!(half.limit_times.feed_s > 1.9 && half.limit_times.corners_s == 0.0, "{half:?}");
    // Feed hold is rest.
    let overrides = vec![OverrideChange { index: 200, ratio: 0.0 }, OverrideChange { index: 1_200, ratio: 1.0 }];
    let held = validate("G21 G90 G94 G1 X100. F6000.\nM30\n", &PipelineConfig { overrides, ..mill() }).summary;
    assert!(held.rest_time_s > 0.98 && held.rest_time_s < 1.0, "{held:?}");
    assert_eq!(held.rest_time_s, held.limit_times.rest_s);
    assert_near(total_s(&held.limit_times), held.duration_s);
}

#[test]
fn peaks_are_where_the_setpoints_have_them_first() {
    let program =
        "G21 G90 G94 G17 G0 X0 Y0 Z5\nG1 Z0 F3000\nX30 F2400\nG3 X40 Y10 R10\nG1 Y30\nX10\nG4 P50\nX0 Y20 F1200\nM30\n";
    let config = mill();
    let (summary, setpoints) = (validate(program, &config).summary, run(program, &config));
    let h = config.period_s();
    for (axis, column) in summary.axes.iter().zip(&setpoints.axes) {
        let AxisSummary { peak_velocity_at, peak_acceleration_at, peak_jerk_at, .. } = axis;
        let difference = |order: usize, k: usize| match order {
            1 => (column[k] - column[k - 1]) / h,
            2 => (column[k] - 2.0 * column[k - 1] + column[k - 2]) / (h * h),
            _ => (column[k] - 3.0 * column[k - 1] + 3.0 * column[k - 2] - column[k - 3]) / (h * h * h),
        };
        let peaks = [
            (1, axis.peak_velocity_per_s, peak_velocity_at),
            (2, axis.peak_acceleration_per_s2, peak_acceleration_at),
            (3, axis.peak_jerk_per_s3, peak_jerk_at),
        ];
        for (order, peak, place) in peaks {
            let place = place.expect("every axis moves");
            let k = place.setpoint_index as usize;
            assert!((difference(order, k).abs() / peak - 1.0).abs() < 1e-5, "{} {order} at {k}", axis.axis);
            assert_eq!((place.time_s, place.line), (k as f64 * h, setpoints.line[k]));
            for k in order..column.len() {
                let found = difference(order, k).abs();
                assert!(found <= peak * (1.0 + 1e-6), "{found} at {k} above {peak} of {}", axis.axis);
                assert!(k >= place.setpoint_index as usize || found < peak, "{order} of {} is at {k}", axis.axis);
            }
        }
    }
    // An axis at rest has no peak.
    let still = validate("G21 G90 G94 G1 X10. F600.\nM30\n", &config).summary;
    assert_eq!(still.axes[1].peak_velocity_at, None);
    assert_eq!(still.axes[1].peak_jerk_per_s3, 0.0);
}

#[test]
fn the_look_ahead_of_the_profile_decides_how_fast_short_blocks_run() {
    let line = |k: u32| format!("X{}.{:02}\n", k / 100, k % 100);
    let program: String = "G21 G90 G94 G1 F6000.\n".to_owned() + &(1..=2_000).map(line).collect::<String>() + "M30\n";
    let duration_s = |look_ahead_blocks| {
        let profile = MachineProfile { look_ahead_blocks, plan_quality: PlanQuality::Fast, ..MachineProfile::mill() };
        validate(&program, &PipelineConfig::new(profile)).summary.duration_s
    };
    // From 4 blocks of 10 µm one can stop at 5 mm/s or so; 5 000 show the whole line.
    let (near, far) = (duration_s(4), duration_s(5_000));
    assert!(far < 0.25 && near > 4.0 * far, "{near} s and {far} s");
}
