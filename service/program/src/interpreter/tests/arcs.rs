//! Circles and helices.

use proptest::prelude::*;

use super::*;

const START: &str = "G0 X10 Y0\nF100\n";

#[track_caller]
fn check_arc(block: &str, expected: &str) {
    check(&mill(), &format!("{START}{block}"), &format!("rapid 0 -> X10\n{expected}"));
}

#[test]
fn centre_is_incremental() {
    check_arc("G3 X0 Y10 I-10", "arc X10 -> Y10 about 0,0 by 90 @100/min");
    check_arc("G2 X0 Y10 I-10", "arc X10 -> Y10 about 0,0 by -270 @100/min");
    check_arc("G91 G3 X-10 Y10 I-10", "arc X10 -> Y10 about 0,0 by 90 @100/min");
    check_arc("G20 G3 X0 Y.3937007874015748 I-.3937007874015748", "arc X10 -> Y10 about 0,0 by 90 @100/min");
}

#[test]
fn radius_with_both_signs() {
    check_arc("G3 X0 Y10 R10", "arc X10 -> Y10 about 0,0 by 90 @100/min");
    check_arc("G3 X0 Y10 R-10", "arc X10 -> Y10 about 10,10 by 270 @100/min");
    check_arc("G2 X0 Y10 R10", "arc X10 -> Y10 about 10,10 by -90 @100/min");
    check_arc("G2 X0 Y10 R-10", "arc X10 -> Y10 about 0,0 by -270 @100/min");
    // Half a turn, also with a radius that rounding left a little short.
    check_arc("G3 X-10 R10", "arc X10 -> X-10 about 0,0 by 180 @100/min");
    check_arc("G2 X-10 R9.999", "arc X10 -> X-10 about 0,0 by -180 @100/min");
}

#[test]
fn full_circles_and_helices() {
    check_arc("G3 I-10", "arc X10 -> X10 about 0,0 by 360 @100/min");
    check_arc("G2 X10 Y0 J5", "arc X10 -> X10 about 10,5 by -360 @100/min");
    check_arc("G3 I-10 Z-2", "arc X10 -> X10 Z-2 about 0,0 by 360 @100/min");
    check_arc("G3 X0 Y10 Z5 R10", "arc X10 -> Y10 Z5 about 0,0 by 90 @100/min");
}

#[test]
fn planes() {
    // Right-handed about the normal: G3 turns Z towards X in G18, Y towards Z in G19.
    check(&mill(), "G18 G0 Z10\nG3 X10 Z0 K-10 F5", "rapid 0 -> Z10\narc Z10 -> X10 about 0,0 by 90 @5/min");
    check(&mill(), "G19 G0 Y10\nG3 Y0 Z10 J-10 F5", "rapid 0 -> Y10\narc Y10 -> Z10 about 0,0 by 90 @5/min");
    // On a lathe X words are diameters, I is a radius all the same.
    check(
        &lathe(),
        "G98 G0 X20. Z0\nG2 X40. Z-10. I10. F5",
        "rapid 0 -> X10\narc X10 -> X20 Z-10 about 0,20 by -90 @5/min",
    );
}

#[test]
fn arcs_that_cannot_be() {
    check_arc("G3 X0 Y10.1 I-10", "! 3:13+4 PRG-ARC-RADIUS-MISMATCH");
    check_arc("G3 X0 Y10.004 I-10", "arc X10 -> Y10.004 about 0,0 by 90 @100/min");
    check_arc("G3 X0 Y10 R5", "! 3:11+2 PRG-ARC-RADIUS-TOO-SMALL");
    check_arc("G3 X10 R5", "! 3:8+2 PRG-ARC-FULL-BY-RADIUS");
    check_arc("G3 X0 Y10", "! 3:1+9 PRG-ARC-CENTRE-MISSING");
    check_arc("G3 X0 Y10 R10 I-10", "! 3:11+3 PRG-ARC-CENTRE-AMBIGUOUS");
    check_arc("G3 X0 Y10 R10 K1", "! 3:15+2 PRG-WORD-UNUSED");
    check_arc("G3 X0 Y10 I0 J0", "! 3:11+2 PRG-ARC-RADIUS-ZERO");
    // Within the tolerance of equal radii, and yet no feed leads around a radius of zero.
    check_arc("G3 X10.004 I0.004", "! 3:12+6 PRG-ARC-RADIUS-ZERO");
    check_arc("G1 X0 I5", "! 3:7+2 PRG-WORD-UNUSED");
    // What follows is judged on its own.
    check_arc("G3 X0 Y10 R5\nG1 X1", "line Y10 -> X1 Y10 @100/min\n! 3:11+2 PRG-ARC-RADIUS-TOO-SMALL");
}

#[test]
fn findings_name_both_radii_and_the_least_radius() {
    let (_, findings) = interpret(b"G0 X10\nG3 X0 Y11 I-10 F5\nG3 X0 Y1 R-4.9\nM30", mill());
    let [mismatch, small] = findings.findings() else { panic!("{findings:?}") };
    let values: Vec<_> = mismatch.values.iter().map(|value| (value.name.as_ref(), value.value)).collect();
    assert_eq!(values, [("start_radius", 10.0), ("end_radius", 11.0), ("difference", 1.0), ("tolerance", 0.005)]);
    assert_eq!(small.suggestions[0].replacement.as_deref(), Some("R-5"));
}

proptest! {
    /// Whatever circle a program describes, both of its ends lie on it and the sweep leads from one to the other.
    #[test]
    fn ends_lie_on_the_circle(
        (x, y) in (-500.0..500.0, -500.0..500.0),
        radius_scale in 1.0..20.0f64,
        major: bool,
        clockwise: bool,
    ) {
        let chord = f64::hypot(x, y);
        prop_assume!(chord > 0.01);
        let radius: f64 = chord / 2.0 * radius_scale * if major { -1.0 } else { 1.0 };
        let code = if clockwise { 2 } else { 3 };
        let program = format!("G{code} X{x:.4} Y{y:.4} R{radius:.4} F100");
        let (operations, findings) = interpret(program.as_bytes(), mill());
        prop_assert!(!findings.has_errors(), "{findings:?}");
        let OperationKind::Move(Move { end, arc: Some(arc), .. }) = &operations[0].kind else {
            panic!("{operations:?}");
        };
        let [cx, cy] = arc.center;
        let programmed = (radius.abs() * 10_000.0).round() / 10_000.0;
        let (start_radius, end_radius) = (f64::hypot(cx, cy), f64::hypot(end[0] - cx, end[1] - cy));
        // A radius a hair below half the chord is taken as half the chord.
        prop_assert!((start_radius - programmed).abs() <= 1e-4, "{start_radius} {programmed}");
        prop_assert!((start_radius - end_radius).abs() <= 1e-9 * programmed.max(1.0));
        let angle = arc.sweep_rad;
        prop_assert_eq!(angle < 0.0, clockwise);
        let turns_as_asked = if major { angle.abs() > 3.1 } else { angle.abs() < 3.2 };
        prop_assert!(turns_as_asked, "{angle}");
        let (sin, cos) = angle.sin_cos();
        let turned = [cx - cx * cos + cy * sin, cy - cx * sin - cy * cos];
        let miss = f64::hypot(turned[0] - end[0], turned[1] - end[1]);
        prop_assert!(miss <= 1e-9 * programmed.max(1.0), "{miss}");
    }
}
