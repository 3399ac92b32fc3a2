//! Tokens of an identity provider, shown to the built binary: roles, tenants and machines from claims, keys from a file and
//! behind a URL, and keys that change.

use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use bytes::Bytes;
use feedwave_tests::{Home, Server, patiently};
use ring::rand::SystemRandom;
use ring::signature::{Ed25519KeyPair, KeyPair as _};
use rustix::process::Signal;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpListener;

use crate::FEEDWAVE;
use crate::access::feedwave;

/// A key of a provider.
struct Key {
    id: &'static str,
    pair: Ed25519KeyPair,
}

impl Key {
    fn new(id: &'static str) -> Self {
        let pkcs8 = Ed25519KeyPair::generate_pkcs8(&SystemRandom::new()).unwrap();
        Self { id, pair: Ed25519KeyPair::from_pkcs8(pkcs8.as_ref()).unwrap() }
    }

    fn jwks(&self) -> String {
        let x = URL_SAFE_NO_PAD.encode(self.pair.public_key());
        json!({"keys": [{"kty": "OKP", "crv": "Ed25519", "kid": self.id, "x": x}]}).to_string()
    }

    /// A token of a client for ten minutes.
    fn token(&self, name: &str, roles: &[&str], otherwise: Value) -> String {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap() + Duration::from_secs(600);
        let mut claims = json!({"iss": "https://id.example", "aud": "feedwave", "exp": now.as_secs(), "sub": name,
            "realm_access": {"roles": roles}, "plant": "north"});
        for (name, value) in otherwise.as_object().unwrap() {
            claims[name] = value.clone();
        }
        let header = json!({"alg": "EdDSA", "kid": self.id, "typ": "JWT"});
        let part = |value: &Value| URL_SAFE_NO_PAD.encode(value.to_string());
        let message = format!("{}.{}", part(&header), part(&claims));
        let signature = URL_SAFE_NO_PAD.encode(self.pair.sign(message.as_bytes()));
        format!("{message}.{signature}")
    }
}

fn config(jwks: &str) -> String {
    format!(
        "[auth.jwt]\njwks = '{jwks}'\nissuer = 'https://id.example'\naudience = 'feedwave'\n\
         roles_claim = 'realm_access.roles'\nrole_prefix = 'feedwave-'\ntenant_claim = 'plant'\n\
         least_refresh_s = 1\n"
    )
}

async fn get(server: &Server, path: &str, token: &str) -> feedwave_tests::Answer {
    let value = format!("Bearer {token}");
    server.web().send("GET", path, &[("authorization", value.as_str())], Bytes::new()).await
}

#[tokio::test]
async fn claims_say_who_asks_and_what_may_be_done() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("jwks.json");
    let key = Key::new("first");
    std::fs::write(&file, key.jwks()).unwrap();
    let server = Home::new(FEEDWAVE, &config(file.to_str().unwrap())).start().await;
    let planner = key.token("anna", &["feedwave-planner", "offline_access"], json!({}));
    let program = folder.path().join("part.nc");
    std::fs::write(&program, "M30\n").unwrap();
    let url = format!("http://{}", server.grpc);
    let submit = ["submit", program.to_str().unwrap(), "--server", url.as_str(), "--wait"];
    let submitted = feedwave(&submit, &[("FEEDWAVE_TOKEN", planner.as_str())]).await;
    assert!(submitted.status.success(), "{submitted:?}");
    let jobs = get(&server, "/v1/jobs", &planner).await.json();
    assert_eq!(jobs["jobs"][0]["owner"], "jwt:anna");

    // Another plant sees nothing of it, and what is not right in every part is nobody's.
    let other = key.token("bert", &["feedwave-viewer"], json!({"plant": "south"}));
    assert_eq!(get(&server, "/v1/jobs", &other).await.json()["jobs"].as_array().map(Vec::len).unwrap_or(0), 0);
    let viewer = key.token("cora", &["feedwave-viewer"], json!({}));
    let refused = feedwave(&submit, &[("FEEDWAVE_TOKEN", viewer.as_str())]).await;
    assert!(!refused.status.success());
    let stranger = Key::new("first");
    for token in [
        stranger.token("anna", &["feedwave-admin"], json!({})),
        key.token("anna", &["feedwave-admin"], json!({"exp": 1})),
        key.token("anna", &["feedwave-admin"], json!({"aud": "another"})),
        key.token("anna", &["feedwave-admin"], json!({"iss": "https://id.example.org"})),
        key.token("anna", &["feedwave-admin"], json!({"nbf": 4_102_444_800_u64})),
        key.token("anna", &["feedwave-admin"], json!({"plant": null})),
        key.token("anna", &["admin"], json!({})),
    ] {
        assert_eq!(get(&server, "/v1/jobs", &token).await.status, 401);
    }
    let operator = key.token("dora", &["feedwave-admin"], json!({"plant": "*"}));
    let audit = get(&server, "/v1/audit?pageSize=500", &operator).await.json();
    let entries = audit["entries"].as_array().unwrap();
    assert!(entries.iter().any(|entry| entry["principal"] == "jwt:anna" && entry["tenant"] == "north"));
    assert!(entries.iter().any(|entry| entry["principal"] == "jwt:cora" && entry["result"] == "PERMISSION_DENIED"));
    assert!(entries.iter().any(|entry| entry["reason"].as_str().is_some_and(|why| why.contains("has ended"))));

    // Other keys from now on.
    let next = Key::new("next");
    std::fs::write(&file, next.jwks()).unwrap();
    server.signal(Signal::HUP);
    patiently(async { while get(&server, "/v1/jobs", &planner).await.status != 401 {} }).await;
    assert_eq!(get(&server, "/v1/jobs", &next.token("anna", &["feedwave-viewer"], json!({}))).await.status, 200);
    let log = server.log();
    assert!(!log.contains(&planner) && !log.contains(planner.rsplit('.').next().unwrap()));
}

#[tokio::test]
async fn keys_behind_a_url_are_found_when_they_come() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}/jwks", listener.local_addr().unwrap());
    let key = Key::new("only");
    let body = Arc::new(Mutex::new(String::new()));
    let answered = body.clone();
    tokio::spawn(async move {
        loop {
            let (mut stream, _) = listener.accept().await.unwrap();
            let body = answered.lock().unwrap().clone();
            let mut head = [0; 1_024];
            let _ = stream.read(&mut head).await;
            let answer = format!("HTTP/1.1 200 OK\r\ncontent-length: {}\r\n\r\n{body}", body.len());
            let _ = stream.write_all(answer.as_bytes()).await;
        }
    });
    // It starts without them, and says that nothing can be said about tokens.
    let server = Home::new(FEEDWAVE, &config(&url)).start().await;
    let token = key.token("anna", &["feedwave-viewer"], json!({}));
    let answer = get(&server, "/v1/jobs", &token).await;
    assert_eq!(answer.status, 503);
    assert!(answer.text().contains("IDENTITY_PROVIDER_UNAVAILABLE"), "{}", answer.text());
    *body.lock().unwrap() = key.jwks();
    patiently(async { while get(&server, "/v1/jobs", &token).await.status != 200 {} }).await;
    // Keys of a network without encryption are refused at the start.
    for (jwks, why) in [
        ("http://id.example/jwks", "use https"),
        ("https://id.example/jwks", "auth.jwt.jwks_ca"),
        ("/absent/jwks.json", "/absent/jwks.json"),
    ] {
        let file = server.home().path().join("refused.toml");
        std::fs::write(&file, config(jwks)).unwrap();
        let store = format!("sqlite://{}/other.db", server.home().path().display());
        let ports = ["--grpc-listen", "127.0.0.1:0", "--http-listen", "127.0.0.1:0", "--store", store.as_str()];
        let refused = feedwave(&[&["serve", "--config", file.to_str().unwrap()], &ports[..]].concat(), &[]).await;
        let message = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(!refused.status.success() && message.contains(why), "{message}");
    }
}
