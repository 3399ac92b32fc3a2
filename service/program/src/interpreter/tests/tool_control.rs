//! Tool centre point control: `G43.4`, `G43.5`, `G49`, and the switches of thinning.

use super::*;

#[test]
fn angles_and_thinning_as_on_the_page() {
    // X Y Z are places of the tool from G43.4 on: what no word has placed since is held (~).
    check(
        &mill(),
        "G0 X1 A5\nG43.4 H7 G0 Z100\nX10 Y20\nM33\nG1 X10. Y20. Z30. A30. C45. F200\nX11\nX12 F300\nX13 M8\nM34\nX14",
        "rapid 0 -> X1 A5
         guided angles H7 rapid -> X1 Z100 A5 ~XY
         guided angles H7 rapid -> X10 Y20 Z100 A5
         Thinning on
         guided angles H7 cut -> X10 Y20 Z30 A30 C45 @200/min pure
         guided angles H7 cut -> X11 Y20 Z30 A30 C45 @200/min pure
         guided angles H7 cut -> X12 Y20 Z30 A30 C45 @300/min pure
         coolant mist false flood true
         guided angles H7 cut -> X13 Y20 Z30 A30 C45 @300/min
         Thinning off
         guided angles H7 cut -> X14 Y20 Z30 A30 C45 @300/min pure",
    );
    // P is the other switch; switching twice changes nothing.
    check(&mill(), "G43.4 H1 P1\nM33\nG43.4 P0\nM34\nG43.4 P1\nG49", &"Thinning on\nThinning off\n".repeat(2));
    // The codes are the profile's.
    let settings = LanguageSettings { thinning: Some(crate::FunctionCodes { on: 133.0, off: 134.0 }), ..mill() };
    check(&settings, "G43.4 H1\nM133\nM134\nM33", "Thinning on\nThinning off\nM33 None\ni 4:1+3 PRG-MACHINE-CODE");
}

#[test]
fn vectors_are_normalised() {
    check(
        &mill(),
        "G43.5 H2\nG1 X10. Y20. Z30. I0.1 J0.6 K0.3 F100\nX11 K-5\nX12\nG93 X13 F2\nG0 I.000001",
        "guided vector - 0.147442,0.884652,0.442326 H2 cut -> X10 Y20 Z30 @100/min pure
         guided vector 0.147442,0.884652,0.442326 0,0,-1 H2 cut -> X11 Y20 Z30 @100/min pure
         guided vector 0,0,-1 0,0,-1 H2 cut -> X12 Y20 Z30 @100/min pure
         guided vector 0,0,-1 0,0,-1 H2 cut -> X13 Y20 Z30 @1/2
         guided vector 0,0,-1 1,0,0 H2 rapid -> X13 Y20 Z30",
    );
    // An angle is one mistake, also beside the vector.
    check(&mill(), "G43.5 H2\nX1 Y1 Z1 F100 A30 I0 J0 K1 G1", "! 2:15+3 PRG-TOOL-DIRECTION");
    check(
        &mill(),
        "G43.5 H2\nG1 X1 Y1 Z1 F100 I0 J0 K0\nX2 A30\nX3 G43.5 H2",
        "! 2:1+25 PRG-TOOL-DIRECTION\n! 3:4+3 PRG-TOOL-DIRECTION\n! 4:4+5 PRG-TOOL-CONTROL-NESTED",
    );
}

#[test]
fn plain_motion_returns_axis_by_axis() {
    // After G49 an axis that is not named stays where the machine has it, even at the number that it had before.
    check(
        &mill(),
        "G43.4 H1 G0 X1 Y2 Z3 A4\nG49\nG91 G28 Z0\nG90 G53 G0 X0\nG0 Y2\nX5",
        "guided angles H1 rapid -> X1 Y2 Z3 A4
         guided axes H0 rapid -> X1 Y2 Z3 A4 ~XYZ
         guided axes H0 rapid -> X1 Y2 A4 ~XY
         guided axes H0 rapid -> Y2 A4 ~Y
         guided axes H0 rapid -> Y2 A4
         rapid Y2 A4 -> X5 Y2 A4",
    );
    // Vectors leave the angles unknown too.
    check(&mill(), "G43.5 H1\nG49\nG0 X1 Y1 Z1", "guided axes H0 rapid -> X1 Y1 Z1 ~ABC");
    check(
        &mill(),
        "G43.4 H1\nG49\nG91 G0 X5\nG90 G2 X1 Y1 R5 F100\nG0 X1 Y1 Z1\nG2 X2 Y2 R5",
        "guided axes H0 rapid -> X1 Y1 Z1
         arc X1 Y1 Z1 -> X2 Y2 Z1 about 5,-2 by -16.260205 @100/min
         ! 3:8+2 PRG-TOOL-CONTROL-HELD
         ! 4:1+20 PRG-TOOL-CONTROL-HELD",
    );
    // Rotary axes may rest where vectors have left them.
    check(
        &mill(),
        "G43.5 H1\nG49\nG0 X1 Y1 Z1\nG2 X2 Y2 R5 F100",
        "guided axes H0 rapid -> X1 Y1 Z1 ~ABC
         guided axes H0 cut -> X2 Y2 Z1 ~ABC about 5,-2 by -16.260205 @100/min",
    );
}

#[test]
fn contradictions_are_refused() {
    let refused = |program: &str, finding: &str| {
        let program = format!("G43.4 H1\nG0 X1 Y1 Z1\n{program}");
        check(&mill(), &program, &format!("guided angles H1 rapid -> X1 Y1 Z1\n{finding}"));
    };
    refused("G43.4 H1", "! 3:1+5 PRG-TOOL-CONTROL-NESTED");
    refused("G43.5 H2", "! 3:1+5 PRG-TOOL-CONTROL-NESTED");
    refused("G5.1 X2 Y2 Z5 I1 J1 F100", "! 3:12+2 PRG-SPLINE-AXIS");
    refused("G28 Z0", "! 3:1+3 PRG-TOOL-CONTROL-BLOCK");
    refused("G53 G0 Z0", "! 3:1+3 PRG-TOOL-CONTROL-BLOCK");
    refused("G55", "! 3:1+3 PRG-TOOL-CONTROL-BLOCK");
    refused("G54", "");
    refused("T2 M6", "! 3:4+2 PRG-TOOL-CONTROL-BLOCK");
    refused("G1 X5 I1 F100", "! 3:7+2 PRG-TOOL-DIRECTION");
    refused("G43.4 P2", "! 3:7+2 PRG-WORD-CONFLICT");
    refused("G1 X2", "! 3:1+5 PRG-FEED-MISSING");
    check(
        &mill(),
        "G43.4\nG43.5 H0\nG43.4 H1.5",
        "! 1:1+5 PRG-TOOL-CONTROL-LENGTH\n! 2:1+5 PRG-TOOL-CONTROL-LENGTH\n! 3:7+4 PRG-NUMBER-NOT-WHOLE",
    );
    check(&mill(), "M33\nM34", "! 1:1+3 PRG-TOOL-CONTROL-OFF");
    check(&lathe(), "G43.4", "! 1:1+5 PRG-UNSUPPORTED-CODE");
}

#[test]
fn curves_of_the_tool_centre_point() {
    // Centres under G43.4; the rotary axes turn on the way, and such a block is never thinned out.
    check(
        &mill(),
        "G43.4 H1\nG0 X0 Y0 Z5 A0 C0\nG2 X2 I1 A10 F100\nG3 I-1 C-20\nG18 G2 X4 R1 Z5\nG17 G5.1 X6 Y2 I1 J0 A5\nG5.1 Q1\nG1 X7",
        "guided angles H1 rapid -> Z5
         guided angles H1 cut -> X2 Z5 A10 about 1,0 by -180 @100/min
         guided angles H1 cut -> X2 Z5 A10 C-20 about 1,0 by 360 @100/min
         guided angles H1 cut -> X4 Z5 A10 C-20 about 5,3 by -180 @100/min
         guided angles H1 cut -> X6 Y2 Z5 A5 C-20 spline order 3 4,0 5,0 6,2 @100/min
         guided angles H1 cut -> X7 Y2 Z5 A5 C-20 @100/min pure",
    );
    check(
        &mill(),
        "G43.4 H1\nG0 X0 Y0 Z5\nF100\nG5.2 X1 Y1\nX2 Y0\nG5.3\nG5 X4 Y0 I1 J1 P-1 Q1",
        "guided angles H1 rapid -> Z5
         guided angles H1 cut -> X2 Z5 spline order 3 0,0 1,1 2,0 @100/min
         guided angles H1 cut -> X4 Z5 spline order 4 2,0 3,1 3,1 4,0 @100/min",
    );
    // Under G43.5 I J K are the direction at the end of the arc, and R says which circle it is.
    check(
        &mill(),
        "G43.5 H1\nG0 X0 Y0 Z5 I0 J0 K1\nG3 X2 R1 I0 J3 K4 F100\nX0 R-1",
        "guided vector - 0,0,1 H1 rapid -> Z5
         guided vector 0,0,1 0,0.6,0.8 H1 cut -> X2 Z5 about 1,0 by 180 @100/min
         guided vector 0,0.6,0.8 0,0.6,0.8 H1 cut -> Z5 about 1,0 by 180 @100/min",
    );
    let refused = |program: &str, finding: &str| {
        let program = format!("G43.5 H1\nG0 X0 Y0 Z5 I0 J0 K1\nF100\n{program}");
        check(&mill(), &program, &format!("guided vector - 0,0,1 H1 rapid -> Z5\n{finding}"));
    };
    refused("G3 X2 I1 J0 K0", "! 4:1+14 PRG-ARC-CENTRE-MISSING");
    refused("G3 X2 R1 A30", "! 4:10+3 PRG-TOOL-DIRECTION");
    refused("G3 R1 I1", "! 4:4+2 PRG-ARC-FULL-BY-RADIUS");
    refused("G5.1 X2 Y2 I1 J1", "! 4:1+16 PRG-TOOL-CONTROL-BLOCK");
    refused(
        "G5.2 X2 Y2\nG1 X5",
        "guided vector 0,0,1 0,0,1 H1 cut -> X5 Y2 Z5 @100/min pure\n! 4:1+10 PRG-TOOL-CONTROL-BLOCK",
    );
    check(&mill(), "G43.4 H1\nG2 X1 Y1 R1 F10", "! 2:1+15 PRG-TOOL-CONTROL-HELD");
    check(&mill(), "G43.4 H1\nF10\nG5.2 X1 Y1", "! 3:1+10 PRG-TOOL-CONTROL-HELD");
}

#[test]
fn a_wrong_switch_of_thinning_is_cured() {
    let (_, findings) = Interpreter::new(mill()).with_tools(tools()).read_all(b"G43.4 H1 P2\nM30\n");
    let [finding] = findings.findings() else { panic!("{findings:?}") };
    assert_eq!(finding.values[0].value, 2.0);
    let cures: Vec<_> = finding.suggestions.iter().filter_map(|it| it.replacement.as_deref()).collect();
    assert_eq!(cures, ["P1", "P0"]);
}

#[test]
fn a_restored_interpreter_goes_on_alike() {
    let program = "G43.5 H1 P1\nG1 X1 Y1 Z1 I0 J1 K1 F10\nX2\nG49\nG0 X3\nY1 Z1 A0 B0 C0\nX4\nM30\n";
    let (expected, _) = Interpreter::new(mill()).with_tools(tools()).read_all(program.as_bytes());
    let mut state = Interpreter::new(mill()).state().clone();
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    for line in program.split_inclusive('\n') {
        let mut interpreter = Interpreter::restore(mill(), state).with_tools(tools());
        interpreter.read_line(line.as_bytes(), false, &mut operations, &mut findings);
        state = interpreter.state().clone();
    }
    assert_eq!(operations, expected);
    assert!(!findings.has_errors());
}
