//! What a service keeps: `feedwave machine`, `feedwave tool`, `feedwave job`.

mod collection;
pub mod jobs;
pub mod machines;
pub mod programs;
pub mod tools;

use std::path::Path;

use prost_types::Timestamp;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

use super::CliError;
use super::client::Client;
use super::terminal::print;

/// The resource name of what people may call by its identifier alone.
pub(super) fn full_name(collection: &str, text: &str) -> String {
    if text.contains('/') { text.to_owned() } else { format!("{collection}/{text}") }
}

/// The resource that a file is put to: named by the file, on the command line, or by both alike.
fn target(collection: &str, path: &Path, stated: &str, asked: Option<&str>) -> Result<String, CliError> {
    let place = path.display();
    let asked = asked.map(|asked| full_name(collection, asked));
    match (stated, asked) {
        ("", None) => Err(CliError::trouble(format!(
            "{place}: name: must be set, such as \"{collection}/my-1\", or the name given behind the file"
        ))),
        ("", Some(asked)) => Ok(asked),
        (stated, Some(asked)) if asked != stated => Err(CliError::trouble(format!(
            "{place}: name: is {stated}, not {asked}: to make a copy, take name and etag out of the file"
        ))),
        (stated, _) => Ok(stated.to_owned()),
    }
}

/// A request that the service refused, every violation on a line of its own.
fn refused(client: &Client, status: &Status) -> CliError {
    let request = status.get_details_bad_request();
    let violations = request.iter().flat_map(|request| &request.field_violations);
    let lines: Vec<_> =
        violations.map(|violation| format!("{}: {}: {}", client.url, violation.field, violation.description)).collect();
    if lines.is_empty() { client.failed(status) } else { CliError::trouble(lines.join("\n")) }
}

/// What `put` did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Put {
    Created,
    Replaced,
}

impl Put {
    fn tell(self, name: &str) -> Result<(), CliError> {
        let what = match self {
            Self::Created => "created",
            Self::Replaced => "replaced",
        };
        print(&format!("{name}: {what}\n"))
    }
}

/// Replaces a resource, or creates it where it is not there. Whoever states an etag means one that is there.
async fn put(
    client: &Client,
    name: &str,
    etag: &str,
    update: impl AsyncFn() -> Result<(), Status>,
    create: impl AsyncFn() -> Result<(), Status>,
) -> Result<Put, CliError> {
    // Once more where another client creates it in between.
    for _ in 0..2 {
        match update().await {
            Ok(()) => return Ok(Put::Replaced),
            Err(status) if status.code() == Code::NotFound && etag.is_empty() => {}
            Err(status) if status.code() == Code::NotFound => {
                return Err(CliError::trouble(format!(
                    "{}: {name} is not there any more; without etag the file creates it anew",
                    client.url
                )));
            }
            Err(status) => return Err(refused(client, &status)),
        }
        match create().await {
            Ok(()) => return Ok(Put::Created),
            Err(status) if status.code() == Code::AlreadyExists => {}
            Err(status) => return Err(refused(client, &status)),
        }
    }
    Err(CliError::trouble(format!("{}: {name} is created and deleted by others at the same time", client.url)))
}

/// A time for people; nothing where there is none.
fn time(time: Option<&Timestamp>) -> String {
    time.map(ToString::to_string).unwrap_or_default()
}

/// Lines of names and values; those without a value are left out.
fn card(lines: &[(&str, String)]) -> String {
    let known = lines.iter().filter(|(_, value)| !value.is_empty());
    known.map(|(name, value)| format!("{name:<14} {value}\n")).collect()
}

/// The name of an enumeration's value as words.
fn words(name: &str, prefix: &str) -> String {
    match name.trim_start_matches(prefix) {
        "UNSPECIFIED" => String::new(),
        name => name.to_lowercase().replace('_', " "),
    }
}
