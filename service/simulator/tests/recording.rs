//! What of a simulated run is kept to learn from.

mod common;

use common::{everywhere, machine};
use feedwave_monitoring::{
    Batch, CutConditions, CutRecord, LearningModel, MAX_RECORDED_CUTS, MonitoringConfig, Pair, Quantity, RecordedCut,
    Recorder, RecordingError, RecordingLimits, learn,
};
use feedwave_simulator::{Description, Fault, FaultKind, Mounting, Process, SensorPair, Tool, Where};

fn description(seed: u64) -> Description {
    Description {
        seed,
        tool: Tool { run_out_mm: 0.003, edge_run_out_mm: 0.005, ..Tool::default() },
        process: Process::Milling { entry_deg: 25.0, exit_deg: 130.0 },
        contacts: everywhere(1.5),
        ..Description::default()
    }
}

fn config(description: &Description) -> MonitoringConfig {
    description.monitoring().expect("distance")
}

/// Two lines with other feeds, as setpoints.
fn path() -> common::Path {
    let mut path = common::Path::default();
    path.add(900, 600.0, 3_100.0, [0.8, 0.6]).add(900, 1_300.0, 3_100.0, [0.8, 0.6]);
    path.line[900..].fill(2);
    path
}

fn record(description: Description, recorder: &mut Recorder, path: &common::Path) -> Vec<RecordedCut> {
    let mut machine = machine(description);
    let mut cuts = Vec::new();
    machine.push(&path.all(), &mut |batch| cuts.extend(recorder.push(batch, true))).unwrap();
    machine.flush(&mut |batch| cuts.extend(recorder.push(batch, true)));
    cuts.extend(recorder.finish());
    cuts
}

fn recorder(description: &Description, limits: RecordingLimits) -> Recorder {
    Recorder::new(&config(description), limits, Vec::new(), 0).expect("distance sensors")
}

#[test]
fn each_condition_is_kept_with_what_it_was() {
    let description = description(1);
    let mut recorder = recorder(&description, RecordingLimits::default());
    let cuts = record(description.clone(), &mut recorder, &path());
    let lines: Vec<_> = cuts.iter().map(|cut| (cut.conditions.line, cut.spindle_angle_deg.len())).collect();
    assert_eq!(lines, [(1, 10_000), (1, 7_980), (2, 10_000), (2, 8_000)]);
    for cut in &cuts {
        let CutConditions { line, feed_mm_per_min, feed_direction: [x, y], spindle_rev_per_min } = cut.conditions;
        assert!((feed_mm_per_min - if line == 1 { 600.0 } else { 1_300.0 }).abs() < 1e-6, "{feed_mm_per_min}");
        assert!((x - 0.8).abs() < 1e-9 && (y - 0.6).abs() < 1e-9);
        assert!((spindle_rev_per_min - 3_100.0).abs() < 0.01, "{spindle_rev_per_min}");
        assert!(cut.missing.is_empty());
    }
    let records: Vec<_> = cuts.iter().map(|cut| cut_record(cut, 1.5)).collect();
    let learnt = learn(&model(&description), &records).expect("learnt");
    let [low, high] = learnt.tangential_n_per_mm2.interval();
    assert!(low < 2_000.0 && high > 2_000.0 && high - low < 20.0, "{learnt:?}");
}

fn model(description: &Description) -> LearningModel {
    LearningModel {
        sample_rate_hz: 20_000.0,
        edges: 4,
        entry_rad: 25_f64.to_radians(),
        exit_rad: 130_f64.to_radians(),
        mode_x: description.tool.mode_x,
        mode_y: description.tool.mode_y,
    }
}

fn cut_record(cut: &RecordedCut, depth_mm: f64) -> CutRecord<'_> {
    CutRecord {
        deflection_mm: Pair { x: &cut.deflection_mm[0], y: &cut.deflection_mm[1] },
        spindle_angle_deg: &cut.spindle_angle_deg,
        feed_mm_per_min: cut.conditions.feed_mm_per_min,
        depth_mm,
        feed_direction: cut.conditions.feed_direction,
        first_edge_deg: 0.0,
        missing: &cut.missing,
    }
}

#[test]
fn lost_and_wrong_samples_leave_marked_places() {
    let mut description = description(2);
    description.drop_rate = 0.01;
    description.tool_sensors = Some(SensorPair { outlier_rate: 0.01, outlier_size: 5.0, ..SensorPair::default() });
    let mut recorder = recorder(&description, RecordingLimits::default());
    let cuts = record(description.clone(), &mut recorder, &path());
    assert!(cuts.len() >= 2, "{}", cuts.len());
    for cut in &cuts {
        let share = cut.missing.len() as f64 / cut.spindle_angle_deg.len() as f64;
        assert!((0.01..0.03).contains(&share), "{share}");
        let even = cut.spindle_angle_deg.windows(2).all(|pair| (pair[1] - pair[0] - 0.93).abs() < 1e-6);
        assert!(even, "angles of lost samples are between their neighbours");
    }
    let records: Vec<_> = cuts.iter().map(|cut| cut_record(cut, 1.5)).collect();
    let learnt = learn(&model(&description), &records).expect("learnt");
    // Outliers below half a millimetre pass the range of the sensors in none of these cases: noise is what is left.
    assert!((learnt.residual_mm / 1e-4 - 1.0).abs() < 0.05, "{learnt:?}");
}

#[test]
fn an_encoder_that_counts_within_one_turn_gives_the_same_record() {
    let mut description = description(4);
    description.drop_rate = 0.01;
    let mut records =
        [recorder(&description, RecordingLimits::default()), recorder(&description, RecordingLimits::default())];
    let mut cuts = [const { Vec::new() }; 2];
    let mut machine = machine(description);
    let mut push = |batch: &Batch<'_>| {
        let wrapped: Vec<_> = batch.spindle_angle_deg.unwrap().iter().map(|angle| angle.rem_euclid(360.0)).collect();
        cuts[0].extend(records[0].push(batch, true));
        cuts[1].extend(records[1].push(&Batch { spindle_angle_deg: Some(&wrapped), ..*batch }, true));
    };
    machine.push(&path().all(), &mut push).unwrap();
    machine.flush(&mut push);
    for (cuts, recorder) in cuts.iter_mut().zip(&mut records) {
        cuts.extend(recorder.finish());
    }
    let [whole, wrapped] = cuts;
    assert!(whole.len() >= 2, "{}", whole.len());
    assert_eq!(wrapped.len(), whole.len());
    for (wrapped, whole) in wrapped.iter().zip(&whole) {
        assert_eq!(wrapped.deflection_mm, whole.deflection_mm);
        assert_eq!(wrapped.missing, whole.missing);
        let turns = whole.spindle_angle_deg[0] - wrapped.spindle_angle_deg[0];
        let differs = |(wrapped, whole): (&f64, &f64)| (wrapped + turns - whole).abs() > 1e-6;
        assert!(!wrapped.spindle_angle_deg.iter().zip(&whole.spindle_angle_deg).any(differs));
    }
}

#[test]
fn bounds_in_bytes_and_in_stretches_hold() {
    let description = description(3);
    let limits = RecordingLimits { max_bytes: 600_000, ..RecordingLimits::default() };
    let mut bounded = recorder(&description, limits);
    let cuts = record(description.clone(), &mut bounded, &path());
    assert!(!cuts.is_empty() && cuts.iter().map(RecordedCut::bytes).sum::<u64>() <= limits.max_bytes);
    // What was kept before counts.
    let kept: Vec<_> = cuts.iter().map(|cut| cut.conditions).collect();
    let bytes = cuts.iter().map(RecordedCut::bytes).sum();
    let mut further = Recorder::new(&config(&description), limits, kept.clone(), bytes).expect("distance sensors");
    let total: u64 = record(description.clone(), &mut further, &path()).iter().map(RecordedCut::bytes).sum();
    assert!(bytes + total <= limits.max_bytes);
    let mut full =
        Recorder::new(&config(&description), limits, vec![kept[0]; MAX_RECORDED_CUTS], 0).expect("distance sensors");
    assert!(full.is_full() && record(description.clone(), &mut full, &path()).is_empty());
    // A long cut is kept four times.
    let mut long = common::Path::default();
    long.add(4_000, 600.0, 3_100.0, [0.8, 0.6]);
    assert_eq!(record(description.clone(), &mut recorder(&description, RecordingLimits::default()), &long).len(), 4);
}

#[test]
fn what_is_no_steady_cut_is_not_kept() {
    let description = description(4);
    let mut accelerating = common::Path::default();
    for step in 0..600 {
        accelerating.add(1, 300.0 + f64::from(step), 3_100.0, [1.0, 0.0]);
    }
    let keeps = |description: Description, path: &common::Path| {
        let mut recorder = recorder(&description, RecordingLimits::default());
        record(description, &mut recorder, path).len()
    };
    assert_eq!(keeps(description.clone(), &accelerating), 0);
    assert_eq!(keeps(Description { contacts: Vec::new(), ..description.clone() }, &path()), 0, "no contact");
    let lost = Fault { at: Where::Time { from_s: 0.0, to_s: 9.0 }, kind: FaultKind::SensorLost(Mounting::Tool) };
    assert_eq!(keeps(Description { faults: vec![lost], ..description.clone() }, &path()), 0, "no sensor");
    let mut silent = recorder(&description, RecordingLimits::default());
    let mut machine = machine(description.clone());
    let mut cuts = 0;
    machine.push(&path().all(), &mut |batch| cuts += silent.push(batch, false).len()).unwrap();
    assert_eq!(cuts, 0, "the monitor does not measure");
    let mut config = config(&description);
    config.tool =
        config.tool.map(|sensors| feedwave_monitoring::Sensors { quantity: Quantity::Acceleration, ..sensors });
    let refused = Recorder::new(&config, RecordingLimits::default(), Vec::new(), 0);
    assert_eq!(refused.err(), Some(RecordingError::Acceleration));
}
