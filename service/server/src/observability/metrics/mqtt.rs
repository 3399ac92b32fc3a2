//! Figures of what is published by MQTT.

use prometheus::{IntCounterVec, IntGaugeVec};

use super::Registrar;

/// Figures of what is published by MQTT; none are shown where there is no broker.
#[derive(Clone, Debug)]
pub struct MqttMetrics {
    connected: IntGaugeVec,
    /// Messages that the broker has confirmed, by what they are about.
    pub published: IntCounterVec,
    /// What failed, by reason.
    pub failures: IntCounterVec,
}

impl MqttMetrics {
    pub(super) fn new(registrar: &Registrar) -> Self {
        Self {
            connected: registrar.gauges("feedwave_mqtt_connected", "1 while the MQTT broker is connected.", &[]),
            published: registrar.counters(
                "feedwave_mqtt_published_total",
                "Messages that the MQTT broker has confirmed.",
                &["what"],
            ),
            failures: registrar.counters(
                "feedwave_mqtt_failures_total",
                "Connections to the MQTT broker that were refused or lost, and messages that were too large.",
                &["reason"],
            ),
        }
    }

    /// There is a broker: everything is there from now on, so that the first of each is seen as an increase.
    pub(crate) fn begin(&self) {
        self.connected(false);
        for what in ["status", "state", "decision"] {
            self.published.with_label_values(&[what]);
        }
        for reason in ["refused", "lost", "too_large"] {
            self.failures.with_label_values(&[reason]);
        }
    }

    /// Whether the broker is connected.
    pub(crate) fn connected(&self, is_connected: bool) {
        self.connected.with_label_values::<&str>(&[]).set(i64::from(is_connected));
    }
}
