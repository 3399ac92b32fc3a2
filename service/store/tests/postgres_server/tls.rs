//! Connections that are encrypted, to a server that is who it says, by clients that are.

use std::path::Path;

use feedwave_store::{Store, StoreError, StoreSettings};
use url::Url;

use super::{Place, new_job, program};

/// The same database over TLS, as a user, at this name of the server.
fn over_tls(place: &Place, user: &str, host: &str, options: &[(&str, &str)]) -> String {
    let mut url: Url = place.uri.parse().unwrap();
    url.set_username(user).unwrap();
    url.set_host(Some(host)).unwrap();
    let certificates = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/tls");
    for (option, value) in options {
        let file = certificates.join(value);
        let value = if value.ends_with(".pem") { file.to_str().unwrap() } else { value };
        url.query_pairs_mut().append_pair(option, value);
    }
    url.into()
}

async fn open(uri: &str) -> Result<Store, StoreError> {
    Store::open(&uri.parse().unwrap(), StoreSettings::default()).await
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn connections_are_encrypted_and_the_server_is_who_it_says() {
    let place = Place::new();
    let authority = ("sslrootcert", "database-ca.pem");
    for options in [
        &[("sslmode", "require")][..],
        &[("sslmode", "verify-ca"), authority],
        // Which is what is not said.
        &[authority],
        &[("sslmode", "verify-full"), authority],
    ] {
        let store = open(&over_tls(&place, "feedwave", "localhost", options)).await.unwrap();
        let program = program(&store).await;
        store.create_job(new_job(&format!("{options:?}"), program)).await.unwrap();
        let (connections, plain): (i64, i64) = sqlx::query_as(
            "SELECT count(*), count(*) FILTER (WHERE s.ssl IS NOT TRUE) FROM pg_stat_activity AS a LEFT JOIN pg_stat_ssl AS s USING (pid)
             WHERE a.datname = current_database() AND a.backend_type = 'client backend' AND a.pid <> pg_backend_pid()",
        )
        .fetch_one(&mut place.raw().await)
        .await
        .unwrap();
        assert!(connections > 0, "{options:?}");
        assert_eq!(plain, 0, "{options:?}");
    }
    for (host, options) in [
        // Signed by somebody else.
        ("localhost", &[("sslmode", "verify-full"), ("sslrootcert", "other-ca.pem")][..]),
        ("localhost", &[("sslmode", "verify-ca"), ("sslrootcert", "other-ca.pem")]),
        // By nobody that this machine knows.
        ("localhost", &[("sslmode", "verify-full")]),
        // For another name.
        ("127.0.0.1", &[("sslmode", "verify-full"), authority]),
    ] {
        // Waiting does not make it fit: it would be an hour.
        let options = [options, &[("connect_timeout_s", "3600")]].concat();
        let refused = open(&over_tls(&place, "feedwave", host, &options)).await.unwrap_err();
        let reason = "the certificate of its server is not accepted";
        assert!(
            matches!(refused, StoreError::CannotOpen { reason: told, .. } if told == reason),
            "{host} {options:?}: {refused:?}"
        );
    }
    // The name does not matter where only the authority does.
    open(&over_tls(&place, "feedwave", "127.0.0.1", &[("sslmode", "verify-ca"), authority])).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_server_that_asks_for_a_certificate_is_shown_it() {
    let place = Place::new();
    let authority = ("sslrootcert", "database-ca.pem");
    let own = [authority, ("sslcert", "client.pem"), ("sslkey", "client-key.pem")];
    let store = open(&over_tls(&place, "sworn", "localhost", &own)).await.unwrap();
    program(&store).await;
    for options in [&[authority][..], &[("sslmode", "disable")]] {
        let refused = open(&over_tls(&place, "sworn", "localhost", options)).await.unwrap_err();
        assert!(matches!(refused, StoreError::CannotOpen { .. }), "{options:?}: {refused:?}");
    }
}
