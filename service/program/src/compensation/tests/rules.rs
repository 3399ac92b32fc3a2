//! Joints, entry and exit, blocks without motion in the plane, and what is refused (section 7).

use super::*;
use crate::{Feed, Interpreter, MoveKind};

const L: CompensationCorner = CompensationCorner::Linear;

/// Errors of a LinuxCNC program.
fn errors(program: &str) -> Vec<&'static str> {
    codes(&read(program).1, Severity::Error)
}

#[test]
fn linuxcnc_refuses_on_a_contour() {
    for word in [
        "G18",
        "G53 X1",
        "G28",
        "G55",
        "G54",
        "M6 T1",
        "G43 H1",
        "G49",
        "G98",
        "G5.1 X5 Y5 I1 J1",
        "G61",
        "G64",
        "G41.1 D6",
        "G42.1 D6",
        "G33 Z-5 K1",
        "M48",
        "M53",
        "M62 P1",
        "M66 P0 L0",
        "M67 E0 Q0",
        "G38.2 Z-1",
    ] {
        let found =
            errors(&format!("S100 M3 G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\nY20\n{word}\nG1 X30\nY0\nG40 X50 Y-10"));
        assert!(found.iter().any(|code| code.starts_with("PRG-COMP-")), "{word}: {found:?}");
    }
    for word in ["G91", "G90", "G4 P1", "M3 S100", "T1", "M8", "M0", "M1", "G17", "G80", "G20\nG21"] {
        let found = errors(&format!("G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\nY20\n{word}\nG90 G1 X30\nY0\nG40 X50 Y-10"));
        assert_eq!(found, [""; 0], "{word}");
    }
}

#[test]
fn words_of_the_switch_are_judged() {
    let with = |switch: &str| errors(&format!("G0 X-20 Y-20\n{switch} G1 X0 Y-10\nY20\nG40 X50 Y-10"));
    assert_eq!(with("G41.1"), ["PRG-COMP-NUMBER"]);
    assert_eq!(with("G41 D7"), ["PRG-COMP-NUMBER"]);
    assert_eq!(with("G41 D1.5"), ["PRG-NUMBER-NOT-WHOLE"]);
    assert_eq!(with("G41.1 D6 L2"), ["PRG-COMP-PLANE"]);
    assert_eq!(with("G18 G42.1 D6 L10"), ["PRG-COMP-TIP"]);
    assert_eq!(with("G41 D0"), [""; 0]);
    let yz = errors("G19 G0 Y-20 Z-20\nG41.1 D6 G1 Y0 Z-10\nZ20\nG40 Y50");
    assert_eq!(yz, ["PRG-COMP-PLANE"]);
}

#[test]
fn an_entry_is_longer_than_the_radius_in_linuxcnc() {
    assert_eq!(errors("G0 X-3 Y0\nG41.1 D6 G1 X0\nY20\nG40 X50"), ["PRG-COMP-ENTRY"]);
    assert_eq!(errors("G0 X-3.1 Y0\nG41.1 D6 G1 X0\nY20\nG40 X50"), [""; 0]);
    assert_eq!(errors("G0 X-9 Y0\nG41.1 D6\nG1 Z-5\nX0\nY20\nG40 X50"), ["PRG-COMP-ENTRY"]);
}

#[test]
fn moves_along_the_normal_stand_at_the_corner() {
    // As rs274 does it: at an inside corner on the crossing, at an outside corner before the arc.
    let (operations, findings) = read("G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\nY20\nZ5\nM8\nZ-5\nX-30\nY0\nG40 X-50 Y-10");
    assert_eq!(codes(&findings, Severity::Error), [""; 0]);
    let found: Vec<_> = moves(&operations).iter().map(|step| [step.end[0], step.end[1], step.end[2]]).collect();
    assert_eq!(found[2..5], [[-3.0, 17.0, 0.0], [-3.0, 17.0, 5.0], [-3.0, 17.0, -5.0]]);
    let coolant = operations.iter().position(|operation| matches!(operation.kind, OperationKind::Coolant(_)));
    assert_eq!(coolant, Some(4));
    let (operations, _) = read("G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\nY20\nZ-5\nX30\nG40 X50 Y-10");
    let found: Vec<_> = moves(&operations).iter().map(|step| [step.end[0], step.end[1], step.end[2]]).collect();
    assert_eq!(found[2..5], [[-3.0, 20.0, 0.0], [-3.0, 20.0, -5.0], [0.0, 23.0, -5.0]]);
}

#[test]
fn a_rapid_goes_over_the_point_beside_the_corner_in_linuxcnc() {
    let (operations, _) = read("G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\nY20\nG0 X30\nG40 X50 Y-10");
    let expected =
        [(-3.0, -8.1459, None), (-3.0, 20.0, None), (0.0, 23.0, None), (30.0, 23.0, None), (50.0, -10.0, None)];
    assert_xy(&operations, &expected);
    assert!(moves(&operations)[3..].iter().all(|step| step.kind == MoveKind::Rapid));
}

#[test]
fn nearly_straight_corners_are_none_in_linuxcnc() {
    let (operations, findings) = read("G0 X-20 Y-20\nG42.1 D6 G1 X0 Y-10\nY20\nX-0.5 Y40\nG40 X50");
    assert_eq!(codes(&findings, Severity::Error), [""; 0]);
    // Ends beside the corner, without a crossing; rs274: STRAIGHT_FEED(3.0000, 20.0000).
    let step = moves(&operations)[3];
    assert_eq!([step.end[0], step.end[1]], [3.0, 20.0]);
    let info = findings.findings().iter().find(|found| found.code == crate::code::COMP_STRAIGHT).expect("a finding");
    // r·(1 − cos(atan(0.5 / 20)))
    assert!((info.values[0].value - 3.0 * (1.0 - 20.0 / 400.25_f64.sqrt())).abs() < 1e-12);
}

/// Out to a corner of 45° outside, and with `G41` to its left.
const ACUTE: &str = "G21 F100 G0 X-20 Y0\nG1 X-10\nX10\nX0 Y-10\nX-20 Y-30";

#[test]
fn beyond_a_right_angle_fanuc_cuts_the_corner_off() {
    let (operations, findings) = fanuc(ACUTE, (2, 5), true, 2.0, CompensationEntry::A, L);
    assert_eq!(codes(&findings, Severity::Warning), [""; 0]);
    // C + r·(n1 + t1), C + r·(n2 − t2) with t2 = (−1, −1)/√2, n2 = (1, −1)/√2.
    let root = core::f64::consts::SQRT_2;
    let expected = [
        (-10.0, 2.0, None),
        (12.0, 2.0, None),
        (10.0 + 2.0 * root, 0.0, None),
        (root, -10.0 - root, None),
        (-20.0, -30.0, None),
    ];
    assert_xy(&operations, &expected);
}

#[test]
fn circular_corners_are_a_setting() {
    let (operations, _) = fanuc(ACUTE, (2, 5), true, 2.0, CompensationEntry::A, CompensationCorner::Circular);
    let root = core::f64::consts::SQRT_2;
    let expected = [
        (-10.0, 2.0, None),
        (10.0, 2.0, None),
        (10.0 + root, -root, Some([10.0, 0.0])),
        (root, -10.0 - root, None),
        (-20.0, -30.0, None),
    ];
    assert_xy(&operations, &expected);
}

#[test]
fn fanuc_prolongs_the_tangents_of_arcs() {
    // A quarter circle about (10, 0), then down at right angles outside.
    let program = "G21 F100 G0 X0 Y-20\nG1 Y0\nG2 X10 Y10 I10\nG1 Y-10\nX20 Y-20";
    let (operations, _) = fanuc(program, (2, 5), true, 2.0, CompensationEntry::A, L);
    let expected = [
        (-2.0, 0.0, None),
        (10.0, 12.0, Some([10.0, 0.0])),
        (12.0, 12.0, None),
        (12.0, -10.0, None),
        (20.0, -20.0, None),
    ];
    assert_xy(&operations, &expected);
}

#[test]
fn type_b_goes_around_the_corner_of_entry_and_exit() {
    // Entry along +X to (0, 0), then up outside at right angles; exit to the right likewise.
    let program = "G21 F100 G0 X-20 Y0\nG1 X0\nY-20\nX-20";
    let (operations, _) = fanuc(program, (2, 4), true, 2.0, CompensationEntry::B, L);
    let expected = [(2.0, 2.0, None), (2.0, -22.0, None), (-20.0, -20.0, None)];
    assert_xy(&operations, &expected);
    // Beyond a right angle: C + r·n1, C + r·(n1 + t1), C + r·(n2 − t2), and mirrored on the exit.
    let program = "G21 F100 G0 X-20 Y0\nG1 X0\nX-10 Y-10\nX10 Y-10";
    let (operations, _) = fanuc(program, (2, 4), true, 2.0, CompensationEntry::B, L);
    let root = core::f64::consts::SQRT_2;
    let expected = [
        (0.0, 2.0, None),
        (2.0, 2.0, None),
        (2.0 * root, 0.0, None),
        (-10.0, -10.0 - 2.0 * root, None),
        (-12.0, -8.0, None),
        (-10.0, -8.0, None),
        (10.0, -10.0, None),
    ];
    // The exit turns toward the tool: it leaves from beside the end.
    let inside = [expected[0], expected[1], expected[2], (-10.0 + root, -10.0 - root, None), (10.0, -10.0, None)];
    assert_xy(&operations, &inside);
    let program = "G21 F100 G0 X-20 Y0\nG1 X0\nX-10 Y-10\nX-10 Y20";
    let (operations, _) = fanuc(program, (2, 4), true, 2.0, CompensationEntry::B, L);
    let outside = [
        expected[0],
        expected[1],
        expected[2],
        (-10.0, -10.0 - 2.0 * root, None),
        (-12.0, -12.0, None),
        (-12.0, -10.0, None),
        (-10.0, 20.0, None),
    ];
    assert_xy(&operations, &outside);
}

#[test]
fn type_c_goes_beside_the_start_by_a_move_of_its_own() {
    let program = "G21 F100 G0 X-20 Y0\nM8\nG1 X0\nY-20\nX-20";
    let (operations, _) = fanuc(program, (2, 5), true, 2.0, CompensationEntry::C, L);
    let expected = [(-20.0, 2.0, None), (2.0, 2.0, None), (2.0, -20.0, None), (-20.0, -20.0, None)];
    assert_xy(&operations, &expected);
    // In a block with motion it is type A.
    let program = "G21 F100 G0 X-20 Y0\nG1 X0\nY-20\nX-20";
    let ends = |entry| {
        let (operations, _) = fanuc(program, (2, 4), true, 2.0, entry, L);
        moves(&operations).iter().map(|step| step.end).collect::<Vec<_>>()
    };
    assert_eq!(ends(CompensationEntry::C), ends(CompensationEntry::A));
}

#[test]
fn fanuc_looks_over_two_blocks_without_motion() {
    let with = |blocks: &str, off| {
        let program = format!("G21 F100 G0 X-20 Y0\nG1 X0\nY20\n{blocks}\nX20\nY0\nX50");
        fanuc(&program, (2, off), true, 2.0, CompensationEntry::A, L)
    };
    let (operations, findings) = with("M8\nZ-1", 8);
    assert_eq!(codes(&findings, Severity::Error), [""; 0]);
    let found: Vec<_> = moves(&operations).iter().map(|step| [step.end[0], step.end[1], step.end[2]]).collect();
    assert_eq!(found[2..5], [[-2.0, 22.0, 0.0], [-2.0, 22.0, -1.0], [22.0, 22.0, -1.0]]);
    let (_, findings) = with("M8\nZ-1\nM9", 9);
    assert_eq!(codes(&findings, Severity::Error), ["PRG-COMP-IDLE"]);
}

#[test]
fn fanuc_enters_and_leaves_on_a_line_only() {
    let (_, findings) =
        fanuc("G21 F100 G0 X-20 Y0\nG2 X0 Y0 I10\nG1 Y-20\nX-20", (2, 4), true, 2.0, CompensationEntry::A, L);
    assert_eq!(codes(&findings, Severity::Error), ["PRG-COMP-ENTRY"]);
    let (_, findings) =
        fanuc("G21 F100 G0 X-20 Y0\nG1 X0\nG1 Y-20\nG2 X-20 Y-20 I-10", (2, 4), true, 2.0, CompensationEntry::A, L);
    assert_eq!(codes(&findings, Severity::Error), ["PRG-COMP-EXIT"]);
    let (_, findings) = fanuc("G21 F100 G0 X-20 Y0\nG1 X0\nY-20", (2, 9), true, 2.0, CompensationEntry::A, L);
    assert_eq!(codes(&findings, Severity::Error), ["PRG-COMP-UNFINISHED"]);
}

#[test]
fn linuxcnc_may_end_on_a_contour_and_refuses_an_arc_behind_it() {
    let (operations, findings) = read("G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\nY20");
    assert_eq!(codes(&findings, Severity::Error), [""; 0]);
    assert_xy(&operations, &[(-3.0, -8.1459, None), (-3.0, 20.0, None)]);
    assert_eq!(errors("G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\nY20\nG40 G2 X10 Y30 R10"), ["PRG-COMP-EXIT"]);
}

#[test]
fn behind_g40_linuxcnc_moves_sideways_with_z_and_fanuc_stays() {
    let (operations, findings) = read("G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\nY20\nG40\nG0 Z20");
    assert_eq!(codes(&findings, Severity::Warning), ["PRG-COMP-EXIT-ASIDE"]);
    let step = moves(&operations)[3];
    assert_eq!((&step.start[..3], &step.end[..3]), (&[-3.0, 20.0, 0.0][..], &[0.0, 20.0, 20.0][..]));
    let program = "G21 F100 G0 X-20 Y0\nG1 X0\nY20\nG0 Z20\nZ30\nX5";
    let (operations, findings) = fanuc(program, (2, 4), true, 2.0, CompensationEntry::A, L);
    assert_eq!(codes(&findings, Severity::Warning), ["PRG-COMP-EXIT-ASIDE"]);
    let ends: Vec<_> = moves(&operations)[3..].iter().map(|step| [step.end[0], step.end[1], step.end[2]]).collect();
    assert_eq!(ends, [[-2.0, 20.0, 20.0], [-2.0, 20.0, 30.0], [5.0, 20.0, 30.0]]);
}

#[test]
fn helices_keep_their_height_and_lose_angle_in_corners() {
    // Up beside x = 0, then a helix inside of half a turn, radius 10, and down beside x = 20.
    let (operations, findings) = read("G0 X-20 Y-20\nG42.1 D6 G1 X0 Y-10\nY20\nG2 X20 I10 Z-2\nG1 Y0\nG40 X10 Y-10");
    assert_eq!(codes(&findings, Severity::Error), [""; 0]);
    let step = moves(&operations)[4];
    let arc = step.arc.expect("the helix");
    assert_eq!((step.start[2], step.end[2]), (0.0, -2.0));
    assert!((arc.sweep_rad + core::f64::consts::PI).abs() < 1e-9 && (step.end[0] - 17.0).abs() < 1e-9);
}

#[test]
fn inverse_time_becomes_the_feed_of_the_programmed_length() {
    let (operations, _) = read("G0 X-20 Y-20\nG93 G41.1 D6 G1 X0 Y-10 F2\nY20 F3\nX30 F4\nG40 X50 Y-10 F1");
    let feeds: Vec<_> = moves(&operations)[1..].iter().map(|step| step.feed).collect();
    let entry = 500.0_f64.sqrt() * 2.0;
    let expected = [entry, 90.0, 120.0, 120.0].map(Feed::PerMinute);
    assert_eq!(feeds[..4], expected);
    assert_eq!(feeds[4], Feed::InverseTime(1.0));
}

#[test]
fn a_contour_that_comes_back_to_itself_is_a_warning() {
    // A pocket with a neck of 5 mm, for a tool of 6 mm.
    let program = "G0 X-20 Y-20\nG42.1 D6 G1 X0 Y-10\nY20\nX-10 Y30\nY50\nX15\nY30\nX5 Y20\nY-10\nG40 X50 Y-10";
    let (_, findings) = read(program);
    assert_eq!(codes(&findings, Severity::Error), [""; 0]);
    let gouges: Vec<_> = findings.findings().iter().filter(|found| found.code == crate::code::COMP_GOUGE).collect();
    let worst = gouges.iter().find(|found| found.severity == Severity::Warning && found.span.line == 10);
    let worst = worst.expect("on the way back through the neck");
    assert!((worst.values[0].value - 1.0).abs() < 1e-9, "{gouges:#?}");
}

/// Beyond the point where a contour closes, neither its first block nor its last one is a wall.
#[test]
fn a_contour_that_overlaps_its_start_cuts_nothing() {
    let gouges = |side: &str, start: &str, rest: &str| {
        let program = format!("{start}\n{side} D6 G1 X0 Y-10\n{rest}");
        let (_, findings) = read(&program);
        assert_eq!(codes(&findings, Severity::Error), [""; 0], "{program}");
        !codes(&findings, Severity::Warning).is_empty()
    };
    let square = "Y50\nX50\nY0\nX-10\nG40 X-30 Y-10";
    assert!(!gouges("G41.1", "G0 X0 Y-20", square), "outside");
    assert!(gouges("G42.1", "G0 X0 Y-20", square), "inside the first block is the wall of the last corner");
    // A last block that comes near the first one without crossing it goes through a neck.
    assert!(gouges("G42.1", "G0 X0 Y-20", "Y20\nX-10 Y30\nY50\nX15\nY30\nX5 Y20\nY-10\nG40 X2 Y-30"), "a neck");
}

#[test]
fn contours_apart_in_height_do_not_meet() {
    let with = |lift: &str, plunge: &str| {
        let contour = "Y20\nX30\nY-10";
        let program = format!("G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\n{contour}\n{lift}\nX10\n{plunge}\nG1 Y40\nG40 X-50");
        let (_, findings) = read(&program);
        (codes(&findings, Severity::Error).len(), codes(&findings, Severity::Warning).len())
    };
    assert_eq!(with("G0 Z5", "G0 Z-1"), (0, 0));
    assert_eq!(with("G1 Z5", "G1 Z-1"), (0, 1));
}

#[test]
fn while_it_is_off_nothing_is_touched() {
    let program = "G0 X-20 Y-20\nG40\nG1 X0 Y-10\nG2 X10 Y0 R10\nZ5\nM8";
    let (operations, mut findings) = read(program);
    let mut stage = Compensator::default();
    let mut through = operations.clone();
    let storage = through.as_ptr();
    stage.apply(&mut through, 0, &mut findings);
    assert_eq!(through, operations);
    assert_eq!(through.as_ptr(), storage);
}

#[test]
fn a_state_restored_on_a_contour_goes_on_identically() {
    let program = "G21 F100 G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\nY20\nZ5\nG3 X-30 Y20 R15\nG1 Y0\nG2 X-40 Y10 R10\nG1 X-60\n\
                   G40\nG0 Z9\nM2\n";
    let (whole, _) = interpret(program.as_bytes(), settings());
    let mut state = Interpreter::new(settings()).state().clone();
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    for line in program.split_inclusive('\n') {
        let bytes = postcard::to_stdvec(&state).expect("plain data");
        let mut interpreter = Interpreter::restore(settings(), postcard::from_bytes(&bytes).expect("its own bytes"));
        let _ = interpreter.read_line(line.as_bytes(), false, &mut operations, &mut findings);
        state = interpreter.state().clone();
    }
    assert_eq!(operations, whole);
}

#[test]
fn a_refused_block_on_a_contour_is_the_only_finding() {
    assert_eq!(errors("G0 X-20 Y-20\nG41.1 D6 G1 X0 Y-10\nY20\nX30 R5\nX2\nY0\nG40 X50 Y-10"), ["PRG-WORD-UNUSED"]);
}

#[test]
fn an_arc_is_an_entry_in_linuxcnc() {
    // Numbers of rs274: ends beside the programmed end, tangent there.
    let (operations, findings) = read("G0 X-20 Y0\nG41.1 D6 G3 X0 Y20 I20 J0\nG1 X-30\nG40 X-50 Y30");
    assert_eq!(codes(&findings, Severity::Error), [""; 0], "{:?}", findings.findings());
    assert!(moves(&operations)[1].arc.is_some());
    assert_eq!(errors("G0 X-4 Y0\nG41.1 D6 G3 X0 I2\nG1 X-30\nG40 X-50 Y30"), ["PRG-COMP-ARC"]);
}

/// Findings of a program for a mill or a lathe with a table of tool offsets.
fn with_tools(settings: LanguageSettings, program: &str) -> (Vec<Operation>, FindingLog) {
    let tools = vec![
        crate::ToolOffset { radius_wear_mm: -0.25, ..crate::ToolOffset::new(7).with_radius(3.25) },
        crate::ToolOffset { tip: 3, ..crate::ToolOffset::new(1).with_radius(0.4) },
        crate::ToolOffset::new(2).with_length(100.0),
    ];
    let tools: Vec<_> = match settings.dialect {
        // With a length, every other tool would need one.
        crate::DialectName::Lathe => tools.into_iter().filter(|row| row.geometry.is_none()).collect(),
        _ => tools,
    };
    Interpreter::new(settings).with_tools(tools).read_all(format!("{program}\nM30\n").as_bytes())
}

#[test]
fn d_names_radius_and_wear_of_a_mill() {
    let program = "G0 X-20 Y-20\nG41 D7 G1 X0 Y-10 F100\nY20\nX30\nY0\nG40 X50 Y-10";
    let (operations, findings) = with_tools(LanguageSettings::mill(), program);
    assert!(!findings.has_errors(), "{:?}", findings.findings());
    let expected =
        [(-3.0, -10.0, None), (-3.0, 23.0, None), (33.0, 23.0, None), (33.0, 0.0, None), (50.0, -10.0, None)];
    assert_xy(&operations, &expected);
    // D is modal; the side cannot change on a contour, but FANUC posts repeat the code.
    let with = |program: &str| codes(&with_tools(LanguageSettings::mill(), program).1, Severity::Error);
    let again = "G41 D7 G1 X0 Y-10 F100\nY20\nG40 X-20\nG41 G1 X0 Y-10\nG41 Y20\nG40 X-20";
    assert_eq!(with(again), [""; 0]);
    assert_eq!(with("G41 D7 G1 X0 Y-10 F100\nY20\nG42 X30\nG40 X-20"), ["PRG-COMP-NESTED"]);
    assert_eq!(with("G41 D2 G1 X0 Y-10 F100\nY20\nG40 X-20"), ["PRG-COMP-NUMBER"]);
    assert_eq!(with("G41 D1 G1 X0 Y-10 F100\nY20\nG40 X-20"), ["PRG-COMP-PLANE"]);
    assert_eq!(with("G41 D7 G1 X0 Y-10 F100\nY20"), ["PRG-COMP-UNFINISHED"]);
    // It may come before, as beside the tool's length, and is kept by mills; on the contour it may not change.
    let before = "G0 X-20 Y-20 D7\nG41 G1 X0 Y-10 F100\nY20\nX30 D7\nY0\nG40 D0 X50 Y-10";
    let (operations, findings) = with_tools(LanguageSettings::mill(), before);
    assert!(!findings.has_errors(), "{:?}", findings.findings());
    assert_xy(&operations, &expected);
    assert_eq!(with("G43 H2 D7\nG41 G1 X0 Y-10 F100\nY20\nG40 X-20"), [""; 0]);
    assert_eq!(with("G41 D7 G1 X0 Y-10 F100\nY20 D1\nG40 X-20"), ["PRG-COMP-BLOCK"]);
    assert_eq!(with("G41 D7 G1 X0 Y-10 F100\nY20\nD1\nX30\nG40 X-20"), ["PRG-COMP-BLOCK"]);
    assert_eq!(with("G0 X-20 D1.5"), ["PRG-NUMBER-NOT-WHOLE"]);
    assert_eq!(codes(&with_tools(LanguageSettings::linuxcnc(), "G0 X-20 D7").1, Severity::Error), ["PRG-WORD-UNUSED"]);
}

#[test]
fn a_lathe_takes_radius_and_tip_of_the_offset_of_its_tool() {
    // Example 10 on a lathe with diameters.
    let program = "G98 F100 T0101 G0 X60 Z10\nG42 G1 X20 Z5\nZ-10\nX30 Z-15\nZ-20\nX40\nG40 G0 X80 Z0";
    let (operations, findings) = with_tools(LanguageSettings::default(), program);
    assert!(!findings.has_errors(), "{:?}", findings.findings());
    let mitre = -15.4 + 0.4 * libm::tan(core::f64::consts::FRAC_PI_8);
    let expected = [
        (10.0, 4.6, None),
        (10.0, -10.2343, None),
        (15.0, mitre, None),
        (15.0, -20.0, None),
        (19.6, -20.0, None),
        (40.0, 0.0, None),
    ];
    assert_ends(&operations, [Axis::X, Axis::Z], 1, &expected);
    let with = |program: &str| codes(&with_tools(LanguageSettings::default(), program).1, Severity::Error);
    assert_eq!(with("G98 F100 G0 X60 Z10\nG42 G1 X20 Z5\nZ-10\nG40 X60"), ["PRG-COMP-NUMBER"]);
    assert_eq!(with("G98 F100 T0101 G0 X60 Z10\nG42 G1 X20 Z5\nZ-10\nT0202\nG40 X60"), ["PRG-COMP-BLOCK"]);
    assert_eq!(with("G98 F100 T0101 G0 X60 Z10\nG42 G1 X20 Z5\nZ-10\nG50 X40\nG40 X60"), ["PRG-COMP-BLOCK"]);
    assert_eq!(with("G98 F100 T0101 G0 X60 Z10\nG42 G1 X20 Z5\nZ-10\nG50 U2\nG40 X60"), ["PRG-COMP-BLOCK"]);
    assert_eq!(with("G98 F100 T0101 G0 X60 Z10\nG42 G1 X20 Z5\nZ-10\nG50 S2000\nG40 X60"), [""; 0]);
    for written in ["#2201=1.", "#2901=0.8", "#2301=3"] {
        let on = format!("G98 F100 T0101 G0 X60 Z10\nG42 G1 X20 Z5\nZ-10\n{written}\nG40 X60");
        let off = format!("G98 F100 T0101 G0 X60 Z10\n{written}\nG42 G1 X20 Z5\nZ-10\nG40 X60");
        assert_eq!(with(&on), ["PRG-PARAMETER-READ-ONLY"], "{written}");
        assert_eq!(with(&off), [""; 0], "{written}");
    }
}

/// Codes of all findings of a mill's program, with the tool 1 of 8 mm.
fn found(program: &str) -> Vec<(&'static str, Severity)> {
    findings_of(program).findings().iter().map(|finding| (finding.code.name(), finding.severity)).collect()
}

fn findings_of(program: &str) -> FindingLog {
    let tool = crate::ToolOffset { radius_mm: Some(4.0), ..crate::ToolOffset::new(1) };
    let program = format!("G21 G17 G90 G94\n{program}\nM30\n");
    Interpreter::new(LanguageSettings::mill()).with_tools(vec![tool]).read_all(program.as_bytes()).1
}

#[test]
fn arcs_that_lead_to_a_contour_and_away_from_it_are_no_walls() {
    // A bore of 30 mm, entered and left on quarter circles of 10 mm, as post processors write it.
    let bore = "G0 X0 Y0\nG41 D1 G1 X5. Y-10. F300\nG3 X15. Y0 I0 J10.\nG3 I-15.\nG3 X5. Y10. I-10.\nG40 G1 X0 Y0";
    assert!(found(bore).iter().all(|(_, severity)| *severity == Severity::Info), "{:?}", found(bore));
    // Its whole circle passes over them, which is said as it is.
    let findings = findings_of(bore);
    let passed = findings.findings().iter().filter(|found| found.code.name() == "PRG-COMP-GOUGE");
    assert!(passed.clone().count() > 0 && passed.clone().all(|it| it.message.starts_with("the tool passes ")));
    // A block round the outside, likewise.
    let block = "G0 X31.5 Y-12.\nG41 D1 G1 X36.5 Y-11.4 F300\nG3 X31.5 Y-6.4 I-5. J0\nG1 X0\nG2 X-5. Y-1.4 J5.\nG1 Y30.\n\
                 G2 X0 Y35. I5.\nG1 X60.\nG2 X65. Y30. J-5.\nG1 Y-1.4\nG2 X60. Y-6.4 I-5.\nG1 X31.5\nG3 X26.5 Y-11.4 J-5.\n\
                 G40 G1 X31.5 Y-12.";
    assert!(found(block).iter().all(|(_, severity)| *severity == Severity::Info), "{:?}", found(block));
    // A slot that the tool does not fit into is a wall all the same.
    let slot =
        "G0 X0 Y0\nG41 D1 G1 X5. Y-10. F300\nG3 X15. Y0 I0 J10.\nG1 Y30.\nX12.\nY0\nG3 X5. Y-10. J-10.\nG40 G1 X0";
    assert!(found(slot).iter().any(|(_, severity)| *severity != Severity::Info), "{:?}", found(slot));
}

/// What the tool cuts into on its way along the contour is a warning, also beside an arc that is its first or last block and meets
/// the others in a corner.
#[test]
fn an_arc_that_meets_the_contour_in_a_corner_is_a_wall() {
    let severities = |program: &str| {
        let findings = found(program);
        let gouges = findings.iter().filter(|(code, _)| *code == "PRG-COMP-GOUGE");
        gouges.map(|(_, severity)| *severity).collect::<Vec<_>>()
    };
    for contour in [
        "G3 X20. Y20. I0 J20.\nG1 X7.\nY4.\nG40 G1 X12. Y12.",
        // The same arc as two.
        "G3 X14.142 Y5.858 I0 J20.\nG3 X20. Y20. I-14.142 J14.142\nG1 X7.\nY4.\nG40 G1 X12. Y12.",
    ] {
        let found = severities(&format!("G0 X-20. Y0\nG41 D1 G1 X0 Y0 F300\n{contour}"));
        assert!(found.contains(&Severity::Warning), "{contour}: {found:?}");
    }
    // Likewise on the other side, and the other way round: at the end of the contour.
    for program in [
        "G0 X-20. Y0\nG42 D1 G1 X0 Y0 F300\nG2 X20. Y-20. I0 J-20.\nG1 X7.\nY-4.\nG40 G1 X12. Y-12.",
        "G0 X12. Y12.\nG42 D1 G1 X7. Y4. F300\nY20.\nX20.\nG2 X0 Y0 I-20. J0\nG40 G1 X-20. Y0",
    ] {
        assert!(severities(program).contains(&Severity::Warning), "{program}: {:?}", found(program));
    }
}

#[test]
fn a_rapid_through_a_wall_is_a_warning_as_a_cut_is() {
    for code in ["G0", "G1"] {
        let program = format!(
            "G0 X-20. Y-30.\nG41 D1 G1 X0 Y-10. F300\nY40.\nX40.\nY0\nX20.\n{code} Y60.\nG1 X-30.\nG40 G1 X-40. Y70."
        );
        assert!(found(&program).contains(&("PRG-COMP-GOUGE", Severity::Warning)), "{code}: {:?}", found(&program));
    }
}

#[test]
fn rapids_are_no_walls() {
    // Out of the groove on the way that led into it.
    let program = "G0 X0 Y-20\nG41 D1 G1 X20. Y0 F300\nG0 Y40.\nG1 X60.\nG0 Y0\nX20.\nG40 G1 X0 Y-20.";
    assert!(found(program).iter().all(|(code, _)| *code != "PRG-COMP-GOUGE"), "{:?}", found(program));
}

#[test]
fn contour_control_is_permitted_on_a_contour_and_the_end_of_the_program_is_not() {
    let on = |block: &str| found(&format!("G0 X0 Y-20\nG41 D1 G1 X0 Y0 F300\nY40.\n{block}\nX60.\nG40 G1 X80."));
    for block in ["G5.1 Q1", "G5 P10000", "G8 P1", "G187 P2", "G103 P1"] {
        assert!(on(block).iter().all(|(_, severity)| *severity == Severity::Info), "{block}: {:?}", on(block));
    }
    assert!(on("M99").contains(&("PRG-COMP-UNFINISHED", Severity::Error)), "{:?}", on("M99"));
    let whole = "G0 X0 Y-20\nM98 P1000\nM30\nO1000\nG41 D1 G1 X0 Y0 F300\nY40.\nX60.\nG40 X80.\nM99";
    assert!(found(whole).iter().all(|(_, severity)| *severity == Severity::Info), "{:?}", found(whole));
}

#[test]
fn a_subprogram_returns_on_a_contour_which_goes_on_in_its_caller() {
    let tool = crate::ToolOffset { radius_mm: Some(4.0), ..crate::ToolOffset::new(1) };
    let read = |program: &str| {
        let program = format!("G21 G17 G90 G94\n{program}\n");
        Interpreter::new(LanguageSettings::mill()).with_tools(vec![tool]).read_all(program.as_bytes())
    };
    let path = |program: &str| {
        let (operations, findings) = read(program);
        assert!(!findings.has_errors(), "{program}: {findings:?}");
        let ends = operations.iter().filter_map(|operation| match &operation.kind {
            OperationKind::Move(step) => Some(step.end),
            _ => None,
        });
        (ends.collect::<Vec<_>>(), findings.findings().iter().any(|it| it.code.name() == "PRG-COMP-RETURN"))
    };
    let (expected, _) = path("G0 X0 Y-20\nG41 D1 G1 X0 Y0 F300\nY40.\nX60.\nG40 G1 X80.\nM30");
    for program in [
        "G0 X0 Y-20\nG41 D1 G1 X0 Y0 F300\nM98 P1000\nG40 G1 X80.\nM30\nO1000\nY40.\nX60.\nM99",
        "G0 X0 Y-20\nM98 P1000\nG40 G1 X80.\nM30\nO1000\nG41 D1 G1 X0 Y0 F300\nY40.\nX60.\nM99",
    ] {
        assert_eq!(path(program), (expected.clone(), true), "{program}");
    }
}
