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
use model::{Device, Limits, Role};
pub(crate) use server::{AgentState, router};
use values::Value;

use crate::error::{Error, Result};
use crate::floor::{Floor, FloorReader, Shown};
use crate::stored;

/// A machine that the agent shows, or has shown.
#[derive(Debug)]
struct Known {
    device: Arc<Device>,
    /// What the run with this name, which is connected, is monitored with, once a window has been judged.
    limits: Option<(String, Limits)>,
    /// Version of the machine that the device was made from.
    etag: String,
    /// What it did when it was looked at last, and since when: an end that is over before it was seen is told nevertheless.
    execution: Option<(Execution, Option<prost_types::Timestamp>)>,
    /// The last observation of a device that is shown no more.
    ended_at: Option<u64>,
}

impl Known {
    /// Takes over the limits that a run is monitored with; whether they have changed. They stay while it is connected, whether its
    /// data can be judged or not.
    fn follow_limits(&mut self, state: &MachineState) -> bool {
        let run = state.run.as_ref().filter(|_| state.availability() == Availability::Available);
        let limits = run.and_then(|run| match &run.process {
            Some(reading) => Some((run.run.clone(), self.device.control_limits(reading)?)),
            None => self.limits.clone().filter(|(of, _)| *of == run.run),
        });
        let is_new = limits != self.limits;
        self.limits = limits;
        is_new
    }

    /// The device with all its limits.
    fn described(&self) -> Device {
        let mut device = (*self.device).clone();
        device.limits.extend(self.limits.iter().map(|(_, limits)| limits.clone()));
        device
    }
}

/// Everything that answers are made of.
#[derive(Debug)]
struct Observations {
    /// Those that are shown, and those of which observations are kept, by their numbers, which are never used twice.
    devices: BTreeMap<u32, Known>,
    next_device: u32,
    buffer: Buffer,
    /// When a device came, went or changed last, µs since the Unix epoch.
    model_changed_us: i64,
    /// Counts these changes.
    model: u64,
}

impl Observations {
    fn new(buffer_size: usize, now_us: i64) -> Self {
        let buffer = Buffer::new(buffer_size);
        Self { devices: BTreeMap::new(), next_device: 0, buffer, model_changed_us: now_us, model: 0 }
    }

    /// Whether the device of an item is shown no more.
    fn has_ended(&self, item: ItemKey) -> bool {
        self.devices.get(&item.0).is_none_or(|known| known.ended_at.is_some())
    }

    /// Devices that are shown, with their numbers, by name.
    fn shown(&self) -> BTreeMap<&str, (u32, &Device)> {
        let there = self.devices.iter().filter(|(_, known)| known.ended_at.is_none());
        there.map(|(number, known)| (known.device.id.as_str(), (*number, &*known.device))).collect()
    }

    /// The device with this name or uuid.
    fn named(&self, name: &str) -> Option<u32> {
        let id = name.strip_prefix("feedwave.").unwrap_or(name);
        let mut there = self.devices.iter().filter(|(_, known)| known.ended_at.is_none() && known.device.id == id);
        there.next().map(|(number, _)| *number)
    }

    /// Shows a machine; the number of its device.
    fn put(&mut self, id: &str, etag: &str, device: Device, now_us: i64) -> u32 {
        if let Some(number) = self.named(id) {
            if let Some(known) = self.devices.get_mut(&number).filter(|known| *known.device == device) {
                etag.clone_into(&mut known.etag);
                return number;
            }
            self.end(number, now_us);
        }
        let number = self.next_device;
        self.next_device += 1;
        let values = device.values(&MachineState::default());
        let known =
            Known { device: Arc::new(device), limits: None, etag: etag.to_owned(), execution: None, ended_at: None };
        self.devices.insert(number, known);
        self.model_changes(now_us);
        // Nothing is known, which has to be said before anybody asks.
        for (index, value) in (0..).zip(values) {
            self.push((number, index), now_us, &value);
        }
        number
    }

    fn remove(&mut self, id: &str, now_us: i64) {
        if let Some(number) = self.named(id) {
            self.end(number, now_us);
        }
    }

    /// Shows a device no more: whoever follows it is told that nothing of it is available.
    fn end(&mut self, number: u32, now_us: i64) {
        let Some(known) = self.devices.get(&number) else { return };
        let values = known.device.values(&MachineState::default());
        for (index, value) in (0..).zip(values) {
            self.push((number, index), now_us, &value);
        }
        let last = self.buffer.last();
        if let Some(known) = self.devices.get_mut(&number) {
            known.ended_at = Some(last);
        }
        self.model_changes(now_us);
        self.forget();
    }

    fn model_changes(&mut self, now_us: i64) {
        self.model_changed_us = now_us;
        self.model += 1;
    }

    /// Forgets devices that are shown no more, once none of their observations is kept.
    fn forget(&mut self) {
        let first = self.buffer.first();
        let is_over = |known: &Known| known.ended_at.is_some_and(|last| last < first);
        let over: Vec<u32> =
            self.devices.iter().filter(|(_, known)| is_over(known)).map(|(number, _)| *number).collect();
        for number in over {
            self.devices.remove(&number);
            self.buffer.forget(number);
        }
    }

    /// Takes over what a machine does.
    fn observe(&mut self, number: u32, state: &MachineState, now_us: i64) {
        self.forget();
        let Some(known) = self.devices.get_mut(&number) else { return };
        let execution = (state.execution(), state.execution_time);
        let is_new = known.execution.is_some_and(|before| before != execution);
        let ended = matches!(state.execution(), Execution::Finished | Execution::Stopped);
        let is_gone = state.availability() != Availability::Available;
        known.execution = Some(execution);
        let has_new_limits = known.follow_limits(state);
        let time_us = state.run.as_ref().and_then(|run| run.update_time).map_or(now_us, |time| {
            time.seconds.saturating_mul(1_000_000).saturating_add(i64::from(time.nanos) / 1_000)
        });
        let values = known.device.values(state);
        let end = (is_new && ended && is_gone).then(|| values::execution(state.execution()));
        let items: Vec<_> = (0..).zip(known.device.items.iter().map(|item| item.role)).zip(values).collect();
        if has_new_limits {
            self.model_changes(now_us);
        }
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
    /// Start of the agent, µs since the Unix epoch, so that no two starts have the same: the numbers begin anew with it.
    instance: u64,
    sender: Arc<str>,
}

fn not_read(shown: &Shown, error: &Error) {
    tracing::warn!(machine = shown.machine_id(), %error, "the MTConnect agent could not read a machine");
}

fn now_us() -> i64 {
    Timestamp::now().as_microsecond()
}

impl Agent {
    /// An agent that knows nothing yet and will keep so many observations.
    pub(crate) fn new(buffer_size: usize) -> Self {
        let now_us = now_us();
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        let host = if host.trim().is_empty() { "feedwave" } else { host.trim() };
        Self {
            observations: Arc::new(Mutex::new(Observations::new(buffer_size, now_us))),
            next: Arc::new(watch::Sender::new(1)),
            instance: u64::try_from(now_us).unwrap_or(1).max(1),
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
    /// Those of the store. A machine whose record is damaged is left out, and said so in the log.
    pub(crate) async fn begin(&self, floor: &Floor, store: &Store) -> Result<FloorReader> {
        let mut reader = floor.reader(None);
        if let Some(changes) = reader.next().await {
            for shown in &changes.states {
                match self.take(shown, store).await {
                    Err(error @ (Error::Damaged(_) | Error::Internal(_))) => not_read(shown, &error),
                    taken => taken?,
                }
            }
        }
        Ok(reader)
    }

    /// Follows the machines until the service ends.
    pub(crate) async fn follow(self, mut reader: FloorReader, store: Store, stop: CancellationToken) {
        while let Some(Some(changes)) = stop.run_until_cancelled(reader.next()).await {
            for shown in &changes.states {
                if let Err(error) = self.take(shown, &store).await {
                    not_read(shown, &error);
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
            number.filter(|number| observations.devices.get(number).is_some_and(|known| known.etag == shown.etag))
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

    use super::model::Axis;
    use super::*;

    /// A device with these linear axes, which travel from −100 mm.
    fn device(id: &str, axes: &[&str]) -> Device {
        let axis = |name: &&str| Axis { name: (*name).to_owned(), turns: false, travel: [Some(-100.0), None] };
        Device::new(id, &axes.iter().map(axis).collect::<Vec<_>>())
    }

    fn agent() -> Agent {
        let agent = Agent::new(1_000);
        agent.observations().put("lathe", "1", device("lathe", &["X", "Z"]), 0);
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
            |item: ItemKey| observations.devices[&item.0].device.items[item.1 as usize].role == Role::Execution;
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
    fn no_two_agents_are_the_same_instance() {
        let instances: BTreeSet<u64> = (0..10).map(|_| Agent::new(1).instance).collect();
        assert_eq!(instances.len(), 10);
    }

    #[test]
    fn only_changes_become_observations() {
        let agent = agent();
        let items = agent.observations().devices[&0].device.items.len() as u64;
        assert_eq!(agent.observations().buffer.next(), items + 1, "every item says that it is not available, but one");
        agent.observations().observe(0, &state(Execution::Running, 1, 7), 0);
        let before = agent.observations().buffer.next();
        agent.observations().observe(0, &state(Execution::Running, 1, 7), 0);
        assert_eq!(agent.observations().buffer.next(), before);
        agent.observations().observe(0, &state(Execution::Running, 1, 8), 0);
        assert_eq!(agent.observations().buffer.next(), before + 1, "the time of the run has changed");
    }

    #[test]
    fn limits_are_those_of_the_run_that_is_connected() {
        use feedwave_contract::proto::{ProcessProperty, ProcessReading};
        let agent = agent();
        let mut observations = agent.observations();
        let shown = |observations: &Observations| {
            let device = observations.devices[&0].described();
            let of = |limits: &Limits| (device.items[limits.item].role, limits.lower, limits.upper);
            device.limits.iter().map(of).collect::<Vec<_>>()
        };
        let travel = [(Role::Axis, Some(-100.0), None); 2];
        let mut run = state(Execution::Running, 1, 7);
        observations.observe(0, &run, 3);
        assert_eq!((shown(&observations), observations.model_changed_us), (travel.to_vec(), 0));
        let reading = |property: ProcessProperty, unit: &str, upper: f64| ProcessReading {
            property: property.into(),
            unit: unit.to_owned(),
            lower: 0.002,
            upper,
            ..Default::default()
        };
        for (time, property, unit, upper, role) in [
            (4, ProcessProperty::Deviation, "mm", 0.01, Some(Role::Deviation)),
            (5, ProcessProperty::Deviation, "mm/s²", 9.0, Some(Role::DeviationAcceleration)),
            (6, ProcessProperty::VibrationFrequency, "Hz", 600.0, Some(Role::Frequency)),
            (7, ProcessProperty::VibrationAmplitude, "mm/s²", 3.0, None),
            (8, ProcessProperty::VibrationAmplitude, "mm", 0.03, Some(Role::Amplitude)),
        ] {
            run.run.as_mut().unwrap().process = Some(reading(property, unit, upper));
            observations.observe(0, &run, time);
            let own = role.map(|role| (role, Some(0.002), Some(upper)));
            assert_eq!(shown(&observations), travel.into_iter().chain(own).collect::<Vec<_>>());
            observations.observe(0, &run, time + 100);
            assert_eq!(observations.model_changed_us, time, "the same again is no change");
        }
        // Nothing can be judged for a while: the limits are what they were.
        run.run.as_mut().unwrap().process = None;
        observations.observe(0, &run, 9);
        assert_eq!((shown(&observations).len(), observations.model_changed_us), (3, 8));
        // Another run has not been judged yet.
        run.run.as_mut().unwrap().run = "runs/2".to_owned();
        observations.observe(0, &run, 10);
        assert_eq!((shown(&observations), observations.model_changed_us), (travel.to_vec(), 10));
    }

    #[test]
    fn positions_are_of_axes_by_their_names() {
        use feedwave_contract::proto::{CommandedAxis, CommandedState};
        let axis = |axis: &str, position: f64, unit: &str| CommandedAxis {
            axis: axis.to_owned(),
            position,
            unit: unit.to_owned(),
        };
        // The job was made when the machine had its axes in another order.
        let commanded = CommandedState {
            axes: vec![axis("Z", 5.0, "mm"), axis("X", -2.0, "mm"), axis("C", 90.0, "deg")],
            ..Default::default()
        };
        let mut state = state(Execution::Running, 1, 7);
        state.run.as_mut().unwrap().commanded = Some(commanded);
        let axes = [("X", false), ("Y", false), ("C", false), ("Z", false), ("C", true)];
        let axes = axes.map(|(name, turns)| Axis { name: name.to_owned(), turns, travel: [None; 2] });
        let device = Device::new("mill", &axes);
        let values = device.values(&state);
        let positions: Vec<_> = device
            .items
            .iter()
            .zip(values)
            .filter(|(item, _)| item.role == Role::Axis)
            .map(|(_, value)| value)
            .collect();
        let expected =
            [Value::Number(-2.0), Value::Unavailable, Value::Unavailable, Value::Number(5.0), Value::Number(90.0)];
        assert_eq!(positions, expected);
    }

    #[test]
    fn who_follows_a_device_is_told_of_its_end_and_follows_the_next_one() {
        let agent = agent();
        agent.observations().observe(0, &state(Execution::Running, 1, 7), 0);
        let mut observations = agent.observations();
        let path = "//DataItem[@type='EXECUTION']";
        let mut wanted = request::Wanted::of(&observations, Some("lathe"), Some(path)).unwrap();
        let mut all = request::Wanted::of(&observations, None, None).unwrap();
        let exec = *wanted.items.first().unwrap();
        assert_eq!((wanted.items.len(), exec.0), (1, 0));
        assert_eq!(observations.put("lathe", "2", device("lathe", &["X"]), 5), 1);
        let newest = |observations: &Observations, item| observations.buffer.newest().of(item)[0].what.clone();
        assert_eq!(newest(&observations, exec), Observed::Value(Value::Unavailable));
        wanted.renew(&observations);
        all.renew(&observations);
        let devices: Vec<u32> = wanted.items.iter().map(|item| item.0).collect();
        assert_eq!(devices, [0, 1], "the end of the former one, and the one that took its place");
        observations.observe(1, &state(Execution::Running, 2, 9), 5);
        assert_eq!(newest(&observations, *wanted.items.last().unwrap()), Observed::Value(Value::Text("ACTIVE".into())));
        wanted.forget_ended(&observations);
        assert_eq!(wanted.items.len(), 1);
        observations.put("mill", "1", device("mill", &["X"]), 6);
        all.renew(&observations);
        assert!(all.items.iter().any(|item| item.0 == 2), "a machine that was made later");
        observations.remove("lathe", 7);
        wanted.renew(&observations);
        assert_eq!(wanted.items.first().unwrap().0, 1);
        wanted.forget_ended(&observations);
        assert!(wanted.items.is_empty());
    }

    #[test]
    fn devices_that_come_and_go_fill_no_memory() {
        let agent = Agent::new(500);
        let mut observations = agent.observations();
        for number in 0..1_000 {
            observations.put("lathe", &number.to_string(), device("lathe", &["X"]), number);
            observations.remove("lathe", number);
        }
        assert!(observations.devices.len() < 50, "{}", observations.devices.len());
        assert_eq!(observations.next_device, 1_000);
        let kept = observations.buffer.at(observations.buffer.last());
        let known = (0..1_000).filter(|number| !kept.of((*number, 0)).is_empty()).count();
        assert!(known < 50, "{known}");
    }

    #[test]
    fn a_machine_with_other_axes_is_another_device() {
        let agent = agent();
        let mut observations = agent.observations();
        assert_eq!(observations.put("lathe", "2", device("lathe", &["X", "Z"]), 5), 0);
        assert_eq!(observations.model_changed_us, 0, "nothing that is shown has changed");
        assert_eq!(observations.put("lathe", "3", device("lathe", &["X"]), 7), 1);
        assert_eq!((observations.named("feedwave.lathe"), observations.model_changed_us), (Some(1), 7));
        observations.remove("lathe", 9);
        assert_eq!((observations.named("lathe"), observations.model_changed_us), (None, 9));
    }
}
