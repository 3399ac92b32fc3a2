//! The subcommands that talk to a service: a real one, in this process, on a free port.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::process::Output;
use std::thread;

use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{GetMonitoringRequest, MonitoringConfig, SetMonitoringRequest};
use feedwave_server::config::{Config, GrpcConfig, HttpConfig, StoreConfig};
use feedwave_server::lifecycle::{RunningServer, Server};

use super::{code, feedwave, fixture, stderr, stdout};

/// A service that ends with the test.
pub(super) struct Service {
    runtime: tokio::runtime::Runtime,
    server: Option<RunningServer>,
    address: SocketAddr,
    _directory: tempfile::TempDir,
}

impl Service {
    pub(super) fn start() -> Self {
        Self::with(GrpcConfig::default())
    }

    /// A service with this gRPC port, on a free one.
    pub(super) fn with(grpc: GrpcConfig) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let free_port = SocketAddr::from(([127, 0, 0, 1], 0));
        let config = Config {
            grpc: GrpcConfig { listen: free_port, ..grpc },
            http: HttpConfig { listen: free_port, ..HttpConfig::default() },
            store: StoreConfig::of_file(&directory.path().join("test.db")).unwrap(),
            ..Config::default()
        };
        let runtime = tokio::runtime::Runtime::new().unwrap();
        let server = runtime.block_on(Server::start(config)).unwrap();
        Self { address: server.grpc_addr(), runtime, server: Some(server), _directory: directory }
    }

    pub(super) const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Changes how the telemetry of a job is judged.
    pub(super) fn judge(&self, job: &str, change: impl FnOnce(&mut MonitoringConfig)) {
        let url = format!("http://{}", self.address);
        self.runtime.block_on(async {
            let mut client = TelemetryClient::connect(url).await.unwrap();
            let job = job.to_owned();
            let kept = client.get_monitoring(GetMonitoringRequest { job: job.clone() }).await.unwrap();
            let mut config = kept.into_inner().config.unwrap();
            change(&mut config);
            client.set_monitoring(SetMonitoringRequest { job, config: Some(config) }).await.unwrap();
        });
    }

    pub(super) fn http_address(&self) -> SocketAddr {
        self.server.as_ref().unwrap().http_addr()
    }

    pub(super) fn run(&self, arguments: &[&str]) -> Output {
        run_against(self.address, arguments)
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        if let Some(server) = self.server.take() {
            self.runtime.block_on(server.shutdown());
        }
    }
}

fn run_against(address: SocketAddr, arguments: &[&str]) -> Output {
    feedwave().args(arguments).args(["--server", &format!("http://{address}")]).output().unwrap()
}

pub(super) fn path(name: &str) -> String {
    fixture(name).display().to_string()
}

#[test]
fn the_same_request_id_is_the_same_job() {
    let service = Service::start();
    let submit = || stdout(&service.run(&["submit", &path("spec-trap.nc"), "--request-id", "order-4711"]));
    let first = submit();
    assert!(first.starts_with("jobs/"));
    assert_eq!(first, submit());
}

#[test]
fn a_large_program_is_uploaded() {
    let service = Service::start();
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("large.nc");
    let text = std::fs::read_to_string(fixture("spec-trap-cured.nc")).unwrap();
    let padding = "(PADDING FOR A PROGRAM THAT DOES NOT TRAVEL INLINE)\n".repeat(40_000);
    std::fs::write(&file, text.replacen("%\n", &format!("%\n{padding}"), 1)).unwrap();
    let output = service.run(&["submit", file.to_str().unwrap(), "--wait"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stdout(&output).contains("40 011 lines"), "{}", stdout(&output));
}

#[test]
fn a_streamed_job_equals_the_plan() {
    let service = Service::start();
    let program = path("spec-trap-cured.nc");
    let submitted = stdout(&service.run(&["submit", &program, "--wait"]));
    let job = submitted.lines().last().unwrap();
    let planned = stdout(&feedwave().args(["plan", &program, "--out", "-"]).output().unwrap());
    assert_eq!(stdout(&service.run(&["stream", job])), planned);

    let part = stdout(&service.run(&["stream", job, "--from-index", "12345", "--count", "20000"]));
    assert_eq!(part.lines().skip(1).collect::<Vec<_>>(), planned.lines().skip(12_346).take(20_000).collect::<Vec<_>>());

    let delta = stdout(&service.run(&["stream", job, "--encoding", "delta", "--count", "5000"]));
    let x = |text: &str| text.lines().nth(5_000).unwrap().split(',').nth(2).unwrap().parse::<f64>().unwrap();
    assert!((x(&delta) - x(&planned)).abs() <= 0.5e-6);

    let output = service.run(&["stream", "jobs/00000000-0000-7000-8000-000000000000"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("does not exist"), "{}", stderr(&output));
}

#[test]
fn a_stream_is_taken_up_where_its_connection_broke() {
    let service = Service::start();
    let program = path("spec-trap-cured.nc");
    let submitted = stdout(&service.run(&["submit", &program, "--wait"]));
    let job = submitted.lines().last().unwrap();
    let whole = stdout(&service.run(&["stream", job]));
    let proxy = breaking_proxy(service.address, 1 << 20);
    let output = run_against(proxy, &["stream", job]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stderr(&output).contains("resuming the stream"), "{}", stderr(&output));
    assert!(stdout(&output) == whole, "the same setpoints, none twice, none missing");
}

/// Passes connections on to `target`; the first one is cut after this many bytes of answers.
fn breaking_proxy(target: SocketAddr, cut_after_bytes: usize) -> SocketAddr {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let address = listener.local_addr().unwrap();
    thread::spawn(move || {
        let mut limit = Some(cut_after_bytes);
        for client in listener.incoming() {
            let (client, server) = (client.unwrap(), TcpStream::connect(target).unwrap());
            let (requests, answers) = (client.try_clone().unwrap(), server.try_clone().unwrap());
            thread::spawn(move || pass_on(requests, server, None));
            let limit = limit.take();
            thread::spawn(move || pass_on(answers, client, limit));
        }
    });
    address
}

fn pass_on(mut from: TcpStream, mut to: TcpStream, limit: Option<usize>) {
    let mut buffer = vec![0; 16 * 1024];
    let mut passed = 0;
    while let Ok(read) = from.read(&mut buffer) {
        passed += read;
        let cut = limit.is_some_and(|limit| passed > limit);
        if read == 0 || cut || to.write_all(&buffer[..read]).is_err() {
            break;
        }
    }
    let _ = (from.shutdown(Shutdown::Both), to.shutdown(Shutdown::Both));
}

#[test]
fn a_stream_with_overrides_is_what_plan_writes_with_them() {
    let service = Service::start();
    let program = path("spec-trap-cured.nc");
    let job = stdout(&service.run(&["submit", &program, "--wait"]));
    let job = job.trim_end().rsplit_once('\n').map_or(job.trim_end(), |(_, job)| job);
    let changes = ["--override", "2:50", "--override", "3.5:0", "--override", "5:100"];
    let part = ["--from-index", "1990", "--count", "4000"];
    let streamed = service.run(&[&["stream", job][..], &changes, &part].concat());
    assert_eq!(code(&streamed), 0, "{}", stderr(&streamed));
    let planned = feedwave().args(["plan", &program, "--out", "-"]).args(changes).args(part).output().unwrap();
    assert!(!planned.stdout.is_empty() && streamed.stdout == planned.stdout);

    let refused = service.run(&["stream", job, "--override", "3:0"]);
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("overrides[0].ratio"), "{}", stderr(&refused));
}
