//! The public keys of an identity provider (JWKS): which of them can be used, for what.

use jsonwebtoken::jwk::{AlgorithmParameters, EllipticCurve, Jwk, KeyOperations, PublicKeyUse};
use jsonwebtoken::{Algorithm, AlgorithmFamily, DecodingKey};
use serde::Deserialize;

/// Most keys that are looked at.
const MAX_KEYS: usize = 100;

/// A key that verifies signatures.
pub(super) struct Key {
    id: Option<String>,
    /// What it may be used for.
    algorithms: Vec<Algorithm>,
    key: DecodingKey,
}

impl Key {
    /// The key itself.
    pub(super) const fn key(&self) -> &DecodingKey {
        &self.key
    }

    /// Whether tokens signed by this algorithm may be verified by it.
    pub(super) fn is_for(&self, algorithm: Algorithm) -> bool {
        self.algorithms.contains(&algorithm)
    }
}

/// The keys that can be used.
#[derive(Default)]
pub(super) struct KeySet {
    keys: Vec<Key>,
}

#[derive(Deserialize)]
struct Document {
    keys: Vec<serde_json::Value>,
}

impl KeySet {
    /// Reads a set. Keys of kinds that are not known here are passed over, as are secrets and keys for encryption: a set without a key
    /// that can be used says that there is none any more. One of which nothing is a key cannot be read.
    ///
    /// # Errors
    /// What is wrong with the whole.
    pub(super) fn parse(text: &[u8]) -> Result<Self, String> {
        let document: Document =
            serde_json::from_slice(text).map_err(|error| format!("it is no set of keys (JWKS): {error}"))?;
        if document.keys.len() > MAX_KEYS {
            return Err(format!("it has {} keys, more than {MAX_KEYS}", document.keys.len()));
        }
        // A key says of which kind it is (RFC 7517, 4.1).
        let has_kind = |key: &serde_json::Value| key.get("kty").is_some_and(serde_json::Value::is_string);
        if !document.keys.is_empty() && !document.keys.iter().any(has_kind) {
            return Err("it is no set of keys (JWKS): none of its keys has a kind (kty)".to_owned());
        }
        let keys: Vec<Key> = document.keys.into_iter().filter_map(key).collect();
        if keys.is_empty() {
            tracing::warn!(
                "the set of keys has none that verifies signatures (RSA, P-256, P-384, Ed25519): no token is accepted"
            );
        }
        Ok(Self { keys })
    }

    /// The key that a token names; the only one where it names none.
    pub(super) fn find(&self, id: Option<&str>) -> Option<&Key> {
        match id {
            Some(id) => self.keys.iter().find(|key| key.id.as_deref() == Some(id)),
            None => match self.keys.as_slice() {
                [only] => Some(only),
                _ => None,
            },
        }
    }
}

/// A key as far as it can be used here.
fn key(document: serde_json::Value) -> Option<Key> {
    let jwk: Jwk = serde_json::from_value(document).ok()?;
    let common = &jwk.common;
    let is_for_signatures = common.public_key_use.as_ref().is_none_or(|purpose| *purpose == PublicKeyUse::Signature)
        && common.key_operations.as_ref().is_none_or(|operations| operations.contains(&KeyOperations::Verify));
    let possible: &[Algorithm] = match &jwk.algorithm {
        AlgorithmParameters::RSA(_) => AlgorithmFamily::Rsa.algorithms(),
        AlgorithmParameters::EllipticCurve(key) => match key.curve {
            EllipticCurve::P256 => &[Algorithm::ES256],
            EllipticCurve::P384 => &[Algorithm::ES384],
            _ => &[],
        },
        AlgorithmParameters::OctetKeyPair(key) if key.curve == EllipticCurve::Ed25519 => &[Algorithm::EdDSA],
        _ => &[],
    };
    // A key that names its algorithm is for that one alone.
    let named = common.key_algorithm.map(|algorithm| algorithm.to_string());
    let is_named = |algorithm: &&Algorithm| named.as_ref().is_none_or(|named| format!("{algorithm:?}") == *named);
    let algorithms: Vec<Algorithm> = possible.iter().filter(is_named).copied().collect();
    if !is_for_signatures || algorithms.is_empty() {
        return None;
    }
    Some(Key { id: common.key_id.clone(), algorithms, key: DecodingKey::from_jwk(&jwk).ok()? })
}
