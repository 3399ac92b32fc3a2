//! `G70` to `G73` of FANUC and Haas.

use super::*;

/// The contour of the first worked example.
const CONTOUR: &str = "N10 G0 X20.\nG1 Z-10. F0.1\nX30. Z-15.\nZ-30.\nN20 X50.";

#[test]
fn the_worked_example() {
    let passes = "r 50.8 2.2; r 47.2 2.2; f 47.2 -29.8; r 49.2 -28.8; r 49.2 2.2;
        r 43.6 2.2; f 43.6 -29.8; r 45.6 -28.8; r 45.6 2.2;
        r 40 2.2; f 40 -29.8; r 42 -28.8; r 42 2.2;
        r 36.4 2.2; f 36.4 -29.8; r 38.4 -28.8; r 38.4 2.2;
        r 32.8 2.2; f 32.8 -29.8; r 34.8 -28.8; r 34.8 2.2;
        r 29.2 2.2; f 29.2 -14; r 31.2 -13; r 31.2 2.2;
        r 25.6 2.2; f 25.6 -12.2; r 27.6 -11.2; r 27.6 2.2;
        r 22 2.2; f 22 -10.4; r 24 -9.4; r 24 2.2;
        r 20.8 2.2; f 20.8 -9.8; f 30.8 -14.8; f 30.8 -29.8; f 50.8 -29.8; r 50.8 2; r 50 2";
    let finish = "r 20 2; f 20 -10; f 30 -15; f 30 -30; f 50 -30; r 50 2";
    let start = "M3 S1000\nG0 X50. Z2.\n";
    for (settings, cycle) in [
        (a(), "G71 U1.8 R1.\nG71 P10 Q20 U0.8 W0.2 F0.2\nCONTOUR\nG70 P10 Q20"),
        (system(GCodeSystem::B), "G71 U1.8 R1.\nG71 P10 Q20 U0.8 W0.2 F0.2\nCONTOUR\nG70 P10 Q20"),
        (system(GCodeSystem::C), "G73 U1.8 R1.\nG73 P10 Q20 U0.8 W0.2 F0.2\nCONTOUR\nG72 P10 Q20"),
        (lathe(), "G71 U1.8 R1.\nG71 P10 Q20 U0.8 W0.2 F0.2\nCONTOUR\nG70 P10 Q20"),
    ] {
        let program = format!("{start}{}", cycle.replace("CONTOUR", CONTOUR));
        moves(&settings, &program, 1, &format!("{passes}; {finish}"));
    }
    let mut one_line = a();
    one_line.turning.escape_mm = Some(1.0);
    let program = format!("{start}G71 P10 Q20 U0.8 W0.2 D1800 F0.2\n{CONTOUR}");
    moves(&one_line, &program, 1, passes);
    one_line.drilling.style = crate::DrillingStyle::Haas;
    let program = format!("{start}G71 P10 Q20 U0.8 W0.2 D1.8 F0.2\n{CONTOUR}");
    moves(&one_line, &program, 1, passes);
}

#[test]
fn feeds_and_speeds_of_the_contour_are_those_of_the_finishing() {
    let program = format!(
        "M3 S1000\nG0 X50. Z2.\nG71 U14. R1.\nG71 P10 Q20 U0.8 W0.2 F0.2\n{}\nG70 P10 Q20\nG1 X51.",
        CONTOUR.replace("N10 G0 X20.", "N10 G0 X20. S1500")
    );
    let (operations, _) = interpret(format!("{program}\nM30").as_bytes(), a());
    let cut = operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Move(step) if step.kind == MoveKind::Cutting => {
            Some((feed(step.feed), number(step.spindle.rev_per_s(0.0) * 60.0)))
        }
        _ => None,
    });
    let cut: Vec<_> = cut.collect();
    assert_eq!(cut.len(), 1 + 4 + 4 + 1);
    assert!(cut[..5].iter().all(|cut| *cut == ("0.2/rev".to_owned(), "1000".to_owned())), "{cut:?}");
    assert!(cut[5..].iter().all(|cut| *cut == ("0.1/rev".to_owned(), "1500".to_owned())), "{cut:?}");
}

#[test]
fn a_bore_is_the_mirror_image() {
    // From 20 mm to the contour 40, 30, 24: growing levels, escapes inward, a negative allowance.
    let program = "M3 S1000\nG0 X20. Z2.\nG71 U2. R0.5\nG71 P10 Q20 U-0.4 W0.1 F0.2\nN10 G0 X40.\nG1 Z-10.\nX30. Z-15.\nZ-30.\nN20 X20.\nG70 P10 Q20";
    moves(
        &a(),
        program,
        1,
        "r 19.6 2.1; r 23.6 2.1; f 23.6 -29.9; r 22.6 -29.4; r 22.6 2.1;
         r 27.6 2.1; f 27.6 -29.9; r 26.6 -29.4; r 26.6 2.1;
         r 31.6 2.1; f 31.6 -13.9; r 30.6 -13.4; r 30.6 2.1;
         r 35.6 2.1; f 35.6 -11.9; r 34.6 -11.4; r 34.6 2.1;
         r 39.6 2.1; f 39.6 -9.9; f 29.6 -14.9; f 29.6 -29.9; f 19.6 -29.9; r 19.6 2; r 20 2;
         r 40 2; f 40 -10; f 30 -15; f 30 -30; f 20 -30; r 20 2",
    );
}

#[test]
fn a_face_along_x() {
    // Depth 2 in Z from Z2.2 on; the contour from (60, −10) over (40, −4) to (20, 0).
    let program = "M3 S1000\nG0 X64. Z2.\nG72 W2. R0.5\nG72 P10 Q20 U0.4 W0.2 F0.2\nN10 G0 Z-10.\nG1 X60.\nX40. Z-4.\nX20. Z0.\nN20 Z2.\nG70 P10 Q20";
    let expected = "r 64.4 2.2; r 64.4 0.2; f 20.4 0.2; r 21.4 0.7; r 64.4 0.7;
         r 64.4 -1.8; f 30.4 -1.8; r 31.4 -1.3; r 64.4 -1.3;
         r 64.4 -3.8; f 40.4 -3.8; r 41.4 -3.3; r 64.4 -3.3;
         r 64.4 -5.8; f 47.066667 -5.8; r 48.066667 -5.3; r 64.4 -5.3;
         r 64.4 -7.8; f 53.733333 -7.8; r 54.733333 -7.3; r 64.4 -7.3;
         r 64.4 -9.8; f 60.4 -9.8; f 40.4 -3.8; f 20.4 0.2; f 20.4 2.2; r 64 2.2; r 64 2;
         r 64 -10; f 60 -10; f 40 -4; f 20 0; f 20 2; r 64 2";
    moves(&a(), program, 1, expected);
    let in_c = program.replace("G72", "G74").replace("G70", "G72");
    moves(&system(GCodeSystem::C), &in_c, 1, expected);
    let mut haas = a();
    haas.drilling.style = crate::DrillingStyle::Haas;
    haas.turning.escape_mm = Some(0.5);
    let one_line = program.replace("G72 W2. R0.5\n", "").replace("W0.2 F0.2", "W0.2 D2. F0.2");
    moves(&haas, &one_line, 1, expected);
}

#[test]
fn levels_meet_arcs_exactly() {
    // Quarters of radius 5: about X30 Z-10, and about X30 Z-20.
    let program = "M3 S1000\nG0 X40. Z2.\nG71 U2. R0.5\nG71 P10 Q20 F0.2\nN10 G0 X20.\nG1 Z-10.\nG2 X30. Z-15. R5.\nG3 X40. Z-20. R5.\nN20 G1 Z-25.";
    moves(
        &a(),
        program,
        1,
        "r 36 2; f 36 -16; r 37 -15.5; r 37 2; r 32 2; f 32 -15.101021; r 33 -14.601021; r 33 2;
         r 28 2; f 28 -14.898979; r 29 -14.398979; r 29 2; r 24 2; f 24 -14; r 25 -13.5; r 25 2;
         r 20 2; f 20 -10; a- 30 -15; a+ 40 -20; f 40 -25; r 40 2",
    );
}

#[test]
fn a_pattern_comes_nearer() {
    let passes = "r 37.4 4.1; f 37.4 -17.9; f 57.4 -25.9; r 57.4 4.1;
        r 28.9 3.1; f 28.9 -18.9; f 48.9 -26.9; r 48.9 3.1;
        r 20.4 2.1; f 20.4 -19.9; f 40.4 -27.9; r 40.4 2.1; r 40.4 2; r 40 2";
    let go = "M3 S1000\nG0 X40. Z2.\n";
    let contour = "N10 G0 X20.\nG1 Z-20.\nN20 X40. Z-28.";
    let two_lines = "U8.5 W2. R3";
    for (settings, code, first) in [
        (a(), "G73", two_lines),
        (system(GCodeSystem::B), "G73", two_lines),
        (system(GCodeSystem::C), "G75", two_lines),
        (lathe(), "G21\nG73", two_lines),
    ] {
        let second = code.trim_start_matches("G21\n");
        let program = format!("{go}{code} {first}\n{second} P10 Q20 U0.4 W0.1 F0.2\n{contour}");
        moves(&settings, &program, 1, passes);
    }
    moves(&a(), &format!("{go}G73 P10 Q20 I8.5 K2. D3 U0.4 W0.1 F0.2\n{contour}"), 1, passes);
    // One pass is the last one.
    moves(
        &a(),
        &format!("{go}G73 U8.5 W2. R1\nG73 P10 Q20 U0.4 W0.1 F0.2\n{contour}"),
        1,
        "r 20.4 2.1; f 20.4 -19.9; f 40.4 -27.9; r 40.4 2.1; r 40.4 2; r 40 2",
    );
}

#[test]
fn pockets_are_cut_to_their_bottom_one_after_the_other() {
    // Ridge at 40, pockets to 24 and 30; levels 44, 38, 32, 26.
    let program = "M3 S1000\nG0 X50. Z2.\nG71 U3. R0.5\nG71 P10 Q20 U0 W0 F0.2\nN10 G0 X20. W0\nG1 Z-5.\nX40. Z-10.\nX24. Z-18.\nZ-22.\nX40. Z-30.\nX30. Z-35.\nZ-40.\nN20 X50. Z-45.";
    moves(&a(), program, 1,
        "r 44 2; f 44 -43.5; f 50 -45; r 51 -44.5; r 51 2;
         r 38 2; f 38 -9.5; f 40 -10; r 41 -9.5; r 41 2;
         r 32 2; f 32 -8; f 38 -9.5; r 39 -9; r 39 2;
         r 26 2; f 26 -6.5; f 32 -8; r 33 -7.5; r 33 2;
         r 45 2; r 45 -10; f 40 -10; f 38 -11; f 38 -29; f 40 -30; r 41 -29.5;
         r 41 -11; f 38 -11; f 32 -14; f 32 -26; f 38 -29; r 39 -28.5;
         r 39 -14; f 32 -14; f 26 -17; f 26 -23; f 32 -26; r 33 -25.5;
         r 45 -25.5; r 45 -30; f 40 -30; f 38 -31; f 38 -42; f 44 -43.5; r 45 -43;
         r 45 -31; f 38 -31; f 32 -34; f 32 -40.5; f 38 -42; r 39 -41.5;
         r 50 -41.5; r 50 2; r 20 2; f 20 -5; f 40 -10; f 24 -18; f 24 -22; f 40 -30; f 30 -35; f 30 -40; f 50 -45; r 50 2;
         i 4:1+22 PRG-TURNING-POCKETS");
}

#[test]
fn inch_and_incremental_words() {
    // 2 inch, depth 0.1 inch on the radius; U and W in the contour.
    moves(
        &a(),
        "G20\nM3 S1000\nG0 X2. Z.1\nG71 U.2 R.02\nG71 P10 Q20 U.02 W.01 F.01\nN10 G0 U-1.\nG1 W-.6\nN20 U1.",
        1,
        "r 51.308 2.794; r 41.148 2.794; f 41.148 -12.446; r 42.164 -11.938; r 42.164 2.794;
         r 30.988 2.794; f 30.988 -12.446; r 32.004 -11.938; r 32.004 2.794;
         r 25.908 2.794; f 25.908 -12.446; f 51.308 -12.446; r 51.308 2.54; r 50.8 2.54",
    );
}

#[test]
fn a_face_beyond_the_centre_and_a_first_block_with_feed() {
    // Facing to −1.6 mm; the passes go down at the feed, as the first block says.
    moves(
        &a(),
        "M3 S1000\nG0 X30. Z2.\nG72 W1.5 R0.5\nG72 P10 Q20 F0.2\nN10 G1 Z-1.\nN20 X-1.6",
        1,
        "f 30 0.5; f -1.6 0.5; r -0.6 1; r 30 1; f 30 -1; f -1.6 -1; r -1.6 2; r 30 2",
    );
}

#[test]
fn the_contour_elsewhere() {
    // Before the cycle: the program goes on behind the cycle, with a warning.
    let program = format!(
        "M3 S1000\nGOTO 1\n{CONTOUR}\nN1 G0 X50. Z2.\nG71 U10. R1.\nG71 P10 Q20 U0.8 W0.2 F0.2\nG70 P10 Q20\nG0 X60."
    );
    moves(
        &a(),
        &program,
        1,
        "r 50.8 2.2; r 30.8 2.2; f 30.8 -29.8; r 32.8 -28.8; r 32.8 2.2;
         r 20.8 2.2; f 20.8 -9.8; f 30.8 -14.8; f 30.8 -29.8; f 50.8 -29.8; r 50.8 2; r 50 2;
         r 20 2; f 20 -10; f 30 -15; f 30 -30; f 50 -30; r 50 2; r 60 2; w 10:1+26 PRG-TURNING-DETACHED",
    );
    // Behind it, with comments and empty lines between, it follows.
    let program =
        format!("M3 S1000\nG0 X50. Z2.\nG71 U20. R1.\nG71 P10 Q20 U0.8 W0.2 F0.2\n\n(contour)\n\n{CONTOUR}\nG0 X60.");
    moves(
        &a(),
        &program,
        1,
        "r 50.8 2.2; r 20.8 2.2; f 20.8 -9.8; f 30.8 -14.8; f 30.8 -29.8; f 50.8 -29.8; r 50.8 2; r 50 2; r 60 2",
    );
    // Behind another block, it is executed as it stands when its turn comes.
    let program = format!("M3 S1000\nG0 X50. Z2.\nG71 U20. R1.\nG71 P10 Q20 U0.8 W0.2 F0.2\nM8\n{CONTOUR}");
    moves(
        &a(),
        &program,
        1,
        "r 50.8 2.2; r 20.8 2.2; f 20.8 -9.8; f 30.8 -14.8; f 30.8 -29.8; f 50.8 -29.8; r 50.8 2; r 50 2;
         r 20 2; f 20 -10; f 30 -15; f 30 -30; f 50 -30; w 4:1+26 PRG-TURNING-DETACHED",
    );
}

#[test]
fn contours_compute() {
    // Variables and jumps within the contour, a chamfer and a rounding between its blocks.
    let program = "M3 S1000\n#1=20.\nG0 X40. Z2.\nG71 U20. R1.\nG71 P10 Q20 F0.2\nN10 G0 X#1\n#2=#1/2\nG1 Z-#2\nX30. ,C1.\nZ-20.\nN20 X40.";
    moves(&a(), program, 1, "r 20 2; f 20 -10; f 28 -10; f 30 -11; f 30 -20; f 40 -20; r 40 2");
    let program = "M3 S1000\nG0 X40. Z2.\nG71 U20. R1.\nG71 P10 Q20 F0.2\nN10 G0 X20.\nIF [1 EQ 2] GOTO 20\nG1 Z-10. ,R2.\nX30.\nN20 G1 X40. Z-12.";
    moves(&a(), program, 1, "r 20 2; f 20 -8; a- 24 -10; f 30 -10; f 40 -12; r 40 2");
}

#[test]
fn the_nose_is_compensated_in_the_finishing_only() {
    let settings = a();
    let nose = vec![ToolOffset { tip: 3, ..ToolOffset::new(1).with_radius(0.4) }];
    let program = "T0101\nM3 S1000\nG0 X50. Z2.\nG71 U20. R1.\nG71 P10 Q20 F0.2\nN10 G0 G42 X20.\nG1 Z-10.\nX30. Z-15.\nN20 G40 X50.\nG70 P10 Q20\nM30\n";
    let (operations, findings) = Interpreter::new(settings).with_tools(nose).read_all(program.as_bytes());
    let ends: Vec<_> = operations
        .iter()
        .filter_map(|operation| match &operation.kind {
            OperationKind::Move(step) if step.kind == MoveKind::Cutting => {
                Some(format!("{} {}", number(step.end[0] * 2.0), number(step.end[2])))
            }
            _ => None,
        })
        .collect();
    assert_eq!(ends[..3], ["20 -10", "30 -15", "50 -15"], "{findings:?}");
    assert_ne!(ends[3], "20 -10");
    let codes: Vec<_> = findings.findings().iter().map(|finding| finding.code.name()).collect();
    assert_eq!(codes, ["PRG-TURNING-COMPENSATION"]);
}

#[test]
fn a_face_from_the_inside_outward() {
    // The passes go toward +X, so that the stock is on the side of −X: U is negative.
    moves(
        &a(),
        "M3 S1000\nG0 X10. Z2.\nG72 W1. R0.5\nG72 P10 Q20 U-0.4 W0.1 F0.2\nN10 G0 Z-4.\nG1 X20.\nX30. Z0.\nN20 Z2.",
        1,
        "r 9.6 2.1; r 9.6 1.1; f 29.6 1.1; r 28.6 1.6; r 9.6 1.6; r 9.6 0.1; f 29.6 0.1; r 28.6 0.6; r 9.6 0.6;
         r 9.6 -0.9; f 27.1 -0.9; r 26.1 -0.4; r 9.6 -0.4; r 9.6 -1.9; f 24.6 -1.9; r 23.6 -1.4; r 9.6 -1.4;
         r 9.6 -2.9; f 22.1 -2.9; r 21.1 -2.4; r 9.6 -2.4;
         r 9.6 -3.9; f 19.6 -3.9; f 29.6 0.1; f 29.6 2.1; r 10 2.1; r 10 2",
    );
}

#[test]
fn a_pattern_in_a_bore() {
    moves(
        &a(),
        "M3 S1000\nG0 X20. Z2.\nG73 U-2. W1. R2\nG73 P10 Q20 U-0.4 W0.1 F0.2\nN10 G0 X30.\nG1 Z-10.\nN20 X22. Z-15.",
        1,
        "r 25.6 3.1; f 25.6 -8.9; f 17.6 -13.9; r 15.6 -13.9; r 15.6 3.1;
         r 29.6 2.1; f 29.6 -9.9; f 21.6 -14.9; r 19.6 -14.9; r 19.6 2.1; r 19.6 2; r 20 2",
    );
}

/// Two lines, and what the one line has instead of the first.
const FORMS: [(&str, &str, &str); 6] = [
    ("G0 X20. Z2.\nG71 U2. R0.5", "G71 P10 Q20 U-0.4 W0.1", "N10 G0 X40.\nG1 Z-10.\nX30. Z-15.\nN20 X20."),
    ("G0 X40. Z2.\nG71 U1.5 R0.5", "G71 P10 Q20", "N10 G0 X20.\nG1 Z-10.\nG2 X30. Z-15. R5.\nN20 G1 X40."),
    ("G0 X64. Z2.\nG72 W2. R0.5", "G72 P10 Q20 U0.4 W0.2", "N10 G0 Z-10.\nG1 X60.\nX40. Z-4.\nN20 X20. Z0."),
    ("G0 X10. Z2.\nG72 W1. R0.5", "G72 P10 Q20 U-0.4", "N10 G0 Z-4.\nG1 X20.\nN20 X30. Z0."),
    ("G0 X40. Z2.\nG73 U3. W2. R3", "G73 P10 Q20 U0.4 W0.1", "N10 G0 X20.\nG1 Z-20.\nN20 X40. Z-28."),
    ("G0 X20. Z2.\nG73 U-2. W1. R2", "G73 P10 Q20 U-0.4", "N10 G0 X30.\nG1 Z-10.\nN20 X22. Z-15."),
];

#[test]
fn one_line_is_two() {
    let mut fanuc = a();
    fanuc.turning.escape_mm = Some(0.5);
    let mut haas = fanuc.clone();
    haas.drilling.style = crate::DrillingStyle::Haas;
    for (first, second, contour) in FORMS {
        let two = format!("M3 S1000\n{first}\n{second} F0.2\n{contour}\nG70 P10 Q20\nG0 Z9.");
        let (go, words) = first.split_once('\n').unwrap();
        let words: Vec<_> = words.split(' ').collect();
        let one = |words: String| format!("M3 S1000\n{go}\n{second} {words} F0.2\n{contour}\nG70 P10 Q20\nG0 Z9.");
        let (of_fanuc, of_haas) = match words.as_slice() {
            [_, depth, _] => {
                let depth: f64 = depth[1..].parse().unwrap();
                (one(format!("D{}", depth * 1_000.0)), one(format!("D{depth:?}")))
            }
            [_, along_x, along_z, passes] => {
                let words = format!("I{} K{} D{}", &along_x[1..], &along_z[1..], &passes[1..]);
                (one(words.clone()), one(words))
            }
            other => panic!("{other:?}"),
        };
        let expected = path(&a(), &two);
        assert!(!expected.contains('!') && expected.lines().count() > 12, "{expected}");
        assert_eq!(path(&fanuc, &of_fanuc), expected, "{of_fanuc}");
        assert_eq!(path(&haas, &of_haas), expected, "{of_haas}");
    }
}

#[test]
fn a_pocket_is_cut_in_passes_where_a_level_is_that_of_the_start_of_the_contour() {
    // Levels 58, 54, 50, ...; the contour starts at 50.
    let program = "M3 S1000\nG0 X62. Z2.\nG71 U2. R0.5\nG71 P10 Q20 F0.2\nN10 G1 X50. W0\nZ-10.\nX38. Z-13.\nZ-25.\nX50. Z-28.\nN20 X62. Z-29.";
    moves(
        &a(),
        program,
        1,
        "f 58 2; f 58 -28.666667; f 62 -29; r 63 -28.5; r 63 2;
         f 54 2; f 54 -28.333333; f 58 -28.666667; r 59 -28.166667; r 59 2;
         f 50 2; f 50 -28; f 54 -28.333333; r 55 -27.833333; r 55 2;
         r 55 -10; f 50 -10; f 46 -11; f 46 -27; f 50 -28; r 51 -27.5;
         r 51 -11; f 46 -11; f 42 -12; f 42 -26; f 46 -27; r 47 -26.5;
         r 47 -12; f 42 -12; f 38 -13; f 38 -25; f 42 -26; r 43 -25.5;
         r 62 -25.5; r 62 2; f 50 2; f 50 -10; f 38 -13; f 38 -25; f 50 -28; f 62 -29; r 62 2;
         i 4:1+16 PRG-TURNING-POCKETS",
    );
}

/// No pass cuts deeper than the contour with its allowances, nor more than its depth, and nothing is cut rapidly: random contours, random starts, outside and in bores.
mod random {
    use proptest::prelude::*;

    use super::*;

    /// Radius of a polyline of Z and X at a Z, the smallest or the largest of a step.
    fn radius(contour: &[[f64; 2]], z: f64) -> Option<f64> {
        contour.windows(2).find_map(|ends| {
            let [[z0, x0], [z1, x1]] = [ends[0], ends[1]];
            (z <= z0 && z >= z1 && z0 > z1).then(|| x0 + (z - z0) / (z1 - z0) * (x1 - x0))
        })
    }

    /// The stock of a contour: radii at places along Z that no move ends at.
    fn stock(contour: &[[f64; 2]], diameter: f64) -> Vec<[f64; 2]> {
        let end = contour.last().unwrap()[0];
        (0..400).map(|place| [end * (f64::from(place) + 0.123_456_7) / 400.0, diameter * 0.5]).collect()
    }

    /// Cuts the stock along a move; the most that it removes at one place, on the radius.
    fn cut(stock: &mut [[f64; 2]], step: &Move, sign: f64) -> f64 {
        let [start, end] = [step.start, step.end].map(|position| [position[2], position[0]]);
        let mut most = 0.0_f64;
        for [z, left] in stock.iter_mut().filter(|[z, _]| (start[0] - *z) * (end[0] - *z) < 0.0) {
            let radius = start[1] + (*z - start[0]) / (end[0] - start[0]) * (end[1] - start[1]);
            most = most.max(sign * (*left - radius));
            *left = sign * (sign * *left).min(sign * radius);
        }
        most
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn passes_stay_off_the_part(
            steps in prop::collection::vec((0.5_f64..6.0, -3.0_f64..4.0), 2..8),
            depth in 0.4_f64..3.0,
            is_pocketed in any::<bool>(),
            is_bore in any::<bool>(),
            is_round in any::<bool>(),
        ) {
            // Round numbers let levels and corners of the contour coincide.
            let depth = if is_round { (depth * 2.0).ceil() * 0.5 } else { depth };
            let sign = if is_bore { -1.0 } else { 1.0 };
            let first = if is_bore { 60.0 } else { 20.0 };
            let (mut z, mut x) = (0.0, first);
            let mut contour = vec![[2.0, first], [0.0, first]];
            let mut text = format!("N10 G0 X{first:.3}{}\nG1 Z0.\n", if is_pocketed { " W0" } else { "" });
            let mut furthest: f64 = 0.0;
            for (along, across) in steps {
                z -= (along * 1_000.0).round() / 1_000.0;
                let across = if is_pocketed { across } else { across.abs() };
                x += sign * if is_round { across.round() } else { (across * 1_000.0).round() / 1_000.0 };
                furthest = furthest.max(sign * (x - first));
                contour.push([z, x]);
                text.push_str(&format!("X{x:.3} Z{z:.3}\n"));
            }
            let start = first + sign * (furthest + 4.0);
            text.push_str(&format!("N20 X{start:.3}"));
            let allowance = sign * 0.4;
            let program = format!("M3 S1000\nG0 X{start:.3} Z2.\nG71 U{depth:.3} R0.3\nG71 P10 Q20 U{allowance} F0.2\n{text}\nM30\n");
            let (operations, findings) = interpret(program.as_bytes(), a());
            prop_assert!(!findings.has_errors(), "{}\n{:?}", program, findings);
            let mut stock = stock(&contour, start);
            // Behind the move to the start of the cycle.
            for operation in operations.iter().filter(|operation| operation.span.line > 2) {
                let OperationKind::Move(step) = &operation.kind else { continue };
                let removed = cut(&mut stock, step, sign);
                let most = if step.kind == MoveKind::Cutting { depth + 1e-3 } else { 1e-3 };
                prop_assert!(removed < most, "{}\n{:?} removes {}", program, step, removed);
                for share in 0..=20 {
                    let at = |axis: usize| step.start[axis] + (step.end[axis] - step.start[axis]) * f64::from(share) / 20.0;
                    if let Some(diameter) = radius(&contour, at(2)) {
                        let gap = sign * (at(0) * 2.0 - diameter) - 0.4;
                        prop_assert!(gap > -1e-3, "{}\nat X{} Z{}: {}", program, at(0) * 2.0, at(2), gap);
                    }
                }
            }
        }
    }
}
