//! One machine of the floor: its runs, what its log raised, and the state that follows.

use std::collections::BTreeSet;
use std::sync::Arc;

use feedwave_contract::names;
use feedwave_contract::proto::{
    Availability, Execution, MachineCondition, MachineState, ProcessReading, RunActivity,
    RunCondition as ConditionMessage, RunKind,
};
use tokio::sync::Notify;
use uuid::Uuid;

use super::{MAX_LOGGED, Shown, alarms};

/// Most conditions of a state.
pub(super) const MAX_CONDITIONS: usize = 32;

/// What is known of a run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RunView {
    pub(super) id: Uuid,
    pub(super) job_id: Uuid,
    /// Place in the order in which runs began.
    pub(super) sequence: i64,
    pub(super) activity: RunActivity,
    /// Conditions that are not in the log.
    pub(super) alarms: Vec<MachineCondition>,
}

impl RunView {
    /// Whether its client is there.
    pub(super) fn is_available(&self) -> bool {
        self.activity.availability() == Availability::Available
    }

    /// Whether it is over for good: a stop of telemetry is not, since such a run can be taken up.
    pub(super) fn has_ended(&self) -> bool {
        match self.activity.execution() {
            Execution::Finished => true,
            Execution::Stopped => self.activity.kind() == RunKind::Live,
            _ => false,
        }
    }
}

/// A stream of this replica.
#[derive(Clone, Debug)]
pub(super) struct Here {
    /// Counts up with every stream of the run, at whichever replica.
    pub(super) attachment: u64,
    /// Rung where another stream may have taken the run up: the store knows.
    pub(super) doubt: Arc<Notify>,
}

/// A run whose stream is connected.
#[derive(Debug)]
pub(super) struct Connected {
    /// Tells streams of the same run apart.
    pub(super) ticket: u64,
    pub(super) view: RunView,
    /// Its job was deleted: it is forgotten with its stream.
    pub(super) forgotten: bool,
    /// `None`: the stream is another replica's.
    pub(super) here: Option<Here>,
}

impl Connected {
    /// Another stream may have taken the run up.
    pub(super) fn doubt(&self) {
        if let Some(here) = &self.here {
            here.doubt.notify_one();
        }
    }
}

/// A condition that a decision raised.
#[derive(Clone, Debug)]
pub(super) struct Logged {
    pub(super) run: Uuid,
    pub(super) job_id: Uuid,
    pub(super) condition: ConditionMessage,
    /// What the window of the decision showed, where that is known.
    pub(super) reading: Option<ProcessReading>,
}

#[derive(Debug)]
pub(super) struct Machine {
    pub(super) display_name: String,
    /// Its version, while it is in the store.
    pub(super) etag: Option<String>,
    /// The newest stream last.
    pub(super) connected: Vec<Connected>,
    /// The newest run whose stream is not connected.
    pub(super) resting: Option<RunView>,
    pub(super) logged: Vec<Logged>,
    pub(super) finished: u64,
    pub(super) shown: Arc<Shown>,
}

impl Machine {
    pub(super) fn new(id: &str) -> Self {
        let state = MachineState { machine: names::machine(id), ..MachineState::default() };
        Self {
            display_name: String::new(),
            etag: None,
            connected: Vec::new(),
            resting: None,
            logged: Vec::new(),
            finished: 0,
            shown: Shown::new(0, state, String::new()),
        }
    }

    /// The run that the state is about: of those whose clients are there the one that moves, of several the one that was
    /// connected last; otherwise the newest.
    pub(super) fn run(&self) -> Option<&RunView> {
        let motion = |view: &&RunView| match view.activity.execution() {
            Execution::Running => 2,
            Execution::Held => 1,
            _ => 0,
        };
        let connected = || self.connected.iter().map(|connected| &connected.view);
        let moving = connected().filter(|view| view.is_available()).max_by_key(motion);
        moving.or_else(|| connected().chain(&self.resting).max_by_key(|view| view.sequence))
    }

    /// Runs whose clients are there, but for the one that is shown.
    pub(super) fn others(&self) -> u32 {
        let available = self.connected.iter().filter(|connected| connected.view.is_available());
        let runs: BTreeSet<Uuid> = available.map(|connected| connected.view.id).collect();
        u32::try_from(runs.len().saturating_sub(1)).unwrap_or(u32::MAX)
    }

    /// A stream is connected. A run has one stream, that of the client that took it up last: the former ones are over, though
    /// they may not know it yet. Which one that is of two replicas' is for the store to say, which those of this one ask.
    pub(super) fn join(&mut self, new: Connected) {
        let run = new.view.id;
        self.resting = self.resting.take().filter(|resting| resting.id != run);
        if let Some(here) = &new.here {
            let is_newer = |old: &Here| old.attachment > here.attachment;
            if self.connected.iter().any(|old| old.view.id == run && old.here.as_ref().is_some_and(is_newer)) {
                return new.doubt();
            }
        }
        self.connected.retain(|old| {
            if old.view.id != run {
                return true;
            }
            old.doubt();
            new.here.is_none() && old.here.is_some()
        });
        self.connected.push(new);
    }

    /// The stream with this ticket is gone, and this is left of its run; what others are to be told of it.
    pub(super) fn part(&mut self, ticket: u64, view: Option<RunView>) -> Option<RunView> {
        let place = self.connected.iter().position(|connected| connected.ticket == ticket)?;
        let Connected { forgotten, here, .. } = self.connected.remove(place);
        let view = view.filter(|_| !forgotten)?;
        let is_told = self.settle(view.clone()) && here.is_some();
        is_told.then_some(view)
    }

    /// Shows what is left of a run one of whose streams is gone, unless another one goes on with it; whether it is shown.
    pub(super) fn settle(&mut self, view: RunView) -> bool {
        let is_of_run = |connected: &Connected| connected.view.id == view.id;
        if view.has_ended() {
            // Nobody goes on with it.
            self.connected.iter().filter(|connected| is_of_run(connected)).for_each(Connected::doubt);
            self.connected.retain(|connected| !is_of_run(connected));
        } else if self.connected.iter().any(is_of_run) {
            return false;
        }
        self.rest(view);
        true
    }

    /// Keeps what is left of a run whose stream is gone, and counts it where it came to its end. What another replica
    /// says of an earlier stream may come later.
    fn rest(&mut self, view: RunView) {
        if self.resting.as_ref().is_some_and(|resting| resting.id == view.id && resting.has_ended()) {
            return;
        }
        self.finished += u64::from(view.activity.execution() == Execution::Finished);
        if self.resting.as_ref().is_none_or(|resting| resting.sequence <= view.sequence) {
            self.resting = Some(view);
        }
    }

    /// Takes in what the log says: its newest run, how many finished, and its conditions. What a run that was connected
    /// meanwhile has told is newer.
    pub(super) fn recall(&mut self, newest: Option<RunView>, finished: u64, logged: Vec<Logged>) {
        let is_news = |view: &RunView| {
            self.connected.iter().all(|connected| connected.view.id != view.id)
                && self.resting.as_ref().is_none_or(|resting| resting.sequence < view.sequence)
        };
        if let Some(view) = newest.filter(is_news) {
            self.resting = Some(view);
        }
        self.finished = self.finished.max(finished);
        self.know(logged);
    }

    /// Takes in conditions that are not known yet.
    pub(super) fn know(&mut self, logged: Vec<Logged>) {
        for new in logged {
            let known =
                |old: &Logged| old.run == new.run && old.condition.decision_number == new.condition.decision_number;
            if !self.logged.iter().any(known) {
                self.logged.push(new);
            }
        }
    }

    /// Whether any run that it shows or remembers is of this job.
    pub(super) fn knows_job(&self, job_id: Uuid) -> bool {
        let views = self.connected.iter().map(|connected| &connected.view).chain(&self.resting);
        let mut jobs = views.map(|view| view.job_id).chain(self.logged.iter().map(|logged| logged.job_id));
        jobs.any(|job| job == job_id)
    }

    pub(super) fn state(&self) -> MachineState {
        let run = self.run();
        let activity = run.map(|view| &view.activity);
        let unavailable = Availability::Unavailable;
        MachineState {
            machine: self.shown.state.machine.clone(),
            display_name: self.display_name.clone(),
            availability: activity.map_or(unavailable, RunActivity::availability).into(),
            execution: activity.map_or(Execution::Idle, RunActivity::execution).into(),
            execution_time: activity.and_then(|activity| activity.execution_time),
            run: activity.cloned(),
            other_runs: self.others(),
            conditions: self.conditions(run),
            finished_runs: self.finished,
        }
    }

    pub(super) fn conditions(&self, run: Option<&RunView>) -> Vec<MachineCondition> {
        let logged = self.logged.iter().map(alarms::of_log);
        let mut conditions: Vec<_> =
            run.into_iter().flat_map(|view| view.alarms.iter().cloned()).chain(logged).collect();
        // The worst first, of these the newest; what was acknowledged comes behind what was not.
        let rank = |condition: &MachineCondition| {
            let time = condition.raise_time.map_or((0, 0), |time| (time.seconds, time.nanos));
            let waits = condition.needs_acknowledgement && condition.acknowledge_time.is_none();
            std::cmp::Reverse((condition.severity, waits, time))
        };
        conditions.sort_by_key(rank);
        conditions.truncate(MAX_CONDITIONS);
        conditions
    }

    /// Forgets conditions that were acknowledged and hold nothing any more.
    pub(super) fn forget_acknowledged(&mut self) {
        let views = self.connected.iter().map(|connected| &connected.view).chain(&self.resting);
        let held: Vec<Uuid> = views.filter(|view| view.activity.feed_held).map(|view| view.id).collect();
        self.logged.retain(|logged| logged.condition.acknowledge_time.is_none() || held.contains(&logged.run));
        let surplus = self.logged.len().saturating_sub(MAX_LOGGED as usize);
        self.logged.drain(..surplus);
    }

    pub(super) fn is_needed(&self) -> bool {
        self.etag.is_some() || !self.connected.is_empty()
    }
}
