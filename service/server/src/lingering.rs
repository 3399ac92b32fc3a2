//! Connections that are closed only after the client has read everything.
//!
//! A socket that is closed while bytes of the other side lie unread is reset, and what the other side had not read by
//! then may be lost to it: on a drain that is the status that says why its stream ends, because a reader that catches
//! up is sending window updates at that very moment. So a connection that has been shut down reads on, into nothing,
//! until the other side closes too or the time is over.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::{Instant, Sleep, sleep};

/// A TCP connection that waits for the other side's close after its own shutdown.
pub(crate) struct Lingering {
    stream: TcpStream,
    timeout: Duration,
    /// Set once the sending side is shut down.
    until: Option<Pin<Box<Sleep>>>,
}

impl Lingering {
    /// A connection whose other side may take as long as `timeout` to close once everything has been sent.
    pub(crate) const fn new(stream: TcpStream, timeout: Duration) -> Self {
        Self { stream, timeout, until: None }
    }
}

impl AsyncRead for Lingering {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(cx, buf)
    }
}

impl AsyncWrite for Lingering {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(cx, buf)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let Self { stream, timeout, until } = &mut *self;
        let until = match until {
            Some(until) => until,
            None => {
                ready!(Pin::new(&mut *stream).poll_shutdown(cx))?;
                until.insert(Box::pin(sleep(*timeout)))
            }
        };
        // A sender that never stops is not waited for either.
        while until.deadline() > Instant::now() {
            let mut scratch = [0; 4096];
            let mut unread = ReadBuf::new(&mut scratch);
            match Pin::new(&mut *stream).poll_read(cx, &mut unread) {
                Poll::Ready(Ok(())) if !unread.filled().is_empty() => {}
                // Closed by the other side, in order or not: no reader is left.
                Poll::Ready(_) => return Poll::Ready(Ok(())),
                Poll::Pending => return until.as_mut().poll(cx).map(Ok),
            }
        }
        Poll::Ready(Ok(()))
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bufs: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(cx, bufs)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::TcpListener;

    use super::*;

    const TIMEOUT: Duration = Duration::from_secs(600);

    async fn pair() -> (Lingering, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let client = TcpStream::connect(listener.local_addr().unwrap()).await.unwrap();
        (Lingering::new(listener.accept().await.unwrap().0, TIMEOUT), client)
    }

    #[tokio::test]
    async fn the_last_words_reach_a_client_that_is_still_sending() {
        let (mut server, mut client) = pair().await;
        client.write_all(b"unread").await.unwrap();
        server.write_all(b"farewell").await.unwrap();
        let closing = tokio::spawn(async move { server.shutdown().await });
        // A plain socket is reset by the first of these, and the second fails.
        for _ in 0..2 {
            client.write_all(b"more").await.unwrap();
            tokio::task::yield_now().await;
        }
        let mut heard = String::new();
        client.read_to_string(&mut heard).await.unwrap();
        assert_eq!(heard, "farewell");
        drop(client);
        closing.await.unwrap().unwrap();
    }

    #[tokio::test(start_paused = true)]
    async fn a_client_that_never_closes_is_not_waited_for() {
        let (mut server, _client) = pair().await;
        let start = Instant::now();
        server.shutdown().await.unwrap();
        assert!(start.elapsed() >= TIMEOUT, "{:?}", start.elapsed());
    }
}
