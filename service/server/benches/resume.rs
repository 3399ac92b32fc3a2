//! How long a live run of hours takes until it goes on: from the request to take it up to the first setpoint that the client
//! does not have, at its end and in its middle, and how many setpoints are generated again for it.
//!
//! `cargo bench -p feedwave-server --bench resume -- --hours 10`

use std::fmt::Write as _;
use std::time::Instant;

use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::jobs_client::JobsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    CreateJobRequest, DecisionRules, FeedRule, JobState, MonitoringConfig, RunCommandKind, RunSettings, SensorQuantity,
    Sensors, SetMonitoringRequest, WatchJobsRequest,
};
use feedwave_server::config::{Config, StoreConfig};
use feedwave_server::lifecycle::{RunningServer, Server};
use feedwave_tests::{LiveClient, Web};
use tempfile::TempDir;
use tonic::transport::Channel;

/// Setpoints that the client takes before it forgets them.
const STEP: u64 = 500_000;
/// The feed is held and resumed this often.
const CHANGES: u64 = 40;

/// Turning to and fro, 12 s with two corners in each pass of 40 mm; in text, as a program of that length has it.
fn program(hours: f64) -> String {
    let mut text = String::from("G21 G94 G97 S1000 M3\nG0 X30. Z2.\n");
    for pass in 0..(hours * 3_600.0 / 12.0) as u32 {
        let x = 30.0 - f64::from(pass % 50) * 0.1;
        let _ = writeln!(text, "G1 X{x:.1} F200\nZ-20.\nX{:.1} Z-25.\nZ-38.\nG0 X42.\nZ2.", x + 5.0);
    }
    text + "M30\n"
}

async fn start(folder: &TempDir) -> (RunningServer, Channel) {
    let mut config = Config::default();
    config.grpc.listen = "127.0.0.1:0".parse().unwrap();
    config.http.listen = "127.0.0.1:0".parse().unwrap();
    config.store = StoreConfig::of_file(&folder.path().join("feedwave.db")).unwrap();
    let server = Server::start(config).await.unwrap();
    let channel = Channel::from_shared(format!("http://{}", server.grpc_addr())).unwrap().connect().await.unwrap();
    (server, channel)
}

/// A validated job with monitoring.
async fn job(channel: &Channel, program: String) -> String {
    let mut jobs = JobsClient::new(channel.clone());
    let request = CreateJobRequest {
        machine: "machines/lathe".to_owned(),
        source: Some(Source::InlineProgram(program.into())),
        ..Default::default()
    };
    let job = jobs.create_job(request).await.unwrap().into_inner().job.unwrap().name;
    let request = WatchJobsRequest { after: Some(0), job: job.clone() };
    let mut events = jobs.watch_jobs(request).await.unwrap().into_inner();
    while events.message().await.unwrap().unwrap().event.unwrap().state() != JobState::Ready {}
    let sensors = Sensors { quantity: SensorQuantity::Displacement.into(), max: 10.0, ..Default::default() };
    let feed = Some(FeedRule { lower: 0.003, upper: 0.01, step: None });
    let rules = Some(DecisionRules { feed, ..Default::default() });
    let config = MonitoringConfig { tool: Some(sensors), rules, ..Default::default() };
    let request = SetMonitoringRequest { job: job.clone(), config: Some(config) };
    TelemetryClient::new(channel.clone()).set_monitoring(request).await.unwrap();
    job
}

async fn regenerated(server: &RunningServer) -> u64 {
    let answer = Web::new(server.http_addr()).get("/metrics").await;
    let line = answer.text().lines().find_map(|line| line.strip_prefix("feedwave_setpoints_regenerated_total "));
    line.and_then(|count| count.parse().ok()).unwrap_or_default()
}

/// Takes setpoints before `end`, and forgets them.
async fn take(run: &mut LiveClient, end: u64) {
    while run.next_index < end {
        run.reach(end.min(run.next_index + STEP)).await.unwrap();
        run.setpoints.clear();
    }
}

async fn measure(hours: f64) {
    let folder = TempDir::new().unwrap();
    let (server, channel) = start(&folder).await;
    let job = job(&channel, program(hours)).await;
    let setpoints = (hours * 3_600_000.0) as u64;
    let mut run = LiveClient::begin(channel.clone(), &job, RunSettings::default()).await.unwrap();
    let name = run.started.run.clone();
    for change in 1..=CHANGES {
        take(&mut run, setpoints / (CHANGES + 1) * change).await;
        run.command(RunCommandKind::Hold).await.unwrap();
        let next = run.next_index + 300;
        take(&mut run, next).await;
        run.command(RunCommandKind::Resume).await.unwrap();
    }
    take(&mut run, setpoints / 50 * 49).await;
    let end = run.next_index;
    drop(run);
    println!("{hours} hours, {end} setpoints, {CHANGES} holds");
    for (place, index) in [("its end", end), ("its end", end - 60_000), ("its middle", end / 2)] {
        let before = regenerated(&server).await;
        let started = Instant::now();
        let mut run = LiveClient::take_up(channel.clone(), &name, index).await.unwrap();
        run.reach(index + 1).await.unwrap();
        let seconds = started.elapsed().as_secs_f64();
        let again = regenerated(&server).await - before;
        println!("taken up at {index} ({place}): {:.0} ms, {again} setpoints generated again", 1e3 * seconds);
    }
    server.shutdown().await;
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let given = arguments.iter().position(|argument| argument == "--hours").and_then(|at| arguments.get(at + 1));
    let hours = given.map_or(10.0, |hours| hours.parse().expect("--hours takes a number"));
    tokio::runtime::Runtime::new().unwrap().block_on(measure(hours));
}
