//! What machines do now: one live model per machine, filled by the runs that are connected, read by all that shows it.
//!
//! Invariants: a run tells of itself a few times a second at most, whether anybody looks or not, so that its cost is
//! bounded; whoever looks takes the newest state when it can, so that nothing queues up for slow readers. What is here is
//! never asked for a decision and can be made anew from the log. There is a floor for each tenant, with all machines and no
//! runs but its own.

mod alarms;
mod course;
mod elsewhere;
mod floors;
mod follow;
mod handed_out;
mod machine;
mod presence;
mod restore;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Bound;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use feedwave_contract::json;
use feedwave_contract::proto::{MachineState, RunActivity, RunCondition as ConditionMessage};
use tokio::sync::{Notify, watch};
use tokio::time::{Instant, sleep_until};
use uuid::Uuid;

pub(crate) use course::Course;
pub(crate) use elsewhere::share;
pub(crate) use floors::Floors;
pub(crate) use follow::follow;
pub(crate) use handed_out::HandedOut;
pub(crate) use machine::RunView;
pub(crate) use presence::Presence;

use crate::conditional::Tagged;
use crate::error::Result;
use machine::{Connected, Here, Logged, Machine};

/// Least time between two states that a run tells of itself, unless something happens, and that a reader is given.
pub(crate) const STATE_INTERVAL: Duration = Duration::from_millis(200);
/// Most unacknowledged conditions that are remembered of a machine; the store has the others.
const MAX_LOGGED: u32 = 64;

/// The state of a machine at one time.
#[derive(Debug)]
pub(crate) struct Shown {
    /// Counts the changes of all machines.
    pub(crate) version: u64,
    /// The state.
    pub(crate) state: MachineState,
    /// Version of the machine in the store; empty where it is in none.
    pub(crate) etag: String,
    json: OnceLock<Bytes>,
    answer: OnceLock<Tagged>,
}

impl Shown {
    fn new(version: u64, state: MachineState, etag: String) -> Arc<Self> {
        Arc::new(Self { version, state, etag, json: OnceLock::new(), answer: OnceLock::new() })
    }

    /// The state as JSON, written once for all readers.
    pub(crate) fn json(&self) -> &Bytes {
        self.json.get_or_init(|| json::to_string(&self.state).into())
    }

    /// The state as an answer with an entity tag, made once for all who ask.
    pub(crate) fn answer(&self) -> &Tagged {
        self.answer.get_or_init(|| Tagged::new(self.json().clone()))
    }

    /// The identifier of the machine.
    pub(crate) fn machine_id(&self) -> &str {
        self.state.machine.strip_prefix("machines/").unwrap_or(&self.state.machine)
    }
}

#[derive(Debug, Default)]
struct Board {
    version: u64,
    tickets: u64,
    machines: BTreeMap<String, Machine>,
    /// Version at which a machine went last.
    removed: u64,
    /// The first page of states as it was written last, and of which version it is.
    first_page: Option<(u64, Arc<Tagged>)>,
    /// Rung where other replicas are to be told of something at once; `None` where there are none.
    bell: Option<Arc<Notify>>,
    /// Connected runs of which they are.
    urgent: BTreeSet<Uuid>,
    /// Runs whose streams have ended here, and of which others were not told yet, with their machines.
    left: Vec<(String, RunView)>,
}

impl Board {
    /// Changes a machine, which is made where it is not known, and shows what became of it.
    fn change(&mut self, id: &str, change: impl FnOnce(&mut Machine)) {
        let machine = self.machines.entry(id.to_owned()).or_insert_with(|| Machine::new(id));
        change(machine);
        machine.forget_acknowledged();
        self.version += 1;
        if machine.is_needed() {
            let state = machine.state();
            machine.shown = Shown::new(self.version, state, machine.etag.clone().unwrap_or_default());
        } else {
            self.machines.remove(id);
            self.removed = self.version;
        }
    }
}

/// What changed since a reader looked last.
#[derive(Debug, Default)]
pub(crate) struct Changes {
    /// States of machines that changed, by identifier.
    pub(crate) states: Vec<Arc<Shown>>,
    /// Machines that the reader was shown and that are gone.
    pub(crate) gone: Vec<String>,
}

/// Follows machines at the reader's own pace.
#[derive(Debug)]
pub(crate) struct FloorReader {
    floor: Floor,
    newest: watch::Receiver<u64>,
    /// Only this machine.
    machine: Option<String>,
    /// Least time between two readings.
    interval: Duration,
    /// Before that, nothing is read again.
    not_before: Option<Instant>,
    seen: u64,
    shown: BTreeSet<String>,
}

impl FloorReader {
    /// With another least time between two readings than [`STATE_INTERVAL`].
    pub(crate) fn every(self, interval: Duration) -> Self {
        Self { interval, ..self }
    }

    /// What changed since the last call, as soon as something has, but not sooner than [`STATE_INTERVAL`] after that call; at
    /// first everything. `None` when there will be no more.
    pub(crate) async fn next(&mut self) -> Option<Changes> {
        self.is_ready().await.then(|| self.changes())
    }

    /// Waits until [`Self::changes`] has something to tell and it is time to; `false` when there will be no more.
    pub(crate) async fn is_ready(&mut self) -> bool {
        let Some(not_before) = self.not_before else { return true };
        // What is given up while it waits has not seen anything.
        let seen = self.seen;
        if self.newest.wait_for(|newest| *newest > seen).await.is_err() {
            return false;
        }
        if not_before > Instant::now() {
            sleep_until(not_before).await;
        }
        true
    }

    /// What changed since the last call; at first everything.
    pub(crate) fn changes(&mut self) -> Changes {
        self.not_before = Some(Instant::now() + self.interval);
        let board = self.floor.board();
        let wanted = |id: &str| self.machine.as_deref().is_none_or(|machine| machine == id);
        let changed = board.machines.iter().filter(|(id, machine)| machine.shown.version > self.seen && wanted(id));
        let states: Vec<_> = changed.map(|(_, machine)| machine.shown.clone()).collect();
        let gone = if board.removed > self.seen {
            let gone = self.shown.iter().filter(|id| !board.machines.contains_key(*id)).cloned().collect();
            self.shown.retain(|id| board.machines.contains_key(id));
            gone
        } else {
            Vec::new()
        };
        self.seen = board.version;
        drop(board);
        self.shown.extend(states.iter().map(|shown| shown.machine_id().to_owned()));
        Changes { states, gone }
    }
}

/// The machines and what they do, as one tenant sees them. Cloning is cheap.
#[derive(Clone, Debug)]
pub(crate) struct Floor {
    board: Arc<Mutex<Board>>,
    newest: Arc<watch::Sender<u64>>,
}

impl Floor {
    /// A floor without machines.
    pub(crate) fn new() -> Self {
        Self { board: Arc::default(), newest: Arc::new(watch::Sender::new(0)) }
    }

    /// From now on, other replicas are to be told of its runs, of some at once: then the bell rings.
    fn share(&self, bell: Arc<Notify>) {
        self.board().bell = Some(bell);
    }

    /// Something happened to a run that is connected here.
    fn ring(&self, run: Uuid) {
        let mut board = self.board();
        if let Some(bell) = board.bell.clone() {
            board.urgent.insert(run);
            bell.notify_one();
        }
    }

    fn board(&self) -> MutexGuard<'_, Board> {
        // Every change leaves a whole board behind, so a poisoned one is valid.
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, id: &str, change: impl FnOnce(&mut Machine)) {
        let version = {
            let mut board = self.board();
            board.change(id, change);
            board.version
        };
        self.newest.send_modify(|newest| *newest = version.max(*newest));
    }

    /// A machine is in the store, in this version and under this name for people.
    pub(crate) fn put_machine(&self, id: &str, etag: &str, display_name: &str) {
        self.change(id, |machine| {
            machine.etag = Some(etag.to_owned());
            display_name.clone_into(&mut machine.display_name);
        });
    }

    /// A machine is in the store no more.
    pub(crate) fn remove_machine(&self, id: &str) {
        self.change(id, |machine| {
            machine.etag = None;
            machine.display_name.clear();
        });
    }

    /// Takes over what the log says of a machine, as far as more is not known already.
    fn restore_machine(&self, id: &str, resting: Option<RunView>, finished: u64, logged: Vec<Logged>) {
        self.change(id, |machine| machine.recall(resting, finished, logged));
    }

    /// A stream of a run is connected, here or elsewhere; its ticket.
    fn connect(&self, id: &str, view: RunView, logged: Vec<Logged>, here: Option<Here>) -> u64 {
        let ticket = {
            let mut board = self.board();
            board.tickets += 1;
            board.tickets
        };
        self.change(id, |machine| {
            machine.know(logged);
            machine.join(Connected { ticket, view, forgotten: false, here });
        });
        ticket
    }

    /// Somebody has taken a run up: streams of it that are connected here ask whether it is still theirs.
    fn doubt(&self, id: &str, run: Uuid) {
        let board = self.board();
        let connected = board.machines.get(id).into_iter().flat_map(|machine| &machine.connected);
        connected.filter(|connected| connected.view.id == run).for_each(Connected::doubt);
    }

    /// What a run does now.
    fn update(&self, id: &str, ticket: u64, view: &RunView) {
        self.change(id, |machine| {
            let connected = machine.connected.iter_mut().find(|connected| connected.ticket == ticket);
            if let Some(connected) = connected {
                connected.view.clone_from(view);
            }
        });
    }

    /// The stream is gone; what is left of its run, where it is not another stream's by now.
    fn disconnect(&self, id: &str, ticket: u64, view: Option<RunView>) {
        let mut left = None;
        self.change(id, |machine| left = machine.part(ticket, view));
        let mut board = self.board();
        if let (Some(view), Some(bell)) = (left, board.bell.clone()) {
            board.left.push((id.to_owned(), view));
            bell.notify_one();
        }
    }

    /// A stream at another replica has come and gone.
    fn come_and_gone(&self, id: &str, view: RunView, logged: Vec<Logged>) {
        self.change(id, |machine| {
            machine.know(logged);
            machine.settle(view);
        });
    }

    fn raise(&self, id: &str, logged: Logged) {
        self.change(id, |machine| machine.logged.push(logged));
    }

    /// Somebody acknowledged a condition of a run on a machine.
    pub(crate) fn acknowledge(&self, machine_id: &str, run: Uuid, condition: &ConditionMessage) {
        self.change(machine_id, |machine| {
            let known = |logged: &&mut Logged| {
                logged.run == run && logged.condition.decision_number == condition.decision_number
            };
            if let Some(logged) = machine.logged.iter_mut().find(known) {
                logged.condition.clone_from(condition);
            }
        });
    }

    /// A job was deleted, and its runs with it.
    pub(crate) fn forget_job(&self, machine_id: &str, job_id: Uuid) {
        self.change(machine_id, |machine| {
            machine.resting = machine.resting.take().filter(|view| view.job_id != job_id);
            machine.logged.retain(|logged| logged.job_id != job_id);
            for connected in machine.connected.iter_mut().filter(|connected| connected.view.job_id == job_id) {
                connected.forgotten = true;
            }
        });
    }

    /// The machines that show or remember something of a job.
    fn machines_of(&self, job_id: Uuid) -> Vec<String> {
        let board = self.board();
        let machines = board.machines.iter().filter(|(_, machine)| machine.knows_job(job_id));
        machines.map(|(id, _)| id.clone()).collect()
    }

    /// The state of a machine.
    pub(crate) fn state(&self, id: &str) -> Option<Arc<Shown>> {
        self.board().machines.get(id).map(|machine| machine.shown.clone())
    }

    /// States by identifier, behind one or from the first on, at most `limit`.
    pub(crate) fn states(&self, after: Option<&str>, limit: usize) -> Vec<Arc<Shown>> {
        let from = after.map_or(Bound::Unbounded, Bound::Excluded);
        let board = self.board();
        let range = board.machines.range::<str, _>((from, Bound::Unbounded));
        range.take(limit).map(|(_, machine)| machine.shown.clone()).collect()
    }

    /// What a run does, where it is the one that a machine shows, or one that is connected.
    pub(crate) fn activity(&self, machine_id: &str, run: Uuid) -> Option<RunActivity> {
        let board = self.board();
        let machine = board.machines.get(machine_id)?;
        let connected = machine.connected.iter().rev().map(|connected| &connected.view);
        let view = connected.chain(&machine.resting).find(|view| view.id == run);
        view.map(|view| view.activity.clone())
    }

    /// Follows all machines, or one.
    pub(crate) fn reader(&self, machine: Option<String>) -> FloorReader {
        let newest = self.newest.subscribe();
        FloorReader {
            floor: self.clone(),
            newest,
            machine,
            interval: STATE_INTERVAL,
            not_before: None,
            seen: 0,
            shown: BTreeSet::new(),
        }
    }

    /// The first page of states, written once for all who poll: by `write` where something has changed since.
    ///
    /// # Errors
    /// Those of `write`.
    pub(crate) fn first_page(&self, write: impl FnOnce() -> Result<Tagged>) -> Result<Arc<Tagged>> {
        let version = {
            let board = self.board();
            if let Some((_, page)) = board.first_page.as_ref().filter(|(version, _)| *version == board.version) {
                return Ok(page.clone());
            }
            board.version
        };
        let page = Arc::new(write()?);
        // What has changed meanwhile is written with the next request.
        self.board().first_page = Some((version, page.clone()));
        Ok(page)
    }

    /// Whether nothing is known but what every tenant sees, and nobody follows it.
    fn is_blank(&self) -> bool {
        let is_blank = |machine: &Machine| {
            let Machine { connected, resting, logged, finished, .. } = machine;
            connected.is_empty() && resting.is_none() && logged.is_empty() && *finished == 0
        };
        Arc::strong_count(&self.board) == 1 && self.board().machines.values().all(is_blank)
    }
}
