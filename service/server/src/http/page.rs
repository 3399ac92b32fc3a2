//! The page for people: a handful of files in the binary, which ask nothing but this service.

use std::sync::LazyLock;

use axum::Router;
use axum::extract::{Path, Request};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use axum::routing::get;

use super::{HttpState, calls, unknown_path};
use crate::conditional::Tagged;

/// What the page may load and do: files and answers of its own origin, no script in a page, nothing around it.
const POLICY: &str =
    "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; object-src 'none'";

macro_rules! files {
    ($($name:literal = $content_type:literal),* $(,)?) => {
        [$(($name, $content_type, include_bytes!(concat!("../../page/", $name)).as_slice())),*]
    };
}

/// Every file by its name, with its type and its bytes.
const FILES: [(&str, &str, &[u8]); 22] = files![
    "index.html" = "text/html; charset=utf-8",
    "page.css" = "text/css; charset=utf-8",
    "icon.svg" = "image/svg+xml",
    "api.js" = "text/javascript; charset=utf-8",
    "board.js" = "text/javascript; charset=utf-8",
    "chart.js" = "text/javascript; charset=utf-8",
    "check.js" = "text/javascript; charset=utf-8",
    "chip.js" = "text/javascript; charset=utf-8",
    "dom.js" = "text/javascript; charset=utf-8",
    "drawing.js" = "text/javascript; charset=utf-8",
    "editor.js" = "text/javascript; charset=utf-8",
    "grpc.js" = "text/javascript; charset=utf-8",
    "jobs.js" = "text/javascript; charset=utf-8",
    "main.js" = "text/javascript; charset=utf-8",
    "path.js" = "text/javascript; charset=utf-8",
    "program.js" = "text/javascript; charset=utf-8",
    "protobuf.js" = "text/javascript; charset=utf-8",
    "resources.js" = "text/javascript; charset=utf-8",
    "run.js" = "text/javascript; charset=utf-8",
    "state.js" = "text/javascript; charset=utf-8",
    "text.js" = "text/javascript; charset=utf-8",
    "upload.js" = "text/javascript; charset=utf-8",
];

static TAGGED: LazyLock<Vec<(&str, Tagged)>> = LazyLock::new(|| {
    let file = |(name, content_type, bytes): (&'static str, &'static str, &'static [u8])| {
        (name, Tagged::of_type(bytes, HeaderValue::from_static(content_type)))
    };
    let made = (calls::NAME, "text/javascript; charset=utf-8", calls::MODULE.as_bytes());
    FILES.into_iter().chain([made]).map(file).collect()
});

/// The paths of the views, which are all the same file: the page itself tells them apart.
const VIEWS: [&str; 5] = ["/", "/check", "/jobs", "/jobs/{id}", "/runs/{id}"];

/// The routes of the page. Everybody may have it: what it shows it has to ask for, as anybody else.
pub(super) fn routes() -> Router<HttpState> {
    let page = VIEWS.iter().fold(Router::new(), |router, path| router.route(path, get(index)));
    page.route("/page/{file}", get(file))
}

async fn index(headers: HeaderMap) -> Response {
    named("index.html", &headers).unwrap_or_else(|| StatusCode::NOT_FOUND.into_response())
}

async fn file(Path(name): Path<String>, headers: HeaderMap, request: Request) -> Response {
    match named(&name, &headers) {
        Some(response) => response,
        None => unknown_path(request).await.into_response(),
    }
}

/// A file as an answer.
fn named(name: &str, request: &HeaderMap) -> Option<Response> {
    let (_, tagged) = TAGGED.iter().find(|(known, _)| *known == name)?;
    let mut response = tagged.response(request);
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    ] {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    Some(response)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(name: &str) -> &'static str {
        let (.., bytes) = FILES.into_iter().find(|(known, ..)| *known == name).unwrap_or_else(|| panic!("no {name}"));
        std::str::from_utf8(bytes).unwrap()
    }

    #[test]
    fn every_file_that_another_names_is_there() {
        let scripts = FILES.iter().filter(|(_, content_type, _)| content_type.starts_with("text/javascript"));
        for (name, ..) in scripts {
            for line in text(name).lines().filter(|line| line.contains(" from \"") || line.starts_with("import \"")) {
                let imported = line.split('"').nth_back(1).unwrap();
                let imported = imported.strip_prefix("./").unwrap_or_else(|| panic!("{name} imports {imported}"));
                if imported != calls::NAME {
                    text(imported);
                }
            }
        }
        for named in text("index.html").split(['"']).filter_map(|word| word.strip_prefix("/page/")) {
            text(named);
        }
    }

    #[test]
    fn nothing_is_asked_of_another_host_and_nothing_is_markup_from_data() {
        for (name, ..) in FILES {
            let text = text(name);
            let foreign = text
                .match_indices("://")
                .filter(|(at, _)| !text[..*at].ends_with("http") || !text[*at..].starts_with("://www.w3.org/2000/svg"));
            assert_eq!(foreign.count(), 0, "{name} names another host");
            for forbidden in
                ["innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", " style=\"", " onclick=\""]
            {
                assert!(!text.contains(forbidden), "{name}: {forbidden}");
            }
        }
        assert!(!POLICY.contains("unsafe"));
    }

    #[test]
    fn both_languages_have_the_same_words() {
        let words = text("text.js");
        let codes = words.find("const CODES = {").unwrap();
        let (first, second) = words.split_at(codes);
        for part in [first, second] {
            let part = part.split("\n};").next().unwrap();
            let (english, german) = part.split_once("\n  de: {").unwrap();
            let of = |text: &str| {
                let mut names: Vec<String> = text
                    .split_inclusive(": \"")
                    .filter_map(|piece| piece.strip_suffix(": \""))
                    .filter_map(|piece| piece.rsplit([' ', '\n', '{', ',']).next())
                    .filter(|name| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'))
                    .filter(|name| *name != "en")
                    .map(str::to_owned)
                    .collect();
                names.sort_unstable();
                names
            };
            assert_eq!(of(english), of(german));
        }
    }
}
