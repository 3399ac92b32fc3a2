//! Tool offsets: `T` words of lathes, `G43` and its relatives, `M70` to `M73`.

use super::*;

fn turning() -> Vec<ToolOffset> {
    let row = |number, x, z, wear_x, wear_z| {
        let mut row = ToolOffset::new(number);
        let (mut geometry, mut wear) = (Position::default(), Position::default());
        [geometry[0], geometry[2]] = [x, z];
        [wear[0], wear[2]] = [wear_x, wear_z];
        (row.geometry, row.wear) = (Some(geometry), wear);
        row
    };
    vec![row(1, 10.0, 100.0, 0.5, -0.25), row(2, 20.0, 80.0, 0.0, 1.0), row(12, 30.0, 60.0, 0.0, 0.0)]
}

#[test]
fn t_words_of_lathes_bring_wear_and_geometry() {
    // No motion; the next words of the axes include the offset. X is a diameter.
    let program = "T0101\nG0 X40 Z5\nT0102\nX40\nZ5\nT0100\nX40 Z5";
    let expected = [[30.5, 0.0, 104.75], [40.0, 0.0, 104.75], [40.0, 0.0, 86.0], [20.0, 0.0, 5.0]];
    ends_with(&lathe(), &turning(), program, &expected);
    // A leading zero may be missing, but two digits name an offset on some controls and a tool on others.
    ends_with(&lathe(), &turning(), "T101\nG0 X0 Z0\nT200\nX0 Z0", &[[10.5, 0.0, 99.75], [0.0, 0.0, 0.0]]);
    for program in ["T2", "T02 G0 X0", "#1=2\nT#1"] {
        let found = run_with(&lathe(), &turning(), program).findings;
        let line = if program.starts_with('#') { 2 } else { 1 };
        assert_eq!(found, [format!("{line}:PRG-CODE-AMBIGUOUS")], "{program}");
    }
    ends_with(&lathe(), &[], "T2\nG0 X2", &[[1.0, 0.0, 0.0]]);
    ends_with(&lathe(), &turning(), "T0\nG0 X2 Z0", &[[1.0, 0.0, 0.0]]);
    let mut settings = lathe();
    settings.coordinates.two_digit_tools = true;
    ends_with(&settings, &turning(), "T12\nG0 X0 Z0", &[[30.0, 0.0, 60.0]]);
    // Geometry by the tool, wear by the offset.
    settings.coordinates.geometry_by_tool = true;
    ends_with(&settings, &turning(), "T0112\nG0 X0 Z0\nT0201\nZ0", &[[10.0, 0.0, 100.0], [10.0, 0.0, 79.75]]);
    assert_eq!(run_with(&lathe(), &turning(), "T0103").findings, ["1:PRG-OFFSET-UNKNOWN"]);
    // Where no tool is measured, nothing is shifted.
    ends_with(&lathe(), &[], "T0303\nG0 X2", &[[1.0, 0.0, 0.0]]);
}

#[test]
fn g43_of_linuxcnc_is_that_of_the_tool_along_all_axes() {
    let program = "T1 M6\nG43\nG0 X0 Z0\nT2 M6\nG43 H12 X0\nG43 Z0\nG49 X0 Z0";
    let expected = [[10.5, 0.0, 99.75], [30.0, 0.0, 99.75], [30.0, 0.0, 81.0], [0.0, 0.0, 0.0]];
    let run = run_with(&linuxcnc(), &turning(), program);
    // The length of another tool is pointed out.
    assert_eq!(run.findings, ["5:PRG-LENGTH-OTHER-TOOL"]);
    same(program, &run.moves.iter().map(|(_, end)| *end).collect::<Vec<_>>(), &expected);
    // Without a tool there is no length.
    ends(&linuxcnc(), "G43\nG0 Z5", &[[0.0, 0.0, 5.0]]);
    let words = "G43.1 X1 Z50\nG0 X0 Z0\nG43.1 Z20\nX1 Z0\nG43.2 H1\nX0 Z0\nG49\nZ0";
    let expected = [[1.0, 0.0, 50.0], [2.0, 0.0, 20.0], [1.0, 0.0, 120.0], [1.0, 0.0, 0.0]];
    let run = run_with(&linuxcnc(), &tools(), words);
    assert_eq!(run.findings, [""; 0]);
    same(words, &run.moves.iter().map(|(_, end)| *end).collect::<Vec<_>>(), &expected);
    resumes(&linuxcnc(), words);
    finds(&linuxcnc(), "G43.1\nG43.2\nG43.2 H77", &["1:PRG-COORD-WORD", "2:PRG-LENGTH-NUMBER", "3:PRG-OFFSET-UNKNOWN"]);
}

#[test]
fn a_tool_is_measured_in_a_turned_system() {
    let tool = |number: u32, x: f64, z: f64| {
        let mut tool = ToolOffset::new(number).with_length(z);
        tool.geometry.as_mut().expect("a length")[0] = x;
        tool
    };
    let tools = [tool(1, 2.0, 100.0), tool(3, 10.0, 40.0)];
    let (sine, cosine) = (0.5, 3.0_f64.sqrt() / 2.0);
    // As LinuxCNC 2.9 does it. The tip of T1 is 12, -1 from the origin of G59.3, which is turned by 30 degrees; along the axes of
    // that, T3 is 10·cos 30°, -5 before.
    let here = [12.0 * cosine - sine, -12.0 * sine - cosine];
    for (words, [x, y]) in [
        ("X5", [here[0] - 5.0, -5.0]),
        ("Y6", [10.0 * cosine, here[1] - 6.0]),
        ("X5 Y6", [here[0] - 5.0, here[1] - 6.0]),
    ] {
        let program =
            format!("G10 L2 P9 X10 Y4 Z5 R30\nG54 G43 H1\nG0 X20 Y3 Z10\nG10 L11 P3 {words}\nG43 H3\nG0 X0 Y0 Z0");
        let measured = [x * cosine - y * sine, x * sine + y * cosine, 40.0];
        ends_with(&linuxcnc(), &tools, &program, &[[22.0, 3.0, 110.0], measured]);
    }
}

#[test]
fn g43_without_h() {
    finds(&mill(), "T1 M6\nG43 G0 Z10", &["2:PRG-LENGTH-NUMBER"]);
    let mut settings = haas();
    settings.coordinates.length_of_tool = true;
    ends(&settings, "T1 M6\nG43 G0 Z0", &[[0.0, 0.0, 100.0]]);
}

#[test]
fn modes_are_saved_with_their_offsets() {
    let program = "G10 L2 P2 X100\nG7 G55 T1 M6 G43\nM70\nG8 G54 G49\nG0 X4 Z0\nM72\nX4 Z0";
    ends(&linuxcnc(), program, &[[4.0, 0.0, 0.0], [102.0, 0.0, 100.0]]);
    resumes(&linuxcnc(), program);
}

#[test]
fn m73_restores_at_the_return() {
    let program = "G10 L2 P2 X100\no1 sub\nM73\nG55 G91 G20\nG0 X1\no1 endsub\no1 call\nG0 X5\no1 call\nX6";
    ends(&linuxcnc(), program, &[[25.4, 0.0, 0.0], [5.0, 0.0, 0.0], [30.4, 0.0, 0.0], [6.0, 0.0, 0.0]]);
    resumes(&linuxcnc(), program);
}

#[test]
fn an_incremental_word_behind_another_offset_is_refused() {
    let mut row = ToolOffset::new(1);
    row.geometry = Some(Position::default());
    row.wear[Axis::X.index()] = 0.2;
    let run = |program| run_with(&lathe(), std::slice::from_ref(&row), program).findings;
    assert_eq!(run("G0 X50 Z5\nT0101\nU2 W-1"), ["3:PRG-LENGTH-INCREMENT"]);
    // Z has no offset; X is named before, or goes home whatever its offset is.
    for program in ["T0101\nG0 W-1", "T0101\nG0 X50\nU2", "T0101\nG28 U0 W0", "G0 X50\nT0101\nT0100\nU2"] {
        assert_eq!(run(program), [""; 0], "{program}");
    }
}

/// Programs and positions are those of its interpreter.
#[test]
fn modes_are_restored_by_their_codes_in_linuxcnc() {
    let shifts = "o1 sub\nM73\nG92 X20\nX21\no1 endsub\nG0 X1\nM70\nG92 X5\nX6\nM72\nX7\nG92 X10\nM70\nG92.2\nX8\nM72\nX9\n\
                  M70\nG92.1\nX3\nM72\nX4\nM70\nG52 X2\nM72\nX5\nG92.1\no1 call\nX22";
    let expected = [1.0, 2.0, 7.0, 8.0, 6.0, 3.0, 4.0, 7.0, 8.0, 22.0].map(|x| [x, 0.0, 0.0]);
    ends(&linuxcnc(), shifts, &expected);
    resumes(&linuxcnc(), shifts);
    // G43 is the tool in the spindle as the table has it, and leaves alone any offset that is in force.
    let lengths = "T1 M6\nG43\nG0 Z1\nM70\nG49\nZ2\nM72\nZ3\nG49\nM70\nG43 H2\nZ4\nM72\nZ5\nG43.1 Z7\nM70\nG43 H1\nZ6\nM72\n\
                   Z7\nG43 H1\nM70\nG43 H2\nZ8\nM72\nZ9\nG43 H1\nM70\nG10 L1 P1 Z110\nG49\nZ10\nM72\nZ11";
    let run = run_with(&linuxcnc(), &tools(), lengths);
    assert_eq!(run.findings, ["11:PRG-LENGTH-OTHER-TOOL", "23:PRG-LENGTH-OTHER-TOOL"]);
    let expected = [101.0, 2.0, 103.0, 54.0, 5.0, 106.0, 107.0, 58.0, 59.0, 10.0, 121.0].map(|z| [0.0, 0.0, z]);
    same(lengths, &run.moves.iter().map(|(_, end)| *end).collect::<Vec<_>>(), &expected);
}

/// `G96` comes back without its clamp, and leaves alone the one in force.
#[test]
fn the_clamp_of_g96_is_not_restored_in_linuxcnc() {
    check(
        &linuxcnc(),
        "G96 D2000 S100 M3\nM70\nG97 S300\nM72",
        "spindle cw 100 m/min max 2000\nspindle cw 300\nspindle cw 100 m/min max inf\nw 4:1+3 PRG-SPEED-CLAMP-MISSING",
    );
    check(
        &linuxcnc(),
        "G96 D2000 S100 M3\nM70\nG96 D1500 S80\nM72",
        "spindle cw 100 m/min max 2000\nspindle cw 80 m/min max 1500\nspindle cw 100 m/min max 1500",
    );
}

#[test]
fn another_unit_under_an_offset_is_told_in_linuxcnc() {
    finds(&linuxcnc(), "G43.1 Z10\nG21\nG20", &["3:PRG-LENGTH-UNIT"]);
    finds(&linuxcnc(), "G43.1 Z10\nG49\nG20", &[]);
    finds(&mill(), "G43 H1\nG20", &[]);
}

/// With `geometry_by_tool` radius and tip are of the tool's row, the wear of the radius of the offset's.
#[test]
fn the_nose_is_of_the_row_of_the_geometry() {
    let mut settings = lathe();
    settings.coordinates.geometry_by_tool = true;
    let nose = |number, tip, radius| {
        let geometry = Some(Position::default());
        ToolOffset { tip, geometry, ..ToolOffset::new(number) }.with_radius(radius)
    };
    let (tool, other) = (nose(1, 3, 0.8), nose(11, 2, 0.4));
    let cuts = |rows: &[ToolOffset], word: &str| {
        let run = run_with(
            &settings,
            rows,
            &format!("G97 S500 M3\n{word}\nG0 X30 Z10\nG42 G1 X20 Z5 F0.1\nZ-10\nX40\nG40 G0 X80 Z0"),
        );
        assert_eq!(run.findings, [""; 0]);
        run.moves
    };
    assert_eq!(cuts(&[tool, other], "T0111"), cuts(&[tool], "T0101"));
    let wear = ToolOffset { radius_wear_mm: -0.1, ..ToolOffset::new(11) };
    assert_eq!(cuts(&[tool, wear], "T0111"), cuts(&[nose(1, 3, 0.8 - 0.1)], "T0101"));
    let unknown = run_with(&settings, &[wear], "G97 S500 M3\nT0111\nG42 G1 X20 F0.1").findings;
    assert_eq!(unknown, ["3:PRG-COMP-NUMBER"]);
}

/// Of the rows that a `T` word names, one is in force with its geometry and one with its wear.
#[test]
fn what_is_not_in_force_of_a_row_may_be_changed() {
    let mut settings = lathe();
    settings.coordinates.geometry_by_tool = true;
    let rows = [1, 11].map(|number| ToolOffset::new(number).with_length(50.0));
    for (change, is_refused) in [
        ("G10 P1 X1", false),
        ("#2001=1", false),
        ("G10 P10011 X1", false),
        ("#2711=1", false),
        ("G10 P11 R1", false),
        ("G10 P11 X1", true),
        ("#2011=1", true),
        ("G10 P10001 Z1", true),
        ("#2801=1", true),
    ] {
        let expected: &[&str] = if is_refused { &["2:PRG-OFFSET-IN-FORCE"] } else { &[] };
        assert_eq!(run_with(&settings, &rows, &format!("T0111\n{change}")).findings, expected, "{change}");
    }
    // The length of the tip that is led.
    for change in ["G10 L10 P1 R105", "#11001=105", "#10001=1"] {
        let program = format!("G43.4 H1\nG0 X0 Y0 Z50 A0 C0\n{change}");
        assert_eq!(run_with(&mill(), &tools(), &program).findings, ["3:PRG-OFFSET-IN-FORCE"], "{change}");
    }
}

/// Numbers that mean one thing on FANUC and another on Haas controls.
#[test]
fn tool_offsets_of_haas_controls_as_variables() {
    let haas = |mut settings: LanguageSettings| {
        settings.coordinates.style = crate::CoordinateStyle::Haas;
        settings
    };
    let rows = [ToolOffset::new(5).with_length(105.0)];
    // Geometry from #2001 and wear from #2201 on.
    let program = "T5 M6\n#2005=100.\n#2205=.5\nG43 H5 G0 Z10.";
    ends_with(&haas(mill()), &rows, program, &[[0.0, 0.0, 110.5]]);
    finds(&haas(mill()), "#10005=.5", &["1:PRG-PARAMETER-READ-ONLY"]);
    finds(&haas(mill()), "#1=#10500", &["1:PRG-PARAMETER-UNAVAILABLE"]);
    finds(&haas(mill()), "#13005=3.", &["1:PRG-PARAMETER-READ-ONLY"]);
    finds(&haas(mill()), "#1=#2405", &["1:PRG-PARAMETER-UNAVAILABLE"]);
    finds(&haas(lathe()), "#2001=.2", &["1:PRG-PARAMETER-READ-ONLY"]);
    finds(&haas(lathe()), "#1=#2701", &["1:PRG-PARAMETER-UNAVAILABLE"]);
}

/// Older Haas mills cancel the length with `G28`: who calls it again is right on all of them.
#[test]
fn a_return_leaves_the_length_of_haas_mills_unclear() {
    let mut haas = mill();
    haas.coordinates.style = crate::CoordinateStyle::Haas;
    let returned = "G43 H1 G0 Z10\nG91 G28 Z0\nG90 X5\n";
    finds(&haas, &format!("{returned}Z10\nZ20"), &["4:PRG-LENGTH-RETURN"]);
    finds(&haas, &format!("{returned}G81 Z-160 R-150 F100"), &["4:PRG-LENGTH-RETURN"]);
    finds(&haas, "G43 H1 G0 Z10\nG28\nZ10", &["3:PRG-LENGTH-RETURN"]);
    for cured in ["G43 H1 Z10", "G43 H1\nZ10", "G49\nZ10", "G53 Z0", "G91 G28 Z0", "G91 Z-5\nG90 G43 H1 Z10"] {
        finds(&haas, &format!("{returned}{cured}"), &[]);
    }
    finds(&mill(), &format!("{returned}Z10"), &[]);
    let program = "G44 H1 G0 Z10\nG91 G28 Z0\nG90 Z10\nM30\n";
    let interpreter = Interpreter::new(haas).with_tools(tools());
    let findings = interpreter.read_all(program.as_bytes()).1.into_findings();
    assert!(findings[0].suggestions[0].message.contains("G44 H1"), "{findings:?}");
}
