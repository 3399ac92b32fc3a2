//! Files that commands write, above all of setpoints: one list of columns, written as CSV or Parquet.
//!
//! Invariants: both formats carry the same columns in the same order and the same numbers to the last bit; memory does
//! not grow with the number of setpoints; a file appears under its name only when it is complete.

mod columns;
mod csv;
mod file;
mod parquet;

use std::io;
use std::ops::Range;

use feedwave_cutting::SetpointBlock;

pub use columns::{Column, Layout};
pub use csv::CsvWriter;
pub use file::{FileFormat, OutputFile, create};
pub use parquet::ParquetWriter;

/// Takes setpoints, block by block.
pub trait SetpointWriter {
    /// Writes these rows of the block.
    ///
    /// # Errors
    /// When the underlying writer fails.
    fn write(&mut self, block: &SetpointBlock, rows: Range<usize>) -> io::Result<()>;

    /// Writes what is still held back and, for a file, makes it appear under its name.
    ///
    /// # Errors
    /// When the underlying writer fails.
    fn finish(self: Box<Self>) -> io::Result<()>;
}

#[cfg(test)]
mod tests;
