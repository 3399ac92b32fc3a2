//! Bytes as a configuration and its telemetry, as the fuzz target `telemetry` has them.

use proptest::prelude::*;

use crate::common::any_bytes::check;

/// Mostly the bytes of what is common: of others alone nearly every configuration would be refused.
fn input() -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(prop_oneof![99 => 0..240_u8, 1 => any::<u8>()], 0..4_096)
}

proptest! {
    #[test]
    fn any_telemetry_is_decided_on_or_refused(input in input()) {
        check(&input);
    }

    #[test]
    fn any_configuration_is_refused_with_reasons_or_runs(input in prop::collection::vec(any::<u8>(), 0..1_024)) {
        check(&input);
    }
}
