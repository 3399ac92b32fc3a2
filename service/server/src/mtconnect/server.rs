//! The agent's port.

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
use super::request::{CurrentQuery, Form, Parameters, Refusal, SampleQuery, Target, Wanted, target};
use super::{Agent, Observations, json, now_us, xml};
use crate::connections::{Connection, Held, OpenCall, Resource};

/// What is between the parts of a stream.
const BOUNDARY: &str = "feedwave-mtconnect-part";
/// Least time between two parts where a client wants them at once.
const LEAST_INTERVAL: Duration = Duration::from_millis(10);

/// What answers the requests of the port.
#[derive(Clone, Debug)]
pub(crate) struct AgentState {
    agent: Agent,
    streams: Arc<Semaphore>,
    draining: CancellationToken,
}

impl AgentState {
    /// Answers from an agent, with so many streams at once.
    pub(crate) fn new(agent: Agent, streams: usize, draining: CancellationToken) -> Self {
        Self { agent, streams: Arc::new(Semaphore::new(streams)), draining }
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
        let observations = self.observations();
        let mut header = self.header(&observations);
        header.push(Self::model_time(&observations));
        header.push(("assetBufferSize", Attribute::Number(1)));
        header.push(("assetCount", Attribute::Number(0)));
        let shown = observations.shown().into_values();
        let devices = shown.filter(|(number, _)| device.is_none_or(|device| *number == device));
        write(&Document::Devices { header, devices: devices.map(|(_, device)| device).collect() }, form)
    }

    fn streams(&self, observations: &Observations, shown: &[&Observation], next: u64, form: Form) -> String {
        let buffer = &observations.buffer;
        let mut header = self.header(observations);
        header.push(Self::model_time(observations));
        header.push(("firstSequence", Attribute::Number(buffer.first())));
        header.push(("lastSequence", Attribute::Number(buffer.last())));
        header.push(("nextSequence", Attribute::Number(next)));
        let devices = observations.shown().into_values();
        let streams = devices.filter_map(|(number, device)| {
            let own = shown.iter().filter(|observation| observation.item.0 == number);
            let own: Vec<_> =
                own.map(|observation| (&device.items[observation.item.1 as usize], *observation)).collect();
            (!own.is_empty()).then(|| device_stream(device, own))
        });
        let streams = streams.collect();
        write(&Document::Streams { header, streams }, form)
    }

    /// What every wanted item shows.
    fn current(&self, wanted: &Wanted, at: Option<u64>, form: Form) -> String {
        let observations = self.observations();
        let past: Option<Snapshot> = at.map(|at| observations.buffer.at(at));
        let snapshot = past.as_ref().unwrap_or_else(|| observations.buffer.newest());
        let shown: Vec<&Observation> = wanted.items.iter().flat_map(|item| snapshot.of(*item)).collect();
        self.streams(&observations, &shown, observations.buffer.last() + 1, form)
    }

    /// Changes; where to go on, and whether there were any.
    fn sample(&self, wanted: &Wanted, query: &SampleQuery, form: Form) -> (String, u64, bool) {
        let observations = self.observations();
        let is_wanted = |item: ItemKey| wanted.items.contains(&item) && observations.device(item).is_some();
        let part = if query.is_backwards {
            observations.buffer.backwards(query.from, query.count, is_wanted)
        } else {
            observations.buffer.forwards(query.from, query.to, query.count, is_wanted)
        };
        let text = self.streams(&observations, &part.observations, part.next, form);
        (text, part.next, !part.observations.is_empty())
    }
}

/// Answers a request.
async fn answer(State(state): State<AgentState>, request: Request) -> Result<Response, Infallible> {
    let parameters = Parameters::parse(request.uri().query());
    let form = Form::of(&parameters, request.headers());
    let connection = request.extensions().get::<Arc<Connection>>().cloned();
    let answered = respond(&state, request.method(), request.uri().path(), &parameters, form, connection.as_ref());
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

fn respond(
    state: &AgentState,
    method: &Method,
    path: &str,
    parameters: &Parameters,
    form: Form,
    connection: Option<&Arc<Connection>>,
) -> Result<Response, Refusal> {
    let agent = &state.agent;
    if method != Method::GET && method != Method::HEAD {
        let message = "this agent is read-only: use GET";
        return Err(Refusal::new(StatusCode::METHOD_NOT_ALLOWED, "UNSUPPORTED", message));
    }
    let (target, name) = target(path)?;
    let streams = target != Target::Probe && parameters.get("interval").is_some();
    let places = admit(state, connection, streams)?;
    let observations = agent.observations();
    let device = match &name {
        None => None,
        Some(name) => {
            let unknown = || {
                let name: String = name.chars().take(80).collect();
                Refusal::new(StatusCode::NOT_FOUND, "NO_DEVICE", format!("there is no device {name}"))
            };
            Some(observations.named(name).ok_or_else(unknown)?)
        }
    };
    let ok = |text| Written { status: StatusCode::OK, form, text }.response();
    match target {
        Target::Probe => {
            drop(observations);
            Ok(ok(agent.probe(device, form)))
        }
        Target::Current => {
            let wanted = Wanted::of(&observations, device, parameters)?;
            let query = CurrentQuery::of(&observations, parameters)?;
            drop(observations);
            match query.interval {
                None => Ok(ok(agent.current(&wanted, query.at, form))),
                Some(interval) => Ok(state.repeat(wanted, interval, form, places)),
            }
        }
        Target::Sample => {
            let wanted = Wanted::of(&observations, device, parameters)?;
            let query = SampleQuery::of(&observations, parameters)?;
            drop(observations);
            match query.interval {
                None => Ok(ok(agent.sample(&wanted, &query, form).0)),
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
        let silent_until = self.not_before.max(Instant::now()) + self.query.heartbeat;
        loop {
            tokio::select! {
                () = self.draining.cancelled() => return None,
                () = sleep_until(self.not_before) => {}
            }
            self.next.mark_unchanged();
            if let Some(part) = self.overtaken() {
                return Some(part);
            }
            let (text, next, has_any) = self.agent.sample(&self.wanted, &self.query, self.form);
            self.query.from = next;
            if has_any || Instant::now() >= silent_until {
                let interval = self.query.interval.unwrap_or_default().max(LEAST_INTERVAL);
                self.not_before = Instant::now() + interval;
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
            not_before: Instant::now(),
            draining: self.draining.clone(),
            is_over: false,
            _places: places,
        };
        multipart(stream::unfold(following, async |mut following| following.part().await.map(|part| (part, following))))
    }

    /// What is current, again and again.
    fn repeat(&self, wanted: Wanted, interval: Duration, form: Form, places: Places) -> Response {
        let begin = (self.agent.clone(), self.draining.clone(), Instant::now(), places);
        let wanted = Arc::new(wanted);
        multipart(stream::unfold(begin, move |(agent, draining, at, places)| {
            let wanted = wanted.clone();
            async move {
                draining.run_until_cancelled(sleep_until(at)).await?;
                let text = agent.current(&wanted, None, form);
                // A client that is slow gets as many as it can read.
                let next = (at + interval.max(LEAST_INTERVAL)).max(Instant::now());
                Some((part(form, &text), (agent, draining, next, places)))
            }
        }))
    }
}
