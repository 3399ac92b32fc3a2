//! Invariants from program text to setpoints, on random programs.

use crate::common::{resume, run, run_in_pieces, snapshots, validate};
use feedwave_cutting::{Frame, GenerationMode, MachineProfile, PipelineConfig};
use feedwave_motion::CarriedBy;
use feedwave_program::Severity;
use proptest::prelude::*;

fn mill() -> PipelineConfig {
    PipelineConfig::new(MachineProfile::mill())
}

fn lathe() -> PipelineConfig {
    PipelineConfig::new(MachineProfile::lathe())
}

/// A block of a random milling program; coordinates in µm keep the text exact.
#[derive(Clone, Debug)]
enum Block {
    Rapid(i32, i32, i32),
    Line(i32, i32, i32),
    /// Quarter arc of this radius, to the given side, that continues the +X direction when it can.
    Arc(i32, bool),
    Dwell(u32),
    Feed(u32),
    Vibrate(u32, u32),
    Still,
}

fn block() -> impl Strategy<Value = Block> {
    let mm = || -20_000..20_000_i32;
    prop_oneof![
        1 => (mm(), mm(), mm()).prop_map(|(x, y, z)| Block::Rapid(x, y, z)),
        4 => (mm(), mm(), mm()).prop_map(|(x, y, z)| Block::Line(x, y, z)),
        2 => (-50..50_i32, -50..50_i32, -50..50_i32).prop_map(|(x, y, z)| Block::Line(x, y, z)),
        4 => (1_000..15_000_i32, any::<bool>()).prop_map(|(radius, clockwise)| Block::Arc(radius, clockwise)),
        1 => (0..200_u32).prop_map(Block::Dwell),
        1 => (200..20_000_u32).prop_map(Block::Feed),
        1 => (20..50_u32, 2..15_u32).prop_map(|(frequency, amplitude)| Block::Vibrate(frequency, amplitude)),
        1 => Just(Block::Still),
    ]
}

/// Program text; incremental, so that every block is valid wherever it is.
fn text(blocks: &[Block]) -> String {
    let mm = |um: i32| format!("{:.3}", f64::from(um) / 1_000.0);
    let mut text = String::from("G17 G21 G91 M3 S3000 F2000.\n");
    let mut vibrating = false;
    for block in blocks {
        match *block {
            Block::Rapid(x, y, z) => text += &format!("G0 X{} Y{} Z{}\n", mm(x), mm(y), mm(z)),
            Block::Line(x, y, z) => text += &format!("G1 X{} Y{} Z{}\n", mm(x), mm(y), mm(z)),
            Block::Arc(radius, clockwise) => {
                let (code, side) = if clockwise { (2, -radius) } else { (3, radius) };
                // A straight lead-in makes the arc tangent to what is before it.
                text += &format!("G1 X1.\nG{code} X{} Y{} I0. J{}\n", mm(radius), mm(side), mm(side));
            }
            Block::Dwell(ms) => text += &format!("G4 P{ms}\n"),
            Block::Feed(feed) => text += &format!("F{feed}.\n"),
            Block::Vibrate(frequency, amplitude) if !vibrating => {
                vibrating = true;
                text += &format!("G200 F{frequency}. A{:.3}\n", f64::from(amplitude) / 1_000.0);
            }
            Block::Still if vibrating => {
                vibrating = false;
                text += "G201\n";
            }
            Block::Vibrate(..) | Block::Still => {}
        }
    }
    if vibrating {
        text += "G201\n";
    }
    text + "M30\n"
}

fn without_vibration(blocks: &[Block]) -> Vec<Block> {
    blocks.iter().filter(|block| !matches!(block, Block::Vibrate(..))).cloned().collect()
}

fn programs() -> impl Strategy<Value = Vec<Block>> {
    prop::collection::vec(block(), 1..25)
}

fn modes() -> impl Strategy<Value = GenerationMode> {
    prop_oneof![Just(GenerationMode::AlongPath), Just(GenerationMode::Tangential), Just(GenerationMode::ServoSide)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn how_input_and_output_are_cut_makes_no_difference(blocks in programs(), piece in 1..200_usize) {
        let program = text(&blocks);
        let whole = run(&program, &mill());
        let pieces = run_in_pieces(program.as_bytes(), &mill(), piece);
        prop_assert!(whole == pieces);
    }

    #[test]
    fn a_resumed_stream_equals_the_original_bit_for_bit(
        blocks in programs(),
        mode in modes(),
        choice in any::<prop::sample::Index>(),
    ) {
        let program = text(&blocks);
        let config = PipelineConfig { generation_mode: mode, ..mill() };
        let original = run(&program, &config);
        let taken = snapshots(program.as_bytes(), &config);
        let (index, offset, snapshot) = choice.get(&taken);
        let (first, resumed) = resume(program.as_bytes(), &config, *offset, snapshot);
        prop_assert_eq!(first, *index);
        prop_assert_eq!(first as usize + resumed.len(), original.len());
        for k in 0..resumed.len() {
            prop_assert_eq!(original.bits(first as usize + k), resumed.bits(k), "setpoint {}", first as usize + k);
        }
    }

    #[test]
    fn limits_hold_by_finite_differences(blocks in programs(), period_us in prop_oneof![Just(1_000_u32), Just(250), Just(4_000)]) {
        let config = PipelineConfig { interpolation_period_us: period_us, ..mill() };
        let setpoints = run(&text(&without_vibration(&blocks)), &config);
        let period_s = config.period_s();
        for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
            for (k, window) in column.windows(3).enumerate() {
                let velocity = (window[1] - window[0]) / period_s;
                let acceleration = (window[2] - 2.0 * window[1] + window[0]) / (period_s * period_s);
                prop_assert!(velocity.abs() <= axis.max_velocity_per_s * (1.0 + 1e-6), "velocity {velocity} at {k}");
                // Positions of 100 mm carry 1e-14 mm of rounding, four times over.
                let rounding = 1e-13 / (period_s * period_s);
                prop_assert!(
                    acceleration.abs() <= axis.max_acceleration_per_s2 * (1.0 + 1e-6) + rounding,
                    "acceleration {acceleration} of {} at {k}, line {}", axis.name, setpoints.line[k]
                );
            }
        }
    }

    #[test]
    fn the_last_setpoint_is_the_end_of_the_program(blocks in programs(), mode in modes()) {
        let config = PipelineConfig { generation_mode: mode, ..mill() };
        let program = text(&blocks);
        let setpoints = run(&program, &config);
        let (operations, _) = feedwave_program::interpret(program.as_bytes(), config.profile.language.clone());
        let end = operations.iter().rev().find_map(|operation| match &operation.kind {
            feedwave_program::OperationKind::Move(mv) => Some(mv.end),
            _ => None,
        });
        if let Some(end) = end {
            for (column, end) in setpoints.axes.iter().zip(end) {
                prop_assert_eq!(column.last().copied(), Some(end));
            }
        }
    }

    #[test]
    fn the_report_counts_what_the_stream_brings(blocks in programs(), mode in modes()) {
        let config = PipelineConfig { generation_mode: mode, ..mill() };
        let program = text(&blocks);
        let report = validate(&program, &config);
        prop_assert!(report.is_accepted(), "{:?}", report.findings);
        let setpoints = run(&program, &config);
        prop_assert_eq!(report.summary.setpoint_count, setpoints.len() as u64);
        let last_s = (setpoints.len() - 1) as f64 * config.period_s();
        prop_assert!((report.summary.duration_s - last_s).abs() < config.period_s() * 1e-6);
        let shares = report.summary.cutting_time_s + report.summary.rapid_time_s + report.summary.rest_time_s;
        prop_assert!((shares - report.summary.duration_s).abs() < 1e-6);
        prop_assert!((report.summary.path_length_mm - setpoints.path.last().copied().unwrap_or(0.0)).abs() < 1e-6);
    }
}

#[test]
fn a_tangent_chain_runs_through_without_stopping() {
    let program = "G17 G21 G90 G0 X0 Y0 Z0\nG1 X20 F1200\nG3 X30 Y10 I0 J10\nG1 Y30\nM30\n";
    let setpoints = run(program, &mill());
    let cutting: Vec<usize> = (0..setpoints.len()).filter(|&k| setpoints.line[k] >= 2).collect();
    let slowest_inside = cutting
        .iter()
        .filter(|&&k| setpoints.path[k] > 5.0 && setpoints.path[k] < 50.0)
        .map(|&k| setpoints.feed[k])
        .fold(f64::INFINITY, f64::min);
    assert!((slowest_inside - 1200.0).abs() < 1e-6, "{slowest_inside}");
}

#[test]
fn a_plan_for_the_least_time_has_the_commanded_feed() {
    let mut config = mill();
    config.profile.plan_quality = feedwave_cutting::PlanQuality::LeastTime;
    // A gentle curve of short blocks, which no axis limits.
    let mut program = String::from("G17 G21 G90 G64 P0.01 G0 X0 Y0 Z0\nG1 F1200\n");
    for k in 1..=400 {
        let x = 0.1 * f64::from(k);
        program += &format!("X{x:.4} Y{:.4}\n", 2.0 * (0.2 * x).sin());
    }
    for program in
        ["G17 G21 G90 G0 X0 Y0 Z0\nG1 X20 F1200\nG3 X30 Y10 I0 J10\nG1 Y30\nM30\n".to_owned(), program + "M30\n"]
    {
        let setpoints = run(&program, &config);
        let end = setpoints.path[setpoints.len() - 1];
        let inside = (0..setpoints.len()).filter(|&k| (5.0..end - 5.0).contains(&setpoints.path[k]));
        let slowest = inside.map(|k| setpoints.feed[k]).fold(f64::INFINITY, f64::min);
        let cuts = (0..setpoints.len()).filter(|&k| setpoints.line[k] >= 2);
        let fastest = cuts.map(|k| setpoints.feed[k]).fold(0.0, f64::max);
        assert!((slowest - 1200.0).abs() < 1e-6 && (fastest - 1200.0).abs() < 1e-6, "{slowest} to {fastest}");
    }
}

#[test]
fn a_corner_is_a_rest_and_exact() {
    let program = "G17 G21 G90 G1 X20 F1200\nY20\nM30\n";
    let setpoints = run(program, &mill());
    for k in 0..setpoints.len() {
        let on_first = setpoints.axes[1][k] == 0.0;
        let on_second = setpoints.axes[0][k] == 20.0;
        assert!(on_first || on_second, "setpoint {k} cuts the corner");
    }
}

#[test]
fn feed_per_revolution_follows_the_spindle_under_constant_surface_speed() {
    // 100 m/min on a face from X60 to X20 (diameters), 0.2 mm/rev.
    let program = "G50 S4000\nG96 S100 M3\nG0 X60 Z0\nG1 X20 F0.2\nG97 S1000\nM30\n";
    let setpoints = run(program, &lathe());
    let mut compared = 0;
    for k in 1..setpoints.len() {
        // Skip the rest at the end, which already has the speed of the block after it.
        if setpoints.line[k - 1] != 4 || setpoints.feed[k] == 0.0 {
            continue;
        }
        let travelled = setpoints.path[k] - setpoints.path[k - 1];
        let turned = (setpoints.spindle[k] - setpoints.spindle[k - 1]) / 360.0;
        let radius = setpoints.axes[0][k];
        let surface_m_per_min = turned / 1e-3 * 60.0 * std::f64::consts::TAU * radius / 1_000.0;
        assert!(surface_m_per_min > 98.5 && surface_m_per_min < 100.5, "{surface_m_per_min} m/min at radius {radius}");
        // Away from the ends the feed per revolution is the programmed one.
        if radius > 10.5 && radius < 29.5 {
            assert!((travelled / turned - 0.2).abs() < 0.002, "{} mm/rev", travelled / turned);
            compared += 1;
        }
    }
    assert!(compared > 1_000);
}

#[test]
fn a_dwell_lasts_as_long_as_written_and_partial_periods_are_carried() {
    let program = "G21 G1 X1 F6000\nG4 P100\nY2\nM30\n";
    let report = validate(program, &mill());
    let without = validate(&program.replace("G4 P100\n", ""), &mill());
    assert!((report.summary.duration_s - without.summary.duration_s - 0.1).abs() < 1.1e-3);
}

#[test]
fn frames_and_workpiece_carried_axes_are_signs_and_offsets_only() {
    let mut config = mill();
    config.profile.language.work_offsets[0][0] = 100.0;
    config.profile.machine.axes[1].carried_by = CarriedBy::Workpiece;
    let program = "G90 G1 X10 Y20 F3000\nM30\n";
    let machine = run(program, &config);
    let work = run(program, &PipelineConfig { frame: Frame::Work, ..config });
    assert_eq!(work.axes[0].last(), Some(&10.0));
    assert_eq!(machine.axes[0].last(), Some(&110.0));
    assert_eq!(work.axes[1].last(), Some(&20.0));
    assert_eq!(machine.axes[1].last(), Some(&-20.0));
    for k in 0..work.len() {
        assert_eq!(machine.axes[0][k], work.axes[0][k] + 100.0);
        assert_eq!(machine.axes[1][k], -work.axes[1][k]);
    }
}

#[test]
fn impossible_programs_are_refused_with_numbers() {
    let codes = |program: &str, config: &PipelineConfig| -> Vec<String> {
        let report = validate(program, config);
        assert_eq!(report.summary.setpoint_count, 0);
        report.findings.iter().map(|finding| finding.code.to_string()).collect()
    };
    assert!(codes("G1 X10 F1000\nA10\nM30\n", &mill()).contains(&"AXIS-MISSING".to_owned()));
    let mut limited = mill();
    limited.profile.machine.axes[0].travel_max = Some(50.0);
    assert!(codes("G1 X50.001 F1000\nM30\n", &limited).contains(&"AXIS-TRAVEL".to_owned()));
    assert!(codes("G1 X10 F0.0001\nM30\n", &mill()).contains(&"PLAN-TOO-LONG".to_owned()));
    // The speed stands in another block than the one that is found, whose text must not be replaced by it.
    let report = validate("M3 S90000\nG1 X10 F100\nM30\n", &mill());
    let too_fast = report.findings.iter().find(|finding| finding.code == "SPINDLE-SPEED").expect("too fast");
    assert_eq!(too_fast.span.line, 2);
    assert!(too_fast.suggestions.iter().all(|suggestion| suggestion.replacement.is_none()), "{too_fast:?}");
}

#[test]
fn a_speed_that_is_kept_is_the_clamped_one() {
    let config = lathe();
    let limit = config.profile.machine.max_spindle_rev_per_min;
    // 400 m/min at a diameter of 10 mm would be 12 732 rev/min; at X0 it has no limit of its own.
    for (clamp, x, kept) in [("G50 S2000", 10, 2_000.0), ("G50 S9000", 10, limit), ("", 10, limit), ("", 0, limit)] {
        let program = format!("{clamp}\nG0 X{x} Z2\nG96 S400 M3\nG1 Z-5 F0.1\nG97\nG1 Z-10\nM30\n");
        let report = validate(&program, &config);
        assert!(!report.findings.iter().any(|finding| finding.severity == Severity::Error), "{:?}", report.findings);
        let said = report.findings.iter().find(|finding| finding.code == "PRG-SPEED-MISSING").expect("it is said");
        // To the last bit: 2000/60·60 would be beyond the clamp.
        assert_eq!((said.span.line, said.values[0].value), (5, kept), "{program}");
        // What is insisted on is still judged.
        let report = validate(&program.replace("G97", "G97 S12732"), &config);
        assert!(report.findings.iter().any(|finding| finding.code == "SPINDLE-SPEED"), "{:?}", report.findings);
    }
}

#[test]
fn an_axis_that_a_lathe_lacks_may_be_a_word_of_the_drawing() {
    let program = "M3 S500\nG0 X20 Z2\nG1 Z-10 R2 F0.2\nX40 C-1\nZ-30\nM30\n";
    let mut config = lathe();
    let report = validate(program, &config);
    let missing = report.findings.iter().find(|finding| finding.code == "AXIS-MISSING").expect("it has no C");
    assert!(
        missing.suggestions.iter().any(|cure| cure.message.contains("language.plain_drawing_words")),
        "{missing:?}"
    );
    config.profile.language.plain_drawing_words = true;
    let report = validate(program, &config);
    assert!(!report.findings.iter().any(|finding| finding.severity == Severity::Error), "{:?}", report.findings);
    // An axis that turns by itself, or at rapid, is none of the drawing.
    for program in ["M3 S500\nG0 C90\nM30\n", "M3 S500\nG98 G1 C90 F100\nM30\n"] {
        let report = validate(program, &lathe());
        let missing = report.findings.iter().find(|finding| finding.code == "AXIS-MISSING").expect("it has no C");
        assert_eq!(missing.suggestions.len(), 1, "{program}");
    }
    // On a mill they are axes.
    let report = validate("G1 X10 C5 F100\nM30\n", &mill());
    let missing = report.findings.iter().find(|finding| finding.code == "AXIS-MISSING").expect("it has no C");
    assert_eq!(missing.suggestions.len(), 1);
}
