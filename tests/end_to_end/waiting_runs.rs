//! `feedwave run` while the service dies: the run waits for an acknowledgement, and is taken up with the next service.

use std::net::SocketAddr;
use std::process::{Output, Stdio};

use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    AcknowledgeConditionRequest, Escalation, GetMonitoringRequest, GetRunRequest, OverrideBounds, SetMonitoringRequest,
};
use feedwave_tests::Home;
use tokio::io::{AsyncBufReadExt as _, BufReader, copy_bidirectional};
use tokio::net::{TcpListener, TcpStream};
use tokio::process::Command;
use tokio::sync::watch;
use tonic::transport::Channel;

use crate::FEEDWAVE;

/// One slot along X at 20 mm/s and 3000 rev/min; line 3 cuts.
const SLOT: &str = "G21 G90 G94 G17 S3000 M3\nG0 X10 Y0 Z0\nG1 X100 F1200\nG0 X110\nM30\n";

/// A port that stays while the service behind it is killed and started again: connections wait until there is one.
struct Port {
    address: SocketAddr,
    behind: watch::Sender<Option<SocketAddr>>,
}

impl Port {
    async fn open(service: SocketAddr) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let address = listener.local_addr().expect("an address");
        let (behind, service) = watch::channel(Some(service));
        tokio::spawn(async move {
            while let Ok((mut client, _)) = listener.accept().await {
                let mut service = service.clone();
                tokio::spawn(async move {
                    let address = *service.wait_for(Option::is_some).await.ok()?;
                    let mut service = TcpStream::connect(address?).await.ok()?;
                    copy_bidirectional(&mut client, &mut service).await.ok()
                });
            }
        });
        Self { address, behind }
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(FEEDWAVE);
        command.args(arguments).env("FEEDWAVE_SERVER", format!("http://{}", self.address));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).kill_on_drop(true);
        command
    }

    async fn succeeds(&self, arguments: &[&str]) -> String {
        let Output { status, stdout, stderr } = self.command(arguments).output().await.expect("the command runs");
        assert!(status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&stderr));
        String::from_utf8(stdout).expect("text")
    }
}

/// Lets the feed be held where three windows at the lower bound do not bring the deflection down.
async fn escalate(telemetry: &mut TelemetryClient<Channel>, job: &str) {
    let job = job.to_owned();
    let kept = telemetry.get_monitoring(GetMonitoringRequest { job: job.clone() }).await.expect("it was set");
    let mut config = kept.into_inner().config.expect("a configuration");
    let rules = config.rules.as_mut().expect("rules");
    rules.feed.as_mut().expect("a rule for the feed").step = Some(0.5);
    rules.feed_bounds = Some(OverrideBounds { lower: 0.5, upper: 1.5 });
    rules.escalation = Some(Escalation { windows: Some(3), ..Default::default() });
    telemetry.set_monitoring(SetMonitoringRequest { job, config: Some(config) }).await.expect("it is valid");
}

#[tokio::test]
async fn a_run_that_waits_for_its_acknowledgement_survives_the_service() {
    let mut server = Home::new(FEEDWAVE, "").start().await;
    let port = Port::open(server.grpc).await;
    let directory = tempfile::tempdir().expect("a temporary directory");
    let program = directory.path().join("slot.nc");
    std::fs::write(&program, SLOT).expect("the program is written");
    let submitted = port.succeeds(&["submit", program.to_str().expect("text"), "--wait", "--machine", "mill"]).await;
    let job = submitted.lines().last().expect("the job").to_owned();
    let shallow = ["run", &job, "--simulate", "--seed", "7", "--cut", "3:0.5"];
    port.succeeds(&shallow).await;
    escalate(&mut TelemetryClient::new(server.connect().await.channel), &job).await;

    let mut run = port.command(&["run", &job, "--simulate", "--seed", "7", "--cut", "3:5"]).spawn().expect("it runs");
    let mut lines = BufReader::new(run.stderr.take().expect("piped")).lines();
    let output = tokio::spawn(run.wait_with_output());
    let mut killed = false;
    let mut name = String::new();
    while let Some(line) = lines.next_line().await.expect("text") {
        let Some((held, _)) = line.split_once(": the feed is held; acknowledge it: feedwave acknowledge runs/") else {
            continue;
        };
        held.clone_into(&mut name);
        if !killed {
            port.behind.send_replace(None);
            server = server.kill().await.start().await;
            port.behind.send_replace(Some(server.grpc));
            killed = true;
        }
        let mut telemetry = TelemetryClient::new(server.connect().await.channel);
        let acknowledgement = AcknowledgeConditionRequest {
            run: name.clone(),
            decision_number: None,
            acknowledged_by: "Ada".to_owned(),
            note: String::new(),
        };
        telemetry.acknowledge_condition(acknowledgement).await.expect("the condition outlived the service");
    }
    let output = output.await.expect("it is waited for").expect("it ends");
    let text = String::from_utf8(output.stdout).expect("text");
    assert!(killed && output.status.success() && text.contains(": finished: "), "{text}");
    // Every escalation was shown once, and each is a condition that somebody acknowledged.
    let mut telemetry = TelemetryClient::new(server.connect().await.channel);
    let kept = telemetry.get_run(GetRunRequest { name: name.clone() }).await.expect("the run is kept").into_inner();
    let kept = kept.run.expect("a run");
    let shown = text.matches("hold feed, above limit at bound").count();
    assert_eq!((kept.conditions.len(), kept.open_conditions), (shown, 0), "{text}");
    let replayed = port.succeeds(&["replay", &name]).await;
    assert!(replayed.contains("identical"), "{replayed}");
}
