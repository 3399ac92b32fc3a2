//! Encryption of the gRPC port: the probe of the container and a client behind it. The certificates in `fixtures/tls` are for
//! these tests alone: an authority whose key is gone, and a server and a client signed by it, both named `feedwave.test`.

use std::process::Output;

use feedwave_server::config::{GrpcConfig, TlsConfig};

use super::service::Service;
use super::{code, feedwave, fixture, stderr};

fn file(name: &str) -> String {
    fixture("tls").join(name).display().to_string()
}

fn encrypted(cert: &str, client_ca: Option<&str>) -> Service {
    let tls = TlsConfig {
        cert: cert.into(),
        key: file("server-key.pem").into(),
        client_ca: client_ca.map(|name| file(name).into()),
        ..TlsConfig::default()
    };
    Service::with(GrpcConfig { tls: Some(tls), ..GrpcConfig::default() })
}

/// The probe as a container runs it: with nothing but the variables that the service has.
fn probe(service: &Service, variables: &[(&str, String)]) -> Output {
    let mut command = feedwave();
    command
        .args(["healthcheck", "--timeout", "600"])
        .env("FEEDWAVE_GRPC__LISTEN", service.address().to_string())
        .env("FEEDWAVE_GRPC__TLS__CERT", file("server.pem"))
        .env("FEEDWAVE_GRPC__TLS__KEY", file("server-key.pem"));
    command.envs(variables.iter().map(|(name, value)| (*name, value.as_str()))).output().unwrap()
}

#[track_caller]
fn assert_refused(output: &Output, why: &str) {
    assert!(code(output) == 1 && stderr(output).contains(why), "{}: {}", code(output), stderr(output));
}

#[track_caller]
fn assert_healthy(output: &Output) {
    assert_eq!(code(output), 0, "{}", stderr(output));
}

fn domain() -> (&'static str, String) {
    ("FEEDWAVE_HEALTHCHECK__DOMAIN", "feedwave.test".to_owned())
}

fn ca(name: &str) -> (&'static str, String) {
    ("FEEDWAVE_HEALTHCHECK__CA", file(name))
}

#[test]
fn the_probe_finds_the_authority_and_the_name_in_its_configuration() {
    let service = encrypted(&file("server.pem"), None);
    assert_healthy(&probe(&service, &[domain(), ca("ca.pem")]));
    // The certificate holds a name and no address.
    assert_refused(&probe(&service, &[ca("ca.pem")]), "not valid for name");
    assert_refused(&probe(&service, &[domain(), ca("other-ca.pem")]), "UnknownIssuer");
    // The same from a file.
    let directory = tempfile::tempdir().unwrap();
    let config = directory.path().join("feedwave.toml");
    let section = format!("[healthcheck]\nca = '{}'\ndomain = 'feedwave.test'\n", file("ca.pem"));
    std::fs::write(&config, section).unwrap();
    assert_healthy(&probe(&service, &[("FEEDWAVE_CONFIG", config.display().to_string())]));
}

#[test]
fn the_chain_that_the_service_shows_is_trusted_without_being_named_again() {
    let chain = ["server.pem", "ca.pem"].map(|name| std::fs::read_to_string(file(name)).unwrap()).concat();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("chain.pem");
    std::fs::write(&path, chain).unwrap();
    let path = path.display().to_string();
    let service = encrypted(&path, None);
    assert_healthy(&probe(&service, &[domain(), ("FEEDWAVE_GRPC__TLS__CERT", path)]));
}

#[test]
fn under_mutual_tls_probe_and_client_show_their_own_certificate() {
    let service = encrypted(&file("server.pem"), Some("ca.pem"));
    let asked = ("FEEDWAVE_GRPC__TLS__CLIENT_CA", file("ca.pem"));
    let cert = ("FEEDWAVE_HEALTHCHECK__CERT", file("client.pem"));
    let key = ("FEEDWAVE_HEALTHCHECK__KEY", file("client-key.pem"));
    let without = [asked, domain(), ca("ca.pem")];
    assert_refused(&probe(&service, &without), "set healthcheck.cert and healthcheck.key");
    let half = [&without[..], std::slice::from_ref(&cert)].concat();
    let half = probe(&service, &half);
    assert!(
        code(&half) == 78 && stderr(&half).contains("healthcheck.cert: needs healthcheck.key"),
        "{}",
        stderr(&half)
    );
    assert_healthy(&probe(&service, &[&without[..], &[cert, key]].concat()));

    let program = fixture("spec-trap.nc").display().to_string();
    let server = format!("https://{}", service.address());
    let submit = |identity: &[(&str, String)]| {
        let mut command = feedwave();
        command.args(["submit", &program, "--server", &server]).env("FEEDWAVE_DOMAIN", "feedwave.test");
        command.env("FEEDWAVE_CA", file("ca.pem"));
        command.envs(identity.iter().map(|(name, value)| (*name, value.as_str()))).output().unwrap()
    };
    let identity = [("FEEDWAVE_CERT", file("client.pem")), ("FEEDWAVE_KEY", file("client-key.pem"))];
    let served = submit(&identity);
    assert_eq!(code(&served), 0, "{}", stderr(&served));
    assert_eq!(code(&submit(&[])), 2);
}

#[test]
fn certificates_are_not_taken_for_a_connection_without_encryption() {
    let options =
        [["--ca", "ca.pem"].as_slice(), &["--cert", "client.pem", "--key", "client-key.pem"], &["--domain", "a"]];
    for command in ["healthcheck", "watch"] {
        for options in options {
            let output = feedwave().args([command, "--server", "http://127.0.0.1:1"]).args(options).output().unwrap();
            let refused = code(&output) == 2 && stderr(&output).contains("would not be encrypted");
            assert!(refused, "{command} {options:?}: {} {}", code(&output), stderr(&output));
        }
        let output = feedwave().args([command, "--server", "foo"]).output().unwrap();
        assert!(code(&output) == 2 && stderr(&output).contains("foo: is no URL"), "{command}: {}", stderr(&output));
    }
}
