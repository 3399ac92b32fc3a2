//! Work coordinate systems, `G52`, the family of `G92`, reference positions, rotary axes.

use super::*;
use crate::{WorkOffset, WorkSystem, straight_length};

#[test]
fn work_offsets_and_shifts_of_linuxcnc() {
    // G10 L2 and G52, the shift stays on a change of the system.
    let program = "G10 L2 P1 X100 Y50\nG10 L2 P2 X200 Y50\nG54 G0 X10 Y10\nG52 X5 Y-5\nX10 Y10\nG55 X10 Y10\n\
                   G52 X0 Y0\nX10 Y10";
    ends(&linuxcnc(), program, &[[110.0, 60.0, 0.0], [115.0, 55.0, 0.0], [215.0, 55.0, 0.0], [210.0, 60.0, 0.0]]);
    resumes(&linuxcnc(), program);
    // The rotation of a system turns the shift with it.
    let rotated = "G10 L2 P1 X100 Y50 R90\nG52 X5\nG0 X10 Y0\nG91 X1\nG90 G53 G0 X0\nG2 X0 Y0 R200 F100";
    let found = run_with(&linuxcnc(), &[], rotated);
    assert_eq!(found.findings, [""; 0]);
    let moves: Vec<_> = found.moves.iter().map(|(_, end)| *end).collect();
    same(rotated, &moves, &[[100.0, 65.0, 0.0], [100.0, 66.0, 0.0], [0.0, 66.0, 0.0], [100.0, 55.0, 0.0]]);
    resumes(&linuxcnc(), rotated);
}

#[test]
fn g92_of_linuxcnc_keeps_unnamed_axes() {
    ends(
        &linuxcnc(),
        "G0 X10 Y20\nG92 X0\nX5 Y5\nG92 Y0\nX0 Y1",
        &[[10.0, 20.0, 0.0], [15.0, 5.0, 0.0], [10.0, 6.0, 0.0]],
    );
    // Suspended and restored; cleared for good.
    let program = "G0 X10\nG92 X0\nG92.2\nX1\nG92.3\nX1\nG92.1\nX2\nG92.3\nX3";
    let expected = [10.0, 1.0, 11.0, 2.0, 3.0].map(|x| [x, 0.0, 0.0]);
    ends(&linuxcnc(), program, &expected);
    resumes(&linuxcnc(), program);
    // G91 has no influence; inches have.
    ends(
        &linuxcnc(),
        "G0 X10\nG91 G92 X0\nG90 X1\nG20 G92 X1\nX2",
        &[[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [36.4, 0.0, 0.0]],
    );
    finds(&linuxcnc(), "G92", &["1:PRG-COORD-WORD"]);
}

#[test]
fn g52_of_fanuc_adds_to_every_system() {
    let mut settings = mill();
    settings.work_offsets[0][0] = 100.0;
    settings.work_offsets[1][0] = 200.0;
    settings.initial_position[0] = 100.0;
    let program = "G52 X5\nG0 X1\nG55 X1\nG52 Y3\nX2 Y0\nG52 X0 Y0\nX1 Y1";
    ends(&settings, program, &[[106.0, 0.0, 0.0], [206.0, 0.0, 0.0], [207.0, 3.0, 0.0], [201.0, 1.0, 0.0]]);
    resumes(&settings, program);
    // G92 takes the place of it on its axes.
    ends(&settings, "G52 X5 Y5\nG0 X0 Y0\nG92 X0\nG52 X0\nX1 Y1", &[[105.0, 5.0, 0.0], [106.0, 6.0, 0.0]]);
    settings.coordinates.local_of_one_system = true;
    ends(&settings, "G52 X5\nG0 X1\nG55 X1\nG54 X1", &[[106.0, 0.0, 0.0], [201.0, 0.0, 0.0], [106.0, 0.0, 0.0]]);
    settings.coordinates.reference_cancels_local = true;
    ends(&settings, "G52 X5\nG91 G28 X0\nG90 G0 X1", &[[0.0; 3], [101.0, 0.0, 0.0]]);
}

#[test]
fn g92_of_fanuc_shifts_all_systems_until_the_preset() {
    let mut settings = mill();
    settings.work_offsets[1][0] = 200.0;
    let program = "G0 X10 Y10\nG92 X0\nX1 Y1\nG55 X0\nG92.1 X0\nX1\nG54 X1";
    let expected = [[10.0, 10.0], [11.0, 1.0], [210.0, 1.0], [201.0, 1.0], [1.0, 1.0]].map(|[x, y]| [x, y, 0.0]);
    ends(&settings, program, &expected);
    finds(
        &mill(),
        "G92.1 X1\nG92.1\nG91 G92 X0\nG52 X1",
        &["1:PRG-COORD-WORD", "2:PRG-COORD-WORD", "3:PRG-COORD-AMBIGUOUS", "4:PRG-COORD-AMBIGUOUS"],
    );
}

#[test]
fn g50_of_lathes_sets_and_shifts() {
    // X is a diameter: at radius 25 the present place gets X 40, radius 20.
    let program = "G0 X50 Z10\nG50 X40 Z0\nG0 X40 Z-5\nG50 U2 W1\nX42 Z1\nG50.3 X0 Z0\nX50 Z10";
    ends_with(&lathe(), &[], program, &[[25.0, 0.0, 10.0], [25.0, 0.0, 5.0], [25.0, 0.0, 10.0]]);
    resumes(&lathe(), program);
}

#[test]
fn extended_systems_are_named_by_p() {
    let mut settings = mill();
    let seventh = WorkSystem::extended(7).expect("a system");
    let first = WorkSystem::extended(1).expect("a system");
    let at = |x| WorkOffset { offset: [x, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], rotation_deg: 0.0 };
    settings.coordinates.systems = [(seventh, at(70.0)), (first, at(10.0))].into();
    settings.coordinates.external_offset[1] = 3.0;
    settings.initial_position[1] = 3.0;
    ends(
        &settings,
        "G54.1 P7 G0 X1\nG54 P1 X1\nG54 X1\nG10 L20 P7 X80\nG54.1 P7\nX1",
        &[[71.0, 3.0, 0.0], [11.0, 3.0, 0.0], [1.0, 3.0, 0.0], [81.0, 3.0, 0.0]],
    );
    // P belongs to the other code of a block.
    ends(&settings, "G54 G4 P100\nG0 X1", &[[1.0, 3.0, 0.0]]);
    finds(
        &settings,
        "G54.1\nG54.1 P0\nG54.1 P49\nG154 P1\nG110",
        &["1:PRG-COORD-WORD", "2:PRG-COORD-WORD", "3:PRG-COORD-WORD", "4:PRG-COORD-SETTING", "5:PRG-COORD-SETTING"],
    );
    settings.coordinates.style = crate::CoordinateStyle::Haas;
    ends(&settings, "G154 P7 G0 X1\nG110 X1\nG116 X2", &[[71.0, 3.0, 0.0], [11.0, 3.0, 0.0], [72.0, 3.0, 0.0]]);
    settings.coordinates.style = crate::CoordinateStyle::Fanuc;
    settings.coordinates.extended_systems = 300;
    ends(&settings, "G54.1 P300 G0 X1", &[[1.0, 3.0, 0.0]]);
    finds(&linuxcnc(), "G54.1 P1", &["1:PRG-UNKNOWN-CODE"]);
    ends(&linuxcnc(), "G10 L2 P9 X5\nG59.3 G0 X1\nG59.1 X1", &[[6.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
}

#[test]
fn reference_positions() {
    let mut settings = mill();
    settings.reference_position[2] = 100.0;
    settings.coordinates.more_reference_positions[0] = Some([7.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let program = "G0 X10 Z5\nG91 G28 Z0\nG90 G30 X20 Z60\nG29 X0 Z0\nG30 P2 X7";
    ends(
        &settings,
        program,
        &[
            [10.0, 0.0, 5.0],
            [10.0, 0.0, 100.0],
            [20.0, 0.0, 60.0],
            [7.0, 0.0, 50.0],
            [20.0, 0.0, 60.0],
            [0.0, 0.0, 0.0],
            [7.0, 0.0, 0.0],
        ],
    );
    resumes(&settings, program);
    finds(
        &settings,
        "G29 X1\nG30 P3 X1\nG30 P5 X1\nG28\nG28 X0\nG54 G10 L2 P1 X1\nG29 X1",
        &[
            "1:PRG-COORD-WORD",
            "2:PRG-COORD-SETTING",
            "3:PRG-COORD-WORD",
            "4:PRG-REFERENCE-AXIS",
            "7:PRG-COORD-AMBIGUOUS",
        ],
    );
    settings.coordinates.style = crate::CoordinateStyle::Haas;
    ends(&settings, "G0 X10 Z5\nG28", &[[10.0, 0.0, 5.0], [0.0, 0.0, 100.0]]);
    // LinuxCNC: bare directly, axes over the intermediate point; the present place is stored without axes.
    ends(
        &linuxcnc(),
        "G0 X10 Y5\nG28.1\nG30.1\nX0 Y0\nG28\nG0 X0 Y0\nG28 X1\nG30",
        &[
            [10.0, 5.0, 0.0],
            [0.0, 0.0, 0.0],
            [10.0, 5.0, 0.0],
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [10.0, 0.0, 0.0],
            [10.0, 5.0, 0.0],
        ],
    );
    finds(&linuxcnc(), "G28.1 X1", &["1:PRG-COORD-WORD"]);
}

#[test]
fn axes_that_roll_over_go_the_shorter_way() {
    let mut settings = mill();
    settings.coordinates.roll_over = [false, false, true];
    let angles = |settings: &LanguageSettings, program: &str| -> Vec<f64> {
        let run = run_with(settings, &[], program);
        let moves = run.operations.iter().filter_map(|operation| match &operation.kind {
            OperationKind::Move(step) => Some(step.end[5]),
            _ => None,
        });
        moves.collect()
    };
    assert_eq!(
        angles(&settings, "G0 C10\nC350\nC100\nC-90\nG91 C400\nG90 C0"),
        [10.0, -10.0, 100.0, 270.0, 670.0, 720.0]
    );
    assert_eq!(angles(&mill(), "G0 C10\nC350"), [10.0, 350.0]);
    finds(&settings, "G0 C0\nC180", &["2:PRG-ROLL-OVER"]);
    // Home within a turn, however many turns were made.
    assert_eq!(angles(&settings, "G91 G0 C3775\nG28 C0\nG90 C10"), [3775.0, 3600.0, 3610.0]);
    assert_eq!(angles(&settings, "G54 G10 L2 P1 C30\nG0 C10\nG28 C20"), [10.0, 20.0, -30.0]);
    finds(&settings, "G91 G0 C180\nG28 C0", &["2:PRG-ROLL-OVER"]);
    let mut settings = linuxcnc();
    settings.coordinates.roll_over = [true, false, true];
    // The sign is the direction.
    assert_eq!(angles(&settings, "G0 C10\nC350\nC5\nC-4\nC-350"), [10.0, 350.0, 365.0, 364.0, 350.0]);
    assert_eq!(angles(&settings, "G0 C90\nC-0\nC90\nC0\nC90\nC-0."), [90.0, 0.0, 90.0, 360.0, 450.0, 360.0]);
    finds(&settings, "G0 C360", &["1:PRG-ROLL-OVER"]);
    // Home in the positive direction.
    assert_eq!(angles(&settings, "G91 G0 C3775\nG28 C0\nC0\nG28 C0"), [3775.0, 3960.0]);
    // Machine positions without an offset of the axis, or after it was taken away as the cure says.
    assert_eq!(angles(&settings, "G10 L2 P1 X80\nG53 G0 C5\nG53 G0 C-4"), [5.0, 4.0]);
    assert_eq!(angles(&settings, "G92 C100\nG92.1\nG53 G0 C5"), [5.0]);
    assert_eq!(angles(&settings, "G10 L2 P1 C80\nG10 L2 P0 C0\nG53 G0 C5"), [5.0]);
    // Under one LinuxCNC ends at another angle.
    finds(&settings, "G92 C100\nG53 G0 C-5", &["2:PRG-ROLL-OVER"]);
    finds(&settings, "G10 L2 P1 C80\nG53 G0 C5", &["2:PRG-ROLL-OVER"]);
    finds(&settings, "G10 L2 P1 C80\nG53 G0 X5\nG91 C5", &[]);
    settings.coordinates.roll_over = [false; 3];
    assert_eq!(angles(&settings, "G10 L2 P1 C80\nG53 G0 C5"), [-75.0]);
}

/// Feeds of the moves of a program, and whether they are per revolution.
fn feeds(settings: &LanguageSettings, program: &str) -> Vec<(f64, bool)> {
    let run = run_with(settings, &[], program);
    let feeds = run.operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Move(step) => Some(step.feed),
        _ => None,
    });
    feeds
        .map(|feed| match feed {
            Feed::PerMinute(feed) | Feed::InverseTime(feed) => (feed, false),
            Feed::PerRevolution(feed) => (feed, true),
        })
        .collect()
}

#[test]
fn degrees_of_a_feed_are_the_same_in_inches() {
    let program = "G20 M3 S1200\nG95 G1 C180 F.05\nG94 C90 F60\nX0 C0\nX1.1\nG91 X.1\nG90 X1.2 C90";
    for settings in [mill(), linuxcnc()] {
        // X0 is a word and no way, X1.2 the rounding of one.
        let [turns, ways] = [(60.0, false), (1_524.0, false)];
        assert_eq!(feeds(&settings, program), [(0.05, true), turns, turns, ways, ways, turns]);
        assert_eq!(feeds(&settings, &program.replace("G20", "G21"))[0], (0.05, true));
    }
}

#[test]
fn fanuc_leads_linear_and_rotary_axes_at_one_feed() {
    // B-63324EN, section 4.3: 20 mm and 40 degrees at F300 take 0.14907 min.
    let program = "G91 G1 X20. C40. F300.\nX3. Y4.\nG93 X1. C1. F2.";
    let share = 20.0 / 2_000.0_f64.sqrt();
    let found = feeds(&mill(), program);
    assert!((found[0].0 - 300.0 * share).abs() < 1e-9 && (20.0 / found[0].0 - 0.149_07).abs() < 1e-5, "{found:?}");
    assert_eq!(found[1..], [(300.0, false), (2.0, false)]);
    assert_eq!(feeds(&linuxcnc(), program), [(300.0, false), (300.0, false), (2.0, false)]);
    // A degree counts as an inch.
    let found = feeds(&mill(), "G20 G91 G1 X3. C4. F10.");
    assert!((found[0].0 - 254.0 * 0.6).abs() < 1e-9, "{found:?}");
}

#[test]
fn linuxcnc_leads_x_y_and_z_or_u_v_and_w_where_these_rest() {
    let program =
        "G91 G18 G1 X3 U4 F60\nU4\nX3\nX3 U4 C90\nU4 C90\nC90\nG3 X6 U4 I3\nM3 S100 G95 G1 X3 V4 F.1\nG93 X3 W4 F2";
    let steps = |settings: &LanguageSettings| -> Vec<Move> {
        let operations = run_with(settings, &[], program).operations.into_iter();
        let step =
            |operation: Operation| if let OperationKind::Move(step) = operation.kind { Some(step) } else { None };
        operations.filter_map(step).collect()
    };
    let on_path = |step: &Move, half_circle: bool| {
        let length_mm = if half_circle {
            (3.0 * core::f64::consts::PI).hypot(4.0)
        } else {
            straight_length(&step.start, &step.end)
        };
        let (Feed::PerMinute(feed) | Feed::PerRevolution(feed) | Feed::InverseTime(feed)) =
            step.feed_on_path(length_mm);
        feed
    };
    let found = steps(&linuxcnc());
    assert_eq!(
        feeds(&linuxcnc(), program).iter().map(|feed| feed.0).collect::<Vec<_>>(),
        [60.0, 60.0, 60.0, 60.0, 60.0, 60.0, 60.0, 0.1, 2.0]
    );
    let half_circle = 3.0 * core::f64::consts::PI;
    let expected = [100.0, 60.0, 60.0, 100.0, 60.0, 60.0, 60.0 * half_circle.hypot(4.0) / half_circle, 0.5 / 3.0, 2.0];
    for (step, expected) in found.iter().zip(expected) {
        let found = on_path(step, step.arc.is_some());
        assert!((found - expected).abs() < 1e-9, "{found} and not {expected}: {step:?}");
    }
    assert_eq!(found.len(), expected.len());
    // All linear axes together elsewhere.
    let found = steps(&mill());
    assert!(found.iter().all(|step| step.feed_on_path(5.0) == step.feed), "{found:?}");
}

#[test]
fn initial_parameters_are_offsets() {
    let mut settings = linuxcnc();
    settings.parameters.numbered = [(5_221, 100.0), (5_230, 90.0), (5_161, 33.0), (5_210, 1.0), (5_211, 5.0)].into();
    settings.initial_position[0] = 100.0;
    ends(&settings, "G0 X10\nG28", &[[100.0, 15.0, 0.0], [33.0, 0.0, 0.0]]);
    assert_eq!(settings.initial_offset()[..2], [100.0, 5.0]);
}
