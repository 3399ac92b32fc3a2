//! The agent's port.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;

use axum::Router;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use bytes::Bytes;
use futures_util::stream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::time::{Duration, Instant, sleep_until};
use tokio_util::sync::CancellationToken;

use super::buffer::{ItemKey, Observation, Snapshot};
use super::document::{AGENT, Attribute, Attributes, Document, device_stream, time};
use super::model::Device;
use super::request::{CurrentQuery, Form, Parameters, Refusal, SampleQuery, Target, Wanted, known, target};
use super::{Agent, Known, Observations, json, now_us, xml};
use crate::access::Access;
use crate::connections::{Connection, Held, OpenCall, Resource};

/// What is between the parts of a stream.
const BOUNDARY: &str = "feedwave-mtconnect-part";
/// Least time between two parts where a client wants them at once.
const LEAST_INTERVAL: Duration = Duration::from_millis(100);

/// What answers the requests of the port.
#[derive(Clone, Debug)]
pub(crate) struct AgentState {
    agent: Agent,
    /// By which names the service may be asked.
    access: Access,
    streams: Arc<Semaphore>,
    draining: CancellationToken,
}

impl AgentState {
    /// Answers from an agent, with so many streams at once.
    pub(crate) fn new(agent: Agent, access: Access, streams: usize, draining: CancellationToken) -> Self {
        Self { agent, access, streams: Arc::new(Semaphore::new(streams)), draining }
    }
}

/// The port's only route: the standard has its own ideas of what is not found.
pub(crate) fn router(state: AgentState) -> Router {
    Router::new().fallback(answer).with_state(state)
}

/// What a request holds to the end of its answer.
struct Places {
    _of_client: Option<Held>,
    _of_connection: Option<OpenCall>,
    _stream: Option<OwnedSemaphorePermit>,
}

/// A document as it is sent.
struct Written {
    status: StatusCode,
    form: Form,
    text: String,
}

impl Written {
    fn response(self) -> Response {
        let headers = [
            (header::CONTENT_TYPE, HeaderValue::from_static(self.form.content_type())),
            (header::CACHE_CONTROL, HeaderValue::from_static("no-cache, no-store, max-age=0")),
        ];
        (self.status, headers, self.text).into_response()
    }
}

fn write(document: &Document<'_>, form: Form) -> String {
    match form {
        Form::Xml => xml::write(document),
        Form::Json => json::write(document),
    }
}

impl Agent {
    /// What every header has.
    fn header(&self, observations: &Observations) -> Attributes {
        vec![
            ("creationTime", Attribute::Text(time(now_us()))),
            ("sender", Attribute::Text(self.sender.to_string())),
            ("instanceId", Attribute::Number(self.instance)),
            ("version", Attribute::Text(AGENT.to_owned())),
            ("bufferSize", Attribute::Number(observations.buffer.capacity() as u64)),
        ]
    }

    fn model_time(observations: &Observations) -> (&'static str, Attribute) {
        ("deviceModelChangeTime", Attribute::Text(time(observations.model_changed_us)))
    }

    fn refused(&self, refusal: &Refusal, form: Form) -> Written {
        let header = self.header(&self.observations());
        let document = Document::Error { header, code: refusal.code, message: refusal.message.clone() };
        Written { status: refusal.status, form, text: write(&document, form) }
    }

    fn probe(&self, device: Option<u32>, form: Form) -> String {
        let (header, devices) = {
            let observations = self.observations();
            let mut header = self.header(&observations);
            header.push(Self::model_time(&observations));
            header.push(("assetBufferSize", Attribute::Number(1)));
            header.push(("assetCount", Attribute::Number(0)));
            let shown = observations.shown().into_values().map(|(number, _)| number);
            let wanted = shown.filter(|number| device.is_none_or(|device| *number == device));
            let known = wanted.filter_map(|number| observations.devices.get(&number));
            (header, known.map(Known::described).collect::<Vec<_>>())
        };
        write(&Document::Devices { header, devices: devices.iter().collect() }, form)
    }

    /// Copies observations with their devices, so that nobody waits while they are written.
    fn copy<'a>(
        &self,
        observations: &Observations,
        shown: impl IntoIterator<Item = &'a Observation>,
        next: u64,
    ) -> Copied {
        let buffer = &observations.buffer;
        let mut header = self.header(observations);
        header.push(Self::model_time(observations));
        header.push(("firstSequence", Attribute::Number(buffer.first())));
        header.push(("lastSequence", Attribute::Number(buffer.last())));
        header.push(("nextSequence", Attribute::Number(next)));
        let mut of_devices: BTreeMap<u32, Vec<Observation>> = BTreeMap::new();
        for observation in shown {
            of_devices.entry(observation.item.0).or_default().push(observation.clone());
        }
        let known = |(number, own)| Some((observations.devices.get(&number)?.device.clone(), own));
        let mut devices: Vec<_> = of_devices.into_iter().filter_map(known).collect();
        // Stable: of a device that has changed, what it was comes first.
        devices.sort_by(|(one, _), (other, _)| one.id.cmp(&other.id));
        Copied { header, devices }
    }

    /// What every wanted item shows.
    fn current(&self, wanted: &mut Wanted, at: Option<u64>, form: Form) -> String {
        let copied = {
            let observations = self.observations();
            wanted.renew(&observations);
            let past: Option<Snapshot> = at.map(|at| observations.buffer.at(at));
            let snapshot = past.as_ref().unwrap_or_else(|| observations.buffer.newest());
            let shown = wanted.items.iter().flat_map(|item| snapshot.of(*item));
            let copied = self.copy(&observations, shown, observations.buffer.last() + 1);
            wanted.forget_ended(&observations);
            copied
        };
        copied.write(form)
    }

    /// Changes; where to go on, and whether there were any.
    fn sample(&self, wanted: &mut Wanted, query: &SampleQuery, form: Form) -> (String, u64, bool) {
        let (copied, next, has_any) = {
            let observations = self.observations();
            wanted.renew(&observations);
            let is_wanted = |item: ItemKey| wanted.items.contains(&item);
            let part = if query.is_backwards {
                observations.buffer.backwards(query.from, query.count, is_wanted)
            } else {
                observations.buffer.forwards(query.from, query.to, query.count, is_wanted)
            };
            let has_any = !part.observations.is_empty();
            let copied = self.copy(&observations, part.observations, part.next);
            if part.next == observations.buffer.next() {
                wanted.forget_ended(&observations);
            }
            (copied, part.next, has_any)
        };
        (copied.write(form), next, has_any)
    }
}

/// Observations with their devices, apart from those of the agent.
struct Copied {
    header: Attributes,
    devices: Vec<(Arc<Device>, Vec<Observation>)>,
}

impl Copied {
    fn write(self, form: Form) -> String {
        let streams = self.devices.iter().map(|(device, own)| {
            device_stream(
                device,
                own.iter().map(|observation| (&device.items[observation.item.1 as usize], observation)),
            )
        });
        write(&Document::Streams { header: self.header, streams: streams.collect() }, form)
    }
}

/// Writes on a thread that nobody else waits for.
async fn written<T: Send + 'static>(write: impl FnOnce() -> T + Send + 'static) -> Result<T, Refusal> {
    tokio::task::spawn_blocking(write).await.map_err(|error| {
        tracing::error!(%error, "a document could not be written");
        let message = "the document could not be written";
        Refusal::new(StatusCode::INTERNAL_SERVER_ERROR, "INTERNAL_ERROR", message)
    })
}

/// Answers a request.
async fn answer(State(state): State<AgentState>, request: Request) -> Result<Response, Infallible> {
    let parameters = Parameters::parse(request.uri().query());
    let form = Form::of(&parameters, request.headers());
    let connection = request.extensions().get::<Arc<Connection>>().cloned();
    let checked = state.access.check_name(&request, connection.as_ref());
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    drop(request);
    let answered = match checked {
        Ok(()) => respond(&state, &method, &path, &parameters, form, connection.as_ref()).await,
        Err(error) => Err(Refusal::new(StatusCode::FORBIDDEN, "UNAUTHORIZED", error.to_string())),
    };
    Ok(match answered {
        Ok(response) => response,
        Err(refusal) => {
            let mut response = state.agent.refused(&refusal, form).response();
            if refusal.status == StatusCode::METHOD_NOT_ALLOWED {
                response.headers_mut().insert(header::ALLOW, HeaderValue::from_static("GET,HEAD"));
            }
            response
        }
    })
}

async fn respond(
    state: &AgentState,
    method: &Method,
    path: &str,
    parameters: &Parameters,
    form: Form,
    connection: Option<&Arc<Connection>>,
) -> Result<Response, Refusal> {
    if method != Method::GET && method != Method::HEAD {
        let message = "this agent is read-only: use GET";
        return Err(Refusal::new(StatusCode::METHOD_NOT_ALLOWED, "UNSUPPORTED", message));
    }
    let (target, name) = target(path)?;
    let streams = target != Target::Probe && parameters.get("interval").is_some();
    let places = admit(state, connection, streams)?;
    let agent = state.agent.clone();
    let ok = |text| Written { status: StatusCode::OK, form, text }.response();
    match target {
        Target::Probe => {
            let device = name.map(|name| known(&agent.observations(), &name)).transpose()?;
            written(move || agent.probe(device, form)).await.map(ok)
        }
        Target::Current => {
            let (mut wanted, query) = {
                let observations = agent.observations();
                let wanted = Wanted::of(&observations, name.as_deref(), parameters.get("path"))?;
                (wanted, CurrentQuery::of(&observations, parameters)?)
            };
            match query.interval {
                None => written(move || agent.current(&mut wanted, query.at, form)).await.map(ok),
                Some(interval) => Ok(state.repeat(wanted, interval, form, places)),
            }
        }
        Target::Sample => {
            let (mut wanted, query) = {
                let observations = agent.observations();
                let wanted = Wanted::of(&observations, name.as_deref(), parameters.get("path"))?;
                (wanted, SampleQuery::of(&observations, parameters)?)
            };
            match query.interval {
                None => written(move || agent.sample(&mut wanted, &query, form).0).await.map(ok),
                Some(_) => Ok(state.follow(wanted, query, form, places)),
            }
        }
    }
}

/// Places for a request.
fn admit(state: &AgentState, connection: Option<&Arc<Connection>>, streams: bool) -> Result<Places, Refusal> {
    let too_many = |message: String| Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "TOO_MANY", message);
    let _of_connection = connection.map(Connection::begin_call);
    let resource = if streams { Resource::Watcher } else { Resource::Call };
    let take = |connection: &Arc<Connection>| connection.clients().take(connection.client(), resource);
    let _of_client = connection.map(take).transpose().map_err(|error| too_many(error.to_string()))?;
    let full = |_| too_many("there are as many streams as there may be (mtconnect.streams)".to_owned());
    let _stream = if streams { Some(state.streams.clone().try_acquire_owned().map_err(full)?) } else { None };
    Ok(Places { _of_client, _of_connection, _stream })
}

/// A document as a part of a stream.
fn part(form: Form, text: &str) -> Bytes {
    let kind = form.content_type();
    format!("--{BOUNDARY}\r\nContent-type: {kind}\r\nContent-length: {}\r\n\r\n{text}\r\n", text.len()).into()
}

fn multipart(parts: impl futures_util::Stream<Item = Bytes> + Send + 'static) -> Response {
    use futures_util::StreamExt as _;
    let content_type = format!("multipart/mixed;boundary={BOUNDARY}");
    let mut response = Body::from_stream(parts.map(Ok::<_, Infallible>)).into_response();
    let headers: &mut HeaderMap = response.headers_mut();
    if let Ok(content_type) = HeaderValue::from_str(&content_type) {
        headers.insert(header::CONTENT_TYPE, content_type);
    }
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache, no-store, max-age=0"));
    response
}

/// A stream of changes.
struct Following {
    agent: Agent,
    next: watch::Receiver<u64>,
    wanted: Wanted,
    query: SampleQuery,
    form: Form,
    /// When the last part was sent.
    sent_at: Instant,
    /// Before that no further part is sent.
    not_before: Instant,
    draining: CancellationToken,
    is_over: bool,
    _places: Places,
}

impl Following {
    /// The next part; `None` where the service ends.
    async fn part(&mut self) -> Option<Bytes> {
        if self.is_over {
            return None;
        }
        let silent_until = self.sent_at + self.query.heartbeat;
        loop {
            tokio::select! {
                () = self.draining.cancelled() => return None,
                () = sleep_until(self.not_before) => {}
            }
            self.next.mark_unchanged();
            if let Some(part) = self.overtaken() {
                return Some(part);
            }
            let (agent, mut wanted, query, form) = (self.agent.clone(), self.wanted.clone(), self.query, self.form);
            let sample = written(move || (agent.sample(&mut wanted, &query, form), wanted));
            let ((text, next, has_any), wanted) = sample.await.ok()?;
            self.wanted = wanted;
            self.query.from = next;
            if has_any || Instant::now() >= silent_until {
                let interval = self.query.interval.unwrap_or_default().max(LEAST_INTERVAL);
                self.sent_at = Instant::now();
                self.not_before = self.sent_at + interval;
                return Some(part(self.form, &text));
            }
            tokio::select! {
                () = self.draining.cancelled() => return None,
                changed = self.next.changed() => changed.ok()?,
                () = sleep_until(silent_until) => {}
            }
        }
    }

    /// The last part for a client that is slower than the buffer.
    fn overtaken(&mut self) -> Option<Bytes> {
        let first = self.agent.observations().buffer.first();
        if std::mem::take(&mut self.query.is_from_oldest) {
            self.query.from = self.query.from.max(first);
        }
        if self.query.from >= first {
            return None;
        }
        self.is_over = true;
        let message = format!("observation {} is no longer kept, the oldest is {first}", self.query.from);
        let refusal = Refusal::new(StatusCode::BAD_REQUEST, "OUT_OF_RANGE", message);
        Some(part(self.form, &self.agent.refused(&refusal, self.form).text))
    }
}

impl AgentState {
    fn follow(&self, wanted: Wanted, query: SampleQuery, form: Form, places: Places) -> Response {
        let following = Following {
            agent: self.agent.clone(),
            next: self.agent.next.subscribe(),
            wanted,
            query,
            form,
            sent_at: Instant::now(),
            not_before: Instant::now(),
            draining: self.draining.clone(),
            is_over: false,
            _places: places,
        };
        multipart(stream::unfold(following, async |mut following| following.part().await.map(|part| (part, following))))
    }

    /// What is current, again and again.
    fn repeat(&self, wanted: Wanted, interval: Duration, form: Form, places: Places) -> Response {
        let begin = (self.agent.clone(), self.draining.clone(), Instant::now(), wanted, places);
        multipart(stream::unfold(begin, move |(agent, draining, at, mut wanted, places)| async move {
            draining.run_until_cancelled(sleep_until(at)).await?;
            let of = agent.clone();
            let current = written(move || (of.current(&mut wanted, None, form), wanted));
            let (text, wanted) = current.await.ok()?;
            // A client that is slow gets as many as it can read.
            let next = (at + interval.max(LEAST_INTERVAL)).max(Instant::now());
            Some((part(form, &text), (agent, draining, next, wanted, places)))
        }))
    }
}
