//! `feedwave check`, `feedwave backup` and `feedwave restore`: the database of a service, without the service.

use std::path::PathBuf;
use std::process::ExitCode;

use feedwave_contract::proto::{CheckedRecords, StoreCheck, StoreProblem};
use feedwave_server::config::{Overrides, StoreUri};
use feedwave_store::{CheckReport, CopyError, CopyReport, StoreError};

use super::terminal::{print, print_json};
use super::validate::Format;
use super::{CliError, EXIT_REFUSED, make_files_private};
use crate::args::GlobalArgs;

/// Which database.
#[derive(Clone, Debug, clap::Args)]
pub struct StoreArgs {
    /// Where it is kept, as for `serve` [key: store.uri]
    #[arg(long, value_name = "URI")]
    store: Option<String>,
}

impl StoreArgs {
    fn uri(&self, global: &GlobalArgs) -> Result<StoreUri, CliError> {
        let config = global.load(Overrides::default().set("store.uri", self.store.clone()))?;
        config.store_uri().map_err(|(key, reason)| CliError::trouble(format!("{key}: {reason}")))
    }
}

/// Arguments of `feedwave check`.
#[derive(Clone, Debug, clap::Args)]
#[command(
    after_long_help = "Exit codes: 0 everything is as it was written, 1 something is not, 2 it cannot be read, 78 its URI is none."
)]
pub struct CheckArgs {
    #[command(flatten)]
    store: StoreArgs,
    /// Form of the output
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    format: Format,
}

/// Arguments of `feedwave backup`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 written, 2 the file is there already, or cannot be written.

Example, every night, from a service that runs on:
  feedwave backup --store sqlite:///var/lib/feedwave/feedwave.db /backup/feedwave-$(date +%F).db")]
pub struct BackupArgs {
    /// File to make
    #[arg(value_name = "TO")]
    to: PathBuf,
    #[command(flatten)]
    store: StoreArgs,
}

/// Arguments of `feedwave restore`.
#[derive(Clone, Debug, clap::Args)]
#[command(
    after_long_help = "Exit codes: 0 restored, 1 the copy is damaged, 2 a service runs, the copy is of a newer version, or a \
file cannot be used. But for 0 the database is what it was."
)]
pub struct RestoreArgs {
    /// A copy that `backup` made
    #[arg(value_name = "FROM")]
    from: PathBuf,
    #[command(flatten)]
    store: StoreArgs,
    /// Restore it even if records in it are damaged; `feedwave check` says what would be lost
    #[arg(long)]
    accept_damage: bool,
}

/// Arguments of `feedwave migrate`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 up to date, 2 it cannot be brought there, 78 its URI is none.")]
pub struct MigrateArgs {
    #[command(flatten)]
    store: StoreArgs,
}

/// Arguments of `feedwave copy`.
#[derive(Clone, Debug, clap::Args)]
#[command(
    after_long_help = "Exit codes: 0 copied, 1 the file is damaged, 2 it cannot be copied. But for 0 nothing was written.

Example:
  feedwave copy sqlite:///var/lib/feedwave/feedwave.db postgres://feedwave@db.plant.example/feedwave"
)]
pub struct CopyArgs {
    /// Store to copy, in a file
    #[arg(value_name = "FROM-URI")]
    from: String,
    /// Store to copy to, an empty database of a server
    #[arg(value_name = "TO-URI")]
    to: String,
}

/// Brings a schema up to date.
///
/// # Errors
/// [`CliError`] when it cannot be.
pub async fn migrate(args: MigrateArgs, global: &GlobalArgs) -> Result<ExitCode, CliError> {
    let uri = args.store.uri(global)?;
    feedwave_store::migrate(&uri).await.map_err(|error| failed(&uri, &error))?;
    print(&format!("{uri}: up to date\n"))?;
    Ok(ExitCode::SUCCESS)
}

/// Copies a store to another kind of database.
///
/// # Errors
/// [`CliError`] when it cannot be copied.
pub async fn copy(args: CopyArgs) -> Result<ExitCode, CliError> {
    let uri = |name: &str, text: &str| {
        text.parse::<StoreUri>().map_err(|error| CliError::trouble(format!("{name}: {error}")))
    };
    let (from, to) = (uri("FROM-URI", &args.from)?, uri("TO-URI", &args.to)?);
    make_files_private();
    let tables = feedwave_store::copy(&from, &to).await.map_err(|error| match error {
        CopyError::From(error @ StoreError::Damaged { .. }) => {
            CliError { message: format!("{from}: {error}; feedwave check says what is lost"), exit_code: EXIT_REFUSED }
        }
        CopyError::From(error) => failed(&from, &error),
        CopyError::To(error) => failed(&to, &error),
    })?;
    let mut text = String::new();
    for table in &tables {
        let hash: String = table.sha256.iter().map(|byte| format!("{byte:02x}")).collect();
        text += &format!("{:20} {:>10} row(s)  {hash}\n", table.table, table.rows);
    }
    print(&format!("{text}{to}: holds what {from} holds\n"))?;
    Ok(ExitCode::SUCCESS)
}

/// Verifies a database.
///
/// # Errors
/// [`CliError`] when it cannot be read.
pub async fn check(args: CheckArgs, global: &GlobalArgs) -> Result<ExitCode, CliError> {
    let uri = args.store.uri(global)?;
    let report =
        feedwave_store::check_with(&uri, feedwave_server::read_decision).await.map_err(|error| failed(&uri, &error))?;
    match args.format {
        Format::Json => print_json(&check_message(&report))?,
        _ => print(&text(&uri, &report))?,
    }
    Ok(if report.is_intact() { ExitCode::SUCCESS } else { ExitCode::from(EXIT_REFUSED) })
}

/// Copies a database.
///
/// # Errors
/// [`CliError`] when it cannot be copied.
pub async fn backup(args: BackupArgs, global: &GlobalArgs) -> Result<ExitCode, CliError> {
    let uri = args.store.uri(global)?;
    make_files_private();
    let report = feedwave_store::backup(&uri, &args.to).await.map_err(|error| match error {
        // It is about the copy: the database is as it should be.
        StoreError::CannotCopy { .. } => failed(args.to.display(), &error),
        error => failed(&uri, &error),
    })?;
    print(&format!("{}: written: {}\n", args.to.display(), of(&report)))?;
    Ok(ExitCode::SUCCESS)
}

/// Puts a copy in the place of a database.
///
/// # Errors
/// [`CliError`] when it cannot be restored.
pub async fn restore(args: RestoreArgs, global: &GlobalArgs) -> Result<ExitCode, CliError> {
    let uri = args.store.uri(global)?;
    make_files_private();
    let report = feedwave_store::restore(&uri, &args.from, args.accept_damage).await.map_err(|error| match error {
        CopyError::From(error @ StoreError::Damaged { .. }) => CliError {
            message: format!("{}: {error}; --accept-damage restores it all the same", args.from.display()),
            exit_code: EXIT_REFUSED,
        },
        CopyError::From(error) => failed(args.from.display(), &error),
        CopyError::To(error) => failed(&uri, &error),
    })?;
    print(&format!("{uri}: restored from {}: {}\n", args.from.display(), of(&report)))?;
    Ok(ExitCode::SUCCESS)
}

fn failed(place: impl std::fmt::Display, error: &StoreError) -> CliError {
    let cause = std::error::Error::source(error).map_or_else(String::new, |cause| format!(": {cause}"));
    CliError::trouble(format!("{place}: {error}{cause}"))
}

fn of(report: &CopyReport) -> String {
    let CopyReport { bytes, jobs, programs, programs_in_objects, newest_event } = report;
    let text = format!("{bytes} bytes, {jobs} job(s), {programs} program(s), newest event {newest_event}");
    if *programs_in_objects == 0 {
        return text;
    }
    format!(
        "{text}\n{programs_in_objects} program(s) are in an object store and not in the copy: keep the objects as long as it"
    )
}

fn text(uri: &StoreUri, report: &CheckReport) -> String {
    let mut text = String::new();
    for problem in &report.problems {
        text += &format!("{} {}: {}\n  lost: {}\n", problem.kind, problem.id, problem.reason, problem.lost);
    }
    if report.further_problems > 0 {
        text += &format!("and {} further problem(s)\n", report.further_problems);
    }
    let checked: Vec<String> = report.checked.iter().map(|(kind, count)| format!("{count} {kind}(s)")).collect();
    let verdict = if report.is_intact() { "intact" } else { "damaged" };
    text + &format!("{uri}: {verdict}; checked: {}\n", checked.join(", "))
}

fn check_message(report: &CheckReport) -> StoreCheck {
    let checked = report.checked.iter().map(|(kind, count)| CheckedRecords { kind: (*kind).to_owned(), count: *count });
    let problems = report.problems.iter().map(|problem| StoreProblem {
        kind: problem.kind.to_owned(),
        id: problem.id.clone(),
        reason: problem.reason.clone(),
        lost: problem.lost.to_owned(),
    });
    StoreCheck {
        intact: report.is_intact(),
        checked: checked.collect(),
        problems: problems.collect(),
        problems_not_listed: report.further_problems,
    }
}
