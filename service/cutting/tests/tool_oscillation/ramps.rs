//! Oscillation where the path climbs or descends: setpoints against p_cmd + u·x̂ + w·ẑ + y·ĉ with x̂ the direction of the path in space,
//! limits, travel and what is judged.

use feedwave_cutting::tool_oscillation::{
    DirectionOscillation, OscillationDirection, OscillationDrives, OscillationJob, ToolOscillation, Waveform, blend,
    judge,
};
use feedwave_cutting::{AxisDrive, DriveModel, FollowingModel, OverrideChange, PipelineConfig};
use feedwave_program::Axis;

use super::program::config;
use super::{condition, job, tool};
use crate::common::course::Course;
use crate::common::{Setpoints, resume, run, snapshots, validate};

/// Two periods of 1 mm.
const RAMP_MM: f64 = 2.0;

fn crossing() -> PipelineConfig {
    let mut config = config();
    for named in &mut config.profile.tool_oscillation {
        named.condition.cross =
            Some(DirectionOscillation { amplitude_mm: 0.1, waveform: Waveform::Sine, phase_deg: 40.0 });
    }
    config
}

fn program(words: &str, path: &str) -> String {
    format!("G21 G90 G17 G94 T4 M6\nM3 S600\nG0 X0 Y0 Z20\nG202 P1 D1 {words}\n{path}\nG203\nM30\n")
}

/// Place and unit direction of the path at a distance along it.
type Path<'a> = dyn Fn(f64) -> ([f64; 3], [f64; 3]) + 'a;

fn line(end: [f64; 3]) -> (f64, impl Fn(f64) -> ([f64; 3], [f64; 3])) {
    let start = [0.0, 0.0, 20.0];
    let travel: [f64; 3] = core::array::from_fn(|axis| end[axis] - start[axis]);
    let length_mm = travel.iter().map(|part| part * part).sum::<f64>().sqrt();
    let along = travel.map(|part| part / length_mm);
    (length_mm, move |s: f64| (core::array::from_fn(|axis| start[axis] + s * along[axis]), along))
}

#[track_caller]
fn assert_formula(setpoints: &Setpoints, config: &PipelineConfig, clockwise: bool, length_mm: f64, path: &Path<'_>) {
    let condition = &config.profile.tool_oscillation[0].condition;
    let oscillation = ToolOscillation::new(&tool(), condition, 1, 1).expect("possible");
    let base_mm = setpoints.path.last().expect("setpoints") - length_mm;
    let mut whole = 0;
    for index in 0..setpoints.len() {
        let along_mm = setpoints.path[index] - base_mm;
        if along_mm <= 0.0 {
            continue;
        }
        let share = blend(along_mm / RAMP_MM) * blend((length_mm - along_mm) / RAMP_MM);
        whole += u32::from(share == 1.0);
        let (place, along) = path(along_mm);
        let azimuth_deg = libm::atan2(along[1], along[0]).to_degrees();
        let turned_deg = if clockwise { 1.0 } else { -1.0 } * (setpoints.spindle[index] + azimuth_deg);
        let offset = oscillation.offset(turned_deg / 360.0);
        let in_plane = libm::hypot(along[0], along[1]);
        let beside = [along[1] / in_plane, -along[0] / in_plane, 0.0];
        for axis in 0..3 {
            let retracted_mm = if axis == 2 { offset.retraction_mm } else { 0.0 };
            let moved_mm = offset.feed_mm * along[axis] + offset.cross_mm * beside[axis] + retracted_mm;
            let off_mm = setpoints.axes[axis][index] - (place[axis] + share * moved_mm);
            assert!(off_mm.abs() < 1e-9, "setpoint {index}: axis {axis} {off_mm:e} mm off");
        }
        assert!((setpoints.vibration[index] - share * offset.feed_mm).abs() < 1e-9);
    }
    assert!(whole > 100, "{whole} setpoints of the whole oscillation");
}

#[test]
fn ramps_follow_the_formula() {
    for end in [[30.0, 0.0, 5.0], [0.0, -20.0, 31.0], [-12.0, 16.0, 12.0], [5.0, 3.0, 48.0]] {
        let (length_mm, path) = line(end);
        let [x, y, z] = end;
        for config in [config(), crossing()] {
            for (spindle, clockwise) in [("M3", true), ("M4", false)] {
                let text = program("", &format!("G1 X{x} Y{y} Z{z} F600")).replace("M3 S", &format!("{spindle} S"));
                let report = validate(&text, &config);
                assert!(report.is_accepted(), "{end:?}: {:#?}", report.findings);
                assert_formula(&run(&text, &config), &config, clockwise, length_mm, &path);
            }
        }
    }
}

#[test]
fn along_the_feed_alone_the_tip_never_leaves_the_line() {
    for end in [[30.0, 0.0, 5.0], [-12.0, 16.0, 45.0]] {
        let (length_mm, path) = line(end);
        let [x, y, z] = end;
        let setpoints = run(&program("A0.4 Q0", &format!("G1 X{x} Y{y} Z{z} F600")), &config());
        let (start, along) = path(0.0);
        let base_mm = setpoints.path.last().expect("setpoints") - length_mm;
        let mut swung_mm = 0.0_f64;
        for index in (0..setpoints.len()).filter(|&index| setpoints.path[index] > base_mm) {
            let from: [f64; 3] = core::array::from_fn(|axis| setpoints.axes[axis][index] - start[axis]);
            let reached_mm: f64 = (0..3).map(|axis| from[axis] * along[axis]).sum();
            let off_mm = (0..3).map(|axis| (from[axis] - reached_mm * along[axis]).abs()).fold(0.0, f64::max);
            assert!(off_mm < 1e-9, "setpoint {index}: {off_mm:e} mm beside the line");
            assert!((-1e-9..=length_mm + 1e-9).contains(&reached_mm), "{reached_mm}");
            swung_mm = swung_mm.max((reached_mm - (setpoints.path[index] - base_mm)).abs());
        }
        assert!((swung_mm - 0.4).abs() < 1e-3, "{swung_mm}");
    }
}

#[test]
fn helices_and_bows_follow_the_formula() {
    let (radius_mm, rise_mm) = (40.0, -17.0);
    let per_rad_mm = rise_mm / core::f64::consts::PI;
    let rate_mm = libm::hypot(radius_mm, per_rad_mm);
    let helix = move |s: f64| {
        let (sin, cos) = libm::sincos(s / rate_mm);
        let place = [radius_mm * sin, radius_mm - radius_mm * cos, 20.0 + per_rad_mm * s / rate_mm];
        (place, [radius_mm * cos, radius_mm * sin, per_rad_mm].map(|part| part / rate_mm))
    };
    // An arc in the plane of X and Z, 45 degrees down to 45 degrees up.
    let half_mm = 60.0 * core::f64::consts::FRAC_1_SQRT_2;
    let bow = move |s: f64| {
        let (sin, cos) = libm::sincos(s / 60.0 - core::f64::consts::FRAC_PI_4);
        ([half_mm + 60.0 * sin, 0.0, 20.0 + half_mm - 60.0 * cos], [cos, 0.0, sin])
    };
    let arcs: [(String, f64, &Path<'_>); 2] = [
        ("G3 X0 Y80 Z3 I0 J40 F600".to_owned(), core::f64::consts::PI * rate_mm, &helix),
        (
            format!("G18 G2 X{:.9} Z20 I{half_mm:.9} K{half_mm:.9} F600", 2.0 * half_mm),
            30.0 * core::f64::consts::PI,
            &bow,
        ),
    ];
    for (arc, length_mm, path) in arcs {
        for config in [config(), crossing()] {
            let text = program("", &arc);
            let report = validate(&text, &config);
            assert!(report.is_accepted(), "{arc}: {:#?}", report.findings);
            assert_formula(&run(&text, &config), &config, true, length_mm, path);
        }
    }
}

#[test]
fn curves_at_corners_that_climb_follow_the_formula() {
    let path = "G64 P2\nG1 X30 F150\nX55 Z10\nX80 Y15 Z12\nX95 Y40 Z22";
    // The dwell rests on the start of the cut.
    let still = program("A0 Q0", path).replace("\nG202", "\nG4 P0.1\nG202");
    let course = Course::of_tip(&run(&still, &config()), |line| line >= 6);
    for config in [config(), crossing()] {
        let text = program("", &path.replace("F150", "F600"));
        let report = validate(&text, &config);
        assert!(report.is_accepted(), "{:#?}", report.findings);
        let along = |s: f64| course.at(s);
        assert_formula(&run(&text, &config), &config, true, course.length_mm(), &along);
    }
}

/// The largest velocity, acceleration and jerk of a column by differences.
fn by_differences(column: &[f64], period_s: f64) -> [f64; 3] {
    let mut most = [0.0_f64; 3];
    for k in column.windows(4) {
        let here = [
            (k[1] - k[0]) / period_s,
            (k[2] - 2.0 * k[1] + k[0]) / period_s.powi(2),
            (k[3] - 3.0 * (k[2] - k[1]) - k[0]) / period_s.powi(3),
        ];
        most = core::array::from_fn(|order| most[order].max(here[order].abs()));
    }
    most
}

#[test]
fn limits_hold_where_the_path_climbs() {
    for period_us in [250, 1_000] {
        let changes = [(800, 2.0), (1_500, 0.6), (2_100, 2.0)];
        let overrides =
            changes.map(|(index, ratio)| OverrideChange { index: index * 1_000 / u64::from(period_us), ratio });
        let mut config =
            PipelineConfig { interpolation_period_us: period_us, overrides: overrides.to_vec(), ..crossing() };
        // Plane and axis have less than what is along the feed, to which every axis has a part here.
        let limits = [(60.0, 4_000.0, 700_000.0), (60.0, 4_000.0, 700_000.0), (60.0, 3_000.0, 700_000.0)];
        for (axis, limit) in config.profile.machine.axes.iter_mut().zip(limits) {
            (axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3) = limit;
        }
        for path in [
            "G1 X30 Z-10 F600",
            "G1 X4 Y3 Z50 F600",
            "G3 X0 Y80 Z3 I0 J40 F600",
            "G18 G2 X84.852813742 Z20 I42.426406871 K42.426406871 F600",
            "G64 P2\nG1 X30 F600\nX55 Z10\nX80 Y15 Z12\nX95 Y40 Z22",
        ] {
            let text = program("", path).replace("P1 D1", "P2 D1 Q0.02");
            let report = validate(&text, &config);
            assert!(report.is_accepted(), "{path}: {:#?}", report.findings);
            let setpoints = run(&text, &config);
            let period_s = config.period_s();
            for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
                let [velocity, acceleration, jerk] = by_differences(column, period_s);
                assert!(velocity <= axis.max_velocity_per_s * 1.000_1, "{path}: {} {velocity}", axis.name);
                assert!(acceleration <= axis.max_acceleration_per_s2 * 1.001, "{path}: {} {acceleration}", axis.name);
                assert!(jerk <= axis.max_jerk_per_s3 * 1.005, "{path}: {} {jerk}", axis.name);
            }
        }
    }
}

#[test]
fn the_axis_of_the_tool_is_asked_for_what_the_feed_takes_of_it() {
    // A sine of 0.4 mm at 10 Hz takes 1 579 mm/s², of which a ramp of 1 : 2 leads 706 into Z, and half of the axial 0.03 mm.
    let mut config = config();
    config.profile.machine.axes[2].max_acceleration_per_s2 = 650.0;
    let codes = |path: &str| {
        let report = validate(&program("Q0", path), &config);
        let codes: Vec<String> = report.findings.iter().map(|finding| finding.code.to_string()).collect();
        (report.is_accepted(), codes)
    };
    assert!(codes("G1 X30 F600").0);
    for path in ["G1 X30 Z5 F600", "G1 X30 Z35 F600", "G1 X30 F600\nG1 X60 Z5"] {
        let (accepted, codes) = codes(path);
        let is_said = codes.iter().any(|code| code == "OSC-AXIS-ACCELERATION" || code == "OSC-AXIS-LIMIT");
        assert!(!accepted && is_said, "{path}: {codes:?}");
    }
}

#[test]
fn travel_ends_where_the_tool_goes_on_a_ramp() {
    let refused = |path: &str, axis: usize, low: Option<f64>, high: Option<f64>| {
        let mut config = config();
        let limited = &mut config.profile.machine.axes[axis];
        (limited.travel_min, limited.travel_max) = (low, high);
        let report = validate(&program("", path), &config);
        report.findings.iter().any(|finding| finding.code == "AXIS-TRAVEL" && finding.span.line == 5)
    };
    // 3 : 4, so that x̂ has 0.6 along X and 0.8 along Z, down and up.
    let (along_x_mm, along_z_mm) = (0.4 * 0.6, 0.4 * 0.8 + 0.03);
    for (path, low_mm) in [("G1 X30 Z-20 F600", -20.0 - along_z_mm), ("G1 X-30 Z60 F600", 20.0 - along_z_mm)] {
        assert!(refused(path, 2, Some(low_mm + 1e-3), None), "{path}");
        assert!(!refused(path, 2, Some(low_mm - 1e-3), None), "{path}");
    }
    assert!(refused("G1 X30 Z60 F600", 0, None, Some(30.0 + along_x_mm - 1e-3)));
    assert!(!refused("G1 X30 Z60 F600", 0, None, Some(30.0 + along_x_mm + 1e-3)));
    // At the bottom of a bow the tangent leads below it.
    let bow = "G18 G2 X84.852813742 Z20 I42.426406871 K42.426406871 F600";
    let setpoints = run(&program("", bow), &config());
    let least = setpoints.axes[2][setpoints.line.iter().position(|line| *line == 5).expect("a cut")..]
        .iter()
        .copied()
        .fold(20.0, f64::min);
    assert!(least < 5.0, "{least}");
    assert!(refused(bow, 2, Some(least + 1e-5), None));
    assert!(!refused(bow, 2, Some(least - 0.32), None));
}

#[test]
fn an_inclined_cut_is_judged_across_the_tool_and_above_the_path() {
    let (tool, condition) = (tool(), condition());
    let level = job(&tool, &condition);
    let mut inclined = level;
    inclined.cut.incline_deg = 60.0;
    let [level, inclined] = [level, inclined].map(|job| judge(&job).0.expect("possible"));
    assert_eq!((level.phase_error_deg, level.hold_share), (inclined.phase_error_deg, inclined.hold_share));
    assert_eq!(level.feed_per_period_mm, inclined.feed_per_period_mm);
    for (level, inclined) in level.edges.iter().zip(&inclined.edges) {
        assert_eq!(level.retraction_mm, inclined.retraction_mm);
        assert_eq!(level.feed_offset_mm, inclined.feed_offset_mm);
        assert!((0.5 * level.front_mm - inclined.front_mm).abs() < 1e-12);
        assert!((0.5 * level.max_chip_mm - inclined.max_chip_mm).abs() < 1e-12);
        assert!((0.5 * level.area_mm2 - inclined.area_mm2).abs() < 1e-12);
    }
    assert!((0.5 * level.volume_mm3_per_rev - inclined.volume_mm3_per_rev).abs() < 1e-9);
    // Every inclination of a program once, and without a floor.
    let report = validate(&program("", "G64 P1\nG1 X30 F600\nX60 Z5\nX90 Z-10\nX120"), &config());
    assert!(report.is_accepted(), "{:#?}", report.findings);
    let judged: Vec<f64> = report.oscillations.iter().map(|one| one.cut.incline_deg).collect();
    assert_eq!((judged[0], judged.len()), (0.0, 2), "{judged:?}");
    assert!((judged[1] - libm::atan(0.5).to_degrees()).abs() < 1e-9, "{judged:?}");
    assert!(report.oscillations[0].report.floor.is_some() && report.oscillations[1].report.floor.is_none());
    assert!(report.findings.iter().any(|finding| finding.code == "OSC-FLOOR"));
}

#[test]
fn the_drive_of_the_tool_axis_carries_a_part_of_the_feed_on_a_ramp() {
    let drive = |gain_per_s| DriveModel { position_loop_gain_per_s: Some(gain_per_s), ..DriveModel::default() };
    let model = FollowingModel { common: drive(120.0), axes: vec![AxisDrive { axis: Axis::Z, drive: drive(60.0) }] };
    let (tool, condition) = (tool(), condition());
    let carried = |incline_deg: f64| {
        let drives = Some(OscillationDrives { model: &model, guided: false });
        let mut job = OscillationJob { drives, ..job(&tool, &condition) };
        job.cut.incline_deg = incline_deg;
        let following = judge(&job).0.expect("possible").following.expect("drives are stated");
        let feed = following.directions.iter().filter(|it| it.direction == OscillationDirection::Feed);
        (feed.map(|it| it.axis).collect::<Vec<_>>(), following.contour_error_mm)
    };
    assert_eq!(carried(0.0), (vec![Axis::X, Axis::Y], Some(0.0)));
    assert_eq!(carried(20.0), (vec![Axis::X, Axis::Y, Axis::Z], None));
}

#[test]
fn a_resumed_ramp_continues_to_the_bit() {
    let (text, config) = (program("", "G64 P1\nG1 X20 F600\nX40 Z10\nG3 X40 Y40 Z2 J20"), crossing());
    let whole = run(&text, &config);
    let taken = snapshots(text.as_bytes(), &config);
    assert!(taken.len() > 3);
    for (index, offset, snapshot) in &taken {
        let (first, resumed) = resume(text.as_bytes(), &config, *offset, snapshot);
        assert_eq!(first, *index);
        assert!((0..resumed.len()).all(|k| resumed.bits(k) == whole.bits(first as usize + k)));
    }
}
