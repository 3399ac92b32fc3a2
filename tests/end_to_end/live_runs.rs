//! A live run through `kill -9`: no acknowledged batch, no decision and no setpoint that was heard of is lost or changes.

use feedwave_contract::proto::SetMonitoringRequest;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_tests::{Chance, Home, LIVE_PART, Left, RunLedger, live_config};
pub(crate) use feedwave_tests::{LIVE_PART as PART, live_batch as batch, live_config as config};

use crate::FEEDWAVE;

/// How often the service is killed.
const KILLS: u64 = 6;

#[tokio::test]
async fn a_live_run_survives_kills_at_any_moment() {
    let mut chance = Chance::new();
    let seed = chance.seed();
    let mut server = Home::new(FEEDWAVE, "").start().await;
    let job = server.connect().await.submit(LIVE_PART).await.job.name;
    let mut telemetry = TelemetryClient::new(server.connect().await.channel);
    let request = SetMonitoringRequest { job: job.clone(), config: Some(live_config()) };
    telemetry.set_monitoring(request).await.expect("the configuration is valid");

    let mut known = RunLedger::default();
    let mut kills = 0;
    loop {
        let messages = if kills < KILLS { chance.up_to(60) } else { u64::MAX };
        match known.drive(server.connect().await.channel, &job, messages).await {
            Left::Ended => break,
            Left::Enough => {}
            Left::Broken(status) => panic!("the service ended by itself: {status:?}"),
        }
        server = server.kill().await.start().await;
        kills += 1;
    }
    assert_eq!(kills, KILLS, "seed {seed}");
    known.prove(server.connect().await, job, seed).await;
}
