//! What every client has taken up of the service, and how much that may be.

use std::collections::HashMap;
use std::fmt;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::config::ConnectionLimits;
use crate::error::Error;
use crate::observability::metrics::ConnectionMetrics;

/// Who takes something up.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum ClientKey {
    /// An address; of IPv6 the first 64 bits, as one host has all that begin with them.
    Address(IpAddr),
    /// Subject of a verified certificate.
    Subject(Arc<str>),
}

impl ClientKey {
    /// The client behind an address.
    pub(crate) fn of_address(address: IpAddr) -> Self {
        Self::Address(match address.to_canonical() {
            IpAddr::V6(ip) => IpAddr::V6(Ipv6Addr::from_bits(ip.to_bits() & !u128::from(u64::MAX))),
            ip => ip,
        })
    }
}

impl fmt::Display for ClientKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Address(address) => address.fmt(f),
            Self::Subject(subject) => f.write_str(subject),
        }
    }
}

/// What a client can take up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Resource {
    /// An open connection.
    Connection,
    /// A unary call or an HTTP request in progress.
    Call,
    /// An open stream that is no watcher.
    Stream,
    /// An open stream of events that waits for the next one.
    Watcher,
}

impl Resource {
    const fn name(self) -> &'static str {
        match self {
            Self::Connection => "open connections",
            Self::Call => "calls in progress",
            Self::Stream => "open streams",
            Self::Watcher => "open watchers",
        }
    }
}

/// Bytes of requests, in words.
const REQUEST_BYTES: &str = "bytes of requests under way";

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    connections: u64,
    calls: u64,
    streams: u64,
    watchers: u64,
    request_bytes: u64,
}

impl Counts {
    const fn of(&mut self, resource: Resource) -> &mut u64 {
        match resource {
            Resource::Connection => &mut self.connections,
            Resource::Call => &mut self.calls,
            Resource::Stream => &mut self.streams,
            Resource::Watcher => &mut self.watchers,
        }
    }
}

#[derive(Debug, Default)]
struct Ledger {
    total: Counts,
    /// Clients that have anything.
    clients: HashMap<ClientKey, Counts>,
}

/// The account of all clients of both ports.
#[derive(Debug)]
pub(crate) struct Clients {
    limits: ConnectionLimits,
    metrics: ConnectionMetrics,
    ledger: Mutex<Ledger>,
}

impl Clients {
    pub(crate) fn new(limits: ConnectionLimits, metrics: ConnectionMetrics) -> Arc<Self> {
        Arc::new(Self { limits, metrics, ledger: Mutex::default() })
    }

    pub(crate) const fn limits(&self) -> &ConnectionLimits {
        &self.limits
    }

    pub(crate) const fn metrics(&self) -> &ConnectionMetrics {
        &self.metrics
    }

    fn ledger(&self) -> MutexGuard<'_, Ledger> {
        // Numbers are added and taken away in one go, so a poisoned account is right.
        self.ledger.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How many there may be in all, and of one client, with the keys that say so.
    fn bounds(&self, resource: Resource) -> (Option<usize>, usize, &'static str) {
        let limits = &self.limits;
        match resource {
            Resource::Connection => (Some(limits.total), limits.per_client, "connections.per_client"),
            Resource::Call => (None, limits.calls_per_client, "connections.calls_per_client"),
            Resource::Stream => (None, limits.streams_per_client, "connections.streams_per_client"),
            Resource::Watcher => (Some(limits.watchers), limits.watchers_per_client, "connections.watchers_per_client"),
        }
    }

    /// Takes one up, until what is returned is dropped.
    ///
    /// # Errors
    /// [`Error::ClientOverloaded`] and [`Error::Overloaded`] where there are too many.
    pub(crate) fn take(self: &Arc<Self>, client: &ClientKey, resource: Resource) -> Result<Held, Error> {
        let (in_all, of_one, key) = self.bounds(resource);
        let taken = {
            let mut ledger = self.ledger();
            let own = *ledger.clients.get(client).copied().unwrap_or_default().of(resource);
            let all = *ledger.total.of(resource);
            if own >= of_one as u64 {
                Err(Error::ClientOverloaded { what: resource.name(), limit: of_one as u64, key })
            } else if let Some(limit) = in_all.filter(|limit| all >= *limit as u64) {
                Err(Error::Overloaded { what: resource.name(), limit: limit as u64 })
            } else {
                *ledger.total.of(resource) += 1;
                *ledger.clients.entry(client.clone()).or_default().of(resource) += 1;
                Ok(())
            }
        };
        match taken {
            Ok(()) => {
                self.metrics.held(resource).inc();
                Ok(Held { clients: self.clone(), client: client.clone(), resource })
            }
            Err(error) => {
                self.metrics.refused(resource.name());
                Err(error)
            }
        }
    }

    /// An account for the bytes of one request.
    pub(crate) fn request_bytes(self: &Arc<Self>, client: &ClientKey) -> RequestBytes {
        RequestBytes { clients: self.clone(), client: client.clone(), bytes: 0 }
    }

    fn change(&self, client: &ClientKey, change: impl Fn(&mut Counts)) {
        let mut ledger = self.ledger();
        change(&mut ledger.total);
        if let Some(counts) = ledger.clients.get_mut(client) {
            change(counts);
            if *counts == Counts::default() {
                ledger.clients.remove(client);
            }
        }
    }
}

/// Something that a client has taken up, until it is dropped.
#[derive(Debug)]
pub(crate) struct Held {
    clients: Arc<Clients>,
    client: ClientKey,
    resource: Resource,
}

impl Drop for Held {
    fn drop(&mut self) {
        self.clients.change(&self.client, |counts| *counts.of(self.resource) -= 1);
        self.clients.metrics.held(self.resource).dec();
    }
}

/// Bytes of a request that are held in memory, until they are given back.
#[derive(Debug)]
pub(crate) struct RequestBytes {
    clients: Arc<Clients>,
    client: ClientKey,
    bytes: u64,
}

impl RequestBytes {
    /// Takes up more.
    ///
    /// # Errors
    /// [`Error::ClientOverloaded`] and [`Error::Overloaded`] where there are too many.
    pub(crate) fn take(&mut self, bytes: u64) -> Result<(), Error> {
        let limits = &self.clients.limits;
        let mut ledger = self.clients.ledger();
        let own = ledger.clients.get(&self.client).map_or(0, |counts| counts.request_bytes);
        let refused = if own + bytes > limits.request_bytes_per_client {
            let (limit, key) = (limits.request_bytes_per_client, "connections.request_bytes_per_client");
            Some(Error::ClientOverloaded { what: REQUEST_BYTES, limit, key })
        } else if ledger.total.request_bytes + bytes > limits.request_bytes {
            Some(Error::Overloaded { what: REQUEST_BYTES, limit: limits.request_bytes })
        } else {
            None
        };
        if let Some(error) = refused {
            drop(ledger);
            self.clients.metrics.refused(REQUEST_BYTES);
            return Err(error);
        }
        ledger.total.request_bytes += bytes;
        ledger.clients.entry(self.client.clone()).or_default().request_bytes += bytes;
        self.clients.metrics.request_bytes.add(bytes.try_into().unwrap_or(i64::MAX));
        self.bytes += bytes;
        Ok(())
    }

    /// Takes these up in place of all others.
    ///
    /// # Errors
    /// As [`RequestBytes::take`], and [`Error::MessageTooCostly`] where a client may not have as many at any time.
    pub(crate) fn replace(&mut self, bytes: u64) -> Result<(), Error> {
        self.give_back();
        let limits = &self.clients.limits;
        let bounds = [
            (limits.request_bytes_per_client, "connections.request_bytes_per_client"),
            (limits.request_bytes, "connections.request_bytes"),
        ];
        if let Some((limit, key)) = bounds.into_iter().find(|(limit, _)| bytes > *limit) {
            self.clients.metrics.refused(REQUEST_BYTES);
            return Err(Error::MessageTooCostly { bytes, limit, key });
        }
        self.take(bytes)
    }

    /// Gives all back.
    pub(crate) fn give_back(&mut self) {
        let bytes = std::mem::take(&mut self.bytes);
        if bytes > 0 {
            self.clients.change(&self.client, |counts| counts.request_bytes -= bytes);
            self.clients.metrics.request_bytes.sub(bytes.try_into().unwrap_or(i64::MAX));
        }
    }
}

impl Drop for RequestBytes {
    fn drop(&mut self) {
        self.give_back();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observability::metrics::Metrics;

    fn clients(limits: ConnectionLimits) -> Arc<Clients> {
        Clients::new(limits, Metrics::new().connections)
    }

    fn address(text: &str) -> ClientKey {
        ClientKey::of_address(text.parse().unwrap())
    }

    #[test]
    fn one_client_has_its_share_and_all_have_what_there_is() {
        let limits = ConnectionLimits { watchers: 3, watchers_per_client: 2, ..ConnectionLimits::default() };
        let clients = clients(limits);
        let (one, other) = (address("10.0.0.1"), address("10.0.0.2"));
        let take = |client| clients.take(client, Resource::Watcher);
        let held = [take(&one).unwrap(), take(&one).unwrap()];
        let error = take(&one).unwrap_err();
        assert_eq!((error.reason(), error.http_status().as_u16()), ("CLIENT_LIMIT", 429));
        let _third = take(&other).unwrap();
        let error = take(&other).unwrap_err();
        assert_eq!((error.reason(), error.http_status().as_u16()), ("OVERLOADED", 503));
        // Other things are as free as before, and what is given back can be taken again.
        clients.take(&one, Resource::Call).unwrap();
        drop(held);
        take(&other).unwrap();
    }

    #[test]
    fn clients_that_have_nothing_are_forgotten() {
        let clients = clients(ConnectionLimits::default());
        for last in 0..100_u8 {
            let client = ClientKey::of_address(IpAddr::from([10, 0, 0, last]));
            let _held = clients.take(&client, Resource::Connection).unwrap();
            clients.request_bytes(&client).take(1_000).unwrap();
        }
        let ledger = clients.ledger();
        assert!(ledger.clients.is_empty());
        assert_eq!(ledger.total, Counts::default());
    }

    #[test]
    fn bytes_of_requests_are_bounded_for_one_and_for_all() {
        let limits = ConnectionLimits { request_bytes: 10, request_bytes_per_client: 6, ..ConnectionLimits::default() };
        let clients = clients(limits);
        let (mut one, mut other) =
            (clients.request_bytes(&address("10.0.0.1")), clients.request_bytes(&address("::1")));
        one.take(6).unwrap();
        assert_eq!(one.take(1).unwrap_err().reason(), "CLIENT_LIMIT");
        other.take(4).unwrap();
        assert_eq!(other.take(1).unwrap_err().reason(), "OVERLOADED");
        one.give_back();
        other.take(1).unwrap();
        drop((one, other));
        assert_eq!(clients.metrics.request_bytes.get(), 0);
    }

    #[test]
    fn a_network_of_one_host_is_one_client() {
        assert_eq!(address("2001:db8::1"), address("2001:db8::ffff:2"));
        assert_ne!(address("2001:db8::1"), address("2001:db8:0:1::1"));
        assert_eq!(address("::ffff:10.0.0.1"), address("10.0.0.1"));
    }
}
