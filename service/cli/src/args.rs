//! The command line: one binary, a subcommand for each thing it does.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use feedwave_server::config::{Config, ConfigError, Overrides};

use crate::commands::{self, CliError, database, healthcheck, serve};

/// Machining programs in, validated and interpolated setpoints out.
#[derive(Debug, Parser)]
#[command(name = "feedwave", version, propagate_version = true, max_term_width = 110)]
#[command(after_help = "Configuration comes from defaults, then --config FILE, then the environment \
(FEEDWAVE_<SECTION>__<KEY>, for example FEEDWAVE_GRPC__LISTEN=0.0.0.0:50051), then flags; later ones win.")]
pub struct Cli {
    /// Options of every subcommand.
    #[command(flatten)]
    pub global: GlobalArgs,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// Options of every subcommand.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Service")]
pub struct GlobalArgs {
    /// Configuration file, TOML
    #[arg(long, global = true, value_name = "FILE", env = "FEEDWAVE_CONFIG")]
    pub config: Option<PathBuf>,
    /// Log level, or directives such as `info,feedwave=debug` [key: log.level]
    #[arg(long, global = true, value_name = "LEVEL")]
    pub log_level: Option<String>,
    /// Form of log lines, `text` or `json` [key: log.format]
    #[arg(long, global = true, value_name = "FORMAT")]
    pub log_format: Option<String>,
}

impl GlobalArgs {
    /// The configuration, with these options and further ones on top.
    ///
    /// # Errors
    /// [`ConfigError`] with every problem found.
    pub fn load(&self, flags: Overrides) -> Result<Config, ConfigError> {
        let flags = flags.set("log.level", self.log_level.as_deref()).set("log.format", self.log_format.as_deref());
        Config::load(self.config.as_deref(), &flags)
    }
}

/// What the binary does.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run the service
    Serve(serve::Args),
    /// The subcommands for people at a terminal.
    #[command(flatten)]
    Tool(Box<commands::Command>),
    /// Ask a running service over gRPC whether it serves; exit code 0 if so, 1 if not
    Healthcheck(healthcheck::Args),
    /// Verify a database: hashes, references, reports, logs; says what is lost
    ///
    /// The service may run meanwhile. Every byte is read; what can be made again is told apart from what cannot.
    Check(database::CheckArgs),
    /// Copy a database as it is at one moment into a new file; the service may run meanwhile
    ///
    /// The file appears once it is complete, verified and on the disk.
    Backup(database::BackupArgs),
    /// Put a copy in the place of a database that no service uses
    ///
    /// The copy is verified first; whenever it is interrupted, either the earlier database or the copy is there. The earlier
    /// one is kept beside it, with `.replaced` behind its name.
    Restore(database::RestoreArgs),
    /// Bring the schema of a store up to date, without a service
    ///
    /// A service does the same as it starts. Of a server's database it is done by one replica after another, so it may be done
    /// while others run.
    Migrate(database::MigrateArgs),
    /// Copy a store in a file into an empty database of a server
    ///
    /// All of it or nothing; each table is compared by its hash with what was read. No service may use the file meanwhile,
    /// and it stays as it is.
    Copy(database::CopyArgs),
}

impl Command {
    /// Does it.
    ///
    /// # Errors
    /// [`CliError`] with what to tell the user and the exit code.
    pub async fn run(self, global: &GlobalArgs) -> Result<ExitCode, CliError> {
        match self {
            Self::Serve(args) => serve::run(args, global).await,
            Self::Tool(command) => command.run().await,
            Self::Healthcheck(args) => healthcheck::run(args, global).await,
            Self::Check(args) => database::check(args, global).await,
            Self::Backup(args) => database::backup(args, global).await,
            Self::Restore(args) => database::restore(args, global).await,
            Self::Migrate(args) => database::migrate(args, global).await,
            Self::Copy(args) => database::copy(args).await,
        }
    }
}
