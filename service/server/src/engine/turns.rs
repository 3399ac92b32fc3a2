//! Turns of validations: as many run at a time as there are workers, each for a while, and who waits comes next.
//!
//! A validation that has used up its turn while others wait rests: its thread waits where it is, with everything it has done, and
//! goes on from there. So many may do so at a time (`limits.begun_validations`); one more gives up what it did in its
//! first turn and begins again once there is a place. Where others want a place for long, one that has had it for long gives it up,
//! and has it for twice as long the next time.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use feedwave_store::WaitingJob;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::schedule::{Class, Given, Schedule};
use crate::observability::metrics::Metrics;

/// Turns for which a validation that was never set aside has its place among those begun, however many want it.
const TENURE: u64 = 64;
/// Bound of the doublings of that.
const MOST_DOUBLINGS: u32 = 32;

/// What waits for a turn.
#[derive(Debug)]
enum Waiter {
    /// A stored job, and how often it was set aside; the worker is told.
    Job(WaitingJob, u32),
    /// A request, and how often it was set aside.
    Request(oneshot::Sender<Turn>, u32),
    /// A validation between two turns.
    Resting(oneshot::Sender<()>),
}

#[derive(Debug)]
struct State {
    schedule: Schedule<Waiter>,
    free: usize,
    /// What clients used since other replicas were told.
    untold: HashMap<String, Duration>,
}

/// The turns of one service. Cloning is cheap.
#[derive(Clone, Debug)]
pub(super) struct Turns {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    state: Mutex<State>,
    /// How long a turn is while others wait.
    length: Duration,
    /// Whether other replicas are told of it.
    is_shared: bool,
    jobs: mpsc::UnboundedSender<(WaitingJob, Turn)>,
    metrics: Arc<Metrics>,
    draining: CancellationToken,
    progress: Mutex<HashMap<Uuid, Arc<Progress>>>,
}

/// How far a validation is.
#[derive(Debug, Default)]
pub(super) struct Progress {
    /// Bytes of the program read.
    pub(super) bytes_read: AtomicU64,
    /// Setpoints generated.
    pub(super) setpoint_count: AtomicU64,
}

/// How far a job's validation is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ValidationProgress {
    /// About how many validations begin up to this one; 0 once it has begun.
    pub queue_place: u64,
    /// Bytes of the program read.
    pub bytes_read: u64,
    /// Setpoints generated.
    pub setpoint_count: u64,
}

/// What a validation does when its turn is over.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// It goes on.
    GoOn,
    /// It gives up what it has done and begins again later.
    SetAside,
}

/// The right to compute. Dropping it ends the validation's part in the schedule.
#[derive(Debug)]
pub(super) struct Turn {
    turns: Turns,
    client: String,
    class: Class,
    suspect: bool,
    /// Since when it has the worker; `None` while it rests.
    since: Option<Instant>,
    /// When to look next whether others wait.
    due: Instant,
    /// How often it was set aside.
    times: u32,
    /// Turns that it had since it was begun.
    had: u64,
}

impl Turns {
    /// Turns for so many workers; the second value is told of jobs whose turn has come.
    pub(super) fn new(
        workers: usize,
        most_begun: usize,
        length: Duration,
        is_shared: bool,
        metrics: Arc<Metrics>,
        draining: CancellationToken,
    ) -> (Self, mpsc::UnboundedReceiver<(WaitingJob, Turn)>) {
        let (jobs, receiver) = mpsc::unbounded_channel();
        let state =
            Mutex::new(State { schedule: Schedule::new(most_begun, length), free: workers, untold: HashMap::new() });
        let inner = Inner { state, length, is_shared, jobs, metrics, draining, progress: Mutex::default() };
        (Self { inner: Arc::new(inner) }, receiver)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Only whole changes are made under the lock.
        self.inner.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn progresses(&self) -> MutexGuard<'_, HashMap<Uuid, Arc<Progress>>> {
        self.inner.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets a stored job wait for its first turn.
    pub(super) fn add_job(&self, job: WaitingJob) {
        let (id, client) = (job.id, job.client.clone());
        let (bytes, suspect) = (job.program_size_bytes, job.attempts > 0);
        self.state().schedule.add(&client, bytes, Some(id), suspect, Waiter::Job(job, 0));
        self.dispatch();
    }

    /// Lets a job wait again that was set aside so often.
    pub(super) fn set_aside(&self, job: WaitingJob, times: u32) {
        let (id, client, suspect) = (job.id, job.client.clone(), job.attempts > 0);
        self.inner.metrics.validations_set_aside.inc();
        self.state().schedule.set_aside(&client, Some(id), suspect, Waiter::Job(job, times));
        self.dispatch();
    }

    /// Waits for a turn for a request of `client` that was set aside so often. `None` when the service ends.
    pub(super) async fn request(&self, client: &str, program_bytes: u64, times: u32) -> Option<Turn> {
        let (sender, receiver) = oneshot::channel();
        let waiter = Waiter::Request(sender, times);
        if times > 0 {
            self.inner.metrics.validations_set_aside.inc();
            self.state().schedule.set_aside(client, None, false, waiter);
        } else {
            self.state().schedule.add(client, program_bytes, None, false, waiter);
        }
        self.dispatch();
        tokio::select! {
            turn = receiver => turn.ok(),
            () = self.inner.draining.cancelled() => None,
        }
    }

    /// Whether no validation waits or is under way.
    pub(super) fn is_idle(&self) -> bool {
        self.state().schedule.is_idle()
    }

    /// What clients used since this was asked last.
    pub(super) fn take_untold(&self) -> Vec<(String, Duration)> {
        std::mem::take(&mut self.state().untold).into_iter().collect()
    }

    /// Charges what clients used at other replicas.
    pub(super) fn charge_elsewhere<'a>(&self, used: impl IntoIterator<Item = (&'a str, Duration)>) {
        let mut state = self.state();
        for (client, used) in used {
            state.schedule.charge_elsewhere(client, used);
        }
    }

    /// Gives turns to who waits, as long as there are workers.
    fn dispatch(&self) {
        loop {
            let Given { what, client, class, suspect } = {
                let mut state = self.state();
                if state.free == 0 {
                    return;
                }
                let Some(given) = state.schedule.next() else { return };
                state.free -= 1;
                self.inner.metrics.begun_validations.set(i64::try_from(state.schedule.begun()).unwrap_or(i64::MAX));
                given
            };
            self.inner.metrics.validation_turns.inc();
            let now = Instant::now();
            let turn = |client, times| {
                let (turns, due) = (self.clone(), now + self.inner.length);
                Turn { turns, client, class, suspect, since: Some(now), due, times, had: 0 }
            };
            match what {
                // Where nobody waits any more the turn ends as it is dropped, and the next one comes.
                Waiter::Job(job, times) => drop(self.inner.jobs.send((job, turn(client, times)))),
                Waiter::Request(request, times) => drop(request.send(turn(client, times))),
                Waiter::Resting(resting) => {
                    // It was interrupted by the end of the service.
                    if resting.send(()).is_err() {
                        let mut state = self.state();
                        state.free += 1;
                        state.schedule.turn_ended(&client);
                    }
                }
            }
        }
    }

    /// Shows how far a job is from now on.
    pub(super) fn track(&self, id: Uuid) -> Arc<Progress> {
        self.progresses().entry(id).or_default().clone()
    }

    /// Ends to show how far a job is.
    pub(super) fn untrack(&self, id: Uuid) {
        self.progresses().remove(&id);
    }

    /// Jobs whose validation has begun and not ended.
    pub(super) fn jobs_under_way(&self) -> u64 {
        self.progresses().len() as u64
    }

    /// How far these jobs are; those that neither wait nor are validated are left out.
    pub(super) fn progress(&self, jobs: &[Uuid]) -> HashMap<Uuid, ValidationProgress> {
        let places = self.state().schedule.places(jobs);
        let mut found: HashMap<Uuid, ValidationProgress> = places
            .into_iter()
            .map(|(id, queue_place)| (id, ValidationProgress { queue_place, ..ValidationProgress::default() }))
            .collect();
        let tracked = self.progresses();
        for id in jobs {
            if let Some(progress) = tracked.get(id) {
                let shown = ValidationProgress {
                    queue_place: 0,
                    bytes_read: progress.bytes_read.load(Ordering::Relaxed),
                    setpoint_count: progress.setpoint_count.load(Ordering::Relaxed),
                };
                found.insert(*id, shown);
            }
        }
        found
    }
}

impl Turn {
    /// How often it was set aside.
    pub(super) const fn times(&self) -> u32 {
        self.times
    }

    /// Begins to compute: what was waited for until now is nobody's turn.
    pub(super) fn start(&mut self) {
        let now = Instant::now();
        self.since = Some(now);
        self.due = now + self.turns.inner.length;
    }

    /// Whether it is another validation's turn.
    pub(super) fn is_over(&mut self) -> bool {
        let now = Instant::now();
        if now < self.due {
            return false;
        }
        if self.turns.state().schedule.has_next() {
            return true;
        }
        // Time that nobody else wanted is nobody's loss.
        self.since = self.since.map(|_| now);
        self.due = now + self.turns.inner.length;
        false
    }

    /// Lets others have their turn; blocks until the next one. The end of the service interrupts it: then it is for the
    /// caller to stop.
    pub(super) fn rest(&mut self) -> Next {
        let turns = self.turns.clone();
        let granted = {
            let mut state = turns.state();
            if self.class == Class::Fresh && !state.schedule.begin(&self.client) {
                return Next::SetAside;
            }
            if self.class == Class::Begun {
                self.had += 1;
                // Twice as long each time, so that every validation that ends at all ends, with at most as much in vain.
                let tenure = TENURE << self.times.min(MOST_DOUBLINGS);
                if self.had >= tenure && state.schedule.wants_place(&self.client) {
                    return Next::SetAside;
                }
            }
            self.give_back(&mut state);
            self.class = Class::Begun;
            let (sender, granted) = oneshot::channel();
            state.schedule.rest(&self.client, self.suspect, Waiter::Resting(sender));
            granted
        };
        turns.dispatch();
        let granted = tokio::runtime::Handle::current().block_on(async {
            tokio::select! {
                biased;
                granted = granted => granted.is_ok(),
                () = turns.inner.draining.cancelled() => false,
            }
        });
        let now = Instant::now();
        self.since = granted.then_some(now);
        self.due = now + turns.inner.length;
        Next::GoOn
    }

    /// Charges the time and frees the worker.
    fn give_back(&mut self, state: &mut State) {
        if let Some(since) = self.since.take() {
            let used = since.elapsed();
            state.schedule.charge(&self.client, self.class, used);
            if self.turns.inner.is_shared {
                *state.untold.entry(self.client.clone()).or_default() += used;
            }
            state.schedule.turn_ended(&self.client);
            state.free += 1;
        }
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        let turns = self.turns.clone();
        {
            let mut state = turns.state();
            self.give_back(&mut state);
            state.schedule.leave(&self.client, self.class == Class::Begun, self.suspect);
        }
        turns.dispatch();
    }
}
