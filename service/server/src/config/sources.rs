//! Where values come from, and which of these places is at fault.

use std::path::Path;

use figment::Figment;
use figment::providers::{Env, Format, Serialized, Toml};
use figment::value::Value;

use super::{Config, ConfigError, ConfigProblem, ENV_PREFIX};

/// Values from flags, by key; absent ones are skipped.
#[derive(Clone, Debug, Default)]
pub struct Overrides(Vec<(&'static str, Value)>);

impl Overrides {
    /// Sets a key where the flag was given.
    #[must_use]
    pub fn set(mut self, key: &'static str, value: Option<impl Into<Value>>) -> Self {
        self.0.extend(value.map(|value| (key, value.into())));
        self
    }
}

impl Config {
    /// Reads configuration from everywhere and checks it.
    ///
    /// # Errors
    /// [`ConfigError`] with every problem found.
    pub fn load(file: Option<&Path>, flags: &Overrides) -> Result<Self, ConfigError> {
        let mut figment = Figment::from(Serialized::defaults(Self::default()));
        if let Some(path) = file {
            if !path.is_file() {
                let reason = if path.is_dir() { "it is a folder" } else { "there is no such file" }.to_owned();
                return Err(ConfigError(vec![ConfigProblem {
                    place: path.display().to_string(),
                    key: String::new(),
                    reason,
                }]));
            }
            figment = figment.merge(Toml::file_exact(path));
        }
        figment = figment.merge(Env::prefixed(ENV_PREFIX).filter(|key| key.as_str().contains("__")).split("__"));
        for (key, value) in &flags.0 {
            figment = figment.merge(Flag { key, value });
        }
        let config: Self = figment.extract().map_err(|errors| {
            let problem = |error: figment::Error| {
                let key = key_of(&error);
                ConfigProblem { place: place_of(error.metadata.as_ref(), &key), key, reason: reason_of(&error.kind) }
            };
            ConfigError(errors.into_iter().map(problem).collect())
        })?;
        let problems: Vec<ConfigProblem> = config
            .problems()
            .into_iter()
            .map(|(key, reason)| {
                let place = place_of(figment.find_metadata(key), key);
                ConfigProblem { place, key: key.to_owned(), reason }
            })
            .collect();
        if problems.is_empty() { Ok(config) } else { Err(ConfigError(problems)) }
    }
}

/// One flag as a source of configuration.
struct Flag<'a> {
    key: &'a str,
    value: &'a Value,
}

impl figment::Provider for Flag<'_> {
    fn metadata(&self) -> figment::Metadata {
        figment::Metadata::named("command line")
    }

    fn data(&self) -> Result<figment::value::Map<figment::Profile, figment::value::Dict>, figment::Error> {
        let nested = figment::util::nest(self.key, self.value.clone());
        let dict = nested.into_dict().unwrap_or_default();
        Ok(figment::value::Map::from([(figment::Profile::Default, dict)]))
    }
}

fn place_of(metadata: Option<&figment::Metadata>, key: &str) -> String {
    match metadata {
        Some(figment::Metadata { source: Some(figment::Source::File(path)), .. }) => path.display().to_string(),
        Some(metadata) if metadata.name.contains("environment") => {
            format!("environment variable {ENV_PREFIX}{}", key.to_ascii_uppercase().replace('.', "__"))
        }
        // What nobody has set is named by its type.
        Some(metadata) if metadata.name.contains("::") => "default value".to_owned(),
        Some(metadata) => metadata.name.to_string(),
        None => "configuration".to_owned(),
    }
}

fn reason_of(kind: &figment::error::Kind) -> String {
    match kind {
        figment::error::Kind::UnknownField(_, known) => format!("unknown key, known are {}", known.join(", ")),
        kind => kind.to_string(),
    }
}

/// The key that an error is about. An unknown field is named by the error's kind, not by its path.
fn key_of(error: &figment::Error) -> String {
    let mut path = error.path.clone();
    if let figment::error::Kind::UnknownField(field, _) = &error.kind
        && path.last() != Some(field)
    {
        path.push(field.clone());
    }
    path.join(".")
}
