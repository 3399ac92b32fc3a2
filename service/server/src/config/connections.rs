//! Bounds on connections and on what one client can take up of the service.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::problems::Range;

/// Bounds on connections of both ports, and the share of one client in what there is.
///
/// A client is the subject of a verified certificate, or else an address; of IPv6 the first 64 bits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConnectionLimits {
    /// Connections open at once, of both ports together.
    pub total: usize,
    /// Connections of one client open at once.
    pub per_client: usize,
    /// Unary calls and HTTP requests of one client in progress at once.
    pub calls_per_client: usize,
    /// Streams of one client open at once, other than watchers: setpoints, runs, telemetry, uploads, interpretation.
    pub streams_per_client: usize,
    /// Watchers open at once.
    pub watchers: usize,
    /// Watchers of one client open at once.
    pub watchers_per_client: usize,
    /// Bytes of request messages held at once.
    pub request_bytes: u64,
    /// Bytes of request messages of one client held at once.
    pub request_bytes_per_client: u64,
    /// How long a handshake and the head of a request may take, s.
    pub header_timeout_s: u64,
    /// Longest pause between two parts of a request, s; calls that send in both directions may pause.
    pub request_timeout_s: u64,
    /// How long a connection stays open without a call, s.
    pub idle_timeout_s: u64,
    /// How long an answer may wait for its reader, s.
    pub unread_timeout_s: u64,
    /// After how long without a sign of life a connection of HTTP/2 is asked for one, s.
    pub keepalive_s: u64,
}

impl Default for ConnectionLimits {
    fn default() -> Self {
        Self {
            total: 1_024,
            per_client: 256,
            calls_per_client: 256,
            streams_per_client: 48,
            watchers: 512,
            watchers_per_client: 128,
            request_bytes: 64 << 20,
            request_bytes_per_client: 32 << 20,
            header_timeout_s: 10,
            request_timeout_s: 60,
            idle_timeout_s: 300,
            unread_timeout_s: 600,
            keepalive_s: 30,
        }
    }
}

impl ConnectionLimits {
    /// [`ConnectionLimits::header_timeout_s`]
    #[must_use]
    pub const fn header_timeout(&self) -> Duration {
        Duration::from_secs(self.header_timeout_s)
    }

    /// [`ConnectionLimits::request_timeout_s`]
    #[must_use]
    pub const fn request_timeout(&self) -> Duration {
        Duration::from_secs(self.request_timeout_s)
    }

    /// [`ConnectionLimits::idle_timeout_s`]
    #[must_use]
    pub const fn idle_timeout(&self) -> Duration {
        Duration::from_secs(self.idle_timeout_s)
    }

    /// [`ConnectionLimits::unread_timeout_s`]
    #[must_use]
    pub const fn unread_timeout(&self) -> Duration {
        Duration::from_secs(self.unread_timeout_s)
    }

    /// [`ConnectionLimits::keepalive_s`]
    #[must_use]
    pub const fn keepalive(&self) -> Duration {
        Duration::from_secs(self.keepalive_s)
    }

    /// Each key with its value and the range that it must be in. The largest message has `message_bytes`.
    pub(super) fn ranges(&self, message_bytes: u64) -> [Range; 13] {
        let counts = 1_000_000;
        let day_s = 86_400;
        [
            ("connections.total", self.total as u64, 1, counts),
            ("connections.per_client", self.per_client as u64, 1, counts),
            ("connections.calls_per_client", self.calls_per_client as u64, 1, counts),
            ("connections.streams_per_client", self.streams_per_client as u64, 1, counts),
            ("connections.watchers", self.watchers as u64, 1, counts),
            ("connections.watchers_per_client", self.watchers_per_client as u64, 1, counts),
            // A largest message has to fit.
            ("connections.request_bytes", self.request_bytes, message_bytes, 1 << 40),
            ("connections.request_bytes_per_client", self.request_bytes_per_client, message_bytes, 1 << 40),
            ("connections.header_timeout_s", self.header_timeout_s, 1, day_s),
            ("connections.request_timeout_s", self.request_timeout_s, 1, day_s),
            ("connections.idle_timeout_s", self.idle_timeout_s, 1, day_s),
            ("connections.unread_timeout_s", self.unread_timeout_s, 1, day_s),
            ("connections.keepalive_s", self.keepalive_s, 1, day_s),
        ]
    }
}
