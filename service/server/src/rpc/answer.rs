//! The body of an answer: counted to its end, ended by a panic or when nobody reads it, and its call with it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};

use bytes::Bytes;
use http::HeaderMap;
use http_body::{Body as _, Frame, SizeHint};
use tokio::time::Instant;
use tonic::Status;
use tonic::body::Body;

use super::Call;
use crate::connections::Unread;
use crate::error::Error;

/// The body of an answer.
pub(super) struct AnswerBody(Arc<Answer>);

/// What the connection and whoever watches over it share.
pub(super) struct Answer(Mutex<State>);

/// An answer as far as it has come.
struct State {
    /// The rest, with its call; `None` once it is over.
    rest: Option<(Body, Call)>,
    /// When the last frame was handed over, while the next one has not been asked for.
    waiting_since: Option<Instant>,
    /// The last words of an answer that was ended.
    farewell: Option<HeaderMap>,
}

impl AnswerBody {
    /// The body of an answer to a call.
    pub(super) fn new(body: Body, call: Call) -> Self {
        Self(Arc::new(Answer(Mutex::new(State { rest: Some((body, call)), waiting_since: None, farewell: None }))))
    }

    /// What can be ended from outside.
    pub(super) fn answer(&self) -> Arc<Answer> {
        self.0.clone()
    }
}

impl Answer {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Ends the answer with an error: what it was made of is dropped, and the error is the next thing to be read.
    fn end(&mut self, error: Error) {
        let Some((_, mut call)) = self.rest.take() else { return };
        let mut trailers = HeaderMap::new();
        // It fails only for texts that are no header values, and these are encoded.
        let _ = Status::from(error).add_header(&mut trailers);
        call.see(&mut trailers);
        self.farewell = Some(trailers);
    }

    fn poll(&mut self, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        self.waiting_since = None;
        if let Some((body, call)) = &mut self.rest {
            let polled = catch_unwind(AssertUnwindSafe(|| Pin::new(body).poll_frame(cx)));
            match polled {
                Ok(mut polled) => {
                    if let Poll::Ready(Some(Ok(frame))) = &mut polled {
                        call.sent(frame);
                        self.waiting_since = Some(Instant::now());
                    }
                    return polled;
                }
                Err(_) => {
                    let error = call.panicked();
                    self.end(error);
                }
            }
        }
        Poll::Ready(self.farewell.take().map(|trailers| Ok(Frame::trailers(trailers))))
    }
}

impl http_body::Body for AnswerBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        self.0.state().poll(cx)
    }

    fn is_end_stream(&self) -> bool {
        let state = self.0.state();
        state.farewell.is_none() && state.rest.as_ref().is_none_or(|(body, _)| body.is_end_stream())
    }

    fn size_hint(&self) -> SizeHint {
        self.0.state().rest.as_ref().map(|(body, _)| body.size_hint()).unwrap_or_default()
    }
}

impl Unread for Answer {
    fn end_if_unread(&self, since: Instant) {
        let mut state = self.state();
        if let (Some(waiting), Some((_, call))) = (state.waiting_since, &state.rest)
            && waiting <= since
        {
            let error = call.unread();
            state.end(error);
        }
    }
}
