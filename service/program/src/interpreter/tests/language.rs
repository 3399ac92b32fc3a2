//! What each code and word does.

use super::*;
use crate::{DecimalPointRule, DwellUnit, FunctionCodes, XWord};

#[test]
fn vibrating_turning_program_of_the_path_vibration_page() {
    check(
        &lathe(),
        "M3 S1000;                 spindle on
G200 F50 A0.03;           vibration on: F = frequency in Hz, A = amplitude in mm
G01 X10.0 Z20.0 F0.01;    line
G02 X14.0 Z23.5 R4.0;     clockwise arc
G201;                     vibration off",
        "spindle cw 1000
         PathVibration on F50 A0.03
         line 0 -> X5 Z20 @0.01/rev
         arc X5 Z20 -> X7 Z23.5 about 23.464194,3.00016 by -60.515539 @0.01/rev
         PathVibration off",
    );
}

#[test]
fn dense_lower_case_and_labels() {
    check(
        &mill(),
        "%\nO1234 (part)\nN10 g0x1.y-2z+.5\nN20G1X1.5F100.;end\nN30 X2.",
        "rapid 0 -> X1 Y-2 Z0.5
         line X1 Y-2 Z0.5 -> X1.5 Y-2 Z0.5 @100/min
         line X1.5 Y-2 Z0.5 -> X2 Y-2 Z0.5 @100/min",
    );
    check(&mill(), ":1234\nG0 X1", "rapid 0 -> X1");
    check(&mill(), "O1\nG0 X1\nO2\nX2", "rapid 0 -> X1\nw 3:1+2 PRG-NO-END");
}

#[test]
fn a_post_s_safety_line_states_what_is_so() {
    check(&mill(), "G0 G15 G17 G21 G40 G49 G50 G67 G69 G80 G90 G94 G97 G98\nX1", "rapid 0 -> X1");
    check(&lathe(), "G18 G21 G40 G80 G97 G99\nG0 X1", "rapid 0 -> X0.5");
}

#[test]
fn block_delete() {
    let program = "/G0 X1\nN5 /2 G0 X2\nG0 X3\n/M30";
    check(&mill(), program, "rapid 0 -> X1\nrapid X1 -> X2\nrapid X2 -> X3\nend");
    let settings = LanguageSettings { block_delete: true, ..mill() };
    check(&settings, program, "rapid 0 -> X3\nend\nw 4:5+0 PRG-NO-END");
    check(&mill(), "G0 / X1", "! 1:4+1 PRG-CHARACTER");
}

#[test]
fn diameters_radii_and_incremental_words() {
    check(
        &lathe(),
        "G0 X20. Z5.\nU2. W-1.\nX20. W1.",
        "rapid 0 -> X10 Z5\nrapid X10 Z5 -> X11 Z4\nrapid X11 Z4 -> X10 Z5",
    );
    check(
        &lathe(),
        "G0 X20. Z5.\nG91 X2. Z1.\nG90 X20.",
        "rapid 0 -> X10 Z5\nrapid X10 Z5 -> X11 Z6\nrapid X11 Z6 -> X10 Z6",
    );
    let radius = LanguageSettings { x_word: XWord::Radius, ..lathe() };
    check(&radius, "G0 X20. U-5.", "! 1:4+4 PRG-WORD-CONFLICT");
    check(&radius, "G0 X20.\nU-5. H90.", "rapid 0 -> X20\nrapid X20 -> X15 C90");
    check(&mill(), "G0 U1 V2 W3", "rapid 0 -> U1 V2 W3");
}

#[test]
fn inches() {
    check(
        &mill(),
        "G20\nG1 X1. F10.\nG91 Y-.5 A90\nG21 X1.6",
        "line 0 -> X25.4 @254/min
         line X25.4 -> X25.4 Y-12.7 A90 @1.411089/min
         line X25.4 Y-12.7 A90 -> X27 Y-12.7 A90 @254/min",
    );
    // Degrees per minute are no inches.
    check(&mill(), "G20\nG1 A90. F10.", "line 0 -> A90 @10/min");
    check(&lathe(), "G20 G0 X1.", "rapid 0 -> X12.7");
}

#[test]
fn decimal_point_rule() {
    let settings = LanguageSettings { decimal_point: DecimalPointRule::LeastIncrement, ..mill() };
    check(
        &settings,
        "G0 X1500 Y1500. A1500\nG20 X10000\nG21\nG1 X0 F100\nG4 X1500\nG4 X1.5",
        "rapid 0 -> X1.5 Y1500 A1.5
         rapid X1.5 Y1500 A1.5 -> X25.4 Y1500 A1.5
         line X25.4 Y1500 A1.5 -> Y1500 A1.5 @100/min
         dwell 1.5
         dwell 1.5",
    );
    let settings = LanguageSettings { decimal_point: DecimalPointRule::LeastIncrement, ..lathe() };
    check(&settings, "G200 F50 A30\nG201", "PathVibration on F50 A0.03\nPathVibration off");
}

#[test]
fn dwell() {
    check(&lathe(), "G4 P500\nG4 X1.5\nG4 U2", "dwell 0.5\ndwell 1.5\ndwell 2");
    let seconds = LanguageSettings { dwell_p_unit: DwellUnit::Seconds, ..mill() };
    check(&seconds, "G4 P.5", "dwell 0.5");
    check(
        &mill(),
        "G4\nG4 P-1\nG4 P1 X1\nG4 P1 Z5",
        "! 1:1+2 PRG-DWELL-TIME\n! 2:1+2 PRG-DWELL-TIME\n! 3:4+2 PRG-WORD-CONFLICT\n! 4:7+2 PRG-WORD-UNUSED",
    );
}

#[test]
fn work_offsets_re_express_the_position() {
    let mut settings = mill();
    settings.work_offsets[0][0] = 100.0;
    settings.work_offsets[1][0] = 150.0;
    settings.work_offsets[5][2] = -10.0;
    settings.initial_position[0] = 110.0;
    check(
        &settings,
        "G0 X20.\nG55 X0\nY1\nG59",
        "rapid X10 -> X20
         rapid X-30 -> 0
         rapid 0 -> Y1",
    );
    let (operations, _) = interpret(b"G0 X20.\nG55 X0", settings);
    let offsets: Vec<_> = operations
        .iter()
        .filter_map(|operation| match &operation.kind {
            OperationKind::Move(step) => Some(step.work_offset[0]),
            _ => None,
        })
        .collect();
    assert_eq!(offsets, [100.0, 150.0]);
}

#[test]
fn machine_coordinates() {
    let mut settings = mill();
    settings.work_offsets[0][0] = 100.0;
    settings.initial_position[0] = 100.0;
    check(
        &settings,
        "G0 X5\nG53 X0\nG53 G1 X10. F50\nG91 X1",
        "rapid 0 -> X5
        rapid X5 -> X-100
        line X-100 -> X-90 @50/min
        line X-90 -> X-89 @50/min",
    );
    check(
        &mill(),
        "G0 G53\nG53 G2 X1 I1\nG0 X0",
        "rapid X1 -> 0\n! 1:4+3 PRG-MACHINE-MOTION\n! 2:1+3 PRG-MACHINE-MOTION",
    );
    check(&lathe(), "G0 G53 U1", "! 1:4+3 PRG-MACHINE-MOTION");
    check(&mill(), "G91 G53 G0 X1", "! 1:5+3 PRG-MACHINE-MOTION");
    // It is rapid on FANUC controls unless a line is in force.
    check(&lathe(), "G53 X20.", "rapid 0 -> X10");
    check(&mill(), "G0 X5\nG2 X7 I1 F9\nG53 X0", "rapid 0 -> X5\narc X5 -> X7 about 6,0 by -180 @9/min\nrapid X7 -> 0");
    check(&linuxcnc(), "G53 X20", "! 1:1+7 PRG-MOTION-MISSING");
    check(&linuxcnc(), "G91 G53 G0 X20", "! 1:5+3 PRG-MACHINE-MOTION");
    check(&linuxcnc(), "G53 G0 X20\nG91 X1", "rapid 0 -> X20\nrapid X20 -> X21");
}

#[test]
fn return_to_the_reference_position() {
    let mut settings = lathe();
    settings.reference_position = [200.0, 0.0, 300.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    settings.work_offsets[0][2] = 50.0;
    settings.initial_position[2] = 50.0;
    check(
        &settings,
        "G0 X10. Z5.\nG28 U0\nG28 U2. W1.\nG28\nZ5.",
        "rapid 0 -> X5 Z5
         rapid X5 Z5 -> X200 Z5
         rapid X200 Z5 -> X201 Z6
         rapid X201 Z6 -> X200 Z250
         rapid X200 Z250 -> X200 Z5
         ! 4:1+3 PRG-REFERENCE-AXIS",
    );
    // The modal motion survives.
    check(
        &mill(),
        "G1 X1 F10\nG91 G28 X0\nG90 X2",
        "line 0 -> X1 @10/min
        rapid X1 -> 0
        line 0 -> X2 @10/min",
    );
}

#[test]
fn feed_modes() {
    check(
        &lathe(),
        "M3 S500 G1 Z1 F.2\nG98 Z2 F100\nZ3\nG99 Z4 F.1\nG93 Z5 F4\nG94 G1 Z6 F200",
        "spindle cw 500
         line 0 -> Z1 @0.2/rev
         line Z1 -> Z2 @100/min
         line Z2 -> Z3 @100/min
         line Z3 -> Z4 @0.1/rev
         line Z4 -> Z5 @1/4
         line Z5 -> Z6 @200/min",
    );
    check(&mill(), "G93 G1 X1 F2\nX2\nG0 X3", "line 0 -> X1 @1/2\nrapid X2 -> X3\n! 2:1+2 PRG-FEED-MISSING");
    check(
        &mill(),
        "G1 X1 F10\nG95 X2\nG94 X3\nX4",
        "line 0 -> X1 @10/min
        ! 2:1+6 PRG-FEED-MISSING
        ! 3:1+6 PRG-FEED-MISSING",
    );
}

#[test]
fn feed_that_cannot_cut_is_said_once() {
    check(&mill(), "G1 X1\nX2\nX3 F5\nX4", "line X2 -> X3 @5/min\nline X3 -> X4 @5/min\n! 1:1+5 PRG-FEED-MISSING");
    check(&mill(), "G1 X1 F0\nX2\nX3 F-1", "! 1:7+2 PRG-FEED-NOT-POSITIVE\n! 3:4+3 PRG-FEED-NOT-POSITIVE");
    check(
        &lathe(),
        "G1 X1 F.1\nX2\nM3 S100\nX3\nM5\nX4",
        "spindle cw 100
         line X1 -> X1.5 @0.1/rev
         spindle off 100
         ! 1:1+9 PRG-SPINDLE-STOPPED
         ! 6:1+2 PRG-SPINDLE-STOPPED",
    );
}

#[test]
fn spindle() {
    check(
        &lathe(),
        "S800\nM3\nM3\nS900\nM4\nM5\nS100",
        "spindle cw 800\nspindle cw 900\nspindle ccw 900\nspindle off 900",
    );
    check(
        &lathe(),
        "G50 S2500\nG96 S180 M3\nG97 S600\nG50 S3000\nG96",
        "spindle cw 180 m/min max 2500
         spindle cw 600
         spindle cw 180 m/min max 3000",
    );
    check(&lathe(), "G92 S2500\nG96 S180 M3", "spindle cw 180 m/min max 2500");
    check(
        &lathe(),
        "G20 G96 S100 M3\nG97",
        "spindle cw 30.48 m/min max inf
         w 1:5+3 PRG-SPEED-CLAMP-MISSING
         ! 2:1+3 PRG-SPEED-MISSING",
    );
    // n = v/(2π·r) = 100 m/min / (2π·50 mm)
    check(
        &lathe(),
        "G50 S2000\nG0 X100.\nG96 S100 M3\nG97",
        "rapid 0 -> X50
         spindle cw 100 m/min max 2000
         spindle cw 318.309886
         w 4:1+3 PRG-SPEED-MISSING",
    );
    check(
        &lathe(),
        "G50 S2000\nG0 X10.\nG96 S100 M3\nG97",
        "rapid 0 -> X5
         spindle cw 100 m/min max 2000
         spindle cw 2000
         w 4:1+3 PRG-SPEED-MISSING",
    );
    check(
        &lathe(),
        "S-5\nG50\nG50 S0\nG96",
        "! 1:1+3 PRG-SPEED-INVALID
         ! 2:1+3 PRG-SPEED-MISSING
         ! 3:5+2 PRG-SPEED-INVALID
         ! 4:1+3 PRG-SPEED-MISSING
         w 4:1+3 PRG-SPEED-CLAMP-MISSING",
    );
}

#[test]
fn tools_coolant_and_stops() {
    check(
        &lathe(),
        "T0102\nT1\nT12\nT1203\nT0004 M6\nT1.5",
        "tool 1.2\ntool 1.0\ntool 12.0\ntool 12.3\ntool 0.4\n! 6:1+4 PRG-NUMBER-NOT-WHOLE",
    );
    check(&mill(), "T5\nM6 T7\nM6\nM6", "tool 7.0\n! 3:1+2 PRG-TOOL-MISSING\n! 4:1+2 PRG-TOOL-MISSING");
    check(
        &mill(),
        "M8\nM8\nM7\nM9\nM0\nM1",
        "coolant mist false flood true
        coolant mist true flood true
        coolant mist false flood false
        stop false
        stop true",
    );
}

#[test]
fn order_within_a_block() {
    check(
        &mill(),
        "X1 M0 G1 F10 M3 S100 T1 M6",
        "tool 1.0
         spindle cw 100
         line 0 -> X1 @10/min
         stop false",
    );
    check(&mill(), "G0 X1 M30", "rapid 0 -> X1\nend");
}

#[test]
fn machining_function_words() {
    check(
        &lathe(),
        "M3 S100 G1 Z1 F.1\nG200 F80 A.02\nZ2\nG201\nG20 G200 F10 A.01",
        "spindle cw 100
         line 0 -> Z1 @0.1/rev
         PathVibration on F80 A0.02
         line Z1 -> Z2 @0.1/rev
         PathVibration off
         PathVibration on F10 A0.254",
    );
    // Values are the function's own business, words are not.
    check(&lathe(), "G200 F-1", "PathVibration on F-1");
    check(
        &lathe(),
        "G200 F50 A.1 Q3 X5.\nG201 F5\nG200 F1 F2",
        "! 1:14+2 PRG-FUNCTION-WORD
         ! 1:17+3 PRG-FUNCTION-WORD
         ! 2:6+2 PRG-FUNCTION-WORD
         ! 3:9+2 PRG-WORD-DUPLICATE",
    );
    let settings = LanguageSettings { path_vibration: FunctionCodes { on: 8.5, off: 8.6 }, ..lathe() };
    check(
        &settings,
        "G8.5 F50 A.1\nG8.6\nG200",
        "PathVibration on F50 A0.1\nPathVibration off\n! 3:1+4 PRG-UNKNOWN-CODE",
    );
}

#[test]
fn groups_duplicates_and_strangers() {
    check(&mill(), "G0 G1 X1", "! 1:4+2 PRG-GROUP-CONFLICT");
    check(&mill(), "M3 M5 S5", "! 1:4+2 PRG-GROUP-CONFLICT");
    check(&mill(), "G0 X1 X2", "! 1:7+2 PRG-WORD-DUPLICATE");
    check(&mill(), "G0 E5 X1", "! 1:4+2 PRG-WORD-UNKNOWN");
    // Without tool centre point control nothing is thinned, and M33 is the machine builder's.
    check(&lathe(), "M33\nM34", "M33 None\nM34 None\ni 1:1+3 PRG-MACHINE-CODE\ni 2:1+3 PRG-MACHINE-CODE");
    check(&mill(), "G223 M77", "! 1:1+4 PRG-UNKNOWN-CODE\ni 1:6+3 PRG-MACHINE-CODE");
    check(&mill(), "G0 X1 P2 R3", "! 1:7+2 PRG-WORD-UNUSED\n! 1:10+2 PRG-WORD-UNUSED");
    check(&mill(), "G0 X1e5", "! 1:6+2 PRG-WORD-UNKNOWN");
    check(&mill(), "G0 X1000000001", "! 1:4+11 PRG-NUMBER-RANGE");
    check(&mill(), "G0 X", "! 1:4+1 PRG-NUMBER-MISSING");
    check(&mill(), "G0 X1 000.", "rapid 0 -> X1000\nw 1:4+7 PRG-NUMBER-SPACED");
    // The cure keeps the point: X50 is 0.05 mm here.
    let increments = LanguageSettings { decimal_point: DecimalPointRule::LeastIncrement, ..mill() };
    let findings = interpret(b"G0 X5 0.\nM30", increments).1;
    let finding = findings.findings().iter().find(|finding| finding.code == "PRG-NUMBER-SPACED").unwrap();
    assert_eq!(finding.suggestions[0].replacement.as_deref(), Some("X50."));
    check(&mill(), "X1 Y2\nX3\nG0 X4", "rapid X3 Y2 -> X4 Y2\n! 1:1+5 PRG-MOTION-MISSING");
}

#[test]
fn before_the_first_motion_code_the_control_may_have_one_in_force() {
    let rapids = "rapid 0 -> X1 Y2\nrapid X1 Y2 -> X3 Y2\nline X3 Y2 -> X4 Y2 @100/min";
    let program = "X1 Y2\nX3\nG1 X4 F100";
    let stated = |initial_motion| LanguageSettings { initial_motion: Some(initial_motion), ..mill() };
    check(&stated(crate::InitialMotion::Rapid), program, rapids);
    let lines = "line 0 -> X1 Y2 @50/min\nline X1 Y2 -> X3 Y2 @50/min\nline X3 Y2 -> X4 Y2 @100/min";
    check(&stated(crate::InitialMotion::Linear), &format!("F50\n{program}"), lines);
    check(&stated(crate::InitialMotion::Linear), "X1", "! 1:1+2 PRG-FEED-MISSING");
    let mut haas = mill();
    haas.coordinates.style = crate::CoordinateStyle::Haas;
    check(&haas, program, rapids);
    // LinuxCNC has none, whatever a profile says.
    let stated = LanguageSettings { initial_motion: Some(crate::InitialMotion::Rapid), ..linuxcnc() };
    for settings in [mill(), lathe(), linuxcnc(), stated] {
        let (_, findings) = interpret(b"X10\nM30\n", settings.clone());
        let codes: Vec<_> = findings.findings().iter().map(|it| it.code.to_string()).collect();
        assert_eq!(codes, ["PRG-MOTION-MISSING"], "{:?}", settings.dialect);
        let has_setting = settings.dialect != crate::DialectName::LinuxCnc;
        assert_eq!(findings.findings()[0].suggestions.len(), if has_setting { 2 } else { 1 });
    }
    // What has a code of its own does not rely on it.
    check(&mill(), "G53 X20\nG0 X1", "rapid 0 -> X20\nrapid X20 -> X1");
    check(&mill(), "G28 X5", "rapid 0 -> X5\nrapid X5 -> 0");
}

#[test]
fn unsupported_codes_are_one_finding_each() {
    check(
        &lathe(),
        "G34 Z-2. F1.5\nX5.\nG0 X10.",
        "rapid X2.5 Z-2 -> X5 Z-2
         ! 1:1+3 PRG-THREAD-VARIABLE-LEAD",
    );
    check(
        &mill(),
        "G27 Z5.\nG41 D1 G1 X3 F10",
        "! 1:1+3 PRG-UNSUPPORTED-CODE
         ! 2:5+2 PRG-COMP-NUMBER",
    );
}

#[test]
fn a_block_with_an_error_moves_nothing_but_leaves_its_position() {
    check(&mill(), "G0 X1 Y1\nX2 E1\nX3", "rapid 0 -> X1 Y1\nrapid X2 Y1 -> X3 Y1\n! 2:4+2 PRG-WORD-UNKNOWN");
    check(&mill(), "M3 S100 G0 X1 E1\nX2", "rapid X1 -> X2\n! 1:15+2 PRG-WORD-UNKNOWN");
}
