//! Where values come from, and how bad ones are refused. `figment::Jail` gives every test its own directory and
//! environment.

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
            "[grpc]\nlisten = '0.0.0.0:1'\n[http]\nlisten = '0.0.0.0:2'\n[limits]\ndrain_s = 3\n",
        )?;
        jail.set_env("FEEDWAVE_HTTP__LISTEN", "0.0.0.0:20");
        jail.set_env("FEEDWAVE_LIMITS__DRAIN_S", "30");
        let flags = Overrides::default().set("limits.drain_s", Some(300)).set("database.path", None::<String>);
        let config = Config::load(Some(Path::new("feedwave.toml")), &flags).unwrap();
        assert_eq!(config.grpc.listen, "0.0.0.0:1".parse().unwrap());
        assert_eq!(config.http.listen, "0.0.0.0:20".parse().unwrap());
        assert_eq!(config.limits.drain_s, 300);
        assert_eq!(config.database, DatabaseConfig::default());
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
