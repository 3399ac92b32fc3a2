//! A freeform program as CAM systems write it: a gently concave surface cut into triangles, a block where the path crosses a
//! triangle edge, the position on the chord surface, the direction averaged over the two triangles at the edge.

use std::fmt::Write;

use feedwave_cutting::PlanQuality;
use feedwave_motion::kinematics::vector::{Vec3, add, cross, sub, unit};

use super::machine::config;
use crate::common::validate;

/// Sides of the triangulated square, mm.
const SIDE_MM: f64 = 100.0;
/// Lead of the tool against the normal, rad: finishing cuts keep off the pole.
const LEAD_RAD: f64 = 0.35;

/// A shallow bowl with the modeller's noise of ±1.5 µm, at a node of the mesh.
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

/// `rows` passes, to and fro, over a mesh of `cells` × `cells` squares of two triangles each, with a rapid over the work
/// between them, thinned.
pub fn program(rows: usize, cells: usize) -> String {
    let mut text = String::from("G43.4 H1 G0 X0 Y0 Z80 A-20 C0\nM33\n");
    for row in 0..rows {
        // Between the mesh lines, at a share that changes from row to row.
        let depth = (row as f64 + 0.37) / rows as f64 * cells as f64;
        let (j, t) = (depth as usize, depth.fract());
        for step in 0..2 * cells {
            let step = if row % 2 == 0 { step } else { 2 * cells - 1 - step };
            let i = step / 2;
            let (a, b) = (node(i, j, cells), node(i + 1, j, cells));
            let (c, d) = (node(i + 1, j + 1, cells), node(i, j + 1, cells));
            let (lower, upper) = (normal(a, b, c), normal(a, c, d));
            let (to, normals) = if step % 2 == 0 {
                let before = if i == 0 { upper } else { normal(node(i - 1, j, cells), a, d) };
                (d, [before, upper])
            } else {
                (c, [upper, lower])
            };
            let tip = [0, 1, 2].map(|axis| a[axis] + (to[axis] - a[axis]) * t);
            let averaged = unit(add(normals[0], normals[1])).expect("normals of a shallow surface");
            let (sine, cosine) = libm::sincos(LEAD_RAD);
            let v = [averaged[0], averaged[1] * cosine + averaged[2] * sine, averaged[2] * cosine - averaged[1] * sine];
            // v = Rz(C)·Rx(A)·z with A negative.
            let c_deg = libm::atan2(-v[0], v[1]).to_degrees();
            let a_deg = -libm::atan2(libm::hypot(v[0], v[1]), v[2]).to_degrees();
            let [x, y, z] = tip;
            if row == 0 && step == 0 {
                let _ = writeln!(text, "G0 X{x:.4} Y{y:.4} A{a_deg:.4} C{c_deg:.4}");
            }
            let feed = if row == 0 && step == 0 { " F3000" } else { "" };
            let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} Z{z:.4} A{a_deg:.4} C{c_deg:.4}{feed}");
        }
    }
    text.push_str("M34\nG49\nG91 G28 Z0\nM30\n");
    text
}

#[test]
fn the_flicker_of_a_freeform_program_goes_and_so_does_its_time() {
    let program = program(250, 205);
    assert!(program.lines().count() > 100_000);
    let mut config = config();
    config.profile.thinning.group_blocks = 10_000;
    // What thinning leaves is the same, and three plans of minutes for the least time take long.
    config.profile.plan_quality = PlanQuality::Fast;
    let report = validate(&program, &config);
    assert!(report.is_accepted(), "{:#?}", &report.findings[..report.findings.len().min(3)]);
    let thinning = report.thinning.expect("it is on");
    let figures = thinning.figures;
    let total = |reversals: [u64; 2]| reversals[0] + reversals[1];
    assert!(figures.blocks_read > 100_000 && figures.blocks_kept() * 8 < figures.blocks_read, "{figures:?}");
    assert!(total(figures.rotary.reversals_after) * 10 < total(figures.rotary.reversals_before), "{figures:?}");
    assert!(figures.position_deviation_mm < config.profile.thinning.distance_tolerance_mm, "{figures:?}");
    assert!(
        thinning.time_after_s * 2.0 < thinning.time_before_s,
        "{} {}",
        thinning.time_before_s,
        thinning.time_after_s
    );
}
