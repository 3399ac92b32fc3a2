//! Resource names: `jobs/{uuid}`, `runs/{uuid}`, `machines/{id}`, `tools/{id}`, `programs/{sha256}`.

use std::fmt::Display;
use std::str::FromStr;

use uuid::Uuid;

/// The header by which a client that acts for any tenant says for which.
pub const TENANT_HEADER: &str = "x-feedwave-tenant";

/// Why a text is not the resource name that is wanted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// Nothing given.
    #[error("must be set")]
    Missing,
    /// Not of the form `collection/id`.
    #[error("must be of the form `{expected}`, is {given:?}")]
    Form {
        /// The form.
        expected: &'static str,
        /// The text, cut where it is long.
        given: String,
    },
    /// The identifier has other characters than permitted.
    #[error("must be 1 to 63 lower-case letters, digits and hyphens, starting with a letter, is {0:?}")]
    Identifier(String),
}

/// Texts quoted in errors are cut here.
const QUOTED_CHARACTERS: usize = 80;

fn quoted(text: &str) -> String {
    text.chars().take(QUOTED_CHARACTERS).collect()
}

fn strip<'a>(name: &'a str, prefix: &str, expected: &'static str) -> Result<&'a str, NameError> {
    if name.is_empty() {
        return Err(NameError::Missing);
    }
    name.strip_prefix(prefix).ok_or_else(|| NameError::Form { expected, given: quoted(name) })
}

/// The identifier in `jobs/{uuid}`.
///
/// # Errors
/// [`NameError`] when it is not one.
pub fn parse_job(name: &str) -> Result<Uuid, NameError> {
    const FORM: &str = "jobs/{uuid}";
    let id = strip(name, "jobs/", FORM)?;
    Uuid::try_parse(id).map_err(|_| NameError::Form { expected: FORM, given: quoted(name) })
}

/// The identifier in `runs/{uuid}`.
///
/// # Errors
/// [`NameError`] when it is not one.
pub fn parse_run(name: &str) -> Result<Uuid, NameError> {
    const FORM: &str = "runs/{uuid}";
    let id = strip(name, "runs/", FORM)?;
    Uuid::try_parse(id).map_err(|_| NameError::Form { expected: FORM, given: quoted(name) })
}

/// The hash in `programs/{sha256}`.
///
/// # Errors
/// [`NameError`] when it is not one.
pub fn parse_program<Id: FromStr>(name: &str) -> Result<Id, NameError> {
    const FORM: &str = "programs/{sha256 in lower-case hexadecimal}";
    let id = strip(name, "programs/", FORM)?;
    id.parse().map_err(|_| NameError::Form { expected: FORM, given: quoted(name) })
}

/// The identifier in `machines/{id}`.
///
/// # Errors
/// [`NameError`] when it is not one.
pub fn parse_machine(name: &str) -> Result<&str, NameError> {
    check_id(strip(name, "machines/", "machines/{machine}")?)
}

/// The identifier in `tools/{id}`.
///
/// # Errors
/// [`NameError`] when it is not one.
pub fn parse_tool(name: &str) -> Result<&str, NameError> {
    check_id(strip(name, "tools/", "tools/{tool}")?)
}

/// An identifier chosen by a client.
///
/// # Errors
/// [`NameError`] when it has another form than permitted.
pub fn check_id(id: &str) -> Result<&str, NameError> {
    if id.is_empty() {
        return Err(NameError::Missing);
    }
    let permitted = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
    let valid = id.len() <= 63 && id.as_bytes()[0].is_ascii_lowercase() && id.bytes().all(permitted);
    if valid { Ok(id) } else { Err(NameError::Identifier(quoted(id))) }
}

/// `jobs/{uuid}`
#[must_use]
pub fn job(id: Uuid) -> String {
    format!("jobs/{id}")
}

/// `runs/{uuid}`
#[must_use]
pub fn run(id: Uuid) -> String {
    format!("runs/{id}")
}

/// `programs/{sha256}`
#[must_use]
pub fn program(id: impl Display) -> String {
    format!("programs/{id}")
}

/// `machines/{id}`
#[must_use]
pub fn machine(id: &str) -> String {
    format!("machines/{id}")
}

/// `tools/{id}`
#[must_use]
pub fn tool(id: &str) -> String {
    format!("tools/{id}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_the_round_trip() {
        let id = Uuid::from_u128(0x0190_0000_0000_7000_8000_0000_0000_0001);
        assert_eq!(parse_job(&job(id)), Ok(id));
        assert_eq!(parse_run(&run(id)), Ok(id));
        let program_id = "7".repeat(64);
        assert_eq!(parse_program(&program(&program_id)), Ok(program_id));
        assert_eq!(parse_machine(&machine("lathe-2")), Ok("lathe-2"));
        assert_eq!(parse_tool(&tool("t7")), Ok("t7"));
    }

    #[test]
    fn other_names_are_refused_with_the_form_wanted() {
        assert_eq!(parse_job(""), Err(NameError::Missing));
        assert!(matches!(parse_job("machines/lathe"), Err(NameError::Form { .. })));
        assert!(matches!(parse_job("jobs/7"), Err(NameError::Form { .. })));
        for id in ["", "Lathe", "7th", "a/b", "a b", &"x".repeat(64)] {
            assert!(check_id(id).is_err(), "{id:?}");
        }
    }
}
