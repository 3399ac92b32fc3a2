//! `feedwave job`

use std::process::ExitCode;

use clap::{Subcommand, ValueEnum};
use feedwave_contract::json;
use feedwave_contract::proto::{
    CancelJobRequest, DeleteJobRequest, GetJobRequest, Job, JobState, ListJobsRequest, ProgramSummary,
};

use super::{Output, PAGE, card, deleted, full_name, refused, time, words};
use crate::commands::CliError;
use crate::commands::client::{Client, ServerArgs};
use crate::commands::terminal::{print, print_json};
use crate::commands::validate::Format;

const COLLECTION: &str = "jobs";

/// Arguments of `feedwave job`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Show jobs, newest first
    #[command(after_long_help = "Exit codes: 0 shown, 2 wrong usage or no answer.

Examples:
  feedwave job list --state ready --machine mill-3
  feedwave job list --format json | jq -r 'select(.state == \"JOB_STATE_FAILED\").name'
      One JSON object per line.")]
    List {
        /// Only jobs in this state; may be repeated
        #[arg(long, value_enum, value_name = "STATE")]
        state: Vec<State>,
        /// Only jobs for this machine, `machines/{machine}` or the part after the slash
        #[arg(long, value_name = "MACHINE")]
        machine: Option<String>,
        #[command(flatten)]
        output: Output,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Show a job
    #[command(after_long_help = "Exit codes: 0 shown, 2 wrong usage, no such job or no answer.")]
    Get {
        /// The job, `jobs/{job}` or the part after the slash
        #[arg(value_name = "JOB")]
        name: String,
        #[command(flatten)]
        output: Output,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Cancel a job; one that is cancelled stays so
    ///
    /// Validation and open streams end, and no new stream starts.
    #[command(
        after_long_help = "Exit codes: 0 cancelled, now or before, 2 wrong usage, no such job, one that has failed or \
was rejected, or no answer."
    )]
    Cancel {
        /// The job, `jobs/{job}` or the part after the slash
        #[arg(value_name = "JOB")]
        name: String,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Delete a job with its report; one that is not there is as good as deleted
    ///
    /// Its program and its events remain.
    #[command(after_long_help = "Exit codes: 0 deleted or not there, 2 wrong usage, another etag or no answer.")]
    Delete {
        /// The job, `jobs/{job}` or the part after the slash
        #[arg(value_name = "JOB")]
        name: String,
        /// Only if it has this etag still
        #[arg(long, value_name = "ETAG", default_value = "")]
        etag: String,
        #[command(flatten)]
        server: ServerArgs,
    },
}

/// State of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum State {
    /// Stored, waiting for validation
    Pending,
    /// Being validated
    Validating,
    /// Valid: setpoints can be streamed
    Ready,
    /// The program has errors
    Rejected,
    /// Cancelled by a client
    Cancelled,
    /// Validation could not be carried out
    Failed,
}

impl From<State> for JobState {
    fn from(state: State) -> Self {
        match state {
            State::Pending => Self::Pending,
            State::Validating => Self::Validating,
            State::Ready => Self::Ready,
            State::Rejected => Self::Rejected,
            State::Cancelled => Self::Cancelled,
            State::Failed => Self::Failed,
        }
    }
}

/// Does it.
///
/// # Errors
/// [`CliError`] when the service does not answer or refuses.
pub(in crate::commands) async fn run(args: Args) -> Result<ExitCode, CliError> {
    match args.command {
        Command::List { state, machine, output, server } => {
            let request = ListJobsRequest {
                page_size: PAGE,
                states: state.into_iter().map(|state| JobState::from(state).into()).collect(),
                machine: machine.map(|machine| full_name("machines", &machine)).unwrap_or_default(),
                ..ListJobsRequest::default()
            };
            list(&mut server.connect().await?, request, output.format).await?;
        }
        Command::Get { name, output, server } => {
            let mut client = server.connect().await?;
            let request = GetJobRequest { name: full_name(COLLECTION, &name) };
            let answer = client.jobs.get_job(request).await.map_err(|status| refused(&client, &status))?;
            let job = answer.into_inner().job.unwrap_or_default();
            match output.format {
                Format::Text => print(&text(&job))?,
                Format::Json => print_json(&job)?,
            }
        }
        Command::Cancel { name, server } => {
            let mut client = server.connect().await?;
            let name = full_name(COLLECTION, &name);
            let request = CancelJobRequest { name: name.clone() };
            client.jobs.cancel_job(request).await.map_err(|status| refused(&client, &status))?;
            print(&format!("{name}: cancelled\n"))?;
        }
        Command::Delete { name, etag, server } => {
            let mut client = server.connect().await?;
            let name = full_name(COLLECTION, &name);
            let request = DeleteJobRequest { name: name.clone(), etag };
            let answer = client.jobs.delete_job(request).await;
            return deleted(&client, &name, answer);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Shows jobs page by page: there may be any number of them.
async fn list(client: &mut Client, mut request: ListJobsRequest, format: Format) -> Result<(), CliError> {
    if format == Format::Text {
        print(&format!(
            "{:<41}  {:<10}  {:>6}  {:>8}  {:<20}  program\n",
            "job", "state", "errors", "warnings", "machine"
        ))?;
    }
    loop {
        let page =
            client.jobs.list_jobs(request.clone()).await.map_err(|status| refused(client, &status))?.into_inner();
        let lines = page.jobs.iter().map(|job| match format {
            Format::Text => line(job),
            Format::Json => format!("{}\n", json::to_string(job)),
        });
        print(&lines.collect::<String>())?;
        if page.next_page_token.is_empty() {
            return Ok(());
        }
        request.page_token = page.next_page_token;
    }
}

fn line(job: &Job) -> String {
    let count = |of: fn(&ProgramSummary) -> String| job.summary.as_ref().map_or("-".to_owned(), of);
    let line = format!(
        "{:<41}  {:<10}  {:>6}  {:>8}  {:<20}  {}",
        job.name,
        words(job.state().as_str_name(), "JOB_STATE_"),
        count(|summary| summary.errors.to_string()),
        count(|summary| summary.warnings.to_string()),
        job.machine,
        job.display_name
    );
    format!("{}\n", line.trim_end())
}

/// A job for people.
fn text(job: &Job) -> String {
    let of = |of: fn(&ProgramSummary) -> String| job.summary.as_ref().map_or_else(String::new, of);
    card(&[
        ("job", job.name.clone()),
        ("name", job.display_name.clone()),
        ("state", words(job.state().as_str_name(), "JOB_STATE_")),
        ("because", job.state_message.clone()),
        ("machine", job.machine.clone()),
        ("program", format!("{}, {} bytes", job.program, job.program_bytes)),
        ("findings", of(|summary| format!("{} errors, {} warnings", summary.errors, summary.warnings))),
        ("duration", of(|summary| format!("{:.3} s", summary.duration_s))),
        ("setpoints", of(|summary| summary.setpoint_count.to_string())),
        ("created", time(job.create_time.as_ref())),
        ("changed", time(job.update_time.as_ref())),
        ("etag", job.etag.clone()),
    ])
}
