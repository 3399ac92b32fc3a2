//! State machine of one run: one tool on one machine (docs/functions/adaptive-feed.md,
//! "State machine of one run").

mod contact;
pub(crate) mod input;
mod judging;
mod silence;
mod snapshot;
mod spindle;
mod window;

use crate::batch::{Batch, BatchError, Event, EventError, Receipt};
use crate::channel::Worth;
use crate::config::{MonitoringConfig, Violation};
use crate::decision::{Decision, HoldReason, Overrides, SpindlePlan};
use crate::spectrum::Analyser;
use contact::Contact;
use input::{Channels, Sample};
use serde::{Deserialize, Serialize};
use silence::Silence;
pub use snapshot::SnapshotError;
use spindle::Requests;
use window::Window;

/// State of the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// Idle at the lowest spindle speed: X_i⁰, Y_i⁰ are collected.
    Baseline,
    /// Idle, the given step of the run-up, from 0.
    IdleRunUp {
        /// Step.
        step: u32,
    },
    /// Ready; the tool has not touched the work yet.
    WaitingForContact,
    /// Waiting time after contact.
    Settling,
    /// Windows are collected while tool and work touch; every full one gives a decision.
    Measuring,
    /// Stopped by a decision; [`Event::Rebaseline`] starts over.
    Stopped,
}

/// What a snapshot keeps besides the configuration.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Run {
    state: State,
    channels: Channels,
    contact: Contact,
    window: Window,
    /// X_i⁰, Y_i⁰, and the tool they belong to.
    baseline: Vec<[f64; 2]>,
    baseline_tool: u32,
    tool: u32,
    /// Time since first contact, ns.
    settled_ns: u64,
    last_ns: Option<u64>,
    clock_ns: Option<u64>,
    silence: Silence,
    overrides: Overrides,
    /// Feed override that a resume takes, while an escalation holds the feed.
    held_feed: Option<f64>,
    /// Windows in a row with the property above its limit at the lower feed bound.
    windows_at_bound: u32,
    programmed_rev_per_min: Option<f64>,
    threading: bool,
    /// A thread was being cut at some time of the window in progress.
    threaded: bool,
    newest_batch: Option<u64>,
    samples: u64,
    decisions: u64,
    /// From here on: what snapshots of earlier versions lack, one after the other.
    spindle: SpindlePlan,
    requests: Requests,
}

/// Turns samples and events into decisions.
///
/// Samples are judged one by one, so batch boundaries do not matter. Between decisions nothing is allocated.
#[derive(Debug, Clone)]
pub struct Monitor {
    config: MonitoringConfig,
    times: Times,
    analyser: Option<Analyser>,
    run: Run,
}

/// Times of the configuration in ns.
#[derive(Debug, Clone, Copy)]
struct Times {
    period: u64,
    max_gap: u64,
    silence: u64,
    stale: u64,
    settling: u64,
}

impl Times {
    fn new(config: &MonitoringConfig) -> Self {
        let ns = |seconds: f64| (seconds * 1e9).round() as u64;
        Self {
            period: ns(1.0 / config.sample_rate_hz),
            max_gap: ns(config.quality.max_gap_s),
            silence: ns(config.quality.silence_s),
            stale: ns(config.quality.stale_s),
            settling: ns(config.settling_s),
        }
    }
}

impl Monitor {
    /// A run at its beginning, with tool 0 in the spindle.
    ///
    /// # Errors
    /// Everything that is wrong with the configuration, one violation per field.
    pub fn new(config: MonitoringConfig) -> Result<Self, Vec<Violation>> {
        let violations = config.violations();
        if !violations.is_empty() {
            return Err(violations);
        }
        let mut window = Window::new(&config);
        window.restart(config.baseline, &config);
        let run = Run {
            state: State::Baseline,
            channels: Channels::default(),
            contact: Contact::default(),
            baseline: vec![[0.0; 2]; window.points.len()],
            window,
            baseline_tool: 0,
            tool: 0,
            settled_ns: 0,
            last_ns: None,
            clock_ns: None,
            silence: Silence::None,
            overrides: Overrides::FULL,
            held_feed: None,
            windows_at_bound: 0,
            programmed_rev_per_min: None,
            threading: false,
            threaded: false,
            newest_batch: None,
            samples: 0,
            decisions: 0,
            spindle: SpindlePlan::default(),
            requests: Requests::default(),
        };
        Ok(Self::with_run(config, run))
    }

    fn with_run(config: MonitoringConfig, run: Run) -> Self {
        let analyser = config.spectrum.map(|spectrum| Analyser::new(spectrum.samples));
        Self { times: Times::new(&config), analyser, config, run }
    }

    /// Plans changes of the spindle speed for places between sections: what is cut depends on the speed.
    #[must_use]
    pub fn planning_spindle(mut self) -> Self {
        self.run.spindle.planned = true;
        self
    }

    /// How changes of the spindle speed come into force, and what is known of the last one.
    pub fn spindle(&self) -> SpindlePlan {
        self.run.spindle
    }

    /// The configuration.
    pub fn config(&self) -> &MonitoringConfig {
        &self.config
    }

    /// State of the run.
    pub fn state(&self) -> State {
        self.run.state
    }

    /// Whether tool and work touch; measuring pauses while they do not.
    pub fn in_contact(&self) -> bool {
        self.run.contact.touching
    }

    /// Whether tool and work touch in a run that is judged then: what was measured last is of a cut that goes on.
    pub fn is_cutting(&self) -> bool {
        self.in_contact() && matches!(self.run.state, State::Settling | State::Measuring)
    }

    /// Overrides in force as far as the monitor knows.
    pub fn overrides(&self) -> Overrides {
        self.run.overrides
    }

    /// Whether an escalation holds the feed, until [`Event::Resume`].
    pub fn holds_feed(&self) -> bool {
        self.run.held_feed.is_some()
    }

    /// Number of the tool in the spindle; 0 until one is named.
    pub fn tool(&self) -> u32 {
        self.run.tool
    }

    /// Programmed spindle speed as it was told last, rev/min.
    pub fn programmed_rev_per_min(&self) -> Option<f64> {
        self.run.programmed_rev_per_min
    }

    /// X_i⁰, Y_i⁰ by angular point (one in time), once [`State::Baseline`] is left.
    pub fn baseline(&self) -> &[[f64; 2]] {
        &self.run.baseline
    }

    /// Number of the newest batch taken: a sender resumes with the one after.
    pub fn newest_batch(&self) -> Option<u64> {
        self.run.newest_batch
    }

    /// Takes a batch and hands every decision to `sink`, in order.
    ///
    /// # Errors
    /// [`BatchError`] when the batch cannot be read; nothing of it is taken.
    pub fn push(&mut self, batch: &Batch<'_>, sink: &mut dyn FnMut(Decision)) -> Result<Receipt, BatchError> {
        batch.check()?;
        let receipt = match self.run.newest_batch {
            Some(newest) if batch.sequence <= newest => return Ok(Receipt::Dropped { newest }),
            Some(newest) if batch.sequence > newest + 1 => {
                self.run.window.invalidate(HoldReason::BatchGap);
                self.run.window.interrupt();
                self.run.channels.interrupt();
                Receipt::AcceptedAfterGap { first: newest + 1, last: batch.sequence - 1 }
            }
            _ => Receipt::Accepted,
        };
        self.run.newest_batch = Some(batch.sequence);
        let missing = input::lacks_column(batch, &self.config);
        for index in 0..batch.time_ns.len() {
            let sample = input::read(batch, index, missing, &self.config, &mut self.run.channels);
            self.take(&sample, sink);
        }
        Ok(receipt)
    }

    /// Takes an event that happened after the last sample.
    ///
    /// # Errors
    /// [`EventError`] when the event is impossible; nothing changes.
    pub fn note(&mut self, event: Event, sink: &mut dyn FnMut(Decision)) -> Result<(), EventError> {
        match event {
            Event::ProgrammedSpindle { rev_per_min } => {
                if !(0.0..=1e6).contains(&rev_per_min) {
                    return Err(EventError::SpindleSpeed(rev_per_min));
                }
                if self.run.programmed_rev_per_min.replace(rev_per_min) != Some(rev_per_min) {
                    self.run.spindle.refused = None;
                }
            }
            Event::Overrides { feed, spindle } => self.take_overrides(Overrides { feed, spindle })?,
            Event::Resume => {
                if let Some(feed) = self.run.held_feed.take() {
                    self.run.overrides.feed = feed;
                    self.run.windows_at_bound = 0;
                    // What was collected so far was cut without feed.
                    self.restart_window();
                    self.settle_silence(sink);
                }
            }
            Event::Threading(threading) => {
                self.run.threading = threading;
                self.run.threaded |= threading;
                self.settle_silence(sink);
            }
            Event::Tool(tool) => {
                if tool != self.run.tool {
                    self.run.tool = tool;
                    self.run.windows_at_bound = 0;
                    self.run.spindle.refused = None;
                    // What was collected so far mixes two tools.
                    self.run.window.invalidate(HoldReason::OtherTool);
                }
            }
            Event::Rebaseline => {
                self.run.contact = Contact::default();
                self.run.windows_at_bound = 0;
                self.enter(State::Baseline);
            }
            Event::SpindleAnswer { decision, answer } => self.answer(decision, answer, sink),
            Event::SpindlePlace { setpoint_index, rev_per_min } => {
                if let Some(request) = &mut self.run.spindle.request {
                    request.setpoint_index = setpoint_index;
                    request.rev_per_min = rev_per_min;
                }
            }
            Event::SpindleUnfit { spindle, setpoint_index } => self.drop_spindle(spindle, setpoint_index, sink),
            Event::Clock(now_ns) => {
                self.run.clock_ns = Some(now_ns);
                if self.run.last_ns.is_some_and(|last| now_ns.saturating_sub(last) > self.times.silence) {
                    self.fall_silent(sink);
                }
            }
            Event::ClockUnknown => self.run.clock_ns = None,
            Event::ClockSet(now_ns) => {
                self.run.clock_ns = Some(now_ns);
                self.run.last_ns = None;
                self.distrust();
            }
        }
        Ok(())
    }

    fn take_overrides(&mut self, overrides: Overrides) -> Result<(), EventError> {
        let rules = &self.config.rules;
        for (which, value, bounds) in
            [("feed", overrides.feed, rules.feed_bounds), ("spindle", overrides.spindle, rules.spindle_bounds)]
        {
            if !(bounds.lower..=bounds.upper).contains(&value) {
                return Err(EventError::Override { which, value, lower: bounds.lower, upper: bounds.upper });
            }
        }
        // Who states the speed in force answers all decisions on it.
        if !self.run.spindle.planned && overrides.spindle != self.run.overrides.spindle {
            self.run.requests.clear();
            self.run.spindle = SpindlePlan::default();
        }
        self.run.overrides = overrides;
        // A hold ends with a resume only.
        if let Some(held_feed) = &mut self.run.held_feed {
            *held_feed = overrides.feed;
            self.run.overrides.feed = 0.0;
        }
        Ok(())
    }

    /// Time since the sample before, in ns, and whether the time stamp can be believed.
    #[inline]
    fn step_ns(&mut self, time_ns: u64, sink: &mut dyn FnMut(Decision)) -> u64 {
        let is_ahead = |of: Option<u64>, by: u64| of.is_some_and(|of| time_ns.saturating_sub(of) > by);
        if is_ahead(self.run.last_ns, self.times.max_gap) && is_ahead(self.run.clock_ns, self.times.stale) {
            // Nothing has been stamped then: it is no silence, and what follows is not late.
            self.distrust();
            return self.times.period;
        }
        let last = self.run.last_ns.replace(time_ns);
        let was_silent = self.run.silence != Silence::None;
        let age = self.run.clock_ns.map_or(0, |clock| clock.saturating_sub(time_ns));
        // What arrives as late as a silence is long does not end it: its fallback comes once.
        if age <= self.times.silence {
            self.run.silence = Silence::None;
        }
        if age > self.times.stale {
            self.run.window.invalidate(HoldReason::Stale);
        }
        let Some(last) = last else { return self.times.period };
        let step = time_ns.saturating_sub(last);
        if step > 0 && step <= self.times.max_gap {
            return step;
        }
        if step == 0 {
            self.run.window.invalidate(HoldReason::TimeOutOfOrder);
        } else {
            if step > self.times.silence && !was_silent {
                // The silence ended before a clock event reported it.
                self.run.last_ns = Some(last);
                self.fall_silent(sink);
                self.run.silence = Silence::None;
                self.run.last_ns = Some(time_ns);
            }
            self.run.window.invalidate(HoldReason::TimeGap);
        }
        self.run.window.interrupt();
        self.run.channels.interrupt();
        // A stamp that cannot be believed still moves the window on, so that every window ends.
        self.times.period
    }

    /// A time stamp cannot be believed: the window is void, and what is before does not go on behind.
    #[cold]
    fn distrust(&mut self) {
        self.run.window.invalidate(HoldReason::TimeOutOfOrder);
        self.run.window.interrupt();
        self.run.channels.interrupt();
    }

    #[inline]
    fn take(&mut self, sample: &Sample, sink: &mut dyn FnMut(Decision)) {
        let step_ns = self.step_ns(sample.time_ns, sink);
        let index = self.run.samples;
        self.run.samples += 1;
        let valid = sample.worth == Worth::Good && !sample.missing;
        let point = if valid { self.run.window.points.index(sample.angle_deg) } else { 0 };
        let working = matches!(self.run.state, State::WaitingForContact | State::Settling | State::Measuring);
        if working {
            let touched = self.run.contact.touching;
            let deviation = valid.then(|| {
                let [x, y] = self.run.baseline[point];
                [sample.value[0] - x, sample.value[1] - y]
            });
            self.run.contact.update(self.config.contact, sample.contact, deviation);
            if touched && !self.run.contact.touching {
                self.run.window.interrupt();
            }
        }
        match self.run.state {
            State::Baseline => {}
            State::IdleRunUp { step } => {
                if !self.runs_at_step(step, sample.rev_per_min) {
                    self.run.window.interrupt();
                    return;
                }
            }
            State::WaitingForContact if self.run.contact.touching => {
                self.enter(State::Settling);
                return;
            }
            State::WaitingForContact | State::Stopped => return,
            State::Settling => {
                self.run.settled_ns += step_ns;
                if self.run.settled_ns < self.times.settling {
                    return;
                }
                self.enter(State::Measuring);
                if !self.run.contact.touching {
                    return;
                }
            }
            State::Measuring if !self.run.contact.touching => return,
            State::Measuring => {}
        }
        self.collect(sample, index, point, valid, step_ns);
        if self.run.window.is_over() {
            self.finish(sample.time_ns, sink);
        }
    }

    /// Whether the spindle turns at the speed of a step of the run-up.
    fn runs_at_step(&self, step: u32, measured_rev_per_min: Option<f64>) -> bool {
        let Some(idle) = &self.config.idle_run_up else { return false };
        let programmed = self.run.programmed_rev_per_min.map(|rev_per_min| rev_per_min * self.run.overrides.spindle);
        let speed = idle.spindle_rev_per_min[step as usize];
        measured_rev_per_min
            .or(programmed)
            .is_some_and(|rev_per_min| (rev_per_min - speed).abs() <= idle.speed_tolerance * speed)
    }

    #[inline]
    fn collect(&mut self, sample: &Sample, index: u64, point: usize, valid: bool, step_ns: u64) {
        let window = &mut self.run.window;
        window.count(sample.time_ns, index, step_ns);
        // Half a period of jitter is none; more means that samples were dropped in transit.
        if window.span.samples > 1 && step_ns > self.times.period + self.times.period / 2 {
            let dropped = (step_ns + self.times.period / 2) / self.times.period - 1;
            window.span.removed.dropped = window.span.removed.dropped.saturating_add(dropped.min(1 << 20) as u32);
            if let Some(record) = &mut window.record {
                record.repeat(dropped);
            }
        }
        if let Some(rev_per_min) = sample.rev_per_min {
            window.measured_speed(rev_per_min);
        }
        if valid {
            window.span.valid += 1;
            window.points.add(point, sample.value, &self.run.baseline);
            if let Some(record) = &mut window.record {
                record.push(sample.value);
            }
            return;
        }
        if let Some(record) = &mut window.record {
            record.repeat(1);
        }
        let removed = &mut window.span.removed;
        if sample.missing {
            removed.missing += 1;
            window.invalidate(HoldReason::SensorMissing);
            return;
        }
        match sample.worth {
            Worth::Good => {}
            Worth::NonFinite => removed.non_finite += 1,
            Worth::OutOfRange => removed.out_of_range += 1,
            Worth::Spike => removed.spikes += 1,
            Worth::Stuck => {
                removed.stuck += 1;
                window.invalidate(HoldReason::StuckSensor);
            }
        }
    }

    fn enter(&mut self, state: State) {
        self.run.state = state;
        self.run.settled_ns = 0;
        self.restart_window();
    }

    fn restart_window(&mut self) {
        let length = match (self.run.state, &self.config.idle_run_up) {
            (State::Baseline, _) => self.config.baseline,
            (State::IdleRunUp { .. }, Some(idle)) => idle.length,
            _ => self.config.window,
        };
        // In the baseline's own window nothing is subtracted.
        if self.run.state == State::Baseline {
            self.run.baseline.fill([0.0; 2]);
        }
        self.run.window.restart(length, &self.config);
        self.run.threaded = self.run.threading;
    }
}
