//! The publisher of MQTT against Debian's mosquitto, read with its own client: states that are retained, decisions in order
//! once, a service that is killed, a broker that starts again, a wire that breaks, encryption.
//!
//! `tests/mqtt/run.sh` gets the broker and runs them.

use std::fs::File;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use feedwave_contract::proto::machines_client::MachinesClient;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::{CreateMachineRequest, DeleteMachineRequest, GetMachineRequest};
use feedwave_tests::{Chance, Gate, Home, Server, patiently};
use http::StatusCode;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt as _, BufReader, Lines};
use tokio::net::{TcpListener, TcpStream};
use tokio::process::{Child, ChildStdout, Command};

use crate::FEEDWAVE;
use crate::shop_floor::{Live, monitored};

/// A program of mosquitto.
fn program(name: &str) -> PathBuf {
    let folder =
        std::env::var_os("FEEDWAVE_TEST_MOSQUITTO").expect("FEEDWAVE_TEST_MOSQUITTO: tests/mqtt/run.sh sets it");
    Path::new(&folder).join(name)
}

/// A broker with a folder and a port of its own.
struct Broker {
    folder: TempDir,
    port: u16,
    config: String,
    process: Option<Child>,
}

impl Broker {
    /// A broker that has these lines in its configuration, `{}` standing for its folder.
    async fn start(lines: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary directory");
        let config = lines.replace("{}", &folder.path().display().to_string());
        let mut broker = Self { folder, port: 0, config, process: None };
        broker.start_again().await;
        broker
    }

    /// One that keeps sessions over its end.
    async fn persistent() -> Self {
        Self::start("allow_anonymous true\npersistence true\npersistence_location {}/\n").await
    }

    async fn anonymous() -> Self {
        Self::start("allow_anonymous true\n").await
    }

    /// Starts it on the port that it had, at first on a free one.
    async fn start_again(&mut self) {
        let file = self.folder.path().join("mosquitto.conf");
        let is_new = self.port == 0;
        loop {
            if is_new {
                let free = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
                self.port = free.local_addr().expect("an address").port();
            }
            let user = if rustix::process::geteuid().is_root() { "user root\n" } else { "" };
            // The listener comes first, since some of the lines are about it.
            let config = format!("listener {} 127.0.0.1\n{user}{}", self.port, self.config);
            std::fs::write(&file, config).expect("the configuration is written");
            // In the script's folder, which outlives the test.
            let log = File::options().create(true).append(true).open(program(&format!("{}.log", self.port)));
            let mut process = Command::new(program("mosquitto"))
                .arg("-c")
                .arg(&file)
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(log.expect("a log"))
                .kill_on_drop(true)
                .spawn()
                .expect("the broker is started");
            let listens = async {
                loop {
                    if TcpStream::connect(self.address()).await.is_ok() {
                        return true;
                    }
                    if tokio::time::timeout(Duration::from_millis(10), process.wait()).await.is_ok() {
                        return false;
                    }
                }
            };
            // Somebody else may have taken the port meanwhile.
            if patiently(listens).await {
                self.process = Some(process);
                return;
            }
            assert!(is_new, "the broker does not start again");
        }
    }

    fn address(&self) -> SocketAddr {
        SocketAddr::from(([127, 0, 0, 1], self.port))
    }

    async fn end(&mut self, signal: Signal) {
        let mut process = self.process.take().expect("it runs");
        let pid = process.id().and_then(|pid| i32::try_from(pid).ok()).and_then(Pid::from_raw).expect("it runs");
        kill_process(pid, signal).expect("the signal is delivered");
        patiently(process.wait()).await.expect("it is waited for");
    }

    /// Reads every topic; what the broker accepts besides stands in `more`.
    fn subscribe(&self, more: &[&str]) -> Subscriber {
        let mut process = Command::new(program("mosquitto_sub"))
            .args(["-h", "localhost", "-p", &self.port.to_string(), "-t", "#", "-q", "2", "-F", "%r %t %p"])
            .args(more)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .expect("the client is started");
        let lines = BufReader::new(process.stdout.take().expect("a pipe")).lines();
        Subscriber { lines, read: Vec::new(), _process: process }
    }
}

/// A message as a client gets it.
#[derive(Clone, Debug, PartialEq)]
struct Message {
    /// Whether the broker had it before the client came.
    retained: bool,
    topic: String,
    /// Null where it is empty.
    payload: Value,
}

/// Reads the messages of a broker.
struct Subscriber {
    lines: Lines<BufReader<ChildStdout>>,
    /// All that it was told.
    read: Vec<Message>,
    _process: Child,
}

impl Subscriber {
    async fn next(&mut self) -> Message {
        let line = patiently(self.lines.next_line()).await.expect("a line").expect("the client goes on");
        let mut parts = line.splitn(3, ' ');
        let retained = parts.next() == Some("1");
        let topic = parts.next().expect("a topic").to_owned();
        let text = parts.next().unwrap_or_default();
        let payload = if text.is_empty() { Value::Null } else { serde_json::from_str(text).expect("JSON") };
        let message = Message { retained, topic, payload };
        self.read.push(message.clone());
        message
    }

    /// Reads until a message is what is wanted.
    async fn until(&mut self, is_wanted: impl Fn(&Message) -> bool) -> Message {
        loop {
            let message = self.next().await;
            if is_wanted(&message) {
                return message;
            }
        }
    }

    /// The decisions that it was told, in their order.
    fn decisions(&self) -> Vec<Value> {
        let of_lathe = self.read.iter().filter(|message| message.topic == "feedwave/lathe/decision");
        of_lathe.map(|message| message.payload.clone()).collect()
    }

    async fn status(&mut self, online: bool) -> Message {
        let is_wanted = |message: &Message| message.topic == "feedwave/status" && message.payload["online"] == online;
        self.until(is_wanted).await
    }
}

/// What the log has, in its order.
async fn log(server: &Server) -> Vec<Value> {
    let page = server.web().get("/v1/decisions?pageSize=500").await.json();
    page["decisions"].as_array().expect("a list").clone()
}

/// Whether this is the decision at the end of the log.
fn is_last<'a>(log: &'a [Value]) -> impl Fn(&Message) -> bool + 'a {
    |message| log.last().is_some_and(|last| message.payload["sequence"] == last["sequence"])
}

/// A service with this publisher.
async fn publisher(port: u16, more: &str) -> Server {
    Home::new(FEEDWAVE, &format!("[mqtt]\nbroker = 'mqtt://127.0.0.1:{port}'\n{more}")).start().await
}

async fn metric(server: &Server, line: &str) -> Option<u64> {
    let text = server.web().get("/metrics").await.text().to_owned();
    text.lines().find_map(|it| it.strip_prefix(line)).map(|rest| rest.trim().parse().expect("a number"))
}

#[tokio::test]
async fn nothing_is_published_unless_it_is_wanted() {
    let server = Server::start(FEEDWAVE).await;
    assert_eq!(metric(&server, "feedwave_mqtt_connected ").await, None);
}

// The broker's absence is nobody's trouble but the publisher's.
#[tokio::test]
async fn a_broker_that_is_not_there_hinders_nobody() {
    let free = TcpListener::bind("127.0.0.1:0").await.expect("a free port").local_addr().expect("an address");
    let server = publisher(free.port(), "").await;
    let job = monitored(&server, crate::live_runs::config()).await;
    let mut live = Live::open(&server, Target::Job(job), 0).await;
    live.reach(600).await;
    live.take(500).await;
    live.measure(0..25).await;
    live.finish().await;
    assert_eq!(server.web().get("/readyz").await.status, StatusCode::OK);
    assert_eq!(metric(&server, "feedwave_mqtt_connected ").await, Some(0));
    assert!(metric(&server, "feedwave_mqtt_failures_total{reason=\"refused\"} ").await > Some(0));
    server.signal(Signal::TERM);
    assert!(server.ended().await.0.success());
}

#[tokio::test]
#[ignore = "needs mosquitto: tests/mqtt/run.sh"]
async fn states_are_retained_and_decisions_come_once_in_order() {
    let broker = Broker::anonymous().await;
    let mut subscriber = broker.subscribe(&[]);
    let server = publisher(broker.port, "").await;
    let job = monitored(&server, crate::live_runs::config()).await;
    let online = subscriber.status(true).await;
    assert!(online.payload["version"].is_string() && online.payload["time"].is_string(), "{online:?}");

    let mut live = Live::open(&server, Target::Job(job), 0).await;
    live.reach(2_000).await;
    live.take(1_900).await;
    live.measure(0..95).await;
    let log = log(&server).await;
    assert!(log.len() > 3, "{log:?}");
    subscriber.until(is_last(&log)).await;
    assert_eq!(subscriber.decisions(), log);
    assert!(metric(&server, "feedwave_mqtt_published_total{what=\"decision\"} ").await.is_some());

    // Who comes later has the newest state of each machine, that the service is there, and no decision of the past.
    let shown = server.web().get("/v1/machines/lathe/state").await.json();
    assert_eq!(shown["availability"], "AVAILABILITY_AVAILABLE");
    let shows_run = |message: &Message| {
        message.topic == "feedwave/lathe/state" && message.payload["run"]["job"] == shown["run"]["job"]
    };
    if !subscriber.read.iter().any(shows_run) {
        subscriber.until(shows_run).await;
    }
    let mut late = broker.subscribe(&[]);
    let mut retained = Vec::new();
    while retained.len() < 3 {
        let message = late.next().await;
        assert!(!message.topic.ends_with("decision"), "{message:?}");
        if message.retained {
            retained.push(message);
        }
    }
    retained.sort_by(|one, other| one.topic.cmp(&other.topic));
    let topics: Vec<_> = retained.iter().map(|message| message.topic.as_str()).collect();
    assert_eq!(topics, ["feedwave/lathe/state", "feedwave/mill/state", "feedwave/status"]);
    assert_eq!(retained[0].payload["machine"], "machines/lathe");
    assert_eq!(retained[0].payload["run"]["job"], shown["run"]["job"]);

    // What the service did last is told, and that it has ended.
    live.finish().await;
    late.until(|message| {
        message.topic == "feedwave/lathe/state" && message.payload["execution"] == "EXECUTION_FINISHED"
    })
    .await;
    server.signal(Signal::TERM);
    late.status(false).await;
    let home = server.ended().await.1;
    let server = home.start().await;
    late.status(true).await;
    drop(server);
}

#[tokio::test]
#[ignore = "needs mosquitto: tests/mqtt/run.sh"]
async fn a_machine_that_is_deleted_is_retained_no_more() {
    let broker = Broker::anonymous().await;
    let mut subscriber = broker.subscribe(&[]);
    let server = publisher(broker.port, "state_topic = 'plant/hall-2/{machine}/now'\n").await;
    let mut machines = MachinesClient::new(server.connect().await.channel);
    let lathe = machines.get_machine(GetMachineRequest { name: "machines/lathe".to_owned() }).await;
    let lathe = lathe.expect("a machine").into_inner().machine;
    let request = CreateMachineRequest { machine_id: "third".to_owned(), machine: lathe };
    machines.create_machine(request).await.expect("a machine");
    let of_third = |message: &Message| message.topic == "plant/hall-2/third/now";
    let made = subscriber.until(of_third).await;
    assert_eq!(made.payload["machine"], "machines/third");
    let request = DeleteMachineRequest { name: "machines/third".to_owned(), ..Default::default() };
    machines.delete_machine(request).await.expect("it is deleted");
    let gone = subscriber.until(of_third).await;
    assert_eq!(gone.payload, Value::Null);
}

#[tokio::test]
#[ignore = "needs mosquitto: tests/mqtt/run.sh"]
async fn the_broker_says_that_the_service_was_killed() {
    let broker = Broker::anonymous().await;
    let mut subscriber = broker.subscribe(&[]);
    let server = publisher(broker.port, "").await;
    subscriber.status(true).await;
    let home = server.kill().await;
    let offline = subscriber.status(false).await;
    assert_eq!(offline.payload, serde_json::json!({ "online": false }));
    let mut late = broker.subscribe(&[]);
    assert!(late.status(false).await.retained);
    let _server = home.start().await;
    late.status(true).await;
}

#[tokio::test]
#[ignore = "needs mosquitto: tests/mqtt/run.sh"]
async fn after_a_broker_was_killed_everything_is_told_again_and_no_run_waited() {
    let mut broker = Broker::anonymous().await;
    let mut subscriber = broker.subscribe(&[]);
    let server = publisher(broker.port, "").await;
    subscriber.status(true).await;
    broker.end(Signal::KILL).await;
    let job = monitored(&server, crate::live_runs::config()).await;
    let mut live = Live::open(&server, Target::Job(job), 0).await;
    live.reach(600).await;
    live.take(500).await;
    // Durable and acknowledged while there is no broker.
    live.measure(0..25).await;
    assert_eq!(server.web().get("/readyz").await.status, StatusCode::OK);
    broker.start_again().await;
    // It has forgotten everything, and is told by the time somebody asks or afterwards.
    let mut late = broker.subscribe(&[]);
    late.status(true).await;
    let knows = |late: &Subscriber, id: &str| {
        let topic = format!("feedwave/{id}/state");
        late.read.iter().any(|message| message.topic == topic)
    };
    while !(knows(&late, "lathe") && knows(&late, "mill")) {
        late.next().await;
    }
    assert!(metric(&server, "feedwave_mqtt_failures_total{reason=\"lost\"} ").await > Some(0));
    // The connection counts as made once the broker has answered.
    while metric(&server, "feedwave_mqtt_connected ").await != Some(1) {}
}

#[tokio::test]
#[ignore = "needs mosquitto: tests/mqtt/run.sh"]
async fn decisions_come_once_in_order_over_restarts_of_a_broker_that_keeps_sessions() {
    let mut broker = Broker::persistent().await;
    // The broker remembers its client as well, which comes back by itself.
    let mut subscriber = broker.subscribe(&["-i", "reader", "-c"]);
    let server = publisher(broker.port, "").await;
    subscriber.status(true).await;
    let job = monitored(&server, crate::live_runs::config()).await;
    let mut live = Live::open(&server, Target::Job(job), 0).await;
    live.reach(3_000).await;
    live.take(2_900).await;
    for round in 0..3 {
        live.measure(round * 40..round * 40 + 20).await;
        broker.end(Signal::TERM).await;
        live.measure(round * 40 + 20..round * 40 + 40).await;
        broker.start_again().await;
        subscriber.status(true).await;
    }
    let log = log(&server).await;
    subscriber.until(is_last(&log)).await;
    assert_eq!(subscriber.decisions(), log);
}

#[tokio::test]
#[ignore = "needs mosquitto: tests/mqtt/run.sh"]
async fn decisions_come_once_in_order_wherever_the_wire_breaks() {
    let mut chance = Chance::new();
    let seed = chance.seed();
    let broker = Broker::anonymous().await;
    let gate = Gate::new(vec![broker.address()]).await;
    let mut subscriber = broker.subscribe(&[]);
    let server = publisher(gate.address.port(), "").await;
    let job = monitored(&server, crate::live_runs::config()).await;
    let mut live = Live::open(&server, Target::Job(job), 0).await;
    live.reach(4_000).await;
    live.take(3_900).await;
    for round in 0..5 {
        subscriber.status(true).await;
        live.measure(round * 30..round * 30 + 20).await;
        // At any moment of what the batches led to.
        tokio::time::sleep(Duration::from_micros(chance.up_to(5_000))).await;
        gate.break_off();
        subscriber.status(false).await;
        live.measure(round * 30 + 20..round * 30 + 30).await;
    }
    let log = log(&server).await;
    subscriber.until(is_last(&log)).await;
    assert_eq!(subscriber.decisions(), log, "seed {seed}");
}

#[tokio::test]
#[ignore = "needs mosquitto: tests/mqtt/run.sh"]
async fn a_broker_that_knows_its_clients_is_shown_certificate_name_and_password() {
    let files = Authority::new();
    let path = |name: &str| files.folder.path().join(name).display().to_string();
    let passwords = path("passwords");
    let line_4 = ["-b", "-c", &passwords, "line-4", "secret of line 4"];
    let made = Command::new(program("mosquitto_passwd")).args(line_4).status().await.expect("it runs");
    assert!(made.success());
    let tls = format!(
        "cafile {}\ncertfile {}\nkeyfile {}\nrequire_certificate true\nallow_anonymous false\npassword_file {passwords}\n",
        path("ca.pem"),
        path("localhost.pem"),
        path("localhost-key.pem"),
    );
    let broker = Broker::start(&tls).await;
    let shown = ["--cafile", &path("ca.pem"), "--cert", &path("reader.pem"), "--key", &path("reader-key.pem")];
    let named = ["-u", "line-4", "-P", "secret of line 4"];
    let mut subscriber = broker.subscribe(&[shown.as_slice(), &named].concat());

    std::fs::write(path("password"), "secret of line 5\n").expect("it is written");
    let config = format!(
        "[mqtt]\nbroker = 'mqtts://localhost:{}'\nuser = 'line-4'\npassword_file = '{}'\nca = '{}'\ncert = '{}'\nkey = '{}'\n",
        broker.port,
        path("password"),
        path("ca.pem"),
        path("publisher.pem"),
        path("publisher-key.pem"),
    );
    let server = Home::new(FEEDWAVE, &config).start().await;
    // With a wrong password it is not let in, says so, and is ready all the same.
    while metric(&server, "feedwave_mqtt_failures_total{reason=\"refused\"} ").await == Some(0) {}
    assert!(server.log().contains("cannot be made") && !server.log().contains("secret"), "{}", server.log());
    assert_eq!(server.web().get("/readyz").await.status, StatusCode::OK);
    // The right one is taken over without a new start.
    std::fs::write(path("password"), "secret of line 4\n").expect("it is written");
    subscriber.status(true).await;
    drop(server);

    // Who shows no certificate, or asks for another name, is not connected.
    let without =
        config.replace(&format!("cert = '{}'\nkey = '{}'\n", path("publisher.pem"), path("publisher-key.pem")), "");
    for wrong in [without, config.replace("//localhost", "//127.0.0.1")] {
        assert_ne!(wrong, config);
        let server = Home::new(FEEDWAVE, &wrong).start().await;
        while metric(&server, "feedwave_mqtt_failures_total{reason=\"refused\"} ").await == Some(0) {}
        assert_eq!(metric(&server, "feedwave_mqtt_connected ").await, Some(0));
    }
}

/// Certificates of an authority of its own, as files of a folder.
struct Authority {
    folder: TempDir,
}

impl Authority {
    fn new() -> Self {
        use rcgen::{BasicConstraints, CertificateParams, DnType, IsCa, Issuer, KeyPair};
        let folder = tempfile::tempdir().expect("a temporary directory");
        let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).expect("it is written");
        let key = KeyPair::generate().expect("a key");
        let mut params = CertificateParams::default();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        params.distinguished_name.push(DnType::CommonName, "authority");
        write("ca.pem", params.self_signed(&key).expect("a certificate").pem());
        let authority = Issuer::new(params, key);
        for name in ["localhost", "reader", "publisher"] {
            let key = KeyPair::generate().expect("a key");
            let mut params = CertificateParams::new(vec![name.to_owned()]).expect("a name");
            params.distinguished_name.push(DnType::CommonName, name);
            write(&format!("{name}.pem"), params.signed_by(&key, &authority).expect("a certificate").pem());
            write(&format!("{name}-key.pem"), key.serialize_pem());
        }
        Self { folder }
    }
}
