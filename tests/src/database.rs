//! A database of a server that a test has for itself.

use std::process::{Command, Stdio};
use std::sync::Arc;

/// A database that is dropped with the last of its clones, where `FEEDWAVE_TEST_POSTGRES_DROP` is a program that drops the
/// database of a name: a full run makes hundreds, of 8 MB each.
#[derive(Clone, Debug)]
pub struct Database {
    /// Where it is. A clone may have another way to it.
    pub uri: String,
    _dropped: Arc<Dropped>,
}

impl Database {
    /// One of this name, by the URI of a store with `{}` where the name goes. Whoever opens it makes it.
    #[must_use]
    pub fn new(pattern: &str, name: &str) -> Self {
        let name = name.to_owned();
        Self { uri: pattern.replace("{}", &name), _dropped: Arc::new(Dropped { name }) }
    }
}

#[derive(Debug)]
struct Dropped {
    name: String,
}

impl Drop for Dropped {
    fn drop(&mut self) {
        if let Some(program) = std::env::var_os("FEEDWAVE_TEST_POSTGRES_DROP") {
            // Where that fails, the server goes with all of them a little later.
            let _ = Command::new(program).arg(&self.name).stdout(Stdio::null()).stderr(Stdio::null()).status();
        }
    }
}
