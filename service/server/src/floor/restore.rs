//! The floor as the log has it, after a start of the service.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use feedwave_contract::convert::action_name;
use feedwave_contract::proto::{Machine, ProcessReading, RunActivity};
use feedwave_monitoring::{Action, Monitor, MonitoringConfig};
use feedwave_store::{
    AttachedRun, DecisionRecord, PageRequest, Run, RunCondition, RunKind, RunState, Store, StoreError, Tenant,
};
use uuid::Uuid;

use super::presence::RunBase;
use super::{Floor, Floors, Logged, MAX_LOGGED, RunView, alarms};
use crate::error::{Error, Result};
use crate::stored::{self, condition_to_proto, config_from_message, decision_from_record, run_settings};

impl Floors {
    /// Takes over the machines of the store and what the log says of their newest runs.
    ///
    /// # Errors
    /// Those of the store. A machine whose records are damaged is left out, and said so in the log.
    pub(crate) async fn restore(&self, store: &Store) -> Result<()> {
        self.renew_machines(store).await?;
        self.recall(store, |_| true).await
    }

    /// Takes over what the log says of the newest runs of machines, such as those that are made again under their old names.
    ///
    /// # Errors
    /// Those of the store.
    pub(crate) async fn recall(&self, store: &Store, wanted: impl Fn(&str) -> bool) -> Result<()> {
        // Identifiers of runs ascend by time.
        let mut of_runs: BTreeMap<Uuid, ((Tenant, String), Vec<RunCondition>)> = BTreeMap::new();
        for found in store.open_conditions(MAX_LOGGED).await?.into_iter().filter(|found| wanted(&found.machine_id)) {
            let of_run = || ((found.tenant, found.machine_id), Vec::new());
            of_runs.entry(found.run_id).or_insert_with(of_run).1.push(found.condition);
        }
        let mut open: HashMap<(Tenant, String), Vec<Logged>> = HashMap::new();
        for (run, (of, conditions)) in of_runs {
            open.entry(of).or_default().extend(logged_of(store, run, &conditions).await?);
        }
        for runs in store.machine_runs().await?.into_iter().filter(|runs| wanted(&runs.machine_id)) {
            let view = readable(&runs.machine_id, newest_view(store, runs.newest).await)?;
            let of = (runs.tenant, runs.machine_id);
            let mut logged = open.remove(&of).unwrap_or_default();
            if let Some(view) = view.as_ref().filter(|view| view.activity.feed_held) {
                logged.retain(|other| other.run != view.id);
                logged.extend(self::logged(store, view.id, true).await?);
            }
            self.of(of.0).restore_machine(&of.1, view, runs.finished, logged);
        }
        Ok(())
    }

    /// Takes over the machines of the store as they are now; those that were not known.
    ///
    /// # Errors
    /// Those of the store.
    pub(super) async fn renew_machines(&self, store: &Store) -> Result<BTreeSet<String>> {
        let mut new = BTreeSet::new();
        let mut known = self.machines();
        let mut page = PageRequest { size: feedwave_store::MAX_PAGE_SIZE, token: String::new() };
        loop {
            let machines = store.list_machines(&page).await?;
            for record in &machines.items {
                match known.remove(&record.id) {
                    Some(etag) if etag == record.etag => continue,
                    Some(_) => {}
                    None => {
                        new.insert(record.id.clone());
                    }
                }
                let machine = readable(&record.id, stored::from_stored::<Machine>(record.body.get()))?;
                self.put_machine(&record.id, &record.etag, &machine.unwrap_or_default().display_name);
            }
            for id in &machines.unreachable {
                // It is there, whatever it is: as it was known, otherwise by its name alone.
                if known.remove(id).is_none() {
                    new.insert(id.clone());
                    self.put_machine(id, "", "");
                }
            }
            match machines.next_token {
                Some(token) => page.token = token,
                None => break,
            }
        }
        for id in known.keys() {
            self.remove_machine(id);
        }
        Ok(new)
    }
}

impl Floor {
    /// What a run does, or did: as the floor knows it, otherwise as the log has it.
    ///
    /// # Errors
    /// Those of the store, and what cannot be read of it.
    pub(crate) async fn activity_of(&self, store: &Store, run: &Run) -> Result<RunActivity> {
        let job = store.job(run.job_id).await?;
        match self.activity(&job.machine_id, run.id) {
            Some(activity) => Ok(activity),
            None => Ok(view_of(store, run).await?.activity),
        }
    }
}

/// What could be read of a machine: damage of one is said, and keeps nobody from the others.
fn readable<T>(machine: &str, read: Result<T>) -> Result<Option<T>> {
    match read {
        Ok(read) => Ok(Some(read)),
        Err(error @ (Error::Damaged(_) | Error::Internal(_))) => {
            tracing::error!(machine, %error, "what the machine did last is not known");
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

async fn newest_view(store: &Store, run: Uuid) -> Result<RunView> {
    view_of(store, &store.run(run).await?).await
}

/// A run as the log has it.
pub(super) async fn view_of(store: &Store, run: &Run) -> Result<RunView> {
    let job = store.job(run.job_id).await?;
    let last_decision = store.last_decision(run.id).await?;
    let changes = changes(store, run.id).await?;
    let overrides = match run.kind {
        RunKind::Live => store.run_overrides(run.id).await?,
        RunKind::Telemetry => Vec::new(),
    };
    let base = RunBase {
        job: &job,
        run,
        last_decision: last_decision.as_ref(),
        changes: &changes,
        overrides: &overrides,
        feed_held: feed_held(store, run).await?,
        conditions: &[],
        deviation_unit: deviation_unit(run)?,
    };
    Ok(base.at_rest()?.0)
}

/// Decisions of a run that changed something, as many as are looked at for why its feed is as it is.
async fn changes(store: &Store, run: Uuid) -> Result<Vec<DecisionRecord>> {
    Ok(store.last_decisions_of(run, action_name(Action::Change), 32).await?)
}

/// Whether an escalation holds the feed of a run: its monitor says so, whatever was decided since.
async fn feed_held(store: &Store, run: &Run) -> Result<bool> {
    match run.state {
        RunState::Open => Ok(holds_feed(run, &store.run_monitor(run.id).await?)),
        _ => Ok(false),
    }
}

/// What cannot be read, such as the state of another version, holds nothing: nobody can take the run up with it either.
fn holds_feed(run: &Run, monitor: &[u8]) -> bool {
    let monitor = Monitor::restore(monitor);
    let read =
        monitor.inspect_err(|error| tracing::error!(run = %run.id, %error, "what the machine did last is not known"));
    read.is_ok_and(|monitor| monitor.holds_feed())
}

/// Unit of the deviation in a run.
pub(super) fn deviation_unit(run: &Run) -> Result<&'static str> {
    let monitoring = run_settings(run)?.monitoring;
    let config = monitoring.as_ref().map(config_from_message).transpose()?;
    Ok(config.as_ref().unwrap_or(&MonitoringConfig::default()).deviation_unit())
}

impl Floor {
    /// A run that a client has taken up, to be connected. Whoever had it before is told at once.
    ///
    /// # Errors
    /// Those of the store, and what cannot be read of it.
    pub(crate) async fn taken_up(
        &self,
        store: &Store,
        job: &feedwave_store::Job,
        attached: &AttachedRun,
    ) -> Result<super::Presence> {
        let run = &attached.run;
        self.doubt(&job.machine_id, run.id);
        let last_decision = store.last_decision(run.id).await?;
        let changes = changes(store, run.id).await?;
        let feed_held = holds_feed(run, &attached.monitor);
        let conditions = logged(store, run.id, feed_held).await?;
        let base = RunBase {
            job,
            run,
            last_decision: last_decision.as_ref(),
            changes: &changes,
            overrides: &attached.overrides,
            feed_held,
            conditions: &conditions,
            deviation_unit: deviation_unit(run)?,
        };
        self.presence(&base, attached.attachment)
    }
}

/// Conditions of a run that nobody has acknowledged, or that hold its feed.
pub(super) async fn logged(store: &Store, run: Uuid, feed_held: bool) -> Result<Vec<Logged>> {
    let mut conditions = store.run_conditions(run).await?;
    conditions.retain(|condition| condition.acknowledged.is_none() || feed_held);
    logged_of(store, run, &conditions).await
}

/// Conditions of a run with what their decisions saw: none of a run that was deleted meanwhile.
async fn logged_of(store: &Store, run: Uuid, conditions: &[RunCondition]) -> Result<Vec<Logged>> {
    if conditions.is_empty() {
        return Ok(Vec::new());
    }
    let run = match store.run(run).await {
        Err(StoreError::NotFound { .. }) => return Ok(Vec::new()),
        run => run?,
    };
    let mut readings = readings(store, &run, conditions).await?;
    let logged = |condition: &RunCondition| Logged {
        run: run.id,
        job_id: run.job_id,
        condition: condition_to_proto(condition),
        reading: readings.remove(&condition.decision_number),
    };
    Ok(conditions.iter().map(logged).collect())
}

/// What the windows showed that raised conditions, by decision. What cannot be read is left out: a condition waits for its
/// acknowledgement all the same.
async fn readings(store: &Store, run: &Run, conditions: &[RunCondition]) -> Result<HashMap<u64, ProcessReading>> {
    let Ok(unit) = deviation_unit(run) else { return Ok(HashMap::new()) };
    let actions: BTreeSet<&str> = conditions.iter().map(|condition| condition.action.as_str()).collect();
    let mut readings = HashMap::new();
    for action in actions {
        let decisions = store.last_decisions_of(run.id, action, MAX_LOGGED).await?;
        let read = decisions.iter().filter_map(|record| decision_from_record(record).ok());
        readings.extend(read.filter_map(|decision| Some((decision.number, alarms::reading(&decision, unit)?))));
    }
    Ok(readings)
}
