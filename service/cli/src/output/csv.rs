//! CSV: a header line with units, then one line per setpoint. Numbers are the shortest decimals that read back
//! to the same double.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::ops::Range;

use feedwave_cutting::SetpointBlock;

use super::columns::Source;
use super::{Layout, SetpointWriter};

/// Bytes gathered before the underlying writer is called.
const FLUSH_BYTES: usize = 256 * 1024;

/// Writes setpoints as CSV.
pub struct CsvWriter<W: Write> {
    inner: W,
    layout: Layout,
    text: String,
    last: Vec<Cell>,
}

/// A value and its text: columns that rest (an axis at rest, a constant feed) are not formatted again.
struct Cell {
    bits: u64,
    text: String,
}

impl<W: Write> CsvWriter<W> {
    /// A writer that starts with the header line.
    pub fn new(inner: W, layout: Layout) -> Self {
        let mut text = String::with_capacity(FLUSH_BYTES + 4_096);
        for (position, column) in layout.columns().iter().enumerate() {
            if position > 0 {
                text.push(',');
            }
            text.push_str(&column.name);
        }
        text.push('\n');
        let last = layout.columns().iter().map(|_| Cell { bits: 0, text: "0".to_owned() }).collect();
        Self { inner, layout, text, last }
    }

    fn flush_text(&mut self) -> io::Result<()> {
        self.inner.write_all(self.text.as_bytes())?;
        self.text.clear();
        Ok(())
    }

    /// Writes what is still held back and returns the underlying writer.
    ///
    /// # Errors
    /// When the underlying writer fails.
    pub fn into_inner(mut self) -> io::Result<W> {
        self.flush_text()?;
        self.inner.flush()?;
        Ok(self.inner)
    }
}

impl<W: Write> SetpointWriter for CsvWriter<W> {
    fn write(&mut self, block: &SetpointBlock, rows: Range<usize>) -> io::Result<()> {
        for row in rows {
            let index = block.first_index + row as u64;
            for (position, (column, cell)) in self.layout.columns().iter().zip(&mut self.last).enumerate() {
                if position > 0 {
                    self.text.push(',');
                }
                match &column.source {
                    Source::Index => append(&mut self.text, index),
                    Source::Line => append(&mut self.text, block.line[row]),
                    Source::Time => append(&mut self.text, self.layout.time_s(index)),
                    source => {
                        let values = source.doubles(block).ok_or_else(|| missing(&column.name))?;
                        let bits = values[row].to_bits();
                        if bits != cell.bits {
                            cell.bits = bits;
                            cell.text.clear();
                            append(&mut cell.text, values[row]);
                        }
                        self.text.push_str(&cell.text);
                    }
                }
            }
            self.text.push('\n');
            if self.text.len() >= FLUSH_BYTES {
                self.flush_text()?;
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.into_inner().map(drop)
    }
}

fn append(text: &mut String, value: impl std::fmt::Display) {
    // Writing to a String cannot fail.
    let _ = write!(text, "{value}");
}

pub(super) fn missing(column: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("the setpoints have no column {column}"))
}
