//! Changes of the feed override with much of the program known ahead: what they read, what they keep, and that they replay.

mod common;

use std::sync::Arc;

use common::changes::{check_limits, wave};
use common::{all_bits, resume, run, snapshots};
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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

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
