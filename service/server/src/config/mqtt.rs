//! The publisher to an MQTT broker.

use std::net::IpAddr;
use std::path::PathBuf;

use feedwave_store::Tenant;
use serde::{Deserialize, Serialize};

use super::problems::{Problem, Range};

/// Longest topic as it is configured, bytes.
const MAX_TOPIC_BYTES: usize = 1_024;
/// Longest name of a client, bytes.
const MAX_CLIENT_ID_BYTES: usize = 128;

/// A publisher of what machines do, and of decisions, to an MQTT broker.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MqttConfig {
    /// The broker, `mqtt://host` or `mqtts://host`, with `:port` where it is not 1883 or 8883; absent: nothing is published.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub broker: Option<String>,
    /// Name by which the broker knows this service; no other client of the broker may have it.
    pub client_id: String,
    /// Topic of the state of a machine, `{machine}` standing for its identifier.
    pub state_topic: String,
    /// Topic of decisions, `{machine}`, `{job}` and `{run}` standing for identifiers.
    pub decision_topic: String,
    /// Topic that says whether this service is connected.
    pub status_topic: String,
    /// Quality of service of decisions: 1, at least once, or 2, exactly once.
    pub decision_qos: u8,
    /// Least time between two states of a machine, ms.
    pub state_interval_ms: u64,
    /// After how long without a message broker and service ask each other for a sign of life, s.
    pub keepalive_s: u64,
    /// Largest message, bytes.
    pub max_message_bytes: u64,
    /// The tenant whose runs are published: its name; empty for the default one.
    pub tenant: String,
    /// Name that is shown to the broker; absent: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub user: Option<String>,
    /// File with the password of `user`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub password_file: Option<PathBuf>,
    /// File with the certificates that the broker's must be signed by, PEM.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ca: Option<PathBuf>,
    /// File with the certificate chain that is shown to the broker, PEM; absent: none is shown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cert: Option<PathBuf>,
    /// File with the key of that certificate, PEM.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub key: Option<PathBuf>,
    /// Whether messages may go over a network without encryption.
    pub allow_insecure_network: bool,
}

impl Default for MqttConfig {
    fn default() -> Self {
        Self {
            broker: None,
            client_id: "feedwave".to_owned(),
            state_topic: "feedwave/{machine}/state".to_owned(),
            decision_topic: "feedwave/{machine}/decision".to_owned(),
            status_topic: "feedwave/status".to_owned(),
            decision_qos: 2,
            state_interval_ms: 500,
            keepalive_s: 10,
            max_message_bytes: 128 << 10,
            tenant: String::new(),
            user: None,
            password_file: None,
            ca: None,
            cert: None,
            key: None,
            allow_insecure_network: false,
        }
    }
}

/// Where a broker is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Broker {
    /// Its name or address, as it stands in a URL.
    pub(crate) host: String,
    /// Its port.
    pub(crate) port: u16,
    /// Whether the connection is encrypted.
    pub(crate) is_encrypted: bool,
}

impl Broker {
    /// Reads `mqtt://host:port` or `mqtts://host:port`.
    fn parse(text: &str) -> Result<Self, String> {
        if text.contains('@') {
            // Not shown: it may hold a password.
            return Err(
                "has a name before @: it goes into mqtt.user, and the password into mqtt.password_file".to_owned()
            );
        }
        let wrong = || format!("must be mqtt://host, mqtts://host or one of these with :port, is {text:?}");
        let uri = text.parse::<http::Uri>().map_err(|_| wrong())?;
        let is_encrypted = match uri.scheme_str() {
            Some("mqtt") => false,
            Some("mqtts") => true,
            _ => return Err(wrong()),
        };
        let host = uri.host().filter(|host| !host.is_empty()).ok_or_else(wrong)?;
        if uri.path_and_query().is_some_and(|path| path.as_str() != "/") {
            return Err(wrong());
        }
        let named_port = uri.authority().is_some_and(|authority| authority.as_str() != host);
        let port = match uri.port_u16() {
            Some(port) if port > 0 => port,
            None if !named_port => {
                if is_encrypted {
                    8_883
                } else {
                    1_883
                }
            }
            _ => return Err(wrong()),
        };
        if is_encrypted && host.starts_with('[') {
            return Err(format!(
                "names the broker by an address of IPv6 ({host}): certificates are held against a name, or an address of IPv4"
            ));
        }
        Ok(Self { host: host.to_owned(), port, is_encrypted })
    }

    fn is_local(&self) -> bool {
        let address = self.host.trim_matches(['[', ']']).parse::<IpAddr>();
        self.host == "localhost" || address.is_ok_and(|address| address.to_canonical().is_loopback())
    }
}

impl MqttConfig {
    /// Each key with its value and the range that it must be in.
    pub(super) fn ranges(&self) -> [Range; 4] {
        [
            ("mqtt.decision_qos", self.decision_qos.into(), 1, 2),
            ("mqtt.state_interval_ms", self.state_interval_ms, 200, 600_000),
            ("mqtt.keepalive_s", self.keepalive_s, 5, 3_600),
            ("mqtt.max_message_bytes", self.max_message_bytes, 16 << 10, 256 << 20),
        ]
    }

    /// The broker; `None` where nothing is to be published. What cannot be read was refused with the configuration.
    pub(crate) fn broker(&self) -> Option<Broker> {
        self.broker.as_deref().and_then(|broker| Broker::parse(broker).ok())
    }

    /// The tenant whose runs are published.
    pub(crate) fn tenant(&self) -> Tenant {
        // What is no name was refused with the configuration.
        self.tenant.parse().unwrap_or(Tenant::DEFAULT)
    }

    /// Values of the right type that still cannot be used, by key.
    pub(super) fn problems(&self) -> Vec<Problem> {
        let mut problems = self.problems_of_topics();
        if !(1..=MAX_CLIENT_ID_BYTES).contains(&self.client_id.len()) || self.client_id.contains(char::is_control) {
            problems.push((
                "mqtt.client_id",
                format!("must have 1 to {MAX_CLIENT_ID_BYTES} bytes, and no control characters"),
            ));
        }
        if let Some(error) =
            Some(&self.tenant).filter(|name| !name.is_empty()).and_then(|name| name.parse::<Tenant>().err())
        {
            problems.push(("mqtt.tenant", error.to_string()));
        }
        let pairs = [
            ("mqtt.password_file", "mqtt.user", self.password_file.is_some() && self.user.is_none()),
            ("mqtt.cert", "mqtt.key", self.cert.is_some() && self.key.is_none()),
            ("mqtt.key", "mqtt.cert", self.key.is_some() && self.cert.is_none()),
        ];
        for (key, other, _) in pairs.into_iter().filter(|(_, _, is_alone)| *is_alone) {
            problems.push((key, format!("needs {other}")));
        }
        match self.broker.as_deref().map(Broker::parse) {
            Some(Ok(broker)) => problems.extend(self.problem_of_encryption(&broker)),
            Some(Err(reason)) => problems.push(("mqtt.broker", reason)),
            None => {}
        }
        problems
    }

    fn problem_of_encryption(&self, broker: &Broker) -> Option<Problem> {
        if broker.is_encrypted {
            return self.ca.is_none().then(|| {
                let reason = "must be set where mqtt.broker is mqtts://, for example to the system's \
                              /etc/ssl/certs/ca-certificates.crt";
                ("mqtt.ca", reason.to_owned())
            });
        }
        let files = [("mqtt.ca", &self.ca), ("mqtt.cert", &self.cert)];
        if let Some((key, _)) = files.into_iter().find(|(_, file)| file.is_some()) {
            return Some((key, "needs mqtt.broker to be mqtts://: mqtt:// is not encrypted".to_owned()));
        }
        (!broker.is_local() && !self.allow_insecure_network).then(|| {
            let reason = format!(
                "{} is reached over a network, and mqtt:// is not encrypted: use mqtts://, or permit it by \
                 mqtt.allow_insecure_network = true",
                broker.host
            );
            ("mqtt.broker", reason)
        })
    }

    fn problems_of_topics(&self) -> Vec<Problem> {
        let topics: [(_, &str, &[&str]); 3] = [
            ("mqtt.state_topic", &self.state_topic, &["machine"]),
            ("mqtt.decision_topic", &self.decision_topic, &["machine", "job", "run"]),
            ("mqtt.status_topic", &self.status_topic, &[]),
        ];
        let mut problems: Vec<Problem> = topics
            .into_iter()
            .filter_map(|(key, topic, places)| topic_problem(topic, places).map(|reason| (key, reason)))
            .collect();
        if problems.is_empty() && !self.state_topic.contains("{machine}") {
            problems.push((
                "mqtt.state_topic",
                "must have {machine} in it: each machine has a state of its own".to_owned(),
            ));
        }
        for (index, &(key, topic, _)) in topics.iter().enumerate() {
            if let Some((other, _, _)) = topics[..index].iter().find(|(_, other, _)| *other == topic) {
                problems.push((key, format!("is the topic of {other} as well: each needs its own")));
            }
        }
        problems
    }
}

/// What is wrong with a topic in which `{name}` may stand for something that has one of these names.
fn topic_problem(topic: &str, places: &[&str]) -> Option<String> {
    if !(1..=MAX_TOPIC_BYTES).contains(&topic.len()) {
        return Some(format!("must have 1 to {MAX_TOPIC_BYTES} bytes"));
    }
    if topic.starts_with('$') {
        return Some("begins with $, which only a broker's own topics do".to_owned());
    }
    let rest = places.iter().fold(topic.to_owned(), |rest, place| rest.replace(&format!("{{{place}}}"), ""));
    let wrong = rest.chars().find(|letter| matches!(letter, '+' | '#' | '{' | '}') || letter.is_control())?;
    let may_have = match places {
        [] => String::new(),
        places => {
            let places: Vec<String> = places.iter().map(|place| format!("{{{place}}}")).collect();
            format!("; it may have {} in it", places.join(", "))
        }
    };
    Some(format!("must be the name of a topic, without {wrong:?}{may_have}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(change: impl FnOnce(&mut MqttConfig)) -> Vec<&'static str> {
        let mut config = MqttConfig { broker: Some("mqtt://127.0.0.1".to_owned()), ..MqttConfig::default() };
        change(&mut config);
        config.problems().into_iter().map(|(key, _)| key).collect()
    }

    #[test]
    fn a_broker_is_a_host_and_a_port() {
        let broker = |text: &str| Broker::parse(text).map(|broker| (broker.host, broker.port, broker.is_encrypted));
        assert_eq!(broker("mqtt://broker.example"), Ok(("broker.example".to_owned(), 1_883, false)));
        assert_eq!(broker("mqtts://broker.example/"), Ok(("broker.example".to_owned(), 8_883, true)));
        assert_eq!(broker("mqtts://10.0.0.7:9000"), Ok(("10.0.0.7".to_owned(), 9_000, true)));
        assert_eq!(broker("mqtt://[::1]:1884"), Ok(("[::1]".to_owned(), 1_884, false)));
        for wrong in [
            "broker:1883",
            "http://broker",
            "mqtt://",
            "mqtt://broker/topic",
            "mqtt://b:0",
            "mqtt://b:65536",
            "mqtt://b:",
            "mqtts://[::1]",
        ] {
            assert!(broker(wrong).is_err(), "{wrong}");
        }
        let refused = broker("mqtt://me:secret@broker").unwrap_err();
        assert!(!refused.contains("secret") && refused.contains("mqtt.user"), "{refused}");
    }

    #[test]
    fn a_network_needs_encryption_or_a_permission() {
        let over = |broker: &str, permitted: bool| {
            keys(|config| {
                config.broker = Some(broker.to_owned());
                config.allow_insecure_network = permitted;
            })
        };
        assert_eq!(over("mqtt://localhost", false), [""; 0]);
        assert_eq!(over("mqtt://[::1]", false), [""; 0]);
        assert_eq!(over("mqtt://10.0.0.7", false), ["mqtt.broker"]);
        assert_eq!(over("mqtt://10.0.0.7", true), [""; 0]);
        assert_eq!(over("mqtts://10.0.0.7", false), ["mqtt.ca"]);
        assert_eq!(keys(|config| config.ca = Some("ca".into())), ["mqtt.ca"]);
    }

    #[test]
    fn what_belongs_together_is_set_together() {
        assert_eq!(keys(|_| ()), [""; 0]);
        assert_eq!(keys(|config| config.password_file = Some("password".into())), ["mqtt.password_file"]);
        let alone = |config: &mut MqttConfig| {
            config.broker = Some("mqtts://broker".to_owned());
            config.ca = Some("ca".into());
            config.key = Some("key".into());
        };
        assert_eq!(keys(alone), ["mqtt.key"]);
        assert_eq!(keys(|config| config.client_id.clear()), ["mqtt.client_id"]);
        assert_eq!(keys(|config| config.tenant = "no tenant".to_owned()), ["mqtt.tenant"]);
    }

    #[test]
    fn topics_are_names_with_known_places() {
        let state = |topic: &str| keys(|config| config.state_topic = topic.to_owned());
        assert_eq!(state("plant/hall-2/{machine}/feedwave/state"), [""; 0]);
        for wrong in
            ["", "$SYS/{machine}", "a/+/{machine}", "a/#", "{machine}/{run}", "{machine", "a\0{machine}", "state"]
        {
            assert_eq!(state(wrong), ["mqtt.state_topic"], "{wrong:?}");
        }
        assert_eq!(keys(|config| config.decision_topic = "d/{machine}/{job}/{run}".to_owned()), [""; 0]);
        assert_eq!(keys(|config| config.decision_topic = "decisions".to_owned()), [""; 0]);
        assert_eq!(keys(|config| config.decision_topic = config.state_topic.clone()), ["mqtt.decision_topic"]);
        assert_eq!(keys(|config| config.status_topic = "status/{machine}".to_owned()), ["mqtt.status_topic"]);
    }
}
