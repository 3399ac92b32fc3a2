//! Checkpoints: snapshots of a job's generator from which its stream continues without generating
//! what precedes. They are derived data: losing them costs time, never content.

use async_trait::async_trait;
use bytes::Bytes;
use uuid::Uuid;

use crate::error::Result;

/// Which checkpoints belong together: snapshots of one generator over one job.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct CheckpointSet {
    /// The job.
    pub job_id: Uuid,
    /// Interpolation period in microseconds.
    pub interpolation_period_us: u32,
    /// Names everything else the snapshots depend on, the version of the generator included.
    pub generation_key: String,
}

/// The state of a generator before it produces one setpoint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Checkpoint {
    /// Index of the setpoint produced next.
    pub setpoint_index: u64,
    /// Offset of the program byte read next.
    pub input_offset: u64,
    /// State of the generator.
    pub snapshot: Bytes,
}

/// Keeps checkpoints.
#[async_trait]
pub trait Checkpoints {
    /// Adds checkpoints to a set; one with the same setpoint index is replaced. All or none.
    ///
    /// # Errors
    /// `NotFound` if the job does not exist, `TooLarge`, `Unavailable`.
    async fn put_checkpoints(&self, set: &CheckpointSet, checkpoints: Vec<Checkpoint>) -> Result<()>;

    /// Replaces a whole set at once.
    ///
    /// # Errors
    /// As [`Checkpoints::put_checkpoints`].
    async fn replace_checkpoints(&self, set: &CheckpointSet, checkpoints: Vec<Checkpoint>) -> Result<()>;

    /// The last checkpoint of a set at or before a setpoint.
    ///
    /// # Errors
    /// `Corrupt`, `Unavailable`.
    async fn nearest_checkpoint(&self, set: &CheckpointSet, setpoint_index: u64) -> Result<Option<Checkpoint>>;

    /// Deletes all checkpoints of a job, of every set.
    ///
    /// # Errors
    /// `Unavailable`.
    async fn delete_checkpoints(&self, job_id: Uuid) -> Result<()>;
}
