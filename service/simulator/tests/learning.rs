//! Learning from telemetry against what the simulated machine really is.

mod common;

use std::f64::consts::PI;

use common::{Log, Path, everywhere, follow};
use feedwave_monitoring::{CutRecord, Estimate, LearningError, LearningModel, Learnt, Mode, Pair, learn};
use feedwave_simulator::{Description, Material, Process, SensorPair, Tool};

const DEPTH_MM: f64 = 2.0;
const REV_PER_MIN: f64 = 3_100.0;
const FEEDS: [f64; 2] = [700.0, 1_500.0];
/// Samples of a record.
const SAMPLES: usize = 6_000;

/// A worn mill in steel whose edges run out.
fn description(seed: u64) -> Description {
    Description {
        seed,
        tool: Tool { run_out_mm: 0.004, edge_run_out_mm: 0.006, ..Tool::default() },
        material: Material {
            tangential_n_per_mm2: 1_850.0,
            radial_ratio: 0.35,
            edge_tangential_n_per_mm: 22.0,
            edge_radial_n_per_mm: 31.0,
            ..Material::default()
        },
        // Every edge has a chip from its entry to its exit.
        process: Process::Milling { entry_deg: 25.0, exit_deg: 130.0 },
        contacts: everywhere(DEPTH_MM),
        tool_sensors: Some(SensorPair { noise: 4e-4, ..SensorPair::default() }),
        ..Description::default()
    }
}

/// What the tool library says: stiffness as it is, the rest not quite.
fn library(description: &Description, frequency: f64, damping: f64) -> LearningModel {
    let Process::Milling { entry_deg, exit_deg } = description.process else { panic!("milling") };
    let of = |mode: Mode| Mode {
        frequency_hz: mode.frequency_hz * frequency,
        damping_ratio: mode.damping_ratio * damping,
        ..mode
    };
    LearningModel {
        sample_rate_hz: f64::from(description.sample_rate_hz),
        edges: description.tool.edge_count,
        entry_rad: entry_deg.to_radians(),
        exit_rad: exit_deg.to_radians(),
        mode_x: of(description.tool.mode_x),
        mode_y: of(description.tool.mode_y),
    }
}

/// A cut with noise of its own.
fn cut(description: &Description, feed_mm_per_min: f64) -> Log {
    cut_at(description, feed_mm_per_min, REV_PER_MIN)
}

fn cut_at(description: &Description, feed_mm_per_min: f64, rev_per_min: f64) -> Log {
    let seed = 1_000 * description.seed + feed_mm_per_min as u64;
    let mut path = Path::default();
    let periods = SAMPLES * 1_000 / description.sample_rate_hz as usize + 2;
    path.add(periods, feed_mm_per_min, rev_per_min, [0.8, 0.6]);
    follow(Description { seed, ..description.clone() }, &path)
}

fn record(log: &Log, feed_mm_per_min: f64) -> CutRecord<'_> {
    record_of(log, feed_mm_per_min, SAMPLES)
}

/// Its first samples.
fn record_of(log: &Log, feed_mm_per_min: f64, samples: usize) -> CutRecord<'_> {
    CutRecord {
        deflection_mm: Pair { x: &log.tool[0][..samples], y: &log.tool[1][..samples] },
        spindle_angle_deg: &log.spindle_angle_deg[..samples],
        feed_mm_per_min,
        depth_mm: DEPTH_MM,
        feed_direction: [0.8, 0.6],
        first_edge_deg: 0.0,
        missing: &[],
    }
}

fn learnt(description: &Description, model: &LearningModel) -> Result<Learnt, LearningError> {
    let logs = FEEDS.map(|feed| cut(description, feed));
    let records: Vec<_> = logs.iter().zip(FEEDS).map(|(log, feed)| record(log, feed)).collect();
    learn(model, &records)
}

/// Every estimate beside the truth.
fn estimates(description: &Description, learnt: &Learnt) -> [(&'static str, Estimate, f64); 10] {
    let (material, tool) = (&description.material, &description.tool);
    let radial = material.radial_ratio * material.tangential_n_per_mm2;
    [
        ("K_tc", learnt.tangential_n_per_mm2, material.tangential_n_per_mm2),
        ("K_te", learnt.edge_tangential_n_per_mm, material.edge_tangential_n_per_mm),
        ("K_rc", learnt.radial_n_per_mm2, radial),
        ("K_re", learnt.edge_radial_n_per_mm, material.edge_radial_n_per_mm),
        ("run-out of the edges", learnt.edge_run_out_mm.expect("four edges"), tool.edge_run_out_mm),
        ("run-out of the surface", learnt.run_out_mm, tool.run_out_mm),
        ("frequency in X", learnt.mode_x.frequency_hz, tool.mode_x.frequency_hz),
        ("damping in X", learnt.mode_x.damping_ratio, tool.mode_x.damping_ratio),
        ("frequency in Y", learnt.mode_y.frequency_hz, tool.mode_y.frequency_hz),
        ("damping in Y", learnt.mode_y.damping_ratio, tool.mode_y.damping_ratio),
    ]
}

#[test]
fn the_truth_is_within_the_stated_interval_for_95_of_100_seeds() {
    const SEEDS: u64 = 60;
    let mut within = [0_u64; 10];
    for seed in 0..SEEDS {
        let description = description(seed);
        let learnt = learnt(&description, &library(&description, 0.96, 1.3)).expect("enough to learn from");
        assert!((learnt.residual_mm / 4e-4 - 1.0).abs() < 0.03, "{learnt:?}");
        for (within, (name, estimate, truth)) in within.iter_mut().zip(estimates(&description, &learnt)) {
            let [low, high] = estimate.interval();
            *within += u64::from((low..=high).contains(&truth));
            // An interval as wide as the value would hold anything.
            assert!(estimate.standard_error < 0.12 * truth, "{name}: {estimate:?}");
            assert!((estimate.value - truth).abs() < 6.0 * estimate.standard_error, "{name}: {estimate:?}, {truth}");
        }
    }
    // 95 % of 60 are 57; by chance three standard deviations of 1.69 fewer.
    assert!(within.iter().all(|within| *within >= 52), "{within:?}");
    let all = within.iter().sum::<u64>() as f64 / (10 * SEEDS) as f64;
    assert!((0.93..=0.985).contains(&all), "{all}");
}

#[test]
fn every_quantity_is_within_its_interval_in_95_of_100_draws() {
    const DRAWS: u64 = 200;
    /// Enough for a settled tool and twenty turns of noise, and quick.
    const SHORT: usize = 2_200;
    let mut within = [0_u64; 10];
    for seed in 0..DRAWS {
        let description = description(10_000 + seed);
        let logs = FEEDS.map(|feed| cut(&description, feed));
        let records: Vec<_> = logs.iter().zip(FEEDS).map(|(log, feed)| record_of(log, feed, SHORT)).collect();
        let learnt = learn(&library(&description, 1.0, 1.0), &records).expect("enough to learn from");
        for (within, (_, estimate, truth)) in within.iter_mut().zip(estimates(&description, &learnt)) {
            let [low, high] = estimate.interval();
            *within += u64::from((low..=high).contains(&truth));
        }
    }
    // 95 % of 200 are 190, with a standard deviation of 3.1: three of them either way.
    assert!(within.iter().all(|within| (181..=199).contains(within)), "{within:?}");
    let all = within.iter().sum::<u64>() as f64 / (10 * DRAWS) as f64;
    assert!((0.93..=0.97).contains(&all), "{all}");
}

/// At 3000 rev/min every turn has 400 samples: that an edge enters and leaves, and where its chip ends, falls on the same places between the same
/// samples in each.
#[test]
fn edges_that_enter_and_leave_alike_in_every_turn_are_learnt_from() {
    let mut within = 0;
    for seed in 0..4 {
        let description = Description {
            process: Process::Milling { entry_deg: 90.0, exit_deg: 180.0 },
            tool_sensors: Some(SensorPair::default()),
            ..description(seed)
        };
        let logs = FEEDS.map(|feed| cut_at(&description, feed, 3_000.0));
        let records: Vec<_> = logs.iter().zip(FEEDS).map(|(log, feed)| record(log, feed)).collect();
        let learnt = learn(&library(&description, 1.0, 1.0), &records).expect("enough to learn from");
        assert!(learnt.correlation_factor < 1.2, "{}", learnt.correlation_factor);
        for (name, estimate, truth) in estimates(&description, &learnt) {
            let [low, high] = estimate.interval();
            within += u32::from((low..=high).contains(&truth));
            assert!((estimate.value / truth - 1.0).abs() < 0.01, "{name}: {estimate:?}, {truth}");
            assert!((estimate.value - truth).abs() < 4.0 * estimate.standard_error, "{name}: {estimate:?}, {truth}");
        }
    }
    // 95 % of 40 are 38; by chance three standard deviations of 1.4 fewer.
    assert!(within >= 34, "{within} of 40");
}

/// Three vibrations in every turn are no run-out: nothing in the model makes them, and another turn tells nothing new of them.
#[test]
fn what_comes_again_with_every_turn_widens_the_intervals_until_they_hold_the_truth() {
    for seed in 0..2 {
        let description = Description {
            tool_sensors: Some(SensorPair::default()),
            sway: Some(feedwave_simulator::Sway { amplitude_mm: 2e-4, frequency_hz: 150.0 }),
            ..description(seed)
        };
        let logs = FEEDS.map(|feed| cut_at(&description, feed, 3_000.0));
        let records: Vec<_> = logs.iter().zip(FEEDS).map(|(log, feed)| record(log, feed)).collect();
        let learnt = learn(&library(&description, 1.0, 1.0), &records).expect("enough to learn from");
        assert!(learnt.correlation_factor > 10.0, "{}", learnt.correlation_factor);
        for (name, estimate, truth) in estimates(&description, &learnt) {
            let [low, high] = estimate.interval();
            assert!((low..=high).contains(&truth), "{name}: {estimate:?}, {truth}");
            assert!(estimate.standard_error < 0.05 * truth, "{name}: {estimate:?}");
        }
    }
}

/// In a whole slot the chip of an edge begins and ends with its sine, and which edges cut there is told by their run-out alone.
#[test]
fn a_whole_slot_is_learnt_from_where_the_edges_run_out() {
    let learnt = |description: &Description| {
        let logs = FEEDS.map(|feed| cut(description, feed));
        let records: Vec<_> = logs.iter().zip(FEEDS).map(|(log, feed)| record_of(log, feed, 2_200)).collect();
        learn(&library(description, 0.97, 1.2), &records)
    };
    for (edge_count, edge_run_out_mm) in [(2, 0.015), (4, 0.006)] {
        let mut description =
            Description { process: Process::Milling { entry_deg: 0.0, exit_deg: 180.0 }, ..description(11) };
        (description.tool.edge_count, description.tool.edge_run_out_mm) = (edge_count, edge_run_out_mm);
        let learnt = learnt(&description).expect("learnt");
        assert!((learnt.residual_mm / 4e-4 - 1.0).abs() < 0.03, "{edge_count} edges: {learnt:?}");
        for (name, estimate, truth) in estimates(&description, &learnt) {
            let off = (estimate.value - truth).abs() / estimate.standard_error;
            assert!(off < 4.0, "{edge_count} edges, {name}: {estimate:?}, {truth}");
        }
    }
    let mut even = Description { process: Process::Milling { entry_deg: 0.0, exit_deg: 180.0 }, ..description(11) };
    even.tool.edge_run_out_mm = 0.0;
    assert_eq!(learnt(&even), Err(LearningError::Steady));
}

/// The force bends the tool in Y with 624 Hz and its multiples; the mode there, at 310 Hz and lightly damped, hardly answers, and several others do as
/// well.
#[test]
fn a_mode_that_hardly_answers_is_refused_or_told_right() {
    let mode =
        |frequency_hz, damping_ratio, stiffness_n_per_mm| Mode { frequency_hz, damping_ratio, stiffness_n_per_mm };
    let (mut told, mut told_apart) = (0, 0);
    for seed in 0..4 {
        let base = description(400 + seed);
        let description = Description {
            sample_rate_hz: 10_000,
            tool: Tool {
                edge_run_out_mm: 0.0,
                mode_x: mode(1_018.0, 0.045, 14_000.0),
                mode_y: mode(310.0, 0.014, 14_000.0),
                ..base.tool
            },
            process: Process::Milling { entry_deg: 106.0, exit_deg: 180.0 },
            tool_sensors: Some(SensorPair { noise: 9e-4, ..SensorPair::default() }),
            ..base
        };
        let logs = [1_170.0, 2_100.0].map(|feed| (cut_at(&description, feed, 9_360.0), feed));
        let records: Vec<_> = logs.iter().map(|(log, feed)| record(log, *feed)).collect();
        match learn(&library(&description, 0.96, 1.2), &records) {
            Ok(learnt) => {
                told += 1;
                let estimate = learnt.mode_y.frequency_hz;
                let off = (estimate.value - 310.0).abs() / estimate.standard_error;
                assert!(off < 5.0, "{seed}: {estimate:?} {:?}", learnt.mode_y.damping_ratio);
            }
            // Or with so little damping that the records are too short to have forgotten how they began.
            Err(LearningError::NotIdentifiable("frequency in Y")) => told_apart += 1,
            Err(error) => assert!(matches!(error, LearningError::Samples { .. }), "{seed}: {error}"),
        }
    }
    assert!(told >= 1 && told_apart >= 1, "{told} told, {told_apart} refused");
}

#[test]
fn the_run_out_of_two_edges_is_learnt() {
    let mut description = description(2);
    description.tool.edge_count = 2;
    let learnt = learnt(&description, &library(&description, 1.0, 1.0)).expect("learnt");
    for (name, estimate, truth) in estimates(&description, &learnt) {
        assert!((estimate.value - truth).abs() < 4.0 * estimate.standard_error, "{name}: {estimate:?}, {truth}");
        assert!(estimate.standard_error < 0.05 * truth, "{name}: {estimate:?}");
    }
}

#[test]
fn what_is_learnt_does_not_depend_on_the_library() {
    let description = description(3);
    let near = learnt(&description, &library(&description, 1.0, 1.0)).expect("learnt");
    for (frequency, damping) in [(0.82, 0.5), (1.2, 2.0), (0.93, 1.0)] {
        let far = learnt(&description, &library(&description, frequency, damping)).expect("learnt");
        for ((name, near, _), (_, far, _)) in
            estimates(&description, &near).into_iter().zip(estimates(&description, &far))
        {
            // Other samples are left out while the mode settles: the noise of a third of them differs.
            assert!((near.value - far.value).abs() < 2.0 * far.standard_error, "{name}: {near:?} {far:?}");
        }
    }
    let model = library(&description, 1.0, 1.0);
    assert_eq!(near.dominant(&model), near.mode_x, "2ζk of X is smaller");
}

#[test]
fn the_same_records_give_the_same_bits() {
    let description = description(5);
    let model = library(&description, 0.97, 1.1);
    assert_eq!(learnt(&description, &model), learnt(&description, &model));
}

#[test]
fn a_vibration_that_no_model_has_widens_the_intervals() {
    let quiet = description(8);
    let mut shaken = quiet.clone();
    shaken.sway = Some(feedwave_simulator::Sway { amplitude_mm: 1e-3, frequency_hz: 37.0 });
    let model = library(&quiet, 0.98, 1.0);
    let (quiet, shaken) = (learnt(&quiet, &model).expect("learnt"), learnt(&shaken, &model).expect("learnt"));
    assert!(quiet.correlation_factor < 1.2, "{}", quiet.correlation_factor);
    assert!(shaken.correlation_factor > 3.0, "{}", shaken.correlation_factor);
    let wider = shaken.tangential_n_per_mm2.standard_error / quiet.tangential_n_per_mm2.standard_error;
    assert!(wider > 3.0, "{wider}");
}

#[test]
fn one_edge_has_no_run_out_against_itself() {
    let mut description = description(1);
    description.tool.edge_count = 1;
    description.tool.edge_run_out_mm = 0.0;
    let learnt = learnt(&description, &library(&description, 0.97, 1.0)).expect("learnt");
    assert_eq!(learnt.edge_run_out_mm, None);
    let [low, high] = learnt.tangential_n_per_mm2.interval();
    assert!(low < 1_900.0 && high > 1_800.0 && high - low < 150.0, "{low} {high}");
}

#[test]
fn where_nothing_can_be_learnt_it_is_said() {
    let description = description(0);
    let model = library(&description, 1.0, 1.0);
    let log = cut(&description, FEEDS[0]);
    let whole = record(&log, FEEDS[0]);
    let short = CutRecord {
        deflection_mm: Pair { x: &log.tool[0][..900], y: &log.tool[1][..900] },
        spindle_angle_deg: &log.spindle_angle_deg[..900],
        ..whole
    };
    assert!(matches!(learn(&model, &[short]), Err(LearningError::Samples { .. })));
    assert!(matches!(learn(&model, &[]), Err(LearningError::Samples { .. })));
    let uneven = CutRecord { spindle_angle_deg: &log.spindle_angle_deg[..5_999], ..whole };
    assert_eq!(learn(&model, &[whole, uneven]), Err(LearningError::Columns { record: 1 }));
    let mut broken = log.clone();
    broken.tool[0][4_000] = f64::NAN;
    assert!(matches!(learn(&model, &[record(&broken, FEEDS[0])]), Err(LearningError::Value { field: "a sample", .. })));
    for wrong in [
        LearningModel { edges: 0, ..model },
        LearningModel { exit_rad: model.entry_rad, ..model },
        LearningModel { sample_rate_hz: f64::NAN, ..model },
        LearningModel { mode_x: Mode { damping_ratio: 1.5, ..model.mode_x }, ..model },
    ] {
        assert!(matches!(learn(&wrong, &[whole]), Err(LearningError::Value { .. })), "{wrong:?}");
    }
    // A spindle that stands still cuts nothing.
    let still = vec![0.0; SAMPLES];
    assert!(learn(&model, &[CutRecord { spindle_angle_deg: &still, ..whole }]).is_err());
    // Behind a gap between the edges every chip is as thick: the edge's share of the force is not to be told.
    let narrow = LearningModel { entry_rad: 1.57, exit_rad: 1.5715, ..model };
    assert!(matches!(learn(&narrow, &[whole]), Err(LearningError::NotIdentifiable(_) | LearningError::NoFit(_))));
}

#[test]
fn chips_that_end_before_the_exit_are_learnt_from_as_well() {
    // Half immersed: at the exit the chip is thinner than the run-out of the edges, and some of them cut air.
    for seed in 0..4 {
        let description =
            Description { process: Process::Milling { entry_deg: 90.0, exit_deg: 180.0 }, ..description(seed) };
        let learnt = learnt(&description, &library(&description, 0.97, 1.2)).expect("learnt");
        for (name, estimate, truth) in estimates(&description, &learnt) {
            assert!((estimate.value / truth - 1.0).abs() < 0.06, "{name}: {estimate:?}, {truth}");
        }
    }
}

#[test]
fn a_run_out_of_zero_is_within_its_interval() {
    let mut beyond = 0;
    for seed in 0..24 {
        let mut description = description(200 + seed);
        (description.tool.run_out_mm, description.tool.edge_run_out_mm) = (0.0, 0.0);
        let learnt = learnt(&description, &library(&description, 1.02, 1.1)).expect("learnt");
        for estimate in [learnt.edge_run_out_mm.expect("four edges"), learnt.run_out_mm] {
            beyond += u32::from(estimate.is_positive());
            assert!(estimate.lower >= 0.0 && estimate.upper < 1e-3, "{estimate:?}");
        }
    }
    // 2.5 % of 48 are 1.2.
    assert!(beyond <= 5, "{beyond} of 48 intervals do not hold 0");
}

#[test]
fn samples_that_are_missing_are_not_judged() {
    let description = description(9);
    let model = library(&description, 0.98, 1.1);
    let logs = FEEDS.map(|feed| cut(&description, feed));
    let missing: Vec<u32> = (0..SAMPLES as u32).filter(|place| place % 17 == 3).collect();
    let mut holed = logs.clone();
    for log in &mut holed {
        missing.iter().for_each(|place| log.tool[0][*place as usize] = 77.0);
    }
    let records: Vec<_> =
        holed.iter().zip(FEEDS).map(|(log, feed)| CutRecord { missing: &missing, ..record(log, feed) }).collect();
    let learnt = learn(&model, &records).expect("learnt");
    assert!((learnt.residual_mm / 4e-4 - 1.0).abs() < 0.03, "{learnt:?}");
    for (name, estimate, truth) in estimates(&description, &learnt) {
        assert!((estimate.value - truth).abs() < 5.0 * estimate.standard_error, "{name}: {estimate:?}, {truth}");
    }
}

#[test]
fn what_no_tool_has_is_not_learnt() {
    let description = description(4);
    let model = library(&description, 1.0, 1.0);
    let log = cut(&description, FEEDS[1]);
    let whole = record(&log, FEEDS[1]);
    // The other side of the work: forces that explain the deflection would pull the chip.
    let mirrored = LearningModel { entry_rad: PI - model.exit_rad, exit_rad: PI - model.entry_rad, ..model };
    let backwards = CutRecord { feed_direction: [-0.8, -0.6], ..whole };
    for (model, record) in [(model, backwards), (mirrored, backwards)] {
        let refused = learn(&model, &[record]);
        assert!(
            matches!(
                refused,
                Err(LearningError::Implausible { .. } | LearningError::NotIdentifiable(_) | LearningError::NoFit(_))
            ),
            "{refused:?}"
        );
    }
    // A library that is wrong by half knows another tool.
    let refused = learn(&library(&description, 0.55, 1.0), &[whole]);
    assert!(
        matches!(
            refused,
            Err(LearningError::Implausible { .. } | LearningError::NotIdentifiable(_) | LearningError::NoFit(_))
        ),
        "{refused:?}"
    );
    // Where the first edge is somewhere else, saying so is all it takes.
    let turned: Vec<f64> = log.spindle_angle_deg.iter().map(|angle_deg| angle_deg + 33.0).collect();
    let turned = CutRecord { spindle_angle_deg: &turned[..SAMPLES], first_edge_deg: 33.0, ..whole };
    let (turned, whole) = (learn(&model, &[turned]).expect("learnt"), learn(&model, &[whole]).expect("learnt"));
    let (a, b) = (turned.tangential_n_per_mm2, whole.tangential_n_per_mm2);
    assert!((a.value / b.value - 1.0).abs() < 1e-6, "{a:?} {b:?}");
}
