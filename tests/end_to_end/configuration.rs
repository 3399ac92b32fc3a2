//! Configuration that cannot be used is refused; the example is complete and can be used.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Output;

use feedwave_server::config::{
    Config, HealthcheckConfig, JwtConfig, MqttConfig, Overrides, RetentionConfig, StoreConfig, TlsConfig,
};
use tokio::process::Command;

use crate::FEEDWAVE;

fn example() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../deploy/feedwave.example.toml"))
}

/// Runs `feedwave serve` with a configuration that must stop it.
async fn refused(config: &str, environment: &[(&str, &str)]) -> Output {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let file = directory.path().join("shop.toml");
    std::fs::write(&file, config).expect("the configuration is written");
    let mut command = Command::new(FEEDWAVE);
    command.args(["serve", "--config"]).arg(file).envs(environment.iter().copied()).kill_on_drop(true);
    command.output().await.expect("the binary is started")
}

#[tokio::test]
async fn a_bad_value_is_refused_with_its_file_its_key_and_the_reason() {
    let cases = [
        ("[limits]\ndrain_seconds = 3\n", "limits.drain_seconds", "unknown key"),
        ("[limits]\nmessage_bytes = 1\n", "limits.message_bytes", "must be 65536 to"),
        (
            "[limits]\nunfinished_upload_bytes_per_client = 1000\n",
            "limits.unfinished_upload_bytes_per_client",
            "must be 2147483648 to",
        ),
        ("[grpc]\nlisten = 'everywhere'\n", "grpc.listen", "invalid socket address"),
        ("[grpc]\nlisten = \n", "", "shop.toml"),
        ("[log]\nlevel = 'info,loud'\n", "log.level", "\"loud\" is neither off, error"),
        ("[store]\nuri = 'feedwave.db'\n", "store.uri", "it has no scheme"),
        ("[store]\nuri = 'sqlite:///1.db'\n[database]\npath = '/2.db'\n", "database.path", "keep store.uri alone"),
    ];
    for (config, key, reason) in cases {
        let output = refused(config, &[]).await;
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(78), "{config}: {message}");
        for part in ["shop.toml", key, reason] {
            assert!(message.contains(part), "{part:?} is not in {message:?}");
        }
    }
}

/// A default may not go with what was set.
#[tokio::test]
async fn a_default_that_is_refused_is_called_one() {
    let output = refused("[limits]\nmessage_bytes = 65536\n", &[]).await;
    let message = String::from_utf8_lossy(&output.stderr);
    let expected = "default value: limits.inline_program_bytes: must be 1 to 32768, is 1048576";
    assert!(output.status.code() == Some(78) && message.contains(expected), "{message}");
}

#[tokio::test]
async fn files_that_are_not_what_they_should_be_are_refused_with_their_key() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let place = |name: &str| directory.path().join(name).display().to_string();
    std::fs::write(place("bad"), "neither a certificate nor a client\n").expect("a file");
    let fixture = |name: &str| format!("{}/../../tests/fixtures/tls/{name}", env!("CARGO_MANIFEST_DIR"));
    let pair = |cert: &str, key: &str| format!("[tls]\ncert = '{cert}'\nkey = '{key}'\n");
    for (section, key) in [
        (pair(&place("bad"), &fixture("server-key.pem")), "tls.cert: "),
        (pair(&fixture("server.pem"), &place("bad")), "tls.key: "),
        (pair(&fixture("server.pem"), &fixture("client-key.pem")), "tls.cert: "),
        (format!("[auth]\nclients = '{}'\n", place("bad")), "auth.clients: "),
    ] {
        let ports = "[grpc]\nlisten = '127.0.0.1:0'\n[http]\nlisten = '127.0.0.1:0'\n";
        let output = refused(&format!("[store]\nuri = 'sqlite://{}'\n{ports}{section}", place("a.db")), &[]).await;
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(78), "{section}: {message}");
        assert!(message.contains(key), "{key} is not in {message}");
    }
}

#[tokio::test]
async fn a_folder_is_no_configuration() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let output = Command::new(FEEDWAVE).args(["serve", "--config"]).arg(directory.path()).output().await;
    let output = output.expect("the binary is started");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(78), "{message}");
    assert!(message.contains("is a folder"), "{message}");
}

#[tokio::test]
async fn a_bad_variable_is_refused_with_its_key() {
    let output = refused("", &[("FEEDWAVE_LIMITS__CONCURRENT_STREAMS", "0")]).await;
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(78), "{message}");
    assert!(message.contains("limits.concurrent_streams") && message.contains("environment"), "{message}");
}

#[tokio::test]
async fn a_store_that_cannot_be_opened_is_named() {
    let output = refused("[store]\nuri = 'sqlite:///absent/feedwave.db'\n", &[]).await;
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "{message}");
    let expected = "store.uri: sqlite:///absent/feedwave.db: the database cannot be opened: its folder does not exist";
    assert!(message.contains(expected), "{message}");
    // The former name is warned of before anything fails.
    let output = refused("[database]\npath = '/absent/feedwave.db'\n", &[]).await;
    let message = String::from_utf8_lossy(&output.stderr);
    let warning = "set store.uri to sqlite:///absent/feedwave.db in its stead";
    assert!(message.contains(warning) && message.contains(expected), "{message}");
}

#[test]
fn a_larger_program_raises_the_bytes_of_unfinished_uploads_that_are_not_stated() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let file = directory.path().join("shop.toml");
    for (upload_bytes, all, of_a_client) in
        [(2 << 30, 16 << 30, 4 << 30), (8 << 30, 16 << 30, 8 << 30), (1_u64 << 40, 1 << 40, 1 << 40)]
    {
        std::fs::write(&file, format!("[limits]\nupload_bytes = {upload_bytes}\n"))
            .expect("the configuration is written");
        let limits = Config::load(Some(&file), &Overrides::default()).expect("the configuration is accepted").limits;
        assert_eq!(limits.max_unfinished_upload_bytes(), all);
        assert_eq!(limits.max_unfinished_upload_bytes_per_client(), of_a_client);
    }
}

#[test]
fn the_example_states_every_key_with_its_default() {
    let loaded = Config::load(Some(example()), &Overrides::default()).expect("the example is accepted");
    let mut expected = Config::default();
    // The default depends on the machine; the example has to name a number.
    expected.limits.validation_workers = loaded.limits.validation_workers;
    assert_eq!(loaded, expected);

    let tls =
        TlsConfig { cert: "cert".into(), key: "key".into(), client_ca: Some("ca".into()), ..TlsConfig::default() };
    let mut full = expected;
    full.auth.clients = Some("clients".into());
    full.auth.jwt = Some(JwtConfig {
        jwks_ca: Some("ca".into()),
        tenant_claim: Some(String::new()),
        machines_claim: Some(String::new()),
        ..JwtConfig::default()
    });
    full.grpc.tls = Some(tls.clone());
    full.tls = Some(tls);
    full.healthcheck = HealthcheckConfig {
        ca: Some("ca".into()),
        cert: Some("cert".into()),
        key: Some("key".into()),
        domain: Some("name".to_owned()),
    };
    full.store = StoreConfig::of_file(Path::new("feedwave.db")).expect("a path");
    full.store.objects.uri = Some("file:///programs".parse().expect("a URI"));
    full.limits.unfinished_upload_bytes = Some(1);
    full.limits.unfinished_upload_bytes_per_client = Some(1);
    full.retention = RetentionConfig {
        jobs_days: Some(1),
        runs_days: Some(1),
        programs_days: Some(1),
        events_days: Some(1),
        audit_days: Some(1),
        max_bytes: Some(1),
        ..RetentionConfig::default()
    };
    full.mtconnect.listen = Some(([127, 0, 0, 1], 5_000).into());
    full.mqtt = MqttConfig {
        broker: Some(String::new()),
        user: Some(String::new()),
        password_file: Some("password".into()),
        ca: Some("ca".into()),
        cert: Some("cert".into()),
        key: Some("key".into()),
        ..MqttConfig::default()
    };
    full.telemetry.otlp_endpoint = Some(String::new());
    let full = serde_json::to_value(full).expect("configuration is serializable");
    let mut keys = BTreeSet::new();
    collect_keys(&full, "", &mut keys);
    let text = std::fs::read_to_string(example()).expect("the example is there");
    assert_eq!(keys_of_example(&text), keys);
}

fn collect_keys(value: &serde_json::Value, path: &str, keys: &mut BTreeSet<String>) {
    match value {
        serde_json::Value::Object(fields) => {
            for (name, value) in fields {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                collect_keys(value, &path, keys);
            }
        }
        _ => {
            keys.insert(path.to_owned());
        }
    }
}

/// Keys of the example, those that are commented out included.
fn keys_of_example(text: &str) -> BTreeSet<String> {
    let mut section = String::new();
    let mut keys = BTreeSet::new();
    for line in text.lines() {
        let line = line.trim_start_matches("# ");
        if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            name.clone_into(&mut section);
        } else if let Some((key, _)) = line.split_once(" = ")
            && key.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_')
        {
            keys.insert(format!("{section}.{key}"));
        }
    }
    keys
}
