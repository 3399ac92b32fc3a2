//! What a client asks of the agent.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use http::{HeaderMap, StatusCode};
use percent_encoding::percent_decode_str;

use super::buffer::ItemKey;
use super::path::{self, PathError};
use super::{Agent, Observations};
use crate::accept::{self, Offer};

/// Observations of an answer where the client does not say.
const DEFAULT_COUNT: i64 = 100;
/// How long a stream says nothing at most, where the client does not say, ms.
const DEFAULT_HEARTBEAT_MS: u64 = 10_000;
/// Longest interval and heartbeat, ms: a day.
const MAX_MS: u64 = 86_400_000;

/// Why a request is not answered, in words of the standard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Refusal {
    pub(super) status: StatusCode,
    pub(super) code: &'static str,
    pub(super) message: String,
}

impl Refusal {
    pub(super) fn new(status: StatusCode, code: &'static str, message: impl Into<String>) -> Self {
        Self { status, code, message: message.into() }
    }

    fn out_of_range(message: String) -> Self {
        Self::new(StatusCode::BAD_REQUEST, "OUT_OF_RANGE", message)
    }

    fn malformed(message: String) -> Self {
        Self::new(StatusCode::BAD_REQUEST, "INVALID_REQUEST", message)
    }
}

/// How documents are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Xml,
    Json,
}

const FORMS: [Offer<Form>; 2] = [
    Offer {
        form: Form::Xml,
        types: &["application/xml", "text/xml", "application/mtconnect+xml", "application/xhtml+xml"],
    },
    Offer { form: Form::Json, types: &["application/mtconnect+json", "application/json", "text/json"] },
];

impl Form {
    pub(super) const fn content_type(self) -> &'static str {
        match self {
            Self::Xml => "application/xml",
            Self::Json => "application/mtconnect+json",
        }
    }

    /// The form that a request is answered in: as `format` says, as `Accept` prefers, or XML.
    pub(super) fn of(parameters: &Parameters, headers: &HeaderMap) -> Self {
        match parameters.get("format") {
            Some("json") => return Self::Json,
            Some("xml") => return Self::Xml,
            _ => {}
        }
        accept::preferred(headers, &FORMS).unwrap_or(Self::Xml)
    }
}

/// The parameters of a query; of one that is there more than once the first counts.
#[derive(Debug, Default)]
pub(super) struct Parameters(Vec<(String, String)>);

impl Parameters {
    pub(super) fn parse(query: Option<&str>) -> Self {
        let decode = |text: &str| percent_decode_str(&text.replace('+', " ")).decode_utf8_lossy().into_owned();
        let pairs = query.unwrap_or_default().split('&').filter(|pair| !pair.is_empty());
        let pair = |pair: &str| {
            let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
            (decode(name), decode(value))
        };
        Self(pairs.map(pair).collect())
    }

    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    /// A whole number.
    fn number(&self, name: &str) -> Result<Option<i64>, Refusal> {
        let Some(text) = self.get(name) else { return Ok(None) };
        let digits = text.strip_prefix('-').unwrap_or(text);
        if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
            return Err(Refusal::malformed(format!("'{name}' must be a whole number")));
        }
        // Digits that are too many for the type are out of any range.
        Ok(Some(text.parse().unwrap_or(if text.starts_with('-') { i64::MIN } else { i64::MAX })))
    }

    /// A number of milliseconds of at least `least`.
    fn milliseconds(&self, name: &str, least: u64) -> Result<Option<Duration>, Refusal> {
        let Some(number) = self.number(name)? else { return Ok(None) };
        let range = least..=MAX_MS;
        let number = u64::try_from(number).ok().filter(|number| range.contains(number));
        let out = || Refusal::out_of_range(format!("'{name}' must be {least} to {MAX_MS} ms"));
        number.map(Duration::from_millis).map(Some).ok_or_else(out)
    }
}

/// Sort of a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Target {
    Probe,
    Current,
    Sample,
}

/// What is asked, and of which device; `None`: of all.
///
/// A path of one segment that is a request is that request, one of two whose last one is `probe`, `current` or `sample` is of the device
/// that the first one names, whatever that is called: `/assets` asks for assets, `/assets/current` for the machine `assets`.
pub(super) fn target(path: &str) -> Result<(Target, Option<String>), Refusal> {
    let invalid = || Refusal::new(StatusCode::NOT_FOUND, "INVALID_URI", format!("{} is not answered", shortened(path)));
    let no_assets = || Refusal::new(StatusCode::NOT_FOUND, "UNSUPPORTED", "this agent has no assets");
    let decoded: Vec<String> = path
        .split('/')
        .filter(|segment| !segment.is_empty())
        .map(|segment| percent_decode_str(segment).decode_utf8_lossy().into_owned())
        .collect();
    let verb = |word: &str| match word {
        "probe" => Some(Target::Probe),
        "current" => Some(Target::Current),
        "sample" => Some(Target::Sample),
        _ => None,
    };
    let is_of_assets = |word: &str| matches!(word, "asset" | "assets");
    let segments: Vec<&str> = decoded.iter().map(String::as_str).collect();
    match segments.as_slice() {
        [] => Ok((Target::Probe, None)),
        [word] if is_of_assets(word) => Err(no_assets()),
        [word] => Ok(match verb(word) {
            Some(target) => (target, None),
            None => (Target::Probe, Some((*word).to_owned())),
        }),
        [device, word] => match verb(word) {
            Some(target) => Ok((target, Some((*device).to_owned()))),
            None if is_of_assets(device) || is_of_assets(word) => Err(no_assets()),
            None => Err(invalid()),
        },
        _ => Err(invalid()),
    }
}

/// A text of a client as answers repeat it.
fn shortened(text: &str) -> String {
    text.chars().take(80).collect()
}

/// The number of the device with this name.
pub(super) fn known(observations: &Observations, name: &str) -> Result<u32, Refusal> {
    let message = || format!("there is no device {}", shortened(name));
    observations.named(name).ok_or_else(|| Refusal::new(StatusCode::NOT_FOUND, "NO_DEVICE", message()))
}

/// What is wanted of the observations.
#[derive(Clone, Debug)]
pub(super) struct Wanted {
    /// Name of the device; `None`: all.
    device: Option<String>,
    path: Option<String>,
    /// The model that the items are of.
    model: u64,
    /// Only these items.
    pub(super) items: Arc<BTreeSet<ItemKey>>,
}

impl Wanted {
    /// The items of one device or all, or those of them that `path` selects.
    pub(super) fn of(observations: &Observations, device: Option<&str>, path: Option<&str>) -> Result<Self, Refusal> {
        let number = device.map(|name| known(observations, name)).transpose()?;
        let is_of = |item: &ItemKey| number.is_none_or(|number| item.0 == number);
        let mut items = match path {
            None => Agent::all_items(observations),
            Some(text) => {
                let invalid = |why: String| Refusal::new(StatusCode::BAD_REQUEST, "INVALID_XPATH", why);
                path::select(text, observations.shown().into_values()).map_err(|error| match error {
                    PathError::Syntax(why) => invalid(format!("'path' cannot be read: {why}")),
                    PathError::Nothing => invalid("'path' selects no data item".to_owned()),
                })?
            }
        };
        items.retain(is_of);
        if items.is_empty() && path.is_some() {
            let message = "'path' selects no data item of this device";
            return Err(Refusal::new(StatusCode::BAD_REQUEST, "INVALID_XPATH", message));
        }
        let [device, path] = [device, path].map(|text| text.map(str::to_owned));
        Ok(Self { device, path, model: observations.model, items: Arc::new(items) })
    }

    /// Looks again for what is wanted, where devices have come, gone or changed since. What was wanted of those that are gone
    /// is wanted on, so that their end is told.
    pub(super) fn renew(&mut self, observations: &Observations) {
        if self.model == observations.model {
            return;
        }
        self.model = observations.model;
        let ended = self.items.iter().filter(|item| observations.has_ended(**item)).copied();
        let found = Self::of(observations, self.device.as_deref(), self.path.as_deref());
        // A machine that is gone may come back.
        let found = found.map(|found| (*found.items).clone()).unwrap_or_default();
        self.items = Arc::new(found.into_iter().chain(ended).collect());
    }

    /// Wants nothing more of devices that are gone.
    pub(super) fn forget_ended(&mut self, observations: &Observations) {
        if self.items.iter().any(|item| observations.has_ended(*item)) {
            let there = self.items.iter().filter(|item| !observations.has_ended(**item)).copied();
            self.items = Arc::new(there.collect());
        }
    }
}

/// Parameters of `current`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct CurrentQuery {
    pub(super) at: Option<u64>,
    pub(super) interval: Option<Duration>,
}

impl CurrentQuery {
    pub(super) fn of(observations: &Observations, parameters: &Parameters) -> Result<Self, Refusal> {
        let interval = parameters.milliseconds("interval", 1)?;
        let at = match parameters.number("at")? {
            None => None,
            Some(_) if interval.is_some() => {
                return Err(Refusal::malformed("'at' and 'interval' exclude each other".to_owned()));
            }
            Some(at) => {
                let (first, last) = (observations.buffer.first(), observations.buffer.last());
                let known = u64::try_from(at).ok().filter(|at| (first..=last).contains(at));
                Some(known.ok_or_else(|| Refusal::out_of_range(format!("'at' must be {first} to {last}")))?)
            }
        };
        Ok(Self { at, interval })
    }
}

/// Parameters of `sample`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SampleQuery {
    /// First observation to look at; where the count is negative, the last one.
    pub(super) from: u64,
    /// The oldest one was meant, whichever it is when it is looked at.
    pub(super) is_from_oldest: bool,
    pub(super) to: u64,
    /// Most observations of an answer.
    pub(super) count: usize,
    pub(super) is_backwards: bool,
    /// Streams, with a document this often at most.
    pub(super) interval: Option<Duration>,
    pub(super) heartbeat: Duration,
}

impl SampleQuery {
    pub(super) fn of(observations: &Observations, parameters: &Parameters) -> Result<Self, Refusal> {
        let buffer = &observations.buffer;
        let (first, last) = (buffer.first(), buffer.last());
        let capacity = i64::try_from(buffer.capacity()).unwrap_or(i64::MAX);
        let count = parameters.number("count")?.unwrap_or(DEFAULT_COUNT.min(capacity));
        if count == 0 || !(-capacity..=capacity).contains(&count) {
            return Err(Refusal::out_of_range(format!("'count' must be 1 to {capacity}, or -{capacity} to -1")));
        }
        let is_backwards = count < 0;
        let interval = parameters.milliseconds("interval", 0)?;
        if is_backwards && interval.is_some() {
            return Err(Refusal::malformed("a negative 'count' and 'interval' exclude each other".to_owned()));
        }
        let heartbeat = parameters.milliseconds("heartbeat", 1)?;
        let asked = parameters.number("from")?;
        let from = match asked {
            None if is_backwards => last,
            None => first,
            Some(from) => {
                let end = buffer.next();
                let known = u64::try_from(from).ok().filter(|from| (first..=end).contains(from));
                known.ok_or_else(|| Refusal::out_of_range(format!("'from' must be {first} to {end}")))?
            }
        };
        let to = match parameters.number("to")? {
            None => u64::MAX,
            Some(_) if is_backwards || interval.is_some() => {
                return Err(Refusal::malformed("'to' goes with neither a negative 'count' nor 'interval'".to_owned()));
            }
            Some(to) => {
                let known = u64::try_from(to).ok().filter(|to| (from..=last).contains(to));
                known.ok_or_else(|| Refusal::out_of_range(format!("'to' must be {from} to {last}")))?
            }
        };
        Ok(Self {
            from,
            is_from_oldest: asked.is_none() && !is_backwards,
            to,
            count: usize::try_from(count.unsigned_abs()).unwrap_or(usize::MAX),
            is_backwards,
            interval,
            heartbeat: heartbeat.unwrap_or(Duration::from_millis(DEFAULT_HEARTBEAT_MS)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::buffer::Observed;
    use super::super::model::Device;
    use super::super::values::Value;
    use super::*;

    fn observations() -> Agent {
        let agent = Agent::new(50);
        agent.observations().put("lathe", "", Device::new("lathe", &[]), 0);
        for number in 0..100 {
            agent.observations().buffer.push((0, 0), 0, Observed::Value(Value::Whole(number)));
        }
        agent
    }

    #[test]
    fn paths_of_requests() {
        assert_eq!(target("/"), Ok((Target::Probe, None)));
        assert_eq!(target("/probe"), Ok((Target::Probe, None)));
        assert_eq!(target("/lathe"), Ok((Target::Probe, Some("lathe".to_owned()))));
        assert_eq!(target("/lathe/sample"), Ok((Target::Sample, Some("lathe".to_owned()))));
        assert_eq!(target("/current/"), Ok((Target::Current, None)));
        // Machines may be called as requests are.
        for name in ["probe", "current", "sample", "asset", "assets"] {
            assert_eq!(target(&format!("/{name}/current")), Ok((Target::Current, Some(name.to_owned()))));
            assert_eq!(target(&format!("/{name}/probe")), Ok((Target::Probe, Some(name.to_owned()))));
        }
        for (path, code) in [
            ("/lathe/nothing", "INVALID_URI"),
            ("/a/b/c", "INVALID_URI"),
            ("/assets", "UNSUPPORTED"),
            ("/asset/7", "UNSUPPORTED"),
            ("/lathe/assets", "UNSUPPORTED"),
            ("/assets/assets", "UNSUPPORTED"),
        ] {
            assert_eq!(target(path).unwrap_err().code, code, "{path}");
        }
    }

    #[test]
    fn every_parameter_has_its_range() {
        let agent = observations();
        let observations = agent.observations();
        let (first, last) = (observations.buffer.first(), observations.buffer.last());
        let code = |query: &str| SampleQuery::of(&observations, &Parameters::parse(Some(query))).map_err(|it| it.code);
        assert!(code("").is_ok());
        assert_eq!(code(&format!("from={}", last + 1)).unwrap().from, last + 1);
        for query in [
            format!("from={}", last + 2),
            format!("from={}", first - 1),
            "from=-1".to_owned(),
            "from=99999999999999999999".to_owned(),
            "count=0".to_owned(),
            "count=51".to_owned(),
            "count=-51".to_owned(),
            "interval=-1".to_owned(),
            "heartbeat=0".to_owned(),
            format!("to={}", last + 1),
            format!("from={last}&to={first}"),
        ] {
            assert_eq!(code(&query), Err("OUT_OF_RANGE"), "{query}");
        }
        for query in ["from=x", "count=", "count=1.5", "interval=1s", "count=-1&interval=0", "to=80&interval=5"] {
            assert_eq!(code(query), Err("INVALID_REQUEST"), "{query}");
        }
        let current =
            |query: &str| CurrentQuery::of(&observations, &Parameters::parse(Some(query))).map_err(|it| it.code);
        assert_eq!(current(&format!("at={first}")).unwrap().at, Some(first));
        assert_eq!(current(&format!("at={}", last + 1)), Err("OUT_OF_RANGE"));
        assert_eq!(current("interval=0"), Err("OUT_OF_RANGE"));
        assert_eq!(current("at=80&interval=5"), Err("INVALID_REQUEST"));
    }

    #[test]
    fn the_form_is_as_asked_or_xml() {
        let form = |query: &str, accept: &'static str| {
            let mut headers = HeaderMap::new();
            headers.insert(http::header::ACCEPT, http::HeaderValue::from_static(accept));
            Form::of(&Parameters::parse(Some(query)), &headers)
        };
        assert_eq!(form("", "*/*"), Form::Xml);
        assert_eq!(form("", "application/json"), Form::Json);
        assert_eq!(form("", "application/mtconnect+json;q=0.5"), Form::Json);
        assert_eq!(form("", "text/html, text/xml, application/json"), Form::Xml);
        assert_eq!(form("", "text/xml;q=0.4, application/json;q=0.5"), Form::Json);
        assert_eq!(form("", "application/json;q=0"), Form::Xml);
        assert_eq!(form("format=json", "text/xml"), Form::Json);
        assert_eq!(form("format=xml", "application/json"), Form::Xml);
    }
}
