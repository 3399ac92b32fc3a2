//! The fault bench: the built binary under faults of disk, clock and data, and under `kill -9`. Every test is short; the long
//! form is `tests/faults/long.sh`, whose figures are in docs/reliability.md.

/// The binary that cargo built along.
const FEEDWAVE: &str = env!("CARGO_BIN_EXE_feedwave");

mod bits;
mod clock;
mod data;
mod disk;
mod library;
mod memory_limit;
mod methods;
mod mixed;
mod replicas;
mod scaling;
