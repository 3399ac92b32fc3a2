//! Where a setpoint file goes: under its name when complete, or straight to a pipe.

use std::fs::{self, File};
use std::io::{self, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use feedwave_cutting::SetpointBlock;
use tempfile::NamedTempFile;

use super::{CsvWriter, Layout, ParquetWriter, SetpointWriter};

/// How setpoints are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FileFormat {
    /// Text, one line per setpoint, with a header line.
    Csv,
    /// Columns, compressed.
    Parquet,
}

impl FileFormat {
    /// The format that a file name asks for by its ending.
    #[must_use]
    pub fn of_path(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "csv" => Some(Self::Csv),
            "parquet" => Some(Self::Parquet),
            _ => None,
        }
    }
}

/// A file that appears under its name only when complete: written beside it under a temporary name, which goes
/// away when this is dropped unfinished. Devices and pipes (`/dev/null`, a named pipe) are written directly.
pub struct OutputFile {
    target: Target,
}

enum Target {
    Beside { temporary: NamedTempFile, path: PathBuf },
    Direct(File),
}

impl OutputFile {
    /// Opens the temporary file, or the device.
    ///
    /// # Errors
    /// When the directory cannot be written or the device not opened.
    pub fn create(path: &Path) -> io::Result<Self> {
        let is_device = fs::metadata(path).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir());
        if is_device {
            return Ok(Self { target: Target::Direct(File::options().write(true).open(path)?) });
        }
        if path.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "is a directory"));
        }
        let directory = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".feedwave-").suffix(".part");
        // Readable like any other new file (the process's umask applies), not private like a temporary one.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let temporary = builder.tempfile_in(directory)?;
        Ok(Self { target: Target::Beside { temporary, path: path.to_owned() } })
    }

    /// Makes the file appear under its name.
    ///
    /// # Errors
    /// When the data cannot be flushed or the file not be renamed.
    pub fn commit(mut self) -> io::Result<()> {
        self.flush()?;
        match self.target {
            Target::Direct(_) => Ok(()),
            Target::Beside { temporary, path } => temporary.persist(path).map(drop).map_err(|error| error.error),
        }
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.target {
            Target::Beside { temporary, .. } => temporary.write(bytes),
            Target::Direct(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.target {
            Target::Beside { temporary, .. } => temporary.flush(),
            Target::Direct(file) => file.flush(),
        }
    }
}

/// A writer of a setpoint file.
///
/// # Errors
/// When the file cannot be created.
pub fn create(path: &Path, format: FileFormat, layout: Layout) -> io::Result<Box<dyn SetpointWriter>> {
    let file = OutputFile::create(path)?;
    Ok(match format {
        FileFormat::Csv => Box::new(CsvFile(CsvWriter::new(file, layout))),
        FileFormat::Parquet => Box::new(ParquetFile(ParquetWriter::new(file, layout)?)),
    })
}

struct CsvFile(CsvWriter<OutputFile>);

impl SetpointWriter for CsvFile {
    fn write(&mut self, block: &SetpointBlock, rows: Range<usize>) -> io::Result<()> {
        self.0.write(block, rows)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.0.into_inner()?.commit()
    }
}

struct ParquetFile(ParquetWriter<OutputFile>);

impl SetpointWriter for ParquetFile {
    fn write(&mut self, block: &SetpointBlock, rows: Range<usize>) -> io::Result<()> {
        self.0.write(block, rows)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.0.into_inner()?.commit()
    }
}
