//! Feed override and feed hold: when changes, where does not.

use std::sync::Arc;

use crate::common::changes::{check_limits, wave};
use crate::common::{Setpoints, all_bits, resume, run, snapshots};
use feedwave_cutting::{AppendError, MachineProfile, OverrideChange, Pipeline, PipelineConfig, PlanQuality, Step};
use proptest::prelude::*;

/// Lines with corners, a tangent arc, short blocks, a change of feed, a dwell.
const PART: &str = "G21 G90 G94 G17 G0 X0 Y0 Z5\nG1 Z0 F3000\nX30 F2400\nG3 X40 Y10 R10\nG1 Y30\nX10 Y30\n\
X9.9\nX9.8\nX9.7\nX9.6\nX9.5\nX9.4\nG4 P50\nG1 X0 Y20 F1200\nY0\nM30\n";

fn config(overrides: &[(u64, f64)]) -> PipelineConfig {
    let overrides = overrides.iter().map(|&(index, ratio)| OverrideChange { index, ratio }).collect();
    PipelineConfig { overrides, ..PipelineConfig::new(MachineProfile::mill()) }
}

/// Positions over path length of a run, to look up by bisection.
fn check_same_path(changed: &Setpoints, plain: &Setpoints) -> Result<(), TestCaseError> {
    let last = |setpoints: &Setpoints| setpoints.bits(setpoints.len() - 1)[..4].to_vec();
    prop_assert_eq!(last(changed), last(plain), "the end is the same to the bit");
    for (k, pair) in changed.path.windows(2).enumerate() {
        prop_assert!(pair[1] >= pair[0], "back from {} to {} at {k}", pair[0], pair[1]);
    }
    // Between two setpoints of the other run that lie on one line, the position follows the path length.
    for k in 0..changed.len() {
        let s = changed.path[k];
        let after = plain.path.partition_point(|&other| other < s).clamp(1, plain.len() - 1);
        let (s0, s1) = (plain.path[after - 1], plain.path[after]);
        let share = if s1 > s0 { (s - s0) / (s1 - s0) } else { 0.0 };
        let distance = (0..3).map(|axis| {
            let column = &plain.axes[axis];
            let between = column[after - 1] + share * (column[after] - column[after - 1]);
            (changed.axes[axis][k] - between).powi(2)
        });
        // On the arc of 10 mm a chord of one period lies (0.04 mm)²/80 beside it, at a corner half a chord.
        let distance = distance.sum::<f64>().sqrt();
        prop_assert!(distance <= 0.5 * (s1 - s0) + 1e-9, "{distance} beside the path at {k}");
    }
    Ok(())
}

#[test]
fn the_feed_follows_the_override_and_the_path_does_not() {
    let plain = run(PART, &config(&[]));
    for ratio in [0.1, 0.5, 1.5, 2.0] {
        let changed_config = config(&[(300, ratio)]);
        let changed = run(PART, &changed_config);
        check_same_path(&changed, &plain).unwrap();
        check_limits(&changed, &changed_config).unwrap();
        // Not a bit of what was handed out changes.
        assert!((0..=300).all(|k| changed.bits(k) == plain.bits(k)));
        let top = changed.feed[500..].iter().copied().fold(0.0, f64::max);
        assert!((top - 2_400.0 * ratio).abs() < 1e-6 || ratio > 1.0, "{top} at {ratio}");
        assert!(top <= 2_400.0 * ratio + 1e-6, "{top} at {ratio}");
        assert_eq!(changed.len() > plain.len(), ratio < 1.0);
    }
}

#[test]
fn feed_hold_stops_on_the_path_and_goes_on() {
    let plain = run(PART, &config(&[]));
    for start in [0, 100, 250, 300, 700, 1_000, 1_400] {
        let held_config = config(&[(start, 0.0), (start + 400, 1.0)]);
        let held = run(PART, &held_config);
        check_same_path(&held, &plain).unwrap();
        check_limits(&held, &held_config).unwrap();
        // 40 mm/s are braked within 40/10 000 + 10 000/5e6 s; a braking in progress may end first, and the dwell lasts.
        let rest = &held.path[start as usize + 150..start as usize + 400];
        assert!(rest.windows(2).all(|pair| pair[0] == pair[1]), "moves while held from {start} on");
        assert!(held.len() > plain.len() + 200);
    }
}

#[test]
fn a_vibrating_section_stays_on_its_path_through_hold_and_override() {
    let program =
        "G21 G97 S1000 M3\nG0 X6. Z10.\nG200 F41.667 A0.03\nG1 X10. Z20. F0.05\nG2 X14.02 Z23.51 R4.\nG201\nM30\n";
    let lathe = |overrides: &[(u64, f64)]| {
        let overrides = overrides.iter().map(|&(index, ratio)| OverrideChange { index, ratio }).collect();
        PipelineConfig { overrides, ..PipelineConfig::new(MachineProfile::lathe()) }
    };
    let plain = run(program, &lathe(&[]));
    let changed = run(program, &lathe(&[(2_000, 0.5), (4_000, 0.0), (5_000, 1.2), (9_000, 0.0), (9_500, 1.0)]));
    let end = |setpoints: &Setpoints| [0, 1].map(|axis| setpoints.axes[axis].last().unwrap().to_bits());
    assert_eq!(end(&changed), end(&plain));
    // While held, the tool vibrates on about the place where the feed rests.
    assert!(changed.path[4_100..4_999].windows(2).all(|pair| pair[0] == pair[1]));
    let about = &changed.vibration[4_100..4_999];
    assert!(about.iter().any(|offset| *offset > 0.029) && about.iter().any(|offset| *offset < -0.029));
    // In along-path mode the place is a function of path position and offset: on the line X = 3 + (Z − 10)/5.
    for k in 0..changed.len() {
        let (x, z) = (changed.axes[0][k], changed.axes[1][k]);
        if changed.line[k] == 4 && (10.1..19.9).contains(&z) {
            assert!((x - (3.0 + (z - 10.0) / 5.0)).abs() < 1e-9, "{x} {z} at {k}");
        }
    }
}

/// A vibration that reaches over many blocks, under changes in the middle of blocks and with little looked ahead.
fn long_vibration() -> (String, PipelineConfig) {
    let blocks: String = (1..=600).map(|block| format!("G1 X{:.1}\n", 0.1 * f64::from(block))).collect();
    let program = format!("G21 G90 G94 G17 S600 M3\nG0 X0 Y0 Z0\nF600\nG200 F20 A0.45\n{blocks}G201\nM30\n");
    let changes = (1..40).map(|change| (137 * change, [0.4, 1.9, 0.0, 1.3, 0.7][change as usize % 5]));
    let mut config = config(&changes.collect::<Vec<_>>());
    config.profile.look_ahead_blocks = 4;
    (program, config)
}

#[test]
fn a_vibration_finds_its_path_beyond_a_block_that_an_override_divided() {
    let (program, config) = long_vibration();
    let setpoints = run(&program, &config);
    let amplitude_mm = 0.45;
    let first = setpoints.vibration.iter().position(|offset| *offset != 0.0).unwrap() - 1;
    let (start_mm, end_mm) = (setpoints.path[first], setpoints.path.last().unwrap());
    let mut inside = Vec::new();
    for k in first..setpoints.len() {
        // The place is that on the path, wherever the blocks end.
        let place_mm = setpoints.path[k] - start_mm;
        assert!((setpoints.axes[0][k] - place_mm - setpoints.vibration[k]).abs() < 1e-9, "setpoint {k}");
        // Beyond two vibrations at 600 mm/min from its ends the vibration is whole.
        if place_mm > 1.0 && setpoints.path[k] < end_mm - 1.0 {
            let wave = feedwave_cutting::sin_turns(20.0 * (k - first) as f64 * 1e-3);
            assert!(
                (setpoints.vibration[k] - amplitude_mm * wave).abs() < 1e-9,
                "setpoint {k}: {} instead of {} at {place_mm}",
                setpoints.vibration[k],
                amplitude_mm * wave
            );
            inside.push(setpoints.axes[0][k]);
        }
    }
    assert!(inside.len() > 4_000, "{}", inside.len());
    check_limits(&Setpoints { axes: vec![inside], ..Setpoints::default() }, &config).unwrap();
}

#[test]
fn a_long_vibration_resumes_bit_for_bit() {
    let (program, config) = long_vibration();
    let whole = run(&program, &config);
    let taken = snapshots(program.as_bytes(), &config);
    assert!(taken.len() >= 5);
    for (index, offset, snapshot) in &taken {
        let (first, resumed) = resume(program.as_bytes(), &config, *offset, snapshot);
        assert_eq!(first, *index);
        assert!((0..resumed.len()).all(|k| resumed.bits(k) == whole.bits(first as usize + k)));
    }
}

#[test]
fn a_stream_with_overrides_resumes_bit_for_bit() {
    let config = Arc::new(config(&[(200, 0.4), (500, 0.0), (900, 1.7), (2_100, 0.0), (2_200, 0.9)]));
    let whole = run(PART, &config);
    let mut pipeline = Pipeline::new(config.clone());
    let mut block = pipeline.new_block();
    pipeline.push(PART.as_bytes());
    pipeline.finish_input();
    let mut snapshots = Vec::new();
    while pipeline.next_block(&mut block) == Step::Block {
        snapshots.push((pipeline.snapshot().unwrap(), pipeline.place().offset, pipeline.next_index()));
    }
    assert!(snapshots.len() >= 2);
    for (snapshot, offset, next) in snapshots {
        let mut pipeline = Pipeline::restore(config.clone(), &snapshot).unwrap();
        pipeline.push(&PART.as_bytes()[offset as usize..]);
        pipeline.finish_input();
        let mut index = next as usize;
        while pipeline.next_block(&mut block) == Step::Block {
            for k in 0..block.len() {
                let found: Vec<u64> = block.axes.iter().map(|column| column[k].to_bits()).collect();
                assert_eq!(found, whole.bits(index)[..3]);
                index += 1;
            }
        }
        assert_eq!(index, whole.len());
    }
}

/// Runs a program and appends each change as late as can be: when everything before it was handed out.
fn run_appending(program: &str, config: &PipelineConfig, overrides: &[(u64, f64)], most: usize) -> Setpoints {
    let mut pipeline = Pipeline::new(Arc::new(PipelineConfig { overrides: Vec::new(), ..config.clone() }));
    let mut block = pipeline.new_block();
    let mut setpoints = Setpoints::default();
    pipeline.push(program.as_bytes());
    pipeline.finish_input();
    let mut overrides = overrides.iter().peekable();
    loop {
        let next = pipeline.next_index();
        while let Some(&(index, ratio)) = overrides.next_if(|change| change.0 <= next) {
            pipeline.append_override(OverrideChange { index, ratio }).unwrap();
        }
        let before_next = overrides.peek().map_or(most, |change| most.min((change.0 - next) as usize));
        match pipeline.next_setpoints(&mut block, before_next) {
            Step::Block => setpoints.append(&block),
            Step::Finished => return setpoints,
            other => panic!("{other:?}: {:?}", pipeline.findings()),
        }
    }
}

/// A pipeline that ran so far, and the changes that it knew.
struct Known {
    next: u64,
    changes: usize,
    offset: u64,
    snapshot: Vec<u8>,
}

/// Runs a program, appends each change as late as can be, and keeps the state at every end of a block.
fn known_states(program: &str, config: &PipelineConfig, overrides: &[OverrideChange], most: usize) -> Vec<Known> {
    let mut pipeline = Pipeline::new(Arc::new(PipelineConfig { overrides: Vec::new(), ..config.clone() }));
    let mut block = pipeline.new_block();
    pipeline.push(program.as_bytes());
    pipeline.finish_input();
    let mut states = Vec::new();
    let mut changes = 0;
    loop {
        let next = pipeline.next_index();
        while let Some(change) = overrides.get(changes).filter(|change| change.index <= next) {
            pipeline.append_override(*change).unwrap();
            changes += 1;
        }
        let before_next = overrides.get(changes).map_or(most, |change| most.min((change.index - next) as usize));
        match pipeline.next_setpoints(&mut block, before_next) {
            Step::Block => states.push(Known {
                next: pipeline.next_index(),
                changes,
                offset: pipeline.place().offset,
                snapshot: pipeline.snapshot().unwrap(),
            }),
            Step::Finished => return states,
            other => panic!("{other:?}: {:?}", pipeline.findings()),
        }
    }
}

#[test]
fn a_state_that_knows_some_changes_goes_on_with_the_others_bit_for_bit() {
    let given = [(150, 0.5), (400, 0.0), (1_000, 1.2), (1_001, 0.3), (1_500, 2.0), (1_503, 0.0), (2_600, 1.0)];
    let config = config(&given);
    let whole = run(PART, &config);
    for most in [64, 333] {
        for state in known_states(PART, &config, &config.overrides, most) {
            let (known, others) = config.overrides.split_at(state.changes);
            let plain = PipelineConfig { overrides: known.to_vec(), ..config.clone() };
            let mut pipeline = Pipeline::restore(Arc::new(plain), &state.snapshot).unwrap();
            for change in others {
                pipeline.append_override(*change).unwrap();
            }
            pipeline.push(&PART.as_bytes()[state.offset as usize..]);
            pipeline.finish_input();
            let mut block = pipeline.new_block();
            let mut index = state.next as usize;
            while pipeline.next_block(&mut block) == Step::Block {
                for k in 0..block.len() {
                    let found: Vec<u64> = block.axes.iter().map(|column| column[k].to_bits()).collect();
                    assert_eq!(found, whole.bits(index)[..3], "setpoint {index} from {}", state.next);
                    index += 1;
                }
            }
            assert_eq!(index, whole.len(), "from {}", state.next);
        }
    }
}

fn assert_same_bits(left: &Setpoints, right: &Setpoints) {
    assert_eq!(left.len(), right.len());
    for k in 0..left.len() {
        assert_eq!(left.bits(k), right.bits(k), "setpoint {k}");
    }
}

#[test]
fn a_change_before_what_was_handed_out_is_refused() {
    let mut pipeline = Pipeline::new(Arc::new(config(&[(5, 0.5)])));
    let mut block = pipeline.new_block();
    pipeline.push(PART.as_bytes());
    assert_eq!(pipeline.earliest_override(), 6, "setpoint 5 has its change");
    assert_eq!(pipeline.next_setpoints(&mut block, 5), Step::Block);
    while pipeline.next_index() < 100 {
        pipeline.next_setpoints(&mut block, 100 - pipeline.next_index() as usize);
    }
    let append = |pipeline: &mut Pipeline, index, ratio| pipeline.append_override(OverrideChange { index, ratio });
    assert_eq!(append(&mut pipeline, 99, 1.0), Err(AppendError::TooEarly { index: 99, earliest: 100 }));
    for ratio in [-0.1, 2.1, f64::INFINITY] {
        assert_eq!(append(&mut pipeline, 100, ratio), Err(AppendError::Ratio(ratio)));
    }
    assert!(matches!(append(&mut pipeline, 100, f64::NAN), Err(AppendError::Ratio(_))));
    assert_eq!(append(&mut pipeline, 120, 1.0), Ok(()));
    assert_eq!(append(&mut pipeline, 120, 1.2), Err(AppendError::TooEarly { index: 120, earliest: 121 }));
}

fn least_time(overrides: &[(u64, f64)]) -> PipelineConfig {
    let mut config = config(overrides);
    config.profile.plan_quality = PlanQuality::LeastTime;
    config
}

#[test]
fn a_plan_for_the_least_time_is_faster_and_resumes_bit_for_bit() {
    let program = wave();
    let config = least_time(&[]);
    let mut runs = least_time(&[]);
    runs.profile.plan_quality = PlanQuality::Fast;
    let [fast, least] = [run(&program, &runs), run(&program, &config)];
    assert!(least.len() * 10 < fast.len() * 9, "{} of {}", least.len(), fast.len());
    check_limits(&least, &config).expect("within the limits");
    for (index, offset, snapshot) in snapshots(program.as_bytes(), &config) {
        let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
        assert_eq!(first, index);
        assert_eq!(all_bits(&rest), all_bits(&least)[index as usize..]);
    }
}

#[test]
fn hold_and_lower_feeds_act_at_once_on_a_plan_for_the_least_time() {
    let program = wave();
    let plain = run(&program, &least_time(&[]));
    for at in (20..plain.len() as u64 - 100).step_by(67) {
        let config = least_time(&[(at, 0.0), (at + 400, 1.0)]);
        let held = run(&program, &config);
        check_same_path(&held, &plain).expect("the same path");
        check_limits(&held, &config).expect("within the limits");
        // A rest from 330 mm/s takes 40 ms by acceleration and jerk alone; turning takes its part.
        let stopped = (at as usize..).find(|&k| held.path[k + 1] == held.path[k]).expect("it stops");
        assert!(stopped < at as usize + 200, "hold at {at} stops at {stopped}");
        let config = least_time(&[(at, 0.1)]);
        let slower = run(&program, &config);
        check_limits(&slower, &config).expect("within the limits");
        let reached = (at as usize..slower.len()).find(|&k| slower.feed[k] <= 2_060.0);
        assert!(reached.is_some_and(|reached| reached < at as usize + 200), "a tenth at {at} from {reached:?} on");
    }
}

#[test]
fn behind_a_change_the_path_is_planned_for_the_least_time_again() {
    let program = wave();
    let plain = run(&program, &least_time(&[]));
    for at in [60, 300, 500] {
        let config = least_time(&[(at, 1.0)]);
        let changed = run(&program, &config);
        check_limits(&changed, &config).expect("within the limits");
        // What ends with the change is the acceleration, once.
        assert!(changed.len() * 100 <= plain.len() * 103, "{} of {} at {at}", changed.len(), plain.len());
    }
}

/// Turning with a vibrating section and a dwell while the spindle turns.
const VIBRATING: &str = "G21 G97 S1000 M3\nG0 X6. Z10.\nG4 P100\nG200 F41.667 A0.03\nG1 X10. Z11. F0.05\n\
G2 X11. Z11.5 R4.\nG201\nG4 P50\nG1 Z12. F0.1\nM30\n";

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn appended_changes_give_the_bits_of_configured_ones(
        steps in prop::collection::vec((1..900_u64, prop_oneof![2 => 0.0..2.0_f64, 2 => Just(0.0), 1 => Just(1.0)]), 1..10),
        last in 0.3..2.0_f64,
        most in prop_oneof![Just(1_024_usize), 1..300_usize],
        vibrating: bool,
        is_least_time: bool,
    ) {
        let mut index = 0;
        let mut overrides: Vec<(u64, f64)> = Vec::new();
        for (step, ratio) in steps {
            index += step;
            overrides.push((index, ratio));
        }
        overrides.push((index + 2_500, last));
        let (program, profile) =
            if vibrating { (VIBRATING, MachineProfile::lathe()) } else { (PART, MachineProfile::mill()) };
        let quality = if is_least_time { PlanQuality::LeastTime } else { PlanQuality::Fast };
        let profile = MachineProfile { plan_quality: quality, ..profile };
        let changes = overrides.iter().map(|&(index, ratio)| OverrideChange { index, ratio }).collect();
        let configured = PipelineConfig { overrides: changes, ..PipelineConfig::new(profile) };
        assert_same_bits(&run_appending(program, &configured, &overrides, most), &run(program, &configured));
    }

    #[test]
    fn any_sequence_of_overrides_keeps_path_and_limits(
        steps in prop::collection::vec((1..400_u64, prop_oneof![2 => 0.0..2.0_f64, 1 => Just(0.0), 1 => Just(1.0)]), 1..12),
        last in 0.2..2.0_f64,
        is_least_time: bool,
    ) {
        let mut index = 0;
        let mut overrides: Vec<(u64, f64)> = Vec::new();
        for (step, ratio) in steps {
            index += step;
            overrides.push((index, ratio));
        }
        overrides.push((index + 100, last));
        let mut plain = config(&[]);
        plain.profile.plan_quality = if is_least_time { PlanQuality::LeastTime } else { PlanQuality::Fast };
        let config_changed = PipelineConfig { overrides: config(&overrides).overrides, ..plain.clone() };
        let changed = run(PART, &config_changed);
        check_same_path(&changed, &run(PART, &plain))?;
        check_limits(&changed, &config_changed)?;
    }
}
