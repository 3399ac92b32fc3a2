//! Arcs, helices and splines under tool centre point control, and in tilted planes with splines and rigid taps: on the exact
//! path on every kind of machine, with the direction interpolated along it.

use feedwave_cutting::PipelineConfig;
use feedwave_motion::kinematics::GreatCircle;
use feedwave_motion::kinematics::vector::{Vec3, angle, norm, sub, unit};
use feedwave_program::{Axis, TiltedPlane};

use crate::common::machines::{config_of, direction_at, kinds, kinematics, poses, position};
use crate::common::{resume, run, snapshots, validate};

/// A direction as a program writes it, and what it then is.
fn written(direction: Vec3) -> (String, Vec3) {
    let rounded = direction.map(|value| (value * 1e6).round() / 1e6);
    let [i, j, k] = rounded;
    (format!("I{i} J{j} K{k}"), unit(rounded).expect("a direction"))
}

/// The shares of a line's path at its setpoints: index and share.
fn shares(setpoints: &super::Setpoints, line: u32, length_mm: f64) -> Vec<(usize, f64)> {
    let rows: Vec<usize> = (0..setpoints.len()).filter(|&row| setpoints.line[row] == line).collect();
    let last = *rows.last().expect("the line moves");
    let base_mm = setpoints.path[last] - length_mm;
    rows.into_iter().map(|row| (row, (setpoints.path[row] - base_mm) / length_mm)).collect()
}

#[test]
fn the_direction_goes_along_the_great_circle_on_an_arc() {
    for (name, description) in kinds() {
        let config = config_of(description);
        let [(start, _), (end, to)] =
            [[20.0, -25.0], [35.0, -40.0]].map(|rotary_deg| written(direction_at(&config, rotary_deg)));
        let (mid, from) = written(direction_at(&config, [26.0, -31.0]));
        let program = format!(
            "G43.5 H1\nG0 X0 Y0 Z20 {start}\nG1 X1 F3000\nG3 X41 R20 {mid}\nG2 X71 Y0 Z26 R15 {end}\nG49\nM30\n"
        );
        let report = validate(&program, &config);
        assert!(report.is_accepted(), "{name}: {:#?}", report.findings);
        let setpoints = run(&program, &config);
        let poses = poses(&setpoints, &config);
        let mut seen = 0;
        // The helix: half a turn of radius 15 about (56, 0), clockwise from (41, 0), over the top.
        let circle = GreatCircle::new(from, to).expect("not opposite");
        let length_mm = (std::f64::consts::PI * 15.0).hypot(6.0);
        for (row, share) in shares(&setpoints, 5, length_mm) {
            let pose = &poses[row];
            let turned = std::f64::consts::PI * (1.0 - share);
            let exact = [56.0 + 15.0 * turned.cos(), 15.0 * turned.sin(), 20.0 + 6.0 * share];
            let off_mm = norm(sub(pose.tip_mm, exact));
            let across_mm = ((pose.tip_mm[0] - 56.0).hypot(pose.tip_mm[1]) - 15.0).abs();
            assert!(across_mm < 1e-9 && off_mm < 2e-9, "{name}: setpoint {row}: {across_mm:e} {off_mm:e}");
            let beside = angle(pose.direction, circle.at(share));
            assert!(beside < 1e-9, "{name}: setpoint {row}: {beside:e} rad beside the great circle");
            seen += 1;
        }
        assert!(seen > 500, "{name}: {seen}");
    }
}

#[test]
fn rotary_axes_turn_evenly_on_a_full_circle() {
    for (name, description) in kinds() {
        let config = config_of(description);
        let [first, second] = kinematics(&config).letters().1;
        let [l, m] = [first.letter(), second.letter()];
        let program =
            format!("G43.4 H1\nG0 X0 Y0 Z20 {l}10 {m}-20\nG2 X0 Y0 I15 {l}20 {m}-32 F3000\nG18 G3 X30 R15\nG49\nM30\n");
        let report = validate(&program, &config);
        assert!(report.is_accepted(), "{name}: {:#?}", report.findings);
        let setpoints = run(&program, &config);
        let poses = poses(&setpoints, &config);
        for (row, pose) in poses.iter().enumerate().filter(|(row, _)| setpoints.line[*row] == 3) {
            let tip = pose.tip_mm;
            let off_mm = ((tip[0] - 15.0).hypot(tip[1]) - 15.0).hypot(tip[2] - 20.0);
            assert!(off_mm < 1e-9, "{name}: {off_mm:e}");
            let turned = (std::f64::consts::PI - tip[1].atan2(tip[0] - 15.0)) / std::f64::consts::TAU;
            let at = position(&setpoints, &config, row);
            let shares = [(at[first.index()] - 10.0) / 10.0, (at[second.index()] + 20.0) / -12.0];
            for share in shares {
                assert!((-1e-9..1.0 + 1e-9).contains(&share), "{name}: {shares:?}");
                let off_turn = share - turned - (share - turned).round();
                assert!(off_turn.abs() < 1e-9, "{name}: setpoint {row}: {shares:?} after {turned} turns");
            }
        }
        for (row, _) in shares(&setpoints, 4, std::f64::consts::PI * 15.0) {
            let tip = poses[row].tip_mm;
            let off_mm = ((tip[0] - 15.0).hypot(tip[2] - 20.0) - 15.0).hypot(tip[1]);
            assert!(off_mm < 1e-9, "{name}: {off_mm:e}");
        }
    }
}

/// A quadratic Bézier curve and its derivative.
fn bezier([p, q, r]: [[f64; 2]; 3], t: f64) -> ([f64; 2], [f64; 2]) {
    let at = |k: usize| (1.0 - t) * (1.0 - t) * p[k] + 2.0 * t * (1.0 - t) * q[k] + t * t * r[k];
    let slope = |k: usize| 2.0 * (1.0 - t) * (q[k] - p[k]) + 2.0 * t * (r[k] - q[k]);
    ([at(0), at(1)], [slope(0), slope(1)])
}

/// Distance of a point of the plane from the curve.
fn from_bezier(points: [[f64; 2]; 3], point: [f64; 2]) -> f64 {
    let square = |t: f64| {
        let (at, _) = bezier(points, t);
        (at[0] - point[0]).powi(2) + (at[1] - point[1]).powi(2)
    };
    let mut t = (0..=200).map(|k| f64::from(k) / 200.0).min_by(|a, b| square(*a).total_cmp(&square(*b))).expect("some");
    for _ in 0..40 {
        let (at, slope) = bezier(points, t);
        let along = (point[0] - at[0]) * slope[0] + (point[1] - at[1]) * slope[1];
        t = (t + along / (slope[0] * slope[0] + slope[1] * slope[1])).clamp(0.0, 1.0);
    }
    square(t).sqrt()
}

const BEZIER: [[f64; 2]; 3] = [[0.0, 0.0], [20.0, -5.0], [30.0, 10.0]];

#[test]
fn splines_of_the_tool_centre_point() {
    for (name, description) in kinds() {
        let config = config_of(description);
        let [l, m] = kinematics(&config).letters().1.map(Axis::letter);
        let program =
            format!("G43.4 H1\nG0 X0 Y0 Z20 {l}10 {m}-20\nG5.1 X30 Y10 I20 J-5 {l}20 {m}-26 F2000\nG49\nM30\n");
        let report = validate(&program, &config);
        assert!(report.is_accepted(), "{name}: {:#?}", report.findings);
        let setpoints = run(&program, &config);
        let mut seen = 0;
        let [first, second] = kinematics(&config).letters().1;
        for (row, pose) in poses(&setpoints, &config).iter().enumerate().filter(|(row, _)| setpoints.line[*row] == 3) {
            let off_mm = from_bezier(BEZIER, [pose.tip_mm[0], pose.tip_mm[1]]).hypot(pose.tip_mm[2] - 20.0);
            assert!(off_mm < 1e-9, "{name}: {off_mm:e}");
            // Both turn by the same share.
            let at = position(&setpoints, &config, row);
            let shares = [(at[first.index()] - 10.0) / 10.0, (at[second.index()] + 20.0) / -6.0];
            assert!((shares[0] - shares[1]).abs() < 1e-9 && (-1e-9..1.0 + 1e-9).contains(&shares[0]), "{shares:?}");
            seen += 1;
        }
        assert!(seen > 500, "{name}: {seen}");
    }
}

/// The tool and the setpoints of a line in the coordinates of the plane.
fn in_plane(program: &str, config: &PipelineConfig, plane: &TiltedPlane, line: u32) -> Vec<(usize, Vec3)> {
    let setpoints = run(program, config);
    let poses = poses(&setpoints, config);
    let rows = (0..setpoints.len()).filter(|&row| setpoints.line[row] == line);
    rows.map(|row| (row, plane.from_work(poses[row].tip_mm))).collect()
}

#[test]
fn splines_in_a_tilted_plane() {
    let plane = TiltedPlane::by_euler_angles([5.0, -3.0, 2.0], [20.0, 25.0, 40.0], 0);
    // The tool of the last kind lies down: it cannot stand on this plane.
    for (name, description) in kinds().into_iter().take(6) {
        let config = config_of(description);
        let program = "G68.2 X5 Y-3 Z2 I20 J25 K40\nG53.1\nG43 H1\nG0 X0 Y0 Z20\nG5.1 X30 Y10 I20 J-5 F3000\nG18 G5 X40 Z25 I2 K3 P-3 Q0\nG69\nM30\n";
        let report = validate(program, &config);
        assert!(report.is_accepted() && report.findings.is_empty(), "{name}: {:#?}", report.findings);
        let rows = in_plane(program, &config, &plane, 5);
        assert!(rows.len() > 300, "{name}");
        for (row, point) in rows {
            let off_mm = from_bezier(BEZIER, [point[0], point[1]]).hypot(point[2] - 20.0);
            assert!(off_mm < 1e-9, "{name}: setpoint {row}: {off_mm:e}");
        }
        let rows = in_plane(program, &config, &plane, 6);
        let (_, end) = rows.last().expect("the second spline");
        assert!(norm(sub(*end, [40.0, 10.0, 25.0])) < 1e-9, "{end:?}");
        assert!(rows.iter().all(|(_, point)| (point[1] - 10.0).abs() < 1e-9));
    }
}

#[test]
fn rigid_taps_in_a_tilted_plane_follow_the_spindle_along_its_normal() {
    let plane = TiltedPlane::by_euler_angles([5.0, -3.0, 2.0], [20.0, 25.0, 40.0], 0);
    let program = "G95\nG68.2 X5 Y-3 Z2 I20 J25 K40\nG53.1\nG43 H1\nM29 S600\nG0 X5 Y3 Z10\nG84 X5 Y3 Z-12 R4 P100 F1.25\nG80\nG69\nM30\n";
    for (name, description) in kinds().into_iter().take(6) {
        let config = config_of(description);
        let report = validate(program, &config);
        let codes: Vec<_> = report.findings.iter().map(|finding| finding.code).collect();
        assert!(report.is_accepted() && codes == ["THREAD-TAP-OVERRIDE"], "{name}: {:#?}", report.findings);
        let setpoints = run(program, &config);
        let poses = poses(&setpoints, &config);
        let turns = |row: usize| setpoints.spindle[row] != setpoints.spindle[row - 1];
        let rows: Vec<usize> = (1..setpoints.len()).filter(|&row| setpoints.line[row] == 7 && turns(row)).collect();
        assert!(rows.len() > 500, "{name}: {}", rows.len());
        let first = rows[0] - 1;
        let mut deepest = 0.0_f64;
        let stand_deg = position(&setpoints, &config, first);
        for &row in &rows {
            let here_deg = position(&setpoints, &config, row);
            for axis in [Axis::A, Axis::B, Axis::C].map(Axis::index) {
                let turned_deg = (here_deg[axis] - stand_deg[axis]).abs();
                assert!(turned_deg < 1e-9, "{name}: setpoint {row}: a rotary axis turns by {turned_deg} in the hole");
            }
            let beside = angle(poses[row].direction, plane.axes[2]);
            assert!(beside < 1e-9, "{name}: setpoint {row}: {beside:e} rad beside the normal");
            let [x, y, z] = plane.from_work(poses[row].tip_mm);
            if z > 4.0 {
                continue;
            }
            assert!((x - 5.0).hypot(y - 3.0) < 1e-9, "{name}: setpoint {row} is beside the hole");
            let turned = (setpoints.spindle[row] - setpoints.spindle[first]) / 360.0;
            assert!((4.0 - z - 1.25 * turned).abs() < 1e-9, "{name}: setpoint {row}: Z {z} after {turned} turns");
            deepest = deepest.min(z);
        }
        assert!((deepest + 12.0).abs() < 1e-9, "{name}: {deepest}");
        // What follows starts where the tap has come out.
        let last = plane.from_work(poses[setpoints.len() - 1].tip_mm);
        assert!(norm(sub(last, [5.0, 3.0, 10.0])) < 1e-9, "{name}: {last:?}");
    }
}

#[test]
fn curves_start_from_anywhere_in_a_stream() {
    let config = config_of(kinds().swap_remove(0).1);
    let program = "G43.4 H1\nG0 X0 Y0 Z20 A-20 C10\nG3 X40 R20 A-30 F3000\nG5.1 X60 Y10 I10 J-5 C30\nG49\nG69\nG68.2 J20\nG53.1\nG43 H1\nG0 X0 Y0 Z30\nM29 S600\nG84 Z10 R20 F600\nG80\nG5 X20 Y0 I5 J5 P-5 Q5\nG69\nM30\n";
    let report = validate(program, &config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    let whole = run(program, &config);
    for (_, offset, snapshot) in snapshots(program.as_bytes(), &config) {
        let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
        for place in 0..rest.len() {
            assert_eq!(rest.bits(place), whole.bits(first as usize + place), "setpoint {place} from {first}");
        }
    }
}
