//! What is around every request of the HTTP port: a place, of everybody's and of the client's, and an answer where a request
//! panics.

use std::any::Any;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, header};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};
use bytes::Bytes;
use http_body::{Frame, SizeHint};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tower_http::catch_panic::ResponseForPanic;

use super::live::WatchedBody;
use super::{HttpError, HttpState};
use crate::connections::{Connection, Held, OpenCall, Resource, Unread, in_json};
use crate::error::{Error, Result};
use crate::observability::metrics::Metrics;

/// Paths that probes ask, however much there is to do.
const PROBES: [&str; 2] = ["/healthz", "/readyz"];

/// The path whose answer stays open.
const WATCH: &str = "/v1/stream";

/// Places for requests.
#[derive(Clone, Debug)]
pub(super) struct Bounds {
    metrics: Arc<Metrics>,
    places: Arc<Semaphore>,
    limit: usize,
}

/// What a request holds to the end of its answer.
#[derive(Default)]
struct Places {
    _in_all: Option<OwnedSemaphorePermit>,
    _of_client: Option<Held>,
    _of_connection: Option<OpenCall>,
}

impl Bounds {
    pub(super) fn new(state: &HttpState) -> Self {
        let limit = state.api.limits.concurrent_requests;
        Self { metrics: state.api.metrics.clone(), places: Arc::new(Semaphore::new(limit)), limit }
    }

    /// Places for a request. One that stays open counts as a watcher, of which there may be many more than requests.
    fn admit(&self, path: &str, connection: Option<&Arc<Connection>>) -> Result<Places> {
        let _of_connection = connection.map(Connection::begin_call);
        if PROBES.contains(&path) {
            return Ok(Places { _of_connection, ..Places::default() });
        }
        let stays = path == WATCH;
        let resource = if stays { Resource::Watcher } else { Resource::Call };
        let of_client = |connection: &Arc<Connection>| connection.clients().take(connection.client(), resource);
        let _of_client = connection.map(of_client).transpose()?;
        if stays {
            return Ok(Places { _of_client, _of_connection, ..Places::default() });
        }
        let what = "requests in progress";
        let _in_all = self.places.clone().try_acquire_owned().map_err(|_| {
            self.metrics.connections.refused(what);
            Error::Overloaded { what, limit: self.limit as u64 }
        })?;
        Ok(Places { _in_all: Some(_in_all), _of_client, _of_connection })
    }
}

/// Answers a request for which there is a place.
pub(super) async fn bounded(State(bounds): State<Bounds>, request: Request, next: Next) -> Response {
    let mut response = answered(&bounds, request, next).await;
    // Whatever is in an answer, it is of the type that it says.
    response.headers_mut().insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    response
}

async fn answered(bounds: &Bounds, request: Request, next: Next) -> Response {
    let connection = request.extensions().get::<Arc<Connection>>().cloned();
    match bounds.admit(request.uri().path(), connection.as_ref()) {
        Ok(places) => next.run(request).await.map(|body| {
            let body = WatchedBody::new(body);
            if let Some(connection) = connection {
                let watched: Arc<dyn Unread> = body.watched();
                connection.watch(Arc::downgrade(&watched));
            }
            Body::new(Holding { body, _places: places })
        }),
        Err(error) => HttpError(error).into_response(),
    }
}

/// A body that holds the places of its request.
struct Holding {
    body: WatchedBody,
    _places: Places,
}

impl http_body::Body for Holding {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(cx)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// The answer to a request that panicked. Where and why the panic itself has said in the log.
#[derive(Clone, Debug)]
pub(super) struct Panicked(pub(super) Arc<Metrics>);

impl ResponseForPanic for Panicked {
    type ResponseBody = Body;

    fn response_for_panic(&mut self, _panic: Box<dyn Any + Send + 'static>) -> Response {
        self.0.connections.panics.inc();
        in_json(&Error::internal("a request of the HTTP port panicked"))
    }
}
