//! What those can do whom the service does not know, and what a wrong entry in the file of clients would do.

use bytes::Bytes;
use feedwave_contract::proto::DESCRIPTORS;
use feedwave_tests::{Home, Web, patiently};
use tokio::task::JoinSet;

use crate::FEEDWAVE;
use crate::access::{feedwave, token};

/// A call over gRPC-Web without a message; the reason of its refusal.
async fn reason_of_call(web: &Web, path: &str, headers: &[(&str, &str)]) -> String {
    let headers: Vec<_> = [("content-type", "application/grpc-web+proto")].iter().chain(headers).copied().collect();
    let answer = web.send("POST", path, &headers, Bytes::new()).await;
    answer.header("grpc-message").replace("%20", " ")
}

/// Whoever has no credentials cannot fill the audit log: refusals are counted, from the first one on.
#[tokio::test]
async fn refusals_of_a_stranger_are_counted_in_few_entries() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("clients.toml");
    let admin = token(&file, "chief", &["--role", "admin"]).await;
    let viewer = format!("Bearer {}", token(&file, "dashboard", &["--role", "viewer"]).await);
    let server = Home::new(FEEDWAVE, &format!("[auth]\nclients = '{}'", file.display())).start().await;

    // Many at once of one method, and every method there is.
    let mut calls = JoinSet::new();
    let grpc = server.grpc;
    for _ in 0..60 {
        calls.spawn(async move { reason_of_call(&Web::new(grpc), "/feedwave.v1.Jobs/GetJob", &[]).await });
    }
    let mut count = calls.join_all().await.len() as u64;
    let web = Web::new(grpc);
    let mut denied = 0;
    for service in DESCRIPTORS.services().filter(|service| service.package_name() == "feedwave.v1") {
        for method in service.methods() {
            let path = format!("/{}/{}", service.full_name(), method.name());
            let why = reason_of_call(&web, &path, &[]).await;
            assert!(why.contains("it is not known who asks"), "{path}: {why}");
            count += 1;
        }
    }
    // Beside that noise, from the same address, what a client that is known may not do: the first kinds of it apart.
    for service in DESCRIPTORS.services().filter(|service| service.package_name() == "feedwave.v1") {
        for method in service.methods() {
            let path = format!("/{}/{}", service.full_name(), method.name());
            let why = reason_of_call(&web, &path, &[("authorization", &viewer)]).await;
            denied += u64::from(why.contains("needs the role"));
        }
    }
    assert!(denied > 16, "{denied}");
    count += denied;
    let value = format!("Bearer {admin}");
    let log = async || {
        let headers = [("authorization", value.as_str())];
        let page = server.web().send("GET", "/v1/audit?pageSize=1000", &headers, Bytes::new()).await.json();
        page["entries"].as_array().cloned().unwrap_or_default()
    };
    let occurrences = |entries: &[serde_json::Value]| -> u64 {
        entries.iter().map(|entry| entry["occurrences"].as_str().unwrap().parse::<u64>().unwrap()).sum()
    };
    patiently(async { while occurrences(&log().await) < count {} }).await;
    let entries = log().await;
    assert_eq!(occurrences(&entries), count);
    // Sixteen kinds and the rest together, of either; a minute may have passed once meanwhile.
    let (known, entries): (Vec<_>, Vec<_>) = entries.into_iter().partition(|entry| entry["principal"] == "dashboard");
    for entries in [&known, &entries] {
        assert!((17..=2 * 17).contains(&entries.len()), "{entries:?}");
    }
    assert_eq!(occurrences(&known), denied);
    assert_eq!(known[0]["method"], "/feedwave.v1.Audit/ListAuditEntries");
    assert!(known.iter().all(|entry| entry["result"] == "PERMISSION_DENIED"));
    let together: Vec<_> =
        entries.iter().filter(|entry| entry["method"].as_str().unwrap_or_default().is_empty()).collect();
    assert!(!together.is_empty());
    for entry in together {
        assert_eq!(entry["address"], "127.0.0.1");
        assert_eq!(entry["result"], "UNAUTHENTICATED");
        assert!(entry["reason"].as_str().unwrap().contains("more than are counted apart"), "{entry}");
    }
}

/// A page of another site that has its own name point to this computer is not answered where nobody has to say who they are.
#[tokio::test]
async fn a_service_without_clients_is_reached_by_its_own_names_alone() {
    let server = Home::new(FEEDWAVE, "[auth]\nhosts = ['cell-4']").start().await;
    let (web, grpc) = (server.web(), Web::new(server.grpc));
    let jobs = async |host: &str| web.send("GET", "/v1/jobs", &[("host", host)], Bytes::new()).await;
    let list = async |host: &str| reason_of_call(&grpc, "/feedwave.v1.Jobs/ListJobs", &[("host", host)]).await;
    for host in [
        "evil.example",
        "evil.example:8080",
        "127.0.0.1.evil.example",
        "localhost.evil.example",
        // No host of HTTP, and one of browsers.
        "a{b.evil.example",
        "a`b.evil.example",
        "a%62.evil.example",
        "[::1].evil.example",
        "evil.example:80:80",
        "cell-5",
    ] {
        let answer = jobs(host).await;
        assert_eq!(answer.status, 403, "{host}");
        assert!(answer.text().contains("HOST_DENIED"), "{}", answer.text());
        assert!(list(host).await.contains("auth.hosts"), "{host}");
    }
    for host in ["localhost", "LOCALHOST:8080", "127.0.0.1:1", "[::1]:8080", "cell-4", "Cell-4:50051"] {
        assert_eq!(jobs(host).await.status, 200, "{host}");
        assert!(!list(host).await.contains("auth.hosts"), "{host}");
    }
    // Who tried is in the audit log.
    let log = web.get("/v1/audit").await;
    let refused: serde_json::Value = serde_json::from_slice(&log.body).expect("JSON");
    let refused =
        refused["entries"].as_array().expect("entries").iter().filter(|it| it["result"] == "PERMISSION_DENIED");
    let methods: Vec<_> = refused.map(|entry| entry["method"].as_str().unwrap_or_default()).collect();
    assert!(methods.contains(&"GET /v1/jobs") && methods.iter().any(|it| it.ends_with("ListJobs")), "{methods:?}");
    // Probes are for everybody.
    let health = web.send("GET", "/healthz", &[("host", "evil.example")], Bytes::new()).await;
    assert_eq!(health.status, 200);
}

/// A page of another site can have a browser send forms and texts without being asked first: these are no calls.
#[tokio::test]
async fn the_grpc_port_refuses_what_is_no_call_over_http_1_too() {
    let server = Home::new(FEEDWAVE, "").start().await;
    let web = Web::new(server.grpc);
    for kind in ["text/plain", "application/x-www-form-urlencoded", "application/json"] {
        let headers = [("content-type", kind)];
        let answer = web.send("POST", "/feedwave.v1.Jobs/ListJobs", &headers, Bytes::new()).await;
        assert_eq!(answer.status, 415, "{kind}");
    }
    assert_eq!(web.get("/").await.status, 415);
}

/// What would make the file of clients one that the service refuses is not added to it.
#[tokio::test]
async fn an_entry_that_cannot_be_used_is_not_added() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("clients.toml");
    token(&file, "chief", &["--role", "admin"]).await;
    let before = std::fs::read_to_string(&file).unwrap();
    let clients = file.to_str().unwrap();
    for (name, more, why) in [
        ("chief", vec![], "a name that no other has"),
        ("north", vec!["--tenant", "North"], "has a tenant that is neither"),
        ("guest", vec!["--expires", "2027-01-01"], "no time such as"),
    ] {
        let arguments = ["token", name, "--role", "viewer", "--clients", clients];
        let refused = feedwave(&[&arguments[..], &more].concat(), &[]).await;
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(!refused.status.success() && refused.stdout.is_empty() && said.contains(why), "{said}");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), before);
    }
    // And the service starts with what there is.
    let server = Home::new(FEEDWAVE, &format!("[auth]\nclients = '{clients}'")).start().await;
    assert_eq!(server.web().get("/readyz").await.status, 200);
}
