//! A read-only agent of MTConnect 2.5 on a listener of its own: what machines do, for clients of that standard.
//!
//! The agent follows the floor as any reader does, and turns what changes into observations with consecutive numbers, of
//! which the last ones are kept. Requests are answered from them.

mod buffer;
mod document;
mod json;
mod model;
mod path;
mod request;
mod server;
mod values;
mod xml;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use feedwave_contract::proto::{Availability, Execution, Machine, MachineState};
use feedwave_store::{Store, StoreError};
use jiff::Timestamp;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

use buffer::{Buffer, ItemKey, Observed};
use model::{Device, Role};
pub(crate) use server::{AgentState, router};
use values::Value;

use crate::error::{Error, Result};
use crate::floor::{Floor, FloorReader, Shown};
use crate::stored;

/// A machine that the agent shows, or has shown.
#[derive(Debug)]
struct Known {
    device: Device,
    /// Version of the machine that the device was made from.
    etag: String,
    /// Whether it is shown still.
    is_there: bool,
    /// What it did when it was looked at last, and since when: an end that is over before it was seen is told nevertheless.
    execution: Option<(Execution, Option<prost_types::Timestamp>)>,
}

/// Everything that answers are made of.
#[derive(Debug)]
struct Observations {
    devices: Vec<Known>,
    buffer: Buffer,
    /// When a device came, went or changed last, µs since the Unix epoch.
    model_changed_us: i64,
}

impl Observations {
    fn device(&self, item: ItemKey) -> Option<&Known> {
        self.devices.get(item.0 as usize).filter(|known| known.is_there)
    }

    /// Devices that are shown, with their numbers, by name.
    fn shown(&self) -> BTreeMap<&str, (u32, &Device)> {
        let there = (0..).zip(&self.devices).filter(|(_, known)| known.is_there);
        there.map(|(number, known)| (known.device.id.as_str(), (number, &known.device))).collect()
    }

    /// The device with this name or uuid.
    fn named(&self, name: &str) -> Option<u32> {
        let id = name.strip_prefix("feedwave.").unwrap_or(name);
        self.shown().get(id).map(|(number, _)| *number)
    }

    /// Shows a machine; the number of its device.
    fn put(&mut self, id: &str, etag: &str, device: Device, now_us: i64) -> u32 {
        let same = |known: &Known| known.is_there && known.device.id == id;
        if let Some(index) = self.devices.iter().position(same) {
            if self.devices[index].device == device {
                etag.clone_into(&mut self.devices[index].etag);
                return index as u32;
            }
            self.devices[index].is_there = false;
        }
        let number = self.devices.len() as u32;
        let values = device.values(&MachineState::default());
        self.devices.push(Known { device, etag: etag.to_owned(), is_there: true, execution: None });
        self.model_changed_us = now_us;
        // Nothing is known, which has to be said before anybody asks.
        for (index, value) in (0..).zip(values) {
            self.push((number, index), now_us, &value);
        }
        number
    }

    fn remove(&mut self, id: &str, now_us: i64) {
        for known in self.devices.iter_mut().filter(|known| known.device.id == id && known.is_there) {
            known.is_there = false;
            self.model_changed_us = now_us;
        }
    }

    /// Takes over what a machine does.
    fn observe(&mut self, number: u32, state: &MachineState, now_us: i64) {
        let Some(known) = self.devices.get_mut(number as usize) else { return };
        let execution = (state.execution(), state.execution_time);
        let is_new = known.execution.is_some_and(|before| before != execution);
        let ended = matches!(state.execution(), Execution::Finished | Execution::Stopped);
        let is_gone = state.availability() != Availability::Available;
        known.execution = Some(execution);
        let time_us = state.run.as_ref().and_then(|run| run.update_time).map_or(now_us, |time| {
            time.seconds.saturating_mul(1_000_000).saturating_add(i64::from(time.nanos) / 1_000)
        });
        let values = known.device.values(state);
        let end = (is_new && ended && is_gone).then(|| values::execution(state.execution()));
        let items: Vec<_> = (0..).zip(known.device.items.iter().map(|item| item.role)).zip(values).collect();
        for ((index, role), value) in items {
            let key = (number, index);
            if let Some(end) = end.filter(|_| role == Role::Execution) {
                self.push(key, time_us, &Value::Text(end.to_owned()));
            }
            self.push(key, time_us, &value);
        }
    }

    fn push(&mut self, key: ItemKey, time_us: i64, value: &Value) {
        let new: Vec<Observed> = buffer::differences(self.buffer.newest().of(key), value);
        for what in new {
            self.buffer.push(key, time_us, what);
        }
    }
}

/// The agent. Cloning is cheap.
#[derive(Clone, Debug)]
pub(crate) struct Agent {
    observations: Arc<Mutex<Observations>>,
    /// Sequence number of the next observation.
    next: Arc<watch::Sender<u64>>,
    /// Start of the agent, s since the Unix epoch: the numbers begin anew with it.
    instance: u64,
    sender: Arc<str>,
}

fn now_us() -> i64 {
    Timestamp::now().as_microsecond()
}

impl Agent {
    /// An agent that knows nothing yet and will keep so many observations.
    pub(crate) fn new(buffer_size: usize) -> Self {
        let now_us = now_us();
        let observations =
            Observations { devices: Vec::new(), buffer: Buffer::new(buffer_size), model_changed_us: now_us };
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        let host = if host.trim().is_empty() { "feedwave" } else { host.trim() };
        Self {
            observations: Arc::new(Mutex::new(observations)),
            next: Arc::new(watch::Sender::new(1)),
            instance: u64::try_from(now_us / 1_000_000).unwrap_or(1).max(1),
            sender: host.into(),
        }
    }

    fn observations(&self) -> MutexGuard<'_, Observations> {
        // Observations are added one by one, so a poisoned list is whole.
        self.observations.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes over the machines as they are, so that whoever asks first finds them all.
    ///
    /// # Errors
    /// Those of the store.
    pub(crate) async fn begin(&self, floor: &Floor, store: &Store) -> Result<FloorReader> {
        let mut reader = floor.reader(None);
        if let Some(changes) = reader.next().await {
            for shown in &changes.states {
                self.take(shown, store).await?;
            }
        }
        Ok(reader)
    }

    /// Follows the machines until the service ends.
    pub(crate) async fn follow(self, mut reader: FloorReader, store: Store, stop: CancellationToken) {
        while let Some(Some(changes)) = stop.run_until_cancelled(reader.next()).await {
            for shown in &changes.states {
                if let Err(error) = self.take(shown, &store).await {
                    tracing::warn!(machine = shown.machine_id(), %error, "the MTConnect agent could not read a machine");
                }
            }
            for id in &changes.gone {
                self.observations().remove(id, now_us());
            }
            self.tell();
        }
    }

    fn tell(&self) {
        let next = self.observations().buffer.next();
        self.next.send_replace(next);
    }

    /// Takes over the state of a machine.
    async fn take(&self, shown: &Shown, store: &Store) -> Result<()> {
        let id = shown.machine_id();
        let known = {
            let observations = self.observations();
            let number = observations.named(id);
            number.filter(|number| observations.devices[*number as usize].etag == shown.etag)
        };
        let number = match known {
            Some(number) => Some(number),
            None => match store.machine(id).await {
                Ok(record) => {
                    let machine: Machine = stored::from_stored(record.body.get())?;
                    let device = Device::of(id, &machine);
                    Some(self.observations().put(id, &shown.etag, device, now_us()))
                }
                // Deleted, with a run that is still connected: its device stays as it was.
                Err(StoreError::NotFound { .. }) => self.observations().named(id),
                Err(error) => return Err(Error::from(error)),
            },
        };
        if let Some(number) = number {
            self.observations().observe(number, &shown.state, now_us());
            self.tell();
        }
        Ok(())
    }

    /// Items of devices that are shown, as a set to look up.
    fn all_items(observations: &Observations) -> BTreeSet<ItemKey> {
        let shown = observations.shown();
        let of = |(number, device): &(u32, &Device)| {
            let number = *number;
            (0..device.items.len() as u32).map(move |item| (number, item))
        };
        shown.values().flat_map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use feedwave_contract::proto::{RunActivity, RunProgress};

    use super::*;

    fn agent() -> Agent {
        let agent = Agent::new(1_000);
        let axes = [("X".to_owned(), false), ("Z".to_owned(), false)];
        agent.observations().put("lathe", "1", Device::new("lathe", &axes), 0);
        agent
    }

    fn state(execution: Execution, second: i64, taken: u64) -> MachineState {
        let at = prost_types::Timestamp { seconds: second, nanos: 0 };
        let available = !matches!(execution, Execution::Finished | Execution::Stopped);
        let availability = if available { Availability::Available } else { Availability::Unavailable };
        let run = RunActivity {
            job: "jobs/1".to_owned(),
            availability: availability.into(),
            update_time: Some(at),
            progress: Some(RunProgress { taken, machining_s: taken as f64 * 1e-3, ..Default::default() }),
            ..Default::default()
        };
        MachineState {
            availability: availability.into(),
            execution: execution.into(),
            execution_time: Some(at),
            run: Some(run),
            ..Default::default()
        }
    }

    fn executions(agent: &Agent) -> Vec<String> {
        let observations = agent.observations();
        let part = observations.buffer.forwards(1, u64::MAX, usize::MAX, |_| true);
        let of_execution =
            |item: ItemKey| observations.devices[item.0 as usize].device.items[item.1 as usize].role == Role::Execution;
        let shown = part.observations.iter().filter(|observation| of_execution(observation.item));
        shown
            .map(|observation| match &observation.what {
                Observed::Value(Value::Text(text)) => text.clone(),
                _ => "UNAVAILABLE".to_owned(),
            })
            .collect()
    }

    #[test]
    fn an_end_is_observed_although_the_stream_is_gone_by_then() {
        let agent = agent();
        for (second, execution) in [(1, Execution::Ready), (2, Execution::Running), (3, Execution::Finished)] {
            agent.observations().observe(0, &state(execution, second, 7), 0);
        }
        // Another run, over between two looks.
        agent.observations().observe(0, &state(Execution::Stopped, 9, 7), 0);
        let expected = ["UNAVAILABLE", "READY", "ACTIVE", "PROGRAM_COMPLETED", "UNAVAILABLE", "STOPPED", "UNAVAILABLE"];
        assert_eq!(executions(&agent), expected);
    }

    #[test]
    fn only_changes_become_observations() {
        let agent = agent();
        let items = agent.observations().devices[0].device.items.len() as u64;
        assert_eq!(agent.observations().buffer.next(), items + 1, "every item says that it is not available, but one");
        agent.observations().observe(0, &state(Execution::Running, 1, 7), 0);
        let before = agent.observations().buffer.next();
        agent.observations().observe(0, &state(Execution::Running, 1, 7), 0);
        assert_eq!(agent.observations().buffer.next(), before);
        agent.observations().observe(0, &state(Execution::Running, 1, 8), 0);
        assert_eq!(agent.observations().buffer.next(), before + 1, "the time of the run has changed");
    }

    #[test]
    fn a_machine_with_other_axes_is_another_device() {
        let agent = agent();
        let axes = [("X".to_owned(), false), ("Z".to_owned(), false)];
        let mut observations = agent.observations();
        assert_eq!(observations.put("lathe", "2", Device::new("lathe", &axes), 5), 0);
        assert_eq!(observations.model_changed_us, 0, "nothing that is shown has changed");
        assert_eq!(observations.put("lathe", "3", Device::new("lathe", &axes[..1]), 7), 1);
        assert_eq!((observations.named("feedwave.lathe"), observations.model_changed_us), (Some(1), 7));
        observations.remove("lathe", 9);
        assert_eq!((observations.named("lathe"), observations.model_changed_us), (None, 9));
    }
}
