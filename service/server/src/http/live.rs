//! Server-sent events: states of machines, state changes of jobs, decisions, on one stream.
//!
//! Invariant: nothing is queued for a client. A stream knows how far it is in each log and which states it has told of;
//! what is next is looked up when the connection can take it, so that a slow client costs no more than a quick one.

use std::fmt;
use std::hash::{BuildHasher as _, RandomState};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::body::Body;
use axum::extract::{RawQuery, State};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::IntoResponse as _;
use bytes::Bytes;
use feedwave_contract::names;
use feedwave_store::{LogPlace, LogPlaces, Tenant};
use futures_util::{FutureExt as _, stream};
use http_body::{Frame, SizeHint};
use serde_json::json;
use sha2::{Digest as _, Sha256};
use tokio::time::{Instant, sleep, sleep_until};
use tokio_util::sync::CancellationToken;

use super::query::Query;
use super::{Answer, HttpState};
use crate::api::{Api, DecisionLog, EventLog, LogFilter, LogWatch};
use crate::connections::Unread;
use crate::error::{Error, Result};
use crate::floor::{Changes, FloorReader};

/// How long a client waits before it asks again, ms.
const RETRY_MS: u32 = 2_000;
/// Records that a client may be behind and still has told one by one; who is further behind reads the lists.
const MOST_BEHIND: i64 = 10_000;
/// How often a stream says something at most: what comes meanwhile is said together. Hundreds of pages that are each told at once of
/// every decision would keep the processor from the decisions.
const PACE: Duration = Duration::from_millis(250);
/// How often a stream tells the state of a machine at most: every other turn.
const STATES_EVERY: Duration = Duration::from_millis(500);
/// Bytes that are said together, about. Who has more to be told does not wait.
const MOST_TOGETHER: usize = 64 << 10;
/// The header of a client that comes back.
const LAST_EVENT_ID: &str = "last-event-id";

/// What a client was told last of each log, as it stands in the id of an event: `5ce1d32a-7-12` is behind event 7 of jobs and
/// decision 12. Both are places of what the client may see: of what others do they tell nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cursor {
    /// Of which store and tenant the places are.
    stamp: u32,
    events: i64,
    decisions: i64,
}

impl Cursor {
    fn parse(text: &str) -> Option<Self> {
        let (stamp, places) = text.split_once('-')?;
        let (events, decisions) = places.split_once('-')?;
        // A sign would be another text for the same place.
        let place = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse().ok()).flatten();
        let is_stamp = stamp.len() == 8 && stamp.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        let stamp = u32::from_str_radix(stamp, 16).ok().filter(|_| is_stamp)?;
        Some(Self { stamp, events: place(events)?, decisions: place(decisions)? })
    }

    /// Behind all that a tenant has in a store.
    fn newest(places: &LogPlaces, tenant: Tenant) -> Self {
        let mut of = Sha256::new();
        places.store.iter().for_each(|number| of.update(number.to_le_bytes()));
        of.update(tenant.name());
        let digest = of.finalize();
        let stamp = u32::from_be_bytes([digest[0], digest[1], digest[2], digest[3]]);
        Self { stamp, events: places.events.newest, decisions: places.decisions.newest }
    }

    /// Whether a client that is here can be told what it missed, record by record.
    fn can_go_on(self, places: &LogPlaces, newest: Self) -> bool {
        let is_near = |here: i64, log: LogPlace| {
            (log.removed..=log.newest).contains(&here) && log.newest.saturating_sub(here) <= MOST_BEHIND
        };
        self.stamp == newest.stamp && is_near(self.events, places.events) && is_near(self.decisions, places.decisions)
    }
}

impl fmt::Display for Cursor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:08x}-{}-{}", self.stamp, self.events, self.decisions)
    }
}

/// What a client is told.
struct Live {
    events: LogWatch<EventLog>,
    decisions: LogWatch<DecisionLog>,
    floor: FloorReader,
    draining: CancellationToken,
    heartbeat: Duration,
    /// The first words.
    greeting: Option<String>,
    /// How far the client has been told.
    told: Cursor,
    /// When the last words were sent.
    sent_at: Instant,
    /// When the stream began.
    begun: Instant,
    /// Where its turns are in the time of [`PACE`]: streams that hear the same bell do not all write at the same moment.
    phase: Duration,
    /// There was more than is said together.
    is_behind: bool,
}

/// How long it is to the next turn of a stream.
fn to_turn(elapsed: Duration, phase: Duration) -> Duration {
    let since = (elapsed + PACE - phase).as_nanos() % PACE.as_nanos();
    PACE - Duration::from_nanos(u64::try_from(since).unwrap_or(0))
}

impl Live {
    async fn new(api: &Api, last: Option<&str>, heartbeat: Duration) -> Result<Self> {
        let (store, tenant) = (api.store.of_all_tenants(), api.caller.tenant());
        // Looked at first: what comes meanwhile is behind these.
        let [all_events, all_decisions] =
            [api.store.watch_events(), api.store.watch_decisions()].map(|newest| *newest.borrow());
        let places = store.log_places(tenant).await?;
        let newest = Cursor::newest(&places, tenant);
        let asked = last.map(Cursor::parse);
        let resumed = asked.flatten().filter(|cursor| cursor.can_go_on(&places, newest));
        let told = resumed.unwrap_or(newest);
        // Who was told of everything need not ask what is between that and the newest record of all.
        let from = |told: i64, newest: i64, all: i64| Some(if told == newest { told.max(all) } else { told });
        let (events, decisions) =
            (from(told.events, newest.events, all_events), from(told.decisions, newest.decisions, all_decisions));
        let filter = LogFilter::of_tenant(tenant);
        // Who reads comments knows by this how long a silence is none.
        let heartbeat_s = heartbeat.as_secs();
        let mut greeting = format!(": heartbeat {heartbeat_s} s\nretry: {RETRY_MS}\nid: {told}\n\n");
        if asked.is_some() && resumed.is_none() {
            greeting.push_str("event: reset\ndata: {}\n\n");
        }
        Ok(Self {
            events: LogWatch::new(store, &api.recent_events, events, filter),
            decisions: LogWatch::new(store, &api.recent_decisions, decisions, filter),
            // Its turns are to fit in whatever the clock makes of them.
            floor: api.floor().reader(None).every(STATES_EVERY - PACE / 2),
            draining: api.engine.draining().clone(),
            heartbeat,
            greeting: Some(greeting),
            told,
            sent_at: Instant::now(),
            begun: Instant::now(),
            phase: PACE.mul_f64(f64::from(RandomState::new().hash_one(()) as u32) / f64::from(u32::MAX)),
            is_behind: false,
        })
    }

    /// The next words, and when they were sent.
    async fn sent(&mut self) -> Result<Option<Bytes>> {
        let words = self.next().await?;
        self.sent_at = Instant::now();
        Ok(words)
    }

    /// The next words; `None` where the stream ends.
    async fn next(&mut self) -> Result<Option<Bytes>> {
        if let Some(greeting) = self.greeting.take() {
            return Ok(Some(greeting.into()));
        }
        loop {
            let silent_until = self.sent_at + self.heartbeat;
            let goes_on = tokio::select! {
                biased;
                () = self.draining.cancelled() => false,
                is_open = self.events.is_ready() => is_open,
                is_open = self.decisions.is_ready() => is_open,
                is_open = self.floor.is_ready() => is_open,
                () = sleep_until(silent_until) => return Ok(Some(format!(":\nid: {}\n\n", self.told).into())),
            };
            if !goes_on {
                return Ok(None);
            }
            if !self.is_behind {
                sleep(to_turn(self.begun.elapsed(), self.phase)).await;
            }
            let words = self.news().await?;
            if !words.is_empty() {
                return Ok(Some(words.into()));
            }
        }
    }

    /// What there is to be said now. The texts are those that all streams share.
    async fn news(&mut self) -> Result<Vec<u8>> {
        let mut text = Vec::new();
        self.events.fill().await?;
        while let Some(event) = (text.len() < MOST_TOGETHER).then(|| self.events.pop()).flatten() {
            self.told.events = event.sequence;
            record(&mut text, self.told, "job", event.json());
        }
        self.decisions.fill().await?;
        while let Some(decision) = (text.len() < MOST_TOGETHER).then(|| self.decisions.pop()).flatten() {
            self.told.decisions = decision.sequence;
            record(&mut text, self.told, "decision", decision.json());
        }
        self.is_behind = text.len() >= MOST_TOGETHER;
        if self.floor.is_ready().now_or_never() == Some(true) {
            states(&self.floor.changes(), &mut text);
        }
        Ok(text)
    }
}

fn record(text: &mut Vec<u8>, id: Cursor, kind: &str, json: &str) {
    let head = format!("id: {id}\nevent: {kind}\ndata: ");
    for part in [&head, json, "\n\n"] {
        text.extend_from_slice(part.as_bytes());
    }
}

/// States as events. They have no id: who comes back is told the newest ones anyway.
fn states(changes: &Changes, text: &mut Vec<u8>) {
    for shown in &changes.states {
        text.extend_from_slice(b"event: state\ndata: ");
        text.extend_from_slice(shown.json());
        text.extend_from_slice(b"\n\n");
    }
    for id in &changes.gone {
        let gone = json!({ "machine": names::machine(id) });
        text.extend_from_slice(format!("event: gone\ndata: {gone}\n\n").as_bytes());
    }
}

/// `GET /v1/stream`
pub(super) async fn follow(
    State(state): State<HttpState>,
    api: Api,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Answer {
    Query::parse(raw.as_deref()).finish()?;
    let last = headers.get(LAST_EVENT_ID).map(|value| value.to_str().unwrap_or_default());
    let live = Live::new(&api, last, state.heartbeat).await?;
    let words = stream::try_unfold(live, async |mut live| {
        let next = live.sent().await;
        if let Err(error) = &next {
            tracing::warn!(%error, "a stream of events ended");
        }
        Ok::<_, Error>(next?.map(|words| (words, live)))
    });
    let mut response = Body::from_stream(words).into_response();
    for (name, value) in [
        (header::CONTENT_TYPE, "text/event-stream"),
        (header::CACHE_CONTROL, "no-cache"),
        // Proxies would gather events otherwise.
        (header::HeaderName::from_static("x-accel-buffering"), "no"),
    ] {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    Ok(response)
}

/// A body that can be ended from outside when nobody reads it.
pub(super) struct WatchedBody(Arc<Watched>);

/// What the connection and whoever watches over it share.
pub(super) struct Watched(Mutex<Reading>);

struct Reading {
    /// The rest; `None` once it was ended.
    rest: Option<Body>,
    /// When the last frame was handed over, while the next one has not been asked for.
    waiting_since: Option<Instant>,
}

impl WatchedBody {
    pub(super) fn new(body: Body) -> Self {
        Self(Arc::new(Watched(Mutex::new(Reading { rest: Some(body), waiting_since: None }))))
    }

    /// What can be ended from outside.
    pub(super) fn watched(&self) -> Arc<Watched> {
        self.0.clone()
    }
}

impl http_body::Body for WatchedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let mut reading = self.0.0.lock().unwrap_or_else(PoisonError::into_inner);
        reading.waiting_since = None;
        let Some(rest) = &mut reading.rest else {
            return Poll::Ready(Some(Err(axum::Error::new("the stream was not read"))));
        };
        let polled = Pin::new(rest).poll_frame(cx);
        if let Poll::Ready(Some(Ok(_))) = &polled {
            reading.waiting_since = Some(Instant::now());
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        let reading = self.0.0.lock().unwrap_or_else(PoisonError::into_inner);
        reading.rest.as_ref().is_some_and(http_body::Body::is_end_stream)
    }

    fn size_hint(&self) -> SizeHint {
        let reading = self.0.0.lock().unwrap_or_else(PoisonError::into_inner);
        reading.rest.as_ref().map(http_body::Body::size_hint).unwrap_or_default()
    }
}

impl Unread for Watched {
    fn end_if_unread(&self, since: Instant) {
        let mut reading = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if reading.waiting_since.is_some_and(|waiting| waiting <= since) {
            reading.rest = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cursor_is_a_stamp_and_two_places_and_nothing_else() {
        let cursor = Cursor { stamp: 0x5c_e1d3, events: 7, decisions: 12 };
        assert_eq!(Cursor::parse("005ce1d3-7-12"), Some(cursor));
        assert_eq!(cursor.to_string(), "005ce1d3-7-12");
        let stamped = ["7", "7-", "-7", "+7-1", "7-12-1", "7--12", "a-b", "99999999999999999999-1"];
        for text in stamped.map(|places| format!("005ce1d3-{places}")) {
            assert_eq!(Cursor::parse(&text), None, "{text}");
        }
        for text in ["", "7-12", "5ce1d3-7-12", "005CE1D3-7-12", "+05ce1d3-7-12", "0005ce1d3-7-12"] {
            assert_eq!(Cursor::parse(text), None, "{text}");
        }
    }

    #[test]
    fn a_client_goes_on_where_all_that_it_missed_is_there() {
        let log = |removed, newest| LogPlace { removed, newest };
        let places = LogPlaces { store: [1, 2], events: log(3, 9), decisions: log(0, 20_000) };
        let newest = Cursor::newest(&places, Tenant::DEFAULT);
        assert!(newest.can_go_on(&places, newest));
        for (events, decisions, goes_on) in [
            (3, 20_000, true),
            (2, 20_000, false),
            (10, 20_000, false),
            (9, 10_000, true),
            (9, 9_999, false),
            (9, 20_001, false),
        ] {
            let cursor = Cursor { events, decisions, ..newest };
            assert_eq!(cursor.can_go_on(&places, newest), goes_on, "{cursor}");
        }
        // Of another store, and of another tenant.
        let elsewhere = Cursor::newest(&LogPlaces { store: [1, 3], ..places }, Tenant::DEFAULT);
        let other = Cursor::newest(&places, "other".parse().unwrap());
        assert!(!elsewhere.can_go_on(&places, newest) && !other.can_go_on(&places, newest));
    }

    #[test]
    fn turns_are_as_far_apart_as_they_should_be_and_each_stream_has_its_own() {
        let ms = Duration::from_millis;
        for (elapsed, phase, expected) in [(0, 0, 250), (0, 30, 30), (29, 30, 1), (30, 30, 250), (281, 30, 249)] {
            assert_eq!(to_turn(ms(elapsed), ms(phase)), ms(expected), "{elapsed} {phase}");
        }
        assert_eq!(to_turn(ms(0), PACE), PACE);
    }
}
