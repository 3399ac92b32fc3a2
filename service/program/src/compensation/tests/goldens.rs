//! The worked examples 4, 5 and 10 of the page, number for number.

use super::*;

const CONTOUR: &str = "G21 F100 G0 X-20 Y-20\nG1 X0 Y-10\nY20\nX30\nY0\nX50 Y-10";
const LINUXCNC: &str = "G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\nY20\nX30\nY0\nG40 X50 Y-10";

#[test]
fn example_4_left_linuxcnc() {
    let (operations, findings) = read(LINUXCNC);
    assert_eq!(codes(&findings, Severity::Error), [""; 0]);
    let expected = [
        (-3.0, -8.1459, None),
        (-3.0, 20.0, None),
        (0.0, 23.0, Some([0.0, 20.0])),
        (30.0, 23.0, None),
        (33.0, 20.0, Some([30.0, 20.0])),
        (33.0, 0.0, None),
        (50.0, -10.0, None),
    ];
    assert_xy(&operations, &expected);
    let arcs: Vec<_> = moves(&operations).into_iter().filter_map(|step| step.arc).collect();
    assert!(arcs.iter().all(|arc| arc.clockwise && (arc.sweep_rad + core::f64::consts::FRAC_PI_2).abs() < 1e-12));
}

#[test]
fn example_4_left_fanuc_type_a() {
    let (operations, findings) = fanuc(CONTOUR, (2, 6), true, 3.0, CompensationEntry::A, CompensationCorner::Linear);
    assert_eq!(codes(&findings, Severity::Warning), [""; 0]);
    let expected =
        [(-3.0, -10.0, None), (-3.0, 23.0, None), (33.0, 23.0, None), (33.0, 0.0, None), (50.0, -10.0, None)];
    assert_xy(&operations, &expected);
}

#[test]
fn example_4_right_linuxcnc() {
    let (operations, _) = read(&LINUXCNC.replace("G41.1", "G42.1"));
    let expected = [
        (1.3416, -12.6833, None),
        (3.0, -10.0, Some([0.0, -10.0])),
        (3.0, 17.0, None),
        (27.0, 17.0, None),
        (27.0, 0.0, None),
        (50.0, -10.0, None),
    ];
    assert_xy(&operations, &expected);
}

#[test]
fn a_negative_diameter_swaps_the_sides() {
    let (left, _) = read(LINUXCNC);
    let (right, _) = read(&LINUXCNC.replace("G41.1 D6", "G42.1 D-6"));
    let ends = |operations: &[Operation]| moves(operations).iter().map(|step| step.end).collect::<Vec<_>>();
    assert_eq!(ends(&left), ends(&right));
}

#[test]
fn example_5_line_and_arc_inside() {
    let (operations, findings) = read("G0 X-20 Y-20\nG42.1 D6 G1 X0 Y-10\nY20\nG3 X20 Y20 I10\nG1 Y40\nG40 X50 Y50");
    assert_eq!(codes(&findings, Severity::Error), [""; 0]);
    let expected = [
        (1.3416, -12.6833, None),
        (3.0, -10.0, Some([0.0, -10.0])),
        (3.0, 9.0455, None),
        (23.0, 20.0, Some([10.0, 20.0])),
        (23.0, 40.0, None),
        (50.0, 50.0, None),
    ];
    assert_xy(&operations, &expected);
    // Down on the other side, the arc of radius 13 ends at (17, 9.0455).
    let (operations, _) = read("G0 X-20 Y-20\nG42.1 D6 G1 X0 Y-10\nY20\nG3 X20 Y20 I10\nG1 Y-10\nG40 X50 Y-20");
    let step = moves(&operations)[4];
    let arc = step.arc.expect("the arc");
    assert!((step.end[0] - 17.0).abs() < TOLERANCE_MM && (step.end[1] - 9.0455).abs() < TOLERANCE_MM);
    let radius = (step.end[0] - arc.center[0]).hypot(step.end[1] - arc.center[1]);
    assert!((radius - 13.0).abs() < 1e-9);
}

#[test]
fn example_5_what_is_too_narrow_is_refused() {
    let (_, findings) = read("G0 X-20 Y-20\nG42.1 D6 G1 X0 Y-10\nY20\nX2\nY0\nG40 X50 Y-10");
    assert_eq!(codes(&findings, Severity::Error), ["PRG-COMP-BACKWARDS"]);
    let (_, findings) = read("G0 X-20 Y-20\nG42.1 D6 G1 X0 Y-10\nY20\nG2 X4 I2\nG1 Y0\nG40 X50 Y-10");
    assert_eq!(codes(&findings, Severity::Error), ["PRG-COMP-ARC"]);
}

const NOSE: &str = "G18 G8 G0 X30 Z10\nG42.1 D0.8 L2 G1 X10 Z5\nZ-10\nX15 Z-15\nZ-20\nX20\nG40 G0 X40 Z0";

#[test]
fn example_10_linuxcnc() {
    let (operations, findings) = read(NOSE);
    assert_eq!(codes(&findings, Severity::Error), [""; 0]);
    let expected = [
        (10.0, 4.2877, None),
        (10.0, -10.2343, None),
        (14.8828, -15.1172, None),
        (15.0, -15.4, Some([-15.4, 14.6])),
        (15.0, -20.0, None),
        (19.6, -20.0, None),
        (40.0, 0.0, None),
    ];
    assert_ends(&operations, [Axis::X, Axis::Z], 1, &expected);
}

#[test]
fn example_10_fanuc() {
    let rules = CompensationRules::Fanuc { entry: CompensationEntry::A, corner: CompensationCorner::Linear };
    let mode = CompensationMode {
        left: false,
        plane: Plane::Zx,
        tilted: false,
        radius_mm: 0.4,
        reference_mm: [-0.4, -0.4],
        rules,
    };
    let program = "G21 F100 G18 G8 G0 X30 Z10\nG1 X10 Z5\nZ-10\nX15 Z-15\nZ-20\nX20\nG0 X40 Z0";
    let (operations, findings) = compensated(program, (2, 7), mode);
    assert_eq!(codes(&findings, Severity::Error), [""; 0]);
    // The mitre of the 45° corner at (15.4, −15 + 0.4·tan 22.5°) of the centre.
    let mitre = -15.0 + 0.4 * libm::tan(core::f64::consts::FRAC_PI_8) - 0.4;
    let expected = [
        (10.0, 4.6, None),
        (10.0, -10.2343, None),
        (15.0, mitre, None),
        (15.0, -20.0, None),
        (19.6, -20.0, None),
        (40.0, 0.0, None),
    ];
    assert_ends(&operations, [Axis::X, Axis::Z], 1, &expected);
}
