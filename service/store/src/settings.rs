//! Limits of a store, whatever its database, and what it tells about its work. What only one database knows is an
//! option of its URI.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use crate::objects::ObjectSettings;

/// Limits of a store. The defaults suit a service of one machine shop.
#[derive(Clone)]
pub struct StoreSettings {
    /// Largest program in bytes; default 2 GiB.
    pub max_program_bytes: u64,
    /// Which programs are kept in an object store, and in which one; none by default.
    pub objects: Option<ObjectSettings>,
    /// Most unfinished uploads kept at a time; default 256.
    pub max_uploads: u32,
    /// Most of these that are one client's; default 64.
    pub max_client_uploads: u32,
    /// Most bytes announced for unfinished uploads; default 16 GiB.
    pub max_uploads_bytes: u64,
    /// Most of these that one client announces; default 4 GiB.
    pub max_client_uploads_bytes: u64,
    /// How long an unfinished upload is kept to which nothing comes; default one day.
    pub upload_expiry: Duration,
    /// Largest JSON document (profile, tool, settings) in bytes; default 4 MiB.
    pub max_document_bytes: u64,
    /// Largest validation report in bytes before compression; default 64 MiB.
    pub max_report_bytes: u64,
    /// Largest snapshot of a checkpoint in bytes before compression; default 16 MiB.
    pub max_snapshot_bytes: u64,
    /// Most entries of the audit log; default one million. Beyond, the oldest ones of the tenants that have most go.
    pub max_audit_entries: u64,
    /// Writes that may wait for the writer; default 1024. Callers beyond wait for a place.
    pub write_queue: usize,
    /// Bytes of payload that waiting writes may hold in memory together; default 32 MiB. Callers
    /// beyond wait.
    pub write_queue_bytes: u64,
    /// Most writes committed by one transaction; default 256.
    pub max_commit_operations: usize,
    /// Name of this replica among those that share a database, which no other one has: what it was at when it ended it goes
    /// on with at once. Empty by default: then what it was at waits until others see that it is gone.
    pub replica_name: String,
    /// Observer of finished operations; none by default.
    pub observer: Arc<dyn Observer>,
}

impl Default for StoreSettings {
    fn default() -> Self {
        Self {
            max_program_bytes: 2 << 30,
            objects: None,
            max_uploads: 256,
            max_client_uploads: 64,
            max_uploads_bytes: 16 << 30,
            max_client_uploads_bytes: 4 << 30,
            upload_expiry: Duration::from_secs(86_400),
            max_document_bytes: 4 << 20,
            max_report_bytes: 64 << 20,
            max_snapshot_bytes: 16 << 20,
            max_audit_entries: 1_000_000,
            write_queue: 1024,
            write_queue_bytes: 32 << 20,
            max_commit_operations: 256,
            replica_name: String::new(),
            observer: Arc::new(NoObserver),
        }
    }
}

impl fmt::Debug for StoreSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StoreSettings")
            .field("max_program_bytes", &self.max_program_bytes)
            .field("objects", &self.objects)
            .field("max_uploads", &self.max_uploads)
            .field("max_client_uploads", &self.max_client_uploads)
            .field("max_uploads_bytes", &self.max_uploads_bytes)
            .field("max_client_uploads_bytes", &self.max_client_uploads_bytes)
            .field("upload_expiry", &self.upload_expiry)
            .field("max_document_bytes", &self.max_document_bytes)
            .field("max_report_bytes", &self.max_report_bytes)
            .field("max_snapshot_bytes", &self.max_snapshot_bytes)
            .field("max_audit_entries", &self.max_audit_entries)
            .field("write_queue", &self.write_queue)
            .field("write_queue_bytes", &self.write_queue_bytes)
            .field("max_commit_operations", &self.max_commit_operations)
            .field("replica_name", &self.replica_name)
            .finish_non_exhaustive()
    }
}

/// Observes finished operations; called on the store's own tasks, so it must return at once.
pub trait Observer: Send + Sync {
    /// A transaction with `operations` writes was committed; `latency` is from its begin to its
    /// durable end.
    fn write_committed(&self, operations: usize, latency: Duration) {
        let _ = (operations, latency);
    }

    /// A read finished, successfully or not, after `latency` (waiting for a reader included).
    fn read_done(&self, latency: Duration) {
        let _ = latency;
    }
}

/// Observes nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoObserver;

impl Observer for NoObserver {}

/// Counters of a store since it was opened.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct StoreStats {
    /// Writes waiting or in progress now.
    pub write_queue_depth: u64,
    /// Transactions committed.
    pub commits: u64,
    /// Writes committed by them.
    pub committed_operations: u64,
    /// Writes refused or failed.
    pub failed_operations: u64,
    /// Reads finished.
    pub reads: u64,
    /// Bytes that the database takes, free space within it included.
    pub database_bytes: u64,
}
