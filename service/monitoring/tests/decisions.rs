//! Every rule of docs/functions/adaptive-feed.md ("Decisions") with worked numbers, as pure functions of the inputs.

use feedwave_monitoring::{
    Action, Bound, Evidence, Fallback, HoldReason, Inputs, LineOrigin, Outcome, Overrides, Properties, Property,
    Reason, Rules, SpectralLine, SpindleRule, SpindleTable, decide,
};

fn inputs(max_deviation: f64) -> Inputs {
    Inputs {
        evidence: Evidence::Process(Properties { max_deviation, mean_angle: None, line: None }),
        rules: Rules::default(),
        before: Overrides::FULL,
        programmed_rev_per_min: Some(1000.0),
        current_rev_per_min: Some(1000.0),
        threading: false,
        windows_at_bound: 0,
        held: false,
    }
}

fn with_spindle(max_deviation: f64, spindle: SpindleRule) -> Inputs {
    let mut inputs = inputs(max_deviation);
    inputs.rules.spindle = spindle;
    inputs
}

fn turning(angle_deg: f64) -> Inputs {
    let rule = SpindleRule::Turning { lower_deg: -0.5, upper_deg: 0.5, step: 0.1, min_concentration: 0.1 };
    let mut inputs = with_spindle(0.02, rule);
    inputs.evidence =
        Evidence::Process(Properties { max_deviation: 0.02, mean_angle: Some((angle_deg, 0.9)), line: None });
    inputs
}

fn milling(max_deviation: f64, current_rev_per_min: f64) -> Inputs {
    let table = SpindleTable::from_pairs(&[(800.0, 700.0), (1200.0, 1100.0)]);
    let mut inputs = with_spindle(max_deviation, SpindleRule::Milling { limit: 0.02, table });
    inputs.current_rev_per_min = Some(current_rev_per_min);
    inputs
}

fn keeps(outcome: &Outcome, action: Action, reason: Reason) {
    assert_eq!((outcome.action, outcome.reason, outcome.after), (action, reason, Overrides::FULL));
}

#[test]
fn the_feed_stays_inside_and_on_both_limits() {
    for inside in [0.003, 0.005, 0.01] {
        keeps(&decide(&inputs(inside)), Action::Keep, Reason::WithinLimits);
    }
}

#[test]
fn the_feed_steps_by_the_default_five_and_the_example_two_percent() {
    let outcome = decide(&inputs(0.0029));
    assert_eq!((outcome.action, outcome.reason), (Action::Change, Reason::FeedBelowLimit));
    assert_eq!(outcome.after, Overrides { feed: 1.05, spindle: 1.0 });
    let outcome = decide(&inputs(0.0101));
    assert_eq!((outcome.action, outcome.reason), (Action::Change, Reason::FeedAboveLimit));
    assert_eq!(outcome.after, Overrides { feed: 0.95, spindle: 1.0 });
    let mut example = inputs(0.0101);
    example.rules.feed.step = 0.02;
    assert_eq!(decide(&example).after.feed, 0.98);
    // Multiplicative: the second step starts from the first.
    example.before = decide(&example).after;
    assert_eq!(decide(&example).after.feed, 0.98 * 0.98);
}

#[test]
fn bounds_hold_and_say_so() {
    let mut fast = inputs(0.0);
    fast.before.feed = 1.49;
    let outcome = decide(&fast);
    assert_eq!((outcome.action, outcome.after.feed, outcome.feed_bound), (Action::Change, 1.5, Some(Bound::Upper)));
    fast.before = outcome.after;
    let outcome = decide(&fast);
    assert_eq!((outcome.action, outcome.after.feed, outcome.feed_bound), (Action::Keep, 1.5, Some(Bound::Upper)));
    let mut slow = inputs(1.0);
    slow.before.feed = 0.101;
    let outcome = decide(&slow);
    assert_eq!((outcome.after.feed, outcome.feed_bound), (0.1, Some(Bound::Lower)));
}

#[test]
fn turning_follows_the_angle_and_keeps_the_feed_per_revolution() {
    let outcome = decide(&turning(-0.6));
    assert_eq!((outcome.action, outcome.reason), (Action::Change, Reason::AngleBelowLimit));
    assert_eq!(outcome.after, Overrides { feed: 1.1, spindle: 1.1 });
    let outcome = decide(&turning(0.6));
    assert_eq!(outcome.after, Overrides { feed: 0.9, spindle: 0.9 });
    assert_eq!(outcome.reason, Reason::AngleAboveLimit);
    // Between the angles the feed rule has its turn.
    assert_eq!(decide(&turning(0.5)).reason, Reason::FeedAboveLimit);
    // A direction that scatters is none.
    let mut scattered = turning(0.6);
    scattered.evidence =
        Evidence::Process(Properties { max_deviation: 0.005, mean_angle: Some((0.6, 0.05)), line: None });
    keeps(&decide(&scattered), Action::Keep, Reason::WithinLimits);
    // At the bound of the spindle the feed rule has its turn too, and the bound is said.
    let mut bound = turning(-0.6);
    bound.before.spindle = 1.2;
    let outcome = decide(&bound);
    assert_eq!((outcome.reason, outcome.spindle_bound), (Reason::FeedAboveLimit, Some(Bound::Upper)));
    assert_eq!(outcome.after, Overrides { feed: 0.95, spindle: 1.2 });
}

#[test]
fn milling_takes_the_speed_from_the_band() {
    // (B_{j−1}, B_j]: 800 belongs to the first band, a little more to the second.
    let outcome = decide(&milling(0.02, 800.0));
    assert_eq!((outcome.action, outcome.reason), (Action::Change, Reason::SpeedFromTable));
    assert_eq!(outcome.after, Overrides { feed: 0.7, spindle: 0.7 });
    let outcome = decide(&milling(0.02, 800.1));
    assert_eq!(outcome.after, Overrides { feed: 1.1, spindle: 1.1 });
    // Below D*** there is nothing for the table to do.
    assert_eq!(decide(&milling(0.0199, 800.0)).reason, Reason::FeedAboveLimit);
    // Already at the speed of the table: only the feed can help.
    let mut there = milling(0.02, 1100.0);
    there.before = Overrides { feed: 1.1, spindle: 1.1 };
    assert_eq!(decide(&there).reason, Reason::FeedAboveLimit);
    // The bounds of the spindle hold: 400/1000 is less than 50 %.
    let mut slow = milling(0.02, 800.0);
    slow.rules.spindle = SpindleRule::Milling { limit: 0.02, table: SpindleTable::from_pairs(&[(1200.0, 400.0)]) };
    let outcome = decide(&slow);
    assert_eq!((outcome.after.spindle, outcome.after.feed, outcome.spindle_bound), (0.5, 0.5, Some(Bound::Lower)));
}

#[test]
fn speeds_outside_the_table_or_unknown_hold() {
    keeps(&decide(&milling(0.02, 1200.1)), Action::Hold, Reason::SpeedNotInTable);
    let mut unknown = milling(0.02, 1000.0);
    unknown.current_rev_per_min = None;
    keeps(&decide(&unknown), Action::Hold, Reason::SpeedUnknown);
}

#[test]
fn stops_win_and_threads_hold() {
    let check = |least, most, max_ratio, max_run_out| {
        let evidence = Evidence::ToolCheck { least: [least, 1.0], most: [most, 1.0], max_ratio, max_run_out };
        decide(&Inputs { evidence, threading: true, ..inputs(0.0) })
    };
    // C = 1 %: (1.0 − 0.985)/1.0 = 1.5 % is unfit; with the default of 2 % it is fit.
    keeps(&check(0.985, 1.0, Some(0.01), None), Action::Stop, Reason::ReplaceTool);
    keeps(&check(0.985, 1.0, Some(0.02), None), Action::Keep, Reason::ToolFit);
    keeps(&check(0.985, 1.0, None, Some(0.01)), Action::Stop, Reason::ReplaceTool);
    keeps(&check(0.0, 0.0, Some(0.02), None), Action::Stop, Reason::ReplaceTool);
    // Machine limit 0.001 mm.
    let idle = |difference| {
        let evidence = Evidence::IdleCheck { spindle_rev_per_min: 6000.0, difference, max_difference: 0.001 };
        decide(&Inputs { evidence, ..inputs(0.0) })
    };
    keeps(&idle(0.001), Action::Keep, Reason::MachineFit);
    keeps(&idle(0.0011), Action::Stop, Reason::ServiceMachine);
    keeps(&decide(&Inputs { threading: true, ..inputs(0.5) }), Action::Hold, Reason::Threading);
}

#[test]
fn silence_brings_the_configured_fallback() {
    let silence = |fallback, threading| {
        let mut inputs = inputs(0.0);
        inputs.evidence = Evidence::Silence { tolerated_ns: 500_000_000 };
        inputs.rules.fallback = fallback;
        inputs.before = Overrides { feed: 0.8, spindle: 0.9 };
        inputs.threading = threading;
        let outcome = decide(&inputs);
        (outcome.action, outcome.reason, outcome.after)
    };
    let before = Overrides { feed: 0.8, spindle: 0.9 };
    assert_eq!(silence(Fallback::Hold, false), (Action::Hold, Reason::Silence, before));
    assert_eq!(silence(Fallback::Full, false), (Action::Change, Reason::Silence, Overrides::FULL));
    assert_eq!(silence(Fallback::Full, true), (Action::Hold, Reason::Threading, before));
    assert_eq!(silence(Fallback::Stop, true), (Action::Stop, Reason::Silence, before));
}

#[test]
fn vibration_is_compared_like_deviation() {
    let line = SpectralLine { frequency_hz: 420.0, amplitude: 0.02, origin: LineOrigin::Chatter };
    let mut inputs = inputs(0.005);
    inputs.rules.property = Property::VibrationAmplitude;
    keeps(&decide(&inputs), Action::Hold, Reason::Data(HoldReason::NoSpectrum));
    inputs.evidence = Evidence::Process(Properties { max_deviation: 0.005, mean_angle: None, line: Some(line) });
    assert_eq!(decide(&inputs).reason, Reason::FeedAboveLimit);
    inputs.rules.property = Property::VibrationFrequency;
    (inputs.rules.feed.lower, inputs.rules.feed.upper) = (430.0, 600.0);
    assert_eq!(decide(&inputs).reason, Reason::FeedBelowLimit);
}
