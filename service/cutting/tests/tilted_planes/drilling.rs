//! Drilling cycles in tilted planes.

use feedwave_motion::kinematics::vector::{Vec3, dot, norm, sub};
use feedwave_program::{Axis, TiltedPlane};

use super::{config, config_of, from_segment, machines, poses, position};
use crate::common::{Setpoints, run, validate};

/// A drilling program in a plane with the origin X10 Y-20 Z30, tool T1, and its path in the coordinates of the plane by the
/// rules of the cycles: down to R, the cut, back to the start level of Z40 or to R.
const DRILLING: &str = "G53.1
G43 H1
G0 X0 Y0 Z40
G98 G81 X5 Y7 Z-8 R2 F3000
G99 X9
G80 G0 Z40
G98 G83 X-3 Y2 Z-10 R1 Q5
G73 X-4 Q6
G82 X6 Y-1 Z-3 P50
G91 G81 X2 Y1 Z-6 R-38 K2
G90 G85 X0 Y0 Z-5 R2
G80
G69
M30
";
const DRILLED: [(u32, &[Vec3]); 8] = [
    (5, &[[5.0, 7.0, 40.0], [5.0, 7.0, 2.0], [5.0, 7.0, -8.0], [5.0, 7.0, 40.0]]),
    (6, &[[9.0, 7.0, 40.0], [9.0, 7.0, 2.0], [9.0, 7.0, -8.0], [9.0, 7.0, 2.0]]),
    (7, &[[9.0, 7.0, 40.0]]),
    (
        8,
        &[
            [-3.0, 2.0, 40.0],
            [-3.0, 2.0, 1.0],
            [-3.0, 2.0, -4.0],
            [-3.0, 2.0, 1.0],
            [-3.0, 2.0, -3.0],
            [-3.0, 2.0, -9.0],
            [-3.0, 2.0, 1.0],
            [-3.0, 2.0, -8.0],
            [-3.0, 2.0, -10.0],
            [-3.0, 2.0, 40.0],
        ],
    ),
    (
        9,
        &[
            [-4.0, 2.0, 40.0],
            [-4.0, 2.0, 1.0],
            [-4.0, 2.0, -5.0],
            [-4.0, 2.0, -4.5],
            [-4.0, 2.0, -10.0],
            [-4.0, 2.0, 40.0],
        ],
    ),
    (10, &[[6.0, -1.0, 40.0], [6.0, -1.0, 1.0], [6.0, -1.0, -3.0], [6.0, -1.0, 40.0]]),
    (
        11,
        &[
            [8.0, 0.0, 40.0],
            [8.0, 0.0, 2.0],
            [8.0, 0.0, -4.0],
            [8.0, 0.0, 40.0],
            [10.0, 1.0, 40.0],
            [10.0, 1.0, 2.0],
            [10.0, 1.0, -4.0],
            [10.0, 1.0, 40.0],
        ],
    ),
    (12, &[[0.0, 0.0, 40.0], [0.0, 0.0, 2.0], [0.0, 0.0, -5.0], [0.0, 0.0, 2.0], [0.0, 0.0, 40.0]]),
];

/// More than the travel of a rapid between two setpoints.
const RAPID_STEP_MM: f64 = 0.5;

/// Drilling on a machine, against end points of its axes that `axes_at` gives by hand for a point of the plane.
fn check_drilling(chain: usize, plane: &str, rotary: [(Axis, f64); 2], axes_at: fn(Vec3) -> Vec3) {
    let mut config = config_of(machines().swap_remove(chain));
    config.profile.language.drilling.peck_clearance_mm = Some(1.0);
    config.profile.language.drilling.chip_break_retract_mm = Some(0.5);
    let program = format!("G68.2 X10 Y-20 Z30 {plane}\n{DRILLING}");
    let report = validate(&program, &config);
    assert!(report.is_accepted() && report.findings.is_empty(), "{:#?}", report.findings);
    let setpoints = run(&program, &config);
    let mut from = axes_at([0.0, 0.0, 40.0]);
    for (line, points) in DRILLED {
        let of_line = (0..setpoints.len()).filter(|&index| setpoints.line[index] == line);
        let positions: Vec<_> = of_line.map(|index| position(&setpoints, &config, index)).collect();
        for (axis, angle_deg) in rotary {
            let stray = positions.iter().find(|at| (at[axis.index()] - angle_deg).abs() > 1e-9);
            assert_eq!(stray, None, "line {line}: {axis:?} {angle_deg}");
        }
        // Every setpoint is on the path by hand, stretch after stretch, and every end point is reached.
        let mut ends = points.iter().map(|point| axes_at(*point));
        let (mut to, mut nearest, mut travelled) = (ends.next().expect("a point"), f64::INFINITY, 0.0);
        for at in positions.iter().map(|at| [at[0], at[1], at[2]]) {
            while from_segment(at, from, to) > 1e-9 || norm(sub(at, from)) < travelled - 1e-9 {
                let next = ends.next().unwrap_or_else(|| panic!("line {line}: {at:?} is beside the path"));
                // Where the path turns the tool is slow; elsewhere it goes on by a rapid's travel in a millisecond.
                let goes_on = dot(sub(to, from), sub(next, to)) > 0.0;
                let reached_mm = if goes_on { RAPID_STEP_MM } else { 0.01 };
                assert!(nearest < reached_mm, "line {line}: {nearest} mm from {to:?}, then at {at:?}");
                (from, to, travelled, nearest) = (to, next, 0.0, f64::INFINITY);
            }
            travelled = norm(sub(at, from));
            nearest = nearest.min(norm(sub(at, to)));
        }
        assert!(nearest < RAPID_STEP_MM && ends.next().is_none(), "line {line}: {nearest} mm from {to:?}");
        from = to;
    }
}

#[test]
fn drilling_cycles_drill_along_the_normal() {
    // The work zero is where the gauge point is at the work offset: (30, −40, 55) + (0, 0, 500). The origin of the plane is
    // at (40, −60, 585), from the A axis at (0, 5.3, 40) by (40, −65.3, 545). At A 90 the tool is turned by 90° against the
    // work, the table by −90° in the machine: (x, y, z) from the axis becomes (x, z, −y), the origin comes to (40, 550.3, 105.3), the axes of the plane are those of the machine. The gauge
    // point is 120 mm above the tip, and Z counts from 500 mm.
    check_drilling(0, "I0 J90 K0", [(Axis::A, 90.0), (Axis::C, 0.0)], |[x, y, z]| [40.0 + x, 550.3 + y, -274.7 + z]);
    // By the angle of the triangle 3, 4, 5: (x, y, z) becomes (x, 0.8·y + 0.6·z, 0.8·z − 0.6·y).
    let angle_deg = 0.75_f64.atan().to_degrees();
    let plane = format!("I0 J{angle_deg:.15} K0");
    check_drilling(0, &plane, [(Axis::A, angle_deg), (Axis::C, 0.0)], |[x, y, z]| [40.0 + x, 280.06 + y, 135.18 + z]);
    // A head that turns about Y at (3, 0, 650), the gauge point (−3, 0, −150) from there: turned by the same angle
    // (−92.4, 0, −118.2). The plane has X along Y, Y along (−0.8, 0, 0.6), its normal and the tool along (0.6, 0, 0.8).
    let plane = format!("I90 J{angle_deg:.15} K0");
    check_drilling(2, &plane, [(Axis::B, angle_deg), (Axis::C, 0.0)], |[x, y, z]| {
        [201.4 - 0.8 * y + 0.6 * z, -60.0 + x, 149.2 + 0.6 * y + 0.8 * z]
    });
}

#[test]
fn the_first_hole_is_reached_from_where_the_machine_is() {
    // In the plane the tool is at X10 Y5 Z50 again by number, but in another place, which only the machine knows.
    let config = config();
    let plane = TiltedPlane::by_euler_angles([10.0, -20.0, 30.0], [0.0, 90.0, 0.0], 0);
    let program =
        "G43 H1\nG0 X10 Y5 Z50\nG68.2 X10 Y-20 Z30 I0 J90 K0\nG53.1\nG0 Z50\nG81 X10 Y5 Z-3 R2 F3000\nG80\nG69\nM30\n";
    let drilling = |setpoints: &Setpoints, line: u32| -> Vec<Vec3> {
        let poses = poses(setpoints, &config);
        (0..setpoints.len()).filter(|&index| setpoints.line[index] == line).map(|index| poses[index].tip_mm).collect()
    };
    let tips: Vec<Vec3> = drilling(&run(program, &config), 6).iter().map(|tip| plane.from_work(*tip)).collect();
    assert!(norm(sub(tips[0], [10.0, 5.0, 50.0])) > 10.0, "{:?}", tips[0]);
    let lowest = tips.iter().fold(f64::INFINITY, |lowest, tip| lowest.min(tip[2]));
    assert!((lowest + 3.0).abs() < 1e-3, "{lowest}");
    let low = tips.iter().filter(|tip| tip[2] < 49.999);
    assert!(low.into_iter().all(|tip| (tip[0] - 10.0).hypot(tip[1] - 5.0) < 1e-9));
    // The same behind the plane: with the length along Z, from wherever the axes are.
    let program = "G43 H1\nG0 X10 Y5 Z50\nG68.2 X10 Y-20 Z30 I0 J90 K0\nG0 X1 Y1 Z30\nG69\nG0 Z60\nG81 X1 Y1 Z-3 R2 F3000\nG80\nM30\n";
    let tips = drilling(&run(program, &config), 7);
    let low = tips.iter().filter(|tip| tip[2] < 59.999);
    assert!(low.into_iter().all(|tip| (tip[0] - 1.0).hypot(tip[1] - 1.0) < 1e-9));
    assert!(tips.iter().any(|tip| (tip[2] + 3.0).abs() < 1e-3));
}

#[test]
fn a_drilling_cycle_vibrates_in_a_tilted_plane() {
    let program = "M3 S1000\nG68.2 I0 J30 K0\nG53.1\nG43 H1\nG0 X0 Y0 Z10\nG200 F41.667 A0.03\nG81 X5 Y5 Z-8 R2 F40\nX9\nG80\nG201\nG69\nM30\n";
    let report = validate(program, &config());
    assert!(report.is_accepted(), "{:#?}", report.findings);
    let sections: Vec<_> = report
        .sections
        .iter()
        .map(|section| (section.first_line, section.drilling_cycle.map(|cycle| (cycle.code(), cycle.line))))
        .collect();
    assert_eq!(sections, [(7, Some(("G81", 7))), (8, Some(("G81", 7)))]);
}
