//! Tests of system variables: section 2 of the page on the language.

use super::*;
use crate::dialect::CodeTable;
use crate::expression::{Context, assignment, evaluate};
use crate::{Interpreter, ToolOffset};

/// T1 is measured, of T2 the number is known.
fn tools() -> Vec<ToolOffset> {
    let turning =
        ToolOffset { tip: 3, front_angle_deg: 10.0, back_angle_deg: 20.0, radius_wear_mm: -0.05, ..ToolOffset::new(1) };
    vec![turning.with_length(100.0).with_radius(4.0), ToolOffset::new(2)]
}

/// An interpreter behind a program, without its end, that gives no finding.
fn behind(settings: &LanguageSettings, program: &str) -> Interpreter {
    behind_all(settings, program, 0)
}

/// An interpreter behind a program that gives so many findings.
fn behind_all(settings: &LanguageSettings, program: &str, count: usize) -> Interpreter {
    let mut interpreter = Interpreter::new(settings.clone()).with_tools(tools());
    let (mut operations, mut findings) = (Vec::new(), crate::FindingLog::default());
    for line in program.lines() {
        interpreter.read_line(format!("{line}\n").as_bytes(), false, &mut operations, &mut findings);
    }
    assert_eq!(findings.findings().len(), count, "{program}: {:?}", findings.findings());
    interpreter
}

/// The value of an expression behind a program; the code of the finding where it has none.
fn value(settings: &LanguageSettings, program: &str, text: &str) -> Result<Value, String> {
    let interpreter = behind(settings, program);
    let dialect = CodeTable::new(settings).dialect;
    let tools = tools();
    let system = System { state: interpreter.state(), settings, dialect, tools: &tools };
    let mut context = Context::new(dialect.expressions, &system, settings.angle_range);
    let found = evaluate(text.as_bytes(), 0, &mut context);
    found.map(|(value, _)| value).map_err(|defect| defect.code.name().to_owned())
}

#[track_caller]
fn check(settings: &LanguageSettings, program: &str, cases: &[(&str, f64)]) {
    for &(text, expected) in cases {
        let found = value(settings, program, text).expect("it has a value").expect("it is not vacant");
        assert!((found - expected).abs() < 1e-12, "{text} behind {program} = {found}, not {expected}");
    }
}

/// Settings with G54 at (100, 50, 10) and G55 at (200, 0, 0).
fn with_offsets(settings: LanguageSettings) -> LanguageSettings {
    let mut settings = settings;
    settings.work_offsets[0][..3].copy_from_slice(&[100.0, 50.0, 10.0]);
    settings.work_offsets[1][0] = 200.0;
    settings
}

#[test]
fn section_2_positions_fanuc() {
    let mill = with_offsets(LanguageSettings::mill());
    check(
        &mill,
        "T1 M6\nG0 X1 Y2 Z3\nG43 H1\nG0 Z5",
        &[
            ("#5001", 1.0),
            ("#5003", 5.0),
            ("#5021", 101.0),
            ("#5022", 52.0),
            ("#5023", 115.0),
            ("#5043", 105.0),
            ("#5083", 100.0),
            ("#5221", 100.0),
            ("#5241", 200.0),
            ("#5242", 0.0),
        ],
    );
    check(&mill, "G20\nG0 X1 Y2", &[("#5001", 1.0), ("#5002", 2.0), ("#5222", 50.0 / 25.4)]);
    let lathe = with_offsets(LanguageSettings::default());
    check(&lathe, "G0 X40 Z-5", &[("#5001", 40.0), ("#5002", -5.0), ("#5021", 240.0), ("#5221", 200.0)]);
    for text in ["#5004", "#5204", "#1000"] {
        assert_eq!(value(&mill, "G0 X1", text), Err("PRG-PARAMETER-UNAVAILABLE".to_owned()), "{text}");
    }
}

#[test]
fn section_2_modes_fanuc() {
    check(
        &LanguageSettings::mill(),
        "G20\nG1 G18 G91 F12.5\nT1 M6\nG55 S500 M3",
        &[
            ("#4001", 1.0),
            ("#4002", 18.0),
            ("#4003", 91.0),
            ("#4005", 94.0),
            ("#4006", 20.0),
            ("#4007", 40.0),
            ("#4008", 49.0),
            ("#4014", 55.0),
            ("#4109", 12.5),
            ("#4119", 500.0),
            ("#4120", 1.0),
        ],
    );
    check(&LanguageSettings::default(), "G0 G97 S100", &[("#4001", 0.0), ("#4002", 97.0), ("#4016", 18.0)]);
    assert_eq!(value(&LanguageSettings::mill(), "", "#4001"), Err("PRG-PARAMETER-UNAVAILABLE".to_owned()));
}

/// Whoever keeps it and writes it again gets the same motion.
#[test]
fn section_2_the_motion_in_force_of_lathes() {
    use crate::GCodeSystem::{A, B, C};
    let setting_up = "M3 S500\nG0 X40 Z5 F0.2\n";
    for (system, thread, turn, face, passes) in
        [(A, "G32", "G90", "G94", "G92"), (B, "G33", "G77", "G79", "G78"), (C, "G33", "G20", "G24", "G21")]
    {
        let mut settings = LanguageSettings { g_code_system: Some(system), ..LanguageSettings::default() };
        settings.turning.thread_chamfer_tenths = Some(0);
        for code in [thread, turn, face, passes] {
            let expected: f64 = code[1..].parse().unwrap();
            check(&settings, &format!("{setting_up}{code} X29 Z-20 F2"), &[("#4001", expected)]);
        }
    }
    let unknown = value(&LanguageSettings::default(), &format!("{setting_up}G33 Z-20 F2"), "#4001");
    assert_eq!(unknown, Err("PRG-PARAMETER-UNAVAILABLE".to_owned()));
}

/// `#4120` is the last T word, whatever is in the spindle.
#[test]
fn section_2_the_last_tool_word_fanuc() {
    check(&LanguageSettings::mill(), "T1 M6\nT2", &[("#4120", 2.0)]);
    check(&LanguageSettings::mill(), "T1 M6", &[("#4120", 1.0)]);
    check(&LanguageSettings::default(), "T0101", &[("#4120", 101.0)]);
    let mut settings = LanguageSettings::mill();
    settings.code_replacements = vec![crate::CodeReplacement { code: "M6".to_owned(), words: "M98 P9001".to_owned() }];
    let program = b"O1\nT1 M6\nT2 M6\nM30\nO9001\nG0 X[#4120*10]\nM6\nM99\n";
    let (operations, findings) = crate::interpret(program, settings);
    let ends = operations.iter().filter_map(|operation| match &operation.kind {
        crate::OperationKind::Move(step) => Some(step.end[0]),
        _ => None,
    });
    assert_eq!(ends.collect::<Vec<_>>(), [10.0, 20.0], "{:?}", findings.findings());
}

/// The last M code, line number and program, also in a subprogram and behind it.
#[test]
fn section_2_codes_and_numbers_of_blocks_fanuc() {
    let mill = LanguageSettings::mill();
    check(&mill, "O5\nN10 G0 X1\nN20 M8\nG0 X2", &[("#4113", 8.0), ("#4114", 20.0), ("#4115", 5.0)]);
    check(&mill, "N10 G0 X1\nN20 X2\nX3\nN30 Y4", &[("#4114", 30.0)]);
    check(&mill, "G0 X1", &[("#4107", 0.0)]);
    for (program, text) in
        [("G0 X1", "#4113"), ("G0 X1", "#4114"), ("G0 X1", "#4115"), ("M8\nM97 P5\nM30\nN5 X1\nM99", "#4113")]
    {
        let found = value(&mill, program, text);
        assert_eq!(found, Err("PRG-PARAMETER-UNAVAILABLE".to_owned()), "{text} behind {program}");
    }
    let program = b"O1\nN1 G0 X3\nM98 P2\nG0 X#4115 Y#4114\nM30\nO2\nG0 X#4115 Y#4114\nN7 G0 Z5\nM99\n";
    let (operations, findings) = crate::interpret(program, mill);
    let ends = operations.iter().filter_map(|operation| match &operation.kind {
        crate::OperationKind::Move(step) => Some([step.end[0], step.end[1]]),
        _ => None,
    });
    assert_eq!(ends.collect::<Vec<_>>(), [[3.0, 0.0], [2.0, 1.0], [2.0, 1.0], [1.0, 7.0]], "{:?}", findings.findings());
}

/// Groups that the manuals number differently.
#[test]
fn section_2_modal_groups_by_control() {
    let mill = LanguageSettings::mill();
    let cycle = "T1 M6\nG0 X0 Y0 Z5\nG81 G99 Z-5 R1 F100";
    check(&mill, cycle, &[("#4009", 81.0), ("#4010", 99.0), ("#4014", 54.0), ("#4012", 67.0)]);
    check(&mill, &format!("{cycle}\nG80 G98"), &[("#4009", 80.0), ("#4010", 98.0)]);
    let mut haas = mill;
    haas.drilling.style = crate::DrillingStyle::Haas;
    haas.coordinates.style = crate::CoordinateStyle::Haas;
    check(&haas, "G55", &[("#4012", 55.0)]);
    for (program, text) in [("G55", "#4014"), ("G154 P3", "#4012")] {
        assert_eq!(value(&haas, program, text), Err("PRG-PARAMETER-UNAVAILABLE".to_owned()), "{text}");
    }
    let mut lathe = LanguageSettings::default();
    assert_eq!(value(&lathe, "", "#4005"), Err("PRG-PARAMETER-UNAVAILABLE".to_owned()), "by the G-code system");
    for (system, codes) in [(crate::GCodeSystem::A, ["G98", "G99"]), (crate::GCodeSystem::B, ["G94", "G95"])] {
        lathe.g_code_system = Some(system);
        for code in codes {
            check(&lathe, code, &[("#4005", code[1..].parse().unwrap())]);
        }
    }
}

#[test]
fn section_2_modes_are_those_that_are_written_fanuc() {
    let lathe = LanguageSettings::default();
    let thread = "G97 S300 M3\nG0 X30 Z5\nG1 X29 F0.2\nG32 Z-5 F1.5";
    check(&lathe, thread, &[("#4109", 1.5)]);
    check(&lathe, &format!("{thread}\nG1 X30 F.3"), &[("#4109", 0.3)]);
    let mill = LanguageSettings::mill();
    for (before, radius) in [("", 3.0), ("", -3.0), ("G51.1 X0", 3.0), ("G51.1 X0", -3.0)] {
        for (code, expected) in [("G41", 41.0), ("G42", 42.0)] {
            let program = format!("G10 L12 P3 R{radius}\nG0 X0 Y0\n{before}\n{code} D3 G1 X10 F500");
            check(&mill, &program, &[("#4007", expected)]);
        }
    }
}

/// In a tilted plane, under tool centre point control and beside a contour the machine is not where work and offsets say.
#[test]
fn section_2_places_that_only_the_machine_knows() {
    let mill = with_offsets(LanguageSettings::mill());
    let refuses = |settings: &LanguageSettings, program: &str, texts: &[&str]| {
        for text in texts {
            let found = value(settings, program, text);
            assert_eq!(found, Err("PRG-PARAMETER-UNAVAILABLE".to_owned()), "{text} behind {program}");
        }
    };
    let plane = "T1 M6\nG43 H1\nG68.2 X5 Y6 Z7 I20 J30 K0\nG53.1\nG0 X1 Y2 Z50";
    let known = [("#5081", 0.0), ("#5083", 100.0), ("#4111", 1.0)];
    check(&mill, plane, &[&known[..], &[("#5001", 1.0), ("#5003", 50.0), ("#4008", 43.0)]].concat());
    let angles = "T1 M6\nG43.4 H1\nG0 X1 Y2 Z50 A0 C0";
    check(&mill, angles, &[&known[..], &[("#5001", 1.0), ("#4008", 43.4)]].concat());
    let vectors = "T1 M6\nG43.5 H1\nG0 X1 Y2 Z50 I0 J0 K1";
    check(&mill, vectors, &[&known[..], &[("#5001", 1.0), ("#4008", 43.5)]].concat());
    for program in [plane, angles, vectors] {
        refuses(&mill, program, &["#5021", "#5023", "#5041", "#5043"]);
    }
    check(&mill, "G43.4 H1\nG49", &[("#4008", 49.0), ("#4111", 0.0), ("#5083", 0.0)]);
    let contour = "G10 L12 P3 R3\nG0 X0 Y0 Z5\nG41 D3 G1 X10 F500\nY20";
    for program in [contour, &format!("{contour}\nG40")] {
        refuses(&mill, program, &["#5021", "#5022", "#5041"]);
        check(&mill, program, &[("#5001", 10.0), ("#5023", 15.0), ("#5043", 5.0)]);
    }
    check(&mill, &format!("{contour}\nG40 X-20"), &[("#5021", 80.0), ("#5041", -20.0)]);
    let linuxcnc = LanguageSettings::linuxcnc();
    let contour = "G0 X0 Y0\nG41.1 D6 G1 X10 F100\nY20";
    refuses(&linuxcnc, contour, &["#<_x>", "#<_abs_y>", "#5021", "#5420", "#5422"]);
    check(&linuxcnc, contour, &[("#<_z>", 0.0), ("#<_ccomp>", 410.0)]);
    check(&linuxcnc, "G0 X20\nG42.1 D6 G1 X50 Y0 F100", &[("#<_ccomp>", 420.0)]);
    check(&linuxcnc, &format!("{contour}\nG40 X-20"), &[("#<_ccomp>", 400.0), ("#<_x>", -20.0), ("#5420", -20.0)]);
}

/// As its interpreter has them.
#[test]
fn section_2_overrides_and_speed_linuxcnc() {
    let settings = LanguageSettings::linuxcnc();
    for (program, [feed, speed, adaptive, hold]) in [
        ("", [1.0, 1.0, 0.0, 1.0]),
        ("M49", [0.0, 0.0, 0.0, 1.0]),
        ("M49\nM48", [1.0, 1.0, 0.0, 1.0]),
        ("M50 P0", [0.0, 1.0, 0.0, 1.0]),
        ("M49\nM50 P1", [1.0, 0.0, 0.0, 1.0]),
        ("M51 P0\nM52\nM53 P0", [1.0, 0.0, 1.0, 0.0]),
        ("M52\nM52 P0\nM53 P0\nM53", [1.0, 1.0, 0.0, 1.0]),
        ("M70\nM49\nM52\nM53 P0\nM72", [1.0, 1.0, 1.0, 1.0]),
        // What was off stays on.
        ("M52\nM53 P0\nM70\nM52 P0\nM53\nM72", [1.0, 1.0, 1.0, 1.0]),
        // One code is restored for both, that of the one that was on.
        ("M50 P0\nM70\nM48\nM72", [1.0, 1.0, 0.0, 1.0]),
    ] {
        check(
            &settings,
            program,
            &[
                ("#<_feed_override>", feed),
                ("#<_speed_override>", speed),
                ("#<_adaptive_feed>", adaptive),
                ("#<_feed_hold>", hold),
            ],
        );
    }
    check(&settings, "G96 D2000 S150 M3", &[("#<_rpm>", 150.0)]);
    check(&settings, "G96 D2000 S150 M3\nG97 S300", &[("#<_rpm>", 300.0)]);
}

#[test]
fn section_2_the_clock_is_refused_unless_the_job_brings_it() {
    let mut mill = LanguageSettings::mill();
    for text in ["#3001", "#3002", "#3011", "#3012", "#3901"] {
        assert_eq!(value(&mill, "", text), Err("PRG-PARAMETER-CLOCK".to_owned()), "{text}");
    }
    mill.parameters.numbered.insert(3_011, 20_260_101.0);
    assert_eq!(value(&mill, "", "#3011"), Ok(Some(20_260_101.0)));
}

#[test]
fn section_2_results_of_probes_are_the_programmed_end() {
    let mill = LanguageSettings::mill();
    let program = "G0 Z5\nG31 Z-10 F100";
    let interpreter = behind_all(&mill, program, 1);
    let dialect = CodeTable::new(&mill).dialect;
    let system = System { state: interpreter.state(), settings: &mill, dialect, tools: &[] };
    assert_eq!(system.numbered(5_063), Ok(Reading { value: Some(-10.0), is_probed: true }));
    let linuxcnc = LanguageSettings::linuxcnc();
    let interpreter = behind_all(&linuxcnc, "G0 Z5\nG38.2 Z-10 F100", 1);
    let dialect = CodeTable::new(&linuxcnc).dialect;
    let system = System { state: interpreter.state(), settings: &linuxcnc, dialect, tools: &[] };
    assert_eq!(system.numbered(5_063), Ok(Reading { value: Some(-10.0), is_probed: true }));
    assert_eq!(system.numbered(5_070).map_err(|refusal| refusal.code), Err(code::PARAMETER_UNAVAILABLE));
    assert_eq!(value(&linuxcnc, "", "#5063"), Ok(Some(0.0)), "nothing was probed");
    assert_eq!(value(&linuxcnc, "", "#5399"), Ok(Some(linuxcnc.input_result)));
}

#[test]
fn section_2_numbers_linuxcnc() {
    let settings = with_offsets(LanguageSettings::linuxcnc());
    check(
        &settings,
        "G55 T1 M6\nG43 H1\nG0 X1 Y2 Z3",
        &[
            ("#5400", 1.0),
            ("#5220", 2.0),
            ("#5221", 100.0),
            ("#5241", 200.0),
            ("#5420", 1.0),
            ("#5422", 3.0),
            ("#5021", 201.0),
            ("#5403", 100.0),
            ("#100", 0.0),
            ("#5", 0.0),
        ],
    );
    check(&settings, "G20\nG0 X1", &[("#5420", 1.0), ("#5221", 100.0)]);
    assert_eq!(value(&settings, "", "#5602"), Err("PRG-PARAMETER-NUMBER".to_owned()));
}

/// The row of the tool in the spindle, held against rs274: only a tool change and the table change it.
#[test]
fn section_2_the_tool_in_the_spindle_linuxcnc() {
    let settings = LanguageSettings::linuxcnc();
    let row = [("#5401", 0.0), ("#5403", 100.0), ("#5410", 7.9), ("#5411", 10.0), ("#5412", 20.0), ("#5413", 2.0)];
    for program in ["T1 M6", "T1 M6 G43", "T1 M6\nG43\nG49", "T1 M6\nG43.1 Z5", "T1 M6\nT2", "M61 Q1", "T1 M6\nG20"] {
        check(&settings, program, &row);
    }
    check(
        &settings,
        "T1 M6\nG10 L1 P1 Z50 R3 I1 J2 Q4\nG10 L1 P2 Z60 R4",
        &[("#5403", 50.0), ("#5410", 6.0), ("#5413", 4.0)],
    );
    check(&settings, "", &[("#5403", 0.0), ("#5410", 0.0), ("#5411", 0.0), ("#5413", 0.0)]);
    check(&settings, "T1 M6\nT0 M6", &[("#5403", 0.0), ("#5410", 0.0)]);
    // The offset in force may be that of another tool.
    let interpreter = behind_all(&settings, "T2 M6\nG43 H1", 1);
    let (dialect, tools) = (CodeTable::new(&settings).dialect, tools());
    let system = System { state: interpreter.state(), settings: &settings, dialect, tools: &tools };
    assert_eq!(system.numbered(5_083), Ok(Reading::from(Some(100.0))));
    for number in [5_403, 5_410] {
        let refusal = system.numbered(number).expect_err("T2 is not measured");
        assert_eq!(refusal.code, code::PARAMETER_UNAVAILABLE, "#{number}");
        assert!(refusal.message.contains("T2"), "{}", refusal.message);
    }
    assert_eq!(value(&settings, "T3 M6", "#5410"), Err("PRG-PARAMETER-UNAVAILABLE".to_owned()), "no such tool");
    assert_eq!(value(&settings, "T3 M6", "#5413"), Err("PRG-PARAMETER-UNAVAILABLE".to_owned()), "no such tool");
    let mut brought = settings;
    brought.parameters.numbered.insert(5_410, 12.0);
    check(&brought, "T2 M6", &[("#5410", 12.0)]);
}

#[test]
fn section_2_pockets_linuxcnc_are_the_machines() {
    let mut settings = LanguageSettings::linuxcnc();
    check(&settings, "", &[("#<_selected_pocket>", -1.0)]);
    for (program, name) in [("", "#<_current_pocket>"), ("T1", "#<_selected_pocket>"), ("T1 M6", "#<_current_pocket>")]
    {
        assert_eq!(value(&settings, program, name), Err("PRG-PARAMETER-UNAVAILABLE".to_owned()), "{name}");
    }
    assert_eq!(after(&settings, &["#<_current_pocket>=3"], "#1"), Err("PRG-PARAMETER-READ-ONLY".to_owned()));
    settings.parameters.named = [("_current_pocket".to_owned(), 5.0), ("_selected_pocket".to_owned(), 6.0)].into();
    check(&settings, "T1 M6", &[("#<_current_pocket>", 5.0), ("#<_selected_pocket>", 6.0)]);
}

/// The cure names the rows that bring the value.
#[test]
fn values_that_only_the_machine_has_name_what_brings_them() {
    let (mill, linuxcnc) = (LanguageSettings::mill(), LanguageSettings::linuxcnc());
    for (settings, text, row) in [
        (&mill, "#3011", "parameter = \"3011\""),
        (&mill, "#1000", "parameter = \"1000\""),
        (&linuxcnc, "#<_HAL[pin]>", "parameter = \"_hal[pin]\""),
        (&linuxcnc, "#<_current_pocket>", "parameter = \"_current_pocket\""),
        (&linuxcnc, "#<_depth>", "parameter = \"_depth\""),
    ] {
        let state = InterpreterState::new(settings);
        let dialect = CodeTable::new(settings).dialect;
        let system = System { state: &state, settings, dialect, tools: &[] };
        let mut context = Context::new(dialect.expressions, &system, settings.angle_range);
        let cure = evaluate(text.as_bytes(), 0, &mut context).expect_err("it is not known").cure;
        assert!(cure.contains("[[language.parameters]]") && cure.contains(row), "{text}: {cure}");
    }
}

#[test]
fn section_2_names_linuxcnc() {
    let mut settings = with_offsets(LanguageSettings::linuxcnc());
    check(
        &settings,
        "",
        &[("#<_motion_mode>", 800.0), ("#<_plane>", 170.0), ("#<_task>", 1.0), ("#<_call_level>", 0.0)],
    );
    check(
        &settings,
        "G1 X1 F100\nG18 G91 G20\nG56 T3\nM3 S100 M8",
        &[
            ("#<_motion_mode>", 10.0),
            ("#<_plane>", 180.0),
            ("#<_metric>", 0.0),
            ("#<_imperial>", 1.0),
            ("#<_incremental>", 1.0),
            ("#<_coord_system>", 560.0),
            ("#<_feed>", 100.0),
            ("#<_rpm>", 100.0),
            ("#<_selected_tool>", 3.0),
            ("#<_current_tool>", 0.0),
            ("#<_flood>", 1.0),
            ("#<_spindle_cw>", 1.0),
            ("#<_ABS_X>", 101.0 / 25.4),
            ("#<_value_returned>", 0.0),
        ],
    );
    assert_eq!(value(&settings, "", "#<_hal[pin]>"), Err("PRG-PARAMETER-UNAVAILABLE".to_owned()));
    assert_eq!(value(&settings, "", "#<_mine>"), Err("PRG-PARAMETER-UNSET".to_owned()));
    settings.parameters.named = [("_hal[pin]".to_owned(), 2.0), ("_mine".to_owned(), 3.0)].into();
    check(&settings, "", &[("[#<_hal[pin]>+#<_mine>]", 5.0)]);
}

/// Assigns in order; the values of `texts` behind it, or the code of the first refusal.
fn after(settings: &LanguageSettings, assignments: &[&str], text: &str) -> Result<Value, String> {
    let dialect = CodeTable::new(settings).dialect;
    let mut state = InterpreterState::new(settings);
    for line in assignments {
        let system = System { state: &state, settings, dialect, tools: &[] };
        let mut context = Context::new(dialect.expressions, &system, settings.angle_range);
        let found = assignment(line.as_bytes(), 0, &mut context).map_err(|defect| defect.code.name().to_owned())?;
        let made = assign(&mut state, settings, dialect, &found.target, found.value);
        made.map_err(|refusal| refusal.code.name().to_owned())?;
    }
    let system = System { state: &state, settings, dialect, tools: &[] };
    let mut context = Context::new(dialect.expressions, &system, settings.angle_range);
    let found = evaluate(text.as_bytes(), 0, &mut context);
    found.map(|(value, _)| value).map_err(|defect| defect.code.name().to_owned())
}

#[test]
fn assignments_are_read_back() {
    let mill = LanguageSettings::mill();
    assert_eq!(after(&mill, &["#1=5", "#100=#1*2", "#500=#100+1"], "#500"), Ok(Some(11.0)));
    assert_eq!(after(&mill, &["#1=5", "#1=#0"], "#1"), Ok(None));
    let linuxcnc = LanguageSettings::linuxcnc();
    assert_eq!(after(&linuxcnc, &["#<a>=5", "#<_beta>=[#<A>+1]", "#31=#<_beta>"], "#31"), Ok(Some(6.0)));
    assert_eq!(after(&linuxcnc, &["#5070=1"], "#5070"), Ok(Some(1.0)));
}

#[test]
fn initial_values_hold_until_something_is_assigned() {
    let mut mill = LanguageSettings::mill();
    mill.parameters.numbered.insert(500, 7.0);
    assert_eq!(after(&mill, &[], "#500"), Ok(Some(7.0)));
    assert_eq!(after(&mill, &["#500=8"], "#500"), Ok(Some(8.0)));
    assert_eq!(after(&mill, &["#500=#0"], "#500"), Ok(None));
}

#[test]
fn section_2_values_of_the_control_cannot_be_assigned() {
    let read_only = Err("PRG-PARAMETER-READ-ONLY".to_owned());
    for line in ["#0=1", "#5001=1", "#5105=1", "#4001=1", "#1000=1", "#2001=1"] {
        assert_eq!(after(&LanguageSettings::mill(), &[line], "#1"), read_only, "{line}");
    }
    for line in ["#5400=1", "#5420=1", "#<_x>=1", "#<_feed>=1", "#5220=1"] {
        assert_eq!(after(&LanguageSettings::linuxcnc(), &[line], "#1"), read_only, "{line}");
    }
    assert_eq!(after(&LanguageSettings::mill(), &["#34=1"], "#1"), Err("PRG-PARAMETER-NUMBER".to_owned()));
}

#[test]
fn what_assignments_do_to_the_run() {
    let settings = LanguageSettings::mill();
    let dialect = CodeTable::new(&settings).dialect;
    let mut state = InterpreterState::new(&settings);
    for (number, effect) in [
        (100, Effect::Set),
        (3_000, Effect::Alarm(21)),
        (3_006, Effect::Stop),
        (3_003, Effect::Ignored),
        (3_004, Effect::Ignored),
        (1_100, Effect::Ignored),
        (1_132, Effect::Ignored),
    ] {
        let made = assign(&mut state, &settings, dialect, &Target::Numbered(number), Some(21.0));
        assert_eq!(made, Ok(effect), "#{number}");
    }
}
