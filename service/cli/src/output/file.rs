//! Where a file goes: under its name when complete, or straight to a pipe.

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
/// away when this is dropped unfinished. A link stays, and what it points to is replaced. Devices and pipes (`/dev/null`, a named
/// pipe, standard output as `/dev/stdout`) are written directly.
pub struct OutputFile {
    target: Target,
}

enum Target {
    Beside { temporary: NamedTempFile, path: PathBuf },
    Direct(File),
}

/// Links that are followed at most, as by the system.
const MOST_LINKS: u32 = 40;

impl OutputFile {
    /// Opens the temporary file, or the device.
    ///
    /// # Errors
    /// When the directory cannot be written or the device not opened.
    pub fn create(path: &Path) -> io::Result<Self> {
        let before = fs::metadata(path).ok();
        if before.as_ref().is_some_and(fs::Metadata::is_dir) {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "is a directory"));
        }
        let is_file = before.as_ref().is_none_or(fs::Metadata::is_file);
        let end = if is_file { end_of_links(path.to_owned())? } else { None };
        let Some(path) = end else {
            // Behind what a descriptor's file has already.
            return Ok(Self { target: Target::Direct(File::options().append(true).open(path)?) });
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".feedwave-").suffix(".part");
        // Readable like any other new file (the process's umask applies), not private like a temporary one.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let temporary = builder.tempfile_in(directory_of(&path))?;
        if let Some(before) = before {
            temporary.as_file().set_permissions(before.permissions())?;
        }
        Ok(Self { target: Target::Beside { temporary, path } })
    }

    /// Writes a whole file.
    ///
    /// # Errors
    /// When it cannot be written; what was there before is then as it was.
    pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
        let mut file = Self::create(path)?;
        file.write_all(bytes)?;
        file.commit()
    }

    /// Makes the file appear under its name.
    ///
    /// # Errors
    /// When the data cannot be flushed or the file not be renamed.
    pub fn commit(mut self) -> io::Result<()> {
        self.flush()?;
        match self.target {
            Target::Direct(_) => Ok(()),
            Target::Beside { temporary, path } => {
                // A disk may say only now that it is full.
                temporary.as_file().sync_all()?;
                temporary.persist(path).map(drop).map_err(|error| error.error)
            }
        }
    }
}

/// Where a path leads to by its links, which need not exist; `None` where it is an open descriptor of a process: its file is
/// not to be replaced, as others write to it as well.
fn end_of_links(mut path: PathBuf) -> io::Result<Option<PathBuf>> {
    for _ in 0..MOST_LINKS {
        let Ok(target) = fs::read_link(&path) else { return Ok(Some(path)) };
        let directory = directory_of(&path);
        if fs::canonicalize(directory)?.starts_with("/proc") {
            return Ok(None);
        }
        path = directory.join(target);
    }
    Err(io::Error::other("is a link to itself"))
}

fn directory_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
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
