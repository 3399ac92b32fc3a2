//! The service as a child process.

use std::fmt::Write as _;
use std::fs::File;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;
use tokio::process::{Child, Command};
use tokio::time::timeout;

use crate::{Clients, Database, PATIENCE, Web};

/// A directory with a database and a configuration, which outlives the servers that run on it.
pub struct Home {
    binary: PathBuf,
    directory: TempDir,
    environment: Vec<(String, String)>,
    /// A server's, where it has one.
    _database: Option<Database>,
}

impl Home {
    /// An empty directory for servers of this binary; the configuration puts the database into it, both ports on free ones,
    /// and adds `more`. The environment variable `FEEDWAVE_TEST_STORE` says another place for the database: a URI with `{}`
    /// where the name of an empty one goes.
    ///
    /// # Panics
    /// When no temporary file can be made.
    #[must_use]
    pub fn new(binary: impl Into<PathBuf>, more: &str) -> Self {
        let directory = tempfile::tempdir().expect("a temporary directory");
        match std::env::var("FEEDWAVE_TEST_STORE") {
            Ok(pattern) => Self::on(binary, &Database::new(&pattern, &unique(&directory)), more),
            Err(_) => {
                let uri = format!("sqlite://{}/feedwave.db", directory.path().display());
                Self::with(binary.into(), directory, &uri, None, more)
            }
        }
    }

    /// As [`Home::new`], for servers that share this database.
    ///
    /// # Panics
    /// When no temporary file can be made.
    #[must_use]
    pub fn on(binary: impl Into<PathBuf>, database: &Database, more: &str) -> Self {
        let directory = tempfile::tempdir().expect("a temporary directory");
        Self::with(binary.into(), directory, &database.uri, Some(database.clone()), more)
    }

    fn with(binary: PathBuf, directory: TempDir, uri: &str, database: Option<Database>, more: &str) -> Self {
        let mut config = String::from("[grpc]\nlisten = '127.0.0.1:0'\n[http]\nlisten = '127.0.0.1:0'\n");
        // A name of its own: what starts here again is the replica that was here before.
        writeln!(config, "[store]\nuri = '{uri}'\nreplica_name = '{}'\n{more}", unique(&directory))
            .expect("text grows");
        std::fs::write(directory.path().join("feedwave.toml"), config).expect("the configuration is written");
        Self { binary, directory, environment: Vec::new(), _database: database }
    }

    /// Sets what the service finds in its environment besides what the test finds in its own.
    pub fn set_environment(&mut self, environment: Vec<(String, String)>) {
        self.environment = environment;
    }

    /// Path of the directory.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.directory.path()
    }

    /// Starts the service and waits until it says that it is ready.
    ///
    /// # Panics
    /// When it does not start; with its log.
    pub async fn start(self) -> Server {
        let ready_file = self.path().join("ready.json");
        let _ = std::fs::remove_file(&ready_file);
        let log = self.path().join("log.txt");
        let log_file = File::options().create(true).append(true).open(&log).expect("the log is opened");
        let mut child = Command::new(&self.binary)
            .args(["serve", "--config"])
            .arg(self.path().join("feedwave.toml"))
            .arg("--ready-file")
            .arg(&ready_file)
            .envs(self.environment.iter().map(|(key, value)| (key, value)))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log_file)
            .kill_on_drop(true)
            .spawn()
            .expect("the service is started");
        let ready = async {
            loop {
                if let Ok(text) = std::fs::read_to_string(&ready_file) {
                    return text;
                }
                let ended = timeout(Duration::from_millis(5), child.wait()).await;
                // It may have been ready before.
                assert!(ended.is_err() || ready_file.is_file(), "the service ended: {ended:?}\n{}", read_log(&log));
            }
        };
        let ready = timeout(PATIENCE, ready).await.unwrap_or_else(|_| panic!("never ready:\n{}", read_log(&log)));
        let ready: serde_json::Value = serde_json::from_str(&ready).expect("the ready file is JSON");
        let address = |key: &str| -> SocketAddr {
            ready[key].as_str().and_then(|text| text.parse().ok()).unwrap_or_else(|| panic!("{key} in {ready}"))
        };
        let mtconnect = ready.get("mtconnect").map(|_| address("mtconnect"));
        Server { grpc: address("grpc"), http: address("http"), mtconnect, child, log, home: self }
    }
}

/// An empty database of a server, for replicas that share it.
///
/// # Panics
/// Where `FEEDWAVE_TEST_STORE` names no server.
#[must_use]
pub fn shared_store() -> Database {
    let pattern = std::env::var("FEEDWAVE_TEST_STORE").expect("FEEDWAVE_TEST_STORE: tests/postgres/run.sh sets it");
    assert!(pattern.starts_with("postgres://"), "{pattern}");
    Database::new(&pattern, &unique(&tempfile::tempdir().expect("a temporary directory")))
}

/// A name that no other directory has.
fn unique(directory: &TempDir) -> String {
    directory.path().file_name().map_or_else(String::new, |name| format!("test-{}", name.to_string_lossy()))
}

fn read_log(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_default()
}

/// A running service. Dropping it kills it.
pub struct Server {
    /// Address of the gRPC port.
    pub grpc: SocketAddr,
    /// Address of the HTTP port.
    pub http: SocketAddr,
    /// Address of the MTConnect agent, where there is one.
    pub mtconnect: Option<SocketAddr>,
    child: Child,
    log: PathBuf,
    home: Home,
}

impl Server {
    /// A service of this binary with an empty database and default limits.
    pub async fn start(binary: impl Into<PathBuf>) -> Self {
        Home::new(binary, "").start().await
    }

    /// Clients over one new connection.
    ///
    /// # Panics
    /// When the port cannot be reached.
    pub async fn connect(&self) -> Clients {
        Clients::connect(self.grpc).await
    }

    /// A plain HTTP/1.1 client for the HTTP port.
    #[must_use]
    pub fn web(&self) -> Web {
        Web::new(self.http)
    }

    /// Process id.
    ///
    /// # Panics
    /// When the process has ended.
    #[must_use]
    pub fn pid(&self) -> u32 {
        self.child.id().expect("the service is running")
    }

    /// What it runs on.
    #[must_use]
    pub const fn home(&self) -> &Home {
        &self.home
    }

    /// What it has logged so far.
    #[must_use]
    pub fn log(&self) -> String {
        read_log(&self.log)
    }

    /// Most memory that it was ever resident with, bytes, by the operating system's account.
    ///
    /// # Panics
    /// Where there is no such account.
    #[must_use]
    pub fn peak_resident_bytes(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.pid())).expect("the process is accounted");
        let kibibytes = status
            .lines()
            .find_map(|line| line.strip_prefix("VmHWM:"))
            .and_then(|rest| rest.trim().strip_suffix(" kB"))
            .and_then(|number| number.trim().parse::<u64>().ok());
        kibibytes.expect("VmHWM in kB") * 1024
    }

    /// Sends a signal.
    ///
    /// # Panics
    /// When the process has ended.
    pub fn signal(&self, signal: Signal) {
        let pid = i32::try_from(self.pid()).ok().and_then(Pid::from_raw).expect("a process id");
        kill_process(pid, signal).expect("the signal is delivered");
    }

    /// Kills it as a power cut would, and gives back what it leaves on the disk.
    ///
    /// # Panics
    /// When it does not end.
    pub async fn kill(mut self) -> Home {
        self.child.kill().await.expect("the service is killed");
        self.home
    }

    /// Waits until it ends by itself.
    ///
    /// # Panics
    /// When it does not end.
    pub async fn ended(mut self) -> (ExitStatus, Home) {
        let status = timeout(PATIENCE, self.child.wait()).await;
        let status = status.unwrap_or_else(|_| panic!("the service does not end:\n{}", read_log(&self.log)));
        (status.expect("the service is waited for"), self.home)
    }
}
