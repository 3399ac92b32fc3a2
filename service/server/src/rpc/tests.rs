use std::sync::Mutex;
use std::time::Duration;

use http_body::Body as _;
use tonic_types::StatusExt as _;
use tower::{Layer as _, Service as _};

use super::*;
use crate::config::AuthConfig;
use crate::engine::Engine;

fn reason(headers: &HeaderMap) -> (Code, String) {
    let status = Status::from_header_map(headers).unwrap();
    (status.code(), status.get_error_details().error_info().unwrap().reason.clone())
}

/// A call of a method.
fn call(path: &str) -> Request<Body> {
    let request = Request::builder().uri(path).header(header::CONTENT_TYPE, "application/grpc");
    request.body(Body::empty()).unwrap()
}

/// A layer over an empty store.
async fn layer_of(limits: Limits) -> (tempfile::TempDir, feedwave_store::Store, Arc<Metrics>, RpcLayer) {
    let folder = tempfile::tempdir().unwrap();
    let uri = feedwave_store::StoreUri::of_file(&folder.path().join("feedwave.db")).unwrap();
    let store = feedwave_store::Store::open(&uri, feedwave_store::StoreSettings::default()).await.unwrap();
    let (metrics, draining) = (Arc::new(Metrics::new()), CancellationToken::new());
    let engine = Engine::new(store.clone(), metrics.clone(), limits.clone(), draining.clone());
    let (access, audit) = (Access::load(&AuthConfig::default()).unwrap(), AuditLog::new(store.clone(), engine));
    let layer = RpcLayer::new(metrics.clone(), &limits, access, audit, draining);
    (folder, store, metrics, layer)
}

#[tokio::test]
async fn a_panic_ends_its_call_and_no_other() {
    let limits = Limits { concurrent_requests: 1, ..Limits::default() };
    let (_folder, _, metrics, layer) = layer_of(limits).await;
    let request = || call("/");
    let at_once = tower::service_fn(|_: Request<Body>| -> std::future::Ready<Result<Response<Body>, Status>> {
        panic!("before there is a future")
    });
    let later = tower::service_fn(async |_: Request<Body>| -> Result<Response<Body>, Status> { panic!("in it") });
    for _ in 0..2 {
        // The place is free again each time.
        let answer = layer.layer(at_once).call(request()).await.unwrap();
        assert_eq!(reason(answer.headers()), (Code::Internal, "INTERNAL".to_owned()));
        drop(answer);
        let answer = layer.layer(later).call(request()).await.unwrap();
        assert_eq!(reason(answer.headers()), (Code::Internal, "INTERNAL".to_owned()));
    }
    let in_body = tower::service_fn(async |_: Request<Body>| -> Result<Response<Body>, Status> {
        let frames = futures_util::stream::once(async { Ok::<_, Status>(Frame::data(Bytes::from_static(b"1"))) });
        let frames = futures_util::StreamExt::chain(frames, futures_util::stream::poll_fn(|_| panic!("in the answer")));
        Ok(Response::new(Body::new(StreamBody(Box::pin(frames)))))
    });
    let mut body = layer.layer(in_body).call(request()).await.unwrap().into_body();
    let mut next = async || std::future::poll_fn(|cx| std::pin::Pin::new(&mut body).poll_frame(cx)).await;
    assert_eq!(next().await.unwrap().unwrap().into_data().unwrap(), "1");
    let trailers = next().await.unwrap().unwrap().into_trailers().unwrap();
    assert_eq!(reason(&trailers), (Code::Internal, "INTERNAL".to_owned()));
    assert!(next().await.is_none());
    assert_eq!(metrics.connections.panics.get(), 5);
    assert_eq!(metrics.active_requests.get(), 0);
}

/// A body of frames.
struct StreamBody(std::pin::Pin<Box<dyn futures_util::Stream<Item = Result<Frame<Bytes>, Status>> + Send>>);

impl http_body::Body for StreamBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: std::pin::Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        futures_util::Stream::poll_next(self.0.as_mut(), cx)
    }
}

#[tokio::test]
async fn a_call_ends_at_its_deadline_with_a_status_that_says_so() {
    let (_folder, _, _, layer) = layer_of(Limits::default()).await;
    tokio::time::pause();
    let endless = tower::service_fn(|_: Request<Body>| std::future::pending::<Result<Response<Body>, Status>>());
    let mut request = call("/");
    request.headers_mut().insert("grpc-timeout", "2S".parse().unwrap());
    let mut answer = layer.layer(endless).call(request);
    assert!((&mut answer).now_or_never().is_none());
    tokio::time::advance(Duration::from_millis(1_990)).await;
    assert!((&mut answer).now_or_never().is_none());
    tokio::time::advance(Duration::from_millis(20)).await;
    let response = answer.await.unwrap();
    let status = Status::from_header_map(response.headers()).unwrap();
    assert_eq!(status.code(), Code::DeadlineExceeded);
    assert_eq!(status.get_error_details().error_info().unwrap().reason, "DEADLINE_EXCEEDED");
}

#[tokio::test]
async fn a_request_that_is_no_call_is_not_looked_at() {
    let (_folder, _, metrics, layer) = layer_of(Limits::default()).await;
    let never = tower::service_fn(|_: Request<Body>| -> std::future::Ready<Result<Response<Body>, Status>> {
        panic!("it is called")
    });
    for kind in [None, Some("text/plain"), Some("application/x-www-form-urlencoded")] {
        let mut request = call("/feedwave.v1.Jobs/DeleteJob");
        request.headers_mut().remove(header::CONTENT_TYPE);
        request.headers_mut().extend(kind.map(|kind| (header::CONTENT_TYPE, kind.parse().unwrap())));
        let answer = layer.layer(never).call(request).await.unwrap();
        assert_eq!(answer.status(), StatusCode::UNSUPPORTED_MEDIA_TYPE);
    }
    assert_eq!(metrics.connections.panics.get(), 0);
}

#[tokio::test]
async fn a_change_is_done_to_its_end_and_logged_though_nobody_waits() {
    let limits = Limits { concurrent_requests: 1, ..Limits::default() };
    let (_folder, store, _, layer) = layer_of(limits).await;
    let (go, gone) = (Arc::new(Semaphore::new(0)), Arc::new(Semaphore::new(0)));
    let (waits, ends) = (go.clone(), gone.clone());
    let work = tower::service_fn(move |request: Request<Body>| {
        let (waits, ends) = (waits.clone(), ends.clone());
        async move {
            waits.acquire().await.unwrap().forget();
            request.extensions().get::<Caller>().unwrap().concerns("jobs/1");
            ends.add_permits(1);
            Ok::<_, Status>(Response::new(Body::empty()))
        }
    });
    let mut answer = layer.layer(work).call(call("/feedwave.v1.Jobs/CancelJob"));
    // It has begun, and is given up.
    let entries = async || store.audit_after(0, &feedwave_store::AuditFilter::default(), 10).await.unwrap();
    while entries().await.is_empty() {
        assert!((&mut answer).now_or_never().is_none());
        tokio::task::yield_now().await;
    }
    drop(answer);
    // Its place is taken until it ends.
    let refused = layer.layer(tower::service_fn(|_: Request<Body>| std::future::pending::<Result<_, Status>>()));
    let refused = { refused }.call(call("/")).await.unwrap();
    assert_eq!(reason(refused.headers()).0, Code::ResourceExhausted);
    go.add_permits(1);
    gone.acquire().await.unwrap().forget();
    let entry = loop {
        match entries().await.remove(0) {
            entry if entry.result.is_some() => break entry,
            _ => tokio::task::yield_now().await,
        }
    };
    let result = entry.result.unwrap();
    assert_eq!((result.code.as_str(), result.resource.as_str()), ("OK", "jobs/1"));
}

#[tokio::test]
async fn what_is_done_is_not_cancelled_by_a_client_that_does_not_read_the_end_of_the_answer() {
    let (_folder, store, metrics, layer) = layer_of(Limits::default()).await;
    for (is_done, code) in [(true, "OK"), (false, "CANCELLED")] {
        // The last message, and an end that does not come before the client has gone away.
        let run = tower::service_fn(move |request: Request<Body>| async move {
            if is_done {
                request.extensions().get::<Caller>().unwrap().work().has_done();
            }
            let frames = futures_util::stream::once(async { Ok::<_, Status>(Frame::data(Bytes::from_static(b"1"))) });
            let frames = futures_util::StreamExt::chain(frames, futures_util::stream::pending());
            Ok::<_, Status>(Response::new(Body::new(StreamBody(Box::pin(frames)))))
        });
        let answer = layer.layer(run).call(call("/feedwave.v1.Runs/Run")).await.unwrap();
        let mut body = answer.into_body();
        let frame = std::future::poll_fn(|cx| std::pin::Pin::new(&mut body).poll_frame(cx)).await;
        assert_eq!(frame.unwrap().unwrap().into_data().unwrap(), "1");
        drop(body);
        let result = loop {
            let entries = store.audit_after(0, &feedwave_store::AuditFilter::default(), 10).await.unwrap();
            match entries.into_iter().next_back().and_then(|entry| entry.result) {
                Some(result) => break result,
                None => tokio::task::yield_now().await,
            }
        };
        assert_eq!(result.code, code);
        assert_eq!(metrics.requests.with_label_values(&["/feedwave.v1.Runs/Run", code]).get(), 1);
    }
}

#[tokio::test]
async fn what_goes_on_after_its_client_has_gone_is_logged_when_it_ends() {
    let (_folder, store, _, layer) = layer_of(Limits::default()).await;
    for (is_done, code) in [(true, "OK"), (false, "CANCELLED")] {
        let work = Arc::new(Mutex::new(None));
        let begun = work.clone();
        let ingest = tower::service_fn(move |request: Request<Body>| {
            *begun.lock().unwrap() = Some(request.extensions().get::<Caller>().unwrap().work());
            let frames = futures_util::stream::pending::<Result<Frame<Bytes>, Status>>();
            std::future::ready(Ok::<_, Status>(Response::new(Body::new(StreamBody(Box::pin(frames))))))
        });
        drop(layer.layer(ingest).call(call("/feedwave.v1.Telemetry/Ingest")).await.unwrap());
        let newest = async || {
            let entries = store.audit_after(0, &feedwave_store::AuditFilter::default(), 10).await.unwrap();
            entries.into_iter().next_back().unwrap().result
        };
        for _ in 0..8 {
            assert_eq!(newest().await, None);
        }
        let work = work.lock().unwrap().take().unwrap();
        if is_done {
            work.has_done();
        } else {
            drop(work);
        }
        let result = loop {
            match newest().await {
                Some(result) => break result,
                None => tokio::task::yield_now().await,
            }
        };
        assert_eq!(result.code, code);
    }
}
