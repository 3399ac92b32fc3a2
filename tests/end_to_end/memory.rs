//! Memory does not grow with the program. The measurement `memory` shows the same with 1 GB.

use std::path::Path;

use feedwave_tests::measure_memory;

use crate::FEEDWAVE;

#[tokio::test]
async fn a_program_of_16_mb_streams_under_100_mb_resident() {
    let used = measure_memory(Path::new(FEEDWAVE), 16_000_000).await;
    assert!(used.setpoints > 100_000, "{used:?}");
    assert!(used.streamed_bytes < 100_000_000, "{used:?}");
}
