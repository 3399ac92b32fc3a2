//! What is between the network and the services: connections, their encryption, and the share of every client.

mod clients;
mod connection;
mod frames;
mod giving_way;
mod listener;
mod refusal;
mod request;
mod tls;

pub(crate) use clients::{Clients, Held, Resource};
pub(crate) use connection::{Connection, OpenCall, Unread};
pub(crate) use listener::{App, Port, app};
pub(crate) use refusal::in_json;
pub(crate) use request::{RequestBody, RequestMemory};
pub(crate) use tls::{Tls, TlsError, client_config};
