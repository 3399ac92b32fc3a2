//! Bytes as a configuration and its telemetry: see `any_bytes`.

#![no_main]

#[path = "../../service/monitoring/tests/common/any_bytes.rs"]
mod any_bytes;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: &[u8]| {
    any_bytes::check(input);
});
