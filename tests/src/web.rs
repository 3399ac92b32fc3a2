//! A plain HTTP/1.1 client.

use std::net::SocketAddr;

use bytes::Bytes;
use http::{HeaderMap, Request, StatusCode};
use http_body_util::{BodyExt, Full};
use hyper::body::Incoming;
use hyper_util::client::legacy::Client;
use hyper_util::client::legacy::connect::HttpConnector;
use hyper_util::rt::TokioExecutor;

/// A client of one address.
pub struct Web {
    address: SocketAddr,
    client: Client<HttpConnector, Full<Bytes>>,
}

/// An answer, read to its end.
#[derive(Debug)]
pub struct Answer {
    /// Status.
    pub status: StatusCode,
    /// Headers.
    pub headers: HeaderMap,
    /// Body.
    pub body: Bytes,
}

impl Answer {
    /// A header as text; empty where there is none.
    #[must_use]
    pub fn header(&self, name: &str) -> &str {
        self.headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default()
    }

    /// The body as text.
    ///
    /// # Panics
    /// When it is not UTF-8.
    #[must_use]
    pub fn text(&self) -> &str {
        std::str::from_utf8(&self.body).expect("a text")
    }

    /// The body as JSON.
    ///
    /// # Panics
    /// When it is not JSON.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| panic!("{error}: {:?}", self.body))
    }
}

impl Web {
    /// A client of `address`.
    #[must_use]
    pub fn new(address: SocketAddr) -> Self {
        Self { address, client: Client::builder(TokioExecutor::new()).build_http() }
    }

    /// `GET`
    ///
    /// # Panics
    /// When there is no answer.
    pub async fn get(&self, path: &str) -> Answer {
        self.send("GET", path, &[], Bytes::new()).await
    }

    /// `GET` of an answer that goes on.
    ///
    /// # Panics
    /// When there is no answer.
    pub async fn open(&self, path: &str, headers: &[(&str, &str)]) -> Open {
        let mut request = Request::builder().method("GET").uri(format!("http://{}{path}", self.address));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let request = request.body(Full::new(Bytes::new())).expect("a valid request");
        let response = self.client.request(request).await.expect("an answer");
        let (parts, body) = response.into_parts();
        Open { status: parts.status, headers: parts.headers, body, read: Vec::new() }
    }

    /// Any request.
    ///
    /// # Panics
    /// When there is no answer.
    pub async fn send(&self, method: &str, path: &str, headers: &[(&str, &str)], body: Bytes) -> Answer {
        let mut request = Request::builder().method(method).uri(format!("http://{}{path}", self.address));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let request = request.body(Full::new(body)).expect("a valid request");
        let response = self.client.request(request).await.expect("an answer");
        let (parts, body) = response.into_parts();
        let body = body.collect().await.expect("the whole answer").to_bytes();
        Answer { status: parts.status, headers: parts.headers, body }
    }
}

/// An answer that goes on.
pub struct Open {
    /// Status.
    pub status: StatusCode,
    /// Headers.
    pub headers: HeaderMap,
    body: Incoming,
    read: Vec<u8>,
}

/// A block of a stream of server-sent events.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServerEvent {
    /// Its place; empty where it has none.
    pub id: String,
    /// What it is; empty where it does not say.
    pub event: String,
    /// Its data as JSON; null where it has none.
    pub data: serde_json::Value,
}

impl Open {
    /// The next bytes up to the end of what `ends` finds in those read; `None` when the answer ends before.
    ///
    /// # Panics
    /// When the connection breaks.
    pub async fn next_part(&mut self, ends: impl Fn(&[u8]) -> Option<usize>) -> Option<Vec<u8>> {
        loop {
            if let Some(end) = ends(&self.read) {
                let rest = self.read.split_off(end);
                return Some(std::mem::replace(&mut self.read, rest));
            }
            let frame = self.body.frame().await?.expect("the connection holds");
            if let Ok(data) = frame.into_data() {
                self.read.extend_from_slice(&data);
            }
        }
    }

    /// The next server-sent event; a comment is one without anything. `None` when the stream ends.
    ///
    /// # Panics
    /// When the connection breaks, or what comes is no such event.
    pub async fn next_event(&mut self) -> Option<ServerEvent> {
        let ends = |read: &[u8]| read.windows(2).position(|pair| pair == b"\n\n").map(|at| at + 2);
        let block = String::from_utf8(self.next_part(ends).await?).expect("a text");
        let mut event = ServerEvent::default();
        for line in block.lines().filter(|line| !line.is_empty()) {
            match line.split_once(": ") {
                Some(("id", id)) => id.clone_into(&mut event.id),
                Some(("event", name)) => name.clone_into(&mut event.event),
                Some(("data", data)) => event.data = serde_json::from_str(data).expect("JSON"),
                Some(("retry", ms)) => assert!(ms.parse::<u32>().is_ok(), "{line}"),
                _ => assert!(line.starts_with(':'), "{line}"),
            }
        }
        Some(event)
    }
}
