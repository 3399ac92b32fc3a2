//! Sizes and counts that bound what clients can ask for.

use std::time::Duration;

use feedwave_contract::MAX_MESSAGE_BYTES;
use serde::{Deserialize, Serialize};

use super::problems::Range;

/// Sizes and counts that bound what clients can ask for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Largest program sent inline, bytes.
    pub inline_program_bytes: u64,
    /// Largest uploaded program, bytes.
    pub upload_bytes: u64,
    /// Unfinished uploads kept at a time.
    pub unfinished_uploads: u32,
    /// Of these most of one client.
    pub unfinished_uploads_per_client: u32,
    /// Bytes announced for unfinished uploads; without it 16 GiB, and a largest program in any case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unfinished_upload_bytes: Option<u64>,
    /// Of these most of one client; without it 4 GiB, and a largest program in any case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unfinished_upload_bytes_per_client: Option<u64>,
    /// How long an unfinished upload is kept to which nothing comes, s.
    pub upload_expiry_s: u64,
    /// Largest request message, bytes.
    pub message_bytes: usize,
    /// Calls in progress at once, streams included.
    pub concurrent_requests: usize,
    /// Setpoint streams open at once.
    pub concurrent_streams: usize,
    /// Runs in progress at once, live ones and those of telemetry only.
    pub concurrent_runs: usize,
    /// How long a live run waits for the client's receipt of setpoints that were sent, s: then its stream ends, and the run can
    /// be taken up.
    pub receipt_s: u64,
    /// Streams that one connection may have open at once.
    pub streams_per_connection: u32,
    /// Programs validated at once.
    pub validation_workers: usize,
    /// How long a validation computes while others wait, ms: then it is another one's turn.
    pub validation_turn_ms: u64,
    /// Validations that keep what they have done between their turns; one client has at most half of them.
    pub begun_validations: usize,
    /// Attempts to validate a job that may end with the service; then the job has failed.
    pub validation_attempts: u32,
    /// How long open calls may take to finish when the service ends, and clients to read the rest of a connection that is
    /// closed, s.
    pub drain_s: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            inline_program_bytes: 1 << 20,
            upload_bytes: 2 << 30,
            unfinished_uploads: 256,
            unfinished_uploads_per_client: 64,
            unfinished_upload_bytes: None,
            unfinished_upload_bytes_per_client: None,
            upload_expiry_s: 86_400,
            message_bytes: 4 << 20,
            concurrent_requests: 1_024,
            concurrent_streams: 64,
            concurrent_runs: 64,
            receipt_s: 3_600,
            streams_per_connection: 128,
            validation_workers: std::thread::available_parallelism()
                .map_or(2, |cores| cores.get().saturating_sub(1).max(2)),
            validation_turn_ms: 200,
            begun_validations: 16,
            validation_attempts: 3,
            drain_s: 10,
        }
    }
}

impl Limits {
    /// [`Limits::unfinished_upload_bytes`], or its default.
    #[must_use]
    pub fn max_unfinished_upload_bytes(&self) -> u64 {
        self.unfinished_upload_bytes.unwrap_or_else(|| self.upload_bytes.max(16 << 30))
    }

    /// [`Limits::unfinished_upload_bytes_per_client`], or its default.
    #[must_use]
    pub fn max_unfinished_upload_bytes_per_client(&self) -> u64 {
        self.unfinished_upload_bytes_per_client.unwrap_or_else(|| self.upload_bytes.max(4 << 30))
    }

    /// [`Limits::validation_turn_ms`]
    #[must_use]
    pub const fn validation_turn(&self) -> Duration {
        Duration::from_millis(self.validation_turn_ms)
    }

    /// [`Limits::receipt_s`]
    #[must_use]
    pub const fn receipt_patience(&self) -> Duration {
        Duration::from_secs(self.receipt_s)
    }

    /// [`Limits::drain_s`]
    #[must_use]
    pub const fn drain(&self) -> Duration {
        Duration::from_secs(self.drain_s)
    }

    /// Each key with its value and the range that it must be in.
    pub(super) fn ranges(&self) -> [Range; 18] {
        let year_s = 31_536_000;
        let message_bytes = self.message_bytes as u64;
        [
            ("limits.message_bytes", message_bytes, 64 << 10, MAX_MESSAGE_BYTES as u64),
            // What surrounds an inline program in its message counts too.
            ("limits.inline_program_bytes", self.inline_program_bytes, 1, message_bytes.saturating_sub(32 << 10)),
            ("limits.upload_bytes", self.upload_bytes, 1, 1 << 40),
            ("limits.unfinished_uploads", self.unfinished_uploads.into(), 1, 100_000),
            ("limits.unfinished_uploads_per_client", self.unfinished_uploads_per_client.into(), 1, 100_000),
            // A largest program has to fit.
            ("limits.unfinished_upload_bytes", self.max_unfinished_upload_bytes(), self.upload_bytes, 1 << 50),
            (
                "limits.unfinished_upload_bytes_per_client",
                self.max_unfinished_upload_bytes_per_client(),
                self.upload_bytes,
                1 << 50,
            ),
            ("limits.upload_expiry_s", self.upload_expiry_s, 1, year_s),
            ("limits.concurrent_requests", self.concurrent_requests as u64, 1, 1_000_000),
            ("limits.concurrent_streams", self.concurrent_streams as u64, 1, 10_000),
            ("limits.concurrent_runs", self.concurrent_runs as u64, 1, 10_000),
            ("limits.receipt_s", self.receipt_s, 1, year_s),
            ("limits.streams_per_connection", self.streams_per_connection.into(), 1, 100_000),
            ("limits.validation_workers", self.validation_workers as u64, 1, 1_024),
            ("limits.validation_turn_ms", self.validation_turn_ms, 1, 60_000),
            ("limits.begun_validations", self.begun_validations as u64, 1, 1_024),
            ("limits.validation_attempts", self.validation_attempts.into(), 1, 1_000),
            ("limits.drain_s", self.drain_s, 0, 3_600),
        ]
    }
}
