//! `feedwave job`

use std::process::ExitCode;

use clap::{Subcommand, ValueEnum};
use feedwave_contract::json;
use feedwave_contract::proto::{
    CancelJobRequest, DeleteJobRequest, GetJobRequest, Job, JobState, ListJobsRequest, ProgramSummary,
};
use tonic::Status;

use super::collection::{self, Collection, DeleteArgs, GetArgs, ListArgs, PAGE, Page};
use super::{card, full_name, refused, time, words};
use crate::commands::CliError;
use crate::commands::client::{Client, ServerArgs};
use crate::commands::terminal::print;

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
        list: ListArgs,
    },
    /// Show a job
    #[command(after_long_help = "Exit codes: 0 shown, 2 wrong usage, no such job or no answer.")]
    Get(GetArgs),
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
    Delete(DeleteArgs),
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
        Command::List { state, machine, list } => {
            let filter = ListJobsRequest {
                page_size: PAGE,
                states: state.into_iter().map(|state| JobState::from(state).into()).collect(),
                machine: machine.map(|machine| full_name("machines", &machine)).unwrap_or_default(),
                ..ListJobsRequest::default()
            };
            collection::list(Jobs { filter }, list).await
        }
        Command::Get(args) => collection::get(Jobs::default(), args).await,
        Command::Cancel { name, server } => {
            let mut client = server.connect().await?;
            let name = full_name(Jobs::NAME, &name);
            let request = CancelJobRequest { name: name.clone() };
            client.jobs.cancel_job(request).await.map_err(|status| refused(&client, &status))?;
            print(&format!("{name}: cancelled\n"))?;
            Ok(ExitCode::SUCCESS)
        }
        Command::Delete(args) => collection::delete(Jobs::default(), args).await,
    }
}

/// The jobs of a service, newest first.
#[derive(Default)]
struct Jobs {
    /// Which of them are listed.
    filter: ListJobsRequest,
}

impl Collection for Jobs {
    const NAME: &'static str = "jobs";
    type Resource = Job;

    async fn get(&self, client: &Client, name: String) -> Result<Job, Status> {
        let answer = client.jobs.clone().get_job(GetJobRequest { name }).await?;
        Ok(answer.into_inner().job.unwrap_or_default())
    }

    async fn page(&self, client: &Client, page_token: String) -> Result<Page<Job>, Status> {
        let request = ListJobsRequest { page_token, ..self.filter.clone() };
        let page = client.jobs.clone().list_jobs(request).await?.into_inner();
        Ok(Page { resources: page.jobs, next: page.next_page_token, unreachable: page.unreachable })
    }

    async fn delete(&self, client: &Client, name: String, etag: String) -> Result<(), Status> {
        client.jobs.clone().delete_job(DeleteJobRequest { name, etag }).await.map(drop)
    }

    fn card(job: &Job) -> String {
        text(job)
    }

    fn head() -> String {
        format!("{:<41}  {:<10}  {:>6}  {:>8}  {:<20}  program", "job", "state", "errors", "warnings", "machine")
    }

    fn line(job: &Job) -> String {
        let count = |of: fn(&ProgramSummary) -> String| job.summary.as_ref().map_or("-".to_owned(), of);
        format!(
            "{:<41}  {:<10}  {:>6}  {:>8}  {:<20}  {}",
            job.name,
            words(job.state().as_str_name(), "JOB_STATE_"),
            count(|summary| summary.errors.to_string()),
            count(|summary| summary.warnings.to_string()),
            job.machine,
            job.display_name
        )
    }

    /// One job a line: there may be too many for one answer.
    async fn print_json(&self, client: &Client) -> Result<(), CliError> {
        let line = |job: &Job| format!("{}\n", json::to_string(job));
        collection::each_page(self, client, |page| print(&page.iter().map(line).collect::<String>())).await
    }
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
