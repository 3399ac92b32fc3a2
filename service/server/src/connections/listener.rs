//! A port: accepts connections, bounds them, serves each in a task of its own, and ends all in order.

use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use http::{Request, Response};
use hyper::body::Incoming;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, sleep, sleep_until, timeout};
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;
use tower::util::BoxCloneSyncService;
use tower::{Service, ServiceExt as _};

use super::clients::{ClientKey, Clients, Held, Resource};
use super::connection::{Connection, Due, Heard};
use super::giving_way::GivingWay;
use super::refusal;
use super::tls::{PeerCertificate, Tls};
use crate::cut_off::CutOff;
use crate::error::Error;
use crate::lingering::Lingering;

/// What answers the requests of a port.
pub(crate) type App = BoxCloneSyncService<Request<Body>, Response<Body>, Infallible>;

/// How long being told may take.
const REFUSAL_TIME: Duration = Duration::from_secs(5);
/// How long a connection that is closed may take to end what it is sending.
const CLOSING_TIME: Duration = Duration::from_secs(10);
/// How long a connection is served at least that is to be closed in order: a call is answered, and a balancer not stormed.
const LEAST_STAY: Duration = Duration::from_secs(1);
/// First and longest pause after a connection could not be accepted.
const ACCEPT_PAUSE: (Duration, Duration) = (Duration::from_millis(10), Duration::from_secs(1));
/// Failures to accept are logged this often.
const ACCEPT_LOG_INTERVAL: Duration = Duration::from_secs(10);

/// A port and how it is served.
pub(crate) struct Port {
    /// `grpc` or `http`, for the log.
    pub(crate) name: &'static str,
    pub(crate) listener: TcpListener,
    pub(crate) app: App,
    pub(crate) tls: Option<Arc<Tls>>,
    pub(crate) clients: Arc<Clients>,
    /// Places for connections that are told why they are not served, of all ports; any further one is closed without a word.
    pub(crate) refusals: Arc<Semaphore>,
    /// Streams that one connection of HTTP/2 may have open.
    pub(crate) streams_per_connection: u32,
    /// How long a client may take to read the rest of a connection that is closed.
    pub(crate) linger: Duration,
    /// While it is, clients are to connect anew: a balancer may lead them elsewhere.
    pub(crate) cut_off: CutOff,
    /// Whether its connections let every other thread go first ([`GivingWay`]).
    pub(crate) gives_way: bool,
}

/// The same for all connections of a port.
struct Shared {
    name: &'static str,
    app: App,
    tls: Option<Arc<Tls>>,
    clients: Arc<Clients>,
    builder: Builder<TokioExecutor>,
    refusals: Arc<Semaphore>,
    linger: Duration,
    cut_off: CutOff,
    /// Cancelled when connections are to end in order.
    closing: CancellationToken,
    /// Cancelled when they are to end at once.
    killed: CancellationToken,
}

/// What a connection that was accepted takes up.
enum Place {
    /// It is served.
    Served(Held),
    /// It is told why not.
    Refused(Error, OwnedSemaphorePermit),
}

impl Port {
    /// Serves until `closing` is cancelled, then until every connection has ended. Where the future is dropped, all of
    /// them end at once.
    pub(crate) async fn serve(self, closing: CancellationToken) {
        let limits = self.clients.limits();
        let mut builder = Builder::new(TokioExecutor::new());
        builder
            .http2()
            .timer(TokioTimer::new())
            .max_concurrent_streams(self.streams_per_connection)
            .keep_alive_interval(limits.keepalive());
        // The head of a request has its time in `Connection`, where being idle is another thing.
        builder.http1().header_read_timeout(None);
        let killed = CancellationToken::new();
        let _kill = killed.clone().drop_guard();
        let shared = Arc::new(Shared {
            name: self.name,
            app: self.app,
            tls: self.tls,
            clients: self.clients,
            builder,
            refusals: self.refusals,
            linger: self.linger,
            cut_off: self.cut_off,
            closing: closing.clone(),
            killed,
        });
        let connections = TaskTracker::new();
        {
            // Closed when the loop is left: whoever connects later is refused by the system.
            let listener = self.listener;
            let mut failures = Failures::default();
            loop {
                let accepted = tokio::select! {
                    accepted = listener.accept() => accepted,
                    () = closing.cancelled() => break,
                };
                match accepted {
                    Ok((stream, peer)) => {
                        failures.pause = ACCEPT_PAUSE.0;
                        let Some(place) = shared.place(peer) else { continue };
                        let shared = shared.clone();
                        let connection = async move { shared.accepted(stream, peer, place).await };
                        if self.gives_way {
                            connections.spawn(GivingWay(Box::pin(connection)));
                        } else {
                            connections.spawn(connection);
                        }
                    }
                    Err(error) if is_of_one_connection(&error) => {}
                    Err(error) => {
                        shared.clients.metrics().accept_errors.inc();
                        tokio::select! {
                            () = failures.wait(shared.name, &error) => {}
                            () = closing.cancelled() => break,
                        }
                    }
                }
            }
        }
        connections.close();
        connections.wait().await;
    }
}

/// Whether the other side went away before it was accepted: the next one is as good as ever.
fn is_of_one_connection(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset)
}

/// Failures of the system to accept, such as for want of descriptors.
struct Failures {
    pause: Duration,
    count: u64,
    logged: Option<Instant>,
}

impl Default for Failures {
    fn default() -> Self {
        Self { pause: ACCEPT_PAUSE.0, count: 0, logged: None }
    }
}

impl Failures {
    /// Waits before the next try, longer from time to time.
    async fn wait(&mut self, port: &str, error: &io::Error) {
        self.count += 1;
        if self.logged.is_none_or(|logged| logged.elapsed() >= ACCEPT_LOG_INTERVAL) {
            tracing::warn!(port, %error, failures = self.count, "connections cannot be accepted, trying again");
            self.logged = Some(Instant::now());
        }
        let pause = self.pause;
        self.pause = (pause * 2).min(ACCEPT_PAUSE.1);
        sleep(pause).await;
    }
}

impl Shared {
    /// The place of a connection that was accepted; none where it is closed without a word. It is taken before the task of the
    /// connection runs: however late that is on a busy machine, no more descriptors are in use than there are places.
    fn place(&self, peer: SocketAddr) -> Option<Place> {
        match self.clients.take(&ClientKey::of_address(peer.ip()), Resource::Connection) {
            Ok(held) => Some(Place::Served(held)),
            Err(error) => {
                let refusal = self.refusals.clone().try_acquire_owned().ok()?;
                Some(Place::Refused(error, refusal))
            }
        }
    }

    async fn accepted(&self, stream: TcpStream, peer: SocketAddr, place: Place) {
        let _ = stream.set_nodelay(true);
        let stream = Lingering::new(stream, self.linger);
        tokio::select! {
            () = self.killed.cancelled() => {}
            () = self.admit(stream, peer, place) => {}
        }
    }

    /// Serves a connection for which there is a place, and tells others why there is none.
    async fn admit(&self, stream: Lingering, peer: SocketAddr, place: Place) {
        let held = match place {
            Place::Served(held) => held,
            Place::Refused(error, _refusal) => return self.refuse(stream, error).await,
        };
        let Some(tls) = &self.tls else {
            return self.serve(stream, peer, ClientKey::of_address(peer.ip()), None, held).await;
        };
        match timeout(self.clients.limits().header_timeout(), tls.accept(stream)).await {
            Ok(Ok((stream, certificate))) => self.secured(stream, peer, certificate, held).await,
            Ok(Err(error)) => tracing::debug!(port = self.name, %peer, %error, "no handshake"),
            Err(_) => self.clients.metrics().closed("handshake_timeout"),
        }
    }

    /// Serves an encrypted connection: one that showed a certificate is counted by its subject from here on.
    async fn secured(
        &self,
        stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
        peer: SocketAddr,
        certificate: Option<PeerCertificate>,
        place: Held,
    ) {
        let Some(certificate) = certificate else {
            return self.serve(stream, peer, ClientKey::of_address(peer.ip()), None, place).await;
        };
        let client = ClientKey::Subject(certificate.subject.clone());
        drop(place);
        match self.clients.take(&client, Resource::Connection) {
            Ok(place) => self.serve(stream, peer, client, Some(certificate), place).await,
            Err(error) => {
                let Ok(_place) = self.refusals.try_acquire() else { return };
                self.tell(stream, error).await;
            }
        }
    }

    /// Serves a connection to its end.
    async fn serve(
        &self,
        stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
        peer: SocketAddr,
        client: ClientKey,
        certificate: Option<PeerCertificate>,
        _place: Held,
    ) {
        let connection = Connection::new(peer.ip(), client, certificate, self.clients.clone());
        let app = self.app.clone();
        let known = connection.clone();
        let service = tower::service_fn(move |mut request: Request<Incoming>| {
            request.extensions_mut().insert(known.clone());
            app.clone().oneshot(request.map(Body::new))
        });
        let io = TokioIo::new(Heard::new(stream, connection.clone()));
        let mut serving = pin!(self.builder.serve_connection(io, TowerToHyperService::new(service)));
        let mut look = pin!(sleep_until(Instant::now()));
        // Until when it may take to close.
        let mut cut_at: Option<Instant> = None;
        let mut is_closing = false;
        let mut leave = pin!(async {
            sleep(LEAST_STAY).await;
            self.cut_off.begun().await;
        });
        loop {
            tokio::select! {
                ended = serving.as_mut() => {
                    if let Err(error) = ended {
                        tracing::debug!(port = self.name, %peer, %error, "the connection ended");
                    }
                    return;
                }
                () = look.as_mut() => {}
                () = self.closing.cancelled(), if !is_closing => {
                    is_closing = true;
                    serving.as_mut().graceful_shutdown();
                }
                () = leave.as_mut(), if !is_closing => {
                    is_closing = true;
                    self.clients.metrics().closed("cut_off");
                    serving.as_mut().graceful_shutdown();
                }
            }
            let now = Instant::now();
            if cut_at.is_some_and(|at| at <= now) {
                return;
            }
            let next = match connection.due(now) {
                Due::Later(next) => next,
                Due::Cut => {
                    self.clients.metrics().closed("header_timeout");
                    return;
                }
                Due::Close => {
                    if cut_at.is_none() {
                        self.clients.metrics().closed("idle_timeout");
                        serving.as_mut().graceful_shutdown();
                    }
                    *cut_at.get_or_insert(now + CLOSING_TIME)
                }
            };
            look.as_mut().reset(cut_at.map_or(next, |at| at.min(next)));
        }
    }

    /// Says why a connection is not served.
    async fn refuse(&self, stream: Lingering, error: Error) {
        match &self.tls {
            None => self.tell(stream, error).await,
            Some(tls) => {
                if let Ok(Ok((stream, _))) = timeout(REFUSAL_TIME, tls.accept(stream)).await {
                    self.tell(stream, error).await;
                }
            }
        }
    }

    /// Answers the first request of a connection with an error, and closes it.
    async fn tell(&self, stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static, error: Error) {
        let told = CancellationToken::new();
        let answered = told.clone();
        let service = tower::service_fn(move |request: Request<Incoming>| {
            answered.cancel();
            std::future::ready(Ok::<_, Infallible>(refusal::answer(request.headers(), &error)))
        });
        let serving = self.builder.serve_connection(TokioIo::new(stream), TowerToHyperService::new(service));
        let mut serving = pin!(serving);
        let _ = timeout(REFUSAL_TIME, async {
            tokio::select! {
                _ = serving.as_mut() => return,
                () = told.cancelled() => {}
            }
            serving.as_mut().graceful_shutdown();
            let _ = serving.await;
        })
        .await;
    }
}

/// A service as a port takes it.
pub(crate) fn app<S, B>(service: S) -> App
where
    S: Service<Request<Body>, Response = Response<B>, Error = Infallible> + Clone + Send + Sync + 'static,
    S::Future: Send + 'static,
    B: http_body::Body<Data = bytes::Bytes> + Send + 'static,
    B::Error: Into<axum::BoxError>,
{
    BoxCloneSyncService::new(service.map_response(|response: Response<B>| response.map(Body::new)))
}

#[cfg(test)]
mod tests {
    use std::task::{Context, Waker};

    use tokio::runtime::Handle;

    use super::*;
    use crate::config::ConnectionLimits;
    use crate::observability::metrics::Metrics;

    const SERVED: usize = 5;
    const REFUSED: usize = 2;

    #[tokio::test]
    async fn places_are_taken_before_connections_are_looked_at() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let limits = ConnectionLimits { total: SERVED, ..ConnectionLimits::default() };
        let clients = Clients::new(limits, Metrics::new().connections);
        let refusals = Arc::new(Semaphore::new(REFUSED));
        let port = Port {
            name: "http",
            listener,
            app: app(tower::service_fn(|_| std::future::ready(Ok(Response::new(Body::empty()))))),
            tls: None,
            clients: clients.clone(),
            refusals: refusals.clone(),
            streams_per_connection: 1,
            linger: Duration::ZERO,
            cut_off: CutOff::default(),
            gives_way: true,
        };
        let _waiting: Vec<_> = (0..40).map(|_| std::net::TcpStream::connect(address).unwrap()).collect();
        let mut serving = pin!(port.serve(CancellationToken::new()));
        // Nothing but this lets tasks run: what is accepted in one step is not looked at before the next.
        while clients.metrics().held(Resource::Connection).get() == 0 {
            assert!(serving.as_mut().poll(&mut Context::from_waker(Waker::noop())).is_pending());
            let open = Handle::current().metrics().num_alive_tasks();
            assert!(open <= SERVED + REFUSED, "{open} connections are open");
            tokio::task::yield_now().await;
        }
        assert_eq!(clients.metrics().held(Resource::Connection).get(), SERVED as i64);
        assert_eq!(refusals.available_permits(), 0);
    }
}
