//! What the log says of calls that failed: refusals, which any stranger can have as many of as it likes, at most so often.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tonic::Code;
use tower_http::classify::GrpcFailureClass;
use tower_http::trace::OnFailure;
use tracing::Span;

/// Least time from one line about refusals of a kind to the next.
const PERIOD: Duration = Duration::from_secs(10);

/// Writes failures of calls into the log. Clones count together.
#[derive(Clone, Debug, Default)]
pub(super) struct Failures {
    refusals: Arc<Mutex<HashMap<i32, Refusals>>>,
}

/// Refusals of one kind.
#[derive(Clone, Copy, Debug)]
struct Refusals {
    /// When the last line about them was written.
    told: Instant,
    /// How many there were since.
    untold: u64,
}

impl Failures {
    /// How many refusals of a kind were passed over since the last line, where there is to be one about this one; `None` where it is
    /// passed over as well. What is no refusal has a line each.
    fn untold(&self, code: i32, now: Instant) -> Option<u64> {
        let refusals = [Code::ResourceExhausted, Code::Unavailable, Code::Unauthenticated, Code::PermissionDenied];
        if !refusals.contains(&Code::from_i32(code)) {
            return Some(0);
        }
        let mut refusals = self.refusals.lock().unwrap_or_else(PoisonError::into_inner);
        match refusals.get_mut(&code) {
            Some(refusals) if now.duration_since(refusals.told) < PERIOD => {
                refusals.untold += 1;
                None
            }
            _ => {
                let former = refusals.insert(code, Refusals { told: now, untold: 0 });
                Some(former.map_or(0, |former| former.untold))
            }
        }
    }
}

impl OnFailure<GrpcFailureClass> for Failures {
    fn on_failure(&mut self, failure: GrpcFailureClass, latency: Duration, _span: &Span) {
        let code = match &failure {
            GrpcFailureClass::Status(status) => status.code_raw(),
            _ => Code::Unknown.into(),
        };
        if let Some(untold) = self.untold(code, Instant::now()) {
            let latency = format!("{} ms", latency.as_millis());
            tracing::warn!(classification = %failure, latency, further = untold, "response failed");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_of_a_kind_have_a_line_in_ten_seconds_with_their_number() {
        let (failures, start) = (Failures::default(), Instant::now());
        let (unknown, denied) = (Code::Unauthenticated.into(), Code::PermissionDenied.into());
        let at = |seconds| start + Duration::from_secs(seconds);
        assert_eq!(failures.untold(unknown, at(0)), Some(0));
        assert!((0..1_000).all(|_| failures.clone().untold(unknown, at(9)).is_none()));
        assert_eq!(failures.untold(denied, at(9)), Some(0), "another kind is told");
        assert_eq!(failures.untold(unknown, at(10)), Some(1_000));
        assert_eq!(failures.untold(unknown, at(20)), Some(0));
        for _ in 0..3 {
            assert_eq!(failures.untold(Code::Internal.into(), at(20)), Some(0), "a fault has a line each");
        }
    }
}
