//! What is to be published: states of machines as they are, decisions as the log has them.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use feedwave_contract::names;
use feedwave_contract::proto::Decision;
use feedwave_store::Store;
use prometheus::IntCounter;
use tokio::time::{Instant, sleep_until};
use uuid::Uuid;

use super::in_flight::What;
use crate::api::{DecisionLog, LogEntry, LogWatch};
use crate::config::MqttConfig;
use crate::error::{Error, Result};
use crate::floor::{Changes, Floor, FloorReader};

/// How long after an error of the store it is asked again.
const AFTER_ERROR: Duration = Duration::from_secs(1);
/// Jobs whose machines are remembered.
const KNOWN_JOBS: usize = 1_024;

/// A message for the broker.
#[derive(Clone, Debug)]
pub(super) struct Message {
    pub(super) what: What,
    pub(super) topic: String,
    pub(super) payload: Bytes,
}

/// States that the broker has to be told of: of each machine the newest one, and nothing else, however slow the broker is.
#[derive(Debug)]
pub(super) struct States {
    floor: Floor,
    topic: String,
    interval: Duration,
    reader: FloorReader,
    not_before: Option<Instant>,
    /// By machine; empty where the machine is gone, which clears what the broker retains.
    waiting: BTreeMap<String, Bytes>,
    /// Machines of which the broker retains a state.
    retained: BTreeSet<String>,
    /// Whether the next changes are all states there are.
    is_whole: bool,
}

impl States {
    pub(super) fn new(floor: Floor, config: &MqttConfig) -> Self {
        Self {
            reader: floor.reader(None),
            floor,
            topic: config.state_topic.clone(),
            interval: Duration::from_millis(config.state_interval_ms),
            not_before: None,
            waiting: BTreeMap::new(),
            retained: BTreeSet::new(),
            is_whole: true,
        }
    }

    /// From now on everything is told again.
    pub(super) fn begin_anew(&mut self) {
        self.reader = self.floor.reader(None);
        self.not_before = None;
        self.waiting.clear();
        self.is_whole = true;
    }

    /// The service ends: what changes is told at once.
    pub(super) fn hurry(&mut self) {
        self.not_before = None;
        self.interval = Duration::ZERO;
    }

    /// What has changed; never, where nothing changes any more. A wait that is given up has passed nothing over.
    pub(super) async fn changes(&mut self) -> Changes {
        if let Some(not_before) = self.not_before {
            sleep_until(not_before).await;
        }
        match self.reader.next().await {
            Some(changes) => changes,
            None => std::future::pending().await,
        }
    }

    /// Takes changes in.
    pub(super) fn take(&mut self, changes: Changes) {
        self.not_before = Some(Instant::now() + self.interval);
        let states = changes.states.iter().map(|shown| (shown.machine_id().to_owned(), shown.json().clone()));
        self.waiting.extend(states);
        let whole = std::mem::take(&mut self.is_whole);
        let unknown = self.retained.iter().filter(|id| whole && !self.waiting.contains_key(*id)).cloned();
        let gone: Vec<String> = unknown.chain(changes.gone).collect();
        self.waiting.extend(gone.into_iter().map(|id| (id, Bytes::new())));
    }

    pub(super) fn are_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// The next one.
    pub(super) fn next(&mut self) -> Option<Message> {
        let (id, payload) = self.waiting.pop_first()?;
        let topic = self.topic.replace("{machine}", &id);
        if payload.is_empty() {
            self.retained.remove(&id);
        } else {
            self.retained.insert(id);
        }
        Some(Message { what: What::State, topic, payload })
    }
}

/// Decisions as they become durable.
pub(super) struct Decisions {
    topic: String,
    log: LogWatch<DecisionLog>,
    store: Store,
    /// Counts decisions that were passed over.
    unreadable: IntCounter,
    machines: HashMap<Uuid, String>,
    /// The one whose machine is being looked up.
    next: Option<Arc<LogEntry<Decision>>>,
    not_before: Option<Instant>,
}

impl Decisions {
    pub(super) fn new(log: LogWatch<DecisionLog>, store: Store, unreadable: IntCounter, config: &MqttConfig) -> Self {
        let topic = config.decision_topic.clone();
        Self { topic, log, store, unreadable, machines: HashMap::new(), next: None, not_before: None }
    }

    /// The next one; never, where there will be none. A wait that is given up has passed nothing over.
    pub(super) async fn next(&mut self) -> Message {
        loop {
            if let Some(not_before) = self.not_before {
                sleep_until(not_before).await;
                self.not_before = None;
            }
            match self.read().await {
                Ok(Some(message)) => return message,
                Ok(None) => std::future::pending().await,
                Err(error) => {
                    tracing::warn!(%error, "decisions could not be read for the MQTT broker");
                    self.not_before = Some(Instant::now() + AFTER_ERROR);
                }
            }
        }
    }

    async fn read(&mut self) -> Result<Option<Message>> {
        loop {
            if self.next.is_none() {
                self.next = self.log.next().await?;
            }
            let Some(entry) = self.next.clone() else { return Ok(None) };
            let topic = self.topic(&entry.message).await;
            self.next = None;
            match topic {
                Ok(topic) => {
                    let payload = Bytes::copy_from_slice(entry.json().as_bytes());
                    return Ok(Some(Message { what: What::Decision(entry.sequence), topic, payload }));
                }
                // Deleted with its decisions.
                Err(Error::NotFound { .. }) => {}
                // Those behind it do not wait for what will never be readable.
                Err(error @ (Error::Damaged(_) | Error::Internal(_))) => {
                    let sequence = entry.sequence;
                    tracing::error!(sequence, %error, "the machine of a decision is not known: the decision is not published");
                    self.unreadable.inc();
                }
                Err(error) => {
                    self.next = Some(entry);
                    return Err(error);
                }
            }
        }
    }

    async fn topic(&mut self, decision: &Decision) -> Result<String> {
        let job = names::parse_job(&decision.job).map_err(Error::internal)?;
        let run = names::parse_run(&decision.run).map_err(Error::internal)?;
        let mut topic = self.topic.replace("{job}", &job.to_string()).replace("{run}", &run.to_string());
        if topic.contains("{machine}") {
            topic = topic.replace("{machine}", self.machine_of(job).await?);
        }
        Ok(topic)
    }

    async fn machine_of(&mut self, job: Uuid) -> Result<&str> {
        if !self.machines.contains_key(&job) {
            let machine = self.store.job(job).await?.machine_id;
            if self.machines.len() >= KNOWN_JOBS {
                self.machines.clear();
            }
            self.machines.insert(job, machine);
        }
        Ok(self.machines.get(&job).map_or("", String::as_str))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Topics with what is said there, as far as a broker that takes everything is told now.
    async fn told(states: &mut States) -> Vec<(String, String)> {
        let changes = states.changes().await;
        states.take(changes);
        let mut told = Vec::new();
        while let Some(message) = states.next() {
            let name = serde_json::from_slice::<serde_json::Value>(&message.payload).ok();
            let name = name.and_then(|state| state["displayName"].as_str().map(str::to_owned));
            told.push((message.topic, name.unwrap_or_default()));
        }
        told
    }

    fn pair(topic: &str, name: &str) -> (String, String) {
        (topic.to_owned(), name.to_owned())
    }

    #[tokio::test(start_paused = true)]
    async fn a_slow_broker_is_told_the_newest_state_and_what_is_gone() {
        let floor = Floor::new();
        floor.put_machine("lathe", "1", "Lathe");
        floor.put_machine("mill", "1", "Mill");
        let config = MqttConfig { state_topic: "hall/{machine}/state".to_owned(), ..MqttConfig::default() };
        let mut states = States::new(floor.clone(), &config);
        assert_eq!(told(&mut states).await, [pair("hall/lathe/state", "Lathe"), pair("hall/mill/state", "Mill")]);
        for name in ["Third", "Fourth", "Fifth"] {
            floor.put_machine("lathe", "2", name);
        }
        floor.remove_machine("mill");
        assert_eq!(told(&mut states).await, [pair("hall/lathe/state", "Fifth"), pair("hall/mill/state", "")]);
    }

    #[tokio::test(start_paused = true)]
    async fn after_a_break_everything_is_told_and_what_is_gone_is_cleared() {
        let floor = Floor::new();
        floor.put_machine("lathe", "1", "Lathe");
        floor.put_machine("mill", "1", "Mill");
        let mut states = States::new(floor.clone(), &MqttConfig::default());
        assert_eq!(told(&mut states).await.len(), 2);
        // Nobody is connected.
        floor.remove_machine("mill");
        floor.put_machine("third", "1", "Third");
        states.begin_anew();
        let expected = [("lathe", "Lathe"), ("mill", ""), ("third", "Third")];
        let expected = expected.map(|(id, name)| pair(&format!("feedwave/{id}/state"), name));
        assert_eq!(told(&mut states).await, expected);
    }

    #[tokio::test(start_paused = true)]
    async fn states_come_no_faster_than_is_wanted() {
        let floor = Floor::new();
        let config = MqttConfig { state_interval_ms: 5_000, ..MqttConfig::default() };
        let mut states = States::new(floor.clone(), &config);
        let start = Instant::now();
        told(&mut states).await;
        floor.put_machine("lathe", "1", "Lathe");
        assert_eq!(told(&mut states).await.len(), 1);
        assert_eq!(start.elapsed(), Duration::from_secs(5));
        states.hurry();
        floor.put_machine("lathe", "2", "Lathe");
        assert_eq!(told(&mut states).await.len(), 1);
        assert!(start.elapsed() < Duration::from_secs(6));
    }
}
