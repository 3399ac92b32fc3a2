//! `G10`, offsets as system variables, and what is skipped.

use super::*;

#[test]
fn g10_l2_of_fanuc_sets_or_adds() {
    let program = "G10 L2 P1 X10\nG0 X1\nG91 G10 L2 P1 X5\nG90 X1\nG10 L2 P0 Y2\nY1\nG10 L2 P2 X-7\nG55 X1";
    ends(&mill(), program, &[[11.0, 0.0, 0.0], [16.0, 0.0, 0.0], [16.0, 3.0, 0.0], [-6.0, 3.0, 0.0]]);
    resumes(&mill(), program);
    // Inches, and diameters on a lathe.
    ends(&mill(), "G20 G10 L2 P1 X1\nG0 X1", &[[50.8, 0.0, 0.0]]);
    ends_with(&lathe(), &[], "G10 L2 P1 X10 Z3\nG0 X4 Z1\nG10 L2 P1 U2\nX4", &[[7.0, 0.0, 4.0], [8.0, 0.0, 4.0]]);
    finds(
        &mill(),
        "G10 L2 P7 X1\nG10 L2 X1\nG10 L2 P1\nG10 L99 P1\nG11",
        &["1:PRG-COORD-WORD", "2:PRG-COORD-WORD", "3:PRG-COORD-WORD", "4:PRG-COORD-WORD", "5:PRG-COORD-WORD"],
    );
}

#[test]
fn g10_l2_of_linuxcnc_only_sets_and_l20_reads_the_present_place() {
    ends(&linuxcnc(), "G91 G10 L2 P0 X10\nG10 L2 P0 X10\nG90 G0 X1", &[[11.0, 0.0, 0.0]]);
    // With a shift and a tool: what reads 7 now is 7 afterwards.
    let program = "G92 X3\nT1 M6 G43\nG0 X20 Z5\nG10 L20 P1 X7 Z0\nX8 Z1\nG10 L20 P2 X100\nG55 X100";
    let run = run_with(&linuxcnc(), &tools(), program);
    assert_eq!(run.findings, [""; 0]);
    let found: Vec<_> = run.moves.iter().map(|(_, end)| *end).collect();
    // The shift is -3; Z is at 105 of the machine.
    same(program, &found, &[[17.0, 0.0, 105.0], [18.0, 0.0, 106.0]]);
    resumes(&linuxcnc(), program);
    // In a rotated system as well.
    let rotated = "G10 L2 P1 X100 Y50 R90\nG0 X10 Y20\nG10 L20 P1 X0 Y0\nX1 Y0";
    ends(&linuxcnc(), rotated, &[[80.0, 60.0, 0.0], [80.0, 61.0, 0.0]]);
    finds(&linuxcnc(), "G10 L20 P1 X0 R5", &["1:PRG-WORD-CONFLICT"]);
}

#[test]
fn g10_sets_tool_offsets_of_mills() {
    // Geometry and wear of H, radius and its wear of D.
    let program = "G10 L10 P20 R50\nG10 L11 P20 R-1\nG43 H20 G0 Z0\nG49\nG91 G10 L11 P20 R-1\nG90 G43 H20 Z0";
    ends(&mill(), program, &[[0.0, 0.0, 49.0], [0.0, 0.0, 48.0]]);
    resumes(&mill(), program);
    let cut = "G0 X10 Y20\nG10 L12 P21 R4\nG10 L13 P21 R-1\nG41 D21 G1 Y0 F100\nX20\nG40 Y20";
    ends(&mill(), cut, &[[10.0, 20.0, 0.0], [10.0, 3.0, 0.0], [20.0, 3.0, 0.0], [20.0, 20.0, 0.0]]);
    ends(&mill(), "G20\nG10 L10 P20 R2\nG43 H20 G0 Z0", &[[0.0, 0.0, 50.8]]);
    ends(&mill(), "G10 L1 P30 R7\nG43 H30 G0 Z0", &[[0.0, 0.0, 7.0]]);
    finds(
        &mill(),
        "G10 L1 P1 R7\nG91 G10 L10 P30 R1\nG10 L10 P30\nG43 H1\nG10 L11 P1 R1",
        &["1:PRG-COORD-AMBIGUOUS", "2:PRG-OFFSET-UNKNOWN", "3:PRG-COORD-WORD", "5:PRG-OFFSET-IN-FORCE"],
    );
}

#[test]
fn g10_sets_tool_offsets_of_lathes() {
    let rows = vec![ToolOffset::new(1).with_length(100.0)];
    // Geometry 10001, wear 1; W adds. X is a diameter.
    let program =
        "G10 P10001 X20 Z80 R0.8 Q3\nG10 P1 X-0.1 Z0.5\nG10 P1 W0.25\nT0101\nG0 X50 Z0\nT0100\nG10 P0 Z-4\nZ0";
    ends_with(&lathe(), &rows, program, &[[34.95, 0.0, 80.75], [34.95, 0.0, -4.0]]);
    resumes(&lathe(), program);
    // The shift of the frame adds.
    ends_with(&lathe(), &[], "G10 P0 X2\nG10 P0 U2\nG0 X10", &[[7.0, 0.0, 0.0]]);
    // Haas: L10 geometry, L11 wear.
    ends_with(&lathe(), &rows, "G10 L10 P1 Z60\nG10 L11 P1 Z1\nT101\nG0 Z0", &[[0.0, 0.0, 61.0]]);
    let refused = run_with(&lathe(), &rows, "T0101\nG10 P1 X1\nG10 P1500 X1\nG10 P10002 U1");
    assert_eq!(refused.findings, ["2:PRG-OFFSET-IN-FORCE", "3:PRG-COORD-WORD", "4:PRG-OFFSET-UNKNOWN"]);
}

#[test]
fn g10_sets_the_table_of_linuxcnc() {
    // L1 as written, in force with the next G43; L10 and L11 so that the present place reads the value.
    let program = "G10 L1 P1 Z50 X2\nT1 M6 G43\nG0 X0 Z0\nG10 L1 P1 Z60\nZ1\nG43\nZ0";
    ends(&linuxcnc(), program, &[[2.0, 0.0, 50.0], [2.0, 0.0, 51.0], [2.0, 0.0, 60.0]]);
    resumes(&linuxcnc(), program);
    ends(
        &linuxcnc(),
        "G10 L2 P1 Z-5\nG92 Z-1\nG0 Z20\nG10 L10 P1 Z0\nT1 M6 G43\nG0 Z1",
        &[[0.0, 0.0, 21.0], [0.0, 0.0, 22.0]],
    );
    ends(
        &linuxcnc(),
        "G10 L2 P9 Z-5\nG92 Z3\nG0 Z20\nG10 L11 P1 Z0\nG92.1 T1 M6 G43 G59.3\nG0 Z1",
        &[[0.0, 0.0, 17.0], [0.0, 0.0, 18.0]],
    );
    finds(
        &linuxcnc(),
        "G10 L1 P77 Z1\nG10 L5 P1\nG10 P1 X1",
        &["1:PRG-OFFSET-UNKNOWN", "2:PRG-COORD-WORD", "3:PRG-COORD-WORD"],
    );
}

#[test]
fn data_up_to_g11_is_skipped() {
    let program = "G10 L50\nN1020 P1 R88\nN1021 R5\nG11\nG0 X1";
    let run = run_with(&mill(), &[], program);
    assert_eq!((run.findings, run.moves.len()), (vec!["1:PRG-DATA-SKIPPED".to_owned()], 1));
    resumes(&mill(), program);
    finds(&mill(), "G10 L3\nP1 L300\nT1 H1", &["1:PRG-DATA-SKIPPED", "4:PRG-DATA-OPEN"]);
}

#[test]
fn assigning_an_offset_acts_like_g10_from_the_next_block_on() {
    let program = "#5221=10\nG0 X1\n#5241=[#5221+5]\nG55 X1\n#7001=40\nG54.1 P1 X1\n#14001=50\nX1\n#5203=2\nZ1";
    ends(&mill(), program, &[[11.0, 0.0, 0.0], [16.0, 0.0, 0.0], [41.0, 0.0, 0.0], [51.0, 0.0, 0.0], [51.0, 0.0, 3.0]]);
    resumes(&mill(), program);
    ends(&mill(), "#11020=50\n#10020=-1\nG43 H20 G0 Z#11020", &[[0.0, 0.0, 99.0]]);
    ends(&mill(), "G20\n#5221=1\nG0 X#5221", &[[50.8, 0.0, 0.0]]);
    let rows = vec![ToolOffset::new(1).with_length(100.0)];
    ends_with(&lathe(), &rows, "#2701=20\n#2801=70\n#2001=1\nT0101\nG0 X0 Z0", &[[10.5, 0.0, 70.0]]);
    // The words of its own line are read before.
    ends(&linuxcnc(), "#5241=10 G55 G0 X1\nG54\nG55 X1", &[[1.0, 0.0, 0.0], [11.0, 0.0, 0.0]]);
    ends(
        &linuxcnc(),
        "#5241=10 #5250=90\nG55 G0 X1 Y0\n#5161=3\nG28 Y0\nG0 X#5250",
        &[[10.0, 1.0, 0.0], [3.0, 1.0, 0.0], [3.0, 90.0, 0.0]],
    );
    finds(&mill(), "G43 H1\n#11001=5\nG0 X1", &["2:PRG-OFFSET-IN-FORCE"]);
    finds(&linuxcnc(), "#5220=2", &["1:PRG-PARAMETER-READ-ONLY"]);
}
