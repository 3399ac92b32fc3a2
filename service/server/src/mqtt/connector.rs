//! How the broker is reached: its address, what is shown to it, and what it is to say when the service is gone.

use std::path::Path;
use std::time::Duration;

use rumqttc::{
    AsyncClient, ConnectionError, Event, EventLoop, LastWill, MqttOptions, NetworkOptions, Outgoing, QoS,
    TlsConfiguration, Transport,
};

use super::in_flight::MAX_IN_FLIGHT;
use crate::config::{Broker, MqttConfig};
use crate::connections::{TlsError, client_config};

/// How long a connection may take to be made, and a message to be handed to the network.
pub(super) const PATIENCE: Duration = Duration::from_secs(10);
/// Largest message that a broker may send, bytes: nothing is subscribed to, so these are answers.
const MAX_INCOMING_BYTES: usize = 64 << 10;
/// What a message has besides topic and payload, bytes at most.
const MAX_HEAD_BYTES: usize = 16;
/// What the broker says where the service has not said that it ends.
pub(super) const WILL: &str = r#"{"online":false}"#;

/// How the broker is reached.
#[derive(Clone, Debug)]
pub(super) struct Connector {
    config: MqttConfig,
    broker: Broker,
}

impl Connector {
    pub(super) fn new(config: MqttConfig, broker: Broker) -> Self {
        Self { config, broker }
    }

    /// The broker, for the log.
    pub(super) fn broker(&self) -> &str {
        self.config.broker.as_deref().unwrap_or_default()
    }

    /// What a connection begins with, as the files say at the moment.
    ///
    /// # Errors
    /// [`TlsError`] where one cannot be read or used.
    pub(super) fn options(&self) -> Result<MqttOptions, TlsError> {
        let config = &self.config;
        let mut options = MqttOptions::new(&config.client_id, &self.broker.host, self.broker.port);
        options
            .set_keep_alive(Duration::from_secs(config.keepalive_s))
            .set_clean_session(false)
            .set_inflight(MAX_IN_FLIGHT)
            .set_max_packet_size(MAX_INCOMING_BYTES, largest_packet(config))
            .set_last_will(LastWill::new(&config.status_topic, WILL, QoS::AtLeastOnce, true));
        if let Some(user) = &config.user {
            let password = config.password_file.as_deref().map(password).transpose()?.unwrap_or_default();
            options.set_credentials(user, password);
        }
        if let Some(ca) = config.ca.as_deref().filter(|_| self.broker.is_encrypted) {
            let own = config.cert.as_deref().zip(config.key.as_deref());
            let tls = TlsConfiguration::Rustls(client_config("mqtt", ca, own)?);
            options.set_transport(Transport::tls_with_config(tls));
        }
        Ok(options)
    }

    /// A client that has not connected yet.
    pub(super) fn client(options: MqttOptions) -> (AsyncClient, EventLoop) {
        let (client, mut events) = AsyncClient::new(options, usize::from(MAX_IN_FLIGHT) + 2);
        let mut network = NetworkOptions::new();
        network.set_tcp_nodelay(true);
        network.set_connection_timeout(PATIENCE.as_secs());
        events.set_network_options(network);
        (client, events)
    }

    /// Makes the broker forget what an earlier process of this name had not finished: its numbers of messages are not those of this
    /// one. Nobody is told that the service came and went.
    pub(super) async fn forget_session(&self, mut options: MqttOptions) -> Result<(), ConnectionError> {
        let (name, transport) = (options.client_id(), options.transport());
        let mut without_will = MqttOptions::new(name, &self.broker.host, self.broker.port);
        without_will.set_transport(transport).set_clean_session(true).set_keep_alive(options.keep_alive());
        if let Some(login) = options.credentials() {
            without_will.set_credentials(login.username, login.password);
        }
        options = without_will;
        let (client, mut events) = Self::client(options);
        let goodbye = async {
            while !matches!(events.poll().await?, Event::Incoming(rumqttc::Packet::ConnAck(_))) {}
            let _ = client.try_disconnect();
            while !matches!(events.poll().await?, Event::Outgoing(Outgoing::Disconnect)) {}
            Ok(())
        };
        tokio::time::timeout(PATIENCE * 2, goodbye).await.unwrap_or(Err(ConnectionError::NetworkTimeout))
    }
}

/// The largest packet that a message makes.
fn largest_packet(config: &MqttConfig) -> usize {
    // A topic has two bytes for its length.
    let payload = usize::try_from(config.max_message_bytes).unwrap_or(usize::MAX);
    payload.saturating_add(usize::from(u16::MAX) + MAX_HEAD_BYTES)
}

/// The password in a file, without the end of its line.
fn password(path: &Path) -> Result<String, TlsError> {
    let problem = |reason: String| TlsError {
        key: "mqtt.password_file".to_owned(),
        reason: format!("{}: {reason}", path.display()),
    };
    let text = std::fs::read_to_string(path).map_err(|error| problem(error.to_string()))?;
    let password = text.trim_end_matches(['\r', '\n']);
    if password.is_empty() || password.len() > usize::from(u16::MAX) {
        return Err(problem("it must hold a password of 1 to 65535 bytes".to_owned()));
    }
    Ok(password.to_owned())
}
