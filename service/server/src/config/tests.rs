//! Where values come from, and how bad ones are refused. `figment::Jail` gives every test its own directory and
//! environment.

use std::path::Path;

use figment::Jail;

use super::*;

fn load(file: &str) -> Result<Config, ConfigError> {
    Config::load(Some(Path::new(file)), &Overrides::default())
}

fn problems(result: Result<Config, ConfigError>) -> Vec<(String, String, String)> {
    let ConfigError(problems) = result.unwrap_err();
    problems.into_iter().map(|problem| (problem.place, problem.key, problem.reason)).collect()
}

#[test]
fn the_defaults_are_usable() {
    assert_eq!(Config::default().problems(), []);
}

#[test]
#[expect(clippy::result_large_err, reason = "the closure's type is figment's")]
fn flags_win_over_environment_over_file_over_defaults() {
    Jail::expect_with(|jail| {
        jail.create_file(
            "feedwave.toml",
            "[grpc]\nlisten = '127.0.0.1:1'\n[http]\nlisten = '127.0.0.1:2'\n[limits]\ndrain_s = 3\n",
        )?;
        jail.set_env("FEEDWAVE_HTTP__LISTEN", "127.0.0.1:20");
        jail.set_env("FEEDWAVE_LIMITS__DRAIN_S", "30");
        let flags = Overrides::default().set("limits.drain_s", Some(300)).set("store.uri", None::<String>);
        let config = Config::load(Some(Path::new("feedwave.toml")), &flags).unwrap();
        assert_eq!(config.grpc.listen, "127.0.0.1:1".parse().unwrap());
        assert_eq!(config.http.listen, "127.0.0.1:20".parse().unwrap());
        assert_eq!(config.limits.drain_s, 300);
        assert_eq!(config.store, StoreConfig::default());
        Ok(())
    });
}

#[test]
#[expect(clippy::result_large_err, reason = "the closure's type is figment's")]
fn an_unknown_key_is_refused_with_its_file() {
    Jail::expect_with(|jail| {
        jail.create_file("feedwave.toml", "[limits]\ndrain_seconds = 3\n")?;
        let found = problems(load("feedwave.toml"));
        assert_eq!(found.len(), 1, "{found:?}");
        let (place, key, reason) = &found[0];
        assert!(place.ends_with("feedwave.toml"), "{place}");
        assert_eq!(key, "limits.drain_seconds");
        assert!(reason.contains("drain_s"), "{reason}");
        Ok(())
    });
}

#[test]
#[expect(clippy::result_large_err, reason = "the closure's type is figment's")]
fn every_value_out_of_range_is_named() {
    Jail::expect_with(|jail| {
        jail.create_file(
            "feedwave.toml",
            "[limits]\nvalidation_workers = 0\nupload_bytes = 0\n[log]\nlevel = 'a=b=c'\n",
        )?;
        jail.set_env("FEEDWAVE_LIMITS__CONCURRENT_STREAMS", "0");
        let found = problems(load("feedwave.toml"));
        let keys: Vec<_> = found.iter().map(|(_, key, _)| key.as_str()).collect();
        assert_eq!(
            keys,
            ["limits.upload_bytes", "limits.concurrent_streams", "limits.validation_workers", "log.level"]
        );
        assert_eq!(found[1].0, "environment variable FEEDWAVE_LIMITS__CONCURRENT_STREAMS");
        assert!(found[2].0.ends_with("feedwave.toml"), "{}", found[2].0);
        Ok(())
    });
}

#[test]
#[expect(clippy::result_large_err, reason = "the closure's type is figment's")]
fn wrong_types_and_missing_files_are_refused() {
    Jail::expect_with(|jail| {
        jail.create_file("feedwave.toml", "[grpc]\nlisten = 'nowhere'\n")?;
        let found = problems(load("feedwave.toml"));
        assert_eq!(found[0].1, "grpc.listen");
        assert_eq!(problems(load("absent.toml"))[0].2, "there is no such file");
        jail.create_file("broken.toml", "[grpc\n")?;
        assert!(problems(load("broken.toml"))[0].0.ends_with("broken.toml"));
        Ok(())
    });
}

#[test]
#[expect(clippy::result_large_err, reason = "the closure's type is figment's")]
fn variables_that_a_cluster_sets_are_no_keys() {
    Jail::expect_with(|jail| {
        jail.set_env("FEEDWAVE_PORT", "tcp://10.0.0.1:50051");
        jail.set_env("FEEDWAVE_SERVICE_HOST", "10.0.0.1");
        assert_eq!(Config::load(None, &Overrides::default()), Ok(Config::default()));
        Ok(())
    });
}

/// Where the store of a configuration with this file, this variable and this flag is kept.
#[expect(clippy::result_large_err, reason = "the closure's type is figment's")]
fn store_of(file: &str, variable: (&str, &str), flag: (&'static str, &str)) -> Result<(String, Vec<String>), String> {
    let mut outcome = Err(String::new());
    Jail::expect_with(|jail| {
        jail.create_file("feedwave.toml", file)?;
        jail.set_env(variable.0, variable.1);
        let flag = Some(flag.1).filter(|value| !value.is_empty()).map(|value| (flag.0, value));
        let flags = flag.map_or_else(Overrides::default, |(key, value)| Overrides::default().set(key, Some(value)));
        let here = jail.directory().display().to_string();
        outcome = match Config::load(Some(Path::new("feedwave.toml")), &flags) {
            Ok(config) => {
                let uri = config.store_uri().expect("was checked").to_string();
                Ok((uri.replace(&here, "HERE"), config.deprecations()))
            }
            Err(error) => Err(error.to_string()),
        };
        Ok(())
    });
    outcome
}

#[test]
fn the_store_is_named_by_file_environment_and_flag() {
    let none = ("FEEDWAVE_UNUSED", "");
    let uri = |outcome: Result<(String, Vec<String>), String>| {
        let (uri, deprecations) = outcome.unwrap();
        assert!(deprecations.is_empty(), "{deprecations:?}");
        uri
    };
    assert_eq!(uri(store_of("", none, ("store.uri", ""))), "sqlite://HERE/feedwave.db");
    let file = "[store]\nuri = 'sqlite:///1.db'\n";
    assert_eq!(uri(store_of(file, none, ("store.uri", ""))), "sqlite:///1.db");
    let variable = ("FEEDWAVE_STORE__URI", "sqlite:///2.db");
    assert_eq!(uri(store_of(file, variable, ("store.uri", ""))), "sqlite:///2.db");
    assert_eq!(uri(store_of(file, variable, ("store.uri", "sqlite:///3.db"))), "sqlite:///3.db");
}

#[test]
fn the_former_name_of_the_store_is_read_with_a_warning() {
    for (file, variable, flag) in [
        ("[database]\npath = '/data/a b.db'\n", ("FEEDWAVE_UNUSED", ""), ("database.path", "")),
        ("", ("FEEDWAVE_DATABASE__PATH", "/data/a b.db"), ("database.path", "")),
        ("", ("FEEDWAVE_UNUSED", ""), ("database.path", "/data/a b.db")),
        // Both, saying the same.
        ("[database]\npath = '/data/a b.db'\n", ("FEEDWAVE_STORE__URI", "sqlite:///data/a%20b.db"), ("store.uri", "")),
    ] {
        let (uri, deprecations) = store_of(file, variable, flag).unwrap();
        assert_eq!(uri, "sqlite:///data/a%20b.db");
        assert_eq!(
            deprecations,
            ["database.path is the former name of store.uri: set store.uri to sqlite:///data/a%20b.db in its stead"]
        );
    }
    let (uri, _) = store_of("[database]\npath = 'x.db'\n", ("FEEDWAVE_UNUSED", ""), ("store.uri", "")).unwrap();
    assert_eq!(uri, "sqlite://HERE/x.db");
}

#[test]
fn two_stores_or_none_are_refused() {
    let none = ("FEEDWAVE_UNUSED", "");
    let both = store_of("[database]\npath = '/1.db'\n", ("FEEDWAVE_STORE__URI", "sqlite:///2.db"), ("store.uri", ""));
    let both = both.unwrap_err();
    assert!(
        both.contains("feedwave.toml: database.path: names another store than store.uri (sqlite:///2.db)"),
        "{both}"
    );
    let empty = store_of("[database]\npath = ''\n", none, ("store.uri", "")).unwrap_err();
    assert!(empty.contains("database.path: the path \"\" cannot be used"), "{empty}");
    for (uri, reason) in [
        ("", "it is empty"),
        ("feedwave.db", "it has no scheme"),
        ("sqlite://feedwave.db", "the path must be absolute"),
        ("oracle://user:secret@plant/feedwave", "the scheme \"oracle\" is unknown"),
    ] {
        let refused = store_of("", ("FEEDWAVE_STORE__URI", uri), ("store.uri", "")).unwrap_err();
        let begin = "environment variable FEEDWAVE_STORE__URI: store.uri: ";
        assert!(refused.starts_with(begin) && refused.contains(reason) && !refused.contains("secret"), "{refused}");
    }
}
