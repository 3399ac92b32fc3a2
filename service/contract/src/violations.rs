//! What is wrong with the fields of a request, all of it at once and bounded however much it is.

use std::fmt;

use crate::text::shortened;

/// Most violations that are listed of one request; further ones are counted.
pub const MAX_VIOLATIONS: usize = 64;
/// Longest path of a field that is kept whole, bytes.
const MAX_FIELD_BYTES: usize = 160;
/// Longest description that is kept whole, bytes: values of any length are quoted in them.
const MAX_DESCRIPTION_BYTES: usize = 400;

/// One field of a request that cannot be accepted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Path of the field in the request, such as `machine.profile.machine.axes[0].max_velocity`.
    pub field: String,
    /// What is wrong with it, with the value and what is allowed.
    pub description: String,
}

impl Violation {
    fn new(field: &str, description: &str) -> Self {
        Self {
            field: shortened(field, MAX_FIELD_BYTES, char::len_utf8).into_owned(),
            description: shortened(description, MAX_DESCRIPTION_BYTES, char::len_utf8).into_owned(),
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.field, self.description)
    }
}

/// Collects what is wrong with a request, so that a client is told all of it at once: the first
/// [`MAX_VIOLATIONS`], long texts shortened in their middle, and the number of the others.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Violations {
    listed: Vec<Violation>,
    not_listed: usize,
}

impl Violations {
    /// Adds a violation.
    pub fn add(&mut self, field: impl Into<String>, description: impl Into<String>) {
        if self.listed.len() < MAX_VIOLATIONS {
            self.listed.push(Violation::new(&field.into(), &description.into()));
        } else {
            self.not_listed += 1;
        }
    }

    /// The same violations with the path of each field written otherwise.
    #[must_use]
    pub fn with_fields(mut self, written: impl Fn(&str) -> String) -> Self {
        for violation in &mut self.listed {
            violation.field = written(&violation.field);
        }
        self
    }

    /// Takes the value, or adds the violation and goes on.
    pub fn check<T, E: fmt::Display>(&mut self, field: impl Into<String>, value: Result<T, E>) -> Option<T> {
        value.map_err(|error| self.add(field, error.to_string())).ok()
    }

    /// Takes over violations of a part of the request; with an empty prefix, of another one that is the same.
    pub fn extend(&mut self, prefix: &str, inner: Self) {
        for violation in inner.listed {
            let separator = if prefix.is_empty() || violation.field.is_empty() { "" } else { "." };
            self.add(format!("{prefix}{separator}{}", violation.field), violation.description);
        }
        self.not_listed += inner.not_listed;
    }

    /// What was found, as far as it is listed.
    #[must_use]
    pub fn as_slice(&self) -> &[Violation] {
        &self.listed
    }

    /// How many more were found.
    #[must_use]
    pub const fn not_listed(&self) -> usize {
        self.not_listed
    }

    /// How many were found.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.listed.len() + self.not_listed
    }

    /// Whether nothing was found.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.listed.is_empty()
    }

    /// Ends the collection.
    ///
    /// # Errors
    /// [`InvalidRequest`] when anything was found.
    pub fn finish(self) -> Result<(), InvalidRequest> {
        if self.is_empty() { Ok(()) } else { Err(InvalidRequest(self)) }
    }
}

/// A request with at least one violation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("invalid request: {0}")]
pub struct InvalidRequest(pub Violations);

impl fmt::Display for Violations {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, violation) in self.listed.iter().enumerate() {
            write!(f, "{}{violation}", if index == 0 { "" } else { "; " })?;
        }
        if self.not_listed > 0 { write!(f, "; {}", more(self.not_listed)) } else { Ok(()) }
    }
}

/// Says how many violations are left out.
pub fn more(count: usize) -> String {
    format!("and {count} more")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_are_listed_and_the_others_counted() {
        let mut part = Violations::default();
        for index in 0..MAX_VIOLATIONS + 5 {
            part.add(format!("axes[{index}]"), "is wrong");
        }
        let mut whole = Violations::default();
        whole.add("name", "must be set");
        whole.extend("machine", part);
        assert_eq!((whole.as_slice().len(), whole.not_listed(), whole.count()), (64, 6, 70));
        assert_eq!(whole.as_slice()[1].field, "machine.axes[0]");
        assert!(whole.to_string().ends_with("machine.axes[62]: is wrong; and 6 more"), "{whole}");
    }

    #[test]
    fn a_long_value_keeps_the_field_and_the_reason() {
        let mut violations = Violations::default();
        violations.add("x".repeat(1 << 20), format!("{:?} is not one of the names", "y".repeat(1 << 20)));
        let Violation { field, description } = &violations.as_slice()[0];
        assert!(field.len() <= MAX_FIELD_BYTES && description.len() <= MAX_DESCRIPTION_BYTES);
        assert!(description.starts_with("\"yyy") && description.ends_with("yyy\" is not one of the names"));
    }
}
