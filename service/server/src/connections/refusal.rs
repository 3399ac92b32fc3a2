//! Errors as answers where nothing is known yet of what the client wants: a status of gRPC for calls, JSON otherwise.

use axum::body::Body;
use feedwave_contract::json;
use http::{HeaderMap, HeaderValue, Response, StatusCode, header};
use tonic::Status;

use crate::error::Error;

/// The error in the form that the client understands.
pub(crate) fn answer(headers: &HeaderMap, error: &Error) -> Response<Body> {
    let of_grpc = |value: &HeaderValue| value.as_bytes().starts_with(b"application/grpc");
    if headers.get(header::CONTENT_TYPE).is_some_and(of_grpc) {
        return Status::from(error.clone()).into_http();
    }
    in_json(error)
}

/// The error as a port of HTTP says it.
pub(crate) fn in_json(error: &Error) -> Response<Body> {
    let http_status = error.http_status();
    let mut response = Response::new(Body::from(json::status_to_string(&Status::from(error.clone()))));
    *response.status_mut() = http_status;
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
    if http_status == StatusCode::UNAUTHORIZED {
        headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"feedwave\""));
    }
    if let Some(after) = error.retry_after() {
        headers.insert(header::RETRY_AFTER, HeaderValue::from(after.as_secs()));
    }
    response
}
