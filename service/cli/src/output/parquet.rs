//! Parquet: the same columns, compressed with zstd, with the unit of each column in the file's metadata as
//! `unit:<column>`.

use std::io::{self, Write};
use std::ops::Range;
use std::sync::Arc;

use feedwave_cutting::SetpointBlock;
use parquet::basic::{Compression, Encoding, Repetition, Type as PhysicalType, ZstdLevel};
use parquet::data_type::{DoubleType, Int32Type, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnPath, Type, TypePtr};

use super::columns::{Column, Source};
use super::csv::missing;
use super::{Layout, SetpointWriter};

/// Rows gathered into a row group: a megabyte per column, so memory stays small and groups compress well.
const ROW_GROUP_ROWS: usize = 128 * 1024;

/// Writes setpoints as Parquet.
pub struct ParquetWriter<W: Write + Send> {
    file: SerializedFileWriter<W>,
    layout: Layout,
    pending: Vec<Values>,
    pending_rows: usize,
}

enum Values {
    Indices(Vec<i64>),
    Lines(Vec<i32>),
    Doubles(Vec<f64>),
}

impl Values {
    fn of(source: &Source) -> Self {
        match source {
            Source::Index => Self::Indices(Vec::new()),
            Source::Line => Self::Lines(Vec::new()),
            _ => Self::Doubles(Vec::new()),
        }
    }

    const fn physical_type(&self) -> PhysicalType {
        match self {
            Self::Indices(_) => PhysicalType::INT64,
            Self::Lines(_) => PhysicalType::INT32,
            Self::Doubles(_) => PhysicalType::DOUBLE,
        }
    }

    /// The encoding that compresses best: counters as differences, doubles byte by byte.
    const fn encoding(&self) -> Encoding {
        match self {
            Self::Indices(_) | Self::Lines(_) => Encoding::DELTA_BINARY_PACKED,
            Self::Doubles(_) => Encoding::BYTE_STREAM_SPLIT,
        }
    }
}

impl<W: Write + Send> ParquetWriter<W> {
    /// A writer that starts the file.
    ///
    /// # Errors
    /// When the underlying writer fails.
    pub fn new(inner: W, layout: Layout) -> io::Result<Self> {
        let pending: Vec<Values> = layout.columns().iter().map(|column| Values::of(&column.source)).collect();
        let schema = schema(layout.columns(), &pending).map_err(io::Error::other)?;
        let properties = properties(layout.columns(), &pending).map_err(io::Error::other)?;
        let file = SerializedFileWriter::new(inner, schema, Arc::new(properties)).map_err(into_io)?;
        Ok(Self { file, layout, pending, pending_rows: 0 })
    }

    fn write_row_group(&mut self) -> io::Result<()> {
        if self.pending_rows == 0 {
            return Ok(());
        }
        self.try_write_row_group().map_err(into_io)?;
        self.pending_rows = 0;
        Ok(())
    }

    fn try_write_row_group(&mut self) -> Result<(), ParquetError> {
        let mut group = self.file.next_row_group()?;
        for values in &mut self.pending {
            write_column(&mut group, values)?;
        }
        group.close().map(drop)
    }

    /// Writes what is still held back and the file's end, and returns the underlying writer.
    ///
    /// # Errors
    /// When the underlying writer fails.
    pub fn into_inner(mut self) -> io::Result<W> {
        self.write_row_group()?;
        self.file.into_inner().map_err(into_io)
    }
}

impl<W: Write + Send> SetpointWriter for ParquetWriter<W> {
    #[allow(clippy::cast_possible_wrap, reason = "indices and lines stay far below the signed range")]
    fn write(&mut self, block: &SetpointBlock, rows: Range<usize>) -> io::Result<()> {
        let indices = rows.clone().map(|row| block.first_index + row as u64);
        for (column, values) in self.layout.columns().iter().zip(&mut self.pending) {
            match values {
                Values::Indices(values) => values.extend(indices.clone().map(|index| index as i64)),
                Values::Lines(values) => values.extend(block.line[rows.clone()].iter().map(|&line| line as i32)),
                Values::Doubles(values) if column.source == Source::Time => {
                    values.extend(indices.clone().map(|index| self.layout.time_s(index)));
                }
                Values::Doubles(values) => {
                    let column_values = column.source.doubles(block).ok_or_else(|| missing(&column.name))?;
                    values.extend_from_slice(&column_values[rows.clone()]);
                }
            }
        }
        self.pending_rows += rows.len();
        if self.pending_rows >= ROW_GROUP_ROWS {
            self.write_row_group()?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.into_inner()?.flush()
    }
}

fn schema(columns: &[Column], values: &[Values]) -> Result<TypePtr, ParquetError> {
    let fields = columns.iter().zip(values).map(|(column, values)| {
        Type::primitive_type_builder(&column.name, values.physical_type())
            .with_repetition(Repetition::REQUIRED)
            .build()
            .map(Arc::new)
    });
    let fields = fields.collect::<Result<Vec<_>, _>>()?;
    Type::group_type_builder("setpoints").with_fields(fields).build().map(Arc::new)
}

fn properties(columns: &[Column], values: &[Values]) -> Result<WriterProperties, ParquetError> {
    let units = columns.iter().map(|column| KeyValue::new(format!("unit:{}", column.name), column.unit.clone()));
    let mut builder = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(3)?))
        .set_dictionary_enabled(false)
        .set_created_by(concat!("feedwave ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(units.collect()));
    for (column, values) in columns.iter().zip(values) {
        builder = builder.set_column_encoding(ColumnPath::from(column.name.as_str()), values.encoding());
    }
    Ok(builder.build())
}

fn write_column<W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    values: &mut Values,
) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("the row group has fewer columns than the schema".to_owned()));
    };
    match values {
        Values::Indices(values) => {
            column.typed::<Int64Type>().write_batch(values, None, None)?;
            values.clear();
        }
        Values::Lines(values) => {
            column.typed::<Int32Type>().write_batch(values, None, None)?;
            values.clear();
        }
        Values::Doubles(values) => {
            column.typed::<DoubleType>().write_batch(values, None, None)?;
            values.clear();
        }
    }
    column.close()
}

/// The I/O error inside, so that a full disk or a closed pipe is still recognised as such.
fn into_io(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(source) => match source.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(source) => io::Error::other(source),
        },
        other => io::Error::other(other),
    }
}
