//! Which pages of other origins may ask the service.

use http::{HeaderName, HeaderValue, Method, header};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use tower_http::cors::{AllowOrigin, CorsLayer};

use feedwave_contract::names::TENANT_HEADER;

/// Most origins that can be listed.
const MAX_ORIGINS: usize = 256;
/// How long a browser may remember what it was told.
const MAX_AGE: Duration = Duration::from_secs(86_400);

/// Pages of other origins; the service's own page needs none of this.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CorsConfig {
    /// Origins such as `https://mes.example` whose pages may read what the ports answer; `*` alone: all.
    pub origins: Vec<String>,
}

impl CorsConfig {
    /// What is wrong with the origins.
    pub(super) fn problem(&self) -> Option<String> {
        if self.origins.len() > MAX_ORIGINS {
            return Some(format!("must be at most {MAX_ORIGINS}, are {}", self.origins.len()));
        }
        if self.is_any() {
            return None;
        }
        let wrong = self.origins.iter().find(|origin| !is_origin(origin))?;
        Some(format!("must be scheme://host or scheme://host:port, or * alone, one is {wrong:?}"))
    }

    fn is_any(&self) -> bool {
        self.origins == ["*"]
    }

    /// For the HTTP port; `None` where no other origin may ask.
    pub(crate) fn for_http(&self) -> Option<CorsLayer> {
        let layer = self
            .layer()?
            .allow_methods([Method::GET, Method::HEAD])
            .allow_headers([
                header::AUTHORIZATION,
                header::IF_NONE_MATCH,
                HeaderName::from_static("last-event-id"),
                HeaderName::from_static(TENANT_HEADER),
            ])
            .expose_headers([header::ETAG, header::RETRY_AFTER]);
        Some(layer)
    }

    /// For gRPC-Web; `None` where no other origin may ask.
    pub(crate) fn for_grpc_web(&self) -> Option<CorsLayer> {
        let asked =
            ["x-grpc-web", "x-user-agent", "grpc-timeout", "x-request-id", TENANT_HEADER].map(HeaderName::from_static);
        let told = ["grpc-status", "grpc-message", "grpc-status-details-bin", "x-request-id"];
        let layer = self
            .layer()?
            .allow_methods([Method::POST])
            .allow_headers([header::AUTHORIZATION, header::CONTENT_TYPE].into_iter().chain(asked).collect::<Vec<_>>())
            .expose_headers(told.map(HeaderName::from_static));
        Some(layer)
    }

    fn layer(&self) -> Option<CorsLayer> {
        if self.origins.is_empty() {
            return None;
        }
        let origins = if self.is_any() {
            AllowOrigin::any()
        } else {
            AllowOrigin::list(self.origins.iter().filter_map(|origin| HeaderValue::from_str(origin).ok()))
        };
        Some(CorsLayer::new().allow_origin(origins).max_age(MAX_AGE))
    }
}

/// Whether a text is an origin as browsers write it: scheme, host in lower case, port where it is not the scheme's.
fn is_origin(text: &str) -> bool {
    let Some((scheme, rest)) = text.split_once("://") else { return false };
    let uri: Option<http::Uri> = text.parse().ok();
    let has_host = uri.is_some_and(|uri| uri.host().is_some_and(|host| !host.is_empty()));
    let is_plain = !rest.contains(['/', '?', '#', '@', '*']) && !text.bytes().any(|byte| byte.is_ascii_uppercase());
    let is_needed = !(scheme == "http" && rest.ends_with(":80") || scheme == "https" && rest.ends_with(":443"));
    has_host && is_plain && is_needed && !rest.ends_with(':')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(origins: &[&str]) -> Option<String> {
        CorsConfig { origins: origins.iter().map(|&origin| origin.to_owned()).collect() }.problem()
    }

    #[test]
    fn origins_are_what_browsers_send() {
        assert_eq!(problem(&[]), None);
        assert_eq!(problem(&["*"]), None);
        assert_eq!(problem(&["https://mes.example", "http://10.0.0.7:8080", "http://[::1]:3000"]), None);
        for wrong in [
            "mes.example",
            "https://mes.example/",
            "https://mes.example/app",
            "https://*.example",
            "null",
            "https://MES.example",
            "http://mes.example:80",
            "https://mes.example:443",
            "https://a@mes.example",
            "*",
            "",
        ] {
            assert!(problem(&["https://mes.example", wrong]).is_some(), "{wrong}");
        }
    }
}
