//! The threads of those who look on: HTTP, the MTConnect agent and MQTT.
//!
//! Five hundred pages that learn of a change at the same time are five hundred tasks at once. In one queue with the runs,
//! the decisions that come next would wait behind all of them. On threads of their own, with a lower priority, they wait
//! themselves.

use std::io;

use tokio::runtime::{Builder, Handle, Runtime};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// How much these threads give way (`nice`): about a tenth of the weight of the others where the processor is contended.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 10;

/// What is asked for holds a thread while it is computed, as on the threads of calls; how many there may be is bounded
/// by the configuration.
const MAX_BLOCKING_THREADS: usize = 16_384;

/// A runtime beside the one that serves machines. What still runs there ends when this is dropped.
#[derive(Debug)]
pub(super) struct Onlookers {
    handle: Handle,
    /// There until this is dropped.
    runtime: Option<Runtime>,
    stop: CancellationToken,
}

impl Onlookers {
    /// # Errors
    /// Where the system gives no threads.
    pub(super) fn start() -> io::Result<Self> {
        let runtime = Builder::new_multi_thread()
            .enable_all()
            .thread_name("feedwave-look")
            .max_blocking_threads(MAX_BLOCKING_THREADS)
            .on_thread_start(give_way)
            .build()?;
        Ok(Self { handle: runtime.handle().clone(), runtime: Some(runtime), stop: CancellationToken::new() })
    }

    /// Cancelled when the tasks there are to end in order.
    pub(super) const fn stop(&self) -> &CancellationToken {
        &self.stop
    }

    /// Starts a task there.
    pub(super) fn spawn<T: Send + 'static>(&self, task: impl Future<Output = T> + Send + 'static) -> JoinHandle<T> {
        self.handle.spawn(task)
    }
}

impl Drop for Onlookers {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            // Waiting for its threads is not for the task that ends a server.
            runtime.shutdown_background();
        }
    }
}

/// Lowers the priority of the calling thread.
fn give_way() {
    // Elsewhere it is that of the whole process.
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(NICENESS) {
        tracing::debug!(%error, "a thread for those who look on has the priority of all others");
    }
}
