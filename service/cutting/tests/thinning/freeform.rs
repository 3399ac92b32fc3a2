//! A freeform program as CAM systems make it: a gently concave surface cut into triangles, a block where the path crosses a
//! triangle edge, the position on the chord surface, the direction averaged over the two triangles at the edge.

use feedwave_cutting::thinning::{CutPoint, DirectionInterpolation, ThinningMethod, ThinningSettings};
use feedwave_motion::kinematics::vector::{Vec3, add, cross, sub, unit};

/// Sides of the triangulated square, mm.
const SIDE_MM: f64 = 100.0;
/// Lead of the tool against the normal, rad: finishing cuts keep off the pole, where C would be free.
const LEAD_RAD: f64 = 0.35;

/// A shallow bowl (radius 200 mm along the passes) with the modeller's noise of ±1.5 µm, at a node of the mesh.
fn node(i: usize, j: usize, cells: usize) -> Vec3 {
    let place = |n: usize| SIDE_MM * n as f64 / cells as f64;
    let (x, y) = (place(i), place(j));
    let noise = ((i * 7_919 + j * 104_729) % 1_013) as f64 / 1_013.0 - 0.5;
    let (u, v) = (x - SIDE_MM / 2.0, y - SIDE_MM / 2.0);
    [x, y, (u * u + 0.7 * v * v) / 400.0 + 0.003 * noise]
}

fn normal(a: Vec3, b: Vec3, c: Vec3) -> Vec3 {
    unit(cross(sub(b, a), sub(c, a))).expect("a triangle")
}

/// Values of C and A of an A/C trunnion for a direction, rad, with A negative: v = Rz(C)·Rx(A)·z.
fn rotary(v: Vec3) -> [f64; 2] {
    [libm::atan2(-v[0], v[1]), -libm::atan2(libm::hypot(v[0], v[1]), v[2])]
}

/// `rows` passes over a mesh of `cells` × `cells` squares, each cut into two triangles.
pub fn program(rows: usize, cells: usize) -> Vec<CutPoint> {
    let mut points: Vec<CutPoint> = Vec::new();
    for row in 0..rows {
        // Between the mesh lines, at a share that changes from row to row.
        let depth = (row as f64 + 0.37) / rows as f64 * cells as f64;
        let (j, t) = (depth as usize, depth.fract());
        let forward = row % 2 == 0;
        for step in 0..2 * cells {
            let step = if forward { step } else { 2 * cells - 1 - step };
            let i = step / 2;
            // Square (i, j): corners a b / d c, cut by the diagonal a–c. The row crosses its left edge, then the diagonal.
            let (a, b) = (node(i, j, cells), node(i + 1, j, cells));
            let (c, d) = (node(i + 1, j + 1, cells), node(i, j + 1, cells));
            let (lower, upper) = (normal(a, b, c), normal(a, c, d));
            let (from, to, normals) = if step % 2 == 0 {
                let before = if i == 0 { upper } else { normal(node(i - 1, j, cells), a, d) };
                (a, d, [before, upper])
            } else {
                (a, c, [upper, lower])
            };
            let tip_mm = [0, 1, 2].map(|axis| from[axis] + (to[axis] - from[axis]) * t);
            let averaged = unit(add(normals[0], normals[1])).expect("normals of a shallow surface");
            // Lead forward in Y.
            let (sine, cosine) = libm::sincos(LEAD_RAD);
            let direction =
                [averaged[0], averaged[1] * cosine + averaged[2] * sine, averaged[2] * cosine - averaged[1] * sine];
            let line = points.len() as u32 + 1;
            points.push(CutPoint { line, tip_mm, direction, rotary_rad: Some(rotary(direction)), feed_word: None });
        }
    }
    points
}

#[test]
fn the_flicker_of_a_freeform_program_goes() {
    let points = program(250, 205);
    assert!(points.len() > 100_000, "{}", points.len());
    let settings = ThinningSettings {
        angle_tolerance_deg: 1.0,
        distance_tolerance_mm: 0.01,
        group_blocks: 10_000,
        interpolated_direction_tolerance_deg: None,
        method: ThinningMethod::Published,
    };
    let (kept, report) = super::thinned(&points, settings, DirectionInterpolation::Angles(super::trunnion()));
    let rotary = report.rotary;
    assert_eq!(kept.len() as u64, report.blocks_kept());
    assert!(report.position_deviation_mm < settings.distance_tolerance_mm);
    // Before, the rotary axes turn back in more than every second block; afterwards nine in ten reversals are gone.
    let total = |reversals: [u64; 2]| reversals[0] + reversals[1];
    assert!(total(rotary.reversals_before) * 2 > report.blocks_read, "{report:?}");
    assert!(total(rotary.reversals_after) * 10 < total(rotary.reversals_before), "{report:?}");
    for axis in 0..2 {
        assert!(rotary.reversals_after[axis] * 5 < rotary.reversals_before[axis], "{report:?}");
    }
    assert!(report.blocks_kept() * 8 < report.blocks_read, "{report:?}");
    // The directions that are left follow the surface: the deviation stays at the size of the flicker.
    assert!(report.direction_deviation_deg < settings.angle_tolerance_deg, "{report:?}");
}

#[test]
fn the_angles_of_the_program_give_its_directions() {
    for point in program(3, 20) {
        let again = super::trunnion().at(point.rotary_rad.expect("angles"));
        let error = sub(again, point.direction);
        assert!(error.iter().all(|component| component.abs() < 1e-14), "{error:?}");
    }
}
