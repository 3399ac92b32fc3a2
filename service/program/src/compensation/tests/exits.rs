//! Behind `G40`, words that name the present programmed point take the tool there, from beside it (section 7).

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

use super::*;
use crate::{CompensationSettings, CoordinateStyle, DrillingStyle, Interpreter, ToolOffset};

const CASES: u32 = 400;

fn mill(entry: CompensationEntry) -> LanguageSettings {
    let mut settings = LanguageSettings::mill();
    settings.compensation = CompensationSettings { entry, ..settings.compensation };
    settings
}

fn haas() -> LanguageSettings {
    let mut settings = LanguageSettings::mill();
    settings.drilling.style = DrillingStyle::Haas;
    settings.coordinates.style = CoordinateStyle::Haas;
    settings
}

fn interpreter(settings: &LanguageSettings) -> Interpreter {
    let tools = match settings.dialect {
        crate::DialectName::Lathe => vec![ToolOffset { tip: 3, ..ToolOffset::new(1).with_radius(0.4) }],
        _ => vec![ToolOffset::new(7).with_radius(3.0)],
    };
    Interpreter::new(settings.clone()).with_tools(tools)
}

/// Operations and warnings of a program.
fn carried_out(settings: &LanguageSettings, program: &str) -> (Vec<Operation>, Vec<&'static str>) {
    let (operations, findings) = interpreter(settings).read_all(program.as_bytes());
    assert_eq!(codes(&findings, Severity::Error), [""; 0], "{program}");
    assert!(!operations.iter().any(|operation| matches!(operation.kind, OperationKind::Compensation(_))));
    assert!(moves(&operations).iter().all(|step| !step.is_nothing()), "{program}");
    (operations, codes(&findings, Severity::Warning))
}

/// X, Y and Z of the ends from the last one on the contour on.
fn ends_behind(operations: &[Operation], last: [f64; 3]) -> Vec<[f64; 3]> {
    let ends: Vec<_> = moves(operations).iter().map(|step| [step.end[0], step.end[1], step.end[2]]).collect();
    let is_last = |end: &[f64; 3]| end.iter().zip(&last).all(|(a, b)| (a - b).abs() < TOLERANCE_MM);
    let place = ends.iter().rposition(is_last).unwrap_or_else(|| panic!("{last:?} is none of {ends:?}"));
    let rounded = ends[place + 1..].iter().map(|end| end.map(|value| (value * 1e9).round() / 1e9 + 0.0));
    rounded.collect()
}

/// What follows a contour, where it leads, and its findings.
type Leaving<'a> = (&'a str, &'a [[f64; 3]], &'a [&'a str]);

#[test]
fn a_mill_goes_to_the_programmed_point_before_it_drills_or_plunges() {
    let over = [30.0, 20.0, 30.0];
    let hole = [over, [30.0, 20.0, 2.0], [30.0, 20.0, -5.0], over];
    let plunge = [over, [30.0, 20.0, -5.0]];
    let cases: [(&str, &[[f64; 3]]); 13] = [
        ("G40 X30. Y20.\nG81 X30. Y20. Z-5. R2. F100", &hole),
        ("G40\nG81 X30. Y20. Z-5. R2. F100", &hole),
        ("G40 G81 X30. Y20. Z-5. R2. F100", &hole),
        ("G40\nG81 X30. Z-5. R2. F100", &hole),
        ("G40 G0 X30. Y20.\nG1 Z-5.", &plunge),
        ("G40\nG0 X30. Y20.\nG1 Z-5.", &plunge),
        ("G40\nM8\nG4 P1\nX30. Y20.\nZ-5.", &plunge),
        ("G40 G0 X30.\nG1 Z-5.", &plunge),
        ("G40 Y20.\nZ-5.", &plunge),
        ("G40 G91 X0\nG90 Z-5.", &plunge),
        ("G40\n#1=30.\nG0 X#1 Y20.\nX30. Y20.\nZ-5.", &plunge),
        ("G40 G0 X30. Y20. Z40.", &[[30.0, 20.0, 40.0]]),
        ("G40 G91 G28 X0 Y0", &[over, [0.0, 0.0, 30.0]]),
    ];
    for settings in [mill(CompensationEntry::A), mill(CompensationEntry::B), mill(CompensationEntry::C), haas()] {
        for (behind, expected) in cases {
            let program = format!("G0 X-20. Y0. Z30.\nG41 D7 G1 X0. F100\nY20.\nX30.\n{behind}\nM30\n");
            let (operations, warnings) = carried_out(&settings, &program);
            assert_eq!(ends_behind(&operations, [30.0, 23.0, 30.0]), expected, "{behind}");
            assert_eq!(warnings, [""; 0], "{behind}");
            is_continuous(&operations);
        }
    }
}

#[test]
fn without_a_word_of_the_plane_a_mill_stays_beside_and_says_so() {
    for settings in [mill(CompensationEntry::A), haas()] {
        for (behind, expected) in [("G40 G1 Z-5.", -5.0), ("G40\nG0 Z30.\nZ10.", 10.0)] {
            let program = format!("G0 X-20. Y0. Z30.\nG41 D7 G1 X0. F100\nY20.\nX30.\n{behind}\nX40.\nM30\n");
            let (operations, warnings) = carried_out(&settings, &program);
            let found = ends_behind(&operations, [30.0, 23.0, 30.0]);
            assert_eq!(found, [[30.0, 23.0, expected], [40.0, 20.0, expected]], "{behind}");
            assert_eq!(warnings, ["PRG-COMP-EXIT-ASIDE"], "{behind}");
        }
    }
}

#[test]
fn a_lathe_goes_to_the_programmed_point() {
    let contour = "G98 F100 T0101 G0 X60. Z10.\nG42 G1 X20. Z5.\nZ-10.\nX30. Z-15.\nZ-20.\nX40.";
    let words = ["X40. Z-20.", "X40.", "Z-20.", "U0 W0", "W0"];
    for behind in words.iter().flat_map(|words| [format!("G40 G0 {words}"), format!("G40\nG1 {words}")]) {
        let program = format!("{contour}\n{behind}\nX50.\nM30\n");
        let (operations, warnings) = carried_out(&LanguageSettings::default(), &program);
        let found = ends_behind(&operations, [19.6, 0.0, -20.0]);
        assert_eq!(found, [[20.0, 0.0, -20.0], [25.0, 0.0, -20.0]], "{behind}");
        assert_eq!(warnings, [""; 0], "{behind}");
    }
}

/// Numbers of rs274.
#[test]
fn linuxcnc_goes_to_the_programmed_point_with_a_word_of_any_axis() {
    let over = [0.0, 20.0, 30.0];
    let cases: [Leaving<'_>; 11] = [
        ("G0 X0 Y20\nG0 Z10", &[over, [0.0, 20.0, 10.0]], &[]),
        ("G0 X0\nG0 Z10", &[over, [0.0, 20.0, 10.0]], &[]),
        ("G81 X0 Y20 Z-5 R2", &[over, [0.0, 20.0, 2.0], [0.0, 20.0, -5.0], [0.0, 20.0, 2.0]], &[]),
        ("G20\nG0 X0\nG0 Z1", &[over, [0.0, 20.0, 25.4]], &[]),
        ("G28\nG0 X1", &[over, [0.0; 3], [1.0, 0.0, 0.0]], &["PRG-COMP-EXIT-ASIDE"]),
        ("G92 X7\nG0 X7\nG0 X8", &[[7.0, 20.0, 30.0], [8.0, 20.0, 30.0]], &[]),
        ("S500 M3 G95 F0.1 G1 X0 Y20\nG1 Z1", &[over, [0.0, 20.0, 1.0]], &[]),
        ("G0 X#5420 Y#5421\nG0 Z5", &[over, [0.0, 20.0, 5.0]], &[]),
        ("o1 sub\nG0 X0 Y20\nG0 Z1\no1 endsub\no1 call", &[over, [0.0, 20.0, 1.0]], &[]),
        ("G0 Z30\nZ5", &[over, [0.0, 20.0, 5.0]], &["PRG-COMP-EXIT-ASIDE"]),
        ("G0 Z10\nX0 Y20", &[[0.0, 20.0, 10.0]], &["PRG-COMP-EXIT-ASIDE"]),
    ];
    for (behind, expected, warned) in cases {
        let program = format!("G21 F100 G0 X-20 Y0 Z30\nG41.1 D6\nG1 X0\nY20\nG40\n{behind}\nM2\n");
        let (operations, warnings) = carried_out(&LanguageSettings::linuxcnc(), &program);
        assert_eq!(ends_behind(&operations, [-3.0, 20.0, 30.0]), expected, "{behind}");
        assert_eq!(warnings, warned, "{behind}");
    }
    let lathe = "G21 F100 G18 G7 G0 X60 Z10\nG42.1 D1.6 L2\nG1 X20 Z5\nZ-10\nX30 Z-20";
    for behind in ["G40 G0 X30 Z-20", "G40 G0 X30", "G40\nG0 Z-20"] {
        let (operations, _) = carried_out(&LanguageSettings::linuxcnc(), &format!("{lathe}\n{behind}\nX50\nM2\n"));
        let ends: Vec<_> = moves(&operations).iter().map(|step| [step.end[0], step.end[2]]).collect();
        assert_eq!(ends[ends.len() - 2..], [[15.0, -20.0], [25.0, -20.0]], "{behind}");
    }
}

#[test]
fn a_tool_that_stands_on_the_path_moves_nowhere() {
    for behind in ["G40 X-20. Y0.", "G40\nX-20. Y0.", "G40 G81 X-20. Y0. Z30. R30."] {
        let program = format!("G0 X-20. Y0. Z30.\nG1 F100\nG41 D7\n{behind}\nM30\n");
        let (operations, _) = carried_out(&mill(CompensationEntry::A), &program);
        assert_eq!(moves(&operations).len(), 1, "{behind}");
    }
}

#[test]
fn a_state_restored_behind_g40_goes_on_identically() {
    for settings in [mill(CompensationEntry::A), mill(CompensationEntry::B), LanguageSettings::linuxcnc()] {
        let on = if settings.dialect == crate::DialectName::LinuxCnc { "G41.1 D6" } else { "G41 D7" };
        for behind in ["G40\nG0 X0 Y20.\nZ10.", "G40 X0\nZ10.", "G40\nM8\nG81 X0 Y20. Z-5. R2.", "G40\nG91 G28 X0 Y0"] {
            let program = format!("G21 G0 X-20. Y0 Z30.\nF100 {on} G1 X0\nY20.\n{behind}\nM2\n");
            let (whole, _) = carried_out(&settings, &program);
            let mut state = Interpreter::new(settings.clone()).state().clone();
            let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
            for line in program.split_inclusive('\n') {
                let bytes = postcard::to_stdvec(&state).expect("plain data");
                let state_again = postcard::from_bytes(&bytes).expect("its own bytes");
                let tools = vec![ToolOffset::new(7).with_radius(3.0)];
                let mut again = Interpreter::restore(settings.clone(), state_again).with_tools(tools);
                let _ = again.read_line(line.as_bytes(), false, &mut operations, &mut findings);
                state = again.state().clone();
            }
            assert_eq!(operations, whole, "{behind}");
        }
    }
}

/// A contour of two lines, and how the programmed point is named behind it.
#[derive(Clone, Debug)]
struct Case {
    control: usize,
    left: bool,
    /// Direction of the first line, the turn behind it, rad, and lengths, mm.
    heading: f64,
    turn: f64,
    lengths: [f64; 2],
    offset: [f64; 2],
    names: [bool; 2],
    is_rapid: bool,
    is_own_block: bool,
    is_incremental: bool,
    goes_up: bool,
}

fn case() -> impl Strategy<Value = Case> {
    let names = prop_oneof![Just([true, true]), Just([true, false]), Just([false, true])];
    let geometry = (0.0..6.2_f64, -2.0..2.0_f64, [20.0..60.0_f64, 20.0..60.0_f64], [-50.0..50.0_f64, -50.0..50.0_f64]);
    let ways = (any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>());
    (0..5_usize, names, geometry, ways).prop_map(|(control, names, geometry, ways)| {
        let (heading, turn, lengths, offset) = geometry;
        let (left, is_rapid, is_own_block, is_incremental, goes_up) = ways;
        Case { control, left, heading, turn, lengths, offset, names, is_rapid, is_own_block, is_incremental, goes_up }
    })
}

/// Whether the contour was possible at all.
fn check_case(case: &Case) -> bool {
    let settings = match case.control {
        0 => mill(CompensationEntry::A),
        1 => mill(CompensationEntry::B),
        2 => mill(CompensationEntry::C),
        3 => haas(),
        _ => LanguageSettings::linuxcnc(),
    };
    let round = |value: f64| (value * 1e3).round() / 1e3;
    let corner = [0, 1].map(|axis| {
        let along = if axis == 0 { libm::cos(case.heading) } else { libm::sin(case.heading) };
        round(case.lengths[0] * along)
    });
    let end = [0, 1].map(|axis| {
        let angle = case.heading + case.turn;
        let along = if axis == 0 { libm::cos(angle) } else { libm::sin(angle) };
        round(corner[axis] + case.lengths[1] * along)
    });
    let side = if case.left { "G41" } else { "G42" };
    let on = if case.control == 4 { format!("{side}.1 D6") } else { format!("{side} D7") };
    let named = |axis: usize| {
        let value = if case.is_incremental { 0.0 } else { end[axis] };
        if case.names[axis] { format!(" {}{value:.3}", ["X", "Y"][axis]) } else { String::new() }
    };
    let up = if !case.goes_up {
        ""
    } else if case.is_incremental {
        " Z5."
    } else {
        " Z35."
    };
    let program = format!(
        "G21 G17 G90 G94\nG10 L2 P1 X{:.3} Y{:.3}\nG54 G0 X0. Y0. Z30.\n{on} G1 X{:.3} Y{:.3} F100\nX{:.3} Y{:.3}\nG40{}{}{}{}{}{up}\nG90 G1 Z-5.\nM30\n",
        round(case.offset[0]),
        round(case.offset[1]),
        corner[0],
        corner[1],
        end[0],
        end[1],
        if case.is_own_block { "\n" } else { "" },
        if case.is_incremental { " G91" } else { "" },
        if case.is_rapid { " G0" } else { " G1" },
        named(0),
        named(1),
    );
    let (operations, findings) = interpreter(&settings).read_all(program.as_bytes());
    if findings.has_errors() {
        return false;
    }
    let path = moves(&operations);
    let [.., exit, plunge] = path[..] else { panic!("{program}") };
    for axis in [0, 1] {
        let programmed = end[axis] + round(case.offset[axis]);
        for (step, is_at) in [(exit, exit.end), (plunge, plunge.start), (plunge, plunge.end)] {
            assert!((is_at[axis] + step.work_offset[axis] - programmed).abs() < 1e-9, "{program}");
        }
    }
    let aside = (exit.start[0] - exit.end[0]).hypot(exit.start[1] - exit.end[1]);
    assert!((aside - 3.0).abs() < 1e-9, "{aside}: {program}");
    assert_eq!(exit.end[2], if case.goes_up { 35.0 } else { 30.0 }, "{program}");
    assert_eq!(plunge.end[2], -5.0, "{program}");
    assert!(!findings.findings().iter().any(|found| found.code == crate::code::COMP_EXIT_ASIDE), "{program}");
    true
}

#[test]
fn behind_a_move_that_names_the_point_the_machine_is_at_the_programmed_one() {
    let possible = core::cell::Cell::new(0_u32);
    let config = proptest::repeatable(Config { cases: CASES, ..Config::default() });
    let result = TestRunner::new(config).run(&case(), |case| {
        possible.set(possible.get() + u32::from(check_case(&case)));
        Ok(())
    });
    assert!(result.is_ok(), "{}", result.unwrap_err());
    assert!(possible.get() > CASES / 2, "{} possible", possible.get());
}

#[test]
fn a_lathe_drops_the_offset_on_its_way_out() {
    let settings = LanguageSettings::default();
    let tool = ToolOffset { tip: 3, ..ToolOffset::new(1).with_radius(0.4) };
    let geometry = ToolOffset { geometry: Some([2.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), ..tool };
    let run = |program: &str| {
        let interpreter = Interpreter::new(settings.clone()).with_tools(vec![geometry]);
        interpreter.read_all(program.as_bytes())
    };
    let program = |switch: &str, out: &str| {
        format!(
            "S500 M3\nT0101\nG0 X60. Z5.\n{switch} X50. Z3.\nG1 Z-20. F0.2\nX60.\n{out} G0 X100. Z50.\nX110.\nM30\n"
        )
    };
    let (operations, findings) = run(&program("G42", "G40 T0100"));
    assert_eq!(codes(&findings, Severity::Error), [""; 0]);
    let (plain, _) = run(&program("", "T0100"));
    let (before, plain) = (moves(&operations), moves(&plain));
    let [.., leaving, last] = &before[..] else { panic!("{before:?}") };
    // It leaves from beside the contour, which is elsewhere without the offset, to where it goes without compensation.
    let (kept, _) = run(&program("G42", "G40"));
    let kept = moves(&kept);
    let beside = kept[kept.len() - 2].start;
    assert_eq!(leaving.start, core::array::from_fn(|axis| beside[axis] + geometry.geometry.unwrap()[axis]));
    assert_eq!([leaving.end, last.end], [plain[plain.len() - 2].end, plain[plain.len() - 1].end]);
    // Another tool or another offset would not be the contour's.
    for change in ["T0200", "T0101"] {
        let (_, findings) = run(&program("G42", &format!("G40 {change}")));
        assert_eq!(codes(&findings, Severity::Error), ["PRG-COMP-BLOCK"], "{change}");
    }
    let (_, findings) = run(&program("G42", "T0100"));
    assert!(codes(&findings, Severity::Error).contains(&"PRG-COMP-BLOCK"));
}
