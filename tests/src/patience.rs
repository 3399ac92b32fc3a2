//! Waiting for what happens, however long a busy machine takes to do it.

use std::time::Duration;

use tonic::{Code, Status};

/// No wait of a test lasts longer; reached only when something is broken.
pub const PATIENCE: Duration = Duration::from_secs(600);

/// Waits, but not for ever.
///
/// # Panics
/// When nothing comes of it.
pub async fn patiently<T>(future: impl Future<Output = T>) -> T {
    tokio::time::timeout(PATIENCE, future).await.expect("nothing came of it in time")
}

/// What is opened before its deadline has passed, which is as short as the machine is quick.
///
/// # Panics
/// When opening fails for another reason, or no deadline is long enough.
pub async fn within_a_deadline<T>(mut open: impl AsyncFnMut(Duration) -> Result<T, Status>) -> T {
    let mut deadline = Duration::from_millis(200);
    loop {
        match open(deadline).await {
            Ok(opened) => return opened,
            // Said by the service, or by the client's own clock.
            Err(status) => {
                assert!(matches!(status.code(), Code::DeadlineExceeded | Code::Cancelled), "{status:?}");
                deadline *= 2;
                assert!(deadline < PATIENCE, "nothing came of it in time");
            }
        }
    }
}
