//! Polar coordinates, mirror image, scaling and rotation.

use super::*;

/// The sines of the arcs and lines of a program: radius and sweep in degrees of each arc.
fn arcs(settings: &LanguageSettings, program: &str) -> Vec<(f64, f64)> {
    let run = run_with(settings, &[], program);
    assert_eq!(run.findings, [""; 0], "{program}");
    let arcs = run.operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Move(Move { arc: Some(arc), start, .. }) => {
            let (first, second) = arc.plane.axes();
            let arm = [start[first.index()] - arc.center[0], start[second.index()] - arc.center[1]];
            Some((arm[0].hypot(arm[1]), arc.sweep_rad.to_degrees()))
        }
        _ => None,
    });
    arcs.collect()
}

#[test]
fn polar_coordinates() {
    let half = 0.5_f64;
    let root = libm::sqrt(3.0) * 0.5;
    ends(
        &mill(),
        "G16\nG0 X10 Y30\nY90\nX20\nG15\nX1 Y1",
        &[[10.0 * root, 10.0 * half, 0.0], [0.0, 10.0, 0.0], [0.0, 20.0, 0.0], [1.0, 1.0, 0.0]],
    );
    // An incremental radius is counted from the present position, an incremental angle from the one before.
    ends(&mill(), "G0 X5 Y5\nG91 G16\nX10 Y90", &[[5.0, 5.0, 0.0], [5.0, 15.0, 0.0]]);
    ends(
        &mill(),
        "G16 G0 X10 Y0\nG91 Y90\nY90\nZ1",
        &[[10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [-10.0, 0.0, 0.0], [-10.0, 0.0, 1.0]],
    );
    // Holes on a circle, as the handbooks write them.
    let holes = "G0 Z5\nG16 G98 G81 X10 Y0 Z-2 R1 F100\nG91 Y90 K3\nG80 G15 G90";
    let run = run_with(&mill(), &[], holes);
    let bottoms: Vec<_> = run.moves.iter().filter(|(_, end)| end[2] == -2.0).map(|(_, end)| *end).collect();
    assert_eq!(run.findings, [""; 0]);
    same(holes, &bottoms, &[[10.0, 0.0, -2.0], [0.0, 10.0, -2.0], [-10.0, 0.0, -2.0], [0.0, -10.0, -2.0]]);
    resumes(&mill(), holes);
    // G18: Z is the radius, X the angle.
    ends(&mill(), "G18 G16 G0 Z10 X90", &[[10.0, 0.0, 0.0]]);
    finds(
        &mill(),
        "G16 G0 X10\nG18\nY90 X5\nG91 X5\nY5\nG90 G2 X5 Y0 I1 F10",
        &["1:PRG-COORD-WORD", "2:PRG-COORD-BLOCK", "5:PRG-COORD-AMBIGUOUS", "6:PRG-COORD-BLOCK"],
    );
    ends(&mill(), "G20 G16 G0 X1 Y180", &[[-25.4, 0.0, 0.0]]);
}

#[test]
fn mirror_image() {
    // The circle about (10, 5) is its own mirror image.
    let program = "G51.1 X10\nG0 X0 Y5\nG1 X15 F100\nG2 X5 Y5 I-5\nG1 G91 X1\nG90\nG50.1 X0\nX0";
    ends(&mill(), program, &[[20.0, 5.0, 0.0], [5.0, 5.0, 0.0], [15.0, 5.0, 0.0], [14.0, 5.0, 0.0], [0.0, 5.0, 0.0]]);
    resumes(&mill(), program);
    // An axis at a time, drilled through the mirror.
    let holes = "G51.1 Y0\nG0 Z5\nG98 G81 X1 Y2 Z-1 R1 F9\nG80";
    let moves = run_with(&mill(), &[], holes).moves;
    assert!(moves.iter().any(|(_, end)| *end == [1.0, -2.0, -1.0]), "{moves:?}");
    finds(
        &mill(),
        "G51.1\nG50.1\nG51.1 X0\nG50.1\nG51.1 C1\nG91 G51.1 Y0",
        &["1:PRG-COORD-WORD", "4:PRG-COORD-AMBIGUOUS", "5:PRG-COORD-WORD", "6:PRG-COORD-AMBIGUOUS"],
    );
}

#[test]
fn mirrored_arcs_and_sides_are_swapped() {
    assert_eq!(arcs(&mill(), "G51.1 X0\nG2 X10 Y0 I5 F100"), [(5.0, 180.0)]);
    assert_eq!(arcs(&mill(), "G51.1 X0 Y0\nG2 X10 Y0 I5 F100"), [(5.0, -180.0)]);
    assert_eq!(arcs(&mill(), "G51.1 Z0\nG2 X10 Y0 I5 F100"), [(5.0, -180.0)]);
    // Left of a mirrored path is right: the offset contour is the mirror image of the plain one.
    let cut = "G0 X10 Y20\nG41 D21 G1 Y0 F100\nX20\nY20\nG3 X10 Y30 I-10\nG40 G1 Y20";
    let plain = run_with(&mill(), &[], &format!("G10 L12 P21 R3\n{cut}"));
    let mirrored = run_with(&mill(), &[], &format!("G10 L12 P21 R3\nG51.1 X0\n{cut}"));
    assert_eq!((plain.findings.len(), mirrored.findings.len()), (0, 0), "{:?}", mirrored.findings);
    let reflected: Vec<_> = plain.moves.iter().map(|(_, [x, y, z])| [-x, *y, *z]).collect();
    same(cut, &mirrored.moves.iter().map(|(_, end)| *end).collect::<Vec<_>>(), &reflected);
}

#[test]
fn haas_mirrors_about_zero() {
    ends(&haas(), "G101 X0\nG0 X5 Y2\nG100 X0\nX5", &[[-5.0, 2.0, 0.0], [5.0, 2.0, 0.0]]);
    finds(&mill(), "G101 X0\nG100 X0", &["1:PRG-COORD-SETTING", "2:PRG-COORD-SETTING"]);
    finds(
        &haas(),
        "G101\nG101 X0\nG100\nG100 X0\nG101 C0",
        &["1:PRG-COORD-WORD", "3:PRG-COORD-AMBIGUOUS", "5:PRG-COORD-WORD"],
    );
}

#[test]
fn scaling() {
    // Without a point in thousandths; about the centre, R and I as well.
    ends(&mill(), "G51 X10 Y0 Z0 P2000\nG0 X15 Y5 Z1\nG50\nX1", &[[20.0, 10.0, 2.0], [1.0, 10.0, 2.0]]);
    assert_eq!(arcs(&mill(), "G51 X0 Y0 Z0 P0.5\nG2 X20 Y0 R10 F100\nG3 X0 I-10"), [(5.0, -180.0), (5.0, 180.0)]);
    // A negative factor mirrors; without a centre about the present position.
    assert_eq!(arcs(&mill(), "G51 X0 Y0 Z0 I-1. J1. K1.\nG2 X20 Y0 R10 F100"), [(10.0, 180.0)]);
    ends(
        &mill(),
        "G0 X10\nG51 P3.\nX11\nG91 X1\nG90 G50\nX0",
        &[[10.0, 0.0, 0.0], [13.0, 0.0, 0.0], [16.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    );
    resumes(&mill(), "G0 X10\nG51 P3.\nX11\nG91 X1\nG90 G50\nX0");
    ends(&mill(), "G20 G51 X1. Y0 Z0 P2.\nG0 X2.", &[[76.2, 0.0, 0.0]]);
    finds(
        &mill(),
        "G51 X0\nG51 X0 P0\nG51 X0 Y0 Z0 I1. J2. K1.\nG2 X5 R5 F10\nG51 P1.\nG0 ,R1 X1",
        &["1:PRG-COORD-SETTING", "2:PRG-COORD-WORD", "4:PRG-COORD-SHAPE", "5:PRG-COORD-ORDER", "6:PRG-CORNER"],
    );
    finds(&haas(), "G51 P2", &["1:PRG-COORD-AMBIGUOUS"]);
    // The levels of cycles are not scaled, so that nobody knows what they mean.
    finds(&mill(), "G51 X0 Y0 Z0 P2.\nG0 Z5\nG81 X1 Z-1 R1 F9", &["3:PRG-COORD-SHAPE"]);
    let cycle = "G51 X0 Y0 Z0 I2. J2. K1.\nG0 Z5\nG98 G81 X1 Z-1 R1 F9\nG80";
    let bottoms = run_with(&mill(), &[], cycle).moves;
    assert!(bottoms.iter().any(|(_, end)| *end == [2.0, 0.0, -1.0]), "{bottoms:?}");
}

#[test]
fn rotation() {
    ends(
        &mill(),
        "G68 X10 Y0 R90\nG0 X20 Y0\nG91 X5\nG90 G69\nX0 Y0",
        &[[10.0, 10.0, 0.0], [10.0, 15.0, 0.0], [0.0, 0.0, 0.0]],
    );
    // Without a centre about the present position, in G18 from Z to X, work offsets behind it.
    ends(&mill(), "G0 X10 Y5\nG68 R180\nX11 Y5", &[[10.0, 5.0, 0.0], [9.0, 5.0, 0.0]]);
    ends(&mill(), "G18 G68 Z0 X0 R90\nG0 Z10 X0", &[[10.0, 0.0, 0.0]]);
    let mut settings = mill();
    settings.work_offsets[0][0] = 100.0;
    settings.initial_position[0] = 100.0;
    let program = "G68 X0 Y0 R90\nG0 X10 Y0\nG1 X20 F100\nG53 G0 X50\nX10 Y0";
    ends(&settings, program, &[[100.0, 10.0, 0.0], [100.0, 20.0, 0.0], [50.0, 20.0, 0.0], [100.0, 10.0, 0.0]]);
    resumes(&settings, program);
    assert_eq!(arcs(&mill(), "G68 X0 Y0 R30\nG2 X20 Y0 R10 F100"), [(10.0, -180.0)]);
    finds(
        &mill(),
        "G68 X0 Y0\nG91 G68 X0 Y0 R1\nG90 G68 X0 Y0 R1\nG18\nG28 Z0\nG52 X1\nG55\nG92 X0\nG69\nG91 X1",
        &[
            "1:PRG-COORD-SETTING",
            "2:PRG-COORD-AMBIGUOUS",
            "4:PRG-COORD-BLOCK",
            "5:PRG-COORD-BLOCK",
            "6:PRG-COORD-BLOCK",
            "7:PRG-COORD-BLOCK",
            "8:PRG-COORD-BLOCK",
            "10:PRG-COORD-INCREMENT",
            "10:PRG-MOTION-MISSING",
        ],
    );
}

#[test]
fn the_first_move_behind_a_rotation_names_both_axes() {
    finds(&mill(), "G0 X5 Y-3\nG68 X0 Y0 R90\nG0 X10", &["3:PRG-COORD-INCREMENT"]);
    finds(&mill(), "G0 X5 Y-3\nG68 X0 Y0 R90\nG0 Z5\nX10 Y2\nX5\nG69\nX5 Y2", &[]);
}

#[test]
fn the_chain_is_mirror_scaling_rotation_compensation_offsets() {
    let mut settings = mill();
    settings.work_offsets[0][1] = 1_000.0;
    settings.initial_position[1] = 1_000.0;
    // (15, 1): mirrored (5, 1), scaled (10, 2), rotated about (0, 0) to (-2, 10).
    let program = "G51.1 X10\nG51 X10 Y0 Z0 I2. J2. K1.\nG68 X10 Y0 R90\nG0 X15 Y1";
    // Centres on the mirror: (15, 1) is mirrored to (5, 1), scaled to (0, 2), rotated about (10, 0) to (8, -10).
    ends(&settings, program, &[[8.0, 990.0, 0.0]]);
    resumes(&settings, program);
    // Compensation is behind: the radius is not scaled.
    ends(
        &settings,
        "G10 L12 P21 R3\nG51 X0 Y0 Z0 P2.\nG0 X10 Y20\nG41 D21 G1 Y0 F100\nX20\nG40 Y20",
        &[[20.0, 1_040.0, 0.0], [20.0, 1_003.0, 0.0], [40.0, 1_003.0, 0.0], [40.0, 1_040.0, 0.0]],
    );
    // The centre of a rotation is scaled, its angle is not.
    ends(&mill(), "G51 X0 Y0 Z0 P2.\nG68 X10 Y0 R90\nG0 X11 Y0", &[[20.0, 2.0, 0.0]]);
    finds(
        &mill(),
        "G68 X0 Y0 R1\nG51 P1.\nG51.1 X0\nG69\nG51 P2.\nG51.1 X0\nG50.1 X0\nG50\nG51.1 X10\nG51 X0 P2.\nG68 X0 Y0 R1",
        &[
            "2:PRG-COORD-ORDER",
            "3:PRG-COORD-ORDER",
            "6:PRG-COORD-ORDER",
            "10:PRG-COORD-AMBIGUOUS",
            "11:PRG-COORD-AMBIGUOUS",
        ],
    );
    finds(
        &mill(),
        "G10 L12 P21 R3\nG0 X10 Y20\nG41 D21 G1 Y0 F100\nG68 X0 Y0 R1\nX20\nG40 Y20",
        &["4:PRG-COORD-ORDER"],
    );
}

#[test]
fn five_axis_modes_do_not_go_with_them() {
    finds(&mill(), "G68 X0 Y0 R1\nG43.4 H1\nG68.2 X0 Y0 Z0 I0 J0 K0", &["2:PRG-COORD-BLOCK", "3:PRG-COORD-BLOCK"]);
    finds(&mill(), "G43.4 H1\nG16\nG51.1 X0\nG49", &["2:PRG-COORD-BLOCK", "3:PRG-COORD-BLOCK"]);
    finds(&mill(), "G33 F1\nG51.1 X0\nM3 S9\nG33 Z-1 F1", &["4:PRG-COORD-BLOCK"]);
}
