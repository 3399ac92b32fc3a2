//! `feedwave token`: a new token for a client of the service, of which the service keeps the hash alone.

use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use feedwave_server::access::check_clients;
use sha2::{Digest as _, Sha256};

use super::CliError;

/// Random bytes of a token.
const TOKEN_BYTES: usize = 32;

/// What a client may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Role {
    /// Read what is kept but the audit log, stream setpoints, interpret, replay, compute from tools and runs
    Viewer,
    /// Besides: upload, validate and improve programs, create, cancel and delete jobs, plan threads, set how jobs are monitored
    Planner,
    /// Besides reading: run jobs, send telemetry, follow a spindle and acknowledge conditions, on its machines
    Machine,
    /// Everything, machines and tools included
    Admin,
}

impl Role {
    const fn name(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Planner => "planner",
            Self::Machine => "machine",
            Self::Admin => "admin",
        }
    }
}

/// Flags of `feedwave token`.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// What the client is called in logs and refusals
    name: String,
    /// What the client may do; may be given more than once
    #[arg(long = "role", value_name = "ROLE", value_enum, required = true)]
    roles: Vec<Role>,
    /// Machine on which the client may run jobs, such as machines/lathe, or * for any; may be given more than once
    #[arg(long = "machine", value_name = "MACHINE")]
    machines: Vec<String>,
    /// Tenant that the client belongs to, or * where it acts for any; without it the default tenant
    #[arg(long, value_name = "TENANT")]
    tenant: Option<String>,
    /// When the token ends, such as 2027-01-01T00:00:00Z; without it never
    #[arg(long, value_name = "TIME")]
    expires: Option<String>,
    /// File of known clients (auth.clients) to add the client to; without it the entry is shown on standard error
    #[arg(long, value_name = "FILE")]
    clients: Option<PathBuf>,
}

/// Makes a token, and writes it to standard output.
///
/// # Errors
/// [`CliError`] where there is no randomness to be had, or a file cannot be written or could not be used with the entry.
pub fn run(args: &Args) -> Result<ExitCode, CliError> {
    let mut random = [0; TOKEN_BYTES];
    getrandom::fill(&mut random).map_err(CliError::trouble)?;
    let token = format!("feedwave_{}", hex(&random));
    let entry = entry(args, &hex(&Sha256::digest(&token)));
    match &args.clients {
        Some(path) => {
            let failed = |error: std::io::Error| CliError::file(path, &error);
            // A file that cannot be used would keep its other changes from the service, and the service from starting.
            if std::fs::metadata(path).is_ok_and(|found| !found.is_file()) {
                return Err(CliError::trouble(format!("{}: is no file", path.display())));
            }
            let text = match std::fs::read_to_string(path) {
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
                text => text.map_err(failed)?,
            };
            check_clients(&(text + &entry), path).map_err(CliError::trouble)?;
            let mut file = File::options().create(true).append(true).open(path).map_err(failed)?;
            // Nobody is to be known by a token that nobody has seen.
            tell(&token)?;
            file.write_all(entry.as_bytes()).map_err(failed)?;
        }
        None => {
            std::io::stderr()
                .write_all(entry.as_bytes())
                .map_err(|error| CliError::written("standard error", &error))?;
            tell(&token)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn tell(token: &str) -> Result<(), CliError> {
    let mut out = std::io::stdout();
    let told = writeln!(out, "{token}").and_then(|()| out.flush());
    told.map_err(|error| CliError::written("standard output", &error))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The entry of the file of known clients.
fn entry(args: &Args, token_sha256: &str) -> String {
    // A string of JSON is one of TOML.
    let text = |text: &str| serde_json::Value::from(text).to_string();
    let list = |items: Vec<String>| format!("[{}]", items.join(", "));
    let roles = list(args.roles.iter().map(|role| text(role.name())).collect());
    let mut entry = format!("\n[[client]]\nname = {}\ntoken_sha256 = {}\n", text(&args.name), text(token_sha256));
    // Text grows.
    let _ = writeln!(entry, "roles = {roles}");
    if !args.machines.is_empty() {
        let _ = writeln!(entry, "machines = {}", list(args.machines.iter().map(|machine| text(machine)).collect()));
    }
    if let Some(tenant) = &args.tenant {
        let _ = writeln!(entry, "tenant = {}", text(tenant));
    }
    if let Some(expires) = &args.expires {
        let _ = writeln!(entry, "expires = {}", text(expires));
    }
    entry
}
