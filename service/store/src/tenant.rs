//! Tenants: who has records that nobody else sees.

use std::fmt;
use std::str::FromStr;

/// Longest name of a tenant, bytes.
pub const MAX_TENANT_BYTES: usize = 32;

/// Whether anything is of a tenant that has a name, or was asked for by one whose client is known.
pub(crate) const HAS_TENANTS: &str = "SELECT CAST(CASE WHEN EXISTS (SELECT 1 FROM jobs WHERE tenant > '')
        OR EXISTS (SELECT 1 FROM programs WHERE tenant > '') OR EXISTS (SELECT 1 FROM runs WHERE tenant > '')
        OR EXISTS (SELECT 1 FROM decisions WHERE tenant > '') OR EXISTS (SELECT 1 FROM job_events WHERE tenant > '')
        OR EXISTS (SELECT 1 FROM audit_tenants WHERE tenant NOT IN ('', '?') AND entries > 0)
    THEN 1 ELSE 0 END AS BIGINT)";

/// A tenant: jobs, programs, runs and what belongs to them are of one. Whoever names none has the default tenant, whose
/// name is empty; it is a tenant like any other.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Tenant {
    /// The name, with zeros behind it.
    name: [u8; MAX_TENANT_BYTES],
}

/// The text is no name of a tenant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a tenant has 1 to {MAX_TENANT_BYTES} lower-case letters, digits, -, _ and ., a letter or digit first")]
pub struct InvalidTenant;

impl Tenant {
    /// The tenant without a name.
    pub const DEFAULT: Self = Self { name: [0; MAX_TENANT_BYTES] };

    /// Its name; empty for the default tenant.
    #[must_use]
    pub fn name(&self) -> &str {
        let length = self.name.iter().position(|byte| *byte == 0).unwrap_or(MAX_TENANT_BYTES);
        // Only ASCII is ever put in.
        std::str::from_utf8(&self.name[..length]).unwrap_or_default()
    }

    /// A name that is unique among all tenants, of one that is unique in this tenant and has no space in it.
    pub(crate) fn key(&self, name: impl fmt::Display) -> String {
        if *self == Self::DEFAULT { name.to_string() } else { format!("{name} {}", self.name()) }
    }

    /// The two parts of a key.
    pub(crate) fn split(key: &str) -> Result<(&str, Self), InvalidTenant> {
        match key.split_once(' ') {
            Some((name, tenant)) => Ok((name, tenant.parse()?)),
            None => Ok((key, Self::DEFAULT)),
        }
    }
}

impl FromStr for Tenant {
    type Err = InvalidTenant;

    fn from_str(text: &str) -> Result<Self, InvalidTenant> {
        let is_plain = |byte: &u8| byte.is_ascii_lowercase() || byte.is_ascii_digit();
        let may_follow = |byte: &u8| is_plain(byte) || b"-_.".contains(byte);
        let bytes = text.as_bytes();
        if bytes.len() > MAX_TENANT_BYTES || !bytes.first().is_some_and(is_plain) || !bytes.iter().all(may_follow) {
            return Err(InvalidTenant);
        }
        let mut name = [0; MAX_TENANT_BYTES];
        name[..bytes.len()].copy_from_slice(bytes);
        Ok(Self { name })
    }
}

impl fmt::Display for Tenant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Debug for Tenant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Tenant({:?})", self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_bounded_and_keys_take_apart_what_they_were_made_of() {
        for name in ["a", "plant-3", "0.x_y", &"z".repeat(MAX_TENANT_BYTES)] {
            let tenant: Tenant = name.parse().unwrap();
            assert_eq!(tenant.name(), name);
            assert_eq!(Tenant::split(&tenant.key("abc")), Ok(("abc", tenant)));
        }
        for name in ["", "-a", "A", "a b", "ä", "a/b", "a\0", &"z".repeat(MAX_TENANT_BYTES + 1)] {
            assert_eq!(name.parse::<Tenant>(), Err(InvalidTenant), "{name:?}");
        }
        assert_eq!(Tenant::DEFAULT.key("abc"), "abc");
        assert_eq!(Tenant::split("abc"), Ok(("abc", Tenant::DEFAULT)));
    }
}
