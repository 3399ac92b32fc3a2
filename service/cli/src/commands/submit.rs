//! `feedwave submit`: a program becomes a job, and its report.

use std::path::PathBuf;
use std::process::ExitCode;

use feedwave_contract::convert::oscillation_request_to_proto;
use feedwave_contract::proto::create_job_request::Source as ProgramSource;
use feedwave_contract::proto::program_file::Source as FileSource;
use feedwave_contract::proto::{CreateJobRequest, Job, JobState, ProgramFile};
use feedwave_cutting::tool_oscillation::OscillationRequest;

use super::called::keep_called;
use super::client::{Client, ServerArgs};
use super::machine::{Envelope, Mode};
use super::offsets::OffsetArgs;
use super::resources::full_name;
use super::source::{IncludeArgs, Source};
use super::terminal::{Style, print, print_json, tell};
use super::tool_oscillation::OscillationArgs;
use super::validate::Format;
use super::{CliError, EXIT_REFUSED, report};

/// Programs up to this size travel with the request, larger ones are uploaded. Well below what services permit.
const INLINE_BYTES: u64 = 512 * 1024;

/// Arguments of `feedwave submit`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 stored (with --wait: accepted), 1 rejected, 2 wrong usage or no answer.

Examples:
  feedwave submit shaft.nc --wait
      To the service on this machine; prints the job's name and the report.
  job=$(feedwave submit shaft.nc --server https://plan.example:50051 --ca ca.pem)
      Prints only the job's name, for `feedwave stream \"$job\"`.
  feedwave submit shaft.nc --request-id order-4711
      Sending it again returns the same job instead of making another one.")]
pub struct Args {
    /// The program; `-` reads standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    include: IncludeArgs,
    #[command(flatten)]
    server: ServerArgs,
    /// Machine of the service to plan for, `machines/{machine}` or the part after the slash
    #[arg(long, value_name = "MACHINE", default_value = "lathe")]
    machine: String,
    /// Makes a repeated request harmless: the same id returns the same job
    #[arg(long, value_name = "ID", default_value = "")]
    request_id: String,
    /// Name for people [default: the file's]
    #[arg(long, value_name = "NAME")]
    display_name: Option<String>,
    /// Interpolation period, µs [default: the service's]
    #[arg(long, value_name = "MICROSECONDS", default_value_t = 0, hide_default_value = true)]
    period_us: u32,
    /// How vibration along the path is generated [default: what the machine's profile says]
    #[arg(long, value_enum, value_name = "MODE")]
    mode: Option<Mode>,
    /// How vibration along the path begins and ends [default: what the machine's profile says]
    #[arg(long, value_enum, value_name = "FORM")]
    envelope: Option<Envelope>,
    /// Tool of the service that the program may use, `tools/{tool}` or the part after the slash; may be repeated [default: any]
    #[arg(long = "tool", value_name = "TOOL")]
    tools: Vec<String>,
    #[command(flatten)]
    offsets: OffsetArgs,
    #[command(flatten)]
    oscillation: OscillationArgs,
    /// Wait for validation and show what was found
    #[arg(long)]
    wait: bool,
    /// Form of the report, with --wait
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text, requires = "wait")]
    format: Format,
}

/// Sends it.
///
/// # Errors
/// [`CliError`] when the program cannot be read or the service does not do what is asked.
pub(super) async fn run(args: Args) -> Result<ExitCode, CliError> {
    let mut source = args.include.open(&args.file)?;
    let mut client = args.server.connect().await?;
    let job = create(&args, &mut client, &mut source).await?;
    if !args.wait {
        print(&format!("{}\n", job.name))?;
        return Ok(ExitCode::SUCCESS);
    }
    let job = client.validated(&job.name).await?;
    match job.state() {
        JobState::Ready | JobState::Rejected => {}
        state => {
            let state = state.as_str_name().trim_start_matches("JOB_STATE_").to_lowercase();
            let why = if job.state_message.is_empty() { String::new() } else { format!(": {}", job.state_message) };
            return Err(CliError::trouble(format!("{} is {state}{why}", job.name)));
        }
    }
    let found = client.report(&job.name).await?;
    match args.format {
        Format::Json => print_json(&found)?,
        Format::Text => {
            print(&report::text(&found, &mut source, Style::stdout())?)?;
            print(&format!("{}\n", job.name))?;
        }
    }
    let refused = job.state() == JobState::Rejected;
    Ok(if refused { ExitCode::from(EXIT_REFUSED) } else { ExitCode::SUCCESS })
}

async fn create(args: &Args, client: &mut Client, source: &mut Source) -> Result<Job, CliError> {
    let file_name = args.file.file_name().map(|name| name.to_string_lossy().into_owned());
    let mut inline_bytes = source.size;
    let program = if inline_bytes <= INLINE_BYTES {
        ProgramSource::InlineProgram(source.whole()?.into())
    } else {
        inline_bytes = 0;
        ProgramSource::Program(client.upload(source, file_name.as_deref().unwrap_or_default()).await?)
    };
    let mut programs = Vec::new();
    keep_called(source)?;
    for place in 0..source.further_count() {
        let (name, file) = source.further_file(place)?;
        let content = if inline_bytes + file.size <= INLINE_BYTES {
            inline_bytes += file.size;
            FileSource::InlineProgram(file.whole()?.into())
        } else {
            FileSource::Program(client.upload(file, &name).await?)
        };
        programs.push(ProgramFile { name, source: Some(content) });
    }
    let oscillation = args.oscillation.request();
    let request = CreateJobRequest {
        request_id: args.request_id.clone(),
        machine: full_name("machines", &args.machine),
        source: Some(program),
        display_name: args.display_name.clone().or_else(|| file_name.clone()).unwrap_or_default(),
        file_name: file_name.unwrap_or_default(),
        interpolation_period_us: args.period_us,
        generation_mode: Mode::value(args.mode),
        vibration_envelope: Envelope::value(args.envelope),
        tools: args.tools.iter().map(|tool| full_name("tools", tool)).collect(),
        offsets: args.offsets.read()?,
        oscillation: (oscillation != OscillationRequest::default()).then(|| oscillation_request_to_proto(&oscillation)),
        programs,
    };
    let response = client.jobs.create_job(request).await.map_err(|status| client.failed(&status))?;
    let job = response.into_inner().job;
    let job = job.ok_or_else(|| CliError::trouble(format!("{}: answered without a job", client.url)))?;
    if args.wait {
        tell(&format!("{} is stored, waiting for validation\n", job.name));
    }
    Ok(job)
}
