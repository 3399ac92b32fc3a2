//! Memory does not grow with the program. The measurement `memory` shows the same with 1 GB.

use std::path::Path;

use feedwave_tests::measure_memory;

use crate::FEEDWAVE;

#[tokio::test]
async fn a_program_of_16_mb_streams_in_a_few_megabytes_more_than_a_service_at_rest() {
    let used = measure_memory(Path::new(FEEDWAVE), 16_000_000).await;
    assert!(used.setpoints > 100_000, "{used:?}");
    // Code that is resident is not counted: a development build has much of it.
    assert!(used.streamed_bytes - used.idle_bytes < 40_000_000, "{used:?}");
}
