//! A feed hold that begins at any setpoint ends with the next change: the program goes on to its end.

use std::sync::Arc;

use crate::common::machines::{config_of, kinds, kinematics};
use crate::common::{Setpoints, all_bits, run, run_appending};
use feedwave_cutting::{MachineProfile, OverrideChange, Pipeline, PipelineConfig, Step};
use feedwave_program::Axis;

/// Setpoints that a feed hold lasts.
const HOLD: u64 = 400;

/// No axis goes further from one setpoint to the next than it can.
fn assert_no_jump(setpoints: &Setpoints, config: &PipelineConfig, held_at: u64) {
    for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
        let most = axis.max_velocity_per_s * 1e-6 * f64::from(config.interpolation_period_us);
        for (k, pair) in column.windows(2).enumerate() {
            let (step, line) = ((pair[1] - pair[0]).abs(), setpoints.line[k + 1]);
            assert!(
                step <= most * (1.0 + 1e-9),
                "held at {held_at}: {} goes {step} to setpoint {}, line {line}",
                axis.name,
                k + 1
            );
        }
    }
}

/// Holds the feed at every setpoint in turn; the number of those at which a hold was longer than the run without one.
fn hold_everywhere(program: &str, plain_config: &PipelineConfig) {
    let plain = run(program, plain_config);
    let end =
        |index: usize, of: &Setpoints| -> Vec<u64> { of.axes.iter().map(|column| column[index].to_bits()).collect() };
    let mut held = 0;
    for index in 1..plain.len() as u64 {
        let mut config = plain_config.clone();
        config.overrides =
            vec![OverrideChange { index, ratio: 0.0 }, OverrideChange { index: index + HOLD, ratio: 1.0 }];
        let changed = run(program, &config);
        assert_no_jump(&changed, &config, index);
        assert_eq!(end(changed.len() - 1, &changed), end(plain.len() - 1, &plain), "held at {index}");
        held += usize::from(changed.len() > plain.len());
    }
    assert!(2 * held > plain.len(), "{held} of {} holds made the run longer", plain.len());
}

#[test]
fn before_within_and_behind_a_vibrating_section_with_a_change_of_the_spindle_speed() {
    let program = "G21 G97 S1000 M3\nG0 X6. Z2.\nG200 F41.66666667 A0.01\nG1 Z2.2 F0.05\nS1200\nG1 Z2.4\nG201\nG4 X0.02\n\
                   G1 Z3. F0.2\nG0 X8.\nM30\n";
    hold_everywhere(program, &PipelineConfig::new(MachineProfile::lathe()));
}

#[test]
fn in_the_parts_of_a_section_and_between_sections() {
    let program = "G21 G90 G17 M3 S3000\nG0 X0 Y0 Z5\nG1 Z4 F2000\nG200 F40 A0.02\nG1 X3 F1500\nY3\nG201\nS2500\nG1 X0\n\
                   G200 F40 A0.02\nG1 Y0\nG201\nG0 Z10\nM30\n";
    hold_everywhere(program, &PipelineConfig::new(MachineProfile::mill()));
}

#[test]
fn where_nothing_vibrates_and_the_path_rests() {
    let program = "G21 G90 G17 M3 S3000\nG0 X0 Y0 Z5\nG4 P20\nG1 Z4 F2000\nG4 P20\nS2000\nG1 X3\nM0\nY3\nG0 Z10\nM30\n";
    hold_everywhere(program, &PipelineConfig::new(MachineProfile::mill()));
}

#[test]
fn before_and_behind_threads_and_taps() {
    let lathe = PipelineConfig::new(MachineProfile::lathe());
    for pass in ["G32 Z6. F1.5 Q144.18", "G165 P3 X9.5 Q1.2\nG32 Z6. F1.5\nG165 P0"] {
        let program = format!("G21 G99 G97 S728 M3\nG0 X14. Z10.\nX9.5\n{pass}\nG0 X14.\nM30\n");
        hold_everywhere(&program, &lathe);
    }
    let tap = "G21 G90 G17 G94 M3 S1200\nG0 X0 Y0 Z5\nM29 S1200\nG84 X2 Y0 Z-2 R1 F1500\nG80\nG0 X0\nM30\n";
    hold_everywhere(tap, &PipelineConfig::new(MachineProfile::mill()));
}

/// A rapid move that a hold finds braking stops at its end, before the section begins.
#[test]
fn before_a_section_under_tool_centre_point_control_on_every_kind_of_machine() {
    for (_, description) in kinds() {
        let config = config_of(description);
        let [l, m] = kinematics(&config).letters().1.map(Axis::letter);
        let program = format!(
            "T1 M6\nG21 G90 M3 S600\nG43.4 H1\nG0 X0 Y0 Z20 {l}3 {m}-6\nG200 F8 A0.006\n\
             G1 X0.3 Y0.4 Z20.1 {l}3.2 {m}-5.9 F600\nG201\nG49\nM30\n"
        );
        hold_everywhere(&program, &config);
    }
}

/// Every setpoint of a pipeline that is taken up from a snapshot of itself each 13 setpoints.
fn run_over_snapshots(program: &str, config: &PipelineConfig) -> Setpoints {
    let config = Arc::new(config.clone());
    let mut pipeline = Pipeline::new(Arc::clone(&config));
    let mut setpoints = Setpoints::default();
    let mut block = pipeline.new_block();
    loop {
        match pipeline.next_setpoints(&mut block, 13) {
            Step::Block => {
                setpoints.append(&block);
                let snapshot = pipeline.snapshot().expect("plain data");
                pipeline = Pipeline::restore(Arc::clone(&config), &snapshot).expect("a snapshot just taken");
                block = pipeline.new_block();
            }
            Step::NeedInput(place) => pipeline.supply(place, program.as_bytes()),
            Step::Finished => return setpoints,
            Step::Refused => panic!("refused: {:#?}", pipeline.findings()),
        }
    }
}

/// A hold that begins at the end of a rapid move waits before what is to be done there, and may be changed again.
#[test]
fn a_hold_before_a_section_is_taken_up_anywhere() {
    let program = "G21 G97 S1000 M3\nG0 X6. Z2.\nG200 F41.66666667 A0.01\nG1 Z2.1 F0.05\nS1200\nG1 Z2.2\nG201\nM30\n";
    let mut config = PipelineConfig::new(MachineProfile::lathe());
    let plain = run(program, &config);
    for index in (1..plain.len() as u64).step_by(3) {
        config.overrides = [(0, 0.0), (HOLD, 0.0), (2 * HOLD, 0.7), (2 * HOLD + 5, 0.0), (3 * HOLD, 1.0)]
            .map(|(later, ratio)| OverrideChange { index: index + later, ratio })
            .to_vec();
        let whole = all_bits(&run(program, &config));
        assert!(all_bits(&run_over_snapshots(program, &config)) == whole, "held at {index}");
    }
}

/// Whether the end of a hold is known as it begins or comes when much of it was handed out is the same to the bit.
#[test]
fn a_long_hold_before_a_thread_or_tap_is_the_same_whenever_its_end_is_known() {
    let thread = "G21 G90 G99 G97 S728 M3\nG0 X14. Z10.\nX9.5\nG32 Z6. F1.5\nG0 X14.\nM30\n";
    let tap = "G21 G90 G17 G94 M3 S1234\nG0 X0 Y0 Z5\nM29 S1234\nG84 X2 Y0 Z-2 R1 F1500\nG80\nG0 X0\nM30\n";
    for (program, profile) in [(thread, MachineProfile::lathe()), (tap, MachineProfile::mill())] {
        let plain_config = PipelineConfig::new(profile);
        let plain = run(program, &plain_config);
        for index in (1..plain.len() as u64).step_by(7) {
            let overrides =
                [(0, 0.0), (3_333, 1.0)].map(|(later, ratio)| OverrideChange { index: index + later, ratio });
            let config = PipelineConfig { overrides: overrides.to_vec(), ..plain_config.clone() };
            let known = all_bits(&run(program, &config));
            assert!(all_bits(&run_appending(program, &plain_config, &overrides, 100)) == known, "held at {index}");
        }
    }
}
