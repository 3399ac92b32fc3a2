//! How long a decision takes: from the sending of the batch that caused it to its receipt, durable by then. Sixteen
//! machines send two channels, the spindle angle and the contact at 20 kHz each, over a connection of their own, to the
//! real binary with a database file.
//!
//! Beside it, in the same run and with the same pace: a bare tonic service that decodes the same batches and answers those
//! that would have caused a decision, and bare SQLite transactions of the same bytes with the same pragmas on the same disk.
//! What the service adds to the sum of both is its own.
//!
//! Batches have the samples of 1, 2 or 5 ms: shorter ones cost more messages than samples, longer ones delay the end of a
//! window by more than the answer takes. Each machine's windows end at another time.
//!
//! With `--lookers 500` the question is another one: what those who look on cost. In each of `--rounds` the service is
//! measured without and with them, one after the other. They stand for other hosts, so they have the processor after all others:
//! what they take from the machines is what the service does for them.
//!
//! Each figure is given twice: of all decisions, and of those during which the computer was as fast as usual (`host.rs`).
//!
//! The bar is 5 ms for 99 of 100 decisions on two cores, clients included; on a larger machine run it under
//! `taskset -c 0,1`. `cargo bench -p feedwave --bench decisions -- --help` has the settings.

mod commits;
mod echo;
mod host;
mod lookers;
mod machine;

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use clap::Parser;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::jobs_client::JobsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{CreateJobRequest, JobState, SetMonitoringRequest, WatchJobsRequest};
use tempfile::TempDir;
use tonic::transport::Channel;

use self::host::Watch;
use self::machine::Latency;

/// What 99 of 100 decisions have to keep to.
const BAR: Duration = Duration::from_millis(5);

/// Telemetry to decisions, how long it takes.
#[derive(Clone, Debug, Parser)]
pub struct Options {
    /// Machines that send at the same time
    #[arg(long, default_value_t = 16)]
    machines: u64,
    /// Samples per second of each machine
    #[arg(long, default_value_t = 20_000)]
    rate_hz: u64,
    /// Milliseconds that a batch is long
    #[arg(long, value_delimiter = ',', default_value = "1,2,5")]
    batch_ms: Vec<u64>,
    /// Milliseconds that a window is long: one decision each
    #[arg(long, default_value_t = 250)]
    window_ms: u64,
    /// Seconds of each measurement
    #[arg(long, default_value_t = 20)]
    seconds: u64,
    /// Folder for the databases, to choose the disk
    #[arg(long)]
    folder: Option<PathBuf>,
    /// Service to measure in place of the one that was built along
    #[arg(long, default_value = env!("CARGO_BIN_EXE_feedwave"), hide_default_value = true)]
    service: PathBuf,
    /// Pages and pollers that look on, in place of the comparison with the bare parts
    #[arg(long, default_value_t = 0)]
    lookers: u64,
    /// How often the service is measured without and with those who look on
    #[arg(long, default_value_t = 3)]
    rounds: u64,
    /// Look on, at the HTTP port with this address
    #[arg(long, hide = true)]
    look: Option<String>,
    /// Passed by Cargo
    #[arg(long, hide = true)]
    bench: bool,
    /// Serve the bare stream
    #[arg(long, hide = true)]
    echo: bool,
}

/// A process that ends with its owner.
struct Process(Child);

impl Process {
    /// User and system time so far, s; 0 where the system does not tell.
    fn cpu_seconds(&self) -> f64 {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.0.id())).unwrap_or_default();
        let after_name = stat.rsplit(')').next().unwrap_or_default();
        let ticks = after_name.split_whitespace().skip(11).take(2).filter_map(|field| field.parse::<f64>().ok());
        ticks.sum::<f64>() / 100.0
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A server that runs.
struct Served {
    process: Process,
    /// URL of its gRPC port.
    url: String,
    /// Address of its HTTP port; empty where it has none.
    http: String,
}

/// Starts a server and waits for the file in which it writes its addresses.
fn serve(mut command: Command, ready_file: &Path) -> Served {
    let process = Process(command.stdout(Stdio::null()).spawn().expect("the server starts"));
    let begun = Instant::now();
    while !ready_file.exists() {
        assert!(begun.elapsed() < Duration::from_secs(60), "the server is not ready after a minute");
        std::thread::sleep(Duration::from_millis(10));
    }
    let ready: serde_json::Value =
        serde_json::from_slice(&std::fs::read(ready_file).expect("a ready file")).expect("JSON");
    let url = format!("http://{}", ready["grpc"].as_str().expect("an address"));
    Served { process, url, http: ready["http"].as_str().unwrap_or_default().to_owned() }
}

/// Starts the service with a database of its own.
fn serve_service(folder: &Path, name: &str, options: &Options) -> Served {
    let ready_file = folder.join(format!("{name}.json"));
    let config = folder.join(format!("{name}.toml"));
    let places = 2 * options.lookers.max(512);
    let connections = format!(
        "[connections]\ntotal = {places}\nper_client = {places}\ncalls_per_client = {places}\nwatchers = {places}\n\
         watchers_per_client = {places}\n"
    );
    std::fs::write(&config, connections).expect("a configuration");
    let mut command = Command::new(&options.service);
    command.args(["serve", "--log-level", "warn", "--grpc-listen", "127.0.0.1:0", "--http-listen", "127.0.0.1:0"]);
    command.arg("--config").arg(config);
    command.arg("--store").arg(format!("sqlite://{}/{name}.db", folder.display()));
    command.arg("--ready-file").arg(&ready_file);
    serve(command, &ready_file)
}

/// Connects to the server that prepares jobs for the machines: each has one and its own connection.
async fn prepare(url: &str, options: &Options) -> Vec<(TelemetryClient<Channel>, String)> {
    let mut machines = Vec::new();
    for _ in 0..options.machines {
        let channel = Channel::from_shared(url.to_owned()).expect("a URL").connect().await.expect("connects");
        let mut jobs = JobsClient::new(channel.clone());
        let request = CreateJobRequest {
            machine: "machines/lathe".to_owned(),
            source: Some(Source::InlineProgram(b"G21\nG0 X10.\nM30\n".as_slice().into())),
            ..Default::default()
        };
        let job = jobs.create_job(request).await.expect("a job").into_inner().job.expect("a job").name;
        let request = WatchJobsRequest { after: Some(0), job: job.clone() };
        let mut events = jobs.watch_jobs(request).await.expect("events").into_inner();
        while events.message().await.expect("events").expect("an event").event.expect("an event").state()
            != JobState::Ready
        {}
        let mut telemetry = TelemetryClient::new(channel);
        let request = SetMonitoringRequest { job: job.clone(), config: Some(machine::config(options)) };
        telemetry.set_monitoring(request).await.expect("a configuration");
        machines.push((telemetry, job));
    }
    machines
}

/// How long decisions took, each ascending.
#[derive(Default)]
struct Latencies {
    all: Vec<Duration>,
    /// While the computer was as fast as usual.
    undisturbed: Vec<Duration>,
}

impl Latencies {
    fn add(&mut self, other: &Self) {
        self.all.extend(&other.all);
        self.undisturbed.extend(&other.undisturbed);
        self.all.sort();
        self.undisturbed.sort();
    }
}

/// Drives all machines.
async fn drive(machines: Vec<(TelemetryClient<Channel>, String)>, batch_ms: u64, options: &Options) -> Latencies {
    let watch = Watch::start();
    let mut tasks = tokio::task::JoinSet::new();
    for (number, (client, job)) in (0..).zip(machines) {
        tasks.spawn(machine::run(client, job, number, batch_ms, options.clone()));
    }
    let latencies = tasks.join_all().await.concat();
    let ascending = |latencies: &[Latency]| {
        let mut durations: Vec<_> = latencies.iter().map(|latency| latency.received - latency.sent).collect();
        durations.sort();
        durations
    };
    Latencies { all: ascending(&latencies), undisturbed: ascending(&watch.undisturbed(&latencies)) }
}

fn show(what: &str, latencies: &[Duration], besides: &str) {
    let at = |share: f64| {
        let index = ((latencies.len() as f64 * share) as usize).min(latencies.len().saturating_sub(1));
        latencies.get(index).map_or(f64::NAN, |latency| latency.as_secs_f64() * 1e3)
    };
    println!("{what:<22}{:>8}{:>10.3}{:>10.3}{:>10.3}  {besides}", latencies.len(), at(0.5), at(0.99), at(1.0));
}

/// Of all decisions, then of those that the computer did its usual speed for.
fn show_both(what: &str, latencies: &Latencies, besides: &str) {
    show(what, &latencies.all, besides);
    show("    at usual speed", &latencies.undisturbed, "");
}

async fn compare(options: &Options) {
    let folder = options.folder.clone().unwrap_or_else(std::env::temp_dir);
    let folder = TempDir::new_in(folder).expect("a temporary folder");
    println!(
        "{} machines, {} samples/s each, windows of {} ms; times in ms",
        options.machines, options.rate_hz, options.window_ms
    );
    println!("{:<22}{:>8}{:>10}{:>10}{:>10}", "", "number", "median", "99 %", "largest");
    for (round, &batch_ms) in options.batch_ms.iter().enumerate() {
        println!("batches of {batch_ms} ms");
        let commits = commits::measure(&folder.path().join(format!("bare-{round}.db"))).await;
        let rate = commits.len() as f64 / commits.iter().sum::<Duration>().as_secs_f64();
        show("  bare transactions", &commits, &format!("{rate:.0}/s one after the other"));

        let ready_file = folder.path().join(format!("echo-{round}.json"));
        let mut command = Command::new(std::env::current_exe().expect("a path"));
        command.arg("--echo").arg("--folder").arg(&ready_file);
        command.args(["--window-ms", &options.window_ms.to_string(), "--batch-ms", &batch_ms.to_string()]);
        let Served { process, url, .. } = serve(command, &ready_file);
        let mut machines = Vec::new();
        for _ in 0..options.machines {
            let client = TelemetryClient::connect(url.clone()).await.expect("connects");
            machines.push((client, "jobs/bare".to_owned()));
        }
        let bare = drive(machines, batch_ms, options).await;
        show_both("  bare stream", &bare, &cores(&process, options));
        drop(process);

        let Served { process, url, .. } = serve_service(folder.path(), &format!("service-{round}"), options);
        let machines = prepare(&url, options).await;
        let decisions = drive(machines, batch_ms, options).await;
        show_both("  decisions", &decisions, &cores(&process, options));
        let kept = decisions.all.iter().filter(|latency| **latency <= BAR).count();
        println!("  {:.2} % of the decisions within {BAR:?}", 100.0 * kept as f64 / decisions.all.len() as f64);
    }
}

/// Starts those who look on. Linux runs an idle process only where nobody else wants the processor, whereas one of low
/// priority is not interrupted at once; without its `chrt` they have the lowest priority.
fn look_from_elsewhere(http: &str, lookers: u64) -> Process {
    let this = std::env::current_exe().expect("a path");
    let start = |command: &mut Command| command.args(["--look", http, "--lookers", &lookers.to_string()]).spawn();
    let started =
        start(Command::new("chrt").args(["--idle", "0"]).arg(&this)).or_else(|_| start(&mut Command::new(&this)));
    Process(started.expect("those who look on start"))
}

/// Measures the service without and with those who look on, again and again.
async fn compare_looked_at(options: &Options) {
    let folder = options.folder.clone().unwrap_or_else(std::env::temp_dir);
    let folder = TempDir::new_in(folder).expect("a temporary folder");
    println!(
        "{} machines, {} samples/s each, windows of {} ms; {} pages and pollers at one second; times in ms",
        options.machines, options.rate_hz, options.window_ms, options.lookers
    );
    println!("{:<22}{:>8}{:>10}{:>10}{:>10}", "", "number", "median", "99 %", "largest");
    for &batch_ms in &options.batch_ms {
        println!("batches of {batch_ms} ms");
        let mut all: [Latencies; 2] = Default::default();
        for round in 0..options.rounds {
            // Whoever is second is so in every other round.
            let order = if round % 2 == 0 { [false, true] } else { [true, false] };
            for is_looked_at in order {
                let name = format!("service-{batch_ms}-{round}-{is_looked_at}");
                let Served { process, url, http } = serve_service(folder.path(), &name, options);
                let _lookers = is_looked_at.then(|| look_from_elsewhere(&http, options.lookers));
                let machines = prepare(&url, options).await;
                let decisions = drive(machines, batch_ms, options).await;
                let what = if is_looked_at { "  looked at" } else { "  alone" };
                let shown = floor_seconds(&http) / options.machines as f64 / options.seconds as f64;
                show_both(
                    what,
                    &decisions,
                    &format!(
                        "{}, {:.4} % of a run's time is for who looks on",
                        cores(&process, options),
                        100.0 * shown
                    ),
                );
                all[usize::from(is_looked_at)].add(&decisions);
            }
        }
        for (what, latencies) in ["  alone, all rounds", "  looked at, all rounds"].into_iter().zip(&all) {
            show_both(what, latencies, "");
        }
    }
}

/// Time that the runs of a service spent on what machines are shown to do, s.
fn floor_seconds(http: &str) -> f64 {
    let mut stream = TcpStream::connect(http).expect("connects");
    stream
        .write_all(format!("GET /metrics HTTP/1.1\r\nhost: {http}\r\nconnection: close\r\n\r\n").as_bytes())
        .expect("asks");
    let mut text = String::new();
    stream.read_to_string(&mut text).expect("an answer");
    let value = text.lines().find_map(|line| line.strip_prefix("feedwave_floor_seconds_total "));
    value.expect("the figure").parse().expect("a number")
}

/// What the server's process has used.
fn cores(process: &Process, options: &Options) -> String {
    format!("{:.2} cores", process.cpu_seconds() / options.seconds as f64)
}

fn main() {
    let options = Options::parse();
    if options.look.is_some() {
        // Before there are threads, so that all have it.
        rustix::process::nice(19).expect("a lower priority");
    }
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build();
    let runtime = runtime.expect("a runtime");
    if let Some(address) = &options.look {
        runtime.block_on(lookers::look(address, options.lookers));
    } else if options.echo {
        runtime.block_on(echo::serve(&options));
    } else if options.lookers > 0 {
        runtime.block_on(compare_looked_at(&options));
    } else {
        runtime.block_on(compare(&options));
    }
}
