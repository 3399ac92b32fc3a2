//! Tasks that let every other thread go first.

use std::pin::Pin;
use std::task::{Context, Poll};

/// A task that offers its processor to the other threads whenever it goes on.
///
/// The system lets a thread that has begun go on for a millisecond or more, whatever its priority. Where hundreds of short
/// tasks become ready at once, such a thread holds up the decision that is to come next for as long; offered after each of
/// them, it waits for one.
pub(crate) struct GivingWay<F>(pub(crate) F);

impl<F: Future + Unpin> Future for GivingWay<F> {
    type Output = F::Output;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<F::Output> {
        std::thread::yield_now();
        Pin::new(&mut self.0).poll(context)
    }
}
