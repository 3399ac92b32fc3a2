//! Tool length compensation: `G43`, `G44`, `G49`. T1 is 100 mm long, T2 50 mm.

use super::*;

/// Where the machine's Z goes in each move.
fn machine_z(program: &str, settings: LanguageSettings) -> Vec<f64> {
    let interpreter = Interpreter::new(settings).with_tools(tools());
    let (operations, findings) = interpreter.read_all(program.as_bytes());
    assert!(!findings.has_errors(), "{:?}", findings.findings());
    let z = Axis::Z.index();
    let mut stands = None;
    let moves = operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Move(step) => {
            let [start, end] = [step.start[z], step.end[z]].map(|place| place + step.work_offset[z]);
            assert!(stands.is_none_or(|stands: f64| (stands - start).abs() < 1e-12), "{stands:?} {start}");
            stands = Some(end);
            Some(end)
        }
        _ => None,
    });
    moves.collect()
}

#[test]
fn the_length_is_between_the_control_point_and_the_tip() {
    let mut settings = mill();
    settings.work_offsets[0][Axis::Z.index()] = -300.0;
    settings.reference_position[Axis::Z.index()] = 10.0;
    // Machine Z = work Z + offset + length; G53 and G28 are machine positions whatever the length.
    let program =
        "G0 Z50\nG43 H1 Z50\nG1 Z-5 F100\nX10\nG53 G0 Z0\nX20\nG0 Z5\nG91 G28 Z0\nG90 G43 H2 Z5\nG44 Z5\nG49 Z5\n";
    let expected =
        [-250.0, -150.0, -205.0, -205.0, 0.0, 0.0, -195.0, -195.0, 10.0, -245.0, -345.0, -295.0].map(|z: f64| z);
    let found = machine_z(program, settings);
    // The return over the present place is no move.
    let expected: Vec<f64> = expected.into_iter().enumerate().filter(|(at, _)| *at != 7).map(|(_, z)| z).collect();
    assert_eq!(found, expected);
}

#[test]
fn switching_moves_nothing() {
    // The same place has other coordinates.
    check(
        &mill(),
        "G0 X1 Z200\nG43 H1\nX2\nZ95\nG90 G2 X3 Y1 R1 F10\nG49\nG0 X0",
        "rapid 0 -> X1 Z200
         rapid X1 Z100 -> X2 Z100
         rapid X2 Z100 -> X2 Z95
         arc X2 Z95 -> X3 Y1 Z95 about 3,0 by -90 @10/min
         rapid X3 Y1 Z195 -> Y1 Z195",
    );
}

#[test]
fn an_incremental_word_takes_the_change_of_the_length_along() {
    for (program, expected) in [
        ("G0 Z50\nG91 G43 H1 Z10\nZ1", vec![50.0, 160.0, 161.0]),
        ("G0 Z50\nG91 G43 H1 G1 Z10 F100", vec![50.0, 160.0]),
        ("G0 Z50\nG43 H1\nX1\nG91 Z-5\nZ-5\nG49\nX1\nZ-5", vec![50.0, 50.0, 145.0, 140.0, 140.0, 35.0]),
        // Changes add up, and what an absolute word has reached is due no more.
        ("G0 Z50\nG43 H1\nG43 H2\nG91 Z-5\nG90 G43 H1 Z0\nG91 Z-5", vec![50.0, 95.0, 100.0, 95.0]),
        ("G0 Z50\nG43 H1\nG49\nG91 Z-5", vec![50.0, 45.0]),
        // What the axis is named for moves it away.
        ("G0 Z50\nG43 H1\nG53 Z20\nG91 Z-5", vec![50.0, 20.0, 15.0]),
        ("G0 Z50\nG43 H1\nG91 G28 Z0\nZ-5", vec![50.0, 0.0, -5.0]),
    ] {
        assert_eq!(machine_z(program, mill()), expected, "{program}");
    }
    let mut haas = mill();
    haas.coordinates.style = crate::CoordinateStyle::Haas;
    let refused = "rapid 0 -> Z50\n! 2:12+3 PRG-LENGTH-INCREMENT";
    check(&haas, "G0 Z50\nG91 G43 H1 Z10", refused);
    check(&mill(), "G0 Z50\nG43 H1\nG91 G81 R-5 Z-5 F100 L0", "rapid 0 -> Z50\n! 3:1+23 PRG-LENGTH-INCREMENT");
}

#[test]
fn h_alone_names_another_length() {
    assert_eq!(machine_z("G43 H1 G0 Z50\nZ40 H2\nZ57 H0\nG43 H1 Z0", mill()), [150.0, 90.0, 57.0, 100.0]);
    assert_eq!(machine_z("G44 H1 G0 Z50\nH2\nZ40", mill()), [-50.0, -10.0]);
    check(&mill(), "H2", "! 1:1+2 PRG-WORD-UNUSED");
    check(&mill(), "G43 H1\nH99", "! 2:1+3 PRG-TOOL-LENGTH");
    check(&linuxcnc(), "G43 H1\nH2", "! 2:1+2 PRG-WORD-UNUSED");
}

#[test]
fn the_length_is_along_z_in_every_plane() {
    check(&mill(), "G18\nG43 H2\nG0 X5", "rapid Z-50 -> X5 Z-50");
    check(&mill(), "G19 G44 H2\nG0 X5", "rapid Z50 -> X5 Z50");
}

#[test]
fn contradictions_are_refused() {
    check(
        &mill(),
        "G43\nG44 H1.5\nG43 H99",
        "! 1:1+3 PRG-LENGTH-NUMBER\n! 2:5+4 PRG-NUMBER-NOT-WHOLE\n! 3:1+3 PRG-TOOL-LENGTH",
    );
    // The offset 0 is always 0.
    check(&mill(), "G43 H0\nG0 Z5", "rapid 0 -> Z5\nw 1:1+3 PRG-LENGTH-NONE");
    check(&mill(), "G43 H1\nG44 H0 G0 Z5", "rapid 0 -> Z5\nw 2:1+3 PRG-LENGTH-NONE");
    // H is modal while the compensation is on.
    check(&mill(), "G43 H1\nG43", "");
    // The offset 0 is none; another number contradicts G49, and LinuxCNC knows neither.
    check(&mill(), "G49 H0\nG43 H1\nG49 H0\nG49 H1", "! 4:5+2 PRG-WORD-UNUSED");
    check(&linuxcnc(), "G49 H0", "! 1:5+2 PRG-WORD-UNUSED");
    check(&mill(), "G43 H1\nG43.4 H1", "! 2:1+5 PRG-TOOL-CONTROL-NESTED");
    check(&mill(), "G43.4 H1\nG43 H1", "! 2:1+3 PRG-TOOL-CONTROL-NESTED");
    check(&mill(), "G43 G49 H1", "! 1:5+3 PRG-GROUP-CONFLICT");
    check(&mill(), "G43 H1\nG49\nG43.4 H1\nG49\nG49", "");
    check(&lathe(), "G43", "! 1:1+3 PRG-UNSUPPORTED-CODE");
}

#[test]
fn another_tool_and_cuts_are_pointed_out() {
    check(&mill(), "T2 M6\nG43 H1 G0 Z0", "tool 2.0\nrapid Z-100 -> 0\nw 2:5+2 PRG-LENGTH-OTHER-TOOL");
    check(&mill(), "T2 M6\nG43 H2 G0 Z0", "tool 2.0\nrapid Z-50 -> 0");
    // One that is still in force behind a tool change, once, and where the tip goes by it.
    check(
        &mill(),
        "T1 M6\nG43 H1 G0 Z0\nT2 M6\nX1\nG53 Z0\nZ5\nZ6",
        "tool 1.0\nrapid Z-100 -> 0\ntool 2.0\nrapid 0 -> X1\nrapid X1 -> X1 Z-100\nrapid X1 Z-100 -> X1 Z5\n\
         rapid X1 Z5 -> X1 Z6\nw 6:1+2 PRG-LENGTH-OTHER-TOOL",
    );
    // The machine is at home all the time.
    check(&mill(), "T1 M6\nG43 H1\nT2 M6\nG91 G28 Z0\nG90 G43 H2 G0 Z-50", "tool 1.0\ntool 2.0");
    check(&mill(), "G1 G43 H2 X1 F10", "line Z-50 -> X1 Z-50 @10/min\nw 1:4+3 PRG-LENGTH-WHILE-CUTTING");
    let returned = render("G1 X1. F10.\nG91 G28 Z0 G43 H2", &mill());
    assert!(!returned.contains("WHILE-CUTTING"), "the return is a rapid: {returned}");
    check(&mill(), "G1 F10\nG43 H2\nG44 H2 X1", "line Z50 -> X1 Z50 @10/min\nw 3:1+3 PRG-LENGTH-WHILE-CUTTING");
    check(&mill(), "G2 G43 H2 X1 Y1 R1 F10", "! 1:4+3 PRG-LENGTH-WHILE-CUTTING");
    check(&mill(), "G43 H2\nG2 G43 H2 X1 Y1 R1 F10", "arc Z-50 -> X1 Y1 Z-50 about 1,0 by -90 @10/min");
}
