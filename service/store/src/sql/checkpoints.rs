//! Checkpoints as rows.

use super::compress::{compress, decompress, offload};
use super::record::{Record, signed, unsigned};
use crate::checkpoints::{Checkpoint, CheckpointSet};
use crate::error::{Result, check_size};
use crate::settings::StoreSettings;

/// Rows per statement: well within SQLite's 32 766 parameters.
pub(crate) const ROWS: usize = 1000;

/// Longest generation key in bytes.
const MAX_KEY_BYTES: u64 = 1024;

/// A checkpoint ready to be written.
#[derive(Debug)]
pub(crate) struct Packed {
    pub(crate) setpoint_index: i64,
    pub(crate) input_offset: i64,
    pub(crate) snapshot_bytes: i64,
    pub(crate) snapshot: Vec<u8>,
}

fn pack(checkpoints: &[Checkpoint]) -> Result<Vec<Packed>> {
    let pack = |checkpoint: &Checkpoint| {
        Ok(Packed {
            setpoint_index: signed("setpoint index", checkpoint.setpoint_index)?,
            input_offset: signed("input offset", checkpoint.input_offset)?,
            snapshot_bytes: signed("snapshot size in bytes", checkpoint.snapshot.len() as u64)?,
            snapshot: compress(&checkpoint.snapshot)?,
        })
    };
    checkpoints.iter().map(pack).collect()
}

/// Checkpoints of a set, ready to be written.
pub(crate) async fn packed(
    set: &CheckpointSet,
    checkpoints: Vec<Checkpoint>,
    settings: &StoreSettings,
) -> Result<Vec<Packed>> {
    check_size("generation key size in bytes", set.generation_key.len(), MAX_KEY_BYTES)?;
    for checkpoint in &checkpoints {
        check_size("snapshot size in bytes", checkpoint.snapshot.len(), settings.max_snapshot_bytes)?;
    }
    let bytes = checkpoints.iter().map(|checkpoint| checkpoint.snapshot.len()).sum();
    offload(bytes, move || pack(&checkpoints)).await
}

/// A checkpoint as it was put.
pub(crate) async fn checkpoint(row: &impl Record) -> Result<Checkpoint> {
    let size = unsigned(row, "snapshot_bytes")?;
    let packed = row.bytes("snapshot")?.to_vec();
    Ok(Checkpoint {
        setpoint_index: unsigned(row, "setpoint_index")?,
        input_offset: unsigned(row, "input_offset")?,
        snapshot: offload(packed.len(), move || decompress(&packed, size)).await?,
    })
}
