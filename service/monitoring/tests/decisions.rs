//! Every rule of docs/functions/adaptive-feed.md ("Decisions") with worked numbers, as pure functions of the inputs.

use feedwave_monitoring::{
    Action, Bound, Evidence, Fallback, HoldReason, Inputs, LineOrigin, Outcome, Overrides, Properties, Property,
    Reason, Rules, SpectralLine, SpindleAnswer, SpindlePlan, SpindleRequest, SpindleRule, SpindleTable, decide,
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
        spindle: SpindlePlan::default(),
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
    // It lowers the feed there, and does not raise it.
    bound.evidence = Evidence::Process(Properties { max_deviation: 0.001, mean_angle: Some((-0.6, 1.0)), line: None });
    let outcome = decide(&bound);
    assert_eq!((outcome.action, outcome.reason), (Action::Keep, Reason::AngleBelowLimit));
    assert_eq!((outcome.after, outcome.spindle_bound), (bound.before, Some(Bound::Upper)));
    bound.evidence = Evidence::Process(Properties { max_deviation: 0.001, mean_angle: Some((0.0, 1.0)), line: None });
    assert_eq!(decide(&bound).reason, Reason::FeedBelowLimit);
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
fn silence_gives_up_a_speed_that_waits_for_its_place() {
    let waiting = |spindle| SpindleRequest {
        decision: 7,
        spindle,
        from: 1.0,
        accepted: false,
        setpoint_index: None,
        rev_per_min: None,
    };
    let silence = |spindle, request: Option<SpindleRequest>| {
        let mut inputs = inputs(0.005);
        inputs.before = Overrides { feed: 1.0, spindle };
        inputs.evidence = Evidence::Silence { tolerated_ns: 500_000_000 };
        inputs.rules.fallback = Fallback::Full;
        inputs.spindle = SpindlePlan { planned: true, request, refused: None };
        let Outcome { reason, planned_spindle, .. } = decide(&inputs);
        assert_eq!(reason, Reason::Silence);
        planned_spindle
    };
    assert_eq!(silence(1.0, Some(waiting(1.05))), Some(1.0), "the programmed speed is in force, another one waits");
    assert_eq!(silence(1.05, Some(waiting(1.1))), Some(1.0));
    assert_eq!(silence(1.05, None), Some(1.0));
    assert_eq!(silence(1.05, Some(waiting(1.0))), None, "it is requested already");
    assert_eq!(silence(1.0, None), None);
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
    // Noise has a largest line too, anywhere.
    let noise = Some(SpectralLine { amplitude: 1e-6, origin: LineOrigin::Noise, ..line });
    inputs.evidence = Evidence::Process(Properties { max_deviation: 0.005, mean_angle: None, line: noise });
    for limits in [(430.0, 600.0), (50.0, 150.0), (400.0, 500.0)] {
        (inputs.rules.feed.lower, inputs.rules.feed.upper) = limits;
        keeps(&decide(&inputs), Action::Hold, Reason::Data(HoldReason::NoSpectrum));
    }
}

#[test]
fn a_planned_change_leaves_the_overrides_until_the_spindle_has_reached_it() {
    // α 1 rad is above 0.5: q = 10 % slower, planned.
    let planned = SpindlePlan { planned: true, ..SpindlePlan::default() };
    let inputs = Inputs { spindle: planned, ..turning(1.0) };
    let outcome = decide(&inputs);
    keeps(&outcome, Action::Keep, Reason::AngleAboveLimit);
    assert_eq!(outcome.planned_spindle, Some(0.9));

    // While it waits, the feed rule goes on: 0.02 mm is above 0.01 mm, 5 % slower.
    let request = SpindleRequest {
        decision: 3,
        spindle: 0.9,
        from: 1.0,
        accepted: false,
        setpoint_index: Some(700),
        rev_per_min: None,
    };
    let waits = SpindlePlan { request: Some(request), ..planned };
    let slower = decide(&Inputs { spindle: waits, ..inputs.clone() });
    assert_eq!((slower.action, slower.reason, slower.after), (Action::Change, Reason::FeedAboveLimit, full(0.95, 1.0)));

    // Reached: the feed goes with the speed, 0.95 · 0.9 = 0.855.
    let answer = |answer, spindle| {
        let evidence = Evidence::SpindleAnswer { decision: 3, answer, request: Some(request) };
        decide(&Inputs { evidence, before: full(0.95, 1.0), spindle, ..inputs.clone() })
    };
    let reached = answer(SpindleAnswer::Reached { time_ns: Some(5), rev_per_min: None }, waits);
    assert_eq!((reached.action, reached.reason), (Action::Change, Reason::SpindleReached));
    assert!((reached.after.feed - 0.855).abs() < 1e-15 && reached.after.spindle == 0.9);
    for (answered, reason) in
        [(SpindleAnswer::Accepted, Reason::SpindleAccepted), (SpindleAnswer::Refused, Reason::SpindleRefused)]
    {
        let outcome = answer(answered, waits);
        assert_eq!((outcome.action, outcome.reason, outcome.after), (Action::Keep, reason, full(0.95, 1.0)));
    }
    // The same speed is not requested again after a refusal.
    let refused = SpindlePlan { refused: Some(0.9), ..planned };
    assert_eq!(decide(&Inputs { spindle: refused, ..inputs.clone() }).reason, Reason::FeedAboveLimit);
}

#[test]
fn a_speed_in_force_at_once_goes_back_where_the_machine_refuses_it() {
    let request = SpindleRequest {
        decision: 3,
        spindle: 0.9,
        from: 1.0,
        accepted: false,
        setpoint_index: None,
        rev_per_min: None,
    };
    let spindle = SpindlePlan { request: Some(request), ..SpindlePlan::default() };
    let evidence = Evidence::SpindleAnswer { decision: 3, answer: SpindleAnswer::Refused, request: Some(request) };
    let outcome = decide(&Inputs { evidence, before: full(0.9, 0.9), spindle, ..inputs(0.005) });
    assert_eq!((outcome.action, outcome.after), (Action::Change, full(1.0, 1.0)));
    let evidence = Evidence::SpindleAnswer { decision: 4, answer: SpindleAnswer::Refused, request: None };
    let outcome = decide(&Inputs { evidence, before: full(0.9, 0.9), spindle, ..inputs(0.005) });
    assert_eq!((outcome.reason, outcome.after), (Reason::SpindleNotAsked, full(0.9, 0.9)));
}

#[test]
fn what_cannot_be_cut_at_the_present_speed_needs_the_programmed_one() {
    let planned = SpindlePlan { planned: true, ..SpindlePlan::default() };
    let unfit = |before, spindle: f64, plan| {
        let evidence = Evidence::SpindleUnfit { spindle, setpoint_index: 9 };
        decide(&Inputs { evidence, before, spindle: plan, ..inputs(0.005) }).planned_spindle
    };
    assert_eq!(unfit(full(0.9, 0.9), 0.9, planned), Some(1.0));
    let request = SpindleRequest {
        decision: 1,
        spindle: 0.8,
        from: 0.9,
        accepted: false,
        setpoint_index: None,
        rev_per_min: None,
    };
    assert_eq!(unfit(full(0.9, 0.9), 0.8, SpindlePlan { request: Some(request), ..planned }), None);
}

fn full(feed: f64, spindle: f64) -> Overrides {
    Overrides { feed, spindle }
}
