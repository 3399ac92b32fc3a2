//! Answers to decisions on the spindle speed that are in force at once: what is in force follows from what the machine says of each.

use crate::common::{Columns, config, cutting, monitor, note, run};
use feedwave_monitoring::{
    Action, Decision, Escalation, Event, Fallback, Monitor, MonitoringConfig, Overrides, Reason, SpindleAnswer,
    SpindleRule,
};

const REACHED: SpindleAnswer = SpindleAnswer::Reached { time_ns: None, rev_per_min: None };

fn turning_rules() -> MonitoringConfig {
    let mut config = config();
    config.rules.feed_bounds.upper = 3.0;
    config.rules.spindle_bounds.upper = 3.0;
    config.rules.fallback = Fallback::Full;
    config.rules.spindle =
        SpindleRule::Turning { lower_deg: 10.0, upper_deg: 20.0, step: 0.05, min_concentration: 0.1 };
    config
}

/// A turning tool that bends to an angle below its limits: each window wants 5 % more speed.
struct Turning {
    monitor: Monitor,
    columns: Columns,
    requests: Vec<u64>,
}

impl Turning {
    /// After so many windows, each with a decision on the speed.
    fn after(windows: usize) -> Self {
        let columns = cutting([0.005, 0.0], windows);
        let mut monitor = monitor(turning_rules());
        let decisions = run(&mut monitor, &columns);
        let mut turning = Self { monitor, columns, requests: Vec::new() };
        turning.keep(&decisions);
        assert_eq!(turning.requests.len(), windows);
        turning
    }

    fn keep(&mut self, decisions: &[Decision]) {
        let changes = |decision: &&Decision| decision.outcome.after.spindle != decision.inputs.before.spindle;
        self.requests.extend(decisions.iter().filter(changes).map(|decision| decision.number));
        assert!(decisions.iter().all(Decision::is_reproduced));
    }

    /// One more window; what was decided.
    fn window(&mut self) -> Vec<Decision> {
        let from = self.columns.len();
        self.columns.add(1_000, [0.005, 0.0], true);
        let sequence = self.monitor.newest_batch().map_or(0, |newest| newest + 1);
        let mut decisions = Vec::new();
        let batch = self.columns.batch(sequence, from, self.columns.len());
        self.monitor.push(&batch, &mut |decision| decisions.push(decision)).unwrap();
        self.keep(&decisions);
        decisions
    }

    /// The machine answers the decision that requested the speed as with this index; a snapshot is in between.
    fn answer(&mut self, request: usize, answer: SpindleAnswer) -> Reason {
        let before = self.monitor.overrides();
        self.monitor = Monitor::restore(&self.monitor.snapshot().unwrap()).unwrap();
        let decision = self.requests[request];
        let decisions = note(&mut self.monitor, Event::SpindleAnswer { decision, answer });
        assert_eq!((decisions.len(), decisions[0].inputs.before), (1, before));
        assert!(decisions[0].is_reproduced());
        assert_eq!(decisions[0].outcome.after, self.monitor.overrides());
        decisions[0].outcome.reason
    }

    /// The speed in force is `steps` steps above the programmed one, and the feed per revolution is the programmed one.
    fn expect(&self, steps: i32) {
        let Overrides { feed, spindle } = self.monitor.overrides();
        assert!((spindle - 1.05_f64.powi(steps)).abs() < 1e-12, "{spindle} is in force, not {steps} steps");
        assert!((feed / spindle - 1.0).abs() < 1e-12, "the feed per revolution is {}", feed / spindle);
    }
}

#[test]
fn speeds_that_are_refused_one_after_the_other_leave_what_was_before_all_of_them() {
    let mut turning = Turning::after(2);
    assert_eq!(turning.answer(0, SpindleAnswer::Refused), Reason::SpindleRefused);
    turning.expect(2);
    assert_eq!(turning.answer(1, SpindleAnswer::Refused), Reason::SpindleRefused);
    turning.expect(0);
    assert_eq!(turning.answer(0, SpindleAnswer::Refused), Reason::SpindleNotAsked, "it was answered");
    // The speed that is wanted from here was refused.
    let decisions = turning.window();
    assert_eq!(decisions.iter().map(|decision| decision.outcome.reason).collect::<Vec<_>>(), [Reason::WithinLimits]);
    turning.expect(0);
}

#[test]
fn the_order_of_refusals_does_not_matter_and_what_is_reached_stays() {
    for (answers, steps) in [
        (vec![(1, SpindleAnswer::Refused), (0, SpindleAnswer::Refused)], 0),
        (vec![(2, SpindleAnswer::Refused), (0, SpindleAnswer::Refused), (1, SpindleAnswer::Refused)], 0),
        (vec![(2, SpindleAnswer::Refused)], 2),
        (vec![(1, SpindleAnswer::Refused)], 3),
        (vec![(1, SpindleAnswer::Refused), (2, SpindleAnswer::Refused)], 1),
        (vec![(0, REACHED), (1, SpindleAnswer::Refused), (2, SpindleAnswer::Refused)], 1),
        (vec![(1, SpindleAnswer::Accepted), (2, SpindleAnswer::Refused), (1, REACHED)], 2),
        (vec![(1, SpindleAnswer::Accepted), (2, SpindleAnswer::Refused), (1, SpindleAnswer::Refused)], 1),
        (vec![(0, SpindleAnswer::Refused), (1, REACHED), (2, SpindleAnswer::Refused)], 2),
    ] {
        let windows = if answers.iter().all(|(request, _)| *request < 2) && steps == 0 { 2 } else { 3 };
        let mut turning = Turning::after(windows);
        for &(request, answer) in &answers {
            assert_ne!(turning.answer(request, answer), Reason::SpindleNotAsked, "{answers:?}");
        }
        turning.expect(steps);
    }
}

#[test]
fn a_decision_before_one_that_is_reached_cannot_be_refused_any_more() {
    let mut turning = Turning::after(2);
    turning.answer(1, REACHED);
    assert_eq!(turning.answer(0, SpindleAnswer::Refused), Reason::SpindleNotAsked);
    turning.expect(2);
}

#[test]
fn of_many_decisions_without_an_answer_the_oldest_count_as_carried_out() {
    let mut turning = Turning::after(18);
    assert_eq!(turning.answer(1, SpindleAnswer::Refused), Reason::SpindleNotAsked);
    for request in (2..18).rev() {
        assert_eq!(turning.answer(request, SpindleAnswer::Refused), Reason::SpindleRefused);
    }
    turning.expect(2);
}

#[test]
fn silence_and_the_operator_take_part() {
    // Back to 100 % is one more decision that may be refused.
    let mut turning = Turning::after(1);
    let last = *turning.columns.time_ns.last().unwrap();
    let silence = note(&mut turning.monitor, Event::Clock(last + 600_000_000));
    turning.keep(&silence);
    turning.expect(0);
    turning.answer(1, SpindleAnswer::Refused);
    turning.expect(1);
    turning.answer(0, SpindleAnswer::Refused);
    turning.expect(0);
    // Who states the overrides in force has answered.
    let mut turning = Turning::after(2);
    let stated = Overrides { feed: 1.0, spindle: 0.9 };
    note(&mut turning.monitor, Event::Overrides { feed: stated.feed, spindle: stated.spindle });
    assert_eq!(turning.answer(1, SpindleAnswer::Refused), Reason::SpindleNotAsked);
    assert_eq!(turning.monitor.overrides(), stated);
}

#[test]
fn while_an_escalation_holds_the_feed_refusals_scale_what_a_resume_takes() {
    let mut config = turning_rules();
    config.rules.spindle_bounds.upper = 1.05 * 1.05;
    config.rules.feed_bounds.lower = 0.5;
    config.rules.feed.step = 0.5;
    config.rules.escalation = Some(Escalation { windows: 1, ..Escalation::default() });
    let columns = cutting([0.05, 0.0], 6);
    let mut monitor = monitor(config);
    let decisions = run(&mut monitor, &columns);
    let held = decisions.iter().any(|decision| decision.outcome.action == Action::HoldFeed);
    assert_eq!((held, monitor.overrides().feed), (true, 0.0));
    // The operator wants the programmed feed per revolution behind the hold.
    let Overrides { spindle, .. } = monitor.overrides();
    note(&mut monitor, Event::Overrides { feed: spindle, spindle });
    let requests: Vec<u64> = decisions
        .iter()
        .filter(|decision| decision.outcome.after.spindle != decision.inputs.before.spindle)
        .map(|decision| decision.number)
        .collect();
    assert_eq!(requests.len(), 2);
    for decision in requests {
        note(&mut monitor, Event::SpindleAnswer { decision, answer: SpindleAnswer::Refused });
        assert_eq!(monitor.overrides().feed, 0.0);
    }
    note(&mut monitor, Event::Resume);
    let Overrides { feed, spindle } = monitor.overrides();
    assert!(spindle == 1.0 && (feed - 1.0).abs() < 1e-12, "{feed}, {spindle}");
}
