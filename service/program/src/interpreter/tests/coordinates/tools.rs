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
    // A leading zero may be missing; two digits name a tool only.
    ends_with(&lathe(), &turning(), "T101\nG0 X0 Z0\nT2\nX0 Z0", &[[10.5, 0.0, 99.75], [0.0, 0.0, 0.0]]);
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
