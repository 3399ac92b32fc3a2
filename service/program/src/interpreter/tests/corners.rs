//! Chamfers, roundings and angles: section 8 of the page on the program language, worked by hand.

use proptest::prelude::*;

use super::*;

#[test]
fn the_size_of_a_corner_may_be_computed() {
    for (words, written) in [(",R#1", ",R5."), (",C[#1-3]", ",C2."), (",R-#2", ",R1.")] {
        let program = |corner: &str| format!("#1=5\n#2=-1\nG1 X10 {corner} F100\nY20");
        let found = |corner: &str| render(program(corner), &mill());
        assert_eq!(found(words), found(written), "{words}");
        assert!(found(words).contains("Y20") && !found(words).contains('!'), "{}", found(words));
    }
    // A vacant value: there is no corner.
    check(&mill(), "G1 X10 ,R#1 F100\nY20", "line 0 -> X10 @100/min\nline X10 -> X10 Y20 @100/min");
}

#[test]
fn a_rounding_and_a_chamfer_between_lines() {
    check(
        &mill(),
        "G1 X10 ,R5 F100\nY20",
        "line 0 -> X5 @100/min\narc X5 -> X10 Y5 about 5,5 by 90 @100/min\nline X10 Y5 -> X10 Y20 @100/min",
    );
    check(
        &mill(),
        "G1 X10 ,R5 F100\nY-20",
        "line 0 -> X5 @100/min\narc X5 -> X10 Y-5 about 5,-5 by -90 @100/min\nline X10 Y-5 -> X10 Y-20 @100/min",
    );
    check(
        &mill(),
        "G1 X10 ,C2 F100\nY20 F50",
        "line 0 -> X8 @100/min\nline X8 -> X10 Y2 @100/min\nline X10 Y2 -> X10 Y20 @50/min",
    );
    // An acute corner: the ends are r·tan(δ/2) = tan 67.5° from it.
    check(
        &mill(),
        "G1 X10 ,R1 F100\nX0 Y10",
        "line 0 -> X7.585786 @100/min\narc X7.585786 -> X8.292893 Y1.707107 about 7.585786,1 by 135 @100/min\n\
         line X8.292893 Y1.707107 -> Y10 @100/min",
    );
    // In inches, and with the least increment.
    check(
        &mill(),
        "G20\nG1 X1 ,C.1 F1\nY1",
        "line 0 -> X22.86 @25.4/min\nline X22.86 -> X25.4 Y2.54 @25.4/min\nline X25.4 Y2.54 -> X25.4 Y25.4 @25.4/min",
    );
    // A corner of no size is none.
    check(&mill(), "G1 X10 ,R0 F100\nY20", "line 0 -> X10 @100/min\nline X10 -> X10 Y20 @100/min");
}

#[test]
fn a_corner_where_the_path_goes_straight_on_is_noted() {
    for corner in [",R5", ",C2"] {
        let program = format!("G1 X10 {corner} F100\nX20");
        check(&mill(), &program, "line 0 -> X10 @100/min\nline X10 -> X20 @100/min\ni 1:8+3 PRG-CORNER");
        let program = format!("G1 X10 {corner} F100\nG3 X20 Y10 R10");
        check(
            &mill(),
            &program,
            "line 0 -> X10 @100/min\narc X10 -> X20 Y10 about 10,10 by 90 @100/min\ni 1:8+3 PRG-CORNER",
        );
    }
}

#[test]
fn a_rounding_and_a_chamfer_at_an_arc() {
    // The centre is 1 above the line and 9 from the centre of the arc: at √80.
    check(
        &mill(),
        "G1 X10 ,R1 F100\nG3 X0 Y10 I-10",
        "line 0 -> X8.944272 @100/min\narc X8.944272 -> X9.93808 Y1.111111 about 8.944272,1 by 96.37937 @100/min\n\
         arc X9.93808 Y1.111111 -> Y10 about 0,0 by 83.62063 @100/min",
    );
    // The same path backwards.
    check(
        &mill(),
        "G0 Y10\nG2 X10 Y0 J-10 ,R1 F100\nG1 X0",
        "rapid 0 -> Y10\narc Y10 -> X9.93808 Y1.111111 about 0,0 by -83.62063 @100/min\n\
         arc X9.93808 Y1.111111 -> X8.944272 about 8.944272,1 by -96.37937 @100/min\nline X8.944272 -> 0 @100/min",
    );
    // 2 mm from the corner as the crow flies: 2·asin(0.1) = 11.478341° of the arc.
    check(
        &mill(),
        "G1 X10 ,C2 F100\nG3 X0 Y10 I-10",
        "line 0 -> X8 @100/min\nline X8 -> X9.8 Y1.989975 @100/min\narc X9.8 Y1.989975 -> Y10 about 0,0 by 78.521659 @100/min",
    );
    // Between two arcs about (5, 0) and (10, 5) that both bend away: the centre is 6 from either of theirs.
    let (operations, findings) = interpret(b"G2 X5 Y5 I5 ,R1 F100\nG2 X10 Y10 I5\nM30", mill());
    assert!(findings.findings().is_empty(), "{findings:?}");
    let OperationKind::Move(Move { arc: Some(arc), .. }) = &operations[1].kind else { panic!("{operations:?}") };
    for center in [[5.0_f64, 0.0_f64], [10.0, 5.0]] {
        assert!(((arc.center[0] - center[0]).hypot(arc.center[1] - center[1]) - 6.0).abs() < 1e-12, "{arc:?}");
    }
}

#[test]
fn corners_at_both_ends_of_a_move() {
    let around = "line 0 -> X5 @100/min\narc X5 -> X10 Y5 about 5,5 by 90 @100/min\n";
    check(
        &mill(),
        "G1 X10 ,R5 F100\nY20 ,C3\nX0",
        &format!(
            "{around}line X10 Y5 -> X10 Y17 @100/min\nline X10 Y17 -> X7 Y20 @100/min\nline X7 Y20 -> Y20 @100/min"
        ),
    );
    // They may meet, but not overlap.
    check(
        &mill(),
        "G1 X10 ,R5 F100\nY10 ,R5\nX0",
        &format!("{around}arc X10 Y5 -> X5 Y10 about 5,5 by 90 @100/min\nline X5 Y10 -> Y10 @100/min"),
    );
    let (_, findings) = interpret(b"G1 X10 ,R5 F100\nY10 ,R5.1\nX0\nM30", mill());
    assert_eq!(findings.findings().len(), 1, "{findings:?}");
}

#[test]
fn blocks_of_numbers_and_comments_are_nothing_between_two_moves() {
    let expected = "line 0 -> X8 @100/min\nline X8 -> X10 Y2 @100/min\nline X10 Y2 -> X10 Y20 @100/min";
    check(&mill(), "G1 X10 ,C2 F100\n(corner)\n\nN20\nN30 Y20", expected);
}

#[test]
fn corners_that_cannot_be() {
    for (program, place) in [
        ("G1 X10 ,R5 F100\nY2\nX0", "1:8+3"),
        ("G1 X4 ,R5 F100\nY20", "1:7+3"),
        ("G1 X10 ,R5 F100\nM8\nY20", "1:8+3"),
        ("G1 X10 ,R5 F100\nG0 Y20", "1:8+3"),
        ("G1 X10 ,R5 F100\nG4 P1\nY20", "1:8+3"),
        ("G1 X10 ,R5 F100\nZ20", "1:8+3"),
        ("G1 X10 ,R5 F100\nX0", "1:8+3"),
        ("G1 X10 ,R5 F100\nG90", "1:8+3"),
        ("G1 X10 ,R5 F100", "1:8+3"),
        ("G1 X10 ,R-5 F100\nY20", "1:8+4"),
        ("G0 X10 ,R5\nY20", "1:8+3"),
        ("M8 ,C1", "1:4+3"),
        ("G1 X10 ,R5 F100\nG17 G2 X10 Y0 I5 J0", "1:8+3"),
    ] {
        let (_, findings) = interpret(format!("{program}\nM30").as_bytes(), mill());
        let found: Vec<_> = findings.findings().iter().map(render_finding).collect();
        if program.contains("G2") {
            assert!(found.is_empty(), "a full circle begins at right angles: {found:?}");
            continue;
        }
        assert_eq!(found, [format!("! {place} PRG-CORNER")], "{program}");
    }
    check(&mill(), "G1 X10 ,R5 ,C2 F100\nY20", "line X10 -> X10 Y20 @100/min\n! 1:12+3 PRG-WORD-DUPLICATE");
    check(&mill(), "G1 X10 ,X5 F100", "! 1:8+3 PRG-CHARACTER");
    // LinuxCNC has none of them.
    check(&linuxcnc(), "F100 G1 X10 ,R5", "! 1:13+3 PRG-CHARACTER");
}

#[test]
fn lathes_write_them_without_a_comma() {
    let start = "G98 F100\nG0 X20 Z2\n";
    let moved = "rapid 0 -> X10 Z2\n";
    let end = "line X13 Z-20 -> X20 Z-20 @100/min";
    check(
        &lathe(),
        &format!("{start}G1 Z-20 R3\nX40"),
        &format!(
            "{moved}line X10 Z2 -> X10 Z-17 @100/min\narc X10 Z-17 -> X13 Z-20 about -17,13 by -90 @100/min\n{end}"
        ),
    );
    let chamfer = format!("{moved}line X10 Z2 -> X10 Z-17 @100/min\nline X10 Z-17 -> X13 Z-20 @100/min\n{end}");
    check(&lathe(), &format!("{start}G1 Z-20 I3\nX40"), &chamfer);
    check(&lathe(), &format!("{start}G1 Z-20 ,C3\nX40"), &chamfer);
    let plain = LanguageSettings { plain_drawing_words: true, ..lathe() };
    check(&plain, &format!("{start}G1 Z-20 C3\nX40"), &chamfer);
    check(
        &lathe(),
        &format!("{start}G1 X40 K-2\nZ-30"),
        &format!("{moved}line X10 Z2 -> X18 Z2 @100/min\nline X18 Z2 -> X20 @100/min\nline X20 -> X20 Z-30 @100/min"),
    );
    // The sign is the direction of the next move.
    for block in ["Z-20 R-3", "Z-20 I-3"] {
        let length = block.split(' ').nth(1).map_or(0, str::len);
        let (_, findings) = interpret(format!("{start}G1 {block}\nX40\nM30").as_bytes(), lathe());
        let found: Vec<_> = findings.findings().iter().map(render_finding).collect();
        assert_eq!(found, [format!("! 3:9+{length} PRG-CORNER")], "{block}");
    }
    check(&lathe(), &format!("{start}G1 Z-20 K3"), &format!("{moved}! 3:9+2 PRG-WORD-UNUSED"));
    check(&mill(), "G1 X10 R3 F100", "! 1:8+2 PRG-WORD-UNUSED");
}

#[test]
fn words_of_the_drawing_need_neither_comma_nor_sign() {
    let plain = LanguageSettings { plain_drawing_words: true, ..lathe() };
    let path =
        |settings: &LanguageSettings, blocks: &str| render(format!("G98 F100\nG0 X20 Z2\n{blocks}\nM30\n"), settings);
    let with_commas = path(&lathe(), "G1 Z-20 ,R3\nX40 ,C2\nX60 Z-40 ,R1\nX70");
    assert!(!with_commas.contains("PRG") && with_commas.contains("arc"), "{with_commas}");
    assert_eq!(path(&plain, "G1 Z-20 R3\nX40 C2\nX60 Z-40 R1\nX70"), with_commas);
    // Toward smaller X, and toward -Z, which a sign would have to say.
    let inward = path(&lathe(), "G1 Z-20 ,R1\nX10 ,C2\nZ-30");
    assert_eq!(path(&plain, "G1 Z-20 R1\nX10 C2\nZ-30"), inward);
    assert_eq!(path(&plain, "G1 Z-20 R-1\nX10 C-2\nZ-30"), inward);
    assert!(path(&plain, "G1 Z-20 R-1\nX40").contains("PRG-CORNER"));
}

#[test]
fn an_angle_gives_the_missing_coordinate() {
    check(&mill(), "G1 X10 ,A45 F100", "line 0 -> X10 Y10 @100/min");
    check(&mill(), "G1 Y10 ,A30 F100", "line 0 -> X17.320508 Y10 @100/min");
    check(&mill(), "G18 G1 Z10 ,A45 F100", "line 0 -> X10 Z10 @100/min");
    // A lathe: from +Z, toward +X, in true lengths.
    check(&lathe(), "G98 F100 G0 X20\nG1 Z-10 ,A170", "rapid 0 -> X10\nline X10 -> X11.76327 Z-10 @100/min");
    let plain = LanguageSettings { plain_drawing_words: true, ..lathe() };
    check(&plain, "G98 F100 G0 X20\nG1 Z-10 A170", "rapid 0 -> X10\nline X10 -> X11.76327 Z-10 @100/min");
    for (program, place) in [
        ("G1 X10 ,A90 F100", "1:8+4"),
        ("G1 X10 Y10 ,A45 F100", "1:12+4"),
        ("G0 X10 ,A45", "1:8+4"),
        ("G1 Z10 ,A45 F100", "1:8+4"),
        ("G1 ,A45 F100", "1:1+12"),
        ("G1 ,A45 F100\nX5", "1:1+12"),
        ("G1 ,A45 F100\nX5 Y9 ,A45", "2:7+4"),
    ] {
        let (_, findings) = interpret(format!("{program}\nM30").as_bytes(), mill());
        let found: Vec<_> = findings.findings().iter().map(render_finding).collect();
        assert_eq!(found, [format!("! {place} PRG-CORNER")], "{program}");
    }
}

#[test]
fn two_angles_give_the_point_between_two_lines() {
    check(&mill(), "G1 ,A90 F100\nX20 Y10 ,A0", "line 0 -> Y10 @100/min\nline Y10 -> X20 Y10 @100/min");
    check(&mill(), "G1 ,A45 F100\nX20 Y0 ,A-45", "line 0 -> X10 Y10 @100/min\nline X10 Y10 -> X20 @100/min");
    check(
        &mill(),
        "G1 ,A90 ,R5 F100\nX20 Y10 ,A0 ,C2\nY0",
        "line 0 -> Y5 @100/min\narc Y5 -> X5 Y10 about 5,5 by -90 @100/min\nline X5 Y10 -> X18 Y10 @100/min\n\
         line X18 Y10 -> X20 Y8 @100/min\nline X20 Y8 -> X20 @100/min",
    );
}

proptest! {
    /// Whatever the corner: the rounding is tangent to both lines, has its radius, and the path is continuous.
    #[test]
    fn a_rounding_is_tangent(turn in 5.0..170.0_f64, left: bool, heading in 0.0..360.0_f64, radius in 0.01..3.0_f64) {
        let turn = if left { turn } else { -turn };
        let point = |length: f64, angle: f64| {
            let (sine, cosine) = angle.to_radians().sin_cos();
            [length * cosine, length * sine]
        };
        let [x, y] = point(50.0, heading);
        let [dx, dy] = point(50.0, heading + turn);
        let program = format!("F100 G1 X{x} Y{y} ,R{radius}\nX{} Y{}\nM30", x + dx, y + dy);
        let (operations, findings) = interpret(program.as_bytes(), mill());
        prop_assert!(findings.findings().is_empty(), "{:?}", findings);
        let moves: Vec<&Move> = operations.iter().filter_map(|operation| match &operation.kind {
            OperationKind::Move(step) => Some(step),
            _ => None,
        }).collect();
        prop_assert_eq!(moves.len(), 3);
        prop_assert!(moves.windows(2).all(|pair| pair[0].end == pair[1].start));
        let arc = moves[1].arc.expect("a rounding");
        prop_assert!((arc.sweep_rad.to_degrees() - turn).abs() < 1e-6, "{} of {}", arc.sweep_rad.to_degrees(), turn);
        for (end, direction) in [(moves[1].start, point(1.0, heading)), (moves[1].end, point(1.0, heading + turn))] {
            let spoke = [end[0] - arc.center[0], end[1] - arc.center[1]];
            prop_assert!((spoke[0].hypot(spoke[1]) - radius).abs() < 1e-9);
            prop_assert!((spoke[0] * direction[0] + spoke[1] * direction[1]).abs() < 1e-9);
        }
    }

    /// A corner that is too large is made when it is written as large as the cure says, and not where it is larger by a micrometre.
    #[test]
    fn the_largest_size_of_a_corner_fits(
        turn in 5.0..170.0_f64, size in 1.0..80.0_f64, rounds: bool, lengths in [1.0..20.0_f64, 1.0..20.0_f64], arc: bool,
    ) {
        let (sine, cosine) = turn.to_radians().sin_cos();
        let [x, end_x, end_y] = [lengths[0], lengths[0] + lengths[1] * cosine, lengths[1] * sine];
        let word = if rounds { 'R' } else { 'C' };
        let next = if arc { format!("G3 X{end_x} Y{end_y} R{}", lengths[1]) } else { format!("X{end_x} Y{end_y}") };
        let found = |size: f64| {
            let (_, findings) = interpret(format!("F100 G1 X{x} ,{word}{size}\n{next}\nM30").as_bytes(), mill());
            findings.findings().iter().find(|it| it.code == code::CORNER).map(|it| it.suggestions[0].message.clone())
        };
        let cure = found(size);
        prop_assume!(cure.is_some());
        let largest = cure.as_deref().and_then(|cure| cure.strip_prefix("write at most ")?.strip_suffix(" mm"));
        prop_assume!(largest.is_some());
        let largest: f64 = largest.unwrap_or_default().parse().expect("a number");
        prop_assert!(largest < size);
        prop_assert_eq!(found(largest), None);
        prop_assert!(arc || found(largest + 1e-3).is_some());
    }

    /// Each corner is waited for by one move at most, whatever the program, and no move is lost or torn.
    #[test]
    fn paths_with_corners_are_continuous(sizes in proptest::collection::vec((0..3_u8, 0.1..4.0_f64), 2..20)) {
        let mut program = "F100 G1 X10\n".to_owned();
        for (index, (kind, size)) in sizes.iter().enumerate() {
            let (word, place) = (if index % 2 == 0 { 'Y' } else { 'X' }, (index + 2) * 10);
            let corner = match kind {
                0 => String::new(),
                1 => format!(",R{size}"),
                _ => format!(",C{size}"),
            };
            program.push_str(&format!("{word}{place} {corner}\n"));
        }
        let (operations, findings) = interpret(format!("{program}X0\nM30").as_bytes(), mill());
        prop_assert!(findings.findings().iter().all(|finding| finding.code == code::CORNER), "{:?}", findings);
        prop_assume!(findings.findings().is_empty());
        let ends: Vec<_> = operations.iter().filter_map(|operation| match &operation.kind {
            OperationKind::Move(step) => Some((step.start, step.end)),
            _ => None,
        }).collect();
        prop_assert!(ends.windows(2).all(|pair| pair[0].1 == pair[1].0));
        prop_assert_eq!(ends.last().map(|(_, end)| end[0]), Some(0.0));
    }
}

#[test]
fn a_corner_before_the_end_of_a_compensation_is_refused_as_such() {
    let tool = ToolOffset::new(1).with_radius(3.0);
    let program = "G0 X-20 Y-20\nG41 D1 G1 X0 Y-10 F100\nY20\nX30 ,R5\nG40 Y50\nM30\n";
    let (_, findings) = Interpreter::new(mill()).with_tools(vec![tool]).read_all(program.as_bytes());
    let corners: Vec<_> = findings.findings().iter().filter(|it| it.code.name() == "PRG-CORNER").collect();
    assert!(matches!(&corners[..], [only] if only.message.contains("switches the radius compensation")), "{corners:?}");
}
