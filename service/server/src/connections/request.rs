//! The body of a call on its way in: its bytes are counted while they are held in memory, and it may not pause for ever.

use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use bytes::Bytes;
use feedwave_contract::codec::Account;
use http_body::{Frame, SizeHint};
use tokio::time::{Sleep, sleep};
use tonic::Status;
use tonic::body::Body;

use super::clients::{ClientKey, Clients, RequestBytes};
use crate::error::Error;

/// Largest factor by which the compression of gRPC's messages (DEFLATE) shrinks what it is given.
const MAX_COMPRESSION: u64 = 1_032;

/// What a request holds of memory; shared by its body, by what decodes it and by the call, which may need it to its end.
#[derive(Clone, Debug)]
pub(crate) struct RequestMemory {
    /// As it came.
    received: Arc<Mutex<RequestBytes>>,
    /// Its newest message, decoded.
    decoded: Arc<Mutex<RequestBytes>>,
}

impl RequestMemory {
    /// Of a request that one client sends.
    pub(crate) fn new(clients: &Arc<Clients>, client: &ClientKey) -> Self {
        let account = || Arc::new(Mutex::new(clients.request_bytes(client)));
        Self { received: account(), decoded: account() }
    }

    /// The account of what the next message takes once it is decoded. Of those before it only the newest is still there.
    pub(crate) fn account(&self) -> Account {
        let decoded = self.decoded.clone();
        Arc::new(move |bytes| Ok(lock(&decoded).replace(bytes)?))
    }

    fn receive(&self, bytes: u64) -> Result<(), Error> {
        lock(&self.received).take(bytes)
    }

    fn give_back(&self) {
        lock(&self.received).give_back();
        lock(&self.decoded).give_back();
    }
}

fn lock(account: &Mutex<RequestBytes>) -> MutexGuard<'_, RequestBytes> {
    // Numbers are added and taken away in one go, so a poisoned account is right.
    account.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The body of a call.
pub(crate) struct RequestBody {
    inner: Body,
    messages: Messages,
    /// Largest message, bytes: none is held that has more.
    message_bytes: u64,
    held: RequestMemory,
    /// Whether a message is done with when the next one is asked for; else with the call.
    has_many: bool,
    /// Longest pause, where there is one.
    pause: Option<Duration>,
    pausing: Option<Pin<Box<Sleep>>>,
}

impl RequestBody {
    /// A body whose bytes are held by `held`, of a stream of messages where `has_many`, with pauses no longer than `pause`.
    pub(crate) fn new(
        inner: Body,
        held: RequestMemory,
        message_bytes: usize,
        has_many: bool,
        pause: Option<Duration>,
    ) -> Self {
        let message_bytes = message_bytes as u64;
        Self { inner, messages: Messages::default(), message_bytes, held, has_many, pause, pausing: None }
    }

    /// Counts what has come.
    fn receive(&mut self, data: &[u8]) -> Result<(), Error> {
        let bytes = self.messages.receive(data, self.message_bytes);
        self.held.receive(bytes)
    }
}

impl http_body::Body for RequestBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        // More is asked for once every whole message has been handed on.
        if self.has_many && self.messages.is_between() {
            self.held.give_back();
        }
        match Pin::new(&mut self.inner).poll_frame(cx) {
            Poll::Ready(Some(Ok(frame))) => {
                self.pausing = None;
                if let Some(data) = frame.data_ref() {
                    // Cheap: the bytes are shared.
                    let data = data.clone();
                    if let Err(error) = self.receive(&data) {
                        return Poll::Ready(Some(Err(error.into())));
                    }
                }
                Poll::Ready(Some(Ok(frame)))
            }
            Poll::Pending => {
                let Some(pause) = self.pause else { return Poll::Pending };
                let pausing = self.pausing.get_or_insert_with(|| Box::pin(sleep(pause)));
                match pausing.as_mut().poll(cx) {
                    Poll::Ready(()) => {
                        Poll::Ready(Some(Err(Error::RequestStalled { seconds: pause.as_secs() }.into())))
                    }
                    Poll::Pending => Poll::Pending,
                }
            }
            other => other,
        }
    }

    fn is_end_stream(&self) -> bool {
        self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.inner.size_hint()
    }
}

/// Where one message of gRPC ends and the next begins: a flag of compression, four bytes of length, the message.
#[derive(Debug, Default)]
struct Messages {
    head: [u8; 5],
    /// Bytes of the head that have come.
    head_bytes: usize,
    /// Bytes of the message that have not come yet.
    rest: u64,
}

impl Messages {
    /// Whether every message that has begun is complete.
    const fn is_between(&self) -> bool {
        self.head_bytes == 0 && self.rest == 0
    }

    /// The most memory that these bytes take: they themselves, and what their messages may become uncompressed.
    fn receive(&mut self, mut data: &[u8], message_bytes: u64) -> u64 {
        let mut bytes = data.len() as u64;
        while !data.is_empty() {
            if self.rest > 0 {
                let taken = self.rest.min(data.len() as u64);
                self.rest -= taken;
                // At most the length of a slice.
                data = &data[taken as usize..];
                continue;
            }
            let taken = (self.head.len() - self.head_bytes).min(data.len());
            self.head[self.head_bytes..self.head_bytes + taken].copy_from_slice(&data[..taken]);
            self.head_bytes += taken;
            data = &data[taken..];
            if self.head_bytes == self.head.len() {
                self.head_bytes = 0;
                let [compressed, length @ ..] = self.head;
                self.rest = u64::from(u32::from_be_bytes(length));
                if compressed != 0 {
                    bytes += (self.rest * MAX_COMPRESSION).min(message_bytes);
                }
            }
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn message(compressed: bool, length: u32) -> Vec<u8> {
        let mut bytes = vec![u8::from(compressed)];
        bytes.extend(length.to_be_bytes());
        bytes.resize(bytes.len() + length as usize, 7);
        bytes
    }

    #[test]
    fn a_compressed_message_counts_for_what_it_may_become() {
        assert_eq!(Messages::default().receive(&message(true, 10), 1 << 20), 15 + 10_320);
        assert_eq!(Messages::default().receive(&message(true, 10_000), 1 << 20), 10_005 + (1 << 20));
        assert_eq!(Messages::default().receive(&message(false, 10_000), 1 << 20), 10_005);
    }

    proptest! {
        #[test]
        fn messages_end_where_they_end_however_they_are_cut(
            lengths in prop::collection::vec(0_u32..40, 0..8),
            cuts in prop::collection::vec(1_usize..9, 1..200),
        ) {
            let mut messages = Messages::default();
            let mut counted = 0;
            let mut cuts = cuts.into_iter().cycle();
            for length in &lengths {
                let bytes = message(false, *length);
                let mut rest = bytes.as_slice();
                while !rest.is_empty() {
                    let (piece, after) = rest.split_at(cuts.next().unwrap_or(1).min(rest.len()));
                    counted += messages.receive(piece, 100);
                    rest = after;
                    prop_assert_eq!(messages.is_between(), rest.is_empty());
                }
            }
            let sent: u64 = lengths.iter().map(|length| u64::from(*length) + 5).sum();
            prop_assert_eq!(counted, sent);
        }
    }
}
