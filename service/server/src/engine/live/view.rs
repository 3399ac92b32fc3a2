//! What a live run tells the floor of itself.

use std::sync::Arc;

use feedwave_contract::proto::{Decision, Execution};
use feedwave_cutting::{PipelineConfig, SetpointBlock};
use feedwave_monitoring::Monitor;
use feedwave_store::{RunOverride, RunState};
use prost_types::Timestamp;

use crate::floor::{Course, HandedOut, Presence};
use crate::observability::metrics::Metrics;

/// A live run as the floor sees it.
#[derive(Debug)]
pub(super) struct LiveView {
    pub(super) presence: Presence,
    handed_out: HandedOut,
    course: Course,
    metrics: Arc<Metrics>,
}

/// How far a run is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reached<'a> {
    /// Setpoints that the client has taken.
    pub(super) taken: u64,
    /// Setpoints that were handed out.
    pub(super) sent: u64,
    /// Setpoints of the run, where that is known.
    pub(super) total: Option<u64>,
    /// Changes of the feed.
    pub(super) changes: &'a [RunOverride],
    /// The operator holds.
    pub(super) held: bool,
}

impl LiveView {
    pub(super) fn new(presence: Presence, config: &PipelineConfig, metrics: Arc<Metrics>) -> Self {
        let period_s = f64::from(config.interpolation_period_us) * 1e-6;
        Self {
            handed_out: HandedOut::new(&config.profile.machine, config.frame, period_s),
            course: Course::new(period_s, presence.planned_s()),
            presence,
            metrics,
        }
    }

    /// Setpoints were generated.
    pub(super) fn note(&mut self, block: &SetpointBlock) {
        self.metrics.showing(|| self.handed_out.note(block));
        self.presence.touch();
    }

    /// Decisions became durable.
    pub(super) fn decided(&mut self, decisions: &[Decision]) {
        self.metrics.showing(|| self.presence.decided(decisions));
    }

    /// Tells the floor, where it is time.
    pub(super) fn show(&mut self, monitor: &Monitor, reached: Reached<'_>) {
        if self.presence.is_due() {
            self.tell(monitor, reached);
        }
    }

    /// The run came to its end; when, as the log has it.
    pub(super) fn end(&mut self, state: RunState, at: Timestamp, monitor: &Monitor, reached: Reached<'_>) {
        self.tell(monitor, reached);
        self.presence.end(state, at);
        self.presence.tell();
    }

    /// The stream is connected.
    pub(super) fn connect(&mut self, monitor: &Monitor, reached: Reached<'_>) {
        self.presence.arrive();
        self.update(monitor, reached);
        self.presence.connect();
    }

    fn tell(&mut self, monitor: &Monitor, reached: Reached<'_>) {
        let metrics = self.metrics.clone();
        metrics.showing(|| {
            self.update(monitor, reached);
            self.presence.tell();
        });
    }

    fn update(&mut self, monitor: &Monitor, reached: Reached<'_>) {
        let Reached { taken, sent, total, changes, held } = reached;
        let progress = self.course.progress(changes, taken, sent, total);
        let commanded = self.handed_out.taken(taken);
        // Of a run that is taken up nothing was generated again yet.
        let rests = commanded.as_ref().is_none_or(|commanded| commanded.feed_mm_per_min == 0.0);
        self.presence.observe(monitor);
        self.presence.follow(match taken {
            0 => Execution::Ready,
            _ if self.course.ratio() == 0.0 && rests => Execution::Held,
            _ => Execution::Running,
        });
        self.presence.proceed(progress, commanded, self.course.ratio(), held);
    }
}
