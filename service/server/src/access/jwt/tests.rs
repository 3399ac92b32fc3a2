use std::sync::atomic::{AtomicUsize, Ordering};

use ::ring::rand::SystemRandom;
use ::ring::signature::{ECDSA_P256_SHA256_FIXED_SIGNING, EcdsaKeyPair, Ed25519KeyPair, KeyPair as _};
use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use serde_json::json;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpListener;

use super::*;

/// A key of RSA, and tokens signed by it until 2100: ring signs with keys of RSA that it is given, and makes none.
const RSA_N: &str = concat!(
    "sMSNNFXqfJ1NEOKKiRIFDQbWimNNZQD_oO-YoU3l5qwzVc_wL0poUzz3q8KGptWnGc0Yhte8-a0V7i_-0IxWL5MEfpDDfIEN4E9lSSiM8BrXjwbW",
    "4kNqS8rCYX0xuEN0SXU5eq4DN-4EnvmBoa7QIE4Q39BqUnTO0PqIkNtm6yG1mY2ppQIXR7WGPZd7T1QzXXqhMssQf4GXxWYDVzFWTJaNOX65jjNL",
    "yGeIAC-cJ1vHuqFY59faZneMsdbbLWvcb7m7NMRbe-G0FipcQmbFlTrp0WMe7u0S5DM7XcIlnAt9zo46o_CszyyXmmsEKUlGcJaKMZMtMmSkDaUy",
    "sX_CgQ",
);
const RS256: &str = concat!(
    "eyJhbGciOiAiUlMyNTYiLCAia2lkIjogInJzYSJ9.eyJpc3MiOiAiaHR0cHM6Ly9pZC5leGFtcGxlIiwgImF1ZCI6ICJmZWVkd2F2ZSIsICJzdWI",
    "iOiAicGxhbm5pbmciLCAicm9sZXMiOiBbInBsYW5uZXIiXSwgImV4cCI6IDQxMDI0NDQ4MDB9.V-UHGpRU2EPxUSIUW2imhC2sZX5uCPCpIKLIdK",
    "trjHexu1RNPsXAcVzpNtAwjP19Gtlqdp32IomRNfYY3W8_zqOCAs7eDs32-adzW21mUAu52-e3vaC6fMmsFlgqHg23HGq8dEh2JM33tHHpSDBXc4",
    "dPeoI9bInB8njR89K6Zv_jaAWoIGpb_LE8rmEnmVVgnKexAcssH0xIoXMhDyGKYF3Gq_L7HYv6EdU-2pT1QDcbps_FZQu57xUJAi5_OkpXBmK7ND",
    "3nA3JMISW1o1hQyqxacBHoZktsgXZ_F2kf313sA8O59XOjJALCzyzybxH4NVRAnEWsmRN92yVz4Hv5KA",
);
const PS384: &str = concat!(
    "eyJhbGciOiAiUFMzODQiLCAia2lkIjogInJzYSJ9.eyJpc3MiOiAiaHR0cHM6Ly9pZC5leGFtcGxlIiwgImF1ZCI6ICJmZWVkd2F2ZSIsICJzdWI",
    "iOiAicGxhbm5pbmciLCAicm9sZXMiOiBbInBsYW5uZXIiXSwgImV4cCI6IDQxMDI0NDQ4MDB9.GrfmPy1AP9rFLTv-JS2ZML8p-JDHl_J5fwWWDw",
    "hQMHSKgvFepXetYqY2Ou-w4880uWlGBJ0NaGsikjqb54J0SVJpPUYw1-GwLrBeLWwKpt2pYUgUYNa4jt4XjQz67WerBZowvW0-UdelC8qRqUlODt",
    "CiKmOtLZKZup90pel5M0u9xsqP2aSipgeJXe89TKwGi_vW5YD9zlkpEM3kP6d-_m_Z9sBvYd5oX8YoZUqD1bU28JYYMLXGyZYPrkp-pQBfDxtwdz",
    "qts3dr8S9BJSySRE9ihbde9fZkoI_O4WAAxGIypmT__aSB1KNI873kkLGpnOKMKsGJHkftbj0OLK4_Xg",
);

fn base64url(bytes: impl AsRef<[u8]>) -> String {
    URL_SAFE_NO_PAD.encode(bytes)
}

/// An identity provider with a key of each kind.
struct Issuer {
    ed25519: Ed25519KeyPair,
    p256: EcdsaKeyPair,
    random: SystemRandom,
}

impl Issuer {
    fn new() -> Self {
        let random = SystemRandom::new();
        let pkcs8 = Ed25519KeyPair::generate_pkcs8(&random).unwrap();
        let ed25519 = Ed25519KeyPair::from_pkcs8(pkcs8.as_ref()).unwrap();
        let algorithm = &ECDSA_P256_SHA256_FIXED_SIGNING;
        let pkcs8 = EcdsaKeyPair::generate_pkcs8(algorithm, &random).unwrap();
        let p256 = EcdsaKeyPair::from_pkcs8(algorithm, pkcs8.as_ref(), &random).unwrap();
        Self { ed25519, p256, random }
    }

    /// Its public keys; the first one is called `id`.
    fn jwks(&self, id: &str) -> String {
        let point = self.p256.public_key().as_ref();
        let keys = json!({"keys": [
            {"kty": "OKP", "crv": "Ed25519", "kid": id, "use": "sig", "x": base64url(self.ed25519.public_key())},
            {"kty": "EC", "crv": "P-256", "kid": "p256", "alg": "ES256", "x": base64url(&point[1..33]),
             "y": base64url(&point[33..])},
            {"kty": "RSA", "kid": "rsa", "key_ops": ["verify"], "n": RSA_N, "e": "AQAB"},
            {"kty": "oct", "kid": "secret", "alg": "HS256", "k": base64url("a secret that nobody may know")},
            {"kty": "RSA", "kid": "encrypting", "use": "enc", "n": RSA_N, "e": "AQAB"},
            {"kty": "of another time", "kid": "unknown"},
            {"kid": 7},
        ]});
        keys.to_string()
    }

    fn sign_as(&self, header: &Value, claims: &Value) -> String {
        let message = format!("{}.{}", base64url(header.to_string()), base64url(claims.to_string()));
        let signature = match header["alg"].as_str() {
            Some("ES256") => self.p256.sign(&self.random, message.as_bytes()).unwrap().as_ref().to_vec(),
            Some("HS256") => {
                let key = ::ring::hmac::Key::new(::ring::hmac::HMAC_SHA256, self.ed25519.public_key().as_ref());
                ::ring::hmac::sign(&key, message.as_bytes()).as_ref().to_vec()
            }
            Some("none") => Vec::new(),
            _ => self.ed25519.sign(message.as_bytes()).as_ref().to_vec(),
        };
        format!("{message}.{}", base64url(signature))
    }

    fn sign(&self, claims: &Value) -> String {
        self.sign_as(&json!({"alg": "EdDSA", "kid": "ed"}), claims)
    }
}

fn now() -> u64 {
    jsonwebtoken::get_current_timestamp()
}

/// Claims of a planner, with some of them otherwise; those that are null are left out.
fn claims(otherwise: Value) -> Value {
    let mut claims = json!({"iss": "https://id.example", "aud": ["other", "feedwave"], "sub": "planning",
        "roles": ["offline", "planner"], "exp": now() + 600});
    for (name, value) in otherwise.as_object().unwrap() {
        claims[name] = value.clone();
    }
    claims.as_object_mut().unwrap().retain(|_, value| !value.is_null());
    claims
}

fn config(jwks: &str) -> JwtConfig {
    JwtConfig {
        jwks: jwks.to_owned(),
        issuer: "https://id.example".to_owned(),
        audience: "feedwave".to_owned(),
        ..JwtConfig::default()
    }
}

/// A provider of keys in a file.
fn provider(issuer: &Issuer, otherwise: impl FnOnce(&mut JwtConfig)) -> Provider {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("jwks.json");
    std::fs::write(&path, issuer.jwks("ed")).unwrap();
    let mut config = config(path.to_str().unwrap());
    otherwise(&mut config);
    Provider::load(&config).unwrap()
}

async fn refusal(provider: &Provider, token: &str) -> String {
    match provider.identity(token).await {
        Err(Error::Unauthenticated { why }) => why.to_owned(),
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn tokens_of_every_algorithm_say_who_shows_them() {
    let issuer = Issuer::new();
    let known = provider(&issuer, |_| {});
    let es256 = issuer.sign_as(&json!({"alg": "ES256", "kid": "p256"}), &claims(json!({})));
    for token in [issuer.sign(&claims(json!({}))), es256, RS256.to_owned(), PS384.to_owned()] {
        let identity = known.identity(&token).await.unwrap();
        assert_eq!(identity.name(), "jwt:planning");
        assert!(identity.is(Role::Planner) && !identity.is(Role::Machine) && !identity.is(Role::Admin));
        assert_eq!(identity.tenants, Tenants::new(None).unwrap());
    }

    let known = provider(&issuer, |config| {
        config.name_claim = "client.id".to_owned();
        config.roles_claim = "https://id.example/roles".to_owned();
        config.role_prefix = "feedwave-".to_owned();
        config.tenant_claim = Some("plant".to_owned());
        config.machines_claim = Some("machines".to_owned());
    });
    let all = json!({"client": {"id": "mill-3"}, "https://id.example/roles": "admin feedwave-machine", "plant": "north",
        "machines": ["machines/mill"]});
    let identity = known.identity(&issuer.sign(&claims(all.clone()))).await.unwrap();
    assert_eq!((identity.name(), identity.tenants), ("jwt:mill-3", Tenants::new(Some("north")).unwrap()));
    assert!(identity.is(Role::Machine) && !identity.is(Role::Admin));
    assert!(identity.may_use("mill") && !identity.may_use("lathe"));
    for (name, value, why) in [
        ("plant", Value::Null, "no tenant"),
        ("plant", json!("North"), "no tenant"),
        ("plant", json!(["north"]), "no tenant"),
        ("client", json!("x"), "no name"),
        ("client", json!({"id": "a\nb"}), "no name"),
        ("https://id.example/roles", json!("planner machine"), "no role"),
    ] {
        let mut otherwise = all.clone();
        otherwise[name] = value;
        let why_not = refusal(&known, &issuer.sign(&claims(otherwise))).await;
        assert!(why_not.contains(why), "{name}: {why_not}");
    }
}

#[tokio::test]
async fn what_is_not_right_in_every_part_is_refused() {
    let issuer = Issuer::new();
    let known = provider(&issuer, |_| {});
    let now = now();
    for (otherwise, why) in [
        (json!({"exp": now - 60}), "has ended"),
        (json!({"exp": null}), "exp, iss and aud"),
        (json!({"exp": "4102444800"}), "exp, iss and aud"),
        (json!({"nbf": now + 600}), "does not begin"),
        (json!({"nbf": "0"}), "a form that cannot be read"),
        (json!({"iss": "https://id.example/"}), "another issuer"),
        (json!({"iss": null}), "exp, iss and aud"),
        (json!({"aud": "feedwav"}), "another service"),
        (json!({"aud": null}), "exp, iss and aud"),
        (json!({"roles": []}), "no role"),
        (json!({"roles": "Admin"}), "no role"),
        (json!({"sub": ""}), "no name"),
        (json!({"sub": "x".repeat(300)}), "too long"),
        (json!({"sub": "x".repeat(9_000)}), "too long"),
    ] {
        let why_not = refusal(&known, &issuer.sign(&claims(otherwise.clone()))).await;
        assert!(why_not.contains(why), "{otherwise}: {why_not}");
    }
    // Within the leeway of clocks.
    known.identity(&issuer.sign(&claims(json!({"exp": now - 10, "nbf": now + 10})))).await.unwrap();

    // No algorithm, a secret made of a public key, and keys used for what they are not for.
    for (header, why) in [
        (json!({"alg": "none", "kid": "ed"}), "no JWT"),
        (json!({"alg": "HS256", "kid": "ed"}), "another algorithm"),
        (json!({"alg": "HS256", "kid": "secret"}), "no known key"),
        (json!({"alg": "ES256", "kid": "ed"}), "another algorithm"),
        (json!({"alg": "EdDSA", "kid": "p256"}), "another algorithm"),
        (json!({"alg": "EdDSA", "kid": "encrypting"}), "no known key"),
        (json!({"alg": "EdDSA", "kid": "other"}), "no known key"),
        (json!({"alg": "EdDSA"}), "no known key"),
        (json!({"alg": "EdDSA", "kid": "ed", "crit": ["b64"], "b64": false}), "not known here"),
    ] {
        let why_not = refusal(&known, &issuer.sign_as(&header, &claims(json!({})))).await;
        assert!(why_not.contains(why), "{header}: {why_not}");
    }
    // Keys that come with the token are nobody's.
    let other = Issuer::new();
    let jwk = json!({"kty": "OKP", "crv": "Ed25519", "x": base64url(other.ed25519.public_key())});
    let token = other.sign_as(&json!({"alg": "EdDSA", "kid": "ed", "jwk": jwk}), &claims(json!({})));
    assert!(refusal(&known, &token).await.contains("signature"));
    let (head, _) = RS256.rsplit_once('.').unwrap();
    for token in [format!("{head}."), format!("{head}.{}", base64url([0; 256])), "a.b".to_owned(), "..".to_owned()] {
        refusal(&known, &token).await;
    }
    let (head, signature) = RS256.rsplit_once('.').unwrap();
    let (header, _) = head.split_once('.').unwrap();
    let more = base64url(claims(json!({"roles": ["admin"]})).to_string());
    assert!(refusal(&known, &format!("{header}.{more}.{signature}")).await.contains("signature"));
}

#[test]
fn sets_of_keys_are_bounded_and_one_that_has_none_is_an_answer() {
    let refused = |text: &str| KeySet::parse(text.as_bytes()).err().unwrap();
    assert!(refused("{}").contains("no set of keys"));
    assert!(refused("{\"keys\": [{}]}").contains("has a kind"));
    assert!(refused("{\"keys\": [{\"kty\": 1}]}").contains("has a kind"));
    assert!(refused("{\"keys\": [null]}").contains("has a kind"));
    for none in ["{\"keys\": []}", "{\"keys\": [{\"kty\": \"oct\", \"kid\": \"a\", \"k\": \"AAAA\"}]}"] {
        assert!(KeySet::parse(none.as_bytes()).unwrap().find(Some("a")).is_none());
    }
    let many = json!({"keys": vec![json!({"kty": "RSA"}); 101]});
    assert!(refused(&many.to_string()).contains("more than 100"));
}

/// A provider's HTTP port: answers every request with what there is at the time, and counts them.
async fn serve(answer: Arc<Mutex<String>>, asked: Arc<AtomicUsize>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move {
        loop {
            let (mut stream, _) = listener.accept().await.unwrap();
            asked.fetch_add(1, Ordering::SeqCst);
            let mut head = Vec::new();
            while !head.ends_with(b"\r\n\r\n") {
                let mut byte = [0];
                stream.read_exact(&mut byte).await.unwrap();
                head.push(byte[0]);
            }
            assert!(head.starts_with(b"GET /keys?of=all HTTP/1.1\r\n"), "{}", String::from_utf8_lossy(&head));
            let answer = answer.lock().unwrap().clone();
            let _ = stream.write_all(answer.as_bytes()).await;
        }
    });
    format!("http://{address}/keys?of=all")
}

fn ok(body: &str) -> String {
    format!("HTTP/1.1 200 OK\r\ncontent-length: {}\r\n\r\n{body}", body.len())
}

#[tokio::test]
async fn keys_behind_a_url_are_asked_for_when_a_token_names_another_and_not_too_often() {
    let issuer = Issuer::new();
    let (answer, asked) = (Arc::new(Mutex::new(String::new())), Arc::new(AtomicUsize::new(0)));
    let url = serve(answer.clone(), asked.clone()).await;
    let set = |text: String| *answer.lock().unwrap() = text;
    let token = issuer.sign(&claims(json!({})));

    // Without keys nothing can be said about a token, whatever the provider answers instead of them.
    let eager = Provider::load(&JwtConfig { least_refresh_s: 0, ..config(&url) }).unwrap();
    let long = ok(&" ".repeat(MAX_BYTES + 1));
    let elsewhere = format!("HTTP/1.1 302 Found\r\nlocation: {url}\r\ncontent-length: 0\r\n\r\n");
    for wrong in [String::new(), "no HTTP".to_owned(), long, elsewhere, ok("{}")] {
        set(wrong);
        let status = eager.identity(&token).await.unwrap_err();
        assert_eq!(status.reason(), "IDENTITY_PROVIDER_UNAVAILABLE");
    }
    set(ok(&issuer.jwks("ed")));
    eager.identity(&token).await.unwrap();
    let before = asked.load(Ordering::SeqCst);
    eager.identity(&token).await.unwrap();
    assert_eq!(asked.load(Ordering::SeqCst), before, "known keys are not asked for");

    // Another key from now on; what was known stays when the provider is gone.
    let next = issuer.sign_as(&json!({"alg": "EdDSA", "kid": "next"}), &claims(json!({})));
    assert!(refusal(&eager, &next).await.contains("no known key"));
    set(ok(&issuer.jwks("next")));
    eager.identity(&next).await.unwrap();
    assert!(refusal(&eager, &token).await.contains("no known key"));
    for unreadable in [String::new(), ok("{}"), ok("{\"keys\": [{}]}")] {
        set(unreadable);
        eager.refresh(Duration::ZERO).await;
        eager.identity(&next).await.unwrap();
    }
    // A set without keys says that they are revoked.
    set(ok("{\"keys\": []}"));
    eager.refresh(Duration::ZERO).await;
    assert!(refusal(&eager, &next).await.contains("no known key"));
    set(ok(&issuer.jwks("next")));
    eager.identity(&next).await.unwrap();

    // However many tokens name other keys, and at once: the provider is asked once.
    set(ok(&issuer.jwks("ed")));
    let patient = Provider::load(&JwtConfig { least_refresh_s: 3_600, ..config(&url) }).unwrap();
    let before = asked.load(Ordering::SeqCst);
    let tries = (0..50).map(|_| patient.identity(&next));
    for refused in futures_util::future::join_all(tries).await {
        assert_eq!(refused.unwrap_err().reason(), "UNAUTHENTICATED");
    }
    patient.identity(&token).await.unwrap();
    assert_eq!(asked.load(Ordering::SeqCst), before + 1);

    // Keys that were not confirmed for too long are none.
    let forgetful = Provider::load(&JwtConfig { stale_s: 0, ..config(&url) }).unwrap();
    assert_eq!(forgetful.identity(&token).await.unwrap_err().reason(), "IDENTITY_PROVIDER_UNAVAILABLE");
}
