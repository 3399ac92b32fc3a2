//! Tilted work planes: `G68.2`, `G53.1`, `G69`. T1 is 100 mm long, T2 50 mm.

use super::*;
use crate::{DecimalPointRule, TiltedPlane, XWord};

#[test]
fn a_pocket_in_a_tilted_plane() {
    // Everything is in coordinates of the plane from G68.2 on; what no word has placed since is held (~).
    check(
        &mill(),
        "G0 X1 Z200\nG68.2 X10 Y20 Z30 I0 J30 K0\nG53.1\nG43 H1\nG0 X0 Y0\nZ5\nG1 Z-1 F100\nG3 X4 I2\nG18 G2 X6 R1\nG17 G91 G1 X1\nG90 X0\nG49\nG69\nG0 X5\nY0 Z0",
        "rapid 0 -> X1 Z200
         guided align Preferred H0 rapid -> X1 Z200 ~XYZABC
         guided plane H1 rapid -> Z200 ~ZABC
         guided plane H1 rapid -> Z5 ~ABC
         guided plane H1 cut -> Z-1 ~ABC @100/min
         guided plane H1 cut -> X4 Z-1 ~ABC about 2,0 by 180 @100/min
         guided plane H1 cut -> X6 Z-1 ~ABC about -1,5 by -180 @100/min
         guided plane H1 cut -> X7 Z-1 ~ABC @100/min
         guided plane H1 cut -> Z-1 ~ABC @100/min
         guided axes H0 rapid -> X5 Z-1 ~YZABC
         guided axes H0 rapid -> X5 ~ABC",
    );
    // The solution is chosen by P, and the length may be on before.
    check(
        &mill(),
        "G43 H2 G0 Z50\nG68.2 J90\nG53.1 P1\nG53.1 P2\nG53.1 P0\nG0 X1 Y1 Z1\nG69\nG0 X0 Y0 Z0",
        "rapid Z-50 -> Z50
         guided align Larger H2 rapid -> Z50 ~XYZABC
         guided align Smaller H2 rapid -> Z50 ~XYZABC
         guided align Preferred H2 rapid -> Z50 ~XYZABC
         guided plane H2 rapid -> X1 Y1 Z1 ~ABC
         guided axes H0 rapid -> 0 ~ABC",
    );
}

#[test]
fn a_length_moves_the_tip_along_the_normal_once_the_tool_is_on_it() {
    // As Fusion posts it: X and Y are placed before the length is.
    check(
        &mill(),
        "G68.2 X10 Y20 Z30 I0 J30 K0\nG53.1\nG0 X0 Y0\nG43 H1 Z20\nG1 Z-1 F100\nG2 X4 I2\nG43 H2\nG91 G1 X1\nG90 G49\nG1 Y2",
        "guided align Preferred H0 rapid -> 0 ~XYZABC
         guided plane H0 rapid -> 0 ~ZABC
         guided plane H1 rapid -> Z20 ~ABC
         guided plane H1 cut -> Z-1 ~ABC @100/min
         guided plane H1 cut -> X4 Z-1 ~ABC about 2,0 by -180 @100/min
         guided plane H2 cut -> X5 Z-1 ~ZABC @100/min
         guided plane H0 cut -> X5 Y2 Z-1 ~ZABC @100/min",
    );
    // A tool that stands askew takes X and Y along with its length; so does one in another plane.
    let askew = "guided plane H0 rapid -> X1 Y1 ~Z\nguided plane H1 rapid -> X1 Y1 Z20 ~XY";
    check(&mill(), "G68.2 J30\nG0 X1 Y1\nG43 H1 Z20", askew);
    check(
        &mill(),
        "G68.2 J30\nG53.1\nG69\nG68.2 J40\nG0 X1 Y1\nG43 H1 Z20",
        "guided align Preferred H0 rapid -> 0 ~XYZABC
         guided plane H0 rapid -> X1 Y1 ~ZABC
         guided plane H1 rapid -> X1 Y1 Z20 ~XYABC",
    );
}

#[test]
fn splines_and_rigid_taps_are_in_the_coordinates_of_the_plane() {
    check(
        &mill(),
        "G68.2 J30\nG43 H1\nG0 X0 Y0 Z5\nF100\nG5.1 X2 Y2 I1 J0\nG5.2 X3 Y1\nX4 Y2\nG5.3",
        "guided plane H1 rapid -> Z5
         guided plane H1 cut -> X2 Y2 Z5 spline order 3 0,0 1,0 2,2 @100/min
         guided plane H1 cut -> X4 Y2 Z5 spline order 3 2,2 3,1 4,2 @100/min",
    );
    check(
        &mill(),
        "G95\nG68.2 J30\nG43 H1\nM29 S600\nG0 X5 Y3 Z10\nG84 X5 Y3 Z-12 R4 F1.25\nG80",
        "M29 Barrier
         guided plane H1 rapid -> X5 Y3 Z10
         guided plane H1 rapid -> X5 Y3 Z4
         tap X5 Y3 Z4 -> X5 Y3 Z-12 @1.25 cw 600 plane H1
         tap X5 Y3 Z-12 -> X5 Y3 Z4 @1.25 ccw 600 plane H1
         guided plane H1 rapid -> X5 Y3 Z10",
    );
}

/// The plane of a program's last move.
fn plane_of(words: &str) -> TiltedPlane {
    plane_on(mill(), words)
}

fn plane_on(settings: LanguageSettings, words: &str) -> TiltedPlane {
    let program = format!("{words}\nG0 X0 Y0 Z0\nM30\n");
    let (operations, findings) = interpret(program.as_bytes(), settings);
    assert!(findings.findings().is_empty(), "{words}: {findings:?}");
    let guided = operations.iter().find_map(|operation| match &operation.kind {
        OperationKind::Guided(guided) => guided.plane,
        _ => None,
    });
    TiltedPlane { line: 0, ..guided.expect("a plane") }
}

fn same(a: &TiltedPlane, b: &TiltedPlane) {
    let pairs = a.origin_mm.iter().zip(&b.origin_mm).chain(a.axes.iter().flatten().zip(b.axes.iter().flatten()));
    assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
}

#[test]
fn planes_by_points_vectors_and_angles() {
    let euler = |origin_mm, angles_deg| TiltedPlane::by_euler_angles(origin_mm, angles_deg, 0);
    // Three points: X to the second, positive Y on the side of the third; blocks of comments may be between.
    let (sine, cosine) = 30f64.to_radians().sin_cos();
    let points = format!(
        "G68.2 P2 Q1 X1 Y2 Z3\n(the second)\nN5 G68.2 P2 Q2 X11 Y2 Z3\nG68.2 P2 Q3 X50 Y{:.9} Z{:.9}",
        2.0 + 20.0 * cosine,
        3.0 + 20.0 * sine
    );
    same(&plane_of(&points), &euler([1.0, 2.0, 3.0], [0.0, 30.0, 0.0]));
    // Two vectors: X, then the normal.
    let vectors = format!("G68.2 P3 Q1 X1 Y2 Z3 I2 J0 K0\nG68.2 P3 Q2 I0 J{:.9} K{:.9}", -3.0 * sine, 3.0 * cosine);
    same(&plane_of(&vectors), &euler([1.0, 2.0, 3.0], [0.0, 30.0, 0.0]));
    // Roll, pitch and yaw, one at a time, whatever the order.
    same(&plane_of("G68.2 P1 X4 I30"), &euler([4.0, 0.0, 0.0], [0.0, 30.0, 0.0]));
    same(&plane_of("G68.2 P1 Q321 J30"), &euler([0.0; 3], [90.0, 30.0, -90.0]));
    same(&plane_of("G68.2 P1 Q213 K30"), &euler([0.0; 3], [30.0, 0.0, 0.0]));
    // Projection angles: Y raised by J, then turned by K in the plane.
    same(&plane_of("G68.2 P4 J30 K40"), &euler([0.0; 3], [0.0, 30.0, 40.0]));
    // Without a doubt: nothing is shifted, and the first point is the origin.
    let at_zero = "G68.2 P2 Q0 X0 Y0 Z0 R0\nG68.2 P2 Q1\nG68.2 P2 Q2 X1\nG68.2 P2 Q3 Y1 Z1";
    same(&plane_of(at_zero), &euler([0.0; 3], [0.0, 45.0, 0.0]));
}

#[test]
fn what_controls_read_differently_is_refused_with_every_reading() {
    let cures = |words: &str| {
        let program = format!("{words}\nM30\n");
        let (_, findings) = interpret(program.as_bytes(), mill());
        let [finding] = findings.findings() else { panic!("{words}: {findings:?}") };
        assert_eq!(finding.code, "PRG-PLANE-DOUBT", "{words}");
        let cures = finding.suggestions.iter().map(|it| it.message.split("write ").nth(1).expect("words").to_owned());
        // Every cure is accepted as it is written.
        cures.map(|words| plane_of(&words)).collect::<Vec<_>>()
    };
    let [fixed, moving] = cures("G68.2 P1 X1 Y2 Z3 I10 J20 K30").try_into().expect("two readings");
    let turn = |axis, angle| TiltedPlane::about(axis, angle);
    let times = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| {
        b.map(|axis| [0, 1, 2].map(|k| (0..3).map(|along| a[along][k] * axis[along]).sum::<f64>()))
    };
    let [x, y, z] = [turn(0, 10.0), turn(1, 20.0), turn(2, 30.0)];
    let near = |plane: &TiltedPlane, axes: [[f64; 3]; 3]| {
        let pairs = plane.axes.iter().flatten().zip(axes.iter().flatten());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-7), "{plane:?} {axes:?}");
    };
    near(&fixed, times(z, times(y, x)));
    near(&moving, times(x, times(y, z)));
    assert_eq!(fixed.origin_mm, [1.0, 2.0, 3.0]);
    assert_eq!(cures("G68.2 P1 Q231 I10 J20 K30").len(), 4);
    assert_eq!(cures("G68.2 P4 I10 J20").len(), 2);
    assert_eq!(cures("G20\nG68.2 P2 Q0 X1\nG68.2 P2 Q1 X5\nG68.2 P2 Q2 X6\nG68.2 P2 Q3 X5 Y1 Z1").len(), 2);
    assert_eq!(cures("G68.2 P3 Q1 I1 R10\nG68.2 P3 Q2 J-1 K2").len(), 2);
}

/// Codes of a mill's findings with their lines.
fn found(settings: LanguageSettings, words: &str) -> Vec<(u32, String)> {
    let interpreter = Interpreter::new(settings).with_tools(tools());
    let (_, findings) = interpreter.read_all(format!("{words}\nM30\n").as_bytes());
    findings.findings().iter().map(|finding| (finding.span.line, finding.code.to_string())).collect()
}

/// A mill whose numbers without a point are least increments, and whose X words are diameters.
fn in_increments() -> LanguageSettings {
    LanguageSettings { decimal_point: DecimalPointRule::LeastIncrement, x_word: XWord::Diameter, ..mill() }
}

#[test]
fn a_block_of_a_plane_takes_the_words_that_its_form_reads() {
    let refused = |words: &str, finding: &str| check(&mill(), words, finding);
    refused("G68.2 P2 Q1 I5\nG68.2 P2 Q2 X10\nG68.2 P2 Q3 Y10", "! 1:13+2 PRG-WORD-UNUSED");
    refused("G68.2 P2 Q0\nG68.2 P2 Q1 R30\nG68.2 P2 Q2 X10\nG68.2 P2 Q3 Y10", "! 2:13+3 PRG-WORD-UNUSED");
    refused("G68.2 P3 Q1 I1\nG68.2 P3 Q2 X5 K1", "! 2:13+2 PRG-WORD-UNUSED");
    refused("G68.2 P3 Q1 I1\nG68.2 P3 Q2 K1 R5", "! 2:16+2 PRG-WORD-UNUSED");
    // Without Q0 nothing says what R does.
    refused("G68.2 P2 Q1 X0 Y0 Z0 R30\nG68.2 P2 Q2 X10\nG68.2 P2 Q3 Y10", "! 3:1+5 PRG-PLANE-DOUBT");
}

#[test]
fn a_direction_has_no_unit() {
    let turned = TiltedPlane::by_euler_angles([0.0; 3], [45.0, 0.0, 0.0], 0);
    for words in ["G68.2 P3 Q1 I1 J1\nG68.2 P3 Q2 K1.", "G68.2 P3 Q1 I1. J1. K0\nG68.2 P3 Q2 K2"] {
        same(&plane_on(in_increments(), words), &turned);
    }
    // One component a thousandth of the other, or not.
    check(&in_increments(), "G68.2 P3 Q1 I1 J1.\nG68.2 P3 Q2 K1", "! 1:1+5 PRG-PLANE-WORDS");
    same(&plane_of("G68.2 P3 Q1 I1 J1.\nG68.2 P3 Q2 K1"), &turned);
    // The two are square within the rounding of decimals.
    plane_of("G68.2 P3 Q1 I1 K0.0004\nG68.2 P3 Q2 K1");
    let (_, findings) = interpret(b"G68.2 P3 Q1 I1 K0.0007\nG68.2 P3 Q2 K1\nM30\n", mill());
    let [finding] = findings.findings() else { panic!("{findings:?}") };
    assert_eq!(finding.code, "PRG-PLANE-WORDS");
    let beside = finding.values.iter().find(|value| value.name == "beside").expect("the angle");
    assert!((beside.value - 0.0007_f64.atan().to_degrees()).abs() < 1e-9, "{beside:?}");
}

#[test]
fn cures_are_right_to_the_letter() {
    let cures = |words: &str| {
        let (_, findings) = interpret(format!("{words}\nM30\n").as_bytes(), in_increments());
        let [finding] = findings.findings() else { panic!("{words}: {findings:?}") };
        finding.suggestions.iter().map(|it| it.message.clone()).collect::<Vec<_>>()
    };
    let plane = |cure: &str| plane_on(in_increments(), cure.split("write ").nth(1).expect("words"));
    let found = cures("G68.2 P1 X8. Y2. Z3. I90. J20.");
    assert_eq!(found.len(), 2, "{found:?}");
    for cure in &found {
        assert_eq!(plane(cure).origin_mm, [4.0, 2.0, 3.0], "{cure}");
    }
    let turn = |axis, angle| TiltedPlane::about(axis, angle);
    let [fixed, moving] = [&found[0], &found[1]].map(|cure| plane(cure).axes[2]);
    // X then Y of the work: the normal goes to −Y; X then the turned Y: it goes on in the plane of X and Y.
    let normal_fixed = turn(0, 90.0)[2].map(|value| value + 0.0);
    assert!((0..3).all(|k| (fixed[k] - normal_fixed[k]).abs() < 1e-7), "{fixed:?}");
    assert!((fixed[0] - moving[0]).abs() > 0.1, "{fixed:?} {moving:?}");
    // Which blocks go.
    let found = cures("(a plane)\nG68.2 P3 Q1 I1. R10.\nG68.2 P3 Q2 J-1. K2.");
    assert!(found.iter().all(|cure| cure.contains("in place of the blocks from line 2 to line 3: write")), "{found:?}");
    // The plane that is offered where none is tilted.
    let found = cures("G53.1");
    let words = found[0].split("such as ").nth(1).expect("a plane");
    same(&plane_on(in_increments(), words), &TiltedPlane::by_euler_angles([0.0; 3], [0.0, 30.0, 0.0], 0));
}

#[test]
fn drilling_cycles_end_before_the_plane_changes() {
    let cycle = "G81 X1 Y2 Z-3 R2 F100";
    assert_eq!(found(mill(), &format!("G0 Z9\n{cycle}\nG68.2 J30\nX5\nG69")), [(3, "PRG-PLANE-BLOCK".to_owned())]);
    let plane = format!("G68.2 J30\nG0 X0 Y0 Z9\n{cycle}");
    assert_eq!(found(mill(), &format!("{plane}\nG69\nX5")), [(4, "PRG-PLANE-BLOCK".to_owned())]);
    for end in ["G80\nG69", "G69 G80", "G0 G69", "G0 X5\nG69"] {
        assert_eq!(found(mill(), &format!("{plane}\n{end}")), [], "{end}");
    }
    // The rotation of coordinates is no plane.
    assert_eq!(found(mill(), &format!("G0 Z9\n{cycle}\nG69\nX5")), []);
}

#[test]
fn a_refused_plane_is_one_finding() {
    check(
        &mill(),
        "G68.2 P1 I10 J20\nG53.1\nG43 H1\nG0 X0 Y0 Z5\nG1 Z4 F100\nG81 X1 Y1 Z-3 R2\nG80\nG69\nG0 X1",
        "guided axes H0 rapid -> X1 Y1 Z4 ~YZABC
         ! 1:1+5 PRG-PLANE-DOUBT",
    );
    let moves = "G53.1\nG43 H1\nG0 X0 Y0 Z5\nG69\nG0 X1";
    for (words, (line, code)) in [
        ("G68.2 P3 Q1\nG68.2 P3 Q2 K1", (2, "PRG-PLANE-WORDS")),
        ("G68.2 P2 Q5\nG68.2 P2 Q2 X1\nG68.2 P2 Q3 Y1", (1, "PRG-PLANE-WORDS")),
        ("G68.2 P3 Q1 I1\nG4 X1.\nG68.2 P3 Q2 K1", (2, "PRG-PLANE-INCOMPLETE")),
        ("G68.2 J30 G53.1", (1, "PRG-PLANE-BLOCK")),
        ("G16\nG68.2 J30\nG15", (2, "PRG-COORD-BLOCK")),
    ] {
        assert_eq!(found(mill(), &format!("{words}\n{moves}")), [(line, code.to_owned())], "{words}");
    }
    // Another try counts.
    check(&mill(), "G68.2 P5\nG68.2 J30\nG0 X1 Y1 Z1", "guided plane H0 rapid -> X1 Y1 Z1\n! 1:1+5 PRG-PLANE-WORDS");
}

#[test]
fn the_length_about_the_tip_is_that_of_the_tool() {
    let other = [(3, "PRG-LENGTH-OTHER-TOOL".to_owned())];
    assert_eq!(found(mill(), "T1 M6\nG68.2 J30\nG53.6 H2"), other);
    assert_eq!(found(mill(), "T1 M6\nG68.2 J30\nG43 H2"), other);
    assert_eq!(found(mill(), "T1 M6\nG68.2 J30\nG53.6 H1"), []);
}

#[test]
fn a_cut_of_the_gauge_point_behind_a_turn_about_the_tip_is_reported_once() {
    let turned = |words: &str| found(mill(), &format!("G68.2 J30\nG53.6 H1\n{words}"));
    let reported = |line| vec![(line, "PRG-PLANE-LENGTH".to_owned())];
    assert_eq!(turned("G0 X0 Y0 Z5\nG1 Z-1 F100\nX5\nG2 X9 I2"), reported(4));
    assert_eq!(turned("G0 X0 Y0 Z5\nG3 X9 I4.5 F100"), reported(4));
    assert_eq!(turned("G0 X0 Y0 Z5\nG81 Z-1 R1 F100\nX5"), reported(4));
    assert_eq!(turned("G0 X0 Y0 Z5\nS100 M3\nG33 Z-9 F1"), reported(5));
    assert_eq!(turned("G43 H1\nG0 X0 Y0 Z5\nG49\nG1 Z4 F100"), reported(6));
    // With a length, without a cut, in plain coordinates again, and where the linear axes rested.
    assert_eq!(turned("G0 X0 Y0\nG43 H1 Z5\nG1 Z-1 F100\nG53.6\nG1 Z-2"), []);
    assert_eq!(turned("G0 X0 Y0 Z5\nG69\nG0 X0 Y0 Z0\nG1 Z-1 F100"), []);
    assert_eq!(found(mill(), "G68.2 J30\nG53.1\nG0 X0 Y0 Z5\nG1 Z-1 F100"), []);
}

#[test]
fn planes_that_are_none_are_refused() {
    let refused = |words: &str, finding: &str| check(&mill(), words, finding);
    refused("G68.2 P5 I10", "! 1:1+5 PRG-PLANE-WORDS");
    refused("G68.2 P1 Q112 I10", "! 1:1+5 PRG-PLANE-WORDS");
    refused("G68.2 P2 Q1\nG68.2 P2 Q2 X1\nG68.2 P2 Q3 X3", "! 3:1+5 PRG-PLANE-WORDS");
    refused("G68.2 P2 Q1\nG68.2 P2 Q3 X3", "! 2:1+5 PRG-PLANE-WORDS");
    refused("G68.2 P3 Q1 I1\nG68.2 P3 Q2 I1 K9", "! 2:1+5 PRG-PLANE-WORDS");
    refused("G68.2 P3 Q1\nG68.2 P3 Q2 K1", "! 2:1+5 PRG-PLANE-WORDS");
    refused("G68.2 P3 Q1 I1\nG4 P1\nG69", "! 2:1+5 PRG-PLANE-INCOMPLETE");
    refused("G68.2 P3 Q1 I1\nG68.2 P2 Q2 K1", "! 2:1+14 PRG-PLANE-INCOMPLETE");
    refused("G68.2 P3 Q1 I1", "! 2:1+3 PRG-PLANE-INCOMPLETE");
    refused("G68.2 P4 I90 J90", "! 1:1+5 PRG-PLANE-WORDS");
    refused("G43.4 H1\nG68.2 P3 Q1 I1\nG68.2 P3 Q2 K1", "! 3:1+5 PRG-TOOL-CONTROL-BLOCK");
}

#[test]
fn the_tool_axis_turns_about_the_tip() {
    check(
        &mill(),
        "G68.2 J30\nG53.6 H1\nG43 H1\nG0 X0 Y0 Z9\nG53.6 P2\nG0 X1",
        "guided align about tip Preferred H1 rapid -> 0 ~XYZABC
         guided plane H1 rapid -> Z9 ~ABC
         guided align about tip Smaller H1 rapid -> Z9 ~XYZABC
         guided plane H1 rapid -> X1 Z9 ~ABC",
    );
    check(&mill(), "G68.2 J30\nG53.6", "! 2:1+5 PRG-TOOL-CONTROL-LENGTH");
    check(&mill(), "G68.2 J30\nG43 H1\nG53.6 H2", "! 3:1+5 PRG-PLANE-BLOCK");
    check(&mill(), "G68.2 J30\nG53.6 H1 R5", "! 2:10+2 PRG-WORD-UNUSED");
    check(&mill(), "G53.6", "! 1:1+5 PRG-PLANE-OFF");
    check(&mill(), "G68.2 J30 G53.6 H1", "! 1:11+5 PRG-PLANE-BLOCK");
}

#[test]
fn rotary_words_do_not_pass_through_the_plane() {
    check(&mill(), "G68.2 J30\nG0 X1 Y1 A5", "! 2:10+2 PRG-PLANE-BLOCK");
    check(&mill(), "G68.2 J30\nG0 X1 Y1 Z1 A5", "! 2:13+2 PRG-PLANE-BLOCK");
    let plane = "G68.2 J30\nG53.1\nG43 H1\nG0 X0 Y0 Z5\n";
    let before = "guided align Preferred H0 rapid -> 0 ~XYZABC\nguided plane H1 rapid -> Z5 ~ABC\n";
    let refused = |program: &str, finding: &str| {
        check(&mill(), &format!("{plane}{program}"), &format!("{before}{finding}"));
    };
    // They would turn the tool about its tip at rapid.
    refused("G28 A0", "! 5:5+2 PRG-PLANE-BLOCK");
    refused("G91 G28 Z0 C0", "! 5:12+2 PRG-PLANE-BLOCK");
    refused("G30 A0", "! 5:1+3 PRG-PLANE-BLOCK");
    // Behind the plane the axis alone moves.
    refused("G69\nG91 G28 A0", "guided axes H0 rapid -> Z5 ~XYZABC\nguided axes H0 rapid -> Z5 ~XYZBC");
    // An axis that rolls over is one finding, and its cure is right.
    let mut settings = mill();
    settings.coordinates.roll_over = [false, false, true];
    check(
        &settings,
        "G68.2 J30\nG53.1\nG0 X0 Y0 Z5 C5",
        "guided align Preferred H0 rapid -> 0 ~XYZABC\n! 3:13+2 PRG-PLANE-BLOCK",
    );
    check(
        &settings,
        "G68.2 J30\nG53.1\nG0 G53 C5",
        "guided align Preferred H0 rapid -> 0 ~XYZABC\n! 3:8+2 PRG-ROLL-OVER",
    );
    let (_, findings) = interpret(b"G68.2 J30\nG53.1\nG69\nG91 G28 C0\nG90 G0 C5\nM30\n", settings);
    assert!(findings.findings().is_empty(), "{findings:?}");
}

#[test]
fn planes_are_turned_by_euler_angles() {
    let near = |a: [f64; 3], b: [f64; 3]| {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?} {b:?}");
    };
    let plane = TiltedPlane::by_euler_angles([10.0, 20.0, 30.0], [90.0, 30.0, 0.0], 1);
    // X of the plane along work Y; the normal 30° from Z towards X.
    near(plane.to_work([1.0, 0.0, 0.0]), [10.0, 21.0, 30.0]);
    near(plane.axes[2], [0.5, 0.0, 3.0_f64.sqrt() / 2.0]);
    for angles_deg in [[12.0, -34.0, 56.0], [-200.0, 170.0, 1e-3], [90.0, 180.0, 270.0]] {
        let plane = TiltedPlane::by_euler_angles([1.0, -2.0, 3.0], angles_deg, 1);
        let point = [7.0, -5.0, 0.25];
        near(plane.from_work(plane.to_work(point)), point);
        let [x, y, z] = plane.axes;
        let cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
        near(cross, z);
    }
    let square = TiltedPlane::by_euler_angles([0.0; 3], [-90.0, 450.0, 180.0], 1);
    assert_eq!(square.axes.map(|axis| axis.map(f64::abs).iter().sum::<f64>()), [1.0; 3], "exact");
    // An inch program: lengths are inches, angles are not.
    let (operations, _) = interpret(b"G20 G68.2 X1 Z2 J45\nG0 X0 Y0 Z0\nM30\n", mill());
    let OperationKind::Guided(guided) = &operations[0].kind else { panic!("{operations:?}") };
    assert_eq!(guided.plane, Some(TiltedPlane::by_euler_angles([25.4, 0.0, 50.8], [0.0, 45.0, 0.0], 1)));
}

#[test]
fn machine_positions_are_reached_from_the_plane() {
    let mut settings = mill();
    settings.reference_position[Axis::Z.index()] = 7.0;
    settings.work_offsets[0][Axis::Z.index()] = 3.0;
    check(
        &settings,
        "G68.2 J90\nG0 X1 Y1 Z1\nG53 Z0\nG91 G28 Z0\nG90 G0 X2\nG53 A0 C0\nG1 G53 X0 F10\nG69\nG0 X0",
        "guided plane H0 rapid -> X1 Y1 Z1
         guided axes H0 rapid -> X1 Y1 Z-3 ~XYABCUVW
         guided plane H0 rapid -> X1 Y1 Z-3 ~XYZ
         guided axes H0 rapid -> X1 Y1 Z4 ~XYABCUVW
         guided plane H0 rapid -> X2 Y1 Z4 ~YZ
         guided axes H0 rapid -> X2 Y1 Z4 ~XYZBUVW
         guided axes H0 cut -> Y1 Z4 ~YZABCUVW @10/min
         guided axes H0 rapid -> Y1 Z4 ~YZ",
    );
}

#[test]
fn contradictions_are_refused() {
    let refused = |program: &str, finding: &str| {
        let program = format!("G68.2 I0 J30 K0\nG0 X1 Y1 Z1\n{program}");
        check(&mill(), &program, &format!("guided plane H0 rapid -> X1 Y1 Z1\n{finding}"));
    };
    refused("G68.2 I10", "! 3:1+5 PRG-PLANE-NESTED");
    refused("G68.2 X1 J30 G53.1", "! 3:14+5 PRG-PLANE-BLOCK");
    refused("G53.1 P3", "! 3:7+2 PRG-WORD-CONFLICT");
    refused("G43.4 H1", "! 3:1+5 PRG-PLANE-BLOCK");
    refused("G44 H1", "! 3:1+3 PRG-PLANE-BLOCK");
    refused("G43 H99", "! 3:1+3 PRG-TOOL-LENGTH");
    refused("M33", "! 3:1+3 PRG-TOOL-CONTROL-OFF");
    refused("G55", "! 3:1+3 PRG-PLANE-BLOCK");
    refused("T2 M6", "! 3:4+2 PRG-PLANE-BLOCK");
    refused("G0 A30", "! 3:4+3 PRG-PLANE-BLOCK");
    refused("G1 X1 Y2 Z3 A30 F9", "! 3:13+3 PRG-PLANE-BLOCK");
    refused("G53 G2 X2 Y2 R5 F100", "! 3:1+3 PRG-MACHINE-MOTION");
    refused("G0 X1 I2", "! 3:7+2 PRG-WORD-UNUSED");
    refused("G43 H1\nG91 G0 Z1", "! 4:8+2 PRG-TOOL-CONTROL-HELD");
    refused("G2 X2 Y2 R5", "! 3:1+11 PRG-FEED-MISSING");
    refused("G54 G69 G69", "! 3:9+3 PRG-GROUP-CONFLICT");
    check(&mill(), "G53.1", "! 1:1+5 PRG-PLANE-OFF");
    check(&mill(), "G69\nG69", "");
    check(&mill(), "G68.2 A1", "! 1:7+2 PRG-PLANE-BLOCK");
    check(&mill(), "G43.4 H1\nG68.2 J30", "! 2:1+5 PRG-TOOL-CONTROL-BLOCK");
    check(&mill(), "G44 H1\nG68.2 J30", "! 2:1+5 PRG-PLANE-BLOCK");
    check(&mill(), "G68.2 J30\nG2 X1 Y1 R1 F10", "! 2:1+15 PRG-TOOL-CONTROL-HELD");
    check(&lathe(), "G68.2 J30\nG53.1", "! 1:1+5 PRG-UNKNOWN-CODE\n! 2:1+5 PRG-UNKNOWN-CODE");
}

#[test]
fn the_length_is_along_z_again_after_the_plane() {
    check(
        &mill(),
        "G43 H1 G0 Z0\nG68.2 J90\nG69\nG0 X0 Y0 Z0\nG0 Z5\nG49\nG0 Z0",
        "rapid Z-100 -> 0
         guided axes H0 rapid -> 0
         rapid 0 -> Z5
         rapid Z105 -> 0",
    );
}

#[test]
fn drilling_cycles_are_drilled_in_the_plane() {
    // The first hole is a move from wherever the machine is, even to the numbers of the position before the plane.
    let plane = "G0 X1 Y2 Z9\nG68.2 J30\nG0 Z9\n";
    let before = "rapid 0 -> X1 Y2 Z9\nguided plane H0 rapid -> X1 Y2 Z9 ~XY\n";
    check(
        &mill(),
        &format!("{plane}G81 X1 Y2 Z-3 R2 F100\nX4"),
        &format!(
            "{before}guided plane H0 rapid -> X1 Y2 Z9
             guided plane H0 rapid -> X1 Y2 Z2
             guided plane H0 cut -> X1 Y2 Z-3 @100/min
             guided plane H0 rapid -> X1 Y2 Z9
             guided plane H0 rapid -> X4 Y2 Z9
             guided plane H0 rapid -> X4 Y2 Z2
             guided plane H0 cut -> X4 Y2 Z-3 @100/min
             guided plane H0 rapid -> X4 Y2 Z9"
        ),
    );
    // The same behind the plane, and plain moves from there on.
    check(
        &mill(),
        &format!("{plane}G69\nG0 Z9\nG81 X1 Y2 Z-3 R2 F100"),
        &format!(
            "{before}guided axes H0 rapid -> X1 Y2 Z9 ~XY
             guided axes H0 rapid -> X1 Y2 Z9
             rapid X1 Y2 Z9 -> X1 Y2 Z2
             line X1 Y2 Z2 -> X1 Y2 Z-3 @100/min
             rapid X1 Y2 Z-3 -> X1 Y2 Z9"
        ),
    );
    let refused =
        |program: &str, finding: &str| check(&mill(), &format!("{plane}{program}"), &format!("{before}{finding}"));
    refused("G81 X1 Z-3 R2 F100", "! 4:1+18 PRG-TOOL-CONTROL-HELD");
    refused("G81 X1 Y2 A5 Z-3 R2 F100", "! 4:11+2 PRG-PLANE-BLOCK");
    refused("G91 G81 X1 Y2 Z-3 R-2 F100", "! 4:9+2 PRG-TOOL-CONTROL-HELD\n! 4:12+2 PRG-TOOL-CONTROL-HELD");
    // An oriented spindle does not turn with the plane.
    for cycle in ["G76 X1 Y2 Z-3 R2 I.5 F100", "G87 X1 Y2 Z-3 R-9 I.5 F100"] {
        assert_eq!(found(mill(), &format!("{plane}{cycle}")), [(4, "PRG-COORD-SHAPE".to_owned())], "{cycle}");
    }
    // Behind the plane a rigid tap needs every axis placed, the rotary ones too.
    check(
        &mill(),
        "G68.2 J30\nG53.1\nG69\nG0 X1 Y2 Z9\nM29 S500\nG84 X1 Y2 Z-3 R2 F500",
        "guided align Preferred H0 rapid -> 0 ~XYZABC
         guided axes H0 rapid -> X1 Y2 Z9 ~ABC
         M29 Barrier
         ! 6:1+21 PRG-TOOL-CONTROL-HELD",
    );
}

#[test]
fn threads_are_in_the_coordinates_of_the_plane() {
    let plane = "M3 S300\nG68.2 J30\nG43 H1\nG0 X4 Y5 Z30\n";
    let before = "spindle cw 300\nguided plane H1 rapid -> X4 Y5 Z30\n";
    let check = |program: &str, expected: &str| {
        check(&mill(), &format!("{plane}{program}"), &format!("{before}{expected}"));
    };
    check(
        "G33 Z-10 F1.5 Q90\nX6 Z-12\nG91 G33 X-20 Z1 F2\nG0 Z30",
        "thread X4 Y5 Z30 -> X4 Y5 Z-10 @1.5 plane H1 from 90
         thread X4 Y5 Z-10 -> X6 Y5 Z-12 @1.5 plane H1
         thread X6 Y5 Z-12 -> X-14 Y5 Z-11 @2 plane H1
         guided plane H1 rapid -> X-14 Y5 Z19",
    );
    // A is its amplitude, no rotary axis; the axes that it does not move are.
    check("G33 Z-10 F1.5 A0", "thread X4 Y5 Z30 -> X4 Y5 Z-10 @1.5 plane H1 amplitude 0");
    check("G33 Z-10 B5 F1.5", "! 5:10+2 PRG-THREAD-AXIS");
    check("G33 Z-10 Y6 F1.5", "! 5:10+2 PRG-THREAD-AXIS");
    check("G33 X4 Z30 F1.5", "! 5:1+15 PRG-THREAD-TRAVEL");
    // Where it starts has to be known.
    let held = |program: &str, expected: &str| {
        super::check(&mill(), &format!("M3 S300\n{program}"), &format!("spindle cw 300\n{expected}"));
    };
    held("G68.2 J30\nG33 Z-10 F1.5", "! 3:1+13 PRG-TOOL-CONTROL-HELD");
    held("G68.2 J30\nG0 X1 Z5\nG33 Z-10 F1.5", "guided plane H0 rapid -> X1 Z5 ~Y\n! 4:1+13 PRG-TOOL-CONTROL-HELD");
}

#[test]
fn a_thread_vibrates_away_from_a_work_of_its_own_coordinates() {
    let on = "G165 P3 X12. Q1.2\n";
    let pass = "G0 X4 Y5 Z30\nG33 Z-10 F1.5\n";
    let found = |program: String| {
        let (_, findings) = interpret(format!("M3 S300\n{program}M30\n").as_bytes(), mill());
        findings.findings().iter().map(|finding| (finding.span.line, finding.code.to_string())).collect::<Vec<_>>()
    };
    let elsewhere = |line: u32| vec![(line, "PRG-THREAD-PLANE-WORK".to_owned())];
    assert_eq!(found(format!("{on}G68.2 J30\n{pass}G165 P0\n")), elsewhere(5));
    assert_eq!(found(format!("G68.2 J30\n{on}G69\nG0 A0 B0 C0\n{pass}G165 P0\n")), elsewhere(7));
    assert_eq!(found(format!("G68.2 J30\n{on}{pass}G165 P0\nG69\n")), []);
    assert_eq!(found(format!("{on}G68.2 J30\nG165 P0\n{on}{pass}G165 P0\n")), []);
    assert_eq!(found(format!("{on}G68.2 J30\nG0 X4 Y5 Z30\nG33 Z-10 F1.5 A0.\nG165 P0\n")), []);
}
