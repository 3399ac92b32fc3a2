//! The edges: ends of sections and of programs, a spindle at the axis or at rest, and hostile sizes.

use std::sync::Arc;

use crate::common::{run, validate};
use feedwave_cutting::{
    GenerationMode, MachineProfile, OverrideChange, Pipeline, PipelineConfig, ServoCondition, ServoWave, Step,
    Validation, VibrationEnvelope, fill_servo_positions,
};

fn mill() -> PipelineConfig {
    PipelineConfig::new(MachineProfile::mill())
}

fn lathe() -> PipelineConfig {
    PipelineConfig::new(MachineProfile::lathe())
}

fn with_mode(generation_mode: GenerationMode) -> PipelineConfig {
    PipelineConfig { generation_mode, ..mill() }
}

const ENVELOPES: [VibrationEnvelope; 2] = [VibrationEnvelope::Blended, VibrationEnvelope::Published];

#[test]
fn the_offset_column_is_what_the_clamps_leave() {
    let program = "G21 G90 M3 S1000\nG200 F50. A0.03\nG1 X1. F60.\nG201\nM30\n";
    for mode in [GenerationMode::AlongPath, GenerationMode::Tangential] {
        for vibration_envelope in ENVELOPES {
            let setpoints = run(program, &PipelineConfig { vibration_envelope, ..with_mode(mode) });
            for k in 0..setpoints.len() {
                let offset = setpoints.axes[0][k] - setpoints.path[k];
                assert!((offset - setpoints.vibration[k]).abs() < 1e-12, "{mode:?} {k}: {offset}");
            }
        }
    }
}

/// Largest step of a drive that generates the vibration of this program's first axis itself.
fn largest_drive_step_mm(program: &str, substeps: usize, vibration_envelope: VibrationEnvelope) -> f64 {
    let config = PipelineConfig { vibration_envelope, ..with_mode(GenerationMode::ServoSide) };
    let mut pipeline = Pipeline::new(Arc::new(config.clone()));
    pipeline.push(program.as_bytes());
    pipeline.finish_input();
    let mut block = pipeline.new_block();
    let mut previous: Option<ServoCondition> = None;
    let (mut last_mm, mut largest_mm) = (0.0, 0.0_f64);
    let (mut wave, mut positions_mm) = (vec![0.0; substeps], vec![0.0; substeps]);
    while pipeline.next_block(&mut block) == Step::Block {
        let servo = block.servo.as_ref().expect("conditions are streamed in this mode");
        for k in 0..block.len() {
            let current = ServoCondition {
                commanded_mm: block.axes[0][k],
                signed_amplitude_mm: servo.amplitude_mm[0][k],
                clamp_low_mm: servo.clamp_low_mm[0][k],
                clamp_high_mm: servo.clamp_high_mm[0][k],
            };
            let (frequency_hz, phase_turns) = (servo.frequency_hz[k], servo.phase_turns[k]);
            let on = ServoWave { on: frequency_hz > 0.0, frequency_hz, phase_turns };
            if let Some(previous) = previous {
                let period = on.fill(config.period_s(), &mut wave);
                fill_servo_positions(&previous, &current, &wave, period, &mut positions_mm);
                for &position_mm in &positions_mm {
                    largest_mm = largest_mm.max((position_mm - last_mm).abs());
                    last_mm = position_mm;
                }
            }
            previous = Some(current);
        }
    }
    largest_mm
}

#[test]
fn a_drive_arrives_at_the_end_of_a_section_without_a_jump() {
    // Feed 1 mm/s and vibration 2π·50·0.03 = 9.42 mm/s, for an eighth of a millisecond.
    let fastest_step_mm = (1.0 + 9.43) * 1e-3 / 8.0;
    for length_um in (1_000..1_052).step_by(2) {
        let length_mm = f64::from(length_um) / 1_000.0;
        let program = format!("G21 G90 M3 S1000\nG200 F50. A0.03\nG1 X{length_mm:.3} F60.\nG201\nM30\n");
        for envelope in ENVELOPES {
            let step_mm = largest_drive_step_mm(&program, 8, envelope);
            assert!(step_mm <= fastest_step_mm, "{step_mm} mm in one servo period with a section of {length_mm} mm");
        }
    }
}

#[test]
fn a_speed_change_on_a_straight_line_is_no_corner() {
    let program = "G21 G90 M3 S1000\nG200 F5. A0.03\nG1 X0.973 F60.\nS1100\nX2.\nG201\nM30\n";
    let rest_s = |mode| validate(program, &with_mode(mode)).summary.rest_time_s;
    assert_eq!(rest_s(GenerationMode::Tangential), rest_s(GenerationMode::AlongPath));
}

#[test]
fn a_spindle_speed_of_zero_ends_a_section() {
    let program = "G98 M3 S1000\nG200 F50 A0.03\nG1 Z-1 F100\nS0\nG1 Z-2\nG201\nM30\n";
    assert_eq!(validate(program, &lathe()).summary.section_count, 2);
}

#[test]
fn a_dwell_turns_the_spindle_no_faster_than_the_machine_can() {
    let program = "G98 G96 S100 M3\nG0 X0 Z0\nG1 Z-1 F100\nG4 P100\nG1 Z-2\nM30\n";
    let setpoints = run(program, &lathe());
    for line in [3, 4] {
        let of_line: Vec<f64> =
            (0..setpoints.len()).filter(|&k| setpoints.line[k] == line).map(|k| setpoints.spindle[k] / 360.0).collect();
        let turned = of_line[of_line.len() - 1] - of_line[0];
        let rev_per_min = turned / ((of_line.len() - 1) as f64 * 1e-3) * 60.0;
        assert!((rev_per_min - 5_000.0).abs() < 1e-6, "{rev_per_min} rev/min in line {line}");
    }
}

#[test]
fn the_summary_knows_the_machines_highest_spindle_speed() {
    for end in ["0.1", "0", "-10"] {
        let report = validate(&format!("G96 S100 M3\nG0 X10 Z0\nG1 X{end} F0.1\nM30\n"), &lathe());
        let [least, most] = report.summary.spindle_rev_per_min.expect("it turns");
        assert!((least - 100_000.0 / (10.0 * std::f64::consts::PI)).abs() < 1e-9);
        assert_eq!(most, 5_000.0, "to X{end}");
    }
}

#[test]
fn what_follows_the_end_is_looked_at_however_the_input_is_cut() {
    let program = "G21 G90 G1 X1 F600\nM30\nG1 X5\nG1 X6\n";
    let whole = validate(program, &mill());
    assert!(whole.findings.iter().any(|finding| finding.code == "PRG-TRAILING"));
    for piece in 1..program.len() {
        let mut validation = Validation::new(Arc::new(mill()));
        loop {
            match validation.step() {
                Step::NeedInput(place) => {
                    let end = program.len().min(place.offset as usize + piece);
                    validation.supply(place, &program.as_bytes()[..end]);
                }
                Step::Finished => break,
                Step::Block | Step::Refused => {}
            }
        }
        assert_eq!(validation.finish(), whole, "in pieces of {piece}");
    }
}

#[test]
fn a_report_lists_a_bounded_number_of_tools() {
    let changes: String = (1..=5_000).map(|tool| format!("T{tool} M6\n")).collect();
    let report = validate(&format!("G21\n{changes}M30\n"), &mill());
    assert_eq!(report.summary.tools, (1..=1_000).collect::<Vec<u32>>());
}

/// A straight section of `count` blocks of `block_mm` each.
fn fine_section(count: usize, block_mm: &str, amplitude_mm: f64) -> String {
    let blocks = format!("X{block_mm}\n").repeat(count);
    format!("G21 G91 M3 S1000 F60.\nG200 F2. A{amplitude_mm:.1}\nG1\n{blocks}G201\nM30\n")
}

#[test]
fn an_amplitude_over_hundreds_of_blocks_is_the_straight_motion_it_would_be_in_one() {
    let setpoints = run(&fine_section(2_000, "0.001", 0.5), &mill());
    let mut went_back = false;
    for k in 0..setpoints.len() {
        let x = setpoints.axes[0][k];
        assert!((x - (setpoints.path[k] + setpoints.vibration[k])).abs() < 1e-9, "setpoint {k}");
        assert!((0.0..=2.0).contains(&x));
        went_back |= k > 0 && x < setpoints.axes[0][k - 1] - 1e-3;
    }
    assert!(went_back && setpoints.len() > 2_000);
}

#[test]
fn more_blocks_within_an_amplitude_than_memory_should_hold_are_refused() {
    let report = validate(&fine_section(20_000, "0.000001", 1.0), &mill());
    let finding = report.findings.iter().find(|finding| finding.code == "VIB-BLOCKS-TOO-SHORT").expect("refused");
    assert_eq!((finding.values[0].value, report.is_accepted()), (16_384.0, false));
    let report = validate(&fine_section(20_000, "0.001", 1.0), &mill());
    assert!(report.is_accepted(), "{:?}", report.findings);
}

#[test]
fn numbers_too_small_to_mean_anything_never_make_a_figure_infinite() {
    let tiny = format!("0.{}1", "0".repeat(315));
    for program in [
        format!("G98 M3 S{tiny}\nG200 F50 A0.03\nG1 Z-1 F100\nG201\nM30\n"),
        format!("M3 S1000\nG1 Z-1 F{tiny}\nM30\n"),
        format!("G50 S{tiny}\nG96 M3 S100\nG1 X1 Z-1 F100\nM30\n"),
        format!("G50 S3000\nG98 G96 M3 S{tiny}\nG200 F50 A0.03\nG1 X1 Z-1 F100\nG201\nM30\n"),
        format!("G98 M3 S1000\nG200 F{tiny} A0.03\nG1 Z-1 F100\nX5\nG201\nM30\n"),
        format!("G98 M3 S1000\nG200 F50 A{tiny}\nG1 Z-1 F100\nG201\nM30\n"),
    ] {
        let config = PipelineConfig { generation_mode: GenerationMode::Tangential, ..lathe() };
        let report = validate(&program, &config);
        for finding in &report.findings {
            assert!(finding.values.iter().all(|value| value.value.is_finite()), "{finding:?}");
        }
        let text = format!("{:?}", report.sections);
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    }
}

#[test]
fn a_section_that_an_error_kept_from_running_does_not_say_that_nothing_was_clamped() {
    let program = "G98 M3 S1000\nG200 F50 A0.03\nG1 Z-0.00001 F100\nG4 X100000\nG201\nM30\n";
    for (program, clamping) in
        [(program.to_owned(), "dominate"), (program.replace("G4 X100000\n", ""), "100 % of its setpoints")]
    {
        let published = PipelineConfig { vibration_envelope: VibrationEnvelope::Published, ..lathe() };
        let report = validate(&program, &published);
        let short = report.findings.iter().find(|finding| finding.code == "VIB-TRAVEL-SHORT").expect("it is short");
        assert!(short.message.contains(clamping), "{}", short.message);
        assert_eq!(short.suggestions[0].value, None, "an amplitude of 0 is no cure");
    }
}

#[test]
fn a_spline_with_a_cusp_is_refused_where_it_is() {
    let config = PipelineConfig::new(MachineProfile::mill());
    // Out and back over the same control point.
    let report = validate("G21 G17 F600\nG0 X0 Y0\nG5.1 X0 Y0 I10 J0\nM30\n", &config);
    let finding = report.findings.iter().find(|finding| finding.code == "PATH-SPLINE-CUSP").expect("refused");
    assert_eq!((finding.span.line, finding.severity), (3, feedwave_program::Severity::Error));
}

#[test]
fn a_block_ends_at_every_change_of_the_feed_override_so_that_the_caller_can_stop_there() {
    let overrides = (0..50).map(|k| OverrideChange { index: 10 * k, ratio: 0.5 + 0.01 * k as f64 }).collect();
    let config = PipelineConfig { overrides, ..PipelineConfig::new(MachineProfile::mill()) };
    let mut pipeline = Pipeline::new(Arc::new(config));
    let mut block = pipeline.new_block();
    pipeline.push(b"G21 G90 G94 G1 X100. F3000.\nM30\n");
    pipeline.finish_input();
    let mut next = 0;
    while pipeline.next_block(&mut block) == Step::Block {
        assert!(!block.is_empty() && block.first_index == next);
        next += block.len() as u64;
        assert!(next > 490 || next % 10 == 0, "{next}");
    }
    assert!(next > 1_000, "{next}");
}

#[test]
fn a_section_ends_exactly_however_far_the_end_is_from_its_start() {
    // The offset at the end is an ulp above zero, and path lengths of 100 mm round to 1e-14 mm.
    let program = "G17 G21 G91 M3 S3000 F2000.\n\
        G200 F36. A0.004\n\
        G1 X7.690 Y-3.480 Z-15.107\n\
        F10184.\n\
        G1 X1.\n\
        G3 X6.809 Y6.809 I0. J6.809\n\
        G1 X1.\n\
        G2 X3.014 Y-3.014 I0. J-3.014\n\
        G0 X0.000 Y5.009 Z6.254\n\
        G1 X1.\n\
        G3 X9.417 Y9.417 I0. J9.417\n\
        G4 P141\n\
        G1 X8.762 Y2.872 Z-18.923\n\
        G1 X2.201 Y13.724 Z7.772\n\
        G1 X-0.036 Y-0.045 Z0.006\n\
        G1 X1.\n\
        G2 X3.410 Y-3.410 I0. J-3.410\n\
        G1 X-9.977 Y8.625 Z19.549\n\
        G1 X0.031 Y0.005 Z0.020\n\
        G201\n\
        M30\n";
    let setpoints = run(program, &mill());
    let (operations, _) = feedwave_program::interpret(program.as_bytes(), mill().profile.language);
    let mut moves = operations.iter().filter_map(|operation| match &operation.kind {
        feedwave_program::OperationKind::Move(step) => Some(step.end),
        _ => None,
    });
    let end = moves.next_back().expect("it moves");
    let last: Vec<f64> = setpoints.axes.iter().map(|column| column[setpoints.len() - 1]).collect();
    assert_eq!(last, end[..3]);
}
