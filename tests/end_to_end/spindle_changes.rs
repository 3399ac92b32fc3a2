//! Planned changes of the spindle speed in live runs: requested between sections, answered, logged, and the same bits again.

use feedwave_contract::proto::machine_event::Event;
use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::spindle_rule::Rule;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    Decision, DecisionReason, FeedChangeCause, ListDecisionsRequest, MachineEvent, MonitoringConfig, OverrideBounds,
    ReplayRunRequest, RunSettings, RunState, SetMonitoringRequest, SpindleAnswer, SpindleAnswerKind, SpindleRule,
    TelemetryBatch, TurningRule,
};
use feedwave_tests::{Home, LiveClient, Server};

use crate::{FEEDWAVE, live_runs, live_threads};

/// Two sections at 1000 rev/min. The first with D = 2.5 and 2A = 1.2 feeds per revolution breaks its chip at 1050 rev/min, but not
/// at 1200; the second, with D = 2.1, has D = 2 at 1050 rev/min and breaks none there.
const SECTIONS: &str = "G21 G97 S1000 M3\nG0 X6. Z2.\nG200 F41.66666667 A0.03\nG1 Z4. F0.05\nG201\nG0 X8.\nG0 Z2.\n\
                        G200 F35. A0.1\nG1 Z4. F0.05\nG201\nG0 X10.\nM30\n";

/// Monitoring that wants a faster spindle by this step, since the mean angle of the deflection is 0.
fn faster_by(step: f64) -> MonitoringConfig {
    let rule = TurningRule { lower_deg: 10.0, upper_deg: 20.0, step: Some(step), ..Default::default() };
    let mut config = live_runs::config();
    let rules = config.rules.as_mut().expect("it has rules");
    rules.spindle = Some(SpindleRule { rule: Some(Rule::Turning(rule)) });
    // At 1050 rev/min the first section breaks its chip up to an override of 1.174.
    rules.feed_bounds = Some(OverrideBounds { lower: 0.125, upper: 1.15 });
    config
}

struct Driven {
    server: Server,
    run: LiveClient,
    next_batch: u64,
}

impl Driven {
    /// A run whose first window has been decided on, before any setpoint.
    async fn begin(program: &str, step: f64) -> Self {
        Self::begin_with(program, faster_by(step)).await
    }

    /// The same under another monitoring.
    async fn begin_with(program: &str, config: MonitoringConfig) -> Self {
        let server = Home::new(FEEDWAVE, "").start().await;
        let job = server.connect().await.submit(program).await.job.name;
        let mut telemetry = TelemetryClient::new(server.connect().await.channel);
        let request = SetMonitoringRequest { job: job.clone(), config: Some(config) };
        telemetry.set_monitoring(request).await.expect("the configuration is valid");
        let channel = server.connect().await.channel;
        let run = LiveClient::begin(channel, &job, RunSettings::default()).await.expect("the run begins");
        let mut driven = Self { server, run, next_batch: 0 };
        // Ten for the baseline, ten for the window, and what contact and settling take.
        for _ in 0..24 {
            driven.batch(Vec::new()).await;
        }
        driven.decided(2).await;
        driven
    }

    async fn batch(&mut self, events: Vec<MachineEvent>) {
        let batch = TelemetryBatch { events, ..live_runs::batch(self.next_batch) };
        self.say(batch).await;
    }

    /// A batch in which the tool bends across, which wants a slower spindle.
    async fn batch_across(&mut self) {
        let mut batch = live_runs::batch(self.next_batch);
        batch.tool.iter_mut().flat_map(|tool| &mut tool.y).for_each(|y| *y += 0.1);
        self.say(batch).await;
    }

    async fn say(&mut self, batch: TelemetryBatch) {
        self.next_batch += 1;
        self.run.say(Request::Batch(batch)).await;
    }

    /// Reads until there are so many decisions; the last.
    async fn decided(&mut self, count: usize) -> Decision {
        while self.run.decisions.len() < count {
            assert_eq!(self.run.next().await.expect("the run goes on"), None);
        }
        self.run.decisions[count - 1].clone()
    }

    /// Answers, and reads the record of it.
    async fn answer(&mut self, decision_number: u64, kind: SpindleAnswerKind, rev_per_min: Option<f64>) -> Decision {
        let reached_ns = rev_per_min.map(|_| 1_234);
        let note = "by the control".to_owned();
        let answer = SpindleAnswer { decision_number, kind: kind.into(), reached_ns, rev_per_min, note };
        let count = self.run.decisions.len() + 1;
        self.batch(vec![MachineEvent { event: Some(Event::SpindleAnswer(answer)) }]).await;
        let decision = self.decided(count).await;
        assert_eq!(decision.note, "by the control");
        decision
    }

    /// Reads and takes setpoints until another change of the speed is requested; it.
    async fn requested(&mut self) -> feedwave_contract::proto::RunSpindleRequest {
        let before = self.run.spindle_requests.len();
        self.run.credit(u64::MAX).await;
        while self.run.spindle_requests.len() == before {
            assert_eq!(self.run.next().await.expect("the run goes on"), None);
            self.run.receipt().await;
        }
        self.run.spindle_requests[before]
    }

    /// Proves that log and setpoints come again as they were.
    async fn prove(self) -> Vec<Decision> {
        let Self { server, run, .. } = self;
        let channel = server.connect().await.channel;
        let request = ListDecisionsRequest { run: run.started.run.clone(), page_size: 500, ..Default::default() };
        let listed = TelemetryClient::new(channel.clone()).list_decisions(request).await.expect("the log").into_inner();
        let request = ReplayRunRequest { run: run.started.run, start_index: 0 };
        let replayed = RunsClient::new(channel).replay_run(request).await.expect("a replay").into_inner();
        assert!(replayed.identical, "{replayed:?}");
        assert_eq!(replayed.setpoint_count, run.next_index);
        assert_eq!(replayed.decision_count, listed.decisions.len() as u64);
        listed.decisions
    }
}

fn reason(decision: &Decision) -> DecisionReason {
    decision.outcome.as_ref().expect("an outcome").reason()
}

/// Degrees that the spindle turns behind a setpoint, in a period of 1 ms.
fn turned(setpoints: &[Vec<u64>], column: usize, index: u64) -> f64 {
    let angle = |index: u64| f64::from_bits(setpoints[usize::try_from(index).expect("small")][column]);
    angle(index + 1) - angle(index)
}

// One run through its sections, each of which begins with what the one before left.
#[tokio::test]
async fn a_speed_is_requested_between_sections_and_in_force_once_it_is_reached() {
    let mut driven = Driven::begin(SECTIONS, 0.05).await;
    let planned = driven.run.decisions[1].clone();
    let outcome = planned.outcome.expect("an outcome");
    assert_eq!((reason(&planned), outcome.planned_spindle), (DecisionReason::AngleBelowLimit, Some(1.05)));
    assert_eq!(outcome.after.map(|after| (after.feed, after.spindle)), Some((1.0, 1.0)), "nothing changes yet");

    let request = driven.requested().await;
    assert_eq!((request.decision_number, request.spindle, request.rev_per_min), (1, 1.05, Some(1_050.0)));
    let place = request.setpoint_index;
    assert_eq!(driven.run.next_index, place, "nothing behind the place is sent");
    // An answer to nothing, and a speed that is not the one requested, are logged and change nothing.
    let early = driven.answer(99, SpindleAnswerKind::Reached, Some(1_050.0)).await;
    assert_eq!(reason(&early), DecisionReason::SpindleNotAsked);
    let accepted = driven.answer(1, SpindleAnswerKind::Accepted, None).await;
    assert_eq!(reason(&accepted), DecisionReason::SpindleAccepted);
    let slow = driven.answer(1, SpindleAnswerKind::Reached, Some(1_000.0)).await;
    assert_eq!(reason(&slow), DecisionReason::SpindleNotAsked);

    // The request is made again after a kill.
    let name = driven.run.started.run.clone();
    let setpoints = std::mem::take(&mut driven.run.setpoints);
    let server = driven.server.kill().await.start().await;
    let channel = server.connect().await.channel;
    let mut run = LiveClient::take_up(channel, &name, place).await.expect("the run is taken up");
    run.setpoints = setpoints;
    let next_batch = run.started.durable_batch.expect("batches are durable") + 1;
    driven = Driven { server, run, next_batch };
    assert_eq!(driven.requested().await, request);
    assert_eq!(driven.run.next_index, place);
    let reached = driven.answer(1, SpindleAnswerKind::Reached, Some(1_051.0)).await;
    assert_eq!(reason(&reached), DecisionReason::SpindleReached);
    let after = reached.outcome.and_then(|outcome| outcome.after).expect("overrides");
    assert_eq!((after.feed, after.spindle), (1.05, 1.05), "the feed per revolution stays");

    // The second section would not break its chip at that speed: the programmed one is requested before it.
    let back = driven.requested().await;
    assert_eq!((back.spindle, back.rev_per_min), (1.0, Some(1_000.0)));
    let unfit = driven.run.decisions.last().expect("a decision").clone();
    assert_eq!((reason(&unfit), unfit.number), (DecisionReason::SpindleUnfit, back.decision_number));
    assert!(unfit.note.starts_with("VIB-CHIP-UNBROKEN in line 8: the chip does not break in line 9"), "{}", unfit.note);
    driven.answer(back.decision_number, SpindleAnswerKind::Reached, None).await;
    let ended = driven.run.finish().await.expect("the run comes to its end");
    assert_eq!(ended.state(), RunState::Finished);

    let told: Vec<_> = driven.run.changes.iter().map(|change| (change.cause(), change.spindle)).collect();
    let ratios = told.iter().map(|(cause, spindle)| {
        assert_eq!(*cause, FeedChangeCause::Spindle);
        spindle.map(|spindle| (spindle.setpoint_index, spindle.ratio))
    });
    assert!(ratios.eq([Some((place, 1.05)), Some((back.setpoint_index, 1.0))]), "{told:?}");
    let header = driven.run.started.header.clone().expect("a header");
    let kind = feedwave_contract::proto::ColumnKind::SpindleAngle;
    let column = header.columns.iter().position(|column| column.kind() == kind).expect("a column of the spindle");
    let setpoints = std::mem::take(&mut driven.run.setpoints);
    for (index, degrees) in [(place - 3, 6.0), (place + 3, 6.3), (back.setpoint_index + 3, 6.0)] {
        assert!((turned(&setpoints, column, index) - degrees).abs() < 1e-6, "behind setpoint {index}");
    }
    let log = driven.prove().await;
    assert_eq!(
        log.iter().map(|decision| decision.number).collect::<Vec<_>>(),
        (0..log.len() as u64).collect::<Vec<_>>()
    );
}

#[tokio::test]
async fn a_speed_at_which_the_chip_would_not_break_is_refused_in_the_log() {
    let mut driven = Driven::begin(SECTIONS, 0.2).await;
    assert_eq!(driven.run.decisions[1].outcome.and_then(|outcome| outcome.planned_spindle), Some(1.2));
    let ended = driven.run.finish().await.expect("the run comes to its end");
    assert_eq!(
        (ended.state(), driven.run.spindle_requests.len(), driven.run.changes.len()),
        (RunState::Finished, 0, 0)
    );
    let log = driven.prove().await;
    let unfit = log.last().expect("a decision");
    assert_eq!(reason(unfit), DecisionReason::SpindleUnfit);
    assert!(unfit.note.starts_with("VIB-CHIP-UNBROKEN in line 3: the chip does not break in line 4"), "{}", unfit.note);
}

#[tokio::test]
async fn a_thread_is_cut_at_the_speed_that_was_reached_before_it() {
    let mut driven = Driven::begin(live_threads::THREAD, 0.05).await;
    let request = driven.requested().await;
    assert_eq!((request.spindle, request.rev_per_min), (1.05, Some(630.0)));
    driven.answer(request.decision_number, SpindleAnswerKind::Reached, Some(630.0)).await;
    let ended = driven.run.finish().await.expect("the run comes to its end");
    assert_eq!(ended.state(), RunState::Finished);
    let columns = &driven.run.started.header.as_ref().expect("a header").columns;
    let of = |name: &str| columns.iter().position(|column| column.name == name).expect("a column");
    let (z, spindle) = (of("Z_mm"), of("spindle_angle_deg"));
    let value = |index: usize, column: usize| f64::from_bits(driven.run.setpoints[index][column]);
    let place = usize::try_from(request.setpoint_index).expect("small");
    assert_eq!(value(place - 1, z), 2.0, "before the thread");
    // In the middle of the thread: a revolution of 360 degrees for each 1.5 mm, 630 of them in a minute.
    let middle = (place..driven.run.setpoints.len()).find(|&index| value(index, z) < -14.0).expect("it is cut");
    let steps = [z, spindle].map(|column| value(middle + 1, column) - value(middle, column));
    assert!((steps[1] - 3.78).abs() < 1e-6 && (steps[0] + 1.5 / 360.0 * 3.78).abs() < 1e-6, "{steps:?}");
    driven.prove().await;
}

#[tokio::test]
async fn a_speed_that_the_client_refuses_changes_nothing() {
    let mut driven = Driven::begin(SECTIONS, 0.05).await;
    let request = driven.requested().await;
    let refused = driven.answer(request.decision_number, SpindleAnswerKind::Refused, None).await;
    assert_eq!(reason(&refused), DecisionReason::SpindleRefused);
    let ended = driven.run.finish().await.expect("the run comes to its end");
    assert_eq!((ended.state(), driven.run.changes.len()), (RunState::Finished, 0));
    // Nor is the same speed requested again.
    assert_eq!(driven.run.spindle_requests.len(), 1);
    driven.prove().await;
}

#[tokio::test]
async fn the_programmed_speed_that_a_decision_wants_may_be_refused() {
    // The sections of SECTIONS that may be cut at 1050 rev/min.
    let section = "G0 Z2.\nG200 F41.66666667 A0.03\nG1 Z4. F0.05\nG201\nG0 X8.\n";
    let program = format!("G21 G97 S1000 M3\nG0 X6. Z2.\n{}M30\n", section.repeat(3));
    let mut config = faster_by(0.05);
    let rules = config.rules.as_mut().expect("it has rules");
    rules.spindle_bounds = Some(OverrideBounds { lower: 1.0, upper: 1.2 });
    let mut driven = Driven::begin_with(&program, config).await;
    let request = driven.requested().await;
    driven.answer(request.decision_number, SpindleAnswerKind::Reached, None).await;
    for _ in 0..12 {
        driven.batch_across().await;
    }
    let back = driven.requested().await;
    assert_eq!((back.spindle, back.rev_per_min), (1.0, Some(1_000.0)));
    // Everything can be cut at the speed in force: the run goes on at it.
    let refused = driven.answer(back.decision_number, SpindleAnswerKind::Refused, None).await;
    let after = refused.outcome.and_then(|outcome| outcome.after).expect("overrides");
    assert_eq!((reason(&refused), after.spindle), (DecisionReason::SpindleRefused, 1.05));
    let ended = driven.run.finish().await.expect("the run comes to its end");
    assert_eq!((ended.state(), driven.run.spindle_requests.len()), (RunState::Finished, 2));
    driven.prove().await;
}
