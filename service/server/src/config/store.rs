//! Where the store is, under its present and its former key.

use std::path::{Path, PathBuf};

use feedwave_store::{InvalidStoreUri, ObjectSettings, ObjectsUri, StoreUri};
use serde::{Deserialize, Serialize};

use super::Config;
use super::problems::Problem;

/// The file of the store where none is named, in the working directory.
const DEFAULT_STORE_FILE: &str = "feedwave.db";

/// The store: jobs, programs, reports, machines, tools and runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StoreConfig {
    /// Where it is kept; absent: the file `feedwave.db` in the working directory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uri: Option<StoreUri>,
    /// Name of this replica among those that share the store.
    pub replica_name: String,
    /// Large programs in an object store.
    pub objects: ObjectsConfig,
}

/// Which programs are kept in an object store.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectsConfig {
    /// Where; absent: all programs are in the store itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uri: Option<ObjectsUri>,
    /// Those with more bytes than these.
    pub above_bytes: u64,
}

impl Default for ObjectsConfig {
    fn default() -> Self {
        Self { uri: None, above_bytes: 16 << 20 }
    }
}

impl ObjectsConfig {
    /// What the store is told.
    pub(crate) fn settings(&self) -> Option<ObjectSettings> {
        self.uri.clone().map(|uri| ObjectSettings { uri, above_bytes: self.above_bytes })
    }
}

impl StoreConfig {
    /// The store in this file, relative to the working directory where the path is relative.
    ///
    /// # Errors
    /// [`InvalidStoreUri`] if the path is empty.
    pub fn of_file(path: &Path) -> Result<Self, InvalidStoreUri> {
        StoreUri::of_file(path).map(|uri| Self { uri: Some(uri), ..Self::default() })
    }
}

/// What named the store before `store.uri` did; still read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DatabaseConfig {
    /// File of the store.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
}

impl Config {
    /// Where the store is kept.
    ///
    /// # Errors
    /// The key and what is wrong with it, where `store.uri` and `database.path` name different stores or none.
    pub fn store_uri(&self) -> Result<StoreUri, Problem> {
        let file = self.database.path.as_deref();
        match (&self.store.uri, file) {
            (Some(uri), None) => Ok(uri.clone()),
            (uri, file) => {
                let file = StoreUri::of_file(file.unwrap_or(Path::new(DEFAULT_STORE_FILE)))
                    .map_err(|error| ("database.path", error.to_string()))?;
                match uri {
                    Some(uri) if uri.file() != file.file() => {
                        let reason = format!("names another store than store.uri ({uri}): keep store.uri alone");
                        Err(("database.path", reason))
                    }
                    Some(uri) => Ok(uri.clone()),
                    None => Ok(file),
                }
            }
        }
    }

    /// What is still read but should be written otherwise, in words for the log.
    #[must_use]
    pub fn deprecations(&self) -> Vec<String> {
        let uri = self.database.path.as_ref().and_then(|_| self.store_uri().ok());
        uri.map(|uri| format!("database.path is the former name of store.uri: set store.uri to {uri} in its stead"))
            .into_iter()
            .collect()
    }
}
