//! What the URI of an SQLite store says.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;
use std::time::Duration;

use percent_encoding::{AsciiSet, CONTROLS, percent_decode_str, percent_encode};
use url::Url;

use crate::uri::{InvalidStoreUri, number};

/// Scheme of the URI.
pub(crate) const SCHEME: &str = "sqlite";
/// A URI as it should be.
pub(crate) const EXAMPLE: &str = "sqlite:///var/lib/feedwave/feedwave.db";

/// What stands for itself in a path; everything else is escaped, so that parsing gives the path back.
const ESCAPED: &AsciiSet = &CONTROLS
    .add(b' ')
    .add(b'"')
    .add(b'#')
    .add(b'%')
    .add(b'<')
    .add(b'>')
    .add(b'?')
    .add(b'\\')
    .add(b'^')
    .add(b'`')
    .add(b'{')
    .add(b'|')
    .add(b'}');

/// A database file and how it is used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SqliteOptions {
    /// The file.
    pub(crate) path: PathBuf,
    /// Connections that read at the same time.
    pub(crate) readers: u32,
    /// How long to wait for a lock held by another process, or for a free reader.
    pub(crate) busy_timeout: Duration,
    /// How long a read may take to answer: a disk that has not by then may never do.
    pub(crate) read_timeout: Duration,
    /// Free space of the disk that is kept for removing records, bytes; where none is stated, [`DEFAULT_HEADROOM`].
    pub(crate) headroom: Option<u64>,
}

/// Free space that is kept where none is stated, bytes: as much as the log holds before a commit moves it into the database.
pub(crate) const DEFAULT_HEADROOM: u64 = 64 << 20;

impl SqliteOptions {
    /// This file, used in the default manner.
    pub(crate) fn new(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            readers: 4,
            busy_timeout: Duration::from_secs(5),
            read_timeout: Duration::from_secs(45),
            headroom: None,
        }
    }

    /// The URI of the file.
    pub(crate) fn to_uri(&self) -> String {
        format!("{SCHEME}://{}", percent_encode(self.path.as_os_str().as_bytes(), ESCAPED))
    }

    /// What a URI with this scheme says.
    pub(crate) fn from_url(url: &Url) -> Result<Self, InvalidStoreUri> {
        let absolute = url.as_str().strip_prefix(SCHEME).is_some_and(|rest| rest.starts_with(":///"));
        if !absolute {
            return Err(InvalidStoreUri::new(format!(
                "the path must be absolute, behind three slashes, as in {EXAMPLE}"
            )));
        }
        if url.fragment().is_some() {
            return Err(InvalidStoreUri::new("a # in a path is written %23"));
        }
        let path: Vec<u8> = percent_decode_str(url.path()).collect();
        if path.ends_with(b"/") {
            return Err(InvalidStoreUri::new(format!("the path names no file, as {EXAMPLE} does")));
        }
        if path.contains(&0) {
            return Err(InvalidStoreUri::new("a path has no %00"));
        }
        let mut options = Self::new(OsStr::from_bytes(&path));
        let mut given = Vec::new();
        for (key, value) in url.query_pairs() {
            match &*key {
                "readers" => options.readers = number(&key, &value, 1, 64)?,
                "busy_timeout_s" => options.busy_timeout = Duration::from_secs(number(&key, &value, 0, 3_600)?.into()),
                "read_timeout_s" => options.read_timeout = Duration::from_secs(number(&key, &value, 1, 3_600)?.into()),
                "headroom_mib" => options.headroom = Some(u64::from(number(&key, &value, 0, 1 << 30)?) << 20),
                _ => {
                    return Err(InvalidStoreUri::new(format!(
                        "the option {key:?} is unknown, known are: readers, busy_timeout_s, read_timeout_s, headroom_mib (a ? in a path is written %3F)"
                    )));
                }
            }
            if given.contains(&key) {
                return Err(InvalidStoreUri::new(format!("the option {key} is given twice")));
            }
            given.push(key);
        }
        Ok(options)
    }
}
