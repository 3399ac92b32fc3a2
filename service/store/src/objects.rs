//! Large programs as objects of an object store: the chunks of a program one behind the other, each compressed alone as in
//! the database, so that any of them is read by its range. The database knows where each lies and its SHA-256; nothing is
//! ever asked of an object store but by the name that the database knows.

mod uri;

use std::collections::HashMap;
use std::fmt;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use object_store::aws::AmazonS3Builder;
use object_store::azure::MicrosoftAzureBuilder;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{
    BackoffConfig, ClientOptions, MultipartUpload, ObjectStore, ObjectStoreExt as _, ObjectStoreScheme, RetryConfig,
};
use sha2::{Digest as _, Sha256};
use tokio::sync::{Semaphore, SemaphorePermit};
use uuid::Uuid;

use crate::error::{Result, StoreError};
use crate::sql::compress::{decompress, offload};
use bytes::Bytes;
pub use uri::{InvalidObjectsUri, ObjectsUri};

/// Bytes sent at once. Some object stores take no smaller ones but the last, and no more than 10 000.
const PART_BYTES: usize = 16 << 20;
/// Objects written at the same time, which bounds the memory that it takes.
const WRITES: usize = 2;
/// How long one request may take, and how long it is asked again for.
const REQUEST_AT_MOST: Duration = Duration::from_secs(30);
const CONNECT_AT_MOST: Duration = Duration::from_secs(5);
const RETRY_AT_MOST: Duration = Duration::from_secs(10);
/// How long reading a range or removing an object may take with all that is tried: who waits for it holds a turn of others.
const SMALL_AT_MOST: Duration = Duration::from_secs(10);
/// After an object could not be removed or written none is removed for so long, but left to be removed later.
const REMOVE_AGAIN_AFTER: Duration = Duration::from_secs(60);

/// Name of an empty object that is there before any other. It tells an object store that has lost something from one that is not
/// the one that was written, such as a folder where nothing is mounted.
const MARK: &str = "feedwave";

/// Which programs are kept as objects, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObjectSettings {
    /// Where new ones go. One that was kept elsewhere stays there.
    pub uri: ObjectsUri,
    /// Programs with more bytes of source than these are kept as objects.
    pub above_bytes: u64,
}

/// A chunk of a program in its object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub(crate) index: i64,
    pub(crate) source_bytes: i64,
    /// Where it begins in the object, and how long it is.
    pub(crate) object_offset: i64,
    pub(crate) object_bytes: i64,
    /// Of its bytes in the object.
    pub(crate) sha256: [u8; 32],
}

/// The name of an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ObjectName {
    /// Unlike the hash of a program it says nothing of what is in it.
    pub(crate) key: String,
    /// URI of the object store and prefix.
    pub(crate) place: String,
}

/// An object that is written.
#[derive(Clone, Debug)]
pub(crate) struct Written {
    pub(crate) name: ObjectName,
    pub(crate) bytes: i64,
    pub(crate) pieces: Vec<Piece>,
}

/// What an object store said, without what stands behind a question mark in an address: signatures may.
#[derive(Debug)]
struct Fault(String);

impl Fault {
    fn of(error: &dyn std::error::Error) -> Self {
        let mut text = error.to_string();
        let mut source = error.source();
        while let Some(cause) = source {
            let cause_text = cause.to_string();
            if !text.contains(&cause_text) {
                text += ": ";
                text += &cause_text;
            }
            source = cause.source();
        }
        let words = text.split(' ').map(|word| word.split_once('?').map_or(word, |(address, _)| address));
        Self(words.collect::<Vec<_>>().join(" ").chars().take(1_000).collect())
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Fault {}

/// Why an object that was written cannot be read where there is no mark either: it may be found again.
pub(crate) const MISSING: &str = "the object store of large programs is not the one that they were written to";

/// It may only not be mounted.
const NO_FOLDER: &str = "the folder of large programs is not there";

fn fault(error: &object_store::Error) -> StoreError {
    let reason = match error {
        object_store::Error::PermissionDenied { .. } | object_store::Error::Unauthenticated { .. } => {
            "the object store of large programs refuses the credentials"
        }
        _ => "the object store of large programs does not answer as it should",
    };
    StoreError::unavailable_by(reason, Fault::of(error))
}

/// An object store and what stands before each name.
#[derive(Clone)]
struct Opened {
    store: Arc<dyn ObjectStore>,
    prefix: Path,
    /// Where the object store is a folder.
    folder: Option<PathBuf>,
}

impl Opened {
    fn path(&self, key: &str) -> Path {
        self.prefix.clone().join(key)
    }

    /// Whether objects were written here before.
    async fn is_marked(&self) -> Result<bool> {
        // A folder would be made anew, where something else was before.
        if let Some(folder) = &self.folder
            && tokio::fs::metadata(folder).await.is_err()
        {
            return Err(StoreError::unavailable(NO_FOLDER));
        }
        match self.store.head(&self.path(MARK)).await {
            Ok(_) => Ok(true),
            Err(object_store::Error::NotFound { .. }) => Ok(false),
            Err(error) => Err(fault(&error)),
        }
    }
}

/// Object stores, opened when they are needed first. Cloning is cheap.
#[derive(Clone)]
pub(crate) struct Objects {
    settings: Option<ObjectSettings>,
    opened: Arc<Mutex<HashMap<String, Opened>>>,
    writes: Arc<Semaphore>,
    /// When one could not be removed or written.
    kept: Arc<Mutex<Option<Instant>>>,
}

impl Objects {
    /// Those that the database knows of; nothing new becomes one.
    pub(crate) fn known() -> Self {
        let writes = Arc::new(Semaphore::new(WRITES));
        Self { settings: None, opened: Arc::default(), writes, kept: Arc::default() }
    }

    /// Those of a store that is served.
    ///
    /// # Errors
    /// `CannotOpen` where the settings and the environment name no object store, whatever one would answer. A folder may be
    /// there later.
    pub(crate) fn of(settings: Option<ObjectSettings>) -> Result<Self> {
        let objects = Self { settings, ..Self::known() };
        let Some(ObjectSettings { uri, .. }) = &objects.settings else { return Ok(objects) };
        if uri.folder().is_some_and(|folder| !folder.is_dir()) {
            tracing::warn!(%uri, "the folder of large programs is not there: they cannot be stored until it is");
            return Ok(objects);
        }
        let opened = open(uri).map_err(|error| StoreError::CannotOpen {
            reason: "store.objects names no object store that can be used",
            source: Some(Arc::new(Fault::of(&error))),
        })?;
        let mut places = objects.opened.lock().unwrap_or_else(PoisonError::into_inner);
        places.insert(uri.to_string(), opened);
        drop(places);
        Ok(objects)
    }

    /// A name for a program of so many bytes, if it is to be an object.
    pub(crate) fn name_for(&self, size_bytes: u64) -> Option<ObjectName> {
        let settings = self.settings.as_ref().filter(|settings| size_bytes > settings.above_bytes)?;
        Some(ObjectName { key: Uuid::new_v4().to_string(), place: settings.uri.to_string() })
    }

    fn opened(&self, place: &str) -> Result<Opened> {
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = opened.get(place) {
            return Ok(found.clone());
        }
        let uri: ObjectsUri =
            place.parse().map_err(|error| StoreError::corrupt_by("the place of an object is none", error))?;
        if uri.folder().is_some_and(|folder| !folder.is_dir()) {
            return Err(StoreError::unavailable(NO_FOLDER));
        }
        let found = open(&uri).map_err(|error| {
            StoreError::unavailable_by("the object store of large programs cannot be opened", Fault::of(&error))
        })?;
        opened.insert(place.to_owned(), found.clone());
        Ok(found)
    }

    /// Whether objects were written to a place before.
    pub(crate) async fn is_marked(&self, place: &str) -> Result<bool> {
        self.opened(place)?.is_marked().await
    }

    /// Says of a place that objects are written to it.
    pub(crate) async fn mark(&self, place: &str) -> Result<()> {
        let opened = self.opened(place)?;
        opened.store.put(&opened.path(MARK), Bytes::new().into()).await.map_err(|error| fault(&error))?;
        Ok(())
    }

    /// Begins to write an object.
    pub(crate) async fn writer(&self, name: ObjectName) -> Result<Writer<'_>> {
        let turn = tokio::time::timeout(REQUEST_AT_MOST, self.writes.acquire()).await;
        let turn = turn.map_err(|_| StoreError::unavailable("other large programs are still being written"))?;
        let turn = turn.map_err(|_| StoreError::unavailable("it is closed"))?;
        let opened = self.opened(&name.place)?;
        let (path, store) = (opened.path(&name.key), opened.store);
        Ok(Writer { name, store, path, upload: None, part: Vec::new(), pieces: Vec::new(), bytes: 0, _turn: turn })
    }

    /// The source of a piece of an object, as it was written.
    pub(crate) async fn read(&self, name: &ObjectName, piece: &Piece) -> Result<Bytes> {
        let packed = self.packed(name, piece).await?;
        let size = piece.source_bytes.unsigned_abs();
        offload(packed.len(), move || decompress(&packed, size)).await
    }

    /// The bytes of a piece of an object, as they were written.
    pub(crate) async fn packed(&self, name: &ObjectName, piece: &Piece) -> Result<Bytes> {
        let opened = self.opened(&name.place)?;
        let path = opened.path(&name.key);
        let begin = piece.object_offset.unsigned_abs();
        let end = begin + piece.object_bytes.unsigned_abs();
        let packed = within(async {
            match opened.store.get_range(&path, begin..end).await {
                Ok(packed) => Ok(packed),
                Err(error) => Err(lost(&opened, name, end, &error).await),
            }
        })
        .await?;
        let (sha256, length) = (piece.sha256, end - begin);
        if (packed.len() as u64) < length {
            return Err(other(name, "is shorter than it was written"));
        }
        let (packed, actual) =
            offload(packed.len(), move || Ok((packed.clone(), <[u8; 32]>::from(Sha256::digest(&packed))))).await?;
        if actual == sha256 { Ok(packed) } else { Err(other(name, "has other bytes than were written")) }
    }

    /// Removes an object, if it is there.
    pub(crate) async fn remove(&self, name: &ObjectName) -> Result<()> {
        let opened = self.opened(&name.place)?;
        if let Some(folder) = &opened.folder {
            // What was being written as the process was killed lies beside it under this name.
            match tokio::fs::remove_file(folder.join(format!("{}#1", name.key))).await {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(StoreError::unavailable_by(
                        "what was being written of an object cannot be removed",
                        error,
                    ));
                }
                _ => {}
            }
        }
        let removed = within(async {
            match opened.store.delete(&opened.path(&name.key)).await {
                Ok(()) => Ok(()),
                // It is where it was written that it has to be gone.
                Err(object_store::Error::NotFound { .. }) if opened.is_marked().await? => Ok(()),
                Err(object_store::Error::NotFound { .. }) => Err(StoreError::unavailable(MISSING)),
                Err(error) => Err(fault(&error)),
            }
        })
        .await;
        *self.kept() = removed.is_err().then(Instant::now);
        removed
    }

    /// It did not do what it was asked: removing anything is tried again later.
    pub(crate) fn has_failed(&self) {
        *self.kept() = Some(Instant::now());
    }

    /// Whether trying to remove an object is likely to take time for nothing.
    pub(crate) fn removes_nothing(&self) -> bool {
        self.kept().is_some_and(|kept| kept.elapsed() < REMOVE_AGAIN_AFTER)
    }

    fn kept(&self) -> MutexGuard<'_, Option<Instant>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

async fn within<T>(asked: impl Future<Output = Result<T>>) -> Result<T> {
    let answer = tokio::time::timeout(SMALL_AT_MOST, asked).await;
    answer
        .unwrap_or_else(|_| Err(StoreError::unavailable("the object store of large programs does not answer in time")))
}

/// What it means that a range could not be read: it may be that there is none.
async fn lost(opened: &Opened, name: &ObjectName, end: u64, error: &object_store::Error) -> StoreError {
    if let object_store::Error::NotFound { .. } = error {
        return match opened.is_marked().await {
            Ok(true) => other(name, "is not there any more"),
            _ => StoreError::unavailable_by(MISSING, Fault::of(error)),
        };
    }
    match opened.store.head(&opened.path(&name.key)).await {
        Ok(there) if there.size < end => other(name, "is shorter than it was written"),
        _ => fault(error),
    }
}

fn other(name: &ObjectName, what: &str) -> StoreError {
    StoreError::corrupt(format!("the object {} at {} {what}", name.key, name.place))
}

/// An object that is being written. It appears as a whole or not at all.
pub(crate) struct Writer<'a> {
    name: ObjectName,
    store: Arc<dyn ObjectStore>,
    path: Path,
    /// `None` as long as everything fits into one part.
    upload: Option<Box<dyn MultipartUpload>>,
    part: Vec<u8>,
    pieces: Vec<Piece>,
    bytes: u64,
    _turn: SemaphorePermit<'a>,
}

impl Writer<'_> {
    /// Appends the next chunk.
    pub(crate) async fn push(&mut self, source_bytes: i64, packed: Vec<u8>) -> Result<()> {
        let (sha256, packed) =
            offload(packed.len(), move || Ok((<[u8; 32]>::from(Sha256::digest(&packed)), packed))).await?;
        let signed = |number: u64| i64::try_from(number).unwrap_or(i64::MAX);
        self.pieces.push(Piece {
            index: signed(self.pieces.len() as u64),
            source_bytes,
            object_offset: signed(self.bytes),
            object_bytes: signed(packed.len() as u64),
            sha256,
        });
        self.bytes += packed.len() as u64;
        self.part.extend_from_slice(&packed);
        if self.part.len() >= PART_BYTES { self.send_part().await } else { Ok(()) }
    }

    async fn send_part(&mut self) -> Result<()> {
        let part = std::mem::take(&mut self.part);
        if self.upload.is_none() {
            self.upload = Some(self.store.put_multipart(&self.path).await.map_err(|error| fault(&error))?);
        }
        let Some(upload) = &mut self.upload else { return Ok(()) };
        upload.put_part(part.into()).await.map_err(|error| fault(&error))
    }

    /// Writes what is left, and makes sure that all of it is there.
    pub(crate) async fn finish(mut self) -> Result<Written> {
        if self.upload.is_some() && !self.part.is_empty() {
            self.send_part().await?;
        }
        match &mut self.upload {
            Some(upload) => upload.complete().await.map_err(|error| fault(&error))?,
            None => {
                let whole = std::mem::take(&mut self.part);
                self.store.put(&self.path, whole.into()).await.map_err(|error| fault(&error))?
            }
        };
        let there = self.store.head(&self.path).await.map_err(|error| fault(&error))?;
        if there.size != self.bytes {
            return Err(other(&self.name, "has another length than was written"));
        }
        let bytes = i64::try_from(self.bytes).unwrap_or(i64::MAX);
        Ok(Written { name: self.name, bytes, pieces: self.pieces })
    }

    /// Gives it up: what was sent of it takes no place any more, if the object store answers.
    pub(crate) async fn abort(mut self) {
        if let Some(upload) = &mut self.upload
            && let Err(error) = upload.abort().await
        {
            tracing::warn!(error = %Fault::of(&error), "what was sent of an object stays in the object store");
        }
    }
}

/// The environment's settings of a client, by their names without regard to case.
fn environment(prefix: &str) -> impl Iterator<Item = (String, String)> {
    std::env::vars_os().filter_map(move |(name, value)| {
        let (name, value) = (name.into_string().ok()?, value.into_string().ok()?);
        name.starts_with(prefix).then(|| (name.to_ascii_lowercase(), value))
    })
}

fn open(uri: &ObjectsUri) -> Result<Opened, object_store::Error> {
    // Of several providers that other crates may bring along TLS takes the one of this program; set already is as well.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let mut url = uri.url().clone();
    url.set_query(None);
    let (scheme, prefix) = ObjectStoreScheme::parse(&url)?;
    if let Some(folder) = uri.folder() {
        let store = LocalFileSystem::new_with_prefix(&folder)?.with_fsync(true);
        return Ok(Opened { store: Arc::new(store), prefix: Path::default(), folder: Some(folder) });
    }
    let retry = RetryConfig {
        backoff: BackoffConfig {
            init_backoff: Duration::from_millis(100),
            max_backoff: Duration::from_secs(2),
            ..BackoffConfig::default()
        },
        max_retries: 4,
        retry_timeout: RETRY_AT_MOST,
    };
    let client = ClientOptions::new().with_timeout(REQUEST_AT_MOST).with_connect_timeout(CONNECT_AT_MOST);
    let options: Vec<(String, String)> = uri.url().query_pairs().into_owned().collect();
    macro_rules! built {
        ($builder:ty, $variables:literal) => {{
            let builder = <$builder>::new().with_client_options(client).with_retry(retry).with_url(url.as_str());
            // Not every object store that speaks the protocol of S3 deletes several at once.
            let one_by_one = [("disable_bulk_delete".to_owned(), "true".to_owned())];
            let settings = one_by_one.into_iter().chain(environment($variables)).chain(options);
            let builder = settings.fold(builder, |builder, (key, value)| match key.parse() {
                Ok(key) => builder.with_config(key, value),
                Err(_) => builder,
            });
            Arc::new(builder.build()?) as Arc<dyn ObjectStore>
        }};
    }
    let store = match scheme {
        ObjectStoreScheme::AmazonS3 => built!(AmazonS3Builder, "AWS_"),
        ObjectStoreScheme::MicrosoftAzure => built!(MicrosoftAzureBuilder, "AZURE_"),
        ObjectStoreScheme::GoogleCloudStorage => built!(GoogleCloudStorageBuilder, "GOOGLE_"),
        other => {
            let source = format!("there is no object store of the kind {other:?}").into();
            return Err(object_store::Error::Generic { store: "none", source });
        }
    };
    Ok(Opened { store, prefix, folder: None })
}
