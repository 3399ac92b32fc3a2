//! The library that makes faults, and what it is told.

use std::fs::File;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use tempfile::TempDir;

/// Input or output error.
pub const EIO: i32 = 5;
/// The quota of the disk is used up.
pub const EDQUOT: i32 = 122;
/// No space left on the device.
pub const ENOSPC: i32 = 28;

/// Size of the page that is shared with the library.
const PAGE_BYTES: u64 = 4_096;

/// The library, built by the system's C compiler once for all tests.
fn library() -> &'static Path {
    static BUILT: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = BUILT.get_or_init(|| {
        let folder = TempDir::new().expect("a temporary folder");
        let path = folder.path().join("interpose.so");
        let source = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/faults/interpose.c");
        let built =
            Command::new("cc").args(["-shared", "-fPIC", "-O2", "-o"]).arg(&path).args([source, "-ldl"]).status();
        assert!(built.expect("a C compiler").success(), "the library is built");
        (folder, path)
    });
    path
}

/// Faults of one service.
#[derive(Debug)]
pub struct Faults {
    control: File,
    _folder: TempDir,
    /// What the service is started with.
    pub environment: Vec<(String, String)>,
}

impl Faults {
    /// None yet.
    pub fn new() -> Self {
        let folder = TempDir::new().expect("a temporary folder");
        let path = folder.path().join("faults");
        let control = File::options().create_new(true).read(true).write(true).open(&path).expect("a file");
        control.set_len(PAGE_BYTES).expect("a page");
        let text = |path: &Path| path.to_str().expect("a path of text").to_owned();
        let environment = vec![("LD_PRELOAD".to_owned(), text(library())), ("FEEDWAVE_FAULTS".to_owned(), text(&path))];
        Self { control, _folder: folder, environment }
    }

    fn set(&self, offset: u64, bytes: &[u8]) {
        self.control.write_all_at(bytes, offset).expect("the fault is set");
    }

    /// Writes fail with this error; 0: they do not.
    pub fn writes_fail(&self, errno: i32) {
        self.set(0, &errno.to_ne_bytes());
    }

    /// Synchronisation with the disk fails with this error; 0: it does not.
    pub fn syncs_fail(&self, errno: i32) {
        self.set(4, &errno.to_ne_bytes());
    }

    /// Whether synchronisation with the disk does not come back.
    pub fn syncs_hang(&self, hang: bool) {
        self.set(8, &i32::from(hang).to_ne_bytes());
    }

    /// Whether writes and synchronisation of the write-ahead log do not fail.
    pub fn spare_log(&self, spare: bool) {
        self.set(12, &i32::from(spare).to_ne_bytes());
    }

    /// Reads fail with this error; 0: they do not.
    pub fn reads_fail(&self, errno: i32) {
        self.set(24, &errno.to_ne_bytes());
    }

    /// Whether reads do not come back.
    pub fn reads_hang(&self, hang: bool) {
        self.set(28, &i32::from(hang).to_ne_bytes());
    }

    /// How much longer each synchronisation with the disk takes, ms.
    pub fn syncs_take_longer(&self, delay_ms: i32) {
        self.set(32, &delay_ms.to_ne_bytes());
    }

    /// By how much the clock is ahead, s.
    pub fn clock_ahead(&self, offset_s: i64) {
        self.set(16, &offset_s.to_ne_bytes());
    }
}
