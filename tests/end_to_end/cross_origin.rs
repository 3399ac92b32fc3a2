//! Pages of other origins: those that are configured read the answers of both ports, no other does.

use bytes::Bytes;
use feedwave_tests::{Home, Server, Web};
use http::StatusCode;

use crate::FEEDWAVE;

const ORIGIN: &str = "https://mes.example";

async fn allowing(origins: &str) -> Server {
    Home::new(FEEDWAVE, &format!("[cors]\norigins = {origins}\n")).start().await
}

/// What a browser asks before a request that is not simple.
async fn preflight(web: &Web, path: &str, origin: &str, method: &str, headers: &str) -> feedwave_tests::Answer {
    let asked =
        [("origin", origin), ("access-control-request-method", method), ("access-control-request-headers", headers)];
    web.send("OPTIONS", path, &asked, Bytes::new()).await
}

#[tokio::test]
async fn a_configured_origin_reads_answers_and_errors_and_no_other_does() {
    let server = allowing("['https://mes.example', 'http://10.0.0.7:3000']").await;
    let web = server.web();
    for (path, status) in [("/v1/machines", StatusCode::OK), ("/v1/nothing", StatusCode::NOT_FOUND)] {
        let answer = web.send("GET", path, &[("origin", ORIGIN)], Bytes::new()).await;
        assert_eq!(answer.status, status);
        assert_eq!(answer.header("access-control-allow-origin"), ORIGIN, "{path}");
        assert!(answer.header("vary").to_lowercase().contains("origin"), "{path}: {:?}", answer.headers);
        let exposed = answer.header("access-control-expose-headers").to_lowercase();
        assert!(exposed.contains("etag") && exposed.contains("retry-after"), "{exposed}");
        assert_eq!(answer.header("access-control-allow-credentials"), "");
        let other = web.send("GET", path, &[("origin", "https://evil.example")], Bytes::new()).await;
        assert_eq!(other.header("access-control-allow-origin"), "", "{path}");
    }
    let asked = preflight(&web, "/v1/machines", ORIGIN, "GET", "if-none-match").await;
    assert_eq!(asked.status, StatusCode::NO_CONTENT, "{asked:?}");
    assert_eq!(asked.header("access-control-allow-origin"), ORIGIN);
    assert!(asked.header("access-control-allow-headers").contains("if-none-match"), "{asked:?}");
    assert!(asked.header("access-control-allow-methods").contains("GET"), "{asked:?}");
    assert_eq!(asked.header("access-control-max-age"), "86400");
}

#[tokio::test]
async fn grpc_web_has_the_same_origins_and_tells_status_and_message() {
    let server = allowing("['https://mes.example']").await;
    let web = Web::new(server.grpc);
    let path = "/feedwave.v1.Machines/ListStates";
    let asked = preflight(&web, path, ORIGIN, "POST", "content-type,x-grpc-web,x-user-agent").await;
    assert_eq!(asked.status, StatusCode::NO_CONTENT, "{asked:?}");
    assert_eq!(asked.header("access-control-allow-origin"), ORIGIN);
    for header in ["content-type", "x-grpc-web", "x-user-agent", "grpc-timeout"] {
        assert!(asked.header("access-control-allow-headers").contains(header), "{header}: {asked:?}");
    }
    let headers = [("origin", ORIGIN), ("content-type", "application/grpc-web+proto"), ("x-grpc-web", "1")];
    let empty = Bytes::from_static(&[0; 5]);
    let answer = web.send("POST", path, &headers, empty).await;
    assert_eq!((answer.status, answer.header("access-control-allow-origin")), (StatusCode::OK, ORIGIN));
    for header in ["grpc-status", "grpc-message", "grpc-status-details-bin"] {
        assert!(answer.header("access-control-expose-headers").contains(header), "{header}: {answer:?}");
    }
}

#[tokio::test]
async fn the_page_calls_its_few_methods_and_pages_of_other_origins_none_on_its_port() {
    let server = allowing("['https://mes.example']").await;
    let web = server.web();
    let headers = [("content-type", "application/grpc-web+proto"), ("x-grpc-web", "1")];
    let empty = || Bytes::from_static(&[0; 5]);
    let own = web.send("POST", "/feedwave.v1.Tools/ListTools", &headers, empty()).await;
    assert_eq!((own.status, own.header("content-type")), (StatusCode::OK, "application/grpc-web+proto"), "{own:?}");
    for path in ["/feedwave.v1.Runs/Run", "/feedwave.v1.Jobs/DeleteJob", "/feedwave.v1.Telemetry/Ingest"] {
        assert_eq!(web.send("POST", path, &headers, empty()).await.status, StatusCode::NOT_FOUND, "{path}");
    }
    let asked = preflight(&web, "/feedwave.v1.Tools/ListTools", ORIGIN, "POST", "content-type,x-grpc-web").await;
    assert!(!asked.header("access-control-allow-methods").contains("POST"), "{asked:?}");
    let state = web.send("GET", "/v1/state", &[], Bytes::new()).await;
    let state: serde_json::Value = serde_json::from_slice(&state.body).unwrap();
    assert_eq!(state["caller"]["roles"], serde_json::json!(["admin"]), "{state}");
    assert_eq!(state["inlineProgramBytes"], "1048576");
}

#[tokio::test]
async fn without_origins_nothing_is_said_of_them() {
    let server = Server::start(FEEDWAVE).await;
    let web = server.web();
    let answer = web.send("GET", "/v1/machines", &[("origin", ORIGIN)], Bytes::new()).await;
    assert_eq!(answer.header("access-control-allow-origin"), "");
    let asked = preflight(&web, "/v1/machines", ORIGIN, "GET", "if-none-match").await;
    assert_eq!(asked.status, StatusCode::METHOD_NOT_ALLOWED);
}
