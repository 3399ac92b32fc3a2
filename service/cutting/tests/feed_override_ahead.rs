//! Changes of the feed override with much of the program known ahead: what they read, what they keep, and that they replay.

use std::sync::Arc;

use crate::common::changes::{check_limits, wave};
use crate::common::{all_bits, resume, run, snapshots};
use feedwave_cutting::{MachineProfile, OverrideChange, Pipeline, PipelineConfig, PlanQuality, SetpointBlock, Step};
use proptest::prelude::*;

fn config(quality: PlanQuality, overrides: &[(u64, f64)]) -> PipelineConfig {
    let overrides = overrides.iter().map(|&(index, ratio)| OverrideChange { index, ratio }).collect();
    let profile = MachineProfile { plan_quality: quality, ..MachineProfile::mill() };
    PipelineConfig { overrides, ..PipelineConfig::new(profile) }
}

/// The next setpoint, and how many pieces of the program were read for it.
fn next(pipeline: &mut Pipeline, block: &mut SetpointBlock, program: &str) -> usize {
    for pieces in 0.. {
        match pipeline.next_setpoints(block, 1) {
            Step::Block => return pieces,
            Step::NeedInput(place) => {
                let from = place.offset as usize;
                pipeline.supply(place, &program.as_bytes()[..program.len().min(from + 200)]);
            }
            other => panic!("{other:?}"),
        }
    }
    unreachable!("a program has an end")
}

#[test]
fn a_change_waits_for_little_more_of_the_program() {
    // 200 setpoints are 3.3 mm at 1000 mm/min, 17 blocks; a piece has twelve of the 900.
    let program = wave().replace("F20000", "F1000");
    for quality in [PlanQuality::Fast, PlanQuality::LeastTime] {
        let mut pipeline = Pipeline::new(Arc::new(config(quality, &[])));
        let mut block = pipeline.new_block();
        while pipeline.next_index() < 500 {
            next(&mut pipeline, &mut block, &program);
        }
        for ratio in [0.8, 1.2, 1.0, 0.0] {
            let mut pipeline = pipeline.clone();
            pipeline.append_override(OverrideChange { index: 500, ratio }).expect("in time");
            let pieces: usize = (0..200).map(|_| next(&mut pipeline, &mut block, &program)).sum();
            assert!(pieces <= 8, "{pieces} to {ratio}, {quality:?}");
            // And on from a hold.
            if ratio == 0.0 {
                pipeline.append_override(OverrideChange { index: 700, ratio: 1.0 }).expect("in time");
                let pieces: usize = (0..200).map(|_| next(&mut pipeline, &mut block, &program)).sum();
                assert!(pieces <= 8, "{pieces} from a hold, {quality:?}");
            }
        }
    }
}

/// Changes some setpoints apart, and the feed as programmed at last.
fn changes() -> impl Strategy<Value = Vec<(u64, f64)>> {
    let ratio = prop_oneof![4 => 0.05..2.0_f64, 1 => Just(0.0), 1 => Just(1.0)];
    prop::collection::vec((1..150_u64, ratio), 1..12).prop_map(|steps| {
        let mut index = 0;
        let mut changes: Vec<_> = steps
            .into_iter()
            .map(|(step, ratio)| {
                index += step;
                (index, ratio)
            })
            .collect();
        changes.push((index + 50, 1.0));
        changes
    })
}

/// Legs that run back and forth over a short step, which are joined in U-turns.
fn raster([leg_mm, step_mm, skew]: [f64; 3], tolerance_mm: f64, feed: f64) -> String {
    let mut program = format!("G21 G90 G94 G17 G64 P{tolerance_mm:.3}\nG0 X0 Y0 Z0\nG1 F{feed:.0}\n");
    for leg in 0..6 {
        let (y, x) = (step_mm * f64::from(leg), if leg % 2 == 0 { leg_mm } else { 0.0 });
        program += &format!("X{x:.4} Y{:.4}\nX{x:.4} Y{:.4}\n", y + skew * leg_mm, y + skew * leg_mm + step_mm);
    }
    program + "M30\n"
}

/// On axes that are slow enough to be at their limits there.
fn on_slow_axes(mut config: PipelineConfig) -> PipelineConfig {
    for axis in &mut config.profile.machine.axes {
        (axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3) = (200.0, 2_000.0, 30_000.0);
    }
    config
}

/// A hold from which the path still has to turn: where the plan is slower than was thought when its knots were placed, they are far
/// apart in time, and the limits are kept between them as well.
#[test]
fn a_hold_before_a_turn_keeps_the_limits_within_it() {
    let program = raster([13.061, 0.0937, 0.0], 0.02, 12_000.0);
    for index in (16..1_000).step_by(100) {
        let changes = [(index, 0.0), (index + 2_600, 1.0)];
        let config = on_slow_axes(config(PlanQuality::LeastTime, &changes));
        let config = PipelineConfig { interpolation_period_us: 250, ..config };
        check_limits(&run(&program, &config), &config).unwrap();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_changes_among_turns_keep_the_limits_at_every_period_and_resume_bit_for_bit(
        size in [1.0..20.0_f64, 0.03..2.0_f64, -0.05..0.05_f64],
        (tolerance_mm, feed) in (0.005..0.1_f64, 2_000.0..20_000.0_f64),
        changes in changes(),
        period_us in prop_oneof![Just(250_u32), Just(1_000), Just(4_000)],
        is_fast: bool,
    ) {
        let quality = if is_fast { PlanQuality::Fast } else { PlanQuality::LeastTime };
        let (program, config) = (raster(size, tolerance_mm, feed), on_slow_axes(config(quality, &changes)));
        let config = PipelineConfig { interpolation_period_us: period_us, ..config };
        let whole = run(&program, &config);
        check_limits(&whole, &config)?;
        let whole = all_bits(&whole);
        for (index, offset, snapshot) in snapshots(program.as_bytes(), &config) {
            let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
            prop_assert_eq!(first, index);
            prop_assert_eq!(&all_bits(&rest)[..], &whole[index as usize..]);
        }
    }

    #[test]
    fn any_changes_among_short_blocks_keep_the_limits_at_every_period(
        changes in changes(), period_us in prop_oneof![Just(250_u32), Just(1_000), Just(4_000)], is_fast: bool,
    ) {
        let quality = if is_fast { PlanQuality::Fast } else { PlanQuality::LeastTime };
        let config = PipelineConfig { interpolation_period_us: period_us, ..config(quality, &changes) };
        check_limits(&run(&wave(), &config), &config)?;
    }

    #[test]
    fn any_changes_among_short_blocks_resume_bit_for_bit(changes in changes(), is_fast: bool) {
        let quality = if is_fast { PlanQuality::Fast } else { PlanQuality::LeastTime };
        let (program, config) = (wave(), config(quality, &changes));
        let whole = all_bits(&run(&program, &config));
        for (index, offset, snapshot) in snapshots(program.as_bytes(), &config) {
            let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
            prop_assert_eq!(first, index);
            prop_assert_eq!(&all_bits(&rest)[..], &whole[index as usize..]);
        }
    }
}
