//! The program that a command reads: a file, or standard input kept in a temporary file so that it can be read
//! twice and its lines be shown.

use std::fs::File;
use std::io::{self, BufReader, Read as _, Seek as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::CliError;

/// Bytes read at once.
const PIECE_BYTES: usize = 256 * 1024;
/// Bytes shown before and after a place in a long line.
const SHOWN_BYTES: usize = 90;
/// Longest line kept to show a part of it; the language reads no longer ones.
const LONGEST_LINE_BYTES: usize = 65_536 + 3;

/// A program that can be read again and again.
#[derive(Debug)]
pub(super) struct Source {
    /// What findings call it.
    pub(super) name: String,
    /// Its size, bytes.
    pub(super) size: u64,
    file: File,
    /// Where the next piece begins, bytes.
    at: u64,
    piece: Vec<u8>,
    /// Further program files, which calls of subprograms find by their names.
    further: Vec<FurtherFile>,
}

/// A further program file, opened when something of it is called.
#[derive(Debug)]
struct FurtherFile {
    name: String,
    path: PathBuf,
    is_read: bool,
    opened: Option<Box<Source>>,
}

/// Opens the further file at a place, and closes the others where many are open: processes have a limit.
fn opened(files: &mut [FurtherFile], place: usize) -> Result<&mut Source, CliError> {
    if files[place].opened.is_none() && files.iter().filter(|file| file.opened.is_some()).count() >= MOST_OPEN_FILES {
        files.iter_mut().for_each(|file| file.opened = None);
    }
    let FurtherFile { path, is_read, opened, .. } = &mut files[place];
    *is_read = true;
    match opened {
        Some(source) => Ok(source),
        closed => Ok(closed.insert(Box::new(Source::open(path)?))),
    }
}

/// Refuses to write over one of the files that a command reads, each with what it is called.
pub(super) fn refuse_input<'a>(
    out: &Path,
    mut inputs: impl Iterator<Item = (&'static str, &'a Path)>,
) -> Result<(), CliError> {
    // Only files are opened to compare them: opening a pipe would wait for who writes to it.
    let is_out = |path: &Path| out.is_file() && path.is_file() && same_file::is_same_file(out, path).unwrap_or(false);
    match inputs.find(|(_, path)| is_out(path)) {
        Some((name, _)) => {
            Err(CliError::trouble(format!("--out: is {name} itself; what is new goes into another file")))
        }
        None => Ok(()),
    }
}

/// Options that name further program files.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct IncludeArgs {
    /// Directory of further program files, in which calls of subprograms look for what the program itself does not have, by
    /// the names of the files: `O1000.nc`, `1000`, `rect.ngc`; with the directories in it; may be repeated
    #[arg(long = "include", value_name = "DIRECTORY")]
    include: Vec<PathBuf>,
}

impl IncludeArgs {
    /// One directory.
    #[cfg(test)]
    pub(super) fn of(directory: &Path) -> Self {
        Self { include: vec![directory.to_owned()] }
    }

    /// Opens a program with the further files.
    pub(super) fn open(&self, path: &Path) -> Result<Source, CliError> {
        self.around(Source::open(path)?)
    }

    /// A program that is open already, with the further files.
    pub(super) fn around(&self, mut source: Source) -> Result<Source, CliError> {
        for directory in &self.include {
            source.include(directory, directory, 0)?;
        }
        source.further.sort_by(|one, other| one.name.cmp(&other.name));
        let lower = |file: &FurtherFile| file.name.to_lowercase();
        let mut names: Vec<_> = source.further.iter().map(lower).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(CliError::trouble(format!("--include: the file {} is there twice", twice[0])));
        }
        Ok(source)
    }
}

/// Most further program files that are looked among; a job has fewer (`called.rs`).
const MOST_FURTHER_FILES: usize = 100_000;
/// Most further program files that are open at a time.
const MOST_OPEN_FILES: usize = 64;
/// How deep directories are searched.
const DEEPEST_DIRECTORY: u32 = 8;

/// A place in the program as text to show.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Snippet {
    /// The line, or the part of it around the place, with nothing unprintable.
    pub(super) text: String,
    /// Where the place begins in `text`, bytes.
    pub(super) start: usize,
    /// How much of `text` it covers, bytes.
    pub(super) length: usize,
}

/// A place to show: line and column counted from 1, column and length in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    pub(super) line: u32,
    pub(super) column: u32,
    pub(super) length: u32,
}

impl Source {
    /// Opens a file; `-` is standard input.
    pub(super) fn open(path: &Path) -> Result<Self, CliError> {
        if path == Path::new("-") {
            return Self::spool(io::stdin().lock(), "standard input");
        }
        let failed = |error: io::Error| CliError::file(path, &error);
        let file = File::open(path).map_err(failed)?;
        let metadata = file.metadata().map_err(failed)?;
        let name = path.display().to_string();
        if metadata.is_dir() {
            return Err(CliError::trouble(format!("{name}: is a directory")));
        }
        if !metadata.is_file() {
            return Self::spool(file, &name);
        }
        Ok(Self { name, size: metadata.len(), file, at: 0, piece: vec![0; PIECE_BYTES], further: Vec::new() })
    }

    /// A program in memory.
    pub(super) fn of_text(name: &str, text: &str) -> Result<Self, CliError> {
        Self::of_bytes(name, text.as_bytes())
    }

    /// A program in memory, whatever its bytes.
    pub(super) fn of_bytes(name: &str, bytes: &[u8]) -> Result<Self, CliError> {
        Self::spool(bytes, name)
    }

    fn spool(mut input: impl io::Read, name: &str) -> Result<Self, CliError> {
        let failed = |error: io::Error| CliError::written(name, &error);
        let mut file = tempfile::tempfile().map_err(failed)?;
        let size = io::copy(&mut input, &mut file).map_err(failed)?;
        Ok(Self { name: name.to_owned(), size, file, at: size, piece: vec![0; PIECE_BYTES], further: Vec::new() })
    }

    /// Adds the files of a directory and of those in it, by their names within `root`.
    fn include(&mut self, root: &Path, directory: &Path, depth: u32) -> Result<(), CliError> {
        let failed = |error: io::Error| CliError::file(directory, &error);
        for entry in std::fs::read_dir(directory).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            let is_hidden = path.file_name().is_none_or(|name| name.as_encoded_bytes().starts_with(b"."));
            // A broken link is no file that could be called.
            let Some(metadata) = std::fs::metadata(&path).ok().filter(|_| !is_hidden) else { continue };
            if metadata.is_dir() && depth < DEEPEST_DIRECTORY {
                self.include(root, &path, depth + 1)?;
            }
            if !metadata.is_file() {
                continue;
            }
            if self.further.len() == MOST_FURTHER_FILES {
                let place = root.display();
                return Err(CliError::trouble(format!("{place}: has more than {MOST_FURTHER_FILES} files")));
            }
            let within = path.strip_prefix(root).unwrap_or(&path);
            let parts: Vec<_> = within.iter().map(|part| part.to_string_lossy()).collect();
            self.further.push(FurtherFile { name: parts.join("/"), path: path.clone(), is_read: false, opened: None });
        }
        Ok(())
    }

    /// The names of the further program files, in the order of their places.
    pub(super) fn further_names(&self) -> Arc<[String]> {
        self.further.iter().map(|file| file.name.clone()).collect()
    }

    /// Where the further program files are, with their names.
    pub(super) fn further_paths(&self) -> impl Iterator<Item = (&str, &Path)> {
        self.further.iter().map(|file| (file.name.as_str(), file.path.as_path()))
    }

    /// The further program files that something was read of, with what they are called.
    pub(super) fn read_files(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        self.further.iter().filter(|file| file.is_read).map(|file| ("a file of --include", file.path.as_path()))
    }

    /// How many further program files there are.
    pub(super) const fn further_count(&self) -> usize {
        self.further.len()
    }

    /// The further program file at a place, with its name.
    pub(super) fn further_file(&mut self, place: usize) -> Result<(String, &mut Self), CliError> {
        Ok((self.further[place].name.clone(), opened(&mut self.further, place)?))
    }

    /// Keeps the further program files at these places, which ascend.
    pub(super) fn keep_further(&mut self, places: &[usize]) {
        let mut place = 0;
        self.further.retain(|_| {
            place += 1;
            places.binary_search(&(place - 1)).is_ok()
        });
    }

    /// The program itself for an empty name, or the further file of this name.
    pub(super) fn file(&mut self, name: &str) -> Result<Option<&mut Self>, CliError> {
        if name.is_empty() {
            return Ok(Some(self));
        }
        let place = self.further.iter().position(|file| file.name == name);
        place.map(|place| opened(&mut self.further, place)).transpose()
    }

    /// All bytes of the file.
    pub(super) fn whole(&mut self) -> Result<Vec<u8>, CliError> {
        self.rewind()?;
        let mut bytes = Vec::new();
        loop {
            match self.next_piece()? {
                [] => return Ok(bytes),
                piece => bytes.extend_from_slice(piece),
            }
        }
    }

    /// Goes back to the first byte.
    pub(super) fn rewind(&mut self) -> Result<(), CliError> {
        self.seek(0)
    }

    /// Goes to a byte.
    pub(super) fn seek(&mut self, offset: u64) -> Result<(), CliError> {
        self.at = self.file.seek(io::SeekFrom::Start(offset)).map_err(|error| self.failed(&error))?;
        Ok(())
    }

    /// Bytes from a place on; none at the end.
    pub(super) fn read(&mut self, place: feedwave_program::Place) -> Result<&[u8], CliError> {
        if let Some(further) = (place.program as usize).checked_sub(1) {
            if further >= self.further.len() {
                return Err(CliError::trouble(format!("there is no further file {further}")));
            }
            return opened(&mut self.further, further)?.read(feedwave_program::Place { program: 0, ..place });
        }
        if self.at != place.offset {
            self.seek(place.offset)?;
        }
        self.next_piece()
    }

    /// The next piece; empty at the end.
    pub(super) fn next_piece(&mut self) -> Result<&[u8], CliError> {
        match self.file.read(&mut self.piece) {
            Ok(length) => {
                self.at += length as u64;
                Ok(&self.piece[..length])
            }
            Err(error) => Err(self.failed(&error)),
        }
    }

    fn failed(&self, error: &io::Error) -> CliError {
        CliError::written(&self.name, error)
    }

    /// The text at each of these places, which ascend by line; `None` where the program has no such line. Reads
    /// the program once and keeps only what is shown.
    pub(super) fn snippets(&mut self, places: &[Place]) -> Result<Vec<Option<Snippet>>, CliError> {
        self.rewind()?;
        // What reads behind its back leaves the place unknown.
        self.at = u64::MAX;
        let mut reader = BufReader::with_capacity(PIECE_BYTES, &self.file);
        let mut line_number = 0;
        let mut line = Vec::new();
        let mut snippets = Vec::with_capacity(places.len());
        for place in places {
            while line_number < place.line {
                line.clear();
                let wanted = line_number + 1 == place.line;
                let read = read_line(&mut reader, if wanted { Some(&mut line) } else { None });
                if read.map_err(|error| CliError::written(&self.name, &error))? == 0 {
                    break;
                }
                line_number += 1;
                if line_number == 1 && line.starts_with(b"\xef\xbb\xbf") {
                    line.drain(..3);
                }
            }
            snippets.push((place.line > 0 && line_number == place.line).then(|| snippet(&line, place)));
        }
        Ok(snippets)
    }
}

/// Reads a line, keeping no more of it than could be shown, and without its end: a line feed, a carriage return, or both, as
/// the interpreter counts lines. Returns the bytes consumed.
fn read_line(reader: &mut impl io::BufRead, mut line: Option<&mut Vec<u8>>) -> io::Result<usize> {
    let mut read = 0;
    loop {
        let piece = reader.fill_buf()?;
        let end = piece.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
        let length = end.unwrap_or(piece.len());
        if let Some(line) = line.as_deref_mut() {
            let space = LONGEST_LINE_BYTES.saturating_sub(line.len());
            line.extend_from_slice(&piece[..length.min(space)]);
        }
        let is_last = piece.is_empty();
        let is_return = end.is_some_and(|end| piece[end] == b'\r');
        let consumed = length + usize::from(end.is_some());
        reader.consume(consumed);
        read += consumed;
        if is_return && reader.fill_buf()?.first() == Some(&b'\n') {
            reader.consume(1);
            read += 1;
        }
        if end.is_some() || is_last {
            return Ok(read);
        }
    }
}

fn snippet(line: &[u8], place: &Place) -> Snippet {
    let start = (place.column.max(1) as usize - 1).min(line.len());
    let end = (start + place.length as usize).min(line.len());
    let from = if line.len() <= 2 * SHOWN_BYTES { 0 } else { start.saturating_sub(SHOWN_BYTES) };
    let to = if line.len() <= 2 * SHOWN_BYTES { line.len() } else { line.len().min(start + SHOWN_BYTES) };
    let end = end.min(to);
    let mut text = String::new();
    if from > 0 {
        text.push('…');
    }
    push_printable(&mut text, &line[from..start]);
    let shown_start = text.len();
    push_printable(&mut text, &line[start..end]);
    let shown_end = text.len();
    push_printable(&mut text, &line[end..to]);
    if to < line.len() {
        text.push('…');
    }
    Snippet { text, start: shown_start, length: shown_end - shown_start }
}

/// Appends bytes as text of one column per character: control characters as their pictures, what is not UTF-8 as �.
fn push_printable(text: &mut String, bytes: &[u8]) {
    for chunk in bytes.utf8_chunks() {
        text.extend(chunk.valid().chars().map(|character| match character {
            '\t' => ' ',
            '\u{0}'..='\u{1f}' => char::from_u32(0x2400 + character as u32).unwrap_or('\u{fffd}'),
            character if character.is_control() => '\u{fffd}',
            character => character,
        }));
        text.extend(chunk.invalid().iter().map(|_| '\u{fffd}'));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(line: u32, column: u32, length: u32) -> Place {
        Place { line, column, length }
    }

    fn shown(program: &str, place: Place) -> Option<(String, String)> {
        let snippets = Source::of_text("p", program).unwrap().snippets(&[place]).unwrap();
        let snippet = snippets.into_iter().next().unwrap()?;
        let marked = snippet.text[snippet.start..snippet.start + snippet.length].to_owned();
        Some((snippet.text, marked))
    }

    #[test]
    fn places_are_found_whatever_the_line_ends_and_a_byte_order_mark() {
        let program = "\u{feff}%\r\nG1 X10\r\nG2 Q3";
        assert_eq!(shown(program, at(1, 1, 1)), Some(("%".to_owned(), "%".to_owned())));
        assert_eq!(shown(program, at(2, 4, 3)), Some(("G1 X10".to_owned(), "X10".to_owned())));
        assert_eq!(shown(program, at(3, 4, 2)), Some(("G2 Q3".to_owned(), "Q3".to_owned())));
        assert_eq!(shown(program, at(3, 6, 0)), Some(("G2 Q3".to_owned(), String::new())));
        assert_eq!(shown(program, at(4, 1, 1)), None);
        for end in ["\r", "\n", "\r\n"] {
            let program = ["%", "", "G1 X10", "G2 Q3"].join(end);
            assert_eq!(shown(&program, at(3, 4, 3)), Some(("G1 X10".to_owned(), "X10".to_owned())), "{end:?}");
            assert_eq!(shown(&program, at(4, 4, 2)), Some(("G2 Q3".to_owned(), "Q3".to_owned())), "{end:?}");
            assert_eq!(shown(&program, at(5, 1, 1)), None);
        }
    }

    #[test]
    fn several_places_in_one_line_and_an_empty_line() {
        let snippets = Source::of_text("p", "\nG1 G2\n").unwrap();
        let places = [at(1, 1, 0), at(2, 1, 2), at(2, 4, 2)];
        let texts: Vec<_> =
            { snippets }.snippets(&places).unwrap().into_iter().map(|snippet| snippet.unwrap().start).collect();
        assert_eq!(texts, [0, 0, 3]);
    }

    #[test]
    fn a_long_line_is_shown_in_part_and_what_follows_it_is_still_found() {
        let program = format!("{}X1{}\nM30\n", "G1 ".repeat(40_000), " Y2".repeat(40_000));
        let (text, _) = shown(&program, at(1, 120_001, 2)).unwrap();
        assert!(text.chars().count() < 200, "{text}");
        let (text, marked) = shown(&program, at(1, 3_001, 2)).unwrap();
        assert!(text.starts_with('…') && text.ends_with('…') && marked == "G1", "{text}");
        assert_eq!(shown(&program, at(2, 1, 3)).unwrap().1, "M30");
    }

    #[test]
    fn unprintable_bytes_keep_the_place() {
        let mut text = String::new();
        push_printable(&mut text, b"\x00\t\xffX");
        assert_eq!(text, "\u{2400} \u{fffd}X");
    }
}
