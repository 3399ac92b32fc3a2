//! One service at a time has a store.

use feedwave_tests::{Home, Server, patiently};
use tokio::process::Command;

use crate::FEEDWAVE;

#[tokio::test]
async fn a_second_service_on_one_store_is_refused_with_who_has_it() {
    let server = Server::start(FEEDWAVE).await;
    let store = format!("sqlite://{}?busy_timeout_s=0", server.home().path().join("feedwave.db").display());
    let second = || {
        let mut command = Command::new(FEEDWAVE);
        command.args(["serve", "--grpc-listen", "127.0.0.1:0", "--http-listen", "127.0.0.1:0", "--store", &store]);
        command.kill_on_drop(true);
        command
    };
    let output = patiently(second().output()).await.expect("the binary is started");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    let expected = format!("the database is in use by process {} on host ", server.pid());
    assert!(message.contains(&expected), "{message}");

    // The first one serves on, and what a killed one leaves is no obstacle.
    server.connect().await.submit("G21\nM30\n").await;
    let home: Home = server.kill().await;
    assert!(home.path().join("feedwave.db.lock").is_file());
    home.start().await.connect().await.submit("G21\nM30\n").await;
}
