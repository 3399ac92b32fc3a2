//! The end of a response stream: its deadline, the end of the service, and the end of its job reach the client as
//! the stream's status, at once and whatever the stream itself is doing.

use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use futures_util::Stream;
use http::HeaderMap;
use tokio::time::{Instant, Sleep};
use tokio_util::sync::CancellationToken;
use tonic::Status;

use crate::cut_off::CutOff;
use crate::error::Error;

/// A cause to end a stream, and the status of the client.
type Cause = (Pin<Box<dyn Future<Output = ()> + Send>>, Error);

/// A stream that ends with a status when one of its causes comes true. The inner stream is dropped then.
pub(super) struct Guarded<S> {
    inner: Option<S>,
    deadline: Option<Pin<Box<Sleep>>>,
    causes: Vec<Cause>,
}

impl<S> Guarded<S> {
    pub(super) fn new(inner: S, deadline: Option<Instant>) -> Self {
        let deadline = deadline.map(|deadline| Box::pin(tokio::time::sleep_until(deadline)));
        Self { inner: Some(inner), deadline, causes: Vec::new() }
    }

    pub(super) fn ends_with(self, token: &CancellationToken, error: Error) -> Self {
        self.ends_once(token.clone().cancelled_owned(), error)
    }

    /// For what cannot go on without the database.
    pub(super) fn ends_when_cut_off(self, cut_off: &CutOff) -> Self {
        self.ends_once(cut_off.begun(), Error::CutOff)
    }

    fn ends_once(mut self, cause: impl Future<Output = ()> + Send + 'static, error: Error) -> Self {
        self.causes.push((Box::pin(cause), error));
        self
    }

    fn poll_end(&mut self, cx: &mut Context<'_>) -> Option<Error> {
        if let Some(deadline) = &mut self.deadline
            && deadline.as_mut().poll(cx).is_ready()
        {
            return Some(Error::DeadlineExceeded);
        }
        self.causes.iter_mut().find_map(|(cause, error)| cause.as_mut().poll(cx).is_ready().then(|| error.clone()))
    }
}

impl<S, T> Stream for Guarded<S>
where
    S: Stream<Item = Result<T, Error>> + Unpin,
{
    type Item = Result<T, Status>;

    fn poll_next(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        if self.inner.is_none() {
            return Poll::Ready(None);
        }
        if let Some(error) = self.poll_end(cx) {
            self.inner = None;
            return Poll::Ready(Some(Err(error.into())));
        }
        match self.inner.as_mut().map(|inner| Pin::new(inner).poll_next(cx)) {
            Some(Poll::Ready(Some(item))) => Poll::Ready(Some(item.map_err(Status::from))),
            Some(Poll::Pending) => Poll::Pending,
            Some(Poll::Ready(None)) | None => {
                self.inner = None;
                Poll::Ready(None)
            }
        }
    }
}

/// The deadline that a call carries in `grpc-timeout`: up to eight digits and a unit.
pub(crate) fn deadline(headers: &HeaderMap) -> Option<Instant> {
    let timeout = headers.get("grpc-timeout")?.to_str().ok()?;
    let (digits, unit) = timeout.split_at_checked(timeout.len().checked_sub(1)?)?;
    if digits.is_empty() || digits.len() > 8 || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let value: u64 = digits.parse().ok()?;
    let timeout = match unit {
        "H" => Duration::from_secs(value * 3_600),
        "M" => Duration::from_secs(value * 60),
        "S" => Duration::from_secs(value),
        "m" => Duration::from_millis(value),
        "u" => Duration::from_micros(value),
        "n" => Duration::from_nanos(value),
        _ => return None,
    };
    Instant::now().checked_add(timeout)
}

#[cfg(test)]
mod tests {
    use futures_util::StreamExt as _;

    use super::*;

    fn endless() -> impl Stream<Item = Result<u32, Error>> + Unpin {
        futures_util::stream::repeat_with(|| Ok(1))
    }

    #[tokio::test]
    async fn a_cause_ends_the_stream_with_its_status_once() {
        let token = CancellationToken::new();
        let mut stream = Guarded::new(endless(), None).ends_with(&token, Error::Draining);
        assert!(matches!(stream.next().await, Some(Ok(1))));
        token.cancel();
        assert_eq!(stream.next().await.unwrap().unwrap_err().code(), tonic::Code::Unavailable);
        assert!(stream.next().await.is_none());
    }

    #[tokio::test(start_paused = true)]
    async fn the_deadline_ends_a_stream_that_waits() {
        let waiting = futures_util::stream::pending::<Result<u32, Error>>();
        let mut stream = Guarded::new(waiting, Some(Instant::now() + Duration::from_secs(5)));
        assert_eq!(stream.next().await.unwrap().unwrap_err().code(), tonic::Code::DeadlineExceeded);
    }

    #[tokio::test(start_paused = true)]
    async fn timeouts_are_read_in_every_unit() {
        let now = Instant::now();
        let cases = [
            ("2H", 7_200_000_000_000),
            ("3M", 180_000_000_000),
            ("4S", 4_000_000_000),
            ("5m", 5_000_000),
            ("6u", 6_000),
            ("7n", 7),
        ];
        for (text, nanos) in cases {
            let mut headers = HeaderMap::new();
            headers.insert("grpc-timeout", text.parse().unwrap());
            assert_eq!(deadline(&headers), Some(now + Duration::from_nanos(nanos)), "{text}");
        }
        for text in ["", "S", "5", "123456789S", "-1S", "1s"] {
            let mut headers = HeaderMap::new();
            headers.insert("grpc-timeout", text.parse().unwrap());
            assert_eq!(deadline(&headers), None, "{text}");
        }
    }
}
