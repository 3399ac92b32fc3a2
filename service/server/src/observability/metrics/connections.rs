//! Figures of connections and of what clients take up.

use prometheus::{IntCounter, IntCounterVec, IntGauge};

use super::Registrar;
use crate::connections::Resource;

/// Figures of connections and of what clients take up.
#[derive(Clone, Debug)]
pub struct ConnectionMetrics {
    connections: IntGauge,
    calls: IntGauge,
    streams: IntGauge,
    watchers: IntGauge,
    refusals: IntCounterVec,
    closed: IntCounterVec,
    /// Bytes of request messages held.
    pub request_bytes: IntGauge,
    /// Connections that could not be accepted, such as for want of descriptors.
    pub accept_errors: IntCounter,
    /// Streams ended because nobody read them.
    pub unread_streams: IntCounter,
    /// Calls ended by a panic.
    pub panics: IntCounter,
    /// Times that changed certificates were taken over or refused, by outcome.
    pub certificate_reloads: IntCounterVec,
}

impl ConnectionMetrics {
    pub(super) fn new(registrar: &Registrar) -> Self {
        Self {
            connections: registrar.gauge("feedwave_connections", "Connections open, of both ports."),
            calls: registrar.gauge("feedwave_unary_calls", "Unary calls and HTTP requests in progress."),
            streams: registrar.gauge("feedwave_open_streams", "Streams open that are no watchers."),
            watchers: registrar.gauge("feedwave_watchers", "Watchers open."),
            refusals: registrar.counters(
                "feedwave_refusals_total",
                "Refusals of what there are too many of.",
                &["what"],
            ),
            closed: registrar.counters(
                "feedwave_connections_closed_total",
                "Connections closed by the service, by reason.",
                &["reason"],
            ),
            request_bytes: registrar.gauge("feedwave_request_bytes", "Bytes of request messages held."),
            accept_errors: registrar.counter("feedwave_accept_errors_total", "Connections that could not be accepted."),
            unread_streams: registrar
                .counter("feedwave_unread_streams_ended_total", "Streams ended because nobody read them."),
            panics: registrar.counter("feedwave_panics_total", "Calls ended by a panic."),
            certificate_reloads: registrar.counters(
                "feedwave_certificate_reloads_total",
                "Changed certificate files taken over or refused.",
                &["outcome"],
            ),
        }
    }

    pub(crate) const fn held(&self, resource: Resource) -> &IntGauge {
        match resource {
            Resource::Connection => &self.connections,
            Resource::Call => &self.calls,
            Resource::Stream => &self.streams,
            Resource::Watcher => &self.watchers,
        }
    }

    pub(crate) fn refused(&self, what: &str) {
        self.refusals.with_label_values(&[what]).inc();
    }

    pub(crate) fn closed(&self, reason: &str) {
        self.closed.with_label_values(&[reason]).inc();
    }
}
