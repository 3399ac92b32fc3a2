//! Every machining function on every kind of machine that can do it, under random changes of the feed override, taken up at a
//! random setpoint: the same bits however the stream is made, every axis within its limits at every setpoint, exact ends.

mod programs;

use std::sync::Arc;

use crate::common::machines::poses;
use crate::common::{Setpoints, all_bits, run, run_appending, run_in_pieces, validate};
use feedwave_cutting::{OverrideChange, Pipeline, PipelineConfig, PlanQuality, Step};
use feedwave_motion::kinematics::vector::{norm, sub};
use programs::{Case, End, Function, Numbers};
use proptest::prelude::*;

/// Polynomials hold the axes of a chain to 1e-10 mm or degrees; differences of setpoints take a multiple of it.
const FIT: f64 = 1e-9;

/// Every setpoint from `at` on, of a pipeline that was taken up from a snapshot made there.
fn resumed_at(program: &str, config: &Arc<PipelineConfig>, at: u64) -> Setpoints {
    let mut pipeline = Pipeline::new(Arc::clone(config));
    let mut block = pipeline.new_block();
    let mut snapshot = None;
    let mut setpoints = Setpoints::default();
    loop {
        if snapshot.is_none() && pipeline.next_index() == at {
            let taken = pipeline.snapshot().expect("plain data");
            pipeline = Pipeline::restore(Arc::clone(config), &taken).expect("a snapshot just taken");
            block = pipeline.new_block();
            snapshot = Some(taken);
        }
        let most = if snapshot.is_none() { (at - pipeline.next_index()) as usize } else { usize::MAX };
        match pipeline.next_setpoints(&mut block, most) {
            Step::Block if snapshot.is_some() => {
                block.first_index -= at;
                setpoints.append(&block);
            }
            Step::Block => {}
            Step::NeedInput(place) => pipeline.supply(place, program.as_bytes()),
            Step::Finished => return setpoints,
            Step::Refused => panic!("refused: {:#?}", pipeline.findings()),
        }
    }
}

/// First, second and third differences of every axis, as far as the function promises them.
fn check_limits(case: &Case, setpoints: &Setpoints) -> Result<(), TestCaseError> {
    let h = case.config.period_s();
    for (axis, column) in case.config.profile.machine.axes.iter().zip(&setpoints.axes) {
        let farthest = column.iter().fold(1.0_f64, |farthest, value| farthest.max(value.abs()));
        let rounding = 16.0 * f64::EPSILON * farthest + 2e-13;
        let noise = if case.config.profile.kinematics.is_some() { FIT } else { rounding };
        for (k, p) in column.windows(4).enumerate() {
            let differences = [p[3] - p[2], p[3] - 2.0 * p[2] + p[1], p[3] - 3.0 * p[2] + 3.0 * p[1] - p[0]];
            let limits = [axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3];
            for (order, (difference, limit)) in (1..).zip(differences.into_iter().zip(limits)) {
                let Some(more) = case.tolerance(order) else { continue };
                let found = (difference.abs() - 2.0_f64.powi(order) * noise).max(0.0) / h.powi(order);
                prop_assert!(
                    found <= limit * (1.0 + more),
                    "{}: derivative {} of {} is {} of {} at setpoint {}, line {}",
                    case.name,
                    order,
                    axis.name,
                    found,
                    limit,
                    k + 3,
                    setpoints.line[k + 3]
                );
            }
        }
    }
    Ok(())
}

/// Places that a path has to come through are setpoints.
fn check_ends(case: &Case, setpoints: &Setpoints) -> Result<(), TestCaseError> {
    for end in &case.ends {
        let nearest = match *end {
            End::Axes(ref wanted) => (0..setpoints.len())
                .map(|k| {
                    wanted.iter().map(|&(column, value)| (setpoints.axes[column][k] - value).abs()).fold(0.0, f64::max)
                })
                .fold(f64::INFINITY, f64::min),
            End::Tip(wanted) => {
                let tips = poses(setpoints, &case.config);
                tips.iter().map(|pose| norm(sub(pose.tip_mm, wanted))).fold(f64::INFINITY, f64::min)
            }
        };
        prop_assert!(nearest < 1e-9, "{}: {:?} is no setpoint: {} off", case.name, end, nearest);
    }
    Ok(())
}

fn check(mut case: Case, changes: &[(u64, f64)], resume: f64, piece: usize) -> Result<(), TestCaseError> {
    let name = case.name.clone();
    let report = validate(&case.program, &case.config);
    prop_assert!(report.is_accepted(), "{}: {:#?}\n{}", name, report.findings, case.program);
    let plain = run(&case.program, &case.config);
    // The changes of a short program come sooner.
    let last_index = changes.last().map_or(1, |change| change.0);
    let scale = (plain.len() as f64 * 0.9 / last_index as f64).min(1.0);
    let overrides: Vec<_> = changes
        .iter()
        .map(|&(index, ratio)| OverrideChange { index: (index as f64 * scale) as u64 + 1, ratio })
        .collect();
    let mut increasing: Vec<OverrideChange> = Vec::new();
    for change in overrides {
        if increasing.last().is_none_or(|before| before.index < change.index) {
            increasing.push(change);
        }
    }
    if let Some(last) = increasing.last_mut() {
        last.ratio = last.ratio.max(0.3);
    }
    let unchanged = case.config.clone();
    case.config.overrides.clone_from(&increasing);
    let whole = run(&case.program, &case.config);
    let bits = all_bits(&whole);
    for setpoints in [&plain, &whole] {
        check_limits(&case, setpoints)?;
        check_ends(&case, setpoints)?;
    }
    let end = |setpoints: &Setpoints| -> Vec<u64> {
        setpoints.axes.iter().map(|column| column.last().expect("setpoints").to_bits()).collect()
    };
    prop_assert_eq!(end(&whole), end(&plain), "{}: the end is the same to the bit", &name);
    let in_pieces = run_in_pieces(case.program.as_bytes(), &case.config, piece);
    prop_assert!(all_bits(&in_pieces) == bits, "{}: pieces of {} give other bits", name, piece);
    let appended = run_appending(&case.program, &unchanged, &increasing, piece);
    prop_assert!(all_bits(&appended) == bits, "{}: appended changes give other bits", name);
    let at = ((whole.len() - 1) as f64 * resume) as u64;
    let resumed = resumed_at(&case.program, &Arc::new(case.config), at);
    prop_assert!(all_bits(&resumed) == bits[at as usize..], "{}: taken up at {}", name, at);
    Ok(())
}

fn changes() -> impl Strategy<Value = Vec<(u64, f64)>> {
    let ratio = prop_oneof![3 => 0.05..1.5_f64, 1 => Just(0.0), 1 => Just(1.0), 1 => Just(2.0)];
    prop::collection::vec((5..600_u64, ratio), 1..8).prop_map(|steps| {
        let mut index = 0;
        let advance = |(step, ratio)| {
            index += step;
            (index, ratio)
        };
        steps.into_iter().map(advance).collect()
    })
}

/// Runs one function on machine after machine.
fn every_machine(
    function: Function,
    numbers: &Numbers,
    machine: usize,
    changes: &[(u64, f64)],
    (resume, piece): (f64, usize),
) -> Result<(), TestCaseError> {
    let machines = function.machines();
    let case = function.case(&machines[machine % machines.len()], numbers);
    check(case, changes, resume, piece)
}

fn numbers() -> impl Strategy<Value = Numbers> {
    let quality = prop_oneof![4 => Just(PlanQuality::Fast), 1 => Just(PlanQuality::LeastTime)];
    (prop::collection::vec(-1.0..1.0_f64, 40), any::<[bool; 4]>(), quality)
        .prop_map(|(values, flags, quality)| Numbers { values, flags, quality })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn vibration_along_the_path(
        numbers in numbers(), machine in any::<usize>(), changes in changes(), resume in 0.0..1.0_f64, piece in 1..400_usize,
    ) {
        every_machine(Function::PathVibration, &numbers, machine, &changes, (resume, piece))?;
    }

    #[test]
    fn tool_oscillation(
        numbers in numbers(), machine in any::<usize>(), changes in changes(), resume in 0.0..1.0_f64, piece in 1..400_usize,
    ) {
        every_machine(Function::ToolOscillation, &numbers, machine, &changes, (resume, piece))?;
    }

    #[test]
    fn threads(
        numbers in numbers(), machine in any::<usize>(), changes in changes(), resume in 0.0..1.0_f64, piece in 1..400_usize,
    ) {
        every_machine(Function::Thread, &numbers, machine, &changes, (resume, piece))?;
    }

    #[test]
    fn tool_centre_point_control(
        numbers in numbers(), machine in any::<usize>(), changes in changes(), resume in 0.0..1.0_f64, piece in 1..400_usize,
    ) {
        every_machine(Function::FiveAxis, &numbers, machine, &changes, (resume, piece))?;
    }

    #[test]
    fn thinning(
        numbers in numbers(), machine in any::<usize>(), changes in changes(), resume in 0.0..1.0_f64, piece in 1..400_usize,
    ) {
        every_machine(Function::Thinning, &numbers, machine, &changes, (resume, piece))?;
    }
}

proptest! {
    // Each is as long as three of the others.
    #![proptest_config(ProptestConfig::with_cases(14))]

    #[test]
    fn several_functions_in_one_program(
        numbers in numbers(), machine in any::<usize>(), changes in changes(), resume in 0.0..1.0_f64, piece in 1..400_usize,
    ) {
        every_machine(Function::Several, &numbers, machine, &changes, (resume, piece))?;
    }
}
