//! `feedwave serve`: the service until a signal ends it.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use feedwave_server::config::{EXIT_CONFIG, Overrides, StoreUri};
use feedwave_server::lifecycle::{RunningServer, Server, StartError};
use feedwave_server::observability::{self, REVISION, VERSION};
use tokio::signal::unix::{SignalKind, signal};

use crate::args::GlobalArgs;
use crate::commands::{CliError, make_files_private};
use crate::output::OutputFile;

/// The signal of a write beyond a limit of file sizes, on every system that has it.
const SIGXFSZ: i32 = 25;

/// Flags of `feedwave serve`; each sets the configuration key that it names.
#[derive(Clone, Debug, clap::Args)]
#[command(
    after_long_help = "Exit codes: 0 ended by SIGTERM or SIGINT, 1 it could not be started, or failed, 2 wrong usage, 78 the configuration
cannot be used.

Examples:
  feedwave serve
      Everything by default: ports of this machine alone, jobs in feedwave.db of the working directory.
  feedwave serve --config feedwave.toml --ready-file /run/feedwave/ready.json"
)]
pub struct Args {
    /// Address and port of gRPC; port 0 takes a free one [key: grpc.listen]
    #[arg(long, value_name = "ADDRESS")]
    grpc_listen: Option<SocketAddr>,
    /// Address and port of HTTP: dashboards, Prometheus, probes and the page [key: http.listen]
    #[arg(long, value_name = "ADDRESS")]
    http_listen: Option<SocketAddr>,
    #[arg(long, value_name = "URI", help = format!("Where jobs, programs and reports are kept, such as {}; without it in \
        the file feedwave.db of the working directory [key: store.uri]", StoreUri::EXAMPLE))]
    store: Option<String>,
    /// Name of this replica among those that share a store; in its log and in what it leases [key: store.replica_name]
    #[arg(long, value_name = "NAME")]
    replica_name: Option<String>,
    /// What named a file before `--store` did [key: database.path]
    #[arg(long, value_name = "FILE", hide = true)]
    database: Option<PathBuf>,
    /// Write the addresses as JSON to this file once the service can be used; one that is there is removed before, and this one at
    /// the end
    #[arg(long, value_name = "FILE")]
    ready_file: Option<PathBuf>,
}

/// Serves until SIGTERM or SIGINT.
///
/// # Errors
/// [`CliError`] when the service cannot be started, or fails.
pub async fn run(args: Args, global: &GlobalArgs) -> Result<ExitCode, CliError> {
    let flags = Overrides::default()
        .set("grpc.listen", args.grpc_listen.map(|address| address.to_string()))
        .set("http.listen", args.http_listen.map(|address| address.to_string()))
        .set("store.uri", args.store)
        .set("store.replica_name", args.replica_name)
        .set("database.path", args.database.map(|path| path.display().to_string()));
    let config = global.load(flags)?;
    make_files_private();
    let log = observability::init(&config).map_err(CliError::new)?;
    tracing::info!(version = VERSION, revision = REVISION, "feedwave");

    // Taken over before the ports open: as process 1 of a container nothing else handles them.
    let mut terminate = signal(SignalKind::terminate()).map_err(CliError::new)?;
    let mut interrupt = signal(SignalKind::interrupt()).map_err(CliError::new)?;
    let mut hangup = signal(SignalKind::hangup()).map_err(CliError::new)?;
    // Without a handler a write beyond a limit of file sizes ends the process; with one it fails, and is told.
    let _file_size = signal(SignalKind::from_raw(SIGXFSZ)).map_err(CliError::new)?;
    let of_ready_file =
        |path: &Path, error: std::io::Error| CliError::new(format!("--ready-file: {}: {error}", path.display()));
    if let Some(path) = &args.ready_file {
        remove_ready_file(path).map_err(|error| of_ready_file(path, error))?;
    }
    let mut server = tokio::select! {
        started = told(Server::start(config)) => started.map_err(not_started)?,
        _ = terminate.recv() => return Ok(ended_while_starting()),
        _ = interrupt.recv() => return Ok(ended_while_starting()),
    };
    let mtconnect = server.mtconnect_addr().map(tracing::field::display);
    tracing::info!(grpc = %server.grpc_addr(), http = %server.http_addr(), mtconnect, "ready");
    if let Some(path) = &args.ready_file {
        write_ready_file(path, &server).map_err(|error| of_ready_file(path, error))?;
    }

    let failure = loop {
        tokio::select! {
            _ = terminate.recv() => break None,
            _ = interrupt.recv() => break None,
            _ = hangup.recv() => server.reload(),
            failure = server.failed() => break Some(failure),
        }
    };
    tracing::info!("shutting down");
    if let Some(Err(error)) = args.ready_file.as_deref().map(remove_ready_file) {
        tracing::warn!(%error, "the ready file could not be removed");
    }
    server.shutdown().await;
    tracing::info!("ended");
    // The exporter blocks while it sends the rest.
    let _ = tokio::task::spawn_blocking(move || log.shutdown()).await;
    failure.map_or(Ok(ExitCode::SUCCESS), |failure| Err(CliError::new(failure)))
}

/// After how long it is told that a start takes long, and how often again.
const LONG_START: Duration = Duration::from_secs(5);

/// A start, of which is told what it waits for while it takes long.
async fn told<T>(start: impl Future<Output = T>) -> T {
    let mut start = std::pin::pin!(start);
    let begun = Instant::now();
    loop {
        match tokio::time::timeout(LONG_START, &mut start).await {
            Ok(started) => return started,
            Err(_) => {
                let seconds = begun.elapsed().as_secs();
                tracing::warn!(seconds, "still starting: waiting for the store; SIGTERM ends it");
            }
        }
    }
}

fn ended_while_starting() -> ExitCode {
    tracing::info!("ended while it was starting");
    ExitCode::SUCCESS
}

/// Certificates, keys and known clients are files of the configuration.
fn not_started(error: StartError) -> CliError {
    let failed = CliError::new(&error);
    if matches!(error, StartError::Tls { .. }) { CliError { exit_code: EXIT_CONFIG, ..failed } } else { failed }
}

/// One of an earlier service would say that this one is ready. What is no plain file is not ours.
fn remove_ready_file(path: &Path) -> std::io::Result<()> {
    match std::fs::symlink_metadata(path) {
        Ok(metadata) if metadata.is_file() => std::fs::remove_file(path),
        _ => Ok(()),
    }
}

fn write_ready_file(path: &Path, server: &RunningServer) -> std::io::Result<()> {
    let mut addresses = serde_json::json!({
        "grpc": server.grpc_addr().to_string(),
        "http": server.http_addr().to_string(),
    });
    if let Some(address) = server.mtconnect_addr() {
        addresses["mtconnect"] = address.to_string().into();
    }
    OutputFile::write_whole(path, format!("{addresses}\n").as_bytes())
}
