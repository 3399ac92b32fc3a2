//! Radius compensation in a tilted plane, from program text to setpoints: the tip on the compensated contour, worked by hand.

use feedwave_program::CompensationCorner;

use super::*;

const RADIUS_MM: f64 = 3.0;
const ORIGIN: Vec3 = [10.0, -20.0, 30.0];

/// Left of the contour: a line, a helix, an inside corner, an outside corner.
const CONTOUR: &str = "G53.1
G43 H1
G0 X-20 Y-20 Z40
Z2
G41 D1 G1 X0 Y-10 F3000
Y20
G2 X20 I10 Z5
G1 Y5
X40
Y-10
G40 G0 X60 Y-20
Z40
G49
G69
M30
";

fn compensating(chain: Vec<ChainAxis>, corner: CompensationCorner) -> PipelineConfig {
    let mut config = config_of(chain);
    config.tools[0].offset = config.tools[0].offset.with_radius(RADIUS_MM);
    config.profile.language.compensation.corner = corner;
    config
}

/// How far the setpoints of each block are from the path of the tool's centre, mm, in the coordinates of the plane. Rounded by hand:
/// the sides are 3 mm beside the lines, the circle has a radius of 13 mm, and the inside corner is at 23, 8.
fn off_contour(point: Vec3, line: u32, corner: CompensationCorner) -> Option<f64> {
    let around = || {
        let off_mm = from_circle(point, [0, 1], [40.0, 5.0, 5.0], RADIUS_MM);
        let is_beside_corner = point[0] >= 40.0 - 1e-9 && point[1] >= 5.0 - 1e-9;
        if is_beside_corner { off_mm } else { f64::INFINITY }
    };
    Some(match (line, corner) {
        (6, _) => from_segment(point, [-20.0, -20.0, 2.0], [-3.0, -10.0, 2.0]),
        (7, _) => from_segment(point, [-3.0, -10.0, 2.0], [-3.0, 20.0, 2.0]),
        (8, _) => {
            let (along, across) = (point[0] - 10.0, point[1] - 20.0);
            // From the left over the top, rising evenly.
            let angle = across.atan2(-along).max(0.0);
            (along.hypot(across) - 13.0).hypot(point[2] - (2.0 + 3.0 * angle / std::f64::consts::PI))
        }
        (9, _) => from_segment(point, [23.0, 20.0, 5.0], [23.0, 8.0, 5.0]),
        (10, CompensationCorner::Linear) => from_segment(point, [23.0, 8.0, 5.0], [43.0, 8.0, 5.0]),
        (11, CompensationCorner::Linear) => from_segment(point, [43.0, 8.0, 5.0], [43.0, -10.0, 5.0]),
        (10, CompensationCorner::Circular) => from_segment(point, [23.0, 8.0, 5.0], [40.0, 8.0, 5.0]),
        (11, CompensationCorner::Circular) => from_segment(point, [43.0, 5.0, 5.0], [43.0, -10.0, 5.0]).min(around()),
        (12, _) => from_segment(point, [43.0, -10.0, 5.0], [60.0, -20.0, 5.0]),
        _ => return None,
    })
}

#[test]
fn the_tip_is_on_the_compensated_contour_in_the_plane() {
    for (angles, corner) in [
        ([0.0, 30.0, 0.0], CompensationCorner::Linear),
        ([40.0, -65.0, 110.0], CompensationCorner::Circular),
        ([90.0, 90.0, -90.0], CompensationCorner::Linear),
    ] {
        for chain in machines() {
            let config = compensating(chain, corner);
            let [i, j, k] = angles;
            let program = format!("G68.2 X10 Y-20 Z30 I{i} J{j} K{k}\n{CONTOUR}");
            let report = validate(&program, &config);
            assert!(report.is_accepted() && report.findings.is_empty(), "{angles:?}: {:#?}", report.findings);
            let setpoints = run(&program, &config);
            let plane = TiltedPlane::by_euler_angles(ORIGIN, angles, 0);
            let mut seen = [0_u32; 16];
            for (pose, &line) in poses(&setpoints, &config).iter().zip(&setpoints.line) {
                let Some(off_mm) = off_contour(plane.from_work(pose.tip_mm), line, corner) else { continue };
                assert!(off_mm < 1e-9, "line {line}: {off_mm:e} mm beside the contour, {angles:?} {corner:?}");
                let beside = angle(pose.direction, plane.axes[2]);
                assert!(beside < 1e-9, "line {line}: {beside:e} rad beside the normal, {angles:?}");
                seen[line as usize] += 1;
            }
            assert!(seen[6..=12].iter().all(|&count| count > 20), "{seen:?}");
        }
    }
}

#[test]
fn a_stream_of_a_contour_in_a_plane_is_the_same_from_anywhere() {
    let config = compensating(machines().swap_remove(0), CompensationCorner::Circular);
    // Waves of short lines, whose bends the tool fits into.
    let wave = |step: u32| {
        let along_mm = 0.1 * f64::from(step);
        format!("X{along_mm:.3} Y{:.4}\n", 2.0 - 2.0 * (along_mm / 4.0).cos())
    };
    let waves: String = (1..600).map(wave).collect();
    let program = format!(
        "G68.2 X10 Y-20 Z30 I0 J30 K0\nG53.1\nG43 H1\nG0 X-20 Y0 Z2\nG41 D1 G1 X0 F900\n{waves}G40 X80\nG0 Z40\nM30\n"
    );
    let whole = run(&program, &config);
    let on_contour = program.find("G41").zip(program.find("G40")).map(|(on, off)| on as u64..off as u64).expect("both");
    let mut taken_up = 0;
    for (_, offset, snapshot) in snapshots(program.as_bytes(), &config) {
        let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
        taken_up += u32::from(on_contour.contains(&offset));
        for at in 0..rest.len() {
            assert_eq!(rest.bits(at), whole.bits(first as usize + at), "{first} + {at}");
        }
    }
    assert!(taken_up > 5, "{taken_up}");
}
