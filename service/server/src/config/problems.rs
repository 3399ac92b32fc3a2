//! What makes configuration unusable: values of the right type that still cannot be used.

use std::fmt;
use std::fs::File;

use tracing_subscriber::filter::{LevelFilter, Targets};

use super::{Config, JwtConfig};

/// A key, its value, and the least and the largest that are accepted.
pub(super) type Range = (&'static str, u64, u64, u64);

/// A key, and what is wrong with its value.
pub(super) type Problem = (&'static str, String);

/// One thing that makes configuration unusable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigProblem {
    /// Where it was set: a file, an environment variable, a flag.
    pub place: String,
    /// Its key, such as `grpc.listen`; empty where the problem is with the whole place.
    pub key: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Configuration that cannot be used, with everything that is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigError(pub Vec<ConfigProblem>);

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.0.iter().enumerate() {
            if index > 0 {
                f.write_str("\n")?;
            }
            write!(f, "{}: ", problem.place)?;
            if !problem.key.is_empty() {
                write!(f, "{}: ", problem.key)?;
            }
            f.write_str(&problem.reason)?;
        }
        Ok(())
    }
}

impl std::error::Error for ConfigError {}

impl Config {
    /// Values of the right type that still cannot be used, by key.
    pub(super) fn problems(&self) -> Vec<Problem> {
        let mut problems = self.out_of_range();
        problems.extend(self.auth.jwt.iter().flat_map(JwtConfig::problems));
        problems.extend(self.mtconnect.problems());
        problems.extend(self.mqtt.problems());
        problems.extend(self.cors.problem().map(|reason| ("cors.origins", reason)));
        problems.extend(self.store_uri().err());
        problems.extend(self.unusable_text());
        problems.extend(self.insecure_ports());
        if self.grpc.tls.is_some() && self.tls.is_some() {
            problems.push(("grpc.tls", "the section tls encrypts both ports already: keep one of them".to_owned()));
        }
        problems.extend(self.unreadable_files());
        match (&self.healthcheck.cert, &self.healthcheck.key) {
            (Some(_), None) => problems.push(("healthcheck.cert", "needs healthcheck.key".to_owned())),
            (None, Some(_)) => problems.push(("healthcheck.key", "needs healthcheck.cert".to_owned())),
            _ => {}
        }
        problems
    }

    /// Numbers that are too small or too large.
    fn out_of_range(&self) -> Vec<Problem> {
        let connections = self.connections.ranges(self.limits.message_bytes as u64);
        let ranges = self.limits.ranges().into_iter().chain(self.retention.ranges()).chain(self.http.ranges());
        let ranges = ranges.chain(connections).chain(self.mtconnect.ranges()).chain(self.mqtt.ranges());
        let ranges = ranges.chain(self.auth.jwt.iter().flat_map(JwtConfig::ranges));
        let outside = ranges.filter(|&(_, value, low, high)| !(low..=high).contains(&value));
        outside.map(|(key, value, low, high)| (key, format!("must be {low} to {high}, is {value}"))).collect()
    }

    /// Text that others have to understand.
    fn unusable_text(&self) -> impl Iterator<Item = Problem> {
        // A word that is no level would be a target, of which everything is logged, and nothing else.
        let is_target = |directive: &&str| !directive.contains('=') && directive.parse::<LevelFilter>().is_err();
        let level = match self.log.level.parse::<Targets>() {
            Err(error) => Some(error.to_string()),
            Ok(_) => self.log.level.split(',').find(is_target).map(|directive| {
                format!("{directive:?} is neither off, error, warn, info, debug or trace nor TARGET=LEVEL")
            }),
        };
        let endpoint = self.telemetry.otlp_endpoint.as_deref().filter(|endpoint| {
            !endpoint.parse::<http::Uri>().is_ok_and(|uri| uri.scheme().is_some() && uri.host().is_some())
        });
        let level = level.map(|reason| ("log.level", reason));
        let endpoint = endpoint
            .map(|endpoint| ("telemetry.otlp_endpoint", format!("must be a URL with a scheme, is {endpoint:?}")));
        level.into_iter().chain(endpoint)
    }

    /// Files that are named and cannot be opened.
    fn unreadable_files(&self) -> impl Iterator<Item = Problem> {
        let (jwt, tls, own, probe) =
            (self.auth.jwt.as_ref(), self.tls.as_ref(), self.grpc.tls.as_ref(), &self.healthcheck);
        let files = [
            ("auth.clients", self.auth.clients.as_ref()),
            ("auth.jwt.jwks_ca", jwt.and_then(|jwt| jwt.jwks_ca.as_ref())),
            ("tls.cert", tls.map(|tls| &tls.cert)),
            ("tls.key", tls.map(|tls| &tls.key)),
            ("tls.client_ca", tls.and_then(|tls| tls.client_ca.as_ref())),
            ("grpc.tls.cert", own.map(|tls| &tls.cert)),
            ("grpc.tls.key", own.map(|tls| &tls.key)),
            ("grpc.tls.client_ca", own.and_then(|tls| tls.client_ca.as_ref())),
            ("mqtt.password_file", self.mqtt.password_file.as_ref()),
            ("mqtt.ca", self.mqtt.ca.as_ref()),
            ("mqtt.cert", self.mqtt.cert.as_ref()),
            ("mqtt.key", self.mqtt.key.as_ref()),
            ("healthcheck.ca", probe.ca.as_ref()),
            ("healthcheck.cert", probe.cert.as_ref()),
            ("healthcheck.key", probe.key.as_ref()),
        ];
        files.into_iter().filter_map(|(key, path)| {
            let path = path?;
            let error = File::open(path).err()?;
            Some((key, format!("{}: {error}", path.display())))
        })
    }
}
