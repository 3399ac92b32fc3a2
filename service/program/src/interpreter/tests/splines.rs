//! `G5`, `G5.1`, `G5.2` … `G5.3`.

use super::*;
use crate::state::Nurbs;
use crate::{DecimalPointRule, Plane};

/// A NURBS of LinuxCNC's documentation.
const NURBS: &str = "F10\nG5.2 P1 L3\nX0 Y1 P1\nX2 Y2 P1\nX2 Y0 P1\nX0 Y0 P2\nG5.3";

#[track_caller]
fn check_mill(program: &str, expected: &str) {
    check(&mill(), &format!("F100\n{program}"), expected);
}

#[test]
fn cubic_splines_and_their_continuation() {
    check_mill(
        "G5 I0 J3 P0 Q-3 X1 Y1\nG5 P0 Q-3 X2 Y2\nP1 Q1 X3 Y2",
        "spline 0 -> X1 Y1 order 4 0,0 0,3 1,-2 1,1 @100/min
         spline X1 Y1 -> X2 Y2 order 4 1,1 1,4 2,-1 2,2 @100/min
         spline X2 Y2 -> X3 Y2 order 4 2,2 2,5 4,3 3,2 @100/min",
    );
    // A dwell does not end the series; words may come in any order and in inches.
    check_mill(
        "G5 X1 Y1 I1 J1 P-.5 Q.5\nG4 P5\nG20\nY.1 X.1 Q0 P.01",
        "spline 0 -> X1 Y1 order 4 0,0 1,1 0.5,1.5 1,1 @100/min
         dwell 0.005
         spline X1 Y1 -> X2.54 Y2.54 order 4 1,1 1.5,0.5 2.794,2.54 2.54,2.54 @100/min",
    );
    // A loop ends where it starts.
    check_mill("G5 I5 J5 P-5 Q5", "spline 0 -> 0 order 4 0,0 5,5 -5,5 0,0 @100/min");
    check_mill(
        "G91 G5 X1 Y1 I1 J0 P0 Q-1\nX1 Y1 P0 Q0",
        "spline 0 -> X1 Y1 order 4 0,0 1,0 1,0 1,1 @100/min
         spline X1 Y1 -> X2 Y2 order 4 1,1 1,2 2,2 2,2 @100/min",
    );
}

#[test]
fn quadratic_splines() {
    check_mill(
        "G0 X-2 Y4\nG5.1 X2 I2 J-8\nX4 Y0 I1 J0",
        "rapid 0 -> X-2 Y4
         spline X-2 Y4 -> X2 Y4 order 3 -2,4 0,-4 2,4 @100/min
         spline X2 Y4 -> X4 order 3 2,4 3,4 4,0 @100/min",
    );
}

#[test]
fn nurbs() {
    check(&mill(), NURBS, "spline 0 -> 0 order 3 0,0 0,1 2,2 2,0 0,0*2 @10/min");
    // Without L the order is 3; P of a block with coordinates is its own, and it is 1 where it is not written.
    check_mill(
        "G0 X1 Y1\nG5.2 X2 Y2 P3\nX3 Y1\nG5.3",
        "rapid 0 -> X1 Y1\nspline X1 Y1 -> X3 Y1 order 3 1,1 2,2*3 3,1 @100/min",
    );
    check_mill(
        "G5.2 P.5 L4\nG5.2 X1 Y1\nX2 Y-1\n\n(note)\nN9 X3 Y0\nG5.3",
        "spline 0 -> X3 order 4 0,0*0.5 1,1 2,-1 3,0 @100/min",
    );
    // As long as it is open the position is its start.
    check_mill(
        "G91 G0 X1 Y1\nG5.2 X1 Y1\nX2 Y1\nG5.3\nG1 X1",
        "rapid 0 -> X1 Y1
         spline X1 Y1 -> X3 Y2 order 3 1,1 2,2 3,2 @100/min
         line X3 Y2 -> X4 Y2 @100/min",
    );
    // Afterwards no motion is in force.
    check_mill(
        "G5.2 X1 Y1\nX2 Y1\nG5.3\nX3",
        "spline 0 -> X2 Y1 order 3 0,0 1,1 2,1 @100/min\n! 5:1+2 PRG-MOTION-MISSING",
    );
}

#[test]
fn every_plane_and_diameters() {
    // Points are Z, X; X words are diameters, but I and P are not.
    check(
        &lathe(),
        "G98 F9 G0 X20. Z1.\nG5 X40. Z5. I1. K2. P3. Q4.\nG5.1 X20. W1. I0 K1.\nG5.2 X30. Z7.\nU10. W2.\nG5.3",
        "rapid 0 -> X10 Z1
         spline X10 Z1 -> X20 Z5 order 4 1,10 3,11 9,23 5,20 @9/min
         spline X20 Z5 -> X10 Z6 order 3 5,20 6,20 6,10 @9/min
         spline X10 Z6 -> X15 Z8 order 3 6,10 7,15 8,15 @9/min",
    );
    check_mill("G19 G5 Y1 Z1 J1 K2 P3 Q4", "spline 0 -> Y1 Z1 order 4 0,0 1,2 4,5 1,1 @100/min");
    let settings = LanguageSettings { decimal_point: DecimalPointRule::LeastIncrement, ..mill() };
    check(
        &settings,
        "F100\nG5 X1000 Y0 I1000 J0 P2000 Q0\nG5.2 X2000 Y1000 P2\nX3000 Y0\nG5.3",
        "spline 0 -> X1 order 4 0,0 1,0 3,0 1,0 @100/min
         spline X1 -> X3 order 3 1,0 2,1*2 3,0 @100/min",
    );
}

#[test]
fn feeds_are_as_for_lines() {
    check(&mill(), "G5 X1 Y1 I1 J1 P1 Q1", "! 1:1+20 PRG-FEED-MISSING");
    check(&mill(), "G5.2 X1 Y1\nX2 Y1\nG5.3", "! 1:1+10 PRG-FEED-MISSING");
    check(&lathe(), "G5.1 X1 Z1 I1 K0 F.1", "! 1:1+20 PRG-SPINDLE-STOPPED");
    check(
        &mill(),
        "G93 F2 G5.2 X1 Y1\nX2 Y1\nG5.3\nG5.1 X1 I1 J0",
        "spline 0 -> X2 Y1 order 3 0,0 1,1 2,1 @1/2\n! 4:1+13 PRG-FEED-MISSING",
    );
}

#[test]
fn nothing_comes_of_a_point() {
    check_mill("G5 I0 J0 P0 Q0\nG5.2 X0 Y0\nX0 Y0\nG5.3\nG1 X1", "line 0 -> X1 @100/min");
}

#[test]
fn beziers_that_cannot_be() {
    for (block, expected) in [
        ("G5 X1 Y1 I1 J1", "! 2:1+14 PRG-SPLINE-POINT-MISSING"),
        ("G5 X1 Y1 I1 J1 P1", "! 2:1+17 PRG-SPLINE-POINT-MISSING"),
        ("G5 X1 Y1 P1 Q1", "! 2:1+14 PRG-SPLINE-POINT-MISSING"),
        ("G5 X1 Y1 I1 P1 Q1", "! 2:1+17 PRG-SPLINE-POINT-MISSING"),
        ("G5 X1 Z1 I1 J1 P1 Q1", "! 2:7+2 PRG-SPLINE-AXIS"),
        ("G5 X1 I1 J1 P1 Q1 A5", "! 2:19+2 PRG-SPLINE-AXIS"),
        ("G5 X1 I1 J1 K1 P1 Q1", "! 2:13+2 PRG-WORD-UNUSED"),
        ("G5 X1 I1 J1 P1 Q1 R1", "! 2:19+2 PRG-WORD-UNUSED"),
        ("G5.1 X1 Y1", "! 2:1+10 PRG-SPLINE-POINT-MISSING"),
        ("G5.1 X1 I0 J0", "! 2:1+13 PRG-SPLINE-POINT-MISSING"),
        ("G5.1 X1 I1 J0 P1", "! 2:15+2 PRG-WORD-UNUSED"),
        ("G53 G5.1 X1 I1", "! 2:1+3 PRG-MACHINE-MOTION"),
        ("G64 P1 G5 X1 I1 J1 Q1", "! 2:1+21 PRG-SPLINE-POINT-MISSING"),
    ] {
        check_mill(block, expected);
    }
    // What follows is judged on its own.
    check_mill(
        "G5 X1 Y1 P1 Q1\nX2 Y2 P0 Q0\nG1 X3",
        "spline X1 Y1 -> X2 Y2 order 4 1,1 0,0 2,2 2,2 @100/min
         line X2 Y2 -> X3 Y2 @100/min
         ! 2:1+14 PRG-SPLINE-POINT-MISSING",
    );
    check_mill("G1 X1\nG5.1 Q1\nX2", "line 0 -> X1 @100/min\nline X1 -> X2 @100/min");
}

#[test]
fn only_a_g5_goes_on_from_a_g5() {
    let first = "G5 X1 Y1 I1 J1 P1 Q1";
    let spline = "spline 0 -> X1 Y1 order 4 0,0 1,1 2,2 1,1 @100/min";
    for (between, moved) in [
        ("G1 X1", ""),
        ("G0", ""),
        ("G28 X1", "rapid X1 Y1 -> Y1"),
        ("G18\nG17", ""),
        ("G5.1 X0 Y0 I1 J0", "spline X1 Y1 -> 0 order 3 1,1 2,1 0,0 @100/min"),
    ] {
        let line = 4 + between.lines().count() - 1;
        check_mill(
            &format!("{first}\n{between}\nG5 X3 Y3 P0 Q0"),
            &format!("{spline}\n{moved}\n! {line}:1+14 PRG-SPLINE-POINT-MISSING"),
        );
    }
}

#[test]
fn control_points_that_cannot_be() {
    for (blocks, expected) in [
        ("G5.2 X1\nX1 Y2\nX2 Y3", "! 2:1+7 PRG-NURBS-POINT"),
        ("G5.2 X1 Y1\nY2 P1\nX2 Y3", "! 3:1+5 PRG-NURBS-POINT"),
        ("G5.2 X1 Y1\nP2\nX2 Y3", "! 3:1+2 PRG-NURBS-POINT"),
        ("G5.2 X1 Y1 P0\nX1 Y2\nX2 Y3", "! 2:12+2 PRG-NURBS-WEIGHT"),
        ("G5.2 P-1\nX1 Y2\nX2 Y3", "! 2:6+3 PRG-NURBS-WEIGHT"),
        ("G5.2 L2\nX1 Y2\nX2 Y3", "! 2:6+2 PRG-NURBS-ORDER"),
        ("G5.2 L11\nX1 Y2\nX2 Y3", "! 2:6+3 PRG-NURBS-ORDER"),
        ("G5.2 L3.5\nX1 Y2\nX2 Y3", "! 2:6+4 PRG-NUMBER-NOT-WHOLE"),
        ("G5.2 X1 Y1 Z1\nX1 Y2\nX2 Y3", "! 2:12+2 PRG-SPLINE-AXIS"),
        ("G5.2 X1 Y1 I1\nX1 Y2\nX2 Y3", "! 2:12+2 PRG-WORD-UNUSED"),
        ("G5.2 X1 Y1\nX1 Y2 E1\nX2 Y3", "! 3:7+2 PRG-WORD-UNKNOWN"),
        ("G5.2 L4\nX1 Y2\nX2 Y3", "! 5:1+4 PRG-NURBS-ORDER"),
    ] {
        // The blocks after it start at its last control point all the same.
        check_mill(&format!("{blocks}\nG5.3\nG1 X9"), &format!("line X2 Y3 -> X9 Y3 @100/min\n{expected}"));
    }
    check_mill("G5.2 X1 Y1\nX2 Y3\nG5.3 X5", "! 4:6+2 PRG-WORD-UNUSED");
    check_mill("G5.3", "! 2:1+4 PRG-NURBS-NOT-OPEN");
    check_mill("G53 G5.2 X1 Y1", "! 2:1+3 PRG-MACHINE-MOTION");
}

#[test]
fn a_nurbs_is_closed_before_anything_else() {
    let start = "G5.2 X1 Y1\nX2 Y3\n";
    for (block, expected) in [
        ("G1 X5\nX6", "line X5 Y3 -> X6 Y3 @100/min\n! 4:1+5 PRG-NURBS-UNFINISHED"),
        ("X4 Y4 F50\nX5 Y6 P1\nG5.3", "! 4:1+9 PRG-NURBS-UNFINISHED"),
        ("M8\nX5 Y6 P1\nG5.3", "! 4:1+2 PRG-NURBS-UNFINISHED"),
        ("G5.3 M8", "! 4:1+7 PRG-NURBS-UNFINISHED"),
        ("G20 X4 Y4\nG5.3", "! 4:1+9 PRG-NURBS-UNFINISHED"),
        ("G4 P1\nG0 X1", "rapid X2 Y3 -> X1 Y3\n! 4:1+5 PRG-NURBS-UNFINISHED"),
        ("M30", "end\n! 4:1+3 PRG-NURBS-UNFINISHED"),
    ] {
        check_mill(&format!("{start}{block}"), expected);
    }
    for program in ["%\nF1 G5.2 X1 Y1\n%", "\nF1 G5.2 X1 Y1\n%"] {
        let rendered = render(program, &mill());
        assert!(rendered.contains("! 2:1+13 PRG-NURBS-UNFINISHED"), "{rendered}");
    }
}

#[test]
fn a_nurbs_is_bounded() {
    let points = |count: usize| (1..=count).map(|x| format!("X{x} Y{}\n", x % 2)).collect::<String>();
    let (operations, findings) = interpret(format!("F1\nG5.2\n{}G5.3\nM30", points(9_999)).as_bytes(), mill());
    assert!(findings.findings().is_empty(), "{findings:?}");
    let OperationKind::Move(Move { spline: Some(spline), .. }) = &operations[0].kind else { panic!("{operations:?}") };
    assert_eq!((spline.points.len(), spline.plane), (10_000, Plane::Xy));
    assert_eq!(
        render(format!("F1\nG5.2\n{}G5.3\nG1 X0\nM30", points(50_000)), &mill()),
        "line X50000 -> 0 @1/min\nend\n! 10002:1+9 PRG-NURBS-TOO-LONG"
    );
}

#[test]
fn an_open_nurbs_survives_a_restart() {
    let program = format!("{NURBS}\nM30");
    let whole = render(&program, &mill());
    for lines in 1..7 {
        let mut interpreter = Interpreter::new(mill());
        let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
        let mut rest = program.as_bytes();
        for line in 0.. {
            if line == lines {
                let open = interpreter.state().nurbs.as_deref().map(|nurbs: &Nurbs| nurbs.points.len());
                assert_eq!(open, (2..7).contains(&lines).then(|| lines - 1));
                let bytes = postcard::to_allocvec(interpreter.state()).unwrap();
                interpreter = Interpreter::restore(mill(), postcard::from_bytes(&bytes).unwrap());
            }
            let LineOutcome::Consumed(length) = interpreter.read_line(rest, true, &mut operations, &mut findings)
            else {
                break;
            };
            rest = &rest[length..];
        }
        let lines: Vec<_> = operations.iter().map(render_operation).collect();
        assert_eq!(lines.join("\n"), whole);
    }
}

#[test]
fn opening_an_open_nurbs_again_moves_nothing() {
    let program = "G21 G17 F100\nG5.2 L3\nX1 Y1\nX2 Y1\nG5.2 L3\nG5.3\nM30";
    let (operations, findings) = interpret(program.as_bytes(), mill());
    assert!(!findings.has_errors(), "{:?}", findings.findings());
    let step = operations.iter().find_map(|operation| match &operation.kind {
        OperationKind::Move(step) => Some(step),
        _ => None,
    });
    let step = step.expect("the spline");
    assert_eq!(step.end[..2], [2.0, 1.0]);
    assert_eq!(step.spline.as_ref().map(|spline| spline.points.len()), Some(3));
}

#[test]
fn linuxcnc_asks_for_every_weight() {
    // That of the start alone may be left out.
    let spline = "spline 0 -> X3 order 3 0,0 1,1 2,-1*2 3,0 @100/min";
    check(&linuxcnc(), "F100 G5.2 X1 Y1 P1\nX2 Y-1 P2\n(note)\nX3 Y0 P1\nG5.3", spline);
    let missing = |program: &str, finding: &str| check(&linuxcnc(), &format!("F100\n{program}\nG5.3"), finding);
    missing("G5.2 X1 Y1\nX2 Y-1 P1\nX3 Y0 P1", "! 2:1+10 PRG-NURBS-WEIGHT");
    missing("G5.2 X1 Y1 P1\nX2 Y-1\nX3 Y0 P1", "! 3:1+6 PRG-NURBS-WEIGHT");
    missing("G5.2 X1 Y1 P1\nG5.2 X2 Y-1\nX3 Y0 P1", "! 3:1+11 PRG-NURBS-WEIGHT");
    missing("G5.2 P1\nX1 Y1\nX2 Y-1 P1", "! 3:1+5 PRG-NURBS-WEIGHT");
}
