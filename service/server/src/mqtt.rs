//! Publishes what machines do, and decisions, to an MQTT broker.
//!
//! The publisher reads the floor and the log of decisions as any watcher does, at the broker's pace: of a state the newest
//! one, of decisions the next one. Nothing is queued for a broker that is slow or away, and no run waits for it. With every
//! connection the service says that it is there, and all states are told again; the broker says that it is gone.

mod connector;
mod in_flight;
mod source;

use std::collections::VecDeque;
use std::panic::AssertUnwindSafe;
use std::pin::{Pin, pin};
use std::time::Duration;

use bytes::Bytes;
use futures_util::FutureExt as _;
use jiff::Timestamp;
use rumqttc::{AsyncClient, Event, EventLoop, MqttOptions, Outgoing, Packet, QoS};
use serde_json::json;
use tokio::time::{Instant, sleep, sleep_until, timeout};
use tokio_util::sync::CancellationToken;

use connector::{Connector, PATIENCE};
use in_flight::{InFlight, MAX_IN_FLIGHT, What};
use source::{Decisions, Message, States};

use crate::api::{Api, LogFilter, LogWatch};
use crate::config::MqttConfig;
use crate::connections::TlsError;
use crate::floor::STATE_INTERVAL;
use crate::observability::metrics::MqttMetrics;

/// Pause before the first attempt to connect again; each further one is twice as long.
const LEAST_PAUSE: Duration = Duration::from_millis(500);
/// The longest pause.
const MOST_PAUSE: Duration = Duration::from_secs(30);
/// Most decisions that wait for the broker: with a greeting before them they can all be said again at once.
const MOST_UNCONFIRMED: usize = MAX_IN_FLIGHT as usize - 1;
/// How long what the last runs did is waited for when the service ends: longer than the floor joins states.
const LAST_WORDS: Duration = STATE_INTERVAL.saturating_mul(2);
/// How long the broker may take for the end.
pub(crate) const GOODBYE: Duration = Duration::from_secs(3);

/// Why a connection is over.
#[derive(Debug)]
enum Ended {
    /// It failed.
    Failed {
        /// Why.
        reason: String,
        /// Since when it was there; `None` where the broker never took it.
        since: Option<Instant>,
    },
    /// The service ends, and the broker was told.
    Stopped,
}

/// How far a connection has come with what it says.
struct Saying {
    /// That the service is there, while it has not been said.
    greeting: Option<Message>,
    /// Where the service ends: until when its last words are waited for.
    ends_at: Option<Instant>,
}

/// Publishes until the service ends.
pub(crate) struct Publisher {
    connector: Connector,
    status_topic: String,
    decision_qos: QoS,
    /// Without a sign of life for so long, a connection is lost.
    silence: Duration,
    max_message_bytes: usize,
    states: States,
    decisions: Decisions,
    /// Decisions that the broker has not confirmed, oldest first.
    unconfirmed: VecDeque<Message>,
    in_flight: InFlight,
    metrics: MqttMetrics,
}

impl Publisher {
    /// A publisher; `None` where there is no broker. Decisions are published from the newest one on.
    ///
    /// # Errors
    /// [`TlsError`] where a file that the configuration names cannot be used.
    pub(crate) fn new(config: &MqttConfig, api: &Api) -> Result<Option<Self>, TlsError> {
        let Some(broker) = config.broker() else { return Ok(None) };
        let store = api.store.of_all_tenants();
        let filter = LogFilter::of_tenant(config.tenant());
        let log = LogWatch::new(store, &api.recent_decisions, None, filter);
        let connector = Connector::new(config.clone(), broker);
        connector.options()?;
        api.metrics.mqtt.begin();
        Ok(Some(Self {
            connector,
            status_topic: config.status_topic.clone(),
            decision_qos: if config.decision_qos == 1 { QoS::AtLeastOnce } else { QoS::ExactlyOnce },
            silence: Duration::from_secs(config.keepalive_s) * 2 + PATIENCE,
            max_message_bytes: usize::try_from(config.max_message_bytes).unwrap_or(usize::MAX),
            states: States::new(api.floors.of(config.tenant()), config),
            decisions: Decisions::new(log, store.clone(), api.metrics.unreadable_records.clone(), config),
            unconfirmed: VecDeque::new(),
            in_flight: InFlight::default(),
            metrics: api.metrics.mqtt.clone(),
        }))
    }

    /// Publishes until `stop`, and then says so to the broker.
    pub(crate) async fn run(mut self, stop: CancellationToken) {
        loop {
            // What the broker sends is read by a library: whatever it is, it ends no more than a connection.
            let session = AssertUnwindSafe(self.session(&stop)).catch_unwind().await;
            self.metrics.connected(false);
            if session.is_ok() {
                return;
            }
            self.metrics.failures.with_label_values(&["lost"]).inc();
            tracing::error!(broker = self.connector.broker(), "the MQTT client panicked, and is made anew");
            if stop.run_until_cancelled(sleep(MOST_PAUSE)).await.is_none() {
                return;
            }
        }
    }

    /// One session with the broker over any number of connections, until `stop`.
    async fn session(&mut self, stop: &CancellationToken) {
        let mut pause = LEAST_PAUSE;
        let mut client: Option<(AsyncClient, EventLoop)> = None;
        self.in_flight.clear();
        loop {
            let ended = match stop.run_until_cancelled(self.connect(&mut client)).await {
                None => return,
                Some(Err(reason)) => Ended::Failed { reason, since: None },
                Some(Ok((client, events))) => self.connection(client, events, stop).await,
            };
            self.metrics.connected(false);
            let Ended::Failed { reason, since } = ended else { return };
            if let Some((_, events)) = &mut client {
                self.in_flight.sort(&mut events.pending);
            }
            // After a connection that lasted the pauses begin anew. Two services of one name push each other out at each other's
            // pace, and so ever more seldom.
            if since.is_some_and(|since| since.elapsed() >= pause * 2) {
                pause = LEAST_PAUSE;
            }
            let (kind, what) = if since.is_some() { ("lost", "is lost") } else { ("refused", "cannot be made") };
            self.metrics.failures.with_label_values(&[kind]).inc();
            let (broker, again_s) = (self.connector.broker(), pause.as_secs_f64());
            tracing::warn!(broker, %reason, again_s, "the connection to the MQTT broker {what}");
            if stop.run_until_cancelled(sleep(pause)).await.is_none() {
                return;
            }
            pause = (pause * 2).min(MOST_PAUSE);
        }
    }

    /// The client with what the files say now, made where there is none.
    async fn connect<'a>(
        &self,
        client: &'a mut Option<(AsyncClient, EventLoop)>,
    ) -> Result<(&'a AsyncClient, &'a mut EventLoop), String> {
        let connector = self.connector.clone();
        // Files are read on a thread that may wait.
        let options = tokio::task::spawn_blocking(move || connector.options()).await;
        let options: MqttOptions =
            options.map_err(|error| error.to_string())?.map_err(|error: TlsError| error.to_string())?;
        if client.is_none() {
            self.connector.forget_session(options.clone()).await.map_err(|error| error.to_string())?;
        }
        let (client, events) = client.get_or_insert_with(|| Connector::client(options.clone()));
        events.mqtt_options = options;
        Ok((client, events))
    }

    /// One connection.
    async fn connection(&mut self, client: &AsyncClient, events: &mut EventLoop, stop: &CancellationToken) -> Ended {
        let resumed = loop {
            match stop.run_until_cancelled(events.poll()).await {
                None => return Ended::Stopped,
                Some(Err(error)) => return Ended::Failed { reason: error.to_string(), since: None },
                Some(Ok(Event::Incoming(Packet::ConnAck(answer)))) => break answer.session_present,
                Some(Ok(_)) => {}
            }
        };
        let since = Some(Instant::now());
        self.metrics.connected(true);
        tracing::info!(broker = self.connector.broker(), resumed, "connected to the MQTT broker");
        match self.publish(client, events, resumed, stop).await {
            Ok(()) => Ended::Stopped,
            Err(reason) => Ended::Failed { reason, since },
        }
    }

    /// Publishes until the connection fails, or until `stop` and everything is said.
    async fn publish(
        &mut self,
        client: &AsyncClient,
        events: &mut EventLoop,
        resumed: bool,
        stop: &CancellationToken,
    ) -> Result<(), String> {
        let mut saying = Saying { greeting: Some(self.status(true)), ends_at: None };
        if !resumed {
            self.in_flight.clear();
            // What the broker does not remember is said again; whether it had told others of it already, nobody knows.
            for message in saying.greeting.take().into_iter().chain(self.unconfirmed.clone()) {
                self.send(client, message)?;
            }
        }
        self.states.begin_anew();
        loop {
            // Never given up while it waits: it may have read half of an event.
            let event = self.say(client, pin!(timeout(self.silence, events.poll())), &mut saying, stop).await?;
            match event {
                Some(Ok(Ok(event))) => self.take(&event)?,
                Some(Ok(Err(error))) => return Err(error.to_string()),
                Some(Err(_)) => {
                    events.clean();
                    return Err(format!("no sign of life within {} s", self.silence.as_secs()));
                }
                None => break,
            }
        }
        timeout(GOODBYE, self.say_goodbye(client, events)).await.unwrap_or_else(|_| Err("no answer".to_owned()))
    }

    /// Sends what there is to send until an event comes; `None` once the service ends and everything is said.
    async fn say<E>(
        &mut self,
        client: &AsyncClient,
        mut event: Pin<&mut impl Future<Output = E>>,
        saying: &mut Saying,
        stop: &CancellationToken,
    ) -> Result<Option<E>, String> {
        loop {
            let has_room = self.in_flight.has_room();
            if let Some(message) = saying.greeting.take_if(|_| has_room) {
                self.send(client, message)?;
                continue;
            }
            let Saying { greeting, ends_at } = &mut *saying;
            let is_over = ends_at.is_some_and(|ends_at| ends_at <= Instant::now());
            if is_over && greeting.is_none() && self.in_flight.is_empty() && !self.states.are_waiting() {
                return Ok(None);
            }
            tokio::select! {
                event = event.as_mut() => return Ok(Some(event)),
                () = stop.cancelled(), if ends_at.is_none() => {
                    *ends_at = Some(Instant::now() + LAST_WORDS);
                    self.states.hurry();
                }
                () = sleep_until(ends_at.unwrap_or_else(Instant::now)), if ends_at.is_some() && !is_over => {}
                changes = self.states.changes() => self.states.take(changes),
                () = std::future::ready(()), if has_room && self.states.are_waiting() => {
                    if let Some(message) = self.states.next() {
                        self.send(client, message)?;
                    }
                }
                message = self.decisions.next(), if has_room && self.unconfirmed.len() < MOST_UNCONFIRMED => {
                    self.unconfirmed.push_back(message.clone());
                    self.send(client, message)?;
                }
            }
        }
    }

    /// Says that the service is not there any more, and ends the connection.
    async fn say_goodbye(&mut self, client: &AsyncClient, events: &mut EventLoop) -> Result<(), String> {
        let message = self.status(false);
        self.send(client, message)?;
        while !self.in_flight.is_empty() {
            let event = events.poll().await.map_err(|error| error.to_string())?;
            self.take(&event)?;
        }
        client.try_disconnect().map_err(|error| error.to_string())?;
        while !matches!(events.poll().await, Ok(Event::Outgoing(Outgoing::Disconnect)) | Err(_)) {}
        Ok(())
    }

    /// Takes note of what the client did or was told.
    fn take(&mut self, event: &Event) -> Result<(), String> {
        if let Event::Outgoing(Outgoing::AwaitAck(number)) = event {
            return Err(format!("message {number} is in use twice"));
        }
        let Some(what) = self.in_flight.take(event) else { return Ok(()) };
        self.metrics.published.with_label_values(&[what.name()]).inc();
        if matches!(what, What::Decision(_)) {
            self.unconfirmed.retain(|message| message.what != what);
        }
        Ok(())
    }

    /// Hands a message to the client.
    fn send(&mut self, client: &AsyncClient, message: Message) -> Result<(), String> {
        let Message { what, topic, payload } = message;
        if payload.len() > self.max_message_bytes || topic.len() > usize::from(u16::MAX) {
            self.metrics.failures.with_label_values(&["too_large"]).inc();
            tracing::warn!(
                topic,
                bytes = payload.len(),
                "a message is larger than mqtt.max_message_bytes, and left out"
            );
            self.unconfirmed.retain(|message| message.what != what || !matches!(what, What::Decision(_)));
            return Ok(());
        }
        let (qos, is_retained) = match what {
            What::Status | What::State => (QoS::AtLeastOnce, true),
            What::Decision(_) => (self.decision_qos, false),
        };
        client.try_publish(topic, qos, is_retained, payload).map_err(|error| error.to_string())?;
        self.in_flight.push(what);
        Ok(())
    }

    /// Whether the service is connected, as a message.
    fn status(&self, online: bool) -> Message {
        let payload =
            json!({ "online": online, "time": Timestamp::now().to_string(), "version": crate::observability::VERSION });
        Message { what: What::Status, topic: self.status_topic.clone(), payload: Bytes::from(payload.to_string()) }
    }
}
