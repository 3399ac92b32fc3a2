//! Planned changes of the spindle speed: where they are possible, what is judged before, and what follows them
//! (docs/functions/adaptive-feed.md, "Planned changes of the spindle speed").

use std::sync::Arc;

use crate::common::{Setpoints, run, run_in_pieces};
use feedwave_cutting::{
    MachineProfile, OverrideChange, Pipeline, PipelineConfig, SpindleChange, SpindleChangeError, SpindleTrial, Step,
    TrialStep,
};

/// 1000 rev/min, 2.5 vibrations per revolution, twice the amplitude is 1.2 times the feed of 0.05 mm/rev; two sections.
const TURNED: &str = "G21 G97 S1000 M3\nG0 X6. Z2.\nG200 F41.66666667 A0.03\nG1 Z4. F0.05\nG0 X8.\nG0 Z2.\nG1 Z4. F0.05\n\
                      G201\nG0 X10.\nM30\n";

fn planned(changes: &[(u64, f64)]) -> PipelineConfig {
    let changes = changes.iter().map(|&(index, ratio)| SpindleChange { index, ratio }).collect();
    PipelineConfig { spindle_changes: Some(changes), ..PipelineConfig::new(MachineProfile::lathe()) }
}

/// Goes on to the next place; its index, or nothing at the end.
fn next_place(pipeline: &mut Pipeline, program: &str, setpoints: &mut Setpoints) -> Option<u64> {
    let mut block = pipeline.new_block();
    loop {
        match pipeline.next_block(&mut block) {
            Step::Block => setpoints.append(&block),
            Step::NeedInput(place) => pipeline.supply(place, program.as_bytes()),
            Step::Finished => return None,
            Step::Refused => panic!("refused: {:#?}", pipeline.findings()),
        }
        if let Some(index) = pipeline.place_between() {
            return Some(index);
        }
    }
}

fn at_place(program: &str, number: usize) -> Pipeline {
    let mut pipeline = Pipeline::new(Arc::new(planned(&[])));
    let mut setpoints = Setpoints::default();
    for _ in 0..=number {
        next_place(&mut pipeline, program, &mut setpoints).expect("a place");
    }
    pipeline
}

/// Whether the first section of a program with the vibration of [`TURNED`] may be cut at a ratio of the speed.
fn judge_cuts(cuts: &str, ratio: f64) -> Result<(), String> {
    let program = format!("G21 G97 S1000 M3\nG0 X6. Z2.\nG200 F41.66666667 A0.03\n{cuts}\nG201\nG0 X10.\nM30\n");
    judge(&at_place(&program, 0), &program, ratio)
}

#[test]
fn a_cut_that_never_breaks_hides_none_that_breaks_at_the_programmed_speed_only() {
    let unbroken = Err("VIB-CHIP-UNBROKEN".to_owned());
    // At 1.2 times the speed 2.08 vibrations of a revolution let 0.016 mm through.
    for cuts in
        ["G1 Z-2. F0.05", "G1 Z-2. F0.05\nG1 Z-3. F0.2", "G1 Z1. F0.2\nG1 Z-3. F0.05", "G1 Z-8. F0.05\nG1 Z-8.4 F0.2"]
    {
        assert_eq!(judge_cuts(cuts, 1.2), unbroken, "{cuts}");
        // What breaks there still breaks.
        assert_eq!(judge_cuts(cuts, 1.01), Ok(()), "{cuts}");
    }
    // What breaks at no speed is no condition that could be lost.
    assert_eq!(judge_cuts("G1 Z-3. F0.2", 1.2), Ok(()));
}

fn judge(pipeline: &Pipeline, program: &str, ratio: f64) -> Result<(), String> {
    cuts_at(pipeline, program, ratio).map(drop)
}

/// Whether anything is cut before the next place, at a speed that it may be cut at, where the feed is at most as programmed.
fn cuts_at(pipeline: &Pipeline, program: &str, ratio: f64) -> Result<bool, String> {
    judge_up_to(1.0, pipeline, program, ratio)
}

/// The same with feed overrides up to this one.
fn judge_up_to(largest: f64, pipeline: &Pipeline, program: &str, ratio: f64) -> Result<bool, String> {
    let mut trial = SpindleTrial::new(pipeline, ratio, largest).expect("at a place");
    loop {
        match trial.step() {
            TrialStep::NeedInput(place) => match program.as_bytes().get(place.offset as usize..) {
                Some(rest) if !rest.is_empty() => trial.push(rest),
                _ => trial.finish_input(),
            },
            TrialStep::More => {}
            TrialStep::Holds { cuts } => return Ok(cuts),
            TrialStep::Fails(finding) => return Err(finding.code.to_string()),
        }
    }
}

#[test]
fn the_path_rests_on_a_setpoint_at_every_place_and_nothing_stops_where_none_are_planned() {
    let mut setpoints = Setpoints::default();
    let mut pipeline = Pipeline::new(Arc::new(planned(&[])));
    let mut places = Vec::new();
    while let Some(index) = next_place(&mut pipeline, TURNED, &mut setpoints) {
        assert_eq!(index, setpoints.len() as u64);
        assert_eq!(setpoints.feed.last(), Some(&0.0));
        places.push((index, setpoints.axes[0].last().copied(), setpoints.axes[1].last().copied()));
    }
    // Before each section, and behind the second: radii of 3 and 4 mm.
    let reached: Vec<_> = places.iter().map(|&(_, x, z)| (x.unwrap(), z.unwrap())).collect();
    assert_eq!(reached, [(3.0, 2.0), (4.0, 2.0), (4.0, 4.0)]);

    let plain = run(TURNED, &PipelineConfig { spindle_changes: None, ..planned(&[]) });
    let ends = |setpoints: &Setpoints| setpoints.axes.iter().map(|axis| *axis.last().unwrap()).collect::<Vec<_>>();
    assert_eq!(ends(&plain), ends(&setpoints));
    assert!(
        setpoints.len() - plain.len() <= 3,
        "{} and {}: at most a period at each place",
        setpoints.len(),
        plain.len()
    );
}

#[test]
fn a_speed_is_judged_by_the_chip_that_it_would_leave() {
    let pipeline = at_place(TURNED, 1);
    // D = 2.5 / 1.05 = 2.381: 2A·|sin πD| = 0.0559 mm, at 0.05 / 1.05 = 0.0476 mm/rev.
    assert_eq!(judge(&pipeline, TURNED, 1.05), Ok(()));
    assert_eq!(judge(&pipeline, TURNED, 1.0), Ok(()));
    // D = 2.0833: 0.0155 mm, at 0.0417 mm/rev.
    assert_eq!(judge(&pipeline, TURNED, 1.2).unwrap_err(), "VIB-CHIP-UNBROKEN");
    // D = 3.125: 0.0230 mm, at 0.0625 mm/rev.
    assert_eq!(judge(&pipeline, TURNED, 0.8).unwrap_err(), "VIB-CHIP-UNBROKEN");
    // Beyond the 4000 rev/min of the machine.
    let machine = pipeline.config().profile.machine.max_spindle_rev_per_min;
    assert_eq!(judge(&pipeline, TURNED, 1.01 * machine / 1_000.0).unwrap_err(), "SPINDLE-SPEED");
    // Behind the sections there is nothing to judge, and nothing is cut.
    assert_eq!(cuts_at(&at_place(TURNED, 2), TURNED, 1.2), Ok(false));
    assert_eq!(cuts_at(&pipeline, TURNED, 1.05), Ok(true));
}

#[test]
fn what_holds_up_to_an_override_at_the_programmed_speed_is_not_lost() {
    // 2A·|sin πD| = 0.06 mm breaks 0.05 mm/rev up to an override of 1.2; at 1.05 times the speed 0.0559 mm break 0.0476 up to 1.174.
    let pipeline = at_place(TURNED, 1);
    for (largest, holds) in [(1.0, true), (1.17, true), (1.18, false), (1.2, false), (1.5, false)] {
        let judged = judge_up_to(largest, &pipeline, TURNED, 1.05);
        assert_eq!(judged, if holds { Ok(true) } else { Err("VIB-CHIP-OVERRIDE".to_owned()) }, "{largest}");
    }
}

#[test]
fn a_held_feed_does_not_hold_a_trial() {
    let mut pipeline = at_place(TURNED, 0);
    let index = pipeline.earliest_override();
    pipeline.append_override(OverrideChange { index, ratio: 0.0 }).unwrap();
    assert_eq!(judge(&pipeline, TURNED, 1.05), Ok(()));
    assert_eq!(judge(&pipeline, TURNED, 1.2).unwrap_err(), "VIB-CHIP-UNBROKEN");
}

#[test]
fn a_change_is_planned_at_its_place_and_gives_the_same_bits_however_it_is_known() {
    let mut setpoints = Setpoints::default();
    let mut pipeline = Pipeline::new(Arc::new(planned(&[])));
    assert_eq!(pipeline.append_spindle_change(1.05), Err(SpindleChangeError::NoPlace));
    next_place(&mut pipeline, TURNED, &mut setpoints).unwrap();
    let index = next_place(&mut pipeline, TURNED, &mut setpoints).unwrap();
    assert_eq!(pipeline.append_spindle_change(0.0), Err(SpindleChangeError::Ratio(0.0)));
    assert_eq!(pipeline.append_spindle_change(1.05), Ok(SpindleChange { index, ratio: 1.05 }));
    assert_eq!(pipeline.append_spindle_change(1.1), Err(SpindleChangeError::NoPlace));
    while next_place(&mut pipeline, TURNED, &mut setpoints).is_some() {}

    // 1000 rev/min turn 6° in a period, 1050 turn 6.3°.
    let turned = |index: u64| setpoints.spindle[index as usize + 1] - setpoints.spindle[index as usize];
    assert!((turned(index - 2) - 6.0).abs() < 1e-6 && (turned(index + 10) - 6.3).abs() < 1e-6);
    let config = planned(&[(index, 1.05)]);
    for piece in [1, 7, usize::MAX] {
        assert!(run_in_pieces(TURNED.as_bytes(), &config, piece) == setpoints, "{piece} at a time");
    }
    // The feed in mm/min stays where nothing else is said: the feed override says it.
    let plain = run(TURNED, &planned(&[]));
    let same = |ours: &[f64], theirs: &[f64]| {
        ours.len() == theirs.len() && ours.iter().zip(theirs).all(|(ours, theirs)| (ours - theirs).abs() < 1e-9)
    };
    assert!(same(&plain.feed, &setpoints.feed));
    assert!(same(&plain.vibration, &setpoints.vibration), "the frequency is the program's, in Hz");
    for (next, offset, snapshot) in crate::common::snapshots(TURNED.as_bytes(), &config) {
        let (first, rest) = crate::common::resume(TURNED.as_bytes(), &config, offset, &snapshot);
        assert_eq!(first, next);
        assert!((0..rest.len()).all(|row| rest.bits(row) == setpoints.bits(first as usize + row)), "from {first}");
    }
}

#[test]
fn all_passes_of_a_thread_are_cut_at_one_speed_and_another_thread_may_have_another() {
    let thread = |x: f64, z: f64| {
        let passes = [0.3, 0.5]
            .map(|depth: f64| format!("G0 X{}\nG33 Z{} F1.5\nG0 X{}\nG0 Z{}\n", x - 2.0 * depth, z - 20.0, x + 4.0, z));
        format!("G0 X{} Z{z}\n{}", x + 4.0, passes.concat())
    };
    let program = format!("G21 G97 S500 M3\n{}{}M30\n", thread(20.0, 10.0), thread(30.0, -40.0));
    let mut setpoints = Setpoints::default();
    let mut pipeline = Pipeline::new(Arc::new(planned(&[])));
    let mut places = Vec::new();
    while let Some(index) = next_place(&mut pipeline, &program, &mut setpoints) {
        places.push(index);
        if places.len() == 2 {
            assert_eq!(judge(&pipeline, &program, 1.1), Ok(()));
            pipeline.append_spindle_change(1.1).unwrap();
        }
    }
    assert_eq!(places.len(), 2, "before the first pass of each thread");
    let fastest = |range: std::ops::Range<usize>| {
        let steps = setpoints.spindle[range].windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>();
        steps.into_iter().fold(0.0, f64::max)
    };
    // 500 rev/min are 3° in a period, 550 are 3.3°.
    assert!((fastest(0..places[1] as usize) - 3.0).abs() < 1e-6);
    assert!((fastest(places[1] as usize + 1..setpoints.len()) - 3.3).abs() < 1e-6);
    assert!(run(&program, &planned(&[(places[1], 1.1)])) == setpoints);
}
