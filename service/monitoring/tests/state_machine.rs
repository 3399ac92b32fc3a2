//! The states of docs/functions/adaptive-feed.md ("State machine of one run") with their worked numbers, from samples
//! to decisions.

use crate::common::{Columns, PERIOD_NS, config, cutting, monitor, note, run};
use feedwave_monitoring::{
    Action, Batch, ContactSource, Event, Evidence, Grouping, IdleRunUp, Length, LineOrigin, Overrides, Pair, Quantity,
    Reason, Sensors, SpectrumConfig, State, ToolCheck,
};
use std::f64::consts::TAU;

fn properties(decision: &feedwave_monitoring::Decision) -> feedwave_monitoring::Properties {
    match decision.inputs.evidence {
        Evidence::Process(properties) => properties,
        other => panic!("no process window: {other:?}"),
    }
}

#[test]
fn a_deflection_of_3_4_5_is_measured_to_size_and_angle() {
    let mut monitor = monitor(config());
    let decisions = run(&mut monitor, &cutting([0.03, 0.04], 2));
    let reasons: Vec<_> = decisions.iter().map(|decision| decision.outcome.reason).collect();
    assert_eq!(reasons, [Reason::ToolFit, Reason::FeedAboveLimit, Reason::FeedAboveLimit]);
    let measured = properties(&decisions[1]);
    assert!((measured.max_deviation - 0.05).abs() < 1e-5);
    let (angle, concentration) = measured.mean_angle.unwrap();
    assert!((angle - libm::atan2(0.04, 0.03).to_degrees()).abs() < 5e-3 && concentration > 0.999_99);
    assert_eq!(decisions[2].outcome.after.feed, 0.98 * 0.98);
    // The settling time of 2 s follows contact and is not repeated: windows follow each other.
    let (first, second) = (decisions[1].span, decisions[2].span);
    assert_eq!((first.first_sample, first.samples, first.valid), (401 + 1999, 1000, 1000));
    assert_eq!(second.first_sample, first.first_sample + 1000);
    assert_eq!(second.first_ns, first.last_ns + PERIOD_NS);
    assert!(decisions.iter().all(feedwave_monitoring::Decision::is_reproduced));
}

#[test]
fn the_baseline_takes_three_series_of_all_points_and_is_subtracted_once() {
    let mut monitor = monitor(config());
    let mut columns = Columns::default();
    // Run-out of 0.004 mm, once per revolution: 0.8 % of the stand-off, below C = 1 %.
    columns.add(3400, [0.0; 2], false);
    for index in 0..columns.len() {
        columns.x[index] += 0.004 * libm::cos(columns.angle_deg[index].to_radians());
        columns.contact[index] = index >= 400;
    }
    let decisions = run(&mut monitor, &columns);
    assert_eq!(decisions[0].outcome.reason, Reason::ToolFit);
    // 100 samples a revolution: the third pass of the last point ends as the fourth revolution begins.
    assert_eq!(decisions[0].span.samples, 301);
    assert!((monitor.baseline()[0][0] - 1.004).abs() < 1e-4);
    assert!((monitor.baseline()[18][0] - 0.996).abs() < 1e-4);
    // With the baseline subtracted nothing of the run-out is left.
    assert!(properties(&decisions[1]).max_deviation < 1e-4, "{:?}", decisions[1]);
}

#[test]
fn a_tool_that_runs_out_is_refused_until_a_new_baseline() {
    let mut monitor = monitor(config());
    let mut columns = cutting([0.05, 0.0], 1);
    for (x, angle) in columns.x.iter_mut().zip(&columns.angle_deg) {
        *x += 0.006 * libm::cos(angle.to_radians());
    }
    let decisions = run(&mut monitor, &columns);
    assert_eq!(decisions.len(), 1);
    assert_eq!((decisions[0].outcome.action, decisions[0].outcome.reason), (Action::Stop, Reason::ReplaceTool));
    assert_eq!(monitor.state(), State::Stopped);
    note(&mut monitor, Event::Rebaseline);
    assert_eq!(monitor.state(), State::Baseline);
}

#[test]
fn the_idle_run_up_passes_step_by_step_or_stops_the_machine() {
    for (difference, expected) in [(0.0009, Reason::MachineFit), (0.0012, Reason::ServiceMachine)] {
        let mut config = config();
        config.idle_run_up = Some(IdleRunUp {
            spindle_rev_per_min: vec![600.0, 1200.0],
            speed_tolerance: 0.02,
            length: Length::Series(3),
            max_difference: 0.001,
        });
        let mut monitor = monitor(config);
        let mut columns = Columns::default();
        columns.add(800, [0.0; 2], false).add(200, [0.5, 0.5], false).add(500, [0.0, -difference], false);
        // From 800 on the spindle runs up, through speeds that belong to no step, then at the second step.
        columns.rev_per_min[800..1000].fill(900.0);
        columns.rev_per_min[1000..].fill(1200.0);
        let decisions = run(&mut monitor, &columns);
        let reasons: Vec<_> = decisions.iter().map(|decision| decision.outcome.reason).collect();
        assert_eq!(reasons, [Reason::ToolFit, Reason::MachineFit, expected]);
        let stopped = expected == Reason::ServiceMachine;
        assert_eq!(monitor.state(), if stopped { State::Stopped } else { State::WaitingForContact });
    }
}

#[test]
fn leaving_the_work_pauses_measuring() {
    let mut monitor = monitor(config());
    let mut columns = Columns::default();
    columns.add(400, [0.0; 2], false).add(2500, [0.05, 0.0], true).add(700, [9.0, 9.0], false);
    columns.add(600, [0.05, 0.0], true);
    let decisions = run(&mut monitor, &columns);
    assert_eq!(decisions.len(), 2);
    assert!((properties(&decisions[1]).max_deviation - 0.05).abs() < 1e-5, "air was measured");
    assert_eq!(decisions[1].span.samples, 1000);
}

#[test]
fn contact_is_detected_without_a_flag() {
    let mut config = config();
    config.contact = ContactSource::Detected { threshold: 0.02, on_samples: 5, off_samples: 20 };
    let mut monitor = monitor(config);
    let mut columns = Columns::default();
    columns.add(400, [0.0; 2], false);
    columns.add(4, [0.05, 0.0], false).add(50, [0.0; 2], false);
    assert_eq!(run(&mut monitor, &columns).len(), 1);
    assert_eq!(monitor.state(), State::WaitingForContact, "four samples are not enough");
    let from = columns.len();
    columns.add(3010, [0.05, 0.0], false);
    let mut decisions = Vec::new();
    monitor.push(&columns.batch(1, from, columns.len()), &mut |decision| decisions.push(decision)).unwrap();
    assert_eq!((monitor.state(), monitor.in_contact(), decisions.len()), (State::Measuring, true, 1));
    let from = columns.len();
    columns.add(20, [0.0; 2], false);
    monitor.push(&columns.batch(2, from, columns.len()), &mut |_| {}).unwrap();
    assert!(!monitor.in_contact());
}

#[test]
fn windows_by_series_end_with_the_third_pass() {
    let mut config = config();
    config.window = Length::Series(3);
    let mut monitor = monitor(config);
    let decisions = run(&mut monitor, &cutting([0.005, 0.0], 1));
    assert_eq!(decisions.len(), 4);
    assert!(decisions[1..].iter().all(|decision| (300..=303).contains(&decision.span.samples)));
    assert!(decisions[1..].iter().all(|decision| decision.outcome.reason == Reason::WithinLimits));
}

#[test]
fn series_too_short_to_decide_on_go_on_until_there_are_enough_samples() {
    let mut config = config();
    config.window = Length::Series(3);
    (config.quality.min_valid_samples, config.quality.stuck_samples) = (390, 100);
    let mut monitor = monitor(config);
    let decisions = run(&mut monitor, &cutting([0.005, 0.0], 1));
    // Three revolutions are 300 samples.
    assert!(decisions[0].span.valid == 390 && decisions[0].outcome.reason == Reason::ToolFit, "{:?}", decisions[0]);
    assert_eq!(decisions.len(), 3);
    assert!(decisions[1..].iter().all(|decision| decision.span.valid == 390));
}

#[test]
fn points_in_time_need_no_angle() {
    let mut config = config();
    config.grouping = Grouping::Time { samples_per_point: 10 };
    config.baseline = Length::Seconds(0.4);
    let mut monitor = monitor(config);
    let mut columns = cutting([0.0, 0.02], 1);
    // One point of ten samples exceeds the window: it is the largest deviation.
    for y in &mut columns.y[2500..2540] {
        *y += 0.03;
    }
    let mut decisions = Vec::new();
    let batch = Batch { spindle_angle_deg: None, ..columns.batch(0, 0, columns.len()) };
    monitor.push(&batch, &mut |decision| decisions.push(decision)).unwrap();
    assert_eq!(decisions.len(), 2);
    assert!((properties(&decisions[1]).max_deviation - 0.05).abs() < 1e-5);
}

#[test]
fn the_vector_is_that_of_the_tool_relative_to_the_work() {
    let mut config = config();
    config.work = config.tool;
    config.tool_check = ToolCheck { max_ratio: None, max_run_out: Some(0.01) };
    let mut monitor = monitor(config);
    let columns = cutting([0.05, 0.0], 1);
    let work = cutting([0.042, 0.0], 1);
    let mut decisions = Vec::new();
    let batch = Batch { work: Some(Pair { x: &work.x, y: &work.y }), ..columns.batch(0, 0, columns.len()) };
    monitor.push(&batch, &mut |decision| decisions.push(decision)).unwrap();
    assert!((properties(&decisions[1]).max_deviation - 0.008).abs() < 1e-9);
    assert_eq!(decisions[1].outcome.reason, Reason::WithinLimits);
}

#[test]
fn strain_becomes_displacement_and_commanded_acceleration_is_subtracted() {
    let mut strain = config();
    strain.tool = Some(Sensors { quantity: Quantity::Strain { mm_per_strain: 50.0 }, min: -1.0, max: 1.0 });
    strain.tool_check = ToolCheck { max_ratio: None, max_run_out: Some(0.01) };
    let mut columns = cutting([0.05, 0.0], 1);
    columns.x.iter_mut().chain(&mut columns.y).for_each(|value| *value = (*value - 1.0) / 50.0);
    let decisions = run(&mut monitor(strain), &columns);
    assert!((properties(&decisions[1]).max_deviation - 0.05).abs() < 1e-5);

    let mut acceleration = config();
    acceleration.tool = Some(Sensors { quantity: Quantity::Acceleration, min: -1e6, max: 1e6 });
    acceleration.tool_check = ToolCheck::default();
    let columns = cutting([300.0, 400.0], 1);
    let commanded: Vec<f64> = columns.contact.iter().map(|&contact| if contact { 294.0 } else { 0.0 }).collect();
    let commanded_y: Vec<f64> = columns.contact.iter().map(|&contact| if contact { 392.0 } else { 0.0 }).collect();
    let mut decisions = Vec::new();
    let batch =
        Batch { commanded: Some(Pair { x: &commanded, y: &commanded_y }), ..columns.batch(0, 0, columns.len()) };
    monitor(acceleration).push(&batch, &mut |decision| decisions.push(decision)).unwrap();
    assert!((properties(&decisions[1]).max_deviation - 10.0).abs() < 1e-4);
}

#[test]
fn chatter_is_named_with_its_frequency() {
    for (frequency_hz, expected) in [(40.0, LineOrigin::EdgePassing(1)), (87.3, LineOrigin::Chatter)] {
        let mut config = config();
        config.spectrum = Some(SpectrumConfig {
            samples: 512,
            min_frequency_hz: 5.0,
            noise_floor: 1e-4,
            harmonic_tolerance_hz: 2.0,
            edges: 4,
        });
        let mut monitor = monitor(config);
        let mut columns = cutting([0.005, 0.0], 1);
        for index in 400..columns.len() {
            columns.x[index] += 0.002 * libm::sin(TAU * frequency_hz * 1e-3 * index as f64);
        }
        let decisions = run(&mut monitor, &columns);
        let line = properties(&decisions[1]).line.unwrap();
        assert_eq!(line.origin, expected);
        assert!((line.frequency_hz - frequency_hz).abs() < 0.02, "{line:?}");
        assert!((line.amplitude - 0.002).abs() < 1e-5, "{line:?}");
    }
}

#[test]
fn a_thread_holds_to_the_end_of_the_window_in_which_its_pass_ends() {
    // Windows end before samples 3400, 4400 and 5400.
    for (pass, held) in [([2500, 2510], 1), ([3000, 3399], 1), ([3000, 3400], 2), ([3000, 5000], 3)] {
        let mut monitor = monitor(config());
        let columns = cutting([0.05, 0.0], 3);
        let mut decisions = Vec::new();
        let mut sink = |decision| decisions.push(decision);
        let cuts = [0, pass[0], pass[1], columns.len()];
        for (sequence, part) in cuts.windows(2).enumerate() {
            monitor.push(&columns.batch(sequence as u64, part[0], part[1]), &mut sink).unwrap();
            monitor.note(Event::Threading(sequence == 0), &mut sink).unwrap();
        }
        let reasons: Vec<_> = decisions[1..].iter().map(|decision| decision.outcome.reason).collect();
        let expected: Vec<_> =
            (0..3).map(|window| if window < held { Reason::Threading } else { Reason::FeedAboveLimit }).collect();
        assert_eq!(reasons, expected, "{pass:?}");
        assert_eq!(decisions[held].outcome.after, Overrides::FULL);
        assert!(decisions[1..].iter().all(|decision| decision.inputs.threading == (decision.number <= held as u64)));
    }
}

#[test]
fn angles_on_both_sides_of_half_a_turn_have_their_mean_there() {
    let mut monitor = monitor(config());
    let mut columns = cutting([-0.05, 0.0], 1);
    // Half of the points are deflected to +170°, the others to −170°: the mean is 180°, not 0.
    let sideways = 0.05 * libm::tan(10f64.to_radians());
    for index in 400..columns.len() {
        columns.y[index] += if columns.angle_deg[index].rem_euclid(360.0) < 180.0 { sideways } else { -sideways };
    }
    let decisions = run(&mut monitor, &columns);
    let (angle, concentration) = properties(&decisions[1]).mean_angle.unwrap();
    assert!((angle.abs() - 180.0).abs() < 0.05, "{angle}");
    assert!((concentration - libm::cos(10f64.to_radians())).abs() < 1e-3, "{concentration}");
}
