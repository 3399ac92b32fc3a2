//! Files of machine and tool data, TOML or JSON.

use std::path::Path;

use figment::Figment;
use figment::providers::{Format as _, Serialized, Toml};

use super::CliError;

/// What a file states: JSON where its name ends so, else TOML.
pub(super) fn read(path: &Path) -> Result<Figment, CliError> {
    let text = std::fs::read_to_string(path).map_err(|error| CliError::file(path, &error))?;
    let is_json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    if !is_json {
        return Ok(Figment::from(Toml::string(&text)));
    }
    let value: serde_json::Value =
        serde_json::from_str(&text).map_err(|error| CliError::trouble(format!("{}: {error}", path.display())))?;
    Ok(Figment::from(Serialized::defaults(value)))
}

/// Every problem of a file that does not have the right form, one a line.
pub(super) fn not_as_expected(path: &Path, error: figment::Error) -> CliError {
    let problems: Vec<_> =
        error.into_iter().map(|problem| (problem.path.join("."), problem.kind.to_string())).collect();
    wrong(path, problems.iter().map(|(key, message)| (key.as_str(), message.as_str())))
}

/// Problems of a file with the keys that they are about, one a line.
pub(super) fn wrong<'a>(path: &Path, problems: impl Iterator<Item = (&'a str, &'a str)>) -> CliError {
    let name = path.display();
    let lines = problems.map(|(key, message)| {
        let separator = if key.is_empty() { "" } else { ": " };
        format!("{name}: {key}{separator}{message}")
    });
    CliError::trouble(lines.collect::<Vec<_>>().join("\n"))
}
