//! One connection: who is at its other end, what is open on it, and when it has been idle for too long.

use std::io;
use std::net::IpAddr;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::Instant;

use super::clients::{ClientKey, Clients};
use super::frames::{Frames, Partial};
use super::tls::PeerCertificate;

/// The first bytes of a connection of HTTP/2.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// An answer that can be ended from outside when nobody reads it.
pub(crate) trait Unread: Send + Sync {
    /// Ends the answer if it has been waiting for its reader since `since` or longer.
    fn end_if_unread(&self, since: Instant);
}

/// A connection. What is asked over it has it among the extensions of the request.
pub(crate) struct Connection {
    address: IpAddr,
    client: ClientKey,
    certificate: Option<PeerCertificate>,
    clients: Arc<Clients>,
    open: Mutex<Open>,
}

impl std::fmt::Debug for Connection {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Connection").field("client", &self.client).finish_non_exhaustive()
    }
}

struct Open {
    /// Calls in progress.
    calls: usize,
    /// When the last call ended; when the connection was made.
    idle_since: Instant,
    /// When the head of a request was begun that is not complete, or the connection was made and has not said anything.
    partial_since: Option<Instant>,
    /// What was begun on a connection of HTTP/2 and is not complete, and since when.
    partial_frame: Option<(Partial, Instant)>,
    answers: Vec<Weak<dyn Unread>>,
}

/// What a connection's time says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Due {
    /// To look again then.
    Later(Instant),
    /// To close it at once: the head of a request does not come.
    Cut,
    /// To close it in order: there has been no call for too long.
    Close,
}

impl Connection {
    pub(super) fn new(
        address: IpAddr,
        client: ClientKey,
        certificate: Option<PeerCertificate>,
        clients: Arc<Clients>,
    ) -> Arc<Self> {
        let now = Instant::now();
        let open =
            Open { calls: 0, idle_since: now, partial_since: Some(now), partial_frame: None, answers: Vec::new() };
        Arc::new(Self { address: address.to_canonical(), client, certificate, clients, open: Mutex::new(open) })
    }

    /// The address at its other end.
    pub(crate) const fn address(&self) -> IpAddr {
        self.address
    }

    /// The client that what happens on the connection is counted for.
    pub(crate) const fn client(&self) -> &ClientKey {
        &self.client
    }

    /// The certificate that the other side has proved to have.
    pub(crate) const fn certificate(&self) -> Option<&PeerCertificate> {
        self.certificate.as_ref()
    }

    /// The account of all clients.
    pub(crate) const fn clients(&self) -> &Arc<Clients> {
        &self.clients
    }

    fn open(&self) -> MutexGuard<'_, Open> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A call that begins; it is over when what is returned is dropped.
    pub(crate) fn begin_call(self: &Arc<Self>) -> OpenCall {
        let mut open = self.open();
        open.calls += 1;
        open.partial_since = None;
        OpenCall(self.clone())
    }

    /// Has an answer ended that nobody reads.
    pub(crate) fn watch(&self, answer: Weak<dyn Unread>) {
        let mut open = self.open();
        if open.answers.len() == open.answers.capacity() {
            open.answers.retain(|answer| answer.strong_count() > 0);
        }
        open.answers.push(answer);
    }

    /// Bytes have come; `is_http2` once they are known to be of that version, whose other frames are no requests.
    fn received(&self, is_http2: bool) {
        let mut open = self.open();
        if is_http2 {
            // From here on its frames say what is incomplete.
            open.partial_since = None;
        } else if open.calls == 0 && open.partial_since.is_none() {
            open.partial_since = Some(Instant::now());
        }
    }

    /// Frames of HTTP/2 have come, after which this is incomplete; `begun` where it was complete in between. Data may come slowly: their
    /// time is that since the last of them.
    fn received_frames(&self, partial: Option<Partial>, begun: bool) {
        let mut open = self.open();
        open.partial_frame = partial.map(|partial| match open.partial_frame {
            Some((_, since)) if !begun && partial != Partial::Data => (partial, since),
            _ => (partial, Instant::now()),
        });
    }

    /// What there is to do now.
    pub(super) fn due(&self, now: Instant) -> Due {
        let limits = self.clients.limits();
        self.end_unread(now);
        let open = self.open();
        let mut next = now + look_again(limits.unread_timeout().min(limits.idle_timeout()));
        // While calls go on a network may stall in the middle of any frame, but a head holds up all that comes behind it, and data
        // do not stall for longer than any part of a request may.
        let until = open.partial_frame.and_then(|(partial, since)| match partial {
            Partial::Data if open.calls > 0 => Some(since + limits.request_timeout()),
            Partial::Frame if open.calls > 0 => None,
            _ => Some(since + limits.header_timeout()),
        });
        if let Some(until) = until {
            if until <= now {
                return Due::Cut;
            }
            next = next.min(until);
        }
        if open.calls > 0 {
            return Due::Later(next);
        }
        if let Some(since) = open.partial_since {
            let until = since + limits.header_timeout();
            if until <= now {
                return Due::Cut;
            }
            next = next.min(until);
        }
        let until = open.idle_since + limits.idle_timeout();
        if until <= now { Due::Close } else { Due::Later(next.min(until)) }
    }

    fn end_unread(&self, now: Instant) {
        let answers: Vec<_> = {
            let mut open = self.open();
            open.answers.retain(|answer| answer.strong_count() > 0);
            open.answers.iter().filter_map(Weak::upgrade).collect()
        };
        if let Some(since) = now.checked_sub(self.clients.limits().unread_timeout()) {
            answers.iter().for_each(|answer| answer.end_if_unread(since));
        }
    }
}

/// How often a time-out is looked at.
fn look_again(timeout: Duration) -> Duration {
    (timeout / 8).clamp(Duration::from_millis(50), Duration::from_secs(30))
}

/// A call in progress.
pub(crate) struct OpenCall(Arc<Connection>);

impl Drop for OpenCall {
    fn drop(&mut self) {
        let mut open = self.0.open();
        open.calls -= 1;
        open.idle_since = Instant::now();
    }
}

/// A byte stream whose connection learns when something comes.
pub(super) struct Heard<S> {
    stream: S,
    connection: Arc<Connection>,
    /// Bytes of the preface that have come; `None` once the connection is known to be of HTTP/2.
    preface: Option<usize>,
    frames: Frames,
}

impl<S> Heard<S> {
    pub(super) fn new(stream: S, connection: Arc<Connection>) -> Self {
        Self { stream, connection, preface: Some(0), frames: Frames::default() }
    }

    fn received(&mut self, bytes: &[u8]) {
        let Some(known) = self.preface else { return self.received_frames(bytes) };
        let rest = &PREFACE[known.min(PREFACE.len())..];
        let common = rest.iter().zip(bytes).take_while(|(expected, byte)| expected == byte).count();
        let is_http2 = common > 0 && known + common == PREFACE.len();
        // Beyond its end is where a connection of HTTP/1 is.
        let is_going_on = common == bytes.len();
        self.preface = if is_http2 { None } else { Some(if is_going_on { known + common } else { usize::MAX }) };
        self.connection.received(is_http2);
        if is_http2 {
            self.received_frames(&bytes[common..]);
        }
    }

    fn received_frames(&mut self, bytes: &[u8]) {
        let (before, begun) = (self.frames.partial(), self.frames.receive(bytes));
        let after = self.frames.partial();
        // The account is shared: it is touched where there is something to say.
        if before.is_some() || after.is_some() {
            self.connection.received_frames(after, begun);
        }
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Heard<S> {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let before = buf.filled().len();
        ready!(Pin::new(&mut self.stream).poll_read(cx, buf))?;
        if buf.filled().len() > before {
            self.received(&buf.filled()[before..]);
        }
        Poll::Ready(Ok(()))
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Heard<S> {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(cx, buf)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
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
    use super::*;
    use crate::config::ConnectionLimits;
    use crate::observability::metrics::Metrics;

    fn connection() -> Arc<Connection> {
        let limits = ConnectionLimits { header_timeout_s: 10, idle_timeout_s: 100, ..ConnectionLimits::default() };
        let clients = Clients::new(limits, Metrics::new().connections);
        let address = [127, 0, 0, 1].into();
        Connection::new(address, ClientKey::of_address(address), None, clients)
    }

    fn seconds(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    #[tokio::test(start_paused = true)]
    async fn who_never_asks_is_cut_off_and_who_is_silent_afterwards_is_closed() {
        let connection = connection();
        let made = Instant::now();
        assert_eq!(connection.due(made + seconds(9)), Due::Later(made + seconds(10)));
        assert_eq!(connection.due(made + seconds(10)), Due::Cut);

        let call = connection.begin_call();
        tokio::time::advance(seconds(1_000)).await;
        assert!(matches!(connection.due(Instant::now()), Due::Later(_)));
        drop(call);
        let ended = Instant::now();
        assert!(matches!(connection.due(ended + seconds(99)), Due::Later(_)));
        assert_eq!(connection.due(ended + seconds(100)), Due::Close);

        // Half a request of HTTP/1 behind a whole one.
        connection.received(false);
        assert_eq!(connection.due(ended + seconds(10)), Due::Cut);
    }

    #[tokio::test(start_paused = true)]
    async fn a_preface_in_pieces_is_known_and_anything_else_is_not() {
        for (pieces, is_http2) in [
            (vec![&PREFACE[..3], &PREFACE[3..], b"more"], true),
            (vec![b"".as_slice(), &[PREFACE, b"\0\0\0"].concat()], true),
            (vec![b"PRI /x HTTP/1.1\r\n".as_slice(), PREFACE], false),
            (vec![b"GET / HTTP/1.1\r\n".as_slice()], false),
            (vec![&PREFACE[..23]], false),
        ] {
            let mut heard = Heard::new(tokio::io::empty(), connection());
            for piece in &pieces {
                heard.received(piece);
            }
            assert_eq!(heard.preface.is_none(), is_http2, "{pieces:?}");
            assert_eq!(heard.connection.open().partial_since.is_none(), is_http2, "{pieces:?}");
            // A preface alone, and half a frame behind it, are no whole beginning.
            assert_eq!(heard.connection.open().partial_frame.is_some(), is_http2, "{pieces:?}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn half_a_head_of_http2_is_cut_off_and_pauses_within_calls_are_not() {
        let settings = [0, 0, 0, 4, 0, 0, 0, 0, 0];
        let head = |length: u8, flags: u8| [0, 0, length, 1, flags, 0, 0, 0, 1];
        let connection = connection();
        let mut heard = Heard::new(tokio::io::empty(), connection.clone());
        let due = |connection: &Connection| connection.due(Instant::now());
        heard.received(&[PREFACE, &settings[..8]].concat());
        tokio::time::advance(seconds(9)).await;
        assert!(matches!(due(&connection), Due::Later(_)));
        tokio::time::advance(seconds(1)).await;
        assert_eq!(due(&connection), Due::Cut);
        heard.received(&settings[8..]);
        assert!(matches!(due(&connection), Due::Later(_)));

        // A head whose bytes trickle in does not begin anew with each of them, nor with a frame that continues it.
        heard.received(&head(2, 0));
        for continued in [&[1_u8, 2][..], &[0, 0, 1, 9, 0, 0, 0, 0, 1], &[3]] {
            tokio::time::advance(seconds(3)).await;
            assert!(matches!(due(&connection), Due::Later(_)));
            heard.received(continued);
        }
        let call = connection.begin_call();
        tokio::time::advance(seconds(1)).await;
        assert_eq!(due(&connection), Due::Cut, "another call keeps no head open");
        heard.received(&[0, 0, 0, 9, 4, 0, 0, 0, 1]);
        assert!(matches!(due(&connection), Due::Later(_)));

        // Within a call data may stall as long as any part of a request, and come slowly; between calls nothing may.
        heard.received(&[0, 0, 200, 0, 0, 0, 0, 0, 1, 7]);
        for _ in 0..3 {
            tokio::time::advance(seconds(59)).await;
            assert!(matches!(due(&connection), Due::Later(_)));
            heard.received(&[7]);
        }
        tokio::time::advance(seconds(60)).await;
        assert_eq!(due(&connection), Due::Cut);
        heard.received(&[7]);
        drop(call);
        tokio::time::advance(seconds(9)).await;
        assert!(matches!(due(&connection), Due::Later(_)), "what is left of a body may come");
        tokio::time::advance(seconds(1)).await;
        assert_eq!(due(&connection), Due::Cut);
        heard.received(&[7; 195]);
        heard.received(&[0, 0, 8, 6]);
        tokio::time::advance(seconds(10)).await;
        assert_eq!(due(&connection), Due::Cut);
    }
}
