//! Strong entity tags and `If-None-Match` (RFC 9110, sections 8.8.3 and 13.1.2).

use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use sha2::{Digest as _, Sha256};

/// A body with its entity tag.
#[derive(Debug)]
pub(crate) struct Tagged {
    tag: String,
    content_type: HeaderValue,
    body: Bytes,
}

impl Tagged {
    /// A body of JSON.
    pub(crate) fn new(body: impl Into<Bytes>) -> Self {
        Self::of_type(body, HeaderValue::from_static("application/json"))
    }

    /// A body of another type.
    pub(crate) fn of_type(body: impl Into<Bytes>, content_type: HeaderValue) -> Self {
        let body = body.into();
        Self { tag: entity_tag(&body), content_type, body }
    }

    /// The body with its tag, or 304 where the client has it already.
    pub(crate) fn response(&self, request: &HeaderMap) -> Response {
        let mut response = if has(request, &self.tag) {
            StatusCode::NOT_MODIFIED.into_response()
        } else {
            ([(header::CONTENT_TYPE, self.content_type.clone())], self.body.clone()).into_response()
        };
        let headers = response.headers_mut();
        if let Ok(tag) = HeaderValue::from_str(&self.tag) {
            headers.insert(header::ETAG, tag);
        }
        // A copy may be kept, but has to be asked about each time.
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
        response
    }
}

/// JSON with its entity tag, or 304 where the client has it already.
pub(crate) fn response(request: &HeaderMap, body: impl Into<Bytes>) -> Response {
    Tagged::new(body).response(request)
}

/// The tag of a body: equal bodies, and only those, have equal tags.
fn entity_tag(body: &[u8]) -> String {
    let digest = Sha256::digest(body);
    let digits: String = digest[..16].iter().map(|byte| format!("{byte:02x}")).collect();
    format!("\"{digits}\"")
}

/// Whether `If-None-Match` names the tag. The comparison is the weak one, as for any GET.
fn has(request: &HeaderMap, tag: &str) -> bool {
    let named = request.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    named
        .flat_map(|value| value.split(','))
        .map(str::trim)
        .any(|named| named == "*" || named.strip_prefix("W/").unwrap_or(named) == tag)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(if_none_match: &str) -> Response {
        let mut headers = HeaderMap::new();
        if !if_none_match.is_empty() {
            headers.insert(header::IF_NONE_MATCH, if_none_match.parse().unwrap());
        }
        response(&headers, "{}".to_owned())
    }

    #[test]
    fn what_the_client_has_is_not_sent_again() {
        let first = ask("");
        assert_eq!(first.status(), StatusCode::OK);
        let tag = first.headers()[header::ETAG].to_str().unwrap().to_owned();
        assert!(tag.starts_with('"') && tag.ends_with('"'), "{tag} is not strong");
        for named in [tag.clone(), format!("W/{tag}"), format!("\"other\", {tag}"), "*".to_owned()] {
            let answer = ask(&named);
            assert_eq!(answer.status(), StatusCode::NOT_MODIFIED, "{named}");
            assert_eq!(answer.headers()[header::ETAG], *tag);
        }
        assert_eq!(ask("\"other\"").status(), StatusCode::OK);
    }

    #[test]
    fn another_body_has_another_tag() {
        assert_ne!(entity_tag(b"{}"), entity_tag(b"{ }"));
    }
}
