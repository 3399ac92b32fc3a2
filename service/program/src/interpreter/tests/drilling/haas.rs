//! What Haas mills have beside: the retract of a tap, decreasing pecks of `G73`, bolt patterns, circular pockets.

use super::*;

/// A Haas mill that taps rigidly.
fn tapping() -> LanguageSettings {
    with(DrillingSettings { rigid_tapping: true, ..haas().drilling })
}

#[test]
fn a_tap_goes_out_as_many_times_faster_as_j_says() {
    let taps = |program: &str, expected: &str| check(&tapping(), program, expected);
    taps(
        "S500 G0 Z10\nG99 G84 X0 Z-8 R2 F500 J2\nX5\nG80",
        "rapid 0 -> Z10
         rapid Z10 -> Z2
         tap Z2 -> Z-8 @1 cw 500
         tap Z-8 -> Z2 @1 ccw 1000
         rapid Z2 -> X5 Z2
         tap X5 Z2 -> X5 Z-8 @1 cw 500
         tap X5 Z-8 -> X5 Z2 @1 ccw 1000",
    );
    // Setting 130 of the control is 0 or 1 where nothing is faster.
    taps(
        "S500 G0 Z10\nG99 G74 X0 Z-8 R2 F500 J0",
        "rapid 0 -> Z10\nrapid Z10 -> Z2\ntap Z2 -> Z-8 @1 ccw 500\ntap Z-8 -> Z2 @1 cw 500",
    );
    taps("S500 G0 Z10\nG84 X0 Z-8 R2 F500 J10", "rapid 0 -> Z10\n! 2:20+3 PRG-CYCLE-VALUE");
    let found = |settings: &LanguageSettings| render("S500 M3\nG0 Z10\nG84 X0 Z-8 R2 F500 J2\nM30\n", settings);
    assert!(found(&haas()).contains("tap Z2 -> Z-8 @1 cw 500"), "{}", found(&haas()));
    assert!(found(&mill()).ends_with("! 3:20+2 PRG-WORD-UNUSED"), "{}", found(&mill()));
}

#[test]
fn pecks_of_g73_decrease_as_those_of_g83() {
    drills(
        &haas(),
        "G99 G73 X0 Z-10 R0 I5 J2 K1 F100",
        "rapid Z10 -> 0
         line 0 -> Z-5 @100/min
         rapid Z-5 -> Z-4
         line Z-4 -> Z-8 @100/min
         rapid Z-8 -> Z-7
         line Z-7 -> Z-9 @100/min
         rapid Z-9 -> Z-8
         line Z-8 -> Z-10 @100/min
         rapid Z-10 -> 0",
    );
}

/// Where the tool cuts down to: X and Y of the holes.
fn holes(settings: &LanguageSettings, program: &str) -> Vec<[f64; 2]> {
    let program = format!("M3 S1000\nG0 Z10\n{program}\nM30\n");
    let (operations, findings) = interpret(program.as_bytes(), settings.clone());
    assert_eq!(findings.findings(), [], "{program}");
    let cuts = operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Move(step) if step.kind == MoveKind::Cutting => Some([step.end[0], step.end[1]]),
        _ => None,
    });
    cuts.collect()
}

#[track_caller]
fn same_places(found: &[[f64; 2]], expected: &[[f64; 2]]) {
    let near = |one: &[f64; 2], other: &[f64; 2]| (0..2).all(|axis| (one[axis] - other[axis]).abs() < 1e-9);
    let is_same = found.len() == expected.len() && found.iter().zip(expected).all(|(one, other)| near(one, other));
    assert!(is_same, "{found:?} instead of {expected:?}");
}

#[test]
fn the_cycle_in_force_is_carried_out_at_each_hole_of_a_pattern() {
    let cycle = "G81 Z-5 R2 F100 L0";
    let places = |pattern: &str| holes(&haas(), &format!("G0 X100 Y50\n{cycle}\n{pattern}\nG80"));
    let circle = [[110.0, 50.0], [100.0, 60.0], [90.0, 50.0], [100.0, 40.0]];
    same_places(&places("G70 I10 J0 L4"), &circle);
    // Clockwise; the angle of the first hole is that of the plane all the same.
    same_places(&places("G70 I-10 J0 L4"), &[circle[0], circle[3], circle[2], circle[1]]);
    same_places(&places("G70 X0 Y0 I10 J90 L2"), &[[0.0, 10.0], [0.0, -10.0]]);
    same_places(&places("G91 G70 X5 Y0 I10 L2"), &[[115.0, 50.0], [95.0, 50.0]]);
    let half = 3.0_f64.sqrt() * 5.0;
    same_places(&places("G71 I10 J30 K60 L3"), &[[100.0 + half, 55.0], [100.0, 60.0], [100.0 - half, 55.0]]);
    same_places(&places("G72 I10 J90 L3"), &[[100.0, 50.0], [100.0, 60.0], [100.0, 70.0]]);
    // The next one begins where the tool is; a pattern in the block of the cycle drills nowhere else.
    same_places(
        &places("G72 I10 J0 L2\nG72 I10 J90 L2"),
        &[[100.0, 50.0], [110.0, 50.0], [110.0, 50.0], [110.0, 60.0]],
    );
    let within = holes(&haas(), "G81 Z-5 R2 F100 G70 X100 Y50 I10 J0 L4\nX0 Y0");
    same_places(&within, &[circle.as_slice(), &[[0.0, 0.0]]].concat());
    // Pecks have I, J and K of their own, from the block before.
    let pecks = holes(&haas(), "G83 Z-5 R0 I3 J1 K1 F100 L0\nG70 I10 J0 L2");
    same_places(&pecks, &[[10.0, 0.0], [10.0, 0.0], [-10.0, 0.0], [-10.0, 0.0]]);
}

#[test]
fn what_is_wrong_with_a_pattern_is_one_finding() {
    let found = |settings: LanguageSettings, program: &str| {
        let program = format!("M3 S1000\nG0 Z10\n{program}\nM30\n");
        let (_, findings) = interpret(program.as_bytes(), settings);
        findings.findings().iter().map(|it| format!("{}:{}", it.span.line, it.code)).collect::<Vec<_>>()
    };
    assert_eq!(found(haas(), "G70 I10 J0 L4"), ["3:PRG-CYCLE-WORD"]);
    let cycle = "G81 Z-5 R2 F100 L0";
    for pattern in ["G70 J0 L4", "G70 I10", "G71 I10 J0 L4", "G70 I10 J0 L0", "G72 I0 L3"] {
        assert_eq!(found(haas(), &format!("{cycle}\n{pattern}\nG80")), ["4:PRG-CYCLE-WORD"], "{pattern}");
    }
    assert_eq!(found(haas(), &format!("{cycle}\nG70 I10 J0 L20000\nG80")), ["4:PRG-CYCLE-VALUE"]);
    assert_eq!(found(haas(), &format!("{cycle}\nG16\nG70 I10 J0 L4\nG15\nG80")), ["5:PRG-COORD-BLOCK"]);
    assert_eq!(found(mill(), &format!("{cycle}\nG70 I10 J0 L4\nG80")), ["4:PRG-CYCLE-SETTING"]);
    assert_eq!(found(mill(), "G71\nG0 X1"), ["3:PRG-CYCLE-SETTING"]);
}

#[test]
fn a_circular_pocket_is_cut_in_circles_from_its_centre() {
    check(
        &haas(),
        "G0 X10 Y20 Z2\nG13 D0 I5 Z-2 F100\nG12 I5 K12 Q4 D0\nG0 Z2",
        "rapid 0 -> X10 Y20 Z2
         line X10 Y20 Z2 -> X10 Y20 Z-2 @100/min
         arc X10 Y20 Z-2 -> X15 Y20 Z-2 about 12.5,20 by 180 @100/min
         arc X15 Y20 Z-2 -> X15 Y20 Z-2 about 10,20 by 360 @100/min
         arc X15 Y20 Z-2 -> X10 Y20 Z-2 about 12.5,20 by 180 @100/min
         arc X10 Y20 Z-2 -> X15 Y20 Z-2 about 12.5,20 by -180 @100/min
         arc X15 Y20 Z-2 -> X15 Y20 Z-2 about 10,20 by -360 @100/min
         line X15 Y20 Z-2 -> X19 Y20 Z-2 @100/min
         arc X19 Y20 Z-2 -> X19 Y20 Z-2 about 10,20 by -360 @100/min
         line X19 Y20 Z-2 -> X22 Y20 Z-2 @100/min
         arc X22 Y20 Z-2 -> X22 Y20 Z-2 about 10,20 by -360 @100/min
         arc X22 Y20 Z-2 -> X10 Y20 Z-2 about 16,20 by -180 @100/min
         rapid X10 Y20 Z-2 -> X10 Y20 Z2
         i 2:1+18 PRG-POCKET-PATH",
    );
    // Deeper in every round; the place is that of the block, and a circle as small as the tool is none.
    check(
        &haas(),
        "G91 G13 D0 I5 Z-2 L2 F100\nG90 G0 Z2",
        "line 0 -> Z-2 @100/min
         arc Z-2 -> X5 Z-2 about 2.5,0 by 180 @100/min
         arc X5 Z-2 -> X5 Z-2 about 0,0 by 360 @100/min
         arc X5 Z-2 -> Z-2 about 2.5,0 by 180 @100/min
         line Z-2 -> Z-4 @100/min
         arc Z-4 -> X5 Z-4 about 2.5,0 by 180 @100/min
         arc X5 Z-4 -> X5 Z-4 about 0,0 by 360 @100/min
         arc X5 Z-4 -> Z-4 about 2.5,0 by 180 @100/min
         rapid Z-4 -> Z2
         i 1:1+25 PRG-POCKET-PATH",
    );
    let tools = vec![ToolOffset::new(3).with_radius(4.0)];
    let run = |program: &str| {
        let interpreter = Interpreter::new(haas()).with_tools(tools.clone());
        let (operations, findings) = interpreter.read_all(format!("{program}\nM30\n").as_bytes());
        let ends = operations.iter().filter_map(|operation| match &operation.kind {
            OperationKind::Move(step) => Some([step.end[0], step.end[1]]),
            _ => None,
        });
        let codes = findings.findings().iter().map(|it| it.code.to_string()).collect::<Vec<_>>();
        (ends.collect::<Vec<_>>(), codes)
    };
    let noted = vec!["PRG-POCKET-PATH".to_owned()];
    let centre = [30.0, 0.0];
    assert_eq!(
        run("G0 Z1\nG13 X30 I10 D3 F100"),
        (vec![[0.0; 2], centre, [36.0, 0.0], [36.0, 0.0], centre], noted.clone())
    );
    // D of a block before counts, also behind G40.
    assert_eq!(
        run("G40 D3\nG13 X30 I4 K6 Q1 F100").0,
        [centre, [31.0, 0.0], [31.0, 0.0], [32.0, 0.0], [32.0, 0.0], centre]
    );
    assert_eq!(run("G13 X30 I3 D3 F100").1, ["PRG-POCKET-WORD"]);
    assert_eq!(run("G13 X30 I3 F100").1, ["PRG-COMP-NUMBER"]);
}

#[test]
fn what_is_wrong_with_a_circular_pocket_is_one_finding() {
    let found = |program: &str| {
        let (operations, findings) = interpret(format!("{program}\nM30\n").as_bytes(), haas());
        assert!(
            operations
                .iter()
                .all(|operation| !matches!(&operation.kind, OperationKind::Move(step) if step.arc.is_some()))
        );
        findings.findings().iter().map(|it| format!("{}:{}", it.span.line, it.code)).collect::<Vec<_>>()
    };
    for words in ["Z-2 D0", "I-5 D0", "I5 K10 D0", "I5 Q2 D0", "I5 K4 Q1 D0", "I5 K10 Q0 D0", "I5 K10 Q0.0001 D0"] {
        assert_eq!(found(&format!("F100\nG13 {words}")), ["2:PRG-POCKET-WORD"], "{words}");
    }
    assert_eq!(found("G13 I5 D0"), ["1:PRG-FEED-MISSING"]);
    let (_, findings) = interpret(b"G0 Z2\nG13 D0 I5 Z-2 F100\nM30\n", mill());
    let codes: Vec<_> = findings.findings().iter().map(|it| it.code.to_string()).collect();
    assert_eq!(codes, ["PRG-CYCLE-SETTING"], "no other control is known to have it");
    assert_eq!(found("F100\nG91 G13 X5 I5 D0 L2 Z-1"), ["2:PRG-POCKET-WORD"]);
    assert_eq!(found("F100 G18\nG13 I5 D0"), ["2:PRG-POCKET-BLOCK"]);
    assert_eq!(found("F100 G16\nG13 I5 D0"), ["2:PRG-POCKET-BLOCK"]);
    assert_eq!(found("F100 M3 S1\nG0 Z5\nG81 Z-1 R2 L0\nG13 I5 D0\nG80"), ["4:PRG-POCKET-BLOCK"]);
}
