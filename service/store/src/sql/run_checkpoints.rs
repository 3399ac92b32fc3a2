//! Checkpoints of live runs as rows.

use std::ops::Range;

use super::compress::{compress, decompress, offload};
use super::record::{Record, signed, unsigned};
use crate::error::{Result, check_size};
use crate::runs::{RunCheckpoint, RunMark};
use crate::settings::StoreSettings;

/// Longest generation key and state of a digest, bytes.
const MAX_KEY_BYTES: u64 = 1024;

/// A checkpoint of a run ready to be written, with what goes for it.
#[derive(Debug)]
pub(crate) struct Packed {
    pub(crate) attachment: i64,
    pub(crate) setpoint_index: i64,
    pub(crate) change_count: i64,
    pub(crate) generation_key: String,
    pub(crate) digest_state: Vec<u8>,
    pub(crate) snapshot_bytes: i64,
    pub(crate) snapshot: Vec<u8>,
    /// First indices of checkpoints that are removed, and those behind the last.
    pub(crate) removed: Vec<[i64; 2]>,
}

/// Refuses a checkpoint that is larger than it may be.
pub(crate) async fn packed(
    attachment: u64,
    checkpoint: RunCheckpoint,
    removed: Vec<Range<u64>>,
    settings: &StoreSettings,
) -> Result<Packed> {
    let RunCheckpoint { mark: RunMark { setpoint_index, digest_state }, change_count, generation_key, snapshot } =
        checkpoint;
    check_size("generation key size in bytes", generation_key.len(), MAX_KEY_BYTES)?;
    check_size("digest state size in bytes", digest_state.len(), MAX_KEY_BYTES)?;
    check_size("snapshot size in bytes", snapshot.len(), settings.max_snapshot_bytes)?;
    let bound = |range: Range<u64>| Ok([signed("setpoint index", range.start)?, signed("setpoint index", range.end)?]);
    Ok(Packed {
        attachment: signed("attachment", attachment)?,
        setpoint_index: signed("setpoint index", setpoint_index)?,
        change_count: signed("number of changes", change_count)?,
        generation_key,
        digest_state: digest_state.into(),
        snapshot_bytes: signed("snapshot size in bytes", snapshot.len() as u64)?,
        removed: removed.into_iter().map(bound).collect::<Result<_>>()?,
        snapshot: offload(snapshot.len(), move || compress(&snapshot)).await?,
    })
}

pub(crate) async fn checkpoint(row: &impl Record) -> Result<RunCheckpoint> {
    let size = unsigned(row, "snapshot_bytes")?;
    let packed = row.bytes("snapshot")?.to_vec();
    Ok(RunCheckpoint {
        mark: mark(row)?,
        change_count: unsigned(row, "change_count")?,
        generation_key: row.text("generation_key")?.to_owned(),
        snapshot: offload(packed.len(), move || decompress(&packed, size)).await?,
    })
}

pub(crate) fn mark(row: &impl Record) -> Result<RunMark> {
    let digest_state = row.bytes("digest_state")?.to_vec();
    Ok(RunMark { setpoint_index: unsigned(row, "setpoint_index")?, digest_state: digest_state.into() })
}
