//! Runs whose streams are connected to other replicas: each tells the others of its own a few times a second, through the
//! store, and shows what it hears. A replica that falls silent has lost its streams, and the log says what is left of them.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::time::{Duration, Instant};

use feedwave_contract::names;
use feedwave_contract::proto::{DecisionReason, MachineState};
use feedwave_store::{Presence, Store, StoreError, Tenant, ToldPresence};
use prost::Message as _;
use tokio::time::MissedTickBehavior;
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::machine::Connected;
use super::restore::{logged, view_of};
use super::{Floor, Floors, RunView};
use crate::error::{Error, Result};

/// How often others are told of everything, and heard.
const PERIOD: Duration = Duration::from_millis(250);
/// Least time from telling or hearing of what has just happened to the next time; it is twice as long as that took, so that
/// with many runs a third of the time is spent on it at most.
const PAUSE: Duration = Duration::from_millis(25);
/// How much later than others something may be visible that is looked for at once; what is later is seen in its turn.
const RING_OVERLAP: Duration = Duration::from_millis(500);
/// What has not changed is told again after this time.
const RENEWAL: Duration = Duration::from_millis(1_500);
/// Who has said nothing for so long is gone.
const SILENCE: Duration = Duration::from_secs(5);
/// How much later than others something may become visible that was told at the same time.
const OVERLAP: Duration = Duration::from_secs(5);
/// Rounds from one look at the machines of the store to the next.
const MACHINE_ROUNDS: u32 = 8;

/// Tells other replicas of runs, and shows theirs, until `stop`. Where one process has the database, nothing is to be done.
pub(crate) async fn share(floors: Floors, store: Store, stop: CancellationToken) {
    if store.lease().is_none() {
        return;
    }
    let bell = floors.share();
    let mut rung = store.watch_presences();
    let mut sharing = Sharing::new(floors, store);
    let mut rounds = tokio::time::interval(PERIOD);
    rounds.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut fails = false;
    let (mut is_to_tell, mut is_to_hear) = (false, false);
    let mut not_before = tokio::time::Instant::now();
    loop {
        let turn = tokio::select! {
            () = stop.cancelled() => return,
            _ = rounds.tick() => Turn::Round,
            () = bell.notified(), if !is_to_tell => {
                is_to_tell = true;
                continue;
            }
            Ok(()) = rung.changed(), if !is_to_hear => {
                is_to_hear = true;
                continue;
            }
            // Where the store does not answer, the next round tries again.
            () = tokio::time::sleep_until(not_before), if (is_to_tell || is_to_hear) && !fails => {
                if is_to_tell { Turn::Tell } else { Turn::Hear }
            }
        };
        match turn {
            Turn::Round => (is_to_tell, is_to_hear) = (false, false),
            Turn::Tell => is_to_tell = false,
            Turn::Hear => is_to_hear = false,
        }
        let begun = tokio::time::Instant::now();
        let done = async {
            match turn {
                Turn::Round => sharing.round().await,
                Turn::Tell => sharing.tell(true).await,
                Turn::Hear => sharing.hear(RING_OVERLAP).await,
            }
        };
        let result = tokio::select! {
            () = stop.cancelled() => return,
            result = done => result,
        };
        if !matches!(turn, Turn::Round) {
            not_before = tokio::time::Instant::now() + PAUSE.max(begun.elapsed() * 2);
        }
        match result {
            Ok(()) => fails = false,
            Err(error) => {
                sharing.heard_since = None;
                if !std::mem::replace(&mut fails, true) {
                    tracing::warn!(%error, "what machines do at other replicas is not seen");
                }
            }
        }
    }
}

/// What is to be done.
enum Turn {
    /// Everything.
    Round,
    /// Others are told of what happened here.
    Tell,
    /// What happened elsewhere is looked at.
    Hear,
}

/// A run with its machine.
type OfMachine = (String, RunView);

/// A stream of another replica, on the floor.
#[derive(Debug)]
struct Place {
    floor: Floor,
    machine_id: String,
    ticket: u64,
    /// Number of the decision that was made last.
    decision: Option<u64>,
    /// Whether the feed was held.
    feed_held: bool,
}

impl Place {
    /// Shows what the other replica told, and reads the conditions again where it may have raised or ended one.
    async fn update(&mut self, store: &Store, view: &RunView) -> Result<()> {
        let last = view.activity.last_decision.as_ref();
        let (decision, feed_held) = (last.map(|last| last.number), view.activity.feed_held);
        let may_raise = last.is_some_and(|last| {
            // Of those in between nothing is known.
            let skipped = self.decision.is_none_or(|known| last.number > known + 1);
            skipped || last.outcome.unwrap_or_default().reason() == DecisionReason::AboveLimitAtBound
        });
        self.floor.update(&self.machine_id, self.ticket, view);
        if (may_raise && self.decision != decision) || (feed_held && !self.feed_held) {
            let logged = logged(store, view.id, view.activity.feed_held).await?;
            self.floor.change(&self.machine_id, |machine| machine.know(logged));
        }
        (self.decision, self.feed_held) = (decision, feed_held);
        Ok(())
    }
}

/// What another replica told of a run last.
#[derive(Debug)]
struct Heard {
    told_us: i64,
    place: Option<Place>,
}

struct Sharing {
    floors: Floors,
    store: Store,
    /// What the others were told of connected runs, and when.
    told: HashMap<Uuid, (RunView, Instant)>,
    /// Streams that have ended, and of which the others were not told yet.
    left: BTreeMap<Uuid, (Tenant, String, RunView)>,
    heard: HashMap<(String, Uuid), Heard>,
    /// When the others were heard last.
    heard_at: Option<Instant>,
    /// Since when they are heard without a break.
    heard_since: Option<Instant>,
    machines: Option<[i64; 3]>,
    round: u32,
}

fn presence(tenant: Tenant, machine_id: &str, view: &RunView, is_connected: bool) -> Presence {
    let state = MachineState {
        machine: names::machine(machine_id),
        run: Some(view.activity.clone()),
        conditions: view.alarms.clone(),
        ..MachineState::default()
    };
    let body = state.encode_to_vec().into();
    Presence { run_id: view.id, tenant, sequence: view.sequence, is_connected, body }
}

/// The machine and what its run does, of what another replica told.
fn understood(told: &ToldPresence, body: &[u8]) -> Result<(String, RunView)> {
    let damaged = |what: &str| Error::internal(format!("what a replica told of run {} has no {what}", told.run_id));
    let state = MachineState::decode(body).map_err(|_| damaged("form"))?;
    let machine = names::parse_machine(&state.machine).map_err(|_| damaged("machine"))?.to_owned();
    let activity = state.run.ok_or_else(|| damaged("run"))?;
    let job_id = names::parse_job(&activity.job).map_err(|_| damaged("job"))?;
    let view = RunView { id: told.run_id, job_id, sequence: told.sequence, activity, alarms: state.conditions };
    Ok((machine, view))
}

impl Sharing {
    fn new(floors: Floors, store: Store) -> Self {
        Self {
            floors,
            store,
            told: HashMap::new(),
            left: BTreeMap::new(),
            heard: HashMap::new(),
            heard_at: None,
            heard_since: None,
            machines: None,
            round: 0,
        }
    }

    async fn round(&mut self) -> Result<()> {
        self.tell(false).await?;
        self.hear(OVERLAP).await?;
        if self.round.is_multiple_of(MACHINE_ROUNDS) {
            let mark = self.store.machines_mark().await?;
            if self.machines != Some(mark) {
                let new = self.floors.renew_machines(&self.store).await?;
                if !new.is_empty() {
                    self.floors.recall(&self.store, |id| new.contains(id)).await?;
                }
                self.machines = Some(mark);
            }
        }
        self.round = self.round.wrapping_add(1);
        Ok(())
    }

    /// Tells what has changed of the runs whose streams are connected here, or were; with `at_once` of those alone to which
    /// something happened. Where something did, the others are to look.
    async fn tell(&mut self, at_once: bool) -> Result<()> {
        let mut rings = false;
        let mut connected: BTreeMap<Uuid, (Tenant, String, RunView)> = BTreeMap::new();
        for (tenant, floor) in self.floors.all() {
            let (here, left, has_happened) = floor.of_this_replica(at_once);
            rings = rings || has_happened;
            connected.extend(here.into_iter().map(|(machine, view)| (view.id, (tenant, machine, view))));
            self.left.extend(left.into_iter().map(|(machine, view)| (view.id, (tenant, machine, view))));
        }
        self.left.retain(|run, _| !connected.contains_key(run));
        let is_over = |run: &Uuid| !connected.contains_key(run) && !self.left.contains_key(run);
        let gone: Vec<Uuid> = self.told.keys().filter(|run| !at_once && is_over(run)).copied().collect();
        let now = Instant::now();
        connected.retain(|run, (_, _, view)| {
            let is_new = |(told, at): &(RunView, Instant)| told != view || now.duration_since(*at) >= RENEWAL;
            self.told.get(run).is_none_or(is_new)
        });
        if connected.is_empty() && self.left.is_empty() && gone.is_empty() {
            return Ok(());
        }
        let told = connected.values().map(|run| (run, true)).chain(self.left.values().map(|run| (run, false)));
        let told = told.map(|((tenant, machine, view), is_connected)| presence(*tenant, machine, view, is_connected));
        self.store.tell_presences(told.collect(), gone.clone(), rings).await?;
        for run in gone.iter().chain(self.left.keys()) {
            self.told.remove(run);
        }
        self.told.extend(connected.into_iter().map(|(run, (_, _, view))| (run, (view, now))));
        self.left.clear();
        Ok(())
    }

    /// Shows what other replicas have told, which may be visible so much later than what was told at the same time.
    async fn hear(&mut self, overlap: Duration) -> Result<()> {
        let now = Instant::now();
        // What was told before this process began is in the log that it took over.
        let is_first = self.heard_at.is_none();
        let window = self.heard_at.map_or(Duration::MAX, |at| at.elapsed() + overlap);
        let all = self.store.presences(window).await?;
        self.heard_at = Some(now);
        // Who could not be heard is not gone.
        let since = *self.heard_since.get_or_insert(now);
        let mut there = HashSet::new();
        for told in &all {
            let key = (told.replica.clone(), told.run_id);
            let may_judge = now.duration_since(since) >= SILENCE;
            self.hear_of(&key, told, may_judge, is_first).await?;
            there.insert(key);
        }
        // Taken back: another stream tells of the run, or it was deleted.
        self.heard.retain(|key, heard| {
            if there.contains(key) {
                return true;
            }
            if let Some(place) = heard.place.take() {
                place.floor.disconnect(&place.machine_id, place.ticket, None);
            }
            false
        });
        Ok(())
    }

    async fn hear_of(
        &mut self,
        key: &(String, Uuid),
        told: &ToldPresence,
        may_judge: bool,
        is_first: bool,
    ) -> Result<()> {
        let heard = self.heard.entry(key.clone()).or_insert(Heard { told_us: i64::MIN, place: None });
        if told.is_connected && told.age >= SILENCE && (may_judge || heard.place.is_none()) {
            if let Some(place) = heard.place.take() {
                let view = in_log(&self.store, told.run_id).await?;
                place.floor.disconnect(&place.machine_id, place.ticket, view);
            }
            heard.told_us = told.told_us;
            return Ok(());
        }
        if heard.told_us == told.told_us {
            return Ok(());
        }
        let Some(body) = &told.body else { return Ok(()) };
        let (machine_id, view) = match understood(told, body) {
            Ok(understood) => understood,
            Err(error) => {
                tracing::warn!(%error, replica = told.replica, "what a replica told is not understood");
                heard.told_us = told.told_us;
                return Ok(());
            }
        };
        match (&mut heard.place, told.is_connected) {
            (None, true) => {
                let floor = self.floors.of(told.tenant);
                let logged = logged(&self.store, view.id, view.activity.feed_held).await?;
                let decision = view.activity.last_decision.as_ref().map(|decision| decision.number);
                let feed_held = view.activity.feed_held;
                let ticket = floor.connect(&machine_id, view, logged, None);
                heard.place = Some(Place { floor, machine_id, ticket, decision, feed_held });
            }
            (Some(place), true) => place.update(&self.store, &view).await?,
            (Some(place), false) => {
                place.floor.disconnect(&place.machine_id, place.ticket, Some(view));
                heard.place = None;
            }
            (None, false) if !is_first => {
                let floor = self.floors.of(told.tenant);
                let logged = logged(&self.store, view.id, view.activity.feed_held).await?;
                // Between two rounds.
                floor.come_and_gone(&machine_id, view, logged);
            }
            (None, false) => {}
        }
        heard.told_us = told.told_us;
        Ok(())
    }
}

/// What the log says of a run; `None` where it is deleted.
async fn in_log(store: &Store, run_id: Uuid) -> Result<Option<RunView>> {
    match store.run(run_id).await {
        Ok(run) => Ok(Some(view_of(store, &run).await?)),
        Err(StoreError::NotFound { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

impl Floor {
    /// Runs whose streams are connected here, of them those alone to which something has happened if that is asked for, and
    /// those whose streams have ended here since the last call, with their machines; and whether anything has happened.
    pub(super) fn of_this_replica(&self, urgent_only: bool) -> (Vec<OfMachine>, Vec<OfMachine>, bool) {
        let mut board = self.board();
        let left = std::mem::take(&mut board.left);
        let urgent = std::mem::take(&mut board.urgent);
        let has_happened = !urgent.is_empty() || !left.is_empty();
        let mut here = Vec::new();
        if urgent_only && urgent.is_empty() {
            return (here, left, has_happened);
        }
        let is_wanted =
            |connected: &&Connected| connected.here.is_some() && (!urgent_only || urgent.contains(&connected.view.id));
        for (id, machine) in &board.machines {
            let connected = machine.connected.iter().filter(is_wanted);
            here.extend(connected.map(|connected| (id.clone(), connected.view.clone())));
        }
        (here, left, has_happened)
    }
}
